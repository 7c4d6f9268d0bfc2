"""Filling a product texture: the coefficients of all its views, by as few of them as suffice.

Turning light and view of an isotropic BRDF together changes nothing, so the coefficients of one view
are those of another at the same angle from the normal, turned. A BRDF that a mirror leaves as it is
needs the views on one side of the mirror only.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.product import ProductFunctions, own_frame
from shrm_cli.progress import Progress
from shrm_cli.sphere.directions import to_angles
from shrm_cli.sphere.harmonics import degrees
from shrm_cli.sphere.parabolic import parabolic_directions, project, unproject
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.sphere.rotation import turn_about_z

Array = NDArray[np.floating]

_PROBES = 512
"""Pairs of directions at which it is seen whether a BRDF is symmetric."""
_ROUNDING = 1e-5
"""The relative difference, of the largest value, that is none."""
_RADIUS_DIGITS = 9
"""Decimals to which the radii of texels are told apart."""


def product_table(
    brdf: Brdf, functions: ProductFunctions, order: int, size: int, progress: Progress | None = None
) -> Array:
    """Compute the product texture of a BRDF.

    Parameters
    ----------
    brdf : Brdf
    functions : ProductFunctions
        Its product functions.
    order : int
        The largest degree l of the harmonics.
    size : int
        Texels along an edge.
    progress : callable, optional
        Called with the work done and the work in all.

    Returns
    -------
    ndarray of float32, shape (size, size, (order+1)^2, channels)
        ``c_i(v)`` for the views of `sphere.parabolic.parabolic_directions`; one channel for a
        grey BRDF, else three.

    Raises
    ------
    BrdfError
        If the BRDF is not finite.
    """
    views = parabolic_directions(size)
    if brdf.isotropic and brdf.center != "tangent":
        return _turned(functions, views, order, progress)
    half = size // 2
    # The rows and columns of the sides that are mirrored into the others begin at the middle.
    rows = half if _is_mirrored(brdf, 1) else 0
    columns = half if _is_mirrored(brdf, 0) else 0
    some = views[rows:, columns:]
    found = functions.coefficients(some.reshape(-1, 3), order, progress)
    table = np.empty((size, size, *found.shape[1:]), dtype=np.float32)
    table[rows:, columns:] = found.reshape(*some.shape[:2], *found.shape[1:])
    if columns:
        mirrored = table[rows:, size - half :][:, ::-1]
        table[rows:, :half] = mirrored * _mirror_signs(order, 0)[:, None]
    if rows:
        table[:half] = table[size - half :][::-1] * _mirror_signs(order, 1)[:, None]
    return table


def _turned(
    functions: ProductFunctions, views: Array, order: int, progress: Progress | None
) -> Array:
    """Compute the table of an isotropic BRDF from views along x alone."""
    size = len(views)
    radius = np.round(np.hypot(*project(views)), _RADIUS_DIGITS)
    radii, which = np.unique(radius, return_inverse=True)
    along_x = functions.coefficients(unproject(radii, np.zeros_like(radii)), order, progress)
    flat = np.moveaxis(along_x[which.reshape(-1)], 0, -1)
    turned = turn_about_z(flat, to_angles(views)[1].reshape(-1))
    table = np.moveaxis(turned, -1, 0).reshape(size, size, *along_x.shape[1:])
    return np.ascontiguousarray(table, dtype=np.float32)


def _is_mirrored(brdf: Brdf, axis: int) -> bool:
    """Whether a BRDF stays as it is where light and view are mirrored along x (0) or y (1)."""
    light = spiral_directions(_PROBES)
    light[:, 2] = np.abs(light[:, 2])
    view = np.roll(light, _PROBES // 3, axis=0)  # neighbours would all be near each other
    mirror = np.ones(3)
    mirror[axis] = -1
    here = brdf.transfer(own_frame(brdf, light), own_frame(brdf, view))
    there = brdf.transfer(own_frame(brdf, light * mirror), own_frame(brdf, view * mirror))
    return bool(np.abs(here - there).max() <= _ROUNDING * np.abs(here).max())


def _mirror_signs(order: int, axis: int) -> Array:
    """The sign that each harmonic takes where x (0) or y (1) changes its own."""
    degree = degrees(order)
    m = np.arange(len(degree)) - degree * (degree + 1)
    is_sine = m < 0
    odd = is_sine if axis == 1 else (np.abs(m) % 2 == 1) != is_sine
    return np.where(odd, -1.0, 1.0)
