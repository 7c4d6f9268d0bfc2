"""The tool of examples/houdini: its shelf, and what the script does.

Houdini itself is not at hand: a stand-in has the few of its functions that are called. The command
is a real one.
"""

import os
import shlex
import sys
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.cli.helpers import ROOT, read_exr, write_exr

FOLDER = ROOT / "examples" / "houdini"
NAME = "li\"ght's (1) 灯"
COLOR = np.array([1.0, 2.0, 0.5])


class Parameter:
    """A parameter; like others of Houdini's objects, it is no truth value."""

    def __init__(self, value=""):
        self.value = value

    def set(self, value):
        self.value = value

    def __bool__(self):
        raise TypeError


class Node:
    def __init__(self, *names):
        self.parameters = {name: Parameter() for name in names}
        self.children, self.is_placed = [], False

    def parm(self, name):
        return self.parameters.get(name)

    def createNode(self, kind, name):
        assert kind == "envlight"
        self.children.append(Node("t", "env_map"))
        return self.children[-1]

    def moveToGoodPosition(self):
        self.is_placed = True

    def texture(self, name):
        return self.parameters[name].value


class Houdini(ModuleType):
    """The module: a scene with what is selected, and answers to what is asked."""

    def __init__(self, folder):
        super().__init__("hou")
        self.said, self.selected, self.objects = [], [], Node()
        self.probe, self.brdf, self.button = "$HIP/probe.exr", "", 0
        self.severityType = SimpleNamespace(Error="error")
        self.fileType = SimpleNamespace(Image="image")
        self.text = SimpleNamespace(expandString=lambda text: text.replace("$HIP", str(folder)))
        self.ui = SimpleNamespace(
            selectFile=lambda title, file_type: self.probe,
            readInput=lambda message, buttons, close_choice, title: (self.button, self.brdf),
            displayMessage=lambda text, severity: self.said.append((severity, text)),
        )

    def selectedNodes(self):
        return tuple(self.selected)

    def node(self, path):
        assert path == "/obj"
        return self.objects

    def press(self):
        shelf = ElementTree.parse(FOLDER / "toolbar" / "shrm.shelf").getroot()
        exec(shelf.find("tool/script").text, {})


@pytest.fixture
def hou(tmp_path, monkeypatch):
    """Houdini with a probe beside its scene, and a command whose path has spaces and quotes."""
    folder = tmp_path / 'a "scene\'s" folder'
    folder.mkdir()
    found = Houdini(folder)
    monkeypatch.setitem(sys.modules, "hou", found)
    monkeypatch.syspath_prepend(str(FOLDER / "scripts" / "python"))
    monkeypatch.delitem(sys.modules, "shrm_houdini", raising=False)
    monkeypatch.setenv("PYTHONHOME", "/nowhere")  # as Houdini may have it
    program = tmp_path / "the program's.py"
    code = (
        "import runpy, sys; sys.path.insert(0, {!r}); runpy.run_module('shrm_cli', run_name={!r})"
    )
    program.write_text(code.format(str(ROOT), "__main__"))
    monkeypatch.setenv("SHRM", shlex.join([sys.executable, str(program)]))
    y = np.cos(np.pi * (np.arange(32) + 0.5) / 32)
    light = np.broadcast_to((1 + 0.5 * y)[:, None, None] * COLOR, (32, 64, 3))
    found.light = light.astype(np.float32)
    write_exr(folder / f"{NAME}.exr", found.light)
    found.probe, found.folder = f"$HIP/{NAME}.exr", folder
    yield found
    sys.modules.pop("shrm_houdini", None)


def test_the_shelf_names_a_tool_whose_script_is_beside_it():
    shelf = ElementTree.parse(FOLDER / "toolbar" / "shrm.shelf").getroot()
    assert shelf.tag == "shelfDocument"
    (member,), (tool,) = shelf.findall("toolshelf/memberTool"), shelf.findall("tool")
    assert member.get("name") == tool.get("name")
    assert tool.find("script").get("scriptType") == "python"
    names = {path.relative_to(FOLDER).as_posix() for path in FOLDER.rglob("*") if path.is_file()}
    held = {name for name in names if not name.endswith(".pyc")}
    assert held == {"toolbar/shrm.shelf", "scripts/python/shrm_houdini.py"}


@pytest.mark.slow
def test_the_tool_makes_a_light_of_the_probe(hou):
    """Its panorama lies as the probe does: Houdini, too, goes by OpenEXR's definition."""
    hou.press()
    assert hou.said == []
    (made,) = hou.objects.children
    assert made.is_placed
    texture = made.texture("env_map")
    assert texture == (hou.folder / "shrm" / NAME / f"{NAME}_dome.exr").as_posix()
    channels = read_exr(texture)[1]
    for k, channel in enumerate("RGB"):
        assert channels[channel] == pytest.approx(hou.light[..., k], rel=2e-3)


@pytest.mark.slow
def test_the_tool_shows_a_material_by_selected_lights(hou):
    """A white surface reflects 1 + n.y / 3 of that light; a mirror shows R, 2 n.v n - v."""
    texture, control = "xn__inputstexturefile_r3ah", "xn__inputstexturefile_control_shbh"
    other, dome = Node("t"), Node(texture, control)
    hou.selected, hou.brdf = [other, dome, Node("env_map")], " lambertian "
    hou.press()
    hou.press()  # again: what is there is made anew
    assert (hou.said, hou.objects.children) == ([], [])
    assert dome.texture(control) == "set"
    texture = dome.texture(texture)
    assert texture == (hou.folder / "shrm" / f"{NAME}.latlong.exr").as_posix()
    assert hou.selected[2].texture("env_map") == texture
    assert other.texture("t") == ""
    found = read_exr(texture)[1]["G"]
    rows, columns = found.shape
    theta = np.pi * (np.arange(rows) + 0.5) / rows
    phi = np.pi - 2 * np.pi * (np.arange(columns) + 0.5) / columns  # from +Z towards +X
    mirrored = np.stack(
        [np.outer(np.sin(theta), np.sin(phi)), np.outer(np.cos(theta), np.ones(columns)),
         np.outer(np.sin(theta), np.cos(phi))], axis=-1,
    )  # fmt: skip
    normals = mirrored + np.array([0, 0, 1])
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    seen = mirrored[..., 2] > -0.95  # all around the silhouette R is -V
    assert found[seen] == pytest.approx(2 * (1 + normals[..., 1] / 3)[seen], rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"probe": "no such.exr"}, "shrm: no such.exr: "),
        ({"brdf": "gxx"}, "shrm: "),
        ({"probe": "$HIP/a$b.exr"}, "shrm: "),
        ({"command": "no-such-shrm"}, "shrm: there is no command no-such-shrm; name it in SHRM"),
    ],
)
def test_what_is_wrong_is_one_line(hou, monkeypatch, change, line):
    if "command" in change:
        monkeypatch.setenv("SHRM", change["command"])
    for name, value in change.items():
        setattr(hou, name, value)
    hou.press()
    ((severity, told),) = hou.said
    assert (severity, len(told.splitlines())) == ("error", 1)
    assert told.startswith(line)
    assert change.get("brdf", "") in told
    assert "Traceback" not in told
    assert hou.objects.children == []


@pytest.mark.parametrize("change", [{"probe": ""}, {"button": 1}])
def test_who_cancels_gets_nothing(hou, change):
    for name, value in change.items():
        setattr(hou, name, value)
    hou.press()
    assert (hou.said, hou.objects.children) == ([], [])


def test_backslashes_of_windows_are_parts_of_paths(hou, monkeypatch):
    import shrm_houdini

    command = r'"C:\Program Files\new\python.exe" -m shrm_cli \\server\tools'
    monkeypatch.setattr(os, "sep", "\\")
    found = shrm_houdini.words_of(command)
    monkeypatch.undo()
    assert found == [r"C:\Program Files\new\python.exe", "-m", "shrm_cli", r"\\server\tools"]
    assert shrm_houdini.words_of(r"/my\ tools/shrm#2 --quiet") == ["/my tools/shrm#2", "--quiet"]
