"""Explicit (tabular) maps: one cube of reflected light for each of some views (section 5.3.2).

What they have in common: an image belongs to a sample of the view, and what lies between the
samples is interpolated linearly. As the SHRM is linear in the harmonics of the view too, each of
them is a matrix away from it: the harmonics at the samples lead to the images (section 5.6.2),
and a least-squares fit leads back.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.brdf.centers import central_directions
from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.size import MAX_VALUES
from shrm_cli.sphere.cube import cube_solid_angles
from shrm_cli.sphere.harmonics import order_of, real_harmonics
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.sphere.sampling import CubeSampler
from shrm_cli.vocabulary import Center, Frame, Sampling

Array = NDArray[np.floating]
Indices = NDArray[np.intp]

_RANK_TOLERANCE = 1e-6
_VIEWS = 4096
"""At which the error of interpolating is measured."""
_NOISE = 0.02
"""Part of an error that rounding the images to half can feign."""


@dataclass(frozen=True)
class ExplicitMap(ABC):
    """Reflected light tabulated over the central direction and samples of the view.

    Attributes
    ----------
    images : ndarray, shape (K, 6N, N, 3)
        An OpenEXR cube of central directions for each sample of the view.
    center : {"reflection", "normal", "tangent"}
        What the central direction is.
    info : MapInfo
    sampling : {"center", "border"}
    """

    images: Array
    center: Center
    info: MapInfo
    sampling: Sampling = "center"
    _samplers: dict[int, CubeSampler] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    representation: ClassVar[str]
    frame: ClassVar[Frame] = "global"
    """Axes of the samples of the view: the world's, or those of each central direction."""

    def __post_init__(self) -> None:
        shape = self.images.shape
        if len(shape) != 4 or shape[1] != 6 * shape[2] or shape[3] != 3:
            raise ValueError(f"images of shape {shape}, not (K, 6N, N, 3)")
        self.check_count(shape[0])

    @property
    def count(self) -> int:
        """Images K."""
        return len(self.images)

    @property
    def size(self) -> int:
        return self.images.shape[2]

    # ---- what a representation states --------------------------------------------------------

    @classmethod
    @abstractmethod
    def image_count(cls, view_count: int) -> int:
        """Images of a map with so many samples along an axis of the view."""

    @classmethod
    @abstractmethod
    def check_count(cls, count: int) -> None:
        """Raise ValueError unless there are maps of so many images."""

    @classmethod
    @abstractmethod
    def sample_views(cls, count: int) -> Array:
        """Unit views of the images, shape (K, 3), in the axes that `frame` says."""

    @classmethod
    @abstractmethod
    def view_weights(cls, count: int) -> Array:
        """Weights, shape (K,), of the samples in an integral over the view."""

    @classmethod
    @abstractmethod
    def basis(cls, order_p: int, count: int) -> Array:
        """Harmonics that a map can hold, at its samples, shape (K, (P+1)^2)."""

    @classmethod
    @abstractmethod
    def blend(cls, centers: Array, views: Array, count: int) -> tuple[Indices, Array]:
        """Images between which a view lies, and their weights.

        Parameters
        ----------
        centers, views : ndarray, shape (..., 3), broadcastable
            World axes.
        count : int

        Returns
        -------
        indices, weights : ndarray, shape (..., k)
            The weights sum to 1.
        """

    # ---- from and to SHRMs -------------------------------------------------------------------

    @classmethod
    def default_view_count(cls, order_p: int) -> int:
        """Samples along an axis of the view: T about 10 P (section 5.5.2)."""
        return max(10 * order_p, 1)

    @classmethod
    def check_memory(cls, size: int, count: int) -> None:
        """Check that a map of so many images can be kept in memory.

        Raises
        ------
        MapError
        """
        values = 18 * size**2 * count
        if values > MAX_VALUES:
            raise MapError(
                f"a {cls.representation} map of {count} images of size {size} holds {values:,} "
                f"values, more than {MAX_VALUES:,}; lower --size or the number of views"
            )

    @classmethod
    def from_shrm(cls, shrm: Shrm, view_count: int | None = None) -> Self:
        """The map that tabulates an SHRM (eq. 5.25, 5.35), exactly at its samples.

        Parameters
        ----------
        shrm : Shrm
        view_count : int, optional
            Samples along an axis of the view; `default_view_count` of its order.

        Raises
        ------
        MapError
            If it would be too large.
        """
        view_count = cls.default_view_count(shrm.order_p) if view_count is None else view_count
        count = cls.image_count(view_count)
        cls.check_memory(shrm.size, count)
        source = shrm.to_frame(cls.frame)
        planes = np.moveaxis(source.coefficients, (2, 3), (0, 1))
        basis = cls.basis(shrm.order_p, count).astype(planes.dtype)
        flat = basis @ planes.reshape(len(planes), -1)
        images = flat.reshape(count, *planes.shape[1:]).transpose(0, 2, 3, 1)
        added = np.hypot(shrm.info.added_error, cls._added_error(source, count))
        info = replace(shrm.info, added_error=float(added))
        return cls(images, shrm.center, info, shrm.sampling)

    def to_shrm(self, order_p: int | None = None) -> Shrm:
        """The SHRM that fits the images best, weighted as an integral over the view.

        Its `info` holds the residual: the relative RMS of what the fit leaves of the images.

        Parameters
        ----------
        order_p : int, optional
            Of the SHRM. By default that of the map's own BRDF, as far as the samples determine
            it.

        Raises
        ------
        MapError
            If the samples do not determine so high an order.
        """
        basis = self._fit_basis(order_p)
        weights = np.sqrt(self.view_weights(self.count))[:, None]
        held = np.abs(basis).max(axis=0) > 0
        inverse = np.zeros(basis.T.shape)
        inverse[held] = np.linalg.pinv(basis[:, held] * weights, rcond=_RANK_TOLERANCE) * weights.T
        planes = np.moveaxis(self.images, 3, 1)
        flat = planes.reshape(self.count, -1)
        coefficients = inverse.astype(flat.dtype) @ flat
        rest = self._norm((flat - basis.astype(flat.dtype) @ coefficients).reshape(planes.shape))
        whole = self._norm(planes)
        info = replace(
            self.info,
            order_p=order_of(len(coefficients)),
            fit_residual=float(np.hypot(self.info.fit_residual, rest / whole if whole > 0 else 0)),
        )
        shaped = coefficients.reshape(-1, *planes.shape[1:]).transpose(2, 3, 0, 1)
        fitted = Shrm(shaped, self.frame, self.center, info, self.sampling)
        # A fit to the map's own order takes back what interpolating added, but nothing else.
        total = self.info.added_error
        is_own = order_p is None or fitted.order_p >= self.info.order_p
        own = self._added_error(fitted if is_own else self.to_shrm(), self.count)
        left = np.sqrt(max(total**2 - own**2, 0.0))
        added = float(left) if left > _NOISE * total else 0.0
        return replace(fitted, info=replace(info, added_error=added))

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Reflected radiance, interpolated between the samples of the view.

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
        shape = np.broadcast_shapes(centers.shape, views.shape)[:-1]
        centers = np.broadcast_to(centers, (*shape, 3)).reshape(-1, 3)
        indices, weights = self.blend(centers.reshape(*shape, 3), views, self.count)
        neighbours = indices.shape[-1]
        indices = np.broadcast_to(indices, (*shape, neighbours)).ravel()
        weights = np.broadcast_to(weights, (*shape, neighbours)).ravel()
        order = np.argsort(indices, kind="stable")
        order = order[weights[order] != 0]
        used, starts = np.unique(indices[order], return_index=True)
        result = np.zeros((len(centers), 3))
        for index, pairs in zip(used, np.split(order, starts[1:]), strict=False):
            points = pairs // neighbours
            values = self._sampler(int(index))(centers[points])
            np.add.at(result, points, weights[pairs, None] * values)
        return result.reshape(*shape, 3)

    # ---- inside ------------------------------------------------------------------------------

    def _sampler(self, index: int) -> CubeSampler:
        if index not in self._samplers:
            self._samplers[index] = CubeSampler(self.images[index], self.sampling)
        return self._samplers[index]

    def _fit_basis(self, order_p: int | None) -> Array:
        """Harmonics to an order, by default to the map's own as far as its samples tell them."""
        wanted = self.info.order_p if order_p is None else order_p
        for order in range(wanted, -1, -1):
            basis = self.basis(order, self.count)
            held = basis[:, np.abs(basis).max(axis=0) > 0]
            if np.linalg.matrix_rank(held, tol=_RANK_TOLERANCE) == held.shape[1]:
                if order < wanted and order_p is not None:
                    raise MapError(
                        f"{self.count} {self.representation} images determine orders up to "
                        f"P = {order}, not {order_p}; lower --order-p"
                    )
                return basis
        raise AssertionError("a single image determines P = 0")

    def _norm(self, planes: Array) -> float:
        """Root of the integral of the squares over views and texels, planes (K, 3, 6N, N)."""
        texels = np.tile(cube_solid_angles(self.size, self.sampling), (6, 1))
        squares = np.einsum("kcij,kcij,ij->k", planes, planes, texels, dtype=float)
        return float(np.sqrt(squares @ self.view_weights(self.count)))

    @classmethod
    def _added_error(cls, source: Shrm, count: int) -> float:
        """Relative RMS, over all views and texels, of what interpolating adds to an SHRM.

        The interpolated harmonics differ by ``e(V)`` from the true ones, and the light by their
        product with the coefficients, of which only the second moments over the texels matter.
        """
        views = spiral_directions(_VIEWS)
        indices, shares = cls.blend(np.array([0.0, 0.0, 1.0]), views, count)
        basis = cls.basis(source.order_p, count)
        exact = real_harmonics(source.order_p, views)
        error = np.einsum("vk,vkn->vn", shares, basis[indices]) - exact
        moments = second_moments(source)
        wrong = np.sum((error @ moments) * error)
        whole = np.sum((exact @ moments) * exact)
        return float(np.sqrt(max(wrong, 0.0) / whole)) if whole > 0 else 0.0


def second_moments(shrm: Shrm) -> Array:
    """Integrals over the texels of the products of coefficients, shape ((P+1)^2, (P+1)^2)."""
    planes = np.moveaxis(shrm.coefficients, (2, 3), (0, 1)).astype(float)
    texels = np.sqrt(np.tile(cube_solid_angles(shrm.size, shrm.sampling), (6, 1)))
    flat = (planes * texels).reshape(len(planes), -1)
    result: Any = flat @ flat.T
    return result
