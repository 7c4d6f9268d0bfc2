"""Writing the page on what batches take, and its figure."""

import json
import os
import platform
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from research.inputs import Page, probe_files, say
from research.scale import chart, page
from research.scale.clock import PARTS, REST
from research.scale.forecast import Load
from research.scale.model import TERMS, Case, PowerLaw, Sum, fit_powers, fit_sum
from research.scale.parts import SPEC, Measured, all_parts, floors
from research.scale.reach import FULL, Reach
from research.scale.scheduler import handed
from research.scale.start import whole_process
from shrm_cli.probe.open import open_probe

_LEAST = 1e-6
"""Seconds below which nothing is fitted, because the clock's own calls take as long."""
_LARGE = 0.02
"""Seconds above which a map counts as large in the table of exponents."""
_DRAWN = "project", "couple", "synthesise", REST, "write"
_MAKING = "couple", "synthesise"
_PACKING = "encode", "write"


def write_scale(folder: Path, probes: Path, reach: Reach) -> Path:
    """Measure, and write the page into a folder as far as it has come.

    Parameters
    ----------
    folder : Path
        It is made where it is missing.
    probes : Path
        The folder of real probes, one of which is the light of all sizes.
    reach : Reach

    Returns
    -------
    Path
        The page.
    """
    light = open_probe(probe_files(probes)[0])
    written = Page(folder / "scale.md")
    remark = "" if reach == FULL else "\n**This is the short form; its numbers mean nothing.**\n"
    load = ", ".join(f"{each:.1f}" for each in os.getloadavg())
    machine = f"{platform.machine()}, {os.cpu_count()} cores, load {load} when it began."
    written.add(page.introduction(machine, remark))
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        found = all_parts(light, scratch, reach)
        least = floors(light, scratch, reach)
        record(folder / "scale.json", found)
        written.add(page.forms([*found["probes"], *found["forms"]]))
        laws = model([*found["sweep"], *found["probes"]])
        written.add(page.powers(exponents(found)))
        written.add(page.sums(laws))
        drawn = chart.draw(folder / "scale.png", panels(found, reach), _DRAWN, laws)
        written.add(f"![what parts take, measured and modelled]({drawn})\n")
        process = whole_process(scratch / f"{reach.form_rows}.exr", scratch, reach.processes)
    defaults = [row for row in found["probes"] if row.label.endswith(SPEC)]
    warm = next(row for row in defaults if row.case.rows == reach.form_rows)
    written.add(page.whole(process, warm, least))
    rows = list(handed(reach))
    task = max(max(row.scheduler, row.client) for row in rows if row.group == 1)
    written.add(page.scheduling(rows, task))
    loads = [Load.of(row) for row in (*defaults, *found["forms"])]
    written.add(page.forecasts(loads, task))
    say(f"The page is {written.path.resolve()}")
    return written.path


def record(path: Path, found: dict[str, list[Measured]]) -> None:
    """Write all measurements as JSON, to fit other laws to them."""
    rows = {name: [asdict(each) for each in many] for name, many in found.items()}
    path.write_text(json.dumps(rows, indent=1))


def model(rows: Sequence[Measured]) -> dict[str, Sum]:
    """Fit the cost model of every part that has terms, to the SHRMs that were measured."""
    found = {}
    for part, terms in TERMS.items():
        kept = [row for row in rows if row.seconds[part] > _LEAST]
        times = [row.seconds[part] for row in kept]
        found[part] = fit_sum(terms, [row.case for row in kept], times)
    return found


def exponents(found: dict[str, list[Measured]]) -> dict[str, tuple[tuple[str, ...], PowerLaw]]:
    """Fit power laws where table 5.3 of the thesis has some, or where one is to be expected."""
    sweep, probes = found["sweep"], found["probes"]
    viewed = [row for row in sweep if row.case.order_p]
    large = [row for row in sweep if _sum(row, _MAKING) > _LARGE] or sweep
    three = ("F", "(P+1)", "S")

    def law(rows: Sequence[Measured], parts: Sequence[str], names: tuple[str, ...]) -> PowerLaw:
        quantities = [[QUANTITIES[name](row.case) for name in names] for row in rows]
        return fit_powers(quantities, [_sum(row, parts) for row in rows])

    return {
        "couple, P > 0": (three[:2], law(viewed, ("couple",), three[:2])),
        "synthesise": (three, law(sweep, ("synthesise",), three)),
        "both, steps 2 and 3 of the thesis": (three, law(sweep, _MAKING, three)),
        f"both, maps that take more than {_LARGE:g} s": (three, law(large, _MAKING, three)),
        "project": (("L", "rows"), law(probes, ("project",), ("L", "rows"))),
        "read": (("rows",), law(probes, ("read",), ("rows",))),
        "encode and write": (three[1:], law(sweep, _PACKING, three[1:])),
        "all of a prefilter": (three, law(sweep, PARTS, three)),
    }


def _sum(row: Measured, parts: Sequence[str]) -> float:
    return sum(row.seconds[part] for part in parts)


QUANTITIES: dict[str, chart.Quantity] = {
    "F": lambda case: case.order_f,
    "L": lambda case: case.light,
    "(P+1)": lambda case: case.order_p + 1,
    "S": lambda case: case.size,
    "rows": lambda case: case.rows,
}


def panels(found: dict[str, list[Measured]], reach: Reach) -> list[chart.Panel]:
    """Return what the figure shows: times along each quantity, the others in the middle."""
    middle = {
        "F": reach.orders_f[len(reach.orders_f) // 2],
        "(P+1)": reach.orders_p[len(reach.orders_p) // 2] + 1,
        "S": reach.sizes[len(reach.sizes) // 2],
    }

    def along(name: str) -> list[Measured]:
        others = [each for each in middle if each != name]
        return [row for row in found["sweep"] if _is_at(row.case, others)]

    def _is_at(case: Case, names: Sequence[str]) -> bool:
        return all(QUANTITIES[name](case) == middle[name] for name in names)

    slopes = {"F": 1.0, "(P+1)": 2.0, "S": 2.0}
    shown = [(name, QUANTITIES[name], along(name), slope) for name, slope in slopes.items()]
    sharp = [row for row in found["probes"] if row.label.endswith(f"F={reach.probe_orders[-1]}")]
    return [*shown, ("rows of the probe", QUANTITIES["rows"], sharp, 2.0)]
