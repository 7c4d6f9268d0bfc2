"""What any BRDF reflects of a white, uniform environment: its directional albedo."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli import progress
from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.base import Brdf, check_finite
from shrm_cli.brdf.cache import remembered
from shrm_cli.brdf.environment.lobe import MaterialLobe
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


# ---- albedo --------------------------------------------------------------------------------------


_NODES = 12, 384
"""The fewest nodes over the slope of the half vector, in each half, and the most; over its azimuth
there are half as many."""
_ENOUGH = 1e-5
"""What twice the nodes may change of an albedo, as it is or of its value where that is more."""
_SAMPLES_AT_ONCE = 2**17
_DENSE = 1e-4
"""The width that the nodes of tables are dense for. What cloth reflects changes like a power of N.V
down to 0, however wide its lobe is."""


def material_albedo(brdf: Brdf, cosines: ArrayLike) -> Array:
    """Integrate rho_hat of an isotropic BRDF over the hemisphere of the light, shape (n, 3).

    The nodes are doubled until nothing changes that counts, so that the integrals are exact to
    2e-5 of the albedo, or of 1 where that is less.

    `cosines`, of shape (n,), are N.V; values below 1e-5 count as 1e-5.
    """
    width = MaterialLobe(brdf).width
    view = np.clip(np.asarray(cosines, dtype=float), GRAZING, 1.0)
    count, most = _NODES
    found = _integrals(brdf, width, view, count)
    open_views = np.arange(len(view))
    while len(open_views) and count < most:
        count *= 2
        finer = _integrals(brdf, width, view[open_views], count)
        change = np.abs(finer - found[open_views])
        found[open_views] = finer
        is_open = (change > _ENOUGH * np.maximum(np.abs(finer), 1)).any(axis=1)
        open_views = open_views[is_open]
    check_finite(found, brdf)
    return found


def _integrals(brdf: Brdf, width: float, view: Array, count: int) -> Array:
    """Compute the integrals with so many nodes, a few views at a time: shape (n, 3)."""
    parts = [
        _integral(brdf, width, view[part, None], count)
        for part in slices(len(view), _SAMPLES_AT_ONCE // count**2)
    ]
    return np.concatenate(parts) if parts else np.empty((0, 3))


def _integral(brdf: Brdf, width: float, view: Array, count: int) -> Array:
    """Compute the integrals for N.V of shape (n, 1), over the half vector: ``dL = 4 V.H dH``."""
    sine = np.sqrt(1 - view**2)
    x, measure, end = half_vectors(width, view, count)
    slope = width * np.sinh(x)
    square = 1 / (1 + slope**2)  # of N.H
    # Here dH = sin(theta_h) dtheta_h dphi, and the light on both sides of the view is alike.
    measure = 2 * measure * width * np.cosh(x) * slope * square * np.sqrt(square) * end
    azimuths, weights = (each[:, None, None] for each in unit_rule(count // 2))
    turn = end * azimuths
    along, across = np.cos(turn) * slope, np.sin(turn) * slope
    facing = along * sine + view  # V.H / N.H
    twice = 2 * square * facing
    light = np.stack([twice * along - sine, twice * across, twice - view], axis=-1)
    views = np.stack([sine, np.zeros_like(sine), view], axis=-1)
    values = brdf.transfer(light, views)
    solid_angles = 4 * measure * facing * np.sqrt(square) * weights
    if values.strides[-1] == 0:
        total = np.einsum("pnx,pnx->n", values[..., 0], solid_angles)
        return np.repeat(total[:, None], 3, axis=1)
    return np.asarray(np.einsum("pnxc,pnx->nc", values, solid_angles))


def albedo_table(brdf: Brdf, size: int) -> Array:
    """Compute the directional albedo of a BRDF for every roughness.

    `size` is the number of rows, over the perceptual roughness, and of columns, over N.V.

    Returns an array of shape (size, size, 3), read-only where the process keeps it for the next map
    of this BRDF.
    """
    return remembered(brdf, ("albedo table", size), lambda: _tabulated(brdf, size))


def _tabulated(brdf: Brdf, size: int) -> Array:
    centers = (np.arange(size) + 0.5) / size
    table = np.empty((size, size, 3))
    last: Brdf | None = None
    for row, roughness in enumerate(centers.tolist()):
        material = brdf.at_roughness(roughness)
        # Below the least roughness of a model all rows are alike.
        is_same = last is not None and last.values == material.values
        table[row] = table[row - 1] if is_same else material_albedo(material, centers)
        last = material
        progress.report(row + 1, size)
    return table


class MaterialAlbedo(ViewTable):
    """The directional albedo of a BRDF, tabulated over N.V for rendering.

    Interpolated values differ from those of `material_albedo` by 1e-4 at most, and by 1e-3 where
    they have kinks, as those of Cook and Torrance's cavities.
    """

    def __init__(self, brdf: Brdf) -> None:
        super().__init__(_DENSE)
        self.brdf = brdf

    def __call__(self, cosines: ArrayLike) -> Array:
        """Interpolate the albedo at N.V of shape (...); the result is of shape (..., 3)."""
        view = np.clip(np.asarray(cosines, dtype=float), GRAZING, 1.0)
        return np.moveaxis(self.interpolated(self._table, view), 0, -1)

    @cached_property
    def _table(self) -> Array:
        return material_albedo(self.brdf, self.nodes).T
