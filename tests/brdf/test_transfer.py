"""Transfer functions against quadrature of single views that shares no code with them."""

import hashlib
import re
from itertools import pairwise

import numpy as np
import pytest
from scipy import integrate
from scipy.special import sph_harm_y

from shrm_cli.arrays import Memo
from shrm_cli.brdf import cache
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import cached_transfer
from shrm_cli.brdf.coefficients import accuracy_remark
from shrm_cli.brdf.lobe_expansion import LobeExpander, light_rule
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import LobeSampling, compute_coefficients, compute_transfer
from shrm_cli.errors import BrdfError
from shrm_cli.progress import using
from shrm_cli.sphere.quadrature import interpolation_matrix
from tests import ggx
from tests.brdf.caches import Counted, new_cache


def gauss(low, high, count):
    x, w = np.polynomial.legendre.leggauss(count)
    return (low + high) / 2 + (high - low) / 2 * x, (high - low) / 2 * w


def lobe_around_mirror(roughness, theta_o, wanted):
    """2 pi int rho_hat f_lq cos(q phi) of a white GGX by Gauss's rule on panels that halve."""
    reflection = np.array([0.0, 0.0, 1.0])
    view = np.array([np.sin(theta_o), 0.0, np.cos(theta_o)])
    normal = (reflection + view) / np.linalg.norm(reflection + view)
    edges = np.append(0, np.pi * 2.0 ** -np.arange(11, -1, -1))
    panels = [gauss(a, b, 40) for a, b in pairwise(edges)]
    theta, weights = (np.concatenate(part) for part in zip(*panels, strict=True))
    phi = np.pi * (np.arange(1200) + 0.5) / 1200
    sine = np.sin(theta)[:, None]
    light = np.stack(
        np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)[:, None]), -1
    )
    base, _ = ggx.lobe(roughness, normal, view, light.reshape(-1, 3))
    value = base.reshape(len(theta), -1)
    weights = weights * np.sin(theta)
    found = {}
    for degree, q in wanted:
        legendre = np.real(sph_harm_y(degree, q, theta, 0.0)) * (-1) ** q  # without the phase
        around = (value @ np.cos(q * phi)) * 2 * np.pi / len(phi)
        found[degree, q] = 2 * np.pi * np.sum(weights * legendre * around)
    energy = 2 * np.pi * np.sum(weights * (value**2).sum(axis=1)) * 2 * np.pi / len(phi)
    return found, energy


@pytest.mark.proof
@pytest.mark.parametrize(("roughness", "order"), [(0.5, 60), (0.2, 250), (0.1, 250)])
@pytest.mark.slow
def test_lobes_of_generic_views(roughness, order):
    wanted = [(0, 0), (3, 1), (10, 2), (order // 2, 4), (order, 0), (order, 3)]
    accuracy = 1e-4
    found = compute_transfer(parse_spec(f"ggx:roughness={roughness},f0=1"), order, 4, accuracy)
    assert found.remark is None
    assert found.values.shape == (5, order + 1, len(found.theta_o), 3)
    scale = np.sqrt(found.total_energy[0])
    for node in np.searchsorted(found.theta_o, [0.3, 1.3, 2.2, 2.7]):
        expected, energy = lobe_around_mirror(roughness, found.theta_o[node], wanted)
        assert np.sqrt(energy) > 0.1 * scale
        for (degree, q), value in expected.items():
            error = abs(found.values[q, degree, node] - value).max()
            assert error < np.sqrt(accuracy) * scale, (degree, q)


@pytest.mark.parametrize("sigma", [0.005, 0.05, 0.4])
def test_the_sharpest_lobe_seen_along_the_normal(sigma):
    """rho_hat is then a Gaussian of theta_i / 2, and one adaptive integral gives a coefficient."""
    brdf = parse_spec(f"microfacet:sigma={sigma}")
    order = 300
    found = LobeExpander(brdf, light_rule(brdf), order, 2).expand(np.zeros(1), 384, 12)
    assert found.values.shape == (3, order + 1, 1, 1)
    assert np.abs(found.values[1:]).max() < 1e-12
    for degree in (0, 5, 120, 300):

        def integrand(theta, degree=degree):
            lobe = np.exp(-((theta / 2 / sigma) ** 2)) / (4 * np.pi * sigma**2)
            return lobe * np.real(sph_harm_y(degree, 0, theta, 0.0)) * np.sin(theta)

        ends = [0, min(12 * sigma, np.pi / 2), np.pi / 2]
        integral = sum(
            integrate.quad(integrand, a, b, epsabs=1e-12, limit=400)[0] for a, b in pairwise(ends)
        )
        expected = 4 * np.pi**2 * integral
        assert found.values[0, degree, 0, 0] == pytest.approx(expected, abs=1e-3, rel=1e-4)


def test_brushed_lobes_are_those_of_the_surface_turned_below_the_view():
    """A view of an azimuth sees what one of azimuth 0 does of a surface whose tangent is turned."""
    own, azimuth = parse_spec("ward:ax=0.2,ay=0.5"), 0.7

    class Below(Brdf):
        isotropic = False

        def evaluate(self, light, view):
            x, y = [np.cos(azimuth), np.sin(azimuth), 0], [-np.sin(azimuth), np.cos(azimuth), 0]
            turn = np.array([x, y, [0, 0, 1]])
            return own.evaluate(light @ turn, view @ turn)

    theta_o = np.array([0.5, 1.6, 2.9])
    found, expected, other = (
        LobeExpander(brdf, light_rule(own), 12, 4).expand(theta_o, 96, 48, turn).values
        for brdf, turn in ((own, azimuth), (Below(), 0.0), (own, 0.0))
    )
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * abs(expected).max())
    assert abs(found - other).max() > 0.1 * abs(found).max()


@pytest.mark.parametrize("spec", ["ward:ax=0.1,ay=0.3", "ggx:roughness=0.5,anisotropy=0.8"])
def test_views_of_brushed_lobes_are_as_fine_as_the_accuracy_asks(spec):
    """High azimuthal orders, of which brushed lobes hold little, need no views of their own."""
    brdf, azimuth, accuracy = parse_spec(spec), np.pi / 12, 1e-4
    sampling = LobeSampling(brdf, 32, 24, accuracy)
    few, many = (sampling.result(least, azimuth) for least in (0, 150))
    assert 2 * len(few.theta_o) < len(many.theta_o) == 150
    missed = 0.0
    for q, (own, truth) in enumerate(zip(few.values[..., 0], many.values[..., 0], strict=True)):
        # The sines come behind the cosines.
        matrix = interpolation_matrix(few.theta_o, many.theta_o, odd=q % 25 % 2 == 1)
        squares = (own @ matrix.T - truth) ** 2 @ many.weights
        missed += (2 if q % 25 else 1) * squares.sum() / (2 * np.pi)
    assert missed < accuracy * many.total_energy[0]


def test_coefficients_are_its_integrals_over_the_view():
    brdf = parse_spec("ggx:roughness=0.5,f0=gold")
    transfer = compute_transfer(brdf, 20, 6, 1e-4)
    coefficients = compute_coefficients(brdf, 20, 6, 1e-4)
    for degree, p, q in [(0, 0, 0), (5, 2, 1), (20, 6, 4), (9, 6, 6)]:
        legendre = np.real(sph_harm_y(p, q, transfer.theta_o, 0.0)) * (-1) ** q
        integral = (transfer.weights * legendre) @ transfer.values[q, degree]
        np.testing.assert_allclose(coefficients.values[degree, p, q], integral, atol=1e-12)
    np.testing.assert_array_equal(coefficients.total_energy, transfer.total_energy)
    assert 0.9 < transfer.degree_energy.sum() / transfer.total_energy.sum() < 1.001


def test_the_estimated_accuracy_is_no_less_than_the_error():
    for spec in ("ggx:roughness=0.4,f0=0.04", "microfacet:sigma=0.5", "oren-nayar"):
        brdf = parse_spec(spec)
        rough, fine = (compute_transfer(brdf, 32, 4, accuracy) for accuracy in (1e-3, 3e-5))
        assert rough.remark is None
        assert fine.accuracy < rough.accuracy <= 1e-3
        squares = (rough.projected(4) - fine.projected(4)) ** 2
        squares[:, :, 1:] *= 2
        total = fine.total_energy.sum()
        assert squares.sum() < 1e-3 * total
        assert abs(rough.total_energy.sum() - total) < 1e-3 * total


@pytest.mark.parametrize("spec", ["ggx:roughness=0.2,f0=1", "ggx:roughness=0.2,f0=0.04"])
def test_grazing_views_are_resolved(spec):
    """Values between the nodes are where a cubic through the nodes puts them."""
    brdf = parse_spec(spec)
    found = compute_transfer(brdf, 64, 2, 1e-4)
    between = np.array([2.3, 2.7, 2.9, 3.0])
    truth = LobeExpander(brdf, light_rule(brdf), 64, 2).expand(between, 768, 384).values[..., 0]
    values = found.values[..., 0]
    near = np.searchsorted(found.theta_o, between)
    for k, (angle, at) in enumerate(zip(between, near, strict=True)):
        nodes = slice(at - 2, at + 2)
        x = found.theta_o[nodes]
        lagrange = [np.prod([(angle - b) / (a - b) for b in x if b != a]) for a in x]
        guess = values[:, :, nodes] @ np.array(lagrange)
        size = np.linalg.norm(values[:, :, at])
        assert np.linalg.norm(guess - truth[:, :, k]) < 0.01 * size


class Noisy(Brdf):
    """White noise of the directions, as unlike a smooth function as can be."""

    name = "noisy"
    summary = source = "test"

    def __init__(self, measured):
        self.values = {"sha256": "0"} if measured else {}

    def evaluate(self, light, view):
        jumps = np.sin(1e5 * (light @ [1.0, 2.0, 3.0]) + 1e5 * (view @ [2.0, 1.0, 5.0]))
        return np.broadcast_to(((jumps > 0) + 0.1)[..., None], (*jumps.shape, 3))


def test_noise_of_measured_data_stops_nothing(monkeypatch):
    monkeypatch.setattr("shrm_cli.brdf.transfer._MOST_SAMPLES", (2**18, 2**18))
    monkeypatch.setattr("shrm_cli.brdf.transfer._WORST", 2e-4)
    found = compute_coefficients(Noisy(measured=True), 8, 2, 1e-4)
    assert found.accuracy > 1e-4
    assert "not to 0.0001" in found.remark
    assert found.remark.count("\n") == 0
    with pytest.raises(BrdfError, match="not converged"):
        compute_coefficients(Noisy(measured=False), 8, 2, 1e-4)


@pytest.mark.parametrize(
    ("accuracy", "asked", "words"),
    [
        (0.0045, 1 / 3000, "good to 0.0045 of its energy, not to 0.00033"),
        (0.000334, 1 / 3000, "good to 0.000334 of its energy, not to 0.000333"),
        (0.1 + 1e-7, 0.1, "good to 0.1000001 of its energy, not to 0.1"),
        (np.nextafter(0.1, 1), 0.1, "not to 0.1"),
        (0.1, 0.1, None),
        (0.05, 0.1, None),
    ],
)
def test_remarks_name_two_numbers(accuracy, asked, words):
    remark = accuracy_remark(accuracy, asked)
    assert (remark is None) == (words is None)
    if words is not None:
        assert words in remark
        reached, wanted = re.findall(r"(?:good|not) to ([0-9.e-]+)", remark)
        assert float(reached) > float(wanted)


def test_what_has_converged_needs_no_remark():
    assert compute_coefficients(parse_spec("microfacet"), 8, 2, 1e-3).remark is None
    assert compute_transfer(parse_spec("lambertian"), 8, 2, 1e-3).remark is None


def test_zonal_functions_do_not_depend_on_the_view():
    found = compute_transfer(parse_spec("phong:exponent=8"), 12, 2)
    assert not found.values[1:].any()
    assert (found.values[0] == found.values[0][:, :1]).all()
    expected = compute_coefficients(parse_spec("phong:exponent=8"), 12, 0)
    np.testing.assert_allclose(found.projected(0), expected.values, atol=1e-14)
    np.testing.assert_allclose(found.degree_energy, expected.degree_energy, atol=1e-14)


def test_progress_goes_on_and_stays_below_the_whole():
    calls = []
    with using(lambda done, total: calls.append((done, total))):
        compute_transfer(parse_spec("ggx:roughness=0.3"), 32, 4, 1e-4)
    done = [part / whole for part, whole in calls]
    assert len(done) > 5
    assert done == sorted(done)
    assert 0.9 < done[-1] <= 1


def test_anisotropic_brdfs_are_refused():
    with pytest.raises(BrdfError, match="anisotropic"):
        compute_transfer(parse_spec("ward:ax=0.1,ay=0.3"), 8, 2)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    return new_cache(tmp_path, monkeypatch)


def test_the_cache_gives_them_back_to_the_last_bit(folder):
    compute = Counted(compute_transfer)
    for spec in ("ggx:roughness=0.6,f0=gold", "lambertian"):
        brdf = parse_spec(spec)
        first = cached_transfer(brdf, 10, 3, 1e-3, compute)
        again = cached_transfer(brdf, 10, 3, 1e-3, compute)
        for name in ("values", "theta_o", "weights", "total_energy"):
            np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
        assert (first.samples, first.accuracy) == (again.samples, again.accuracy)
        assert (first.asked, first.remark) == (again.asked, again.remark)
    assert compute.calls == 2
    cached_transfer(parse_spec("lambertian"), 10, 4, 1e-3, compute)
    cached_transfer(parse_spec("lambertian"), 11, 3, 1e-3, compute)
    cached_transfer(parse_spec("lambertian"), 10, 3, 1e-4, compute)
    assert compute.calls == 5


def test_coefficients_and_transfer_functions_have_entries_of_their_own(folder):
    brdf = parse_spec("microfacet:sigma=0.6")
    cached_transfer(brdf, 8, 3, 1e-3, compute_transfer)
    cache.cached_coefficients(brdf, 8, 3, 1e-3, compute_coefficients)
    assert cache.cache_usage()[0] == 2
    assert cached_transfer(brdf, 8, 3, 1e-3, compute_transfer).max_q == 3


def test_what_another_function_computes_has_an_entry_of_its_own(folder, monkeypatch):
    monkeypatch.setattr(cache, "_in_memory", Memo(0))

    def coarse(brdf, order_f, max_q, accuracy):
        return compute_transfer(brdf, order_f, max_q, 0.1)

    for _ in range(2):
        ways = coarse, compute_transfer
        rough, fine = (cached_transfer(parse_spec("phong"), 8, 3, 1e-4, way) for way in ways)
        assert (rough.asked, fine.asked) == (0.1, 1e-4)
    assert cache.cache_usage()[0] == 2


def test_damaged_entries_are_made_anew(folder):
    brdf, compute = parse_spec("microfacet:sigma=0.6"), Counted(compute_transfer)
    first = cached_transfer(brdf, 8, 3, 1e-3, compute)
    (path,) = folder.iterdir()
    content = path.read_bytes()
    start = len(b"shrm coefficients 1\n")
    longer = content[start + 32 :] + bytes(8)
    forged = content[:start] + hashlib.sha256(longer).digest() + longer
    for damaged in (content[:-1], content[:100], b"", content[:-1] + b"\xff\xff", forged):
        path.write_bytes(damaged)
        before = compute.calls
        again = cached_transfer(brdf, 8, 3, 1e-3, compute)
        assert compute.calls == before + 1
        np.testing.assert_array_equal(first.values, again.values)
        assert path.read_bytes() == content
