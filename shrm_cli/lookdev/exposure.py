"""An exposure for each probe, from its light alone, so that all materials share it.

It is metered as photographers do with an incident-light meter: by a white, diffuse ball, which is
lit by the whole probe. The luminance that a tenth of the ball's surface exceeds is shown as 80 % of
white. It depends neither on the materials nor on the view, so that a turntable does not flicker.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.color import to_rec709
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.cube import cube_directions, cube_solid_angles
from shrm_cli.vocabulary import LUMINANCE

Array = NDArray[np.floating]

SHOWN = 0.8
"""Linear grey, 1 being white, of the luminance that is metered: 231 of 255 in sRGB."""
BRIGHTEST = 0.1
"""The part of the ball's surface that is brighter than what is metered."""
_TEXELS = 16
"""Texels along an edge of the cube on which the ball is sampled; irradiance is smooth."""
_STEP = 0.1
"""Stops to which exposures are rounded, so that a label states them exactly."""
_MOST = 32.0
"""The most stops either way, as `shrm render --exposure` takes them."""


def metered(probe: Probe) -> float:
    """Return the exposure of a probe in stops, a multiple of a tenth; 0 if it is black.

    Parameters
    ----------
    probe : Probe

    Raises
    ------
    ProbeError
        If the probe cannot be read.
    """
    ball = prefilter_with_facts(probe, "irradiance", {"window": "auto"}).map
    normals = cube_directions(_TEXELS)
    radiance = ball.radiance(normals, normals)  # of a white surface: its irradiance over pi
    matrix = to_rec709(probe.chromaticities)
    shown = radiance if matrix is None else radiance @ matrix.T
    level = weighted_quantile(
        shown @ LUMINANCE, np.tile(cube_solid_angles(_TEXELS, "center"), (6, 1)), 1 - BRIGHTEST
    )
    if not level > 0:
        return 0.0
    stops = round(float(np.log2(SHOWN / level)) / _STEP) * _STEP
    return round(min(max(stops, -_MOST), _MOST), 6)


def weighted_quantile(values: Array, weights: Array, fraction: float) -> float:
    """Return the least value up to which at least a fraction of the weight lies."""
    order = np.argsort(values, axis=None)
    weight = np.cumsum(np.asarray(weights).ravel()[order])
    place = int(np.searchsorted(weight, fraction * weight[-1]))
    return float(np.asarray(values).ravel()[order[min(place, len(order) - 1)]])
