"""Contact sheets: where tiles and labels are, and how labels are cut to size."""

import numpy as np
import pytest

from shrm_cli.errors import OutputError
from shrm_cli.render.sheet import PAPER, arrange, draw_sheet, shorten, text_coverage

GREY = np.float32(PAPER)


def tiles(count, size):
    rng = np.random.default_rng(3)
    return [rng.uniform(0.1, 5, (size, size, 3)).astype(np.float32) for _ in range(count)]


def label_of(sheet, layout, index):
    top, left = layout.origin(index)
    rows = slice(top + layout.tile, top + layout.tile + layout.label_height)
    return sheet[rows, left : left + layout.tile]


@pytest.mark.parametrize(
    ("count", "columns", "expected"),
    [(2, None, 2), (3, None, 2), (4, None, 2), (5, None, 3), (10, None, 4), (7, 2, 2), (3, 9, 3)],
)
def test_columns(count, columns, expected):
    layout = arrange(count, 64, columns)
    assert layout.columns == expected
    height, width = layout.shape
    rows = -(-count // expected)
    assert width == expected * 64 + (expected + 1) * layout.gap
    assert height == rows * (64 + layout.label_height) + (rows + 1) * layout.gap


@pytest.mark.parametrize("size", [16, 64, 512])
def test_tiles_and_labels_are_in_their_places_and_nothing_else_is(size):
    pictures = tiles(5, size)
    layout = arrange(5, size)
    sheet = draw_sheet(layout, pictures, ["a", "bb", "gj", "a", "e"])
    assert sheet.dtype == np.float32
    assert sheet.shape == (*layout.shape, 3)
    rest = np.ones(layout.shape, dtype=bool)
    for index, picture in enumerate(pictures):
        top, left = layout.origin(index)
        tile = sheet[top : top + size, left : left + size]
        np.testing.assert_array_equal(tile, picture)
        rest[top : top + size + layout.label_height, left : left + size] = False
        label = label_of(sheet, layout, index)
        assert label.max() > 0.9
        assert label.max() <= 1
        # Text is grey, within the strip, and in its middle.
        assert (label == label[..., :1]).all()
        inked = np.argwhere(label[..., 0] != GREY)
        assert inked[:, 0].min() >= 1
        assert inked[:, 0].max() <= layout.label_height - 2
        centre = (inked[:, 1].min() + inked[:, 1].max() + 1) / 2
        assert abs(centre - size / 2) <= 2
    assert rest.any()
    assert (sheet[rest] == GREY).all()
    same = [label_of(sheet, layout, index) for index in (0, 3, 1)]
    np.testing.assert_array_equal(same[0], same[1])
    assert (same[0] != same[2]).any()


@pytest.mark.parametrize("size", [16, 40, 200])
def test_long_labels_stay_under_their_tile(size):
    layout = arrange(4, size)
    labels = ["W" * 300, "a.very.long.name." * 9, "", "i" * 4000]
    sheet = draw_sheet(layout, [np.zeros((size, size, 3), np.float32)] * 4, labels)
    for index in range(4):
        top, left = layout.origin(index)
        gap = sheet[top : top + layout.label_height + size, left - layout.gap : left]
        assert (gap == GREY).all()
    assert (label_of(sheet, layout, 2) == GREY).all()
    assert label_of(sheet, layout, 1).max() > 0.5


@pytest.mark.parametrize("words", [("0.828%", "apart"), ("truth", "30,15"), ("gypsum", "of jugs")])
def test_labels_that_are_wider_than_their_tile_have_two_lines_and_all_of_their_ink(words):
    layout = arrange(2, 48)
    sheet = draw_sheet(layout, tiles(2, 48), [" ".join(words), "_" * 99])
    label = (label_of(sheet, layout, 0)[..., 0] - GREY) / (1 - GREY)
    alone = [text_coverage(word, layout.font_size, 400, 99)[..., 0] for word in words]
    assert label.sum() == pytest.approx(sum(each.sum() for each in alone), rel=1e-5)
    rows = np.flatnonzero(label.any(axis=1))
    tall = [np.ptp(np.flatnonzero(each.any(axis=1))) + 1 for each in alone]
    assert np.ptp(rows) + 1 > max(tall) + 5
    assert rows[-1] < layout.label_height


def test_names_of_files_that_are_no_text_have_a_label():
    layout = arrange(2, 64)
    sheet = draw_sheet(layout, tiles(2, 64), ["a\udcffb", "äöü"])
    assert label_of(sheet, layout, 0).max() > 0.9
    assert label_of(sheet, layout, 1).max() > 0.9


@pytest.mark.parametrize(
    ("room", "expected"),
    [
        (10, "abcdefghij"),
        (9, "abc...hij"),
        (8, "abc...ij"),
        (5, "a...j"),
        (4, "a..."),
        (3, "..."),
        (2, ""),
    ],
)
def test_shortening_leaves_out_the_middle(room, expected):
    assert shorten("abcdefghij", lambda text: len(text) <= room) == expected


def test_sheets_have_a_largest_size():
    arrange(2, 7000)
    with pytest.raises(OutputError, match="smaller `size`"):
        arrange(4, 8000)
