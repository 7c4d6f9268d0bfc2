"""The script of `shrm export --for blender` and the extension: Blender's API, and Blender itself.

SHRM_BLENDER names a Python that has the package `bpy`, for the latter: `make blender` installs it.
"""

import importlib.util
import json
import os
import runpy
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.export.engine import engine
from shrm_cli.export.make import Asked, Source, packaged, write
from tests.cli.helpers import ROOT, done, write_exr
from tests.web import letters

NAME = "li\"ght's 灯"


_SOCKETS = {
    "ShaderNodeTexEnvironment": (["Vector"], ["Color"]),
    "ShaderNodeBackground": (["Color", "Strength"], ["Background"]),
    "ShaderNodeOutputWorld": (["Surface", "Volume"], []),
}
"""The sockets of nodes that the script uses, by Blender's manual."""


class Node:
    """A node of the kinds that the script makes; other attributes cannot be set."""

    __slots__ = ("image", "inputs", "kind", "location", "outputs")

    def __init__(self, kind):
        self.kind = kind
        self.inputs, self.outputs = (
            {name: SimpleNamespace(node=self, name=name, default_value=None) for name in names}
            for names in _SOCKETS[kind]
        )


class Nodes(list):
    def new(self, kind):
        self.append(Node(kind))
        return self[-1]


class Links(list):
    def new(self, source, target):
        self.append((source, target))


class World:
    __slots__ = ("name", "node_tree", "use_nodes")

    def __init__(self, name):
        self.name = name
        tree = SimpleNamespace(nodes=Nodes([Node("ShaderNodeBackground")]), links=Links())
        self.node_tree = tree


def exported(folder):
    write(
        packaged(Source(NAME, "x.exr", letters.lettered_probe()), engine("blender"), Asked()),
        folder,
    )
    return folder / f"{NAME}_world.py"


def test_the_script_makes_a_world_of_the_picture(tmp_path, monkeypatch):
    script = exported(tmp_path)
    loaded = []

    def load(path):
        assert Path(path).is_file()
        loaded.append(SimpleNamespace(colorspace_settings=SimpleNamespace(name="sRGB")))
        return loaded[-1]

    bpy = ModuleType("bpy")
    bpy.data = SimpleNamespace(images=SimpleNamespace(load=load), worlds=SimpleNamespace(new=World))
    bpy.context = SimpleNamespace(scene=SimpleNamespace(world=None))
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    runpy.run_path(str(script))
    world = bpy.context.scene.world
    assert (world.name, world.use_nodes) == (NAME, True)
    texture, background, output = world.node_tree.nodes
    assert texture.image is loaded[0]
    assert texture.image.colorspace_settings.name == "Linear Rec.709"
    assert background.inputs["Strength"].default_value == 1
    assert world.node_tree.links == [
        (texture.outputs["Color"], background.inputs["Color"]),
        (background.outputs["Background"], output.inputs["Surface"]),
    ]


@pytest.fixture
def extension(monkeypatch):
    """The extension, beside as much of Blender as it touches when it is imported."""
    bpy = ModuleType("bpy")
    names = ("AddonPreferences", "PropertyGroup", "Operator", "Panel")
    bpy.types = SimpleNamespace(**{name: type(name, (), {}) for name in names})
    bpy.props = SimpleNamespace(StringProperty=lambda **described: str)
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    path = ROOT / "examples" / "blender" / "__init__.py"
    spec = importlib.util.spec_from_file_location("shrm_extension", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def context_of(command):
    own = SimpleNamespace(preferences=SimpleNamespace(command=command))
    return SimpleNamespace(preferences=SimpleNamespace(addons={"shrm_extension": own}))


def test_the_extension_finds_the_world_of_six_files(extension, tmp_path, monkeypatch):
    """Their name is `sky_%.exr`, and those of the files that are made begin with `sky`."""
    for face in ("+X", "-X", "+Y", "-Y", "+Z", "-Z"):
        write_exr(tmp_path / f"sky_{face}.exr", np.ones((8, 8, 3), np.float32))
    operator, ran = extension.SHRM_OT_world(), []
    monkeypatch.setattr(operator, "run", lambda context, *given: done(*given), raising=False)
    monkeypatch.setattr(extension.runpy, "run_path", ran.append)
    operator.work(None, None, tmp_path / "sky_%.exr", tmp_path)
    assert [Path(each) for each in ran] == [tmp_path / "world" / "sky_world.py"]
    assert Path(ran[0]).is_file()


def test_the_extension_says_that_there_is_no_command(extension):
    with pytest.raises(RuntimeError, match="there is no command no-such-shrm; name it in"):
        extension.SHRM_OT_world().run(context_of("no-such-shrm -q"), "info")


@pytest.mark.skipif("SHRM_BLENDER" not in os.environ, reason="SHRM_BLENDER names a Python with bpy")
def test_letters_can_be_read_in_blender(tmp_path):
    script = exported(tmp_path)
    program = Path(__file__).parent / "blender_letters.py"
    around = json.dumps(letters.AROUND)
    command = [os.environ["SHRM_BLENDER"], program, script, tmp_path, around]
    subprocess.run([*map(str, command)], check=True, capture_output=True)
    for name in letters.AROUND:
        pixels = oiio.ImageBuf(str(tmp_path / f"{name}.exr")).get_pixels()
        picture, text = np.asarray(pixels)[..., :3], letters.written(name)
        right = letters.likeness(picture, text)
        assert right > 0.97, name
        for wrong in (text[:, ::-1], text[::-1], text.T):
            assert letters.likeness(picture, wrong) < right - 0.1
        assert np.abs(picture[..., 1] - text)[4:-4, 4:-4].mean() < 0.02  # and is as bright


@pytest.mark.proof
@pytest.mark.skipif("SHRM_BLENDER" not in os.environ, reason="SHRM_BLENDER names a Python with bpy")
def test_the_extension_in_blender(tmp_path):
    """A ball in the world that the panel makes looks as the truth of `shrm reference` does."""
    user = tmp_path / "user"
    for kind in ("config", "scripts", "extensions"):
        (user / kind).mkdir(parents=True)
    probe, view = ROOT / "probes" / "studio.exr", (40, 20)
    command = f"{sys.executable} -m shrm_cli"
    subprocess.run(
        [os.environ["SHRM_BLENDER"], Path(__file__).parent / "blender_extension.py",
         ROOT / "examples" / "blender", command, probe, tmp_path, *map(str, view)],
        env={**os.environ, "PYTHONPATH": str(ROOT), "BLENDER_USER_RESOURCES": str(user)},
        check=True,
    )  # fmt: skip
    rows, columns = (np.mgrid[:32, :32] - 15.5) / (0.45 * 32)
    inside = np.hypot(rows, columns) < 0.9
    for kind, brdf in (("Diffuse", "lambertian"), ("Glossy", "ggx:roughness=0.5,f0=1")):
        truth = tmp_path / f"{kind}.truth.exr"
        place = f"{view[0]},{view[1]}"
        done("reference", probe, "--brdf", brdf, "--view", place, "--size", 32, "-o", truth)
        found, wanted = (
            np.asarray(oiio.ImageBuf(str(path)).get_pixels())[..., :3]
            for path in (tmp_path / f"{kind}.exr", truth)
        )
        off = np.abs(found - wanted)[inside].mean() / wanted[inside].mean()
        mirrored = np.abs(found[:, ::-1] - wanted)[inside].mean() / wanted[inside].mean()
        assert off < 0.02, kind
        assert mirrored > 3 * off
        assert found[inside].mean() == pytest.approx(wanted[inside].mean(), rel=0.01)
