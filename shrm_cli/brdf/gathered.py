"""Where the lobes of a BRDF gather: about the mirror direction, or about the normal."""

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe_expansion import SHARP, squared_lobes, view_azimuths, width_for
from shrm_cli.brdf.polar_rule import PolarRule, azimuths
from shrm_cli.vocabulary import Center

_VIEWS, _LIGHTS, _AZIMUTHS = 12, 48, 16
"""The numbers of samples in theta_o, theta_i and, over half a turn, phi."""
_NEARLY = 0.9
"""How many times as much lobes gather about the mirror direction that are still about the normal.

Maps of `ggx:roughness=0.7,f0=1` (1.13 times) are as good about the one as about the other, and
those of `microfacet:sigma=0.8` (1.09) have half the error about the normal. Brushed lobes are wide
along the tangent only, and turn with the view across it: of `ggx:roughness=0.5,anisotropy=0.9`
(0.96) and 0.3 (0.91) maps have half the error about the mirror direction, of 0.7 (1.08) three
quarters about the normal. There both count alike."""


def gathering_center(brdf: Brdf) -> Center:
    """Return the direction about which a BRDF's own functions of the view are the fewest.

    Sharp lobes are about the mirror direction. The lobes of rough surfaces, felt and diffuse
    standards hardly turn with the view, and sheen is a ring along the horizon: about the normal,
    few functions hold them. Lobes gather about the direction that has the larger mean cosine with
    the light, weighted by the squared lobe.

    Returns the BRDF's own central direction, unless that is the mirror direction and its lobes
    gather about the normal.
    """
    if brdf.center != "reflection" or brdf.zonal:
        return brdf.center
    if width_for(brdf, 0.0) < SHARP:  # the lobe is too sharp to gather about anything else
        return brdf.center
    theta_o = np.pi * (np.arange(_VIEWS) + 0.5) / _VIEWS
    theta, weights = PolarRule().nodes(_LIGHTS)
    gathered, nearly = 0.0, _NEARLY if brdf.isotropic else 1.0
    for azimuth in view_azimuths(brdf):
        light, squares = squared_lobes(brdf, theta, azimuths(_AZIMUTHS), theta_o / 2, azimuth)
        squares = weights[:, None, None] * squares
        whole = np.maximum(squares.sum(axis=(0, 2)), 1e-300)
        of_mirror = np.cos(theta) @ squares.sum(axis=2)
        of_normal = np.sum(squares * light[..., 2], axis=(0, 2))
        # All views count alike, whatever they reflect, because errors are seen where they are dark.
        even = np.sin(theta_o) / whole
        gathered += float(even @ of_normal - nearly * (even @ of_mirror))
    return "normal" if gathered > 0 else "reflection"
