"""Letters in every direction, as each engine shows them around the eye: upright, not mirrored."""

from pathlib import Path

import numpy as np
import pytest

from shrm_cli.probe.probe import open_probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.sphere.grid.cube import Cube
from tests.bilinear import look_up
from tests.web import letters

pytestmark = pytest.mark.slow
PACKAGES = {
    "three": ["three"],
    "babylon": ["@babylonjs/core", "@babylonjs/loaders"],
    "filament": ["filament"],
    "gltf-sample-viewer": ["@khronosgroup/gltf-viewer"],
}
CHART = Path(__file__).parents[3] / "shared" / "probes" / "OrientationLatLong.exr"


@pytest.mark.parametrize("name", letters.ENGINES)
def test_text_can_be_read(browser, needs, site, name):
    needs("esbuild", *PACKAGES[name])
    probe = letters.lettered_probe()
    found = letters.seen_around(browser, *site, name, probe)
    for direction in letters.AROUND:
        text = letters.written(direction)
        right = letters.likeness(found[direction], text)
        assert right > 0.95, direction
        for wrong in (text[:, ::-1], text[::-1], text.T):
            assert letters.likeness(found[direction], wrong) < right - 0.1
        for other in set(letters.AROUND) - {direction}:
            assert letters.likeness(found[direction], letters.written(other)) < right - 0.1


@pytest.mark.parametrize("name", letters.ENGINES)
def test_the_orientation_chart_of_openexr(browser, needs, site, name):
    """Its names and axes lie where the directions of the file's own cube have them."""
    if not CHART.is_file():
        pytest.skip(f"{CHART} is not here")
    needs("esbuild", *PACKAGES[name])
    probe = open_probe(CHART)
    cube = np.asarray(to_grid(probe, Cube(256, "center")))
    found = letters.seen_around(browser, *site, name, probe, size=256, pixels=128)
    s = (np.arange(128) + 0.5) / 64 - 1
    column, row = np.meshgrid(s, -s)
    for direction, forward in letters.AROUND.items():
        right = np.cross(forward, [0, 1, 0])
        rays = forward + column[..., None] * right + row[..., None] * np.array([0, 1, 0])
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        want = look_up(cube, rays.reshape(-1, 3)).reshape(128, 128, 3)
        picture = found[direction][..., 0].ravel()
        assert np.corrcoef(picture, want[..., 0].ravel())[0, 1] > 0.9
        assert np.corrcoef(picture, want[:, ::-1, 0].ravel())[0, 1] < 0.6
