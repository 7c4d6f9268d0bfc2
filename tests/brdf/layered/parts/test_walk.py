"""The random walk in coats: what its border must keep, and what is known of it without a walk."""

import numpy as np
import pytest
from scipy.integrate import quad

from shrm_cli.brdf.layered.parts import walk
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError
from tests import ggx
from tests.brdf.layered.test_coated import fresnel, seen
from tests.brdf.models.test_analytic import upper


@pytest.mark.parametrize(("roughness", "degrees"), [(0.3, 20), (0.6, 50), (0.9, 75)])
def test_light_leaves_facets_at_once_as_often_as_ggx_says(monkeypatch, rng, roughness, degrees):
    """What meets no second facet is the albedo of GGX, which loses the rest."""
    counts = []

    def mirror(cosine, ratio):
        counts.append(len(cosine))
        return np.ones_like(cosine), np.zeros_like(cosine)

    monkeypatch.setattr(walk, "_fresnel", mirror)
    directions = np.tile(seen(degrees), (200_000, 1))
    found, passes = walk.border(directions, roughness**2, 1 / 1.5, rng)
    expected = ggx.moments(roughness, np.cos(np.radians(degrees)))[0, 0]
    assert 1 - counts[1] / counts[0] == pytest.approx(expected, abs=4e-3)
    assert not passes.any()
    assert (found[:, 2] > 0).all()


def test_a_smooth_border_is_fresnels(rng):
    directions = np.tile(seen(55), (100_000, 1))
    found, passes = walk.border(directions, 1e-4, 1 / 1.6, rng)
    assert passes.mean() == pytest.approx(1 - fresnel(np.cos(np.radians(55)), 1.6), abs=4e-3)
    sine = np.hypot(*found[passes].T[:2])
    turned = np.abs(sine - np.sin(np.radians(55)) / 1.6)
    assert np.percentile(turned, 99) < 2e-3  # GGX has long tails


@pytest.mark.proof
@pytest.mark.parametrize("alpha", [0.04, 0.36, 1.0])
def test_as_much_passes_a_border_from_inside_as_from_outside(rng, alpha):
    """Reciprocity: even light that passes from outside is n^2 times that from inside, and the
    products of functions of where it comes from and where it goes are the same both ways.
    """
    count, ior = 400_000, 1.5
    radius, turn = np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    even = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)], axis=1)
    (inside, enters), (outside, leaves) = (
        walk.border(even, alpha, ratio, rng) for ratio in (1 / ior, ior)
    )

    def weigh(out, within):
        return np.stack([np.ones(count), out[:, 2] ** 4 * within[:, 2], out[:, 0] * within[:, 0]])

    there = enters * weigh(even, inside)
    back = leaves * weigh(outside, even) * ior**2
    noise = np.hypot(there.std(axis=1), back.std(axis=1)) / np.sqrt(count)
    assert (np.abs(there.mean(axis=1) - back.mean(axis=1)) < 4.5 * noise).all()
    assert (noise < 0.01 * there.mean(axis=1)).all()


@pytest.mark.parametrize("alpha", [0.0025, 0.36])
def test_all_light_that_passes_leaves_a_white_base(rng, alpha):
    """However rough the border: what does not leave was reflected outside at first."""
    light, view = upper(rng, 4000), np.tile(seen(40), (4000, 1))
    found, _ = walk.coated(parse_spec("lambertian"), light, view, alpha, 1.5, samples=32)
    leaving = 2 * np.pi * np.mean(found * light[:, 2:])
    passes = walk.border(np.tile(seen(40), (100_000, 1)), alpha, 1 / 1.5, rng)[1]
    assert leaving == pytest.approx(passes.mean(), abs=0.02)


def test_a_diffuse_base_under_a_smooth_coat(rng):
    """The series of all rounds, by integrals over a smooth border."""
    albedo, ior = 0.7, 1.5

    def returned(inner):
        outer = 1 - ior**2 * (1 - inner**2)
        return 2 * inner * (fresnel(np.sqrt(outer), ior) if outer > 0 else 1.0)

    critical = np.sqrt(1 - 1 / ior**2)
    back = quad(returned, 0, critical)[0] + quad(returned, critical, 1)[0]
    passed = (1 - fresnel(np.cos(np.radians(20)), ior)) * (1 - fresnel(np.cos(np.radians(60)), ior))
    base = parse_spec(f"lambertian:albedo={albedo}")
    light, view = seen(20)[None], seen(60)[None]
    found, error = walk.coated(base, light, view, 1e-3, ior, samples=100_000)
    expected = albedo / np.pi * passed / ior**2 / (1 - albedo * back)
    assert found[0, 0] == pytest.approx(expected, abs=4 * error[0, 0])
    assert error[0, 0] < 0.005 * expected


@pytest.mark.proof
def test_the_fast_form_is_compared_with_it():
    brdf = parse_spec("coated:roughness=0.15,base=(lambertian:albedo=0.8/0.4/0.1)")
    found = walk.compared(brdf, 64)
    assert np.abs(found.albedo - found.walked).max() < 0.01 + 4 * found.noise.max()
    assert (found.difference < 0.05 + 1.3 * found.difference_noise).all()
    again = walk.compared(brdf, 64)
    np.testing.assert_array_equal(again.walked, found.walked)


@pytest.mark.proof
@pytest.mark.parametrize("roughness", [0.3, 0.7])
def test_metals_under_rough_coats_keep_their_light(roughness):
    """GGX's own lobe, as wide as it is through the coat, would lose a fifth and more of it."""
    found = walk.compared(parse_spec(f"coated:roughness={roughness},base=(ggx:f0=0.9)"), 128)
    close = np.abs(found.albedo - found.walked) < 0.04 * found.walked + 3 * found.noise
    assert close.all()
    assert found.noise.max() < 0.03


@pytest.mark.parametrize("spec", ["ggx", "coated:weight=0.5", "coated:film=300", "fuzzy"])
def test_there_is_no_walk_for_others(spec):
    with pytest.raises(BrdfError, match="the walk is for coated"):
        walk.compared(parse_spec(spec), 4)
