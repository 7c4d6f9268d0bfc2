"""The lobes of a BRDF for given views, expanded into harmonics of the light about C."""

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe_samples import every_third, transfer_samples
from shrm_cli.brdf.polar_rule import PolarRule, azimuths
from shrm_cli.errors import BrdfError
from shrm_cli.sphere.harmonics import legendre_table

Array = NDArray[np.floating]

_TABLE_BYTES = 200 * 2**20
"""The most that tables of Legendre functions take together; the last one is kept in any case."""
FINER = 4.0
"""A rule errs less than the rule with a third of its nodes by this factor at least.

Between the first and the second order of convergence the difference of both rules is 2 to 8 times
the error of the finer one; that of smooth integrands is far more.
"""


@dataclass(frozen=True)
class Expansion:
    """Lobes of several views as harmonics, with estimates of what their sampling misses.

    Attributes
    ----------
    values : ndarray, shape (max_q+1, F+1, n, channels)
        ``2 pi`` times the integrals of ``rho_hat f_lq(theta_i) cos(q phi)`` over the light; one
        channel for a grey BRDF, else three.
    energy : ndarray, shape (n, channels)
        ``2 pi`` times the integrals of ``rho_hat^2``.
    error_theta, error_phi : ndarray, shape (n,)
        The energy that the rules in theta_i and phi are estimated to miss, of all channels.
    """

    values: Array
    energy: Array
    error_theta: Array
    error_phi: Array


class LobeExpander:
    """Expands lobes of one BRDF, to fixed orders, at whatever numbers of nodes.

    Parameters
    ----------
    brdf : Brdf
    rule : PolarRule
        The rule for the angle of the light from C.
    order_f, max_q : int
        The largest l and q.
    """

    def __init__(self, brdf: Brdf, rule: PolarRule, order_f: int, max_q: int) -> None:
        self.brdf, self.rule, self.order_f, self.max_q = brdf, rule, order_f, max_q
        self._tables: OrderedDict[int, tuple[Array, Array]] = OrderedDict()
        self._sign = np.where(np.arange(max_q + 1) == 0, 1.0, 2.0)

    def expand(self, theta_o: Array, count: int, azimuth_count: int) -> Expansion:
        """Expand the lobes for views at angles from C.

        Parameters
        ----------
        theta_o : ndarray, shape (n,)
            Radians.
        count, azimuth_count : int
            The numbers of nodes in theta_i and, over half a turn, in phi: multiples of 3.

        Raises
        ------
        BrdfError
            If a value of the BRDF is not finite.
        """
        weights, coarse_weights = (self.rule.nodes(n)[1] for n in (count, count // 3))
        # phi runs over half a circle, and its mirror image doubles that; the other 2 pi is the
        # factor of eq. 5.22 of Ramamoorthi's thesis.
        measure = 2 * np.pi * 2 * np.pi / azimuth_count
        waves = measure * np.cos(np.outer(azimuths(azimuth_count), np.arange(self.max_q + 1)))
        # Samples by q: from all of them, from a third in phi, and from a third in theta_i.
        parts: tuple[list[Array], ...] = [], [], []
        energies = np.zeros((3, len(theta_o), 1))
        for rows, samples, coverage in transfer_samples(
            self.brdf, self.rule, count, theta_o, azimuth_count
        ):
            if samples.strides[-1] == 0:
                samples = samples[..., :1]
            thirds = slice(rows.start // 3, rows.stop // 3)
            blocks: tuple[list[Array], ...] = [], [], []
            energy = np.zeros((3, len(theta_o), samples.shape[-1]))
            for channel in range(samples.shape[-1]):
                values = np.ascontiguousarray(samples[..., channel])
                covered = values if coverage is None else values * coverage
                middle, part = every_third(values, coverage)
                middle_covered = middle if part is None else middle * part
                blocks[0].append(covered @ waves)
                blocks[1].append(3 * (covered[..., 1::3] @ waves[1::3]))
                blocks[2].append(middle_covered @ waves)
                squares = covered * values
                energy[0, :, channel] = weights[rows] @ squares.sum(axis=2)
                energy[1, :, channel] = weights[rows] @ squares[..., 1::3].sum(axis=2) * 3
                squares = (middle_covered * middle).sum(axis=2)
                energy[2, :, channel] = coarse_weights[thirds] @ squares
            energies = energies + measure * energy
            for whole, block in zip(parts, blocks, strict=True):
                whole.append(np.stack(block, axis=2))
        if not np.isfinite(energies.sum()):
            raise BrdfError(f"{self.brdf!r}: its value is not finite everywhere")
        table, coarse_table = self._table(count)
        values, by_phi = (self._projected(table, part) for part in parts[:2])
        by_theta = self._projected(coarse_table, parts[2])
        return Expansion(
            values,
            energies[0],
            self._error(values - by_theta, energies[0] - energies[2]),
            self._error(values - by_phi, energies[0] - energies[1]),
        )

    def _error(self, difference: Array, energy: Array) -> Array:
        """The energy that a rule is estimated to miss of each view, shape (n,)."""
        square = np.einsum("q,qlvc,qlvc->v", self._sign, difference, difference) / (2 * np.pi)
        return np.asarray(np.maximum(square / FINER**2, np.abs(energy).sum(axis=1) / FINER))

    def _projected(self, table: Array, blocks: list[Array]) -> Array:
        """Integrate over theta_i, with Legendre functions: shape (max_q+1, F+1, n, channels)."""
        samples = np.concatenate(blocks)
        count, views, channels, _ = samples.shape
        by_q = np.moveaxis(samples, -1, 0).reshape(-1, count, views * channels)
        result = np.zeros((self.max_q + 1, self.order_f + 1, views * channels))
        for q in range(min(self.max_q, self.order_f) + 1):
            result[q, q:] = table[q, : self.order_f + 1 - q] @ np.ascontiguousarray(by_q[q])
        return result.reshape(self.max_q + 1, self.order_f + 1, views, channels)

    def _table(self, count: int) -> tuple[Array, Array]:
        """Legendre functions [q, l - q, node] times weights, of all nodes and of every third."""
        if count in self._tables:
            self._tables.move_to_end(count)
            return self._tables[count]
        theta, weights = self.rule.nodes(count)
        functions = legendre_table(self.order_f, np.cos(theta), max_m=self.max_q)
        coarse = functions[..., 1::3] * self.rule.nodes(count // 3)[1]
        functions *= weights
        found = self._tables[count] = functions, coarse
        while len(self._tables) > 1 and self._table_bytes() > _TABLE_BYTES:
            self._tables.popitem(last=False)
        return found

    def _table_bytes(self) -> int:
        return sum(part.nbytes for pair in self._tables.values() for part in pair)
