"""The transfer curve of an ICC profile, which tells how integer pixels encode light."""

import struct
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
Curve = Callable[[Array], Array]

_TAG_COUNT_AT = 128
_MOST_TAGS = 200
_PARAMETERS = (1, 3, 4, 5, 7)
"""How many parameters a parametric curve of each type has."""


def linear_curve(profile: bytes) -> Curve | None:
    """From encoded values in 0 .. 1 to linear ones, as a profile's red or grey curve has it.

    Parameters
    ----------
    profile : bytes

    Returns
    -------
    callable or None
        None where the profile holds no such curve, as those of printers do.

    References
    ----------
    ICC.1:2022, 7.3 (tags), 10.6 (curveType), 10.18 (parametricCurveType).
    """
    try:
        (count,) = struct.unpack_from(">I", profile, _TAG_COUNT_AT)
        for index in range(min(count, _MOST_TAGS)):
            name, start, size = struct.unpack_from(">4sII", profile, _TAG_COUNT_AT + 4 + 12 * index)
            if name in (b"rTRC", b"kTRC"):
                return _curve(profile[start : start + size])
    except (struct.error, ValueError):  # the profile is cut short
        pass
    return None


def _curve(data: bytes) -> Curve | None:
    """The curve of one tag."""
    if data[:4] == b"curv":
        (count,) = struct.unpack_from(">I", data, 8)
        if count == 0:
            return _identity
        if count == 1:
            return _power(struct.unpack_from(">H", data, 12)[0] / 256)
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


def _identity(values: Array) -> Array:
    return values


def _power(exponent: float) -> Curve:
    return lambda values: np.maximum(values, 0) ** exponent


def _parametric(kind: int, numbers: list[float]) -> Curve:
    """``(a x + b)^g + e`` from d on and ``c x + f`` below it; types leave some of these out."""
    g, a, b, c, d, e, f = numbers[0], 1.0, 0.0, 0.0, -np.inf, 0.0, 0.0
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
        above = np.maximum(a * values + b, 0) ** g + e
        return np.where(values >= d, above, c * values + f)

    return curve
