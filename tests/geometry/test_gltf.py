"""What glTF files may say of meshes, beside the same meshes in plain words."""

import copy
import tracemalloc

import numpy as np
import pytest

from shrm_cli.errors import MeshError
from shrm_cli.files import gltf as gltf_json
from shrm_cli.geometry import gltf
from shrm_cli.geometry.load import load_mesh
from shrm_cli.geometry.mesh import face_normals
from tests.geometry.shapes import TETRAHEDRON, glb, gltf_tree

TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
COLUMNS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class File:
    """A glTF file that grows."""

    def __init__(self, vertices=TETRAHEDRON[0], faces=TETRAHEDRON[1], **given):
        self.tree, self.data = gltf_tree(vertices, faces, **given)
        self.primitive = self.tree["meshes"][0]["primitives"][0]

    def view(self, values):
        """Add numbers to the buffer, and return the place of their view."""
        self.data += bytes(-len(self.data) % 4)
        raw = np.ascontiguousarray(values).tobytes()
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)}
        self.tree["bufferViews"].append(view)
        self.data += raw
        self.tree["buffers"][0]["byteLength"] = len(self.data)
        return len(self.tree["bufferViews"]) - 1

    def accessor(self, values, kind="f4", **more):
        """Add an array, and return the place of its accessor."""
        values = np.asarray(values, f"<{kind}").reshape(len(values), -1)
        self.tree["accessors"].append({
            "bufferView": self.view(values), "componentType": TYPES[kind], "count": len(values),
            "type": COLUMNS[values.shape[1]], **more,
        })  # fmt: skip
        return len(self.tree["accessors"]) - 1

    def load(self, folder):
        path = folder / "a.glb"
        path.write_bytes(glb(copy.deepcopy(self.tree), self.data))
        return load_mesh(path)


def test_integers_stand_for_fractions_where_the_file_says_so(tmp_path):
    """As programs write them that shrink files, beside a node that gives them their size."""
    file = File(node={"scale": [2, 2, 2], "translation": [10, 0, 0]})
    whole = {"i1": 127, "u1": 255, "i2": 32767, "u2": 65535}
    for kind, most in whole.items():
        place = file.accessor(TETRAHEDRON[0] * most, kind, normalized=True)
        file.primitive["attributes"]["POSITION"] = place
        assert file.load(tmp_path).bounds.tolist() == [[10, 0, 0], [12, 2, 2]]
    file.primitive["attributes"]["POSITION"] = file.accessor(TETRAHEDRON[0] * 100, "u1")
    assert file.load(tmp_path).bounds.tolist() == [[10, 0, 0], [210, 200, 200]]
    uvs = np.array([(0, 0), (1, 0), (1, 1), (0.5, 1)])
    corners = TETRAHEDRON[1].ravel()
    for kind, given in (("u2", {"normalized": True}), ("i2", {"normalized": True}), ("u2", {})):
        share = whole[kind] if given else 1000
        place = file.accessor(np.round(uvs * share), kind, **given)
        file.primitive["attributes"]["TEXCOORD_0"] = place
        expected = np.array(uvs if given else uvs * 1000) * [1, -1] + [0, 1]
        np.testing.assert_allclose(file.load(tmp_path).uvs, expected[corners], atol=1e-4)


def test_triangles_without_normals_are_flat(tmp_path):
    """As the format has it; smooth ones would round the edges of a box off."""
    mesh = File(uvs=np.arange(8).reshape(4, 2)).load(tmp_path)
    flat = face_normals(*TETRAHEDRON)
    np.testing.assert_allclose(mesh.normals[mesh.faces], np.repeat(flat[:, None], 3, axis=1))
    corners = TETRAHEDRON[1]
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], TETRAHEDRON[0][corners])
    np.testing.assert_array_equal(mesh.uvs[mesh.faces][..., 0], 2 * corners)
    np.testing.assert_array_equal(mesh.file_vertices[mesh.faces], corners)
    np.testing.assert_array_equal(mesh.file_vertices[mesh.file_rows], np.arange(4))


@pytest.mark.parametrize("is_indexed", [True, False])
def test_strips_and_fans_are_triangles(tmp_path, is_indexed):
    """A square of 2 x 1 from its six corners; strips turn every second triangle round."""
    square = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (0, 1, 0)], float)
    for mode, order in ((5, [5, 0, 4, 1, 3, 2]), (6, [0, 2, 3, 4, 5])):
        file = File(square if is_indexed else square[order])
        file.primitive["mode"] = mode
        del file.primitive["indices"]
        if is_indexed:
            file.primitive["indices"] = file.accessor(order, "u2")
        mesh = file.load(tmp_path)
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
        areas = np.cross(b - a, c - a)[:, 2] / 2
        assert (areas > 0).all()
        assert areas.sum() == pytest.approx(2)


def test_elements_are_replaced_that_a_file_lists(tmp_path):
    file = File()
    sparse = {
        "count": 1,
        "indices": {"bufferView": file.view(np.array([3], "<u2")), "componentType": 5123},
        "values": {"bufferView": file.view(np.array([0, 0, 7], "<f4"))},
    }
    file.tree["accessors"][0]["sparse"] = sparse
    assert file.load(tmp_path).bounds[1].tolist() == [1, 1, 7]
    file.tree["accessors"][0]["sparse"]["count"] = 2
    with pytest.raises(MeshError, match="declares 2 elements"):
        file.load(tmp_path)
    sparse["count"] = 1
    sparse["indices"]["bufferView"] = file.view(np.array([4], "<u2"))
    with pytest.raises(MeshError, match="beyond its accessor"):
        file.load(tmp_path)


def test_what_a_node_hides_is_not_drawn(tmp_path):
    file = File()
    file.tree["nodes"].append({"mesh": 0, "scale": [0, 0, 0], "translation": [9, 9, 9]})
    file.tree["scenes"][0]["nodes"].append(1)
    assert file.load(tmp_path).bounds.tolist() == [[0, 0, 0], [1, 1, 1]]


def test_instances_are_where_their_attributes_put_them(tmp_path):
    """Turned about +Y by integers that stand for fractions, before the node moves them all."""
    file = File(node={"translation": [10, 0, 0]})
    turns = np.round(32767 * np.array([[0, 0, 0, 1], [0, np.sqrt(0.5), 0, np.sqrt(0.5)]]))
    attributes = {
        "TRANSLATION": file.accessor([[0, 0, 0], [0, 5, 0]]),
        "ROTATION": file.accessor(turns, "i2", normalized=True),
        "SCALE": file.accessor([[1, 1, 1], [2, 3, 4]]),
    }
    extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    file.tree["nodes"][0]["extensions"] = extension
    file.tree["extensionsRequired"] = list(extension)
    corners = TETRAHEDRON[0]
    x, y, z = (corners * [2, 3, 4]).T
    expected = np.concatenate([corners, np.stack([z, y + 5, -x], axis=-1)])
    expected[:, 0] += 10
    found = file.load(tmp_path).vertices
    assert {tuple(each) for each in found.round(3)} == {tuple(each) for each in expected.round(3)}
    attributes["SCALE"] = file.accessor([[1, 1, 1]])
    with pytest.raises(MeshError, match="instances of different numbers"):
        file.load(tmp_path)


def test_instances_are_counted_before_they_are_placed(tmp_path, monkeypatch):
    monkeypatch.setattr(gltf_json, "MOST_ITEMS", 7)
    for count in (7, 8):
        file = File()
        attributes = {"TRANSLATION": file.accessor(np.zeros((count, 3)))}
        file.tree["nodes"][0]["extensions"] = {
            "EXT_mesh_gpu_instancing": {"attributes": attributes}
        }
        if count == 7:
            assert len(file.load(tmp_path).faces) == 7 * len(TETRAHEDRON[1])
            continue
        with pytest.raises(MeshError, match="show 8 primitives"):
            file.load(tmp_path)


def test_units_may_be_of_any_size(tmp_path):
    """A node takes a mesh of a billion units to a hundredth of one."""
    mesh = File(TETRAHEDRON[0] * 1e9, node={"scale": [1e-11] * 3}).load(tmp_path)
    np.testing.assert_allclose(mesh.bounds, [[0, 0, 0], [0.01, 0.01, 0.01]])


def test_joints_are_where_their_nodes_are(tmp_path):
    """Two vertices follow a joint that is turned about +Z, and one both of them by halves."""
    outwards = TETRAHEDRON[0] - 0.25
    file = File(node={"skin": 0, "translation": [50, 0, 0]}, normals=outwards)
    joints, shares = np.zeros((4, 4)), np.zeros((4, 4))
    joints[:, 1] = 1
    shares[:, 0], shares[2:, 0], shares[2, 1], shares[3, 1] = 1, 0, 1, 0.5
    shares[3, 0] = 0.5
    file.primitive["attributes"] |= {
        "JOINTS_0": file.accessor(joints, "u1"),
        "WEIGHTS_0": file.accessor(shares),
    }
    move = np.eye(4)
    move[:3, 3] = 0, -1, 0  # the second joint is at (0, 1, 0) at rest
    rest = [np.eye(4).T.ravel(), move.T.ravel()]
    place = file.accessor(rest)
    file.tree["skins"] = [{"joints": [1, 2], "inverseBindMatrices": place}]
    turn = [0, 0, 0.5**0.5, 0.5**0.5]
    file.tree["nodes"] += [
        {"translation": [0, 0, 5], "children": [2]},
        {"translation": [0, 1, 0], "rotation": turn},
    ]
    file.tree["scenes"][0]["nodes"] = [0, 1]
    mesh = file.load(tmp_path)
    second = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    expected = TETRAHEDRON[0] + [0, 0, 5]
    turned = (TETRAHEDRON[0] - [0, 1, 0]) @ second.T + [0, 1, 5]
    expected[2], expected[3] = turned[2], (expected[3] + turned[3]) / 2
    np.testing.assert_allclose(mesh.vertices, expected, atol=1e-6)
    normal = outwards[2] @ second.T
    np.testing.assert_allclose(mesh.normals[2], normal / np.linalg.norm(normal), atol=1e-6)
    file.primitive["attributes"]["JOINTS_0"] = file.accessor(joints + 2, "u1")
    with pytest.raises(MeshError, match="a joint that its skin has not"):
        file.load(tmp_path)


def test_shapes_are_blended_as_the_file_begins(tmp_path):
    file = File()
    targets = [{"POSITION": file.accessor(np.tile([0, k, 0], (4, 1)))} for k in (4, 100)]
    file.primitive["targets"] = targets
    file.tree["meshes"][0]["weights"] = [0.5, 0]
    assert file.load(tmp_path).bounds.tolist() == [[0, 2, 0], [1, 3, 1]]


@pytest.mark.parametrize("kind", ["f4", "u1", "u2"])
def test_colours_are_fractions_of_the_largest(tmp_path, kind):
    file = File(normals=TETRAHEDRON[0] - 0.25)
    most = 1 if kind == "f4" else np.iinfo(kind).max
    colors = np.array([(1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 0), (1, 1, 1, 1)]) * most
    file.primitive["attributes"]["COLOR_0"] = file.accessor(colors, kind, normalized=True)
    np.testing.assert_allclose(file.load(tmp_path).colors, colors[:, :3] / most)


def test_primitives_may_share_the_vertices_of_a_whole_scene(tmp_path):
    """Each has those that it uses, which have one number in the file, and a row of each."""
    file = File(normals=TETRAHEDRON[0] - 0.25)
    (primitive,) = file.tree["meshes"][0]["primitives"]
    names = [{**primitive, "indices": file.accessor([*face], "u4")} for face in TETRAHEDRON[1]]
    file.tree["meshes"][0]["primitives"] = names
    mesh = file.load(tmp_path)
    assert (len(mesh.vertices), len(mesh.faces)) == (12, 4)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], TETRAHEDRON[0][TETRAHEDRON[1]])
    np.testing.assert_array_equal(mesh.file_vertices, np.sort(TETRAHEDRON[1]).ravel())
    np.testing.assert_array_equal(mesh.file_vertices[mesh.file_rows], range(4))


def test_memory_grows_with_vertices_and_not_with_primitives_times_these(tmp_path):
    """A scene of 1,000 primitives of 1,000 vertices took more than 7 GB."""
    file = File()
    (primitive,) = file.tree["meshes"][0]["primitives"]
    points = np.random.default_rng(2).uniform(-1, 1, (200, 300, 3))
    file.tree["meshes"][0]["primitives"] = [
        {"attributes": {"POSITION": file.accessor(each)}, "indices": primitive["indices"]}
        for each in points
    ]
    tracemalloc.start()
    try:
        file.load(tmp_path)
        assert tracemalloc.get_traced_memory()[1] < 20 * points.nbytes
    finally:
        tracemalloc.stop()


def test_nodes_are_counted_before_they_are_placed(tmp_path, monkeypatch):
    """Of 65,536 nodes that show 4,096 primitives each the places alone took 7 s."""
    monkeypatch.setattr(gltf_json, "MOST_ITEMS", 5)
    for times, told in ((2, "has no triangles"), (3, "show 6 primitives")):
        file, placed = File(), []
        monkeypatch.setattr(gltf._File, "_places", lambda _, here=placed: here.append(1) or {})
        file.tree["meshes"][0]["primitives"] *= 2
        file.tree["nodes"] = [{"mesh": 0}] * times
        with pytest.raises(MeshError, match=told):
            file.load(tmp_path)
        assert len(placed) == 3 - times


def test_shapes_are_blended_of_some_only(tmp_path, monkeypatch):
    """A short text names a shape as often as it likes."""
    monkeypatch.setattr(gltf, "_MOST_BLENDED", 4 * 5)
    for times, is_refused in ((5, False), (6, True)):
        file = File()
        mesh = file.tree["meshes"][0]
        mesh["weights"] = [0.5] * times
        mesh["primitives"][0]["targets"] = [{"POSITION": 0}] * times
        if is_refused:
            with pytest.raises(MeshError, match="blended of too many"):
                file.load(tmp_path)
        else:
            size = 1 + times / 2
            np.testing.assert_allclose(np.ptp(file.load(tmp_path).vertices, axis=0), size)
