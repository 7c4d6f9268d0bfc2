"""Figure 6: how many coefficients lobes need that are more and more specular."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from research.extent import Extent
from research.product.scenes import exposure, write_sheet
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.files.image import Picture
from shrm_cli.maps.base import Map
from shrm_cli.maps.product.product import LitProduct
from shrm_cli.maps.request import Request
from shrm_cli.prefilter import make
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer
from shrm_cli.render.comparison import compare_spheres
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.sphere.harmonics import real_harmonics
from shrm_cli.sphere.quadrature import spiral_directions

Array = NDArray[np.floating]

VIEWER = Viewer(0, 10)
MORE_POINTS = 10
"""How many times more points are drawn than for other figures. The few that see a lamp at a grazing
angle decide the error, and with few points it comes out too small."""
_MOST_TEXELS = 48
"""Texels that are enough for 225 coefficients: the cubic filter then misses a thousandth."""
_FEW_TEXELS = 8
"""Texels of textures of which nothing is used but what is known of their errors."""
_LEAST_COSINE = 0.02
"""The least N.V of the views at which errors are measured, as of those that predict them."""


@dataclass(frozen=True)
class Column:
    """A number of coefficients, n, and the window of the light."""

    count: int
    window: str = "none"

    @property
    def order(self) -> int:
        """The largest degree."""
        return round(np.sqrt(self.count)) - 1

    @property
    def name(self) -> str:
        """What the column is called."""
        return f"n = {self.count}" + ("" if self.window == "none" else ", windowed")


def columns(most: int) -> tuple[Column, ...]:
    """Return the columns of the figure: up to `most` coefficients, then as many windowed."""
    few = [Column(count) for count in (9, 25, 49) if count < most]
    return *few, Column(most), Column(most, "hann")


@dataclass(frozen=True)
class Truncated:
    """What the figure says of one lobe and one column.

    Attributes
    ----------
    exponents : tuple of 2 int
    column : Column
    predicted : float
        Relative RMS error over all orientations and views, from the coefficients.
    measured : float
        The same against brute force, at orientations and views drawn at random.
    pictured : float
        That of the picture of the sphere.
    """

    exponents: tuple[int, int]
    column: Column
    predicted: float
    measured: float
    pictured: float


def figure_6(probe: Probe, folder: Path, extent: Extent) -> tuple[str, list[Truncated]]:
    """Draw spheres of several lobes, and the light above them, by more and more coefficients.

    Parameters
    ----------
    probe : Probe
        Small, since the truth is a sum over all its pixels.
    folder : Path
    extent : Extent

    Returns
    -------
    str
        The file's name.
    list of Truncated
    """
    own = columns(extent.product_most)
    rows: list[list[tuple[Picture, str]]] = []
    found: list[Truncated] = []
    for exponents in extent.product_lobes:
        brdf = parse_spec("ashikhmin-shirley:nu={},nv={}".format(*exponents))
        texels, size = min(extent.product_texels, _MOST_TEXELS), extent.product_small
        made = _lit_textures(probe, brdf, own, texels)
        drawn = compare_spheres(Reference(probe, brdf, exact=True), made, [VIEWER], size)
        measured = measured_errors(probe, brdf, made, MORE_POINTS * extent.product_points)
        row = []
        for k, column in enumerate(own):
            pictured = drawn.difference(k).relative_rmse
            row.append((drawn.others[k, 0], f"error {pictured:.1%}"))
            # The window changes the degrees up to the order; those beyond are missed besides.
            info = made[k].info
            predicted = float(np.hypot(info.predicted_error, info.added_error))
            found.append(Truncated(exponents, column, predicted, measured[k], pictured))
        rows.append([*row, (drawn.baseline[0], "truth, AS ({}, {})".format(*exponents))])
    lights = [_light_picture(each, size) for each in made]  # of all lobes the same
    image = probe.radiance(LatLong(size // 2).directions())
    tops = [*zip(lights, (each.name for each in own), strict=True), (_framed(image), "the light")]
    stops = [exposure([tops[-1][0]]), *(exposure([row[-1][0]]) for row in rows)]
    return write_sheet(folder / "figure-6.png", [tops, *rows], stops), found


def _lit_textures(probe: Probe, brdf: Brdf, own: Sequence[Column], texels: int) -> list[LitProduct]:
    """Make the product textures of columns, of which the last one differs by its window alone."""
    made = []
    for column in own:
        size = texels if column.window == "none" else _FEW_TEXELS
        given = {"brdf": brdf, "order": column.order, "texels": size, "window": column.window}
        found = make(probe, Request.of("product", given, probe)).map
        assert isinstance(found, LitProduct)
        made.append(found)
    # The window changes the light, and what is known of errors; the texture was filled before.
    return [*made[:-1], replace(made[-2], lighting=made[-1].lighting).with_info(made[-1].info)]


def _light_picture(made: LitProduct, size: int) -> Picture:
    """Draw the light that a product texture holds, as a lat-long."""
    directions = LatLong(size // 2).directions()
    return _framed(real_harmonics(made.order, directions) @ made.lighting)


def _framed(image: Array) -> Picture:
    """Return a lat-long in the middle of a square."""
    rows, size = image.shape[:2]
    picture = np.zeros((size, size, 3), dtype=np.float32)
    picture[(size - rows) // 2 :][:rows] = image
    return picture


def random_points(count: int, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Draw normals over the sphere, tangents, and views over the hemispheres above the normals."""
    turns = np.linalg.qr(rng.standard_normal((count, 3, 3)))[0]
    normals, tangents = turns[:, 2], turns[:, 0]
    views = spiral_directions(2 * count)[count:]
    views[:, 2] = np.maximum(views[:, 2], _LEAST_COSINE)
    views /= np.linalg.norm(views, axis=1, keepdims=True)
    bitangents = np.cross(normals, tangents)
    local = np.stack([tangents, bitangents, normals], axis=1)
    return normals, tangents, np.einsum("ni,nij->nj", views, local)


def measured_errors(probe: Probe, brdf: Brdf, maps: Sequence[Map], count: int) -> list[float]:
    """Return the relative RMS errors of maps over random orientations and views.

    Parameters
    ----------
    probe : Probe
        Whose light the maps hold. The truth is a sum over all its pixels.
    brdf : Brdf
    maps : sequence of Map
    count : int
        How many orientations and views are drawn.
    """
    points = random_points(count, np.random.default_rng(6))
    exact = Reference(probe, brdf, exact=True).brushed_radiance(*points)
    return [relative(each.shaded().brushed_radiance(*points), exact) for each in maps]


def relative(found: Array, expected: Array) -> float:
    """Return the relative RMS difference."""
    return float(np.sqrt(np.sum((found - expected) ** 2) / np.sum(expected**2)))
