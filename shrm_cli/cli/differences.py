"""What `shrm compare` prints: progress of the truth, numbers, and the table of them."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from shrm_cli.render.comparison import Comparison, Difference


class TruthProgress:
    """Rows of the truth's pictures, and within them the points; maps take no time beside it."""

    def __init__(self, views: int, size: int, bar: Callable[[int, int], None] | None) -> None:
        self.done, self.size, self.total, self.bar = 0, size, views * size, bar

    def rows(self, count: int) -> None:
        """Take note of whole rows."""
        self.done = min(self.done + count, self.total)
        self._show(self.done)

    def points(self, done: int, total: int) -> None:
        """Take note of points in the view that is being drawn."""
        self._show(self.done + (self.size - self.done % self.size) * done // total)

    def _show(self, rows: int) -> None:
        if self.bar is not None:
            self.bar(rows, self.total)


def numbers_of(
    comparison: Comparison, names: Sequence[str], views: Sequence[tuple[float, float]]
) -> dict[str, Any]:
    """Differences of each view and of all together, as the JSON has them."""

    def rows(view: int | None) -> list[dict[str, Any]]:
        return [
            {"file": name, **_values(comparison.difference(index, view))}
            for index, name in enumerate(names)
        ]

    each = [{"view": list(view), "maps": rows(index)} for index, view in enumerate(views)]
    return {"views": each, "summary": rows(None)}


def _values(difference: Difference) -> dict[str, float | None]:
    # JSON knows no infinity.
    return {key: v if math.isfinite(v) else None for key, v in asdict(difference).items()}


def table_of(result: dict[str, Any]) -> str:
    """Rows of each view, and of all together, below each other."""
    rows = [["view", "map", "RMSE", "relative", "maximum", "PSNR"]]
    for each in result["views"]:
        rows += [["{:g},{:g}".format(*each["view"]), *_cells(row)] for row in each["maps"]]
    rows += [["all", *_cells(row)] for row in result["summary"]]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    of_probe = "" if result["probe"] is None else f" of {result['probe']}"
    lines = [f"compared with {result['baseline']}{of_probe}"]
    for view, name, *numbers in rows:
        cells = [view.ljust(widths[0]), name.ljust(widths[1])]
        cells += [text.rjust(width) for text, width in zip(numbers, widths[2:], strict=True)]
        lines.append("  ".join(cells))
    return "\n".join(lines)


def _cells(row: dict[str, Any]) -> list[str]:
    rmse, relative, psnr = row["rmse"], row["relative_rmse"], row["psnr"]
    none = "inf dB" if rmse == 0 else "-inf dB"
    return [
        row["file"],
        f"{rmse:.4g}",
        "inf" if relative is None else f"{relative:.2%}",
        f"{row['maximum']:.4g}",
        none if psnr is None else f"{psnr:.1f} dB",
    ]
