"""What any BRDF reflects of a white, uniform environment: its directional albedo."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli import progress
from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import remembered
from shrm_cli.brdf.environment.lobe import MaterialLobe
from shrm_cli.brdf.environment.views import ViewTable, half_vectors, unit_rule
from shrm_cli.brdf.vectors import GRAZING

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

    Raises BrdfError if the BRDF is one that `MaterialLobe` refuses.
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

    `size` is the number of rows, over the perceptual roughness, and of columns, over N.V. Both are
    sampled at texel centers, ``(k + 0.5) / size``. The first row is the smoothest.

    Returns an array of shape (size, size, 3), read-only where the process keeps it for the next map
    of this BRDF.

    Raises BrdfError if the BRDF has no roughness, or is one that `MaterialLobe` refuses.
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
