"""`shrm compare PROBE --representations`: the table, the JSON, the sheet, and bad input."""

import json
import re
import sys
from dataclasses import replace

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.analysis import representations
from shrm_cli.errors import OrderError
from shrm_cli.maps.shrm import prefilter as shrm
from shrm_cli.maps.splitsum import prefilter as splitsum
from tests.cli.helpers import (
    assert_refused,
    done,
    polynomial_light,
    run,
    snapshot,
    told_to_bars,
    write_exr,
)
from tests.oracles import latlong_pixels
from tests.render.materials import furnace

NAMES = ["shrm", "principal", "splitsum", "she", "cabral"]
SINGLE = ("shrm", "principal", "cabral")
"""Representations that are made for one roughness."""
TITLES = ["SHRM", "principal functions", "split sum", "SH exponential", "Cabral"]
QUICK = ["--representations", "--eps", 0.1, "--size", 16, "--source-height", 8, "--view", "30,10"]
TWO = [*QUICK, "--roughness", "0.6..1", "--steps", 2]
SUMMED = [*QUICK, "--exact"]
TWO_SUMMED = [*TWO, "--exact"]
"""Sums over few pixels, for what does not depend on how a truth is found."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a smooth probe and a map; split sums of two levels are quick."""
    make = splitsum.prefilter

    def quick(probe, request):
        return make(probe, replace(request, size=16, own={**request.own, "levels": (0.5, 1.0)}))

    monkeypatch.setattr(splitsum, "prefilter", quick)
    directions = latlong_pixels(32, 16)
    write_exr(tmp_path / "room.exr", polynomial_light(directions).astype(np.float32))
    furnace((1, 1, 1)).save(tmp_path / "white.shrm.exr")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def only_shrm(monkeypatch):
    """For what does not depend on the other representations: they take a second."""
    monkeypatch.setattr(representations, "COMPARED", ("shrm",))


def told(*arguments):
    """Standard JSON, without NaN and infinities."""

    def refuse(name):
        raise AssertionError(name)

    return json.loads(done("compare", *arguments, "--json"), parse_constant=refuse)


def without_times(value):
    for each in value["representations"]:
        each.pop("seconds")
    return value


@pytest.mark.slow
def test_json(folder):
    """All but the times is the same again."""
    before = snapshot(folder)
    value = told("room.exr", *TWO, "--f0", "1/0.5/0.5")
    assert snapshot(folder) == before
    assert (value["roughness"], value["f0"]) == ([0.6, 1], [1, 0.5, 0.5])
    assert (value["epsilon"], value["size"], value["views"]) == (0.1, 16, [[30, 10]])
    assert (value["source_height"], value["picture"]) == (8, None)
    assert [each["representation"] for each in value["representations"]] == NAMES
    for each in value["representations"]:
        assert each["files"] == (2 if each["representation"] in SINGLE else 1)
        assert 100 < each["bytes"] < 10_000_000
        assert each["seconds"] > 0
        assert each["failures"] == []
        assert len(each["relative_rmse"]) == 2
        low, high = sorted(each["relative_rmse"])
        assert 0 < low <= each["relative_rmse_of_all"] <= high < 0.4
        for key in ("median_relative_error", "p95_relative_error", "wrong_share", "negative_share"):
            low, high = sorted(each[key])
            assert 0 <= low <= each[f"{key}_of_all"] <= high < 0.5
        assert 0 < each["median_relative_error_of_all"] < each["p95_relative_error_of_all"]
    lines = done("compare", "room.exr", *TWO, "--f0", "1/0.5/0.5").splitlines()
    assert lines[0] == (
        "room.exr on GGX of f0 1/0.5/0.5: relative RMS error by roughness; the truth is "
        "summed adaptively, 95 % within 0.00%"
    )
    assert lines[1].split() == ["files", "storage", "build", "0.6", "1", "all", "p95"]
    for line, title, each in zip(lines[2:7], TITLES, value["representations"], strict=True):
        assert line.startswith(title + "  ")
        cells = line[len(title) :].split()
        assert cells[0] == str(each["files"])
        errors = [*each["relative_rmse"], each["relative_rmse_of_all"]]
        errors.append(each["p95_relative_error_of_all"])
        assert cells[-4:] == [f"{error:.2%}" for error in errors]
        assert cells[2] in ("B", "kB")
        assert cells[4] == "s"
    assert lines[7:] == [
        "p95: the 95th percentile of the relative error over all the pixels of the spheres.",
        "SHRM, principal functions and Cabral need a file for each roughness, all counted; the "
        "others serve all.",
    ]
    assert len({len(line) for line in lines[1:7]}) == 1  # the columns are flush


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize(("eps", "low"), [(0.1, 0.6), (0.03, 1)])
def test_storage_is_that_of_the_files_that_shrm_prefilter_writes(folder, eps, low):
    """Byte for byte: the table takes no way of its own, with other terms or orders."""
    pixels = np.full((16, 32, 3), 0.2, np.float32)
    pixels[4:6, 9:12] = [30, 20, 10]
    write_exr(folder / "lamp.exr", pixels)
    range_of = ["--roughness", "0.6..1", "--steps", 2] if low < 1 else ["--roughness", 1]
    value = told("lamp.exr", *QUICK, "--eps", eps, *range_of, "--f0", "1/0.5/0.5")
    found = {each["representation"]: each["bytes"] for each in value["representations"]}
    surfaces = [f"ggx:roughness={r},f0=1/0.5/0.5" for r in sorted({low, 1})]
    brdfs = [["--eps", eps, "--brdf", surface] for surface in surfaces]
    shared = {"splitsum": [[]], "she": [["--roughness", f"{low}..1"]]}
    reports = {}
    for name in NAMES:
        total = 0
        for options in shared.get(name, brdfs):
            written = run("prefilter", "lamp.exr", "--to", name, *options, "-o", "x.exr")
            assert written.code == 0
            reports[name] = written.out
            total += (folder / "x.exr").stat().st_size
        assert found[name] == total, name
    assert "captured by the terms" in reports["shrm"]


@pytest.mark.slow
def test_the_same_again_and_nothing(folder, only_shrm):
    first, second = (without_times(told("room.exr", *TWO_SUMMED)) for _ in range(2))
    assert first == second
    assert done("compare", "room.exr", *TWO_SUMMED, "--quiet") == ""


def test_a_single_roughness(folder):
    value = told("room.exr", *SUMMED, "--roughness", 0.8)
    assert value["roughness"] == [0.8]
    assert [each["files"] for each in value["representations"]] == [1] * len(NAMES)
    for each in value["representations"]:
        assert each["relative_rmse"] == [each["relative_rmse_of_all"]]


def test_the_table_of_a_single_roughness(folder, only_shrm):
    header = done("compare", "room.exr", *SUMMED, "--roughness", 0.8).splitlines()[1]
    assert header.split() == ["files", "storage", "build", "0.8", "p95"]


def test_defaults(folder, monkeypatch):
    seen = []

    def note(probe, surfaces, tolerance, viewers, size, height, max_memory, exact):
        seen.append((surfaces, tolerance, viewers, size, height, max_memory, exact))
        raise OrderError("stop here")

    monkeypatch.setattr(representations, "plan_comparison", note)
    run("compare", "room.exr", "--representations")
    run("compare", "room.exr", "--representations", "-o", "x.png")
    (surfaces, *others), (*_, picture_size, _, _, _) = seen
    tolerance, viewers, size, height, max_memory, exact = others
    roughness = [each.number("roughness") for each in surfaces]
    np.testing.assert_allclose(roughness, [1 / 2, 2 / 3, 5 / 6, 1])
    assert {each.color("f0") for each in surfaces} == {(1, 1, 1)}
    assert (tolerance, len(viewers), size, height, picture_size) == (0.03, 3, 96, None, 128)
    assert (max_memory, exact) == (None, False)


@pytest.mark.slow
def test_the_sheet_has_a_row_for_each_roughness(folder):
    out = done("compare", "room.exr", *TWO_SUMMED, "-o", "sheet.exr", "--exposure", 1)
    layout = representations.table_layout(2, 16)
    assert layout.columns == 6
    height, width = layout.shape
    assert out.splitlines()[-1] == f"sheet.exr: {width} x {height}, half"
    image = oiio.ImageBuf("sheet.exr")
    pixels = image.get_pixels(oiio.FLOAT)
    for index in range(12):
        top, left = layout.origin(index)
        # No map is far from the truth, which stands in the first column.
        middle = pixels[top + 8, left + 8]
        expected = pixels[layout.origin(index // 6 * 6)[0] + 8, layout.origin(0)[1] + 8]
        assert expected.min() > 0.3
        np.testing.assert_allclose(middle, expected, rtol=0.3)
    recipe = json.loads(image.spec().get_string_attribute("shrm:recipe"))
    assert recipe["representations"] == NAMES
    assert (recipe["compare"], recipe["roughness"], recipe["exposure"]) == (
        ["room.exr"],
        [0.6, 1],
        1,
    )


def test_sheets_have_the_same_bytes_twice(folder, only_shrm):
    assert told("room.exr", *TWO_SUMMED, "-o", "s.exr")["picture"] == "s.exr"
    first = (folder / "s.exr").read_bytes()
    done("compare", "room.exr", *TWO_SUMMED, "-o", "s.exr")
    assert (folder / "s.exr").read_bytes() == first


def test_what_cannot_be_made_is_said(folder, monkeypatch):
    def fail(*_, **__):
        raise OrderError("too sharp")

    monkeypatch.setattr(shrm, "prefilter", fail)
    monkeypatch.setattr(representations, "COMPARED", ("shrm", "cabral"))
    result = run("compare", "room.exr", *TWO_SUMMED, "-o", "x.png")
    assert result.code == 0
    assert result.err.splitlines() == [
        "Warning: SHRM: roughness 0.6: too sharp",
        "Warning: SHRM: roughness 1: too sharp",
    ]
    assert result.out.splitlines()[2].split() == ["SHRM", "0", "-", "-", "-", "-", "-", "-"]
    assert result.out.splitlines()[3].startswith("Cabral")
    result = run("compare", "room.exr", *TWO_SUMMED, "--json")
    first = json.loads(result.out)["representations"][0]
    assert first["relative_rmse"] == [None, None]
    assert (first["relative_rmse_of_all"], first["bytes"]) == (None, 0)
    assert first["p95_relative_error"] == [None, None]
    assert first["p95_relative_error_of_all"] is None
    assert first["failures"] == ["roughness 0.6: too sharp", "roughness 1: too sharp"]


def test_black_light_has_no_relative_error(folder):
    write_exr("black.exr", np.zeros((8, 16, 3), np.float32))
    arguments = ["black.exr", *SUMMED, "--roughness", 0.8]
    result = run("compare", *arguments, "--json")
    assert result.code == 0
    for each in json.loads(result.out)["representations"]:
        assert each["relative_rmse_of_all"] in (0, None)


def test_probes_options_are_obeyed_and_warnings_told(folder, only_shrm):
    pixels = np.ones((8, 16, 3), np.float32)
    pixels[2, 3] = -1
    write_exr("negative.exr", pixels)
    result = run("compare", "negative.exr", *SUMMED, "--roughness", 0.8)
    assert result.err.startswith("Warning: negative.exr: 1 pixel with negative radiance")
    yawed = told("room.exr", *SUMMED, "--roughness", 0.8, "--yaw", 90)
    plain = told("room.exr", *SUMMED, "--roughness", 0.8)
    assert (
        yawed["representations"][0]["relative_rmse"]
        != (plain["representations"][0]["relative_rmse"])
    )


def test_sheets_that_show_nothing_say_which_exposure_does(folder, only_shrm):
    asked = ["compare", "room.exr", *SUMMED, "--roughness", 0.8, "-o", "sheet.png"]
    assert "--exposure" not in run(*asked).err
    line = run(*asked, "--exposure", -12).err
    better = re.search(r"sheet.png: all but black at an exposure of -12; --exposure (\S+)", line)[1]
    assert "--exposure" not in run(*asked, "--exposure", better).err


def test_progress(folder, only_shrm, monkeypatch):
    seen = told_to_bars(monkeypatch, "representations")
    done("compare", "room.exr", *TWO)
    steps = [step for step, _ in seen]
    assert len({total for _, total in seen}) == 1
    assert steps == sorted(steps)
    assert steps[-1] == seen[-1][1]
    assert len(set(steps)) > 3


USAGE = {
    "map": (["white.shrm.exr", *QUICK], "white.shrm.exr is a map; --representations takes a light"),
    "two": (["room.exr", "room.exr", *QUICK], "takes a single light probe, not 2 files"),
    "nothing": (QUICK, "MAP..."),
    "probe": (
        ["room.exr", *QUICK, "--probe", "room.exr"],
        "--probe applies without --representations",
    ),
    "brdf": (["room.exr", *QUICK, "--brdf", "phong"], "--brdf applies to maps, without --rep"),
    "amplify": (["room.exr", *QUICK, "--amplify", 2], "--amplify applies to maps, without --rep"),
    "no picture": (
        ["room.exr", *QUICK, "--no-picture"],
        "--no-picture applies to maps, without --rep",
    ),
    "exposure": (
        ["room.exr", *QUICK, "--exposure", 2],
        "--exposure applies to the picture, with -o",
    ),
    "steps": (["room.exr", *QUICK, "--roughness", 1, "--steps", 2], "--steps applies to a range"),
    "one step": (["room.exr", *QUICK, "--steps", 1], "--steps"),
    "eps": (["room.exr", "--representations", "--eps", 1], "--eps"),
    "range": (["room.exr", *QUICK, "--roughness", "0.01..1"], "--roughness"),
    "memory for maps": (
        ["white.shrm.exr", "white.shrm.exr", "--max-memory", "2GB"],
        "--max-memory",
    ),
    "memory": (["room.exr", *QUICK, "--max-memory", "2 ells"], "--max-memory"),
    "little memory": (["room.exr", *QUICK, "--max-memory", "1MB"], "--max-memory 1 MB is too"),
    "large pictures": (
        ["room.exr", *QUICK, "--size", 2048, "--steps", 32, "--max-memory", "2GB"],
        "or lower --size, --steps",
    ),
}


@pytest.mark.parametrize("case", USAGE)
def test_wrong_usage(folder, case):
    arguments, part = USAGE[case]
    before = snapshot(folder)
    assert_refused(run("compare", *arguments), 2, part)
    assert snapshot(folder) == before


REFUSED = {
    "missing": (["no.exr", *QUICK], "no.exr: no such file"),
    "onto the probe": (["room.exr", *QUICK, "-o", "room.exr"], "overwrite"),
    "jpeg": (["room.exr", *QUICK, "-o", "x.jpg"], ".png or .exr"),
    "too large": (
        ["room.exr", *QUICK, "--size", 2048, "--steps", 32, "-o", "x.png"],
        "give a smaller --size",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_before_anything_is_written(folder, case):
    arguments, part = REFUSED[case]
    before = snapshot(folder)
    assert_refused(run("compare", *arguments), 1, part)
    assert snapshot(folder) == before


def test_what_will_be_made_is_said_on_a_terminal_before_it_begins(folder, monkeypatch):
    seen = []

    def stop(plan, progress):
        seen.append((plan, progress, sys.stderr.getvalue()))
        raise OrderError("stop here")

    monkeypatch.setattr(representations, "compare_representations", stop)
    limited = [*TWO, "--max-memory", "1GiB"]
    run("compare", "room.exr", *limited, terminal=True)
    run("compare", "room.exr", *limited, "--quiet", terminal=True)
    run("compare", "room.exr", *limited)
    (plan, progress, said), quiet, elsewhere = seen
    # SHRM, principal functions and Cabral are made twice, for two roughnesses.
    assert said.splitlines() == [
        "room.exr: 2 pictures of 16 x 16 pixels of the truth, and as many of each of 5 "
        "representations",
        f"  8 maps of at most 32 MB each, and {plan.memory.needed / 1e9:.3g} GB of memory at most, "
        "of 1.07 GB allowed",
    ]
    assert progress is not None
    assert quiet[1:] == (None, "")
    assert elsewhere[2] == ""


def test_memory_is_in_the_json_and_limits_maps(folder, only_shrm, monkeypatch):
    most = told("room.exr", *SUMMED, "--roughness", 0.8)
    assert most["max_size"] == 32_000_000
    assert most["estimated_memory"] <= most["max_memory"]
    sizes = []
    make = shrm.prefilter

    def note(probe, request):
        sizes.append(request.max_size)
        return make(probe, request)

    monkeypatch.setattr(shrm, "prefilter", note)
    limit = most["estimated_memory"] // 2
    result = run(
        "compare", "room.exr", *SUMMED, "--roughness", 0.8, "--max-memory", limit, "--json"
    )
    value = json.loads(result.out)
    assert sizes == [value["max_size"]]
    assert value["max_size"] < 32_000_000
    assert value["estimated_memory"] <= limit == value["max_memory"]
    assert result.err.startswith("Warning: maps have at most ")
    assert "--max-memory" in result.err
