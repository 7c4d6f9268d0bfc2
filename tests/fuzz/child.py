"""Processes in which cases run: limits of time and address space, and a report on each case.

A process runs a batch of cases one after the other, because to fork one takes longer than most
cases. If a library crashes, or takes all memory or time, the process ends; the report that it owes
tells which case it was, and the rest of the batch goes to another process.
"""

import contextlib
import ctypes
import json
import os
import resource
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

WORKS = 60
"""The most processor time of a case, in the times of `work`: its input is tiny.

A coat that is a mirror, which ``brdf`` expands to order 430, takes 23. What was found here took a
thousand.
"""
MOST_SECONDS = 60
"""The processor time after which a process is ended, however slow the machine is."""
_WALL = 240
_ADDRESS_SPACE = 3 * 2**30  # what a case may map beyond what the harness has mapped already
_FILE = 2**28


@dataclass(frozen=True)
class Outcome:
    """How a command ended.

    Attributes
    ----------
    code : int
        The exit code, or minus the number of the signal that ended it.
    out, err : str
        What it printed.
    seconds : float
        Its processor time.
    works : float
        The same, in the times that `work` took after it; 0 where that was not asked.
    resident : int
        The most memory that it used, bytes.
    """

    code: int
    out: str = ""
    err: str = ""
    seconds: float = 0.0
    works: float = 0.0
    resident: int = 0


def work() -> float:
    """Do what takes a fixed amount of work, and return its processor time in seconds.

    Both kinds of work of commands are in it, that of numpy and that of the interpreter. What a case
    takes is told in its times, so that a slow or a busy machine does not make a finding.
    """
    image = np.linspace(0, 1, 90_000).reshape(300, 300)
    start = time.process_time()
    for step in range(60):
        float((np.sqrt(image + step) @ image).sum())
        sum(k * step % 7 for k in range(10_000))
    return time.process_time() - start


def run_batch(
    cases: Sequence[int], run: Callable[[int], dict[str, Any]], log: Path
) -> Iterator[tuple[int, dict[str, Any] | int]]:
    """Run cases in processes of their own.

    Parameters
    ----------
    cases : sequence of int
    run : callable
        Runs a case, and returns what is to be reported.
    log : Path
        The folder for what commands print.

    Yields
    ------
    case : int
    report : dict or int
        What `run` returned, or the code of the process that ended instead, as `Outcome` has it.
    """
    pending = list(cases)
    while pending:
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            _work(pending, run, writing, log)
        os.close(writing)
        with open(reading, encoding="utf-8") as stream:
            for line in _lines(stream, child):
                yield pending.pop(0), json.loads(line)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if pending:
            yield pending.pop(0), code


def _lines(stream: Any, child: int) -> Iterator[str]:
    """Lines from a process, which is ended if it is silent for too long."""
    waiting = select.poll()
    waiting.register(stream, select.POLLIN | select.POLLHUP)
    while True:
        if not waiting.poll(1000 * _WALL):
            os.kill(child, signal.SIGKILL)
        line = stream.readline()
        if not line.endswith("\n"):
            return
        yield line


def _work(
    cases: Sequence[int], run: Callable[[int], dict[str, Any]], writing: int, log: Path
) -> None:
    """In the child: run the cases, report on each, and end."""
    try:
        os.setsid()
        mapped = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        limits = {
            resource.RLIMIT_AS: mapped + _ADDRESS_SPACE,
            resource.RLIMIT_FSIZE: _FILE,
            resource.RLIMIT_CORE: 0,
        }
        for limit, most in limits.items():
            resource.setrlimit(limit, (most, most))
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        for number in cases:
            os.write(writing, json.dumps(run(number)).encode() + b"\n")
    except BaseException:
        import traceback

        (log / "harness").write_text(traceback.format_exc())
        os._exit(71)
    # As at the end of a process: libraries print what nobody asked them for.
    ctypes.CDLL(None).exit(0)


def run_command(arguments: list[str], folder: Path, log: Path) -> Outcome:
    """Run a command in a folder, within this process; what it prints goes to files in `log`."""
    os.chdir(folder)
    before = resource.getrusage(resource.RUSAGE_SELF)
    start = before.ru_utime + before.ru_stime
    most = int(start) + MOST_SECONDS + 1
    resource.setrlimit(resource.RLIMIT_CPU, (most, resource.RLIM_INFINITY))
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")  # the largest memory is counted anew
    for number, name in ((1, "out"), (2, "err")):
        target = os.open(log / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(target, number)
        os.close(target)
    code = _called(arguments)
    after = resource.getrusage(resource.RUSAGE_SELF)
    texts = [(log / name).read_bytes().decode("utf-8", "replace") for name in ("out", "err")]
    seconds = after.ru_utime + after.ru_stime - start
    resident = _largest_memory()
    # Only what took long is worth the time.
    works = seconds / work() if seconds > 1 else 0.0
    return Outcome(code, *texts, seconds, works, resident)


def _called(arguments: list[str]) -> int:
    """Call the command with streams as those of a process, and return its exit code."""
    from shrm_cli.cli.main import main

    kept = sys.stdout, sys.stderr
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
    code = 0
    try:
        main(arguments)
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    except BaseException as error:
        code = 70
        print("Traceback beyond main:", type(error).__name__, ascii(error), file=sys.stderr)
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(Exception):
                stream.flush()
        sys.stdout, sys.stderr = kept
    return code


def _largest_memory() -> int:
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmHWM:")[1].split()[0])


def as_report(outcome: Outcome) -> dict[str, Any]:
    """Return an outcome as what JSON holds."""
    return asdict(outcome)
