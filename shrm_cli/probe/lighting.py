"""Probe -> Lighting: the spherical harmonic coefficients of the incident light."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shrm_cli import progress
from shrm_cli.probe.lamps import PolarRows
from shrm_cli.probe.pixels import refuse_overflow
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.sphere.harmonics import order_of
from shrm_cli.sphere.rotation import transform_coefficients

if TYPE_CHECKING:
    from shrm_cli.probe.light_sum import LightSum

Array = NDArray[np.floating]

_ROWS_AT_ONCE = 16
"""The rows whose squares are summed at a time, which stay in the processor's cache."""


@record(eq=False)
class Lighting:
    """Incident light in the frequency domain.

    Attributes
    ----------
    coefficients : ndarray, shape ((order+1)^2, 3)
        L_lm over the real harmonics of world axes, index l(l+1)+m.
    energy : ndarray, shape (3,)
        The integral of the squared radiance, of all frequencies (Ramamoorthi 2002, eq. 5.15).
    """

    coefficients: Array
    energy: Array

    def __post_init__(self) -> None:
        if self.coefficients.shape != ((self.order + 1) ** 2, 3) or self.energy.shape != (3,):
            raise ValueError(f"lighting coefficients of shape {self.coefficients.shape}")

    @property
    def order(self) -> int:
        return order_of(len(self.coefficients))

    @cached_property
    def resolved_order(self) -> int:
        """The largest degree that is not 0, as those are that are finer than the pixels."""
        return int(np.flatnonzero(self._power.any(axis=1)).max(initial=0))

    def power(self) -> Array:
        """``sum_m |L_lm|^2`` of each degree and channel, shape (order+1, 3); read-only."""
        return self._power

    @cached_property
    def _power(self) -> Array:
        starts = np.arange(self.order + 1) ** 2
        found = np.add.reduceat(self.coefficients**2, starts)
        found.setflags(write=False)
        return found


class Projection:
    """The light of a probe, projected when it is first asked for, and again for higher orders.

    Parameters
    ----------
    probe : Probe
    """

    def __init__(self, probe: Probe) -> None:
        self.probe = probe
        self._known: Lighting | None = None

    def to_order(self, order: int) -> Lighting:
        """Return the light to an order at least as high as this one.

        Raises
        ------
        ProbeError
            If the probe cannot be read.
        """
        if self._known is None or self._known.order < order:
            self._known = project(self.probe, order)
        return self._known


def project(probe: Probe, order: int) -> Lighting:
    """Project a probe onto the spherical harmonics.

    Parameters
    ----------
    probe : Probe
    order : int
        Largest degree.

    Returns
    -------
    Lighting
        A lat-long is integrated by Fejer's or Clenshaw and Curtis's rule, which is exact for
        images band-limited below half its height, but small lamps near its poles by the solid
        angles of their pixels (see `probe.lamps`), as other grids are. Degrees that are finer
        than the pixels are 0. Of a sum each light is projected by itself: discs have closed forms.

    Raises
    ------
    ProbeError
        If the probe cannot be read, or a coefficient is beyond 32-bit floats.

    References
    ----------
    Ramamoorthi 2002, eq. 5.20 and 5.21.
    """
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
        if order not in probe.kept:
            probe.kept[order] = _project_image(probe, order)
        return probe.kept[order]
    return _project_image(probe, order)


def _project_image(probe: Probe, order: int) -> Lighting:
    """Project the pixels of a probe."""
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
    energy += light.image_of_sum.overlaps()
    light.report.energy = float(coefficients[0].sum() * np.sqrt(4 * np.pi))
    light.tell_warnings()
    return Lighting(transform_coefficients(coefficients, light.matrix), energy)


def _squared(pixels: Array, weights: Array) -> Array:
    """Integral of the squared radiance of each channel, shape (3,)."""
    if weights.shape[1] == 1:
        sums, ones = np.empty((len(pixels), 3)), np.ones(pixels.shape[1])
        for start in range(0, len(pixels), _ROWS_AT_ONCE):
            rows = slice(start, start + _ROWS_AT_ONCE)
            sums[rows] = ones @ pixels[rows].astype(float) ** 2
        return np.asarray(weights[:, 0] @ sums)
    return np.asarray(np.einsum("ijc,ijc,ij->c", pixels, pixels, weights, dtype=float))
