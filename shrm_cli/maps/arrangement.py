"""Planes of a map in other layouts than OpenEXR's stacked cube, and back."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.layouts import CUBES, IMAGE_LAYOUTS, Layout
from shrm_cli.probe.layout import arrange_faces, stack_faces
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.latlong import latlong_directions
from shrm_cli.sphere.sampling import CubeSampler, sample_latlong_cubic
from shrm_cli.vocabulary import MAX_CUBE_SIZE, Orientation, Sampling

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Arrangement:
    """How the planes of a file are laid out.

    Attributes
    ----------
    layout : Layout
        A cube layout in one image, or ``latlong``.
    orientation : {"openexr", "gl"}
        Of cube faces.
    sampling : {"center", "border"}
        Of the cube. A lat-long is sampled at its pixel centres.
    """

    layout: Layout = "openexr"
    orientation: Orientation = "openexr"
    sampling: Sampling = "center"

    def __post_init__(self) -> None:
        if not _holds_maps(self.layout):
            raise MapError(f"maps are not written as {self.layout}; use latlong or a cube layout")

    @property
    def is_plain(self) -> bool:
        """Whether it is the cube that maps are in memory."""
        return (self.layout, self.orientation) == ("openexr", "openexr")

    def apply(self, stack: Array) -> Array:
        """A cube of channels, shape (6N, N, C), of this sampling, in this arrangement.

        A lat-long is 2N high, which keeps the resolution at the equator.
        """
        if self.layout == "latlong":
            height = 2 * stack.shape[1]
            return CubeSampler(stack, self.sampling)(latlong_directions(2 * height, height))
        return arrange_faces(stack, self.layout, self.orientation)

    def undo(self, image: Array) -> Array:
        """The cube, shape (6N, N, C), that such an image holds."""
        if self.layout == "latlong":
            directions = cube_directions(len(image) // 2, self.sampling)
            return sample_latlong_cubic(image, directions)
        return stack_faces(image, self.layout, self.orientation)

    def cube_size(self, width: int, height: int) -> int | None:
        """Texels along a face's edge of an image of this size; None if it cannot be one."""
        if self.layout == "latlong":
            return height // 2 if width == 2 * height and height % 2 == 0 and height else None
        return CUBES[self.layout].face_size(width, height)


def _holds_maps(layout: Layout) -> bool:
    """Whether the planes of a map may be laid out so: as a lat-long, or a cube in one image."""
    return layout == "latlong" or (layout in CUBES and layout in IMAGE_LAYOUTS)


def stored_arrangement(
    path: str | os.PathLike[str], spec: Any, attributes: dict[str, Any]
) -> tuple[Arrangement, int]:
    """How a part is laid out, and the texels along an edge of its cube.

    Parameters
    ----------
    path : path-like
        For messages.
    spec : ImageSpec
        Of the part.
    attributes : dict
        Of the part, as `read_attributes` finds them.

    Raises
    ------
    MapError
        If it is no such layout, or larger than maps are.
    """
    layout = attributes["layout"]
    if not _holds_maps(layout):
        raise MapError(f"{path}: maps are not laid out as {layout}; make it again")
    sampling: Sampling = "border" if spec.get_int_attribute("oiio:sampleborder") else "center"
    sampling = attributes["sampling"] or sampling
    arrangement = Arrangement(layout, attributes["orientation"], sampling)
    size = arrangement.cube_size(spec.width, spec.height)
    if size is None or size > MAX_CUBE_SIZE:
        what = "a cube of 1:6" if layout == "openexr" else layout
        raise MapError(f"{path}: {spec.width} x {spec.height} is not {what}")
    return arrangement, size
