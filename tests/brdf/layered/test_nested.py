"""Specifications within specifications, and what maps record of them."""

import json

import pytest

from shrm_cli.brdf.base import MOST_NESTED, masked
from shrm_cli.brdf.cache import _key
from shrm_cli.brdf.measured.table import sample_table, write_table
from shrm_cli.brdf.models.lambertian import Lambertian
from shrm_cli.brdf.spec import named_files, parse_spec
from shrm_cli.brdf.sums import is_sum, split
from shrm_cli.cli.types import Spec
from shrm_cli.errors import BrdfError
from shrm_cli.lookdev.sheet import material_names
from shrm_cli.maps.info import MapInfo, common_brdf, record_of, spec_of

PAINT = "coated:roughness=0.05,base=(0.7*lambertian:albedo=0.6/0.05/0.03+0.3*ggx:f0=0.9)"


def test_a_plus_and_a_comma_in_parentheses_are_none_of_the_term():
    assert not is_sum(PAINT)
    assert is_sum(f"0.5*{PAINT}+ggx")
    found = parse_spec(PAINT)
    assert found.number("roughness") == 0.05
    assert [weight for weight, _ in found.base.terms] == [0.7, 0.3]
    assert found.base.terms[0][1].color("albedo") == (0.6, 0.05, 0.03)
    after = parse_spec("coated:base=(coated:base=(ggx:roughness=0.3,f0=gold),ior=1.4),ior=1.6")
    assert (after.number("ior"), after.base.number("ior")) == (1.6, 1.4)
    assert after.base.base.values == {"roughness": 0.3, "f0": [1, 0.782, 0.344]}


@pytest.mark.parametrize(
    "spec",
    [
        PAINT,
        "fuzzy:color=0.3,base=(coated:base=(ggx))",
        "coated:base=(2*lambertian)",
        f"0.5*{PAINT}+0.5*ggx:roughness=0.3",
        "coated:base=(0.5*coated:base=(phong)+0.5*fuzzy)",
    ],
)
def test_what_is_recorded_gives_the_same_brdf_again(spec):
    found = parse_spec(spec)
    recorded = json.loads(json.dumps(record_of(found)))
    info = MapInfo(3, 2, 0.03, 1.0, 0.0, recorded, "room.exr", "f00d")
    again = common_brdf({"map.exr": info})
    assert again.values == found.values
    assert repr(parse_spec(repr(found))) == repr(found)
    assert [repr(term) for _, term in again.terms] == [repr(term) for _, term in found.terms]


def test_colors_of_metals_are_in_the_primaries_of_the_probe():
    wide = (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329)
    alone = parse_spec("ggx:f0=gold", primaries=wide)
    assert parse_spec("coated:base=(ggx:f0=gold)", primaries=wide).base.values == alone.values


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("coated:base=ggx", r"base=ggx is no BRDF in parentheses, such as base=\(lambertian\)"),
        ("coated:base=(ggx", r"base=\(ggx is no BRDF in parentheses"),
        ("coated:base=3", "base=3.0 is no BRDF"),
        ("coated:base=()", "no BRDF is called ''"),
        ("coated:base=(gxx)", "no BRDF is called 'gxx'; did you mean ggx"),
        ("coated:base=(kajiya-kay)", "hair has no normal in common"),
        ("coated:base=(ggx),base=(ggx)", "base is given twice"),
        ("coated:ior=0.5", "outside 1 .. 3"),
        ("coated:bass=(ggx)", "unknown parameter 'bass'"),
        (
            "coated:base=(" * (MOST_NESTED + 1) + "ggx" + ")" * (MOST_NESTED + 1),
            "more than 8 BRDFs within one",
        ),
        ("coated:base=(" * 5000 + "ggx" + ")" * 5000, "more than 8 BRDFs within one"),
    ],
)
def test_bad_specifications(spec, words):
    with pytest.raises(BrdfError, match=words) as caught:
        parse_spec(spec)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["a=(b", "paint (1).brdf", "f(x)+g(y)", "a=b)"])
def test_other_parentheses_are_text(text):
    assert masked(text) == text


def test_a_measured_base_is_found_beside_the_map(tmp_path):
    path = tmp_path / "paint.npz"
    write_table(path, sample_table(Lambertian(albedo=0.4), (8, 8, 8)))
    spec = f"coated:base=(0.5*ggx+0.5*{path})"
    found = parse_spec(spec)
    assert found.is_measured
    assert named_files(spec) == [path]
    recorded = json.loads(json.dumps(record_of(found)))
    assert str(tmp_path) not in json.dumps(recorded)
    info = MapInfo(3, 2, 0.03, 1.0, 0.0, recorded, "room.exr", "f00d")
    assert common_brdf({str(tmp_path / "map.exr"): info}).values == found.values
    assert found.with_values(ior=1.3).base is found.base
    assert repr(found.with_values(base="(phong)").base) == repr(parse_spec("phong"))
    with pytest.raises(BrdfError, match="unknown"):
        found.with_values(unknown=1.0)
    with pytest.raises(BrdfError, match=r"was measured, and paint\.npz does not lie beside it"):
        common_brdf({str(tmp_path / "elsewhere" / "map.exr"): info})
    with pytest.raises(BrdfError, match="no BRDF is called"):
        type(found)(base=f"({path})")


def test_what_is_computed_of_foreign_code_is_not_kept(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "import numpy as np\nfrom shrm_cli.brdf.base import Brdf\n\nclass Mine(Brdf):\n"
        "    '''Half.'''\n\n    def evaluate(self, light, view):\n"
        "        return np.full(np.broadcast_shapes(light.shape, view.shape), 0.5, light.dtype)\n"
    )
    for part in split(parse_spec(f"coated:base=({path}:Mine)")):
        assert (_key("a", part, (8, 2, 0.1)) is None) == (" in coated:" in repr(part))
    assert all(_key("a", part, (8, 2, 0.1)) for part in split(parse_spec("coated:base=(ggx)")))


def test_the_shell_completes_within_parentheses():
    def completed(text):
        return [each.value for each in Spec().shell_complete(None, None, text)]

    assert completed("coated:base=(0.5*lamb") == ["coated:base=(0.5*lambertian"]
    assert completed("coated:base=(ggx+pho") == ["coated:base=(ggx+phong"]
    assert "coated:base=(ggx),roughness=" in completed("coated:base=(ggx),ro")


def test_short_names():
    assert material_names(["coated:ior=1.5,base=(ggx:f0=gold)"]) == ["coated 1.5 ggx gold"]


def test_specs_of_records_leave_the_files_out():
    parameters = {"ior": 1.5, "base": "(paint.npz)", "terms": "[]"}
    assert (
        spec_of({"name": "coated", "parameters": parameters}) == "coated:ior=1.5,base=(paint.npz)"
    )
