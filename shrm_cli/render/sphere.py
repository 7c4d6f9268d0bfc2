"""Pictures of a sphere of a map's material, and of the surroundings behind it."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, slices
from shrm_cli.files.image import Picture
from shrm_cli.progress import Progress, tell
from shrm_cli.render import camera

_PIXELS_AT_ONCE = 2**19
"""The most pixels that are drawn at a time."""

_SAMPLES = 4
"""Samples along the edge of a pixel on the rim; other pixels have one sample."""

_RIM = 2.0
"""Width of the rim inside the silhouette, pixels."""

_INSIDE = 0.25 / _SAMPLES
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
    rim = np.hypot(x, y) > 1 - _RIM / radius
    # All samples go into one call, because a map contracts its coefficients with the view at
    # every call.
    sub_x, sub_y, weights = _rim_samples(x[rim], y[rim], radius)
    counted = weights > 0
    normals = camera.sphere_normals(
        viewer,
        np.concatenate([x[~rim], sub_x[counted]]),
        np.concatenate([y[~rim], sub_y[counted]]),
    )
    values = reflecting.radiance(normals, viewer.direction)
    inside = np.count_nonzero(~rim)
    samples = np.zeros((*sub_x.shape, 3))
    samples[counted] = values[inside:]
    sphere = np.empty((len(x), 3))
    sphere[~rim] = values[:inside]
    sphere[rim] = np.einsum("nk,nkc->nc", weights, samples)
    rows = picture[start:stop]  # a view, so that the picture itself changes
    alpha = coverage[:, None]
    rows[covered] = alpha * sphere + (1 - alpha) * rows[covered]


def _rim_samples(x: Array, y: Array, radius: float) -> tuple[Array, Array, Array]:
    """Place samples in pixels near the silhouette, where one pixel spans many reflections.

    `x` and `y`, each of shape (n,), are pixel centres, in radii. `radius` is the radius of the
    sphere in pixels.

    Returns `x`, `y` and `weights`, each of shape (n, k). Samples on the sphere have equal weights,
    which sum to 1. Samples off it are moved just inside the silhouette, and count only if the
    sphere covers a part of the pixel but none of its samples.
    """
    offsets = ((np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5) / radius
    down, right = (grid.ravel() for grid in np.meshgrid(offsets, offsets, indexing="ij"))
    x, y = x[:, None] + right, y[:, None] + down
    distance = np.hypot(x, y)
    is_on = distance <= 1
    weights = is_on | ~is_on.any(axis=-1, keepdims=True)
    inwards = np.where(is_on, 1.0, (1 - _INSIDE / radius) / distance)
    return x * inwards, y * inwards, weights / weights.sum(axis=-1, keepdims=True)
