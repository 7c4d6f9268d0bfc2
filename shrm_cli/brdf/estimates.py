"""What known degrees of a BRDF tell of the others, and how sampling is told and refined."""

import numpy as np

from shrm_cli.arrays import Array

_FALLING = 0.8
"""The ratio of the energies of two octaves of degrees, above which they have not begun to fall."""


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

    Parameters
    ----------
    degree_energy : ndarray, shape (F+1, ...)

    Returns
    -------
    ndarray, shape (...)
        Infinite where energies have not begun to fall.
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


def both_signs(order: int) -> Array:
    """How many signs each q >= 0 stands for: 1 for q = 0 and 2 for the others."""
    return np.where(np.arange(order + 1) == 0, 1.0, 2.0)


def power_of_two_times(least: int, wanted: float, most: int) -> int:
    """`least`, doubled until it is at least `wanted`, or to double it would exceed `most`."""
    while least < wanted and 2 * least <= most:
        least *= 2
    return least
