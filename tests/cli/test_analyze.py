"""`shrm analyze`: the numbers it prints, the files it writes, and what it refuses."""

import json
import sys

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.analysis import analyze, plots
from shrm_cli.analysis.analyze import accuracy_curve, energy_grid, order_pictures
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.files.png import encode_srgb
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer
from tests import oracles
from tests.cli.helpers import (
    assert_refused,
    done,
    noise,
    polynomial_light,
    run,
    snapshot,
    write_exr,
)

DEFAULT = (0.1, 0.03, 0.01)
KEYS = [
    "brdf", "probe", "order_f", "order_p", "orders", "brdf_energy_captured", "accuracy",
    "pictures", "files", "warnings",
]  # fmt: skip
SMALL = ("--size", 16)
NO_CHARTS = "Warning: matplotlib is not installed, so no charts are drawn; pip install matplotlib\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a smooth probe, 64 x 32."""
    light = polynomial_light(oracles.latlong_pixels(64, 32)).astype(np.float32)
    write_exr(tmp_path / "probe.exr", light)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def without_matplotlib(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)


@pytest.fixture
def blank(monkeypatch):
    """Charts are laid out and their files are there, but not drawn, which takes half a second."""
    monkeypatch.setattr(plots, "_save", lambda figure, path: open(path, "x").close())


def analyzed(*arguments):
    return json.loads(done("analyze", *arguments, "--json"))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def read(path):
    return oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8)


@pytest.mark.slow
def test_energies_without_a_probe(folder, blank):
    result = analyzed("--brdf", "microfacet:sigma=0.2")
    assert list(result) == KEYS
    assert result["brdf"] == {"name": "microfacet", "parameters": {"sigma": 0.2}}
    assert (result["order_f"], result["order_p"]) == (32, 8)
    assert result["probe"] is result["accuracy"] is result["pictures"] is None
    grid = energy_grid(parse_spec("microfacet:sigma=0.2"), DEFAULT)
    np.testing.assert_array_equal(result["brdf_energy_captured"], grid.captured)
    rows = result["orders"]
    assert [row["epsilon"] for row in rows] == [0.1, 0.03, 0.01]
    assert [(row["order_f"], row["order_p"]) for row in rows] == [(7, 1), (11, 2), (16, 4)]
    for row in rows:
        captured = result["brdf_energy_captured"][row["order_f"]][row["order_p"]]
        assert row["brdf_energy_captured"] == pytest.approx(captured, abs=1e-4)
    assert result["files"] == ["microfacet-sigma-0.2.energy.png"]
    assert names(folder) == ["microfacet-sigma-0.2.energy.png", "probe.exr"]


@pytest.mark.slow
def test_everything_with_a_probe(folder):
    options = ("--view", "20,10", "--size", 16, "--order-f", 12, "--exposure", 0.5)
    result = analyzed("--brdf", "microfacet:sigma=.4", "--probe", "probe.exr", *options)
    assert list(result) == KEYS
    brdf, source = parse_spec("microfacet:sigma=.4"), open_probe("probe.exr")
    grid = energy_grid(brdf, DEFAULT, 12)
    lighting = project(source, grid.coefficients.order_f)
    curve = accuracy_curve(lighting, grid.coefficients, 12, grid.orders[-1].order_p)
    assert result["accuracy"]["order_p"] == grid.orders[-1].order_p
    assert result["accuracy"]["truth_order_f"] == grid.coefficients.order_f
    for name in ("accuracy", "estimate_minimum", "estimate_brdf", "estimate_bound"):
        np.testing.assert_array_equal(result["accuracy"][name], getattr(curve, name))
    pictures = order_pictures(
        lighting,
        grid.coefficients,
        "reflection",
        [Viewer(20, 10)],
        12,
        16,
        Reference(source, brdf, exact=True),
    )
    shown = result["pictures"]
    assert shown["views"] == [[20, 10]]
    assert (shown["order_f"], shown["size"], shown["exposure"]) == (12, 16, 0.5)
    assert shown["source_height"] is None  # 32 rows are few enough
    for p, row in enumerate(shown["orders"]):
        assert row["order_p"] == p
        assert row["brdf_energy_captured"] == pytest.approx(grid.captured[12, p])
        assert row["predicted_error"] == pytest.approx(pictures.predicted_errors[p])
        assert row["errors"] == [pytest.approx(pictures.error(p, 0))]
    assert len(shown["orders"]) == 6
    stem = "probe.microfacet-sigma-.4"
    kinds = ("energy", "accuracy", "pictures")
    assert result["files"] == [f"{stem}.{kind}.png" for kind in kinds]
    assert names(folder) == sorted([*result["files"], "probe.exr"])
    expected = encode_srgb(pictures.sheet(0.5)).astype(int)
    assert np.abs(read(f"{stem}.pictures.png") - expected).max() <= 1


@pytest.mark.slow
def test_report_for_people(folder):
    options = ("--probe", "probe.exr", *SMALL, "-o", "out")
    out = done("analyze", "--brdf", "phong:exponent=32", *options)
    lines = out.splitlines()
    assert lines[:4] == [
        "phong:exponent=32",
        "  eps 0.1     F = 8, P = 0 (91.67% of the energy)",
        "  eps 0.03    F = 10, P = 0 (97.62% of the energy)",
        "  eps 0.01    F = 12, P = 0 (99.48% of the energy)",
    ]
    assert lines[4] == "probe.exr, P = 0: accuracy of the reflected light"
    assert lines[5].split() == ["F", "accuracy", "minimum", "BRDF", "bound"]
    assert [line.split()[0] for line in lines[6:10]] == ["8", "10", "12", "32"]
    # This light ends at degree 3, so that all of what it makes is kept.
    assert lines[6].split()[1:4] == ["100.00%", "100.00%", "91.67%"]
    assert lines[10] == "pictures, F = 32: relative RMS error"
    assert lines[11].split() == ["P", "energy", "predicted", "0,0", "90,30"]
    assert lines[12].split()[:3] == ["0", "100.00%", "0.00%"]
    assert lines[13:] == [f"wrote out.{kind}.png" for kind in ("energy", "accuracy", "pictures")]
    before = snapshot(folder)
    assert done("analyze", "--brdf", "phong:exponent=32", *options, "--quiet") == ""
    assert snapshot(folder) == before  # the same bytes again


@pytest.mark.slow
def test_lambert(folder, blank):
    result = analyzed("--brdf", "lambertian", "--probe", "probe.exr", "--eps", 0.05, *SMALL)
    assert [(row["order_f"], row["order_p"]) for row in result["orders"]] == [(2, 0)]
    assert len(result["pictures"]["orders"]) == 1
    assert max(result["pictures"]["orders"][0]["errors"]) < 0.01


def test_orders_asked_for(folder, blank):
    result = analyzed("--brdf", "microfacet", "--order-f", 6, "--order-p", 3, "--probe",
                      "probe.exr", *SMALL)  # fmt: skip
    assert np.shape(result["brdf_energy_captured"]) == (7, 4)
    assert result["accuracy"]["order_p"] == 3
    assert len(result["accuracy"]["accuracy"]) == 7
    assert len(result["pictures"]["orders"]) == 4


def test_order_p_of_a_zonal_brdf_is_zero(folder):
    result = run("analyze", "--brdf", "phong", "--order-p", 3, "--no-plots")
    assert result.code == 0
    assert result.err == (
        "Warning: phong:exponent=32: does not depend on the view, so P = 0 only\n"
    )


@pytest.mark.slow
def test_black_probe(folder, blank):
    write_exr(folder / "black.exr", np.zeros((16, 32, 3), dtype=np.float32))
    options = ("--order-f", 6, "--eps", 0.3, *SMALL)
    result = run("analyze", "--brdf", "microfacet", "--probe", "black.exr", *options, "--json")
    assert (result.code, result.err) == (0, "Warning: black.exr: the probe is black\n")
    result = json.loads(result.out)
    for name in ("accuracy", "estimate_bound"):
        assert set(result["accuracy"][name]) == {1}
    assert result["pictures"]["exposure"] == 0
    assert all(row["errors"] == [0, 0] for row in result["pictures"]["orders"])
    assert all(row["predicted_error"] == 0 for row in result["pictures"]["orders"])


def test_exact_pictures_of_a_fine_probe_are_of_its_own_pixels(folder, monkeypatch):
    """They took a minute, summed over all pixels of a probe whose lamps averaging had moved."""
    image = noise(160, 320)
    image[40, 77] = 3000
    write_exr(folder / "fine.exr", image)
    options = ("--probe", "fine.exr", "--size", 16, "--view", "0,0", "--brdf", "ggx", "--eps", 0.1)
    made = []

    class Recorded(Reference):
        def __init__(self, *arguments, **named):
            super().__init__(*arguments, **named)
            made.append(self)

    monkeypatch.setattr(analyze, "Reference", Recorded)
    found = analyzed(*options)["pictures"]
    assert found["source_height"] is None
    assert made[0].error is not None  # None of full sums
    grid = energy_grid(parse_spec("ggx"), [0.1])
    probe = open_probe(folder / "fine.exr")
    lighting = project(probe, grid.coefficients.order_f)
    truth = Reference(probe, parse_spec("ggx"), exact=True)
    pictures = order_pictures(
        lighting, grid.coefficients, "reflection", [Viewer(0, 0)], found["order_f"], 16, truth
    )
    for p, row in enumerate(found["orders"]):
        assert row["errors"] == [pytest.approx(pictures.error(p, 0), rel=0.01)]
    assert analyzed(*options, "--source-height", 8)["pictures"]["source_height"] == 8


@pytest.mark.slow
def test_prefix_and_folder(folder, blank):
    (folder / "charts").mkdir()
    quick = ("--brdf", "phong:exponent=2", "--eps", 0.1, "--order-f", 6)
    for prefix, stem in (
        ("charts", "phong-exponent-2"),
        ("charts/a", "a"),
        ("charts/b.png", "b"),
    ):
        assert analyzed(*quick, "-o", prefix)["files"] == [f"charts/{stem}.energy.png"]
    assert names(folder / "charts") == [
        "a.energy.png", "b.energy.png", "phong-exponent-2.energy.png",
    ]  # fmt: skip


def test_numbers_alone_write_nothing(folder):
    before = snapshot(folder)
    result = analyzed("--brdf", "microfacet", "--probe", "probe.exr", "--no-plots")
    assert result["files"] == []
    assert result["pictures"] is None
    assert len(result["accuracy"]["accuracy"]) == 33
    assert snapshot(folder) == before


def test_without_matplotlib_numbers_and_pictures_still_come(folder, without_matplotlib):
    result = run("analyze", "--brdf", "phong", "--probe", "probe.exr", *SMALL, "--json")
    assert result.code == 0
    assert result.err == NO_CHARTS
    values = json.loads(result.out)
    assert values["files"] == ["probe.phong.pictures.png"]
    assert names(folder) == ["probe.exr", "probe.phong.pictures.png"]
    assert len(values["accuracy"]["accuracy"]) == 33
    assert NO_CHARTS.endswith(f"{values['warnings'][0]}\n")
    assert run("analyze", "--brdf", "phong", "--no-plots").err == ""
    assert run("analyze", "--brdf", "phong", "--quiet").err == ""


@pytest.mark.parametrize(
    ("arguments", "code", "parts"),
    [
        (("--size", 32), 2, ("--size applies with --probe", "leave it out")),
        (("--view", "1,2"), 2, ("--view applies with --probe",)),
        (("--yaw", 3), 2, ("--yaw applies with --probe",)),
        (("--no-plots", "-o", "x"), 2, ("exclude each other",)),
        (("--eps", 1), 2, ("not between 0 and 1",)),
        (("--order-f", 513), 2, ("513",)),
        (("--probe", "probe.exr", "--exposure", "nan"), 2, ("-32 .. 32",)),
        (("--probe", "none.exr"), 1, ("none.exr",)),
        (("-o", "none/x"), 1, ("none/x.energy.png", "there is no folder")),
        (("--probe", "probe.exr", "--size", 2048, *("--view", "0,0") * 40), 1, ("--size",)),
    ],
)
def test_what_is_refused(folder, arguments, code, parts):
    before = snapshot(folder)
    assert_refused(run("analyze", "--brdf", "phong", *arguments), code, *parts)
    assert snapshot(folder) == before


@pytest.mark.slow
def test_unknown_missing_and_brushed_brdfs_are_refused(folder):
    assert_refused(run("analyze", "--brdf", "fong"), 1, "did you mean phong")
    assert_refused(run("analyze"), 2, "--brdf")
    brushed = "ggx:roughness=0.3,anisotropy=0.5"
    for further in ((), ("lambertian",)):
        assert_refused(run("analyze", "--brdf", brushed, *further), 1, "anisotropic", "orders F")


@pytest.mark.slow
def test_lobes_that_meet_no_tolerance_are_analysed_too(folder):
    asked = "--brdf", "phong:exponent=1e5", "--eps", 0.05
    found = run("analyze", *asked, "--probe", "probe.exr", *SMALL)
    assert found.code == 0
    assert "Warning: phong:exponent=100000: tolerance 0.05 cannot be met" in found.err
    assert found.out.rstrip().endswith(".pictures.png")


def test_outputs_do_not_replace_the_probe(folder):
    pixels = np.zeros((4, 8, 3), dtype=np.float32)
    write_exr(folder / "a.exr", pixels).rename(folder / "x.pictures.png")
    refused = run("analyze", "--brdf", "phong", "--probe", "x.pictures.png", "-o", "x", *SMALL)
    assert_refused(refused, 1, "overwrite the input")
