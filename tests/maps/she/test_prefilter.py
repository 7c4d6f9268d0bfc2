"""Fits to real probes against sums over their pixels, with GGX written again."""

import os
import re
import subprocess
import sys
from functools import cache

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.maps.she.reflectance import sample_reflectance
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.directions import turn_matrix
from tests import ggx, oracles
from tests.cli.helpers import environment, polynomial_light, write_exr
from tests.makers import environment_brdf, prefilter_exponential
from tests.maps.scenes import normals_of

LUMINANCE = [0.2126, 0.7152, 0.0722]
ROUGHNESSES = 0.45, 0.7, 1.0
METAL, PLASTIC = (1.0, 1.0, 1.0), (0.04, 0.04, 0.04)
UNIT_LIGHT = np.sqrt(4 * np.pi)
"""What p_00 gains where the logarithm of the light gains 1."""


@cache
def pairs():
    """Normals and views, uniform in the mirror direction and the view: Sobol's points."""
    from scipy.stats import qmc  # which takes a second to load

    points = qmc.Sobol(4, seed=11).random(512)
    z, phi = 2 * points[:, :2].T - 1, 2 * np.pi * points[:, 2:].T
    sine = np.sqrt(1 - z**2)
    mirrors, views = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)
    return normals_of(mirrors, views), views


@cache
def coarse(path):
    """A real probe's directions, and radiance times solid angle: 64 x 128 pixels."""
    image = open_probe(path).image().astype(float)
    height, width = image.shape[:2]
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    weights = (edges[:-1] - edges[1:])[:, None, None] * 2 * np.pi / width

    def blocks(values):
        return values.reshape(64, height // 64, 128, width // 128, 3).sum(axis=(1, 3))

    light = blocks(oracles.latlong_pixels(width, height) * weights)
    light /= np.linalg.norm(light, axis=-1, keepdims=True)
    return light.reshape(-1, 3), blocks(image * weights).reshape(-1, 3)


@cache
def truth(path):
    """E_0 of every roughness, (3, pairs, 3)."""
    return np.stack([ggx.reflected(each, *pairs(), *coarse(path))[0] for each in ROUGHNESSES])


def error(made, path):
    """Relative RMS of a metal over all views and roughnesses."""
    found = np.stack([made.shaded(each, METAL).radiance(*pairs()) for each in ROUGHNESSES])
    return float(np.linalg.norm(found - truth(path)) / np.linalg.norm(truth(path)))


def dense_error(made, samples, f0):
    """Relative RMS over samples of reflected light."""
    expected = samples.reflected[:, 0] * f0 + samples.reflected[:, 1] * (1 - np.array(f0))
    seen = [made.shaded(each, f0).radiance(samples.normals, samples.views) for each in ROUGHNESSES]
    square, whole = (
        np.einsum("s,rsc->", samples.weights, values**2) for values in (seen - expected, expected)
    )
    return float(np.sqrt(square / whole))


def small_probe(folder, pixels, name="small.exr"):
    return open_probe(write_exr(folder / name, np.asarray(pixels, dtype=np.float32)))


def smooth_pixels():
    return polynomial_light(oracles.latlong_pixels(64, 32))


def same(one, other, tolerance=0.0):
    return bool(np.abs(one.coefficients - other.coefficients).max() <= tolerance)


@pytest.fixture
def smooth(tmp_path):
    """Positive light of degree 3, on a small lat-long."""
    return small_probe(tmp_path, smooth_pixels())


@pytest.mark.proof
@pytest.mark.parametrize("name", ["forest", "city"])
def test_the_fit_is_better_than_the_papers(real_probes, name):
    path = real_probes / f"{name}.exr"
    lobe, paper = (
        prefilter_exponential(open_probe(path), law=law).map for law in ("lobe", "paper")
    )
    assert error(lobe, path) < 0.97 * error(paper, path)
    # What a plastic reflects is nearly all at grazing views, and takes many more of them than
    # sums over pixels can have: here those of the frequency domain, of twice the order.
    probe = open_probe(path)
    samples = sample_reflectance(project(probe, 64), ROUGHNESSES, 10, 12, 1)
    for f0 in (METAL, PLASTIC):
        one, other = (dense_error(each, samples, f0) for each in (lobe, paper))
        assert one < 0.95 * other


def test_more_coefficients_are_better(real_probes):
    path = real_probes / "forest.exr"
    errors = [
        error(prefilter_exponential(open_probe(path), *orders).map, path)
        for orders in [(2, 0), (4, 2), (6, 4)]
    ]
    assert errors[0] > 1.1 * errors[1] > 1.1**2 * errors[2], errors


@pytest.mark.parametrize(
    ("name", "orders", "bound"),
    # Of eight rings, those of the default orders, the fit to the city had 1.2 times its error.
    [
        ("studio", (8, 0), 0.98),
        ("studio", (4, 10), 0.98),
        pytest.param("city", (10, 10), 1.05, marks=pytest.mark.proof),
    ],
)
def test_high_orders_are_not_free_between_the_samples(real_probes, name, orders, bound):
    """With as few mirror directions as coefficients, what lies between them could swing."""
    path = real_probes / f"{name}.exr"
    probe = open_probe(path)
    few = error(prefilter_exponential(probe).map, path)
    assert error(prefilter_exponential(probe, *orders).map, path) < bound * few


@pytest.mark.parametrize("angles", [(40, 0, 0), (170, 0, 0), (75, -30, 110)])
def test_the_fit_turns_with_the_light(real_probes, angles):
    """Of samples that did not turn it was another one: by 9 % at roughness 0.45 under a city."""
    path, turn = real_probes / "city.exr", turn_matrix(*angles)
    made = prefilter_exponential(open_probe(path)).map
    yaw, pitch, roll = angles
    moved = prefilter_exponential(open_probe(path, yaw=yaw, pitch=pitch, roll=roll)).map
    normals, views = pairs()
    for roughness in ROUGHNESSES:
        found = made.shaded(roughness, METAL).radiance(normals @ turn, views @ turn)
        anew = moved.shaded(roughness, METAL).radiance(normals, views)
        assert np.linalg.norm(found - anew) < 0.002 * np.linalg.norm(anew)


def test_the_residual_is_the_error_that_pixels_tell(real_probes):
    """Of the same light, at other views than it was fitted to."""
    for name in ("forest", "city"):
        path = real_probes / f"{name}.exr"
        made = prefilter_exponential(open_probe(path), roughness=(0.7, 0.7)).map
        base = truth(path)[ROUGHNESSES.index(0.7)]
        found = made.shaded(0.7, METAL).radiance(*pairs())
        expected = np.linalg.norm(found - base) / np.linalg.norm(base)
        assert made.info.fit_residual == pytest.approx(expected, rel=0.25)


@pytest.mark.proof
@pytest.mark.parametrize("name", ["night", "interior"])
def test_the_residual_of_sharp_lobes_counts_what_lies_between_the_samples(real_probes, name):
    """At the samples of the fit it was 42 and 55 % of the light."""
    path = real_probes / f"{name}.exr"
    made = prefilter_exponential(open_probe(path), roughness=(0.3, 0.3)).map
    base, _ = ggx.reflected(0.3, *pairs(), *coarse(path))
    found = made.shaded(0.3, METAL).radiance(*pairs())
    expected = np.linalg.norm(found - base) / np.linalg.norm(base)
    assert expected > 0.65
    assert made.info.fit_residual == pytest.approx(expected, rel=0.25)


@pytest.mark.proof
def test_a_fit_from_the_sharpest_lobes_on_is_not_black(tmp_path):
    """Their light ends at an order, and rings about the lamp."""
    pixels = np.full((64, 128, 3), 0.1)
    pixels[20:22, 37:39] = 1e4
    probe = small_probe(tmp_path, pixels)
    prefiltered = prefilter_exponential(probe, roughness=(0.05, 1.0))
    edges = np.cos(np.pi * np.arange(65) / 64)
    light = pixels * ((edges[:-1] - edges[1:]) * 2 * np.pi / 128)[:, None, None]
    directions = oracles.latlong_pixels(128, 64).reshape(-1, 3)
    expected, _ = ggx.reflected(0.7, *pairs(), directions, light.reshape(-1, 3))
    found = prefiltered.map.shaded(0.7, METAL).radiance(*pairs())
    assert np.linalg.norm(found - expected) < 0.5 * np.linalg.norm(expected)
    (warning,) = prefiltered.warnings
    assert "roughness 0.23 are wrong by" in warning
    assert "sharper ones by more" in warning


@pytest.mark.parametrize("name", [
    "city", "courtyard", "forest", "interior", "night", "studio", "sunrise", "sunset",
])  # fmt: skip
def test_a_bad_fit_is_told(real_probes, name):
    """Where most of what the sharpest surfaces show is wrong by over a quarter, by pixels."""
    path, sharpest = real_probes / f"{name}.exr", ROUGHNESSES[0]
    made = prefilter_exponential(open_probe(path))
    base = ggx.reflected(sharpest, *pairs(), *coarse(path))[0]
    off = made.map.shaded(sharpest, METAL).radiance(*pairs()) - base
    wrong = np.mean(np.abs(off @ LUMINANCE) > base @ LUMINANCE / 4)
    assert abs(wrong - 0.58) > 0.05
    assert bool(made.warnings) == (wrong > 0.58)
    if made.warnings:
        (line,) = made.warnings
        found = float(re.search(r"roughness 0.45 are wrong by (\d+)%", line)[1]) / 100
        assert found == pytest.approx(np.linalg.norm(off) / np.linalg.norm(base), rel=0.25)
        assert "`to` splitsum" in line


def test_mean_light_is_kept_at_every_roughness(real_probes):
    """What a surface reflects of its albedo, averaged over all mirror directions and views."""
    path = real_probes / "forest.exr"
    made = prefilter_exponential(open_probe(path)).map
    _, radiance = coarse(path)
    mean = radiance.sum(axis=0) / (4 * np.pi)
    normals, views = pairs()
    # The first two are smoother than what it was fitted to.
    for roughness, bound in [(0.1, 0.15), (0.3, 0.07), (0.45, 0.06), (0.7, 0.06), (1.0, 0.06)]:
        scale, bias = environment_brdf(roughness, np.sum(normals * views, axis=1))
        seen = made.shaded(roughness, METAL).radiance(normals, views)
        found = np.mean(seen / (scale + bias)[:, None], axis=0)
        assert found == pytest.approx(mean, rel=bound), roughness


def test_smooth_light_is_nearly_exact(smooth):
    """Light of degree 3, every channel another."""
    made = prefilter_exponential(smooth).map
    light, weights = oracles.sphere_rule(60)
    radiance = polynomial_light(light) * weights[:, None]
    for roughness, f0 in [(0.5, 1.0), (0.8, 0.04)]:
        base, tail = ggx.reflected(roughness, *pairs(), light, radiance)
        expected = f0 * base + (1 - f0) * tail
        found = made.shaded(roughness, (f0,) * 3).radiance(*pairs())
        assert np.linalg.norm(found - expected) < 0.03 * np.linalg.norm(expected)


def test_uniform_light_is_exact(tmp_path):
    colour = np.array([0.5, 1.0, 2.0])
    made = prefilter_exponential(small_probe(tmp_path, np.broadcast_to(colour, (32, 64, 3)))).map
    assert made.p_coefficients[0] == pytest.approx(np.log(colour) * UNIT_LIGHT, abs=0.01)
    assert np.abs(made.coefficients[1:]).max() < 0.05
    normals, views = pairs()
    scale, bias = environment_brdf(0.6, np.sum(normals * views, axis=1))
    expected = colour * (0.3 * scale + bias)[:, None]
    found = made.shaded(0.6, (0.3, 0.3, 0.3)).radiance(normals, views)
    assert np.linalg.norm(found - expected) < 2e-3 * np.linalg.norm(expected)


@pytest.mark.parametrize("law", ["lobe", "paper"])
def test_twice_the_light_is_twice_the_reflection(tmp_path, smooth, law):
    brighter = small_probe(tmp_path, 2 * smooth_pixels(), "bright.exr")
    once, twice = (prefilter_exponential(probe, law=law).map for probe in (smooth, brighter))
    expected = once.coefficients.copy()
    expected[0] += np.log(2) * UNIT_LIGHT
    # The rest is the ridge, which draws the constant too.
    assert twice.coefficients == pytest.approx(expected, abs=2e-3)
    found, before = (made.shaded(0.6, METAL).radiance(*pairs()) for made in (twice, once))
    assert found == pytest.approx(2 * before, rel=2e-3)
    assert twice.info.fit_residual == pytest.approx(once.info.fit_residual, rel=2e-2)


@pytest.mark.parametrize("law", ["lobe", "paper"])
def test_channels_are_fitted_alone_but_for_their_weights(tmp_path, smooth, law):
    """Red and blue exchanged in the probe, and what they mean, are exchanged in the map."""
    blue_first = (0.15, 0.06, 0.3, 0.6, 0.64, 0.33, 0.3127, 0.329)
    pixels = np.ascontiguousarray(smooth.image()[..., ::-1])
    swapped = Probe.from_array(pixels, chromaticities=blue_first)
    one, other = (prefilter_exponential(probe, law=law).map for probe in (smooth, swapped))
    assert one.coefficients[:, ::-1] == pytest.approx(other.coefficients, abs=1e-4)
    assert not same(one, other, 0.05)


@pytest.mark.parametrize("law", ["lobe", "paper"])
def test_a_sun_gives_numbers(tmp_path, law):
    """A pixel that is 1e5 times as bright as the sky; in log space nobody minds its size."""
    pixels = smooth_pixels()
    pixels[9, 23] = 1e5, 8e4, 5e4
    prefiltered = prefilter_exponential(small_probe(tmp_path, pixels), law=law)
    assert np.isfinite(prefiltered.map.coefficients).all()
    assert prefiltered.map.info.fit_residual < (0.6 if law == "lobe" else np.inf)
    for roughness in (0.0, 0.45, 1.0):
        assert np.isfinite(prefiltered.map.shaded(roughness, METAL).radiance(*pairs())).all()


@pytest.mark.parametrize("law", ["lobe", "paper"])
@pytest.mark.parametrize("pixel", [(0, 0), (9, 23), (31, 40)])
def test_a_single_light_in_the_dark_gives_numbers(tmp_path, law, pixel):
    """Its truncated series is as often below 0 as above."""
    pixels = np.zeros((32, 64, 3))
    pixels[pixel] = 100.0, 100.0, 0.0
    prefiltered = prefilter_exponential(small_probe(tmp_path, pixels), law=law)
    assert prefiltered.map.info.fit_residual < (0.6 if law == "lobe" else np.inf)
    made = prefiltered.map
    assert np.isfinite(made.coefficients).all()
    seen = made.shaded(0.6, METAL).radiance(*pairs())
    assert np.isfinite(seen).all()
    assert seen[:, 0].max() > 1e-3
    np.testing.assert_allclose(seen[:, 0], seen[:, 1], rtol=1e-6)
    assert seen[:, 2].max() < 1e-20  # a channel without light stays black


def test_one_roughness_is_a_range_too(real_probes):
    """And is fitted better than as a part of many."""
    path = real_probes / "forest.exr"
    one = prefilter_exponential(open_probe(path), roughness=(0.7, 0.7))
    assert one.map.ggx_alpha == pytest.approx((0.49, 0.49))
    many = prefilter_exponential(open_probe(path))
    base = truth(path)[ROUGHNESSES.index(0.7)]
    found = [each.map.shaded(0.7, METAL).radiance(*pairs()) - base for each in (one, many)]
    assert np.linalg.norm(found[0]) < np.linalg.norm(found[1])


@pytest.mark.parametrize("law", ["lobe", "paper"])
def test_orders_0_are_a_uniform_light(smooth, law):
    made = prefilter_exponential(smooth, 0, 0, law=law).map
    assert made.coefficients.shape == (1, 3)
    assert np.exp(made.coefficients[0] / UNIT_LIGHT) == pytest.approx([1.5, 2.0, 1.0], rel=0.5)


def test_a_turned_probe_is_a_turned_map(real_probes):
    """The samples do not turn with it: the maps differ by less than they are wrong."""
    path = real_probes / "forest.exr"
    here = prefilter_exponential(open_probe(path)).map
    turned = prefilter_exponential(open_probe(path, ReadOptions(yaw=67.0))).map
    matrix = oracles.turn("y", np.radians(67.0))
    normals, views = pairs()
    for roughness in ROUGHNESSES:
        expected = here.shaded(roughness, METAL).radiance(normals, views)
        found = turned.shaded(roughness, METAL).radiance(normals @ matrix.T, views @ matrix.T)
        still = turned.shaded(roughness, METAL).radiance(normals, views)
        difference = np.linalg.norm(found - expected) / np.linalg.norm(expected)
        assert difference < 0.06
        assert np.linalg.norm(still - expected) > 5 * difference * np.linalg.norm(expected)


def test_two_runs_are_the_same(smooth):
    for law in ("lobe", "paper"):
        one, other = (prefilter_exponential(smooth, law=law).map for _ in range(2))
        assert one.coefficients.tobytes() == other.coefficients.tobytes()
        assert one.info == other.info


@pytest.mark.proof
@pytest.mark.slow
def test_threads_change_nothing_but_rounding(smooth):
    """In processes of their own: a pool's size is set when numpy is loaded."""
    code = (
        "import sys; from tests.makers import prefilter_exponential as prefilter;"
        "from shrm_cli.probe.open import open_probe;"
        "made = prefilter(open_probe(sys.argv[1])).map;"
        "print(*map(repr, made.coefficients.ravel().tolist()))"
    )
    found = []
    for count in ("1", "4"):
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), count)
        out = subprocess.run(
            [sys.executable, "-c", code, smooth.name],
            env={**environment(), **threads},
            cwd=os.path.dirname(smooth.name),
            capture_output=True,
            check=True,
            timeout=60,
        ).stdout
        found.append([float(word) for word in out.split()])
    assert len(found[0]) == 33 * 3
    assert found[0] == pytest.approx(found[1], abs=1e-6)


def test_the_summary_tells_what_was_made(smooth):
    prefiltered = prefilter_exponential(smooth, 3, 1, (0.5, 0.9), "paper")
    assert prefiltered.facts["roughness"] == [0.5, 0.9]
    assert prefiltered.map.ggx_alpha == pytest.approx((0.25, 0.81))
    summary = prefiltered.summary()
    told = {"representation": "she", "law": "paper", "p_order": 3, "q_order": 1}
    told |= {"coefficients": 16 + 3, "roughness": [0.5, 0.9], "center": "reflection"}
    told |= {"brdf": {"name": "ggx", "parameters": {}}, "probe": "small.exr"}
    assert {key: summary[key] for key in told} == told
    assert summary["probe_sha256"] == smooth.digest()
    assert 0 < summary["fit_residual"] < 1


def test_it_tells_how_far_it_is(smooth):
    told = []
    prefilter_exponential(smooth, progress=lambda *what: told.append(what))
    assert told[-1] == (32, 32)


def test_a_black_probe_is_refused(tmp_path):
    probe = small_probe(tmp_path, np.zeros((16, 32, 3)), "black.exr")
    for law in ("lobe", "paper"):
        with pytest.raises(MapError, match=r"black\.exr: .*black"):
            prefilter_exponential(probe, law=law)


@pytest.mark.parametrize(
    "roughness", [(0.0, 1.0), (0.5, 0.4), (0.5, 1.1), (-0.2, 0.5), (float("nan"), 1.0), (0.01, 1.0)]
)
def test_roughness_out_of_range_is_refused(smooth, roughness):
    with pytest.raises(ArgumentError, match=r"is not two numbers that rise within 0\.05 \.\. 1"):
        prefilter_exponential(smooth, roughness=roughness)


@pytest.mark.parametrize("orders", [(-1, 2), (4, -1), (17, 2), (4, 17)])
def test_orders_out_of_range_are_refused(smooth, orders):
    with pytest.raises(ArgumentError, match=r"is not a whole number of 0 \.\. 16"):
        prefilter_exponential(smooth, *orders)
