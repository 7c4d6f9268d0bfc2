"""Tables over half and difference angles: coordinates, interpolation, files, hostile files."""

import contextlib
import io
import json
import os
import struct
import tracemalloc
import zipfile

import numpy as np
import OpenEXR
import pytest
from scipy.spatial.transform import Rotation

from shrm_cli.brdf.measured import table
from shrm_cli.brdf.measured.table import SHAPE, Table, TableSettings, sample_table, write_table
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.brdf.vectors import from_half_angles, half_angles
from shrm_cli.errors import BrdfError, OutputError
from tests.brute_force import unit

AXES = (np.linspace(0, 1.5, 4), np.linspace(0, 1.5, 3), np.linspace(0, 3.1, 5))


def coordinates(light, view):
    """theta_h, theta_d, phi_d of single directions, by rotating the half vector to the pole."""
    half = (light + view) / np.linalg.norm(light + view)
    theta, phi = np.arccos(np.clip(half[2], -1, 1)), np.arctan2(half[1], half[0])
    turned = Rotation.from_euler("zy", [-phi, -theta]).apply(light)
    return theta, np.arccos(np.clip(turned[2], -1, 1)), np.arctan2(turned[1], turned[0])


def hemisphere(rng, count, lowest=0.0):
    directions = unit(rng, 6 * count)
    return directions[directions[:, 2] > lowest][:count]


def test_angles_are_those_of_the_light_turned_with_the_half_vector(rng):
    lights, views = unit(rng, 200), unit(rng, 200)
    theta_h, theta_d, phi_d = half_angles(lights, views)
    for k in range(200):
        expected = coordinates(lights[k], views[k])
        assert np.allclose((theta_h[k], theta_d[k]), expected[:2], atol=1e-6)
        assert np.isclose(phi_d[k], expected[2], atol=1e-6)


def test_directions_have_the_angles_that_they_were_made_from(rng):
    angles = rng.uniform(0.05, 1.5, (2, 100)), rng.uniform(0.05, 3.1, 100)
    light, view = from_half_angles(*angles[0], angles[1])
    for found, expected in zip(half_angles(light, view), (*angles[0], angles[1]), strict=True):
        assert np.allclose(found, expected, atol=1e-9)
    assert np.allclose(np.linalg.norm(light, axis=-1), 1)
    assert np.allclose(np.linalg.norm(view, axis=-1), 1)


def test_small_angles_keep_their_precision():
    light, view = from_half_angles(np.array([1e-7]), np.array([0.7]), np.array([1.0]))
    theta_h, theta_d, phi_d = half_angles(light, view)
    assert np.allclose(theta_h, 1e-7, rtol=1e-6)
    assert np.allclose((theta_d, phi_d), [[0.7], [1.0]], atol=1e-6)


def test_functions_linear_in_each_angle_are_reproduced(rng):
    def function(a, b, c):
        parts = [1 + a + 0.5 * b * c, 2 + a * b, 3 + 0.3 * c - 0.2 * a * b * c]
        return np.stack(np.broadcast_arrays(*parts), axis=-1)

    values = function(*np.meshgrid(*AXES, indexing="ij"))
    light, view = from_half_angles(*rng.uniform(0.02, 0.7, (2, 300)), rng.uniform(0, 3.1, 300))
    expected = [
        function(h, d, abs(p)) for h, d, p in map(coordinates, light, view)
    ]  # fmt: skip
    assert np.allclose(Table(values, AXES).evaluate(light, view), expected, rtol=2e-6)


@pytest.mark.parametrize(
    ("spec", "tolerance"),
    [
        ("lambertian:albedo=0.4", 1e-7),
        ("microfacet:sigma=0.05", 2e-3),
        ("ggx:roughness=0.3,f0=gold", 0.01),
        ("phong:exponent=100", 2e-3),
        ("oren-nayar:sigma=0.5", 0.01),
    ],
)
def test_tables_are_near_the_model_that_they_are_of(rng, spec, tolerance):
    model = parse_spec(spec)
    table = sample_table(model)
    assert table.table.shape[:3] == SHAPE
    view = hemisphere(rng, 20000, 0.1)
    # Half vectors at all scales, so that the lobe's peak is met.
    tilt, turn = 10 ** rng.uniform(-3, 0.1, len(view)), rng.uniform(0, 2 * np.pi, len(view))
    half = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], -1)
    light = 2 * np.sum(half * view, axis=-1, keepdims=True) * half - view
    light, view = light[light[:, 2] > 0.1], view[light[:, 2] > 0.1]
    expected, found = model.transfer(light, view), table.transfer(light, view)
    assert np.sqrt(np.sum((found - expected) ** 2) / np.sum(expected**2)) < tolerance
    assert (table.center, table.includes_cosine, table.has_horizon) == (
        (model.center, model.includes_cosine, model.has_horizon)
    )


def test_coefficients_are_near_those_of_the_model():
    model = parse_spec("ggx:roughness=0.6")
    one, other = (compute_coefficients(b, 24, 4, 1e-4) for b in (model, sample_table(model)))
    difference = np.sum((one.values - other.values) ** 2) / np.sum(one.values**2)
    assert np.sqrt(difference) < 0.005


def test_a_fibre_is_a_function_around_its_tangent(rng):
    model = parse_spec("kajiya-kay")
    light, view = unit(rng, 5000), unit(rng, 5000)
    table = sample_table(model)
    assert table.center == "tangent"
    expected = model.evaluate(light, view)
    error = np.sum((table.evaluate(light, view) - expected) ** 2) / np.sum(expected**2)
    assert np.sqrt(error) < 0.01


def test_lobes_below_the_horizon_stay_and_others_end_there(rng):
    light = unit(rng, 500) * [1, 1, -1]
    light[:, 2] = -abs(light[:, 2])
    view = hemisphere(rng, 500)
    assert not sample_table(parse_spec("ggx"), (8, 6, 4)).evaluate(light, view).any()
    assert not sample_table(parse_spec("ggx"), (8, 6, 4)).evaluate(view, light).any()
    phong = parse_spec("phong:exponent=4")
    expected = phong.evaluate(light, view)
    assert expected.max() > 0.1
    assert np.allclose(sample_table(phong).evaluate(light, view), expected, atol=0.004)


def test_what_is_not_reciprocal_stays_so(rng):
    model = parse_spec("phong:exponent=8")
    light, view = hemisphere(rng, 1000, 0.2), hemisphere(rng, 1000, 0.2)

    class Physical(type(model)):
        def evaluate(self, light, view):
            return np.where(light[..., 2:] > 0, 1 + light[..., 2:], 0) * np.ones(3)

    table = sample_table(Physical())
    assert np.allclose(table.evaluate(light, view), 1 + light[:, 2:], atol=0.01)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_values_are_finite_everywhere_and_keep_their_type(rng, dtype):
    table = sample_table(parse_spec("ggx:f0=copper"), (8, 6, 4))
    light = unit(rng, 300).astype(dtype)
    light[:6] = np.concatenate([np.eye(3), -np.eye(3)])
    for view in (light, -light, np.roll(light, 7, axis=0), light[2]):
        value = table.evaluate(light, view)
        assert value.dtype == dtype
        assert value.shape == light.shape
        assert np.isfinite(value).all()
        assert (value >= 0).all()
    assert table.evaluate(light[:, None], light).shape == (300, 300, 3)


def test_grey_tables_give_a_broadcast_view(rng):
    table = sample_table(parse_spec("ggx"), (8, 6, 4))
    assert table.table.shape == (8, 6, 4, 1)
    assert table.evaluate(unit(rng, 5), unit(rng, 5)).strides[-1] == 0


def test_negative_values_are_noise():
    values = np.full((4, 3, 5, 1), -0.2)
    values[0] = 1
    assert Table(values, AXES).table.min() == 0


def test_tables_in_memory_are_identified_by_their_values():
    models = [parse_spec(f"ggx:roughness={r},f0=0.1") for r in (0.3, 0.3, 0.4)]
    tables = [sample_table(model, (5, 4, 3)) for model in models]
    digests = [table.values["sha256"] for table in tables]
    assert digests[0] == digests[1] != digests[2]
    assert repr(tables[0]) == "table of ggx:roughness=0.3,f0=0.1"


def test_anisotropic_and_infinite_models_are_refused():
    with pytest.raises(BrdfError, match="anisotropic"):
        sample_table(parse_spec("ward:ax=0.1,ay=0.3"))
    with pytest.raises(ValueError, match="of shape"):
        Table(np.ones((4, 3, 5)), AXES)


# Files.


@pytest.fixture
def coloured():
    return sample_table(parse_spec("ggx:roughness=0.5,f0=gold"), (7, 5, 4))


@pytest.mark.parametrize("suffix", [".exr", ".npz", ".NPZ"])
def test_files_hold_a_table_exactly(tmp_path, coloured, suffix):
    paths = [tmp_path / f"{name}{suffix}" for name in "ab"]
    for path in paths:
        write_table(path, coloured)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    found = Table.open(paths[0])
    assert np.array_equal(found.table, coloured.table)
    for axis, expected in zip(found.axes, coloured.axes, strict=True):
        assert np.array_equal(axis, expected)
    assert found.settings == coloured.settings
    assert found.source == "made from ggx:roughness=0.5,f0=1/0.782/0.344"
    assert repr(found) == paths[0].name


@pytest.mark.parametrize("suffix", [".exr", ".npz"])
def test_settings_of_other_frames_are_kept(tmp_path, suffix):
    table = Table(np.ones((4, 3, 5, 1)), AXES, TableSettings("tangent", True, False, "hair"))
    write_table(tmp_path / f"t{suffix}", table)
    found = Table.open(tmp_path / f"t{suffix}")
    assert found.settings == table.settings
    assert (found.center, found.includes_cosine, found.has_horizon) == ("tangent", True, False)


def test_the_layout_of_an_exr(tmp_path, coloured):
    write_table(tmp_path / "t.exr", coloured)
    with OpenEXR.File(str(tmp_path / "t.exr"), separate_channels=True) as file:
        header, channels = file.header(), file.channels()
        stored = json.loads(header["shrm:brdf_table"])
        assert sorted(channels) == ["B", "G", "R"]
        green = channels["G"].pixels
        assert green.dtype == np.float32
    assert green.shape == (7, 20)
    assert green[3, 2 * 4 + 1] == coloured.table[3, 2, 1, 1]
    assert stored["axes"]["phi_d"] == coloured.axes[2].tolist()
    assert stored["version"] == 1
    assert stored["center"] == "reflection"


def save_npz(path, **changes):
    """A table by numpy alone; None leaves an array out."""
    arrays = {
        "values": np.ones((4, 3, 5, 3)),
        **dict(zip(("theta_h", "theta_d", "phi_d"), AXES, strict=True)),
    }
    arrays |= changes
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    return path


def test_an_archive_made_by_others_needs_no_settings(tmp_path, rng):
    values = np.asfortranarray(rng.uniform(size=(4, 3, 5, 1)).astype(">f4"))
    found = Table.open(save_npz(tmp_path / "t.npz", values=values))
    assert np.array_equal(found.table, values)
    assert found.settings == TableSettings()


def test_other_names_are_refused(tmp_path, coloured):
    with pytest.raises(OutputError, match=r"\.exr or \.npz"):
        write_table(tmp_path / "t.png", coloured)


def settings(**values):
    return np.array(json.dumps(values))


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"values": None}, "no array 'values'"),
        ({"phi_d": None}, "no array 'phi_d'"),
        ({"values": np.ones((4, 3, 5))}, "which is wrong"),
        ({"values": np.ones((4, 3, 5, 2))}, "do not fit"),
        ({"values": np.ones((4, 3, 6, 3))}, "do not fit"),
        ({"values": np.ones((4, 3, 5, 3), dtype=int)}, "int64"),
        ({"values": np.ones((4, 3, 5, 3), dtype=complex)}, "complex128"),
        ({"values": np.ones((4, 3, 5, 3), dtype=object)}, "object|not an array"),
        ({"values": np.full((4, 3, 5, 3), np.nan)}, "NaN"),
        ({"values": np.full((4, 3, 5, 3), np.inf)}, "infinite"),
        ({"values": np.full((4, 3, 5, 3), 1e300)}, "infinite"),
        ({"values": np.ones((0, 3, 5, 3)), "theta_h": np.ones(0)}, "theta_h"),
        ({"theta_h": np.array([0, 1, 1, 1.5])}, "ascending"),
        ({"theta_h": np.array([0, 1, np.nan, 1.5])}, "ascending"),
        ({"theta_d": np.array([0.0, 45, 90])}, "give radians"),
        ({"theta_d": np.array([[0.0, 1, 1.2]])}, "which is wrong"),
        ({"settings": np.array("[1]")}, "JSON object"),
        ({"settings": np.array("{" * 5000)}, "JSON object"),
        ({"settings": np.array("[" * 100000)}, "JSON object"),
        ({"settings": np.array(b"{}")}, "which is wrong"),
        ({"settings": settings(center="up")}, "settings are wrong"),
        ({"settings": settings(center=["up"])}, "settings are wrong"),
        ({"settings": settings(has_horizon="yes")}, "settings are wrong"),
        ({"settings": settings(made_from=3)}, "settings are wrong"),
        ({"settings": settings(version=2)}, "newer shrm"),
        ({"settings": np.array("x" * 300_000)}, "unpacks to|JSON"),
    ],
)
def test_bad_archives(tmp_path, changes, what):
    path = save_npz(tmp_path / "bad.npz", **changes)
    with pytest.raises(BrdfError, match=what) as caught:
        Table.open(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def archive_of(path, members, compression=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def npy(shape, content=b""):
    stream = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, header)
    return stream.getvalue() + content


def refused(path, what, most=3_000_000):
    """One line, and little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(BrdfError, match=what) as caught:
            Table.open(path)
        assert tracemalloc.get_traced_memory()[1] < most
    finally:
        tracemalloc.stop()
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_header_that_promises_too_much(tmp_path):
    axes = {f"{name}.npy": npy((1,), bytes(8)) for name in ("theta_h", "theta_d", "phi_d")}
    for shape in [(10**6, 10**6, 10**6, 3), (1, 1, 1, 3), (2**62, 2**62, 2**62, 3)]:
        path = archive_of(tmp_path / "t.npz", {**axes, "values.npy": npy(shape)})
        refused(path, "values.npy is truncated")
    path = archive_of(tmp_path / "t.npz", {**axes, "values.npy": npy((1, 1, -1, 3), bytes(24))})
    refused(path, "t.npz: ")
    for content in (b"", b"\x93NUMPY", b"\x93NUMPY\x01\0\xff\xff{", b"\x93NUMPY\x09\0", b"x" * 50):
        path = archive_of(tmp_path / "t.npz", {**axes, "values.npy": content})
        refused(path, "not an array")


@pytest.mark.parametrize(
    "header",
    [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (True,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1, ",
        "{'descr': '<f8', 'fortran_order': False, 'shape': ('a',), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1L,), }",
        "{'descr': '<f8', 'fortran_order': " + "(" * 300 + "}",
    ],
)
def test_headers_that_numpy_stumbles_over(tmp_path, header):
    """Numpy has Python parse their text; ``(True,)`` passed for a shape."""
    start = b"\x93NUMPY\x01\0" + struct.pack("<H", len(header)) + header.encode()
    members = {f"{name}.npy": npy((1,), bytes(8)) for name in ("theta_h", "theta_d", "phi_d")}
    members = {**members, "values.npy": npy((1, 1, 1, 3), bytes(24))}
    path = archive_of(tmp_path / "t.npz", {**members, "theta_h.npy": start + bytes(8)})
    refused(path, "not an array of numpy's")


@pytest.mark.parametrize("code", [0xD800, 0x110000, 0x7FFFFFFF])
def test_settings_that_are_no_text(tmp_path, code):
    path = save_npz(tmp_path / "t.npz", settings=settings(made_from="here"))
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    text = members["settings.npy"]
    members["settings.npy"] = text[:-4] + struct.pack("<I", code)
    refused(archive_of(path, members), "t.npz: ")


def test_names_of_members_that_are_no_text(tmp_path):
    path = save_npz(tmp_path / "t.npz")
    data = path.read_bytes().replace(b"theta_h.npy", b"theta\xff\xfe.npy"[:11])
    # Bit 11 of the flags says that names are UTF-8.
    changed = bytearray(data)
    at = changed.find(b"PK\x01\x02")
    while at >= 0:
        changed[at + 9] |= 8
        at = changed.find(b"PK\x01\x02", at + 4)
    path.write_bytes(changed)
    refused(path, "t.npz: ")


def test_a_name_that_is_no_text(tmp_path, coloured):
    """What maps record of it can be read again."""
    path = tmp_path / "a.exr"
    write_table(path, coloured)
    odd = os.fsdecode(os.fsencode(tmp_path) + b"/b\xff.npz")
    write_table(tmp_path / "b.npz", coloured)
    os.rename(tmp_path / "b.npz", odd)
    assert Table.open(odd).values["file"] == "b?.npz"


def test_an_archive_that_unpacks_to_too_much(tmp_path, monkeypatch):
    monkeypatch.setattr(table, "MOST_CELLS", 1000)
    zeros = npy((100, 100, 100, 3), bytes(24_000_000))
    members = {f"{name}.npy": npy((1,), bytes(8)) for name in ("theta_h", "theta_d", "phi_d")}
    path = archive_of(tmp_path / "t.npz", {**members, "values.npy": zeros})
    assert path.stat().st_size < 50_000
    refused(path, "unpacks to 24,000,")
    # Many cells in few bytes of settings and slack.
    path = save_npz(
        tmp_path / "u.npz", values=np.ones((1001, 1, 1, 1)), theta_h=np.linspace(0, 1, 1001),
        theta_d=np.zeros(1), phi_d=np.zeros(1),
    )  # fmt: skip
    refused(path, "1,001 values are more than 1,000")


def test_an_archive_whose_directory_lies(tmp_path):
    path = save_npz(tmp_path / "t.npz")
    content = bytearray(path.read_bytes())
    # The sizes of every member in the central directory, compressed and not.
    start = content.find(b"PK\x01\x02")
    while start >= 0:
        content[start + 20 : start + 28] = struct.pack("<II", 0xFFFFFF, 0xFFFFFF)
        start = content.find(b"PK\x01\x02", start + 4)
    path.write_bytes(content)
    refused(path, "t.npz: ", most=60_000_000)


@pytest.mark.parametrize("kept", [0.02, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("suffix", [".exr", ".npz"])
def test_truncated_files(tmp_path, coloured, suffix, kept):
    path = tmp_path / f"t{suffix}"
    write_table(path, coloured)
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    refused(path, "t.(exr|npz): (damaged|.*truncated)")


@pytest.mark.parametrize("suffix", [".exr", ".npz"])
def test_damaged_files_are_refused_or_read(tmp_path, coloured, suffix, rng):
    path = tmp_path / f"t{suffix}"
    write_table(path, coloured)
    content = path.read_bytes()
    for position in rng.integers(0, len(content), 150):
        damaged = bytearray(content)
        damaged[position] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        with contextlib.suppress(BrdfError):
            assert np.isfinite(Table.open(path).table).all()


def save_exr(path, pixels, text):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    if text is not None:
        header["shrm:brdf_table"] = text
    names = "RGB" if pixels.shape[-1] == 3 else "Y"
    planes = {c: np.ascontiguousarray(pixels[..., k]) for k, c in enumerate(names)}
    OpenEXR.File(header, planes).write(str(path))
    return path


def described(**changes):
    axes = {n: a.tolist() for n, a in zip(("theta_h", "theta_d", "phi_d"), AXES, strict=True)}
    return json.dumps({"axes": axes, **changes})


ONES = np.ones((4, 15, 3), dtype=np.float32)


@pytest.mark.parametrize(
    ("pixels", "text", "what"),
    [
        (ONES, None, "an image, but not a table"),
        (ONES, "nonsense", "JSON object"),
        (ONES, "{}", "lacks the axes"),
        (ONES, described(axes=3), "lacks the axes"),
        (ONES, described(axes={"theta_h": [0, 1]}), "lacks the axes"),
        (ONES, described(axes={"theta_h": [[0]], "theta_d": ["a"], "phi_d": [{}]}), "ascending"),
        (ONES, described(axes={"theta_h": [10**400], "theta_d": [0], "phi_d": [0]}), "JSON"),
        (ONES[:3], described(), "do not fit"),
        (ONES[:, :14], described(), "do not fit"),
        (ONES[..., :1], described(), "not R, G and B"),
        (np.where(np.arange(3) == 1, np.nan, ONES), described(), "NaN"),
        (ONES, described(center="nowhere"), "settings are wrong"),
        (ONES, described(version=99), "newer shrm"),
    ],
)
def test_bad_images(tmp_path, pixels, text, what):
    refused(save_exr(tmp_path / "bad.exr", pixels.astype(np.float32), text), what)


def test_axes_end_where_they_may_but_for_rounding(tmp_path):
    for beyond, is_sound in ((0.8e-6, True), (1.3e-6, False)):
        axes = {"theta_h": [0, 0.1, 0.5, 1], "theta_d": [-beyond, 1, np.pi / 2 + beyond],
                "phi_d": [0, 1, 2, 3, np.pi + beyond]}  # fmt: skip
        path = save_exr(tmp_path / "t.exr", ONES, described(axes=axes))
        if is_sound:
            assert Table.open(path).table.shape == (4, 3, 5, 1)
        else:
            refused(path, "give radians, 0 .. ")


def test_images_of_others_are_read(tmp_path):
    found = Table.open(save_exr(tmp_path / "t.exr", ONES, described()))
    assert found.table.shape == (4, 3, 5, 1)
