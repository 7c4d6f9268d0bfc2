"""The syntax that names BRDFs."""

from pathlib import Path

import pytest

from shrm_cli.brdf import library
from shrm_cli.brdf.base import value_text
from shrm_cli.brdf.spec import file_label, names_file, parse_spec
from shrm_cli.errors import BrdfError


def test_names_and_parameters():
    assert parse_spec("microfacet").values == {"sigma": 0.2}
    assert parse_spec(" phong: exponent = 64 ").values == {"exponent": 64.0}
    assert parse_spec("lambertian:albedo=5e-1").values == {"albedo": 0.5}


def test_colours():
    assert parse_spec("ggx:f0=0.1").values == {"roughness": 0.4, "f0": 0.1}
    assert parse_spec("ggx:f0=1/0.78/0.34").values["f0"] == [1, 0.78, 0.34]
    assert parse_spec("ggx:f0=0.3/0.3/0.3").values["f0"] == 0.3
    assert parse_spec("ggx:f0=gold").values["f0"] == [1, 0.782, 0.344]
    assert parse_spec("ggx:f0=gold").color("f0") == (1, 0.782, 0.344)
    assert parse_spec("ggx:f0=0.1").color("f0") == (0.1, 0.1, 0.1)


def test_choices():
    assert parse_spec("lafortune:fit=skin").values == {"fit": "skin"}
    assert repr(parse_spec("lafortune:fit=skin")) == "lafortune:fit=skin"


def test_a_parameter_follows_another():
    assert parse_spec("ward:ax=0.4").values["ay"] == 0.4
    assert parse_spec("ward:ax=0.4,ay=0.1").values["ay"] == 0.1
    assert parse_spec("ward:ay=0.1").values["ax"] == 0.2


def test_texts_of_values_lose_nothing():
    for value in (1 / 3, 64.0, 1e-5, 123456789.0):
        assert float(value_text(value)) == value
    assert value_text(64.0) == "64"
    assert value_text([0.1, 0.2, 1 / 3]) == "0.1/0.2/0.3333333333333333"
    assert value_text((0.5, 0.5, 0.5)) == "0.5"
    assert value_text("skin") == "skin"


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("microfacett", "did you mean microfacet"),
        ("Phong", "did you mean phong"),
        ("qqq", "known: ashikhmin-shirley, blinn-phong, charlie"),
        ("gxx:f0=1/0.78/0.34", "no BRDF is called 'gxx'; did you mean ggx"),
        ("Gold", "no BRDF is called 'Gold'; take ggx:roughness=0.3,f0=gold"),
        ("plastic:roughness=0.3", "no BRDF is called 'plastic'; take openpbr"),
        ("ggx(roughness=0.3)", "parameters follow a colon: ggx:roughness=0.3"),
        ("ggx roughness=0.3", "parameters follow a colon: ggx:roughness=0.3"),
        ("ggx:f0=gould", "neither a colour nor the name of one; did you mean gold"),
        ("ggx:f0=1/2", "f0=1/2 has 2 channels; give R/G/B"),
        ("ggx:f0=1/2/0.3", "f0=1/2/0.3 is outside 0 .. 1"),
        ("ggx:f0=1/nan/0.3", "is not a number"),
        ("ggx:f0=", "is not a number"),
        ("ggx:f0=a/b/c", "neither a colour"),
        ("lambertian:albedo=red", "albedo=red is not a number"),
        ("phong:exponent=1/2/3", "exponent=1/2/3 is not a number"),
        ("lafortune:fit=skim", "fit=skim is unknown; did you mean skin"),
        ("lafortune:fit=3", "fit=3 is unknown"),
        ("lafortune:fit=skin,cz=1", "fit=skin has numbers of its own; give it alone"),
        ("", "known"),
        ("phong:exponnent=3", "unknown parameter 'exponnent'; it has exponent"),
        ("phong:exponent", "expected key=value"),
        ("phong:", "expected key=value"),
        ("phong:exponent=", "not a number"),
        ("phong:exponent=many", "not a number"),
        ("phong:exponent=nan", "not a number"),
        ("phong:exponent=inf", "not a number"),
        ("phong:exponent=1,exponent=2", "given twice"),
        ("microfacet:sigma=0", "outside 0.005 .. 1"),
        ("microfacet:sigma=1.5", "outside 0.005 .. 1"),
        ("lambertian:albedo=-0.1", "outside 0 .. 1"),
    ],
)
def test_bad_specifications(spec, words):
    with pytest.raises(BrdfError, match=words) as caught:
        parse_spec(spec)
    assert "\n" not in str(caught.value)


def test_what_stands_for_everyday_names_is_a_material():
    for spec in set(library._EVERYDAY.values()):
        assert parse_spec(spec).name == spec.partition(":")[0]


@pytest.mark.parametrize(
    ("spec", "label"),
    [
        ("microfacet", "microfacet"),
        ("phong:exponent=32", "phong-exponent-32"),
        ("a:b=0.5,c=1e-3", "a-b-0.5-c-1e-3"),
        ("ggx:f0=1/0.78/0.34", "ggx-f0-1-0.78-0.34"),
        ("../x:y", "x-y"),
        ("measured/blue paint.binary", "blue-paint"),
        ("paint.brdf", "paint"),
    ],
)
def test_labels_are_safe_in_file_names(spec, label):
    assert file_label(spec) == label


@pytest.mark.parametrize(
    ("spec", "is_file"),
    [
        ("ggx", False),
        ("ggx:f0=1/0.78/0.34", False),
        ("gxx:f0=1/0.78/0.34", False),
        ("lamb", False),
        ("", False),
        ("paint.binary", True),
        ("Paint.BSDF", True),
        ("measured/paint", True),
        ("plain", True),
        ("odd:name=1", True),
    ],
)
def test_what_names_a_file(spec, is_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("plain", "odd:name=1", "ggx"):
        (tmp_path / name).write_text("")
    assert names_file(spec) == is_file


def test_files_are_opened_as_measured_brdfs(monkeypatch):
    opened = []
    monkeypatch.setattr("shrm_cli.brdf.measured.open_measured", opened.append)
    parse_spec("folder/paint.bsdf")
    assert opened == [Path("folder/paint.bsdf")]
