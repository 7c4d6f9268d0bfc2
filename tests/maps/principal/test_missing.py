"""What functions leave out of a BRDF, against sums over its views with looked-up tables."""

import numpy as np
import pytest

from shrm_cli.brdf.brushed_transfer import scout_brushed_transfer, wave_values
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_transfer
from shrm_cli.maps.principal.brushed import BrushedSpectrum
from shrm_cli.maps.principal.functions import Spectrum
from shrm_cli.vocabulary import MAX_PRINCIPAL_MAPS

COUNTS = (5, 2, 1)
FACTORS = np.append(np.ones(12), np.linspace(1, 0, 6))
LIGHT = np.linspace(3, 1, 33)[:, None] * [1.0, 0.5, 0.2] / (1 + np.arange(33)[:, None])


def isotropic(divide=False):
    transfer = compute_transfer(parse_spec("ggx:roughness=0.5,f0=gold"), 32, 4, 1e-3)
    return Spectrum.of(transfer, "reflection", LIGHT, divide)


def brushed():
    transfer = scout_brushed_transfer(parse_spec("ward:ax=0.2,ay=0.4"), 32, 4, 1e-2)
    return BrushedSpectrum.of(transfer, "reflection", LIGHT)


def looked_up(spectrum, table):
    """A table at the nodes, shape (n, 3), with straight lines between its entries."""
    theta = spectrum.transfer.theta_o
    rows = table.reshape(-1, spectrum.entries, 3)
    straight = np.stack(
        [[np.interp(theta, spectrum.angles(), each[:, c]) for c in range(3)] for each in rows]
    ).transpose(0, 2, 1)
    if not isinstance(spectrum, BrushedSpectrum):
        return straight[0]
    waves = wave_values(spectrum.waves, spectrum.transfer.azimuths)
    is_real = np.arange(len(theta)) < len(theta) // 2
    return np.sum(np.where(is_real, waves.real, waves.imag)[..., None] * straight, axis=0)


@pytest.mark.parametrize("spectrum", [isotropic(), isotropic(divide=True), brushed()])
def test_what_functions_miss_is_summed_over_the_views(spectrum):
    albedo = spectrum.albedo_table()
    by_albedo = 1.0 if albedo is None else looked_up(spectrum, albedo)
    total = 0.0
    for q, rest in enumerate(spectrum.transfer.values.astype(float)):
        for k in range(COUNTS[q] if q < len(COUNTS) else 0):
            function = looked_up(spectrum, spectrum.table(q, k, k + 1)[0]) * by_albedo
            part = spectrum.parts[q][k, : len(FACTORS)] * FACTORS[:, None]
            rest[: len(FACTORS)] -= 2 * np.pi * part[:, None] * function
        squares = np.sum(rest**2 * spectrum.weights[:, None], axis=1) / (2 * np.pi)
        total += (2 if q else 1) * np.sum(LIGHT * squares)
    assert spectrum.missing(COUNTS, FACTORS) == pytest.approx(total, rel=1e-9)
    more = spectrum.looked_up(0, 7)  # what is known already stays
    np.testing.assert_array_equal(more[:5], spectrum.looked_up(0, 5))


def test_no_more_functions_are_found_than_maps_may_hold():
    found = [len(each) for each in brushed().vectors]
    assert found == [min(33, MAX_PRINCIPAL_MAPS // (2 * q + 1)) for q in range(len(found))]
