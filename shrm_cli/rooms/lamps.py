"""Lamps of a room as triangles of one radiance each, whose light at any point is known.

The irradiance from a polygon of radiance L is ``L / 2`` times the sum over its edges of ``angle
(axis . N)``: the angle that the edge fills, and the axis of the plane through it and the point
(Lambert 1760). Of one that the surface's horizon cuts, the part above counts, and the way along the
horizon is one more edge.

A harmonic of degree l is an eigenfunction of the Laplacian over the sphere. So its integral over a
polygon is one along the edges, of its derivative across them, over ``l (l+1)``. Along an arc that
is a trigonometric polynomial of degree l.

What hides lamps is known at probes, and interpolated: each has a share of a lamp that it sees.

References: Lambert 1760, Photometria. Arvo 1995, Analytic Methods for Simulated Light Transport,
chapter 2. Wang and Ramamoorthi 2018, Analytic Spherical Harmonic Coefficients for Polygonal Area
Lights, has the same coefficients by zonal harmonics.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.geometry.mesh import Integers
from shrm_cli.geometry.rays import cross, dot
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles
from shrm_cli.sphere.harmonics import degrees, harmonic_planes, real_harmonics
from shrm_cli.sphere.quadrature import gauss_legendre

MOST_LAMPS = 64
MOST_TRIANGLES = 1024
"""`MOST_LAMPS`, `MOST_TRIANGLES`: the most of a room, as each is looked for at every point."""
_OF_LAMP = 128
"""The most triangles of a lamp; where it has more, corners are brought together."""
_COARSER = 1.25
"""How many times as far apart as before corners may be, until the triangles are few enough."""
_RULES = (0.0, None), (4.0, (1 - np.eye(3)) / 2), (10.0, np.full((1, 3), 1 / 3))
"""How triangles are integrated, from the nearest to the farthest: a distance in units of the
longest edge, and the points that stand for the triangle from there on, as weights of its corners.
They are the middles of its edges, or its own, and off by less than a hundredth of the light. Where
there are none, the integral is exact."""


@record(eq=False)
class Lamps:
    """Triangles that send light, from the side about which their corners are right-handed."""

    corners: Array
    """World axes, shape (k, 3, 3)."""
    radiance: Array
    """Shape (k, 3)."""
    of: NDArray[np.int64]
    """The lamp that a triangle belongs to, 0 .. m-1, shape (k,)."""

    def irradiance(self, points: Array, normals: Array, shares: Array) -> Array:
        """Return the irradiance of surfaces, shape (n, 3).

        `points` and `normals`, of shape (n, 3), are in world axes. `shares`, of shape (n, m), are
        how much of each lamp is seen.
        """
        found = np.zeros((len(points), 3))
        for triangle, own, rule in self._seen(points, shares):
            ways, facing = self._ways(triangle, points[own]), normals[own].T
            if rule is None or len(rule) > 1:
                values = polygon_irradiance(ways, facing)
            else:
                ((direction, area),) = _points(ways, rule)
                values = area * np.maximum(dot(direction, facing), 0)
            values *= shares[own, self.of[triangle]]
            found[own] += values[:, None] * self.radiance[triangle]
        return found

    def coefficients(self, points: Array, order: int, shares: Array) -> Array:
        """Return the light over harmonics of world axes, shape (n, (order+1)^2, 3)."""
        found = np.zeros((len(points), (order + 1) ** 2, 3))
        for triangle, own, rule in self._seen(points, shares):
            ways = self._ways(triangle, points[own])
            if rule is None:
                values = polygon_coefficients(ways, order)
            else:
                values = np.zeros((len(own), (order + 1) ** 2))
                for direction, area in _points(ways, rule):
                    values += area[:, None] * real_harmonics(order, direction.T)
            values *= shares[own, self.of[triangle], None]
            found[own] += values[..., None] * self.radiance[triangle]
        return found

    def _ways(self, triangle: int, points: Array) -> Array:
        """Return the ways from points to a triangle's corners, shape (3 corners, 3 axes, n)."""
        return np.asarray(self.corners[triangle][..., None] - points.T)

    def _seen(
        self, points: Array, shares: Array
    ) -> Iterator[tuple[int, NDArray[np.intp], Array | None]]:
        """Yield triangles, some points that see their front, and the rule that will do there."""
        for triangle, (a, b, c) in enumerate(self.corners):
            front = np.cross(b - a, c - a)
            longest = max(np.linalg.norm(each) for each in (b - a, c - b, a - c))
            own = np.flatnonzero((shares[:, self.of[triangle]] > 0) & ((points - a) @ front > 0))
            away = np.linalg.norm(points[own] - (a + b + c) / 3, axis=1)
            band = np.searchsorted([start * longest for start, _ in _RULES[1:]], away)
            for number, (_, rule) in enumerate(_RULES):
                if (band == number).any():
                    yield triangle, own[band == number], rule


@record(eq=False)
class SeenLamps:
    """What probes know of lamps."""

    lamps: Lamps
    seen: Array
    """How much of each lamp a probe sees; -1 where it is behind all of the lamp, shape (n, m)."""
    others: Array
    """Coefficients of what comes straight from lamps besides: what those parts of lamps that are
    seen send more or less than as much of all, and other lamps, shape (n, (order+1)^2, 3)."""

    def shares(self, probes: Array, weights: Array) -> Array:
        """Return how much points see of each lamp, shape (n, m), as the probes that know it do.

        `probes` and `weights`, of shape (n, 8), are those about each point.
        """
        total, known = np.zeros((2, len(probes), self.seen.shape[1]))
        for probe, weight in zip(probes.T, weights.T, strict=True):
            own = self.seen[probe]
            known += weight[:, None] * (own >= 0)
            total += weight[:, None] * np.maximum(own, 0)
        return np.asarray(total / np.maximum(known, np.finfo(float).tiny))


# ---- the lamps of a room -------------------------------------------------------------------------


@record(eq=False)
class Group:
    """Triangles of a room that touch each other, which are one lamp."""

    rows: Integers
    """Their numbers among all triangles that send light, shape (f,)."""
    lamps: Lamps
    """The lamp: these triangles, or a few that stand for them."""


def lamps_of(corners: Array, radiance: Array) -> list[Group]:
    """Return the lamps that triangles (f, 3, 3) of some radiance (f, 3) are, the brightest first.

    There are `MOST_LAMPS`, with `MOST_TRIANGLES` in all, at most. What more there are is left out.
    """
    points, places = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    numbers = _touching(places.reshape(-1, 3), len(points))
    power = areas(corners) * radiance.sum(axis=1)
    _, lamp = np.unique(numbers, return_inverse=True)
    found: list[Group] = []
    room = MOST_TRIANGLES
    for number in np.argsort(-np.bincount(lamp, power), kind="stable")[:MOST_LAMPS]:
        rows = np.flatnonzero(lamp == number)
        few, sent = _simplified(corners[rows], radiance[rows])
        if 0 < len(few) <= room:
            found.append(Group(rows, Lamps(few, sent, np.zeros(len(few), np.int64))))
            room -= len(few)
    return found


def joined(groups: Sequence[Group]) -> Lamps:
    """Return the lamps of groups, one at least."""
    each = [group.lamps for group in groups]
    of = np.repeat(np.arange(len(each)), [len(lamps.of) for lamps in each])
    return Lamps(
        np.concatenate([lamps.corners for lamps in each]),
        np.concatenate([lamps.radiance for lamps in each]), of,
    )  # fmt: skip


def _touching(places: Integers, count: int) -> Integers:
    """Return a number for each triangle, the same for all that are joined by their corners.

    `places`, of shape (f, 3), are the numbers of corners, of which there are `count`.
    """
    least = np.arange(count)
    while True:
        found = least.copy()
        np.minimum.at(found, places, least[places].min(axis=1, keepdims=True))
        found = found[found]
        if np.array_equal(found, least):
            return np.asarray(least[places[:, 0]])
        least = found


def areas(corners: Array) -> Array:
    """Return the areas of triangles (f, 3, 3), shape (f,)."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(across, axis=1) / 2)


def _simplified(corners: Array, radiance: Array) -> tuple[Array, Array]:
    """Return few triangles of the same power in place of many.

    Corners that lie in the same cell of a lattice become one, in their middle.
    """
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max()) / _OF_LAMP
    kept, sent = corners, radiance
    while len(kept) > _OF_LAMP:
        size *= _COARSER
        cells = np.round(corners.reshape(-1, 3) / size)
        _, place, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        place = place.reshape(-1)
        flat = [np.bincount(place, axis) / count for axis in corners.reshape(-1, 3).T]
        moved = np.stack(flat, axis=-1)[place].reshape(-1, 3, 3)
        own = areas(moved) > 0
        kept, sent = moved[own], radiance[own]
    power, left = (areas(each) @ of for each, of in ((corners, radiance), (kept, sent)))
    return kept, sent * power / np.maximum(left, np.finfo(float).tiny)


# ---- closed forms --------------------------------------------------------------------------------
# Ways from points to the corners of polygons are of shape (corners, 3, n): numpy is slow along axes
# of three. Seen from the points, corners go round counterclockwise.


def _edges(ways: Array) -> Iterator[tuple[Array, Array]]:
    """Yield the directions of both ends of each edge."""
    length = np.sqrt(np.sum(ways**2, axis=1, keepdims=True))
    directions = ways / np.maximum(length, np.finfo(float).tiny)
    return zip(directions, np.roll(directions, -1, axis=0), strict=True)


def _length(vectors: Array) -> Array:
    return np.asarray(np.sqrt(dot(vectors, vectors)))


def _axis(first: Array, second: Array) -> tuple[Array, Array]:
    """Return the unit axis about which the first turns to the second, and by how much, radians."""
    axis = cross(first, second)
    length = _length(axis)
    return axis / np.maximum(length, np.finfo(float).tiny), np.arctan2(length, dot(first, second))


def polygon_irradiance(ways: Array, normals: Array) -> Array:
    """Return the irradiance from convex polygons of radiance 1, shape (n,).

    `normals`, of shape (3, n), are those of the surfaces. What is below the horizon does not count.
    """
    total, leaving, entering = (np.zeros(normals.shape) for _ in range(3))
    for first, second in _edges(ways):
        high, next_high = dot(first, normals), dot(second, normals)
        axis, _ = _axis(first, second)
        # A sum with weights at least 0 lies between both.
        crossing = np.abs(next_high) * first + np.abs(high) * second
        start = np.where(high > 0, first, crossing)
        _, angle = _axis(start, np.where(next_high > 0, second, crossing))
        total += angle * axis
        leaving += np.where((high > 0) & (next_high <= 0), crossing, 0)
        entering += np.where((high <= 0) & (next_high > 0), crossing, 0)
    axis, angle = _axis(leaving, entering)
    return np.asarray(np.maximum(-dot(total + angle * axis, normals) / 2, 0))


def polygon_coefficients(ways: Array, order: int) -> Array:
    """Return the coefficients of triangles of radiance 1, shape (n, (order+1)^2)."""
    found = np.zeros(((order + 1) ** 2, ways.shape[-1]))
    found[0] = _solid_angle(ways) / np.sqrt(4 * np.pi)
    if order == 0:
        return found.T
    # Waves of order - 1 at most, over half a turn at most.
    places, weights = gauss_legendre(order + 2)
    for first, second in _edges(ways):
        axis, angle = _axis(first, second)
        beside = cross(axis, first)
        along = np.zeros((order**2, len(angle)))
        for place, weight in zip((places + 1) / 2, weights / 2, strict=True):
            arc = np.cos(place * angle) * first + np.sin(place * angle) * beside
            along += weight * harmonic_planes(order - 1, arc.T)
        along *= angle
        for across, component in zip(_derivatives(order), axis, strict=True):
            found -= component * (across.T @ along)
    return found.T


def _solid_angle(ways: Array) -> Array:
    """Return the solid angles of triangles, after Van Oosterom and Strackee 1983, shape (n,)."""
    a, b, c = ways
    lengths = [_length(each) for each in ways]
    below = np.prod(lengths, axis=0)
    for first, second, other in ((a, b, 2), (b, c, 0), (c, a, 1)):
        below = below + dot(first, second) * lengths[other]
    return np.asarray(-2 * np.arctan2(dot(a, cross(b, c)), below))


@lru_cache(maxsize=8)
def _derivatives(order: int) -> Array:
    """Return what leads to derivatives of harmonics over ``l (l+1)``, shape (3, lower, all).

    The derivative of ``r^l Y_lm`` along an axis is a sum of ``r^(l-1) Y_(l-1)m'``. By the
    divergence theorem in the ball, their factors are 2 l + 1 times the integrals over the sphere of
    Y_lm times Y_(l-1)m' times the coordinate.
    """
    heights, weights = gauss_legendre(order + 1)
    angles = np.arange(2 * order + 2) * (np.pi / (order + 1))
    directions = from_angles(np.arccos(heights)[:, None], angles).reshape(-1, 3)
    weights = np.repeat(weights, len(angles)) * (np.pi / (order + 1))
    lower, degree = degrees(order - 1), degrees(order)
    found = np.einsum(
        "d,dk,di,dj->kij", weights, directions,
        real_harmonics(order - 1, directions), real_harmonics(order, directions),
    )  # fmt: skip
    scale = (2 * degree + 1) / np.maximum(degree * (degree + 1), 1)
    return np.asarray(np.where(lower[:, None] == degree - 1, found * scale, 0))


def _points(ways: Array, rule: Array) -> Iterator[tuple[Array, Array]]:
    """Yield the directions (3, n) and solid angles (n,) of points that stand for triangles.

    `rule` has the weights of the corners in each point, shape (points, 3).
    """
    a, b, c = ways
    across = cross(b - a, c - a) / (2 * len(rule))
    for weights in rule:
        place = np.tensordot(weights, ways, 1)
        distance = _length(place)
        yield place / distance, -dot(place, across) / distance**3
