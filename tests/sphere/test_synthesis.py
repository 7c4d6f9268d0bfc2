import ducc0
import numpy as np
import pytest

from shrm_cli.arrays import Memo
from shrm_cli.sphere import double_fourier, synthesis
from shrm_cli.sphere.synthesis import CubeIntegral, CubeSeries, synthesize_cube
from shrm_cli.vocabulary import FACES
from tests import oracles
from tests.oracles import tolerance

SAMPLINGS = ["center", "border"]


def integrate_cube(planes, order, sampling="center"):
    """Integrals of planes, (maps, 6 N, N), that are weighted already, with every harmonic."""
    maps, _, size = planes.shape
    faces = planes.reshape(maps, 6, size, size)
    result = CubeIntegral(order, sampling)
    result.add({name: faces[:, index] for index, name in enumerate(FACES)})
    return result.coefficients()


def truth(coefficients, size, sampling):
    """Planes (maps, 6 size, size), texel by texel."""
    order = round(len(coefficients) ** 0.5) - 1
    directions = oracles.cube_texels(size, sampling).reshape(6 * size, size, 3)
    return np.moveaxis(oracles.real_harmonics(order, directions) @ coefficients, -1, 0)


@pytest.fixture(params=["octants", "meridians"])
def method(request, monkeypatch):
    """Both ways in which series are synthesized, whichever is taken for such a size."""
    monkeypatch.setattr(double_fourier, "MOST_VALUES", 2**21 if request.param == "octants" else 0)


@pytest.mark.usefixtures("method")
@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("size", [1, 2, 3, 6, 7])
@pytest.mark.parametrize("order", range(8))
def test_every_texel_against_the_harmonics(rng, order, size, sampling):
    coefficients = rng.standard_normal(((order + 1) ** 2, 2))
    found = synthesize_cube(coefficients, size, sampling)
    assert found.shape == (2, 6 * size, size)
    expected = truth(coefficients, size, sampling)
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance(order) * 2 * (order + 1))


@pytest.mark.usefixtures("method")
@pytest.mark.parametrize(("order", "known"), [(7, 7), (4, 7), (0, 3)])
def test_factors_multiply_degrees_and_cut_the_rest_off(rng, order, known):
    coefficients, factors = (
        rng.standard_normal(((known + 1) ** 2, 2)),
        rng.standard_normal(order + 1),
    )
    degree = np.repeat(np.arange(order + 1), 2 * np.arange(order + 1) + 1)
    expected = truth(coefficients[: len(degree)] * factors[degree, None], 5, "center")
    series = CubeSeries(coefficients)
    found = series.planes(5, factors=factors)
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance(order) * 10 * (order + 1))
    again = series.planes(5)
    np.testing.assert_allclose(again, truth(coefficients, 5, "center"), atol=tolerance(known) * 80)


@pytest.mark.usefixtures("method")
@pytest.mark.parametrize("basis", range(9))
def test_each_harmonic_alone(basis):
    """No two of them can be exchanged, and none can change its sign."""
    coefficients = np.zeros((9, 1))
    coefficients[basis] = 1
    found = synthesize_cube(coefficients, 3)
    np.testing.assert_allclose(found, truth(coefficients, 3, "center"), atol=tolerance(2))


@pytest.mark.usefixtures("method")
@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize(("order", "size"), [(3, 1), (20, 16), (33, 5), (100, 11), (130, 2)])
def test_every_texel_against_ducc(rng, order, size, sampling):
    coefficients = rng.standard_normal(((order + 1) ** 2, 1))
    theta, phi = oracles.angles(oracles.cube_texels(size, sampling).reshape(-1, 3))
    expected = ducc0.sht.synthesis_general(
        alm=oracles.alm_from_real(coefficients[:, 0], order)[None],
        spin=0,
        lmax=order,
        loc=np.stack([theta, phi % (2 * np.pi)], axis=-1),
        epsilon=3e-13,
    )
    found = synthesize_cube(coefficients, size, sampling)
    np.testing.assert_allclose(
        found.ravel(), expected[0], rtol=0, atol=3e-12 * np.abs(expected).max()
    )


@pytest.mark.usefixtures("method")
@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize(("order", "size"), [(5, 7), (63, 16)])
def test_single_precision(rng, order, size, sampling):
    coefficients = rng.standard_normal(((order + 1) ** 2, 3))
    double = synthesize_cube(coefficients, size, sampling)
    single = synthesize_cube(coefficients, size, sampling, np.float32)
    assert single.dtype == np.float32
    assert double.dtype == np.float64
    np.testing.assert_allclose(single, double, rtol=0, atol=1e-5 * np.abs(double).max())


@pytest.mark.usefixtures("method")
def test_many_maps_are_the_maps_one_by_one(rng):
    """So many that the rows of a face no longer fit one block."""
    coefficients = rng.standard_normal((16, 200))
    together = synthesize_cube(coefficients, 33)
    for at in (0, 77, 199):
        alone = synthesize_cube(coefficients[:, [at]], 33)
        np.testing.assert_allclose(together[[at]], alone, rtol=0, atol=1e-13)


@pytest.mark.usefixtures("method")
@pytest.mark.parametrize("size", [6, 7])
def test_blocks_of_any_size_give_the_same_texels(rng, monkeypatch, size):
    """One row, or two maps, at a time."""
    coefficients = rng.standard_normal((25, 5))
    expected = synthesize_cube(coefficients, size)
    integrals = integrate_cube(expected, 4)
    monkeypatch.setattr(synthesis, "_CACHED_BYTES", 1)
    monkeypatch.setattr(double_fourier, "_CACHED_BYTES", 1)
    monkeypatch.setattr(synthesis, "_BLOCK_BYTES", 2 * 8 * 8 * size * 5)
    np.testing.assert_allclose(synthesize_cube(coefficients, size), expected, rtol=0, atol=1e-13)
    np.testing.assert_allclose(integrate_cube(expected, 4), integrals, rtol=0, atol=1e-11)


def test_maps_of_a_large_cube_share_their_waves(rng, monkeypatch):
    """Waves took four fifths of the time of 6 x 2048 x 2048 texels, once for each channel."""
    waves, rows = synthesis.meridian_waves, []

    def counted(count, s, t):
        rows.extend(s.tolist())
        return waves(count, s, t)

    monkeypatch.setattr(double_fourier, "MOST_VALUES", 0)
    monkeypatch.setattr(synthesis, "_known_waves", Memo(0))
    monkeypatch.setattr(synthesis, "meridian_waves", counted)
    coefficients = rng.standard_normal((36, 3))
    monkeypatch.setattr(synthesis, "_BLOCK_BYTES", 8 * 16 * 6 * 6 * 3)  # three maps, of few rows
    found = synthesize_cube(coefficients, 64)
    np.testing.assert_allclose(found, truth(coefficients, 64, "center"), rtol=0, atol=1e-12)
    assert rows == sorted(set(rows))
    assert len(rows) == 32


def test_border_texels_agree_where_faces_meet(rng):
    """A direction that several faces share has one value."""
    size = 5
    values = synthesize_cube(rng.standard_normal((81, 1)), size, "border").ravel()
    directions = np.round(oracles.cube_texels(size, "border").reshape(-1, 3), 9) + 0.0
    _, group = np.unique(directions, axis=0, return_inverse=True)
    group = group.ravel()
    count = group.max() + 1
    assert count == 98  # of 150
    highest, lowest = np.full(count, -np.inf), np.full(count, np.inf)
    np.maximum.at(highest, group, values)
    np.minimum.at(lowest, group, values)
    np.testing.assert_allclose(highest, lowest, atol=tolerance(8) * 10)
    assert np.ptp(values) > 1


def test_the_coefficients_are_left_alone(rng):
    coefficients = rng.standard_normal((16, 2))
    before = coefficients.copy()
    synthesize_cube(coefficients, 4)
    np.testing.assert_array_equal(coefficients, before)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("size", [1, 2, 3, 6, 7])
@pytest.mark.parametrize("order", [0, 1, 2, 5, 6])
def test_integrals_against_the_harmonics(rng, order, size, sampling):
    """The sum over all texels, of random images, with each harmonic."""
    planes = rng.standard_normal((2, 6 * size, size))
    directions = oracles.cube_texels(size, sampling).reshape(6 * size, size, 3)
    basis = oracles.real_harmonics(order, directions)
    np.testing.assert_allclose(
        integrate_cube(planes, order, sampling),
        np.einsum("crk,rci->ik", planes.transpose(2, 1, 0), basis),
        rtol=0,
        atol=tolerance(order) * 6 * size**2,
    )


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize(("order", "size"), [(40, 12), (100, 5)])
def test_integration_is_the_transpose_of_synthesis(rng, order, size, sampling):
    coefficients = rng.standard_normal(((order + 1) ** 2, 3))
    planes = rng.standard_normal((3, 6 * size, size))
    forward = np.sum(synthesize_cube(coefficients, size, sampling) * planes, axis=(1, 2))
    backward = np.sum(coefficients * integrate_cube(planes, order, sampling), axis=0)
    scale = np.linalg.norm(coefficients) * np.linalg.norm(planes)
    np.testing.assert_allclose(forward, backward, rtol=0, atol=1e-13 * scale)


@pytest.mark.slow
def test_integrals_of_a_band_limited_image(rng):
    """Texels times solid angles give the coefficients, up to what the midpoint rule misses."""
    coefficients = rng.standard_normal((16, 1))
    at = np.array(oracles.positions(128, "center"))
    solid_angle = (1 + at[:, None] ** 2 + at**2) ** -1.5 * (2 / 128) ** 2
    planes = truth(coefficients, 128, "center") * np.tile(solid_angle, (6, 1))
    np.testing.assert_allclose(integrate_cube(planes, 3), coefficients, atol=1e-3)
