"""Coefficients as light: against sums over points, explicit polynomials and files of programs."""

import json

import numpy as np
import pytest

import shrm_cli
from shrm_cli.errors import ProbeError
from shrm_cli.export.engines.coefficients import coefficients_json
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.sphere.quadrature import spiral_directions
from tests import oracles

RNG = np.random.default_rng(8)
LIGHT = RNG.normal(size=(9, 3)) * 0.2 + [[5, 4, 3], *[[0] * 3] * 8]
"""Light that is positive everywhere."""
POINTS = spiral_directions(20000)
SLOAN = [
    lambda x, y, z: 0.282094791773878 + 0 * x,
    lambda x, y, z: -0.488602511902920 * y,
    lambda x, y, z: 0.488602511902920 * z,
    lambda x, y, z: -0.488602511902920 * x,
    lambda x, y, z: 1.092548430592079 * y * x,
    lambda x, y, z: -1.092548430592079 * y * z,
    lambda x, y, z: 0.946174695757560 * z * z - 0.315391565252520,
    lambda x, y, z: -1.092548430592079 * x * z,
    lambda x, y, z: 0.546274215296039 * (x * x - y * y),
]
"""The basis of Sloan, Stupid Spherical Harmonics (SH) Tricks, appendix A2, with its phase."""


def radiance(directions, light=LIGHT):
    """The light as a function, by the oracle's harmonics."""
    order = round(len(light) ** 0.5) - 1
    return oracles.real_harmonics(order, directions) @ light


def integral(values):
    """Over the sphere, by points that are evenly spread."""
    return 4 * np.pi * values.mean(axis=0)


def close(found, expected):
    """Compare but for the rounding of sums."""
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-14)


def saved(folder, values, name="light.npy"):
    np.save(folder / name, values)
    return folder / name


def test_a_file_is_the_light_of_its_coefficients(tmp_path):
    light = RNG.normal(size=(16, 3)) * 0.3 + [[6, 5, 4], *[[0] * 3] * 15]
    probe = open_probe(saved(tmp_path, light))
    found = project(probe, 5)
    close(found.coefficients[:16], light)
    assert not found.coefficients[16:].any()
    close(project(probe, 2).coefficients, light[:9])
    some = POINTS[::997]
    np.testing.assert_allclose(probe.radiance(some), radiance(some, light), rtol=2e-4)
    energy = integral(radiance(POINTS[::4], light) ** 2)
    np.testing.assert_allclose(found.energy, energy, rtol=2e-3)


def test_options_turn_coefficients_and_change_their_primaries(tmp_path):
    path = saved(tmp_path, LIGHT)
    probe = open_probe(path, yaw=90.0, primaries="rec709", working="rec2020")
    image = open_probe(saved(tmp_path, LIGHT, "b.npy")).image()
    by_pixels = shrm_cli.Probe.from_array(image, yaw=90.0, primaries="rec709", working="rec2020")
    expected = project(by_pixels, 2).coefficients
    np.testing.assert_allclose(project(probe, 2).coefficients, expected, atol=2e-5)


@pytest.mark.parametrize("shape", [(9, 3), (27,), (1, 9, 3)])
def test_shapes_of_arrays(tmp_path, shape):
    found = project(open_probe(saved(tmp_path, LIGHT.reshape(shape))), 2)
    close(found.coefficients, LIGHT)


@pytest.mark.parametrize("shape", [(9,), (9, 1)])
def test_grey_light(tmp_path, shape):
    found = project(open_probe(saved(tmp_path, LIGHT[:, 0].reshape(shape))), 2)
    close(found.coefficients, LIGHT[:, [0, 0, 0]])


def test_one_of_many_lights_as_pifu_has_them(tmp_path):
    path = saved(tmp_path, np.stack([0 * LIGHT, LIGHT, 2 * LIGHT]))
    (tmp_path / "one.toml").write_text(f"[[sh]]\nfile = '{path.name}'\npart = 1\n")
    for light in (
        open_probe(path, ReadOptions(part="1")),
        open_probe(path, part=1),
        open_probe(tmp_path / "one.toml"),
    ):
        close(project(light, 2).coefficients, LIGHT)
    for part in (None, "3", "one", "-1"):
        with pytest.raises(ProbeError, match=r"it holds 3 lights; choose one by `part`, 0 \.\. 2"):
            open_probe(path, ReadOptions(part=part))


def test_files_of_programs(tmp_path):
    """LightProbe.toJSON of three.js, our own export, and text with whatever between numbers."""
    three = {
        "metadata": {"version": 4.6, "type": "Object", "generator": "Object3D.toJSON"},
        "object": {"type": "LightProbe", "intensity": 0.5, "sh": LIGHT.ravel().tolist()},
    }
    (tmp_path / "three.json").write_text(json.dumps(three))
    (tmp_path / "ours.json").write_text(coefficients_json(LIGHT))
    (tmp_path / "list.json").write_text(json.dumps(LIGHT.tolist()))
    rows = "\n".join(f"({r!r}, {g!r};{b!r}) // row" for r, g, b in LIGHT.tolist())
    (tmp_path / "a.txt").write_text(f"# 9 rows\n{rows}\n")
    for name, scale in (("three.json", 0.5), ("ours.json", 1), ("list.json", 1), ("a.txt", 1)):
        found = project(open_probe(tmp_path / name), 2).coefficients
        np.testing.assert_allclose(found, scale * LIGHT, rtol=1e-15, err_msg=name)


def test_probes_of_a_scene_are_added_as_three_does(tmp_path):
    """Below whatever object; those that are not visible do not count, and other lights are told."""

    def probe(intensity, **more):
        return {"type": "LightProbe", "sh": LIGHT.ravel().tolist(), "intensity": intensity, **more}

    hidden = {"type": "Group", "visible": False, "children": [probe(8)]}
    group = {"type": "Group", "children": [probe(0.5), probe(4, visible=False), hidden]}
    sun = {"type": "DirectionalLight", "intensity": 3}
    scene = {"type": "Scene", "children": [{"type": "Mesh"}, group, probe(1)]}
    (tmp_path / "a.json").write_text(json.dumps({"metadata": {}, "object": scene}))
    light = open_probe(tmp_path / "a.json")
    np.testing.assert_allclose(project(light, 2).coefficients, 1.5 * LIGHT, rtol=1e-15)
    assert not light.report.notes
    scene["children"].append(sun)
    (tmp_path / "b.json").write_text(json.dumps({"metadata": {}, "object": scene}))
    (said,) = open_probe(tmp_path / "b.json").report.notes
    assert said == "its LightProbes alone are its light, without DirectionalLight"


def through(folder, **keys):
    """The coefficients that a light file with one table [[sh]] makes."""
    lines = [f"{key} = {json.dumps(value)}" for key, value in keys.items()]
    (folder / "lights.toml").write_text("[[sh]]\n" + "\n".join(lines))
    return project(open_probe(folder / "lights.toml"), 2).coefficients


def test_the_phase_of_condon_and_shortley(tmp_path):
    """The coefficients are integrals with the functions of Sloan's report."""
    x, y, z = POINTS.T
    light = radiance(POINTS)
    theirs = [integral(each(x, y, z)[:, None] * light).tolist() for each in SLOAN]
    found = through(tmp_path, coefficients=theirs, basis="condon-shortley")
    np.testing.assert_allclose(found, LIGHT, atol=2e-3)


def irradiance(normals):
    """Summed over points of the sphere."""
    return np.stack([integral(np.maximum(POINTS @ n, 0)[:, None] * LIT) for n in normals])


LIT = radiance(POINTS)


def test_coefficients_of_irradiance(tmp_path):
    normals = POINTS[::20]
    basis = oracles.real_harmonics(2, normals)
    theirs = np.linalg.lstsq(basis, irradiance(normals), rcond=None)[0]
    found = through(tmp_path, coefficients=theirs.tolist(), of="irradiance")
    np.testing.assert_allclose(found, LIGHT, atol=5e-3)


def test_polynomials_of_filament(tmp_path):
    """Numbers that make E / pi as the sum of products with 1, y, z, x, xy, ..."""
    x, y, z = normals = POINTS[::20].T
    terms = np.stack([1 + 0 * x, y, z, x, x * y, y * z, 3 * z * z - 1, z * x, x * x - y * y], -1)
    theirs = np.linalg.lstsq(terms, irradiance(normals.T) / np.pi, rcond=None)[0]
    found = through(tmp_path, coefficients=theirs.tolist(), basis="filament")
    np.testing.assert_allclose(found, LIGHT, atol=5e-3)
    rows = [f"({r:.9f}, {g:.9f}, {b:.9f}); // L00, irradiance, pre-scaled base"
            for r, g, b in theirs]  # fmt: skip
    (tmp_path / "sh.txt").write_text("\n".join(rows))
    probe = open_probe(tmp_path / "sh.txt")
    np.testing.assert_allclose(project(probe, 2).coefficients, found, atol=1e-6)


def test_tables_add_to_other_lights(tmp_path):
    """Coefficients of a file, turned and scaled, beside a disc; energies and products as well."""
    saved(tmp_path, LIGHT)
    (tmp_path / "lights.toml").write_text(
        '[[sh]]\nfile = "light.npy"\nscale = [2, 1, 0.5]\nyaw = 90\n'
        "[[sh]]\ncoefficients = [1.5]\n"
        "[[disc]]\nazimuth = 40\nelevation = 30\nradius = 30\nradiance = 3\n"
    )
    probe = open_probe(tmp_path / "lights.toml")
    x, y, z = POINTS.T
    light = radiance(np.stack([-z, y, x], axis=-1)) * [2, 1, 0.5] + 1.5 * 0.282094791773878
    axis = np.array([np.sin(np.radians(40)), np.tan(np.radians(30)), np.cos(np.radians(40))])
    inside = POINTS @ axis / np.linalg.norm(axis) > np.cos(np.radians(30))
    light = light + 3 * inside[:, None]
    basis = oracles.real_harmonics(2, POINTS)
    expected = np.stack([integral(basis[:, [k]] * light) for k in range(9)])
    found = project(probe, 2)
    np.testing.assert_allclose(found.coefficients, expected, atol=0.01)
    np.testing.assert_allclose(found.energy, integral(light**2), rtol=3e-3)


def test_irradiance_maps_are_probes(tmp_path):
    made = shrm_cli.prefilter(open_probe(saved(tmp_path, LIGHT)), to="irradiance")
    made.save(tmp_path / "a.irradiance.exr")
    probe = open_probe(tmp_path / "a.irradiance.exr")
    close(project(probe, 2).coefficients, LIGHT)
    with pytest.warns(shrm_cli.ShrmWarning, match="degrees up to 2"):
        again = shrm_cli.prefilter(probe, to="irradiance")
    close(again.coefficients, made.coefficients)


def test_negative_light_stays_in_coefficients_and_is_cut_in_pixels(tmp_path):
    light = np.zeros((4, 3))
    light[2] = 1.0
    probe = open_probe(saved(tmp_path, light))
    close(project(probe, 1).coefficients, light)
    assert probe.image().min() == 0
    assert "negative radiance" in probe.report.warnings()[0]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.txt", "1 2 3 4 5", "5 numbers; give 1, 4, 9, 16"),
        ("a.txt", "1 2 x", "'x' is no number"),
        ("a.txt", "1e40", "larger than 1e"),
        ("a.json", '{"sh": [1, 2, 3]}', "27 numbers, not 3"),
        ("a.json", "{}", 'neither "radiance" nor the "sh"'),
        ("a.json", "[1, null, 2]", "not finite numbers"),
        ("a.json", '{"radiance": {"a": 1}}', "not finite numbers"),
        ("a.json", "[[1, 2], [3]]", "rows of different lengths"),
        ("a.npy", "no array", "is not an array of numpy's"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, name, content, said):
    (tmp_path / name).write_text(content)
    with pytest.raises(ProbeError, match=said) as caught:
        open_probe(tmp_path / name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("basis = 'real'", "'file' is missing, or 'coefficients'"),
        ("coefficients = [1, 2, 3, 4]\nbasis = 'legendre'", "'legendre' is no basis; name one"),
        ("coefficients = [1, 2, 3, 4]\nof = 'light'", "neither radiance nor irradiance"),
        (f"coefficients = {[1.0] * 16}\nof = 'irradiance'", "above degree 2"),
        ("coefficients = [nan]", "not finite"),
        ("coefficients = [[1, 2], [3, 4]]", "of shape"),
        ("coefficients = [[1, 2, 3], 4, 5, 6]", "rows of different lengths"),
        ("file = 'a.npy'\npart = [1]", "'part' must be a name or a number, not"),
        ("file = 'a.npy'\npart = true", "'part' must be a name or a number, not True"),
        ("file = 'a.png'", "holds no coefficients"),
        ("file = '../a.npy'", "a name in the light file's folder"),
        ("coefficients = [1]\npart = '1'", "'part' applies to a file"),
        ("coefficients = [1]\nscale = -1", "'scale' must be a number from 0"),
        ("coefficients = [1]\nyaw = 'a'", "finite number of degrees"),
        ("coefficients = [1]\nradius = 2", "unknown key 'radius'"),
    ],
)
def test_wrong_tables_are_said(tmp_path, table, said):
    (tmp_path / "a.toml").write_text(f"[[sh]]\n{table}\n")
    with pytest.raises(ProbeError, match=rf"a.toml: sh 1: .*({said})"):
        open_probe(tmp_path / "a.toml")


def test_options_of_images_do_not_apply(tmp_path):
    path = saved(tmp_path, LIGHT)
    for options in (ReadOptions(layout="latlong"), ReadOptions(part="0")):
        with pytest.raises(ProbeError, match=r"nothing about coefficients|leave `part` out"):
            open_probe(path, options)
    with pytest.raises(ProbeError, match="`clamp` and `fix_nonfinite` say nothing"):
        open_probe(path, clamp=3.0)
    np.save(tmp_path / "huge.npy", np.zeros((35**2, 3)))
    with pytest.raises(ProbeError, match="up to order 32"):
        open_probe(tmp_path / "huge.npy")
