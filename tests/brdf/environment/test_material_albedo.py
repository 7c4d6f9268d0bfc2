"""Directional albedos against quadratures over the light's own angles, with models rewritten."""

import numpy as np
import pytest

from shrm_cli.brdf.base import Brdf, Parameter, grey
from shrm_cli.brdf.environment.environment_brdf import columns_table
from shrm_cli.brdf.environment.material_albedo import MaterialAlbedo, albedo_table, material_albedo
from shrm_cli.brdf.spec import parse_spec
from tests.makers import environment_brdf

COSINES = np.array([2e-4, 0.01, 0.06, 0.2, 0.45, 0.8, 1.0])


def charlie(r, light, view, h):
    """D / (4 (n.l + n.v - n.l n.v)), as Filament has it; the other shadowing is in test_lobes."""
    d = (2 + 1 / r) * np.sqrt(np.maximum(1 - h[..., 2] ** 2, 0)) ** (1 / r) / (2 * np.pi)
    nl, nv = light[..., 2], view[2]
    return d / (4 * (nl + nv - nl * nv))


def beckmann(m, light, view, h):
    nh, vh = h[..., 2], h @ view
    d = np.exp((1 - 1 / nh**2) / m**2) / (np.pi * m**2 * nh**4)
    nl, nv = light[..., 2], view[2]
    return d * np.minimum(1, 2 * nh * np.minimum(nl, nv) / vh) / (4 * nl * nv)


def ward(a, light, view, h):
    nh, vh = h[..., 2], h @ view
    return np.exp((1 - 1 / nh**2) / a**2) / (4 * np.pi * a**2 * vh**2 * nh**4)


MODELS = {
    "charlie:visibility=neubelt": charlie,
    "cook-torrance": beckmann,
    "ward": ward,
}


def rule(count):
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


def albedo(model, roughness, cosine):
    """Gauss's rule over the light's height and azimuth, dense at the horizon and behind."""
    x, wx = rule(1200)
    y, wy = rule(300)
    height, turn = (x**3)[:, None], np.pi * (1 - y**2)
    radius = np.sqrt(1 - height**2)
    light = np.stack(
        np.broadcast_arrays(radius * np.cos(turn), radius * np.sin(turn), height), axis=-1
    )
    view = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    half = light + view
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    value = model(roughness, light, view, half) * height
    return float(2 * np.einsum("ij,i,j->", value, 3 * x**2 * wx, 2 * np.pi * y * wy))


@pytest.mark.proof
@pytest.mark.parametrize("p", [0.4, 0.7, 1.0])
@pytest.mark.parametrize("spec", MODELS)
def test_albedos_are_integrals_over_the_light(spec, p):
    brdf = parse_spec(spec).at_roughness(p)
    expected = [albedo(MODELS[spec], p * p, cosine) for cosine in COSINES]
    np.testing.assert_allclose(material_albedo(brdf, COSINES)[:, 0], expected, atol=1e-4)
    kinks = 1e-3 if spec == "cook-torrance" else 2e-4
    np.testing.assert_allclose(MaterialAlbedo(brdf)(COSINES)[:, 1], expected, atol=kinks)


def test_ggx_has_the_albedo_of_its_own_table():
    for roughness in (0.1, 0.5, 1.0):
        scale, bias = environment_brdf(roughness, COSINES)
        brdf = parse_spec(f"ggx:roughness={roughness},f0=0.9/0.5/0.04")
        expected = scale[:, None] * [0.9, 0.5, 0.04] + bias[:, None]
        np.testing.assert_allclose(material_albedo(brdf, COSINES), expected, atol=3e-5)


class Chalk(Brdf):
    """A BRDF of a user's: white where it is rough, black where it is smooth."""

    parameters = (Parameter("roughness", 0.5, 0.2, 0.9),)
    center = "normal"

    def evaluate(self, light, view):
        above = (light[..., 2] > 0) & (view[..., 2] > 0)
        return grey(np.where(above, self.number("roughness") / np.pi, 0.0))


def test_rows_are_roughnesses_within_the_range_of_the_model():
    table = albedo_table(Chalk(), 8)
    rows = np.clip((np.arange(8) + 0.5) / 8, 0.2, 0.9)
    np.testing.assert_allclose(table, np.broadcast_to(rows[:, None, None], (8, 8, 3)), rtol=1e-6)


def test_a_third_column_gives_back_what_single_scattering_loses():
    lost, part = columns_table("fdez-aguera", 6), columns_table("turquin", 6)
    # At f0 = 1 the mean of Fresnel's term is 1, and both reflect all light.
    single, missing = lost[..., 0] + lost[..., 1], lost[..., 2]
    np.testing.assert_allclose(single * (1 + missing / (1 - missing)), 1, rtol=1e-12)
    np.testing.assert_allclose((part[..., 0] + part[..., 1]) * (1 + part[..., 2]), 1, rtol=1e-12)
    engine = columns_table("filament", 6)
    np.testing.assert_allclose(engine[..., 1], single, rtol=1e-12)
    for row, column in [(0, 1), (1, 0), (3, 1), (5, 4)]:
        p, cosine = (row + 0.5) / 6, (column + 0.5) / 6
        assert engine[row, column, 2] == pytest.approx(albedo(charlie, p * p, cosine), abs=1e-4)
