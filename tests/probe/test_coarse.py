"""Probes whose pixels are cut."""

import numpy as np
import pytest

from shrm_cli.maps.splitsum.prefilter import make_levels
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.coarse import fine_probe
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.sky import sky
from tests import oracles
from tests.brute_force import latlong_samples, unit
from tests.cli.helpers import write_exr


@pytest.mark.parametrize("size", [10, 21])
def test_balls_are_lit_up_to_their_rim(rng, size):
    """What the disc holds of pixels whose middles are beside it was black."""
    image = rng.uniform(0.5, 1, (size, size, 3)).astype(np.float32)
    probe = Probe.from_array(image, layout="angular")
    fine = fine_probe(probe)
    times, found, used = fine.grid.size // size, fine.image(), fine.grid.used()
    cut, in_disc = (
        each.repeat(times, axis=0).repeat(times, axis=1) for each in (image, probe.grid.used())
    )
    assert times > 1
    assert found[used].min() >= 0.5
    own = used & in_disc
    np.testing.assert_array_equal(found[own], cut[own])
    assert 0.8 < own.sum() / used.sum() < 1


def test_eight_rows_are_areas(rng):
    """Against sums over parts of pixels: their middles alone err by a tenth."""
    image = rng.random((8, 16, 3)).astype(np.float32) ** 4
    parts = image.repeat(32, axis=0).repeat(32, axis=1).reshape(-1, 3)
    directions, areas = latlong_samples(256)
    expected = oracles.real_harmonics(2, directions).T @ (areas[:, None] * parts)
    found = project(Probe.from_array(image), 2).coefficients
    assert np.abs(found - expected).max() < 2e-3 * np.abs(expected[1:]).max()


@pytest.mark.parametrize(
    ("noise", "becomes"),
    [(0.0027, None), (0.0037, "cube"), (0.008, "cube"), (0.0125, "latlong")],
)
def test_light_is_cut_where_a_hundredth_of_it_is_beyond_its_degrees(rng, noise, becomes):
    """In root mean square: of white noise over a smooth sky, told by sums over the pixels.

    Of a third of that it goes on between its pixels, in a cube.
    """
    height, order = 24, 23
    directions, areas = latlong_samples(height)
    smooth = 2 + directions @ rng.normal(0, 0.4, (3, 3))
    rough = rng.normal(size=smooth.shape)
    energy = areas @ (rough**2).sum(axis=1)
    known = oracles.real_harmonics(order, directions).T @ (areas[:, None] * rough)
    scale = np.sqrt(areas @ (smooth**2).sum(axis=1) / abs(energy - np.sum(known**2)))
    image = (smooth + noise * scale * rough).reshape(height, -1, 3).astype(np.float32)
    probe = Probe.from_array(image)
    assert probe.grid.resolved_order == order
    fine = fine_probe(probe)
    assert (None if fine is probe else fine.grid.name) == becomes


def test_a_sky_of_few_rows_has_no_rings():
    """The series of its degrees rang below its horizon, by 4 % RMS in a polished ball."""
    pixels = sky(32, 45, 35, has_disc=False)
    found = prefilter(Probe.from_array(pixels), "ggx:roughness=0.1,f0=1")
    below = unit(np.random.default_rng(1), 4000)
    below = below[below[:, 1] < -0.3]
    seen = found.shaded().rough_radiance(below, below)[:, 0]  # seen from where it is mirrored to
    ground = pixels[-1, 0, 0]
    assert np.sqrt(np.mean((seen / ground - 1) ** 2)) < 0.005
    assert np.abs(seen / ground - 1).max() < 0.02


@pytest.fixture
def of_two(tmp_path):
    """A light file of a coarse noise with a negative pixel, and of a finer one; and its parts."""
    rng = np.random.default_rng(3)
    coarse = rng.random((16, 32, 3), np.float32) ** 8
    coarse[3, 4, 1] = -1
    write_exr(tmp_path / "coarse.exr", coarse)
    write_exr(tmp_path / "fine.exr", rng.random((140, 280, 3), np.float32))
    lights = '[[probe]]\nfile = "coarse.exr"\nscale = 3\n[[probe]]\nfile = "fine.exr"\nyaw = 90\n'
    (tmp_path / "both.toml").write_text(lights)
    parts = open_probe(tmp_path / "coarse.exr"), open_probe(tmp_path / "fine.exr", yaw=90)
    return open_probe(tmp_path / "both.toml"), *parts


def test_probes_of_a_sum_are_cut(of_two):
    """Degrees that a coarse probe does not tell passed for darkness, as a finer one beside it had
    them: principal maps of a sky of 64 rows and soft boxes of 256 had 77 % of wrong pixels."""
    both, coarse, fine = of_two
    found = fine_probe(both)
    assert both.may_be_coarse
    assert (found.digest(), fine_probe(found)) == (both.digest(), found)
    lighting = project(found, 170)
    assert lighting.resolved_order == 170
    alone = 3 * project(fine_probe(coarse), 60).coefficients + project(fine, 60).coefficients
    np.testing.assert_allclose(lighting.coefficients[: 61**2], alone, atol=5e-3)
    lines = [line for line in found.report.warnings() if "negative" in line]
    assert len(lines) == 1
    assert "coarse.exr" in lines[0]


def test_a_level_of_a_sum_is_the_sum_of_levels(of_two):
    both, coarse, fine = of_two
    levels = [make_levels(each, [0.2], 32, sizes=[32])[0][0] for each in (both, coarse, fine)]
    np.testing.assert_allclose(levels[0], 3 * levels[1] + levels[2], rtol=2e-2)
