"""Times of whole processes, compared with a floor that no such tool can go below.

The floor is a process that imports the same libraries, and reads and writes the same files.
"""

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR

from shrm_cli.prefilter import prefilter
from tests.benchmarks.table import Row, measure

_SHRM = [sys.executable, "-c", "from shrm_cli.__main__ import main; main()"]

# Any tool in Python with these libraries must do this: start, read the probe, write the arrays.
_FLOOR = """
import sys
import numpy as np, OpenImageIO as oiio, OpenEXR, click, tqdm
source = oiio.ImageInput.open(sys.argv[1])
pixels = source.read_image(0, 0, 0, 3, oiio.FLOAT)
planes = np.load(sys.argv[2])
names = [f"sh{k // 3:03d}.{'RGB'[k % 3]}" for k in range(len(planes))]
header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
OpenEXR.File(header, dict(zip(names, planes))).write(sys.argv[3])
"""
_CLICK = """
import click
@click.group()
def cli(): pass
cli(["--help"])
"""


def rows() -> Iterator[Row]:
    """Yield the rows of the table that are about whole processes."""
    with tempfile.TemporaryDirectory() as folder:
        yield from _prefilter_rows(Path(folder))
        yield _library_row(Path(folder))
        yield _exponential_row(Path(folder))
        yield _help_row()
        yield _memory_row(Path(folder))


def _prefilter_rows(folder: Path) -> Iterator[Row]:
    probe = folder / "probe.exr"
    _write_probe(probe, 1024, np.float32)
    cases = (
        ("phong:exponent=32 --to shrm", 1.5, 15),
        ("lambertian --to shrm", 1.5, 15),
        ("microfacet --to principal --eps 0.03", 2.0, 15),
        ("ggx:roughness=0.4 --to shrm", None, 3),
        ("ggx:roughness=0.1 --to shrm", None, 3),
        ("ggx:roughness=0.4 --to shrm --no-cache", None, 3),
        ("ggx:roughness=0.1 --to shrm --no-cache", None, 3),
        ("ggx:roughness=0.4", None, 3),
        ("ggx:roughness=0.4 --no-cache", None, 3),
    )
    for made, bar, pairs in cases:
        target, planes = folder / "map.exr", folder / "planes.npy"
        ours = [*_SHRM, "prefilter", str(probe), "--brdf", *made.split(), "-o", str(target)]
        ours += ["--quiet"]
        _run(ours)
        channels = OpenEXR.File(str(target), separate_channels=True).channels()
        np.save(planes, np.stack([channels[name].pixels for name in sorted(channels)]))
        floor = [sys.executable, "-c", _FLOOR, str(probe), str(planes), str(folder / "floor.exr")]
        yield measure(
            f"shrm prefilter 1024x512 {made}",
            lambda ours=ours: _run(ours),
            lambda floor=floor: _run(floor),
            bar=bar,
            note="against a process that imports the same, reads the probe, writes the arrays",
            pairs=pairs,
        )


def _library_row(folder: Path) -> Row:
    """Time what a program that makes many maps sees of each, beside a command for it."""
    probe = folder / "small.exr"
    _write_probe(probe, 512, np.float32)
    brdf = "phong:exponent=32"
    command = [*_SHRM, "prefilter", str(probe), "--brdf", brdf, "--to", "shrm"]
    command += ["-o", str(folder / "one.exr")]
    return measure(
        f"shrm_cli.prefilter 512x256 {brdf}",
        lambda: prefilter(str(probe), brdf, to="shrm"),
        lambda: _run([*command, "--quiet"]),
        note="the map in memory; against a whole command that writes it",
        pairs=15,
    )


# This floor writes nothing, because an SH exponential has a few hundred bytes.
_READ = "\n".join(_FLOOR.splitlines()[:5])
_FIT = 50.0
"""Milliseconds that the fit of an SH exponential may take beyond 1.5 times the floor."""


def _exponential_row(folder: Path) -> Row:
    """Time one fit from the command line; the bar is 1.5 times the floor plus 50 ms."""
    probe = folder / "probe.exr"
    _write_probe(probe, 1024, np.float32)
    ours = [*_SHRM, "prefilter", str(probe), "--to", "she", "-o", str(folder / "she.exr")]
    found = measure(
        "shrm prefilter 1024x512 --to she",
        lambda: _run([*ours, "--quiet"]),
        lambda: _run([sys.executable, "-c", _READ, str(probe)]),
        note="against a process that imports the same and reads the probe; the bar is 50 ms more",
        pairs=15,
    )
    return replace(found, bar=1.5 + _FIT / found.reference)


def _help_row() -> Row:
    return measure(
        "shrm --help",
        lambda: _run([*_SHRM, "--help"]),
        lambda: _run([sys.executable, "-c", _CLICK]),
        bar=2.0,
        note="against a process that imports click and prints help",
        pairs=15,
    )


def _memory_row(folder: Path) -> Row:
    """Measure peak memory; the row holds MB in place of milliseconds."""
    probe = folder / "large.exr"
    # The probe is written by another process, whose memory is not counted as ours.
    writer = (
        "import sys; from tests.benchmarks.bench_process import _write_probe; import numpy as np;"
        "_write_probe(sys.argv[1], 8192, np.float16)"
    )
    _run([sys.executable, "-c", writer, str(probe)])
    peak = _peak([*_SHRM, "prefilter", str(probe), "--brdf", "microfacet", "-o",
                  str(folder / "large.shrm.exr"), "--quiet"])  # fmt: skip
    return Row(
        "peak memory at 8192x4096 (MB)", peak, 400.0, peak / 400.0, 1.0, "MB; the limit is 400"
    )


def _write_probe(path: Path | str, width: int, dtype: type) -> None:
    """Write a probe with structure and a sun."""
    height = width // 2
    rng = np.random.default_rng(0)
    x = np.linspace(0, 2 * np.pi, width, dtype=np.float32)
    y = np.linspace(0, np.pi, height, dtype=np.float32)[:, None]
    grain = rng.random((height, 1), dtype=np.float32)
    channels = {}
    for k, name in enumerate("RGB"):
        plane = (1 + np.sin(3 * x + k) * np.sin(y)) * (0.5 + grain)
        plane[height // 4, width // 3] = 30000
        channels[name] = plane.astype(dtype)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))


def _run(command: list[str]) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


_PEAK = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


def _peak(command: list[str]) -> float:
    """Measure the largest resident size of a process, MB.

    The process is started by a small one, because Linux counts the memory that the parent has at
    the start as well.
    """
    started = [sys.executable, "-c", _PEAK, *command]
    return int(subprocess.run(started, check=True, capture_output=True).stdout) / 1024
