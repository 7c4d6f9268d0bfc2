"""Pairs of a mirror direction and a view where reflected light is bright, for errors of maps.

A lamp's few directions hold most of the light and of the error of maps, so that pairs that are
drawn evenly tell little of either. These are drawn where maps are bright, where two of them differ,
and where bilinear look-ups differ from either. Their weights undo that: sums with them are
integrals over the measure of predicted errors.
About the mirror direction that is all mirror directions and views, which are the pixels of spheres
in parallel projection from all sides; about the normal it is all normals and all views above them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from research.bilinear import AXES
from research.looked_up import looked_up
from shrm_cli.maps.base import Map
from shrm_cli.sphere.directions import bisector

Array = NDArray[np.floating]

_CANDIDATES = 16
"""For each pair, the number of pairs that it is drawn from."""
_GRAZING = 0.002
"""The least N.V of the views that are drawn more often. A third of the squared error of maps of
plastics over the harmonics of the view can lie below N.V = .02, of which even views have so few
that the measured error would vary by a tenth."""
_EVERYWHERE = 0.25
"""The part of the pairs that is drawn evenly, in units of those that are drawn by the light."""


@dataclass(frozen=True)
class Pairs:
    """Pairs of a normal and a view.

    Attributes
    ----------
    normals, views : ndarray, shape (n, 3)
        Unit vectors in world axes.
    weights : ndarray, shape (n, 1)
        Of integrals over the measure of predicted errors.
    """

    normals: Array
    views: Array
    weights: Array

    def error(self, found: Array, truth: Array) -> float:
        """Return the relative RMS error over the measure of predicted errors."""
        missed = np.sum(self.weights * (found - truth) ** 2)
        return float(np.sqrt(missed / np.sum(self.weights * truth**2)))


def bright_pairs(default: Map, others: Sequence[Map], count: int) -> Pairs:
    """Draw pairs of a normal and a view, neighbors in their normals one after the other.

    Parameters
    ----------
    default : Map
        A center-sampled map of a single cube of harmonics.
    others : sequence of Map
        Maps of the same light with other errors, the best one last.
    count : int
    """
    rng = np.random.default_rng(count)
    centers, density = _bright_directions(default, _CANDIDATES * count, rng)
    is_normal = default.center == "normal"
    cosines, of_views = _grazing_cosines(len(centers), 1 if is_normal else 2, rng)
    density = density * of_views
    # The view is twice as far from the mirror direction as from the normal.
    views = _views_at(centers, cosines if is_normal else 2 * cosines**2 - 1, rng)
    normals = centers if is_normal else bisector(centers, views)
    maps = default, *others
    found = [each.radiance(normals, views) for each in maps]
    filtered = [
        looked_up(each, normals, views) - shown for each, shown in zip(maps, found, strict=True)
    ]
    differing = [found[0], *(each - found[-1] for each in found[:-1]), *filtered]
    energies = [np.sum(each**2, axis=1) for each in differing]
    means = [np.average(each, weights=1 / density) for each in energies]
    wanted = _EVERYWHERE + sum(
        each / mean for each, mean in zip(energies, means, strict=True) if mean > 0
    )
    chosen = _drawn(wanted / density, count)
    along = np.arctan2(normals[chosen, 1], normals[chosen, 0]), np.round(4 * normals[chosen, 2])
    chosen = chosen[np.lexsort(along)]
    return Pairs(normals[chosen], views[chosen], 1 / wanted[chosen][:, None])


def _grazing_cosines(count: int, power: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Draw N.V of views, more of them grazing than there are, and return their density.

    Half of them are spread as evenly as the views of a measure are. For the other half the
    logarithm of N.V is even, because a hundredth of all views about a mirror direction has
    N.V < .1, where some maps have nearly all of their error.

    Parameters
    ----------
    count : int
    power : int
        The power of N.V that even views make even: 1 for views above a normal, 2 for all views
        of a mirror direction.

    Returns
    -------
    cosines, density : ndarray, shape (count,)
        The density is relative to that of even views.
    """
    span = -np.log(_GRAZING)
    drawn = rng.random(count)
    cosines = np.where(rng.random(count) < 0.5, drawn ** (1 / power), np.exp(-span * drawn))
    grazing = 1 / (power * cosines**power * span)
    return cosines, 0.5 + 0.5 * np.where(cosines > _GRAZING, grazing, 0.0)


def _views_at(centers: Array, cosines: Array, rng: np.random.Generator) -> Array:
    """Draw views at angles from central directions, shape (n, 3), of any azimuth."""
    across = np.cross(centers, rng.normal(size=centers.shape))
    across *= (np.sqrt(1 - cosines**2) / np.linalg.norm(across, axis=1))[:, None]
    return cosines[:, None] * centers + across


def _bright_directions(made: Map, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Draw directions by the light of a map over all views, and return their density.

    The squares of harmonic coefficients are that light's energy. The directions are central ones of
    the map: normals, or mirror directions.
    """
    (plane,) = made.planes()
    size = made.size
    energy = np.sum(plane.astype(float) ** 2, axis=2)
    middles = (np.arange(size) + 0.5) * 2 / size - 1
    shrink = (1 + middles[:, None] ** 2 + middles**2) ** -1.5
    solid = np.tile(shrink / (6 * shrink.sum()), (6, 1))
    share = solid * (energy / np.sum(solid * energy) + _EVERYWHERE)
    share /= share.sum()
    face, row, column = np.unravel_index(
        np.searchsorted(np.cumsum(share), (np.arange(count) + 0.5) / count), (6, size, size)
    )
    t, s = ((each + rng.random(count)) * 2 / size - 1 for each in (row, column))
    points = AXES[face, 0] + s[:, None] * AXES[face, 1] + t[:, None] * AXES[face, 2]
    length = np.linalg.norm(points, axis=1)
    # A texel's share is spread evenly over its square on the face, not over its solid angle.
    area = 4 / size**2 * length**-3 / (4 * np.pi)
    density = share.reshape(6, size, size)[face, row, column] / area
    return points / length[:, None], density


def _drawn(chances: Array, count: int) -> NDArray[np.integer]:
    """Draw indices in proportion to chances, evenly along their order of size."""
    order = np.argsort(chances)
    whole = np.cumsum(chances[order])
    places = np.searchsorted(whole, (np.arange(count) + 0.5) / count * whole[-1])
    return np.asarray(order[np.minimum(places, len(order) - 1)])
