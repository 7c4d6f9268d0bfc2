"""BRDF product textures: any BRDF, also an anisotropic one, under light of low frequency.

The texture holds, for directions of the view in the frame of the surface, the harmonics of the BRDF
times the cosine. The light is a short vector of coefficients. A point turns the light into its own
frame, looks the view up, and multiplies both: the light and the view may change in every frame, and
the surface may have any tangents.

References: Kautz, Sloan and Snyder 2002, "Fast, Arbitrary BRDF Shading for Low-Frequency Lighting
Using Spherical Harmonics", sections 3 and 4.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, slices
from shrm_cli.errors import MapError
from shrm_cli.maps.base import Map
from shrm_cli.maps.info import ERRORS, MapInfo
from shrm_cli.maps.kinds import BrushedLight, FixedMap, HarmonicLight, MaterialMap, ReflectionMap
from shrm_cli.maps.product.steps import Steps
from shrm_cli.records import handed_on, record
from shrm_cli.sphere.directions import surface_frames
from shrm_cli.sphere.harmonics import order_of
from shrm_cli.sphere.parabolic import ParabolicSampler
from shrm_cli.sphere.rotation import rotate_each_into_frames, rotate_into_frames
from shrm_cli.vocabulary import Center, Frame, Sampling

if TYPE_CHECKING:
    from shrm_cli.maps.product.window import LightWindow
    from shrm_cli.probe.lighting import Projection

Points = Sequence[ArrayLike]
"""Normals, tangents and views, shape (..., 3), broadcastable; unit vectors in world axes."""
_POINTS_AT_ONCE = 2**14
"""Points that are shaded at a time."""


class _Parabolic(FixedMap):
    """What product textures are, with light and without."""

    representation = "product"
    format_version = 5
    is_rearrangeable = False
    frame: ClassVar[Frame] = "local"
    center: ClassVar[Center] = "normal"
    sampling: ClassVar[Sampling] = "center"


class ProductMap(_Parabolic, MaterialMap):
    """A map that holds a BRDF over the view: one texture, or several where parameters vary."""

    if TYPE_CHECKING:

        @property
        def textures(self) -> "Sequence[ProductTexture]": ...

    @property
    def order(self) -> int:
        """The largest degree of the harmonics."""
        return order_of(self.textures[0].table.shape[2])

    @property
    def channels(self) -> int:
        """The number of color channels of the BRDF, 1 or 3."""
        return self.textures[0].table.shape[3]

    @property
    def size(self) -> int:
        """Texels along an edge of the parabolic maps."""
        return len(self.textures[0].table)

    @abstractmethod
    def at(self, shares: ArrayLike) -> "ProductTexture":
        """Return the texture where parameters that vary are at shares, 0 .. 1, of their ways."""

    def weights(self, shares: ArrayLike) -> Array:
        """Return the weights by which `textures` are summed up at shares, shape (..., textures)."""
        return np.ones((*np.shape(shares)[:-1], 1))

    def info_at(self, shares: ArrayLike) -> MapInfo:
        """Return the record of the texture that `at` returns."""
        return self.info

    @abstractmethod
    def values(self, local_views: ArrayLike, shares: ArrayLike = 0.5) -> Array:
        """Look up the coefficients of the product functions of views.

        `local_views`, of shape (..., 3), are directions to the viewer, unit, in the frame of the
        surface: x along the tangent, z = N. Those below the horizon count as on it. `shares`, of
        shape (..., parameters), broadcastable, are where parameters that vary are on their ways, 0
        .. 1.

        Returns an array of shape (..., (order+1)^2, channels).
        """

    def reflected(self, lighting: Array, points: Points, shares: ArrayLike = 0.5) -> Array:
        """Evaluate the radiance under light of coefficients in world axes.

        `lighting` is of shape ((order+1)^2, 3), or of shape (..., (order+1)^2, 3) where each point
        has its own.
        """
        normals, *others = (each.astype(float) for each in np.broadcast_arrays(*points))
        flat = [each.reshape(-1, 3) for each in (normals, *others)]
        shares, count = np.asarray(shares, dtype=float), max(self.varies, 1)
        shares = shares if count > 1 else shares[..., None]
        spread = np.broadcast_to(shares, (*normals.shape[:-1], count)).reshape(-1, count)
        result = np.empty_like(flat[0])
        each_light = None if lighting.ndim == 2 else lighting.reshape(-1, *lighting.shape[-2:])
        for part in slices(len(result), _POINTS_AT_ONCE):
            normal, tangent, view = (each[part] for each in flat)
            frames = surface_frames(normal, tangent)
            if each_light is None:
                light = rotate_into_frames(lighting, frames)
            else:
                light = rotate_each_into_frames(np.moveaxis(each_light[part], 0, -1), frames)
            own = self.values(np.einsum("nij,nj->ni", frames, view), spread[part])
            result[part] = shade(own, np.moveaxis(light, -1, 0))
        return result.reshape(normals.shape)

    def lit(self, lighting: ArrayLike) -> "LitProduct":
        """Return the textures under light, whose degrees beyond `order` do not count."""
        count = (self.order + 1) ** 2
        try:
            coefficients = np.asarray(getattr(lighting, "coefficients", lighting), dtype=float)
        except (TypeError, ValueError):
            raise MapError(
                f"{type(lighting).__name__} is no light; give coefficients, {count} x 3, such as "
                "`project` returns"
            ) from None
        if coefficients.ndim != 2 or coefficients.shape[1] != 3 or len(coefficients) < count:
            raise MapError(
                f"light of shape {coefficients.shape} is not {count} coefficients or more, x 3"
            )
        if not np.isfinite(coefficients).all():
            raise MapError("the light holds NaN or infinite coefficients; project it again")
        return LitProduct(self, coefficients[:count])

    def window(self, spec: str, lighting: ArrayLike) -> "LightWindow":
        from shrm_cli.maps.product.window import product_window

        return product_window(spec, self, lighting)

    def error_under(self, light: "Projection", values: Mapping[str, float]) -> float:
        from shrm_cli.maps.product.window import error_beyond_order

        shares = self.shares(values)
        return error_beyond_order(self.at(shares), light, self.captured_at(shares))

    def captured_at(self, shares: ArrayLike) -> float:
        """Return how much of the BRDF's energy the texture has that `at` returns."""
        return self.info.captured

    def mixed(self, matrix: Array, info: MapInfo) -> Map:
        """Raise a `MapError`, since only light has primaries."""
        raise MapError(f"{self.what} that holds no light has no primaries")

    def summary(self) -> dict[str, Any]:
        info = self.info
        return {
            **super().summary(),
            "size": self.size,
            "order": self.order,
            "coefficients": (self.order + 1) ** 2,
            "channels": self.channels,
            "lit": False,
            "brdf_energy_captured": info.captured,
            **info.errors,
        }

    def details(self) -> dict[str, Any]:
        return {}


@record(eq=False)
class LitProduct(BrushedLight, _Parabolic, ReflectionMap):
    """Product textures under light."""

    product: ProductMap
    lighting: Array
    """The light's coefficients in world axes, shape ((order+1)^2, 3)."""

    against_negatives = "take a larger `order`, or `window` hann, which blurs"
    texels_are_series = True

    def __post_init__(self) -> None:
        if self.lighting.shape != ((self.order + 1) ** 2, 3):
            raise ValueError(f"lighting coefficients of shape {self.lighting.shape}")

    info = handed_on("product", "info")
    size = handed_on("product", "size")
    order = handed_on("product", "order")
    ways = handed_on("product", "ways")

    @property
    def harmonic_light(self) -> HarmonicLight:
        return HarmonicLight(self.lighting, self.product)

    def with_values(self, values: Mapping[str, float]) -> "LitProduct":
        return replace(self, product=self.product.at(self.shares(values)))

    def with_info(self, info: MapInfo) -> "LitProduct":
        return replace(self, product=self.product.with_info(info))

    def summary(self) -> dict[str, Any]:
        return {**self.product.summary(), "lit": True}

    def details(self) -> dict[str, Any]:
        return {**self.product.details(), "lighting_coefficients": self.lighting.tolist()}

    def mixed(self, matrix: Array, info: MapInfo) -> "LitProduct":
        if self.product.channels > 1:
            raise MapError(
                f"{self.what} of a colored BRDF is a table of each channel's own, which cannot be "
                "mixed; prefilter its probe with `working`"
            )
        return replace(self, lighting=self.lighting @ matrix.T).with_info(info)

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate what is reflected where parameters that vary are in the middle of their ways."""
        return self.varied_radiance(normals, tangents, views, 0.5)

    def varied_radiance(
        self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike, shares: ArrayLike
    ) -> Array:
        return self.product.reflected(self.lighting, (normals, tangents, views), shares)


@record(eq=False)
class ProductTexture(ProductMap):
    """The product functions of a BRDF over the view."""

    table: Array
    """``c_i(v)``, index l(l+1)+m, in the parabolic map of `sphere.parabolic`; one channel for a
    grey BRDF, else three, shape (N, N, (order+1)^2, channels)."""
    info: MapInfo

    def __post_init__(self) -> None:
        shape, count = self.table.shape, (self.order + 1) ** 2
        if len(shape) != 4 or shape[0] != shape[1] or shape[2] != count or shape[3] not in (1, 3):
            raise ValueError(f"a product texture of shape {shape}")

    @property
    def textures(self) -> "tuple[ProductTexture]":
        return (self,)

    def at(self, shares: ArrayLike) -> "ProductTexture":
        """Return the texture itself, of which nothing varies."""
        return self

    def values(
        self, local_views: ArrayLike, shares: ArrayLike = 0.5, linear: bool = False
    ) -> Array:
        """Look up the coefficients of views; see `ProductMap.values`.

        With `linear` they are filtered as graphics hardware does, which is four times as fast,
        instead of by a cubic filter.
        """
        look_up = self._sampler.linear if linear else self._sampler
        flat = look_up(local_views)
        return flat.reshape(*flat.shape[:-1], *self.table.shape[2:])

    @cached_property
    def _sampler(self) -> ParabolicSampler:
        return ParabolicSampler(self.table.reshape(self.size, self.size, -1))


def shade(values: Array, light: Array) -> Array:
    """Multiply product functions with light in the same frames (eq. 1 of the paper).

    `values` are of shape (n, (order+1)^2, channels). `light` is of shape (n, (order+1)^2, 3) or
    ((order+1)^2, 3).

    Returns an array of shape (n, 3).
    """
    values = np.broadcast_to(values, (*values.shape[:2], 3))
    return np.asarray(
        np.einsum("nkc,...kc->nc" if light.ndim == 2 else "nkc,nkc->nc", values, light)
    )


# ---- textures of a BRDF of which parameters vary over the surface --------------------------------
# Textures for a few values of the parameters are joined with weights that are interpolated linearly
# between these values. Those of one parameter are as the slices of a 3D texture.
#
# References: Kautz, Sloan and Snyder 2002, section 3: "we just need a higher-dimensional c_i(v, q)
# table indexed by whichever parameters q are to be spatially varied".


@record(eq=False)
class VaryingProduct(ProductMap):
    """Product textures that are joined by the values of parameters."""

    textures: tuple[ProductTexture, ...]
    """Textures of one order and size."""
    steps: Steps
    """The values of the parameters, and the weights of the textures."""
    info: MapInfo
    """How the map was made, with the largest errors of any texture. Its BRDF has the middles of the
    ranges, which are shown where nothing tells the parameters."""

    def __post_init__(self) -> None:
        if self.steps.weights.shape[-1] != len(self.textures):
            raise ValueError(f"{len(self.textures)} textures for other weights")
        if len({each.table.shape for each in self.textures}) > 1:
            raise ValueError("textures of several shapes")

    @classmethod
    def of(cls, textures: Sequence[ProductTexture], steps: Steps) -> "VaryingProduct":
        """Join textures; those of grey BRDFs among coloured ones become coloured."""
        channels = max(each.table.shape[3] for each in textures)
        same = [
            replace(each, table=np.repeat(each.table, channels // each.table.shape[3], axis=3))
            for each in textures
        ]
        infos = [each.info for each in textures]
        info = replace(
            infos[0],
            brdf=steps.recorded([each.brdf for each in infos], 0.5),
            captured=min(each.captured for each in infos),
            **{name: max(getattr(each, name) for each in infos) for name in ("eps", *ERRORS)},
        )
        return cls(tuple(same), steps, info)

    @property
    def ways(self) -> Mapping[str, tuple[float, float]]:
        return self.steps.ways

    def details(self) -> dict[str, Any]:
        return {**self.steps.summary(), "textures": len(self.textures)}

    def with_info(self, info: MapInfo) -> "VaryingProduct":
        textures = tuple(replace(each, info=each.info.read_as(info)) for each in self.textures)
        return replace(self, textures=textures, info=info)

    def at(self, shares: ArrayLike) -> ProductTexture:
        weights = self.weights(shares).tolist()
        pairs = [(w, each) for w, each in zip(weights, self.textures, strict=True) if w]
        table = sum((w * each.table for w, each in pairs), np.zeros_like(self.textures[0].table))
        return ProductTexture(table, self.info_at(shares))

    def weights(self, shares: ArrayLike) -> Array:
        return self.steps.at(shares)

    def info_at(self, shares: ArrayLike) -> MapInfo:
        return replace(self.info, brdf=self.steps.recorded([self.info.brdf], shares))

    def captured_at(self, shares: ArrayLike) -> float:
        own = np.array([each.info.captured for each in self.textures])
        # The weights of the textures of two parameters may be negative.
        return float(np.clip(self.weights(shares) @ own, own.min(), own.max()))

    def values(self, local_views: ArrayLike, shares: ArrayLike = 0.5) -> Array:
        views = np.asarray(local_views, dtype=float)
        flat, weights = views.reshape(-1, 3), self.weights(shares)
        weights = np.broadcast_to(weights, (*views.shape[:-1], len(self.textures)))
        result = np.zeros((len(flat), *self.textures[0].table.shape[2:]))
        for texture, own in zip(self.textures, weights.reshape(len(flat), -1).T, strict=True):
            near = np.flatnonzero(own)
            result[near] += own[near, None, None] * texture.values(flat[near])
        return result.reshape(*views.shape[:-1], *result.shape[1:])
