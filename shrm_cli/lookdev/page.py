"""The page of a sheet: one file, without a network, whose columns can be exposed anew.

Short names of materials and probes stand beside its rows and columns, as on pictures of sheets.
"""

import base64
import html
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from shrm_cli.brdf.base import COMMA, cut
from shrm_cli.brdf.spec import file_label, names_file
from shrm_cli.brdf.sums import is_sum, term_texts
from shrm_cli.files.html_page import asset, html_page
from shrm_cli.files.picture import Picture
from shrm_cli.maps.options import counted
from shrm_cli.naming import probe_stem

if TYPE_CHECKING:
    from shrm_cli.lookdev.sheet import Column

_MOST = 24
"""Characters of a short name; longer ones end in an ellipsis."""
_STOPS = 8
"""Stops that a slider goes either way."""
_HALF_MAX = 65504.0
"""What is brighter is white at every exposure that a slider reaches."""


def lookdev_page(
    columns: "Sequence[Column]",
    heads: Sequence[str],
    sides: Sequence[str],
    tiles: Sequence[Sequence[Picture | str]],
    size: int,
) -> str:
    """Return a page of a sheet: HTML, to be written as UTF-8.

    `heads` and `sides` are the names of the probes and of the materials. `tiles` are for each
    column the picture of each material, shape (size, size, 3), linear Rec.709 and exposed, or why
    there is none. `size` is the width of a cell, pixels.
    """
    style = f":root {{ --cell: {size}px; }}\n" + asset("lookdev", "page.css")
    script = asset("lookdev", "page.js")
    sections = [
        _section(column, head, sides, cells, size)
        for column, head, cells in zip(columns, heads, tiles, strict=True)
    ]
    title = f"{counted(len(sides), 'material')}, {counted(len(heads), 'probe')}"
    body = [
        f"<h1>{title}</h1>",
        "<p>Every sphere stands before its own light. A slider exposes its column anew, in "
        "stops.</p>",
        "<main>",
        *sections,
        "</main>",
    ]
    return html_page(f"{title} \u2013 shrm", "\n".join(body), style, script)


def _section(
    column: "Column", head: str, sides: Sequence[str], cells: Sequence[Picture | str], size: int
) -> str:
    name = html.escape(head)
    lines = ["<section>", "<header>", f'<h2 title="{html.escape(column.path)}">{name}</h2>']
    if any(not isinstance(cell, str) for cell in cells):
        lines.append(
            f'<label><input type="range" min="-{_STOPS}" max="{_STOPS}" step="0.1" value="0" '
            f'data-own="{column.exposure:.6g}" aria-label="Exposure of {name}">'
            "<output></output>"
            f'<button type="button" title="The probe\'s own exposure" aria-label="Reset the '
            f'exposure of {name}">\u21ba</button></label>'
        )
    else:
        lines.append('<div class="none">no picture</div>')
    lines += ["</header>", '<div class="cells">']
    for side, cell in zip(sides, cells, strict=True):
        caption = html.escape(side)
        shown = (
            f'<div class="failed">{html.escape(cell)}</div>'
            if isinstance(cell, str)
            else f'<canvas width="{size}" height="{size}" role="img" '
            f'aria-label="{caption}, {name}"></canvas>'
            f'<script type="text/plain">{_halves(cell)}</script>'
        )
        title = f"{caption}" if isinstance(cell, str) else f"{caption} \u00b7 {name}"
        lines.append(f'<figure>{shown}<figcaption title="{title}">{caption}</figcaption></figure>')
    return "\n".join([*lines, "</div>", "</section>"])


def _halves(picture: Picture) -> str:
    """Return a picture as half floats in base64, little-endian, RGB of row after row."""
    limited = np.clip(picture, -_HALF_MAX, _HALF_MAX).astype("<f2")
    return base64.b64encode(limited.tobytes()).decode("ascii")


def material_names(specs: Sequence[str]) -> list[str]:
    """Return a short name for each specification of a BRDF, and no two alike.

    ``ggx:roughness=0.4,f0=gold`` is ``ggx 0.4 gold``, a measured file is its name without folder
    and suffix, and ``0.9*lambertian+0.1*ggx`` is ``lambertian + ggx``. Where that is the same for
    two of them, both keep all that they say.
    """
    return _told_apart([_short(spec) for spec in specs], [file_label(spec) for spec in specs])


def probe_names(paths: Sequence[str]) -> list[str]:
    """Return a short name for each probe: that of its file, with its folder where two are alike."""
    return _told_apart([probe_stem(path) for path in paths], paths)


def _told_apart(short: Sequence[str], full: Sequence[str]) -> list[str]:
    counts = Counter(short)
    return [name if counts[name] == 1 else text for name, text in zip(short, full, strict=True)]


def _short(spec: str) -> str:
    if is_sum(spec):
        return _cut(" + ".join(_short(term).partition(" ")[0] for term in term_texts(spec)))
    if names_file(spec):
        return _cut(file_label(spec))
    name, _, parameters = spec.partition(":")
    values = [pair.partition("=")[2] or pair for pair in cut(COMMA, parameters) if pair]
    words = (_short(value[1:-1]) if value[0] == "(" else value for value in map(str.strip, values))
    return _cut(" ".join([name.strip(), *words]))


def _cut(text: str) -> str:
    return text if len(text) <= _MOST else f"{text[: _MOST - 3]}..."
