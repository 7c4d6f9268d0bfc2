"""Fits the roughness at which even GGX reflects as much as brushed GGX; see `equal_roughness`."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from shrm_cli.brdf.environment.environment_brdf import brushed_totals, lobe_moments

_RATIOS = 0.25, 0.4, 0.55, 0.7, 0.85
_ROUGHNESS = 0.2, 0.3, 0.4, 0.5, 0.62, 0.75, 0.9
_COSINES = np.array([0.95, 0.8, 0.6, 0.4, 0.25, 0.12])
_AZIMUTHS = np.radians([0, 30, 60, 90])


def turns() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return c and d of the total and of the bias, and what they leave of each integral."""
    grid = np.linspace(0.05, 1, 40)
    even = CubicSpline(grid, [lobe_moments(each, _COSINES)[:, 0] for each in grid.tolist()])
    truth, means, turned = [], [], []
    for ratio in _RATIOS:
        for roughness in _ROUGHNESS:
            if roughness > ratio * (1 + 1e-9):
                continue
            ay = roughness**2
            ax = min(ay / ratio**2, 1.0)
            for azimuth in _AZIMUTHS:
                truth.append(brushed_totals((ax, ay), _COSINES, azimuth))
                means.append((ax**2 + ay**2) / 2)
                turned.append((ax**2 - ay**2) / 2 * np.cos(2 * azimuth) * (1 - _COSINES**2))
    wanted, mean, turn = np.array(truth), np.array(means)[:, None], np.array(turned)

    def left(numbers: np.ndarray, kind: int) -> np.ndarray:
        square = mean + (numbers[0] + numbers[1] * _COSINES) * turn
        found = even(np.clip(square, 0.05**4, 1) ** 0.25)
        column = np.arange(len(_COSINES))
        return (found[:, column, kind, column] - wanted[:, kind]).ravel()

    fits = (least_squares(left, [0.1, 0.1], args=(kind,)) for kind in (0, 1))
    return {name: (fit.x, fit.fun) for name, fit in zip(("total", "bias"), fits, strict=True)}
