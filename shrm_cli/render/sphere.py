"""A sphere of the map's material, and the surroundings behind it."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.render.camera import (
    Viewer,
    background_directions,
    pixel_centers,
    sphere_coverage,
    sphere_normals,
    sphere_radius,
)

Array = NDArray[np.floating]
Picture = NDArray[np.float32]

_PIXELS_AT_ONCE = 2**19
_SAMPLES = 4  # a pixel's edge; on the rim only
_RIM = 2.0  # pixels inside the silhouette
_INSIDE = 0.25 / _SAMPLES  # pixels; on the silhouette itself, N.V = 0, BRDFs have no value
_ALMOST_NOTHING = 1e-6


class ReflectionMap(Protocol):
    """What is asked of a map."""

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Reflected radiance, shape (..., 3), for unit world vectors of shape (..., 3)."""


class Surroundings(Protocol):
    """What is asked of a probe."""

    def radiance(self, directions: ArrayLike) -> Array:
        """Radiance, shape (..., 3), from unit world directions of shape (..., 3)."""


def render_sphere(
    reflection_map: ReflectionMap,
    viewer: Viewer,
    size: int,
    background: Picture | None = None,
    progress: Callable[[int], object] | None = None,
) -> Picture:
    """Picture of a sphere seen by a distant viewer.

    Parameters
    ----------
    reflection_map : ReflectionMap
    viewer : Viewer
    size : int
        Width and height in pixels.
    background : ndarray, shape (size, size, 3), optional
        Linear picture behind the sphere, such as `render_background` makes. Without it there is
        black, so that silhouette pixels are premultiplied by their coverage.
    progress : callable, optional
        Called with the number of rows after each batch of rows.

    Returns
    -------
    ndarray of float32, shape (size, size, 3)
        Scene-linear. The small negative values of a truncated expansion are kept.
    """
    picture = np.zeros((size, size, 3), dtype=np.float32)
    if background is not None:
        picture[:] = background
    rows = max(_PIXELS_AT_ONCE // size, 1)
    for start in range(0, size, rows):
        stop = min(start + rows, size)
        _draw_rows(reflection_map, viewer, picture, start, stop)
        if progress is not None:
            progress(stop - start)
    return picture


def render_background(surroundings: Surroundings, viewer: Viewer, size: int) -> Picture:
    """Picture of the surroundings behind the sphere; see `background_directions`.

    Returns
    -------
    ndarray of float32, shape (size, size, 3)
        Scene-linear.
    """
    picture = np.empty((size, size, 3), dtype=np.float32)
    rows = max(_PIXELS_AT_ONCE // size, 1)
    for start in range(0, size, rows):
        stop = min(start + rows, size)
        directions = background_directions(viewer, size, start, stop)
        picture[start:stop] = surroundings.radiance(directions)
    return picture


def _draw_rows(
    reflection_map: ReflectionMap, viewer: Viewer, picture: Picture, start: int, stop: int
) -> None:
    """Blend the sphere over the rows `start` .. `stop` - 1 of a picture, by its coverage."""
    size = len(picture)
    radius = sphere_radius(size)
    x, y = pixel_centers(size, start, stop)
    coverage = sphere_coverage(size, x, y)
    covered = coverage > 0
    if not covered.any():
        return
    coverage, x, y = coverage[covered], x[covered] / radius, y[covered] / radius
    rim = np.hypot(x, y) > 1 - _RIM / radius
    # One call for all: a map contracts its coefficients with the view at every call.
    sub_x, sub_y, weights = _rim_samples(x[rim], y[rim], radius)
    normals = sphere_normals(
        viewer, np.concatenate([x[~rim], sub_x.ravel()]), np.concatenate([y[~rim], sub_y.ravel()])
    )
    values = reflection_map.radiance(normals, viewer.direction)
    inside = len(values) - sub_x.size
    sphere = np.empty((len(x), 3))
    sphere[~rim] = values[:inside]
    sphere[rim] = np.einsum("nk,nkc->nc", weights, values[inside:].reshape(*sub_x.shape, 3))
    rows = picture[start:stop]  # a view
    alpha = coverage[:, None]
    rows[covered] = alpha * sphere + (1 - alpha) * rows[covered]


def _rim_samples(x: Array, y: Array, radius: float) -> tuple[Array, Array, Array]:
    """Samples within pixels near the silhouette, where one pixel spans many reflections.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Pixel centres, in radii.
    radius : float
        In pixels.

    Returns
    -------
    x, y, weights : ndarray, shape (n, k)
        The weights of the samples on the sphere are equal, those of samples off it almost
        nothing: they count where the sphere covers a pixel but none of its samples, and lie
        just inside the silhouette. Rows sum to 1.
    """
    offsets = ((np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5) / radius
    down, right = (grid.ravel() for grid in np.meshgrid(offsets, offsets, indexing="ij"))
    x, y = x[:, None] + right, y[:, None] + down
    distance = np.hypot(x, y)
    weights = np.where(distance <= 1, 1.0, _ALMOST_NOTHING)
    inwards = np.where(distance <= 1, 1.0, (1 - _INSIDE / radius) / distance)
    return x * inwards, y * inwards, weights / weights.sum(axis=-1, keepdims=True)
