"""Principal components against numpy's singular values, and orders left out."""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import MapError
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.make import prefilter_shrm
from shrm_cli.maps.shrm.shrm import CompressedShrm
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.open import open_probe
from tests.maps.scenes import cube_weights, make_shrm, relative_rms, uniform_points

EVERY = 9


def weighted_matrix(shrm):
    """Coefficients times the root of the solid angle, shape (texels and channels, (P+1)^2)."""
    root = np.sqrt(cube_weights(shrm.size, shrm.sampling))[..., None, None]
    return (shrm.coefficients * root).transpose(0, 1, 3, 2).reshape(-1, shrm.coefficients.shape[2])


def error_of(shrm, other):
    """Relative RMS over all central directions and views: Parseval over the view."""
    whole = weighted_matrix(shrm)
    return np.linalg.norm(weighted_matrix(other) - whole) / np.linalg.norm(whole)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("frame", ["global", "local"])
@pytest.mark.parametrize("count", [1, 4, 8])
def test_components_are_those_of_the_singular_values(count, frame, sampling):
    shrm = make_shrm(size=6, frame=frame, sampling=sampling)
    made = CompressedShrm.from_shrm(shrm, count)
    assert (made.frame, made.center, made.sampling) == (frame, "reflection", sampling)
    assert (made.cube_count, made.order_p, made.size) == (count, 2, 6)
    left, values, right = np.linalg.svd(weighted_matrix(shrm), full_matrices=False)
    best = (left[:, :count] * values[:count]) @ right[:count]
    found = weighted_matrix(made.expand())
    np.testing.assert_allclose(found, best, atol=1e-11 * np.abs(best).max())
    expected = np.sqrt(np.sum(values[count:] ** 2) / np.sum(values**2))
    assert error_of(shrm, made.expand()) == pytest.approx(expected, rel=1e-9)
    assert made.info.added_error == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("count", [1, 4, 8])
def test_no_other_basis_is_better(count):
    shrm = make_shrm(size=6)
    matrix = weighted_matrix(shrm)
    error = error_of(shrm, CompressedShrm.from_shrm(shrm, count).expand())
    rng = np.random.default_rng(41)
    others = []
    for _ in range(20):
        basis = np.linalg.qr(rng.normal(size=(EVERY, count)))[0]
        rest = matrix - matrix @ basis @ basis.T
        others.append(np.linalg.norm(rest) / np.linalg.norm(matrix))
    assert error < min(others)


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-14), (np.float32, 1e-6)])
def test_all_components_lose_nothing(dtype, tolerance):
    shrm = make_shrm(size=6, dtype=dtype)
    made = CompressedShrm.from_shrm(shrm, EVERY)
    assert made.components.dtype == dtype
    assert relative_rms(made.expand().coefficients, shrm.coefficients) < tolerance
    assert made.info == replace(shrm.info, added_error=0.0)


def test_rows_are_orthonormal_and_ordered():
    shrm = make_shrm(size=6)
    made = CompressedShrm.from_shrm(shrm, 6)
    np.testing.assert_allclose(made.matrix @ made.matrix.T, np.eye(6), atol=1e-14)
    weights = cube_weights(6)[..., None, None]
    energies = np.sum(made.components**2 * weights, axis=(0, 1, 3))
    assert np.all(np.diff(energies) < 0)


def test_sign_does_not_depend_on_chance():
    """The largest entry of a row is positive; the same map gives the same components."""
    shrm = make_shrm(size=6)
    made = CompressedShrm.from_shrm(shrm, 6)
    peaks = made.matrix[np.arange(6), np.abs(made.matrix).argmax(axis=1)]
    assert peaks.min() > 0
    turned = CompressedShrm.from_shrm(replace(shrm, coefficients=-shrm.coefficients), 6)
    np.testing.assert_array_equal(turned.matrix, made.matrix)
    np.testing.assert_array_equal(turned.components, -made.components)


@pytest.mark.parametrize("tolerance", [1.5, 0.9, 0.5, 0.2, 0.05, 1e-9, 0.0])
def test_tolerance_keeps_the_least_components(tolerance):
    shrm = make_shrm(size=6)
    values = np.linalg.svd(weighted_matrix(shrm), compute_uv=False)
    errors = [np.sqrt(np.sum(values[k:] ** 2) / np.sum(values**2)) for k in range(EVERY + 1)]
    expected = next(k for k in range(1, EVERY + 1) if errors[k] <= tolerance)
    made = CompressedShrm.from_shrm(shrm, tolerance=tolerance)
    assert made.cube_count == expected
    assert made.info.added_error <= tolerance


def test_a_map_of_few_components_is_kept_by_as_many():
    """Coefficients that are all multiples of two patterns."""
    rng = np.random.default_rng(42)
    shrm = make_shrm(size=6)
    values = np.einsum("ijkc,kn->ijnc", rng.normal(size=(36, 6, 2, 3)), rng.normal(size=(2, 9)))
    shrm = replace(shrm, coefficients=values)
    made = CompressedShrm.from_shrm(shrm, tolerance=1e-6)
    assert made.cube_count == 2
    assert made.info.added_error < 1e-7
    np.testing.assert_allclose(made.expand().coefficients, values, atol=1e-12)


def test_black_maps():
    shrm = make_shrm(size=4)
    shrm = replace(shrm, coefficients=0 * shrm.coefficients)
    for count, expected in ((None, 1), (3, 3)):
        made = CompressedShrm.from_shrm(shrm, count)
        assert made.cube_count == expected
        assert made.info.added_error == 0
        assert np.isfinite(made.matrix).all()
        assert not made.radiance(*uniform_points(5)).any()


@pytest.mark.parametrize("count", [0, -1, 10])
def test_components_that_there_are_not(count):
    with pytest.raises(MapError, match=f"{count} components .* P = 2 has 9; ask for 1 .. 9"):
        CompressedShrm.from_shrm(make_shrm(size=3), count)


def test_shapes_are_checked():
    info = make_shrm(size=3).info
    for shape in ((18, 3, 2, 4), (17, 3, 2, 3), (18, 3, 2)):
        with pytest.raises(ValueError, match="components of shape"):
            CompressedShrm(np.zeros(shape), np.zeros((2, 9)), "global", "reflection", info)
    for shape, words in (((3, 9), "2 components"), ((9,), "2 components"), ((2, 8), "square")):
        with pytest.raises(ValueError, match=words):
            CompressedShrm(np.zeros((18, 3, 2, 3)), np.zeros(shape), "global", "reflection", info)


@pytest.mark.parametrize("count", [1, 4, 8])
@pytest.mark.parametrize("frame", ["global", "local"])
def test_added_error_is_the_measured_one(frame, count):
    shrm = make_shrm(order_f=5, size=32, seed=7, frame=frame, dtype=np.float32)
    made = CompressedShrm.from_shrm(shrm, count)
    points = uniform_points(8000)
    measured = relative_rms(made.radiance(*points), shrm.radiance(*points))
    assert made.info.added_error == pytest.approx(measured, rel=0.03)


@pytest.mark.parametrize("frame", ["global", "local"])
@pytest.mark.parametrize("name", ["studio", "interior"])
def test_four_of_nine_components_are_better_than_the_orders(real_probes, name, frame):
    """Less is lost by four components than by the four coefficients of P = 1."""
    brdf = parse_spec("microfacet:sigma=0.2")
    probe = open_probe(real_probes / f"{name}.exr")
    prefiltered = prefilter_shrm(Projection(probe), Request("shrm", brdf, size=32, frame=frame))
    assert prefiltered.map.coefficients.shape[2] == 9
    made = CompressedShrm.from_shrm(prefiltered.map, 4)
    fewer = prefiltered.map.truncated(1)
    print(f"{name} {frame}: {made.info.added_error:.4f}, orders {fewer.info.added_error:.4f}")
    assert made.info.added_error < 0.9 * fewer.info.added_error
    points = uniform_points(4000)
    measured = relative_rms(made.radiance(*points), prefiltered.map.radiance(*points))
    assert made.info.added_error == pytest.approx(measured, rel=0.1)


# ---- orders left out -----------------------------------------------------------------------------


@pytest.mark.parametrize("frame", ["global", "local"])
@pytest.mark.parametrize("order_p", [0, 1, 2])
def test_truncated_maps(order_p, frame):
    shrm = make_shrm(order_p=3, size=32, frame=frame, dtype=np.float32)
    made = shrm.truncated(order_p)
    assert (made.order_p, made.info.order_p, made.frame) == (order_p, order_p, frame)
    kept = (order_p + 1) ** 2
    np.testing.assert_array_equal(made.coefficients, shrm.coefficients[:, :, :kept])
    matrix = weighted_matrix(shrm)
    expected = np.linalg.norm(matrix[:, kept:]) / np.linalg.norm(matrix)
    assert made.info.added_error == pytest.approx(expected, rel=1e-5)
    points = uniform_points(8000)
    measured = relative_rms(made.radiance(*points), shrm.radiance(*points))
    assert made.info.added_error == pytest.approx(measured, rel=0.03)


def test_nothing_to_leave_out():
    shrm = make_shrm(size=3)
    for order_p in (None, 2, 5):
        assert shrm.truncated(order_p) is shrm
    black = replace(shrm, coefficients=0 * shrm.coefficients).truncated(1)
    assert black.info.added_error == 0


def test_errors_of_one_step_after_the_other_add_up():
    """They are orthogonal: first the orders, then components of what is left."""
    shrm = make_shrm(order_p=3, size=32, dtype=np.float32)
    made = CompressedShrm.from_shrm(shrm.truncated(2), 6)
    points = uniform_points(8000)
    measured = relative_rms(made.radiance(*points), shrm.radiance(*points))
    assert made.info.added_error == pytest.approx(measured, rel=0.1)
