"""Probes whose suns were clipped, and readings of the light as it was."""

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError, ProbeError
from shrm_cli.photo.unclip import unclip
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.grid.latlong import latlong_directions
from tests.cli.helpers import ROOT

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@pytest.fixture(scope="module")
def sky():
    """Return the shipped sky with its sun, shape (H, 2H, 3)."""
    return open_probe(ROOT / "probes" / "sky.exr").image()


def irradiance(pixels, normal):
    """Sum it over a hemisphere, with the solid angles of a lat-long's rows."""
    height, width = pixels.shape[:2]
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    areas = (edges[:-1] - edges[1:])[:, None] * 2 * np.pi / width
    cosines = np.maximum(latlong_directions(width, height) @ normal, 0)
    return np.einsum("hw,hwc->c", cosines * areas, pixels, dtype=float)


@pytest.mark.parametrize("normal", [(0.0, 1.0, 0.0), (0.48, 0.8, 0.36)])
def test_a_reading_gives_the_light_back(sky, normal):
    normal = np.array(normal)
    clipped = np.minimum(sky, 40)
    wanted = irradiance(sky, normal)
    assert (irradiance(clipped, normal) < 0.7 * wanted).all()
    made = unclip(Probe.from_array(clipped), irradiance=wanted, normal=3 * normal)
    np.testing.assert_allclose(irradiance(made.pixels, normal), wanted, rtol=1e-5)
    # It is right for other surfaces, too, because it is the sun that grew.
    other = np.array([0.6, 0.64, -0.48])
    np.testing.assert_allclose(irradiance(made.pixels, other), irradiance(sky, other), rtol=0.02)
    sun = latlong_directions(sky.shape[1], sky.shape[0]).reshape(-1, 3)[sky.sum(axis=2).argmax()]
    assert made.direction @ sun > np.cos(np.radians(1))
    changed = (made.pixels != clipped).any(axis=-1)
    assert 0 < changed.sum() < 20


def test_a_light_meter_tells_it_by_its_reading_in_the_shadow(sky):
    up = np.array([0.0, 1.0, 0.0])
    clipped = np.minimum(sky, 40)
    is_sun = sky.min(axis=2) >= 40
    shaded = irradiance(np.where(is_sun[..., None], 0, clipped), up) @ LUMINANCE
    ratio = irradiance(sky, up) @ LUMINANCE / shaded
    made = unclip(Probe.from_array(clipped), ratio=ratio)
    found = irradiance(made.pixels, up) @ LUMINANCE
    assert found == pytest.approx(irradiance(sky, up) @ LUMINANCE, rel=0.01)


def test_what_cannot_be_is_refused(sky):
    probe = Probe.from_array(np.minimum(sky, 40))
    with pytest.raises(ArgumentError, match="`irradiance` or `ratio` must be given, and not both"):
        unclip(probe)
    with pytest.raises(ArgumentError, match=r"`ratio` is below the irrad.*\(a ratio of 1\.00"):
        unclip(probe, ratio=1.001)
    with pytest.raises(ArgumentError, match="`irradiance` is below the irradiance"):
        unclip(probe, irradiance=1e-3)
    with pytest.raises(ArgumentError, match=r"`irradiance` is \[1.0, nan, 1.0\]; give a finite"):
        unclip(probe, irradiance=[1, np.nan, 1])
    with pytest.raises(ProbeError, match="does not light a surface that faces so"):
        unclip(probe, ratio=5, normal=(0, -1, 0))
    with pytest.raises(ProbeError, match=r"no lamp stands out of its light, of which 12\.6 sr"):
        unclip(Probe.from_array(np.ones((8, 16, 3))), ratio=5)


@pytest.mark.parametrize(("rows", "is_lamp"), [(5, True), (8, False)])
def test_a_soft_box_is_a_lamp_and_a_bright_part_of_a_sky_is_none(rows, is_lamp):
    directions, radius = latlong_directions(128, 64), rows * 180 / 64
    pixels = np.where(directions @ [0.0, 1.0, 0.0] > np.cos(np.radians(radius)), 9.0, 1.0)
    probe = Probe.from_array(np.repeat(pixels[..., None], 3, axis=-1))
    if is_lamp:
        wanted = 2 * np.pi * (1 - np.cos(np.radians(radius)))
        assert unclip(probe, ratio=5).solid_angle == pytest.approx(wanted, rel=0.03)
    else:
        with pytest.raises(ProbeError, match="no lamp stands out of its light"):
            unclip(probe, ratio=5)
