"""Samples of rho_hat over the light, in polar coordinates about the central direction C."""

import math
from collections.abc import Iterator

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.polar_rule import PolarRule, SplitRule
from shrm_cli.sphere.directions import from_angles, tilted_frame

_SAMPLES_AT_ONCE = 2**15
"""Arrays of so many samples stay in the processor's cache."""
_ROUNDING = 1e-6
"""The part of a cell below the horizon that is none."""
_INSIDE = 1 - 1e-9
"""The part of the way to the horizon at which the value beside it is taken."""


def transfer_samples(
    brdf: Brdf,
    rule: PolarRule | SplitRule,
    count: int,
    theta_o: Array,
    phi: Array,
    is_single: bool = False,
) -> Iterator[tuple[slice, Array, Array | None]]:
    """Sample rho_hat on a grid of angles about C, a block of theta_i at a time.

    The horizon N.L = 0 cuts through cells in theta_i. Such a cell counts by the part of it that
    is above the horizon, and if its own sample lies below, it takes the value at the horizon. So
    the integral of a model that jumps at the horizon converges with the square of the cell's
    size, not with the size.

    Parameters
    ----------
    brdf : Brdf
    rule : PolarRule or SplitRule
        The rule for the angle theta_i of the light from C.
    count : int
        The number of nodes in theta_i.
    theta_o : ndarray, shape (n,)
        Angles of the views from C, radians; their azimuth is 0.
    phi : ndarray, shape (n, azimuths)
        Azimuths of the light for each view, radians.
    is_single : bool
        Whether single precision suffices, in which most BRDFs take half the time. Tables of
        measured ones are no more exact than that.

    Yields
    ------
    rows : slice
        Which of theta_i the block holds; it begins and ends at multiples of 3 nodes, or at the
        last node. Of a BRDF with a horizon no block holds the nodes that are below it for all
        views and azimuths.
    samples : ndarray, shape (block, n, azimuths, 3)
        rho_hat.
    coverage : ndarray, shape (block, n, azimuths), or None
        The part of each cell that lies above the horizon, 0 .. 1; None where all cells do.
    """
    theta_i = rule.nodes(count)[0]
    # About the mirror direction the normal is half way between C and the view.
    tilt = theta_o / 2 if brdf.center == "reflection" else np.zeros_like(theta_o)
    dtype = np.float32 if is_single or brdf.is_measured else np.float64
    view: Array = from_angles(theta_o - tilt, 0.0)[None, :, None].astype(dtype)
    horizon = np.pi / 2 + np.arctan(np.tan(tilt)[:, None] * np.cos(phi))
    ends = rule.parameter(horizon) * (count / np.pi)  # in cells
    last = min(count, 3 * math.ceil(ends.max() / 3)) if brdf.has_horizon else count
    step = 3 * max(1, _SAMPLES_AT_ONCE // (3 * phi.size))
    for start in range(0, last, step):
        rows = slice(start, min(start + step, last))
        cells = np.arange(start, rows.stop)[:, None, None]
        light = _lights(theta_i[rows], phi, tilt, dtype)
        if not brdf.has_horizon or rows.stop <= ends.min() + _ROUNDING:
            yield rows, brdf.transfer(light, view), None
            continue
        coverage = np.clip(ends - cells, 0.0, 1.0).astype(dtype, copy=False)
        cut = np.nonzero((coverage > 0) & (coverage <= 0.5))
        edge = from_angles(horizon[cut[1:]] * _INSIDE, phi[cut[1:]])
        light[cut] = tilted_frame(edge, tilt[cut[1]])
        yield rows, brdf.transfer(light, view), coverage


def _lights(theta: Array, phi: Array, tilt: Array, dtype: type) -> Array:
    """Directions at angles about C, in the frame of the normal, shape (rows, n, azimuths, 3).

    Components lie apart in memory, so that functions of them need no gaps to be skipped.

    Parameters
    ----------
    theta : ndarray, shape (rows,)
    phi : ndarray, shape (n, azimuths)
    tilt : ndarray, shape (n,)
        The angles between C and the normal.
    dtype : type
        Of the result.
    """
    theta, tilt = theta[:, None, None], tilt[:, None]
    sine: Array = np.sin(theta).astype(dtype)
    cosine = np.cos(theta)
    lights = np.empty((3, len(theta), *phi.shape), dtype)
    along = np.cos(phi)
    np.multiply(sine, (np.cos(tilt) * along).astype(dtype), out=lights[0])
    lights[0] -= (np.sin(tilt) * cosine).astype(dtype)
    np.multiply(sine, np.sin(phi).astype(dtype), out=lights[1])
    np.multiply(sine, (np.sin(tilt) * along).astype(dtype), out=lights[2])
    lights[2] += (np.cos(tilt) * cosine).astype(dtype)
    return np.moveaxis(lights, 0, -1)


def every_third(samples: Array, coverage: Array) -> tuple[Array, Array]:
    """The samples of a block on the rule with a third of the nodes in theta_i.

    Parameters
    ----------
    samples : ndarray, shape (3 k, n, azimuths, ...)
    coverage : ndarray, shape (3 k, n, azimuths)
        Those that `transfer_samples` yields.

    Returns
    -------
    samples : ndarray, shape (k, n, azimuths, ...)
    coverage : ndarray, shape (k, n, azimuths)
    """
    middle = samples[1::3]
    first = (coverage[1::3] == 0) & (coverage[::3] > 0)
    if first.any():
        # The middle of the coarse cell is below the horizon, and the first of its cells is not.
        middle = np.where(
            first.reshape(first.shape + (1,) * (middle.ndim - 3)), samples[::3], middle
        )
    return middle, (coverage[::3] + coverage[1::3] + coverage[2::3]) / 3
