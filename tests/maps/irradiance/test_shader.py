"""Irradiance as source code: compiled, and run against the map that it was made from."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.irradiance.shader import irradiance_snippet
from shrm_cli.maps.irradiance.window import Window, window_factors
from tests.brute_force import unit
from tests.maps.khronos import compile_fragment

ORDERS = (0, 1, 2)
HIGHER = (3, 7, 16)
"""Orders above that of the polynomial."""
NAMES = [
    "room.exr",
    "*/ int evil; /*",
    "a\nb\r\u2028c",
    "back\\slash\\",
    "trigraph ??/\nfloat x;",
    'quote" // $(rm) #define x',
    "pröbe \N{SNOWMAN}.exr",
    "x" * 5000,
    "",
]
STAGES = {
    "glsl": "#version {version}\n{precision}{snippet}\nin vec3 n;\nout vec4 color;\n"
    "void main() {{ color = vec4(shrm_irradiance(normalize(n)), 1.0); }}\n",
    "hlsl": "{snippet}\nfloat4 main(float3 n : NORMAL) : SV_Target\n"
    "{{ return float4(shrm_irradiance(normalize(n)), 1.0); }}\n",
}
C_MAIN = """
#include <stdio.h>
{snippet}
int main(void)
{{
    double n[3], e[3];
    while (scanf("%lf %lf %lf", n, n + 1, n + 2) == 3) {{
        shrm_irradiance(n, e);
        printf("%.17g %.17g %.17g\\n", e[0], e[1], e[2]);
    }}
    return 0;
}}
"""
# Just what the snippet uses of GLSL, or of HLSL, as C++.
CPP_MAIN = """
#include <cstdio>
struct vec3 {{ float x, y, z; vec3(float a, float b, float c) : x(a), y(b), z(c) {{}} }};
typedef vec3 float3;
static vec3 operator*(vec3 a, float b) {{ return vec3(a.x * b, a.y * b, a.z * b); }}
static vec3 operator+(vec3 a, vec3 b) {{ return vec3(a.x + b.x, a.y + b.y, a.z + b.z); }}
{snippet}
int main()
{{
    double x, y, z;
    while (std::scanf("%lf %lf %lf", &x, &y, &z) == 3) {{
        vec3 e = shrm_irradiance(vec3(x, y, z)) + vec3(0, 0, 0) * 1;
        std::printf("%.9g %.9g %.9g\\n", e.x, e.y, e.z);
    }}
}}
"""


def make(order, name="room.exr", scale=1.0, window=None):
    rng = np.random.default_rng(order)
    coefficients = rng.normal(size=((order + 1) ** 2, 3)) * scale
    coefficients[0] += 5 * scale  # nowhere near 0, as light is
    info = MapInfo(order, 0, 0.0, 1.0, 0.0, probe=name, probe_sha256="ab" * 32)
    return Irradiance(coefficients, info, window=window or Window())


def compiler(*names):
    found = next((path for name in names if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(f"no compiler: {' or '.join(names)}")
    return found


def run(command, text=""):
    return subprocess.run(
        command, input=text, capture_output=True, text=True, timeout=60, check=False
    )


def results(program, normals):
    """What a compiled program prints for each of the normals."""
    lines = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in normals.tolist())
    return np.array(run([program], lines).stdout.split(), dtype=float).reshape(-1, 3)


def compile_c(folder, snippet, standard):
    source, program = folder / "main.c", folder / "main"
    source.write_text(C_MAIN.format(snippet=snippet), encoding="ascii")
    strict = ["-Wall", "-Wextra", "-Werror", "-pedantic", f"-std={standard}"]
    return program, run([compiler("cc", "gcc", "clang"), *strict, source, "-o", program, "-lm"])


def validate(folder, language, snippet, version="330 core", precision=""):
    text = STAGES[language].format(snippet=snippet, version=version, precision=precision)
    return compile_fragment(folder, language, text)


@pytest.mark.parametrize("order", ORDERS + HIGHER)
@pytest.mark.parametrize(
    ("scale", "standard"), [(1.0, "c89"), (1.0, "c99"), (1e-9, "c89"), (3e7, "c17")]
)
def test_c_computes_the_irradiance(tmp_path, order, scale, standard):
    made, normals = make(order, scale=scale), unit(np.random.default_rng(1), 100)
    program, done = compile_c(tmp_path, irradiance_snippet(made, "c"), standard)
    assert (done.returncode, done.stderr) == (0, "")
    found = results(program, normals)
    np.testing.assert_allclose(found, made.irradiance(normals), rtol=1e-12)
    np.testing.assert_allclose(found, np.pi * made.radiance(normals, -normals), rtol=1e-12)


@pytest.mark.parametrize("order", [0, 2, 5])
@pytest.mark.parametrize("standard", ["c89", "c99"])
def test_code_that_nothing_calls_is_no_warning(tmp_path, order, standard):
    """A header with the code is included by files that do not call it, too."""
    source = tmp_path / "alone.c"
    source.write_text(irradiance_snippet(make(order), "c"), encoding="ascii")
    strict = ["-Wall", "-Wextra", "-Werror", "-pedantic", f"-std={standard}", "-c"]
    done = run([compiler("cc", "gcc", "clang"), *strict, source, "-o", tmp_path / "alone.o"])
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("language", ["glsl", "hlsl"])
@pytest.mark.parametrize("order", ORDERS)
def test_shaders_compute_the_irradiance(tmp_path, order, language):
    """Their text compiled as C++, in 32-bit floats."""
    made, normals = make(order), unit(np.random.default_rng(1), 100)
    source, program = tmp_path / "main.cpp", tmp_path / "main"
    source.write_text(CPP_MAIN.format(snippet=irradiance_snippet(made, language)))
    done = run([compiler("c++", "g++", "clang++"), "-w", source, "-o", program])
    assert (done.returncode, done.stderr) == (0, "")
    np.testing.assert_allclose(results(program, normals), made.irradiance(normals), rtol=2e-6)


@pytest.mark.parametrize("order", [*ORDERS, 16])
@pytest.mark.parametrize(
    ("language", "version", "precision"),
    [
        ("glsl", "330 core", ""), ("glsl", "450", ""),
        ("glsl", "300 es", "precision highp float;\n"), ("hlsl", "", ""),
    ],
)  # fmt: skip
def test_shaders_compile(tmp_path, order, language, version, precision):
    snippet = irradiance_snippet(make(order), language)
    done = validate(tmp_path, language, snippet, version, precision)
    assert done.returncode == 0, done.stdout
    assert "ERROR" not in done.stdout
    assert "WARNING" not in done.stdout


@pytest.mark.parametrize("language", ["glsl", "hlsl"])
def test_the_compiler_refuses_what_is_wrong(tmp_path, language):
    snippet = irradiance_snippet(make(2), language).replace("return ", "return wrong + ")
    assert validate(tmp_path, language, snippet).returncode != 0


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_no_name_escapes_from_the_comment(tmp_path, name):
    made = make(2, name)
    for language in ("glsl", "hlsl", "c"):
        snippet = irradiance_snippet(made, language)
        assert snippet.isascii()
        assert snippet.count("*/") == snippet.count("/*") == 1
        plain = irradiance_snippet(make(2), language)
        assert len(snippet.splitlines()) == len(plain.splitlines())
        assert snippet.partition("*/")[2] == plain.partition("*/")[2]
        assert max(map(len, snippet.splitlines())) < 120
    _, done = compile_c(tmp_path, irradiance_snippet(made, "c"), "c89")
    assert (done.returncode, done.stderr) == (0, "")
    assert validate(tmp_path, "glsl", irradiance_snippet(made, "glsl")).returncode == 0


@pytest.mark.parametrize("language", ["glsl", "hlsl", "wgsl", "c"])
def test_the_comment_tells_where_it_comes_from(language):
    window = Window("hann", 2.5, tuple(window_factors("hann", 2.5, 2).tolist()))
    comment = irradiance_snippet(make(2, "my room.exr", window=window), language).partition("*/")[0]
    for words in ("my room.exr", "ab" * 32, "Order: 2", "hann, width 2.5", "without 1/pi", "+Y up"):
        assert words in comment
    assert "window: none" in irradiance_snippet(make(2), language)


def test_numbers_are_in_place():
    """Those of the polynomial, in single precision for shaders and double for C."""
    made = make(2)
    n = np.array([0.0, 0.0, 1.0])
    for language, digits in (("glsl", 9), ("c", 17)):
        body = irradiance_snippet(made, language).partition("*/")[2]
        numbers = re.findall(r"-?\d+\.\d+(?:e[-+]\d+)?", body)
        assert len(numbers) == 27
        assert max(len(re.sub(r"\D|e.*", "", text).lstrip("0")) for text in numbers) == digits
        values = np.array(numbers, dtype=float)
        by_term = values.reshape(9, 3) if language == "glsl" else values.reshape(3, 9).T
        at_z = by_term[0] + by_term[3] + by_term[7]  # what is left at x = y = 0, z = 1
        np.testing.assert_allclose(at_z, made.irradiance(n), rtol=1e-8)


def test_numbers_of_any_size_have_a_point(tmp_path):
    coefficients = np.zeros((9, 3))
    coefficients[0] = (1 / 0.886226925452758, 1e-30, 2e20)
    coefficients[2] = -1e-12
    made = Irradiance(coefficients, make(2).info)
    for language in ("glsl", "hlsl"):
        assert validate(tmp_path, language, irradiance_snippet(made, language)).returncode == 0
    program, done = compile_c(tmp_path, irradiance_snippet(made, "c"), "c89")
    assert (done.returncode, done.stderr) == (0, "")
    normals = unit(np.random.default_rng(1), 9)
    np.testing.assert_allclose(results(program, normals), made.irradiance(normals), rtol=1e-12)


def test_what_is_refused():
    with pytest.raises(MapError, match="orders up to 16, not 17; lower") as caught:
        irradiance_snippet(make(17), "glsl")
    assert "\n" not in str(caught.value)
    with pytest.raises(MapError, match="take one of glsl, hlsl, wgsl, c"):
        irradiance_snippet(make(2), "metal")
    bright = make(2, scale=1e38)
    with pytest.raises(MapError, match="beyond the 32-bit floats"):
        irradiance_snippet(bright, "hlsl")
    assert "e+38" in irradiance_snippet(bright, "c")
