"""The syntax that names BRDFs."""

import pytest

from shrm_cli.brdf.spec import file_label, parse_spec
from shrm_cli.errors import BrdfError


def test_names_and_parameters():
    assert parse_spec("microfacet").values == {"sigma": 0.2}
    assert parse_spec(" phong: exponent = 64 ").values == {"exponent": 64.0}
    assert parse_spec("lambertian:albedo=5e-1").values == {"albedo": 0.5}


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("microfacett", "did you mean microfacet"),
        ("Phong", "did you mean phong"),
        ("zzz", "known: lambertian, phong, microfacet"),
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


@pytest.mark.parametrize(
    ("spec", "label"),
    [
        ("microfacet", "microfacet"),
        ("phong:exponent=32", "phong-exponent-32"),
        ("a:b=0.5,c=1e-3", "a-b-0.5-c-1e-3"),
        ("../x:y", "..-x-y"),
    ],
)
def test_labels_are_safe_in_file_names(spec, label):
    assert file_label(spec) == label
