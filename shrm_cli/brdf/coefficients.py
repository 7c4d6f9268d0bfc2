"""Brdf -> rho_hat_lpq: the spherical harmonic coefficients about the central direction C.

With both directions in the local frame of C, whose z axis is C,

    rho_hat(w_i', w_o') = sum over l, p, q of rho_hat_lpq conj(Y_lq(w_i')) Y_pq(w_o').

The coefficients of an isotropic BRDF are real, and the same for q and -q.

References
----------
Ramamoorthi and Hanrahan 2002, "Frequency Space Environment Map Rendering", appendix A, eq. 13 (the
expansion). Equations with a number 5.x are those of chapter 5 of Ramamoorthi's thesis, "A
Signal-Processing Framework for Forward and Inverse Rendering" (2002).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import BrdfError
from shrm_cli.sphere.directions import from_angles, tilted_frame
from shrm_cli.sphere.harmonics import legendre_degrees, legendre_table
from shrm_cli.sphere.quadrature import colatitude_weights, nodes

Array = NDArray[np.floating]

_MOST_SAMPLES = 2**23
_WORST_ACCURACY = 50  # times the accuracy that was asked for, accepted at the most samples
_ROUNDING = 1e-24  # the share of the energy that is taken for rounding errors
_ZONAL_NODES = 2**7, 2**15  # at least and at most


@dataclass(frozen=True)
class BrdfCoefficients:
    """Coefficients of a transfer function up to the orders F and P, and its whole energy.

    Attributes
    ----------
    values : ndarray, shape (F+1, P+1, P+1, 3)
        rho_hat_lpq for q >= 0, indexed [l, p, q, channel]; zero where q > min(l, p).
    total_energy : ndarray, shape (3,)
        ``2 pi int int int rho_hat^2 sin(theta_i) sin(theta_o) dtheta_i dtheta_o dphi`` of each
        channel, the right side of eq. 5.18.
    degree_energy : ndarray, shape (F+1, 3)
        The part of that energy in each l, with every p but azimuthal orders up to P. It is
        known without expanding the dependence on theta_o.
    samples : tuple of int
        The numbers of nodes in theta_i, theta_o and phi at which the sampling had converged.
    """

    values: Array
    total_energy: Array
    degree_energy: Array
    samples: tuple[int, int, int]

    def __post_init__(self) -> None:
        order_f, order_p = self.order_f, self.order_p
        if self.values.shape != (order_f + 1, order_p + 1, order_p + 1, 3):
            raise ValueError(f"coefficients of shape {self.values.shape}")
        if self.degree_energy.shape != (order_f + 1, 3) or self.total_energy.shape != (3,):
            raise ValueError("energies and coefficients have different shapes")

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

    def energies(self) -> Array:
        """The energy of each l and p, shape (F+1, P+1, 3): the sum of squares over all q."""
        return np.sum(self.values**2 * _both_signs(self.order_p)[:, None], axis=2)

    def captured(self) -> Array:
        """The fraction of the energy of all channels that each pair of orders captures (eq. 5.18).

        Returns
        -------
        ndarray, shape (F+1, P+1)
        """
        total = self.total_energy.sum()
        if total == 0:
            return np.ones(self.values.shape[:2])
        return np.cumsum(np.cumsum(self.energies().sum(axis=-1), axis=0), axis=1) / total

    def truncated(self, order_f: int, order_p: int) -> Array:
        """The coefficients up to smaller orders, shape (order_f+1, order_p+1, order_p+1, 3)."""
        return self.values[: order_f + 1, : order_p + 1, : order_p + 1]


def compute_coefficients(
    brdf: Brdf, order_f: int, order_p: int, accuracy: float = 1e-5
) -> BrdfCoefficients:
    """Compute coefficients of a BRDF by quadrature (eq. 5.22), sampled until they have converged.

    The nodes are Fejer's in theta_i and theta_o and equidistant in phi, at least two for each
    order. The number of nodes of one axis after the other is doubled. It stays doubled if that
    changes the coefficients, measured as the energy of the difference over the whole energy, or
    the whole energy, relatively, by more than `accuracy`. The sampling has converged when
    doubling any axis changes less. BRDFs with a discontinuity (the horizon) converge
    algebraically, smooth ones exponentially.

    A zonal BRDF needs only one integral over the cosine of the angle, for which Fejer's rule is
    exact where the BRDF is a polynomial; the rule is doubled until nothing changes at all.

    Parameters
    ----------
    brdf : Brdf
    order_f, order_p : int
        The largest l and p. A zonal BRDF has p = 0 only, whatever `order_p` is.
    accuracy : float
        The fraction of the energy that the sampling may miss; up to 50 times as much is accepted
        at the largest number of samples.

    Raises
    ------
    BrdfError
        If the BRDF is anisotropic or not finite, or has not converged at 8 million samples.
    """
    if not brdf.isotropic:
        raise BrdfError(
            f"{brdf!r}: anisotropic; prefiltering is for isotropic BRDFs, shrm reference renders it"
        )
    if brdf.zonal:
        return _zonal_coefficients(brdf, order_f)
    return _without_rounding(_converged_coefficients(brdf, order_f, order_p, accuracy))


def _without_rounding(coefficients: BrdfCoefficients) -> BrdfCoefficients:
    """Set the azimuthal orders that hold nothing but rounding errors to exactly 0."""
    values = coefficients.values
    energy = np.sum(values**2, axis=(0, 1, 3))
    nothing = energy <= _ROUNDING * energy.sum()
    return replace(coefficients, values=np.where(nothing[:, None], 0.0, values))


def _converged_coefficients(
    brdf: Brdf, order_f: int, order_p: int, accuracy: float
) -> BrdfCoefficients:
    shape = max(64, 2 * order_f), max(16, 2 * order_p), max(16, 2 * order_p)
    current = _sampled_coefficients(brdf, order_f, order_p, shape)
    axis = settled = 0
    change = 0.0
    while settled < 3:
        finer_shape = tuple(n * (2 if k == axis else 1) for k, n in enumerate(current.samples))
        if np.prod(finer_shape) > _MOST_SAMPLES:
            if change <= _WORST_ACCURACY * accuracy:
                return current
            raise BrdfError(
                f"{brdf!r}: its coefficients have not converged at {current.samples} samples; "
                "make it smoother or the tolerance larger"
            )
        finer = _sampled_coefficients(brdf, order_f, order_p, finer_shape)
        change = _change(current, finer)
        if change > accuracy:
            current, settled = finer, 0
        else:
            axis, settled = (axis + 1) % 3, settled + 1
    return current


def _change(one: BrdfCoefficients, other: BrdfCoefficients) -> float:
    """How far two samplings are apart, relative to the energy; see `compute_coefficients`."""
    total = other.total_energy.sum()
    if total == 0:
        return 0.0
    signs = _both_signs(one.order_p)[:, None]
    difference = np.sum((one.values - other.values) ** 2 * signs)
    energy = abs(one.total_energy.sum() - total)
    return float(max(difference, energy) / total)


def _both_signs(order_p: int) -> Array:
    """How many signs each q >= 0 stands for: 1 for q = 0 and 2 for the others, shape (P+1,)."""
    return np.where(np.arange(order_p + 1) == 0, 1.0, 2.0)


def _sampled_coefficients(
    brdf: Brdf, order_f: int, order_p: int, shape: tuple[int, ...]
) -> BrdfCoefficients:
    theta_i, theta_o, phi = ((nodes(n) + 1) * (np.pi / 2) for n in shape)
    weights_i, weights_o = colatitude_weights(shape[0]), colatitude_weights(shape[1])
    waves = np.cos(np.outer(phi, np.arange(order_p + 1)))
    # phi runs over half a circle, and its mirror image doubles that; the other 2 pi is the factor
    # of eq. 5.22.
    measure = 2 * np.pi * 2 * np.pi / shape[2]
    by_q = np.empty((shape[0], shape[1], 3, order_p + 1))
    energies = np.empty((3, shape[0]))
    for rows, samples, coverage in transfer_samples(brdf, theta_i, theta_o, phi):
        if not np.isfinite(samples.sum()):
            raise BrdfError(f"{brdf!r}: its value is not finite everywhere")
        is_grey = samples.strides[-1] == 0
        for channel in range(1 if is_grey else 3):
            covered = samples[..., channel] * coverage
            by_q[rows, :, channel] = covered @ waves * measure
            energies[channel, rows] = np.sum(covered * samples[..., channel], axis=2) @ weights_o
        if is_grey:
            by_q[rows, :, 1:], energies[1:, rows] = by_q[rows, :, :1], energies[0, rows]
    energy = measure * energies @ weights_i
    lighting = legendre_table(order_f, np.cos(theta_i), max_m=order_p)
    viewing = legendre_table(order_p, np.cos(theta_o))
    values = np.zeros((order_f + 1, order_p + 1, order_p + 1, 3))
    degree_energy = np.zeros((order_f + 1, 3))
    for q in range(min(order_f, order_p) + 1):
        light_part = lighting[q, : order_f + 1 - q] * weights_i
        by_lq = (light_part @ by_q[..., q].reshape(shape[0], -1)).reshape(-1, shape[1], 3)
        # The functions of theta_o are complete in p, and their squares integrate to 1 / (2 pi), so
        # that the energy over all p is an integral over theta_o.
        square = np.einsum("loc,o->lc", by_lq**2, weights_o) / (2 * np.pi)
        degree_energy[q:] += (1 if q == 0 else 2) * square
        values[q:, q:, q] = (viewing[q, : order_p + 1 - q] * weights_o) @ by_lq
    return BrdfCoefficients(values, energy, degree_energy, (shape[0], shape[1], shape[2]))


def transfer_samples(
    brdf: Brdf, theta_i: Array, theta_o: Array, phi: Array
) -> Iterator[tuple[slice, Array, Array]]:
    """Sample rho_hat on a grid of angles about C, a block of theta_i at a time.

    The horizon N.L = 0 cuts through cells in theta_i. Such a cell counts by the part of it that
    is above the horizon, and if its own sample lies below, it takes the value at the horizon. So
    the integral of a model that jumps at the horizon converges with the square of the cell's
    size, not with the size.

    Parameters
    ----------
    brdf : Brdf
    theta_i, theta_o : ndarray
        Angles of light and view from C, radians; those of the light are the middles of equal
        cells over 0 .. pi.
    phi : ndarray
        Azimuths of the light about C, radians; the view has the azimuth 0.

    Yields
    ------
    rows : slice
        Which of theta_i the block holds.
    samples : ndarray, shape (block, theta_o, phi, 3)
        rho_hat.
    coverage : ndarray, shape (block, theta_o, phi)
        The part of each cell that lies above the horizon, 0 .. 1.
    """
    # About the mirror direction the normal is half way between C and the view.
    tilt = theta_o / 2 if brdf.center == "reflection" else np.zeros_like(theta_o)
    view = from_angles(theta_o - tilt, 0.0)[None, :, None]
    horizon = np.pi / 2 + np.arctan(np.tan(tilt)[:, None] * np.cos(phi))
    cell = np.pi / len(theta_i)
    step = max(1, 2**17 // (len(theta_o) * len(phi)))
    for start in range(0, len(theta_i), step):
        rows = slice(start, start + step)
        beyond = theta_i[rows, None, None] - horizon
        coverage = np.clip(0.5 - beyond / cell, 0.0, 1.0)
        if not brdf.has_horizon:
            coverage[:] = 1.0
        light = tilted_frame(from_angles(theta_i[rows, None, None], phi), tilt[:, None])
        cut = np.nonzero((coverage > 0) & (coverage < 1) & (beyond >= 0))
        edge = from_angles(horizon[cut[1:]] * (1 - 1e-9), phi[cut[2]])
        light[cut] = tilted_frame(edge, tilt[cut[1]])
        yield rows, brdf.transfer(light, view), coverage


def _zonal_coefficients(brdf: Brdf, order_f: int) -> BrdfCoefficients:
    """The coefficients of a zonal BRDF, which has p = q = 0 only.

    With rho_hat = u(C.L) and the normalized Legendre functions f_l0 they are
    ``rho_hat_l00 = sqrt(4 pi) 2 pi int u(z) f_l0(z) dz``.
    """
    count, most = _ZONAL_NODES
    current = _zonal_integrals(brdf, order_f, max(count, 2 * order_f))
    while current.samples[0] < most:
        finer = _zonal_integrals(brdf, order_f, 2 * current.samples[0])
        if _change(current, finer) < 1e-14:
            return finer
        current = finer
    return current


def _zonal_integrals(brdf: Brdf, order_f: int, count: int) -> BrdfCoefficients:
    """The integrals of `_zonal_coefficients` with `count` nodes."""
    z = (nodes_in_cosine(count) + 1) / 2
    weights = colatitude_weights(count) / 2
    sine = np.sqrt(1 - z**2)
    light = np.stack([sine, np.zeros_like(z), z], axis=-1)
    lobe = brdf.transfer(light, np.array([0.0, 0.0, 1.0]))
    values = np.zeros((order_f + 1, 1, 1, 3))
    for degree, legendre in legendre_degrees(order_f, z, max_m=0):
        values[degree, 0, 0] = np.sqrt(4 * np.pi) * 2 * np.pi * (legendre[0] * weights) @ lobe
    energy = 8 * np.pi**2 * weights @ lobe**2
    return BrdfCoefficients(values, energy, values[:, 0, 0] ** 2, (count, 1, 1))


def nodes_in_cosine(count: int) -> Array:
    """Fejer's nodes as cosines, over which the weights of `colatitude_weights` integrate."""
    return np.cos((nodes(count) + 1) * (np.pi / 2))
