"""Charts of an analysis as PNG files.

This is the only module that uses matplotlib, which is an optional dependency. Figures and equations
5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

import importlib.util
import logging
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.choose.offer import Choice
from shrm_cli.files.png import SOFTWARE
from shrm_cli.files.whole import replacing
from shrm_cli.maps.registry import description

_WIDTH, _HEIGHT = 7.0, 4.8  # inches
_DOTS_PER_INCH = 150
_LEVEL = {"color": "0.25", "lw": 0.9, "ls": "--", "zorder": 1.5}
"""Style of the line at a tolerance."""
_CIRCLE = {
    "marker": "o", "mfc": "none", "mec": "0.25", "ms": 9, "mew": 1.4, "zorder": 4, "clip_on": False,
}  # fmt: skip
"""Style of the circle around the orders that meet a tolerance."""
_TRUTH, _MINIMUM, _BRDF, _BOUND = "#111111", "#0072b2", "#d55e00", "#009e73"
"""Colors of the curves; all but the first are from the palette of Okabe and Ito."""

_COSTS = {"bytes": "bytes", "look_ups": "look-ups", "multiply_adds": "multiply-adds"}
"""What maps cost, by the names of `Offer`: a chart for each, and the name of its axis."""
_ROW = 3.1
"""Height of a row of charts, inches."""


def can_plot() -> bool:
    """Return whether matplotlib is installed."""
    return importlib.util.find_spec("matplotlib") is not None


def plot_energy(
    path: str | os.PathLike[str],
    captured: Array,
    orders: Sequence[tuple[int, int, float]],
    title: str,
) -> None:
    """Draw the energy of a BRDF that orders capture: a curve over F for each P.

    `captured`, of shape (F+1, P+1), holds fractions of the energy. `orders` are the orders that
    meet each tolerance. A line marks the tolerance, and a circle the orders if they lie within the
    grid.
    """
    floor = min((tolerance for *_, tolerance in orders), default=0.01) / 20
    with _default_style():
        from matplotlib import colormaps

        figure, (axes, missed_axes) = _figure(title, columns=2, width=1.6 * _WIDTH)
        axes.set(ylabel="BRDF energy captured (%)", ylim=(0, 102))
        missed_axes.set(ylabel="BRDF energy missed (%)", ylim=(100 * floor, 110))
        missed_axes.set_yscale("log")
        missed_axes.yaxis.set_major_formatter("{x:g}")
        frequencies = np.arange(len(captured))
        missed = np.maximum(1 - captured, floor / 10)  # a logarithmic axis has no zero
        # The curves go from light for P = 0 to dark for the largest P. The lightest yellows are
        # left out, because they are hard to see.
        shades = colormaps["viridis"](np.linspace(0, 0.85, captured.shape[1]))[::-1]
        for p, shade in enumerate(shades):
            style: dict[str, Any] = {"color": shade, "marker": ".", "markersize": 5, "label": p}
            axes.plot(frequencies, 100 * captured[:, p], **style)
            missed_axes.plot(frequencies, 100 * missed[:, p], **style)
        for f, p, tolerance in orders:
            missed_axes.annotate(
                f"{100 * tolerance:g}%: F = {f}, P = {p}", (1, 100 * tolerance), (5, 0),
                xycoords=("axes fraction", "data"), textcoords="offset points", va="center",
            )  # fmt: skip
            axes.axhline(100 * (1 - tolerance), **_LEVEL)
            missed_axes.axhline(100 * tolerance, **_LEVEL)
            if f < captured.shape[0] and p < captured.shape[1]:
                axes.plot([f], [100 * captured[f, p]], **_CIRCLE)
                missed_axes.plot([f], [100 * max(missed[f, p], floor)], **_CIRCLE)
        for each in (axes, missed_axes):
            _frequency_axis(each, len(captured) - 1)
        axes.legend(loc="lower right", title="P", ncols=min(-(-len(shades) // 3), 3))
        _save(figure, path)


def plot_accuracy(
    path: str | os.PathLike[str], curves: Mapping[str, Array], order_p: int, title: str
) -> None:
    """Draw the accuracy of the reflected light and estimates of it against F (figure 5.5).

    `curves` are, each of shape (F+1,), ``accuracy``, ``estimate_minimum``, ``estimate_brdf`` and
    ``estimate_bound``: fractions of the energy.
    """
    with _default_style():
        figure, (axes,) = _figure(f"{title}, P = {order_p}", columns=1, width=_WIDTH)
        named = {
            "accuracy": ("accuracy of the reflected light", _TRUTH, "-", 2.2),
            "estimate_bound": ("estimate: bound of eq. 5.19", _BOUND, "-.", 1.6),
            "estimate_minimum": ("estimate: lesser error, light or BRDF", _MINIMUM, "--", 1.6),
        }
        for key, (label, color, line, width) in named.items():
            values = curves[key]
            axes.plot(np.arange(len(values)), values, line, color=color, lw=width, label=label)
        values = curves["estimate_brdf"]
        axes.plot(
            np.arange(len(values)), values, ".", color=_BRDF, markersize=5,
            label="estimate: error of the BRDF",
        )  # fmt: skip
        lowest = min(values[-1] for values in curves.values())
        axes.set(
            ylabel="accuracy 1 \N{MINUS SIGN} \N{GREEK SMALL LETTER EPSILON} (of the energy)",
            ylim=(0.5 if lowest > 0.5 else 0, 1.01),
        )
        _frequency_axis(axes, len(values) - 1)
        figure.legend(loc="outside lower center", ncols=2, frameon=False)
        _save(figure, path)


def plot_materials(
    path: str | os.PathLike[str], names: Sequence[str], captured: Array, order_f: int
) -> None:
    """Draw the energy that orders capture of several BRDFs as bars, as in figure 5.7.

    `captured`, of shape (materials, P+1), holds fractions of the energy. The energy that each
    further P adds is a part of the bar.
    """
    with _default_style():
        from matplotlib import colormaps

        width = max(_WIDTH, 2.5 + 0.45 * len(names))
        figure, (axes,) = _figure(f"energy captured at F = {order_f}", columns=1, width=width)
        shades = colormaps["viridis"](np.linspace(0.95, 0, captured.shape[1]))
        parts = np.diff(100 * captured, axis=1, prepend=0)
        for p, shade in enumerate(shades):
            below = 100 * captured[:, p - 1] if p else 0
            axes.bar(range(len(names)), parts[:, p], 0.7, bottom=below, color=shade, label=p)
        axes.set(ylabel="BRDF energy captured (%)", ylim=(0, 101))
        labels = [name.encode("utf-8", "replace").decode() for name in names]
        axes.set_xticks(range(len(names)), labels, rotation=35, ha="right", parse_math=False)
        axes.grid(visible=False, axis="x")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside right upper", title="P")
        _save(figure, path)


def plot_offers(path: str | os.PathLike[str], choices: Sequence[tuple[str, Choice]]) -> None:
    """Draw the errors of maps over what they cost, with the front and what is recommended.

    `choices` are at least one, with the path of its probe: a row of charts for each.
    """
    with _default_style():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from matplotlib.lines import Line2D

        size = (4.3 * len(_COSTS), _ROW * len(choices) + 0.5)
        figure = Figure(size, _DOTS_PER_INCH, layout="constrained")
        FigureCanvasAgg(figure)
        parts = figure.subfigures(len(choices), 1, squeeze=False)[:, 0]
        for part, (probe, choice) in zip(parts, choices, strict=True):
            title = f"{probe}, {choice.brdf}".encode("utf-8", "replace").decode()
            part.suptitle(title, fontsize="medium", parse_math=False)
            axes = part.subplots(1, len(_COSTS), sharey=True, squeeze=False)[0]
            for each, cost in zip(axes, _COSTS, strict=True):
                _draw_offers(each, choice, cost)
            axes[0].set(ylabel="RMS error (%)")
        names = sorted({each.form for _, choice in choices for each in choice.offers})
        marks = [
            Line2D([], [], color=color, marker=marker, ls="none")
            for color, marker in (description(name).mark for name in names)
        ]
        figure.legend(marks, names, loc="outside lower center", ncols=len(names), frameon=False)
        _save(figure, path)


def _draw_offers(axes: Any, choice: Choice, cost: str) -> None:
    """Draw the errors over one of the `_COSTS`; marks of the front are full."""
    from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter

    offers = choice.offers
    percent = 100 * np.array([each.error for each in offers])
    values = np.array([getattr(each, cost) for each in offers], dtype=float)
    on_front = [each.on_front if cost == "bytes" else each.on_cost_front for each in offers]
    for x, y, offer, is_front in zip(values, percent, offers, on_front, strict=True):
        color, marker = description(offer.form).mark
        style = {"mfc": color if is_front else "none", "mec": color, "mew": 1.2}
        axes.plot([x], [y], marker, ms=6, ls="none", zorder=3, **style)
    front = np.flatnonzero(on_front)
    front = front[np.argsort(values[front], kind="stable")]
    least = np.minimum.accumulate(percent[front])
    axes.step(values[front], least, where="post", color="0.6", lw=1, zorder=2)
    axes.axhline(100 * choice.goal.error, **_LEVEL)
    if cost == "bytes" and choice.budget is not None:
        axes.axvline(choice.budget, **_LEVEL)
    if choice.recommended is not None:
        best = offers.index(choice.recommended)
        axes.plot([values[best]], [percent[best]], ls="none", **{**_CIRCLE, "ms": 13})
    if (values < 1).any():  # a logarithmic axis has no zero
        axes.set_xscale("symlog", linthresh=1)
        axes.set_xlim(-0.2, 2 * max(values.max(), 1))
    else:
        axes.set_xscale("log")
        axes.set_xlim(values.min() / 2, values.max() * 2)
    axes.xaxis.set_major_formatter(EngFormatter(sep="\N{NO-BREAK SPACE}"))
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_formatter(NullFormatter())
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set(xlabel=_COSTS[cost])


def _default_style() -> Any:
    """Return matplotlib's own style, so that charts do not depend on the style of the user."""
    # Matplotlib warns if it cannot write its caches, which has nothing to do with the chart.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    import matplotlib.style

    return matplotlib.style.context("default", after_reset=True)


def _figure(title: str, columns: int, width: float) -> tuple[Any, Any]:
    """Make a figure without pyplot, so that no window system is needed."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure((width, _HEIGHT), _DOTS_PER_INCH, layout="constrained")
    FigureCanvasAgg(figure)
    # The name of a file may hold bytes that are not text, and dollars that start no formula.
    title = title.encode("utf-8", "replace").decode()
    figure.suptitle(title, fontsize="large", parse_math=False)
    axes = figure.subplots(1, columns, squeeze=False)[0]
    for each in axes:
        each.grid(color="0.9")
        each.set_axisbelow(True)
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _frequency_axis(axes: Any, order_f: int) -> None:
    axes.set(xlabel="order F", xlim=(0, max(order_f, 1)))
    axes.xaxis.get_major_locator().set_params(integer=True)


def _save(figure: Any, path: str | os.PathLike[str]) -> None:
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", metadata={"Software": SOFTWARE})
