"""`shrm brdf`: the list, one explained, and its orders."""

import json

import numpy as np
import pytest

from shrm_cli import orders
from shrm_cli.brdf.library import built_in_names, find_model
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from tests.cli.helpers import assert_refused, done, process, run, snapshot

FORMATS = ["goniometer", "merl", "rgl", "table", "zernike"]
MODELS = {name: find_model(name) for name in built_in_names()}


def test_list_names_every_model_and_parameter():
    text = done("brdf")
    for model in MODELS.values():
        assert f"{model.name} " in text
        assert model.summary in text
        for parameter in model.parameters:
            assert f"{parameter.name}  {parameter.domain}, default " in text


def test_list_says_what_is_anisotropic_and_what_files_are_read():
    text = done("brdf")
    groups = ["Diffuse, about the normal:", "Glossy, about the mirror direction:"]
    groups += ["Fibres, about the tangent:", "Measured, by the path of a file:"]
    places = [text.index(group) for group in groups]
    assert places == sorted(places)
    assert places[0] < text.index("  lambertian ") < places[1] < text.index("  ggx ") < places[2]
    assert places[2] < text.index("  kajiya-kay ") < places[3] < text.index("  goniometer ")
    assert "anisotropic where ax and ay differ: `--to principal` and" in text
    assert "\n                       anisotropic: `--to principal` and" in text
    formats = [text.index(f"\n  {name} ", places[3]) for name in FORMATS]
    assert formats == sorted(formats)


def test_list_is_in_the_order_of_the_alphabet_within_each_group():
    rows = [line for line in done("brdf").splitlines() if not line.startswith("   ")]
    groups = " ".join(row.split()[0] if row.startswith(" ") else "|" for row in rows).split("|")
    found = [group.split() for group in groups[1:]]
    assert found == [sorted(group) for group in found]
    assert sorted(name for group in found[:3] for name in group) == sorted(MODELS)
    assert found[3] == FORMATS


def test_list_as_json():
    values = json.loads(done("brdf", "--json"))
    groups = ["normal", "reflection", "tangent"]
    expected = sorted(MODELS.values(), key=lambda model: (groups.index(model.center), model.name))
    assert [each["name"] for each in values] == [model.name for model in expected]
    for each in values:
        assert list(each) == ["name", "summary", "source", "center", "isotropic", "parameters"]
    microfacet = next(each for each in values if each["name"] == "microfacet")
    assert microfacet["center"] == "reflection"
    (sigma,) = microfacet["parameters"]
    assert (sigma["name"], sigma["default"]) == ("sigma", 0.2)
    by_name = {each["name"]: each for each in values}
    assert by_name["lambertian"]["center"] == "normal"
    assert not by_name["poulin-fournier"]["isotropic"]


def test_one_is_explained_with_its_orders():
    text = done("brdf", "microfacet")
    assert text.startswith("microfacet:sigma=0.2: ")
    assert "5.34" in text
    assert "centre      reflection" in text
    assert "eps 0.03    F = 11, P = 2 (97." in text
    assert text.count("eps ") == 3


def test_one_is_explained_with_what_it_does():
    """A Lambertian of albedo .25 is .25 / pi everywhere, and keeps to its first order."""
    text = done("brdf", "lambertian:albedo=0.25/0.5/0.25", "--eps", 0.03)
    lines = [line.split() for line in text.splitlines()]
    assert lines[4][:8] == ["values", "0.07958", "..", "0.1592", "1/sr,", "up", "to", "80"]
    assert lines[5][:7] == ["albedo", "0", "15", "30", "45", "60", "75"]
    for row, name, expected in zip(lines[6:9], "RGB", (0.25, 0.5, 0.25), strict=True):
        assert row[0] == name
        assert [float(value) for value in row[1:]] == pytest.approx([expected] * 6, abs=2e-3)
    assert lines[9][0] == "furnace"
    assert float(lines[9][1]) == pytest.approx(0.5, rel=2e-3)
    assert "gains no energy" in text
    assert "reciprocity exact" in text
    assert text.count("%") == 7
    assert text.rstrip().endswith("within F = 2")


def test_one_is_explained_as_json():
    values = json.loads(done("brdf", "microfacet:sigma=0.4", "--json", "--eps", 0.03))
    found = values["examination"]
    assert [row["theta"] for row in found["albedo"]] == [0, 15, 30, 45, 60, 75]
    assert all(len(row["rgb"]) == 3 for row in found["albedo"])
    assert not found["gains_energy"]
    # Not reciprocal: the model leaves the cosine of the light out.
    assert found["reciprocity_error"] > 0.1
    captured = values["captured_by_view_order"]
    assert captured["order_f"] == values["orders"][0]["order_f"]
    assert len(captured["captured"]) == 6
    assert captured["captured"] == sorted(captured["captured"])
    order_p = values["orders"][0]["order_p"]
    got = values["orders"][0]["brdf_energy_captured"]
    assert captured["captured"][order_p] == pytest.approx(got, abs=2e-3)


def test_energy_of_the_view_orders():
    values = json.loads(done("brdf", "microfacet:sigma=0.4", "--json", "--eps", 0.1, "--eps", 0.05))
    found = values["captured_by_view_order"]
    f = values["orders"][-1]["order_f"]
    assert found["order_f"] == f
    whole = compute_coefficients(parse_spec("microfacet:sigma=0.4"), 16, 9, 1e-5)
    by_order = whole.values[: f + 1] ** 2
    by_order[:, :, 1:] *= 2
    expected = np.cumsum(by_order.sum(axis=(0, 2, 3))) / whole.total_energy.sum()
    assert found["captured"] == pytest.approx(expected[:6], abs=1e-3)
    assert found["captured"][0] < found["captured"][2] < found["captured"][5] < 1


def test_zonal_models_have_it_all_in_the_first_order():
    """Degrees 0, 1 and 2 of max(z, 0), by Parseval: 1/4, 1/2 and 5/32 of its square's integral."""
    found = json.loads(done("brdf", "lambertian", "--json", "--eps", 0.03))
    assert found["captured_by_view_order"]["order_f"] == 2
    expected = (1 / 4 + 1 / 3 + 5 / 64) * 3 / 2
    assert found["captured_by_view_order"]["captured"] == pytest.approx([expected] * 6)


def test_orders_of_several_tolerances_take_one_search(monkeypatch):
    """The search is for the smallest of them, and its coefficients meet the others too."""
    searched = []
    known = orders.known_coefficients
    monkeypatch.setattr(
        orders, "known_coefficients", lambda *given: searched.append(given[1]) or known(*given)
    )
    together = json.loads(done("brdf", "ggx:roughness=0.6", "--json", "--eps", 0.1, "--eps", 0.05))
    assert searched == [0.05]
    for row in together["orders"]:
        alone = orders.choose_orders(parse_spec("ggx:roughness=0.6"), row["epsilon"])[0]
        assert (row["order_f"], row["order_p"]) == (alone.order_f, alone.order_p)


def test_one_that_gains_energy_is_told():
    text = done("brdf", "kajiya-kay", "--eps", 0.1)
    assert "it gains energy" in text
    assert "degrees from the tangent" in text


def test_an_anisotropic_one_is_explained_without_orders():
    text = done("brdf", "ward:ax=0.1,ay=0.3")
    assert "eps " not in text
    assert "anisotropic: `--to principal` and `shrm product` hold it, other forms refuse it" in text
    values = json.loads(done("brdf", "ward:ax=0.1,ay=0.3", "--json"))
    assert values["orders"] == []
    assert values["isotropic"] is False
    assert "captured_by_view_order" not in values


def test_a_measured_file_is_explained(shared):
    file = shared / "brdf" / "rgl" / "paper_white_rgb.bsdf"
    values = json.loads(done("brdf", file, "--json", "--eps", 0.1))
    assert values["values"]["file"] == file.name
    assert values["name"] == "rgl"
    # The database's own albedo at normal incidence.
    expected = pytest.approx([0.8186, 0.8329, 0.9791], rel=2e-3)
    assert values["examination"]["albedo"][0]["rgb"] == expected


@pytest.mark.parametrize(
    ("suffix", "kind", "error"),
    [("exr", "table", 0.01), ("npz", "table", 0.01), ("binary", "merl", 0.02)],
)
@pytest.mark.slow
def test_saving_converts_and_tells_the_error(tmp_path, suffix, kind, error):
    target = tmp_path / f"gold.{suffix}"
    spec = "ggx:roughness=0.5,f0=gold"
    values = json.loads(done("brdf", spec, "--save", target, "--json"))
    assert list(values) == ["file", "format", "bytes", "rms_difference"]
    assert values["format"] == kind
    assert values["bytes"] == target.stat().st_size
    assert 0 < values["rms_difference"] < error
    original, written = (
        json.loads(done("brdf", each, "--json", "--eps", 0.3)) for each in (spec, target)
    )
    assert written["values"]["file"] == target.name
    for one, other in zip(
        original["examination"]["albedo"], written["examination"]["albedo"], strict=True
    ):
        assert other["rgb"] == pytest.approx(one["rgb"], rel=0.02)
    assert original["orders"][0]["order_p"] == written["orders"][0]["order_p"]


def test_saving_speaks_of_what_was_written(tmp_path):
    target = tmp_path / "t.npz"
    text = done("brdf", "phong", "--save", target)
    assert text.startswith(f"{target}: a table over half and difference angles, 128 x 72 x 64, ")
    assert "RMS error" in text
    assert "of phong:exponent=32" in text
    target.unlink()
    assert done("brdf", "phong", "--save", target, "--quiet") == ""
    assert target.exists()


def test_saving_refuses_what_cannot_be(tmp_path):
    target = tmp_path / "t.exr"
    done("brdf", "oren-nayar", "--save", target)
    before = snapshot(tmp_path)
    for arguments, code, parts in [
        (["ggx", "--save", tmp_path / "t.png"], 2, ["--save", ".binary"]),
        (["--save", target], 2, ["--save", "name one"]),
        (["ward:ax=0.1,ay=0.2", "--save", target], 1, ["anisotropic"]),
        (["poulin-fournier", "--save", tmp_path / "t.binary"], 1, ["isotropic"]),
        (["kajiya-kay", "--save", tmp_path / "t.binary"], 1, ["about a normal"]),
        (["ggx", "--save", tmp_path / "no" / "t.exr"], 1, ["no folder"]),
        (["ggx", "--save", tmp_path], 2, ["--save"]),
        ([target, "--save", target], 1, ["overwrite the input"]),
    ]:
        assert_refused(run("brdf", *arguments), code, *parts)
    assert snapshot(tmp_path) == before


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
    # The BRDF stands in the first line, and is not told again.
    assert "eps 0.01    tolerance 0.01 cannot be met" in text
    assert f"eps 0.5     F = {met['order_f']}, P = 0" in text


def test_quiet_prints_nothing_but_json():
    assert done("brdf", "--quiet") == ""
    assert done("brdf", "phong", "--quiet") == ""
    assert json.loads(done("brdf", "phong", "--quiet", "--json"))["name"] == "phong"


@pytest.mark.parametrize(
    ("arguments", "code", "parts"),
    [
        (["microfact"], 1, ["'microfact'", "did you mean microfacet"]),
        (["Phong"], 1, ["'Phong'", "did you mean phong?"]),
        (["qqq"], 1, ["'qqq'", "known: ashikhmin-shirley, blinn-phong, charlie"]),
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


def test_a_coat_is_compared_with_a_walk():
    coat = "coated:roughness=0.4,base=(lambertian:albedo=0.5)"
    text, told = (
        done("brdf", coat, "--walk", 16),
        json.loads(done("brdf", coat, "--walk", 16, "--json")),
    )
    assert "16 paths for each of 512 lights" in text
    assert told["theta"] == [0, 15, 30, 45, 60, 75]
    assert told["walked"][0][0] == pytest.approx(told["albedo"][0][0], abs=0.05)
    assert f"{told['walked'][3][1]:.4f}" in text
    assert_refused(run("brdf", "ggx", "--walk", 16), 1, "the walk is for coated")
    assert_refused(run("brdf", "--walk", 16), 2, "--walk needs a coated BRDF")
