"""Letters in every direction, as each engine shows them around the eye: upright, not mirrored."""

from pathlib import Path

import numpy as np
import pytest

from research.bilinear import look_up
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.sphere.grid.cube import Cube
from tests.web import letters

ROOT = Path(__file__).parents[2]
CHART = ROOT.parent / "shared" / "probes" / "OrientationLatLong.exr"
FILES = [ROOT / "probes" / "studio.exr", *([CHART] if CHART.is_file() else [])]


@pytest.mark.parametrize("name", letters.ENGINES)
def test_text_can_be_read(browser, site, name):
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


@pytest.mark.parametrize("path", FILES, ids=[path.stem for path in FILES])
@pytest.mark.parametrize("name", letters.ENGINES)
def test_what_a_file_shows(browser, site, name, path):
    """It lies where the directions of its own cube have it: OpenEXR's chart, where it is here."""
    probe = open_probe(path)
    cube = np.asarray(to_grid(probe, Cube(256, "center")))
    found = letters.seen_around(browser, *site, name, probe, size=256, pixels=128)
    s = (np.arange(128) + 0.5) / 64 - 1
    column, row = np.meshgrid(s, -s)
    for direction, forward in letters.AROUND.items():
        right = np.cross(forward, [0, 1, 0])
        rays = forward + column[..., None] * right + row[..., None] * np.array([0, 1, 0])
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        want = look_up(cube, rays.reshape(-1, 3)).reshape(128, 128, 3)
        if name == "filament":
            want = np.minimum(want, 1)  # its canvas has 8 bits
        picture = found[direction][..., 0].ravel()
        # <model-viewer> has no mirror: its least roughness blurs the thin lines of the chart.
        least = 0.88 if name == "model-viewer" else 0.9
        assert np.corrcoef(picture, want[..., 0].ravel())[0, 1] > least
        assert np.corrcoef(picture, want[:, ::-1, 0].ravel())[0, 1] < 0.6
