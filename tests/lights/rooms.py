"""Probes with lamps of known places, sizes and radiances, averaged over parts of each pixel."""

from functools import cache

import numpy as np

from shrm_cli.probe.probe import Probe
from tests.probe import scenes

PARTS = 6
"""Parts of a pixel along each axis."""


def unit(*vector):
    return np.array(vector) / np.linalg.norm(vector)


def background(directions):
    """Smooth and coloured, about 0.5."""
    waves = 0.1 * np.sin(5 * directions[..., :1] + 3 * directions[..., 2:])
    return 0.5 + 0.3 * directions[..., 1:2] * np.array([1, 0.8, 0.6]) + waves


def room(*lamps):
    """Return radiance with lamps: pairs of a function that tells who is inside, and a radiance."""

    def radiance(directions):
        result = background(directions)
        for is_inside, light in lamps:
            result = result + is_inside(directions)[..., None] * np.array(light)
        return result

    return radiance


def round_lamp(axis, degrees):
    return lambda directions: directions @ axis > np.cos(np.radians(degrees))


def long_lamp(axis, along, length, width):
    """Return who is within a strip: degrees along a direction at right angles, and across it."""
    across = np.cross(axis, along)

    def is_inside(directions):
        forward = directions @ axis
        turns = [np.degrees(np.arctan2(directions @ each, forward)) for each in (along, across)]
        return (np.abs(turns[0]) < length / 2) & (np.abs(turns[1]) < width / 2)

    return is_inside


def latlong(height, radiance):
    """A lat-long, whose parts of pixels count by the cosine of their latitude."""
    fine = scenes.latlong(height * PARTS, f=radiance).astype(float)
    rows = np.sin(np.pi * (np.arange(height * PARTS) + 0.5) / (height * PARTS))
    weights = np.broadcast_to(rows[:, None, None], fine.shape)
    return _means(fine, weights)


def cube(size, radiance):
    """The six faces stacked; parts of texels count by their solid angles."""
    faces = scenes.cube_faces(size * PARTS, f=radiance).astype(float)
    s = (2 * np.arange(size * PARTS) + 1) / (size * PARTS) - 1
    angles = (1 + s[:, None] ** 2 + s**2) ** -1.5
    return np.concatenate([_means(face, angles[..., None]) for face in faces])


def angular(size, radiance):
    return _means(scenes.angular(size * PARTS, f=radiance).astype(float), np.ones((1, 1, 1)))


def _means(fine, weights):
    weights = np.broadcast_to(weights, fine.shape)
    shape = (fine.shape[0] // PARTS, PARTS, fine.shape[1] // PARTS, PARTS, 3)
    total = (fine * weights).reshape(shape).sum(axis=(1, 3))
    return (total / weights.reshape(shape).sum(axis=(1, 3))).astype(np.float32)


IMAGES = {"latlong": (latlong, 96), "openexr": (cube, 48), "angular": (angular, 128)}


def probe(layout, *lamps):
    """A probe of a layout, sampled at pixel centres, with pixels of 1.9 or 2.8 degrees."""
    make, size = IMAGES[layout]
    return Probe.from_array(make(size, room(*lamps)), layout, name=f"{layout} with lamps")


def pixel(layout):
    """The mean distance of pixels of such a probe, radians."""
    return {"latlong": np.pi / 96, "openexr": np.pi / 96, "angular": 2 * np.pi / 128}[layout]


@cache
def bare(layout):
    """The image of the room without lamps, as a probe reads it."""
    make, size = IMAGES[layout]
    return Probe.from_array(make(size, room()), layout).image()
