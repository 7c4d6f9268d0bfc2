"""The environment-BRDF against sums over the light's directions, written out again."""

import numpy as np
import pytest

from shrm_cli.brdf.environment.environment_brdf import (
    DirectionalAlbedo,
    environment_table,
    moments_table,
)
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.errors import MapError
from shrm_cli.progress import using
from tests.makers import environment_brdf

COSINES = [0.002, 0.02, 0.1, 0.4, 0.9]


def brute_force(roughness, cosine, polar=800, azimuths=1400):
    """Scale and bias by a million samples of L, dense about the mirror direction.

    In polar coordinates (t, p) about R: what is below the surface counts 0. The angle t is
    ``pi u^3``, so that sharp lobes and tails both get samples.
    """
    a2 = roughness**4
    view = np.array([np.sqrt(1 - cosine**2), 0, cosine])
    mirror = np.array([-view[0], 0, cosine])
    side = np.array([cosine, 0, view[0]])
    u = (np.arange(polar)[:, None] + 0.5) / polar
    t, p = np.pi * u**3, np.pi * (np.arange(azimuths) + 0.5) / azimuths
    weight = 2 * np.pi / azimuths * np.sin(t) * 3 * np.pi * u**2 / polar
    along, across = np.sin(t) * np.cos(p), np.sin(t) * np.sin(p)
    light = np.cos(t)[..., None] * mirror + along[..., None] * side
    light[..., 1] += across
    height = light[..., 2]
    half = light + view
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    d = a2 / (np.pi * (half[..., 0] ** 2 + half[..., 1] ** 2 + a2 * half[..., 2] ** 2) ** 2)
    above = np.maximum(height, 1e-12)
    lambdas = sum((np.sqrt(1 + a2 * (1 / c**2 - 1)) - 1) / 2 for c in (above, cosine))
    value = np.where(height > 0, d / (1 + lambdas) / (4 * cosine), 0) * weight
    tail = (1 - np.clip(half @ view, 0, 1)) ** 5
    return float(np.sum(value * (1 - tail))), float(np.sum(value * tail))


@pytest.mark.proof
@pytest.mark.parametrize("roughness", [0.05, 0.1, 0.3, 0.6, 1.0])
@pytest.mark.slow
def test_it_is_a_sum_of_a_million_samples(roughness):
    scale, bias = environment_brdf(roughness, COSINES)
    for cosine, one, other in zip(COSINES, scale, bias, strict=True):
        expected = brute_force(roughness, cosine)
        assert (one, other) == pytest.approx(expected, abs=1e-4), cosine


def test_it_is_the_albedo_of_the_model_that_it_belongs_to(rng):
    """Uniform samples of the package's own BRDF: 1 % is what a million of them can tell."""
    light = rng.normal(size=(1_000_000, 3))
    light[:, 2] = np.abs(light[:, 2])
    light /= np.linalg.norm(light, axis=1, keepdims=True)
    for cosine, f0 in [(0.3, 0.04), (0.9, 0.8)]:
        view = np.array([np.sqrt(1 - cosine**2), 0, cosine])
        values = Ggx(roughness=0.6, f0=f0).transfer(light, view)[:, 0]
        scale, bias = environment_brdf(0.6, [cosine])
        assert f0 * scale[0] + bias[0] == pytest.approx(2 * np.pi * values.mean(), rel=1e-2)


def test_roughness_1_seen_along_the_normal_has_a_closed_form():
    """For a = 1, D is 1 / pi: the integral of ``2 pi / pi * c / (2 (c + 1))`` over c = N.L."""
    scale, bias = environment_brdf(1.0, [1.0])
    assert scale[0] + bias[0] == pytest.approx(1 - np.log(2), abs=1e-9)


def test_a_smooth_surface_loses_nothing():
    cosines = np.linspace(0.05, 1, 20)
    for roughness, tolerance in [(0.0, 1e-15), (0.02, 1e-4), (0.05, 2e-3)]:
        scale, bias = environment_brdf(roughness, cosines)
        assert np.abs(scale + bias - 1).max() <= tolerance
        assert bias == pytest.approx((1 - cosines) ** 5, abs=max(3 * tolerance, 1e-15))


def test_more_nodes_change_nothing(monkeypatch):
    """The rule has converged, down to grazing views that no sum over L resolves."""
    cosines = np.concatenate([[1e-5, 1e-4, 1e-3], np.linspace(0.01, 1, 12)])
    for roughness in (0.01, 0.05, 0.15, 0.5, 1.0):
        once = environment_brdf(roughness, cosines)
        with monkeypatch.context() as patch:
            patch.setattr("shrm_cli.brdf.environment.environment_brdf._SLOPES", 120)
            patch.setattr("shrm_cli.brdf.environment.environment_brdf._AZIMUTHS", 120)
            again = environment_brdf(roughness, cosines)
        assert np.abs(np.subtract(once, again)).max() < 1e-5


@pytest.mark.parametrize("roughness", [0.0, 0.01, 0.05, 0.2, 0.7, 1.0])
def test_the_table_of_one_roughness_is_fine_enough(rng, roughness):
    cosines = np.concatenate([rng.uniform(0, 1, 300), 10 ** rng.uniform(-5, 0, 300)])
    f0 = (1.0, 0.5, 0.04)
    scale, bias = environment_brdf(roughness, cosines)
    expected = scale[:, None] * np.array(f0) + bias[:, None]
    found = DirectionalAlbedo(roughness)(cosines.reshape(20, 30), f0)
    assert found.shape == (20, 30, 3)
    assert np.abs(found.reshape(-1, 3) - expected).max() < 2e-5


def test_views_from_below_count_as_grazing():
    albedo = DirectionalAlbedo(0.3)
    assert np.array_equal(albedo([-0.5], (1, 1, 1)), albedo([0.0], (1, 1, 1)))


def test_tables_are_at_texel_centres_with_the_smoothest_row_first():
    table = environment_table(4)
    assert table.shape == (4, 4, 2)
    for row, column in [(0, 3), (2, 0), (3, 1)]:
        scale, bias = environment_brdf((row + 0.5) / 4, [(column + 0.5) / 4])
        assert table[row, column] == pytest.approx([scale[0], bias[0]], abs=1e-14)
    other = environment_table(4, multiscatter=True)
    assert np.array_equal(other[..., 0], table[..., 1])
    assert other[..., 1] == pytest.approx(table.sum(axis=-1), abs=1e-15)


def test_tables_tell_how_far_they_are():
    told = []
    with using(lambda *what: told.append(what)):
        environment_table(3)
    assert told == [(1, 3), (2, 3), (3, 3)]
    with using(lambda *what: told.append(what)):
        moments_table(2)
    assert told[3:] == [(1, 2), (2, 2)]


@pytest.mark.slow
def test_the_table_of_moments_holds_that_of_the_split_sum():
    moments, table = moments_table(5), environment_table(5)
    assert moments.shape == (5, 5, 6)
    assert moments[..., 0] == pytest.approx(table.sum(axis=-1), abs=1e-14)
    assert moments[..., 3] == pytest.approx(table[..., 1], abs=1e-14)
    # Within the lobe's own range, and for the smoothest along the mirror direction.
    sines = np.sqrt(1 - ((np.arange(5) + 0.5) / 5) ** 2)
    assert (np.hypot(moments[..., 1], sines * moments[..., 2]) <= moments[..., 0]).all()
    smooth = moments_table(100)[0]
    cosines = (np.arange(100) + 0.5) / 100
    assert smooth[:, 1] == pytest.approx(cosines, abs=1e-3)
    assert smooth[:, 2] == pytest.approx(np.ones(100), abs=1e-2)


@pytest.mark.parametrize("roughness", [-0.1, 1.01, float("nan")])
def test_roughness_has_a_range(roughness):
    with pytest.raises(MapError, match=r"outside 0 \.\. 1"):
        environment_brdf(roughness, [0.5])
    with pytest.raises(MapError, match=r"outside 0 \.\. 1"):
        DirectionalAlbedo(roughness)
