"""MERL tables against the format's own indexing, and a model that is written and read again."""

import hashlib
import tracemalloc

import numpy as np
import pytest

from shrm_cli.brdf.measured.merl import Merl, write_merl
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError
from tests.brute_force import unit

SCALES = np.array([1 / 1500, 1.15 / 1500, 1.66 / 1500])
HEADER = np.array([90, 90, 180], "<i4").tobytes()
CELLS = 90 * 90 * 180


def write(path, red, green, blue):
    """A file of three planes (90, 90, 180), as stored."""
    planes = [np.broadcast_to(p, (90, 90, 180)).astype("<f8").tobytes() for p in (red, green, blue)]
    path.write_bytes(HEADER + b"".join(planes))
    return path


def upper(rng, count):
    directions = unit(rng, count)
    directions[:, 2] = np.abs(directions[:, 2])
    return directions


def rusinkiewicz(light, view):
    """theta_h, theta_d, phi_d of one pair, with rotation matrices as in the 1998 paper."""
    half = (light + view) / np.linalg.norm(light + view)
    theta_h, phi_h = np.arccos(half[2]), np.arctan2(half[1], half[0])
    c, s = np.cos(-phi_h), np.sin(-phi_h)
    about_normal = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c, s = np.cos(-theta_h), np.sin(-theta_h)
    about_binormal = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    x, y, z = about_binormal @ about_normal @ light
    return theta_h, np.arccos(min(z, 1)), np.arctan2(y, x) % np.pi


def test_every_axis_is_where_the_format_has_it(tmp_path, rng):
    """Planes that hold each index are linear in the coordinate, with whole numbers + 1/2 at
    the centres of the cells into which MERL's reader truncates."""
    i, j, k = np.meshgrid(np.arange(90), np.arange(90), np.arange(180), indexing="ij")
    brdf = Merl.open(write(tmp_path / "ramps.binary", i + 0.5, j + 0.5, k + 0.5))
    light, view = upper(rng, 400), upper(rng, 400)
    found = brdf.evaluate(light, view) / SCALES
    checked = 0
    for k in range(400):
        theta_h, theta_d, phi_d = rusinkiewicz(light[k], view[k])
        expected = (
            np.clip(90 * np.sqrt(theta_h / (np.pi / 2)), 0.5, 89.5),
            np.clip(np.degrees(theta_d), 0.5, 89.5),
            np.degrees(phi_d),
        )
        np.testing.assert_allclose(found[k, :2], expected[:2], rtol=1e-5)
        if 0.5 < expected[2] < 179.5:  # between the last cell and the first it jumps
            assert found[k, 2] == pytest.approx(expected[2], rel=1e-5)
            checked += 1
    assert checked > 300


def test_the_difference_azimuth_goes_round(tmp_path):
    """Between phi_d of 179.5 and 180.5 degrees it goes from the last cell to the first."""
    k = np.arange(180.0)
    brdf = Merl.open(write(tmp_path / "k.binary", k, k, k))
    phi = np.radians([179.5, 179.75, 180, 180.25, 180.5, 0])
    theta_h, theta_d = 0.3, 0.4
    x, y, z = np.sin(theta_d) * np.cos(phi), np.sin(theta_d) * np.sin(phi), np.cos(theta_d)
    c, s = np.cos(theta_h), np.sin(theta_h)
    half = np.array([s, 0, c])
    light = np.stack([c * x + s * z, y, c * z - s * x], -1)
    view = 2 * (light @ half)[:, None] * half - light
    found = brdf.evaluate(light, view)[:, 0] / SCALES[0]
    np.testing.assert_allclose(found, [179, 179 * 0.75, 179 / 2, 179 / 4, 0, 179 / 2], atol=1e-3)


@pytest.fixture(scope="module")
def ggx(tmp_path_factory):
    path = tmp_path_factory.mktemp("merl") / "ggx.binary"
    model = parse_spec("ggx:roughness=0.5")
    write_merl(path, model)
    return model, path, Merl.open(path)


def test_a_model_comes_back_within_the_formats_resolution(ggx, rng):
    """Cells of a degree, and of two about grazing half vectors: there f_r changes by the inverse
    of the height, so that the error is about (1.9 degrees / elevation)^2 / 4."""
    model, path, brdf = ggx
    assert path.stat().st_size == 12 + 24 * CELLS
    light, view = upper(rng, 50000), upper(rng, 50000)
    expected, found = model.evaluate(light, view), brdf.evaluate(light, view)
    error = np.abs(found - expected)
    lowest = np.minimum(light[:, 2], view[:, 2])
    for height, bound in ((0.3, 0.005), (0.2, 0.01), (0.1, 0.035)):
        high = lowest > height
        assert (error[high] < bound * expected[high]).all()
    high = lowest > 0.05
    assert np.quantile(error[high] / expected[high], 0.99) < 0.012
    carried = light[:, 2:] * error, light[:, 2:] * expected
    assert np.linalg.norm(carried[0]) < 0.05 * np.linalg.norm(carried[1])
    assert not np.array_equal(found, expected)


def test_single_precision_stays_so(ggx, rng):
    brdf = ggx[2]
    light, view = upper(rng, 2000), upper(rng, 2000)
    double = brdf.evaluate(light, view)
    single = brdf.evaluate(light.astype("f4"), view.astype("f4"))
    assert (double.dtype, single.dtype) == (np.float64, np.float32)
    high = np.minimum(light[:, 2], view[:, 2]) > 0.05
    np.testing.assert_allclose(single[high], double[high], rtol=2e-3)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_it_is_finite_and_black_below_the_horizon(ggx, rng, dtype):
    special = np.array([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 0, -1], [1e-9, 0, 1]], dtype)
    light = np.concatenate([special, unit(rng, 200).astype(dtype)])
    found = ggx[2].evaluate(light[:, None], light[None, :])
    assert found.shape == (205, 205, 3)
    assert np.isfinite(found).all()
    above = (light[:, None, 2] > 0) & (light[None, :, 2] > 0)
    assert (found[~above] == 0).all()
    assert (found[above] > 0).all()


def test_reciprocal_and_the_same_from_every_side(ggx, rng):
    light, view = upper(rng, 300), upper(rng, 300)
    turn = np.array([[np.cos(2), -np.sin(2), 0], [np.sin(2), np.cos(2), 0], [0, 0, 1]])
    expected = ggx[2].evaluate(light, view)
    np.testing.assert_allclose(ggx[2].evaluate(view, light), expected, rtol=1e-6)
    np.testing.assert_allclose(ggx[2].evaluate(light @ turn.T, view @ turn.T), expected, rtol=1e-6)


def test_a_transfer_function_is_written_without_its_cosine(tmp_path):
    """The half in each order of light and view, as reciprocity has it."""
    path = tmp_path / "m.binary"
    model = parse_spec("microfacet:sigma=0.4")
    write_merl(path, model)
    light = np.array([[0.5, 0.1, np.sqrt(0.74)], [0.1, 0.0, np.sqrt(0.99)]])
    view = np.array([[-0.3, 0.2, np.sqrt(0.87)], [0.2, -0.1, np.sqrt(0.95)]])
    both = (1 / light[:, 2:] + 1 / view[:, 2:]) / 2
    expected = model.evaluate(light, view) * both
    np.testing.assert_allclose(Merl.open(path).evaluate(light, view), expected, rtol=2e-3)


def test_what_the_format_cannot_hold_is_refused(tmp_path):
    path = tmp_path / "x.binary"
    with pytest.raises(BrdfError, match="isotropic BRDFs about a normal"):
        write_merl(path, parse_spec("kajiya-kay"))
    brdf = parse_spec("lambertian")
    brdf.evaluate = lambda light, view: np.full(np.broadcast(light, view).shape, np.nan)
    with pytest.raises(BrdfError, match="not finite"):
        write_merl(path, brdf)
    assert list(tmp_path.iterdir()) == []


def test_invalid_cells_take_what_is_near_them(tmp_path, rng):
    """A hole in one plane is one in all; it takes values from between its rims."""
    i = np.broadcast_to(np.arange(90.0)[:, None, None], (90, 90, 180))
    red = i.copy()
    red[20:24, 10:50, 30:140] = -1
    green = np.full_like(red, 7.0)
    brdf = Merl.open(write(tmp_path / "hole.binary", red, green, i))
    x, y = np.moveaxis(rng.uniform(-0.1, 0.1, (2000, 2)), -1, 0)
    light = np.stack([0.3 + x, 0.3 + y, np.sqrt(1 - (0.3 + x) ** 2 - (0.3 + y) ** 2)], -1)
    view = np.stack([-0.2 + y, -0.3 + x, np.sqrt(1 - (-0.2 + y) ** 2 - (-0.3 + x) ** 2)], -1)
    found = brdf.evaluate(light, view) / SCALES
    np.testing.assert_allclose(found[:, 1], 7, rtol=1e-5)
    np.testing.assert_allclose(found[:, 0], found[:, 2], rtol=1e-5)
    expected = [
        90 * np.sqrt(rusinkiewicz(*pair)[0] * 2 / np.pi) for pair in zip(light, view, strict=True)
    ]
    inside = (np.array(expected) > 20) & (np.array(expected) < 24)
    assert inside.sum() > 100
    # A block of eight cells about the hole: no value from farther away.
    assert np.abs(found[:, 0] + 0.5 - np.maximum(expected, 0.5)).max() < 8


def test_a_file_is_identified_by_its_content(ggx):
    _, path, brdf = ggx
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert brdf.values == {"file": "ggx.binary", "sha256": digest}
    assert repr(brdf) == "ggx.binary"
    assert Merl.recognizes(HEADER)
    assert not Merl.recognizes(HEADER[:8])
    assert not Merl.recognizes(b"")


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "0 x 0 x 0"),
        (HEADER[:7], "not a MERL file"),
        (np.array([2**31 - 1] * 3, "<i4").tobytes() + bytes(99), "2147483647"),
        (np.array([-90, 90, 180], "<i4").tobytes() + bytes(99), "-90"),
        (np.array([90, 90, 360], "<i4").tobytes() + bytes(99), "90 x 90 x 360"),
        (HEADER, "12 bytes instead of 34,992,012"),
        (HEADER + bytes(99999), "100,011 bytes"),
    ],
)
def test_other_and_truncated_files_are_refused(tmp_path, content, word):
    path = tmp_path / "x.binary"
    path.write_bytes(content)
    tracemalloc.start()
    with pytest.raises(BrdfError, match=word) as caught:
        Merl.open(path)
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize("size", [12 + 24 * CELLS - 1, 12 + 24 * CELLS + 1, 2**40])
def test_other_sizes_are_refused(tmp_path, size):
    path = tmp_path / "x.binary"
    with open(path, "wb") as stream:
        stream.write(HEADER)
        stream.truncate(size)
    with pytest.raises(BrdfError, match="copy the file again"):
        Merl.open(path)


@pytest.mark.parametrize(
    ("value", "place", "word"),
    [
        (np.nan, 5, "not numbers"),
        (np.inf, 2 * CELLS + 1, "infinite"),
        (-np.inf, CELLS, "infinite"),
        (1e200, 3 * CELLS - 1, "beyond 1e"),
    ],
)
def test_values_that_are_none_are_refused(tmp_path, value, place, word):
    path = tmp_path / "x.binary"
    with open(path, "wb") as stream:
        stream.write(HEADER)
        stream.truncate(12 + 24 * CELLS)
        stream.seek(12 + 8 * place)
        stream.write(np.float64(value).tobytes())
    tracemalloc.start()
    with pytest.raises(BrdfError, match=word):
        Merl.open(path)
    assert tracemalloc.get_traced_memory()[1] < 5e7
    tracemalloc.stop()


def test_a_file_without_a_valid_cell_is_refused(tmp_path):
    with pytest.raises(BrdfError, match="all its cells are marked invalid"):
        Merl.open(write(tmp_path / "x.binary", -1, 1, 1))


def test_black_is_a_brdf(tmp_path, rng):
    brdf = Merl.open(write(tmp_path / "x.binary", 0, 0, 0))
    assert (brdf.evaluate(upper(rng, 9), upper(rng, 9)) == 0).all()
