"""Light files: TOML that names probes, circular lights and harmonics, whose sum is a probe.

A small one, with all that a disc needs; `docs/conventions.md` has every key::

    [[probe]]
    file = "sky.exr"
    yaw = 30

    [[disc]]
    azimuth = 45
    elevation = 35
    radius = 0.2655
    radiance = [1.2e6, 1.0e6, 0.8e6]
"""

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import TYPE_CHECKING, Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.color import conversion
from shrm_cli.errors import ProbeError
from shrm_cli.files.json_text import read_toml
from shrm_cli.files.whole import note
from shrm_cli.messages import as_keys
from shrm_cli.probe.disc import BRIGHTEST, LEAST_RADIUS, Disc, facing_factor, radius_of
from shrm_cli.probe.image_file import is_light_file
from shrm_cli.probe.light_sum import LightSum, SumImage, Term, in_one_color
from shrm_cli.probe.options import ReadOptions, chromaticities_of
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.reader import check_file
from shrm_cli.probe.series import Series, as_radiance, holds_series, read_series, sum_of
from shrm_cli.sphere.directions import from_azimuth_elevation
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.vocabulary import FACES, MOST_DEGREES

if TYPE_CHECKING:
    from shrm_cli.probe.proxy import ProxyBox

_MOST_BYTES = 2**20
_MOST_LIGHTS = 1000
_OF_THE_WHOLE = {"yaw", "pitch", "roll", "mirror", "up", "working", "box", "at"}
"""The options that apply to a light file: they turn it, and tell its primaries and its box."""
_PROBE_KEYS = {each.name for each in fields(ReadOptions)} - {"pixels"} | {"clamp", "fix_nonfinite"}
_KINDS = "probe", "disc", "sh"
_SH_READING = ("part", "yaw", "pitch", "roll", "mirror", "up")
_SH_KEYS = {"file", "coefficients", "basis", "of", "scale", "primaries", *_SH_READING}
_DISC_KEYS = {
    "azimuth", "elevation", "direction", "radius", "solid_angle", "radiance", "irradiance",
    "primaries",
}  # fmt: skip


def open_light_file(name: str, options: ReadOptions, opening: Callable[..., Probe]) -> LightSum:
    """Open a light file, and the probes that it names.

    Names in it are relative to its folder. `options` are what turns the whole; other options say
    nothing about a light file. `opening` opens the probes that it names, as `open_probe` does.
    """
    _check_options(name, options)
    path = check_file(name)
    tables, in_file, text = _parsed(name)
    note(path)
    count = sum(len(each) for each in tables.values())
    if not 1 <= count <= _MOST_LIGHTS:
        raise ProbeError(
            f"{name}: {count:,} lights; give 1 to {_MOST_LIGHTS} [[probe]], [[disc]] or [[sh]]"
        )
    terms = [
        _term(f"{name}: probe {k}", path, each, opening)
        for k, each in enumerate(tables["probe"], 1)
    ]
    asked = in_file if options.working is None else options.working
    own = _primaries(name, "working", asked)
    colors = own or next((t.probe.chromaticities for t in terms if t.probe.chromaticities), None)
    found_terms, notes = in_one_color(terms, colors, own is not None)
    discs = [_disc(f"{name}: disc {k}", each, colors) for k, each in enumerate(tables["disc"], 1)]
    series = [
        _series(f"{name}: sh {k}", path, each, colors) for k, each in enumerate(tables["sh"], 1)
    ]
    whole = sum_of([each for each, _ in series])
    box, more = _box_of(name, terms, options)
    image = SumImage(
        name, path, text + b"".join(more for _, more in series), found_terms, tuple(discs),
        notes + more, whole,
    )  # fmt: skip
    record = {} if options.working is None or own is None else {"working": list(own)}
    return LightSum.of(image, options.matrix(), colors, record, box)


def _box_of(
    name: str, terms: list[Term], options: ReadOptions
) -> tuple["ProxyBox | None", tuple[str, ...]]:
    """The proxy box that the probes tell, turned as the whole is, and a line if there is none."""
    told = {term.probe.proxy for term in terms} - {None}
    (box,) = told if len(told) == 1 else (None,)
    turned = None if box is None else box.turned(options.matrix())
    if turned is None and told and options.box is None:
        why = "those of its probes differ" if len(told) > 1 else "it is not turned by right angles"
        return None, (f"{name}: it has no proxy box, for {why}",)
    return turned, ()


def read_light_tables(name: str) -> tuple[dict[str, list[dict[str, Any]]], Any]:
    """Return the tables of a light file by their kinds, and what it says of `working`."""
    return _parsed(name)[:2]


def _parsed(name: str) -> tuple[dict[str, list[dict[str, Any]]], Any, bytes]:
    """The tables, the primaries and the bytes of a light file."""
    too_large = f"larger than {_MOST_BYTES:,} bytes; put many lights into an image"
    found, text = read_toml(name, "a light file", _MOST_BYTES, too_large, ProbeError)
    if "objects" in found:
        raise ProbeError(f"{name}: a scene, and no light; shrm render MAP --mesh draws it")
    _check_keys(name, found, {*_KINDS, "working"})
    tables = {kind: _tables(name, kind, found.get(kind, [])) for kind in _KINDS}
    return tables, found.get("working"), text


def _primaries(what: str, key: str, value: Any) -> tuple[float, ...] | None:
    try:
        return chromaticities_of(key, value)
    except ProbeError as error:
        raise ProbeError(f"{what}: {as_keys(error)}") from None


def _check_options(name: str, options: ReadOptions) -> None:
    default = ReadOptions()
    for each in fields(ReadOptions):
        if each.name in _OF_THE_WHOLE or getattr(options, each.name) == getattr(default, each.name):
            continue
        changed = each.name
        if changed == "pixels":
            changed = "clamp" if options.pixels.clamp is not None else "fix_nonfinite"
        raise ProbeError(
            f"{name}: `{changed}` says nothing about a light file; name it in a probe's table"
        )


def _tables(name: str, kind: str, found: object) -> list[dict[str, Any]]:
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise ProbeError(f"{name}: '{kind}' must be tables; write [[{kind}]]")
    return found


def _check_keys(what: str, table: Mapping[str, Any], known: set[str]) -> None:
    unknown = sorted(table.keys() - known)
    if unknown:
        names = ", ".join(sorted(known))
        raise ProbeError(f"{what}: unknown key {unknown[0]!r:.60}; give {names}")


def _term(what: str, path: Path, table: dict[str, Any], opening: Callable[..., Probe]) -> Term:
    """A [[probe]]: an image file of the light file's folder, and how it is read."""
    _check_keys(what, table, {"file", "scale"} | _PROBE_KEYS)
    file = table.get("file")
    if not isinstance(file, str) or not file:
        raise ProbeError(f"{what}: 'file' must be the name of an image")
    if not stays_below(file, path.parent):
        raise ProbeError(
            f"{what}: {file!r:.100} leaves the light file's folder; put the image into it"
        )
    if is_light_file(file):
        raise ProbeError(f"{what}: {file!r:.100} is a light file; name images, and copy its lights")
    scale = _color(what, "scale", table["scale"]) if "scale" in table else np.ones(3)
    reading = {key: value for key, value in table.items() if key in _PROBE_KEYS}
    try:
        probe = opening(os.path.join(os.path.dirname(path), file), **reading)
    except ProbeError as error:
        raise ProbeError(f"{what}: {as_keys(error)}") from None
    return Term(probe, scale)


def _series(
    what: str, path: Path, table: dict[str, Any], colors: tuple[float, ...] | None
) -> tuple[Array, bytes]:
    """A [[sh]]: coefficients, of a file or in the table, and the bytes of that file.

    Their color is in the primaries of the sum, `colors`, if nothing tells others.
    """
    _check_keys(what, table, _SH_KEYS)
    basis, of = table.get("basis"), table.get("of")
    content = b""
    try:
        options = ReadOptions(**{key: table[key] for key in _SH_READING if key in table})
        if _only(what, table, "file", "coefficients") == "file":
            name = table["file"]
            if not isinstance(name, str) or not name or not stays_below(name, path.parent):
                raise ProbeError(f"{what}: 'file' must be a name in the light file's folder")
            name = os.path.join(os.path.dirname(path), name)
            if not holds_series(name):
                raise ProbeError(
                    f"{what}: {table['file']!r:.100} holds no coefficients; name .txt, .npy, "
                    ".json or an irradiance map"
                )
            found = read_series(name, basis, "radiance" if of is None else of, options.part_name())
            content = Path(name).read_bytes()
        elif options.part is not None:
            raise ProbeError(f"{what}: 'part' applies to a file")
        else:
            values = table["coefficients"]
            found = Series(as_radiance(values, basis or "real", "radiance" if of is None else of))
    except ProbeError as error:
        said = as_keys(error)
        raise ProbeError(said if said.startswith(what) else f"{what}: {said}") from None
    except (ValueError, TypeError, OverflowError) as error:
        said = str(error).split("\n", maxsplit=1)[0]
        raise ProbeError(f"{what}: {said:.200}") from None
    own = _primaries(what, "primaries", table.get("primaries")) or found.chromaticities
    change = None if own is None else conversion(own, colors)
    values = found.coefficients if change is None else found.coefficients @ change.T
    scale = _color(what, "scale", table["scale"]) if "scale" in table else np.ones(3)
    return transform_coefficients(values * scale, options.matrix()), content


def stays_below(file: str, folder: str | os.PathLike[str]) -> bool:
    """Whether a name is that of a file of a folder, or of one within it, on every system.

    It is not where a link leads out of the folder. A ``%`` stands for each of six faces.
    """
    windows = PureWindowsPath(file)
    if windows.drive or windows.root or PurePosixPath(file).is_absolute() or ".." in windows.parts:
        return False
    real = os.path.realpath(folder)
    where, name = os.path.split(os.path.join(folder, file))
    names = {name, *(name.replace("%", face) for face in FACES)}
    found = [os.path.realpath(os.path.join(where, each)) for each in names if "\0" not in each]
    return all(os.path.commonpath([each, real]) == real for each in found)


def _disc(what: str, table: dict[str, Any], colors: tuple[float, ...] | None) -> Disc:
    """A [[disc]], with one of the ways to say where it is, how large and how bright.

    Its color is in the primaries of the sum, `colors`, if it tells no others.
    """
    _check_keys(what, table, _DISC_KEYS)
    if _only(what, table, "direction", "azimuth") == "direction":
        if "elevation" in table:
            raise ProbeError(f"{what}: 'direction' has the elevation; leave 'elevation' out")
        direction = _direction(what, table["direction"])
    else:
        azimuth = _number(what, "azimuth", table["azimuth"], -MOST_DEGREES, MOST_DEGREES)
        elevation = _number(what, "elevation", table.get("elevation"), -90, 90)
        direction = from_azimuth_elevation(azimuth, elevation)
    if _only(what, table, "radius", "solid_angle") == "radius":
        radius = math.radians(_number(what, "radius", table["radius"], 0, 180))
    else:
        radius = radius_of(_number(what, "solid_angle", table["solid_angle"], 0, 4 * math.pi))
    if radius < LEAST_RADIUS:
        raise ProbeError(
            f"{what}: too small; give a radius of {math.degrees(LEAST_RADIUS):.2g} degrees or more"
        )
    radiance = _color(what, key := _only(what, table, "radiance", "irradiance"), table[key])
    if key == "irradiance":
        radiance = radiance / facing_factor(radius)
    own = _primaries(what, "primaries", table.get("primaries"))
    matrix = None if own is None else conversion(own, colors)
    if matrix is not None:
        radiance = np.maximum(matrix @ radiance, 0)
    return Disc(direction, radius, radiance)


def _only(what: str, table: dict[str, Any], one: str, other: str) -> str:
    """Which one of two keys there is."""
    if (one in table) == (other in table):
        said = "excludes" if one in table else "is missing, or"
        raise ProbeError(f"{what}: '{one}' {said} '{other}'; give one of them")
    return one if one in table else other


def _direction(what: str, value: object) -> Array:
    if not isinstance(value, list) or len(value) != 3:
        raise ProbeError(f"{what}: 'direction' must be three numbers")
    vector = np.array([_number(what, "direction", each, -1e6, 1e6) for each in value])
    length = float(np.linalg.norm(vector))
    if length < 1e-6:
        raise ProbeError(f"{what}: 'direction' is 0; give three numbers that point to the light")
    return np.asarray(vector / length)


def _color(what: str, key: str, value: object) -> Array:
    """One number for all channels, or three."""
    values = value if isinstance(value, list) else [value] * 3
    if len(values) != 3:
        raise ProbeError(f"{what}: '{key}' must be one number or three")
    return np.array([_number(what, key, each, 0, BRIGHTEST) for each in values])


def _number(what: str, key: str, value: object, least: float, most: float) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not least <= value <= most:  # type: ignore[operator]
        raise ProbeError(f"{what}: '{key}' must be a number from {least:g} to {most:g}")
    return float(value)  # type: ignore[arg-type]
