"""Light that has given harmonic coefficients and is negative nowhere.

A series of a few degrees is negative beside its lamps: nine coefficients of a studio are so on half
of the sphere. As pixels they would be cut off at 0, which adds a seventh to what surfaces receive,
and half of it to that of eight degrees; as they are they make bands of black on polished surfaces.
So pixels show another light: of those that are negative nowhere and have the same coefficients, the
one that is nearest to the series.

The squared distance from the series S, with multipliers x for the coefficients, is least where the
light is the positive part of a series, ``L = max(0, S + sum_k x_k Y_k)``. The multipliers are the
least point of a convex function, half of the energy of L minus the sum of ``x_k c_k``, whose
gradient is what the coefficients of L differ by from c, and whose Hessian is the integral of ``Y_k
Y_l`` where L is lit (Boyd and Vandenberghe 2004, Convex Optimization, sections 5.1 and 9.5: duality
and Newton's method). A little of ``|x|^2 / 2`` beside it bounds x for coefficients that no such
light has, or only that of a single point. Degrees above those that surfaces receive are left free.
"""

import numpy as np

from shrm_cli.arrays import Array, slices
from shrm_cli.records import record
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.sphere.harmonics import order_of, real_harmonics

_KEPT = 8
"""The last degree whose coefficients the light has. What irradiance has of further ones is less
than a hundredth of what it has of a point."""
_ROWS = 128
"""The rows of the lat-long that integrals are taken on, some four times the most degrees."""
_BOUND = 1e-4
"""What the squares of multipliers count. So far are the coefficients off in parts of themselves of
degree 2, and a hundredth in what surfaces receive of eight degrees of a studio, the worst probe."""
_SETTLED = 1e-6
"""The part of the coefficients that the gradient falls below at the end."""
_STEPS = 60
"""The most steps, of which some twenty are needed."""
_ALIKE = 0.1
"""The part of the coefficients that may differ; what is negative on the whole, as light that is
taken away from another, is left alone."""
_VALUES_AT_ONCE = 2**22
"""Values of harmonics in memory at a time."""


@record(eq=False)
class PositivePart:
    """Light that is the positive part of a series."""

    series: Array
    """Coefficients, shape ((order+1)^2, 3)."""
    negative_share: float
    """The share of the sphere on which the light was negative in a channel that it was made of."""

    @property
    def told(self) -> str:
        """A line about it."""
        return (
            f"its coefficients are negative in {self.negative_share:.0%} of directions; pixels and "
            "maps that show them have the nearest light that is not, of the same coefficients"
        )

    def at(self, directions: Array) -> Array:
        """Return the light from directions, shape (n, 3) -> (n, 3)."""
        return np.maximum(radiance_of(self.series, directions), 0)


def without_negatives(coefficients: Array) -> PositivePart | None:
    """Return the light that is negative nowhere, has these coefficients and is nearest to them.

    Parameters
    ----------
    coefficients : array of shape ((order+1)^2, 3)

    Returns
    -------
    PositivePart or None
        None where the series is negative nowhere itself, or where no such light has its
        coefficients, not even nearly.
    """
    order = order_of(len(coefficients))
    grid = LatLong(_ROWS)
    directions = grid.directions().reshape(-1, 3)
    weights = np.broadcast_to(grid.weights(), grid.shape).ravel()
    light = radiance_of(coefficients, directions)
    is_negative = (light < -_SETTLED * np.abs(light).max()).any(axis=1)
    if not is_negative.any():
        return None
    basis = real_harmonics(min(order, _KEPT), directions)
    kept = coefficients[: basis.shape[1]]
    added = np.stack([
        _multipliers(basis, weights, own, wanted)
        for own, wanted in zip(light.T, kept.T, strict=True)
    ], axis=1)  # fmt: skip
    made = basis.T @ (weights[:, None] * np.maximum(light + basis @ added, 0))
    if np.linalg.norm(made - kept) > _ALIKE * np.linalg.norm(kept):
        return None
    series = coefficients.astype(float)
    series[: len(added)] += added
    return PositivePart(series, float(weights @ is_negative) / (4 * np.pi))


def radiance_of(series: Array, directions: Array) -> Array:
    """Return the light of a series from directions, shape (n, 3) -> (n, 3)."""
    result, order = np.empty((len(directions), 3)), order_of(len(series))
    for some in slices(len(directions), max(_VALUES_AT_ONCE // len(series), 1)):
        result[some] = real_harmonics(order, directions[some]) @ series
    return result


def _multipliers(basis: Array, weights: Array, series: Array, wanted: Array) -> Array:
    """Return x of one channel by Newton's method, shape (n,).

    Of points, `basis` are the harmonics, shape (points, n), `weights` what they count, and `series`
    the light that is looked for without multipliers. `wanted` are its coefficients.
    """

    def lit(x: Array) -> tuple[float, Array]:
        light = np.maximum(series + basis @ x, 0)
        energy = weights @ light**2 + _BOUND * x @ x
        return float(energy / 2 - x @ wanted), light

    x = np.zeros(len(wanted))
    value, light = lit(x)
    for _ in range(_STEPS):
        gradient = (weights * light) @ basis + _BOUND * x - wanted
        if np.linalg.norm(gradient) <= _SETTLED * np.linalg.norm(wanted):
            break
        shown = basis[light > 0]
        hessian = (shown.T * weights[light > 0]) @ shown
        hessian[np.diag_indices_from(hessian)] += _BOUND
        step = np.linalg.solve(hessian, gradient)
        further, further_light = lit(x - step)
        if further >= value:  # rounding is all that is left
            break
        x, value, light = x - step, further, further_light
    return x
