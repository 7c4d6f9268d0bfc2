"""Irradiance maps in files: what is read is what was written, and contradictions are refused."""

import json

import numpy as np
import OpenEXR
import pytest

from shrm_cli.files.parts import Part, open_file, write_parts
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.irradiance.file import decode, encode
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.irradiance.window import Window, make_window
from shrm_cli.maps.stored import Arrangement
from tests import oracles
from tests.brute_force import unit
from tests.maps import damage
from tests.maps.damage import survives_flipped_bits

P3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
LAMBERT = {"name": "lambertian", "parameters": {"albedo": 1.0}}


def make(order=2, scale=1.0, window=None, **options):
    rng = np.random.default_rng(order)
    coefficients = rng.normal(size=((order + 1) ** 2, 3)) * scale
    coefficients[0] += 5 * scale
    info = MapInfo(order, 0, 0.0078125, 0.9921875, 0.0625, LAMBERT, "p.exr", "ab" * 32)
    if window is not None:
        made = make_window(":".join(map(str, window)), Irradiance(coefficients, info).series)
        return Irradiance(made.apply(coefficients), info, window=made, **options)
    return Irradiance(coefficients, info, **options)


def read(path):
    return decode(open_file(path))


def stored(path):
    """Header and channels that OpenEXR finds."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        header = {name: value for name, value in file.header().items() if name != "channels"}
        return header, {name: channel.pixels for name, channel in file.channels().items()}


@pytest.fixture
def changed(tmp_path):
    """Write a sound map with attributes and planes of it changed; None removes."""

    def write(made=None, planes=None, **attributes):
        (part,) = encode(made or make())
        header = part.header | {f"shrm:{name}": value for name, value in attributes.items()}
        kept = {name: value for name, value in header.items() if value is not None}
        channels = {
            name: plane for name, plane in {**part.channels, **(planes or {})}.items()
            if plane is not None
        }  # fmt: skip
        write_parts(tmp_path / "changed.exr", [Part(channels, kept)], "float")
        return tmp_path / "changed.exr"

    return write


def refused(path, *words):
    damage.refused(path, *words, read=read)


@pytest.mark.parametrize("precision", ["half", "float"])
@pytest.mark.parametrize("order", [0, 1, 2, 3, 20])
def test_coefficients_are_read_back_exactly(tmp_path, order, precision):
    made = make(order)
    write_parts(tmp_path / "a.exr", encode(made), precision)
    back = read(tmp_path / "a.exr")
    np.testing.assert_array_equal(back.coefficients, made.coefficients)
    assert (back.size, back.sampling, back.window) == (made.size, "center", Window())
    assert back.info == made.info
    normals = unit(np.random.default_rng(1), 9)
    np.testing.assert_array_equal(back.irradiance(normals), made.irradiance(normals))


@pytest.mark.parametrize("scale", [0.0, 1e-12, 1e-8, 1e-5, 1e6, 1e30])
def test_light_of_any_brightness(tmp_path, scale):
    made = make(2, scale)
    write_parts(tmp_path / "a.exr", encode(made), "auto")
    np.testing.assert_array_equal(read(tmp_path / "a.exr").coefficients, made.coefficients)


@pytest.mark.parametrize("window", [("hann", 3.0), ("lanczos", 2.123456789012345)])
def test_windows_are_read_back(tmp_path, window):
    made = make(3, window=window)
    write_parts(tmp_path / "a.exr", encode(made), "auto")
    assert read(tmp_path / "a.exr").window == made.window
    found = json.loads(stored(tmp_path / "a.exr")[0]["shrm:window"])
    assert (found["name"], found["width"]) == window
    assert found["factors"] == pytest.approx(list(made.window.factors), abs=0)


@pytest.mark.parametrize("factors", [(1, 0.942, 0.99, 0), (1.0, 1 / 3, 0.0, 1.0)])
def test_windows_without_a_width_are_read_back(tmp_path, factors):
    whole = make(3)
    window = Window.of(np.array(factors), whole.series)
    made = Irradiance(window.apply(whole.coefficients), whole.info, window=window)
    write_parts(tmp_path / "a.exr", encode(made), "auto")
    back = read(tmp_path / "a.exr")
    assert back.window == window
    assert back.window.factors == factors
    found = json.loads(stored(tmp_path / "a.exr")[0]["shrm:window"])
    assert (found["name"], found["width"], found["factors"]) == ("least", None, list(factors))


@pytest.mark.parametrize("sampling", ["center", "border"])
def test_what_the_file_holds(tmp_path, sampling):
    """As the contract says: an RGB cube of E(N), and JSON of nine colours and three matrices."""
    made = make(size=8, sampling=sampling)
    write_parts(tmp_path / "a.exr", encode(made), "float")
    header, channels = stored(tmp_path / "a.exr")
    assert sorted(channels) == ["B", "G", "R"]
    cube = np.stack([channels[c] for c in "RGB"], axis=-1)
    assert cube.shape == (48, 8, 3)
    normals = oracles.cube_texels(8, sampling).reshape(48, 8, 3)
    found = json.loads(header["shrm:lighting_coefficients"])
    np.testing.assert_array_equal(found, made.coefficients)
    matrices = np.array(json.loads(header["shrm:irradiance_matrices"]))
    points = np.concatenate([normals, np.ones((48, 8, 1))], axis=-1)
    by_matrices = np.einsum("rci,kij,rcj->rck", points, matrices, points)
    np.testing.assert_allclose(cube, by_matrices, rtol=1e-6, atol=1e-6)
    expected = {
        "representation": "irradiance", "version": 3, "frame": "global", "center": "normal",
        "F": 2, "P": 0, "probe": "p.exr", "probe_sha256": "ab" * 32,
    }  # fmt: skip
    assert {name: header[f"shrm:{name}"] for name in expected} == expected
    assert json.loads(header["shrm:brdf"]) == LAMBERT


def test_there_are_no_matrices_above_order_2(tmp_path):
    write_parts(tmp_path / "a.exr", encode(make(3)), "float")
    assert "shrm:irradiance_matrices" not in stored(tmp_path / "a.exr")[0]


def test_chromaticities_pass_through(tmp_path):
    made = make()
    object.__setattr__(made.info, "chromaticities", P3)
    write_parts(tmp_path / "a.exr", encode(made), "float")
    assert read(tmp_path / "a.exr").info.chromaticities == pytest.approx(P3, rel=1e-6)


@pytest.mark.parametrize("layout", ["strip", "hcross", "vcross", "latlong"])
def test_other_layouts(tmp_path, layout):
    """Laid out as `write_map` does it; the coefficients tell what there is."""
    made = make(size=8)
    (part,) = encode(made)
    arrangement = Arrangement(layout, "openexr" if layout == "latlong" else "gl")
    image = arrangement.apply(np.stack(list(part.channels.values()), axis=-1))
    header = part.header | {
        "shrm:layout": layout, "shrm:orientation": arrangement.orientation,
        "shrm:sampling": "center",
    }  # fmt: skip
    channels = {name: image[..., k] for k, name in enumerate("RGB")}
    write_parts(tmp_path / "a.exr", [Part(channels, header)], "half")
    back = read(tmp_path / "a.exr")
    np.testing.assert_array_equal(back.coefficients, made.coefficients)
    assert back.size == 8


def test_bytes_are_the_same_each_time_and_under_print_options(tmp_path):
    write_parts(tmp_path / "a.exr", encode(make()), "auto")
    with np.printoptions(precision=2, legacy="1.13"):
        write_parts(tmp_path / "b.exr", encode(make()), "auto")
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


NINE = make().coefficients.tolist()
MATRICES = make().matrices().tolist()


def text(values):
    return json.dumps(values)


@pytest.mark.parametrize(
    "value",
    [
        None, "", "nine", "{", "[" * 100_000, 7, (1.0, 2.0, 3.0), "[]", "9", "null", "{}",
        text(NINE[:8]), text([*NINE, [0, 0, 0]]), text([row[:2] for row in NINE]),
        text([*NINE[:8], [1, 2]]), text([*NINE[:8], [1, 2, "3"]]), text([*NINE[:8], [1, 2, None]]),
        text([*NINE[:8], [1, 2, float("nan")]]), text([*NINE[:8], [1, 2, float("inf")]]),
        text([*NINE[:8], [1, 2, 10**400]]), text([*NINE[:8], [True, {}, []]]),
    ],
    ids=lambda value: str(value)[-20:],
)  # fmt: skip
def test_coefficients_must_be_nine_colours(changed, value):
    refused(changed(lighting_coefficients=value), "shrm:lighting_coefficients", "9 x 3")


@pytest.mark.parametrize(
    ("value", "word"),
    [
        (None, "not 3 x 4 x 4"), ("[1]", "not 3 x 4 x 4"), (text(MATRICES[:2]), "not 3 x 4 x 4"),
        (text(np.full((3, 4, 4), np.nan).tolist()), "not 3 x 4 x 4"),
        (text(MATRICES[::-1]), "does not belong"),
        (text((np.array(MATRICES) / np.pi).tolist()), "does not belong"),
        (text((np.array(MATRICES) + 1e-6).tolist()), "does not belong"),
    ],
    ids=range(7),
)  # fmt: skip
def test_matrices_must_be_those_of_the_coefficients(changed, value, word):
    refused(changed(irradiance_matrices=value), "shrm:irradiance_matrices", word)


def test_coefficients_must_be_those_of_the_matrices(changed):
    other = text((make().coefficients * 1.001).tolist())
    refused(changed(lighting_coefficients=other), "does not belong to the coefficients")


def test_matrices_have_no_meaning_above_order_2(changed):
    refused(changed(make(3), irradiance_matrices=text(MATRICES)), "no meaning at order F = 3")


@pytest.mark.parametrize(
    "value",
    [
        None, "", "hann", "[]", "{}", "7", "[" * 100_000,
        *(
            json.dumps({"name": "hann", "width": 3.0, "factors": [1, 0.75, 0.25],
                        "energy_lost": 0.1, "change": 0.1} | wrong)
            for wrong in (
                {"name": "boxcar"}, {"name": ["hann"]}, {"name": None}, {"name": "none"},
                {"width": None}, {"width": 0}, {"width": -3.0}, {"width": "3"}, {"width": True},
                {"width": 10**400}, {"width": float("nan")}, {"width": 4.0},
                {"factors": [1, 0.75]}, {"factors": [1, 0.75, 0.5]}, {"factors": []},
                {"factors": None}, {"factors": [1, 0.75, [0.25]]}, {"factors": [1, 0.75, "x"]},
                {"factors": [1, 0.75, float("nan")]}, {"factors": {}},
                {"energy_lost": float("inf")}, {"change": "much"}, {"change": None},
                {"name": "least"}, {"name": None, "width": None}, {"width": None},
                *(
                    {"name": "least", "width": None, "factors": factors}
                    for factors in (
                        None, [], {}, [1, 0.5], [1, 0.5, 0.5, 0.5], [0.9, 0.5, 0.5], [1, 1.1, 0.5],
                        [1, -0.1, 0.5], [1, float("nan"), 0.5], [1, "0", 0.5], [1, None, 0.5],
                        [1, [0.5], 0.5], [True, 0.5, 0.5], [1, 10**400, 0.5], 1,
                    )
                ),
            )
        ),
    ],
    ids=lambda value: str(value)[:80],
)  # fmt: skip
def test_windows_must_be_sound(changed, value):
    refused(changed(window=value), "shrm:window")


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("frame", "local", ("shrm:frame", "global")),
        ("center", "reflection", ("shrm:center", "normal")),
        ("P", 1, ("shrm:P", "0")),
        ("F", 1, ("4 x 3",)),
        ("F", 512, ("263169 x 3",)),
        ("F", None, ("shrm:F",)),
        ("layout", "angular", ("not laid out",)),
        ("layout", "strip", ("is not strip",)),
    ],
)
def test_other_attributes(changed, name, value, words):
    refused(changed(**{name: value}), *words)


def plane(value=1.0, shape=(96, 16)):
    return np.full(shape, value, dtype=np.float32)


@pytest.mark.parametrize(
    "planes", [{"R": None}, {"A": plane()}, {"R": None, "sh000.R": plane()}], ids=str
)
def test_channels_must_be_rgb(changed, planes):
    refused(changed(planes=planes), "channels")


def test_shape_must_be_a_cube(changed):
    refused(changed(planes={c: plane(shape=(95, 16)) for c in "RGB"}), "16 x 95", "cube")


def test_pixels_must_be_those_of_the_coefficients(changed):
    """Exposure, swapped channels, another orientation: each shows something else."""
    (part,) = encode(make())
    r, g, b = (part.channels[c] for c in "RGB")
    for planes in (
        {"R": r * 1.01, "G": g * 1.01, "B": b * 1.01}, {"R": b, "B": r},
        {c: part.channels[c][::-1] for c in "RGB"}, {c: part.channels[c][:, ::-1] for c in "RGB"},
        {"G": plane(0.0)},
    ):  # fmt: skip
        refused(changed(planes=planes), "its pixels are not those")


def test_pixels_must_be_whole(tmp_path):
    write_parts(tmp_path / "a.exr", encode(make(24)), "float")
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(data[: len(data) - 2000])
    refused(tmp_path / "a.exr")


def test_there_is_one_part(tmp_path):
    (part,) = encode(make())
    parts = [Part(part.channels, part.header | {"name": name}) for name in "ab"]
    write_parts(tmp_path / "a.exr", parts, "float")
    refused(tmp_path / "a.exr", "one part")


@pytest.mark.slow
def test_every_flipped_byte_is_survived(tmp_path):
    """Damage anywhere gives a map or a MapError, and nothing else."""
    write_parts(tmp_path / "a.exr", encode(make(1, size=4)), "half")
    survives_flipped_bits(tmp_path / "a.exr", 300, least=100, read=read)
