"""The page on what is seen of maps, as Markdown; see the module `seen`."""

from collections.abc import Sequence
from textwrap import fill

import numpy as np

from research.bars import BARS, Case
from research.extent import Extent
from research.page import short_form, table
from research.seen import (
    AFTER,
    BEFORE,
    CMFT_P95,
    CMFT_PART,
    CMFT_SECONDS,
    PRINCIPAL,
    SAME_BYTES,
    VIEW_ALONE,
    PhongCube,
    Seen,
    find,
)
from shrm_cli.vocabulary import MAX_PRINCIPAL_MAPS


def introduction(probes: Sequence[str], rows: int, extent: Extent) -> str:
    """Write the title, and what is compared."""
    pixels = f"{extent.seen_picture} x {extent.seen_picture}"
    spheres = f"""{_listed(probes)}, averaged down to {rows} rows for maps and truth alike (twice
that for sharp lobes with heavy tails, of which a sum over coarse pixels is no truth). Median,
p95 and HDR-FLIP are those of spheres of {pixels} pixels from the three views of `shrm compare`,
against the sum over all pixels of the probe: of the relative error of the luminance, pixel by
pixel. Negative is the share of negative pixels."""
    ways = f""""{BEFORE}" is the map that ends at the orders F and P that the tolerance .03 asks
for, as all maps did once; "{AFTER}" is that of `--to shrm` (as one map, without
terms), which carries all visible orders of the light, in as many bytes. "{VIEW_ALONE}" is the map
of three times the order F, as far as the same cubes support it, with the same P: what it misses is
the view beyond P.
"{PRINCIPAL}" is the map of `--to principal` with as many cubes of the same size, or with
{MAX_PRINCIPAL_MAPS} larger ones that take no more bytes, and "{SAME_BYTES}" the best one that takes
no more, mostly of more cubes that are smaller."""
    errors = f"""RMS is the relative error over all mirror directions and views, or about the
normal (`lambertian`, `oren-nayar`) over all normals and views above them, at {extent.seen_pairs}
pairs that are drawn where the light and the error are, beside the predicted one. "On a GPU" are
the same two with bilinear look-ups in half precision. Seconds are those of this machine, for
coefficients that an earlier row may have left in the cache."""
    paragraphs = "\n\n".join(fill(each, 100) for each in (spheres, ways, errors))
    return f"# What is seen\n\n{paragraphs}\n{short_form(extent)}"


def verdict(rows: Sequence[Seen]) -> str:
    """Write what is asked of maps, whether it is kept, and which maps miss it."""
    head, body, lists = ("asked", "kept by", "met"), [], []
    for bar in BARS:
        cases = bar.cases(rows)
        missed = [case for case in cases if not case.is_kept]
        met = "yes" if not missed else "**no**"
        kept = f"{len(cases) - len(missed)} of {len(cases)}"
        body.append((bar.text, kept, met if cases else "nothing to tell it by"))
        if missed:
            lists.append(f"{bar.text} Missed by:\n\n" + "".join(map(_missed, missed)))
    return "\n".join(["\n## What is asked of maps\n", table(head, body), *lists])


def _missed(case: Case) -> str:
    return (
        f"- {case.spec} under {case.probe}, {case.way}: {case.value:.2%}, "
        f"where at most {case.limit:.2%} is asked\n"
    )


def summary(rows: Sequence[Seen]) -> str:
    """Write the means over the probes, with a line for each BRDF and way."""
    head = (
        "BRDF", "map", "orders F, P; carried", "size", "kB", "median", "p95", "worst p95",
        "negative", "RMS", "predicted", "on a GPU", "predicted", "HDR-FLIP",
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
                f"{_mean(own, 'gpu_rms'):.2%}", f"{_mean(own, 'gpu_predicted'):.2%}",
                f"{_mean(own, 'flip'):.3f}",
            ))  # fmt: skip
    return f"\n## Means over the probes\n\n{table(head, body)}"


def section(rows: Sequence[Seen]) -> str:
    """Write all numbers of one BRDF."""
    head = (
        "probe", "map", "median", "p95", "negative", "RMS", "predicted", "on a GPU", "predicted",
        "HDR-FLIP", "seconds",
    )  # fmt: skip
    spec = rows[0].spec
    body = []
    for probe in dict.fromkeys(row.probe for row in rows):
        for way in _ways(rows, spec):
            row = find(rows, spec, probe, way)
            body.append((
                probe, way, f"{row.median:.2%}", f"{row.p95:.2%}", f"{row.negative:.2%}",
                f"{row.rms:.2%}", f"{row.predicted:.2%}", f"{row.gpu_rms:.2%}",
                f"{row.gpu_predicted:.2%}", f"{row.flip:.3f}", f"{row.seconds:.2f}",
            ))  # fmt: skip
    return f"\n## {spec}\n\n{table(head, body)}"


def beside_cmft(rows: Sequence[PhongCube], probe: str, size: int) -> str:
    """Write the part on Phong cubes, beside what cmft was measured to do."""
    body = [
        (
            f"{row.exponent}", f"{CMFT_SECONDS[row.exponent]:g}", f"{row.seconds:.2f}",
            f"{row.median:.3%}", f"{row.p95:.3%}", "yes" if row.keeps_bar else "**no**",
        )
        for row in rows
    ]  # fmt: skip
    head = ("s", "cmft (s)", "ours (s)", "our median", "our p95", "within a tenth of cmft's")
    text = f"""Cubes of {size} x {size} faces under `{probe}`, at texels drawn at random. cmft's
times and errors were measured once, for 128 x 128 faces on two cores, under a probe with a small
sun: its p95 went from {CMFT_P95[0]:.1%} to {CMFT_P95[1]:.1%}. A tenth of the least of them is
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
