"""What every grid promises, asked of each of them, and of one that is made for the purpose."""

import numpy as np
import pytest

from shrm_cli.sphere.grid.angular import Angular
from shrm_cli.sphere.grid.base import WholeImageAnalysis
from shrm_cli.sphere.grid.cube import Cube
from shrm_cli.sphere.grid.latlong import LatLong
from tests import oracles
from tests.sphere.grid.octahedral import Octahedral

KINDS = [LatLong, Cube, Angular, Octahedral]
SAMPLINGS = ["center", "border"]
SIZES = {LatLong: 24, Cube: 12, Angular: 48, Octahedral: 24}
GRIDS = [kind(SIZES[kind], sampling) for kind in KINDS for sampling in SAMPLINGS]


def name(grid):
    return f"{grid.name}-{grid.sampling}"


def pixels_of(grid):
    """Rows and columns of the pixels that hold radiance."""
    used = grid.used()
    return np.nonzero(np.ones(grid.shape, bool) if used is None else used)


@pytest.mark.parametrize(
    ("grid", "shape", "rows"),
    [
        (LatLong(24), (24, 48), 24),
        (Cube(12), (72, 12), 24),
        (Angular(48), (48, 48), 24),
        (Angular(49), (49, 49), 24),
        (Octahedral(24), (24, 24), 24),
    ],
)
def test_shapes_and_resolutions(grid, shape, rows):
    assert grid.shape == shape
    assert grid.directions().shape == (*shape, 3)
    assert grid.latlong_rows == rows
    assert grid.resolution == pytest.approx(rows, abs=0.5)


@pytest.mark.parametrize(
    ("grid", "order"),
    [
        (LatLong(24), 23),
        (LatLong(24, "border"), 22),
        (LatLong(2, "border"), 0),
        (Cube(12), 23),
        (Cube(12, "border"), 21),
        (Cube(1, "border"), 1),
        (Angular(48), 23),
        (Angular(49, "border"), 23),
        (Angular(3), 0),
    ],
)
def test_the_order_that_pixels_resolve(grid, order):
    """Half a turn has one pixel more than the order; border pixels share their ends."""
    assert grid.resolved_order == order


@pytest.mark.parametrize("grid", GRIDS, ids=name)
def test_weights_sum_to_the_sphere_and_can_be_cut(grid):
    weights = grid.weights()
    whole = np.broadcast_to(weights, grid.shape)
    assert whole.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    assert whole.min() >= 0
    np.testing.assert_array_equal(grid.weights(3, 7), weights[3:7])
    if (used := grid.used()) is not None:
        np.testing.assert_array_equal(whole > 0, used)


@pytest.mark.parametrize("grid", GRIDS, ids=name)
def test_weights_are_the_solid_angles_of_cells(grid):
    """But for the pixels that a rim cuts, and the rules of lat-longs near the poles."""
    rows, columns = pixels_of(grid)
    cells = grid.solid_angles(rows, columns)
    weights = np.broadcast_to(grid.weights(), grid.shape)[rows, columns]
    assert np.abs(cells - weights).sum() < 0.05 * 4 * np.pi
    assert np.median(np.abs(cells / weights - 1)) < 0.01


@pytest.mark.parametrize("grid", GRIDS, ids=name)
def test_points_at_the_samples_are_the_directions(grid):
    rows, columns = pixels_of(grid)
    down, across = grid.parts(1)
    points, density = grid.points(rows, down[rows, 0], across[columns, 0])
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    np.testing.assert_allclose(points, grid.directions()[rows, columns], atol=1e-12)
    assert density.min() >= 0


@pytest.mark.parametrize("grid", GRIDS, ids=name)
def test_the_density_is_the_solid_angle_of_small_areas(grid):
    """Against the area of a small parallelogram on the sphere, away from creases."""
    rows, columns = (k[::37] for k in pixels_of(grid))
    (down, across), (heights, widths) = grid.parts(4), grid.extents()
    d, a = down[rows, 1], across[columns, 1]
    step = 1e-5

    def unit(shift_down, shift_across):
        points, _ = grid.points(rows, d + shift_down * step, a + shift_across * step)
        return points / np.linalg.norm(points, axis=-1, keepdims=True)

    _, density = grid.points(rows, d, a)
    area = np.linalg.norm(np.cross(unit(1, 0) - unit(-1, 0), unit(0, 1) - unit(0, -1)), axis=-1)
    inside = density > 0
    np.testing.assert_allclose((area / (4 * step**2))[inside], density[inside], rtol=1e-4)
    assert inside.sum() > 5
    assert heights.sum() == pytest.approx(2 * grid.faces)
    assert widths.sum() == pytest.approx(2)


@pytest.mark.parametrize("grid", GRIDS, ids=name)
def test_pixels_of_their_own_directions(grid):
    """Every pixel finds itself, unless others share its direction or a rim cuts it."""
    rows, columns = pixels_of(grid)
    directions = grid.directions()[rows, columns]
    found = grid.pixels(5 * directions)
    back = grid.directions()[found]
    if grid.name == "angular":
        near = np.hypot(*(2 * np.stack([rows, columns]) / (grid.size - 1) - 1)) < 0.95
        directions, back = directions[near], back[near]
    np.testing.assert_allclose(back, directions, atol=1e-9)


@pytest.mark.parametrize("grid", GRIDS, ids=name)
def test_the_sampler_finds_the_pixels(grid, rng):
    image = rng.random((*grid.shape, 2))
    if grid.sampling == "border":
        image = grid.directions()[..., :2].copy()  # equal where directions are
    rows, columns = pixels_of(grid)
    found = grid.sampler(image)(grid.directions()[rows, columns])
    if grid.name == "angular":
        near = np.hypot(*(2 * np.stack([rows, columns]) / (grid.size - 1) - 1)) < 0.9
        rows, columns, found = rows[near], columns[near], found[near]
    np.testing.assert_allclose(found, image[rows, columns], atol=1e-6)


@pytest.mark.parametrize("grid", GRIDS, ids=name)
def test_the_analysis_of_a_smooth_image(grid, rng):
    order = 3
    expected = rng.standard_normal(((order + 1) ** 2, 2))
    image = oracles.real_harmonics(order, grid.directions()) @ expected
    analysis = grid.analysis(order)
    analysis.add(0, image.astype(np.float32), grid.weights())
    np.testing.assert_allclose(analysis.coefficients(), expected, atol=0.03)


@pytest.mark.parametrize("grid", GRIDS, ids=name)
def test_an_image_that_is_not_turned_is_the_same(grid, rng):
    image = rng.random((*grid.shape, 3)).astype(np.float32)
    np.testing.assert_array_equal(grid.turned(image, np.eye(3)), image)
    assert grid.turned(image, oracles.turn("x", 0.3)) is None


@pytest.mark.parametrize("grid", GRIDS, ids=name)
def test_only_latlongs_are_reduced_exactly(grid, rng):
    image = rng.random((*grid.shape, 3))
    for kind in KINDS:
        found = grid.reduced(image, kind(5), np.eye(3))
        assert (found is not None) == (grid.name == kind.name == "latlong")
    assert grid.reduced(image, LatLong(5), oracles.turn("x", 0.3)) is None


@pytest.mark.parametrize("grid", [LatLong(9, "border"), Cube(5, "border")], ids=name)
def test_borders_are_shared(grid, rng):
    image = rng.random((*grid.shape, 3))
    before = image.copy()
    grid.share_borders(image)
    directions = grid.directions().reshape(-1, 3)
    same = np.linalg.norm(directions[:, None] - directions, axis=-1) < 1e-6
    flat = image.reshape(-1, 3)
    assert (same.sum(axis=1) > 1).sum() > 8
    for k in range(len(flat)):
        np.testing.assert_allclose(flat[same[k]], np.tile(flat[k], (same[k].sum(), 1)))
    alone = same.sum(axis=1) == 1
    np.testing.assert_array_equal(flat[alone], before.reshape(-1, 3)[alone])
    assert flat.mean() == pytest.approx(before.mean(), abs=0.1)


def test_grids_are_equal_where_all_is():
    assert LatLong(8) == LatLong(8, "center")
    assert LatLong(8) != LatLong(8, "border")
    assert LatLong(8) != LatLong(9)
    assert Angular(8) != Octahedral(8)


def test_what_is_analyzed_as_a_whole_comes_as_a_whole():
    analysis = WholeImageAnalysis(lambda image: image.sum(axis=(0, 1))[None])
    with pytest.raises(ValueError, match="no rows"):
        analysis.coefficients()
    with pytest.raises(ValueError, match="as a whole"):
        analysis.add(2, np.ones((2, 4, 3)), np.ones((2, 4)))
    analysis.add(0, np.ones((2, 4, 3)), np.full((2, 4), 0.5))
    np.testing.assert_array_equal(analysis.coefficients(), [[4, 4, 4]])
    with pytest.raises(ValueError, match="as a whole"):
        analysis.add(0, np.ones((2, 4, 3)), np.ones((2, 4)))
