"""What is seen of maps: spheres of many materials, as maps were and as they are, beside the truth.

Maps used to hold the orders F and P that the tolerance asks for, and no more. Now they carry every
order of the light that is visible and that their cubes support, at the same number of bytes. The
maps as they were can still be made, by giving the orders and the size by hand.

The truth is a sum over all pixels of the probes, which maps and truth take averaged down to the
same number of rows. For the pictures it serves all probes at once, because the lobe is the same for
all of them. Errors of a map as a whole are measured elsewhere: at pairs of a mirror direction and a
view that are drawn where the light is.
"""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from research.extent import FULL, Extent
from research.glossy_truth import Light, Sphere, light_of, sphere
from research.inputs import say, small_probes
from research.looked_up import looked_up
from research.pairs import Pairs, bright_pairs
from shrm_cli import settings
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.brdf.lobe_expansion import lobe_width
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.base import Map
from shrm_cli.maps.size import supported_order, total_error
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.render.camera import Viewer
from shrm_cli.render.seen import can_flip, hdr_flip, seen_errors
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.directions import horizontal_tangents
from shrm_cli.vocabulary import COARSE_ROWS, MAX_PRINCIPAL_MAPS

Array = NDArray[np.floating]
Way = Callable[[Map], tuple[str, dict[str, Any]]]
"""From the map that the defaults make, what else is made for comparison: a representation and its
options."""

VIEWERS = Viewer(0, 0), Viewer(120, 20), Viewer(240, -20)
"""Those of `shrm compare`."""

CMFT_SECONDS = {8: 7.4, 32: 3.0, 64: 1.7, 512: 0.25}
"""Seconds that cmft took for one Phong lobe of an exponent on a cube of 128 x 128 faces, with two
cores and its source resampled to 128."""
CMFT_P95 = 0.024, 0.063
"""The least and the largest p95 of these four cubes, under a 1024 x 512 probe with a small sun."""
CMFT_PART = 0.1
"""The part of cmft's least p95 that ours may have."""

_AT_ONCE = 2**17
"""Pairs of a pixel and a light that are computed at a time."""
_NEIGHBORS = 16
"""Pixels that are lit together; lights below the horizons of all of them are left out."""
_LEAST_PIXELS = 3
"""The pixels within which half of the energy of a lobe must lie."""
_STRICTER = 0.1
"""The tolerance, in units of the default's, that asks for more than the default's bytes."""
_TEXELS = 1000
"""The texels of a cube that are compared with the truth."""


def before(default: Map) -> tuple[str, dict[str, Any]]:
    """The map with nothing beyond F, at the same bytes."""
    return "shrm", _by_hand(default, default.info.order_f)


def view_alone(default: Map) -> tuple[str, dict[str, Any]]:
    """The map whose only visible error is that its view goes to P: three times the order F.

    It has the same size, and goes no further than its cubes support.
    """
    most = supported_order(default.size)
    order = max(default.info.order_carried, min(3 * default.info.order_f, most))
    return "shrm", _by_hand(default, order)


def principal(default: Map) -> tuple[str, dict[str, Any]]:
    """As many principal maps as the default has coefficients of the view, and as large ones.

    Where these are more than principal maps may have, the bytes that are left go into the size.
    """
    maps = min(default.cube_count, MAX_PRINCIPAL_MAPS)
    size = int(default.size * np.sqrt(default.cube_count / maps))
    return "principal", {"maps": maps, "size": size}


def same_bytes(default: Map) -> tuple[str, dict[str, Any]]:
    """The best principal map of the default's bytes, whatever the number of its cubes."""
    size = 2 * sum(plane.size for plane in default.planes())
    return "principal", {"eps": _STRICTER * default.info.eps, "max_size": size}


AFTER, BEFORE, VIEW_ALONE = "after", "before", "P alone"
PRINCIPAL, SAME_BYTES = "principal", "principal, same bytes"


def ways(brdf: Brdf) -> dict[str, Way]:
    """Return what the default map of a BRDF is compared with."""
    if brdf.zonal:
        return {BEFORE: before}
    return {
        BEFORE: before, VIEW_ALONE: view_alone, SAME_BYTES: same_bytes, PRINCIPAL: principal,
    }  # fmt: skip


def _by_hand(default: Map, order_f: int) -> dict[str, Any]:
    info = default.info
    # A tolerance that the orders cannot meet would have them searched for in vain.
    eps = max(info.eps, 1 - 0.99 * info.captured)
    return {"order_f": order_f, "order_p": info.order_p, "size": default.size, "eps": eps}


@dataclass(frozen=True)
class Seen:
    """How far the spheres of one map are from the truth.

    Attributes
    ----------
    spec, probe, way : str
        The BRDF, the name of the probe, and `AFTER`, or a key of `ways`.
    zonal : bool
        Whether the lobe depends on nothing but the angle to its center.
    order_f, order_p, carried, size : int
    bytes : int
        The map's values in half precision, before they are packed.
    median, p95, negative : float
        As `SeenErrors` has them, over the pixels of all views.
    rms, predicted : float
        The relative RMS error over the measure of `Pairs`, and the predicted one.
    gpu_rms, gpu_predicted : float
        The same with bilinear look-ups in half precision, as on a GPU.
    flip : float
        The mean of HDR-FLIP over the pixels, nan where it is not installed.
    seconds : float
        What making the map took.
    """

    spec: str
    probe: str
    way: str
    zonal: bool
    order_f: int
    order_p: int
    carried: int
    size: int
    bytes: int
    median: float
    p95: float
    negative: float
    rms: float
    predicted: float
    gpu_rms: float
    gpu_predicted: float
    flip: float
    seconds: float


def measure(probes: Sequence[Probe], extent: Extent = FULL) -> Iterator[list[Seen]]:
    """Compare the maps of each BRDF with the truth; yields the rows of one BRDF at a time.

    Parameters
    ----------
    probes : sequence of Probe
        Lat-longs of one size, which are averaged down to the rows that each lobe needs.
    extent : Extent
        Which BRDFs, which must be grey, and how large the pictures are.
    """
    spheres = [sphere(viewer.direction, extent.seen_picture) for viewer in VIEWERS]
    opened, lights = probes, dict[int, tuple[Sequence[Probe], Light]]()
    for spec in extent.seen:
        brdf = parse_spec(spec)
        height = min(_rows(brdf, extent), opened[0].height)
        if height not in lights:
            small = small_probes(opened, height)
            lights[height] = small, _light_of_areas(small)
        probes, light = lights[height]
        truths = [lit(brdf, each.normals, each.views, light) for each in spheres]
        rows = []
        for k, probe in enumerate(probes):
            say(f"what is seen of {spec} under {probe.name}")
            own = slice(3 * k, 3 * k + 3)
            made = make_maps(brdf, probe)
            pairs = error_pairs(made, extent.seen_pairs)
            alone = Light(light.directions, light.power[:, own])
            truth = lit(brdf, pairs.normals, pairs.views, alone)
            pictures = [truth[:, own] for truth in truths]
            for way, (each, seconds) in made.items():
                errors = _errors(each, pairs, truth)
                rows.append(_row(spec, brdf, probe, way, each, seconds, spheres, pictures, errors))
        yield rows


def _light_of_areas(probes: Sequence[Probe]) -> Light:
    """Turn probes into lights whose pixels are as bright all over, as maps of coarse ones are."""
    times = -(-COARSE_ROWS // probes[0].height)
    parts = [each.image().repeat(times, axis=0).repeat(times, axis=1) for each in probes]
    cut = [Probe.from_array(pixels, layout="latlong") for pixels in parts]
    return light_of(cut, cut[0].height)


def _rows(brdf: Brdf, extent: Extent) -> int:
    """Return the rows of probes whose pixels, as lights, are dense enough for a lobe.

    The truth is a sum over points, whose light has waves of every length. A map has those that the
    pixels resolve, and a lobe with heavy tails that is few pixels wide shows the difference.
    """
    pixel = np.pi / extent.seen_rows
    is_sharp = not brdf.zonal and lobe_width(brdf) < _LEAST_PIXELS * pixel
    return extent.seen_rows * (2 if is_sharp else 1)


def make_maps(brdf: Brdf, probe: Probe) -> dict[str, tuple[Map, float]]:
    """Make the default map of a BRDF and all that it is compared with, and time it."""
    started = time.perf_counter()
    # One map, since the orders of several terms cannot be given by hand.
    default = prefilter_with_facts(probe, "shrm", {"brdf": brdf, "split": False}).map
    made = {AFTER: (default, time.perf_counter() - started)}
    for way, choose in ways(brdf).items():
        to, options = choose(default)
        started = time.perf_counter()
        other = prefilter_with_facts(probe, to, {"brdf": brdf, **options}).map
        made[way] = other, time.perf_counter() - started
    return made


def error_pairs(made: dict[str, tuple[Map, float]], count: int) -> Pairs:
    """Draw the pairs that tell the errors of the maps that `make_maps` returns."""
    judged = [way for way in (SAME_BYTES, PRINCIPAL) if way in made] or [BEFORE]
    return bright_pairs(made[AFTER][0], [made[way][0] for way in judged], count)


def _row(
    spec: str,
    brdf: Brdf,
    probe: Probe,
    way: str,
    each: Map,
    seconds: float,
    spheres: Sequence[Sphere],
    pictures: Sequence[Array],
    errors: tuple[float, float, float, float],
) -> Seen:
    """Measure one map."""
    found = [each.radiance(ball.normals, ball.views) for ball in spheres]
    seen = seen_errors(np.concatenate(found), np.concatenate(pictures))
    info = each.info
    return Seen(
        spec, probe.name, way, brdf.zonal, info.order_f, info.order_p, info.order_carried,
        each.size, 2 * sum(plane.size for plane in each.planes()),
        seen.median_relative_error, seen.p95_relative_error, seen.negative_share,
        *errors, _flip(found, pictures, spheres), seconds,
    )  # fmt: skip


def _errors(each: Map, pairs: Pairs, truth: Array) -> tuple[float, float, float, float]:
    """Return the relative RMS error of a map and the predicted one, and both as on a GPU."""
    found = each.radiance(pairs.normals, pairs.views)
    shown = looked_up(each, pairs.normals, pairs.views)
    predicted = float(np.hypot(each.info.predicted_error, each.info.added_error))
    whole = total_error(predicted, each.info.filter_error)
    return pairs.error(found, truth), predicted, pairs.error(shown, truth), whole


def _flip(found: Sequence[Array], truths: Sequence[Array], spheres: Sequence[Sphere]) -> float:
    """Return the mean of HDR-FLIP over the pixels of all spheres, which stand before black."""
    if not can_flip():
        return float("nan")
    means = []
    for ours, truth, ball in zip(found, truths, spheres, strict=True):
        pictures = np.zeros((2, *ball.inside.shape, 3))
        pictures[0, ball.inside], pictures[1, ball.inside] = ours, truth
        error = hdr_flip(pictures[0], pictures[1], ball.inside)
        means.append(float("nan") if error is None else error.mean)
    return float(np.mean(means))


def lit(brdf: Brdf, normals: Array, views: Array, light: Light) -> Array:
    """Integrate what a grey BRDF reflects, by a sum over all lights.

    Parameters
    ----------
    brdf : Brdf
    normals, views : ndarray, shape (n, 3)
        Unit vectors in world axes; views point to the viewer.
    light : Light
        Probes as lights.

    Returns
    -------
    ndarray, shape (n, 3 * probes)
    """
    tangents = horizontal_tangents(normals)
    frames = np.stack([tangents, np.cross(normals, tangents), normals], axis=1).astype(np.float32)
    local_views = np.einsum("nij,nj->ni", frames, views).astype(np.float32)
    has_horizon = cuts_horizon(brdf)

    def work(start: int) -> Array:
        part = slice(start, start + _NEIGHBORS)
        own = frames[part]
        sums = np.zeros((len(own), light.power.shape[1]))
        above = slice(None)
        if has_horizon:
            above = (light.directions @ own[:, 2].T > 0).any(axis=1)
        directions, power = light.directions[above], light.power[above]
        step = max(_AT_ONCE // len(own), 1)
        for first in range(0, len(directions), step):
            some = slice(first, first + step)
            local = np.moveaxis(own @ directions[some].T, 1, -1)
            values = brdf.transfer(local, local_views[part][:, None])
            if values.strides[-1] != 0:
                raise ValueError(f"{brdf!r} is coloured")
            sums += values[..., 0].astype(np.float32) @ power[some]
        return sums

    with ThreadPoolExecutor(settings.current().threads or os.cpu_count()) as pool:
        return np.concatenate(list(pool.map(work, range(0, len(frames), _NEIGHBORS))))


def find(rows: Sequence[Seen], spec: str, probe: str, way: str) -> Seen:
    """Return the one row of a BRDF, a probe and a way."""
    (found,) = (each for each in rows if (each.spec, each.probe, each.way) == (spec, probe, way))
    return found


# ---- beside cmft ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class PhongCube:
    """A prefiltered Phong lobe, against the truth at texels of its cube.

    Attributes
    ----------
    exponent : int
    seconds : float
        What making the map takes, with the coefficients of the BRDF.
    median, p95 : float
        Of the relative error of the luminance.
    """

    exponent: int
    seconds: float
    median: float
    p95: float

    @property
    def keeps_bar(self) -> bool:
        return self.p95 <= CMFT_PART * CMFT_P95[0]


def phong_cubes(probe: Probe, size: int = 128) -> list[PhongCube]:
    """Make the cubes that cmft was measured with, and compare texels drawn at random."""
    light = light_of([probe], probe.height)
    texels = cube_directions(size).reshape(-1, 3)
    chosen = texels[np.random.default_rng(128).choice(len(texels), _TEXELS, replace=False)]
    rows = []
    for exponent in CMFT_SECONDS:
        brdf = parse_spec(f"phong:exponent={exponent}")
        with settings.using(cache=False):
            started = time.perf_counter()
            made = prefilter_with_facts(probe, "shrm", {"brdf": brdf, "size": size}).map
            seconds = time.perf_counter() - started
        seen = seen_errors(made.radiance(chosen, chosen), lit(brdf, chosen, chosen, light))
        rows.append(
            PhongCube(exponent, seconds, seen.median_relative_error, seen.p95_relative_error)
        )
    return rows
