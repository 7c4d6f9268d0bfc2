"""Spherical harmonic reflection maps (section 5.4): a cube over R of expansions over V."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.brdf.centers import central_directions
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.coupling import reflected_coefficients
from shrm_cli.maps.size import check_size, choose_size
from shrm_cli.sphere.cube import cube_directions, cube_solid_angles
from shrm_cli.sphere.directions import to_angles
from shrm_cli.sphere.harmonics import degrees, order_of, real_harmonics
from shrm_cli.sphere.rotation import rotate_to_frames
from shrm_cli.sphere.sampling import CubeSampler
from shrm_cli.sphere.synthesis import synthesize_cube
from shrm_cli.vocabulary import Center, Frame, Sampling

Array = NDArray[np.floating]

_TEXELS_AT_ONCE = 2**14


@dataclass(frozen=True)
class Shrm:
    """A spherical harmonic reflection map.

    Attributes
    ----------
    coefficients : ndarray, shape (6N, N, (P+1)^2, 3)
        Real coefficients over the view, index p(p+1)+q, at each texel of an OpenEXR cube of
        central directions.
    frame : {"global", "local"}
        Whether they belong to the view in world axes (eq. 5.11) or in the local frame of the
        texel's direction (eq. 5.10).
    center : {"reflection", "normal", "tangent"}
        What the central direction is.
    info : MapInfo
    sampling : {"center", "border"}
    """

    coefficients: Array
    frame: Frame
    center: Center
    info: MapInfo
    sampling: Sampling = "center"

    representation = "shrm"

    def __post_init__(self) -> None:
        shape = self.coefficients.shape
        if len(shape) != 4 or shape[0] != 6 * shape[1] or shape[3] != 3:
            raise ValueError(f"SHRM coefficients of shape {shape}, not (6N, N, (P+1)^2, 3)")
        if (self.order_p + 1) ** 2 != shape[2]:
            raise ValueError(f"{shape[2]} coefficients are not a square number")

    @property
    def size(self) -> int:
        return self.coefficients.shape[1]

    @property
    def order_p(self) -> int:
        return order_of(self.coefficients.shape[2])

    @property
    def azimuth_free(self) -> bool:
        """Whether a local map holds only q = 0 (a BRDF without azimuthal dependence)."""
        if self.frame != "local":
            return False
        q = [q for p in range(self.order_p + 1) for q in range(-p, p + 1)]
        return not self.coefficients[:, :, np.array(q) != 0].any()

    @classmethod
    def build(
        cls,
        lighting: ArrayLike,
        brdf: Array,
        center: Center,
        info: MapInfo,
        size: int | None = None,
        frame: Frame = "global",
        sampling: Sampling = "center",
        dtype: type = np.float64,
    ) -> "Shrm":
        """Prefilter: from coefficients of light and BRDF to the map.

        Parameters
        ----------
        lighting : array_like, shape (>= (F+1)^2, 3)
        brdf : ndarray, shape (F+1, P+1, P+1, 3)
            rho_hat_lpq to exactly the orders of the map.
        center : {"reflection", "normal", "tangent"}
            The BRDF's central direction.
        info : MapInfo
        size : int, optional
            Texels along a face's edge; `choose_size` by default.
        frame, sampling
            As the attributes.
        dtype : float32 or float64
            Precision of the synthesis.

        Raises
        ------
        MapError
            If the map would be too large to be kept in memory.
        """
        size = choose_size(brdf.shape[0] - 1) if size is None else size
        check_size(brdf.shape[0] - 1, brdf.shape[1] - 1, size)
        if frame == "local" and not brdf[:, :, 1:].any():
            return cls(
                _zonal_coefficients(np.asarray(lighting), brdf, size, sampling, dtype),
                frame, center, info, sampling,
            )  # fmt: skip
        series = reflected_coefficients(np.asarray(lighting), brdf)
        planes = synthesize_cube(series.reshape(len(series), -1), size, sampling, dtype)
        stacked = planes.reshape(*series.shape[1:], 6 * size, size)
        built = cls(stacked.transpose(2, 3, 0, 1), "global", center, info, sampling)
        return built if frame == "global" else built.to_frame(frame)

    def to_frame(self, frame: Frame) -> "Shrm":
        """The same map in another frame: a rotation of each texel's coefficients (eq. 5.14)."""
        if frame == self.frame:
            return self
        directions = cube_directions(self.size, self.sampling).reshape(-1, 3)
        theta, phi = to_angles(directions)
        flat = self.coefficients.reshape(len(theta), -1, 3)
        turned = np.empty_like(flat)
        for start in range(0, len(theta), _TEXELS_AT_ONCE):
            part = slice(start, start + _TEXELS_AT_ONCE)
            turned[part] = rotate_to_frames(
                flat[part].transpose(1, 2, 0), theta[part], phi[part], inverse=frame == "global"
            ).transpose(2, 0, 1)
        return replace(self, coefficients=turned.reshape(self.coefficients.shape), frame=frame)

    def truncated(self, order_p: int | None) -> "Shrm":
        """The same map without what is above an order P; None keeps all.

        Its `info` holds what that adds to the relative RMS error.
        """
        if order_p is None or order_p >= self.order_p:
            return self
        kept = (order_p + 1) ** 2
        texels = np.tile(cube_solid_angles(self.size, self.sampling), (6, 1))
        energy = np.einsum("ijkc,ijkc,ij->k", self.coefficients, self.coefficients, texels)
        lost = float(np.sqrt(energy[kept:].sum() / energy.sum())) if energy.sum() > 0 else 0.0
        info = replace(
            self.info, order_p=order_p, added_error=float(np.hypot(self.info.added_error, lost))
        )
        return replace(self, coefficients=self.coefficients[:, :, :kept], info=info)

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Reflected radiance, filtered between texels.

        Parameters
        ----------
        normals, views : array_like, shape (..., 3), broadcastable
            Unit, world axes; views point to the viewer.

        Returns
        -------
        ndarray, shape (..., 3)
        """
        normals, views = np.asarray(normals, dtype=float), np.asarray(views, dtype=float)
        return self.central_radiance(central_directions(self.center, normals, views), views)

    def central_radiance(self, centers: ArrayLike, views: ArrayLike) -> Array:
        """Radiance by central directions instead of normals; the rest as `radiance`."""
        centers, views = np.asarray(centers, dtype=float), np.asarray(views, dtype=float)
        if views.ndim == 1:  # a distant viewer: one reflection map serves all (eq. 5.35)
            return self._distant_sampler(views)(centers)
        shape = np.broadcast_shapes(centers.shape, views.shape)
        values = self._sampler(np.broadcast_to(centers, shape))
        values = values.reshape(*shape[:-1], -1, 3)
        return np.einsum("...k,...kc->...c", real_harmonics(self.order_p, views), values)

    def reflection_map(self, view: ArrayLike) -> Array:
        """The map for one distant viewer (eq. 5.35), shape (6N, N, 3)."""
        weights = real_harmonics(self.order_p, np.asarray(view, dtype=float))
        coefficients = self._global.coefficients
        return np.einsum("rckx,k->rcx", coefficients, weights.astype(coefficients.dtype))

    def _distant_sampler(self, view: Array) -> CubeSampler:
        """The sampler of one view's reflection map; that of the last view is kept."""
        kept = self._last_view
        if kept.get("view") != tuple(view):
            kept["sampler"] = CubeSampler(self.reflection_map(view), self.sampling)
            kept["view"] = tuple(view)
        return kept["sampler"]

    @cached_property
    def _last_view(self) -> dict[str, Any]:
        return {}

    @cached_property
    def _global(self) -> "Shrm":
        # Local frames are singular at the poles, so only global coefficients can be filtered.
        return self.to_frame("global")

    @cached_property
    def _sampler(self) -> CubeSampler:
        coefficients = self._global.coefficients
        return CubeSampler(coefficients.reshape(*coefficients.shape[:2], -1), self.sampling)


def _zonal_coefficients(
    lighting: Array, brdf: Array, size: int, sampling: Sampling, dtype: type
) -> Array:
    """Local coefficients of a BRDF without azimuth: P + 1 convolutions (eq. 5.9 with q = 0)."""
    order_f, order_p = brdf.shape[0] - 1, brdf.shape[1] - 1
    degree = degrees(order_f)
    scale = np.sqrt(4 * np.pi / (2 * degree + 1))[:, None, None]
    series = lighting[: len(degree), None] * brdf[degree, :, 0] * scale
    planes = synthesize_cube(series.reshape(len(series), -1), size, sampling, dtype)
    result = np.zeros((6 * size, size, (order_p + 1) ** 2, 3), dtype=dtype)
    zonal = [p * (p + 1) for p in range(order_p + 1)]
    stacked = planes.reshape(order_p + 1, 3, 6 * size, size)
    result[:, :, zonal] = stacked.transpose(2, 3, 0, 1)
    return result
