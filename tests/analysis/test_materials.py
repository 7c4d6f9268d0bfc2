"""Several materials beside each other."""

import json

import numpy as np
import pytest

from shrm_cli.analysis.analyze import material_energies
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.orders import choose_orders
from tests.cli.helpers import assert_refused, done, run


def test_energies_are_those_of_the_orders():
    brdfs = [parse_spec("microfacet:sigma=0.2"), parse_spec("phong")]
    captured = material_energies(brdfs)
    assert captured.shape == (2, 6)
    orders, _ = choose_orders(brdfs[0], 0.03, order_f=30, order_p=2)
    assert captured[0, 2] == pytest.approx(orders.captured, abs=1e-3)
    assert np.all(np.diff(captured[0]) > 0)
    assert np.ptp(captured[1]) == 0  # it does not depend on the view


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = ["analyze", "--brdf", "microfacet", "lambertian", "oren-nayar"]
    values = json.loads(done(*arguments, "--json"))
    assert [each["brdf"] for each in values["materials"]] == ["microfacet", *arguments[3:]]
    assert values["materials"][1]["brdf_energy_captured"][0] > 0.99
    assert values["files"] == ["materials.energy.png"]
    first = (tmp_path / "materials.energy.png").read_bytes()
    text = done(*arguments, "-o", "again")
    assert "P = 5" in text
    assert (tmp_path / "again.energy.png").read_bytes() == first


def test_options_about_a_single_brdf(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run("analyze", "--brdf", "phong", "microfacet", "--eps", "0.1")
    assert_refused(result, 2, "--eps", "single BRDF")
    assert_refused(run("analyze", "--brdf", "phong", "microfaset"), 1, "microfaset", "microfacet")
    assert not list(tmp_path.iterdir())
