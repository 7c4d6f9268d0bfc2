"""Pictures on disk: values, bytes, and what happens when they cannot be written."""

import subprocess
import sys
import time

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.errors import OutputError
from shrm_cli.files.image import file_type, write_picture
from shrm_cli.files.png import encode_srgb, png_bytes
from shrm_cli.render.camera import whole_coverage
from shrm_cli.render.image import expose, exposure_advice, shown_at, suitable_exposure


def read(path):
    image = oiio.ImageBuf(str(path))
    assert not image.has_error
    return image.get_pixels(image.spec().format)


def colours(shape=(20, 30, 3), low=-0.2, high=1.3):
    return np.random.default_rng(2).uniform(low, high, shape).astype(np.float32)


@pytest.mark.parametrize(
    ("linear", "code"),
    # Worked by hand from IEC 61966-2-1.
    [(0, 0), (0.001, 3), (0.0031308, 10), (0.18, 118), (0.5, 188), (0.99, 254), (1, 255)],
)
def test_srgb_of_known_values(linear, code):
    assert encode_srgb(np.float32(linear)) == code


def test_srgb_clips_and_rounds():
    assert encode_srgb([-1, -1e-9, 1.5, np.inf]).tolist() == [0, 0, 255, 255]
    encoded = np.arange(256) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    assert encode_srgb(linear).tolist() == list(range(256))


def test_exposure_is_in_stops():
    np.testing.assert_array_equal(expose([1, -2, 3], 0), np.float32([1, -2, 3]))
    np.testing.assert_array_equal(expose([1, -2, 3], 3), np.float32([8, -16, 24]))
    np.testing.assert_array_equal(expose([1, -2, 3], -1), np.float32([0.5, -1, 1.5]))
    assert expose(np.float32(3e38), 5) == np.inf


def test_exposures_bring_the_upper_quartile_to_two_fifths():
    values = 0.4 * 2.0 ** np.array([-3.0, -3, -3, 2, 9])
    assert suitable_exposure(values) == -2  # three of five are darker
    assert suitable_exposure(values, [1, 1, 10, 1, 1]) == 3  # by their areas nearly all are
    assert suitable_exposure(np.append(values, np.nan)) == -2
    assert suitable_exposure([0.31]) == 0.25
    assert suitable_exposure(np.zeros(4)) == suitable_exposure([np.nan]) == 0
    assert suitable_exposure([1e-30]) == 30


@pytest.mark.parametrize("shape", [(1, 1, 3), (9, 7, 3), (5, 16, 4)])
def test_pngs_of_pages_are_read_by_others(tmp_path, rng, shape):
    pixels = rng.integers(0, 256, shape, dtype=np.uint8)
    pixels[shape[0] // 2 :] = pixels[:1]  # rows alike take another filter
    if shape[-1] == 4:
        pixels[..., 3] = 255  # OpenImageIO multiplies by the coverage
    (tmp_path / "a.png").write_bytes(png_bytes(pixels))
    np.testing.assert_array_equal(read(tmp_path / "a.png"), pixels)


def test_png_holds_the_srgb_of_the_picture(tmp_path):
    linear = colours((300, 40, 3))
    assert write_picture(tmp_path / "a.png", linear) == "8-bit sRGB"
    stored = read(tmp_path / "a.png")
    assert stored.dtype == np.uint8
    clipped = np.clip(linear.astype(float), 0, 1)
    expected = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    assert np.abs(stored / 255 - expected).max() <= 0.5 / 255 + 1e-6
    spec = oiio.ImageInput.open(str(tmp_path / "a.png")).spec()
    assert "srgb" in spec.get_string_attribute("oiio:ColorSpace").lower()
    assert not spec.get_string_attribute("DateTime")


@pytest.mark.parametrize("precision", ["half", "float"])
def test_exr_holds_the_linear_picture(tmp_path, precision):
    linear = 1000 * colours()
    recipe = {"shrm:recipe": "{}"}
    assert write_picture(tmp_path / "a.exr", linear, precision, recipe) == precision
    stored = read(tmp_path / "a.exr")
    rounding = 2.0**-11 if precision == "half" else 0
    np.testing.assert_allclose(stored, linear, rtol=rounding)
    spec = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec()
    assert spec.channelnames == ("R", "G", "B")
    assert spec.get_string_attribute("shrm:recipe") == "{}"


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "exr"])
def test_two_writes_give_the_same_bytes(tmp_path, suffix):
    first, second = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    write_picture(first, colours())
    time.sleep(1.1)  # PNG and EXR keep time in seconds
    write_picture(second, colours())
    assert first.read_bytes() == second.read_bytes()


def test_suffix_chooses_the_type():
    assert file_type("a.b.PNG") == "png"
    assert file_type("folder.png/a.Exr") == "exr"
    for name in ("a.jpg", "a", "png", "a.png.tif", ".png"):
        with pytest.raises(OutputError, match=r"\.png or \.exr"):
            file_type(name)


def test_upper_case_suffix_is_written(tmp_path):
    write_picture(tmp_path / "A.PNG", colours())
    assert read(tmp_path / "A.PNG").shape == (20, 30, 3)


@pytest.mark.parametrize("suffix", ["png", "exr"])
def test_values_that_are_no_numbers_are_refused(tmp_path, suffix):
    linear = colours()
    linear[3, 4, 1] = np.nan
    with pytest.raises(OutputError, match="not"):
        write_picture(tmp_path / f"a.{suffix}", linear)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", ["png", "exr"])
def test_missing_folder(tmp_path, suffix):
    with pytest.raises(OutputError, match="there is no folder") as caught:
        write_picture(tmp_path / "no" / f"a.{suffix}", colours())
    assert "\n" not in str(caught.value)
    assert ".shrm-" not in str(caught.value)


# Python 3.11 would keep compiled modules that are cut off.
FILL_DISK = """
import resource, sys
sys.dont_write_bytecode = True
import numpy as np
from shrm_cli.errors import OutputError
from shrm_cli.files.image import write_picture
path, limit, width = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
picture = np.random.default_rng(1).random((width, width, 3)).astype(np.float32)
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
try:
    write_picture(path, picture)
except OutputError as error:
    print(error)
"""


@pytest.mark.parametrize("suffix", ["png", "exr"])
# Within the first block, after some blocks, and in the last block, which is written by closing.
@pytest.mark.parametrize(("limit", "width"), [(50, 16), (2000, 300), (100_000, 300), (3900, 36)])
def test_full_disk_leaves_the_old_file(tmp_path, suffix, limit, width):
    path = tmp_path / f"picture.{suffix}"
    path.write_text("old")
    command = [sys.executable, "-c", FILL_DISK, str(path), str(limit), str(width)]
    result = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert result.stdout.startswith(f"{path}: cannot be written (")
    assert result.stdout.count("\n") == 1
    assert result.stderr == ""
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_the_rim_of_a_small_ball_does_not_count_as_seen():
    """Pixels that it covers in part are dim; a tenth of the ball that can be seen is a picture."""
    ball = 1.01 * np.repeat(whole_coverage(64)[..., None], 3, axis=-1)
    (line,) = exposure_advice("a.png", ball, 0)
    assert "all but white" in line
    ball[:20] *= 0.5
    assert exposure_advice("a.png", ball, 0) == []


def test_a_picture_that_shows_nothing_says_which_exposure_would():
    ball = np.linspace(0.2, 0.8, 60, dtype=np.float32).reshape(4, 5, 3)
    ball[0] = 0  # beside the sphere
    assert exposure_advice("a.png", ball, 0) == []
    for stops in (-12, 9):
        (line,) = exposure_advice("a.png", expose(ball, stops), 1.5)
        assert ("black" if stops < 0 else "white") in line
        better = float(line.split("`exposure` ")[1].split()[0])
        assert exposure_advice("a.png", expose(ball, stops + better - 1.5), better) == []
        assert exposure_advice("a.exr", expose(ball, stops), 1.5) == []
    assert exposure_advice("a.png", np.zeros((4, 4, 3)), 0) == []
    (line,) = exposure_advice("sheet.png", expose(ball, 9), 0, "b.shrm")
    assert line.startswith("sheet.png, b.shrm: all but white")
    # No --exposure is as large, and one of 30 left it black.
    for dim, stops in ((1e-12 * ball, 0), (expose(ball, -12), 26)):
        (line,) = exposure_advice("a.png", dim, stops)
        assert line.endswith("; it is beyond what exposures show")


@pytest.mark.parametrize("stops", [-14, -9, 2, 9])
def test_the_default_exposure_shows_what_would_be_white_or_black(stops):
    ball = np.linspace(0.2, 0.8, 60, dtype=np.float32).reshape(4, 5, 3)
    ball[0] = 0
    other = np.zeros((2, 2, 3), np.float32)  # it shows nothing at any exposure
    assert shown_at("a.png", ball) == shown_at("a.png", other) == 0
    drawn = expose(ball, stops)
    found = shown_at("a.png", drawn, other)
    assert found == suitable_exposure(drawn[1:])
    assert 0.3 < np.quantile(expose(drawn[1:], found), 0.75) < 0.5
    assert shown_at("a.exr", drawn) == 0


@pytest.mark.parametrize(("share", "is_black"), [(0.002, True), (0.01, False)])
def test_lamps_in_a_black_mirror_are_no_black_picture(share, is_black):
    values = np.full((10_000, 3), 1e-5)
    values[: int(share * len(values))] = 0.5
    assert (shown_at("a.png", values) > 5) == is_black
    assert bool(exposure_advice("a.png", values, 0)) == is_black


def test_one_white_view_among_others_makes_all_darker_and_none_brighter():
    """Of three views of a ball in a studio two were white, though half of all that was lit was not.

    Where the others are dim, an exposure for all of them would make the white one whiter.
    """
    white, grey = np.full((4, 5, 3), 3.0), np.full((5, 6, 3), 0.8)
    assert shown_at("a.png", white, grey) == suitable_exposure([3.0] * 20 + [0.8] * 30) < 0
    assert shown_at("a.png", np.concatenate([white.reshape(-1, 3), grey.reshape(-1, 3)])) == 0
    assert shown_at("a.png", white, *[grey / 8] * 3) == 0


def test_the_default_exposure_is_none_where_half_of_a_picture_can_be_seen():
    values = np.full((10, 1, 3), 7.0)
    values[:6] = 0.9
    assert shown_at("a.png", values) == 0
    values[:6] = [[[0.9]], [[0.9]], [[0.9]], [[0.9]], [[7.0]], [[7.0]]]
    assert shown_at("a.png", values) < 0
    assert exposure_advice("a.png", values, 0) == []
    # No exposure shows what is as dim as this.
    assert shown_at("a.png", np.full((4, 3), 1e-30)) == 0
