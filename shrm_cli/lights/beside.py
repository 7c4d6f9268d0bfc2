"""Maps of what is left of a probe without its lamps, and these beside it: `sun` split."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, cached_property, partial
from itertools import compress
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.brushed_transfer import scout_brushed_transfer
from shrm_cli.brdf.cache import cached_transfer
from shrm_cli.brdf.transfer import TransferFunctions, compute_transfer
from shrm_cli.errors import ArgumentError
from shrm_cli.lights.lamp import Lamp
from shrm_cli.lights.shape import Change, of_pixels
from shrm_cli.lights.split import LampSplit, order_on, split_lamps
from shrm_cli.maps.base import REMEDY
from shrm_cli.maps.info import probe_name
from shrm_cli.maps.lamps.lobe import LobeTable, bytes_of_table, table_bytes
from shrm_cli.maps.lamps.map import DIM_THE_REST, LampMap
from shrm_cli.maps.lamps.rule import LitDiscs
from shrm_cli.maps.lobes_lit import Lobes, judged, reflected
from shrm_cli.maps.options import counted
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.view_lobes import whole_lobes
from shrm_cli.maps.wrong_pixels import (
    LampsBeside,
    LampsLit,
    beside_lamps,
    negative_in,
    share_of_points,
)
from shrm_cli.messages import percent
from shrm_cli.plan import policy
from shrm_cli.plan.search import Goal, error_beside
from shrm_cli.probe.disc import disc_coefficients
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.shared import SharedProbe
from shrm_cli.progress import using
from shrm_cli.records import once_each, record
from shrm_cli.reference import Reference
from shrm_cli.reflected import reflected_rms
from shrm_cli.vocabulary import DEFAULT_ERROR

_ORDERS = 192, 8
"""The degrees and azimuthal orders of a BRDF that tell how much light lamps reflect. What lies
beyond is estimated."""
_ACCURACY = 1e-3
_LAMPS = "lamps"
_HELD = 0, 32, 48, 64, 96, 128, 192
"""The last degrees that are tried of what discs change: none, some, and in the end all. Of soft
boxes in GGX of roughness .3 discs change 7 % (RMS). With 64 degrees of that a map takes 1.1 MB,
with all 2.1 MB, because those that its cubes do not hold ring around the boxes."""
_FINER = 0.5
"""The part of what discs change that is finer than all of these degrees, or than the pixels, above
which a map holds none of it. Of a filament it is .8, and of soft boxes in GGX of roughness .1 .25.
"""
SMALL, MUCH = float(np.radians(1.0)), 0.02
"""Lamps of a smaller radius that hold more of the light together are worth taking out. Of eight
real probes, those of five are so (2 % to 59 % of the light), and the best maps of 32 MB of a
plastic of roughness 0.3 have errors of 7 % to 16 %. The others have 1 % to 4 %: a courtyard without
lamps, a forest whose sun of a degree holds 7 %, a studio with 75 % in lamps of 3 to 6 degrees."""


@record(eq=False)
class Beside:
    """The lamps that are put beside a map, and what is left of the light for the map."""

    split: LampSplit
    rest: Probe
    """What the map is made of: the light without that of the lamps' discs, but for some of what
    these differ by from the pixels. The probe itself where it has no lamps."""
    left: float
    """The RMS of what is reflected of the rest, over that of all light."""
    error: float
    """What is reflected wrongly beside the map, in the same measure: what discs differ by from the
    lamps' pixels, as far as the rest lacks it, and a table from the BRDF."""
    brdf: Brdf
    """What reflects the discs: the BRDF of the map, or a table of it."""
    lamps: LampsBeside | None = None
    """The lamps as the wrong pixels of maps are counted beside them, where they light any."""
    is_held: bool = False
    """Whether the rest holds some of what discs differ by from the lamps' pixels."""

    @property
    def bytes(self) -> int:
        """The bytes that the file of the map takes for that."""
        return table_bytes(self.brdf)

    def asked(self, request: Request) -> Request:
        """Return what is asked of the map of the rest.

        An RMS error beside a share of wrong pixels is of all light, of which this map has a part.
        Where lamps light nothing, the share keeps what is seen.
        """
        goal = Goal.of(request.error, request.seen)
        if goal.wrong_share is None:
            return request
        error = error_beside(self.error, goal.error) / max(self.left, goal.error)
        return replace(request, error=error, seen=goal.wrong_share)


_PARTS = 1 / 2, 1 / 4, 1 / 8
"""How far discs may change the light, in parts of what may be wrong beside a map, while too many
pixels are wrong."""
ANY = Goal(math.inf, None)
"""What a map keeps that is made of pixels, and cannot hold what discs differ by from lamps."""


def splits_for(probe: Probe, brdf: Brdf, goal: Goal) -> Iterator[Beside]:
    """Take the lamps out of a probe, for a map of what a BRDF reflects.

    `goal` is what map and lamps have to keep together. As far as discs alone would take too much of
    it, the map holds what they differ by from the lamps' pixels.

    Yields the best way, and the same with discs alone where a map may not hold more. Lamps have as
    many discs as suffice. Where none do, a map may hold what these, or the fewest discs, change. Of
    soft boxes that may need so many functions that nothing is won.

    Raises ArgumentError if the BRDF is one whose reflection of discs is not integrated. Raises
    ProbeError if the probe cannot be read.
    """
    if brdf.center == "tangent":
        raise ArgumentError("sun", f"does not apply to fibres such as {brdf.name}")
    split = split_of(probe)
    if not split.discs:
        yield Beside(split, probe, 1.0, 0.0, brdf)
        return
    lit = _Reflected.of(split, brdf)
    if lit.whole == 0:
        yield Beside(split, split.residual_probe, 1.0, 0.0, brdf)
        return
    fine = lit
    for part in _PARTS:
        if fine.suffices(0, goal):
            yield fine.beside(goal)
            return
        fine = lit.finer(part * policy.BESIDE * goal.error)
    finest, fewest = fine.beside(goal), lit.beside(goal)
    ways = [finest, fewest] if fewest.is_held else [finest]
    yield from sorted(ways, key=lambda each: each.error > policy.BESIDE * goal.error)
    if finest.is_held:
        yield fine.beside(ANY)


def _transfer(brdf: Brdf) -> TransferFunctions:
    """Return the transfer functions that tell how much light lamps reflect."""
    order, max_q = _ORDERS
    compute = compute_transfer if brdf.isotropic else scout_brushed_transfer
    return cached_transfer(brdf, order, 0 if brdf.zonal else max_q, _ACCURACY, compute)


def split_of(probe: Probe) -> LampSplit:
    """Take the lamps out of a probe; once, where it is there for several maps.

    Those stay that are nothing like discs. Large soft boxes are lamps, too: as lights of engines
    they would cast sharp shadows, but discs beside a map are as large as they are. In a dark studio
    of three boxes gold of roughness .25 has 26 % of wrong pixels in 14 MB, and brown rims, and 4 %
    in 3.8 MB beside them. Light in more than 1.1 sr hardly stands out of the mean, which it raises.
    """
    kept = probe.kept if isinstance(probe, SharedProbe) else {}
    if _LAMPS not in kept:
        found = split_lamps(probe, largest=4 * np.pi)
        of_discs = _are_like_discs(found.lamps, order_on(found.grid))
        kept[_LAMPS] = replace(
            found, lamps=tuple(compress(found.lamps, of_discs)),
            fills=tuple(compress(found.fills, of_discs)),
            left=found.left + of_discs.count(False),
        )  # fmt: skip
    split: LampSplit = kept[_LAMPS]
    return split


def _are_like_discs(lamps: Sequence[Lamp], order: int) -> list[bool]:
    """Tell of each lamp whether its discs are nearer to it than darkness is, up to an order.

    A ring of light is not like any few discs, which may give its irradiance: a strip all around a
    ceiling differs from four of them by more than its own energy, a long box by less.
    """
    lit = zip(lamps, of_pixels(lamps, order), strict=True)
    return [
        bool(np.linalg.norm(own - disc_coefficients(lamp.discs, order)) < np.linalg.norm(own))
        for lamp, own in lit
    ]


@record(eq=False)
class _Reflected:
    """What a BRDF reflects of what discs change, which tells how much of that a map has to hold."""

    light: Lighting
    """All light."""
    transfer: TransferFunctions
    lobes: Lobes
    """The lobes of the transfer functions."""
    change: "Change"
    brdf: Brdf
    """What reflects the discs: the BRDF, or a table of it."""
    whole: float
    """The RMS of what is reflected of all light."""
    of_table: float
    """What a table makes wrong of the lamps' light, in parts of that."""
    seen: Callable[[], Array]
    """Returns the luminance of what is reflected of all light; found once."""
    pixels: LampsLit | None
    """The lamps' pixels, if the BRDF is brushed.

    Its lobes have more azimuthal orders than are known here, without which dark places are not
    dark: of brushed metal between two soft boxes 14 % seemed wrong, and 2 % are.
    """

    @classmethod
    def of(cls, split: LampSplit, brdf: Brdf) -> "_Reflected":
        """Return what a BRDF reflects of what the discs of lamps change."""
        transfer = _transfer(brdf)
        order = transfer.order_f
        light, lobes = project(split.probe, order), whole_lobes(transfer, brdf.center)
        whole = reflected_rms(light, transfer)
        shown, error = brdf, 0.0
        if whole > 0 and bytes_of_table(brdf):
            shown = LobeTable.of(brdf)
            energy = np.sum([disc.energy for disc in split.discs], axis=0)
            lit = Lighting(disc_coefficients(split.discs, order), energy)
            error = shown.error(brdf) * reflected_rms(lit, transfer) / whole

        lamps = cache(lambda: Reference(split.lamps_probe, shown))

        def radiance(*points: Array) -> Array:
            with using(None):
                return lamps().brushed_radiance(*points)

        return cls(
            light, transfer, lobes, Change.of(split, transfer), shown, whole, error,
            cache(lambda: reflected(lobes, light.coefficients, judged([lobes]))),
            None if shown.isotropic else LampsLit(_flux(split), radiance),
        )  # fmt: skip

    def finer(self, most: float) -> "_Reflected":
        """Return the same for more discs, which change no more than a part of it if they can."""
        return replace(self, change=self.change.finer(most * self.whole))

    @cached_property
    def _lamps(self) -> LampsLit:
        """The discs, whose light is the same however much of what they change a map holds."""
        split = self.change.split
        is_signed = any((disc.radiance < 0).any() for disc in split.discs)
        lit = LitDiscs(self.brdf, split.discs, np.float32)
        return LampsLit(_flux(split), lit.brushed_radiance, is_signed)

    def beside(self, goal: Goal) -> Beside:
        """Return the lamps beside a map, and what the map is made of to keep a goal with them."""
        enough = self.degrees(goal)
        rest = self.change.rest(enough)
        left = reflected_rms(project(rest, self.transfer.order_f), self.transfer) / self.whole
        return Beside(
            self.change.split, rest, min(left, 1.0), self.missed(enough), self.brdf,
            self._lamps_beside(enough), enough != 0,
        )  # fmt: skip

    def _lamps_beside(self, last: int | None) -> LampsBeside:
        """Return the lamps beside a map that holds the degrees up to the last one."""
        wrong = np.zeros((1, 3)) if last is None else self.change.beyond(last).coefficients
        return LampsBeside(self._lamps, wrong, self.lobes, self.pixels if last == 0 else None)

    def degrees(self, goal: Goal) -> int | None:
        """Return the last degree of what discs change that a map has to hold; None means all.

        It is 0 where a map holds nothing of it: because discs are good enough, or because what they
        change is finer than all degrees.
        """
        for last in _HELD:
            if self.suffices(last, goal):
                return last
        finest = max(self.missed(_HELD[-1]), self.missed(None))
        return None if finest <= _FINER * self.missed(0) else 0

    def missed(self, last: int | None) -> float:
        """Return the error of lamps beside a map that holds the degrees up to the last one."""
        return math.hypot(self.of_table, self.change.missed(last) / self.whole)

    def suffices(self, last: int, goal: Goal) -> bool:
        """Tell whether these lamps leave enough of what may be wrong to the map."""
        if self.missed(last) > policy.BESIDE * goal.error:
            return False
        if goal.wrong_share is None:
            return True
        return self._wrong_share(last) <= policy.WRONG_BESIDE * goal.wrong_share

    @once_each
    def _wrong_share(self, last: int) -> float:
        """Return the share of pixels that is wrong beside a perfect map of these degrees."""
        if last == 0 and self.pixels is not None:
            rest = project(self.change.pixels, self.lobes.order)
            seen = reflected(self.lobes, rest.coefficients, judged([self.lobes]))
            with beside_lamps(self._lamps_beside(last)):
                return share_of_points(rest, [self.lobes], seen, np.zeros_like(seen))
        beyond = self.change.beyond(last).coefficients
        wrong = reflected(self.lobes, beyond, judged([self.lobes]))
        return share_of_points(self.light, [self.lobes], self.seen(), wrong)


def _flux(split: LampSplit) -> Array:
    """Return the integral of the radiance of all lamps, shape (3,)."""
    return np.sum([lamp.light.flux for lamp in split.lamps], axis=0)


def with_lamps(made: Prefiltered, beside: Beside) -> Prefiltered:
    """Put the lamps of a probe beside the map of the rest; errors become relative to all.

    `made` is the map of the rest. Where there are no lamps, it is of the probe.
    """
    split, left = beside.split, beside.left
    info = replace(made.map.info, probe=probe_name(split.probe), probe_sha256=split.probe.digest())
    inner = made.map.with_info(info)
    if not split.discs:
        line = "`sun` split changes nothing: the probe has no compact lamps"
        return replace(made, map=inner, warnings=(line, *made.warnings))
    bound = made.facts.get("error_bound")
    facts = made.facts | ({} if bound is None else {"error_bound": bound * left + beside.error})
    held = ", some of whose shape the map holds" if beside.is_held else ""
    note = (
        "lamps",
        f"{counted(len(split.discs), 'disc')} beside the map{held}; the rest of the light, in the "
        f"map, is {percent(left)}% of what is reflected (RMS)",
    )
    further = {name: partial(_together, find, beside) for name, find in made.further.items()}
    lit = LampMap(inner, split.discs, left, beside.error, beside.brdf)
    of_dark: tuple[str, ...] = ()
    darkness = of_dark
    if "negative_share" in further:  # of the map as it is seen with the lamps
        dark = negative_in(made)
        of_dark, darkness = dark.warnings(made.map), dark.warnings(lit)
    told = [
        f"of the light without its lamps: {line.replace(REMEDY, DIM_THE_REST)}"
        for line in made.warnings
        if line not in of_dark
    ]
    told += split.clipped
    if split.left:
        stay = "lamp stays" if split.left == 1 else "lamps stay"
        told.append(f"{split.left} more {stay} in the map")
    if beside.error > DEFAULT_ERROR:
        told.append(
            f"lamps beside the map change {beside.error:.1%} (RMS) of the reflected light: they "
            "are no discs, or the table of the BRDF is coarse for so sharp a lobe"
        )
    return replace(
        made, map=lit, facts=facts, notes=(*made.notes, note), warnings=(*told, *darkness),
        further=further,
    )  # fmt: skip


def _together(find: Callable[[], Any], beside: Beside) -> Any:
    """Find a fact of a map as it is together with its lamps."""
    with beside_lamps(beside.lamps):
        return find()


def lamps_share(probe: Probe) -> float:
    """Return the part of the luminance of a probe's light that is in its lamps.

    Large ones are worth taking out, too: gold of roughness 0.3 in a studio has 13 % of its pixels
    wrong in 21 MB, and 4 % in 0.6 MB beside soft boxes that are discs, with 7 % of RMS error.
    """
    return split_of(probe).share
