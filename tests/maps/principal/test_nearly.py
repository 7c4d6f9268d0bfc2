"""Maps that are nearly as good take fewer cubes or bytes, against trying all forms."""

from dataclasses import dataclass

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.principal.plan import Joint, Planner, Sharing
from shrm_cli.maps.principal.terms import planned
from shrm_cli.maps.request import Request
from shrm_cli.maps.size import TRIED_SIZES
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from tests.maps.principal.test_principal import SPECS, lit_room, spectrum_of

METAL = parse_spec(SPECS["metal"])


@pytest.fixture(scope="module")
def planner():
    room = Probe.from_array(lit_room())
    return Planner(spectrum_of(room, METAL, False), Projection(room).to_order(64))


def forms_of(planner, size, most):
    """All forms of a size within a number of bytes, the one of the most functions last."""
    return [
        planner.form(counts, size)
        for cubes, counts in enumerate(planner.choices, 1)
        if 36 * size**2 * cubes <= most
    ]


@pytest.mark.parametrize(
    ("most", "is_smaller"),
    [(12_000, True), (132_123, False), (142_409, True), (165_443, True), (438_410, False)],
)
def test_a_tenth_more_error_is_worth_fewer_cubes(planner, most, is_smaller):
    """At twice that, and at none, other maps would be made."""
    largest = [forms_of(planner, size, most) for size in TRIED_SIZES if size <= 64]
    forms = [each[-1] for each in largest if each]
    least = min(forms, key=lambda form: form.total_error)
    made = planner.best_within(most, 64)
    assert made.total_error <= 1.1 * least.total_error
    assert (made.cubes < least.cubes) == is_smaller
    better = [form for form in forms if form.cubes < made.cubes]
    assert all(form.total_error > 1.1 * least.total_error for form in better)


@pytest.mark.parametrize("most", [100_000, 200_000])
def test_a_twentieth_more_error_is_worth_fewer_bytes_where_a_tolerance_is_missed(planner, most):
    forms = [form for size in TRIED_SIZES for form in forms_of(planner, size, most)]
    allowed = 1.05 * min(form.total_error for form in forms)
    made, is_met = planned(planner, Request("principal", METAL, 1e-4, max_size=most))
    assert not is_met
    kept = min((f for f in forms if f.total_error <= allowed), key=lambda form: form.bytes)
    assert (made.counts, made.size) == (kept.counts, kept.size)


@dataclass(frozen=True)
class Made:
    """A form whose error is larger than the search knows."""

    counts: int
    total_error: float
    size: int = 16


class Optimist(Sharing):
    """Knows the errors of a few forms without their tables only."""

    KNOWN, EXACT = (1.0, 0.9, 0.8, 0.5), (1.1, 1.08, 0.99, 0.6)

    def within_error(self, error, max_size, size):
        index = next(k for k, each in enumerate(self.KNOWN) if each <= error)
        return Joint((Made(index, self.KNOWN[index]),)), True

    def form(self, counts, size, is_exact):
        assert is_exact
        return Made(counts, self.EXACT[counts])

    @property
    def planners(self):
        return [self]


def test_an_error_is_kept_with_tables_by_asking_for_less_again_and_again():
    """At 1 the first form is found, whose tables add .46; with as much the third keeps 1."""
    joint, is_met = Optimist.kept(Optimist.__new__(Optimist), 1.0, 10**6, None)
    assert is_met
    assert joint.forms[0].counts == np.argmax(np.less_equal(Optimist.EXACT, 1.0))


def test_what_is_lost_in_tables_is_not_laid_on_lamps():
    """A sheen falls so steeply beside the horizon that tables miss it, and lamps have no part."""
    light = np.full((32, 64, 3), 0.02, np.float32)
    light[7:12, 15:25] = 20
    asked = {"error": 0.01, "max_size": "2MB"}
    lines = [
        " ".join(prefilter_with_facts(Probe.from_array(light), "principal",
                                      {"brdf": brdf, "seen": 0.01, **asked}).warnings)
        for brdf in ("charlie:roughness=0.05", "ggx:roughness=0.1")
    ]  # fmt: skip
    assert "tables, which are no finer" in lines[0]
    assert "bright places in sharp lobes" not in lines[0]
    assert "tables" not in lines[1]
    assert "bright places in sharp lobes" in lines[1]
