"""Errors of what is seen, against the definition written again, one pixel after the other."""

import math

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError
from shrm_cli.render.seen import SeenErrors, seen_errors


def luminance(pixel):
    return 0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2]


def formulas(picture, truth, weights):
    """The four numbers; a percentile is the least error that leaves too little weight above."""
    pixels = [
        (luminance(picture[index]), luminance(truth[index]), weights[index])
        for index in np.ndindex(truth.shape[:-1])
        if weights[index] > 0
    ]
    whole = sum(weight for *_, weight in pixels)
    floor = 0.02 * sum(true * weight for _, true, weight in pixels) / whole
    errors = sorted((abs(m - t) / max(t, floor), weight) for m, t, weight in pixels)

    def percentile(fraction):
        passed = 0.0
        for error, weight in errors:
            passed += weight
            if passed >= fraction * whole:
                return error
        raise AssertionError

    wrong = sum(weight for error, weight in errors if error > 0.05)
    negative = sum(weight for m, _, weight in pixels if m < 0)
    return percentile(0.5), percentile(0.95), wrong / whole, negative / whole


def numbers(found):
    relative = found.median_relative_error, found.p95_relative_error
    return *relative, found.wrong_share, found.negative_share


@pytest.mark.parametrize("shape", [(90,), (20, 30), (3, 11, 13)])
def test_formulas(shape):
    random = np.random.default_rng(len(shape))
    truth = np.exp(random.normal(0, 2, (*shape, 3)))
    truth[..., 0] *= random.random(shape) < 0.7  # colours far from grey
    picture = truth * random.normal(1, 0.8, truth.shape)
    weights = random.random(shape) * (random.random(shape) < 0.8)
    expected = formulas(picture, truth, weights)
    np.testing.assert_allclose(numbers(seen_errors(picture, truth, weights)), expected, rtol=1e-9)
    alike = formulas(picture, truth, np.ones(shape))
    np.testing.assert_allclose(numbers(seen_errors(picture, truth)), alike, rtol=1e-9)
    assert expected != pytest.approx(alike, rel=1e-3)


def test_percentiles_are_those_of_numpy():
    """With 100 k + 1 pixels that count alike, no two definitions of a percentile differ."""
    random = np.random.default_rng(1)
    truth = random.uniform(1, 2, (2001, 1)).repeat(3, axis=1)
    picture = truth * random.uniform(0, 3, (2001, 1))
    errors = np.abs(picture / truth - 1)[:, 0]
    found = seen_errors(picture, truth)
    assert found.median_relative_error == pytest.approx(np.percentile(errors, 50))
    assert found.p95_relative_error == pytest.approx(np.percentile(errors, 95))


def test_dark_pixels_are_divided_by_a_fiftieth_of_the_mean():
    truth = np.zeros((100, 3))
    truth[:50] = 2.0  # the mean is 1
    picture = truth + 0.01
    found = seen_errors(picture, truth)
    assert found.median_relative_error == pytest.approx(0.005)
    assert found.p95_relative_error == pytest.approx(0.5)


def test_negative_is_what_has_negative_luminance():
    truth = np.ones((4, 3))
    picture = np.array([[-1.0, 1, 1], [1, -1, 1], [0, 0, 0], [-1e-9, 0, 0]])
    assert seen_errors(picture, truth).negative_share == 0.5
    assert seen_errors(picture, truth, [0, 3, 0, 1]).negative_share == 1
    assert seen_errors(truth, picture).negative_share == 0


def test_units_do_not_matter():
    random = np.random.default_rng(2)
    truth, picture = random.uniform(0, 2, (2, 50, 3))
    found = numbers(seen_errors(picture, truth))
    for unit in (1e-30, 1e30):
        np.testing.assert_allclose(numbers(seen_errors(unit * picture, unit * truth)), found)


def test_a_black_truth():
    black, some = np.zeros((5, 3)), np.ones((5, 3))
    assert seen_errors(black, black) == SeenErrors(0, 0, 0, 0)
    assert seen_errors(some, black) == SeenErrors(math.inf, math.inf, 1, 0)
    assert seen_errors(-some, -some) == SeenErrors(0, 0, 0, 1)
    # Most pixels are right, so the median is 0.
    assert seen_errors(np.eye(5)[:, [0] * 3], black).median_relative_error == 0


def test_a_single_pixel():
    found = numbers(seen_errors([-1, -1, -1], [2, 2, 2]))
    np.testing.assert_allclose(found, (1.5, 1.5, 1, 1))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_counts_only_where_it_has_weight(bad):
    good, broken = np.ones((3, 3)), np.ones((3, 3))
    broken[1, 2] = bad
    for pair in ((good, broken), (broken, good), (broken, broken)):
        assert all(math.isnan(each) for each in numbers(seen_errors(*pair)))
        assert seen_errors(*pair, weights=[1, 0, 1]) == SeenErrors(0, 0, 0, 0)


@pytest.mark.parametrize(
    ("picture", "truth", "weights", "named"),
    [
        ((4, 3), (5, 3), (), "`picture`"),
        ((4, 4), (4, 4), (), "`picture`"),
        ((), (), (), "`picture`"),
        ((4, 3), (4, 3), (5,), "`weights`"),
        ((4, 3), (4, 3), (2, 4), "`weights`"),
        ((0, 3), (0, 3), (), "`weights`"),
    ],
)
def test_shapes_that_do_not_fit(picture, truth, weights, named):
    with pytest.raises(ArgumentError, match=named):
        seen_errors(np.ones(picture), np.ones(truth), np.ones(weights))
    with pytest.raises(ArgumentError, match="`weights` are all 0"):
        seen_errors(np.ones((2, 3)), np.ones((2, 3)), 0)
