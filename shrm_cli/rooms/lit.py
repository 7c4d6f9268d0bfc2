"""Surfaces in a room, each point of which is under the light of the probes about it.

Coefficients of light are interpolated between probes for the place and the normal of a point, and
the surface is shaded with them as with those of a single probe: white and diffuse, or by the
product texture of any BRDF.

References: Kautz, Sloan and Snyder 2002, "Fast, Arbitrary BRDF Shading for Low-Frequency Lighting
Using Spherical Harmonics", section 4: "an incident light field which interpolates lighting sampled
at various points around the object".
"""

import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, slices
from shrm_cli.errors import MapError
from shrm_cli.maps.base import Map
from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.kinds import BrushedLight, FixedMap, MaterialMap, ReflectionMap
from shrm_cli.maps.product.product import ProductMap
from shrm_cli.probe.proxy import ProxyBox
from shrm_cli.records import record
from shrm_cli.rooms.grid import Lattice, ProbeGrid, as_grid
from shrm_cli.sphere.harmonics import degrees
from shrm_cli.vocabulary import Center, Frame, Sampling

_POINTS_AT_ONCE = 2**14
"""Points whose light is interpolated at a time."""
_WINDOWS = 3
"""The most parts along each axis of a grid for whose light a window is sought."""
_WITHIN = 0.5 + 1e-9
"""How far points of such a part are from its middle at most, in units of its edges."""
_DARK = 1e-30


_UP = np.array([0.0, 1, 0])


STAYS = (
    "the light of a grid of probes stays where it is; leave out what moves it, or take a map of "
    "one place"
)
"""What whoever moves the light is told."""


@record(eq=False)
class InGrid(BrushedLight, FixedMap, ReflectionMap):
    """What white diffuse surfaces reflect in a grid of probes.

    Without a place they are in the middle of the grid, whose box is the proxy box of the `info`.
    """

    grid: ProbeGrid
    name: str
    """The name of the grid's file."""

    representation = "grid"
    frame: ClassVar[Frame] = "global"
    center: ClassVar[Center] = "normal"
    sampling: ClassVar[Sampling] = "center"
    size: ClassVar[int] = 1
    is_white: ClassVar[bool] = True

    @property
    def what(self) -> str:
        return "a grid of probes"

    @cached_property
    def info(self) -> MapInfo:
        """What is known of the grid; its order is that of the light."""
        lattice = self.grid.lattice
        box = ProxyBox.of(lattice.low, lattice.high)
        return MapInfo(
            self.grid.order, 0, 0.0, 1.0, 0.0, {"name": "lambertian", "parameters": {}}, self.name,
            chromaticities=self.grid.chromaticities, options={"reading": {"proxy": box.record()}},
        )  # fmt: skip

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        return self.varied_radiance(normals, tangents, views, 0.5)

    def varied_radiance(
        self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike, shares: ArrayLike
    ) -> Array:
        lattice = self.grid.lattice
        return self.placed_radiance(
            (lattice.low + lattice.high) / 2, normals, tangents, views, shares
        )

    def placed_radiance(
        self,
        points: ArrayLike,
        normals: ArrayLike,
        tangents: ArrayLike,
        views: ArrayLike,
        shares: ArrayLike = 0.5,
    ) -> Array:
        """Evaluate what surfaces reflect at points of the room, shape (..., 3).

        `points`, of shape (..., 3), broadcastable, are in world axes; the other parameters are
        those of `ReflectedLight.varied_radiance`.
        """
        given = (np.asarray(each, dtype=float) for each in (points, normals, tangents, views))
        places, *vectors = np.broadcast_arrays(*given)
        flat = [each.reshape(-1, 3) for each in (places, *vectors)]
        share = np.asarray(shares, dtype=float)
        result = np.empty_like(flat[0])
        for part in slices(len(result), _POINTS_AT_ONCE):
            own = share if share.ndim == 0 else share.reshape(len(result), -1)[part]
            point, normal, tangent, view = (each[part] for each in flat)
            result[part] = self._of_points(point, normal, tangent, view, own)
        return result.reshape(places.shape)

    def light(self, points: Array, normals: Array, order: int) -> Array:
        """Return the coefficients of the light of surfaces, as `ProbeGrid.light` does."""
        return self.grid.light(points, normals, order)

    def _of_points(
        self, points: Array, normals: Array, tangents: Array, views: Array, shares: Array
    ) -> Array:
        """Return what `placed_radiance` does of points, shape (n, 3)."""
        return self.grid.irradiance(points, normals) / np.pi


@record(eq=False)
class ProductInGrid(InGrid):
    """What surfaces of a product texture reflect in a grid of probes."""

    product: ProductMap
    windows: tuple[Lattice, Array] | None = None
    """Some places, and by what the light there is multiplied, degree by degree, shape (places,
    order+1)."""

    representation = "product"
    is_white: ClassVar[bool] = False

    @cached_property
    def info(self) -> MapInfo:
        """How the product texture was made, with what is known of the grid."""
        grid, made = InGrid(self.grid, self.name).info, self.product.info
        options = {**made.options, **grid.options}
        return replace(made, probe=self.name, chromaticities=grid.chromaticities, options=options)

    @property
    def what(self) -> str:
        return self.product.what

    @property
    def ways(self) -> Mapping[str, tuple[float, float]]:
        return self.product.ways

    def with_values(self, values: Mapping[str, float]) -> "ProductInGrid":
        return replace(self, product=self.product.at(self.shares(values)))

    def light(self, points: Array, normals: Array, order: int) -> Array:
        """Return windowed coefficients of the light, at most to the product texture's order."""
        order = min(order, self.product.order)
        light = self.grid.light(points, normals, order)
        if self.windows is None:
            return light
        lattice, factors = self.windows
        places, shares = lattice.corners(points)
        by_degree = np.einsum("nk,nkl->nl", shares, factors[places])
        return light * by_degree[:, degrees(order), None]

    def _of_points(
        self, points: Array, normals: Array, tangents: Array, views: Array, shares: Array
    ) -> Array:
        light = self.light(points, normals, self.product.order)
        return self.product.reflected(light, (normals, tangents, views), shares)


def in_grid(material: MaterialMap, grid: ProbeGrid, window: str) -> tuple[ProductInGrid, float]:
    """Return a product texture under the light of a grid, windowed as `shrm render --window` says.

    A window for each point's own light would take a tenth of a second. So windows are sought for
    the light of a few probes, of which each part of the grid has one, and between these their
    factors are interpolated.

    The second result is by how much a window changes what is reflected, RMS, at most.
    """
    black = material.lit(np.zeros(((material.info.order_f + 1) ** 2, 3))).harmonic_light
    product = None if black is None else black.product
    if product is None:
        raise MapError(f"{material.what} has no coefficients for the light of a grid of probes")
    lattice, order = grid.lattice, product.order
    few = Lattice(lattice.low, lattice.high, tuple(min(n, _WINDOWS) for n in lattice.shape))  # type: ignore[arg-type]
    places = lattice.points()
    factors, change = np.ones((few.count, order + 1)), 0.0
    for own, probe in zip(factors, _most_directed(grid, few), strict=False):
        (series,) = grid.light(places[probe][None], _UP[None], order)
        found = product.window(window, series)
        own[:] = found.factors or 1.0
        change = max(change, found.change)
    windows = (few, factors) if change else None
    return ProductInGrid(grid, product.info.probe, product, windows), change


def _most_directed(grid: ProbeGrid, few: Lattice) -> Iterator[int]:
    """Yield the probe in each cell of another lattice whose light is the least even.

    It needs the strongest window. Of a cell without probes that count, the nearest one is meant.
    """
    living = np.flatnonzero(grid.alive)
    if not len(living):
        return
    places, light = grid.lattice.points()[living], grid.coefficients[living].sum(axis=2)
    directed = np.linalg.norm(light[:, 1:4], axis=1) / np.maximum(light[:, 0], _DARK)
    for middle in few.points():
        away = np.abs((places - middle) / few.spacing).max(axis=1)
        within = away <= max(_WITHIN, away.min())
        yield int(living[np.argmax(np.where(within, directed, -1))])


def open_lit(path: str | os.PathLike[str]) -> Map:
    """Open a map, or a grid of probes, which lights white diffuse surfaces.

    Raises
    ------
    MapError, MeshError
        If the file is neither, or is damaged.
    """
    grid = as_grid(path)
    return open_map(path) if grid is None else InGrid(grid, Path(path).name)
