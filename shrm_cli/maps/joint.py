"""The error of a sum of maps, from the errors of its terms."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.maps.base import Map
from shrm_cli.sphere.directions import bisector
from shrm_cli.sphere.quadrature import spiral_directions

_PAIRS = 4096
"""The pairs of mirror directions and views at which maps are compared."""


def joint_error(strengths: ArrayLike, errors: Sequence[float], whole: float) -> float:
    """Return the error of a sum relative to the sum, taking those of its terms as independent.

    `strengths`, of shape (terms,), are the RMS of the light that each term reflects. `whole` is the
    RMS of the sum. It is the sum of the strengths only where all terms are bright in the same
    places.
    """
    return float(np.linalg.norm(np.multiply(strengths, errors)) / max(whole, 1e-300))


def brightness(terms: Sequence[Map]) -> tuple[Array, float]:
    """Measure how bright the terms of a sum are, each a map of its own, and how bright it is.

    Returns `strengths` of shape (terms,), the RMS of the light of each over mirror directions and
    views; and `whole`, that of the sum.
    """
    views = spiral_directions(_PAIRS)
    centers = np.random.default_rng(0).permutation(views)
    found = [each.radiance(bisector(centers, views), views) for each in terms]
    strengths = np.array([np.sqrt(np.mean(each**2)) for each in found])
    return strengths, float(np.sqrt(np.mean(np.sum(found, axis=0) ** 2)))
