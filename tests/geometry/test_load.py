"""Meshes of every format, as they should be and as nobody should write them."""

import copy
import json
import struct
import time

import numpy as np
import pytest

from shrm_cli.errors import MeshError
from shrm_cli.files.gltf import MOST_BYTES
from shrm_cli.files.whole import is_input, protecting
from shrm_cli.geometry.load import load_mesh
from shrm_cli.geometry.mesh import MOST_FACES
from tests.geometry import shapes
from tests.geometry.shapes import TETRAHEDRON, glb, gltf, gltf_tree, icosphere, obj, ply, stl

TREE = gltf_tree(*TETRAHEDRON)


def load(folder, name, data):
    path = folder / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return load_mesh(path)


def volume(mesh):
    a, b, c = np.moveaxis(mesh.corners(np.arange(len(mesh.faces))), 1, 0)
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


FORMS = {
    "a.obj": obj,
    "a.ply": ply,
    "b.ply": lambda v, f: ply(v, f, binary=False),
    "a.stl": stl,
    "b.STL": lambda v, f: stl(v, f, binary=False),
    "a.glb": lambda v, f: glb(*gltf_tree(v, f, normals=v)),
    "a.gltf": lambda v, f: gltf(*gltf_tree(v, f, normals=v)),
}


@pytest.mark.parametrize("name", FORMS)
def test_all_formats_hold_the_same_sphere(tmp_path, name):
    vertices, faces = icosphere(2)
    mesh = load(tmp_path, name, FORMS[name](vertices, faces))
    assert mesh.vertices.shape == vertices.shape
    assert len(mesh.faces) == len(faces)
    assert {tuple(v) for v in np.round(mesh.vertices, 5) + 0.0} == {
        tuple(v) for v in np.round(vertices, 5) + 0.0
    }
    # By symmetry the smooth normals of such a sphere are nearly its vertices, and point outwards.
    np.testing.assert_allclose(mesh.normals, mesh.vertices, atol=0.01)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, rtol=1e-12)
    assert 3.9 < volume(mesh) < 4.19


def test_the_files_that_were_read_are_inputs(tmp_path):
    tree, data = gltf_tree(*TETRAHEDRON)
    (tmp_path / "b.bin").write_bytes(data)
    tree["buffers"][0]["uri"] = "b.bin"
    with protecting():
        load(tmp_path, "a.gltf", json.dumps(tree))
        assert is_input(tmp_path / "a.gltf")
        assert is_input(tmp_path / "b.bin")


# ---- what formats can say ------------------------------------------------------------------------


def test_indices_of_obj_may_count_backwards_and_name_polygons(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 \\\n -1\n"
    text += "v 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n"
    mesh = load(tmp_path, "a.obj", text)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6]]
    assert mesh.vertices[4].tolist() == [5, 0, 0]


def test_normals_coordinates_and_colours_of_obj(tmp_path):
    text = (
        "mtllib ../../secret.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\n"
        "vn 0 0 -2\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl x\nf 1/1/1 2/2/1 3/3/1\n"
    )
    mesh = load(tmp_path, "a.obj", text)
    assert mesh.normals.tolist() == [[0, 0, -1]] * 3
    assert mesh.uvs.tolist() == [[0, 0], [1, 0], [0, 1]]
    np.testing.assert_array_equal(mesh.colors, np.eye(3))


def test_seams_of_coordinates_are_not_seen(tmp_path):
    """Two triangles share an edge whose ends have two texture coordinates each."""
    text = "v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 0\n" + "vt 0 0\nvt 1 1\n"
    mesh = load(tmp_path, "a.obj", text + "f 1/1 2/1 3/1\nf 1/2 3/2 4/2\n")
    assert len(mesh.vertices) == 6
    for place in np.unique(mesh.vertices, axis=0):
        own = mesh.normals[(mesh.vertices == place).all(axis=1)]
        np.testing.assert_allclose(own, own[:1].repeat(len(own), axis=0), atol=1e-15)


def test_smooth_normals_do_not_depend_on_the_cut(tmp_path):
    """A corner of a cube: one side of two triangles counts as much as those of one."""
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 1 0\n"
    mesh = load(tmp_path, "a.obj", text + "f 1 3 5\nf 1 5 2\nf 1 2 4\nf 1 4 3\n")
    at = np.flatnonzero((mesh.vertices == 0).all(axis=1))[0]
    np.testing.assert_allclose(mesh.normals[at], -np.ones(3) / 3**0.5, atol=1e-12)


def test_nodes_of_gltf_move_their_meshes(tmp_path):
    """The node mirrors, stretches, turns by 90 degrees about +Z, and moves."""
    turn = [0, 0, 0.5**0.5, 0.5**0.5]
    node = {"translation": [5, 0, 0], "rotation": turn, "scale": [-2, 1, 1]}
    outwards = TETRAHEDRON[0] - 0.25
    mesh = load(tmp_path, "a.glb", glb(*gltf_tree(*TETRAHEDRON, node=node, normals=outwards)))
    expected = TETRAHEDRON[0] * [-2, 1, 1]
    expected = np.stack([5 - expected[:, 1], expected[:, 0], expected[:, 2]], axis=1)
    np.testing.assert_allclose(mesh.vertices, expected, atol=1e-6)
    assert volume(mesh) == pytest.approx(2 / 6, rel=1e-5)  # the outside is still outside
    inwards = np.einsum("ij,ij->i", mesh.normals, mesh.vertices.mean(axis=0) - mesh.vertices)
    assert (inwards < 0).all()


def test_materials_of_gltf(tmp_path):
    pbr = {"baseColorFactor": [1, 0.5, 0, 1], "metallicFactor": 0.25, "roughnessFactor": 0.75}
    data = glb(*gltf_tree(*TETRAHEDRON, material={"name": "x", "pbrMetallicRoughness": pbr}))
    mesh = load(tmp_path, "a.glb", data)
    (material,) = mesh.materials
    assert (material.base_color, material.metallic, material.roughness) == ((1, 0.5, 0), 0.25, 0.75)
    assert set(mesh.face_materials) == {0}


def test_materials_of_gltf_without_a_name_have_that_of_their_number(tmp_path):
    """So warnings tell them apart, and options of rooms can name them."""
    for unnamed in ({}, {"name": ""}):
        mesh = load(tmp_path, "a.glb", glb(*gltf_tree(*TETRAHEDRON, material=unnamed)))
        assert [each.name for each in mesh.materials] == ["material 0"]


def test_coordinates_of_gltf_point_upwards(tmp_path):
    mesh = load(tmp_path, "a.glb", glb(*gltf_tree(*TETRAHEDRON, uvs=np.full((4, 2), 0.25))))
    np.testing.assert_allclose(mesh.uvs, [[0.25, 0.75]] * 12)


def test_sides_that_share_no_vertices_are_apart(tmp_path):
    """As other programs have it: a crate whose file repeats its corners for each side has edges."""
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "v 0 0 0\nv 0 1 0\nv 0 0 1\n"
    mesh = load(tmp_path, "a.obj", text + "vt 0 0\nf 1/1 2/1 3/1\nf 4/1 5/1 6/1\n")
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1]] * 3 + [[1, 0, 0]] * 3)


def test_comments_end_lines_of_an_obj(tmp_path):
    text = "v 0 0 0 # first\nv 1 0 0 # 2 3 4 5 6 7\nv 0 1 0 # a b c d\nf 1 2 3 # all\n"
    assert load(tmp_path, "a.obj", text).faces.tolist() == [[0, 1, 2]]


QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\n"


def materials(folder, library, lines="mtllib a.mtl", names=("x",)):
    """The materials of an OBJ with a file beside it."""
    (folder / "a.mtl").write_text(library)
    faces = "".join(f"usemtl {name}\nf 1/1 2/1 3/1\n" for name in names)
    return load(folder, "a.obj", f"{lines}\n{QUAD}{faces}").materials


@pytest.mark.parametrize(
    "line",
    ["b.mtl a.mtl", "./a.mtl", '"a.mtl"', "C:\\out\\a.mtl", "/out/a.mtl", "b.mtl\nmtllib a.mtl"],
)
def test_files_of_materials_are_found(tmp_path, line):
    """One line may name several, and paths of other machines lead to what lies beside the mesh."""
    (tmp_path / "b.mtl").write_text("newmtl y\nKd 0 1 0\n")
    names = ("x", "y") if "b" in line else ("x",)
    found = materials(tmp_path, "newmtl x\nKd 1 0 0\n", f"mtllib {line}", names)
    assert [each.base_color for each in found] == [(1, 0, 0), (0, 1, 0)][: len(names)]
    assert not any(each.unread for each in found)


def test_materials_that_are_missing_say_where(tmp_path):
    (lost,) = materials(tmp_path, "newmtl y\n", "mtllib a.mtl gone.mtl")
    assert lost.unread == ("whose file 'gone.mtl' is missing",)
    assert materials(tmp_path, "newmtl y\n")[0].unread == ("which a.mtl does not have",)
    assert "no file of materials is named" in materials(tmp_path, "", "")[0].unread[0]


def test_textures_of_other_machines_are_looked_for_beside_the_mesh(tmp_path):
    (tmp_path / "c d.png").write_bytes(b"")
    (found,) = materials(tmp_path, "newmtl x\nmap_Kd -s 2 2 C:\\art\\c d.png\n")
    assert found.color_map.picture == tmp_path / "c d.png"
    (found,) = materials(tmp_path, "newmtl x\nmap_Kd /art/gone.png\n")
    assert "copy it there" in found.color_map.picture


def test_opacity_and_glow_of_mtl(tmp_path):
    """What is blended by less than a half is not seen, and a black glow does not hide a texture."""
    text = "newmtl x\nd 0.25\nTr 0\nnewmtl y\nTr 0.25\nnewmtl z\nKe 0 0 0\nmap_Ke z.png\n"
    x, y, z = materials(tmp_path, text, names=("x", "y", "z"))
    assert (x.opacity, x.cutoff, x.unread) == (0.25, 0.5, ("opacity 0.25",))
    assert (y.opacity, y.cutoff, y.unread) == (0.75, 0.5, ("opacity 0.75",))
    assert (z.emission, z.opacity, z.cutoff) == ((1, 1, 1), 1, None)
    (found,) = materials(tmp_path, "newmtl x\nKe 2 0 0\nmap_Ke z.png\n")
    assert found.emission == (2, 0, 0)


def test_channels_of_packed_textures(tmp_path):
    text = "newmtl x\nmap_Pr -imfchan g a.png\nmap_Pm -imfchan b -mm 0 2 a.png\n"
    (found,) = materials(tmp_path, text)
    assert (found.roughness_channel, found.metallic_channel) == (1, 2)
    assert found.unread == ("-mm of map_Pm",)


def test_triangles_without_an_area_are_left_out(tmp_path):
    vertices, faces = TETRAHEDRON
    more = np.concatenate([faces, [[0, 0, 1], [1, 1, 1]]])
    line = np.concatenate([vertices, [[2, 0, 0]]])  # three points on a line
    mesh = load(tmp_path, "a.obj", obj(line, np.concatenate([more, [[0, 1, 4]]])))
    assert len(mesh.faces) == 4
    assert len(mesh.vertices) == 4
    assert np.isfinite(mesh.normals).all()


def test_edges_of_many_triangles_are_no_error(tmp_path):
    vertices, faces = TETRAHEDRON
    mesh = load(tmp_path, "a.obj", obj(vertices, np.concatenate([faces, faces, faces[:, ::-1]])))
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1)


def test_missing_and_broken_normals_are_made(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nvn nan 0 0\nvn 0 1 0\nf 1//1 2//2 3//3\n"
    mesh = load(tmp_path, "a.obj", text)
    assert mesh.normals.tolist() == [[0, 0, 1], [0, 0, 1], [0, 1, 0]]


# ---- what nobody should write --------------------------------------------------------------------


def changed(**changes):
    """A GLB of a tetrahedron with other values: paths such as accessors__0__count."""
    tree, data = copy.deepcopy(TREE)
    for path, value in changes.items():
        at, *rest = [int(part) if part.isdigit() else part for part in path.split("__")][::-1]
        place = tree
        for part in rest[::-1]:
            place = place[part]
        place[at] = value
    return glb(tree, data)


def ply_header(*lines):
    return "\n".join(["ply", "format ascii 1.0", *lines, "end_header", "0 0 0", ""])


BILLION = 10**9
BAD = {
    "empty.obj": b"",
    "garbage.obj": b"\x89PNG\0\0\xff" * 99,
    "text.obj": "hello\nworld\n",
    "points.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
    "nan.obj": "v 0 nan 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "huge.obj": "v 0 1e300 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "far.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4000000000\n",
    "zero.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 2 3\n",
    "two.obj": "v 0 0 0\nv 1 0 0\nf 1 2\n",
    "flat.obj": "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
    "word.obj": "v 0 0 x\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
    "normal.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1//7 2//7 3//7\n",
    "polygon.obj": "v 0 0 0\n" + "f" + " 1" * 5000 + "\n",
    "empty.ply": b"ply\n",
    "endless.ply": "ply\nformat ascii 1.0\n" + "comment x\n" * 9999,
    "billion.ply": ply(*TETRAHEDRON, count=BILLION),
    "ascii.ply": ply(*TETRAHEDRON, binary=False, count=BILLION),
    "short.ply": ply(*TETRAHEDRON)[:-5],
    "text.ply": ply(*TETRAHEDRON, binary=False).replace(b"1", b"x"),
    "beyond.ply": ply(TETRAHEDRON[0], TETRAHEDRON[1] + 9),
    "list.ply": ply_header("element vertex 1", "property list uint float x"),
    "nothing.ply": ply_header(f"element vertex {BILLION}"),
    "kind.ply": ply_header("element vertex 1", "property quaternion x"),
    "minus.ply": ply_header("element vertex -1", "property float x"),
    "bare.ply": ply_header("element vertex 1", "property"),
    "billion.stl": stl(*TETRAHEDRON, count=BILLION),
    "short.stl": stl(*TETRAHEDRON)[:-3],
    "none.stl": stl(TETRAHEDRON[0], TETRAHEDRON[1][:0].reshape(0, 3)),
    "word.stl": stl(*TETRAHEDRON, binary=False).replace(b"vertex 1", b"vertex x"),
    "open.stl": b"solid a\nfacet normal 0 0 1\n",
    "solids.stl": b"solid a\nfacet normal 0 0 1\nendsolid a\n" * 2000,
    "nan.stl": stl(TETRAHEDRON[0] * np.nan, TETRAHEDRON[1]),
    "short.glb": glb(*TREE)[:-9],
    "one.glb": glb(*TREE).replace(b"glTF\2", b"glTF\1"),
    "text.glb": b"glTF" + bytes(99),
    "billion.glb": changed(accessors__1__count=3 * BILLION),
    "offset.glb": changed(accessors__0__byteOffset=40),
    "minus.glb": changed(accessors__0__count=-1),
    "view.glb": changed(bufferViews__0__byteLength=BILLION),
    "buffer.glb": changed(buffers__0__byteLength=10**7),
    "petabyte.glb": changed(buffers__0__byteLength=10**15),
    "hollow.glb": changed(accessors__0={"componentType": 5126, "count": BILLION, "type": "VEC3"}),
    "index.glb": changed(meshes__0__primitives__0__indices=7),
    "kind.glb": changed(accessors__0__type="MAT4"),
    "lines.glb": changed(meshes__0__primitives__0__mode=1),
    "node.glb": changed(nodes__0__children=[5]),
    "matrix.glb": changed(nodes__0__matrix=[1, 2, 3]),
    "flat.glb": changed(nodes__0__scale=[0, 1, 1]),
    "draco.glb": changed(extensionsRequired=["KHR_draco_mesh_compression"]),
    "list.glb": changed(meshes={}),
    "scene.glb": changed(scenes__0__nodes=[]),
    "a.gltf": b"{",
    "deep.gltf": b"[" * 10**5,
    "up.gltf": gltf(*TREE).replace(b"data:application/octet-stream;base64,", b"../"),
    "web.gltf": json.dumps({**TREE[0], "buffers": [{"byteLength": 9, "uri": "http://a.b/c"}]}),
    "root.gltf": json.dumps({**TREE[0], "buffers": [{"byteLength": 9, "uri": "%2Fetc/passwd"}]}),
    "gone.gltf": json.dumps({**TREE[0], "buffers": [{"byteLength": 9, "uri": "gone.bin"}]}),
    "base.gltf": json.dumps({**TREE[0], "buffers": [{"byteLength": 9, "uri": "data:;base64,?"}]}),
    "a.zip": b"PK\x03\x04",
    "zip.stl": b"PK\x03\x04" + bytes(200),
    "ply.obj": ply(*TETRAHEDRON),
    "obj.ply": obj(*TETRAHEDRON),
    "stl.glb": stl(*TETRAHEDRON),
    "none": b"x",
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_are_refused_in_one_line(tmp_path, name):
    with pytest.raises(MeshError) as caught:
        load(tmp_path, name, BAD[name])
    said = str(caught.value)
    assert said.startswith(f"{tmp_path / name}: ")
    assert "; " in said
    assert "\n" not in said
    assert len(said) < len(str(tmp_path / name)) + 250


@pytest.mark.parametrize("name", ["billion.ply", "ascii.ply", "billion.stl", "billion.glb"])
def test_what_is_not_there_is_counted(tmp_path, name):
    with pytest.raises(MeshError, match="declares"):
        load(tmp_path, name, BAD[name])


def test_no_memory_is_taken_for_claims(tmp_path):
    import tracemalloc

    for name in BAD:
        tracemalloc.start()
        try:
            with pytest.raises(MeshError):
                load(tmp_path, name, BAD[name])
            assert tracemalloc.get_traced_memory()[1] < 60 * 2**20, name
        finally:
            tracemalloc.stop()


def test_a_mesh_shown_ten_thousand_times_is_too_much(tmp_path):
    vertices, faces = icosphere(3)
    tree, data = gltf_tree(vertices, faces)
    count = MOST_FACES // len(faces) + 1
    tree["nodes"] = [{"mesh": 0}] * count
    tree["scenes"] = [{"nodes": list(range(count))}]
    with pytest.raises(MeshError, match=r"triangles are more than"):
        load(tmp_path, "a.glb", glb(tree, data))


def test_nodes_in_a_circle_end(tmp_path):
    tree, data = gltf_tree(*TETRAHEDRON)
    tree["nodes"] = [{"mesh": 0, "children": [1]}, {"children": [0]}]
    with pytest.raises(MeshError, match="several parents"):
        load(tmp_path, "a.glb", glb(tree, data))


def test_nodes_in_nodes_have_an_end(tmp_path):
    tree, data = gltf_tree(*TETRAHEDRON)
    tree["nodes"] = [*({"children": [k + 1]} for k in range(99)), {"mesh": 0}]
    with pytest.raises(MeshError, match="nested"):
        load(tmp_path, "a.glb", glb(tree, data))


def test_bytes_are_not_read_again_and_again(tmp_path, monkeypatch):
    """As those of an archive that unpacks to a thousand times its size."""
    most = 2**24
    monkeypatch.setattr("shrm_cli.files.gltf.MOST_BYTES", most)
    tree, data = gltf_tree(*TETRAHEDRON)
    data += bytes(5000 * len(data))
    many = 2 * most // len(data) + 2
    tree["buffers"][0]["byteLength"] = len(data)
    tree["bufferViews"] += [{"buffer": 0, "byteLength": len(data)}] * many
    assert len(load(tmp_path, "a.glb", glb(tree, data)).faces) == 4  # which are not read at all
    del tree["bufferViews"][2:]
    tree["bufferViews"][0] = {"buffer": 0, "byteLength": len(data)}
    whole = {"bufferView": 0, "componentType": 5126, "count": len(data) // 36 * 3, "type": "VEC3"}
    tree["accessors"] += [whole] * many
    tree["meshes"][0]["primitives"] = [{"attributes": {"POSITION": 2 + k}} for k in range(many)]
    with pytest.raises(MeshError, match="bytes of its buffers"):
        load(tmp_path, "a.glb", glb(tree, data))


def test_a_mesh_of_many_parts_is_not_shown_many_times(tmp_path):
    tree, data = gltf_tree(*TETRAHEDRON)
    tree["meshes"][0]["primitives"] *= 1000
    tree["nodes"] = [{"mesh": 0}] * 1000
    tree["scenes"] = [{"nodes": list(range(1000))}]
    with pytest.raises(MeshError, match="1,000,000 primitives"):
        load(tmp_path, "a.glb", glb(tree, data))


def test_files_of_gigabytes_are_not_read(tmp_path, monkeypatch):
    path = tmp_path / "a.obj"
    with open(path, "wb") as stream:
        stream.truncate(MOST_BYTES + 1)  # no block of it is on the disk
    with pytest.raises(MeshError, match="simplify"):
        load_mesh(path)


@pytest.mark.parametrize("name", ["missing.obj", ".", "a\0b.obj", "x" * 300 + ".obj"])
def test_files_that_are_none(tmp_path, name):
    with pytest.raises(MeshError):
        load_mesh(tmp_path / name if "\0" not in name else name)


def test_without_trimesh_one_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "trimesh.exchange.load", None)
    with pytest.raises(MeshError, match="pip install trimesh embreex"):
        load(tmp_path, "a.stl", stl(*TETRAHEDRON))


def test_the_shapes_are_what_they_should_be():
    vertices, faces = shapes.icosphere(1)
    assert vertices.shape == (42, 3)
    assert faces.shape == (80, 3)
    assert struct.calcsize("<12f2x") == 50


def test_lines_of_megabytes_are_skipped_or_refused(tmp_path):
    """Their words would take a hundred times as much memory."""
    vertices, faces = TETRAHEDRON
    text, long = obj(vertices, faces), "1 " * 2**20
    text = text if isinstance(text, str) else text.decode()
    assert len(load(tmp_path, "a.obj", f"# {long}\n{text}").faces) == len(faces)
    for data in (f"v {long}\n{text}", f"{text}\nf {long}", f"{text}\nvn {long}"):
        with pytest.raises(MeshError, match="is too long"):
            load(tmp_path, "a.obj", data)
    plain = ply(vertices, faces, binary=False)
    plain = plain if isinstance(plain, bytes) else plain.encode()
    with pytest.raises(MeshError, match="a line of more than"):
        load(tmp_path, "a.ply", plain + long.encode())
    solid = stl(vertices, faces, binary=False)
    solid = solid if isinstance(solid, bytes) else solid.encode()
    with pytest.raises(MeshError, match="a line of more than"):
        load(tmp_path, "a.stl", solid + long.encode())


def test_lines_that_go_on_are_joined_once(tmp_path):
    """Each was copied to what came before it: 6 MB took two minutes."""
    text = obj(*TETRAHEDRON)
    text = text if isinstance(text, str) else text.decode()
    split = text.replace(" ", " \\\n")
    assert len(load(tmp_path, "a.obj", split).faces) == len(TETRAHEDRON[1])
    started = time.process_time()
    for step in ("0 \\\n", "\\\n"):
        with pytest.raises(MeshError, match="is too long"):
            load(tmp_path, "a.obj", f"v {step * 2**20}{text}")
    assert time.process_time() - started < 10


def test_materials_of_many_meshes_are_found_without_comparing_all(tmp_path, monkeypatch):
    """4096 materials and 65,536 nodes took 54 s, most of it to compare materials."""
    from shrm_cli.geometry.mesh import SurfaceMaterial

    tree, data = copy.deepcopy(TREE[0]), TREE[1]
    count = 200
    primitive = tree["meshes"][0]["primitives"][0]
    tree["materials"] = [{"name": f"m{k}"} for k in range(count)]
    tree["meshes"] = [{"primitives": [{**primitive, "material": k}]} for k in range(count)]
    tree["nodes"] = [{"mesh": k % count} for k in range(2 * count)]
    tree["scenes"], tree["scene"] = [{"nodes": list(range(2 * count))}], 0
    compared, equal = [], SurfaceMaterial.__eq__
    monkeypatch.setattr(SurfaceMaterial, "__eq__", lambda a, b: compared.append(1) or equal(a, b))
    mesh = load(tmp_path, "a.glb", glb(tree, data))
    assert len(mesh.materials) == count
    assert (np.bincount(mesh.face_materials) == 2 * len(TETRAHEDRON[1])).all()
    assert len(compared) < 10 * count
