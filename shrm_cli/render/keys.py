"""Keyframes of scene files: what light, viewer and parameters of BRDFs do over the frames.

An example, with everything that a key may have:

    [[key]]
    frame = 1               # from 1, rising
    turn = 0                # of the light about +Y, degrees; or [yaw, pitch, roll]
    blend = 0               # how much of the light is that of --blend-to
    view = [30, 10]         # azimuth and elevation of the viewer
    vary = {ay = 0.3}       # values of parameters that vary, where nothing else tells them

Each of these is a line between the keys that name it, and constant before the first and after the
last of them.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.records import record
from shrm_cli.render.camera import Viewer
from shrm_cli.render.moving import Moment
from shrm_cli.render.scene_file import is_number, read_tables
from shrm_cli.sphere.directions import turn_matrix

MOST_FRAMES = 9999
_LARGEST = 1e6
_KEYS = "frame", "turn", "blend", "view", "vary"


@record
class Key:
    """A keyframe."""

    frame: int
    """From 1."""
    turn: tuple[float, ...] | None = None
    """Yaw, pitch and roll of the light, degrees."""
    blend: float | None = None
    """How much of the light, 0 .. 1, is that of the second map."""
    view: tuple[float, ...] | None = None
    """Azimuth and elevation of the viewer, degrees."""
    vary: Mapping[str, float] = field(default_factory=dict)
    """Values of parameters."""


def read_keys(path: str | os.PathLike[str]) -> list[Key]:
    """Return the keyframes of a scene file; there may be none.

    Raises MeshError if it is no scene file, or a key is not as the top of this module has it.
    """
    name = os.fspath(path)
    keys: list[Key] = []
    for index, each in enumerate(read_tables(name)[1], 1):
        try:
            keys.append(_key(each, keys[-1].frame if keys else 0))
        except ValueError as error:
            raise MeshError(f"{name}: key {index}: {error}") from None
    return keys


def moments_between(keys: Sequence[Key], viewer: Viewer) -> list[Moment]:
    """Return all frames up to the last key's.

    `keys` are at least one. `viewer` holds where no key tells the view.
    """
    frames = np.arange(1.0, keys[-1].frame + 1)
    turns, shares, views = (
        _between([(each.frame, getattr(each, name)) for each in keys], frames)
        for name in ("turn", "blend", "view")
    )
    values = {
        name: _between([(each.frame, each.vary.get(name)) for each in keys], frames)
        for name in sorted({name for each in keys for name in each.vary})
    }
    return [
        Moment(
            viewer if views is None else Viewer(*map(float, views[k])),
            None if turns is None else turn_matrix(*turns[k]),
            0.0 if shares is None else float(shares[k, 0]),
            {name: float(own[k, 0]) for name, own in values.items() if own is not None},
        )
        for k in range(len(frames))
    ]


def _between(keys: Sequence[tuple[int, Any]], frames: Array) -> Array | None:
    """Interpolate what some keys name at all frames, shape (frames, numbers)."""
    at = [frame for frame, value in keys if value is not None]
    if not at:
        return None
    known = [value for _, value in keys if value is not None]
    columns = np.array(known, dtype=float).reshape(len(known), -1).T
    return np.stack([np.interp(frames, at, column) for column in columns], axis=-1)


def _key(given: Mapping[str, Any], before: int) -> Key:
    unknown = sorted(set(given) - set(_KEYS))
    if unknown:
        raise ValueError(f"{unknown[0][:40]!r} is none of {', '.join(_KEYS)}; correct it")
    frame = given.get("frame")
    is_whole = isinstance(frame, int) and not isinstance(frame, bool)
    if not is_whole or not before < frame <= MOST_FRAMES:  # type: ignore[operator]
        raise ValueError(f"frame must be a whole number within {before + 1} .. {MOST_FRAMES}")
    turn, view, blend = given.get("turn"), given.get("view"), given.get("blend")
    turn = [turn, 0, 0] if is_number(turn, _LARGEST) else turn
    if blend is not None and not (is_number(blend, 1.0) and blend >= 0):
        raise ValueError("blend must be a number within 0 .. 1")
    vary = given.get("vary", {})
    if not isinstance(vary, dict) or not all(is_number(each) for each in vary.values()):
        raise ValueError("vary must be values of parameters, such as {ay = 0.3}")
    numbers = _numbers("turn", turn, 3), blend, _numbers("view", view, 2)
    found = Key(int(frame), *numbers, vary)  # type: ignore[arg-type]
    if found.view and abs(found.view[1]) > 90:
        raise ValueError(f"view has an elevation of {found.view[1]:g}, outside -90 .. 90")
    return found


def _numbers(key: str, value: Any, count: int) -> tuple[float, ...] | None:
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != count:
        said = "a number or three, [yaw, pitch, roll]" if key == "turn" else "[azimuth, elevation]"
        raise ValueError(f"{key} must be {said}, degrees")
    if not all(is_number(each, _LARGEST) for each in value):
        raise ValueError(f"{key} must have finite numbers up to {_LARGEST:g}")
    return tuple(float(each) for each in value)
