"""Input that cannot be used: one line each, with the file, what is wrong, and what to do."""

import json
import os
import re
import resource
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe import image_file
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.sphere.grid.cube import Cube
from tests.probe import scenes

RNG_SEED = 5
NOISE = r"EXR_ERR|EXR Error|OpenImageIO|Iex|Imf|TIFF[A-Z]|TIFFRead|libpng|Traceback|0x[0-9a-f]+"


def noise(height=32, width=64, channels=3):
    rng = np.random.default_rng(RNG_SEED)
    return rng.uniform(0, 1, (height, width, channels)).astype(np.float32)


def exr(folder, height=32, width=64, **options):
    return scenes.write(folder / "bad.exr", noise(height, width), **options)


def cut(path, part):
    data = path.read_bytes()
    path.write_bytes(data[: max(int(part * len(data)), 1)] if part < 1 else data[: int(part)])
    return path


def missing(folder):
    return folder / "bad.exr"


def directory(folder):
    (folder / "bad.exr").mkdir()
    return folder / "bad.exr"


def empty(folder):
    (folder / "bad.exr").touch()
    return folder / "bad.exr"


def text(folder):
    (folder / "bad.exr").write_text("This is no image.\n" * 50)
    return folder / "bad.exr"


def png_named_exr(folder):
    path = scenes.write_png(folder / "a.png", np.zeros((32, 64, 3), np.uint8))
    return path.rename(folder / "bad.exr")


def hdr_named_exr(folder):
    return scenes.write_rgbe(folder / "a.hdr", noise()).rename(folder / "bad.exr")


def no_pixels(folder):
    path = exr(folder)
    scenes.patch_exr_windows(path, 0, 0)
    return path


def too_large(folder):
    path = exr(folder)
    scenes.patch_exr_windows(path, 200000, 100000)
    return path


def too_large_tiled(folder):
    path = exr(folder, tile=16)
    scenes.patch_exr_windows(path, 200000, 100000)
    return path


def large_but_not_there(folder):
    """Just below the limit, so only its pixels are missing."""
    path = exr(folder)
    scenes.patch_exr_windows(path, 32768, 16384)
    return path


def large_cube(folder):
    path = exr(folder)
    scenes.patch_exr_windows(path, 8192, 6 * 8192)
    return path


def deep(folder):
    samples = np.empty((32, 64), object)
    for index in np.ndindex(samples.shape):
        samples[index] = np.array([0.5, 0.25], "f4")
    header = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.deepscanline}
    with OpenEXR.File(header, {"R": samples, "G": samples, "B": samples}) as file:
        file.write(str(folder / "bad.exr"))
    return folder / "bad.exr"


def fifo(folder):
    os.mkfifo(folder / "bad.exr")
    return folder / "bad.exr"


def device(folder):
    (folder / "bad.exr").symlink_to("/dev/null")
    return folder / "bad.exr"


def loop(folder):
    (folder / "bad.exr").symlink_to(folder / "bad.exr")
    return folder / "bad.exr"


def long_name(folder):
    return folder / f"bad{300 * 'x'}.exr"


def two_channels(folder):
    return scenes.write_exr(folder / "bad.exr", {"R": noise()[..., 0], "G": noise()[..., 1]})


def cie_xyz(folder):
    planes = dict(zip("XYZ", np.moveaxis(noise(), -1, 0), strict=True))
    return scenes.write_exr(folder / "bad.exr", planes)


def luminance_chroma(folder):
    planes = dict(zip(("Y", "RY", "BY"), np.moveaxis(noise(), -1, 0), strict=True))
    return scenes.write_exr(folder / "bad.exr", planes)


def luminance_chroma_subsampled(folder):
    y, chroma = noise()[..., 0], noise()[::2, ::2, 1]
    path = folder / "bad.exr"
    return scenes.write_raw_exr(path, {"Y": (1, y), "RY": (2, chroma), "BY": (2, chroma)})


def integers(folder):
    planes = {c: np.zeros((32, 64), np.uint32) for c in "RGB"}
    return scenes.write_exr(folder / "bad.exr", planes)


def envmap_cube_of_wrong_shape(folder):
    return scenes.write_exr(folder / "bad.exr", scenes.rgb(noise()), envmap=OpenEXR.ENVMAP_CUBE)


def damaged_png(folder):
    path = scenes.write_png(folder / "bad.png", np.zeros((32, 64, 3), np.uint8))
    data = bytearray(path.read_bytes())
    data[-20] ^= 1
    path.write_bytes(data)
    return path


CASES = {
    "missing": (missing, "no such file; check its name"),
    "directory": (directory, "a directory; name an image"),
    "empty": (empty, "is empty; copy or export"),
    "text": (text, "not an image that can be read"),
    "PNG named .exr": (png_named_exr, r"named \.exr, but it is a png file; rename it"),
    "HDR named .exr": (hdr_named_exr, r"named \.exr, but it is a hdr file; rename it"),
    "EXR cut in the header": (lambda d: cut(exr(d), 100), "copy or export it again"),
    "EXR cut after the magic number": (lambda d: cut(exr(d), 4), "copy or export it again"),
    "EXR cut in the offsets": (lambda d: cut(exr(d), 400), "damaged or truncated; copy"),
    "EXR cut in the pixels": (lambda d: cut(exr(d), 0.5), "damaged or truncated; copy"),
    "EXR cut at the end": (lambda d: cut(exr(d), 0.99), "damaged or truncated; copy"),
    "tiled EXR cut in the pixels": (lambda d: cut(exr(d, tile=16), 0.6), "damaged or truncated"),
    "no pixels": (no_pixels, "the image has no pixels|not an image"),
    "too large": (too_large, "; "),
    "too large and tiled": (too_large_tiled, "; "),
    "large but not there": (large_but_not_there, "damaged or truncated|not an image"),
    "large cube": (large_cube, "more than|not an image"),
    "deep": (deep, "deep image has no single radiance; flatten"),
    "fifo": (fifo, "not a regular file; name an image"),
    "device": (device, "not a regular file; name an image"),
    "link to itself": (loop, "cannot be opened .*; check its name"),
    "name too long": (long_name, "cannot be opened .*; check its name"),
    "square": (lambda d: exr(d, 32, 32), "a square image .* give `layout` angular"),
    "3 : 2": (lambda d: exr(d, 32, 48), "48 x 32 is no known layout .* give `layout`"),
    "odd cube": (lambda d: exr(d, 47, 8), "8 x 47 is no known layout"),
    "envmap cube of wrong shape": (envmap_cube_of_wrong_shape, "64 x 32 cannot be openexr, .*; "),
    "two channels": (two_channels, "no R, G and B .* among R, G; export it as RGB"),
    "CIE XYZ": (cie_xyz, "among X, Y, Z; export it as RGB"),
    "luminance-chroma": (luminance_chroma, "luminance-chroma .*; convert it to RGB"),
    "luminance-chroma, subsampled": (luminance_chroma_subsampled, "[Ss]ubsampled.*; "),
    "integers": (integers, "uint pixels .* give `linearize` .*, or use an HDR file"),
    "PNG of 8 bits": (
        lambda d: scenes.write_png(d / "bad.png", np.zeros((32, 64, 3), np.uint8)),
        "uint8 pixels .* give `linearize`",
    ),
    "PNG cut short": (
        lambda d: cut(scenes.write(d / "bad.png", noise(), "uint8"), 0.5),
        "damaged or truncated; copy",
    ),
    "PNG cut in the header": (
        lambda d: cut(scenes.write(d / "bad.png", noise(), "uint8"), 30),
        "damaged or truncated; copy",
    ),
    "PNG with a wrong bit": (damaged_png, "damaged or truncated; copy"),
    "JPEG cut short": (
        lambda d: cut(scenes.write(d / "bad.jpg", noise(), "uint8"), 0.5),
        "damaged or truncated; copy",
    ),
    "HDR cut short": (
        lambda d: cut(scenes.write_rgbe(d / "bad.hdr", noise()), 0.7),
        "damaged or truncated; copy",
    ),
    "HDR upside down": (
        lambda d: scenes.write_rgbe(d / "bad.hdr", noise(), "+Y 32 +X 64"),
        "Orientation 4.*--reorient",
    ),
    "PFM cut short": (
        lambda d: cut(scenes.write_pfm(d / "bad.pfm", noise()), 0.7),
        "damaged or truncated; copy",
    ),
    "TIFF cut short": (
        lambda d: cut(scenes.write(d / "bad.tif", noise(), compression="zip"), 0.7),
        "damaged or truncated; copy|not an image",
    ),
    "TIFF cut in the header": (
        lambda d: cut(scenes.write(d / "bad.tif", noise(), compression="zip"), 200),
        "copy or export it again",
    ),
}
LINEARIZED = ("PNG cut", "PNG with", "JPEG")


def check_message(error, path, message):
    line = str(error)
    assert "\n" not in line
    assert line.startswith(f"{path}: ")
    assert line.count(str(path)) == 1
    assert re.search(message, line), line
    assert not re.search(NOISE, line), line
    # What is wrong, and after it what to do.
    assert "; " in line or "give --" in line


@pytest.mark.parametrize("case", CASES)
def test_bad_files(tmp_path, capfd, case):
    make, message = CASES[case]
    path = make(tmp_path)
    options = ReadOptions(linearize=case.startswith(LINEARIZED))
    capfd.readouterr()
    start = time.process_time()
    with pytest.raises(ProbeError) as caught:
        project(open_probe(path, options), 2)
    assert time.process_time() - start < 2
    check_message(caught.value, path, message)
    assert capfd.readouterr() == ("", "")


def test_nothing_is_printed_when_the_process_ends(tmp_path):
    """OpenImageIO prints errors at exit that nobody asked it for."""
    paths = []
    for k, (make, _) in enumerate(CASES.values()):
        folder = tmp_path / str(k)
        folder.mkdir()
        paths.append(str(make(folder)))
    program = """
import json, sys
from shrm_cli.errors import ProbeError
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.lighting import project
refused = 0
for path in json.load(sys.stdin):
    try:
        project(open_probe(path), 2)
    except ProbeError:
        refused += 1
print(refused)
"""
    result = subprocess.run(
        [sys.executable, "-c", program],
        input=json.dumps(paths),
        env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, f"{len(CASES)}\n", "")


@pytest.mark.parametrize("make", [too_large, too_large_tiled, large_but_not_there, large_cube])
def test_claims_of_a_header_cost_no_memory(tmp_path, make):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ProbeError):
        project(open_probe(make(tmp_path)), 2)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100 * 1024


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_unreadable_file(tmp_path):
    path = exr(tmp_path)
    path.chmod(0)
    with pytest.raises(ProbeError) as caught:
        open_probe(path)
    check_message(caught.value, path, "no permission to read it")


@pytest.mark.parametrize(
    ("layout", "height", "width"),
    [("angular", 32, 64), ("latlong", 32, 32), ("strip", 32, 64), ("hcross", 30, 40),
     ("vcross", 32, 64), ("openexr", 32, 64), ("hcross", 33, 44)],
)  # fmt: skip
def test_layouts_that_do_not_fit(tmp_path, layout, height, width):
    path = exr(tmp_path, height, width)
    options = ReadOptions(layout=layout)
    if layout == "hcross":  # these do
        assert open_probe(path, options).width == width // 4
        return
    with pytest.raises(ProbeError) as caught:
        open_probe(path, options)
    check_message(caught.value, path, f"{width} x {height} cannot be {layout}, which is .*; ")


def test_more_pixels_than_are_read(tmp_path, monkeypatch):
    path = exr(tmp_path)
    monkeypatch.setattr(image_file, "MAX_PIXELS", 2047)
    with pytest.raises(ProbeError) as caught:
        open_probe(path)
    check_message(caught.value, path, "64 x 32 pixels are more than 2,047; scale it down")


def test_tiles_much_larger_than_their_image(tmp_path):
    """A file of a few kilobytes cannot ask for hundreds of megabytes."""
    path = scenes.write(tmp_path / "bad.tif", noise(8, 16), tile=16)
    data = path.read_bytes()
    for tag in (322, 323):  # TileWidth and TileLength of TIFF, a short integer each
        data = re.sub(struct.pack("<HHI", tag, 3, 1) + rb"\x10\x00", lambda found: (
            found.group()[:-2] + struct.pack("<H", 8192)), data, flags=re.DOTALL)  # fmt: skip
    path.write_bytes(data)
    with pytest.raises(ProbeError) as caught:
        open_probe(path)
    check_message(caught.value, path, "its tiles of 8192 x 8192 are larger than the image; export")


def test_more_pixels_than_are_kept_in_memory(tmp_path, monkeypatch):
    path = exr(tmp_path, 48, 8)
    monkeypatch.setattr(Cube, "most_pixels", 383)
    with pytest.raises(ProbeError) as caught:
        open_probe(path)
    check_message(caught.value, path, "384 openexr pixels exceed 383; scale it down")


def six_files(folder, size=8):
    for name in scenes.FACES:
        scenes.write(folder / f"sky_{name}.exr", noise(size, size))
    return folder / "sky_%.exr"


@pytest.mark.parametrize("face", scenes.FACES)
def test_one_of_six_files_is_missing(tmp_path, face):
    pattern = six_files(tmp_path)
    path = tmp_path / f"sky_{face}.exr"
    path.unlink()
    with pytest.raises(ProbeError) as caught:
        open_probe(pattern)
    check_message(caught.value, path, "no such file; ")


@pytest.mark.parametrize("face", scenes.FACES[1:])
def test_one_of_six_files_has_another_size(tmp_path, face):
    pattern = six_files(tmp_path)
    path = scenes.write(tmp_path / f"sky_{face}.exr", noise(16, 16))
    with pytest.raises(ProbeError) as caught:
        open_probe(pattern)
    check_message(caught.value, path, r"16 x 16 pixels, but .*sky_\+X\.exr has 8 x 8; make all")


def test_six_files_that_are_not_square(tmp_path):
    for name in scenes.FACES:
        scenes.write(tmp_path / f"sky_{name}.exr", noise(8, 16))
    path = tmp_path / "sky_%.exr"
    with pytest.raises(ProbeError) as caught:
        open_probe(path)
    check_message(caught.value, path, "16 x 8 cannot be faces, which is a square image; ")


def test_six_files_with_names_too_long(tmp_path):
    with pytest.raises(ProbeError, match=r"bad\+Xx+\.exr: cannot be opened .*; "):
        open_probe(tmp_path / f"bad%{300 * 'x'}.exr")


def test_six_files_of_another_layout(tmp_path):
    path = six_files(tmp_path)
    with pytest.raises(ProbeError) as caught:
        open_probe(path, ReadOptions(layout="latlong"))
    check_message(caught.value, path, "six files are not latlong; leave `layout` out")
    assert open_probe(path, ReadOptions(layout="faces")).layout == "faces"


def test_one_file_as_six(tmp_path):
    path = exr(tmp_path, 8, 8)
    with pytest.raises(ProbeError) as caught:
        open_probe(path, ReadOptions(layout="faces"))
    line = str(caught.value)
    assert line.startswith(f"{path}: write %")


def test_a_name_that_is_not_utf8(tmp_path):
    name = os.fsencode(tmp_path) + b"/b\xff.exr"
    with open(name, "wb") as stream:
        stream.write(b"anything")
    with pytest.raises(ProbeError, match="is not UTF-8; give it one that is, or rename it"):
        open_probe(os.fsdecode(name))


def test_a_name_that_the_locale_cannot_spell(tmp_path):
    """Bytes that are UTF-8, in a process whose names are ASCII."""
    (tmp_path / "b\u00fc.exr").write_bytes(b"anything")
    with pytest.raises(ProbeError, match=r"encoding, .*, lacks; set LC_ALL=C.UTF-8, or rename it"):
        open_probe(tmp_path / "b\udcc3\udcbc.exr")
