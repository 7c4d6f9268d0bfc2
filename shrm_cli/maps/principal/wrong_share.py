"""The predicted share of wrong pixels of a map of principal functions.

The transfer functions that were factorized are the lobes of all views, and what the map leaves out
of them is known, so that nothing of the BRDF is sampled again.
"""

from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.maps.expansion import wrong_share
from shrm_cli.maps.lobes_lit import Lobes, sample_tangents, sample_views
from shrm_cli.maps.principal.brushed import BrushedSpectrum
from shrm_cli.maps.principal.plan import Form, Planner
from shrm_cli.reflected import last_visible


def predicted_wrong_share(terms: Sequence[tuple[Planner, Form]]) -> float:
    """Predict the share of what is visible whose luminance is wrong by more than 5 %.

    Parameters
    ----------
    terms : sequence of (Planner, Form)
        The light and the transfer functions of each term of the BRDF, and what the map keeps.

    Returns
    -------
    float
        As `shrm_cli.maps.expansion.predicted_wrong_share` returns it.
    """
    lighting = max((planner.lighting for planner, _ in terms), key=lambda each: each.order)
    return wrong_share(lighting, [_lobes(*term) for term in terms])


def _lobes(planner: Planner, form: Form) -> Lobes:
    """Take the lobes of some views, and what the map leaves out of them, as far as is visible."""
    spectrum = planner.spectrum
    transfer = spectrum.transfer
    energies = np.sum(spectrum.light * spectrum.known, axis=1)
    beyond = planner.visible_beyond(energies)
    order = last_visible(beyond)
    # Lobes are taken between the nodes on both sides of each view.
    angles, _ = sample_views(spectrum.center)
    theta_o = transfer.theta_o
    if isinstance(spectrum, BrushedSpectrum):
        theta_o = theta_o[: spectrum.view_count]
    after = np.clip(np.searchsorted(theta_o, angles), 1, len(theta_o) - 1)
    low, high = theta_o[after - 1], theta_o[after]
    part = np.clip((angles - low) / (high - low), 0.0, 1.0)[:, None]
    nodes = np.concatenate([after - 1, after])
    signs = None
    if isinstance(spectrum, BrushedSpectrum):
        nodes, signs = spectrum.parts_near(nodes, np.tile(sample_tangents(len(angles)), 2))

    def between(values: Array) -> Array:
        if signs is not None:
            real, imaginary = np.split(values, 2, axis=-2)
            values = real + 1j * signs[:, None] * imaginary
        count = len(angles)
        return (1 - part) * values[..., :count, :] + part * values[..., count:, :]

    factors = form.band.factors
    rest = [spectrum.rest(q, form.counts, factors, nodes) for q in range(transfer.max_q + 1)]
    return Lobes(
        between(transfer.values[:, : order + 1, nodes]),
        between(np.stack([each[: order + 1] for each in rest])),
        spectrum.center,
    ).ended(beyond)
