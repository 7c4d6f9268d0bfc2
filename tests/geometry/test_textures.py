"""Look-ups of textures, against SciPy's and against means over many points."""

import numpy as np
import OpenImageIO as oiio
import pytest
from scipy.ndimage import map_coordinates

from shrm_cli.errors import MeshError
from shrm_cli.files.texture import mean_color, read_texture
from shrm_cli.geometry import textures
from shrm_cli.geometry.mesh import Texture
from shrm_cli.geometry.textures import MipMap, Shelf, pyramid_of

SCIPY = {"repeat": "grid-wrap", "clamp": "nearest", "mirror": "reflect"}
"""What SciPy calls them, for pixels that lie at centres."""


def still(uvs):
    """Steps of pixels that cover nothing."""
    return np.zeros((len(uvs), 2, 2))


def image(rng, height=12, width=20):
    return rng.random((height, width, 4)).astype(np.float16).astype(float)


@pytest.mark.parametrize("side", SCIPY)
def test_pixels_that_are_large_are_interpolated(rng, side):
    pixels = image(rng)
    uvs = rng.uniform(-2.3, 2.3, (300, 2))
    found = MipMap(pyramid_of(pixels), Texture("", wrap=(side, side))).at(uvs, still(uvs))
    places = (1 - uvs[:, 1]) * 12 - 0.5, uvs[:, 0] * 20 - 0.5
    for channel in range(4):
        expected = map_coordinates(pixels[..., channel], places, order=1, mode=SCIPY[side])
        np.testing.assert_allclose(found[:, channel], expected, atol=1e-9)


def test_the_two_directions_wrap_each_in_its_own_way(rng):
    pixels = image(rng, 4, 4)
    made = MipMap(pyramid_of(pixels), Texture("", wrap=("clamp", "mirror"), is_nearest=True))
    # Beyond the right edge, and one and a half heights below the top, mirrored there.
    found = made.at(np.array([[1.7, -0.3 + 1e-9]]), np.zeros((1, 2, 2)))
    np.testing.assert_allclose(found[0], pixels[2, 3])


def test_levels_are_means_of_what_lies_within(rng):
    """Of 7 x 5 pixels 3 x 2: each is repeated, so that all edges lie between pixels."""
    pixels = image(rng, 7, 5)
    fine = pixels.repeat(3, axis=0).repeat(2, axis=1)
    expected = fine.reshape(3, 7, 2, 5, 4).mean(axis=(1, 3))
    pyramid = pyramid_of(pixels)
    levels = [pyramid.level(k) for k in range(3)]
    assert pyramid.sizes.tolist() == [[5, 7], [2, 3], [1, 1]]
    np.testing.assert_allclose(levels[1].astype(float), expected, atol=1e-3)
    np.testing.assert_allclose(levels[2][0, 0].astype(float), pixels.mean(axis=(0, 1)), atol=2e-3)


@pytest.mark.parametrize("stretch", [(9.0, 9.0), (30.0, 5.0), (12.0, 1.5), (0.7, 0.3)])
def test_pixels_show_the_mean_of_what_they_cover(rng, stretch):
    """Parallelograms of many texels at a generic angle, of noise as wide as a few texels."""
    coarse = rng.random((32, 32, 4))
    pixels = sum(np.roll(coarse.repeat(4, 0).repeat(4, 1), (k, k), (0, 1)) for k in range(4)) / 4
    made = MipMap(pyramid_of(pixels), Texture("", wrap=("repeat", "mirror")))
    c, s = np.cos(0.6), np.sin(0.6)
    steps = np.array([[c, -s], [s, c]]) @ np.diag(stretch) @ np.array([[1, 0.4], [0, 1]]) / 128
    uvs = rng.random((150, 2))
    found = made.at(uvs, np.broadcast_to(steps, (150, 2, 2)))
    around = np.stack(np.meshgrid(*[(np.arange(40) + 0.5) / 40 - 0.5] * 2), -1).reshape(-1, 2)
    many = (uvs[:, None] + around @ steps.T).reshape(-1, 2)
    expected = made.at(many, still(many)).reshape(150, -1, 4).mean(axis=1)
    error = np.sqrt(np.mean((found - expected) ** 2))
    unfiltered = np.sqrt(np.mean((made.at(uvs, still(uvs)) - expected) ** 2))
    print(f"{stretch}: {error:.4f} of {expected.std():.4f}, unfiltered {unfiltered:.4f}")
    assert error < max(0.2 * unfiltered, 0.01)


@pytest.mark.parametrize("stretch", [(16.0, 1.0), (0.7, 0.7)])
def test_pixels_of_stripes_show_the_mean_of_what_they_cover(rng, stretch):
    """Pixels that are 16 texels long and one wide, along the stripes, and smaller than texels."""
    pixels = np.zeros((64, 64, 4))
    pixels[::4] = pixels[1::4] = 1
    made = MipMap(pyramid_of(pixels), Texture(""))
    uvs, steps = rng.random((300, 2)), np.diag(stretch) / 64
    found = made.at(uvs, np.broadcast_to(steps, (300, 2, 2)))
    across = (np.arange(40) + 0.5) / 40 - 0.5
    many = np.repeat(uvs[:, None], 40, axis=1)
    many[..., 1] += across * steps[1, 1]
    many = many.reshape(-1, 2)
    expected = made.at(many, still(many)).reshape(300, 40, 4).mean(axis=1)
    unfiltered = np.sqrt(np.mean((made.at(uvs, still(uvs)) - expected) ** 2))
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.3 * unfiltered


def test_a_texture_that_covers_a_pixel_again_and_again_is_its_mean(rng):
    pixels = image(rng)
    found = MipMap(pyramid_of(pixels), Texture("")).at(
        rng.random((5, 2)), np.broadcast_to([[50.0, 3], [0, 40]], (5, 2, 2))
    )
    np.testing.assert_allclose(found, np.broadcast_to(pixels.mean(axis=(0, 1)), (5, 4)), atol=2e-3)


def test_coordinates_repeat_as_far_as_single_precision_has_fractions(rng):
    made = MipMap(pyramid_of(image(rng)), Texture("", wrap=("repeat", "repeat")))
    far = np.array([[2.0**23 + 0.5, 2.0**23 + 0.5]])
    np.testing.assert_allclose(made.at(far, still(far)), made.at(far % 1, still(far)), atol=1e-6)


def test_endless_coordinates_have_some_pixel(rng):
    made = MipMap(pyramid_of(image(rng)), Texture("", wrap=("clamp", "repeat")))
    steps = np.broadcast_to([[np.inf, 0], [0, np.nan]], (2, 2, 2))
    found = made.at(np.array([[1e300, -1e300], [np.nan, 1e9]]), steps)
    assert np.isfinite(found).all()


@pytest.mark.parametrize("turn", [0.4, -1.1])
def test_axes_of_turned_textures(turn):
    """Where the texture is turned and mirrored, its own axes are found by small steps."""
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[-2 * c, s * 3, 0.1], [-2 * -s, c * 3, 0.2]])
    made = MipMap(pyramid_of(np.zeros((2, 2, 4))), Texture("", matrix=tuple(matrix.ravel())))
    place = lambda u, v: matrix @ [u, 1 - v, 1]  # noqa: E731
    here = place(0.3, 0.4)
    for axis, wanted in ((0, [1, 0]), (1, [0, -1])):  # to the right, and upwards
        u, v = 0.01 * made.axes[:, axis]
        step = place(0.3 + u, 0.4 + v) - here
        np.testing.assert_allclose(step / np.linalg.norm(step), wanted, atol=1e-9)


def test_textures_that_are_missing_or_damaged_say_so(tmp_path):
    with pytest.raises(MeshError, match=r"a\.glb: the texture is missing"):
        Shelf().open("a.glb", Texture("the texture is missing"))
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(20))
    with pytest.raises(MeshError, match=r"a\.glb: a\.png"):
        Shelf().open("a.glb", Texture(tmp_path / "a.png"))
    with pytest.raises(MeshError, match="neither PNG"):
        Shelf().open("a.glb", Texture(b"GIF89a"))


@pytest.mark.parametrize(("name", "kind"), [("a.png", "uint8"), ("a.png", "uint16"),
                                            ("a.exr", "half"), ("a.hdr", "float")])  # fmt: skip
def test_integers_are_srgb_and_floats_linear(tmp_path, name, kind):
    """Half of what an integer holds is a fifth of white, and half of a float is half."""
    path = tmp_path / name
    picture = oiio.ImageBuf(np.full((2, 2, 3), 0.5, np.float32))
    assert picture.write(str(path), kind)
    expected = 0.5 if kind in ("half", "float") else 0.2140
    np.testing.assert_allclose(read_texture(path, True)[..., :3], expected, rtol=0.01)
    np.testing.assert_allclose(mean_color(path, True)[:3], expected, rtol=0.01)
    np.testing.assert_allclose(read_texture(path, False)[..., :3], 0.5, rtol=0.01)


def test_each_picture_is_read_once_and_counted_once(tmp_path, monkeypatch):
    monkeypatch.setattr(textures, "MOST_PIXELS", 30)
    monkeypatch.setattr(textures, "read_texture", lambda picture, is_srgb: read.append(picture) or
                        np.ones((3, 4, 4)))  # fmt: skip
    read, shelf = [], Shelf()
    for uv_set in (0, 1, 0):
        shelf.open("a.glb", Texture(b"first", uv_set=uv_set))
    shelf.open("a.glb", Texture(b"second"))
    assert read == [b"first", b"second"]
    with pytest.raises(MeshError, match="more than 30 pixels"):
        shelf.open("a.glb", Texture(b"third"))
