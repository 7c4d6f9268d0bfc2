"""Functions of the angle from the normal that take long to integrate, and are tabulated."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.albedo import hemisphere_rule, sampled_albedos, settled
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.vectors import interpolated, shared, sharing
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles

COSINES = np.linspace(0, 1, 64) ** 2
"""Where functions are tabulated: densely where directions graze, where they are steep."""
_ACCURACY = 1e-4
"""The relative accuracy of albedos."""
_LEAST = 1e-3
"""Directions closer to the horizon, .06 degrees, are taken as this cosine."""
_STEPS = 20
_ROWS_AT_ONCE = 16
"""Views for which what several BRDFs share is kept at a time."""
_COUNTS = 32, 48, 96, 192
"""Nodes of each angle, tried until an albedo settles."""
_ROW_COUNTS = 64, 96, 192
"""The same for functions that are linear between the `COSINES`, which have kinks there."""


@record(eq=False)
class Table:
    """A function of the cosine to the normal at `COSINES`, linear between them."""

    values: Array
    """Linear RGB, shape (64, 3)."""

    def __call__(self, cosine: Array) -> Array:
        """The values at cosines (...), shape (..., 3); directions below the horizon graze."""
        square = np.clip(cosine, 0, 1) * (len(COSINES) - 1) ** 2
        row = np.minimum(np.floor(np.sqrt(square)), len(COSINES) - 2)
        return interpolated(self.values, row, (square - row * row) / (2 * row + 1))

    def at(self, directions: Array) -> Array:
        """The values at the cosines of directions (..., 3)."""
        return shared("table", (self, directions), lambda: self(directions[..., 2]))


def transport(brdf: Brdf, views: Array, lights: Array) -> Array:
    """Where light comes from that a BRDF reflects to views, as a matrix.

    `views`, of shape (n,), are cosines of the views to the normal. `lights`, of shape (m,), are
    cosines of the light, rising from 0 to 1.

    Returns an array of shape (n, m, 3): multiplied by the values of a function of the light's
    cosine at `lights`, it is the integral of that function, linear between them, times the BRDF and
    the cosine.
    """
    return transports([brdf], views, lights)[0]


def transports(brdfs: Sequence[Brdf], views: Array, lights: Array) -> Array:
    """`transport` of several BRDFs, shape (k, n, m, 3), which share their directions."""
    angles = np.arccos(np.maximum(views, _LEAST))
    found = np.empty((len(brdfs), len(views), len(lights), 3))
    for part in slices(len(views), _ROWS_AT_ONCE):
        with sharing():
            for brdf, rows in zip(brdfs, found, strict=True):
                sample = partial(_rows, brdf, lights)
                rows[part] = settled(sample, angles[part], _ACCURACY, _ROW_COUNTS)
    return found


def _nodes(angles: Array, lights: Array, count: int) -> tuple[Array, ...]:
    """Directions and weights about views, the views, and where they lie among the lights."""
    light, weights = hemisphere_rule(angles, count)
    place = np.interp(light[..., 2], lights, np.arange(len(lights)))
    return light, weights, from_angles(angles, 0.0)[:, None, None], place


def _rows(brdf: Brdf, lights: Array, angles: Array, count: int) -> Array:
    """Rows of `transport`, shape (k, m, 3), with a number of nodes of each angle."""
    light, weights, views, place = shared(
        ("nodes", tuple(angles.tolist()), count), (lights,), partial(_nodes, angles, lights, count)
    )
    values = brdf.transfer(light, views)
    grey = values.strides[-1] == 0
    below = np.minimum(place.astype(int), len(lights) - 2)
    part = place - below
    rows = np.zeros((len(angles), len(lights), 3))
    for k, row in enumerate(rows):
        at = below[k].ravel()
        for channel in range(1 if grey else 3):
            each = values[k, ..., channel] * weights[k]
            row[:, channel] = np.bincount(at, (each * (1 - part[k])).ravel(), len(lights))
            row[:, channel] += np.bincount(at + 1, (each * part[k]).ravel(), len(lights))
    return rows[..., [0, 0, 0]] if grey else rows


def albedos(brdf: Brdf, cosines: Array) -> Array:
    """The part of light from angles that a BRDF reflects, shape (n, 3)."""
    angles = np.arccos(np.maximum(cosines, _LEAST))
    return settled(partial(sampled_albedos, brdf, hemisphere_rule), angles, _ACCURACY, _COUNTS)


def strength(matrix: Array, passing: Array, wanted: Array) -> Array:
    """Factors h of light and view, the same for both, with ``h (M (passing h)) = wanted``.

    `matrix`, of shape (n, n, 3), is as `transport` returns it. `passing` and `wanted` are each of
    shape (n, 3).
    """
    factors = np.ones_like(wanted)
    for _ in range(_STEPS):
        found = factors * np.einsum("ijc,jc->ic", matrix, passing * factors)
        factors = factors * np.sqrt(wanted / np.maximum(found, 1e-300))
    return factors
