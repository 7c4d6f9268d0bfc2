"""Probes of pixels in memory: the same as those of files with these pixels."""

import hashlib

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe.image import ArrayImage
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import to_layout
from shrm_cli.reference import Reference
from tests.probe import scenes

CUBES = ("openexr", "strip", "hcross", "vcross")
LAYOUTS = ("latlong", *CUBES, "angular")


def image_of(layout, size=16):
    if layout == "latlong":
        return scenes.latlong(size)
    if layout == "angular":
        return scenes.angular(size)
    return scenes.arrange(scenes.cube_faces(size // 2), layout)


def same_light(found, expected, order=6):
    one, other = project(found, order), project(expected, order)
    np.testing.assert_array_equal(one.coefficients, other.coefficients)
    np.testing.assert_array_equal(one.energy, other.energy)
    assert found.report == expected.report
    assert np.any(one.coefficients)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"sampling": "border"},
        {"yaw": 30, "mirror": True, "up": "z"},
        {"clamp": 1.5},
        {"orientation": "openexr"},
    ],
    ids=str,
)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_same_light_as_of_a_file(tmp_path, layout, options):
    image = image_of(layout)
    path = scenes.write(tmp_path / "a.exr", image)
    found = Probe.from_array(image, layout, **options)
    expected = open_probe(path, layout=layout, **options)
    assert (found.grid, found.layout, found.orientation) == (
        expected.grid, expected.layout, expected.orientation,
    )  # fmt: skip
    same_light(found, expected)
    np.testing.assert_array_equal(found.image(), expected.image())


@pytest.mark.parametrize("layout", [layout for layout in LAYOUTS if layout != "angular"])
def test_the_layout_follows_from_the_shape(layout):
    assert Probe.from_array(image_of(layout)).layout == layout


def test_six_faces_stacked(tmp_path):
    faces = scenes.cube_faces(8, orientation="gl")
    for name, face in zip(scenes.FACES, faces, strict=True):
        scenes.write(tmp_path / f"a_{name}.exr", face)
    found = Probe.from_array(faces.reshape(48, 8, 3), "faces")
    same_light(found, open_probe(tmp_path / "a_%.exr"))
    np.testing.assert_array_equal(to_layout(found, "faces"), faces.reshape(48, 8, 3))


def test_one_channel_serves_as_three(tmp_path):
    image = scenes.latlong(16)[..., 1]
    found = Probe.from_array(image)
    same_light(found, Probe.from_array(np.stack([image] * 3, axis=-1)))
    path = scenes.write(tmp_path / "a.exr", image[..., None])
    light, expected = project(found, 6), project(open_probe(path), 6)
    np.testing.assert_array_equal(light.coefficients, expected.coefficients)
    # The library's one channel lies otherwise in memory, where sums take another order.
    np.testing.assert_allclose(light.energy, expected.energy, rtol=1e-14)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, ">f4"])
def test_floats_of_any_size(dtype):
    image = scenes.latlong(16).astype(dtype)
    same_light(Probe.from_array(image), Probe.from_array(image.astype(np.float32)))
    same_light(Probe.from_array(image.tolist()), Probe.from_array(image))


def test_blocks_of_rows_are_those_of_files(tmp_path, monkeypatch):
    from shrm_cli.probe import pixels

    image = scenes.latlong(16)
    path = scenes.write(tmp_path / "a.exr", image)
    monkeypatch.setattr(pixels, "_BLOCK_PIXELS", 96)
    found = Probe.from_array(image)
    assert len(list(found.blocks())) == 6
    same_light(found, open_probe(path))


def test_the_array_is_copied_and_left_alone(rng):
    image = rng.uniform(-1, 100, (16, 16, 3)).astype(np.float32)
    before = image.copy()
    probe = Probe.from_array(image, "angular", clamp=2.0)
    first = probe.image()
    np.testing.assert_array_equal(image, before)
    probe.image()[...] = 7  # what is given away is not what is kept
    image[...] = 5
    np.testing.assert_array_equal(probe.image(), first)


def test_the_digest_is_of_float32_and_shape():
    image = scenes.latlong(16).astype(np.float64)
    data = image.astype("<f4").tobytes()
    expected = hashlib.sha256(data + b"(16, 32, 3)").hexdigest()
    assert Probe.from_array(image).digest() == expected
    assert Probe.from_array(image[::-1, ::-1][::-1, ::-1]).digest() == expected  # strides
    assert Probe.from_array(image.reshape(96, 16), "openexr").digest() != expected


def test_names_and_attributes():
    image = scenes.latlong(8)
    primaries = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
    probe = Probe.from_array(image, name="night", chromaticities=primaries)
    assert (probe.name, probe.chromaticities, probe.paths) == ("night", primaries, [])
    assert Probe.from_array(image).name == "array"
    with pytest.raises(ProbeError, match="night: `chromaticities` must be 8 numbers"):
        Probe.from_array(image, name="night", chromaticities=(0.3, 0.3))


def test_negative_radiance_is_told():
    image = scenes.latlong(16)
    image[3, 4] = -2
    probe = Probe.from_array(image)
    assert probe.image().min() == 0
    (line,) = probe.report.warnings()
    assert probe.warnings() == [f"{probe.name}: {line}"]
    assert line.startswith("1 pixel with negative radiance")


@pytest.mark.parametrize("layout", ["latlong", "vcross", "angular"])
def test_nonfinite_pixels(layout):
    image = image_of(layout)
    row, column = image.shape[0] // 2, image.shape[1] // 2
    image[row, column] = np.nan
    with pytest.raises(ProbeError, match=rf"^a: 1 pixel .* column {column}, row {row}; give `fix"):
        project(Probe.from_array(image, layout, name="a"), 2)
    probe = Probe.from_array(image, layout, fix_nonfinite=True)
    assert np.isfinite(probe.image()).all()
    assert probe.report.nonfinite == 1


def test_values_that_float32_cannot_hold_are_told():
    image = scenes.latlong(16).astype(float)
    image[2, 3] = 1e200
    with pytest.raises(ProbeError, match=r"too large for 32-bit.* column 3, row 2"):
        Probe.from_array(image)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.ones((8, 16, 4)), r"array: an array of shape \(8, 16, 4\) is no image"),
        (np.ones(8), "no image"),
        (np.ones((0, 0, 3)), "no image"),
        (np.float64(1), "no image"),
        (np.ones((8, 16, 3), np.uint8), "uint8 values are not scene-linear radiance"),
        (np.ones((8, 16, 3), complex), "complex128 values"),
        (np.ones((8, 16), bool), "bool values"),
        (np.ones((8, 8, 3)), "a square image .* give `layout` angular"),
        (np.ones((8, 9, 3)), "9 x 8 is no known layout .* give `layout`"),
    ],
)
def test_arrays_that_are_no_probe(array, message):
    with pytest.raises(ProbeError, match=message):
        Probe.from_array(array)


def test_shapes_that_do_not_suit_the_layout():
    with pytest.raises(ProbeError, match=r"16 x 8 cannot be angular, .* give the `layout`"):
        Probe.from_array(np.ones((8, 16, 3)), "angular")
    with pytest.raises(ProbeError, match="8 x 8 cannot be faces, which is 1 x 6 square faces"):
        Probe.from_array(np.ones((8, 8, 3)), "faces")


def test_reflected_light_of_an_array(tmp_path):
    """The reference takes it as it takes files."""
    from shrm_cli.brdf.spec import parse_spec

    image = scenes.latlong(8)
    path = scenes.write(tmp_path / "a.exr", image)
    normals = np.eye(3)
    brdf = parse_spec("lambertian")
    found, expected = (
        Reference(probe, brdf, dtype=np.float64, exact=True).radiance(normals, normals)
        for probe in (Probe.from_array(image), open_probe(path))
    )
    np.testing.assert_array_equal(found, expected)


def test_rows_of_an_array_are_new():
    image = ArrayImage.copy_of(np.ones((4, 8)), "a")
    rows = image.read(1, 3)
    assert rows.shape == (2, 8, 3)
    rows[...] = 0
    assert image.read(1, 3).min() == 1
