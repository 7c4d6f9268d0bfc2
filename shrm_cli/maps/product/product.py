"""BRDF product textures: any BRDF, also an anisotropic one, under light of low frequency.

The texture holds, for directions of the view in the frame of the surface, the harmonics of the BRDF
times the cosine. The light is a short vector of coefficients. A point turns the light into its own
frame, looks the view up, and multiplies both: the light and the view may change in every frame, and
the surface may have any tangents.

References
----------
Kautz, Sloan and Snyder 2002, "Fast, Arbitrary BRDF Shading for Low-Frequency Lighting Using
Spherical Harmonics", sections 3 and 4.
"""

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.maps.base import Map
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.light_map import FixedMap
from shrm_cli.records import record
from shrm_cli.sphere.directions import horizontal_tangents, surface_frames
from shrm_cli.sphere.harmonics import order_of
from shrm_cli.sphere.parabolic import ParabolicSampler
from shrm_cli.sphere.rotation import rotate_into_frames
from shrm_cli.vocabulary import Center, Frame, Sampling

_POINTS_AT_ONCE = 2**14
"""Points that are shaded at a time."""


class ProductMap(FixedMap):
    """A map that holds a BRDF over the view, and maybe the light that it is under."""

    representation = "product"
    format_version = 5
    is_rearrangeable = False
    against_negatives = "take `window` auto"
    frame: ClassVar[Frame] = "local"
    center: ClassVar[Center] = "normal"
    sampling: ClassVar[Sampling] = "center"

    if TYPE_CHECKING:

        @property
        def order(self) -> int: ...
        @property
        def lighting(self) -> Array | None: ...
        @property
        def channels(self) -> int: ...

    @property
    def needs_light(self) -> bool:  # type: ignore[override]
        """Whether the map holds no light."""
        return self.lighting is None

    def check_mixing(self) -> None:
        """Check that the light of the map can be had in other primaries.

        Raises
        ------
        MapError
            If it holds no light, or its BRDF has colors, which multiply channel by channel.
        """
        if self.lighting is None:
            raise MapError(f"{self.what} that holds no light has no primaries")
        if self.channels > 1:
            raise MapError(
                f"{self.what} of a colored BRDF is a table of each channel's own, which cannot be "
                "mixed; prefilter its probe with `working`"
            )

    def summary(self) -> dict[str, Any]:
        """Return what users and scripts are told about the map."""
        info = self.info
        return {
            "representation": self.representation,
            "frame": self.frame,
            "center": self.center,
            "size": self.size,
            "order": self.order,
            "coefficients": (self.order + 1) ** 2,
            "channels": self.channels,
            "lit": self.lighting is not None,
            "brdf_energy_captured": info.captured,
            "predicted_error": info.predicted_error,
            "added_error": info.added_error,
            "filter_error": info.filter_error,
            "storage_error": info.storage_error,
        }

    def details(self) -> dict[str, Any]:
        """Return the light's coefficients, where the map holds them."""
        if self.lighting is None:
            return {}
        return {"lighting_coefficients": self.lighting.tolist()}

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the radiance that a surface reflects which is brushed around +Y.

        The tangents are those of `sphere.directions.horizontal_tangents`; isotropic BRDFs do not
        care. Parameters and result are those of `Map.radiance`.

        Raises
        ------
        MapError
            If the map holds no light.
        """
        return self.brushed_radiance(
            normals, horizontal_tangents(np.asarray(normals, float)), views
        )


@record(eq=False)
class ProductTexture(ProductMap):
    """The product functions of a BRDF over the view, and maybe the light that it is under.

    Attributes
    ----------
    table : ndarray, shape (N, N, (order+1)^2, channels)
        ``c_i(v)``, index l(l+1)+m, in the parabolic map of `sphere.parabolic`; one channel for a
        grey BRDF, else three.
    info : MapInfo
        How the map was made.
    lighting : ndarray, shape ((order+1)^2, 3), optional
        The light's coefficients in world axes; None where the light is chosen when the map is used.
    """

    table: Array
    info: MapInfo
    lighting: Array | None = None

    def __post_init__(self) -> None:
        shape, count = self.table.shape, (self.order + 1) ** 2
        if len(shape) != 4 or shape[0] != shape[1] or shape[2] != count or shape[3] not in (1, 3):
            raise ValueError(f"a product texture of shape {shape}")
        if self.lighting is not None and self.lighting.shape != (count, 3):
            raise ValueError(f"lighting coefficients of shape {self.lighting.shape}")

    @property
    def order(self) -> int:
        """The largest degree of the harmonics."""
        return order_of(self.table.shape[2])

    @property
    def channels(self) -> int:
        """The number of color channels of the BRDF, 1 or 3."""
        return self.table.shape[3]

    @property
    def size(self) -> int:
        """Texels along an edge of the parabolic map."""
        return len(self.table)

    def mixed(self, matrix: Array, info: MapInfo) -> Map:
        """Return the map with other channels; see `maps.primaries`."""
        self.check_mixing()
        return replace(self, lighting=self.lighting @ matrix.T, info=info)  # type: ignore[operator]

    def lit(self, lighting: ArrayLike) -> "ProductTexture":
        """Return the same texture under light of some coefficients.

        Parameters
        ----------
        lighting : array_like, shape (at least (order+1)^2, 3)
            Over the harmonics of world axes, index l(l+1)+m. Degrees beyond `order` do not count.

        Raises
        ------
        MapError
            If the coefficients are of a lower order than the texture.
        """
        coefficients = np.asarray(lighting, dtype=float)
        count = self.table.shape[2]
        if coefficients.ndim != 2 or coefficients.shape[1] != 3 or len(coefficients) < count:
            raise MapError(
                f"light of shape {coefficients.shape} is not {count} coefficients or more, x 3"
            )
        return replace(self, lighting=coefficients[:count])

    def values(self, local_views: ArrayLike, linear: bool = False) -> Array:
        """Look up the coefficients of the product functions of views.

        Parameters
        ----------
        local_views : array_like, shape (..., 3)
            Directions to the viewer, unit, in the frame of the surface: x along the tangent, z =
            N. Those below the horizon count as on it.
        linear : bool
            Filter as graphics hardware does, which is four times as fast, instead of by a cubic
            filter.

        Returns
        -------
        ndarray, shape (..., (order+1)^2, channels)
        """
        look_up = self._sampler.linear if linear else self._sampler
        flat = look_up(local_views)
        return flat.reshape(*flat.shape[:-1], *self.table.shape[2:])

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the reflected radiance; see `Map.brushed_radiance`.

        Raises
        ------
        MapError
            If the map holds no light.
        """
        if self.lighting is None:
            raise MapError("a product texture holds no light; give a probe")
        normals, tangents, views = (
            each.astype(float) for each in np.broadcast_arrays(normals, tangents, views)
        )
        flat = [each.reshape(-1, 3) for each in (normals, tangents, views)]
        result = np.empty_like(flat[0])
        for start in range(0, len(result), _POINTS_AT_ONCE):
            part = slice(start, start + _POINTS_AT_ONCE)
            normal, tangent, view = (each[part] for each in flat)
            frames = surface_frames(normal, tangent)
            light = rotate_into_frames(self.lighting, frames)
            own = self.values(np.einsum("nij,nj->ni", frames, view))
            result[part] = shade(own, np.moveaxis(light, -1, 0))
        return result.reshape(normals.shape)

    @cached_property
    def _sampler(self) -> ParabolicSampler:
        return ParabolicSampler(self.table.reshape(self.size, self.size, -1))


def shade(values: Array, light: Array) -> Array:
    """Multiply product functions with light in the same frames (eq. 1 of the paper).

    Parameters
    ----------
    values : ndarray, shape (n, (order+1)^2, channels)
    light : ndarray, shape (n, (order+1)^2, 3) or ((order+1)^2, 3)

    Returns
    -------
    ndarray, shape (n, 3)
    """
    values = np.broadcast_to(values, (*values.shape[:2], 3))
    return np.asarray(
        np.einsum("nkc,...kc->nc" if light.ndim == 2 else "nkc,nkc->nc", values, light)
    )
