"""What maps remember of their light and material."""

import json
from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.brdf import measured as measured_brdfs
from shrm_cli.brdf.library import built_in_names
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError
from shrm_cli.maps.info import (
    MapInfo,
    common_brdf,
    differing_origins,
    record_of,
    same_brdf,
    spec_of,
)
from shrm_cli.vocabulary import MAX_TERMS
from tests.oracles import random_directions

MICROFACET = {"name": "microfacet", "parameters": {"sigma": 0.1, "ior": 1.7}}
LAMBERT = {"name": "lambertian", "parameters": {}}


def info(brdf, digest="f00d"):
    return MapInfo(3, 2, 0.03, 1.0, 0.0, brdf, "room.exr", digest)


NESTED = "0.5*coated:base=(coated:film=300)+0.5*lambertian"


@pytest.mark.parametrize("spec", [
    "phong:exponent=0.1", "microfacet:sigma=0.3333333333333333", "ggx:roughness=0.2,f0=gold",
    "lafortune:fit=skin", "0.3*lambertian+2*microfacet:sigma=0.1", "0.3333333333333333*ggx",
    "2*0.5*phong:exponent=7", "1e-5*phong+1e5*lambertian", "ggx:ax=0.3,ay=0.1",
    "ggx:film=300,f0=0.5", "coated:film=300",
    pytest.param(NESTED, marks=pytest.mark.proof),
    "fuzzy:base=(0.25*lambertian:albedo=0.3/0.5/0.7+0.1234567890123*ggx)", *built_in_names(),
])  # fmt: skip
def test_a_record_gives_the_same_brdf_again(spec, rng):
    brdf = parse_spec(spec)
    record = json.loads(json.dumps(record_of(brdf)))
    light, view = np.abs(random_directions(rng, 2, 50))
    for again in (parse_spec(spec_of(record)), parse_spec(repr(brdf))):
        assert type(again) is type(brdf)
        assert again.values == brdf.values
        assert repr(again) == repr(brdf)
        assert np.array_equal(again.transfer(light, view), brdf.transfer(light, view))


def test_a_record_of_layers_over_layers_says_the_same():
    """What they reflect takes seconds to tabulate: `make prove` compares it."""
    brdf = parse_spec(NESTED)
    again = parse_spec(spec_of(json.loads(json.dumps(record_of(brdf)))))
    assert (again.values, repr(again)) == (brdf.values, repr(brdf))
    assert "base=(coated:roughness=0.1,ior=1.5,color=1,weight=1,film=300," in repr(again)


def test_specs():
    assert spec_of({"name": "phong", "parameters": {"exponent": 8.0}}) == "phong:exponent=8"
    assert spec_of({"name": "plain", "parameters": {}}) == "plain"
    for record in ({}, {"name": "phong"}, {"name": 3, "parameters": {}}, {"parameters": {}}):
        assert spec_of(record) == "unknown"
    assert spec_of({"name": "phong", "parameters": [8]}) == "unknown"


def test_one_brdf_for_all():
    phong = {"name": "phong", "parameters": {"exponent": 8.0}}
    brdf = common_brdf({"a": info(phong), "b": info(dict(phong))})
    assert (brdf.name, brdf.values) == ("phong", {"exponent": 8.0})


@pytest.mark.parametrize(
    ("records", "message"),
    [
        (
            [MICROFACET, LAMBERT],
            "1.exr: its BRDF is lambertian, but that of 0.exr is microfacet:sigma=0.1,ior=1.7; "
            "give `brdf`",
        ),
        ([{}], "0.exr: its BRDF, unknown, cannot be evaluated; give `brdf`"),
        ([{"name": "velvet", "parameters": {}}], "0.exr: its BRDF, velvet, cannot be"),
        ([{"name": "phong", "parameters": {"exponent": "x"}}], "phong:exponent=x, cannot be"),
        ([{"name": "phong", "parameters": {"exponent": None}}], "phong:exponent=None, cannot"),
        ([{"name": "phong", "parameters": {"gloss": 1.0}}], "phong:gloss=1, cannot be"),
    ],
)
def test_no_common_brdf(records, message):
    infos = {f"{k}.exr": info(record) for k, record in enumerate(records)}
    with pytest.raises(BrdfError) as caught:
        common_brdf(infos)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "record",
    [
        {"name": "evil.py:Evil", "parameters": {}},
        {"name": "evil.py:Evil", "parameters": {"k": 1.0}},
        {"name": "sum", "parameters": {"spec": "0.5*lambertian+0.5*evil.py:Evil"}},
        {"name": "sum", "parameters": {"spec": "2*evil.py:Evil"}},
        {"name": "sum", "parameters": {"spec": "evil.py"}},
    ],
)
def test_what_a_file_says_runs_no_code(tmp_path, monkeypatch, record):
    (tmp_path / "evil.py").write_text("open('done', 'w').close()\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BrdfError, match="cannot be evaluated; give `brdf`"):
        common_brdf({"a.exr": info(record)})
    assert not (tmp_path / "done").exists()


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """The record of a measured file in a folder of its own, and that folder."""
    folder = tmp_path / "paints"
    folder.mkdir()
    rows = "".join(f"{angle},0,{angle},180,{1 - angle / 100}\n" for angle in (0, 30, 60))
    (folder / "paint.csv").write_text("theta_i,phi_i,theta_r,phi_r,brdf\n" + rows)
    monkeypatch.chdir(tmp_path)
    return record_of(parse_spec(str(folder / "paint.csv"))), folder


@pytest.mark.parametrize("spec", ["{}", "0.5*lambertian+0.5*{}", "2*{}", "lambertian+0.5*2*{}"])
@pytest.mark.parametrize("place", ["beside the map", "beside another map"])
def test_measured_files_are_found_again(measured, place, spec):
    _, folder = measured
    record = record_of(parse_spec(spec.format(folder / "paint.csv")))
    maps = {
        "beside the map": [folder / "a.exr"],
        "beside another map": ["b.exr", folder / "a.exr"],
    }[place]
    assert record_of(common_brdf({str(each): info(record) for each in maps})) == record


@pytest.mark.parametrize("spec", ["paint.csv", "0.5*lambertian+0.5*paint.csv"])
def test_measured_files_of_the_working_folder_are_not_looked_at(measured, monkeypatch, spec):
    _, folder = measured
    monkeypatch.chdir(folder)
    record = record_of(parse_spec(spec))
    with pytest.raises(BrdfError, match=r"paint.csv does not lie beside it; put the file there"):
        common_brdf({str(folder.parent / "a.exr"): info(record)})


@pytest.mark.parametrize("text", ["{}", "0.5*lambertian+0.5*{}", "2*{}", "{}+{}"])
@pytest.mark.parametrize("name", ["{folder}/paint.csv", "paints/paint.csv", "paint.csv"])
@pytest.mark.parametrize("kind", ["name", "spec", "spec with terms"])
def test_what_a_map_says_opens_no_file(measured, monkeypatch, text, name, kind):
    """Neither by a path, nor by a plain name without the digest of what it names."""
    _, folder = measured
    monkeypatch.chdir(folder if name == "paint.csv" else folder.parent)
    opened = []
    monkeypatch.setattr(measured_brdfs, "open_measured", lambda path: opened.append(path))
    path = name.format(folder=folder)
    spec = text.format(*[path] * 2)
    terms = json.dumps([{"file": path, "sha256": "0" * 64}] if "/" in path else [{"file": path}])
    record = {
        "name": {"name": spec, "parameters": {}},
        "spec": {"name": "sum", "parameters": {"spec": spec}},
        "spec with terms": {"name": "sum", "parameters": {"spec": spec, "terms": terms}},
    }[kind]
    with pytest.raises(BrdfError, match="cannot be evaluated; give `brdf`"):
        common_brdf({"a.exr": info(record)})
    assert opened == []


@pytest.mark.parametrize("terms", ["[", "3", "{}", '[[["a"]]]', json.dumps([{"terms": "["}])])
def test_damaged_records_of_sums_are_told(terms):
    record = {"name": "sum", "parameters": {"spec": "phong+paint.csv", "terms": terms}}
    with pytest.raises(BrdfError, match="cannot be evaluated"):
        common_brdf({"a.exr": info(record)})


def test_a_recorded_sum_has_few_terms():
    record = {"name": "sum", "parameters": {"spec": "+".join(["ggx"] * (MAX_TERMS + 1))}}
    with pytest.raises(BrdfError, match="cannot be evaluated"):
        common_brdf({"a.exr": info(record)})


def test_measured_files_that_are_gone_or_others_are_asked_for(measured):
    record, folder = measured
    with pytest.raises(BrdfError, match=r"a.exr: its BRDF was measured, and paint.csv does n"):
        common_brdf({"a.exr": info(record)})
    other = {**record, "parameters": {**record["parameters"], "sha256": "0" * 64}}
    with pytest.raises(BrdfError, match=r"paint.csv is another measurement than its BRDF's; put"):
        common_brdf({str(folder / "a.exr"): info(other)})


def test_measured_files_are_found_through_no_links(measured):
    record, folder = measured
    (folder / "library").mkdir()
    (folder / "paint.csv").rename(folder / "library" / "paint.csv")
    (folder / "paint.csv").symlink_to(folder / "library" / "paint.csv")
    with pytest.raises(BrdfError, match=r"paint.csv does not lie beside it; put"):
        common_brdf({str(folder / "a.exr"): info(record)})
    (folder / "linked").symlink_to(folder / "library")
    assert common_brdf({str(folder / "linked" / "a.exr"): info(record)}) is not None


@pytest.mark.parametrize("name", ["paints/paint.csv", "../paint.csv", "..", "", "a\0b", 3])
def test_names_of_measured_files_lead_nowhere_else(measured, name):
    record, _ = measured
    away = {**record, "parameters": {**record["parameters"], "file": name}}
    with pytest.raises(BrdfError, match="cannot be evaluated"):
        common_brdf({"a.exr": info(away)})


def test_differing_origins():
    infos = {
        "same": info(MICROFACET),
        "probe": info(MICROFACET, "beef"),
        "both": info(LAMBERT, "beef"),
        "silent": info({}, ""),
    }
    assert differing_origins(infos, "that of x.exr", "f00d", MICROFACET) == [
        "probe: its probe is not that of x.exr",
        "both: its probe is not that of x.exr",
        "both: its BRDF is lambertian, not microfacet:sigma=0.1,ior=1.7",
    ]
    assert differing_origins(infos, "that of x.exr", "", {}) == []


def test_probes_that_were_read_otherwise_are_told():
    """Not for the colours that light is converted to, which compare converts, nor for a box."""
    read = {"layout": "latlong", "sampling": "center"}
    turned = {**read, "axes": [[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]], "clamp": 2.0}
    infos = {
        "same": replace(info(MICROFACET), options={"reading": read}),
        "turned": replace(info(MICROFACET), options={"reading": turned}),
        "colours": replace(
            info(MICROFACET), options={"reading": {**read, "working": [1.0], "proxy": {}}}
        ),
        "silent": info(MICROFACET),
    }
    assert differing_origins(infos, "x.exr", "f00d", MICROFACET, read) == [
        "turned: x.exr was read otherwise for it (`clamp`, `yaw`, `pitch`, `roll`, `mirror` or "
        "`up`); give the options of then"
    ]
    assert differing_origins(infos, "x.exr", "f00d", MICROFACET) == []


def test_a_record_is_the_same_in_any_order_and_with_greys_as_colours():
    one = {"name": "ggx", "parameters": {"roughness": 0.3, "f0": 0.04}}
    other = {"parameters": {"f0": [0.04, 0.04, 0.04], "roughness": 0.3}, "name": "ggx"}
    assert same_brdf(one, other)
    assert differing_origins({"a": info(other)}, "x", "", one) == []
    assert common_brdf({"a": info(one), "b": info(other)}).values == one["parameters"]
    for roughness, f0 in [(0.4, 0.04), (0.3, [0.04, 0.04, 0.05]), (0.3, None)]:
        assert not same_brdf(one, {"name": "ggx", "parameters": {"roughness": roughness, "f0": f0}})
    assert not same_brdf(one, {**other, "name": "charlie"})
    assert not same_brdf(one, {"name": "ggx", "parameters": {"roughness": 0.3}})
    assert not same_brdf(one, {"name": "ggx", "parameters": "x"})


def test_advice_is_the_callers():
    infos = {"a": info(MICROFACET), "b": info(LAMBERT)}
    with pytest.raises(BrdfError, match=r"; try another$"):
        common_brdf(infos, "try another")
