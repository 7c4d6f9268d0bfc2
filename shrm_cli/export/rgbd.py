"""RGBD: radiance up to 255 in the four bytes of a pixel, as Babylon.js defines it.

A pixel holds a divisor D in its alpha and ``(c D)^(1/2.2)`` in its colours, all as bytes. A reader
takes ``rgb^2.2 / D``. D is 1 for what a display could show, and falls to 1/255 at radiance 255,
which is the most that a pixel can hold.

References: Babylon.js, ``helperFunctions``: ``toRGBD`` and ``fromRGBD``.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.export.pixels import Clipped, TexelFormat, encoded
from shrm_cli.files.png import png_of_lines

LARGEST = 255.0
"""The largest radiance that a pixel can hold."""
_GAMMA = 2.2


def rgbd_pictures(faces: Array, what: str) -> tuple[list[bytes], Clipped]:
    """Return PNG files of the faces of a level, and what RGBD could not hold.

    The pictures stand on their heads: Babylon.js, and glTF's image-based light with it, counts the
    rows of a face as those of other textures, from below.

    `faces`, of shape (6, N, N, 3), are linear radiance. `what` is what the level is called in
    messages.

    Raises MapError if a value is not finite.
    """
    data, clipped = encoded(faces, RGBD, what)
    pixels = np.frombuffer(data, np.uint8).reshape(*faces.shape[:-1], 4)[:, ::-1]
    return [rgba_png(face) for face in pixels], clipped


def _pack(radiance: Array) -> NDArray[np.uint8]:
    """Encode linear radiance within 0 .. 255 in bytes, shape (..., 4)."""
    radiance = np.asarray(radiance, dtype=np.float64)
    peak = np.maximum(radiance.max(axis=-1, keepdims=True), 1.0)
    divisor = np.floor(LARGEST / peak)
    colors = np.rint(255 * (radiance * divisor / 255) ** (1 / _GAMMA))
    return np.concatenate([colors, divisor], axis=-1).astype(np.uint8)


RGBD = TexelFormat("rgbd", "RGBD", (LARGEST,) * 3, 4, _pack, dimmest=5e-3)
"""The format; it is no choice of users, because its pixels lie in pictures."""


def rgba_png(pixels: NDArray[np.uint8]) -> bytes:
    """Return a PNG file of pixels whose alpha is no opacity.

    Image libraries multiply colours with alpha on their way into or out of a file, which would
    destroy RGBD; here bytes stay as they are. Each row is stored as its difference to that above.

    `pixels` are of shape (H, W, 4).
    """
    height, width, _ = pixels.shape
    rows = pixels.reshape(height, 4 * width)
    above = np.vstack([np.zeros_like(rows[:1]), rows[:-1]])
    filtered = np.full((height, 1 + 4 * width), 2, dtype=np.uint8)  # the filter "up"
    filtered[:, 1:] = rows - above
    return png_of_lines(width, filtered, 9)
