"""SHRMs compressed by principal component analysis, the future work of section 5.8."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.errors import MapError
from shrm_cli.maps.explicit.explicit import second_moments
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.sphere.harmonics import order_of
from shrm_cli.vocabulary import Center, Frame, Sampling

Array = NDArray[np.floating]


@dataclass(frozen=True)
class CompressedShrm:
    """An SHRM as K spatial maps and the matrix that mixes its coefficients from them.

    The coefficients of a texel are correlated: where the light is bright, all of them are large.
    Their principal components over texels and channels, by solid angle, are the best basis for
    them: as the harmonics are orthonormal, no other K maps come closer in RMS over all central
    directions and views.

    Attributes
    ----------
    components : ndarray, shape (6N, N, K, 3)
        Spatial maps, RGB cubes of central directions.
    matrix : ndarray, shape (K, (P+1)^2)
        ``coefficients = sum_k components[..., k, :] matrix[k]``; orthonormal rows.
    frame, center, info, sampling
        As those of `Shrm`.
    """

    components: Array
    matrix: Array
    frame: Frame
    center: Center
    info: MapInfo
    sampling: Sampling = "center"

    representation = "shrm"

    def __post_init__(self) -> None:
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
    def count(self) -> int:
        """Spatial maps K."""
        return len(self.matrix)

    @classmethod
    def from_shrm(
        cls, shrm: Shrm, count: int | None = None, tolerance: float = 0.0
    ) -> "CompressedShrm":
        """Keep the largest principal components of an SHRM.

        Parameters
        ----------
        shrm : Shrm
        count : int, optional
            Components to keep.
        tolerance : float
            Without `count`: the least components whose relative RMS error stays within it.

        Raises
        ------
        MapError
            If there are fewer components than `count`.
        """
        every = (shrm.order_p + 1) ** 2
        if count is not None and not 1 <= count <= every:
            raise MapError(
                f"{count} components cannot be kept: an SHRM of order P = {shrm.order_p} has "
                f"{every}; ask for 1 .. {every}"
            )
        energies, vectors = np.linalg.eigh(second_moments(shrm))
        energies, vectors = np.maximum(energies[::-1], 0.0), vectors[:, ::-1]
        # Entry k is what k components leave. Sums of the small ones alone: no cancellation.
        left = np.append(np.cumsum(energies[::-1])[::-1], 0.0)
        errors = np.sqrt(left / left[0]) if left[0] > 0 else np.zeros(every + 1)
        if count is None:
            count = max(int(np.argmax(errors <= tolerance)), 1)
        matrix = vectors[:, :count].T
        # The sign of an eigenvector is arbitrary: the largest entry is positive.
        peaks = np.take_along_axis(matrix, np.abs(matrix).argmax(axis=1)[:, None], axis=1)
        matrix = matrix * np.where(peaks < 0, -1.0, 1.0)
        planes = np.moveaxis(shrm.coefficients, (2, 3), (0, 1))
        flat = matrix.astype(planes.dtype) @ planes.reshape(every, -1)
        components = flat.reshape(count, *planes.shape[1:]).transpose(2, 3, 0, 1)
        info = replace(shrm.info, added_error=float(np.hypot(shrm.info.added_error, errors[count])))
        return cls(components, matrix, shrm.frame, shrm.center, info, shrm.sampling)

    def expand(self) -> Shrm:
        """The SHRM of all coefficients."""
        planes = np.moveaxis(self.components, (2, 3), (0, 1))
        flat = self.matrix.T.astype(planes.dtype) @ planes.reshape(self.count, -1)
        shaped = flat.reshape(-1, *planes.shape[1:]).transpose(2, 3, 0, 1)
        return Shrm(shaped, self.frame, self.center, self.info, self.sampling)

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Reflected radiance, shape (..., 3), as `Shrm.radiance` gives it."""
        return self._expanded.radiance(normals, views)

    def central_radiance(self, centers: ArrayLike, views: ArrayLike) -> Array:
        """Radiance by central directions instead of normals."""
        return self._expanded.central_radiance(centers, views)

    @cached_property
    def _expanded(self) -> Shrm:
        return self.expand()
