"""The error that `shrm` promises is the error that it makes, on real probes and shipped ones."""

import math

import numpy as np
import OpenEXR
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.make import prefilter_shrm
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from tests import brute_force
from tests.cli.helpers import ROOT

HEIGHT = 128
PAIRS = 4000


def reduced(path, height=HEIGHT):
    """A probe at 256 x 128, or of another height: means over blocks of pixels."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    image = np.stack([channels[c].pixels.astype(np.float32) for c in "RGB"], axis=-1)
    step = image.shape[0] // height
    blocks = image.reshape(height, step, 2 * height, step, 3).mean(axis=(1, 3))
    return np.maximum(blocks, 0)


def write(path, image):
    channels = {c: np.ascontiguousarray(image[..., k]) for k, c in enumerate("RGB")}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))


@pytest.mark.parametrize("sigma", [0.2, pytest.param(0.5, marks=pytest.mark.proof)])
@pytest.mark.parametrize("name", ["city", "interior", "studio", "sunset"])
@pytest.mark.parametrize("height", [64, pytest.param(HEIGHT, marks=pytest.mark.proof)])
def test_measured_error_is_the_predicted_one(real_probes, tmp_path, height, name, sigma):
    image = reduced(real_probes / f"{name}.exr", height)
    measured, predicted, bound = errors(tmp_path, f"{name} {sigma}", image, sigma)
    assert abs(measured - predicted) < 0.1 * predicted
    assert measured < bound


@pytest.mark.proof
@pytest.mark.parametrize(("name", "sigma"), [("studio", 0.5), ("sky", 0.2)])
def test_measured_error_is_the_predicted_one_on_shipped_probes(tmp_path, name, sigma):
    """On a clean clone too, at 64 x 32: soft boxes, and a bare sun."""
    image = reduced(ROOT / "probes" / f"{name}.exr", 32)
    measured, predicted, bound = errors(tmp_path, f"{name} {sigma}", image, sigma)
    assert abs(measured - predicted) < 0.1 * predicted
    assert predicted <= bound


def errors(tmp_path, title, image, sigma):
    """The error measured by integration, the predicted one, and its bound."""
    write(tmp_path / "probe.exr", image)
    brdf = parse_spec(f"microfacet:sigma={sigma}")
    light = Projection(open_probe(tmp_path / "probe.exr"))
    prefiltered = prefilter_shrm(light, Request("shrm", brdf))
    order_p = prefiltered.map.info.order_p
    higher = Request("shrm", brdf, order_p=order_p + 3, size=prefiltered.map.size)
    finer = prefilter_shrm(light, higher, dtype=np.float64)
    directions, weights = brute_force.latlong_samples(len(image))
    radiance = image.reshape(-1, 3).astype(float)
    rng = np.random.default_rng(9)
    reflections, views, shares = brute_force.bright_pairs(rng, prefiltered.map, PAIRS, finer.map)
    formula = brute_force.microfacet(sigma)
    truth = np.array(
        [
            brute_force.reflected(formula, r, v, directions, weights, radiance)
            for r, v in zip(reflections, views, strict=True)
        ]
    )
    normals = reflections + views
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    found = prefiltered.map.radiance(normals, views)
    measured = np.sqrt(np.sum(shares * (found - truth) ** 2) / np.sum(shares * truth**2))
    predicted = prefiltered.map.info.predicted_error
    print(f"{title}: predicted {predicted:.4f}, measured {measured:.4f}")
    return measured, predicted, prefiltered.facts["error_bound"]


@pytest.mark.parametrize("beyond", [0.3, 0.6, 1.0, 2.0])
@pytest.mark.parametrize("degree", [37, 61])
def test_what_is_predicted_is_known_and_not_only_estimated(degree, beyond):
    """Light of three degrees, the last of which Lambert's law has nothing of (eq. 4.12)."""
    powers = {0: 4.0**2, 28: 0.5**2, degree: beyond**2}
    up = np.cos((np.arange(128) + 0.5) / 128 * np.pi)
    series = np.zeros(degree + 1)
    for each, power in powers.items():
        series[each] = np.sqrt(power)
    light = np.broadcast_to(np.polynomial.legendre.legval(up, series)[:, None, None], (128, 256, 3))
    made = prefilter(Probe.from_array(light.astype(np.float32)), "lambertian", order_f=24)
    energies = {n: lambert(n) ** 2 * power / (2 * n + 1) for n, power in powers.items()}
    expected = np.sqrt((energies[28] + energies[degree]) / sum(energies.values()))
    assert made.info.predicted_error == pytest.approx(expected, rel=0.01)


def lambert(degree):
    """A_l of eq. 4.12, but for a factor that is common to all even degrees."""
    if degree % 2:
        return 0.0
    return math.comb(degree, degree // 2) / 2.0**degree / ((degree + 2) * (degree - 1))
