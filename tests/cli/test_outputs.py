"""The names of files that commands choose, and when they replace what is there."""

import numpy as np
import pytest

from shrm_cli.naming import brdf_label, probe_stem
from shrm_cli.prefilter import prefilter
from tests.batch.helpers import edit, forget
from tests.cli.helpers import assert_refused, done, run, snapshot, write_exr

LONG = "+".join(["lambertian", *(f"0.1*phong:exponent={n}" for n in range(1, 16))])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a probe."""
    write_exr(tmp_path / "probe.exr", np.ones((8, 16, 3), np.float32))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "suffixes"),
    [
        (["prefilter", "probe.exr", "--size", "4"], [".shrm.exr"]),
        (["reference", "probe.exr", "--size", "16", "--exact"], [".reference.exr"]),
        (["analyze", "--order-f", "2", "--eps", "0.5"], [".energy.png"]),
    ],
)
def test_sums_of_any_length_have_a_name(folder, command, suffixes):
    before = set(folder.iterdir())
    done(*command, "--brdf", LONG)
    made = sorted(path.name for path in set(folder.iterdir()) - before)
    assert len(made) == len(suffixes)
    for name, suffix in zip(made, suffixes, strict=True):
        assert name.endswith(suffix)
        assert "lambertian+0.1-phong-exponent-1+" in name
        assert len(name) < 200


def test_probes_with_the_longest_names_have_maps_and_pictures(folder):
    name = f"{'ü' * 120}.exr"
    write_exr(folder / name, np.ones((8, 16, 3), np.float32))
    done("prefilter", name, "--brdf", LONG, "--size", "4", "--quiet")
    (made,) = folder.glob("*.shrm.exr")
    done("render", made.name, "--size", "16", "--quiet")
    assert made.with_suffix(".png").exists()


def test_long_names_that_begin_alike_are_told_apart():
    assert brdf_label(LONG) != brdf_label(LONG + "+phong")
    assert brdf_label("phong:exponent=32") == "phong-exponent-32"
    assert probe_stem("x" * 200 + "1.exr") != probe_stem("x" * 200 + "2.exr")
    assert probe_stem("folder/sky_%.exr") == "sky"


# ---- files that exist --------------------------------------------------------------------------

PREFILTER = ["prefilter", "probe.exr", "--brdf", "phong", "--to", "shrm"]
REFERENCE = ["reference", "probe.exr", "--brdf", "phong", "--size", "16", "--exact"]
CASES = {
    "tolerance": (PREFILTER, ["--eps", "0.1"], "--eps 0.03 there, 0.1 here"),
    "order": (PREFILTER, ["--order-f", "3"], "--order-f by default there, 3 here"),
    "precision": (PREFILTER, ["--precision", "float"], "--precision by default there"),
    "reading": (PREFILTER, ["--yaw", "20"], "how the probe is read"),
    "clamp": (PREFILTER, ["--clamp", "2"], "how the probe is read"),
    "window": (
        ["prefilter", "probe.exr", "--to", "irradiance"], ["--window", "hann"],
        '--window "auto" there, "hann" here',
    ),
    "split sum": (
        ["prefilter", "probe.exr", "--to", "splitsum"], ["--levels", "3"],
        "--levels by default there, 3 here",
    ),
    "exponential": (
        ["prefilter", "probe.exr", "--to", "she"], ["--roughness", "0.3..1"],
        "--roughness [0.45, 1.0] there, [0.3, 1.0] here",
    ),
    "sum": (
        ["prefilter", "probe.exr", "--brdf", "0.5*lambertian+0.5*phong"], ["--no-split"],
        "--split by default there, false here",
    ),
    "reference": (REFERENCE, ["--view", "30,10"], "other inputs or options"),
    "reference read otherwise": (REFERENCE, ["--mirror"], "other inputs or options"),
    "table": (["dfg", "--size", "4"], ["--multiscatter"], "other inputs or options"),
    "conversion": (["convert", "probe.exr", "--to", "strip"], ["--size", "2"], "other inputs"),
    "faces": (["convert", "probe.exr", "--to", "faces"], ["--size", "2"], "other inputs"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_other_options_made_is_kept_under_default_names(folder, case):
    command, options, words = CASES[case]
    done(*command)
    made = snapshot(folder)
    done(*command)  # the same again
    assert snapshot(folder) == made
    assert_refused(run(*command, *options), 1, "exists, and", words, "--force", "--output")
    assert snapshot(folder) == made
    assert run(*command, *options, "--force").code == 0
    assert snapshot(folder) != made
    assert_refused(run(*command), 1, "exists, and")


def test_what_is_named_is_replaced(folder):
    done(*PREFILTER, "-o", "probe.phong.shrm.exr")
    done(*PREFILTER, "--eps", "0.1", "-o", "probe.phong.shrm.exr")
    done("dfg", "--size", "4")
    done("dfg", "--size", "5", "-o", "dfg.exr")
    done("render", "probe.phong.shrm.exr", "--size", "16")
    done("render", "probe.phong.shrm.exr", "--size", "20")  # pictures are to look at


def test_an_edited_map_is_kept_and_a_damaged_one_is_not(folder):
    """What shrm made may be replaced; what somebody has made of it since may not."""
    done(*PREFILTER)
    path = folder / "probe.phong.shrm.exr"
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    done(*PREFILTER)
    assert path.read_bytes() == whole
    edit(path)
    edited = path.read_bytes()
    assert_refused(run(*PREFILTER), 1, "exists, and it was changed since shrm made it", "--force")
    assert path.read_bytes() == edited
    done(*PREFILTER, "--force")
    assert path.read_bytes() == whole


BY_COMMAND = [
    (REFERENCE, "probe.phong.reference.exr"),
    (["product", "phong", "--size", "8", "--order", "1"], "phong.product.exr"),
    (["dfg", "--size", "4"], "dfg.exr"),
    (["convert", "probe.exr", "--to", "strip"], "probe.strip.exr"),
]


@pytest.mark.parametrize(("command", "name"), BY_COMMAND)
def test_what_was_edited_is_kept_by_every_command(folder, command, name):
    done(*command)
    edit(name)
    edited = (folder / name).read_bytes()
    assert_refused(run(*command), 1, f"{name}: exists, and", "--force")
    assert (folder / name).read_bytes() == edited
    done(*command, "--force")


def test_maps_of_earlier_versions_are_known_by_what_they_record(folder):
    """They have no digests, and left out the options that nobody gave."""
    done(*PREFILTER)
    path = folder / "probe.phong.shrm.exr"
    forget(path)
    done(*PREFILTER)
    forget(path)
    assert_refused(run(*PREFILTER, "--eps", "0.1"), 1, "--eps 0.03 there, 0.1 here")


@pytest.mark.slow
def test_another_probe_and_another_file_of_that_name_are_kept_apart(folder):
    done(*PREFILTER)
    write_exr(folder / "probe.exr", np.full((8, 16, 3), 2, np.float32))
    assert_refused(run(*PREFILTER), 1, "another probe made it, or another version of this one")
    done("brdf", "lambertian", "--save", "matte.exr")
    command = ["prefilter", "probe.exr", "--brdf", "matte.exr", "--order-f", "2", "--order-p", "0"]
    assert run(*command).code == 0
    done("brdf", "lambertian:albedo=0.5", "--save", "matte.exr")
    refused = run(*command)
    assert_refused(refused, 1, "it is for another BRDF")
    (folder / "probe.ggx.shrm.exr").write_text("my notes")
    refused = run("prefilter", "probe.exr", "--brdf", "ggx")
    assert_refused(refused, 1, "it is no map that can be read")
    assert (folder / "probe.ggx.shrm.exr").read_text() == "my notes"


def test_maps_of_the_library_are_recognised(folder):
    """The default tolerance is the same, named or not; so are bytes of commands and library."""
    prefilter("probe.exr", "phong", eps=0.03).save("probe.phong.shrm.exr")
    done(*PREFILTER)
    done(*PREFILTER, "--eps", "0.03")
    prefilter("probe.exr", "phong", to="shrm").save("again.exr")
    assert (folder / "again.exr").read_bytes() == (folder / "probe.phong.shrm.exr").read_bytes()
    assert_refused(run(*PREFILTER, "--size", "16"), 1, "--size by default there, 16 here")


@pytest.mark.parametrize(("command", "name"), BY_COMMAND)
@pytest.mark.parametrize("left", [0, 200, -100])
def test_what_was_cut_is_made_anew_by_every_command(folder, command, name, left):
    done(*command)
    path = folder / name
    whole = path.read_bytes()
    path.write_bytes(whole[:left])
    done(*command)
    assert path.read_bytes() == whole
