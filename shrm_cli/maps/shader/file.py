"""The textures that the code of a map reads in the layout ``layers``, and files of them."""

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.files.parts import Part, peek, write_parts
from shrm_cli.maps.base import Map
from shrm_cli.maps.shader.code import lobe_of, source_of, whole_code
from shrm_cli.maps.shader.language import harmless
from shrm_cli.maps.shader.pages import arrange, drawn
from shrm_cli.maps.stored import image_channels
from shrm_cli.records import record
from shrm_cli.vocabulary import Precision

_MARK = "shrm:textures"
"""The attribute by which these files are known."""


@record(eq=False)
class PackedTexture:
    """An array of images, as graphics APIs take it."""

    name: str
    """What the code calls it: cubes, functions of the view or a table of a BRDF, which half
    precision holds as well as the map's file does, or numbers that want 32-bit floats. One of
    "shrm_layers", "shrm_product", "shrm_lobe" and "shrm_table"."""
    values: NDArray[np.float32]
    """RGB, the top row first, shape (layers, height, width, 3)."""


def pack(made: Map) -> tuple[PackedTexture, ...]:
    """Return the textures of a map for the code that `written_code` writes with ``layers``.

    Cubes of local frames are turned to world axes, in which alone they can be filtered.

    Returns none for irradiance, whose code holds all numbers.
    """
    if whole_code(made) is not None:
        return ()
    source = source_of(made, "layers")
    found = []
    if source.stacks:
        pages = arrange([(stack.shape[2], stack.shape[1]) for stack in source.stacks])
        found.append(PackedTexture("shrm_layers", drawn(pages, source.stacks)))
    tables = {"shrm_table": source.table, "shrm_product": source.images, "shrm_lobe": lobe_of(made)}
    for name, table in tables.items():
        if table is not None:
            with np.errstate(over="ignore"):
                found.append(PackedTexture(name, table.make().astype(np.float32)))
    if not all(np.isfinite(each.values).all() for each in found):
        raise MapError("a number is beyond 32-bit floats; dim the light")
    return tuple(found)


def write_layers(
    path: str | os.PathLike[str], made: Map, precision: Precision = "auto"
) -> tuple[str, dict[str, tuple[int, ...]]]:
    """Write the textures of a map, each layer as a part, whole or not at all.

    The part of layer 3 of ``shrm_table`` is called ``shrm_table.003``. The file is no map, and
    is written as 32-bit floats unless `precision` is half, which costs tables some digits.

    Returns `pixel_type`; and `shapes`, layers, height and width of each texture by its name.
    """
    textures = pack(made)
    if not textures:
        raise MapError(
            f"{made.what} has no textures: its code holds all numbers, and "
            f"shrm convert --to {made.representation} --shader prints it"
        )
    about = {
        _MARK: "layers",
        "shrm:of": made.representation,
        "shrm:probe": harmless(made.info.probe),
    }
    parts = [
        Part(image_channels(layer), {"name": f"{texture.name}.{number:03d}", **about})
        for texture in textures
        for number, layer in enumerate(texture.values)
    ]
    pixel_type = write_parts(path, parts, "float" if precision == "auto" else precision)
    return pixel_type, {texture.name: texture.values.shape[:3] for texture in textures}


def read_layers_facts(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """What a file of textures says of itself; None if a file is none.

    Returns the representation and the probe of the map that they were made from, and layers, height
    and width of each texture by its name.
    """
    file = peek(path)
    if file is None or not file.first.text(_MARK):
        return None
    shapes: dict[str, list[int]] = {}
    for part in file.parts:
        name = part.name.rpartition(".")[0] or part.name
        layers, *_ = shapes.get(name, [0])
        shapes[name] = [layers + 1, part.height, part.width]
    return {"of": file.first.text("shrm:of"), "probe": file.first.text("shrm:probe"), **shapes}
