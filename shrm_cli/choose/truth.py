"""The light itself at some hundred points, for what no error is predicted of."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe_expansion import lobe_width
from shrm_cli.maps.negative import visible_pairs
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.reference import Reference
from shrm_cli.render.seen import seen_errors
from shrm_cli.render.sphere import Reflecting
from shrm_cli.sphere.directions import bisector

_POINTS = 400
"""The pairs of a mirror direction and a view. A share of 5 % is known to 1.1 % of all by them."""
_ROWS_OF_LOBE = 24.0
"""Rows of the probe for the truth times the width of the lobe, as `shrm compare` takes them."""
_ROWS = 64, 256
"""The fewest and the most rows. More would take longer than the maps that are measured."""


class Truth:
    """The light that a BRDF reflects of a probe, spread evenly over the pixels of spheres.

    Parameters
    ----------
    probe : Probe
    brdf : Brdf
    progress : callable, optional
        Called with the number of points done, and of points in all.
    """

    def __init__(self, probe: Probe, brdf: Brdf, progress: Progress | None = None) -> None:
        self._probe, self._brdf, self._progress = probe, brdf, progress
        mirrored, self._views = visible_pairs(_POINTS)
        self._normals = bisector(mirrored, self._views)

    @cached_property
    def _radiance(self) -> Array:
        rows = int(np.clip(np.ceil(_ROWS_OF_LOBE / lobe_width(self._brdf)), *_ROWS))
        height = rows if self._probe.grid.latlong_rows > rows else None
        truth = Reference(self._probe, self._brdf, height, progress=self._progress)
        return truth.radiance(self._normals, self._views)

    def errors(self, shown: Reflecting, scale: ArrayLike = 1.0) -> tuple[float, float]:
        """Measure a map.

        Parameters
        ----------
        shown : Reflecting
        scale : array_like, shape (3,)
            What its light is multiplied with.

        Returns
        -------
        error : float
            The relative RMS error; 0 where nothing is reflected and nothing shown.
        wrong_share : float
            The share of points whose luminance is wrong by more than 5 %.
        """
        found = shown.radiance(self._normals, self._views) * np.asarray(scale)
        truth = self._radiance
        missed, whole = np.linalg.norm(found - truth), np.linalg.norm(truth)
        error = missed / whole if whole > 0 else np.inf if missed > 0 else 0.0
        return float(error), seen_errors(found, truth).wrong_share
