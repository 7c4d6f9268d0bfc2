"""Product textures of which a parameter varies: between its values, and at them."""

from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError, MapError
from shrm_cli.maps.file import open_map
from shrm_cli.maps.product.prefilter import product_texture, varying_texture
from shrm_cli.maps.product.varying import VaryingProduct
from tests import brute_force
from tests.maps.damage import refused
from tests.maps.product.test_file import texture

VALUES = (0.3, 0.4, 0.6)


@pytest.fixture(scope="module")
def made():
    return varying_texture(parse_spec("ward:ax=0.6"), "ay", VALUES, 2, 24).map


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
    alone = product_texture(parse_spec(f"ward:ax=0.6,ay={VALUES[index]}"), 2, 24).map
    share = (VALUES[index] - 0.3) / 0.3
    found = made.lit(light()).varied_radiance(*points, share)
    np.testing.assert_allclose(found, alone.lit(light()).brushed_radiance(*points), atol=1e-9)


def test_layered_materials_vary_as_models_do(points):
    spec = "openpbr:base_metalness=0.5,specular_roughness"
    made = varying_texture(parse_spec("openpbr:base_metalness=0.5"), "specular_roughness",
                           (0.4, 0.7), 2, 12).map  # fmt: skip
    lit = made.lit(light())
    ends = [lit.varied_radiance(*points, share) for share in (0.0, 1.0)]
    for value, found in zip((0.4, 0.7), ends, strict=True):
        alone = product_texture(parse_spec(f"{spec}={value}"), 2, 12).map.lit(light())
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
    truth = product_texture(parse_spec("ward:ax=0.6,ay=0.35"), 2, 24).map.lit(light())
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
    assert (found.parameter, found.values) == ("ay", VALUES)
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
    two = VaryingProduct.of([texture(), texture()], "a", [0, 1])
    two.save(tmp_path / "x.exr")
    with OpenEXR.File(str(tmp_path / "x.exr"), separate_channels=True) as file:
        headers = [{k: v for k, v in part.header.items() if k != "channels"} for part in file.parts]
        written = [
            OpenEXR.Part({**header, "shrm:varying": varying}, part.channels)
            for header, part in zip(headers, file.parts, strict=True)
        ]
        OpenEXR.File(written).write(str(tmp_path / "lying.exr"))
    refused(tmp_path / "lying.exr", "shrm:varying")


def test_grey_and_coloured_textures_are_joined_as_coloured():
    joined = VaryingProduct.of([texture(1), texture(3)], "a", [0, 1])
    assert joined.channels == 3
    np.testing.assert_array_equal(joined.textures[0].table[..., 2], texture(1).table[..., 0])


def test_what_cannot_vary_is_refused():
    for spec, name in (("ward", "az"), ("lafortune", "material"), ("ward", "")):
        with pytest.raises(BrdfError, match="no parameter"):
            varying_texture(parse_spec(spec), name, (0.1, 0.2), 1, 8)
    with pytest.raises(BrdfError, match="outside"):
        varying_texture(parse_spec("ward"), "ay", (0.1, 5.0), 1, 8)
    with pytest.raises(MapError, match="too many"):
        varying_texture(parse_spec("ward"), "ay", np.linspace(0.1, 0.9, 64), 16, 1024)
    with pytest.raises(ValueError, match="rise"):
        VaryingProduct.of([texture(), texture()], "a", [1, 1])
    with pytest.raises(ValueError, match="shapes"):
        VaryingProduct.of([texture(), texture(size=9)], "a", [0, 1])
    assert replace(texture()).order == 2


@pytest.mark.parametrize("share", [0.0, 0.2, 1 / 3, 0.5, 0.9, 1.0])
def test_the_texture_of_one_value_is_that_of_the_whole(made, points, share):
    found = made.at(share).lit(light()).brushed_radiance(*points)
    expected = made.lit(light()).varied_radiance(*points, share)
    np.testing.assert_allclose(found, expected, atol=1e-6)
