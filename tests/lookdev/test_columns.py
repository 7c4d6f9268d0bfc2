"""The maps of a column, beside the truth of a probe with one lamp."""

import numpy as np
import pytest

from shrm_cli.lookdev.columns import Wanted, make_column
from shrm_cli.maps.lamps.map import LampMap
from shrm_cli.probe.options import ReadOptions
from shrm_cli.vocabulary import LUMINANCE
from tests import brushed_ggx
from tests.brute_force import latlong_samples, unit
from tests.cli.helpers import write_exr


@pytest.fixture
def lit(tmp_path):
    """The path of soft light with a lamp of one pixel, and its pixels."""
    image = np.full((64, 128, 3), 0.2, np.float32)
    image[:32] += 0.3
    image[20, 40] = 4000, 3000, 1000
    write_exr(tmp_path / "lamp.exr", image)
    return str(tmp_path / "lamp.exr"), image


def column(path, spec, to="auto", **arguments):
    return make_column(path, ReadOptions(), Wanted([spec], to, arguments, 16, 0.0))


def test_lamps_are_beside_maps_that_cannot_hold_them(rng, lit):
    """Few places differ from the sum over all pixels by over 5 %, where many did without."""
    path, image = lit
    (made,) = column(path, "ggx:roughness=0.3,f0=1").cells
    assert isinstance(made, LampMap)
    light = image.reshape(-1, 3)
    directions, weights = latlong_samples(64)
    normals, view = unit(rng, 400), np.array([0.0, 0.0, 1.0])
    normals = normals[normals[:, 2] > 0.1]
    truth = []
    for normal in normals:
        first = np.cross(normal, [1.0, 0.0, 0.0])
        first /= np.linalg.norm(first)
        frame = np.stack([first, np.cross(normal, first), normal])
        values, _ = brushed_ggx.lobe((0.09, 0.09), frame, view, directions)
        truth.append((values * weights) @ light)

    def wrong(shown):
        missed = np.abs((shown.radiance(normals, view) - truth) @ LUMINANCE)
        return np.average(missed > 0.05 * (truth @ LUMINANCE), weights=normals[:, 2])

    truth = np.array(truth)
    assert wrong(made) < 0.1
    (alone,) = column(path, "ggx:roughness=0.3,f0=1", "principal", error=0.05, seen=0.05).cells
    assert wrong(alone) > 0.2


@pytest.mark.parametrize(
    ("spec", "to"), [("lambertian", "auto"), ("kajiya-kay", "auto"), ("phong", "shrm")]
)
def test_other_maps_have_none(lit, spec, to):
    """What holds the lamp, what discs are not integrated for, and what is asked for."""
    (made,) = column(lit[0], spec, to).cells
    assert not isinstance(made, LampMap | str)
