"""Prefiltering in the angular and in the frequency domain gives the same maps."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import MapError
from shrm_cli.maps.explicit.prefilter import prefilter_angular, prefilter_explicit
from shrm_cli.maps.request import Request
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.cube import cube_solid_angles, texel_solid_angles
from tests import oracles
from tests.cli.helpers import polynomial_light, write_exr
from tests.maps.shrm.test_predicted_error import reduced

# Errors are greatest at the grazing end of a Kautz-McCool map: few slices would make much of it.
VIEWS = {"cabral": {}, "kautz-mccool": {"slices": 15}, "lightfield": {"views": 5}}


def relative(found, expected):
    """RMS over views, texels and channels, by solid angle, over that of what is expected."""
    texels = texel_solid_angles(found.size)[..., None]
    weights = found.view_weights(found.count)[:, None, None, None] * texels
    error = np.sum(weights * (found.images - expected.images) ** 2)
    return np.sqrt(error / np.sum(weights * expected.images**2))


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize("representation", VIEWS)
@pytest.mark.parametrize("spec", ["microfacet:sigma=0.3", "phong:exponent=8", "lambertian"])
def test_band_limited_light(tmp_path, spec, representation):
    """Light of degree 3: what is left is the microfacet lobe's p > 20, and 128 x 64 pixels."""
    light = polynomial_light(oracles.latlong_pixels(128, 64)).astype(np.float32)
    probe, brdf = open_probe(write_exr(tmp_path / "probe.exr", light)), parse_spec(spec)
    options = {"size": 6, "own": VIEWS[representation]}
    one = prefilter_angular(probe, Request(representation, brdf, 1e-7, **options)).map
    other = Request(representation, brdf, 0.03, order_f=3, order_p=20, **options)
    other = prefilter_explicit(probe, other, dtype=np.float64).map
    error = relative(one, other)
    print(f"{spec} {representation}: {error:.2e}, predicted {other.info.predicted_error:.2e}")
    # The pixels make up to 2e-4, and the orders what they are predicted to, within a factor 2.
    assert error < 2 * other.info.predicted_error + 2e-4


@pytest.mark.parametrize(("name", "spec", "representation"), [
    ("interior", "microfacet:sigma=0.2", "cabral"),
    ("interior", "microfacet:sigma=0.2", "kautz-mccool"),
    ("interior", "microfacet:sigma=0.2", "lightfield"),
    ("studio", "microfacet:sigma=0.2", "cabral"),
    ("studio", "phong:exponent=32", "lightfield"),
])  # fmt: skip
def test_real_light(real_probes, tmp_path, name, spec, representation):
    """The domains differ by no more than both have predicted: 5 % lobe, eps .03."""
    pixels = reduced(real_probes / f"{name}.exr", 64).astype(np.float32)
    probe, brdf = open_probe(write_exr(tmp_path / "probe.exr", pixels)), parse_spec(spec)
    options = {"size": 6, "own": VIEWS[representation]}
    one = prefilter_angular(probe, Request(representation, brdf, 0.05, **options)).map
    other = Request(representation, brdf, 0.03, **options)
    other = prefilter_explicit(probe, other, dtype=np.float64).map
    assert (one.info.domain, other.info.domain) == ("angular", "frequency")
    predicted = np.hypot(one.info.predicted_error, other.info.predicted_error)
    error = relative(one, other)
    print(f"{name} {spec} {representation}: {error:.4f}, predicted {predicted:.4f}")
    assert error < 1.1 * predicted


@pytest.mark.proof
@pytest.mark.parametrize("spec", ["microfacet:sigma=0.2", "phong:exponent=32", "lambertian"])
def test_the_error_of_a_truncated_lobe_is_predicted(real_probes, tmp_path, spec):
    pixels = reduced(real_probes / "interior.exr", 64).astype(np.float32)
    probe, brdf = open_probe(write_exr(tmp_path / "probe.exr", pixels)), parse_spec(spec)
    options = {"size": 8, "own": {"views": 4}}
    cut = prefilter_angular(probe, Request("lightfield", brdf, 0.05, **options)).map
    whole = prefilter_angular(probe, Request("lightfield", brdf, 1e-7, **options)).map
    error = relative(cut, whole)
    print(f"{spec}: {error:.4f}, predicted {cut.info.predicted_error:.4f}")
    assert error == pytest.approx(cut.info.predicted_error, rel=0.2)
    assert whole.info.predicted_error < 1e-3
    # What interpolation adds is a property of the views, not of the domain.
    smooth = Request("lightfield", brdf, 1e-3, **options)
    smooth = prefilter_explicit(probe, smooth, dtype=np.float64).map
    assert cut.info.added_error == pytest.approx(smooth.info.added_error, rel=0.1, abs=1e-6)


def test_maps_too_large_are_refused_before_the_work(tmp_path):
    probe = open_probe(write_exr(tmp_path / "probe.exr", np.ones((8, 16, 3), np.float32)))
    asked = Request("lightfield", parse_spec("microfacet"), size=256, own={"views": 128})
    with pytest.raises(MapError, match="number of views"):
        prefilter_angular(probe, asked)


def test_lobes_of_many_orders_are_summed_all_the_same(tmp_path, monkeypatch):
    """The map of all orders, which tells the error between views, was refused for roughness .2."""
    light = polynomial_light(oracles.latlong_pixels(16, 8)).astype(np.float32)
    probe = open_probe(write_exr(tmp_path / "probe.exr", light))
    asked = Request("cabral", parse_spec("microfacet:sigma=0.3"), 0.05, size=4)
    whole = prefilter_angular(probe, asked).map
    monkeypatch.setattr("shrm_cli.maps.size.MAX_SERIES", 200_000)
    found = prefilter_angular(probe, asked).map
    np.testing.assert_array_equal(found.images, whole.images)
    assert found.info.added_error == pytest.approx(whole.info.added_error, rel=0.01)


@pytest.mark.parametrize(
    "spec", [pytest.param("microfacet:sigma=0.3", marks=pytest.mark.proof), "phong:exponent=8"]
)
def test_the_error_of_bilinear_look_ups_is_stated(spec):
    """Against the same map of texels that are three times as fine, within the faces."""
    light = polynomial_light(oracles.latlong_pixels(64, 32)).astype(np.float32)
    probe, brdf = Probe.from_array(light), parse_spec(spec)
    asked = [Request("cabral", brdf, 0.05, size=size) for size in (6, 18)]
    coarse, fine = (prefilter_angular(probe, each).map for each in asked)
    inner = slice(3, 15)
    places = (np.arange(18)[inner] + 0.5) / 3 - 0.5  # of fine texels, in coarse ones
    grid = np.meshgrid(places, places, indexing="ij")
    weights = cube_solid_angles(18)[inner, inner]
    lost = whole = 0.0
    for before, after in zip(coarse.images, fine.images, strict=True):
        for few, many in zip(np.split(before, 6), np.split(after, 6), strict=True):
            for channel in range(3):
                seen = map_coordinates(few[..., channel], grid, order=1)
                truth = many[inner, inner, channel]
                lost += float((weights * (seen - truth) ** 2).sum())
                whole += float((weights * truth**2).sum())
    found = np.sqrt(lost / whole)
    print(found, coarse.info.filter_error)
    assert coarse.info.filter_error == pytest.approx(found, rel=0.25)
    same = prefilter_explicit(probe, asked[0]).map
    assert coarse.info.filter_error == pytest.approx(same.info.filter_error, rel=0.05)
