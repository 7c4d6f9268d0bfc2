"""SH exponentials: the two laws written out again, and what they do to light that is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import sph_harm_y

from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.she.exponential import SphericalHarmonicExponential
from tests import ggx, oracles
from tests.brute_force import unit
from tests.makers import environment_brdf

INFO = MapInfo(32, 0, 0.0, 1.0, 0.0, {"name": "ggx", "parameters": {}}, "p.exr", "ab" * 32)
UNIT_LIGHT = np.sqrt(4 * np.pi)
"""What p_00 gains where the logarithm of the light gains 1."""


def random_map(order_p=4, order_q=2, law="lobe", seed=0, scale=0.3):
    rng = np.random.default_rng(seed)
    return SphericalHarmonicExponential(
        scale * rng.normal(size=((order_p + 1) ** 2, 3)),
        scale * rng.normal(size=((order_q + 1) ** 2 - 1, 3)),
        (0.2, 1.0),
        INFO,
        law,
    )


def uniform(law, colour=(0.5, 1.0, 2.0)):
    """Light of one colour from everywhere."""
    p = np.zeros((25, 3))
    p[0] = np.log(colour) * UNIT_LIGHT
    return SphericalHarmonicExponential(p, np.zeros((8, 3)), (0.2, 1.0), INFO, law)


def pairs(count, seed=3):
    """Normals and views above their surfaces, one along its normal and one near grazing."""
    rng = np.random.default_rng(seed)
    normals, views = unit(rng, count), unit(rng, count)
    views *= np.sign(np.sum(normals * views, axis=1, keepdims=True))
    views[0] = normals[0]
    tangent = np.cross(normals[1], views[1])
    views[1] = 0.02 * normals[1] + np.sqrt(1 - 0.02**2) * tangent / np.linalg.norm(tangent)
    return normals, views


def harmonic(degree, m, direction):
    """Eq. 4.5 from scipy's harmonics, without the phase of Condon and Shortley."""
    x, y, z = direction
    value = sph_harm_y(degree, abs(m), np.arctan2(np.hypot(x, y), z), np.arctan2(y, x))
    if m == 0:
        return value.real
    return np.sqrt(2) * (-1) ** m * (value.real if m > 0 else value.imag)


def lm(count):
    """Degree and order of the first coefficients."""
    order = int(np.sqrt(count)) - 1
    return [(degree, m) for degree in range(order + 1) for m in range(-degree, degree + 1)]


def half_way(one, other):
    total = one + other
    return total / np.linalg.norm(total)


def by_the_paper(made, normal, view, roughness, f0, moments):
    """Eq. 5, 9-12 and 15, one sample and one colour after the other."""
    alpha = roughness**2
    cosine = normal @ view
    reflection = 2 * cosine * normal - view
    half = half_way(normal, reflection)
    result = []
    for channel in range(3):
        log_p = log_q = 0.0
        for (degree, m), coefficient in zip(
            lm(len(made.p_coefficients)), made.p_coefficients[:, channel], strict=True
        ):
            vmf = np.exp(-degree * (degree + 1) / (2 * (1 / alpha)))
            log_p += vmf * harmonic(degree, m, reflection) * coefficient
        for (degree, m), coefficient in zip(
            lm(len(made.q_coefficients) + 1)[1:], made.q_coefficients[:, channel], strict=True
        ):
            vmf = np.exp(-degree * (degree + 1) / (2 * (1 / alpha)))
            log_q += vmf * harmonic(degree, m, half) * coefficient
        base = np.exp(log_p) * np.exp(log_q)
        result.append(f0[channel] * base + (1 - f0[channel]) * base * moments[1, 0])
    return result


def by_the_lobe(made, normal, view, roughness, f0, moments):
    """As the module's first lines have it, one sample and one colour after the other."""
    del roughness  # all of it is in the moments
    tangent = (normal @ view) * normal - view
    if np.linalg.norm(tangent) > 1e-9:
        tangent = tangent / np.linalg.norm(tangent)
    result = []
    for channel in range(3):
        whole = f0[channel] * (moments[0] - moments[1]) + moments[1]
        mean = (whole[1] * normal + whole[2] * tangent) / whole[0]
        kappa = -1 / np.log(np.linalg.norm(mean))
        direction = mean / np.linalg.norm(mean)
        half = half_way(direction, normal)
        exponent = variance = 0.0
        for (degree, m), coefficient in zip(
            lm(len(made.p_coefficients)), made.p_coefficients[:, channel], strict=True
        ):
            a = np.exp(-degree * (degree + 1) / (2 * kappa))
            exponent += a * coefficient * harmonic(degree, m, direction)
            variance += (degree > 0) * (a * coefficient) ** 2
        for (degree, m), coefficient in zip(
            lm(len(made.q_coefficients) + 1)[1:], made.q_coefficients[:, channel], strict=True
        ):
            b = np.exp(-degree * (degree + 1) / (8 * kappa))
            exponent += b * coefficient * harmonic(degree, m, half)
            variance += (b * coefficient) ** 2
        result.append(whole[0] * np.exp(exponent - variance / (8 * np.pi)))
    return result


LAWS = {"paper": by_the_paper, "lobe": by_the_lobe}


@pytest.mark.parametrize("law", ["paper", "lobe"])
@pytest.mark.parametrize(
    ("roughness", "f0", "orders"),
    [
        (0.45, (1.0, 1.0, 1.0), (4, 2)),
        (0.7, (0.9, 0.5, 0.04), (3, 4)),
        (1.0, (0.04, 0.0, 0.3), (4, 2)),
    ],
)
def test_they_are_the_laws_written_out_again(law, roughness, f0, orders):
    made = random_map(*orders, law)
    normals, views = pairs(5)
    found = made.shaded(roughness, f0).radiance(normals, views)
    for k, (normal, view) in enumerate(zip(normals, views, strict=True)):
        moments = ggx.moments(roughness, min(normal @ view, 1.0), 500, 500)
        expected = LAWS[law](made, normal, view, roughness, f0, moments)
        assert found[k] == pytest.approx(expected, rel=1e-4, abs=1e-7), k


def test_there_is_no_other_law():
    """Not even one that is taken for the other of the two."""
    with pytest.raises(ValueError, match="law 'Paper' is not one of lobe, paper"):
        random_map(law="Paper")


def test_the_laws_differ():
    normals, views = pairs(20)
    paper, lobe = (
        random_map(law=law).shaded(0.5, (1, 1, 1)).radiance(normals, views) for law in LAWS
    )
    assert np.abs(np.log(paper / lobe)).min() > 1e-3


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.45, 0.8, 1.0])
@pytest.mark.parametrize("f0", [(1.0, 1.0, 1.0), (0.04, 0.04, 0.04), (1.0, 0.3, 0.0)])
def test_uniform_light_is_reflected_by_the_albedo(roughness, f0):
    """Exactly by the law of the lobe; the paper's does not know how much is shadowed."""
    colour = np.array([0.5, 1.0, 2.0])
    normals, views = pairs(40)
    cosines = np.minimum(np.sum(normals * views, axis=1), 1)
    scale, bias = environment_brdf(roughness, cosines)
    albedo = scale[:, None] * np.array(f0) + bias[:, None]
    found = uniform("lobe", colour).shaded(roughness, f0).radiance(normals, views)
    np.testing.assert_allclose(found, colour * albedo, rtol=0, atol=5e-5 * colour.max())
    paper = uniform("paper", colour).shaded(roughness, f0).radiance(normals, views)
    tail = np.array(f0) + (1 - np.array(f0)) * bias[:, None]
    np.testing.assert_allclose(paper, colour * tail, rtol=0, atol=5e-5 * colour.max())


@pytest.mark.parametrize("law", ["paper", "lobe"])
def test_a_coloured_surface_is_each_channel_alone(law):
    made, f0 = random_map(law=law), (0.9, 0.04, 0.9)
    normals, views = pairs(10)
    found = made.shaded(0.6, f0).radiance(normals, views)
    for channel in range(3):
        grey = made.shaded(0.6, (f0[channel],) * 3).radiance(normals, views)
        np.testing.assert_allclose(found[:, channel], grey[:, channel], rtol=1e-13)
    others = made.shaded(0.6, (0.9, 0.9, 0.9)).radiance(normals, views)
    assert np.abs(found[:, 1] - others[:, 1]).min() > 1e-3


@pytest.mark.parametrize("law", ["paper", "lobe"])
def test_everything_turns_with_the_harmonics(rng, law):
    """Coefficients turned by an oracle: nothing depends on the axes but them."""
    made, turn = random_map(2, 2, law), oracles.random_rotation(rng)
    light, weights = oracles.sphere_rule(4)
    before = oracles.real_harmonics(2, light @ turn)
    matrix = oracles.real_harmonics(2, light).T @ (weights[:, None] * before)
    turned = replace(
        made,
        p_coefficients=matrix @ made.p_coefficients,
        q_coefficients=matrix[1:, 1:] @ made.q_coefficients,
    )
    normals, views = pairs(10)
    found = turned.shaded(0.5, (0.5, 0.5, 0.5)).radiance(normals @ turn.T, views @ turn.T)
    expected = made.shaded(0.5, (0.5, 0.5, 0.5)).radiance(normals, views)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_roughness_keeps_the_mean_of_the_light():
    """To second order in the contrast of the light: c takes back what the curve of exp adds."""
    light, weights = oracles.sphere_rule(40)
    p = random_map(4, 0, scale=0.25).p_coefficients
    made = SphericalHarmonicExponential(p, np.zeros((0, 3)), (0.0, 1.0), INFO)
    means = []
    for roughness in (0.0, 0.4, 0.7, 1.0):
        # N = V: the mean direction of the lobe is N itself.
        seen = made.shaded(roughness, (1.0, 1.0, 1.0)).radiance(light, light)
        scale, bias = environment_brdf(roughness, [1.0])
        means.append(weights @ seen / (scale + bias) / (4 * np.pi))
    assert np.array(means) == pytest.approx(np.broadcast_to(means[0], (4, 3)), rel=0.005)
    plain = np.exp(oracles.real_harmonics(4, light) @ p)
    unblurred = weights @ plain / (4 * np.pi)
    assert np.all(unblurred > 1.03 * means[0])  # without c, that is
    assert means[0] == pytest.approx(np.exp(p[0] / UNIT_LIGHT), rel=0.005)


@pytest.mark.parametrize("law", ["paper", "lobe"])
def test_a_mirror_of_nothing_along_its_normal_is_black_or_the_light(law):
    up = np.array([0.0, 0.0, 1.0])
    found = uniform(law).shaded(0.0, (0.0, 0.0, 0.0)).radiance(up, up)
    assert found == pytest.approx([0, 0, 0], abs=1e-12)


@pytest.mark.parametrize("law", ["paper", "lobe"])
def test_views_from_behind_give_numbers(rng, law):
    """Shading normals may face away; and where V = -N, R = -N too, with no half vector."""
    normals = unit(rng, 30)
    views = np.concatenate([-normals[:10], unit(rng, 20)])
    for roughness in (0.0, 0.5):
        found = random_map(law=law).shaded(roughness, (0.04, 0.5, 1.0)).radiance(normals, views)
        assert np.isfinite(found).all()
        assert found.min() >= 0


def test_shapes_broadcast():
    shaded = random_map().shaded(0.5, (0.5, 0.5, 0.5))
    normals, views = pairs(6)
    one = shaded.radiance(normals[2], views[2])
    assert one.shape == (3,)
    many = shaded.radiance(normals.reshape(2, 3, 3), views[2])
    assert many.shape == (2, 3, 3)
    np.testing.assert_allclose(many[0, 2], one, rtol=1e-12)
    assert shaded.radiance(normals, views).shape == (6, 3)


def test_nothing_overflows():
    made = random_map(scale=1e4)
    with np.errstate(over="raise", invalid="raise"):
        for law in LAWS:
            seen = replace(made, law=law).shaded(0.3, (1, 1, 1)).radiance(*pairs(50))
            assert np.isfinite(seen.astype(np.float32)).all()


@pytest.mark.parametrize("roughness", [-0.01, 1.01, float("nan")])
def test_roughness_has_a_range(roughness):
    with pytest.raises(MapError, match=r"outside 0 \.\. 1"):
        random_map().shaded(roughness, (1.0, 1.0, 1.0))


@pytest.mark.parametrize("f0", [(-0.1, 1.0, 1.0), (1.0, 1.0, 1.5)])
def test_reflectance_has_a_range(f0):
    with pytest.raises(MapError, match=r"f0 .* is outside 0"):
        random_map().shaded(0.5, f0)


def test_a_surface_says_what_it_is():
    shaded = random_map().shaded(0.5, (0.5, 0.25, 0.04))
    parameters = {"roughness": 0.5, "f0": [0.5, 0.25, 0.04]}
    assert shaded.info == replace(INFO, brdf={"name": "ggx", "parameters": parameters})


def test_orders_come_from_the_coefficients():
    made = random_map(3, 1)
    assert (made.order_p, made.order_q) == (3, 1)
    assert made.coefficients.shape == (16 + 3, 3)
    np.testing.assert_array_equal(made.coefficients[16:], made.q_coefficients)
    constant = random_map(0, 0)
    assert (constant.order_p, constant.order_q) == (0, 0)
    for p, q in [((15, 3), (3, 3)), ((16, 3), (4, 3)), ((16, 4), (3, 4)), ((16,), (3, 3))]:
        with pytest.raises(ValueError, match="coefficients of shapes"):
            SphericalHarmonicExponential(np.zeros(p), np.zeros(q), (0.2, 1.0), INFO)


@pytest.mark.parametrize("law", ["lobe", "paper"])
def test_turned_light_is_seen_by_turned_surfaces(rng, law):
    light, matrix = random_map(law=law), oracles.random_rotation(rng)
    turned = light.turned(matrix)
    normals, views = pairs(20)
    for surface in ((0.5, (1.0, 1.0, 1.0)), (0.9, (0.04, 0.5, 1.0))):
        expected = light.shaded(*surface).radiance(normals, views)
        found = turned.shaded(*surface).radiance(normals @ matrix.T, views @ matrix.T)
        np.testing.assert_allclose(found, expected, rtol=1e-9)
        assert abs(turned.shaded(*surface).radiance(normals, views) / expected - 1).max() > 0.01


@pytest.mark.parametrize("axes", ["sideways", [1.0, 2.0], [[1, 2, 3], [4, 5]], None])
def test_turns_of_light_whose_file_records_no_axes(axes):
    odd = replace(random_map(), info=replace(INFO, options={"reading": {"axes": axes}}))
    turn = oracles.turn("y", 0.3)
    found = odd.turned(turn).info.options["reading"]["axes"]
    np.testing.assert_allclose(found, turn, atol=1e-9)
