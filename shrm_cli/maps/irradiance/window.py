"""Windows: factors that damp the high degrees of an irradiance map.

Without them, a sun or another small bright light may leave a side where the irradiance is negative.
The least that leaves none is the shortest vector within linear bounds, by non-negative least
squares.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, relative_rms
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.records import record
from shrm_cli.sphere.extremes import degree_values, low_places, lowest
from shrm_cli.sphere.harmonics import by_degree, degrees, order_of
from shrm_cli.sphere.quadrature import spiral_directions

FAMILIES = ("hann", "lanczos")
NAMES = ("none", *FAMILIES, "auto")

MARGIN = 1e-5
"""The least irradiance that the window ``auto`` aims at, as a part of the mean irradiance. It is
above the rounding of 32-bit floats."""

_ROUNDS = 60
"""How often `least_window` seeks the factors, at most."""
_FIRST_DIRECTIONS = 256
"""The number of directions, evenly spread, where the first factors are sought."""
_MOST_PLACES = 64
"""The most directions of each channel that are added after a round."""


@record
class Window:
    """A factor for every degree of a series."""

    name: str = "none"
    """The kind of the window; ``least`` is what `least_window` makes. One of "none", "hann",
    "lanczos" and "least"."""
    width: float | None = None
    """The degree at and beyond which the factors are 0; None for ``none`` and ``least``."""
    factors: tuple[float, ...] = ()
    """The factors of the degrees 0 .. F; the tuple is empty where all are 1."""
    energy_lost: float = 0.0
    """``1 - |E_w|^2 / |E|^2`` over the sphere and all channels, with E_w the windowed
    irradiance."""
    change: float = 0.0
    """Relative RMS change of the irradiance, over the sphere and all channels."""

    @classmethod
    def of(
        cls, factors: Array, series: Array, name: str = "least", width: float | None = None
    ) -> "Window":
        """Make the window of factors, and measure its costs for a series, shape ((F+1)^2, 3)."""
        squares = _squares(series)
        whole = squares.sum()
        lost = float(np.sum((1 - factors**2) * squares) / whole) if whole > 0 else 0.0
        change = relative_rms(np.sum((1 - factors) ** 2 * squares), whole)
        return cls(name, width, tuple(factors.tolist()), lost, change)

    def summary(self, order: int) -> dict[str, Any]:
        """Return the window as JSON holds it, with a factor for each degree up to an order."""
        return {
            "name": self.name,
            "width": self.width,
            "factors": list(self.factors) or [1.0] * (order + 1),
            "energy_lost": self.energy_lost,
            "change": self.change,
        }

    def apply(self, series: Array) -> Array:
        """Multiply a series, shape ((F+1)^2, ...), by the factors of its degrees."""
        if not self.factors:
            return series
        by_index = np.array(self.factors)[degrees(len(self.factors) - 1)]
        return series * by_index.reshape(-1, *[1] * (series.ndim - 1))


def window_factors(name: str, width: float, order: int) -> Array:
    """Return the factors of the degrees 0 .. order: 1 at 0, and 0 at and beyond the width.

    `name` is ``hann`` or ``lanczos``: ``(1 + cos(pi l / w)) / 2`` or ``sin(pi l / w) / (pi l /
    w)``. `width` is the width w, a positive number that need not be whole.

    Returns an array of shape (order+1,).

    References: Sloan 2008, Stupid Spherical Harmonics (SH) Tricks, "Windowing".
    """
    if name not in FAMILIES:
        raise MapError(f"window {name!r}: no such family; take one of {', '.join(FAMILIES)}")
    share = np.minimum(np.arange(order + 1), width) / width
    shape = np.sinc(share) if name == "lanczos" else (1 + np.cos(np.pi * share)) / 2
    return np.where(share < 1, shape, 0.0)


def parse_window(spec: str) -> tuple[str, float | None]:
    """Split `NAME` or `NAME:WIDTH` into name and width; the width is None where none is given."""
    name, colon, text = spec.partition(":")
    if name not in NAMES:
        raise ArgumentError("window", f"{spec!r}: no such window; take one of {', '.join(NAMES)}")
    if not colon:
        return name, None
    if name not in FAMILIES:
        raise ArgumentError("window", f"{spec!r}: {name} has no width; leave :{text} out")
    try:
        width = float(text)
    except ValueError:
        width = np.nan
    if not (np.isfinite(width) and width > 0):
        raise ArgumentError(
            "window", f"{spec!r}: its width must be a positive number, as in {name}:3"
        )
    return name, width


def make_window(spec: str, series: Array) -> Window:
    """Make the window that a specification asks for.

    `spec` is ``NAME`` or ``NAME:WIDTH``, as `parse_window` takes it; the width is F + 1 where none
    is given. ``auto`` asks for `least_window`. `series`, of shape ((F+1)^2, 3), are the
    coefficients of the irradiance, ``A_l L_lm``.
    """
    name, width = parse_window(spec)
    if name == "auto":
        return least_window(series)
    if name == "none":
        return Window()
    order = order_of(len(series))
    width = width or order + 1.0
    return Window.of(window_factors(name, width, order), series, name, width)


def least_window(series: Array) -> Window:
    """Find the window that changes a series least and leaves it non-negative everywhere.

    Each degree has a factor of its own, which is 1 for the mean and within 0 .. 1 for the others;
    the factors need not fall with the degree. Of all factors that keep every channel at or above
    `MARGIN` times its mean, these are the ones that change the series least, as RMS over all
    channels. The channels share the factors. A series that is nowhere negative gets no window.

    The factors are sought for a set of directions, where the value that each degree adds is known.
    Then the lowest directions of the windowed series join the set, and the factors are sought
    anew, until the windowed series is not too low anywhere.

    `series`, of shape ((F+1)^2, 3), are the coefficients of the irradiance. The mean, which is
    coefficient 0, must not be negative in any channel.
    """
    directions, values = lowest(series)
    if values.min() >= 0:
        return Window()
    floor = MARGIN * series[0] / np.sqrt(4 * np.pi)
    start = np.concatenate([spiral_directions(_FIRST_DIRECTIONS), directions])
    by_degree = degree_values(series, start)
    for _ in range(_ROUNDS):
        window = Window.of(least_factors(_squares(series), by_degree, floor), series)
        windowed = window.apply(series)
        found, values = lowest(windowed)
        if (values >= floor / 2).all():
            return window
        found = np.concatenate([found, low_places(windowed, floor / 2, _MOST_PLACES)])
        by_degree = np.concatenate([by_degree, degree_values(series, found)])
    return Window.of(_faded(np.array(window.factors), values, floor), series)


def least_factors(squares: Array, by_degree: Array, floor: Array) -> Array:
    """Find the factors that keep a series at its floor in some directions, and change it least.

    With t = 1 - factor and p the relative RMS of a degree, the least ``|p t|^2`` is sought with
    ``sum_l t_l value_l <= sum_l value_l - floor`` in every direction, and t within 0 .. 1.

    `squares`, of shape (F+1,), are the mean square of what each degree adds, or any multiple of it.
    `by_degree`, of shape (n, F+1, channels), is the value that each degree adds in each direction.
    `floor`, of shape (channels,), is the least values.

    Returns an array of shape (F+1,), within 0 .. 1; that of degree 0 is 1.
    """
    used = np.flatnonzero(squares[1:] > 0) + 1
    share = np.sqrt(squares[used] / squares.sum())
    values = by_degree.transpose(0, 2, 1).reshape(-1, len(squares))
    rows, bounds = values[:, used] / share, values.sum(axis=1) - np.tile(floor, len(by_degree))
    lengths = np.linalg.norm(rows, axis=1)
    binding = bounds < lengths  # |p t| is 1 at most, so other rows always keep their bounds
    lengths = lengths[binding]
    rows, bounds = rows[binding] / lengths[:, None], bounds[binding] / lengths
    box = np.eye(len(used))
    found = shortest_within(
        np.concatenate([rows, box, -box]), np.concatenate([bounds, share, np.zeros(len(used))])
    )
    factors = np.ones(len(squares))
    factors[used] -= 1.0 if found is None else np.clip(found / share, 0.0, 1.0)
    return factors


def _faded(factors: Array, values: Array, floor: Array) -> Array:
    """Bring factors nearer to 0, so that the lowest values rise to the floor; the mean stays."""
    mean = floor / MARGIN
    is_low = values < floor
    kept = ((mean - floor)[is_low] / (mean - values)[is_low]).min(initial=1.0)
    return np.concatenate([factors[:1], factors[1:] * kept])


def _squares(series: Array) -> Array:
    """Sum the squares of each degree's coefficients over all channels, shape (F+1,)."""
    return by_degree(np.sum(series**2, axis=1))


_TINY = 1e-13
"""Residuals, gains and coefficients that are smaller than this, relatively, count as rounding."""


def shortest_within(rows: Array, bounds: Array) -> Array | None:
    """Find the x of least ``|x|^2`` with ``rows @ x <= bounds``.

    `rows`, of shape (m, n), must each be of about unit length, so that all bounds are kept with the
    same precision. `bounds`, of shape (m,), must not be much smaller than -1, for the same reason.

    Returns the vector x, or None if no x is within the bounds.

    References: Lawson and Hanson 1974, Solving Least Squares Problems, chapter 23: Least distance
    programming, algorithm 23.27.
    """
    n = rows.shape[1]
    matrix = -np.concatenate([rows.T, bounds[None]])
    target = np.zeros(n + 1)
    target[n] = 1.0
    residual = target - matrix @ non_negative_least_squares(matrix, target)
    if residual[n] <= _TINY:
        return None
    return np.asarray(-residual[:n] / residual[n])


def non_negative_least_squares(matrix: Array, target: Array) -> Array:
    """Find the u >= 0 of least ``|matrix @ u - target|``, shape (n,).

    Columns that lower the residual join the set of free columns, one at a time. Columns whose
    coefficient would turn negative leave it, and their coefficient is 0.

    `matrix` is of shape (m, n). `target` is of shape (m,).

    References: Lawson and Hanson 1974, algorithm 23.10.
    """
    count = matrix.shape[1]
    result: Array = np.zeros(count)
    free = np.zeros(count, dtype=bool)
    lengths = np.linalg.norm(matrix, axis=0)
    tolerance = _TINY * lengths * np.linalg.norm(target)
    for _ in range(3 * count):
        gain = np.where(free, 0.0, matrix.T @ (target - matrix @ result))
        joined = _join(matrix, target, free, np.where(gain > tolerance, gain, 0.0))
        if joined is None:
            break
        solved = joined
        while (solved[free] <= 0).any():
            leaving = free & (solved <= 0)
            shares = result[leaving] / (result[leaving] - solved[leaving])
            result += shares.min() * (solved - result)
            free &= result > _TINY * result.max()
            result[~free] = 0.0
            solved = _solved(matrix, target, free)
        result = solved
    return result


def _join(matrix: Array, target: Array, free: NDArray[np.bool_], gain: Array) -> Array | None:
    """Let the column that gains most join the free ones, and solve for all free ones.

    The result is None if no column can join.
    """
    while gain.any():
        joining = int(np.argmax(gain))
        free[joining] = True
        solved = _solved(matrix, target, free)
        if solved[joining] > 0:
            return solved
        free[joining], gain[joining] = False, 0.0  # its gain is rounding alone
    return None


def _solved(matrix: Array, target: Array, free: NDArray[np.bool_]) -> Array:
    """Solve least squares over the free columns; the coefficients of the others are 0."""
    result = np.zeros(matrix.shape[1])
    if free.any():
        result[free] = np.linalg.lstsq(matrix[:, free], target, rcond=None)[0]
    return result
