"""Exports for CesiumJS, PlayCanvas and <model-viewer>, looked up as their shaders do it."""

import json
import re

import numpy as np
import pytest
from PIL import Image

from tests.brute_force import unit
from tests.export import test_engines as known
from tests.export.readers import read_ktx2
from tests.export.test_engines import assert_levels, exported, filtered, irradiance, light

probe, samples = known.probe, known.samples


def test_cesium(probe, samples, tmp_path, rng):
    exported(probe, "cesium", tmp_path, size=32)
    data = (tmp_path / "sky.ktx2").read_bytes()
    assert int.from_bytes(data[44:48], "little") == 0  # its reader knows no supercompression
    found = read_ktx2(data)
    assert found.header["texels"] == "rgba16f"
    assert_levels(found.mips, [0, 0.5, 1], np.eye(3), samples, rng)
    text = (tmp_path / "sky_sh.js").read_text()
    rows = re.findall(r"new Cartesian3\((.*)\)", text)
    numbers = np.array([json.loads(f"[{row}]") for row in rows])
    for x, y, z in unit(rng, 20):
        terms = [1, y, z, x, y * x, y * z, 3 * z * z - 1, z * x, x * x - y * y]
        wanted = irradiance(samples, np.array([[x, y, z]]))[0] / np.pi
        assert np.dot(terms, numbers) == pytest.approx(wanted, rel=0.03)


@pytest.fixture(scope="module")
def atlas(probe, tmp_path_factory):
    """A picture of half the default size."""
    return atlas_of(probe, tmp_path_factory.mktemp("playcanvas"), 128)


@pytest.fixture(scope="module")
def whole_atlas(probe, tmp_path_factory):
    """One of the default size, whose roughest levels have rows enough."""
    return atlas_of(probe, tmp_path_factory.mktemp("whole"), 256)


def atlas_of(probe, folder, size):
    """Return the picture as the engine's texture unit holds it, row 0 at v = 0."""
    exported(probe, "playcanvas", folder, size=size)
    with Image.open(folder / "sky_envAtlas.png") as image:
        raw = np.asarray(image, dtype=float) / 255
    return (raw[..., :3] * (8 - 7 * raw[..., 3:])) ** 2  # decodeRGBP


def seen_in(atlas, direction, left, top, width, height):
    """The chunks `envAtlas` and `spherical`, with the filter of a texture unit."""
    x, y, z = direction * np.array([-1, 1, 1])
    u = np.arctan2(x, z) / (2 * np.pi) + 0.5
    v = 1 - (np.arcsin(y) / np.pi + 0.5)
    seam, edge = 1 / 512, len(atlas)
    s = (left + seam + u * (width - 2 * seam)) * edge - 0.5
    t = (top + seam + v * (height - 2 * seam)) * edge - 0.5
    column, row = int(np.floor(s)), int(np.floor(t))
    across, along = s - column, t - row
    upper, lower = (
        (1 - across) * atlas[each, column] + across * atlas[each, column + 1]
        for each in (row, row + 1)
    )
    return (1 - along) * upper + along * lower


def rough(level):
    """The chunk's rectangle of a roughness."""
    part = 2.0**-level
    return 0, 1 - part, part, part / 2


@pytest.mark.proof
def test_playcanvas_levels(whole_atlas, samples, rng):
    for level in range(1, 6):
        for direction in unit(rng, 12):
            found = seen_in(whole_atlas, direction, *rough(level))
            wanted = filtered(samples, level / 5, direction)
            assert found == pytest.approx(wanted, rel=0.04), level


@pytest.mark.proof
def test_playcanvas_seams(whole_atlas, samples):
    """At the poles and at the seam of -Z texels of both sides are mixed."""
    for direction in ([0, 1, 0], [0, -1, 0], [1e-9, 0, -1], [-1e-9, 0, -1], [0.1, 0.99, -0.1]):
        axis = np.array(direction) / np.linalg.norm(direction)
        for level in (2, 4):
            found = seen_in(whole_atlas, axis, *rough(level))
            assert found == pytest.approx(filtered(samples, level / 5, axis), rel=0.04)


@pytest.mark.parametrize("mip", [0, 2])
def test_playcanvas_shows_the_light_itself(atlas, rng, mip):
    part = 2.0**-mip
    for direction in unit(rng, 50):
        found = seen_in(atlas, direction, 1 - part, 1 - part, part, part / 2)
        assert found == pytest.approx(light(direction[None])[0], rel=0.06)


def test_playcanvas_diffuse(atlas, samples, rng):
    for direction in unit(rng, 20):
        found = seen_in(atlas, direction, 128 / 512, 384 / 512, 64 / 512, 32 / 512)
        wanted = irradiance(samples, direction[None])[0] / np.pi
        assert found == pytest.approx(wanted, rel=0.03)


def test_model_viewer(probe, tmp_path, rng):
    exported(probe, "model-viewer", tmp_path)
    data = (tmp_path / "sky.hdr").read_bytes()
    start = data.index(b"\n", data.index(b"-Y ")) + 1
    pixels = np.frombuffer(data, np.uint8, offset=start).reshape(64, 128, 4).astype(float)
    image = pixels[..., :3] * np.exp2(pixels[..., 3:] - 136)

    def place(x, y, z):
        """`equirectUv` of three.js, whose v is 1 in the picture's first row."""
        u = np.arctan2(z, x) / (2 * np.pi) + 0.5
        return u, 1 - (np.arcsin(y) / np.pi + 0.5)

    known.assert_latlong(image, place, rng)
