"""How maps lie in files, whatever their representation: laid out, written, and read by images.

A file is laid out as OpenEXR stacks a cube, unless somebody asks for another layout. What is read
again is an image of an opened file: its part, its attributes, and its layout.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from shrm_cli import vocabulary
from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.files.parts import Part, Storage, StoredPart, prepared, write_chosen
from shrm_cli.maps.attributes import COLORS, map_info, options_text, read_attributes
from shrm_cli.records import record

if TYPE_CHECKING:
    from shrm_cli.maps.base import Map

_ALLOWED = 0.1
"""The part of a map's own error that storing it in half precision may add."""


def store(
    path: str | os.PathLike[str],
    reflection_map: Map,
    precision: vocabulary.Precision = "auto",
    layout: str = "openexr",
    orientation: vocabulary.Orientation = "openexr",
) -> Storage:
    """Write a map to a file, completely or not at all.

    The `precision` ``auto`` is float for an SH exponential. For other maps it is half unless a
    value exceeds the range of half, or half would make an error of more than a tenth of the map's
    own. `layout` and `orientation` are the layout of the images and the orientation of cube faces;
    OpenEXR's stacked cube by default.

    Returns the pixel type written, and the error that it makes. An error beyond ordinary rounding
    is written into the file as well.
    """
    arrangement = Arrangement(layout, orientation, reflection_map.sampling)
    if layout == "latlong" and reflection_map.turns_with_texels:
        raise MapError(
            f"{path}: a local map cannot be resampled as a lat-long; take `frame` global"
        )
    if not (arrangement.is_plain or reflection_map.is_rearrangeable):
        raise MapError(f"{path}: {reflection_map.what} is written as OpenEXR's cube only")
    asked = precision
    if precision == "auto":
        precision = reflection_map.natural_precision
    parts = [arrangement.arranged(part) for part in reflection_map.encode()]
    info = reflection_map.stored.info
    allowed = _ALLOWED * float(np.hypot(info.predicted_error, info.added_error))
    storage, parts = prepared(path, parts, precision, allowed)
    if storage.error:
        for part in parts:
            part.header["shrm:storage_error"] = float(np.hypot(storage.error, info.storage_error))
    if info.options and asked != "auto":
        for part in parts:
            part.header["shrm:options"] = options_text({**info.options, "precision": asked})
    write_chosen(path, parts, storage.pixel_type)
    return storage


@record
class Arrangement:
    """How the planes of a file are laid out.

    Raises MapError if maps are not laid out so.
    """

    layout: vocabulary.Layout = "openexr"
    """A cube layout in one image, or ``latlong``."""
    orientation: vocabulary.Orientation = "openexr"
    """How the faces of a cube are turned."""
    sampling: vocabulary.Sampling = "center"
    """Where the edge texels of the cube lie. A lat-long is sampled at its pixel centres."""

    def __post_init__(self) -> None:
        if not _holds_maps(self.layout):
            raise MapError(f"maps are not written as {self.layout}; use latlong or a cube layout")

    @property
    def is_plain(self) -> bool:
        """Whether this is OpenEXR's stacked cube, the arrangement of maps in memory."""
        return (self.layout, self.orientation) == ("openexr", "openexr")

    def apply(self, stack: Array) -> Array:
        """Lay out a stacked cube of this sampling, shape (6N, N, C), in this arrangement.

        A lat-long gets a height of 2N, which keeps the resolution at the equator.
        """
        from shrm_cli.probe.image import arrange_faces
        from shrm_cli.sphere.cube import CubeSampler
        from shrm_cli.sphere.grid.latlong import latlong_directions

        if self.layout == "latlong":
            height = 2 * stack.shape[1]
            return CubeSampler(stack, self.sampling)(latlong_directions(2 * height, height))
        return arrange_faces(stack, self.layout, self.orientation)

    def undo(self, image: Array) -> Array:
        """Return the stacked cube, shape (6N, N, C), from an image in this arrangement."""
        from shrm_cli.probe.image import stack_faces
        from shrm_cli.sphere.cube import cube_directions
        from shrm_cli.sphere.grid.latlong import sample_latlong_cubic

        if self.layout == "latlong":
            directions = cube_directions(len(image) // 2, self.sampling)
            return sample_latlong_cubic(image, directions)
        return stack_faces(image, self.layout, self.orientation)

    def arranged(self, part: Part) -> Part:
        """Lay out the planes of a part in this arrangement, and add attributes that say so."""
        if part.is_table:
            return part
        if self.is_plain:
            envmap = {"envmap": "openexr"} if self.sampling == "border" else {}
            return Part(part.channels, {**part.header, **envmap})
        image = self.apply(np.stack(list(part.channels.values()), axis=-1))
        header = {
            **part.header,
            "shrm:version": max(part.header["shrm:version"], 2),
            "shrm:layout": self.layout,
            "shrm:orientation": self.orientation,
            "shrm:sampling": self.sampling,
        }
        return Part(image_channels(image, list(part.channels)), header)

    def cube_size(self, width: int, height: int) -> int | None:
        """Return the texels along a face's edge of the cube in an image of this size in pixels.

        The result is None if no image in this arrangement has that size.
        """
        if self.layout == "latlong":
            return height // 2 if width == 2 * height and height % 2 == 0 and height else None
        return vocabulary.CUBES[self.layout].face_size(width, height)


def _holds_maps(layout: vocabulary.Layout) -> bool:
    """Whether a layout may hold the planes of a map: a lat-long or a cube in one image may."""
    return layout == "latlong" or (
        layout in vocabulary.CUBES and layout in vocabulary.IMAGE_LAYOUTS
    )


@record
class StoredImage:
    """A part of a map's file, with its checked attributes."""

    part: StoredPart
    attributes: dict[str, Any]
    """The attributes of the part, as `read_attributes` returns them."""
    arrangement: Arrangement
    """How the part is laid out."""
    size: int

    @classmethod
    def of(cls, part: StoredPart) -> StoredImage:
        """Return the image in a part."""
        attributes = read_attributes(part)
        path, layout = part.path, attributes["layout"]
        if not _holds_maps(layout):
            raise MapError(f"{path}: maps are not laid out as {layout}; make it again")
        sampling: vocabulary.Sampling = "border" if part.border_sampled else "center"
        sampling = attributes["sampling"] or sampling
        arrangement = Arrangement(layout, attributes["orientation"], sampling)
        size = arrangement.cube_size(part.width, part.height)
        if size is None or size > vocabulary.MAX_CUBE_SIZE:
            what = "a cube of 1:6" if layout == "openexr" else layout
            raise MapError(f"{path}: {part.width} x {part.height} is not {what}")
        return cls(part, attributes, arrangement, size)

    @property
    def path(self) -> str:
        """The path of the file, for messages."""
        return self.part.path

    def common(self) -> dict[str, Any]:
        """Return arguments that the constructors of maps have in common."""
        return {
            "center": self.attributes["center"],
            "info": map_info(self.attributes, self.part),
            "sampling": self.arrangement.sampling,
        }

    def check_channels(self, names: Sequence[str], what: str) -> None:
        """Check that the part has exactly these channels.

        `names` are the names of the channels. `what` is what the channels make up, for the message.
        """
        if not self.part.holds(names):
            raise MapError(f"{self.path}: its channels are not those of {what}")

    def check_resampling(self, turns_with_texels: bool) -> None:
        """Refuse a lat-long of values that cannot be interpolated between texels.

        `turns_with_texels` says whether the values belong to local axes, which turn from texel to
        texel.
        """
        if self.arrangement.layout == "latlong" and turns_with_texels:
            raise MapError(f"{self.path}: a local map cannot be a lat-long; make it again")

    def stack(self, names: Sequence[str]) -> Array:
        """Read channels as an OpenEXR cube, shape (6N, N, len(names)).

        Raises MapError if the file is damaged.
        """
        wanted = self.part.read(names)
        return wanted if self.arrangement.is_plain else self.arrangement.undo(wanted)


def image_channels(image: Array, names: Sequence[str] = COLORS) -> dict[str, Array]:
    """Return the channels of a part that holds an image of shape (H, W, len(names))."""
    return {name: image[..., k] for k, name in enumerate(names)}
