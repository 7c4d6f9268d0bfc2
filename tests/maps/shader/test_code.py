"""The code of every form: compiled by Khronos's compiler, and run in C beside the map."""

import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.maps.kinds import LightMap
from shrm_cli.maps.principal.principal import PrincipalMap
from shrm_cli.maps.product.product import VaryingProduct
from shrm_cli.maps.shader.code import _corner, written_code
from shrm_cli.maps.shader.file import pack
from shrm_cli.maps.shader.language import LANGUAGES
from shrm_cli.maps.shader.pages import Run
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.render.boxed import parts_of, seen_from
from shrm_cli.sphere.directions import horizontal_tangents
from tests.maps.khronos import compile_fragment
from tests.maps.scenes import make_info
from tests.maps.shader import cases

STAGES = {
    "glsl": "{head}{code}\nin vec3 n;\nin vec3 v;\nout vec4 color;\n"
    "void main() {{ color = vec4({call}, 1.0); }}\n",
    "hlsl": "{code}\nfloat4 main(float3 n : NORMAL, float3 v : TEXCOORD) : SV_Target\n"
    "{{ return float4({call}, 1.0); }}\n",
}
HEADS = {
    ("glsl", "layers"): "#version 300 es\nprecision highp float;\nprecision highp int;\n",
    ("glsl", "cube-array"): "#version 400 core\n",
    ("hlsl", "layers"): "",
    ("hlsl", "cube-array"): "",
}
C_MAIN = """
{code}
#include <stdio.h>
#include <stdlib.h>
static const float *loaded(const char *name, size_t count)
{{
    FILE *file = fopen(name, "rb");
    float *values = malloc(count * sizeof *values);
    if (fread(values, sizeof *values, count, file) != count) exit(1);
    fclose(file);
    return values;
}}
#define GIVEN(k) (argc > k ? atof(argv[k]) : 0.0)
int main(int argc, char **argv)
{{
    double a, b, c, d, e, f;
    shrm_vec3 found;
    {load}
    while (scanf("%lf %lf %lf %lf %lf %lf", &a, &b, &c, &d, &e, &f) == 6) {{
        found = {call};
        printf("%.9g %.9g %.9g\\n", found.x, found.y, found.z);
    }}
    (void)argc;
    (void)argv;
    return 0;
}}
"""
STRICT = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-std=c89"]
FORMS = sorted(cases.FORMS)
SOME = {
    "cabral", "lamps of layers", "principal brushed sum", "product of two parameters", "she lobe",
    "shrm sum", "splitsum cloth", "splitsum linear",
}  # fmt: skip
"""A form of each kind, the longest."""


BOX = {"at": [0.5, 1.6, 3.0], "min": [-1.0, 0.0, 2.0], "max": [3.0, 2.5, 7.0]}
PLACES = ((1.4, 1.1, 4.3), (3.0, 0.2, 2.0), (-9.0, 1.0, 3.0))
"""Within a box, on an edge of it, and outside."""


def call_of(made, language, name="shrm_radiance", point=""):
    vector = {"glsl": "vec3", "hlsl": "float3", "c": "shrm_vec"}[language]
    surface = ", 0.5" if isinstance(made, LightMap) else ""
    surface += f", {vector}(1.0, 0.5, 0.25)" if "f0" in made.surface_arguments else ""
    return f"{name}(normalize(n), normalize(v){point}{surface})"


def run(command, text=""):
    return subprocess.run(
        command, input=text, capture_output=True, text=True, timeout=120, check=False
    )


def compiler_of_c():
    found = next((path for name in ("cc", "gcc", "clang") if (path := shutil.which(name))), None)
    return found or pytest.skip("no compiler of C")


def in_c(folder, made, normals, views, roughness, f0, dtype=np.float32, place=None, shares=None):
    """What the code in C computes for each pair, with textures of some precision; at a place."""
    compiler = compiler_of_c()
    load = ""
    for texture in pack(made):
        texture.values.astype(dtype).astype(np.float32).tofile(folder / texture.name)
        load += f'{texture.name} = loaded("{folder / texture.name}", {texture.values.size});\n'
    surface = "" if place is None else ", shrm_vec(GIVEN(5), GIVEN(6), GIVEN(7))"
    surface += ", GIVEN(1)" if isinstance(made, LightMap) else ""
    surface += ", shrm_vec(GIVEN(2), GIVEN(3), GIVEN(4))" if "f0" in made.surface_arguments else ""
    name = "shrm_radiance" if place is None else "shrm_radiance_at"
    call = f"{name}(shrm_vec(a, b, c), shrm_vec(d, e, f){surface})"
    if shares is not None:
        own = "".join(f", GIVEN({5 + k})" for k in range(len(shares)))
        call = f"shrm_tangent(shrm_vec(a, b, c)), shrm_vec(d, e, f){own})"
        call = f"shrm_varied_radiance(shrm_vec(a, b, c), {call}"
    source, program = folder / "main.c", folder / "main"
    text = C_MAIN.format(code=written_code(made, "c").text, load=load, call=call)
    if not program.exists() or source.read_text(encoding="ascii") != text:
        source.write_text(text, encoding="ascii")
        done = run([compiler, *STRICT, source, "-o", program, "-lm"])
        assert (done.returncode, done.stderr) == (0, "")
    lines = "".join(" ".join(map(repr, row)) + "\n" for row in np.c_[normals, views].tolist())
    given = map(str, (roughness, *f0, *(place or shares or ())))
    return np.array(run([program, *given], lines).stdout.split(), dtype=float).reshape(-1, 3)


@pytest.mark.parametrize("name", FORMS)
def test_c_computes_what_the_map_does(tmp_path, monkeypatch, name):
    """With cubes filtered bilinearly, as all code does: exactly, but for 32-bit texels."""
    cases.filter_bilinearly(monkeypatch)
    made, (normals, views) = cases.FORMS[name](), cases.points(60)
    for roughness, f0 in cases.SURFACES if isinstance(made, LightMap) else [(0.5, (1.0, 1.0, 1.0))]:
        found = in_c(tmp_path, made, normals, views, roughness, f0)
        truth = cases.expected(made, normals, views, roughness, f0)
        np.testing.assert_allclose(found, truth, rtol=0, atol=digits_of(name) * np.abs(truth).max())


def digits_of(name, usual=2e-7):
    """How exact C is. Python knows places in tables of BRDFs, unlike C, as 32-bit numbers alone."""
    return 1e-5 if "table" in name else usual


SHARES = ((0.0, 1.0), (0.07, 0.61), (0.93, 0.3), (1 / 3, 1.0), (-0.2, 1.3))
"""Places of parameters on their ways: at ends, between values and beyond, and at one of a value."""
VARYING = sorted(name for name, form in cases.FORMS.items() if form().varies)


def varied(made, normals, views, shares):
    """What a map reflects with the tangents of the code, of parameters at shares of their ways."""
    where = shares[0] if made.varies == 1 else shares
    return made.varied_radiance(normals, horizontal_tangents(normals), views, where)


@pytest.mark.parametrize("name", VARYING)
def test_c_computes_it_wherever_parameters_are(tmp_path, monkeypatch, name):
    cases.filter_bilinearly(monkeypatch)
    made, (normals, views) = cases.FORMS[name](), cases.points(60)
    seen = []
    for shares in (each[: made.varies] for each in SHARES):
        found = in_c(tmp_path, made, normals, views, 0.5, (1.0, 1.0, 1.0), shares=shares)
        truth = varied(made, normals, views, shares)
        np.testing.assert_allclose(found, truth, rtol=0, atol=2e-7 * np.abs(truth).max())
        seen.append(truth)
    assert np.ptp(seen, axis=0).max() > 0.1 * np.abs(seen).max()


def test_images_that_fit_into_no_array_are_refused():
    made = cases.varying(1, {"a": tuple(range(64))}, 64, order=0)
    many = replace(made.product.textures[0], table=np.zeros((4, 4, 289, 1)))
    textures = VaryingProduct((many,) * 64, made.product.steps, many.info)
    assert pack(textures)[1].values.shape == (229, 36, 36, 3)
    wide = replace(many, table=np.broadcast_to(many.table[:1, :1], (1024, 1024, 289, 1)))
    with pytest.raises(MapError, match="18496 images of 1024 x 1024 texels"):
        written_code(replace(textures, textures=(wide,) * 64), "glsl", "layers")


def boxed(made):
    """A map whose probe knows of a box; None of what is about the tangent, without parallax."""
    within = made.stored
    info = replace(within.info, options={"reading": {"proxy": BOX}})
    inner = within.with_info(info)
    placed = inner if made is within else replace(made, map=inner)
    return placed if "shrm_radiance_at" in written_code(placed, "c").text else None


def placed(made, normals, views, roughness, f0, place):
    """The radiance at a place, of each part of a map looked up on its own."""
    total = 0
    for part, center in parts_of(made, made):
        given = normals, views, horizontal_tangents(normals)
        turned, seen, tangents = seen_from(made, center, given, np.array(place))
        if getattr(part, "representation", None) in ("splitsum", "she"):
            total = total + cases.expected(part, turned, seen, roughness, f0)
        else:
            total = total + part.brushed_radiance(turned, tangents, seen)
    return total


WITHOUT = {"shrm tangent"}
"""Forms whose code has no parallax."""


@pytest.mark.parametrize("name", FORMS)
def test_c_has_the_parallax_of_pictures(tmp_path, monkeypatch, name):
    """A point in the box, one on its edge, and one outside, for axes and generic directions."""
    cases.filter_bilinearly(monkeypatch)
    made, (normals, views) = boxed(cases.FORMS[name]()), cases.points(60)
    assert (made is None) == (name in WITHOUT)
    if made is None:
        return
    for place in PLACES:
        found = in_c(tmp_path, made, normals, views, 0.62, (0.9, 0.5, 0.04), place=place)
        truth = placed(made, normals, views, 0.62, (0.9, 0.5, 0.04), place)
        digits = digits_of(name, 3e-7)
        np.testing.assert_allclose(found, truth, rtol=0, atol=digits * np.abs(truth).max())


@pytest.mark.parametrize(
    "name",
    [
        "shrm sum",
        "splitsum linear",
        "lamps",
        "principal sum",
        "product",
        "principal brushed sum",
        "lamps of brushed",
    ],
)
@pytest.mark.parametrize(("language", "textures"), HEADS)
def test_code_with_parallax_compiles(tmp_path, language, textures, name):
    made = boxed(cases.FORMS[name]())
    code = written_code(made, language, textures).text
    point = ", vec3(1.0, 2.0, 3.0)".replace("vec3", "vec3" if language == "glsl" else "float3")
    call = call_of(made, language, "shrm_radiance_at", point)
    assert compiled(tmp_path, language, code, HEADS[language, textures], call) == []


@pytest.mark.parametrize("language", ["glsl", "hlsl"])
def test_irradiance_with_parallax_compiles(tmp_path, language):
    made = cases.irradiance(4)
    made = replace(made, info=replace(made.info, options={"reading": {"proxy": BOX}}))
    code, vector = written_code(made, language).text, "vec3" if language == "glsl" else "float3"
    call = f"shrm_irradiance_at(n, {vector}(1.0, 2.0, 3.0) + v)"
    assert compiled(tmp_path, language, code, HEADS[language, "cube-array"], call) == []


@pytest.mark.parametrize("name", sorted(SOME))
def test_c_that_nothing_calls_is_no_warning(tmp_path, name):
    """A header with the code is included by files that do not call it, too."""
    compiler, source = compiler_of_c(), tmp_path / "alone.c"
    made = cases.FORMS[name]()
    source.write_text(written_code(boxed(made) or made, "c").text, encoding="ascii")
    done = run([compiler, *STRICT, "-c", source, "-o", tmp_path / "alone.o"])
    assert (done.returncode, done.stderr) == (0, "")


def test_exponentials_are_numbers_where_half_loses_the_tail(tmp_path):
    """Of a surface of f0 = 0 that faces the viewer; smaller halves than 6e-8 are 0."""
    made, (normals, _) = cases.FORMS["she lobe"](), cases.points(20)
    for roughness in np.linspace(0.06, 0.2, 5):  # a single program for all of them
        found = in_c(tmp_path, made, normals, normals, roughness, (0.0, 0.0, 0.0), np.float16)
        assert np.isfinite(found).all(), roughness
        assert np.abs(found).max() < 1e-5, roughness


def is_proof(head, name):
    """Arrays of cubes are looked up alike in both languages, and each is compiled with layers."""
    return head == ("hlsl", "cube-array") and name not in SOME


def compiled(folder, language, code, head, call):
    """What Khronos's compiler says of a fragment shader with the code; nothing if it is right."""
    text = STAGES[language].format(head=head, code=code, call=call)
    done = compile_fragment(folder, language, text)
    said = done.stdout.strip().splitlines()[1:]
    return said or [str(done.returncode)] * (done.returncode != 0)


@pytest.mark.parametrize(
    ("language", "textures", "name"),
    [
        pytest.param(*head, name, marks=pytest.mark.proof if is_proof(head, name) else ())
        for head in HEADS
        for name in FORMS
    ],
)
def test_code_compiles(tmp_path, language, textures, name):
    made = cases.FORMS[name]()
    unfit = made.sampling == "border" or (made.frame == "local" and isinstance(made, Shrm))
    if textures == "cube-array" and (unfit or name == "shrm compressed local"):
        with pytest.raises(MapError, match="layers"):
            written_code(made, language, textures)
        return
    code = written_code(made, language, textures).text
    assert max(map(len, code.partition("*/")[0].splitlines())) < 110
    assert (
        compiled(tmp_path, language, code, HEADS[language, textures], call_of(made, language)) == []
    )


def test_more_principal_cubes_are_no_longer_code():
    """A browser took seconds to compile 50 cubes that were written out one by one."""
    texts = []
    for degrees in [(1, 0), (12, 6, 5, 4, 3, 2, 1, 1, 0, 0)]:
        made = PrincipalMap((cases.lobe(0, degrees=degrees),), make_info(4, 3))
        texts.append(written_code(made, "glsl", "layers").text.partition("*/")[2])
    assert len(texts[1]) == pytest.approx(len(texts[0]), rel=0.02)


def test_the_compiler_refuses_what_is_wrong(tmp_path):
    made = cases.FORMS["shrm"]()
    code = written_code(made, "glsl", "layers").text.replace("return sum", "return wrong")
    assert compiled(tmp_path, "glsl", code, HEADS["glsl", "layers"], call_of(made, "glsl"))


@pytest.mark.parametrize("name", FORMS)
def test_no_form_needs_more_samplers_than_its_textures(name):
    made = cases.FORMS[name]()
    code = written_code(made, "glsl", "layers").text
    names = [line.split()[-1].strip(";") for line in code.splitlines() if "sampler2DArray" in line]
    assert names == [texture.name for texture in pack(made)]
    assert set(names) <= {"shrm_layers", "shrm_table", "shrm_product", "shrm_lobe"}


@pytest.mark.parametrize("name", ["*/ int evil; /*", "a\nb", "trigraph ??/\nfloat x;", "x" * 5000])
@pytest.mark.parametrize("language", ["glsl", "hlsl", "wgsl", "c"])
def test_no_name_escapes_from_the_comment(language, name):
    made = cases.FORMS["shrm"]()
    named = replace(made, info=replace(made.info, probe=name))
    plain, code = written_code(made, language).text, written_code(named, language).text
    assert code.isascii()
    assert code.partition("*/")[2] == plain.partition("*/")[2]
    assert len(code.splitlines()) == len(plain.splitlines())


def test_what_has_no_code_is_refused():
    made = cases.FORMS["shrm"]()
    with pytest.raises(MapError, match="take one of glsl, hlsl, wgsl, c"):
        written_code(made, "metal")
    with pytest.raises(ArgumentError, match="c reads no cube-array"):
        written_code(made, "c", "cube-array")
    sizes = range(40, 20, -1)
    many = cases.split_sum_of("linear", tuple(np.linspace(0.1, 1, 20)), sizes)
    with pytest.raises(ArgumentError, match="20 sizes of cubes take more than 16 samplers"):
        written_code(many, "glsl", "cube-array")
    bright = Shrm(1e39 * made.coefficients, "global", "reflection", make_info(4, 3))
    with pytest.raises(MapError, match="beyond 32-bit floats"):
        pack(bright)


@pytest.mark.parametrize("run", [Run(6, 16, 3), Run(6, 16, 3, columns=2, rows=3)])
def test_the_number_of_a_cube_may_be_a_choice(run):
    """Wherever the stack lies, the whole expression counts; C has the same operators as Python."""
    for cube in (1, 4):
        texts = _corner(run, "2 * c == 2 and 1 or c")
        found = tuple(eval(each.replace("/", "//"), {"c": cube}) for each in texts)
        assert found == run.corner(cube)


@pytest.mark.parametrize("language", LANGUAGES)
def test_negative_numbers_of_tables_stand_without_brackets(language):
    code = written_code(cases.FORMS["cabral"](), language).text
    assert re.search(r"[{(]-0\.", code)
    assert not re.search(r"[{(,] ?\(-\d", code)
