"""Plain OpenEXR files are read as OpenImageIO reads them, and all others are left to it."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe import reader
from shrm_cli.probe.image_file import ImageFile
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.reader import PlainExr
from tests.probe import scenes

HEIGHT, WIDTH = 24, 48
SRGB = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
TOLD = ("PixelAspectRatio", "Orientation", "shrm:layout", "chromaticities", "Software", "none")


@pytest.fixture
def image(rng):
    return rng.uniform(0.01, 20, (HEIGHT, WIDTH, 4)).astype(np.float32)


def write(path, image, dtype=np.float32, names="RGB", **header):
    planes = {name: image[..., k] for k, name in enumerate(names)}
    return scenes.write_exr(path, planes, dtype, **header)


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIP", "PIZ", "B44", "DWAA", "DWAB", "PXR24"])
@pytest.mark.parametrize("dtype", [np.float16, np.float32])
@pytest.mark.parametrize("names", ["RGB", "RGBA"])
def test_pixels_are_those_of_openimageio(tmp_path, image, compression, dtype, names):
    kind = getattr(OpenEXR, f"{compression}_COMPRESSION")
    path = write(tmp_path / "a.exr", image, dtype, names, compression=kind)
    source = oiio.ImageInput.open(str(path))
    expected = source.read_image(0, 0, 0, len(names), oiio.FLOAT)
    plain = PlainExr.open(path)
    rows = [(0, 5), (5, HEIGHT), (3, 9)]
    for begin, end in rows:
        found = plain.read_scanlines(0, 0, begin, end, 0, 1, len(names), "float")
        np.testing.assert_array_equal(found, expected[begin:end, :, 1:])
        assert plain.is_decoded == (end < HEIGHT)


def test_headers_are_those_of_openimageio(tmp_path, image):
    given = {"chromaticities": SRGB, "pixelAspectRatio": 1.25, "Software": "a camera",
             "Orientation": 1, "shrm:layout": "angular"}  # fmt: skip
    path = write(tmp_path / "a.exr", image, np.float16, "RGBA", **given)
    plain, theirs = PlainExr.open(path).spec(), oiio.ImageInput.open(str(path)).spec()
    for name in TOLD:
        expected = theirs.getattribute(name)
        assert plain.getattribute(name) == expected, name
        for kind in ("string", "int", "float"):
            if expected is None or type(expected).__name__.startswith(kind[:3]):
                ask = f"get_{kind}_attribute"
                assert getattr(plain, ask)(name) == getattr(theirs, ask)(name), name
    for name in ("width", "height", "x", "y", "z", "full_width", "full_height", "full_x", "full_y",
                 "tile_width", "tile_height", "deep", "nchannels"):  # fmt: skip
        assert getattr(plain, name) == getattr(theirs, name), name
    assert list(plain.channelnames) == list(theirs.channelnames)
    assert [plain.channelformat(k) for k in range(4)] == ["half"] * 4


@pytest.mark.parametrize(
    "header",
    [
        {"envmap": OpenEXR.ENVMAP_LATLONG},
        {"expTime": 0.5},
        {"aperture": 4.0},
        {"isoSpeed": 100.0},
        {"name": "beauty"},
        {"view": "left"},
        {"multiView": ["left", "right"]},
        {"dataWindow": (np.array([0, 1], np.int32), np.array([WIDTH - 1, HEIGHT], np.int32))},
        {"displayWindow": (np.array([0, 0], np.int32), np.array([WIDTH, HEIGHT], np.int32))},
    ],
)
def test_what_openimageio_understands_is_left_to_it(tmp_path, image, header):
    plain = write(tmp_path / "plain.exr", image)
    assert PlainExr.open(plain) is not None
    assert PlainExr.open(write(tmp_path / "a.exr", image, **header)) is None


def test_other_kinds_of_files_are_left_to_it(tmp_path, image):
    tiled = scenes.write(tmp_path / "tiled.exr", image[..., :3], "float", 16)
    layers = write(tmp_path / "layers.exr", image, names=("R", "G", "B", "albedo.R"))
    grey = write(tmp_path / "grey.exr", image, names="Y")
    integers = write(tmp_path / "integers.exr", image.astype(np.uint32))
    parts = [OpenEXR.Part({}, {"R": image[..., 0].copy()}) for _ in range(2)]
    with OpenEXR.File(parts) as file:
        file.write(str(tmp_path / "parts.exr"))
    mixed = {"R": image[..., 0].astype(np.float16), "G": image[..., 1].copy(),
             "B": image[..., 2].copy()}  # fmt: skip
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, mixed) as file:
        file.write(str(tmp_path / "mixed.exr"))
    others = [tiled, layers, grey, integers, tmp_path / "parts.exr", tmp_path / "mixed.exr"]
    assert [PlainExr.open(path) for path in others] == [None] * len(others)
    expected = [image[..., 0].astype(np.float16), image[..., 1], image[..., 2]]
    found = ImageFile.open(tmp_path / "mixed.exr").read(0, HEIGHT)
    np.testing.assert_array_equal(np.moveaxis(found, -1, 0), expected)


def test_large_files_are_read_by_rows(tmp_path):
    for rows, is_plain in ((1024, True), (1025, False)):
        path = write(tmp_path / f"{rows}.exr", np.zeros((rows, 4096, 3), np.float16), np.float16)
        assert (PlainExr.open(path) is not None) == is_plain


def test_the_file_has_to_be_there_when_it_is_read(tmp_path, image):
    path = write(tmp_path / "a.exr", image)
    file = ImageFile.open(path)
    np.testing.assert_array_equal(file.read(0, 4), image[:4, :, :3])
    write(path, image[:-1])
    np.testing.assert_array_equal(file.read(4, HEIGHT), image[4:, :, :3])  # it was decoded before
    with pytest.raises(ProbeError, match="not the image that it was; open it again"):
        file.read(0, 4)
    path.unlink()
    with pytest.raises(ProbeError, match="no such file"):
        file.read(0, 4)


def test_a_file_that_changes_as_it_is_decoded_is_damaged(tmp_path, image):
    plain = PlainExr.open(write(tmp_path / "a.exr", image))
    write(tmp_path / "a.exr", image[:-1])
    assert plain.read_scanlines(0, 0, 0, 4, 0, 0, 3, "float") is None


def test_damage_is_told_by_us_alone(tmp_path, image, capfd):
    path = write(tmp_path / "a.exr", image, np.float16)
    data = bytearray(path.read_bytes())
    data[-400:-390] = bytes(10)
    path.write_bytes(data)
    with pytest.raises(ProbeError, match="damaged or truncated"):
        open_probe(path).image()
    assert capfd.readouterr() == ("", "")


def test_a_plain_run_does_not_load_openimageio(tmp_path, image):
    """It would take a tenth of the run."""
    program = (
        "import sys; from shrm_cli.probe.open import open_probe; open_probe(sys.argv[1]).image(); "
        "print('OpenImageIO' in sys.modules)"
    )
    plain = write(tmp_path / "plain.exr", image)
    other = scenes.write(tmp_path / "tiled.exr", image[..., :3], "float", 16)
    environment = os.environ | {"PYTHONPATH": str(Path(reader.__file__).parents[2])}
    said = [
        subprocess.run(
            [sys.executable, "-c", program, str(path)], env=environment, capture_output=True,
            text=True, check=True,
        ).stdout.strip()
        for path in (plain, other)
    ]  # fmt: skip
    assert said == ["False", "True"]
