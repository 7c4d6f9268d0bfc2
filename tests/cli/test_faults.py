"""Faults from outside: processes that are killed at any moment, full disks, odd environments.

Nothing may be lost or half-written, and what a killed process leaves the next run removes. With
FAULTS=50 in the environment as many moments are tried, and all signals.
"""

import functools
import os
import random
import shutil
import signal
import subprocess
import sys
import time

import pytest

from tests.cli.helpers import (
    MAIN,
    NO_MODULES,
    Run,
    environment,
    noise,
    run,
    snapshot,
    start,
    write_exr,
)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="has no such signals")

MOMENTS = int(os.environ.get("FAULTS", "1"))
# What the installed command runs: it obeys Ctrl-C while the command line loads, too.
WHOLE = "from shrm_cli.__main__ import main; main()"
COMMANDS = {
    "prefilter": ("prefilter", "probe.exr", "--brdf", "ggx:roughness=0.4", "-o", "out.exr"),
    "frames": ("render", "m.exr", "--frames", "12", "--size", "32", "-o", "out.%04d.png"),
    "convert": ("convert", "m.exr", "--to", "lightfield", "--views", "8", "-o", "out.exr"),
    "faces": ("convert", "probe.exr", "--to", "faces", "--size", "256", "-o", "out_%.exr"),
}


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A folder with a probe and its map."""
    folder = tmp_path_factory.mktemp("faults")
    write_exr(folder / "probe.exr", noise(32, 64))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        made = run("prefilter", "probe.exr", "--brdf", "ggx:roughness=0.5", "-o", "m.exr")
    assert made.code == 0
    return folder


@pytest.fixture(scope="module")
def finished(prepared):
    """A function that tells what a command writes there, and how many seconds it takes."""

    @functools.cache
    def whole(name):
        other = prepared.with_name(f"{prepared.name}-{name}")
        shutil.copytree(prepared, other)
        begin = time.monotonic()
        assert subprocess_in(other, COMMANDS[name]).code == 0
        return snapshot(other), time.monotonic() - begin

    return whole


def subprocess_in(folder, command, code=MAIN, **changes):
    """Run a command in a folder, in an environment with some changes; None removes a variable."""
    changed = {k: v for k, v in {**environment(), **changes}.items() if v is not None}
    found = subprocess.run(
        [sys.executable, "-c", code, *command],
        cwd=folder, env=changed, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    return Run(found.returncode, found.stdout, found.stderr)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
@pytest.mark.parametrize("name", COMMANDS)
def test_killed_at_any_moment(prepared, finished, tmp_path, name, number):
    """Outputs are whole or not there, and a second run makes what the first would have made."""
    if MOMENTS == 1 and (number in (signal.SIGHUP, signal.SIGINT) or name == "faces"):
        pytest.skip("FAULTS=50 tries all")
    whole, seconds = finished(name)
    rng = random.Random(f"{name} {number}")
    code = f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n{WHOLE}"
    for moment in range(MOMENTS):
        folder = tmp_path / str(moment)
        shutil.copytree(prepared, folder)
        with start(*COMMANDS[name], code=code, cwd=folder) as child:
            time.sleep(rng.uniform(0.2, 1) * seconds)
            child.send_signal(number)
            _, err = child.communicate(timeout=60)
        found = snapshot(folder)
        left = [each for each in found if ".shrm-" in each]
        assert all(whole[each] == found[each] for each in found if each not in left)
        if number != signal.SIGKILL:
            assert left == [], (child.returncode, err)
            assert "Traceback" not in err
        if moment == 0 or number == signal.SIGKILL:
            assert subprocess_in(folder, COMMANDS[name]).code == 0
            assert snapshot(folder) == whole


WRITERS = [
    ("prefilter", "probe.exr", "--brdf", "phong", "-o", "out.exr"),
    ("prefilter", "probe.exr", "--to", "irradiance", "-o", "out.exr"),
    ("render", "m.exr", "--size", "64", "-o", "out.png"),
    ("render", "m.exr", "--size", "64", "-o", "out.exr"),
    ("compare", "m.exr", "m.exr", "--size", "64", "--no-flip", "-o", "out.png"),
    ("convert", "probe.exr", "--to", "faces", "--size", "32", "-o", "out_%.exr"),
    ("reference", "probe.exr", "--brdf", "phong", "--size", "32", "-o", "out.png"),
    ("brdf", "ggx", "--save", "out.npz"),
    ("brdf", "ggx", "--save", "out.exr"),
    ("dfg", "--size", "32", "-o", "out.exr"),
    ("probe", "studio", "--size", "32", "-o", "out.exr"),
]


@pytest.mark.parametrize("limit", [0, 1000])
@pytest.mark.slow
def test_a_full_disk_at_every_writer(prepared, tmp_path, limit):
    """All commands in one process, whose files cannot grow beyond so many bytes."""
    folder = tmp_path / "full"
    shutil.copytree(prepared, folder)
    before = snapshot(folder)
    code = f"""
{NO_MODULES}
import resource, sys
from shrm_cli.cli.main import main
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
for command in {WRITERS!r}:
    try:
        main(list(command))
    except SystemExit as stop:
        print(stop.code, file=sys.stderr)
"""
    result = subprocess_in(folder, [], code)
    lines = result.err.splitlines()
    assert result.out == ""
    assert lines[1::2] == ["1"] * len(WRITERS), result.err
    for command, line in zip(WRITERS, lines[::2], strict=True):
        assert line.startswith("Error: out"), command
        assert "make room or name another output" in line, command
    assert snapshot(folder) == before


@pytest.mark.parametrize(
    "changes",
    [
        {"HOME": "/proc/nothing", "SHRM_CACHE_DIR": None, "XDG_CACHE_HOME": None},
        {"SHRM_CACHE_DIR": "/dev/null/cache"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"PYTHONIOENCODING": "ascii", "TERM": "dumb"},
    ],
    ids=lambda changes: next(iter(changes)),
)
@pytest.mark.slow
def test_odd_environments(prepared, finished, tmp_path, changes):
    """The same bytes and no word on stderr, whatever the variables are."""
    folder = tmp_path / "odd"
    shutil.copytree(prepared, folder)
    result = subprocess_in(folder, COMMANDS["convert"], **changes)
    assert (result.code, result.err) == (0, "")
    assert snapshot(folder) == finished("convert")[0]


@pytest.mark.slow
def test_an_output_that_the_locale_cannot_spell(prepared, tmp_path):
    """The name is UTF-8; it is the process that takes names for ASCII."""
    folder = tmp_path / "odd"
    shutil.copytree(prepared, folder)
    before = snapshot(folder)
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    *command, _ = COMMANDS["convert"]
    result = subprocess_in(folder, [*command, "pr\u00fcfung.exr"], **plain)
    assert result.code == 1
    assert "the locale's encoding, ascii, lacks; set LC_ALL=C.UTF-8, or name another" in result.err
    assert "not UTF-8" not in result.err
    assert snapshot(folder) == before
