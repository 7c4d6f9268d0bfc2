"""Lamps beside the maps of one probe: looked for once, and the same as for a map alone."""

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.lights import beside
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.disc import Disc, disc_coefficients, radius_of
from shrm_cli.probe.shared import shared


@pytest.fixture
def pixels(rng):
    found = 0.1 + rng.random((64, 128, 3)).astype(np.float32) / 10
    found[20:22, 40:42] = 300
    return found


def test_maps_of_one_probe_look_for_its_lamps_once(pixels, monkeypatch):
    looked = []
    split_lamps = beside.split_lamps
    monkeypatch.setattr(beside, "split_lamps", lambda probe: looked.append(1) or split_lamps(probe))
    probe = shared(shrm.Probe.from_array(pixels, layout="latlong"))
    residuals = set()
    for brdf in ("ggx:roughness=0.5", "phong:exponent=32"):
        given = {"brdf": brdf, "sun": "split"}
        made = prefilter_with_facts(probe, "auto", given).map
        found = beside.split_for(probe, shrm.parse_spec(brdf)).split
        residuals.add(id(found.residual_probe))
        assert len(looked) == 1
        alone = shrm.Probe.from_array(pixels, layout="latlong")
        apart = prefilter_with_facts(alone, "auto", given).map
        for plane, expected in zip(made.planes(), apart.planes(), strict=True):
            np.testing.assert_array_equal(plane, expected)
        looked.pop()
    assert len(residuals) == 1


def test_what_discs_change_is_known_to_all_degrees(monkeypatch):
    """A sixth of it lies beyond those that are known, where lobes are as sharp as lamps."""
    rows, columns = np.mgrid[:256, :512]
    pixels = np.full((256, 512, 3), 0.1, np.float32)
    pixels[(abs(rows - 90) <= 1) & (abs(columns - 200) <= 3)] = 3000
    pixels[(abs(rows - 94) <= 1) & (abs(columns - 203) <= 1)] = 9000
    probe, brdf = shrm.Probe.from_array(pixels), shrm.parse_spec("ggx:roughness=0.15")
    errors = []
    for order in (96, 255):
        monkeypatch.setattr(beside, "_ORDERS", (order, 4))
        errors.append(beside.split_for(probe, brdf).error)
    assert errors[1] > 0.05
    assert errors[0] == pytest.approx(errors[1], rel=0.08)


def test_what_is_wrong_with_discs_is_known_in_world_axes(pixels):
    """It is expanded in others, about which the pixels of a row are alike."""
    probe = shrm.Probe.from_array(pixels, layout="latlong")
    found = beside.split_for(probe, shrm.parse_spec("ggx:roughness=0.5"))
    (lamp,) = found.split.lamps
    each = zip(lamp.light.directions, lamp.light.areas, lamp.light.radiance, strict=True)
    discs = [Disc(direction, radius_of(area), radiance) for direction, area, radiance in each]
    order = found.split.grid.resolved_order
    expected = disc_coefficients(discs, order) - disc_coefficients(found.split.discs, order)
    assert np.linalg.norm(expected) > 1
    np.testing.assert_allclose(found.wrong[: len(expected)], expected, rtol=0, atol=1e-10)
    assert not found.wrong[len(expected) :].any()
