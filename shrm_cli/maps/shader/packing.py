"""The textures that the code of a map reads in the layout ``layers``."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.maps.shader.code import source_of
from shrm_cli.maps.shader.pages import arrange, drawn
from shrm_cli.records import record

if TYPE_CHECKING:
    from shrm_cli.maps.base import Map


@record(eq=False)
class PackedTexture:
    """An array of images, as graphics APIs take it.

    Attributes
    ----------
    name : {"shrm_layers", "shrm_table"}
        What the code calls it: the cubes, which half precision holds as well as the map's file
        does, or numbers that want 32-bit floats.
    values : ndarray of float32, shape (layers, height, width, 3)
        RGB, the top row first.
    """

    name: str
    values: NDArray[np.float32]


def pack(made: "Map") -> tuple[PackedTexture, ...]:
    """Return the textures of a map for the code that `look_up_code` writes with ``layers``.

    Cubes of local frames are turned to world axes, in which alone they can be filtered.

    Parameters
    ----------
    made : Map

    Returns
    -------
    tuple of PackedTexture
        None for irradiance, whose code holds all numbers.

    Raises
    ------
    MapError
        If the map has no shader, or does not fit into such textures.
    """
    if made.representation == "irradiance":
        return ()
    source = source_of(made, "layers")
    found = []
    if source.stacks:
        pages = arrange([(stack.shape[2], stack.shape[1]) for stack in source.stacks])
        found.append(PackedTexture("shrm_layers", drawn(pages, source.stacks, source.sampling)))
    if source.table is not None:
        with np.errstate(over="ignore"):
            found.append(PackedTexture("shrm_table", source.table.make().astype(np.float32)))
    if not all(np.isfinite(each.values).all() for each in found):
        raise MapError("a number is beyond 32-bit floats; dim the light")
    return tuple(found)
