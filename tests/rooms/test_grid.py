"""Interpolation between probes, their files, and the forms that engines read."""

import json
import struct
from dataclasses import replace

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.analysis.describe import describe
from shrm_cli.errors import MeshError, ShrmError, ShrmWarning
from shrm_cli.export.ktx import can_compress
from shrm_cli.files.parts import Part, write_parts
from shrm_cli.rooms import export
from shrm_cli.rooms.grid import (
    EDGE,
    Lattice,
    ProbeGrid,
    _texels,
    is_grid,
    octahedral_directions,
    read_grid,
    write_grid,
)
from shrm_cli.rooms.table import read_positions
from tests.cli.helpers import write_exr
from tests.oracles import real_harmonics, sphere_rule


def lit(shape=(3, 2, 4), order=2, seed=3, walls=True):
    """A grid of random light that is nowhere negative, in a box of three edges."""
    rng = np.random.default_rng(seed)
    lattice = Lattice(np.array([-1.0, 0, 2]), np.array([2.0, 1, 7]), shape)
    light = 0.05 * rng.standard_normal((lattice.count, (order + 1) ** 2, 3))
    light[:, 0] = rng.uniform(1, 2, (lattice.count, 3))
    direct = np.zeros_like(light)
    direct[:, 0] = rng.uniform(0, 1, (lattice.count, 3))
    alive = np.ones(lattice.count, bool)
    known = np.tile(ball_of_walls(9.0), (lattice.count, 1, 1)) if walls else None
    return ProbeGrid(lattice, light, direct, known, alive, {"error": 0.125})


def ball_of_walls(distance):
    """What a probe knows of walls all around it, shape (EDGE^2, 4)."""
    return np.pad(octahedral_directions() / distance, [(0, 0), (0, 1)])


def directions(rng, count):
    found = rng.standard_normal((count, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@pytest.mark.parametrize("shape", [(3, 2, 4), (1, 5, 1)])
def test_shares_of_corners_keep_linear_functions(rng, shape):
    lattice = Lattice(np.array([-1.0, 0, 2]), np.array([2.0, 1, 7]), shape)
    inner = lattice.low + lattice.spacing / 2, lattice.high - lattice.spacing / 2
    points = rng.uniform(*inner, (200, 3))
    probes, shares = lattice.corners(points)
    np.testing.assert_allclose(shares.sum(axis=1), 1)
    found = np.einsum("nk,nkv->nv", shares, lattice.points()[probes])
    np.testing.assert_allclose(found, points, atol=1e-12)


def test_irradiance_at_a_probe_is_an_integral_over_its_light(rng):
    grid = lit()
    places = grid.lattice.points()
    around, weights = sphere_rule(24)
    light = np.einsum("dj,njc->ndc", real_harmonics(2, around), grid.reflected + grid.direct)
    normals = directions(rng, len(places))
    cosines = np.maximum(normals @ around.T, 0)
    expected = np.einsum("d,nd,ndc->nc", weights, cosines, light)
    np.testing.assert_allclose(grid.irradiance(places, normals), expected, rtol=0.01)
    light = np.einsum("dj,njc->ndc", real_harmonics(2, around), grid.reflected)
    dim = np.einsum("d,nd,ndc->nc", weights, cosines, light)
    np.testing.assert_allclose(grid.irradiance(places, normals, direct=False), dim, rtol=0.01)


def test_octahedral_maps_are_filtered_over_their_edges(rng):
    """A smooth function at the texels is found between them, wherever the map is cut."""
    around = directions(rng, 5000)
    texels, shares = _texels(around)
    np.testing.assert_allclose(shares.sum(axis=1), 1)
    tilt = np.array([0.3, -0.7, 0.2])
    values = np.exp(octahedral_directions() @ tilt)
    found = np.einsum("nt,nt->n", shares, values[texels])
    np.testing.assert_allclose(found, np.exp(around @ tilt), rtol=0.08)
    exact, weights = _texels(octahedral_directions())
    chosen = exact[np.arange(EDGE**2), weights.argmax(axis=1)]
    np.testing.assert_array_equal(chosen, np.arange(EDGE**2))


def test_hidden_and_dead_probes_do_not_count():
    grid = lit(shape=(2, 1, 1))
    light = np.zeros_like(grid.reflected)
    light[0, 0], light[1, 0] = 1, 100
    grid = replace(grid, reflected=light, direct=0 * light)
    middle, up = np.array([[0.5, 0.5, 4.5]]), np.array([[0.0, 1, 0]])
    one = np.sqrt(np.pi) / 2
    assert grid.irradiance(middle, up)[0, 0] == pytest.approx(101 / 2 * one)
    hidden = np.array(grid.walls)
    hidden[1] = ball_of_walls(0.2)  # a wall a fifth of a unit before the probe
    assert grid.irradiance(middle, up)[0, 0] > 50 * one
    found = replace(grid, walls=hidden).irradiance(middle, up)[0, 0]
    assert found == pytest.approx(one, rel=0.01)
    dead = replace(grid, alive=np.array([True, False]))
    assert dead.irradiance(middle, up)[0, 0] == pytest.approx(one)
    both = replace(grid, walls=np.broadcast_to(ball_of_walls(0.2), hidden.shape))
    assert both.irradiance(middle, up)[0, 0] == pytest.approx(101 / 2 * one, rel=1e-3)


def test_where_all_probes_are_hidden_distance_alone_counts():
    """One of two sees a little further through its wall than the other, or as good as nothing."""
    grid = lit(shape=(2, 1, 1))
    middle, up = np.array([[0.5, 0.5, 4.5]]), np.array([[0.0, 1, 0]])
    for distance, share in ((0.699, 0.5), (0.701, 1.0)):
        walls = np.array([ball_of_walls(distance), ball_of_walls(0.2)])
        probes, weights = replace(grid, walls=walls).weights(middle, up)
        assert weights[probes == 0].sum() == pytest.approx(share, abs=1e-6), distance


def test_files_hold_the_same(tmp_path):
    grid = lit()
    write_grid(tmp_path / "a.npz", grid)
    write_grid(tmp_path / "b.npz", grid)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    found = read_grid(tmp_path / "a.npz")
    assert is_grid(tmp_path / "a.npz")
    assert found.summary() == grid.summary()
    for name in ("reflected", "direct", "walls", "alive"):
        np.testing.assert_allclose(getattr(found, name), getattr(grid, name), rtol=1e-6)
    write_grid(tmp_path / "c.npz", replace(grid, walls=None))
    assert read_grid(tmp_path / "c.npz").walls is None


@pytest.mark.parametrize("fault", ["box", "shape", "order", "nan", "walls", "version"])
def test_files_that_do_not_fit_are_refused(tmp_path, fault):
    grid = lit()
    lattice = grid.lattice
    if fault == "box":
        grid = replace(grid, lattice=replace(lattice, high=lattice.low))
    elif fault == "shape":
        grid = replace(grid, lattice=replace(lattice, shape=(3, 2, 5)))
    elif fault == "order":
        grid = replace(grid, reflected=grid.reflected[:, :5])
    elif fault == "nan":
        grid = replace(grid, direct=grid.direct * np.nan)
    elif fault == "walls":
        grid = replace(grid, walls=grid.walls[:, :5])
    write_grid(tmp_path / "a.npz", grid)
    if fault == "version":
        raw = (tmp_path / "a.npz").read_bytes()
        wide = '"version": 2'.encode("utf-32-le")
        assert wide in raw
        (tmp_path / "a.npz").write_bytes(raw.replace(wide, '"version": 9'.encode("utf-32-le")))
    with pytest.raises(MeshError, match=r"a\.npz"):
        read_grid(tmp_path / "a.npz")


def test_files_of_the_first_version_are_read(tmp_path, rng):
    """They hold mean distances, and mean squares of them, about the same directions."""
    grid = lit(shape=(2, 1, 1))
    near = replace(grid, walls=np.stack([ball_of_walls(9.0), ball_of_walls(0.2)]))
    write_grid(tmp_path / "new.npz", near)
    lattice = near.lattice
    arrays = {name: getattr(near, name) for name in ("reflected", "direct", "alive")}
    arrays["box"] = np.stack([lattice.low, lattice.high])
    arrays["moments"] = np.tile(np.array([[9.0, 81], [0.2, 0.04]])[:, None], (1, EDGE**2, 1))
    arrays["alive"] = arrays["alive"].astype("f4")
    settings = json.dumps({"version": 1, "shape": lattice.shape, "facts": {}})
    np.savez(tmp_path / "old.npz", settings=settings, **arrays)
    points, normals = rng.uniform([-1, 0, 2], [2, 1, 7], (50, 3)), directions(rng, 50)
    old, new = (read_grid(tmp_path / f"{name}.npz") for name in ("old", "new"))
    np.testing.assert_allclose(
        old.irradiance(points, normals), new.irradiance(points, normals), rtol=1e-4
    )
    assert not np.allclose(new.irradiance(points, normals), grid.irradiance(points, normals), 0.01)


def three(coefficients, normal):
    """What three.js's shader makes of nine coefficients."""
    c, (x, y, z) = np.asarray(coefficients).reshape(9, 3), normal
    result = c[0] * 0.886227
    result = result + c[1] * 2 * 0.511664 * y + c[2] * 2 * 0.511664 * z + c[3] * 2 * 0.511664 * x
    result = result + c[4] * 2 * 0.429043 * x * y + c[5] * 2 * 0.429043 * y * z
    result = result + c[6] * (0.743125 * z * z - 0.247708) + c[7] * 2 * 0.429043 * x * z
    return result + c[8] * 0.429043 * (x * x - y * y)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_json_is_in_the_order_of_three(rng, order):
    grid = lit(order=order)
    held = json.loads(export.as_json(grid, direct=True))
    nx, ny, nz = held["resolution"]
    assert (nx, ny, nz) == grid.lattice.shape
    numbers = np.array(held["coefficients"]).reshape(nz, ny, nx, 27)
    low = replace(grid, reflected=grid.reflected[:, :9], direct=grid.direct[:, :9])
    for index in ((0, 0, 0), (2, 1, 3), (1, 0, 2)):
        step = (np.array(held["max"]) - held["min"]) / held["resolution"]
        place = held["min"] + (np.array(index) + 0.5) * step
        normal = directions(rng, 1)
        expected = low.irradiance(place[None], normal)[0]
        found = three(numbers[index[2], index[1], index[0]], normal[0])
        np.testing.assert_allclose(found, expected, rtol=1e-4)


def unpacked(word):
    """RGB of a texel with a shared exponent, by Vulkan's specification."""
    scale = 2.0 ** ((word >> 27) - 15 - 9)
    return np.stack([(word >> shift & 511) * scale for shift in (0, 9, 18)], axis=-1)


@pytest.mark.skipif(not can_compress(), reason="zstandard is not installed")
def test_volumes_are_bevys_ambient_cubes():
    import zstandard

    grid = lit()
    data = export.as_volume(grid, direct=False)
    number, _, width, height, depth, layers, faces, levels, scheme = struct.unpack_from(
        "<9I", data, 12
    )
    nx, ny, nz = grid.lattice.shape
    assert (number, width, height, depth) == (123, nx, 2 * ny, 3 * nz)
    assert (layers, faces, levels, scheme) == (0, 1, 1, 2)
    at, size, whole = struct.unpack_from("<3Q", data, 80)
    words = np.frombuffer(zstandard.decompress(data[at : at + size]), "<u4")
    assert words.nbytes == whole
    texels = unpacked(words.astype(np.int64)).reshape(depth, height, width, 3)
    rng = np.random.default_rng(2)
    for x, y, z in ((0, 0, 0), (2, 1, 3), (1, 1, 2)):
        place = grid.lattice.low + (np.array([x, y, z]) + 0.5) * grid.lattice.spacing
        found = [bevys(texels, (x, y, z), normal) for normal in np.vstack([np.eye(3), -np.eye(3)])]
        for light, normal in zip(found, np.vstack([np.eye(3), -np.eye(3)]), strict=True):
            expected = grid.irradiance(place[None], normal[None], direct=False)[0] / np.pi
            np.testing.assert_allclose(light, expected, rtol=0.01)
        between = directions(rng, 1)[0]
        squares = between**2
        sides = [found[axis if between[axis] > 0 else axis + 3] for axis in range(3)]
        np.testing.assert_allclose(bevys(texels, (x, y, z), between), squares @ sides, rtol=1e-6)


def bevys(texels, voxel, normal):
    """What irradiance_volume.wgsl of Bevy looks up in the middle of a voxel."""
    depth, height, width = texels.shape[:3]
    size = np.array([width, height, depth])
    place = (np.array(voxel) + 0.5) / size
    found = np.zeros(3)
    for axis in range(3):
        offset = [0, 0.5 if normal[axis] < 0 else 0, axis / 3]
        x, y, z = np.floor((place + offset) * size).astype(int)
        found += texels[z, y, x] * normal[axis] ** 2
    return found


def test_pictures_have_a_row_of_probes_a_line(tmp_path):
    grid = lit()
    export.WRITERS[".exr"](tmp_path / "a.exr", grid, True)
    image = oiio.ImageBuf(str(tmp_path / "a.exr"))
    facts = json.loads(image.spec().getattribute("shrm:grid"))
    nx, ny, nz = facts["resolution"]
    pixels = image.get_pixels(oiio.FLOAT).reshape(9, nz, ny, nx, 3)
    light = (grid.reflected + grid.direct).reshape(nx, ny, nz, 9, 3)
    np.testing.assert_allclose(pixels[5, 3, 1, 2], light[2, 1, 3, 5], rtol=1e-6)
    assert facts["order"] == 2
    said = describe(tmp_path / "a.exr")
    assert said.what == "is a grid of probes"
    assert [said.facts[name] for name in ("shape", "low", "high", "order")] == [
        [nx, ny, nz], facts["min"], facts["max"], 2,
    ]  # fmt: skip


@pytest.mark.parametrize("said", ["{", "[1]", '{"resolution": 3, "min": 0, "max": 1, "order": 2}'])
def test_a_picture_of_a_grid_whose_header_is_wrong_is_told(tmp_path, said):
    pixels = {name: np.zeros((4, 4), np.float32) for name in "RGB"}
    write_parts(tmp_path / "a.exr", [Part(pixels, {"shrm:grid": said})], "float")
    with pytest.raises(MeshError, match="shrm:grid is wrong"):
        describe(tmp_path / "a.exr")


def test_probes_within_walls_get_their_neighbours_light():
    grid = lit(shape=(4, 1, 1))
    grid = replace(grid, alive=np.array([False, False, True, True]))
    light = export.prepared(grid, direct=False)[:, 0, 0]
    np.testing.assert_allclose(light[:3], np.broadcast_to(light[2], (3, 9, 3)))
    np.testing.assert_allclose(light[2:], grid.reflected[2:])


def test_probes_that_would_be_negative_get_a_window(rng):
    grid = lit(shape=(2, 1, 1))
    light = np.array(grid.reflected)
    light[0] = 40 * real_harmonics(2, np.array([[0.6, 0.0, 0.8]]))[0][:, None]
    light[0, 0] += 1
    made = export.prepared(replace(grid, reflected=light), direct=False)[:, 0, 0]
    np.testing.assert_allclose(made[1], light[1])
    windowed = replace(grid, reflected=made, direct=0 * made)
    normals = directions(rng, 1000)
    values = np.array([three(made[0], normal) for normal in normals])
    assert np.array([three(light[0], normal) for normal in normals]).min() < -0.5
    assert values.min() > -1e-3 * values.max()
    assert windowed.order == 2


def test_tables_name_probes_that_exist(tmp_path):
    rows = ["x,y,z,file"]
    for index, place in enumerate(np.ndindex(2, 1, 3)):
        write_exr(tmp_path / f"{index}.exr", np.full((8, 16, 3), index + 1, np.float32))
        x, y, z = np.array(place) * [2.0, 1, 0.5] + [1, 5, -1]
        rows.append(f"{x},{y},{z},{index}.exr")
    table = tmp_path / "t.csv"
    text = "\n".join([rows[0], *reversed(rows[1:])]) + "\n"
    table.write_text(text.replace(",", ", "), encoding="utf-8-sig")  # as spreadsheets begin it
    grid = read_positions(table, 2)
    assert grid.lattice.shape == (2, 1, 3)
    np.testing.assert_allclose(grid.lattice.points()[0], [1, 5, -1])
    np.testing.assert_allclose(grid.lattice.points()[-1], [3, 5, 0])
    means = grid.reflected[:, 0, 0] / np.sqrt(4 * np.pi)
    np.testing.assert_allclose(means, np.arange(1, 7), rtol=1e-5)
    assert grid.walls is None
    tables = [
        f"[[probe]]\nfile = '{file}'\nat = [{x}, {y}, {z}]\n"
        for x, y, z, file in (row.split(",") for row in rows[1:])
    ]
    (tmp_path / "t.toml").write_text("".join(tables))
    same = read_positions(tmp_path / "t.toml", 2)
    np.testing.assert_array_equal(same.reflected, grid.reflected)
    np.testing.assert_array_equal(same.lattice.points(), grid.lattice.points())


def usd_dome(number, place):
    """A dome light below a prim that is moved to a place, as a stage has it."""
    x, y, z = place
    return f"""def Xform "At{number}" {{
        double3 xformOp:translate = ({x}, {y}, {z})
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def DomeLight "Light" {{
            asset inputs:texture:file = @./{number}.exr@
        }}
    }}
    """


@pytest.mark.parametrize("up", "YZ")
def test_tables_are_stages_with_a_dome_light_for_each_probe(tmp_path, up):
    """Of one whose +Z is up, (x, y, z) is (x, z, -y) here, as of a probe with --up z."""
    pytest.importorskip("pxr.Usd", reason="no OpenUSD (pip install usd-core)")
    image = np.full((8, 16, 3), 0.1, np.float32)
    image[:2] = 5  # light from the top of the file, which is that of the stage
    domes = []
    for number, (x, y, z) in enumerate(np.ndindex(2, 1, 3)):
        write_exr(tmp_path / f"{number}.exr", image * (number + 1))
        place = (2.0 * x + 1, y + 5, 0.5 * z - 1)
        domes.append(usd_dome(number, place if up == "Y" else (place[0], -place[2], place[1])))
    more = 'def SphereLight "Lamp" {}\ndef Xform "Nothing" {}\n'
    head = f'#usda 1.0\n(\n upAxis = "{up}"\n)\n'
    (tmp_path / "t.usda").write_text(head + more + "".join(reversed(domes)))
    grid = read_positions(tmp_path / "t.usda", 1)
    assert grid.lattice.shape == (2, 1, 3)
    np.testing.assert_allclose(grid.lattice.points()[[0, -1]], [[1, 5, -1], [3, 5, 0]])
    means = grid.reflected[:, 0, 0]
    np.testing.assert_allclose(means / means[0], np.arange(1, 7), rtol=1e-5)
    along = {"Y": (0, 1), "Z": (1, -1)}[up]  # of y, z and x; the file's top is +Y of the stage
    linear = grid.reflected[0, 1:, 0]
    assert linear[along[0]] * along[1] > 1
    np.testing.assert_allclose(np.delete(linear, along[0]), 0, atol=1e-4)


def test_a_stage_without_dome_lights_is_no_table(tmp_path):
    pytest.importorskip("pxr.Usd", reason="no OpenUSD (pip install usd-core)")
    (tmp_path / "t.usda").write_text('#usda 1.0\ndef DistantLight "Sun" {}\n')
    with pytest.raises(MeshError, match="no table of probes; put a DomeLight"):
        read_positions(tmp_path / "t.usda", 1)


def test_pixels_of_a_table_that_are_clamped_are_told(tmp_path):
    image = np.full((8, 16, 3), 1, np.float32)
    write_exr(tmp_path / "0.exr", image)
    image[3, 4] = -2
    write_exr(tmp_path / "1.exr", image)
    (tmp_path / "t.csv").write_text("x,y,z,file\n0,0,0,0.exr\n1,0,0,1.exr\n")
    with pytest.warns(ShrmWarning, match="1 pixel with negative radiance was clamped to 0") as told:
        read_positions(tmp_path / "t.csv", 1)
    assert len(told) == 1
    rows = "".join(f"{k},0,0,1.exr\n" for k in range(20))
    (tmp_path / "t.csv").write_text("x,y,z,file\n" + rows)
    with pytest.warns(ShrmWarning) as told:
        read_positions(tmp_path / "t.csv", 1)
    assert len(told) == 5
    assert "16 more lines" in str(told[-1].message)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "no table of probes; give"),
        ("[[disc]]\n", "no table of probes; give"),
        ("probe = 3\n", "no table of probes; give"),
        ("probe = []\n", "0 rows"),
        ("probe = [3]\n", "probe 1 must have 'file' and 'at'"),
        ("[[probe]]\nfile = '0.exr'\n", "probe 1 must have 'file' and 'at'"),
        ("[[probe]]\nfile = '0.exr'\nat = 3\n", "probe 1 has no three numbers"),
        ("[[probe]]\nfile = '0.exr'\nat = [0, 0, 0, 0]\n", "probe 1 has no three numbers"),
        ("[[probe]]\nfile = '0.exr'\nat = [0, 0, nan]\n", "probe 1 has no position"),
        ("[[probe]]\nfile = 3\nat = [0, 0, 0]\n", "probe 1 has no position or no file"),
        ("[[probe]]\nfile = '../0.exr'\nat = [0, 0, 0]\n", "probe 1: .* leaves the table's folder"),
        (
            "[[probe]]\nfile = '0.exr'\nat = [0, 0, 1" + 400 * "0" + "]\n",
            "probe 1 has no three numbers",
        ),
        ("[[probe]\n", "no TOML"),
    ],
)
def test_tables_in_toml_are_checked(tmp_path, text, part):
    (tmp_path / "t.toml").write_text(text)
    with pytest.raises(MeshError, match=part):
        read_positions(tmp_path / "t.toml", 2)


@pytest.mark.parametrize("name", ["none.csv", "none.toml", "none.usda"])
def test_tables_that_are_not_there_are_no_such_files(tmp_path, name):
    with pytest.raises(ShrmError, match=f"{name}: no such file; check its name"):
        read_positions(tmp_path / name, 2)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("a,b\n1,2\n", "columns x, y, z, file"),
        ("x,y,z,file\n", "0 rows"),
        ("x,y,z,file\n0,0,a,0.exr\n", "line 2"),
        ("x,y,z,file\n0,0,inf,0.exr\n", "line 2"),
        ("x,y,z,file\n0,0,0,\n", "line 2"),
        ("x,y,z,file\n0,0,0,0.exr\n1,0,0,0.exr\n1.7,0,0,0.exr\n", "evenly"),
        ("x,y,z,file\n0,0,0,0.exr\n1,1,0,0.exr\n", "whole lattice"),
        ("x,y,z,file\n0,0,0,0.exr\n0,0,0,0.exr\n", "whole lattice"),
    ],
)
def test_tables_that_are_no_lattice_are_refused(tmp_path, text, part):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(MeshError, match=part):
        read_positions(tmp_path / "t.csv", 2)
