"""Lamps and residual as a light file of ours, and as USD; files of coefficients."""

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from shrm_cli.arrays import Array
from shrm_cli.errors import OutputError
from shrm_cli.files.image import probe_attributes, write_image
from shrm_cli.files.whole import write_bytes
from shrm_cli.lights.edit import Tables
from shrm_cli.lights.split import LampSplit
from shrm_cli.messages import printable
from shrm_cli.probe.disc import Disc
from shrm_cli.probe.proxy import box_attributes
from shrm_cli.sphere.directions import normalize
from shrm_cli.vocabulary import PixelType, Precision


def write_residual(path: str, split: LampSplit, precision: Precision = "auto") -> PixelType:
    """Write the residual as an OpenEXR file, on the grid of the probe.

    A cube is stacked, in OpenEXR's order and orientation, whatever it was.

    Raises OutputError if the file cannot be written, or half precision would overflow.
    """
    probe = split.residual_probe
    is_tagged = probe.sampling == "border" and probe.layout in ("latlong", "openexr")
    attributes = probe_attributes(probe.chromaticities, probe.layout if is_tagged else None)
    attributes |= box_attributes(split.probe.proxy)
    return write_image(path, split.residual, precision, attributes)


def light_file_text(split: LampSplit, residual: str) -> str:
    """A light file whose sum is the probe: see `shrm_cli.probe.light_file`.

    `residual` is the name of the residual's file, relative to the folder of the light file.
    """
    probe = split.residual_probe
    lines = [
        f"# The lamps of {printable(Path(split.probe.name).name)}, and what is left of it.",
        "[[probe]]",
        f"file = {toml_text(residual)}",
    ]
    if probe.layout == "angular":
        lines += ['layout = "angular"', f'sampling = "{probe.sampling}"']
    for disc in split.discs:
        lines += [
            "",
            "[[disc]]",
            f"direction = {_list(disc.direction)}",
            f"radius = {np.degrees(disc.radius):.9g}",
            f"radiance = {_list(disc.radiance)}",
        ]
    return "\n".join(lines) + "\n"


def usd_text(split: LampSplit, residual: str) -> str:
    """A USD layer with a dome of the residual and a distant light for each disc.

    `residual` is the name of the residual's file, relative to the folder of the layer.

    Distant lights are normalized: colour times intensity is the irradiance of a surface that faces
    them, as `UsdLuxLightAPI` defines it. They send light along -Z of their own axes. Raises
    OutputError if the residual is no lat-long sampled at pixel centres, as domes take them.
    """
    probe = split.residual_probe
    if (probe.layout, probe.sampling) != ("latlong", "center"):
        raise OutputError(
            f"{split.probe.name}: domes of USD take lat-longs sampled at pixel centres; make one "
            "by shrm convert --to latlong first"
        )
    return usd_layer("Residual", residual, split.discs)


def usd_layer(name: str, panorama: str, discs: Sequence[Disc]) -> str:
    """A USD layer of a dome and distant lights, in our axes whatever stage it becomes part of.

    `name` is what the dome is called. `panorama` is the name of its file, relative to the folder of
    the layer.

    Raises OutputError if USD cannot name such a file.
    """
    parts = [_USD_HEAD.format(name=name, file=_usd_asset(panorama))]
    for number, disc in enumerate(discs, 1):
        intensity, color = intensity_and_color(disc)
        rows = [", ".join(f"{each:.9g}" for each in row) for row in light_axes(disc.direction)]
        parts.append(
            _USD_LIGHT.format(
                number=number, angle=2 * np.degrees(disc.radius), intensity=intensity,
                color=", ".join(f"{each:.9g}" for each in color),
                matrix=", ".join(f"({row}, 0)" for row in rows),
            )
        )  # fmt: skip
    return "\n".join(parts) + "}\n"


def relative_name(residual: str, path: str) -> str:
    """The name of the residual's file as a file beside or above it has it.

    Raises OutputError if the residual is not in the folder of the file or below it.
    """
    folder = Path(path).absolute().parent.resolve()
    target = Path(residual).absolute()
    target = target.parent.resolve() / target.name
    if not target.is_relative_to(folder):
        raise OutputError(f"{path}: {residual} is not in its folder; write both into one")
    return target.relative_to(folder).as_posix()


def intensity_and_color(disc: Disc) -> tuple[float, Array]:
    """The irradiance of a surface that faces a disc, as its largest channel and a colour to it."""
    intensity = float(disc.irradiance.max())
    return intensity, disc.irradiance / intensity if intensity else np.ones(3)


def light_axes(direction: Array) -> Array:
    """Axes of a light that shines along its own -Z, as rows in world axes: Z is the direction."""
    helper = np.eye(3)[1] if abs(direction[1]) < 0.99 else np.eye(3)[0]
    right = normalize(np.cross(helper, direction))
    return np.stack([right, np.cross(direction, right), direction])


def _list(values: Array) -> str:
    return "[" + ", ".join(f"{value:.9g}" for value in values) + "]"


def toml_text(text: str) -> str:
    """Return a text as TOML writes it."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in escaped) + '"'


def _usd_asset(text: str) -> str:
    """An asset path; @@@ delimits paths that have an @."""
    if "@" in text or not text.isprintable():
        raise OutputError(f"{text!r}: USD cannot name such a file; rename the residual")
    return f"@{text if text.startswith('.') else './' + text}@"


_USD_HEAD = """#usda 1.0
(
    defaultPrim = "Lights"
    metersPerUnit = 1
    upAxis = "Y"
)

def Xform "Lights"
{{
    def DomeLight_1 "{name}"
    {{
        uniform token poleAxis = "Y"
        asset inputs:texture:file = {file}
        token inputs:texture:format = "latlong"
        float inputs:intensity = 1
        float inputs:exposure = 0
        color3f inputs:color = (1, 1, 1)
    }}
"""

_USD_LIGHT = """    def DistantLight "Lamp{number}"
    {{
        float inputs:angle = {angle:.9g}
        float inputs:intensity = {intensity:.9g}
        float inputs:exposure = 0
        color3f inputs:color = ({color})
        bool inputs:normalize = 1
        matrix4d xformOp:transform = ( {matrix}, (0, 0, 0, 1) )
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }}
"""


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

    `tables` are lists of tables of texts, numbers and lists, by their kinds. `working` holds the
    primaries of the sum.

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
    # As people write numbers: .3 times .3 is .09, without what rounding adds in the last digit.
    return repr(float(f"{value:.15g}") if isinstance(value, float) else value)
