"""What a map has lost already stays told, whatever is made of it."""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.maps.explicit.prefilter import tabulate_sum
from shrm_cli.maps.explicit.views import Cabral
from shrm_cli.maps.irradiance.irradiance import in_form
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.prefilter import prefilter, prefilter_with_facts
from shrm_cli.probe.probe import Probe
from tests.maps.scenes import make_shrm
from tests.probe import scenes

BEFORE = 0.2


def probe():
    return Probe.from_array(scenes.latlong(32), "latlong")


def principal(spec):
    return prefilter(probe(), spec, to="principal", maps=8, size=16)


def summed():
    terms = make_shrm(order_p=1, center="normal"), make_shrm(order_p=2, seed=1)
    return SummedShrm(terms, replace(terms[1].info, added_error=0.0))


STEPS = {
    "resampled": (make_shrm, lambda made: made.resampled(4)),
    "explicit, resampled": (lambda: Cabral.from_shrm(make_shrm()), lambda made: made.resampled(4)),
    "of fewer orders": (make_shrm, lambda made: made.truncated(1)),
    "sum, resampled": (summed, lambda made: made.resampled(4)),
    "sum, explicit": (summed, lambda made: tabulate_sum(Cabral, made, 1)),
    "principal, as an SHRM": (lambda: principal("ggx:roughness=0.5"), lambda made: made.to_shrm(2)),
    "lobes, resampled": (
        lambda: principal("0.5*lambertian+0.5*ggx:roughness=0.5"), lambda made: made.resampled(8)
    ),
    "zonal": (lambda: prefilter(probe(), to="irradiance"), lambda made: in_form(made, "zh3")),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")
@pytest.mark.parametrize("name", STEPS)
def test_a_step_adds_its_error_to_those_before_it(name):
    """Their squares add up."""
    make, step = STEPS[name]
    clean = make()
    start = clean.info.added_error
    worn = replace(clean, info=replace(clean.info, added_error=float(np.hypot(start, BEFORE))))
    once, twice = step(clean).info.added_error, step(worn).info.added_error
    assert once > start
    assert twice**2 == pytest.approx(once**2 + BEFORE**2, rel=1e-6)


def test_a_window_adds_its_error_to_that_of_a_form():
    form, both = (
        prefilter_with_facts(probe(), "irradiance", {"form": "zh3", **given}).map
        for given in ({}, {"window": "hann"})
    )
    assert form.info.added_error > 0
    normals = np.random.default_rng(3).normal(size=(20000, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    before, after = form.irradiance(normals), both.irradiance(normals)
    change = np.sqrt(np.sum((after - before) ** 2) / np.sum(before**2))
    assert both.info.added_error == pytest.approx(np.hypot(form.info.added_error, change), rel=0.02)
