"""Pictures of a sphere of a map's material, and of the surroundings behind it."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.files.image import Picture
from shrm_cli.progress import Progress, tell
from shrm_cli.render import camera

Indices = NDArray[np.integer]

_PIXELS_AT_ONCE = 2**19
"""The most pixels that are drawn at a time."""

_RINGS = ((2.0, 4),)
"""How wide rings inside the silhouette are, pixels, and how many samples their pixels have along an
edge; other pixels have one. The page of `shrm view` draws its spheres by the same rule."""

_INSIDE = 1 / 16
"""Samples off the sphere are moved this many pixels inside the silhouette, because BRDFs have no
value on the silhouette itself, where N.V = 0."""


class Reflecting(Protocol):
    """The part of a map that `render_sphere` needs."""

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Return reflected radiance (..., 3) for unit vectors (..., 3) in world axes."""


class Surroundings(Protocol):
    """The part of a probe that `render_background` needs."""

    def radiance(self, directions: ArrayLike) -> Array:
        """Return radiance (..., 3) from unit directions (..., 3) in world axes."""


def render_sphere(
    reflecting: Reflecting,
    viewer: camera.Viewer,
    size: int,
    background: Picture | None = None,
    progress: Progress | None = None,
) -> Picture:
    """Draw a sphere as a distant viewer sees it.

    `background`, of shape (size, size, 3), is the linear picture behind the sphere, such
    as `render_background` makes. By default it is black, so that silhouette pixels are
    premultiplied by their coverage.

    Returns an array of float32 of shape (size, size, 3): scene-linear. The small negative values of
    a truncated expansion are kept.
    """
    picture = np.zeros((size, size, 3), dtype=np.float32)
    if background is not None:
        picture[:] = background
    for rows in slices(size, _PIXELS_AT_ONCE // size):
        _draw_rows(reflecting, viewer, picture, rows.start, rows.stop)
        tell(progress, rows.stop, size)
    return picture


def render_background(surroundings: Surroundings, viewer: camera.Viewer, size: int) -> Picture:
    """Draw the surroundings behind the sphere; see `background_directions`.

    Returns an array of float32 of shape (size, size, 3): scene-linear.
    """
    picture = np.empty((size, size, 3), dtype=np.float32)
    for rows in slices(size, _PIXELS_AT_ONCE // size):
        directions = camera.background_directions(viewer, size, rows.start, rows.stop)
        picture[rows] = surroundings.radiance(directions)
    return picture


def _draw_rows(
    reflecting: Reflecting, viewer: camera.Viewer, picture: Picture, start: int, stop: int
) -> None:
    """Blend the sphere over the rows `start` .. `stop` - 1 of a picture, by its coverage."""
    size = len(picture)
    radius = camera.sphere_radius(size)
    x, y = camera.pixel_centers(size, start, stop)
    coverage = camera.sphere_coverage(size, x, y)
    covered = coverage > 0
    if not covered.any():
        return
    coverage, x, y = coverage[covered], x[covered] / radius, y[covered] / radius
    pixels, sub_x, sub_y, weights = _samples(x, y, radius)
    # All samples go into one call, because a map contracts its coefficients with the view at
    # every call.
    normals = camera.sphere_normals(viewer, sub_x, sub_y)
    values = reflecting.radiance(normals, viewer.direction) * weights[:, None]
    sphere = np.stack([np.bincount(pixels, values[:, c], len(x)) for c in range(3)], axis=-1)
    rows = picture[start:stop]  # a view, so that the picture itself changes
    alpha = coverage[:, None]
    rows[covered] = alpha * sphere + (1 - alpha) * rows[covered]


def _samples(x: Array, y: Array, radius: float) -> tuple[Indices, Array, Array, Array]:
    """Place samples in pixels: more near the silhouette, where a pixel spans many reflections.

    `x` and `y`, each of shape (n,), are pixel centres, in radii. `radius` is the radius of the
    sphere in pixels.

    Returns the `pixels` of samples, in 0 .. n-1, and `x`, `y` and `weights` of each, shape (m,).
    Samples on the sphere have equal weights, which sum to 1 in each pixel. Those off it count only
    if the sphere covers a part of the pixel but none of its samples: they are moved just inside the
    silhouette.
    """
    inside = (1 - np.hypot(x, y)) * radius
    counts = np.ones(len(x), dtype=int)
    for width, count in reversed(_RINGS):
        counts[inside < width] = count
    parts = []
    for count in np.unique(counts):
        own = np.flatnonzero(counts == count)
        offsets = ((np.arange(count) + 0.5) / count - 0.5) / radius
        down, right = (grid.ravel() for grid in np.meshgrid(offsets, offsets, indexing="ij"))
        sub_x, sub_y = x[own, None] + right, y[own, None] + down
        distance = np.hypot(sub_x, sub_y)
        is_on = distance <= 1
        counted = is_on | ~is_on.any(axis=-1, keepdims=True)
        inwards = np.where(is_on, 1.0, (1 - _INSIDE / radius) / np.maximum(distance, 1))
        shares = counted / counted.sum(axis=-1, keepdims=True)
        pixels = np.broadcast_to(own[:, None], counted.shape)
        found = pixels, sub_x * inwards, sub_y * inwards, shares
        parts.append([each[counted] for each in found])
    pixels, across, up, shares = (np.concatenate(each) for each in zip(*parts, strict=True))
    return pixels, across, up, shares
