"""The program of `make figures`: what the pages of the theory show, as SVG files.

They are computed by the library from the shipped probes, and have the same bytes in each run of
as many threads: `make figures` takes one.
"""

from __future__ import annotations

import io
import re
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import shrm_cli as shrm
from shrm_cli import settings
from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.maps.irradiance.window import make_window, window_factors
from shrm_cli.maps.size import Band
from shrm_cli.orders import known_coefficients
from shrm_cli.probe.open import open_probe
from shrm_cli.sphere.harmonics import degrees, real_harmonics
from shrm_cli.sphere.quadrature import spiral_directions

PROBES = Path(__file__).parents[2] / "probes"
_GREY = "#808080"
"""It is seen on white pages and on dark ones."""


def main(folder: Path) -> None:
    """Draw all figures into a folder."""
    style = {
        "svg.hashsalt": "shrm", "svg.fonttype": "none", "font.size": 9,
        "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
    }  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(style), warnings.catch_warnings(), settings.using(threads=1):
        warnings.simplefilter("ignore", shrm.ShrmWarning)  # maps of too few orders are the subject
        for name, draw in FIGURES.items():
            figure = Figure(figsize=(6, 3.2), layout="constrained")
            draw(figure)
            drawn = io.StringIO()
            figure.savefig(drawn, format="svg", metadata={"Date": None}, facecolor="white")
            (folder / f"{name}.svg").write_text(steady(drawn.getvalue()), encoding="utf-8")


def steady(svg: str) -> str:
    """Return a figure without last bits, which are not the same everywhere.

    Coordinates are rounded to a hundredth of a point. Clips are called by their order, in place of
    a digest of their bits.
    """
    svg = re.sub(r"-?\d+\.\d{3,}", lambda found: f"{round(float(found[0]), 2) + 0:g}", svg)
    for number, name in enumerate(re.findall(r'<clipPath id="(\w+)"', svg), 1):
        svg = re.sub(rf"\b{name}\b", f"clip{number}", svg)
    return svg


def energies(figure: Figure) -> None:
    """Draw which part of a BRDF's energy is missed by the orders up to F."""
    axes = figure.subplots()
    for spec in ("lambertian", "phong:exponent=32", "microfacet:sigma=0.2", "ggx:roughness=0.5"):
        captured = known_coefficients(shrm.parse_spec(spec), 0.001).captured[:, -1]
        axes.semilogy(np.maximum(1 - captured, 1e-6), label=spec)
    axes.axhline(0.03, color=_GREY, lw=0.8, ls=":")
    axes.set(xlabel="order F", ylabel="energy missed", xlim=(0, 60), ylim=(1e-4, 1))
    axes.legend()


def parseval(figure: Figure) -> None:
    """Draw errors of truncated maps as predicted, and as measured among directions."""
    axes = figure.subplots()
    spec, orders = "phong:exponent=32", [1, 2, 3, 4, 6, 8, 10, 12, 14]
    directions = spiral_directions(4000)
    for probe, color in (("studio", "C0"), ("sky", "C1")):
        light = open_probe(PROBES / f"{probe}.exr")
        # More texels than a map takes by default, so that filtering plays no part.
        maps = [
            shrm.prefilter(light, spec, to="shrm", order_f=order, size=128)
            for order in (*orders, 48)
        ]
        *shown, whole = (each.radiance(directions, directions) for each in maps)
        measured = [np.sqrt(np.mean((each - whole) ** 2) / np.mean(whole**2)) for each in shown]
        predicted = [each.info.predicted_error for each in maps[:-1]]
        axes.semilogy(orders, predicted, color=color, label=f"{probe}, predicted")
        axes.semilogy(orders, measured, "o", color=color, label="measured")
    axes.set(xlabel="order F", ylabel="relative RMS error")
    axes.legend()


def carried(figure: Figure) -> None:
    """Draw reflected light around a sun, of maps that end at F and of those that go on."""
    axes = figure.subplots()
    angles, directions = _through_the_sun("sky")
    for label, options in (
        ("ends at F = 11", {"order_f": 11}),
        ("carried on, in as many texels", {}),
    ):
        size = shrm.prefilter(PROBES / "sky.exr", "phong:exponent=64", eps=0.03).size
        map_ = shrm.prefilter(
            PROBES / "sky.exr", "phong:exponent=64", to="shrm", size=size, **options
        )
        axes.plot(angles, map_.radiance(directions, directions)[:, 1], label=label)
    axes.axhline(0, color=_GREY, lw=0.8)
    axes.set(xlabel="degrees from the sun", ylabel="reflected radiance", yscale="symlog")
    axes.legend()


def principal(figure: Figure) -> None:
    """Draw the error of as many cubes of an SHRM and of principal functions."""
    axes, functions = figure.subplots(1, 2)
    probe, spec = open_probe(PROBES / "studio.exr"), "ggx:roughness=0.5"
    squares = np.arange(1, 7)
    maps = [shrm.prefilter(probe, spec, to="principal", maps=int(n**2), size=32) for n in squares]
    axes.semilogy(squares**2, [each.info.predicted_error for each in maps], "o-", label="principal")
    maps = [shrm.prefilter(probe, spec, to="shrm", order_p=int(n - 1), size=32) for n in squares]
    axes.semilogy(squares**2, [each.info.predicted_error for each in maps], "s-", label="SHRM")
    axes.set(xlabel="cubes", ylabel="predicted relative RMS error")
    axes.legend()
    lobe = shrm.prefilter(probe, spec, to="principal", maps=3, size=16).lobes[0]
    angles = np.linspace(0, 180, lobe.functions.shape[1])
    for q, curve in enumerate(lobe.functions[:, :, 1]):
        functions.plot(angles, curve, label=f"the first of q = {q}")
    functions.set(xlabel="degrees from R to V")
    functions.legend()


def windows(figure: Figure) -> None:
    """Draw what windows do to the irradiance of nine coefficients under a lamp."""
    axes = figure.subplots()
    angles, directions = _through_the_sun("impulse")
    made = shrm.prefilter(PROBES / "impulse.exr", to="irradiance", window="none")
    series = lambert_factors(2)[degrees(2), None] * made.coefficients
    for spec in ("none", "hann", "lanczos", "auto"):
        values = real_harmonics(2, directions) @ make_window(spec, series).apply(series)
        axes.plot(angles, values[:, 1], label="least" if spec == "auto" else spec)
    axes.axhline(0, color=_GREY, lw=0.8)
    axes.set(xlabel="degrees of the normal from the lamp", ylabel="irradiance")
    axes.legend()


def factors(figure: Figure) -> None:
    """Draw the factors by which series end."""
    axes = figure.subplots()
    order = 20
    for name in ("hann", "lanczos"):
        axes.plot(window_factors(name, order + 1.0, order), ".-", label=name)
    axes.plot(Band(int(0.8 * order), order).factors, ".-", label="end of a map's orders")
    axes.set(xlabel="degree l", ylabel="factor")
    axes.legend()


def _through_the_sun(probe: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return angles and directions of a great circle through the brightest place of a probe."""
    irradiance = shrm.prefilter(PROBES / f"{probe}.exr", to="irradiance", order_f=1)
    y, z, x = irradiance.coefficients[1:4].mean(axis=1)
    sun = np.array([x, y, z]) / np.linalg.norm([x, y, z])
    across = np.cross(sun, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    angles = np.linspace(-180, 180, 721)
    turned = np.radians(angles)[:, None]
    return angles, np.cos(turned) * sun + np.sin(turned) * across


FIGURES: dict[str, Callable[[Figure], None]] = {
    "energies": energies,
    "parseval": parseval,
    "carried": carried,
    "principal": principal,
    "windows": windows,
    "factors": factors,
}
"""Each figure's name, and what draws it."""

if __name__ == "__main__":
    main(Path(sys.argv[1]))
