"""Where lobes gather: beside means over random directions of the light and the view."""

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.principal.terms import gathering_center


def mean_cosines(brdf):
    """The mean cosines of the light with the mirror direction and the normal, of squared lobes.

    All views about a mirror direction count alike, along the tangent and across it in turns.
    """
    rng = np.random.default_rng(6)
    sums = np.zeros(2)
    for number, from_normal in enumerate(np.arccos(rng.uniform(-1, 1, 400)) / 2):
        view = np.array([np.sin(from_normal), 0, np.cos(from_normal)])
        view = [*np.roll(view[:2], number % 2).tolist(), view[2]]
        mirrored = view * np.array([-1, -1, 1])
        light = rng.normal(size=(4000, 3))
        light /= np.linalg.norm(light, axis=1)[:, None]
        squares = np.sum(brdf.transfer(light, np.broadcast_to(view, light.shape)) ** 2, axis=1)
        sums += [squares @ (light @ mirrored), squares @ light[:, 2]] / squares.sum()
    return sums / 400


@pytest.mark.parametrize(
    ("spec", "center"),
    [
        ("charlie:roughness=0.2", "normal"),
        ("ggx:roughness=1,f0=0.04", "normal"),
        ("ggx:roughness=0.8", "normal"),
        ("ggx:roughness=0.6", "reflection"),
        ("lafortune:fit=felt", "normal"),
        ("microfacet:sigma=0.6", "reflection"),
        ("microfacet:sigma=0.8", "normal"),
        ("ggx:roughness=0.5,anisotropy=0.9", "reflection"),
        ("ggx:roughness=0.7,anisotropy=0.9", "normal"),
    ],
)
def test_lobes_gather_where_their_light_is(spec, center):
    brdf = parse_spec(spec)
    of_mirror, of_normal = mean_cosines(brdf)
    nearly = 0.9 if brdf.isotropic else 1.0
    assert ("normal" if of_normal > nearly * of_mirror else "reflection") == center
    assert gathering_center(brdf) == center


@pytest.mark.parametrize(
    "spec", ["phong:exponent=1", "oren-nayar", "kajiya-kay", "ggx:roughness=0.05", "microfacet"]
)
def test_other_lobes_keep_their_own_center(spec):
    brdf = parse_spec(spec)
    assert gathering_center(brdf) == brdf.center
