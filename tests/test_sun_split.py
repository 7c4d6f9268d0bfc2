"""`sun` split, from a probe to what a map with lamps beside it reflects."""

import json

import numpy as np
import pytest

import shrm_cli
from shrm_cli import automatic
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.errors import ArgumentError, ShrmWarning
from shrm_cli.forms import Forms
from shrm_cli.lights.split import split_lamps
from shrm_cli.maps.request import Request
from shrm_cli.plan import policy
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import LUMINANCE
from tests import brute_force, ggx
from tests.lights import rooms
from tests.probe.scenes import latlong

SUN = rooms.unit(0.35, 0.55, -0.7)
ROWS = 128
RADIUS = 3.0
"""Of the sun, degrees, of which pixels of 1.4 degrees show the size."""


def probe():
    """A bare sun in a sky without clouds."""
    lamp = (rooms.round_lamp(SUN, RADIUS), (900.0, 800.0, 600.0))
    return Probe.from_array(rooms.latlong(ROWS, rooms.room(lamp)), name="room")


def truth(roughness, normals, views, f0):
    """What GGX reflects of the room itself, of which nothing is a pixel: as a sum over points."""
    lights, areas = brute_force.latlong_samples(100)
    radiance = rooms.background(lights)
    polar = np.radians(RADIUS) * (np.arange(60) + 0.5) / 60
    around = 2 * np.pi * (np.arange(120) + 0.5) / 120
    side = np.cross(SUN, [0.0, 1.0, 0.0]) / np.linalg.norm(np.cross(SUN, [0.0, 1.0, 0.0]))
    other = np.cross(SUN, side)
    ring = np.cos(around)[:, None] * side + np.sin(around)[:, None] * other
    disc = np.cos(polar)[:, None, None] * SUN + np.sin(polar)[:, None, None] * ring
    weights = np.repeat(np.sin(polar) * np.radians(RADIUS) / 60 * 2 * np.pi / 120, 120)
    lights = np.concatenate([lights, disc.reshape(-1, 3)])
    energy = np.concatenate(
        [areas[:, None] * radiance, weights[:, None] * np.array([900.0, 800.0, 600.0])]
    )
    base, tail = ggx.reflected(roughness, normals, views, lights, energy)
    return f0 * (base - tail) + tail


@pytest.fixture(scope="module")
def points():
    """Mirror directions and views of all kinds, and some that see the sun's highlight."""
    rng = np.random.default_rng(8)
    mirrored, views = brute_force.unit(rng, 160), brute_force.unit(rng, 160)
    near = SUN + 0.12 * rng.normal(size=(60, 3))
    mirrored[:60] = near / np.linalg.norm(near, axis=1, keepdims=True)
    normals = mirrored + views
    return normals / np.linalg.norm(normals, axis=1, keepdims=True), views


class Unknown(Ggx):
    """A BRDF of a class that shaders have no code of."""

    name = "unknown"


def asked(max_size):
    """A map of such a BRDF in so many bytes."""
    brdf = Unknown(roughness=0.3, f0=0.04)
    return prefilter_with_facts(probe(), "auto", {"brdf": brdf, "max_size": max_size})


def test_what_has_no_code_is_shown_by_a_table(tmp_path, points):
    """By default, in a file that needs no BRDF beside it, as the BRDF itself shows the sun."""
    made = asked(1_400_000)
    assert "lamps beside it" in dict(made.notes)["form"]
    made.map.save(tmp_path / "map.exr")
    found = shrm_cli.open_map(tmp_path / "map.exr").radiance(*points)
    expected = truth(0.3, *points, 0.04)
    error = np.sqrt(np.sum((found - expected) ** 2) / np.sum(expected**2))
    assert error < 0.02
    assert made.map.error > error  # uniformly over views, of which these have few at the horizon


def test_no_table_is_made_that_does_not_fit():
    assert "lamps" not in dict(asked(1_100_000).notes)


@pytest.mark.proof
def test_no_shrm_loses_the_bytes_that_lamps_beside_a_map_win(monkeypatch):
    """It may take the place of a map of functions, but not with more bytes than are worth it."""
    light = probe()
    request = Request.of("auto", {"brdf": "oren-nayar:sigma=0.25"}, light)
    made = [
        automatic._Choice(Forms(light, request, most_simple=most)).make() for most in (1e9, 1e4)
    ]
    assert [each.map.representation for each in made] == ["shrm", "principal"]
    given, of = [], automatic._BesideLamps.of

    def noted(beside, request, most_simple):
        given.append(most_simple)
        return of(beside, request, most_simple)

    monkeypatch.setattr(automatic._BesideLamps, "of", noted)
    prefilter_with_facts(
        probe(), "auto", {"brdf": "ggx:roughness=0.15,f0=0.04", "max_size": 400_000}
    )
    (most,) = given
    assert 0.3 * 400_000 < most <= policy.WORTH_LAMPS * 400_000


def test_the_rest_misses_less_where_discs_change_much(rng):
    """Two rows of pixels are no disc, which alone misses two thirds of what is allowed."""
    leaves = rng.uniform(0.2, 1.8, (64, 128, 3)).astype(np.float32)
    leaves[20:22, 40:44] = 300
    asked = {"brdf": "ggx:roughness=0.5", "sun": "split", "error": 0.02, "seen": 0.5}
    made = prefilter_with_facts(Probe.from_array(leaves), "auto", asked).map
    rest = np.hypot(made.info.predicted_error, made.info.filter_error)
    assert 0.012 < made.error < 0.02
    assert np.hypot(made.error, rest) <= 0.02


@pytest.mark.proof
def test_brute_force(points):
    """In the highlight and beside it, in a thousandth of the bytes."""
    expected = truth(0.2, *points, 0.04)
    made = {
        sun: prefilter_with_facts(
            probe(), "auto", {"brdf": "ggx:roughness=0.2,f0=0.04", "sun": sun}
        )
        for sun in ("keep", "split")
    }
    errors, wrong, sizes = {}, {}, {}
    for sun, each in made.items():
        found = each.map.radiance(*points)
        errors[sun] = np.sqrt(np.sum((found - expected) ** 2) / np.sum(expected**2))
        bright = expected @ LUMINANCE
        limit = 0.05 * np.maximum(bright, 0.02 * bright.mean())
        wrong[sun] = np.mean(np.abs((found - expected) @ LUMINANCE) > limit)
        sizes[sun] = each.map.cube_count * each.map.size**2
    assert errors["split"] < 0.01 < 0.03 < errors["keep"]
    assert wrong["split"] < 0.05 < 0.075 < wrong["keep"]
    assert 2 * wrong["split"] < wrong["keep"]
    assert sizes["split"] < sizes["keep"] / 1000


def test_the_whole_is_what_errors_are_relative_to(diffuse):
    """The share of the light that is left is that of sums over evenly spread points."""
    made = diffuse
    rng = np.random.default_rng(3)
    normals = brute_force.unit(rng, 4000)
    rest, whole = (each.radiance(normals, normals) for each in (made.map.map, made.map))
    share = np.sqrt(np.sum(rest**2) / np.sum(whole**2))
    assert made.map.left == pytest.approx(share, rel=0.03)
    inner = made.map.map.info.predicted_error
    assert made.summary()["predicted_error"] == pytest.approx(made.map.left * inner)
    assert made.map.error < 0.01


@pytest.fixture(scope="module")
def diffuse():
    """An SHRM of chalk with the sun beside it, and what is known of it."""
    return prefilter_with_facts(probe(), "shrm", {"brdf": "lambertian", "sun": "split"})


def test_the_record_is_that_of_the_probe(diffuse):
    found = diffuse.map
    assert found.info.probe == "room"
    assert found.info.probe_sha256 == probe().digest()
    assert found.info.options["sun"] == "split"
    (lamp,) = split_lamps(probe()).lamps
    assert json.loads(json.dumps(found.summary()))["lamps"][0]["radius"] == pytest.approx(
        np.degrees(lamp.discs[0].radius)
    )


def test_a_probe_without_lamps_says_so():
    plain = Probe.from_array(latlong(32))
    with pytest.warns(ShrmWarning, match="no compact lamps"):
        found = shrm_cli.prefilter(plain, "lambertian", to="shrm", sun="split")
    same = shrm_cli.prefilter(plain, "lambertian", to="shrm")
    np.testing.assert_array_equal(found.coefficients, same.coefficients)


@pytest.mark.parametrize("value", ["none", "", True, 3])
def test_other_values_are_refused(value):
    with pytest.raises(ArgumentError, match="sun"):
        shrm_cli.prefilter(probe(), "lambertian", sun=value)


def test_what_it_does_not_apply_to():
    with pytest.raises(ArgumentError, match="fibres"):
        shrm_cli.prefilter(probe(), "kajiya-kay", to="shrm", sun="split")
    with pytest.raises(ArgumentError, match="applies with `to`"):
        shrm_cli.prefilter(probe(), to="irradiance", sun="split")
