"""`shrm export --for gltf --into MODEL`: files of trimesh with a light in them, read by trimesh."""

import base64
import json
import struct

import numpy as np
import pytest
import trimesh

from shrm_cli.errors import ArgumentError, MapError, MeshError
from shrm_cli.export import engine as engines
from shrm_cli.export.asset import EXTENSION
from shrm_cli.export.make import Asked, Source, packaged, write
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import ENGINES
from tests.web.glb import ball_file

PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYGD4DwABCQEBtxmN7wAAAABJRU5ErkJggg=="
)


@pytest.fixture(scope="module")
def probe():
    values = np.random.default_rng(3).uniform(0.1, 4, (32, 64, 3))
    return Probe.from_array(values, "latlong")


def parts(data):
    """The JSON and the binary chunk of a GLB, by the words of its specification."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    assert size % 4 == 0
    tree = json.loads(data[20 : 20 + size])
    rest, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0"
    chunk = data[28 + size :]
    assert len(chunk) == rest == tree["buffers"][0]["byteLength"]
    assert len(tree["buffers"]) == 1
    return tree, chunk


def put_into(path, probe, folder):
    """Export into a file; return the package, and the bytes of all of its files by their names."""
    source = Source("sky", "sky.exr", probe)
    made = packaged(source, engines.engine("gltf"), Asked(size=32, into=str(path)))
    write(made, folder)
    return made, {file.name: (folder / file.name).read_bytes() for file in made.files}


def seen(tree, chunk, index):
    view = tree["bufferViews"][index]
    assert view["buffer"] == 0
    return chunk[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]


def test_a_glb_gets_the_light_of_a_gltf(probe, tmp_path):
    (tmp_path / "ball.glb").write_bytes(ball_file(0.5, 0.3, rows=8))
    made, files = put_into(tmp_path / "ball.glb", probe, tmp_path / "out")
    assert set(files) == {"sky_ball.glb", "sky_README.md"}
    assert "sky_ball.glb" in "\n".join(made.loading)
    alone = packaged(Source("sky", "sky.exr", probe), engines.engine("gltf"), Asked(size=32))
    write(alone, tmp_path / "alone")
    wanted = json.loads((tmp_path / "alone" / "sky.gltf").read_text())
    tree, chunk = parts(files["sky_ball.glb"])
    light, other = (each["extensions"][EXTENSION]["lights"][0] for each in (tree, wanted))
    assert EXTENSION in tree["extensionsUsed"]
    assert tree["scenes"][0]["extensions"][EXTENSION] == {"light": 0}
    assert {**light, "specularImages": 0} == {**other, "specularImages": 0}
    assert len(light["specularImages"]) == len(other["specularImages"]) == 2
    for ours, theirs in zip(light["specularImages"], other["specularImages"], strict=True):
        for k, m in zip(ours, theirs, strict=True):
            assert tree["images"][k]["mimeType"] == "image/png"
            picture = (tmp_path / "alone" / wanted["images"][m]["uri"]).read_bytes()
            assert seen(tree, chunk, tree["images"][k]["bufferView"]) == picture
    before = trimesh.load(tmp_path / "ball.glb").to_mesh()
    after = trimesh.load(tmp_path / "out" / "sky_ball.glb").to_mesh()
    assert np.array_equal(before.vertices, after.vertices)
    assert np.array_equal(before.faces, after.faces)
    assert after.visual.material.roughnessFactor == pytest.approx(0.3)


def separate(folder):
    """A .gltf with buffers and a picture in files, and an extension that nobody knows."""
    tree, chunk = parts(ball_file(0.5, 0.3, rows=8))
    cut = tree["bufferViews"][1]["byteOffset"]
    (folder / "points.bin").write_bytes(chunk[:cut])
    (folder / "its corners.bin").write_bytes(chunk[cut:])
    (folder / "textures").mkdir()
    (folder / "textures" / "a b.png").write_bytes(PNG)
    tree["buffers"] = [
        {"uri": "points.bin", "byteLength": cut},
        {"uri": "its%20corners.bin", "byteLength": len(chunk) - cut},
    ]
    tree["bufferViews"][1].update(buffer=1, byteOffset=0, target=34963)
    tree["images"] = [{"uri": "textures/a%20b.png", "name": "paint"}]
    tree["extensionsUsed"] = ["VENDOR_unknown"]
    tree["scenes"].append({"extensions": {"VENDOR_unknown": {"x": 1}}})
    (folder / "ball.gltf").write_text(json.dumps(tree))
    return chunk[:cut], chunk[cut:]


def test_a_gltf_becomes_one_file_with_all_of_it(probe, tmp_path):
    pieces = separate(tmp_path)
    made, files = put_into(tmp_path / "ball.gltf", probe, tmp_path / "out")
    tree, chunk = parts(files["sky_ball.glb"])
    assert [seen(tree, chunk, k) for k in (0, 1)] == list(pieces)
    assert tree["bufferViews"][1]["target"] == 34963
    assert tree["images"][0]["name"] == "paint"
    assert seen(tree, chunk, tree["images"][0]["bufferView"]) == PNG
    assert not [each for each in tree["images"] if "uri" in each]
    assert tree["extensionsUsed"] == ["VENDOR_unknown", EXTENSION]
    both = {"VENDOR_unknown": {"x": 1}, EXTENSION: {"light": 0}}
    assert tree["scenes"][1]["extensions"] == both
    assert "each scene of the file: 2" in "; ".join(made.told)
    (tmp_path / "whole.glb").write_bytes(ball_file(0.5, 0.3, rows=8))
    before = trimesh.load(tmp_path / "whole.glb").to_mesh()
    after = trimesh.load(tmp_path / "out" / "sky_ball.glb").to_mesh()
    assert np.array_equal(before.vertices, after.vertices)


def test_another_light_is_added_and_takes_its_place(probe, tmp_path):
    (tmp_path / "ball.glb").write_bytes(ball_file(0.5, 0.3, rows=8))
    put_into(tmp_path / "ball.glb", probe, tmp_path)
    _, files = put_into(tmp_path / "sky_ball.glb", probe, tmp_path / "again")
    tree, _ = parts(files["sky_sky_ball.glb"])
    first, second = tree["extensions"][EXTENSION]["lights"]
    assert tree["scenes"][0]["extensions"][EXTENSION] == {"light": 1}
    assert not {*np.ravel(first["specularImages"])} & {*np.ravel(second["specularImages"])}


def changed(change):
    def apply(folder):
        separate(folder)
        tree = json.loads((folder / "ball.gltf").read_text())
        change(tree, folder)
        (folder / "ball.gltf").write_text(json.dumps(tree))

    return apply


def linked(path):
    path.unlink()
    path.symlink_to("/etc/hostname")


REFUSED = {
    "no scene": (lambda tree, _: tree.pop("scenes"), "no scene"),
    "elsewhere": (lambda tree, _: tree["images"][0].update(uri="../a.png"), "in its folder"),
    "a link": (lambda _, folder: linked(folder / "points.bin"), "in its folder"),
    "a picture is missing": (lambda _, at: (at / "textures/a b.png").unlink(), "is missing"),
    "another picture": (lambda tree, _: tree["images"][0].update(uri="a.tga"), "no PNG"),
    "compressed": (lambda tree, _: tree.update(extensionsUsed=["EXT_meshopt_compression"]), "comp"),
    "a view beyond": (lambda tree, _: tree["bufferViews"][0].update(byteLength=10**6), "beyond"),
    "lights are none": (lambda tree, _: tree.update(extensions={EXTENSION: []}), "damaged"),
    "version 1": (lambda tree, _: tree["asset"].update(version="1.0"), "version"),
}


@pytest.mark.parametrize("change", REFUSED.values(), ids=REFUSED)
def test_what_cannot_hold_a_light_is_refused(probe, tmp_path, change):
    changed(change[0])(tmp_path)
    with pytest.raises((MapError, MeshError), match=change[1]) as caught:
        put_into(tmp_path / "ball.gltf", probe, tmp_path / "out")
    assert str(tmp_path / "ball.gltf") in str(caught.value)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", sorted(set(ENGINES) - {"gltf"}))
def test_other_engines_take_no_asset(probe, name):
    with pytest.raises(ArgumentError, match="does not apply"):
        packaged(Source("sky", "sky.exr", probe), engines.engine(name), Asked(into="ball.glb"))
