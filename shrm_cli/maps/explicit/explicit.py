"""What explicit (tabular) maps have in common: one cube of reflected light for each of some views.

Each image belongs to a sample of the view, and the light between the samples is interpolated
linearly (section 5.3.2). Because the SHRM is linear in the harmonics of the view, a matrix leads
from it to the images of every such map: the harmonics at the samples (section 5.6.2). A
least-squares fit leads back.

Equations and sections 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from math import isqrt
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, Indices, relative_rms
from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo, check_names
from shrm_cli.maps.kinds import CentralMap
from shrm_cli.maps.options import checked_order_p
from shrm_cli.maps.shrm.shrm import Shrm, second_moments
from shrm_cli.messages import refuse_arguments
from shrm_cli.records import once_each, record
from shrm_cli.sphere.cube import CubeSampler, nearest_texels, texel_solid_angles
from shrm_cli.sphere.directions import bisector, central_directions
from shrm_cli.sphere.harmonics import order_of, real_harmonics
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.vocabulary import Center, Frame, Sampling

_MOST_VALUES = 2**28
"""The most values of all images: 1 GiB, of which some copies are made on the way to a file."""

_RANK_TOLERANCE = 1e-6
"""Singular values of the harmonics at the samples below this one count as zero."""
_VIEWS = 4096
"""The number of views over which the error of interpolating is measured."""
_NOISE = 0.02
"""The fraction of an added error that the images' rounding to half can imitate. A remainder below
it counts as zero."""


@record(eq=False)
class ExplicitMap(CentralMap):
    """Reflected light tabulated over the central direction and samples of the view."""

    images: Array
    """An OpenEXR cube of central directions for each sample of the view, shape (K, 6N, N, 3)."""
    center: Center
    """What the central direction is."""
    info: MapInfo
    sampling: Sampling = "center"

    representation: ClassVar[str]
    frame: ClassVar[Frame] = "global"
    """The axes of the samples of the view: those of the world, or of each central direction."""

    def __post_init__(self) -> None:
        check_names(self)
        shape = self.images.shape
        if len(shape) != 4 or shape[1] != 6 * shape[2] or shape[3] != 3:
            raise ValueError(f"images of shape {shape}, not (K, 6N, N, 3)")
        if not self.can_have(shape[0]):
            raise ValueError(f"a {self.representation} map cannot have {shape[0]} images")

    @property
    def count(self) -> int:
        """The number K of images."""
        return len(self.images)

    @property
    def cube_count(self) -> int:
        return self.count

    def planes(self) -> list[Array]:
        return list(self.images)

    def with_planes(self, planes: Sequence[Array], sampling: Sampling, info: MapInfo) -> Self:
        return replace(self, images=np.stack(planes), sampling=sampling, info=info)

    @property
    def size(self) -> int:
        return self.images.shape[2]

    # ---- what each representation defines ----------------------------------------------------

    @classmethod
    @abstractmethod
    def image_count(cls, view_count: int) -> int:
        """Return the number of images of a map with so many samples along an axis of the view."""

    @classmethod
    def can_have(cls, count: int) -> bool:
        """Whether a map can have `count` images: for samples along one axis of the view, or two."""
        return count > 0 and count in (cls.image_count(count), cls.image_count(isqrt(count)))

    @classmethod
    @abstractmethod
    def sample_views(cls, count: int) -> Array:
        """Return the views of the images as unit vectors in the axes of `frame`, shape (K, 3)."""

    @classmethod
    @abstractmethod
    def view_weights(cls, count: int) -> Array:
        """Return the weights of the samples in an integral over the view, shape (K,)."""

    @classmethod
    def basis(cls, order_p: int, count: int) -> Array:
        """Return the harmonics of the view at the samples, shape (K, (P+1)^2).

        Harmonics that the map cannot hold are zero.
        """
        return real_harmonics(order_p, cls.sample_views(count))

    @classmethod
    @abstractmethod
    def blend(cls, centers: Array, views: Array, count: int) -> tuple[Indices, Array]:
        """Return the images between which a view lies, and their weights.

        `centers` and `views`, each of shape (..., 3), broadcastable, are unit vectors in world
        axes.

        Returns `indices` and `weights`, each of shape (..., k), the images, and weights that sum to
        1.
        """

    @classmethod
    @abstractmethod
    def part_names(cls, count: int) -> list[str]:
        """Return the names of the parts of a file that hold the images."""

    @classmethod
    def view_attributes(cls, count: int) -> list[dict[str, Any]]:
        """Return, for each image, the attributes of its part that say which view it belongs to."""
        return [{"shrm:view": tuple(map(float, view))} for view in cls.sample_views(count)]

    # ---- from and to other maps --------------------------------------------------------------

    @classmethod
    def view_count(cls, slices: int | None = None, views: int | None = None) -> int | None:
        """Return the samples along an axis of the view that this kind of map is asked for.

        `slices` and `views` are the arguments of Kautz and McCool's maps and of light fields. Each
        kind of map takes its own argument or none.

        Returns None where the number is not given.
        """
        refuse_arguments(f"maps of representation {cls.representation}", slices=slices, views=views)
        return None

    @classmethod
    def default_view_count(cls, order_p: int) -> int:
        """Return the default samples along an axis of the view, T = 10 P (section 5.5.2)."""
        return max(10 * order_p, 1)

    def check_memory(self, size: int) -> None:
        self.check_images(size, self.count)

    @classmethod
    def check_images(cls, size: int, count: int) -> None:
        """Check that a map of `count` images can be kept in memory."""
        values = 18 * size**2 * count
        if values > _MOST_VALUES:
            raise MapError(
                f"a {cls.representation} map of {count} images of size {size} holds {values:,} "
                f"values, more than {_MOST_VALUES:,}; lower `size` or the number of views"
            )

    @classmethod
    def from_shrm(cls, shrm: Shrm, view_count: int | None = None) -> Self:
        """Make the map that tabulates an SHRM (eq. 5.25, 5.35); it is exact at its samples.

        `view_count` is the number of samples along an axis of the view; `default_view_count` of the
        SHRM's order by default.
        """
        view_count = cls.default_view_count(shrm.order_p) if view_count is None else view_count
        count = cls.image_count(view_count)
        cls.check_images(shrm.size, count)
        source = shrm.to_frame(cls.frame)
        planes = np.moveaxis(source.coefficients, (2, 3), (0, 1))
        basis = cls.basis(shrm.order_p, count).astype(planes.dtype)
        flat = basis @ planes.reshape(len(planes), -1)
        images = flat.reshape(count, *planes.shape[1:]).transpose(0, 2, 3, 1)
        info = shrm.info.adding(cls._added_error(source, count))
        return cls(images, shrm.center, info, shrm.sampling)

    def to_shrm(self, order_p: int | None = None, frame: Frame | None = None) -> Shrm:
        """Return the SHRM that fits the images best, weighted as an integral over the view.

        Its `info` holds the residual: the relative RMS of what the fit leaves of the images.

        `order_p` is the order P of the SHRM. By default it is that of the map's `info`, as far as
        the samples determine it. `frame` is the frame of the SHRM; that of the samples by default.
        """
        order_p = checked_order_p(order_p)
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
        # A fit to the map's own order removes the error that interpolating added, but no other.
        total = self.info.added_error
        is_own = order_p is None or fitted.order_p >= self.info.order_p
        own = self._added_error(fitted if is_own else self.to_shrm(), self.count)
        left = np.sqrt(max(total**2 - own**2, 0.0))
        added = float(left) if left > _NOISE * total else 0.0
        fitted = replace(fitted, info=replace(info, added_error=added))
        return fitted.to_frame(frame or self.frame)

    def central_radiance(self, centers: ArrayLike, views: ArrayLike) -> Array:
        centers, views = np.asarray(centers, dtype=float), np.asarray(views, dtype=float)
        shape = np.broadcast_shapes(centers.shape, views.shape)[:-1]
        centers = np.broadcast_to(centers, (*shape, 3)).reshape(-1, 3)
        indices, weights = self.blend(centers.reshape(*shape, 3), views, self.count)
        neighbors = indices.shape[-1]
        indices = np.broadcast_to(indices, (*shape, neighbors)).ravel()
        weights = np.broadcast_to(weights, (*shape, neighbors)).ravel()
        order = np.argsort(indices, kind="stable")
        order = order[weights[order] != 0]
        used, starts = np.unique(indices[order], return_index=True)
        result = np.zeros((len(centers), 3))
        for index, pairs in zip(used, np.split(order, starts[1:]), strict=False):
            points = pairs // neighbors
            values = self._sampler(int(index))(centers[points])
            np.add.at(result, points, weights[pairs, None] * values)
        return result.reshape(*shape, 3)

    def rough_radiance(self, reflections: Array, views: Array) -> Array:
        """Interpolate between the samples of the view at the nearest texels."""
        centers = central_directions(self.center, bisector(reflections, views), views)
        indices, weights = self.blend(centers, views, self.count)
        rows, columns = nearest_texels(centers, self.size, self.sampling)
        values = self.images[indices, rows[:, None], columns[:, None]]
        return np.asarray(np.sum(weights[..., None] * values, axis=1))

    # ---- private parts -----------------------------------------------------------------------

    @once_each
    def _sampler(self, index: int) -> CubeSampler:
        return CubeSampler(self.images[index], self.sampling)

    def _fit_basis(self, order_p: int | None) -> Array:
        """Return the `basis` to an order P, which the samples must determine.

        By default it is the order of the map's `info`, or the highest below that the samples
        determine.
        """
        wanted = self.info.order_p if order_p is None else order_p
        for order in range(wanted, -1, -1):
            basis = self.basis(order, self.count)
            held = basis[:, np.abs(basis).max(axis=0) > 0]
            if np.linalg.matrix_rank(held, tol=_RANK_TOLERANCE) == held.shape[1]:
                if order < wanted and order_p is not None:
                    raise MapError(
                        f"{self.count} {self.representation} images determine orders up to "
                        f"P = {order}, not {order_p}; lower `order_p`"
                    )
                return basis
        raise AssertionError("a single image determines P = 0")

    def _norm(self, planes: Array) -> float:
        """Return the root of the integral of the squares over views, texels and channels."""
        texels = texel_solid_angles(self.size, self.sampling)
        squares = np.einsum("kcij,kcij,ij->k", planes, planes, texels, dtype=float)
        return float(np.sqrt(squares @ self.view_weights(self.count)))

    @classmethod
    def _added_error(cls, source: Shrm, count: int) -> float:
        """Return the relative RMS error, over all views and texels, of interpolating an SHRM.

        The interpolated harmonics differ by ``e(V)`` from the true ones, and the light differs by
        the product of ``e(V)`` and the coefficients. The mean square of that product depends only
        on the second moments of the coefficients over the texels.
        """
        views = spiral_directions(_VIEWS)
        indices, shares = cls.blend(np.array([0.0, 0.0, 1.0]), views, count)
        basis = cls.basis(source.order_p, count)
        exact = real_harmonics(source.order_p, views)
        error = np.einsum("vk,vkn->vn", shares, basis[indices]) - exact
        moments = second_moments(source)
        wrong = np.sum((error @ moments) * error)
        whole = np.sum((exact @ moments) * exact)
        return relative_rms(max(wrong, 0.0), whole)
