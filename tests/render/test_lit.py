"""Which maps take a surface, which surface they get, and the range that they were made for."""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError
from shrm_cli.maps.info import MapInfo, record_of, same_brdf
from shrm_cli.maps.product.prefilter import product_texture
from shrm_cli.maps.she.exponential import SphericalHarmonicExponential
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.probe.probe import Probe
from shrm_cli.render.lit import ggx_surface, lit_maps, outside_range
from tests.render.materials import furnace

INFO = MapInfo(0, 0, 0.0, 1.0, 0.0)
NORMALS = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
VIEW = np.array([0.0, 0.0, 1.0])


def split_sum(roughness):
    """Light of radiance 2, 1 and 0.5 from everywhere."""
    level = np.broadcast_to(np.array([2, 1, 0.5], np.float32), (24, 4, 3))
    return SplitSum((level,) * len(roughness), roughness, "linear", INFO)


def exponential(low, high):
    """Light of radiance 1 from everywhere: the logarithm is 0."""
    zero = np.zeros((4, 3))
    return SphericalHarmonicExponential(zero, zero[1:], (low, high), INFO)


def test_the_surface_is_ggx_of_the_roughness_that_is_documented():
    assert record_of(ggx_surface()) == record_of(parse_spec("ggx:roughness=0.5"))
    gold = parse_spec("ggx:roughness=0.3,f0=gold")
    assert ggx_surface(0.3, gold.color("f0")).values == gold.values
    assert (
        ggx_surface(f0=(0.04, 0.04, 0.04)).values == parse_spec("ggx:roughness=0.5,f0=0.04").values
    )
    for values in [(0.04, None), (1.01, None), (None, (0.5, 0.5, 2.0)), (float("nan"), None)]:
        with pytest.raises(BrdfError):
            ggx_surface(*values)


def test_only_maps_that_need_a_surface_get_one():
    white, asked = furnace((1, 1, 1)), (0.3, (1.0, 0.5, 0.25))
    assert white.shaded(*asked) is white
    for light in (split_sum((0.5,)), exponential(0.25, 1.0)):
        shown = light.shaded(*asked)
        assert shown.light is light
        assert (shown.roughness, shown.f0) == asked


def test_a_shaded_map_remembers_the_surface_as_an_shrm_does():
    for spec in ("ggx:roughness=0.3,f0=0.04", "ggx:roughness=0.7,f0=gold"):
        surface = parse_spec(spec)
        shown = split_sum((0.0, 1.0)).shaded(surface.number("roughness"), surface.color("f0"))
        info = shown.info
        assert same_brdf(info.brdf, record_of(surface))
        other = replace(info, brdf={"name": "ggx", "parameters": {"roughness": 0.3, "f0": 1.0}})
        assert not same_brdf(other.brdf, record_of(surface))


def test_white_light_shows_the_albedo():
    """Of a smooth surface Schlick's: 0.04 + 0.96 (1 - N.V)^5."""
    shown = split_sum((0.05, 1.0)).shaded(0.05, (0.04, 1.0, 0.5))
    albedo = np.array([0.04, 1, 0.5]) + (1 - np.array([0.04, 1, 0.5])) * 0.2**5
    expected = np.array([2, 1, 0.5]) * np.array([[0.04, 1, 0.5], albedo])
    np.testing.assert_allclose(shown.radiance(NORMALS, VIEW), expected, rtol=2e-3)


def test_lines_about_maps_of_another_range():
    maps = {
        "s": split_sum((0.25, 0.75)),
        "one": split_sum((0.5,)),
        "e": exponential(0.0400000005, 0.25),
        "shrm": furnace((1, 1, 1)),
    }
    assert outside_range(maps, 0.5) == []
    assert outside_range(maps, 0.2) == [
        "s: it was made for roughness 0.25 .. 0.75, not 0.2",
        "one: it was made for roughness 0.5, not 0.2",
    ]
    assert outside_range(maps, 0.6) == [
        "one: it was made for roughness 0.5, not 0.6",
        "e: it was made for roughness 0.2 .. 0.5, not 0.6",
    ]


def test_what_a_texture_of_few_orders_blurs_is_told():
    """Of order 4, a sharp lobe under lamps; not of what is matt, or under light without lamps."""
    lamp = np.full((32, 64, 3), 0.1, np.float32)
    lamp[10, 20] = 300
    told = {}
    for spec in ("ward:ax=0.2,ay=0.4", "lambertian"):
        texture = product_texture(parse_spec(spec), 4, 16).map
        for light, pixels in (("lamp", lamp), ("even", np.ones_like(lamp))):
            probe = Probe.from_array(pixels)
            _, lines = lit_maps([texture], ["a.exr"], probe, "none")
            told[spec[:4], light] = [line for line in lines if "shows nothing sharper" in line]
    assert [key for key, lines in told.items() if lines] == [("ward", "lamp")]
    (line,) = told["ward", "lamp"]
    assert line.startswith("a.exr: the reflected light is wrong by ")
    assert "for order 4 shows" in line
