"""Maps of what is left of a probe without its lamps, and these beside it: `sun` split."""

import math
from dataclasses import replace

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.brushed_transfer import compute_brushed_transfer
from shrm_cli.brdf.cache import cached_transfer
from shrm_cli.brdf.transfer import compute_transfer
from shrm_cli.errors import ArgumentError
from shrm_cli.lights.lamp import Lamp
from shrm_cli.lights.split import LampSplit, split_lamps
from shrm_cli.maps.base import REMEDY
from shrm_cli.maps.expansion import LampsBeside
from shrm_cli.maps.info import probe_name
from shrm_cli.maps.lamps.lobe import LobeTable, table_bytes
from shrm_cli.maps.lamps.map import DIM_THE_REST, LampMap
from shrm_cli.maps.lamps.models import bytes_of_table
from shrm_cli.maps.lamps.rule import LitDiscs
from shrm_cli.maps.options import counted
from shrm_cli.maps.request import Prefiltered, negative_warnings
from shrm_cli.plan import policy
from shrm_cli.probe.disc import Disc, disc_coefficients, radius_of
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.shared import SharedProbe
from shrm_cli.records import record
from shrm_cli.reflected import reflected_rms
from shrm_cli.sphere.grid.latlong import AXES
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.vocabulary import LUMINANCE

_ORDERS = 192, 8
"""The degrees and azimuthal orders of a BRDF that tell how much light lamps reflect. What lies
beyond is estimated."""
_ACCURACY = 1e-3
_LAMPS = "lamps"
SMALL, MUCH = float(np.radians(1.0)), 0.02
"""Lamps of a smaller radius that hold more of the light together are worth taking out. Of eight
real probes, those of five are so (2 % to 59 % of the light), and the best maps of 32 MB of a
plastic of roughness 0.3 have errors of 7 % to 16 %. The others have 1 % to 4 %: a courtyard without
lamps, a forest whose sun of a degree holds 7 %, a studio with 75 % in lamps of 3 to 6 degrees."""


@record(eq=False)
class Beside:
    """The lamps that are put beside a map, and what that does to the reflected light."""

    split: LampSplit
    left: float
    """The RMS of what is reflected of the residual, over that of all light."""
    error: float
    """What discs in place of the lamps' pixels change, in the same measure."""
    wrong: Array
    """The coefficients of the light of these pixels without that of the discs, world axes, shape
    (n, 3)."""
    brdf: Brdf
    """What reflects the discs: the BRDF of the map, or a table of it, which `error` counts."""

    @property
    def bytes(self) -> int:
        """The bytes that the file of the map takes for that."""
        return table_bytes(self.brdf)

    def lamps(self) -> LampsBeside | None:
        """Return the lamps as the wrong pixels of maps are counted beside them, where they are."""
        if not self.brdf.isotropic:  # the lobes for views have tangents of their own
            return None
        flux = sum((lamp.light.flux for lamp in self.split.lamps), np.zeros(3))
        return LampsBeside(flux, self.wrong, LitDiscs(self.brdf, self.split.discs).radiance)


def split_for(probe: Probe, brdf: Brdf) -> Beside:
    """Take the lamps out of a probe, for a map of what a BRDF reflects.

    Raises ArgumentError if the BRDF is one whose reflection of discs is not integrated. Raises
    ProbeError if the probe cannot be read.
    """
    if brdf.center == "tangent":
        raise ArgumentError("sun", f"does not apply to fibres such as {brdf.name}")
    split = _split_of(probe)
    if not split.discs:
        return Beside(split, 1.0, 0.0, np.zeros((1, 3)), brdf)
    order, max_q = _ORDERS
    max_q = 0 if brdf.zonal else max_q
    compute = compute_transfer if brdf.isotropic else compute_brushed_transfer
    transfer = cached_transfer(brdf, order, max_q, _ACCURACY, compute)
    order = transfer.order_f
    whole = reflected_rms(project(probe, order), transfer)
    if whole == 0:
        return Beside(split, 1.0, 0.0, np.zeros((1, 3)), brdf)
    wrong = np.zeros(((order + 1) ** 2, 3))
    found = _wrong(split, min(order, split.grid.resolved_order))
    wrong[: len(found)] = found
    # What is beyond these degrees shows in sharp lobes: discs and pixels differ most at their rims.
    energy = np.maximum(sum(map(_wrong_energy, split.lamps)), (wrong**2).sum(axis=0))
    error = reflected_rms(Lighting(wrong, energy), transfer)
    residual = reflected_rms(project(split.residual_probe, order), transfer)
    shown = brdf
    if bytes_of_table(brdf):
        shown = LobeTable.of(brdf)
        energy = np.sum([disc.energy for disc in split.discs], axis=0)
        lit = Lighting(disc_coefficients(split.discs, order), energy)
        error = math.hypot(error, shown.error(brdf) * reflected_rms(lit, transfer))
    return Beside(split, min(residual / whole, 1.0), error / whole, wrong, shown)


def _split_of(probe: Probe) -> LampSplit:
    """Take the lamps out of a probe; once, where it is there for several maps."""
    if not isinstance(probe, SharedProbe):
        return split_lamps(probe)
    if _LAMPS not in probe.kept:
        probe.kept[_LAMPS] = split_lamps(probe)
    found: LampSplit = probe.kept[_LAMPS]
    return found


def _wrong(split: LampSplit, order: int) -> Array:
    """Return the coefficients of the pixels of all lamps without those of their discs, world axes.

    Pixels are discs of their areas, so that a lamp of a single pixel is right. They are expanded in
    the axes of a lat-long, about whose pole those of a row are alike.
    """
    pixels = [
        Disc(direction, radius_of(area), radiance)
        for light in (lamp.light for lamp in split.lamps)
        for direction, area, radiance in zip(
            light.directions @ AXES.T, light.areas, light.radiance, strict=True
        )
    ]
    own = disc_coefficients(pixels, order)
    return transform_coefficients(own, AXES.T) - disc_coefficients(split.discs, order)


def _wrong_energy(lamp: Lamp) -> Array:
    """Return the energy of a lamp's pixels without its discs at all degrees, shape (3,).

    Each pixel is as its middle is; what discs have outside of all pixels counts, too.
    """
    light, rest = lamp.light, lamp.light.radiance.copy()
    outside = np.zeros(3)
    for disc in lamp.discs:
        inside = light.directions @ disc.direction >= np.cos(disc.radius)
        rest[inside] -= disc.radiance
        outside += disc.radiance**2 * max(disc.solid_angle - float(light.areas[inside].sum()), 0.0)
    return np.asarray(light.areas @ rest**2 + outside)


def with_lamps(made: Prefiltered, beside: Beside) -> Prefiltered:
    """Put the lamps of a probe beside the map of the rest; errors become relative to all.

    `made` is the map of the residual. Where there are no lamps, it is of the probe.
    """
    split, left = beside.split, beside.left
    info = replace(made.map.info, probe=probe_name(split.probe), probe_sha256=split.probe.digest())
    inner = made.map.with_info(info)
    if not split.discs:
        line = "`sun` split changes nothing: the probe has no compact lamps"
        return replace(made, map=inner, warnings=(line, *made.warnings))
    bound = made.facts.get("error_bound")
    facts = made.facts | ({} if bound is None else {"error_bound": bound * left})
    note = (
        "lamps",
        f"{counted(len(split.discs), 'disc')} beside the map, for {beside.error:.2%} (RMS) in "
        f"place of the pixels; without, errors were {1 / max(left, 1e-6):.3g} times as large a "
        "part of the light",
    )
    further = dict(made.further)
    dark = further.pop("negative_share", None)  # it is found again, with the lamps
    of_dark = () if dark is None else negative_warnings(made.map, dark())
    told = [
        f"of the light without its lamps: {line.replace(REMEDY, DIM_THE_REST)}"
        for line in made.warnings
        if line not in of_dark
    ]
    told += split.clipped
    if split.left:
        stay = "lamp stays" if split.left == 1 else "lamps stay"
        told.append(f"{split.left} more {stay} in the map")
    if beside.error > policy.ERROR:
        told.append(
            f"discs in place of the lamps' pixels change {beside.error:.1%} (RMS) of the reflected "
            "light: their shapes, or those of the pixels, show in so sharp a lobe"
        )
    lit = LampMap(inner, split.discs, left, beside.error, beside.brdf)
    return replace(
        made, map=lit, facts=facts, notes=(*made.notes, note), warnings=tuple(told),
        further=further,
    )  # fmt: skip


def lamps_share(probe: Probe) -> float:
    """Return the part of the luminance of a probe's light that is in its lamps.

    Large ones are worth taking out, too: gold of roughness 0.3 in a studio has 13 % of its pixels
    wrong in 21 MB, and 4 % in 0.6 MB beside soft boxes that are discs, with 7 % of RMS error.
    """
    mean = project(probe, 0).coefficients[0] / np.sqrt(4 * np.pi)
    whole = 4 * np.pi * float(mean @ LUMINANCE)
    lamps = _split_of(probe).lamps
    return sum(float(each.light.flux @ LUMINANCE) for each in lamps) / whole if whole > 0 else 0.0
