"""Probes of which several maps are made: how often their pixels are read, and what is kept."""

import numpy as np
import pytest

from shrm_cli.probe import shared as of_several
from shrm_cli.probe.image import ArrayImage
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.shared import shared
from tests import oracles
from tests.cli.helpers import polynomial_light


@pytest.fixture
def pixels():
    return polynomial_light(oracles.latlong_pixels(128, 64)).astype(np.float32)


@pytest.fixture
def reads(monkeypatch):
    """How many rows were read of images in memory, added up."""
    found, plain = [], ArrayImage.read

    def read(self, start, stop):
        found.append(stop - start)
        return plain(self, start, stop)

    monkeypatch.setattr(ArrayImage, "read", read)
    return found


def test_pixels_are_held_unless_they_are_too_many(pixels, reads, monkeypatch):
    held = shared(Probe.from_array(pixels))
    for order in (4, 8, 16, 12):
        project(held, order)
    assert (held.is_held, sum(reads)) == (True, 64)
    monkeypatch.setattr(of_several, "MOST_BYTES", pixels.nbytes - 1)
    assert not shared(Probe.from_array(pixels)).is_held
    assert shared(held) is held


def test_what_is_known_is_not_that_of_other_colors(pixels):
    held = shared(Probe.from_array(pixels))
    before = project(held, 64).coefficients
    found = project(held.multiplied(np.diag([2.0, 1.0, 0.5]), None), 64).coefficients
    np.testing.assert_allclose(found, before * [2, 1, 0.5], rtol=1e-5, atol=1e-6)


def test_an_image_that_is_not_held_is_read_twice_at_most(pixels, reads, monkeypatch):
    """Once for few degrees, which are enough for dull surfaces, and once for all."""
    monkeypatch.setattr(of_several, "MOST_BYTES", 0)
    large = shared(Probe.from_array(pixels))
    for orders, times in (((4, 64, 8), 1), ((65, 200, 30, 512), 2)):
        for order in orders:
            assert project(large, order).order == order
        assert sum(reads) == 64 * times


def test_what_is_known_of_it_is_that_of_the_image(pixels, monkeypatch):
    """It is rounded alike, whatever was asked for before."""
    monkeypatch.setattr(of_several, "MOST_BYTES", 0)
    alone = Probe.from_array(pixels)
    large, other = shared(alone), shared(alone)
    project(other, 512)
    for order in (4, 64, 65, 200):
        found, expected = project(large, order), project(alone, order)
        np.testing.assert_allclose(found.coefficients, expected.coefficients, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(found.energy, expected.energy)
        np.testing.assert_array_equal(found.coefficients, project(other, order).coefficients)
