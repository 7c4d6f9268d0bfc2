"""Explicit maps made image by image in the angular domain, as they were before SHRMs."""

from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.info import MapInfo
from shrm_cli.progress import Progress
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.directions import to_angles
from shrm_cli.vocabulary import Center, Sampling

Array = NDArray[np.floating]
Kind = TypeVar("Kind", bound=ExplicitMap)


class Integral(Protocol):
    """What is asked of an integration in the angular domain."""

    def central_radiance(self, centers: Array, views: Array) -> Array:
        """Radiance, shape (..., 3), by central directions and views, unit, world axes."""

    def zonal_radiance(self, centers: Array, view_theta: float) -> Array:
        """Its mean over the views at an angle (radians) from central directions (..., 3)."""


def tabulate(
    kind: type[Kind],
    integral: Integral,
    center: Center,
    info: MapInfo,
    size: int,
    view_count: int,
    sampling: Sampling = "center",
    progress: Progress | None = None,
) -> Kind:
    """A map of a kind, by one integral for each texel of each image.

    Parameters
    ----------
    kind : type of ExplicitMap
    integral : Integral
    center, info, sampling
        Attributes of the map.
    size : int
        Texels along a face's edge.
    view_count : int
        Samples along an axis of the view.
    progress : callable, optional
        Called with images done and images in all.

    Raises
    ------
    MapError
        If it would be too large.
    """
    count = kind.image_count(view_count)
    kind.check_memory(size, count)
    images = np.empty((count, 3, 6 * size, size), dtype=np.float32)
    texels = cube_directions(size, sampling)
    for index, view in enumerate(kind.sample_views(count)):
        if kind.frame == "local":
            image = integral.zonal_radiance(texels, float(to_angles(view)[0]))
        else:
            image = integral.central_radiance(texels, view)
        images[index] = np.moveaxis(image, -1, 0)
        if progress is not None:
            progress(index + 1, count)
    return kind(images.transpose(0, 2, 3, 1), center, info, sampling)
