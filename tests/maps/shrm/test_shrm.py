"""SHRM against brute-force integration at generic angles, in both frames."""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.errors import MapError
from shrm_cli.maps.explicit.views import Cabral
from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.shrm import CompressedShrm, Shrm
from shrm_cli.maps.size import check_size, choose_size
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.harmonics import real_harmonics
from tests.brute_force import band_limited, reflected, sphere_rule, unit
from tests.maps.scenes import make_shrm

INFO = MapInfo(0, 0, 0.03, 1.0, 0.0)


def random_coefficients(rng, order_f, order_p):
    values = rng.normal(size=(order_f + 1, order_p + 1, order_p + 1, 3))
    for degree in range(order_f + 1):
        for p in range(order_p + 1):
            values[degree, p, min(degree, p) + 1 :] = 0
    return values


@pytest.fixture(params=[(6, 3), (3, 4), (5, 0)], ids=str)
def case(request):
    rng = np.random.default_rng(request.param)
    order_f, order_p = request.param
    lighting = rng.normal(size=((order_f + 1) ** 2, 3))
    return rng, lighting, random_coefficients(rng, order_f, order_p)


def truth(lighting, coefficients, reflection, view):
    order_f = coefficients.shape[0] - 1
    light, weights = sphere_rule(4 * order_f + 4)
    radiance = real_harmonics(order_f, light) @ lighting
    return np.array(
        [
            reflected(
                band_limited(coefficients[..., c]), reflection, view, light, weights, radiance[:, c]
            )
            for c in range(3)
        ]
    )


@pytest.mark.parametrize("what", ["frame", "center", "sampling"])
def test_unknown_names_are_refused(what):
    """Code would take them for one of the known ones, and look up something else."""
    made = make_shrm(3, 2, 4)
    maps = [made, CompressedShrm.from_shrm(made, 3)]
    maps += [Cabral.from_shrm(made)] if what != "frame" else []
    for each in maps:
        with pytest.raises(ValueError, match=f"{what} 'foo' is not one of "):
            replace(each, **{what: "foo"})


@pytest.mark.parametrize("frame", ["global", "local"])
def test_equals_the_integral_at_generic_angles(case, frame):
    rng, lighting, coefficients = case
    shrm = Shrm.from_coefficients(lighting, coefficients, "reflection", INFO, size=7, frame=frame)
    texels = cube_directions(7).reshape(-1, 3)
    for reflection in texels[rng.choice(len(texels), 6, replace=False)]:
        for view in unit(rng, 2):
            normal = (reflection + view) / np.linalg.norm(reflection + view)
            expected = truth(lighting, coefficients, reflection, view)
            # R of (N, V) is the texel's centre: no filtering comes in.
            found = shrm.radiance(normal, view)
            np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


def test_local_frame_holds_the_coefficients_of_equation_5_10(case):
    rng, lighting, coefficients = case
    shrm = Shrm.from_coefficients(lighting, coefficients, "reflection", INFO, size=5, frame="local")
    texels = cube_directions(5)
    row, column = 13, 2
    reflection = texels[row, column]
    theta, phi = np.arccos(reflection[2]), np.arctan2(reflection[1], reflection[0])
    c, s = np.cos(theta), np.sin(theta)
    frame = np.array(
        [
            [c * np.cos(phi), -np.sin(phi), s * np.cos(phi)],
            [c * np.sin(phi), np.cos(phi), s * np.sin(phi)],
            [-s, 0, c],
        ]
    )
    view = unit(rng, 1)[0]
    harmonics = real_harmonics(shrm.order_p, view @ frame)
    found = harmonics @ shrm.coefficients[row, column]
    np.testing.assert_allclose(found, truth(lighting, coefficients, reflection, view), rtol=1e-9)


def test_frames_convert_back_and_forth(case):
    _, lighting, coefficients = case
    shrm = Shrm.from_coefficients(lighting, coefficients, "reflection", INFO, size=6)
    again = shrm.to_frame("local").to_frame("global")
    np.testing.assert_allclose(again.coefficients, shrm.coefficients, atol=1e-11)


def test_half_file_read_back(case, tmp_path):
    rng, lighting, coefficients = case
    shrm = Shrm.from_coefficients(lighting, coefficients, "reflection", INFO, size=8)
    assert shrm.save(tmp_path / "a.exr") == "half"
    back = open_map(tmp_path / "a.exr")
    normals, views = unit(rng, 300), unit(rng, 300)
    expected = shrm.radiance(normals, views)
    scale = np.sqrt(np.mean(expected**2))
    assert np.abs(back.radiance(normals, views) - expected).max() < 2e-3 * scale


@pytest.mark.parametrize("sampling", ["center", "border"])
def test_distant_view_is_the_same_as_each_view(case, sampling):
    rng, lighting, coefficients = case
    shrm = Shrm.from_coefficients(
        lighting, coefficients, "reflection", INFO, size=8, sampling=sampling
    )
    normals, view = unit(rng, 50), unit(rng, 1)[0]
    views = np.broadcast_to(view, normals.shape).copy()
    np.testing.assert_allclose(
        shrm.radiance(normals, view), shrm.radiance(normals, views), atol=1e-10
    )


def test_another_distant_view_in_between_changes_nothing(case):
    """As of two threads: the second one asks before the first one has what it looked up."""
    rng, lighting, coefficients = case
    shrm = Shrm.from_coefficients(lighting, coefficients, "reflection", INFO, size=8)
    normals, (view, other) = unit(rng, 50), unit(rng, 2)
    expected = shrm.radiance(normals, view)

    class Interrupted(dict):
        asked = 0

        def __setitem__(self, key, value):
            super().__setitem__(key, value)
            self.asked += 1
            if self.asked == 1:
                shrm.radiance(normals, other)

    shrm.__dict__["_last_view"] = Interrupted()
    np.testing.assert_array_equal(shrm.radiance(normals, view), expected)
    assert shrm._last_view.asked == 2


def test_float32_synthesis_is_close(case):
    _, lighting, coefficients = case
    double = Shrm.from_coefficients(lighting, coefficients, "reflection", INFO, size=8)
    single = Shrm.from_coefficients(
        lighting, coefficients, "reflection", INFO, size=8, dtype=np.float32
    )
    assert single.coefficients.dtype == np.float32
    scale = np.abs(double.coefficients).max()
    assert np.abs(single.coefficients - double.coefficients).max() < 2e-6 * scale


@pytest.mark.parametrize(("spec", "factor"), [("lambertian:albedo=0.7", 0.7), ("phong", 1.0)])
def test_furnace(spec, factor):
    """f_r = albedo / pi reflects albedo times the light, Phong's normalised lobe once."""
    brdf = parse_spec(spec)
    coefficients = compute_coefficients(brdf, 12, 0)
    light = np.array([1.0, 2.0, 0.25])
    lighting = np.zeros((13**2, 3))
    lighting[0] = light * np.sqrt(4 * np.pi)
    shrm = Shrm.from_coefficients(lighting, coefficients.values, brdf.center, INFO, size=16)
    radiance = shrm.coefficients[:, :, 0] * np.sqrt(1 / (4 * np.pi))
    np.testing.assert_allclose(radiance, np.broadcast_to(factor * light, radiance.shape), rtol=1e-6)


def test_lambertian_is_centred_on_the_normal():
    rng = np.random.default_rng(4)
    brdf = parse_spec("lambertian")
    lighting = np.zeros((9, 3))
    lighting[3] = 1.0  # Y_11 = 0.488603 x
    shrm = Shrm.from_coefficients(
        lighting, compute_coefficients(brdf, 2, 0).values, brdf.center, INFO, size=32
    )
    normals, views = unit(rng, 40), unit(rng, 40)
    # The cosine-weighted integral of x is (2 pi / 3) N_x; the BRDF divides by pi.
    expected = 0.48860251190292 * (2 / 3) * normals[:, 0]
    np.testing.assert_allclose(shrm.radiance(normals, views)[:, 1], expected, atol=2e-4)


@pytest.mark.parametrize(
    ("order", "size"), [(0, 16), (6, 16), (7, 32), (11, 32), (24, 64), (60, 256)]
)
def test_size_follows_the_order(order, size):
    assert choose_size(order) == size


def test_size_is_bounded_before_anything_is_allocated():
    with pytest.raises(MapError, match="lower `size`"):
        Shrm.from_coefficients(
            np.zeros((4, 3)), np.zeros((2, 4, 4, 3)), "reflection", INFO, size=4096
        )


def test_shapes_are_checked():
    with pytest.raises(ValueError, match="shape"):
        Shrm(np.zeros((5, 1, 1, 3)), "global", "reflection", INFO)
    with pytest.raises(ValueError, match="square"):
        Shrm(np.zeros((6, 1, 3, 3)), "global", "reflection", INFO)


def test_orders_are_bounded_before_anything_is_computed():
    with pytest.raises(MapError, match="F = 512 and P = 32 make"):
        check_size(512, 32, 16)
    check_size(465, 2)


def test_frames_and_moments_of_large_maps_are_made_in_parts(monkeypatch):
    """Whole, the directions of 3800 texels along an edge took 8 GB for a map of 1 GB."""
    import tracemalloc

    from shrm_cli.maps.shrm import shrm as module

    size = 160
    rng = np.random.default_rng(2)
    coefficients = rng.normal(size=(6 * size, size, 4, 3)).astype(np.float32)
    map_ = Shrm(coefficients, "global", "reflection", INFO)
    whole, whole_frame = module.second_moments(map_), map_.to_frame("local").coefficients
    monkeypatch.setattr(module, "_VALUES_AT_ONCE", 2**14)
    monkeypatch.setattr(module, "_TEXELS_AT_ONCE", 2**10)
    tracemalloc.start()
    try:
        parts, frame = module.second_moments(map_), map_.to_frame("local").coefficients
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    np.testing.assert_allclose(parts, whole, rtol=1e-12)
    np.testing.assert_array_equal(frame, whole_frame)
    assert peak < 1.3 * coefficients.nbytes
