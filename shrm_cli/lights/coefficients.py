"""Files of harmonic coefficients, and of tables of light files, written."""

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from shrm_cli.arrays import Array
from shrm_cli.files.whole import write_bytes
from shrm_cli.lights.edit import Tables
from shrm_cli.lights.light_files import toml_text

_BASIS = (
    "radiance, real orthonormal spherical harmonics without Condon-Shortley phase, index l(l+1)+m: "
    "1, y, z, x, xy, ...; right-handed axes, +Y up"
)


def write_coefficients(path: str, coefficients: Array) -> None:
    """Write a light's coefficients, shape (n, 3), as .txt, .npy or .json; see `probe.series`.

    Raises OutputError if the file cannot be written.
    """
    write_bytes(path, _CONTENTS[Path(path).suffix.lower()](coefficients))


def write_light_file(path: str, tables: Tables, working: Any = None) -> None:
    """Write the tables of a light file.

    Parameters
    ----------
    tables : dict
        Lists of tables of texts, numbers and lists, by their kinds.
    working : str or list of float, optional
        The primaries of the sum.

    Raises OutputError if the file cannot be written.
    """
    lines = [] if working is None else [f"working = {_toml(working)}", ""]
    for kind, some in tables.items():
        for table in some:
            lines += [f"[[{kind}]]", *(f"{key} = {_toml(table[key])}" for key in table), ""]
    write_bytes(path, "\n".join(lines).encode())


def _text(coefficients: Array) -> bytes:
    rows = [" ".join(map(repr, row)) for row in coefficients.tolist()]
    return "\n".join([f"# {_BASIS}", *rows, ""]).encode()


def _array(coefficients: Array) -> bytes:
    stream = io.BytesIO()
    npy.write_array(stream, np.ascontiguousarray(coefficients, "<f8"), allow_pickle=False)
    return stream.getvalue()


def _json(coefficients: Array) -> bytes:
    found = {"basis": _BASIS, "radiance": coefficients.tolist()}
    return (json.dumps(found, indent=1) + "\n").encode()


_CONTENTS = {".txt": _text, ".npy": _array, ".json": _json}


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return toml_text(value)
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, Mapping):
        raise TypeError("tables of light files hold no tables")
    return repr(value)
