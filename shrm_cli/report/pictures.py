"""Pictures of a page: 8-bit, within it as data, in its own colours for numbers."""

import base64

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.color import to_rec709
from shrm_cli.files.png import encode_srgb, png_bytes
from shrm_cli.render.camera import whole_coverage
from shrm_cli.report.markup import Html, tag

Bytes = NDArray[np.uint8]

_SHOULDER = 0.7
"""What is brighter than this on the screen is compressed, in pictures of probes."""

_TURBO = np.array([
    [0.13572138, 4.6153926, -42.66032258, 132.13108234, -152.94239396, 59.28637943],
    [0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604],
    [0.1066733, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973],
])  # fmt: skip
"""Google's polynomials of the colours Turbo, which the page of `shrm view` has, too."""
_MAGMA = np.array([
    (0, 0, 4), (28, 16, 68), (79, 18, 123), (129, 37, 129), (181, 54, 122), (229, 80, 100),
    (251, 135, 97), (254, 194, 135), (252, 253, 191),
]) / 255  # fmt: skip
"""Matplotlib's Magma, as FLIP is usually shown."""
_SIGNED = np.array([
    (23, 79, 158), (66, 135, 203), (146, 192, 226), (244, 244, 242), (246, 178, 140),
    (220, 101, 66), (153, 27, 40),
]) / 255  # fmt: skip
"""The colors of errors, from too dark (blue) through right (nearly white) to too bright (red)."""


def turbo(values: ArrayLike) -> Bytes:
    """Return colours of numbers from 0 to 1, shape (..., 3)."""
    powers = np.clip(np.asarray(values, float), 0, 1)[..., None] ** np.arange(6)
    return _eight_bits(powers @ _TURBO.T)


def magma(values: ArrayLike) -> Bytes:
    """Return colours of errors from 0 to 1, shape (..., 3)."""
    return _between(_MAGMA, np.asarray(values, float))


def signed(values: ArrayLike) -> Bytes:
    """Return colours of differences from -1 to 1, shape (..., 3)."""
    return _between(_SIGNED, (np.asarray(values, float) + 1) / 2)


def _between(colors: Array, values: Array) -> Bytes:
    places = np.linspace(0, 1, len(colors))
    return _eight_bits(np.stack([np.interp(values, places, each) for each in colors.T], axis=-1))


def _eight_bits(values: Array) -> Bytes:
    return np.floor(255 * np.clip(values, 0, 1) + 0.5).astype(np.uint8)


def shown(pixels: ArrayLike, exposure: float, primaries: tuple[float, ...] | None) -> Bytes:
    """Return linear radiance (..., 3) as a screen shows it; what is too bright is white."""
    return encode_srgb(_exposed(pixels, exposure, primaries))


def tone_mapped(pixels: ArrayLike, exposure: float, primaries: tuple[float, ...] | None) -> Bytes:
    """Return linear radiance (..., 3) for a screen; what is too bright approaches white."""
    values = np.maximum(_exposed(pixels, exposure, primaries), 0)
    room = 1 - _SHOULDER
    above = np.maximum(values - _SHOULDER, 0)
    return encode_srgb(np.minimum(values, _SHOULDER) + room * -np.expm1(-above / room))


def _exposed(pixels: ArrayLike, exposure: float, primaries: tuple[float, ...] | None) -> Array:
    values = np.nan_to_num(np.asarray(pixels, dtype=np.float64) * 2.0**exposure)
    matrix = to_rec709(primaries)
    return values if matrix is None else values @ matrix.T


def unmultiplied(picture: Array) -> Array:
    """Return a sphere's picture (S, S, 3) divided by its coverage; 0 beside the sphere."""
    part = whole_coverage(len(picture))[..., None]
    return np.divide(picture, part, out=np.zeros(picture.shape), where=part > 0)


def on_sphere(colors: Bytes) -> Bytes:
    """Add the coverage of a sphere to its colours (S, S, 3), so that the page shows beside it."""
    return np.concatenate([colors, _eight_bits(whole_coverage(len(colors)))[..., None]], axis=-1)


def image(pixels: Bytes, text: str, of_class: str = "") -> Html:
    """Return an element that holds a picture, (H, W, 3) or (H, W, 4), and says what it shows."""
    data = base64.b64encode(png_bytes(pixels)).decode("ascii")
    height, width = pixels.shape[:2]
    name = f"img.{of_class}" if of_class else "img"
    return tag(
        name, src=f"data:image/png;base64,{data}", alt=text, width=str(width), height=str(height)
    )


def scale(colors: Bytes, ticks: list[str], text: str) -> Html:
    """Return a bar of colours (N, 3) from left to right, with evenly spaced numbers below."""
    bar = image(colors[None], text, "bar")
    return tag("div.scale", bar, tag("div.ticks", [tag("span", tick) for tick in ticks]))
