"""How far the BRDF of a map is sampled: the thresholds, beside errors of full maps."""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_transfer
from shrm_cli.maps.principal import terms
from shrm_cli.maps.principal.proposal import Proposals, is_out_of_reach, scouted
from shrm_cli.maps.principal.terms import first_planner, planner_of, terms_of
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.seen import kept_or_best
from shrm_cli.plan.search import Candidate, Goal
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.reflected import energies_beyond, weighted_power
from tests.maps.principal.test_principal import lit_room

BRUSHED = "ggx:roughness=0.4,anisotropy=0.8"
LITTLE = 200_000
"""Bytes in which no map of the brushed surface is right."""


@pytest.fixture(scope="module")
def light():
    return Projection(Probe.from_array(lit_room()))


def planned(light, spec, eps=0.03, error=None):
    want = Request("principal", eps=eps, error=error, max_size=2**25)
    return planner_of(light, parse_spec(spec), want).spectrum.transfer


def test_a_tenth_of_the_squared_error_may_lie_beyond_the_degrees():
    pixels = np.full((128, 256, 3), 0.01, np.float32)
    pixels[40, 30] = 1000  # a lamp, whose light has all degrees
    light = Projection(Probe.from_array(pixels))
    known = compute_transfer(parse_spec("ggx:roughness=0.4"), 64, 6, 1e-4)
    lighting = light.to_order(64)
    above = energies_beyond(lighting, known)[0]
    whole = np.sum(weighted_power(lighting, 64) * known.degree_energy)
    least = np.sqrt(10 * above / whole)
    assert planned(light, "ggx:roughness=0.4", error=1.15 * least).order_f == 64
    assert planned(light, "ggx:roughness=0.4", error=0.87 * least).order_f == 128


def test_a_tenth_of_that_may_lie_in_higher_azimuthal_orders(light):
    known = compute_transfer(parse_spec("ggx:roughness=0.6"), 64, 6, 1e-4)
    # Nearly all that is missing is at higher azimuthal orders, as degrees end before 64.
    aside = 1 - known.degree_energy.sum() / known.total_energy.sum()
    assert planned(light, "ggx:roughness=0.6", eps=1.2 * 50 * aside).max_q == 6
    assert planned(light, "ggx:roughness=0.6", eps=0.8 * 50 * aside).max_q == 12


@pytest.mark.proof
def test_a_coarse_look_tells_what_no_map_keeps(light):
    """It is sure only where the best map misses by far."""
    brdf = parse_spec(BRUSHED)
    best = prefilter_with_facts(
        light.probe, "principal", {"brdf": brdf, "error": 1e-3, "max_size": LITTLE}
    )
    error = np.hypot(best.map.info.predicted_error, best.map.info.filter_error)
    share = best.further["predicted_wrong_share"]()

    want = Request("principal", error=error, max_size=LITTLE)
    planner = scouted(light, brdf, want)

    def is_far(error, seen):
        return is_out_of_reach([planner], replace(want, error=error, seen=seen))

    assert is_far(error / 1.7, None)
    assert not is_far(error / 1.3, None)
    assert is_far(error, share / 4.4)
    assert not is_far(error, share / 1.8)
    # Nor of maps that are so good that coarse sampling would be a part of their error.
    best = Request("principal", error=1e-4, max_size=2**25)
    assert not is_out_of_reach([planner], best)
    # Where maps are nearly as good, shares are told that are 3.2 times as large as they are.
    more = replace(want, max_size=8 * LITTLE)
    assert not is_out_of_reach([planner], replace(more, seen=0.082))
    assert is_out_of_reach([planner], replace(more, seen=0.06))


@pytest.mark.parametrize(
    ("spec", "sure"),
    [
        ("ggx:roughness=0.3", 1.7),
        ("ggx:roughness=0.4", 1.7),
        # The terms of a sum share the bytes, all of which each has at a first look.
        ("ggx:roughness=0.3,f0=0.04+0.5*lambertian", 2.2),
    ],
)
def test_a_first_look_tells_what_no_map_keeps(light, spec, sure):
    """It is sure only where the best map misses by far."""
    brdf = parse_spec(spec)
    asked = {"brdf": brdf, "error": 1e-3, "max_size": LITTLE}
    best = prefilter_with_facts(light.probe, "principal", asked)
    error = np.hypot(best.map.info.predicted_error, best.map.info.filter_error)
    share = best.further["predicted_wrong_share"]()
    parts, _ = terms_of(brdf, None, False)
    want = Request("principal", error=error, max_size=LITTLE)
    planners = [first_planner(light, part, want) for part in parts]

    def is_far(error, seen):
        return is_out_of_reach(planners, replace(want, error=error, seen=seen))

    assert is_far(error / sure, None)
    assert not is_far(error / 1.4, None)
    assert is_far(error, share / 1.7)
    assert not is_far(error, share / 1.3)


@pytest.mark.proof
def test_what_no_map_keeps_is_sampled_coarsely_and_once(light, monkeypatch):
    asked = []

    def sampled(brdf, order, max_q, accuracy, compute):
        asked.append((order, max_q, accuracy))
        return compute(brdf, order, max_q, accuracy)

    monkeypatch.setattr(terms, "cached_transfer", sampled)
    given = {"brdf": BRUSHED, "max_size": LITTLE, "sun": "keep"}
    made = prefilter_with_facts(light.probe, "auto", given)
    assert [accuracy for *_, accuracy in asked] == [1e-3]
    (line,) = [each for each in made.warnings if each.startswith("no map keeps")]
    assert "raise `max_size`" in line
    asked.clear()
    prefilter_with_facts(light.probe, "principal", {"brdf": BRUSHED, "error": 0.2})
    assert {accuracy for *_, accuracy in asked} == {1e-4}


@pytest.mark.parametrize("can_grow", [True, False])
def test_more_bytes_are_advised_where_they_would_hold_more(can_grow):
    candidate = Candidate(
        "principal", 100, 128, 0.5, lambda: 0.5, lambda: Prefiltered(None), can_grow
    )
    (line,) = kept_or_best([candidate], Goal(), 150).warnings
    assert ("raise `max_size`" in line) == can_grow
    assert "50% RMS error" in line


@pytest.mark.proof
def test_a_map_of_all_cubes_cannot_grow(light):
    given = {"brdf": parse_spec(BRUSHED), "error": 1e-3, "size": 12}
    proposals = Proposals(light, Request.of("principal", given, light.probe))
    assert not proposals.candidate(1e-3).can_grow
    proposals.asked = replace(proposals.asked, max_size=LITTLE)
    assert proposals.candidate(1e-3).can_grow
