"""Map <-> file: what is read is what was written, and nothing that is not a map."""

import json
import os
import stat
import struct
import sys

import numpy as np
import OpenEXR
import pytest

from shrm_cli.errors import MapError, OutputError
from shrm_cli.files.image import write_image
from shrm_cli.maps.file import is_map, open_map
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.stored import VERSION
from tests.cli.helpers import process
from tests.maps.damage import parts, refused, survives_flipped_bits, writer_of_damage

P3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
INFO = MapInfo(
    11,
    2,
    0.03,
    0.975,
    0.125,
    {"name": "phong", "parameters": {"exponent": 8.0}},
    "p.exr",
    "ab" * 32,
)


def random_map(frame="global", sampling="center", order_p=2, size=5, info=INFO, scale=1.0):
    rng = np.random.default_rng(order_p)
    values = rng.normal(size=(6 * size, size, (order_p + 1) ** 2, 3)) * scale
    return Shrm(values, frame, "reflection", info, sampling)


@pytest.fixture
def damaged(tmp_path):
    """Writes a sound map with its header and channels changed; None removes."""
    random_map().save(tmp_path / "sound.exr")
    return writer_of_damage(tmp_path / "sound.exr")


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("frame", ["global", "local"])
@pytest.mark.parametrize("order_p", [0, 2, 5])
def test_float_is_read_back_exactly(tmp_path, frame, sampling, order_p):
    made = random_map(frame, sampling, order_p)
    assert made.save(tmp_path / "a.exr", "float") == "float"
    back = open_map(tmp_path / "a.exr")
    np.testing.assert_array_equal(back.coefficients, made.coefficients.astype(np.float32))
    assert (back.frame, back.center, back.sampling) == (frame, "reflection", sampling)
    assert (back.order_p, back.size) == (order_p, 5)


def test_half_is_read_back_to_its_precision(tmp_path):
    made = random_map(size=16)
    assert made.save(tmp_path / "a.exr") == "half"
    back = open_map(tmp_path / "a.exr").coefficients
    np.testing.assert_allclose(back, made.coefficients, rtol=2e-3, atol=1e-7)
    assert np.abs(back - made.coefficients).max() > 0


@pytest.mark.parametrize("chromaticities", [None, P3])
def test_what_a_map_remembers_is_read_back(tmp_path, chromaticities):
    info = MapInfo(
        11, 2, 0.03, 0.972359, 0.0491997, INFO.brdf, "prö be.exr", "ab" * 32, chromaticities
    )
    random_map(info=info).save(tmp_path / "a.exr")
    back = open_map(tmp_path / "a.exr").info
    found = back.chromaticities
    assert back == MapInfo(**{**vars(info), "chromaticities": found})
    assert (found is None) == (chromaticities is None)
    assert found is None or found == pytest.approx(P3, rel=1e-6)


def test_azimuth_free_local_maps_hold_only_q_0(tmp_path):
    made = random_map("local", order_p=3)
    made.coefficients[:, :, [k for k in range(16) if k not in (0, 2, 6, 12)]] = 0
    made.save(tmp_path / "a.exr", "float")
    expected = {f"sh{k:03d}.{c}" for k in (0, 2, 6, 12) for c in "RGB"}
    assert parts(tmp_path / "a.exr")[1].keys() == expected
    back = open_map(tmp_path / "a.exr")
    np.testing.assert_array_equal(back.coefficients, made.coefficients.astype(np.float32))
    assert back.order_p == 3


def test_the_same_zeros_in_the_global_frame_are_kept(tmp_path):
    made = random_map(order_p=1)
    made.coefficients[:, :, 1] = 0
    made.coefficients[:, :, 3] = 0
    made.save(tmp_path / "a.exr")
    assert len(parts(tmp_path / "a.exr")[1]) == 12


def test_index_has_three_digits(tmp_path):
    random_map(order_p=10, size=4).save(tmp_path / "a.exr")
    channels = parts(tmp_path / "a.exr")[1]
    assert {"sh000.R", "sh009.G", "sh099.B", "sh120.R"} <= channels.keys()
    assert len(channels) == 3 * 121


def test_high_orders_have_more_channels_than_the_library_expects(tmp_path):
    made = random_map(order_p=20, size=4)
    made.save(tmp_path / "a.exr", "float")
    found = open_map(tmp_path / "a.exr").coefficients
    np.testing.assert_array_equal(found, made.coefficients.astype(np.float32))


def test_bytes_are_the_same_each_time(tmp_path):
    for name in "ab":
        random_map(size=64).save(tmp_path / f"{name}.exr")
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


@pytest.mark.parametrize(
    ("scale", "precision", "expected"),
    [
        (1.0, "auto", "half"),
        (65519.0, "auto", "half"),
        (65520.0, "auto", "float"),
        (-65520.0, "auto", "float"),
        (1.0, "float", "float"),
        (-65519.0, "half", "half"),
    ],
)
def test_precision_follows_the_range(tmp_path, scale, precision, expected):
    made = random_map()
    made.coefficients[:] = 0.0
    made.coefficients[3, 2, 1, 0] = scale
    assert made.save(tmp_path / "a.exr", precision) == expected
    back = open_map(tmp_path / "a.exr").coefficients
    assert np.isfinite(back).all()
    assert back[3, 2, 1, 0] == pytest.approx(scale, rel=1e-3)


@pytest.mark.parametrize(
    ("value", "precision", "words"),
    [
        (-65520.0, "half", "overflows half"),
        (np.nan, "auto", "not finite"),
        (np.inf, "float", "not finite"),
        (-1e39, "float", "not finite"),
    ],
)
def test_values_that_cannot_be_held_leave_no_file(tmp_path, value, precision, words):
    made = random_map()
    made.coefficients[1, 1, 1, 1] = value
    with pytest.raises(OutputError, match=words):
        made.save(tmp_path / "a.exr", precision)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "name",
    [
        "version", "frame", "center", "F", "P", "epsilon", "brdf_energy_captured",
        "predicted_error", "brdf",
    ],
)  # fmt: skip
def test_missing_attributes(damaged, name):
    refused(damaged({f"shrm:{name}": None}), f"shrm:{name} is missing or wrong")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("version", "1"), ("version", 0), ("version", -3), ("version", 1.0),
        ("frame", "x"), ("frame", "Global"), ("frame", 1), ("frame", ""),
        ("center", "middle"), ("center", 2.5),
        ("F", -5), ("F", 513), ("F", 2**31 - 1), ("F", 11.0), ("F", "11"), ("F", (1, 2)),
        ("P", -1), ("P", 33), ("P", 1000), ("P", 2.0), ("P", "2"),
        ("epsilon", "small"), ("epsilon", 3), ("epsilon", float("nan")),
        ("brdf_energy_captured", float("inf")), ("brdf_energy_captured", "0.97"),
        ("predicted_error", float("nan")), ("predicted_error", 0),
        ("brdf", "phong"), ("brdf", "[1]"), ("brdf", "{"), ("brdf", "[" * 100_000), ("brdf", 7),
        ("brdf", '{"name": "\\ud800", "parameters": {}}'), ("brdf", '{"name": "\\udcff"}'),
        ("brdf", '{"a": ' + "[" * 5 + "]" * 5 + "}"), ("brdf", '{"a":' * 900 + "1" + "}" * 900),
        ("brdf", '{"parameters": {"roughness": NaN}}'), ("brdf", '{"a": -Infinity}'),
        ("brdf", '{"parameters": {"roughness": 1e999}}'), ("brdf", '{"a": ' + "9" * 400 + "}"),
        ("probe", 3), ("probe_sha256", 0.5), ("probe", "x" * 5000),
        ("predicted_error", -0.5), ("added_error", 1e30), ("epsilon", -1.0),
    ],
    ids=lambda value: str(value)[:20],
)  # fmt: skip
def test_wrong_attributes(damaged, name, value):
    refused(damaged({f"shrm:{name}": value}), f"shrm:{name} is missing or wrong; make it again")


def test_bytes_that_are_no_text_are_replaced(damaged):
    path = damaged({"shrm:probe": "XX.exr"})
    path.write_bytes(path.read_bytes().replace(b"XX", b"\xff\xfe"))
    assert open_map(path).info.probe == "??.exr"


@pytest.mark.parametrize("version", [VERSION + 1, 1000])
def test_newer_files_ask_for_a_newer_shrm(damaged, version):
    changed = {"shrm:version": version, "shrm:frame": "tangent", "shrm:F": None}
    refused(damaged(changed), f"newer shrm (format {version})", "update")


def test_other_representations(damaged):
    refused(damaged({"shrm:representation": "hologram"}), "'hologram'", "cannot read")


def test_a_long_name_is_not_repeated_whole(damaged):
    with pytest.raises(MapError) as caught:
        open_map(damaged({"shrm:representation": "x" * 10000}))
    assert "'" + "x" * 40 + "', which" in str(caught.value)


def plane(value=0.5, dtype=np.float16):
    return np.full((30, 5), value, dtype=dtype)


@pytest.mark.parametrize(
    "planes",
    [
        {"sh000.R": None},
        {"sh008.B": None},
        {"sh005.G": None},
        {"sh009.R": plane()},
        {"A": plane()},
        {"sh0.R": plane()},
        # What an azimuth-free map has, but this one is in world axes.
        {f"sh{k:03d}.{c}": None for k in (1, 3, 4, 5, 7, 8) for c in "RGB"},
    ],
    ids=lambda planes: ",".join(planes)[:20],
)
def test_channels_must_be_those_of_p(damaged, planes):
    refused(damaged(planes=planes), "channels", "P = 2")


def test_p_must_be_that_of_the_channels(damaged):
    refused(damaged({"shrm:P": 1}), "channels", "P = 1")


def test_whole_numbers_are_no_coefficients(damaged):
    planes = {f"sh{k:03d}.{c}": plane(7, np.uint32) for k in range(9) for c in "RGB"}
    refused(damaged(planes=planes), "channels")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_coefficients_must_be_finite(damaged, value):
    bad = plane()
    bad[17, 3] = value
    refused(damaged(planes={"sh004.G": bad}), "NaN or infinite")


def test_shape_must_be_a_cube(tmp_path):
    random_map().save(tmp_path / "sound.exr")
    header, channels = parts(tmp_path / "sound.exr")
    for name in ("dataWindow", "displayWindow"):
        del header[name]
    cut = {name: np.ascontiguousarray(pixels[:29]) for name, pixels in channels.items()}
    OpenEXR.File(header, cut).write(str(tmp_path / "cut.exr"))
    refused(tmp_path / "cut.exr", "5 x 29 is not a cube")


@pytest.mark.parametrize("part", [0.0, 0.01, 0.3, 0.6, 0.9, 0.999])
def test_truncated_files(tmp_path, part):
    random_map(size=32).save(tmp_path / "a.exr")
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(data[: int(part * len(data))])
    refused(tmp_path / "a.exr", "damaged")


def test_every_flipped_byte_is_survived(tmp_path):
    """Damage anywhere gives a map or a MapError, and nothing else."""
    random_map(order_p=1, size=4).save(tmp_path / "a.exr")
    survives_flipped_bits(tmp_path / "a.exr", 400)


@pytest.mark.slow
@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="no /proc to measure with")
@pytest.mark.parametrize("size", [1024, 4096, 5000, 200_000])
def test_hostile_sizes_allocate_nothing(tmp_path, size):
    """A header that claims a huge image; getrusage would count what the child inherits."""
    random_map().save(tmp_path / "a.exr")
    data = bytearray((tmp_path / "a.exr").read_bytes())
    for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        struct.pack_into(
            "<4i", data, data.index(name) + len(name) + 4, 0, 0, size - 1, 6 * size - 1
        )
    (tmp_path / "a.exr").write_bytes(data)
    refused(tmp_path / "a.exr")
    code = """
import sys
from shrm_cli.errors import MapError
from shrm_cli.maps.file import open_map
def peak():
    return int(open("/proc/self/status").read().split("VmHWM:")[1].split()[0])
before = peak()
try:
    open_map(sys.argv[1])
except MapError:
    print(peak() - before)
"""
    result = process(tmp_path / "a.exr", code=code)
    assert result.err == ""
    assert int(result.out) < 50_000  # kB


def test_things_that_are_no_maps(tmp_path):
    refused(tmp_path / "missing.exr", "no such file")
    refused(tmp_path, "a directory")
    (tmp_path / "text.exr").write_text("no image")
    refused(tmp_path / "text.exr", "not an OpenEXR file")
    write_image(tmp_path / "image.exr", np.ones((6, 1, 3)))
    refused(tmp_path / "image.exr", "an image, but not a map")


@pytest.mark.skipif(sys.platform == "win32", reason="has no named pipes")
def test_a_pipe_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe.exr")
    refused(tmp_path / "pipe.exr", "not a regular file")
    assert not is_map(tmp_path / "pipe.exr")


def test_is_map(tmp_path):
    random_map().save(tmp_path / "map.exr")
    write_image(tmp_path / "image.exr", np.ones((2, 4, 3)))
    (tmp_path / "text.exr").write_text("no image")
    assert is_map(tmp_path / "map.exr")
    for name in ("image.exr", "text.exr", "missing.exr", "."):
        assert not is_map(tmp_path / name)


def test_library_errors_are_not_left_for_the_end(tmp_path):
    """OpenImageIO prints errors that nobody fetched when the process ends."""
    random_map(size=32).save(tmp_path / "a.exr")
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "cut.exr").write_bytes(data[: len(data) // 2])
    (tmp_path / "text.exr").write_text("no image")
    code = """
import sys
from shrm_cli.errors import MapError
from shrm_cli.maps.file import is_map, open_map
for path in sys.argv[1:]:
    is_map(path)
    try:
        open_map(path)
    except MapError:
        print("refused")
"""
    names = ("cut.exr", "text.exr", "missing.exr", ".")
    result = process(*(tmp_path / name for name in names), code=code)
    assert (result.out.split(), result.err) == (["refused"] * 4, "")


@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_permissions_follow_the_umask(tmp_path, mask, mode):
    (tmp_path / "a.exr").touch(mode=0o640)
    before = os.umask(mask)
    try:
        write_image(tmp_path / "a.exr", np.ones((2, 4, 3)))
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.exr").stat().st_mode) == mode


def test_image_is_written_whole(tmp_path):
    pixels = np.random.default_rng(1).uniform(0, 3, (4, 8, 3))
    recipe = json.dumps({"probe": "x"})
    written = write_image(
        tmp_path / "a.exr", pixels, attributes={"shrm:recipe": recipe, "chromaticities": P3}
    )
    assert written == "half"
    header, channels = parts(tmp_path / "a.exr")
    assert header["shrm:recipe"] == recipe
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    for k, colour in enumerate("RGB"):
        np.testing.assert_array_equal(channels[colour], pixels[..., k].astype(np.float16))


def test_print_options_of_numpy_change_no_file(tmp_path):
    with np.printoptions(precision=2):
        random_map().save(tmp_path / "one.exr")
        read = open_map(tmp_path / "one.exr")
    assert read.info.eps == open_map(tmp_path / "one.exr").info.eps
    with np.printoptions(legacy="1.13"):
        assert open_map(tmp_path / "one.exr").info == read.info
