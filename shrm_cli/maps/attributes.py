"""The ``shrm:`` attributes of a map's parts: how they are written, and how they are checked."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli import __release__, vocabulary
from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.files.parts import StoredPart, sound_primaries
from shrm_cli.maps import registry
from shrm_cli.maps.info import MapInfo

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
    """Return the attributes that every part of a map carries.

    `order_p` is the order P of the map, which may be lower than that of its BRDF.
    """
    info = reflection_map.info
    if not np.isfinite([info.predicted_error, info.filter_error, info.added_error]).all():
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


def read_numbers(part: StoredPart, name: str, shape: tuple[int, ...]) -> Array | None:
    """Read an attribute of nested lists of finite numbers of some shape, in JSON, or None."""
    from shrm_cli.files.json_text import parse_json

    text = part.attribute(f"shrm:{name}")
    try:
        values = np.array(parse_json(text))
    except (ValueError, TypeError, OverflowError):
        return None
    if values.shape != shape or values.dtype.kind not in "fiu":
        return None
    return values.astype(float) if np.isfinite(values).all() else None


def has_map_attributes(part: StoredPart) -> bool:
    """Whether a part says that it is a map."""
    return isinstance(part.attribute("shrm:representation"), str)


def read_attributes(part: StoredPart) -> dict[str, Any]:
    """Read the ``shrm:`` attributes of a part, and check that they have the right types and values.

    Returns the value of each attribute by its name without the prefix ``shrm:``.
    """
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
    """Return how a map was made, from the attributes of one of its parts.

    `attributes` are the attributes of the part, as `read_attributes` returns them.
    """
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
