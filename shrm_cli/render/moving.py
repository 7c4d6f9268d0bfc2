"""Frames: their names, the views of a turntable, and what moves: light and parameters of BRDFs.

Turning the light is turning the surface and the viewer back, whatever the form of a map: with a
rotation M of the light, what a surface of the normal N reflects towards V is what one of the normal
M^-1 N reflects towards M^-1 V under the light at rest. Reflection is linear in the light, so that a
blend of two lights reflects the blend of what they reflect.
"""

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.color import same_primaries
from shrm_cli.errors import MapError, MeshError, OutputError
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.maps.info import MapInfo, same_brdf
from shrm_cli.maps.kinds import LightMap
from shrm_cli.records import record
from shrm_cli.render.camera import Viewer
from shrm_cli.render.scene_file import is_number, read_tables
from shrm_cli.render.sphere import Surroundings
from shrm_cli.render.stage import Reflector
from shrm_cli.render.vertex_colors import VertexColors
from shrm_cli.rooms.lit import STAYS, InGrid
from shrm_cli.sphere.directions import horizontal_tangents, turn_about, turn_matrix
from shrm_cli.vocabulary import MOST_DEGREES

Drawn = TypeVar("Drawn")
_ROUNDING = 1e-6
"""The part of an end that values may be beyond it, which are computed or were written as text."""


@record(eq=False)
class Moment:
    """A frame: where the viewer stands, and what has become of the light and of the surface."""

    viewer: Viewer
    turn: Array | None = None
    """The rotation of the light; None where it is at rest, shape (3, 3)."""
    share: float = 0.0
    """How much of the light, 0 .. 1, is that of the second map."""
    values: Mapping[str, float] = field(default_factory=dict)
    """Values of parameters that vary; the others are in the middle of their ranges."""

    def record(self) -> dict[str, Any]:
        """Return what the recipe of a picture says of it; nothing of what is at rest."""
        turn = None if self.turn is None else np.round(self.turn, 9).tolist()
        known = {"turn_light": turn, "blend": self.share or None, "vary": self.values or None}
        return {key: value for key, value in known.items() if value is not None}

    def moved(self, first: Drawn, second: Drawn | None = None) -> Drawn:
        """Return what is drawn under the light of this moment, with its values.

        `first` is the map, or what reflects it, as it is under the light at rest. `second` is the
        same under the light that this one becomes.
        """
        if second is None or self.share == 0:
            second = None
        elif self.share == 1:
            first, second = second, None
        return self._moved(first, second)

    def behind(self, first: Surroundings, second: Surroundings | None = None) -> Surroundings:
        """Return the surroundings at this moment."""
        second = first if second is None else second
        return _Behind(first, second, self.share, np.eye(3) if self.turn is None else self.turn)

    def _moved(self, first: Any, second: Any) -> Any:
        if isinstance(first, list):
            pairs = list(zip(first, second or [None] * len(first), strict=True))
            # All looks of a mesh with its own shadows are one and the same.
            known = {tuple(map(id, pair)): pair for pair in pairs}
            moved = {key: self._moved(*pair) for key, pair in known.items()}
            return [moved[tuple(map(id, pair))] for pair in pairs]
        if first is not None and self.values:
            first = first.with_values(self.values)
            second = second and second.with_values(self.values)
        return self._relit(first, second)

    def _relit(self, first: Any, second: Any) -> Any:
        """Move the light alone: who reflects it has told which of its parts take the values."""
        if first is None or (self.turn is None and second is None):
            return first
        if isinstance(first, VertexColors):
            return first.under(self.turn, second, self.share)
        if isinstance(first, Reflector):
            if self.turn is None:  # each stays in the box of its own room
                return replace(first, other=second, share=self.share)
            return replace(
                first,
                map=self._relit(first.map, second and second.map),
                shown=self._relit(first.shown, second and second.shown),
                irradiance=self._relit(first.irradiance, second and second.irradiance),
                varied=self._relit(first.varied, second and second.varied),
                is_boxed=False,
            )
        if isinstance(first, InGrid):
            raise MapError(STAYS)
        return MovedMap(first, second, self.share, np.eye(3) if self.turn is None else self.turn)


@record(eq=False)
class MovedMap(ReflectedLight):
    """A map, or one with a surface, under light that has moved."""

    first: Any
    second: Any
    """`first` and `second`: under the light at rest, and under the one that it becomes; None where
    it becomes no other. Each is a ReflectedLight or a VariedSurface."""
    share: float
    """How much of the light is that of the second one."""
    turn: Array
    """The rotation of the light, shape (3, 3)."""

    @property
    def info(self) -> MapInfo:
        """How the first map was made; the box of a room does not turn with the light."""
        return self.first.info.without_box()

    @property
    def varies(self) -> int:
        """How many parameters of the BRDF vary in the first map."""
        return self.first.varies

    @property
    def center(self) -> str:
        """The central direction of the first map."""
        return self.first.center

    def radiance(
        self,
        normals: ArrayLike,
        views: ArrayLike,
        tangents: ArrayLike | None = None,
        *surface: ArrayLike,
    ) -> Array:
        if surface:
            places = [
                None if each is None else np.asarray(each) @ self.turn
                for each in (normals, views, tangents)
            ]
            return self._blend(lambda each: each.radiance(*places, *surface))
        along = horizontal_tangents(np.asarray(normals, dtype=float))
        return self.brushed_radiance(normals, along if tangents is None else tangents, views)

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        normals, tangents, views = (
            np.asarray(each) @ self.turn for each in (normals, tangents, views)
        )
        return self._blend(lambda each: each.brushed_radiance(normals, tangents, views))

    def varied_radiance(
        self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike, shares: ArrayLike
    ) -> Array:
        places = [np.asarray(each) @ self.turn for each in (normals, tangents, views)]
        return self._blend(lambda each: each.varied_radiance(*places, shares))

    def _blend(self, seen: Any) -> Array:
        found: Array = seen(self.first)
        if self.second is None:
            return found
        return (1 - self.share) * found + self.share * seen(self.second)


@record(eq=False)
class _Behind:
    """What is behind the subject; attributes as `MovedMap` has them."""

    first: Surroundings
    second: Surroundings
    share: float
    turn: Array

    def radiance(self, directions: ArrayLike) -> Array:
        """Return the radiance from directions."""
        places = np.asarray(directions) @ self.turn
        if self.share == 0:
            return self.first.radiance(places)
        second = self.second.radiance(places)
        return (1 - self.share) * self.first.radiance(places) + self.share * second


def moving_light(
    viewer: Viewer,
    frames: int | None,
    turn: tuple[ArrayLike, float] | None = None,
    share: float | None = None,
) -> list[Moment]:
    """Return frames in which the light moves, and the viewer stands still.

    `frames` is how many; by default a single picture, of the end of the way. `turn` is the axis and
    the angle of the turn, degrees. Frames turn on by equal steps from 0, so that after the last one
    a whole turn begins anew. `share` is how much of the light is that of the second map in the last
    frame; the first has none of it.
    """
    found = []
    for k in range(frames or 1):
        turned = 1.0 if frames is None else k / frames
        blended = 1.0 if frames is None else k / max(frames - 1, 1)
        matrix = None if turn is None else turn_about(turn[0], turned * turn[1])
        found.append(Moment(viewer, matrix, blended * (share or 0.0)))
    return found


def with_ways(frames: Sequence[Moment], ways: Mapping[str, tuple[float, float]]) -> list[Moment]:
    """Return frames in which parameters go from a first value to a last one by equal steps."""
    last = max(len(frames) - 1, 1)
    return [
        replace(each, values={name: a + (b - a) * k / last for name, (a, b) in ways.items()})
        for k, each in enumerate(frames)
    ]


def told_of_rest(frames: Sequence[Moment]) -> list[str]:
    """Return a line that says so where several frames are alike."""
    first, *others = frames

    def is_like(each: Moment) -> bool:
        turn, other = (np.eye(3) if k.turn is None else k.turn for k in (first, each))
        same = (first.viewer, first.share, first.values) == (each.viewer, each.share, each.values)
        return same and np.allclose(turn, other, rtol=0, atol=1e-9)

    if not others or not all(map(is_like, others)):
        return []
    return [f"nothing moves: its {len(frames):,} frames are alike"]


def check_values(frames: Iterable[Moment], maps: Sequence[Map]) -> None:
    """Check that values are those of parameters that vary in maps."""
    ways = [way for each in maps for way in each.ways.items()]
    for name, value in sorted({pair for each in frames for pair in each.values.items()}):
        own = [ends for known, ends in ways if known == name]
        if not own:
            known = ", ".join(sorted({known for known, _ in ways}))
            hint = f"there is {known}" if known else "shrm product --vary makes maps that have some"
            raise MapError(f"no map has a parameter {name[:40]!r} that varies; {hint}")
        low, high = max(a for a, _ in own), min(b for _, b in own)
        if not low - _ROUNDING * abs(low) <= value <= high + _ROUNDING * abs(high):
            raise MapError(f"{name} varies from {low:g} to {high:g}, and cannot be {value:g}")


def check_blend(first: Map, second: Map, name: str) -> None:
    """Check that the light of one map can become that of another."""
    one, other = first.info, second.info
    # Metals have other values in other primaries, so that these are the reason where both differ.
    if not same_primaries(one.chromaticities, other.chromaticities):
        raise MapError(
            f"{name}: its primaries are not those of the map whose light becomes its own; "
            "prefilter one with `working`, or convert it by shrm convert --working"
        )
    are_lights = isinstance(first, LightMap), isinstance(second, LightMap)
    if are_lights[0] != are_lights[1] or not same_brdf(one.brdf, other.brdf):
        raise MapError(
            f"{name}: it is of another BRDF than the map whose light becomes its own; prefilter "
            "both for the same one"
        )


_NUMBER = re.compile(r"%0([1-9]\d?)d")
_LIKE_NUMBER = re.compile(r"%\d*d")
"""What is meant as the place of a number, be it one such as `_NUMBER` or not."""


def frame_paths(pattern: str, count: int) -> list[str]:
    """Return the names of frames, numbered from 1 where the pattern has ``%04d`` or the like."""
    folder, name = os.path.split(pattern)
    if len(_NUMBER.findall(name)) != 1:
        stem, suffix = os.path.splitext(name)
        bare = _LIKE_NUMBER.sub("", stem).rstrip(".")
        example = f"{bare or 'frame'}.%04d{suffix}"
        raise OutputError(f"{pattern}: frames need one place for their number, such as {example}")
    before, digits, after = _NUMBER.split(name)
    return [os.path.join(folder, f"{before}{k:0{digits}d}{after}") for k in range(1, count + 1)]


def check_one_file(name: str, what: str) -> None:
    """Check that the name of what is one file has no place for a number."""
    if _LIKE_NUMBER.search(os.path.basename(name)):
        raise OutputError(f"{name}: {what} is one file; leave the number out of its name")


def turntable(first: Viewer, count: int) -> list[Viewer]:
    """Return views at equal steps of a full turn about +Y, towards growing azimuth."""
    return [first.turned(360 * k / count) for k in range(count)]


# ---- keyframes -----------------------------------------------------------------------------------
# Keyframes of scene files say what light, viewer and parameters of BRDFs do over the frames. An
# example, with everything that a key may have:
#
#     [[key]]
#     frame = 1               # from 1, rising
#     turn = 0                # of the light about +Y, degrees; or [yaw, pitch, roll]
#     blend = 0               # how much of the light is that of --blend-to
#     view = [30, 10]         # azimuth and elevation of the viewer
#     vary = {ay = 0.3}       # values of parameters that vary, where nothing else tells them
#
# Each of these is a line between the keys that name it, and constant before the first and after the
# last of them.

MOST_FRAMES = 9999
_KEYS = "frame", "turn", "blend", "view", "vary"


@record
class Key:
    """A keyframe."""

    frame: int
    """The number of the frame, from 1."""
    turn: tuple[float, ...] | None = None
    """Yaw, pitch and roll of the light, degrees."""
    blend: float | None = None
    """How much of the light, 0 .. 1, is that of the second map."""
    view: tuple[float, ...] | None = None
    """Azimuth and elevation of the viewer, degrees."""
    vary: Mapping[str, float] = field(default_factory=dict)
    """Values of parameters."""


def read_keys(path: str | os.PathLike[str]) -> list[Key]:
    """Return the keyframes of a scene file; there may be none."""
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
    turn = [turn, 0, 0] if is_number(turn, MOST_DEGREES) else turn
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
    if not all(is_number(each, MOST_DEGREES) for each in value):
        raise ValueError(f"{key} must have finite numbers up to {MOST_DEGREES:g}")
    return tuple(float(each) for each in value)
