"""Maps and probes that are shown together, brought to the same primaries."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.color import conversion, same_primaries, title_of
from shrm_cli.errors import MapError
from shrm_cli.maps.base import ReflectedLight
from shrm_cli.maps.info import MapInfo
from shrm_cli.records import record


@record(eq=False)
class Recolored(ReflectedLight):
    """A map whose radiance is shown in other primaries; that is exact for maps of every form."""

    shown: ReflectedLight
    matrix: Array
    """From the map's linear RGB to that which is wanted, shape (3, 3)."""
    primaries: tuple[float, ...] | None
    """Of that; None is Rec.709."""

    @cached_property
    def info(self) -> MapInfo:
        """How the map was made, with the new primaries."""
        return replace(self.shown.info, chromaticities=self.primaries)

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        return np.asarray(self.shown.radiance(normals, views) @ self.matrix.T)


def in_same_primaries(
    maps: Sequence[ReflectedLight], primaries: tuple[float, ...] | None
) -> list[ReflectedLight]:
    """Return maps that are all shown in the same primaries, which None says are Rec.709."""
    found: list[ReflectedLight] = []
    for each in maps:
        matrix = conversion(each.info.chromaticities, primaries)
        found.append(each if matrix is None else Recolored(each, matrix, primaries))
    return found


def one_of(stated: set[tuple[float, ...] | None]) -> tuple[float, ...] | None:
    """Return the primaries that all maps of a mesh have; None where nobody states any."""
    first, *others = sorted(stated, key=lambda each: each or ()) or [None]
    for other in others:
        if not same_primaries(first, other):
            raise MapError(
                f"maps in {title_of(first)} and in {title_of(other)} do not add up; convert one "
                "of them, by shrm convert MAP --to REPRESENTATION with `working`"
            )
    return next((each for each in stated if each is not None), None)
