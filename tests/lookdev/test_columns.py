"""The maps of a column, beside the truth of a probe with one lamp."""

import numpy as np
import pytest

from shrm_cli.lookdev.sheet import Wanted, make_column
from shrm_cli.maps.lamps.map import LampMap
from shrm_cli.probe.options import ReadOptions
from tests import brushed_ggx
from tests.brute_force import latlong_samples, unit
from tests.cli.helpers import write_exr

SHINY = "ggx:roughness=0.25,f0=1"


@pytest.fixture
def lit(tmp_path):
    """The path of soft light with a lamp of one pixel, and its pixels."""
    image = np.full((128, 256, 3), 0.2, np.float32)
    image[:64] += 0.3
    image[40, 80] = 16000, 12000, 4000
    write_exr(tmp_path / "lamp.exr", image)
    return str(tmp_path / "lamp.exr"), image


def column(path, spec, to="auto", **arguments):
    return make_column(path, ReadOptions(), Wanted([spec], to, arguments, 16, 0.0))


def test_lamps_are_beside_maps_that_cannot_hold_them(rng, lit):
    """They are then right around the lamp's reflection: the sum over all pixels."""
    path, image = lit
    (made,) = column(path, SHINY).cells
    assert isinstance(made, LampMap)
    directions, weights = latlong_samples(128)
    lamp = directions[40 * 256 + 80]
    normals, views = lamp + [0, 0, 1] + 0.3 * unit(rng, 100), np.array([0.0, 0.0, 1.0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    truth = []
    for normal in normals:
        first = np.cross(normal, [1.0, 0.0, 0.0])
        first /= np.linalg.norm(first)
        frame = np.stack([first, np.cross(normal, first), normal])
        values, _ = brushed_ggx.lobe((0.0625, 0.0625), frame, views, directions)
        truth.append((values * weights) @ image.reshape(-1, 3))

    def error(shown):
        return np.linalg.norm(shown.radiance(normals, views) - truth) / np.linalg.norm(truth)

    assert error(made) < 0.02


@pytest.mark.proof
def test_maps_that_hold_lamps_keep_less(lit):
    path, _ = lit
    (made,) = column(path, SHINY).cells
    (alone,) = column(path, SHINY, "principal", error=0.05, seen=0.05).cells
    assert alone.info.predicted_error > 0.05 > 10 * made.info.predicted_error


@pytest.mark.parametrize(
    ("spec", "to"), [("lambertian", "auto"), ("kajiya-kay", "auto"), ("phong", "shrm")]
)
def test_other_maps_have_none(lit, spec, to):
    """What holds the lamp, what discs are not integrated for, and what is asked for."""
    (made,) = column(lit[0], spec, to).cells
    assert not isinstance(made, LampMap | str)
