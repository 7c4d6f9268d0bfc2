"""Product textures against integrals that are written out again, at generic frames."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.product import LightRule, ProductFunctions, ProductQuadrature, scout_views
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import ArgumentError, BrdfError, MapError
from shrm_cli.maps.product.make import product
from shrm_cli.maps.product.prefilter import product_table, product_texture
from shrm_cli.prefilter import prefilter as prefilter_any
from shrm_cli.probe import lighting
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import Reference
from shrm_cli.sphere.parabolic import parabolic_directions, project, unproject
from tests import brute_force, oracles
from tests.makers import prefilter_product as prefilter

PROBES = Path(__file__).resolve().parents[3] / "probes"
ORDER = 4
FRAMES = 24


def ward(light, view, ax, ay):
    """Ward's lobe times the cosine, of lights (n, 3) and a view (3,) in the surface's frame."""
    x, y, z = (light + view).T
    slope = ((x / ax) ** 2 + (y / ay) ** 2) / z**2
    return np.exp(-slope) * (x**2 + y**2 + z**2) / (np.pi * ax * ay * z**4) * light[:, 2]


def ashikhmin_shirley(light, view, nu, nv, specular):
    """Equations 4 and 5 of Ashikhmin and Shirley 2000, without the diffuse part, and the cosine."""
    half = light + view
    half = half / np.linalg.norm(half, axis=1)[:, None]
    towards = half @ view
    exponent = (nu * half[:, 0] ** 2 + nv * half[:, 1] ** 2) / (1 - half[:, 2] ** 2)
    fresnel = specular + (1 - specular) * (1 - towards) ** 5
    lobe = np.sqrt((nu + 1) * (nv + 1)) / (8 * np.pi) * half[:, 2] ** exponent
    return lobe / (towards * np.maximum(light[:, 2], view[2])) * fresnel * light[:, 2]


MODELS = {
    "ward:ax=0.5,ay=0.2": lambda light, view: ward(light, view, 0.5, 0.2),
    "ashikhmin-shirley:nu=12,nv=48,specular=0.3": lambda light, view: ashikhmin_shirley(
        light, view, 12, 48, 0.3
    ),
}


def above_surface(rings, around):
    """Directions with z > 0, and their weights: Gauss's rule in z times even azimuths."""
    z, weights = np.polynomial.legendre.leggauss(rings)
    z, weights = np.repeat((z + 1) / 2, around), np.repeat(weights / 2, around)
    phi = np.tile(2 * np.pi * (np.arange(around) + 0.5) / around, rings)
    sine = np.sqrt(1 - z**2)
    directions = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)
    return directions, weights * 2 * np.pi / around


@pytest.fixture(scope="module")
def hemisphere():
    """Directions above a surface, and solid angles: Gauss by even azimuths, very many of both."""
    return above_surface(100, 200)


@pytest.fixture(scope="module")
def frames():
    """Surfaces in world axes, and views above them, down to 4 degrees."""
    rng = np.random.default_rng(11)
    axes = np.array([oracles.random_rotation(rng) for _ in range(FRAMES)])
    z = rng.uniform(0.07, 1.0, FRAMES)
    phi = rng.uniform(0, 2 * np.pi, FRAMES)
    sine = np.sqrt(1 - z**2)
    local = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)
    return axes, np.einsum("nij,ni->nj", axes, local), local


@pytest.fixture(scope="module")
def light():
    return np.random.default_rng(5).normal(size=((ORDER + 1) ** 2, 3))


@pytest.fixture(scope="module", params=MODELS)
def made(request):
    return request.param, product_texture(parse_spec(request.param), ORDER, 128).map


def relative_rms(found, truth):
    return np.sqrt(np.sum((found - truth) ** 2) / np.sum(truth**2))


@pytest.mark.proof
@pytest.mark.slow
def test_shading_is_the_integral_under_band_limited_light(made, light, frames, hemisphere):
    spec, texture = made
    directions, weights = hemisphere
    axes, views, local = frames
    expected = np.array(
        [
            (weights * MODELS[spec](directions, view))
            @ (oracles.real_harmonics(ORDER, directions @ frame) @ light)
            for frame, view in zip(axes, local, strict=True)
        ]
    )
    found = texture.lit(light).brushed_radiance(axes[:, 2], axes[:, 0], views)
    assert relative_rms(found, expected) < 1e-4
    # The wrong tangent would be seen.
    turned = texture.lit(light).brushed_radiance(axes[:, 2], axes[:, 1], views)
    assert relative_rms(turned, expected) > 0.05


@pytest.mark.proof
def test_bilinear_look_ups_keep_their_stated_error(made):
    """Over views spread evenly more than a degree above the horizon, against exact integrals."""
    spec, texture = made
    rng = np.random.default_rng(4)
    z, phi = rng.uniform(0.02, 1, 400), rng.uniform(0, 2 * np.pi, 400)
    sine = np.sqrt(1 - z**2)
    views = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)
    exact = ProductFunctions.of(parse_spec(spec), ORDER).coefficients(views, ORDER)
    error = relative_rms(texture.values(views, linear=True), exact)
    assert texture.info.filter_error == pytest.approx(error, rel=0.4)
    assert error < 3e-3


@pytest.mark.parametrize("along", [8, 40])
@pytest.mark.parametrize("width", [(0.03, 0.03), (0.4, 0.4), (1.0, 1.0), (0.6, 0.2), (0.1, 0.4)])
def test_nodes_cover_the_hemisphere(along, width):
    views = np.concatenate(scout_views())
    around = 96 if width[0] == width[1] else 192
    directions, weights = LightRule("reflection", width, True).nodes(views, along, around)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1, atol=1e-12)
    assert directions[..., 2].min() > -1e-12
    assert weights.min() >= 0  # parts between azimuths that coincide are empty
    if along == 40:
        np.testing.assert_allclose(weights.sum(axis=1), 2 * np.pi, rtol=1e-6)
        moments = np.einsum("nj,njk->nk", weights, directions)
        np.testing.assert_allclose(moments, np.tile([0, 0, np.pi], (len(views), 1)), atol=1e-5)


def test_lobes_that_are_far_longer_than_wide():
    """Sums over even slopes of the half vector; views along both axes crowd where others do not."""
    ax, ay = 0.8, 0.01
    theta, phi = np.radians([[30, 45, 80], [200, 0, 90]])
    sine = np.sin(theta)
    views = np.stack([sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)], axis=1)
    steps = [np.linspace(-end * a, end * a, n) for end, a, n in ((40, ax, 8001), (6, ay, 121))]
    x, y = (each.ravel() for each in np.meshgrid(*steps, indexing="ij"))
    length = np.sqrt(1 + x**2 + y**2)
    half = np.stack([x, y, np.ones_like(x)], axis=1) / length[:, None]
    area = (steps[0][1] - steps[0][0]) * (steps[1][1] - steps[1][0]) / length**3
    found = ProductFunctions.of(parse_spec(f"ward:ax={ax},ay={ay}"), ORDER).coefficients(
        views, ORDER
    )
    for own, view in zip(found[..., 0], views, strict=True):
        towards = half @ view
        light = 2 * towards[:, None] * half - view
        above = (towards > 0) & (light[:, 2] > 0)
        weighted = ward(light[above], view, ax, ay) * (4 * area * towards)[above]
        expected = oracles.real_harmonics(ORDER, light[above]).T @ weighted
        assert np.linalg.norm(own - expected) < 2e-4 * np.linalg.norm(expected)


@pytest.mark.parametrize("center", ["reflection", "normal", "tangent"])
def test_nodes_cover_the_sphere_where_there_is_no_horizon(center):
    views = np.concatenate(scout_views())
    directions, weights = LightRule(center, (0.3, 0.3), False).nodes(views, 24, 24)
    np.testing.assert_allclose(weights.sum(axis=1), 4 * np.pi, rtol=1e-9)
    moments = np.einsum("nj,njk->nk", weights, directions)
    np.testing.assert_allclose(moments, 0, atol=1e-9)


@pytest.mark.parametrize(
    "spec",
    ["ward:ax=0.5,ay=0.3", "microfacet:sigma=0.4", "kajiya-kay:exponent=8", "phong:exponent=8"],
)
@pytest.mark.parametrize("size", [12, 13])
def test_symmetries_fill_the_texture_with_what_its_views_have(spec, size):
    brdf = parse_spec(spec)
    functions = ProductFunctions.of(brdf, 3)
    table = product_table(brdf, functions, 3, size)
    direct = functions.coefficients(parabolic_directions(size).reshape(-1, 3), 3)
    assert table.shape == (size, size, 16, 1)
    np.testing.assert_allclose(table.reshape(-1, 16, 1), direct, atol=3e-6 * np.abs(direct).max())


class Lopsided(Brdf):
    """Brighter on one side, so that no mirror leaves it as it is."""

    name = "lopsided"
    center = "normal"
    isotropic = False

    def evaluate(self, light, view):
        side = 1 + 0.5 * light[..., 0] + 0.3 * view[..., 1] * light[..., 2]
        return np.stack([side, side**2, 0.5 * side], axis=-1)


def test_a_brdf_without_symmetry_and_with_colors():
    functions = ProductFunctions.of(Lopsided(), 2)
    table = product_table(Lopsided(), functions, 2, 10)
    assert table.shape == (10, 10, 9, 3)
    views = parabolic_directions(10)
    # The integrals of side, its harmonics of degree 1 and the cosine, by hand: the mean of x^2 z
    # over the hemisphere is pi/4, that of z is pi and that of z^2 is 2 pi/3.
    y = views[..., 1]
    constant = (np.pi + 0.3 * y * 2 * np.pi / 3) * np.sqrt(1 / (4 * np.pi))
    np.testing.assert_allclose(table[..., 0, 0], constant, atol=1e-5)
    along_x = 0.5 * np.pi / 4 * np.sqrt(3 / (4 * np.pi))
    np.testing.assert_allclose(table[..., 3, 0], along_x, atol=1e-5)
    np.testing.assert_allclose(table[..., 2], 0.5 * table[..., 0], atol=1e-6)


class Twisted(Brdf):
    """Brushed along a diagonal: half a turn leaves it as it is, and no mirror does."""

    name = "twisted"
    center = "normal"
    isotropic = False

    def evaluate(self, light, view):
        along, of_view = (each[..., 0] * each[..., 1] for each in (light, view))
        value = 1 + along + of_view * (1 + light[..., 0] * view[..., 0])
        return np.broadcast_to(value[..., None], (*value.shape, 3))


@pytest.mark.parametrize(("brdf", "share"), [(Twisted(), 2), (Lopsided(), 1)])
def test_texels_off_the_circle_and_half_turns_cost_nothing(brdf, share):
    size, order = 48, 3
    functions = ProductFunctions.of(brdf, order)
    views = parabolic_directions(size).reshape(-1, 3)
    asked = []

    class Counting(ProductFunctions):
        def coefficients(self, views, order):
            asked.append(len(views))
            return super().coefficients(views, order)

    table = product_table(brdf, Counting(functions.terms), order, size)
    direct = functions.coefficients(views, order)
    np.testing.assert_allclose(
        table.reshape(direct.shape), direct, atol=3e-6 * np.abs(direct).max()
    )
    inside = np.count_nonzero(np.hypot(*project(views)) < 1 - 1.001 / size)
    assert sum(asked) == (inside + 512) / share
    assert inside + 512 < len(views)


@pytest.mark.slow
def test_sums_are_sums_of_their_terms():
    views = np.concatenate(scout_views())
    terms = ["ward:ax=0.5,ay=0.2", "lambertian:albedo=0.8/0.4/0.2", "phong:exponent=8"]
    weights = [0.5, 0.3, 0.2]
    whole = ProductFunctions.of(
        parse_spec("+".join(f"{w}*{t}" for w, t in zip(weights, terms, strict=True))), ORDER
    ).coefficients(views, ORDER)
    parts = [ProductFunctions.of(parse_spec(t), ORDER).coefficients(views, ORDER) for t in terms]
    expected = sum(w * part for w, part in zip(weights, parts, strict=True))
    np.testing.assert_allclose(whole, expected, atol=1e-12)


def test_energy_of_high_degrees_is_no_noise_of_the_nodes(hemisphere):
    """Poulin and Fournier's cylinders have kinks, for which nodes are few."""
    brdf = parse_spec("poulin-fournier")
    functions = ProductFunctions.of(brdf, ORDER, 1e-2)
    views = np.concatenate([scouts[::8] for scouts in scout_views()])
    directions, weights = hemisphere
    squares = np.array([brdf.transfer(directions, view)[:, 0] ** 2 @ weights for view in views])
    for order in (ORDER, 16):
        coefficients, energy = functions.expanded(views, order)
        np.testing.assert_allclose(energy.sum(), squares.sum(), rtol=0.01)
        assert np.sum(coefficients**2) < 1.01 * squares.sum()


def test_fibres_along_the_tangent(hemisphere):
    """Kajiya and Kay's lobe is about the tangent, and lit from all around."""
    spec = "kajiya-kay:exponent=8"
    functions = ProductFunctions.of(parse_spec(spec), ORDER)
    directions, weights = hemisphere
    sphere = np.concatenate([directions, directions * [1, 1, -1]])
    around = np.concatenate([weights, weights])
    view = unproject(np.array([0.3]), np.array([-0.5]))
    brdf = parse_spec(spec)
    # The angle to the tangent alone matters, with the azimuth around it.
    light_x, view_x = sphere[:, 0], view[0, 0]
    turned = np.stack([sphere[:, 1], sphere[:, 2], light_x], axis=-1)
    own = np.array([view[0, 1], view[0, 2], view_x])
    expected = oracles.real_harmonics(ORDER, sphere).T @ (around * brdf.transfer(turned, own)[:, 0])
    found = functions.coefficients(view, ORDER)[0, :, 0]
    np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.proof
def test_equal_to_an_shrm_of_the_same_isotropic_brdf():
    """A map that keeps every order of the view that counts reflects the same band-limited light."""
    rng = np.random.default_rng(2)
    image = rng.uniform(0, 1, (24, 48, 3)).astype(np.float32)
    probe = Probe.from_array(image)
    texture = prefilter(probe, parse_spec("microfacet:sigma=0.4"), ORDER, 64).map
    reflections, views = brute_force.unit(rng, 300), brute_force.unit(rng, 300)
    normals = reflections + views
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    found, errors = texture.radiance(normals, views), []
    for order_p in (6, 12, 24):
        options = {"order_f": ORDER, "order_p": order_p, "size": 48}
        shrm = prefilter_any(probe, "microfacet:sigma=0.4", **options)
        errors.append(relative_rms(found, shrm.radiance(normals, views)))
    # What is left is the truncation in P, at grazing views.
    assert errors[0] < 4e-3
    assert errors[2] < errors[1] / 1.5 < errors[0] / 3
    assert errors[2] < 6e-4


@pytest.mark.proof
@pytest.mark.parametrize("order", [4, 16])
def test_the_error_of_sharp_lobes_is_predicted_beyond_all_known_degrees(order):
    """It was 2.5 times as large: light beyond was as dense as that of degrees 9 to 16."""
    probe, brdf = open_probe(PROBES / "studio.exr"), parse_spec("ggx:roughness=0.3")
    found = prefilter(probe, brdf, order, 64, "none").map
    rng = np.random.default_rng(2)
    normals, views = brute_force.pixels_of_spheres(rng, 2000)
    truth = Reference(probe, brdf).radiance(normals, views)
    measured = relative_rms(found.radiance(normals, views), truth)
    assert found.info.predicted_error == pytest.approx(measured, rel=0.15)


@pytest.mark.proof
def test_the_predicted_error_is_that_of_pixels_of_spheres():
    rng = np.random.default_rng(8)
    coefficients = rng.normal(size=(49, 3)) / (1 + np.arange(49)[:, None]) ** 0.4
    directions, _ = brute_force.latlong_samples(48)
    values = oracles.real_harmonics(6, directions) @ coefficients
    image = (values - values.min()).reshape(48, 96, 3).astype(np.float32)
    coefficients[0] -= values.min() * np.sqrt(4 * np.pi)
    texture = prefilter(Probe.from_array(image), parse_spec("ward:ax=0.5,ay=0.2"), 2, 32).map
    some, weights = above_surface(40, 80)
    lost = whole = 0.0
    z = np.sqrt(rng.uniform(0, 1, 250))  # as pixels of spheres have it
    phi = rng.uniform(0, 2 * np.pi, 250)
    for height, turn in zip(z, phi, strict=True):
        sine = np.sqrt(1 - height**2)
        view = np.array([sine * np.cos(turn), sine * np.sin(turn), height])
        frame = oracles.random_rotation(rng)
        harmonics = oracles.real_harmonics(6, some @ frame)
        product = (weights * ward(some, view, 0.5, 0.2)) @ harmonics
        lost += np.sum((product[9:] @ coefficients[9:]) ** 2)
        whole += np.sum((product @ coefficients) ** 2)
    assert texture.info.predicted_error == pytest.approx(np.sqrt(lost / whole), rel=0.15)


@pytest.mark.proof
@pytest.mark.slow
def test_a_window_leaves_few_black_spots():
    image = np.full((32, 64, 3), 0.05, dtype=np.float32)
    image[8, 20] = 900, 700, 500
    probe, brdf = Probe.from_array(image), parse_spec("ward:ax=0.4,ay=0.2")
    rng = np.random.default_rng(3)
    normals = brute_force.unit(rng, 3000)
    tangents = np.cross(normals, brute_force.unit(rng, 3000))
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    views = brute_force.unit(rng, 3000)
    views *= np.sign(np.sum(views * normals, axis=1))[:, None]
    plain = prefilter(probe, brdf, ORDER, 32, window="none")
    made = prefilter(probe, brdf, ORDER, 32)
    luminance = [0.2126, 0.7152, 0.0722]
    before, shown = (
        each.map.brushed_radiance(normals, tangents, views) @ luminance for each in (plain, made)
    )
    # A hundredth of what is seen may be black, each view as far as the surface is turned to it.
    seen = np.sum(normals * views, axis=1)
    assert np.average(before < 0, weights=seen) > 0.03
    assert 0.003 <= np.average(shown < 0, weights=seen) <= 0.012
    assert made.map.info.added_error > 0.05
    with pytest.raises(ArgumentError, match="no such window"):
        prefilter(probe, brdf, window="boxcar")


def test_light_is_needed_and_of_enough_orders():
    texture = product_texture(parse_spec("lambertian"), 2, 8).map
    with pytest.raises(MapError, match="no light"):
        texture.radiance([0.0, 0, 1], [0.0, 0, 1])
    with pytest.raises(MapError, match="9 coefficients"):
        texture.lit(np.zeros((4, 3)))
    for wrong in ("a", {"a": 1}, [["a", "b", "c"]] * 25):
        with pytest.raises(MapError, match="is no light; give coefficients, 9 x 3"):
            texture.lit(wrong)
    sky = lighting.project(Probe.from_array(np.ones((16, 32, 3))), 5)
    assert np.array_equal(texture.lit(sky).lighting, sky.coefficients[:9])
    lit = texture.lit(np.ones((25, 3)))
    assert lit.lighting.shape == (9, 3)


def test_a_uniform_light_is_multiplied_by_the_albedo():
    """Lambert's albedo comes back whatever the frame."""
    texture = product_texture(parse_spec("lambertian:albedo=0.6/0.3/0.1"), 2, 16).map
    light = np.zeros((9, 3))
    light[0] = np.sqrt(4 * np.pi)
    shown = texture.lit(light).radiance(
        [[0.6, 0.8, 0.0], [0, -1.0, 0]], [[0.0, 1, 0], [0, -1.0, 0]]
    )
    np.testing.assert_allclose(shown, [[0.6, 0.3, 0.1]] * 2, rtol=1e-6)


def test_what_is_not_finite_or_does_not_apply_is_refused():
    class Infinite(Lopsided):
        name = "infinite"

        def evaluate(self, light, view):
            return super().evaluate(light, view) / 0.0

    with pytest.raises(BrdfError, match="not finite"), np.errstate(all="ignore"):
        ProductQuadrature.converged(Infinite(), scout_views()[0], 2)
    texture = product_texture(parse_spec("lambertian"), 1, 8).map
    with pytest.raises(ArgumentError, match="size"):
        texture.resampled(4)
    with pytest.raises(ArgumentError, match="made from the probe"):
        texture.converted("shrm")
    assert replace(texture).order == 1


@pytest.mark.parametrize(
    ("name", "value"),
    [("order", -1), ("order", 2.5), ("size", 0), ("size", 1), ("size", "8"), ("steps", 1)],
)
def test_numbers_that_no_texture_has_are_refused(name, value):
    given = {"order": 1, "size": 8, "vary": ("exponent", 5, 10), name: value}
    with pytest.raises(ArgumentError, match=f"^`{name}` {value!r} is not a whole number of "):
        product("phong", **given)


def test_no_parameter_to_vary_is_refused():
    with pytest.raises(ArgumentError, match="`vary` names no parameter; leave it out"):
        product("phong", 1, 8, [])
