"""glTF files, checked and rewritten into the plain GLB that trimesh reads, and their materials.

A glTF file is a text that says where in its buffers the numbers are. Every count, offset and index
of it is checked against what is really there, before anything is read by it. The GLB that is
handed on holds nodes, triangles and their attributes only: no names, addresses, images or
extensions, which trimesh might follow. Materials are factors, and textures that multiply them.
"""

from collections.abc import Callable
from dataclasses import replace
from math import cos, isfinite, sin
from pathlib import Path
from typing import Any

from shrm_cli.errors import MeshError
from shrm_cli.files import gltf
from shrm_cli.geometry.mesh import MOST_FACES, Matrix, SurfaceMaterial, Texture, Wrap, too_many

_WRAPS: dict[int, Wrap] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_NEAREST = 9728
_TRANSFORM = "KHR_texture_transform"
_STRONG = "KHR_materials_emissive_strength"
_BRIGHTEST = 1e12
"""The most radiance that a material may send."""
_MASKED = 0.5
"""Least opacity that is seen of what a file would blend with what lies behind."""
_UV_SETS = 2
_DRAWN = {_STRONG}
"""Extensions of materials that are drawn."""


class SurfaceReader:
    """Reads the materials of a file.

    `name` is the path of the file, whose textures are looked for in its folder. `tree` is its JSON.
    `buffers` returns the bytes of its buffers.
    """

    def __init__(self, name: str, tree: gltf.Json, buffers: Callable[[], list[bytes]]) -> None:
        self._name, self._tree, self._buffers = name, tree, buffers
        self._textures = gltf.list_of(tree, "textures")
        self._pictures: dict[int, Path | bytes | str] = {}

    def material(self, given: gltf.Json) -> SurfaceMaterial:
        """Return a material.

        Raises ValueError, KeyError or TypeError if it is damaged, or a texture is not beside the
        file.
        """
        pbr = gltf.table(given.get("pbrMetallicRoughness", {}))
        color = [_unit(each) for each in pbr.get("baseColorFactor", (1, 1, 1, 1))]
        if len(color) < 3:
            raise ValueError("a base colour of less than three numbers")
        extensions = gltf.table(given.get("extensions", {}))
        mode = given.get("alphaMode", "OPAQUE")
        rough = self._texture(pbr, "metallicRoughnessTexture")
        return SurfaceMaterial(
            name=str(given.get("name", ""))[:80],
            base_color=(color[0], color[1], color[2]),
            metallic=_unit(pbr.get("metallicFactor", 1)),
            roughness=_unit(pbr.get("roughnessFactor", 1)),
            color_map=self._texture(pbr, "baseColorTexture", True),
            metallic_map=rough,
            roughness_map=rough,
            normal_map=self._texture(given, "normalTexture"),
            normal_scale=_number(gltf.table(given.get("normalTexture", {})).get("scale", 1)),
            occlusion_map=self._texture(given, "occlusionTexture"),
            occlusion_strength=_unit(
                gltf.table(given.get("occlusionTexture", {})).get("strength", 1)
            ),
            emission=_emission(given, extensions),
            emission_map=self._texture(given, "emissiveTexture", True),
            opacity=color[3] if len(color) > 3 else 1.0,
            cutoff={"MASK": _unit(given.get("alphaCutoff", _MASKED)), "BLEND": _MASKED}.get(mode),
            unread=(
                *(f"alphaMode {mode}" for _ in range(mode == "BLEND")),
                *(str(each)[:40] for each in sorted(set(extensions) - _DRAWN)),
            ),
        )

    def _texture(self, held: gltf.Json, key: str, is_srgb: bool = False) -> Texture | None:
        if key not in held:
            return None
        try:
            return self._laid(held[key], is_srgb)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            return Texture(f"its {key} is damaged ({str(error)[:60]})")

    def _laid(self, given: Any, is_srgb: bool) -> Texture:
        """Return a texture as it lies over the mesh."""
        info = gltf.table(given)
        index = gltf.index_in(info["index"], self._textures)
        named = gltf.table(self._textures[index])
        samplers = gltf.list_of(self._tree, "samplers")
        sampler = gltf.table(
            samplers[gltf.index_in(named["sampler"], samplers)] if "sampler" in named else {}
        )
        moved = gltf.table(gltf.table(info.get("extensions", {})).get(_TRANSFORM, {}))
        uv_set = gltf.natural(moved.get("texCoord", info.get("texCoord", 0)))
        if uv_set >= _UV_SETS:
            raise ValueError(f"a texture over the coordinates TEXCOORD_{uv_set}")
        return Texture(
            self._picture(index, named), is_srgb, uv_set, _matrix(moved),
            (_wrap(sampler, "wrapS"), _wrap(sampler, "wrapT")),
            sampler.get("magFilter") == _NEAREST,
        )  # fmt: skip

    def _picture(self, index: int, named: gltf.Json) -> Path | bytes | str:
        """Return the picture of a texture; the same object for the same one."""
        if index not in self._pictures:
            try:
                found = gltf.picture_of(self._name, self._tree, self._buffers, named)
            except ValueError as error:
                self._pictures[index] = str(error)
            else:
                self._pictures[index] = found
        return self._pictures[index]


def _emission(given: gltf.Json, extensions: gltf.Json) -> tuple[float, float, float]:
    """Return the radiance that a material sends, its factor times its strength."""
    strength = float(gltf.table(extensions.get(_STRONG, {})).get("emissiveStrength", 1))
    if not 0 <= strength <= _BRIGHTEST:
        raise ValueError(f"an emissive strength of {strength}")
    red, green, blue = (strength * _unit(each) for each in given.get("emissiveFactor", (0, 0, 0)))
    return red, green, blue


def _wrap(sampler: gltf.Json, key: str) -> Wrap:
    value = sampler.get(key, 10497)
    if value not in _WRAPS:
        raise ValueError(f"a sampler whose {key} is {str(value)[:20]}")
    return _WRAPS[value]


def _matrix(given: gltf.Json) -> Matrix:
    """Return the matrix of KHR_texture_transform, which scales, rotates, and then moves.

    v points down, and coordinates are rotated counter-clockwise as they are seen.
    """
    (x, y), (across, down) = _pair(given, "offset", 0.0), _pair(given, "scale", 1.0)
    turn = _number(given.get("rotation", 0))
    c, s = cos(turn), sin(turn)
    return c * across, s * down, x, -s * across, c * down, y


def _pair(given: gltf.Json, key: str, default: float) -> tuple[float, float]:
    values = [_number(each) for each in given.get(key, (default, default))]
    if len(values) != 2:
        raise ValueError(f"the {key} of a texture is no pair")
    return values[0], values[1]


def _number(value: Any) -> float:
    number = float(value)
    if not isfinite(number) or abs(number) > 1e6:
        raise ValueError("a number of a material is out of range")
    return number


def _unit(value: Any) -> float:
    return min(max(_number(value), 0.0), 1.0)


_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_ATTRIBUTES = {
    "POSITION": ("POSITION", ("VEC3",)),
    "NORMAL": ("NORMAL", ("VEC3",)),
    "TANGENT": ("_TANGENT", ("VEC4",)),
    "TEXCOORD_0": ("_UV", ("VEC2",)),
    "TEXCOORD_1": ("_UV1", ("VEC2",)),
    "COLOR_0": ("_COLOR", ("VEC3", "VEC4")),
}
"""Attributes that are used: what they are called in the GLB, and their types. trimesh drops
texture coordinates without an image, but keeps attributes whose names begin with an underscore."""
_TRIANGLES, _STRIP = 4, 5
_TRANSFORMS = {"matrix": 16, "translation": 3, "rotation": 4, "scale": 3}
_MOST_PRIMITIVES = 2**12
"""The most primitives, each of which becomes a mesh of its own."""
_KNOWN = ("KHR_materials_", "KHR_texture_", "KHR_lights_", "KHR_mesh_quantization", "EXT_texture_")
"""Beginnings of extensions without which the shape of a mesh is the same."""


def read_gltf(name: str, data: bytes) -> tuple[bytes, str, list[SurfaceMaterial | None]]:
    """Check a glTF or GLB file, and return it as a plain GLB.

    Buffers in other files are looked for in its folder.

    Returns `data`, a GLB with nothing but nodes and triangles; `kind`, ``"glb"``; and `materials`,
    those of the primitives, in their order.
    """
    tree, chunk = gltf.read_tree(name, data)
    with gltf.damage(name, MeshError):
        return _rewritten(name, tree, chunk)


def _rewritten(
    name: str, tree: gltf.Json, chunk: bytes | None
) -> tuple[bytes, str, list[SurfaceMaterial | None]]:
    for needed in gltf.list_of(tree, "extensionsRequired"):
        if not str(needed).startswith(_KNOWN):
            raise MeshError(
                f"{name}: it needs the extension {str(needed)[:40]!r}; export it without"
            )
    buffers = gltf.buffers_of(name, tree, chunk)
    views = [gltf.view_of(each, buffers) for each in gltf.list_of(tree, "bufferViews")]
    _check_sum(name, [each["byteLength"] for each in views])  # trimesh copies each of them
    reader = SurfaceReader(name, tree, lambda: buffers)
    materials = [reader.material(gltf.table(each)) for each in gltf.list_of(tree, "materials")]
    # Those that vertex colours multiply; the last is glTF's own, of what has none.
    colored = [replace(each or SurfaceMaterial(), colored="linear") for each in (*materials, None)]
    plain = _Plain(name, gltf.list_of(tree, "accessors"), views)
    meshes, owners = [], []
    for mesh in gltf.list_of(tree, "meshes"):
        primitives = []
        for primitive in gltf.list_of(mesh, "primitives", required=True):
            if primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP):
                primitives.append(plain.primitive(primitive))
                place = -1
                if "material" in primitive:
                    place = gltf.index_in(primitive["material"], materials)
                known = colored if "COLOR_0" in primitive["attributes"] else [*materials, None]
                owners.append(known[place])
        meshes.append({"name": "mesh", "primitives": primitives})
    if not owners:
        raise MeshError(f"{name}: it has no triangles; export it with its faces")
    if len(owners) > _MOST_PRIMITIVES:
        raise MeshError(f"{name}: more than {_MOST_PRIMITIVES:,} primitives; join its meshes")
    _check_sum(name, plain.sizes)
    nodes = [_node(each, tree) for each in gltf.list_of(tree, "nodes")]
    roots = _roots(tree, nodes)
    _check_tree(nodes, roots)
    shown = sum(len(meshes[node["mesh"]]["primitives"]) for node in nodes if "mesh" in node)
    if shown > gltf.MOST_ITEMS:
        raise MeshError(f"{name}: it shows {shown:,} primitives; join its meshes")
    header = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": roots}],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": plain.accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(each)} for each in buffers],
    }
    return gltf.glb(header, buffers), "glb", owners


def _check_sum(name: str, sizes: list[int]) -> None:
    """Refuse parts that are read from the same bytes again and again."""
    if sum(sizes) > 2 * gltf.MOST_BYTES:
        raise MeshError(f"{name}: it reads {sum(sizes):,} bytes of its buffers; export it again")


def _check_tree(nodes: list[gltf.Json], roots: list[int]) -> None:
    """Refuse nodes that are shown from more than one place, and so circles."""
    shown = roots + [child for node in nodes for child in node.get("children", ())]
    if len(set(shown)) < len(shown):
        raise ValueError("a node with several parents")


class _Plain:
    """Checks what primitives name, and writes down the accessors that they use, and their bytes."""

    def __init__(self, name: str, accessors: list[gltf.Json], views: list[gltf.Json]) -> None:
        self.name, self._given, self._views = name, accessors, views
        self.accessors: list[gltf.Json] = []
        self.sizes: list[int] = []
        self._places: dict[int, int] = {}

    def primitive(self, primitive: gltf.Json) -> gltf.Json:
        """Return a primitive with the attributes that are used."""
        given = gltf.table(primitive["attributes"])
        kept = {}
        for label, (known, types) in _ATTRIBUTES.items():
            if label in given:
                kept[known] = self._accessor(given[label], types)
        count = self.accessors[kept["POSITION"]]["count"]
        if any(self.accessors[place]["count"] != count for place in kept.values()):
            raise ValueError("attributes of different numbers of vertices")
        result: gltf.Json = {"attributes": kept, "mode": primitive.get("mode", _TRIANGLES)}
        if "indices" in primitive:
            result["indices"] = self._accessor(primitive["indices"], ("SCALAR",))
            count = self.accessors[result["indices"]]["count"]
        if result["mode"] == _TRIANGLES and count % 3:
            raise ValueError("triangles of less than three corners")
        if count > 3 * MOST_FACES:
            raise too_many(self.name, count // 3)
        return result

    def _accessor(self, index: Any, types: tuple[str, ...]) -> int:
        """Return the place of an accessor among those that are used, after checking its bounds."""
        number = gltf.index_in(index, self._given)
        given = gltf.table(self._given[number])
        if "sparse" in given or "bufferView" not in given:
            raise MeshError(f"{self.name}: sparse or compressed accessors; export it without")
        kind, component = given["type"], given["componentType"]
        if kind not in types:
            raise ValueError(f"an accessor of type {str(kind)[:20]}")
        if component not in _BYTES:
            raise ValueError("an accessor of no known component type")
        view = self._views[gltf.index_in(given["bufferView"], self._views)]
        count, start = gltf.natural(given["count"]), gltf.natural(given.get("byteOffset", 0))
        width = _COLUMNS[kind] * _BYTES[component]
        stride = view.get("byteStride", width)
        if count < 1 or stride < width or start + (count - 1) * stride + width > view["byteLength"]:
            raise MeshError(
                f"{self.name}: it declares {count:,} elements, more than its buffer holds; "
                "copy or export it again"
            )
        if number not in self._places:
            self._places[number] = len(self.accessors)
            self.sizes.append(count * width)
            self.accessors.append({
                "bufferView": given["bufferView"], "byteOffset": start, "componentType": component,
                "count": count, "type": kind,
            })  # fmt: skip
        return self._places[number]


def _node(given: gltf.Json, tree: gltf.Json) -> gltf.Json:
    result: gltf.Json = {}
    if "mesh" in given:
        result["mesh"] = gltf.index_in(given["mesh"], gltf.list_of(tree, "meshes"))
    children = gltf.list_of(given, "children")
    if children:
        result["children"] = [gltf.index_in(each, gltf.list_of(tree, "nodes")) for each in children]
    for key, length in _TRANSFORMS.items():
        if key in given:
            numbers = [float(each) for each in given[key]]
            if len(numbers) != length or not all(isfinite(each) for each in numbers):
                raise ValueError(f"a {key} of other than {length} numbers")
            result[key] = numbers
    return result


def _roots(tree: gltf.Json, nodes: list[gltf.Json]) -> list[int]:
    """Return the nodes that the scene begins with; without a scene, those that have no parent."""
    scenes = gltf.list_of(tree, "scenes")
    if scenes:
        scene = scenes[gltf.index_in(tree.get("scene", 0), scenes)]
        return [gltf.index_in(each, nodes) for each in gltf.list_of(scene, "nodes")]
    owned = {child for node in nodes for child in node.get("children", ())}
    return [index for index in range(len(nodes)) if index not in owned]
