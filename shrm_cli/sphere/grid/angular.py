"""The grid of angular maps (light-probe balls), whose corners hold nothing."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, Indices
from shrm_cli.layouts import FACES
from shrm_cli.sphere.angular import (
    angular_coordinates,
    angular_directions,
    angular_points,
    angular_solid_angles,
)
from shrm_cli.sphere.cube import face_axes, right_angles, turned_face
from shrm_cli.sphere.grid.base import Analysis, Grid, Sampler, WholeImageAnalysis
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.sphere.sampling import AngularSampler
from shrm_cli.sphere.transform import analyze_angular

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
        return angular_directions(self.size, self.sampling)[0]

    def weights(self, start: int = 0, stop: int | None = None) -> Array:
        return angular_solid_angles(self.size, self.sampling)[start:stop]

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
