"""Spherical harmonic reflection maps: a cube over R of spherical harmonic expansions over V.

They are those of section 5.4 of Ramamoorthi's thesis, and equations 5.x are those of its chapter 5.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, Memo, slices
from shrm_cli.errors import MapError
from shrm_cli.maps.coupling import reflected_coefficients
from shrm_cli.maps.info import MapInfo, check_names
from shrm_cli.maps.kinds import CentralMap
from shrm_cli.maps.options import checked_order_p
from shrm_cli.maps.size import check_size, choose_size
from shrm_cli.records import record
from shrm_cli.sphere.cube import (
    CubeSampler,
    cube_solid_angles,
    nearest_texels,
    texel_directions,
    texel_solid_angles,
)
from shrm_cli.sphere.directions import bisector, central_directions, local_frame, to_angles
from shrm_cli.sphere.harmonics import degrees, harmonic_planes, order_of, real_harmonics
from shrm_cli.sphere.synthesis import synthesize_cube
from shrm_cli.vocabulary import Center, Frame, Sampling

_TEXELS_AT_ONCE = 2**14
"""The number of texels whose coefficients `Shrm.to_frame` rotates at a time."""
_VALUES_AT_ONCE = 2**22
"""The number of values that look-ups and `second_moments` take at a time, as doubles of 32 MB."""


@record(eq=False)
class Shrm(CentralMap):
    """A spherical harmonic reflection map."""

    coefficients: Array
    """Coefficients over the real harmonics of the view, index p(p+1)+q, at each texel of an OpenEXR
    cube of central directions, shape (6N, N, (P+1)^2, 3)."""
    frame: Frame
    """Whether the coefficients belong to the view in world axes (eq. 5.11) or in the local frame of
    the texel's direction (eq. 5.10)."""
    center: Center
    """What the central direction is."""
    info: MapInfo
    sampling: Sampling = "center"

    representation = "shrm"
    texels_are_series = True

    def __post_init__(self) -> None:
        check_names(self)
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
        """Whether the map is local and holds q = 0 only, as for a BRDF that ignores the azimuth."""
        if self.frame != "local":
            return False
        q = [q for p in range(self.order_p + 1) for q in range(-p, p + 1)]
        return not self.coefficients[:, :, np.array(q) != 0].any()

    @property
    def turns_with_texels(self) -> bool:
        """Whether the frame is local and the coefficients depend on how the frames are turned."""
        return self.frame == "local" and not self.azimuth_free

    @property
    def cube_count(self) -> int:
        """The number of RGB cubes: one for each coefficient, or for each p if `azimuth_free`."""
        every = self.order_p + 1
        return every if self.azimuth_free else every**2

    def planes(self) -> list[Array]:
        """Return one cube of all coefficients, shape (6N, N, 3 (P+1)^2)."""
        return [self.coefficients.reshape(*self.coefficients.shape[:2], -1)]

    def with_planes(self, planes: Sequence[Array], sampling: Sampling, info: MapInfo) -> Shrm:
        (flat,) = planes
        shaped = flat.reshape(*flat.shape[:2], *self.coefficients.shape[2:])
        return replace(self, coefficients=shaped, sampling=sampling, info=info)

    @classmethod
    def from_coefficients(
        cls,
        lighting: ArrayLike,
        brdf: Array,
        center: Center,
        info: MapInfo,
        size: int | None = None,
        frame: Frame = "global",
        sampling: Sampling = "center",
        dtype: type = np.float64,
    ) -> Shrm:
        """Make the map from the coefficients of light and BRDF.

        `lighting`, of shape (>= (F+1)^2, 3), are the coefficients of the light over the real
        harmonics of world axes. `brdf`, of shape (F+1, P+1, P+1, 3), are the coefficients
        rho_hat_lpq of the BRDF to exactly the orders of the map, for q >= 0. `center` is the BRDF's
        central direction. `size` is the number of texels along a face's edge; `choose_size` by
        default. `dtype` is the precision in which the texels are computed.
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

    def to_frame(self, frame: Frame) -> Shrm:
        """Rotate the coefficients of each texel to another frame (eq. 5.14)."""
        from shrm_cli.sphere.rotation import rotate_to_frames

        if frame == self.frame:
            return self
        if self.order_p == 0:  # a constant is the same in all axes
            return replace(self, frame=frame)
        flat = self.coefficients.reshape(6 * self.size**2, -1, 3)
        turned = np.empty_like(flat)
        for part in slices(len(flat), _TEXELS_AT_ONCE):
            rows, columns = np.divmod(np.arange(*part.indices(len(flat))), self.size)
            angles = to_angles(texel_directions(rows, columns, self.size, self.sampling))
            turned[part] = rotate_to_frames(
                flat[part].transpose(1, 2, 0), *angles, inverse=frame == "global"
            ).transpose(2, 0, 1)
        return replace(self, coefficients=turned.reshape(self.coefficients.shape), frame=frame)

    def truncated(self, order_p: int | None) -> Shrm:
        """Return the same map without the coefficients above an order P; None keeps all."""
        if order_p is None or order_p >= self.order_p:
            return self
        kept = (order_p + 1) ** 2
        texels = texel_solid_angles(self.size, self.sampling)
        energy = np.einsum("ijkc,ijkc,ij->k", self.coefficients, self.coefficients, texels)
        lost = float(np.sqrt(energy[kept:].sum() / energy.sum())) if energy.sum() > 0 else 0.0
        info = replace(self.info.adding(lost), order_p=order_p)
        return replace(self, coefficients=self.coefficients[:, :, :kept], info=info)

    def check_memory(self, size: int) -> None:
        check_size(self.info.order_f, self.order_p, size)

    def _moved(self, size: int, sampling: Sampling) -> Shrm:
        # Local frames turn from texel to texel, so only global coefficients can be filtered.
        moved = super(Shrm, self.to_frame("global"))._moved(size, sampling)
        return cast(Shrm, moved).to_frame(self.frame)

    def to_shrm(self, order_p: int | None = None, frame: Frame | None = None) -> Shrm:
        """Return the map itself, or of a lower order P or in another frame."""
        order_p = checked_order_p(order_p)
        if order_p is not None and order_p > self.order_p:
            raise MapError(
                f"an SHRM of order P = {self.order_p} has nothing of order {order_p}; lower "
                "`order_p`"
            )
        return self.truncated(order_p).to_frame(frame or self.frame)

    def central_radiance(self, centers: ArrayLike, views: ArrayLike) -> Array:
        centers, views = np.asarray(centers, dtype=float), np.asarray(views, dtype=float)
        if views.ndim == 1:  # one reflection map serves all points for a distant viewer (eq. 5.35)
            return self._distant_sampler(views)(centers)
        shape, count = np.broadcast_shapes(centers.shape, views.shape), (self.order_p + 1) ** 2
        centers, views = (np.broadcast_to(each, shape).reshape(-1, 3) for each in (centers, views))
        result = np.empty(centers.shape)
        for part in slices(len(centers), _VALUES_AT_ONCE // (3 * count)):
            values = self._sampler(centers[part]).reshape(-1, count, 3)
            harmonics = real_harmonics(self.order_p, views[part])
            result[part] = np.einsum("nk,nkc->nc", harmonics, values)
        return result.reshape(shape)

    def rough_radiance(self, reflections: Array, views: Array) -> Array:
        form = self.center, self.frame, self.size, self.sampling, self.order_p
        digests = (hashlib.sha256(each.tobytes()).digest() for each in (reflections, views))
        make = partial(_rough_terms, reflections, views, *form)
        texels, weights = _known_terms.get((*form, *digests), make)
        planes = np.moveaxis(self.coefficients, (2, 3), (0, 1)).reshape(len(weights), 3, -1)
        shown = planes.take(texels, axis=-1)
        shown *= weights.astype(shown.dtype)[:, None]
        return np.asarray(shown.sum(axis=0).T)

    def reflection_map(self, view: ArrayLike) -> Array:
        """Return the reflection map for one distant viewer (eq. 5.35), shape (6N, N, 3).

        `view`, of shape (3,), is the unit direction to the viewer, world axes.
        """
        weights = real_harmonics(self.order_p, np.asarray(view, dtype=float))
        coefficients = self._global.coefficients
        return np.einsum("rckx,k->rcx", coefficients, weights.astype(coefficients.dtype))

    def _distant_sampler(self, view: Array) -> CubeSampler:
        """Return the sampler of one view's reflection map, which is kept until the view changes."""
        sampler = self._last_view.get(tuple(view))
        if sampler is None:
            sampler = CubeSampler(self.reflection_map(view), self.sampling)
            self._last_view.clear()
            self._last_view[tuple(view)] = sampler
        return sampler  # which other threads may have replaced by now

    @cached_property
    def _last_view(self) -> dict[tuple[float, ...], CubeSampler]:
        """The sampler of the last distant view by that; empty before the first."""
        return {}

    @cached_property
    def _global(self) -> Shrm:
        # Local frames are singular at the poles, so only global coefficients can be filtered.
        return self.to_frame("global")

    @cached_property
    def _sampler(self) -> CubeSampler:
        coefficients = self._global.coefficients
        return CubeSampler(coefficients.reshape(*coefficients.shape[:2], -1), self.sampling)


_known_terms = Memo(2**23)
"""Texels and harmonics for `Shrm.rough_radiance`, which is asked for the same pairs of every map.
Those of 4096 pairs take 0.3 MB at P = 2."""


def _rough_terms(
    reflections: Array,
    views: Array,
    center: Center,
    frame: Frame,
    size: int,
    sampling: Sampling,
    order_p: int,
) -> tuple[NDArray[np.intp], Array]:
    """Return what a map of some form is weighted with for pairs of mirror directions and views.

    Returns `texels` of shape (n,), the nearest texel of each pair's central direction, as an index
    into a flat cube; and `weights` of shape ((P+1)^2, n), the harmonics of the view in the frame of
    the map.
    """
    centers = central_directions(center, bisector(reflections, views), views)
    rows, columns = nearest_texels(centers, size, sampling)
    if frame == "local":
        frames = local_frame(*to_angles(centers))
        views = np.einsum("...ji,...j->...i", frames, views)
    return rows * size + columns, harmonic_planes(order_p, views)


def second_moments(shrm: Shrm) -> Array:
    """Integrate the products of all pairs of coefficients over the texels and channels.

    Returns an array of shape ((P+1)^2, (P+1)^2).
    """
    face = np.sqrt(cube_solid_angles(shrm.size, shrm.sampling))
    count = (shrm.order_p + 1) ** 2
    result: Array = np.zeros((count, count))
    for part in slices(6 * shrm.size, _VALUES_AT_ONCE // (3 * shrm.size * count)):
        rows = np.arange(part.start, part.stop)
        planes = np.moveaxis(shrm.coefficients[part], (2, 3), (0, 1)).astype(float)
        flat = (planes * face[rows % shrm.size]).reshape(count, -1)
        result += flat @ flat.T
    return result


def _zonal_coefficients(
    lighting: Array, brdf: Array, size: int, sampling: Sampling, dtype: type
) -> Array:
    """Compute the local coefficients for a BRDF that does not depend on the azimuth.

    They are P + 1 convolutions (eq. 5.9 with q = 0).
    """
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


# ---- compressed by principal components; section 5.8 names it as future work ---------------------


@record(eq=False)
class CompressedShrm(CentralMap):
    """An SHRM as K spatial maps and the matrix that mixes its coefficients from them.

    The coefficients of a texel are correlated: where the light is bright, all of them are large.
    Their principal components over texels and channels, weighted by solid angle, are the best
    basis for them. Because the harmonics are orthonormal, no other K maps come closer in RMS over
    all central directions and views.
    """

    components: Array
    """The spatial maps, which are RGB cubes of central directions, shape (6N, N, K, 3)."""
    matrix: Array
    """The mixing matrix, ``coefficients = sum_k components[..., k, :] matrix[k]``, shape (K,
    (P+1)^2). Its rows are orthonormal."""
    frame: Frame
    center: Center
    info: MapInfo
    sampling: Sampling = "center"
    """`frame`, `center`, `info` and `sampling`: the same as in `Shrm`."""

    representation = "shrm"
    texels_are_series = True
    format_version = 2

    def __post_init__(self) -> None:
        check_names(self)
        shape = self.components.shape
        if len(shape) != 4 or shape[0] != 6 * shape[1] or shape[3] != 3:
            raise ValueError(f"components of shape {shape}, not (6N, N, K, 3)")
        if self.matrix.ndim != 2 or len(self.matrix) != shape[2]:
            raise ValueError(f"a matrix of shape {self.matrix.shape} for {shape[2]} components")
        if (self.order_p + 1) ** 2 != self.matrix.shape[1]:
            raise ValueError(f"{self.matrix.shape[1]} coefficients are not a square number")

    @property
    def size(self) -> int:
        return self.components.shape[1]

    @property
    def order_p(self) -> int:
        return order_of(self.matrix.shape[1])

    @property
    def cube_count(self) -> int:
        return len(self.matrix)

    def summary(self) -> dict[str, Any]:
        return {**super().summary(), "components": self.cube_count}

    @property
    def turns_with_texels(self) -> bool:
        """Whether the frame is local, so that the components belong to axes that turn."""
        return self.frame == "local"

    def planes(self) -> list[Array]:
        """Return one cube of all components, shape (6N, N, 3 K)."""
        return [self.components.reshape(*self.components.shape[:2], -1)]

    def with_planes(
        self, planes: Sequence[Array], sampling: Sampling, info: MapInfo
    ) -> CompressedShrm:
        (flat,) = planes
        shaped = flat.reshape(*flat.shape[:2], *self.components.shape[2:])
        return replace(self, components=shaped, sampling=sampling, info=info)

    def check_memory(self, size: int) -> None:
        check_size(self.info.order_f, self.order_p, size)

    def _moved(self, size: int, sampling: Sampling) -> CompressedShrm:
        # The best components at one size are not the best ones at another.
        whole = self.expand().resampled(size, sampling)
        again = CompressedShrm.from_shrm(whole.to_shrm(), self.cube_count)
        return replace(again, info=whole.info)

    def to_shrm(self, order_p: int | None = None, frame: Frame | None = None) -> Shrm:
        return self.expand().to_shrm(order_p, frame)

    @classmethod
    def from_shrm(
        cls, shrm: Shrm, count: int | None = None, tolerance: float = 0.0
    ) -> CompressedShrm:
        """Keep the largest principal components of an SHRM.

        `count` is the number of components to keep. `tolerance` is the relative RMS error that may
        be added. Without `count` the fewest components that stay within it are kept.
        """
        every = (shrm.order_p + 1) ** 2
        if count is not None and not 1 <= count <= every:
            raise MapError(
                f"{count} components cannot be kept: an SHRM of order P = {shrm.order_p} has "
                f"{every}; ask for 1 .. {every}"
            )
        energies, vectors = np.linalg.eigh(second_moments(shrm))
        energies, vectors = np.maximum(energies[::-1], 0.0), vectors[:, ::-1]
        # Entry k is the energy that the first k components leave. It is a sum of the small
        # energies rather than a difference of large ones, so that nothing cancels.
        left = np.append(np.cumsum(energies[::-1])[::-1], 0.0)
        errors = np.sqrt(left / left[0]) if left[0] > 0 else np.zeros(every + 1)
        if count is None:
            count = max(int(np.argmax(errors <= tolerance)), 1)
        matrix = vectors[:, :count].T
        # The sign of an eigenvector is arbitrary, so the largest entry is made positive.
        peaks = np.take_along_axis(matrix, np.abs(matrix).argmax(axis=1)[:, None], axis=1)
        matrix = matrix * np.where(peaks < 0, -1.0, 1.0)
        planes = np.moveaxis(shrm.coefficients, (2, 3), (0, 1))
        flat = matrix.astype(planes.dtype) @ planes.reshape(every, -1)
        components = flat.reshape(count, *planes.shape[1:]).transpose(2, 3, 0, 1)
        info = shrm.info.adding(errors[count])
        return cls(components, matrix, shrm.frame, shrm.center, info, shrm.sampling)

    def expand(self) -> Shrm:
        """Return the SHRM of all coefficients."""
        planes = np.moveaxis(self.components, (2, 3), (0, 1))
        flat = self.matrix.T.astype(planes.dtype) @ planes.reshape(self.cube_count, -1)
        shaped = flat.reshape(-1, *planes.shape[1:]).transpose(2, 3, 0, 1)
        return Shrm(shaped, self.frame, self.center, self.info, self.sampling)

    def central_radiance(self, centers: ArrayLike, views: ArrayLike) -> Array:
        return self._expanded.central_radiance(centers, views)

    def rough_radiance(self, reflections: Array, views: Array) -> Array:
        return self._expanded.rough_radiance(reflections, views)

    @cached_property
    def _expanded(self) -> Shrm:
        return self.expand()


def compressed(shrm: Shrm, compress: int | float | None) -> Shrm | CompressedShrm:
    """Compress an SHRM, if that is asked for.

    `compress` is the number of principal components to keep (an int), or the relative RMS error
    that may be added (a float below 1). None returns the SHRM as it is.
    """
    if compress is None:
        return shrm
    if isinstance(compress, int):
        return CompressedShrm.from_shrm(shrm, compress)
    if not 0 < compress < 1:
        raise MapError(f"`compress` {compress:g} is neither a number of components nor an error")
    return CompressedShrm.from_shrm(shrm, tolerance=compress)
