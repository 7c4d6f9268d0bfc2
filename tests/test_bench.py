"""What `make bench` writes, and that README has no other numbers of it."""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests.benchmarks import __main__ as benchmarks
from tests.benchmarks.__main__ import main
from tests.benchmarks.bench_start import _copies, _environment, last_release
from tests.benchmarks.results import END, README, START, block, merged, read_results, replaced
from tests.benchmarks.table import Row

ROWS = [Row("a | b", 123.456, 60.0, 2.0576, 1.25, "a floor"), Row("c (MB)", 0.0512, 7.0, 0.5)]


def test_the_table_of_readme_is_that_of_the_committed_results():
    text = README.read_text()
    assert replaced(text, read_results()) == text, "python -m tests.benchmarks writes both"
    assert len(read_results()["rows"]) > 0


def test_readme_tells_no_time_but_in_that_table():
    text = README.read_text()
    text = text[: text.index(START)] + text[text.index(END) :]
    assert re.findall(r"\d[\d.]* (?:s|ms|seconds|minutes)\b", text) == []
    assert re.findall(r"\d\S* times (?:faster|slower|as fast)", text) == []


def test_copies_are_compiled_or_hold_no_bytecode_at_all(tmp_path):
    package = tmp_path / "checkout" / "shrm_cli"
    (package / "__pycache__").mkdir(parents=True)
    (package / "__init__.py").write_text("from shrm_cli import other\n")
    (package / "other.py").write_text("print(__file__)\n")
    (package / "__pycache__" / "left.cpython-311.pyc").write_bytes(b"from elsewhere")
    for way, tree in _copies(package, tmp_path / "copies").items():

        def compiled(tree=tree):
            return sorted(path.name.partition(".")[0] for path in tree.rglob("*.pyc"))

        expected = ["__init__", "other"] if way == "bytecode" else []
        assert compiled() == expected
        ran = subprocess.run(
            [sys.executable, "-c", "import shrm_cli"],
            cwd=tree, env=_environment(way, tree), check=True, capture_output=True, text=True,
        )  # fmt: skip
        assert Path(ran.stdout.strip()) == tree / "shrm_cli" / "other.py"  # none that is installed
        assert compiled() == expected  # a run without bytecode leaves none


def test_rows_are_rendered_with_what_they_are_measured_against():
    text = block({"machine": "2 processors", "rows": {"start": [vars(row) for row in ROWS]}})
    assert text.startswith("On 2 processors:\n")
    assert "| a / b | 123 ms | 60.0 ms | 2.06 | 1.25 | a floor |\n" in text
    assert "| c (MB) | 0.0512 | 7.00 | 0.50 |  |  |\n" in text


def test_benchmarks_that_did_not_run_keep_their_rows():
    before = merged({"machine": "", "rows": {}}, {"start": ROWS, "sphere": ROWS[:1]})
    after = merged(before, {"start": ROWS[1:]})
    assert [row["name"] for row in after["rows"]["start"]] == ["c (MB)"]
    assert after["rows"]["sphere"] == before["rows"]["sphere"]


def test_readme_without_marks_is_not_written():
    with pytest.raises(ValueError, match="lost the marks"):
        replaced("no marks", read_results())
    assert README.read_text().count(START) == README.read_text().count(END) == 1


def test_unknown_benchmarks_are_refused(capsys):
    with pytest.raises(SystemExit):
        main(["strat"])
    assert "no benchmark is called 'strat'; there are sphere, start" in capsys.readouterr().err


def test_rows_are_told_as_they_are_measured(monkeypatch, capsys):
    """All of them together take minutes, which were silent."""

    def rows():
        yield ROWS[0]
        assert "a | b" in capsys.readouterr().out
        yield ROWS[1]

    fake = ModuleType("tests.benchmarks.bench_fake")
    fake.rows = rows
    monkeypatch.setitem(sys.modules, fake.__name__, fake)
    monkeypatch.setattr(benchmarks, "MODULES", [fake.__name__])
    monkeypatch.setattr(benchmarks, "limit_small_products", lambda: None)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "")
    main(["--print", "fake"])
    assert "1 of 1 bars missed" in capsys.readouterr().out


def test_without_git_the_last_release_is_left_out_with_a_line(tmp_path, capsys):
    assert last_release(tmp_path / "release", tmp_path) is None
    told = capsys.readouterr().err
    assert told.startswith("bench: no comparison with the last release: ")
    assert told.count("\n") == 1


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_the_last_release_is_the_newest_tag_before_this_commit(tmp_path):
    def git(*arguments):
        who = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
        subprocess.run(["git", *who, *arguments], cwd=tmp_path, check=True, capture_output=True)

    git("init")
    (tmp_path / "shrm_cli").mkdir()
    for tag in ("v0.9.0", "v0.10.0", "v0.11.0"):
        (tmp_path / "shrm_cli" / "a.py").write_text(tag)
        git("add", ".")
        git("commit", "-m", tag)
        git("tag", tag)
    revision, source = last_release(tmp_path / "release", tmp_path)
    assert (revision, (source / "a.py").read_text()) == ("v0.10.0", "v0.10.0")
