"""The form that is chosen: right in the picture, against brute force, in few bytes."""

import re
from dataclasses import replace

import numpy as np
import pytest

from shrm_cli import automatic
from shrm_cli.errors import ArgumentError
from shrm_cli.lights import beside
from shrm_cli.lights.split import split_lamps
from shrm_cli.maps import wrong_pixels
from shrm_cli.maps.lamps.map import LampMap
from shrm_cli.maps.options import bytes_text
from shrm_cli.maps.principal import proposal as principal_proposal
from shrm_cli.maps.request import Prefiltered
from shrm_cli.maps.seen import kept_or_best
from shrm_cli.maps.shrm import proposals
from shrm_cli.maps.size import total_error
from shrm_cli.maps.wrong_pixels import Negative, lamps_beside
from shrm_cli.plan import policy
from shrm_cli.plan.search import Candidate, Goal
from shrm_cli.prefilter import prefilter, prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.shared import shared
from shrm_cli.vocabulary import COARSE_ROWS, DEFAULT_ERROR, DEFAULT_SEEN
from tests import brute_force, oracles
from tests.cli.helpers import done, polynomial_light, run, write_exr

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
POINTS = 1500
MICROFACET = "microfacet:sigma=0.4"
SKIN = "lafortune:fit=skin"


@pytest.fixture(scope="module")
def pixels():
    """A coloured gradient with a lamp of a few pixels, 64 x 32."""
    found = polynomial_light(oracles.latlong_pixels(64, 32))
    found[8:10, 20:22] = [120, 80, 40]
    return found.astype(np.float32)


@pytest.fixture(scope="module")
def probe(pixels):
    return Probe.from_array(pixels)


@pytest.fixture
def folder(tmp_path, monkeypatch, pixels):
    write_exr(tmp_path / "probe.exr", pixels)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def measured(pixels, rho_hat, made):
    """The relative RMS error of a map and its share of wrong pixels, by brute force."""
    rng = np.random.default_rng(7)
    mirrored, views = brute_force.unit(rng, POINTS), brute_force.unit(rng, POINTS)
    normals = mirrored + views
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    directions, weights = brute_force.latlong_samples(len(pixels))
    radiance = pixels.reshape(-1, 3).astype(float)
    pairs = zip(mirrored, views, strict=True)
    truth = np.array(
        [brute_force.reflected(rho_hat, *each, directions, weights, radiance) for each in pairs]
    )
    shown = made.radiance(normals, views)
    error = np.sqrt(np.mean((shown - truth) ** 2) / np.mean(truth**2))
    dark = 0.02 * (truth @ LUMINANCE).mean()
    wrong = np.abs((shown - truth) @ LUMINANCE) > 0.05 * np.maximum(truth @ LUMINANCE, dark)
    return error, wrong.mean(), np.mean(shown @ LUMINANCE < 0)


def made(probe, **given):
    return prefilter_with_facts(probe, "auto", given)


def texels(map_):
    """The texels of all cubes of a map, a face each."""
    return map_.summary()["maps"] * map_.size**2


def stored_size(map_):
    """The bytes of the cubes in half precision."""
    return 6 * 6 * map_.cube_count * map_.size**2


def stated_error(map_):
    return total_error(map_.info.predicted_error, map_.info.filter_error)


def test_a_picture_is_right_by_default(pixels, probe):
    """The SHRM of the default tolerance has a tenth of its pixels wrong here."""
    rho_hat = brute_force.microfacet(0.4)
    map_ = prefilter(probe, MICROFACET)
    assert stated_error(map_) <= DEFAULT_ERROR
    error, wrong, negative = measured(pixels, rho_hat, map_)
    assert error < 1.1 * DEFAULT_ERROR
    assert wrong < DEFAULT_SEEN + 0.015  # of 1500 points
    assert negative <= 0.002
    assert measured(pixels, rho_hat, prefilter(probe, MICROFACET, to="shrm"))[1] > 0.08


def test_lobes_of_one_cube_are_shrms_as_ever(probe):
    for spec in ("lambertian", "phong:exponent=16", "0.6*lambertian+0.4*phong:exponent=16"):
        found, forced = prefilter(probe, spec), prefilter(probe, spec, to="shrm")
        assert found.representation == "shrm"
        np.testing.assert_array_equal(
            found.radiance([0, 0, 1], [0.6, 0, 0.8]), forced.radiance([0, 0, 1], [0.6, 0, 0.8])
        )


def test_an_shrm_is_taken_where_it_keeps_what_is_asked_in_few_bytes(probe, monkeypatch):
    found = made(probe, brdf=MICROFACET)
    assert found.map.representation == "shrm"
    heading, why = found.notes[0]
    assert heading == "form"
    assert why.startswith("SHRM, which keeps")
    # The file of smooth light is a fifth of it, and no contradiction.
    assert why.endswith(f"in {bytes_text(6 * 6 * texels(found.map))} before packing")
    monkeypatch.setattr(policy, "SIMPLE_TIMES", 0)  # unless another form takes fewer
    found = made(probe, brdf=MICROFACET)
    assert found.map.representation == "principal"


def test_the_line_tells_what_an_shrm_would_be_like(probe, monkeypatch):
    monkeypatch.setattr(policy, "SIMPLE_TIMES", 0)
    found = made(probe, brdf=SKIN)
    assert found.map.representation == "principal"
    why = dict(found.notes)["form"]
    assert why.startswith("principal: an SHRM of its error takes ")
    asked = {"brdf": SKIN, "error": stated_error(found.map)}
    shrm = prefilter_with_facts(probe, "shrm", asked).map
    assert why.endswith(bytes_text(6 * 6 * texels(shrm)))
    assert texels(shrm) > 2 * texels(found.map)


def test_less_is_asked_and_fewer_bytes_are_made(probe):
    def size(**given):
        found = made(probe, brdf=SKIN, **given).map
        return texels(found), stated_error(found)

    by_default, exact = size(), size(error=0.01)
    rough = size(error=0.2)
    assert rough[0] < by_default[0] < exact[0]
    assert exact[1] <= 0.01 < rough[1] <= 0.2
    loose, strict = (prefilter(probe, SKIN, to="principal", seen=share) for share in (0.3, 0.01))
    assert texels(loose) < texels(strict)


def test_where_nothing_holds_the_line_says_what_would(pixels):
    sun = pixels.copy()
    sun[8, 20] = 1e6
    asked = {"brdf": "ggx:roughness=0.1,f0=0.04", "max_size": 200_000}
    found = made(Probe.from_array(sun), **asked, sun="keep")
    (line,) = [each for each in found.warnings if each.startswith("no map keeps")]
    assert "in 200 kB" in line
    assert "dim them by `clamp`" in line
    assert "take them out with `sun` split, as discs, or" in line
    apart = made(Probe.from_array(sun), **asked, sun="split")
    assert stated_error(apart.map) < stated_error(found.map) / 2
    assert "raise `max_size`" in line
    assert f"{100 * stated_error(found.map):.2g}%" in line


def test_dark_maps_name_what_helps(bare_sun):
    """A ring of light is no disc that could lie beside the map."""
    ring = np.full((32, 64, 3), 0.001, np.float32)
    ring[8] = 1e3
    asked = {"brdf": "ggx:roughness=0.4", "max_size": "100kB"}
    for light, helps in (
        (bare_sun, "take them out with `sun` split, as discs, or dim them by `clamp`"),
        (Probe.from_array(ring), "dim them by `clamp`"),
    ):
        warnings = prefilter_with_facts(light, "principal", asked).warnings
        (line,) = [each for each in warnings if "negative" in each]
        assert line.endswith(f"; {helps}")


@pytest.mark.parametrize("is_better", [True, False])
def test_discs_that_are_better_but_not_by_enough_are_told_of(bare_sun, monkeypatch, is_better):
    """At night 19 % of gold's pixels were wrong, and 11 % with `sun` split: "as much", it said."""
    monkeypatch.setattr(automatic._Choice, "kept_beside_lamps", None)
    monkeypatch.setattr(automatic, "is_worth_lamps", lambda *_: False)
    if not is_better:
        monkeypatch.setattr(policy, "MISSED", 1e9)
    asked = {"brdf": "ggx:roughness=0.2", "max_size": "500kB"}
    lines = [each for each in made(bare_sun, **asked).warnings if "`clamp`" in each]
    assert lines
    if not is_better:
        assert all("(`sun` split) miss as much; dim them by `clamp`" in each for each in lines)
        return
    assert all("take them out with `sun` split, as discs, " in each for each in lines)
    share = made(bare_sun, **asked, sun="split").further["predicted_wrong_share"]()
    assert f" and {100 * share:.2g}% of pixels wrong by more than 5% in 5.18 kB" in lines[0]


@pytest.fixture(scope="module")
def bare_sun():
    """A grey sky with a sun of half a degree, as sharp as pixels of 2.8 degrees show it."""
    found = np.full((64, 128, 3), 0.5, np.float32)
    found[15, 20] = 5e3
    return Probe.from_array(found)


GLOSSY = [
    pytest.param("0.1*ggx:roughness=0.1,f0=0.5+0.9*lambertian", marks=pytest.mark.proof),
    pytest.param("coated", marks=pytest.mark.proof),
    "ggx:roughness=0.2",
]


@pytest.mark.parametrize("spec", GLOSSY)
def test_lamps_go_beside_the_map_where_it_cannot_keep_them(bare_sun, spec):
    """In what code of shaders tells of all, and so fewer bytes keep what is asked."""
    apart, kept = (made(bare_sun, brdf=spec, sun=sun, max_size="500kB") for sun in (None, "keep"))
    assert isinstance(apart.map, LampMap)
    assert not isinstance(kept.map, LampMap)
    assert (
        np.hypot(stated_error(apart.map), apart.map.error) <= DEFAULT_ERROR < stated_error(kept.map)
    )
    assert texels(apart.map) < texels(kept.map) / 10
    why = dict(apart.notes)["form"]
    assert "lamps beside it" in why
    assert "no map of 500 kB with them in it (`sun` keep) keeps an RMS error of 5%" in why
    assert [heading for heading, _ in apart.notes].count("form") == 1
    assert not any("no map keeps" in line for line in apart.warnings)
    assert apart.map.info.options["to"] == "auto"
    assert "sun" not in apart.map.info.options  # whoever asks for the same gets the same
    assert apart.further["negative_share"]() == 0
    assert apart.further["worst_negative_share"]() == 0


@pytest.mark.proof
def test_what_is_left_beside_lamps_may_miss_as_much_of_all_light():
    """Small lamps that stay in the map would take thirty times the texels for their own light."""
    light = np.full((128, 256, 3), 0.5, np.float32)
    light[20:92:6, 15:230:19] = np.where(np.eye(12, 12)[..., None] > 0, 55, 0.5)
    light[30, 40] = 1e5
    probe, spec = Probe.from_array(light), "0.1*ggx:roughness=0.1+0.9*lambertian"
    asked = {"brdf": spec, "max_size": "300kB"}
    found, by_hand = (made(probe, **asked, **more) for more in ({}, {"sun": "split"}))
    own = made(split_lamps(probe).residual_probe, **asked, sun="keep")
    assert stated_error(found.map) <= DEFAULT_ERROR < stated_error(found.map) / found.map.left
    assert stated_error(own.map) <= DEFAULT_ERROR
    assert found.further["predicted_wrong_share"]() <= DEFAULT_SEEN
    assert texels(found.map) == texels(by_hand.map) < texels(own.map) / 20


def test_lamps_taken_out_by_hand_leave_as_much_to_be_missed():
    """Of a dark sky with a horizon, what is left is a small part of the light."""
    sky = np.full((64, 128, 3), 0.1, np.float32)
    sky[32:] = 0.01
    sky[15, 20] = 5e3
    dark = Probe.from_array(sky)
    asked = {"brdf": "coated", "max_size": "500kB", "seen": 0.02}
    found, by_hand = (made(dark, **asked, **more) for more in ({}, {"sun": "split"}))
    assert isinstance(found.map, LampMap)
    assert texels(by_hand.map) == texels(found.map)
    assert by_hand.map.info.predicted_error == found.map.info.predicted_error
    assert by_hand.map.info.options["sun"] == "split"


def test_what_is_missed_beside_lamps_is_told_of_all_light():
    """What is left may miss much of its own light, which nobody should read as that of all."""
    missed = Candidate("principal", 1000, 1, 0.6, lambda: 0.01, lambda: Prefiltered(None))
    (line,) = kept_or_best([missed], Goal(0.4, 0.05), 2**25, left=0.125).warnings
    assert "no map keeps an RMS error of 5% of all light and 5% wrong pixels" in line
    assert "the one made has 7.5% RMS error and 1% of pixels wrong" in line


def test_lamps_stay_in_maps_that_keep_them_and_where_code_has_none(bare_sun):
    assert not isinstance(made(bare_sun, brdf="lambertian").map, LampMap)
    assert not isinstance(made(bare_sun, brdf="phong:exponent=8").map, LampMap)
    found = made(bare_sun, brdf="coated:base=(lafortune)", max_size="100kB")
    assert not isinstance(found.map, LampMap)
    assert any("`sun` split" in line for line in found.warnings)


@pytest.mark.proof
def test_no_brushed_map_of_all_light_is_looked_for_in_vain(bare_sun, monkeypatch):
    """A coarse look tells that none keeps what is asked, by far. What is made is the same."""
    monkeypatch.setattr(beside, "_ORDERS", (48, 4))
    looked_for = counting(monkeypatch, principal_proposal, "planner_of")
    asked = {"brdf": "ggx:roughness=0.4,anisotropy=0.6", "max_size": "100kB"}
    found = made(bare_sun, **asked)
    assert isinstance(found.map, LampMap)
    assert "with them in it (`sun` keep) keeps an RMS" in dict(found.notes)["form"]
    assert bare_sun.digest() not in {light.probe.digest() for light, *_ in looked_for}
    monkeypatch.setattr(principal_proposal, "is_out_of_reach", lambda *_: False)
    slower = made(bare_sun, **asked)
    error = stated_error(made(bare_sun, **asked, sun="keep").map)
    would = f"with them in the map (`sun` keep) it would have {100 * error:.2g}% RMS error"
    assert would in dict(slower.notes)["form"]
    assert bare_sun.digest() in {light.probe.digest() for light, *_ in looked_for}
    for planes, others in zip(found.map.planes(), slower.map.planes(), strict=True):
        np.testing.assert_array_equal(planes, others)


@pytest.mark.parametrize(("brdf", "searches"), [("charlie:roughness=0.5", 0), (MICROFACET, 1)])
def test_no_shrm_is_looked_for_where_few_degrees_of_the_view_show_too_little(
    probe, monkeypatch, brdf, searches
):
    looked_for = counting(monkeypatch, proposals.ShrmProposals, "within")
    found = made(probe, brdf=brdf, sun="keep")
    assert (found.map.representation == "shrm") == (searches == 1)
    assert len(looked_for) == searches


@pytest.mark.proof
def test_lamps_beside_a_map_that_keeps_too_little_have_to_spare_bytes(rng, monkeypatch):
    """Between leaves, which no map of some kilobytes shows."""
    names = "WORTH_LAMPS", "FAR_SMALLER"
    for each in (*names, "FAR_LESS_WRONG"):
        monkeypatch.setattr(policy, each, 0.0)
    leaves = rng.uniform(0.2, 0.8, (64, 128, 3)).astype(np.float32)
    leaves[15, 20] = 5e3
    light, asked = Probe.from_array(leaves), {"brdf": "ggx:roughness=0.3", "max_size": "20kB"}
    asked |= {"error": 3e-4, "seen": 1e-3}
    apart, kept = (made(light, **asked, sun=sun) for sun in ("split", "keep"))
    share = stored_size(apart.map) / stored_size(kept.map)
    for worths in ((1.01, 0), (0, 1.01), (0.99, 0.99)):
        for name, worth in zip(names, worths, strict=True):
            monkeypatch.setattr(policy, name, worth * share)
        found = made(light, **asked)
        assert isinstance(found.map, LampMap) == (max(worths) > 1)
        assert any("no map keeps" in line for line in found.warnings)


def test_lamps_leave_large_maps_that_keep_them_for_far_smaller_ones(bare_sun, monkeypatch):
    monkeypatch.setattr(policy, "SIMPLE_TIMES", 0)
    asked = {"brdf": "ggx:roughness=0.6", "error": 0.05}
    kept = made(bare_sun, **asked, sun="keep")
    assert not any("no map keeps" in line for line in kept.warnings)
    monkeypatch.setattr(policy, "LARGE", 10_000)
    monkeypatch.setattr(policy, "FAR_SMALLER", 1.0)
    apart = made(bare_sun, **asked)
    assert isinstance(apart.map, LampMap)
    size = stored_size(kept.map)
    share = stored_size(apart.map) / size
    for large, far, is_apart in (
        (0.99 * size, 1.01 * share, True),
        (1.01 * size, 1.01 * share, False),
        (0.99 * size, 0.99 * share, False),
    ):
        monkeypatch.setattr(policy, "LARGE", int(large))
        monkeypatch.setattr(policy, "FAR_SMALLER", far)
        found = made(bare_sun, **asked)
        assert isinstance(found.map, LampMap) == is_apart


@pytest.mark.parametrize(
    ("brighter", "spec", "large", "is_apart", "is_sure"),
    [
        (8, "ggx:roughness=0.25", 210_000, True, True),  # the least error is far too large
        pytest.param(4, "ggx:roughness=0.3", 400_000, True, False, marks=pytest.mark.proof),
        pytest.param(20, "ggx:roughness=0.5", 1_600_000, False, False, marks=pytest.mark.proof),
    ],
)
def test_no_large_map_is_looked_for_where_lamps_go_beside_a_far_smaller_one(
    pixels, monkeypatch, brighter, spec, large, is_apart, is_sure
):
    """What is made is the same as where all maps are looked for first."""
    lit = pixels.copy()
    lit[8:10, 20:22] *= brighter
    probe, looked_for = Probe.from_array(lit), []
    find = principal_proposal.Proposals.rows

    def rows(maps, max_size):
        if maps.light.probe.digest() == probe.digest():
            looked_for.append(max_size)
        return find(maps, max_size)

    monkeypatch.setattr(principal_proposal.Proposals, "rows", rows)
    monkeypatch.setattr(policy, "LARGE", large)
    found = made(probe, brdf=spec)
    assert isinstance(found.map, LampMap) == is_apart
    assert looked_for == ([] if is_sure else [large])
    monkeypatch.setattr(automatic._Choice, "_are_lamps_first", False)
    monkeypatch.setattr(automatic._Choice, "_kept_in_few", None)
    slower = made(probe, brdf=spec)
    for planes, others in zip(found.map.planes(), slower.map.planes(), strict=True):
        np.testing.assert_array_equal(planes, others)


@pytest.mark.parametrize(("error", "is_said"), [(0.05, True), (0.9 * policy.LEAST_ERROR, False)])
def test_more_bytes_are_advised_where_more_would_be_tried(error, is_said):
    """A hundred megabytes made the very map of 32."""
    best = Candidate("principal", 100, 128, error, lambda: 0.5, lambda: Prefiltered(None))
    (line,) = kept_or_best([best], Goal(), 150).warnings
    assert ("raise `max_size`" in line) == is_said


def test_a_size_that_is_too_small_is_named():
    """Lamps were blamed for what four texels along an edge cannot hold."""
    best = Candidate("principal", 100, 128, 0.5, lambda: 0.5, lambda: Prefiltered(None))
    (line,) = kept_or_best([best], Goal(), 1000, size=4).warnings
    assert "in cubes of 4 texels; " in line
    assert line.endswith("Leave `size` out, which chooses them")
    (line,) = kept_or_best([best], Goal(), 150, size=4).warnings
    assert "raise `max_size`" in line


@pytest.mark.parametrize("shown", [Negative(0.3, 0.3), Negative(0.0, 0.006)])
def test_dark_maps_are_made_without_lamps_too(bare_sun, monkeypatch, shown):
    """Where all that keep the error are negative beside the lamp, from some side at least."""
    asked = {"brdf": "ggx:roughness=0.5", "error": 0.3, "seen": 0.9}
    assert not isinstance(made(bare_sun, **asked).map, LampMap)
    counted = wrong_pixels.negative_of

    def dark(map_, truth=None):
        return shown if lamps_beside.get() is None else counted(map_, truth)

    monkeypatch.setattr(wrong_pixels, "negative_of", dark)
    found = made(bare_sun, **asked)
    assert isinstance(found.map, LampMap)
    assert re.search(r"with them in the map .*, and black spots$", dict(found.notes)["form"])


def test_dark_places_are_given_more(probe, monkeypatch):
    """Where a map is negative, those of less error are tried, and the least dark one is taken."""
    asked = []
    shares = [(0.0005, 0.3), (0.02, 0.0), (0.0, 0.2)]

    def share(map_, truth=None):
        asked.append(texels(map_))
        return Negative(*shares[len(asked) - 1])

    monkeypatch.setattr(wrong_pixels, "negative_of", share)
    monkeypatch.setattr(policy, "SIMPLE_TIMES", 0)
    found = made(probe, brdf=MICROFACET, sun="keep").map
    assert len(asked) == policy.TRIED_DARK
    assert asked == sorted(asked)
    assert texels(found) == asked[1]


def test_what_is_better_is_looked_for_beside_each_map(monkeypatch):
    """Where the first one is negative somewhere, lamps may be worth it beside the next, larger."""

    def candidate(bytes_):
        return Candidate("principal", bytes_, 1, 0.01, float, lambda: Prefiltered(None))

    shares = {"negative_share": lambda: 0.5, "worst_negative_share": lambda: 0.5}
    dark = replace(Prefiltered(None), further=shares)
    monkeypatch.setattr("shrm_cli.maps.seen.examined", lambda *_: dark)
    beside = Prefiltered(None, warnings=("beside",))
    found = kept_or_best(
        [candidate(10), candidate(20), candidate(30)], Goal(), 150,
        lambda best, is_kept: beside if is_kept and best.bytes == 20 else None,
    )  # fmt: skip
    assert found is beside


def counting(monkeypatch, owner, name):
    """Count the calls of a function."""
    calls, plain = [], getattr(owner, name)

    def counted(*args, **given):
        calls.append(args)
        return plain(*args, **given)

    monkeypatch.setattr(owner, name, counted)
    return calls


def test_nothing_is_found_out_twice(probe, monkeypatch):
    monkeypatch.setattr(policy, "SIMPLE_TIMES", 0)
    dark = counting(monkeypatch, wrong_pixels, "negative_of")
    wrong = counting(monkeypatch, principal_proposal, "predicted_wrong_share")
    expanded = counting(monkeypatch, proposals, "choose_orders")
    found = made(probe, brdf=SKIN)
    judged = len(wrong)
    assert found.map.representation == "principal"
    assert found.summary()["predicted_wrong_share"] <= DEFAULT_SEEN
    assert (len(dark), len(wrong), len(expanded)) == (1, judged, 1)


def test_no_map_is_made_beside_lamps_in_vain(rng, monkeypatch):
    """Discs in place of a square box miss more than the map; that of a pixel misses nothing."""
    for name in ("WORTH_LAMPS", "FAR_LESS_WRONG", "FAR_SMALLER"):
        monkeypatch.setattr(policy, name, 0.0)
    monkeypatch.setattr(wrong_pixels, "_LOOKED_UP", np.inf)  # maps are made for look-ups, too
    makes = counting(monkeypatch, principal_proposal, "lobe_of")
    foreseen = counting(monkeypatch, automatic._Choice, "foresee")
    for rows, columns, times, ways in ((slice(20, 34), slice(40, 60), 0, 3), (20, 40, 1, 4)):
        light = rng.uniform(0.2, 0.8, (64, 128, 3)).astype(np.float32)
        light[rows, columns] = 300
        asked = {"brdf": "ggx:roughness=0.3", "max_size": "20kB", "seen": 1e-3}
        found = made(Probe.from_array(light), **asked)
        assert not isinstance(found.map, LampMap)
        assert (len(makes), len(foreseen)) == (1 + times, ways)


def test_pixels_are_read_once(probe, monkeypatch):
    """The SHRM of single cubes misses what is asked here, and principal functions are made."""
    rows = counting(monkeypatch, type(probe.images[0]), "read")
    sharp = "phong:exponent=2000"
    found = made(probe, brdf=sharp, error=0.002, sun="keep")
    assert found.map.representation == "principal"
    # Its pixels are cut for so sharp a lobe, and those of 128 rows are read once, too.
    assert sum(stop - start for _, start, stop in rows) == probe.height + COARSE_ROWS
    known = shared(probe)
    assert shared(known) is known


@pytest.mark.parametrize(
    ("given", "form"),
    [
        ({"eps": 0.03}, "shrm"),
        ({"order_p": 2}, "shrm"),
        ({"frame": "local"}, "shrm"),
        ({"compress": 2}, "shrm"),
    ],
)
def test_what_only_shrms_obey_means_one(probe, form, given):
    assert made(probe, brdf=SKIN, **given).map.representation == form


def test_the_command_names_files_by_what_it_made(folder, monkeypatch):
    monkeypatch.setattr(policy, "SIMPLE_TIMES", 0)
    done("prefilter", "probe.exr", "--brdf", "lambertian")
    out = done("prefilter", "probe.exr", "--brdf", SKIN, "--max-size", "2MB")
    assert "form           principal: an SHRM of its error takes" in out
    assert (folder / "probe.lambertian.shrm.exr").exists()
    target = folder / "probe.lafortune-fit-skin.principal.exr"
    made = target.read_bytes()
    done("prefilter", "probe.exr", "--brdf", SKIN, "--max-size", "2MB")
    assert target.read_bytes() == made
    refused = run("prefilter", "probe.exr", "--brdf", SKIN)
    assert refused.code == 1
    assert "--max-size 2000000 there, 32000000 here" in refused.err


@pytest.mark.proof
def test_batches_choose_too_and_know_what_they_chose(folder):
    command = "batch", "probe.exr", "--brdf", "lambertian", "--brdf", SKIN
    assert run(*command, "--max-size", "500kB").code == 0
    names = {path.name for path in folder.glob("probe.*.auto.exr")}
    assert names == {"probe.lambertian.auto.exr", "probe.lafortune-fit-skin.auto.exr"}
    again = run(*command, "--max-size", "500kB", "--dry-run")
    assert (again.code, again.err.count("there already")) == (0, 2)
    other = run(*command, "--max-size", "400kB", "--dry-run")
    assert other.err.count("--max-size 500000 there, 400000 here") == 2, other
    assert run(*command, "--eps", "0.1").code == 0
    assert (folder / "probe.lambertian.shrm.exr").exists()


@pytest.mark.proof
def test_forms_that_are_named_keep_what_is_seen_too(pixels, probe):
    rho_hat = brute_force.microfacet(0.4)
    sizes = {}
    for form in ("shrm", "principal"):
        rough = prefilter(probe, MICROFACET, to=form, error=0.2)
        fine = prefilter(probe, MICROFACET, to=form, seen=0.05)
        assert measured(pixels, rho_hat, rough)[1] > 0.1
        assert measured(pixels, rho_hat, fine)[1] < 0.065
        sizes[form] = texels(fine)
    assert sizes["principal"] < sizes["shrm"]


@pytest.mark.parametrize(
    ("form", "given"),
    [("shrm", {"eps": 0.1}), ("shrm", {"frame": "local"}), ("shrm", {"compress": 2}),
     ("principal", {"maps": 4})],
)  # fmt: skip
def test_what_says_the_opposite_is_refused(probe, form, given):
    (name,) = given
    with pytest.raises(ArgumentError, match=f"`?{name}`? does not apply with `seen`"):
        prefilter(probe, MICROFACET, to=form, seen=0.05, **given)


@pytest.mark.parametrize("spec", [pytest.param(MICROFACET, marks=pytest.mark.proof), "oren-nayar"])
def test_who_asks_for_orders_at_a_terminal_hears_what_would_have_been_made(folder, probe, spec):
    asked = ["prefilter", "probe.exr", "--brdf", spec, "--order-f", "2", "--order-p", "0"]
    short = run(*asked, "-o", "a.exr").err
    assert "--to auto, without --eps, --error or orders, chooses the form that it needs" in short
    told = run(*asked, "-o", "b.exr", terminal=True).err
    (line,) = [each for each in told.splitlines() if "--to auto" in each]
    made = prefilter_with_facts(probe, "auto", {"brdf": spec})
    error = total_error(made.map.info.predicted_error, made.map.info.filter_error)
    share = made.further["predicted_wrong_share"]()
    assert f"would make {made.map.representation} in " in line
    assert f" or more, with {100 * error:.2g}% RMS error and {100 * share:.2g}% of pixels" in line


def test_who_hears_of_other_forms_hears_of_the_shrm_of_a_single_cube(folder):
    asked = ["prefilter", "probe.exr", "--brdf", "phong:exponent=8", "--order-f", "0"]
    told = run(*asked, "-o", "a.exr", terminal=True).err
    assert "would make shrm in " in told


def test_bytes_that_hold_no_map_of_a_sum_are_refused_with_those_that_would(bare_sun):
    """Each term needs a cube."""
    spec = "ggx:roughness=0.6,f0=0.04+0.5*lambertian"
    for max_size in ("5kB", "6kB"):
        with pytest.raises(ArgumentError, match="the least map takes 10,368 bytes"):
            made(bare_sun, brdf=spec, max_size=max_size)
