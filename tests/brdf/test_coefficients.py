"""BRDF coefficients against independent quadrature and closed forms."""

import numpy as np
import pytest
from scipy import integrate
from scipy.special import eval_legendre, sph_harm_y

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import octaves_to_come
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.errors import BrdfError
from tests import brute_force


def test_lambertian_coefficients_of_equation_4_12():
    """A_l = pi, 2 pi / 3, pi / 4, 0, -pi / 24, 0."""
    values = compute_coefficients(parse_spec("lambertian"), 5, 0).values[:, 0, 0, 0]
    degree = np.arange(6)
    # rho_hat_l00 Y_00 = A_l / pi sqrt((2l+1) / 4 pi): radiance is irradiance over pi.
    found = values / np.sqrt(4 * np.pi) * np.sqrt(4 * np.pi / (2 * degree + 1)) * np.pi
    expected = np.pi * np.array([1, 2 / 3, 1 / 4, 0, -1 / 24, 0])
    np.testing.assert_allclose(found, expected, atol=1e-14)


@pytest.mark.parametrize("exponent", [0.0, 2.5, 32.0, 700.0])
def test_phong_coefficients_against_adaptive_quadrature(exponent):
    coefficients = compute_coefficients(parse_spec(f"phong:exponent={exponent}"), 20, 0)

    def integrand(z, degree):
        return (exponent + 1) / (2 * np.pi) * z**exponent * eval_legendre(degree, z)

    for degree in (0, 1, 2, 3, 9, 20):
        integral = integrate.quad(integrand, 0, 1, (degree,), epsabs=1e-13, points=[0.9, 0.99])[0]
        expected = (
            np.sqrt(4 * np.pi) * 2 * np.pi * np.sqrt((2 * degree + 1) / (4 * np.pi)) * integral
        )
        np.testing.assert_allclose(coefficients.values[degree, 0, 0], expected, atol=1e-10)
    # 4 pi times 2 pi int u^2 dz
    energy = 8 * np.pi**2 * ((exponent + 1) / (2 * np.pi)) ** 2 / (2 * exponent + 1)
    np.testing.assert_allclose(coefficients.total_energy, energy, rtol=1e-10)


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize("sigma", [0.3, 0.8])
def test_microfacet_coefficients_against_monte_carlo_free_brute_force(sigma):
    """Full integral over w_i' and w_o' in world space, with another rule and scipy's Y_lm."""
    coefficients = compute_coefficients(parse_spec(f"microfacet:sigma={sigma}"), 32, 8, 1e-6)
    reflection = np.array([0.0, 0.0, 1.0])
    formula = brute_force.microfacet(sigma)
    light, weights = brute_force.sphere_rule(180)
    z, view_weights = np.polynomial.legendre.leggauss(40)
    theta_i, phi_i = np.arccos(light[:, 2]), np.arctan2(light[:, 1], light[:, 0])
    wanted = [(0, 0, 0), (1, 0, 0), (3, 1, 1), (4, 2, 0), (7, 3, 2), (12, 4, 3)]
    found = dict.fromkeys(wanted, 0.0)
    energy = 0.0
    for cosine, weight in zip(z, view_weights, strict=True):
        view = np.array([np.sqrt(1 - cosine**2), 0, cosine])
        rho = formula(reflection, view, light) * weights
        energy += 2 * np.pi * weight * np.sum(rho**2 / weights)
        for degree, p, q in wanted:
            # By isotropy the integral over phi_o is 2 pi times its value at phi_o = 0.
            left = np.sum(rho * sph_harm_y(degree, q, theta_i, phi_i))
            right = np.conj(sph_harm_y(p, q, np.arccos(cosine), 0.0))
            found[degree, p, q] += 2 * np.pi * weight * (left * right).real
    scale = np.sqrt(coefficients.total_energy[0])
    for degree, p, q in wanted:
        assert abs(found[degree, p, q] - coefficients.values[degree, p, q, 0]) < 2e-3 * scale
    np.testing.assert_allclose(coefficients.total_energy, energy, rtol=2e-3)


class Shifted(Brdf):
    """A coloured band-limited lobe about the normal whose value depends on the azimuth."""

    name = "shifted"
    summary = source = "test"
    center = "normal"
    includes_cosine = True

    def evaluate(self, light, view):
        cosine = np.sum(light * view, axis=-1)
        value = (1 + cosine) ** 2  # band-limited at 2, and not cut at the horizon
        return np.stack([value, 0 * value, 2 * value], axis=-1)


def test_horizon_is_cut_exactly_enough_and_channels_are_kept_apart():
    coefficients = compute_coefficients(Shifted(), 24, 24, 1e-7)
    np.testing.assert_array_equal(coefficients.values[..., 1], 0)
    # Most coefficients of the polynomial are 0, of which only rounding errors are left.
    np.testing.assert_allclose(
        coefficients.values[..., 2], 2 * coefficients.values[..., 0], atol=1e-13
    )
    assert coefficients.total_energy[1] == 0
    view, view_weights = brute_force.sphere_rule(12)
    z, weights = np.polynomial.legendre.leggauss(12)
    z, weights = (z + 1) / 2, weights / 2  # the upper half of the sphere alone
    phi = 2 * np.pi * np.arange(12) / 12
    sine = np.sqrt(1 - z**2)[:, None]
    light = np.stack(
        [sine * np.cos(phi), sine * np.sin(phi), np.broadcast_to(z[:, None], (12, 12))], axis=-1
    ).reshape(-1, 3)
    product = (1 + light @ view.T) ** 2
    energy = np.repeat(weights * 2 * np.pi / 12, 12) @ product**2 @ view_weights
    np.testing.assert_allclose(coefficients.total_energy[0], energy, rtol=1e-9)


def test_energy_of_degrees_bounds_the_expansion():
    coefficients = compute_coefficients(parse_spec("microfacet:sigma=0.4"), 32, 8)
    by_degree = coefficients.energies.sum(axis=1)
    assert (by_degree <= coefficients.degree_energy * (1 + 1e-6) + 1e-9).all()
    assert (coefficients.degree_energy.sum(axis=0) <= coefficients.total_energy * 1.0002).all()
    captured = coefficients.captured
    assert (np.diff(captured, axis=0) >= 0).all()
    assert (np.diff(captured, axis=1) >= 0).all()
    assert 0.99 < captured[-1, -1] < 1.0002


def test_next_to_no_energy_can_be_asked_for():
    """The energy beyond F, in units of what is allowed, is beyond the doubles here."""
    rough = compute_coefficients(parse_spec("ggx:roughness=0.5"), 32, 0)
    assert octaves_to_come(rough, 1e-320) == octaves_to_come(rough, 1e-12) > 0


class Broken(Shifted):
    def evaluate(self, light, view):
        return np.full((*np.broadcast_shapes(light.shape[:-1], view.shape[:-1]), 3), np.nan)


def test_values_that_are_not_finite_are_refused():
    with pytest.raises(BrdfError, match="not finite"):
        compute_coefficients(Broken(), 4, 2)
