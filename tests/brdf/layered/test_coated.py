"""A coat over a base: energy, limits that are known exactly, Mitsuba, and the random walk."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import k1

import shrm_cli
from shrm_cli.brdf.layered.parts.dielectric import CoatLobe, ThroughCoat
from shrm_cli.brdf.layered.parts.walk import coated
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.probe.source import source_pixels
from tests.brdf.models.test_analytic import mitsuba, mitsuba_values, upper  # noqa: F401
from tests.brute_force import unit

GOLD = "ggx:roughness=0.4,f0=gold"
PLASTIC = "0.9*lambertian:albedo=0.1/0.3/0.8+ggx:roughness=0.4,f0=0.04"
PAINT = "0.7*lambertian:albedo=0.6/0.05/0.03+0.3*ggx:roughness=0.45,f0=aluminum"
ANGLES = (0, 15, 30, 45, 60, 70, 80, 85, 88)


def fresnel(cosine, ior):
    """The reflectance of a border that is met in air, by the angles of Snell's law."""
    there = np.arcsin(np.sin(np.arccos(cosine)) / ior)
    here = np.arccos(cosine)
    if here < 1e-6:
        return ((ior - 1) / (ior + 1)) ** 2
    s = np.sin(here - there) / np.sin(here + there)
    p = np.tan(here - there) / np.tan(here + there)
    return (s**2 + p**2) / 2


def seen(degrees):
    theta = np.radians(degrees)
    return np.array([np.sin(theta), 0, np.cos(theta)])


def reflected_share(brdf, degrees, count=700):
    """The albedo, with nodes about the half vector: dense at the mirror, and apart from shrm's."""
    view = seen(degrees)
    u = (np.arange(count) + 0.5) / count
    tilt, turn = np.pi / 2 * u**3, 2 * np.pi * u[: count // 2] * (count / (count // 2))
    sine = np.sin(tilt)[:, None]
    z = np.broadcast_to(np.cos(tilt)[:, None], (count, len(turn)))
    half = np.stack([sine * np.cos(turn), sine * np.sin(turn), z], axis=-1)
    cosine = np.maximum(half @ view, 0)
    light = 2 * cosine[..., None] * half - view
    area = sine * (np.pi / 2 * 3 * u**2 / count)[:, None] * 2 * np.pi / len(turn) * 4 * cosine
    return np.einsum("ij,ijc->c", area, brdf.transfer(light, view))


def under(brdf, light, view):
    """What a coated BRDF reflects below its coat."""
    below = (w * each.evaluate(light, view) for w, each in brdf.terms if each.name != "coat-lobe")
    return sum(below)


@pytest.mark.proof
@pytest.mark.parametrize(
    "spec",
    [
        "coated:roughness=0.3,base=(lambertian)",
        "coated:base=(ggx:roughness=0.1)",
        "coated:base=(ggx:roughness=0.3)",
        "coated:roughness=0.6,base=(ggx:roughness=0.8)",
        "coated:ior=2.4,base=(oren-nayar)",
        "coated:base=(0.5*lambertian+0.5*ggx:roughness=0.3)",
        "coated:base=(coated:base=(lambertian))",
        "coated:color=0.2,base=(phong:exponent=20)",
        "fuzzy:base=(coated:base=(lambertian))",
        "fuzzy:roughness=0.1,color=1/0.2/0.1,base=(ggx)",
        "fuzzy:roughness=1,base=(lambertian)",
    ],
)
def test_no_more_light_leaves_than_arrives(spec):
    brdf = parse_spec(spec)
    for degrees in ANGLES:
        assert reflected_share(brdf, degrees).max() < 1 + 1e-3, degrees


@pytest.mark.parametrize("ior", [1.2, 1.5, 2.4])
def test_nothing_is_lost_over_a_white_base(ior):
    brdf = parse_spec(f"coated:ior={ior},base=(lambertian)")
    for degrees in (0, 30, 60, 75):
        assert reflected_share(brdf, degrees) == pytest.approx(1, abs=2e-3)


def test_little_is_lost_over_a_mirror():
    """GGX of this roughness reflects all but a few parts in a thousand."""
    brdf = parse_spec("coated:base=(ggx:roughness=0.1)")
    for degrees in (0, 30, 60, 75):
        assert reflected_share(brdf, degrees) == pytest.approx(1, abs=6e-3)


@pytest.mark.parametrize(("ior", "albedo", "tint"), [(1.5, 0.8, 1.0), (1.8, 0.3, 0.4)])
def test_a_diffuse_base_under_a_smooth_coat(rng, ior, albedo, tint):
    """Light of all rounds, by integrals over the border; the coat is all but smooth."""
    spec = f"coated:roughness=0.05,ior={ior},color={tint},base=(lambertian:albedo={albedo})"
    brdf = parse_spec(spec)

    def way(cosine):
        return tint ** (0.5 / np.sqrt(1 - (1 - cosine**2) / ior**2))

    def returned(inner):
        outer = 1 - ior**2 * (1 - inner**2)
        reflected = fresnel(np.sqrt(outer), ior) if outer > 0 else 1.0
        return 2 * inner * reflected * tint ** (1 / inner)

    critical = np.sqrt(1 - 1 / ior**2)
    back = quad(returned, 0, critical)[0] + quad(returned, critical, 1)[0]
    light, view = upper(rng, 40), upper(rng, 40)
    for one, other in zip(light, view, strict=True):
        if min(one[2], other[2]) < 0.1:
            continue
        passed = [(1 - fresnel(each[2], ior)) * way(each[2]) for each in (one, other)]
        expected = albedo / np.pi * passed[0] * passed[1] / ior**2 / (1 - albedo * back)
        assert under(brdf, one, other) == pytest.approx(expected, rel=6e-3)


def test_what_a_smooth_coat_reflects_is_fresnels_part():
    lobe = parse_spec("coated:roughness=0.05,ior=1.7,base=(lambertian:albedo=0)")
    for degrees in (0, 20, 45, 60):
        expected = fresnel(np.cos(np.radians(degrees)), 1.7)
        assert reflected_share(lobe, degrees) == pytest.approx(expected, rel=2e-3)


@pytest.mark.proof
@pytest.mark.parametrize("base", [GOLD, PLASTIC, "phong:exponent=9", "oren-nayar"])
def test_a_coat_of_air_is_none(rng, base):
    light, view = upper(rng, 60), upper(rng, 60)
    found, bare = parse_spec(f"coated:ior=1,base=({base})"), parse_spec(base)
    expected = bare.transfer(light, view)
    np.testing.assert_allclose(found.transfer(light, view), expected, rtol=2e-3, atol=1e-6)


@pytest.mark.proof
def test_a_part_of_the_surface_may_be_coated(rng):
    light, view = upper(rng, 60), upper(rng, 60)
    part, whole = (parse_spec(f"coated:weight={w},base=({PAINT})") for w in (0.3, 1))
    mixed = 0.3 * whole.evaluate(light, view) + 0.7 * whole.base.evaluate(light, view)
    np.testing.assert_allclose(part.evaluate(light, view), mixed, rtol=1e-9)


@pytest.mark.proof
@pytest.mark.parametrize("spec", [f"coated:base=({PAINT})", f"fuzzy:base=(coated:base=({GOLD}))"])
def test_light_and_view_may_be_exchanged(rng, spec):
    brdf, light, view = parse_spec(spec), upper(rng, 100), upper(rng, 100)
    there, back = brdf.evaluate(light, view), brdf.evaluate(view, light)
    np.testing.assert_allclose(there, back, rtol=1e-9)


@pytest.mark.parametrize(("base", "coat"), [(0.2, 0.3), (0.3, 0.4), (0.4, 0.2), (0.5, 0.2)])
def test_slopes_of_facets_are_added_under_a_rough_coat(base, coat):
    """Those of the base and of the border on both ways, each half of what turns the light there.

    The sum has the product of the Fourier transforms of GGX's slopes, ``alpha k K_1(alpha k)``.
    """
    widths = np.array([base**2, *[(1 - 1 / 1.5) / 2 * coat**2] * 2])

    def transform(k):
        return k / (2 * np.pi) * np.prod(widths * k * k1(widths * k))

    peak = quad(transform, 1e-9, 60 / widths.max(), limit=500)[0]
    ggx, border = parse_spec(f"ggx:roughness={base}"), CoatLobe(coat, 1.5)
    up = np.array([0.0, 0.0, 1.0])
    found = 4 * ThroughCoat(ggx, border, False).evaluate(up, up)[0]
    assert 1 / np.sqrt(found) == pytest.approx(1 / np.sqrt(peak), rel=0.035)


@pytest.mark.proof
@pytest.mark.parametrize("base", ["40*ggx", "40*lambertian", "9*lambertian+9*phong"])
def test_a_base_that_glows_stays_finite(rng, base):
    """The light between the coat and such a base would grow without an end."""
    found = parse_spec(f"coated:base=({base})").evaluate(upper(rng, 200), upper(rng, 200))
    assert np.isfinite(found).all()
    assert (found >= 0).all()


def test_roughplastic_of_mitsuba(mitsuba, rng):  # noqa: F811
    """A rough border over a diffuse base, away from the border's own narrow lobe."""
    plugin = {
        "type": "roughplastic", "distribution": "ggx", "alpha": 0.01, "int_ior": 1.5,
        "diffuse_reflectance": {"type": "rgb", "value": [0.8, 0.3, 0.1]}, "nonlinear": True,
    }  # fmt: skip
    brdf = parse_spec("coated:base=(lambertian:albedo=0.8/0.3/0.1)")
    light, view = upper(rng, 60), upper(rng, 60)
    steep = np.minimum(light[:, 2], view[:, 2]) > 0.15
    expected = mitsuba_values(mitsuba, plugin, light, view)[steep]
    found = brdf.transfer(light, view)[steep]
    assert np.abs(found - expected).max() < 0.02 * expected.max()
    assert steep.sum() > 30


def walked(brdf, light, view, **more):
    alpha, ior = brdf.number("roughness") ** 2, brdf.number("ior")
    return coated(brdf.base, light, view, alpha, ior, brdf.color("color"), **more)


@pytest.mark.proof
@pytest.mark.parametrize(
    "spec",
    [
        f"coated:base=({GOLD})",
        f"coated:ior=1.7,color=0.9/0.5/0.2,base=({PLASTIC})",
        f"coated:roughness=0.2,base=({PAINT})",
        "coated:ior=1.8,base=(fuzzy:base=(lambertian))",
    ],
)
def test_the_walk_agrees_about_energies(rng, spec):
    """How much light from angles the base reflects below the coat, over even directions."""
    brdf = parse_spec(spec)
    light = upper(rng, 3000)
    for degrees in (0, 40, 65):
        view = np.tile(seen(degrees), (len(light), 1))
        true, _ = walked(brdf, light, view, samples=96, base_alpha=0.16)
        found = under(brdf, light, view)
        cosine = light[:, 2:]
        assert np.sum(found * cosine, axis=0) == pytest.approx(
            np.sum(true * cosine, axis=0), rel=0.04
        )


PROBES = "city", "courtyard", "forest", "interior", "night", "studio", "sunrise", "sunset"


@pytest.mark.proof
@pytest.mark.parametrize("base", [GOLD, PLASTIC, PAINT])
def test_the_walk_agrees_about_the_reflected_light(rng, shared, base):
    """RMS over normals and views, of what the base alone adds; the coat is the same for both."""
    brdf = parse_spec(f"coated:base=({base})")
    lights = {}
    for name in PROBES:
        source = shrm_cli.open_probe(shared / "probes" / f"{name}.exr")
        directions, light = (each.reshape(-1, 3) for each in source_pixels(source, 64))
        lights[name] = light.astype(float)
    wrong, whole, noise = (dict.fromkeys(PROBES, 0.0) for _ in range(3))
    for cosine in (0.95, 0.8, 0.6, 0.4):
        normal, turn = unit(rng, 1)[0], rng.uniform(0, 2 * np.pi)
        across = np.cross(normal, unit(rng, 1)[0])
        across /= np.linalg.norm(across)
        own = directions @ np.stack([across, np.cross(normal, across), normal], axis=1)
        lit = own[:, 2] > 1e-4
        own = own[lit].astype(float)
        sine = np.sqrt(1 - cosine**2)
        view = np.array([sine * np.cos(turn), sine * np.sin(turn), cosine])
        shares = np.max(
            [np.sum(each[lit], axis=1) / np.sum(each) for each in lights.values()], axis=0
        )
        order, views = np.argsort(-shares * own[:, 2]), np.tile(view, (len(own), 1))
        true, error = np.zeros_like(own), np.zeros_like(own)
        for part, samples in (
            (order[:20], 8000),
            (order[20:300], 500),
            (order[300:], 30),
        ):  # lamps are what matters
            there = walked(brdf, own[part], views[part], samples=samples, base_alpha=0.2)
            true[part], error[part] = there
        found = under(brdf, own, view)
        for name, light in lights.items():
            weights = light[lit] * own[:, 2:]
            wrong[name] += np.sum(np.sum((found - true) * weights, axis=0) ** 2)
            whole[name] += np.sum(np.sum(true * weights, axis=0) ** 2)
            noise[name] += np.sum((error * weights) ** 2)
    for name in PROBES:
        assert wrong[name] < 0.05**2 * whole[name] + 4 * noise[name], name
    assert np.median([noise[name] / whole[name] for name in PROBES]) < 0.03**2
