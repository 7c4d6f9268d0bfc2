"""Maps of every representation -> the parts and channels of a file."""

import json
import os

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.files.exr import Part, write_parts
from shrm_cli.files.image import envmap_attribute
from shrm_cli.layouts import Layout
from shrm_cli.maps.arrangement import Arrangement
from shrm_cli.maps.attributes import common_header, shortest
from shrm_cli.maps.codecs import codec
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.explicit.kautz_mccool import KautzMcCool
from shrm_cli.maps.light_map import EngineMap
from shrm_cli.maps.names import (
    COLOURS,
    component_channels,
    part_names,
    shrm_channels,
    term_names,
    view_attributes,
)
from shrm_cli.maps.representations import Map
from shrm_cli.maps.shrm.compressed import CompressedShrm
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.vocabulary import Orientation

Array = NDArray[np.floating]


def write_map(
    path: str | os.PathLike[str],
    reflection_map: Map,
    precision: str = "auto",
    layout: Layout = "openexr",
    orientation: Orientation = "openexr",
) -> str:
    """Write a map, whole or not at all.

    Parameters
    ----------
    path : path-like
    reflection_map : Map
    precision : {"auto", "half", "float"}
        ``auto`` is half unless a value exceeds its range; of an SH exponential it is float.
    layout, orientation
        Of the images: OpenEXR's stacked cube by default.

    Returns
    -------
    str
        The pixel type written, ``"half"`` or ``"float"``.

    Raises
    ------
    OutputError
        If half would overflow, or the file cannot be written.
    MapError
        If a local map is to be resampled: local axes turn about +-Z from texel to texel.
    """
    arrangement = Arrangement(layout, orientation, reflection_map.sampling)
    if layout == "latlong" and reflection_map.frame == "local" and not _is_zonal(reflection_map):
        raise MapError(
            f"{path}: a local map cannot be resampled as a lat-long; take --frame global"
        )
    if isinstance(reflection_map, SummedShrm) and not arrangement.is_plain:
        raise MapError(f"{path}: a sum of terms is written as OpenEXR's cube only")
    kind = reflection_map.representation
    if kind in ("splitsum", "she") and not arrangement.is_plain:
        raise MapError(f"{path}: a map of representation {kind} is written as OpenEXR's cube only")
    if kind == "she" and precision == "auto":
        precision = "float"  # a few hundred bytes, and exponents
    parts = _encode(reflection_map)
    if not arrangement.is_plain:
        parts = [_arranged(part, arrangement) for part in parts]
    elif arrangement.sampling == "border":
        parts = [
            Part(part.channels, {**part.header, **envmap_attribute("openexr")}) for part in parts
        ]
    return write_parts(path, parts, precision)


def _is_zonal(reflection_map: Map) -> bool:
    """Whether what a local map holds does not depend on how its frames turn about C."""
    if isinstance(reflection_map, Shrm):
        return reflection_map.azimuth_free
    return isinstance(reflection_map, KautzMcCool)


def _encode(reflection_map: Map) -> list[Part]:
    if isinstance(reflection_map, EngineMap):
        parts: list[Part] = codec(reflection_map.representation).encode(reflection_map)
        return parts
    if isinstance(reflection_map, ExplicitMap):
        return _encode_explicit(reflection_map)
    if isinstance(reflection_map, SummedShrm):
        return _encode_sum(reflection_map)
    header = common_header(reflection_map, reflection_map.order_p)
    if isinstance(reflection_map, CompressedShrm):
        rows = [[shortest(x) for x in row] for row in reflection_map.matrix]
        header |= {"shrm:version": 2, "shrm:pca_matrix": json.dumps(rows)}
        names = component_channels(reflection_map.count)
        return [Part(_channels(names, reflection_map.components), header)]
    channels = _channels(shrm_channels(reflection_map.order_p), reflection_map.coefficients)
    if reflection_map.azimuth_free:
        zonal = shrm_channels(reflection_map.order_p, zonal=True)
        channels = {name: channels[name] for name in zonal}
    return [Part(channels, header)]


def _encode_sum(reflection_map: SummedShrm) -> list[Part]:
    """A part for each term; what is known of the sum stands on all of them."""
    size, info = reflection_map.size, reflection_map.info
    whole = {
        "shrm:version": 2,
        "shrm:predicted_error": float(info.predicted_error),
        "shrm:brdf_energy_captured": float(info.captured),
        "shrm:epsilon": float(info.tolerance),
        "displayWindow": (np.array([0, 0], np.int32), np.array([size - 1, 6 * size - 1], np.int32)),
    }
    if info.added_error:
        whole["shrm:added_error"] = float(info.added_error)
    parts = [part for term in reflection_map.terms for part in _encode(term)]
    names = term_names(len(parts))
    return [
        Part(part.channels, {"name": name, **part.header, **whole})
        for name, part in zip(names, parts, strict=True)
    ]


def _encode_explicit(reflection_map: ExplicitMap) -> list[Part]:
    header = common_header(reflection_map, reflection_map.info.order_p)
    kind, count = type(reflection_map), reflection_map.count
    return [
        Part({c: image[..., k] for k, c in enumerate(COLOURS)}, {"name": name, **header, **view})
        for name, view, image in zip(
            part_names(kind, count), view_attributes(kind, count), reflection_map.images,
            strict=True,
        )
    ]  # fmt: skip


def _channels(names: list[str], values: Array) -> dict[str, Array]:
    """Planes of values (6N, N, maps, 3) by name."""
    flat = [values[..., index, k] for index in range(values.shape[2]) for k in range(3)]
    return dict(zip(names, flat, strict=True))


def _arranged(part: Part, arrangement: Arrangement) -> Part:
    image = arrangement.apply(np.stack(list(part.channels.values()), axis=-1))
    header = {
        **part.header,
        "shrm:version": max(part.header["shrm:version"], 2),
        "shrm:layout": arrangement.layout,
        "shrm:orientation": arrangement.orientation,
        "shrm:sampling": arrangement.sampling,
    }
    return Part({name: image[..., k] for k, name in enumerate(part.channels)}, header)
