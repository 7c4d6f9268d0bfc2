"""Product textures of which a parameter varies: between its values, and at them."""

import json
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError, MapError
from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import common_brdf
from shrm_cli.maps.product.make import product
from shrm_cli.maps.product.prefilter import product_texture, varying_texture
from shrm_cli.maps.product.product import VaryingProduct
from shrm_cli.maps.product.steps import ENOUGH, Steps
from tests import brute_force, oracles
from tests.maps.damage import refused
from tests.maps.product.test_file import texture
from tests.maps.product.test_product import above_surface, ward

VALUES = (0.3, 0.4, 0.6)


def varying(spec, parameter, values, size, order=2):
    steps, points = Steps.of_one(parameter, values), [(each,) for each in values]
    return varying_texture(parse_spec(spec), steps, points, order, size).map


@pytest.fixture(scope="module")
def made():
    return varying("ward:ax=0.6", "ay", VALUES, 12)


@pytest.fixture(scope="module")
def points():
    rng = np.random.default_rng(6)
    normals = brute_force.unit(rng, 200)
    tangents = np.cross(normals, brute_force.unit(rng, 200))
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    views = brute_force.unit(rng, 200)
    views *= np.sign(np.sum(views * normals, axis=1))[:, None]
    return normals, tangents, views


def light():
    return np.random.default_rng(7).normal(size=(9, 3))


@pytest.mark.parametrize("index", range(3))
def test_at_its_values_it_is_the_texture_of_that_brdf(made, points, index):
    alone = product_texture(parse_spec(f"ward:ax=0.6,ay={VALUES[index]}"), 2, 12).map
    share = (VALUES[index] - 0.3) / 0.3
    found = made.lit(light()).varied_radiance(*points, share)
    np.testing.assert_allclose(found, alone.lit(light()).brushed_radiance(*points), atol=1e-9)


def reported(vary):
    """Textures of a range or two, and what was told of how far they were."""
    told = []
    made = product("ward", 1, 8, vary, progress=lambda *way: told.append(np.divide(*way)))
    return made, told


def check_told(made, told):
    """It takes longer than the textures, of which the last reports are."""
    assert len(told) > 2 * len(made.textures)
    assert told == sorted(told)
    assert told[0] < 0.1
    assert told[-1] == 1


def test_choosing_values_tells_how_far_it_is():
    check_told(*reported(("ay", 0.4, 0.5)))


def test_choosing_values_of_two_parameters_tells_how_far_it_is(small):
    check_told(*small)


def test_layered_materials_vary_as_models_do(points):
    spec = "coated:roughness"
    made = varying("coated", "roughness", (0.4, 0.7), 6)
    lit = made.lit(light())
    ends = [lit.varied_radiance(*points, share) for share in (0.0, 1.0)]
    for value, found in zip((0.4, 0.7), ends, strict=True):
        alone = product_texture(parse_spec(f"{spec}={value}"), 2, 6).map.lit(light())
        np.testing.assert_allclose(found, alone.brushed_radiance(*points), atol=1e-9)
    assert np.abs(ends[0] - ends[1]).max() > 0.01


def test_between_them_it_is_linear_and_each_point_has_its_own(made, points):
    lit = made.lit(light())
    low, high = (lit.varied_radiance(*points, share) for share in (1 / 3, 1.0))
    half = lit.varied_radiance(*points, 2 / 3)
    np.testing.assert_allclose(half, (low + high) / 2, atol=1e-9)
    shares = np.random.default_rng(9).uniform(-0.2, 1.2, 200)
    found = lit.varied_radiance(*points, shares)
    for k in (0, 50, 120, 199):
        one = [each[k] for each in points]
        np.testing.assert_allclose(found[k], lit.varied_radiance(*one, shares[k]), atol=1e-12)
    np.testing.assert_allclose(
        lit.brushed_radiance(*points), lit.varied_radiance(*points, 0.5), atol=0
    )


def test_interpolation_is_near_the_truth_of_a_value_between(made, points):
    truth = product_texture(parse_spec("ward:ax=0.6,ay=0.35"), 2, 12).map.lit(light())
    expected = truth.brushed_radiance(*points)
    found = made.lit(light()).varied_radiance(*points, 0.05 / 0.3)
    assert np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2)) < 0.02


@pytest.mark.parametrize("lit", [False, True])
def test_what_is_written_comes_back(tmp_path, made, lit):
    map_ = made.lit(light()) if lit else made
    map_.save(tmp_path / "x.exr", "float")
    found = open_map(tmp_path / "x.exr")
    assert found.summary()["lit"] is lit
    if lit:
        np.testing.assert_array_equal(found.lighting, light())
        found = found.product
    assert isinstance(found, VaryingProduct)
    assert found.steps.values == {"ay": VALUES}
    for one, other in zip(found.textures, made.textures, strict=True):
        np.testing.assert_array_equal(one.table, other.table)


def test_parts_under_several_lights_are_refused(tmp_path, made):
    made.lit(light()).save(tmp_path / "x.exr")
    with OpenEXR.File(str(tmp_path / "x.exr"), separate_channels=True) as file:
        headers = [{k: v for k, v in part.header.items() if k != "channels"} for part in file.parts]
        headers[1].pop("shrm:lighting_coefficients")
        written = [
            OpenEXR.Part(header, part.channels)
            for header, part in zip(headers, file.parts, strict=True)
        ]
        OpenEXR.File(written).write(str(tmp_path / "lying.exr"))
    refused(tmp_path / "lying.exr", "several lights")


@pytest.mark.parametrize(
    "varying",
    ["", "{}", '{"parameter": "", "values": [0, 1]}', '{"parameter": "a", "values": [1, 0]}',
     '{"parameter": "a", "values": [0, 1e999]}', '{"parameter": "a", "values": [0, 1, 2]}',
     '{"parameter": "a", "values": [0, "1"]}', "[" * 10_000, "[]",
     '{"parameter": "a", "values": [0, 1], "step_error": -1}',
     '{"parameter": "a", "values": [0, 1], "step_error": "x"}'],
)  # fmt: skip
def test_lying_attributes_are_refused(tmp_path, varying):
    two = VaryingProduct.of([texture(), texture()], Steps.of_one("a", [0, 1]))
    two.save(tmp_path / "x.exr")
    with OpenEXR.File(str(tmp_path / "x.exr"), separate_channels=True) as file:
        headers = [{k: v for k, v in part.header.items() if k != "channels"} for part in file.parts]
        written = [
            OpenEXR.Part({**header, "shrm:varying": varying}, part.channels)
            for header, part in zip(headers, file.parts, strict=True)
        ]
        OpenEXR.File(written).write(str(tmp_path / "lying.exr"))
    refused(tmp_path / "lying.exr", "shrm:varying")


BOTH = {"ax": (0.25, 0.5), "ay": (0.2, 0.6)}


@pytest.fixture(scope="module")
def small():
    """Small textures of two parameters, and what was told as they were made."""
    return reported([("ax", 0.4, 0.5), ("ay", 0.4, 0.5)])


@pytest.fixture(scope="module")
def two():
    return product("ward", 2, 24, [(name, *ends) for name, ends in BOTH.items()])


@pytest.mark.proof
def test_two_parameters_beside_the_integral_for_values_of_each_point(two, points):
    """Of few textures, at values that are of none of them, down to 6 degrees above the surface."""
    points = [each[np.sum(points[0] * points[2], axis=1) > 0.1] for each in points]
    assert two.varies == 2
    assert two.steps.error <= ENOUGH
    assert len(two.textures) < np.prod([len(own) for own in two.steps.values.values()]) / 4
    shares = np.random.default_rng(3).uniform(size=(len(points[0]), 2))
    lows, highs = np.array(list(BOTH.values())).T
    directions, weights = above_surface(80, 160)
    expected = []
    for normal, tangent, view, share in zip(*points, shares, strict=True):
        frame = np.array([tangent, np.cross(normal, tangent), normal])
        values = weights * ward(directions, frame @ view, *(lows + share * (highs - lows)))
        expected.append(values @ (oracles.real_harmonics(2, directions @ frame) @ light()))
    expected = np.array(expected)
    lit = two.lit(light())

    def error(places):
        found = lit.varied_radiance(*points, places)
        return np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))

    assert error(shares) < ENOUGH
    assert error(shares[:, ::-1]) > 5 * ENOUGH
    assert error(0.5) > 5 * ENOUGH


def test_the_texture_of_two_values_is_that_of_the_whole(small, points):
    two, _ = small
    lit = two.lit(light()[:4])
    found = two.at((0.3, 0.8)).lit(light()[:4]).brushed_radiance(*points)
    np.testing.assert_allclose(found, lit.varied_radiance(*points, (0.3, 0.8)), atol=1e-6)
    middle = {"ax": 0.45, "ay": 0.45}
    assert {name: two.info.brdf["parameters"][name] for name in middle} == pytest.approx(middle)
    middle = two.at(0.5).lit(light()[:4]).brushed_radiance(*points)
    np.testing.assert_allclose(lit.brushed_radiance(*points), middle, atol=1e-6)


def test_the_middle_is_recorded_where_a_texture_does_not_have_the_parameters():
    """GGX that is even has a roughness in the place of both alphas."""
    vary = [("ax", 0.25, 0.5), ("ay", 0.25, 0.75)]
    made = product("ggx:ax=0.3,ay=0.5", 1, 8, vary, steps=2)
    assert any("ax" not in each.info.brdf["parameters"] for each in made.textures)
    for found in (made, made.at(0.5)):
        assert repr(common_brdf({"x": found.info})) == repr(parse_spec("ggx:ax=0.375,ay=0.5"))


def test_two_parameters_are_written_and_come_back(tmp_path, small):
    two, _ = small
    two.lit(light()[:4]).save(tmp_path / "x.exr", "float")
    found = open_map(tmp_path / "x.exr").product
    assert list(found.steps.values.items()) == list(two.steps.values.items())
    np.testing.assert_array_equal(found.steps.weights, two.steps.weights)
    assert found.details() == two.details()
    for one, other in zip(found.textures, two.textures, strict=True):
        np.testing.assert_array_equal(one.table, other.table)


@pytest.mark.parametrize(
    "attributes",
    [{"weights": None}, {"weights": None, "part": 1}, {"weights": "[[1, 0]]"},
     {"weights": "[[1, 0], [1e999, 0]]"},
     {"weights": "[[1, 0], [0, 1, 2]]"}, {"varying": {"parameters": ["a", "a"]}},
     {"varying": {"parameters": ["a", "b", "c"]}}, {"varying": {"parameters": []}},
     {"varying": {"values": [[0, 1]]}}, {"varying": {"values": [[0, 1], [1, 0]]}},
     {"varying": {"values": [[0, 1], [1]]}}, {"varying": {"values": [[0, 1], 7]}},
     {"varying": {"parameters": "ab"}}],
)  # fmt: skip
def test_lies_about_two_parameters_are_refused(tmp_path, attributes):
    steps = Steps({"a": (0, 1), "b": (0, 1)}, np.arange(8.0).reshape(2, 2, 2))
    VaryingProduct.of([texture(), texture()], steps).save(tmp_path / "x.exr")
    said = {**steps.summary(), **attributes.get("varying", {})}
    with OpenEXR.File(str(tmp_path / "x.exr"), separate_channels=True) as file:
        written = []
        for index, part in enumerate(file.parts):
            header = {k: v for k, v in part.header.items() if k != "channels"}
            header["shrm:varying"] = json.dumps(said)
            if "weights" in attributes and index >= attributes.get("part", 0):
                header["shrm:weights"] = attributes["weights"]
            kept = {k: v for k, v in header.items() if v is not None}
            written.append(OpenEXR.Part(kept, part.channels))
        OpenEXR.File(written).write(str(tmp_path / "lying.exr"))
    refused(tmp_path / "lying.exr", "shrm:varying")


def test_grey_and_coloured_textures_are_joined_as_coloured():
    joined = VaryingProduct.of([texture(1), texture(3)], Steps.of_one("a", [0, 1]))
    assert joined.channels == 3
    np.testing.assert_array_equal(joined.textures[0].table[..., 2], texture(1).table[..., 0])


def test_what_cannot_vary_is_refused():
    for spec, name in (("ward", "az"), ("lafortune", "material"), ("ward", "")):
        with pytest.raises(BrdfError, match="no parameter"):
            varying(spec, name, (0.1, 0.2), 8)
    with pytest.raises(BrdfError, match="outside"):
        varying("ward", "ay", (0.1, 5.0), 8)
    steps = Steps.of_one("ay", np.linspace(0.1, 0.9, 64))
    with pytest.raises(MapError, match="too many"):
        varying_texture(parse_spec("ward"), steps, [(0.1,)] * 64, 16, 1024)
    with pytest.raises(ValueError, match="rise"):
        Steps.of_one("a", [1, 1])
    with pytest.raises(ValueError, match="shapes"):
        VaryingProduct.of([texture(), texture(size=9)], Steps.of_one("a", [0, 1]))
    assert replace(texture()).order == 2


@pytest.mark.parametrize("share", [0.0, 0.2, 1 / 3, 0.5, 0.9, 1.0])
def test_the_texture_of_one_value_is_that_of_the_whole(made, points, share):
    found = made.at(share).lit(light()).brushed_radiance(*points)
    expected = made.lit(light()).varied_radiance(*points, share)
    np.testing.assert_allclose(found, expected, atol=1e-6)
