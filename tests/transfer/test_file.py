"""Files of transfer: what is read back, and that files which lie are refused in one line."""

import io
import json
import struct
import zipfile

import numpy as np
import pytest
import trimesh

from shrm_cli.errors import OutputError, TransferError
from shrm_cli.transfer.bake import Plan, bake, mesh_digest
from shrm_cli.transfer.file import (
    is_transfer,
    read_transfer,
    write_glb,
    write_pifu,
    write_ply,
    write_transfer,
)
from tests.transfer import meshes


@pytest.fixture(scope="module")
def mesh():
    return meshes.bumps(6)


@pytest.fixture(scope="module")
def glossy(mesh):
    return bake(Plan(mesh, order=2, samples=16, glossy=True))


@pytest.fixture(scope="module")
def coloured(mesh):
    return bake(Plan(mesh, order=1, samples=16, bounces=1, albedo=(0.9, 0.5, 0.1)))


@pytest.mark.parametrize("which", ["glossy", "coloured"])
def test_what_is_written_is_read(tmp_path, request, which):
    transfer, path = request.getfixturevalue(which), tmp_path / "t.npz"
    write_transfer(path, transfer)
    found = read_transfer(path)
    assert is_transfer(path)
    assert found.facts == transfer.facts
    for name in ("vectors", "albedo", "matrices", "frames"):
        if getattr(transfer, name) is None:
            assert getattr(found, name) is None
        else:
            np.testing.assert_array_equal(getattr(found, name), getattr(transfer, name))
    with np.load(path, allow_pickle=False) as archive:  # noqa: TID251  # numpy reads it too
        np.testing.assert_array_equal(archive["vectors"], transfer.vectors)


def test_transfer_belongs_to_its_mesh(mesh, glossy):
    glossy.check_mesh(mesh_digest(mesh.vertices, mesh.faces), mesh)
    with pytest.raises(TransferError, match=r"^bumps: not the mesh"):
        glossy.check_mesh(mesh_digest(mesh.vertices + 1, mesh.faces), mesh)


def save(path, arrays, compression=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, array in arrays.items():
            stream = io.BytesIO()
            np.lib.format.write_array(stream, np.asarray(array))
            archive.writestr(f"{name}.npy", stream.getvalue())
    return path


@pytest.fixture
def arrays(tmp_path, glossy):
    facts = {"version": 1, **vars(glossy.facts)}
    names = ("vectors", "albedo", "matrices", "frames")
    return {**{name: getattr(glossy, name) for name in names}, "settings": json.dumps(facts)}


def nan_within(array):
    array = np.array(array)
    array.reshape(-1)[7] = np.nan
    return array


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"vectors": None}, "not a transfer"),
        ({"albedo": None}, "not a transfer"),
        ({"vectors": None, "settings": '{"shape": [4, 3, 4]}'}, "not a transfer"),
        ({"settings": None}, "no array 'settings'"),
        ({"settings": "[1]"}, "not a JSON object"),
        ({"settings": '{"version": 3}'}, "newer shrm"),
        ({"settings": '{"version": 1}'}, "settings are wrong"),
        ({"vectors": np.zeros((36, 8, 1), "f4")}, "of shape"),
        ({"vectors": np.zeros((0, 9, 1), "f4")}, "no vertices"),
        ({"vectors": np.zeros((36, 324, 1), "f4")}, "order"),
        ({"vectors": np.zeros((35, 9, 1), "f4")}, "of shape"),
        ({"vectors": np.zeros((36, 9, 1), "i4")}, "which is wrong"),
        ({"vectors": np.array([None])}, "is wrong|not an array|truncated"),
        ({"matrices": None}, "of shape"),
        ({"frames": None}, "of shape"),
        ({"frames": np.zeros((36, 3, 3))}, "not orthonormal"),
        ({"frames": np.zeros((36, 3, 2))}, "of shape"),
        ({"albedo": np.full((1, 1), 2.0)}, "albedo"),
        ({"albedo": np.zeros((0, 1))}, "of shape"),
        ({"vectors": "nan"}, "vectors holds NaN"),
        ({"matrices": "nan"}, "matrices holds NaN"),
    ],
)
def test_files_that_lie(tmp_path, arrays, changes, what):
    for name, value in changes.items():
        is_nan = isinstance(value, str) and value == "nan"
        arrays[name] = nan_within(arrays[name]) if is_nan else value
    held = {name: value for name, value in arrays.items() if value is not None}
    objects = any(np.asarray(value).dtype == object for value in held.values())
    if objects:
        with zipfile.ZipFile(tmp_path / "t.npz", "w") as archive:
            facts = b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }"
            header = b"\x93NUMPY\x01\x00v\x00" + facts
            archive.writestr("vectors.npy", header.ljust(127) + b"\n" + b"\x80\x04N.")
            archive.writestr("settings.npy", b"")
    else:
        save(tmp_path / "t.npz", held)
    with pytest.raises(TransferError, match=what) as caught:
        read_transfer(tmp_path / "t.npz")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path / 't.npz'}: ")


def test_bombs_and_damage(tmp_path, arrays):
    packed = save(tmp_path / "packed.npz", arrays, zipfile.ZIP_DEFLATED)
    with pytest.raises(TransferError, match="is packed"):
        read_transfer(packed)
    path = save(tmp_path / "t.npz", arrays)
    data = path.read_bytes()
    for cut in (0, 10, len(data) // 2, len(data) - 3):
        path.write_bytes(data[:cut])
        with pytest.raises(TransferError):
            read_transfer(path)
    header = io.BytesIO()
    facts = {"descr": "<f4", "fortran_order": False, "shape": (2**30, 25, 1)}
    np.lib.format.write_array_header_1_0(header, facts)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("vectors.npy", header.getvalue() + bytes(400))
        archive.writestr("settings.npy", b"")
    with pytest.raises(TransferError, match="truncated"):
        read_transfer(path)
    with pytest.raises(TransferError, match="no such file"):
        read_transfer(tmp_path / "none.npz")
    assert not is_transfer(tmp_path / "none.npz")


@pytest.mark.parametrize("which", ["glossy", "coloured"])
def test_gltf_opens_elsewhere(tmp_path, request, mesh, which):
    """trimesh reads attributes of its own names; the rest is as glTF 2 says."""
    transfer, path = request.getfixturevalue(which), tmp_path / "a.glb"
    write_glb(path, mesh, transfer)
    (found,) = trimesh.load(path, process=False).geometry.values()
    np.testing.assert_allclose(found.vertices, mesh.vertices, atol=1e-6)
    np.testing.assert_array_equal(found.faces, mesh.faces)
    names = [f"_TRANSFER_{k}" for k in range(len(found.vertex_attributes) - 1)]
    numbers = np.asarray(found.vertex_attributes["_VERTEX"]).reshape(-1)
    np.testing.assert_array_equal(numbers, mesh.file_vertices)
    parts = [np.asarray(found.vertex_attributes[name]) for name in names]
    count, size, channels = transfer.vectors.shape
    if channels == 3:
        stored = np.stack(parts, axis=1)
    else:
        stored = np.concatenate(parts, axis=1)
        assert (stored[:, size:] == 0).all()
        stored = stored[:, :size, None]
    np.testing.assert_array_equal(stored, transfer.vectors)
    data = path.read_bytes()
    assert struct.unpack("<4sII", data[:12]) == (b"glTF", 2, len(data))
    length = struct.unpack("<I", data[12:16])[0]
    content = json.loads(data[20 : 20 + length])
    assert content["accessors"][0]["max"] == found.vertices.max(axis=0).tolist()
    assert content["meshes"][0]["extras"]["shrm:transfer"]["vertices"] == count


@pytest.mark.parametrize("which", ["glossy", "coloured"])
def test_ply_opens_elsewhere(tmp_path, request, mesh, which):
    transfer, path = request.getfixturevalue(which), tmp_path / "a.ply"
    write_ply(path, mesh, transfer)
    found = trimesh.load(path, process=False)
    np.testing.assert_allclose(found.vertices, mesh.vertices, atol=1e-6)
    np.testing.assert_array_equal(found.faces, mesh.faces)
    held = found.metadata["_ply_raw"]["vertex"]["data"]
    colors = ["_r", "_g", "_b"] if transfer.vectors.shape[2] == 3 else [""]
    for k in range(transfer.vectors.shape[1]):
        for channel, color in enumerate(colors):
            np.testing.assert_array_equal(
                held[f"transfer_{k:03d}{color}"].ravel(), transfer.vectors[:, k, channel]
            )


def test_the_layout_of_pifu(tmp_path, mesh, glossy, coloured):
    write_pifu(tmp_path / "bounce0.txt", mesh, glossy)
    found = np.loadtxt(tmp_path / "bounce0.txt")
    assert found.shape == (len(mesh.vertices), 9)
    np.testing.assert_allclose(found, glossy.vectors[..., 0], atol=1e-8)
    faces = np.load(tmp_path / "face.npy")  # noqa: TID251  # as PIFu reads it
    np.testing.assert_array_equal(faces, mesh.faces)
    with pytest.raises(OutputError, match="grey transfer of order 2"):
        write_pifu(tmp_path / "bounce1.txt", mesh, coloured)


def test_a_name_that_is_no_text(tmp_path):
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("\u00e9.npy", b"")
    path.write_bytes(path.read_bytes().replace("\u00e9".encode(), b"\xff\xff"))
    with pytest.raises(TransferError, match="damaged"):
        read_transfer(path)
