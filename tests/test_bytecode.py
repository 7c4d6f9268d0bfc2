"""Compiled modules are kept where Python keeps none, for their owner alone, and used again."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import shrm_cli
from tests.cli.helpers import done

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="users are of POSIX")


@pytest.fixture
def copied(tmp_path):
    """A copy of the package that was never compiled."""
    where = tmp_path / "copy"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(shrm_cli.__file__).parent, where / "shrm_cli", ignore=ignored)
    return where


def start(where, cache, code="", **environment):
    """Run `shrm --version`, or code before it, by a copy of the package; return its output."""
    code = code or "pass"
    program = f"import sys; sys.argv = ['shrm', '--version']\n{code}\n"
    program += "from shrm_cli.__main__ import main; main()"
    environment = {"PYTHONDONTWRITEBYTECODE": "1", "SHRM_CACHE_DIR": str(cache), **environment}
    found = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=where,
        env={**os.environ, "PYTHONPATH": str(where), **environment},
    )  # fmt: skip
    assert "version" in found.stdout
    return found.stdout


def kept(cache):
    return sorted((cache / "bytecode").rglob("*.pyc"))


COMPILES = """
import builtins
original = builtins.compile
def compile(source, name, *rest, **more):
    if "shrm_cli" in str(name): print("compiled", name)
    return original(source, name, *rest, **more)
import importlib._bootstrap_external as loading
before = loading.SourceLoader.source_to_code
def source_to_code(self, data, path, **more):
    if "shrm_cli" in str(path): print("compiled", path)
    return before(self, data, path, **more)
loading.SourceLoader.source_to_code = source_to_code
"""


def compiled(output):
    return [line.split()[-1] for line in output.splitlines() if line.startswith("compiled")]


def test_the_second_start_compiles_nothing_that_the_first_did(copied, tmp_path):
    cache = tmp_path / "cache"
    first = compiled(start(copied, cache, COMPILES))
    second = compiled(start(copied, cache, COMPILES))
    assert len(first) > 8
    # What begins to keep it is compiled each time.
    assert len(second) < len(first) / 2
    assert any(path.endswith("cli/main.py") for path in first)
    assert not any(path.endswith("cli/main.py") for path in second)
    assert kept(cache)
    assert not list(copied.rglob("__pycache__"))
    assert (cache / "bytecode").stat().st_mode & 0o777 == 0o700


def test_a_changed_module_is_compiled_again(copied, tmp_path):
    start(copied, tmp_path)
    module = copied / "shrm_cli" / "cli" / "usage.py"
    module.write_text(module.read_text() + "\nprint('changed')\n")
    assert "changed" in start(copied, tmp_path)


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: b"no code",
        lambda data: data[: len(data) // 2],  # as where a disk is full
        lambda data: data[:20],
        lambda data: data[:16] + bytes(len(data) - 16),  # as where power fails
    ],
    ids=["text", "half", "head", "zeros"],
)
def test_a_damaged_file_is_not_run(copied, tmp_path, damage):
    start(copied, tmp_path)
    whole = {path: path.read_bytes() for path in kept(tmp_path)}
    for path, data in whole.items():
        path.write_bytes(damage(data))
    start(copied, tmp_path)
    assert {path: path.read_bytes() for path in kept(tmp_path)} == whole  # made again


@pytest.mark.parametrize("how", ["others write", "a link", "a file"])
def test_a_folder_that_is_not_ones_own_is_not_used(copied, tmp_path, how):
    folder = tmp_path / "bytecode"
    if how == "a file":
        folder.write_text("")
    elif how == "a link":
        (tmp_path / "elsewhere").mkdir(mode=0o700)
        folder.symlink_to(tmp_path / "elsewhere")
    else:
        folder.mkdir()
        folder.chmod(0o770)
    start(copied, tmp_path)
    assert not list(tmp_path.rglob("*.pyc"))


def test_python_that_keeps_it_itself_is_left_to_it(copied, tmp_path):
    start(copied, tmp_path / "cache", PYTHONDONTWRITEBYTECODE="")
    assert list((copied / "shrm_cli").rglob("*.pyc"))
    # The package is compiled from now on, so that there is nothing to keep.
    start(copied, tmp_path / "cache")
    assert not kept(tmp_path / "cache")


def test_other_packages_are_left_alone(copied, tmp_path):
    start(copied, tmp_path, "import click")
    assert not [path for path in kept(tmp_path) if "shrm_cli" not in str(path)]


def test_the_cache_counts_and_clears_it(copied, tmp_path, monkeypatch):
    start(copied, tmp_path)
    monkeypatch.setenv("SHRM_CACHE_DIR", str(tmp_path))
    assert f"{len(kept(tmp_path))} entries" in done("cache", "info")
    done("cache", "clear")
    assert not (tmp_path / "bytecode").exists()
