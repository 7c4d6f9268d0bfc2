"""Light probes of places in a room, by paths from there.

A path goes from the probe to a surface, and from this to another one and to a point of a lamp.
What the second surface sends is known as the brightness of its patch, which holds all further
bounces.
"""

import numpy as np

from shrm_cli.arrays import Array, relative_rms, slices
from shrm_cli.geometry.rays import Rays
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress, Stages, in_order
from shrm_cli.records import record
from shrm_cli.rooms.brightness import LIFT, Brightness
from shrm_cli.rooms.emitters import Emitters, cosines
from shrm_cli.rooms.room import Room
from shrm_cli.sphere.directions import horizontal_tangents, surface_frames
from shrm_cli.sphere.grid.latlong import LatLong, latlong_points
from shrm_cli.sphere.quadrature import spiral_directions

_PATCHES = 48
"""Patches along the diagonal of a room."""
_PATHS_AT_ONCE = 2**16
_LOOKS = 4096
"""Directions in which the box around a place is looked for."""
_SNAP = 0.02
"""The part of a room's size by which what these meet may fall short of corners that are seen."""
_TOUCH = 1e-4
"""The part of its distance by which a corner may lie behind what is met before it."""
_PLASTIC = 1.1673039782614187
"""The root of x^5 = x + 1, whose powers' reciprocals fill cubes of four dimensions evenly (Roberts
2018, "The Unreasonable Effectiveness of Quasirandom Sequences")."""


@record(eq=False)
class Captured:
    """A light probe of a place."""

    pixels: Array
    """A lat-long in world axes, float32 of shape (height, 2 height, 3)."""
    noise: float
    """The relative RMS error of the pixels that is left by chance, from two independent halves."""
    behind: float
    """The share of what is seen that is the back of surfaces, and black."""


def trace_probe(
    room: Room,
    at: Array,
    height: int,
    samples: int,
    surroundings: Probe | None = None,
    progress: Progress | None = None,
) -> Captured:
    """Find what is seen from a place of a room.

    `at` is of shape (3,). `height` is that of the image, pixels. `samples` is the number of paths
    through each pixel; an odd number is one more. `surroundings` are what is seen past the room,
    with its compact lamps.
    """
    stages = Stages(progress, 3)
    brightness = Brightness(room, Rays(room.mesh), room.size / _PATCHES, stages.within)
    stages.done(1, 3)
    paths = _Paths(brightness, np.asarray(at, dtype=float), height, surroundings)
    halves, behind = [], 0.0
    for number in range(2):
        pixels, seen = paths.half((samples + 1) // 2, number, stages.within)
        halves.append(pixels)
        behind += seen / 2
        stages.done(2 + number, 3)
    image = (halves[0] + halves[1]) / 2
    weights = LatLong(height).weights()[..., None]
    off = (weights * (halves[0] - halves[1]) ** 2).sum()
    # Of independent halves the difference has four times the variance of their mean.
    noise = relative_rms(off / 4, (weights * image**2).sum())
    return Captured(image.astype(np.float32), noise, behind)


def box_around(room: Room, at: Array) -> tuple[Array, Array]:
    """Return two corners of a box around what is seen from a place, each of shape (3,).

    That is the room, where a mesh has several, up to the near side of its walls. Along an axis on a
    side of which nothing is seen it is the box of the mesh.
    """
    low, high = room.mesh.bounds
    rays, at = Rays(room.mesh), np.asarray(at, dtype=float)
    directions = spiral_directions(_LOOKS)
    faces, _, distance = rays.first_hits(at, directions)
    seen = at + distance[faces >= 0, None] * directions[faces >= 0]
    if not len(seen):
        return low, high
    least, most = seen.min(axis=0), seen.max(axis=0)
    # Corners lie between the rays. Those of the far sides of walls are near, too, and hidden.
    past, near = room.mesh.vertices, _SNAP * room.size
    past = past[((past < least) | (past > most)).any(axis=1)]
    past = past[((past > least - near) & (past < most + near)).all(axis=1)]
    away = np.linalg.norm(past - at, axis=1)
    _, _, distance = rays.first_hits(at, (past - at) / away[:, None])
    seen = np.concatenate([seen, past[distance > (1 - _TOUCH) * away]])
    digits = 6 - int(np.floor(np.log10(room.size)))  # Embree has 32-bit floats
    least, most = seen.min(axis=0).round(digits), seen.max(axis=0).round(digits)
    within = (least < at) & (most > at)
    return np.where(within, least, low), np.where(within, most, high)


class _Paths:
    """Paths from one place through the pixels of a lat-long."""

    def __init__(
        self, brightness: Brightness, at: Array, height: int, surroundings: Probe | None
    ) -> None:
        self._brightness, self._at, self._height = brightness, at, height
        self._surroundings = surroundings
        self._emitters = Emitters(brightness.room, brightness.rays, 1)

    def half(self, samples: int, number: int, progress: Progress) -> tuple[Array, float]:
        """Return the mean over some paths of each pixel, and the share of back faces.

        The paths of each `number` are independent of those of other numbers.
        """
        height, width = self._height, 2 * self._height
        random = np.random.Generator(np.random.PCG64(number))
        image, behind = np.empty((height * width, 3)), np.empty(height * width)
        parts = list(slices(len(image), _PATHS_AT_ONCE // samples))
        # Chances are drawn in order, so that threads change nothing.
        jobs = [
            (part, random.random((part.stop - part.start, 1, 4)), int(random.integers(2**30)))
            for part in parts
        ]

        def traced(job: tuple[slice, Array, int]) -> tuple[Array, Array]:
            part, shifts, of_lamps = job
            # Each pixel has the same even sequence, shifted by other amounts.
            steps = np.arange(samples)[:, None] / _PLASTIC ** np.arange(1, 5)
            chances = ((shifts + steps) % 1).reshape(-1, 4)
            row, column = np.divmod(np.repeat(np.arange(part.start, part.stop), samples), width)
            ways = latlong_points(
                2 * (column + chances[:, 0]) / width - 1, 2 * (row + chances[:, 1]) / height - 1
            )
            light, back = self._seen(ways, chances[:, 2:], of_lamps)
            means = light.reshape(-1, samples, 3).mean(axis=1)
            return means, back.reshape(-1, samples).mean(axis=1)

        for part, found in zip(parts, in_order(traced, jobs), strict=True):
            image[part], behind[part] = found
            progress(part.stop, len(image))
        weights = np.broadcast_to(LatLong(height).weights(), (height, width)).ravel()
        return image.reshape(height, width, 3), float(weights @ behind / weights.sum())

    def _seen(self, ways: Array, chances: Array, number: int) -> tuple[Array, Array]:
        """Return the radiance along directions from the place, and which meet back faces."""
        room, rays = self._brightness.room, self._brightness.rays
        faces, weights, distance = rays.first_hits(self._at, ways)
        light = np.zeros((len(ways), 3))
        free = np.flatnonzero(faces < 0)
        if self._surroundings is not None and len(free):
            light[free] = self._surroundings.radiance(ways[free])
        normals = room.normals[faces]
        is_front = np.einsum("nv,nv->n", normals, ways) < 0
        hit = np.flatnonzero((faces >= 0) & is_front)
        points = self._at + distance[hit, None] * ways[hit]
        arriving = self._arriving(points, normals[hit], chances[hit], number)
        own = faces[hit], weights[hit]
        light[hit] = room.emission_at(*own) + room.albedo_at(*own) / np.pi * arriving
        return light, (faces >= 0) & ~is_front

    def _arriving(self, points: Array, normals: Array, chances: Array, number: int) -> Array:
        """Return the irradiance of points by one direction each, and one point of lamps."""
        origins = points + LIFT * self._brightness.room.size * normals

        def dense(directions: Array) -> Array:
            return cosines(directions, normals) / np.pi

        directions, lamps = self._emitters.arriving(origins, number, dense)
        found: Array = np.einsum("ns,nsc->nc", cosines(directions, normals), lamps)
        height, around = np.sqrt(chances[:, 0]), 2 * np.pi * chances[:, 1]
        flat = np.sqrt(1 - chances[:, 0])
        local = np.stack([flat * np.cos(around), flat * np.sin(around), height], axis=-1)
        frames = surface_frames(normals, horizontal_tangents(normals))
        ways = np.einsum("ni,nij->nj", local, frames)
        density = height / np.pi
        seen = self._brightness.look(origins, ways, self._emitters, density)
        light = self._brightness.radiance[seen.patches] + seen.sky + seen.lamps
        return found + np.pi * light
