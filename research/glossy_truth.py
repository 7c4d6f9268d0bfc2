"""The light that spheres of GGX reflect, by brute force.

Nothing here is shared with `shrm_cli` except the reading and averaging of probes. With Schlick's
Fresnel term the reflected light is ``f0 E0 + (1 - f0) E1``, so that two integrals serve every f0.
One matrix, over the pixels of a sphere and of a probe, serves all probes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from research.irradiance import latlong_pixels
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.sphere.grid.latlong import LatLong

Array = NDArray[np.floating]

SOURCE_ROWS = 128
"""Probes are averaged down to this height, 256 x 128. At alpha = .25 the result is within 1 % RMS
of that from 512 x 256 (2 % for Fresnel's tail under the lamps of a night), which is a small part of
any method's error."""
_AT_ONCE = 2**17
"""Pairs of a pixel and a light that are computed at a time. Because they stay in the processor's
cache, the sums take a quarter of the time."""
_RINGS = 20000
"""Rings about N that the integral of a lobe is summed over."""


@dataclass(frozen=True)
class Light:
    """Several probes as lights of the same directions.

    Attributes
    ----------
    directions : ndarray, shape (m, 3)
        Unit vectors to the lights.
    power : ndarray, shape (m, 3 * probes)
        Radiance times solid angle.
    """

    directions: Array
    power: Array


@dataclass(frozen=True)
class Sphere:
    """The n pixels of a sphere that a distant viewer sees, row by row.

    Attributes
    ----------
    normals, views : ndarray, shape (n, 3)
        Unit vectors in world axes; views point to the viewer.
    inside : ndarray, shape (size, size)
        Whether each pixel of the picture shows the sphere.
    """

    normals: Array
    views: Array
    inside: NDArray[np.bool_]

    @property
    def mirrored(self) -> Array:
        """The mirror directions R, shape (n, 3)."""
        cosines = np.sum(self.normals * self.views, axis=1, keepdims=True)
        return 2 * cosines * self.normals - self.views


def light_of(probes: Sequence[Probe], rows: int = SOURCE_ROWS) -> Light:
    """Turn probes into lights, averaged down to a number of rows."""
    directions, solid = latlong_pixels(rows)
    power = [to_grid(probe, LatLong(rows)) * solid[..., None] for probe in probes]
    return Light(
        directions.reshape(-1, 3).astype(np.float32),
        np.concatenate([each.reshape(-1, 3) for each in power], axis=1).astype(np.float32),
    )


def sphere(view: ArrayLike, size: int) -> Sphere:
    """Make a sphere that fills a picture of `size` x `size` pixels; `view` points to the viewer."""
    view = np.asarray(view, dtype=float)
    middles = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(middles, -middles)
    inside = x**2 + y**2 < 0.998
    x, y = x[inside], y[inside]
    up = np.array([0, 1.0, 0]) if abs(view[1]) < 0.9 else np.array([0, 0, -1.0])
    right = np.cross(up, view)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(view, right), view])
    normals = np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=1) @ axes
    return Sphere(normals, np.broadcast_to(view, normals.shape), inside)


def reflect(pixels: Sphere, light: Light, alphas: Sequence[float]) -> Array:
    """Integrate E0 and E1 for each of GGX's alphas, shape (2, len(alphas), n, channels).

    The masking and shadowing term is Smith's with correlated heights, eq. 99 of Heitz 2014.
    """
    result = np.empty((2, len(alphas), len(pixels.normals), light.power.shape[1]))
    directions = light.directions.T
    for part in _parts(len(pixels.normals), light):
        normals, views = (each[part].astype(np.float32) for each in (pixels.normals, pixels.views))
        n_v = np.sum(normals * views, axis=1)[:, None]
        n_l = normals @ directions
        length = np.sqrt(np.maximum(2 + 2 * (views @ directions), 1e-12))  # the length of L + V
        n_h2 = ((n_l + n_v) / length) ** 2
        tail = (1 - length / 2) ** 5  # V.H is half the length
        n_l = np.maximum(n_l, 0)
        for k, alpha in enumerate(alphas):
            a2 = np.float32(alpha * alpha)
            masking = n_l * np.sqrt(a2 + (1 - a2) * n_v**2)
            shadowing = n_v * np.sqrt(a2 + (1 - a2) * n_l**2)
            kernel = _distribution(n_h2, a2) * n_l / (2 * (masking + shadowing))
            result[0, k, part] = kernel @ light.power
            kernel *= tail
            result[1, k, part] = kernel @ light.power
    return result


def mirror_means(mirrored: Array, light: Light, alphas: Sequence[float]) -> Array:
    """Compute the split sum's first factor: means of the light by GGX's lobe for N = V = R.

    Parameters
    ----------
    mirrored : ndarray, shape (n, 3)
        Mirror directions R.
    light : Light
    alphas : sequence of float
        GGX's alphas.

    Returns
    -------
    ndarray, shape (len(alphas), n, channels)
    """
    theta = (np.arange(_RINGS) + 0.5) / _RINGS * np.pi / 2
    rings = np.pi**2 * np.sin(theta) / _RINGS
    wholes = [float(rings @ _lobe(np.cos(theta), alpha)) for alpha in alphas]
    result = np.empty((len(alphas), len(mirrored), light.power.shape[1]))
    for part in _parts(len(mirrored), light):
        cosines = mirrored[part].astype(np.float32) @ light.directions.T
        for k, (alpha, whole) in enumerate(zip(alphas, wholes, strict=True)):
            result[k, part] = (_lobe(cosines, alpha) @ light.power) / whole
    return result


def _parts(count: int, light: Light) -> list[slice]:
    step = max(_AT_ONCE // len(light.directions), 1)
    return [slice(start, start + step) for start in range(0, count, step)]


def _distribution(n_h2: Array, a2: float) -> Array:
    """Compute GGX's distribution D from the square of N.H."""
    return a2 / (np.pi * (1 - (1 - a2) * n_h2) ** 2)


def _lobe(cosines: Array, alpha: float) -> Array:
    """Compute ``f_DV N.L`` for N = V from the cosines N.L."""
    a2 = alpha * alpha
    n_l = np.maximum(cosines, 0)
    return (
        _distribution((1 + cosines) / 2, a2) * n_l / (2 * (n_l + np.sqrt(a2 + (1 - a2) * n_l**2)))
    )
