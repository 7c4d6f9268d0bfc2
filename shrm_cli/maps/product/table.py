"""Filling a product texture: the coefficients of all its views, by as few of them as suffice.

Turning light and view of an isotropic BRDF together changes nothing, so the coefficients of one
view are those of another at the same angle from the normal, turned. A BRDF that a mirror leaves as
it is needs the views on one side of the mirror only, and so has one that half a turn leaves as it
is. All texels off the circle of the views are of views on its rim.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.product import ProductFunctions, own_frame
from shrm_cli.sphere.cube import catmull_rom
from shrm_cli.sphere.directions import to_angles
from shrm_cli.sphere.harmonics import degrees_and_orders
from shrm_cli.sphere.parabolic import parabolic_directions, project, unproject
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.sphere.rotation import turn_about_z

_PROBES = 512
"""Pairs of directions at which it is seen whether a BRDF is symmetric."""
_ROUNDING = 1e-5
"""The relative difference, of the largest value, that is none."""
_DIGITS = 9
"""Decimals to which the places of texels are told apart."""
_RING = 512
"""Views around the rim from which texels off the circle are interpolated, where those are more."""


def product_table(brdf: Brdf, functions: ProductFunctions, order: int, size: int) -> Array:
    """Compute the product texture of a BRDF.

    `functions` are its product functions.

    Returns an array of float32 of shape (size, size, (order+1)^2, channels), ``c_i(v)`` for the
    views of `sphere.parabolic.parabolic_directions`; one channel for a grey BRDF, else three.
    """
    views = parabolic_directions(size)
    if brdf.isotropic and brdf.center != "tangent":
        return _turned(functions, views, order)
    x, y = project(views)
    rim = np.hypot(x, y) > 1 - 1 / size - _ROUNDING
    if rim.sum() <= _RING:
        found = _by_symmetry(brdf, functions, views.reshape(-1, 3), order)
        return found.reshape(size, size, *found.shape[1:])
    turn = 2 * np.pi * (np.arange(_RING) + 0.5) / _RING
    radius = 1 - 1 / size
    ring = unproject(radius * np.cos(turn), radius * np.sin(turn))
    inner = views[~rim]
    found = _by_symmetry(brdf, functions, np.concatenate([inner, ring]), order)
    table = np.empty((size, size, *found.shape[1:]), dtype=np.float32)
    table[~rim] = found[: len(inner)]
    table[rim] = _between(found[len(inner) :], np.arctan2(y[rim], x[rim]))
    return table


def _between(ring: Array, azimuths: Array) -> Array:
    """Interpolate values at the middles of even steps of the azimuth, (n, ...), by a cubic."""
    first, weights = catmull_rom(azimuths / (2 * np.pi) * len(ring) - 0.5)
    shares = np.stack(weights)[(..., *(None,) * (ring.ndim - 1))]
    return np.sum([w * ring[(first + k) % len(ring)] for k, w in enumerate(shares)], axis=0)


def _by_symmetry(brdf: Brdf, functions: ProductFunctions, views: Array, order: int) -> Array:
    """Compute the coefficients of views (n, 3) from those on one side of each symmetry.

    Returns an array of float32 of shape (n, (order+1)^2, channels).
    """
    negative = np.signbit(views[:, :2])
    keeps = [_is_kept(brdf, flips) for flips in ((-1, 1), (1, -1))]
    if not any(keeps) and _is_kept(brdf, (-1, -1)):
        negative = negative[:, [1, 1]]  # x and y change their signs together
    else:
        negative = negative & keeps
    folded = views * np.where(np.pad(negative, [(0, 0), (0, 1)]), -1.0, 1.0)
    x, y = (np.round(each, _DIGITS) for each in project(folded))
    _, chosen, which = np.unique(x + 1j * y, return_index=True, return_inverse=True)
    found = functions.coefficients(folded[chosen], order).astype(np.float32)[which]
    _, m = degrees_and_orders(order)
    for axis, is_odd in enumerate(((m < 0) != (m % 2 == 1), m < 0)):
        found[negative[:, axis]] *= np.where(is_odd, -1.0, 1.0)[:, None]
    return found


def _turned(functions: ProductFunctions, views: Array, order: int) -> Array:
    """Compute the table of an isotropic BRDF from views along x alone."""
    size = len(views)
    radius = np.round(np.hypot(*project(views)), _DIGITS)
    radii, which = np.unique(radius, return_inverse=True)
    along_x = functions.coefficients(unproject(radii, np.zeros_like(radii)), order)
    flat = np.moveaxis(along_x[which.reshape(-1)], 0, -1)
    turned = turn_about_z(flat, to_angles(views)[1].reshape(-1))
    table = np.moveaxis(turned, -1, 0).reshape(size, size, *along_x.shape[1:])
    return np.ascontiguousarray(table, dtype=np.float32)


def _is_kept(brdf: Brdf, signs: tuple[int, int]) -> bool:
    """Whether a BRDF stays as it is where x and y of light and view take factors of -1 or 1."""
    light = spiral_directions(_PROBES)
    light[:, 2] = np.abs(light[:, 2])
    view = np.roll(light, _PROBES // 3, axis=0)  # neighbours would all be near each other
    flips = np.array([*signs, 1.0])
    here = brdf.transfer(own_frame(brdf, light), own_frame(brdf, view))
    there = brdf.transfer(own_frame(brdf, light * flips), own_frame(brdf, view * flips))
    return bool(np.abs(here - there).max() <= _ROUNDING * np.abs(here).max())
