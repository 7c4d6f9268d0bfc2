"""What a parameter of a BRDF that varies over a surface follows: vertex colours, or an image.

Kautz, Sloan and Snyder 2002, section 4 and figure 4, vary one parameter of their model so.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.probe.image_file import stored_image
from shrm_cli.vocabulary import LUMINANCE

_MOST_PIXELS = 2**26
"""The most pixels of an image that is read, 8192 x 8192."""


class Variation:
    """Where a parameter lies in its range, at points of a mesh: a brightness from 0 to 1.

    Parameters
    ----------
    image : array_like, shape (H, W), optional
        Its brightness counts over the texture coordinates, which it is repeated over; its first row
        is at the top, where v is 1. By default that of the vertices' colours counts.
    """

    def __init__(self, image: ArrayLike | None = None) -> None:
        self._image = None if image is None else np.asarray(image, dtype=np.float32)

    def shares(self, mesh: Mesh, faces: NDArray[np.int64], weights: Array) -> Array:
        """Return the shares of the way from the least value to the largest, shape (n,).

        They are interpolated between vertices, or bilinearly between pixels.

        Parameters
        ----------
        faces : ndarray of int64, shape (n,)
            The triangles of the points.
        weights : ndarray, shape (n, 3)
            Their barycentric coordinates.
        """
        if self._image is None:
            brightness = (_known(mesh, mesh.colors, "vertex colours") @ LUMINANCE)[:, None]
            return mesh.interpolated(brightness, faces, weights)[:, 0]
        uvs = _known(mesh, mesh.uvs, "texture coordinates")
        u, v = mesh.interpolated(uvs, faces, weights).T
        height, width = self._image.shape
        x, y = (u % 1) * width - 0.5, ((1 - v) % 1) * height - 0.5
        left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
        across, down = x - left, y - top
        result = np.zeros(len(x))
        for row, row_weight in ((top, 1 - down), (top + 1, down)):
            for column, weight in ((left, 1 - across), (left + 1, across)):
                result += row_weight * weight * self._image[row % height, column % width]
        return result


def open_variation(follows: str, mesh: Mesh) -> Variation:
    """Return what a parameter follows over a mesh.

    Parameters
    ----------
    follows : str
        ``vertex``, or the path of an image, whose numbers are taken as they are stored, integers as
        shares of their largest.

    Raises
    ------
    MeshError
        If the mesh has no colours, or no texture coordinates for an image.
    ProbeError
        If the image cannot be read, or is too large.
    """
    if follows == "vertex":
        _known(mesh, mesh.colors, "vertex colours")
        return Variation()
    _known(mesh, mesh.uvs, "texture coordinates")
    image = stored_image(follows, _MOST_PIXELS)
    return Variation(image @ np.array(LUMINANCE, dtype=np.float32))


def _known(mesh: Mesh, values: Array | None, what: str) -> Array:
    """Return values of a mesh's vertices, which all of it must have.

    Raises
    ------
    MeshError
    """
    if values is None:
        raise MeshError(f"{mesh.name}: it has no {what} that a parameter could follow; add them")
    return values
