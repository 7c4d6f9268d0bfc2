"""What messages and pages tell to install: the packages themselves, as one table words them."""

import importlib.util
import re
import sys
import tomllib

import pytest

from shrm_cli import extras
from shrm_cli.cli import main
from tests.cli.helpers import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
FOR_WORK_ON_IT = {"dev", "mutants", "site", "web-test"}
"""Extras that no command of `shrm` needs."""
PLACES = ["*.md", "*.cff", "*.in", "Makefile", "pyproject.toml", ".ci/*", "docs/*", "examples/*",
          "probes/*", "shrm_cli/**/*"]  # fmt: skip
OTHERS = {"pip install openjd-cli", "pip install ./examples/plugin"}
"""What is told to be installed for tests of other programs, and the example of a package."""
OWN = re.compile(r"-e|-U|\.|\.\[[a-z,-]+\]|(dist/)?shrm_cli-[0-9a-z.*+-]+\.whl(\[[a-z,-]+\])?")
"""An option, this repository or a wheel of it, with extras or without."""


def texts():
    """Every text that a user may read, by its name; files of other kinds are left out."""
    for place in PLACES:
        for path in sorted(ROOT.glob(place)):
            if path.is_file() and path.suffix != ".pyc":
                try:
                    yield path.relative_to(ROOT).as_posix(), path.read_text()
                except UnicodeDecodeError:
                    continue


TEXTS = dict(texts())


def told(text):
    """What a text tells pip to install, one command each: a code span that may be broken into
    lines, or the rest of a line.
    """
    for match in re.finditer(r"\bpip\s+install\b", text):
        paragraph = text.rfind("\n\n", 0, match.start()) + 1
        if text.count("`", paragraph, match.start()) % 2:
            found = text[match.start() : text.index("`", match.start())]
        else:
            found = re.split(r"\n|  #|;", text[match.start() :], maxsplit=1)[0]
        yield " ".join(found.replace("'", "").split())


def is_known(command):
    worded = {extras.install(each) for each in extras.EXTRAS}
    worded |= {extras.install_store(each) for each in extras.STORES}
    return command in worded | OTHERS or all(
        OWN.fullmatch(each) for each in command.removeprefix("pip install").split()
    )


def test_what_shrm_cannot_do_without_is_what_is_required():
    assert [re.match(r"\w+", each)[0] for each in PROJECT["dependencies"]] == list(main._REQUIRED)


def test_the_table_is_that_of_the_distribution():
    names = {
        extra: tuple(re.split(r"[^\w-]", requirement, maxsplit=1)[0] for requirement in wanted)
        for extra, wanted in PROJECT["optional-dependencies"].items()
        if extra not in FOR_WORK_ON_IT
    }
    assert names == extras.EXTRAS


def test_the_distribution_asks_for_itself_by_its_own_name():
    assert PROJECT["name"] == "shrm-cli"
    requirements = [each for wanted in PROJECT["optional-dependencies"].values() for each in wanted]
    own = [each for each in requirements if each.startswith("shrm")]
    assert own
    assert all(each.startswith("shrm-cli[") for each in own)


def test_fsspec_names_the_same_packages():
    known = pytest.importorskip("fsspec.registry").known_implementations
    for scheme, package in extras.STORES.items():
        assert package in known[scheme]["err"]
    assert extras.install_store("S3") == "pip install s3fs"
    assert extras.install_store("webdav") == "install it"


@pytest.mark.parametrize("name", [name for name, text in TEXTS.items() if any(told(text))])
def test_what_is_told_to_be_installed_is_worded_at_one_place(name):
    if name in ("Makefile", "shrm_cli/extras.py"):
        return  # what is passed to pip as options; the place itself
    for command in told(TEXTS[name]):
        assert is_known(command), command


def test_nothing_tells_to_install_a_stranger():
    """`shrm` on PyPI is another project."""
    assert len(TEXTS) > 400
    stranger = re.compile(r"(\binstall|\badd|--with|--from)\s+(-\S+\s+)*'?shrm(-cli)?\b(?!_)")
    for name, text in TEXTS.items():
        assert "shrm[" not in text, name
        assert not stranger.search(text), name


@pytest.mark.parametrize(
    ("text", "commands"),
    [
        ("see `pip\ninstall x`", ["pip install x"]),
        ("so `pip install\n'trimesh' embreex`, then", ["pip install trimesh embreex"]),
        ("so:\n\n    pip install shrm[mesh]  # all\n", ["pip install shrm[mesh]"]),
        ("no mesh; pip install trimesh", ["pip install trimesh"]),
        ("    uv pip install -e .[mesh]\n", ["pip install -e .[mesh]"]),
    ],
)
def test_commands_are_found(text, commands):
    assert list(told(text)) == commands
    known = {"pip install trimesh embreex", "pip install -e .[mesh]"}
    assert [is_known(each) for each in commands] == [each in known for each in commands]


def test_gradients_without_torch_say_what_to_install(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.delitem(sys.modules, "shrm_cli.torch", raising=False)
    with pytest.raises(ImportError, match=f"the package torch; {extras.install('torch')}$"):
        importlib.import_module("shrm_cli.torch")
