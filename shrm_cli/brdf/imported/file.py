"""Files of materials, ``material.mtlx#name`` and ``asset.glb#name``, as OpenPBR's surface.

The result has no file: its parameters are all of it, so that a map which records them needs none.
"""

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.brdf.imported.surfaces import LEFT_OUT, SURFACES
from shrm_cli.brdf.layered.openpbr import OpenPbr
from shrm_cli.brdf.measured.reading.file import check_file, readable
from shrm_cli.color import Primaries, from_rec709, mix_channels
from shrm_cli.errors import BrdfError, ShrmWarning
from shrm_cli.files.gltf import MOST_BYTES
from shrm_cli.files.whole import note


def open_material(path: Path, wanted: str, primaries: Primaries | None = None) -> OpenPbr:
    """The surface of a material in a file.

    `wanted` is the material's name or number; empty for the only one. `primaries` are
    chromaticities that colors are converted to, Rec.709 by default.

    Warns for what is averaged, and for what is left out.
    """
    check_file(path)
    note(path)
    with readable(path) as stream:
        data = stream.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise BrdfError(f"{path}: larger than {MOST_BYTES:,} bytes; name a smaller file")
    if path.suffix.lower() == ".mtlx":
        from shrm_cli.brdf.imported.materialx import read_materialx

        material = read_materialx(str(path), data, wanted)
    else:
        from shrm_cli.brdf.imported.gltf import read_gltf_material

        material = read_gltf_material(str(path), data, wanted)
    try:
        values = SURFACES[material.surface](material.values)
        found = OpenPbr(**_converted(values, primaries))
    except BrdfError as error:
        raise BrdfError(f"{path}: {str(error).removeprefix('openpbr: ')}") from error
    except (ArithmeticError, ValueError) as error:  # of numbers that no surface has
        raise BrdfError(f"{path}: its material cannot be used ({error})") from error
    unlike = [each for each in LEFT_OUT if material.values.get(each, 0) != 0]
    for what, names in (
        ("left out", [*material.left_out, *unlike]),
        ("replaced by the mean of a texture", material.averaged),
    ):
        if names:
            line = f"{path}: {what}: {', '.join(dict.fromkeys(names))}"
            warnings.warn(line, ShrmWarning, stacklevel=2)
    return found


def _converted(values: dict[str, Any], primaries: Primaries | None) -> dict[str, Any]:
    """The values to six digits, with colors in a probe's primaries within 0 .. 1."""
    matrix = from_rec709(primaries)
    found = {}
    for key, value in values.items():
        each = np.array(value, dtype=float)
        if matrix is not None and key.endswith("_color"):
            each = np.clip(mix_channels(each, matrix), 0, 1)
        short = [float(f"{number:.6g}") for number in each.ravel()]
        found[key] = short if each.ndim else short[0]
    return found
