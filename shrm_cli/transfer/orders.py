"""How many degrees of the light a mesh has to be baked for.

What a vertex that sees most of the sky takes of the light is smooth. Where light comes in by a
window alone, the window's edges are in the transfer vectors. What a light loses beyond an order
depends on the light, which is not known here: coefficients that fall as ``1 / (l+1)`` are those of
a sunrise without its sun, and fall less than those of six of nine real probes without their lamps.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.geometry.rays import Rays
from shrm_cli.sphere.directions import horizontal_tangents, surface_frames
from shrm_cli.sphere.harmonics import degrees
from shrm_cli.transfer.gather import Gathering, Sites

ORDERS = 4, 6, 8, 10, 12, 16
"""The orders that are tried."""
MISSED = 0.025
"""The relative RMS error of the irradiance of such a light that an order may make."""
_SITES, _SAMPLES = 256, 1024
"""The sites that stand for all, at least, and their rays."""
_AT_ONCE = 32


def sufficient_order(sites: Sites, rays: Rays) -> int:
    """Return the least of some orders that the irradiance of a mesh's sites needs.

    `rays` meet the same mesh.
    """
    missed = missed_by_order(sites, rays)
    return next((order for order in ORDERS if missed[order] <= MISSED), ORDERS[-1])


def missed_by_order(sites: Sites, rays: Rays) -> Array:
    """Return the relative RMS error that each order up to the last one makes, shape (order+1,)."""
    last, count = ORDERS[-1], len(sites.positions)
    frames = surface_frames(sites.normals, horizontal_tangents(sites.normals))
    gathering = Gathering(sites, frames, rays, last, _SAMPLES)
    step = max(count // _SITES, 1)
    energy = np.zeros((last + 1) ** 2)
    for start in range(0, count, step * _AT_ONCE):
        part = slice(start, min(start + step * _AT_ONCE, count), step)
        energy += (gathering.transfer(part)[0][..., 0] ** 2).sum(axis=0)
    lit = energy / (degrees(last) + 1) ** 2
    by_degree = np.add.reduceat(lit, np.arange(last + 1) ** 2)
    beyond = np.append(np.cumsum(by_degree[::-1])[-2::-1], 0.0)
    return np.sqrt(beyond / max(by_degree.sum(), 1e-300))
