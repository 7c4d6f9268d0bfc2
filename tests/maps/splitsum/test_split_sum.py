"""Split sums against sums over a probe's pixels, with the lobe written out again."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad

from shrm_cli.brdf.environment.lobe import GgxLobe
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.errors import BrdfError, MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.splitsum.core import energies, multipliers
from shrm_cli.maps.splitsum.prefilter import frequency_pays
from shrm_cli.maps.splitsum.roughness import (
    DEFAULT_LEVELS,
    blend,
    check_roughnesses,
    level_roughnesses,
)
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.reflected import predicted_error
from shrm_cli.sphere.cube import CubeSampler, bilinear_filtering, cube_directions
from shrm_cli.vocabulary import NO_TAPS
from tests import oracles
from tests.brute_force import unit
from tests.cli.helpers import polynomial_light, write_exr
from tests.makers import environment_brdf, prefilter_split_sum
from tests.maps.shrm.test_predicted_error import reduced


def lobe(roughness, cosine, square_sine):
    """``D(h) G2 / (4 n.v)`` at n = v, up to a factor; the sine is that of half the angle."""
    a2 = roughness**4
    d = a2 / ((1 - square_sine) * a2 + square_sine) ** 2
    c = np.maximum(cosine, 1e-9)
    g2 = 1 / (1 + (np.sqrt(1 + a2 * (1 / c**2 - 1)) - 1) / 2)
    return np.where(cosine > 0, d * g2 / 4, 0.0)


@cache
def whole_lobe(roughness):
    # In the logarithm of the angle, which knows every scale.
    def ring(x):
        angle = np.exp(x)
        value = lobe(roughness, np.cos(angle), np.sin(angle / 2) ** 2)
        return 2 * np.pi * np.sin(angle) * float(value) * angle

    return quad(ring, np.log(1e-8), np.log(np.pi / 2), epsabs=0, epsrel=1e-9, limit=400)[0]


def normalised_lobe(roughness, cosine, square_sine):
    return lobe(roughness, cosine, square_sine) / whole_lobe(roughness)


def latlong_pixels(image):
    """Directions, and radiance times solid angle, of a lat-long's pixels, from the contract."""
    height, width = image.shape[:2]
    polar = np.pi * (np.arange(height)[:, None] + 0.5) / height
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    turn = np.pi - 2 * np.pi * (np.arange(width) + 0.5) / width
    directions = np.stack(
        np.broadcast_arrays(
            np.sin(polar) * np.sin(turn), np.cos(polar), np.sin(polar) * np.cos(turn)
        ), axis=-1,
    )  # fmt: skip
    light = image * ((edges[:-1] - edges[1:]) * 2 * np.pi / width)[:, None, None]
    return directions.reshape(-1, 3), light.reshape(-1, 3).astype(float)


def brute_force(image, roughness, directions):
    where, light = latlong_pixels(image)
    result = np.empty((len(directions), 3))
    for k, direction in enumerate(directions):
        cosine = where @ direction
        result[k] = normalised_lobe(roughness, cosine, (1 - cosine) / 2) @ light
    return result


@pytest.fixture
def real_probe(real_probes, tmp_path):
    """Open a real probe by its name at 256 rows: lobes are smooth there, and sums four times as
    fast as at its own 512.
    """

    def opened(name):
        path = tmp_path / f"{name}.exr"
        return open_probe(write_exr(path, reduced(real_probes / path.name, 256)))

    return opened


def difference(found, expected):
    return np.sqrt(np.sum((found - expected) ** 2) / np.sum(expected**2))


@pytest.fixture
def smooth_probe(tmp_path):
    directions = latlong_pixels(np.ones((32, 64, 3)))[0]
    pixels = polynomial_light(directions).reshape(32, 64, 3).astype(np.float32)
    return open_probe(write_exr(tmp_path / "smooth.exr", pixels))


@pytest.fixture
def furnace(tmp_path):
    pixels = np.broadcast_to(np.float32([0.5, 1.0, 2.0]), (32, 64, 3))
    return open_probe(write_exr(tmp_path / "furnace.exr", pixels))


# ---- the lobe ---------------------------------------------------------------------------------


@pytest.mark.parametrize("roughness", [0.05, 0.2, 0.5, 1.0])
def test_the_lobe_is_normalised_and_of_the_right_shape(roughness):
    angles = np.array([0, 0.1, 1, 3, 10]) * roughness**2
    angles = np.append(angles[angles < 1.5], [1.3, 1.6])
    light = np.stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)], axis=-1)
    found = GgxLobe(roughness=roughness).evaluate(light, np.array([0.0, 0.0, 1.0]))
    expected = normalised_lobe(roughness, np.cos(angles), np.sin(angles / 2) ** 2)
    assert found[:, 0] == pytest.approx(expected, rel=1e-7, abs=1e-15)
    assert np.array_equal(found[:, 0], found[:, 2])


def test_the_lobe_is_that_of_ggx_seen_along_the_normal(rng):
    light = unit(rng, 50)
    up = np.array([0.0, 0.0, 1.0])
    model = Ggx(roughness=0.5, f0=1.0).transfer(light, up)
    ratio = model[light[:, 2] > 0] / GgxLobe(roughness=0.5).transfer(light, up)[light[:, 2] > 0]
    scale, bias = environment_brdf(0.5, [1.0])
    assert ratio == pytest.approx(scale[0] + bias[0], rel=1e-9)


def test_the_lobe_turns_with_the_view_and_keeps_single_precision(rng):
    brdf = GgxLobe(roughness=0.05)
    mirror, light = unit(rng, 1)[0], unit(rng, 40)
    light = mirror + 0.004 * light
    light /= np.linalg.norm(light, axis=1, keepdims=True)
    view = mirror * [-1, -1, 1]
    square_sine = np.sum((light - mirror) ** 2, axis=1) / 4
    expected = normalised_lobe(0.05, 1 - 2 * square_sine, square_sine)
    assert brdf.evaluate(light, view)[:, 0] == pytest.approx(expected, rel=1e-7)
    single = brdf.evaluate(light.astype(np.float32), view.astype(np.float32))
    assert single.dtype == np.float32
    assert single[:, 0] == pytest.approx(expected, rel=1e-3)


def test_the_lobe_is_not_among_the_models():
    with pytest.raises(BrdfError, match="ggx-lobe"):
        parse_spec("ggx-lobe")


# ---- the mappings -----------------------------------------------------------------------------


def test_mappings_are_those_of_the_engines():
    assert level_roughnesses(5, "linear") == (0, 0.25, 0.5, 0.75, 1)
    # cmgen: lodToPerceptualRoughness; light_indirect.fs: lod = max * r * (2 - r).
    filament = np.array(level_roughnesses(5, "filament"))
    assert 4 * filament * (2 - filament) == pytest.approx(np.arange(5), abs=1e-12)
    assert filament[2] == pytest.approx(1 - np.sqrt(0.5))
    # CubemapMaxMip - 1 - (1 - 1.2 log2(r)) with CubemapMaxMip = 7 (8 mips of 128 texels).
    unreal = np.array(level_roughnesses(6, "unreal"))
    assert 7 - 1 - (1 - 1.2 * np.log2(unreal)) == pytest.approx(np.arange(6), abs=1e-12)
    for mapping, count in DEFAULT_LEVELS.items():
        levels = level_roughnesses(count, mapping)
        assert levels[-1] == 1
        assert 5 <= len(levels) <= 8
        assert all(np.diff(levels) > 0)
    assert level_roughnesses(1, "unreal") == (1.0,)


@pytest.mark.parametrize("mapping", ["linear", "filament", "unreal"])
def test_levels_are_mixed_as_a_texture_unit_does_it(mapping):
    levels = level_roughnesses(6, mapping)
    lod = {
        "linear": lambda r: 5 * r,
        "filament": lambda r: 5 * r * (2 - r),
        "unreal": lambda r: 5 + 1.2 * np.log2(r),
    }[mapping]
    for roughness in (0.06, 0.2, 0.45, 0.77, 0.999):
        low, weight = blend(roughness, levels, mapping)
        assert low + weight == pytest.approx(lod(roughness), abs=1e-12)
    for k, roughness in enumerate(levels):
        assert blend(roughness, levels, mapping) == (k, 0.0)
    assert blend(0.0, levels[1:], mapping) == (0, 0.0)
    assert blend(1.0, levels[:3], mapping) == (2, 0.0)


@pytest.mark.parametrize(
    ("values", "mapping", "part"),
    [
        ([], "linear", "1 to 64 levels, not 0"),
        ([0.5, 0.4], "linear", "must rise"),
        ([0.5, 0.5], "linear", "must rise"),
        ([0.5, 0.50000001], "linear", "must rise"),
        ([0.0, 0.5], "unreal", "no level of roughness 0"),
        ([0.01, 0.5], "linear", "0.01 cannot be made"),
        ([0.5, 1.5], "linear", "1.5 cannot be made"),
        ([float("nan")], "linear", "nan cannot be made"),
    ],
)
def test_roughnesses_that_cannot_be(values, mapping, part):
    with pytest.raises(MapError, match=part):
        check_roughnesses(values, mapping)


def test_numbers_of_levels_that_cannot_be():
    for count in (0, 65):
        with pytest.raises(MapError, match=f"not {count}"):
            level_roughnesses(count, "linear")
    with pytest.raises(MapError, match="fewer levels"):
        level_roughnesses(9, "unreal")


# ---- the levels -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["studio", "interior"])
def test_levels_are_brute_force_integrals(real_probe, rng, name):
    """At texels of the cubes and between."""
    probe = real_probe(name)
    split_sum = prefilter_split_sum(probe).map
    image = probe.image()
    for k in (1, 7):
        level, roughness = split_sum.levels[k], split_sum.roughness[k]
        texels = rng.integers(0, level.shape[0] * level.shape[1], 12)
        at = cube_directions(level.shape[1]).reshape(-1, 3)[texels]
        between = unit(rng, 12)
        found = np.concatenate(
            [level.reshape(-1, 3)[texels], split_sum.prefiltered(roughness, between)]
        )
        expected = brute_force(image, roughness, np.concatenate([at, between]))
        assert difference(found, expected) < 0.005, roughness


@pytest.mark.parametrize(("mapping", "count"), [("filament", 5), ("linear", 5), ("unreal", 4)])
def test_levels_of_every_mapping_are_brute_force_integrals(tmp_path, rng, mapping, count):
    """Of a few soft lamps, at the roughness that the engine reads each level at."""
    lamps, colours = unit(rng, 6), rng.uniform(0.2, 5, (6, 3))
    directions = latlong_pixels(np.ones((64, 128, 3)))[0]
    pixels = 0.1 + np.exp(30 * (directions @ lamps.T - 1)) @ colours
    image = pixels.reshape(64, 128, 3).astype(np.float32)
    probe = open_probe(write_exr(tmp_path / "lamps.exr", image))
    split_sum = prefilter_split_sum(probe, count, mapping).map
    directions = latlong_pixels(np.ones((192, 384, 3)))[0]
    fine = (0.1 + np.exp(30 * (directions @ lamps.T - 1)) @ colours).reshape(192, 384, 3)
    asked = {
        "filament": 1 - np.sqrt(1 - np.arange(5) / 4),
        "linear": np.arange(5) / 4,
        "unreal": 2 ** ((np.arange(4) - 3) / 1.2),
    }[mapping]
    assert split_sum.roughness == pytest.approx(asked)
    for level, roughness in zip(split_sum.levels, asked, strict=True):
        texels = rng.integers(0, level.shape[0] * level.shape[1], 40)
        at = cube_directions(level.shape[1]).reshape(-1, 3)[texels]
        found = level.reshape(-1, 3)[texels]
        if roughness == 0:  # the light itself, bilinear between its pixels
            expected = 0.1 + np.exp(30 * (at @ lamps.T - 1)) @ colours
            assert difference(found, expected) < 0.02
        else:
            expected = brute_force(fine, roughness, at)
            assert difference(found, expected) < 0.005, roughness


def test_both_domains_agree_with_brute_force(real_probe, monkeypatch):
    probe = real_probe("studio")
    directions = cube_directions(16)[::5, ::3].reshape(-1, 3)
    expected = brute_force(probe.image(), 0.15, directions)
    for domain in ("frequency", "angular"):
        monkeypatch.setattr(
            "shrm_cli.maps.splitsum.prefilter.frequency_pays",
            lambda *_, pays=domain == "frequency": pays,
        )
        prefiltered = prefilter_split_sum(probe, [0.15], size=16)
        assert prefiltered.summary()["levels"][0]["domain"] == prefiltered.map.info.domain == domain
        assert prefiltered.map.info.predicted_error <= 0.0005
        found = prefiltered.map.levels[0][::5, ::3].reshape(-1, 3)
        assert difference(found, expected) < 0.002


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def dark_error(probe, level, roughness, rng):
    """Median relative error where the luminance is below a fifth of the mean; None if nowhere."""
    light = latlong_pixels(probe.image())[1]
    mean = light.sum(axis=0) @ LUMINANCE / (4 * np.pi)
    at, found = cube_directions(level.shape[1]).reshape(-1, 3), level.reshape(-1, 3) @ LUMINANCE
    dim = np.nonzero(found < 0.25 * mean)[0]
    if len(dim) < 50:
        return None
    texels = rng.choice(dim, 50, replace=False)
    expected = brute_force(probe.image(), roughness, at[texels]) @ LUMINANCE
    dark = expected < 0.2 * mean
    return np.median(np.abs(found[texels] / expected - 1)[dark]) if dark.sum() > 20 else None


@pytest.mark.slow
@pytest.mark.parametrize("domain", ["frequency", "angular"])
def test_dark_places_beside_a_lamp_keep_their_light(tmp_path, rng, monkeypatch, domain):
    """The lamp has 2000 times the radiance of the room, whose dark half has a tenth of the rest."""
    where = latlong_pixels(np.ones((256, 512, 3)))[0].reshape(256, 512, 3)
    room = np.where(where[..., 0] > 0, 1.0, 0.1)
    pixels = np.where(where @ [0.6, 0.64, 0.48] > np.cos(0.06), 2000.0, room)
    image = np.repeat(pixels[..., None], 3, axis=-1).astype(np.float32)
    probe = open_probe(write_exr(tmp_path / "lamp.exr", image))
    monkeypatch.setattr(
        "shrm_cli.maps.splitsum.prefilter.frequency_pays", lambda *_: domain == "frequency"
    )
    roughness, size = ([0.15, 0.2, 0.3], 64) if domain == "frequency" else ([0.15], 24)
    made = prefilter_split_sum(probe, roughness, size=size).map
    for level, asked, info in zip(made.levels, roughness, made.level_info, strict=True):
        assert info.domain == domain
        assert info.predicted_error <= 0.0005
        assert dark_error(probe, level, asked, rng) < 0.002, asked


@pytest.mark.parametrize("name", ["studio", "sunrise", "night"])
def test_dark_places_of_real_probes_keep_their_light(real_probe, rng, name):
    probe = real_probe(name)
    made = prefilter_split_sum(probe, [0.15, 0.2, 0.4]).map
    for level, roughness in zip(made.levels, made.roughness, strict=True):
        assert dark_error(probe, level, roughness, rng) < 0.005, roughness


@pytest.mark.slow
def test_the_predicted_error_is_that_of_the_level(real_probes, rng):
    """As much as the fading leaves out, against brute force, where the tolerance is loose."""
    probe = open_probe(real_probes / "studio.exr")
    made = prefilter_split_sum(probe, [0.3], error=0.02).map
    every = cube_directions(made.levels[0].shape[1]).reshape(-1, 3)
    solid_angles = np.abs(every).max(axis=1) ** 3
    texels = rng.choice(len(every), 200, p=solid_angles / solid_angles.sum())
    found = made.levels[0].reshape(-1, 3)[texels]
    error = difference(found, brute_force(probe.image(), 0.3, every[texels]))
    assert made.info.predicted_error <= 0.02
    assert error == pytest.approx(made.info.predicted_error, rel=0.3)


def test_sharp_lobes_on_small_faces_are_integrated(tmp_path):
    pixels = np.random.default_rng(3).uniform(0, 2, (32, 64, 3)).astype(np.float32)
    probe = open_probe(write_exr(tmp_path / "noise.exr", pixels))
    levels = prefilter_split_sum(probe, [0.1, 0.5], size=8).summary()["levels"]
    assert [each["domain"] for each in levels] == ["angular", "frequency"]


def test_lobes_finer_than_the_pixels_meet_what_lies_between_them(tmp_path, rng):
    """Of 128 rows the sum goes over a finer probe, bilinear between its pixels; fewer are cut."""
    from scipy.ndimage import map_coordinates

    coarse = np.random.default_rng(3).uniform(0, 2, (128, 256, 3)).astype(np.float32)
    probe = open_probe(write_exr(tmp_path / "noise.exr", coarse))
    made = prefilter_split_sum(probe, [0.1], size=8, error=0.001)
    assert made.summary()["levels"][0]["domain"] == "angular"
    rows = (np.arange(256) + 0.5) / 2 - 0.5
    columns = (np.arange(512) + 0.5) / 2 - 0.5 + 2
    # The seam goes round; away from the poles nothing else matters.
    padded = np.pad(coarse, ((0, 0), (2, 2), (0, 0)), mode="wrap")
    grid = np.meshgrid(rows, columns, indexing="ij")
    fine = np.stack([map_coordinates(padded[..., k], grid, order=1) for k in range(3)], axis=-1)
    texels = [(k, i, j) for k in (0, 1, 4, 5) for i in (3, 4) for j in (0, 5)]
    at = cube_directions(8).reshape(6, 8, 8, 3)
    found = np.array([made.map.levels[0].reshape(6, 8, 8, 3)[texel] for texel in texels])
    expected = brute_force(fine, 0.1, np.array([at[texel] for texel in texels]))
    assert difference(found, expected) < 0.005


def test_a_bare_sun_of_few_rows_does_not_ring(tmp_path):
    """The lobe passes degrees up to 280, of which 128 rows of pixels know 127."""
    image = np.zeros((128, 256, 3), np.float32)
    image[40, 60] = 5e4
    probe = open_probe(write_exr(tmp_path / "sun.exr", image))
    (level,) = prefilter_split_sum(probe, [0.134], size=16).map.levels
    at, light = latlong_pixels(image)
    sun = light.any(axis=-1)
    cosine = cube_directions(16) @ at[sun][0]
    aside = (cosine > 0.1) & (cosine < np.cos(np.radians(7)))
    expected = normalised_lobe(0.134, cosine, (1 - cosine) / 2) * light[sun][0, 0]
    assert level[..., 0][aside] == pytest.approx(expected[aside], rel=0.05)


@pytest.mark.parametrize(
    ("rows", "levels", "error"),
    [(256, [0.143], 0.05), (256, [0.3], 0.05), (64, [0.1, 0.2], 0.0005)],
)
def test_a_bare_sun_does_not_ring_whatever_its_levels_may_miss(tmp_path, rows, levels, error):
    """Where the light is known to too few degrees, or ends at those of its pixels."""
    image = np.zeros((rows, 2 * rows, 3), np.float32)
    image[rows // 3, rows // 4] = 1e3
    probe = open_probe(write_exr(tmp_path / "sun.exr", image))
    level = prefilter_split_sum(probe, levels, size=64, error=error).map.levels[-1]
    at, light = latlong_pixels(image)
    cosine = cube_directions(64) @ at[light.any(axis=-1)][0]
    lobe = normalised_lobe(levels[-1], cosine, (1 - cosine) / 2)
    expected = lobe[..., None] * light.sum(axis=0)
    mean = light.sum(axis=0) / (4 * np.pi)
    dark = expected < 0.2 * mean
    assert (level - expected)[dark] == pytest.approx(0, abs=0.006 * mean[0])
    assert level.min() > -0.0013 * mean[0]


def test_smooth_light_is_prefiltered_to_rounding(smooth_probe, rng):
    """Degree 3 is within every expansion: what is left is the probe's single precision."""
    split_sum = prefilter_split_sum(smooth_probe, [0.3, 0.6, 1.0], error=1e-5).map
    directions = unit(rng, 6)
    for k, roughness in enumerate(split_sum.roughness):
        at = cube_directions(split_sum.levels[k].shape[1])[7, 3]
        polar, weights = np.polynomial.legendre.leggauss(400)
        azimuth = 2 * np.pi * np.arange(16) / 16
        # The lobe in its own polar coordinates, dense about the axis.
        angle = np.pi / 2 * ((polar + 1) / 2) ** 2
        density = normalised_lobe(roughness, np.cos(angle), np.sin(angle / 2) ** 2)
        density = density * np.sin(angle) * np.pi * (polar + 1) / 2 * weights / 2 * 2 * np.pi / 16
        side = np.cross(at, directions[0])
        side /= np.linalg.norm(side)
        other = np.cross(at, side)
        around = np.cos(azimuth)[:, None] * side + np.sin(azimuth)[:, None] * other
        light = np.cos(angle)[:, None, None] * at + np.sin(angle)[:, None, None] * around
        expected = np.einsum("tpc,t->c", polynomial_light(light), density)
        assert split_sum.levels[k][7, 3] == pytest.approx(expected, rel=2e-5)


def test_a_constant_probe_gives_constant_levels(furnace):
    prefiltered = prefilter_split_sum(furnace)
    for level in prefiltered.map.levels:
        assert np.abs(level / [0.5, 1.0, 2.0] - 1).max() < 2e-6
    assert prefiltered.map.info.predicted_error < 1e-6


def test_black_light_is_black(tmp_path):
    probe = open_probe(write_exr(tmp_path / "black.exr", np.zeros((16, 32, 3), np.float32)))
    prefiltered = prefilter_split_sum(probe, [0.0, 0.1, 0.5], size=8)
    assert not any(level.any() for level in prefiltered.map.levels)
    assert prefiltered.summary()["predicted_error"] == 0


def test_sizes_and_orders_follow_the_lobes(real_probes):
    probe = open_probe(real_probes / "sunset.exr")
    prefiltered = prefilter_split_sum(probe)
    levels = prefiltered.summary()["levels"]
    sizes = [each["size"] for each in levels]
    assert sizes[0] == prefiltered.map.size == 256
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[-1] <= 128
    assert levels[0]["domain"] == "probe"
    assert {each["domain"] for each in levels[1:]} == {"frequency"}
    assert all(each["predicted_error"] <= 0.0005 for each in levels)
    small = prefilter_split_sum(probe, levels=3, mapping="filament", size=32)
    assert [level.shape[1] for level in small.map.levels] == [32, 32, 32]
    assert small.map.info.probe == "sunset.exr"


def test_a_tiny_probe_has_levels_that_hold_what_is_blurred_of_it(tmp_path, rng):
    """Pixels of 90 degrees, each as 64 x 64 that sum to them: by default it was 1 texel a face."""
    image = rng.uniform(0, 1, (2, 4, 3)).astype(np.float32)
    probe = open_probe(write_exr(tmp_path / "tiny.exr", image))
    found = prefilter_split_sum(probe, [0.4, 0.8]).map
    normals = unit(rng, 200)
    fine = image.repeat(64, axis=0).repeat(64, axis=1)
    for roughness in found.roughness:
        expected = brute_force(fine, roughness, normals)
        looked = found.prefiltered(roughness, normals)
        assert difference(looked, expected) < 0.03


def expansion_errors(lighting, coefficients):
    """The relative RMS error of a level for each order at which it may end abruptly."""
    light, missing = energies(lighting, multipliers(coefficients))
    return np.sqrt(missing / (light[0] + missing[0]))


def test_predicted_errors_are_those_of_the_orders(real_probes):
    """With the light known to 511, where nothing of it is left that this lobe would pass."""
    probe = open_probe(real_probes / "studio.exr")
    coefficients = compute_coefficients(GgxLobe(roughness=0.3), 300, 0)
    lighting = project(probe, 300)
    errors = expansion_errors(lighting, coefficients)
    for order in (5, 20, 40):
        expected = predicted_error(lighting, coefficients, order, 0)
        assert errors[order] == pytest.approx(expected, rel=1e-6)


def test_light_beyond_the_expansion_is_not_forgotten(tmp_path):
    """A bright pixel: at its last order an expansion lacks what it does not know."""
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[20, 30] = 100
    probe = open_probe(write_exr(tmp_path / "lamp.exr", pixels))
    coefficients = compute_coefficients(GgxLobe(roughness=0.3), 60, 0)
    whole = expansion_errors(project(probe, 60), coefficients)
    part = expansion_errors(project(probe, 24), coefficients)
    assert part[24] == pytest.approx(whole[24], rel=0.1)
    assert part[10] == pytest.approx(whole[10], rel=0.01)


def test_what_pays():
    assert frequency_pays(200, 0.02, 512, 256)
    assert not frequency_pays(400, 0.01, 512, 16)
    assert not frequency_pays(400, 0.01, 512, 256)
    assert frequency_pays(400, 0.01, 1024, 256)
    assert frequency_pays(100, 0.04, 64, 4)


# ---- reading ----------------------------------------------------------------------------------


def made_up(rng, roughness=(0.0, 0.5, 1.0), mapping="linear"):
    levels = tuple(rng.uniform(0, 1, (6 * n, n, 3)) for n in (16, 8, 8)[: len(roughness)])
    info = MapInfo(8, 0, 0.002, 1.0, 0.001, {"name": "ggx-lobe", "parameters": {}}, "p.exr", "0")
    return SplitSum(levels, roughness, mapping, info)


def test_a_level_is_read_as_it_is(rng):
    split_sum = made_up(rng)
    for k, roughness in enumerate(split_sum.roughness):
        at = cube_directions(split_sum.levels[k].shape[1])
        assert split_sum.prefiltered(roughness, at) == pytest.approx(split_sum.levels[k], abs=1e-12)


def test_between_levels_it_is_mixed(rng):
    split_sum = made_up(rng, mapping="filament")
    at = unit(rng, 9)
    low, high = (split_sum.prefiltered(r, at) for r in (0.5, 1.0))
    position = [r * (2 - r) for r in (0.5, 0.8, 1.0)]
    weight = (position[1] - position[0]) / (position[2] - position[0])
    assert split_sum.prefiltered(0.8, at) == pytest.approx((1 - weight) * low + weight * high)


def test_shading_is_the_split_sum(rng):
    split_sum = made_up(rng)
    f0 = (1.0, 0.6, 0.04)
    normals, views = unit(rng, 30), unit(rng, 30)
    views *= np.sign(np.sum(normals * views, axis=1, keepdims=True))
    shaded = split_sum.shaded(0.5, f0, taps=NO_TAPS)
    cosine = np.sum(normals * views, axis=1)
    mirror = 2 * cosine[:, None] * normals - views
    scale, bias = environment_brdf(0.5, cosine)
    albedo = scale[:, None] * np.array(f0) + bias[:, None]
    expected = split_sum.prefiltered(0.5, mirror) * albedo
    assert shaded.radiance(normals, views) == pytest.approx(expected, abs=1e-4)
    assert shaded.radiance(normals, views[0]).shape == (30, 3)
    assert shaded.info.brdf == {"name": "ggx", "parameters": {"roughness": 0.5, "f0": list(f0)}}


def test_a_uniform_environment_gives_the_albedo_of_ggx(furnace, rng):
    """The split sum is exact there: against a sum over the model itself."""
    split_sum = prefilter_split_sum(furnace, levels=3).map
    normal = np.array([0.0, 0.0, 1.0])
    view = np.array([0.8, 0.0, 0.6])
    light = unit(rng, 400_000)
    light[:, 2] = np.abs(light[:, 2])
    expected = 2 * np.pi * Ggx(roughness=0.7, f0=0.3).transfer(light, view).mean(axis=0)
    found = split_sum.shaded(0.7, (0.3, 0.3, 0.3)).radiance(normal, view)
    assert found == pytest.approx(expected * [0.5, 1.0, 2.0], rel=0.01)


def test_filtering_makes_nothing_darker_than_black(rng):
    level = np.zeros((48, 8, 3))
    level[20, 3] = 1e4
    info = made_up(rng).info
    bright = SplitSum((level,), (0.0,), "linear", info)
    assert bright.prefiltered(0.0, unit(rng, 2000)).min() == 0
    level[21, 3] = -1.0
    assert bright.prefiltered(0.0, unit(rng, 2000)).min() == -1


@pytest.mark.parametrize(
    ("roughness", "f0", "part"),
    [
        (1.2, (1, 1, 1), "roughness 1.2"),
        (float("nan"), (1, 1, 1), "roughness nan"),
        (0.5, (1, 2, 1), "f0 1/2/1"),
        (0.5, (1, float("nan"), 1), "f0 1/nan/1"),
    ],
)
def test_materials_have_ranges(rng, roughness, f0, part):
    with pytest.raises(MapError, match=part):
        made_up(rng).shaded(roughness, f0)


@pytest.mark.parametrize(
    "change",
    [
        {"levels": ()},
        {"roughness": (0.0, 1.0)},
        {"roughness": (0.0, 1.0, 0.5)},
        {"mapping": "quadratic"},
    ],
)
def test_what_is_no_split_sum(rng, change):
    good = made_up(rng)
    fields = {"levels": good.levels, "roughness": good.roughness, "mapping": "linear"} | change
    with pytest.raises(ValueError, match=r"level|roughness|mapping"):
        SplitSum(**fields, info=good.info)
    with pytest.raises(ValueError, match="grow"):
        SplitSum(good.levels[::-1], good.roughness, "linear", good.info)
    with pytest.raises(ValueError, match="shape"):
        SplitSum((np.zeros((12, 4, 3)),), (0.5,), "linear", good.info)


@pytest.mark.parametrize("rows", [16, 40])
def test_coarse_light_is_what_its_pixels_are(rows):
    """Of pixels that are cut by hand the levels are the same: they were negative, in rings."""
    image = np.full((rows, 2 * rows, 3), 0.2, np.float32)
    image[rows // 3, rows // 2] = 300
    parts = -(-128 // rows)
    found, expected = (
        prefilter(each, to="splitsum", levels=[0.2, 0.4], size=32)
        for each in (image, image.repeat(parts, axis=0).repeat(parts, axis=1))
    )
    for level, other in zip(found.levels, expected.levels, strict=True):
        np.testing.assert_allclose(level, other, rtol=1e-5, atol=1e-6)
        assert level.min() > 0.1


@pytest.mark.parametrize(("rows", "most"), [(16, 0.03), (32, 0.02)])
def test_coarse_light_is_in_as_many_texels_as_its_edges_need(rng, rows, most):
    """In the 8 texels that 16 rows hold, the level beside a mirror's was wrong by 22 %."""
    image = np.full((rows, 2 * rows, 3), 0.2, np.float32)
    assert prefilter(image, to="splitsum", levels=2).size == rows // 2
    image[rows // 3, rows // 2] = 100
    made, directions = prefilter(image, to="splitsum"), unit(rng, 400)
    with bilinear_filtering():
        found = CubeSampler(made.levels[2])(directions)
    parts = 256 // rows
    fine = image.repeat(parts, axis=0).repeat(parts, axis=1)
    expected = brute_force(fine, made.roughness[2], directions)
    assert np.linalg.norm(found - expected) < most * np.linalg.norm(expected)


def test_coarse_light_without_finer_degrees_has_no_steps():
    """Its pixels are samples: every level is a line in x, as the light is."""
    light = 1 + 0.5 * oracles.latlong_pixels(32, 16)[..., :1]
    made = prefilter(np.repeat(light, 3, axis=-1), to="splitsum", levels=[0.4], size=16)
    x, values = oracles.cube_texels(16)[..., 0].ravel(), made.levels[0][..., 0].ravel()
    slope, middle = np.polyfit(x, values, 1)
    assert 0.4 < slope < 0.5
    np.testing.assert_allclose(values, middle + slope * x, atol=1e-5)
