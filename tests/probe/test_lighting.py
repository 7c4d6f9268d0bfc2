"""The same scene through every layout and correction, and its power and energy."""

import numpy as np
import OpenEXR
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe import pixels
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.progress import using
from tests import oracles
from tests.probe import scenes

ORDER = 5
TOLERANCE = 1e-3
CUBE_LAYOUTS = ["openexr", "strip", "hcross", "vcross"]


def coefficients(path, order=ORDER, **options):
    return project(open_probe(path, ReadOptions(**options)), order).coefficients


def test_the_scene_itself_is_asymmetric():
    """No turn or mirroring by the axes leaves the scene's coefficients nearly as they are."""
    here = scenes.coefficients(ORDER)
    turns = [np.diag(signs) for signs in ((-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, 1, -1))]
    turns += [oracles.turn(axis, np.pi / 2) for axis in "xyz"]
    for matrix in turns:
        moved = scenes.project(lambda d, m=matrix: scenes.radiance(d @ m), ORDER)
        assert scenes.error(moved, here) > 0.05


@pytest.mark.parametrize("sampling", ["center", "border"])
def test_latlong(tmp_path, sampling):
    path = scenes.write(tmp_path / "probe.exr", scenes.latlong(64, sampling))
    found = coefficients(path, sampling=sampling)
    assert scenes.error(found, scenes.coefficients(ORDER)) < 1e-5
    other = "border" if sampling == "center" else "center"
    assert scenes.error(coefficients(path, sampling=other), scenes.coefficients(ORDER)) > 1e-3


@pytest.mark.parametrize("size", [64, 65])
@pytest.mark.parametrize("orientation", ["openexr", "gl"])
@pytest.mark.parametrize("layout", CUBE_LAYOUTS)
@pytest.mark.parametrize("sampling", ["center", "border"])
def test_cubes_in_one_image(tmp_path, sampling, layout, orientation, size):
    faces = scenes.cube_faces(size, sampling, orientation)
    path = scenes.write(tmp_path / "probe.exr", scenes.arrange(faces, layout))
    found = coefficients(path, orientation=orientation, sampling=sampling)
    assert scenes.error(found, scenes.coefficients(ORDER)) < TOLERANCE
    default = {"openexr": "openexr"}.get(layout, "gl")
    unsaid = scenes.error(coefficients(path, sampling=sampling), scenes.coefficients(ORDER))
    assert unsaid < TOLERANCE if orientation == default else unsaid > 0.1


@pytest.mark.parametrize("layout", ["hcross", "vcross"])
def test_crosses_are_cubes_laid_flat(tmp_path, layout):
    path = scenes.write(tmp_path / "probe.exr", scenes.unfolded(layout, 64))
    assert scenes.error(coefficients(path), scenes.coefficients(ORDER)) < TOLERANCE


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("orientation", ["openexr", "gl"])
def test_six_files(tmp_path, orientation, sampling):
    for name, face in zip(scenes.FACES, scenes.cube_faces(64, sampling, orientation), strict=True):
        scenes.write(tmp_path / f"sky_{name}.exr", face)
    path = tmp_path / "sky_%.exr"
    found = coefficients(path, orientation=orientation, sampling=sampling)
    assert scenes.error(found, scenes.coefficients(ORDER)) < TOLERANCE
    if orientation == "gl":
        unsaid = coefficients(path, sampling=sampling)
        np.testing.assert_array_equal(unsaid, found)


@pytest.mark.parametrize("size", [128, 129])
@pytest.mark.parametrize("sampling", ["center", "border"])
def test_angular(tmp_path, sampling, size):
    path = scenes.write(tmp_path / "probe.exr", scenes.angular(size, sampling))
    found = coefficients(path, layout="angular", sampling=sampling)
    assert scenes.error(found, scenes.coefficients(ORDER)) < TOLERANCE


@pytest.mark.parametrize("envmap", ["LATLONG", "CUBE"])
def test_tagged_files_follow_openexr(tmp_path, envmap):
    """Orientation and border sampling of files with the attribute `envmap`."""
    if envmap == "CUBE":
        image = scenes.arrange(scenes.cube_faces(32, "border", "openexr"), "openexr")
    else:
        image = scenes.latlong(32, "border")
    path = scenes.write_exr(
        tmp_path / "probe.exr", scenes.rgb(image), envmap=getattr(OpenEXR, f"ENVMAP_{envmap}")
    )
    assert scenes.error(coefficients(path), scenes.coefficients(ORDER)) < TOLERANCE
    said = scenes.error(coefficients(path, sampling="center"), scenes.coefficients(ORDER))
    assert said > TOLERANCE


def in_the_file(up="y", mirror=False, yaw=0.0):
    """The scene as a file holds it that `up`, `mirror` and `yaw` put right."""

    def content(directions):
        x, y, z = np.moveaxis(directions, -1, 0)
        if up == "z":
            x, y, z = x, z, -y
        if mirror:
            x = -x
        # From +Z towards +X about +Y.
        a = np.deg2rad(yaw)
        x, z = x * np.cos(a) + z * np.sin(a), z * np.cos(a) - x * np.sin(a)
        return scenes.radiance(np.stack([x, y, z], axis=-1))

    return content


def images(f):
    faces = scenes.cube_faces(48, "center", "openexr", f)
    return {
        "latlong": scenes.latlong(48, f=f),
        "openexr": scenes.arrange(faces, "openexr"),
        "angular": scenes.angular(128, f=f),
    }


@pytest.mark.parametrize("layout", ["latlong", "openexr", "angular"])
@pytest.mark.parametrize(
    "options",
    [
        {"yaw": 90.0},
        {"yaw": -33.0},
        {"mirror": True},
        {"up": "z"},
        {"mirror": True, "yaw": 50.0},
        {"up": "z", "yaw": 120.0},
        {"up": "z", "mirror": True},
        {"up": "z", "mirror": True, "yaw": -70.0},
    ],
    ids=str,
)
def test_corrections_of_foreign_files(tmp_path, options, layout):
    path = scenes.write(tmp_path / "probe.exr", images(in_the_file(**options))[layout])
    expected = scenes.coefficients(ORDER)
    assert scenes.error(coefficients(path, layout=layout, **options), expected) < TOLERANCE
    assert scenes.error(coefficients(path, layout=layout), expected) > 0.05


def test_yaw_by_the_direction_of_a_light(tmp_path):
    """A light at +Z is at +X after a yaw of 90 degrees, and its mirror image at -X."""
    f = lambda d: np.exp(20 * (d[..., 2:] - 1)) * np.ones(3)  # noqa: E731
    path = scenes.write(tmp_path / "probe.exr", scenes.latlong(64, f=f))
    for yaw, expected in ((0, (0, 0, 1)), (90, (1, 0, 0)), (-90, (-1, 0, 0)), (180, (0, 0, -1))):
        found = coefficients(path, 1, yaw=yaw)[[3, 1, 2], 0]  # x, y, z
        np.testing.assert_allclose(found / np.linalg.norm(found), expected, atol=1e-6)


def test_openexrs_own_pair(shared):
    """The cube and the lat-long that OpenEXR publishes show one scene (and decide the table)."""
    cube = shared / "probes" / "KernerEnvCube.exr"
    latlong = coefficients(shared / "probes" / "KernerEnvLatLong.exr", 4)
    assert scenes.error(coefficients(cube, 4), latlong) < 5e-4
    assert scenes.error(coefficients(cube, 4, orientation="gl"), latlong) > 0.3


@pytest.mark.parametrize("height", [12, 40])
def test_band_limited_light_is_projected_to_rounding(tmp_path, rng, height):
    """A lat-long of band-limited light, in float32."""
    order = height // 2 - 1
    count = (order + 1) ** 2
    expected = rng.standard_normal((count, 3)) / np.arange(1, count + 1)[:, None]
    expected[0] = 20  # nowhere negative, so nothing is clamped
    image = scenes.latlong(height, f=lambda d: oracles.real_harmonics(order, d) @ expected)
    assert image.min() > 0
    found = coefficients(scenes.write(tmp_path / "probe.exr", image), order)
    np.testing.assert_allclose(found, expected, atol=20 * 2e-7)


@pytest.mark.parametrize(("unknown", "order"), [(2.5e-7, 5), (4e-6, 1)])
def test_light_of_few_degrees_is_known_to_all(unknown, order):
    """Where no more than .1 % (RMS) is of others, which pixels would have to show."""
    series = np.zeros((36, 3))
    series[:4] = [[2.0], [1.0], [0.5], [0.3]]
    energy = (series**2).sum(axis=0)
    assert Lighting(series, energy * (1 + unknown)).resolved_order == order


def test_power_and_energy(tmp_path, rng):
    """Against sums over degrees, and Parseval: all the energy of a band-limited image."""
    order = 6
    expected = rng.standard_normal((49, 3))
    expected[0] = 40
    image = scenes.latlong(32, f=lambda d: oracles.real_harmonics(order, d) @ expected)
    found = project(open_probe(scenes.write(tmp_path / "probe.exr", image)), 10)
    assert found.order == 10
    power = found.power()
    assert power.shape == (11, 3)
    for degree in range(order + 1):
        own = sum(expected[degree * degree + k] ** 2 for k in range(2 * degree + 1))
        np.testing.assert_allclose(power[degree], own, rtol=2e-5)
    assert power[order + 1 :].max() < 1e-8 * power.max()
    np.testing.assert_allclose(found.energy, np.sum(expected**2, axis=0), rtol=1e-6)


@pytest.mark.parametrize("layout", ["latlong", "openexr", "angular"])
@pytest.mark.parametrize("sampling", ["center", "border"])
def test_energy_in_every_layout(tmp_path, layout, sampling):
    """The integral of the squared radiance, by another rule."""
    directions, weights = oracles.sphere_rule(80)
    expected = weights @ scenes.radiance(directions) ** 2
    image = {
        "latlong": scenes.latlong(64, sampling),
        "openexr": scenes.arrange(scenes.cube_faces(64, sampling), "openexr"),
        "angular": scenes.angular(128, sampling),
    }[layout]
    path = scenes.write(tmp_path / "probe.exr", image)
    found = project(open_probe(path, ReadOptions(layout=layout, sampling=sampling)), 2)
    np.testing.assert_allclose(found.energy, expected, rtol=2e-3 if layout != "latlong" else 1e-5)


def test_a_sun_of_one_pixel(tmp_path):
    """50000 over one pixel of 128 x 64: each coefficient is its weight times a harmonic."""
    image = np.zeros((64, 128, 3))
    image[20, 37] = (50000, 40000, 30000)
    path = scenes.write(tmp_path / "probe.exr", image)
    direction = oracles.latlong_pixels(128, 64)[20, 37]
    found = project(open_probe(path), 20)
    # Fejer's weight of the row, by its defining property: exact for polynomials of z.
    z = np.cos(np.pi * (np.arange(64) + 0.5) / 64)
    powers = np.polynomial.chebyshev.chebvander(z, 63).T
    integrals = [0 if k % 2 else 2 / (1 - k * k) for k in range(64)]
    weight = np.linalg.solve(powers, integrals)[20] * 2 * np.pi / 128
    expected = oracles.real_harmonics(20, direction)[:, None] * weight * image[20, 37]
    np.testing.assert_allclose(found.coefficients, expected, atol=2e-6 * expected.max())
    np.testing.assert_allclose(found.energy, weight * image[20, 37] ** 2, rtol=1e-9)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize(
    ("layout", "width", "height"),
    [("latlong", 4, 2), ("latlong", 16, 8), ("openexr", 1, 6), ("openexr", 3, 18),
     ("hcross", 4, 3), ("angular", 3, 3), ("angular", 10, 10)],
)  # fmt: skip
def test_a_coarse_furnace_stays_a_furnace(tmp_path, layout, width, height, sampling):
    """Light from everywhere has no finer waves, however few pixels show it."""
    path = scenes.write(tmp_path / "probe.exr", np.full((height, width, 3), 0.5))
    found = coefficients(path, 24, layout=layout, sampling=sampling)
    assert found.shape == (625, 3)
    np.testing.assert_allclose(found[0], 0.5 * np.sqrt(4 * np.pi), rtol=1e-6)
    assert np.abs(found[1:]).max() < 0.03 * found[0, 0]


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize(
    ("layout", "size"), [("openexr", 8), ("openexr", 9), ("angular", 32), ("angular", 33)]
)
def test_noise_is_summed_pixel_by_pixel(tmp_path, rng, layout, size, sampling):
    """Values times solid angles times harmonics: no symmetry is assumed of the image."""
    angular = layout == "angular"
    image = rng.random((size if angular else 6 * size, size, 3)).astype(np.float32)
    path = scenes.write(tmp_path / "probe.exr", image)
    probe = open_probe(path, ReadOptions(layout=layout, sampling=sampling))
    found = project(probe, 8).coefficients
    ((_, pixels, weights),) = probe.blocks()
    if angular:
        s = np.array(oracles.positions(size, sampling))
        r = np.maximum(np.hypot(s[:, None], s), 1e-12)
        flat = np.sin(np.pi * r) / r
        directions = np.stack([-s * flat, -s[:, None] * flat, np.cos(np.pi * r)], axis=-1)
    else:
        directions = oracles.cube_texels(size, sampling).reshape(6 * size, size, 3)
    harmonics = oracles.real_harmonics(8, directions)
    expected = np.einsum("ijn,ijc,ij->nc", harmonics, pixels, weights)
    np.testing.assert_allclose(found, expected, atol=1e-7)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize(
    ("layout", "size", "degree"), [("latlong", 32, 29), ("openexr", 16, 26), ("angular", 64, 28)]
)
def test_fine_waves_are_resolved(tmp_path, layout, size, degree, sampling):
    """Nearly down to two pixels a wave."""
    wave = degree * (degree + 1) + 3

    def f(directions):
        value = -np.sqrt(2) * oracles.complex_harmonic(degree, 3, directions).real
        return 3 + value[..., None] * np.ones(3)

    image = {
        "latlong": scenes.latlong(size, sampling, f),
        "openexr": scenes.arrange(scenes.cube_faces(size, sampling, f=f), "openexr"),
        "angular": scenes.angular(size, sampling, f),
    }[layout]
    path = scenes.write(tmp_path / "probe.exr", image)
    found = coefficients(path, degree, layout=layout, sampling=sampling)
    np.testing.assert_allclose(found[wave], 1, atol=0.3)


def test_progress_is_reported(tmp_path):
    path = scenes.write(tmp_path / "probe.exr", np.ones((64, 128, 3)))
    calls = []
    with using(lambda done, total: calls.append((done, total))):
        project(open_probe(path), 2)
    assert calls[-1] == (64, 64)


def test_wrong_shapes_are_refused():
    with pytest.raises(ValueError, match="shape"):
        Lighting(np.zeros((5, 3)), np.zeros(3))
    with pytest.raises(ValueError, match="shape"):
        Lighting(np.zeros((9, 3)), np.zeros(2))


@pytest.mark.parametrize("orientation", ["openexr", "gl"])
def test_large_faces_are_integrated_one_after_the_other(tmp_path, monkeypatch, rng, orientation):
    """A hole, filled within its face, and negative pixels are the same as in a whole cube."""
    for k, name in enumerate(scenes.FACES):
        face = rng.lognormal(0, 1, (9, 9, 3)).astype(np.float32)
        face[2, 3] = np.nan if k == 4 else -1
        scenes.write(tmp_path / f"sky_{name}.exr", face)
    options = {"orientation": orientation, "fix_nonfinite": True, "yaw": 20}
    found = []
    for size in (1024, 8):
        monkeypatch.setattr(pixels, "_SMALL_FACE", size)
        probe = open_probe(tmp_path / "sky_%.exr", **options)
        found.append((project(probe, 6), probe.report, probe.image()))
    (whole, report, image), (parts, again, same) = found
    np.testing.assert_allclose(parts.coefficients, whole.coefficients, rtol=0, atol=1e-12)
    np.testing.assert_allclose(parts.energy, whole.energy, rtol=1e-12)
    np.testing.assert_array_equal(same, image)
    assert (again.nonfinite, again.negative) == (report.nonfinite, report.negative) == (1, 5)
    assert again.energy == pytest.approx(report.energy)


def test_large_faces_with_holes_are_refused_by_their_file(tmp_path, monkeypatch):
    monkeypatch.setattr(pixels, "_SMALL_FACE", 4)
    for name in scenes.FACES:
        face = np.full((8, 8, 3), np.nan if name == "+Z" else 1, dtype=np.float32)
        scenes.write(tmp_path / f"sky_{name}.exr", face)
    with pytest.raises(ProbeError, match=r"sky_\+Z\.exr: 64 pixels are NaN or infinite"):
        project(open_probe(tmp_path / "sky_%.exr"), 2)
    with pytest.raises(ProbeError, match=r"sky_\+Z\.exr: nothing is finite"):
        project(open_probe(tmp_path / "sky_%.exr", fix_nonfinite=True), 2)
