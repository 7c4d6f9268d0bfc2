"""The transfer functions of anisotropic BRDFs: their nodes are views of several azimuths.

The light is still expanded about C with the azimuth counted from the plane of the view, so that

    2 pi rho_hat(w_i', w_o) = sum over l, q of rho_hat_lq(theta_o, psi) conj(Y_lq(w_i')),

in which psi, the azimuth of the view from the tangent, is all that tells of the tangent. Mirror
images differ, so that rho_hat_lq is complex. Its real and imaginary parts, the integrals with
``cos(q phi)`` and ``sin(q phi)``, are nodes of their own here: the energy of q and -q together is
twice the sum of the squares of both, as it is for isotropic BRDFs, whose imaginary parts are 0.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import both_signs
from shrm_cli.brdf.transfer import LobeSampling, TransferFunctions, of_channels
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles

_FEWEST_STEPS = 6
"""The fewest steps of azimuths in a quarter turn. Measured BRDFs have no more, because no number of
samples mends their noise."""
_MOST_STEPS = 24
"""The most of models."""
_UNSEEN = 10
"""The part of the energy that the upper half of the waves over azimuths may have, in units of the
accuracy: what lies beyond them is far less, because waves of smooth lobes fall exponentially."""

_PAIRS = 256
"""The pairs of directions at which a BRDF and its mirror images are compared."""
_ALIKE = 1e-4
"""How far mirror images may be apart, beside the RMS of all values."""


Waves = NDArray[np.intp]
"""Waves over the azimuth psi of the view, shape (n, 2): a row (f, k) is ``i^k exp(i f psi)``."""


@record
class Azimuths:
    """Even azimuths of views, over the part of the turn that tells all."""

    steps: int
    """The number of azimuths in a quarter turn."""
    quarters: int
    """The number of quarter turns, as `quarters_that_differ` returns it. Where it is 1, real parts
    are even about both ends of the quarter, and imaginary ones odd."""

    @property
    def is_mirrored(self) -> bool:
        """Whether mirror images are the same."""
        return self.quarters == 1

    @property
    def angles(self) -> Array:
        """The azimuths, radians, shape (n,)."""
        count = self.quarters * self.steps + (1 if self.is_mirrored else 0)
        return np.arange(count) * (np.pi / 2 / self.steps)

    @property
    def weights(self) -> Array:
        """The part of all azimuths that each stands for, shape (n,)."""
        weights = np.ones(len(self.angles))
        if self.is_mirrored:
            weights[[0, -1]] = 0.5
        return np.asarray(weights / weights.sum())

    @property
    def waves(self) -> Waves:
        """The waves with real amplitudes that the azimuths tell apart."""
        step = 1 if self.quarters == 4 else 2
        frequencies = range(step - 2 * self.steps, 2 * self.steps, step)
        powers = (0,) if self.is_mirrored else (0, 1)
        return np.array([(f, k) for f in frequencies for k in powers], dtype=np.intp)

    def analysis(self, waves: Waves) -> Array:
        """The matrix from values [part, azimuth] to the real amplitudes of waves."""
        conjugate = wave_values(waves, self.angles).conj() * self.weights
        return np.hstack([conjugate.real, -conjugate.imag])


def wave_values(waves: Waves, azimuths: Array) -> NDArray[np.complexfloating]:
    """The values of waves at azimuths, shape (waves, n)."""
    frequency, power = waves.T[..., None]
    return np.asarray(1j**power * np.exp(1j * frequency * azimuths))


def quarters_that_differ(brdf: Brdf) -> int:
    """Return over how many quarter turns the views differ that tell everything of a BRDF.

    Returns 1 where a BRDF is the same in mirrors along its tangent and across it, as all brushed
    models are; 2 where it is the same after half a turn; else 4.
    """
    random = np.random.default_rng(0)
    theta = np.arccos(random.uniform(0.05, 1.0, (2, _PAIRS)))
    light, view = from_angles(theta, random.uniform(0, 2 * np.pi, (2, _PAIRS)))
    own = brdf.transfer(light, view)
    limit = _ALIKE * np.sqrt(np.mean(own**2))

    def is_same(*way: int) -> bool:
        image = brdf.transfer(light * np.array(way), view * np.array(way))
        return bool(np.sqrt(np.mean((image - own) ** 2)) <= limit)

    if not is_same(-1, -1, 1):
        return 4
    return 1 if is_same(1, -1, 1) else 2


def scout_brushed_transfer(
    brdf: Brdf, order_f: int, max_q: int, accuracy: float
) -> TransferFunctions:
    """Compute transfer functions at the fewest azimuths, which tell how much is reflected."""
    return compute_brushed_transfer(brdf, order_f, max_q, accuracy, _FEWEST_STEPS)


def compute_brushed_transfer(
    brdf: Brdf, order_f: int, max_q: int, accuracy: float = 1e-5, most_steps: int = _MOST_STEPS
) -> TransferFunctions:
    """Compute the transfer functions of an anisotropic BRDF.

    `most_steps` is the largest number of steps of azimuths in a quarter turn.

    Nodes of the result are indexed [part, azimuth, theta_o], flattened: real parts come first.
    """
    most_steps = _FEWEST_STEPS if brdf.is_measured else most_steps
    azimuths = Azimuths(_FEWEST_STEPS, quarters_that_differ(brdf))
    known: dict[float, TransferFunctions] = {}
    # All azimuths share the tables of the sampling.
    sampling = LobeSampling(brdf, order_f, max_q, accuracy, share=azimuths.quarters)
    while True:
        _sample(sampling, azimuths, known)
        found = _together([known[azimuth] for azimuth in azimuths.angles], azimuths)
        energy = np.sum(wave_energies(found), axis=0)
        tail = energy[np.abs(azimuths.waves[:, 0]) > azimuths.steps].sum()
        if tail <= _UNSEEN * accuracy * energy.sum() or 2 * azimuths.steps > most_steps:
            return found
        del found  # it is large, and so is the next one
        azimuths = Azimuths(2 * azimuths.steps, azimuths.quarters)


def _sample(
    sampling: LobeSampling, azimuths: Azimuths, known: dict[float, TransferFunctions]
) -> None:
    """Sample the lobes for views of all azimuths, at the same nodes of theta_o."""
    count = 0
    while True:
        fewer = [a for a in azimuths.angles if a not in known or len(known[a].theta_o) < count]
        if not fewer:
            return
        for azimuth in fewer:
            known[azimuth] = sampling.result(count, azimuth)
            count = max(len(known[a].theta_o) for a in known)


def _together(found: Sequence[TransferFunctions], azimuths: Azimuths) -> TransferFunctions:
    """Put the nodes of several azimuths one behind the other, real parts before imaginary ones."""
    first = found[0]
    waves, degrees, views = first.values.shape[:3]
    channels = 1 if all(each.values.strides[-1] == 0 for each in found) else 3
    shape = waves // 2, degrees, 2, len(found), views, channels
    nodes: Array = np.empty(shape, first.values.dtype)
    for place, each in enumerate(found):
        parts = each.values[..., :channels].reshape(2, -1, degrees, views, channels)
        nodes[:, :, :, place] = np.moveaxis(parts, 0, 2)
    values, shares = of_channels(nodes.reshape(waves // 2, degrees, -1, channels)), azimuths.weights
    return TransferFunctions(
        values, np.tile(first.theta_o, 2 * len(found)),
        np.tile(np.outer(shares, first.weights).ravel(), 2),
        shares @ [each.total_energy for each in found], max(each.samples for each in found),
        float(shares @ [each.accuracy for each in found]), first.asked,
        np.tile(np.repeat(azimuths.angles, views), 2),
    )  # fmt: skip


def azimuths_of(transfer: TransferFunctions) -> Azimuths:
    """The azimuths of the nodes of `compute_brushed_transfer`."""
    angles = np.unique(transfer.azimuths)
    steps = round(np.pi / 2 / angles[1])
    return Azimuths(steps, len(angles) // steps)


def wave_energies(transfer: TransferFunctions) -> Array:
    """The energy of each degree in each wave of the azimuth of the view, shape (F+1, waves)."""
    azimuths = azimuths_of(transfer)
    matrix = azimuths.analysis(azimuths.waves)
    nodes = transfer.values.reshape(*transfer.values.shape[:2], matrix.shape[1], -1)
    weights = np.repeat(transfer.weights[: nodes.shape[3] // 3] / azimuths.weights[0], 3)
    squares = [np.einsum("lwo,o->lw", (matrix @ each) ** 2, weights) for each in nodes]
    return np.tensordot(both_signs(transfer.max_q) / (2 * np.pi), squares, 1)
