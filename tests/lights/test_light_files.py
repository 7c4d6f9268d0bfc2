"""Light files, USD and lines for engines say what the lamps are, each read by other code."""

import json
import re

import numpy as np
import pytest

from shrm_cli.errors import OutputError
from shrm_cli.files.whole import write_bytes
from shrm_cli.lights.light_files import light_file_text, relative_name, usd_text, write_residual
from shrm_cli.lights.snippets import beside_cubes, snippet
from shrm_cli.lights.split import split_lamps
from shrm_cli.probe.disc import Disc
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import LIGHT_ENGINES
from tests import oracles
from tests.lights import rooms
from tests.lights.rooms import probe, round_lamp, unit

AXIS = unit(0.3, 0.5, 0.7)
LIGHT = np.array([900.0, 700.0, 400.0])


@pytest.fixture(scope="module", params=list(rooms.IMAGES))
def split(request):
    return split_lamps(probe(request.param, (round_lamp(AXIS, 5.0), LIGHT)))


@pytest.fixture(scope="module")
def latlong():
    return split_lamps(probe("latlong", (round_lamp(AXIS, 5.0), LIGHT)))


def test_a_light_file_is_the_probe_again(split, tmp_path):
    """Its coefficients against those of the probe, from pixels; precision is that of halves."""
    write_residual(str(tmp_path / "rest.exr"), split)
    write_bytes(str(tmp_path / "sun.toml"), light_file_text(split, "rest.exr").encode())
    whole = open_probe(tmp_path / "sun.toml")
    assert len(whole.discs) == 1
    assert whole.terms[0].probe.grid == split.probe.grid
    expected = project(split.probe, 6).coefficients
    found = project(whole, 6).coefficients
    np.testing.assert_allclose(found, expected, rtol=0, atol=4e-3 * expected.max())


def test_border_sampled_residuals_are_tagged(tmp_path):
    image = rooms.latlong(32, rooms.room((round_lamp(AXIS, 12.0), LIGHT)))
    for layout, pixels in (("latlong", image[:31, :62]), ("angular", rooms.bare("angular"))):
        found = split_lamps(Probe.from_array(pixels, layout, sampling="border"))
        write_residual(str(tmp_path / "rest.exr"), found)
        write_bytes(str(tmp_path / "sun.toml"), light_file_text(found, "rest.exr").encode())
        assert open_probe(tmp_path / "sun.toml").terms[0].probe.grid == found.probe.grid


def test_a_lamp_of_the_largest_pixels_is_read_back(tmp_path):
    image = np.zeros((64, 128, 3), np.float32)
    image[20, 37] = 3e38
    split = split_lamps(Probe.from_array(image))
    write_residual(str(tmp_path / "rest.exr"), split)
    write_bytes(str(tmp_path / "sun.toml"), light_file_text(split, "rest.exr").encode())
    (found,) = open_probe(tmp_path / "sun.toml").discs
    np.testing.assert_allclose(found.radiance, 3e38, rtol=1e-6)


def test_names_are_relative_and_below(tmp_path):
    inner = tmp_path / "in"
    inner.mkdir()
    assert relative_name(str(inner / "a b.exr"), str(tmp_path / "s.toml")) == "in/a b.exr"
    with pytest.raises(OutputError, match="not in its folder"):
        relative_name(str(tmp_path / "a.exr"), str(inner / "s.toml"))


def test_usd_in_its_own_library(latlong, tmp_path):
    """OpenUSD composes the stage; light goes along -Z of the light's own axes."""
    usd = pytest.importorskip("pxr.Usd", reason="no OpenUSD (pip install usd-core)")
    from pxr import Gf, UsdGeom, UsdLux

    (tmp_path / "sun.usda").write_text(usd_text(latlong, "rest.exr"))
    stage = usd.Stage.Open(str(tmp_path / "sun.usda"))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    dome = UsdLux.DomeLight_1(stage.GetPrimAtPath("/Lights/Residual"))
    assert dome.GetPoleAxisAttr().Get() == "Y"
    assert dome.GetTextureFileAttr().Get().path == "./rest.exr"
    lamp = UsdLux.DistantLight(stage.GetPrimAtPath("/Lights/Lamp1"))
    check_usd(
        lamp.GetAngleAttr().Get(), lamp.GetIntensityAttr().Get(), lamp.GetColorAttr().Get(),
        UsdGeom.Xformable(lamp).ComputeLocalToWorldTransform(0).TransformDir(Gf.Vec3d(0, 0, -1)),
        latlong.discs[0],
    )  # fmt: skip
    assert lamp.GetNormalizeAttr().Get()


def test_usd_as_text(latlong):
    """Read by hand: rows of USD's matrices are the axes, as it multiplies row vectors."""
    text = usd_text(latlong, "rest.exr")
    assert text.startswith("#usda 1.0\n")
    assert text.count("{") == text.count("}")
    values = dict(re.findall(r"inputs:(\w+) = ([^\n]+)", text.split("DistantLight")[1]))
    color = json.loads(values["color"].replace("(", "[").replace(")", "]"))
    matrix = re.search(r"xformOp:transform = (.*)", text)[1].replace("(", "[").replace(")", "]")
    rows = np.array(json.loads(matrix))[:3, :3]
    np.testing.assert_allclose(rows @ rows.T, np.eye(3), atol=1e-8)
    assert np.linalg.det(rows) > 0
    check_usd(
        float(values["angle"]), float(values["intensity"]), color, np.array([0, 0, -1]) @ rows,
        latlong.discs[0],
    )  # fmt: skip
    assert values["normalize"] == "1"


def check_usd(angle, intensity, color, travel, disc):
    assert angle == pytest.approx(np.degrees(2 * disc.radius), rel=1e-6)
    expected = np.pi * np.sin(disc.radius) ** 2 * disc.radiance
    np.testing.assert_allclose(intensity * np.array(color), expected, rtol=1e-6)
    np.testing.assert_allclose(travel, -disc.direction, atol=1e-6)


def test_usd_takes_latlongs_only():
    cube = split_lamps(probe("openexr", (round_lamp(AXIS, 5.0), LIGHT)))
    with pytest.raises(OutputError, match="convert --to latlong"):
        usd_text(cube, "rest.exr")


def pixel_of(direction, height=512):
    """Row and column, from 0 to 1, of a direction in our lat-longs, found among all pixels."""
    at = np.argmax(oracles.latlong_pixels(2 * height, height).reshape(-1, 3) @ direction)
    row, column = divmod(at, 2 * height)
    return (column + 0.5) / (2 * height), (row + 0.5) / height


def discs(rng):
    directions = [*oracles.random_directions(rng, 6), np.array([0, 1.0, 0]), np.array([0, -1.0, 0])]
    return [Disc(each, 0.02, LIGHT) for each in directions]


def numbers(pattern, text):
    found = re.findall(pattern, text)
    return [np.array([float(each) for each in line.split(",")]) for line in found]


def test_three_js_shows_the_lamp_where_the_residual_has_it(rng):
    """Its shader's `equirectUv`, written out: u from atan(z, x), v from asin(y)."""
    made = discs(rng)
    positions = numbers(r"position\.set\(([^)]*)\)", snippet("three", made))
    assert len(positions) == len(made)
    for (x, y, z), disc in zip(positions, made, strict=True):
        u = np.arctan2(z, x) / (2 * np.pi) + 0.5
        v = 0.5 - np.arcsin(np.clip(y, -1, 1)) / np.pi
        check_place(u, v, disc)


def test_blender_shows_the_lamp_where_the_residual_has_it(rng):
    """Cycles' `direction_to_equirectangular`, written out: u from -atan(y, x), v from asin(z)."""
    made = discs(rng)
    for (x, y, z), disc in zip(
        numbers(r"Vector\(\(([^)]*)\)\)", snippet("blender", made)), made, strict=True
    ):
        u = -np.arctan2(y, x) / (2 * np.pi) + 0.5
        check_place(u, 0.5 - np.arcsin(np.clip(z, -1, 1)) / np.pi, disc)


def check_place(u, v, disc):
    expected = pixel_of(disc.direction)
    assert v == pytest.approx(expected[1], abs=2e-3)
    if abs(disc.direction[1]) < 0.99:
        assert abs((u - expected[0] + 0.5) % 1 - 0.5) < 3e-3


def test_gltf_nodes_turn_minus_z_along_the_light(rng):
    """The rotation by the quaternion, by its definition q v q*."""
    made = discs(rng)
    found = json.loads(snippet("gltf", made))
    lights = found["extensions"]["KHR_lights_punctual"]["lights"]
    assert len(found["nodes"]) == len(lights) == len(made)
    for node, light, disc in zip(found["nodes"], lights, made, strict=True):
        q = np.array(node["rotation"])
        assert np.linalg.norm(q) == pytest.approx(1, abs=1e-6)
        v = np.array([0, 0, -1.0])
        turned = v + 2 * np.cross(q[:3], np.cross(q[:3], v) + q[3] * v)
        np.testing.assert_allclose(turned, -disc.direction, atol=1e-6)
        expected = np.pi * np.sin(0.02) ** 2 * LIGHT
        np.testing.assert_allclose(light["intensity"] * np.array(light["color"]), expected, 1e-6)


def test_filament_has_one_directional_light_and_far_points(rng):
    """It shades with the strongest directional light alone."""
    made = discs(rng)
    strong = Disc(made[1].direction, made[1].radius, 2 * made[1].radiance)
    text = snippet("filament", [made[0], strong, *made[2:]])
    assert re.findall(r"Type::(\w+)", text) == ["POINT", "SUN"] + ["POINT"] * (len(made) - 2)
    (direction,) = numbers(r"direction\(\{([^}]*)\}", text)
    np.testing.assert_allclose(direction, -strong.direction, atol=1e-5)
    for position, disc in zip(
        numbers(r"float3\{([^}]*)\} \* far", text), [made[0], *made[2:]], strict=True
    ):
        np.testing.assert_allclose(position, disc.direction, atol=1e-5)
    radius = float(re.search(r"sunAngularRadius\(([\d.]+)f", text)[1])
    assert radius == pytest.approx(np.degrees(0.02), rel=1e-5)


def test_bevy_looks_from_the_lamp_to_the_origin(rng):
    made = discs(rng)
    text = snippet("bevy", made)
    for direction, disc in zip(numbers(r"from_xyz\(([^)]*)\)", text), made, strict=True):
        np.testing.assert_allclose(direction, disc.direction, atol=1e-5)
    for words in (r"illuminance: (\S+) \*", r"linear_rgb\(([^)]*)\)"):
        for found in re.findall(words, text):
            assert all(re.fullmatch(r"-?\d+\.\d+(e-?\d+)?", each) for each in found.split(", "))


def test_godot_looks_along_the_light(rng):
    made = discs(rng)
    text = snippet("godot", made)
    for along, disc in zip(numbers(r"Vector3\(([^)]*)\)", text), made, strict=True):
        np.testing.assert_allclose(along, -disc.direction, atol=1e-5)
    angle = float(re.search(r"angular_distance = ([\d.]+)", text)[1])
    assert angle == pytest.approx(2 * np.degrees(0.02), rel=1e-5)


@pytest.mark.parametrize(("engine", "axes"), [("bevy", "XY"), ("godot", ("RIGHT", "UP"))])
def test_lights_are_turned_about_axes_that_are_far_from_them(rng, engine, axes):
    """Of two axes that are parallel no rotation is made; else a round light is the same."""
    directions = np.concatenate([rng.normal(size=(200, 3)), np.eye(3), -np.eye(3)])
    for direction in directions / np.linalg.norm(directions, axis=1, keepdims=True):
        lines = snippet(engine, [Disc(direction, 0.01, np.ones(3))])
        (axis,) = re.findall(r"Vec(?:tor)?3(?:::|\.)(X|Y|UP|RIGHT)\b", lines)
        assert abs(direction[axes.index(axis)]) < 0.71


def test_cubes_of_three_js_are_looked_up_in_our_axes(rng):
    made = discs(rng)
    positions = numbers(r"position\.set\(([^)]*)\)", beside_cubes("three", made))
    np.testing.assert_allclose(positions, [disc.direction for disc in made], atol=1e-5)
    assert beside_cubes("bevy", made) == snippet("bevy", made)


def test_every_engine_has_the_irradiance(rng):
    """Godot multiplies its energy by pi."""
    made = discs(rng)
    irradiance = np.pi * np.sin(0.02) ** 2 * LIGHT.max()
    for engine in LIGHT_ENGINES:
        intensity = irradiance / (np.pi if engine == "godot" else 1)
        assert snippet(engine, made).count(f"{intensity:.5g}") == len(made), engine
