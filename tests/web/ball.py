"""What balls under prefiltered light look like by the documented shading of engines, in numpy."""

import base64

import numpy as np

from research.bilinear import look_up


def decoded(text, size, channels=4):
    """An image of 32-bit floats from a page, its first row on top, shape (size, size, 3)."""
    pixels = np.frombuffer(base64.b64decode(text), np.float32)
    return pixels.reshape(size, size, channels)[::-1, :, :3].astype(float)


def seen(size, towards):
    """Normals of a ball from far away, shape (size, size, 3), and which pixels show it.

    The camera lies in the direction `towards`, y is up, and the ball fills the picture.
    """
    towards = np.asarray(towards, dtype=float)
    towards = towards / np.linalg.norm(towards)
    right = np.cross([0, 1, 0], towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
    s = (np.arange(size) + 0.5) * 2 / size - 1
    x, y = np.meshgrid(s, -s)
    inside = x**2 + y**2 < 1
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    return x[..., None] * right + y[..., None] * up + z[..., None] * towards, inside


def change(size):
    """The largest difference of a normal's parts, in camera axes, within a block of 2 x 2 pixels.

    It is what ``max(abs(dFdx(n)), abs(dFdy(n)))`` makes, largest part.
    """
    s = (np.arange(size) + 0.5) * 2 / size - 1
    x, y = np.meshgrid(s, -s)
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1)
    across = np.abs(normals[:, 1::2] - normals[:, ::2]).repeat(2, axis=1)
    down = np.abs(normals[1::2] - normals[::2]).repeat(2, axis=0)
    return np.maximum(across, down).max(axis=-1)


def mirrored(normals, view):
    """Where views are reflected to; `view` is one for all, or one for each normal."""
    view = np.asarray(view, dtype=float)
    view = view / np.linalg.norm(view, axis=-1, keepdims=True)
    return 2 * np.sum(normals * view, axis=-1, keepdims=True) * normals - view


def views(normals, towards, distance):
    """Directions to an eye from the points of a ball of radius 1; most engines shade by these.

    They do so even where the projection is orthographic. At a distance of 1000 they turn by 0.06
    degrees across the ball, which is a sixth of a texel of a cube of 256.
    """
    eye = distance * np.asarray(towards, dtype=float) / np.linalg.norm(towards)
    return eye - normals


def trilinear(levels, directions, lod):
    """Blends of two levels, each looked up bilinearly; `lod` is a number or one a direction."""
    flat = directions.reshape(-1, 3)
    lod = np.broadcast_to(np.clip(lod, 0, len(levels) - 1), directions.shape[:-1]).ravel()
    result = np.zeros((len(flat), 3))
    for k, level in enumerate(levels):
        weight = np.maximum(1 - np.abs(lod - k), 0)
        used = weight > 0
        if used.any():
            result[used] += weight[used, None] * look_up(level, flat[used])
    return result.reshape(directions.shape)


_POLYNOMIALS = [0.282095, *[0.325735] * 3, 0.273137, 0.273137, 0.078848, 0.273137, 0.136569]
"""Of Ramamoorthi and Hanrahan 2001, with A_l / pi and the factors of the harmonics."""


def polynomials(nine):
    """Nine lighting coefficients times what makes polynomials of E / pi of them, shape (9, 3)."""
    return np.array(_POLYNOMIALS)[:, None] * nine


def lambert(nine, normals):
    """E / pi of nine lighting coefficients."""
    x, y, z = np.moveaxis(normals, -1, 0)
    terms = [np.ones_like(x), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y]
    return np.stack(terms, axis=-1) @ polynomials(nine)
