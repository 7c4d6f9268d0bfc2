"""Prefiltering term by term: fewer coefficients, and the error that was predicted."""

import numpy as np
import OpenEXR
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.sums import parse_sum
from shrm_cli.errors import MapError
from shrm_cli.maps.explicit.prefilter import tabulate_sum
from shrm_cli.maps.file import open_map
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.make import prefilter_shrm
from shrm_cli.maps.shrm.terms import _truncation_error, plan_terms, prefilter_terms
from shrm_cli.orders import choose_center
from shrm_cli.plan import policy
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.open import open_probe
from shrm_cli.reflected import predicted_error
from tests import brute_force, oracles
from tests.cli.helpers import ROOT, polynomial_light, write_exr
from tests.maps.scenes import EXPLICIT
from tests.maps.shrm.test_predicted_error import reduced

SPEC = "0.5*lambertian:albedo=1+0.5*microfacet:sigma=0.1"


@pytest.fixture
def smooth(tmp_path):
    light = polynomial_light(oracles.latlong_pixels(64, 32)).astype(np.float32)
    return open_probe(write_exr(tmp_path / "probe.exr", light))


def brdf():
    return parse_sum(SPEC, parse_spec)


def pairs(count=1500):
    rng = np.random.default_rng(12)
    reflections, views = brute_force.unit(rng, count), brute_force.unit(rng, count)
    normals = reflections + views
    return reflections, normals / np.linalg.norm(normals, axis=1)[:, None], views


def whole_sum(probe):
    """The map of all terms, in double precision."""
    plan = plan_terms(Projection(probe), Request("shrm", brdf()))
    return prefilter_terms(plan, dtype=np.float64).map


@pytest.mark.proof
def test_fewer_coefficients_at_no_larger_error(real_probes, tmp_path):
    """Against brute force written again; predicted and measured errors agree."""
    pixels = reduced(real_probes / "interior.exr", 64).astype(np.float32)
    probe = open_probe(write_exr(tmp_path / "probe.exr", pixels))
    plan = plan_terms(Projection(probe), Request("shrm", brdf()))
    assert plan.pays
    as_terms, as_one = plan.counts
    assert as_terms < 0.8 * as_one
    split = prefilter_terms(plan).map
    whole = prefilter_shrm(Projection(probe), Request("shrm", brdf())).map
    assert split.info.predicted_error <= whole.info.predicted_error
    light, weights = brute_force.latlong_samples(len(pixels))
    radiance = pixels.reshape(-1, 3).astype(float)
    rng = np.random.default_rng(12)
    reflections, views, shares = brute_force.bright_pairs(rng, split, 8000, candidates=60)
    normals = reflections + views
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    lobe = brute_force.microfacet(0.1)

    def rho_hat(normal):
        def value(reflection, view, at):
            diffuse = np.maximum(at @ normal, 0) / np.pi
            return 0.5 * diffuse + 0.5 * lobe(reflection, view, at)

        return value

    truth = np.array(
        [
            brute_force.reflected(rho_hat(n), r, v, light, weights, radiance)
            for r, n, v in zip(reflections, normals, views, strict=True)
        ]
    )
    for made in (split, whole):
        found = made.radiance(normals, views)
        measured = np.sqrt(np.sum(shares * (found - truth) ** 2) / np.sum(shares * truth**2))
        print(f"{made.center}: predicted {made.info.predicted_error:.4f}, measured {measured:.4f}")
        assert measured == pytest.approx(made.info.predicted_error, rel=0.1)


def test_terms_end_no_sooner_than_the_whole(smooth):
    """Diffuse and Phong lobes, whose degrees are integrals of Legendre polynomials.

    What small maps carry beyond F would hide that F is too low.
    """
    spec = "0.5*lambertian:albedo=1+0.5*phong:exponent=64"
    plan = plan_terms(Projection(smooth), Request("shrm", parse_sum(spec, parse_spec)))
    light = Projection(smooth).to_order(plan.whole.coefficients.order_f)
    power = [np.sum(light.coefficients[n**2 : (n + 1) ** 2] ** 2) for n in range(60)]
    nodes, weights = np.polynomial.legendre.leggauss(400)
    legendre = np.polynomial.legendre.legvander(nodes, 59)
    above = np.maximum(nodes, 0)
    missing = strengths = 0.0
    for term, lobe in zip(plan.terms, [above / np.pi, 65 / (2 * np.pi) * above**64], strict=True):
        energies = power * (weights * lobe @ legendre) ** 2
        missing += energies[term.orders.order_f + 1 :].sum()
        strengths += np.sqrt(energies.sum())
    orders = plan.whole.orders
    allowed = predicted_error(light, plan.whole.coefficients, orders.order_f, orders.order_p)
    assert np.sqrt(missing) / strengths <= allowed


def test_terms_of_more_coefficients_stay_one_map(smooth):
    spec = "0.5*lambertian+0.5*microfacet:sigma=0.3"
    free, split = (prefilter(smooth, spec, to="shrm", split=each) for each in (None, True))
    counts = [
        [(e.info.order_f + 1) ** 2 * (e.info.order_p + 1) ** 2 for e in maps]
        for maps in ([free], split.terms)
    ]
    assert len(counts[1]) == 2
    assert counts[0][0] < sum(counts[1]) < 2 * counts[0][0]
    assert not hasattr(free, "terms")


def test_files_hold_all_terms(smooth, tmp_path):
    made = whole_sum(smooth)
    path = tmp_path / "sum.exr"
    made.save(path, "float")
    with OpenEXR.File(str(path)) as file:
        names = [part.header["name"] for part in file.parts]
        centers = [part.header["shrm:center"] for part in file.parts]
    assert names == ["term00", "term01"]
    assert centers == ["normal", "reflection"]
    again = open_map(path)
    _, normals, views = pairs(100)
    expected = made.radiance(normals, views)
    assert np.abs(again.radiance(normals, views) - expected).max() < 1e-5 * np.abs(expected).max()
    assert again.info.predicted_error == pytest.approx(made.info.predicted_error, rel=1e-6)
    assert again.info.brdf == made.info.brdf == {"name": "sum", "parameters": {"spec": SPEC}}
    assert again.cube_count == sum(term.cube_count for term in made.terms)
    one_view = again.radiance(normals, views[0])
    assert one_view == pytest.approx(again.radiance(normals, np.tile(views[0], (100, 1))), rel=1e-4)


def test_a_sum_has_no_single_shrm(smooth):
    made = whole_sum(smooth)
    with pytest.raises(MapError, match="`split=False`"):
        made.to_shrm()
    smaller = made.resampled(8, "border")
    assert {term.size for term in smaller.terms} == {8}


@pytest.mark.parametrize("sizes", [(4,), (6, 4)])
def test_a_smaller_sum_says_what_all_its_terms_lost(tmp_path, smooth, sizes):
    """Measured, also of what was made smaller, written, read and made smaller again."""
    found = whole = whole_sum(smooth)
    for size in sizes:
        found.resampled(size).save(tmp_path / "small.exr", "float")
        found = open_map(tmp_path / "small.exr")
    _, normals, views = pairs(5000)
    expected = whole.radiance(normals, views)
    lost = found.radiance(normals, views) - expected
    measured = np.sqrt(np.sum(lost**2) / np.sum(expected**2))
    assert measured > 0.001
    assert found.info.added_error == pytest.approx(measured, rel=0.15)


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize("representation", ["cabral", "kautz-mccool", "lightfield"])
def test_a_sum_as_an_explicit_map(smooth, representation):
    """Exact at the sample views; between them the error is told."""
    made = whole_sum(smooth).resampled(16, "border")
    found = tabulate_sum(EXPLICIT[representation], made, 6)
    assert found.center == "reflection"
    reflections, normals, views = pairs(800)
    expected = made.radiance(normals, views)
    error = found.radiance(normals, views) - expected
    measured = np.sqrt(np.sum(error**2) / np.sum(expected**2))
    assert measured == pytest.approx(found.info.added_error, rel=0.15)
    if representation != "kautz-mccool":
        view = found.sample_views(found.count)[5]
        at_sample = reflections + view
        at_sample /= np.linalg.norm(at_sample, axis=1)[:, None]
        expected = made.radiance(at_sample, view)
        difference = found.radiance(at_sample, view) - expected
        # The diffuse term has a cube of its own, with other texels.
        assert np.sqrt(np.sum(difference**2) / np.sum(expected**2)) < 5e-3


def test_layouts_of_sums_are_refused(smooth, tmp_path):
    made = whole_sum(smooth)
    with pytest.raises(MapError, match="cube only"):
        made.save(tmp_path / "x.exr", layout="strip")


def test_renamed_parts_are_refused(smooth, tmp_path):
    made = whole_sum(smooth)
    path = tmp_path / "sum.exr"
    made.save(path)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        parts = [
            OpenEXR.Part({**part.header, "name": f"part{k}"}, part.channels)
            for k, part in enumerate(file.parts)
        ]
        OpenEXR.File(parts).write(str(tmp_path / "other.exr"))
    with pytest.raises(MapError, match="not the terms"):
        open_map(tmp_path / "other.exr")


@pytest.mark.parametrize(
    ("spec", "center"),
    [("microfacet:sigma=0.5", "reflection"), ("oren-nayar", "normal"), ("kajiya-kay", "tangent")],
)
def test_the_centre_with_the_fewest_coefficients(spec, center):
    found, counts = choose_center(parse_spec(spec), 0.03)
    assert found.center == center
    assert counts[center] == min(counts.values())


def test_kajiya_kay_needs_no_azimuth(smooth):
    """s = 32: P = 8, and q = 0 only."""
    light, hair = Projection(smooth), parse_spec("kajiya-kay:exponent=32")
    made = prefilter_shrm(light, Request("shrm", hair, frame="local"), dtype=np.float64)
    assert made.map.info.order_p == 8
    assert made.map.azimuth_free
    assert made.map.cube_count == 9
    # The way without the azimuth gives what the general one gives.
    general = prefilter_shrm(light, Request("shrm", hair), dtype=np.float64).map.to_frame("local")
    difference = np.abs(made.map.coefficients - general.coefficients).max()
    assert difference < 1e-9 * np.abs(general.coefficients).max()


@pytest.mark.parametrize(
    ("name", "eps", "tolerance"),
    [
        ("furnace", 0.005, 64 * 0.005),
        ("furnace", 0.03, 0.7),
        ("studio", 0.03, 0.5 * 0.03),
    ],
)
def test_the_tolerances_that_are_tried_for_terms(name, eps, tolerance):
    """Constant light has no error, so that the loosest is taken. A studio shows what lobes miss."""
    light = Projection(open_probe(ROOT / "probes" / f"{name}.exr"))
    spec = "0.5*phong:exponent=8+0.5*phong:exponent=40"
    plan = plan_terms(light, Request("shrm", brdf=parse_sum(spec, parse_spec), eps=eps))
    for term in plan.terms:
        assert term.orders.eps == pytest.approx(tolerance)
    error = _truncation_error(plan.terms, light.to_order(32))
    assert error < policy.NO_ERROR if name == "furnace" else error > 1000 * policy.NO_ERROR
