"""The grid of angular maps (light-probe balls), whose corners hold nothing.

The center looks along +Z. The angle from it is proportional to the distance from the center, 180
degrees at the rim, a circle that touches the edges of the image. Right is -X (seen from inside)
and up is +Y.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, Indices
from shrm_cli.sphere.cube import face_axes, right_angles, texel_index, texel_scale, turned_face
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.grid.base import Analysis, Grid, Sampler, WholeImageAnalysis, bilinear
from shrm_cli.sphere.harmonics import index, legendre_degrees
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.vocabulary import FACES, Sampling

_FRONT = FACES.index("+Z")
"""An angular map has the axes of this face: right is -X and down is -Y."""


class Angular(Grid):
    """An angular map of `size` times `size` pixels."""

    name = "angular"
    proportions = (1, 1)
    half_turn = 0.5
    smallest = 3
    largest = 4096
    most_pixels = 2**25  # about 7 GB while they are read and projected

    def directions(self) -> Array:
        """Unit directions of the pixels, shape (size, size, 3); -Z outside the rim."""
        s = nodes(self.size, self.sampling)
        return angular_points(s, s[:, None])

    def weights(self, start: int = 0, stop: int | None = None) -> Array:
        """Solid angles, ``pi sin(pi r) / r dx dy``, which sum to 4 pi; see `Grid.weights`.

        Pixels that the rim cuts are averaged over sub-pixels, and those whose sample lies outside
        it have none.
        """
        s = nodes(self.size, self.sampling)
        step = s[1] - s[0]
        radius = np.hypot(s[None, :], s[:, None])
        weights = np.pi**2 * np.sinc(np.minimum(radius, 1.0)) * step**2
        rim = (radius > 1 - step) & (radius <= 1)
        offsets = nodes(16) * step / 2
        rows, columns = np.nonzero(rim)
        x = s[columns][:, None, None] + offsets[None, None, :]
        y = s[rows][:, None, None] + offsets[None, :, None]
        fine = np.hypot(x, y)
        density = np.pi**2 * np.sinc(np.minimum(fine, 1.0)) * (fine < 1)
        weights[rim] = density.mean(axis=(1, 2)) * step**2
        weights[radius > 1] = 0
        return np.asarray(weights * (4 * np.pi / weights.sum()))[start:stop]

    def points(self, rows: Indices, down: Array, across: Array) -> tuple[Array, Array]:
        radius = np.hypot(across, down)
        density = np.where(radius <= 1, np.pi**2 * np.sinc(radius), 0)
        return angular_points(across, down), density

    def coordinates(self, directions: Array) -> tuple[Indices, Array, Array]:
        """Where `pixels` looks for directions: not so near to the rim that it finds unused ones.

        The light of pixels whose samples lie beyond the rim goes to those before it.
        """
        across, down = angular_coordinates(directions)
        reach = 1 - np.sqrt(2) / self.size
        radius = np.hypot(across, down)
        scale = np.where(radius > reach, reach / np.maximum(radius, reach), 1)
        return np.zeros(across.shape, dtype=np.intp), across * scale, down * scale

    def sampler(self, image: Array) -> Sampler:
        return AngularSampler(image, self.sampling)

    def analysis(self, order: int) -> Analysis:
        def integrate(weighted: Array) -> Array:
            return analyze_angular(weighted, order, self.sampling)

        return WholeImageAnalysis(integrate)

    def used(self) -> NDArray[np.bool_]:
        """The pixels whose samples lie inside the rim, shape (size, size)."""
        s = nodes(self.size, self.sampling)
        return np.asarray(np.hypot(s, s[:, None]) <= 1)

    def share_borders(self, image: Array) -> None:
        """Leave the image as it is: its rim is one direction, but hardly a pixel lies on it."""

    def turned(self, image: Array, matrix: Array) -> Array | None:
        turned = right_angles(matrix)
        if turned is None or turned[2, 2] != 1:
            return None
        return turned_face(image, face_axes()[_FRONT] @ turned, _FRONT)


def angular_points(across: ArrayLike, down: ArrayLike) -> Array:
    """Directions at positions on an angular map, broadcastable: (..., 3); -Z beyond the rim."""
    across, down = np.broadcast_arrays(across, down)
    radius = np.minimum(np.hypot(across, down), 1.0)
    # sin(pi r) / r, continued to pi at the center.
    ratio = np.pi * np.sinc(radius)
    return normalize(np.stack([-ratio * across, -ratio * down, np.cos(radius * np.pi)], axis=-1))


def angular_coordinates(directions: ArrayLike) -> tuple[Array, Array]:
    """Position across and down an angular map, each in [-1, 1], of directions (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(directions), -1, 0)
    sine = np.hypot(x, y)
    x = np.where((sine == 0) & (z < 0), -1.0, x)  # -Z is the whole rim: take its right end
    ratio = np.arctan2(sine, z) / (np.pi * np.where(sine > 0, sine, 1.0))
    return -ratio * x, -ratio * y


class AngularSampler:
    """Bilinear filtering of an angular map, which goes on beyond its rim on the other side.

    What the image holds outside its rim does not count.

    `image` is of shape (N, N, channels).
    """

    def __init__(self, image: ArrayLike, sampling: Sampling) -> None:
        self._image = np.asarray(image)
        self._sampling = sampling
        self._padded = _beyond_rim(self._image, sampling) if len(self._image) > 1 else self._image

    def __call__(self, directions: ArrayLike) -> Array:
        """Values at directions of any length, shape (..., 3): (..., channels)."""
        across, down = angular_coordinates(directions)
        if len(self._image) == 1:
            return np.broadcast_to(self._image[0, 0], (*across.shape, self._image.shape[2]))
        return _bilinear(self._padded, across, down, self._sampling)


def _bilinear(padded: Array, across: Array, down: Array, sampling: Sampling) -> Array:
    """Values at positions in [-1, 1] of a square image with one more texel on every side."""
    size = len(padded) - 2
    return bilinear(padded, *(texel_index(each, size, sampling) + 1 for each in (across, down)))


def _beyond_rim(image: Array, sampling: Sampling) -> Array:
    """An angular map that goes on beyond its rim, with one more texel on every side.

    The way through -Z leads to the other side of the image: from radius r > 1 to radius 2 - r,
    half a turn away. A bilinear filter can trust texels up to a distance from the rim; beyond it
    values are interpolated between the last ones of this side and those of the other side.
    """
    size = len(image)
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    scale, shift = texel_scale(size, sampling)
    s = (np.arange(-1, size + 1) + shift) / scale - 1
    radius = np.hypot(s[:, None], s)
    reach = 1.5 / scale  # a bilinear filter reaches less than a texel's diagonal
    rows, columns = np.nonzero((radius > 1) & (radius < 1 + reach))
    r = radius[rows, columns]
    x, y = s[columns] / r * (1 - reach), s[rows] / r * (1 - reach)
    far = ((r - 1 + reach) / (2 * reach))[:, None]
    here, there = _bilinear(padded, x, y, sampling), _bilinear(padded, -x, -y, sampling)
    padded[rows, columns] = (1 - far) * here + far * there
    return padded


def analyze_angular(weighted: Array, order: int, sampling: Sampling = "center") -> Array:
    """Coefficients of an angular map (light-probe ball).

    Pixels at the same distance from the center share their Legendre functions, and pixels that
    are mirror images in x or y share their waves in longitude, up to the sign.

    `weighted`, of shape (size, size, channels), holds pixels, each already multiplied by its solid
    angle.

    Returns an array of shape ((order+1)^2, channels): real coefficients in world axes, index
    l(l+1)+m.
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
    """The last quarter of square images plus its mirror images, by their signs in x and in y."""
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
