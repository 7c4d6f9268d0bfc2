"""The shrm: attributes of a map's parts, and what of them is believed."""

import json
import math
import os
from collections.abc import Callable
from typing import Any, get_args

import numpy as np

from shrm_cli.errors import MapError
from shrm_cli.layouts import LAYOUTS
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.light_map import ENGINES, EngineMap
from shrm_cli.maps.representations import REPRESENTATIONS, Map
from shrm_cli.vocabulary import (
    MAX_ORDER_F,
    MAX_ORDER_P,
    Center,
    Domain,
    Frame,
    Orientation,
    Sampling,
)

VERSION = 3
"""2 since there are compressed maps and other layouts than OpenEXR's cube, 3 since there are
irradiance, split sums and SH exponentials; others are written as 1, which earlier versions read."""

_MOST_NAME = 40  # characters of one that is not known


def common_header(reflection_map: Map, order_p: int) -> dict[str, Any]:
    """Attributes that every part of a map carries.

    Parameters
    ----------
    reflection_map : Map
    order_p : int
        Of the map, which may be lower than that of its BRDF.
    """
    info = reflection_map.info
    header: dict[str, Any] = {
        "shrm:representation": reflection_map.representation,
        "shrm:version": 3 if isinstance(reflection_map, EngineMap) else 1,
        "shrm:frame": reflection_map.frame,
        "shrm:center": reflection_map.center,
        "shrm:F": info.order_f,
        "shrm:P": order_p,
        "shrm:epsilon": float(info.tolerance),
        "shrm:brdf_energy_captured": float(info.captured),
        "shrm:predicted_error": float(info.predicted_error),
        "shrm:brdf": json.dumps(info.brdf, sort_keys=True),
        "shrm:probe": info.probe,
        "shrm:probe_sha256": info.probe_sha256,
    }
    if info.added_error:
        header["shrm:added_error"] = float(info.added_error)
    if info.fit_residual:
        header["shrm:fit_residual"] = float(info.fit_residual)
    if info.domain != "frequency":
        header["shrm:domain"] = info.domain
    if info.chromaticities is not None:
        header["chromaticities"] = tuple(info.chromaticities)
    return header


def shortest(value: float) -> float:
    """The number of fewest decimals that is this float32: 0.03, not 0.029999999329447746."""
    # str() would obey numpy's print options, which other libraries set.
    return float(np.format_float_scientific(np.float32(value), unique=True))


def has_map_attributes(spec: Any) -> bool:
    """Whether an image says that it is a map."""
    return isinstance(spec.getattribute("shrm:representation"), str)


def read_attributes(path: str | os.PathLike[str], spec: Any) -> dict[str, Any]:
    """The shrm: attributes of a part, each of its type and within its range.

    Raises
    ------
    MapError
    """
    found = spec.getattribute("shrm:representation")
    if not isinstance(found, str) or not found:
        raise MapError(f"{path}: an image, but not a map; shrm prefilter makes maps")
    version = spec.getattribute("shrm:version")
    if isinstance(version, int) and version > VERSION:
        raise MapError(f"{path}: written by a newer shrm (format {version}); update shrm")
    if found not in (*REPRESENTATIONS, *ENGINES):
        name = repr(found[:_MOST_NAME])
        raise MapError(f"{path}: a map of representation {name}, which this version cannot read")
    result: dict[str, Any] = {"representation": found}
    for name, (kind, is_valid) in _ATTRIBUTES.items():
        value: Any = spec.getattribute(f"shrm:{name}")
        if value is None:
            # The library leaves empty strings out.
            value = _OPTIONAL.get(name, "" if kind is str else None)
        if isinstance(value, str):  # bytes that are no text could not be printed
            value = value.encode("utf-8", "replace").decode()
        is_sound = type(value) is kind and is_valid(value)
        if not is_sound:
            raise MapError(f"{path}: its attribute shrm:{name} is missing or wrong; make it again")
        result[name] = shortest(value) if kind is float else value
    return {**result, "brdf": json.loads(result["brdf"])}


def map_info(attributes: dict[str, Any], spec: Any) -> MapInfo:
    """What the attributes tell of how a map was made."""
    primaries = spec.getattribute("chromaticities")
    known = isinstance(primaries, tuple) and len(primaries) == 8
    return MapInfo(
        attributes["F"],
        attributes["P"],
        attributes["epsilon"],
        attributes["brdf_energy_captured"],
        attributes["predicted_error"],
        attributes["brdf"],
        attributes["probe"],
        attributes["probe_sha256"],
        tuple(primaries) if known else None,
        attributes["added_error"],
        attributes["fit_residual"],
        attributes["domain"],
    )


def _is_json_object(text: str) -> bool:
    try:
        return isinstance(json.loads(text), dict)
    except (ValueError, RecursionError):
        return False


# Types of the attributes that a map must have, and what their values must hold.
_ATTRIBUTES: dict[str, tuple[type, Callable[[Any], bool]]] = {
    "version": (int, lambda value: value >= 1),
    "frame": (str, get_args(Frame).__contains__),
    "center": (str, get_args(Center).__contains__),
    "F": (int, lambda value: 0 <= value <= MAX_ORDER_F),
    "P": (int, lambda value: 0 <= value <= MAX_ORDER_P),
    "epsilon": (float, math.isfinite),
    "brdf_energy_captured": (float, math.isfinite),
    "predicted_error": (float, math.isfinite),
    "brdf": (str, _is_json_object),
    "probe": (str, lambda value: True),
    "probe_sha256": (str, lambda value: True),
    "added_error": (float, math.isfinite),
    "fit_residual": (float, math.isfinite),
    "domain": (str, get_args(Domain).__contains__),
    "layout": (str, LAYOUTS.__contains__),
    "orientation": (str, get_args(Orientation).__contains__),
    "sampling": (str, ("", *get_args(Sampling)).__contains__),
}

# Those that are left out where they say nothing.
_OPTIONAL: dict[str, Any] = {
    "added_error": 0.0,
    "fit_residual": 0.0,
    "domain": "frequency",
    "layout": "openexr",
    "orientation": "openexr",
}
