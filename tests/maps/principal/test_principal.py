"""Maps of principal functions: what they reflect, their errors, their files and conversions."""

from dataclasses import replace
from itertools import product

import numpy as np
import OpenEXR
import pytest

from research.bilinear import look_up
from research.looked_up import looked_up
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_transfer
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.principal import functions
from shrm_cli.maps.principal import terms as principal_terms
from shrm_cli.maps.principal.principal import Lobe, PrincipalMap
from shrm_cli.maps.principal.terms import _transfer as transfer_functions
from shrm_cli.maps.size import Band
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import Reference
from shrm_cli.reflected import kept_energy, weighted_power
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.harmonics import legendre_table
from tests import brute_force
from tests.brute_force import bright_pairs, unit
from tests.maps.damage import refused, survives_flipped_bits
from tests.maps.scenes import make_shrm, normals_of, uniform_points

HEIGHT = 64
pytestmark = pytest.mark.filterwarnings("ignore:.*is negative:shrm_cli.errors.ShrmWarning")
PAIRS = {"microfacet": 2000, "metal": 2000, "plastic": 5000}
"""Pairs at which errors are measured; that of plastic sits in few views, which graze it."""
SPECS = {
    "microfacet": "microfacet:sigma=0.3",
    "metal": "ggx:roughness=0.5,f0=0.9/0.6/0.3",
    "plastic": "ggx:roughness=0.5,f0=0.04",
}


def lit_room(height=HEIGHT):
    """A dim room with a coloured lamp and a window."""
    light, _ = brute_force.latlong_samples(height)
    lamp = np.exp(60 * (light @ np.array([0.6, 0.64, 0.48]) - 1))[:, None]
    window = np.exp(12 * (light @ np.array([0.0, 0.0, -1.0]) - 1))[:, None]
    pixels = 0.05 + lamp * np.array([30.0, 20.0, 10.0]) + window * np.array([0.5, 1.0, 2.0])
    return pixels.reshape(height, 2 * height, 3).astype(np.float32)


@pytest.fixture(scope="module")
def room():
    return Probe.from_array(lit_room())


def measured_error(made, probe, brdf, count=3000, seed=4):
    """The relative RMS error over central directions and visible views, by integration."""
    rng = np.random.default_rng(seed)
    centers, views, shares = bright_pairs(rng, made, count)
    normals = normals_of(centers, views)
    truth = Reference(probe, brdf, dtype=np.float64, exact=True).radiance(normals, views)
    found = made.radiance(normals, views)
    return np.sqrt(np.sum(shares * (found - truth) ** 2) / np.sum(shares * truth**2))


def shown_error(made, probe, brdf, count):
    """The same with bilinear look-ups in half precision, as on a GPU."""
    (lobe,) = made.lobes
    half = made.planes()[0].astype(np.float16)
    rng = np.random.default_rng(5)
    centers, views, shares = bright_pairs(rng, made, count)
    truth = Reference(probe, brdf, dtype=np.float64, exact=True).radiance(
        normals_of(centers, views), views
    )
    found = lobe.radiance(lambda directions: look_up(half, directions), centers, views)
    return np.sqrt(np.sum(shares * (found - truth) ** 2) / np.sum(shares * truth**2))


def spectrum_of(probe, brdf, divide):
    """The functions of a BRDF to order 64, for the light of a probe."""
    transfer = compute_transfer(brdf, 64, 6, 1e-4)
    light = weighted_power(Projection(probe).to_order(64), 64)
    return functions.Spectrum.of(transfer, brdf.center, light, divide)


# ---- what they reflect ---------------------------------------------------------------------------


def of_legendre_functions(shrm):
    """An SHRM as a map of principal functions: its cubes, with its own functions of the view."""
    order = shrm.order_p
    degrees = tuple(range(order, -1, -1))
    table = legendre_table(order, np.cos(np.linspace(0, np.pi, 1801)))
    functions = np.stack([table[q, p - q] for p in degrees for q in range(p + 1)])
    functions = np.repeat(functions[..., None], 3, axis=2)
    cubes = np.concatenate([shrm.coefficients[:, :, p**2 : (p + 1) ** 2] for p in degrees], axis=2)
    return PrincipalMap((Lobe(cubes, degrees, functions, "reflection"),), shrm.info)


def test_legendre_functions_make_an_shrm():
    shrm = make_shrm(order_p=3, size=16)
    made = of_legendre_functions(shrm)
    points = uniform_points(500)
    expected = shrm.radiance(*points)
    np.testing.assert_allclose(made.radiance(*points), expected, atol=2e-5 * np.abs(expected).max())
    back = made.to_shrm(3)
    np.testing.assert_allclose(back.coefficients, shrm.coefficients, atol=1e-4)
    assert back.info.added_error < 1e-5
    assert made.to_shrm(1).info.added_error == pytest.approx(
        shrm.truncated(1).info.added_error, rel=1e-3
    )


def test_what_an_expansion_loses_is_known_of_light_of_any_brightness():
    """Squares of values of 1e22 are beyond 32-bit floats, and the error was NaN."""
    shrm = make_shrm()
    lit = replace(shrm, coefficients=(1e22 * shrm.coefficients).astype(np.float32))
    found = of_legendre_functions(lit).to_shrm(1).info.added_error
    assert found == pytest.approx(shrm.truncated(1).info.added_error, rel=1e-3)


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize("divide", [False, True])
@pytest.mark.parametrize("name", SPECS)
def test_measured_error_is_the_predicted_one(room, name, divide):
    brdf = parse_spec(SPECS[name])
    for maps in (12,) if name == "plastic" else (4, 12):
        made = prefilter(room, brdf, to="principal", maps=maps, size=32, divide=divide)
        assert made.cube_count <= maps
        measured = measured_error(made, room, brdf, PAIRS[name])
        assert measured == pytest.approx(made.info.predicted_error, rel=0.1)


@pytest.mark.proof
@pytest.mark.parametrize("name", SPECS)
def test_a_tolerance_is_kept_where_the_albedo_is_divided_by(room, name):
    """The tolerance is a part of the energy of the quotient, which views share more evenly."""
    brdf = parse_spec(SPECS[name])
    made = prefilter(room, brdf, to="principal", eps=0.2, divide=True)
    assert made.lobes[0].albedo is not None
    assert made.cube_count > 1
    assert 0.8 <= made.info.captured < 1
    total = np.hypot(made.info.predicted_error, made.info.filter_error)
    assert shown_error(made, room, brdf, PAIRS[name]) == pytest.approx(total, rel=0.1)


def test_rough_radiance_is_what_is_stored_in_the_nearest_texels(room):
    """At the centers of texels nothing is interpolated, whatever the view is."""
    made = prefilter(room, SPECS["metal"], to="principal", maps=12, size=16)
    centers = cube_directions(16).reshape(-1, 3)[::3]
    views = normals_of(centers, unit(np.random.default_rng(1), len(centers)))
    beside = centers + 1e-3 * unit(np.random.default_rng(2), len(centers))
    beside /= np.linalg.norm(beside, axis=1)[:, None]
    expected = made.radiance(normals_of(centers, views), views)
    found = made.rough_radiance(beside, views)
    np.testing.assert_allclose(found, expected, atol=0.02 * np.abs(expected).max())
    np.testing.assert_allclose(
        made.rough_radiance(centers, views), expected, atol=1e-5 * np.abs(expected).max()
    )


@pytest.mark.parametrize("divide", [False, True])
@pytest.mark.parametrize("spec", [SPECS["plastic"], SPECS["microfacet"], "oren-nayar"])
def test_energies_of_functions_are_what_they_take_from_the_error(room, spec, divide):
    """Whether they are added up function by function, or the rest is integrated over the views."""
    spectrum = spectrum_of(room, parse_spec(spec), divide)
    order = spectrum.transfer.order_f
    bands = Band.exact(order), Band(order // 3, order // 2)
    for counts, band in product(((1,), (3, 2, 1), (6, 5, 3, 2)), bands):
        rest = spectrum.missing(counts, band.factors)
        by_degree = np.diff(spectrum.kept(counts), prepend=0.0)[: band.last + 1]
        kept = by_degree @ kept_energy(band.factors)
        assert spectrum.whole() - kept == pytest.approx(rest, rel=0.03)
        parts = [spectrum.parts[q][:count] for q, count in enumerate(counts)]
        shown = sum(spectrum.shown_energy(q, each, spectrum.light) for q, each in enumerate(parts))
        assert shown == pytest.approx(integrated_energy(spectrum, counts), rel=1e-9)


def integrated_energy(spectrum, counts):
    """The energy of what functions show, by a sum over the views."""
    total = 0.0
    for q, count in enumerate(counts):
        parts = spectrum.parts[q][:count]
        functions = spectrum.vectors[q][:count] * spectrum.unit
        shown = 2 * np.pi * np.einsum("klc,koc->loc", parts, functions)
        squares = np.einsum("loc,o->lc", shown**2, spectrum.weights) / (2 * np.pi)
        total += (2 if q else 1) * np.sum(spectrum.light * squares)
    return total


def test_dark_views_get_more_than_their_share(room, monkeypatch):
    """Facing views of plastic reflect a tenth of what grazing ones do."""
    brdf = parse_spec(SPECS["plastic"])
    errors, predicted = [], []
    centers, views = uniform_points(4000)
    facing = np.sum(centers * views, axis=1) > np.cos(np.radians(45))
    centers, views = centers[facing], views[facing]
    normals = normals_of(centers, views)
    truth = Reference(room, brdf, dtype=np.float64, exact=True).radiance(normals, views)
    for evenness in (0.0, functions._EVENNESS):
        monkeypatch.setattr(functions, "_EVENNESS", evenness)
        made = prefilter(room, brdf, to="principal", maps=9, size=32)
        errors.append(np.linalg.norm(made.radiance(normals, views) - truth))
        predicted.append(made.info.predicted_error)
    assert errors[1] < 0.95 * errors[0]
    assert predicted[0] < predicted[1] < 1.02 * predicted[0]


@pytest.mark.proof
@pytest.mark.parametrize("spec", ["phong:exponent=512", "microfacet:sigma=0.05"])
@pytest.mark.slow
def test_light_is_carried_as_far_as_in_an_shrm_of_its_size(spec):
    """What the tolerance asks for is less than a cube of that size can show of a bare sun."""
    pixels = np.full((256, 512, 3), 0.05, dtype=np.float32)
    pixels[100, 300] = 3000
    sun = Probe.from_array(pixels)
    shrm = prefilter(sun, spec, size=96, sun="keep")
    made = prefilter(sun, spec, to="principal", size=96, sun="keep")
    assert made.info.order_f < made.info.order_carried
    assert made.info.order_carried >= shrm.info.order_carried > 100


@pytest.mark.slow
def test_more_maps_are_better(room):
    errors = [
        prefilter(room, SPECS["plastic"], to="principal", maps=maps, size=16).info.predicted_error
        for maps in (1, 3, 9, 25, 49)
    ]
    assert (np.diff(errors) < 0).all()
    assert errors[-1] < errors[0] / 8


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize("name", ["metal", "plastic"])
def test_half_the_error_of_an_shrm_with_as_many_maps(room, name):
    shrm = prefilter(room, SPECS[name], order_p=4, size=32, eps=0.5)
    made = prefilter(room, SPECS[name], to="principal", maps=shrm.cube_count, size=32)
    brdf = parse_spec(SPECS[name])
    pair = [measured_error(each, room, brdf, 1500) for each in (made, shrm)]
    assert pair[0] < pair[1] / 2


@pytest.mark.slow
def test_the_view_is_read_without_a_pole(room):
    """Small steps of the normal make small steps of light, where N = V, at +-Z and at grazing."""
    made = prefilter(room, SPECS["metal"], to="principal", maps=12)
    rng = np.random.default_rng(2)
    for view in (np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.6, 0.8])):
        for toward in (view, np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])):
            offsets = 1e-4 * unit(rng, 50)
            normals = toward + offsets
            normals /= np.linalg.norm(normals, axis=1)[:, None]
            if toward @ view < 0.05:
                continue
            light = made.radiance(normals, view)
            assert np.ptp(light, axis=0).max() < 0.01 * light.max()


@pytest.mark.proof
@pytest.mark.slow
def test_terms_have_centers_of_their_own(room):
    spec = "0.5*lambertian+0.5*ggx:roughness=0.4,f0=0.04"
    made = prefilter(room, spec, to="principal", error=0.04)
    assert made.center == "normal+reflection"
    assert made.lobes[0].cubes.shape[2] == 1
    assert measured_error(made, room, parse_spec(spec)) < 0.04
    with pytest.raises(MapError, match="no single SHRM"):
        made.to_shrm()


def test_diffuse_brdfs_count_only_visible_views(room):
    brdf = parse_spec("oren-nayar:sigma=0.6")
    made = prefilter(room, brdf, to="principal", maps=3, size=32)
    rng = np.random.default_rng(0)
    normals, views = unit(rng, 3000), unit(rng, 3000)
    views *= np.sign(np.sum(normals * views, axis=1))[:, None]
    truth = Reference(room, brdf, exact=True).radiance(normals, views)
    measured = np.sqrt(np.sum((made.radiance(normals, views) - truth) ** 2) / np.sum(truth**2))
    assert measured == pytest.approx(made.info.predicted_error, rel=0.1)


def test_hair_is_about_its_tangent(room):
    brdf = parse_spec("kajiya-kay:exponent=16")
    made = prefilter(room, brdf, to="principal", error=0.05)
    assert made.center == "tangent"
    shrm = prefilter(room, brdf, eps=1e-4)
    points = uniform_points(300, "normal")
    difference = made.radiance(*points) - shrm.radiance(*points)
    assert np.sqrt(np.mean(difference**2)) < 0.05 * np.sqrt(np.mean(shrm.radiance(*points) ** 2))


# ---- what is asked for ---------------------------------------------------------------------------


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize("divide", [False, True])
@pytest.mark.parametrize(
    ("name", "error"), [("microfacet", 0.02), ("metal", 0.03), ("plastic", 0.05)]
)
def test_an_error_is_kept_with_bilinear_look_ups_and_half(room, name, error, divide):
    brdf = parse_spec(SPECS[name])
    made = prefilter(room, brdf, to="principal", error=error, divide=divide)
    measured = shown_error(made, room, brdf, PAIRS[name])
    total = np.hypot(made.info.predicted_error, made.info.filter_error)
    assert total <= error
    assert measured < 1.1 * error
    assert measured == pytest.approx(total, rel=0.15)


def test_a_smaller_error_takes_more_bytes(room):
    sizes = []
    for error in (0.3, 0.1, 0.05, 0.02):
        made = prefilter(room, SPECS["plastic"], to="principal", error=error)
        sizes.append(made.size**2 * made.cube_count)
    assert sizes == sorted(sizes)
    assert len(set(sizes)) == 4


@pytest.mark.filterwarnings("ignore:.*400 kB before packing hold:shrm_cli.errors.ShrmWarning")
def test_no_degrees_are_computed_for_cubes_that_the_bytes_rule_out(room, monkeypatch):
    found = {}
    for is_bounded in (True, False):
        if not is_bounded:
            monkeypatch.setattr(principal_terms, "_fills_budget", lambda *_: False)
        orders = []

        def noted(brdf, order, *more, orders=orders):
            orders.append(order)
            return transfer_functions(brdf, order, *more)

        monkeypatch.setattr(principal_terms, "_transfer", noted)
        made = prefilter(room, "ggx:roughness=0.3", to="principal", eps=0.03, max_size=400_000)
        found[is_bounded] = max(orders), made
    (few, map_of_few), (many, map_of_many) = found[True], found[False]
    assert few < many
    assert map_of_few.size == map_of_many.size < 64
    assert map_of_few.lobes[0].degrees == map_of_many.lobes[0].degrees
    pair = bright_pairs(np.random.default_rng(5), map_of_many, 500)[:2]
    radiance = [made.radiance(normals_of(*pair), pair[1]) for made in (map_of_few, map_of_many)]
    assert np.linalg.norm(radiance[0] - radiance[1]) < 0.01 * np.linalg.norm(radiance[1])


@pytest.mark.proof
@pytest.mark.filterwarnings("ignore:.*1.2 MB before packing hold:shrm_cli.errors.ShrmWarning")
def test_all_azimuthal_orders_are_known_where_bytes_bound_a_map(room, monkeypatch):
    """Plastic at grazing views has more of them than are computed first, and they are an error."""
    asked = {"brdf": "ggx:roughness=0.3,f0=0.04", "to": "principal", "max_size": 1_200_000}
    bounded = prefilter(room, **asked)
    monkeypatch.setattr(principal_terms, "_fills_budget", lambda *_: False)
    expected = prefilter(room, **asked).info.predicted_error
    assert bounded.info.predicted_error == pytest.approx(expected, rel=0.02)


def test_zonal_lobes_need_one_map(room):
    for eps in (0.1, 0.001):
        assert prefilter(room, "phong:exponent=20", to="principal", eps=eps).cube_count == 1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"maps": 3, "error": 0.1}, "does not apply with"),
        ({"eps": 0.1, "error": 0.1}, "does not apply with `error`"),
        ({"eps": 0.1, "seen": 0.1}, "does not apply with `seen`"),
        ({"maps": 1, "brdf": "0.5*ggx+0.5*microfacet"}, "less than the 2 terms"),
        ({"order_p": 3}, "applies with"),
        ({"domain": "angular"}, "applies with"),
    ],
)
def test_refused_options(room, options, words):
    with pytest.raises(ArgumentError, match=words):
        prefilter(room, to="principal", **{"brdf": "ggx", **options})


# ---- files ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["one", "two", "divided"])
def stored(request, room, tmp_path_factory):
    spec = "0.5*lambertian+0.5*ggx:roughness=0.6" if request.param == "two" else SPECS["metal"]
    made = prefilter(room, spec, to="principal", maps=7, size=16, divide=request.param == "divided")
    path = tmp_path_factory.mktemp("principal") / "map.exr"
    made.save(path, "float")
    return made, path


def test_files_hold_the_map(stored):
    made, path = stored
    again = open_map(path)
    points = uniform_points(200)
    expected = made.radiance(*points)
    np.testing.assert_allclose(
        again.radiance(*points), expected, atol=1e-5 * np.abs(expected).max()
    )
    assert again.details() == made.details()
    assert again.info.brdf == made.info.brdf
    assert again.info.order_carried == made.info.order_carried
    assert again.info.filter_error == pytest.approx(made.info.filter_error, rel=1e-6)


def test_layouts(stored, tmp_path):
    made, _ = stored
    made.save(tmp_path / "cross.exr", "float", "hcross", "gl")
    again = open_map(tmp_path / "cross.exr")
    points = uniform_points(50)
    np.testing.assert_allclose(again.radiance(*points), made.radiance(*points), rtol=1e-3)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("shrm:degrees", "[13]"), ("shrm:degrees", "[0.5]"), ("shrm:degrees", "{}"),
        ("shrm:degrees", "[0, 0]"), ("shrm:functions", "{}"), ("shrm:functions", "[" * 5000),
        ("shrm:functions", '{"shape": [1, 91, 3], "values": [1]}'),
        ("shrm:functions", '{"shape": [99999999, 91, 3], "values": []}'),
        ("shrm:functions", '{"shape": [1, 1, 3], "values": [1, NaN, 1]}'),
    ],
)  # fmt: skip
def test_wrong_attributes_are_refused(room, tmp_path, name, value):
    made = prefilter(room, SPECS["metal"], to="principal", maps=1)
    path = tmp_path / "map.exr"
    made.save(path, "float")
    with OpenEXR.File(str(path)) as file:
        header, channels = file.header(), file.channels()
        header[name] = value
        OpenEXR.File(header, channels).write(str(path))
    refused(path, name if name == "shrm:functions" or value != "[0, 0]" else "")


@pytest.mark.slow
def test_flipped_bits(stored):
    survives_flipped_bits(stored[1], 60, least=1)


def test_damaged_shapes_are_refused_in_memory():
    cubes = np.zeros((24, 4, 3, 3))
    info = MapInfo(1, 1, 0.03, 1.0, 0.0)
    for degrees, shape in (((0,), (1, 5, 3)), ((1,), (1, 5, 3)), ((), (0, 5, 3))):
        with pytest.raises(ValueError, match=r"bundles|functions"):
            Lobe(cubes, degrees, np.zeros(shape), "reflection")
    with pytest.raises(ValueError, match="one lobe"):
        PrincipalMap((), info)


def test_resampled_maps_say_what_it_costs(stored):
    made, _ = stored
    small = made.resampled(8)
    assert small.size == 8
    assert 0 < small.info.added_error < 1


@pytest.mark.proof
@pytest.mark.parametrize("size", [8, 12])
def test_a_resampled_sum_says_what_each_lobe_loses(room, size):
    """Its first lobe is diffuse and loses next to nothing, and the other one is sharp."""
    made = prefilter(room, "0.5*lambertian+0.5*ggx:roughness=0.4", to="principal", maps=10)
    assert [lobe.center for lobe in made.lobes] == ["normal", "reflection"]
    small = made.resampled(size)
    rng = np.random.default_rng(9)
    centers, views, shares = bright_pairs(rng, made, 6000)
    normals = normals_of(centers, views)
    truth = made.radiance(normals, views)

    def error(found):
        return np.sqrt(np.sum(shares * (found - truth) ** 2) / np.sum(shares * truth**2))

    added = error(small.radiance(normals, views))
    as_on_a_gpu = error(looked_up(small, normals, views))
    info = small.info
    assert info.added_error == pytest.approx(added, rel=0.2)
    assert np.hypot(info.added_error, info.filter_error) == pytest.approx(as_on_a_gpu, rel=0.2)


def test_explicit_maps_of_lobes(room):
    made = prefilter(room, "0.5*lambertian+0.5*ggx:roughness=0.6", to="principal", error=0.02)
    tabulated = made.converted("cabral", size=16)
    assert tabulated.representation == "cabral"
    vertices = tabulated.sample_views(12)
    centers = unit(np.random.default_rng(1), 50)
    for view in vertices[:3]:
        expected = made.resampled(16).central_radiance(centers, view)
        found = tabulated.central_radiance(centers, np.broadcast_to(view, centers.shape))
        error = np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))
        assert error < 0.03
