"""Prefiltering for the split sum: light averaged by lobes of GGX, or others, for N = V = R."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import cached_coefficients
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.brdf.environment.lobe import GgxLobe, MaterialLobe, NormalLobe, check_varies
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.errors import ArgumentError, BrdfError
from shrm_cli.maps.info import MapInfo, provenance, record_of
from shrm_cli.maps.options import counted
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.size import choose_size
from shrm_cli.maps.splitsum.core import (
    Expansion,
    dark_order,
    expand,
    split_lobe,
    sum_core,
    synthesized,
)
from shrm_cli.maps.splitsum.mips import default_mips, mip_sizes, power_of_two
from shrm_cli.maps.splitsum.roughness import DEFAULT_LEVELS, check_roughnesses, level_roughnesses
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.orders import Orders
from shrm_cli.probe.coarse import fine_probe
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import default_size, to_grid
from shrm_cli.probe.shared import SharedProbe
from shrm_cli.probe.source import latlong_light
from shrm_cli.progress import Stages, current, using
from shrm_cli.records import record
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.grid.cube import Cube
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.sphere.synthesis import CubeSeries
from shrm_cli.vocabulary import MAX_ORDER_F, MIN_ROUGHNESS, Sampling

_ERROR = 0.0005
"""The relative RMS error that each level may have."""
_LEAST_SIZE = 8
"""The fewest texels along an edge that the first level has by default: what a roughness of .3 blurs
of a probe of 4 x 2 pixels is wrong by 20 % RMS in 1 texel, and by 2 % in 8."""
_LEAST_OF_COARSE = 32
"""The fewest of them where pixels are coarse and cut into parts, whose edges lobes show: a lamp of
a pixel of 16 rows that a roughness of .29 blurs is wrong by 22 % RMS in 8 texels, by 2 % in 32."""
LARGEST_SIZE = 256
"""The most texels along an edge that the first level has by default. Engines use this size."""

# Seconds, measured on one core. The time of projection and synthesis grows with the cube of the
# order, that of direct integration with the texels, and with the pairs of a texel and a pixel
# within its lobe.
_SECONDS_A_CUBED_ORDER = 3e-8
_SECONDS_A_TEXEL_AND_ORDER = 3e-9
_SECONDS_A_TEXEL = 1e-6
_SECONDS_A_PAIR = 2e-9
_SOON = 1.0
"""Seconds that an expansion may always take, because it is exact and the levels share it."""
_ACCURACY = 1e-5
"""The part of a lobe's energy that the sampling of its coefficients may miss."""
LEAST_ORDER = 256
"""The order of the light's expansion where the core of a lobe is integrated directly."""
_KINK = 1e-3
"""A lobe that lacks no more than this beyond `LEAST_ORDER`, as relative RMS error in white light,
is expanded no further. Broad lobes are not smooth where the light grazes, so that their
coefficients fall slowly beyond that order, and direct integration costs most for broad lobes."""
_CORE_ANGLE = np.radians(5)
"""The angle at which the core of a lobe ends that either way would do for. Sharper ones end at 3.5
degrees and more. From it the time is estimated."""
_MIRROR = 0.01
"""The level of roughness 0 is the light itself where the sharpest lobe of the material is as sharp
as GGX of this ggx_alpha. Cloth has no such lobe, so that its first level is its least roughness."""
_ROWS_A_LOBE = 1.5
"""The least number of rows of pixels, from pole to pole, that a lobe is summed over, times its
width. A probe with fewer rows is interpolated. With this many rows the levels of a uniform
probe ripple by up to 3 %, with twice as many by 0.01 %."""
_MOST_ROWS = 1024
"""A probe that has more rows than this, and than twice the least number of a lobe, is averaged down
to the larger of both numbers. It loses nothing that the lobe would show."""


def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Prefilter a probe for the split sum.

    The light is projected once. Each level is a product of the light's coefficients with those of
    the lobe, to the least order F whose predicted error is small enough. Where a lobe needs more
    than F = 512, or degrees that are finer than the probe's pixels, or its expansion would cost
    more than direct integration, its core is summed over the probe's pixels, and only the rest
    beyond an angle is expanded. The level of roughness 0 is the probe itself.

    The own options of `request` are ``levels``, their number or their perceptual roughnesses, by
    default the number that `DEFAULT_LEVELS` has for the mapping; ``mapping``, which roughnesses a
    number of levels has, and how levels are mixed; and ``mips``, whether each level is half as
    large as the one before, as in a mip chain. The first has a power of two of texels then, and by
    default there are all levels down to one texel. The size is that of the first level, by default
    as many texels as the probe holds, but at least 8, or 32 where coarse pixels have edges, and at
    most 256. That of the others follows from their orders; none is larger than the one before. The
    error is the one that each level may have.
    """
    brdf = split_material(request.brdf)
    size, sampling, own = request.size, request.sampling, request.own
    mips, mapping, levels = own["mips"], own["mapping"], own.get("levels")
    if mips and sampling != "center":
        raise ArgumentError("mips", "needs texels at their centers, as graphics cards have them")
    fine = fine_probe(probe)
    least = _LEAST_SIZE if fine is probe else _LEAST_OF_COARSE
    held = max(default_size(probe, Cube), least)
    largest = min(held, LARGEST_SIZE) if size is None else size
    if mips and size is None:
        largest = power_of_two(largest)
    if levels is None:
        levels = default_mips(largest, mapping) if mips else DEFAULT_LEVELS[mapping]
    if isinstance(levels, int):
        roughness = level_roughnesses(levels, mapping)
    else:
        roughness = check_roughnesses([float(value) for value in levels], mapping)
    sizes = mip_sizes(largest, len(roughness)) if mips else None
    error = request.error or _ERROR
    cubes, infos = make_levels(fine, roughness, largest, sampling, error, sizes, brdf)
    center = "reflection" if brdf is None else brdf.center
    made = SplitSum.of_levels(cubes, roughness, mapping, sampling, infos, center)
    made = replace(made, given=brdf)
    return Prefiltered(made, _facts(made))


def make_levels(
    probe: Probe,
    roughness: Sequence[float],
    largest: int,
    sampling: Sampling = "center",
    error: float = _ERROR,
    sizes: Sequence[int] | None = None,
    brdf: Brdf | None = None,
) -> tuple[list[Array], list[MapInfo]]:
    """Make the cubes of the levels of a split sum.

    `roughness` is the perceptual roughness of each level: 0, or `MIN_ROUGHNESS` to 1. `largest` is
    the most texels along an edge of the first level; no level is larger than the one before.
    `error` is the relative RMS error that each level may have, in (0, 1). `sizes` are the texels
    along an edge of each level, for readers that want them so, in place of what `largest` and the
    orders of the levels ask for. `brdf` is the material whose lobes the levels are of, as
    `split_material` returns it.

    Returns the cubes, of shape (6 N_k, N_k, 3) each, and their records.
    """
    probe = fine_probe(probe)
    rows = _rows(probe)
    fixed = [None] * len(roughness) if sizes is None else list(sizes)
    with using(None):  # the coefficients of all lobes take less time than anything else
        lobes = [
            level_lobe(value, error, rows, size or largest, brdf)
            for value, size in zip(roughness, fixed, strict=True)
        ]
    wanted = (lobe.light_order for lobe in lobes if lobe)
    stages = Stages(current(), 1 + len(lobes))
    with using(stages.within):
        lighting = project(probe, max(wanted, default=0))
    stages.done(1, 0)
    series = CubeSeries(lighting.coefficients)
    known = provenance(probe, GgxLobe(), Orders(0, 0, error, 1.0))
    whole = _Light(probe, rows, lighting, series, known, sampling)
    cubes: list[Array] = []
    infos: list[MapInfo] = []
    for value, lobe, size in zip(roughness, lobes, fixed, strict=True):
        ggx = {"name": GgxLobe.name, "parameters": {"roughness": value}}
        of_level = ggx if brdf is None else record_of(brdf.at_roughness(value))
        light = replace(whole, known=replace(known, brdf=of_level))
        with using(stages.within):
            cube, info = _level(light, lobe, largest, size)
        largest = cube.shape[1]
        cubes.append(cube)
        infos.append(info)
        stages.done(1 + len(cubes), 0)
    return cubes, infos


def _level(
    light: "_Light", lobe: "LevelLobe | None", largest: int, size: int | None
) -> tuple[Array, MapInfo]:
    if lobe is None:
        return _mirror(light, size or largest)
    if not lobe.in_frequency:
        return _integrated(light, lobe, largest, size)
    expansion = expand(light.lighting, lobe.coefficients, light.known.eps)
    if expansion.error > light.known.eps and lobe.lobe.is_peaked:
        # The lobe passes degrees that are finer than the pixels, which no expansion knows.
        return _integrated(light, lobe, largest, size)
    return _expanded(light, lobe, expansion, largest, size)


def _facts(made: SplitSum) -> dict[str, Any]:
    """Return what is known of the making of a split sum, with the least value of each level."""
    info = made.info
    rows = zip(made.level_rows(), made.levels, strict=True)
    return {
        "maps": made.cube_count,
        "mapping": made.mapping,
        "domain": info.domain,
        "order_f": info.order_f,
        "order_p": info.order_p,
        "epsilon": info.eps,
        "brdf_energy_captured": info.captured,
        "predicted_error": info.predicted_error,
        "levels": [{**row, "minimum": float(level.min())} for row, level in rows],
    }


@record
class LevelLobe:
    """The lobe of a level, and how the level is to be made."""

    lobe: NormalLobe
    coefficients: BrdfCoefficients
    """The lobe's zonal coefficients, to order 512."""
    order: int
    """The least order that keeps the error in white light within what was asked for; 513 where
    order 512 does not. It is 256 at most for broad lobes (`_KINK`)."""
    in_frequency: bool
    """Whether the level is expanded to that order, and not integrated directly."""

    @property
    def light_order(self) -> int:
        """The order to which the light is to be known."""
        if not self.in_frequency:
            return LEAST_ORDER
        return max(self.order, min(dark_order(self.coefficients), LEAST_ORDER))


def frequency_pays(order: int, alpha: float, rows: int, largest: int) -> bool:
    """Tell whether an expansion costs less time than direct integration, by measured rates.

    `alpha` is the lobe's ggx_alpha, the square of the perceptual roughness. `rows` is the height of
    the probe as a lat-long. `largest` is the most texels along an edge that the level may have.
    """
    texels = 6 * min(choose_size(order), largest) ** 2
    expansion = _SECONDS_A_CUBED_ORDER * order**3 + _SECONDS_A_TEXEL_AND_ORDER * texels * order
    source_rows = _source_rows(rows, alpha)
    pixels = 2 * source_rows**2 * np.sin(_CORE_ANGLE / 2) ** 2
    integration = texels * (_SECONDS_A_TEXEL + _SECONDS_A_PAIR * pixels)
    return bool(expansion <= max(integration, _SOON))


def split_material(brdf: Brdf | None) -> Brdf | None:
    """Return the material whose lobes a split sum is of; None for GGX, which has its own."""
    if brdf is None:
        return None
    if isinstance(brdf, Ggx) and not brdf.isotropic:
        raise BrdfError(
            f"{brdf!r}: brushed GGX is seen in the split sum of all GGX; make it without `brdf`, "
            "and look it up with `anisotropy`, or take a principal map"
        )
    check_varies(brdf)
    if isinstance(brdf, Ggx):
        if brdf.film:
            raise BrdfError(
                f"{brdf!r}: a split sum of GGX is the same with a film and without; make it "
                f"without --brdf, and the film's table by `shrm dfg --brdf`"
            )
        if brdf.values != Ggx().values:
            raise BrdfError(f"{brdf!r}: a split sum of GGX is shown with any f0; leave it out")
        return None
    return brdf


check_brdf = split_material
"""Refuses a BRDF that no split sum is of, before a batch begins."""


def level_lobe(
    roughness: float, error: float, rows: int, largest: int, material: Brdf | None = None
) -> LevelLobe | None:
    """Choose the order of a level's lobe in white light, and the domain where the level is made.

    Returns None where the level is the light itself: at roughness 0, where the lobe is a mirror's.
    """
    lobe = _lobe(roughness, material)
    if roughness == 0 and lobe.width <= _MIRROR:
        return None
    coefficients = cached_coefficients(lobe, MAX_ORDER_F, 0, _ACCURACY, compute_coefficients)
    missed = 1 - coefficients.captured[:, 0]
    enough = missed <= error**2
    order = int(np.argmax(enough)) if enough.any() else MAX_ORDER_F + 1
    if missed[LEAST_ORDER] <= _KINK**2:
        order = min(order, LEAST_ORDER)
    if not lobe.is_peaked:
        return LevelLobe(lobe, coefficients, min(order, MAX_ORDER_F), True)
    pays = order <= MAX_ORDER_F and frequency_pays(order, lobe.width, rows, largest)
    return LevelLobe(lobe, coefficients, order, pays)


def _lobe(roughness: float, material: Brdf | None) -> NormalLobe:
    """Return the lobe of a level; that of roughness 0 is the sharpest that can be integrated."""
    roughness = max(roughness, MIN_ROUGHNESS)
    if material is None:
        return GgxLobe(roughness=roughness)
    return MaterialLobe(material.at_roughness(roughness))


@record(eq=False)
class _Light:
    """The light of all levels: as a probe of so many rows, its coefficients, and their series.

    What is known of all levels is recorded of each, and all cubes have the same sampling.
    """

    probe: Probe
    rows: int
    lighting: Lighting
    series: CubeSeries
    known: MapInfo
    sampling: Sampling


def _mirror(light: _Light, size: int) -> tuple[Array, MapInfo]:
    """Make the level of roughness 0, which is the probe itself.

    The order that it is given is the one that its texels can hold.
    """
    info = replace(light.known, order_f=4 * size // 10, domain="angular")
    probe, target = light.probe, Cube(size, light.sampling)
    kept = probe.kept if isinstance(probe, SharedProbe) else {}
    key = f"on {target!r}"
    if key not in kept:
        kept[key] = to_grid(probe, target)
    cube: Array = kept[key]
    return cube.copy(), info


def _expanded(
    light: _Light, lobe: LevelLobe, expansion: Expansion, largest: int, size: int | None
) -> tuple[Array, MapInfo]:
    """Make a level by multiplying the coefficients of light and lobe, and one synthesis.

    Its order decides how many texels it has, at most `largest`, unless the size is given.
    """
    size = size or min(choose_size(expansion.order), largest)
    cube = synthesized(light.series, expansion.multipliers, size, light.sampling)
    info = replace(
        light.known,
        order_f=expansion.order,
        captured=float(lobe.coefficients.captured[expansion.order, 0]),
        predicted_error=expansion.error,
    )
    return cube, info


def _integrated(
    light: _Light, lobe: LevelLobe, largest: int, size: int | None
) -> tuple[Array, MapInfo]:
    """Make a level in two parts: the lobe's core sums the pixels, its smooth tail is expanded.

    Its order decides how many texels it has, at most `largest`, unless the size is given.
    """
    # Between the pixels of a coarse probe there is light of finer degrees than it resolves.
    known, resolved = light.known, min(light.lighting.order, light.probe.grid.resolved_order)
    kept = light.lighting.coefficients[: (resolved + 1) ** 2]
    lighting = replace(light.lighting, coefficients=kept)
    core, tail, predicted = split_lobe(lobe.lobe, lobe.coefficients, lighting, known.eps)
    order = min(lobe.order, MAX_ORDER_F)
    size = size or min(choose_size(order), largest)
    pixels = latlong_light(light.probe, _source_rows(light.rows, lobe.lobe.width))
    cube = sum_core(core, pixels, cube_directions(size, light.sampling))
    cube += synthesized(light.series, tail[: resolved + 1], size, light.sampling)
    info = replace(known, order_f=order, predicted_error=predicted, domain="angular")
    return cube, info


def _rows(probe: Probe) -> int:
    """Return the rows of a lat-long in world axes that holds a probe for sums over its pixels.

    A probe that is no such lat-long itself is interpolated, which blurs less on twice the rows.
    """
    rows = min(default_size(probe, LatLong), LatLong.largest)
    own = probe.grid == LatLong(rows) and np.array_equal(probe.matrix, np.eye(3))
    return rows if own else min(2 * rows, LatLong.largest)


def _source_rows(rows: int, alpha: float) -> int:
    """Choose the height of the lat-long that a lobe is summed over, from that of the probe.

    It is even, as the sum asks for, so that a probe of an odd number of rows has twice as many.
    """
    least = int(np.ceil(_ROWS_A_LOBE / alpha))
    if rows < least:
        height = min(rows * -(-least // rows), LatLong.largest)
    else:
        height = min(rows, max(2 * least, _MOST_ROWS))
    return height * (1 + height % 2)


def report(result: dict[str, Any]) -> list[str]:
    """Return the lines for people about a split sum, from what ``--json`` prints."""
    levels = result["levels"]
    heading = f"{'roughness':<10} {'texels':>15} {'F':>4}  {'made by':<12} RMS error predicted"
    of = result["brdf"]["name"]
    of = "" if of == "ggx-lobe" else f" of {of}"
    what = f"split sum{of}, {counted(len(levels), 'level')} by the mapping {result['mapping']}"
    lines = [what, heading]
    for level in levels:
        texels = f"6 x {level['size']} x {level['size']}"
        order, error = str(level["order_f"]), f"{level['predicted_error']:.2%}"
        if level["domain"] != "frequency":  # the order of such a level only chose its size
            order = "-"
        if level["domain"] == "probe":
            error = "-"
        made_by = {"frequency": "coefficients", "angular": "integration"}
        lines.append(
            f"{level['roughness']:<10.4g} {texels:>15} {order:>4}  "
            f"{made_by.get(level['domain'], 'resampling'):<12} {error}"
        )
    known = (
        "principal maps do without" if of else "shrm compare PROBE --representations measures it"
    )
    return [*lines, f"beside these, N = V = R is assumed: {known}"]
