"""Files of explicit and of compressed maps: names, attributes, and what is not believed."""

import json
import os
import struct
from dataclasses import replace

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

from shrm_cli.errors import OutputError
from shrm_cli.maps.explicit.views import Cabral, KautzMcCool, LightField
from shrm_cli.maps.file import is_map, open_map
from shrm_cli.maps.shrm.shrm import CompressedShrm
from tests.cli.helpers import process
from tests.maps.damage import refused, survives_flipped_bits
from tests.maps.scenes import make_shrm, relative_rms, uniform_points

P3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
GOLDEN = (1 + np.sqrt(5)) / 2

MAKERS = {
    "cabral": Cabral.from_shrm,
    "kautz-mccool": lambda shrm: KautzMcCool.from_shrm(shrm, 4),
    "kautz-mccool of 1": lambda shrm: KautzMcCool.from_shrm(shrm, 1),
    "kautz-mccool of 101": lambda shrm: KautzMcCool.from_shrm(shrm, 101),
    "lightfield": lambda shrm: LightField.from_shrm(shrm, 3),
    "lightfield of 1": lambda shrm: LightField.from_shrm(shrm, 1),
    "compressed": lambda shrm: CompressedShrm.from_shrm(shrm, 4),
}
NAMES = {
    "cabral": [f"view{k:02d}" for k in range(12)],
    "kautz-mccool": ["slice00", "slice01", "slice02", "slice03"],
    "kautz-mccool of 1": ["slice00"],
    "kautz-mccool of 101": [f"slice{k:02d}" for k in range(101)],
    "lightfield": [f"view{j:02d}_{k:02d}" for j in range(3) for k in range(3)],
    "lightfield of 1": ["view00_00"],
}
FOUR = ["cabral", "kautz-mccool", "lightfield", "compressed"]


def make(name, **options):
    return MAKERS[name](make_shrm(**{"size": 4, **options}))


def stored_values(made):
    return made.components if isinstance(made, CompressedShrm) else made.images


def parts(path):
    """Header and channels of each part, as OpenEXR finds them."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return [
            (
                {k: v for k, v in part.header.items() if k not in ("channels", "chunkCount")},
                {name: channel.pixels for name, channel in part.channels.items()},
            )
            for part in file.parts
        ]


def write_parts(path, made):
    """A file of headers and channels; None removes an attribute."""
    kept = [
        OpenEXR.Part({k: v for k, v in header.items() if v is not None}, channels)
        for header, channels in made
    ]
    OpenEXR.File(kept).write(str(path))
    return path


@pytest.fixture
def damaged(tmp_path):
    """Write a sound map with its parts changed by a function."""

    def write(name, change):
        make(name).save(tmp_path / "sound.exr")
        return write_parts(tmp_path / "damaged.exr", change(parts(tmp_path / "sound.exr")))

    return write


# ---- what is read is what was written --------------------------------------------------------


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("name", MAKERS)
def test_float_is_read_back_exactly(tmp_path, name, sampling):
    made = make(name, size=3, sampling=sampling, center="normal")
    assert made.save(tmp_path / "a.exr", "float") == "float"
    back = open_map(tmp_path / "a.exr")
    assert type(back) is type(made)
    np.testing.assert_array_equal(stored_values(back), stored_values(made).astype(np.float32))
    assert (back.center, back.sampling, back.frame) == ("normal", sampling, made.frame)
    assert back.info == replace(made.info, added_error=back.info.added_error)
    assert back.info.added_error == pytest.approx(made.info.added_error, rel=1e-6)
    if isinstance(made, CompressedShrm):
        np.testing.assert_allclose(back.matrix, made.matrix, atol=1e-7)
    points = uniform_points(100)
    assert relative_rms(back.radiance(*points), made.radiance(*points)) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", MAKERS)
def test_half_is_read_back_to_its_precision(tmp_path, name):
    made = make(name)
    assert made.save(tmp_path / "a.exr") == "half"
    back = open_map(tmp_path / "a.exr")
    np.testing.assert_allclose(stored_values(back), stored_values(made), rtol=5e-4, atol=1e-7)
    assert np.abs(stored_values(back) - stored_values(made)).max() > 0
    points = uniform_points(100)
    assert relative_rms(back.radiance(*points), made.radiance(*points)) < 5e-4


@pytest.mark.parametrize("frame", ["global", "local"])
def test_frames_of_compressed_maps(tmp_path, frame):
    made = make("compressed", frame=frame)
    made.save(tmp_path / "a.exr", "float")
    assert open_map(tmp_path / "a.exr").frame == frame


@pytest.mark.parametrize("name", FOUR)
def test_what_a_map_remembers_is_read_back(tmp_path, name):
    info = replace(
        make_shrm().info,
        probe="prö be.exr",
        added_error=0.25,
        fit_residual=0.0123,
        domain="angular",
        chromaticities=P3,
    )
    replace(make(name), info=info).save(tmp_path / "a.exr")
    back = open_map(tmp_path / "a.exr").info
    assert back == replace(info, chromaticities=back.chromaticities)
    assert back.chromaticities == pytest.approx(P3, rel=1e-6)


@pytest.mark.parametrize("name", FOUR)
def test_one_precision_for_all_parts(tmp_path, name):
    """Where a single value of the last part overflows half, every part is float."""
    made = make(name)
    stored_values(made)[-1, 0, 0, 0] = 1e6
    with pytest.raises(OutputError, match="overflows half"):
        made.save(tmp_path / "a.exr", "half")
    assert list(tmp_path.iterdir()) == []
    assert made.save(tmp_path / "a.exr") == "float"
    for _, channels in parts(tmp_path / "a.exr"):
        assert {pixels.dtype for pixels in channels.values()} == {np.dtype(np.float32)}


@pytest.mark.parametrize("name", FOUR)
def test_bytes_are_the_same_each_time(tmp_path, name):
    for file in "ab":
        make(name, size=8).save(tmp_path / f"{file}.exr")
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(("order_p", "t"), [(1, 10), (2, 20), (3, 30)])
def test_light_fields_in_half_hold_the_shrm(tmp_path, order_p, t):
    """At the default T = 10 P: rounding averages out over the many images."""
    shrm = make_shrm(order_p=order_p, size=8, dtype=np.float32)
    assert LightField.from_shrm(shrm).save(tmp_path / "a.exr") == "half"
    stored = open_map(tmp_path / "a.exr")
    assert stored.count == t**2
    back = stored.to_shrm()
    error = relative_rms(back.coefficients, shrm.coefficients)
    print(
        f"P = {order_p}, T = {t}: relative RMS {error:.1e}, residual {back.info.fit_residual:.1e}"
    )
    assert error < 1e-4
    assert 1e-5 < back.info.fit_residual < 3e-4  # half's own rounding


@pytest.mark.parametrize("order_p", [1, 2, 3])
def test_the_least_light_fields_hold_the_shrm(tmp_path, order_p):
    """At T = 2 P + 1 little averages out; in float nothing needs to."""
    shrm = make_shrm(order_p=order_p, size=8, dtype=np.float32)
    made = LightField.from_shrm(shrm, 2 * order_p + 1)
    for precision, most in (("float", 1e-6), ("half", 2e-4)):
        made.save(tmp_path / "a.exr", precision)
        back = open_map(tmp_path / "a.exr").to_shrm()
        assert relative_rms(back.coefficients, shrm.coefficients) < most


# ---- names and attributes --------------------------------------------------------------------


def expected_views(name):
    """What the files must say of their views, by formulas again."""
    if name == "cabral":
        return None
    t = {"lightfield": 3, "lightfield of 1": 1}[name]
    steps = (np.arange(t) + 0.5) / t
    return [
        (np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a))
        for a in np.pi * steps
        for b in 2 * np.pi * steps - np.pi
    ]


@pytest.mark.parametrize("name", NAMES)
def test_names_of_parts_and_channels(tmp_path, name):
    make(name).save(tmp_path / "a.exr")
    found = parts(tmp_path / "a.exr")
    assert [header["name"] for header, _ in found] == NAMES[name]
    for header, channels in found:
        assert channels.keys() == set("RGB")
        assert header["compression"] == OpenEXR.ZIP_COMPRESSION
        assert {pixels.shape for pixels in channels.values()} == {(24, 4)}


@pytest.mark.parametrize("name", NAMES)
def test_images_are_in_their_parts(tmp_path, name):
    made = make(name)
    made.save(tmp_path / "a.exr", "float")
    for image, (_, channels) in zip(made.images, parts(tmp_path / "a.exr"), strict=True):
        stacked = np.stack([channels[c] for c in "RGB"], axis=-1)
        np.testing.assert_array_equal(stacked, image.astype(np.float32))


def test_channels_of_compressed_maps(tmp_path):
    made = make("compressed")
    made.save(tmp_path / "a.exr", "float")
    [(header, channels)] = parts(tmp_path / "a.exr")
    assert channels.keys() == {f"pc{k:03d}.{c}" for k in range(4) for c in "RGB"}
    for k in range(4):
        for n, c in enumerate("RGB"):
            expected = made.components[:, :, k, n].astype(np.float32)
            np.testing.assert_array_equal(channels[f"pc{k:03d}.{c}"], expected)
    matrix = np.array(json.loads(header["shrm:pca_matrix"]))
    np.testing.assert_allclose(matrix, made.matrix, rtol=1e-6)


def test_cabral_views(tmp_path):
    """The twelve permutations of (0, +-1, +-golden) around the axes, one each."""
    make("cabral").save(tmp_path / "a.exr")
    found = np.array([header["shrm:view"] for header, _ in parts(tmp_path / "a.exr")])
    corners = [np.roll((0, a, b * GOLDEN), k) for a in (1, -1) for b in (1, -1) for k in range(3)]
    expected = np.array(corners) / np.hypot(1, GOLDEN)
    distances = np.linalg.norm(found[:, None] - expected, axis=-1)
    assert distances.min(axis=1).max() < 1e-6
    assert sorted(distances.argmin(axis=1)) == list(range(12))


@pytest.mark.parametrize("name", ["lightfield", "lightfield of 1"])
def test_light_field_views(tmp_path, name):
    make(name).save(tmp_path / "a.exr")
    found = [header["shrm:view"] for header, _ in parts(tmp_path / "a.exr")]
    np.testing.assert_allclose(found, expected_views(name), atol=1e-6)


@pytest.mark.parametrize(("name", "count"), [("kautz-mccool", 4), ("kautz-mccool of 101", 101)])
def test_kautz_mccool_angles(tmp_path, name, count):
    make(name).save(tmp_path / "a.exr")
    found = [header["shrm:theta_o"] for header, _ in parts(tmp_path / "a.exr")]
    np.testing.assert_allclose(found, np.linspace(0, np.pi, count), rtol=1e-6)
    assert all("shrm:view" not in header for header, _ in parts(tmp_path / "a.exr"))


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("name", MAKERS)
def test_attributes_are_on_every_part(tmp_path, name, sampling):
    """For OpenEXR, and for OpenImageIO, which calls parts subimages."""
    made = make(name, sampling=sampling)
    made = replace(made, info=replace(made.info, fit_residual=0.5, domain="angular"))
    made.save(tmp_path / "a.exr")
    expected = {
        "shrm:representation": made.representation,
        "shrm:frame": "local" if "kautz" in name else "global",
        "shrm:center": "reflection",
        "shrm:F": 4,
        "shrm:P": 2,
        "shrm:epsilon": pytest.approx(0.03),
        "shrm:brdf_energy_captured": pytest.approx(0.975),
        "shrm:predicted_error": pytest.approx(0.125),
        "shrm:brdf": '{"name": "phong", "parameters": {"exponent": 8.0}}',
        "shrm:probe": "p.exr",
        "shrm:probe_sha256": "ab" * 32,
        "shrm:version": 2 if name == "compressed" else 1,
        "shrm:added_error": pytest.approx(made.info.added_error),
        "shrm:fit_residual": pytest.approx(0.5),
        "shrm:domain": "angular",
    }
    found = parts(tmp_path / "a.exr")
    assert len(found) == len(NAMES.get(name, [""]))
    for header, _ in found:
        assert {key: header[key] for key in expected} == expected
        assert ("envmap" in header) == (sampling == "border")
    source = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    for index in range(len(found)):
        assert source.seek_subimage(index, 0)
        spec = source.spec()
        assert {key: spec.getattribute(key) for key in expected} == expected
        assert (spec.width, spec.height) == (4, 24)
        if name in NAMES:
            assert spec.getattribute("oiio:subimagename") == NAMES[name][index]
            assert sorted(spec.channelnames) == ["B", "G", "R"]
    assert not source.seek_subimage(len(found), 0)


def test_the_order_of_parts_is_that_of_their_names(tmp_path, damaged):
    """Parts in another order are the same map."""
    for name in NAMES:
        back = open_map(damaged(name, lambda made: made[::-1]))
        np.testing.assert_array_equal(back.images, open_map(tmp_path / "sound.exr").images)


@pytest.mark.parametrize("name", FOUR)
def test_is_map(tmp_path, name):
    make(name).save(tmp_path / "a.exr")
    assert is_map(tmp_path / "a.exr")


# ---- what is not believed --------------------------------------------------------------------


@pytest.mark.parametrize("name", ["cabral", "lightfield"])
@pytest.mark.parametrize("missing", [0, 3, -1])
def test_missing_parts(damaged, name, missing):
    def change(made):
        del made[missing]
        return made

    refused(damaged(name, change), f"its parts are not those of a {name} map")


@pytest.mark.parametrize("missing", [0, 2])
def test_missing_slices(damaged, missing):
    def change(made):
        del made[missing]
        return made

    refused(damaged("kautz-mccool", change), "its parts are not those of a kautz-mccool map")


@pytest.mark.parametrize("name", ["cabral", "kautz-mccool", "lightfield"])
@pytest.mark.parametrize(
    "other", ["view99", "slice4", "Slice00", "sh", "view00_3", "ä\nö", "x" * 9999]
)
def test_renamed_parts(damaged, name, other):
    def change(made):
        made[1][0]["name"] = other
        return made

    refused(damaged(name, change), "its parts are not those of a")


@pytest.mark.parametrize("name", ["cabral", "kautz-mccool", "lightfield"])
def test_duplicate_parts(tmp_path, name):
    """No library writes them: the name is changed in the file."""
    make(name).save(tmp_path / "a.exr")
    data = (tmp_path / "a.exr").read_bytes()
    first, second = (
        b"name\0string\0" + struct.pack("<i", len(part)) + part.encode() for part in NAMES[name][:2]
    )
    assert data.count(second) == 1
    (tmp_path / "a.exr").write_bytes(data.replace(second, first))
    refused(tmp_path / "a.exr", "its parts are not those of a")


@pytest.mark.parametrize("name", ["cabral", "kautz-mccool", "lightfield"])
def test_one_part_too_many(damaged, name):
    def change(made):
        return [*made, ({**made[0][0], "name": "more"}, made[0][1])]

    refused(damaged(name, change), "its parts are not those of a")


@pytest.mark.parametrize(
    ("name", "claim"),
    [
        ("cabral", "lightfield"), ("cabral", "kautz-mccool"), ("lightfield", "cabral"),
        ("kautz-mccool", "lightfield"), ("compressed", "cabral"), ("compressed", "kautz-mccool"),
        ("compressed", "lightfield"),
    ],
)  # fmt: skip
def test_another_representation(damaged, name, claim):
    def change(made):
        return [({**header, "shrm:representation": claim}, channels) for header, channels in made]

    refused(damaged(name, change), f"its parts are not those of a {claim} map")


@pytest.mark.parametrize("name", ["cabral", "kautz-mccool", "lightfield"])
def test_an_explicit_map_is_no_shrm(damaged, name):
    def change(made):
        return [({**header, "shrm:representation": "shrm"}, channels) for header, channels in made]

    refused(damaged(name, change), "its parts are not the terms of an SHRM")


@pytest.mark.parametrize(
    ("name", "attribute", "value"),
    [
        ("cabral", "shrm:view", (0.0, 0.0, 1.0)),
        ("lightfield", "shrm:view", None),
        ("kautz-mccool", "shrm:theta_o", 0.123),
        ("kautz-mccool", "shrm:theta_o", "one"),
    ],
)
def test_views_that_are_not_those_of_their_parts(damaged, name, attribute, value):
    def change(made):
        header, channels = made[-1]
        changed = {key: each for key, each in header.items() if key != attribute}
        return [*made[:-1], (changed | ({} if value is None else {attribute: value}), channels)]

    refused(damaged(name, change), attribute, "is wrong")


@pytest.mark.parametrize(
    ("name", "frame"), [("cabral", "local"), ("lightfield", "local"), ("kautz-mccool", "global")]
)
def test_frames_that_a_representation_has_not(damaged, name, frame):
    def change(made):
        return [({**header, "shrm:frame": frame}, channels) for header, channels in made]

    refused(damaged(name, change), f"a {name} map is {make(name).frame}")


def plane(value=0.5, dtype=np.float16, height=24):
    return np.full((height, 4), value, dtype=dtype)


@pytest.mark.parametrize("part", [0, -1])
@pytest.mark.parametrize(
    "channels",
    [
        {"R": plane(), "G": plane()},
        {"R": plane(), "G": plane(), "B": plane(), "A": plane()},
        {"X": plane(), "Y": plane(), "Z": plane()},
        {"R": plane(), "G": plane(), "b": plane()},
        {"Y": plane()},
        {c: plane(3, np.uint32) for c in "RGB"},
    ],
    ids=lambda channels: ",".join(channels),
)
@pytest.mark.parametrize("name", ["cabral", "kautz-mccool", "lightfield"])
def test_channels_must_be_colours(damaged, name, channels, part):
    def change(made):
        made[part] = (made[part][0], channels)
        return made

    refused(damaged(name, change), f"its channels are not those of a {name} map")


@pytest.mark.parametrize(
    "change",
    [
        lambda channels: {k: v for k, v in channels.items() if k != "pc003.B"},
        lambda channels: {**channels, "pc004.R": plane()},
        lambda channels: {**channels, "A": plane()},
        lambda channels: {k.replace("pc", "sh"): v for k, v in channels.items()},
        lambda channels: {k: v for k, v in channels.items() if "003" not in k},
        lambda channels: {k: plane(3, np.uint32) for k in channels},
    ],
)
def test_channels_must_be_components(damaged, change):
    path = damaged("compressed", lambda made: [(made[0][0], change(made[0][1]))])
    refused(path, "its channels are not those of an SHRM compressed to 4 components")


@pytest.mark.parametrize("part", [0, 2])
@pytest.mark.parametrize("name", ["cabral", "kautz-mccool", "lightfield"])
def test_parts_of_different_sizes(damaged, name, part):
    def change(made):
        header = {**made[part][0], "dataWindow": None}
        made[part] = (header, {c: np.zeros((18, 3), np.float16) for c in "RGB"})
        return made

    refused(damaged(name, change), "its parts differ in size")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", FOUR)
def test_values_must_be_finite(damaged, name, value):
    def change(made):
        for pixels in made[-1][1].values():
            pixels[17, 3] = value
        return made

    refused(damaged(name, change), "NaN or infinite")


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.6, 0.9, 0.999])
@pytest.mark.parametrize("name", FOUR)
def test_truncated_files(tmp_path, name, share):
    make(name, size=16).save(tmp_path / "a.exr")
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(data[: int(share * len(data))])
    refused(tmp_path / "a.exr", "damaged")


MATRIX = np.eye(9)[:4].tolist()


@pytest.mark.parametrize(
    "text",
    [
        json.dumps(np.eye(9)[:, :4].tolist()),
        json.dumps(np.eye(4).tolist()),
        json.dumps(np.eye(9)[0].tolist()),
        json.dumps(np.ones((10, 9)).tolist()),
        json.dumps([MATRIX]),
        json.dumps([*MATRIX[:3], [1.0] * 8]),
        json.dumps(MATRIX).replace("0.0", "NaN", 1),
        json.dumps(MATRIX).replace("0.0", "Infinity", 1),
        json.dumps(MATRIX).replace("0.0", "-1e999", 1),
        json.dumps(MATRIX).replace("0.0", "null", 1),
        json.dumps(MATRIX).replace("0.0", '"x"', 1),
        json.dumps(MATRIX).replace("0.0", "9" * 400, 1),
        json.dumps(MATRIX).replace("0.0", "9" * 5000, 1),
        json.dumps(MATRIX).replace("0.0", "{}", 1),
        json.dumps({"a": MATRIX}),
        json.dumps(MATRIX)[:-1],
        "[]", "[[]]", "[[], []]", "0", "null", "true", '"text"', "{}", "text", " ", "ä\n",
        "[" * 100_000,
        "[" * 40 + "1" + "]" * 40,
        "[" * 900 + "1" + "]" * 900,
        "[" + "[0]," * 200_000 + "[0]]",
        "[[" + "0," * 500_000 + "0]]",
    ],
    ids=lambda text: f"{text[:12]!r}..{len(text)}",
)  # fmt: skip
def test_matrices_that_are_none(damaged, text):
    def change(made):
        made[0][0]["shrm:pca_matrix"] = text
        return made

    refused(damaged("compressed", change), "shrm:pca_matrix is not K x 9 numbers; make it again")


@pytest.mark.parametrize("value", [None, "", "\0", 3, 2.5, (1.0, 2.0, 3.0), (1, 2)])
def test_without_a_matrix_components_are_no_shrm(damaged, value):
    def change(made):
        made[0][0]["shrm:pca_matrix"] = value
        return made

    refused(damaged("compressed", change))


def test_a_matrix_must_have_the_order(damaged):
    def change(made):
        made[0][0]["shrm:P"] = 1
        return made

    refused(damaged("compressed", change), "shrm:pca_matrix is not K x 4 numbers")


@pytest.mark.parametrize("name", FOUR)
@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        ("added_error", "much"), ("added_error", float("nan")), ("added_error", 1),
        ("fit_residual", float("inf")), ("fit_residual", "none"),
        ("domain", "time"), ("domain", 3), ("center", "sideways"), ("P", 33), ("P", None),
        ("version", None),
    ],
    ids=str,
)  # fmt: skip
def test_wrong_attributes(damaged, name, attribute, value):
    def change(made):
        made[0][0][f"shrm:{attribute}"] = value
        return made

    refused(damaged(name, change), f"shrm:{attribute} is missing or wrong")


@pytest.mark.proof
@pytest.mark.parametrize("name", FOUR)
def test_damage_anywhere_is_survived(tmp_path, name):
    """It gives a map or a MapError, and nothing else."""
    make(name, size=2).save(tmp_path / "a.exr")
    survives_flipped_bits(tmp_path / "a.exr", 500, seed=5)


PEAK = """
import sys
from shrm_cli.errors import MapError
from shrm_cli.maps.file import open_map
def peak():
    return int(open("/proc/self/status").read().split("VmHWM:")[1].split()[0])
before = peak()
for path in sys.argv[1:]:
    try:
        open_map(path)
    except MapError:
        print(peak() - before)
"""


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="no /proc to measure with")
@pytest.mark.parametrize("name", FOUR)
def test_hostile_sizes_allocate_nothing(tmp_path, name):
    """Headers that claim huge images, in every part."""
    make(name).save(tmp_path / "a.exr")
    data = (tmp_path / "a.exr").read_bytes()
    paths = []
    for width, height in ((512, 3072), (2048, 12288), (4096, 24576), (100_000, 600_000)):
        claim = bytearray(data)
        for window in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
            at = claim.find(window)
            while at >= 0:
                start = at + len(window) + 4
                struct.pack_into("<4i", claim, start, 0, 0, width - 1, height - 1)
                at = claim.find(window, start)
        paths.append(tmp_path / f"{width}.exr")
        paths[-1].write_bytes(claim)
        refused(paths[-1])
    result = process(*paths, code=PEAK)
    assert result.err == ""
    assert len(result.out.split()) == len(paths)
    assert int(result.out.split()[-1]) < 50_000  # kB


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="no /proc to measure with")
def test_parts_that_are_many_and_large_together(tmp_path):
    """Black images compress to little: 400 of 1024 texels would be 30 GB."""
    path = tmp_path / "a.exr"
    made = make("lightfield", size=2)
    replace(made, images=np.zeros((400, 12, 2, 3), np.float32)).save(path)
    data = bytearray(path.read_bytes())
    for window in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        at = data.find(window)
        while at >= 0:
            start = at + len(window) + 4
            struct.pack_into("<4i", data, start, 0, 0, 1023, 6143)
            at = data.find(window, start)
    path.write_bytes(data)
    refused(path)
    result = process(path, code=PEAK)
    assert result.err == ""
    assert int(result.out) < 50_000  # kB
