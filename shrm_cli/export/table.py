"""Tables of `shrm dfg` as textures: KTX 2 of half or 32-bit floats, and PNG of 16 bits."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import OutputError
from shrm_cli.export.ktx import ktx2
from shrm_cli.export.pixels import FORMATS, TexelFormat
from shrm_cli.files.png import write_png
from shrm_cli.files.whole import write_bytes
from shrm_cli.vocabulary import Precision

SUFFIXES = ".ktx2", ".png"
_LARGEST_WORD = 2**16 - 1
_COLUMNS = 3


def check_texture(path: str | os.PathLike[str], columns: int, precision: Precision) -> None:
    """Refuse a texture that cannot hold a table, before this is integrated.

    Raises OutputError.
    """
    if columns > _COLUMNS:
        raise OutputError(f"{path}: textures hold three columns, not {columns}; take .exr")
    if precision != "auto" and Path(path).suffix.lower() != ".ktx2":
        raise OutputError(f"{path}: a PNG has 16 bits, whatever `precision` is; leave it out")


def check_range(path: str | os.PathLike[str], values: Array) -> None:
    """Refuse to write a table, or a coarser one, as PNG that does not hold its values."""
    if Path(path).suffix.lower() == ".png" and not (values.min() >= 0 and values.max() <= 1):
        raise OutputError(
            f"{path}: PNG holds 0 .. 1, and the table has {values.min():.3g} .. "
            f"{values.max():.3g}; take .ktx2 or .exr"
        )


def write_texture(path: str | os.PathLike[str], table: Array, precision: Precision = "auto") -> str:
    """Write a table as a texture, by the suffix of its name, whole or not at all.

    The third column of `table`, of shape (N, N, 2 or 3), is 0 where there are two. `precision`
    holds the texels of KTX 2, RGBA whose alpha is 1; ``auto`` is half, as engines read it.

    Returns what the texels are: ``"half"``, ``"float"`` or ``"16 bits"``.
    """
    check_texture(path, table.shape[-1], precision)
    values = np.zeros((*table.shape[:2], _COLUMNS))
    values[..., : table.shape[-1]] = table
    if Path(path).suffix.lower() == ".ktx2":
        is_float, size = precision == "float", len(values)
        texels = _FLOAT if is_float else FORMATS["rgba16f"]
        words = texels.pack(values)
        data = words.astype(words.dtype.newbyteorder("<")).tobytes()
        write_bytes(path, ktx2([data], (size, size, 0), texels, compress=False))
        return "float" if is_float else "half"
    check_range(path, values)
    write_png(path, np.floor(_LARGEST_WORD * values + 0.5).astype(np.uint16))
    return "16 bits"


def _pack_floats(values: Array) -> NDArray[np.uint32]:
    opaque = np.concatenate([values, np.ones((*values.shape[:-1], 1))], axis=-1)
    return opaque.astype(np.float32).view(np.uint32)


_FLOAT = TexelFormat("rgba32f", "RGBA32F", (float(np.finfo(np.float32).max),) * 3, 16, _pack_floats)
