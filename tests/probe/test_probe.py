"""Probes: what a file is taken for, reading in blocks, repairs in file coordinates, memory."""

import hashlib
import os
import subprocess
import sys
import textwrap
import tracemalloc
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe import pixels as reading
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.pixels import PixelPolicy
from shrm_cli.probe.probe import Probe
from tests import oracles
from tests.probe import scenes

NAN, INF = np.nan, np.inf
FIX = ReadOptions(pixels=PixelPolicy(fix_nonfinite=True))


def matrix_by_hand(up="y", mirror=False, yaw=0.0, pitch=0.0, roll=0.0):
    result = np.eye(3)
    if up == "z":  # (x, y, z) -> (x, z, -y)
        result = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]) @ result
    if mirror:
        result = np.diag([-1, 1, 1]) @ result
    for axis, angle in (("z", roll), ("x", pitch), ("y", yaw)):  # in this order
        result = oracles.turn(axis, np.deg2rad(angle)) @ result
    return result


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("yaw", [0, 90, -37.5, 360])
def test_matrix(up, mirror, yaw):
    found = ReadOptions(yaw=yaw, mirror=mirror, up=up).matrix()
    np.testing.assert_allclose(found, matrix_by_hand(up, mirror, yaw), atol=1e-15)


@pytest.mark.parametrize("up", ["y", "z"])
def test_all_turns(up):
    angles = {"mirror": True, "yaw": 70, "pitch": -25, "roll": 110}
    found = ReadOptions(up=up, **angles).matrix()
    np.testing.assert_allclose(found, matrix_by_hand(up, **angles), atol=1e-15)
    pixels = np.ones((4, 8, 3))
    np.testing.assert_array_equal(Probe.from_array(pixels, up=up, **angles).matrix, found)


def test_the_words_of_the_options():
    x, y, z = np.eye(3)
    np.testing.assert_allclose(ReadOptions(yaw=90).matrix() @ z, x, atol=1e-15)
    np.testing.assert_allclose(ReadOptions(pitch=90).matrix() @ y, z, atol=1e-15)
    np.testing.assert_allclose(ReadOptions(roll=90).matrix() @ x, y, atol=1e-15)
    np.testing.assert_array_equal(ReadOptions(mirror=True).matrix() @ x, -x)
    np.testing.assert_array_equal(ReadOptions(up="z").matrix() @ z, y)
    np.testing.assert_array_equal(ReadOptions().matrix(), np.eye(3))


def test_what_a_plain_file_is_taken_for(tmp_path):
    path = scenes.write(tmp_path / "a.exr", scenes.latlong(16))
    probe = open_probe(path)
    assert (probe.grid.name, probe.layout, probe.sampling) == ("latlong", "latlong", "center")
    assert (probe.width, probe.height, probe.name) == (32, 16, str(path))
    assert probe.digest() == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("layout", ["openexr", "strip", "hcross", "vcross"])
def test_what_a_cube_is_taken_for(tmp_path, layout):
    path = scenes.write(tmp_path / "a.exr", scenes.arrange(scenes.cube_faces(8), layout))
    probe = open_probe(path)
    assert (probe.grid.name, probe.layout, probe.sampling) == ("cube", layout, "center")
    assert (probe.width, probe.height) == (8, 48)
    assert probe.orientation == ("openexr" if layout == "openexr" else "gl")


def test_dds_cubes_have_the_orientation_of_graphics(tmp_path):
    """8-bit sRGB of the scene, in GL's table."""
    faces = scenes.cube_faces(32, orientation="gl") / 10
    encoded = np.where(faces <= 0.0031308, 12.92 * faces, 1.055 * faces ** (1 / 2.4) - 0.055)
    path = scenes.write_dds_cube(tmp_path / "a.dds", np.rint(encoded * 255).astype(np.uint8))
    probe = open_probe(path, ReadOptions(linearize=True))
    assert (probe.grid.name, probe.layout, probe.orientation) == ("cube", "openexr", "gl")
    found = 10 * project(probe, 4).coefficients
    assert scenes.error(found, scenes.coefficients(4)) < 2e-3


def test_options_overrule_the_file(tmp_path):
    image = scenes.arrange(scenes.cube_faces(8), "openexr")
    path = scenes.write_exr(tmp_path / "a.exr", scenes.rgb(image), envmap=OpenEXR.ENVMAP_CUBE)
    assert open_probe(path).sampling == "border"
    probe = open_probe(path, ReadOptions(sampling="center", orientation="gl"))
    assert (probe.sampling, probe.orientation) == ("center", "gl")


def test_pixels_of_the_grid(tmp_path):
    """Any cube comes as a stack of OpenEXR's orientation; others as they are."""
    expected = scenes.cube_faces(8).reshape(48, 8, 3)
    faces = scenes.cube_faces(8, orientation="gl")
    path = scenes.write(tmp_path / "a.exr", scenes.arrange(faces, "vcross"))
    np.testing.assert_array_equal(open_probe(path).image(), expected)
    image = scenes.latlong(8)
    path = scenes.write(tmp_path / "b.exr", image)
    np.testing.assert_array_equal(open_probe(path).image(), image)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("layout", ["latlong", "openexr", "angular"])
def test_solid_angles_of_all_blocks(tmp_path, monkeypatch, layout, sampling):
    monkeypatch.setattr(reading, "_BLOCK_PIXELS", 100)
    size = {"latlong": (64, 32), "openexr": (16, 96), "angular": (32, 32)}[layout]
    path = scenes.write(tmp_path / "a.exr", np.ones((size[1], size[0], 3)))
    probe = open_probe(path, ReadOptions(layout=layout, sampling=sampling))
    total = rows = 0
    for start, pixels, weights in probe.blocks():
        assert start == rows
        assert len(weights) == len(pixels)
        rows += len(pixels)
        total += np.broadcast_to(weights, pixels.shape[:2]).sum()
    assert rows == size[1]
    assert total == pytest.approx(4 * np.pi, rel=1e-12)
    assert probe.report.energy == pytest.approx(3 * 4 * np.pi, rel=1e-9)


@pytest.mark.parametrize("rows", [1, 7, 50, 64])
@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("tile", [0, 16])
def test_streaming_changes_nothing(tmp_path, monkeypatch, rng, rows, sampling, tile):
    image = rng.uniform(-0.1, 5, (64, 128, 3))
    path = scenes.write(tmp_path / "a.exr", image, tile=tile)
    options = ReadOptions(sampling=sampling, pixels=PixelPolicy(clamp=4.0))
    whole = open_probe(path, options)
    expected = project(whole, 20)
    monkeypatch.setattr(reading, "_BLOCK_PIXELS", rows * 128)
    probe = open_probe(path, options)
    starts = [start for start, *_ in probe.blocks()]
    assert len(starts) == -(-64 // (rows if not tile else -(-rows // tile) * tile))
    found = project(probe, 20)
    np.testing.assert_allclose(found.coefficients, expected.coefficients, atol=1e-6)
    np.testing.assert_allclose(found.energy, expected.energy, rtol=1e-12)
    assert probe.report.energy == pytest.approx(whole.report.energy, rel=1e-12)
    assert probe.report.energy_removed == pytest.approx(whole.report.energy_removed, rel=1e-9)
    for name in ("negative", "minimum", "clamped"):
        assert getattr(probe.report, name) == getattr(whole.report, name) != 0


def test_reading_again_does_not_count_again(tmp_path):
    image = scenes.latlong(16)
    image[3, 4] = -2
    image[5, 6] = 1e4
    image[7, 8] = NAN
    path = scenes.write(tmp_path / "a.exr", image)
    policy = PixelPolicy(fix_nonfinite=True, clamp=100)
    probe = open_probe(path, ReadOptions(pixels=policy))
    project(probe, 2)
    first = probe.report.warnings()
    assert [line.split()[0] for line in first] == ["1", "1", "1"]
    probe.image()
    project(probe, 2)
    assert probe.report.warnings() == first


# ---------------------------------------------------------------- NaN and infinite pixels


def stacked_faces(tmp_path, image):
    size = image.shape[1]
    for k, name in enumerate(scenes.FACES):
        scenes.write(tmp_path / f"sky_{name}.exr", image[k * size : (k + 1) * size])
    return tmp_path / "sky_%.exr"


@pytest.mark.parametrize("layout", ["latlong", "openexr", "strip", "hcross", "vcross", "angular"])
def test_nonfinite_pixels_are_named_in_file_coordinates(tmp_path, layout):
    if layout == "latlong":
        image = scenes.latlong(16)
    elif layout == "angular":
        image = scenes.angular(16)
    else:
        image = scenes.arrange(scenes.cube_faces(8), layout)
    height, width, _ = image.shape
    row, column = height // 2 - 1, width // 2 - 1  # inside a used cell of each
    image[row, column, 1] = NAN
    image[row, column + 1] = -INF
    path = scenes.write(tmp_path / "a.exr", image)
    message = f"{path}: 2 pixels are NaN or infinite, the first at column {column}, row {row}; "
    for _ in range(2):
        with pytest.raises(ProbeError) as caught:
            project(open_probe(path, ReadOptions(layout=layout)), 2)
        assert str(caught.value).startswith(message)
        assert "\n" not in str(caught.value)
    probe = open_probe(path, ReadOptions(layout=layout, pixels=PixelPolicy(fix_nonfinite=True)))
    assert np.isfinite(probe.image()).all()
    assert probe.report.nonfinite == 2
    assert probe.report.first_nonfinite == (column, row)


def test_every_nonfinite_pixel_of_a_streamed_file_is_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "_BLOCK_PIXELS", 32 * 3)
    image = scenes.latlong(16)
    image[2, 5] = image[9, 0] = image[15, 31] = NAN
    path = scenes.write(tmp_path / "a.exr", image)
    with pytest.raises(ProbeError, match=r"3 pixels .* column 5, row 2;"):
        project(open_probe(path), 2)


def test_nonfinite_pixels_of_one_of_six_faces(tmp_path):
    image = scenes.cube_faces(8).reshape(48, 8, 3)
    image[8 * 3 + 2, 6] = INF
    path = stacked_faces(tmp_path, image)
    with pytest.raises(ProbeError, match=r"sky_-Y\.exr: 1 pixel .* column 6, row 2;"):
        project(open_probe(path), 2)


def test_what_layouts_leave_unused_does_not_matter(tmp_path):
    """Corners of crosses and of angular maps may hold anything."""
    cross = scenes.arrange(scenes.cube_faces(16, orientation="gl"), "hcross")
    ball = scenes.angular(32)
    for layout, image in (("hcross", cross), ("angular", ball)):
        clean = scenes.write(tmp_path / "clean.exr", image)
        expected = project(open_probe(clean, ReadOptions(layout=layout)), 4)
        corner = image.copy()
        assert np.all(corner[:2, :2] == 0)
        corner[:2, :2] = [[NAN], [-1e9]]
        path = scenes.write(tmp_path / "a.exr", corner)
        probe = open_probe(path, ReadOptions(layout=layout))
        found = project(probe, 4)
        np.testing.assert_array_equal(found.coefficients, expected.coefficients)
        assert probe.report.warnings() == []


def test_holes_at_the_rim_of_an_angular_map_are_not_filled_with_black(tmp_path):
    image = np.where(scenes.angular(32) > 0, 5, 0)
    image = image.astype(np.float32)
    inside = image[..., 0] > 0
    expected = image.copy()
    for row in (0, 15, 31):
        column = np.nonzero(inside[row])[0][0]
        image[row, column] = NAN
    path = scenes.write(tmp_path / "a.exr", image)
    options = ReadOptions(layout="angular", pixels=PixelPolicy(fix_nonfinite=True))
    np.testing.assert_array_equal(open_probe(path, options).image(), expected)


def test_holes_of_a_cube_are_filled_within_their_face(tmp_path):
    faces = np.arange(1, 7, dtype=np.float32)[:, None, None, None] * np.ones((6, 8, 8, 3), "f4")
    expected = faces.reshape(48, 8, 3)
    damaged = faces.copy()
    damaged[:, 0, 0] = damaged[:, 7, 3] = damaged[:, 3:6, 5:] = NAN
    path = scenes.write(tmp_path / "a.exr", damaged.reshape(48, 8, 3))
    np.testing.assert_array_equal(open_probe(path, FIX).image(), expected)


def holes(rng, height=96):
    image = rng.uniform(0.1, 5, (height, 2 * height, 3)).astype(np.float32)
    scattered = rng.random(image.shape[:2]) < 0.02
    image[scattered] = rng.choice([NAN, INF, -INF], np.count_nonzero(scattered))[:, None]
    image[10:24, 30:60] = NAN  # over several blocks
    image[40:47, :20] = image[40:47, -9:] = NAN  # over the seam
    image[-5:, 70:90] = NAN
    image[0] = NAN
    return image


@pytest.mark.parametrize("tile", [0, 16])
@pytest.mark.parametrize("rows", [1, 5, 16])
def test_filling_a_streamed_file_is_filling_it_whole(tmp_path, monkeypatch, rng, rows, tile):
    path = scenes.write(tmp_path / "a.exr", holes(rng), tile=tile)
    whole = open_probe(path, FIX)
    expected = whole.image()
    assert np.isfinite(expected).all()
    monkeypatch.setattr(reading, "_BLOCK_PIXELS", rows * 192)
    probe = open_probe(path, FIX)
    np.testing.assert_array_equal(probe.image(), expected)
    assert probe.report.nonfinite == whole.report.nonfinite
    assert probe.report.first_nonfinite == whole.report.first_nonfinite == (0, 0)


def test_holes_deeper_than_what_is_read_around_a_block(tmp_path, monkeypatch, rng):
    """More is read, until the deepest pixel of the block has all that it depends on."""
    image = rng.uniform(0.1, 5, (64, 128, 3)).astype(np.float32)
    image[3:58] = NAN
    image[20:40, :4] = 7.0  # nearer by rows than the rim, but farther by columns
    path = scenes.write(tmp_path / "a.exr", image)
    expected = open_probe(path, FIX).image()
    monkeypatch.setattr(reading, "_BLOCK_PIXELS", 4 * 128)
    monkeypatch.setattr(reading, "_HOLE_ROWS", 2)
    np.testing.assert_array_equal(open_probe(path, FIX).image(), expected)


@pytest.mark.parametrize("layout", ["latlong", "openexr", "angular"])
def test_nothing_finite(tmp_path, layout):
    size = {"latlong": (32, 16), "openexr": (8, 48), "angular": (16, 16)}[layout]
    path = scenes.write(tmp_path / "a.exr", np.full((size[1], size[0], 3), NAN))
    options = ReadOptions(layout=layout, pixels=PixelPolicy(fix_nonfinite=True))
    with pytest.raises(ProbeError, match=r"a\.exr: nothing is finite"):
        project(open_probe(path, options), 2)


# ---------------------------------------------------------------- other repairs


def test_negative_radiance(tmp_path):
    image = scenes.latlong(32)
    expected = project(open_probe(scenes.write(tmp_path / "a.exr", image)), 4)
    image[::7, ::5] *= -3
    count = np.count_nonzero(image[..., 0] < 0)
    probe = open_probe(scenes.write(tmp_path / "b.exr", image))
    found = project(probe, 4)
    assert np.all(found.energy < expected.energy)
    assert probe.report.negative == count
    assert probe.report.minimum == image.min()
    assert probe.image().min() == 0


def test_clamping_reports_the_energy_on_the_sphere(tmp_path):
    """A bright band near the pole weighs less than its share of the pixels."""
    image = np.full((64, 128, 3), 0.5, np.float32)
    image[4:16] = (100, 50, 25)
    path = scenes.write(tmp_path / "a.exr", image)
    probe = open_probe(path, ReadOptions(pixels=PixelPolicy(clamp=2.0)))
    found = project(probe, 0)
    np.testing.assert_allclose(probe.image()[4], np.tile([2, 1, 0.5], (128, 1)), rtol=1e-6)
    edges = np.cos(np.pi * np.arange(65) / 64)
    patch = 2 * np.pi * (edges[4] - edges[16])
    total = 3 * 0.5 * (4 * np.pi - patch) + 175 * patch
    assert probe.report.energy == pytest.approx(total, rel=1e-3)
    assert probe.report.energy_removed == pytest.approx(171.5 * patch, rel=2e-3)
    left = found.coefficients[0].sum() * np.sqrt(4 * np.pi)
    assert left == pytest.approx(probe.report.energy - probe.report.energy_removed, rel=1e-6)


def test_black(tmp_path):
    probe = open_probe(scenes.write(tmp_path / "a.exr", np.zeros((8, 16, 3))))
    assert np.all(project(probe, 3).coefficients == 0)
    assert probe.report.warnings() == ["the probe is black"]


def test_alpha_changes_nothing(tmp_path):
    image = scenes.latlong(16)
    expected = project(open_probe(scenes.write(tmp_path / "a.exr", image)), 4)
    planes = scenes.rgb(image) | {"A": 0 * image[..., 0]}
    found = project(open_probe(scenes.write_exr(tmp_path / "b.exr", planes)), 4)
    np.testing.assert_array_equal(found.coefficients, expected.coefficients)


# ---------------------------------------------------------------- looking up directions


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("layout", ["latlong", "openexr", "angular"])
def test_radiance_in_world_directions(tmp_path, rng, layout, sampling):
    matrix = matrix_by_hand("z", True, 40)
    f = lambda directions: scenes.radiance(directions @ matrix.T)  # noqa: E731
    image = {
        "latlong": scenes.latlong(128, sampling, f),
        "openexr": scenes.arrange(scenes.cube_faces(64, sampling, f=f), "openexr"),
        "angular": scenes.angular(256, sampling, f),
    }[layout]
    path = scenes.write(tmp_path / "a.exr", image)
    options = ReadOptions(layout=layout, sampling=sampling, up="z", mirror=True, yaw=40)
    directions = oracles.random_directions(rng, 40, 50)
    found = open_probe(path, options).radiance(directions)
    assert found.shape == (40, 50, 3)
    np.testing.assert_allclose(found, scenes.radiance(directions), rtol=0.02)


def test_radiance_is_never_negative(tmp_path, rng):
    """A cubic filter overshoots beside a bright texel."""
    image = np.zeros((48, 8, 3))
    image[20, 4] = 1000
    path = scenes.write(tmp_path / "a.exr", image)
    assert open_probe(path).radiance(oracles.random_directions(rng, 20000)).min() == 0


# ---------------------------------------------------------------- six files, memory


def test_six_files_and_their_digest(tmp_path):
    path = stacked_faces(tmp_path, scenes.cube_faces(8).reshape(48, 8, 3))
    probe = open_probe(path)
    assert (probe.grid.name, probe.layout, probe.width, probe.height) == ("cube", "faces", 8, 48)
    data = b"".join((tmp_path / f"sky_{face}.exr").read_bytes() for face in scenes.FACES)
    assert probe.digest() == hashlib.sha256(data).hexdigest()


def test_a_file_with_a_percent_sign_of_its_own(tmp_path):
    path = scenes.write(tmp_path / "50%.exr", scenes.latlong(8))
    assert open_probe(path).layout == "latlong"


MAKE = """
    import sys
    import numpy as np, OpenImageIO as oiio
    path, tile, envmap = sys.argv[1], int(sys.argv[2]), sys.argv[3]
    spec = oiio.ImageSpec(8192, 4096, 3, oiio.HALF)
    spec.tile_width = spec.tile_height = tile
    spec.attribute("compression", "rle")
    if envmap:
        spec.attribute("textureformat", envmap)
    output = oiio.ImageOutput.create(path)
    assert output.open(path, spec)
    across = np.cos(np.linspace(-np.pi, np.pi, 8192))[None, :, None] + np.array([1, 2, 3])
    across = np.rint(across * 64) / 64
    for start in range(0, 4096, 128):
        down = 1 + np.arange(start, start + 128)[:, None, None] // 256
        block = np.ascontiguousarray(across * down, np.float16)
        if tile:
            output.write_tiles(0, 8192, start, start + 128, 0, 1, block)
        else:
            output.write_scanlines(start, start + 128, 0, block)
    output.close()
    del output
"""

MEASURE = """
    import sys
    from shrm_cli.probe.lighting import project
    from shrm_cli.probe.open import open_probe
    probe = open_probe(sys.argv[1])
    lighting = project(probe, 64)
    print(probe.sampling, probe.width, probe.height)
    print(*lighting.coefficients[:4].ravel())
    # Not ru_maxrss, which begins with the memory of the process that started this one.
    print(open("/proc/self/status").read().split("VmHWM:")[1].split()[0])
"""


def in_a_process(program, *arguments):
    root = Path(__file__).resolve().parents[2]
    result = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program), *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""
    return result.stdout.splitlines()


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peak memory: needs /proc")
@pytest.mark.parametrize(
    ("tile", "envmap"),
    [
        (0, ""),
        pytest.param(64, "", marks=pytest.mark.proof),
        pytest.param(0, "LatLong Environment", marks=pytest.mark.proof),
    ],
    ids=str,
)
def test_memory_of_a_large_probe(tmp_path, tile, envmap):
    """8192 x 4096 half: 200 MB as it is, 400 MB as float32."""
    path = tmp_path / "large.exr"
    try:
        in_a_process(MAKE, path, tile, envmap)
        described, numbers, kilobytes = in_a_process(MEASURE, path)
    finally:
        path.unlink(missing_ok=True)
    sampling = "border" if envmap else "center"
    assert described == f"{sampling} 8192 4096"
    # The mean over rows, of 1 + row // 256 times the weight of the row, is 8.5 by symmetry.
    mean = np.array([1, 2, 3]) * 8.5 * np.sqrt(4 * np.pi)
    np.testing.assert_allclose(np.array(numbers.split(), float)[:3], mean, rtol=5e-3)
    assert 20e3 < float(kilobytes) < 400e3


def test_an_image_takes_its_own_memory_once(monkeypatch, rng):
    """Blocks of rows are written into it one after the other, not joined at the end."""
    monkeypatch.setattr(reading, "_BLOCK_PIXELS", 2**14)
    pixels = rng.random((512, 1024, 3), dtype=np.float32)
    probe = Probe.from_array(pixels, "latlong")
    tracemalloc.start()
    try:
        found = probe.image()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    np.testing.assert_array_equal(found, pixels)
    assert peak < 1.3 * pixels.nbytes


def test_pixels_that_are_not_finite_are_refused_in_whole_images():
    """Also where the image is one block, after which nobody asks for more."""
    image = np.ones((8, 16, 3))
    image[2, 3, 1] = np.nan
    with pytest.raises(ProbeError, match=r"1 pixel is NaN or infinite, .* column 3, row 2"):
        Probe.from_array(image, "latlong").image()
