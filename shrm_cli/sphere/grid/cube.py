"""The grid of cube maps: six faces in OpenEXR's order and orientation, stacked."""

import numpy as np

from shrm_cli.arrays import Array, Indices
from shrm_cli.sphere import cube
from shrm_cli.sphere.grid.base import Analysis, Grid, Sampler, channels_at_once
from shrm_cli.sphere.synthesis import CubeIntegral
from shrm_cli.vocabulary import FACES


class Cube(Grid):
    """A stacked cube of `size` texels along the edges of its faces."""

    name = "cube"
    proportions = (1, 6)
    half_turn = 2.0
    smallest = 1
    largest = 4096
    most_pixels = 2**27  # less than 1 GB as faces of their own, 4 GB otherwise
    faces = 6

    def directions(self) -> Array:
        return cube.cube_directions(self.size, self.sampling)

    def weights(self, start: int = 0, stop: int | None = None) -> Array:
        first, last, _ = slice(start, stop).indices(6 * self.size)
        if first % self.size == 0 and last - first == self.size:
            return cube.cube_solid_angles(self.size, self.sampling)
        return cube.texel_solid_angles(self.size, self.sampling)[first:last]

    def points(self, rows: Indices, down: Array, across: Array) -> tuple[Array, Array]:
        right, below, forward = np.moveaxis(cube.face_axes()[rows // self.size], -2, 0)
        points = forward + right * across[..., None] + below * down[..., None]
        return points, (1 + across**2 + down**2) ** -1.5

    def coordinates(self, directions: Array) -> tuple[Indices, Array, Array]:
        return cube.cube_coordinates(directions)

    def sampler(self, image: Array) -> Sampler:
        return cube.CubeSampler(image, self.sampling)

    def analysis(self, order: int) -> Analysis:
        return CubeAnalysis(order, self)

    def share_borders(self, image: Array) -> None:
        if self.size == 1:
            return
        last = self.size - 1
        k = np.arange(0, 2 * last + 1, 2) - last  # whole numbers: equal points are equal
        right, down, forward = np.moveaxis(cube.face_axes().astype(int), 1, 0)[:, :, None, None]
        points = forward * last + right * k[:, None] + down * k[:, None, None]
        on_edge = np.broadcast_to(
            (np.abs(k) == last) | (np.abs(k[:, None]) == last), (len(FACES), len(k), len(k))
        )
        pixels = image.reshape(*on_edge.shape, 3)
        _, place, count = np.unique(
            points[on_edge], axis=0, return_inverse=True, return_counts=True
        )
        total = np.zeros((len(count), 3))
        np.add.at(total, place.ravel(), pixels[on_edge])
        pixels[on_edge] = (total / count[:, None])[place.ravel()]

    def turned(self, image: Array, matrix: Array) -> Array | None:
        turned = cube.right_angles(matrix)
        if turned is None:
            return None
        faces = image.reshape(6, self.size, self.size, -1)
        result = np.empty_like(faces)
        for face, axes in enumerate(cube.face_axes() @ turned):  # M^-1 of each axis, as rows
            source = int(np.argmax(cube.face_axes()[:, 2] @ axes[2]))
            result[face] = cube.turned_face(faces[source], axes, source)
        return result.reshape(image.shape)


class CubeAnalysis:
    """An `Analysis` of a stacked cube, which arrives as a whole or face by face."""

    def __init__(self, order: int, grid: Cube) -> None:
        self._order, self._grid = order, grid
        self._integrals: dict[int, CubeIntegral] = {}

    def add(self, start: int, pixels: Array, weights: Array) -> None:
        """Take in whole faces, as `Analysis` has it."""
        size, channels = self._grid.size, pixels.shape[-1]
        names = FACES[start // size :]
        step = channels_at_once(pixels)
        for first in range(0, channels, step):
            if first not in self._integrals:
                self._integrals[first] = CubeIntegral(self._order, self._grid.sampling)
            part = pixels[..., first : first + step] * weights[..., None]
            faces = part.reshape(-1, size, size, part.shape[-1]).transpose(0, 3, 1, 2)
            self._integrals[first].add(dict(zip(names, faces, strict=False)))

    def coefficients(self) -> Array:
        parts = [each.coefficients() for each in self._integrals.values()]
        return np.concatenate(parts, axis=-1)
