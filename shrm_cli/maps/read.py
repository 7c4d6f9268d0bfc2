"""The parts and channels of a file -> maps of every representation."""

import json
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.environment.file import MEANINGS
from shrm_cli.errors import MapError
from shrm_cli.files.exr import has_channels, open_image, open_map, part_specs, read_channels
from shrm_cli.maps.arrangement import Arrangement, stored_arrangement
from shrm_cli.maps.attributes import has_map_attributes, map_info, read_attributes
from shrm_cli.maps.codecs import codec
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.light_map import ENGINES
from shrm_cli.maps.names import (
    COLOURS,
    component_channels,
    part_names,
    shrm_channels,
    term_names,
    view_attributes,
)
from shrm_cli.maps.representations import EXPLICIT, Map
from shrm_cli.maps.shrm.compressed import CompressedShrm
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.maps.size import MAX_VALUES

Array = NDArray[np.floating]


def read_map(path: str | os.PathLike[str]) -> Map:
    """Read a map that `write_map` wrote.

    Raises
    ------
    MapError
        If the file is missing, damaged, or no map.
    """
    source, specs = _open(path)
    attributes = read_attributes(path, specs[0])
    name = attributes["representation"]
    if name in ENGINES:
        is_plain = (attributes["layout"], attributes["orientation"]) == ("openexr", "openexr")
        if name != "irradiance" and not is_plain:
            raise MapError(
                f"{path}: a {name} map is never laid out as {attributes['layout']}; make it again"
            )
        engine_map: Map = codec(name).decode(path, source, specs)
        return engine_map
    stored = _stored(path, source, specs, 0)
    if name in EXPLICIT:
        return _read_explicit(stored, EXPLICIT[name])
    if len(specs) == 1:
        return _read_term(stored)
    names = [_part_name(spec) for spec in specs]
    if sorted(names) != term_names(len(specs)):
        raise MapError(f"{path}: its parts are not the terms of an SHRM; make it again")
    order = [names.index(name) for name in term_names(len(specs))]
    return _summed([_read_term(_stored(path, source, specs, part)) for part in order])


def is_map(path: str | os.PathLike[str]) -> bool:
    """Whether a readable image carries the attributes of a map."""
    source = open_image(path) if Path(path).is_file() else None
    return source is not None and has_map_attributes(source.spec())


def environment_table(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """What an environment-BRDF table (`write_dfg`) holds; None of any other file."""
    source = open_image(path) if Path(path).is_file() else None
    spec = None if source is None else source.spec()
    if spec is None or spec.get_string_attribute("shrm:table") != "dfg":
        return None
    multiscatter = spec.get_int_attribute("shrm:multiscatter") != 0
    moments = spec.get_int_attribute("shrm:moments") != 0
    meaning = MEANINGS["moments" if moments else "multiscatter" if multiscatter else "scale-bias"]
    found = {
        "width": spec.width,
        "height": spec.height,
        "multiscatter": multiscatter,
        "moments": moments,
        "channels": meaning.channels,
        "reflectance": meaning.reflectance,
    }
    return {**found, "mean_direction": meaning.mean} if moments else found


@dataclass(frozen=True)
class _Stored:
    """An opened file: its parts, the attributes of one of them, and how it is laid out."""

    path: str | os.PathLike[str]
    source: Any
    specs: list[Any]
    part: int
    attributes: dict[str, Any]
    arrangement: Arrangement
    size: int

    @property
    def spec(self) -> Any:
        return self.specs[self.part]

    def common(self) -> dict[str, Any]:
        """Arguments of every map's constructor."""
        return {
            "center": self.attributes["center"],
            "info": map_info(self.attributes, self.spec),
            "sampling": self.arrangement.sampling,
        }

    def stack(self, part: int, names: list[str]) -> Array:
        """Channels of a part as an OpenEXR cube, shape (6N, N, len(names))."""
        wanted = read_channels(self.path, self.source, part, names)
        return wanted if self.arrangement.is_plain else self.arrangement.undo(wanted)


def _open(path: str | os.PathLike[str]) -> tuple[Any, list[Any]]:
    """The file, and the specifications of its parts, which are not too much to load."""
    source = open_map(path)
    first = source.spec()
    read_attributes(path, first)
    parts = max(first.get_int_attribute("oiio:subimages"), 1)
    values = parts * first.nchannels * first.width * first.height
    specs = list(part_specs(source)) if values <= MAX_VALUES else []
    values = max(values, sum(spec.nchannels * spec.width * spec.height for spec in specs))
    if values > MAX_VALUES:
        raise MapError(f"{path}: {values:,} values are too many to load")
    return source, specs


def _stored(path: str | os.PathLike[str], source: Any, specs: list[Any], part: int) -> _Stored:
    spec = specs[part]
    attributes = read_attributes(path, spec)
    arrangement, size = stored_arrangement(path, spec, attributes)
    return _Stored(path, source, specs, part, attributes, arrangement, size)


def _read_term(stored: _Stored) -> Shrm | CompressedShrm:
    if stored.spec.get_string_attribute("shrm:pca_matrix"):
        return _read_compressed(stored)
    return _read_shrm(stored)


def _summed(terms: list[Shrm | CompressedShrm]) -> SummedShrm:
    """A sum; its parts share what is known of the whole."""
    info = replace(
        terms[0].info,
        order_f=max(term.info.order_f for term in terms),
        order_p=max(term.order_p for term in terms),
    )
    return SummedShrm(tuple(terms), info)


def _check_channels(stored: _Stored, part: int, names: list[str], what: str) -> None:
    spec = stored.specs[part]
    if not has_channels(spec, names):
        raise MapError(f"{stored.path}: its channels are not those of {what}")


def _read_shrm(stored: _Stored) -> Shrm:
    order_p = stored.attributes["P"]
    every, zonal = shrm_channels(order_p), shrm_channels(order_p, zonal=True)
    is_zonal = stored.attributes["frame"] == "local" and stored.spec.nchannels == len(zonal)
    names = zonal if is_zonal else every
    if stored.spec.nchannels * len(every) / len(names) * 6 * stored.size**2 > MAX_VALUES:
        raise MapError(f"{stored.path}: its coefficients are too many to load")
    _check_channels(stored, stored.part, names, f"an SHRM of order P = {order_p}")
    coefficients = np.zeros((6 * stored.size, stored.size, len(every)), dtype=np.float32)
    coefficients[..., [every.index(name) for name in names]] = stored.stack(stored.part, names)
    shaped = coefficients.reshape(*coefficients.shape[:2], -1, 3)
    found = Shrm(shaped, stored.attributes["frame"], **stored.common())
    _check_resampling(stored, found.azimuth_free)
    return found


def _check_resampling(stored: _Stored, is_zonal: bool) -> None:
    """Refuse local axes on a lat-long: they turn from pixel to pixel."""
    is_local = stored.attributes["frame"] == "local"
    if stored.arrangement.layout == "latlong" and is_local and not is_zonal:
        raise MapError(f"{stored.path}: a local map cannot be a lat-long; make it again")


def _read_compressed(stored: _Stored) -> CompressedShrm:
    order_p = stored.attributes["P"]
    matrix = _matrix(stored.spec.get_string_attribute("shrm:pca_matrix"))
    if matrix is None or matrix.shape[1] != (order_p + 1) ** 2 or len(matrix) > matrix.shape[1]:
        raise MapError(
            f"{stored.path}: its attribute shrm:pca_matrix is not K x {(order_p + 1) ** 2} "
            "numbers; make it again"
        )
    names = component_channels(len(matrix))
    _check_channels(stored, stored.part, names, f"an SHRM compressed to {len(matrix)} components")
    if matrix.shape[1] * 18 * stored.size**2 > MAX_VALUES:
        raise MapError(f"{stored.path}: its coefficients are too many to load")
    _check_resampling(stored, is_zonal=False)
    components = stored.stack(stored.part, names).reshape(6 * stored.size, stored.size, -1, 3)
    return CompressedShrm(components, matrix, stored.attributes["frame"], **stored.common())


def _matrix(text: str) -> Array | None:
    """A matrix of finite numbers from JSON; None from anything else."""
    try:
        values = np.array(json.loads(text), dtype=float)
    except (ValueError, TypeError, RecursionError, OverflowError):
        return None
    return values if values.ndim == 2 and values.size and np.isfinite(values).all() else None


def _read_explicit(stored: _Stored, kind: type[ExplicitMap]) -> ExplicitMap:
    count = len(stored.specs)
    width, height = stored.spec.width, stored.spec.height
    if any((spec.width, spec.height) != (width, height) for spec in stored.specs):
        raise MapError(f"{stored.path}: its parts differ in size; make it again")
    names = [_part_name(spec) for spec in stored.specs]
    try:
        kind.check_count(count)
    except ValueError:
        wanted: list[str] = []
    else:
        wanted = part_names(kind, count)
    if sorted(names) != sorted(wanted):
        raise MapError(
            f"{stored.path}: its parts are not those of a {kind.representation} map; make it again"
        )
    if stored.attributes["frame"] != kind.frame:
        raise MapError(f"{stored.path}: a {kind.representation} map is {kind.frame}; make it again")
    images = np.empty((count, 3, 6 * stored.size, stored.size), dtype=np.float32)
    views = view_attributes(kind, count)
    for index, name in enumerate(wanted):
        part = names.index(name)
        for attribute, view in views[index].items():
            if not _is_near(stored.specs[part].getattribute(attribute), view):
                raise MapError(f"{stored.path}: the {attribute} of its part {name} is wrong")
        _check_channels(stored, part, list(COLOURS), f"a {kind.representation} map")
        images[index] = np.moveaxis(stored.stack(part, list(COLOURS)), -1, 0)
    return kind(images.transpose(0, 2, 3, 1), **stored.common())


def _is_near(found: Any, expected: Any) -> bool:
    """Whether an attribute holds the numbers that it should."""
    expected, found = np.atleast_1d(expected), np.atleast_1d(found)
    is_number = np.issubdtype(found.dtype, np.floating) and found.shape == expected.shape
    return bool(is_number and np.allclose(found, expected, atol=1e-5))


def _part_name(spec: Any) -> str:
    return re.sub(r"[^ -~]", "?", spec.get_string_attribute("oiio:subimagename"))
