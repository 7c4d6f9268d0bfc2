"""Encoding maps of principal functions as parts of a file, one for each lobe, and decoding them."""

import json
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.brushed_transfer import Waves
from shrm_cli.errors import MapError
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.parts import Part, StoredFile, StoredPart
from shrm_cli.maps.principal.brushed import BrushedLobe
from shrm_cli.maps.principal.functions import MAX_Q
from shrm_cli.maps.principal.principal import Lobe, PrincipalMap
from shrm_cli.maps.stored import (
    COLORS,
    StoredImage,
    color_channels,
    common_header,
    image_channels,
    shortest_values,
)
from shrm_cli.vocabulary import MAX_PRINCIPAL_MAPS

_TABLES = "functions"
"""What the names of parts begin with that hold functions of the azimuth of the view, too."""
_MOST_WAVES = 512
"""The most waves of a lobe, and their largest frequency."""
_MOST_ENTRIES = 4096
"""The most entries of a table that are read."""


def encode(made: PrincipalMap) -> list[Part]:
    """Return one part for each lobe; every part carries what is known of the whole map."""
    parts, tables = [], []
    for k, lobe in enumerate(made.lobes):
        header: dict[str, Any] = common_header(made, made.info.order_p) | {
            "shrm:center": lobe.center,
            "shrm:degrees": json.dumps(list(lobe.degrees)),
        }
        if isinstance(lobe, BrushedLobe):
            header["shrm:waves"] = json.dumps(lobe.waves.tolist())
            tables.append(_table_part(k, lobe, header))
        else:
            header["shrm:functions"] = _text(lobe.functions)
        if lobe.albedo is not None:
            header["shrm:albedo"] = _text(lobe.albedo)
        if len(made.lobes) > 1 or made.is_brushed:
            header["name"] = f"lobe{k:02d}"
        names = color_channels("map", lobe.cubes.shape[2])
        planes = lobe.cubes.reshape(*lobe.cubes.shape[:2], -1)
        parts.append(Part(image_channels(planes, names), header))
    return parts + tables


def _table_part(k: int, lobe: BrushedLobe, header: dict[str, Any]) -> Part:
    """Return the functions of a lobe as an image: a row for each wave, functions one by one."""
    table = lobe.functions.reshape(-1, *lobe.functions.shape[2:])
    return Part(image_channels(table), header | {"name": f"{_TABLES}{k:02d}"}, is_table=True)


def decode(file: StoredFile) -> PrincipalMap:
    """Read the map that a file holds."""
    named = {part.name: part for part in file.parts}
    tables = {name for name in named if name.startswith(_TABLES)}
    names = [f"lobe{k:02d}" for k in range(len(file.parts) - len(tables))]
    if len(file.parts) == 1:
        names, named = [""], {"": file.first}
    if not names or set(named) != {*names, *tables} or len(named) != len(file.parts):
        raise MapError(f"{file.path}: its parts are not the lobes of a map; make it again")
    images = [StoredImage.of(named[name]) for name in names]
    lobes = tuple(
        _decode_lobe(image, named.get(f"{_TABLES}{k:02d}")) for k, image in enumerate(images)
    )
    common = images[0].common()
    return PrincipalMap(lobes, common["info"], common["sampling"])


def _decode_lobe(image: StoredImage, table: StoredPart | None) -> Lobe:
    path, part = image.path, image.part
    degrees = _json(path, "degrees", part.text("shrm:degrees"))
    is_sound = isinstance(degrees, list) and 1 <= len(degrees) <= MAX_PRINCIPAL_MAPS
    if not is_sound or not all(type(p) is int and 0 <= p <= MAX_Q for p in degrees):
        raise MapError.of_attribute(path, "degrees")
    count = sum(2 * p + 1 for p in degrees)
    names = color_channels("map", count)
    image.check_channels(names, f"{count} maps of principal functions")
    stack = image.stack(names)
    cubes, center = stack.reshape(*stack.shape[:2], count, 3), image.attributes["center"]
    rows = sum(p + 1 for p in degrees)
    if table is not None:
        waves = _waves(path, part.text("shrm:waves"))
        functions = _brushed_functions(table, rows, len(waves))
        return BrushedLobe(cubes, tuple(degrees), functions, center, None, waves)
    functions = _table(path, "functions", part.text("shrm:functions"), 3)
    if len(functions) != rows:
        raise MapError.of_attribute(path, "functions")
    albedo = part.text("shrm:albedo")
    return Lobe(
        cubes,
        tuple(degrees),
        functions,
        center,
        _table(path, "albedo", albedo, 2, functions.shape[1:]) if albedo else None,
    )


def _waves(path: str, text: str) -> Waves:
    found = _json(path, "waves", text)
    is_sound = isinstance(found, list) and 1 <= len(found) <= _MOST_WAVES
    if not is_sound or not all(
        isinstance(wave, list)
        and [type(number) for number in wave] == [int, int]
        and abs(wave[0]) <= _MOST_WAVES
        and wave[1] in (0, 1)
        for wave in found
    ):
        raise MapError.of_attribute(path, "waves")
    return np.array(found, dtype=np.intp)


def _brushed_functions(table: StoredPart, count: int, waves: int) -> Array:
    """Read what `_table_part` wrote, shape (count, waves, entries, 3)."""
    is_sound = table.height == count * waves and 2 <= table.width <= _MOST_ENTRIES
    if not (is_sound and table.holds(COLORS)):
        raise MapError(f"{table.path}: its part {table.name} is wrong; make it again")
    return table.read(COLORS).astype(float).reshape(count, waves, table.width, 3)


def _text(table: Array) -> str:
    """Return a table as JSON, with the fewest decimals that keep its 32-bit floats."""
    content = {"shape": list(table.shape), "values": shortest_values(table)}
    return json.dumps(content, separators=(",", ":"))


def _json(path: str, name: str, text: str) -> Any:
    try:
        return parse_json(text)
    except ValueError:
        raise MapError.of_attribute(path, name) from None


def _table(
    path: str, name: str, text: str, axes: int, shape: tuple[int, ...] | None = None
) -> Array:
    """Read a table that `_text` wrote, with so many axes, the last of which are colours."""
    found = _json(path, name, text)
    wrong = MapError.of_attribute(path, name)
    if not isinstance(found, dict) or set(found) != {"shape", "values"}:
        raise wrong
    sizes, values = found["shape"], found["values"]
    if not (isinstance(sizes, list) and isinstance(values, list) and len(sizes) == axes):
        raise wrong
    is_sound = all(type(n) is int and 1 <= n <= _MOST_ENTRIES for n in sizes) and sizes[-1] == 3
    if not is_sound or sizes[-2] < 2 or (shape is not None and tuple(sizes) != shape):
        raise wrong
    if len(values) != np.prod(sizes) or not all(type(v) in (int, float) for v in values):
        raise wrong
    table = np.array(values, dtype=float).reshape(sizes)
    if not np.isfinite(table).all():
        raise wrong
    return table
