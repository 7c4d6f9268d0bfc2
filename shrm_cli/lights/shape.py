"""What discs in place of the lamps' pixels change, and more discs where that shows in a material.

The irradiance tells how many discs a lamp needs as a light of an engine. In the highlights of sharp
lobes its shape shows: the corners of a soft box, the bright middle of a bulb. More discs that are
fitted to it take some bytes where a map of the difference takes megabytes.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Self

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.transfer import TransferFunctions
from shrm_cli.lights.fit import fitted_discs
from shrm_cli.lights.lamp import Lamp, Light
from shrm_cli.lights.split import MOST_OF_LAMP, LampSplit
from shrm_cli.probe.coarse import fine_probe
from shrm_cli.probe.disc import Disc, disc_coefficients, radius_of
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.shared import SharedProbe, shared
from shrm_cli.records import record
from shrm_cli.reflected import blur_amplitudes, energies_beyond, reflected_rms
from shrm_cli.sphere.directions import horizontal_tangents, normalize
from shrm_cli.sphere.grid.latlong import AXES
from shrm_cli.sphere.harmonics import degrees, order_of
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.vocabulary import COARSE_ROWS

_PARTS_ALONG, _MOST_PARTS = 8, 2**14
"""The parts along the edges of pixels that discs may cut, and the most parts of a lamp. The middles
of four pixels are on a disc of the same area, from which a third of their light differs."""
_LEFT, _LEFT_BY_MANY, _MANY = 1 / 3, 1 / 5, 8
"""The part of what a lamp's first discs change that others may leave, and that more than so many
may. Those that leave more follow the pixels and not the lamp: of a round sun of 84 pixels eight
leave .39 and thirteen .25, and those were three times as far from the sun itself as one."""


@record(eq=False)
class _Shape:
    """A lamp of some discs, and what these change."""

    lamp: Lamp
    error: float
    """The RMS of what is reflected of it."""

    @classmethod
    def of(cls, lamp: Lamp, changed: Lighting, transfer: TransferFunctions) -> Self:
        """Return the shape of a lamp whose discs change this."""
        return cls(lamp, reflected_rms(changed, transfer))

    @property
    def count(self) -> int:
        return len(self.lamp.discs)


class Change:
    """What discs in place of the lamps' pixels change, and the rest of the light with some of it.

    A soft box has corners, and a lamp a bright middle. What discs lack of them shows in sharp
    lobes. It is light of its own, partly negative, and a map holds its degrees like all others.
    Degrees that end where those of the map would end rather fade out before, because they ring
    around lamps, where much of the light is dark.
    """

    def __init__(
        self,
        split: LampSplit,
        transfer: TransferFunctions,
        of_lamps: Sequence[Array],
        whole: Probe,
        pixels: Probe,
    ) -> None:
        self.split, self.whole, self.pixels = split, whole, pixels
        self._transfer, self._of_lamps = transfer, of_lamps
        self._each = list(map(_changed, split.lamps, of_lamps))
        self.known = np.sum([light.coefficients for light in self._each], axis=0)
        known = np.sum(self.known**2, axis=0)
        self._energy = np.maximum(np.sum([light.energy for light in self._each], axis=0), known)

    @classmethod
    def of(cls, split: LampSplit, transfer: TransferFunctions) -> Self:
        """Return what the discs of some lamps change, to the order of what reflects them."""
        of_lamps = of_pixels(split.lamps, transfer.order_f)
        whole, pixels = (shared(fine_probe(each)) for each in (split.probe, split.residual_probe))
        return cls(split, transfer, of_lamps, whole, pixels)

    def finer(self, most: float) -> Self:
        """Return the same for more discs, until they change no more than allowed if they can.

        `most` is the RMS of what is reflected of what discs change. In each step that lamp takes
        more discs of which each one takes away the most.
        """
        enough = most / len(self._fits)
        offers = [self._until(index, enough) for index in range(len(self._fits))]
        taken = [shapes[0] for shapes, _ in self._fits]
        while sum(each.error**2 for each in taken) > most**2:
            # Others that take no more discs count as if each took half of one.
            steps = [
                ((now.error**2 - each.error**2) / max(each.count - now.count, 0.5), index, each)
                for index, now in enumerate(taken)
                for each in offers[index]
                if each.error < now.error
            ]
            if not steps:
                break
            _, index, better = max(steps, key=lambda step: step[0])
            taken[index] = better
        split = replace(self.split, lamps=tuple(each.lamp for each in taken))
        return type(self)(split, self._transfer, self._of_lamps, self.whole, self.pixels)

    @cached_property
    def _fits(self) -> list[tuple[list[_Shape], Iterator[tuple[Disc, ...]]]]:
        """The lamps as they are and with more discs, as far as found; and further discs."""
        amplitudes = blur_amplitudes(self._transfer)
        return [
            (
                [_Shape.of(lamp, changed, self._transfer)],
                fitted_discs(_fine_light(lamp), amplitudes, MOST_OF_LAMP),
            )
            for lamp, changed in zip(self.split.lamps, self._each, strict=True)
        ]

    def _until(self, index: int, enough: float) -> list[_Shape]:
        """Return a lamp as it is, and with ever more discs until these change little enough."""
        found, further = self._fits[index]
        lamp, pixels, first = self.split.lamps[index], self._of_lamps[index], found[0]
        if first.error <= enough:
            return [first]
        while min(each.error for each in found) > min(enough, _LEFT_BY_MANY * first.error):
            discs = next(further, None)
            if discs is None:
                break
            finer = replace(lamp, discs=discs)
            found.append(_Shape.of(finer, _changed(finer, pixels), self._transfer))
        return [first, *(each for each in found if each.error <= _left(each.count) * first.error)]

    def beyond(self, last: int) -> Lighting:
        """Return what a rest that holds its degrees up to the last one lacks."""
        left = self.known * (1 - _fading(order_of(len(self.known)), last))
        unknown = self._energy - (self.known**2).sum(axis=0)
        return Lighting(left, unknown + (left**2).sum(axis=0))

    def missed(self, last: int | None) -> float:
        """Return the RMS of what is reflected of what a rest lacks.

        `last` is the last degree of this that the rest holds, or None where it holds all: those of
        the pixels. Then it is infinite where discs, whose degrees do not end there, are known to
        finer ones: a rest that ends where its lamps go on rings around them.
        """
        if last is not None:
            return reflected_rms(self.beyond(last), self._transfer)
        order, finest = self._transfer.order_f, self.whole.grid.resolved_order
        if finest < order:
            return math.inf
        above, _ = energies_beyond(Lighting(self.known, self._energy), self._transfer)
        # The energy of rims beyond a degree falls as the inverse of the degree.
        return math.sqrt(above * order / finest)

    def rest(self, last: int | None) -> Probe:
        """Return the light without discs, and with the degrees of this up to the last one, or all.

        Its pixels are those of the residual.
        """
        if last == 0:
            return self.pixels
        lit = self._with_all if last is None else partial(self._with_degrees, last)
        return SharedProbe.of(self.pixels, lit)

    def _with_all(self, order: int) -> Lighting:
        """Return the light without discs. Lamps of many pixels are as good as points."""
        whole = project(self.whole, order)
        series = whole.coefficients.copy()
        discs = disc_coefficients(self.split.discs, whole.resolved_order)
        series[: len(discs)] -= discs
        energy = project(self.pixels, 0).energy + self._energy
        return Lighting(series, np.maximum(energy, (series**2).sum(axis=0)))

    def _with_degrees(self, last: int, order: int) -> Lighting:
        """Return the light of the residual, with what fades out up to the last degree."""
        pixels = project(self.pixels, order)
        held = self.known[: (min(order, last) + 1) ** 2]
        held = held * _fading(order_of(len(held)), last)
        series = pixels.coefficients.copy()
        series[: len(held)] += held
        return Lighting(series, pixels.energy + (held**2).sum(axis=0))


def _left(count: int) -> float:
    return _LEFT if count <= _MANY else _LEFT_BY_MANY


def of_pixels(lamps: Sequence[Lamp], order: int) -> list[Array]:
    """Return the coefficients of the light of each lamp, world axes, shape ((order+1)^2, 3).

    Pixels are discs of their areas, so that a lamp of a single pixel is right, to degrees that are
    finer than pixels, too: light that ends at the degrees of coarse ones rings around its lamps.
    Discs are expanded in the axes of a lat-long, about whose pole those of a row are alike.
    """
    if not lamps:
        return []
    own = [disc_coefficients(_pixels_as_discs(_fine_light(lamp)), order) for lamp in lamps]
    # To turn all lamps together takes hardly more time than to turn one.
    return np.split(transform_coefficients(np.concatenate(own, axis=1), AXES.T), len(own), axis=1)


def _fine_light(lamp: Lamp) -> Light:
    """Return a lamp's light in pixels, or parts of them, as small as those of `fine_probe`.

    Four large pixels as discs are a clover leaf, which sixteen discs follow in place of the lamp.
    """
    return _in_parts(lamp, math.ceil(0.99 * lamp.pitch * COARSE_ROWS / np.pi))


def _in_parts(lamp: Lamp, along: int) -> Light:
    """Return a lamp's light with so many parts along the edges of pixels, or as many as may be."""
    light = lamp.light
    along = min(along, int(np.sqrt(_MOST_PARTS / len(light.areas))))
    if along < 2:
        return light
    places = ((np.arange(along) + 0.5) / along - 0.5)[:, None, None]
    across = horizontal_tangents(light.directions)
    columns = places * across * (light.areas / lamp.pitch)[:, None]
    rows = places[:, None] * np.cross(light.directions, across) * lamp.pitch
    parts = normalize(light.directions + columns + rows).reshape(-1, 3)
    each = along**2
    return Light(parts, np.tile(light.radiance, (each, 1)), np.tile(light.areas / each, each))


def _pixels_as_discs(light: Light) -> list[Disc]:
    """Return discs in the place of the pixels of a lamp, in the axes of a lat-long."""
    return [
        Disc(direction, radius_of(area), radiance)
        for direction, area, radiance in zip(
            light.directions @ AXES.T, light.areas, light.radiance, strict=True
        )
    ]


def _fading(order: int, last: int) -> Array:
    """Return factors of coefficients that fade out up to a degree, shape ((order+1)^2, 1)."""
    part = np.minimum(degrees(order) / max(last, 1), 1.0)
    return np.asarray(np.cos(np.pi / 2 * part)[:, None] ** 2) if last else np.zeros((1, 1))


def _changed(lamp: Lamp, pixels: Array) -> Lighting:
    """Return what the discs of a lamp change, of which `pixels` are the coefficients."""
    known = pixels - disc_coefficients(lamp.discs, order_of(len(pixels)))
    return Lighting(known, np.maximum(_changed_energy(lamp), np.sum(known**2, axis=0)))


def _changed_energy(lamp: Lamp) -> Array:
    """Return the energy of a lamp's pixels without its discs at all degrees, shape (3,).

    What discs have outside of all pixels counts, too.
    """
    light = _in_parts(lamp, _PARTS_ALONG)
    rest, outside = light.radiance.copy(), np.zeros(3)
    for disc in lamp.discs:
        inside = light.directions @ disc.direction >= np.cos(disc.radius)
        rest[inside] -= disc.radiance
        outside += disc.radiance**2 * max(disc.solid_angle - float(light.areas[inside].sum()), 0.0)
    return np.asarray(light.areas @ rest**2 + outside)
