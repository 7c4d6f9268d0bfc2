"""Differences against formulas written again, and where the pictures of a comparison are."""

import inspect
import math

import numpy as np
import pytest

from shrm_cli.errors import OutputError
from shrm_cli.render.camera import Viewer, pixel_centers, sphere_coverage
from shrm_cli.render.comparison import Comparison, compare_spheres, comparison_layout, measure
from shrm_cli.render.sheet import PAPER
from tests.render.materials import Painted, furnace

SIZE = 24
GREY = np.float32(PAPER)
VIEWERS = [Viewer(0, 0), Viewer(120, 20)]


def coverage(size=SIZE):
    return sphere_coverage(size, *pixel_centers(size, 0, size))


def disc(values):
    """Pictures of a sphere whose pixels have these values, as render_sphere draws them."""
    values = np.asarray(values, dtype=float)
    return (coverage(values.shape[-2])[..., None] * values).astype(np.float32)


def noise(seed, *shape, low=0.0, high=2.0):
    return np.random.default_rng(seed).uniform(low, high, (*shape, SIZE, SIZE, 3))


def formulas(values, expected):
    """RMSE, relative RMSE, maximum and PSNR, pixel by pixel."""
    weights = coverage()
    total = squares = scale = largest = 0.0
    peak = -math.inf
    for index in np.ndindex(values.shape):
        weight = weights[index[-3], index[-2]]
        if weight == 0:
            continue
        error = values[index] - expected[index]
        total += weight
        squares += weight * error * error
        scale += weight * expected[index] ** 2
        largest = max(largest, abs(error))
        peak = max(peak, expected[index])
    rmse = math.sqrt(squares / total)
    return rmse, rmse / math.sqrt(scale / total), largest, 20 * math.log10(peak / rmse)


def seen(values, expected):
    """Median and p95 of the relative error, and the shares of wrong and negative, by definition."""
    weights = np.broadcast_to(coverage(), values.shape[:-1])
    inside = weights > 0
    weights = weights[inside] / weights.sum()
    shown, true = (each[inside] @ [0.2126, 0.7152, 0.0722] for each in (values, expected))
    errors = np.abs(shown - true) / np.maximum(true, 0.02 * (weights * true).sum())
    up_to = np.array([weights[errors <= error].sum() for error in errors])
    found = [errors[up_to >= fraction].min() for fraction in (0.5, 0.95)]
    return *found, weights[errors > 0.05].sum(), weights[shown < 0].sum()


def numbers(difference):
    return difference.rmse, difference.relative_rmse, difference.maximum, difference.psnr


@pytest.mark.parametrize("views", [(), (1,), (3,)])
def test_formulas(views):
    values, expected = noise(1, *views, low=-0.2), noise(2, *views, high=5)
    found = numbers(measure(disc(values), disc(expected)))
    np.testing.assert_allclose(found, formulas(values, expected), rtol=1e-6)


@pytest.mark.parametrize("views", [(), (2,)])
def test_what_is_seen(views):
    values, expected = noise(1, *views, low=-0.7), noise(2, *views, high=3)
    found = measure(disc(values), disc(expected))
    relative = found.median_relative_error, found.p95_relative_error
    numbers = *relative, found.wrong_share, found.negative_share
    np.testing.assert_allclose(numbers, seen(values, expected), rtol=1e-5)
    assert 0.01 < found.negative_share < 0.5


def test_flip_sees_the_sphere_on_black():
    evaluator = pytest.importorskip("flip_evaluator")
    baseline, others = disc(noise(1, 2)), disc(noise(2, 3, 2, low=-0.5))
    comparison = Comparison(VIEWERS, baseline, others)
    for other, view in np.ndindex(3, 2):
        errors, _, chosen = evaluator.evaluate(
            baseline[view],
            np.maximum(others[other, view], 0),
            "HDR",
            applyMagma=False,
            parameters={},
        )
        found = comparison.flip(other, view)
        expected = (errors[..., 0] * coverage()).sum() / coverage().sum()
        assert found.mean == pytest.approx(expected, abs=1e-5)
        assert found.exposures.start == pytest.approx(chosen["startExposure"], abs=1e-5)
    assert Comparison(VIEWERS, 0 * baseline, others).flip(0, 0) is None


def test_the_integral_over_a_disc():
    """The mean of x^2 over the unit disc is 1/4."""

    def tilted(normals):
        return np.repeat(1 + normals[..., :1], 3, axis=-1)

    def flat(normals):
        return np.ones(normals.shape)

    comparison = compare_spheres(Painted(flat), [Painted(tilted)], [Viewer()], 200)
    found = comparison.difference(0)
    assert found.rmse == pytest.approx(0.5, rel=1e-3)
    assert found.relative_rmse == pytest.approx(0.5, rel=1e-3)
    assert found.maximum == pytest.approx(1, rel=1e-2)
    assert found.psnr == pytest.approx(20 * math.log10(2), abs=0.01)


def test_nothing_outside_of_the_silhouette_counts():
    values, expected = disc(noise(1)), disc(noise(2))
    found = measure(values, expected)
    outside = coverage() == 0
    assert outside.any()
    values[outside], expected[outside] = 1e9, np.nan
    assert measure(values, expected) == found


def test_pixels_of_the_silhouette_count_as_much_as_they_are_covered():
    expected = np.ones((SIZE, SIZE, 3))
    weights = coverage()
    for row, column in [(SIZE // 2, SIZE // 2), *np.argwhere((weights > 0) & (weights < 1))[:5]]:
        values = expected.copy()
        values[row, column] += 3
        found = measure(disc(values), disc(expected))
        share = weights[row, column] / weights.sum()
        assert found.rmse == pytest.approx(3 * math.sqrt(share), rel=1e-5)
        assert found.maximum == pytest.approx(3, rel=1e-5)


def test_equal_pictures_and_black_ones():
    some, black = disc(noise(1)), np.zeros((SIZE, SIZE, 3), np.float32)
    assert numbers(measure(some, some.copy())) == (0, 0, 0, math.inf)
    assert numbers(measure(black, black)) == (0, 0, 0, math.inf)
    found = measure(some, black)
    assert found.rmse > 0.5
    assert (found.relative_rmse, found.psnr) == (math.inf, -math.inf)
    assert measure(black, some).relative_rmse == pytest.approx(1)
    assert measure(black, -some).psnr == -math.inf


def test_differences_of_one_view_and_of_all():
    baseline, others = noise(1, 2), noise(2, 3, 2)
    comparison = Comparison(VIEWERS, disc(baseline), disc(others))
    for other in range(3):
        for view in range(2):
            found = numbers(comparison.difference(other, view))
            expected = formulas(others[other, view], baseline[view])
            np.testing.assert_allclose(found, expected, rtol=1e-6)
        each = [comparison.difference(other, view) for view in range(2)]
        found = comparison.difference(other)
        assert found.rmse == pytest.approx(math.hypot(each[0].rmse, each[1].rmse) / math.sqrt(2))
        assert found.maximum == max(each[0].maximum, each[1].maximum)


def test_all_are_seen_from_the_same_places():
    """Painted by the world's axes: what faces the viewer is the direction to the viewer."""
    doubled = Painted(lambda n: 2 * n)
    told = []
    comparison = compare_spheres(
        Painted(lambda n: n), [doubled, doubled], VIEWERS, 25, lambda *what: told.append(what)
    )
    assert comparison.baseline.shape == (2, 25, 25, 3)
    assert comparison.others.shape == (2, 2, 25, 25, 3)
    assert told == [(pictures, 3 * 2) for pictures in range(1, 7)]
    for k, viewer in enumerate(VIEWERS):
        middle = comparison.baseline[k, 12, 12]
        np.testing.assert_allclose(middle, viewer.direction, atol=1e-6)
        np.testing.assert_allclose(comparison.others[:, k], [2 * comparison.baseline[k]] * 2)


def test_a_map_is_not_different_from_itself():
    found = compare_spheres(furnace((1, 2, 3)), [furnace((1, 2, 3))], VIEWERS, 16).difference(0)
    assert numbers(found) == (0, 0, 0, math.inf)


def tile(sheet, layout, index, below=False):
    top, left = layout.origin(index)
    top, height = (top + layout.tile, layout.label_height) if below else (top, layout.tile)
    return sheet[top : top + height, left : left + layout.tile]


@pytest.mark.parametrize(("exposure", "amplification"), [(0.0, 1.0), (1.5, 1.0), (-1.0, 4.0)])
def test_a_row_holds_the_baseline_and_each_map_with_its_difference(exposure, amplification):
    comparison = Comparison(VIEWERS, disc(noise(1, 2)), disc(noise(2, 3, 2, low=-1)))
    sheet = comparison.picture("truth", ["a", "b", "c"], exposure, amplification)
    layout = comparison_layout(3, 2, SIZE)
    assert layout.columns == 7
    assert sheet.shape == (*layout.shape, 3)
    gain = 2**exposure
    for k in range(2):
        first = comparison.baseline[k]
        np.testing.assert_allclose(tile(sheet, layout, 7 * k), gain * first, rtol=1e-6)
        for other in range(3):
            index = 7 * k + 1 + 2 * other
            picture = comparison.others[other, k]
            np.testing.assert_allclose(tile(sheet, layout, index), gain * picture, rtol=1e-6)
            difference = gain * amplification * np.abs(picture - first)
            np.testing.assert_allclose(tile(sheet, layout, index + 1), difference, rtol=1e-6)


def labels_of(monkeypatch, comparison, *arguments):
    """The texts under the tiles, by row."""
    found = []
    drawing = inspect.getmodule(type(comparison))
    monkeypatch.setattr(drawing, "draw_sheet", lambda layout, tiles, labels: found.extend(labels))
    comparison.picture(*arguments)
    columns = 1 + 2 * len(comparison.others)
    return [found[k : k + columns] for k in range(0, len(found), columns)]


def test_labels(monkeypatch):
    baseline = disc(np.ones((2, SIZE, SIZE, 3)))
    others = np.stack([baseline, baseline * np.float32(1.25), -2 * baseline])
    viewers = [Viewer(0, 0), Viewer(-100 / 3, 20)]
    comparison = Comparison(viewers, baseline, others)
    same = ["a", "0% apart", "b", "25% apart", "c", "300% apart"]
    assert labels_of(monkeypatch, comparison, "truth", ["a", "b", "c"]) == [
        ["truth 0,0", *same],
        ["truth -33.33,20", *same],
    ]
    dark = Comparison(viewers[:1], 0 * baseline[:1], others[:1, :1])
    assert labels_of(monkeypatch, dark, "room", ["a"], 3, 2.5) == [
        ["room 0,0", "a", "inf% apart, x2.5"]
    ]


@pytest.mark.parametrize("size", [16, 96, 128, 300])
def test_labels_are_drawn_beside_each_other(size):
    flat = np.ones((2, size, size, 3), np.float32)
    comparison = Comparison(VIEWERS, flat, np.stack([2 * flat] * 2))
    names = ["a.very.long.name.of.a.probe." * 9, "W" * 200]
    sheet = comparison.picture("an.even.longer.name." * 9, names, 0, 123.456)
    layout = comparison_layout(2, 2, size)
    beside = np.ones(sheet.shape[:2], dtype=bool)
    for index in range(10):
        top, left = layout.origin(index)
        strip = tile(sheet, layout, index, below=True)
        assert strip.max() > (0.9 if size > 16 else 0.4)
        beside[top : top + size + layout.label_height, left : left + size] = False
    assert (sheet[beside] == GREY).all()


def test_sheets_have_a_largest_size():
    comparison_layout(2, 3, 2048)
    with pytest.raises(OutputError, match="smaller `size` or fewer maps"):
        comparison_layout(9, 3, 2048)
