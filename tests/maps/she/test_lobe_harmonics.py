"""Harmonics of a BRDF's lobe against sums over directions of light, through scipy's harmonics."""

from functools import cache

import numpy as np
import pytest

from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.models.phong import Phong
from shrm_cli.maps.she.reflectance import lobe_harmonics
from tests import ggx, oracles

SAMPLES = 64, 24
ANGLES = np.array([0.0, 0.35, 1.2, 2.0, 2.8])


def around_mirror(theta, azimuth=0.0):
    """R = +Z, the view at an angle from it, and their normal."""
    reflection = np.array([0.0, 0.0, 1.0])
    view = oracles.turn("z", azimuth) @ [np.sin(theta), 0.0, np.cos(theta)]
    total = reflection + view
    return total / np.linalg.norm(total), view


def integrals(roughness, theta, order, azimuth=0.0):
    """All real harmonics of the lobe and its tail, over a fine grid: (2, (order+1)^2)."""
    light, weighted = weighted_harmonics(order)
    normal, view = around_mirror(theta, azimuth)
    base, tail = ggx.lobe(roughness, normal, view, light)
    return np.stack([base, base * tail]) @ weighted


@cache
def weighted_harmonics(order):
    light, weights = oracles.sphere_rule(240)
    return light, oracles.real_harmonics(order, light) * weights[:, None]


def error(found, expected):
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


def index(order, m):
    degree = np.arange(abs(m), order + 1)
    return degree * (degree + 1) + m


@pytest.mark.slow
@pytest.mark.parametrize(
    ("roughness", "order"), [pytest.param(0.45, 10, marks=pytest.mark.proof), (0.8, 8)]
)
def test_they_are_integrals_over_the_light(roughness, order):
    brdf = Ggx(roughness=roughness, f0=(1.0, 0.0, 0.0))
    found = lobe_harmonics(brdf, ANGLES, order, order, SAMPLES)
    assert found.shape == (order + 1, order + 1, len(ANGLES), 3)
    for k, theta in enumerate(ANGLES):
        expected = integrals(roughness, theta, order)
        for kind in range(2):
            both = [
                (found[m, : order + 1 - m, k, kind], expected[kind, index(order, m)])
                for m in range(order + 1)
            ]
            # Of the tail, a few thousandths at the horizon are what remains.
            bound = 0.003 if kind == 0 else 0.02
            assert error(*map(np.concatenate, zip(*both, strict=True))) < bound, (theta, kind)
        np.testing.assert_array_equal(found[..., k, 1], found[..., k, 2])
        sines = np.concatenate([index(order, -m) for m in range(1, order + 1)])
        assert np.abs(expected[:, sines]).max() < 1e-6  # the lobe is even


def test_what_is_beyond_the_order_is_0():
    found = lobe_harmonics(Ggx(roughness=0.6), ANGLES, 6, 4, SAMPLES)
    assert found.shape == (5, 7, len(ANGLES), 3)
    for m in range(1, 5):
        assert not found[m, 7 - m :].any()
        assert found[m, : 7 - m].any()


def test_fewer_harmonics_are_a_part_of_more():
    brdf = Ggx(roughness=0.7)
    many, few = (
        lobe_harmonics(brdf, ANGLES, order, max_m, SAMPLES) for order, max_m in [(9, 9), (5, 3)]
    )
    for m in range(4):
        np.testing.assert_allclose(
            few[m, : 6 - m], many[m, : 6 - m], rtol=0, atol=1e-14 * np.abs(many).max()
        )


@pytest.mark.parametrize("azimuth", [0.7, -2.5])
def test_a_view_in_another_azimuth_turns_the_lobe(azimuth):
    """Of cos(m phi), cos(m (phi - a)): a cosine and a sine harmonic, with their signs."""
    order, roughness, theta = 8, 0.6, 1.2
    found = lobe_harmonics(
        Ggx(roughness=roughness, f0=1.0), np.array([theta]), order, order, SAMPLES
    )[..., 0, 0]
    expected = integrals(roughness, theta, order, azimuth)[0]
    turned = np.zeros((order + 1) ** 2)
    for m in range(order + 1):
        turned[index(order, -m)] = np.sin(m * azimuth) * found[m, : order + 1 - m]
        turned[index(order, m)] = np.cos(m * azimuth) * found[m, : order + 1 - m]
    assert error(turned, expected) < 0.002
    assert np.abs(turned[index(order, -1)]).max() > 0.01


def test_light_comes_from_the_far_side_of_the_normal():
    """Rough lobes lean from R towards N, which is on the side of the view: m = 1 has that sign."""
    first = lobe_harmonics(Ggx(roughness=0.8, f0=1.0), np.array([1.2]), 1, 1, SAMPLES)[1, 0, 0, 0]
    normal, view = around_mirror(1.2)
    light, weights = oracles.sphere_rule(200)
    lean = ggx.lobe(0.8, normal, view, light)[0] * weights @ light[:, 0]
    assert first == pytest.approx(np.sqrt(3 / (4 * np.pi)) * lean, rel=0.01)
    assert first > 0.01


def test_phong_has_the_closed_form_of_its_powers():
    """``(n+1) / (2 pi) cos^n``: m = 0 alone, and ``1, (n+1) / (n+2)`` of degrees 0 and 1."""
    found = lobe_harmonics(Phong(exponent=8.0), ANGLES, 4, 2, SAMPLES)
    zero = np.sqrt(1 / (4 * np.pi)) * np.ones(len(ANGLES))
    assert found[0, 0, :, 0] == pytest.approx(zero, rel=1e-6)
    assert found[0, 1, :, 0] == pytest.approx(zero * np.sqrt(3) * 9 / 10, rel=1e-6)
    assert np.abs(found[1:]).max() < 1e-12
