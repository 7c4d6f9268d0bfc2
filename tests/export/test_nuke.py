"""The node of examples/nuke: its file by the grammar of Nuke's scripts, and what its button does.

Nuke itself is not at hand: a stand-in has the few of its functions that are called. The command is
a real one.
"""

import os
import re
import shlex
import sys
from contextlib import nullcontext
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from shrm_cli.maps.file import open_map
from tests.cli.helpers import ROOT, read_exr, write_exr

FOLDER = ROOT / "examples" / "nuke"
NAME = "li\"ght's (1) 灯"
COLOR = np.array([1.0, 2.0, 0.5])
KINDS = {20: "tab", 2: "file", 1: "text", 7: "number", 4: "choice", 22: "button"}
"""Numbers of kinds of knobs, which Nuke's guide for developers lists."""

_SPACE = re.compile(r"[ \t]*")
_BARE = re.compile(r"(?:[^\s\\\[$\"{}]|\\.)+")
_QUOTED = re.compile(r"(?:[^\\\"\[$]|\\.)*\"", re.DOTALL)
_ESCAPED = re.compile(r"\\(.)", re.DOTALL)


def unescaped(text):
    return _ESCAPED.sub(lambda found: {"n": "\n", "t": "\t"}.get(found[1], found[1]), text)


def words(text, at=0):
    """Yield lists of the words of each command, as Tcl reads them; those in braces are kept raw.

    Brackets and dollar signs that are not escaped would be expressions, and are refused.
    """
    line = []
    while at < len(text):
        at = _SPACE.match(text, at).end()
        if text.startswith("\n", at) or at == len(text):
            if line:
                yield line
            line, at = [], at + 1
        elif text[at] == "{":
            end, depth = at + 1, 1
            while depth:
                step = 2 if text[end] == "\\" else 1
                depth += {"{": 1, "}": -1}.get(text[end], 0) if step == 1 else 0
                end += step
            line.append(text[at + 1 : end - 1])
            at = end
        else:
            is_quoted = text[at] == '"'
            found = (_QUOTED if is_quoted else _BARE).match(text, at + is_quoted)
            assert found, f"no word at {text[at : at + 40]!r}"
            line.append(unescaped(found[0].removesuffix('"') if is_quoted else found[0]))
            at = found.end()
    if line:
        yield line


def test_the_parser_reads_what_nuke_writes():
    """Lines of scripts that Nuke 10 to 15 wrote."""
    text = (
        "Group {\n name A\n"
        ' addUserKnob {22 go l "Go on" -STARTLINE T "n\\[0].x(\\"b\\")\\nc"}\n'
        ' addUserKnob {4 view M {main "" cams}}\n gamma {{curve x1 1}}\n}\nend_group\n'
    )
    (group, body), end = words(text)
    assert (group, end) == ("Group", ["end_group"])
    name, button, choice, gamma = words(body)
    assert (name, gamma) == (["name", "A"], ["gamma", "{curve x1 1}"])
    (button,) = words(button[1])
    assert button == ["22", "go", "l", "Go on", "-STARTLINE", "T", 'n[0].x("b")\nc']
    assert list(words(next(words(choice[1]))[3])) == [["main", "", "cams"]]
    with pytest.raises(AssertionError, match="no word at"):
        list(words('file "[value name].exr"'))


class Knob:
    """A knob of a kind, with what Nuke's reference says that it has."""

    def __init__(self, kind, value, choices=(), script=""):
        self.kind, self._value, self.choices, self.script = kind, value, choices, script

    def value(self):
        assert self.kind in ("text", "number", "choice", "file", "switch")
        return self._value

    def setValue(self, value):
        assert self.kind != "choice" or value in self.choices
        self._value = value

    def evaluate(self):
        assert self.kind == "file"
        return self._value or None

    def fromUserText(self, value):
        assert self.kind == "file"
        self._value = value

    def execute(self):
        assert self.kind == "button"
        self._value += 1


class Node(dict):
    """A node: its knobs by their names."""

    def __init__(self, group, place=(0, 0), **knobs):
        super().__init__(knobs)
        self._group, self.place = group, place

    def parent(self):
        return self._group

    def xpos(self):
        return self.place[0]

    def ypos(self):
        return self.place[1]

    def setXYpos(self, x, y):
        self.place = x, y


class Nuke(ModuleType):
    """The module, with a script that holds the node and what is made beside it."""

    def __init__(self):
        super().__init__("nuke")
        self.said, self.printed, self.commands, self.made = [], [], {}, []
        self.group = nullcontext()
        self.nodes = SimpleNamespace(Read=self._read)
        self.message, self.tprint = self.said.append, self.printed.append

    def _read(self):
        knobs = {
            "file": Knob("file", ""),
            "raw": Knob("switch", False),
            "reload": Knob("button", 0),
        }
        self.made.append(Node(self.group, **knobs))
        return self.made[-1]

    def allNodes(self, kind):
        assert kind == "Read"
        return list(self.made)

    def menu(self, name):
        assert name == "Nodes"
        return SimpleNamespace(addCommand=self.commands.__setitem__)

    def createNode(self, name):
        self.node = Node(self.group, (40, 7), **knobs_of(FOLDER / f"{name}.gizmo"))
        return self.node

    def thisNode(self):
        return self.node

    def press(self):
        exec(self.node["make"].script, {"nuke": self})


def knobs_of(path):
    """The user's knobs of the group in a file, with their defaults."""
    commands = list(words(path.read_text(encoding="utf-8")))
    assert [each[0] for each in commands] == ["Group", "Input", "Output", "end_group"]
    knobs, defaults = {}, {}
    for name, value in words(commands[0][1]):
        if name != "addUserKnob":
            defaults[name] = value
            continue
        ((number, name, *more),) = words(value)
        if KINDS[int(number)] == "tab":
            continue
        flags = [each for each in more if each[:1] in "+-" and each[1:].isupper()]
        more = [each for each in more if each not in flags]
        told = {}
        while more:
            letter = more.pop(0)
            told[letter] = [more.pop(0) for _ in range(2 if letter == "R" else 1)]
        assert told.keys() <= set("ltMRT"), name
        choices = next(words(told["M"][0])) if "M" in told else ()
        knobs[name] = Knob(
            KINDS[int(number)], choices[0] if choices else "", choices, *told.get("T", ())
        )
    for name in knobs.keys() & defaults.keys():
        is_number = knobs[name].kind == "number"
        knobs[name].setValue(float(defaults[name]) if is_number else defaults[name])
    assert defaults.keys() - knobs.keys() == {"name", "help"}
    return knobs


@pytest.fixture
def nuke(tmp_path, monkeypatch):
    """Nuke with the node, a probe, and a command whose path has spaces and quotes."""
    found = Nuke()
    monkeypatch.setitem(sys.modules, "nuke", found)
    monkeypatch.setenv("PYTHONHOME", "/nowhere")  # as Nuke may have it
    monkeypatch.syspath_prepend(str(FOLDER))
    monkeypatch.delitem(sys.modules, "shrm_nuke", raising=False)
    exec((FOLDER / "menu.py").read_text(), {})
    (command,) = found.commands.values()
    exec(command, {"nuke": found})
    y = np.cos(np.pi * (np.arange(32) + 0.5) / 32)
    light = np.broadcast_to((1 + 0.5 * y)[:, None, None] * COLOR, (32, 64, 3))
    probe = tmp_path / f"{NAME}.exr"
    write_exr(probe, light.astype(np.float32))
    program = tmp_path / "the program's.py"
    program.write_text(
        f"import runpy, sys\nsys.path.insert(0, {str(ROOT)!r})\n"
        "runpy.run_module('shrm_cli', run_name='__main__')\n"
    )
    found.node["command"].setValue(shlex.join([sys.executable, str(program)]))
    found.node["probe"].setValue(str(probe))
    yield found
    sys.modules.pop("shrm_nuke", None)


def test_the_node_has_what_the_page_says(nuke):
    assert list(nuke.commands) == ["Image/shrm"]
    assert list(nuke.node) == ["probe", "brdf", "error", "view", "by", "output", "command", "make"]
    assert nuke.node["error"].value() == 0.05
    assert nuke.node["by"].value() == "normal"


@pytest.mark.slow
def test_the_button_makes_a_lat_long_and_reads_it(nuke, tmp_path):
    """A white surface reflects 1 + n.y / 3 of that light, whatever the view."""
    target = tmp_path / 'new "folder"' / f"{NAME} 1-20.exr"
    nuke.node["brdf"].setValue("lambertian")
    nuke.node["output"].setValue(str(target))
    nuke.press()
    assert nuke.said == []
    (read,) = nuke.made
    assert read["file"].value() == target.as_posix()
    assert read["raw"].value() is True
    assert read.place == (40, 107)
    found = read_exr(target)[1]["G"]
    up = np.cos(np.pi * (np.arange(len(found)) + 0.5) / len(found))
    assert found == pytest.approx(np.repeat(2 * (1 + up / 3)[:, None], found.shape[1], 1), rel=0.02)
    nuke.press()  # again: the same node reads it anew
    assert nuke.said == []
    assert nuke.made == [read]
    assert read["reload"]._value == 1


@pytest.mark.slow
def test_without_a_view_the_map_itself_is_written(nuke, tmp_path):
    nuke.node["view"].setValue("")
    nuke.node["error"].setValue(0.2)
    nuke.node["output"].setValue(str(tmp_path / f"{NAME}.map.exr"))
    nuke.press()
    assert nuke.said == []
    made = open_map(nuke.made[0]["file"].value())
    assert made.info.options["error"] == 0.2
    assert made.info.brdf["name"] == "ggx"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("knob", "value", "line"),
    [
        ("probe", "", "shrm: name a probe and an output"),
        ("output", "", "shrm: name a probe and an output"),
        ("output", "a[b]%04d.exr", "shrm: a[b]%04d.exr: Nuke reads % [ ] as no name; name it "),
        ("probe", "no such.exr", "shrm: no such.exr: "),
        ("brdf", "gxx", "shrm: "),
        ("brdf", "", "shrm: "),
        ("view", "up", "shrm: "),
        ("command", "no-such-shrm", "shrm: there is no command no-such-shrm; name it in Command"),
        ("command", "'", "shrm: No closing quotation"),
    ],
)
def test_what_is_wrong_is_one_line(nuke, tmp_path, knob, value, line):
    target = tmp_path / "out.exr"
    nuke.node["output"].setValue(str(target))
    nuke.node[knob].setValue(value)
    nuke.press()
    (told,) = nuke.said
    assert told.startswith(line)
    assert len(told.splitlines()) == 1
    assert "Traceback" not in told
    assert value in told or knob != "brdf"
    assert (nuke.made, target.exists()) == ([], False)


def test_the_folder_holds_what_nuke_looks_for():
    names = {each.name for each in FOLDER.iterdir() if each.is_file()}
    assert names == {"menu.py", "shrm.gizmo", "shrm_nuke.py"}
    assert Path(FOLDER / "shrm.gizmo").read_bytes().isascii()


def test_backslashes_of_windows_are_parts_of_paths(nuke, monkeypatch):
    import shrm_nuke

    command = r'"C:\Program Files\new\python.exe" -m shrm_cli \\server\tools'
    monkeypatch.setattr(os, "sep", "\\")
    found = shrm_nuke.words_of(command)
    monkeypatch.undo()
    assert found == [r"C:\Program Files\new\python.exe", "-m", "shrm_cli", r"\\server\tools"]
    assert shrm_nuke.words_of(r"/my\ tools/shrm#2 --quiet") == ["/my tools/shrm#2", "--quiet"]
