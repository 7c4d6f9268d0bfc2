"""Tables of BRDFs -> files; `shrm_cli.brdf.measured.reading.table_file` reads them back."""

import json
import os
from pathlib import Path

from shrm_cli.brdf.measured.reading.table_file import ATTRIBUTE, settings_object, write_npz
from shrm_cli.brdf.measured.table import AXES, Table
from shrm_cli.errors import OutputError
from shrm_cli.files.exr import Part, open_image, write_parts

TABLE_SUFFIXES = (".exr", ".npz")


def write_table(path: str | os.PathLike[str], table: Table) -> None:
    """Write a table, whole or not at all, as OpenEXR or .npz as its name says.

    Parameters
    ----------
    path : path-like
    table : Table

    Raises
    ------
    OutputError
        If the name ends with something else, or the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        write_npz(path, table)
    elif suffix == ".exr":
        rows = table.table.shape[0]
        planes = table.table.reshape(rows, -1, table.table.shape[-1])
        channels = {name: planes[..., k % planes.shape[-1]] for k, name in enumerate("RGB")}
        axes = {name: axis.tolist() for name, axis in zip(AXES, table.axes, strict=True)}
        settings = json.dumps({**settings_object(table.settings), "axes": axes})
        write_parts(path, [Part(channels, {ATTRIBUTE: settings})], "float")
    else:
        raise OutputError(f"{path}: a table is written as {' or '.join(TABLE_SUFFIXES)}")


def is_table(path: str | os.PathLike[str]) -> bool:
    """Whether a readable OpenEXR file says that it is a table of a BRDF."""
    source = open_image(path) if Path(path).is_file() else None
    return source is not None and isinstance(source.spec().getattribute(ATTRIBUTE), str)
