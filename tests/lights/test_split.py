"""Lamps of known places and sizes, found on every grid and put back as discs."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.special

from shrm_cli.errors import ArgumentError
from shrm_cli.lights.lamp import Light
from shrm_cli.lights.pixels import SpherePixels
from shrm_cli.lights.split import fill_regions, order_on, prove, split_lamps
from shrm_cli.probe import resample
from shrm_cli.probe.disc import Disc, disc_coefficients
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.sky import SUN_RADIUS, sky, sun_radiance
from shrm_cli.sphere.quadrature import spiral_directions
from tests import oracles
from tests.lights import rooms
from tests.lights.rooms import long_lamp, probe, round_lamp, unit

LIGHT = np.array([900.0, 700.0, 400.0])
PLACES = {
    "generic": unit(0.3, 0.5, 0.7),
    "seam": unit(0.004, 0.3, -0.9),
    "zenith": unit(0.01, 1, 0.004),
    "nadir": unit(0.03, -1, -0.02),
    "corner of a cube": unit(1, 1.01, 0.99),
    "edge of a cube": unit(1, 0.2, 1),
}


@pytest.mark.parametrize(("layout", "place"), [
    ("latlong", "generic"), ("latlong", "seam"), ("latlong", "zenith"), ("latlong", "nadir"),
    ("openexr", "generic"), ("openexr", "corner of a cube"), ("openexr", "edge of a cube"),
    ("angular", "generic"), ("angular", "seam"),
])  # fmt: skip
def test_a_disc_is_recovered(layout, place):
    """Against the disc that was drawn: a tenth of a pixel, 1 % of the irradiance."""
    axis, radius = PLACES[place], 2 * np.degrees(rooms.pixel(layout))
    split = split_lamps(probe(layout, (round_lamp(axis, radius), LIGHT)))
    (lamp,) = split.lamps
    assert len(lamp.discs) == 1
    assert np.linalg.norm(lamp.direction - axis) < 0.1 * rooms.pixel(layout)
    expected = np.pi * np.sin(np.radians(radius)) ** 2 * LIGHT
    np.testing.assert_allclose(lamp.irradiance, expected, rtol=0.01)
    assert np.degrees(lamp.radius) == pytest.approx(radius, rel=0.1)
    assert not lamp.is_elongated
    assert lamp.is_resolved
    # What is left looks like the room without the lamp.
    np.testing.assert_allclose(split.residual, rooms.bare(layout), rtol=0, atol=0.1)
    assert split.proof.rms < 1e-3


@pytest.mark.parametrize("rows", [16, 32, 64])
def test_a_single_large_pixel_is_a_lamp(rows):
    """Against sums over 64 parts of the pixel, which as a point differs from them by .2 %."""
    image = np.zeros((rows, 2 * rows, 3))
    row, column = rows // 3, rows // 2
    image[row, column] = LIGHT
    split = split_lamps(Probe.from_array(image))
    ((disc,),) = [lamp.discs for lamp in split.lamps]
    assert not split.residual.any()
    inside = np.s_[8 * row : 8 * row + 8, 8 * column : 8 * column + 8]
    parts = oracles.latlong_pixels(16 * rows, 8 * rows)[inside].reshape(-1, 3)
    areas = np.hypot(parts[:, 0], parts[:, 2]) * (np.pi / rows / 8) ** 2
    normals = spiral_directions(500)
    expected = np.maximum(normals @ parts.T, 0) @ areas
    around, weights = oracles.disc_rule(disc.direction, disc.radius)
    found = np.maximum(normals @ around.T, 0) @ weights
    wrong = np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))
    assert wrong < 2e-3
    assert split.lamps[0].error < 1e-3


@pytest.mark.parametrize("elevation", [4.0, 28.7, 88.0])
def test_the_sun_of_a_sky(elevation):
    """Its direction and its irradiance are known exactly; pixels are larger than it."""
    split = split_lamps(Probe.from_array(sky(256, 37.3, elevation)))
    (lamp,) = split.lamps
    facts = lamp.summary()
    assert facts["elevation"] == pytest.approx(elevation, abs=0.25 * 180 / 256)
    expected = sun_radiance(elevation, 3.0) * np.pi * np.sin(SUN_RADIUS) ** 2
    np.testing.assert_allclose(lamp.irradiance, expected, rtol=0, atol=0.01 * expected.max())
    assert not lamp.is_resolved
    forced = split_lamps(split.probe, sun_radius=0.2655).lamps[0]
    assert forced.radius == pytest.approx(np.radians(0.2655))
    np.testing.assert_allclose(forced.irradiance, lamp.irradiance, rtol=1e-3)


def polar(rows, height, sampling):
    """A dim room with a lamp in one texel, or all, of its first rows."""
    image = np.full((height, 2 * height, 3), 0.1, np.float32)
    image[: rows or 1, slice(5, 6) if rows == 0 else slice(None)] = 6e4
    return Probe.from_array(image, "latlong", sampling=sampling)


def disc_irradiance(disc, normals, count=2000):
    """Of surfaces with these normals, as a sum over points that share the disc's area."""
    down = 1 - (np.arange(count) + 0.5) / count * (1 - np.cos(disc.radius))
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    helper = np.cross(disc.direction, np.eye(3)[np.argmin(np.abs(disc.direction))])
    right = helper / np.linalg.norm(helper)
    points = down[:, None] * disc.direction + np.sqrt(1 - down**2)[:, None] * (
        np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * np.cross(disc.direction, right)
    )
    mean = np.maximum(normals @ points.T, 0).mean(axis=1)
    return mean[:, None] * disc.radiance * disc.solid_angle


@pytest.mark.parametrize(("rows", "height", "sampling"), [
    (0, 16, "center"), (0, 32, "center"), (0, 32, "border"),
    (1, 32, "center"), (1, 64, "center"), (2, 64, "center"),
])  # fmt: skip
def test_lamps_at_a_pole_keep_their_irradiance(rows, height, sampling):
    """Against sums over the pixels by their solid angles, and by what the proof itself says."""
    split = split_lamps(polar(rows, height, sampling))
    assert len(split.lamps) == 1
    assert split.proof.rms <= split.error
    pixels = SpherePixels(split.probe.grid)
    numbers = np.arange(2 * height**2)
    points, areas = pixels.directions(numbers), pixels.areas(numbers)
    normals = spiral_directions(1000)
    light = (split.probe.image() - split.residual.astype(float)).reshape(-1, 3)
    there = light.any(axis=1)
    taken = np.maximum(normals @ points[there].T, 0) @ (areas[there, None] * light[there])
    given = sum(disc_irradiance(disc, normals) for disc in split.discs)
    scale = np.sqrt((taken**2).sum(axis=1).mean())
    assert np.sqrt(((taken - given) ** 2).sum(axis=1).mean()) < 2e-3 * scale


def row_areas(height):
    """Solid angle of a pixel of each row."""
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    return (edges[:-1] - edges[1:]) * np.pi / height


def test_what_is_taken_out_is_what_lamps_have(rng):
    lamps = [(round_lamp(PLACES[name], 2.0), LIGHT) for name in ("generic", "seam", "nadir")]
    split = split_lamps(probe("latlong", *lamps))
    assert len(split.lamps) == 3
    areas = row_areas(96)
    taken = (split.probe.image().astype(float) - split.residual).sum(axis=1).T @ areas
    flux = sum(disc.radiance * disc.solid_angle for disc in split.discs)
    np.testing.assert_allclose(flux, taken, rtol=1e-6)


def irradiance(normals, directions, light):
    """Brute force: sums over points with (n, 3) radiance times area."""
    return np.maximum(normals @ directions.T, 0) @ light


def test_the_proof_is_that_of_sums_over_pixels(rng):
    """RMS and maximum over normals, without harmonics: the original against residual and discs."""
    tube = long_lamp(unit(0.3, 0.5, 0.7), unit(0.7, 0, -0.3), 24, 3)
    lamps = [(round_lamp(PLACES["seam"], 6.0), LIGHT), (tube, LIGHT)]
    split = split_lamps(probe("latlong", *lamps), error=0.02)
    directions = oracles.latlong_pixels(192, 96).reshape(-1, 3)
    areas = np.repeat(row_areas(96), 192)[:, None]
    normals = oracles.random_directions(rng, 600)
    before = irradiance(normals, directions, split.probe.image().reshape(-1, 3) * areas)
    after = irradiance(normals, directions, split.residual.reshape(-1, 3) * areas)
    for disc in split.discs:
        points, weights = oracles.disc_rule(disc.direction, disc.radius)
        after += irradiance(normals, points, weights[:, None] * disc.radiance)
    wrong = np.linalg.norm(after - before, axis=1)
    scale = np.sqrt((np.linalg.norm(before, axis=1) ** 2).mean())
    assert split.proof.scale == pytest.approx(scale, rel=0.05)
    assert split.proof.rms == pytest.approx(np.sqrt((wrong**2).mean()) / scale, rel=0.15)
    assert split.proof.maximum == pytest.approx(wrong.max() / scale, rel=0.15)
    assert 1e-4 < split.proof.rms < 0.02


def test_the_largest_difference_is_that_of_many_normals(rng, monkeypatch):
    """Of discs anywhere, half of them brighter and half dimmer, to three parts in a thousand."""
    before, differences = np.ones((169, 3)), []
    for _ in range(12):
        colors = rng.normal(size=(6, 3))
        parts = zip(oracles.random_directions(rng, 6), colors, strict=True)
        discs = [Disc(direction, 0.05, color) for direction, color in parts]
        differences.append(disc_coefficients(discs, 12))

    def largest():
        return np.array([prove(before, before + each, []).maximum for each in differences])

    found = largest()
    monkeypatch.setattr("shrm_cli.lights.split._NORMALS", 16384)
    np.testing.assert_array_less(0.997, found / largest())


def test_a_wrong_disc_is_told(rng):
    """The proof notices a disc that is too bright by a tenth of it."""
    split = split_lamps(probe("latlong", (round_lamp(PLACES["generic"], 3.0), LIGHT)))
    (disc,) = split.discs
    before = project(split.probe, 12).coefficients
    after = project(split.residual_probe, 12).coefficients
    brighter = Disc(disc.direction, disc.radius, disc.radiance * 1.1)
    # A point gives E cos, whose square has the mean E^2 / 6 over normals.
    expected = 0.1 * np.linalg.norm(disc.irradiance) / np.sqrt(6) / split.proof.scale
    assert prove(before, after, [brighter]).rms == pytest.approx(expected, rel=0.02)


def test_a_tube_is_long_and_becomes_discs():
    axis, along = unit(0.3, 0.5, 0.7), unit(0.7, 0, -0.3)
    made = probe("latlong", (long_lamp(axis, along, 40, 3), LIGHT))
    (rough,) = split_lamps(made, error=0.2).lamps
    assert len(rough.discs) == 1
    assert rough.is_elongated
    facts = rough.summary()
    assert facts["length"] == pytest.approx(40, rel=0.1)
    # A pixel is no narrower than 1.9 degrees, and those that the tube touches count as it.
    assert 3 < facts["width"] < 3 + 2 * 1.9
    split = split_lamps(made, error=0.002)
    (fine,) = split.lamps
    assert 2 <= len(fine.discs) <= 16
    assert split.proof.rms < 0.002 < rough.error
    np.testing.assert_allclose(fine.light.flux, rough.light.flux, rtol=1e-6)


def test_the_error_decides_what_is_a_lamp():
    bright, dim = PLACES["generic"], PLACES["seam"]
    made = probe("latlong", (round_lamp(bright, 2.0), LIGHT), (round_lamp(dim, 2.0), LIGHT / 30))
    assert len(split_lamps(made, error=0.002).lamps) == 2
    assert len(split_lamps(made, error=0.1).lamps) == 1
    split = split_lamps(made, error=0.002, count=1)
    assert (len(split.lamps), split.left) == (1, 1)
    assert np.linalg.norm(split.lamps[0].direction - bright) < 0.01


def test_nothing_is_found_where_nothing_stands_out(rng):
    for image in (
        scenes_without_lamps(rng), np.zeros((32, 64, 3), np.float32),
        np.ones((32, 64, 3), np.float32),
    ):  # fmt: skip
        split = split_lamps(Probe.from_array(image))
        assert split.lamps == ()
        np.testing.assert_array_equal(split.residual, image)
        assert split.proof.rms == 0


def scenes_without_lamps(rng):
    return rng.uniform(0, 2, (32, 64, 3)).astype(np.float32)


def test_a_turned_probe_has_its_lamps_in_world_axes():
    image = probe("latlong", (round_lamp(PLACES["generic"], 3.0), LIGHT)).image()
    turned = Probe.from_array(image, yaw=90)
    split = split_lamps(turned)
    x, y, z = PLACES["generic"]
    np.testing.assert_allclose(split.lamps[0].direction, [z, y, -x], atol=0.003)
    assert split.proof.rms < 5e-4


def test_dark_rims_do_not_stay():
    """A filter's dark ring around a lamp is taken away with it."""
    made = probe("latlong", (round_lamp(PLACES["generic"], 3.0), LIGHT))
    image = made.image()
    near = oracles.latlong_pixels(192, 96) @ PLACES["generic"]
    ring = (near < np.cos(np.radians(4.2))) & (near > np.cos(np.radians(6.6)))
    assert ring.sum() > 10
    image[ring] = 0
    split = split_lamps(Probe.from_array(image))
    np.testing.assert_allclose(split.residual, rooms.bare("latlong"), rtol=0, atol=0.1)
    assert split.residual.min() > 0


def test_a_place_is_filled_by_what_is_near():
    """At an edge of the light each side goes on, and a slope goes on across the lamp."""
    axis, along = unit(0.3, 0.2, 0.7), unit(0.7, 0, -0.3)
    directions = oracles.latlong_pixels(192, 96)
    inside, x = directions @ axis > np.cos(np.radians(6)), directions @ along
    pixels = SpherePixels(Probe.from_array(np.ones((96, 192))).grid)
    for light, limit in ((np.where(x > 0, 10.0, 1.0), 0.8), (5 + 10 * x, 0.5)):
        image = np.repeat(np.where(inside, 1000, light)[..., None], 3, axis=2)
        (filled,) = fill_regions(image, pixels, [np.flatnonzero(inside)])
        off = np.abs(filled.values[:, 0] - light.ravel()[filled.numbers])
        at_edge = (light == 5 + 10 * x) | (np.abs(x) > np.sin(np.radians(6)))
        assert off[at_edge.ravel()[filled.numbers]].max() < limit


def test_dim_ends_are_of_a_lamp_and_glare_is_not():
    """A tube of 20 degrees, of which a half has a third of the radiance, and a streak beyond."""
    angles = np.radians(np.arange(-19.5, 20))
    radiance = np.select([np.abs(angles) > np.radians(10), angles > 0], [0.2, 0.35], 1.0)
    directions = np.stack([np.sin(angles), np.zeros(40), np.cos(angles)], axis=1)
    light = Light(directions, np.repeat(radiance[:, None], 3, 1), np.full(40, np.radians(1) ** 2))
    middle, axes, spans = light.shape()
    assert np.degrees(spans[0]) == pytest.approx(20, rel=0.01)
    np.testing.assert_allclose([middle[2], abs(axes[0, 0])], 1, atol=1e-3)


def test_the_degrees_that_are_compared_hold_the_irradiance_of_a_point():
    """But for 1e-5 of its square, for which half as many are too few."""

    def beyond(order):
        x, w = np.polynomial.legendre.leggauss(200)
        x, w = (x + 1) / 2, w / 2  # from the horizon to the normal
        factors = np.array([w @ (x * scipy.special.eval_legendre(n, x)) for n in range(order + 1)])
        return 1 - 1.5 * ((2 * np.arange(order + 1) + 1) * factors**2).sum()

    order = order_on(Probe.from_array(np.ones((128, 256))).grid)
    assert beyond(order) < 1e-5 < beyond(order // 2)
    assert order_on(Probe.from_array(np.ones((16, 32))).grid) == 15


def test_a_plateau_is_suspected_to_be_clipped():
    image = probe("latlong", (round_lamp(PLACES["generic"], 5.0), LIGHT)).image()
    near = oracles.latlong_pixels(192, 96) @ PLACES["generic"]
    falling = np.exp(600 * (near - 1))[..., None].astype(np.float32) * 4000
    whole = image + falling
    assert split_lamps(Probe.from_array(whole)).lamps[0].clipped == ""
    cut = np.minimum(whole, 2500)
    assert "share the maximum 2500 of R" in split_lamps(Probe.from_array(cut)).lamps[0].clipped
    # A green lamp has next to no red, the same everywhere, which tells nothing.
    green = whole.copy()
    green[..., 0] = np.minimum(green[..., 0], 5)
    assert split_lamps(Probe.from_array(green)).lamps[0].clipped == ""
    half = np.minimum(whole * 40, 65504)
    assert "end of half precision" in split_lamps(Probe.from_array(half)).lamps[0].clipped


def test_one_line_tells_of_all_clipped_lamps():
    pixels = np.full((64, 128, 3), 0.1, np.float32)
    for column in (20, 60, 100):
        pixels[20:23, column : column + 3] = 65504
    split = split_lamps(Probe.from_array(pixels))
    (line,) = split.clipped
    assert line.startswith("3 lamps may be clipped, such as lamp 1: R reaches 65504")
    (line,) = replace(split, lamps=split.lamps[:1]).clipped
    assert line.startswith("lamp 1 may be clipped: R reaches 65504, the end of half precision; its")
    assert not replace(split, lamps=()).clipped


def test_large_probes_are_searched_in_means(monkeypatch):
    """Against the search in all pixels: the same lamp, and the residual has all pixels."""
    made = probe("latlong", (round_lamp(PLACES["generic"], 4.0), LIGHT))
    fine = split_lamps(made)
    monkeypatch.setattr(resample, "LEAST_ROWS", 48)
    monkeypatch.setattr("shrm_cli.lights.split.LEAST_ROWS", 48)
    split = split_lamps(replace(made))
    assert split.grid.shape == (48, 96)
    assert split.residual.shape == (96, 192, 3)
    np.testing.assert_allclose(split.lamps[0].direction, fine.lamps[0].direction, atol=2e-3)
    np.testing.assert_allclose(split.lamps[0].irradiance, fine.lamps[0].irradiance, rtol=0.01)
    assert split.proof.rms < 2e-3
    np.testing.assert_allclose(split.residual, rooms.bare("latlong"), atol=0.1)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("sun_radius", each) for each in (0.0, -1.0, 91.0, np.nan)),
        ("error", np.nan), ("error", -0.1), ("count", -1), ("largest", np.nan),
    ],
)  # fmt: skip
def test_numbers_that_cannot_be_are_refused(name, value):
    with pytest.raises(ArgumentError, match=f"`{name}` is .*; give"):
        split_lamps(np.ones((8, 16, 3)), **{name: value})
