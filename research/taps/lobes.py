"""Lobes as series of harmonics, and how far apart two are under the light of real probes.

The mean squared error of a lobe, over all rotations of a light, is a sum over the squares of the
differences of its coefficients, each times the power of the light in a degree. So a fit of lobes
in this norm is one over light from everywhere.
"""

from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import assoc_legendre_p_all, eval_legendre

from shrm_cli.brdf.environment.lobe import GgxLobe
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe

ORDER = 72
"""The degrees that count; lobes of alpha 0.04 and more have little beyond."""
_RINGS = 160
_DEGREES = np.arange(ORDER + 1)
_PART = _DEGREES[None] <= _DEGREES[:, None]
_ROUGHNESS = np.linspace(0.1, 1, 46)


def mean_spectrum(files: list[Path]) -> np.ndarray:
    """Return the power of one coefficient in each degree, averaged over probes of equal energy."""
    found = []
    for file in files:
        power = project(open_probe(file), 128).power().sum(axis=1)
        found.append(power / (2 * np.arange(129) + 1) / power[1:].sum())
    return np.mean(found, axis=0)[: ORDER + 1]


def view(cosine: float, azimuth: float) -> np.ndarray:
    sine = np.sqrt(1 - cosine * cosine)
    return np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine])


class Norm:
    """Vectors of lobes, whose squared distances are mean squared errors under some light."""

    def __init__(self, spectrum: np.ndarray) -> None:
        twice = np.where(_DEGREES == 0, 1, np.sqrt(2))
        self._weights = (np.sqrt(spectrum)[:, None] * twice)[_PART]

    def vector(self, coefficients: np.ndarray) -> np.ndarray:
        """Return the vector of coefficients (degree, order) of a real function."""
        parts = coefficients[_PART] * self._weights
        return np.concatenate([parts.real, parts.imag])

    def brushed(self, alphas: tuple[float, float], seen: np.ndarray) -> np.ndarray:
        """Return the vector of the lobe of a view, scaled to be a mean of light."""
        light, rings, series = _grid()
        brdf = Ggx(ax=alphas[0], ay=alphas[1])
        values = brdf.transfer(light, seen)[..., 0]
        turns = np.fft.rfft(values, axis=-1)[:, : ORDER + 1]
        turns = turns * np.exp(-1j * np.pi / (2 * _RINGS) * _DEGREES) * rings[:, None]
        found = np.einsum("lmz,zm->lm", series, turns, optimize=True)
        return self.vector(found) / (values.sum(axis=1) @ rings * np.sqrt(2 * np.pi))

    def even(self, roughness: float, axis: np.ndarray) -> np.ndarray:
        """Return the vector of the lobe of a level of a split sum about an axis."""
        legendre = assoc_legendre_p_all(ORDER, ORDER, axis[2], norm=True)[0][:, : ORDER + 1]
        turned = np.exp(-1j * _DEGREES * np.arctan2(axis[1], axis[0]))
        passed = _levels()(np.clip(roughness, _ROUGHNESS[0], 1))
        return self.vector(passed[:, None] * legendre * turned / np.sqrt(2 * np.pi))


@cache
def _grid() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return directions (rings, azimuths, 3), the rings' weights, and Legendre's functions."""
    heights, weights = np.polynomial.legendre.leggauss(_RINGS)
    azimuths = (np.arange(2 * _RINGS) + 0.5) / _RINGS * np.pi
    z, phi = np.meshgrid(heights, azimuths, indexing="ij")
    sine = np.sqrt(1 - z * z)
    light = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)
    series = assoc_legendre_p_all(ORDER, ORDER, heights, norm=True)[0][:, : ORDER + 1]
    return light, weights, series


@cache
def _levels() -> CubicSpline:
    """Return what levels multiply the degrees of the light with, over their roughness."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    t = (nodes + 1) / 2
    angles, steps = np.pi / 2 * t**3, 3 * np.pi / 4 * t**2 * weights
    legendre = eval_legendre(_DEGREES[:, None], np.cos(angles))
    rings = 2 * np.pi * np.sin(angles) * steps
    half = np.sin(angles / 2) ** 2
    lobes = (GgxLobe(roughness=float(each)).radial(half) for each in _ROUGHNESS)
    return CubicSpline(_ROUGHNESS, [legendre @ (rings * lobe) for lobe in lobes])
