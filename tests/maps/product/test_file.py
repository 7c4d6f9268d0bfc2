"""Product texture <-> file: a part of coefficients, and nothing believed that is not so."""

import json
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.product.product import ProductTexture
from tests.maps.damage import refused, survives_flipped_bits

INFO = MapInfo(2, 0, 0.1, 0.9, 0.25, {"name": "ward", "parameters": {"ax": 0.5}}, filter_error=0.01)


def texture(channels=1, lit=False, order=2, size=8):
    rng = np.random.default_rng(order)
    table = rng.normal(size=(size, size, (order + 1) ** 2, channels)).astype(np.float16)
    made = ProductTexture(table.astype(np.float32), replace(INFO, order_f=order))
    return made.lit(rng.normal(size=((order + 1) ** 2, 3))) if lit else made


def parts(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        header = {name: value for name, value in file.header().items() if name != "channels"}
        return header, {name: channel.pixels for name, channel in file.channels().items()}


@pytest.mark.parametrize("lit", [False, True])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("order", [0, 2, 4])
def test_what_is_written_comes_back(tmp_path, channels, lit, order):
    made = texture(channels, lit, order)
    assert made.save(tmp_path / "x.exr") == "half"
    found = open_map(tmp_path / "x.exr")
    assert found.info == replace(made.info, captured=pytest.approx(0.9), eps=0.1)
    if lit:
        np.testing.assert_array_equal(found.lighting, made.lighting)
        found, made = found.product, made.product
    assert isinstance(found, ProductTexture)
    np.testing.assert_array_equal(found.table, made.table)


def test_channels_have_the_names_of_the_conventions(tmp_path):
    texture().save(tmp_path / "grey.exr")
    texture(3).save(tmp_path / "color.exr")
    assert sorted(parts(tmp_path / "grey.exr")[1]) == [f"sh{k:03d}" for k in range(9)]
    colored = sorted(f"sh{k:03d}.{c}" for k in range(9) for c in "RGB")
    assert sorted(parts(tmp_path / "color.exr")[1]) == colored


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"shrm:F": 3}, ["channels", "order 3"]),
        ({"shrm:F": 17}, ["order 17"]),
        ({"shrm:frame": "global"}, ["local"]),
        ({"shrm:center": "reflection"}, ["about the normal"]),
        ({"shrm:lighting_coefficients": "[[1, 2, 3]]"}, ["lighting_coefficients", "9 x 3"]),
        ({"shrm:lighting_coefficients": json.dumps([[1e999] * 3] * 9)}, ["finite"]),
        ({"shrm:lighting_coefficients": "[" * 100_000}, ["lighting_coefficients"]),
    ],
)
def test_lying_attributes_are_refused(tmp_path, attributes, words):
    texture(lit=True).save(tmp_path / "sound.exr")
    header, channels = parts(tmp_path / "sound.exr")
    path = tmp_path / "lying.exr"
    OpenEXR.File({**header, **attributes}, channels).write(str(path))
    refused(path, *words)


def test_missing_channels_and_odd_shapes_are_refused(tmp_path):
    texture().save(tmp_path / "sound.exr")
    header, channels = parts(tmp_path / "sound.exr")
    channels.pop("sh004")
    OpenEXR.File(header, channels).write(str(tmp_path / "missing.exr"))
    refused(tmp_path / "missing.exr", "channels")
    for name in ("dataWindow", "displayWindow"):
        header.pop(name)
    wide = {f"sh{k:03d}": np.zeros((8, 10), np.float16) for k in range(9)}
    OpenEXR.File(header, wide).write(str(tmp_path / "wide.exr"))
    refused(tmp_path / "wide.exr", "10 x 8")


def test_what_is_not_finite_is_refused(tmp_path):
    texture().save(tmp_path / "sound.exr")
    header, channels = parts(tmp_path / "sound.exr")
    channels["sh003"][2, 2] = np.nan
    OpenEXR.File(header, channels).write(str(tmp_path / "nan.exr"))
    refused(tmp_path / "nan.exr", "finite")


def test_flipped_bits(tmp_path):
    texture(lit=True).save(tmp_path / "x.exr")
    survives_flipped_bits(tmp_path / "x.exr", 300)


def test_a_texture_is_no_cube(tmp_path):
    with pytest.raises(MapError, match="OpenEXR's cube only"):
        texture().save(tmp_path / "x.exr", layout="latlong")
