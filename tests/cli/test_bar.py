"""Bars on a terminal of their own: seen soon, moving while nothing is reported, and gone after."""

import os
import pty
import subprocess
import sys
import time
from pathlib import Path

import pytest

from shrm_cli.cli import terminal
from shrm_cli.cli.bar import progress_bar
from shrm_cli.cli.terminal import announce
from shrm_cli.progress import report
from tests.cli.helpers import Terminal, environment, run, told_to_bars

PROBE = str(Path(__file__).parents[2] / "probes" / "sky.exr")
WORK = """
import sys, time
from shrm_cli.cli.terminal import progress_bar
from shrm_cli.files.openimageio import caught, last_noise
with progress_bar("working") as progress:
    {work}
sys.stderr.write(f"over; {{last_noise()}}")
"""


WORKS = {
    "long": "time.sleep(2.4)",
    "reported": "progress(1, 4); time.sleep(1.6); progress(2, 4); time.sleep(0.6)",
    "short": "progress(1, 2)",
    "caught": "progress(1, 2)\n    with caught(): time.sleep(2)",
    "interrupted": "time.sleep(1.6); raise SystemExit(3)",
}


@pytest.fixture(scope="module")
def on_a_terminal():
    """What a process prints to a terminal while it works under a bar, and its exit code.

    They mostly wait, and so they do it at the same time.
    """
    started = {name: started_on_a_terminal(work) for name, work in WORKS.items()}
    return {name: ended(*each) for name, each in started.items()}


def started_on_a_terminal(work):
    master, slave = pty.openpty()
    code = WORK.format(work=work)
    try:
        child = subprocess.Popen([sys.executable, "-c", code], stderr=slave, env=environment())
    finally:
        os.close(slave)
    return child, master


def ended(child, master):
    printed = b""
    with child, open(master, "rb", buffering=0) as stream:
        while True:
            try:
                block = stream.read(2**12)
            except OSError:  # Linux: nobody has the other end open any more
                break
            if not block:
                break
            printed += block
    return printed.decode(), child.returncode


def drawn(printed):
    """Each drawing of the bar, and what is printed after it is gone."""
    *bars, rest = printed.split("\r")
    return [bar for bar in bars if bar.strip()], rest


def test_a_bar_moves_while_nothing_is_reported(on_a_terminal):
    """A long step is told from a process that hangs."""
    printed, code = on_a_terminal["long"]
    bars, rest = drawn(printed)
    assert (code, rest) == (0, "over; ")
    assert len(bars) >= 3
    assert bars[0].startswith("working:   0%|")
    assert len({bar.partition("| ")[2] for bar in bars}) > 1  # the time


def test_a_bar_tells_what_is_reported_and_how_long_is_left(on_a_terminal):
    printed, _ = on_a_terminal["reported"]
    shares = [bar.partition("%")[0] for bar in drawn(printed)[0]]
    assert shares == sorted(shares)
    assert {shares[0], shares[-1]} == {"working:  25", "working:  50"}
    assert drawn(printed)[0][-1].rpartition("<")[2].startswith("00:0")


def test_work_of_no_time_has_no_bar(on_a_terminal):
    assert on_a_terminal["short"] == ("over; ", 0)


def test_a_bar_is_no_noise_of_a_library(on_a_terminal):
    """It is seen while an image library reads, and not taken for what the library says."""
    bars, rest = drawn(on_a_terminal["caught"][0])
    assert rest == "over; "
    assert len(bars) >= 2


def test_an_interrupted_bar_is_gone(on_a_terminal):
    bars, rest = drawn(on_a_terminal["interrupted"][0])
    assert bars
    assert rest == ""


GGX = ("ggx:roughness=0.7", "--eps", "0.03", "--eps", "0.01")


@pytest.mark.parametrize(
    "command",
    [
        ("brdf", *GGX),
        ("analyze", "--no-plots", "--brdf", *GGX),
        ("sun", PROBE),
        ("prefilter", PROBE, "--to", "splitsum", "--size", "32"),
        ("prefilter", PROBE, "--brdf", "phong:exponent=32", "--to", "shrm", "--sun", "split"),
        ("export", PROBE, "--for", "filament", "--size", "32"),
    ],
    ids=lambda command: command[0],
)
def test_bars_never_fall(monkeypatch, tmp_path, command):
    """Though orders take several attempts, and levels and lamps are made one after the other,
    each of which reports all of itself.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SHRM_CACHE_DIR", str(tmp_path))
    told = told_to_bars(monkeypatch, command[0])
    assert run(*command).code == 0
    shares = [done / total for done, total in told]
    assert len(shares) > 5
    assert shares == sorted(shares)


def test_what_is_announced_commands_no_terminal(monkeypatch):
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    announce(["\x1b]0;pwned\x07.exr: 2 pictures"])
    assert stream.getvalue() == "\\x1b]0;pwned\\x07.exr: 2 pictures\n"
    monkeypatch.setattr(sys, "stderr", None)
    announce(["nobody sees it"])


def test_the_bar_of_scripts_shows_what_it_is_told_and_what_is_reported(capsys):
    with progress_bar("lacquer") as progress:
        time.sleep(0.12)  # it is not drawn more than ten times a second
        progress(1, 4)
        time.sleep(0.12)
        report(3, 4)
    printed = capsys.readouterr().err
    assert "lacquer:  25%" in printed
    assert "lacquer:  75%" in printed


def test_logs_tell_of_long_work(monkeypatch, capsys):
    """Polished metals took minutes, in which nothing was said where stderr is no terminal."""
    now = 0.0
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now)
    with terminal.progress_bar("comparing") as progress:
        for now in range(0, 121, 7):
            progress(min(now, 35) if now < 100 else now, 120)
        now = 180
        progress(999, 1000)
    assert capsys.readouterr().err.splitlines() == [
        "comparing: 29% after 35 s, about 85 s left",
        "comparing: 29% after 70 s",
        "comparing: 87% after 2 min, about 15 s left",
        "comparing: 99% after 3 min",
    ]


def test_logs_tell_of_steps_that_report_nothing(monkeypatch, capsys):
    """A search for principal functions took a minute in which nothing was said."""
    monkeypatch.setattr(terminal, "_LONG_SILENCE", 0.05)

    def is_said(words):
        said, end = "", time.monotonic() + 60
        while words not in said and time.monotonic() < end:
            time.sleep(0.02)
            said += capsys.readouterr().err
        return words in said

    with terminal.progress_bar("prefiltering") as progress:
        assert is_said("prefiltering: 0% after ")
        progress(3, 4)
        capsys.readouterr()
        assert is_said("prefiltering: 75% after ")
