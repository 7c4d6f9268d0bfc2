"""Large probes that are averaged down while they are read."""

import numpy as np
import pytest

from shrm_cli.probe import pixels, resample
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import coarse_probe, to_layout
from shrm_cli.render.camera import Viewer, background_directions, background_rows
from tests.probe import scenes


@pytest.fixture(autouse=True)
def _everything_is_large(monkeypatch):
    monkeypatch.setattr(resample, "LEAST_ROWS", 2)


def solid_angles(height):
    """Solid angle of a pixel in each row of a lat-long, as the zones between parallels have it."""
    parallels = np.cos(np.linspace(0, np.pi, height + 1))
    return 2 * np.pi * (parallels[:-1] - parallels[1:]) / (2 * height)


@pytest.mark.parametrize("count", [2, 3, 6])
@pytest.mark.parametrize("pixels_at_once", [1, 5 * 48, 2**20])
def test_pixels_are_means_by_solid_angle(tmp_path, monkeypatch, rng, count, pixels_at_once):
    """However the image is cut into blocks."""
    monkeypatch.setattr(pixels, "_BLOCK_PIXELS", pixels_at_once)
    image = rng.lognormal(0, 3, (24, 48, 3)).astype(np.float32)
    probe = open_probe(scenes.write(tmp_path / "a.exr", image))
    found = coarse_probe(probe, 24 // count).image()
    assert found.shape == (24 // count, 48 // count, 3)
    weight = np.broadcast_to(solid_angles(24)[:, None, None], image.shape)
    for row in range(24 // count):
        for column in range(48 // count):
            cell = np.s_[row * count : (row + 1) * count, column * count : (column + 1) * count]
            mean = (image[cell] * weight[cell]).sum(axis=(0, 1)) / weight[cell].sum(axis=(0, 1))
            np.testing.assert_allclose(found[row, column], mean, rtol=1e-5)


@pytest.mark.parametrize(("rows", "expected"), [(24, 24), (13, 24), (12, 12), (7, 8), (1, 2)])
def test_never_coarser_than_asked_for(rows, expected):
    probe = Probe.from_array(np.ones((24, 48, 3)))
    assert coarse_probe(probe, rows).height == expected


@pytest.mark.parametrize(
    ("shape", "options"), [((96, 16), {}), ((25, 50), {"sampling": "border"}), ((23, 46), {})]
)
def test_grids_that_cannot_be_joined_stay(shape, options):
    probe = Probe.from_array(np.ones((*shape, 3)), **options)
    assert coarse_probe(probe, 2) is probe


def test_small_probes_stay(monkeypatch):
    monkeypatch.undo()
    probe = Probe.from_array(np.ones((24, 48, 3)))
    assert coarse_probe(probe, 2) is probe


def test_pixels_are_mended_once(rng):
    """Clamping and filling come before the means, and stand in the first probe's report."""
    image = rng.uniform(0, 1, (24, 48, 3))
    image[3, 5], image[20, 30] = 1000, np.nan
    probe = Probe.from_array(image, clamp=2, fix_nonfinite=True)
    found = coarse_probe(probe, 12)
    assert probe.report.clamped == 1
    assert probe.report.nonfinite == 1
    assert found.image().max() < 2
    assert found.report.clamped == 0


@pytest.mark.parametrize("layout", ["latlong", "openexr", "angular"])
def test_light_keeps_its_energy_and_place_on_other_grids(layout):
    """A sun in one pixel and a smooth sky, turned."""
    image = np.ones((96, 192, 3))
    image[30, 100] = 1e5
    probe = Probe.from_array(image, yaw=20, up="z")
    assert coarse_probe(probe, 16).height == 16
    sun = (1e5 - 1) * solid_angles(96)[30]
    found = Probe.from_array(to_layout(probe, layout, size=8), layout)
    places = np.nonzero(np.ones(found.grid.shape))
    areas = found.grid.solid_angles(*places).reshape(found.grid.shape)
    light = (found.image()[..., 0] - 1) * areas
    assert light.sum() == pytest.approx(sun, rel=0.02)
    towards = np.einsum("ij,ijk->k", light, found.grid.directions())
    expected = probe.matrix @ probe.grid.directions()[30, 100]
    apart = np.degrees(np.arccos(towards @ expected / np.linalg.norm(towards)))
    assert apart < 180 / found.grid.resolution / 2  # half a pixel


def test_backgrounds_keep_their_pixels():
    """Neighboring pixels of the picture are never nearer to each other than those of the probe."""
    for size in (64, 501):
        directions = background_directions(Viewer(20, 10), size, 0, size)
        steps = np.linalg.norm(np.diff(directions, axis=1), axis=-1)
        assert np.pi / background_rows(size) <= steps.max() * 1.0001
