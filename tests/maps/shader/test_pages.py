"""Where cubes lie in the layers of an array: without overlaps, and within what devices take."""

import numpy as np
import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps.shader.pages import MAX_EDGE, MAX_LAYERS, arrange, drawn
from tests.maps.shader.cases import Bilinear

STACKS = [
    [(1, 256), (1, 128), (1, 64), (1, 32), (1, 16), (1, 8)],
    [(9, 8), (25, 64), (3, 20)],
    [(1, 4), (7, 4), (1, 4), (1, 3)],
    [(1089, 6)],
    [(400, 100), (1, 100)],
    [(1, 1)],
]


@pytest.mark.parametrize("stacks", STACKS, ids=str)
def test_no_two_cubes_overlap(stacks):
    pages = arrange(stacks)
    assert pages.layers <= MAX_LAYERS
    assert max(pages.width, pages.height) <= MAX_EDGE
    taken = np.zeros((pages.layers, pages.height, pages.width), dtype=int)
    for run, (count, size) in zip(pages.runs, stacks, strict=True):
        for cube in range(count):
            layer, left, top = run.corner(cube)
            place = taken[layer, top : top + 2 * (size + 2), left : left + 3 * (size + 2)]
            assert place.shape == (2 * (size + 2), 3 * (size + 2))
            place += 1
    assert taken.max() == 1
    assert taken.any(axis=(1, 2)).all()


@pytest.mark.parametrize(
    ("stacks", "most"), [(STACKS[0], 2.0), ([(1, 256)] * 2 + [(1, 128)] * 6, 1.2)], ids=str
)
def test_levels_share_layers(stacks, most):
    """What is left free is at most as much as a chain of halving levels holds."""
    pages = arrange(stacks)
    held = sum(6 * count * (size + 2) ** 2 for count, size in stacks)
    assert pages.layers * pages.width * pages.height < most * held


@pytest.mark.parametrize("stacks", [[(257, 2000)], [(1, 4096)]], ids=str)
def test_what_does_not_fit_is_refused(stacks):
    with pytest.raises(MapError, match="do not fit into 256 layers of 8192 texels; make"):
        arrange(stacks)


@pytest.mark.parametrize("size", [1, 2, 5])
def test_faces_and_rims_lie_where_they_are_said_to_lie(rng, size):
    """The rims are those of an oracle that walks over the edges."""
    stack = rng.normal(size=(6 * size, size, 2, 3))
    found = drawn(arrange([(2, size)]), [stack])
    wide = Bilinear(stack.reshape(6 * size, size, 6)).wide.reshape(6, size + 2, size + 2, 2, 3)
    for face in range(6):
        left, top = face // 2 * (size + 2), face % 2 * (size + 2)
        there = found[:, top : top + size + 2, left : left + size + 2]
        np.testing.assert_allclose(there, np.moveaxis(wide[face], 2, 0), rtol=1e-6)
