"""Meshes of glTF files, each where the nodes of the scene put it, in the pose of the file.

Of what is animated, joints are where their nodes are, and shapes are blended by the weights that
the file begins with.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.files import gltf
from shrm_cli.geometry.gltf_accessors import Accessors
from shrm_cli.geometry.gltf_materials import SurfaceReader
from shrm_cli.geometry.mesh import (
    MOST_FACES,
    Integers,
    Mesh,
    SurfaceMaterial,
    face_normals,
    first_places,
    joined,
    make_mesh,
    too_many,
)  # fmt: skip
from shrm_cli.records import record

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_TRANSFORMS = {"matrix": 16, "translation": 3, "rotation": 4, "scale": 3}
_INSTANCES = "EXT_mesh_gpu_instancing"
_MOST_PRIMITIVES = 2**12
"""The most primitives, each of which becomes a mesh of its own."""
_MOST_BLENDED = 2**26
"""The most vertices that are moved by shapes, each of which counts for every shape."""
_NO_ROWS = np.zeros(0, np.int64)
"""Rows of the vertices of the file are found once for all parts."""
_MOST_STEPS = 64
"""The most nodes on the way from the root of a scene to a mesh."""
_KNOWN = (
    "KHR_materials_", "KHR_texture_", "KHR_lights_", "KHR_mesh_quantization", "EXT_texture_",
    _INSTANCES,
)  # fmt: skip
"""Beginnings of extensions that are read, or without which the shape of a mesh is the same."""


def read_gltf(name: str, data: bytes) -> Mesh:
    """Read a glTF or GLB file. Buffers in other files are looked for in its folder."""
    tree, chunk = gltf.read_tree(name, data)
    with gltf.damage(name, MeshError):
        for needed in gltf.list_of(tree, "extensionsRequired"):
            if not str(needed).startswith(_KNOWN):
                raise MeshError(
                    f"{name}: it needs the extension {str(needed)[:40]!r}; export it without"
                )
        return _File(name, tree, gltf.buffers_of(name, tree, chunk)).mesh()


@record(eq=False)
class _Part:
    """A primitive of triangles, in the axes of its mesh, with the vertices that these use."""

    positions: Array
    """Shape (n, 3)."""
    normals: Array | None
    """Shape (n, 3); None where the file has none, and triangles are flat."""
    faces: Integers
    numbers: Integers
    """The numbers of its vertices among those of the file, shape (n,)."""
    joints: tuple[tuple[NDArray[np.number], Array], ...]
    """The joints that move each vertex, and their shares of it, each of shape (n, 4)."""
    more: dict[str, Any]
    """Other arguments of `make_mesh` that its vertices have, by their names."""
    material: SurfaceMaterial | None

    def mesh(self, name: str, skin: Array | None = None) -> Mesh:
        """Return it as a mesh; `skin` holds matrices of the joints, shape (k, 4, 4)."""
        positions, normals, faces, more = self.positions, self.normals, self.faces, self.more
        if skin is not None:
            positions, normals = _moved(positions, normals, self._blended(skin))
        own = np.arange(len(positions))
        if skin is not None or normals is None:
            more = {key: values for key, values in more.items() if key != "tangents"}
        if normals is None:
            # Flat triangles share no vertices.
            own, positions = faces.ravel(), positions[faces.ravel()]
            more = {key: values[own] for key, values in more.items()}
            faces = np.arange(len(own)).reshape(-1, 3)
            normals = np.repeat(face_normals(positions, faces), 3, axis=0)
        return make_mesh(
            name, positions, faces, normals, **more,
            materials=() if self.material is None else (self.material,),
            file_vertices=self.numbers[own], file_rows=_NO_ROWS,
        )  # fmt: skip

    def _blended(self, skin: Array) -> Array:
        """Return the matrix that moves each vertex, shape (n, 4, 4)."""
        total, whole = np.zeros((len(self.positions), 4, 4)), np.zeros(len(self.positions))
        for joints, shares in self.joints:
            if joints.max() >= len(skin):
                raise ValueError("a joint that its skin has not")
            for joint, share in zip(joints.T, shares.T, strict=True):
                total += share[:, None, None] * skin[joint]
                whole += share
        bare = whole <= 0
        total[bare], whole[bare] = np.eye(4), 1
        return total / whole[:, None, None]


def _moved(positions: Array, normals: Array | None, matrices: Array) -> tuple[Array, Array | None]:
    """Return positions and normals, each moved by a matrix of its own."""
    linear = matrices[:, :3, :3]
    moved = np.einsum("nij,nj->ni", linear, positions) + matrices[:, :3, 3]
    if normals is None:
        return moved, None
    # The cofactors of a matrix keep normals perpendicular, and exist where it has no inverse.
    x, y, z = np.moveaxis(linear, 2, 0)
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=-1)
    return moved, np.einsum("nij,nj->ni", cofactors, normals)


class _File:
    """What is read of a file. `tree` is its JSON."""

    def __init__(self, name: str, tree: gltf.Json, buffers: list[bytes]) -> None:
        self._name, self._tree = name, tree
        self._accessors = Accessors(name, tree, buffers)
        reader = SurfaceReader(name, tree, lambda: buffers)
        given = gltf.list_of(tree, "materials")
        self._materials = [reader.material(gltf.table(each), k) for k, each in enumerate(given)]
        # Those that vertex colours multiply; the last is glTF's own, of what has none.
        every: list[SurfaceMaterial | None] = [*self._materials, None]
        self._colored = [replace(each or SurfaceMaterial(), colored="linear") for each in every]
        self._nodes = [gltf.table(each) for each in gltf.list_of(tree, "nodes")]
        self._vertices = self._steps = 0
        self._firsts: dict[int, int] = {}

    def mesh(self) -> Mesh:
        """Return all meshes that the scene shows as one."""
        parts = [
            self._parts(gltf.list_of(each, "primitives", required=True), gltf.table(each))
            for each in gltf.list_of(self._tree, "meshes")
        ]
        if not any(parts):
            raise self._empty()
        if sum(map(len, parts)) > _MOST_PRIMITIVES:
            raise MeshError(
                f"{self._name}: more than {_MOST_PRIMITIVES:,} primitives; join its meshes"
            )
        drawn = [
            parts[gltf.index_in(node["mesh"], parts)] if "mesh" in node else []
            for node in self._nodes
        ]
        instances = [self._instances(node) for node in self._nodes]
        count = sum(len(some) * _count(each) for some, each in zip(drawn, instances, strict=True))
        if count > gltf.MOST_ITEMS:  # to place them all would take long
            raise MeshError(f"{self._name}: its nodes show {count:,} primitives; join its meshes")
        places = self._places()
        shown = [
            (each, some, self._nodes[each])
            for each, some in enumerate(drawn)
            if some and each in places and places[each][:3, :3].any()
        ]
        total = sum(
            len(part.faces) * _count(instances[each]) for each, some, _ in shown for part in some
        )
        if total > MOST_FACES:
            raise too_many(self._name, total)
        made: dict[int, Mesh] = {}
        meshes = []
        for each, some, node in shown:
            skin = self._skin(node, places) if "skin" in node else None
            for part in some:
                if skin is not None and part.joints:
                    meshes.append(part.mesh(self._name, skin))
                    continue
                if id(part) not in made:
                    made[id(part)] = part.mesh(self._name)
                meshes += [
                    made[id(part)].transformed(places[each] @ own)
                    for own in _matrices(instances[each])
                ]
        if not meshes:
            raise self._empty()
        found = joined(self._name, meshes)
        return replace(found, file_rows=first_places(found.file_vertices, self._vertices))

    def _empty(self) -> MeshError:
        return MeshError(f"{self._name}: it has no triangles; export it with its faces")

    # ---- primitives --------------------------------------------------------------------------

    def _parts(self, primitives: list[Any], mesh: gltf.Json) -> list[_Part]:
        weights = [float(each) for each in gltf.list_of(mesh, "weights")]
        return [
            self._part(gltf.table(each), weights)
            for each in primitives
            if each.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP, _FAN)
        ]

    def _part(self, given: gltf.Json, weights: list[float]) -> _Part:
        of, attributes = self._accessors, gltf.table(given["attributes"])
        positions: Array = of.values(attributes["POSITION"], "VEC3")
        normals: Array | None = None
        if "NORMAL" in attributes:
            normals = of.values(attributes["NORMAL"], "VEC3")
        more: dict[str, Any] = {}
        if "TANGENT" in attributes:
            more["tangents"] = of.values(attributes["TANGENT"], "VEC4")
        for key, label in (("uvs", "TEXCOORD_0"), ("uvs_1", "TEXCOORD_1")):
            if label in attributes:
                more[key] = of.values(attributes[label], "VEC2")
        if "COLOR_0" in attributes:
            more["colors"] = of.values(attributes["COLOR_0"], "VEC3", "VEC4", is_share=True)
        joints = tuple(
            (of.numbers(attributes[f"JOINTS_{k}"], "VEC4"),
             of.values(attributes[f"WEIGHTS_{k}"], "VEC4", is_share=True))
            for k in range(2) if f"JOINTS_{k}" in attributes
        )  # fmt: skip
        held = [*more.values(), *(each for pair in joints for each in pair)]
        held += [] if normals is None else [normals]
        if any(len(each) != len(positions) for each in held):
            raise ValueError("attributes of different numbers of vertices")
        faces = self._faces(given, len(positions))
        first = self._first_number(attributes["POSITION"], len(positions))
        # Many primitives may share the vertices of a whole scene.
        used, corners = np.unique(faces, return_inverse=True)
        more = {key: values[used] for key, values in more.items()}
        for key in more.keys() & {"uvs", "uvs_1"}:
            more[key] = more[key] * [1, -1] + [0, 1]  # its v points down
        joints = tuple((which[used], shares[used]) for which, shares in joints)
        positions, normals = self._blended(
            given, weights, used, positions[used], None if normals is None else normals[used]
        )
        place, known = -1, self._colored if "colors" in more else [*self._materials, None]
        if "material" in given:
            place = gltf.index_in(given["material"], self._materials)
        return _Part(
            positions, normals, corners.reshape(-1, 3), first + used, joints, more, known[place],
        )  # fmt: skip

    def _first_number(self, accessor: int, count: int) -> int:
        """Return the number of the first of so many vertices among those of the file.

        Primitives that name the same positions have the same vertices.
        """
        if accessor not in self._firsts:
            self._firsts[accessor], self._vertices = self._vertices, self._vertices + count
        return self._firsts[accessor]

    def _blended(
        self,
        given: gltf.Json,
        weights: list[float],
        used: Integers,
        positions: Array,
        normals: Array | None,
    ) -> tuple[Array, Array | None]:
        """Return positions and normals of the used vertices, as the weights blend them."""
        of = self._accessors
        for weight, target in zip(weights, gltf.list_of(given, "targets"), strict=False):
            if not weight:
                continue
            self._steps += len(used)
            if self._steps > _MOST_BLENDED:
                raise MeshError(f"{self._name}: its shapes are blended of too many; export one")
            if "POSITION" in target:
                positions = positions + weight * of.values(target["POSITION"], "VEC3")[used]
            if normals is not None and "NORMAL" in target:
                normals = normals + weight * of.values(target["NORMAL"], "VEC3")[used]
        return positions, normals

    def _faces(self, given: gltf.Json, count: int) -> Integers:
        """Return the triangles of a primitive, shape (m, 3)."""
        corners = np.arange(count)
        if "indices" in given:
            found = self._accessors.numbers(given["indices"], "SCALAR")[:, 0]
            if found.dtype.kind != "u":
                raise ValueError("indices that are no natural numbers")
            corners = found.astype(np.int64)
        mode = given.get("mode", _TRIANGLES)
        if len(corners) < 3 or (mode == _TRIANGLES and len(corners) % 3):
            raise ValueError("triangles of less than three corners")
        if mode == _TRIANGLES:
            faces = corners.reshape(-1, 3)
        elif mode == _FAN:
            middle = np.broadcast_to(corners[:1], len(corners) - 2)
            faces = np.stack([middle, corners[1:-1], corners[2:]], axis=1)
        else:
            faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
            faces[1::2] = faces[1::2, [1, 0, 2]]
        if len(faces) > MOST_FACES:
            raise too_many(self._name, len(faces))
        if int(faces.max()) >= count:
            raise MeshError(
                f"{self._name}: a triangle names a vertex that is not there; export the mesh again"
            )
        return faces

    # ---- nodes -------------------------------------------------------------------------------

    def _places(self) -> dict[int, Array]:
        """Return the matrices from the axes of the nodes that the scene shows to the world's."""
        steps: list[tuple[int, Array, int]] = [(each, np.eye(4), 0) for each in self._roots()]
        places: dict[int, Array] = {}
        while steps:
            number, above, depth = steps.pop()
            if number in places:
                raise ValueError("a node with several parents")
            if depth > _MOST_STEPS:
                raise ValueError("its nodes are nested too deeply")
            node = self._nodes[number]
            places[number] = above @ _matrix(node)
            steps += [(child, places[number], depth + 1) for child in self._children(node)]
        return places

    def _instances(self, node: gltf.Json) -> dict[str, Array]:
        """Return the transforms of the instances of a node's mesh, or none of a mesh by itself."""
        extension = gltf.table(gltf.table(node.get("extensions", {})).get(_INSTANCES, {}))
        given = gltf.table(extension.get("attributes", {}))
        found: dict[str, Array] = {
            key: self._accessors.values(given[key.upper()], f"VEC{_TRANSFORMS[key]}")
            for key in ("translation", "rotation", "scale")
            if key.upper() in given
        }
        if len({len(each) for each in found.values()}) > 1:
            raise ValueError("instances of different numbers")
        return found

    def _children(self, node: gltf.Json) -> list[int]:
        return [gltf.index_in(each, self._nodes) for each in gltf.list_of(node, "children")]

    def _roots(self) -> list[int]:
        """Return the nodes that the scene begins with; without one, those that have no parent."""
        scenes = gltf.list_of(self._tree, "scenes")
        if scenes:
            scene = scenes[gltf.index_in(self._tree.get("scene", 0), scenes)]
            return [gltf.index_in(each, self._nodes) for each in gltf.list_of(scene, "nodes")]
        owned = {child for node in self._nodes for child in self._children(node)}
        return [each for each in range(len(self._nodes)) if each not in owned]

    def _skin(self, node: gltf.Json, places: dict[int, Array]) -> Array:
        """Return the matrices from a mesh at rest to the world, one for each joint."""
        skins = gltf.list_of(self._tree, "skins")
        skin = gltf.table(skins[gltf.index_in(node["skin"], skins)])
        joints = [places[each] for each in gltf.list_of(skin, "joints", required=True)]
        result = np.stack(joints)
        if "inverseBindMatrices" not in skin:
            return result
        rest = self._accessors.values(skin["inverseBindMatrices"], "MAT4")
        if len(rest) < len(result):
            raise ValueError("less matrices than joints")
        # The file has columns one after the other.
        return result @ np.swapaxes(rest[: len(result)].reshape(-1, 4, 4), 1, 2)


def _count(instances: dict[str, Array]) -> int:
    """Return how often a node shows its mesh."""
    return len(next(iter(instances.values()), [0]))


def _matrices(instances: dict[str, Array]) -> Iterator[Array]:
    """Yield the matrices from the axes of a mesh to those of its node, for each instance."""
    for each in range(_count(instances)):
        yield _matrix({key: values[each] for key, values in instances.items()})


def _matrix(node: gltf.Json) -> Array:
    """Return the matrix of a node, shape (4, 4)."""
    found = dict(_numbers(node))
    if "matrix" in found:
        return found["matrix"].reshape(4, 4).T
    result = np.eye(4)
    result[:3, :3] = _rotation(found.get("rotation", np.array([0.0, 0, 0, 1])))
    result[:3, :3] *= found.get("scale", np.ones(3))
    result[:3, 3] = found.get("translation", np.zeros(3))
    return result


def _numbers(node: gltf.Json) -> Iterator[tuple[str, Array]]:
    for key, length in _TRANSFORMS.items():
        if key in node:
            numbers = [float(each) for each in node[key]]
            if len(numbers) != length or not all(isfinite(each) for each in numbers):
                raise ValueError(f"a {key} of other than {length} numbers")
            yield key, np.array(numbers)


def _rotation(quaternion: Array) -> Array:
    """Return the matrix of a rotation (x, y, z, w), shape (3, 3)."""
    length = np.linalg.norm(quaternion)
    x, y, z, w = quaternion / length if length > 0 else (0, 0, 0, 1)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
