"""Sums of probes, circular lights and harmonics, which are one probe to all that takes probes.

Harmonic coefficients of a sum are sums, so that discs and light that is given by its coefficients
are exact there (`shrm_cli.probe.lighting`). What needs pixels gets those of a lat-long, on which
the light of each disc is spread over the pixels that it covers, and a series is negative nowhere
(`shrm_cli.probe.nonnegative`).
"""

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.color import conversion, same_primaries, title_of
from shrm_cli.errors import ProbeError
from shrm_cli.probe.disc import Disc, disc_rows
from shrm_cli.probe.make import latlong_solid_angles
from shrm_cli.probe.pixels import Block, PixelPolicy, PixelReport
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.progress import using
from shrm_cli.records import record
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.sphere.harmonics import order_of
from shrm_cli.vocabulary import COARSE_ROWS, MAX_ORDER_F

if TYPE_CHECKING:
    from shrm_cli.probe.nonnegative import PositivePart
    from shrm_cli.probe.proxy import ProxyBox

_LEAST_ROWS, _MOST_ROWS = 512, 2048
"""The range of the rows of the lat-long; within it, those of the finest probe are taken."""


@record(eq=False)
class Term:
    """A probe that is part of a sum."""

    probe: Probe
    scale: Array
    """What its radiance is multiplied by, shape (3,)."""


def in_one_color(
    terms: list[Term], colors: tuple[float, ...] | None, is_asked: bool
) -> tuple[tuple[Term, ...], tuple[str, ...]]:
    """The probes in the same primaries, and a line about each that nobody asked to convert."""
    found, notes = [], []
    for term in terms:
        own = term.probe.chromaticities
        found.append(replace(term, probe=term.probe.in_primaries(colors)))
        if not (is_asked or same_primaries(own, colors)):
            tells = "nothing of its primaries, was taken for Rec.709"
            tells = tells if own is None else f"that its primaries are {title_of(own)}"
            notes.append(
                f"{term.probe.name}: it says {tells}, and was converted to {title_of(colors)}; "
                "`working` chooses others"
            )
    return tuple(found), tuple(notes)


@record(eq=False)
class SumImage:
    """The lat-long of a sum, which is made when it is first read; a `ProbeImage`."""

    name: str
    """What messages call the sum."""
    path: Path | None
    """The light file."""
    recipe: bytes
    """What tells this sum from others of the same probes: the bytes of the light file."""
    terms: tuple[Term, ...]
    """All of the same primaries."""
    discs: tuple[Disc, ...]
    notes: tuple[str, ...] = ()
    """What a user should know, a line each."""
    series: Array | None = None
    """Coefficients of light that is given by them, shape ((order+1)^2, 3)."""
    file_format: str = "light file"
    """What the sum was read from. One of "light file", "USD stage" and "coefficients"."""

    largest = given = None
    row_multiple = 1

    @property
    def height(self) -> int:
        finest = max((term.probe.grid.latlong_rows for term in self.terms), default=0)
        return min(max(finest, _LEAST_ROWS), _MOST_ROWS)

    @property
    def width(self) -> int:
        return 2 * self.height

    @property
    def is_one(self) -> bool:
        """Whether it is a single light, or none."""
        return len(self.terms) + len(self.discs) + (self.series is not None) < 2

    @property
    def fine_rows(self) -> int:
        """The rows that maps ask of each probe.

        Of several lights the degrees are known together, and those that a coarse probe does not
        tell would pass for darkness beside those of another light.
        """
        return COARSE_ROWS if self.is_one else MAX_ORDER_F

    def facts(self) -> dict[str, Any]:
        """The probes, the discs and the coefficients, for `shrm info`."""
        probes = [
            {"file": term.probe.name, "scale": term.scale.tolist(), **term.probe.reading()}
            for term in self.terms
        ]
        found: dict[str, Any] = {}
        if self.series is not None:
            found["order"] = order_of(len(self.series))
            # What turns of the light round is no number to show: 6e-33 for 0.
            least = 1e-12 * np.abs(self.series).max(initial=0)
            shown = np.where(np.abs(self.series) > least, self.series, 0)
            found["lighting_coefficients"] = shown.tolist()
        if self.file_format != "coefficients":
            found |= {"probes": probes, "discs": [_facts_of(disc) for disc in self.discs]}
        return found

    def contents(self) -> Iterator[bytes]:
        """Yield the bytes of the light file, and those of each probe's files."""
        yield self.recipe
        for term in self.terms:
            for image in term.probe.images:
                yield from image.contents()

    def converted(self, matrix: Array, primaries: tuple[float, ...] | None) -> "SumImage":
        """The sum whose colors are the products of a matrix, shape (3, 3), and those of this one.

        A probe's scale multiplies its own colors, so that it becomes part of the probe's matrix.
        """
        terms = tuple(
            Term(term.probe.multiplied(matrix * term.scale, primaries), np.ones(3))
            for term in self.terms
        )
        discs = tuple(
            replace(disc, radiance=np.maximum(matrix @ disc.radiance, 0)) for disc in self.discs
        )
        series = None if self.series is None else self.series @ matrix.T
        recipe = self.recipe + np.asarray(matrix, dtype=float).tobytes()
        return replace(self, recipe=recipe, terms=terms, discs=discs, series=series)

    @cached_property
    def positive_part(self) -> "PositivePart | None":
        """What pixels show in place of a series that is negative somewhere."""
        if self.series is None:
            return None
        from shrm_cli.probe.nonnegative import without_negatives  # few lights are coefficients

        return without_negatives(self.series)

    def told_of_pixels(self) -> tuple[str, ...]:
        """Return a line about what pixels show, if any were asked for."""
        part = self.positive_part if "_pixels_and_overlaps" in vars(self) else None
        return () if part is None else (part.told,)

    def read(self, start: int, stop: int) -> Array:
        return self._pixels_and_overlaps[0][start:stop].copy()

    def overlaps(self) -> Array:
        """What the energy of the sum is more than the energies of its lights, shape (3,).

        It is twice the integral of the products of all pairs of lights, over the pixels.
        """
        if self.is_one:
            return np.zeros(3)
        return self._pixels_and_overlaps[1]

    @cached_property
    def _pixels_and_overlaps(self) -> tuple[NDArray[np.float32], Array]:
        pixels = np.zeros((self.height, self.width, 3), dtype=np.float32)
        areas = latlong_solid_angles(self.height)
        overlaps = np.zeros(3)
        with np.errstate(over="ignore", invalid="ignore"):  # the sum is checked below
            for start, light in self._lights():
                before = pixels[start : start + len(light)]
                weights = areas[start : start + len(light)]
                overlaps += 2 * np.einsum("ijc,ijc,i->c", before, light, weights, dtype=float)
                before += light
        if not np.isfinite(pixels).all():
            raise ProbeError(f"{self.name}: its lights together exceed 32-bit floats; scale down")
        return pixels, overlaps

    def _lights(self) -> Iterator[tuple[int, Array]]:
        """Yield first rows and pixels of one light after the other."""
        grid = LatLong(self.height)
        for term in self.terms:
            with using(None):
                image = to_grid(term.probe, grid)
            yield 0, image * term.scale.astype(np.float32)
        for disc in self.discs:
            for start, coverage in disc_rows(disc, self.height):
                yield start, coverage[..., None] * disc.radiance
        if self.series is not None:
            yield 0, self.shown_series()

    def shown_series(self) -> Array:
        """Return the pixels of the light that is given by coefficients, shape (H, W, 3)."""
        from shrm_cli.probe.nonnegative import radiance_of

        assert self.series is not None
        grid, part = LatLong(self.height), self.positive_part
        directions = grid.directions().reshape(-1, 3)
        light = radiance_of(self.series, directions) if part is None else part.at(directions)
        return light.reshape(*grid.shape, 3)


@record(eq=False)
class LightSum(Probe):
    """A sum of probes, discs and light that is given by its coefficients."""

    image_of_sum: SumImage = field(kw_only=True)
    """The lights, and the lat-long that `images` holds."""

    @classmethod
    def of(
        cls,
        image: SumImage,
        matrix: Array,
        chromaticities: tuple[float, ...] | None = None,
        colors: Mapping[str, list[float]] | None = None,
        proxy: "ProxyBox | None" = None,
    ) -> "LightSum":
        """Make the sum of the lights of an image; the matrix turns all of them."""
        return cls(
            image.name, LatLong(image.height), "latlong", None, matrix, PixelPolicy(),
            chromaticities, (image,), PixelReport(notes=image.notes), colors or {},
            proxy, image_of_sum=image,
        )  # fmt: skip

    def in_primaries(self, primaries: tuple[float, ...] | None) -> "LightSum":
        """The same sum, its probes, discs and coefficients in other primaries; None is Rec.709."""
        matrix = conversion(self.chromaticities, primaries)
        if matrix is None:
            return self
        image = self.image_of_sum.converted(matrix, primaries)
        return replace(self, image_of_sum=image, images=(image,), chromaticities=primaries)

    @property
    def terms(self) -> tuple[Term, ...]:
        return self.image_of_sum.terms

    @property
    def discs(self) -> tuple[Disc, ...]:
        """The circular lights, in the axes that `matrix` turns."""
        return self.image_of_sum.discs

    @property
    def series(self) -> Array | None:
        """Coefficients of light that is given by them, in the axes that `matrix` turns."""
        return self.image_of_sum.series

    @property
    def is_series(self) -> bool:
        """Whether it is light that is given by its coefficients, and nothing else."""
        return self.series is not None and not (self.terms or self.discs)

    @property
    def may_be_coarse(self) -> bool:
        rows = self.image_of_sum.fine_rows
        is_coarse = any(term.probe.grid.resolution < rows for term in self.terms)
        return is_coarse or self.image_of_sum.positive_part is not None

    @property
    def paths(self) -> list[Path]:
        """The light file, and the files of its probes."""
        own = [] if self.image_of_sum.path is None else [self.image_of_sum.path]
        return own + [path for term in self.terms for path in term.probe.paths]

    def blocks(self) -> Iterator[Block]:
        """Yield the lat-long in blocks of rows, as `Probe.blocks` does."""
        self.image_of_sum.read(0, 0)  # this reads the probes
        self.tell_warnings()
        yield from super().blocks()

    def tell_warnings(self) -> None:
        """Take what the pixels of the probes needed, which have been read, into the report."""
        of_probes = (line for term in self.terms for line in term.probe.warnings())
        image = self.image_of_sum
        self.report.notes = (*image.notes, *image.told_of_pixels(), *of_probes)


def _facts_of(disc: Disc) -> dict[str, Any]:
    """A disc as `shrm info` prints it."""
    x, y, z = disc.direction
    return {
        "azimuth": float(np.degrees(np.arctan2(x, z))),
        "elevation": float(np.degrees(np.arcsin(np.clip(y, -1, 1)))),
        "radius": float(np.degrees(disc.radius)),
        "solid_angle": disc.solid_angle,
        "radiance": disc.radiance.tolist(),
        "irradiance": disc.irradiance.tolist(),
    }
