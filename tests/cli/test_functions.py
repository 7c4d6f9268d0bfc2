"""Functions of the library do what the commands do: the same numbers, the same pixels."""

import json
import shutil
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

import shrm_cli as shrm
from tests.batch.helpers import work_here
from tests.cli.helpers import done


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a probe and two maps of it."""
    folder = tmp_path_factory.mktemp("made")
    done("probe", "studio", "--size", "32", "-o", folder / "probe.exr")
    probe = shrm.open_probe(folder / "probe.exr")
    shrm.prefilter(probe, "lambertian", eps=0.01).save(folder / "white.exr")
    shrm.prefilter(probe, to="splitsum", size=16).save(folder / "chain.exr")
    return folder


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    """The current folder, with the probe and its maps."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_compare(folder):
    told = json.loads(
        done("compare", "white.exr", "--probe", "probe.exr", "--size", "16", "--no-flip", "--json",
             "--no-picture", "--view", "30,10")
    )  # fmt: skip
    found = shrm.compare(["white.exr"], "probe.exr", size=16, views=[(30.0, 10.0)])
    assert found.numbers() == {"views": told["views"], "summary": told["summary"]}
    assert found.truth.error == told["truth_error"]
    with pytest.raises(shrm.ArgumentError, match="nothing to be compared with"):
        shrm.compare(["white.exr"])


def test_render(folder):
    done("render", "chain.exr", "--size", "32", "--view", "30,10", "--roughness", "0.3",
         "--background", "probe.exr", "-o", "ball.exr", "--precision", "float")  # fmt: skip
    with OpenEXR.File("ball.exr") as file:
        written = file.channels()["RGB"].pixels
    drawn = shrm.render("chain.exr", (30, 10), 32, roughness=0.3, background="probe.exr")
    np.testing.assert_array_equal(written, drawn)


def test_convert(folder):
    done("convert", "white.exr", "--to", "cabral", "-o", "by-command.exr")
    made = shrm.Map.converted(shrm.open_map("white.exr"), "cabral")
    made.save("by-function.exr", "float")
    np.testing.assert_array_equal(
        np.stack(shrm.open_map("by-command.exr").planes()),
        np.stack(shrm.open_map("by-function.exr").planes()),
    )
    done("convert", "probe.exr", "--to", "hcross", "--size", "8", "-o", "cross.exr",
         "--precision", "float")  # fmt: skip
    written = shrm.convert("white.exr", "cabral").save("by-function.exr")
    told = json.loads(
        done("convert", "white.exr", "--to", "cabral", "-o", "by-command.exr", "--json")
    )
    assert {**written.result, "file": "by-command.exr", "warnings": written.warnings} == told
    assert (folder / "by-function.exr").read_bytes() == (folder / "by-command.exr").read_bytes()
    cross = shrm.to_layout(shrm.open_probe("probe.exr"), "hcross", size=8)
    again = shrm.to_layout(shrm.open_probe("cross.exr"), "hcross", size=8)
    np.testing.assert_allclose(again, cross, rtol=1e-6, atol=1e-6)


def test_an_array_is_a_probe_that_is_converted(folder):
    pixels = np.ones((16, 32, 3), np.float32)
    shrm.convert(pixels, "openexr", size=4).save("cube.exr")
    assert shrm.open_probe("cube.exr").layout == "openexr"
    with pytest.raises(shrm.ArgumentError, match="array is no map"):
        shrm.convert(pixels, "cabral")


def test_what_is_no_path_is_said_in_one_line(folder):
    pixels = np.ones((16, 32, 3), np.float32)
    for function in (shrm.open_probe, shrm.open_map):
        with pytest.raises(shrm.ArgumentError, match=r"^`path` array\(.*Probe.from_array$"):
            function(pixels)


def test_info(folder):
    told = json.loads(done("info", "white.exr", "--json"))
    assert {"file": "white.exr", **shrm.describe("white.exr").facts, "warnings": []} == told
    assert shrm.open_map("white.exr").summary().items() <= told.items()
    told = json.loads(done("info", "probe.exr", "--json"))
    found = shrm.probe_statistics(shrm.open_probe("probe.exr")).summary()
    assert json.loads(json.dumps(found))["stops"] == told["stops"]
    found = shrm.describe("probe.exr")
    assert json.loads(json.dumps(found.facts))["stops"] == told["stops"]
    assert (found.is_probe, list(found.warnings)) == (True, told["warnings"])


def test_light_edit(folder):
    told = json.loads(
        done("light", "edit", "probe.exr", "--order", "3", "--scale", "2", "-o", "twice.npy",
             "--json")
    )  # fmt: skip
    twice = shrm.Edit([], 2 * np.ones(3), [], np.eye(3))
    found, warnings = shrm.edit_light("probe.exr", twice, order=3)
    assert told["coefficients"] == found.tolist()
    assert warnings == []


def test_contact(folder):
    done("contact", "white.exr", "chain.exr", "-o", "page.html")
    found = shrm.draw_contacts(["white.exr", "chain.exr"])
    page = shrm.contact_page(found, "page.html")
    assert len(found.maps) == 2
    assert page.count("<img") == (folder / "page.html").read_text().count("<img") == 2


def test_dfg_and_product_and_transfer(folder):
    done("dfg", "--size", "8", "--brdf", "charlie", "-o", "dfg.exr", "--precision", "float")
    table = shrm.dfg("charlie", size=8)
    told = json.loads(done("dfg", "--size", "8", "--brdf", "charlie", "-o", "dfg.exr", "--json"))
    assert told["maximum"] == table.texels.max()
    assert (told["columns"], told["brdf"]) == (table.kind, table.brdf)
    with pytest.raises(shrm.ArgumentError, match="kind"):
        shrm.dfg("charlie", kind="gltf")
    done("product", "ggx", "--order", "2", "--size", "16", "-o", "ggx.exr", "--precision", "float")
    np.testing.assert_allclose(
        shrm.open_map("ggx.exr").table, shrm.product("ggx", 2, 16).table, rtol=1e-6, atol=1e-7
    )


def test_analyze(folder):
    told = json.loads(
        done("analyze", "--brdf", "lambertian", "--probe", "probe.exr", "--no-plots", "--json")
    )
    found = shrm.analyze("lambertian", "probe.exr")
    assert found.grid.captured.tolist() == told["brdf_energy_captured"]
    assert found.curve.accuracy.tolist() == told["accuracy"]["accuracy"]


def test_view_and_lookdev_and_report(folder):
    done("view", "white.exr", "--lossless", "-o", "page.html")
    assert shrm.view(["white.exr"]).html() == (folder / "page.html").read_text()
    done("lookdev", "probe.exr", "--brdf", "lambertian", "--size", "16", "-o", "sheet.html")
    made = shrm.lookdev(["probe.exr"], ["lambertian"], size=16)
    assert made.page(shrm.Viewer(0, 0)) == (folder / "sheet.html").read_text()


def test_batch(folder, monkeypatch):
    work_here(monkeypatch)
    entry = shrm.Entry(("probe.exr",), to=("irradiance",))
    looked = shrm.batch([entry], jobs=1, terms=shrm.Terms(only_looks=True))
    assert (looked.waiting, looked.made) == (1, 0)
    assert not (folder / "probe.irradiance.exr").exists()
    assert shrm.batch([entry], jobs=1).made == 1
    assert shrm.open_map("probe.irradiance.exr").representation == "irradiance"
    assert shrm.batch([entry], jobs=1).skipped == 1


def test_one_of_what_may_be_several_stands_for_itself(folder):
    """A name was taken for its letters: ``'w': no such file``, or no BRDF is called 'l'."""
    white = shrm.open_map("white.exr")
    several = shrm.compare([white], "probe.exr", size=16).numbers()
    assert shrm.compare(white, "probe.exr", size=16).numbers() == several
    assert shrm.compare("white.exr", "probe.exr", size=16).names == ("white.exr",)
    assert shrm.view("white.exr").html() == shrm.view(["white.exr"]).html()
    assert shrm.lookdev("probe.exr", "lambertian", size=16).sides == ["lambertian"]
    page = shrm.report("probe.exr", "lambertian", "shrm", picture_size=16)
    assert len(page.measured.summary()) == 1
    assert shrm.unwrap_balls("probe.exr", circles=[(32, 16, 15)], size=8).pixels.shape == (8, 16, 3)
    assert len(shrm.draw_contacts(Path("white.exr")).maps) == 1
    entry = shrm.Entry(Path("probe.exr"), "lambertian", "shrm")
    assert (entry.probes, entry.brdfs, entry.to) == (("probe.exr",), ("lambertian",), ("shrm",))
    assert shrm.batch(entry, jobs=1, terms=shrm.Terms(only_looks=True)).jobs == 1
    assert shrm.lookdev(iter([Path("probe.exr")]), "lambertian", size=16).failures == []
    with pytest.raises(shrm.ProbeError, match=r"probe\.exr: is one exposure"):
        shrm.merge_brackets("probe.exr")


@pytest.mark.parametrize("function", [shrm.render, shrm.compare, shrm.view])
def test_no_map_is_said_in_one_line(function):
    with pytest.raises(shrm.ArgumentError, match="`maps` are none; name one at least"):
        function([])
