"""Brushed GGX as a few lobes of even GGX: where engines look up its light, and with what weight.

A facet whose normal is H reflects the view about H. Brushed facets have slopes that spread further
along x than along y, so that a few of them along x, each with a lobe as wide as y asks for, stand
for all. In the slopes of facets, that are the x and y of ``H / N.H``, the taps of a table are

    t (ax^2 x, ay^2 y) / sqrt(ax^2 x^2 + ay^2 y^2 + z^2) + (+-u sqrt(ax^2 - ay^2), 0)

for the view (x, y, z). The first part is how the facets that are seen lean towards the view; the
second spreads the taps across the brush marks. A tap weighs ``max(w, 0) max(V.H / N.H, 0)``, as so
much of its facets is seen, and its light is that of a level of alpha ``r^2 ay``.

The numbers u, w, r and t of each tap are polynomials of the roughness, the ratio of alphas and N.V.
They are fitted by `research.taps` to the lobes themselves, by least squares over light whose
spectrum is the mean of real probes, in all rotations.
"""

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.records import record

LEAST_FITTED = 0.2, 0.25
"""The roughness along y, and the root of the ratio of alphas, below which the polynomials are taken
as they are there."""
_TABLE = Path(__file__).with_name("taps.csv")
KINDS = "uwrt"
"""The names of the numbers of a tap: spread, weight, roughness, tilt."""
MONOMIALS = ("1", "s", "p", "z", "s*s", "s*p", "s*z", "p*p", "p*z", "z*z")
"""What the columns of the table multiply: s is the root of ay / ax, p that of ay, and z is N.V."""


@record(eq=False)
class Taps:
    """The taps of some views, in the frame whose x axis runs across the brush marks."""

    weights: Array
    """Their sum is 1, shape (..., taps)."""
    directions: Array
    """Unit vectors, shape (..., taps, 3)."""
    roughness: Array
    """Perceptual, at most 1, shape (..., taps)."""


@cache
def polynomials(count: int) -> dict[str, Array]:
    """Return the fitted polynomials of a number of taps.

    Returns arrays of shape (n, 10), by the letters of `KINDS`. With an odd number of taps the first
    one is the middle, which has no u. All others are pairs. The first weight is 1, and is not among
    those of ``w``.
    """
    rows: dict[str, list[list[float]]] = {kind: [] for kind in KINDS}
    for line in _TABLE.read_text(encoding="ascii").splitlines()[1:]:
        taps, kind, *numbers = line.split(",")
        if int(taps) == count:
            rows[kind].append([float(number) for number in numbers])
    return {kind: np.array(values) for kind, values in rows.items()}


def monomials(roughness: Array, ratio: Array, cosines: Array) -> Array:
    """Evaluate `MONOMIALS`, shape (10, ...)."""
    least_p, least_s = LEAST_FITTED
    p, s, z = np.broadcast_arrays(
        np.maximum(roughness, least_p), np.maximum(ratio, least_s), cosines
    )
    return np.stack([np.ones(z.shape), s, p, z, s * s, s * p, s * z, p * p, p * z, z * z])


def taps(alphas: tuple[float, float], views: ArrayLike, count: int) -> Taps:
    """Return the taps of brushed GGX.

    `alphas` are along x and y, that along x not being the lesser. `views`, of shape (..., 3), are
    unit vectors above the horizon, in the frame of the surface. `count` is one of
    `vocabulary.TAP_COUNTS`.
    """
    numbers = polynomials(count)
    return taps_of(tuple(numbers[kind] for kind in KINDS), alphas, views)


def taps_of(numbers: tuple[Array, ...], alphas: tuple[float, float], views: ArrayLike) -> Taps:
    """Return the taps that polynomials describe, in the order of `KINDS`; see `taps`."""
    views = np.asarray(views, dtype=float)
    (ax, ay), (x, y, z) = alphas, np.moveaxis(views, -1, 0)
    basis = monomials(np.sqrt(ay), np.sqrt(ay / ax), z)
    spreads, weights, widths, tilts = (np.tensordot(each, basis, 1) for each in numbers)
    weights = np.concatenate([np.ones((1, *z.shape)), np.maximum(weights, 0)])
    has_middle = len(tilts) > len(spreads)
    if has_middle:
        spreads = np.concatenate([np.zeros((1, *z.shape)), spreads])
    spreads = spreads * np.sqrt(ax * ax - ay * ay)
    masking = np.sqrt((ax * x) ** 2 + (ay * y) ** 2 + z**2)
    sides = [(tap, side) for tap in range(len(tilts)) for side in (1, -1)][has_middle:]
    index, signs = np.array(sides).T
    signs = signs.reshape(-1, *[1] * z.ndim)
    slope_x = tilts[index] * ax * ax * x / masking + signs * spreads[index]
    slope_y = tilts[index] * ay * ay * y / masking
    facing = slope_x * x + slope_y * y + z
    half = np.stack([slope_x, slope_y, np.ones(slope_x.shape)], axis=-1)
    scale = 2 * facing / np.sum(half**2, axis=-1)
    seen = weights[index] * np.maximum(facing, 0)
    return Taps(
        np.moveaxis(seen / seen.sum(axis=0), 0, -1),
        np.moveaxis(scale[..., None] * half - views, 0, -2),
        np.moveaxis(np.minimum(np.sqrt(ay) * widths[index], 1), 0, -1),
    )
