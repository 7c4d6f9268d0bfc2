"""The figure of the cost model: what each part takes, and the lines that the model predicts."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from research.scale.model import Case, Sum
from research.scale.parts import Measured

Quantity = Callable[[Case], float]
Panel = tuple[str, Quantity, Sequence[Measured], float]
"""The label of an axis, the quantity, what was measured along it, and the thesis' exponent."""
_COLORS = "C0", "C1", "C2", "C3", "C4"


def draw(path: Path, panels: Sequence[Panel], parts: Sequence[str], laws: dict[str, Sum]) -> str:
    """Draw measured and modelled times against one quantity a panel; return the file's name.

    Parameters
    ----------
    path : Path
    panels : sequence of Panel
        The slope of the thesis is dashed.
    parts : sequence of str
    laws : dict of str to Sum
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure((4.2 * len(panels), 4.2), 110, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    for axes, (label, quantity, rows, slope) in zip(
        figure.subplots(1, len(panels)), panels, strict=True
    ):
        _panel(axes, quantity, sorted(rows, key=lambda row: quantity(row.case)), parts, laws)
        x = [quantity(row.case) for row in rows]
        low, high = min(x), max(x)
        top = max(max(row.seconds[part] for part in parts) for row in rows) * 1e3
        axes.plot(
            [low, high],
            [top * (low / high) ** slope, top],
            "k--",
            lw=1,
            label="slope in the thesis",
        )
        axes.set(xlabel=label, ylabel="ms", xscale="log", yscale="log", ylim=(0.05, 3 * top))
        axes.set_xticks(sorted(set(x)), [f"{each:g}" for each in sorted(set(x))])
        axes.minorticks_off()
        axes.grid(color="0.9")
    axes.legend(fontsize="small", loc="lower right", framealpha=0.8)
    figure.savefig(path)
    return path.name


def _panel(
    axes: Any,
    quantity: Quantity,
    rows: Sequence[Measured],
    parts: Sequence[str],
    laws: dict[str, Sum],
) -> None:
    x = [quantity(row.case) for row in rows]
    for part, color in zip(parts, _COLORS, strict=False):
        axes.plot(x, [1e3 * row.seconds[part] for row in rows], "o", color=color, ms=4, label=part)
        axes.plot(x, [1e3 * laws[part].seconds(row.case) for row in rows], color=color, lw=1)
