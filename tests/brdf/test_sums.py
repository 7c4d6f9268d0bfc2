"""Sums of BRDFs, and how others come apart."""

import json

import numpy as np
import pytest

from shrm_cli.brdf import transfer, vectors
from shrm_cli.brdf.base import Brdf, added, scaled
from shrm_cli.brdf.measured.table import sample_table, write_table
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.models.lambertian import Lambertian
from shrm_cli.brdf.models.microfacet import Microfacet
from shrm_cli.brdf.models.oren_nayar import OrenNayar
from shrm_cli.brdf.models.phong import Phong
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.sums import Sum, diffuse_albedo, is_sum, parse_sum, split
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.errors import BrdfError
from shrm_cli.vocabulary import MAX_ORDER_P, MAX_TERMS
from tests.brute_force import unit


class Lifted(Brdf):
    """A coloured Lambertian base under a lobe that vanishes somewhere."""

    name, summary, source = "lifted", "for tests", "here"

    def evaluate(self, light, view):
        height = (light[..., 2] * view[..., 2])[..., None] ** 2
        return np.array([0.1, 0.05, 0.0]) / np.pi + height * np.array([0.3, 0.0, 0.2])


@pytest.fixture
def pairs(rng):
    """Light and view above the horizon."""
    light, view = unit(rng, 50), unit(rng, 50)
    light[:, 2], view[:, 2] = np.abs(light[:, 2]), np.abs(view[:, 2])
    return light, view


def test_a_sum_is_the_sum(pairs):
    one, other = OrenNayar(), Lambertian(albedo=0.5)
    both = Sum([(0.3, one), (2.0, other)])
    light, view = pairs
    expected = 0.3 * one.evaluate(light, view) + 2 * 0.5 / np.pi
    assert both.evaluate(light, view) == pytest.approx(expected)
    assert not both.includes_cosine
    assert both.center == "normal"
    assert Sum([(0.3, one), (2.0, Ggx())]).center == "reflection"
    assert both.transfer(light, view) == pytest.approx(expected * light[:, 2:])


def test_transfer_functions_and_brdfs_may_be_added(rng):
    both = Sum([(0.5, Lambertian()), (0.5, Microfacet(sigma=0.3))])
    light, view = unit(rng, 200), unit(rng, 200)  # below the horizon too
    expected = 0.5 * np.maximum(light[:, 2:], 0) / np.pi
    expected = expected + 0.5 * Microfacet(sigma=0.3).transfer(light, view)
    assert both.transfer(light, view) == pytest.approx(np.broadcast_to(expected, (200, 3)))


@pytest.mark.parametrize(
    ("spec", "terms", "exponents"),
    [
        (
            "0.5*lambertian+0.5*phong:exponent=8",
            [(0.5, "lambertian"), (0.5, "phong")],
            [None, 8.0],
        ),
        (
            "lambertian + 2e-1 * phong:exponent=1e+2",
            [(1.0, "lambertian"), (0.2, "phong")],
            [None, 100.0],
        ),
        (
            "1e+1*lambertian+phong",
            [(10.0, "lambertian"), (1.0, "phong")],
            [None, Phong().values["exponent"]],
        ),
    ],
)
def test_specifications(spec, terms, exponents):
    assert is_sum(spec)
    found = parse_sum(spec, parse_spec)
    assert [(weight, term.name) for weight, term in found.terms] == terms
    assert [term.values.get("exponent") for _, term in found.terms] == exponents
    again = parse_sum(found.values["spec"], parse_spec)
    assert again.values == found.values


@pytest.mark.parametrize(
    "spec", ["2*ggx:f0=gold", "0.5*coated:base=(0.5*lambertian+0.5*ggx)+0.2*eon"]
)
def test_values_that_json_held_make_the_same_brdf(spec):
    """`Brdf` says so of sums, and of what has a weight."""
    found = parse_spec(spec)
    again = parse_spec(json.loads(json.dumps(found.values))["spec"])
    assert again.values == found.values
    assert type(again) is type(found)


@pytest.mark.parametrize("spec", ["phong", "phong:exponent=1e+2", "lambertian:albedo=0.5"])
def test_what_is_no_sum(spec):
    assert not is_sum(spec)


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("1.2.3*lambertian+phong", "weight"),
        ("lambertian+", "a term is empty"),
        ("a*lambertian+phong", "a*"),
    ],
)
def test_malformed_sums(spec, words):
    with pytest.raises(BrdfError, match=words.replace("*", "[*]")):
        parse_sum(spec, parse_spec)


def test_hair_is_no_term():
    with pytest.raises(BrdfError, match="no normal in common"):
        Sum([(1.0, Lambertian()), (1.0, parse_spec("kajiya-kay"))])


def test_a_weight_alone(pairs):
    found = parse_sum("0.25*lambertian", parse_spec)
    assert found.evaluate(*pairs) == pytest.approx(np.full((50, 3), 0.25 / np.pi))
    assert (found.center, found.zonal) == ("normal", True)


def test_the_largest_lambertian_part(pairs):
    albedo = diffuse_albedo(Lifted())
    assert albedo == pytest.approx([0.1, 0.05, 0.0], abs=2e-4)
    diffuse, rest = split(Lifted())
    light, view = pairs
    assert rest.evaluate(light, view).min() >= 0
    total = diffuse.evaluate(light, view) + rest.evaluate(light, view)
    assert total == pytest.approx(Lifted().evaluate(light, view), abs=1e-4)
    assert (diffuse.center, rest.center) == ("normal", "reflection")


def test_what_does_not_come_apart():
    for whole in (Microfacet(), Phong(), Lambertian(), parse_spec("charlie")):
        assert split(whole) == [whole]


def test_a_sum_comes_apart_into_its_weighted_terms(pairs):
    both = Sum([(0.3, OrenNayar()), (2.0, Microfacet())])
    light, view = pairs
    terms = split(both)
    assert [term.term.name for term in terms] == ["oren-nayar", "microfacet"]
    total = sum(term.transfer(light, view) for term in terms)
    assert total == pytest.approx(both.transfer(light, view))


def test_sums_of_different_files_of_one_name_are_different(tmp_path):
    """The cache of coefficients, and the maps, know them by their contents."""
    found = []
    for folder, albedo in (("a", 0.2), ("b", 0.7)):
        (tmp_path / folder).mkdir()
        path = tmp_path / folder / "x.npz"
        write_table(path, sample_table(Lambertian(albedo=albedo), (8, 8, 8)))
        found.append(parse_sum(f"0.5*lambertian+0.5*{path}", parse_spec))
    assert found[0].is_measured
    assert found[0].values != found[1].values
    alone = [split(each)[1] for each in found]
    assert alone[0].values != alone[1].values


def test_terms_are_sampled_to_the_degrees_that_they_have(monkeypatch):
    """A wide lobe under a sharp coat took eight times as long as the coat, for the same sum."""
    both = parse_spec("coated:roughness=0.2,base=(lambertian:albedo=0.5)")
    sampled = transfer.compute_transfer
    orders = []

    def recorded(term, order_f, *others):
        orders.append(order_f)
        return sampled(term, order_f, *others)

    monkeypatch.setattr(transfer, "compute_transfer", recorded)
    found = compute_coefficients(both, 256, 4, 1e-4)
    assert orders[0] == 256
    assert max(orders[1:]) <= 64
    wide = sampled(both.terms[1][1].recentered("reflection"), 256, 4, 1e-4)
    sharp = sampled(both.terms[0][1], 256, 4, 1e-4)
    values = sharp.projected(4) + wide.projected(4)
    total = found.total_energy.sum()
    assert np.sum((found.values - values) ** 2) < 1e-4 * wide.total_energy.sum()
    degrees = np.abs(found.degree_energy - _common_energy(sharp, wide)).sum()
    assert degrees < 1e-4 * total


def _common_energy(one, other):
    """The energy of each degree of a sum of two lobes, which `compute_transfer` sampled."""
    first, second = (each.projected(MAX_ORDER_P) for each in (one, other))
    signs = np.where(np.arange(MAX_ORDER_P + 1) == 0, 1.0, 2.0)[:, None]
    shared = 2 * np.sum(first * second * signs, axis=(1, 2))
    return one.degree_energy + other.degree_energy + shared


@pytest.mark.parametrize("weight", ["1e999", "1e31", "1e300"])
def test_weights_without_a_finite_energy(weight):
    for spec in (f"{weight}*lambertian", f"lambertian+{weight}*phong"):
        with pytest.raises(BrdfError, match=r"weights are not negative, and 1e\+30 at most"):
            parse_spec(spec)


class Sampled(Brdf):
    """A sum that does not tell that it is one, so that it is sampled as a whole."""

    name = summary = source = "whole"

    def __init__(self, whole):
        self.whole, self.values = whole, {}
        self.center, self.includes_cosine = whole.center, whole.includes_cosine
        self.has_horizon = whole.has_horizon

    def evaluate(self, light, view):
        return self.whole.evaluate(light, view)


@pytest.mark.slow
@pytest.mark.parametrize(
    "spec",
    [
        "0.5*lambertian+0.5*ggx:roughness=0.4,f0=0.04",
        "0.9*lambertian:albedo=0.8/0.1/0.05+0.1*phong:exponent=16",
        "oren-nayar+0.5*lambertian",
    ],
)
def test_coefficients_of_terms_are_added(spec):
    """The values, and the energy with what the terms have in common, are those of the whole."""
    whole = parse_spec(spec)
    added = compute_coefficients(whole, 32, 6, accuracy=1e-5)
    sampled = compute_coefficients(Sampled(whole), 32, 6, accuracy=1e-5)
    energy = sampled.total_energy.sum()
    assert np.sum((added.values - sampled.values) ** 2) < 1e-5 * energy
    np.testing.assert_allclose(added.total_energy, sampled.total_energy, rtol=2e-4)
    difference = np.abs(added.degree_energy - sampled.degree_energy).sum()
    assert difference < 2e-4 * energy
    assert added.remark is None


def test_terms_and_factors_are_bounded():
    assert len(parse_spec("+".join(["lambertian"] * MAX_TERMS)).terms) == MAX_TERMS
    with pytest.raises(BrdfError, match=rf"a sum of {MAX_TERMS + 1} terms; give {MAX_TERMS} at m"):
        parse_spec("+".join(["lambertian"] * (MAX_TERMS + 1)))
    assert parse_spec("1*" * MAX_TERMS + "lambertian").values
    for count in (MAX_TERMS + 1, 100_000):
        with pytest.raises(BrdfError, match="too many factors"):
            parse_spec("1*" * count + "lambertian")


def test_a_sum_has_no_parameters_to_change():
    """OpenPBR's surface, which is a sum, too, has."""
    with pytest.raises(BrdfError, match="has no parameter 'exponent'"):
        parse_spec("lambertian+phong").with_values(exponent=3)
    found = parse_spec("openpbr").with_values(coat_weight=1.0)
    assert repr(found) == "openpbr:coat_weight=1"


@pytest.mark.parametrize(
    "spec",
    [
        "0.5*ggx:roughness=0.3+0.5*blinn-phong",
        "fuzzy:base=(coated:base=(0.7*lambertian+0.2*ggx:f0=gold+0.3*phong))",
        pytest.param(
            "openpbr:base_metalness=0.3,coat_weight=0.5,fuzz_weight=0.5", marks=pytest.mark.proof
        ),
    ],
)
def test_what_terms_share_is_what_each_finds_alone(spec, pairs, monkeypatch):
    """To the last bit; half vectors of the same directions are found once for all terms."""
    whole, (light, view), made = parse_spec(spec), pairs, []
    alone = added([scaled(each.evaluate(light, view), weight) for weight, each in whole.terms])
    original = vectors._half_vector
    monkeypatch.setattr(vectors, "_half_vector", lambda *pair: made.append(1) or original(*pair))
    np.testing.assert_array_equal(whole.evaluate(light, view), alone)
    in_air_and_coat = 2 if "coat" in spec else 1
    assert len(made) == in_air_and_coat
    whole.evaluate(light, view)
    assert len(made) == 2 * in_air_and_coat  # nothing is kept from one evaluation to the next


GREY = (
    "0.5*lambertian+0.5*ggx:roughness=0.3",
    "ggx:roughness=0.3,anisotropy=0.5",
    "coated:roughness=0.1,base=(ggx:roughness=0.5,f0=0.9)",
    "openpbr:base_metalness=1",
    "openpbr:base_metalness=0.5,base_diffuse_roughness=0.5,coat_weight=1",
    "openpbr:fuzz_weight=1",
)
"""Materials that are grey, of all kinds of terms."""


@pytest.mark.parametrize("spec", GREY)
def test_grey_terms_have_one_channel(rng, spec):
    """Whoever samples them takes a third of the time."""
    brdf, light, view = parse_spec(spec), unit(rng, 9), unit(rng, 9)
    for each in (brdf, *split(brdf)):
        assert each.evaluate(light, view).strides[-1] == 0, each


@pytest.mark.parametrize(("albedo", "count"), [(0.003, 1), (0.008, 2)])
def test_a_lambertian_part_is_apart_where_it_is_seen(albedo, count):
    """Less than half of a percent of the light is not worth a map of its own."""

    class Lifted(Brdf):
        name = "lifted"

        def __init__(self):
            self.values = {}

        def evaluate(self, light, view):
            half = light + view
            half = half / np.linalg.norm(half, axis=-1, keepdims=True)
            return np.repeat(albedo / np.pi + half[..., 2:] ** 400, 3, axis=-1)

    assert len(split(Lifted())) == count
