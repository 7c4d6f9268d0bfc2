"""The letters of OpenEXR's own orientation chart read the right way round from every layout."""

import numpy as np
import OpenEXR
import pytest

from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.render.camera import Viewer
from shrm_cli.render.sphere import render_background
from tests import oracles

CUBE = 256


@pytest.fixture(scope="module")
def chart(shared):
    return open_probe(shared / "probes" / "OrientationLatLong.exr")


def nearest(image, directions):
    """Pixels of a border-sampled lat-long, from the words of ImfEnvmap.h."""
    height, width = image.shape[:2]
    latitude = np.arcsin(np.clip(directions[..., 1], -1, 1))
    longitude = np.arctan2(directions[..., 0], directions[..., 2])
    column = (longitude / (-2 * np.pi) + 0.5) * (width - 1)
    row = (latitude / -np.pi + 0.5) * (height - 1)
    return image[np.rint(row).astype(int), np.rint(column).astype(int)]


def write(path, image):
    channels = {c: np.ascontiguousarray(image[..., k], np.float32) for k, c in enumerate("RGB")}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))


def view_of(probe, azimuth, elevation):
    return render_background(probe, Viewer(azimuth, elevation), 96)


@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 0), (90, 0), (200, 35), (0, -90)])
@pytest.mark.parametrize("orientation", ["openexr", "gl"])
def test_letters_from_cubes(chart, shared, tmp_path, azimuth, elevation, orientation):
    channels = OpenEXR.File(
        str(shared / "probes" / "OrientationLatLong.exr"), separate_channels=True
    ).channels()
    image = np.stack([channels[c].pixels.astype(np.float32) for c in "RGB"], axis=-1)
    faces = nearest(image, oracles.cube_texels(CUBE, "center", orientation))
    write(tmp_path / "cube.exr", faces.reshape(6 * CUBE, CUBE, 3))
    cube = open_probe(tmp_path / "cube.exr", ReadOptions(orientation=orientation))
    wanted, found = (view_of(probe, azimuth, elevation) for probe in (chart, cube))
    right = np.abs(found - wanted).mean()
    # Letters are dark on white: the same picture, and neither mirrored nor upside down.
    assert right < 0.35 * np.abs(found[:, ::-1] - wanted).mean()
    assert right < 0.35 * np.abs(found[::-1] - wanted).mean()


def test_the_chart_is_seen_from_inside(chart):
    """Looking along -Z with +Y up: the chart's right end (towards +X) is on the right."""
    picture = view_of(chart, 0, 0)
    direction = np.array([0.3, 0.1, -1.0])
    direction /= np.linalg.norm(direction)
    half = np.tan(np.radians(25))
    column = round((direction[0] / -direction[2] / half + 1) * 48 - 0.5)
    row = round((1 - direction[1] / -direction[2] / half) * 48 - 0.5)
    np.testing.assert_allclose(picture[row, column], chart.radiance(direction), atol=0.1)
