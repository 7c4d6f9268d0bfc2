"""Windows, the lowest irradiance of the whole sphere, and the least window that lifts it to 0."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq, minimize

from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.files.image import write_image
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.irradiance.irradiance import Irradiance, lambert_factors
from shrm_cli.maps.irradiance.window import (
    MARGIN,
    Window,
    least_window,
    make_window,
    parse_window,
    window_factors,
)
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.sky import sky
from shrm_cli.sphere.extremes import degree_values, low_places, lowest, series_values
from tests import oracles
from tests.brute_force import unit
from tests.makers import prefilter_irradiance

INFO = MapInfo(2, 0, 0.0, 1.0, 0.0)
A_L = {0: math.pi, 1: 2 * math.pi / 3, 2: math.pi / 4, 4: -math.pi / 24}


def series_of(order, lights):
    """Irradiance of distant lights, (direction, colour) each, up to order 5."""
    directions = np.array([d for d, _ in lights]) / np.linalg.norm(
        [d for d, _ in lights], axis=1, keepdims=True
    )
    colours = np.array([colour for _, colour in lights], dtype=float)
    light = oracles.real_harmonics(order, directions).T @ colours
    return factor_column(order) * light


def factor_column(order):
    """A_l of every index (eq. 4.12), up to order 5, shape ((order+1)^2, 1)."""
    factors = [A_L.get(k, 0.0) for k in range(order + 1) for _ in range(2 * k + 1)]
    return np.array(factors)[:, None]


def ambient(order, colour):
    series = np.zeros(((order + 1) ** 2, 3))
    series[0] = np.sqrt(4 * np.pi) * np.array(colour, dtype=float)
    return series


def values(series, directions):
    """The sum over scipy's harmonics."""
    order = math.isqrt(len(series)) - 1
    return oracles.real_harmonics(order, directions) @ series


def sphere_minimum(matrix):
    """Least ``(n, 1) M (n, 1)`` of unit n: a trust-region problem with its secular equation.

    At the minimum ``(A - mu) n = -b`` with mu no larger than A's least eigenvalue.
    """
    eigenvalues, vectors = np.linalg.eigh(matrix[:3, :3])
    b = vectors.T @ matrix[:3, 3]
    least = eigenvalues[0]

    def excess(mu):
        return np.sum((b / (eigenvalues - mu)) ** 2) - 1

    near = least - 1e-13 * max(1.0, abs(least))
    if excess(near) > 0:
        mu = brentq(excess, least - np.linalg.norm(b) - 1, near, xtol=1e-15)
        point = -b / (eigenvalues - mu)
    else:  # the hard case: b has nothing along the lowest eigenvector, which fills up the length
        above = eigenvalues - least > 1e-12
        point = np.where(above, -b / np.where(above, eigenvalues - least, 1.0), 0.0)
        point[0] = math.sqrt(1 - point @ point)
    n = vectors @ (point / np.linalg.norm(point))
    return n @ matrix[:3, :3] @ n + 2 * matrix[:3, 3] @ n + matrix[3, 3]


def test_factors():
    hann, lanczos = window_factors("hann", 3, 4), window_factors("lanczos", 3, 4)
    np.testing.assert_allclose(hann, [1, 0.75, 0.25, 0, 0], atol=1e-15)
    third = math.pi / 3
    np.testing.assert_allclose(
        lanczos, [1, math.sin(third) / third, math.sin(2 * third) / (2 * third), 0, 0], atol=1e-15
    )
    assert window_factors("lanczos", 1.5, 3)[2:].tolist() == [0, 0]  # sin(4 pi / 3) is not
    for name in ("hann", "lanczos"):
        assert window_factors(name, 1e-320, 3).tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize("spec", ["hann", "lanczos"])
def test_the_width_is_one_more_than_the_order(spec):
    series = np.ones((16, 3))
    window = make_window(spec, series)
    assert (window.name, window.width) == (spec, 4.0)
    assert window.factors == tuple(window_factors(spec, 4, 3).tolist())
    assert min(window.factors) > 0


def test_a_named_width():
    assert make_window("lanczos:2.5", np.ones((9, 3))).width == 2.5
    assert parse_window("hann:1e1") == ("hann", 10.0)
    assert parse_window("auto") == ("auto", None)
    assert make_window("none", np.ones((9, 3))) == Window()


@pytest.mark.parametrize(
    ("spec", "word"),
    [
        ("hamming", "no such window"), ("", "no such window"), ("Hann", "no such window"),
        ("hann:", "positive number"), ("hann:0", "positive number"), ("hann:-2", "positive"),
        ("hann:nan", "positive number"), ("hann:inf", "positive number"),
        ("lanczos:wide", "positive number"), ("hann:3:4", "positive number"),
        ("auto:3", "no width"), ("none:3", "no width"), ("least", "no such window"),
    ],
)  # fmt: skip
def test_what_is_no_window(spec, word):
    """The command line says so as wrong usage, which no probe mends."""
    with pytest.raises(ArgumentError, match=word) as caught:
        parse_window(spec)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["hamming", "auto", "none", "least", ""])
def test_factors_of_no_family_are_refused(name):
    with pytest.raises(MapError, match="no such family; take one of hann, lanczos"):
        window_factors(name, 3, 4)


@pytest.mark.parametrize("spec", ["hann", "lanczos:2.2", "hann:1"])
def test_costs_are_those_of_integrals_over_the_sphere(rng, spec):
    series = rng.normal(size=(16, 3))
    window = make_window(spec, series)
    directions, weights = oracles.sphere_rule(8)
    before, after = values(series, directions), values(window.apply(series), directions)
    whole = np.sum(weights @ before**2)
    assert window.energy_lost == pytest.approx(1 - np.sum(weights @ after**2) / whole, abs=1e-12)
    change = math.sqrt(np.sum(weights @ (after - before) ** 2) / whole)
    assert window.change == pytest.approx(change, abs=1e-12)


def test_a_black_series_costs_nothing():
    window = make_window("hann", np.zeros((9, 3)))
    assert (window.energy_lost, window.change) == (0.0, 0.0)
    assert least_window(np.zeros((9, 3))) == Window()


def test_values_by_degree(rng):
    series, directions = rng.normal(size=(25, 2)), unit(rng, 7)
    by_degree = degree_values(series, directions)
    for degree in range(5):
        alone = np.zeros_like(series)
        alone[degree**2 : (degree + 1) ** 2] = series[degree**2 : (degree + 1) ** 2]
        np.testing.assert_allclose(by_degree[:, degree], values(alone, directions), atol=1e-12)
    np.testing.assert_allclose(series_values(series, directions), by_degree.sum(axis=1), atol=1e-12)


def test_lowest_of_order_2_is_that_of_the_secular_equation(rng):
    for _ in range(12):
        made = Irradiance(rng.normal(size=(9, 3)), INFO)
        directions, found = lowest(made.series)
        expected = [sphere_minimum(matrix) for matrix in made.matrices()]
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(made.series).max())
        at = np.diagonal(values(made.series, directions))
        np.testing.assert_allclose(at, found, atol=1e-12)


@pytest.mark.parametrize("index", [0, 1, 2, 3, 6, 8])
def test_lowest_of_single_harmonics(index):
    """Rings and pairs of minima, the hard case of the secular equation among them."""
    for sign in (1, -1):
        coefficients = np.zeros((9, 3))
        coefficients[index] = sign
        made = Irradiance(coefficients, INFO)
        expected = sphere_minimum(made.matrices()[0])
        np.testing.assert_allclose(lowest(made.series)[1], expected, atol=1e-14)


@pytest.mark.parametrize("order", [0, 1, 5, 9])
def test_lowest_is_below_every_sample(rng, order):
    series = rng.normal(size=((order + 1) ** 2, 3))
    directions, found = lowest(series)
    samples = values(series, unit(rng, 10_000)).min(axis=0)
    scale = np.abs(series).sum()
    assert (found <= samples + 1e-13 * scale).all()
    # Samples lie 0.04 apart; a minimum rises by less than (0.04 order)^2 / 2 of the half range.
    assert (samples - found < (0.04 * order) ** 2 / 2 * scale + 1e-12).all()
    np.testing.assert_allclose(np.diagonal(values(series, directions)), found, atol=1e-12 * scale)


def test_nothing_is_done_where_nothing_is_negative():
    series = ambient(2, (1, 1, 1)) + series_of(2, [((1, 2, 3), (1, 0.5, 2))])
    assert least_window(series) == Window()


LIGHTS = {
    "one": [((1, 2, 3), (1, 1, 1))],
    "two colours": [((1, 2, 3), (1, 0.5, 0.2)), ((-1, 1, 0), (0.1, 0.1, 0.5))],
    "dim blue": [((0, 1, 0), (1, 0.3, 0)), ((3, -1, 1), (0, 0, 1e-6))],
    "three": [((1, 0, 0.2), (1, 1, 1)), ((0, 1, 0), (0, 1, 2)), ((0, 0, -1), (3, 1, 1))],
}


REST = (1, 0.0), (4, 0.0), (5, 0.0), (1, 0.003), (2, 0.003), (5, 0.003)


def damped(series, directions):
    """What each degree adds, shape (F+1, n, 3), by scipy's harmonics."""
    order = math.isqrt(len(series)) - 1
    harmonics = oracles.real_harmonics(order, directions)
    degrees = [slice(k**2, (k + 1) ** 2) for k in range(order + 1)]
    return np.stack([harmonics[:, part] @ series[part] for part in degrees])


def change_of(factors, series):
    """RMS change by the coefficients (Parseval)."""
    taken = 1 - np.repeat(factors, 2 * np.arange(len(factors)) + 1)
    return math.sqrt(np.sum((taken[:, None] * series) ** 2) / np.sum(series**2))


@pytest.mark.parametrize("name", LIGHTS)
@pytest.mark.parametrize(
    ("order", "fill"),
    [(2, 0.0), (4, 0.003), *(pytest.param(*each, marks=pytest.mark.proof) for each in REST)],
)
def test_no_side_is_negative_and_less_change_would_not_do(rng, order, name, fill):
    """Against scipy's programming over a dense sphere, and windows of both families."""
    series = ambient(order, (fill, 2 * fill, 0)) + series_of(order, LIGHTS[name])
    mean = series[0] / np.sqrt(4 * np.pi)
    by_degree = damped(series, unit(rng, 3000))
    assert by_degree.sum(axis=0).min() < -1e-4 * mean.min()
    window = least_window(series)
    assert (window.name, window.width, window.factors[0]) == ("least", None, 1.0)
    assert all(0 <= factor <= 1 for factor in window.factors)
    assert window.change == pytest.approx(change_of(window.factors, series), rel=1e-9)
    assert (np.tensordot(window.factors, by_degree, 1) >= 0).all()
    best = scipys_change(series, by_degree)
    assert best * (1 - 1e-6) <= window.change <= best + 0.02 * max(best, 0.01)
    for family in ("hann", "lanczos"):
        for width in np.geomspace(100, 1.001, 400):
            other = make_window(f"{family}:{width}", series)
            is_near = (np.tensordot(other.factors, by_degree, 1) > MARGIN * mean).all()
            if is_near and (lowest(other.apply(series))[1] >= MARGIN * mean).all():
                assert window.change <= other.change * (1 + 1e-6)
                break


def scipys_change(series, by_degree):
    """The least change that keeps every sample at half the floor or above, by SLSQP."""
    order = len(by_degree) - 1
    shares = np.array([
        np.linalg.norm(series[k**2 : (k + 1) ** 2]) for k in range(order + 1)
    ]) / np.linalg.norm(series)  # fmt: skip
    lit = series[0] > 0
    floor = 0.5 * MARGIN
    rows = (by_degree[:, :, lit] / by_degree[0, 0, lit]).reshape(order + 1, -1).T
    # In units of each degree's share, without those that have none.
    used = np.flatnonzero(shares[1:] > 0) + 1
    scaled = rows[:, used] / shares[used]
    binding = rows.sum(axis=1) - floor < np.linalg.norm(scaled, axis=1)
    scaled, bounds = scaled[binding], (rows.sum(axis=1) - floor)[binding]
    lengths = np.linalg.norm(scaled, axis=1)
    scaled, bounds = scaled / lengths[:, None], bounds / lengths
    found = minimize(
        lambda x: x @ x, shares[used], jac=lambda x: 2 * x, method="SLSQP",
        bounds=[(0, share) for share in shares[used]], options={"ftol": 1e-12, "maxiter": 500},
        constraints={
            "type": "ineq", "fun": lambda x: bounds - scaled @ x, "jac": lambda _: -scaled,
        },
    )  # fmt: skip
    assert found.success, found.message
    return float(np.linalg.norm(found.x))


def test_the_engineers_numbers(tmp_path):
    """A sun at noon over black ground: hann and lanczos changed a third of it."""
    write_image(tmp_path / "sky.exr", sky(64, 20, 60, 3, 0.0))
    window = prefilter_irradiance(open_probe(tmp_path / "sky.exr"), 2, "auto").map.window
    assert 0.03 < window.change < 0.045
    light = series_of(2, [((1, 2, 3), (1, 1, 1))])
    assert least_window(light).change == pytest.approx(0.106, abs=5e-4)
    # By hand: 1/4 + x/2 c + 5/16 y (3/2 c^2 - 1/2) touches 0 at c = -4x / (15y), inside.
    x, y = least_window(light).factors[1:]
    c = -4 * x / (15 * y) * 2
    assert abs(0.25 + x * c / 2 + 5 / 16 * y * (1.5 * c**2 - 0.5)) < 1e-5


@pytest.mark.proof
@pytest.mark.parametrize(("order", "seed"), [(6, 8), (6, 38), (9, 18), (9, 29)])
@pytest.mark.slow
def test_narrow_valleys_are_found(order, seed):
    """Lights of all colours and strengths: a window leaves many minima that are nearly as low."""
    rng = np.random.default_rng(seed)
    colours = 10 ** rng.uniform(-6, 3, (4, 3))
    light = oracles.real_harmonics(order, unit(rng, 4)).T @ colours
    degree = np.repeat(np.arange(order + 1), 2 * np.arange(order + 1) + 1)
    series = lambert_factors(order)[degree][:, None] * light
    windowed = least_window(series).apply(series)
    found = lowest(windowed)[1]
    samples = values(windowed, unit(np.random.default_rng(0), 20_000)).min(axis=0)
    assert (samples >= 0).all()
    assert (samples >= found - 1e-12 * series[0]).all()


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize("order", [9, 24])
def test_higher_orders(rng, order):
    """The cuts converge where a ring of light turns negative on many rings."""
    direction = np.array([[1.0, 2, 3]]) / math.sqrt(14)
    harmonics = oracles.real_harmonics(order, direction).T
    degree = np.repeat(np.arange(order + 1), 2 * np.arange(order + 1) + 1)
    series = harmonics * lambert_factors(order)[degree][:, None] * [1.0, 0.5, 2.0]
    window = least_window(series)
    cosines = np.linspace(-1, 1, 4001)
    zonal = window.factors * lambert_factors(order) * (2 * np.arange(order + 1) + 1) / (4 * np.pi)
    values = np.polynomial.legendre.legval(cosines, zonal)
    assert 0 < values.min() < 1.1 * MARGIN / 4
    assert window == least_window(series)


def test_what_never_converges_still_is_nowhere_negative(monkeypatch):
    """After the last round the factors fade until nothing is negative."""
    monkeypatch.setattr("shrm_cli.maps.irradiance.window._ROUNDS", 1)
    monkeypatch.setattr("shrm_cli.maps.irradiance.window._FIRST_DIRECTIONS", 2)
    series = series_of(4, LIGHTS["three"])
    window = least_window(series)
    found = lowest(window.apply(series))[1] / (series[0] / np.sqrt(4 * np.pi))
    assert found.min() == pytest.approx(1e-5, rel=1e-3)
    assert 0 < window.change < 1


def test_low_places(rng):
    series = rng.normal(size=(49, 3))
    limits = lowest(series)[1] * 0.3
    places = low_places(series, limits, 5)
    assert 3 <= len(places) <= 15
    assert np.linalg.norm(places, axis=1) == pytest.approx(1)
    assert (values(series, places) < limits).any(axis=1).all()
    assert len(low_places(series, lowest(series)[1] - 1, 5)) == 0


def test_the_floor_is_just_kept():
    series = series_of(2, [((0, 1, 0), (1, 2, 3))])
    window = least_window(series)
    found = lowest(window.apply(series))[1]
    mean = series[0] / np.sqrt(4 * np.pi)
    assert (found >= 0.5 * MARGIN * mean).all()
    assert (found <= 1.01 * MARGIN * mean).all()


@pytest.mark.parametrize("order", [2, 5])
@pytest.mark.parametrize("name", [
    "city", "courtyard", "forest", "interior", "night", "studio", "sunrise", "sunset",
])  # fmt: skip
def test_auto_leaves_no_shared_probe_negative(real_probes, name, order):
    prefiltered = prefilter_irradiance(open_probe(real_probes / f"{name}.exr"), order, "auto")
    check_non_negative(prefiltered, order)
    assert (prefiltered.facts["minimum_without_window"] < 0) == bool(prefiltered.map.window.factors)
    # Of the eight, only the low sun before a dark ground rings below 0.
    assert (prefiltered.facts["minimum_without_window"] < 0) == (name == "sunrise")


@pytest.mark.parametrize("name", ["city", "sunrise"])
def test_auto_is_the_default_and_leaves_what_needs_no_window(real_probes, name):
    probe = open_probe(real_probes / f"{name}.exr")
    found, none = prefilter_irradiance(probe), prefilter_irradiance(probe, window="none")
    is_same = np.array_equal(found.map.coefficients, none.map.coefficients)
    assert is_same == (name == "city")
    assert not found.warnings
    assert found.facts["minimum_irradiance"] >= 0
    check_non_negative(found, 2)
    assert bool(none.warnings) == (name == "sunrise")


@pytest.mark.parametrize(
    ("elevation", "albedo", "is_negative"), [(60, 0.2, False), (60, 0.0, True), (10, 0.0, True)]
)
def test_auto_leaves_no_sky_with_its_sun_negative(tmp_path, elevation, albedo, is_negative):
    write_image(tmp_path / "sky.exr", sky(64, 20, elevation, 2.5, albedo))
    prefiltered = prefilter_irradiance(open_probe(tmp_path / "sky.exr"), 2, "auto")
    assert (prefiltered.facts["minimum_without_window"] < 0) == is_negative
    check_non_negative(prefiltered, 2)


def check_non_negative(prefiltered, order):
    """On a dense grid that the search does not know, and in a file."""
    grid = oracles.latlong_pixels(32 * (order + 3), 16 * (order + 3)).reshape(-1, 3)
    least = values(prefiltered.map.coefficients * factor_column(order), grid).min()
    assert least >= 0
    assert prefiltered.facts["minimum_irradiance"] <= least
    assert prefiltered.facts["minimum_irradiance"] >= 0
    for precision in (np.float16, np.float32):
        with np.errstate(over="ignore"):
            assert prefiltered.map.cube().astype(precision).min() >= 0
