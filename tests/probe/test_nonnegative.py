"""Light that is negative nowhere in place of a series that is, and what is made of it."""

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.probe.coarse import fine_probe
from shrm_cli.probe.lighting import project
from shrm_cli.probe.nonnegative import without_negatives
from shrm_cli.probe.open import open_probe
from tests import oracles

COLORS = np.array([3.0, 2.0, 0.7])


def lamps(directions, count=3):
    """A dim room with some broad lamps, which no channel has alike."""
    axes = oracles.random_directions(np.random.default_rng(4), count)
    light = 0.05 + 0 * directions[..., :1] + np.zeros(3)
    for axis, color in zip(axes, np.roll(COLORS, 1) * np.eye(3) + 0.5, strict=True):
        light = light + color * (directions @ axis > 0.8)[..., None]
    return light


@pytest.fixture(scope="module")
def rule():
    return oracles.sphere_rule(300)


def coefficients_of(light, order, rule):
    directions, weights = rule
    return oracles.real_harmonics(order, directions).T @ (weights[:, None] * light)


@pytest.mark.parametrize(("order", "allowed"), [(2, 0.002), (4, 0.02), (8, 0.05), (12, 0.05)])
def test_it_has_the_coefficients_and_is_negative_nowhere(order, allowed, rule):
    """Against sums over other points, with the harmonics of scipy; those to degree 8 are kept."""
    directions, _ = rule
    series = coefficients_of(lamps(directions), order, rule)
    plain = oracles.real_harmonics(order, directions) @ series
    assert plain.min() < -0.05 * plain.max()
    part = without_negatives(series)
    light = part.at(directions)
    assert light.min() == 0
    kept = (min(order, 8) + 1) ** 2
    wrong = coefficients_of(light, order, rule)[:kept] - series[:kept]
    assert np.linalg.norm(wrong) < allowed * np.linalg.norm(series[:kept])
    cut = coefficients_of(np.maximum(plain, 0), order, rule)[:kept] - series[:kept]
    assert np.linalg.norm(wrong) < 0.3 * np.linalg.norm(cut)
    assert part.negative_share == pytest.approx(
        (plain < 0).any(axis=1) @ rule[1] / 4 / np.pi, abs=0.01
    )


@pytest.mark.parametrize("order", [3, 8, 24])
def test_a_small_lamp_is_nearly_kept(order, rule):
    """Of a point only itself has the coefficients; surfaces receive the same to some percent."""
    directions, _ = rule
    axis = oracles.random_directions(np.random.default_rng(2))
    light = (directions @ axis > 0.99)[:, None] * np.ones(3)
    series = coefficients_of(50.0 * light + 0.01, order, rule)
    degree = np.repeat(np.arange(3), 2 * np.arange(3) + 1)
    received = np.array([1, 2 / 3, 1 / 4])[degree, None]
    found = coefficients_of(without_negatives(series).at(directions), 2, rule)
    wrong, whole = (np.linalg.norm(received * each) for each in (found - series[:9], series[:9]))
    assert wrong < 0.03 * whole


@pytest.mark.parametrize("order", [2, 4, 10])
def test_no_light_of_the_same_coefficients_is_nearer(order, rule):
    """Others are what the coefficients are of, and mixtures of both."""
    directions, weights = rule
    real = lamps(directions)
    series = coefficients_of(real, order, rule)
    plain = oracles.real_harmonics(order, directions) @ series
    found = without_negatives(series).at(directions)

    def distance(light):
        return np.sqrt(weights @ ((light - plain) ** 2).sum(axis=1))

    for share in (0.02, 0.2, 1.0):
        assert distance(found) < distance(found + share * (real - found)) + 1e-3 * distance(0)


def test_light_that_is_negative_nowhere_stays(rng):
    assert without_negatives(np.array([[1.0, 2.0, 3.0]])) is None
    assert without_negatives(np.zeros((9, 3))) is None
    series = 0.05 * rng.normal(size=(9, 3))
    series[0] = 2
    assert without_negatives(series) is None


def test_what_is_taken_away_from_other_light_is_left_alone(rng):
    """No light has coefficients whose mean is below 0."""
    assert without_negatives(np.array([[-1.0, -1.0, -1.0]])) is None
    series = rng.normal(size=(9, 3))
    series[0] = -1
    assert without_negatives(series) is None


@pytest.fixture
def nine(tmp_path, rule):
    """A file of nine coefficients that are negative on much of the sphere."""
    path = tmp_path / "nine.npy"
    np.save(path, coefficients_of(lamps(rule[0]), 2, rule))
    return path


def test_maps_of_coefficients_have_no_black_bands(nine):
    """The polished map is that of the light that pixels show; the matte one that of both."""
    with pytest.warns(shrm.ShrmWarning, match="negative in .* of directions; pixels and maps"):
        polished = shrm.prefilter(nine, "ggx:roughness=0.4")
    compared = shrm.compare([polished], nine, size=32, views=[(0, 0), (120, 20), (240, -20)])
    difference = compared.comparison.difference(0)
    assert difference.negative_share < 0.01
    assert difference.wrong_share < 0.05


@pytest.mark.parametrize("matrix", ["upright", "turned"])
def test_matte_surfaces_receive_what_the_coefficients_say(nine, matrix):
    options = {} if matrix == "upright" else {"yaw": 40, "pitch": 25}
    given, fine = open_probe(nine, **options), fine_probe(open_probe(nine, **options))
    assert fine.digest() == given.digest()
    expected, found = (project(each, 2).coefficients for each in (given, fine))
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-3 * np.abs(expected).max())
    pixels = project(fine, 40)
    assert pixels.coefficients[9:].any()
    assert (fine.image() >= 0).all()
    np.testing.assert_allclose(fine.image(), given.image(), atol=1e-5)


def test_split_sums_are_of_the_light_that_pixels_show(nine):
    with pytest.warns(shrm.ShrmWarning, match="of directions"):
        made = shrm.prefilter(nine, to="splitsum", size=32)
    assert all(level.min() > -0.01 * level.max() for level in made.levels)


def test_lamps_are_looked_for_in_what_pixels_show(nine):
    """What is left without any is the light itself, whose degrees do not end."""
    split = shrm.split_lamps(nine)
    assert split.proof.rms < 1e-3
    assert not split.changed


def test_it_is_added_to_other_lights_as_a_probe(tmp_path, nine):
    """A disc beside it stays exact, and nothing is counted twice."""
    nine.rename(tmp_path / "sh.npy")
    light = tmp_path / "light.toml"
    light.write_text(
        '[[sh]]\nfile = "sh.npy"\n\n'
        "[[disc]]\nazimuth = 30\nelevation = 40\nradius = 2\nirradiance = [2, 2, 2]\n"
    )
    given, fine = open_probe(light), fine_probe(open_probe(light))
    assert fine.series is None
    assert len(fine.terms) == len(fine.discs) == 1
    expected, found = project(given, 2), project(fine, 2)
    scale = np.abs(expected.coefficients).max()
    np.testing.assert_allclose(found.coefficients, expected.coefficients, atol=2e-3 * scale)
    assert any("of directions" in line for line in fine.warnings())
