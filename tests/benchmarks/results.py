"""The file of the benchmarks' results, and README's table, which is made of it and nothing else."""

import json
import math
import os
import platform
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tests.benchmarks.table import Row

_ROOT = Path(__file__).resolve().parents[2]
RESULTS = _ROOT / "docs" / "bench.json"
README = _ROOT / "README.md"
START, END = "<!-- made by make bench -->\n", "<!-- end of what make bench makes -->\n"


def read_results(path: Path = RESULTS) -> dict[str, Any]:
    """Read the results; empty ones where there is no file yet."""
    if not path.exists():
        return {"machine": "", "rows": {}}
    found: dict[str, Any] = json.loads(path.read_text())
    return found


def machine() -> str:
    """Describe the machine as far as it decides times."""
    model = platform.machine()
    cpus = Path("/proc/cpuinfo")
    if cpus.exists():
        lines = (line.partition(":") for line in cpus.read_text().splitlines())
        model = next((text.strip() for name, _, text in lines if "model name" in name), model)
    return f"{os.cpu_count()} processors ({model}), Python {platform.python_version()}"


def merged(results: Mapping[str, Any], made: Mapping[str, Iterable[Row]]) -> dict[str, Any]:
    """Return results with new rows in place of those of the benchmarks that ran again.

    Parameters
    ----------
    results : mapping
    made : mapping of str to iterable of Row
        The rows by the name of their benchmark.
    """
    new = {name: [asdict(row) for row in rows] for name, rows in made.items()}
    return {"machine": machine(), "rows": {**results["rows"], **new}}


def block(results: Mapping[str, Any]) -> str:
    """Render the results as the table of README."""
    lines = [
        f"On {results['machine']}:", "",
        "| what | ours | reference | ratio | bar | against |", "|---|---|---|---|---|---|",
    ]  # fmt: skip
    for rows in results["rows"].values():
        for row in rows:
            unit = "" if "MB" in row["name"] else " ms"
            cells = [
                row["name"], f"{_short(row['ours'])}{unit}", f"{_short(row['reference'])}{unit}",
                f"{row['ratio']:.2f}", "" if row["bar"] is None else f"{row['bar']:.3g}",
                row["note"],
            ]  # fmt: skip
            lines.append(f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |")
    return "\n".join(lines) + "\n"


def _short(value: float) -> str:
    """Return a number to three digits, without an exponent."""
    if not value:
        return "0"
    places = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{round(value, places):.{places}f}"


def replaced(text: str, results: Mapping[str, Any]) -> str:
    """Return README's text with the table of some results.

    Raises
    ------
    ValueError
        If the marks are missing between which it stands.
    """
    head, start, rest = text.partition(START)
    _, end, tail = rest.partition(END)
    if not start or not end:
        raise ValueError(f"README.md has lost the marks {START.strip()} and {END.strip()}")
    return f"{head}{START}{block(results)}{END}{tail}"


def write(results: Mapping[str, Any]) -> None:
    """Write the results and README's table."""
    text = replaced(README.read_text(), results)
    RESULTS.write_text(json.dumps(results, indent=1) + "\n")
    README.write_text(text)
