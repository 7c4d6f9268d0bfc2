"""What an ICC profile tells of pixels: the transfer curve of integers, and primaries.

A PNG states primaries outside its profile too, which image libraries leave out.
"""

import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.color import adaptation, is_possible
from shrm_cli.vocabulary import PRIMARIES

Curve = Callable[[Array], Array]

_TAG_COUNT_AT = 128
_MOST_TAGS = 200
_COLORANT_TAGS = (b"rXYZ", b"gXYZ", b"bXYZ", b"wtpt", b"chad")
_D50 = np.array([0.9642, 1.0, 0.8249])
"""XYZ of the white that colorants are adapted to (ICC.1:2022, 7.2.16)."""
_PARAMETERS = (1, 3, 4, 5, 7)
"""How many parameters a parametric curve of each type has."""
_MAGIC = b"\x89PNG\r\n\x1a\n"
_MOST_CHUNKS = 1000
_CODES = {1: "rec709", 9: "rec2020", 11: "dci-p3", 12: "p3"}
"""Names of ColourPrimaries in ITU-T H.273 that are known here."""


def linear_curve(profile: bytes) -> Curve | None:
    """From encoded values in 0 .. 1 to linear ones, as a profile's red or grey curve has it.

    Returns None where the profile holds no such curve, as those of printers do.

    References: ICC.1:2022, 7.3 (tags), 10.6 (curveType), 10.18 (parametricCurveType).
    """
    try:
        for name, data in _tags(profile):
            if name in (b"rTRC", b"kTRC"):
                return _curve(data)
    except (struct.error, ValueError):  # the profile is cut short
        pass
    return None


def profile_primaries(profile: bytes) -> tuple[float, ...] | None:
    """The primaries and the white of a profile that consists of a matrix and curves.

    Its colorants are adapted to D50. The tag ``chad`` says by which matrix; without it they are
    taken to be adapted from the media's white, by Bradford's, which is D50 itself in many profiles.

    Returns CIE x and y of red, green, blue and white, or None where the profile is of another kind.

    References: ICC.1:2022, 8.3.3 (three-component matrix-based profiles), 9.2.14 (chad), annex E.
    """
    try:
        found = {
            # The numbers of an XYZType or an s15Fixed16ArrayType.
            name: np.frombuffer(data[8 : 8 + (len(data) - 8) // 4 * 4], ">i4") / 65536
            for name, data in _tags(profile)
            if name in _COLORANT_TAGS
        }
    except struct.error:
        return None
    if not {b"rXYZ", b"gXYZ", b"bXYZ"} <= found.keys():
        return None
    try:
        colorants = np.stack([found[name] for name in (b"rXYZ", b"gXYZ", b"bXYZ")], axis=1)
        if b"chad" in found:
            native = np.linalg.solve(found[b"chad"].reshape(3, 3), colorants)
        else:
            native = adaptation(_D50, found.get(b"wtpt", _D50)) @ colorants
    except (ValueError, np.linalg.LinAlgError):
        return None
    points = np.column_stack([native, native.sum(axis=1)])
    with np.errstate(all="ignore"):
        places = (points[:2] / points.sum(axis=0)).T
    primaries = tuple(float(each) for each in places.ravel())
    return primaries if is_possible(primaries) else None


def _tags(profile: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield the name and the data of each tag."""
    (count,) = struct.unpack_from(">I", profile, _TAG_COUNT_AT)
    for index in range(min(count, _MOST_TAGS)):
        name, start, size = struct.unpack_from(">4sII", profile, _TAG_COUNT_AT + 4 + 12 * index)
        yield name, profile[start : start + size]


def _curve(data: bytes) -> Curve | None:
    if data[:4] == b"curv":
        (count,) = struct.unpack_from(">I", data, 8)
        if count == 0:
            return lambda values: values
        if count == 1:
            (exponent,) = struct.unpack_from(">H", data, 12)
            return (lambda values: np.maximum(values, 0) ** (exponent / 256)) if exponent else None
        table = np.frombuffer(data, ">u2", offset=12)[:count] / 65535
        if len(table) != count:
            return None
        return lambda values: np.interp(values, np.linspace(0, 1, count), table)
    if data[:4] == b"para":
        (kind,) = struct.unpack_from(">H", data, 8)
        if kind < len(_PARAMETERS):
            numbers = struct.unpack_from(f">{_PARAMETERS[kind]}i", data, 12)
            return _parametric(kind, [number / 65536 for number in numbers])
    return None


def _parametric(kind: int, numbers: list[float]) -> Curve | None:
    """``(a x + b)^g + e`` from d on and ``c x + f`` below it; types leave some of these out.

    None where the exponent g is not positive: that is no curve from black to white.
    """
    g, a, b, c, d, e, f = numbers[0], 1.0, 0.0, 0.0, -np.inf, 0.0, 0.0
    if g <= 0:
        return None
    if kind > 0:
        a, b = numbers[1:3]
        d = -b / a if a else 0.0
    if kind == 2:
        e = f = numbers[3]
    if kind > 2:
        c, d = numbers[3:5]
    if kind == 4:
        e, f = numbers[5:7]

    def curve(values: Array) -> Array:
        with np.errstate(over="ignore"):  # pixels that are not finite are refused later
            above = np.maximum(a * values + b, 0) ** g + e
        return np.where(values >= d, above, c * values + f)

    return curve


def png_primaries(path: Path, has_profile: bool) -> tuple[float, ...] | None:
    """Return the primaries that the chunks of a PNG state: x and y of RGB and white.

    `path` is that of any file; only a PNG states something. `has_profile` tells whether its ICC
    profile tells primaries, over which only ``cICP`` stands.

    References: Portable Network Graphics (PNG) Specification, third edition, 4.3: the order of
    precedence is cICP, iCCP, sRGB, cHRM.
    """
    found = dict(_chunks(path))
    code = found.get(b"cICP", b"")
    if len(code) == 4 and code[0] in _CODES:
        return PRIMARIES[_CODES[code[0]]]
    if has_profile:
        return None
    if b"sRGB" in found:
        return PRIMARIES["rec709"]
    if len(found.get(b"cHRM", b"")) == 32:
        white_x, white_y, *others = (each / 1e5 for each in struct.unpack(">8I", found[b"cHRM"]))
        stated = (*others, white_x, white_y)
        return stated if is_possible(stated) else None
    return None


def _chunks(path: Path) -> Iterator[tuple[bytes, bytes]]:
    """Yield names and contents of the short chunks before the pixels."""
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            return
        for _ in range(_MOST_CHUNKS):
            head = file.read(8)
            if len(head) < 8 or head[4:] == b"IDAT":
                return
            size = int.from_bytes(head[:4], "big")
            if size <= 32:
                yield head[4:], file.read(size)
            else:
                file.seek(size, 1)
            file.seek(4, 1)  # its checksum, which was checked when the file was opened
