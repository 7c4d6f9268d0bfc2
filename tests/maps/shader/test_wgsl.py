"""Lines of GLSL in WGSL; that browsers compute the same by both is a test of tests/web."""

import re

import pytest

from shrm_cli.maps.shader.code import written_code
from shrm_cli.maps.shader.language import in_wgsl
from tests.maps.shader import cases


@pytest.mark.parametrize(
    ("glsl", "wgsl"),
    [
        (
            "vec3 shrm_f(vec3 n, int layer)\n{",
            "fn shrm_f(n: vec3f, layer: i32) -> vec3f\n{",
        ),
        ("    float a = max(b, 1.0), c;", "    var a: f32 = max(b, 1.0);\n    var c: f32;"),
        ("    float w[7];", "    var w: array<f32, 7>;"),
        ("    for (k = 0; k < 2; ++k) {", "    for (k = 0; k < 2; k++) {"),
        ("    x = atan(float(k), int(y));", "    x = atan2(f32(k), i32(y));"),
        ("    return x < 0.0 ? -a : a;", "    return select(a, -a, x < 0.0);"),
        ("    a = f(b, c == 1 ? d[i] : e);", "    a = f(b, select(e, d[i], c == 1));"),
        ("    a = b ? c : (d ? e : f);", "    a = select((select(f, e, d)), c, b);"),
        ("    a += b <= c ? d : e ? f : g;", "    a += select(select(g, f, e), d, b <= c);"),
        ("/* Is x ? y : z? */", "/* Is x ? y : z? */"),
    ],
)
def test_statements(glsl, wgsl):
    assert in_wgsl(glsl) == wgsl


def test_textures_have_bindings():
    code = written_code(cases.FORMS["splitsum linear"](), "wgsl", "cube-array").text
    found = re.findall(r"@group\(0\) @binding\((\d)\) var (\w+):", code)
    assert [int(number) for number, _ in found] == list(range(len(found)))
    assert {"shrm_sampler", "shrm_cubes", "shrm_cubes3", "shrm_table"} <= {n for _, n in found}
