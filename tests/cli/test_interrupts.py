"""Signals in the middle of writing, and two writers at once.

The child writes half of its temporary file, says so, and waits: signals always hit there.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import shrm_cli
from tests.cli.helpers import (
    MAIN,
    listen,
    noise,
    process,
    read_exr,
    run,
    snapshot,
    start,
    write_exr,
)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="has no such signals")

# A shell without job control starts processes with SIGINT ignored; a terminal does not.
HALF_WRITTEN = f"""
import os, signal, time, OpenEXR
signal.signal(signal.SIGINT, signal.default_int_handler)
write = OpenEXR.File.write
def write_half(self, name):
    write(self, name)
    os.truncate(name, os.path.getsize(name) // 2)
    print("half", flush=True)
    time.sleep(20)
    write(self, name)  # who was not stopped goes on
OpenEXR.File.write = write_half
{MAIN}"""

# Waits with a whole temporary until as many processes have theirs as its first argument says.
TOGETHER = f"""
import signal, sys, time, OpenEXR
from pathlib import Path
signal.alarm(30)  # the other one may have failed
writers = int(sys.argv.pop(1))
write = OpenEXR.File.write
def write_together(self, name):
    write(self, name)
    while len(list(Path(name).parent.glob(".*.shrm-*"))) < writers:
        time.sleep(0.005)
    Path(name + ".seen").touch()
    while len(list(Path(name).parent.glob("*.seen"))) < writers:
        time.sleep(0.005)
OpenEXR.File.write = write_together
{MAIN}"""

WRITE = ("prefilter", "probe.exr", "--brdf", "phong", "-o", "out.exr")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a probe, and an old output."""
    write_exr(tmp_path / "probe.exr", noise())
    (tmp_path / "out.exr").write_text("old")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def struck(folder, number, command=WRITE):
    """What a process said that was sent a signal in mid-write."""
    before = snapshot(folder)
    with start(*command, code=HALF_WRITTEN, preexec_fn=listen) as child:
        assert child.stdout.readline() == "half\n"
        (temporary,) = snapshot(folder).keys() - before.keys()
        assert temporary.startswith(".")
        assert (folder / temporary).stat().st_size > 0
        child.send_signal(number)
        out, err = child.communicate(timeout=30)
    return child.returncode, out, err


@pytest.mark.parametrize("old", [False, True], ids=["no old file", "old file"])
def test_sigint_exits_130_and_leaves_nothing(folder, old):
    if not old:
        (folder / "out.exr").unlink()
    before = snapshot(folder)
    code, out, err = struck(folder, signal.SIGINT)
    assert (code, out) == (130, "")
    assert err.strip() == "Error: interrupted"
    assert snapshot(folder) == before


def test_sigterm_leaves_nothing(folder):
    before = snapshot(folder)
    code, out, err = struck(folder, signal.SIGTERM)
    assert (code, out, err) == (128 + signal.SIGTERM, "", "Error: stopped by SIGTERM\n")
    assert snapshot(folder) == before


def test_a_terminal_that_is_closed_leaves_nothing(folder):
    before = snapshot(folder)
    assert struck(folder, signal.SIGHUP) == (128 + signal.SIGHUP, "", "")
    assert snapshot(folder) == before


@pytest.mark.slow
def test_hangups_are_ignored_under_nohup(folder):
    code = f"import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n{HALF_WRITTEN}"
    with start(*WRITE, code=code.replace("time.sleep(20)", "time.sleep(0.5)")) as child:
        assert child.stdout.readline() == "half\n"
        child.send_signal(signal.SIGHUP)
        child.communicate(timeout=30)
    assert child.returncode == 0
    assert not [name for name in os.listdir(folder) if ".shrm-" in name]


def test_little_is_loaded_before_ctrl_c_is_listened_to():
    """Ctrl-C prints a traceback of Python's own until then."""
    code = """
import sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        print(name)
sys.meta_path.insert(0, Finder())
import shrm_cli.__main__
"""
    found = subprocess.run(
        [sys.executable, "-S", "-c", code], capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONPATH": str(Path(shrm_cli.__file__).parents[1])},
    )  # fmt: skip
    loaded = found.stdout.split()
    assert {"shrm_cli", "shrm_cli.__main__", "signal"} <= set(loaded)
    assert not {"typing", "re", "pathlib", "dataclasses", "click", "numpy"} & set(loaded)


def test_sigint_while_the_command_line_is_loaded():
    """The module that is loaded first sends the signal, in a process that listens to it."""
    code = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "click":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
from shrm_cli.__main__ import main
main()
"""
    result = process("--version", code=code)
    assert (result.code, result.out, result.err) == (130, "", "\nError: interrupted\n")


def test_sigkill_leaves_the_old_file_and_the_next_run_cleans_up(folder):
    before = snapshot(folder)
    code, _, _ = struck(folder, signal.SIGKILL)
    assert code == -signal.SIGKILL
    after = snapshot(folder)
    (left_over,) = after.keys() - before.keys()
    assert after.items() - {(left_over, after[left_over])} == before.items()
    other = run(*WRITE[:-1], "another.exr")
    assert other.code == 0
    assert (folder / left_over).exists()  # it is not that run's business
    assert run(*WRITE).code == 0
    assert sorted(snapshot(folder)) == ["another.exr", "out.exr", "probe.exr"]
    assert (folder / "out.exr").read_bytes() == (folder / "another.exr").read_bytes()


def test_probes_are_written_whole_too(folder):
    before = snapshot(folder)
    command = ("probe", "furnace", "--size", "8", "-o", "out.exr")
    assert struck(folder, signal.SIGINT, command)[0] == 130
    assert snapshot(folder) == before


def test_sigint_while_it_computes(folder):
    before = snapshot(folder)
    code = f"""
import signal, time, shrm_cli.maps.shrm.make
signal.signal(signal.SIGINT, signal.default_int_handler)
def prefilter_shrm(*_, **__):
    print("prefiltering", flush=True)
    time.sleep(20)
shrm_cli.maps.shrm.make.prefilter_shrm = prefilter_shrm
{MAIN}"""
    with start(*WRITE, code=code) as child:
        assert child.stdout.readline() == "prefiltering\n"
        child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=30)
    assert (child.returncode, out, err.strip()) == (130, "", "Error: interrupted")
    assert snapshot(folder) == before


def check_obeyed(result, number, out):
    """Check that a command ended as a signal asks, having printed some text before."""
    said = "interrupted" if number == signal.SIGINT else "stopped by SIGTERM"
    assert (result.code, result.out) == (128 + number, out)
    assert result.err.strip() == f"Error: {said}"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_in_callbacks_of_python_are_obeyed(folder, number):
    """Python drops exceptions that are raised while an object is freed."""
    before = snapshot(folder)
    code = f"""
import os, signal, time, weakref, shrm_cli.maps.shrm.make
signal.signal(signal.SIGINT, signal.default_int_handler)
def prefilter_shrm(*_, **__):
    freed = type("Freed", (), {{}})()
    kept = weakref.ref(freed, lambda _: os.kill(os.getpid(), {int(number)}))
    del freed
    print("survived", flush=True)
    time.sleep(0.1)
shrm_cli.maps.shrm.make.prefilter_shrm = prefilter_shrm
{MAIN}"""
    result = process(*WRITE, code=code)
    check_obeyed(result, number, "survived\n")
    assert snapshot(folder) == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_that_come_while_a_class_is_made_are_obeyed(folder, number):
    """Python 3.11 makes their exceptions causes of others."""
    before = snapshot(folder)
    code = f"""
import os, signal, time, shrm_cli.maps.shrm.make
signal.signal(signal.SIGINT, signal.default_int_handler)
class Field:
    def __set_name__(self, owner, name):
        os.kill(os.getpid(), {int(number)})
        time.sleep(0.1)
def prefilter_shrm(*_, **__):
    type("Made", (), {{"field": Field()}})
shrm_cli.maps.shrm.make.prefilter_shrm = prefilter_shrm
{MAIN}"""
    result = process(*WRITE, code=code)
    check_obeyed(result, number, "")
    assert snapshot(folder) == before


INTERRUPTED_AT_ITS_START = """
import os, signal, sys
if any("spawn_main" in word for word in sys.orig_argv):
    os.kill(os.getpid(), signal.SIGINT)
"""


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals are masked on POSIX")
def test_workers_that_still_load_do_not_hear_ctrl_c(folder):
    """A terminal sends it to each of them; only the command says that it was interrupted."""
    (folder / "sitecustomize.py").write_text(INTERRUPTED_AT_ITS_START)
    code = f"import os; os.environ['PYTHONPATH'] += os.pathsep + {str(folder)!r}; {MAIN}"
    command = ("batch", "probe.exr", "--to", "irradiance", "-o", "{probe}.made.exr")
    with start(*command, code=code, preexec_fn=listen) as child:
        out, err = child.communicate(timeout=60)
    assert (child.returncode, err) == (0, "")
    assert "1 output: 1 made" in out


def test_two_writers_leave_one_whole_file(folder):
    """Neither removes the other's temporary, and the last one wins."""
    sizes = (16, 32)
    children = [start("2", *WRITE, "--size", size, code=TOGETHER) for size in sizes]
    for child in children:
        with child:
            _, err = child.communicate(timeout=60)
            assert (child.returncode, err) == (0, "")
    names = [name for name in snapshot(folder) if not name.endswith(".seen")]
    assert sorted(names) == ["out.exr", "probe.exr"]
    size = read_exr("out.exr")[1]["sh000.R"].shape[1]
    assert size in sizes
    assert process(*WRITE[:-1], "alone.exr", "--size", size).code == 0
    assert (folder / "out.exr").read_bytes() == (folder / "alone.exr").read_bytes()


def test_a_running_writer_keeps_its_temporary(folder):
    """A run to the same target meets the half-written file of another, and leaves it alone."""
    with start(*WRITE, code=HALF_WRITTEN) as child:
        assert child.stdout.readline() == "half\n"
        assert run(*WRITE).code == 0
        assert len([name for name in os.listdir(folder) if ".shrm-" in name]) == 1
        whole = (folder / "out.exr").read_bytes()
        child.send_signal(signal.SIGINT)
        child.communicate(timeout=30)
    assert sorted(snapshot(folder)) == ["out.exr", "probe.exr"]
    assert (folder / "out.exr").read_bytes() == whole


# Says that a file is half written, of commands that write by other means than OpenEXR's.
SLOW_SYNC = f"""
import os, signal, time
signal.signal(signal.SIGINT, signal.default_int_handler)
def wait(number):
    print("half", flush=True)
    time.sleep(20)
os.fsync = wait
{MAIN}"""


@pytest.mark.proof
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("command", [
    ("export", "probe.exr", "--for", "json", "-o", "made"),
    ("sun", "probe.exr", "-o", "rest.exr", "--light-file", "sun.toml"),
    ("lookdev", "probe.exr", "--brdf", "lambertian", "--size", "16", "-o", "sheet.html"),
    ("view", "map.exr", "-o", "page.html"),
    ("contact", "map.exr", "-o", "page.html"),
    ("report", "probe.exr", "--brdf", "lambertian", "--picture-size", "16", "--no-flip",
     "--truth-height", "8", "--no-view", "--view", "0,0", "-o", "page.html"),
])  # fmt: skip
def test_pages_and_folders_appear_whole_or_not_at_all(tmp_path, monkeypatch, command, number):
    monkeypatch.chdir(tmp_path)
    write_exr("probe.exr", noise())
    if "map.exr" in command:
        run("prefilter", "probe.exr", "--to", "irradiance", "-o", "map.exr")
    before = sorted(tmp_path.rglob("*"))
    with start(*command, code=SLOW_SYNC) as child:
        assert child.stdout.readline() == "half\n"
        child.send_signal(number)
        _, err = child.communicate(timeout=30)
    assert child.returncode == 128 + number
    said = "stopped by SIGTERM" if number == signal.SIGTERM else "interrupted"
    assert err.strip().splitlines()[-1] == f"Error: {said}"
    assert sorted(tmp_path.rglob("*")) == before
