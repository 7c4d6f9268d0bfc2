"""Functions that run `shrm` in a test or as a process, and that make files without `shrm`."""

import contextlib
import hashlib
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO  # noqa: F401  (it notes in the environment where its font is; `run` keeps that)
import pytest

from shrm_cli.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
MAIN = "from shrm_cli.cli.main import main; main()"
WHOLE = "from shrm_cli.__main__ import main; main()"
"""What the installed command runs: it obeys Ctrl-C while the command line loads, too."""
NO_MODULES = "import sys; sys.dont_write_bytecode = True"
"""What a process does first whose files may be cut off: Python 3.11 would keep compiled modules
that are, and fail to import them ever after."""


UNPRIVILEGED = """
import ctypes, os
if os.geteuid() == 0:
    version, this_process = 0x20080522, 0
    ends = ctypes.CDLL(None).capset((ctypes.c_uint32 * 2)(version, this_process),
                                    (ctypes.c_uint32 * 6)())
    assert ends == 0
"""
"""Takes the capabilities from a process of root's, because permissions do not bind root. It stays
root's otherwise: the environment may lie in a folder that no other user can enter."""
MESH = "v 0 1 0\nv 1 0 1\nv -1 0 1\nv -1 0 -1\nv 1 0 -1\nf 1 3 2\nf 1 4 3\nf 1 5 4\nf 1 2 5\n"
"""A pyramid without its base, as OBJ."""
FAULTS = int(os.environ.get("FAULTS", "1"))
"""How many moments and places of a fault are tried; all that are asked for take an hour."""


@dataclass(frozen=True)
class Run:
    """The exit code, standard output and standard error of a command line."""

    code: int
    out: str
    err: str


class Terminal(io.StringIO):
    """A stream in memory that programs take for a terminal."""

    def isatty(self):
        return True


def told_to_bars(monkeypatch, command):
    """Return the amounts (done, in all) that a command will tell its progress bars."""
    seen = []

    class Bar:
        def __init__(self, label):
            assert label

        def __enter__(self):
            return lambda done, total: seen.append((done, total))

        def __exit__(self, *error):
            return None

    monkeypatch.setattr(f"shrm_cli.cli.{command}.progress_bar", Bar)
    return seen


def run(*arguments, terminal=False):
    """Run `shrm` in this process, and undo its changes to signals, warnings and the like."""
    out, err = io.StringIO(), Terminal() if terminal else io.StringIO()
    handlers = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    environment, hook = dict(os.environ), sys.unraisablehook
    try:
        with (
            warnings.catch_warnings(),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            main([str(argument) for argument in arguments])
    except SystemExit as stop:
        return Run(int(stop.code or 0), out.getvalue(), err.getvalue())
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        os.environ.clear()
        os.environ.update(environment)
        sys.unraisablehook = hook
    raise AssertionError("main() returned")


def environment():
    """Return the environment of a process that imports this checkout, not an installed shrm."""
    return {**os.environ, "PYTHONPATH": str(ROOT)}


def listen():
    """Obey Ctrl-C and SIGHUP, also where the tests run in the background or under nohup."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def start(*arguments, code=MAIN, **options):
    """Start `shrm`, or other code with its arguments, as a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def process(*arguments, code=MAIN):
    """Run `shrm`, or other code with its arguments, as a process of its own."""
    with start(*arguments, code=code) as child:
        # What hangs ends, but what is slow on a busy machine does not.
        out, err = child.communicate(timeout=600)
    return Run(child.returncode, out, err)


SEVERAL = """
import json, sys
from shrm_cli.cli.main import main
for words in json.loads(sys.argv[1]):
    try:
        main(words)
    except SystemExit as stop:
        print(end=f"{stop.code or 0}\\0", flush=True)
        print(end="\\0", file=sys.stderr, flush=True)
"""


def several(*commands):
    """Run command lines one after the other in a process of their own.

    What libraries print past Python is among what each has printed, and nothing is printed when the
    process ends, as they do of errors that nobody fetched.
    """
    words = [[str(word) for word in command] for command in commands]
    found = process(json.dumps(words), code=SEVERAL)
    assert found.code == 0, found.err
    *outs, out = found.out.split("\0")
    *errs, err = found.err.split("\0")
    assert (out, err, len(outs), len(errs)) == ("", "", len(commands), len(commands))
    parts = [re.fullmatch(r"(.*?)(\d+)", each, re.S) for each in outs]
    return [Run(int(part[2]), part[1], told) for part, told in zip(parts, errs, strict=True)]


WRONG_PICTURE = "of the picture is predicted to be wrong by more than 5 %"


def done(*arguments):
    """Run a command that must succeed without a warning, and return its standard output.

    An SHRM that is asked for by its tolerance is one whatever its picture is like, and a product
    texture by its order, so that the line about the picture does not count. Nor does what is said
    of coarse meshes.
    """
    result = run(*arguments)
    wrong = WRONG_PICTURE, "shows nothing sharper;", "between its vertices"
    told = [line for line in result.err.splitlines() if not any(each in line for each in wrong)]
    assert (result.code, told) == (0, [])
    return result.out


def assert_refused(result, code, *parts):
    """Check the exit code, one line on stderr that holds all parts, and nothing on stdout."""
    assert result.out == ""
    assert result.err.startswith("Error: ")
    assert result.err.count("\n") == 1
    assert result.err.endswith("\n")
    for part in parts:
        assert part in result.err
    for noise in ("Traceback", "internal error", "OpenImageIO", "0x", ".shrm-"):
        assert noise not in result.err
    assert result.code == code


def snapshot(folder):
    """Return every path below a folder, hidden ones too, with a digest of each file."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        if path.is_file()
        else ""
        for path in Path(folder).rglob("*")
    }


def write_package(site, name, group, points, code):
    """Make a package of one module with entry points importable, as an installer would."""
    write_information(site, name, {group: points})
    (site / f"{name}.py").write_text(code)


def write_information(site, name, groups):
    """Write what an installer notes of a package: its name, and entry points by their groups."""
    information = site / f"{name.replace('-', '_')}-1.0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = []
    for group, points in groups.items():
        lines += [f"[{group}]", *(f"{key} = {value}" for key, value in points.items())]
    (information / "entry_points.txt").write_text("\n".join(lines) + "\n")


def write_exr(path, pixels, **attributes):
    """Write an RGB EXR; the attributes override those of its header."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    channels = {c: np.ascontiguousarray(pixels[..., k]) for k, c in enumerate("RGB")}
    OpenEXR.File(header | attributes, channels).write(str(path))
    return path


def read_exr(path):
    """Return the header and the channels of an EXR, as OpenEXR reads them."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert len(file.parts) == 1
        header = {name: value for name, value in file.header().items() if name != "channels"}
        return header, {name: channel.pixels for name, channel in file.channels().items()}


def write_scene(folder):
    """Write probe.exr, lamp.exr, which has a lamp, and mesh.obj."""
    write_exr(folder / "probe.exr", noise(32, 64))
    with_lamp = noise(32, 64) / 10
    with_lamp[8, 20] = 2000
    write_exr(folder / "lamp.exr", with_lamp)
    (folder / "mesh.obj").write_text(MESH)


def noise(height=16, width=32):
    """Return random radiance, the same each time."""
    values = np.random.default_rng(7).uniform(0, 2, (height, width, 3))
    return values.astype(np.float32)


def polynomial_light(directions):
    """Return positive radiance of degree 3 that differs between channels and has no symmetry."""
    x, y, z = np.moveaxis(np.asarray(directions, dtype=float), -1, 0)
    red = 1.5 + 0.5 * x - 0.3 * y * z + 0.2 * x * z * z
    green = 2.0 + 0.7 * y + 0.4 * x * z - 0.3 * x * y * z
    blue = 1.0 - 0.3 * z + 0.2 * x * y + 0.3 * y * y * y
    return np.stack([red, green, blue], axis=-1)


@contextlib.contextmanager
def mounted(folder, options):
    """A file system in memory on a new folder, with options of `mount`, such as its size."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    if os.geteuid() != 0 or shutil.which("mount") is None:
        pytest.skip("only root can mount a file system")
    if subprocess.run(command, capture_output=True).returncode != 0:
        pytest.skip("this root may not mount a file system")
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)
