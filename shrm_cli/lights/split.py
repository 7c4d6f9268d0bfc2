"""A probe as lamps and what is left of it: `split_lamps`.

The lamps are the compact places that stand out and give more irradiance than the error that is
allowed. Each becomes a disc. Where discs change the irradiance by more than the error, lamps that
fit them worst become several discs, and in the end stay in the probe. What a lamp hides, its pixels
and some around them, is filled from farther around.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, Indices, slices
from shrm_cli.errors import ArgumentError
from shrm_cli.lights.clipping import clipping
from shrm_cli.lights.lamp import Lamp, Light, disc_of
from shrm_cli.lights.pixels import SpherePixels, near
from shrm_cli.lights.search import LARGEST, find_regions
from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.messages import whole_number
from shrm_cli.probe.coarse import shown_sum
from shrm_cli.probe.disc import Disc, disc_coefficients, radius_of, zonal_of_discs
from shrm_cli.probe.image import ArrayImage
from shrm_cli.probe.light_sum import LightSum
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.probe.pixels import PixelPolicy
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import LEAST_ROWS, coarse_probe, to_grid
from shrm_cli.probe.shared import shared
from shrm_cli.progress import Stages, current, using
from shrm_cli.records import Displayed, record
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.grid.base import Grid
from shrm_cli.sphere.harmonics import degrees, order_of, real_harmonics
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.vocabulary import LAMP_COUNT, LAMP_ERROR, LUMINANCE

MOST_OF_LAMP = 16
"""The most discs of a lamp."""


@record(eq=False)
class Proof:
    """How far the irradiance of residual and discs is from that of the probe."""

    rms: float
    maximum: float
    """`rms` and `maximum`: of the difference, over all normals and the channels together, relative
    to `scale`."""
    scale: float
    """The RMS of the probe's irradiance over all normals, channels together."""
    worst: Array
    """The normal of the largest difference, world axes, shape (3,)."""


@record(eq=False)
class LampSplit(Displayed):
    """A probe as lamps and a residual, whose sum it is."""

    probe: Probe
    lamps: tuple[Lamp, ...]
    """The one with the most irradiance first."""
    fills: tuple["Filled", ...]
    """The place of each lamp without it, on `grid`."""
    grid: Grid
    """Where lamps were looked for: the probe's own, or a coarser one that each of its pixels is k x
    k pixels of."""
    left: int
    """Lamps that stay in the residual: more than were asked for, or nothing like discs."""
    error: float
    """The relative RMS error of the irradiance that was allowed."""
    refused: float | None = None
    """The radius in degrees that was asked for of the brightest lamp, if that stays for it."""

    @property
    def discs(self) -> tuple[Disc, ...]:
        return tuple(disc for lamp in self.lamps for disc in lamp.discs)

    @property
    def share(self) -> float:
        """The part of the luminance of the probe's light that is in the lamps; 0 of black light."""
        whole = np.sqrt(4 * np.pi) * float(project(self.probe, 0).coefficients[0] @ LUMINANCE)
        lit = sum(float(lamp.light.flux @ LUMINANCE) for lamp in self.lamps)
        return lit / whole if whole > 0 else 0.0

    @cached_property
    def residual(self) -> NDArray[np.float32]:
        """The probe with each lamp replaced by its surroundings, shape (rows, columns, 3).

        It is on the probe's grid, in world axes. Where lamps were looked for in means of k x k
        pixels, these pixels take the value of theirs: what is taken out of them together is the
        same.

        Raises ProbeError if the probe cannot be read.
        """
        result = self.probe.image()
        factor = self.probe.height // self.grid.shape[0]
        for filled in self.fills:
            rows, columns = np.divmod(filled.numbers, self.grid.shape[1])
            for down in range(factor):
                for across in range(factor):
                    result[rows * factor + down, columns * factor + across] = filled.values
        if np.array_equal(self.probe.matrix, np.eye(3)):
            return result
        return to_grid(_in_memory(self.probe, result, self.probe.matrix), self.probe.grid)

    @cached_property
    def residual_probe(self) -> Probe:
        """The residual as a probe in memory, of which several maps may be made."""
        return shared(_in_memory(self.probe, self.residual, np.eye(3)))

    @property
    def lamps_probe(self) -> Probe:
        """What the lamps' pixels lost, as a probe in memory."""
        whole = to_grid(self.probe, self.probe.grid)
        return _in_memory(self.probe, np.maximum(whole - self.residual, 0), np.eye(3))

    @property
    def clipped(self) -> list[str]:
        """A line about the lamps that may be clipped, if there are any.

        That integers end at white the probe tells itself, of all that is.
        """
        if self.probe.report.is_clipped:
            return []
        numbers = [number for number, lamp in enumerate(self.lamps, 1) if lamp.clipped]
        if not numbers:
            return []
        first, *others = numbers
        which, whose = f"lamp {first} may be clipped", "its"
        if others:
            which, whose = f"{len(numbers)} lamps may be clipped, such as lamp {first}", "their"
        return [
            f"{which}: {self.lamps[first - 1].clipped}; {whose} irradiance may be too low, which "
            "shrm probe unclip mends by a reading"
        ]

    @property
    def changed(self) -> list[str]:
        """A line about the irradiance, if it changes more than is allowed."""
        if self.proof.rms <= self.error:
            return []
        turned = not np.array_equal(self.probe.matrix, np.eye(3))
        cure = "turning it resampled its pixels, do that later" if turned else "check it before use"
        return [
            f"residual and discs change the irradiance by {self.proof.rms:.3%} RMS, more than "
            f"the {self.error:.3g} that `error` allows; {cure}"
        ]

    @cached_property
    def proof(self) -> Proof:
        """How far the irradiance of residual and discs is from that of the probe."""
        order = order_on(self.probe.grid)
        before = project(self.probe, order).coefficients
        for lamp in self.lamps:
            points = light_coefficients(lamp.light, order)
            before = before + (_widening(lamp.light, order) - 1) * points
        after = project(self.residual_probe, order).coefficients
        return prove(before, after, self.discs)


@dataclass(eq=False)
class _Candidate:
    """A lamp that may still become more discs, or stay in the probe."""

    light: Light
    level: float
    source: Array
    areas: Array
    filled: "Filled"
    order: int
    parts: list[Light] = field(default_factory=list)
    discs: list[Disc] = field(default_factory=list)
    wrong: Array = field(default_factory=lambda: np.zeros(0))

    def divide(self, count: int, radius: float | None) -> None:
        """Make a number of discs of the light, cutting the part with the most error in two."""
        self.parts = _cut_worst(self.parts or [self.light], count, self.order, radius)
        self.discs = [disc_of(part, radius) for part in self.parts]
        self.wrong = _wrong(self.light, self.discs, self.order)


def _cut_worst(
    parts: list[Light], count: int, order: int, radius: float | None = None
) -> list[Light]:
    """Cut the part whose disc errs most in two, until there are so many or none can be cut.

    What is counted are the degrees of the irradiance up to `order`. `radius` is that of all discs,
    radians; by default each has its own.
    """
    while len(parts) < count:
        wrongs = [_wrong(part, [disc_of(part, radius)], order) for part in parts]
        at = int(np.argmax([irradiance_rms(each) for each in wrongs]))
        pieces = _halves(parts[at])
        if len(pieces) < 2:
            break
        parts = parts[:at] + pieces + parts[at + 1 :]
    return parts


def split_lamps(
    probe: AnyProbe,
    error: float = LAMP_ERROR,
    count: int = LAMP_COUNT,
    sun_radius: float | None = None,
    largest: float = LARGEST,
) -> LampSplit:
    """Find the lamps of a probe, and take them out of it.

    Parameters
    ----------
    probe : Probe, path-like or array
    error : float
        The RMS error of the irradiance over all normals, relative to its RMS, that discs in place
        of pixels may make. What gives less irradiance than this is no lamp.
    count : int
        The most lamps.
    sun_radius : float, optional
        The radius of the brightest lamp in degrees, instead of the one that is found.
    largest : float
        The solid angle of the largest lamp, sr.

    Returns
    -------
    LampSplit
        The flux of its lamps is what the residual lacks.

    Raises
    ------
    ProbeError
        If the probe cannot be read, or its light is beyond 32-bit floats.
    ArgumentError
        If a number is one that cannot be, such as a radius of 0.

    Examples
    --------
    >>> split = shrm.split_lamps("probes/sky.exr")
    >>> len(split.lamps), split.proof.rms < 0.01
    (1, True)
    """
    whole_number("count", count, 0, 100)
    for name, value in (("error", error), ("largest", largest)):
        if not 0 <= value < np.inf:
            raise ArgumentError(name, f"is {value}; give 0 or more")
    if sun_radius is not None and not 0 < sun_radius <= 90:
        raise ArgumentError("sun_radius", f"is {sun_radius}; give more than 0 to 90 degrees")
    probe = as_probe(probe)
    if isinstance(probe, LightSum):
        probe = shown_sum(probe)
    coarse = coarse_probe(probe, LEAST_ROWS)
    image = coarse.image()
    pixels = SpherePixels(coarse.grid)
    order = order_on(coarse.grid)
    stages = Stages(current(), 3)
    with using(stages.within):
        scale = irradiance_rms(project(coarse, order).coefficients)
        stages.done(1, 3)
        # The brightness is the mean of channels, the scale the root of the sum of their squares.
        regions = find_regions(image, pixels, error * scale / np.sqrt(3), largest)
    stages.done(2, 3)
    kept = regions[:count]
    filled_regions = fill_regions(image, pixels, [region.numbers for region in kept])
    flat = image.reshape(-1, 3)
    candidates = []
    for region, filled in zip(kept, filled_regions, strict=True):
        light = Light(
            pixels.directions(filled.numbers) @ probe.matrix.T, filled.excess,
            pixels.areas(filled.numbers),
        )  # fmt: skip
        if light.flux.sum() > 0:
            source, areas = flat[region.numbers], pixels.areas(region.numbers)
            candidates.append(_Candidate(light, region.level, source, areas, filled, order))
    radius = None if sun_radius is None else float(np.radians(sun_radius))
    chosen = _fitted(candidates, error * scale, radius)
    # A lamp becomes no more discs where a radius is asked for, so that it fits or stays.
    stays = bool(candidates) and all(each is not candidates[0] for each in chosen)
    first = probe.images[0]
    lamps = tuple(
        Lamp(
            tuple(each.discs), each.light, each.level, each.source.max(axis=0),
            clipping(each.source, each.areas, first.largest, first.given),
            irradiance_rms(each.wrong) / scale, pixels.pitch,
        )
        for each in chosen
    )  # fmt: skip
    fills = tuple(each.filled for each in chosen)
    stages.done(3, 3)
    left = len(regions) - len(lamps)
    refused = sun_radius if stays else None
    return LampSplit(probe, lamps, fills, coarse.grid, left, error, refused)


def _fitted(candidates: list[_Candidate], most: float, radius: float | None) -> list[_Candidate]:
    """Make discs of lamps until they err by no more than this irradiance together."""
    for index, each in enumerate(candidates):
        each.divide(1, radius if index == 0 else None)
    while candidates and irradiance_rms(np.sum([each.wrong for each in candidates], axis=0)) > most:
        worst = max(candidates, key=lambda each: irradiance_rms(each.wrong))
        before = len(worst.discs)
        is_forced = radius is not None and worst is candidates[0]
        if not is_forced and before < MOST_OF_LAMP:
            worst.divide(before + 1, None)
        if len(worst.discs) == before:
            candidates = [each for each in candidates if each is not worst]
            radius = None if is_forced else radius
    return candidates


def _wrong(light: Light, discs: Sequence[Disc], order: int) -> Array:
    pixels = _widening(light, order) * light_coefficients(light, order)
    return pixels - disc_coefficients(discs, order)


def _widening(light: Light, order: int) -> Array:
    """Return what coefficients at points are multiplied by for pixels, ((order+1)^2, 1).

    A pixel is a disc of the mean area. That of a probe of 32 rows has a radius of 3 degrees, and a
    surface that it grazes sees a part of it: as a point it would be no lamp, because a disc in its
    place changes the irradiance by more than the error that is allowed.
    """
    area = np.full(1, light.areas.mean())
    zonal = zonal_of_discs(order, np.array([radius_of(float(area[0]))]), area)[:, 0]
    wider = zonal / zonal[0] / np.sqrt(2 * np.arange(order + 1) + 1)
    return np.asarray(wider[degrees(order), None])


def _halves(light: Light) -> list[Light]:
    """Cut light across its length, at the middle of its flux; one part where it cannot be cut."""
    _, axes, _ = light.shape()
    beyond = (light.directions - light.axis) @ axes[0] > 0
    parts = [light.where(beyond), light.where(~beyond)]
    can_be_cut = all(each.flux.min(initial=0) >= 0 < each.flux.sum() for each in parts)
    return parts if can_be_cut else [light]


def _in_memory(probe: Probe, pixels: NDArray[np.float32], matrix: Array) -> Probe:
    """A probe of other pixels on the same grid; a cube's are in OpenEXR's order and orientation."""
    image = ArrayImage(pixels, f"residual of {probe.name}")
    is_cube = probe.grid.faces > 1
    return Probe(
        image.name, probe.grid, "openexr" if is_cube else probe.layout,
        "openexr" if is_cube else None, matrix, PixelPolicy(), probe.chromaticities, (image,),
    )  # fmt: skip


_ORDER = 32
"""Degrees of the light that are counted, where pixels are fine enough. Of a point's irradiance
those beyond hold less than 1e-5 of the square."""
_NORMALS = 2048
"""Normals among which the largest difference is looked for: any is within 3 degrees of one. Of six
probes the difference found is that of 32,768 normals to 4 %; half as many miss up to 10 %."""
_VALUES_AT_ONCE = 2**23


def order_on(grid: Grid) -> int:
    """The degrees in which light on a grid is compared: no finer ones than its pixels have."""
    return min(_ORDER, grid.resolved_order)


def prove(before: Array, residual: Array, discs: Sequence[Disc]) -> Proof:
    """Compare the irradiance of a probe with that of what is left of it and discs.

    `before` and `residual`, each of shape ((order+1)^2, 3), are coefficients of the radiance of the
    probe and of the residual, world axes.
    """
    difference = residual + disc_coefficients(discs, order_of(len(before))) - before
    irradiance = _irradiance(difference)
    scale = irradiance_rms(before)
    normals = spiral_directions(_NORMALS)
    values = np.linalg.norm(real_harmonics(order_of(len(before)), normals) @ irradiance, axis=1)
    worst = int(np.argmax(values))
    return Proof(
        _over(irradiance_rms(difference), scale), _over(float(values[worst]), scale), scale,
        normals[worst],
    )  # fmt: skip


def irradiance_rms(coefficients: Array) -> float:
    """RMS of the irradiance over all normals, channels together, from those of the radiance."""
    return float(np.sqrt((_irradiance(coefficients) ** 2).sum() / (4 * np.pi)))


def light_coefficients(light: Light, order: int) -> Array:
    """Coefficients of light at points, shape ((order+1)^2, 3), as sums over them."""
    result = np.zeros(((order + 1) ** 2, 3))
    for some in slices(len(light.areas), _VALUES_AT_ONCE // len(result)):
        weighted = light.radiance[some] * light.areas[some, None]
        result += real_harmonics(order, light.directions[some]).T @ weighted
    return result


def _irradiance(coefficients: Array) -> Array:
    order = order_of(len(coefficients))
    return np.asarray(lambert_factors(order)[degrees(order), None] * coefficients)


def _over(value: float, scale: float) -> float:
    return value / scale if scale else 0.0


# ---- what lamps hide -----------------------------------------------------------------------------

_GROWN = 2.3
"""Mean distances of pixels that a lamp is grown by: filters blur it, and leave dark rims."""
_RING = 1.6
"""Mean distances beyond, from which the place of the lamp is filled."""
_POWER = 3
"""Pixels of the ring count by the distance to minus this; of 2 and less far ones would win."""
_PAIRS_AT_ONCE = 2**22


@record(eq=False)
class Filled:
    """The place of a lamp without the lamp."""

    numbers: Indices
    """Pixels, in row-major order, shape (n,)."""
    values: Array
    """The radiance of the pixels without the lamp, shape (n, 3)."""
    excess: Array
    """What is taken out of each pixel, shape (n, 3). Single values may be negative, at dark rims;
    no sum is."""


def fill_regions(image: Array, pixels: SpherePixels, regions: Sequence[Indices]) -> list[Filled]:
    """Take lamps out of an image, one for each region. They share no pixel.

    `image`, of shape (rows, columns, 3), is left as it is. `regions` are numbers of the pixels of
    each lamp; no pixel is in two of them.
    """
    flat = image.reshape(-1, 3)
    owner = np.full(len(flat), -1)
    for index, numbers in enumerate(regions):
        owner[numbers] = index
    around = []
    for index, numbers in enumerate(regions):
        cap, band = _bands(pixels, numbers)
        grown = cap[band <= 1]
        owner[grown[owner[grown] < 0]] = index
        around.append(cap)
    return [
        _filled(flat, pixels, cap[owner[cap] == index], cap[owner[cap] < 0])
        for index, cap in enumerate(around)
    ]


def _bands(pixels: SpherePixels, numbers: Indices) -> tuple[Indices, NDArray[np.intp]]:
    """Pixels near a lamp, and the band of each: 0 in the lamp, 1 in its rim, 2 in the ring."""
    points = pixels.directions(numbers)
    total = points.sum(axis=0)
    axis = normalize(total) if np.linalg.norm(total) > 0 else points[0]
    widest = 2 * np.arcsin(min(np.linalg.norm(points - axis, axis=1).max() / 2, 1.0))
    outer = (_GROWN + _RING) * pixels.pitch
    cap = np.union1d(pixels.within(axis, float(widest) + outer), numbers)
    band = np.where(np.isin(cap, numbers, assume_unique=True), 0, 3)
    outside = np.flatnonzero(band)
    around = pixels.directions(cap[outside])
    for number, reach in ((2, outer), (1, _GROWN * pixels.pitch)):
        band[outside[near(around, points, reach)]] = number
    return cap[band < 3], band[band < 3]


def _filled(flat: Array, pixels: SpherePixels, place: Indices, ring: Indices) -> Filled:
    """Fill a lamp's place from a ring, each pixel of which counts by its distance and its area."""
    before = flat[place].astype(float)
    areas = pixels.areas(place)
    if len(ring):
        values = _interpolated(pixels, place, ring, flat[ring].astype(float))
    else:  # all around are other lamps
        values = np.zeros_like(before)
    # A red sun may be darker in blue than what is around it: it takes nothing, and adds nothing.
    there, filled = areas @ before, areas @ values
    values *= np.minimum(there / np.where(filled > 0, filled, 1), 1)
    stored = values.astype(np.float32)
    return Filled(place, stored, before - stored)


def _interpolated(pixels: SpherePixels, place: Indices, ring: Indices, values: Array) -> Array:
    """Shepard's interpolation at the pixels of a place, shape (n, 3)."""
    sources, weights = pixels.directions(ring), pixels.areas(ring)
    targets = pixels.directions(place)
    result = np.empty((len(place), 3))
    for part in slices(len(place), _PAIRS_AT_ONCE // len(ring)):
        squares = np.maximum(2 - 2 * (targets[part] @ sources.T), (pixels.pitch / 4) ** 2)
        shares = weights * squares ** (-_POWER / 2)
        result[part] = shares @ values / shares.sum(axis=1, keepdims=True)
    return result
