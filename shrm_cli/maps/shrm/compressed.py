"""SHRMs compressed by principal component analysis.

Section 5.8 of Ramamoorthi's thesis names this as future work.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo, check_names
from shrm_cli.maps.kinds import CentralMap
from shrm_cli.maps.shrm.shrm import Shrm, second_moments
from shrm_cli.maps.size import check_size
from shrm_cli.records import record
from shrm_cli.sphere.harmonics import order_of
from shrm_cli.vocabulary import Center, Frame, Sampling


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
    ) -> "CompressedShrm":
        (flat,) = planes
        shaped = flat.reshape(*flat.shape[:2], *self.components.shape[2:])
        return replace(self, components=shaped, sampling=sampling, info=info)

    def check_memory(self, size: int) -> None:
        check_size(self.info.order_f, self.order_p, size)

    def _moved(self, size: int, sampling: Sampling) -> "CompressedShrm":
        # The best components at one size are not the best ones at another.
        whole = self.expand().resampled(size, sampling)
        again = CompressedShrm.from_shrm(whole.to_shrm(), self.cube_count)
        return replace(again, info=whole.info)

    def to_shrm(self, order_p: int | None = None, frame: Frame | None = None) -> Shrm:
        return self.expand().to_shrm(order_p, frame)

    @classmethod
    def from_shrm(
        cls, shrm: Shrm, count: int | None = None, tolerance: float = 0.0
    ) -> "CompressedShrm":
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
        info = replace(shrm.info, added_error=float(np.hypot(shrm.info.added_error, errors[count])))
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
