"""The lowest values of harmonic series over the whole sphere."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.harmonics import order_of, real_harmonics
from shrm_cli.sphere.synthesis import synthesize_cube

Array = NDArray[np.floating]

_SAMPLES_AN_ORDER = 8
"""Texels along a face's edge for each degree; with 4, narrow valleys lie between the texels."""
_LEAST_SIZE = 16
_MOST_SIZE = 1024
"""The range of the texels along a face's edge."""
_MOST_STARTS = 512
_START_VALUES = 2**20
"""The most texels that are followed by one step, and values of harmonics at all of them."""
_MOST_FOLLOWED = 16
"""The lowest of them, which are followed to the end."""
_STEPS = 6
_FINER = 4
"""Steps of Newton's method, and by how much each is finer than the one before."""
_BLOCK_VALUES = 2**22
"""Values of harmonics that are in memory at a time."""


def series_values(series: Array, directions: Array) -> Array:
    """Values of real series in some directions.

    Parameters
    ----------
    series : ndarray, shape ((order+1)^2, maps)
        One series a column, index l(l+1)+m.
    directions : ndarray, shape (n, 3)
        Unit directions, in the axes of the series.

    Returns
    -------
    ndarray, shape (n, maps)
    """
    order = order_of(len(series))
    step = max(1, _BLOCK_VALUES // len(series))
    result = np.empty((len(directions), series.shape[1]))
    for start in range(0, len(directions), step):
        part = slice(start, start + step)
        result[part] = real_harmonics(order, directions[part]) @ series
    return result


def degree_values(series: Array, directions: Array) -> Array:
    """What each degree adds to the values of real series.

    Parameters
    ----------
    series, directions
        As `series_values` takes them.

    Returns
    -------
    ndarray, shape (n, order+1, maps)
    """
    order = order_of(len(series))
    starts = np.arange(order + 1) ** 2
    step = max(1, _BLOCK_VALUES // series.size)
    result = np.empty((len(directions), order + 1, series.shape[1]))
    for start in range(0, len(directions), step):
        part = slice(start, start + step)
        terms = real_harmonics(order, directions[part])[..., None] * series
        result[part] = np.add.reduceat(terms, starts, axis=1)
    return result


def lowest(series: Array) -> tuple[Array, Array]:
    """Where each of several real series is lowest on the sphere.

    On a cube of texels that are dense for the order, the texel nearest to the minimum is above
    it by no more than Bernstein's inequality says: on every great circle a series of order F is
    a trigonometric polynomial, so its second derivative is at most F^2 times the half of its
    range. Each texel that is so low, and lower than most around it, is followed downhill: all of
    them by one step, and those that are lowest then to the end, since many minima may be nearly as
    low.

    Parameters
    ----------
    series : ndarray, shape ((order+1)^2, maps)
        One series a column, index l(l+1)+m.

    Returns
    -------
    directions : ndarray, shape (maps, 3)
        Unit directions of the minima.
    values : ndarray, shape (maps,)
        The minima.
    """
    order, size = order_of(len(series)), _dense_size(series)
    texels = cube_directions(size).reshape(-1, 3)
    farthest = np.sqrt(2.0) / size  # from a direction to the nearest texel, at a face's center
    most = max(min(_MOST_STARTS, _START_VALUES // len(series)), _MOST_FOLLOWED)
    directions, values = np.empty((series.shape[1], 3)), np.empty(series.shape[1])
    for k, plane in enumerate(synthesize_cube(series, size)):
        half_range = float(plane.max() - plane.min()) / 2
        limit = plane.min() + (farthest * order) ** 2 / 2 * half_range
        starts = np.flatnonzero(_are_dips(plane) & (plane <= limit))
        starts = starts[np.argsort(plane.ravel()[starts], kind="stable")[:most]]
        one = series[:, k : k + 1]
        near, reached = _descend(one, texels[starts], 2 / size, 1)
        near = near[np.argsort(reached, kind="stable")[:_MOST_FOLLOWED]]
        found, reached = _descend(one, near, 2 / size / _FINER, _STEPS - 1)
        best = int(np.argmin(reached))
        directions[k], values[k] = found[best], reached[best]
    return directions, values


def low_places(series: Array, limits: Array, most: int) -> Array:
    """Directions of some of the texels that are too low, and lower than most around them.

    Parameters
    ----------
    series : ndarray, shape ((order+1)^2, maps)
        One series a column, index l(l+1)+m.
    limits : ndarray, shape (maps,)
        The values below which each series is too low.
    most : int
        How many texels of each series are taken, from the lowest to the highest of them.

    Returns
    -------
    ndarray, shape (n, 3)
    """
    size = _dense_size(series)
    places: list[NDArray[np.intp]] = []
    for plane, limit in zip(synthesize_cube(series, size), limits, strict=True):
        found = np.flatnonzero(_are_dips(plane) & (plane < limit))
        found = found[np.argsort(plane.ravel()[found], kind="stable")]
        chosen = np.linspace(0, len(found) - 1, min(most, len(found))).astype(int)
        places.append(found[chosen])
    return cube_directions(size).reshape(-1, 3)[np.unique(np.concatenate(places))]


def _dense_size(series: Array) -> int:
    """Texels along an edge of a cube that shows all that a series does."""
    order = order_of(len(series))
    return min(max(_SAMPLES_AN_ORDER * (order + 1), _LEAST_SIZE), _MOST_SIZE)


def _are_dips(plane: Array) -> NDArray[np.bool_]:
    """Which texels of a cube, (6N, N), have no more than two lower neighbors on their face.

    Two are allowed, since along a narrow valley that runs askew every texel has one or two.
    """
    size = plane.shape[1]
    faces = plane.reshape(6, size, size)
    framed = np.pad(faces, ((0, 0), (1, 1), (1, 1)), constant_values=np.inf)
    lower = np.zeros(faces.shape, dtype=np.int8)
    for row in range(3):
        for column in range(3):
            lower += framed[:, row : row + size, column : column + size] < faces
    return (lower <= 2).reshape(plane.shape)


def _descend(series: Array, starts: Array, step: float, steps: int) -> tuple[Array, Array]:
    """Follow a series, shape ((order+1)^2, 1), downhill from each of (n, 3) directions.

    Each step of Newton's method takes a square of nine directions around each one. It goes to the
    lowest point of the quadratic through their values, or to the lowest of the nine if that is
    lower, and stays where it is if nothing is lower.
    """
    u, v = (grid.ravel() for grid in np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]))
    fit = np.linalg.pinv(np.stack([np.ones(9), u, v, u * u / 2, u * v, v * v / 2], axis=1))
    at, value = starts, series_values(series, starts)[:, 0]
    for _ in range(steps):
        right, up = _tangents(at)
        square = _move(at[:, None], right[:, None], up[:, None], step * u, step * v)
        values = series_values(series, square.reshape(-1, 3)).reshape(-1, 9)
        target = _downhill(*(fit @ values.T)[1:])
        aimed = _move(at, right, up, step * target[:, 0], step * target[:, 1])
        tried = np.concatenate([square, aimed[:, None]], axis=1)
        values = np.concatenate([values, series_values(series, aimed)], axis=1)
        best = np.argmin(values, axis=1)
        lower = np.take_along_axis(values, best[:, None], axis=1)[:, 0]
        chosen = np.take_along_axis(tried, best[:, None, None], axis=1)[:, 0]
        at = np.where((lower < value)[:, None], chosen, at)
        value = np.minimum(value, lower)
        step /= _FINER
    return at, value


def _downhill(gu: Array, gv: Array, uu: Array, uv: Array, vv: Array) -> Array:
    """Newton's step from the slopes and second derivatives of quadratics, shape (n, 2).

    The step is taken along each axis of curvature, whose sign is left out, so that it leads down
    from saddles as well. Where a valley is flat along an axis, the slope along it is rounding, and
    moves nothing far.
    """
    curvature = np.stack([np.stack([uu, uv], axis=-1), np.stack([uv, vv], axis=-1)], axis=-2)
    strengths, axes = np.linalg.eigh(curvature)
    slopes = np.einsum("nij,ni->nj", axes, np.stack([gu, gv], axis=-1))
    strengths = np.abs(strengths)
    strengths = np.maximum(strengths, 1e-3 * strengths.max(axis=1, keepdims=True))
    along = np.clip(slopes / np.where(strengths > 0, strengths, np.inf), -1.5, 1.5)
    return -np.einsum("nij,nj->ni", axes, along)


def _tangents(directions: Array) -> tuple[Array, Array]:
    """Two unit vectors that are at right angles to each of (n, 3) directions and to each other."""
    helper = np.eye(3)[np.argmin(np.abs(directions), axis=-1)]
    right = np.cross(helper, directions)
    right /= np.linalg.norm(right, axis=-1, keepdims=True)
    return right, np.cross(directions, right)


def _move(at: Array, right: Array, up: Array, u: Array, v: Array) -> Array:
    """Unit directions beside `at`, by `u` to the right and `v` up on the tangent plane."""
    moved = at + u[..., None] * right + v[..., None] * up
    return moved / np.linalg.norm(moved, axis=-1, keepdims=True)
