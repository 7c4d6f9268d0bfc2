"""Mirror balls, photographed ray by ray, and what is unwrapped of them."""

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError, ProbeError
from shrm_cli.photo.ball import ball_points, unwrap_balls
from shrm_cli.sphere.grid.latlong import latlong_directions
from tests.cli.helpers import write_exr
from tests.photo.camera import direction, photograph

ROWS = 48


def waves(directions):
    """Smooth light that is different everywhere, and in every channel."""
    x, y, z = directions.T
    return np.stack([1.5 + np.sin(3 * x + y), 1.5 + np.cos(2 * y - z), 1.5 + x * z], axis=1)


def with_photographer(view, width=0.2):
    """The same light, with a black blob where the camera stands."""

    def radiance(directions):
        return waves(directions) * (directions @ view < np.cos(width))[:, None]

    return radiance


def written(folder, cameras, distance=np.inf, size=160, of=with_photographer):
    paths = []
    for number, camera in enumerate(cameras):
        view = direction(*camera)
        paths.append(folder / f"{number}.exr")
        write_exr(paths[-1], photograph(of(view), view, size, distance))
    return paths


@pytest.mark.parametrize("distance", [np.inf, 2.5, 9.0])
@pytest.mark.parametrize("camera", [(0.0, 0.0), (37.0, -24.0), (-140.0, 70.0)])
def test_directions_are_where_rays_find_them(distance, camera, rng):
    """A ray from the camera to the place in the picture is reflected into the direction."""
    wanted = rng.normal(size=(50, 3))
    wanted /= np.linalg.norm(wanted, axis=1)[:, None]
    view = direction(*camera)
    wanted = wanted[wanted @ view > -0.9]
    x, y = ball_points(wanted, view, distance).T[..., None]
    right = np.cross([0.0, 1.0, 0.0], view)
    right /= np.linalg.norm(right)
    flat = x * right + y * np.cross(view, right)
    if np.isinf(distance):
        point, ray = flat + np.sqrt(1 - x**2 - y**2) * view, -view
    else:
        ray = flat / np.sqrt(distance**2 - 1) - view
        ray /= np.linalg.norm(ray, axis=1)[:, None]
        along = distance * (ray @ view)
        reach = -along - np.sqrt(along**2 - distance**2 + 1)
        point = distance * view + reach[:, None] * ray
    found = ray - 2 * np.sum(ray * point, axis=1)[:, None] * point
    np.testing.assert_allclose(found, wanted, atol=2e-6)


@pytest.mark.parametrize("distance", [np.inf, 6.0])
def test_two_photographs_show_everything_and_no_camera(tmp_path, distance):
    cameras = (20.0, 10.0), (110.0, 10.0)
    paths = written(tmp_path, cameras, distance)
    truth = waves(latlong_directions(2 * ROWS, ROWS).reshape(-1, 3)).reshape(ROWS, 2 * ROWS, 3)
    both = unwrap_balls(paths, cameras, distance=distance, size=ROWS)
    error = np.abs(both.pixels / truth - 1)
    assert np.median(error) < 2e-3
    assert error.max() < 0.05
    np.testing.assert_allclose(both.gains, 1, atol=2e-3)
    assert both.differences[0] == 0 < both.differences[1] < 2e-3
    # One shows the camera, and little of what is behind the ball.
    alone = unwrap_balls(paths[:1], cameras[:1], distance=distance, size=ROWS)
    toward = latlong_directions(2 * ROWS, ROWS) @ direction(*cameras[0])
    assert (alone.pixels[toward > np.cos(0.1)] == 0).all()
    assert np.abs(alone.pixels / truth - 1)[np.abs(toward) < 0.8].max() < 0.02
    # It was photographed from afar if nothing else is said, which is another picture.
    if distance < 10:
        wrong = unwrap_balls(paths, cameras, size=ROWS)
        assert np.abs(wrong.pixels / truth - 1).max() > 0.1


def test_small_lamps_keep_their_light(tmp_path):
    """They are as large as a pixel of the probe, between whose middles parts of them would hide."""
    errors, cap = [], np.radians(2)
    for axis in (direction(*at) for at in ((75, -40), (110, 10), (100, -20))):

        def lamp(directions, axis=axis):
            return np.repeat(directions @ axis > np.cos(cap), 3).reshape(-1, 3)

        path = tmp_path / "lamp.exr"
        write_exr(path, photograph(lamp, direction(0), 160, fine=8))
        made = unwrap_balls([path]).pixels[..., 0]
        rows = np.cos(np.pi * np.arange(len(made) + 1) / len(made))
        flux = (rows[:-1] - rows[1:]) @ made.sum(axis=1) * np.pi / len(made)
        errors.append(flux / (2 * np.pi * (1 - np.cos(cap))) - 1)
    assert np.linalg.norm(errors) < 0.03


def test_photographs_agree_with_the_first(tmp_path):
    """The second was exposed differently, and its white balance, too."""
    cameras = (0.0, 0.0), (90.0, 0.0)
    paths = written(tmp_path, cameras, of=lambda view: waves)
    gain = np.array([2.0, 0.5, 1.25])
    second = photograph(lambda each: waves(each) * gain, direction(90), 160)
    write_exr(paths[1], second)
    made = unwrap_balls(paths, cameras, size=ROWS)
    np.testing.assert_allclose(made.gains[1], 1 / gain, rtol=1e-3)
    truth = waves(latlong_directions(2 * ROWS, ROWS).reshape(-1, 3)).reshape(ROWS, 2 * ROWS, 3)
    assert np.abs(made.pixels / truth - 1).max() < 0.03
    # Where the second was turned otherwise, they differ, and say so.
    assert unwrap_balls(paths, ((0, 0), (60, 0)), size=ROWS).differences[1] > 0.03


def test_cameras_stand_a_quarter_turn_apart_where_nothing_is_said(tmp_path):
    paths = written(tmp_path, ((0.0, 0.0), (90.0, 0.0)))
    found, said = unwrap_balls(paths, size=ROWS), unwrap_balls(paths, ((0, 0), (90, 0)), size=ROWS)
    assert found.cameras == ((0, 0), (90, 0))
    np.testing.assert_array_equal(found.pixels, said.pixels)
    assert unwrap_balls(paths[:1], size=ROWS).cameras == ((0, 0),)


def test_a_ball_may_be_a_part_of_the_picture(tmp_path):
    (path,) = written(tmp_path, [(0, 0)], of=lambda view: waves)
    alone = unwrap_balls([path], size=ROWS)
    picture = np.full((220, 300, 3), 9.0, np.float32)
    ball = photograph(waves, direction(0), 160)
    covered = ball.any(axis=-1)
    picture[30:190, 75:235][covered] = ball[covered]
    write_exr(tmp_path / "wide.exr", picture)
    found = unwrap_balls([tmp_path / "wide.exr"], circles=[(155, 110, 80)], size=ROWS)
    toward = latlong_directions(2 * ROWS, ROWS) @ direction(0)
    np.testing.assert_allclose(found.pixels[toward > -0.9], alone.pixels[toward > -0.9], rtol=1e-5)
    # What is beside the ball does not shine over its rim.
    assert found.pixels.max() < 3
    dim = unwrap_balls([path], size=ROWS, reflectance=0.5)
    np.testing.assert_allclose(dim.pixels, 2 * alone.pixels, rtol=1e-6)


def test_pixels_are_as_fine_as_those_of_the_ball(tmp_path):
    (path,) = written(tmp_path, [(0, 0)], size=64)
    assert unwrap_balls([path]).pixels.shape == (50, 100, 3)


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"cameras": ()}, ArgumentError, "`camera` must be given once for each"),
        ({"circles": [(8, 8, 8)] * 2}, ArgumentError, "`circle` must be given once"),
        ({"distance": 1.5}, ArgumentError, "`distance` must be above 2 radii of the ball"),
        ({"reflectance": 0.0}, ArgumentError, "`reflectance` must be above 0"),
        ({"distance": np.nan}, ArgumentError, "`distance` must be above 2"),
        ({"circles": [(8, 8, 40)]}, ProbeError, "is not within its 24 x 16 pixels"),
        ({"circles": [(-80, 8, 4)]}, ProbeError, "is not within its 24 x 16 pixels"),
        ({}, ProbeError, "24 x 16 pixels, which a ball does not fill; crop it to the ball"),
    ],
)
def test_what_fits_no_ball_is_refused(tmp_path, options, error, words):
    path = tmp_path / "ball.exr"
    write_exr(path, np.ones((16, 24, 3), np.float32))
    with pytest.raises(error, match=words):
        unwrap_balls([path], **options)
