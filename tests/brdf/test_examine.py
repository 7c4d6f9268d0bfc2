"""What is said of a BRDF: albedos, reciprocity, furnace, energy of the orders."""

import csv

import numpy as np
import pytest

from shrm_cli.brdf.albedo import directional_albedo
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.examine import difference, examine
from shrm_cli.brdf.spec import parse_spec
from tests.brdf.layered.parts.test_table import gridded
from tests.brute_force import microfacet, sphere_rule


class Given(Brdf):
    """A function of light and view."""

    name = "given"
    summary = source = ""

    def __init__(self, function, **attributes):
        self.function, self.values = function, {}
        for name, value in attributes.items():
            setattr(self, name, value)

    def evaluate(self, light, view):
        return np.broadcast_to(
            self.function(light, view), (*np.broadcast_shapes(light.shape, view.shape)[:-1], 3)
        )


def constant(*rgb):
    return Given(lambda light, view: np.array(rgb) / np.pi)


def test_a_specification_is_examined_as_its_brdf_is():
    text = "phong:exponent=8"
    assert np.array_equal(examine(text).albedo, examine(parse_spec(text)).albedo)


def test_a_constant_has_its_albedo_at_every_angle():
    found = examine(constant(0.2, 0.5, 0.9))
    assert np.allclose(found.albedo, [[0.2, 0.5, 0.9]] * 6, rtol=1e-3)
    assert np.allclose(found.smallest, np.array([0.2, 0.5, 0.9]) / np.pi)
    assert np.allclose(found.largest, np.array([0.2, 0.5, 0.9]) / np.pi)
    assert found.reciprocity_error == 0
    assert found.furnace_albedo == pytest.approx(0.9, rel=1e-3)
    assert not found.gains_energy
    assert not examine(constant(1, 1, 1)).gains_energy
    assert examine(constant(0.5, 1.01, 0.5)).gains_energy


@pytest.mark.parametrize("degrees", [0, 30, 60, 80])
@pytest.mark.parametrize("sigma", [0.15, 0.5])
def test_albedos_are_those_of_brute_force(degrees, sigma):
    directions, weights = sphere_rule(1600)
    theta = np.radians(degrees)
    view = np.array([np.sin(theta), 0, np.cos(theta)])
    rho_hat = microfacet(sigma)(view * [-1, 1, 1], view, directions)
    expected = rho_hat @ weights
    found = directional_albedo(parse_spec(f"microfacet:sigma={sigma}"), theta)
    assert np.allclose(found, expected, rtol=3e-3)


@pytest.mark.parametrize("spec", ["microfacet:sigma=0.005", "phong:exponent=100000"])
def test_the_sharpest_lobes_are_not_missed(spec):
    """Both are normalised for a view along the normal."""
    assert np.allclose(directional_albedo(parse_spec(spec), 0.0), 1, atol=2e-3)


@pytest.mark.parametrize("cosine", [0.1, 0.03, 0.01])
@pytest.mark.parametrize(
    "spec",
    [
        "ggx:roughness=0.05,f0=1",
        "ggx:ax=0.3,ay=0.02,f0=1",
        "0.5*ggx:roughness=0.1,f0=1+0.3*charlie",
    ],
)
def test_lobes_that_the_horizon_cuts(spec, cosine):
    """Beside a sum over slopes of half vectors, even in their inverse hyperbolic sines."""
    expected = gridded(spec, cosine, np.ones_like)
    found = directional_albedo(parse_spec(spec), np.arccos(cosine))
    assert np.allclose(found, expected, rtol=2e-3)


def test_an_albedo_of_a_surface_whose_sides_differ():
    """Twice as bright on one side of the plane of the view as on the other."""
    sided = Given(lambda light, view: (1.0 + (light[..., 1:2] > 0)) / np.pi, isotropic=False)
    assert np.allclose(directional_albedo(sided, 0.7), 1.5, rtol=1e-3)


def test_an_albedo_that_grows_is_found_at_its_angle():
    found = examine(Given(lambda light, view: 0.3 / np.pi / np.maximum(view[..., 2:], 1e-3)))
    assert found.furnace_angle == 88
    assert found.furnace_albedo == pytest.approx(0.3 / np.cos(np.radians(88)), rel=2e-3)
    assert found.gains_energy


def test_albedos_of_a_measured_material_are_those_of_its_database(shared):
    folder = shared / "brdf" / "rgl"
    with open(folder / "albedo.csv") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    brdf = parse_spec(str(folder / "paper_white_rgb.bsdf"))
    rows = [row for row in rows if row["material"] == "paper_white_rgb"]
    assert len(rows) == 4
    for row in rows:
        expected = [float(row[channel]) for channel in "rgb"]
        found = directional_albedo(brdf, np.radians(float(row["theta_i_deg"])))
        assert np.allclose(found, expected, rtol=2e-3)


def test_reciprocity_is_measured_against_the_values():
    """|f - f'| is 1 wherever, and the mean square of f is (1 + 4) / 2."""
    one_sided = Given(lambda light, view: 1.0 + (light[..., 2:] > view[..., 2:]))
    assert examine(one_sided).reciprocity_error == pytest.approx(1 / np.sqrt(2.5), rel=1e-3)


def test_transfer_functions_are_divided_by_their_cosine():
    cosine = Given(lambda light, view: light[..., 2:] * 0.25, includes_cosine=True)
    found = examine(cosine)
    assert found.reciprocity_error < 1e-12
    assert np.allclose(found.largest, 0.25)
    without = Given(lambda light, view: np.array([0.25]), includes_cosine=True)
    assert examine(without).reciprocity_error > 0.1
    assert examine(without).largest.max() <= 0.25 / np.cos(np.radians(80)) * (1 + 1e-9)


def test_a_fibre_is_examined_all_around_its_tangent():
    fibre = Given(
        lambda light, view: 0.5 + 0.5 * light[..., 2:] ** 2,
        center="tangent", includes_cosine=True, has_horizon=False,
    )  # fmt: skip
    found = examine(fibre)
    assert np.allclose(found.albedo, 4 * np.pi * (0.5 + 0.5 / 3), rtol=1e-3)
    assert np.allclose([found.smallest[0], found.largest[0]], [0.5, 1], atol=1e-3)


def test_values_are_looked_for_up_to_80_degrees():
    """Of one that grows without end beyond."""
    grown = examine(Given(lambda light, view: 1 / (light * view)[..., 2:]))
    assert 0.9 < grown.largest[0] * np.cos(np.radians(80)) ** 2 <= 1 + 1e-9


def test_differences_of_the_sharpest_peaks_are_found():
    """Within 2.5 milliradians of the mirror's half vector, the width of GGX's sharpest lobe."""

    def peaked(light, view):
        half = light + view
        half = half / np.linalg.norm(half, axis=-1, keepdims=True)
        return 1.0 + (np.linalg.norm(half[..., :2], axis=-1, keepdims=True) < 0.0025)

    assert difference(Given(peaked), constant(np.pi, np.pi, np.pi)) > 0.15


def test_black_is_black():
    found = examine(constant(0, 0, 0))
    assert (found.furnace_albedo, found.reciprocity_error) == (0, 0)
    assert difference(constant(0, 0, 0), constant(1, 1, 1)) == 0


def test_the_same_seed_gives_the_same_result():
    phong = parse_spec("phong:exponent=8")
    one, same, other = (examine(phong, seed).reciprocity_error for seed in (3, 3, 4))
    assert one == same != other
    assert one == pytest.approx(other, rel=0.05)


def test_difference_is_relative():
    assert difference(constant(0.5, 0.5, 0.5), constant(0.55, 0.55, 0.55)) == pytest.approx(0.1)
    assert difference(parse_spec("ggx"), parse_spec("ggx")) == 0
