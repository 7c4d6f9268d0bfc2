"""Predicted errors against sums written again, closed forms and brute force."""

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients, compute_transfer
from shrm_cli.maps.coupling import bundle_coefficients
from shrm_cli.orders import choose_orders
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.probe import Probe
from shrm_cli.reflected import (
    cube_energies,
    energies_beyond,
    energy_beyond,
    error_bound,
    filter_matrices,
    filtered_parts,
    last_visible,
    predicted_error,
    visible_beyond,
    visible_beyond_p,
    weighted_power,
)
from shrm_cli.sphere.harmonics import degrees


def lit(power, energy=None):
    """Light with a given power in each degree, shape (n, 3), all of it in m = 0."""
    power = np.asarray(power, dtype=float)
    coefficients = np.zeros((len(power) ** 2, 3))
    degree = np.arange(len(power))
    coefficients[degree * (degree + 1)] = np.sqrt(power)
    return Lighting(coefficients, power.sum(axis=0) if energy is None else energy)


def lamp(order):
    """A lamp that is a point: every degree has the power 2l + 1."""
    power = np.repeat(2.0 * np.arange(order + 1)[:, None] + 1, 3, axis=1)
    return lit(power, np.full(3, 1e12))


def test_predicted_error_is_exact_where_everything_is_known():
    """One degree of light: the error is the missing part of that degree alone."""
    coefficients = compute_coefficients(parse_spec("phong:exponent=8"), 32, 0)
    power = np.zeros((33, 3))
    power[3] = 2.0
    assert predicted_error(lit(power), coefficients, 3, 0) == 0
    assert predicted_error(lit(power), coefficients, 2, 0) == pytest.approx(1)
    power[5] = 1.0
    squares = coefficients.values[:, 0, 0, 0] ** 2 / (2 * np.arange(33) + 1)
    expected = np.sqrt(squares[5] / (2 * squares[3] + squares[5]))
    assert predicted_error(lit(power), coefficients, 4, 0) == pytest.approx(expected)
    factors = np.array([1, 1, 1, 0.75, 0.5, 0.25])
    errors = np.array([2 * squares[3] * 0.25**2, squares[5] * 0.75**2])
    expected = np.sqrt(errors.sum() / (2 * squares[3] + squares[5]))
    found = predicted_error(lit(power), coefficients, 5, 0, factors[:, None])
    assert found == pytest.approx(expected)


@pytest.mark.parametrize("spec", ["microfacet:sigma=0.2", "phong:exponent=50", "lambertian"])
@pytest.mark.parametrize("seed", [0, 1])
def test_bound_is_conservative(spec, seed):
    rng = np.random.default_rng(seed)
    orders, coefficients = choose_orders(parse_spec(spec), 0.05)
    power = (
        rng.random((coefficients.order_f + 1, 3))
        * np.exp(-rng.random() * np.arange(coefficients.order_f + 1))[:, None]
    )
    light = lit(power, power.sum(axis=0) * 1.3)
    for f in (0, 1, orders.order_f):
        predicted = predicted_error(light, coefficients, f, orders.order_p)
        bound = error_bound(light, coefficients, f, orders.order_p)
        assert predicted <= bound * (1 + 1e-9)
        assert bound <= 1


def test_black_light_has_no_error():
    coefficients = compute_coefficients(parse_spec("microfacet"), 32, 8)
    black = lit(np.zeros((33, 3)))
    assert predicted_error(black, coefficients, 4, 2) == 0
    assert error_bound(black, coefficients, 4, 2) == 0
    assert last_visible(visible_beyond(black, coefficients, 2)) == 0


@pytest.mark.parametrize(("spec", "order"), [("phong:exponent=512", 52), ("phong:exponent=64", 16)])
def test_what_lies_beyond_the_coefficients_counts(spec, order):
    """A lamp lights all degrees, and a sharp lobe has energy in all of them."""
    brdf = parse_spec(spec)
    known = compute_coefficients(brdf, order, 0)
    whole = compute_coefficients(brdf, 400, 0)
    squares = whole.degree_energy.sum(axis=1)  # for a lamp, (2l + 1) cancels Lambda_l^2
    expected = np.sqrt(squares[order + 1 :].sum() / squares.sum())
    assert expected > 0.03
    found = predicted_error(lamp(order), known, order, 0)
    assert found == pytest.approx(expected, rel=1e-3)


def test_energy_beyond_is_never_more_than_the_light_has():
    """Light that ends at the known degrees reflects nothing beyond them."""
    known = compute_coefficients(parse_spec("phong:exponent=512"), 20, 0)
    power = np.ones((21, 3))
    assert energy_beyond(lit(power), known) == 0
    assert energy_beyond(lit(power, power.sum(axis=0) + 1e-3), known) > 0


@pytest.mark.parametrize(
    ("spec", "order"),
    [("phong:exponent=100", 12), ("ggx:roughness=0.6", 32), ("microfacet:sigma=0.3", 24)],
)
@pytest.mark.parametrize("extent", [0.5, 1, 2])
def test_light_that_ends_is_met_by_few_of_the_unknown_degrees(spec, order, extent):
    """The power of a blurred lamp falls from degrees on that are known, or are not."""
    brdf = parse_spec(spec)
    max_q = 0 if brdf.zonal else 12
    known, whole = (compute_transfer(brdf, f, max_q, 1e-4) for f in (order, 4 * order))
    degree = np.arange(4 * order + 1.0)[:, None]
    power = np.repeat((2 * degree + 1) * np.exp(-((degree / (extent * order)) ** 2)), 3, axis=1)
    light = (4 * np.pi / (2 * degree + 1)) * power
    expected = np.sum((light * whole.degree_energy)[order + 1 :])
    found, _ = energies_beyond(lit(power[: order + 1], power.sum(axis=0)), known)
    assert expected > 0
    assert 0.8 < np.sqrt(found / expected) < 1.45


@pytest.mark.parametrize(("rows", "exponent"), [(8, 4096), (32, 4096), (16, 16384)])
def test_light_that_is_finer_than_pixels_is_missed_by_maps(rng, rows, exponent):
    """Edges of pixels go on beyond the degrees of 128 rows, into which they are cut for a map."""
    image = rng.gamma(0.3, size=(rows, 2 * rows, 3))
    known, truth = (
        project(Probe.from_array(image.repeat(times, 0).repeat(times, 1)), 400)
        for times in (128 // rows, 512 // rows)
    )
    lobe = compute_coefficients(parse_spec(f"phong:exponent={exponent}"), 400, 0)
    by_degree = np.sum(weighted_power(truth, 400) * lobe.degree_energy, axis=1)
    expected = np.sqrt(by_degree[128:].sum() / by_degree.sum())
    assert 0.75 * expected < predicted_error(known, lobe, 400, 0) < 1.4 * expected


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize("spec", ["ggx:roughness=0.5", "ggx:roughness=0.5,f0=0.04"])
@pytest.mark.parametrize("fall", [0, 1])
def test_azimuthal_orders_that_are_not_known_meet_the_light_of_known_degrees(spec, fall):
    """Light that falls with the degree lights them more than the degrees beyond F."""
    order, brdf = 64, parse_spec(spec)
    degree = np.arange(order + 1.0)[:, None]
    power = np.repeat((2 * degree + 1) / (1 + degree) ** fall, 3, axis=1)
    known, whole = (compute_transfer(brdf, order, q, 1e-5) for q in (6, 24))
    light = (4 * np.pi / (2 * degree + 1)) * power
    expected = np.sum(light * (whole.degree_energy - known.degree_energy))
    # The light ends at the known degrees, so that nothing beyond them counts.
    found = energy_beyond(lit(power), known)
    assert expected > 0
    assert 0.8 < np.sqrt(found / expected) < 1.6


def test_visible_part_is_the_rms_of_the_missing_degrees():
    """The missing part of the light of a lamp, from its Legendre series (eq. 5.8)."""
    order, kept = 60, 14
    coefficients = compute_coefficients(parse_spec("phong:exponent=64"), order, 0)
    cosines, weights = np.polynomial.legendre.leggauss(200)
    # L_l0 = sqrt(2l + 1), so the reflected light has the coefficients rho_l Lambda_l sqrt(2l + 1),
    # and Y_l0 = sqrt((2l + 1) / 4 pi) P_l.
    degree = np.arange(order + 1)
    series = coefficients.values[:, 0, 0, 0] * np.sqrt(2.0 * degree + 1) / np.sqrt(4 * np.pi)
    left = np.where(degree > kept, series, 0) * np.sqrt(4 * np.pi)
    missing = np.polynomial.legendre.legval(cosines, left / np.sqrt(4 * np.pi))
    whole = np.polynomial.legendre.legval(cosines, series)
    rms = np.sqrt(weights @ missing**2 / 2)
    mean = weights @ whole / 2
    found = visible_beyond(lamp(order), coefficients, 0)
    assert found[kept] == pytest.approx(rms / mean, rel=1e-6)
    assert found[-1] == 0
    assert (np.diff(found) <= 0).all()


def test_the_worst_channel_is_what_is_visible():
    """Each channel alone, as grey light."""
    coefficients = compute_coefficients(parse_spec("microfacet:sigma=0.3"), 30, 4)
    power = np.array([[4.0], [1.0]]).repeat([1, 30], axis=0) * [1.0, 0.1, 0.3]
    power[0] = [4.0, 0.1, 9.0]
    grey = [lit(power[:, [channel] * 3]) for channel in range(3)]
    alone = [visible_beyond(each, coefficients, 2) for each in grey]
    np.testing.assert_allclose(visible_beyond(lit(power), coefficients, 2), np.max(alone, axis=0))
    views = [visible_beyond_p(each, coefficients, 2) for each in grey]
    assert visible_beyond_p(lit(power), coefficients, 2) == pytest.approx(max(views))


def test_nothing_is_visible_beyond_the_visible_order():
    coefficients = compute_coefficients(parse_spec("phong:exponent=64"), 80, 0)
    light = lamp(80)
    order = last_visible(visible_beyond(light, coefficients, 0))
    seen = visible_beyond(light, coefficients, 0)
    assert seen[order] <= 1e-4 < seen[order - 1]


def test_parts_of_cubes_are_filtered_in_their_own_degrees(rng):
    order, p = 12, 3
    parts = rng.normal(size=(order + 1, p + 1, 2, 3))
    q, degree = np.arange(p + 1), np.arange(order + 1)
    parts[degree[:, None] < q] = 0  # there are none
    half = filter_matrices(np.full(order + p + 1, 0.5), order, p)
    everything = filtered_parts(parts, half)
    assert everything == pytest.approx(0.5 * parts, abs=1e-12)
    factors = rng.random(order + p + 1)
    light = rng.random((order + 1, 3))
    filtered = filtered_parts(parts, filter_matrices(factors, order, p))
    squares = np.sum(filtered**2, axis=2)
    found = np.einsum("lqc,lc,q->", squares, light, np.where(q, 2, 1))
    assert found == pytest.approx(factors**2 @ cube_energies(light, parts))


def test_filtered_parts_are_those_of_filtered_cubes(rng):
    """Functions of one order q are turned to world axes, and blurred there."""
    order, p, q = 5, 2, 1
    parts = np.zeros((order + 1, p + 1, 1, 3))
    parts[order, q] = 1.0
    factors = 1 / (1 + np.arange(order + p + 1.0))
    light = np.zeros(((order + 1) ** 2, 3))
    light[order**2 :] = rng.normal(size=(2 * order + 1, 3))
    cubes = bundle_coefficients(light, parts)
    blurred = cubes * factors[degrees(order + p)][:, None, None, None]
    assert np.abs(blurred).max() > 0.01
    filtered = filtered_parts(parts, filter_matrices(factors, order, p))
    assert bundle_coefficients(light, filtered) == pytest.approx(blurred)


def test_degrees_that_are_weakened_make_an_error_by_the_squares_of_what_they_lose():
    """Factors of each degree of the light and of the view, by a sum over all of them."""
    coefficients = compute_coefficients(parse_spec("microfacet:sigma=0.4"), 8, 4)
    light = lit(np.repeat(np.exp(-np.arange(9.0))[:, None], 3, axis=1))
    factors = np.outer(np.linspace(1, 0.3, 7), [1, 1, 0.8, 0.4])
    whole = left = 0.0
    power = light.power()
    for degree in range(9):
        measure = 4 * np.pi / (2 * degree + 1) * power[degree]
        whole += np.sum(measure * coefficients.degree_energy[degree])
        kept = np.zeros(3)
        for p in range(4 if degree < 7 else 0):
            signs = np.where(np.arange(p + 1) > 0, 2, 1)[:, None]
            energy = np.sum(signs * coefficients.values[degree, p, : p + 1] ** 2, axis=0)
            kept += energy
            left += np.sum(measure * energy * (1 - factors[degree, p]) ** 2)
        left += np.sum(measure * (coefficients.degree_energy[degree] - kept))
    beyond = energy_beyond(light, coefficients)
    found = predicted_error(light, coefficients, 6, 3, factors=factors)
    assert found == pytest.approx(np.sqrt((left + beyond) / (whole + beyond)), rel=1e-9)
