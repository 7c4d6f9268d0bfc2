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

Even GGX has taps of its own, without u: its lobe leans towards the normal, and is narrower on one
side than on the other, which a look-up about the mirror direction leaves out.
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
_TABLE, _EVEN_TABLE = (Path(__file__).with_name(name) for name in ("taps.csv", "even_taps.csv"))
KINDS, EVEN_KINDS = "uwrt", "wrt"
"""The names of the numbers of a tap: spread, weight, roughness, tilt."""
MONOMIALS = ("1", "s", "p", "z", "s*s", "s*p", "s*z", "p*p", "p*z", "z*z")
"""What the columns of the table multiply: s is the root of ay / ax, p that of ay, and z is N.V."""
EVEN_MONOMIALS = ("1", "p", "z", "p*p", "p*z", "z*z")
"""The monomials of the table of even GGX."""


@record(eq=False)
class Taps:
    """The taps of some views: of brushed GGX in the frame whose x axis runs across the marks."""

    weights: Array
    """The weights of the taps, whose sum is 1, shape (..., taps)."""
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
    return _polynomials(_TABLE, KINDS, count)


@cache
def even_polynomials(count: int) -> dict[str, Array]:
    """Return the fitted polynomials of a number of taps of even GGX.

    Returns arrays of shape (n, 6), by the letters w, r and t. The first weight is 1, and is not
    among those of ``w``.
    """
    return _polynomials(_EVEN_TABLE, EVEN_KINDS, count)


def _polynomials(table: Path, kinds: str, count: int) -> dict[str, Array]:
    rows: dict[str, list[list[float]]] = {kind: [] for kind in kinds}
    header, *lines = table.read_text(encoding="ascii").splitlines()
    for line in lines:
        taps, kind, *numbers = line.split(",")
        if int(taps) == count:
            rows[kind].append([float(number) for number in numbers])
    width = header.count(",") - 1
    return {kind: np.reshape(values, (-1, width)) for kind, values in rows.items()}


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


def even_monomials(roughness: ArrayLike, cosines: ArrayLike) -> Array:
    """Evaluate `EVEN_MONOMIALS`, shape (6, ...)."""
    p, z = np.broadcast_arrays(np.maximum(roughness, LEAST_FITTED[0]), cosines)
    return np.stack([np.ones(z.shape), p, z, p * p, p * z, z * z])


def even_taps(roughness: float, normals: ArrayLike, views: ArrayLike, count: int) -> Taps:
    """Return the taps of GGX that is not brushed, in the axes of the normals and views.

    `roughness` is perceptual. `normals` and `views`, of shape (..., 3), are unit vectors. `count`
    is one of `vocabulary.EVEN_TAP_COUNTS`.
    """
    numbers = even_polynomials(count)
    return even_taps_of(tuple(numbers[kind] for kind in EVEN_KINDS), roughness, normals, views)


def even_taps_of(
    numbers: tuple[Array, ...], roughness: float, normals: ArrayLike, views: ArrayLike
) -> Taps:
    """Return the taps that polynomials describe, in the order of `EVEN_KINDS`; see `even_taps`."""
    normals, views = np.broadcast_arrays(
        np.asarray(normals, dtype=float), np.asarray(views, dtype=float)
    )
    z = np.maximum(np.sum(normals * views, axis=-1), 1e-5)
    weights, widths, tilts = (
        np.moveaxis(np.tensordot(each, even_monomials(roughness, z), 1), 0, -1) for each in numbers
    )
    square, across = roughness**4, 1 - z**2  # of alpha, and of the sine of the view
    # A facet's slopes are those of the view along the surface, as far as it leans towards it.
    leans = tilts * (square / np.sqrt(square * across + z**2))[..., None]
    beside = views - z[..., None] * normals
    halves = normals[..., None, :] + leans[..., None] * beside[..., None, :]
    facing = z[..., None] + leans * across[..., None]
    scale = 2 * facing / (1 + leans**2 * across[..., None])
    first = np.ones((*z.shape, 1))
    seen = np.concatenate([first, np.maximum(weights, 0)], axis=-1) * np.maximum(facing, 0)
    return Taps(
        seen / seen.sum(axis=-1, keepdims=True),
        scale[..., None] * halves - views[..., None, :],
        np.minimum(roughness * widths, 1),
    )
