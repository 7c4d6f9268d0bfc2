"""Layouts: which one an image has, and its faces in place."""

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe import image as layout
from shrm_cli.sphere.grid.angular import Angular
from shrm_cli.sphere.grid.cube import Cube
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.vocabulary import LAYOUTS
from tests.probe import scenes

SIZES = {
    "latlong": (64, 32),
    "openexr": (32, 192),
    "strip": (192, 32),
    "hcross": (128, 96),
    "vcross": (96, 128),
}
IMAGES = {"faces": 6}


@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize("scale", [1, 7])
def test_layout_from_the_aspect_ratio(name, scale):
    width, height = (side * scale for side in SIZES[name])
    assert layout.detect_layout("a.exr", width, height, "") == name


@pytest.mark.parametrize(
    ("width", "height", "envmap", "expected"),
    [
        (64, 32, "latlong", "latlong"),
        (32, 192, "cube", "openexr"),
        # The attribute says more than the shape; what does not fit is refused later.
        (192, 32, "latlong", "latlong"),
        (64, 32, "cube", "openexr"),
        (32, 32, "cube", "openexr"),
    ],
)
def test_layout_from_the_attribute(width, height, envmap, expected):
    assert layout.detect_layout("a.exr", width, height, envmap) == expected


@pytest.mark.parametrize(
    ("width", "height", "message"),
    [
        (64, 64, r"a\.exr: a square image .* `layout` angular .* with % in place of \+X"),
        (96, 64, r"a\.exr: 96 x 64 is no known layout .* `layout`"),
        (65, 32, "65 x 32 is no known layout"),
        (32, 191, "32 x 191 is no known layout"),
        (1, 1, "square"),
    ],
)
def test_shapes_that_do_not_tell_are_refused(width, height, message):
    with pytest.raises(ProbeError, match=message):
        layout.detect_layout("a.exr", width, height, "")


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_layout_has_a_shape_that_fits_and_no_pixel_more(name):
    width, height = SIZES.get(name, (32, 32))
    layout.check_shape("a.exr", name, width, height, IMAGES.get(name, 1))
    for wrong in [(width + 1, height), (width, height + 1), (height * 2, width)]:
        with pytest.raises(ProbeError, match=f"{wrong[0]} x {wrong[1]} cannot be {name}"):
            layout.check_shape("a.exr", name, *wrong, IMAGES.get(name, 1))


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize(("width", "height"), [(96, 64), (64, 33), (31, 192), (193, 32), (0, 0)])
def test_layouts_that_do_not_fit_are_refused(name, width, height):
    with pytest.raises(ProbeError, match=f"a.exr: {width} x {height} .*{name}.*; "):
        layout.check_shape("a.exr", name, width, height, IMAGES.get(name, 1))


@pytest.mark.parametrize(
    ("name", "width", "height"),
    [("angular", 2, 2), ("latlong", 2, 1)],
)
def test_images_that_are_too_small_are_refused(name, width, height):
    with pytest.raises(ProbeError, match="too small"):
        layout.check_shape("a.exr", name, width, height)


@pytest.mark.parametrize(
    ("name", "width", "height"), [("openexr", 1, 6), ("faces", 1, 1), ("strip", 6, 1)]
)
def test_faces_may_be_single_texels_but_not_none(name, width, height):
    images = IMAGES.get(name, 1)
    layout.check_shape("a.exr", name, width, height, images)
    assert layout.grid_of(name, width, "center", images) == Cube(1, "center")
    with pytest.raises(ProbeError, match="0 x 0 is too small"):
        layout.check_shape("a.exr", name, 0, 0, images)


def test_cubes_whose_faces_would_not_be_whole_are_refused():
    """4 : 3, but not by whole texels."""
    with pytest.raises(ProbeError, match="square faces"):
        layout.check_shape("a.exr", "hcross", 6, 4)


def test_six_faces_in_one_image_are_stacked():
    layout.check_shape("a.exr", "faces", 4, 24)
    with pytest.raises(ProbeError, match="4 x 4 cannot be faces, which is 1 x 6 square faces"):
        layout.check_shape("a.exr", "faces", 4, 4)


@pytest.mark.parametrize(
    ("name", "width", "images", "expected"),
    [
        ("latlong", 64, 1, LatLong(32, "border")),
        ("strip", 48, 1, Cube(8, "border")),
        ("vcross", 24, 1, Cube(8, "border")),
        ("faces", 8, 6, Cube(8, "border")),
        ("angular", 9, 1, Angular(9, "border")),
    ],
)
def test_the_grid_of_a_layout(name, width, images, expected):
    assert layout.grid_of(name, width, "border", images) == expected
    assert layout.grid_of(name, width, "center", images) != expected


@pytest.mark.parametrize("orientation", ["openexr", "gl"])
@pytest.mark.parametrize("name", ["openexr", "strip", "hcross", "vcross", "faces"])
def test_faces_are_stacked_texel_by_texel(name, orientation):
    """An image of the directions themselves: afterwards each texel holds its own."""
    faces = scenes.cube_faces(5, "center", orientation, lambda directions: directions)
    image = scenes.arrange(faces, "openexr" if name == "faces" else name)
    expected = scenes.cube_faces(5, "center", "openexr", lambda directions: directions)
    found = layout.stack_faces(image, name, orientation)
    np.testing.assert_array_equal(found, expected.reshape(30, 5, 3))


@pytest.mark.parametrize("name", ["hcross", "vcross"])
def test_crosses_have_no_seam_where_cells_meet(name):
    """The cross of the package's table is the cube laid flat: its faces come from there."""
    image = scenes.unfolded(name, 6, "center", lambda directions: directions)
    expected = scenes.cube_faces(6, "center", "openexr", lambda directions: directions)
    np.testing.assert_allclose(
        layout.stack_faces(image, name, "gl"), expected.reshape(36, 6, 3), atol=1e-7
    )


@pytest.mark.parametrize("name", ["hcross", "vcross"])
def test_unused_cells_are_cleared_and_no_others(name):
    faces = scenes.cube_faces(4, f=lambda directions: 2 + directions)
    image = scenes.arrange(faces, name)
    unused = image == 0
    assert np.count_nonzero(unused) == 6 * 4 * 4 * 3
    littered = np.where(unused, np.float32(np.nan), image)
    layout.clear_unused(littered, name)
    np.testing.assert_array_equal(littered, image)


@pytest.mark.parametrize("name", ["latlong", "openexr", "strip", "faces", "angular"])
def test_other_layouts_use_every_cell(name):
    image = np.ones((24, 24, 3))
    layout.clear_unused(image, name)
    assert image.min() == 1


@pytest.mark.parametrize("orientation", ["openexr", "gl"])
@pytest.mark.parametrize("name", ["openexr", "strip", "hcross", "vcross", "faces"])
def test_arranging_undoes_stacking(name, orientation, rng):
    stack = rng.uniform(size=(30, 5, 3)).astype(np.float32)
    image = layout.arrange_faces(stack, name, orientation)
    assert image.dtype == stack.dtype
    np.testing.assert_array_equal(layout.stack_faces(image, name, orientation), stack)
    again = layout.arrange_faces(layout.stack_faces(image, name, orientation), name, orientation)
    np.testing.assert_array_equal(again, image)


@pytest.mark.parametrize("orientation", ["openexr", "gl"])
@pytest.mark.parametrize("name", ["openexr", "strip", "hcross", "vcross", "faces"])
def test_faces_are_arranged_texel_by_texel(name, orientation):
    stack = scenes.cube_faces(5, "center", "openexr", lambda directions: 2 + directions)
    faces = scenes.cube_faces(5, "center", orientation, lambda directions: 2 + directions)
    found = layout.arrange_faces(stack.reshape(30, 5, 3), name, orientation)
    np.testing.assert_array_equal(
        found, scenes.arrange(faces, "openexr" if name == "faces" else name)
    )
