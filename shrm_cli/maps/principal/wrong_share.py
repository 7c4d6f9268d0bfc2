"""The predicted share of wrong pixels of a map of principal functions.

The transfer functions that were factorized are the lobes of all views, and what the map leaves out
of them is known, so that nothing of the BRDF is sampled again.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.maps.principal.functions import Spectrum
from shrm_cli.maps.principal.plan import Form, Planner
from shrm_cli.maps.wrong_share import Lobes, known_share
from shrm_cli.reflected import last_visible

_VIEWS = 12
"""The number of views, of those that the transfer functions have."""


def predicted_wrong_share(planner: Planner, form: Form) -> float | None:
    """Predict the share of what is visible whose luminance is wrong by more than 5 %.

    Parameters
    ----------
    planner : Planner
        The light, and the transfer functions of the BRDF.
    form : Form
        What the map keeps.

    Returns
    -------
    float or None
        As `shrm_cli.maps.wrong_share.predicted_wrong_share` returns it.
    """
    spectrum = planner.spectrum
    if spectrum.center == "tangent":
        return None
    energies = np.sum(spectrum.light * spectrum.known, axis=1)
    order = last_visible(planner.visible_beyond(energies))
    lobes = _lobes(spectrum, form, order)
    unknown = 1 - spectrum.whole() / max(planner.whole, 1e-300)
    return known_share(planner.lighting, lobes, unknown, form.error**2)


def _lobes(spectrum: Spectrum, form: Form, order: int) -> Lobes:
    """Take the lobes of some views, and what the map leaves out of them, up to an order."""
    transfer = spectrum.transfer
    nodes, shares = _views(spectrum)
    factors = form.band.factors
    error = [spectrum.rest(q, form.counts, factors, nodes) for q in range(transfer.max_q + 1)]
    return Lobes(
        transfer.values[:, : order + 1, nodes],
        np.stack([each[: order + 1] for each in error]),
        shares,
    )


def _views(spectrum: Spectrum) -> tuple[NDArray[np.intp], NDArray[np.floating]]:
    """Choose nodes that stand for all pixels, dense where views graze, and the share of each."""
    theta_o, weights = spectrum.transfer.theta_o, spectrum.weights
    # About the normal, pixels of spheres are uniform over the squared sine of the angle.
    weights = weights * np.cos(theta_o) if spectrum.center == "normal" else weights
    upto = np.cumsum(weights) / weights.sum()
    wanted = 1 - (1 - (np.arange(_VIEWS) + 0.5) / _VIEWS) ** 2
    nodes = np.unique(np.searchsorted(upto, wanted))
    middles = upto[nodes] - weights[nodes] / weights.sum() / 2
    edges = np.concatenate([[0.0], (middles[1:] + middles[:-1]) / 2, [1.0]])
    return nodes, np.diff(edges)
