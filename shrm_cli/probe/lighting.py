"""Probe -> Lighting: the spherical harmonic coefficients of the incident light.

Small lamps near the poles of a lat-long count by the solid angles of their pixels. The rule that
integrates a lat-long is exact where the light is smooth, and pays for it near the poles: the first
row weighs .873 of its solid angle, the second one 1.024 of it. No set of weights has both,
exactness and areas. So the two are divided: what is smooth is integrated by the rule, and what
stands out of it within the polar rows, such as a sun in the zenith, by areas.
"""

import os
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from shrm_cli import progress
from shrm_cli.arrays import Array, over_channels, slices
from shrm_cli.messages import whole_number
from shrm_cli.probe.pixels import refuse_overflow
from shrm_cli.probe.probe import Probe
from shrm_cli.records import Displayed, once_each, record
from shrm_cli.sphere.grid.base import Grid
from shrm_cli.sphere.harmonics import by_degree, order_of
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.vocabulary import MAX_ORDER_F

if TYPE_CHECKING:
    from shrm_cli.probe.light_sum import LightSum
    from shrm_cli.probe.shared import SharedProbe

_MOST_ROWS = 32
"""Rows at each pole; farther away the rule and the areas differ by less than 1e-4."""
_PART = 4
"""The polar rows are no more than the height over this."""
_STANDS_OUT = 4.0
"""What is brighter than the mean of the polar rows without their lamps, times this, is a lamp.

Smooth light is at most so bright that its waves are longer than the rows are high.
"""
_PASSES, _SETTLED = 16, 0.99
"""The mean is taken anew, with lamps dimmed to the limit, until the limit falls by less than this.
A lamp that raised its own limit would be smooth in part: a row of 32 lost .8 % of its light."""
_LARGE_ROWS = 16
"""Probes of fewer rows are cut before they are projected: of random 2, 4 and 8 rows the irradiance
of points is off by 11, 2 and .3 %, and beside a lamp by 29, 9 and 1.4 %; of 16 rows by .6 %."""
_NOTHING = 1e-6
"""The part of the light's energy that is none: .1 % as RMS."""
_MOST = 4096
"""The largest order."""
_FEW = 64
"""Pixels that are not held are projected to this order at least. It takes no longer than to read
them, and matte surfaces ask for less."""
_ROWS_AT_ONCE = 16
"""The rows whose squares are summed at a time, which stay in the processor's cache."""


@record(eq=False)
class Lamps:
    """What integrals over a block of polar rows must add for lamps."""

    start: int
    """The first row."""
    excess: Array
    """Radiance of the lamps above the smooth light, shape (rows, width, 3)."""
    smooth: Array
    """Radiance of what is left, shape (rows, width, 3)."""
    ratios: Array
    """What the solid angle is more than the weight of the rule, over that weight, shape (rows, 1,
    1)."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.excess.shape[0], self.excess.shape[1]

    @property
    def light(self) -> Array:
        """Radiance to be added to the pixels, with the rule's weights: (rows, width, 3)."""
        return self.excess * self.ratios

    @property
    def squares(self) -> Array:
        """Squared radiance to be added to that of the pixels, with the rule's weights."""
        return (self.excess**2 + 2 * self.excess * self.smooth) * self.ratios


class PolarRows:
    """Gathers the polar rows of an image, which arrives in blocks of rows.

    Nothing is gathered of `grid`, and there are no lamps, where weights are solid angles.
    """

    def __init__(self, grid: Grid) -> None:
        self._ratios = grid.area_ratios()
        rows, width = grid.shape
        self._count = 0 if self._ratios is None else min(rows // _PART, _MOST_ROWS)
        self._starts = (0, rows - self._count)
        self._caps = [np.zeros((self._count, width, 3), np.float32) for _ in self._starts]

    def add(self, start: int, pixels: Array) -> None:
        """Take in a block of rows, pixels of shape (rows, width, 3)."""
        stop = start + len(pixels)
        for first, cap in zip(self._starts, self._caps, strict=True):
            low, high = max(start, first), min(stop, first + self._count)
            if low < high:
                cap[low - first : high - first] = pixels[low - start : high - start]

    def lamps(self) -> Iterator[Lamps]:
        """Yield the lamps at each pole, where there are any, after all rows were added."""
        for start, cap in zip(self._starts, self._caps, strict=True):
            if self._ratios is None or not cap.any():
                continue
            ratios, areas = (each[start : start + self._count] for each in self._ratios)
            brightest = over_channels(np.maximum, cap)
            limit = _limit(brightest, areas / areas.sum())
            if brightest.max() > limit:
                most = np.maximum(brightest, max(limit, float(np.finfo(np.float32).tiny)))
                excess = cap * (1 - limit / most)[..., None]
                yield Lamps(start, excess, cap - excess, ratios[:, None, None])


def _limit(brightest: Array, shares: Array) -> float:
    """What is brighter is a lamp, of radiance (rows, width) in rows with shares of the area."""
    limit = float(brightest.max())
    for _ in range(_PASSES):
        before = limit
        limit = _STANDS_OUT * float(shares @ np.minimum(brightest, before).mean(axis=1))
        if limit >= _SETTLED * before:
            break
    return limit


def lamps_of(grid: Grid, image: Array) -> Iterator[Lamps]:
    """Yield the lamps near the poles of a whole image, shape (rows, width, 3)."""
    rows = PolarRows(grid)
    rows.add(0, image)
    return rows.lamps()


@record(eq=False)
class Lighting(Displayed):
    """Incident light in the frequency domain."""

    coefficients: Array
    """L_lm over the real harmonics of world axes, index l(l+1)+m, shape ((order+1)^2, 3)."""
    energy: Array
    """The integral of the squared radiance, of all frequencies (Ramamoorthi 2002, eq. 5.15), shape
    (3,)."""

    def __post_init__(self) -> None:
        if self.coefficients.shape != ((self.order + 1) ** 2, 3) or self.energy.shape != (3,):
            raise ValueError(f"lighting coefficients of shape {self.coefficients.shape}")

    @property
    def order(self) -> int:
        return order_of(len(self.coefficients))

    @cached_property
    def resolved_order(self) -> int:
        """The largest degree that is known: not 0, as those are that are finer than the pixels.

        Light that has all of its energy in the degrees that are not 0 has no others, as light that
        is given by coefficients: these are all known.
        """
        energy = self.energy.sum()
        if energy - self.power().sum() <= _NOTHING * energy:
            return self.order
        return int(np.flatnonzero(self.power().any(axis=1)).max(initial=0))

    @once_each
    def power(self) -> Array:
        """``sum_m |L_lm|^2`` of each degree and channel, shape (order+1, 3); read-only."""
        found = by_degree(self.coefficients**2)
        found.setflags(write=False)
        return found


class Projection:
    """The light of a probe, projected when it is first asked for, and again for higher orders."""

    def __init__(self, probe: Probe) -> None:
        self.probe = probe
        self._known: Lighting | None = None

    def to_order(self, order: int) -> Lighting:
        """Return the light to an order at least as high as this one."""
        if self._known is None or self._known.order < order:
            self._known = project(self.probe, order)
        return self._known


def project(probe: Probe | str | os.PathLike[str] | Array, order: int) -> Lighting:
    """Project a probe onto the spherical harmonics.

    Parameters
    ----------
    probe : Probe, path-like or array
    order : int
        Largest degree.

    Returns
    -------
    Lighting
        A lat-long is integrated by Fejer's or Clenshaw and Curtis's rule, which is exact for
        images band-limited below half its height, but small lamps near its poles by the solid
        angles of their pixels, as other grids are. Degrees that are finer than the pixels are
        0. Of a sum each light is projected by itself: discs have closed forms, and what is given
        by coefficients has them.

    Raises
    ------
    ProbeError
        If the probe cannot be read, or a coefficient is beyond 32-bit floats.

    References
    ----------
    Ramamoorthi 2002, eq. 5.20 and 5.21.

    Examples
    --------
    >>> white = shrm.Probe.from_array(np.ones((16, 32, 3), np.float32), layout="latlong")
    >>> shrm.project(white, 1).coefficients.shape
    (4, 3)
    """
    if not isinstance(probe, Probe):
        from shrm_cli.probe.open import as_probe  # most callers have opened it

        probe = as_probe(probe)
    order = whole_number("order", order, 0, _MOST)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused below
        found = _project(probe, order)
    refuse_overflow(probe.name, found.coefficients)
    return found


def _project(probe: Probe, order: int) -> Lighting:
    if type(probe) is Probe:
        return _project_image(probe, order)
    # Most runs have no other probes, and are spared the loading of these modules.
    from shrm_cli.probe.light_sum import LightSum
    from shrm_cli.probe.shared import SharedProbe

    if isinstance(probe, LightSum):
        return _project_sum(probe, order)
    if isinstance(probe, SharedProbe):
        return _project_shared(probe, order)
    return _project_image(probe, order)


def _project_shared(probe: "SharedProbe", order: int) -> Lighting:
    """Project a probe once to each order, or twice if its pixels are read each time."""
    kept = probe.kept
    if probe.project is None and not probe.is_held:
        # Whoever asks for more than a few degrees may soon ask for others. Those of an order are
        # always rounded alike, whatever was asked for before.
        most = _FEW if order <= _FEW else max(order, MAX_ORDER_F)
        if most not in kept:
            kept[most] = _project_image(probe, most)
        found: Lighting = kept[most]
        return Lighting(found.coefficients[: (order + 1) ** 2], found.energy)
    if order not in kept:
        own = probe.project
        kept[order] = _project_image(probe, order) if own is None else own(order)
    return kept[order]


def _project_image(probe: Probe, order: int) -> Lighting:
    """Project a probe, whose pixels are areas where they are so large that their shape shows."""
    if probe.grid.resolution < _LARGE_ROWS:
        from shrm_cli.probe.coarse import fine_probe  # which most runs do not need

        probe = fine_probe(probe)
    energy = np.zeros(3)
    resolved = min(order, probe.grid.resolved_order)
    analysis = probe.grid.analysis(resolved)
    polar_rows = PolarRows(probe.grid)
    for start, pixels, weights in probe.blocks():
        energy += _squared(pixels, weights)
        analysis.add(start, pixels, weights)
        polar_rows.add(start, pixels)
        progress.report(start + len(pixels), probe.height)
    for lamps in polar_rows.lamps():
        weights = probe.grid.weights(lamps.start, lamps.start + len(lamps.excess))
        energy += np.einsum("ijc,ij->c", lamps.squares, np.broadcast_to(weights, lamps.shape))
        analysis.add(lamps.start, lamps.light, weights)
    coefficients = analysis.coefficients()
    if not np.array_equal(probe.matrix, np.eye(3)):
        coefficients = transform_coefficients(coefficients, probe.matrix)
    result = np.zeros(((order + 1) ** 2, 3))
    result[: (resolved + 1) ** 2] = coefficients
    return Lighting(result, energy)


def _project_sum(light: "LightSum", order: int) -> Lighting:
    """Project each light of a sum; only products of two lights are integrated over pixels."""
    from shrm_cli.probe.disc import disc_coefficients

    coefficients = disc_coefficients(light.discs, order)
    energy = sum((disc.energy for disc in light.discs), np.zeros(3))
    for term in light.terms:
        part = project(term.probe, order)
        coefficients += term.scale * part.coefficients
        energy += term.scale**2 * part.energy
    if light.series is not None:
        count = min(len(light.series), len(coefficients))
        coefficients[:count] += light.series[:count]
        energy += (light.series**2).sum(axis=0)
    energy += light.image_of_sum.overlaps()
    light.report.energy = float(coefficients[0].sum() * np.sqrt(4 * np.pi))
    light.tell_warnings()
    alone = not light.terms and not light.discs
    if not (alone and np.array_equal(light.matrix, np.eye(3))):  # numbers of files stay as they are
        coefficients = transform_coefficients(coefficients, light.matrix)
    return Lighting(coefficients, energy)


def _squared(pixels: Array, weights: Array) -> Array:
    """Integral of the squared radiance of each channel, shape (3,)."""
    if weights.shape[1] == 1:
        sums, ones = np.empty((len(pixels), 3)), np.ones(pixels.shape[1])
        for rows in slices(len(pixels), _ROWS_AT_ONCE):
            sums[rows] = ones @ pixels[rows].astype(float) ** 2
        return np.asarray(weights[:, 0] @ sums)
    return np.asarray(np.einsum("ijc,ijc,ij->c", pixels, pixels, weights, dtype=float))
