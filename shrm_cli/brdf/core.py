"""The core of a lobe: how finely sums must look for its peak, and where."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, check_finite
from shrm_cli.brdf.sums import joined, weighted_terms
from shrm_cli.errors import BrdfError
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles, tilted_frame, turned

_VIEWS = np.concatenate([np.linspace(0, 2.6, 9), [2.8, 2.95, 3.05, 3.1, 3.13]])
"""Angles from the central direction to the view, radians; at the last one, a surface that reflects
about the mirror direction is seen .3 degrees from its edge, where lobes are narrowest."""
_BRUSHES = 0.0, np.pi / 4, np.pi / 2
"""Azimuths from the x axis of an anisotropic surface."""
_ANGLES = np.unique(np.concatenate([np.geomspace(5e-4, 0.1, 58), np.linspace(0, np.pi, 404)]))
"""Angles from the central direction; the finer steps begin where most peaks are."""
_AZIMUTHS = 16
PART = 0.5
"""Cells are to be no larger than this part of the width of the core: with the whole of it, the
peaks of Phong's lobe of exponent 512 and of fibres were missed by 3 and 6 %."""
MOST_CELLS = 2**14
_APART = 3
"""How much wider than the narrowest the core of a term is that is summed apart from it."""
_PEAK = 0.75
"""Azimuths count that come so near to the peak."""


@record
class Core:
    """How narrow the peak of a lobe is, and how far from the central direction C it reaches."""

    views: Array
    """Angles from C to the view, radians, rising, shape (n,)."""
    widths: Array
    """The least distance from the peak, of any azimuth about C, to where the lobe falls below half
    of it, radians, shape (n,)."""
    reaches: Array
    """The largest angle from C at which that peak is above half, radians, shape (n,). Where more
    than `MOST_CELLS` would be needed to cover so much, widths are larger than they are; of most
    BRDFs that is within some degrees of the edge of a surface."""
    cells: float
    """How many cells of radii of `PART` of the width cover the core: the median of all views."""

    @classmethod
    def of(cls, brdf: Brdf) -> "Core":
        """Find the core of a BRDF's lobe."""
        views = np.zeros(1) if brdf.zonal else _VIEWS
        widths, reaches = np.array([_core(brdf, theta) for theta in views]).T
        areas = 2 * np.pi * (1 - np.cos(reaches))
        cells = areas / (2 * (PART * widths) ** 2)
        widths = np.maximum(widths, np.sqrt(areas / (2 * PART**2 * MOST_CELLS)))
        return cls(views, widths, reaches, float(np.median(cells)))

    def seen(self, angles: Array) -> tuple[float, float]:
        """Return the least width and the largest reach of views at angles from C, and of those
        between which they are.
        """
        first = max(int(np.searchsorted(self.views, angles.min(), side="right")) - 1, 0)
        last = int(np.searchsorted(self.views, angles.max()))
        views = slice(first, last + 1)
        return float(self.widths[views].min()), float(self.reaches[views].max())


def parts_with_cores(brdf: Brdf, core: Core) -> list[tuple[Brdf, Core]]:
    """Return the parts of a BRDF that are to be summed one after the other, with their cores, the
    widest first.

    `core` is that of the BRDF. Wide terms that take long, as the base under a clear coat, would be
    evaluated as often beside a narrow one as that needs: for car paint at night this took two
    thirds of the time. Others share what they compute with the narrow ones.
    """
    terms = weighted_terms(brdf)
    is_slow = [term.is_slow for _, term in terms]
    if len(terms) < 2 or not any(is_slow):
        return [(brdf, core)]
    widths = [float(np.median(Core.of(term).widths)) for _, term in terms]
    is_apart = [
        slow and width > _APART * min(widths) for slow, width in zip(is_slow, widths, strict=True)
    ]
    if not any(is_apart):
        return [(brdf, core)]
    groups = (
        joined([term for term, own in zip(terms, is_apart, strict=True) if own is group])
        for group in (True, False)
    )
    return [(each, Core.of(each)) for each in groups]


def _core(brdf: Brdf, theta: float) -> tuple[float, float]:
    """The width and the reach for a view at an angle from C."""
    width, reach = np.pi, 0.0
    phi = 2 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    tilt = theta / 2 if brdf.center == "reflection" else 0.0
    for brush in (0.0,) if brdf.isotropic else _BRUSHES:
        light = tilted_frame(from_angles(_ANGLES[:, None], phi), np.asarray(tilt))
        view = from_angles(np.asarray(theta - tilt), np.asarray(0.0))
        values = brdf.transfer(turned(light, brush), turned(view, brush)).sum(axis=-1)
        check_finite(values, brdf)
        if values.any():
            if values.max() <= 0:
                raise BrdfError(f"{brdf!r}: its value is negative wherever it is not 0")
            rays = values.T[values.max(axis=0) > _PEAK * values.max()]
            widths, reaches = zip(*map(_peak, rays), strict=True)
            width, reach = min(width, *widths), max(reach, *reaches)
    return width, reach


def _peak(values: Array) -> tuple[float, float]:
    """Half the width of the peak of values along a ray from C, where they are half of it, and how
    far from C that is: radians. A peak at C goes on beyond it.
    """
    peak = int(values.argmax())
    below = values <= values[peak] / 2
    before, after = np.flatnonzero(below[:peak]), np.flatnonzero(below[peak:])
    stop = float(_ANGLES[peak + after[0]]) if len(after) else np.pi
    return (stop - float(_ANGLES[before[-1]])) / 2 if len(before) else stop, stop
