"""Fronts and recommendations, beside what a person would say of a handful of maps."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from shrm_cli.choose.offer import Choice, Offer, decided
from shrm_cli.plan.search import Goal

GOAL = Goal(0.05, 0.05)


def offer(size, error, share, look_ups=1, work=1, form="shrm"):
    what = f"{size} {error} {share} {look_ups} {work}"
    return Offer(form, what, size, error, share, (), look_ups, work, None, lambda: None)


def best(offers, budget=None, goal=GOAL):
    choice = decided("p", "b", goal, budget, offers)
    return choice.recommended and (choice.recommended.bytes, choice.is_kept)


def test_the_fewest_bytes_that_keep_both():
    offers = [offer(100, 0.04, 0.2), offer(200, 0.06, 0.01), offer(400, 0.03, 0.05)]
    assert best([*offers, offer(800, 0.01, 0.0)]) == (400, True)
    assert best([*offers, offer(399, 0.05, 0.04)]) == (399, True)
    assert best(offers, goal=Goal(0.05, 0.3)) == (100, True)
    assert best(offers, goal=Goal(0.1, 0.04)) == (200, True)


def test_within_a_budget_the_least_wrong_is_taken():
    offers = [offer(10, 0.5, 0.9), offer(100, 0.2, 0.4), offer(150, 0.2, 0.39), offer(900, 0, 0)]
    assert best(offers) == (900, True)
    assert best(offers, 899) == (100, False)  # 150 bytes are hardly better
    assert best(offers, 99) == (10, False)
    assert best(offers, 9) is None


def test_what_has_spots_keeps_nothing():
    offers = [replace(offer(10, 0.01, 0.01), has_spots=True), offer(100, 0.04, 0.04)]
    assert best(offers) == (100, True)
    assert best(offers, 99) == (10, False)


def test_fronts_hold_what_nothing_beats():
    rng = np.random.default_rng(0)
    numbers = rng.integers(1, 12, size=(40, 4)).tolist()
    offers = [offer(a, b / 100, 0.5, c, d) for a, b, c, d in numbers]
    for each in decided("p", "b", GOAL, None, offers).offers:
        others = [other for other in offers if other.what != each.what]
        bytes_ = any(
            (o.bytes < each.bytes and o.error <= each.error)
            or (o.bytes <= each.bytes and o.error < each.error)
            for o in others
        )
        assert each.on_front == (not bytes_)
        mine = np.array([each.error, each.look_ups, each.multiply_adds])
        theirs = np.array([[o.error, o.look_ups, o.multiply_adds] for o in others])
        worse = ((theirs <= mine).all(axis=1) & (theirs < mine).any(axis=1)).any()
        assert each.on_cost_front == (not worse)


def test_offers_are_frozen():
    with pytest.raises(AttributeError):
        offer(1, 0.1, 0.1).bytes = 2


def test_notebooks_show_a_table_in_which_names_are_text():
    offers = [
        Offer(form, "a < b", 1000, 0.01, 0.02, (), 3, 4, None, lambda: None) for form in ("x", "y")
    ]
    choice = Choice("<b>.exr", "ggx", Goal(0.05, 0.05), None, tuple(offers), offers[1], True)
    table = ElementTree.fromstring(choice._repr_html_())
    assert table.find("caption").text == "<b>.exr, ggx"
    rows = [[(cell.tag, cell.text) for cell in row] for row in table.findall("tr")]
    assert [row[1] for row in rows] == [("th", "what"), ("td", "a < b"), ("th", "a < b")]
    assert rows[2][0] == ("th", "y")
    assert rows[1][2:5] == [("td", "1,000"), ("td", "1.0%"), ("td", "2.0%")]
