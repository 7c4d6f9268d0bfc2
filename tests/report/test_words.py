"""Numbers in words, as the pages of `shrm report` show them."""

import pytest

from shrm_cli.analysis.facts import seen_channels
from shrm_cli.report import words


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ((0.5, 0.5, 0.5), "0.5"),
        ((6520, 984.5, 2.477), "6520 / 984.5 / 2.477"),
        ((12345.6, 2, 1), "12,346 / 2 / 1"),
        ((0.4601, 0.07078, 2.4e-12), "0.4601 / 0.07078 / 0"),  # of a red sun, which rounding makes
        ((2.4e-12, 1e-12, 0), "2.4e-12 / 1e-12 / 0"),
        ((0, 0, 0), "0"),
    ],
)
def test_colors(values, text):
    assert words.color(values) == text


def test_channels_that_are_nothing_beside_others_are_none():
    assert seen_channels([1, -1e-7, 1e-5]) == [1, 0, 1e-5]
    assert seen_channels([]) == []
