"""The program of `make taps`: its norm, and that the package has what it finds."""

import numpy as np
import pytest

from research.taps.environment import turns
from research.taps.fit import (
    brushed_node,
    even_fitted,
    even_kinds,
    even_node,
    fitted,
    kinds,
    missed,
)
from research.taps.lobes import ORDER, Norm, view
from shrm_cli.brdf.environment.taps import EVEN_KINDS, KINDS, even_polynomials, polynomials
from shrm_cli.maps.splitsum.split_sum import TURNS
from shrm_cli.vocabulary import TAP_COUNTS
from tests import brushed_ggx
from tests.brute_force import unit

SPECTRUM = 1 / (1 + np.arange(ORDER + 1)) ** 2.5
"""Of light that is about as smooth as that of real probes."""


@pytest.fixture(scope="module")
def norm():
    return Norm(SPECTRUM)


@pytest.mark.parametrize("roughness", [0.3, 0.55, 1.0])
def test_lobes_of_levels_are_those_of_even_surfaces_that_face_the_viewer(norm, roughness):
    seen = view(1 - 1e-9, 0.3)
    lobe = norm.brushed((roughness**2, roughness**2), seen)
    np.testing.assert_allclose(
        norm.even(roughness, seen * [-1, -1, 1]), lobe, atol=3e-4 * np.linalg.norm(lobe)
    )


@pytest.mark.proof
def test_distances_are_errors_under_light_from_everywhere():
    """Of light of one degree: Legendre's polynomial about random axes."""
    degree = 3
    spectrum = np.zeros(ORDER + 1)
    spectrum[degree] = 1.0
    alphas, seen = (0.5, 0.2), view(0.6, 0.7)
    light, _ = brushed_ggx.directions(80)
    value, _ = brushed_ggx.lobe(alphas, np.eye(3), seen, light)
    cosines = unit(np.random.default_rng(1), 3000) @ light.T
    passed = (2.5 * cosines**3 - 1.5 * cosines) @ value / value.sum()
    # This light has coefficients of this mean square.
    square = 4 * np.pi / (2 * degree + 1) ** 2
    found = np.sum(Norm(spectrum).brushed(alphas, seen) ** 2)
    assert found == pytest.approx(np.mean(passed**2) / square, rel=0.07)


@pytest.mark.parametrize("count", TAP_COUNTS)
def test_the_package_has_polynomials_that_fit(norm, count):
    """Those of an even lobe about the mirror direction miss more than half of these lobes."""
    rows = polynomials(count)
    assert "".join(kind * len(rows[kind]) for kind in KINDS) == kinds(count)
    names = kinds(count)
    for alphas, seen, most in (
        ((0.52, 0.25), view(0.8, 0.3), 0.14),
        ((0.6, 0.3), view(0.4, 1.1), 0.2),
        ((0.42, 0.09), view(0.6, 0.7), 0.25),
    ):
        node = brushed_node(norm, alphas, seen)
        numbers = np.concatenate([rows[kind] @ node.basis for kind in KINDS])
        error = np.linalg.norm(missed(norm, node, numbers, names))
        mirror = 2 * seen[2] * np.array([0, 0, 1]) - seen
        even = norm.even(alphas[1] ** 0.5, mirror) - node.lobe
        assert error < min(most, 0.5 * np.linalg.norm(even) / np.linalg.norm(node.lobe))


@pytest.mark.parametrize(("count", "most"), [(1, 0.17), (2, 0.1), (3, 0.08)])
def test_the_package_has_polynomials_that_fit_even_lobes(norm, count, most):
    """A look-up about the mirror direction misses more than twice as much."""
    rows = even_polynomials(count)
    assert "".join(kind * len(rows[kind]) for kind in EVEN_KINDS) == even_kinds(count)
    ours, theirs = [], []
    for roughness in (0.45, 0.7, 0.93):
        for seen in (view(0.8, 0.0), view(0.5, 0.0), view(0.2, 0.0)):
            node = even_node(norm, roughness, seen)
            numbers = np.concatenate([rows[kind] @ node.basis for kind in EVEN_KINDS])
            ours.append(np.linalg.norm(missed(norm, node, numbers, even_kinds(count))))
            mirror = norm.even(roughness, seen * [-1, -1, 1]) - node.lobe
            theirs.append(np.linalg.norm(mirror) / np.linalg.norm(node.lobe))
    error = np.sqrt(np.mean(np.square(ours)))
    assert error < min(most, np.sqrt(np.mean(np.square(theirs))) / 2)


def test_a_fit_of_an_even_surface_is_closer_than_where_it_starts(norm):
    among = [even_node(norm, 0.6, view(z, 0.0)) for z in (0.9, 0.5, 0.3)]
    told = []
    found = even_fitted(2, norm, among, told.append)
    errors = [
        np.linalg.norm(missed(norm, each, found @ each.basis, even_kinds(2))) for each in among
    ]
    assert len(told) > 1
    assert max(errors) < 0.1


def test_a_fit_of_one_surface_is_closer_than_where_it_starts(norm):
    alphas = 0.52, 0.25
    among = [
        brushed_node(norm, alphas, seen)
        for seen in (view(0.9, 0.0), view(0.5, 0.8), view(0.3, 1.6))
    ]
    told = []
    found = fitted(3, norm, among, told.append)
    errors = [np.linalg.norm(missed(norm, node, found @ node.basis, kinds(3))) for node in among]
    assert len(told) > 1
    assert max(errors) < 0.12


def test_the_package_has_the_turns_that_fit():
    """And what they leave is what the page says."""
    for part, (found, left) in turns().items():
        np.testing.assert_allclose(TURNS[part], found, atol=2e-3)
        most = {"total": (0.023, 0.18), "bias": (0.003, 0.02)}[part]
        assert np.sqrt(np.mean(left**2)) < most[0]
        assert np.abs(left).max() < most[1]
