"""The primaries of a probe: stated by its file, declared, and converted on reading."""

import struct
import zlib

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe import resample
from shrm_cli.probe.icc import profile_primaries
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.shared import shared
from shrm_cli.vocabulary import PRIMARIES
from tests.probe import scenes

# Published: ACES AP1 to Rec.709 with Bradford's adaptation (ampas/aces-dev, to six digits).
AP1_TO_709 = np.array(
    [
        [1.705051, -0.621792, -0.083259],
        [-0.130256, 1.140805, -0.010548],
        [-0.024003, -0.128969, 1.152972],
    ]
)


@pytest.fixture
def pixels(rng):
    """Colors of ACEScg that Rec.709 has too."""
    return (rng.uniform(0.4, 0.6, (16, 32, 3))).astype(np.float32)


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def tagged(folder, pixels, space="acescg"):
    attributes = {} if space is None else {"chromaticities": PRIMARIES[space]}
    return scenes.write_exr(folder / "a.exr", scenes.rgb(pixels), **attributes)


@pytest.mark.parametrize("space", ["acescg", None, "rec2020"])
def test_declared_and_converted(tmp_path, pixels, space):
    """What the file says gives way to what the user says, who is told."""
    path = tagged(tmp_path, pixels, space)
    probe = open_probe(path, primaries="acescg", working="rec709")
    np.testing.assert_allclose(probe.image(), pixels @ AP1_TO_709.T, atol=2e-5)
    assert probe.chromaticities == PRIMARIES["rec709"]
    assert probe.reading()["working"] == list(PRIMARIES["rec709"])
    told = [line for line in probe.report.warnings() if "was obeyed instead" in line]
    assert len(told) == (space == "rec2020")
    assert all("Rec.2020" in line and "ACEScg" in line for line in told)
    # The same light, however it is held.
    np.testing.assert_array_equal(shared(probe).image(), probe.image())
    assert open_probe(path).digest() == probe.digest()


def test_only_declared(tmp_path, pixels):
    probe = open_probe(tagged(tmp_path, pixels, None), primaries=PRIMARIES["p3"])
    np.testing.assert_array_equal(probe.image(), pixels)
    assert probe.chromaticities == PRIMARIES["p3"]


def test_unknown_primaries_are_taken_for_rec709_and_told(tmp_path, pixels):
    probe = open_probe(tagged(tmp_path, pixels, None), working="acescg")
    np.testing.assert_allclose(probe.image() @ AP1_TO_709.T, pixels, atol=2e-5)
    assert any("taken for Rec.709 and converted to ACEScg" in x for x in probe.report.notes)
    assert not open_probe(tagged(tmp_path, pixels), working="p3").report.notes


def test_a_large_probe_is_converted_once(pixels, monkeypatch):
    monkeypatch.setattr(resample, "LEAST_ROWS", 4)
    whole = Probe.from_array(pixels, working="p3")
    small = resample.coarse_probe(whole, 1)
    assert small.height < whole.height
    np.testing.assert_allclose(small.image().mean((0, 1)), whole.image().mean((0, 1)), rtol=2e-2)


def test_what_lies_outside_is_negative_and_told(pixels):
    green = pixels * np.float32([0, 1, 0])
    probe = Probe.from_array(green, primaries="acescg", working="rec709")
    assert probe.image().min() == 0
    assert any("negative radiance were clamped" in line for line in probe.report.warnings())


@pytest.mark.parametrize("value", ["acesgc", 3, (np.nan,) * 8, "", PRIMARIES["p3"][:6], ("a",) * 8])
@pytest.mark.parametrize("name", ["primaries", "working"])
def test_what_are_no_primaries(pixels, name, value):
    with pytest.raises(ProbeError, match=f"`{name}` .*acescg"):
        Probe.from_array(pixels, **{name: value})


def png(path, *chunks):
    """A grey PNG with more chunks."""

    def chunk(name, data):
        sum_ = zlib.crc32(name + data)
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", sum_)

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 8, 4, 8, 2, 0, 0, 0))
    rows = chunk(b"IDAT", zlib.compress((b"\0" + b"\x80" * 24) * 4)) + chunk(b"IEND", b"")
    between = b"".join(chunk(*each) for each in chunks)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + head + between + rows)
    return path


def chrm(space):
    *colors, x, y = PRIMARIES[space]
    return b"cHRM", struct.pack(">8I", *(round(1e5 * each) for each in (x, y, *colors)))


SRGB, CICP = (b"sRGB", b"\0"), (b"cICP", bytes([9, 13, 0, 1]))


def profile(space):
    """A profile with colorants adapted to D50 by colour-science, as ICC has it."""
    colour = pytest.importorskip("colour")
    theirs = colour.RGB_COLOURSPACES[space]
    white = colour.xy_to_XYZ(theirs.whitepoint)
    chad = colour.adaptation.matrix_chromatic_adaptation_VonKries(
        white, np.array([0.9642, 1, 0.8249]), "Bradford"
    )
    matrix = chad @ theirs.matrix_RGB_to_XYZ

    def numbers(kind, values):
        return kind + struct.pack(f">4x{len(values)}i", *(round(65536 * v) for v in values))

    tags = [
        (name, numbers(b"XYZ ", matrix[:, k])) for k, name in enumerate((b"rXYZ", b"gXYZ", b"bXYZ"))
    ]
    tags.append((b"chad", numbers(b"sf32", chad.ravel())))
    start, table, body = 132 + 12 * len(tags), b"", b""
    for name, data in tags:
        table += struct.pack(">4sII", name, start + len(body), len(data))
        body += data
    head = struct.pack(">I4xI4s4s4s", start + len(body), 0x04300000, b"mntr", b"RGB ", b"XYZ ")
    head = head.ljust(36, b"\0") + b"acsp"
    white = struct.pack(">3i", 0xF6D6, 0x10000, 0xD32D)
    head = (head.ljust(68, b"\0") + white).ljust(128, b"\0")
    return head + struct.pack(">I", len(tags)) + table + body


@pytest.mark.parametrize(
    ("chunks", "expected"),
    [
        ([], None),
        ([chrm("p3")], "p3"),
        ([SRGB, chrm("p3")], "rec709"),
        ([SRGB, CICP], "rec2020"),
        ([(b"cHRM", b"\0" * 32)], None),
        ([(b"cHRM", b"\0" * 31)], None),
    ],
)
def test_primaries_of_a_png(tmp_path, chunks, expected):
    found = open_probe(png(tmp_path / "a.png", *chunks), linearize=True).chromaticities
    assert found == (None if expected is None else pytest.approx(PRIMARIES[expected], abs=1e-5))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["Display P3", "ACEScg", "ITU-R BT.2020"])
def test_primaries_of_a_profile(tmp_path, name):
    names = {"Display P3": "p3", "ACEScg": "acescg", "ITU-R BT.2020": "rec2020"}
    data = profile(name)
    expected = PRIMARIES[names[name]]
    assert profile_primaries(data) == pytest.approx(expected, abs=5e-4)
    assert profile_primaries(data[:150]) is None
    path = png(tmp_path / "a.png", (b"iCCP", b"a\0\0" + zlib.compress(data)), chrm("adobe"))
    found = open_probe(path, linearize=True).chromaticities
    assert found == pytest.approx(expected, abs=5e-4)
