"""For which values of parameters that vary there are textures, and how those are joined.

Between the values of a parameter a shader interpolates linearly. What that misses of the texture
in the middle is measured, and the interval that misses most gets that texture, until all miss
little or there are as many as asked for. Lobes change most where they are broad: evenly spaced
values would be too few there, and too many elsewhere.

Of several parameters a texture for each combination of their values would take tens of megabytes.
But these textures are much alike, so that few of them are kept, of which all others are sums: where
a material is linear in a parameter, such as an albedo, two suffice. The weights of the sums are a
table over the values, and are what is interpolated.
"""

import heapq
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.progress import report
from shrm_cli.records import record

MOST_STEPS = 64
"""The most values of a parameter, with a texture for each."""
_MOST_OF_TWO = 24
"""The most values of each of two parameters, and the most textures of them."""
ENOUGH = 0.01
"""The relative RMS error between textures above which more of them are made."""
_FIRST = 4
"""Intervals to begin with: the middle of a single one could be right by symmetry alone."""
_SHARES = 0.5, 0.35, 0.25
"""The parts of `ENOUGH` that interpolation of each of two parameters may miss: the next one is
tried where all of it together misses too much."""
_ALIKE = ENOUGH / 10
"""What textures that are kept may miss of others, where more of them would not help."""
_DECIMALS = 6
"""The decimals of the weights, which files hold as text."""


@record(eq=False)
class Steps:
    """Values of parameters, and how textures are joined at each combination of them.

    `values` are two or more rising values of each parameter. `weights`, of shape (values of the
    first parameter, ..., textures), are what the textures are multiplied with before they are
    added. Between values the weights are linear in each parameter. Of one parameter there is a
    texture for each value. `error` is the largest relative RMS error in the middle between values,
    under white noise; 0 where nobody has measured it.
    """

    values: Mapping[str, tuple[float, ...]]
    weights: Array
    error: float = 0.0

    def __post_init__(self) -> None:
        if any(len(own) < 2 or any(b <= a for a, b in pairwise(own)) for own in self._axes):
            raise ValueError("values that do not rise")
        if self.weights.shape[:-1] != tuple(map(len, self._axes)):
            raise ValueError(f"weights of shape {self.weights.shape}")

    @classmethod
    def of_one(cls, parameter: str, values: Iterable[float], error: float = 0.0) -> "Steps":
        """Return the values of a single parameter, with a texture for each."""
        own = tuple(map(float, values))
        return cls({parameter: own}, np.eye(len(own)), error)

    @property
    def _axes(self) -> list[tuple[float, ...]]:
        return list(self.values.values())

    def summary(self) -> dict[str, Any]:
        """Return the parameters, their values, and what lies between them, as files record them."""
        names, axes = list(self.values), [list(own) for own in self._axes]
        if len(names) == 1:
            return {"parameter": names[0], "values": axes[0], "step_error": self.error}
        return {"parameters": names, "values": axes, "step_error": self.error}

    @property
    def ways(self) -> dict[str, tuple[float, float]]:
        """The least and the largest value of each parameter."""
        return {name: (own[0], own[-1]) for name, own in self.values.items()}

    def wanted(self, shares: ArrayLike) -> Array:
        """Return the values of the parameters at shares of their ways, shape (..., parameters).

        `shares`, of shape (..., parameters), are from 0 to 1; less and more count as these. A
        number counts for all parameters.
        """
        low, high = (np.array([own[end] for own in self._axes]) for end in (0, -1))
        return np.asarray(low + np.clip(np.asarray(shares, dtype=float), 0, 1) * (high - low))

    def recorded(self, brdfs: Sequence[Mapping[str, Any]], shares: ArrayLike) -> dict[str, Any]:
        """Return the record of the BRDF whose parameters are at shares as `wanted` takes them.

        Some of the records of textures may lack a parameter, as those of GGX do where it is even.
        """
        values = {
            name: rounded(value)
            for name, value in zip(self.values, self.wanted(shares).tolist(), strict=True)
        }
        for brdf in brdfs:
            held = brdf.get("parameters")
            if isinstance(held, dict) and held.keys() >= values.keys():
                return {**brdf, "parameters": {**held, **values}}
        return dict(brdfs[0])

    def at(self, shares: ArrayLike) -> Array:
        """Return the weights of the textures at shares as `wanted` takes them, (..., textures)."""
        below, between = [], []
        for own, value in zip(self._axes, np.moveaxis(self.wanted(shares), -1, 0), strict=True):
            place = np.interp(value, own, np.arange(len(own)))
            below.append(np.clip(place.astype(np.intp), 0, len(own) - 2))
            between.append(place - below[-1])
        result: Array = np.zeros(1)
        for corner in product((0, 1), repeat=len(below)):
            sides = [part if up else 1 - part for up, part in zip(corner, between, strict=True)]
            nodes = tuple(low + up for up, low in zip(corner, below, strict=True))
            result = result + np.prod(sides, axis=0)[..., None] * self.weights[nodes]
        return result


def rounded(value: float) -> float:
    """Return a value to 12 digits: the middle of .2 and .4 is .30000000000000004 as it is."""
    return float(f"{value:.12g}")


def chosen_steps(
    coefficients: Callable[..., Array],
    ranges: Mapping[str, tuple[float, float]],
    steps: int | None = None,
) -> tuple[Steps, list[tuple[float, ...]]]:
    """Choose the values of parameters, and those of which textures are made.

    `coefficients` takes a value of each parameter, and returns coefficients of the product
    functions at some views, an array of any shape, which is the same for all values of two
    parameters. `ranges` are the ends of each range, which are among the values. `steps` is the
    number of values of each parameter, as `chosen_values` takes it.

    Returns `steps`, whose error is more than `ENOUGH` where no number of values that is allowed is
    enough, and of two parameters may be that of one of them; and `points`, the values of the
    parameters that each texture is made for.
    """
    if len(ranges) == 1:
        ((name, ends),) = ranges.items()
        own, error = chosen_values(coefficients, *ends, steps)
        return Steps.of_one(name, own, error), [(value,) for value in own]
    known = cache(coefficients)
    lines = [(low, (low + high) / 2, high) for low, high in ranges.values()]
    for share in _SHARES:
        axes = {}
        for index, (name, ends) in enumerate(ranges.items()):

            def across(value: float, index: int = index) -> Array:
                points = product(*lines[:index], (value,), *lines[index + 1 :])
                return np.stack([known(*point).ravel() for point in points])

            own, missed = chosen_values(across, *ends, steps, share * ENOUGH, _MOST_OF_TWO)
            if steps is None and missed > ENOUGH:  # a grid of them would not miss less
                return Steps.of_one(name, own, missed), [(value,) for value in own]
            axes[name] = tuple(own)
        found, points = _joined(known, axes)
        if steps is not None or found.error <= ENOUGH:
            break
    return found, points


def _joined(
    coefficients: Callable[..., Array], axes: Mapping[str, tuple[float, ...]]
) -> tuple[Steps, list[tuple[float, ...]]]:
    """Find few of the textures of a grid of values, and the weights of which all are sums.

    Whichever misses most of its own size joins those that are kept, until interpolated weights
    miss no more than `ENOUGH`, at the values and in the middles between them. The results are
    those of `chosen_steps`.
    """
    nodes = list(product(*axes.values()))
    middles = list(product(*([(a + b) / 2 for a, b in pairwise(own)] for own in axes.values())))
    low, high = (np.array([own[end] for own in axes.values()]) for end in (0, -1))
    shares = (np.array(nodes + middles) - low) / (high - low)
    rows = []
    for done, point in enumerate(every := nodes + middles, 1):
        rows.append(coefficients(*point).ravel())
        report(done, len(every))
    exact = np.stack(rows)
    sizes = np.maximum(np.linalg.norm(exact, axis=1), np.finfo(float).tiny)
    rest = exact[: len(nodes)] / sizes[: len(nodes), None]
    kept: list[int] = []
    while True:
        missed = np.linalg.norm(rest, axis=1)
        if kept and (missed.max() <= _ALIKE or len(kept) == _MOST_OF_TWO):
            break
        kept.append(int(missed.argmax()))
        along = rest[kept[-1]] / max(missed.max(), np.finfo(float).tiny)
        rest -= np.outer(rest @ along, along)
        tables = exact[kept]
        weights = np.linalg.lstsq(tables.T, exact[: len(nodes)].T)[0].T
        grid = np.round(weights, _DECIMALS).reshape(*map(len, axes.values()), len(kept))
        found = Steps(axes, grid)
        wrong = np.linalg.norm(exact - found.at(shares) @ tables, axis=1)
        found = replace(found, error=float((wrong / sizes).max()))
        if found.error <= ENOUGH:
            break
    return found, [nodes[index] for index in kept]


def chosen_values(
    coefficients: Callable[[float], Array],
    low: float,
    high: float,
    steps: int | None = None,
    enough: float = ENOUGH,
    most: int | None = None,
) -> tuple[list[float], float]:
    """Choose the values of a parameter that textures are made for.

    `coefficients` takes a value, and returns coefficients of the product functions at some views,
    an array of any shape. `low` and `high` are the ends of the range, which are among the values.
    `steps` is the number of values, at least 2; by default as many as miss no more than `enough`,
    and no more than `most`. `enough` is a relative RMS error. `most` is by default `MOST_STEPS`.

    Returns `values`, rising; and `error`, the largest relative RMS error in the middle between two
    of them.
    """
    known: dict[float, Array] = {}

    def at(value: float) -> Array:
        if value not in known:
            report(0, 1)  # nobody knows how many there will be
            known[value] = coefficients(value)
        return known[value]

    def measured(a: float, b: float) -> tuple[float, float, float]:
        middle = at((a + b) / 2)
        whole = max(float(np.sum(middle**2)), np.finfo(float).tiny)
        missed = float(np.sum((middle - (at(a) + at(b)) / 2) ** 2))
        return -np.sqrt(missed / whole), a, b

    count = _FIRST if steps is None else min(_FIRST, steps - 1)
    ends = [low + (high - low) * k / count for k in range(count)] + [high]
    worst = [measured(a, b) for a, b in pairwise(ends)]
    heapq.heapify(worst)
    most = steps or most or MOST_STEPS
    while len(worst) + 1 < most and (steps is not None or -worst[0][0] > enough):
        _, a, b = heapq.heappop(worst)
        middle = (a + b) / 2
        heapq.heappush(worst, measured(a, middle))
        heapq.heappush(worst, measured(middle, b))
    return sorted({a for _, a, _ in worst} | {high}), -worst[0][0]
