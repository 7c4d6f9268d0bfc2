"""Irradiance, split sums and exponentials with gradients, beside the numpy code's own maps."""

from itertools import pairwise

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.brdf.environment.lobe import GgxLobe
from shrm_cli.maps.she.prefilter import Problem, fit_logarithm
from shrm_cli.maps.splitsum.core import expand
from shrm_cli.maps.splitsum.prefilter import level_lobe, make_levels
from shrm_cli.probe.lighting import project
from tests.oracles import random_directions
from tests.torch.setup import has_right_gradients, torch, variable

from shrm_cli.torch import (  # isort: skip
    Exponential,
    GgxMultipliers,
    Irradiance,
    SplitSumLevels,
    SplitSumRadiance,
)
from tests.makers import environment_brdf

pytestmark = pytest.mark.filterwarnings("ignore:.*(negative radiance|fit to this light)")


def seen(rng, count):
    normals, views = random_directions(rng, count), random_directions(rng, count)
    cosines = np.sum(normals * views, axis=-1)
    return normals * np.sign(cosines)[:, None], views


def light_of(path, order):
    probe = shrm.open_probe(path)
    return probe, torch.from_numpy(project(probe, order).coefficients)


@pytest.mark.parametrize("name", ["city", "night", "studio"])
def test_irradiance_is_that_of_the_map(real_probes, rng, name):
    probe, light = light_of(real_probes / f"{name}.exr", 4)
    normals = [*random_directions(rng, 40), [0, 0, 1], [0, 0, -1]]
    made = shrm.prefilter(probe, to="irradiance", order_f=4, window="none")
    expected = made.irradiance(normals)
    np.testing.assert_allclose(Irradiance(4, normals)(light), expected, rtol=1e-6)


@pytest.mark.parametrize("roughness", [0.05, 0.11, 0.37, 0.82, 1.0])
def test_multipliers_are_integrals_of_the_lobe(roughness):
    """By scipy's rule and Legendre polynomials, beside the interpolated ones."""
    from scipy.integrate import quad
    from scipy.special import eval_legendre

    lobe = GgxLobe(roughness=roughness)
    found = GgxMultipliers(30)(torch.tensor([roughness], dtype=torch.float64))[0]
    for degree in (0, 1, 2, 7, 30):

        def integrand(angle, degree=degree):
            value = lobe.radial(np.sin(angle / 2) ** 2) * eval_legendre(degree, np.cos(angle))
            return 2 * np.pi * value * np.sin(angle)

        knots = [0, 0.01, 0.1, 1]
        parts = [
            quad(integrand, low * np.pi / 2, high * np.pi / 2, epsabs=1e-11, limit=200)[0]
            for low, high in pairwise(knots)
        ]
        assert float(found[degree]) == pytest.approx(sum(parts), abs=1e-9)


@pytest.mark.parametrize("name", ["forest", "night"])
def test_levels_are_those_of_a_split_sum(real_probes, name):
    """The numpy code chooses the degrees that a level keeps, and where they fade out."""
    probe = shrm.open_probe(real_probes / f"{name}.exr")
    (cube,), (info,) = make_levels(probe, [0.5], 16, sizes=[16])
    lobe = level_lobe(0.5, 5e-4, probe.height, 16)
    lighting = project(probe, lobe.light_order)
    carried = len(expand(lighting, lobe.coefficients, 5e-4).multipliers) - 1
    levels = SplitSumLevels(carried, 16, whole=info.order_f)
    light = torch.from_numpy(lighting.coefficients)
    found = levels(light, torch.tensor([0.5], dtype=torch.float64))[0]
    np.testing.assert_allclose(found, cube, atol=1e-6 * np.abs(cube).max())


def test_surfaces_reflect_what_the_formula_says(rng):
    normals, views = seen(rng, 20)
    uniform = torch.zeros(81, 3, dtype=torch.float64)
    uniform[0] = np.sqrt(4 * np.pi)  # a light of radiance 1
    module = SplitSumRadiance(8, normals, views)
    for roughness in (0.06, 0.3, 0.9):
        f0 = torch.tensor([0.04, 0.5, 1.0], dtype=torch.float64)
        found = module(uniform, torch.tensor(roughness).double(), f0)
        scale, bias = environment_brdf(roughness, np.sum(normals * views, axis=-1))
        expected = scale[:, None] * f0.numpy() + bias[:, None]
        np.testing.assert_allclose(found, expected, atol=2e-5)


def test_exponentials_are_those_of_the_map(real_probes, rng):
    normals, views = seen(rng, 60)
    probe = shrm.open_probe(real_probes / "city.exr")
    for law in ("lobe", "paper"):
        made = shrm.prefilter(probe, to="she", roughness=(0.5, 0.8), law=law)
        expected = made.shaded(0.6, (0.3, 0.3, 0.3)).radiance(normals, views)
        module = Exponential(made, normals, views, 0.6, 0.3)
        found = module(torch.from_numpy(made.coefficients))
        np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_exponentials_are_fitted_as_numpy_fits_them(real_probes, rng):
    probe = shrm.open_probe(real_probes / "city.exr")
    made = shrm.prefilter(probe, to="she", roughness=(0.5, 0.8), law="paper")
    normals, views = seen(rng, 90)
    module = Exponential(made, normals, views, 0.6)
    radiance, weights = rng.uniform(0.1, 3, (90, 3)), rng.uniform(0.5, 1, 90)
    rows, target = module.rows.numpy(), radiance / module.albedo.numpy()[:, None]
    problems = [Problem(rows, np.zeros_like(rows), target[:, c], weights) for c in range(3)]
    expected = np.stack([fit_logarithm(each) for each in problems], axis=-1)
    found = module.fit(torch.from_numpy(radiance), torch.from_numpy(weights))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_gradients(real_probes, rng):
    normals, views = seen(rng, 20)
    roughness = variable(2, low=0.2, high=0.8, seed=3)
    assert has_right_gradients(Irradiance(2, normals), variable(9, 2))
    assert has_right_gradients(GgxMultipliers(4), roughness)
    assert has_right_gradients(SplitSumLevels(3, 3), variable(16, 1), roughness)
    one = variable(low=0.3, high=0.7)
    few = SplitSumRadiance(3, normals[:5], views[:5])
    assert has_right_gradients(few, variable(16, 3), one, variable(3, seed=5))
    made = shrm.prefilter(
        shrm.open_probe(real_probes / "city.exr"), to="she", roughness=(0.5, 0.8), p_order=1,
        q_order=1,
    )  # fmt: skip
    exponential = Exponential(made, normals, views, 0.6)
    assert has_right_gradients(exponential, variable(7, 2))
    assert has_right_gradients(exponential.fit, variable(20, 1, low=0.5, high=2.0))


def test_roughness_beyond_what_is_known_is_that_at_the_end():
    found = GgxMultipliers(6)(torch.tensor([0.0, 0.05, 1.0, 1.5], dtype=torch.float64))
    np.testing.assert_allclose(found[0], found[1], atol=1e-12)
    np.testing.assert_allclose(found[3], found[2], atol=1e-12)
