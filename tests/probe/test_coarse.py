"""Probes whose pixels are cut."""

import numpy as np
import pytest

from shrm_cli.probe.coarse import fine_probe
from shrm_cli.probe.probe import Probe


@pytest.mark.parametrize("size", [10, 21])
def test_balls_are_lit_up_to_their_rim(rng, size):
    """What the disc holds of pixels whose middles are beside it was black."""
    image = rng.uniform(0.5, 1, (size, size, 3)).astype(np.float32)
    probe = Probe.from_array(image, layout="angular")
    fine = fine_probe(probe)
    times, found, used = fine.grid.size // size, fine.image(), fine.grid.used()
    cut, in_disc = (
        each.repeat(times, axis=0).repeat(times, axis=1) for each in (image, probe.grid.used())
    )
    assert times > 1
    assert found[used].min() >= 0.5
    own = used & in_disc
    np.testing.assert_array_equal(found[own], cut[own])
    assert 0.8 < own.sum() / used.sum() < 1
