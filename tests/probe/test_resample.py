"""Probes on other grids: exact copies, means over cells, interpolation, energy, real files.

Directions of the targets' pixels come from `scenes`, which writes the conventions down again.
"""

from functools import lru_cache

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe import resample
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.progress import using
from shrm_cli.sphere.grid.angular import Angular
from shrm_cli.sphere.grid.cube import Cube
from shrm_cli.sphere.grid.latlong import LatLong
from tests import oracles
from tests.maps.shrm.test_predicted_error import reduced
from tests.probe import scenes

CUBES = ("openexr", "strip", "hcross", "vcross", "faces")
ALL = ("latlong", *CUBES, "angular")
GRIDS = ("latlong", "openexr", "angular")


def smooth(directions):
    """Positive polynomials of degree 3 without any symmetry, (..., 3)."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack(
        [
            2 + 0.5 * x - 0.3 * y + 0.2 * z + 0.4 * x * y - 0.2 * y * z * z,
            3 - 0.4 * z + 0.6 * x * z + 0.3 * y**3,
            2.5 + 0.7 * y - 0.5 * x * y * z + 0.3 * z * z,
        ],
        axis=-1,
    )


def image_of(layout, size, sampling="center", f=smooth, orientation=None):
    """`f` in any layout; size as for `to_layout`."""
    if layout == "latlong":
        return scenes.latlong(size, sampling, f)
    if layout == "angular":
        return scenes.angular(size, sampling, f)
    orientation = orientation or ("openexr" if layout == "openexr" else "gl")
    faces = scenes.cube_faces(size, sampling, orientation, f)
    return scenes.arrange(faces, "openexr" if layout == "faces" else layout)


def probe_of(tmp_path, image, layout=None, **options):
    path = scenes.write(tmp_path / "probe.exr", image)
    return open_probe(path, ReadOptions(layout=layout, **options))


def rim(size, sampling="center"):
    s = np.array(oracles.positions(size, sampling))
    return np.hypot(s, s[:, None])


@lru_cache
def solid_angles(layout, size):
    """Of cells of centre-sampled pixels, (rows, columns): exact, or the sum over small parts."""
    if layout == "latlong":
        edges = np.cos(np.pi * np.arange(size + 1) / size)
        return np.repeat(-np.diff(edges)[:, None], 2 * size, axis=1) * np.pi / size
    fine = max(4, 512 // size)
    s = np.array(oracles.positions(size * fine, "center"))
    area = (2 / size / fine) ** 2
    r = np.hypot(s, s[:, None])
    if layout == "angular":
        density = np.pi * np.sin(np.pi * r) / r * (r < 1)
    else:
        density = (1 + r**2) ** -1.5
    whole = density.reshape(size, fine, size, fine).sum(axis=(1, 3)) * area
    return whole if layout == "angular" else np.tile(whole, (6, 1))


# ---------------------------------------------------------------- any layout to any other


@pytest.mark.parametrize("target", ALL)
@pytest.mark.parametrize("source", GRIDS)
@pytest.mark.parametrize("sampling", ["center", "border"])
def test_smooth_light_at_the_targets_directions(tmp_path, source, target, sampling):
    """By the default size, which interpolates; the bound is that of a bilinear filter."""
    size = {"latlong": 64, "openexr": 32, "angular": 128}[source]
    probe = probe_of(tmp_path, image_of(source, size, sampling), source, sampling=sampling)
    found = resample.to_layout(probe, target, sampling=sampling)
    expected_size = {"latlong": 64, "angular": 128}.get(target, 32)
    expected = image_of(target, expected_size, sampling)
    assert found.dtype == np.float32
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, atol=4e-3)


@pytest.mark.parametrize("orientation", ["openexr", "gl"])
@pytest.mark.parametrize("target", CUBES)
def test_orientations(tmp_path, target, orientation):
    probe = probe_of(tmp_path, image_of("latlong", 64))
    found = resample.to_layout(probe, target, orientation, 16)
    expected = image_of(target, 16, orientation=orientation)
    np.testing.assert_allclose(found, expected, atol=6e-3)


@pytest.mark.parametrize("source", GRIDS)
@pytest.mark.parametrize("target", GRIDS)
@pytest.mark.parametrize(
    "options", [{"yaw": 40}, {"mirror": True}, {"up": "z"}, {"up": "z", "mirror": True, "yaw": -75}]
)
def test_world_axes(tmp_path, source, target, options):
    """A turned file of the turned light is the light."""
    matrix = np.eye(3)
    if options.get("up") == "z":
        matrix = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]) @ matrix
    if options.get("mirror"):
        matrix = np.diag([-1, 1, 1]) @ matrix
    matrix = oracles.turn("y", np.deg2rad(options.get("yaw", 0))) @ matrix
    size = {"latlong": 64, "openexr": 32, "angular": 128}
    turned = image_of(source, size[source], f=lambda d: smooth(d @ matrix.T))
    probe = probe_of(tmp_path, turned, source, **options)
    for factor in (1, 3):
        found = resample.to_layout(probe, target, size=size[target] // factor)
        expected = image_of(target, size[target] // factor)
        # The mean over a cell differs from its middle by the square of the cell's size.
        np.testing.assert_allclose(found, expected, atol=4e-3 * factor**2)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("way", ["openexr", "vcross", "angular"])
def test_round_trips(tmp_path, way, sampling):
    image = image_of("latlong", 64, sampling)
    there = resample.to_layout(
        probe_of(tmp_path, image, "latlong", sampling=sampling), way, sampling=sampling
    )
    probe = probe_of(tmp_path, there, way, sampling=sampling)
    back = resample.to_grid(probe, LatLong(64, sampling))
    np.testing.assert_allclose(back, image, atol=6e-3)


@pytest.mark.parametrize("source", GRIDS)
def test_finer_targets_are_interpolated(tmp_path, source):
    size = {"latlong": 24, "openexr": 12, "angular": 48}[source]
    probe = probe_of(tmp_path, image_of(source, size), source)
    for target, fine in (("latlong", 70), ("openexr", 40), ("angular", 150)):
        found = resample.to_layout(probe, target, size=fine)
        np.testing.assert_allclose(found, image_of(target, fine), atol=0.03)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("source", GRIDS)
def test_constant_light_stays_constant(tmp_path, source, sampling):
    f = lambda directions: 0 * directions + (0.3, 1.7, 70000.0)  # noqa: E731
    size = {"latlong": 32, "openexr": 16, "angular": 64}[source]
    probe = probe_of(tmp_path, image_of(source, size, f=f), source, yaw=20, up="z")
    for target in GRIDS:
        for other in (3, 7, 11, 30, 50):
            found = resample.to_layout(probe, target, size=other, sampling=sampling)
            inside = rim(other, sampling) <= 1 if target == "angular" else ...
            expected = np.broadcast_to((0.3, 1.7, 70000.0), found[inside].shape)
            np.testing.assert_allclose(found[inside], expected, rtol=1e-6)


def test_nothing_outside_the_rim(tmp_path):
    probe = probe_of(tmp_path, image_of("latlong", 64))
    for size in (9, 40, 128, 300):
        for sampling in ("center", "border"):
            found = resample.to_grid(probe, Angular(size, sampling))
            np.testing.assert_array_equal(found.any(axis=-1), rim(size, sampling) <= 1)


# ---------------------------------------------------------------- pixels that line up


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("layout", ALL)
def test_the_same_raster_comes_back_bit_by_bit(tmp_path, rng, layout, sampling):
    size = 6
    image = rng.lognormal(0, 4, image_of(layout, size).shape).astype(np.float32)
    image[image_of(layout, size, f=np.ones_like) == 0] = 0  # corners of crosses, outside the rim
    if layout == "angular" and sampling == "border":
        image[rim(size, sampling) > 1] = 0
    if layout == "faces":
        path = str(tmp_path / "sky_%.exr")
        for name, face in zip(scenes.FACES, image.reshape(6, size, size, 3), strict=True):
            scenes.write(tmp_path / f"sky_{name}.exr", face)
        probe = open_probe(path, ReadOptions(sampling=sampling))
    else:
        probe = probe_of(tmp_path, image, layout, sampling=sampling)
    np.testing.assert_array_equal(resample.to_layout(probe, layout, sampling=sampling), image)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("layout", GRIDS)
@pytest.mark.parametrize(
    "options",
    [
        {"mirror": True},
        {"up": "z"},
        {"yaw": 90},
        {"yaw": 180},
        {"yaw": -90, "mirror": True},
        {"up": "z", "mirror": True, "yaw": 270},
    ],
)
def test_turned_pixels_are_copied(tmp_path, rng, layout, sampling, options):
    """Where a target's pixel is one of the source's directions, its bits are the source's.

    Which one follows from an image of the directions themselves, drawn by `scenes`.
    """
    size = 8
    image = rng.uniform(1, 2, image_of(layout, size).shape).astype(np.float32)
    outside = rim(size, sampling) > 1
    if layout == "angular":
        image[outside] = 0
    probe = probe_of(tmp_path, image, layout, sampling=sampling, **options)
    found = resample.to_layout(probe, layout, sampling=sampling).reshape(-1, 3)
    points = image_of(layout, size, sampling, f=lambda d: d).reshape(-1, 3)
    inside = np.ones(len(points), bool) if layout != "angular" else ~outside.ravel()
    near = np.linalg.norm((points @ probe.matrix)[:, None] - points, axis=-1) < 1e-5
    near &= inside & inside[:, None]
    single = near.sum(axis=1) == 1
    lines_up = layout == "openexr" or (options in ({"mirror": True},))
    lines_up |= layout == "latlong" and sampling == "center" and "up" not in options
    if not lines_up:
        assert not near[inside].any(axis=1).all()
        return
    assert single.sum() >= 0.5 * inside.sum()
    values = image.reshape(-1, 3)
    np.testing.assert_array_equal(found[single], values[near[single].argmax(axis=1)])
    # Redundant border pixels: one of those that share the direction, channels together.
    for k in np.flatnonzero(near.sum(axis=1) > 1):
        assert (found[k] == values[near[k]]).all(axis=1).any()


@pytest.mark.parametrize("orientation", ["openexr", "gl"])
@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("source", ["openexr", "strip", "hcross", "vcross"])
def test_cubes_are_rearranged_without_a_change(tmp_path, rng, source, sampling, orientation):
    stack = rng.lognormal(0, 4, (6, 5, 5, 3)).astype(np.float32)
    signs = {  # right, down of gl against openexr, from the table of the conventions
        name: tuple(1 if a == b else -1 for a, b in zip(line[:2], line[2:], strict=True))
        for name, *line in (line.split() for line in scenes.TABLE.split("\n")[1:-1])
    }
    gl = np.stack(
        [f[:: signs[n][1], :: signs[n][0]] for n, f in zip(scenes.FACES, stack, strict=True)]
    )
    faces = {"openexr": stack, "gl": gl}
    probe = probe_of(
        tmp_path,
        scenes.arrange(faces[orientation], source),
        source,
        orientation=orientation,
        sampling=sampling,
    )
    for target in CUBES:
        for other, expected in faces.items():
            found = resample.to_layout(probe, target, other, sampling=sampling)
            np.testing.assert_array_equal(
                found, scenes.arrange(expected, "openexr" if target == "faces" else target)
            )


# ---------------------------------------------------------------- means and energy


@pytest.mark.parametrize("ratio", [2, 3, 8])
@pytest.mark.parametrize("mirror", [False, True])
def test_latlongs_are_reduced_by_the_mean_of_blocks(tmp_path, rng, ratio, mirror):
    """Weighted by sin(theta) between rows, plain between columns; a sun beside darkness."""
    image = rng.lognormal(0, 3, (24, 48, 3)).astype(np.float32)
    image[5, 7] = 1e8
    probe = probe_of(tmp_path, image, mirror=mirror)
    found = resample.to_grid(probe, LatLong(24 // ratio))
    sine = np.sin(np.pi * (np.arange(24) + 0.5) / 24).reshape(-1, ratio)
    columns = image.astype(float).reshape(24, 48 // ratio, ratio, 3).mean(axis=2)
    blocks = columns.reshape(24 // ratio, ratio, 48 // ratio, 3)
    expected = np.einsum("rkcx,rk->rcx", blocks, sine / sine.sum(axis=1, keepdims=True))
    np.testing.assert_allclose(found, expected[:, ::-1] if mirror else expected, rtol=3e-7)


def test_cubes_are_reduced_by_the_mean_of_blocks(tmp_path, rng):
    image = rng.uniform(1, 2, (6 * 24, 24, 3)).astype(np.float32)
    found = resample.to_grid(probe_of(tmp_path, image), Cube(8))
    s = np.array(oracles.positions(24, "center"))
    weight = np.tile((1 + s**2 + s[:, None] ** 2) ** -1.5, (6, 1))
    sums = (image * weight[..., None]).reshape(48, 3, 8, 3, 3).sum(axis=(1, 3))
    expected = sums / weight.reshape(48, 3, 8, 3).sum(axis=(1, 3))[..., None]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "options"),
    [("sunset", {}), ("night", {"yaw": 17, "mirror": True}), ("city", {"up": "z"})],
)
def test_energy_of_a_real_probe(real_probes, tmp_path, name, options):
    """256 rows reduced by 4 and by 3.01."""
    image = reduced(real_probes / f"{name}.exr", 256)
    probe = probe_of(tmp_path, image, **options)
    pixels = probe.image().astype(float)
    expected = np.sum(pixels * solid_angles("latlong", 256)[..., None], axis=(0, 1))
    for rows in (64, 85):
        for layout, size in (("latlong", rows), ("openexr", rows // 2), ("angular", 2 * rows)):
            found = resample.to_layout(probe, layout, size=size).astype(float)
            weights = solid_angles(layout, size)[..., None]
            np.testing.assert_allclose(np.sum(found * weights, axis=(0, 1)), expected, rtol=1e-3)


@pytest.mark.parametrize("source", GRIDS)
@pytest.mark.parametrize("target", GRIDS)
def test_energy_of_suns_in_single_pixels(tmp_path, rng, source, target):
    """Each as bright as 1e6 times the rest; a filter would find them by chance."""
    size = {"latlong": 96, "openexr": 48, "angular": 192}
    suns = np.full(image_of(source, size[source]).shape, 0.01)
    for _ in range(4):
        at = rng.integers(suns.shape[0] // 4, suns.shape[0] * 3 // 4)
        suns[at, rng.integers(suns.shape[1] // 4, suns.shape[1] * 3 // 4)] = 1e4
    probe = probe_of(tmp_path, suns, source, up="z", yaw=33)
    weights = solid_angles(source, size[source])[..., None]
    expected = np.sum(probe.image().astype(float) * weights, axis=(0, 1))
    for divisor in (3, 4.3):
        reduced = int(size[target] / divisor)
        found = resample.to_layout(probe, target, size=reduced).astype(float)
        assert found.min() >= 0
        weights = solid_angles(target, reduced)[..., None]
        np.testing.assert_allclose(np.sum(found * weights, axis=(0, 1)), expected, rtol=2e-3)


def test_a_sun_stays_where_it_was(tmp_path):
    """The brightest pixel of each reduced image looks at it."""
    image = np.full((96, 192, 3), 0.01)
    image[30, 50] = 1e5
    elevation, longitude = np.pi * (0.5 - 30.5 / 96), np.pi * (1 - 50.5 / 96)
    level = np.cos(elevation)
    sun = [level * np.sin(longitude), np.sin(elevation), level * np.cos(longitude)]
    probe = probe_of(tmp_path, image, yaw=50, up="z")
    for layout, size in (("latlong", 24), ("openexr", 12), ("angular", 48)):
        for sampling in ("center", "border"):
            found = resample.to_layout(probe, layout, size=size, sampling=sampling)[..., 0]
            points = image_of(layout, size, sampling, f=lambda d: d)
            brightest = points.reshape(-1, 3)[found.argmax()]
            assert brightest @ probe.matrix @ sun > np.cos(1.3 * np.pi / 2 / 12)


@pytest.mark.parametrize("layout", ["latlong", "openexr"])
@pytest.mark.parametrize("options", [{}, {"up": "z", "yaw": 10}])
def test_redundant_border_pixels_agree(tmp_path, rng, layout, options):
    probe = probe_of(tmp_path, rng.lognormal(0, 2, (60, 120, 3)), **options)
    for size in (5, 8):
        found = resample.to_layout(probe, layout, size=size, sampling="border").reshape(-1, 3)
        points = image_of(layout, size, "border", f=lambda d: d).reshape(-1, 3)
        same = np.linalg.norm(points[:, None] - points, axis=-1) < 1e-5
        assert (same.sum(axis=1) > 1).sum() >= 2 * size
        for k in range(len(found)):
            np.testing.assert_allclose(found[same[k]], found[k][None].repeat(same[k].sum(), 0))


# ---------------------------------------------------------------- files of others


def test_the_kerner_pair(shared):
    """The same scene as a cube and as a lat-long, in OpenEXR's sample images."""
    cube = open_probe(shared / "probes" / "KernerEnvCube.exr")
    latlong = open_probe(shared / "probes" / "KernerEnvLatLong.exr")
    assert (cube.sampling, latlong.sampling) == ("border", "border")
    for sampling in ("center", "border"):
        pairs = [
            [resample.to_grid(probe, LatLong(64, sampling)) for probe in (cube, latlong)],
            [resample.to_grid(probe, Cube(32, sampling)) for probe in (cube, latlong)],
        ]
        for found, expected in pairs:
            assert np.abs(found - expected).sum() < 0.01 * expected.sum()
            assert np.linalg.norm(found - expected) < 0.05 * np.linalg.norm(expected)
            assert found.sum() == pytest.approx(expected.sum(), rel=1e-4)


# ---------------------------------------------------------------- sizes


@pytest.mark.parametrize(("source", "size"), [("latlong", 40), ("openexr", 20), ("angular", 80)])
def test_default_sizes_keep_the_resolution(tmp_path, source, size):
    probe = probe_of(tmp_path, image_of(source, size), source)
    assert resample.default_size(probe, LatLong) == 40
    assert resample.default_size(probe, Cube) == 20
    assert resample.default_size(probe, Angular) == 80


@pytest.mark.parametrize(
    ("layout", "size", "limits"),
    [
        ("latlong", 1, "2 to 8192"),
        ("latlong", 8193, "2 to 8192"),
        ("vcross", 0, "1 to 4096"),
        ("openexr", 4097, "1 to 4096"),
        ("angular", 2, "3 to 4096"),
        ("angular", 10**9, "3 to 4096"),
    ],
)
def test_sizes_out_of_range_are_refused(tmp_path, layout, size, limits):
    probe = probe_of(tmp_path, image_of("latlong", 8))
    with pytest.raises(ProbeError, match=rf"probe\.exr: .*size {size} .*{limits}"):
        resample.to_layout(probe, layout, size=size)


def test_sources_too_large_for_memory_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(resample, "MAX_PIXELS", 127)
    probe = probe_of(tmp_path, image_of("latlong", 8))
    with pytest.raises(ProbeError, match=r"probe\.exr: 128 pixels exceed 127"):
        resample.to_grid(probe, Cube(2))


def test_blocks_of_rows_change_nothing(tmp_path, monkeypatch, rng):
    probe = probe_of(tmp_path, rng.lognormal(0, 3, (40, 80, 3)), yaw=12, up="z")
    done = []
    expected = [resample.to_layout(probe, layout, size=12) for layout in GRIDS]
    monkeypatch.setattr(resample, "_SAMPLES_AT_ONCE", 100)
    for layout, whole in zip(GRIDS, expected, strict=True):
        with using(lambda rows, all_rows: done.append((rows, all_rows))):
            found = resample.to_layout(probe, layout, size=12)
        np.testing.assert_allclose(found, whole, rtol=1e-6)
    assert done[-1] == (12, 12)
    assert len(done) == 12 + 18 + 12
