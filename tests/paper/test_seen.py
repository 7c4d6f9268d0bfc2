"""Tests of what `make tables` says of what is seen of maps, on one small probe with a bare sun."""

import numpy as np
import pytest

from shrm_cli import settings
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.probe.make import impulse
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import reference
from tests.conftest import ROOT
from tests.paper import page_seen, seen
from tests.paper.__main__ import Page, equal_probes
from tests.paper.glossy_truth import light_of, sphere

ROWS = 64
SPECS = ("phong:exponent=64", "microfacet:sigma=0.2")


@pytest.fixture(scope="module")
def probe():
    """A dim sky, and a sun of one pixel that sends ten times the sky's light."""
    sky = np.full((ROWS, 2 * ROWS, 3), (0.2, 0.3, 0.5), np.float32)
    sun = impulse(ROWS, np.array([0.48, 0.6, 0.64]))
    sun *= 10 * 4 * np.pi * np.array([0.2, 0.3, 0.5]) / seen_light(sun)
    return Probe.from_array(sky + sun.astype(np.float32), layout="latlong", name="sun")


def seen_light(image):
    """The integral of an image's radiance, for each channel."""
    return light_of([Probe.from_array(image, layout="latlong")], ROWS).power.sum(axis=0)


@pytest.fixture(scope="module")
def rows(probe):
    with settings.using(cache=False):
        return [row for each in seen.measure([probe], SPECS, size=16) for row in each]


def test_default_maps_keep_the_bars_under_a_bare_sun(rows):
    defaults = [row for row in rows if row.way == seen.AFTER]
    assert [row.spec for row in defaults] == list(SPECS)
    assert [seen.misses(row, rows) for row in defaults] == [[], []]


def test_the_maps_as_they_were_miss_them_at_the_same_bytes(rows):
    for spec in SPECS:
        before, after = (seen.find(rows, spec, "sun", way) for way in (seen.BEFORE, seen.AFTER))
        assert before.bytes == after.bytes
        assert (before.order_f, before.order_p) == (after.order_f, after.order_p)
        assert before.carried == before.order_f < after.carried
        assert before.p95 > 1.5 * after.p95
    phong = seen.find(rows, SPECS[0], "sun", seen.BEFORE)
    assert phong.p95 > seen.ZONAL_P95
    assert phong.negative > 0


def test_the_page_names_the_maps_that_miss_their_bar(rows):
    assert "2 of 2 maps keep them" in page_seen.verdict(rows)
    as_before = [row for row in rows if row.way != seen.AFTER]
    failing = [
        seen.Seen(**{**vars(row), "way": seen.AFTER}) for row in as_before if row.way == seen.BEFORE
    ]
    page = page_seen.verdict([*as_before, *failing])
    assert "0 of 2 maps keep them" in page
    assert "- phong:exponent=64 under sun: p95" in page
    assert "of the pixels are negative" in page


def test_shipped_probes_are_made_equally_large():
    files = [ROOT / "probes" / f"{name}.exr" for name in ("studio", "sky")]
    studio, sky = equal_probes(files)
    assert studio.image().shape == sky.image().shape == (128, 256, 3)
    assert studio.name == "studio"
    assert [each.height for each in equal_probes(files, most=32)] == [32, 32]


def test_a_page_is_on_disk_as_far_as_it_has_come(tmp_path):
    page = Page(tmp_path / "index.md")
    page.add("one\n")
    assert page.path.read_text() == "one\n"
    page.add("two\n")
    assert page.path.read_text() == "one\n\ntwo\n"


@pytest.mark.parametrize("spec", [*SPECS, "lambertian", "ggx:roughness=0.5,f0=0.04"])
def test_the_truth_of_many_probes_is_the_reference_of_each(probe, spec):
    other = Probe.from_array(probe.image()[::-1].copy(), layout="latlong")
    ball = sphere((0.6, 0.0, 0.8), 6)
    brdf = parse_spec(spec)
    found = seen.lit(brdf, ball.normals, ball.views, light_of([probe, other], ROWS))
    for k, each in enumerate((probe, other)):
        expected = reference(each, brdf, ball.normals, ball.views)
        np.testing.assert_allclose(found[:, 3 * k : 3 * k + 3], expected, rtol=1e-3, atol=1e-5)
