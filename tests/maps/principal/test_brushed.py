"""Principal maps of anisotropic BRDFs, beside sums over all pixels at generic tangents."""

import numpy as np
import OpenEXR
import pytest

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.brushed_transfer import azimuths_of, compute_brushed_transfer, wave_energies
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import ArgumentError, BrdfError, MapError
from shrm_cli.maps.file import open_map
from shrm_cli.maps.principal.about_center import cone_rule
from shrm_cli.maps.principal.principal import PrincipalMap
from shrm_cli.prefilter import prefilter, prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import LUMINANCE
from tests import brute_force
from tests.brute_force import unit
from tests.maps.damage import refused, survives_flipped_bits
from tests.maps.principal.test_principal import lit_room
from tests.maps.scenes import make_info, normals_of, relative_rms
from tests.maps.shader.cases import brushed_lobe
from tests.oracles import real_harmonics

pytestmark = pytest.mark.filterwarnings("ignore:.*is negative:shrm_cli.errors.ShrmWarning")
HEIGHT = 64
WARD, GGX = "ward:ax=0.2,ay=0.5", "ggx:roughness=0.5,anisotropy=0.6"
SUM = f"0.3*lambertian+0.5*{GGX}"


class Napped(Brdf):
    """A brushed lobe that a nap tilts, so that no mirror image of it is the same."""

    isotropic = False

    def evaluate(self, light, view):
        lobe = parse_spec(WARD).evaluate(light, view)
        tilt = 1 + 0.4 * (light + view)[..., 0] + 0.2 * (light + view)[..., 1]
        return lobe * np.maximum(tilt, 0)[..., None]


class Skewed(Brdf):
    """A brushed lobe whose marks are not along the tangent, and so the same after half a turn."""

    isotropic = False

    def evaluate(self, light, view):
        turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
        return parse_spec(WARD).evaluate(light @ turn, view @ turn)


@pytest.fixture(scope="module")
def room():
    return Probe.from_array(lit_room())


def surfaces(count, center="reflection", seed=3):
    """Normals, tangents at any angle, and views above the surfaces, uniform about the center."""
    rng = np.random.default_rng(seed)
    views = unit(rng, count)
    normals = normals_of(unit(rng, count), views, center)
    normals = normals * np.sign(np.sum(normals * views, axis=1, keepdims=True))
    tangents = np.cross(normals, unit(rng, count))
    return normals, tangents / np.linalg.norm(tangents, axis=1, keepdims=True), views


def summed(brdf, normals, tangents, views):
    """What brushed surfaces reflect of the room, as sums over all of its pixels."""
    light, weights = brute_force.latlong_samples(HEIGHT)
    radiance = lit_room().reshape(-1, 3)
    result = []
    for normal, tangent, view in zip(normals, tangents, views, strict=True):
        axes = np.stack([tangent, np.cross(normal, tangent), normal], axis=1)
        above = light @ normal > 0
        values = brdf.evaluate(light[above] @ axes, (view @ axes)[None])
        cosine = (light @ normal)[above]
        result.append(((weights[above] * cosine)[:, None] * values * radiance[above]).sum(axis=0))
    return np.array(result)


@pytest.mark.proof
@pytest.mark.parametrize(
    ("brdf", "options"),
    [
        (WARD, {"maps": 30}),
        (GGX, {"maps": 30}),
        (GGX, {"maps": 30, "center": "normal"}),
        (SUM, {"error": 0.03}),
        (Skewed(), {"maps": 30}),
        (Napped(), {"maps": 40}),
    ],
    ids=["ward", "ggx", "normal", "sum", "skewed", "napped"],
)
def test_the_predicted_error_is_that_of_any_tangents(room, brdf, options):
    chosen = parse_spec(brdf) if isinstance(brdf, str) else brdf
    made = prefilter(room, chosen, to="principal", **options)
    points = surfaces(1500, options.get("center", "reflection"))
    error = relative_rms(made.brushed_radiance(*points), summed(chosen, *points))
    predicted = np.hypot(made.info.predicted_error, made.info.filter_error)
    assert 0.8 < error / predicted < 1.25


@pytest.mark.proof
def test_files_hold_lobes_with_and_without_brush_marks(room, tmp_path):
    made = prefilter(room, SUM, to="principal", maps=12)
    made.save(tmp_path / "sum.exr", "float")
    again = open_map(tmp_path / "sum.exr")
    assert [lobe.is_brushed for lobe in again.lobes] == [False, True]
    points = surfaces(200)
    found = again.brushed_radiance(*points)
    np.testing.assert_allclose(found, made.brushed_radiance(*points), rtol=1e-4, atol=1e-6)
    for layout in ("strip", "latlong"):
        made.save(tmp_path / "other.exr", layout=layout)
        other = open_map(tmp_path / "other.exr").brushed_radiance(*points)
        assert relative_rms(other, found) < (0.02 if layout == "latlong" else 2e-3)


def test_what_cannot_hold_them_is_refused(room):
    with pytest.raises(ArgumentError, match="depends on tangents"):
        prefilter(room, SUM, to="principal", divide=True)
    with pytest.raises(BrdfError, match="take `to` principal"):
        prefilter(room, GGX, to="shrm")
    made = PrincipalMap((brushed_lobe(1, [(0, 0), (2, 0)]),), make_info(4, 3))
    for to in ("shrm", "cabral"):
        with pytest.raises(MapError, match=r"knows no tangents.* a product texture of the probe"):
            made.converted(to)


@pytest.mark.parametrize(
    "waves", ["", "[]", "[[0]]", "[[0, 2]]", "[[0.5, 0]]", "[[0, 0], [1000, 0]]", "[[0, 0]]", "{"]
)
def test_wrong_waves_are_refused(tmp_path, waves):
    path = tmp_path / "map.exr"
    PrincipalMap((brushed_lobe(1, [(0, 0), (2, 0)]),), make_info(4, 3)).save(path)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        file.parts[0].header["shrm:waves"] = waves
        file.write(str(path))
    refused(path)


def test_damaged_files_are_refused(tmp_path):
    path = tmp_path / "map.exr"
    PrincipalMap((brushed_lobe(1, [(0, 0), (2, 0)]),), make_info(4, 3)).save(path)
    survives_flipped_bits(path, 150)


@pytest.mark.proof
def test_half_keeps_dim_light(room, tmp_path):
    dim = Probe.from_array(lit_room() * np.float32(1e-8))
    made = prefilter(dim, GGX, to="principal", maps=4)
    assert made.save(tmp_path / "dim.exr") == "float"


@pytest.mark.proof
def test_waves_hold_the_energy_of_all_azimuths():
    for brdf, quarters in ((parse_spec(GGX), 1), (Skewed(), 2), (Napped(), 4)):
        found = compute_brushed_transfer(brdf, 16, 4, 1e-3)
        assert azimuths_of(found).quarters == quarters
        energies = wave_energies(found).sum(axis=1)
        assert energies == pytest.approx(found.degree_energy.sum(axis=1), rel=1e-4)


@pytest.mark.parametrize("degree", [0, 1, 4, 12])
def test_cones_tell_all_orders_apart(degree):
    angle, azimuths, inverse = cone_rule(degree)
    around = np.sin(angle) * np.cos(azimuths), np.sin(angle) * np.sin(azimuths)
    cone = np.stack([*around, np.full(len(azimuths), np.cos(angle))], axis=-1)
    harmonics = inverse @ real_harmonics(degree, cone)[:, degree**2 :]
    expected = np.zeros_like(harmonics)
    expected[0, degree] = 1
    for q in range(1, degree + 1):
        expected[q, degree + q] = expected[degree + q, degree - q] = np.sqrt(2)
    np.testing.assert_allclose(harmonics, expected, atol=1e-12)


@pytest.mark.proof
def test_the_predicted_share_of_wrong_pixels_counts_all_azimuthal_orders(room):
    """Brushed lobes have more of them than maps hold, which are seen as soon as they miss."""
    brdf = parse_spec("ggx:roughness=0.5,anisotropy=0.9")
    given = {"brdf": brdf, "maps": 60, "center": "normal"}
    made = prefilter_with_facts(room, "principal", given)
    points = surfaces(3000)
    truth, found = (
        values @ LUMINANCE for values in (summed(brdf, *points), made.map.brushed_radiance(*points))
    )
    limit = 0.05 * np.maximum(truth, 0.02 * truth.mean())
    share = np.mean(np.abs(found - truth) > limit)
    assert 0.8 < share / made.further["predicted_wrong_share"]() < 1.25


@pytest.mark.filterwarnings("ignore:the probe is black:shrm_cli.errors.ShrmWarning")
def test_black_light_is_reflected_as_nothing():
    dark = Probe.from_array(np.zeros((16, 32, 3), np.float32))
    made = prefilter(dark, WARD, to="principal", error=0.3)
    normals, tangents, views = surfaces(20)
    assert not made.brushed_radiance(normals, tangents, views).any()
