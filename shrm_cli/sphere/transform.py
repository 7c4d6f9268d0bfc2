"""Spherical harmonic analysis: from samples on a grid to real coefficients."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.memo import Memo
from shrm_cli.sphere.double_fourier import harmonics_from_moments
from shrm_cli.sphere.harmonics import index, legendre_degrees
from shrm_cli.sphere.latlong import LATLONG_AXES
from shrm_cli.sphere.quadrature import colatitude_weights, longitude_weights
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.vocabulary import Sampling

_known_waves = Memo(2**24)
"""The waves of each size and order; those of 1024 x 512 pixels and order 64 take 0.8 MB."""
_ROWS_AT_ONCE = 64
"""The rows that are folded at a time, which stay in the processor's cache."""


class LatLongAnalysis:
    """Analysis of a lat-long whose rows arrive in blocks.

    The integrals with cos(m phi), sin(m phi) over longitude are a matrix product for each block,
    and those with the waves in theta another. Only (order+1)^2 moments stay in memory. The rules
    are exact for images band-limited below half the height.

    Parameters
    ----------
    width, height : int
        Size of the whole image; the width is even.
    order : int
        Largest degree.
    sampling : {"center", "border"}
    dtype : float32 or float64
        Precision of the longitude integral; everything after it is float64.

    References
    ----------
    Ramamoorthi 2002, eq. 5.20 and 5.21.
    """

    def __init__(
        self,
        width: int,
        height: int,
        order: int,
        sampling: Sampling = "center",
        dtype: type = np.float32,
    ) -> None:
        self.order = order
        key = width, height, order, sampling, np.dtype(dtype)
        self._row_waves, self._column_waves = _known_waves.get(key, lambda: _analysis_waves(*key))
        self._moments: Array | None = None

    def add(self, start: int, pixels: Array, weights: Array | None = None) -> None:
        """Take in a block of rows of the image.

        Parameters
        ----------
        start : int
            Index of the first row.
        pixels : ndarray, shape (rows, width, channels)
        weights : ndarray, optional
            Not used. Other analyses need the solid angles of the pixels; this one has separate
            weights for rows and columns, which it knows.
        """
        count, width, channels = pixels.shape
        planes = np.moveaxis(pixels, -1, 0)
        left, right = planes[..., : width // 2], planes[..., : width // 2 - 1 : -1]
        dtype = self._column_waves[0].dtype
        rings = np.empty((channels, count, 2, self.order + 1))
        for first in range(0, count, _ROWS_AT_ONCE):
            rows = slice(first, min(first + _ROWS_AT_ONCE, count))
            # The product is three times as fast where the columns of a channel lie side by side.
            folded = np.empty((channels, rows.stop - first, width // 2), dtype)
            for k, (fold, wave) in enumerate(
                zip((np.add, np.subtract), self._column_waves, strict=True)
            ):
                fold(left[:, rows], right[:, rows], out=folded, dtype=dtype)  # half would overflow
                product = folded.reshape(-1, width // 2) @ wave
                rings[:, rows, k] = product.reshape(channels, -1, product.shape[1])
        if self._moments is None:
            self._moments = np.zeros((2, self.order + 1, self.order + 1, channels))
        for parity, waves in enumerate(self._row_waves):
            part = waves[start : start + count].T @ np.moveaxis(
                rings[..., parity::2], 1, 0
            ).reshape(count, -1)
            part = part.reshape(self.order + 1, channels, 2, -1)
            self._moments[:, parity::2] += part.transpose(2, 3, 0, 1)

    def coefficients(self) -> Array:
        """Real coefficients in world axes, shape ((order+1)^2, channels)."""
        return transform_coefficients(self.polar_coefficients(), LATLONG_AXES.T)

    def polar_coefficients(self) -> Array:
        """Coefficients in the image's own axes, whose polar axis is the world's +Y.

        They have the same shape as `coefficients`, and are cheaper where the axes do not matter.
        """
        if self._moments is None:
            raise ValueError("no rows were added")
        return harmonics_from_moments(self._moments)


def _analysis_waves(
    width: int, height: int, order: int, sampling: Sampling, dtype: np.dtype[Any]
) -> tuple[list[Array], list[Array]]:
    """Return the waves over rows and over columns, times the weights of the integrals.

    The parameters are those of `LatLongAnalysis`.

    Returns
    -------
    rows : list of ndarray, shape (height, order+1)
        The cosines and the sines.
    columns : list of ndarray, shape (width/2, order+1)
        The same over half of the columns, in the precision `dtype`.
    """
    border = sampling == "border"
    # theta is a multiple of pi / rows, longitude one of pi / columns.
    rows = height - 1 if border else 2 * height
    columns = width - 1 if border else width
    weights = colatitude_weights(height, sampling)[:, None]
    multiples = np.arange(height) if border else 2 * np.arange(height) + 1
    row_waves: list[Array] = [wave * weights for wave in _waves(multiples, rows, order)]
    # Column j and its mirror image width - 1 - j have opposite longitudes: half is enough.
    half = np.arange(width // 2)
    measure = longitude_weights(width, sampling)[: len(half), None]
    column_waves = _waves(width - 1 - 2 * half, columns, order)
    return row_waves, [(wave * measure).astype(dtype) for wave in column_waves]


def _waves(multiples: NDArray[np.integer], divisor: int, order: int) -> tuple[Array, Array]:
    """Cosine and sine of ``m * multiples * pi / divisor``, m = 0 .. order, looked up in a table."""
    turns = np.arange(2 * divisor) * (np.pi / divisor)
    at = np.outer(multiples, np.arange(order + 1)) % (2 * divisor)
    return np.cos(turns)[at], np.sin(turns)[at]


def analyze_angular(weighted: Array, order: int, sampling: Sampling = "center") -> Array:
    """Coefficients of an angular map (light-probe ball).

    Pixels at the same distance from the center share their Legendre functions, and pixels that
    are mirror images in x or y share their waves in longitude, up to the sign.

    Parameters
    ----------
    weighted : ndarray, shape (size, size, channels)
        Pixels, each already multiplied by its solid angle.
    order : int
        Largest degree.
    sampling : {"center", "border"}

    Returns
    -------
    ndarray, shape ((order+1)^2, channels)
        Real coefficients in world axes, index l(l+1)+m.
    """
    size, channels = weighted.shape[1:]
    half = size // 2
    at = 2 * np.arange(half, size) - (size - 1)  # in half pixels from the center, >= 0
    y, x = np.meshgrid(at, at, indexing="ij")
    scale = size if sampling == "center" else size - 1
    inside = x * x + y * y <= scale**2
    y, x = y[inside], x[inside]
    squares, ring = np.unique(x * x + y * y, return_inverse=True)
    in_rings = np.argsort(ring, kind="stable")
    starts = np.searchsorted(ring[in_rings], np.arange(len(squares)))
    step = np.exp(1j * np.arctan2(y, x))[in_rings]
    # Right is -X and down is -Y.
    planes = np.moveaxis(weighted[::-1, ::-1], -1, 0)
    folded = {
        signs: quarter[:, inside][:, in_rings] for signs, quarter in _fold(planes, half).items()
    }
    rings = np.empty((order + 1, 2, channels, len(squares)))
    wave = np.ones_like(step)
    for m in range(order + 1):
        sign = 1 - 2 * (m % 2)  # x -> -x turns phi to pi - phi, y -> -y to -phi
        for k, (part, signs) in enumerate(((wave.real, (sign, 1)), (wave.imag, (-sign, -1)))):
            for channel, values in enumerate(folded[signs]):
                np.add.reduceat(part * values, starts, out=rings[m, k, channel])
        wave *= step
    result = np.empty(((order + 1) ** 2, channels))
    for degree, values in legendre_degrees(order, np.cos(np.sqrt(squares) * (np.pi / scale))):
        sums = rings[: degree + 1] @ values[:, None, :, None]
        sums[1:] *= np.sqrt(2)
        center = index(degree, 0)
        result[center : center + degree + 1] = sums[:, 0, :, 0]
        result[center - degree : center] = sums[:0:-1, 1, :, 0]
    return result


def _fold(planes: Array, half: int) -> dict[tuple[int, int], Array]:
    """The last quarter of square images plus its mirror images, with each pair of signs.

    Returns
    -------
    dict of (sign of the mirror image in x, in y): ndarray, shape (..., size - half, size - half)
    """
    size = planes.shape[-1]
    mirrored = slice(size - 1 - half, None, -1)
    # Where x or y is 0 a pixel is its own mirror image, and would count twice.
    share = np.where(np.arange(half, size) == (size - 1) / 2, 0.5, 1.0)
    result: dict[tuple[int, int], Array] = {}
    for sign_y in (1, -1):
        rows = planes[..., half:, :] + sign_y * planes[..., mirrored, :]
        for sign_x in (1, -1):
            quarter = rows[..., half:] + sign_x * rows[..., mirrored]
            result[sign_x, sign_y] = quarter * share[:, None] * share
    return result
