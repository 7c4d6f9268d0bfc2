"""`--error` and `--seen` of forms that search nothing: the coarsest settings that keep them."""

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.maps import registry
from shrm_cli.maps.options import SHARED
from shrm_cli.maps.seen import known_error
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.vocabulary import AUTO, REPRESENTATIONS
from tests.cli.helpers import assert_refused, run

CASES = [
    ("cabral", "microfacet:sigma=0.4", 0.2),
    ("lightfield", "oren-nayar:sigma=0.5", 0.2),
    ("irradiance", None, 0.02),
    pytest.param("product", "lambertian", 0.03, marks=pytest.mark.proof),
    ("she", None, 0.3),
]


@pytest.fixture(scope="module")
def light():
    """A smooth sky without a sun, to which all of the forms come near."""
    rows = np.linspace(1.0, 0.2, 32)[:, None, None]
    turn = 1 + 0.5 * np.cos(np.linspace(0, 2 * np.pi, 64, endpoint=False))[None, :, None]
    return shrm.Probe.from_array(rows * turn * np.array([1.0, 0.8, 0.6]))


def made(light, to, brdf, **given):
    few = {"texels": 16} if to == "product" else {}
    return prefilter_with_facts(light, to, {"brdf": brdf, **few, **given})


@pytest.mark.proof
@pytest.mark.parametrize(("to", "brdf", "error"), CASES)
def test_the_coarsest_settings_that_keep_the_error_are_taken(light, to, brdf, error):
    found = made(light, to, brdf, error=error)
    assert known_error(found) <= error
    assert not found.warnings
    steps = registry.description(to).steps
    errors = [known_error(made(light, to, brdf, **step)) for step in steps]
    first = next(index for index, each in enumerate(errors) if each <= error)
    assert known_error(found) == errors[first]


@pytest.mark.proof
@pytest.mark.parametrize(("to", "brdf", "error"), CASES)
def test_where_none_keeps_it_the_best_is_made_and_says_so(light, to, brdf, error):
    found = made(light, to, brdf, error=1e-4)
    assert any("map keeps an RMS error of 0.01%: the best one has" in x for x in found.warnings)
    assert found.map.info.options["error"] == 1e-4


def test_the_share_of_wrong_pixels_is_kept(light):
    found = made(light, "cabral", "microfacet:sigma=0.5", seen=0.3, error=0.5)
    assert found.further["predicted_wrong_share"]() <= 0.3
    coarsest = made(light, "cabral", "microfacet:sigma=0.5", error=0.5)
    assert coarsest.further["predicted_wrong_share"]() > 0.3


def test_levels_of_a_split_sum_have_the_error(light):
    exact, coarse = (made(light, "splitsum", None, error=error).map for error in (1e-4, 0.02))
    assert max(info.predicted_error for info in exact.level_info) <= 1e-4
    assert [info.order_f for info in coarse.level_info] < [i.order_f for i in exact.level_info]


def test_records_hold_what_was_asked_and_not_what_followed(light):
    asked = shrm.prefilter(light, to="irradiance", error=0.02)
    assert "order_f" not in asked.info.options
    assert shrm.prefilter(light, to="irradiance").info.options["order_f"] == 2
    assert "eps" not in made(light, "cabral", "lambertian", error=0.2).map.info.options


def test_settings_that_the_error_chooses_are_refused(tmp_path):
    probe = str(tmp_path / "p.exr")
    assert run("probe", "sky", "--size", "16", "-o", probe).code == 0
    for words, option in [
        (("--to", "cabral", "--brdf", "lambertian", "--eps", "0.1"), "--eps"),
        (("--to", "cabral", "--brdf", "lambertian", "--order-p", "2"), "--order-p"),
        (("--to", "irradiance", "--order-f", "2"), "--order-f"),
        (("--to", "she", "--p-order", "4"), "--p-order"),
    ]:
        found = run("prefilter", probe, *words, "--error", "0.1")
        assert_refused(found, 2, f"{option} does not apply with --error, which chooses it")


@pytest.mark.parametrize("to", [AUTO, *REPRESENTATIONS])
def test_every_form_obeys_an_error(to):
    assert "error" in SHARED
    assert "error" in registry.description(to).arguments
