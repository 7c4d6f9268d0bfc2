"""A map of what is left of a probe without its lamps, with these beside it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import MapError
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.parts import StoredPart
from shrm_cli.maps.base import Map
from shrm_cli.maps.info import ERRORS, MapInfo, common_brdf
from shrm_cli.maps.kinds import ReflectionMap
from shrm_cli.maps.lamps.lobe import LobeTable, table_bytes
from shrm_cli.maps.lamps.rule import LitDiscs, disc_records
from shrm_cli.probe.disc import BRIGHTEST, Disc
from shrm_cli.records import handed_on, record
from shrm_cli.sphere.directions import bisector, normalize
from shrm_cli.vocabulary import Frame, Sampling

if TYPE_CHECKING:
    from shrm_cli.files.parts import Part
    from shrm_cli.maps.shrm.shrm import Shrm

DIM_THE_REST = "dim what is left by `clamp`"
"""What helps against what is wrong with a map beside which its lamps are already."""
FORMAT = 6
"""The version of files with lamps, which readers that know none of them must refuse."""
FORMAT_WITH_TABLE = 7
"""The version of those that hold a table of the BRDF, too."""


@record(eq=False)
class LampMap(ReflectionMap):
    """A map for a BRDF of the light without lamps, and the lamps, which `radiance` adds.

    What it is and how it is stored, it is as the map within: its representation is that of it.
    """

    map: Map
    """The map of the residual, with what it holds of what discs differ by from the lamps."""
    discs: tuple[Disc, ...]
    """The lamps, world axes; at least one."""
    left: float
    """The RMS of the reflected light without that of the lamps, over that of all. The errors of the
    map within are relative to the former, and those that this map states to the latter."""
    error: float
    """The RMS of what is wrong with the light of the lamps, over that of all: what discs differ by
    from their pixels, but for what the map holds of it, and a table from the BRDF."""
    known: Brdf | None = None
    """The BRDF, where it is at hand, or a `LobeTable` of it, which the file of the map holds. It is
    found by the record of the map otherwise."""
    path: str = ""
    """The file of the map, beside which a measured BRDF is looked for."""
    precision: type = field(default=np.float64, repr=False)
    """The precision at which the lamps are integrated."""

    format_version = FORMAT

    representation = handed_on("map", "representation")
    frame = handed_on("map", "frame")
    center = handed_on("map", "center")
    size = handed_on("map", "size")
    sampling = handed_on("map", "sampling")
    natural_precision = handed_on("map", "natural_precision")
    is_rearrangeable = handed_on("map", "is_rearrangeable")
    against_negatives = DIM_THE_REST
    is_exact_in_half = handed_on("map", "is_exact_in_half")
    turns_with_texels = handed_on("map", "turns_with_texels")
    texels_are_series = handed_on("map", "texels_are_series")
    cube_count = handed_on("map", "cube_count")

    @cached_property
    def info(self) -> MapInfo:
        """How it was made, with errors relative to all of the reflected light."""
        return replace(self.map.info, **self._scaled(self.map.info.errors))

    @property
    def stated_error(self) -> float:
        return math.hypot(self.info.stated_error, self.error)

    @property
    def stored(self) -> Map:
        return self.map

    def _scaled(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return those errors among some values that are relative to the reflected light."""
        return {name: self.left * values[name] for name in ERRORS if name in values}

    @cached_property
    def lamps(self) -> LitDiscs:
        """The lamps and the BRDF that reflects them.

        Raises BrdfError if the BRDF cannot be evaluated, such as a measured one that is not beside
        the map.
        """
        advice = "make it without `sun`"
        brdf = self.known or common_brdf({self.path: self.info}, advice)
        return LitDiscs(brdf, self.discs, self.precision)

    def shaded(self, *surface: object, **named: object) -> LampMap:
        """Return the map as pictures show it, for which single precision does."""
        return replace(self, known=self.lamps.brdf, precision=np.float32)

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the reflected radiance: that of the map within and that of the lamps.

        Parameters and result are those of `Map.radiance`.
        """
        return np.asarray(self.map.radiance(normals, views) + self.lamps.radiance(normals, views))

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        points = normals, tangents, views
        return np.asarray(
            self.map.shaded().brushed_radiance(*points) + self.lamps.brushed_radiance(*points)
        )

    def rough_radiance(self, reflections: Array, views: Array) -> Array:
        """Evaluate it roughly; the lamps are exact."""
        lamps = self.lamps.radiance(bisector(reflections, views), views)
        return np.asarray(self.map.shaded().rough_radiance(reflections, views) + lamps)

    @property
    def parts(self) -> tuple[tuple[Any, str], ...]:
        return (*self.map.parts, (self.lamps, self.lamps.brdf.center))

    def planes(self) -> Sequence[Array]:
        return self.map.planes()

    def with_planes(self, planes: Sequence[Array], sampling: Sampling, info: MapInfo) -> LampMap:
        own = replace(self.map.info, chromaticities=info.chromaticities, options=info.options)
        return replace(self, map=self.map.with_planes(planes, sampling, own))

    def with_info(self, info: MapInfo) -> LampMap:
        """Return it with another record of the options; the errors stay those of the map within."""
        own = replace(self.map.info, options=info.options)
        return replace(self, map=self.map.with_info(own))

    def summary(self) -> dict[str, Any]:
        of_map = self.map.summary()
        lamps = {"lamps": disc_records(self.discs), "lamp_error": self.error}
        return {**of_map, **self._scaled(of_map), **lamps}

    def details(self) -> dict[str, Any]:
        return self.map.details()

    def resampled(self, size: int | None = None, sampling: Sampling | None = None) -> LampMap:
        return replace(self, map=self.map.resampled(size, sampling))

    def to_shrm(self, order_p: int | None = None, frame: Frame | None = None) -> Shrm:
        """Refuse to lose the lamps."""
        raise MapError(f"{self.what} has lamps beside it, which an SHRM does not hold")

    def converted(self, to: str, *given: Any, **options: Any) -> LampMap:
        return replace(self, map=self.map.converted(to, *given, **options))

    def mixed(self, matrix: Array, info: MapInfo) -> LampMap:
        """Refuse other primaries, in which a BRDF with colors would not be the same."""
        raise MapError(
            f"{self.what} has lamps beside it, whose BRDF is in the primaries of the map; "
            "prefilter its probe with `working`"
        )

    @property
    def table(self) -> LobeTable | None:
        """The table of the BRDF, where the file holds one."""
        return self.known if isinstance(self.known, LobeTable) else None

    @property
    def table_bytes(self) -> int:  # type: ignore[override]
        return table_bytes(self.known)

    def encode(self) -> list[Part]:
        """Return the parts of the map within, the first of which says what lamps there are.

        A table of the BRDF follows them.
        """
        parts, table = self.map.encode(), self.table
        for part in parts:
            part.header["shrm:version"] = FORMAT if table is None else FORMAT_WITH_TABLE
        parts[0].header[_NAME] = json.dumps(
            {"left": self.left, "error": self.error, "discs": disc_records(self.discs)}
        )
        if table is None:
            return parts
        parts[0].header.setdefault("name", "map")
        return [*parts, table.part()]


# ---- in files ------------------------------------------------------------------------------------

MOST_DISCS = 128
"""The most discs of a map: those of eight lamps, which may be of 16 each."""
_NAME = "shrm:lamps"
_KEYS = {"direction", "radius", "radiance"}
_OFF_UNIT = 1e-3
"""How much the length of a direction may be off 1."""
_LARGEST = 1e6
"""The largest error that is sound."""
_MOST_RADIUS = 90.0


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
        raise MapError.of_attribute(part.path, "lamps") from None


def _disc(values: object) -> Disc:
    """Return a disc of a file.

    Raises ValueError if it is none.
    """
    if not isinstance(values, dict) or set(values) != _KEYS:
        raise ValueError("no disc")
    direction, radiance = (_triple(values[name]) for name in ("direction", "radiance"))
    (radius,) = _numbers([values["radius"]])
    is_unit = abs(math.hypot(*direction) - 1) <= _OFF_UNIT
    is_lit = all(abs(channel) <= BRIGHTEST for channel in radiance)
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
