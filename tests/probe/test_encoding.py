"""What files say of their own numbers is obeyed or refused: exposure, curves, shapes, windows."""

import struct

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe.icc import linear_curve
from shrm_cli.probe.image_file import ImageFile
from shrm_cli.probe.open import open_probe
from shrm_cli.vocabulary import PRIMARIES
from tests.cli.helpers import noise, run, write_exr
from tests.probe import scenes

HEIGHT, WIDTH = 8, 16


@pytest.fixture
def steps(rng):
    """Values that 8 bits hold, in 0 .. 1."""
    return rng.integers(0, 256, (HEIGHT, WIDTH, 3)) / 255


def hdr(folder, lines="", pixels=None, kind="rgbe"):
    """A Radiance file with lines in its header."""
    pixels = np.full((HEIGHT, WIDTH, 3), 0.5) if pixels is None else pixels
    path = scenes.write_rgbe(folder / "a.hdr", pixels)
    data = path.read_bytes().replace(b"#?RADIANCE\n", f"#?RADIANCE\n{lines}".encode())
    path.write_bytes(data.replace(b"rle_rgbe", f"rle_{kind}".encode()))
    return path


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("EXPOSURE=8\n", (0.0625, 0.0625, 0.0625)),
        ("EXPOSURE= 8.0\nEXPOSURE=.25\n", (0.25, 0.25, 0.25)),
        ("COLORCORR=1 2 4\n", (0.5, 0.25, 0.125)),
        ("COLORCORR= 1 2 4\nEXPOSURE=0.5\n", (1, 0.5, 0.25)),
        ("\tEXPOSURE=8\npfilt EXPOSURE=8\nVIEW= -vtv -vp 0 0 0\n", (0.5, 0.5, 0.5)),
    ],
)
def test_applied_factors_are_divided_out(tmp_path, lines, expected):
    """The file's manual: radiance is the pixel over the product of all factors."""
    probe = open_probe(hdr(tmp_path, lines))
    np.testing.assert_allclose(probe.image()[3, 5], expected, rtol=1e-6)
    warned = [line for line in probe.report.warnings() if "EXPOSURE" in line]
    assert len(warned) == (expected != (0.5, 0.5, 0.5))


def test_what_was_divided_out_is_told(tmp_path):
    (note,) = open_probe(hdr(tmp_path, "COLORCORR=2 2 4\r\n")).report.notes
    assert "were divided by 2/2/4:" in note
    (note,) = open_probe(hdr(tmp_path, "EXPOSURE=2\n")).report.notes
    assert "were divided by 2:" in note


def test_primaries_of_a_radiance_file(tmp_path):
    path = hdr(tmp_path, "PRIMARIES= .708 .292 .17 .797 .131 .046 .3127 .329\n")
    rec2020 = (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329)
    assert open_probe(path).chromaticities == rec2020
    assert open_probe(hdr(tmp_path)).chromaticities is None


def test_primaries_of_zeros_are_a_field_that_nobody_has_filled_in(tmp_path):
    """Rec. 709 is taken without a word, and `shrm info` says so."""
    path = hdr(tmp_path, "PRIMARIES= 0 0 0 0 0 0 0 0\n")
    for options in ({}, {"working": "acescg"}, {"primaries": "p3"}):
        assert open_probe(path, **options).report.notes == ()
    assert open_probe(path).chromaticities == PRIMARIES["rec709"]
    found = run("info", path)
    assert (found.code, found.err) == (0, "")
    assert "zeros, which are no colors" in found.out
    exr = write_exr(tmp_path / "b.exr", noise(), chromaticities=(0.0,) * 8)
    assert open_probe(exr).report.notes == ()
    assert open_probe(exr).chromaticities == PRIMARIES["rec709"]


@pytest.mark.parametrize(
    "line", ["EXPOSURE=0", "EXPOSURE=-1", "EXPOSURE=nan", "EXPOSURE=much", "EXPOSURE=1 2",
             "COLORCORR=1 2", "PRIMARIES=.3 .3", "GAMMA=", "PIXASPECT=0"],
)  # fmt: skip
def test_numbers_that_cannot_be(tmp_path, line):
    with pytest.raises(ProbeError, match=line.partition("=")[0] + "=.* of its header is not"):
        open_probe(hdr(tmp_path, line + "\n"))


def test_factors_that_overflow(tmp_path):
    with pytest.raises(ProbeError, match="multiply to"):
        open_probe(hdr(tmp_path, "EXPOSURE=1e38\n" * 9))


def test_gamma_of_a_radiance_file(tmp_path):
    with pytest.raises(ProbeError, match=r"GAMMA=2\.2 .*not linear; "):
        open_probe(hdr(tmp_path, "GAMMA=2.2\n"))
    assert open_probe(hdr(tmp_path, "GAMMA=1.0\n")).report.notes == ()


def test_xyze(tmp_path):
    with pytest.raises(ProbeError, match=r"CIE XYZ .* not RGB; .*ra_xyze"):
        open_probe(hdr(tmp_path, kind="xyze"))


def icc(*tags):
    """A profile of nothing but tags, each of a name and its data."""
    start = 132 + 12 * len(tags)
    table, body = b"", b""
    for name, data in tags:
        table += struct.pack(">4sII", name, start + len(body), len(data))
        body += data
    head = struct.pack(">I", start + len(body)).ljust(36, b"\0") + b"acsp"
    return head.ljust(128, b"\0") + struct.pack(">I", len(tags)) + table + body


def curv(*values):
    return b"curv\0\0\0\0" + struct.pack(f">I{len(values)}H", len(values), *values)


def para(kind, *values):
    numbers = [round(value * 65536) for value in values]
    return b"para\0\0\0\0" + struct.pack(f">HH{len(values)}i", kind, 0, *numbers)


def srgb(v):
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


CURVES = {
    "linear": (curv(), lambda v: v),
    "gamma 1.8": (curv(461), lambda v: v ** (461 / 256)),
    "table": (curv(0, 65535 // 4, 65535), lambda v: np.interp(v, [0, 0.5, 1], [0, 0.25, 1])),
    "power": (para(0, 2.5), lambda v: v**2.5),
    "BT.709": (
        para(3, 1 / 0.45, 1 / 1.099, 0.099 / 1.099, 1 / 4.5, 0.081),
        lambda v: np.where(v < 0.081, v / 4.5, ((v + 0.099) / 1.099) ** (1 / 0.45)),
    ),
    "offset": (
        para(4, 2.0, 0.5, 0.5, 0.25, 0.5, -0.25, 0.0),
        lambda v: np.where(v >= 0.5, (0.5 * v + 0.5) ** 2 - 0.25, 0.25 * v),
    ),
}


@pytest.mark.parametrize("name", CURVES)
def test_tiff_with_a_profile(tmp_path, steps, name):
    data, expected = CURVES[name]
    path = tmp_path / "a.tif"
    spec = oiio.ImageSpec(WIDTH, HEIGHT, 3, oiio.UINT16)
    profile = icc((b"wtpt", b"XYZ \0\0\0\0"), (b"rTRC", data))
    spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(profile)}]"), profile)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    output.write_image(np.rint(steps * 65535).astype(np.uint16))
    output.close()
    with pytest.raises(ProbeError, match="`linearize`"):
        ImageFile.open(path)
    file = ImageFile.open(path, linearize=True)
    assert file.encoding.name == "ICC profile"
    np.testing.assert_allclose(file.read(0, HEIGHT), expected(steps), atol=2e-5)


@pytest.mark.parametrize(
    ("gamma", "name", "expected"),
    [(100000, "linear", lambda v: v), (50000, "gamma 2", lambda v: v**2), (None, "sRGB", srgb)],
)
def test_gamma_of_a_png(tmp_path, steps, gamma, name, expected):
    chunks = [] if gamma is None else [(b"gAMA", struct.pack(">I", gamma))]
    values = np.rint(steps * 255).astype(np.uint8)
    file = ImageFile.open(scenes.write_png(tmp_path / "a.png", values, *chunks), linearize=True)
    assert file.encoding.name == name
    np.testing.assert_allclose(file.read(0, HEIGHT), expected(steps), atol=1e-5)


def test_curves_that_are_not_known_are_refused(tmp_path, steps):
    """Perceptual quantizing, as HDR video has it."""
    values = np.rint(steps * 255).astype(np.uint8)
    path = scenes.write_png(tmp_path / "a.png", values, (b"cICP", bytes([9, 16, 0, 1])))
    with pytest.raises(ProbeError, match=r"encoded as pq_.*; convert it"):
        ImageFile.open(path, linearize=True)


@pytest.mark.parametrize(
    ("space", "message"), [("KodakLog", "'Logarithmic': not sRGB"), ("", "'Undefined': not sRGB")]
)
def test_dpx_that_is_not_linear_is_refused(tmp_path, steps, space, message):
    path = scenes.write(tmp_path / "a.dpx", steps, "uint16", oiio__ColorSpace=space)
    with pytest.raises(ProbeError, match=f"dpx of transfer {message}; convert"):
        ImageFile.open(path, linearize=True)


def test_linear_dpx(tmp_path, steps):
    path = scenes.write(tmp_path / "a.dpx", steps, "uint16", oiio__ColorSpace="linear")
    found = ImageFile.open(path, linearize=True).read(0, HEIGHT)
    np.testing.assert_allclose(found, steps, atol=1e-5)


def test_pixels_may_be_square_but_for_rounding(tmp_path, steps):
    for aspect in (0.993, 1.007):
        assert open_probe(scenes.write(tmp_path / "a.exr", steps, PixelAspectRatio=aspect))
    with pytest.raises(ProbeError, match="not square"):
        open_probe(scenes.write(tmp_path / "a.exr", steps, PixelAspectRatio=1.015))


@pytest.mark.parametrize("suffix", ["exr", "tif", "hdr"])
def test_pixels_that_are_not_square_need_a_layout(tmp_path, steps, suffix):
    if suffix == "hdr":
        path = hdr(tmp_path, "PIXASPECT=2\n")
    else:
        path = scenes.write(tmp_path / f"a.{suffix}", steps, PixelAspectRatio=2.0)
    with pytest.raises(ProbeError, match=r"not square \(aspect 2\).* give `layout`, or resample"):
        open_probe(path)
    assert open_probe(path, layout="latlong").height == HEIGHT


def test_what_a_data_window_leaves_out_is_told(tmp_path, steps):
    spec = oiio.ImageSpec(WIDTH // 2, HEIGHT, 3, oiio.FLOAT)
    spec.x, spec.full_width, spec.full_height = WIDTH // 4, WIDTH, HEIGHT
    output = oiio.ImageOutput.create(str(tmp_path / "a.exr"))
    output.open(str(tmp_path / "a.exr"), spec)
    output.write_image(np.ones((HEIGHT, WIDTH // 2, 3), np.float32))
    output.close()
    probe = open_probe(tmp_path / "a.exr")
    probe.image()
    (line,) = probe.report.warnings()
    assert line.startswith("0.5 of the picture lies outside its data window")


@pytest.mark.parametrize("lost", [1, 100, 2880 - 1])
def test_fits_without_its_end(tmp_path, lost):
    """Its records are 2880 bytes long, the last one as well."""
    path = scenes.write(tmp_path / "a.fits", np.ones((HEIGHT, WIDTH, 3)))
    open_probe(path)
    path.write_bytes(path.read_bytes()[:-lost])
    with pytest.raises(ProbeError, match="damaged or truncated; copy"):
        open_probe(path)


@pytest.mark.parametrize("count", [0, 1, 2, 3, 2**16, 2**32 - 1])
def test_profiles_that_are_cut_off(count):
    """A curve that claims more entries than there are, cut at every byte."""
    profile = icc((b"rTRC", struct.pack(">4sII", b"curv", 0, count) + bytes(7)))
    for end in range(len(profile) + 1):
        linear_curve(profile[:end])


@pytest.mark.parametrize("data", [para(0, -2.2), para(3, 0, 1, 0, 1, 0), curv(0)])
def test_powers_that_are_not_positive_are_no_curves(data):
    assert linear_curve(icc((b"rTRC", data))) is None


@pytest.mark.filterwarnings("error")
def test_curves_that_overflow_do_so_silently():
    """The pixels are counted and refused later."""
    curve = linear_curve(icc((b"rTRC", para(1, 30000, 30000, 1))))
    assert np.isinf(curve(np.array([1.0])))
