"""Integrals over a lobe as functions of the view: nodes of half vectors, and tables over N.V."""

from functools import lru_cache

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.vectors import GRAZING
from shrm_cli.sphere.quadrature import gauss_legendre

_TABLE = 129  # nodes in N.V


def half_vectors(alpha: float, view: Array, count: int) -> tuple[Array, Array, Array]:
    """Return nodes of a quadrature over the half vectors with which light comes from above.

    Their coordinates are the azimuth of H from the view, and x, where the slope of H is ``t =
    tan(theta_h) = alpha sinh(x)``; in x lobes of all widths are smooth. L is above the surface
    where ``cos(phi) > N.V (t^2 - 1) / (2 t sin(theta_v))``. That holds for all azimuths up to the
    slope ``(1 - sin(theta_v)) / N.V``, and for none beyond ``(1 + sin(theta_v)) / N.V``. Nodes are
    dense at both slopes, because the range of azimuths changes there like a square root.

    `alpha` is the width of the lobe, as a slope. `view`, of shape (n, 1), is N.V. `count` is the
    number of nodes of each half of the integral over x.

    Returns `x`, `measure` and `end`, each of shape (n, 2 count), the nodes, their weights for an
    integral over x, and the azimuth where L meets the horizon.
    """
    sine = np.sqrt(1 - view**2)
    first, second = np.arcsinh(view / (1 + sine) / alpha), np.arcsinh((1 + sine) / view / alpha)
    nodes, weights = unit_rule(count)
    eased, eased_weights = nodes**2 * (3 - 2 * nodes), weights * 6 * nodes * (1 - nodes)
    span = second - first
    x = np.concatenate([first * nodes, first + span * eased], axis=1)
    measure = np.concatenate([first * weights, span * eased_weights], axis=1)
    slope = alpha * np.sinh(x)
    limit = view * (slope**2 - 1) / np.maximum(2 * slope * sine, np.finfo(float).tiny)
    return x, measure, np.arccos(np.clip(limit, -1.0, 1.0))


@lru_cache
def unit_rule(count: int) -> tuple[Array, Array]:
    """Nodes and weights of Gauss and Legendre's rule on 0 .. 1."""
    nodes, weights = gauss_legendre(count)
    return (nodes + 1) / 2, weights / 2


class ViewTable:
    """Nodes in N.V for the table of a lobe, and the interpolation between them.

    What a lobe reflects changes fastest where N.V is less than its width. The nodes are dense
    there, for any width.

    `width` is the ggx_alpha of the lobe, or of one that is as wide.
    """

    def __init__(self, width: float) -> None:
        self._scale = 0.3 * width
        first, last = np.arcsinh(np.sqrt(np.array([GRAZING, 1.0]) / self._scale)).tolist()
        self._ends = first, last

    @property
    def nodes(self) -> Array:
        """N.V at the nodes, rising from 1e-5 to 1."""
        return self._scale * np.sinh(np.linspace(*self._ends, _TABLE)) ** 2

    def interpolated(self, table: Array, view: Array) -> Array:
        """Interpolate each row by the cubic polynomial through the four nearest nodes.

        `table` is of shape (..., nodes). `view` is N.V, from 1e-5 to 1.
        """
        first, last = self._ends
        position = (_TABLE - 1) * (
            (np.arcsinh(np.sqrt(view / self._scale)) - first) / (last - first)
        )
        node = np.clip(position.astype(int), 1, _TABLE - 3)
        t = position - node
        result = table[..., node - 1] * (-t * (t - 1) * (t - 2) / 6)
        result += table[..., node] * ((t + 1) * (t - 1) * (t - 2) / 2)
        result += table[..., node + 1] * (-(t + 1) * t * (t - 2) / 2)
        result += table[..., node + 2] * ((t + 1) * t * (t - 1) / 6)
        return np.asarray(result)
