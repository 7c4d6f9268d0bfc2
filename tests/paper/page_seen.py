"""The page on what is seen of maps, as Markdown; see the module `seen`."""

from collections.abc import Sequence
from textwrap import fill

import numpy as np

from tests.paper.page import table
from tests.paper.seen import (
    AFTER,
    BEFORE,
    CMFT_P95,
    CMFT_PART,
    CMFT_SECONDS,
    OTHER_P95,
    VIEW_ALONE,
    ZONAL_P95,
    PhongCube,
    Seen,
    bar_of,
    find,
    misses,
)


def introduction(probes: Sequence[str], rows: int, size: int) -> str:
    """Write the title, and what is compared."""
    text = f"""{_listed(probes)}, averaged down to {rows} rows for maps and truth alike.
Spheres of {size} x {size} pixels from the three views of `shrm compare`, against the sum over all
pixels of the probe. "{BEFORE}" is the map that ends at the orders F and P that the tolerance .03
asks for, as all maps did once; "{AFTER}" is the default (as one map, without terms), which
carries all visible orders of
the light, in as many bytes. "{VIEW_ALONE}" is the map of three times the order F with the same P,
in larger cubes where it needs them: what it misses is the view beyond P. Median and p95 are those
of the relative error of the luminance, pixel by pixel; negative is the share of negative pixels.
RMS is that of these pixels; the predicted one is over mirror directions and views, uniformly."""
    return f"# What is seen\n\n{fill(text, 100)}\n"


def verdict(rows: Sequence[Seen]) -> str:
    """Write what the bars are, and which maps miss them."""
    missed = [misses(row, rows) for row in rows if row.way == AFTER]
    text = f"""The bars: the p95 of lobes that do not depend on the view is at most {ZONAL_P95:.0%},
and none of their pixels is negative; the p95 of other lobes is at most {OTHER_P95:g} times that of
"{VIEW_ALONE}". {sum(not lines for lines in missed)} of {len(missed)} maps keep them."""
    broken = "".join(f"\n- {line}" for lines in missed for line in lines)
    return f"\n{fill(text, 100)}\n{broken}\n"


def summary(rows: Sequence[Seen]) -> str:
    """Write the means over the probes, with a line for each BRDF and way."""
    head = (
        "BRDF", "map", "orders F, P; carried", "size", "kB", "median", "p95", "worst p95",
        "negative", "RMS", "predicted", "HDR-FLIP",
    )  # fmt: skip
    body = []
    for spec in dict.fromkeys(row.spec for row in rows):
        for way in _ways(rows, spec):
            own = [row for row in rows if (row.spec, row.way) == (spec, way)]
            body.append((
                spec, way, _span(own, "order_f") + ", " + _span(own, "order_p") + "; "
                + _span(own, "carried"), _span(own, "size"), f"{_mean(own, 'bytes') / 1e3:.0f}",
                f"{_mean(own, 'median'):.2%}", f"{_mean(own, 'p95'):.2%}",
                f"{max(row.p95 for row in own):.2%}", f"{_mean(own, 'negative'):.2%}",
                f"{_mean(own, 'rms'):.2%}", f"{_mean(own, 'predicted'):.2%}",
                f"{_mean(own, 'flip'):.3f}",
            ))  # fmt: skip
    return f"\n## Means over the probes\n\n{table(head, body)}"


def section(rows: Sequence[Seen]) -> str:
    """Write all numbers of one BRDF."""
    head = (
        "probe", "map", "median", "p95", "bar", "negative", "RMS", "predicted", "HDR-FLIP",
        "seconds",
    )  # fmt: skip
    spec = rows[0].spec
    body = []
    for probe in dict.fromkeys(row.probe for row in rows):
        for way in _ways(rows, spec):
            row = find(rows, spec, probe, way)
            bar = f"{bar_of(row, rows):.2%}" if way == AFTER else ""
            body.append((
                probe, way, f"{row.median:.2%}", f"{row.p95:.2%}", bar, f"{row.negative:.2%}",
                f"{row.rms:.2%}", f"{row.predicted:.2%}", f"{row.flip:.3f}", f"{row.seconds:.2f}",
            ))  # fmt: skip
    return f"\n## {spec}\n\n{table(head, body)}"


def beside_cmft(rows: Sequence[PhongCube], probe: str) -> str:
    """Write the part on Phong cubes, beside what cmft was measured to do."""
    body = [
        (
            f"{row.exponent}", f"{CMFT_SECONDS[row.exponent]:g}", f"{row.seconds:.2f}",
            f"{row.median:.3%}", f"{row.p95:.3%}", "yes" if row.keeps_bar else "**no**",
        )
        for row in rows
    ]  # fmt: skip
    head = ("s", "cmft (s)", "ours (s)", "our median", "our p95", "bar kept")
    text = f"""Cubes of 128 x 128 faces under `{probe}`, at texels drawn at random. cmft's times and
errors were measured once, on two cores, under a probe with a small sun: its p95 went from
{CMFT_P95[0]:.1%} to {CMFT_P95[1]:.1%}. The bar is {CMFT_PART:g} of the least of them,
{CMFT_PART * CMFT_P95[0]:.2%}. Ours is the time of the prefiltering alone, with the coefficients of
the lobe, before the map is written."""
    return f"\n## Phong lobes, beside cmft\n\n{fill(text, 100)}\n\n{table(head, body)}"


def _ways(rows: Sequence[Seen], spec: str) -> list[str]:
    """The ways of a BRDF's maps, in the order in which a reader compares them."""
    found = dict.fromkeys(row.way for row in rows if row.spec == spec)
    return sorted(found, key=lambda way: (way != BEFORE, way != AFTER))


def _mean(rows: Sequence[Seen], name: str) -> float:
    return float(np.mean([getattr(row, name) for row in rows]))


def _span(rows: Sequence[Seen], name: str) -> str:
    """A whole number that the rows share, or its least and largest value."""
    values = [getattr(row, name) for row in rows]
    least, largest = min(values), max(values)
    return f"{least}" if least == largest else f"{least} .. {largest}"


def _listed(names: Sequence[str]) -> str:
    return f"{len(names)} probes ({', '.join(names)})" if len(names) > 1 else f"`{names[0]}`"
