"""The levels of a split sum: expansions of broad lobes, and sharp ones in two parts.

A level is the light with each degree l multiplied by a number of the lobe. The least order that
keeps the error decides how many texels the level has, because texels cost storage. Degrees cost
none, so more of them are carried than that. They fade out slowly: an expansion that ends abruptly
rings about lamps, and the rings are large beside the light of dark places.

The core of a sharp lobe is summed over pixels, and its tail is expanded. The core fades out
smoothly with the angle from the lobe's axis, so that the tail is smooth and a few hundred degrees
hold it. Behind a core that ended abruptly the tail would begin with a step.

A core is narrow, so that a group of neighboring directions needs a small window of pixels of a
lat-long: some rows, and as many columns as the core is wide at that latitude, which are all of them
near a pole. Directions of nearly one latitude are a band, and share their rows; groups are parts of
bands.

What takes time are the values of the core at these pixels. But a lat-long of an even number of rows
stays the same if it is turned about its axis by quarters, or mirrored from left to right or from
top to bottom: these are 16 symmetries together, and cubes have them too. So the directions are
folded into a 16th of the sphere, and the values of one window are multiplied with 16 images of the
light, which side by side are one matrix.
"""

from collections.abc import Iterator

import numpy as np

from shrm_cli import progress
from shrm_cli.arrays import Array, Indices, relative_rms, slices
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.brdf.environment.lobe import NormalLobe
from shrm_cli.maps.size import Band
from shrm_cli.orders import first_enough
from shrm_cli.probe.lighting import Lighting
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles
from shrm_cli.sphere.harmonics import legendre_degrees
from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.sphere.synthesis import CubeSeries
from shrm_cli.vocabulary import MAX_ORDER_F, Sampling

DARK_ERROR = 3e-4
"""Degrees are carried until the RMS of what is left beyond them is this part of the mean radiance.
An error that is relative to the RMS of the level says little about dark places, because lamps make
that RMS many times the mean."""


@record(eq=False)
class Expansion:
    """What the degrees of the light are multiplied with for a level, and what is known of it."""

    multipliers: Array
    """One number a degree; for l = 0 it is 1, shape (carried + 1,)."""
    order: int
    """The least order that keeps the error, or the largest that the light has."""
    error: float
    """The predicted relative RMS error of the level."""


def expand(lighting: Lighting, coefficients: BrdfCoefficients, tolerance: float) -> Expansion:
    """Choose the degrees of a level: the order that keeps an error, and those carried beyond it.

    `coefficients` are coefficients of a zonal lobe, to at least the light's order. `tolerance` is
    the relative RMS error that the order may leave.
    """
    passed = multipliers(coefficients)
    light, missing = energies(lighting, passed)
    whole = light[0] + missing[0]
    order = first_enough(missing <= tolerance**2 * whole)
    dark = first_enough(missing <= DARK_ERROR**2 * light[0])
    carried = max(order, min(dark, lighting.resolved_order))
    fade = Band(order, carried).factors
    lost = float(light[: carried + 1] @ (1 - fade) ** 2 + missing[carried])
    error = relative_rms(lost, whole)
    return Expansion(passed[: carried + 1] / passed[0] * fade, order, error)


def dark_order(coefficients: BrdfCoefficients) -> int:
    """Return the order to which any light is to be known, so that dark places keep theirs.

    No light has more of each degree, beside its mean, than a single lamp, which has as much of all.
    """
    passed = multipliers(coefficients)
    light = (2 * np.arange(len(passed)) + 1) * passed**2
    return first_enough(_beyond(light) <= DARK_ERROR**2 * light[0])


def unknown_light(lighting: Lighting, passed: Array) -> float:
    """Estimate the energy of the filtered light that is beyond the light's expansion.

    Two estimates are made, and the smaller one counts. In the first, the light goes on as white
    light does, with ``(2l+1)`` times the mean power of its last 16 degrees. In the second, all
    energy of the light that is left sits in the degree that the lobe passes most of.

    `passed`, of shape (degrees,), holds the squared multipliers of the lobe.
    """
    known = lighting.resolved_order + 1
    power = lighting.power().sum(axis=1)
    rest = max(float(lighting.energy.sum() - power.sum()), 0.0)
    width = 2 * np.arange(len(passed)) + 1
    last = slice(max(known - 16, 0), known)
    density = power[last].sum() / width[last].sum()
    white = density * float(width[known:] @ passed[known:])
    return min(white, rest * float(passed[known:].max(initial=0.0)))


def multipliers(coefficients: BrdfCoefficients) -> Array:
    """Return what a zonal lobe multiplies the light's degrees with; for l = 0, its integral."""
    values = coefficients.values[:, 0, 0, 0]
    return values / np.sqrt(2 * np.arange(len(values)) + 1)


def synthesized(light: CubeSeries, passed: Array, size: int, sampling: Sampling) -> Array:
    """Synthesize light with its degrees multiplied, to the lower of both orders: (6N, N, 3)."""
    planes = light.planes(size, sampling, factors=passed[: light.order + 1])
    return np.ascontiguousarray(planes.transpose(1, 2, 0))


def energies(lighting: Lighting, passed: Array) -> tuple[Array, Array]:
    """Return the energy of a level in each degree that is known of the light, and beyond each."""
    light = lighting.power().sum(axis=1) * passed[: lighting.order + 1] ** 2
    beyond = unknown_light(lighting, passed**2)
    return light, _beyond(light) + beyond


def _beyond(energy: Array) -> Array:
    """Return the energy beyond each degree, from that in each."""
    return np.asarray(np.cumsum(energy[::-1])[::-1] - energy)


_NODES = 256
"""Gauss's nodes over the angle of a core."""
_LEAST_ANGLE = 9.0
"""The angle, radians, at which the smallest core ends that is tried, times the light's order."""
_GROWTH = 1.25
"""How much wider each core is than the one that was tried before it."""


class LobeCore(NormalLobe):
    """The part of a lobe about its axis that fades out at an angle.

    With ``x = sin(theta / 2) / sin(angle / 2)`` it is the lobe times ``1 - I_x(8, 4)``, where I is
    the regularized incomplete beta function. The tail begins as x^8, which outweighs the lobe's
    own fall (GGX falls with theta^-4), and it joins the lobe with three derivatives at the angle.

    `angle` is where the core ends, radians.
    """

    def __init__(self, lobe: NormalLobe, angle: float) -> None:
        self.name, self.values, self.width = lobe.name, lobe.values, lobe.width
        self.lobe, self.angle = lobe, angle
        self._end = float(np.sin(angle / 2))

    def radial(self, square_sine: Array) -> Array:
        x = np.minimum(np.sqrt(square_sine) / self._end, 1)
        x4 = (x * x) * (x * x)
        # In powers of 1 - x, which do not cancel where the core is small.
        y = 1 - x
        y2 = y * y
        kept = (
            y2 * y2 * (1 + x * (4 + x * (10 + 20 * x)) + x4 * (35 + x * (56 + x * (84 + 120 * x))))
        )
        return self.lobe.radial(square_sine) * kept

    def multipliers(self) -> Array:
        """Compute what the core multiplies the light's degrees with: shape (513,)."""
        nodes, weights = gauss_legendre(_NODES)
        theta = (nodes + 1) / 2 * self.angle
        values = self.evaluate(from_angles(theta, 0.0), np.array([0.0, 0.0, 1.0]))[:, 0]
        rings = self.angle / 2 * weights * np.sin(theta) * values
        return np.array(
            [
                2 * np.pi * np.sqrt(4 * np.pi / (2 * degree + 1)) * float(legendre[0] @ rings)
                for degree, legendre in legendre_degrees(MAX_ORDER_F, np.cos(theta), max_m=0)
            ]
        )


def split_lobe(
    lobe: NormalLobe, coefficients: BrdfCoefficients, lighting: Lighting, tolerance: float
) -> tuple[LobeCore, Array, float]:
    """Find the narrowest core whose tail loses little where the light's expansion ends.

    `coefficients` are coefficients of the lobe, to order 512. `tolerance` is the relative RMS error
    that the tail may leave. It is kept small beside the mean radiance too, as in an expansion of
    the whole lobe.

    Returns `core`; `tail` of shape (513,), what the rest of the lobe multiplies the light's degrees
    with; and `error`, the predicted relative RMS error of the level.
    """
    whole = multipliers(coefficients)
    power = lighting.power().sum(axis=1)
    light = float(power @ whole[: lighting.order + 1] ** 2) + unknown_light(lighting, whole**2)
    allowed = min(tolerance**2 * light, DARK_ERROR**2 * float(power[0]) * whole[0] ** 2)
    angle = _LEAST_ANGLE / max(lighting.order, 1)
    while True:
        core = LobeCore(lobe, min(angle, np.pi / 2))
        tail = whole - core.multipliers()
        lost = unknown_light(lighting, tail**2)
        if lost <= allowed or angle >= np.pi / 2:
            return core, tail, relative_rms(lost, light)
        angle *= _GROWTH


_IMAGES = 16
_PAIRS_AT_ONCE = 2**15
"""Pairs of a direction and a pixel that are evaluated at a time, so that they stay in the cache."""
_GROUP_ANGLE = 0.5
"""How wide a group of directions is, as a part of the core's angle, if they fill the sphere."""
_GROUP_SIZES = 16, 256
"""Fewest and most directions of a group. Fewer take longer to prepare than to sum."""
_STEPS = 1000
"""Steps of a core's table for each width of its lobe, between which it is linear. It is exact to a
millionth of the peak."""
_SAME = 2.0**-29
"""Directions whose angles agree to this many radians are one."""


def sum_core(core: LobeCore, light: Array, directions: Array) -> Array:
    """Sum a core about each direction over all pixels of a lat-long.

    `light`, of shape (2 k, 4 k, 3), is radiance times solid angle of the pixels of a lat-long,
    sampled at their centers, in world axes. `directions`, of shape (..., 3), are unit, world axes.
    Those of a cube take the least time.

    Returns an array of float64 of shape (..., 3): the sums are in single precision.
    """
    folded = _fold(directions.reshape(-1, 3))
    count = len(folded.polar)
    solid_angle = 4 * np.pi / _IMAGES / count
    size = int(np.clip((_GROUP_ANGLE * core.angle) ** 2 / solid_angle, *_GROUP_SIZES))
    bands = (folded.polar / np.sqrt(size * solid_angle)).astype(np.intp)
    light = light.astype(np.float32)
    table = _Table.of(core)
    sums = np.empty((count, _IMAGES, 3))
    for members in np.split(np.arange(count), np.nonzero(np.diff(bands))[0] + 1):
        ordered = members[np.argsort(folded.turn[members])]
        groups = np.split(ordered, range(size, len(ordered), size))
        for group, values in zip(groups, _sum_band(table, light, folded, groups), strict=True):
            sums[group] = values
        progress.report(int(members[-1]) + 1, count)
    return sums[folded.source, folded.image].reshape(directions.shape)


@record(eq=False)
class _Folded:
    """Directions in a 16th of the sphere, and which of them, in which image, each direction is."""

    polar: Array
    turn: Array
    """`polar` and `turn`: angles from the pole, rising, in 0 .. pi / 2, and about it, in 0 .. pi /
    4, from +Z to +X, shape (n,)."""
    source: Indices
    image: Indices
    """`source` and `image`: shape (directions,)."""


def _fold(directions: Array) -> _Folded:
    x, y, z = directions.T
    across, along = np.minimum(np.abs(x), np.abs(z)), np.maximum(np.abs(x), np.abs(z))
    polar, turn = np.arctan2(np.hypot(across, along), np.abs(y)), np.arctan2(across, along)
    # The keys are sorted, and so are the angles from the pole.
    steps = [np.rint(angle / _SAME).astype(np.int64) for angle in (polar, turn)]
    _, first, source = np.unique(
        (steps[0] << 32) + steps[1], return_index=True, return_inverse=True
    )
    around = np.arctan2(x, z)
    quarter = np.rint(around / (np.pi / 2))
    image = 4 * (quarter.astype(np.intp) % 4) + 2 * (around < quarter * (np.pi / 2)) + (y < 0)
    return _Folded(polar[first], turn[first], source, image)


@record(eq=False)
class _Table:
    """The values of a core, tabulated, which takes a third of the time."""

    angle: float
    """Where the core ends, radians."""
    scale: float
    """Steps for each unit of the sine of half the angle."""
    starts: Array
    slopes: Array
    """`starts` and `slopes`: the value at the start of each step, and by how much it grows to the
    next, float32 of shape (steps + 1,). The last ones are 0."""

    @classmethod
    def of(cls, core: LobeCore) -> "_Table":
        end = np.sin(core.angle / 2)
        steps = int(np.ceil(_STEPS * end / core.width))
        values = core.radial(np.linspace(0, end, steps + 1) ** 2)
        slopes = np.append(np.diff(values), 0)
        return cls(core.angle, steps / end, values.astype(np.float32), slopes.astype(np.float32))

    def values(self, square: Array) -> Array:
        """Return the core, from the squared sines of half the angles to its axis, in float32."""
        place = np.sqrt(square)
        place *= np.float32(self.scale)
        np.minimum(place, np.float32(len(self.starts) - 1), out=place)
        step = place.astype(np.intp)
        place -= step
        place *= self.slopes.take(step)
        place += self.starts.take(step)
        return place


def _sum_band(
    core: _Table, light: Array, folded: _Folded, groups: list[Indices]
) -> Iterator[Array]:
    """Sum the core about the members of each group: shape (members, 16, 3)."""
    step = np.pi / len(light)
    polar = folded.polar[np.concatenate(groups)]
    top = max(int((polar.min() - core.angle) / step), 0)
    rows = np.arange(top, min(int((polar.max() + core.angle) / step) + 1, len(light)))
    windows = [
        _columns(core.angle, step, folded.polar[group], folded.turn[group]) for group in groups
    ]
    first, last = min(left for left, _ in windows), max(right for _, right in windows)
    images = _images(light, rows, np.arange(first, last))
    row_polar = (rows + 0.5) * step
    for group, (left, right) in zip(groups, windows, strict=True):
        polar, turn = folded.polar[group, None], folded.turn[group, None]
        column_turn = np.pi - (np.arange(left, right) + 0.5) * step
        # The square of the sine of half an angle, by haversines, which do not cancel.
        apart = (np.sin((polar - row_polar) / 2) ** 2).astype(np.float32)
        joint = (np.sin(polar) * np.sin(row_polar)).astype(np.float32)
        around = (np.sin((turn - column_turn) / 2) ** 2).astype(np.float32)
        seen = images[left - first : right - first].reshape(-1, _IMAGES * 3)
        result = np.empty((len(group), _IMAGES * 3))
        for part in slices(len(group), _PAIRS_AT_ONCE // len(seen)):
            square = apart[part, None] + joint[part, None] * around[part, :, None]
            result[part] = core.values(square).reshape(-1, len(seen)) @ seen
        yield result.reshape(-1, _IMAGES, 3)


def _columns(angle: float, step: float, polar: Array, turn: Array) -> tuple[int, int]:
    """Return the first and the last column, plus one, within an angle of some directions."""
    # A cap that does not hold the pole spans this much to either side.
    sines = np.sin(angle) / np.sin(np.maximum(polar, angle))
    half = np.where(polar > angle, np.arcsin(np.minimum(sines, 1)), np.pi)
    # Longitudes fall from pi as columns rise.
    left = int(np.floor((np.pi - (turn + half).max()) / step))
    right = int(np.ceil((np.pi - (turn - half).min()) / step))
    return left, min(right, left + round(2 * np.pi / step))


def _images(light: Array, rows: Indices, columns: Indices) -> Array:
    """Return pixels of all images of the light: shape (len(columns), len(rows), 16, 3).

    An image is what the folded directions see in the place of the light itself. Columns may be
    beyond the seam.
    """
    height, width = light.shape[:2]
    result = np.empty((len(columns), len(rows), _IMAGES, 3), dtype=light.dtype)
    for image in range(_IMAGES):
        quarter, mirrored, flipped = image // 4, image // 2 % 2, image % 2
        down = height - 1 - rows if flipped else rows
        right = (width - 1 - columns if mirrored else columns) - quarter * (width // 4)
        result[:, :, image] = light[down, (right % width)[:, None]]
    return result
