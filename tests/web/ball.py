"""What balls under prefiltered light look like by the documented shading of engines, in numpy."""

import base64

import numpy as np

from tests.bilinear import look_up


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


def mirrored(normals, view):
    """Where views are reflected to."""
    view = np.asarray(view, dtype=float) / np.linalg.norm(view)
    return 2 * (normals @ view)[..., None] * normals - view


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


def lambert(nine, normals):
    """E / pi of nine lighting coefficients, by the polynomials of Ramamoorthi and Hanrahan."""
    x, y, z = np.moveaxis(normals, -1, 0)
    terms = [
        0.282095, 0.325735 * y, 0.325735 * z, 0.325735 * x, 0.273137 * x * y, 0.273137 * y * z,
        0.078848 * (3 * z * z - 1), 0.273137 * x * z, 0.136569 * (x * x - y * y),
    ]  # fmt: skip
    return sum(np.multiply.outer(term, row) for term, row in zip(terms, nine, strict=True))
