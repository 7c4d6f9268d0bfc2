"""Lamps beside the maps of one probe: looked for once, and the same as for a map alone."""

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.lights import beside, shape
from shrm_cli.maps import lobes_lit, sphere_pixels
from shrm_cli.maps.lamps.map import MOST_DISCS
from shrm_cli.maps.lamps.rule import LitDiscs
from shrm_cli.maps.wrong_pixels import beside_lamps, wrong_share
from shrm_cli.plan import policy
from shrm_cli.plan.search import Goal
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.disc import Disc, disc_coefficients, radius_of
from shrm_cli.probe.lighting import project
from shrm_cli.probe.shared import shared
from shrm_cli.reference import Reference
from shrm_cli.vocabulary import LAMP_COUNT, LUMINANCE
from tests import brute_force, ggx
from tests.lights import rooms


@pytest.fixture
def pixels(rng):
    found = 0.1 + rng.random((64, 128, 3)).astype(np.float32) / 10
    found[20:22, 40:42] = 300
    return found


def test_maps_of_one_probe_look_for_its_lamps_once(pixels, monkeypatch):
    looked = []
    split_lamps = beside.split_lamps

    def looking(probe, **given):
        looked.append(1)
        return split_lamps(probe, **given)

    monkeypatch.setattr(beside, "split_lamps", looking)
    probe = shared(shrm.Probe.from_array(pixels, layout="latlong"))
    residuals = set()
    for brdf in ("ggx:roughness=0.5", "phong:exponent=32"):
        given = {"brdf": brdf, "sun": "split"}
        made = prefilter_with_facts(probe, "auto", given).map
        found = next(beside.splits_for(probe, shrm.parse_spec(brdf), beside.ANY)).split
        residuals.add(id(found.residual_probe))
        assert len(looked) == 1
        alone = shrm.Probe.from_array(pixels, layout="latlong")
        apart = prefilter_with_facts(alone, "auto", given).map
        for plane, expected in zip(made.planes(), apart.planes(), strict=True):
            np.testing.assert_array_equal(plane, expected)
        looked.pop()
    assert len(residuals) == 1


def bright_rows(rows=256):
    """A lamp as long as it is no disc, with a brighter spot beside its middle."""
    row, column = np.mgrid[:rows, : 2 * rows]
    pixels = np.full((rows, 2 * rows, 3), 0.1, np.float32)
    pixels[(abs(row - 90) <= 1) & (abs(column - 200) <= 3)] = 3000
    pixels[(abs(row - 94) <= 1) & (abs(column - 203) <= 1)] = 9000
    return pixels


def soft_box(rows=128):
    """A box of light of 14 x 8 degrees."""
    pixels = np.full((rows, 2 * rows, 3), 0.1, np.float32)
    pixel = rows // 128
    pixels[44 * pixel : 50 * pixel, 90 * pixel : 100 * pixel] = 300
    return pixels


def split_of(pixels, roughness, most):
    return next(beside.splits_for(
        shrm.Probe.from_array(pixels), shrm.parse_spec(f"ggx:roughness={roughness}"),
        Goal(most, None),
    ))  # fmt: skip


def test_what_discs_change_is_known_to_all_degrees(monkeypatch):
    """A sixth of it lies beyond those that are known, where lobes are as sharp as lamps.

    It is no less dense there than before, as far as is known, and never more.
    """
    errors = []
    for order in (96, 255):
        monkeypatch.setattr(beside, "_ORDERS", (order, 4))
        errors.append(split_of(bright_rows(), 0.15, 1.0).error)
    assert errors[1] > 0.05
    assert errors[1] <= errors[0] <= 1.1 * errors[1]


def test_what_lamps_change_is_known_to_a_part_in_a_thousand(monkeypatch):
    """As the sampling of the BRDF lets it be, beside a finer one."""
    found = split_of(soft_box(), 0.3, 1.0).error
    monkeypatch.setattr(beside, "_ACCURACY", 1e-5)
    assert found == pytest.approx(split_of(soft_box(), 0.3, 1.0).error, rel=1e-3)


def test_what_is_wrong_with_discs_is_known_in_world_axes(pixels):
    """It is expanded in others, about which the pixels of a row are alike."""
    found = split_of(pixels, 0.5, 1.0)
    expected = difference(found.split, 192)
    assert np.linalg.norm(expected) > 1
    np.testing.assert_allclose(found.lamps.wrong, expected, rtol=0, atol=1e-9)


def difference(split, order):
    """What a probe's lamps are and their discs are not, of which coarse pixels are in parts."""
    lights = map(shape._fine_light, split.lamps)
    each = [zip(light.directions, light.areas, light.radiance, strict=True) for light in lights]
    discs = [Disc(at, radius_of(area), radiance) for some in each for at, area, radiance in some]
    return disc_coefficients(discs, order) - disc_coefficients(split.discs, order)


@pytest.mark.parametrize(
    ("most", "of_lamp", "count", "is_held"),
    [(1.0, None, 2, False), (0.05, None, 6, False), (0.015, None, 12, False), (0.05, 0, 2, True)],
)
def test_a_map_holds_what_discs_lack_of_a_soft_box(most, of_lamp, count, is_held, monkeypatch):
    """No more of it than it has to, and map and lamps lack what it does not hold.

    It holds none where some more discs suffice.
    """
    if of_lamp is not None:
        monkeypatch.setattr(shape, "MOST_OF_LAMP", of_lamp)
    found = split_of(soft_box(), 0.2, most)
    assert (len(found.split.discs), found.is_held) == (count, is_held)
    residual, rest = (project(each, 60) for each in (found.split.residual_probe, found.rest))
    added, wrong = rest.coefficients - residual.coefficients, difference(found.split, 60)
    share = np.linalg.norm(added) / np.linalg.norm(wrong)
    assert 0.2 < share < 0.9 if found.is_held else share == 0
    np.testing.assert_allclose(added + found.lamps.wrong[: len(wrong)], wrong, rtol=0, atol=1e-9)
    assert np.all(rest.energy - residual.energy >= (added**2).sum(axis=0) * (1 - 1e-9))
    assert 0.005 < found.error <= policy.BESIDE * most


@pytest.mark.parametrize("roughness", [0.2, 0.1])
def test_a_map_holds_all_of_it_where_no_part_suffices(roughness, monkeypatch):
    """Of the sharper lobe a third is finer than all parts that are tried."""
    monkeypatch.setattr(shape, "MOST_OF_LAMP", 0)
    found = split_of(soft_box(256), roughness, 0.01)
    rest, whole = (project(each, 60).coefficients for each in (found.rest, found.split.probe))
    discs = disc_coefficients(found.split.discs, 60)
    np.testing.assert_allclose(rest + discs, whole, rtol=0, atol=1e-9)
    assert found.is_held
    assert 0 < found.error < 0.05


def test_no_map_holds_what_is_finer_than_pixels(monkeypatch):
    """Of large pixels it was said to hold all, and rings were all over sharp lobes."""
    monkeypatch.setattr(shape, "MOST_OF_LAMP", 0)
    found = split_of(soft_box(), 0.1, 0.01)
    assert not found.is_held
    assert found.rest.digest() == found.split.residual_probe.digest()


def ceiling(rows=128):
    """A room with a window, and a ring of weak light along its ceiling."""
    pixels = np.full((rows, 2 * rows, 3), 0.15, np.float32)
    pixels[15] = 10
    pixels[50:65, 75:85] = 300
    return pixels


def boxes(rows=128):
    """A room with a window, and a long box of weak light."""
    pixels = np.full((rows, 2 * rows, 3), 0.15, np.float32)
    pixels[44:50, 100:125] = 10
    pixels[50:65, 75:85] = 300
    return pixels


@pytest.mark.parametrize("brdf", [
    "ggx:roughness=0.4", pytest.param("ggx:roughness=0.4,anisotropy=0.6", marks=pytest.mark.proof),
])  # fmt: skip
def test_what_discs_change_is_seen_though_the_error_is_small(brdf, monkeypatch):
    """Of all light the box is little, and a disc in its place is seen all around it."""
    monkeypatch.setattr(shape, "MOST_OF_LAMP", 0)
    brdf, probe = shrm.parse_spec(brdf), shrm.Probe.from_array(boxes())
    by_error = next(beside.splits_for(probe, brdf, Goal(0.05, None)))
    assert not by_error.is_held
    expected, found = measured(by_error)
    limit = 0.1 if by_error.brdf.isotropic else 0.02  # brushed ones are integrated, too
    assert np.linalg.norm(found - expected) < limit * np.linalg.norm(expected)
    assert seen_beside(by_error) > 1.5 * policy.WRONG_BESIDE * 0.05
    by_pixels = next(beside.splits_for(probe, brdf, Goal(0.05, 0.05)))
    assert by_pixels.is_held
    assert seen_beside(by_pixels) <= 1.1 * policy.WRONG_BESIDE * 0.05


@pytest.mark.proof
def test_discs_are_good_enough_for_brushed_metal_in_a_dark_studio():
    """They seemed wrong at 14 % of the points, and maps that held their corners had black rims."""
    boxes, points = np.zeros((128, 256, 3), np.float32), sphere_pixels.pixels("reflection")
    boxes[41:50, 62:72], boxes[52:60, 200:208] = 280, 170
    brdf = shrm.parse_spec("ggx:roughness=0.5,anisotropy=0.8,mapping=openpbr,f0=0.9/0.8/0.6")
    found = next(beside.splits_for(shrm.Probe.from_array(boxes), brdf, Goal(0.05, 0.05)))
    assert not found.is_held
    normals, views = (
        np.reshape(each[::7, ::5, 1], (-1, 3)) for each in (points.normals, points.views)
    )
    seen = Reference(found.split.probe, brdf).radiance(normals, views) @ LUMINANCE
    lit = LitDiscs(brdf, found.split.discs).radiance(normals, views) @ LUMINANCE
    wrong = np.abs(lit - seen) > 0.05 * np.maximum(seen, 0.02 * seen.mean())
    assert np.mean(wrong) < 0.05


@pytest.mark.parametrize("rows", [128, 256])
def test_what_discs_change_does_not_ring_under_sharp_lobes(rows):
    """At 1 % of the points it is seen, where pixels are coarse, and else at .2 %.

    With degrees that end within an octave 7 % were wrong, or with those of coarse pixels 22 %.
    """
    assert 0 < seen_beside(split_of(bright_rows(rows), 0.15, 1.0)) < 0.02


def measured(found):
    """What discs change of the light at some points, by integration and as it is known."""
    rng, brdf = np.random.default_rng(5), found.brdf
    points = lobes_lit.judged([found.lamps.lobes])
    third = points.views.shape[1] // 3
    of_views = rng.integers(third, 2 * third, 300)  # the middle ones of `sample_views`
    at = rng.integers(0, 480, 300), of_views, rng.integers(0, 4, 300)
    where = points.normals[at], points.tangents(at), points.views[at]
    truth, rest = (Reference(each, brdf).brushed_radiance(*where)
                   for each in (found.split.probe, found.split.residual_probe))  # fmt: skip
    lit = LitDiscs(brdf, found.split.discs).brushed_radiance(*where)
    light = found.lamps.lit.seen_at(points, at)
    lit_by_these = 2 * np.pi * lit @ LUMINANCE  # in double precision
    np.testing.assert_allclose(light, lit_by_these, rtol=1e-5, atol=1e-5 * lit_by_these.max())
    wrong = found.lamps.wrong_at(points, at)
    return 2 * np.pi * (truth - rest - lit) @ LUMINANCE, wrong


def seen_beside(found):
    """The share of wrong pixels of lamps beside a map that misses nothing of what is left."""
    light = project(found.split.residual_probe, 60)
    with beside_lamps(found.lamps):
        return wrong_share(light, [found.lamps.lobes.to_order(60)])


def test_a_ring_stays_in_the_map():
    """Four discs give its irradiance, and are bright where its middle is dark."""
    probe = shrm.Probe.from_array(ceiling())
    by_irradiance = beside.split_lamps(probe, largest=0.3)
    assert [len(lamp.discs) for lamp in by_irradiance.lamps] == [3, 4]
    split = next(beside.splits_for(probe, shrm.parse_spec("ggx:roughness=0.4"), beside.ANY)).split
    assert ([len(lamp.discs) for lamp in split.lamps], split.left) == ([3], 1)
    ring = probe.image()[:30]
    np.testing.assert_array_equal(split.residual[:30], ring)


def test_larger_boxes_are_lamps_beside_maps_alone():
    """As lights of engines they would cast shadows that are too sharp."""
    pixels = np.full((128, 256, 3), 0.1, np.float32)
    pixels[44:60, 90:114] = 40
    assert not beside.split_lamps(shrm.Probe.from_array(pixels)).lamps
    assert split_of(pixels, 0.3, 0.05).split.lamps
    pixels[44:79, 90:125] = 40  # .7 sr
    assert split_of(pixels, 0.3, 0.05).split.lamps
    pixels[30:80, 90:140] = 40  # 1.5 sr
    assert not split_of(pixels, 0.3, 0.05).split.lamps


def filament():
    pixels = np.full((512, 1024, 3), 0.1, np.float32)
    pixels[180:186:2, 360:368:2] = 9000
    return pixels


def test_a_filament_takes_some_discs():
    found = split_of(filament(), 0.15, 0.05)
    assert (len(found.split.discs), found.is_held) == (4, False)
    assert found.error <= policy.BESIDE * 0.05


def test_a_filament_stays_discs(monkeypatch):
    """What is finer than the degrees of maps is none of their light."""
    monkeypatch.setattr(shape, "MOST_OF_LAMP", 0)
    found = split_of(filament(), 0.15, 0.05)
    assert (len(found.split.discs), found.is_held) == (2, False)
    assert found.error > 0.05


def test_the_lamp_that_wins_most_takes_the_discs():
    """A bright box, and a weak lamp that is round."""
    pixels = soft_box()
    down, right = np.mgrid[:128, :256]
    pixels[(down - 30) ** 2 + (right - 200) ** 2 < 12] = 60
    change = split_of(pixels, 0.2, 1.0).split
    transfer = beside._transfer(shrm.parse_spec("ggx:roughness=0.2"))
    few = shape.Change.of(change, transfer)
    made = [few.finer(most) for most in (20, 7, 5, 0)]
    counts = [[len(lamp.discs) for lamp in each.split.lamps] for each in made]
    assert counts[:3] == [[2, 1], [5, 1], [6, 1]]
    lost = [np.linalg.norm(each.known) for each in made]
    assert sorted(lost, reverse=True) == lost


def test_a_map_has_as_many_discs_as_its_file_may():
    assert LAMP_COUNT * shape.MOST_OF_LAMP <= MOST_DISCS


def test_a_round_sun_of_few_pixels_stays_one_disc():
    """Discs that follow its pixels are farther from the sun; see the proof in test_sun_split."""
    sun = rooms.round_lamp(rooms.unit(0.35, 0.55, -0.7), 3.0), (900.0, 800.0, 600.0)
    pixels = rooms.latlong(128, rooms.room(sun))
    transfer = beside._transfer(shrm.parse_spec("ggx:roughness=0.2,f0=0.04"))
    change = shape.Change.of(beside.split_of(shrm.Probe.from_array(pixels)), transfer)
    assert [len(lamp.discs) for lamp in change.finer(0).split.lamps] == [1]


@pytest.mark.proof
def test_a_soft_box_is_as_in_truth(monkeypatch):
    """Summed over points of the box, at the highlight and around it, where errors are largest."""
    probe = shrm.Probe.from_array(soft_box())
    rng = np.random.default_rng(3)
    (lamp, *_) = beside.split_lamps(probe).lamps
    near = lamp.light.axis + 0.3 * rng.normal(size=(200, 3))
    mirrored = near / np.linalg.norm(near, axis=1, keepdims=True)
    views = brute_force.unit(rng, 200)
    normals = mirrored + views
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lights, areas = brute_force.latlong_samples(512)
    row, column = np.divmod(np.arange(512 * 1024), 1024)
    energy = areas[:, None] * soft_box()[row // 4, column // 4]
    base, tail = ggx.reflected(0.2, normals, views, lights, energy)
    expected = 0.5 * (base - tail) + tail
    errors = []
    for most, held in ((shape.MOST_OF_LAMP, (0,)), (0, beside._HELD), (0, (0,))):
        monkeypatch.setattr(shape, "MOST_OF_LAMP", most)
        monkeypatch.setattr(beside, "_HELD", held)
        asked = {"brdf": "ggx:roughness=0.2,f0=0.5", "sun": "split", "error": 0.03}
        found = prefilter_with_facts(probe, "auto", asked).map.radiance(normals, views)
        errors.append(np.sqrt(np.sum((found - expected) ** 2) / np.sum(expected**2)))
    assert max(errors[:2]) < 0.05 < 0.07 < errors[2]


def test_an_error_beside_a_share_is_of_all_light():
    """It was of what is left, of which there is little beside a sun: a coat took 3.9 MB, not .1."""
    rng = np.random.default_rng(3)
    pixels = (0.05 + rng.random((8, 16, 3)) ** 4).repeat(8, 0).repeat(8, 1).astype(np.float32)
    pixels[20, 40] = 3000
    asked = {"brdf": "ggx:roughness=0.3", "to": "principal", "sun": "split"}
    light = shrm.Probe.from_array(pixels)
    of_rest, of_all = (shrm.prefilter(light, **asked, **each) for each in (
        {"error": 0.05}, {"error": 0.05, "seen": 0.5}
    ))  # fmt: skip
    assert of_all.cube_count < of_rest.cube_count
    errors = [np.hypot(each.info.predicted_error, each.error) for each in (of_rest, of_all)]
    assert errors[0] < errors[1] < 0.05
