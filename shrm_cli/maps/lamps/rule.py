"""The integral of a BRDF over a disc of light: where it is evaluated, and how often.

About the central direction C, longitudes x run in the plane of the view and latitudes y off it,
so that a direction is ``(sin x cos y, sin y, cos x cos y)``. A disc about a, of radius r, lies
within the longitudes of two great circles that touch it, and at each longitude within

    y = atan2(a_y, b) -+ acos(cos r / s),   b = a_x sin x + a_z cos x,   s^2 = a_y^2 + b^2.

A lobe has its peak near C, however small it is beside the disc. Steps are even in asinh(x / w) and
asinh(y / w) therefore, where w is the width of the peak: they are fine near C and grow with the
distance from it. Seen at a grazing angle lobes are narrow across the plane of the view, by the
cosine of the view's angle to the normal, and so is w. The normal is in the plane of the view, so
that the horizon is a pair of longitudes, at which integrals end.

Integrals over y vanish as square roots where the great circles touch the disc; Chebyshev's rule of
the second kind takes them as they are. Where one of them is the horizon instead, x is a sine of
evenly spread angles, and Gauss's rule in these takes both ends. Small angles are told by their
sines, which keep their digits in 32-bit floats, too.

Most points mirror no lamp: beyond some distance from C a disc meets the smooth side of the lobe,
and a few steps do.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import remembered
from shrm_cli.brdf.core import Core
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.maps.kinds import BrushedLight
from shrm_cli.maps.lamps.lobe import TABLE_EXACT, LobeTable
from shrm_cli.probe.disc import Disc
from shrm_cli.records import record
from shrm_cli.sphere.directions import (
    central_directions,
    from_angles,
    horizontal_tangents,
    normalize,
    surface_frames,
)
from shrm_cli.sphere.quadrature import gauss_legendre

Points = tuple[Array, Array, Array, Array]
"""Normals, views, axes of discs and tangents, unit vectors in world axes, shape (..., 3). Tangents
do not matter to isotropic BRDFs."""

LEAST_COSINE = 0.05
"""The cosine of the view's angle below which lobes are not followed any narrower."""
_SIZES = 2, 3, 4, 6, 8, 12, 16, 24, 32, 48
"""Steps in each direction, of which the fewest are taken that are exact enough."""
MORE = 3
"""Steps more where it does: it takes so many for a rule that is good at both kinds of ends."""
EXACT = 1e-3
"""The part of the largest value for a view that a rule may miss."""
_FAR = 1e-2
"""The part of a value that fewer steps may miss where a disc is beyond reach of the lobe."""
_NOTHING = 1e-7
"""What is so small a part of the largest value for a view does not show."""
_REACH = 3.0
"""Widths of the peak and radii of the disc together that are within its reach."""
_BEYOND = 1.0, 1.4, 2.0, 3.0, 5.0
"""Distances of C from the middle of the disc, in reaches, for which that is looked at."""
_MOST_REACH = 1.5
"""The largest reach, radians, beyond which there are few points."""
_TRUTH = 16, 24, 72
"""Steps of rules that the others are compared with: of the second where it differs from the first
by `_SURE` times what a rule may miss, or less, as under smooth lobes; or of the third."""
_SURE = 1e-2
_VIEWS = 1.0, 0.8, 0.5, 0.2
"""Cosines of the views for which they are compared."""
_BESIDE = 0.0, 0.4, 0.8, 0.97, 1.03, 1.3, 2.0
"""Distances of C from the middle of the disc, in radii."""
_AROUND = 0.3, 1.2, 2.1, 3.3
"""Azimuths of that distance from the plane of the view, radians."""
_HEIGHTS = -0.6, -0.2, 0.2, 0.6
"""Heights over the horizon, in radii, where the surface loses sight of a part of the disc."""
_SAMPLES_AT_ONCE = 2**17
"""Values of the BRDF that are computed at a time; as arrays they take some megabytes."""
_TINY = 1e-12


@record
class DiscRule:
    """Where a BRDF is evaluated to integrate it over discs."""

    width: float
    """w, radians."""
    steps: int
    """Longitudes where the horizon does not cut the disc, and latitudes on each of them."""
    reach: float = np.pi
    """The distance of C from the middle of a disc, radians, from which on fewer steps do."""
    few: int = 1
    """The steps there."""

    def longitudes(self, is_cut: bool) -> int:
        """Return how many there are: more where the horizon cuts the disc."""
        return self.steps + MORE if is_cut else self.steps

    @property
    def beyond(self) -> "DiscRule":
        """The rule for what is beyond reach."""
        return DiscRule(self.width, self.few)

    @classmethod
    def of(cls, brdf: Brdf, radius: float, exact: float = EXACT) -> "DiscRule":
        """Choose the rule of the fewest steps that is exact enough for discs of up to a radius."""
        width = float(Core.of(brdf).widths[0])
        normals, views, axes = _trials(brdf, radius)
        tangents = horizontal_tangents(normals)

        def values(steps: int, axes: Array) -> Array:
            rule = cls(width, steps)
            points = normals, views, axes, tangents
            return integrals(rule, brdf, points, radius).sum(axis=-1)

        def misses(found: Array) -> float:
            return float(np.max(np.abs(found - truth) / largest))

        def largest_of(truth: Array) -> Array:
            return np.maximum(truth.max(axis=(1, 2), keepdims=True), _TINY)

        nearly, truth = (values(steps, axes) for steps in _TRUTH[:2])
        largest = largest_of(truth)
        if misses(nearly) > _SURE * exact:
            truth = values(_TRUTH[2], axes)
            largest = largest_of(truth)
        good = (n for n in _SIZES if misses(values(n, axes)) <= exact)
        steps = next(good, _SIZES[-1])
        reach = _REACH * (width + radius)
        if steps == _SIZES[0] or reach > _MOST_REACH:
            return cls(width, steps)
        far = _beside(brdf, normals, views, np.minimum(reach * np.array(_BEYOND), np.pi))
        # Some BRDFs have a second peak towards the view.
        aside = np.sum(
            central_directions(brdf.center, normals, views) * views, axis=-1, keepdims=True
        )
        backwards = np.where(aside < np.cos(reach), views, far[:, :1])
        far = np.concatenate([far, backwards], axis=1)
        truth = values(steps, far)
        # What is seen there may be far less than in the peak.
        largest = np.maximum(truth, _NOTHING * largest)
        few = next((n for n in _SIZES if n < steps and misses(values(n, far)) <= _FAR), steps)
        return cls(width, steps, reach, few) if few < steps else cls(width, steps)


def integrals(
    rule: DiscRule, brdf: Brdf, points: Points, radius: float, dtype: type = np.float64
) -> Array:
    """Integrate the transfer function of a BRDF over a disc, shape (..., 3).

    `brdf` has another central direction than the tangent. `points`, of shape (..., 3) each, are
    broadcastable. `radius` is that of the disc, radians. Single precision as `dtype` takes half of
    the time, and changes results by less than a hundred thousandth: it does for pictures.
    """
    shape = np.broadcast_shapes(*(each.shape for each in points[:3]))
    flat = [np.broadcast_to(each, shape).reshape(-1, 3) for each in points]
    normals, views, axes, _ = flat
    result = np.zeros((len(normals), 3))
    heights = np.sum(normals * axes, axis=-1) if cuts_horizon(brdf) else np.ones(len(normals))
    edge = np.sin(radius)
    is_far = np.zeros(len(result), dtype=bool)
    if rule.reach < np.pi:
        centers = central_directions(brdf.center, normals, views)
        is_far = np.sum(centers * axes, axis=-1) < np.cos(rule.reach)
    for is_cut, there in ((False, heights >= edge), (True, np.abs(heights) < edge)):
        for own, found in (
            (rule, np.flatnonzero(there & ~is_far)),
            (rule.beyond, np.flatnonzero(there & is_far)),
        ):
            at_once = _SAMPLES_AT_ONCE // (own.longitudes(is_cut) * own.steps)
            for part in slices(len(found), at_once):
                some = found[part]
                normals, views, axes, tangents = (each[some] for each in flat)
                own_points = normals, views, axes, tangents
                result[some] = _over(own, brdf, own_points, radius, is_cut, dtype)
    return result.reshape(shape)


def _over(
    rule: DiscRule, brdf: Brdf, points: Points, radius: float, is_cut: bool, dtype: type
) -> Array:
    """Integrate over a disc that the horizon cuts, or one that it does not, for points (n, 3)."""
    normals, views, axes, tangents = points
    centers = central_directions(brdf.center, normals, views)
    frame = _frames(centers, views, axes)
    a_x, a_y, a_z = np.einsum("nij,nj->in", frame, axes)
    low, high = _span(a_x, a_y, a_z, radius)
    if is_cut:
        up_x, _, up_z = np.einsum("nij,nj->in", frame, normals)
        low = np.maximum(low, np.arctan2(up_x, up_z) - np.pi / 2)
        high = np.clip(high, low, np.arctan2(up_x, up_z) + np.pi / 2)
    count = rule.longitudes(is_cut)
    x, over_x = _stepped(sines(count) if is_cut else chebyshev(count), low, high, rule.width)
    middle, half = _latitudes(x, a_x[:, None], a_y[:, None], a_z[:, None], radius)
    cosines = np.maximum(np.sum(normals * views, axis=-1), LEAST_COSINE)
    low, high = np.maximum(middle - half, -np.pi / 2), np.minimum(middle + half, np.pi / 2)
    width = rule.width * cosines[:, None]
    y, weights = _stepped(gauss_legendre(rule.steps), low, high, width, dtype)
    own = _frames(normals, views, centers) if brdf.isotropic else surface_frames(normals, tangents)
    # Of the direction at x and y, sin(x) cos(y), sin(y) and cos(x) cos(y), in the surface's axes.
    # Each axis is an array of its own: numpy is slow along axes of three.
    turn = np.einsum("nik,njk->ijn", own, frame)
    sine_x, cosine_x, sine_y, cosine_y = np.sin(x), np.cos(x), np.sin(y), np.cos(y)
    light = np.empty((3, *y.shape), dtype)
    for axis, (side, up, ahead) in zip(light, turn[..., None], strict=True):
        across = (side * sine_x + ahead * cosine_x).astype(dtype)
        np.multiply(across[..., None], cosine_y, out=axis)
        axis += up[..., None].astype(dtype) * sine_y
    weights *= cosine_y
    weights *= over_x[..., None]
    view = np.einsum("nj,nij->ni", views, own)[:, None, None].astype(dtype)
    values = brdf.transfer(np.moveaxis(light, 0, -1), view)
    return np.asarray(np.einsum("nxyc,nxy->nc", values, weights))


def _span(a_x: Array, a_y: Array, a_z: Array, radius: float) -> tuple[Array, Array]:
    """Return the longitudes of the great circles that touch a disc."""
    flat, sine = np.hypot(a_x, a_z), np.sin(radius)
    half = np.arcsin(np.minimum(sine / np.maximum(flat, sine), 1.0))
    half = np.where(np.abs(a_y) >= np.cos(radius), np.pi, half)  # it holds the pole
    middle = np.arctan2(a_x, a_z)
    return middle - half, middle + half


def _stepped(
    rule: tuple[Array, Array],
    low: Array,
    high: Array,
    width: float | Array,
    dtype: type = np.float64,
) -> tuple[Array, Array]:
    """Return angles (..., n) between two, even in asinh(angle / width), and their weights."""
    low, high = np.arcsinh(low / width), np.arcsinh(high / width)
    middle: Array = ((low + high) / 2).astype(dtype)[..., None]
    half: Array = ((high - low) / 2).astype(dtype)[..., None]
    width = np.asarray(width, dtype)[..., None]
    sinh = np.sinh(middle + half * rule[0].astype(dtype))
    return width * sinh, half * width * rule[1].astype(dtype) * np.sqrt(1 + sinh**2)


def _latitudes(x: Array, a_x: Array, a_y: Array, a_z: Array, radius: float) -> tuple[Array, Array]:
    """Return the middle of the disc's latitudes at some longitudes, and half of their span."""
    turn = x - np.arctan2(a_x, a_z)
    flat = np.hypot(a_x, a_z)
    b = flat * np.cos(turn)
    reach = np.hypot(a_y, b)
    # s - cos r = (1 - cos r) - (1 - s), and 1 - s^2 is what the turn takes from 1.
    above = 2 * np.sin(radius / 2) ** 2 - (flat * np.sin(turn)) ** 2 / (1 + reach)
    share = np.clip(above / np.maximum(2 * reach, _TINY), 0.0, 1.0)
    return np.arctan2(a_y, b), 2 * np.arcsin(np.sqrt(share))


def _frames(up: Array, towards: Array, other: Array) -> Array:
    """Axes as rows, whose z is `up` and whose x is in the plane of `towards`, (..., 3, 3).

    Where these are parallel it is in the plane of `other`, or any.
    """
    side, missing = np.zeros(up.shape), np.ones((*up.shape[:-1], 1), dtype=bool)
    for helper in (towards, other, np.eye(3)[1], np.eye(3)[0]):
        # It vanishes for parallel vectors, which rotations may leave a little off unit length.
        across = np.cross(up, helper)
        sine = np.linalg.norm(across, axis=-1, keepdims=True)
        found = missing & (sine > 1e-6)
        side = np.where(found, across / np.maximum(sine, _TINY), side)
        missing = missing & ~found
        if not missing.any():
            break
    return np.stack([np.cross(side, up), side, up], axis=-2)


@cache
def chebyshev(count: int) -> tuple[Array, Array]:
    """Return the rule of the second kind of Chebyshev's nodes: exact for ``sqrt(1-x^2)`` p(x)."""
    angles = np.pi * np.arange(1, count + 1) / (count + 1)
    return np.cos(angles), np.sin(angles) * np.pi / (count + 1)


@cache
def sines(count: int) -> tuple[Array, Array]:
    """Return a rule on -1 .. 1 for functions that are square roots at its ends, or smooth there."""
    nodes, weights = gauss_legendre(count)
    angles = np.pi / 2 * nodes
    return np.sin(angles), np.pi / 2 * weights * np.cos(angles)


def _trials(brdf: Brdf, radius: float) -> tuple[Array, Array, Array]:
    """Return normals, views and axes of discs, shape (views, distances, azimuths, 3)."""
    cosines = np.array(_VIEWS)[:, None, None]
    views = from_angles(np.arccos(cosines), 0.0)
    normals = np.broadcast_to(np.eye(3)[2], views.shape)
    axes = _beside(brdf, normals, views, radius * np.array(_BESIDE))
    heights = radius * np.array(_HEIGHTS)[:, None]
    low = np.broadcast_to(
        from_angles(np.pi / 2 - heights, np.array(_AROUND)),
        (*axes.shape[:1], len(_HEIGHTS), len(_AROUND), 3),
    )
    return normals, views, np.concatenate([axes, low], axis=1)


def _beside(brdf: Brdf, normals: Array, views: Array, distances: Array) -> Array:
    """Return axes of discs at some distances from C, shape (views, distances, azimuths, 3)."""
    frame = _frames(central_directions(brdf.center, normals, views), views, np.eye(3)[0])
    beside = from_angles(distances[:, None], np.array(_AROUND))
    return normalize(np.einsum("...j,...ji->...i", beside, frame))


# ---- what a BRDF reflects of discs ---------------------------------------------------------------


@record(eq=False)
class LitDiscs(BrushedLight):
    """Discs of light, and the BRDF that reflects them."""

    brdf: Brdf
    """A BRDF that is not about the tangent."""
    discs: tuple[Disc, ...]
    """The discs, in world axes."""
    dtype: type = np.float64
    """The precision, as `integrals` takes it."""

    @cached_property
    def rules(self) -> tuple[DiscRule, ...]:
        """How each of them is integrated: as the largest of about its size needs it.

        A lamp of many discs has a large one, and small ones for its rim. These need a tenth of the
        steps. Beyond reach all take as many, as in shaders.
        """
        radii = np.array([disc.radius for disc in self.discs])
        # A rule for each octave would take longer to find than its steps save.
        kinds = np.floor(np.log2(radii.max() / radii) / 2)
        largest = [float(radii[kinds == kind].max()) for kind in kinds]
        exact = TABLE_EXACT if isinstance(self.brdf, LobeTable) else EXACT

        def rule(radius: float) -> DiscRule:
            make = partial(DiscRule.of, self.brdf, radius, exact)
            return remembered(self.brdf, ("disc rule", radius), make)

        found = {radius: rule(radius) for radius in set(largest)}
        few = max(each.few for each in found.values())
        return tuple(replace(found[radius], few=few) for radius in largest)

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        normals, tangents, views = (
            np.asarray(each, dtype=float) for each in (normals, tangents, views)
        )
        result = np.zeros(np.broadcast_shapes(normals.shape, views.shape))
        for disc, rule in zip(self.discs, self.rules, strict=True):
            points = normals, views, disc.direction, tangents
            result += disc.radiance * integrals(rule, self.brdf, points, disc.radius, self.dtype)
        return result


def disc_records(discs: Sequence[Disc]) -> list[dict[str, object]]:
    """Return discs by the names that light files have, for files and for people."""
    return [
        {
            "direction": disc.direction.tolist(),
            "radius": float(np.degrees(disc.radius)),
            "radiance": disc.radiance.tolist(),
        }
        for disc in discs
    ]
