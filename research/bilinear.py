"""Bilinear look-ups in a cube as a GPU with seamless cube maps makes them, without the package."""

import numpy as np

AXES = np.array(
    [  # forward, right, down of the faces in OpenEXR's order and orientation
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[-1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[0, 1, 0], [1, 0, 0], [0, 0, -1]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        [[0, 0, 1], [-1, 0, 0], [0, -1, 0]],
        [[0, 0, -1], [1, 0, 0], [0, -1, 0]],
    ],
    dtype=float,
)


def corners(directions, size, sampling="center"):
    """Face, row and column of the four texels around directions, (n, 4, 3), and weights (n, 4).

    Where a texel lies beyond the edge, it is the one of the neighbouring face that is nearest to
    the place where the face's own grid would go on.
    """
    forward = directions @ AXES[:, 0].T
    face = forward.argmax(axis=1)
    along = np.einsum("nk,njk->nj", directions, AXES[face]) / forward.max(axis=1)[:, None]
    scale, shift = ((size - 1) / 2, 0.0) if sampling == "border" else (size / 2, 0.5)
    x, y = ((along[:, k] + 1) * scale - shift for k in (1, 2))
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = x - column, y - row
    texels, weights = [], []
    for i, wy in ((0, 1 - fy), (1, fy)):
        for j, wx in ((0, 1 - fx), (1, fx)):
            texels.append(_on_cube(face, row + i, column + j, size, scale, shift))
            weights.append(wx * wy)
    return np.stack(texels, axis=1), np.stack(weights, axis=1)


def _on_cube(face, row, column, size, scale, shift):
    outside = (row < 0) | (row >= size) | (column < 0) | (column >= size)
    s, t = (column + shift) / scale - 1, (row + shift) / scale - 1
    axes = AXES[face]
    point = axes[:, 0] + s[:, None] * axes[:, 1] + t[:, None] * axes[:, 2]
    other = np.where(outside, (point @ AXES[:, 0].T).argmax(axis=1), face)
    along = np.einsum("nk,njk->nj", point, AXES[other])
    along = along / along[:, :1]
    x, y = ((along[:, k] + 1) * scale - shift for k in (1, 2))
    clip = lambda value: np.clip(np.rint(value).astype(int), 0, size - 1)  # noqa: E731
    return np.stack(
        [other, np.where(outside, clip(y), row), np.where(outside, clip(x), column)], axis=1
    )


def centers(size, sampling="center"):
    """Unit directions of all texels, shape (6, size, size, 3)."""
    s = np.linspace(-1, 1, size) if sampling == "border" else (np.arange(size) + 0.5) * 2 / size - 1
    t, s = np.meshgrid(s, s, indexing="ij")
    points = (
        AXES[:, None, None, 0]
        + s[..., None] * AXES[:, None, None, 1]
        + t[..., None] * AXES[:, None, None, 2]
    )
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


def look_up(stack, directions, sampling="center"):
    """Bilinear values of a stacked cube, shape (6N, N, ...), at unit directions (n, 3)."""
    size = stack.shape[1]
    texels, weights = corners(directions, size, sampling)
    faces = np.asarray(stack).reshape(6, size, size, -1).astype(float)
    return np.einsum("nkc,nk->nc", faces[texels[..., 0], texels[..., 1], texels[..., 2]], weights)


def bilinear(function, size, directions, sampling="center"):
    """What look-ups in a cube of a function's values return at directions."""
    values = function(centers(size, sampling))
    return look_up(values.reshape(6 * size, size, -1), directions, sampling)
