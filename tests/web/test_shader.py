"""The code for WebGL2, run in a browser: what it draws is what the maps say."""

import base64
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.maps.shader.code import look_up_code
from shrm_cli.maps.shader.file import pack
from shrm_cli.maps.splitsum.brushed_shader import taps_code
from shrm_cli.render.shading import takes_f0
from shrm_cli.vocabulary import TAP_COUNTS
from tests.maps.shader import cases

DRAW = Path(__file__).with_name("draw.js").read_text()
PRECISION = 3e-5
"""Of 32-bit floats: places on a face are rounded to 1e-6 of a texel, and texels beside each other
differ by as much as the largest, as they are random here."""


def packed(values):
    return base64.b64encode(np.ascontiguousarray(values, dtype=np.float32).tobytes()).decode()


def drawn(page, made, normals, views, call):
    """What the code returns in the browser for each pair, and the milliseconds that it took."""
    job = {
        "code": look_up_code(made, "glsl", "layers"),
        "call": call,
        "count": len(normals),
        "pairs": packed([normals, views]),
        "textures": [
            {"name": each.name, "shape": each.values.shape[:3], "values": packed(each.values)}
            for each in pack(made)
        ],
    }
    found = page.evaluate(DRAW, job)
    return np.reshape(found["pixels"], (-1, 4))[:, :3], found["milliseconds"]


@pytest.mark.parametrize("name", cases.FORMS)
def test_the_browser_draws_what_the_map_says(watched, monkeypatch, name):
    cases.filter_bilinearly(monkeypatch)
    made = cases.FORMS[name]()
    normals, views = (each.astype(np.float32).astype(float) for each in cases.points(200))
    for roughness, f0 in cases.SURFACES if made.needs_surface else [(0.5, (1.0, 1.0, 1.0))]:
        surface = f", {roughness}" if made.needs_surface else ""
        surface += f", vec3{f0}" if takes_f0(made) else ""
        found, _ = drawn(watched.page, made, normals, views, f"shrm_radiance(n, v{surface})")
        truth = cases.expected(made, normals, views, roughness, f0)
        np.testing.assert_allclose(found, truth, rtol=0, atol=PRECISION * np.abs(truth).max())
    assert (watched.errors, watched.requests) == ([], [])


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
def test_the_browser_compiles_the_taps_in_wgsl(watched, site, taps):
    """WebGPU is of secure pages alone, as those of the loopback are."""
    folder, address = site
    (folder / "empty.html").write_text("<!doctype html>")
    watched.page.goto(f"{address}/empty.html")
    code = taps_code(taps, "wgsl") + WGSL
    assert watched.page.evaluate(COMPILE, code) == []
    assert watched.page.evaluate(COMPILE, code.replace("shrm_fit(q", "shrm_fit(rough", 1)) != []
