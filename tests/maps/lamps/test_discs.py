"""What discs of light reflect, beside sums over their areas that share no code with it."""

import numpy as np
import pytest

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.lamps import rule
from shrm_cli.maps.lamps.rule import DiscRule, LitDiscs
from shrm_cli.probe.disc import Disc
from tests import brute_force, ggx
from tests.oracles import disc_rule

RADIANCE = np.array([900.0, 700.0, 300.0])
F0 = np.array([0.9, 0.5, 0.04])


def towards(mirror, angle, around):
    """A direction at an angle from another one, at some azimuth about it."""
    side = np.cross(mirror, [0.3, 0.8, 0.5])
    side /= np.linalg.norm(side)
    other = np.cross(mirror, side)
    turned = np.cos(around) * side + np.sin(around) * other
    return np.cos(angle) * mirror + np.sin(angle) * turned


def views_of(normal, cosines, rng):
    """Views at angles of these cosines from a normal."""
    side = np.cross(normal, brute_force.unit(rng, len(cosines)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    cosines = np.array(cosines)[:, None]
    return cosines * normal + np.sqrt(1 - cosines**2) * side


@pytest.mark.parametrize("degrees", [0.27, 5.0])
@pytest.mark.parametrize("roughness", [0.05, 0.1, 0.3, 0.7])
def test_ggx(roughness, degrees):
    """Within .2 % of the largest value for each view, wherever the disc is beside the mirror."""
    rng, radius = np.random.default_rng(1), np.radians(degrees)
    brdf = parse_spec(f"ggx:roughness={roughness},f0={'/'.join(map(str, F0))}")
    (normal,) = brute_force.unit(rng, 1)
    for view in views_of(normal, (0.97, 0.6, 0.25), rng):
        mirror = 2 * (normal @ view) * normal - view
        found, expected = [], []
        for share, around in [(0.02, 1.0), (0.6, 2.0), (0.96, 4.0), (1.05, 0.4), (1.7, 3.0)]:
            disc = Disc(towards(mirror, share * radius, around), radius, RADIANCE)
            light, areas = disc_rule(disc.direction, radius, 24 + int(3 * radius / roughness**2))
            base, tail = ggx.lobe(roughness, normal, view, light)
            both = areas @ base, areas @ (base * tail)
            expected.append(RADIANCE * (F0 * (both[0] - both[1]) + both[1]))
            found.append(LitDiscs(brdf, (disc,)).radiance(normal, view))
        error = np.abs(np.array(found) - expected).max(axis=0) / np.max(expected, axis=0)
        assert error.max() < 2e-3


@pytest.mark.parametrize("spec", ["ggx:roughness=0.1", "0.9*lambertian+0.1*ggx:roughness=0.1"])
def test_few_steps_beyond_reach(spec):
    """There the same as elsewhere: within .2 % of the largest value, and 1 % of each."""
    rng, radius = np.random.default_rng(5), 0.05
    brdf = parse_spec(spec)
    rule = DiscRule.of(brdf, radius)
    assert rule.beyond.steps < rule.steps / 2
    assert rule.reach < 0.3
    (normal,) = brute_force.unit(rng, 1)
    for view in views_of(normal, (0.97, 0.6, 0.2), rng):
        mirror = 2 * (normal @ view) * normal - view
        found, expected = [], []
        for distance in [0.0, *rule.reach * np.array([0.9, 1.01, 1.3, 2.0, 3.5])]:
            for around in (0.4, 2.0, 3.6, 5.0):
                disc = Disc(towards(mirror, distance, around), radius, np.ones(3))
                light, areas = disc_rule(disc.direction, radius, 60)
                side = np.cross(normal, [0.1, 0.9, 0.2])
                side /= np.linalg.norm(side)
                other = np.cross(normal, side)
                axes = np.stack([side, other, normal], axis=1)
                expected.append(areas @ brdf.transfer(light @ axes, (view @ axes)[None]))
                found.append(LitDiscs(brdf, (disc,)).radiance(normal, view))
        error, seen = np.abs(np.array(found) - expected), np.max(expected, axis=0)
        assert np.all(error < 2e-3 * seen)
        assert np.all(error < 0.01 * np.array(expected) + 1e-9 * seen)


def test_a_peak_beyond_reach_counts():
    """A lobe that has another peak far from its center is never summed up by few steps."""

    class Backwards(Brdf):
        """Sharp lobes about the mirror direction and, as of a retroreflector, about the view."""

        name, includes_cosine, has_horizon = "backwards", True, False

        def evaluate(self, light, view):
            mirrored = view * [-1.0, -1.0, 1.0]
            cosines = [np.sum(light * each, axis=-1) for each in (mirrored, view)]
            value = sum(np.exp(2e4 * (each - 1)) for each in cosines)
            return np.broadcast_to(value[..., None], (*value.shape, 3))

    assert DiscRule.of(parse_spec("phong:exponent=2000"), 0.05).reach < 1
    assert DiscRule.of(Backwards(), 0.05).reach == np.pi


def test_lambert_sets_smoothly():
    """A lamp that goes down gives the irradiance of what is still above the horizon."""
    radius, normal = np.radians(5.0), np.array([0.0, 0.0, 1.0])
    view, brdf = np.array([0.6, 0.0, 0.8]), parse_spec("lambertian")
    heights = np.radians(np.linspace(-7, 9, 81))
    found = []
    for height in heights:
        axis = np.array([0.3 * np.cos(height), np.sqrt(0.91) * np.cos(height), np.sin(height)])
        disc = Disc(axis, radius, np.ones(3))
        light, areas = disc_rule(axis, radius, 60)
        found.append(LitDiscs(brdf, (disc,)).radiance(normal, view)[0])
        expected = areas @ np.maximum(light @ normal, 0) / np.pi
        assert found[-1] == pytest.approx(expected, abs=2e-3 * np.sin(radius) ** 2)
    assert found[0] == 0
    assert np.all(np.diff(found) >= -1e-12)
    # Its slope changes by no more than the disc's own profile makes it.
    assert np.abs(np.diff(found, 2)).max() < 0.2 * np.diff(found).max()


def test_a_sum_of_lobes_and_discs():
    rng = np.random.default_rng(4)
    brdf = parse_spec("0.5*phong:exponent=40+0.25*lambertian:albedo=0.8")
    discs = tuple(
        Disc(axis, radius, light)
        for axis, radius, light in zip(
            brute_force.unit(rng, 3), np.radians([0.5, 2.0, 4.0]), rng.random((3, 3)), strict=True
        )
    )
    normals, views = brute_force.unit(rng, 40), brute_force.unit(rng, 40)
    views *= np.where(np.sum(normals * views, axis=1) < 0, -1.0, 1.0)[:, None]
    found = LitDiscs(brdf, discs).radiance(normals, views)
    expected = np.zeros((40, 3))
    for k, (normal, view) in enumerate(zip(normals, views, strict=True)):
        mirror = 2 * (normal @ view) * normal - view
        for disc in discs:
            light, areas = disc_rule(disc.direction, disc.radius, 60)
            lobe = 0.5 * brute_force.phong(40)(mirror, view, light)
            lobe += 0.25 * 0.8 / np.pi * np.maximum(light @ normal, 0)
            expected[k] += (areas @ lobe) * disc.radiance
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3 * expected.max())
    assert found.shape == (40, 3)
    one = LitDiscs(brdf, discs).radiance(normals[:, None], views[0])
    np.testing.assert_allclose(one[0, 0], found[0], rtol=1e-12)


def test_small_discs_beside_a_large_one_take_few_steps():
    """A lamp of sixteen discs took as many steps for each as for a soft box, in shaders too."""
    brdf, axis = parse_spec("ggx:roughness=0.3"), np.array([0.6, 0.0, 0.8])
    radii = np.radians([40.0, 2.0, 30.0, 1.4])
    discs = tuple(Disc(axis, float(radius), np.ones(3)) for radius in radii)
    box, small, *alike = LitDiscs(brdf, discs).rules
    assert alike == [box, small]
    assert 3 * small.steps < box.steps
    assert LitDiscs(brdf, discs[1:2]).rules == (small,)


def test_a_brushed_lobe_and_its_tangents():
    rng = np.random.default_rng(6)
    brdf = parse_spec("ward:ax=0.2,ay=0.5")
    normals = brute_force.unit(rng, 60)
    views = brute_force.unit(rng, 60)
    views *= np.where(np.sum(normals * views, axis=1) < 0, -1.0, 1.0)[:, None]
    tangents = np.cross(normals, brute_force.unit(rng, 60))
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    disc = Disc(brute_force.unit(rng, 1)[0], np.radians(3), RADIANCE)
    found = LitDiscs(brdf, (disc,)).brushed_radiance(normals, tangents, views)
    light, areas = disc_rule(disc.direction, disc.radius, 60)
    expected = []
    for normal, tangent, view in zip(normals, tangents, views, strict=True):
        axes = np.stack([tangent, np.cross(normal, tangent), normal], axis=1)
        values = brdf.evaluate(light @ axes, (view @ axes)[None])
        cosines = np.maximum(light @ normal, 0)
        expected.append((areas * cosines) @ values * disc.radiance)
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-3 * np.max(expected))


@pytest.mark.parametrize("degrees", [0.27, 5.0])
@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.7])
def test_vectors_that_rotations_left_off_unit_length(roughness, degrees):
    """The view is along the normal there, and the plane of the view any."""
    rng, radius = np.random.default_rng(7), np.radians(degrees)
    brdf = parse_spec(f"ggx:roughness={roughness},f0={'/'.join(map(str, F0))}")
    for normal in (np.array([0.0, 0.0, 1.0]), *brute_force.unit(rng, 2)):
        for angle, around in [(0.3 * radius, 1.0), (0.4, 2.0), (1.2, 4.0)]:
            disc = Disc(towards(normal, angle, around), radius, RADIANCE)
            light, areas = disc_rule(disc.direction, radius, 40 + int(5 * radius / roughness**2))
            base, tail = ggx.lobe(roughness, normal, normal, light)
            expected = RADIANCE * (areas @ base * F0 + areas @ (base * tail) * (1 - F0))
            for length in (1 + 1e-7, 1 + 2e-8, 1 - 2e-8):
                found = LitDiscs(brdf, (disc,)).radiance(length * normal, length * normal)
                np.testing.assert_allclose(found, expected, rtol=2e-3)


@pytest.mark.parametrize("radius", [0.02, 0.15])
@pytest.mark.parametrize(
    "spec", ["ggx:roughness=0.3", "phong:exponent=60", "oren-nayar", "ward:ax=0.1,ay=0.3"]
)
def test_rules_are_those_that_many_steps_choose(monkeypatch, spec, radius):
    """Of smooth lobes, as of the first two, they are compared with fewer."""
    chosen = DiscRule.of(parse_spec(spec), radius)
    monkeypatch.setattr(rule, "_SURE", -1.0)
    assert DiscRule.of(parse_spec(spec), radius) == chosen
