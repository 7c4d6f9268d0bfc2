"""Where the time of a whole `shrm prefilter` goes: starting, importing, each part of the work."""

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from statistics import median

from research.inputs import ROOT, say
from research.scale.clock import Seconds
from research.scale.parts import SPEC

_SHRM = "from shrm_cli.__main__ import main; main()"
_LIBRARIES = "import click, numpy, OpenEXR, OpenImageIO"
_REPORTED = "import time:"
# Without this variable, modules are compiled once and not by every process.
_ENVIRONMENT = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}


def whole_process(probe: Path, folder: Path, repeats: int) -> dict[str, Seconds]:
    """Time a whole `shrm prefilter`, its parts, and floors of some.

    Returns
    -------
    dict of str to dict of str to float
        Median processor seconds. Under ``whole`` of processes: the command, an empty Python, and
        one that imports the libraries. Under ``parts`` those of the command, where every part runs
        for the first time. Under ``imports`` the least seconds that modules took, by package.
    """
    work = ["prefilter", str(probe), "--brdf", SPEC, "--force", "--quiet"]
    work += ["-o", str(folder / "whole.exr")]
    commands = {
        "shrm prefilter": [sys.executable, "-c", _SHRM, *work],
        "an empty Python": [sys.executable, "-c", "pass"],
        "one that imports the libraries": [sys.executable, "-c", _LIBRARIES],
    }
    cold = [sys.executable, "-m", "research.scale.cold", str(folder / "modules.json"), *work]
    for command in (commands["shrm prefilter"], cold):  # fills caches, and the list of modules
        _seconds(command)
    say("whole processes")
    found: dict[str, list[float]] = {name: [] for name in commands}
    parts: list[Seconds] = []
    modules: dict[str, float] = {}
    for _ in range(repeats):
        for name, command in commands.items():
            found[name].append(_seconds(command))
        parts.append(json.loads(_run(cold).stdout))
        for name, seconds in _imports([sys.executable, "-X", "importtime", "-c", _SHRM, *work]):
            modules[name] = min(seconds, modules.get(name, seconds))
    packages: Counter[str] = Counter()
    for name, seconds in modules.items():
        package = name.partition(".")[0]
        packages["the standard library" if package in sys.stdlib_module_names else package] += (
            seconds
        )
    return {
        "whole": {name: median(each) for name, each in found.items()},
        "parts": {part: median(each.get(part, 0.0) for each in parts) for part in parts[0]},
        "imports": dict(packages.most_common()),
    }


def _seconds(command: list[str]) -> float:
    """Run a command, and return its processor seconds."""
    null = subprocess.DEVNULL
    process = subprocess.Popen(command, cwd=ROOT, env=_ENVIRONMENT, stdout=null, stderr=null)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return usage.ru_utime + usage.ru_stime


def _run(command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=ROOT, env=_ENVIRONMENT, check=True, capture_output=True, text=True
    )


def _imports(command: list[str]) -> list[tuple[str, float]]:
    """Return the seconds that each module takes itself, by Python's own account."""
    lines = (line for line in _run(command).stderr.splitlines() if line.startswith(_REPORTED))
    cells = (line.removeprefix(_REPORTED).split("|") for line in lines)
    return [(name.strip(), int(own) / 1e6) for own, _, name in cells if own.strip().isdecimal()]
