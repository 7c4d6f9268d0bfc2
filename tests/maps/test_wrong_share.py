"""The predicted share of wrong pixels: against brute force, and when there is none."""

import warnings

import numpy as np
import pytest
from scipy.special import eval_legendre, sph_harm_y

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import ShrmWarning
from shrm_cli.maps import lobes_lit
from shrm_cli.maps.expansion import _sampled as sampled_lobes
from shrm_cli.maps.lamps.map import LampMap
from shrm_cli.maps.lobes_lit import Lobes, judged, keeping_light, lit, reflected
from shrm_cli.maps.sphere_pixels import pixels, sample_views
from shrm_cli.maps.wrong_pixels import (
    LampsBeside,
    LampsLit,
    _drawn,
    beside_lamps,
    share_of_points,
    wrong_share,
)
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.lighting import Lighting
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import Reference
from shrm_cli.render.seen import seen_errors
from shrm_cli.sphere.cube import bilinear_filtering
from shrm_cli.sphere.directions import from_angles
from tests import brute_force, oracles
from tests.brdf.caches import new_cache
from tests.cli.helpers import polynomial_light

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
MATERIALS = (
    "microfacet:sigma=0.2", "microfacet:sigma=0.5", "ggx:roughness=0.3,f0=gold",
    "ggx:roughness=0.5", "ggx:roughness=0.2,f0=0.04", "phong:exponent=64", "lafortune:fit=skin",
    "cook-torrance", "ward:ax=0.2,ay=0.2", "oren-nayar", "charlie", "coated",
    "0.5*lambertian+0.5*ggx:roughness=0.4",
)  # fmt: skip
MICROFACET = brute_force.microfacet(0.3)
POINTS = 1500
SUM = "0.7*lambertian+0.1*microfacet:sigma=0.3"
LACQUER = "0.7*lambertian+0.3*phong:exponent=20"


def test_a_lamp_in_a_mirror_hardly_rings_and_is_hardly_blurred():
    """Its light to degree 96, whose last degrees tell 2 degrees apart."""
    lamp, order = np.array([0.48, 0.6, -0.64]), 96
    mirror = np.sqrt((2 * np.arange(order + 1) + 1) / (4 * np.pi))[None, :, None, None]
    lobes = Lobes(mirror, np.zeros_like(mirror))
    at = judged([lobes])
    light = oracles.real_harmonics(order, lamp[None])[0]
    shown = reflected(lobes, np.repeat(light[:, None], 3, axis=1), at)[:, 0, 0]
    apart = np.degrees(np.arccos(at.rings.frames[:, :, 2] @ lamp))
    assert np.abs(shown[apart > 25]).max() < 0.06 * shown.mean()
    assert apart[shown > shown.max() / 2].max() < 3.5


def matte(reflection, view, light):
    normal = (reflection + view) / np.linalg.norm(reflection + view)
    return np.maximum(light @ normal, 0) / np.pi


def of_sum(*directions):
    return 0.7 * matte(*directions) + 0.1 * MICROFACET(*directions)


def of_lacquer(*directions):
    return 0.7 * matte(*directions) + 0.3 * brute_force.phong(20)(*directions)


@pytest.fixture(scope="module")
def light():
    """A coloured gradient with a bright lamp of a few pixels, 64 x 32."""
    pixels = polynomial_light(oracles.latlong_pixels(64, 32))
    pixels[8:10, 20:22] = [1200, 800, 400]
    return pixels.astype(np.float32)


def share(pixels, rho_hat, made):
    """Count the wrong pixels of spheres seen from all sides on a GPU, drawn at random."""
    rng = np.random.default_rng(11)
    mirrored, views = brute_force.unit(rng, POINTS), brute_force.unit(rng, POINTS)
    normals = mirrored + views
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    directions, weights = brute_force.latlong_samples(len(pixels))
    radiance = pixels.reshape(-1, 3) @ LUMINANCE
    pairs = zip(mirrored, views, strict=True)
    lit = (brute_force.reflected(rho_hat, *each, directions, weights, radiance) for each in pairs)
    truth = np.array(list(lit))
    with bilinear_filtering():
        shown = made.radiance(normals, views) @ LUMINANCE
    return np.mean(np.abs(shown - truth) > 0.05 * np.maximum(truth, 0.02 * truth.mean()))


@pytest.mark.parametrize(("to", "spec", "rho_hat", "given", "range_"), [
    ("shrm", "microfacet:sigma=0.3", MICROFACET, {}, (0.1, 0.5)),
    ("shrm", "microfacet:sigma=0.3", MICROFACET, {"order_f": 5, "order_p": 2}, (0.4, 0.9)),
    ("shrm", "microfacet:sigma=0.3", MICROFACET, {"order_p": 4}, (0.02, 0.3)),
    ("shrm", "phong:exponent=20", brute_force.phong(20), {"order_f": 10}, (0.2, 0.9)),
    ("shrm", "phong:exponent=20", brute_force.phong(20), {"size": 8}, (0.04, 0.2)),
    ("principal", "microfacet:sigma=0.3", MICROFACET, {"maps": 3}, (0.1, 0.9)),
    ("shrm", "microfacet:sigma=0.3", MICROFACET, {"compress": 3}, (0.1, 1.0)),
    ("cabral", "microfacet:sigma=0.3", MICROFACET, {}, (0.1, 1.0)),
    ("kautz-mccool", "microfacet:sigma=0.3", MICROFACET, {}, (0.1, 1.0)),
    ("shrm", SUM, of_sum, {"split": True, "eps": 0.2}, (0.1, 0.9)),
    ("shrm", SUM, of_sum, {"split": True, "eps": 0.2, "compress": 2}, (0.1, 0.9)),
    ("principal", SUM, of_sum, {"maps": 3}, (0.02, 0.9)),
    ("principal", "phong:exponent=20", brute_force.phong(20), {"maps": 1, "size": 8}, (0.03, 0.2)),
    ("principal", LACQUER, of_lacquer, {"maps": 2, "size": 8}, (0.0, 0.2)),
])  # fmt: skip
def test_it_is_what_brute_force_counts(light, to, spec, rho_hat, given, range_):
    made = prefilter_with_facts(Probe.from_array(light), to, {"brdf": spec, **given})
    expected = share(light, rho_hat, made.map)
    assert range_[0] < expected < range_[1]
    # Of cubes of 8 texels only look-ups are wrong.
    # A share of 1500 points is uncertain by up to 0.013, and the prediction's own points add to it.
    assert made.summary()["predicted_wrong_share"] == pytest.approx(expected, rel=0.1, abs=0.03)


@pytest.mark.proof
def test_high_degrees_of_a_broad_lobe_with_a_peak_are_no_noise():
    """A coat of roughness .1 over matte paint, seen along the normal, where its lobe is zonal."""
    brdf, degrees = parse_spec("coated"), np.array([0, 50, 380, 450, 500])
    x, weights = np.polynomial.legendre.leggauss(4000)
    theta = np.pi / 2 * ((x + 1) / 2) ** 3
    weights = weights * 3 * np.pi / 4 * ((x + 1) / 2) ** 2 * np.sin(theta)
    lights = from_angles(theta, 0.0)
    samples = brdf.evaluate(lights, np.array([0.0, 0.0, 1.0]))[:, 0] * np.cos(theta)
    zonal = eval_legendre(degrees[:, None], np.cos(theta)) @ (weights * samples)
    expected = 2 * np.pi * np.sqrt((2 * degrees + 1) * np.pi) * zonal
    found = sampled_lobes(brdf, 512, 6, np.zeros(1), 5e-4)[0, degrees, 0, 0]
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_probes_of_nearly_the_same_order_share_lobes(tmp_path, monkeypatch):
    folder, brdf = new_cache(tmp_path, monkeypatch), parse_spec("phong")
    angles, _ = sample_views("reflection")
    first, second = (sampled_lobes(brdf, order, 6, angles, 0.01) for order in (22, 19))
    assert first.shape[1:3] == (23, len(angles))
    np.testing.assert_array_equal(second, first[:, :20])
    assert len(list(folder.iterdir())) == 1
    sampled_lobes(brdf, 25, 6, angles, 0.01)
    assert len(list(folder.iterdir())) == 2


def test_lobes_that_are_complete_leave_nothing_wrong(light):
    made = prefilter_with_facts(Probe.from_array(light), "shrm", {"brdf": "phong:exponent=20"})
    assert made.summary()["predicted_wrong_share"] == 0


def test_nothing_is_said_in_the_angular_domain(light):
    given = {"brdf": "microfacet", "domain": "angular", "size": 8}
    made = prefilter_with_facts(Probe.from_array(light), "cabral", given)
    assert made.summary()["predicted_wrong_share"] is None


def test_lobes_about_one_direction_are_added_before_they_are_judged():
    """What one term leaves out of degree 1, the other has too much of."""
    lighting = Lighting(np.array([[1.0] * 3, [0.0] * 3, [0.5] * 3, [0.0] * 3]), np.full(3, 1.25))
    whole = np.ones((1, 2, 1, 1))
    error = np.zeros_like(whole)
    error[:, 1] = 0.5
    assert wrong_share(lighting, [Lobes(whole, error)]) > 0.5
    assert wrong_share(lighting, [Lobes(whole, error), Lobes(whole, -error)]) == 0


@pytest.mark.parametrize("center", ["reflection", "normal"])
def test_lobes_of_two_centers_reflect_at_the_same_points(center):
    """The BRDF (L.V)^2 is the same whichever direction its lobes are about."""
    angles = {each: sample_views(each)[0] for each in ("reflection", "normal")}
    other = {"reflection": "normal", "normal": "reflection"}[center]
    first, second = (squared_cosine(each, angles[each]) for each in (center, other))
    light = np.random.default_rng(3).normal(size=(9, 3))
    whole, _ = lit(light, [first])
    both, error = lit(light, [first, second])
    np.testing.assert_allclose(both, 2 * whole, atol=1e-12)
    np.testing.assert_allclose(error, whole, atol=1e-12)


def test_points_are_where_the_light_is_reflected():
    """(L.V)^2 reflects towards V what the light has of degree 0 and 2 there, times constants."""
    light = np.random.default_rng(4).normal(size=(9, 3))
    angles = sample_views("reflection")[0]
    found, _ = lit(light, [squared_cosine("reflection", angles)])
    views = pixels("reflection").views
    harmonics = oracles.real_harmonics(2, views.reshape(-1, 3))
    by_degree = [harmonics[:, part] @ light[part].sum(axis=1) for part in (slice(1), slice(4, 9))]
    # The integral of (L.V)^2 = 1/3 + 2/3 P_2 times a harmonic, by the theorem of Funk and Hecke.
    exact = 4 * np.pi * (by_degree[0] / 3 + 2 / 3 * by_degree[1] / 5)
    # The light about central directions is known in single precision.
    np.testing.assert_allclose(found.ravel(), exact, rtol=0, atol=1e-6)


def test_light_of_many_degrees_is_known_about_every_direction():
    """Lobes that show the light at the view itself: all of their degrees and azimuthal orders."""
    order, some = 45, (slice(None, None, 7), slice(None, None, 5), slice(None, None, 2))
    light = np.random.default_rng(6).normal(size=((order + 1) ** 2, 3))
    theta_o = sample_views("reflection")[0]
    at_views = oracles.real_harmonics(order, from_angles(theta_o, np.zeros(len(theta_o))))
    whole = np.zeros((order + 1, order + 1, len(theta_o), 1))
    for degree, q in zip(*np.tril_indices(order + 1), strict=True):
        whole[q, degree, :, 0] = at_views[:, degree * (degree + 1) + q] / np.sqrt(2 if q else 1)
    found, _ = lit(light, [Lobes(whole, np.zeros_like(whole))])
    views = pixels("reflection").views[some]
    exact = oracles.real_harmonics(order, views.reshape(-1, 3)) @ light.sum(axis=1)
    np.testing.assert_allclose(found[some].ravel(), exact, rtol=0, atol=1e-6 * np.ptp(exact))


def test_light_of_the_most_degrees_is_kept_at_the_most_points(monkeypatch):
    """It takes a second. What a map shows, and what it misses, are both reflections of it."""
    made = []

    def make(light, order, orders, rings):
        made.append(orders)
        waves = rings.count * rings.around
        return np.zeros((2, len(orders), (order + 1) * light.shape[1], waves), np.float32)

    monkeypatch.setattr(lobes_lit, "_make_local_light", make)
    lobes = Lobes(np.ones((7, 513, 24, 3)), np.zeros((7, 513, 24, 3)))
    at = judged([lobes], is_dense=True)
    with keeping_light():
        for each in (lobes, Lobes(lobes.whole / 2, lobes.error)):
            lit(np.zeros((513**2, 3)), [each], at)
    assert made == [range(7)]


def test_unknown_azimuthal_orders_are_an_error():
    """As much of the light as they have is wrong, mostly from views where lobes have the last."""
    rng = np.random.default_rng(5)
    theta_o, shares = sample_views("reflection")
    degree, q = np.arange(33)[:, None], np.arange(7)[:, None, None]
    whole = (np.exp(-degree / 8) * (0.1 + theta_o / 5) ** q)[..., None] * (degree >= q)[..., None]
    power = rng.uniform(0.5, 1.5, (33, 3))
    signs = np.array([1, 2, 2, 2, 2, 2, 2])

    def energy(lobes):
        return np.einsum("q,l,qlvc->v", signs, power.sum(axis=1), lobes**2)

    beyond, known = np.zeros(35), energy(whole) @ shares
    for before in (0 * whole, 0.1 * whole):
        ended = Lobes(whole, before).ended(beyond, power, 0.01)
        np.testing.assert_array_equal(ended.whole, whole)
        more = energy(ended.error) - energy(before)
        assert more @ shares == pytest.approx(0.01 * known, rel=1e-9)
        assert np.all(np.diff(more) > 0)
        np.testing.assert_array_equal(Lobes(whole, before).ended(beyond, power).error, before)


@pytest.mark.parametrize(("known", "fades"), [(33, True), (34, True), (35, False), (64, False)])
def test_lobes_fade_out_where_the_light_goes_on_beyond_them(known, fades):
    """What is cut off at the last known degree rings, and not where nothing more is visible."""
    whole = np.ones((1, 33, 24, 1))
    ended = Lobes(whole, whole / 2).ended(np.zeros(known), np.ones((64, 3)))
    np.testing.assert_array_equal(ended.error, ended.whole / 2)
    np.testing.assert_array_equal(ended.whole[:, :25], 1)
    assert (ended.whole[0, -1, 0, 0] < 0.05) == fades
    assert np.all(np.diff(ended.whole[0, 24:, 0, 0]) < 0) == fades


def test_degrees_without_the_last_azimuthal_orders_have_none_that_are_unknown():
    """Of smooth light few degrees are seen, and all orders of these are known."""
    whole, beyond = np.zeros((7, 6, 24, 1)), np.zeros(8)
    whole[:5, :5] = 1
    ended = Lobes(whole, 0.1 * whole).ended(beyond, np.ones((6, 3)), 0.01)
    np.testing.assert_array_equal(ended.error, 0.1 * whole)


def test_the_dark_half_of_a_ball_under_a_bare_sun_counts():
    """Of degrees that no cube of its size holds, which are known all the same."""
    sun = np.full((128, 256, 3), 0.01, np.float32)
    sun[32, 140] = 6e4

    def cosine_lobe(reflection, view, light):
        normal = (reflection + view) / np.linalg.norm(reflection + view)
        return np.maximum(light @ normal, 0) / np.pi

    made = prefilter_with_facts(Probe.from_array(sun), "shrm", {"brdf": "lambertian"})
    expected = share(sun, cosine_lobe, made.map)
    assert expected > 0.05
    assert made.summary()["predicted_wrong_share"] == pytest.approx(expected, rel=0.4)


def test_maps_beside_lamps_are_judged_together_with_them(light):
    made = prefilter_with_facts(
        Probe.from_array(light), "auto", {"brdf": "microfacet:sigma=0.3", "max_size": "15kB"}
    )
    assert isinstance(made.map, LampMap)
    expected = share(light, MICROFACET, made.map)
    assert 0.03 < expected < 0.1
    assert made.summary()["predicted_wrong_share"] == pytest.approx(expected, abs=0.015)


def test_lamps_beside_a_map_hide_its_errors_and_have_their_own():
    lighting = Lighting(np.array([[1.0] * 3, [0.0] * 3, [0.5] * 3, [0.0] * 3]), np.full(3, 1.25))
    whole = np.ones((1, 2, 1, 1))
    lobes = Lobes(whole, 0.5 * whole * [[[0]], [[1]]])

    own = np.pad(whole, ((0, 0), (0, 98), (0, 0), (0, 0)))  # what is wrong fades out over these
    own = Lobes(own, np.zeros_like(own))

    def beside(wrong, light, map_lobes=lobes):
        with beside_lamps(LampsBeside(LampsLit(np.zeros(3), light), wrong, own)):
            return wrong_share(lighting, [map_lobes])

    def none(normals, tangents, views):
        return np.zeros(normals.shape)

    def above(normals, tangents, views):
        """Much light on the half of the pixels that is seen from above."""
        return 1e3 * (views[..., 2:] > 0) * np.ones(3)

    nothing, alone = np.zeros((4, 3)), wrong_share(lighting, [lobes])
    assert beside(nothing, none) == pytest.approx(alone, abs=0.01)
    assert beside(nothing, above) == pytest.approx(alone / 2, abs=0.02)
    # What the map has too little of degree 1, its lamps have too much.
    wrong = -0.5 * lighting.coefficients * [[0], [1], [1], [1]]
    assert beside(wrong, none) == 0
    # A map of degree 0 misses nothing of its own, and tells nothing of degree 1.
    even = Lobes(np.ones((1, 1, 1, 1)), np.zeros((1, 1, 1, 1)))
    assert beside(nothing, none, even) == 0
    assert beside(wrong, none, even) == pytest.approx(alone, abs=0.1)


@pytest.mark.parametrize("azimuth", [2, 3])
def test_all_normals_of_brushed_spheres_count_beside_lamps(azimuth):
    """Where tangents are horizontal, one azimuth of a view has few normals, which may be wrong."""
    lobes = [Lobes(np.ones((1, 1, 48, 1), complex), np.zeros((1, 1, 48, 1)))]
    whole = np.ones(judged(lobes).views.shape[:-1])
    error = whole * (np.arange(4) == azimuth)
    lighting = Lighting(np.ones((1, 3)), np.ones(3))
    none = LampsLit(np.zeros(3), lambda normals, tangents, views: np.zeros(normals.shape))
    alone = share_of_points(lighting, lobes, whole, error)
    with beside_lamps(LampsBeside(none, np.zeros((1, 3)), lobes[0])):
        beside = share_of_points(lighting, lobes, whole, error)
    assert 0.05 < alone < 0.95
    assert beside == pytest.approx(alone, rel=1e-9)


def squared_cosine(center, angles):
    """The lobes of (L.V)^2 about a direction at angles from V, by the addition theorem."""
    values = np.zeros((3, 3, len(angles), 1))
    for degree, weight in ((0, 1 / 3), (2, 2 / 3)):
        for q in range(degree + 1):
            # (L.V)^2 = 1/3 + 2/3 P_2, and P_l(L.V) = 4 pi / (2l+1) sum of Y_lq(L)* Y_lq(V).
            # Lobes are without the sign of Condon and Shortley.
            functions = (-1) ** q * sph_harm_y(degree, q, angles, 0.0).real
            values[q, degree, :, 0] = weight * 4 * np.pi / (2 * degree + 1) * functions
    return Lobes(values, values if center == "normal" else 0 * values, center)


def test_principal_maps_do_not_bend_beside_the_horizon(light):
    """Lambert's law has few views, of which those below the horizon once took part in tables."""
    probe = Probe.from_array(light)
    made, exact = (prefilter_with_facts(probe, to, {"brdf": "lambertian"}).map
                   for to in ("principal", "shrm"))  # fmt: skip
    normal = np.array([0.6, 0.0, 0.8])
    angle = np.radians([0, 60, 75, 85, 89])[:, None]
    views = np.cos(angle) * normal + np.sin(angle) * np.array([0.0, 1.0, 0.0])
    found = made.radiance(np.broadcast_to(normal, views.shape), views)
    np.testing.assert_allclose(found, np.broadcast_to(exact.radiance(normal, normal), found.shape),
                               rtol=0.02)  # fmt: skip


@pytest.mark.parametrize(("to", "spec", "given"), [
    ("principal", "kajiya-kay:exponent=16", {"maps": 9, "size": 8}),
    ("principal", "kajiya-kay:exponent=16", {"maps": 12, "size": 16}),
    ("shrm", "kajiya-kay", {"compress": 3}),
    ("cabral", "kajiya-kay", {}),
])  # fmt: skip
def test_fibres_are_looked_up_about_their_own_direction(light, to, spec, given):
    """They were about that of others: 96 % of all pixels seemed wrong of a map that has 3 %."""
    rng, probe = np.random.default_rng(17), Probe.from_array(light)
    made = prefilter_with_facts(probe, to, {"brdf": spec, **given})
    errors = made.map.info  # of which those of look-ups or of the form are large enough to count
    assert errors.filter_error > errors.predicted_error or errors.added_error
    tangents, views, others = (brute_force.unit(rng, 2000) for _ in range(3))
    normals = np.cross(tangents, others)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = normals, tangents, views
    truth = Reference(probe, parse_spec(spec)).brushed_radiance(*points)
    with bilinear_filtering():
        measured = seen_errors(made.map.brushed_radiance(*points), truth).wrong_share
    predicted = made.further["predicted_wrong_share"]()
    assert predicted == pytest.approx(measured, rel=0.2, abs=0.01)


def test_points_for_look_ups_are_drawn_where_these_decide():
    """What they stand for is what all do, and most are where pixels are just wrong or right."""
    rng = np.random.default_rng(2)
    shares, bad = rng.random(100_000), np.exp(rng.normal(-4, 2, 100_000))
    shares /= shares.sum()
    found, stand_for = _drawn(shares, bad, 7680)
    values = np.sin(3 * bad) + shares / shares.mean()
    assert values[found] @ stand_for == pytest.approx(values @ shares, rel=0.03)
    decide = (bad > 0.34) & (bad < 2.9)
    drawn, others = decide[found].sum(), (~decide)[found].sum()
    assert drawn / others == pytest.approx(
        4 * shares[decide].sum() / shares[~decide].sum(), rel=0.1
    )


def test_look_ups_of_brushed_maps_count():
    """Without them 13.7 % are predicted."""
    spec, probe = "ggx:roughness=0.6,anisotropy=0.5", Probe.from_array(low_sun())
    made = prefilter_with_facts(probe, "principal", {"brdf": spec, "size": 8, "maps": 100})
    measured = max(brushed_shares(probe, spec, made.map, 2048))
    assert made.further["predicted_wrong_share"]() == pytest.approx(measured, rel=0.1)


@pytest.mark.proof
@pytest.mark.parametrize("spec", MATERIALS)
@pytest.mark.parametrize("name", ["courtyard", "night", "studio"])
def test_it_is_right_under_real_light(real_probes, name, spec):
    """README counts a city and an interior, too: right to a quarter, or to half a percent."""
    check_under_real_light(
        real_probes / f"{name}.exr", spec, ("shrm", {}), ("principal", {"max_size": "1MB"})
    )


@pytest.mark.proof
@pytest.mark.parametrize(("name", "spec"), [
    ("interior", "charlie"), ("studio", "charlie"), ("studio", "phong:exponent=64"),
    ("interior", "coated"),
])  # fmt: skip
def test_shrms_of_an_error_are_right_under_real_light(real_probes, name, spec):
    """Cloth of P = 30, an SHRM that loses nothing but to look-ups, and a sharp coat over paint."""
    check_under_real_light(real_probes / f"{name}.exr", spec, ("shrm", {"error": 0.05}))


def points_of_spheres(count):
    """Return normals, views and any angles, (count, 1), that are even over all pixels of spheres.

    2.7 % of 4000 random ones were wrong of `charlie` in a studio, and of more 2.1 %.
    """
    from scipy.stats import qmc  # which takes a second to load

    drawn = qmc.Sobol(5, rng=7).random(count)
    mirrored, views = (brute_force.on_sphere(drawn[:, at : at + 2]) for at in (0, 2))
    normals = mirrored + views
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, views, 2 * np.pi * drawn[:, 4:]


def check_under_real_light(path, spec, *forms):
    """Check the prediction of each form, with what is given for it, against the adaptive truth."""
    # Few pixels of cloth are wrong, and in few places.
    normals, views, _ = points_of_spheres(8192 if spec == "charlie" else 4096)
    probe = open_probe(path)
    truth = Reference(probe, parse_spec(spec)).radiance(normals, views)
    for to, given in forms:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ShrmWarning)
            made = prefilter_with_facts(probe, to, {"brdf": spec, **given})
        predicted = made.further["predicted_wrong_share"]()
        with bilinear_filtering():
            measured = seen_errors(made.map.radiance(normals, views), truth).wrong_share
        assert measured == pytest.approx(predicted, rel=0.25, abs=0.005)


def brushed_shares(probe, spec, made, count):
    """The wrong pixels of spheres that are brushed around +Y, and of any that are brushed."""
    normals, views, angle = points_of_spheres(count)
    around = np.cross([0, 1, 0], normals)
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    any_way = np.cos(angle) * around + np.sin(angle) * np.cross(normals, around)
    reference, shares = Reference(probe, parse_spec(spec)), []
    for tangents in (around, any_way):
        truth = reference.brushed_radiance(normals, tangents, views)
        with bilinear_filtering():
            shown = made.brushed_radiance(normals, tangents, views)
        shares.append(seen_errors(shown, truth))
    return [each.wrong_share for each in shares]


def low_sun():
    """A sunset: light is brightest at the horizon, where brushed streaks stand upright."""
    _, y, z = np.moveaxis(oracles.latlong_pixels(128, 64), -1, 0)
    sky = 0.05 + 0.5 * np.exp(-((y / 0.2) ** 2)) + 400 * np.exp(300 * (0.99 * z + 0.1 * y - 1))
    return np.float32(sky[..., None] * [1, 0.9, 0.8])


@pytest.mark.proof
def test_brushed_surfaces_are_judged_as_spheres_are_drawn():
    """Of them more pixels are wrong than of meshes that are brushed in all directions."""
    spec, probe = "ggx:roughness=0.5,anisotropy=0.8", Probe.from_array(low_sun())
    made = prefilter_with_facts(probe, "principal", {"brdf": spec, "max_size": "1MB"})
    spheres, meshes = brushed_shares(probe, spec, made.map, 2048)
    assert spheres > 1.3 * meshes
    assert made.summary()["predicted_wrong_share"] == pytest.approx(spheres, rel=0.15)


@pytest.mark.proof
@pytest.mark.parametrize("spec", [
    "ggx:roughness=0.4,anisotropy=0.7,f0=gold", "ggx:roughness=0.5,anisotropy=0.8,f0=0.04",
    "ward:ax=0.1,ay=0.3",
])  # fmt: skip
@pytest.mark.parametrize("name", ["night", "sunrise", "sunset"])
def test_brushed_surfaces_are_right_under_real_light(real_probes, name, spec):
    """Whichever surface is worse is told: under low suns spheres, at night meshes."""
    probe = open_probe(real_probes / f"{name}.exr")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ShrmWarning)
        made = prefilter_with_facts(probe, "principal", {"brdf": spec, "max_size": "500kB"})
    measured = max(brushed_shares(probe, spec, made.map, 8192))
    assert made.further["predicted_wrong_share"]() == pytest.approx(measured, rel=0.2, abs=0.005)


@pytest.mark.proof
def test_brushed_metal_beside_street_lamps_keeps_what_is_asked(real_probes):
    """7 % were wrong where 5 % may be: the search took what seemed best of a few points."""
    spec, probe = "ggx:roughness=0.5,anisotropy=0.8,f0=1", open_probe(real_probes / "night.exr")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ShrmWarning)
        made = prefilter_with_facts(probe, "auto", {"brdf": spec})
    assert isinstance(made.map, LampMap)
    assert max(brushed_shares(probe, spec, made.map, 8192)) < 0.055


@pytest.mark.parametrize("max_q", [0, 6, 8, 9, 15])
def test_lobes_reflect_the_same_with_more_orders_of_which_they_have_nothing(rng, max_q):
    """Azimuthal orders are computed in groups."""
    whole = rng.normal(size=(max_q + 1, 20, len(sample_views("normal")[0]), 3))
    coefficients = rng.normal(size=(400, 3))
    more = np.concatenate([whole, np.zeros((22 - len(whole), *whole.shape[1:]))])
    few, many = (lit(coefficients, [Lobes(each, each / 2, "normal")]) for each in (whole, more))
    np.testing.assert_allclose(few, many, atol=1e-5 * np.abs(many).max())


def test_grey_lobes_have_one_channel_and_reflect_the_same(rng):
    grey = np.broadcast_to(
        rng.normal(size=(4, 9, len(sample_views("normal")[0]), 1)), (4, 9, 24, 3)
    )
    coefficients = rng.normal(size=(81, 3))
    one = Lobes.of(grey, grey / 2, "normal")
    assert one.whole.shape[-1] == one.error.shape[-1] == 1
    found, expected = lit(coefficients, [one]), lit(coefficients, [Lobes(grey, grey / 2, "normal")])
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())
    assert Lobes.of(grey, grey * [1, 1, 0.999], "normal").whole.shape[-1] == 3
