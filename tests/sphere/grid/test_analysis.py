import ducc0
import numpy as np
import pytest
from scipy.special import eval_legendre

from shrm_cli.sphere.grid.angular import analyze_angular
from shrm_cli.sphere.grid.latlong import LatLongAnalysis
from tests import oracles
from tests.oracles import EPS

GEOMETRY = {"center": "F1", "border": "CC"}


def analyze(image, order, sampling="center", dtype=np.float64):
    height, width, _ = image.shape
    analysis = LatLongAnalysis(width, height, order, sampling, dtype)
    analysis.add(0, image)
    return analysis


def band_limited_image(rng, width, height, order, sampling, channels=2):
    coefficients = rng.standard_normal(((order + 1) ** 2, channels))
    directions = oracles.latlong_pixels(width, height, sampling)
    return coefficients, oracles.real_harmonics(order, directions) @ coefficients


def zonal_sum(rng, directions, order):
    """Coefficients, by the addition theorem, and values of ``sum_l P_l(a_l . d)``, a_l random."""
    values, coefficients = 0.0, np.zeros((order + 1) ** 2)
    for degree in range(order + 1):
        axis = oracles.random_directions(rng)
        values = values + eval_legendre(degree, directions @ axis)
        for m in range(-degree, degree + 1):
            value = oracles.complex_harmonic(degree, abs(m), axis)
            part = value.imag if m < 0 else value.real
            scale = (-1) ** m * np.sqrt(2) if m else 1
            coefficients[degree * (degree + 1) + m] = scale * part * 4 * np.pi / (2 * degree + 1)
    return coefficients, values


def ducc_map(image, sampling):
    """One channel with its longitude ascending from -pi, and the longitude of its first column.

    ducc0's rings do not repeat their first column at the end, so the two border columns, each of
    half the weight, become their mean.
    """
    flipped = image[:, ::-1].astype(np.float64)
    if sampling == "center":
        return np.ascontiguousarray(flipped)[None], -np.pi + np.pi / image.shape[1]
    merged = flipped[:, :-1].copy()
    merged[:, 0] = (flipped[:, 0] + flipped[:, -1]) / 2
    return merged[None], -np.pi


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("height", [1, 2, 3, 8, 17, 24])
def test_band_limited_images_are_analysed_exactly(rng, height, sampling):
    if sampling == "border":
        height += 1
    order = (height - 1) // 2
    expected, image = band_limited_image(rng, 2 * height, height, order, sampling)
    found = analyze(image, order, sampling).coefficients()
    np.testing.assert_allclose(found, expected, rtol=0, atol=50 * EPS * (order + 1))


@pytest.mark.parametrize(("height", "sampling"), [(24, "center"), (25, "border")])
def test_images_of_higher_order(rng, height, sampling):
    """Exact while both orders together stay below the height."""
    expected, image = band_limited_image(rng, 48, height, 17, sampling)
    found = analyze(image, 6, sampling).coefficients()
    np.testing.assert_allclose(found, expected[:49], rtol=0, atol=1e-13)


@pytest.mark.parametrize(("width", "height"), [(26, 30), (70, 30)])
def test_widths_other_than_twice_the_height(rng, width, height):
    expected, image = band_limited_image(rng, width, height, 12, "center")
    found = analyze(image, 12).coefficients()
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize(
    ("height", "order"),
    [(32, 15), (33, 10), (128, 63), pytest.param(256, 125, marks=pytest.mark.proof)],
)
def test_band_limited_images_against_ducc(rng, height, order, sampling):
    directions = oracles.latlong_pixels(2 * height, height, sampling)
    expected, values = zonal_sum(rng, directions, order)
    rings, phi0 = ducc_map(values, sampling)
    alm = ducc0.sht.analysis_2d(
        map=rings, spin=0, lmax=order, geometry=GEOMETRY[sampling], phi0=phi0
    )
    analysis = analyze(values[..., None], order, sampling)
    found = analysis.polar_coefficients()[:, 0]
    np.testing.assert_allclose(
        found, oracles.real_from_alm(alm[0], order), rtol=0, atol=50 * EPS * (order + 1)
    )
    np.testing.assert_allclose(
        analysis.coefficients()[:, 0], expected, rtol=0, atol=50 * EPS * (order + 1)
    )


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize(
    ("height", "order"), [(2, 1), (32, 15), (33, 32), (128, 100), (131, 128), (256, 20)]
)
def test_random_images_against_the_same_quadrature_by_ducc(rng, height, order, sampling):
    """White noise, which no rule of this many rings integrates exactly.

    `analysis_2d` answers differently: it takes for granted that the image has no degrees above
    `order`. So the comparison is with ducc0's own weights and the adjoint of its synthesis.
    """
    image = rng.random((height, 2 * height, 1))
    rings, phi0 = ducc_map(image[..., 0], sampling)
    weights = ducc0.sht.experimental.get_gridweights(GEOMETRY[sampling], height)
    alm = ducc0.sht.adjoint_synthesis_2d(
        map=rings * (weights / rings.shape[-1])[:, None],
        spin=0,
        lmax=order,
        mmax=min(order, (rings.shape[-1] - 1) // 2),
        geometry=GEOMETRY[sampling],
        phi0=phi0,
    )
    found = analyze(image, order, sampling).polar_coefficients()[:, 0]
    np.testing.assert_allclose(
        found, oracles.real_from_alm(alm[0], order), rtol=0, atol=50 * EPS * (order + 1)
    )


@pytest.mark.parametrize("sampling", ["center", "border"])
def test_world_axes_and_the_axes_of_the_image(rng, sampling):
    """One function in two frames: image axes x, y, z are world +Z, +X, +Y."""
    image = rng.random((9, 18, 1))
    analysis = analyze(image, 4, sampling)
    world = oracles.random_directions(rng, 30)
    np.testing.assert_allclose(
        oracles.real_harmonics(4, world) @ analysis.coefficients(),
        oracles.real_harmonics(4, world[:, [2, 0, 1]]) @ analysis.polar_coefficients(),
        atol=1e-13,
    )


@pytest.mark.parametrize(("axis", "at"), [(0, 3), (1, 1), (2, 2)])
def test_an_image_of_one_coordinate(axis, at):
    """x, y and z are 1 / 0.488603 times Y_11, Y_1,-1 and Y_10, in float32 too."""
    image = oracles.latlong_pixels(64, 32)[..., [axis]].astype(np.float32)
    expected = np.zeros((16, 1))
    expected[at] = 1 / 0.4886025119029199
    found = analyze(image, 3, dtype=np.float32).coefficients()
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_uneven_blocks_of_rows_are_one_image(rng, sampling, dtype):
    image = rng.random((37, 74, 3)).astype(dtype)
    whole = analyze(image, 11, sampling, dtype).coefficients()
    blocks = LatLongAnalysis(74, 37, 11, sampling, dtype)
    for start, stop in ((20, 33), (0, 1), (33, 37), (1, 20)):
        blocks.add(start, image[start:stop])
    np.testing.assert_allclose(blocks.coefficients(), whole, rtol=0, atol=50 * np.finfo(dtype).eps)


@pytest.mark.parametrize("stored", [np.float16, np.float32])
@pytest.mark.parametrize(("height", "order"), [(64, 24), (128, 120)])
def test_single_precision(rng, stored, height, order):
    image = rng.random((height, 2 * height, 3)).astype(stored)
    exact = analyze(image.astype(np.float64), order).coefficients()
    found = analyze(image, order, dtype=np.float32).coefficients()
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-6 * np.abs(exact).max())
    # float32 images lose nothing when the integral is asked for in double precision
    np.testing.assert_allclose(analyze(image, order).coefficients(), exact, rtol=0, atol=1e-13)


@pytest.mark.parametrize(("height", "order"), [(4, 1), (128, 120)])
def test_half_images_near_their_limit_do_not_overflow(height, order):
    image = np.full((height, 2 * height, 1), 60000, dtype=np.float16)
    found = analyze(image, order, dtype=np.float32).coefficients()[:, 0]
    exact = float(image[0, 0, 0]) * np.sqrt(4 * np.pi)
    assert found[0] == pytest.approx(exact, rel=1e-6)
    np.testing.assert_allclose(found[1:], 0, atol=1e-6 * exact)


def test_the_image_is_left_alone(rng):
    image = rng.random((8, 16, 3))
    before = image.copy()
    analyze(image, 3).coefficients()
    np.testing.assert_array_equal(image, before)


def test_an_analysis_without_rows_has_no_coefficients():
    analysis = LatLongAnalysis(16, 8, 3)
    with pytest.raises(ValueError, match="no rows"):
        analysis.coefficients()


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("size", [2, 3, 8, 13])
@pytest.mark.parametrize("order", [0, 1, 5])
def test_angular_maps_against_the_harmonics(rng, order, size, sampling):
    """The sum over the pixels inside the rim, of a random image, with each harmonic."""
    weighted = rng.standard_normal((size, size, 2))
    expected = np.zeros(((order + 1) ** 2, 2))
    for row, t in enumerate(oracles.positions(size, sampling)):
        for column, s in enumerate(oracles.positions(size, sampling)):
            radius = np.hypot(s, t)
            if radius > 1:
                continue
            around = np.sin(np.pi * radius) / radius if radius > 0 else 0
            direction = [-s * around, -t * around, np.cos(np.pi * radius)]
            basis = oracles.real_harmonics(order, direction)
            expected += basis[:, None] * weighted[row, column]
    found = analyze_angular(weighted, order, sampling)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


def test_the_smallest_angular_map():
    found = analyze_angular(np.full((1, 1, 1), 4 * np.pi), 1)
    np.testing.assert_allclose(found[:, 0], np.sqrt([4 * np.pi, 0, 12 * np.pi, 0]), atol=1e-14)
