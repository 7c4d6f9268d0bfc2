"""The page that puts the thesis' numbers beside ours, as Markdown."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from research.extent import FULL, Extent
from research.figures import BLURS, LOBES_5_4, MOST_P, ORDER_F, Method
from research.timings import ANGULAR_TOLERANCE, VIEW_COUNT, Timing

CAPTURED_5_7 = 0.9
"""The part of a BRDF's energy that figure 5.7 counts as enough."""


def introduction(processor: str, numpy: str, extent: Extent) -> str:
    """Write the title, and what the page is."""
    rows = extent.source_rows
    return f"""# The paper's tables and figures, made anew

Ramamoorthi, *A Signal-Processing Framework for Forward and Inverse Rendering* (2002), chapter 5.
`make tables` wrote this page (numpy {numpy}, {processor}, one thread in every timing).

The paper timed a 1.4 GHz Pentium IV. What can be compared are the ratios. Both sides take the
same {2 * rows} x {rows} lat-long from memory, and sampling the BRDF is part of their time.
The angular side is `Reference`: an integral over the source's pixels for each texel, in float32,
neighbouring texels and pixels together, tiles of pixels outside every lobe of a group left out,
and the lobe cut where it holds all but {ANGULAR_TOLERANCE:g} of its light (eq. 5.30).
{short_form(extent)}"""


def short_form(extent: Extent) -> str:
    """Return a paragraph that tells readers of the short form not to trust its numbers."""
    if extent == FULL:
        return ""
    return """
**This is the short form of the page, which shows that all of it can be made. Its probes and
pictures are too small for its numbers to mean anything.**
"""


def table_5_4(rows: Sequence[Timing]) -> str:
    """Write table 5.4, the times for Phong lobes."""
    size = rows[0].size
    body = [
        (
            f"{row.value:g}", f"{row.order_f}", f"{row.paper_angular:.2f}",
            f"{row.paper_frequency:.3f}", f"{row.paper_ratio:.1f}", f"{row.angular:.2f}",
            f"{1e3 * row.frequency:.1f}", f"{row.ratio:.1f}", _verdict(row),
        )
        for row in rows
    ]  # fmt: skip
    head = (
        "s", "F", "paper: angular (s)", "frequency (s)", "ratio",
        "ours: angular (s)", "frequency (ms)", "ratio", "at least the paper's",
    )  # fmt: skip
    return f"""
## Table 5.4: Phong, six faces of {size} x {size}

F = 1 + sqrt(6 s). {_texels(size)}

{table(head, body)}"""


def table_5_5(rows: Sequence[Timing]) -> str:
    """Write table 5.5, the times for microfacet lobes."""
    size = rows[0].size
    body = [
        (
            f"{row.value:g}", f"{row.order_f}, {row.order_p}", f"{row.paper_angular:g}",
            f"{row.paper_frequency:.2f}", f"{row.paper_shrm:.2f}", f"{row.paper_ratio:.0f}",
            f"{row.angular:.0f}", f"{row.angular / VIEW_COUNT**2:.2f}",
            f"{1e3 * row.frequency:.0f}", f"{1e3 * row.shrm:.0f}", f"{row.ratio:.0f}",
            _verdict(row),
        )
        for row in rows
    ]  # fmt: skip
    head = (
        "sigma", "F, P", "paper: angular (s)", "frequency (s)", "SHRM (s)", "ratio",
        "ours: angular (s)", "an image (s)", "frequency (ms)", "SHRM (ms)", "ratio",
        "at least the paper's",
    )  # fmt: skip
    return f"""
## Table 5.5: microfacet, {VIEW_COUNT} x {VIEW_COUNT} maps, six faces of {size} x {size}

Orders for eps = .03. The angular side was timed for one of the {VIEW_COUNT**2} maps, drawn at
random, and scaled. {_texels(size)}

{table(head, body)}"""


def figure_4_1(file: str, error: float, largest: float, names: Sequence[str]) -> str:
    """Write the part on figure 4.1, a scene of diffuse things."""
    probe, mesh = names
    return f"""
## Figure 4.1: diffuse shading by nine coefficients, under `{probe}`

A mirror, a white ball and {mesh} on a white table, and a ball with a texture that is glossy, too:
a split sum beside the irradiance, as game engines have it. Above, the irradiance of nine
coefficients; below, that of all of the light (degree 40). Where something diffuse is seen the
pictures differ by {error:.1%} (relative RMS), at most by {largest:.1%} of the mean. Nothing casts a
shadow, as in the thesis.

![a scene of diffuse things]({file})
"""


def figure_5_4(
    file: str, of_lights: Sequence[int], of_lobes: Sequence[int], of_both: Sequence[Sequence[int]]
) -> str:
    """Write the part on figure 5.4, the highest frequencies of light, BRDF and reflected light."""
    names = ["sharp" if each is None else f"by s = {each}" for each in BLURS]
    head = ("light", "F of the light", *(f"Phong, s = {each}" for each in LOBES_5_4))
    body = [("F of the BRDF", "", *map(str, of_lobes))]
    body += [
        (name, f"{own}", *map(str, row))
        for name, own, row in zip(names, of_lights, of_both, strict=True)
    ]
    return f"""
## Figure 5.4: the highest frequencies of light, BRDF and reflected light

Down the picture the light is more and more blurred; to the right the BRDF is more and more
diffuse. The table has the degrees F within which all but a hundredth of what varies lies. The
thesis: the highest frequency of the reflected light is about the lesser of those of both.

![lights and lobes]({file})

{table(head, body)}"""


def figure_5_5(file: str, probe: str) -> str:
    """Write the part on figure 5.5, the accuracy against F."""
    return f"""
## Figure 5.5: accuracy against the order F

Phong, s = 32, under `{Path(probe).name}` (the paper has the Grace Cathedral). Both estimates are
conservative; the one by the BRDF's error alone is what `--eps` uses.

![accuracy against F]({file})
"""


def figure_5_6(file: str, rows: Sequence[tuple[int, float, float, float]]) -> str:
    """Write the part on figure 5.6, pictures for P = 0 .. 5."""
    body = [
        (f"{p}", f"{captured:.1%}", f"{predicted:.1%}", f"{pictured:.1%}")
        for p, captured, predicted, pictured in rows
    ]
    head = ("P", "BRDF energy", "predicted relative RMS error", "of these pictures")
    return f"""
## Figure 5.6: pictures for P = 0 .. 5, microfacet sigma .2, F = 30

The paper: P = 2 suffices for eps < .03. Differences are not amplified.

![spheres for P = 0 .. 5]({file})

{table(head, body)}"""


def figure_5_7(rows: Sequence[tuple[str, NDArray[np.floating]]]) -> str:
    """Write the part on figure 5.7, the energy of BRDFs within the orders F and P."""
    good = sum(captured[-1] > CAPTURED_5_7 for _, captured in rows)
    head = ("BRDF", *(f"P = {p}" for p in range(len(rows[0][1]))))
    body = [(spec, *(f"{each:.1%}" for each in captured)) for spec, captured in rows]
    return f"""
## Figure 5.7: energy of BRDFs within F = {ORDER_F} and P = 0 .. {MOST_P}

The paper has the 61 materials of the CUReT database, whose measurements are not at hand. They are
replaced by the materials of the table: Lafortune's fits to six measured ones, and models, each
about its own central direction (the paper takes the mirror direction for all). In the paper P = 5
captures more than {CAPTURED_5_7:.0%} of 56 of the 61 materials, and the other five are anisotropic;
here it does of {good} of {len(rows)}.

{table(head, body)}"""


def figure_5_8(file: str, methods: Sequence[Method]) -> str:
    """Write the part on figure 5.8, Kautz and McCool's method."""
    return f"""
## Figure 5.8: the SHRM and Kautz and McCool's 3D texture at equal storage

The paper shows CUReT's velvet with P = 5. Its measurements are not at hand either, and velvet is
replaced by a microfacet lobe of sigma .5, whose dependence on the azimuth the 3D texture leaves out
as well. Differences are not amplified.

![sphere: exact, SHRM, Kautz-McCool]({file})

{_methods(methods)}"""


def figure_5_9(file: str, brdf: str, methods: Sequence[Method]) -> str:
    """Write the part on figure 5.9, Cabral's method."""
    return f"""
## Figure 5.9: the SHRM and Cabral's icosahedral interpolation, {brdf}

With no more maps than Cabral's twelve. Differences are not amplified.

![sphere: exact, SHRM, Cabral]({file})

{_methods(methods)}"""


def _methods(methods: Sequence[Method]) -> str:
    first = methods[0]
    body = [
        (
            each.name, f"{each.maps}", f"{each.expected:.2%}",
            f"{each.expected / first.expected:.1f}", f"{each.pictured:.2%}",
            f"{each.pictured / first.pictured:.1f}",
        )
        for each in methods
    ]  # fmt: skip
    head = (
        "method", "maps", "relative RMS error, all orientations and views", "times the SHRM's",
        "of these pictures", "times the SHRM's",
    )  # fmt: skip
    return table(head, body)


def _texels(size: int) -> str:
    if size == 52:
        return (
            "The texels of six such faces together are as many as the paper's maps have. So few "
            "take the frequency side\nless time than what does not depend on them, the "
            "coefficients of light and BRDF."
        )
    return "Both sides make the same texels."


def _verdict(row: Timing) -> str:
    return "yes" if row.ratio >= row.paper_ratio else "**no**"


def table(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Write a table in Markdown."""
    lines = [head, ["---"] * len(head), *body]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)
