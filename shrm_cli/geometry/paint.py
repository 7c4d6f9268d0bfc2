"""What materials are at points of a mesh: numbers times textures times vertex colours."""

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.color import srgb_to_linear
from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import Mesh, SurfaceMaterial, Texture
from shrm_cli.geometry.tangents import perpendicular
from shrm_cli.geometry.textures import FINER, Shelf
from shrm_cli.records import record
from shrm_cli.vocabulary import MIN_ROUGHNESS

_LEAST_AREA = 1e-20


@record(eq=False)
class Points:
    """Points of a mesh under pixels."""

    mesh: Mesh
    faces: NDArray[np.int64]
    """Shape (n,)."""
    weights: Array
    """Barycentric coordinates, shape (n, 3)."""
    steps: Array
    """How the point in the triangle's plane moves to the next pixel to the right, and upwards,
    shape (n, 3, 2)."""
    finer: int = FINER
    """How finely textures are averaged, as `MipMap.at` takes it. One of 1 and 2."""

    def over(self, uv_set: int) -> tuple[Array, Array]:
        """Return texture coordinates (n, 2), and their changes to the next pixels (n, 2, 2)."""
        uvs = self.mesh.uvs_1 if uv_set else self.mesh.uvs
        assert uvs is not None, "a Paint is made of a mesh that has those of its textures"
        corners = uvs[self.mesh.faces[self.faces]]
        middle = np.einsum("kc,kcv->kv", self.weights, corners)
        return middle, np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2) @ self._shares

    @cached_property
    def _shares(self) -> Array:
        """How the weights of the second and third corner change, shape (n, 2, 2)."""
        corners = self.mesh.corners(self.faces)
        edges = corners[:, 1:] - corners[:, :1]  # (n, 2, 3)
        scale = np.abs(edges).max(axis=(1, 2))[:, None, None]
        unit = edges / scale
        (a, b), (_, d) = np.moveaxis(unit @ np.swapaxes(unit, 1, 2), 0, -1)
        # Triangles have areas, but those of slivers may be lost to rounding.
        adjoint = np.moveaxis(np.array([[d, -b], [-b, a]]), -1, 0)
        inverse = adjoint / np.maximum(a * d - b * b, _LEAST_AREA)[:, None, None]
        return inverse @ (unit @ (self.steps / scale))


_POINTS_AT_ONCE = 2**16
"""The most points whose textures are looked up at a time."""


def points_of(
    mesh: Mesh, material: int, faces: NDArray[np.int64], weights: Array, steps: Array | None = None
) -> Iterator[tuple[NDArray[np.int64], Points]]:
    """Yield the points of a mesh that are of a material, some at a time, and which of all they are.

    `faces`, `weights` and `steps` are as of `Points`; without steps points have no size.
    """
    own = np.flatnonzero(mesh.face_materials[faces] == material)
    for part in slices(len(own), _POINTS_AT_ONCE):
        some = own[part]
        sides = np.zeros((len(some), 3, 2)) if steps is None else steps[some]
        yield some, Points(mesh, faces[some], weights[some], sides)


def linear_colors(colors: Array, encoding: str) -> Array:
    """Return linear colours of vertices of colours as a file has them, within 0 .. 1."""
    within = np.clip(colors, 0, 1)
    return srgb_to_linear(within) if encoding == "srgb" else within


@record(eq=False)
class Painted:
    """What a material is at n points."""

    base_color: Array
    emission: Array
    """`base_color` and `emission`: shape (n, 3)."""
    metallic: Array
    roughness: Array
    occlusion: Array
    """`metallic`, `roughness` and `occlusion`: shape (n,)."""


class Paint:
    """A material with its textures opened.

    `matrix`, of shape (3, 3), leads from Rec.709 to the primaries of the light.

    `normal_set` is the set of texture coordinates of its normal map; -1 without any.
    """

    def __init__(
        self, mesh: Mesh, material: SurfaceMaterial, shelf: Shelf, matrix: Array | None = None
    ) -> None:
        self.material, self._matrix = material, matrix
        self._maps = {each: shelf.open(mesh.name, each) for each in material.textures}
        normals = material.normal_map
        self.normal_set = -1
        if normals is not None and not self._maps[normals].is_gray:
            self.normal_set = normals.uv_set
        for each in material.textures:
            if (mesh.uvs_1 if each.uv_set else mesh.uvs) is None:
                raise MeshError(
                    f"{mesh.name}: the texture coordinates of the material {material.name!r} are "
                    f"missing or damaged; export them, or {shelf.otherwise}"
                )

    @property
    def is_rough_by_texture(self) -> bool:
        """Whether a texture has its roughness or metallic."""
        return bool(self.material.metallic_map or self.material.roughness_map)

    @property
    def roughness_range(self) -> tuple[float, float]:
        """The least and the largest roughness."""
        given, texture = self.material, self.material.roughness_map
        found = (
            (1.0, 1.0) if texture is None else self._maps[texture].range(given.roughness_channel)
        )
        low, high = np.clip(np.round(given.roughness * np.array(found), 3), MIN_ROUGHNESS, 1)
        return float(low), float(high)

    @property
    def has_diffuse(self) -> bool:
        is_metal = self.material.metallic == 1 and self.material.metallic_map is None
        return any(self.material.base_color) and not is_metal

    @property
    def unread(self) -> list[str]:
        """What the file says of the material and is not drawn."""
        own = self.material.normal_map
        gray = ["heights of its bump map"] if own is not None and self.normal_set < 0 else []
        return [*self.material.unread, *gray]

    def at(self, points: Points) -> Painted:
        """Return what the material is at points."""
        given = self.material
        rough = self._read(points, given.roughness_map)[:, given.roughness_channel]
        metal = self._read(points, given.metallic_map)[:, given.metallic_channel]
        light = self._read(points, given.occlusion_map)[:, 0]
        return Painted(
            self.base_color(points),
            self.emission(points),
            np.clip(given.metallic * metal, 0, 1),
            np.clip(given.roughness * rough, MIN_ROUGHNESS, 1),
            1 + given.occlusion_strength * (np.clip(light, 0, 1) - 1),
        )

    def base_color(self, points: Points) -> Array:
        """Return its base colour at points, shape (n, 3)."""
        given = self.material
        color = np.array(given.base_color) * self._read(points, given.color_map)[:, :3]
        if given.colored and points.mesh.colors is not None:
            linear = linear_colors(points.mesh.colors, given.colored)
            color = color * points.mesh.interpolated(linear, points.faces, points.weights)
        return np.clip(self._in_primaries(color), 0, 1)

    def emission(self, points: Points) -> Array:
        """Return what it emits at points, shape (n, 3)."""
        given = self.material
        if not any(given.emission):
            return np.zeros((len(points.faces), 3))
        emission = np.array(given.emission) * self._read(points, given.emission_map)[:, :3]
        return np.maximum(self._in_primaries(emission), 0)

    @property
    def has_holes(self) -> bool:
        """Whether some of its texture is cut out."""
        given, texture = self.material, self.material.color_map
        if given.cutoff is None or texture is None:
            return False
        return given.opacity * self._maps[texture].range(3)[0] < given.cutoff

    def visible(self, points: Points) -> NDArray[np.bool_]:
        """Return whether points are seen: those that are not cut out by their opacity."""
        opacity = self.material.opacity * self._read(points, self.material.color_map)[:, 3]
        return opacity >= (self.material.cutoff or 0.0)

    def bent(self, points: Points, normals: Array, tangents: Array) -> Array:
        """Return normals as the normal map turns them, shape (n, 3).

        `normals`, of shape (n, 3), are unit, on the side of the triangles that is their front.
        `tangents`, of shape (n, 4), are the direction in which u grows, of any length, and the sign
        of v's direction N x T.
        """
        texture = self.material.normal_map
        if texture is None or self.normal_set < 0:
            return normals
        local = 2 * self._read(points, texture)[:, :3] - 1
        local[:, :2] *= self.material.normal_scale
        local[:, :2] = local[:, :2] @ self._maps[texture].axes.T
        along = perpendicular(tangents[:, :3], normals)
        across = np.sign(tangents[:, 3:]) * np.cross(normals, along)
        found = local[:, :1] * along + local[:, 1:2] * across + local[:, 2:] * normals
        length = np.linalg.norm(found, axis=1, keepdims=True)
        return np.where(length > 1e-6, found / np.maximum(length, 1e-6), normals)

    def _read(self, points: Points, texture: Texture | None) -> Array:
        if texture is None:
            return np.ones((len(points.faces), 4))
        return self._maps[texture].at(*points.over(texture.uv_set), points.finer)

    def _in_primaries(self, colors: Array) -> Array:
        return colors if self._matrix is None else colors @ self._matrix.T
