"""Making explicit maps image by image, by evaluating an integral or another map at every texel."""

from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np

from shrm_cli import progress
from shrm_cli.arrays import Array
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.principal.principal import PrincipalMap
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.directions import to_angles
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.vocabulary import Center, Sampling

Kind = TypeVar("Kind", bound=ExplicitMap)

_PAIRS = 4096
"""The pairs of central directions and views at which the error of a tabulated sum is measured."""


class Integral(Protocol):
    """What `tabulate` needs of an integral in the angular domain, or of another map."""

    def central_radiance(self, centers: Array, views: Array) -> Array:
        """Evaluate the radiance for central directions and views.

        Parameters
        ----------
        centers, views : ndarray, shape (..., 3), broadcastable
            Unit vectors in world axes.

        Returns
        -------
        ndarray, shape (..., 3)
        """

    def zonal_radiance(self, centers: Array, view_theta: float) -> Array:
        """Average the radiance over the azimuth of the view about central directions.

        Parameters
        ----------
        centers : ndarray, shape (..., 3)
            Unit vectors in world axes.
        view_theta : float
            The angle between the view and the central direction, radians.

        Returns
        -------
        ndarray, shape (..., 3)
        """


def tabulate(
    kind: type[Kind],
    integral: Integral,
    center: Center,
    info: MapInfo,
    size: int,
    view_count: int,
    sampling: Sampling = "center",
) -> Kind:
    """Make an explicit map of a given kind, by one integral for each texel of each image.

    Parameters
    ----------
    kind : type of ExplicitMap
    center, info, sampling
        Attributes of the map.
    size : int
        Texels along a face's edge.
    view_count : int
        Samples along an axis of the view.

    Raises
    ------
    MapError
        If the map would be too large.
    """
    count = kind.image_count(view_count)
    kind.check_images(size, count)
    images = np.empty((count, 3, 6 * size, size), dtype=np.float32)
    texels = cube_directions(size, sampling)
    for index, view in enumerate(kind.sample_views(count)):
        if kind.frame == "local":
            image = integral.zonal_radiance(texels, float(to_angles(view)[0]))
        else:
            image = integral.central_radiance(texels, view)
        images[index] = np.moveaxis(image, -1, 0)
        progress.report(index + 1, count)
    return kind(images.transpose(0, 2, 3, 1), center, info, sampling)


def tabulate_sum(
    kind: type[Kind], summed: SummedShrm | PrincipalMap, view_count: int | None = None
) -> Kind:
    """Tabulate a sum of terms as an explicit map over the mirror direction.

    Parameters
    ----------
    kind : type of ExplicitMap
    view_count : int, optional
        Samples along an axis of the view; `ExplicitMap.default_view_count` of the largest P by
        default.

    Raises
    ------
    MapError
        If the map would be too large.
    """
    if view_count is None:
        view_count = kind.default_view_count(max(summed.info.order_p, 1))
    made = tabulate(
        kind, summed, "reflection", summed.info, summed.size, view_count, summed.sampling
    )
    centers = spiral_directions(_PAIRS)
    views = np.random.default_rng(0).permutation(centers)
    exact = summed.central_radiance(centers, views)
    error = np.sum((made.central_radiance(centers, views) - exact) ** 2)
    added = np.sqrt(error / max(float(np.sum(exact**2)), 1e-300))
    info = replace(summed.info, added_error=float(np.hypot(summed.info.added_error, added)))
    return replace(made, info=info)
