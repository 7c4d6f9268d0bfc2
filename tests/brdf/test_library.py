"""Models are found by their files, and by the entry points of what is installed."""

import json
import sys
from importlib import metadata
from subprocess import run as start

import numpy as np
import pytest

from shrm_cli.brdf import models
from shrm_cli.brdf.library import all_models, built_in_names, find_model, model_names
from shrm_cli.brdf.spec import names_file, parse_spec
from shrm_cli.errors import ArgumentError, BrdfError
from tests.cli.helpers import done, environment, run, write_package

VELVET = '''
import numpy as np
from shrm_cli.brdf.base import Brdf, Parameter


class Velvet(Brdf):
    """A constant."""

    name = "red-velvet"
    source = "nobody"
    parameters = (Parameter("level", 0.5, 0, 1, "its value"),)
    center = "normal"

    def evaluate(self, light, view):
        shape = np.broadcast_shapes(light.shape, view.shape)
        return np.full(shape, self.number("level"), light.dtype)


class RedVelvetLiner(Velvet):
    name = "liner"
'''


@pytest.mark.parametrize("name", built_in_names())
def test_each_module_has_exactly_one_model_of_its_name(name):
    module = sys.modules[find_model(name).__module__]
    places = [f"shrm_cli.brdf.{each}.{name.replace('-', '_')}" for each in ("models", "layered")]
    assert module.__name__ in places
    model = find_model(name)
    assert model.name == name
    assert [v for v in vars(module).values() if getattr(v, "name", "") == name] == [model]
    for key in ("name", "summary", "source", "parameters"):
        assert vars(model)[key], key
    assert model.__doc__


@pytest.mark.parametrize("name", built_in_names())
def test_models_are_evaluated_for_vectors_alone_of_any_kind(name):
    brdf, up = find_model(name)(), [0, 0, 1]
    for light, view, said in (
        ("up", up, "`light` are no numbers"),
        (np.ones((4, 2)), np.ones((4, 2)), "`light` of shape .4, 2. are no vectors"),
        (np.ones((4, 3)), np.ones((5, 3)), "`view` of shape .5, 3. do not go with light"),
    ):
        with pytest.raises(ArgumentError, match=said):
            brdf.evaluate(light, view)
        with pytest.raises(ArgumentError, match=said):
            brdf.transfer(light, view)
    # Whole numbers once gave whole radiance, or another value than the same floats.
    found = np.array(up, float)
    assert brdf.evaluate(up, [up]).tolist() == [brdf.evaluate(found, found).tolist()]
    assert brdf.transfer(up, [up]).tolist() == [brdf.transfer(found, found).tolist()]
    assert brdf.evaluate(found.astype(np.float32), found.astype(np.float32)).dtype == np.float32


def test_there_are_eighteen():
    assert len(built_in_names()) == 18
    assert built_in_names() == sorted(built_in_names())
    assert {"ggx", "kajiya-kay", "lambertian"} <= set(built_in_names())


def test_only_the_model_that_is_asked_for_is_loaded():
    code = (
        "import sys\n"
        "from shrm_cli.brdf.spec import parse_spec\n"
        "from shrm_cli.brdf.library import model_names\n"
        "model_names()\n"
        "prefix = 'shrm_cli.brdf.models.'\n"
        "print(sorted(name for name in sys.modules if name.startswith(prefix)))\n"
        "parse_spec('ggx')\n"
        "print(sorted(name for name in sys.modules if name.startswith(prefix)))\n"
    )
    found = start([sys.executable, "-c", code], env=environment(), capture_output=True, text=True)
    assert found.stdout == "[]\n['shrm_cli.brdf.models.ggx']\n"


def test_a_new_model_is_one_new_file(tmp_path, monkeypatch):
    (tmp_path / "red_velvet.py").write_text(VELVET)
    monkeypatch.setattr(models, "__path__", [*models.__path__, str(tmp_path)])
    assert find_model("red-velvet").summary == "A constant."
    assert parse_spec("red-velvet:level=0.25").evaluate(np.ones(3), np.ones(3))[1] == 0.25
    listed = [each["name"] for each in json.loads(done("brdf", "--json"))]
    assert "red-velvet" in listed
    assert "liner" not in listed
    text = done("brdf")
    assert text.index("  oren-nayar ") < text.index("  red-velvet ") < text.index("Glossy")
    with pytest.raises(BrdfError, match="did you mean red-velvet"):
        parse_spec("red_velvet")


@pytest.mark.parametrize("text", ["", "from shrm_cli.brdf.models.ggx import Ggx as Velvet\n"])
def test_a_module_without_its_model_is_said(tmp_path, monkeypatch, text):
    (tmp_path / "odd_one.py").write_text(text)
    monkeypatch.setattr(models, "__path__", [*models.__path__, str(tmp_path)])
    with pytest.raises(BrdfError, match="odd_one: holds 0 BRDFs called 'odd-one', not one"):
        find_model("odd-one")


# Installed packages.


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Make a package with entry points of the group importable, as an installer would."""

    def make(points, code=VELVET):
        write_package(tmp_path / "site", "velvets", "shrm.brdf", points, code)
        monkeypatch.syspath_prepend(str(tmp_path / "site"))
        monkeypatch.delitem(sys.modules, "velvets", raising=False)

    yield make
    sys.modules.pop("velvets", None)


def test_an_installed_package_adds_a_model(install):
    install({"red-velvet": "velvets:Velvet"})
    assert model_names() == sorted([*built_in_names(), "red-velvet"])
    assert parse_spec("red-velvet:level=0.25").evaluate(np.ones(3), np.ones(3))[1] == 0.25
    assert repr(parse_spec("0.5*red-velvet+0.5*ggx")).startswith("0.5*red-velvet:level=0.5+0.5*ggx")
    assert "  red-velvet         A constant.\n" in done("brdf")
    assert "lambertian:albedo=1" in done("brdf", "lambertian", "--eps", 0.1)
    assert done("brdf", "red-velvet", "--eps", 0.1).startswith("red-velvet:level=0.5: A constant.")
    with pytest.raises(BrdfError, match="did you mean red-velvet"):
        parse_spec("redvelvet")


def test_its_name_is_no_file(install, tmp_path, monkeypatch):
    install({"red-velvet": "velvets:Velvet"})
    monkeypatch.chdir(tmp_path)
    for name in ("red-velvet", "blue-velvet"):
        (tmp_path / name).write_text("x")
    assert not names_file("red-velvet")
    assert not names_file("red-velvet:level=0.5")
    assert names_file("blue-velvet")


def test_models_of_shrm_win(install):
    install({"ggx": "velvets:Velvet"})
    assert find_model("ggx").__module__ == "shrm_cli.brdf.models.ggx"
    assert done("brdf").count("  ggx ") == 1


BROKEN = {
    "gone": ("nowhere_at_all:Velvet", "cannot be loaded: ModuleNotFoundError: No module named"),
    "lost": ("velvets:Silk", "cannot be loaded: AttributeError"),
    "number": ("velvets:np", "is not a subclass of Brdf"),
    "mute": ("velvets:Mute", "has no method evaluate"),
    "other": ("velvets:Velvet", "a BRDF that calls itself 'red-velvet'; give both one name"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_one_is_one_line(install, name):
    value, words = BROKEN[name]
    install({name: value, "red-velvet": "velvets:Velvet"}, VELVET + "class Mute(Brdf):\n    pass\n")
    with pytest.raises(BrdfError, match=words) as caught:
        parse_spec(name)
    assert f"{name}: the entry point '{value}' of the package velvets " in str(caught.value)
    assert "\n" not in str(caught.value)
    for options in ([], ["--json"]):
        result = run("brdf", *options)
        assert result.code == 0
        assert "red-velvet" in result.out
        assert result.err.startswith(f"Warning: {name}: the entry point")
        assert result.err.count("\n") == 1
    assert run("brdf", "--quiet").err == ""


@pytest.mark.parametrize("code", ["raise SystemExit(3)", "1 / 0", "def x(:", "'\x00'"])
def test_one_whose_module_fails_is_one_line(install, code):
    install({"red-velvet": "velvets:Velvet"}, code)
    with pytest.raises(BrdfError, match=r"red-velvet: the entry point .* cannot be loaded: "):
        parse_spec("red-velvet")
    models, problems = all_models()
    assert [model.name for model in models] == built_in_names()
    assert len(problems) == 1


def test_the_first_of_two_of_one_name_is_taken(install, monkeypatch):
    install({"red-velvet": "velvets:Velvet"})
    twice = [*metadata.entry_points(group="shrm.brdf")] * 2
    monkeypatch.setattr(metadata, "entry_points", lambda group: twice)
    assert model_names().count("red-velvet") == 1
