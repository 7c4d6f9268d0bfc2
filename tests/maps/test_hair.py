"""Hair whose direction is known, as meshes with `--brush` have it, beside sums over all pixels."""

import numpy as np
import pytest

from shrm_cli.maps.shrm.shrm import compressed
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.probe import Probe
from tests.brute_force import latlong_samples, unit

EXPONENT, HEIGHT = 8, 32
HAIR = f"kajiya-kay:exponent={EXPONENT}"


def lit_room():
    light, _ = latlong_samples(HEIGHT)
    lamp = np.exp(20 * (light @ np.array([0.6, 0.64, 0.48]) - 1))[:, None]
    return (0.1 + lamp * [9.0, 6.0, 3.0]).astype(np.float32)


def summed(tangents, views):
    """What fibres reflect, ``cos(theta_i - theta_o)^s``, of angles by the arc cosine."""
    light, weights = latlong_samples(HEIGHT)
    angles = np.arccos(np.clip(tangents @ light.T, -1, 1))
    own = np.arccos(np.clip(np.einsum("ij,ij->i", tangents, views), -1, 1))
    lobe = np.maximum(np.cos(angles - own[:, None]), 0) ** EXPONENT
    return lobe @ (weights[:, None] * lit_room())


@pytest.mark.parametrize("form", ["shrm", "compressed", "kautz-mccool", "principal"])
def test_hair_follows_its_tangent(rng, form):
    """And not the horizontal one that its normal alone tells."""
    asked = {"error": 0.01} if form == "principal" else {"eps": 1e-3}
    probe = Probe.from_array(lit_room().reshape(HEIGHT, 2 * HEIGHT, 3))
    made = prefilter(probe, HAIR, to="shrm" if form == "compressed" else form, **asked)
    made = compressed(made, 1e-3) if form == "compressed" else made
    normals, views = unit(rng, 500), unit(rng, 500)
    tangents = np.cross(normals, unit(rng, 500))
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    truth = summed(tangents, views)
    followed = made.brushed_radiance(normals, tangents, views) - truth
    horizontal = made.radiance(normals, views) - truth
    scale = np.sqrt(np.mean(truth**2))
    assert np.sqrt(np.mean(followed**2)) < 0.03 * scale
    assert np.sqrt(np.mean(horizontal**2)) > 0.2 * scale
