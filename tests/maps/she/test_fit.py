"""Least squares of exponentials against numpy's, scipy's, and data whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from shrm_cli.brdf.environment.environment_brdf import lobe_moments
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.she.exponential import SphericalHarmonicExponential, exponent_series
from shrm_cli.maps.she.prefilter import Problem, fit_exponent, fit_logarithm
from shrm_cli.maps.she.reflectance import sample_reflectance
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from tests.brute_force import unit
from tests.oracles import real_harmonics

INFO = MapInfo(32, 0, 0.0, 1.0, 0.0)


def random_problem(rng, samples=300, columns=12, scale=0.4):
    """Rows with a constant column first, as those of harmonics; and coefficients that fit them."""
    rows = rng.normal(size=(samples, columns))
    rows[:, 0] = 1 / np.sqrt(4 * np.pi)
    variances = rng.uniform(0, 0.1, size=(samples, columns))
    variances[:, 0] = 0
    x = scale * rng.normal(size=columns)
    target = np.exp(rows @ x - variances @ x**2)
    return Problem(rows, variances, target, rng.uniform(0.2, 1, samples)), x


def cost(problem, x):
    value = np.exp(problem.rows @ x - problem.variances @ x**2)
    return float(problem.weights @ (value - problem.target) ** 2)


def light_problem(contrast, order=3):
    """A sun beside a dim sky, of too many frequencies for the coefficients to hold."""
    rng = np.random.default_rng(4)
    directions = unit(rng, 400)
    rows = real_harmonics(order, directions)
    target = 0.2 + 0.1 * directions[:, 1] + contrast * np.exp(20 * (directions[:, 0] - 1))
    variances = rows**2 * 0 + 1 / (8 * np.pi)
    variances[:, 0] = 0
    return Problem(rows, variances, target, np.full(400, 1 / 400))


def by_scipy(problem, start):
    root = np.sqrt(problem.weights)

    def residuals(x):
        exponent = problem.rows @ x - problem.variances @ x**2
        return root * (np.exp(np.minimum(exponent, 60)) - problem.target)

    return least_squares(residuals, start, xtol=1e-12, ftol=1e-12, gtol=1e-12).x


def by_numpy(problem, logarithm):
    """The rows' least squares; a ridge of a millionth is as many rows more, whose target is 0."""
    root = np.sqrt(problem.weights)
    rows = root[:, None] * problem.rows
    ridge = np.sqrt(1e-6 * np.mean(np.sum(rows**2, axis=0))) * np.eye(rows.shape[1])
    targets = np.append(root * logarithm, np.zeros(len(ridge)))
    return np.linalg.lstsq(np.concatenate([rows, ridge]), targets)[0]


def test_in_log_space_it_is_linear_least_squares(rng):
    problem, x = random_problem(rng)
    noisy = replace(problem, target=problem.target * np.exp(0.2 * rng.normal(size=300)))
    expected = by_numpy(noisy, np.log(noisy.target))
    assert fit_logarithm(noisy) == pytest.approx(expected, abs=1e-9)
    assert np.abs(expected - x).max() > 0.01


def test_in_log_space_exact_data_are_recovered(rng):
    problem, x = random_problem(rng)
    plain = replace(problem, variances=0 * problem.variances, target=np.exp(problem.rows @ x))
    assert fit_logarithm(plain) == pytest.approx(x, abs=1e-5)


@pytest.mark.parametrize("scale", [0.1, 0.4, 0.7])
def test_exact_data_are_recovered(rng, scale):
    problem, x = random_problem(rng, scale=scale)
    assert np.abs(fit_logarithm(problem) - x).max() > 1e-3  # which knows no variances
    assert fit_exponent(problem) == pytest.approx(x, abs=1e-4)


@pytest.mark.parametrize("contrast", [0.5, 3.0])
def test_it_is_the_least_that_scipy_finds(contrast):
    problem = light_problem(contrast)
    found = fit_exponent(problem)
    least = by_scipy(problem, fit_logarithm(problem))
    assert cost(problem, least) > 1e-6  # it cannot fit
    assert cost(problem, found) == pytest.approx(cost(problem, least), rel=0.01)


def test_slopes_know_the_variances(rng):
    """Without them it would settle beside the least: the derivative of the cost there is 0."""
    problem, _ = random_problem(rng)
    variances = 10 * problem.variances
    target = problem.target * np.exp(0.5 * rng.normal(size=300))
    noisy = replace(problem, variances=variances, target=target)
    x = fit_exponent(noisy)
    around = [cost(noisy, x + sign * step) for step in 1e-3 * np.eye(12) for sign in (1, -1)]
    assert min(around) > cost(noisy, x)


def test_a_real_problem_has_the_cost_that_scipy_finds(real_probes):
    samples = sample_reflectance(
        project(open_probe(real_probes / "studio.exr"), 32), [0.6], 8, 4, 1
    )
    cosines = np.sum(samples.normals * samples.views, axis=1)
    form = SphericalHarmonicExponential(np.zeros((16, 3)), np.zeros((3, 3)), (0.36, 0.36), INFO)
    moments = lobe_moments(0.6, cosines)
    series = exponent_series(form, samples.normals, samples.views, 0.6, moments, 1.0)
    target = samples.reflected[0, 0, :, 1] / series.albedo
    problem = Problem(series.rows, series.variances, target, samples.weights)
    start, found = fit_logarithm(problem), fit_exponent(problem)
    least = by_scipy(problem, start)
    assert cost(problem, found) == pytest.approx(cost(problem, least), rel=1e-3)
    assert cost(problem, found) < 0.8 * cost(problem, start)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("contrast", [1.0, 1e3, 1e6])
def test_it_never_ends_worse_than_it_began(seed, contrast):
    rng = np.random.default_rng(seed)
    problem, _ = random_problem(rng, samples=60, scale=0.7)
    target = np.where(rng.uniform(size=60) < 0.05, contrast, problem.target)
    hard = replace(problem, target=target)
    start, end = fit_logarithm(hard), fit_exponent(hard)
    assert np.isfinite(end).all()
    assert cost(hard, end) <= cost(hard, start)


def test_a_light_in_the_dark_does_not_stop_it(rng):
    """In log space the coefficients are large, and their variances would hide all of the light."""
    problem = light_problem(100.0)
    dark = replace(problem, target=problem.target - 0.2 + 1e-7)
    start = fit_logarithm(dark)
    assert cost(dark, start) > 0.9 * cost(dark, np.append(-60.0, np.zeros(len(start) - 1)))
    assert cost(dark, fit_exponent(dark)) < 0.2 * cost(dark, start)


@pytest.mark.parametrize("fit", [fit_logarithm, fit_exponent])
def test_dark_and_negative_targets_count_as_dark(rng, fit):
    """Truncated light rings below 0; its logarithm counts as that of a thousandth of the mean."""
    problem, _ = random_problem(rng)
    target = problem.target.copy()
    target[::10], target[5::10] = 0.0, -0.3 * target[5::10]
    x = fit(replace(problem, target=target))
    assert np.isfinite(x).all()
    if fit is fit_logarithm:
        mean = np.average(target, weights=problem.weights)
        expected = by_numpy(problem, np.log(np.maximum(target, 1e-3 * mean)))
        assert x == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("fit", [fit_logarithm, fit_exponent])
@pytest.mark.parametrize("target", [0.0, -1e-3])
def test_a_black_channel_stays_black(rng, fit, target):
    problem, _ = random_problem(rng)
    x = fit(replace(problem, target=np.full(300, target)))
    value = np.exp(problem.rows @ x - problem.variances @ x**2)
    assert np.isfinite(x).all()
    assert value.max() < 1e-20


@pytest.mark.parametrize("fit", [fit_logarithm, fit_exponent])
@pytest.mark.parametrize("factor", [1e-35, 1e-4, 2.0, 1e5, 1e35])
def test_brightness_is_added_to_the_constant(rng, fit, factor):
    problem, _ = random_problem(rng)
    noisy = replace(problem, target=problem.target + 0.3 * rng.uniform(size=300))
    found = fit(replace(noisy, target=factor * noisy.target))
    expected = fit(noisy)
    expected[0] += np.log(factor) * np.sqrt(4 * np.pi)
    assert found == pytest.approx(expected, rel=2e-5, abs=5e-4)


@pytest.mark.parametrize("fit", [fit_logarithm, fit_exponent])
def test_only_the_ratios_of_weights_count(rng, fit):
    problem, _ = random_problem(rng)
    noisy = replace(problem, target=problem.target + 0.3 * rng.uniform(size=300))
    found = fit(replace(noisy, weights=1e9 * noisy.weights))
    assert found == pytest.approx(fit(noisy), abs=1e-7)


@pytest.mark.parametrize("fit", [fit_logarithm, fit_exponent])
def test_more_coefficients_than_samples_tell_are_kept_small(rng, fit):
    """P and Q nearly cancel in some directions: the ridge keeps both from running away."""
    problem, _ = random_problem(rng, samples=60)
    twice = Problem(
        np.concatenate([problem.rows, problem.rows], axis=1),
        np.concatenate([problem.variances, problem.variances], axis=1),
        problem.target,
        problem.weights,
    )
    x = fit(twice)
    assert np.abs(x).max() < 3
    assert cost(twice, x) <= cost(twice, np.zeros(24))
