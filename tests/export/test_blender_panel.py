"""The panel of examples/blender where the command is wrong; Blender's modules are stand-ins."""

import runpy
import sys
from types import SimpleNamespace as Space

import pytest

from tests.cli.helpers import ROOT


class Base:
    """What operators, panels and settings derive from."""


@pytest.fixture
def operator(tmp_path, monkeypatch):
    """The operator that sets the world, its context, and what it reports."""
    names = ("AddonPreferences", "PropertyGroup", "Operator", "Panel")
    props = Space(StringProperty=lambda **_: None)
    types = Space(**{name: type(name, (Base,), {}) for name in names})
    bpy = Space(types=types, props=props, path=Space(abspath=lambda path: path))
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    loaded = runpy.run_path(str(ROOT / "examples/blender/__init__.py"))
    told = []
    made = loaded["SHRM_OT_world"]()
    made.report = lambda kind, line: told.append((kind, line))
    addons = {loaded["__package__"]: Space(preferences=Space(command=""))}
    settings = Space(folder=str(tmp_path), probe=str(tmp_path / "p.exr"))
    context = Space(preferences=Space(addons=addons), scene=Space(shrm=settings))
    return made, context, addons[loaded["__package__"]].preferences, told


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("it's/shrm", "No closing quotation"),
        ("no-such-shrm", "there is no command no-such-shrm; name it in Preferences"),
        (f"'{sys.executable}' -m shrm_cli", "p.exr: no such file; check its name"),
        (f"""'{sys.executable}' -c 'print("{{")'""", "Expecting property name"),
    ],
)
def test_a_wrong_command_is_one_line(operator, command, said):
    """What is wrong in the quotes of a path was a trace of Python in Blender."""
    made, context, preferences, told = operator
    preferences.command = command
    assert made.execute(context) == {"CANCELLED"}
    ((kind, line),) = told
    assert kind == {"ERROR"}
    assert said in line
    assert "\n" not in line
