"""Which view functions a map of K cubes keeps.

A function of the azimuthal order q > 0 has two parts, the cosine and the sine, whose axes turn with
the mirror direction. To be stored without a pole they are turned to world axes, in bundles. A
bundle of degree p holds one function of each order 0 .. p, which are ``2p + 1`` numbers, and turns
as the harmonics of degree p do. A vector is a bundle of degree 1, for example. So K cubes can hold
any numbers n_q of functions that do not rise with q, with ``K = n_0 + 2 (n_1 + n_2 + ...)``.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array

Counts = tuple[int, ...]
"""The number of functions of each azimuthal order, which does not rise."""


def cubes_of(counts: Counts) -> int:
    """Return the number of cubes that functions take."""
    return counts[0] + 2 * sum(counts[1:])


def bundle_degrees(counts: Counts) -> tuple[int, ...]:
    """Return the degrees of the bundles that hold functions, descending."""
    fewer = [a - b for a, b in pairwise((*counts, 0))]
    return tuple(p for p in reversed(range(len(fewer))) for _ in range(fewer[p]))


def bundle_functions(counts: Counts) -> dict[int, list[tuple[int, ...]]]:
    """Return which functions the bundles of each degree hold.

    A bundle of degree p shows details of up to p degrees more than those of the light, which
    look-ups between texels blur. The strongest functions are therefore in the bundles of the lowest
    degrees that may hold them, and the weakest in those of the highest.

    Returns the bundles for each degree p, descending, in the order of `bundle_degrees`. A bundle is
    given by the index of its function of each order 0 .. p, of which 0 is the strongest.
    """
    found: dict[int, list[tuple[int, ...]]] = {}
    for place, p in enumerate(bundle_degrees(counts)):
        found.setdefault(p, []).append(tuple(counts[q] - 1 - place for q in range(p + 1)))
    return found


def bundle_counts(degrees: tuple[int, ...]) -> Counts:
    """Return the number of functions of each order that bundles hold."""
    return tuple(sum(p >= q for p in degrees) for q in range(max(degrees, default=0) + 1))


def best_counts(energies: Array, most: int) -> list[Counts]:
    """Choose the functions of the most energy: those of K cubes at index K - 1.

    `energies`, of shape (Q+1, k), are the energy in each function; functions of an order are taken
    from the first on. `most` is the largest number of cubes, 1 or more.
    """
    q_count = len(energies)
    # held[n, k] is the most energy of orders from q on, with n functions of order q, in k cubes.
    limit = min(energies.shape[1], most)
    held = np.zeros((limit + 1, most + 1))
    held[1:] = -np.inf
    choices: list[NDArray[np.intp]] = []
    for q in reversed(range(q_count)):
        cost = 1 if q == 0 else 2
        # With n functions of order q there may be at most n of the next one.
        order = np.maximum.accumulate(held, axis=0)
        fits = held >= order
        best = np.maximum.accumulate(np.where(fits, np.arange(limit + 1)[:, None], 0), axis=0)
        choices.append(best)
        summed = np.append(0.0, np.cumsum(energies[q, :limit]))
        held = np.full_like(order, -np.inf)
        for n in range(limit + 1):
            if cost * n <= most:
                held[n, cost * n :] = order[n, : most + 1 - cost * n] + summed[n]
    return [_traced(held, choices[::-1], k) for k in range(1, most + 1)]


def _traced(held: Array, choices: list[NDArray[np.intp]], cubes: int) -> Counts:
    """Follow the choices back from the best number of functions of order 0."""
    # A map holds one function at least, even where there is no light.
    n = 1 + int(np.argmax(held[1:, cubes]))
    left, counts = cubes - n, [n]
    for best in choices[:-1]:
        n = int(best[n, left])
        left -= 2 * n
        counts.append(n)
    while len(counts) > 1 and counts[-1] == 0:
        counts.pop()
    return tuple(counts)
