"""What maps of principal functions are made by default: their bytes, functions and centers."""

import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.principal.terms import _fills_budget
from shrm_cli.maps.request import Request
from shrm_cli.maps.size import choose_size, stored_bytes
from shrm_cli.plan import policy
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import Reference
from tests.brute_force import unit
from tests.maps.principal.test_principal import PAIRS, SPECS, lit_room, shown_error

LEAST = policy.LEAST_BYTES
pytestmark = pytest.mark.filterwarnings("ignore:.*is negative:shrm_cli.errors.ShrmWarning")


@pytest.fixture(scope="module")
def room():
    return Probe.from_array(lit_room())


@pytest.mark.proof
@pytest.mark.parametrize(("name", "eps"), [("microfacet", 0.05), ("metal", 0.1)])
def test_a_tolerance_makes_the_best_of_the_bytes_that_it_asks_for(room, name, eps):
    """The fewest functions that keep it leave room for many more where texels are fewer."""
    brdf = parse_spec(SPECS[name])
    asked = {"brdf": brdf, "to": "principal", "eps": eps}
    made = prefilter(room, **asked)
    # A given size keeps the fewest functions, and is far larger here than their order F asks for.
    order_f = prefilter(room, **asked, size=128).info.order_f
    simplest = prefilter(room, **asked, size=choose_size(order_f))
    assert made.size < simplest.size
    assert made.cube_count > simplest.cube_count
    sizes = [stored_bytes(each.size, each.cube_count) for each in (made, simplest)]
    assert sizes[0] <= max(sizes[1], LEAST)
    errors = [shown_error(each, room, brdf, PAIRS[name]) for each in (made, simplest)]
    assert errors[0] < errors[1] / 2


def test_broad_lobes_get_more_than_a_handful_of_functions(room):
    """The fewest bytes that keep a tolerance would be less than a picture of the map."""
    given = {"brdf": "blinn-phong:exponent=8", "to": "principal", "eps": 0.03}
    made, few = prefilter(room, **given), prefilter(room, **given, max_size=30_000)
    assert stored_bytes(few.size, few.cube_count) <= 30_000
    assert LEAST / 2 < stored_bytes(made.size, made.cube_count) <= LEAST
    assert made.info.predicted_error < few.info.predicted_error / 2


class Full:
    """The choices for a lobe that is known to order 64, and needs more bytes than there are."""

    spectrum = SimpleNamespace(transfer=SimpleNamespace(order_f=64))

    def __init__(self, size):
        self.best = SimpleNamespace(size=size, bytes=10**9)

    def for_tolerance(self, tolerance):
        return (1,), 64, 1 - tolerance

    def form(self, counts, size):
        return self.best

    def best_fitting(self, max_size, size):
        return self.best


@pytest.mark.parametrize(("best", "fills"), [(12, True), (48, True), (64, False)])
def test_more_degrees_are_computed_where_larger_cubes_might_be_better(best, fills):
    """Cubes of 64 texels, the rival of those of 48, support 80 degrees, and those of 96, 120."""
    assert _fills_budget(Full(best), Request("principal", eps=0.01, max_size=10**6)) == fills


@pytest.mark.proof
@pytest.mark.parametrize("spec", ["charlie:roughness=0.3", "ggx:roughness=1,f0=1"])
def test_rough_surfaces_are_about_the_normal(room, spec):
    """On spheres their maps are better there than about the mirror direction."""
    given = {"brdf": spec, "to": "principal", "eps": 1e-3, "max_size": 150_000}
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = [prefilter(room, center=center, **given) for center in (None, "reflection")]
    made, other = found
    # The tolerance takes more bytes, which is said only of light that is seen to be wrong.
    wrong = [each for each in found if each.info.predicted_error > 0.05]
    said = [each for each in told if "150 kB before packing" in str(each.message)]
    assert len(said) == len(wrong)
    assert (made.center, other.center) == ("normal", "reflection")
    assert made.cube_count < other.cube_count
    rng = np.random.default_rng(3)
    normals, views = unit(rng, 2000), unit(rng, 2000)
    views *= np.sign(np.sum(normals * views, axis=1))[:, None]
    pixels = np.sum(normals * views, axis=1)[:, None]
    truth = Reference(room, parse_spec(spec), exact=True).radiance(normals, views)
    errors = [np.sum(pixels * (each.radiance(normals, views) - truth) ** 2) for each in found]
    assert errors[0] < errors[1] / 4


def test_terms_obey_the_center_that_is_asked_for(room):
    given = {"brdf": "0.5*lambertian+0.5*charlie:roughness=0.5", "to": "principal", "eps": 0.1}
    centers = [prefilter(room, center=c, **given).center for c in (None, "auto", "reflection")]
    assert centers == ["normal+normal", "normal+normal", "reflection+reflection"]
    assert prefilter(room, **given, divide=True).center == "normal+reflection"
