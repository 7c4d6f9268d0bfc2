"""Windows that damp the high degrees of the irradiance, so that a sun leaves no negative side."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.maps.irradiance.quadratic import shortest_within
from shrm_cli.sphere.extremes import degree_values, low_places, lowest
from shrm_cli.sphere.harmonics import degrees, order_of
from shrm_cli.sphere.quadrature import spiral_directions

Array = NDArray[np.floating]

FAMILIES = ("hann", "lanczos")
NAMES = ("none", *FAMILIES, "auto")

MARGIN = 1e-5
"""Of the mean irradiance: the least value that `auto` leaves, above what 32-bit floats round."""

_ROUNDS = 60
_FIRST_DIRECTIONS = 256
_MOST_PLACES = 64


@dataclass(frozen=True)
class Window:
    """A factor for every degree of a series.

    Attributes
    ----------
    name : {"none", "hann", "lanczos", "least"}
    width : float, optional
        The degree at and beyond which the factors are 0; None where that does not tell them.
    factors : tuple of float
        Of the degrees 0 .. F; empty where all are 1.
    energy_lost : float
        ``1 - |E_w|^2 / |E|^2`` over the sphere and all channels.
    change : float
        Relative RMS change of the irradiance, over the sphere and all channels.
    """

    name: str = "none"
    width: float | None = None
    factors: tuple[float, ...] = ()
    energy_lost: float = 0.0
    change: float = 0.0

    @classmethod
    def of(cls, name: str, width: float | None, series: Array) -> "Window":
        """The window of a family and width, and what it costs a series, shape ((F+1)^2, 3)."""
        if name == "none" or width is None:
            return cls()
        factors = window_factors(name, width, order_of(len(series)))
        return cls._with_costs(name, float(width), factors, series)

    @classmethod
    def least(cls, factors: Array, series: Array) -> "Window":
        """The window of some factors, and what it costs a series."""
        return cls._with_costs("least", None, factors, series)

    @classmethod
    def _with_costs(cls, name: str, width: float | None, factors: Array, series: Array) -> "Window":
        squares = _squares(series)
        whole = squares.sum()
        lost, change = 0.0, 0.0
        if whole > 0:
            lost = float(np.sum((1 - factors**2) * squares) / whole)
            change = float(np.sqrt(np.sum((1 - factors) ** 2 * squares) / whole))
        return cls(name, width, tuple(factors.tolist()), lost, change)

    def apply(self, series: Array) -> Array:
        """A series, shape ((F+1)^2, ...), times the factors of its degrees."""
        if not self.factors:
            return series
        by_index = np.array(self.factors)[degrees(len(self.factors) - 1)]
        return series * by_index.reshape(-1, *[1] * (series.ndim - 1))


def window_factors(name: str, width: float, order: int) -> Array:
    """Factors of the degrees 0 .. order: 1 at 0, and 0 at and beyond the width.

    Parameters
    ----------
    name : {"hann", "lanczos"}
        ``(1 + cos(pi l / w)) / 2`` or ``sin(pi l / w) / (pi l / w)``.
    width : float
        w, positive; it need not be whole.
    order : int

    References
    ----------
    Sloan 2008, Stupid Spherical Harmonics (SH) Tricks, "Windowing".
    """
    share = np.minimum(np.arange(order + 1), width) / width
    shape = np.sinc(share) if name == "lanczos" else (1 + np.cos(np.pi * share)) / 2
    return np.where(share < 1, shape, 0.0)


def parse_window(spec: str) -> tuple[str, float | None]:
    """Name and width of a window, as `NAME` or `NAME:WIDTH`; no width where none is said.

    Raises
    ------
    MapError
        If the name is unknown, or the width is not a positive number.
    """
    name, colon, text = spec.partition(":")
    if name not in NAMES:
        raise MapError(f"window {spec!r}: no such window; take one of {', '.join(NAMES)}")
    if not colon:
        return name, None
    if name not in FAMILIES:
        raise MapError(f"window {spec!r}: {name} has no width; leave :{text} out")
    try:
        width = float(text)
    except ValueError:
        width = np.nan
    if not (np.isfinite(width) and width > 0):
        raise MapError(f"window {spec!r}: its width must be a positive number, as in {name}:3")
    return name, width


def make_window(spec: str, series: Array) -> Window:
    """The window that a specification asks for.

    Parameters
    ----------
    spec : str
        As `parse_window` takes it; the width is order + 1 where none is said. ``auto`` is
        `least_window`.
    series : ndarray, shape ((F+1)^2, 3)
        Of the irradiance, ``A_l L_lm``.

    Raises
    ------
    MapError
    """
    name, width = parse_window(spec)
    if name == "auto":
        return least_window(series)
    if name != "none" and width is None:
        width = order_of(len(series)) + 1.0
    return Window.of(name, width, series)


def least_window(series: Array) -> Window:
    """The window that changes a series least, of those that leave it non-negative everywhere.

    Each degree has a factor of its own, 1 for the mean and within 0 .. 1 for the others; they
    need not fall with the degree. Of all such that keep every channel at or above `MARGIN` times
    its mean, these change the series least, as RMS over all channels, which share them: their
    hue stays. A series that is nowhere negative gets no window.

    The factors are sought over some directions alone, where what each degree adds is known; the
    lowest directions of the series that they give join these, until they are not too low either.

    Parameters
    ----------
    series : ndarray, shape ((F+1)^2, 3)
        With a mean, which is coefficient 0, that is not negative in any channel.
    """
    directions, values = lowest(series)
    if values.min() >= 0:
        return Window()
    floor = MARGIN * series[0] / np.sqrt(4 * np.pi)
    start = np.concatenate([spiral_directions(_FIRST_DIRECTIONS), directions])
    by_degree = degree_values(series, start)
    for _ in range(_ROUNDS):
        window = Window.least(_least_factors(_squares(series), by_degree, floor), series)
        windowed = window.apply(series)
        found, values = lowest(windowed)
        if (values >= floor / 2).all():
            return window
        found = np.concatenate([found, low_places(windowed, floor / 2, _MOST_PLACES)])
        by_degree = np.concatenate([by_degree, degree_values(series, found)])
    return Window.least(_faded(np.array(window.factors), values, floor), series)


def _least_factors(squares: Array, by_degree: Array, floor: Array) -> Array:
    """The factors for some directions, from the values of their degrees, shape (n, F+1, 3).

    With t = 1 - factor and p the RMS of a degree, the least ``|p t|^2`` is sought with
    ``sum_l t_l value_l <= sum_l value_l - floor`` in every direction, and t within 0 .. 1.
    """
    used = np.flatnonzero(squares[1:] > 0) + 1
    share = np.sqrt(squares[used] / squares.sum())
    values = by_degree.transpose(0, 2, 1).reshape(-1, len(squares))
    rows, bounds = values[:, used] / share, values.sum(axis=1) - np.tile(floor, len(by_degree))
    lengths = np.linalg.norm(rows, axis=1)
    binding = bounds < lengths  # |p t| is 1 at most: other rows cannot be too large
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
    """Factors nearer to 0, so that the lowest values rise to the floor; the mean stays."""
    mean = floor / MARGIN
    is_low = values < floor
    kept = ((mean - floor)[is_low] / (mean - values)[is_low]).min(initial=1.0)
    return np.concatenate([factors[:1], factors[1:] * kept])


def _squares(series: Array) -> Array:
    """The square of each degree, over all its coefficients and channels, shape (F+1,)."""
    starts = np.arange(order_of(len(series)) + 1) ** 2
    return np.add.reduceat(np.sum(series**2, axis=1), starts)
