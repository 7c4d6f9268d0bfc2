"""Streams that are closed, full, or a pipe whose reader has gone: files are made all the same.

What cannot be told on stderr is dropped. Results that cannot be printed are an error.
"""

import functools
import os
import shlex
import shutil
import subprocess
import sys

import pytest

from tests.cli.helpers import WHOLE, Run, environment, run, snapshot, write_scene

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="has no such shell"),
    pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full to print to"),
]

COMMANDS = {
    "quiet about nothing": ("prefilter", "probe.exr", "--brdf", "phong", "-o", "out.exr"),
    "a warning": ("sun", "lamp.exr", "--clamp", "2", "-o", "out.exr", "--light-file", "out.toml"),
    "announced": ("transfer", "mesh.obj", "--samples", "4", "-o", "out.npz"),
    "no file": ("info", "probe.exr"),
    "help": ("--help",),
    "an error": ("prefilter", "no.exr", "--brdf", "phong", "-o", "out.exr"),
    "wrong usage": ("prefilter", "--brdf", "phong"),
}
CLOSED = "Error: standard output: Bad file descriptor\n"
FULL = "Error: standard output: No space left on device\n"


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A folder with a probe, one with lamps and a mesh."""
    folder = tmp_path_factory.mktemp("streams")
    write_scene(folder)
    return folder


@pytest.fixture(scope="module")
def whole(prepared, tmp_path_factory):
    """A function that tells what comes of a command whose streams are all there."""

    @functools.cache
    def told(name):
        folder = tmp_path_factory.mktemp("whole") / "here"
        shutil.copytree(prepared, folder)
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(folder)
            return run(*COMMANDS[name]), snapshot(folder)

    return told


def redirected(prepared, folder, command, redirection, **options):
    """Run a command in a copy of the folder, and return what came of it and the files there."""
    shutil.copytree(prepared, folder)
    line = shlex.join([sys.executable, "-c", WHOLE, *command])
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    found = subprocess.run(
        f"{line} {redirection}", shell=True, text=True, cwd=folder, env=environment(), **options
    )
    return Run(found.returncode, found.stdout, found.stderr), snapshot(folder)


@pytest.mark.proof
@pytest.mark.parametrize("name", COMMANDS)
def test_files_are_made_whatever_becomes_of_the_streams(prepared, whole, tmp_path, name):
    command = COMMANDS[name]
    expected, files = whole(name)
    assert ("Warning: " in expected.err) == (name == "a warning")
    for number, silent in enumerate(["2>&-", "2>/dev/full", "<&- 2>&-"]):
        found, made = redirected(prepared, tmp_path / f"err{number}", command, silent)
        assert found == Run(expected.code, expected.out, ""), silent
        assert made == files
    is_told = name not in ("an error", "wrong usage")
    for number, (closed, said) in enumerate({">&-": CLOSED, ">/dev/full": FULL}.items()):
        if name == "help" and closed == ">&-":
            continue  # click prints it to nobody
        found, made = redirected(prepared, tmp_path / f"out{number}", command, closed)
        # Of a sun, warnings follow the results.
        wanted = Run(1, "", said) if is_told else expected
        assert found == wanted, closed
        assert made == files
    found, made = redirected(prepared, tmp_path / "all", command, "<&- >&- 2>&-")
    assert found == Run(1 if is_told and name != "help" else expected.code, "", "")
    assert made == files


@pytest.mark.parametrize(
    ("name", "both"),
    [*((name, False) for name in COMMANDS), ("a warning", True), ("an error", True)],
)
@pytest.mark.slow
def test_a_pipe_that_ends_early(prepared, whole, tmp_path, name, both):
    """Its reader has gone before the first byte, as in ``shrm ... | head -c0``."""
    command = COMMANDS[name]
    expected, files = whole(name)
    reader, writer = os.pipe()
    os.close(reader)
    streams = {"stdout": writer, **({"stderr": writer} if both else {})}
    found, made = redirected(prepared, tmp_path / "pipe", command, "", **streams)
    os.close(writer)
    is_told = name not in ("an error", "wrong usage")
    assert found.code == (1 if is_told else expected.code)
    assert found.err == (None if both else "" if is_told else expected.err)
    assert made == files


@pytest.mark.parametrize(
    ("closed", "code", "out", "err"),
    [
        ("2>&-", 0, "furnace.exr: 16 x 8, half\n", ""),
        (">&-", 1, "", CLOSED),
        (">&- 2>&-", 1, "", ""),
        ("<&-", 0, "furnace.exr: 16 x 8, half\n", ""),
    ],
)
def test_streams_that_are_closed(tmp_path, closed, code, out, err):
    command = ("probe", "furnace", "--size", "8", "-o", "furnace.exr")
    (tmp_path / "empty").mkdir()
    found, made = redirected(tmp_path / "empty", tmp_path / "here", command, closed)
    assert found == Run(code, out, err)
    assert sorted(made) == ["furnace.exr"]
    assert run("info", tmp_path / "here" / "furnace.exr").code == 0
