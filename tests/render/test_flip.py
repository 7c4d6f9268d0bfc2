"""HDR-FLIP against calls of NVIDIA's evaluator, and that no picture makes it end the process.

It ends the process from C++, which no test could survive: a test that is not reported has failed.
"""

import math
import sys

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError
from shrm_cli.render import seen
from shrm_cli.render.seen import FlipError, can_flip, hdr_flip

evaluator = pytest.importorskip("flip_evaluator")


def noise(seed, *shape, spread=1.5):
    pixels = np.random.default_rng(seed).normal(0, spread, (*(shape or (24, 32)), 3))
    return np.exp(pixels).astype(np.float32)


def direct(picture, truth):
    errors, mean, chosen = evaluator.evaluate(
        truth, picture, "HDR", applyMagma=False, parameters={}
    )
    return errors[..., 0], mean, chosen


@pytest.mark.parametrize("spread", [0.3, 1.5])
def test_the_same_as_a_direct_call(spread):
    picture, truth = noise(1, spread=spread), noise(2, spread=spread)
    errors, mean, chosen = direct(picture, truth)
    found = hdr_flip(picture, truth)
    assert found.mean == pytest.approx(mean, abs=1e-5)
    assert 0.05 < mean < 0.95
    exposures = found.exposures
    assert exposures.start == pytest.approx(chosen["startExposure"], abs=1e-5)
    assert exposures.stop == pytest.approx(chosen["stopExposure"], abs=1e-5)
    assert exposures.number == chosen["numExposures"] >= 2
    weights = np.random.default_rng(3).random((24, 32))
    weights[:, :9] = 0
    expected = np.sum(errors * weights) / np.sum(weights)
    weighted = hdr_flip(picture, truth, weights)
    assert weighted.mean == pytest.approx(expected, abs=1e-5)
    assert weighted.mean != pytest.approx(found.mean, abs=1e-4)
    assert weighted.exposures == exposures


def test_negative_values_are_black():
    picture, truth = noise(1) - 1, noise(2) - 1
    assert (picture < 0).any()
    assert (truth < 0).any()
    found = hdr_flip(picture, truth)
    _, mean, _ = direct(np.maximum(picture, 0), np.maximum(truth, 0))
    assert found.mean == pytest.approx(mean, abs=1e-5)


def test_what_is_given_is_not_changed():
    picture, truth = noise(1) - 1, noise(2) - 1
    before = picture.copy(), truth.copy()
    hdr_flip(picture, truth)
    np.testing.assert_array_equal((picture, truth), before)


def test_equal_pictures():
    found = hdr_flip(noise(1), noise(1))
    assert found.mean == 0
    assert found.exposures.stop > found.exposures.start


@pytest.mark.parametrize("unit", [1e-300, 1e-43, 1e-30, 1e-8, 1e8, 1e30, 1e300])
def test_units_only_move_the_exposures(unit, capfd):
    """The evaluator itself would end the process below 1e-7, and overflow above 1e30."""
    picture, truth = noise(1).astype(float), noise(2).astype(float)
    plain, found = hdr_flip(picture, truth), hdr_flip(unit * picture, unit * truth)
    assert found.mean == pytest.approx(plain.mean, abs=1e-4)
    stops = math.log2(unit)
    assert found.exposures.start == pytest.approx(plain.exposures.start - stops, abs=1e-4)
    assert found.exposures.stop == pytest.approx(plain.exposures.stop - stops, abs=1e-4)
    assert capfd.readouterr() == ("", "")


def test_what_is_beyond_white_is_white():
    truth, picture = noise(2), noise(1)
    results = []
    for bright in (1e6, 1e30, 1e300):
        shown = picture.astype(float)
        shown[4:9, 5:11] = bright
        results.append(hdr_flip(shown, truth))
    assert results[0] == results[1] == results[2]
    shown = picture.copy()
    shown[4:9, 5:11] = 1e6
    assert results[0].mean == pytest.approx(direct(shown, truth)[1], abs=1e-5)


def test_a_spike_does_not_make_exposures_endless():
    """Alone, the evaluator would take a hundred of them, and with infinity billions."""
    truth = noise(2).astype(float)
    truth[3, 3] = 1e30
    found = hdr_flip(noise(1), truth)
    assert found.exposures.number <= 25
    assert 0 <= found.mean <= 1


def test_without_a_truth_to_be_seen_there_is_none(capfd):
    black, some = np.zeros((8, 8, 3)), noise(1, 8, 8)
    for truth in (black, -some, black - 1e-300):
        assert hdr_flip(some, truth) is None
        assert hdr_flip(black, truth) is None
    assert capfd.readouterr() == ("", "")
    assert hdr_flip(black, some).mean > 0.5


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_has_none(bad):
    broken = noise(1)
    broken[3, 3, 1] = bad
    assert hdr_flip(broken, noise(2)) is None
    assert hdr_flip(noise(2), broken) is None


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (2, 2), (40, 1)])
def test_small_pictures(shape):
    found = hdr_flip(noise(1, *shape), noise(2, *shape))
    assert isinstance(found, FlipError)
    assert 0 < found.mean <= 1


def test_a_single_lit_pixel_is_enough(capfd):
    truth = np.zeros((16, 16, 3))
    truth[5, 5, 2] = 1e-20
    found = hdr_flip(np.zeros((16, 16, 3)), truth)
    assert found.mean > 0
    assert found.exposures.number <= 25
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("picture", "truth", "weights", "named"),
    [
        ((4, 5, 3), (5, 4, 3), (), "`picture`"),
        ((4, 5), (4, 5), (), "`picture`"),
        ((4, 5, 4), (4, 5, 4), (), "`picture`"),
        ((2, 4, 5, 3), (2, 4, 5, 3), (), "`picture`"),
        ((0, 5, 3), (0, 5, 3), (), "`picture`"),
        ((4, 5, 3), (4, 5, 3), (4,), "`weights`"),
        ((4, 5, 3), (4, 5, 3), (2, 4, 5), "`weights`"),
    ],
)
def test_shapes_that_do_not_fit(picture, truth, weights, named):
    with pytest.raises(ArgumentError, match=named):
        hdr_flip(np.ones(picture), np.ones(truth), np.ones(weights))
    with pytest.raises(ArgumentError, match="`weights` are all 0"):
        hdr_flip(np.ones((2, 2, 3)), np.ones((2, 2, 3)), 0)


def test_without_the_package(monkeypatch):
    assert can_flip()
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    with pytest.raises(ModuleNotFoundError):
        seen.hdr_flip(noise(1), noise(2))
