"""The pages of the reference, man pages, figures' and the gallery's programs, without MkDocs."""

import re

import click
import pytest

import shrm_cli
from shrm_cli.cli.main import cli
from tests.cli.helpers import ROOT
from tests.site import gallery
from tests.site.reference import command_pages, man_pages, python_page

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
    """A product of terms is no emphasis, and no cell of a table ends within a line."""
    assert r"0.5\*lambertian+0.5\*ggx" in PAGES["prefilter"]
    for text in PAGES.values():
        for line in re.findall(r"^\| `-.*$", text, re.M):
            outside = re.sub(r"`[^`]*`|\\\|", "", line)
            assert outside.count("|") == 3, line


def test_every_public_name_has_a_place():
    text = python_page(shrm_cli._HOMES)
    for name in shrm_cli.__all__:
        assert name.startswith("__") or f'heading: "{name}"' in text


@pytest.mark.filterwarnings("ignore:.*short_help:DeprecationWarning")  # click-man asks for it
def test_man_pages_and_completion(tmp_path):
    pytest.importorskip("click_man")
    man_pages(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert {"shrm.1", "shrm-prefilter.1", "shrm-probe-sky.1", "shrm.zsh"} <= names
    assert r"\-\-brdf" in (tmp_path / "shrm-prefilter.1").read_text()


def test_pages_of_docs_are_in_the_navigation():
    told = set(re.findall(r"[\w/-]+\.md", (ROOT / "mkdocs.yml").read_text()))
    docs = ROOT / "docs"
    assert {path.relative_to(docs).as_posix() for path in docs.rglob("*.md")} <= told


def test_the_site_asks_for_nothing_from_elsewhere():
    text = (ROOT / "mkdocs.yml").read_text()
    assert "font: false" in text
    assert "//" not in text


def test_figures_are_all_on_a_page():
    pages = "".join(path.read_text() for path in (ROOT / "docs" / "theory").glob("*.md"))
    drawn = {path.name for path in (ROOT / "docs" / "figures").iterdir()}
    assert drawn == set(re.findall(r"\(\.\./figures/([\w-]+\.svg)\)", pages))
    pytest.importorskip("matplotlib")
    from tests.site.figures import FIGURES

    assert drawn == {f"{name}.svg" for name in FIGURES}


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
