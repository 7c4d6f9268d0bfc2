"""Finding the lowest values of spherical harmonic series over the whole sphere."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.harmonics import by_degree, order_of, real_harmonics
from shrm_cli.sphere.synthesis import synthesize_cube

_SAMPLES_AN_ORDER = 8
"""Texels along a face's edge of the searched cube, for each degree of the series. With 4, narrow
valleys would lie between the texels."""
_LEAST_SIZE = 16
"""The fewest texels along a face's edge of the searched cube."""
_MOST_SIZE = 1024
"""The most texels along a face's edge of the searched cube."""
_MOST_STARTS = 512
"""The most texels from which a series is followed downhill by one step."""
_START_VALUES = 2**20
"""The most values of harmonics at all these texels together, which means fewer at high orders."""
_MOST_FOLLOWED = 16
"""The most places, the lowest after the first step, that are followed to the end."""
_STEPS = 6
"""The number of steps of Newton's method."""
_FINER = 4
"""Each step of Newton's method is finer than the one before by this factor."""
_BLOCK_VALUES = 2**22
"""The most values of harmonics that are in memory at a time."""


def series_values(series: Array, directions: Array) -> Array:
    """Evaluate real series in some directions, shape (n, maps).

    Each column of `series`, of shape ((order+1)^2, maps), is a series, index l(l+1)+m.
    `directions`, of shape (n, 3), are unit directions, in the axes of the series.
    """
    order = order_of(len(series))
    result = np.empty((len(directions), series.shape[1]))
    for part in slices(len(directions), _BLOCK_VALUES // len(series)):
        result[part] = real_harmonics(order, directions[part]) @ series
    return result


def degree_values(series: Array, directions: Array) -> Array:
    """Evaluate each degree of real series in some directions, as `series_values` takes them.

    Returns an array of shape (n, order+1, maps): what each degree adds to the values of
    `series_values`.
    """
    order = order_of(len(series))
    result = np.empty((len(directions), order + 1, series.shape[1]))
    for part in slices(len(directions), _BLOCK_VALUES // series.size):
        terms = real_harmonics(order, directions[part])[..., None] * series
        result[part] = by_degree(terms, axis=1)
    return result


def lowest(series: Array) -> tuple[Array, Array]:
    """Find where each of several real series is lowest on the sphere.

    The series is computed at the texels of a cube that is dense for its order. Bernstein's
    inequality limits how far the texel nearest to the minimum is above it: on every great circle a
    series of order F is a trigonometric polynomial, so its second derivative is at most F^2 times
    half of its range. Texels within this limit that are lower than most around them are followed
    downhill. All of them take one step, because many minima may be nearly as low. The lowest places
    after this step are followed to the end.

    Each column of `series`, of shape ((order+1)^2, maps), is a series, index l(l+1)+m.

    Returns `directions` of shape (maps, 3), unit directions of the minima; and `values` of shape
    (maps,), the minima.
    """
    order, size = order_of(len(series)), _dense_size(series)
    texels = cube_directions(size).reshape(-1, 3)
    farthest = np.sqrt(2.0) / size  # a direction is no farther from the nearest texel than this
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
    """Find some directions where series are too low, and lower than most around them.

    Each column of `series`, of shape ((order+1)^2, maps), is a series, index l(l+1)+m. `limits`, of
    shape (maps,), are the value below which each series is too low. `most` is the most directions
    that are taken for each series, evenly from the lowest to the highest.

    Returns an array of shape (n, 3): unit directions of texels of a cube.
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
    """Choose the texels along an edge of a cube that shows every valley of a series."""
    order = order_of(len(series))
    return min(max(_SAMPLES_AN_ORDER * (order + 1), _LEAST_SIZE), _MOST_SIZE)


def _are_dips(plane: Array) -> NDArray[np.bool_]:
    """Tell which texels of a cube, (6N, N), have no more than two lower neighbors on their face.

    Two are allowed, because every texel along a narrow valley that runs askew has one or two.
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

    Each step of Newton's method evaluates a square of nine directions around the present one. It
    goes to the lowest point of the quadratic that fits their values, or to the lowest of the nine
    if that is lower. It stays where it is if nothing is lower.
    """
    u, v = (grid.ravel() for grid in np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]))
    fit = np.linalg.pinv(np.stack([np.ones(9), u, v, u * u / 2, u * v, v * v / 2], axis=1))
    at, value = starts, series_values(series, starts)[:, 0]
    for _ in range(steps):
        helper = np.eye(3)[np.argmin(np.abs(at), axis=-1)]
        right = normalize(np.cross(helper, at))
        up = np.cross(at, right)
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
    """Compute Newton's step, shape (n, 2), from slopes and second derivatives of quadratics.

    The step is taken along each axis of curvature. The sign of the curvature is left out, so that
    the step leads down from saddles as well. The length of the step is limited: where a valley is
    flat along an axis, the slope along it is rounding and must not lead far.
    """
    curvature = np.stack([np.stack([uu, uv], axis=-1), np.stack([uv, vv], axis=-1)], axis=-2)
    strengths, axes = np.linalg.eigh(curvature)
    slopes = np.einsum("nij,ni->nj", axes, np.stack([gu, gv], axis=-1))
    strengths = np.abs(strengths)
    strengths = np.maximum(strengths, 1e-3 * strengths.max(axis=1, keepdims=True))
    along = np.clip(slopes / np.where(strengths > 0, strengths, np.inf), -1.5, 1.5)
    return -np.einsum("nij,nj->ni", axes, along)


def _move(at: Array, right: Array, up: Array, u: Array, v: Array) -> Array:
    """Return unit directions beside `at`, `u` to the right and `v` up on the tangent plane."""
    return normalize(at + u[..., None] * right + v[..., None] * up)
