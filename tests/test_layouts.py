"""The names of layouts, and the pictures that their faces are read from."""

import subprocess
import sys
from pathlib import Path

import pytest

from shrm_cli.sphere.grid.base import grid_class
from shrm_cli.vocabulary import (
    CUBES,
    FACES,
    GRIDS,
    IMAGE_LAYOUTS,
    LAYOUTS,
    CubeArrangement,
    default_orientation,
    grid_name,
)

# Where +X, -X, +Y, -Y, +Z and -Z lie: column and row, in faces.
PLACES = {
    "openexr": [(0, 0), (0, 1), (0, 2), (0, 3), (0, 4), (0, 5)],
    "strip": [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0)],
    "hcross": [(2, 1), (0, 1), (1, 0), (1, 2), (1, 1), (3, 1)],
    "vcross": [(2, 1), (0, 1), (1, 0), (1, 2), (1, 1), (1, 3)],
    "faces": [(0, 0), (0, 1), (0, 2), (0, 3), (0, 4), (0, 5)],
}
SHAPES = {"openexr": (1, 6), "strip": (6, 1), "hcross": (4, 3), "vcross": (3, 4), "faces": (1, 6)}


def test_names_in_the_order_of_the_help():
    assert IMAGE_LAYOUTS == ("latlong", "openexr", "strip", "hcross", "vcross", "angular")
    assert (*IMAGE_LAYOUTS, "faces") == LAYOUTS


def test_every_arrangement():
    assert list(CUBES) == list(PLACES)
    for name, cube in CUBES.items():
        assert [place[:2] for place in cube.places] == PLACES[name]
        turned = [face for face, place in zip(FACES, cube.places, strict=True) if place[2]]
        assert turned == (["-Z"] if name == "vcross" else [])
        assert (cube.columns, cube.rows) == SHAPES[name]
        assert cube.in_six_files == (name == "faces")
        assert cube.is_cross == name.endswith("cross")
        assert len(cube.unused()) == cube.columns * cube.rows - 6
        assert not set(cube.unused()) & set(PLACES[name])


@pytest.mark.parametrize(
    ("name", "size", "expected"),
    [
        ("hcross", (32, 24), 8),
        ("hcross", (32, 25), None),
        ("hcross", (33, 24), None),
        ("openexr", (1, 6), 1),
        ("strip", (0, 0), None),
        ("faces", (4, 24), 4),
    ],
)
def test_size_of_the_faces(name, size, expected):
    assert CUBES[name].face_size(*size) == expected


@pytest.mark.parametrize(
    "lines",
    [
        ["+X -X +Y -Y +Z"],
        ["+X -X +Y -Y +Z +Z"],
        ["+X -X +Y -Y", "+Z -Z"],
        ["+X -X +Y -Y +Z -Z +W"],
    ],
)
def test_pictures_that_are_no_cube_are_refused(lines):
    with pytest.raises(ValueError, match="each face of a cube"):
        CubeArrangement.drawn(*lines)


def test_orientation_by_default():
    """As the conventions have it: OpenEXR's for its stacked cube, that of graphics for others."""
    assert default_orientation("openexr") == "openexr"
    for name in ("strip", "hcross", "vcross", "faces"):
        assert default_orientation(name) == "gl"
    for name in ("latlong", "angular"):
        assert default_orientation(name) == "openexr"


def test_every_layout_has_a_grid():
    assert {name: grid_class(name).name for name in GRIDS} == {name: name for name in GRIDS}
    assert {grid_name(layout) for layout in LAYOUTS} == set(GRIDS)
    assert grid_name("vcross") == grid_name("faces") == "cube"


def test_names_are_had_without_numpy():
    program = "import sys, shrm_cli.vocabulary; print('numpy' in sys.modules)"
    root = Path(__file__).resolve().parents[1]
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=root
    )
    assert result.stdout == "False\n"
