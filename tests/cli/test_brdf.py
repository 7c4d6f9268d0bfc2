"""`shrm brdf`: the list, one explained, and its orders."""

import json

import pytest

from shrm_cli.brdf.spec import MODELS
from tests.cli.helpers import assert_refused, done, process, run


def test_list_names_every_model_and_parameter():
    text = done("brdf")
    for model in MODELS.values():
        assert f"{model.name} " in text
        assert model.summary in text
        for parameter in model.parameters:
            assert f"{parameter.name}  {parameter.minimum:g} .. {parameter.maximum:g}, " in text
            assert f"default {parameter.default:g}" in text


def test_list_as_json():
    values = json.loads(done("brdf", "--json"))
    assert [each["name"] for each in values] == list(MODELS)
    for each in values:
        assert list(each) == ["name", "summary", "source", "center", "parameters"]
    microfacet = next(each for each in values if each["name"] == "microfacet")
    assert microfacet["center"] == "reflection"
    (sigma,) = microfacet["parameters"]
    assert (sigma["name"], sigma["default"]) == ("sigma", 0.2)
    assert next(each for each in values if each["name"] == "lambertian")["center"] == "normal"


def test_one_is_explained_with_its_orders():
    text = done("brdf", "microfacet")
    assert text.startswith("microfacet:sigma=0.2: ")
    assert "5.34" in text
    assert "centre      reflection" in text
    assert "eps 0.03    F = 11, P = 2 (97." in text
    assert text.count("eps ") == 3


def test_several_tolerances_keep_their_order():
    values = json.loads(
        done("brdf", "phong:exponent=32", "--eps", 0.01, "--eps", 0.3, "--eps", 0.1, "--json")
    )
    assert values["values"] == {"exponent": 32}
    assert [row["epsilon"] for row in values["orders"]] == [0.01, 0.3, 0.1]
    orders = {row["epsilon"]: row["order_f"] for row in values["orders"]}
    # The paper's table has F = 12 at 0.01; exp(-F^2 / s) of eq. 5.28 elsewhere.
    assert abs(orders[0.01] - 12) <= 1
    assert orders[0.3] < orders[0.1] < orders[0.01]
    for row in values["orders"]:
        assert list(row) == ["epsilon", "order_f", "order_p", "brdf_energy_captured"]
        assert row["order_p"] == 0
        assert row["brdf_energy_captured"] >= 1 - row["epsilon"]


def test_a_tolerance_that_cannot_be_met_is_a_row_with_what_was_reached():
    command = ("brdf", "phong:exponent=1e5", "--eps", 0.01, "--eps", 0.5)
    values = json.loads(done(*command, "--json"))
    failed, met = values["orders"]
    assert list(failed) == ["epsilon", "error"]
    assert "F = 512" in failed["error"]
    assert "0.072" in failed["error"]
    assert met["order_f"] < 512
    text = done(*command)
    assert "eps 0.01    phong:exponent=100000: tolerance 0.01 cannot be met" in text
    assert f"eps 0.5     F = {met['order_f']}, P = 0" in text


def test_quiet_prints_nothing_but_json():
    assert done("brdf", "--quiet") == ""
    assert done("brdf", "phong", "--quiet") == ""
    assert json.loads(done("brdf", "phong", "--quiet", "--json"))["name"] == "phong"


@pytest.mark.parametrize(
    ("arguments", "code", "parts"),
    [
        (["microfact"], 1, ["'microfact'", "did you mean microfacet?"]),
        (["Phong"], 1, ["'Phong'", "did you mean phong?"]),
        (["zzz"], 1, ["'zzz'", "known: lambertian, phong, microfacet"]),
        (["phong:shine=3"], 1, ["'shine'", "it has exponent"]),
        (["phong:exponent=-1"], 1, ["exponent=-1", "outside 0 .. 100000"]),
        (["phong:exponent=nan"], 1, ["exponent=nan", "not a number"]),
        (["phong", "--eps", "0"], 2, ["--eps", "between 0 and 1"]),
        (["phong", "--eps", "1"], 2, ["--eps", "between 0 and 1"]),
        (["phong", "--eps", "nan"], 2, ["--eps", "nan", "between 0 and 1"]),
        (["phong", "--eps", "0.1", "--eps", "-1"], 2, ["--eps", "-1"]),
        (["phong", "--eps", "many"], 2, ["--eps", "'many'"]),
    ],
)
def test_bad_input(arguments, code, parts):
    assert_refused(run("brdf", *arguments), code, *parts)


def test_as_a_process():
    result = process("brdf", "lambertian", "--eps", "0.1")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith("lambertian:albedo=1: ")
