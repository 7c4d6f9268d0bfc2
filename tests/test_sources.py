"""The fingerprint of the program: another one for every change of code that decides bytes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import shrm_cli
from shrm_cli import sources
from shrm_cli.sources import COEFFICIENTS, EXPORTS, MAPS, fingerprint

PACKAGE = Path(shrm_cli.__file__).parent


def forget():
    """Forget what is known of folders, as a new process does."""
    fingerprint.cache_clear()
    sources._folder_digest.cache_clear()


def below(folder):
    """All modules of a folder of the package, and the tables that they read, by their names."""
    found = (PACKAGE / folder).glob("*" if folder == "" else "**/*")
    names = {path.relative_to(PACKAGE).as_posix() for path in found if path.is_file()}
    return {name for name in names if not name.endswith((".pyc", "py.typed"))} - {"_version.py"}


@pytest.mark.parametrize("folders", [MAPS, COEFFICIENTS, EXPORTS])
def test_all_modules_of_the_folders_count(folders):
    names = [name for folder in folders for name in sources._modules(str(PACKAGE), folder)]
    assert set(names) == set().union(*map(below, folders))
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("vocabulary.py", True),
        ("maps/shrm/make.py", True),
        ("brdf/models/ggx.py", True),
        ("brdf/models/new.py", True),
        ("cli/main.py", False),
        ("maps/notes.txt", False),
        ("brdf/measured/reading/table.csv", True),
        ("maps/tween.js/main.js", True),
        ("maps/tween.js/notes.txt", False),
        ("_version.py", False),
    ],
)
def test_a_change_of_any_module_of_maps_is_noticed(tmp_path, name, counts):
    """Whether a module is changed or new, and not by its time or size."""
    names = ("vocabulary.py", "maps/shrm/make.py", "brdf/models/ggx.py", "brdf/table.py")
    for each in names:
        (tmp_path / each).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / each).write_text("x = 1\n")

    def found():
        forget()  # as in a new process
        return fingerprint(MAPS, str(tmp_path))

    before = found()
    assert found() == before
    (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / name).write_text("x = 2\n")
    assert (found() != before) == counts
    forget()


def loaded_by(code):
    """The modules and folders of the package that a process of its own has loaded at its end."""
    code += "print(*(name for name in sys.modules if name.startswith('shrm_cli.')))\n"
    told = subprocess.run(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, check=True
    )
    return {name.split(".")[1] for name in told.stdout.split()}


def test_all_that_makes_maps_counts():
    """Every module that the making of any map loads is in one of the folders."""
    code = (
        "import sys, shrm_cli.prefilter, shrm_cli.maps.file, shrm_cli.maps.stored\n"
        "from shrm_cli.maps import registry\n"
        "for name in registry.descriptions():\n"
        "    registry.module(name, 'prefilter'), registry.module(name, 'file')\n"
    )
    loaded = loaded_by(code)
    assert {"maps", "brdf", "orders"} <= loaded
    assert {name for name in loaded if (PACKAGE / name).is_dir()} <= set(MAPS)


def test_all_that_makes_files_of_engines_counts():
    """Every module that any engine loads is in one of the folders."""
    code = (
        "import sys, shrm_cli.batch.exports\n"
        "from shrm_cli.export.engine import engine\n"
        "from shrm_cli.vocabulary import ENGINES\n"
        "all(engine(name) for name in ENGINES)\n"
    )
    loaded = loaded_by(code)
    assert "export" in loaded
    # A batch decides what is made, and not what it holds.
    assert {name for name in loaded if (PACKAGE / name).is_dir()} <= {*EXPORTS, "batch"}


@pytest.mark.parametrize(
    ("home", "changed", "counts"),
    [
        ("moon", "moon.py", True),
        ("moon", "other.py", False),
        ("orbit.home", "orbit/home.py", True),
        ("orbit.home", "orbit/deep/table.csv", True),
        ("orbit.home", "orbit/notes.txt", False),
        ("orbit.home", "moon.py", False),
        ("studio.orbit.home", "studio/orbit/__init__.py", True),
        ("studio.orbit.home", "studio/other/home.py", False),
    ],
)
def test_a_change_of_the_package_of_a_form_is_noticed(tmp_path, home, changed, counts):
    """The folder studio has no module of its own: other packages lie in it, too."""
    packages = ("orbit", "studio/orbit", "studio/other")
    names = [f"{each}/{name}.py" for each in packages for name in ("__init__", "home")]
    for each in ("moon.py", "other.py", "orbit/notes.txt", "orbit/deep/table.csv", *names):
        (tmp_path / each).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / each).write_text("")
    code = f"import {home}; from shrm_cli.sources import *; print(fingerprint_with('{home}'))"
    found = []
    for text in ("", "#", "##"):
        (tmp_path / changed).write_text(text)
        line = [sys.executable, "-c", code]
        there = {**os.environ, "PYTHONPATH": os.pathsep.join([str(PACKAGE.parent), str(tmp_path)])}
        found.append(subprocess.run(line, env=there, text=True, check=True, capture_output=True))
    assert len({each.stdout for each in found}) == (3 if counts else 1)


def test_what_moves_from_one_module_to_another_is_noticed(tmp_path):
    found = []
    for first, second in (("ab", "c"), ("a", "bc")):
        (tmp_path / "a.py").write_text(first)
        (tmp_path / "b.py").write_text(second)
        forget()
        found.append(fingerprint(MAPS, str(tmp_path)))
    assert found[0] != found[1]
    forget()


def test_a_package_without_files_is_known_by_its_version(tmp_path, monkeypatch):
    before = fingerprint(MAPS, str(tmp_path / "none"))
    monkeypatch.setattr(shrm_cli, "__version__", "999")
    forget()
    assert fingerprint(MAPS, str(tmp_path / "none")) != before
    forget()
