"""Widths of lobes and their means over the azimuth, against closed forms and brute force."""

import numpy as np
import pytest

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe import (
    azimuthal_mean,
    cuts_horizon,
    interpolate_mean,
    lobe_angle,
    lobe_tail,
    zonal_support,
)
from shrm_cli.brdf.spec import parse_spec
from tests import brute_force


class Coloured(Brdf):
    """A wide red lobe and a narrow blue one about the mirror direction; no green."""

    name = "coloured"
    summary = source = "this test"
    includes_cosine = True
    has_horizon = False

    def evaluate(self, light, view):
        mirrored = view * [-1, -1, 1]
        cosine = np.clip(np.sum(light * mirrored, axis=-1), 0, 1)
        return np.stack([cosine, 0 * cosine, cosine**9], axis=-1)


@pytest.mark.parametrize("tolerance", [0.001, 0.03, 0.3])
@pytest.mark.parametrize("exponent", [0, 3, 64, 2e4])
def test_phong_lobe_is_that_of_equation_5_30(exponent, tolerance):
    angle = lobe_angle(parse_spec(f"phong:exponent={exponent}"), tolerance)
    np.testing.assert_allclose(np.cos(angle), tolerance ** (1 / (exponent + 1)), atol=1e-7)


def test_lambertian_lobe_includes_the_cosine():
    """int cos sin = sin^2 / 2."""
    assert lobe_angle(parse_spec("lambertian"), 0.25) == pytest.approx(np.pi / 3, abs=1e-6)


def test_channels_of_a_lobe_are_summed():
    """int_0^x (c + c^9) sin = (1 - c^2) / 2 + (1 - c^10) / 10, that of the whole is 0.6."""
    cosine = np.cos(lobe_angle(Coloured(), 0.1))
    missed = 1 - ((1 - cosine**2) / 2 + (1 - cosine**10) / 10) / 0.6
    assert missed == pytest.approx(0.1, abs=1e-5)


def test_tolerances_at_both_ends():
    brdf = parse_spec("phong:exponent=8")
    assert lobe_angle(brdf, 0) == pytest.approx(np.pi / 2, rel=0.01)
    assert lobe_angle(brdf, 1) == 0
    assert lobe_angle(parse_spec("lambertian:albedo=0"), 0.01) == 0


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.5])
def test_microfacet_lobe_against_brute_force(sigma):
    rho_hat = brute_force.microfacet(sigma)
    light, weights = brute_force.sphere_rule(160)
    nodes, view_weights = np.polynomial.legendre.leggauss(40)
    inside = dict.fromkeys((0.01, 0.1), 0.0)
    angles = {tolerance: lobe_angle(parse_spec(f"microfacet:sigma={sigma}"), tolerance)
              for tolerance in inside}  # fmt: skip
    total = 0.0
    reflection = np.array([0.0, 0.0, 1.0])
    for cosine, view_weight in zip(nodes, view_weights, strict=True):
        view = np.array([np.sqrt(1 - cosine**2), 0, cosine])
        values = rho_hat(reflection, view, light) * weights * view_weight
        total += values.sum()
        for tolerance, angle in angles.items():
            inside[tolerance] += values[light[:, 2] >= np.cos(angle)].sum()
    for tolerance, energy in inside.items():
        assert 1 - energy / total == pytest.approx(tolerance, rel=0.1, abs=1e-3)


@pytest.mark.parametrize("sigma", [0.05, 0.3])
@pytest.mark.parametrize("theta_o", [0.3, 1.5, 2.6])
def test_azimuthal_mean_against_brute_force(sigma, theta_o):
    """At 2.6 rad the normal is tilted by 1.3: the horizon cuts into the lobe."""
    cosines, means = azimuthal_mean(parse_spec(f"microfacet:sigma={sigma}"), theta_o)
    rho_hat = brute_force.microfacet(sigma)
    phi = 2 * np.pi * (np.arange(4000) + 0.5) / 4000
    view = np.array([np.sin(theta_o), 0, np.cos(theta_o)])
    peak = 0.0
    for k in (0, 40, 130, 300, 600, 1000, 1400, 2047):
        sine = np.sqrt(max(1 - cosines[k] ** 2, 0))
        light = np.stack([sine * np.cos(phi), sine * np.sin(phi), 0 * phi + cosines[k]], axis=-1)
        samples = rho_hat(np.array([0.0, 0.0, 1.0]), view, light)
        peak = max(peak, samples.max())
        np.testing.assert_allclose(means[k], samples.mean(), atol=2e-4 * peak)
    assert (means > 0.01 * peak).any()


def test_azimuthal_mean_of_a_zonal_lobe_is_the_lobe():
    cosines, means = azimuthal_mean(parse_spec("phong:exponent=6"), 1.0)
    assert cosines[0] == 1
    assert cosines[-1] == -1
    expected = 7 / (2 * np.pi) * np.maximum(cosines, 0) ** 6
    np.testing.assert_allclose(means, np.repeat(expected[:, None], 3, axis=1), atol=1e-12)


@pytest.mark.parametrize("colours", [(1, 1, 1), (1, 2, 3)])
def test_interpolated_means(colours, rng):
    chords = np.linspace(0, 1, 501)
    means = np.exp(-3 * chords)[:, None] * colours
    cosines = rng.uniform(-1, 1, (40, 7))
    expected = np.exp(-3 * np.sqrt((1 - cosines) / 2))[..., None] * colours
    found = interpolate_mean(cosines, means)
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    assert (found.strides[-1] == 0) == (colours == (1, 1, 1))
    ends = interpolate_mean(np.array([1 + 1e-7, -1 - 1e-7], dtype=np.float32), means)
    np.testing.assert_allclose(ends, means[[0, -1]])


@pytest.mark.parametrize("spec", ["microfacet:sigma=0.4", "phong:exponent=5"])
def test_tail_is_the_lobe_outside_the_angle(spec, rng):
    whole = parse_spec(spec)
    tail = lobe_tail(whole, 0.5)
    light, view = brute_force.unit(rng, 500), brute_force.unit(rng, 500)
    light[:, 2], view[:, 2] = abs(light[:, 2]), abs(view[:, 2])
    if whole.zonal:  # the frame of the centre
        view = np.array([0.0, 0.0, 1.0])
    angles = np.arccos(np.sum(light * (view * [-1, -1, 1]), axis=-1))
    expected = whole.transfer(light, view) * (angles > 0.5)[:, None]
    np.testing.assert_array_equal(tail.transfer(light, view), expected)
    assert 0 < np.count_nonzero(expected) < expected.size
    assert tail.transfer(light, view).strides[-1] == 0
    assert (tail.center, tail.zonal) == (whole.center, whole.zonal)
    assert cuts_horizon(tail) == cuts_horizon(whole)


def test_tail_about_the_normal():
    tail = lobe_tail(parse_spec("lambertian"), np.pi / 3)
    light = np.array([[np.sin(t), 0, np.cos(t)] for t in (0.9, 1.2, 1.7)])
    values = tail.transfer(light, np.array([0.6, 0, 0.8]))
    np.testing.assert_allclose(values[:, 1], [0, np.cos(1.2) / np.pi, 0])


def test_support_of_zonal_lobes():
    angle = zonal_support(parse_spec("phong:exponent=512"))
    assert np.arccos(1e-30 ** (1 / 512)) <= angle < np.arccos(1e-31 ** (1 / 512))
    assert zonal_support(parse_spec("phong:exponent=0")) == pytest.approx(np.pi / 2)
    assert zonal_support(parse_spec("lambertian:albedo=0")) == 0


def test_what_cuts_at_the_horizon():
    specs = ["lambertian", "microfacet", "phong"]
    assert [cuts_horizon(parse_spec(spec)) for spec in specs] == [True, True, False]
