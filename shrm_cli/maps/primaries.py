"""Maps in other primaries, without their probes."""

from dataclasses import replace

from shrm_cli.color import conversion
from shrm_cli.maps.base import Map


def with_stated_primaries(found: Map, primaries: tuple[float, ...]) -> Map:
    """Return a map that states other primaries for the numbers that it has."""
    return found.with_planes(
        found.planes(), found.sampling, replace(found.info, chromaticities=primaries)
    )


def in_primaries(found: Map, primaries: tuple[float, ...]) -> Map:
    """Return a map in other primaries, exactly, because what it makes is linear in the light.

    `primaries` are CIE x and y of red, green, blue and white. Those of the map are Rec.709's where
    it tells none. White stays white, by Bradford's adaptation.

    A BRDF with colors stays the one that it was in the old primaries, and so does the record of it.
    The errors that the map states are those in the old primaries.
    """
    matrix = conversion(found.info.chromaticities, primaries)
    info = found.info.in_primaries(primaries)
    if matrix is None:
        return found.with_planes(found.planes(), found.sampling, info)
    return found.mixed(matrix, info)
