"""The page of the survey of all BRDFs, as Markdown; see the module `survey`."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

from research.page import table
from research.survey import FORMS, MOST_BYTES, MOST_SECONDS, Outcome


def survey(rows: Sequence[Outcome], height: int) -> list[str]:
    """Write the parts of the page: what it is, what is marked, and a table for each probe."""
    probes = list(dict.fromkeys(row.probe for row in rows))
    return [_introduction(rows, probes, height), _marked(rows), *(_table(rows, p) for p in probes)]


def _introduction(rows: Sequence[Outcome], probes: Sequence[str], height: int) -> str:
    specs = dict.fromkeys(row.spec for row in rows)
    listed = " and ".join(f"`{probe}`" for probe in probes)
    text = f"""{len(specs)} BRDFs under {listed}, averaged down to {height} rows for maps and truth
alike: every model that `shrm brdf` lists, over its useful range, plastics as sums, and the measured
files that were named. Each is prefiltered with `--to shrm` and with `--to principal`, at the
defaults of both, without a cache. Seconds are processor time, of all threads; MB are those of half
precision, before they are packed. Predicted is the relative RMS error. p95 is that of the relative
error of the luminance over the visible pixels of spheres from the three views of `shrm compare`,
against the sum over all pixels of the probe, and negative is the share of negative pixels."""
    return f"# All BRDFs, as SHRMs and as principal maps\n\n{fill(text, 100)}\n"


def _marked(rows: Sequence[Outcome]) -> str:
    """Write how many maps take more than they may, or are refused, and which."""
    titles = {
        "slow": f"more than {MOST_SECONDS:g} s",
        "large": f"more than {MOST_BYTES / 1e6:g} MB",
        "refused": "refused",
    }
    lines = []
    for mark, title in titles.items():
        found = [row for row in rows if mark in row.marks]
        lines.append(f"- {title}: {len(found)} of {len(rows)} maps")
        lines += [
            f"  - {_name(row.spec)} under {row.probe}, {row.form}: {_why(row)}" for row in found
        ]
    return "## Marked\n\n" + "\n".join(lines) + "\n"


def _why(row: Outcome) -> str:
    return row.refused or f"{row.seconds:.1f} s, {row.bytes / 1e6:.1f} MB"


def _table(rows: Sequence[Outcome], probe: str) -> str:
    head = ["BRDF"]
    for form in FORMS:
        head += [f"{form}: s", "MB", "predicted", "p95", "negative"]
    body = []
    for spec in dict.fromkeys(row.spec for row in rows):
        cells = [_name(spec)]
        marks: dict[str, None] = {}
        for form in FORMS:
            (row,) = (r for r in rows if (r.spec, r.probe, r.form) == (spec, probe, form))
            cells += _cells(row)
            marks |= dict.fromkeys(f"{mark} ({form})" for mark in row.marks)
        body.append([*cells, ", ".join(marks)])
    return f"## {probe}\n\n{table([*head, 'marks'], body)}"


def _cells(row: Outcome) -> list[str]:
    if row.refused:
        return [f"{row.seconds:.2f}", *4 * ["-"]]
    return [
        f"{row.seconds:.2f}", f"{row.bytes / 1e6:.2f}", f"{row.predicted:.2%}", f"{row.p95:.2%}",
        f"{row.negative:.2%}",
    ]  # fmt: skip


def _name(spec: str) -> str:
    """Return a specification, without the folder of a file."""
    return f"`{Path(spec).name}`" if Path(spec).is_file() else f"`{spec}`"
