"""Commands and engines of installed packages, and the example that docs/plugins.md is about.

BRDFs of packages are tested in tests/brdf/test_library.py, too.
"""

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import DistributionFinder, MetadataPathFinder
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from shrm_cli import plugins, sources
from shrm_cli.analysis import representations
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.cli.main import cli
from shrm_cli.errors import ArgumentError, PluginError
from shrm_cli.export.engine import engine
from shrm_cli.maps import installed, registry
from shrm_cli.probe.open import open_probe
from tests.batch.helpers import work_here
from tests.cli.helpers import (
    MAIN,
    ROOT,
    assert_refused,
    done,
    environment,
    read_exr,
    run,
    write_exr,
    write_information,
    write_package,
)

COLOR = np.array([1.0, 2.0, 0.5])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder with the example as pip leaves it, which tests/test_package.py has install it."""
    folder, source = tmp_path_factory.mktemp("site"), ROOT / "examples" / "plugin"
    shutil.copytree(source / "shrm_moon", folder / "shrm_moon")
    project = tomllib.loads((source / "pyproject.toml").read_text())["project"]
    write_information(folder, project["name"], project["entry-points"])
    return folder


@pytest.fixture
def dawn(tmp_path, monkeypatch):
    """A folder, in which tests work, with a probe as a picture and as the example's own file."""
    y = np.cos(np.pi * (np.arange(64) + 0.5) / 64)
    light = np.broadcast_to((1 + 0.5 * y)[:, None, None] * COLOR, (64, 128, 3))
    write_exr(tmp_path / "dawn.exr", light.astype(np.float32))
    np.savetxt(tmp_path / "dawn.scan", light[..., 1])
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def shell(site, dawn):
    """What runs `shrm` in a process that finds the example; its folder has a probe in it."""

    def call(*arguments, code=MAIN, **more):
        found = subprocess.run(
            [sys.executable, "-c", code, *map(str, arguments)],
            env={**environment(), "PYTHONPATH": os.pathsep.join([str(ROOT), str(site)]), **more},
            cwd=dawn, capture_output=True, text=True,
        )  # fmt: skip
        assert (found.returncode, found.stderr) == (0, "")
        return found.stdout

    return call


@contextlib.contextmanager
def importable(folder):
    """Let this process find a copy of the example, which it forgets afterwards."""

    def forget():
        for name in [each for each in sys.modules if each.partition(".")[0] == "shrm_moon"]:
            del sys.modules[name]
        installed.description.cache_clear()
        installed.home.cache_clear()

    forget()
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))
        forget()


@pytest.fixture
def call(site, dawn):
    """What runs `shrm` in this process, which finds the example."""

    def told(*arguments):
        found = run(*arguments)
        assert (found.code, found.err) == (0, "")
        return found.out

    with importable(site):
        yield told


@pytest.mark.slow
def test_the_example_is_in_the_help(call):
    _, found = call("--help").split("Commands of installed packages:\n")
    assert found == "  mean  Print the mean radiance of a probe.\n"
    assert call("mean", "--help").startswith("Usage: shrm mean [OPTIONS] PROBE\n")
    for command in ("export", "prefilter", "convert", "batch", "report", "lookdev"):
        assert "|ambient-cube" in "".join(call(command, "--help").split())
    assert "\n  lommel-seeliger " in call("brdf")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("shrm mea", "mean"),
        ("shrm export x --for amb", "ambient-cube"),
        ("shrm prefilter x --to amb", "ambient-cube"),
        ("shrm prefilter x --to ambient-cube --fit", "--fit"),
        ("shrm batch x --to amb", "ambient-cube"),
        ("shrm batch x --to export --to ambient-cube --fit", "--fit"),
    ],
)
def test_the_example_is_completed(call, line, offered):
    words = {"_SHRM_COMPLETE": "zsh_complete", "COMP_WORDS": line}
    words["COMP_CWORD"] = str(line.count(" "))
    out = CliRunner().invoke(cli, env=words, prog_name="shrm").output
    assert out.splitlines()[:2] == ["plain", offered]


@pytest.mark.slow
def test_the_command_of_the_example(call):
    """The light is 1 + y / 2 of a colour, whose mean over the sphere is the colour."""
    assert [float(each) for each in call("mean", "dawn.exr").split()] == pytest.approx(
        COLOR, rel=1e-3
    )


@pytest.mark.slow
def test_the_reader_of_the_example(call):
    """The green of the light, as text; it is turned as every probe is."""
    assert [float(each) for each in call("mean", "dawn.scan").split()] == pytest.approx(
        [COLOR[1]] * 3, rel=1e-3
    )
    found = json.loads(call("info", "dawn.scan", "--up", "z", "--json"))
    assert (found["format"], found["layout"], found["height"]) == ("scan", "latlong", 64)
    azimuth, elevation = found["light_from"]["azimuth_elevation"]
    assert (abs(azimuth), elevation) == pytest.approx((180, 0), abs=0.1)


@pytest.mark.slow
def test_the_engine_of_the_example(call, tmp_path):
    """A white diffuse surface reflects 1 + n.y / 3 of that light: its degree 1 times 2 / 3."""
    result = json.loads(call("export", "dawn.exr", "--for", "ambient-cube", "--json"))
    assert [each["name"] for each in result["files"]] == ["dawn_cube.json", "dawn_README.md"]
    cube = json.loads((tmp_path / "dawn.ambient-cube" / "dawn_cube.json").read_text())
    for axis, value in cube.items():
        wanted = {"+y": 4 / 3, "-y": 2 / 3}.get(axis, 1) * COLOR
        assert value == pytest.approx(wanted, rel=2e-3), axis
    assert len(cube) == 6
    readme = (tmp_path / "dawn.ambient-cube" / "dawn_README.md").read_text()
    assert readme.startswith("Light of dawn.exr for programs with ambient cubes, by shrm ")


@pytest.mark.slow
def test_the_engine_of_the_example_in_batches(call, site, tmp_path, monkeypatch):
    """A batch keeps what is there, and notices that the package has changed."""
    work_here(monkeypatch)
    options = ("batch", "dawn.exr", "--for", "ambient-cube", "--jobs", 1, "--json")
    assert json.loads(call(*options))["made"] == 1
    written = (tmp_path / "dawn.ambient-cube" / "dawn_cube.json").read_text()
    assert json.loads(written).keys() == {"+x", "-x", "+y", "-y", "+z", "-z"}
    assert json.loads(call(*options))["made"] == 0
    code = site / "shrm_moon" / "engine.py"
    whole = code.read_text()

    def forget():
        for kept in (sources.fingerprint_with, sources.package_digest, sources._folder_digest):
            kept.cache_clear()

    try:
        code.write_text(whole + "# changed\n")
        forget()
        assert json.loads(call(*options))["made"] == 1
    finally:
        code.write_text(whole)
        forget()


def off(density, slope=1):
    """The relative RMS error of that cube, whose slope the map has, over heights of a density."""
    y, shares = np.linspace(-1, 1, 100_001), np.sqrt(density)
    truth, cube = 1 + y / 3, 1 + slope * y * np.abs(y) / 3
    return np.linalg.norm(shares * (cube - truth)) / np.linalg.norm(shares * truth)


OF_SPHERE, OF_DISC = np.ones(100_001), np.sqrt(1 - np.linspace(-1, 1, 100_001) ** 2)
"""How often heights are met on a sphere, and in a picture of one."""


@pytest.mark.slow
def test_the_form_of_the_example(call, tmp_path):
    """A white surface reflects 1 + n.y / 3 of that light, and the cube 1 + n.y |n.y| / 3."""
    file = "dawn.ambient-cube.exr"
    made = json.loads(call("prefilter", "dawn.exr", "--to", "ambient-cube", "--json"))
    assert made["file"] == file
    assert made["added_error"] == pytest.approx(off(OF_SPHERE), rel=2e-3)
    told = json.loads(call("info", file, "--json"))
    assert told["colors"] == pytest.approx(np.array(made["colors"]), rel=1e-6)
    for axis, value in zip(["x", "x", "+y", "-y", "z", "z"], told["colors"], strict=True):
        assert value == pytest.approx({"+y": 4 / 3, "-y": 2 / 3}.get(axis, 1) * COLOR, rel=2e-3)
    call("render", file, "--size", 65, "-o", "ball.exr")
    drawn = read_exr(tmp_path / "ball.exr")[1]["G"]
    for row in 8, 32, 50:
        height = (32 - row) / (0.9 * 65 / 2)  # a sphere takes nine tenths of the picture
        expected = (1 + height * abs(height) / 3) * COLOR[1]
        assert drawn[row, 32] == pytest.approx(expected, rel=2e-3)
    numbers = "--size", 64, "--no-flip", "--no-picture", "--view", "0,0", "--json"
    found = json.loads(call("compare", file, "--probe", "dawn.exr", *numbers))
    assert found["summary"][0]["relative_rmse"] == pytest.approx(off(OF_DISC), rel=0.02)
    call("convert", file, "--to", "ambient-cube", "-o", "again.exr")
    first, again = (read_exr(tmp_path / name)[1]["G"] for name in (file, "again.exr"))
    assert np.array_equal(first, again)


@pytest.mark.slow
def test_batches_make_the_form_of_the_example(call, tmp_path, monkeypatch):
    work_here(monkeypatch)
    (tmp_path / "bake.toml").write_text(
        'probes = ["dawn.exr"]\nto = ["ambient-cube", "irradiance"]\n'
        'output = "{probe}.{to}.exr"\n[ambient-cube]\nfit = "least"\n'
    )
    line = "batch", "dawn.exr", "--to", "ambient-cube", "--fit", "least", "--json", "--jobs", 1
    assert json.loads(call(*line))["made"] == 1
    again = json.loads(call("batch", "bake.toml", "--json", "--jobs", 1))
    assert (again["made"], again["skipped"]) == (1, 1)
    colors = json.loads(call("info", "dawn.ambient-cube.exr", "--json"))["colors"]
    assert colors[2] == pytest.approx((1 + 5 / 12) * COLOR, rel=2e-3)
    line = "batch", "dawn.exr", "--to", "ambient-cube", "--dry-run", "--quiet", "--json"
    looked = json.loads(call(*line))
    assert (looked["waiting"], looked["predictions"][0]["bytes"]) == (1, 2 * 6 * 3)


def changes(site, shell, tmp_path, line, changed):
    """Run a batch of a copy of the example anew after each of its files has changed.

    Returns the first run, and each later one with why it made what it made.
    """
    copy = tmp_path / "copy"
    shutil.copytree(site, copy)
    where = {"PYTHONPATH": os.pathsep.join([str(ROOT), str(copy)])}
    line = ("batch", "dawn.exr", *line, "--json", "--jobs", "1")
    yield json.loads(shell(*line, **where))
    for name in changed:
        before = (tmp_path / "batch.jsonl").read_text().count("\n")
        with open(copy / "shrm_moon" / name, "a") as file:
            file.write("# another state\n")
        again = json.loads(shell(*line, **where))
        records = (tmp_path / "batch.jsonl").read_text().splitlines()[before:]
        made = [each for each in map(json.loads, records) if each["status"] == "made"]
        yield again["made"], again["skipped"], [each["why"] for each in made]


@pytest.mark.slow
def test_batches_notice_that_the_code_of_a_form_has_changed(site, shell, tmp_path):
    line = "--to", "ambient-cube", "--to", "she"
    first, coded = changes(site, shell, tmp_path, line, ("ambient_cube.py",))
    assert first["made"] == 2
    why = "another version or state of shrm, or of the package with the form, made it"
    assert coded == (1, 1, [why])


@pytest.mark.slow
def test_batches_notice_that_the_code_of_a_brdf_has_changed(site, shell, tmp_path):
    brdfs = "lommel-seeliger:albedo=0.4", "0.5*lommel-seeliger+0.5*lambertian", "lambertian"
    line = [word for brdf in brdfs for word in ("--brdf", brdf)] + ["--to", "shrm"]
    first, noted, coded = changes(site, shell, tmp_path, line, ("notes.txt", "brdf.py"))
    assert first["made"] == 3
    assert noted == (0, 3, [])
    assert coded == (
        2,
        1,
        ["it was made with other options (another state of the BRDF's code)"] * 2,
    )


@pytest.mark.slow
def test_what_takes_no_form_of_a_package_says_so(call, tmp_path, monkeypatch):
    call("prefilter", "dawn.exr", "--to", "ambient-cube", "--quiet", "-o", "cube.exr")
    line = "ambient-cube is not what engines read; export its probe, a split sum or an irradiance"
    assert line in run("export", "cube.exr", "--for", "three").err
    assert "json, all, ambient-cube" in run("export", "dawn.exr").err
    line = (
        "Without ambient-cube of installed packages; shrm choose measures those that are offered."
    )
    monkeypatch.setattr(representations, "COMPARED", ("shrm",))
    options = "--representations", "--roughness", "1..1", "--eps", 0.2, "--size", 16
    found = run("compare", "dawn.exr", *options)
    assert line in found.out + found.err


@pytest.mark.slow
def test_conversions_to_the_form_of_the_example(call):
    """Of a map that only its own form is made of otherwise; its option is in the help, too."""
    call("prefilter", "dawn.exr", "--to", "irradiance", "--order-f", 8, "-o", "white.exr")
    line = "convert", "white.exr", "--to", "ambient-cube"
    for fit, slope in (("axes", 1), ("least", 5 / 4)):
        told = json.loads(call(*line, "--fit", fit, "--json", "-o", f"{fit}.exr"))
        assert told["file"] == f"{fit}.exr"
        assert told["added_error"] == pytest.approx(off(OF_SPHERE, slope), rel=5e-3)
        colors = json.loads(call("info", f"{fit}.exr", "--json"))["colors"]
        making = "prefilter", "dawn.exr", "--to", "ambient-cube", "--fit", fit, "--force"
        made = json.loads(call(*making, "--json"))
        np.testing.assert_allclose(colors, made["colors"], rtol=1e-6)
    assert "--fit" in call(*line, "--help")
    assert "--fit" not in call("convert", "--help")
    assert_refused(run(*line, "--order-p", 3), 2, "--order-p applies with --to shrm")
    assert_refused(run(*line[:-1], "cabral"), 2, "it is made from the probe")


@pytest.mark.slow
def test_what_the_form_of_the_example_is_not_made_of(call):
    """Light alone and reflected light; the form says so, and no file is left."""
    call("prefilter", "dawn.exr", "--to", "splitsum", "--size", 8, "-o", "light.exr")
    call("prefilter", "dawn.exr", "--brdf", "phong:exponent=2", "--to", "shrm", "-o", "shiny.exr")
    for name in ("light", "shiny"):
        found = run("convert", f"{name}.exr", "--to", "ambient-cube", "-o", "cube.exr")
        assert_refused(found, 1, "is not of white surfaces; convert irradiance")
    assert not os.path.exists("cube.exr")


@pytest.mark.slow
def test_the_form_of_the_example_is_chosen_among(call):
    """A diffuse surface of albedo 1/2 reflects half of what the cube holds; its error is known."""
    brdf = "lambertian:albedo=0.5"
    (choice,) = json.loads(call("choose", "dawn.exr", "--brdf", brdf, "--json"))["choices"]
    found = {each["what"]: each for each in choice["offers"] if each["form"] == "ambient-cube"}
    assert set(found) == {"six colors, axes", "six colors, least"}
    for what, slope in (("axes", 1), ("least", 5 / 4)):
        offer = found[f"six colors, {what}"]
        assert offer["arguments"] == {"to": "ambient-cube", "fit": what}
        assert offer["error"] == pytest.approx(off(OF_SPHERE, slope), rel=5e-3)
        assert (offer["bytes"], offer["look_ups"], offer["multiply_adds"]) == (72, 0, 12)
    (choice,) = json.loads(call("choose", "dawn.exr", "--brdf", "phong:exponent=4", "--json"))[
        "choices"
    ]
    assert "ambient-cube" not in {each["form"] for each in choice["offers"]}


@pytest.mark.slow
def test_the_form_of_the_example_is_reported_on(call, tmp_path):
    options = "--to", "ambient-cube", "--fit", "least", "--view", "0,0", "--picture-size", 64
    told = json.loads(
        call("report", "dawn.exr", *options, "--no-flip", "-o", "page.html", "--json")
    )
    ((made,), page) = told["maps"], (tmp_path / "page.html").read_text()
    assert made["measured"]["relative_rmse"] == pytest.approx(off(OF_DISC, 5 / 4), rel=0.02)
    assert "shrm_cube[6]" in page
    assert "dawn.ambient-cube.exr" in page


@pytest.mark.slow
def test_an_option_and_the_code_of_the_form_of_the_example(call, tmp_path):
    """The least error over the sphere is of ``1 + c n.y |n.y|``, c = 5 / 12: that of y on y |y|."""
    options = "--to", "ambient-cube", "--fit", "least", "--shader", "c", "--quiet"
    code = call("prefilter", "dawn.exr", *options)
    call("view", "dawn.ambient-cube.exr", "-o", "page.html")
    assert "const vec3 shrm_cube[6]" in (tmp_path / "page.html").read_text()
    compiler = shutil.which("cc") or pytest.skip("no C compiler")
    (tmp_path / "cube.c").write_text(f"#include <stdio.h>\n{code}{PRINTS}")
    subprocess.run([compiler, "cube.c", "-o", "cube", "-lm"], cwd=tmp_path, check=True)
    out = subprocess.run([tmp_path / "cube"], capture_output=True, text=True, check=True).stdout
    y = np.array([-1, -0.6, 0.8])
    expected = (1 + 5 / 12 * y * np.abs(y))[:, None] * COLOR
    assert [float(each) for each in out.split()] == pytest.approx(expected.ravel(), rel=5e-3)


PRINTS = """
int main(void) {
    double y[] = {-1.0, -0.6, 0.8}, x[] = {0.0, 0.8, -0.6};
    for (int i = 0; i < 3; ++i) {
        shrm_vec3 n = shrm_vec(x[i], y[i], 0.0), light = shrm_radiance(n, n);
        printf("%.9g %.9g %.9g\\n", light.x, light.y, light.z);
    }
    return 0;
}
"""


@pytest.mark.slow
def test_the_brdf_of_the_example(call):
    """A full moon, whose light comes from where it is seen, is as bright everywhere."""
    brdf = "lommel-seeliger:albedo=0.4"
    light = np.array([[0, 0, 1], [0.6, 0, 0.8], [0, -0.96, 0.28]])
    values = parse_spec(brdf).evaluate(light, light) * light[:, 2:]
    assert values == pytest.approx(np.full((3, 3), 0.4 / (8 * np.pi)))
    out = call("prefilter", "dawn.exr", "--brdf", brdf, "--to", "principal", "--json")
    assert json.loads(out)["file"] == "dawn.lommel-seeliger-albedo-0.4.principal.exr"


REPORTING = """
import atexit, sys
looked = {"importlib.metadata", "shrm_moon.brdf", "shrm_moon.command", "shrm_moon.engine",
          "shrm_moon.reader", "shrm_moon.form", "shrm_moon.ambient_cube"}
atexit.register(lambda: print("loaded", *sorted(looked & sys.modules.keys())))
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "loaded"),
    [
        ("--help", "importlib.metadata shrm_moon.command"),
        ("prefilter --help", "importlib.metadata"),
        ("prefilter --to ambient-cube --help", "importlib.metadata shrm_moon.form"),
        (
            "prefilter dawn.exr --to ambient-cube --quiet",
            "importlib.metadata shrm_moon.ambient_cube shrm_moon.form",
        ),
        ("prefilter dawn.exr --to irradiance --quiet", ""),
        (
            "export dawn.exr --for ambient-cube",
            "importlib.metadata shrm_moon.ambient_cube shrm_moon.engine",
        ),
        ("brdf lommel-seeliger", "importlib.metadata shrm_moon.brdf"),
        ("export dawn.exr --for json", ""),
        ("info dawn.scan", "importlib.metadata shrm_moon.reader"),
        ("brdf phong", ""),
    ],
)
def test_only_what_is_named_is_loaded(shell, arguments, loaded):
    out = shell(*arguments.split(), code=REPORTING + MAIN)
    assert out.splitlines()[-1] == f"loaded {loaded}".rstrip()


# What goes wrong.

CODE = '''
import click
import shrm_cli as shrm
from shrm_cli.export.engine import Engine

@click.command()
@click.argument("how")
def sound(how):
    """Fail in some way."""
    if how == "argument":
        raise shrm.ArgumentError("how", "is wrong")
    raise {"ours": shrm.MapError, "theirs": KeyError}[how]("it broke")

class Packs(Engine):
    wants_levels = False
    def pack(self, light, texels):
        {"key": lambda: {}["k"], "none": lambda: None, "ours": lambda: ours()}[self.name]()

def ours():
    raise shrm.MapError("is too dark")

class Key(Packs):
    name = title = "key"

class Nothing(Packs):
    name = title = "none"

class Ours(Packs):
    name = title = "ours"

class Odd(Packs):
    name = title = "odd"
    formats = ("rgba16f", "bc7")

class Lawless(Packs):
    name = title = "lawless"
    wants_levels = True

class Mute(Engine):
    name = title = "mute"

class Nameless(Engine):
    title = "nobody"
    def pack(self, light, texels): ...

class Untitled(Engine):
    name = "untitled"
    def pack(self, light, texels): ...

class Unmade(Packs):
    name = title = "unmade"
    def __init__(self): 1 / 0

class Bevy(Nameless):
    name = title = "bevy"
'''


@pytest.fixture
def install(tmp_path, monkeypatch):
    def make(group, points, code=CODE):
        write_package(tmp_path / "site", "oddments", group, points, code)
        monkeypatch.syspath_prepend(str(tmp_path / "site"))
        monkeypatch.delitem(sys.modules, "oddments", raising=False)

    yield make
    sys.modules.pop("oddments", None)


BROKEN_COMMANDS = {
    "gone": ("nowhere_at_all:x", "cannot be loaded: ModuleNotFoundError: No module named"),
    "lost": ("oddments:x", "cannot be loaded: AttributeError"),
    "engine": ("oddments:Mute", "is no click.Command; make it one"),
}


@pytest.mark.parametrize("name", BROKEN_COMMANDS)
def test_a_broken_command_is_one_line(install, name):
    value, words = BROKEN_COMMANDS[name]
    install("shrm_cli.commands", {name: value, "sound": "oddments:sound"})
    line = f"{name}: the entry point '{value}' of the package oddments "
    assert_refused(run(name, "--help"), 1, line, words)
    helped = run("--help")
    assert helped.code == 0
    assert helped.out.endswith("Commands of installed packages:\n  sound  Fail in some way.\n")
    assert helped.err.startswith(f"Warning: {line}")
    assert helped.err.count("\n") == 1
    assert run("brdf", "lambertian").err == ""
    words = {"_SHRM_COMPLETE": "zsh_complete", "COMP_WORDS": "shrm ", "COMP_CWORD": "1"}
    completed = CliRunner().invoke(cli, env=words, prog_name="shrm")
    assert completed.exit_code == 0
    assert completed.output.splitlines()[1::3][-2:] == ["cache", "sound"]


@pytest.mark.parametrize("code", ["raise SystemExit(3)", "1 / 0", "def x(:"])
def test_a_command_whose_module_fails_is_one_line(install, code):
    install("shrm_cli.commands", {"sound": "oddments:sound"}, code)
    assert_refused(run("sound"), 1, "sound: the entry point", " cannot be loaded: ")
    assert run("--help").code == 0


def test_a_list_that_cannot_be_read_is_one_warning(install):
    """One line without an equals sign, which no installer writes, fails for all packages."""
    install("shrm_cli.commands", {"sound": "oddments:sound\nnothing"})
    helped = run("--help")
    assert helped.code == 0
    assert "\n  cache " in helped.out
    assert helped.err.startswith("Warning: entry points of installed packages cannot be read: ")
    assert helped.err.count("\n") == 1
    assert run("brdf", "lambertian").err == ""


def test_packages_in_archives_are_found(tmp_path, monkeypatch):
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        archive.writestr("oddments-1.dist-info/METADATA", "Name: oddments\nVersion: 1\n")
        points = "[shrm_cli.commands]\nsound = oddments:sound\n"
        archive.writestr("oddments-1.dist-info/entry_points.txt", points)
    assert "sound" not in plugins.installed("shrm_cli.commands")
    monkeypatch.syspath_prepend(str(tmp_path / "all.zip"))
    assert plugins.installed("shrm_cli.commands")["sound"].value == "oddments:sound"


def test_packages_that_others_find_are_found(install, tmp_path, monkeypatch):
    install("shrm_cli.commands", {"sound": "oddments:sound"})
    monkeypatch.undo()
    found = list(
        MetadataPathFinder.find_distributions(
            DistributionFinder.Context(path=[str(tmp_path / "site")])
        )
    )
    finder = SimpleNamespace(find_distributions=lambda context: found, find_spec=lambda *_: None)
    assert "sound" not in plugins.installed("shrm_cli.commands")
    monkeypatch.setattr(sys, "meta_path", [*sys.meta_path, finder])
    assert plugins.installed("shrm_cli.commands")["sound"].value == "oddments:sound"


def test_commands_of_shrm_win(install):
    install("shrm_cli.commands", {"brdf": "nowhere_at_all:x"})
    assert run("--help").err == ""
    assert "Lambert" in done("brdf", "lambertian")


def test_a_command_that_fails_says_whose_it_is(install):
    install("shrm_cli.commands", {"sound": "oddments:sound"})
    assert run("sound", "argument").err == "Error: --how is wrong; see shrm sound --help\n"
    assert run("sound", "ours").err == "Error: it broke\n"
    told = run("--debug", "sound", "--nothing").err
    assert told.startswith("Error: No such option")
    told = "the installed command 'sound' failed, please report it to its authors (KeyError: "
    assert_refused(run("sound", "theirs"), 1, told)
    assert_refused(run("soumd", "theirs"), 2, "Did you mean 'sound'?")


BROKEN_ENGINES = {
    "gone": ("nowhere_at_all:x", "cannot be loaded: ModuleNotFoundError: No module named"),
    "command": ("oddments:sound", "is not a subclass of Engine; make it one"),
    "mute": ("oddments:Mute", "has no method pack"),
    "nameless": ("oddments:Nameless", "calls itself something else; make its name 'nameless'"),
    "untitled": ("oddments:Untitled", "has no title; give it one"),
    "unmade": ("oddments:Unmade", "cannot be made: ZeroDivisionError"),
    "odd": ("oddments:Odd", "has other formats than r11g11b10, rgb9e5, "),
    "lawless": ("oddments:Lawless", "wants levels, and has neither a mapping nor roughness()"),
}


@pytest.mark.parametrize("name", BROKEN_ENGINES)
def test_a_broken_engine_is_one_line(install, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    value, words = BROKEN_ENGINES[name]
    install("shrm_cli.engines", {name: value})
    line = f"{name}: the entry point '{value}' of the package oddments "
    with pytest.raises(PluginError, match=words):
        engine(name)
    done("probe", "furnace", "-o", "white.exr", "--size", 16)
    assert_refused(run("export", "white.exr", "--for", name), 1, line, words)
    both = run("export", "white.exr", "--for", name, "--for", "json")
    assert both.code == 1
    assert line in both.err
    assert (tmp_path / "white.json" / "white_sh.json").exists()


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("key", "Key", "the engine 'key' failed: KeyError: 'k'"),
        ("none", "Nothing", "the engine 'none' failed: pack() returns None"),
        ("ours", "Ours", "white.exr: is too dark"),
    ],
)
def test_an_engine_that_fails_is_one_line(install, tmp_path, monkeypatch, name, value, line):
    monkeypatch.chdir(tmp_path)
    install("shrm_cli.engines", {name: f"oddments:{value}"})
    done("probe", "furnace", "-o", "white.exr", "--size", 16)
    found = run("export", "white.exr", "--for", name)
    assert (found.code, found.err) == (1, f"Error: {line}\n")


FORMS = """
import numpy as np
import shrm_cli as shrm
from shrm_cli.files.parts import Part
from shrm_cli.maps.stored import common_header, map_info, read_attributes
from shrm_cli.maps.kinds import FixedMap, ReflectionMap
from shrm_cli.maps.options import Option, Representation
from shrm_cli.maps.request import Prefiltered
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.records import record

def form(name, home="oddments", *options):
    return Representation(name, name, frozenset(), options, why_no_brdf="it is white", home=home)

number = 3
other = form("another")
homeless = form("homeless", "")
lost = form("lost", "nowhere_at_all")
bare = form("bare", "shrm_cli.records")
taking = form("taking", "oddments", Option("eps", "Mine.", "fraction"))
fails = form("fails")
empty = form("empty")
ours = form("ours")

def prefilter(probe, request):
    if request.to == "fails":
        1 / 0
    if request.to == "ours":
        raise shrm.MapError("is too dark")

    if request.to == "late":
        info = prefilter_with_facts(probe, "irradiance", {}).map.info
        return Prefiltered(Late(info))

def report(result): return ["it is late"]
def encode(made): return [Part({"Y": np.zeros((1, 1))}, common_header(made, 0))]
def decode(file): return Late(map_info(read_attributes(file.first), file.first))

late = form("late")

@record(eq=False)
class Late(FixedMap, ReflectionMap):
    info: shrm.MapInfo
    representation, center, sampling, size = "late", "normal", "center", 1
    def radiance(self, normals, views): return np.ones(3) @ np.ones(2)
"""
BROKEN_FORMS = {
    "gone": ("nowhere_at_all:x", "cannot be loaded: ModuleNotFoundError: No module named"),
    "number": ("oddments:number", "is no Representation; make it one"),
    "other": ("oddments:other", "calls itself 'another'; give both one name"),
    "homeless": ("oddments:homeless", "has no home; name the module that makes its maps"),
    "lost": ("oddments:lost", "cannot be loaded: ModuleNotFoundError: No module named"),
    "bare": ("oddments:bare", "the form 'bare': shrm_cli.records has no function prefilter"),
    "taking": ("oddments:taking", "has the option 'eps', which others have; rename it"),
    "fails": ("oddments:fails", "the form 'fails' failed: ZeroDivisionError"),
    "empty": ("oddments:empty", "the form 'empty' failed: prefilter() returns None"),
    "ours": ("oddments:ours", "is too dark"),
}


FLAT = """
import numpy as np
import shrm_cli as shrm
from shrm_cli.files.parts import Part
from shrm_cli.maps.stored import common_header, map_info, read_attributes
from shrm_cli.maps.kinds import FixedMap, ReflectionMap
from shrm_cli.maps.options import Representation
from shrm_cli.maps.request import Prefiltered
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.records import record

flat = Representation("flat", "flat", frozenset(["brdf"]), home="oddments")
half = Representation("half", "half", frozenset(), (), "white", is_offered=True, home="oddments")

@record(eq=False)
class Flat(FixedMap, ReflectionMap):
    info: shrm.MapInfo
    representation, center, sampling, size = "flat", "normal", "center", 1
    def radiance(self, normals, views): return np.full(np.shape(normals), 2.0)

def prefilter(probe, request):
    asked = {"brdf": request.brdf, "order_f": 0, "order_p": 0}
    return Prefiltered(Flat(prefilter_with_facts(probe, "shrm", asked).map.info))

def report(result): return ["it is flat"]
def encode(made): return [Part({"Y": np.zeros((1, 1))}, common_header(made, 0))]
def decode(file): return Flat(map_info(read_attributes(file.first), file.first))
"""


@pytest.fixture
def forms(install):
    installed.description.cache_clear()
    installed.home.cache_clear()
    yield install
    installed.description.cache_clear()
    installed.home.cache_clear()


@pytest.mark.parametrize("name", BROKEN_FORMS)
def test_a_broken_form_is_one_line(forms, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    value, words = BROKEN_FORMS[name]
    forms("shrm_cli.forms", {name: value}, FORMS)
    done("probe", "furnace", "-o", "white.exr", "--size", 16)
    assert_refused(run("prefilter", "white.exr", "--to", name), 1, words)
    for command in ("prefilter", "convert"):
        assert f"|{name}]" in "".join(done(command, "--help").split())
    done("prefilter", "white.exr", "--to", "irradiance")
    assert "representation" in done("info", "white.irradiance.exr")
    line = {"COMP_WORDS": f"shrm prefilter white.exr --to {name} --ep", "COMP_CWORD": "5"}
    of_shell = {"_SHRM_COMPLETE": "zsh_complete", **line}
    assert "--eps" in CliRunner().invoke(cli, env=of_shell, prog_name="shrm").output


def test_forms_of_shrm_win(forms):
    forms("shrm_cli.forms", {"she": "nowhere_at_all:x", "shy": "nowhere_at_all:x"}, FORMS)
    assert registry.description("she").title == "SH exponential"
    with pytest.raises(ArgumentError, match=r"'shi' is none of auto, shrm, .*, she, product, shy$"):
        registry.description("shi")
    assert_refused(run("prefilter", "x.exr", "--to", "shi"), 2, "'shi'", "'shy'")


def test_a_map_of_a_form_that_fails_is_one_line(forms, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    forms("shrm_cli.forms", {"late": "oddments:late"}, FORMS)
    done("probe", "furnace", "-o", "white.exr", "--size", 16)
    assert "it is late" in done("prefilter", "white.exr", "--to", "late")
    assert "late" in done("info", "white.late.exr")
    told = "the installed package 'oddments' failed, please report it to its authors (ValueError: "
    assert_refused(run("render", "white.late.exr", "--size", 16), 1, told)
    told = "a map of representation late has no shader; look it up by shrm render"
    assert_refused(run("convert", "white.late.exr", "--to", "layers"), 1, told)


def test_a_form_without_a_class_of_its_name(forms):
    forms("shrm_cli.forms", {"fails": "oddments:fails"}, FORMS)
    with pytest.raises(
        PluginError, match="oddments has no class of maps of representation 'fails'"
    ):
        registry.map_class("fails")


def test_materials_are_shown_by_a_form_of_a_package(forms, tmp_path, monkeypatch):
    """The form shows all as 2, before the light of a furnace, which is 1."""
    monkeypatch.chdir(tmp_path)
    forms("shrm_cli.forms", {"flat": "oddments:flat", "late": "oddments:late"}, FLAT)
    done("probe", "furnace", "-o", "white.exr", "--size", 16)
    line = "lookdev", "white.exr", "--brdf", "lambertian", "--to", "flat", "--exposure", 0
    done(*line, "--size", 64, "-o", "sheet.exr")
    shown = read_exr(tmp_path / "sheet.exr")[1]["G"]
    radius = 0.9 * 64 / 2
    assert np.pi * (radius - 1) ** 2 < np.isclose(shown, 2).sum() < np.pi * radius**2
    assert_refused(run(*line[:-3], "late"), 1, "late: the entry point", "AttributeError")


def test_a_form_that_can_show_no_material_is_refused_before_the_work(forms, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    forms("shrm_cli.forms", {"late": "oddments:late"}, FORMS)
    done("probe", "furnace", "-o", "white.exr", "--size", 16)
    found = run("lookdev", "white.exr", "--brdf", "lambertian", "--to", "late")
    assert_refused(found, 2, "--brdf applies with --to", "; it is white")


def test_a_broken_form_is_left_out_of_a_choice(forms, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    forms("shrm_cli.forms", {"gone": "nowhere_at_all:x", "half": "oddments:half"}, FLAT)
    done("probe", "furnace", "-o", "white.exr", "--size", 16)
    found = run("choose", "white.exr", "--brdf", "lambertian")
    assert found.code == 0
    told = found.err.splitlines()
    assert len(told) == 2
    assert told[0].startswith("Warning: lambertian: no gone: gone: the entry point 'nowhere_at_")
    line = "no half: the form 'half': oddments has no function settings; write one"
    assert told[1] == f"Warning: lambertian: {line}"


@pytest.mark.parametrize("name", ["gone", "fails", "unknown"])
def test_a_batch_with_a_form_that_fails_is_one_line(forms, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    points = {each: BROKEN_FORMS[each][0] for each in ("gone", "fails")}
    forms("shrm_cli.forms", points, FORMS)
    done("probe", "furnace", "-o", "white.exr", "--size", 16)
    (tmp_path / "bake.toml").write_text(f'probes = ["white.exr"]\nto = ["{name}"]\n')
    words = BROKEN_FORMS.get(name, ("", "is none of auto, shrm, cabral"))[1]
    work_here(monkeypatch)
    found = run("batch", "bake.toml", "--jobs", 1)
    assert found.code == 1
    assert words in found.err
    assert found.err.count("\n") == 1


@pytest.mark.slow
def test_a_map_of_a_form_that_is_not_installed(site, dawn):
    with importable(site):
        done("prefilter", "dawn.exr", "--to", "ambient-cube")
    words = "representation 'ambient-cube', which this version cannot read"
    assert_refused(run("info", "dawn.ambient-cube.exr"), 1, words)


READERS = """
import numpy as np
import shrm_cli as shrm

def cube(path):
    return np.ones((24, 4, 3)), {"layout": "openexr", "orientation": "gl"}

def theirs(path): 1 / 0
def ours(path): raise shrm.ProbeError(f"{path.name}: is no scan")
def bare(path): return np.ones((8, 16))
def odd(path): return np.ones((8, 16)), {"shape": "round"}
def flat(path): return np.ones(8), {}
number = 3
"""
BROKEN_READERS = {
    "theirs": "failed: ZeroDivisionError",
    "ours": "x.scan: is no scan",
    "bare": "failed: ValueError",
    "odd": "describes 'shape'; it may tell chromaticities, layout, orientation, sampling",
    "flat": "x.scan: an array of shape (8,) is no image",
    "number": "is no function; make it one",
}


@pytest.mark.parametrize("value", BROKEN_READERS)
def test_a_broken_reader_is_one_line(install, tmp_path, monkeypatch, value):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.scan").write_text("1")
    install("shrm_cli.readers", {"scan": f"oddments:{value}"}, READERS)
    assert_refused(run("info", "x.scan"), 1, BROKEN_READERS[value])


def test_what_a_reader_says_is_obeyed_after_options(install, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.SCAN").write_text("1")
    install("shrm_cli.readers", {"scan": "oddments:cube", "exr": "nowhere_at_all:x"}, READERS)
    probe = open_probe("x.SCAN")
    assert (probe.layout, probe.orientation, probe.width) == ("openexr", "gl", 4)
    assert [path.name for path in probe.paths] == ["x.SCAN"]
    assert open_probe("x.SCAN", orientation="openexr").orientation == "openexr"
    write_exr(tmp_path / "y.exr", np.ones((8, 16, 3), np.float32))
    assert open_probe("y.exr").layout == "latlong"


def test_engines_of_shrm_win(install):
    install("shrm_cli.engines", {"bevy": "oddments:Bevy", "mute": "oddments:Mute"})
    assert type(engine("bevy")).__module__ == "shrm_cli.export.engines.bevy"
    with pytest.raises(ArgumentError, match=r"'bevi' is none of filament, bevy, .*, json, mute$"):
        engine("bevi")
    assert_refused(run("export", "x.exr", "--for", "bevi"), 2, "'bevi'", "'mute'")


def test_the_page_tells_what_the_example_is():
    page = (ROOT / "docs" / "plugins.md").read_text()
    folder = ROOT / "examples" / "plugin"
    files = [folder / "pyproject.toml", *sorted((folder / "shrm_moon").glob("*.py"))]
    count = sum(len(path.read_text().splitlines()) for path in files)
    assert f"in {count} lines" in page
    points = tomllib.loads(files[0].read_text())["project"]["entry-points"]
    for group, named in points.items():
        for name, value in named.items():
            assert f'    [project.entry-points."{group}"]\n    {name} = "{value}"\n' in page
    groups = plugins.BRDFS, plugins.COMMANDS, plugins.ENGINES, plugins.FORMS, plugins.READERS
    assert set(points) == set(groups)
