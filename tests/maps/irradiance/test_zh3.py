"""Irradiance with a zonal degree 2, against fits and integrals that share nothing with it."""

import json
import shutil
import subprocess

import numpy as np
import OpenEXR
import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import MapInfo, in_primaries
from shrm_cli.maps.irradiance.irradiance import FORMS, Irradiance, Zh3, form_errors, in_form
from shrm_cli.maps.irradiance.prefilter import report
from shrm_cli.maps.irradiance.shader import irradiance_snippet
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import PRIMARIES
from tests import oracles
from tests.makers import prefilter_irradiance as prefilter
from tests.maps.irradiance.test_shader import C_MAIN, CPP_MAIN

ROWS = 32


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.fixture
def light(rng):
    """Two lamps of different colors over a dim floor and sky."""
    pixels = rng.uniform(0.1, 0.4, (ROWS, 2 * ROWS, 3))
    pixels[6:9, 10:14] += [30, 20, 10]
    pixels[12:15, 30:33] += [3, 8, 20]
    return Probe.from_array(pixels.astype(np.float32))


def brute_irradiance(probe, normals):
    """E(N) as a sum over the pixels, by the weights of the grid."""
    directions = oracles.latlong_pixels(2 * ROWS, ROWS).reshape(-1, 3)
    power = (probe.image() * probe.grid.weights()[..., None]).reshape(-1, 3)
    return np.maximum(normals @ directions.T, 0) @ power


@pytest.mark.parametrize("options", [{"form": "zh3"}, {"form": "sh"}, {"window": "hann"}])
def test_the_error_that_is_told_is_that_of_the_map(light, options):
    """It was that of nine coefficients, whatever the form and the window were: 7 of 26 %."""
    made = prefilter(light, **options)
    normals, weights = oracles.sphere_rule(20)
    truth = brute_irradiance(light, normals)
    wrong = (weights[:, None] * (made.map.irradiance(normals) - truth) ** 2).sum()
    error = 100 * np.sqrt(wrong / (weights[:, None] * truth**2).sum())
    (line,) = (each for each in report(made.summary()) if each.startswith("RMS error"))
    assert float(line.split()[2].rstrip("%")) == pytest.approx(error, rel=0.01)


@pytest.mark.parametrize("form", ["zh3", "zh3-channel"])
def test_the_zonal_coefficient_is_the_best_one(light, form):
    """Least squares over brute-force irradiance, over an exact rule of normals."""
    made = prefilter(light, form=form).map
    normals, weights = oracles.sphere_rule(20)
    truth = brute_irradiance(light, normals)
    linear = prefilter(light, order_f=1).map.irradiance(normals)
    root = np.sqrt(weights)
    for channel in range(3):
        shape = 3 * (normals @ made.axes[channel]) ** 2 - 1
        # The sum over pixels has degrees beyond 2, which are orthogonal to this one.
        rest = (truth - linear)[:, channel]
        (best,), *_ = np.linalg.lstsq((root * shape)[:, None], root * rest, rcond=None)
        expected = np.pi / 4 * np.sqrt(5 / (16 * np.pi)) * made.zonal[channel]
        assert best == pytest.approx(expected, rel=2e-2)
        found = made.irradiance(normals)[:, channel]
        np.testing.assert_allclose(found, linear[:, channel] + expected * shape, rtol=1e-9)


def test_axes(light):
    """The shared one is that of the luminance; both follow from degree 1 alone."""
    shared, own = (prefilter(light, form=form).map for form in ("zh3", "zh3-channel"))
    directions = oracles.latlong_pixels(2 * ROWS, ROWS)
    power = light.image() * light.grid.weights()[..., None]
    vectors = np.einsum("ijk,ijc->ck", directions, power)
    np.testing.assert_allclose(
        own.axes, vectors / np.linalg.norm(vectors, axis=1)[:, None], atol=2e-3
    )
    vector = np.array([0.2126, 0.7152, 0.0722]) @ vectors
    np.testing.assert_allclose(shared.axes, [vector / np.linalg.norm(vector)] * 3, atol=2e-3)


@pytest.mark.parametrize("form", FORMS[:2])
def test_exact_where_light_is_zonal(rng, form):
    """Light that depends on the angle from an axis alone, and falls with it."""
    axis = oracles.random_directions(rng)
    pixels = np.exp(2 * oracles.latlong_pixels(2 * ROWS, ROWS) @ axis)[..., None] * [1, 0.5, 2]
    made = prefilter(Probe.from_array(pixels), form=form)
    np.testing.assert_allclose(made.map.axes, [axis] * 3, atol=1e-6)
    assert made.map.info.added_error < 1e-6
    assert made.facts["form_errors"]["kept"] == pytest.approx(1)


@pytest.mark.parametrize("form", FORMS)
def test_turned_light(light, rng, form):
    """A form of turned light is the turned form; mirrored light too."""
    plain = prefilter(light).map
    for mirrored in (False, True):
        turn = oracles.random_rotation(rng, mirrored)
        one, other = in_form(plain, form).turned(turn), in_form(plain.turned(turn), form)
        np.testing.assert_allclose(one.coefficients, other.coefficients, atol=1e-12)
        np.testing.assert_allclose(one.axes, other.axes, atol=1e-12)
        np.testing.assert_allclose(one.zonal, other.zonal, atol=1e-12)


@pytest.mark.parametrize("form", FORMS)
def test_errors_are_those_of_brute_force(light, form):
    made = prefilter(light, form=form)
    normals, weights = oracles.sphere_rule(20)
    truth = brute_irradiance(light, normals)

    def error(found):
        lost = weights @ np.sum((found.irradiance(normals) - truth) ** 2, axis=1)
        return np.sqrt(lost / (weights @ np.sum(truth**2, axis=1)))

    errors = made.facts["form_errors"]
    assert errors["form"] == pytest.approx(error(made.map), rel=0.02)
    assert errors["nine"] == pytest.approx(error(prefilter(light).map), rel=0.05)
    assert errors["four"] == pytest.approx(error(prefilter(light, order_f=1).map), rel=0.02)
    assert errors["nine"] < errors["form"] < errors["four"]


def test_the_best_coefficient_is_never_worse_than_none(rng):
    for _ in range(200):
        coefficients = rng.normal(size=(9, 3)) * rng.exponential(size=(9, 1))
        plain = Irradiance(coefficients, MapInfo(2, 0, 0.0, 1.0, 0.1))
        for form in FORMS[:2]:
            errors = form_errors(plain, in_form(plain, form))
            assert errors["nine"] <= errors["form"] <= errors["four"] + 1e-12
            assert 0 <= errors["kept"] <= 1


def test_guess_of_a_lamp():
    """The paper's formula at r = sqrt 3, that of a single direction."""
    pixels = np.zeros((ROWS, 2 * ROWS, 3))
    pixels[10, 20] = 1
    plain = prefilter(Probe.from_array(pixels), window="none").map
    made = in_form(plain, "zh3-hallucinated")
    ratio = 3**0.5
    expected = plain.coefficients[0] * ratio * (0.08 + 0.6 * ratio)
    np.testing.assert_allclose(made.zonal, expected, rtol=1e-3)
    counts = [each.summary()["coefficients"] for each in (made, in_form(plain, "zh3"))]
    assert counts == [4, 5]


@pytest.mark.parametrize("form", FORMS)
def test_light_from_a_side_has_an_axis_unless_that_is_rounding(form):
    for part, length in ((1.5e-6, 1), (0.7e-6, 0)):
        series = np.zeros((9, 3))
        series[0], series[2] = 2.0, 2.0 * part
        made = in_form(Irradiance(series, MapInfo(2, 0, 0.0, 1.0, 0.0)), form)
        np.testing.assert_allclose(np.linalg.norm(made.axes, axis=1), length)


def test_light_without_a_side():
    """Nothing tells an axis, and nothing is added."""
    made = prefilter(Probe.from_array(np.ones((8, 16, 3))), form="zh3").map
    assert not made.axes.any()
    assert not made.zonal.any()
    np.testing.assert_allclose(made.irradiance([0, 1, 0]), np.pi, rtol=1e-5)


@pytest.mark.parametrize("form", FORMS)
def test_files(tmp_path, light, form):
    made = prefilter(light, form=form).map
    made.save(tmp_path / "a.exr")
    found = open_map(tmp_path / "a.exr")
    assert isinstance(found, Zh3)
    assert found.form == form
    for name in ("coefficients", "axes", "zonal"):
        np.testing.assert_array_equal(getattr(found, name), getattr(made, name))
    assert found.converted("irradiance", size=8).form == form
    plain = found.converted("irradiance", form="sh")
    assert type(plain) is not Zh3
    np.testing.assert_array_equal(plain.coefficients, made.coefficients)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("shrm:form", "zh4"),
        ("shrm:form", 3),
        ("shrm:zh3", "{}"),
        ("shrm:zh3", "[" * 500),
        ("shrm:zh3", json.dumps({"axes": [[0, 0, 1]] * 3, "zonal": [1, 2, 3]})),
        ("shrm:zh3", json.dumps({"axes": [[0, 0, 1]] * 2, "zonal": [1, 2, 3]})),
        ("shrm:zh3", '{"axes": [[0, 0, 1e999]], "zonal": NaN}'),
    ],
)
def test_damaged_files(tmp_path, light, name, value):
    path = str(tmp_path / "a.exr")
    prefilter(light, form="zh3").map.save(path)
    with OpenEXR.File(path, separate_channels=True) as file:
        header, channels = dict(file.header()), dict(file.channels())
        channels = {key: each.pixels.copy() for key, each in channels.items()}
    header[name] = value
    header = {key: each for key, each in header.items() if key not in ("channels", "dataWindow")}
    with OpenEXR.File(header, channels) as file:
        file.write(path)
    with pytest.raises(MapError, match=r"shrm:(form|zh3)"):
        open_map(path)


def test_a_form_of_an_unknown_type_is_refused(tmp_path, light):
    """OpenImageIO gives its bytes, as an array, which is neither true nor false."""
    path = tmp_path / "a.exr"
    prefilter(light, form="zh3").map.save(path)
    data = path.read_bytes()
    assert b"shrm:form\0string\0" in data
    path.write_bytes(data.replace(b"shrm:form\0string\0", b"shrm:form\0^tring\0"))
    with pytest.raises(MapError, match="shrm:form"):
        open_map(path)


def test_windows(light):
    """A window keeps the form, and nothing of it is negative."""
    pixels = np.full((ROWS, 2 * ROWS, 3), 0.001)
    pixels[6:9, 10:14] += [30, 20, 10]
    made = prefilter(Probe.from_array(pixels), window="auto", form="zh3")
    normals = oracles.random_directions(np.random.default_rng(1), 2000)
    assert made.facts["minimum_without_window"] < 0
    assert made.map.irradiance(normals).min() >= 0
    again = in_form(made.map, "zh3")
    np.testing.assert_allclose(again.zonal, made.map.zonal, rtol=1e-9)
    with pytest.raises(MapError, match="`window` does not apply"):
        prefilter(Probe.from_array(pixels), window="hann", form="zh3-hallucinated")
    with pytest.raises(MapError, match="prefilter the probe in this form"):
        in_form(prefilter(Probe.from_array(pixels)).map, "zh3-hallucinated")


def test_a_guess_that_is_negative_is_told_and_left():
    """A window would undo the guess, so that ``auto`` does nothing, and another form helps."""
    pixels = np.full((ROWS, 2 * ROWS, 3), 0.001)
    pixels[8, 12] += 1000
    made = prefilter(Probe.from_array(pixels), form="zh3-hallucinated")
    least = made.map.irradiance(oracles.latlong_pixels(64, 32).reshape(-1, 3)).min()
    assert least < 0
    assert not made.map.window.factors
    (line,) = made.warnings
    assert "take `form` zh3" in line
    assert "`window`" not in line
    freed = prefilter(Probe.from_array(pixels), form="zh3")
    assert freed.map.minimum() >= 0
    assert not freed.warnings


def test_other_primaries(light):
    """Shared axes: the form of mixed channels is the mixed form, but for the luminance's axis."""
    made = prefilter(light, form="zh3").map
    mixed = in_primaries(made, PRIMARIES["acescg"])
    normals = oracles.random_directions(np.random.default_rng(1), 100)
    back = in_primaries(mixed, PRIMARIES["rec709"])
    np.testing.assert_allclose(back.irradiance(normals), made.irradiance(normals), rtol=1e-9)
    np.testing.assert_array_equal(mixed.axes, made.axes)
    again = (mixed.zonal[:, None] * oracles.real_harmonics(2, mixed.axes)[:, 4:]).T
    np.testing.assert_allclose(mixed.coefficients[4:], np.sqrt(4 * np.pi / 5) * again, rtol=1e-9)
    with pytest.raises(MapError, match="cannot be mixed"):
        in_primaries(prefilter(light, form="zh3-channel").map, PRIMARIES["acescg"])


def test_forms_need_order_2(light):
    for order in (1, 3):
        with pytest.raises(MapError, match=f"order F = 2, not {order}"):
            prefilter(light, order_f=order, form="zh3")


@pytest.mark.slow
@pytest.mark.parametrize("form", ["zh3", "zh3-channel"])
@pytest.mark.parametrize("language", ["c", "glsl", "hlsl"])
def test_snippets_run(tmp_path, light, form, language):
    compiler = shutil.which("cc" if language == "c" else "c++")
    if compiler is None:
        pytest.skip("no compiler")
    made = prefilter(light, form=form).map
    main = C_MAIN if language == "c" else CPP_MAIN.replace("{snippet}", DOT + "{snippet}")
    source = tmp_path / ("a.c" if language == "c" else "a.cpp")
    source.write_text(main.format(snippet=irradiance_snippet(made, language)))
    flags = ["-std=c89", "-Wall", "-Wextra", "-pedantic", "-Werror"] if language == "c" else []
    subprocess.run([compiler, *flags, str(source), "-o", str(tmp_path / "a")], check=True)
    normals = oracles.random_directions(np.random.default_rng(2), 50)
    text = "\n".join(" ".join(map(repr, each)) for each in normals.tolist())
    ran = subprocess.run(
        [str(tmp_path / "a")], input=text, capture_output=True, text=True, check=True
    )
    found = np.array([line.split() for line in ran.stdout.splitlines()], dtype=float)
    np.testing.assert_allclose(
        found, made.irradiance(normals), rtol=1e-4 if language != "c" else 1e-9
    )


# What this snippet uses beside the one of nine coefficients.
DOT = """
static float dot(vec3 a, vec3 b) {{ return a.x * b.x + a.y * b.y + a.z * b.z; }}
static vec3 operator*(vec3 a, vec3 b) {{ return vec3(a.x * b.x, a.y * b.y, a.z * b.z); }}
"""
