"""Functions of the angle from the normal that take long to integrate, and are tabulated."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.albedo import hemisphere_rule, sampled_albedo, settled
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
    found = np.empty((len(brdfs), len(views), len(lights), 3))
    for number, theta in enumerate(np.arccos(np.maximum(views, _LEAST)).tolist()):
        with sharing():
            for brdf, rows in zip(brdfs, found, strict=True):
                rows[number] = settled(partial(_row, brdf, theta, lights), _ACCURACY, _ROW_COUNTS)
    return found


def _nodes(theta: float, lights: Array, count: int) -> tuple[Array, ...]:
    """Directions and weights about a view, the view, and where they lie among the lights."""
    light, weights = hemisphere_rule(theta, count)
    place = np.interp(light[..., 2].ravel(), lights, np.arange(len(lights)))
    return light, weights, from_angles(theta, 0.0), place


def _row(brdf: Brdf, theta: float, lights: Array, count: int) -> Array:
    """A row of `transport`, shape (m, 3), with a number of nodes of each angle."""
    light, weights, view, place = shared(
        ("nodes", theta, count), (lights,), partial(_nodes, theta, lights, count)
    )
    values = brdf.transfer(light, view)
    grey = values.strides[-1] == 0
    below = np.minimum(place.astype(int), len(lights) - 2)
    row = np.zeros((len(lights), 3))
    for channel in range(1 if grey else 3):
        each = (values[..., channel] * weights).ravel()
        row[:, channel] = np.bincount(below, each * (1 - place + below), len(lights))
        row[:, channel] += np.bincount(below + 1, each * (place - below), len(lights))
    return row[:, [0, 0, 0]] if grey else row


def albedos(brdf: Brdf, cosines: Array) -> Array:
    """The part of light from angles that a BRDF reflects, shape (n, 3)."""
    thetas = np.arccos(np.maximum(cosines, _LEAST))
    found = [partial(sampled_albedo, brdf, float(theta), hemisphere_rule) for theta in thetas]
    return np.stack([settled(each, _ACCURACY, _COUNTS) for each in found])


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
