"""How maps lie in files, whatever their representation: ``shrm:`` attributes, and images.

A file is laid out as OpenEXR stacks a cube, unless somebody asks for another layout. What is read
again is an image of an opened file: its part, its attributes, and its layout.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli import __release__, vocabulary
from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.files.parts import Part, Storage, StoredPart, prepared, sound_primaries, write_chosen
from shrm_cli.maps import registry
from shrm_cli.maps.info import MapInfo
from shrm_cli.records import record

if TYPE_CHECKING:
    from shrm_cli.maps.base import Map

VERSION = 7
"""The newest version of the format of files that this version of `shrm` reads.

Compressed maps, sums of terms and other layouts than OpenEXR's cube are written as version 2, and
irradiance, split sums and SH exponentials as version 3, principal functions as version 4, and
product textures as version 5. Maps with lamps beside them are written as version 6, and as
version 7 with a table of what their BRDF reflects of these. All other maps are written as version
1, which earlier versions of `shrm` read too.
"""

COLORS = "RGB"
"""The channels of an image, and the last letters of the channels of a part with many images."""

_DIGITS = 6, 7, 8, 9
"""Six significant digits pass through 32-bit floats, and nine tell all of them apart."""
_USUAL = 1e-13, 1e22
"""Sizes of numbers whose digits are told by exact powers of ten, the largest of which is 10^22."""
_MOST_DEPTH = 4
"""The most lists and objects within each other in the record of a BRDF."""
_MOST_TEXT = 1024
"""The most characters of a text."""
_LARGEST = 1e6
"""The largest error that is sound; relative errors beyond 1 mean a useless map already."""
_MOST_NAME = 40
"""The most characters of an unknown representation's name that an error message quotes."""


def common_header(reflection_map: Map, order_p: int) -> dict[str, Any]:
    """Return the attributes that every part of a map carries."""
    info = reflection_map.info
    if not np.isfinite(list(info.errors.values())).all():
        raise MapError(
            f"{info.probe}: the error of its map cannot be computed, because the light is too "
            "bright for 32-bit floats; dim it, or give `clamp`"
        )
    header: dict[str, Any] = {
        "shrm:representation": reflection_map.representation,
        "shrm:version": reflection_map.format_version,
        "shrm:program": __release__,
        "shrm:sources": registry.sources(reflection_map.representation),
        "shrm:frame": reflection_map.frame,
        "shrm:center": reflection_map.center,
        "shrm:P": order_p,
    }
    values = {
        **vars(info),
        "brdf": json.dumps(info.brdf, sort_keys=True),
        "carried": -1 if info.order_carried == info.order_f else info.order_carried,
        "options": options_text(info.options),
    }
    for name, each in _ATTRIBUTES.items():
        if each.field and values[each.field] != each.default:
            header[f"shrm:{name}"] = each.kind(values[each.field])
    if info.chromaticities is not None:
        header["chromaticities"] = tuple(info.chromaticities)
    return header


def options_text(options: Mapping[str, Any]) -> str:
    """Return the options of prefiltering as a file holds them."""
    return json.dumps(options, sort_keys=True)


def shortest(value: float) -> float:
    """Return the number with the fewest decimals that rounds to the same float32.

    The result is 0.03, for example, and not 0.029999999329447746.
    """
    # str() would depend on numpy's print options, which other libraries may set.
    return float(np.format_float_scientific(np.float32(value), unique=True))


def shortest_values(values: ArrayLike) -> list[float]:
    """Return `shortest` of many numbers, flat, in a tenth of the time."""
    single = np.asarray(values, np.float32).ravel()
    exact = single.astype(float)
    sizes = np.abs(exact)
    is_usual = (sizes >= _USUAL[0]) & (sizes < _USUAL[1])
    found = exact.copy()
    left = np.flatnonzero(is_usual)
    # What fewer digits tell is found among six, whose trailing zeros a float does not have.
    for digits in _DIGITS:
        places = digits - 1 - np.floor(np.log10(sizes[left]))
        # Negative powers of ten are not exact, and the quotient would be off by a rounding.
        scale = 10.0 ** np.abs(places)
        is_fine = places >= 0
        whole = np.rint(np.where(is_fine, exact[left] * scale, exact[left] / scale))
        rounded = np.where(is_fine, whole / scale, whole * scale)
        is_same = rounded.astype(np.float32) == single[left]
        found[left[is_same]] = rounded[is_same]
        left = left[~is_same]
    for i in np.flatnonzero(~is_usual & (sizes > 0)):
        found[i] = shortest(exact[i])
    return [float(value) for value in found]


def read_numbers(part: StoredPart, name: str, shape: tuple[int, ...] | None = None) -> Array | None:
    """Read an attribute of nested lists of finite numbers in JSON, of a shape or any, or None."""
    from shrm_cli.files.json_text import parse_json

    text = part.attribute(f"shrm:{name}")
    try:
        values = np.array(parse_json(text))
    except (ValueError, TypeError, OverflowError):
        return None
    if values.shape != (shape or values.shape) or values.dtype.kind not in "fiu":
        return None
    return values.astype(float) if np.isfinite(values).all() else None


def has_map_attributes(part: StoredPart) -> bool:
    """Whether a part says that it is a map."""
    return isinstance(part.attribute("shrm:representation"), str)


def read_attributes(part: StoredPart) -> dict[str, Any]:
    """Read the ``shrm:`` attributes of a part, checked, by their names without the prefix."""
    from shrm_cli.files.json_text import parse_json

    path, found = part.path, part.attribute("shrm:representation")
    if not isinstance(found, str) or not found:
        raise MapError(f"{path}: an image, but not a map; shrm prefilter makes maps")
    version = part.attribute("shrm:version")
    if isinstance(version, int) and version > VERSION:
        raise MapError(f"{path}: written by a newer shrm (format {version}); update shrm")
    if not registry.is_known(found):
        name = repr(found[:_MOST_NAME])
        raise MapError(f"{path}: a map of representation {name}, which this version cannot read")
    result: dict[str, Any] = {"representation": found}
    for name, each in _ATTRIBUTES.items():
        value: Any = part.attribute(f"shrm:{name}")
        if value is None:
            # An empty string reads as missing: the library that reads files leaves it out.
            value = "" if each.default is None and each.kind is str else each.default
        if isinstance(value, str):  # bytes that are not valid text could not be printed
            value = value.encode("utf-8", "replace").decode()
        is_sound = type(value) is each.kind and each.is_valid(value)
        if not is_sound:
            raise MapError.of_attribute(path, name)
        result[name] = shortest(value) if each.kind is float else value
    held = {name: parse_json(result[name], _MOST_DEPTH) for name in ("brdf", "options")}
    return {**result, **held}


def map_info(attributes: dict[str, Any], part: StoredPart) -> MapInfo:
    """Return how a map was made, from the attributes of one of its parts."""
    values = {each.field: attributes[name] for name, each in _ATTRIBUTES.items() if each.field}
    values["carried"] = None if attributes["carried"] < 0 else attributes["carried"]
    primaries = sound_primaries(part.attribute("chromaticities"))
    return MapInfo(order_p=attributes["P"], chromaticities=primaries, **values)


def _is_json_object(text: str) -> bool:
    from shrm_cli.files.json_text import parse_json

    try:
        return isinstance(parse_json(text, _MOST_DEPTH), dict)
    except ValueError:
        return False


def _is_size(value: float) -> bool:
    return 0 <= value <= _LARGEST


def _is_text(value: str) -> bool:
    return len(value) <= _MOST_TEXT


class _Attribute(NamedTuple):
    """An attribute of a map."""

    kind: type
    is_valid: Callable[[Any], bool]
    """A condition that its value must meet."""
    field: str = ""
    """The field of `MapInfo` that it holds, if it holds one."""
    default: Any = None
    """What a part has that lacks it, and why it is not written; None where none may lack it."""


_ATTRIBUTES = {
    "version": _Attribute(int, lambda value: value >= 1),
    "frame": _Attribute(str, vocabulary.FRAMES.__contains__),
    "center": _Attribute(str, vocabulary.CENTERS.__contains__),
    "F": _Attribute(int, lambda value: 0 <= value <= vocabulary.MAX_ORDER_F, "order_f"),
    "P": _Attribute(int, lambda value: 0 <= value <= vocabulary.MAX_ORDER_P),
    "epsilon": _Attribute(float, _is_size, "eps"),
    "brdf_energy_captured": _Attribute(float, math.isfinite, "captured"),
    "predicted_error": _Attribute(float, _is_size, "predicted_error"),
    "brdf": _Attribute(str, _is_json_object, "brdf"),
    "probe": _Attribute(str, _is_text, "probe"),
    "probe_sha256": _Attribute(str, _is_text, "probe_sha256"),
    "added_error": _Attribute(float, _is_size, "added_error", 0.0),
    "fit_residual": _Attribute(float, _is_size, "fit_residual", 0.0),
    "carried": _Attribute(int, lambda value: -1 <= value <= vocabulary.MAX_ORDER_F, "carried", -1),
    "filter_error": _Attribute(float, _is_size, "filter_error", 0.0),
    "storage_error": _Attribute(float, _is_size, "storage_error", 0.0),
    "domain": _Attribute(str, vocabulary.DOMAINS.__contains__, "domain", "frequency"),
    "options": _Attribute(str, _is_json_object, "options", "{}"),
    "program": _Attribute(str, _is_text),
    "sources": _Attribute(str, _is_text),
    "layout": _Attribute(str, vocabulary.LAYOUTS.__contains__, default="openexr"),
    "orientation": _Attribute(str, vocabulary.ORIENTATIONS.__contains__, default="openexr"),
    "sampling": _Attribute(str, ("", *vocabulary.SAMPLINGS).__contains__),
}
"""The attributes of maps by their names."""


# ---- maps in files -------------------------------------------------------------------------------


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
    for name, value, known in (
        ("orientation", orientation, vocabulary.ORIENTATIONS),
        ("precision", precision, vocabulary.PRECISIONS),
    ):
        if value not in known:
            raise ArgumentError(name, f"is {value!r}; give one of {', '.join(known)}")
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
    """How the planes of a file are laid out."""

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
        """Check that the part has exactly these channels."""
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
        """Read channels as an OpenEXR cube, shape (6N, N, len(names))."""
        wanted = self.part.read(names)
        return wanted if self.arrangement.is_plain else self.arrangement.undo(wanted)


def color_channels(name: str, count: int) -> list[str]:
    """Return the names of the channels of many images: ``map000.R map000.G map000.B map001.R``."""
    return [f"{name}{k:03d}.{color}" for k in range(count) for color in COLORS]


def image_channels(image: Array, names: Sequence[str] = COLORS) -> dict[str, Array]:
    """Return the channels of a part that holds an image of shape (H, W, len(names))."""
    return {name: image[..., k] for k, name in enumerate(names)}
