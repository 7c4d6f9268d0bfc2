"""Rules over the angle from the central direction, against integrals that are known."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import eval_legendre

from shrm_cli.brdf.polar_rule import (
    PolarRule,
    SplitRule,
    squeezed_azimuths,
    transfer_samples,
    view_nodes,
)

RULES = [PolarRule(), PolarRule(0.3), PolarRule(0.02), SplitRule(below=True)]


@pytest.mark.parametrize("rule", RULES)
def test_polynomials_are_integrated(rule):
    """Legendre's polynomials are orthogonal, and the integral of exp(3 z) is known."""
    theta, weights = rule.nodes(216)
    z = np.cos(theta)
    assert (np.diff(theta) > 0).all()
    for one in range(6):
        for other in range(6):
            found = weights @ (eval_legendre(one, z) * eval_legendre(other, z))
            expected = 2 / (2 * one + 1) if one == other else 0
            assert found == pytest.approx(expected, abs=1e-9)
    assert weights @ np.exp(3 * z) == pytest.approx(2 * np.sinh(3) / 3, rel=1e-9)


def test_the_upper_half_alone():
    theta, weights = SplitRule().nodes(12)
    z = np.cos(theta)
    assert z.min() > 0
    for power in range(11):
        assert weights @ z**power == pytest.approx(1 / (power + 1), abs=1e-14)


@pytest.mark.parametrize("width", [0.3, 0.03, 0.003])
def test_focused_rules_resolve_sharp_lobes(width):
    """With 96 nodes, whatever the width; the even rule needs a multiple of 1 / width."""
    theta, weights = PolarRule(width).nodes(96)
    kappa = 1 / width**2
    # int exp(kappa (z - 1)) dz
    expected = -np.expm1(-2 * kappa) / kappa
    assert weights @ np.exp(kappa * (np.cos(theta) - 1)) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("rule", [PolarRule(), PolarRule(0.05), SplitRule(), SplitRule(below=True)])
def test_every_third_node_is_a_node_of_the_coarser_rule(rule):
    np.testing.assert_allclose(rule.nodes(54)[0][1::3], rule.nodes(18)[0], rtol=1e-12)


@pytest.mark.parametrize("rule", [PolarRule(), PolarRule(0.05), SplitRule(), SplitRule(below=True)])
def test_parameters_count_nodes(rule):
    theta, _ = rule.nodes(24)
    cells = rule.parameter(theta) * 24 / np.pi
    np.testing.assert_allclose(cells, np.arange(24) + 0.5, rtol=1e-9)


@pytest.mark.parametrize("center", ["reflection", "normal", "tangent"])
def test_views_are_dense_where_they_graze(center):
    theta, weights = view_nodes(center, 96)
    grazing = {"reflection": np.pi, "normal": np.pi / 2, "tangent": None}[center]
    assert weights.sum() == pytest.approx(2, rel=1e-12)
    assert (np.diff(theta) > 0).all()
    np.testing.assert_allclose(theta[1::3], view_nodes(center, 32 - 32 % 2)[0], rtol=1e-12)
    assert weights @ np.cos(theta) ** 2 == pytest.approx(2 / 3, rel=1e-12)
    if grazing is not None:
        assert np.abs(theta - grazing).min() < np.pi / 96 / 4


def test_squeezed_azimuths_integrate_narrow_ellipses():
    """``int dphi / (cos^2 + sin^2 / c^2) = pi c`` over half a turn, in the principal case."""
    cosine = np.array([1.0, 0.3, 0.02])
    phi, weights = squeezed_azimuths(60, np.sqrt(cosine))
    squares = np.cos(phi) ** 2 + np.sin(phi) ** 2 / cosine[:, None] ** 2
    np.testing.assert_allclose(np.sum(weights / squares, axis=1), np.pi * cosine, rtol=1e-6)
    even, thirds = squeezed_azimuths(60, cosine)[0], squeezed_azimuths(20, cosine)[0]
    np.testing.assert_allclose(even[:, 1::3], thirds, rtol=1e-12)


def heights(center):
    """A surface that reflects as much as the light is high above its horizon."""
    return SimpleNamespace(
        center=center, has_horizon=True, is_measured=False, transfer=lambda light, _: light[..., 2:]
    )


def test_cells_that_the_horizon_cuts_take_the_value_just_above_it():
    phi = np.linspace(0, np.pi, 7)[None]
    cut = []
    for _, values, coverage in transfer_samples(
        heights("reflection"), PolarRule(), 96, np.array([0.9]), phi
    ):
        if coverage is not None:
            cut.append(values[(coverage > 0) & (coverage <= 0.5)])
    found = np.concatenate(cut)
    assert len(found) > 1
    assert (found > 0).all()
    assert found.max() < 1e-8


def test_no_cell_is_cut_where_the_horizon_lies_between_two():
    """The last node of the split rule is next to it, and rounding cuts off a part of 1e-6."""
    samples = transfer_samples(
        heights("normal"), SplitRule(), 192, np.array([0.9]), np.zeros((1, 4))
    )
    assert all(coverage is None for _, _, coverage in samples)
