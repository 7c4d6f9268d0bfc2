"""Figures 2 and 4: what product textures hold, and materials that vary over a surface."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from research.extent import Extent
from research.product.scenes import Shot, exposure, vase, write_sheet
from shrm_cli.brdf.product import ProductFunctions
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.files.image import Picture
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.irradiance.window import make_window
from shrm_cli.maps.product.prefilter import product_table
from shrm_cli.maps.product.product import ProductTexture, VaryingProduct
from shrm_cli.maps.product.steps import Steps
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.render.camera import Viewer
from shrm_cli.render.sheet import PAPER
from shrm_cli.render.variation import Variation
from shrm_cli.sphere.harmonics import degrees
from shrm_cli.sphere.parabolic import parabolic_directions
from shrm_cli.sphere.quadrature import spiral_directions

Array = NDArray[np.floating]

ORDER = 4
"""The order of all figures but the sixth: 25 coefficients."""
EXAMPLE = "ashikhmin-shirley:nu=24,nv=8"
"""The BRDF of figure 2. The paper does not name its exponents; these are of its figure 6."""
_VIEWS = 256
"""Views, spread evenly over the hemisphere, over which energies are summed."""


@cache
def texture(spec: str, texels: int) -> ProductTexture:
    """Return the product texture of a BRDF, without light and without its predicted errors."""
    brdf = parse_spec(spec)
    functions = ProductFunctions.of(brdf, ORDER)
    table = product_table(brdf, functions, ORDER, texels)
    return ProductTexture(table, MapInfo(ORDER, 0, 0.0, 0.0, 0.0))


def light_of(probe: Probe) -> Array:
    """Return coefficients of a probe, shape (25, 3), windowed so that nothing is negative."""
    series = project(probe, ORDER).coefficients
    return make_window("auto", series).apply(series)


def energy_of(spec: str) -> Array:
    """Return the energy of each band over all views, as a part of all of the product functions'."""
    views = spiral_directions(2 * _VIEWS)[_VIEWS:]
    coefficients, energy = ProductFunctions.of(parse_spec(spec), ORDER).expanded(views, ORDER)
    squares = np.sum(coefficients**2, axis=(0, 2))
    return np.bincount(degrees(ORDER), squares) / energy.sum()


def figure_2(folder: Path, extent: Extent) -> tuple[str, Array]:
    """Draw the components and the squared energy of the bands of a product texture.

    Returns
    -------
    str
        The file's name.
    ndarray, shape (order+1,)
        The energy of each band over all views, as a part of that of the product functions.
    """
    size = extent.product_small
    found = texture(EXAMPLE, extent.product_texels).values(parabolic_directions(size))
    table = found.mean(axis=-1)[::-1]  # the rows of a picture go down
    off = solid_angles(size)[::-1] == 0
    table[off] = 0
    bands = [np.flatnonzero(degrees(ORDER) == degree) for degree in range(ORDER + 1)]
    squares = [np.sum(table[..., band] ** 2, axis=-1) for band in bands]
    blank = np.full((size, size, 3), PAPER, np.float32)
    rows = []
    for degree, band in enumerate(bands):
        row = [(blank, "")] * (2 * ORDER + 2)
        for m, index in zip(range(-degree, degree + 1), band, strict=True):
            row[ORDER + m] = (
                _signed(table[..., index] / np.abs(table).max(), off),
                f"l {degree}, m {m}",
            )
        grey = np.repeat(squares[degree][..., None] / np.max(squares), 3, axis=-1)
        row[-1] = (_off_circle(grey, off), f"band {degree}")
        rows.append(row)
    name = write_sheet(folder / "figure-2.png", rows, [0.0] * len(rows))
    return name, energy_of(EXAMPLE)


def _signed(values: Array, off: NDArray[np.bool_]) -> Picture:
    """Show numbers from -1 to 1: those above 0 red, those below it blue."""
    red, blue = np.maximum(values, 0), np.maximum(-values, 0)
    return _off_circle(np.stack([red, np.zeros_like(red), blue], axis=-1), off)


def _off_circle(picture: Array, off: NDArray[np.bool_]) -> Picture:
    """Return a picture that is paper where there are no directions of the hemisphere."""
    return np.where(off[..., None], PAPER, picture).astype(np.float32)


@dataclass(frozen=True)
class Varied:
    """What figure 4 says of one parameter.

    Attributes
    ----------
    what : str
    brdfs : str
        The BRDFs between which the surface varies.
    expected : float
        Relative RMS error that linear interpolation between the textures makes, at the values
        midway between theirs, of the product functions of all views.
    """

    what: str
    brdfs: str
    expected: float


def figure_4(probe: Probe, folder: Path, extent: Extent) -> tuple[str, list[Varied]]:
    """Draw a vase whose exponent varies, and one whose anisotropy does."""
    light = light_of(probe)
    shot = Shot(vase(extent.product_rows), Viewer(0, 15), extent.product_picture)
    # An isotropic lobe whose exponent changes in both directions, and one that stays in one.
    values, texels = extent.product_exponents, extent.product_texels
    cases = {
        "exponent": "ashikhmin-shirley:nu={0:g}",
        "anisotropy": f"ashikhmin-shirley:nu={values[-1]:g},nv={{0:g}}",
    }
    rows, found = [], []
    for what, spec in cases.items():
        varying = VaryingProduct.of(
            [texture(spec.format(each), texels) for each in values], Steps.of_one(what, values)
        )
        lit = varying.lit(light)
        shown = {
            f"{values[0]:g} everywhere": shot.picture(varying.textures[0].lit(light)),
            f"varying {what}": shot.picture(lit, Variation()),
            f"{values[-1]:g} everywhere": shot.picture(varying.textures[-1].lit(light)),
        }
        rows.append([(picture, label) for label, picture in shown.items()])
        ends = ", ".join(f"`{spec.format(each)}`" for each in (values[0], values[-1]))
        found.append(Varied(f"varying {what}", ends, _between(varying, spec, texels)))
    stops = exposure([picture for row in rows for picture, _ in row])
    return write_sheet(folder / "figure-4.png", rows, [stops] * len(rows)), found


def _between(varying: VaryingProduct, spec: str, texels: int) -> float:
    """Return the relative RMS error of interpolated textures midway between two of them."""
    weights = solid_angles(texels)[..., None, None]
    wrong = whole = 0.0
    (values,) = varying.steps.values.values()
    pairs = zip(varying.textures, varying.textures[1:], values, values[1:], strict=False)
    for lower, upper, low, high in pairs:
        exact = texture(spec.format((low + high) / 2), texels).table
        error = (lower.table + upper.table) / 2 - exact
        wrong += float(np.sum(weights * error**2))
        whole += float(np.sum(weights * exact**2))
    return float(np.sqrt(wrong / whole))


def solid_angles(size):
    """Return the solid angles of texels, shape (size, size), by their middles; 0 off the circle."""
    at = (2 * np.arange(size) + 1) / size - 1
    square = at**2 + at[:, None] ** 2
    return np.where(square < 1, 4 / (1 + square) ** 2 * (2 / size) ** 2, 0.0)
