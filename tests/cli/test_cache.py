"""`shrm cache`: what is kept, and its removal."""

import json

import pytest

from shrm_cli.arrays import Memo
from shrm_cli.brdf import cache
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from tests.cli.helpers import assert_refused, done, process, run


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A cache with two entries."""
    monkeypatch.setenv("SHRM_CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr(cache, "_SLOW", -1.0)
    monkeypatch.setattr(cache, "_in_memory", Memo(0))  # as in a new process
    for exponent in (2, 3):
        brdf = parse_spec(f"phong:exponent={exponent}")
        cache.cached_coefficients(brdf, 8, 3, 1e-2, compute_coefficients)
    return tmp_path / "kept"


def size(folder):
    return sum(path.stat().st_size for path in folder.iterdir())


def test_info(folder):
    assert json.loads(done("cache", "info", "--json")) == {
        "folder": str(folder),
        "entries": 2,
        "bytes": size(folder),
        "limit": 512 * 2**20,
    }
    text = done("cache", "info")
    assert text == f"{folder}: 2 entries, {size(folder) / 1000:.3g} kB, at most 537 MB\n"


def test_clear(folder):
    expected = size(folder)
    assert done("cache", "clear") == f"{folder}: 2 entries, {expected / 1000:.3g} kB removed\n"
    assert not folder.exists()
    assert "0 entries, 0 bytes" in done("cache", "info")
    assert json.loads(done("cache", "clear", "--json")) == {
        "folder": str(folder),
        "removed": 0,
        "bytes": 0,
    }


def test_quiet(folder):
    assert done("cache", "info", "--quiet") == ""
    assert done("cache", "clear", "--quiet") == ""
    assert not folder.exists()


def test_wrong_usage(folder):
    assert_refused(run("cache", "clean"), 2, "No such command 'clean'")
    assert_refused(run("cache", "clear", "everything"), 2, "everything")
    assert size(folder) > 0


def test_as_a_process(folder):
    result = process("cache", "clear", "--json")
    assert (result.code, result.err) == (0, "")
    assert json.loads(result.out)["removed"] == 2
