"""The page on what batches take, as Markdown; `docs/scale.md` takes its tables from it."""

from collections.abc import Sequence

from research.page import table
from research.scale.clock import PARTS, Seconds
from research.scale.forecast import (
    Farm,
    Load,
    cores_of_disk,
    cores_of_scheduler,
    forecast,
    task_seconds,
)
from research.scale.model import PowerLaw, Sum
from research.scale.parts import Measured
from research.scale.scheduler import Handed
from shrm_cli.batch import run

PROBES = 10_000, 1_000_000
CORES = 1, 16, 1000
DISKS = (100e6, "100 MB/s"), (1e9, "1 GB/s"), (10e9, "10 GB/s")
"""What a shared disk gives to all cores together: a small server, ten-gigabit Ethernet, a cluster's
file system."""
_POOL = 16
"""The most cores of one machine, which needs no scheduler."""
BUSY = 0.25
"""The share of its time that a scheduler may be busy with tasks, so that none waits for it."""
_UNITS = (86_400, "d"), (3600, "h"), (60, "min"), (1, "s")
_SIZES = (1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB")


def duration(seconds: float) -> str:
    """Write seconds in the unit that suits them."""
    size, unit = next((each for each in _UNITS if seconds >= 1.5 * each[0]), _UNITS[-1])
    return (
        f"{seconds / size:.2g} {unit}" if seconds < 100 * size else f"{seconds / size:.0f} {unit}"
    )


def amount(count: float) -> str:
    """Write bytes in the unit that suits them."""
    size, unit = next((each for each in _SIZES if count >= each[0]), (1, "bytes"))
    return f"{count / size:.3g} {unit}"


def introduction(machine: str, remark: str) -> str:
    """Write the title, and what the page is."""
    return f"""# What prefiltering costs

`python -m research FOLDER --scale` wrote this page. {machine}
Times of parts are processor seconds of one warm process with one thread, medians.
{remark}"""


def forms(rows: Sequence[Measured]) -> str:
    """Write what each form takes, part by part."""
    head = ("form", "probe", "F, P", "S", *PARTS, "in all (ms)", "probe", "map")
    body = [
        (
            row.label, f"{2 * row.case.rows} x {row.case.rows}",
            f"{row.case.order_f}, {row.case.order_p}", f"{row.case.size}",
            *(f"{1e3 * row.seconds[part]:.1f}" for part in PARTS), f"{1e3 * row.total:.0f}",
            amount(row.read), amount(row.written),
        )
        for row in rows
    ]  # fmt: skip
    return f"\n## Parts of a prefilter (ms)\n\n{table(head, body)}"


def powers(laws: dict[str, tuple[tuple[str, ...], PowerLaw]]) -> str:
    """Write the exponents that were fitted, beside those of the thesis."""
    body = [
        (
            name, " ".join(f"{q}^{x:.2f}" for q, x in zip(names, law.exponents, strict=True)),
            f"{law.spread:.0%}",
        )
        for name, (names, law) in laws.items()
    ]  # fmt: skip
    return f"""
## Exponents

{table(("part", "fitted by one power law", "RMS residual"), body)}"""


def sums(laws: dict[str, Sum]) -> str:
    """Write the cost model that was fitted."""
    body = [
        (
            part, " + ".join(
                f"{1e9 * factor:.3g}" + ("" if name == "1" else f" {name}")
                for name, factor in law.factors.items()
            ), f"{law.spread:.0%}",
        )
        for part, law in laws.items()
    ]  # fmt: skip
    return f"\n## Cost model (ns)\n\n{table(('part', 'nanoseconds', 'RMS residual'), body)}"


def forecasts(loads: Sequence[Load], task: float) -> str:
    """Write how long batches take, and what limits them.

    Parameters
    ----------
    loads : sequence of Load
    task : float
        Seconds of the scheduler for each task.
    """
    parts = ["\n## Batches\n"]
    head = (
        "each map",
        "probes",
        "read",
        "written",
        *(f"{c} cores" if c > 1 else "1 core" for c in CORES),
    )
    body = []
    for load in loads:
        for probes in PROBES:
            cells = []
            for cores in CORES:
                found = forecast(load, probes, _farm(load, probes, cores, DISKS[1][0], task))
                cells.append(f"{duration(found.seconds)} ({found.limit})")
            size = amount(probes * load.read), amount(probes * load.written)
            body.append((load.label, f"{probes:,}", *size, *cells))
    parts.append(
        f"A shared disk of {DISKS[1][1]}. In brackets what is the limit.\n\n{table(head, body)}"
    )
    head = (
        "each map", "reading", "mathematics", "packing (ms)", "bytes",
        *(f"cores that use up {name}" for _, name in DISKS), "probes a task",
        "cores that use up a scheduler",
    )  # fmt: skip
    rows = []
    for load in loads:
        farm = _farm(load, PROBES[-1], CORES[-1], DISKS[1][0], task)
        shares = (f"{1e3 * x:.0f}" for x in (load.reading, load.mathematics, load.packing))
        disks = (f"{cores_of_disk(load, disk):.0f}" for disk, _ in DISKS)
        most = cores_of_scheduler(load.seconds * farm.group, task)
        rows.append(
            (load.label, *shares, amount(load.bytes), *disks, f"{farm.group}", f"{most:.0f}")
        )
    parts.append(table(head, rows))
    return "\n".join(parts)


def _farm(load: Load, probes: int, cores: int, disk: float, task: float) -> Farm:
    """Return a farm whose tasks are as long as `shrm batch` makes them, or a pool of few cores."""
    if cores <= _POOL:
        return Farm(cores, disk, 0.0, 1)
    wanted = max(run._TASK_SECONDS, run._WORKER_SECONDS * cores)
    most = min(run._MOST_TOGETHER, -(-probes // (run._AHEAD * cores)))
    return Farm(cores, disk, task, max(1, min(most, int(wanted / load.seconds))))


def scheduling(rows: Sequence[Handed], task: float) -> str:
    """Write what the scheduler takes, and how long tasks must be."""
    head = (
        "workers", "probes a task", "tasks", "scheduler (ms a task)", "`shrm batch` (ms a task)",
        "ms a probe, both", "tasks a second here", "scheduler's memory (MB)",
    )  # fmt: skip
    body = [
        (
            f"{row.workers}", f"{row.group}", f"{row.tasks:,}", f"{1e3 * row.scheduler:.2f}",
            f"{1e3 * row.client:.2f}", f"{1e3 * (row.scheduler + row.client) / row.group:.3f}",
            f"{row.tasks / row.elapsed:.0f}", " ".join(f"{size:.0f}" for _, size in row.grown[::3]),
        )
        for row in rows
    ]  # fmt: skip
    needs = [
        (
            f"{cores}",
            duration(task_seconds(cores, task, 1)),
            duration(task_seconds(cores, task, BUSY)),
        )
        for cores in (2, *CORES[1:])
    ]
    return f"""
## The scheduler

{table(head, body)}
A task takes {1e3 * task:.1f} ms of the slower of the two processes. So tasks must take at least:

{table(("cores", "seconds that keep the scheduler busy", f"{BUSY:.0%} of the time"), needs)}"""


def whole(
    found: dict[str, Seconds], warm: Measured, floors: Seconds, before: float | None = None
) -> str:
    """Write where the time of a whole process goes, beside floors."""
    parts, processes = found["parts"], found["whole"]
    empty, libraries = processes["an empty Python"], processes["one that imports the libraries"]
    floor = {
        "start": (empty, "`python -c pass`"),
        "libraries": (libraries - empty, "importing numpy, OpenImageIO, OpenEXR and click alone"),
        "shrm": (0.0, "none"),
        "read": (floors["read"], "OpenImageIO alone, warm"),
        "write": (floors["write"], "OpenEXR alone, warm"),
    }
    names = {"libraries": "import libraries", "shrm": "import shrm_cli"}
    body = []
    for part in ("start", "libraries", "shrm", *PARTS):
        least, what = floor.get(part, (warm.seconds.get(part, 0.0), "the same in a warm process"))
        took = parts.get(part, 0.0)
        body.append((names.get(part, part), f"{1e3 * took:.1f}", f"{1e3 * least:.1f}", what))
    total = sum(parts.values())
    body.append(("in all", f"{1e3 * total:.0f}", f"{1e3 * processes['shrm prefilter']:.0f}",
                 "the command itself, whose exit is counted"))  # fmt: skip
    imports = [(name, f"{1e3 * s:.1f}") for name, s in found["imports"].items() if s >= 1e-3]
    return f"""
## A whole process, `shrm prefilter` of a {2 * warm.case.rows} x {warm.case.rows} probe

{table(("part", "ms", "floor (ms)", "what the floor is"), body)}
Reading the same probe packed as DWAB takes OpenImageIO {1e3 * floors["read as DWAB"]:.0f} ms in
place of {1e3 * floors["read"]:.0f} ms, and writing the map unpacked takes OpenEXR
{1e3 * floors["write unpacked"]:.1f} ms in place of {1e3 * floors["write"]:.1f} ms.

Imports by package, the least of several runs (`-X importtime`):

{table(("package", "ms"), imports)}"""
