"""Maps in other layouts: where each texel lies, and back again."""

import os
import struct
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps.explicit.views import Cabral, KautzMcCool, LightField
from shrm_cli.maps.file import open_map
from shrm_cli.maps.shrm.shrm import CompressedShrm
from tests import oracles
from tests.cli.helpers import process
from tests.maps.explicit.test_file import PEAK, parts, refused, stored_values, write_parts
from tests.maps.scenes import make_shrm, relative_rms, rms

CUBES = ["openexr", "strip", "hcross", "vcross"]
ORIENTATIONS = ["openexr", "gl"]

# Places (row, column) of the faces +X -X +Y -Y +Z -Z, in faces; -Z of a vertical cross is turned.
PLACES = {
    "openexr": [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0)],
    "strip": [(0, 0), (0, 1), (0, 2), (0, 3), (0, 4), (0, 5)],
    "hcross": [(1, 2), (1, 0), (0, 1), (2, 1), (1, 1), (1, 3)],
    "vcross": [(1, 2), (1, 0), (0, 1), (2, 1), (1, 1), (3, 1)],
}
SHAPES = {"openexr": (6, 1), "strip": (1, 6), "hcross": (3, 4), "vcross": (4, 3)}

MAKERS = {
    "shrm": lambda **options: make_shrm(**options),
    "local shrm": lambda **options: make_shrm(frame="local", **options),
    "compressed": lambda **options: CompressedShrm.from_shrm(make_shrm(**options), 3),
    "cabral": lambda **options: Cabral.from_shrm(make_shrm(**options)),
    "kautz-mccool": lambda **options: KautzMcCool.from_shrm(make_shrm(**options), 3),
    "lightfield": lambda **options: LightField.from_shrm(make_shrm(**options), 2),
    "zonal shrm": lambda **options: zonal(make_shrm(frame="local", **options)),
}
ANYWHERE = [name for name in MAKERS if name != "local shrm"]


def zonal(shrm):
    """Without all coefficients of azimuth."""
    kept = np.isin(np.arange(9), [0, 2, 6])
    return replace(shrm, coefficients=shrm.coefficients * kept[:, None])


def values_of(made):
    return made.coefficients if hasattr(made, "coefficients") else stored_values(made)


def light(directions):
    """Three channels without any symmetry."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([x + 2 * y - 3 * z, 2 + x * y - z, 1 + y + z * x * x], axis=-1)


@pytest.mark.parametrize(
    ("name", "layout", "orientation", "sampling"),
    [
        # Arranging does not know what it arranges: all arrangements of one kind, all kinds in one.
        *product(["lightfield"], CUBES, ORIENTATIONS, ["center", "border"]),
        *((name, "vcross", "gl", "border") for name in MAKERS if name != "lightfield"),
    ],
)
def test_cube_layouts_are_exact(tmp_path, name, layout, orientation, sampling):
    made = MAKERS[name](size=3, sampling=sampling)
    made.save(tmp_path / "a.exr", "float", layout, orientation)
    back = open_map(tmp_path / "a.exr")
    assert type(back) is type(made)
    np.testing.assert_array_equal(values_of(back), values_of(made).astype(np.float32))
    assert (back.size, back.sampling, back.frame) == (3, sampling, made.frame)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("orientation", ORIENTATIONS)
@pytest.mark.parametrize("layout", CUBES)
def test_texels_are_at_their_places(tmp_path, layout, orientation, sampling):
    size = 4
    texels = oracles.cube_texels(size, sampling).reshape(6 * size, size, 3)
    made = make_shrm(order_f=1, order_p=0, size=size, sampling=sampling)
    made = replace(made, coefficients=light(texels)[:, :, None])
    made.save(tmp_path / "a.exr", "float", layout, orientation)
    [(_, channels)] = parts(tmp_path / "a.exr")
    rows, columns = SHAPES[layout]
    expected = np.zeros((rows * size, columns * size, 3))
    faces = light(oracles.cube_texels(size, sampling, orientation))
    for k, ((row, column), face) in enumerate(zip(PLACES[layout], faces, strict=True)):
        turned = face[::-1, ::-1] if layout == "vcross" and k == 5 else face
        expected[row * size : (row + 1) * size, column * size : (column + 1) * size] = turned
    for k, c in enumerate("RGB"):
        np.testing.assert_allclose(channels[f"sh000.{c}"], expected[..., k], atol=1e-6)


@pytest.mark.parametrize("sampling", ["center", "border"])
def test_pixels_of_a_latlong_are_at_their_places(tmp_path, sampling):
    size = 32
    texels = oracles.cube_texels(size, sampling).reshape(6 * size, size, 3)
    made = make_shrm(order_f=1, order_p=0, size=size, sampling=sampling)
    made = replace(made, coefficients=light(texels)[:, :, None])
    made.save(tmp_path / "a.exr", "float", "latlong")
    [(_, channels)] = parts(tmp_path / "a.exr")
    expected = light(oracles.latlong_pixels(4 * size, 2 * size))
    found = np.stack([channels[f"sh000.{c}"] for c in "RGB"], axis=-1)
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, atol=5e-4)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("name", ANYWHERE)
def test_latlongs_hold_smooth_maps(tmp_path, name, sampling):
    """Degree F + P = 5: both ways the error of a cubic filter."""
    errors = {}
    for size in (12, 24):
        made = MAKERS[name](order_f=3, size=size, sampling=sampling)
        made.save(tmp_path / "a.exr", "float", "latlong")
        back = open_map(tmp_path / "a.exr")
        assert type(back) is type(made)
        assert (back.size, back.sampling, back.frame) == (size, sampling, made.frame)
        errors[size] = relative_rms(values_of(back), values_of(made))
    print(f"{name} {sampling}: {errors[12]:.1e} {errors[24]:.1e}")
    assert errors[24] < errors[12] / 6
    assert errors[24] < 3e-4
    worst = np.abs(values_of(back) - values_of(made)).max() / rms(values_of(made))
    assert worst < 5e-3


def test_azimuth_free_maps_stay_so_as_latlongs(tmp_path):
    MAKERS["zonal shrm"](size=4).save(tmp_path / "a.exr", "float", "latlong")
    assert parts(tmp_path / "a.exr")[0][1].keys() == {
        f"sh{k:03d}.{c}" for k in (0, 2, 6) for c in "RGB"
    }
    assert open_map(tmp_path / "a.exr").azimuth_free


@pytest.mark.parametrize("compressed", [False, True])
def test_local_maps_are_no_latlongs(tmp_path, compressed):
    made = make_shrm(frame="local", size=4)
    made = CompressedShrm.from_shrm(made, 3) if compressed else made
    with pytest.raises(MapError, match=r"a\.exr: a local map .* lat-long; take `frame` global"):
        made.save(tmp_path / "a.exr", layout="latlong")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("layout", ["faces", "angular"])
def test_layouts_that_maps_have_not(tmp_path, layout):
    with pytest.raises(MapError, match=f"not written as {layout}; use latlong or a cube layout"):
        make_shrm(size=4).save(tmp_path / "a.exr", layout=layout)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("layout", [*CUBES, "latlong"])
@pytest.mark.parametrize("name", ["shrm", "cabral", "kautz-mccool", "compressed"])
def test_half_and_determinism(tmp_path, name, layout):
    made = MAKERS[name](size=4)
    for file in "ab":
        assert made.save(tmp_path / f"{file}.exr", "auto", layout, "gl") == "half"
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    made.save(tmp_path / "c.exr", "float", layout, "gl")
    half, single = (values_of(open_map(tmp_path / f"{file}.exr")) for file in "ac")
    assert 0 < relative_rms(half, single) < 5e-4


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize(
    ("layout", "orientation"),
    [("openexr", "gl"), ("strip", "openexr"), ("hcross", "gl"), ("vcross", "gl"),
     ("latlong", "openexr")],
)  # fmt: skip
@pytest.mark.parametrize("name", ["shrm", "cabral"])
def test_every_part_says_how_it_is_laid_out(tmp_path, name, layout, orientation, sampling):
    """Earlier versions must not take it for a cube, nor others for an environment map."""
    made = MAKERS[name](size=3, sampling=sampling)
    made.save(tmp_path / "a.exr", "auto", layout, orientation)
    found = parts(tmp_path / "a.exr")
    assert len(found) == (12 if name == "cabral" else 1)
    for header, _ in found:
        assert header["shrm:layout"] == layout
        assert header["shrm:orientation"] == orientation
        assert header["shrm:sampling"] == sampling
        assert header["shrm:version"] == 2
        assert "envmap" not in header


def test_plain_cubes_say_nothing(tmp_path):
    MAKERS["cabral"](size=3).save(tmp_path / "a.exr")
    for header, _ in parts(tmp_path / "a.exr"):
        assert header["shrm:version"] == 1
        assert not {"shrm:layout", "shrm:orientation", "shrm:sampling"} & header.keys()


# ---- what is not believed --------------------------------------------------------------------


@pytest.fixture
def relabelled(tmp_path):
    """A sound file whose attributes are changed."""

    def write(layout, attributes, name="shrm"):
        MAKERS[name](size=4).save(tmp_path / "sound.exr", layout=layout)
        changed = {f"shrm:{key}": value for key, value in attributes.items()}
        made = [
            ({**header, **changed}, channels) for header, channels in parts(tmp_path / "sound.exr")
        ]
        return write_parts(tmp_path / "damaged.exr", made)

    return write


@pytest.mark.parametrize("layout", ["strip", "hcross", "vcross", "latlong"])
@pytest.mark.parametrize("claim", ["openexr", "strip", "hcross", "vcross", "latlong"])
@pytest.mark.parametrize("name", ["shrm", "cabral"])
def test_shapes_must_be_those_of_the_layout(relabelled, name, layout, claim):
    path = relabelled(layout, {"layout": claim}, name)
    if claim == layout:
        assert open_map(path).size == 4
    else:
        refused(path, "is not", "a cube of 1:6" if claim == "openexr" else claim)


@pytest.mark.parametrize("claim", ["angular", "faces"])
def test_layouts_that_no_map_has(relabelled, claim):
    refused(relabelled("strip", {"layout": claim}), f"maps are not laid out as {claim}")


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        ("layout", "ball"), ("layout", "Strip"), ("layout", 3), ("layout", "x" * 9999),
        ("layout", "ä\nö"), ("orientation", "dx"), ("orientation", 1.5),
        ("sampling", "corner"), ("sampling", 2),
    ],
    ids=lambda value: str(value)[:10],
)  # fmt: skip
@pytest.mark.parametrize("layout", ["openexr", "strip", "latlong"])
def test_nonsense(relabelled, layout, attribute, value):
    path = relabelled(layout, {attribute: value})
    refused(path, f"shrm:{attribute} is missing or wrong; make it again")


def cut(path, width, height):
    """The same file with pixels of another size."""
    made = [
        (
            {k: v for k, v in header.items() if not k.endswith("Window")},
            {c: np.zeros((height, width), np.float16) for c in channels},
        )
        for header, channels in parts(path)
    ]
    return write_parts(path, made)


@pytest.mark.parametrize(
    ("layout", "width", "height"),
    [
        ("strip", 23, 4), ("strip", 25, 4), ("strip", 24, 5), ("strip", 5, 1), ("strip", 4, 24),
        ("hcross", 16, 13), ("hcross", 17, 12), ("hcross", 3, 2), ("hcross", 12, 16),
        ("vcross", 12, 15), ("vcross", 13, 16), ("vcross", 2, 3), ("vcross", 16, 12),
        ("latlong", 16, 9), ("latlong", 18, 9), ("latlong", 2, 1), ("latlong", 17, 8),
        ("latlong", 8, 16),
    ],
)  # fmt: skip
def test_sizes_must_be_those_of_the_layout(tmp_path, layout, width, height):
    make_shrm(size=4).save(tmp_path / "a.exr", layout=layout)
    refused(cut(tmp_path / "a.exr", width, height), f"{width} x {height} is not {layout}")


@pytest.mark.parametrize(
    ("layout", "width", "height"),
    [("strip", 6, 1), ("hcross", 4, 3), ("vcross", 3, 4), ("latlong", 4, 2)],
)
def test_the_smallest_sizes_are_read(tmp_path, layout, width, height):
    make_shrm(size=4).save(tmp_path / "a.exr", layout=layout)
    back = open_map(cut(tmp_path / "a.exr", width, height))
    assert back.coefficients.shape == (6, 1, 9, 3)
    assert not back.coefficients.any()


@pytest.mark.parametrize("layout", ["strip", "latlong"])
@pytest.mark.parametrize("share", [0.3, 0.9, 0.999])
def test_truncated_files(tmp_path, layout, share):
    make_shrm(size=16).save(tmp_path / "a.exr", layout=layout)
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(data[: int(share * len(data))])
    refused(tmp_path / "a.exr", "damaged")


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="no /proc to measure with")
@pytest.mark.parametrize("layout", ["strip", "hcross", "vcross", "latlong"])
def test_hostile_sizes_allocate_nothing(tmp_path, layout):
    make_shrm(size=4).save(tmp_path / "a.exr", layout=layout)
    data = (tmp_path / "a.exr").read_bytes()
    rows, columns = (2, 4) if layout == "latlong" else SHAPES[layout]
    paths = []
    for size in (1024, 4096, 5000, 100_000):
        claim = bytearray(data)
        for window in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
            start = claim.index(window) + len(window) + 4
            struct.pack_into("<4i", claim, start, 0, 0, columns * size - 1, rows * size - 1)
        paths.append(tmp_path / f"{size}.exr")
        paths[-1].write_bytes(claim)
        refused(paths[-1])
    result = process(*paths, code=PEAK)
    assert result.err == ""
    assert len(result.out.split()) == len(paths)
    assert int(result.out.split()[-1]) < 50_000  # kB
