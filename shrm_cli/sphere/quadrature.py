"""Sample positions of one axis, the weights of rules over it or the sphere, and interpolation.

Two samplings of an axis by n pixels exist. With ``center`` pixel i covers ``(i, i+1) / n`` and is
sampled at its center. With ``border`` pixel 0 and pixel n-1 lie on the two ends of the range, as
OpenEXR defines its environment maps. Matrices interpolate functions of the polar angle from one set
of nodes to another.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.vocabulary import Sampling


def nodes(size: int, sampling: Sampling = "center") -> Array:
    """The `size` sample positions of one axis, in [-1, 1], ascending."""
    if sampling == "border":
        return np.linspace(-1.0, 1.0, size) if size > 1 else np.zeros(1)
    return (2 * np.arange(size) + 1) / size - 1


def cell_edges(count: int, sampling: Sampling) -> Array:
    """Where the cells of `count` samples in [-1, 1] meet, and both ends, shape (count + 1,).

    A sample's cell reaches half way to the samples beside it, and is cut at the ends of the axis.
    """
    samples = nodes(count, sampling)
    return np.concatenate([[-1.0], (samples[1:] + samples[:-1]) / 2, [1.0]])


def colatitude_weights(height: int, sampling: Sampling = "center") -> Array:
    """Quadrature weights of the rows of a lat-long for the integral over sin(theta) dtheta.

    The rule is Fejer's first (``center``) or Clenshaw and Curtis's (``border``). Both are exact
    for every trigonometric polynomial of degree below `height`, unlike the usual sin(theta) times
    the row's height.

    Returns an array of shape (height,), whose sum is 2.

    References: Waldvogel 2006, Fast construction of the Fejer and Clenshaw-Curtis quadrature rules.
    """
    intervals = height if sampling == "center" else height - 1
    k = np.arange(intervals // 2 + 1)
    moments = 4 / (1 - 4.0 * k**2)  # twice the integrals of cos(2 k theta) sin(theta)
    moments[0] /= 2
    if intervals % 2 == 0:
        # The last wave is 0 at the centers of the intervals, and counts twice at their ends.
        moments[-1] *= 0 if sampling == "center" else 0.5
    shift = np.exp(1j * np.pi * k / intervals) if sampling == "center" else 1
    weights = np.fft.ifft(moments * shift, n=intervals).real
    if sampling == "border":
        weights = np.append(weights, weights[0])
        weights[[0, -1]] /= 2
    return weights


def longitude_weights(width: int, sampling: Sampling = "center") -> Array:
    """Weights of the columns of a lat-long; they sum to 2 pi."""
    if sampling == "center":
        return np.full(width, 2 * np.pi / width)
    # The two end columns are the same meridian and share its weight.
    weights = np.full(width, 2 * np.pi / (width - 1))
    weights[[0, -1]] /= 2
    return weights


@lru_cache(maxsize=32)
def gauss_legendre(count: int) -> tuple[Array, Array]:
    """Nodes in (-1, 1), ascending, and weights of the rule exact to degree 2 count - 1; read-only.

    References: Golub & Welsch 1969: eigenvalues and first components of the eigenvectors of the
    Jacobi matrix.
    """
    k = np.arange(1, count)
    beside = k / np.sqrt(4.0 * k**2 - 1)
    values, vectors = np.linalg.eigh(np.diag(beside, -1) + np.diag(beside, 1))
    weights = 2 * vectors[0] ** 2
    for each in (values, weights):
        each.setflags(write=False)
    return values, weights


def spiral_directions(count: int) -> Array:
    """Directions of equal weight all over the sphere, without regular rows, shape (count, 3).

    Sums over the rows of other grids resonate with functions that have rows of their own.

    References: Gonzalez 2010, Measurement of areas on a sphere using Fibonacci and
    latitude-longitude lattices.
    """
    k = np.arange(count)
    z = (2 * k + 1) / count - 1
    phi = k * (np.pi * (3 - np.sqrt(5)))
    sine = np.sqrt(1 - z**2)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)


def scrambled(count: int) -> NDArray[np.intp]:
    """The numbers 0 .. count - 1 in a fixed order without any pattern.

    It does what ``numpy.random`` would, which takes longer to load than many a map to be made.

    Returns an array of int of shape (count,).

    References: Wellons 2018, Prospecting for hash functions: ``lowbias32``, which maps no two
    numbers to one.
    """
    keys = np.arange(count, dtype=np.uint32)
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B), (16, 1)):
        keys ^= keys >> np.uint32(shift)
        keys *= np.uint32(factor)
    return np.argsort(keys)


def interpolation_matrix(known: Array, targets: Array, odd: bool) -> Array:
    """Return what leads from values at known angles to those at others, cubically: (m, n).

    `known`, of shape (n,), are angles in 0 .. pi, ascending, four at least. `targets`, of shape
    (m,), are angles in 0 .. pi. Beyond the last one the polynomial of the last four goes on. `odd`
    tells whether the function is odd about angle 0; otherwise it is even.
    """
    wide = np.concatenate([-known[2::-1], known])
    first = np.clip(np.searchsorted(wide, targets) - 2, 0, len(wide) - 4)
    matrix = np.zeros((len(targets), len(wide)))
    rows = np.arange(len(targets))
    for i in range(4):
        weight = np.ones(len(targets))
        for j in range(4):
            if j != i:
                near, far = wide[first + i], wide[first + j]
                weight *= (targets - far) / (near - far)
        matrix[rows, first + i] += weight
    folded = matrix[:, 3:].copy()
    folded[:, :3] += (-1 if odd else 1) * matrix[:, 2::-1]
    return folded


def linear_matrix(known: Array, targets: Array) -> Array:
    """Return the matrix of linear interpolation between even places, clamped: shape (m, n).

    `known`, of shape (n,), are evenly spaced, ascending, two at least. `targets` are of shape (m,).
    """
    position = (targets - known[0]) / (known[1] - known[0])
    position = np.clip(position, 0, len(known) - 1)
    low = np.minimum(position.astype(np.intp), len(known) - 2)
    matrix = np.zeros((len(targets), len(known)))
    rows = np.arange(len(targets))
    matrix[rows, low] = 1 - (position - low)
    matrix[rows, low + 1] += position - low
    return matrix
