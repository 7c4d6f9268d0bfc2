"""The lamps of a map in its file: how they are written, and how they are checked."""

import json
import math
from collections.abc import Sequence

import numpy as np

from shrm_cli.errors import MapError
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.parts import StoredPart
from shrm_cli.maps.lamps.discs import disc_records
from shrm_cli.probe.disc import Disc
from shrm_cli.sphere.directions import normalize

FORMAT = 6
"""The version of files with lamps, which readers that know none of them must refuse."""
FORMAT_WITH_TABLE = 7
"""The version of those that hold a table of the BRDF, too."""
MOST_DISCS = 128
"""The most discs of a map: those of eight lamps, which may be of 16 each."""
_NAME = "shrm:lamps"
_KEYS = {"direction", "radius", "radiance"}
_OFF_UNIT = 1e-3
"""How much the length of a direction may be off 1."""
_LARGEST = 1e6
"""The largest error that is sound."""
_MOST_RADIUS, _MOST_RADIANCE = 90.0, 1e30


def lamps_text(discs: Sequence[Disc], left: float, error: float) -> str:
    """Return the attributes of a `LampMap` as a file holds them."""
    return json.dumps({"left": left, "error": error, "discs": disc_records(discs)})


def read_lamps(part: StoredPart) -> tuple[tuple[Disc, ...], float, float]:
    """Read the discs, `left` and `error` of a `LampMap` from the first part of its file.

    Raises MapError if the discs are unsound, or too many.
    """
    text = part.attribute(_NAME)
    try:
        found = parse_json(text)
        if not isinstance(found, dict) or set(found) != {"left", "error", "discs"}:
            raise ValueError("no lamps")
        discs, (left, error) = found["discs"], _numbers([found["left"], found["error"]])
        if not isinstance(discs, list) or not 1 <= len(discs) <= MOST_DISCS:
            raise ValueError("no list of discs")
        if not (0 <= left <= 1 and 0 <= error <= _LARGEST):
            raise ValueError("no shares")
        return tuple(map(_disc, discs)), left, error
    except (ValueError, TypeError, OverflowError):
        raise MapError(f"{part.path}: its attribute {_NAME} is wrong; make it again") from None


def _disc(values: object) -> Disc:
    """Return a disc of a file.

    Raises ValueError if it is none.
    """
    if not isinstance(values, dict) or set(values) != _KEYS:
        raise ValueError("no disc")
    direction, radiance = (_triple(values[name]) for name in ("direction", "radiance"))
    (radius,) = _numbers([values["radius"]])
    is_unit = abs(math.hypot(*direction) - 1) <= _OFF_UNIT
    is_lit = all(0 <= channel <= _MOST_RADIANCE for channel in radiance)
    if not (is_unit and is_lit and 0 < radius <= _MOST_RADIUS):
        raise ValueError("beyond its range")
    return Disc(normalize(direction), math.radians(radius), np.array(radiance))


def _triple(values: object) -> list[float]:
    if not isinstance(values, list) or len(values) != 3:
        raise ValueError("no three numbers")
    return _numbers(values)


def _numbers(values: list[object]) -> list[float]:
    if not all(isinstance(each, int | float) and not isinstance(each, bool) for each in values):
        raise ValueError("no numbers")
    return [float(each) for each in values]  # type: ignore[arg-type]
