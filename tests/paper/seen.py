"""What is seen of maps: spheres of many materials, as maps were and as they are, beside the truth.

Maps used to hold the orders F and P that the tolerance asks for, and no more. Now they carry every
order of the light that is visible and that their cubes support, at the same number of bytes. The
maps as they were can still be made, by giving the orders and the size by hand.

The truth is a sum over all pixels of the probes, which maps and truth take averaged down to the
same number of rows. It serves all probes at once, because the lobe is the same for all of them.
"""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli import settings
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.base import Map
from shrm_cli.maps.size import supported_order
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.render.camera import Viewer
from shrm_cli.render.flip import can_flip, hdr_flip
from shrm_cli.render.seen import seen_errors
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.directions import horizontal_tangents
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.vocabulary import REPRESENTATIONS
from tests.paper.glossy_truth import Light, Sphere, light_of, sphere

Array = NDArray[np.floating]
Way = Callable[[Map], tuple[str, dict[str, Any]]]
"""From the map that the defaults make, what else is made for comparison: a representation and its
options."""

ROWS = 256
"""Probes are averaged down to this height."""
SPECS = (
    "lambertian", "phong:exponent=32", "phong:exponent=64", "phong:exponent=512",
    "microfacet:sigma=0.1", "microfacet:sigma=0.2", "microfacet:sigma=0.5", "oren-nayar",
    "ggx:roughness=0.3,f0=1", "ggx:roughness=0.5,f0=1", "ggx:roughness=0.7,f0=1",
    "ggx:roughness=0.3,f0=0.04", "ggx:roughness=0.5,f0=0.04", "ggx:roughness=0.7,f0=0.04",
)  # fmt: skip
VIEWERS = Viewer(0, 0), Viewer(120, 20), Viewer(240, -20)
"""Those of `shrm compare`."""
SIZE = 40
"""Width and height of a sphere's picture, pixels."""

ZONAL_P95 = 0.03
"""The largest p95 that lobes without a dependence on the view may have."""
OTHER_P95 = 1.15
"""The largest p95 of other lobes, in units of that of the map with the same P alone."""

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
_TEXELS = 1000
"""The texels of a cube that are compared with the truth."""


def before(default: Map) -> tuple[str, dict[str, Any]]:
    """The map with nothing beyond F, at the same bytes."""
    info = default.info
    return "shrm", _by_hand(default, info.order_f, default.size)


def view_alone(default: Map) -> tuple[str, dict[str, Any]]:
    """The map whose only visible error is that its view goes to P: three times the order F.

    Where cubes of the default's size do not support it, they are twice as large, and it is lowered
    to what these support.
    """
    info, size = default.info, default.size
    order = max(info.order_carried, min(3 * info.order_f, supported_order(2 * size)))
    return "shrm", _by_hand(default, order, size if order <= supported_order(size) else 2 * size)


def principal(default: Map) -> tuple[str, dict[str, Any]]:
    """As many principal maps as the default has coefficients of the view."""
    return "principal", {"maps": default.cube_count}


AFTER, BEFORE, VIEW_ALONE, PRINCIPAL = "after", "before", "P alone", "principal"


def ways(brdf: Brdf) -> dict[str, Way]:
    """Return what the default map of a BRDF is compared with."""
    found: dict[str, Way] = {BEFORE: before}
    if not brdf.zonal:
        found[VIEW_ALONE] = view_alone
        if PRINCIPAL in REPRESENTATIONS:
            found[PRINCIPAL] = principal
    return found


def _by_hand(default: Map, order_f: int, size: int) -> dict[str, Any]:
    info = default.info
    # A tolerance that the orders cannot meet would have them searched for in vain.
    eps = max(info.tolerance, 1 - 0.99 * info.captured)
    return {"order_f": order_f, "order_p": info.order_p, "size": size, "eps": eps}


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
        The relative RMS error of these pixels, and the predicted one.
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
    flip: float
    seconds: float


def small_probes(probes: Sequence[Probe], rows: int = ROWS) -> list[Probe]:
    """Average probes down to lat-longs of the same number of rows, and keep their names."""
    return [
        Probe.from_array(to_grid(each, LatLong(rows)), layout="latlong", name=Path(each.name).stem)
        for each in probes
    ]


def measure(
    probes: Sequence[Probe], specs: Sequence[str] = SPECS, size: int = SIZE
) -> Iterator[list[Seen]]:
    """Compare the maps of each BRDF with the truth; yields the rows of one BRDF at a time.

    Parameters
    ----------
    probes : sequence of Probe
        Lat-longs of one size; see `small_probes`.
    specs : sequence of str
        Specifications of grey BRDFs.
    size : int
        Width and height of a sphere's picture, pixels.
    """
    light = light_of(probes, probes[0].height)
    spheres = [sphere(viewer.direction, size) for viewer in VIEWERS]
    for spec in specs:
        brdf = parse_spec(spec)
        truths = [lit(brdf, each.normals, each.views, light) for each in spheres]
        rows = []
        for k, probe in enumerate(probes):
            own = [truth[:, 3 * k : 3 * k + 3] for truth in truths]
            rows += _rows(spec, brdf, probe, spheres, own)
        yield rows


def _rows(
    spec: str, brdf: Brdf, probe: Probe, spheres: Sequence[Sphere], truths: Sequence[Array]
) -> list[Seen]:
    """Measure the default map of one BRDF and probe, and all that it is compared with."""
    started = time.perf_counter()
    # One map, since the orders of several terms cannot be given by hand.
    default = prefilter_with_facts(probe, "shrm", {"brdf": brdf, "split": False}).map
    made = {AFTER: (default, time.perf_counter() - started)}
    for way, choose in ways(brdf).items():
        to, options = choose(default)
        started = time.perf_counter()
        other = prefilter_with_facts(probe, to, {"brdf": brdf, **options}).map
        made[way] = other, time.perf_counter() - started
    rows = []
    for way, (each, seconds) in made.items():
        found = [each.radiance(ball.normals, ball.views) for ball in spheres]
        seen = seen_errors(np.concatenate(found), np.concatenate(truths))
        error, whole = np.concatenate(found) - np.concatenate(truths), np.concatenate(truths)
        info = each.info
        rows.append(Seen(
            spec, probe.name, way, brdf.zonal, info.order_f, info.order_p, info.order_carried,
            each.size, 2 * sum(plane.size for plane in each.planes()),
            seen.median_relative_error, seen.p95_relative_error, seen.negative_share,
            float(np.sqrt(np.mean(error**2) / np.mean(whole**2))),
            float(np.hypot(info.predicted_error, info.added_error)),
            _flip(found, truths, spheres), seconds,
        ))  # fmt: skip
    return rows


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


# ---- bars ----------------------------------------------------------------------------------------


def misses(row: Seen, rows: Sequence[Seen]) -> list[str]:
    """Return a line for each bar that a default map misses; `rows` hold what it is compared with.

    The p95 of lobes without a dependence on the view is at most `ZONAL_P95`, and none of their
    pixels is negative. That of other lobes is at most `OTHER_P95` times what their P alone costs.
    """
    case, bar, lines = f"{row.spec} under {row.probe}", bar_of(row, rows), []
    if row.p95 > bar:
        lines.append(f"{case}: p95 {row.p95:.2%}, the bar is {bar:.2%}")
    if row.zonal and row.negative > 0:
        lines.append(f"{case}: {row.negative:.2%} of the pixels are negative")
    return lines


def bar_of(row: Seen, rows: Sequence[Seen]) -> float:
    """Return the largest p95 that the default map of a row may have."""
    return ZONAL_P95 if row.zonal else OTHER_P95 * find(rows, row.spec, row.probe, VIEW_ALONE).p95


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
