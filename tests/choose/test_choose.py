"""`shrm.choose` beside a search of all forms, one by one, and beside the truth."""

import gc
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.choose import choose
from shrm_cli.choose.choose import Truth
from shrm_cli.errors import ArgumentError
from shrm_cli.lights import beside
from shrm_cli.lights.split import split_lamps
from shrm_cli.maps.lamps.map import LampMap
from shrm_cli.maps.principal.plan import Sharing
from shrm_cli.maps.principal.principal import PrincipalMap
from shrm_cli.maps.principal.proposal import Proposals, predicted_wrong_share
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.proposals import ShrmProposals
from shrm_cli.maps.size import TRIED_SIZES
from shrm_cli.maps.splitsum.split_sum import BrushedSplitSum
from shrm_cli.plan import policy
from shrm_cli.plan.search import Goal
from shrm_cli.probe.lighting import Projection
from shrm_cli.reference import Reference
from tests.brute_force import unit

LIMIT = 32_000_000
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def light(seed, lamp):
    """Soft light with a lamp, on 32 rows."""
    rng = np.random.default_rng(seed)
    pixels = rng.random((32, 64, 3)) ** 3 + 0.1
    pixels[8:11, 20 + seed : 23 + seed] += lamp
    return shrm.Probe.from_array(pixels.astype(np.float32), layout="latlong")


def every_form(probe, spec):
    """(bytes, function that tells error and share) of principal maps and SHRMs, one by one."""
    projection = Projection(probe)
    asked = Request("principal", parse_spec(spec), error=policy.LEAST_ERROR, max_size=LIMIT)
    proposals = Proposals(projection, asked)
    (planner,) = proposals.planners

    def principal(counts, size):
        form = planner.form(counts, size)
        if form.total_error > 0.051:
            return 1.0, 1.0
        share = predicted_wrong_share([(planner, form)])
        exact = planner.form(counts, size, is_exact=True)
        if share <= 0.05:  # look-ups may show more, which take longer to be known
            share = proposals.proposal([exact]).wrong_share()
        return exact.total_error, share

    for size in TRIED_SIZES:
        for counts in planner.choices:
            cubes = counts[0] + 2 * sum(counts[1:])
            yield 36 * size**2 * cubes, partial(principal, counts, size)
    transfer = planner.spectrum.transfer
    for size in TRIED_SIZES:
        asked = Request("shrm", proposals.parts[0], size=size, max_size=LIMIT)
        shrms = ShrmProposals.of(projection, asked, transfer)
        error, before = 0.05, 0
        while (found := shrms.candidate(error)).total_error <= error and found.bytes > before:
            yield found.bytes, lambda found=found: (found.total_error, found.wrong_share)
            error, before = found.total_error * 0.999, found.bytes


@pytest.mark.proof
@pytest.mark.parametrize(
    ("seed", "lamp", "spec"),
    [
        (0, 5, "ggx:roughness=0.7,f0=gold"),
        (1, 30, "microfacet:sigma=0.4"),
        (2, 10, "oren-nayar"),
        (3, 1, "phong:exponent=32"),
    ],
)
def test_no_other_form_keeps_the_goal_in_far_fewer_bytes(seed, lamp, spec):
    probe = light(seed, lamp)
    (choice,) = shrm.choose(probe, spec)
    assert choice.is_kept
    kept = [
        each.bytes
        for each in choice.offers
        if each.form in ("principal", "shrm") and each.keeps(choice.goal)
    ]
    least = min(kept)
    for size, find in sorted(every_form(probe, spec), key=lambda each: each[0]):
        if size >= least / 1.05:
            break
        error, share = find()
        assert error > 0.05 or share > 0.05, (size, least)
    assert choice.recommended.bytes <= least


@pytest.mark.proof
def test_exact_errors_are_found_only_where_enough_pixels_are_right(monkeypatch):
    """They take ten times as long as the share of wrong pixels, and were found of all maps."""
    looked_at = []
    joint = Sharing.joint

    def recorded(self, forms, is_exact=False):
        if is_exact:
            share = predicted_wrong_share(list(zip(self.planners, forms, strict=True)))
            looked_at.append((sum(form.bytes for form in forms), share))
        return joint(self, forms, is_exact)

    monkeypatch.setattr(Sharing, "joint", recorded)
    (choice,) = shrm.choose(light(1, 30), "oren-nayar")
    offered = {each.bytes for each in choice.offers if each.form == "principal"}
    assert len(looked_at) > len(offered)
    assert [each for each in looked_at if each[0] not in offered and each[1] > 0.05] == []


@pytest.mark.proof
def test_sums_share_their_bytes_among_terms_best():
    """Every pair of forms of both terms is tried, with errors that are taken as independent."""
    spec = "0.5*oren-nayar+0.5*ggx:roughness=0.5"
    probe = light(4, 8)
    (choice,) = shrm.choose(probe, spec)
    asked = Request("principal", parse_spec(spec), error=policy.LEAST_ERROR, max_size=LIMIT)
    proposals = Proposals(Projection(probe), asked)
    planners = proposals.planners
    base = proposals.propose()
    strengths = np.sqrt([each.whole for each in planners])
    apart = np.linalg.norm(strengths * [term.form.error for term in base.terms])
    whole = apart / base.info.predicted_error
    sizes, errors = [], []
    for planner, strength in zip(planners, strengths, strict=True):
        forms = [planner.form(c, size) for size in TRIED_SIZES for c in planner.choices]
        sizes.append(np.array([form.bytes for form in forms]))
        errors.append(strength / whole * np.array([form.total_error for form in forms]))
    both = np.hypot(errors[0][:, None], errors[1])
    together = sizes[0][:, None] + sizes[1]
    for rung in (0.2, 0.05):
        least = together[both <= rung].min()
        found = min(
            each.bytes
            for each in choice.offers
            if each.form == "principal" and each.error <= rung * 1.01
        )
        assert found <= 1.05 * least


@pytest.mark.proof
@pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")
def test_arguments_make_what_is_offered():
    probe = light(0, 5)
    (choice,) = shrm.choose(probe, "ggx:roughness=0.6")
    forms = {each.form for each in choice.offers}
    assert forms == {"principal", "shrm", "splitsum", "she", "cabral"}
    for each in choice.offers:
        needs_brdf = each.form not in ("splitsum", "she")
        if each.bytes > 10**6:
            continue
        brdf = "ggx:roughness=0.6" if needs_brdf else None
        made = shrm.prefilter(probe, brdf, **each.arguments)
        if each.form != "she":
            assert sum(plane.size * 2 for plane in made.planes()) == each.bytes
        if each.form in ("principal", "shrm"):
            assert each.error == pytest.approx(
                np.hypot(made.info.predicted_error, made.info.filter_error), rel=0.01
            )
            assert made.cube_count == each.look_ups


def test_the_truth_of_large_probes_is_near_that_of_all_pixels():
    pixels = np.random.default_rng(1).random((512, 1024, 3)).astype(np.float32) ** 8
    probe, brdf = shrm.Probe.from_array(pixels), parse_spec("ggx:roughness=0.2")
    assert 0 < Truth(probe, brdf).errors(Reference(probe, brdf))[0] < 0.012


@pytest.mark.proof
@pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")
def test_errors_are_those_beside_the_truth():
    """At other points than those of `choose`; predictions and measurements alike."""
    probe, spec = light(5, 4), "0.5*lambertian+0.5*ggx:roughness=0.6"
    rng = np.random.default_rng(1)
    mirrors, views = unit(rng, 1500), unit(rng, 1500)
    normals = (mirrors + views) / np.linalg.norm(mirrors + views, axis=1, keepdims=True)
    truth = shrm.reference(probe, spec, normals, views)
    (choice,) = shrm.choose(probe, spec)
    checked = 0
    for each in choice.offers:
        if each.bytes > 10**6:
            continue
        shown = each.make().radiance(normals, views)
        error = np.linalg.norm(shown - truth) / np.linalg.norm(truth)
        assert error == pytest.approx(each.error, rel=0.3, abs=0.003)
        wrong = np.abs((shown - truth) @ LUMINANCE) > 0.05 * (truth @ LUMINANCE)
        assert wrong.mean() == pytest.approx(each.wrong_share, abs=0.05)
        checked += 1
    assert checked >= 5


def test_diffuse_surfaces_need_nothing_but_irradiance():
    (choice,) = shrm.choose(light(6, 3), "lambertian:albedo=0.8/0.4/0.1")
    best = choice.recommended
    assert choice.is_kept
    assert best.form == "irradiance"
    assert best.bytes in (108, 300, 972)
    assert best.look_ups == 0


def test_budgets_bound_what_is_recommended():
    probe, spec = light(1, 20), "phong:exponent=100"
    (bound,) = shrm.choose(probe, [spec], budget="6kB")
    assert bound.budget == 6000
    assert bound.recommended.bytes <= 6000 < max(each.bytes for each in bound.offers)
    assert not bound.is_kept
    shares = [each.wrong_share for each in bound.offers if each.bytes <= 6000]
    assert len(shares) > 1
    assert bound.recommended.wrong_share <= 1.1 * min(shares)


@pytest.mark.parametrize(
    "wrong", [{"budget": "much"}, {"budget": 0}, {"error": 0.0}, {"seen": float("nan")}]
)
def test_what_is_no_number_is_refused(wrong):
    with pytest.raises(ArgumentError, match=next(iter(wrong))):
        shrm.choose(light(0, 1), "lambertian", **wrong)


def test_progress_never_falls():
    told = []
    brdfs = ["lambertian", "phong:exponent=8"]
    shrm.choose(light(0, 1), brdfs, progress=lambda a, b: told.append(a / b))
    assert told == sorted(told)
    assert told[-1] == 1


@pytest.mark.proof
@pytest.mark.parametrize("spec", ["ggx:roughness=0.8,anisotropy=0.5,f0=gold", "ggx:ax=0.9,ay=0.4"])
def test_brushed_materials_are_offered_taps_beside_principal_maps(spec):
    """Forms that know no tangent are not offered. Errors are those beside the truth, elsewhere."""
    probe, rng = light(0, 5), np.random.default_rng(1)
    (found,) = shrm.choose(probe, spec)
    assert not found.warnings
    assert {offer.form for offer in found.offers} == {"principal", "splitsum"}
    taps = [offer for offer in found.offers if offer.form == "splitsum"]
    assert sorted(offer.look_ups for offer in taps) == [14, 18, 24]
    brdf = parse_spec(spec)
    ax, ay = brdf.alphas
    mirrors, views = unit(rng, 1500), unit(rng, 1500)
    normals = (mirrors + views) / np.linalg.norm(mirrors + views, axis=1, keepdims=True)
    truth = shrm.reference(probe, spec, normals, views)
    stretch = ((ax - ay) / (1 - ay)) ** 0.5
    for offer in taps:
        count = (offer.look_ups - 8) // 2
        shown = BrushedSplitSum(offer.make(), ay**0.5, brdf.color("f0"), stretch, count)
        missed = shown.radiance(normals, views) - truth
        error = np.linalg.norm(missed) / np.linalg.norm(truth)
        assert offer.error == pytest.approx(error, rel=0.3, abs=0.003)
        wrong = np.abs(missed @ LUMINANCE) > 0.05 * (truth @ LUMINANCE)
        assert offer.wrong_share == pytest.approx(wrong.mean(), abs=0.05)


def test_offers_hold_no_cubes_before_they_are_made():
    """Those of all that are judged with their look-ups took hundreds of megabytes together."""

    def maps():
        gc.collect()
        return [each for each in gc.get_objects() if isinstance(each, PrincipalMap)]

    of_others = maps()
    (found,) = shrm.choose(light(0, 30), "phong:exponent=32")
    offers = [each for each in found.offers if each.form == "principal"]
    assert len(maps()) == len(of_others)
    assert offers[-1].make().cube_count == offers[-1].look_ups


def test_all_taps_share_one_chain(monkeypatch):
    made, prefilter = [], choose.prefilter_with_facts
    monkeypatch.setattr(
        choose, "prefilter_with_facts", lambda *asked: made.append(asked) or prefilter(*asked)
    )
    brdf = parse_spec("ggx:roughness=0.8,anisotropy=0.5")
    ((form, setting),) = choose.others_of(brdf, [])
    truth = Truth(light(0, 5), brdf)
    offers = choose.made_offers(form, setting, light(0, 5), brdf, truth)
    assert len(made) == 1
    assert [offer.look_ups for offer in offers] == [14, 18, 24]
    assert len({offer.error for offer in offers}) == 3


@pytest.mark.proof
def test_surfaces_brushed_along_the_tangent_alone_have_no_taps():
    (found,) = shrm.choose(light(0, 5), "ggx:ax=0.4,ay=0.9")
    assert {offer.form for offer in found.offers} == {"principal"}


@pytest.fixture
def sun():
    """Clouds with a sun of one pixel, on 64 rows."""
    rng = np.random.default_rng(1)
    pixels = np.kron(rng.random((8, 16, 3)), np.ones((8, 8, 1)))
    pixels[20, 40] = 3000
    return shrm.Probe.from_array(pixels.astype(np.float32), layout="latlong")


def test_maps_beside_lamps_are_those_of_auto(sun):
    """No map of this sun is right in few bytes, and one with a disc beside it is."""
    (found,) = shrm.choose(sun, "lambertian", budget=100)
    assert not found.is_kept
    assert found.recommended is None
    assert found.lamps == 1
    glossy = "phong:exponent=100"
    (found,) = shrm.choose(sun, glossy, budget="10kB")
    made, best = shrm.prefilter(sun, glossy, max_size=10_000), found.recommended
    assert found.is_kept
    assert best.arguments == {"to": "auto", "max_size": 10_000}
    assert best.what == f"1 cube of {made.size}, 1 disc beside"
    assert best.multiply_adds is None
    assert not best.on_cost_front
    assert isinstance(made, LampMap)
    assert best.error == pytest.approx(made.stated_error, rel=0.01)  # and half precision
    views, normals = (unit(np.random.default_rng(seed), 50) for seed in (1, 2))
    for again in (best.make(), replace(best.make, known=None)()):
        np.testing.assert_array_equal(again.radiance(normals, views), made.radiance(normals, views))
    assert "<th>-</th>" in found._repr_html_()


def test_maps_beside_lamps_keep_the_goal_that_is_asked_for(sun):
    (found,) = shrm.choose(sun, "phong:exponent=100", budget="40kB", error=0.01, seen=0.01)
    best = found.recommended
    assert best.arguments == {"to": "auto", "error": 0.01, "seen": 0.01, "max_size": 40_000}
    assert found.is_kept
    assert best.error <= 0.01
    assert best.wrong_share <= 0.01


@pytest.mark.proof
def test_lamps_lie_beside_where_they_make_a_large_map_small(sun):
    (found,) = shrm.choose(sun, "ggx:roughness=0.3")
    assert found.is_kept
    assert found.lamps == 1
    assert found.recommended.bytes < policy.LARGE
    assert found.recommended.arguments == {"to": "auto"}
    assert isinstance(found.recommended.make(), LampMap)
    others = [each for each in found.offers if each.keeps(Goal()) and each.multiply_adds]
    assert min(each.bytes for each in others) > policy.LARGE


def test_small_maps_with_the_lamps_in_them_need_none_beside(sun):
    (found,) = shrm.choose(sun, "phong:exponent=100")
    assert found.is_kept
    assert found.recommended.bytes <= policy.LARGE
    assert all(each.multiply_adds is not None for each in found.offers)


@pytest.mark.parametrize("large", [policy.LARGE, 10_000])
def test_lamps_lie_beside_a_map_as_by_default(sun, monkeypatch, large):
    """A map of 21 kB keeps the goal, which is large where 10 kB are."""
    monkeypatch.setattr(policy, "LARGE", large)
    (found,) = shrm.choose(sun, "phong:exponent=100")
    made = shrm.prefilter(sun, "phong:exponent=100")
    assert isinstance(made, LampMap) == (found.recommended.multiply_adds is None)


def worst_side(shown):
    """The largest share of negative pixels of a sphere, seen from 300 sides."""
    rng = np.random.default_rng(4)
    mirrors, shares = unit(rng, 1000), []
    for view in unit(rng, 300):
        normals = mirrors + view
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        views = np.broadcast_to(view, normals.shape)
        shares.append(np.mean(shown.radiance(normals, views) @ LUMINANCE < 0))
    return max(shares)


@pytest.mark.parametrize("has_lamps", [True, pytest.param(False, marks=pytest.mark.proof)])
def test_what_is_black_beside_a_lamp_is_not_recommended(monkeypatch, has_lamps):
    """From one side of a sphere, that is, where what auto makes has a lamp beside it, or not."""
    if not has_lamps:
        monkeypatch.setattr(beside, "split_lamps", lambda probe, **_: split_lamps(probe, count=0))
    pixels = np.ones((32, 64, 3), np.float32)
    pixels[8, 20] = 1000 if has_lamps else 300
    probe = shrm.Probe.from_array(pixels)
    (found,) = shrm.choose(probe, "microfacet")
    made, best = shrm.prefilter(probe, "microfacet"), found.recommended
    assert found.is_kept
    assert best.form == made.representation
    assert best.look_ups == made.cube_count
    assert isinstance(made, LampMap) == has_lamps == (best.multiply_adds is None)
    spotted = [each for each in found.offers if each.has_spots]
    assert spotted
    assert all(worst_side(each.make()) > 0.004 for each in spotted)
    assert worst_side(best.make()) < 0.006
    assert best not in spotted
    named = {(each.form, each.look_ups, each.bytes) for each in found.offers}
    assert len(named) == len(found.offers)


def test_split_sums_of_other_brdfs_are_offered():
    probe, spec = light(0, 5), "disney-diffuse:roughness=0.7"
    (choice,) = shrm.choose(probe, spec)
    offers = [each for each in choice.offers if each.form == "splitsum"]
    assert any(each.what.startswith("8 levels") for each in offers)
    rng = np.random.default_rng(1)
    mirrors, views = unit(rng, 1500), unit(rng, 1500)
    normals = (mirrors + views) / np.linalg.norm(mirrors + views, axis=1, keepdims=True)
    truth = shrm.reference(probe, spec, normals, views)
    for each in offers:
        made = shrm.prefilter(probe, **each.arguments)
        missed = made.shaded(0.7).radiance(normals, views) - truth
        assert np.linalg.norm(missed) / np.linalg.norm(truth) == pytest.approx(each.error, rel=0.3)
    for without in ("ward:ax=0.2,ay=0.4", "phong", "0.5*charlie+0.5*lambertian"):
        assert "splitsum" not in {form for form, _ in choose.others_of(parse_spec(without), [])}
