"""What the pages for users say: links that lead somewhere, and a citation that can be read."""

import re
import shlex
import subprocess
import tomllib
from functools import partial
from types import SimpleNamespace

import click
import numpy as np
import OpenEXR
import pytest

from shrm_cli import __release__
from shrm_cli.cli.main import cli
from shrm_cli.extras import EXTRAS, install
from shrm_cli.maps.file import open_map
from shrm_cli.render.camera import Viewer, sphere_normals, sphere_radius
from tests.cli.helpers import ROOT, process
from tests.maps.shader.test_code import STRICT, compiler_of_c

PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files_and_headings(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if "://" in target:
            continue
        name, _, heading = target.partition("#")
        linked = page.parent / name if name else page
        assert linked.exists(), f"{page.name}: {target}"
        if heading:
            titles = re.findall(r"^#+ (.*)$", linked.read_text(), re.M)
            slugs = [re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles]
            assert heading in slugs, f"{page.name}: {target}"


def commands(text):
    """The commands of blocks of a shell, as words; lines that go on are joined.

    Where they write their output to is left out.
    """
    blocks = re.findall(r"^```bash\n(.*?)^```", text, re.M | re.S)
    lines = [line.partition(" > ")[0] for block in blocks for line in joined(block)]
    return [shlex.split(line) for line in lines if line]


def joined(text):
    return text.replace("\\\n", " ").splitlines()


def parsed(words):
    """The context of a command, which click makes after it has looked at all arguments."""
    command, context = cli, click.Context(cli, info_name="shrm", **cli.context_settings)
    while isinstance(command, click.Group):
        name, command, words = command.resolve_command(context, list(words))
    return command.make_context(name, list(words), parent=context)


@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if "```bash" in page.read_text()],
    ids=lambda page: page.name,
)
def test_commands_of_pages_can_be_given(page):
    for program, *words in commands(page.read_text()):
        assert program == "shrm"
        parsed(words)


def test_commands_that_cannot_be_given_are_found():
    (words,) = commands("```bash\nshrm prefilter a.exr \\\n  --no-such-option\n```\n")
    with pytest.raises(click.UsageError, match="no-such-option"):
        parsed(words[1:])


@pytest.mark.proof
def test_five_minutes(tmp_path, monkeypatch):
    """All commands of the first page that a newcomer types work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    for _, *words in commands((ROOT / "docs" / "start.md").read_text()):
        assert process(*words).code == 0, words
    assert (tmp_path / "gold.html").exists()


def test_the_first_lines_of_the_readme_print_what_it_says(tmp_path, monkeypatch):
    """What compression saves is the only number that another processor may change."""
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "README.md").read_text()
    first = re.search(r"^    shrm probe sky.*?\n\n", text, re.M | re.S)[0]
    said = [process(*shlex.split(line)[1:]).out for line in joined(first)[:2]]
    told = re.search(r"^    (lacquer\.shrm\.exr: .*?)\n\n", text, re.M | re.S)[1]
    told, made = (re.sub(r"[\d,]+ bytes", "", each).split() for each in (told, said[1]))
    assert told == made


def test_formulas_of_engine_programmers_fit_their_tables(tmp_path, monkeypatch):
    """Each after the line that makes its table; both reflect alike, but what is lost in metals."""
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "howto" / "engine.md").read_text()
    pairs = re.findall(
        r"shrm (dfg[^\n]*?) -o dfg\.\w+\n```\n\n`radiance = level\(R, roughness\) \* (.*?)`", text
    )
    assert len(pairs) == len(re.findall("^shrm dfg", text, re.M)) == 2
    single, several = (partial(reflected, *pair) for pair in pairs)
    np.testing.assert_allclose(several(1.0), 1, atol=1e-3)
    assert 0.3 < single(1.0).min() < 0.7
    assert single(1.0).max() < 1.001
    for f0 in (0.0, 0.04, 0.9):  # the more f0, the more of the energy that is lost comes back
        gain = 1 + f0 * (1 / single(1.0) - 1)
        np.testing.assert_allclose(several(f0), single(f0) * gain, rtol=3e-3)


def reflected(command, formula, f0):
    """Evaluate a formula of a shader in all texels of the table that a command makes."""
    options = ["--size", "16", "--precision", "float", "-o", "t.exr"]
    assert process(*command.split(), *options).code == 0
    with OpenEXR.File("t.exr", separate_channels=True) as file:
        channels = file.parts[0].channels
        dfg = SimpleNamespace(r=channels["R"].pixels, g=channels["G"].pixels)
    scope = {"mix": lambda a, b, x: a * (1 - x) + b * x, "dfg": dfg, "f0": f0}
    return eval(formula, scope)


def blocks_of_researchers(language):
    text = (ROOT / "docs" / "howto" / "research.md").read_text()
    return re.findall(rf"```{language}\n(.*?)```", text, re.S)


@pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")
def test_python_of_researchers(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    block, _ = blocks_of_researchers("python")
    exec(compile(block, "research.md", "exec"), {})
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == [
        "shrm", "principal"
    ]  # fmt: skip


def test_c_of_researchers_finds_the_radiance_of_the_map(tmp_path, monkeypatch):
    """The commands, the Python and the C of the page; the compiler allows no warning."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "probes").symlink_to(ROOT / "probes")
    block = next(each for each in blocks_of_researchers("bash") if "--shader c" in each)
    made, looked_up = (process(*words[1:]) for words in commands(f"```bash\n{block}```"))
    assert made.code == looked_up.code == 0
    (tmp_path / "look.c").write_text(looked_up.out)
    exec(blocks_of_researchers("python")[1], {})
    (tmp_path / "main.c").write_text(*blocks_of_researchers("c"))
    subprocess.run([compiler_of_c(), *STRICT, "main.c", "-o", "main", "-lm"], check=True)
    told = subprocess.run(["./main"], check=True, capture_output=True, text=True).stdout
    found = open_map("gold.exr")
    light = found.radiance([0, 0.6, 0.8], [0.6, 0.48, 0.64])
    assert np.ptp(light) > 0.01 * light.mean()
    np.testing.assert_allclose([float(x) for x in told.split()], light, rtol=2e-3)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_pages_tell_to_make_can_be_made(page):
    targets = re.findall(r"^([\w .-]+):(?!=)", (ROOT / "Makefile").read_text(), re.M)
    known = {name for line in targets for name in line.split()}
    told = re.findall(r"(?:`|^    )make (?:-\S+ )*([a-z]+)\b", page.read_text(), re.M)
    assert set(told) <= known


@pytest.mark.parametrize("name", ["CONTRIBUTING.md", "SECURITY.md"])
def test_files_that_pages_name_are_there(name):
    text = (ROOT / name).read_text()
    named = re.findall(r"\b(?:shrm_cli|tests|docs|examples|probes)/[\w/.-]*\w/?", text)
    assert len(named) >= 2
    for path in named:
        assert "NAME" in path or (ROOT / path).exists(), path


def test_everything_that_is_extra_is_told_of():
    text = (ROOT / "docs" / "install.md").read_text()
    for extra in EXTRAS:
        assert f"`{extra}`" in text
        assert f"| `{install(extra)}`" in text


def test_the_release_is_the_same_everywhere():
    parts = re.findall(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(), re.M)
    first = parts[parts[0] == "Unreleased"]
    assert re.fullmatch(rf"{re.escape(__release__)} \(\d{{4}}-\d\d-\d\d\)", first)
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
    assert tools["setuptools_scm"]["fallback_version"] == f"{__release__}.dev0"


def test_addresses_that_are_placeholders_are_said_once():
    """Whoever publishes the project changes one line each."""
    assert (ROOT / "pyproject.toml").read_text().count("example.org") == 1
    assert (ROOT / "SECURITY.md").read_text().count("example.org") == 1
    others = {"CITATION.cff", "README.md", "CONTRIBUTING.md", "docs/install.md"}
    assert not [name for name in others if "example.org" in (ROOT / name).read_text()]


def test_the_citation_is_of_this_release():
    text = (ROOT / "CITATION.cff").read_text()
    assert text.startswith("cff-version: 1.2.0\n")
    assert re.search(r"^version: (.*)$", text, re.M)[1] == __release__
    released = re.search(r"^date-released: (.*)$", text, re.M)[1]
    assert f"## {__release__} ({released})" in (ROOT / "CHANGELOG.md").read_text()
    assert re.search(r"^license: (.*)$", text, re.M)[1] == "BSD-3-Clause"
    for key in ("message", "title", "authors", "references"):
        assert re.search(rf"^{key}:", text, re.M)


def test_pictures_are_as_the_page_says():
    text = (ROOT / "docs" / "conventions.md").read_text()
    assert f"radius is {sphere_radius(1):g} N" in text.replace("\n", " ")
    normal = sphere_normals(Viewer(0, 0), np.array(0.6), np.array(0.48))
    np.testing.assert_allclose(normal, [0.6, 0.48, 0.64], atol=1e-12)
    side = Viewer(90, 0)  # V = +X sees -Z on its right
    np.testing.assert_allclose(
        sphere_normals(side, np.array(1.0), np.array(0.0)), [0, 0, -1], atol=1e-12
    )
