"""BRDFs whose parameters differ from point to point: what these follow, and GGX under maps.

Kautz, Sloan and Snyder 2002, section 4 and figure 4, vary one parameter of their model so.
Brightness tells one parameter, and the red and the green of colours two.

Under maps of light, GGX surfaces differ in roughness and reflectance. A map is shown as surfaces of
a few roughnesses, between which points are interpolated. Light that a surface reflects is a linear
function of its reflectance f0, by Schlick's term, so that a black one and a white one tell all
others.
"""

from collections.abc import Callable
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Color
from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.maps.base import ReflectedLight
from shrm_cli.maps.kinds import LightMap
from shrm_cli.probe.image_file import open_picture
from shrm_cli.render.boxed import looked_up
from shrm_cli.render.lit import ggx_surface, shown_as
from shrm_cli.vocabulary import LUMINANCE, MIN_ROUGHNESS

_STEPS = {1: 32, 2: 12}
"""How many intervals the way of each of so many parameters has, in which surfaces are interpolated.
Of two, a lobe from 0.1 wide on is 2 % off in the middle of its first interval."""


class Variation:
    """Where parameters lie in their ranges, at points of a mesh: numbers from 0 to 1.

    The colours of `image`, of shape (H, W, 3), count over the texture coordinates, which it is
    repeated over; its first row is at the top, where v is 1. By default the vertices' colours
    count.
    """

    def __init__(self, image: ArrayLike | None = None) -> None:
        self._image = None if image is None else np.asarray(image, dtype=np.float32)

    def shares(self, mesh: Mesh, faces: NDArray[np.int64], weights: Array, count: int = 1) -> Array:
        """Return the shares of the way from the least value to the largest.

        They are interpolated between vertices, or bilinearly between pixels.

        `faces`, of shape (n,), are the triangles of the points. `weights`, of shape (n, 3), are
        their barycentric coordinates.

        Returns an array of shape (n,) or (n, count), the brightness for one parameter; red and
        green for two.
        """
        colors = self._colors(mesh, faces, weights)
        return colors @ LUMINANCE if count < 2 else colors[:, :count]

    def _colors(self, mesh: Mesh, faces: NDArray[np.int64], weights: Array) -> Array:
        if self._image is None:
            colors = _known(mesh, mesh.colors, "vertex colours")
            return mesh.interpolated(colors, faces, weights)
        uvs = _known(mesh, mesh.uvs, "texture coordinates")
        u, v = mesh.interpolated(uvs, faces, weights).T
        height, width = self._image.shape[:2]
        x, y = (u % 1) * width - 0.5, ((1 - v) % 1) * height - 0.5
        left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
        across, down = x - left, y - top
        result = np.zeros((len(x), 3))
        for row, row_weight in ((top, 1 - down), (top + 1, down)):
            for column, weight in ((left, 1 - across), (left + 1, across)):
                share = (row_weight * weight)[:, None]
                result += share * self._image[row % height, column % width]
        return result


def open_variation(follows: str, mesh: Mesh) -> Variation:
    """Return what parameters follow over a mesh.

    `follows` is ``vertex``, or the path of an image, whose numbers are taken as they are stored,
    integers as shares of their largest.
    """
    if follows == "vertex":
        _known(mesh, mesh.colors, "vertex colours")
        return Variation()
    _known(mesh, mesh.uvs, "texture coordinates")
    return Variation(open_picture(follows, as_stored=True).whole())


def between_steps(
    shares: Array, radiance: Callable[[tuple[float, ...], NDArray[np.int64]], Array]
) -> Array:
    """Interpolate what surfaces reflect between those of a few values of their parameters.

    `shares`, of shape (n, parameters), are where the parameters of points are on their ways, 0 ..
    1. `radiance` takes the shares of a surface, and the numbers of k points; returns what they
    reflect as that surface, shape (k, 3).

    Returns an array of shape (n, 3).
    """
    steps, count = _STEPS[shares.shape[1]], shares.shape[1]
    places = np.clip(shares, 0, 1) * steps
    below = np.minimum(np.floor(places), steps - 1).astype(np.intp)
    corners = below[None] + np.array([*product((0, 1), repeat=count)])[:, None]
    weights = np.prod(np.maximum(1 - np.abs(places - corners), 0), axis=-1)
    # Points that are next to a node lie together, once all are sorted by their nodes.
    nodes = np.ravel_multi_index(tuple(np.moveaxis(corners, -1, 0)), (steps + 1,) * count)
    order = np.argsort(nodes, axis=None, kind="stable")
    order = order[weights.ravel()[order] > 0]
    found, begins = np.unique(nodes.ravel()[order], return_index=True)
    result = np.zeros((len(shares), 3))
    for node, group in zip(found, np.split(order, begins[1:]), strict=True):
        own = group % len(shares)
        at = np.array(np.unravel_index(node, (steps + 1,) * count)) / steps
        result[own] += weights.ravel()[group, None] * radiance(tuple(at.tolist()), own)
    return result


def _known(mesh: Mesh, values: Array | None, what: str) -> Array:
    """Return values of a mesh's vertices, which all of it must have."""
    if values is None:
        raise MeshError(f"{mesh.name}: it has no {what} that a parameter could follow; add them")
    return values


_KEPT = 128
"""Surfaces whose tables are kept."""
_BLACK, _WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)


class VariedSurface:
    """A GGX surface under the light of a map.

    `anisotropy` is that of glTF, and `taps` are how many directions the light is looked up in, as
    `Map.shaded` has them.
    """

    def __init__(
        self, made: LightMap, anisotropy: float | None = None, taps: int | None = None
    ) -> None:
        self._map, self._anisotropy, self._taps = made, anisotropy, taps
        self._surface = lru_cache(_KEPT)(self._of)

    def radiance(
        self, normals: Array, views: Array, tangents: Array | None, roughness: Array, f0: Array
    ) -> Array:
        """Return reflected radiance, shape (n, 3).

        `normals`, `views` and `tangents`, each of shape (n, 3), are unit vectors in world axes;
        tangents run around +Y by default. `roughness`, of shape (n,), is perceptual. `f0`, of shape
        (n, 3), is the reflectance at normal incidence, linear RGB, 0 .. 1.
        """
        if len(normals) == 0:
            return np.empty((0, 3))
        vectors = normals, views, tangents
        if np.ptp(roughness) == 0:  # exactly, and not between two
            return self._of_one(float(roughness[0]), slice(None), vectors, f0)
        return between_steps(
            roughness[:, None],
            lambda node, own: self._of_one(max(node[0], MIN_ROUGHNESS), own, vectors, f0[own]),
        )

    def _of_one(
        self,
        roughness: float,
        own: NDArray[np.int64] | slice,
        vectors: tuple[Array, Array, Array | None],
        f0: Array,
    ) -> Array:
        normals, views, tangents = vectors
        where = normals[own], views[own], None if tangents is None else tangents[own]
        if (f0 == f0[0]).all():
            red, green, blue = f0[0].tolist()
            return looked_up(self._surface(roughness, (red, green, blue)), where)
        surfaces = (self._surface(roughness, each) for each in (_BLACK, _WHITE))
        black, white = (looked_up(each, where) for each in surfaces)
        return black + f0 * (white - black)

    def _of(self, roughness: float, f0: Color) -> ReflectedLight:
        surface = ggx_surface(roughness, f0, self._anisotropy)
        return shown_as(self._map, surface, self._taps)
