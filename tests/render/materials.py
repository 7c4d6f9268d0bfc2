"""Maps that the pictures are taken of."""

import numpy as np

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.shrm import Shrm
from tests.oracles import real_harmonics

INFO = MapInfo(0, 0, 0.03, 1.0, 0.0)


class Painted:
    """A stand-in for a map whose radiance is a function of the normal alone."""

    def __init__(self, paint):
        self.paint = paint

    def radiance(self, normals, views):
        assert np.shape(views) == (3,)  # one distant viewer, so that maps can contract
        return self.paint(normals)


def spot(direction, order=24):
    """A glossy SHRM that is lit from one direction: radiance falls off around R = direction."""
    light = real_harmonics(order, np.asarray(direction, dtype=float))
    gloss = np.exp(-((np.arange(order + 1) / (order / 2.5)) ** 2))[:, None, None, None]
    return Shrm.from_coefficients(
        np.repeat(light[:, None], 3, axis=1),
        np.broadcast_to(gloss, (order + 1, 1, 1, 3)),
        "reflection",
        INFO,
        size=64,
    )


def furnace(radiance, size=8):
    """An SHRM that reflects the same radiance everywhere."""
    light = np.sqrt(4 * np.pi) * np.array([radiance])
    return Shrm.from_coefficients(light, np.ones((1, 1, 1, 3)), "reflection", INFO, size=size)


def under_random_light(spec="microfacet:sigma=.3", frame="global", order_f=6, order_p=2):
    """An SHRM of a real BRDF under light that has no symmetry."""
    brdf = parse_spec(spec)
    rng = np.random.default_rng(4)
    light = rng.normal(size=((order_f + 1) ** 2, 3))
    coefficients = compute_coefficients(brdf, order_f, order_p).values
    return Shrm.from_coefficients(light, coefficients, brdf.center, INFO, size=32, frame=frame)
