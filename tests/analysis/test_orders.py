"""Energies, accuracies and pictures against integrals and sums that share no code with them."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import eval_legendre

from shrm_cli.analysis.analyze import accuracy_curve, analyze, energy_grid, order_pictures
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.reflected import energy_beyond
from shrm_cli.render.camera import Viewer
from shrm_cli.render.sheet import PAPER
from shrm_cli.render.sphere import render_sphere
from tests import brute_force, oracles

DEFAULT = (0.1, 0.03, 0.01)
CHANNELS = np.array([1.0, 0.6, 1.7])


def phong_energies(exponent, order):
    """Of each degree, and of all: integrals of (1 + s)/(2 pi) z^s with Legendre polynomials."""
    lobe = lambda z: (exponent + 1) / (2 * np.pi) * z**exponent  # noqa: E731
    total = 2 * np.pi * quad(lambda z: lobe(z) ** 2, 0, 1)[0]
    parts = [
        2 * np.pi * np.sqrt((2 * degree + 1) / (4 * np.pi))
        * quad(lambda z, degree=degree: lobe(z) * eval_legendre(degree, z), 0, 1, limit=200)[0]
        for degree in range(order + 1)
    ]  # fmt: skip
    return np.array(parts) ** 2, total


def random_light(order, rng, decay=0):
    """Coefficients of light of a known order, and the power of each degree."""
    coefficients = rng.normal(size=((order + 1) ** 2, 3)) * CHANNELS
    parts = np.split(coefficients, np.arange(1, order + 1) ** 2)
    parts = [part / (1 + degree) ** decay for degree, part in enumerate(parts)]
    return np.concatenate(parts), np.array([np.sum(part**2, axis=0) for part in parts])


def lighting_of(coefficients, order, energy=None):
    """Padded to an order."""
    padded = np.zeros(((order + 1) ** 2, 3))
    padded[: len(coefficients)] = coefficients
    return Lighting(padded, np.sum(padded**2, axis=0) if energy is None else energy)


@pytest.mark.parametrize("exponent", [8, 32])
def test_captured_energy_of_phong(exponent):
    grid = energy_grid(parse_spec(f"phong:exponent={exponent}"), DEFAULT)
    energies, total = phong_energies(exponent, 32)
    np.testing.assert_allclose(grid.captured[:, 0], np.cumsum(energies) / total, atol=1e-9)
    assert grid.captured.shape == (33, 1)
    for orders in grid.orders:
        least = np.argmax(np.cumsum(energies) / total >= 1 - orders.eps)
        assert (orders.order_f, orders.order_p) == (least, 0)


def test_captured_energy_of_lambert_follows_from_equation_4_12():
    grid = energy_grid(parse_spec("lambertian"), (0.03,))
    factors = np.array([np.pi, 2 * np.pi / 3, np.pi / 4, 0, -np.pi / 24, 0])
    energies = (2 * np.arange(6) + 1) / (4 * np.pi) * factors**2
    np.testing.assert_allclose(
        grid.captured[:6, 0], np.cumsum(energies) / (2 * np.pi / 3), atol=1e-9
    )
    assert [(each.order_f, each.order_p) for each in grid.orders] == [(2, 0)]


@pytest.mark.parametrize(("sigma", "order_f"), [(0.1, 23), (0.2, 11), (0.3, 7), (0.4, 5), (0.5, 4)])
def test_grid_holds_the_papers_orders(sigma, order_f):
    grid = energy_grid(parse_spec(f"microfacet:sigma={sigma}"), (0.03,))
    assert [(each.order_f, each.order_p) for each in grid.orders] == [(order_f, 2)]
    enough = grid.captured >= 0.97
    assert enough[order_f, 2]
    assert not enough[order_f - 1, 2]
    assert not enough[:, 1].any()


def test_grid_is_monotonic_and_stays_below_one():
    grid = energy_grid(parse_spec("microfacet:sigma=0.3"), DEFAULT)
    assert grid.captured.shape == (33, 9)
    assert (np.diff(grid.captured, axis=0) >= 0).all()
    assert (np.diff(grid.captured, axis=1) >= 0).all()
    assert 0 < grid.captured[0, 0] < 0.2
    assert 0.99 < grid.captured[-1, -1] < 1
    assert grid.coefficients.order_f >= 64


def test_grid_is_as_large_as_asked_or_needed():
    sharp = energy_grid(parse_spec("phong:exponent=512"), (0.01,))
    assert sharp.order_f == sharp.orders[0].order_f == 48
    asked = energy_grid(parse_spec("microfacet"), (0.01,), order_f=5, order_p=1)
    assert (asked.order_f, asked.order_p) == (5, 1)
    assert (asked.orders[0].order_f, asked.orders[0].order_p) == (16, 4)
    whole = energy_grid(parse_spec("microfacet"), (0.01,))
    np.testing.assert_allclose(asked.captured, whole.captured[:6, :2], atol=1e-4)
    assert energy_grid(parse_spec("phong"), (0.1,), order_p=4).order_p == 0


@pytest.mark.slow
@pytest.mark.parametrize("exponent", ["2e4", "1e5"])
def test_pictures_of_sharp_lobes_have_fewer_orders(exponent):
    """No orders meet the tolerance of the second, whose pictures had the fewest, and rings."""
    light = Probe.from_array(np.ones((8, 16, 3), np.float32), layout="latlong")
    found = analyze(f"phong:exponent={exponent}", light, tolerances=[0.1], views=[(0, 0)], size=16)
    assert found.grid.order_f > found.pictures.order_f == 128


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tolerances", "met", "told"),
    [((0.05, 0.01), [], 0.05), ((0.5, 0.01, 0.6, 0.03), [0.5, 0.6], 0.03)],
)
def test_tolerances_that_cannot_be_met_are_told(tolerances, met, told):
    """The largest of them is, and the grid has the largest orders, not those of dull surfaces."""
    grid = energy_grid(parse_spec("phong:exponent=1e5"), tolerances)
    assert [each.eps for each in grid.orders] == met
    assert f"tolerance {told:g} cannot be met" in str(grid.unmet)
    assert grid.order_p == 0
    assert grid.order_f == 512


def test_curves_of_a_zonal_brdf_are_those_of_the_formulas(rng):
    """Figure 5.5 from the sums of eq. 5.15 to 5.19, written again."""
    light, power = random_light(12, rng, decay=2)
    energy = power.sum(axis=0) * 1.02  # a part of the light has frequencies beyond all orders
    coefficients = compute_coefficients(parse_spec("phong:exponent=32"), 64, 0)
    curve = accuracy_curve(lighting_of(light, 64, energy), coefficients, 20, 0)
    assert (curve.order_p, curve.truth_order_f) == (0, 64)
    rho, rho_total = phong_energies(32, 64)
    power = np.vstack([power, np.zeros((52, 3))])
    reflected = 4 * np.pi / (2 * np.arange(65) + 1) * rho * power.sum(axis=1)
    # What of it the lobe meets is estimated.
    beyond = energy_beyond(lighting_of(light, 64, energy), coefficients)
    beyond *= rho_total / coefficients.total_energy[0]
    assert 0 < beyond < 1e-3 * reflected.sum()
    for f in range(21):
        whole, kept = reflected.sum() + beyond, reflected[: f + 1].sum()
        eps_rho = 1 - rho[: f + 1].sum() / rho_total
        eps_light = 1 - power[: f + 1].sum() / energy.sum()
        light_left = energy - power[: f + 1].sum(axis=0)
        residual = 4 * np.pi / (2 * f + 3) * light_left.sum() * eps_rho * rho_total
        assert curve.accuracy[f] == pytest.approx(kept / whole, abs=1e-9)
        assert curve.estimate_brdf[f] == pytest.approx(1 - eps_rho, abs=1e-9)
        assert curve.estimate_minimum[f] == pytest.approx(1 - min(eps_rho, eps_light), abs=1e-9)
        assert curve.estimate_bound[f] == pytest.approx(1 - residual / (kept + residual), abs=1e-6)
    # Both sides of the minimum are met.
    assert curve.estimate_minimum[3] > curve.estimate_brdf[3] + 0.01
    assert curve.estimate_minimum[20] == curve.estimate_brdf[20]


@pytest.mark.parametrize(("order_f", "order_p"), [(3, 1), (6, 2)])
def test_accuracy_is_that_of_brute_force(rng, order_f, order_p):
    """Band-limited light, a BRDF that depends on the view, and the map of these orders."""
    light, _ = random_light(6, rng)
    coefficients = compute_coefficients(parse_spec("microfacet:sigma=.4"), 32, 12)
    curve = accuracy_curve(lighting_of(light, 32), coefficients, order_f, order_p)
    made = Shrm.from_coefficients(
        light, coefficients.truncated(order_f, order_p), "reflection", MapInfo(0, 0, 0, 0, 0), 64
    )
    directions, weights = brute_force.sphere_rule(120)
    radiance = oracles.real_harmonics(6, directions) @ light
    formula = brute_force.microfacet(0.4)
    reflections, views = brute_force.unit(rng, 800), brute_force.unit(rng, 800)
    truth = np.array(
        [
            brute_force.reflected(formula, r, v, directions, weights, radiance)
            for r, v in zip(reflections, views, strict=True)
        ]
    )
    normals = reflections + views
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    missed = np.sum((made.radiance(normals, views) - truth) ** 2) / np.sum(truth**2)
    assert missed == pytest.approx(1 - curve.accuracy[order_f], rel=0.15)
    assert missed > 0.01


def test_little_light_does_not_make_up_for_a_small_p(rng):
    """Beyond its band light costs nothing, but what lies beyond P is missed."""
    light, _ = random_light(3, rng)
    coefficients = compute_coefficients(parse_spec("microfacet:sigma=.3"), 64, 8)
    lighting = lighting_of(light, 64)
    small, large = (accuracy_curve(lighting, coefficients, 10, p) for p in (1, 8))
    assert large.accuracy[3] > 0.99
    assert large.estimate_minimum[3] > large.estimate_brdf[3] + 0.1
    assert (small.estimate_minimum[3:] <= small.accuracy[3:]).all()
    missed = 1 - coefficients.captured[-1, 1]
    assert missed > 0.03
    np.testing.assert_allclose(small.estimate_minimum[3:], 1 - missed, atol=1e-3)
    np.testing.assert_allclose(
        large.estimate_brdf - small.estimate_brdf,
        coefficients.captured[:11, 8] - coefficients.captured[:11, 1],
        atol=1e-12,
    )


@pytest.mark.parametrize(
    ("name", "spec"),
    [
        ("interior", "phong:exponent=32"),
        ("studio", "microfacet:sigma=0.2"),
        ("sunset", "lambertian"),
    ],
)
def test_estimates_are_conservative_on_real_probes(real_probes, name, spec):
    grid = energy_grid(parse_spec(spec), DEFAULT)
    lighting = project(open_probe(real_probes / f"{name}.exr"), grid.coefficients.order_f)
    curve = accuracy_curve(lighting, grid.coefficients, grid.order_f, grid.orders[-1].order_p)
    for estimate in (curve.estimate_minimum, curve.estimate_brdf, curve.estimate_bound):
        assert (estimate <= curve.accuracy + 1e-9).all()
        assert (np.diff(estimate) >= -1e-9).all()
        assert (estimate >= 0).all()
    assert (np.diff(curve.accuracy) >= -1e-12).all()
    assert (curve.estimate_minimum >= curve.estimate_brdf - 1e-12).all()
    # Section 5.5.1: "almost always equivalent simply to using the BRDF error", where that counts.
    high = curve.estimate_brdf > 0.9
    np.testing.assert_allclose(curve.estimate_minimum[high], curve.estimate_brdf[high], atol=0.01)
    for orders in grid.orders:
        if orders.order_p <= curve.order_p:
            assert curve.accuracy[orders.order_f] >= 1 - orders.eps


def test_curves_of_black_light_and_of_a_black_brdf():
    grid = energy_grid(parse_spec("phong"), DEFAULT)
    black = lighting_of(np.zeros((1, 3)), grid.coefficients.order_f)
    curve = accuracy_curve(black, grid.coefficients, 32, 0)
    for values in (curve.accuracy, curve.estimate_minimum, curve.estimate_bound):
        np.testing.assert_array_equal(values, 1)
    np.testing.assert_allclose(curve.estimate_brdf, grid.captured[:, 0])
    grid = energy_grid(parse_spec("lambertian:albedo=0"), DEFAULT)
    assert (grid.captured == 1).all()
    light = lighting_of(np.ones((1, 3)), grid.coefficients.order_f)
    curve = accuracy_curve(light, grid.coefficients, 32, 0)
    for values in (curve.accuracy, curve.estimate_minimum, curve.estimate_brdf):
        np.testing.assert_array_equal(values, 1)


def test_curve_needs_light_and_coefficients_of_its_orders():
    coefficients = compute_coefficients(parse_spec("phong"), 16, 0)
    with pytest.raises(ValueError, match="lighting of order 15"):
        accuracy_curve(lighting_of(np.ones((1, 3)), 15), coefficients, 8, 0)
    for orders in ((17, 0), (8, 1)):
        with pytest.raises(ValueError, match="more than the coefficients have"):
            accuracy_curve(lighting_of(np.ones((1, 3)), 16), coefficients, *orders)


class Integrated:
    """The true sphere: sums of a formula over a rule for the sphere."""

    def __init__(self, formula, light):
        self.formula = formula
        self.directions, self.weights = brute_force.sphere_rule(90)
        self.light = oracles.real_harmonics(4, self.directions) @ light

    def radiance(self, normals, views):
        view = np.asarray(views)
        normals = np.asarray(normals) + 1e-6 * view  # on the silhouette R + V is no direction
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        reflections = 2 * (normals @ view)[:, None] * normals - view
        return np.array(
            [
                brute_force.reflected(
                    self.formula, reflection, view, self.directions, self.weights, self.light
                )
                for reflection in reflections
            ]
        )


VIEWS = [Viewer(20, 10), Viewer(-100, -40)]


@pytest.fixture(scope="module")
def microfacet_pictures():
    light, _ = random_light(4, np.random.default_rng(5))
    coefficients = compute_coefficients(parse_spec("microfacet:sigma=.4"), 32, 8)
    truth = Integrated(brute_force.microfacet(0.4), light)
    lighting = lighting_of(light, 32)
    return coefficients, lighting, truth, order_pictures(
        lighting, coefficients, "reflection", VIEWS, 12, 16, truth
    )  # fmt: skip


@pytest.mark.slow
def test_pictures_approach_the_truth_with_p(microfacet_pictures):
    coefficients, _, truth, made = microfacet_pictures
    assert made.pictures.shape == (6, 2, 16, 16, 3)
    np.testing.assert_array_equal(made.truth[1], render_sphere(truth, VIEWS[1], 16))
    np.testing.assert_allclose(made.captured, coefficients.captured[12, :6])
    assert (np.diff(made.predicted_errors) < 0).all()
    errors = np.array([[made.error(p, view) for view in range(2)] for p in range(6)])
    assert (np.diff(errors, axis=0) < 0).all()
    assert (errors[0] > 0.1).all()
    assert (errors[5] < 0.06).all()
    # One view's error is about that of all views.
    np.testing.assert_allclose(np.log2(errors.mean(axis=1) / made.predicted_errors), 0, atol=1)


@pytest.mark.slow
def test_pictures_are_those_of_maps_of_each_p(microfacet_pictures):
    coefficients, lighting, _, made = microfacet_pictures
    for p in (0, 2, 5):
        own = Shrm.from_coefficients(
            lighting.coefficients, coefficients.truncated(12, p), "reflection",
            MapInfo(12, p, 0, 0, 0),
        )  # fmt: skip
        expected = render_sphere(own, VIEWS[0], 16)
        np.testing.assert_allclose(made.pictures[p, 0], expected, atol=2e-5 * expected.max())


def test_sheet_shows_pictures_above_unamplified_differences(microfacet_pictures):
    made = microfacet_pictures[-1]
    sheet = made.sheet(exposure=1.0)
    gap, label = 2, 20
    assert sheet.shape == (4 * (16 + label + gap) + gap, 7 * (16 + gap) + gap, 3)

    def tile(row, column):
        top, left = gap + row * (16 + label + gap), gap + column * (16 + gap)
        return sheet[top : top + 16, left : left + 16]

    for view in range(2):
        for p in range(6):
            picture = made.pictures[p, view]
            np.testing.assert_array_equal(tile(2 * view, p), 2 * picture)
            expected = 2 * np.abs(picture - made.truth[view])
            np.testing.assert_array_equal(tile(2 * view + 1, p), expected)
        np.testing.assert_array_equal(tile(2 * view, 6), 2 * made.truth[view])
        np.testing.assert_allclose(tile(2 * view + 1, 6), PAPER, rtol=1e-6)


def test_exposure_makes_bright_parts_white(microfacet_pictures):
    made = microfacet_pictures[-1]
    exposure = made.exposure()
    assert 2 * exposure == round(2 * exposure)
    brightest = made.truth.max(axis=-1)
    brightest = brightest[brightest > 0] * 2**exposure
    assert 0.02 < np.mean(brightest > 1) < 0.12


def test_zonal_pictures_have_one_p_and_are_true():
    light, _ = random_light(4, np.random.default_rng(5))
    coefficients = compute_coefficients(parse_spec("phong:exponent=8"), 32, 0)
    truth = Integrated(brute_force.phong(8), light)
    made = order_pictures(lighting_of(light, 32), coefficients, "reflection", VIEWS, 8, 16, truth)
    assert made.pictures.shape == (1, 2, 16, 16, 3)
    assert made.predicted_errors == [0]
    assert made.error(0, 0) < 0.005
    assert made.error(0, 1) < 0.005


class Black:
    def radiance(self, normals, views):
        return np.zeros_like(normals)


def test_black_light_makes_black_pictures():
    coefficients = compute_coefficients(parse_spec("microfacet"), 32, 5)
    black = lighting_of(np.zeros((1, 3)), 32)
    made = order_pictures(black, coefficients, "reflection", VIEWS, 8, 16, Black())
    assert not made.pictures.any()
    assert made.exposure() == 0
    assert made.error(3, 1) == 0
    assert np.isfinite(made.sheet(made.exposure())).all()


def test_pictures_of_too_large_maps_are_refused():
    coefficients = compute_coefficients(parse_spec("microfacet:sigma=1"), 512, 5, accuracy=1e-3)
    with pytest.raises(MapError, match="lower"):
        order_pictures(
            lighting_of(np.ones((1, 3)), 512), coefficients, "reflection", VIEWS, 512, 16, Black()
        )


def test_exact_pictures_of_each_view_move_the_bar():
    """That of the second view stood at the end of the bar, for as long as the first had taken."""
    light = np.ones((16, 32, 3), np.float32)
    light[3, 4] = 50
    told = []
    analyze(
        "microfacet:sigma=.4", light, order_f=4, order_p=1, size=16,
        views=[(0, 0), (90, 10)], progress=lambda done, total: told.append(done / total),
    )  # fmt: skip
    assert told == sorted(told)
    assert told[-1] == 1
    first, second = (sum(low < each < low + 0.25 for each in told) for low in (0.5, 0.75))
    assert first == second > 1
    assert told.count(1) <= 2
