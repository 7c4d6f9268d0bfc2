"""The pages of the reference, man pages, figures' and the gallery's programs, without MkDocs."""

import re
import shutil
import subprocess

import click
import numpy as np
import pytest

import shrm_cli
from shrm_cli.cli.main import cli
from tests.cli.helpers import ROOT
from tests.site import gallery
from tests.site.manual import man_pages
from tests.site.reference import command_pages, python_page

PAGES = dict(command_pages())


def options(command):
    """The names of all options of a command and of those below it, but hidden ones."""
    names = {
        name
        for each in command.params
        if isinstance(each, click.Option) and not each.hidden
        for name in each.opts
    }
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            names |= options(command.get_command(context, name))
    return names


@pytest.mark.parametrize("name", cli.list_commands(click.Context(cli)))
def test_every_option_of_a_command_is_on_its_page(name):
    command = cli.get_command(click.Context(cli), name)
    told = " ".join(re.findall(r"^\| `([^`]*)`", PAGES[name], re.M))
    for option in options(command):
        assert re.search(rf"(?<![\w-]){re.escape(option)}(?![\w-])", told), option


def test_text_of_help_means_itself_in_markdown():
    """A product of terms is no emphasis, options are code, and no cell ends within a line."""
    assert r"0.5\*lambertian+0.5\*ggx" in PAGES["prefilter"]
    assert "\nWith `--eps` it is an SHRM" in PAGES["prefilter"]
    for text in PAGES.values():
        for line in re.findall(r"^\| `-.*$", text, re.M):
            outside = re.sub(r"`[^`]*`|\\\|", "", line)
            assert outside.count("|") == 3, line


def test_every_public_name_has_a_place():
    text = python_page(shrm_cli._HOMES)
    for name in shrm_cli.__all__:
        assert name.startswith("__") or f'heading: "{name}"' in text


@pytest.fixture(scope="module")
def manual(tmp_path_factory):
    """What is written for the manual, by name."""
    folder = tmp_path_factory.mktemp("man")
    man_pages(folder)
    return {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}


@pytest.fixture
def set_page():
    """Sets a page of the manual as `man` does, with options of groff; what groff did."""
    groff = shutil.which("groff")
    if groff is None:
        pytest.skip("groff is not installed")

    def run(text, *options):
        command = [groff, "-K", "utf8", "-man", "-Tutf8", *options]
        return subprocess.run(command, input=text, capture_output=True, text=True, check=True)

    return run


def test_the_manual_has_a_page_of_every_command_that_others_name(manual):
    assert {"shrm-probe-sky.1", "shrm.bash", "shrm.zsh", "shrm.fish"} <= set(manual)
    named = set(re.findall(r"^\.BR (\S+) \(1\)$", "\n".join(manual.values()), re.M))
    assert {f"{each}.1".replace(r"\-", "-") for each in named} == {
        name for name in manual if name.endswith(".1")
    }
    for name in cli.list_commands(click.Context(cli)):
        assert rf".BR shrm\-{name} (1)" in manual["shrm.1"]


def test_a_page_of_the_manual_shows_all_that_help_says(manual, set_page):
    """As `man` sets it, which would leave out lines that it takes for requests."""
    for name, text in manual.items():
        if name.endswith(".1"):
            done = set_page(text, "-P-cbou", "-rHY=0", "-rLL=500n")
            command, context = cli, click.Context(cli)
            for part in name.removesuffix(".1").split("-")[1:]:
                command = command.get_command(context, part)
            told = command.help, *(each.help for each in command.params if hasattr(each, "help"))
            shown = " ".join(done.stdout.split())
            for paragraph in "\n\n".join(filter(None, told)).replace("\b", "").split("\n\n"):
                assert " ".join(paragraph.split()) in shown, name
            assert done.stderr == "", name


def test_pages_of_the_manual_fit_into_80_columns(manual, set_page):
    """Long lists of an option's values stood out, as they had no place to be broken at."""
    for name, text in manual.items():
        if name.endswith(".1"):
            assert set_page(text, "-rLL=80n", "-wbreak").stderr == "", name


def test_pages_of_docs_are_in_the_navigation():
    told = set(re.findall(r"[\w/-]+\.md", (ROOT / "mkdocs.yml").read_text()))
    docs = ROOT / "docs"
    assert {path.relative_to(docs).as_posix() for path in docs.rglob("*.md")} <= told


def test_the_site_asks_for_nothing_from_elsewhere():
    text = (ROOT / "mkdocs.yml").read_text()
    assert "font: false" in text
    assert "//" not in text
    assert "polyfills: [iframe-worker/index.js]" in text  # or it is taken from unpkg.com


def test_figures_are_all_on_a_page():
    pages = "".join(path.read_text() for path in (ROOT / "docs" / "theory").glob("*.md"))
    drawn = {path.name for path in (ROOT / "docs" / "figures").iterdir()}
    assert drawn == set(re.findall(r"\(\.\./figures/([\w-]+\.svg)\)", pages))
    pytest.importorskip("matplotlib")
    from tests.site.figures import FIGURES

    assert drawn == {f"{name}.svg" for name in FIGURES}


def test_last_bits_of_a_figure_are_not_in_its_file(tmp_path, monkeypatch):
    """Such bits are not the same on each machine, and matplotlib makes names of them."""
    pytest.importorskip("matplotlib")
    from tests.site import figures

    texts = []
    for top in (0.9, np.nextafter(0.9, 1), 0.9 + 1e-7):

        def draw(figure, top=top):
            for bottom in (0.1, 0.5):
                figure.add_axes((0.1, bottom, 0.8, (top - 0.1) / 2)).plot([1, 3, 2])
            figure.set_layout_engine("none")

        monkeypatch.setattr(figures, "FIGURES", {"two": draw})
        figures.main(tmp_path)
        texts.append((tmp_path / "two.svg").read_text())
    assert len(set(texts)) == 1
    named = re.findall(r'<clipPath id="(\w+)"', texts[0])
    assert len(set(named)) == len(named) == 2
    assert set(re.findall(r"url\(#(\w+)\)", texts[0])) == set(named)


@pytest.mark.proof
def test_a_short_gallery(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "SHORT", gallery.Extent(("chalk",), 32))
    monkeypatch.setattr(gallery, "PROBES", {"studio": "0"})
    gallery.main([str(tmp_path / "gallery"), "--short"])
    text = (tmp_path / "gallery" / "gallery.md").read_text()
    rows = re.findall(r"^\| (\w+) \| [\d,]+ \| [\d.]+% \|.*% \|$", text, re.M)
    made = re.findall(r"^shrm prefilter probes/studio.exr --to (\w+)", text, re.M)
    assert rows == made == ["irradiance", "shrm"]
    linked = set(re.findall(r"\]\(gallery/(.*?)\)", text))
    assert linked == {"studio-chalk.html", "studio-chalk.png"}
    assert all((tmp_path / "gallery" / name).stat().st_size > 1000 for name in linked)
