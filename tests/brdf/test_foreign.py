"""Classes of users are checked before work begins, named by a file or passed to a function."""

import json
import warnings

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.brdf.core import Core
from shrm_cli.brdf.foreign import check_instance
from shrm_cli.brdf.library import built_in_names, find_model
from shrm_cli.brdf.spec import as_brdf
from shrm_cli.brdf.sums import Sum
from shrm_cli.errors import BrdfError, ShrmWarning
from tests.brdf import foreign_classes as classes
from tests.cli.helpers import assert_refused, run

FILE = classes.__file__
WHITE = np.ones((8, 16, 3), np.float32)
UP = [0.0, 1.0, 0.0]
ANISOTROPIC = "write `isotropic = False` into the class"
ZONAL = "leave `zonal = True` out of the class"
INFINITE = "its value is not finite everywhere"
REFUSED = {
    "Brushed": ANISOTROPIC,
    "Lit": ANISOTROPIC,
    "CutCosine": ZONAL,
    "ZonalMinnaert": ZONAL,
    "ZonalBlinn": ZONAL,
    "NoNumber": INFINITE,
    "Negative": "its value is negative",
    "NoChannels": "evaluate() returns the shape (6, 6)",
    "Scalar": "evaluate() returns 0.3, not an array of floats",
    "Exits": "cannot be evaluated: SystemExit",
}
SOUND = "Blinn", "InFloats", "Told", "Cosine", "ZonalNormal", "Band", "Writes"


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_wrong_is_refused_where_it_is_named(name):
    assert_refused(run("brdf", f"{FILE}:{name}"), 1, f"{name}", REFUSED[name])


@pytest.mark.parametrize("name", [*REFUSED, "NoSuper"])
def test_what_is_wrong_is_refused_where_it_is_passed(name):
    words = REFUSED.get(name, "lacks super().__init__(**values)")
    calls = [
        lambda brdf: shrm.prefilter(WHITE, brdf),
        lambda brdf: shrm.reference(WHITE, brdf, UP, UP),
        lambda brdf: shrm.examine(brdf),
    ]
    for call in calls:
        with pytest.raises(BrdfError) as caught:
            call(getattr(classes, name)())
        assert str(caught.value).startswith(name)
        assert words in str(caught.value)
        assert "\n" not in str(caught.value)


def test_terms_of_sums_are_checked():
    with pytest.raises(BrdfError, match="Lit: it changes where"):
        shrm.examine(Sum([(0.5, shrm.parse_spec("lambertian")), (0.5, classes.Lit())]))


@pytest.mark.parametrize("along", [0.002, 0.02, 0.2, 0.9])
def test_brushed_lobes_of_all_widths_are_noticed(along):
    with pytest.raises(BrdfError, match="anisotropic"):
        check_instance(classes.Brushed(along=along, across=along / 2), "it")
    check_instance(classes.Brushed(along=along, across=along), "it")


@pytest.mark.parametrize("name", SOUND)
def test_what_is_sound_passes(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for values in ({}, {"roughness": 0.0}, {"roughness": 0.1}, {"roughness": 1.0}):
            model = getattr(classes, name)
            known = {each.name for each in model.parameters}
            if known >= values.keys():
                check_instance(model(**values), name)


@pytest.mark.parametrize("name", built_in_names())
def test_models_of_shrm_would_pass(name):
    """What they state of themselves is true, which other tests show: so these are no mistakes."""
    model = find_model(name)
    made = [model()]
    made += [made[0].at_roughness(each) for each in (0.1, 1.0) if "roughness" in made[0].values]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for each in made:
            check_instance(each, name)


def test_models_of_shrm_are_not_evaluated_where_they_are_passed(monkeypatch):
    brdf = shrm.parse_spec("ggx:roughness=0.4")

    def fail(*_):
        raise AssertionError

    monkeypatch.setattr(type(brdf), "evaluate", fail)
    assert as_brdf(brdf) is brdf


def test_an_object_is_checked_once():
    brdf = classes.Blinn()
    as_brdf(brdf)
    brdf.evaluate = None
    assert as_brdf(brdf) is brdf


def test_what_is_negative_in_places_is_told_once():
    words = "its value is negative in places, -0.125 in red"
    result = run("brdf", f"{FILE}:NegativeRed")
    assert result.code == 0
    assert result.err.count("negative") == 1
    assert words in result.err
    with pytest.warns(ShrmWarning, match=words) as told:
        shrm.examine(classes.NegativeRed())
    assert len(told) == 1


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Band", INFINITE),
        ("AtZero", INFINITE),
        ("NegativeRough", "it reflects less than nothing"),
    ],
)
def test_values_that_the_check_misses_are_one_line(tmp_path, name, words):
    """They were internal errors: no ray from the center was near to the peak."""
    spec, probe, out = f"{FILE}:{name}", tmp_path / "p.exr", tmp_path / "out.exr"
    run("probe", "studio", "--size", 8, "-o", probe)
    commands = [
        ("dfg", "--brdf", spec, "--size", 8, "-o", out),
        ("prefilter", probe, "--to", "splitsum", "--brdf", spec, "-o", out),
    ]
    if name == "Band":
        commands += [("reference", probe, "--brdf", spec, "-o", out), ("brdf", spec)]
    for command in commands:
        assert_refused(run(*command), 1, words)
        assert not out.exists()


@pytest.mark.parametrize(("name", "words"), [("NoNumber", INFINITE), ("Negative", "is negative")])
def test_a_core_without_a_peak_is_refused(name, words):
    with pytest.raises(BrdfError, match=words):
        Core.of(getattr(classes, name)())


def test_a_class_that_cannot_be_made_of_a_roughness_is_one_line(tmp_path):
    probe, out = tmp_path / "p.exr", tmp_path / "out.exr"
    run("probe", "studio", "--size", 8, "-o", probe)
    result = run(
        "prefilter",
        probe,
        "--to",
        "splitsum",
        "--brdf",
        f"{FILE}:Divides",
        "-o",
        out,
        "--levels",
        "0,0.5,1",
    )
    assert_refused(result, 1, "Divides cannot be made with roughness=0: ZeroDivisionError")
    with pytest.raises(BrdfError, match="Divides cannot be made with roughness=0: ZeroDiv"):
        classes.Divides().with_values(roughness=0)


def test_a_class_that_ends_the_program_is_refused_whenever_it_does():
    assert_refused(run("brdf", f"{FILE}:ExitsLater"), 1, "evaluate() fails: SystemExit: too many")


@pytest.fixture
def split_sum(tmp_path, monkeypatch):
    """The probe, the split sum of a class, and the same in a file, in the current folder."""
    monkeypatch.chdir(tmp_path)
    run("probe", "studio", "--size", 16, "-o", "p.exr")
    made = shrm.prefilter("p.exr", classes.Tinted(part=0.25), to="splitsum", levels=[0.5, 1.0])
    made.save("m.exr", "float")
    return made


def test_a_split_sum_of_a_class_is_compared_by_the_class(split_sum):
    views = [(0.0, 0.0), (120.0, 20.0), (240.0, -20.0)]  # those of the command
    at = {"probe": "p.exr", "roughness": 0.75, "size": 32, "views": views}
    brdf = classes.Tinted(part=0.25, roughness=0.75)
    found = shrm.compare([shrm.open_map("m.exr")], brdf=brdf, **at)
    expected = shrm.compare([split_sum], brdf=brdf, **at)
    for one, other in zip(found.numbers()["summary"], expected.numbers()["summary"], strict=True):
        assert one["relative_rmse"] == pytest.approx(other["relative_rmse"], rel=1e-4)
    assert found.warnings == expected.warnings
    spec = f"{FILE}:Tinted:part=0.25,roughness=0.75"
    result = run("compare", "m.exr", "--probe", "p.exr", "--roughness", 0.75, "--size", 32,
                 "--brdf", spec, "--no-picture", "--no-flip", "--json")  # fmt: skip
    assert result.code == 0
    row = json.loads(result.out)["summary"][0]
    assert row["relative_rmse"] == pytest.approx(
        found.numbers()["summary"][0]["relative_rmse"], rel=1e-6
    )


def test_a_class_shows_a_split_sum_with_the_values_that_it_records(split_sum):
    back = shrm.open_map("m.exr").with_class(classes.Tinted(part=1.0))
    up = np.array(UP)
    found, expected = (each.shaded(0.75, (1, 1, 1)).radiance(up, up) for each in (back, split_sum))
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_a_page_shows_a_split_sum_of_a_class(split_sum):
    spec = f"{FILE}:Tinted:part=0.25,roughness=0.75"
    result = run("view", "m.exr", "--probe", "p.exr", "--roughness", 0.75, "--brdf", spec,
                 "--truth-size", 16, "-o", "v.html")  # fmt: skip
    assert result.code == 0


@pytest.mark.parametrize(
    "command",
    [
        ("render", "m.exr", "-o", "r.png"),
        ("view", "m.exr", "-o", "v.html"),
        ("compare", "m.exr", "--probe", "p.exr", "--no-picture"),
        ("compare", "m.exr", "--probe", "p.exr", "--no-picture", "--brdf", f"{FILE}:Blinn"),
    ],
)
def test_a_split_sum_of_an_unknown_class_tells_what_takes_it(split_sum, command):
    words = (
        "m.exr: a split sum of tinted:part=0.25,roughness=1, which cannot be evaluated (no BRDF is "
        "called 'tinted'); if it is a class in a file of yours, compare and view take that as "
        "--brdf, with --probe"
    )
    assert_refused(run(*command), 1, words)
