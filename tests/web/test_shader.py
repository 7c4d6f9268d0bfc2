"""The code for WebGL2 and WebGPU, run in a browser: what it computes is what the maps say."""

import base64
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps.irradiance.irradiance import in_form
from shrm_cli.maps.kinds import LightMap
from shrm_cli.maps.shader.code import written_code
from shrm_cli.maps.shader.file import pack
from shrm_cli.maps.splitsum.tap_shader import taps_code
from shrm_cli.vocabulary import TAP_COUNTS
from tests.cli.helpers import ROOT
from tests.maps.irradiance.test_shader import make
from tests.maps.shader import cases
from tests.maps.shader.test_code import BOX, PLACES, SHARES, VARYING, WITHOUT, boxed, placed, varied

DRAW = {
    "glsl": Path(__file__).with_name("draw.js").read_text(),
    "wgsl": Path(__file__).with_name("draw_wgsl.js").read_text(),
}
VECTOR = {"glsl": "vec3", "wgsl": "vec3f"}
PRECISION = 3e-5
"""Of 32-bit floats: places on a face are rounded to 1e-6 of a texel, and texels beside each other
differ by as much as the largest, as they are random here."""


def packed(values):
    return base64.b64encode(np.ascontiguousarray(values, dtype=np.float32).tobytes()).decode()


def drawn(
    page, made, normals, views, language, roughness=0.5, f0=(1.0, 1.0, 1.0), place=None, shares=None
):
    """What the code returns in the browser for each pair, or for each at a place."""
    point = "" if place is None else f", {VECTOR[language]}{place}"
    at = "_at" if point else ""
    call = f"shrm_irradiance{at}(n{point})"
    if made.representation != "irradiance":
        surface = f", {roughness}" if isinstance(made, LightMap) else ""
        surface += f", {VECTOR[language]}{f0}" if "f0" in made.surface_arguments else ""
        call = f"shrm_radiance{at}(n, v{point}{surface})"
    if shares is not None:
        call = f"shrm_varied_radiance(n, shrm_tangent(n), v, {', '.join(map(str, shares))})"
    textures = [] if made.representation == "irradiance" else pack(made)
    job = {
        "code": written_code(made, language, "layers").text,
        "call": call,
        "count": len(normals),
        "lighting": packed(made.lighting) if made.representation == "product" else None,
        "pairs": packed([normals, views]),
        "textures": [
            {"name": each.name, "shape": each.values.shape[:3], "values": packed(each.values)}
            for each in textures
        ],
    }
    found = page.evaluate(DRAW[language], job)
    return np.reshape(found, (len(normals), -1))[:, :3]


@pytest.fixture
def secure(watched, site):
    """A page of the loopback: WebGPU is of secure pages alone."""
    folder, address = site
    (folder / "empty.html").write_text('<!doctype html><link rel="icon" href="data:,">')
    watched.page.goto(f"{address}/empty.html")
    watched.requests.clear()
    return watched


@pytest.mark.parametrize("name", cases.FORMS)
@pytest.mark.parametrize("language", DRAW)
def test_the_browser_draws_what_the_map_says(secure, monkeypatch, language, name):
    cases.filter_bilinearly(monkeypatch)
    made = cases.FORMS[name]()
    normals, views = (each.astype(np.float32).astype(float) for each in cases.points(200))
    for surface in cases.SURFACES if isinstance(made, LightMap) else [(0.5, (1.0, 1.0, 1.0))]:
        found = drawn(secure.page, made, normals, views, language, *surface)
        truth = cases.expected(made, normals, views, *surface)
        np.testing.assert_allclose(found, truth, rtol=0, atol=PRECISION * np.abs(truth).max())
    assert (secure.errors, secure.requests) == ([], [])


@pytest.mark.parametrize("name", VARYING)
@pytest.mark.parametrize("language", DRAW)
def test_the_browser_draws_what_varies(secure, monkeypatch, language, name):
    cases.filter_bilinearly(monkeypatch)
    made = cases.FORMS[name]()
    normals, views = (each.astype(np.float32).astype(float) for each in cases.points(200))
    for shares in (each[: made.varies] for each in SHARES):
        found = drawn(secure.page, made, normals, views, language, shares=shares)
        truth = varied(made, normals, views, shares)
        np.testing.assert_allclose(found, truth, rtol=0, atol=PRECISION * np.abs(truth).max())
    assert (secure.errors, secure.requests) == ([], [])


@pytest.mark.parametrize("name", [name for name in cases.FORMS if name not in WITHOUT])
@pytest.mark.parametrize("language", DRAW)
def test_the_browser_looks_up_with_parallax(secure, monkeypatch, language, name):
    cases.filter_bilinearly(monkeypatch)
    made = boxed(cases.FORMS[name]())
    normals, views = (each.astype(np.float32).astype(float) for each in cases.points(100))
    surface = 0.62, (0.9, 0.5, 0.04)
    allowed = PRECISION
    if name.startswith("principal") or name.startswith("lamps of brushed"):
        # Functions of degree 12 that are random tell directions apart that are rounded to 1e-7. The
        # first normals are views as well, about which there is no azimuth but by rounding.
        allowed, normals, views = 1e-4, normals[3:], views[3:]
    elif name.startswith("lamps"):
        # Rounding directions to 6e-8 already changes the truth by 1.5e-5 where a lamp is sharp, and
        # the shader rounds those that it finds at the box.
        allowed = 1e-4
    for place in PLACES:
        found = drawn(secure.page, made, normals, views, language, *surface, place)
        truth = placed(made, normals, views, *surface, place)
        np.testing.assert_allclose(found, truth, rtol=0, atol=allowed * np.abs(truth).max())
    assert (secure.errors, secure.requests) == ([], [])


@pytest.mark.parametrize("language", DRAW)
def test_the_browser_computes_irradiance_with_parallax(secure, language):
    made = make(6)
    made = replace(made, info=replace(made.info, options={"reading": {"proxy": BOX}}))
    normals, views = (each.astype(np.float32).astype(float) for each in cases.points(100))
    for place in PLACES:
        found = drawn(secure.page, made, normals, views, language, place=place)
        truth = made.irradiance(made.info.proxy.directions(np.array(place), normals))
        np.testing.assert_allclose(found, truth, rtol=0, atol=1e-5 * np.abs(truth).max())


LIGHT = {
    "polynomial": lambda: make(2),
    "sum": lambda: make(6),
    "zh3": lambda: in_form(make(2), "zh3"),
    "zh3 of each channel": lambda: in_form(make(2), "zh3-channel"),
}


@pytest.mark.parametrize("name", LIGHT)
@pytest.mark.parametrize("language", DRAW)
def test_the_browser_computes_irradiance(secure, language, name):
    made = LIGHT[name]()
    normals, views = (each.astype(np.float32).astype(float) for each in cases.points(200))
    found = drawn(secure.page, made, normals, views, language)
    truth = made.irradiance(normals)
    np.testing.assert_allclose(found, truth, rtol=0, atol=3e-6 * np.abs(truth).max())


@pytest.mark.parametrize("name", cases.FORMS)
def test_the_browser_compiles_arrays_of_cubes_in_wgsl(secure, name):
    made = cases.FORMS[name]()
    try:
        code = written_code(made, "wgsl", "cube-array").text
    except MapError:  # cubes that no hardware filters, as `test_code` says
        return
    assert secure.page.evaluate(COMPILE, code) == []


WGSL = """
@group(0) @binding(0) var levels: texture_cube<f32>;
@group(0) @binding(1) var filtered: sampler;
fn shrm_light(d: vec3f, roughness: f32) -> vec3f
{
    return textureSampleLevel(levels, filtered, d, 8.0 * roughness).rgb;
}
@fragment fn main(@location(0) n: vec3f, @location(1) v: vec3f) -> @location(0) vec4f
{
    return vec4f(shrm_taps(n, normalize(cross(n, v)), v, 0.5, 0.1), 1.0);
}
"""
COMPILE = """async (code) => {
    const device = await (await navigator.gpu.requestAdapter()).requestDevice();
    const { messages } = await device.createShaderModule({ code }).getCompilationInfo();
    return messages.map((each) => `${each.lineNum}: ${each.message}`);
}"""


@pytest.mark.parametrize("taps", TAP_COUNTS)
def test_the_browser_compiles_the_taps_in_wgsl(secure, taps):
    code = taps_code(taps, "wgsl") + WGSL
    assert secure.page.evaluate(COMPILE, code) == []
    assert secure.page.evaluate(COMPILE, code.replace("shrm_fit(q", "shrm_fit(rough", 1)) != []


BEVY = """
struct Layer { N: vec3f, roughness: f32 }
struct LightingInput { layers: array<Layer, 2>, V: vec3f, Ba: vec3f, anisotropy: f32 }
struct LightProbes {
    view_cubemap_index: i32, smallest_specular_mip_level_for_view: u32, intensity_for_view: f32
}
struct Radiances { irradiance: vec3f, radiance: vec3f }
const LAYER_BASE = 0u;
@group(0) @binding(0) var specular_environment_map: texture_cube<f32>;
@group(0) @binding(1) var environment_map_sampler: sampler;
@group(0) @binding(2) var<uniform> light_probes: LightProbes;
fn environment_map_light(input: ptr<function, LightingInput>) -> vec3f
{
    var radiances = Radiances();
%s    return radiances.radiance;
}
"""
"""What the patch finds in Bevy, and where it stands there."""


@pytest.mark.parametrize("is_array", [False, True])
def test_the_browser_compiles_the_patch_of_bevy(secure, is_array):
    """Browsers have no arrays of textures; one texture stands for them."""
    text = (ROOT / "docs" / "anisotropy.md").read_text()
    light, patch = re.findall(r"```rust\n(.*?)```", text, re.S)
    array, one = re.search(r"#ifdef MULT\w+\n(.*?)#else\n(.*?)#endif\n", light, re.S).groups()
    light = re.sub(r"#ifdef.*?#endif\n", array if is_array else one, light, flags=re.S)
    light = light.replace("maps[light_probes.view_cubemap_index]", "map").replace("bindings::", "")
    patch = re.sub("#.*\n", "", patch)
    code = taps_code(5, "wgsl") + light + BEVY % patch
    assert secure.page.evaluate(COMPILE, code) == []
    assert secure.page.evaluate(COMPILE, code.replace("(*input).Ba", "(*input).Bo")) != []
