"""Maps at places of a room: looked up where rays meet the box that their probe knows of it.

Each part of a map is looked up by a central direction C. What lies in it from a place, the probe
saw in another direction C'. The surface and the viewer are turned by the least rotation that takes
C to C', and the map is asked for the light of those: all angles of the BRDF stay as they are.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.kinds import ReflectionMap
from shrm_cli.probe.proxy import carried
from shrm_cli.records import record
from shrm_cli.rooms.lit import InGrid
from shrm_cli.sphere.directions import central_directions, horizontal_tangents

_BEYOND = 0.01
"""What lies less than this part of the box's edge beyond it lies at its walls."""

Parts = tuple[tuple[Any, str], ...]
Vectors = tuple[Array, Array, Array | None]


def parts_of(made: Map, shown: ReflectedLight) -> Parts:
    """Return what a map consists of; with a surface it has one part, about the map's center."""
    return shown.parts if isinstance(shown, ReflectionMap) else ((shown, made.center),)


def seen_from(made: Map, center: str, vectors: Vectors, points: Array | None) -> Vectors:
    """Return vectors of surfaces, turned as the probe of a map saw what they look at.

    `center`, one of ``reflection``, ``normal``, ``tangent``, is the central direction. About the
    tangent nothing is turned, as light comes from all around. `vectors`, each of shape (n, 3), are
    normals, views, and tangents or None; unit, world axes. `points`, of shape (n, 3), are in world
    axes. Without them, or where the map knows of no box, nothing is turned.
    """
    box = made.info.proxy
    if points is None or box is None or center not in ("reflection", "normal"):
        return vectors
    normals, views, tangents = vectors
    before = central_directions(center, normals, views)  # type: ignore[arg-type]
    after = box.directions(points, before)
    normals, views = (carried(each, before, after) for each in (normals, views))
    return normals, views, None if tangents is None else carried(tangents, before, after)


def reflected(
    made: Map,
    shown: ReflectedLight,
    vectors: Vectors,
    points: Array | None,
    shares: Array | None = None,
) -> Array:
    """Return the radiance of a map, each part of which is looked up as `seen_from` some points.

    Surfaces in a grid of probes are under the light of the probes about them.

    The shares, where parameters of the BRDF vary, are those of `ReflectedLight.varied_radiance`.
    """
    if points is None or made.info.proxy is None:
        return looked_up(shown, vectors, shares)
    if isinstance(shown, InGrid):
        normals, views, tangents = vectors
        along = horizontal_tangents(normals) if tangents is None else tangents
        return shown.placed_radiance(
            points, normals, along, views, 0.5 if shares is None else shares
        )
    found = [
        looked_up(part, seen_from(made, center, vectors, points), shares)
        for part, center in parts_of(made, shown)
    ]
    return sum(found[1:], found[0])


def looked_up(shown: ReflectedLight, vectors: Vectors, shares: Array | None = None) -> Array:
    """Return the radiance with the tangents and the values that are given."""
    normals, views, tangents = vectors
    if tangents is None:
        return shown.radiance(normals, views)
    if shares is None:
        return shown.brushed_radiance(normals, tangents, views)
    return shown.varied_radiance(normals, tangents, views, shares)


def outside(maps: Sequence[Map], names: Sequence[str], points: Array) -> list[str]:
    """Return a warning about each map in whose box some of what it lights is not.

    `points`, of shape (n, 3), are in world axes. What lies outside is lit as at the walls, so that
    a mesh in the axes and the unit of its own looks like a patchwork of them.
    """
    warnings = []
    for made, name in zip(maps, names, strict=True):
        box = made.info.proxy
        if box is None:
            continue
        slack = _BEYOND * np.subtract(box.high, box.low)
        share = ((points < box.low - slack) | (points > box.high + slack)).any(axis=1).mean()
        if share > _BEYOND:
            low, high = (",".join(f"{each:g}" for each in corner) for corner in (box.low, box.high))
            warnings.append(
                f"{name}: {share:.0%} of what it lights lies outside its box, which goes from "
                f"{low} to {high}, and is lit as at the walls; move it into the box, or look light "
                "up without one"
            )
    return warnings


@record(eq=False)
class Placed(ReflectedLight):
    """A map as a sphere shows it that stands in the room of its probe."""

    made: Map
    shown: ReflectedLight
    """The map with its surface."""
    place: Array
    """The sphere's middle, world axes, shape (3,)."""
    radius: float

    @classmethod
    def of(
        cls, made: Map, shown: ReflectedLight, name: str, place: ArrayLike, radius: float | None
    ) -> "Placed":
        """Place a map; the radius is a tenth of the box's shortest edge by default."""
        box = made.info.proxy
        if box is None:
            raise ArgumentError(
                "place", f"needs a proxy box, and {name} has none; prefilter its probe with `box`"
            )
        edges = np.subtract(box.high, box.low)
        size = float(edges.min()) / 10 if radius is None else radius
        return cls(made, shown, np.asarray(place, dtype=float), size)

    @property
    def info(self) -> MapInfo:
        """How the map was made."""
        return self.shown.info

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        normals, views = np.broadcast_arrays(np.asarray(normals, float), np.asarray(views, float))
        points = self.place + self.radius * normals
        tangents = horizontal_tangents(normals)
        return reflected(self.made, self.shown, (normals, views, tangents), points)
