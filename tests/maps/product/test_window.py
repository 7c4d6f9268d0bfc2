"""The window of light under a product texture, beside light that is reflected by brute force."""

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.irradiance.window import make_window
from shrm_cli.maps.product.prefilter import product_texture
from shrm_cli.maps.product.product import VaryingProduct
from shrm_cli.maps.product.steps import Steps
from shrm_cli.maps.product.window import product_window
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.directions import turn_matrix
from shrm_cli.sphere.rotation import transform_coefficients
from tests import brute_force
from tests.makers import prefilter_product as prefilter
from tests.maps.product.test_product import ward
from tests.maps.product.test_varying import varying

ROWS, COUNT, ORDER = 32, 8000, 8
SUMMED = 300
"""The points of them whose truth is summed."""
ALLOWED = 0.01
"""The share of what is seen that may be black; an average over `COUNT` points is off by a tenth."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
SURFACE = 0.5, 0.2


def sky(lamp):
    """A sky that is brighter above, with a lamp of two pixels that is so much brighter."""
    light, _ = brute_force.latlong_samples(ROWS)
    pixels = (0.4 + 0.3 * light[:, 1:2]) * np.array([0.8, 1.0, 1.3])
    pixels = pixels.reshape(ROWS, 2 * ROWS, 3)
    pixels[9, 20:22] += lamp * np.array([1.0, 0.9, 0.8])
    return pixels.astype(np.float32)


@pytest.fixture(scope="module")
def points():
    rng = np.random.default_rng(3)
    normals, views = brute_force.pixels_of_spheres(rng, COUNT)
    tangents = np.cross(normals, brute_force.unit(rng, COUNT))
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    return normals, tangents, views


@pytest.fixture(scope="module")
def texture():
    return product_texture(parse_spec(f"ward:ax={SURFACE[0]},ay={SURFACE[1]}"), ORDER, 48).map


def truth(pixels, points):
    """What is reflected, by sums over the pixels."""
    light, weights = brute_force.latlong_samples(ROWS)
    radiance = pixels.reshape(-1, 3) * weights[:, None]
    found = []
    for normal, tangent, view in zip(*points, strict=True):
        frame = np.array([tangent, np.cross(normal, tangent), normal])
        local = light @ frame.T
        above = local[:, 2] > 0
        found.append(ward(local[above], frame @ view, *SURFACE) @ radiance[above])
    return np.array(found)


def black(shown):
    """The largest share of a channel that is negative."""
    return np.mean(shown < 0, axis=0).max()


def errors(everywhere, expected):
    """The relative RMS error, the p95 of that of the luminance, and the share that is negative."""
    found = everywhere[: len(expected)]
    seen, wanted = found @ LUMINANCE, expected @ LUMINANCE
    return (
        np.sqrt(np.sum((found - expected) ** 2) / np.sum(expected**2)),
        np.quantile(np.abs(seen - wanted) / wanted, 0.95),
        black(everywhere),
    )


@pytest.mark.proof
@pytest.mark.parametrize("lamp", [2, 50, 200, 2000])
def test_it_blurs_no_more_than_leaves_few_black_spots(texture, points, lamp):
    pixels = sky(lamp)
    series = project(Probe.from_array(pixels, layout="latlong"), ORDER).coefficients
    expected = truth(pixels, [each[:SUMMED] for each in points])
    windows = {
        "none": make_window("none", series),
        "of the light": make_window("auto", series),
        "auto": product_window("auto", texture, series),
    }
    found = {
        name: errors(texture.lit(each.apply(series)).brushed_radiance(*points), expected)
        for name, each in windows.items()
    }
    assert found["auto"][2] <= 1.2 * ALLOWED
    assert found["auto"][0] <= found["of the light"][0] + 1e-9
    if found["none"][2] <= 0.5 * ALLOWED:
        assert windows["auto"].factors == ()
    if found["none"][2] > 2 * ALLOWED:
        assert found["auto"][1] < found["none"][1]
    if lamp == 2:
        assert make_window("auto", series).factors == windows["auto"].factors == ()
    if lamp == 50:  # the light alone is negative, and what is reflected is not
        assert windows["of the light"].factors
        assert windows["auto"].factors == ()
    if lamp == 2000:
        assert found["none"][2] > 0.02


@pytest.mark.parametrize("lamp", [400, 1000, 3000])
def test_it_is_as_weak_as_leaves_few_black_spots(texture, points, lamp):
    """Half of what the window does would leave more."""
    pixels = sky(lamp)
    series = project(Probe.from_array(pixels, layout="latlong"), ORDER).coefficients
    factors = np.array(product_window("auto", texture, series).factors)
    shares = []
    for strength in (0.0, 0.5, 1.0):
        by_degree = 1 - strength * (1 - factors)
        by_index = np.repeat(by_degree, 2 * np.arange(ORDER + 1) + 1)[:, None]
        shares.append(black(texture.lit(by_index * series).brushed_radiance(*points)))
    assert 0.8 * ALLOWED <= shares[2] <= 1.2 * ALLOWED
    assert shares[0] >= shares[1] > shares[2]


def test_a_lamp_of_one_color_leaves_few_spots_that_lack_it(texture, points):
    """Beside a red sun under a blue sky metal had teal spots: its red alone was negative."""
    pixels = sky(400) * np.array([1, 0, 0], np.float32) + sky(0) * np.array([0, 1, 2], np.float32)
    series = project(Probe.from_array(pixels, layout="latlong"), ORDER).coefficients
    window = product_window("auto", texture, series)
    plain, shown = (
        texture.lit(light).brushed_radiance(*points) for light in (series, window.apply(series))
    )
    assert black(plain @ LUMINANCE) < 0.5 * black(plain)
    assert black(plain) > 2 * ALLOWED
    assert black(shown) <= 1.2 * ALLOWED
    # What is told is why there is a window: red lacks in more than is black.
    assert window.spots == pytest.approx(black(plain), rel=0.1)


def test_hair_around_the_vertical_has_few_spots():
    hair = product_texture(parse_spec("kajiya-kay:exponent=16"), 4, 32).map
    series = project(Probe.from_array(sky(6000), layout="latlong"), 4).coefficients
    rng = np.random.default_rng(8)
    points = brute_force.pixels_of_spheres(rng, 4000)
    plain, lit = (
        black(hair.lit(each).radiance(*points))
        for each in (series, product_window("auto", hair, series).apply(series))
    )
    assert plain > 10 * ALLOWED
    assert lit <= 1.2 * ALLOWED


def test_what_it_costs_is_measured(texture, points):
    series = project(Probe.from_array(sky(2000), layout="latlong"), ORDER).coefficients
    for spec in ("auto", "hann", "lanczos:6"):
        window = product_window(spec, texture, series)
        light = texture.lit(series).brushed_radiance(*points)
        windowed = texture.lit(window.apply(series)).brushed_radiance(*points)
        lost, whole = np.sum((windowed - light) ** 2), np.sum(light**2)
        assert window.change == pytest.approx(np.sqrt(lost / whole), rel=0.1), spec
        before, after = light @ LUMINANCE, windowed @ LUMINANCE
        scale = np.maximum(np.maximum(before, after), 0.02 * before.mean())
        relative = np.abs(after - before) / scale
        assert window.p95_change == pytest.approx(np.quantile(relative, 0.95), rel=0.1), spec
        assert window.spots == pytest.approx(black(light), rel=0.1), spec
    assert product_window("none", texture, series).change == 0


@pytest.mark.proof
def test_all_values_of_a_parameter_are_looked_at():
    made = varying("ward:ax=0.9", "ay", (0.1, 0.9), 24, ORDER)
    series = project(Probe.from_array(sky(2000), layout="latlong"), ORDER).coefficients
    sharp, dull = (product_window("auto", made.at(share), series) for share in (0.0, 1.0))
    both = product_window("auto", made, series)
    assert dull.change < sharp.change

    def strength(window):
        return np.sum((1 - np.array(window.factors)) ** 2)

    assert strength(both) >= 0.5 * strength(sharp)
    # Of two parameters the surface is sharp at one corner, and not where both are alike.
    corner = np.array([[[0.0, 1.0], [0.0, 1.0]], [[1.0, 0.0], [0.0, 1.0]]])
    two = VaryingProduct.of(made.textures, Steps({"a": (0, 1), "b": (0, 1)}, corner))
    alike = [product_window("auto", two.at(share), series) for share in (0.0, 0.5, 1.0)]
    seldom = product_window("auto", two, series)
    assert strength(seldom) > 1.2 * max(strength(each) for each in alike)


@pytest.mark.proof
def test_prefilter_states_the_change_as_an_error_that_is_added():
    brdf = parse_spec(f"ward:ax={SURFACE[0]},ay={SURFACE[1]}")
    made = prefilter(Probe.from_array(sky(2000), layout="latlong"), brdf, ORDER, 24)
    assert made.facts["window"]["name"] == "least"
    # Relative to all of the light, of which the texture shows the degrees up to its order.
    assert 0.3 * made.facts["window"]["change"] < made.map.info.added_error
    assert made.map.info.added_error < 1.1 * made.facts["window"]["change"]
    dim = prefilter(Probe.from_array(sky(50), layout="latlong"), brdf, ORDER, 24)
    assert dim.facts["window"]["name"] == "none"
    assert dim.map.info.added_error == 0


def test_prefilter_tells_light_that_its_order_does_not_show():
    """In a sharp lobe next to nothing of a sun is left, which pictures alone would tell."""
    probe = Probe.from_array(sky(2000), layout="latlong")
    (line,) = prefilter(probe, parse_spec("ggx:roughness=0.2"), 2, 16, window="none").warnings
    assert line.startswith("the reflected light is wrong by 9")
    assert line.endswith("for order 2 shows nothing sharper; raise `order`, or take `to` auto")
    assert not prefilter(probe, parse_spec("lambertian"), 4, 16, window="none").warnings


@pytest.mark.parametrize("mean", [0, -1])
def test_light_without_a_positive_mean_has_no_window(texture, mean):
    """Lamps that were subtracted leave such light; no factor of a degree changes its mean."""
    light = np.full(((ORDER + 1) ** 2, 3), 0.1 * mean)
    light[0] = mean
    assert product_window("auto", texture, light).factors == ()


@pytest.mark.parametrize(
    ("spec", "order"), [("ggx:roughness=0.4,f0=1", 4), ("phong:exponent=9", 2)]
)
def test_turned_light_has_the_same_window(rng, spec, order):
    """Of isotropic surfaces: nothing tells up from down but the light."""
    texture = product_texture(parse_spec(spec), order, 32).map
    light = project(Probe.from_array(sky(2000)), order)
    found = []
    for angles in ((0, 0, 0), (30, -70, 100)):
        turned = transform_coefficients(light.coefficients, turn_matrix(*angles))
        found.append(product_window("auto", texture, turned))
    assert found[0].factors
    assert min(found[0].factors) < 0.97
    np.testing.assert_allclose(found[0].factors, found[1].factors, atol=1e-6)
    assert found[0].change == pytest.approx(found[1].change, abs=1e-6)
