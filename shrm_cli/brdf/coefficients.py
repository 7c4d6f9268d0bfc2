"""Brdf -> rho_hat_lpq: the spherical harmonic coefficients about the central direction C.

With both directions in the local frame of C, whose z axis is C,

    rho_hat(w_i', w_o') = sum over l, p, q of rho_hat_lpq conj(Y_lq(w_i')) Y_pq(w_o').

The coefficients of an isotropic BRDF are real, and the same for q and -q.

References: Ramamoorthi and Hanrahan 2002, "Frequency Space Environment Map Rendering", appendix A,
eq. 13 (the expansion). Equations with a number 5.x are those of chapter 5 of Ramamoorthi's thesis,
"A Signal-Processing Framework for Forward and Inverse Rendering" (2002).
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.records import record

if TYPE_CHECKING:
    from shrm_cli.brdf.transfer import TransferFunctions

FIRST_ORDER_F = 32
"""The least order F to which BRDFs are expanded first; it doubles until it suffices."""
_MOST_OCTAVES = 3
"""The most octaves of degrees over which the fall of their energies is trusted."""
_LEAST_ENERGY = 1e-300
"""The least fraction of the energy that counts as asked for: quotients by it are doubles."""
_FALLING = 0.8
"""The ratio of the energies of two octaves of degrees, above which they have not begun to fall."""


class Sampled:
    """What was sampled up to an accuracy, or as far towards it as that went."""

    accuracy: float
    asked: float

    @property
    def remark(self) -> str | None:
        """What a user should know of the accuracy, in one line; None where it is as asked."""
        return accuracy_remark(self.accuracy, self.asked)


@record
class FirstOrder:
    """The order F to which a BRDF is expanded first, as `lobe_expansion.first_order_f` finds it."""

    order_f: int


@record(eq=False)
class ExpandedLobes:
    """Lobes of several views as harmonics, with estimates of what their sampling misses."""

    values: Array
    """``2 pi`` times the integrals of ``rho_hat f_lq(theta_i) cos(q phi)`` over the light; one
    channel for a grey BRDF, else three, shape (max_q+1, F+1, n, channels). Of an anisotropic BRDF
    those with ``sin(q phi)`` follow, shape (2 max_q + 2, ...)."""
    energy: Array
    """``2 pi`` times the integrals of ``rho_hat^2``, shape (n, channels)."""
    error_theta: Array
    error_phi: Array
    """`error_theta` and `error_phi`: the energy that the rules in theta_i and phi are estimated to
    miss, of all channels, shape (n,)."""


@record(eq=False)
class BrdfCoefficients(Sampled):
    """Coefficients of a transfer function up to the orders F and P, and its whole energy."""

    values: Array
    """rho_hat_lpq for q >= 0, indexed [l, p, q, channel]; zero where q > min(l, p), shape (F+1,
    P+1, P+1, 3)."""
    total_energy: Array
    """``2 pi int int int rho_hat^2 sin(theta_i) sin(theta_o) dtheta_i dtheta_o dphi`` of each
    channel, the right side of eq. 5.18, shape (3,)."""
    degree_energy: Array
    """The part of that energy in each l, with every p but azimuthal orders up to P, shape (F+1, 3).
    It is known without expanding the dependence on theta_o."""
    samples: tuple[int, int, int]
    """The largest numbers of nodes in theta_i, theta_o and phi."""
    accuracy: float = 0.0
    asked: float = 1.0
    """`accuracy` and `asked`: the part of the energy that the sampling is estimated to miss, and
    the part that it was allowed to miss."""

    def __post_init__(self) -> None:
        order_f, order_p = self.order_f, self.order_p
        if self.values.shape != (order_f + 1, order_p + 1, order_p + 1, 3):
            raise ValueError(f"coefficients of shape {self.values.shape}")
        if self.degree_energy.shape != (order_f + 1, 3) or self.total_energy.shape != (3,):
            raise ValueError("energies and coefficients have different shapes")

    @classmethod
    def of(cls, transfer: TransferFunctions, order_p: int, is_zonal: bool) -> BrdfCoefficients:
        """Expand transfer functions over theta_o, up to an order P (eq. 5.22)."""
        values = transfer.projected(order_p)
        # Of a zonal BRDF the energy of each l is in one coefficient, to the last bit.
        degree_energy = values[:, 0, 0] ** 2 if is_zonal else transfer.degree_energy
        return cls(
            values, transfer.total_energy, degree_energy, transfer.samples, transfer.accuracy,
            transfer.asked,
        )  # fmt: skip

    @property
    def order_f(self) -> int:
        return self.values.shape[0] - 1

    @property
    def order_p(self) -> int:
        return self.values.shape[1] - 1

    @property
    def azimuth_free(self) -> bool:
        """Whether the BRDF does not depend on the azimuth between light and view about C."""
        return not self.values[:, :, 1:].any()

    @cached_property
    def spread(self) -> Array:
        """How energy of unknown azimuthal orders is spread over l, (F+1, 3), in proportions.

        It is that of the known ones with p > P, which depends on the view as finely.
        """
        return np.maximum(self.degree_energy - self.energies.sum(axis=1), 0.0)

    @cached_property
    def energy_above(self) -> Array:
        """The energy at degrees above F as `transfer.energy_above` estimates it, shape (3,)."""
        return energy_above(self.degree_energy)

    @cached_property
    def energies(self) -> Array:
        """The energy of each l and p, shape (F+1, P+1, 3): the sum of squares over all q."""
        found = np.sum(self.values**2 * both_signs(self.order_p)[:, None], axis=2)
        found.setflags(write=False)
        return found

    @cached_property
    def captured(self) -> Array:
        """The part of the energy of all channels that orders capture (eq. 5.18), (F+1, P+1)."""
        total = self.total_energy.sum()
        if total == 0:
            found = np.ones(self.values.shape[:2])
        else:
            summed = np.cumsum(self.energies.sum(axis=-1), axis=0)
            found = np.cumsum(summed, axis=1) / total
        found.setflags(write=False)
        return found

    def truncated(self, order_f: int, order_p: int) -> Array:
        """The coefficients up to smaller orders, shape (order_f+1, order_p+1, order_p+1, 3)."""
        return self.values[: order_f + 1, : order_p + 1, : order_p + 1]


def accuracy_remark(accuracy: float, asked: float) -> str | None:
    """What a user should know of the accuracy of coefficients; None where it is as asked."""
    if accuracy <= asked:
        return None
    # As many digits as tell the two apart; 17 tell any two floats apart.
    pairs = ((f"{accuracy:.{digits}g}", f"{asked:.{digits}g}") for digits in range(2, 18))
    reached, wanted = next(pair for pair in pairs if pair[0] != pair[1])
    return (
        f"sampled to what it resolves: its coefficients are good to {reached} of its energy, "
        f"not to {wanted}"
    )


def energy_above(degree_energy: Array) -> Array:
    """Estimate the energy of the degrees above the known ones, as `next_octave` has them fall.

    `degree_energy` is of shape (F+1, ...).

    Returns an array of shape (...): infinite where energies have not begun to fall.
    """
    last, ratio = next_octave(degree_energy)
    falls = ratio < _FALLING
    above = np.where(falls, last * ratio / (1 - np.where(falls, ratio, 0.0)), np.inf)
    return np.where(last > 0, above, 0.0)


def next_octave(degree_energy: Array) -> tuple[Array, Array]:
    """The energy of the last octave of degrees, F/2 < l <= F, and the next one's ratio to it.

    Energies that fall by a power of the degree have the same ratio r from octave to octave, and
    those that fall exponentially r, r^2, r^4 and so on. BRDFs lie between, as the last three
    octaves tell, and about half way between what these tell and a power is what comes next.
    """
    ends = [len(degree_energy) - 1]
    while len(ends) < 4:
        ends.append(ends[-1] // 2)
    octaves = [degree_energy[ends[k + 1] + 1 : ends[k] + 1].sum(axis=0) for k in range(3)]
    last, before, first = (np.maximum(octave, 1e-300) for octave in octaves)
    ratio, earlier = np.log(last / before), np.log(before / first)
    steeper = np.sqrt(np.clip(ratio / np.minimum(earlier, -1e-9), 1.0, 4.0))
    return octaves[0], np.exp(np.where((ratio < 0) & (earlier < 0), ratio * steeper, ratio))


def octaves_to_come(coefficients: BrdfCoefficients | TransferFunctions, eps: float) -> int:
    """Estimate how often the order F must be doubled until little energy lies beyond it.

    `energy_above` estimates it. What no F finds, because it has q > P, does not count.

    `eps` is the fraction of the energy that may lie beyond.

    Returns 0 .. `_MOST_OCTAVES`; 2 where energies have not begun to fall.
    """
    by_degree = coefficients.degree_energy.sum(axis=-1)
    allowed = max(eps, _LEAST_ENERGY) * coefficients.total_energy.sum()
    missing = coefficients.total_energy.sum() - by_degree.sum()
    above = float(energy_above(by_degree))
    if min(missing, above) <= allowed:
        return 0
    if not np.isfinite(above):
        return 2
    octaves = np.log(min(missing, above) / allowed) / -np.log(next_octave(by_degree)[1])
    return min(int(np.ceil(octaves)), _MOST_OCTAVES)


def both_signs(order: int) -> Array:
    """How many signs each q >= 0 stands for: 1 for q = 0 and 2 for the others."""
    return np.where(np.arange(order + 1) == 0, 1.0, 2.0)


def power_of_two_times(least: int, wanted: float, most: int) -> int:
    """`least`, doubled until it is at least `wanted`, or to double it would exceed `most`."""
    while least < wanted and 2 * least <= most:
        least *= 2
    return least
