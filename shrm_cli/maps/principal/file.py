"""Encoding maps of principal functions as parts of a file, one for each lobe, and decoding them."""

import json
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.parts import Part, StoredFile
from shrm_cli.maps.arrangement import StoredImage
from shrm_cli.maps.attributes import COLORS, common_header, shortest_values
from shrm_cli.maps.principal.functions import MAX_Q
from shrm_cli.maps.principal.principal import Lobe, PrincipalMap
from shrm_cli.vocabulary import MAX_PRINCIPAL_MAPS

_MOST_ENTRIES = 4096
"""The most entries of a table that are read."""


def channels_of(count: int) -> list[str]:
    """Return the names of a lobe's channels: ``map000.R map000.G map000.B map001.R ...``."""
    return [f"map{k:03d}.{c}" for k in range(count) for c in COLORS]


def encode(made: PrincipalMap) -> list[Part]:
    """Return one part for each lobe; every part carries what is known of the whole map."""
    parts = []
    for k, lobe in enumerate(made.lobes):
        header: dict[str, Any] = common_header(made, made.info.order_p) | {
            "shrm:center": lobe.center,
            "shrm:degrees": json.dumps(list(lobe.degrees)),
            "shrm:functions": _text(lobe.functions),
        }
        if lobe.albedo is not None:
            header["shrm:albedo"] = _text(lobe.albedo)
        if len(made.lobes) > 1:
            header |= {"name": f"lobe{k:02d}", "displayWindow": (made.size, 6 * made.size)}
        names = channels_of(lobe.cubes.shape[2])
        planes = lobe.cubes.reshape(*lobe.cubes.shape[:2], -1)
        channels = {name: planes[..., index] for index, name in enumerate(names)}
        parts.append(Part(channels, header))
    return parts


def decode(file: StoredFile) -> PrincipalMap:
    """Read the map that a file holds.

    Raises
    ------
    MapError
        If parts, channels or attributes are missing or contradict each other.
    """
    images = {part.name: StoredImage.of(part) for part in file.parts}
    names = [f"lobe{k:02d}" for k in range(len(file.parts))]
    if len(file.parts) > 1 and sorted(images) != names:
        raise MapError(f"{file.path}: its parts are not the lobes of a map; make it again")
    ordered = [StoredImage.of(file.first)] if len(file.parts) == 1 else [images[n] for n in names]
    lobes = tuple(_decode_lobe(image) for image in ordered)
    common = ordered[0].common()
    return PrincipalMap(lobes, common["info"], common["sampling"])


def _decode_lobe(image: StoredImage) -> Lobe:
    path, part = image.path, image.part
    degrees = _json(path, "degrees", part.text("shrm:degrees"))
    is_sound = isinstance(degrees, list) and 1 <= len(degrees) <= MAX_PRINCIPAL_MAPS
    if not is_sound or not all(type(p) is int and 0 <= p <= MAX_Q for p in degrees):
        raise MapError(f"{path}: its attribute shrm:degrees is wrong; make it again")
    count = sum(2 * p + 1 for p in degrees)
    names = channels_of(count)
    image.check_channels(names, f"{count} maps of principal functions")
    functions = _table(path, "functions", part.text("shrm:functions"), 3)
    if len(functions) != sum(p + 1 for p in degrees):
        raise MapError(f"{path}: its attribute shrm:functions is wrong; make it again")
    albedo = part.text("shrm:albedo")
    stack = image.stack(names)
    return Lobe(
        stack.reshape(*stack.shape[:2], count, 3),
        tuple(degrees),
        functions,
        image.attributes["center"],
        _table(path, "albedo", albedo, 2, functions.shape[1:]) if albedo else None,
    )


def _text(table: Array) -> str:
    """Return a table as JSON, with the fewest decimals that keep its 32-bit floats."""
    content = {"shape": list(table.shape), "values": shortest_values(table)}
    return json.dumps(content, separators=(",", ":"))


def _json(path: str, name: str, text: str) -> Any:
    try:
        return parse_json(text)
    except ValueError:
        raise MapError(f"{path}: its attribute shrm:{name} is wrong; make it again") from None


def _table(
    path: str, name: str, text: str, axes: int, shape: tuple[int, ...] | None = None
) -> Array:
    """Read a table that `_text` wrote, with so many axes, the last of which are colours."""
    found = _json(path, name, text)
    wrong = MapError(f"{path}: its attribute shrm:{name} is wrong; make it again")
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
