"""Cubes turned for engines: an engine's own lookup of a direction finds the light from there."""

import tracemalloc

import numpy as np
import pytest

from shrm_cli.export.cubes import WORLD, mirrored, to_lookup
from shrm_cli.export.engine import Package
from shrm_cli.export.latlong import add_radiance, rgbe, rolled
from tests.brute_force import latlong_samples, unit
from tests.export.readers import look_up


def openexr_cube(size):
    """Return a cube (6 size, size, 3) whose texels are their own directions (ImfEnvmap.h)."""
    axes = {"X": np.array([1.0, 0, 0]), "Y": np.array([0, 1.0, 0]), "Z": np.array([0, 0, 1.0])}
    table = ["+X+Z-Y", "-X-Z-Y", "+Y+X-Z", "-Y+X+Z", "+Z-X-Y", "-Z+X-Y"]
    rows = []
    for line in table:
        forward, right, down = (
            axes[line[k + 1]] * (1 if line[k] == "+" else -1) for k in (0, 2, 4)
        )
        for row in range(size):
            for column in range(size):
                s, t = (2 * column + 1) / size - 1, (2 * row + 1) / size - 1
                point = forward + s * right + t * down
                rows.append(point / np.linalg.norm(point))
    return np.reshape(rows, (6 * size, size, 3))


@pytest.mark.parametrize(
    "lookup",
    [
        WORLD, mirrored(1, 1, -1), mirrored(-1, 1, 1), np.eye(3)[[0, 2, 1]], np.eye(3)[[1, 2, 0]],
        np.array([[0.0, 0, -1], [0, 1, 0], [-1, 0, 0]]),
    ],
)  # fmt: skip
def test_lookups_find_the_light_of_their_direction(lookup, rng):
    size = 16
    faces = to_lookup(openexr_cube(size), lookup)
    directions = unit(rng, 500)
    found = look_up(faces, directions @ lookup.T)
    # A texel is 2 / size wide at most, seen from the middle.
    assert np.linalg.norm(found - directions, axis=1).max() < 1.5 / size


@pytest.mark.parametrize("degrees", [0, 90, 180, 270])
def test_latlongs_are_turned_about_the_vertical(degrees):
    """The column in the middle looks along the azimuth that was asked for."""
    height = 8
    image = np.asarray(latlong_samples(height)[0]).reshape(height, 2 * height, 3)
    turned = rolled(image, degrees)
    middle = turned[:, height - 1 : height + 1].mean(axis=(0, 1))
    azimuth = np.degrees(np.arctan2(middle[0], middle[2])) % 360
    assert azimuth == pytest.approx(degrees, abs=1e-9)
    # To the left the azimuth rises, as before.
    left = turned[:, height // 2].mean(axis=0)
    assert np.degrees(np.arctan2(left[0], left[2])) % 360 > azimuth


def test_rgbe_is_the_nearest_mantissa(rng):
    image = np.exp(rng.uniform(-8, 11, size=(300, 3)))
    image[3] = 0
    pixels = rgbe(image).astype(float)
    found = pixels[:, :3] * np.exp2(pixels[:, 3:] - 136)
    assert (found[3] == 0).all()
    steps = image.max(axis=1) / 128
    assert (np.abs(found - image) <= steps[:, None] / 2 + 1e-12).all()


def test_radiance_files_take_little_memory_beside_their_pixels(tmp_path, rng):
    """They are encoded some rows at a time, which changes nothing."""
    image = rng.uniform(0, 9, size=(512, 1024, 3)).astype(np.float32)
    made = Package()
    tracemalloc.start()
    add_radiance(made, "a.hdr", image)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5 * image.nbytes  # it was 11 times
    made.files[0].write(tmp_path / "a.hdr")
    assert (tmp_path / "a.hdr").read_bytes().endswith(b"-Y 512 +X 1024\n" + rgbe(image).tobytes())
