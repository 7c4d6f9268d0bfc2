"""What bilinear filtering of a cube's texels does to a function on the sphere, degree by degree.

A GPU looks a cube map up by weighting the four texels around a direction. Between the texels the
result is too smooth, and the finer the detail the more of it is lost. A function of degree l is
locally a plane wave of ``l + 1/2`` radians per radian. A wave that advances by ``a`` radians from
one sample to the next is, interpolated linearly, correlated with itself by ``sinc(a/2)^2`` and has
the mean square ``(2 + cos a) / 3``; both are means over the positions between the samples. Along
two axes both factors multiply. What is left is a mean over the face, where texels differ in size,
and over the directions of the wave.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.vocabulary import Sampling

Array = NDArray[np.floating]

_POSITIONS = 6
"""Gauss's nodes over half a face along each of its axes."""
_DIRECTIONS = 16
"""Directions of waves, over half a turn."""


def bilinear_errors(order: int, size: int, sampling: Sampling = "center") -> Array:
    """Return the mean squared error of bilinear filtering, relative to the energy of each degree.

    Parameters
    ----------
    order : int
        The largest degree.
    size : int
        Texels along a face's edge.
    sampling : {"center", "border"}
        Where the edge texels lie.

    Returns
    -------
    ndarray, shape (order+1,)
        Degree 0 is filtered without error. Where a degree is far beyond what the texels resolve,
        its error approaches 13/9: the wave is lost, and the values of single texels are left.
    """
    step = 2 / size if sampling == "center" or size == 1 else 2 / (size - 1)
    nodes, weights = gauss_legendre(_POSITIONS)
    s, t = np.meshgrid((nodes + 1) / 2, (nodes + 1) / 2, indexing="ij")
    measure = np.outer(weights, weights) * (1 + s**2 + t**2) ** -1.5
    measure /= measure.sum()
    along_s, along_t = _advances(s, t)
    # Shape (positions, directions, degrees).
    degree = np.arange(order + 1)
    wave = np.where(degree > 0, degree + 0.5, 0.0) * step
    a, b = along_s.reshape(-1, _DIRECTIONS, 1) * wave, along_t.reshape(-1, _DIRECTIONS, 1) * wave
    correlation = (np.sinc(a / (2 * np.pi)) * np.sinc(b / (2 * np.pi))) ** 2
    square = (2 + np.cos(a)) * (2 + np.cos(b)) / 9
    return np.asarray(measure.reshape(-1) @ np.mean(1 - 2 * correlation + square, axis=1))


def _advances(s: Array, t: Array) -> tuple[Array, Array]:
    """Return how many radians waves of 1 radian per radian advance for each unit of s and t.

    Parameters
    ----------
    s, t : ndarray, shape (n, n)
        Positions on the face ``(1, s, t)``.

    Returns
    -------
    along_s, along_t : ndarray, shape (n, n, directions)
    """
    # The direction is d = (1, s, t) / r, and its derivatives are tangents of the sphere.
    r = np.sqrt(1 + s**2 + t**2)
    d = np.stack([np.ones_like(s), s, t], axis=-1) / r[..., None]
    by_s = (np.array([0.0, 1.0, 0.0]) - d * d[..., 1:2]) / r[..., None]
    by_t = (np.array([0.0, 0.0, 1.0]) - d * d[..., 2:3]) / r[..., None]
    first = by_s / np.linalg.norm(by_s, axis=-1, keepdims=True)
    second = np.cross(d, first)
    angle = np.pi * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    wave = (
        np.cos(angle)[:, None] * first[..., None, :] + np.sin(angle)[:, None] * second[..., None, :]
    )
    return np.einsum("ijnk,ijk->ijn", wave, by_s), np.einsum("ijnk,ijk->ijn", wave, by_t)
