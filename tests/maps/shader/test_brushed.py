"""The code of taps: run in C beside the map, and compiled for graphics cards."""

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import MapError
from shrm_cli.maps.shader.code import written_code
from shrm_cli.maps.shader.file import pack
from shrm_cli.maps.splitsum.split_sum import BrushedSplitSum
from shrm_cli.render.boxed import reflected
from shrm_cli.vocabulary import EVEN_TAP_COUNTS, TAP_COUNTS
from tests.brute_force import unit
from tests.maps.lamps.test_discs import disc_rule
from tests.maps.shader import cases
from tests.maps.shader.test_code import (
    C_MAIN,
    HEADS,
    PLACES,
    STRICT,
    boxed,
    compiled,
    compiler_of_c,
    run,
)

SURFACES = (0.62, 0.5, (0.9, 0.5, 0.04)), (0.3, 0.9, (1.0, 1.0, 1.0)), (0.9, 0.1, (0.04,) * 3)
CALL = (
    "shrm_brushed(normalize(n), normalize(cross(n, v)), normalize(v), 0.5, 0.6, {}(1.0, 0.5, 0.2))"
)


def frames(count):
    """Normals, tangents and visible views."""
    normals, views = cases.points(count)
    tangents = np.cross(normals, unit(np.random.default_rng(8), count))
    return normals, tangents / np.linalg.norm(tangents, axis=1, keepdims=True), views


def in_c(folder, made, points, call, taps=None, given=(), even=None):
    """What the code computes for each point; `call` has a place for its first arguments.

    Its others may be GIVEN(1) and so on, the numbers that are given.
    """
    load = "double g, h, i;\n"
    for texture in pack(made):
        texture.values.astype(np.float32).tofile(folder / texture.name)
        load += f'{texture.name} = loaded("{folder / texture.name}", {texture.values.size});\n'
    arguments = "shrm_vec(a, b, c), shrm_vec(d, e, f), shrm_vec(g, h, i)"
    code = written_code(made, "c", taps=taps, even_taps=even).text
    program = C_MAIN.format(code=code, load=load, call=call.format(arguments))
    program = program.replace("%lf %lf %lf %lf %lf %lf", "%lf " * 9).replace(
        "&e, &f) == 6", "&e, &f, &g, &h, &i) == 9"
    )
    source = folder / "main.c"
    if not source.exists() or source.read_text(encoding="ascii") != program:
        source.write_text(program, encoding="ascii")
        done = run([compiler_of_c(), *STRICT, source, "-o", folder / "main", "-lm"])
        assert (done.returncode, done.stderr) == (0, "")
    lines = "".join(" ".join(map(repr, row)) + "\n" for row in np.hstack(points).tolist())
    return np.array(
        run([folder / "main", *map(str, given)], lines).stdout.split(), dtype=float
    ).reshape(-1, 3)


@pytest.mark.parametrize("taps", TAP_COUNTS)
@pytest.mark.parametrize("name", ["splitsum linear", "splitsum unreal", "splitsum single"])
def test_c_computes_what_the_map_does(tmp_path, monkeypatch, name, taps):
    cases.filter_bilinearly(monkeypatch)
    made, points = cases.FORMS[name](), frames(60)
    for surface in SURFACES:
        roughness, anisotropy, f0 = surface
        shown = BrushedSplitSum(made, roughness, f0, anisotropy, taps)
        truth = shown.brushed_radiance(*points)
        call = "shrm_brushed({}, GIVEN(1), GIVEN(2), shrm_vec(GIVEN(3), GIVEN(4), GIVEN(5)))"
        found = in_c(tmp_path, made, points, call, taps, (roughness, anisotropy, *f0))
        np.testing.assert_allclose(found, truth, rtol=0, atol=2e-7 * np.abs(truth).max())


@pytest.mark.parametrize("taps", EVEN_TAP_COUNTS)
def test_c_computes_what_the_map_does_for_even_surfaces(tmp_path, monkeypatch, taps):
    """The light alone, and with the albedo, of which the code has a table."""
    cases.filter_bilinearly(monkeypatch)
    made, points = cases.FORMS["splitsum linear"](), frames(60)
    where = "shrm_vec(a, b, c), shrm_vec(g, h, i), GIVEN(1)"
    color = "shrm_vec(GIVEN(2), GIVEN(3), GIVEN(4))"
    cosines = np.sum(points[0] * points[2], axis=1)
    for roughness, _, f0 in SURFACES:
        shown = made.shaded(roughness, f0, taps=taps)
        truth = shown.radiance(points[0], points[2])
        light = truth / shown._albedo(cosines)
        for call, expected, most in (
            (f"shrm_even_taps({where})", light, 2e-7),
            (f"shrm_even({where}, {color})", truth, 1e-3),
        ):
            found = in_c(tmp_path, made, points, call, None, (roughness, *f0), taps)
            np.testing.assert_allclose(found, expected, rtol=0, atol=most * expected.max())


def test_c_has_the_parallax_of_pictures_for_even_surfaces(tmp_path, monkeypatch):
    cases.filter_bilinearly(monkeypatch)
    made, points = boxed(cases.FORMS["splitsum linear"]()), frames(60)
    shown, vectors = made.shaded(0.62, (0.9, 0.5, 0.04)), (points[0], points[2], None)
    plain = shown.radiance(points[0], points[2])
    for place in PLACES:
        there = f"shrm_vec({', '.join(map(str, place))})"
        color = "shrm_vec(0.9, 0.5, 0.04)"
        call = f"shrm_even_at(shrm_vec(a, b, c), shrm_vec(g, h, i), {there}, 0.62, {color})"
        found = in_c(tmp_path, made, points, call, even=3)
        expected = reflected(made, shown, vectors, np.array(place))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3 * expected.max())
        assert np.abs(expected - plain).max() > 0.1 * plain.max()


@pytest.mark.parametrize(("language", "textures"), HEADS)
def test_code_of_even_surfaces_compiles(tmp_path, language, textures):
    code = written_code(cases.FORMS["splitsum linear"](), language, textures, even_taps=3).text
    call = "shrm_even(normalize(n), normalize(v), 0.5, {}(1.0, 0.5, 0.2))"
    call = call.format({"glsl": "vec3", "hlsl": "float3"}[language])
    assert compiled(tmp_path, language, code, HEADS[language, textures], call) == []


@pytest.mark.parametrize("taps", TAP_COUNTS)
@pytest.mark.parametrize(("language", "textures"), HEADS)
def test_code_compiles(tmp_path, language, textures, taps):
    code = written_code(cases.FORMS["splitsum linear"](), language, textures, taps).text
    call = CALL.format({"glsl": "vec3", "hlsl": "float3"}[language])
    assert compiled(tmp_path, language, code, HEADS[language, textures], call) == []


@pytest.mark.parametrize("name", ["shrm", "she lobe", "splitsum cloth"])
def test_other_forms_are_refused(name):
    with pytest.raises(MapError, match="only split sums of GGX"):
        written_code(cases.FORMS[name](), "glsl", taps=5)
    with pytest.raises(MapError, match="only split sums of GGX"):
        written_code(cases.FORMS[name](), "glsl", even_taps=1)


@pytest.mark.parametrize(
    "spec", ["ggx:roughness=0.4,anisotropy=0.6,f0=0.9/0.5/0.04", "ggx:ax=0.1,ay=0.3"]
)
def test_lamps_beside_brushed_maps_are_sums_over_their_discs(tmp_path, monkeypatch, spec):
    """With tangents of any direction, and discs that the horizon cuts."""
    cases.filter_bilinearly(monkeypatch)
    made = cases.lamps(spec, cases.FORMS["principal brushed"]())
    points = normals, tangents, views = frames(60)
    found = in_c(tmp_path, made, points, "shrm_brushed_radiance({})")
    whole = made.brushed_radiance(*points)
    np.testing.assert_allclose(found, whole, rtol=0, atol=2e-7 * np.abs(whole).max())
    expected, brdf = np.zeros((60, 3)), parse_spec(spec)
    for disc in made.discs:
        light, areas = disc_rule(disc.direction, disc.radius, 60)
        for k, (n, t, v) in enumerate(zip(normals, tangents, views, strict=True)):
            axes = np.stack([t, np.cross(n, t), n], axis=1)
            values = brdf.evaluate(light @ axes, (v @ axes)[None])
            expected[k] += (areas * np.maximum(light @ n, 0)) @ values * disc.radiance
    found = found - made.map.brushed_radiance(*points)
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-3 * expected.max())
