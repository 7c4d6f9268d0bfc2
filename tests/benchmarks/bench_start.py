"""Times of whole short runs, with the package's bytecode and where Python keeps none.

Both ways are compared with a process that no tool in Python can go below, and with the last
release, so that a start that gets slower is seen. The package is copied for it, because what lies
beside a checkout's modules decides what Python compiles.
"""

import compileall
import io
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenEXR

from tests.archives import unpack
from tests.benchmarks.bench_process import _FLOOR, _SHRM, _write_probe
from tests.benchmarks.table import Row, measure

_ROOT = Path(__file__).resolve().parents[2]
_BASE = "43a128f"
"""The commit that stands for the last release until there is one."""
_MADE = "microfacet:sigma=0.1"
_BARS = {"bytecode": 1.25, "no bytecode": 1.6}
"""The two ways, and how many times as long as the floor a run may take."""
_PAIRS = 15


def rows() -> Iterator[Row]:
    """Yield the rows of the table that are about the start of a run."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        probe = folder / "probe.exr"
        _write_probe(probe, 1024, np.float32)
        here = _copies(_ROOT / "shrm_cli", folder / "here")
        run = {way: _Run(tree, way, probe) for way, tree in here.items()}
        planes = _planes(run["bytecode"], folder / "planes.npy")
        for way, bar in _BARS.items():
            yield _floor_row(run[way], way, bar, probe, planes)
        before = last_release(folder / "release")
        if before is None:
            return
        revision, source = before
        for way, tree in _copies(source, folder / "before").items():
            then = _Run(tree, way, probe)
            yield measure(
                f"the same, {way}, against {revision}",
                run[way], then, note=f"the same run by the sources of {revision}", pairs=_PAIRS,
            )  # fmt: skip


class _Run:
    """A whole `shrm prefilter` by one copy of the package."""

    def __init__(self, tree: Path, way: str, probe: Path) -> None:
        self.target = tree / "map.exr"
        self.command = [*_SHRM, "prefilter", str(probe), "--brdf", _MADE, "--eps", "0.03"]
        self.command += ["-o", str(self.target)]
        self.tree, self.environment = tree, _environment(way, tree)

    def __call__(self) -> None:
        # In a checkout's own folder Python would find its modules before those of the copy.
        subprocess.run(
            self.command, check=True, cwd=self.tree, env=self.environment,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,  # it warns of the picture
        )  # fmt: skip


def _environment(way: str, tree: Path) -> dict[str, str]:
    kept = {name: text for name, text in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    kept |= {"PYTHONPATH": str(tree), "SHRM_CACHE_DIR": str(tree / "cache")}
    return kept if way == "bytecode" else {**kept, "PYTHONDONTWRITEBYTECODE": "1"}


def _copies(source: Path, folder: Path) -> dict[str, Path]:
    """Copy a package once for each way, and compile one of the copies."""
    found = {}
    for way in _BARS:
        tree = found[way] = folder / way.replace(" ", "-")
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(source, tree / "shrm_cli", ignore=ignored)
        if way == "bytecode":
            compileall.compile_dir(tree, quiet=1)
    return found


def _planes(run: _Run, path: Path) -> Path:
    """Write the arrays that a run writes, for the floor to write them again."""
    run()
    with OpenEXR.File(str(run.target), separate_channels=True) as file:
        channels = file.channels()
        np.save(path, np.stack([channels[name].pixels for name in sorted(channels)]))
    return path


def _floor_row(run: _Run, way: str, bar: float, probe: Path, planes: Path) -> Row:
    command = [sys.executable, "-c", _FLOOR, str(probe), str(planes), str(run.tree / "floor.exr")]

    def floor() -> None:
        subprocess.run(command, check=True, cwd=run.tree, env=run.environment)

    return measure(
        f"whole shrm prefilter 1024x512 {_MADE} --eps 0.03, {way}",
        run, floor, bar=bar, pairs=_PAIRS,
        note="a process that imports the same, reads the probe, writes the arrays",
    )  # fmt: skip


def last_release(folder: Path, root: Path = _ROOT) -> tuple[str, Path] | None:
    """Get the sources of the newest release before this commit, else of a named commit.

    Parameters
    ----------
    folder : Path
        Where they are put.
    root : Path
        The checkout.

    Returns
    -------
    revision : str
    source : Path
        The folder of the package. None where git or the commit is missing, which is told.
    """
    before = ["tag", "--list", "v*", "--merged", "HEAD", "--no-contains", "HEAD"]
    try:
        tags = _git(root, *before, "--sort=-version:refname").decode().split()
        revision = tags[0] if tags else _BASE
        archive = _git(root, "archive", "--format=tar", revision, "shrm_cli")
    except (OSError, subprocess.CalledProcessError):
        print(
            f"bench: no comparison with the last release: git, a tag v* or the commit {_BASE} is "
            "missing here (git fetch --unshallow --tags brings them)",
            file=sys.stderr,
        )
        return None
    with tarfile.open(fileobj=io.BytesIO(archive)) as packed:
        unpack(packed, folder)
    return revision, folder / "shrm_cli"


def _git(root: Path, *arguments: str) -> bytes:
    return subprocess.run(
        ["git", "-C", str(root), *arguments], check=True, capture_output=True
    ).stdout
