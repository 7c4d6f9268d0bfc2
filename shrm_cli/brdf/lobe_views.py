"""The lobes of a BRDF for the views of a rule, as far as they are known, and what they err."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.lobe_expansion import Expansion

_DOUBLED = 3.0
"""How often the error of a rule goes into its difference to the rule with half of its nodes.

It is 3 for the second order of convergence, as `FINER` is 8."""


class Views:
    """The lobes of the views at all nodes of theta_o, as far as they are known.

    Attributes
    ----------
    levels : ndarray of int, shape (n, 2)
        The numbers of nodes in theta_i and phi.
    values, energy : ndarray, shapes (max_q+1, F+1, n, channels), (n, channels)
        As `Expansion` has them.
    errors : ndarray, shape (n, 2)
        The energy that the rules in theta_i and phi are estimated to miss.
    """

    def __init__(self, theta_o: Array, weights: Array, levels: object) -> None:
        self.theta_o, self.weights = theta_o, weights
        self.levels = np.array(np.broadcast_to(np.array(levels), (len(theta_o), 2)))
        self.values, self.energy = np.zeros((0, 0, 0, 0)), np.zeros((0, 0))
        self.errors = np.full((len(theta_o), 2), np.inf)
        self._sampled = np.zeros_like(self.levels)  # the levels of what is known; 0: nothing is
        self._trust = np.ones((len(theta_o), 2))  # the errors, as parts of a third's estimates

    def put(self, which: NDArray[np.intp], found: Expansion) -> None:
        """Keep what was found for some of the views, at their levels.

        A rule that was doubled errs no more than its change tells, and one that was not doubled no
        more than before. A third of the nodes may be too few for the highest degrees, and then
        tells far more than the rule itself errs. By how much, a view tells those beside it.
        """
        if not self.values.size:
            orders, channels = found.values.shape[:2], found.values.shape[3]
            self.values = np.zeros((*orders, len(self.theta_o), channels))
            self.energy = np.zeros((len(self.theta_o), channels))
        estimate = np.stack([found.error_theta, found.error_phi], axis=-1)
        is_doubled = self.levels[which] > self._sampled[which]
        least = np.where(is_doubled, self._change(which, found)[:, None], self.errors[which])
        self.errors[which] = np.minimum(estimate * self._trust[which], least)
        self._trust[which] = self.errors[which] / np.maximum(estimate, 1e-300)
        self.values[:, :, which], self.energy[which] = found.values, found.energy
        self._sampled[which] = self.levels[which]

    def _change(self, which: NDArray[np.intp], found: Expansion) -> Array:
        """The energy that views still miss, from their change by doubling; shape (views,)."""
        both_signs = np.where(np.arange(len(found.values)) == 0, 1.0, 2.0)
        squares = np.empty((len(which), len(found.values)))
        for k, view in enumerate(which):
            change = found.values[:, :, k] - self.values[:, :, view]
            squares[k] = np.einsum("qlc,qlc->q", change, change)
        by_values = squares @ both_signs / (2 * np.pi)
        by_energy = np.abs(found.energy - self.energy[which]).sum(axis=1)
        error = np.maximum(by_values / _DOUBLED**2, by_energy / _DOUBLED)
        return np.where(self._sampled[which, 0] > 0, error, np.inf)

    def known_energy(self) -> float:
        """The energy of all views and channels, as far as they tell that are known."""
        known = np.isfinite(self.errors[:, 0])
        weights = self.weights[known]
        return float(2 * (weights @ self.energy[known].sum(axis=1)) / weights.sum())

    def total(self) -> Array:
        """The energy of all views, shape (channels,)."""
        return self.weights @ self.energy

    def refined(self, theta_o: Array, weights: Array) -> "Views":
        """Other nodes of theta_o, of which none is known, that begin as those beside them ended."""
        after = np.clip(np.searchsorted(self.theta_o, theta_o), 1, len(self.theta_o) - 1)
        result = Views(theta_o, weights, self.levels[0])
        result._begin(np.arange(len(theta_o)), self, after - 1, after)
        return result

    def begin_beside(self, which: NDArray[np.intp], known: NDArray[np.intp]) -> None:
        """Let some views begin as the known ones beside them ended."""
        at = np.searchsorted(known, which)
        self._begin(
            which, self, known[np.maximum(at - 1, 0)], known[np.minimum(at, len(known) - 1)]
        )

    def _begin(
        self,
        which: NDArray[np.intp],
        others: "Views",
        before: NDArray[np.intp],
        after: NDArray[np.intp],
    ) -> None:
        """Take over levels, and what estimates are worth, from the views on both sides."""
        self.levels[which] = np.maximum(others.levels[before], others.levels[after])
        self._trust[which] = np.maximum(others._trust[before], others._trust[after])
