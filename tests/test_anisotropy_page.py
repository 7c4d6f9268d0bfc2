"""docs/anisotropy.md holds the code that the package writes, and what it has measured."""

import re
import subprocess

import pytest

from shrm_cli.maps.splitsum.split_sum import TURNS
from shrm_cli.maps.splitsum.tap_shader import even_taps_code, taps_code
from tests.cli.helpers import ROOT
from tests.maps.khronos import compile_fragment
from tests.maps.shader.test_code import STRICT, compiler_of_c

TEXT = (ROOT / "docs" / "anisotropy.md").read_text()


@pytest.mark.parametrize("language", ["glsl", "wgsl"])
def test_the_code_is_that_of_the_package(language):
    even = [even_taps_code(2, language)] if language == "glsl" else []
    assert re.findall(rf"```{language}\n(.*?)```", TEXT, re.S) == [taps_code(5, language), *even]


def test_the_code_of_glsl_compiles_beside_the_look_up_of_an_engine(tmp_path):
    text = (
        "#version 300 es\nprecision highp float;\nuniform samplerCube levels;\n"
        "vec3 shrm_light(vec3 d, float roughness)"
        "{ return textureLod(levels, d, 8.0 * roughness).rgb; }\n"
        f"{taps_code(5, 'glsl')}in vec3 n;\nin vec3 v;\nout vec4 color;\n"
        "void main() { color = vec4(shrm_taps(n, cross(n, v), v, 0.5, 0.1), 1.0); }\n"
    )
    done = compile_fragment(tmp_path, "glsl", text)
    assert done.returncode == 0, done.stdout


def test_the_code_of_c_compiles_beside_the_look_up_of_a_program(tmp_path):
    head, vectors, code = taps_code(3, "c").partition("} shrm_vec3;\n")
    light = "static shrm_vec3 shrm_light(shrm_vec3 d, double roughness);\n"
    rest = (
        "static shrm_vec3 shrm_light(shrm_vec3 d, double roughness)"
        "{ return shrm_scale(roughness, d); }\n"
        "int main(void) { shrm_vec3 a = shrm_vec(0, 0, 1), t = shrm_vec(1, 0, 0);\n"
        "return shrm_taps(a, t, a, 0.5, 0.1).z > 0 ? 0 : 1; }\n"
    )
    (tmp_path / "a.c").write_text(head + vectors + light + code + rest, encoding="ascii")
    program = tmp_path / "a"
    done = subprocess.run(
        [compiler_of_c(), *STRICT, tmp_path / "a.c", "-o", program, "-lm"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert subprocess.run([program], check=False).returncode == 0


def test_the_numbers_of_the_environment_brdf_are_those_of_the_package():
    (c, d), (e, f) = TURNS["total"], TURNS["bias"]
    assert f"`m + ({d} z - {-c}) w d`" in TEXT
    assert f"`m + ({e} +\n{f} z) w d`" in TEXT


STUBS = {
    "Filament": "#define MATERIAL_HAS_ANISOTROPY\n#define MIN_ROUGHNESS 0.007\n"
    "struct PixelParams { float roughness, anisotropy, perceptualRoughness;"
    " vec3 anisotropicT, anisotropicB; };\n"
    "uniform PixelParams pixel;\nuniform vec3 shading_normal, shading_view, E;\n"
    "vec3 prefilteredRadiance(vec3 d, float r) { return textureLod(levels, d, 4.0 * r).rgb; }\n"
    "vec3 shrm_light(vec3 d, float roughness) { return prefilteredRadiance(d, roughness); }\n",
    "glTF Sample Viewer": "uniform int u_MipCount;\n"
    "vec4 getSpecularSample(vec3 d, float lod) { return textureLod(levels, d, lod); }\n",
}
"""What the patches find in the engines."""


@pytest.mark.parametrize("engine", STUBS)
def test_patches_compile_beside_what_they_find(tmp_path, engine):
    patch = re.search(rf"### {engine}\n.*?```c\n(.*?)```", TEXT, re.S)[1]
    head = "#version 300 es\nprecision highp float;\nuniform samplerCube levels;\nout vec4 color;\n"
    if engine == "Filament":
        body = (
            f"{taps_code(5, 'glsl')}void main() {{\nvec3 Fr;\n{patch}color = vec4(Fr, 1.0);\n}}\n"
        )
    else:
        light, _, rest = patch.partition("vec3 getIBL")
        body = f"{light}{taps_code(5, 'glsl')}vec3 getIBL{rest}"
        axes = "vec3(0, 0, 1), vec3(0, 0, 1), 0.5, 0.6, vec3(1, 0, 0)"
        body += f"void main() {{ color = vec4(getIBLRadianceAnisotropy({axes}), 1.0); }}\n"
    done = compile_fragment(tmp_path, "glsl", head + STUBS[engine] + body)
    assert done.returncode == 0, done.stdout
