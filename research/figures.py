"""Figures 5.4 to 5.9: curves, pictures, and the errors of the methods.

They are figures of chapter 5 of Ramamoorthi's thesis, "A Signal-Processing Framework for Forward
and Inverse Rendering" (2002).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from research.extent import Extent
from shrm_cli.analysis.analyze import accuracy_curve, energy_grid, order_pictures
from shrm_cli.analysis.plots import plot_accuracy
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.files.image import write_picture
from shrm_cli.maps.base import Map
from shrm_cli.maps.explicit.views import Cabral, KautzMcCool
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import Reference
from shrm_cli.reflected import predicted_error
from shrm_cli.render.camera import Viewer
from shrm_cli.render.comparison import compare_spheres
from shrm_cli.render.drawing import SphereSubject
from shrm_cli.render.image import expose
from shrm_cli.render.sheet import Grid, draw_grid
from shrm_cli.sphere.harmonics import degrees

Array = NDArray[np.floating]

ORDER_F = 30
MOST_P = 5
"""The orders of figures 5.6 and 5.7."""
_VIEWERS = (Viewer(20, 15), Viewer(140, -10))


@dataclass(frozen=True)
class Method:
    """The storage and the errors of one method for one BRDF.

    Attributes
    ----------
    name : str
    maps : int
        The number of RGB cubes that it stores.
    expected : float
        Relative RMS error of the reflected light over all orientations and views, from the
        coefficients (Parseval), against light known to the orders `Extent.known`.
    pictured : float
        Relative RMS error of the pictures, against brute-force integration.
    """

    name: str
    maps: int
    expected: float
    pictured: float


BLURS = None, 32, 8, 2
"""Exponents of the Phong lobes that the light of figure 5.4 is blurred by; None for not at all."""
LOBES_5_4 = 128, 32, 8, 2
"""Exponents of its BRDFs."""
_MOST_OF_IT = 0.99
"""The part of what varies that lies within the highest frequency."""


def figure_5_4(
    probe: Probe, folder: Path, extent: Extent
) -> tuple[str, list[int], list[int], list[list[int]]]:
    """Draw spheres of more and more diffuse lobes, under light that is more and more blurred.

    Returns
    -------
    str
        The file's name.
    list of int
        The highest degree of each light, within which all but a hundredth of its energy lies, the
        mean aside.
    list of int
        That of each BRDF, which is the one of its reflection of a distant point.
    list of list of int
        That of the reflected light: a row for each light, of a number for each BRDF.
    """
    order, _, size = extent.known
    light = project(probe, order).coefficients
    degree = degrees(order)
    lobes = [compute_coefficients(parse_spec(f"phong:exponent={s}"), order, 0) for s in LOBES_5_4]
    # A distant point has as much light in each degree as the degree has harmonics.
    point = np.sqrt(2 * np.arange(order + 1) + 1)
    of_lobes = [_highest((point * _kernel(each)) ** 2) for each in lobes]
    info, viewer, tiles = MapInfo(order, 0, 0.0, 0.0, 0.0), _VIEWERS[0], []
    subject = SphereSubject(extent.picture)
    of_lights: list[int] = []
    of_both: list[list[int]] = []
    for row, blur in enumerate(BLURS):
        blurred = light if blur is None else light * _gauss(blur, degree)[:, None]
        of_lights.append(_highest(np.bincount(degree, (blurred**2).sum(axis=1))))
        of_both.append([])
        for column, lobe in enumerate(lobes):
            made = Shrm.from_coefficients(
                blurred, lobe.values, "reflection", info, size, dtype=np.float32
            )
            drawn = subject.draw(made, viewer, None, None)
            tiles.append((row, column, drawn))
            reflected = blurred * _kernel(lobe)[degree][:, None]
            of_both[-1].append(_highest(np.bincount(degree, (reflected**2).sum(axis=1))))
    stops = -np.log2(max(np.percentile(tiles[0][2].max(axis=-1), 97), 1e-6))
    names = [f"s = {each}" for each in LOBES_5_4], [_blurred_by(each) for each in BLURS]
    grid = Grid(len(BLURS), len(lobes), extent.picture)
    shown = [(row, column, expose(each, float(stops))) for row, column, each in tiles]
    write_picture(folder / "figure-5.4.png", draw_grid(grid, *names, shown))
    return "figure-5.4.png", of_lights, of_lobes, of_both


def _blurred_by(exponent: int | None) -> str:
    return "sharp light" if exponent is None else f"by s = {exponent}"


def _gauss(exponent: int, degree: NDArray[np.int64]) -> Array:
    """Return by what a Gaussian damps degrees that is as wide as a Phong lobe of an exponent."""
    return np.exp(-degree * (degree + 1) / (2 * exponent))


def _kernel(lobe: BrdfCoefficients) -> Array:
    """Return by what a radially symmetric lobe damps the degrees of light, shape (F+1,)."""
    values = lobe.values[:, 0, 0, 0]
    found = values / np.sqrt(2 * np.arange(len(values)) + 1)
    return found / found[0]


def _highest(energy: Array) -> int:
    """Return the degree within which nearly all energy beyond degree 0 lies."""
    share = np.cumsum(energy[1:]) / max(energy[1:].sum(), np.finfo(float).tiny)
    return 1 + int(np.searchsorted(share, _MOST_OF_IT))


def figure_5_5(probe: Probe, folder: Path) -> str:
    """Plot the accuracy for a Phong lobe, s = 32, against F, and return the file's name."""
    grid = energy_grid(parse_spec("phong:exponent=32"), [0.01], ORDER_F)
    lighting = project(probe, grid.coefficients.order_f)
    curve = accuracy_curve(lighting, grid.coefficients, ORDER_F, 0)
    curves = {
        key: getattr(curve, key)
        for key in ("accuracy", "estimate_minimum", "estimate_brdf", "estimate_bound")
    }
    plot_accuracy(folder / "figure-5.5.png", curves, 0, f"phong, s = 32, {Path(probe.name).stem}")
    return "figure-5.5.png"


def figure_5_6(
    probe: Probe, folder: Path, extent: Extent
) -> tuple[str, list[tuple[int, float, float, float]]]:
    """Draw pictures for P = 0 .. 5 and the truth; return the file's name and the rows of a table.

    A row holds P, the captured fraction of the BRDF's energy, and the predicted and the pictured
    relative RMS error.
    """
    brdf = parse_spec("microfacet:sigma=0.2")
    coefficients = compute_coefficients(brdf, 64, 8)
    lighting = project(probe, 64)
    truth = Reference(probe, brdf, extent.source_rows, exact=True)
    pictures = order_pictures(
        lighting, coefficients, brdf.center, _VIEWERS, ORDER_F, extent.picture, truth
    )
    sheet = pictures.sheet(pictures.exposure())
    write_picture(folder / "figure-5.6.png", sheet)
    rows = [
        (
            p,
            float(captured),
            float(pictures.predicted_errors[p]),
            float(np.mean([pictures.error(p, view) or 0.0 for view in range(len(_VIEWERS))])),
        )
        for p, captured in enumerate(pictures.captured)
    ]
    return "figure-5.6.png", rows


def figure_5_7(specs: Sequence[str]) -> list[tuple[str, Array]]:
    """Return the energy of BRDFs within F = 30 and each P = 0 .. 5, beside their specifications."""
    rows = []
    for spec in specs:
        captured = compute_coefficients(parse_spec(spec), ORDER_F, MOST_P).captured[ORDER_F]
        rows.append((spec, np.pad(captured, (0, MOST_P + 1 - len(captured)), mode="edge")))
    return rows


def figure_5_8(probe: Probe, folder: Path, extent: Extent) -> tuple[str, list[Method]]:
    """Draw Kautz and McCool's 3D texture beside an SHRM of as many maps: microfacet, sigma .5."""
    brdf = parse_spec("microfacet:sigma=0.5")
    light, coefficients, whole = _known(probe, brdf, extent)
    shrm = whole.truncated(5)
    texture = KautzMcCool.from_shrm(whole, shrm.cube_count)
    return _compare(folder / "figure-5.8.png", probe, brdf, extent, [
        ("SHRM, P = 5", shrm, predicted_error(light, coefficients, extent.known[0], 5)),
        ("Kautz-McCool", texture, texture.info.added_error),
    ])  # fmt: skip


def figure_5_9(
    probe: Probe, folder: Path, brdf: Brdf, order_p: int, name: str, extent: Extent
) -> tuple[str, list[Method]]:
    """Draw Cabral's icosahedral interpolation beside an SHRM with no more maps."""
    light, coefficients, whole = _known(probe, brdf, extent)
    shrm = whole.truncated(order_p)
    if coefficients.azimuth_free:
        shrm = _without_azimuth(shrm)
    twelve = Cabral.from_shrm(whole)
    return _compare(folder / name, probe, brdf, extent, [
        (f"SHRM, P = {order_p}", shrm,
         predicted_error(light, coefficients, extent.known[0], order_p)),
        ("Cabral", twelve, twelve.info.added_error),
    ])  # fmt: skip


LOBES_5_9: tuple[tuple[Brdf, int, str], ...] = (
    (parse_spec("kajiya-kay:exponent=32"), 11, "figure-5.9-kajiya-kay.png"),
    (parse_spec("microfacet:sigma=0.2"), 2, "figure-5.9-microfacet.png"),
)
"""The BRDFs of figure 5.9, each with P of an SHRM of twelve maps or less, and a picture's name."""


def _known(probe: Probe, brdf: Brdf, extent: Extent) -> tuple[Lighting, BrdfCoefficients, Shrm]:
    """Compute light, BRDF and SHRM to orders beyond which nothing counts."""
    order_f, order_p, size = extent.known
    coefficients = compute_coefficients(brdf, order_f, order_p, accuracy=1e-3)
    lighting = project(probe, order_f)
    info = MapInfo(order_f, order_p, 0.0, 0.0, 0.0)
    whole = Shrm.from_coefficients(
        lighting.coefficients, coefficients.values, brdf.center, info, size, dtype=np.float32
    )
    return lighting, coefficients, whole


def _without_azimuth(shrm: Shrm) -> Shrm:
    """Keep the P + 1 local maps with q = 0, for a BRDF whose other maps are rounding alone."""
    local = shrm.to_frame("local")
    zonal = [q == 0 for p in range(local.order_p + 1) for q in range(-p, p + 1)]
    return replace(local, coefficients=local.coefficients * np.array(zonal)[:, None])


def _compare(
    path: Path, probe: Probe, brdf: Brdf, extent: Extent, methods: list[tuple[str, Map, float]]
) -> tuple[str, list[Method]]:
    truth = Reference(probe, brdf, extent.source_rows, exact=True)
    maps = [each for _, each, _ in methods]
    comparison = compare_spheres(truth, maps, _VIEWERS, extent.picture)
    names = [f"{name}, {each.cube_count} maps" for name, each, _ in methods]
    peak = np.percentile(comparison.baseline.max(axis=-1), 97)
    write_picture(path, comparison.picture("exact", names, float(-np.log2(max(peak, 1e-6)))))
    return path.name, [
        Method(name, each.cube_count, expected, comparison.difference(k).relative_rmse)
        for k, (name, each, expected) in enumerate(methods)
    ]
