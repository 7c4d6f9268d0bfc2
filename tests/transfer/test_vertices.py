"""Which row of a transfer is which vertex of the mesh's file, for programs that have both files.

The files are read here by a few lines that follow docs/meshes.md, and share nothing with shrm.
"""

import json
import struct

import numpy as np
import pytest

from shrm_cli.geometry.load import load_mesh
from shrm_cli.transfer.file import read_transfer
from tests.cli.helpers import done
from tests.geometry.shapes import glb, gltf_tree, ply, stl

# A roof of two triangles with a seam along its ridge, and vertices that nothing uses.
POINTS = np.array(
    [(9, 9, 9), (0, 0, 0), (2, 0, 0), (2, 1, 1), (0, 1, 1), (7, 7, 7), (2, 0, 2), (0, 0, 2),
     (8, 8, 8)],
    dtype=float,
)  # fmt: skip
FACES = np.array([(1, 3, 2), (1, 4, 3), (4, 7, 6), (4, 6, 3)])
UNUSED = [0, 5, 8]
SEAM = """{points}
vt 0 0
vt 1 0
vt 0 1
vt 1 1
f 2/1 4/4 3/2
f 2/1 5/3 4/4
f 5/1 8/3 7/4
f 5/1 7/4 4/2
"""


def obj(seam):
    lines = [f"v {x} {y} {z}" for x, y, z in POINTS]
    if seam:
        return SEAM.format(points="\n".join(lines)).encode()
    return "\n".join([*lines, *("f " + " ".join(str(k + 1) for k in f) for f in FACES)]).encode()


def two_primitives():
    """The triangles in two meshes, of which a node shows the second one first."""
    tree, data = gltf_tree(POINTS, FACES[:2])
    other, more = gltf_tree(POINTS[::-1], len(POINTS) - 1 - FACES[2:])
    shift = len(tree["bufferViews"])
    for view in other["bufferViews"]:
        tree["bufferViews"].append({**view, "byteOffset": view.get("byteOffset", 0) + len(data)})
    for accessor in other["accessors"]:
        tree["accessors"].append({**accessor, "bufferView": accessor["bufferView"] + shift})
    (primitive,) = other["meshes"][0]["primitives"]
    first = len(tree["accessors"]) - len(other["accessors"])
    moved = {**primitive, "indices": primitive["indices"] + first,
             "attributes": {k: v + first for k, v in primitive["attributes"].items()}}  # fmt: skip
    tree["meshes"].append({"primitives": [moved]})
    tree["nodes"] = [{"mesh": 1}, {"mesh": 0}]
    tree["scenes"], tree["scene"] = [{"nodes": [0, 1]}], 0
    tree["buffers"] = [{"byteLength": len(data + more)}]
    return glb(tree, data + more)


FILES = {
    "a.obj": (obj(False), POINTS),
    "seam.obj": (obj(True), POINTS),
    "a.ply": (ply(POINTS, FACES), POINTS),
    "text.ply": (ply(POINTS, FACES, binary=False), POINTS),
    "a.stl": (stl(POINTS, FACES), POINTS[FACES].reshape(-1, 3)),
    "a.glb": (glb(*gltf_tree(POINTS, FACES)), POINTS),
    "two.glb": (two_primitives(), np.concatenate([POINTS, POINTS[::-1]])),
}
"""The bytes of each file, and the positions of its vertices in its own order."""


@pytest.fixture(params=FILES)
def baked(request, tmp_path, monkeypatch):
    """The name of a mesh, the positions of its file's vertices, and the arrays of its transfer."""
    data, points = FILES[request.param]
    monkeypatch.chdir(tmp_path)
    (tmp_path / request.param).write_bytes(data if isinstance(data, bytes) else data.encode())
    done("transfer", request.param, "--samples", "64", "--order", "2", "-o", "t.npz")
    with np.load("t.npz", allow_pickle=False) as arrays:  # noqa: TID251
        return request.param, points, dict(arrays)


def test_rows_are_vertices_of_the_file(baked):
    name, points, arrays = baked
    rows, vertices = arrays["vertex_of_row"], arrays["row_of_vertex"]
    assert len(arrays["vectors"]) == len(arrays["positions"]) == len(rows)
    assert len(vertices) == len(points)
    np.testing.assert_allclose(points[rows], arrays["positions"], atol=1e-6)
    used = np.flatnonzero(vertices >= 0)
    np.testing.assert_allclose(arrays["positions"][vertices[used]], points[used], atol=1e-6)
    if name != "a.stl":
        lost = set(range(len(points))) - set(used.tolist())
        assert {tuple(points[each]) for each in lost} <= {tuple(p) for p in points}
        assert set(UNUSED) <= lost
        assert (rows[vertices[used]] == used).all()
    if name == "seam.obj":
        assert len(rows) == 8  # two of the ridge's vertices have two rows each
        assert np.bincount(rows, minlength=9).tolist() == [0, 1, 1, 2, 2, 0, 1, 1, 0]
    corners = {tuple(map(tuple, np.round(arrays["positions"][f], 5))) for f in arrays["faces"]}
    assert corners == {tuple(map(tuple, POINTS[f])) for f in FACES}


def test_what_is_read_again_is_what_was_baked(baked):
    name, _, arrays = baked
    mesh, transfer = load_mesh(name), read_transfer("t.npz")
    np.testing.assert_array_equal(transfer.vectors, arrays["vectors"])
    np.testing.assert_allclose(mesh.vertices, arrays["positions"], atol=1e-6)
    np.testing.assert_allclose(mesh.normals, arrays["normals"], atol=1e-6)


def test_one_vertex_has_the_transfer_of_its_own_place(baked):
    """The foot of the roof sees the sky without the roof; the vector of degree 0 tells how much."""
    _, points, arrays = baked
    place = int(np.flatnonzero((points == POINTS[1]).all(axis=1))[0])
    row = arrays["row_of_vertex"][place]
    normal = arrays["normals"][row].astype(float)
    # A plane that is not shadowed: the integral of the cosine times Y_00 is pi Y_00.
    assert arrays["vectors"][row, 0, 0] == pytest.approx(np.pi * 0.2820948, rel=1e-3)
    linear = arrays["vectors"][row, [3, 1, 2], 0]
    np.testing.assert_allclose(linear, 2 * np.pi / 3 * 0.4886025 * normal, atol=2e-3)


def test_ply_and_glb_tell_the_vertex_and_text_has_their_order(baked):
    name, points, arrays = baked
    for target in ("out.ply", "out.glb", "out.txt"):
        done("transfer", name, "--samples", "64", "--order", "2", "-o", target)
    with open("out.ply", "rb") as stream:
        data = stream.read()
    header, _, body = data.partition(b"end_header\n")
    names = [line.split()[-1].decode() for line in header.splitlines() if line[:8] == b"property"]
    kinds = [(each, "<i4" if each == "file_vertex" else "<f4") for each in names[:-1]]
    rows = np.frombuffer(body, np.dtype(kinds), len(arrays["vectors"]))
    np.testing.assert_array_equal(rows["file_vertex"], arrays["vertex_of_row"])
    np.testing.assert_allclose(rows["transfer_000"], arrays["vectors"][:, 0, 0], atol=1e-6)
    with open("out.glb", "rb") as stream:
        data = stream.read()
    length = struct.unpack("<I", data[12:16])[0]
    tree, body = json.loads(data[20 : 20 + length]), data[28 + length :]
    accessor = tree["accessors"][tree["meshes"][0]["primitives"][0]["attributes"]["_VERTEX"]]
    view = tree["bufferViews"][accessor["bufferView"]]
    found = np.frombuffer(body, "<f4", accessor["count"], view["byteOffset"])
    np.testing.assert_array_equal(found, arrays["vertex_of_row"])
    lines = np.loadtxt("out.txt")
    assert len(lines) == len(points)
    expected = np.where(
        arrays["row_of_vertex"][:, None] >= 0, arrays["vectors"][arrays["row_of_vertex"], :9, 0], 0
    )
    np.testing.assert_allclose(lines, expected, atol=1e-6)
    faces = np.load("face.npy", allow_pickle=False)  # noqa: TID251
    assert {tuple(map(tuple, points[f])) for f in faces} == {
        tuple(map(tuple, POINTS[f])) for f in FACES
    }


def test_files_without_the_map_are_read(baked):
    """As earlier versions wrote them."""
    from shrm_cli.transfer.file import write_transfer

    transfer = read_transfer("t.npz")
    write_transfer("old.npz", transfer)
    np.testing.assert_array_equal(read_transfer("old.npz").vectors, transfer.vectors)
