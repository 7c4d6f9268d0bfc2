"""Throughput of `shrm batch`, compared with floors that no such program can go below.

The floor of a batch is the same pool of processes, which reads the same probes and writes the same
files, without any mathematics. ``BENCH_PROBES`` in the environment says how many probes are taken.
"""

import functools
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from multiprocessing import active_children
from pathlib import Path
from statistics import median

import numpy as np
import OpenEXR
import OpenImageIO as oiio

from shrm_cli.batch.batch import ProcessWorkers
from shrm_cli.batch.entry import Entry
from shrm_cli.batch.job import by_probe
from shrm_cli.batch.run import run
from shrm_cli.batch.work import Terms
from shrm_cli.files.whole import replacing
from tests.benchmarks.bench_process import _SHRM, _run, _write_probe
from tests.benchmarks.table import Row

COUNT = int(os.environ.get("BENCH_PROBES", "1000"))
BRDF = "microfacet:sigma=0.2"
WORKERS = 2
_DIFFERENT = 25
"""Different probes, which are copied under other names to make them many."""
_ROOT = Path(__file__).resolve().parents[2]
_OUTPUTS = [
    *(("shrm", f"microfacet:sigma={sigma}") for sigma in (0.15, 0.2, 0.25, 0.3, 0.4, 0.5)),
    *(("shrm", f"phong:exponent={n}") for n in (8, 16, 32, 64, 128)),
    *(("principal", f"microfacet:sigma={sigma}") for sigma in (0.2, 0.3, 0.4, 0.5)),
    *(("cabral", f"phong:exponent={n}") for n in (8, 16)),
    ("shrm", "lambertian"), ("irradiance", None), ("she", None),
]  # fmt: skip
"""Twenty outputs of one probe."""


_ALONE = """
import sys, time
from shrm_cli import settings
from shrm_cli.maps.stored import store
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.shared import shared
probe, to, brdf, target = sys.argv[1:]
light = shared(open_probe(probe))
light.image()
start = time.perf_counter()
with settings.using(threads=1):
    store(target, prefilter_with_facts(light, to, {"brdf": brdf or None}).map)
print(time.perf_counter() - start)
"""
"""The mathematics and the writing of a single output, in a process that makes nothing else."""


def rows() -> Iterator[Row]:
    """Yield the rows of the table that are about batches."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_probes(folder)
        throughput, memory = _throughput(folder)
        yield throughput
        yield memory
        yield _make_row(folder)
        yield _outputs_row(folder)


def _write_probes(folder: Path) -> None:
    """Write probes of 256 x 128 half floats, each under a name of its own."""
    (folder / "p").mkdir()
    rng = np.random.default_rng(3)
    y = np.linspace(0, np.pi, 128, dtype=np.float32)[:, None]
    x = np.linspace(0, 2 * np.pi, 256, dtype=np.float32)
    for k in range(_DIFFERENT):
        turn = rng.uniform(0, 2 * np.pi)
        sky = 1 + np.sin(3 * x + turn) * np.sin(y) + 0.3 * rng.random((128, 256))
        sky[20 + k, 7 * k] = 3000.0
        channels = {name: (sky * (1 - 0.2 * c)).astype(np.float16) for c, name in enumerate("RGB")}
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, channels).write(str(folder / f"p/{k:05d}.exr"))
    for k in range(_DIFFERENT, COUNT):
        data = (folder / f"p/{k % _DIFFERENT:05d}.exr").read_bytes()
        (folder / f"p/{k:05d}.exr").write_bytes(data)


def _throughput(folder: Path) -> tuple[Row, Row]:
    """Time a batch and its floor, both with a pool that is warm, in turn and twice."""
    entry = Entry((f"{folder}/p/*.exr",), (BRDF,), ("shrm",), f"{folder}/out/{{probe}}.exr")
    chunks = by_probe(entry.jobs())
    sizes: dict[int, float] = {}
    ours, floors = [], []
    for _ in range(2):
        pool = ProcessWorkers(WORKERS)
        run(chunks[: 2 * _DIFFERENT], pool, Terms(force=True), lambda result: None)
        told = 0

        def tell(result: object) -> None:
            nonlocal told
            told += 1
            if told in (50, COUNT):
                sizes[told] = max(sizes.get(told, 0.0), _resident_mb())

        start = time.perf_counter()
        run(chunks, pool, Terms(force=True), tell)
        ours.append(time.perf_counter() - start)
        pool.stop()
        floors.append(_floor(folder))
    ratio = median(a / b for a, b in zip(ours, floors, strict=True))
    note = f"{COUNT} probes of 256x128, {WORKERS} processes; the floor reads and writes the same"
    first, last = sizes[min(50, COUNT)], sizes[COUNT]
    return (
        Row(f"shrm batch {BRDF}, {COUNT} probes", min(ours) * 1e3, min(floors) * 1e3, ratio,
            1 / 0.6, note),
        Row(f"memory of its processes at job {COUNT} (MB)", last, first, last / first, 1.1,
            "MB; against those at job 50"),
    )  # fmt: skip


def _floor(folder: Path) -> float:
    """Time a pool that reads the probes and writes the maps that a batch has made of them."""
    pool = ProcessWorkers(WORKERS)
    names = sorted(path.name for path in (folder / "p").iterdir())
    (folder / "floor").mkdir(exist_ok=True)
    warm = [pool.submit(_copied, folder, name) for name in names[: 2 * _DIFFERENT]]
    wait(warm)
    start = time.perf_counter()
    waiting: set[object] = set()
    for name in names:
        waiting.add(pool.submit(_copied, folder, name))
        if len(waiting) >= 2 * WORKERS:
            _, waiting = wait(waiting, return_when="FIRST_COMPLETED")  # type: ignore[arg-type,assignment]
    wait(waiting)  # type: ignore[arg-type]
    elapsed = time.perf_counter() - start
    pool.stop()
    return elapsed


def _copied(folder: Path, name: str) -> None:
    """Read a probe, and write the map that was made of one with the same pixels."""
    source = oiio.ImageInput.open(str(folder / "p" / name))
    source.read_image(0, 0, 0, 3, oiio.HALF)
    header, channels = _made(folder, f"{int(name[:5]) % _DIFFERENT:05d}.exr")
    with replacing(folder / "floor" / name) as temporary:
        OpenEXR.File(header, channels).write(str(temporary))


@functools.cache
def _made(folder: Path, name: str) -> tuple[dict[str, object], dict[str, object]]:
    """Return the header and the channels of a map; they stay in memory."""
    file = OpenEXR.File(str(folder / "out" / name), separate_channels=True)
    header = {key: value for key, value in file.header().items() if key != "channels"}
    return header, {key: channel.pixels.copy() for key, channel in file.channels().items()}


def _resident_mb() -> float:
    """Return the memory of all workers, MB."""
    pages = 0
    for child in active_children():
        pages += int(Path(f"/proc/{child.pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def _make_row(folder: Path) -> Row:
    """Compare the time of a map with that of two processes for each, which draw a picture, too."""
    count = 12
    probes = sorted((folder / "p").iterdir())[:count]

    def make(probe: Path) -> None:
        target = folder / f"{probe.stem}.exr"
        _run([*_SHRM, "prefilter", str(probe), "--brdf", BRDF, "-o", str(target), "--quiet"])
        _run([*_SHRM, "render", str(target), "-o", f"{target}.png", "--quiet"])

    start = time.perf_counter()
    with ThreadPoolExecutor(WORKERS) as pool:
        list(pool.map(make, probes))
    theirs = (time.perf_counter() - start) / count
    many = [str(path) for path in sorted((folder / "p").iterdir())]
    (folder / "list.toml").write_text(
        f"probes = {many!r}\nbrdfs = ['{BRDF}']\noutput = '{folder}/cli/{{probe}}.exr'\n"
    )
    start = time.perf_counter()
    _run([*_SHRM, "batch", str(folder / "list.toml"), "--jobs", str(WORKERS), "--log",
          str(folder / "log.jsonl"), "--quiet"])  # fmt: skip
    ours = (time.perf_counter() - start) / COUNT
    return Row(
        "shrm batch, whole process, per map", ours * 1e3, theirs * 1e3, ours / theirs, 1 / 8,
        "against `shrm prefilter` and `shrm render` of each",
    )  # fmt: skip


def _outputs_row(folder: Path) -> Row:
    """Compare twenty outputs of one probe with their mathematics and writing on all processors."""
    probe = folder / "large.exr"
    _write_probe(probe, 1024, np.float32)
    forms = [
        f"[[entry]]\nto = '{to}'\n" + (f"brdfs = ['{brdf}']\n" if brdf else "")
        for to, brdf in _OUTPUTS
    ]
    manifest = folder / "outputs.toml"
    manifest.write_text(
        f"probes = ['{probe}']\noutput = '{folder}/many/{{brdf}}.{{to}}.exr'\n" + "\n".join(forms)
    )
    command = [*_SHRM, "batch", str(manifest), "--jobs", str(WORKERS), "--force", "--quiet",
               "--log", str(folder / "log.jsonl")]  # fmt: skip
    _run(command)  # the coefficients of BRDFs are in the cache now
    start = time.perf_counter()
    _run(command)
    ours = time.perf_counter() - start
    alone = [
        subprocess.run(
            [sys.executable, "-c", _ALONE, str(probe), to, brdf or "", str(folder / "one.exr")],
            check=True, capture_output=True,
        ).stdout
        for to, brdf in _OUTPUTS
    ]  # fmt: skip
    floor = sum(map(float, alone)) / WORKERS
    return Row(
        f"one probe of 1024x512 to {len(_OUTPUTS)} outputs", ours * 1e3, floor * 1e3, ours / floor,
        3.0, "whole process; against mathematics and writing alone, divided by the processes",
    )  # fmt: skip
