"""Transforms with gradients, beside scipy's harmonics and beside the numpy code."""

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.probe.lighting import project
from shrm_cli.sphere.synthesis import synthesize_cube
from tests.oracles import (
    cube_texels,
    latlong_pixels,
    random_directions,
    random_rotation,
    real_harmonics,
)
from tests.torch.setup import has_right_gradients, torch, variable

from shrm_cli.torch import (  # isort: skip
    CubeSynthesis,
    DirectionSynthesis,
    Irradiance,
    LatLongProjection,
    Rotation,
)


@pytest.mark.parametrize(("order", "size", "sampling"), [
    (1, 1, "center"), (2, 3, "center"), (7, 5, "border"), (12, 8, "center"), (20, 2, "border"),
])  # fmt: skip
def test_cubes_hold_the_series_at_their_texels(rng, order, size, sampling):
    series = rng.standard_normal(((order + 1) ** 2, 2))
    expected = real_harmonics(order, cube_texels(size, sampling)) @ series
    found = CubeSynthesis(order, size, sampling)(torch.from_numpy(series))
    np.testing.assert_allclose(found, expected.reshape(6 * size, size, 2), atol=1e-11)


def test_levels_are_series_with_their_degrees_multiplied(rng):
    series, factors = rng.standard_normal((49, 3)), rng.standard_normal((4, 6))
    degree = np.floor(np.sqrt(np.arange(36))).astype(int)
    texels = real_harmonics(5, cube_texels(6)).reshape(36, 6, 36)
    expected = np.stack([texels @ (each[degree, None] * series[:36]) for each in factors])
    found = CubeSynthesis(5, 6)(torch.from_numpy(series), torch.from_numpy(factors))
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("order", [64, 97, 130])
def test_high_orders_are_those_of_numpy(rng, order):
    series = rng.standard_normal(((order + 1) ** 2, 1))
    expected = np.moveaxis(synthesize_cube(series, 24), 0, -1)
    found = CubeSynthesis(order, 24)(torch.from_numpy(series))
    np.testing.assert_allclose(found, expected, atol=1e-10)


@pytest.mark.parametrize(("order", "sampling"), [(5, "center"), (9, "center"), (6, "border")])
def test_coefficients_are_those_of_a_known_series(rng, order, sampling):
    series = rng.standard_normal(((order + 1) ** 2, 2))
    image = real_harmonics(order, latlong_pixels(40, 20, sampling)) @ series
    found = LatLongProjection(order, 20, sampling)(torch.from_numpy(image))
    np.testing.assert_allclose(found, series, atol=1e-12)


def test_real_probes_have_the_coefficients_of_numpy(real_probes):
    for name in ("city", "night", "studio", "forest"):
        probe = shrm.open_probe(real_probes / f"{name}.exr")
        expected = project(probe, 24).coefficients
        image = torch.from_numpy(np.asarray(probe.image(), dtype=float))
        found = LatLongProjection(24, len(image))(image)
        np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_pixels_at_poles_have_gradients_as_small_as_their_solid_angles(rng):
    """A pixel counts as much as the harmonic there, times the weight of its row."""
    order, height = 6, 16
    image = variable(height, 2 * height, 1)
    toward = torch.from_numpy(rng.standard_normal((49, 1)))
    (LatLongProjection(order, height)(image) * toward).sum().backward()
    pixels = latlong_pixels(2 * height, height)
    per_weight = (
        image.grad[..., 0].numpy() / (real_harmonics(order, pixels) @ toward.numpy())[..., 0]
    )
    rows = per_weight.mean(axis=1)
    np.testing.assert_allclose(per_weight, rows[:, None] * np.ones(2 * height), rtol=1e-9)
    areas = np.pi / height * (-np.diff(np.cos(np.linspace(0, np.pi, height + 1))))
    np.testing.assert_allclose(rows, areas, rtol=0.15)
    assert rows.sum() * 2 * height == pytest.approx(4 * np.pi)


def test_rotations_carry_functions_along(rng):
    matrix, series = random_rotation(rng), rng.standard_normal((64, 2))
    directions = random_directions(rng, 9)
    found = Rotation(7, matrix)(torch.from_numpy(series)).numpy()
    expected = real_harmonics(7, directions @ matrix) @ series
    np.testing.assert_allclose(real_harmonics(7, directions) @ found, expected, atol=1e-12)


def test_gradients(rng):
    assert has_right_gradients(CubeSynthesis(3, 4), variable(16, 2), variable(2, 4, seed=2))
    assert has_right_gradients(LatLongProjection(3, 4), variable(4, 8, 2))
    synthesis = DirectionSynthesis(3, [*random_directions(rng, 3), [0, 0, 1], [0, 0, -1]])
    assert has_right_gradients(synthesis, variable(16, 2), variable(4, seed=2))


def test_single_precision_and_other_shapes():
    synthesis = CubeSynthesis(8, 16).float()
    assert synthesis(torch.ones(100, 3)).dtype == torch.float32
    with pytest.raises(ValueError, match="order 0"):
        CubeSynthesis(0, 4)
    with pytest.raises(ValueError, match="order 8"):
        LatLongProjection(8, 8)
    with pytest.raises(ValueError, match="shape"):
        LatLongProjection(3, 8)(torch.ones(8, 8, 3))


def test_modules_work_on_other_devices():
    """Tensors of the device ``meta`` have shapes and no numbers: one that stays behind fails."""
    image = torch.ones(16, 32, 3, device="meta", dtype=torch.float64)
    series = LatLongProjection(5, 16).to("meta")(image)
    factors = torch.ones(2, 6, device="meta", dtype=torch.float64)
    levels = CubeSynthesis(5, 8).to("meta")(series, factors)
    assert levels.device.type == "meta"
    assert levels.shape == (2, 48, 8, 3)


def test_further_coefficients_are_left_out_and_others_refused(rng):
    """A vector of one channel would be spread over as many maps as it has coefficients."""
    series = torch.from_numpy(rng.standard_normal((49, 2)))
    modules = (
        Rotation(3, random_rotation(rng)),
        DirectionSynthesis(3, random_directions(rng, 5)),
        Irradiance(3, random_directions(rng, 5)),
        CubeSynthesis(3, 4),
    )
    for module in modules:
        np.testing.assert_array_equal(module(series), module(series[:16]))
        for wrong in (series[:9], series[:16, 0]):
            with pytest.raises(ValueError, match=r"coefficients of shape .*, not \(16 or more"):
                module(wrong)
