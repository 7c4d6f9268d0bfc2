"""Anisotropic BRDFs as they look to views of one azimuth, and over which azimuths they differ."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.vectors import turned
from shrm_cli.sphere.directions import from_angles

_PAIRS = 256
"""The pairs of directions at which a BRDF and its mirror images are compared."""
_ALIKE = 1e-4
"""How far mirror images may be apart, beside the RMS of all values."""


class Turned(Brdf):
    """A BRDF in a frame that is turned about the normal: a view of azimuth 0 has another one.

    `azimuth` is the azimuth from the tangent that a view of azimuth 0 has in the BRDF's own frame,
    radians.
    """

    isotropic = False

    def __init__(self, brdf: Brdf, azimuth: float) -> None:
        self.brdf, self.azimuth = brdf, azimuth
        self.name, self.values = brdf.name, {**brdf.values, "azimuth": azimuth}
        self.center, self.has_horizon = brdf.center, brdf.has_horizon
        self.includes_cosine = brdf.includes_cosine

    @property
    def is_measured(self) -> bool:
        return self.brdf.is_measured

    def evaluate(self, light: Array, view: Array) -> Array:
        return self.brdf.evaluate(*(turned(each, self.azimuth) for each in (light, view)))

    def __repr__(self) -> str:
        return repr(self.brdf)


def turned_views(brdf: Brdf) -> list[Brdf]:
    """Return what stands for the views of all azimuths: of an isotropic BRDF, itself."""
    if brdf.isotropic:
        return [brdf]
    return [Turned(brdf, azimuth) for azimuth in (0.0, np.pi / 2)]


def quarters_that_differ(brdf: Brdf) -> int:
    """Return over how many quarter turns the views differ that tell everything of a BRDF.

    Returns 1 where a BRDF is the same in mirrors along its tangent and across it, as all brushed
    models are; 2 where it is the same after half a turn; else 4.
    """
    random = np.random.default_rng(0)
    theta = np.arccos(random.uniform(0.05, 1.0, (2, _PAIRS)))
    light, view = from_angles(theta, random.uniform(0, 2 * np.pi, (2, _PAIRS)))
    own = brdf.transfer(light, view)
    limit = _ALIKE * np.sqrt(np.mean(own**2))

    def is_same(*way: int) -> bool:
        image = brdf.transfer(light * np.array(way), view * np.array(way))
        return bool(np.sqrt(np.mean((image - own) ** 2)) <= limit)

    if not is_same(-1, -1, 1):
        return 4
    return 1 if is_same(1, -1, 1) else 2
