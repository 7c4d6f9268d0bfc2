"""The analytic models: reciprocity, energy, formulas written again, and Mitsuba's values."""

import csv

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import gamma

from shrm_cli.brdf.library import built_in_names, find_model
from shrm_cli.brdf.models.lafortune import FITS
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError
from shrm_cli.orders import choose_orders
from tests import brute_force

MODELS = {name: find_model(name) for name in built_in_names()}

# Reflect more than they receive: the most found for views up to 80 degrees, and why.
MORE_THAN_RECEIVED = {
    "oren-nayar": (1.01, "its fitted A and B rise past 1 towards grazing, for sigma about 0.15"),
    "disney-diffuse": (1.28, "fitted to measurements, its rim is not balanced by anything"),
}
# f_r = rho_hat / N.L of these is not reciprocal, though rho_hat is symmetric.
TRANSFER_FUNCTIONS = {"phong", "microfacet", "kajiya-kay"}
# Their lobes are not normalised: a parameter makes them as bright as one likes.
NOT_NORMALISED = {"lafortune", "kajiya-kay"}


def direction(degrees, azimuth=0.0):
    theta = np.radians(degrees)
    sine = np.sin(theta)
    return np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(theta)])


def upper(rng, count):
    vectors = brute_force.unit(rng, count)
    vectors[:, 2] = abs(vectors[:, 2])
    return vectors


def lobe_rule(pole, rings=100, azimuths=128, end=np.pi):
    """Directions up to an angle from a pole, dense there, where a lobe may be sharp; weights."""
    x, weights = np.polynomial.legendre.leggauss(rings)
    u = (x + 1) / 2
    theta = end * u**3
    weights = weights / 2 * 3 * end * u**2 * np.sin(theta) * 2 * np.pi / azimuths
    phi = 2 * np.pi * (np.arange(azimuths) + 0.5) / azimuths
    sine = np.sin(theta)[:, None]
    parts = sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)[:, None] + 0 * phi
    local = np.stack(parts, axis=-1).reshape(-1, 3)
    x_axis = np.cross([0.0, 1.0, 0.0], pole)
    x_axis = x_axis / np.linalg.norm(x_axis)
    frame = np.stack([x_axis, np.cross(pole, x_axis), pole])
    return local @ frame, np.repeat(weights, azimuths)


def directional_albedo(brdf, view):
    """``int f_r N.L dL``; the horizon costs it 4e-4, found with the Lambertian."""
    light, weights = lobe_rule(view * [-1, -1, 1] if brdf.center == "reflection" else view)
    return weights @ brdf.transfer(light, view)


def quickly(names):
    """The models by name; those whose layers are integrated anew for each example are proofs."""
    layers = {"coated", "fuzzy", "openpbr"}
    return [
        pytest.param(name, marks=pytest.mark.proof if name in layers else ())
        for name in sorted(names)
    ]


def random_model(name, rng):
    """A model with random parameters in their ranges, wide enough for `lobe_rule`."""
    values = {}
    for parameter in MODELS[name].parameters:
        low, high = parameter.minimum, parameter.maximum
        if isinstance(parameter.default, str) or parameter.is_optional:
            continue
        if isinstance(parameter.default, tuple):
            values[parameter.name] = list(rng.uniform(low, high, 3))
        elif high > 200:  # exponents
            values[parameter.name] = 10 ** rng.uniform(-1, 3)
        else:
            values[parameter.name] = rng.uniform(max(low, 0.1 * min(high, 1)), high)
    if name == "poulin-fournier":  # the cylinders themselves reflect no more than they receive
        values["specular"] = list(1 - np.array(values["diffuse"]))
    if name == "ggx" and rng.integers(2):  # brushed
        values["anisotropy"] = rng.uniform(0, 0.8)
    return MODELS[name](**values)


@pytest.mark.parametrize("name", quickly(set(MODELS) - TRANSFER_FUNCTIONS))
@settings(max_examples=8)
@given(st.integers(0, 10**6))
def test_helmholtz_reciprocity(name, seed):
    rng = np.random.default_rng(seed)
    brdf = random_model(name, rng)
    light, view = upper(rng, 100), upper(rng, 100)
    found, exchanged = brdf.evaluate(light, view), brdf.evaluate(view, light)
    np.testing.assert_allclose(found, exchanged, rtol=1e-9, atol=1e-12 * found.max())
    assert found.max() > 0


@pytest.mark.parametrize("name", sorted(TRANSFER_FUNCTIONS))
def test_transfer_functions_are_symmetric_and_so_not_reciprocal(name, rng):
    brdf = MODELS[name]()
    light, view = upper(rng, 50), upper(rng, 50)
    assert brdf.includes_cosine
    np.testing.assert_allclose(brdf.evaluate(light, view), brdf.evaluate(view, light), rtol=1e-9)


@pytest.mark.parametrize("name", quickly(set(MODELS) - NOT_NORMALISED))
@settings(max_examples=6)
@given(st.integers(0, 10**6))
def test_directional_albedo_is_at_most_1(name, seed):
    rng = np.random.default_rng(seed)
    brdf = random_model(name, rng)
    most, _ = MORE_THAN_RECEIVED.get(name, (1.0, ""))
    for degrees in (0.5, 35, 60, 80):
        azimuth = 0.0 if brdf.isotropic else rng.uniform(0, np.pi)
        albedo = directional_albedo(brdf, direction(degrees, azimuth))
        assert albedo.max() < most + 1e-3
        assert albedo.min() >= 0


@pytest.mark.parametrize(("name", "most"), [(k, v[0]) for k, v in MORE_THAN_RECEIVED.items()])
def test_the_exceptions_are_exceptions(name, most):
    first = MODELS[name].parameters[0]
    settings_of_it = np.linspace(first.minimum, first.maximum, 21)
    albedos = [
        directional_albedo(MODELS[name](**{first.name: value}), direction(80)).max()
        for value in settings_of_it
    ]
    assert 1 + 1e-3 < max(albedos) < most


@pytest.mark.parametrize(
    ("fit", "most"),
    [("skin", 0.7), ("clay", 0.5), ("felt", 0.04), ("primer", 0.5), ("bluepaint", 0.8)],
)
def test_lafortune_fits_reflect_less_than_they_receive(fit, most):
    brdf = parse_spec(f"lafortune:fit={fit}")
    albedos = [directional_albedo(brdf, direction(d)).max() for d in (0.5, 45, 65, 80)]
    assert 0.75 * most < max(albedos) < most


def test_the_fit_of_brushed_metal_reflects_too_much_at_grazing_angles():
    brdf = parse_spec("lafortune:fit=brushedmetal")
    assert directional_albedo(brdf, direction(65)).max() < 1
    assert directional_albedo(brdf, direction(80)).max() == pytest.approx(1.55, abs=0.02)


def from_above(brdf_of_cosine):
    """2 pi int f_r(cos) cos d(cos): what is reflected of constant light seen from the normal."""
    return 2 * np.pi * quad(lambda c: brdf_of_cosine(c) * c, 0, 1, epsabs=1e-12, limit=200)[0]


def ggx_formula(roughness, f0):
    alpha = roughness**2

    def value(c):
        h = np.arccos(c) / 2
        d = alpha**2 / (np.pi * (np.cos(h) ** 2 * (alpha**2 - 1) + 1) ** 2)
        smith = (np.sqrt(1 + alpha**2 * (1 / c**2 - 1)) - 1) / 2 if c > 0 else np.inf
        fresnel = f0 + (1 - f0) * (1 - np.cos(h)) ** 5
        return d * fresnel / (1 + smith) / (4 * c) if c > 0 else 0.0

    return value


def cook_torrance_formula(m, f0):
    def value(c):
        h = np.arccos(c) / 2
        d = np.exp(-((np.tan(h) / m) ** 2)) / (np.pi * m**2 * np.cos(h) ** 4)
        g = min(1, 2 * np.cos(h) * c / np.cos(h), 2 * np.cos(h) / np.cos(h))
        return d * g * (f0 + (1 - f0) * (1 - np.cos(h)) ** 5) / (4 * c) if c > 0 else 0.0

    return value


def charlie_formula(r):
    first = np.array([25.3245, 3.32435, 0.16801, -1.27393, -4.85967])
    second = np.array([21.5473, 3.82987, 0.19823, -1.97760, -4.32054])
    a, b, c, d, e = (1 - r) ** 2 * first + (1 - (1 - r) ** 2) * second

    def lam(x):
        curve = [a / (1 + b * y**c) + d * y + e for y in (min(x, 1 - x), 0.5)]
        return np.exp(curve[0] if x < 0.5 else 2 * curve[1] - curve[0])

    def value(cosine):
        d_term = (2 + 1 / r) * np.sin(np.arccos(cosine) / 2) ** (1 / r) / (2 * np.pi)
        return d_term / (1 + lam(1.0) + lam(cosine)) / (4 * cosine) if cosine > 0 else 0.0

    return value


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        ("lambertian:albedo=0.3", 0.3),
        ("oren-nayar:sigma=0.4,albedo=0.5", 0.5 * (1 - 0.5 * 0.16 / 0.49)),
        ("blinn-phong:exponent=9.5,color=0.7", 0.7),
        ("blinn-phong:exponent=200", 1.0),
        ("phong:exponent=30", 1.0),
        ("lafortune:diffuse=0.25,cxy=-1,cz=0.9,exponent=12", 0.25 + 0.9**12 * 2 * np.pi / 14),
        (
            "ashikhmin-shirley:nu=0,specular=0,diffuse=0.5",
            from_above(
                lambda c: (
                    28 * 0.5 / (23 * np.pi) * (1 - (1 - c / 2) ** 5) * (1 - 0.5**5)
                    + (1 - np.sqrt((1 + c) / 2)) ** 5 / (8 * np.pi) / np.sqrt((1 + c) / 2)
                )
            ),
        ),
        (
            "ashikhmin-shirley:nu=40,specular=0.9",
            from_above(
                lambda c: (
                    41
                    / (8 * np.pi)
                    * (0.9 + 0.1 * (1 - np.sqrt((1 + c) / 2)) ** 5)
                    * np.sqrt((1 + c) / 2) ** 39
                )
            ),
        ),
        (
            "disney-diffuse:roughness=0.8",
            from_above(lambda c: (1 + (0.8 * (1 + c) - 0.5) * (1 - c) ** 5) / np.pi),
        ),
        ("ggx:roughness=0.6,f0=0.3", from_above(ggx_formula(0.6, 0.3))),
        ("cook-torrance:roughness=0.35,f0=0.3", from_above(cook_torrance_formula(0.35, 0.3))),
        ("charlie:roughness=0.4", from_above(charlie_formula(0.4))),
        (
            "ward:ax=0.3",
            from_above(
                lambda c: (
                    np.exp(-(np.tan(np.arccos(c) / 2) ** 2) / 0.09)
                    / (np.pi * 0.09)
                    * (2 + 2 * c)
                    / (1 + c) ** 4
                )
            ),
        ),
    ],
)
def test_white_furnace_seen_from_the_normal(spec, expected):
    up = np.array([0.0, 0.0, 1.0])
    # Many rings, because Cook and Torrance's G has a kink; all azimuths are alike.
    light, weights = lobe_rule(up, rings=1000, azimuths=4, end=np.pi / 2)
    found = weights @ parse_spec(spec).transfer(light, up)
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_white_furnace_of_a_fibre():
    """2 pi int cos^s(t) cos(t) dt from the side, which is pi^(3/2) times two gamma functions."""
    light, weights = lobe_rule(np.array([0.0, 0.0, 1.0]), 200, 8)
    found = weights @ parse_spec("kajiya-kay:exponent=32").transfer(light, direction(90))
    np.testing.assert_allclose(found, 2 * np.pi**1.5 * gamma(17) / gamma(17.5), rtol=1e-6)
    assert found[0] == pytest.approx(2.72, abs=0.005)


def test_kajiya_kay_is_the_cosine_of_the_difference_of_the_angles(rng):
    light, view = brute_force.unit(rng, 200), brute_force.unit(rng, 200)
    difference = np.arccos(light[:, 2]) - np.arccos(view[:, 2])
    expected = np.where(np.abs(difference) < np.pi / 2, np.cos(difference), 0) ** 7
    found = parse_spec("kajiya-kay:exponent=7").transfer(light, view)
    np.testing.assert_allclose(found[:, 1], expected, atol=1e-12)


def test_oren_nayar_in_angles(rng):
    light, view = upper(rng, 200), upper(rng, 200)
    theta_i, theta_o = np.arccos(light[:, 2]), np.arccos(view[:, 2])
    phi = np.arctan2(light[:, 1], light[:, 0]) - np.arctan2(view[:, 1], view[:, 0])
    large, small = np.maximum(theta_i, theta_o), np.minimum(theta_i, theta_o)
    b = 0.45 * 0.25 / (0.25 + 0.09)
    swing = np.maximum(0, np.cos(phi)) * np.sin(large) * np.tan(small)
    expected = 0.8 / np.pi * (1 - 0.5 * 0.25 / (0.25 + 0.33) + b * swing)
    found = parse_spec("oren-nayar:sigma=0.5,albedo=0.8").evaluate(light, view)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-9)


def test_brushed_ward_and_ashikhmin_shirley_in_angles(rng):
    light, view = upper(rng, 200), upper(rng, 200)
    half = light + view
    length = np.linalg.norm(half, axis=1)
    theta = np.arccos(half[:, 2] / length)
    phi = np.arctan2(half[:, 1], half[:, 0])
    slopes = (np.cos(phi) / 0.5) ** 2 + (np.sin(phi) / 0.2) ** 2
    expected = np.exp(-(np.tan(theta) ** 2) * slopes) / (np.pi * 0.5 * 0.2)
    expected *= length**2 / (np.cos(theta) * length) ** 4
    found = parse_spec("ward:ax=0.5,ay=0.2").evaluate(light, view)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-9)

    cosine = np.sum(light * half, axis=1) / length
    expected = np.sqrt(13 * 5) / (8 * np.pi)
    expected = expected * np.cos(theta) ** (12 * np.cos(phi) ** 2 + 4 * np.sin(phi) ** 2)
    expected = expected / (cosine * np.maximum(light[:, 2], view[:, 2]))
    found = parse_spec("ashikhmin-shirley:nu=12,nv=4,specular=1").evaluate(light, view)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-9)
    assert not parse_spec("ward:ax=0.5,ay=0.2").isotropic
    assert not parse_spec("ashikhmin-shirley:nu=12,nv=4").isotropic
    assert parse_spec("ward:ax=0.5").isotropic
    assert parse_spec("ashikhmin-shirley:nu=12").isotropic


def test_cook_torrance_at_generic_angles(rng):
    light, view = upper(rng, 200), upper(rng, 200)
    half = (light + view) / np.linalg.norm(light + view, axis=1, keepdims=True)
    nh, nl, nv = half[:, 2], light[:, 2], view[:, 2]
    vh = np.sum(view * half, axis=1)
    tangent2 = (1 - nh**2) / nh**2
    d = np.exp(-tangent2 / 0.16) / (np.pi * 0.16 * nh**4)
    g = np.minimum(1, np.minimum(2 * nh * nv / vh, 2 * nh * nl / vh))
    for channel, f0 in enumerate((1.0, 0.782, 0.344)):
        expected = d * g * (f0 + (1 - f0) * (1 - vh) ** 5) / (4 * nl * nv)
        found = parse_spec("cook-torrance:roughness=0.4,f0=gold").evaluate(light, view)
        np.testing.assert_allclose(found[:, channel], expected, rtol=1e-8)


def reaches(y, z, ray, distance):
    """Whether rays from points of one period get away from the cylinders beside it."""
    free = np.ones(len(y), dtype=bool)
    for k in range(-30, 31):
        # Nearest point of the ray to the axis at (k distance, 0), in the plane across the axes.
        along = (k * distance - y) * ray[1] - z * ray[2]
        along = along / (ray[1] ** 2 + ray[2] ** 2)
        gap2 = (y + along * ray[1] - k * distance) ** 2 + (z + along * ray[2]) ** 2
        free &= ~((along > 1e-9) & (gap2 < 1 - 1e-9))
    return free


@pytest.mark.parametrize("distance", [2.0, 2.7, 6.0])
def test_poulin_fournier_against_rays(distance, rng):
    """The profile cut into 20000 pieces; a ray from each towards the light and the view."""
    spec = f"poulin-fournier:distance={distance},exponent=12,diffuse=0.5/0/0,specular=0/0.5/0"
    brdf = parse_spec(spec)
    turn = np.pi * (np.arange(10000) + 0.5) / 10000 - np.pi / 2
    floor = 1 + (distance - 2) * (np.arange(10000) + 0.5) / 10000
    y = np.concatenate([np.sin(turn), floor])
    z = np.concatenate([np.cos(turn), 0 * floor])
    normal = np.stack([0 * y, y, z], axis=1)
    normal[10000:] = [0, 0, 1]
    piece = np.concatenate([np.full(10000, np.pi / 10000), np.full(10000, (distance - 2) / 10000)])
    scale = 14 * 16 / (8 * np.pi * (2**-6 + 12))
    for light, view in zip(upper(rng, 20), upper(rng, 20), strict=True):
        open_ = reaches(y, z, light, distance) & reaches(y, z, view, distance)
        facing = np.maximum(normal @ light, 0) * np.maximum(normal @ view, 0) * open_ * piece
        facing = facing / (distance * light[2] * view[2])
        half = (light + view) / np.linalg.norm(light + view)
        lobe = np.maximum(normal @ half, 0) ** 12 * scale
        expected = [0.5 / np.pi * facing.sum(), 0.5 * (facing * lobe).sum(), 0]
        found = brdf.evaluate(light, view)
        np.testing.assert_allclose(found, expected, rtol=3e-3, atol=3e-4)


def test_lafortune_fits_are_the_published_numbers(shared):
    terms = {"diffuse": None, "c_xy": 0, "c_z": 1, "exponent": 2}
    with open(shared / "brdf" / "lafortune.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["material"] for row in rows} == set(FITS)
    for row in rows:
        diffuse, lobes = FITS[row["material"]]
        term = terms[row["term"]]
        found = diffuse if term is None else lobes[int(row["index"])][term]
        assert found == tuple(float(row[c]) for c in "rgb")


def test_orders_that_the_paper_found():
    """Section 5.7.1: Kajiya-Kay P = 8 without azimuth, Lafortune's skin P = 4, at eps .03."""
    orders, coefficients = choose_orders(parse_spec("kajiya-kay:exponent=32"), 0.03)
    assert orders.order_p == 8
    assert np.abs(coefficients.values[:, :, 1:]).max() < 1e-12 * coefficients.values.max()
    orders, _ = choose_orders(parse_spec("lafortune:fit=skin"), 0.03)
    assert orders.order_p == 4


@pytest.fixture(scope="module")
def mitsuba():
    module = pytest.importorskip("mitsuba", reason="mitsuba is not installed")
    module.set_variant("scalar_rgb")
    return module


def mitsuba_values(mitsuba, plugin, light, view):
    """f_r N.L of Mitsuba's BSDF."""
    bsdf, context = mitsuba.load_dict(plugin), mitsuba.BSDFContext()
    found = []
    for one, other in zip(light, view, strict=True):
        point = mitsuba.SurfaceInteraction3f()
        point.wi = mitsuba.Vector3f(*other)
        found.append(np.array(bsdf.eval(context, point, mitsuba.Vector3f(*one))))
    return np.array(found)


def test_diffuse_models_of_mitsuba(mitsuba, rng):
    light, view = upper(rng, 40), upper(rng, 40)
    color = {"type": "rgb", "value": [0.2, 0.5, 0.8]}
    found = parse_spec("lambertian:albedo=0.2/0.5/0.8").transfer(light, view)
    plugin = {"type": "diffuse", "reflectance": color}
    np.testing.assert_allclose(found, mitsuba_values(mitsuba, plugin, light, view), rtol=1e-4)
    for roughness in (0.2, 0.9):
        plugin = {
            "type": "principled",
            "base_color": color,
            "roughness": roughness,
            "specular": 0.0,
        }
        spec = f"disney-diffuse:roughness={roughness},color=0.2/0.5/0.8"
        found = parse_spec(spec).transfer(light, view)
        np.testing.assert_allclose(found, mitsuba_values(mitsuba, plugin, light, view), rtol=1e-3)


def test_ggx_of_mitsuba(mitsuba, rng):
    """Mitsuba masks and shadows independently of each other: its G is the product of both."""
    light, view = upper(rng, 60), upper(rng, 60)
    alpha = 0.55**2
    one, other = ((np.sqrt(1 + alpha**2 * (1 / v[:, 2] ** 2 - 1)) - 1) / 2 for v in (light, view))
    correlation = (1 + one) * (1 + other) / (1 + one + other)
    plugin = {"type": "roughconductor", "alpha": alpha, "distribution": "ggx", "material": "none"}
    expected = mitsuba_values(mitsuba, plugin, light, view) * correlation[:, None]
    found = parse_spec("ggx:roughness=0.55,f0=1").transfer(light, view)
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    gold = {"type": "rgb", "value": [1.0, 0.782, 0.344]}
    plugin = {"type": "principled", "base_color": gold, "roughness": 0.55, "metallic": 1.0}
    expected = mitsuba_values(mitsuba, plugin, light, view) * correlation[:, None]
    found = parse_spec("ggx:roughness=0.55,f0=gold").transfer(light, view)
    np.testing.assert_allclose(found, expected, rtol=1e-3)


BRUSHED = {
    "ggx:ax=0.5,ay=0.12": (0.5, 0.12),
    "ggx:ax=0.06,ay=0.3": (0.06, 0.3),
    # KHR_materials_anisotropy: mix(alpha, 1, strength^2) along the tangent.
    "ggx:roughness=0.5,anisotropy=0.6": (0.52, 0.25),
    # OpenPBR 1.1, section on microfacet models: r^2 sqrt(2 / (1 + (1 - s)^2)), and 1 - s of it.
    "ggx:roughness=0.5,anisotropy=0.6,mapping=openpbr": (0.328266, 0.131306),
}


@pytest.mark.parametrize(("spec", "alphas"), BRUSHED.items())
def test_brushed_ggx_of_mitsuba(mitsuba, rng, spec, alphas):
    """At generic azimuths; Mitsuba's G is the product of masking and shadowing."""
    light, view = upper(rng, 200), upper(rng, 200)
    lambdas = []
    for v in (light, view):
        slope = ((alphas[0] * v[:, 0]) ** 2 + (alphas[1] * v[:, 1]) ** 2) / v[:, 2] ** 2
        lambdas.append((np.sqrt(1 + slope) - 1) / 2)
    one, other = lambdas
    correlation = (1 + one) * (1 + other) / (1 + one + other)
    plugin = {"type": "roughconductor", "distribution": "ggx", "material": "none",
              "alpha_u": alphas[0], "alpha_v": alphas[1]}  # fmt: skip
    expected = mitsuba_values(mitsuba, plugin, light, view) * correlation[:, None]
    found = parse_spec(spec).transfer(light, view)
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=1e-6)


def test_brushed_ggx_is_reciprocal_and_loses_light(rng):
    """The albedo, by a grid over the hemisphere, is at most 1; light on several facets is lost."""
    brdf = parse_spec("ggx:roughness=0.6,anisotropy=0.7")
    light, view = upper(rng, 200), upper(rng, 200)
    np.testing.assert_allclose(brdf.evaluate(light, view), brdf.evaluate(view, light), rtol=1e-12)
    height = (np.arange(400) + 0.5) / 400
    azimuth = 2 * np.pi * (np.arange(800) + 0.5) / 800
    z, p = (axis.ravel() for axis in np.meshgrid(height, azimuth))
    sine = np.sqrt(1 - z * z)
    lights = np.stack([sine * np.cos(p), sine * np.sin(p), z], axis=-1)
    albedos = [brdf.transfer(lights, each)[:, 0].mean() * 2 * np.pi for each in view[:9]]
    assert max(albedos) < 1
    assert min(albedos) > 0.6


def test_ggx_of_two_equal_alphas_is_ggx(rng):
    light, view = upper(rng, 60), upper(rng, 60)
    even, equal = parse_spec("ggx:roughness=0.5"), parse_spec("ggx:ax=0.25")
    assert equal.isotropic
    assert repr(equal) == repr(even)
    np.testing.assert_array_equal(equal.evaluate(light, view), even.evaluate(light, view))
    nearly = parse_spec("ggx:ax=0.25,ay=0.2500001")
    assert not nearly.isotropic
    np.testing.assert_allclose(nearly.evaluate(light, view), even.evaluate(light, view), rtol=1e-5)


@pytest.mark.parametrize(
    ("spec", "why"),
    [
        ("ggx:ay=0.2", "ax is missing"),
        ("ggx:ax=0.2,ay=0.3,roughness=0.4", "roughness does not apply with ax and ay"),
        ("ggx:mapping=openpbr", "mapping applies with anisotropy"),
        ("ggx:anisotropy=1.5", "outside 0 .. 1"),
    ],
)
def test_alphas_and_mappings_that_do_not_fit_are_refused(spec, why):
    with pytest.raises(BrdfError, match=why):
        parse_spec(spec)


def test_optional_parameters_are_recorded_only_where_they_are_given():
    """Labels and files of even surfaces are as they were."""
    assert parse_spec("ggx").values.keys() == {"roughness", "f0"}
    brushed = parse_spec("ggx:roughness=0.5,anisotropy=0.6")
    assert repr(brushed) == "ggx:roughness=0.5,anisotropy=0.6,f0=1"
    assert type(brushed)(**brushed.values).alphas == brushed.alphas


def test_beckmann_distribution_of_mitsuba(mitsuba, rng):
    """Seen along the half vector's mirror, G and F are 1: what remains is D / (4 cos^2)."""
    distribution = mitsuba.MicrofacetDistribution(mitsuba.MicrofacetType.Beckmann, 0.4)
    brdf = parse_spec("cook-torrance:roughness=0.4,f0=1")
    for view in upper(rng, 40):
        if view[2] < 0.75:  # light and view coincide, and G = min(1, 2 (N.H)^2) = 1
            continue
        expected = distribution.eval(mitsuba.Vector3f(*view)) / (4 * view[2] ** 2)
        np.testing.assert_allclose(brdf.evaluate(view, view), expected, rtol=1e-3)


def test_metals_resemble_those_of_mitsuba(mitsuba):
    """Its indices of refraction are other measurements, seen through other colour matching."""
    up = np.array([[0.0, 0.0, 1.0]])
    for name, material in (("gold", "Au"), ("silver", "Ag"), ("copper", "Cu"), ("aluminum", "Al")):
        plugin = {"type": "roughconductor", "alpha": 0.3, "distribution": "ggx"}
        metal = mitsuba_values(mitsuba, {**plugin, "material": material}, up, up)
        mirror = mitsuba_values(mitsuba, {**plugin, "material": "none"}, up, up)
        found = parse_spec(f"ggx:f0={name}").color("f0")
        np.testing.assert_allclose(found, (metal / mirror)[0], atol=0.04)
