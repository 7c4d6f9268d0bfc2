"""Sums over a probe at the fineness that a lobe needs, with an estimate of their error.

A group of neighboring points begins with the largest cells of a pyramid of lights. The transfer
function T at the centroid of a cell is compared with T at those of its four quarters, which tells
how much T is curved there; the curvature times the spread of the light within a quarter is what is
still wrong with it. The quarters that matter most are cut again, down to the pixels, until what is
left is less than a given part of the reflected light. Where nothing is known of the lobe but that
it is narrow, near its core, cells are cut until they are smaller than it; and pixels, too, each of
which is as bright all over as it is in its middle.

The curvature also corrects the sums: ``T + k s / w`` instead of T, where s is the spread and w the
luminance of the cell, is exact for a function of even curvature k. What is stated is the size of
all corrections of a point together, so that it is more than the error that is left.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.core import PART
from shrm_cli.probe.source import Level, Pyramid, pixel_sides
from shrm_cli.records import record
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.vocabulary import LUMINANCE

Indices = NDArray[np.integer]
Cap = tuple[Array, float]
"""Axes of spherical caps, one for each point, and the half angle of all of them, radians."""

ALLOWED = 0.02
"""The part of the light of a point that may be left to corrections. Under four real probes of
512 rows, 95 % of the pixels of nine BRDFs were within .02 to .5 % of the full sum, and .1 to 1.3 %
stated; with .03, brushed fibres in a studio missed 1.4 %."""
_SPENT = 0.5
"""The part of what is left of it that each level may spend."""
_GRADING = 0.15
"""How much larger they may be beside the core, for each radian from it: with .25, GGX of roughness
.3 at grazing views under a city's sun missed .5 % instead of .1 %."""
_EDGE = 0.06
"""Cells that cross the edge of a cap, such as the horizon, are cut to this radius, radians. Without
it a matt sphere at night missed .5 % and stated .2 %, with it .1 and .2 %."""
_DARK = 0.02
"""Points whose light is less than this part of the mean of their group need no better sums."""
_PIXEL_PART = 0.1
"""Pixels that are larger than this part of the width of the core are no points: one of half the
width, alone in the dark, was 8 % too bright as such."""
_PIXEL_SHARE = 0.01
"""The part of the light of a point that a pixel must hold for that, and that cells and pixels may
hold which cross the edge of a cap and are small: a lamp of one pixel of 16 rows, alone in the dark,
missed .7 % of a matt sphere and stated .15 %."""
_BENT = 1e-5
"""Pixels are also cut where their middles are wrong by more than this part of the light of a point.
With ten times as much, 5 % of the points of a polished sphere in an interior missed .3 %, and so
.03 %, beside all pixels near the core cut: at the rim of a sphere these are 17 times as many."""
_HIDING = 2.0
"""Pixels that are larger than so many widths of the core may hide it between their middles."""
_OWN_SPREAD = 1 / 3
"""The mean square of the distances within a pixel from its middle, as a part of that of the middles
of four from theirs."""
_QUARTERS = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]], np.float32) / 4
"""Where the middles of the quarters of a pixel lie along both of its sides."""
_FEWEST_NODES, _MOST_NODES = 2, 6
"""The nodes of Gauss and Legendre's rule along each side of a pixel: of GGX of roughness .1 under a
sunset of 512 rows, 8.8 % of a right picture is wrong beside points, 2.5 % beside parts."""
_EDGE_NODES = 4
"""The fewest of them where the edge of a cap crosses a pixel."""
SAMPLES_AT_ONCE = 2**15
"""Pairs of a point and a cell or a pixel that are evaluated at a time: a handful of arrays of so
many numbers fit into the L2 cache."""
ROUNDING = 1e-5
"""How much the cosine to a cell or a tile may be less than that of a cap, for float32."""
_TELLS = 0.05
"""The part of the spread of a cell that is between its quarters, where they tell of what is within
them; three quarters where the light is even."""
_TINY = 1e-30


@record
class Points:
    """Points whose light is summed at once: neighbors, each by one cut through the pyramid."""

    rows: Array
    """Vectors whose cosines with the directions to the light `evaluate` needs, shape (k, points,
    3)."""
    evaluate: Callable[[Array, Indices], Array]
    """From cosines, shape (1, k, some, m), and which points these are of, shape (some,), to the
    transfer function, (1, some, m, 3)."""
    caps: list[Cap]
    """Each point is lit from within all its caps."""
    centers: Array
    """Central directions, shape (points, 3)."""
    core: tuple[float, float]
    """The width of the core of their lobes and how far from the center it reaches, radians."""
    beside: Array
    """The luminance of what other parts of the BRDF reflect, shape (points,), beside which errors
    count."""

    def transfer(self, directions: Array) -> Array:
        """The transfer function of light from directions, (m, 3): (channels, points, m)."""
        which, parts = np.arange(len(self.centers)), []
        for part in slices(len(directions), SAMPLES_AT_ONCE // len(which)):
            cosines = self.rows.reshape(-1, 3) @ directions[part].T
            cosines = cosines.reshape(1, len(self.rows), len(which), -1)
            parts.append(_channels(self.evaluate(cosines, which)[0]))
        return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=-1)

    def lit(self, level: Level) -> Indices:
        """The cells of a level that may light any point."""
        cells = np.flatnonzero(level.light.any(axis=1))
        for axes, angle in self.caps:
            limits = np.cos(np.minimum(angle + level.radii[cells], np.pi)) - ROUNDING
            cells = cells[(axes @ level.directions[cells].T).max(axis=0) >= limits]
        return cells

    def near_core(self, cosines: Array, radii: Array, part: float = PART) -> NDArray[np.bool_]:
        """Which cells are larger than a part of the core of a lobe, where it may be.

        `cosines`, of shape (..., m), are those of the centroids with central directions.

        Returns an array of shape (..., m).
        """
        least = part * self.core[0]
        near = np.zeros(cosines.shape, dtype=bool)
        large = np.flatnonzero(radii > least)
        beyond = self._beyond_core(cosines[..., large], radii[large])
        near[..., large] = radii[large] > least + _GRADING * beyond
        return near

    def _beyond_core(self, cosines: Array, radii: Array) -> Array:
        """How far cells lie from where the core of a lobe may be, radians, shape (..., m)."""
        angles = np.arccos(np.clip(cosines, -1, 1))
        return np.maximum(angles - radii - self.core[1], 0)

    def of_pixels(
        self, pixels: Level, cells: Indices, values: Array, coarse: Array, weights: Array,
        scale: Array,
    ) -> Array:  # fmt: skip
        """Sum the light of pixels, shape (points, 3), of known values at their middles.

        `cells` are the pixels, in the order of `quarters`.

        Those that are large beside the core of the lobe of a point, or cross the edge of its cap,
        are cut into parts: if the point has enough of its luminance, `scale`, from theirs,
        `weights`; or if the transfer function is bent there, as it tells in the middle of four,
        `coarse`; or if they are so large that it could be bent without being told.
        """
        directions, sides = pixels.directions[cells], pixel_sides(pixels, cells)
        radii = np.linalg.norm(sides, axis=-1).max(axis=-1) / 2
        large = self.near_core(self.centers @ directions.T, radii, _PIXEL_PART)
        some = np.flatnonzero(large.any(axis=0))
        own, fours = values[..., some], some % coarse.shape[-1]
        is_heavy = _relative(own, scale) * weights[some] > _PIXEL_SHARE
        bent = values.reshape(*values.shape[:2], 4, -1)[..., fours].mean(axis=2)
        bent = _relative(bent - coarse[..., fours], scale) * _OWN_SPREAD
        is_bent = bent * weights[some] > _BENT
        large[:, some] &= is_heavy | is_bent | (radii[some] > _HIDING * self.core[0])
        edge = self.on_edge(directions, radii, weights, values, scale)
        light = pixels.light[cells]
        total = self._over_pixels(edge, directions, sides, light, _EDGE_NODES)
        total += self._over_pixels(large & ~edge, directions, sides, light, _FEWEST_NODES)
        cut = large | edge
        return total + _sums(np.where(cut, 0, values) if cut.any() else values, light)

    def _over_pixels(
        self, cut: NDArray[np.bool_], directions: Array, sides: Array, light: Array, fewest: int
    ) -> Array:
        """Sum the light of the pixels that are `cut`, (points, m), over the area of each.

        Each pair of a point and a pixel is integrated by itself, by as many nodes as the lobe of
        the point needs there, and no fewer than `fewest`. A pixel that would need more than
        `_MOST_NODES` along its sides is cut into quarters before, until none does.

        Returns an array of shape (points, 3).
        """
        total = np.zeros(self.centers.shape)
        points: Indices
        pixels: Indices
        points, pixels = np.nonzero(cut)
        while len(points):
            some, pixels = _used(pixels, len(directions))
            directions, sides, light = directions[some], sides[some], light[some]
            nodes = np.maximum(self._nodes(points, pixels, directions, sides), fewest)
            for count in range(fewest, _MOST_NODES + 1):
                pairs = np.flatnonzero(nodes == count)
                if len(pairs):
                    shares = self._means(points[pairs], pixels[pairs], directions, sides, count)
                    for channel, sums in enumerate(shares * light[pixels[pairs]].T):
                        total[:, channel] += np.bincount(points[pairs], sums, len(total))
            ways = (sides[:, None] * _QUARTERS[:, :, None]).sum(axis=2)
            directions = normalize(directions[:, None] + ways).reshape(-1, 3)
            sides, light = np.repeat(sides / 2, 4, axis=0), np.repeat(light / 4, 4, axis=0)
            large = np.flatnonzero(nodes > _MOST_NODES)
            points = np.repeat(points[large], 4)
            pixels = (4 * pixels[large, None] + np.arange(4)).ravel()
        return total

    def _nodes(
        self, points: Indices, pixels: Indices, directions: Array, sides: Array
    ) -> NDArray[np.integer]:
        """How many nodes the lobes of points need along the sides of pixels, for each pair.

        They lie as far apart as the middles of cells may, which see the lobe as it is.
        """
        radii = (np.linalg.norm(sides, axis=-1).max(axis=-1) / 2)[pixels]
        cosines = np.einsum("nc,nc->n", self.centers[points], directions[pixels])
        beyond = self._beyond_core(cosines, radii)
        needed = np.ceil(radii / (PART * self.core[0] + _GRADING * beyond))
        return 1 + needed.astype(np.intp)

    def _means(
        self, points: Indices, pixels: Indices, directions: Array, sides: Array, count: int
    ) -> Array:
        """The mean of the transfer function of points over pixels, shape (channels, pairs)."""
        some, pixels = _used(pixels, len(directions))
        places, shares = _places(directions[some], sides[some], count)
        found = []
        for part in slices(len(points), SAMPLES_AT_ONCE // count**2):
            # Components lie apart in memory, as those that `transfer` has.
            rows = self.rows[:, points[part], :, None]
            towards = np.moveaxis(places[pixels[part]], -1, 1)
            cosines = rows[:, :, 0] * towards[:, 0]
            for axis in (1, 2):
                cosines += rows[:, :, axis] * towards[:, axis]
            found.append(_channels(self.evaluate(cosines[None], points[part])[0]) @ shares)
        return np.concatenate(found, axis=-1)

    def on_edge(
        self, directions: Array, radii: Array, weights: Array, values: Array, scale: Array
    ) -> NDArray[np.bool_]:
        """Which cells cross the edge of a cap, where the transfer function bends or jumps, and are
        large or may hold much of the light of a point, `scale`, by their luminance, `weights`.

        `values` are the transfer function at their centroids, shape (channels, points, m). A dark
        one tells nothing, as a part of its cell may be lit: its inner side tells.

        Returns an array of shape (points, m).
        """
        found = np.zeros(values.shape[1:], dtype=bool)
        most = max(float(values.max()), -float(values.min())) / float(scale.min())
        some = np.flatnonzero((radii > _EDGE) | (weights * most > _PIXEL_SHARE))
        for axes, angle in self.caps:
            cosines, sizes = axes @ directions[some].T, radii[some]
            inner, outer = np.maximum(angle - sizes, 0), np.minimum(angle + sizes, np.pi)
            crosses = (cosines > np.cos(outer)) & (cosines < np.cos(inner))
            small = np.flatnonzero(crosses.any(axis=0) & (sizes <= _EDGE))
            if len(small):
                cells = some[small]
                lit = normalize(directions[cells] + radii[cells, None] * axes.mean(axis=0))
                brighter = np.maximum(np.abs(self.transfer(lit)), np.abs(values[..., cells]))
                crosses[:, small] &= _relative(brighter, scale) * weights[cells] > _PIXEL_SHARE
            found[:, some] |= crosses
        return found


def adaptive_sums(pyramid: Pyramid, points: Points) -> tuple[Array, Array]:
    """Sum the light of a pyramid for points.

    Returns `light` of shape (points, 3); and `errors` of shape (points,), estimated errors of the
    luminance; it is more than the errors are.
    """
    levels = pyramid.levels
    parents = points.lit(levels[-1])
    if not len(parents):
        return np.zeros(points.centers.shape), np.zeros(len(points.centers))
    coarse = points.transfer(levels[-1].directions[parents])
    total = _sums(coarse, levels[-1].light[parents])
    if len(levels) == 1:
        return total, np.zeros(len(total))
    sums, errors, left = np.zeros_like(total), np.zeros(len(total)), ALLOWED
    for above, level in zip(levels[:0:-1], levels[-2::-1], strict=True):
        cells = quarters(parents)
        light, directions = level.light[cells], level.directions[cells]
        values = points.transfer(directions)
        total += _sums(values, light) - _sums(coarse, above.light[parents])
        weights = np.abs(light) @ np.array(LUMINANCE, light.dtype)
        bright = np.abs(total) @ LUMINANCE + points.beside
        scale = np.maximum(bright, max(_DARK * float(bright.mean()), _TINY))
        if level is levels[0]:
            sums += points.of_pixels(level, cells, values, coarse, weights, scale)
            break
        chords = directions.reshape(4, -1, 3) - above.directions[parents]
        curvature, is_known = _curvature(chords, above.spread[parents], values, coarse, weights)
        relative = _relative(curvature, scale).astype(light.dtype)
        spread, radii = level.spread[cells], level.radii[cells]
        worst = np.tile(relative.max(axis=0), 4) * spread
        order = np.argsort(worst, kind="stable")
        spent = np.cumsum(worst[order], dtype=float)
        cut = np.ones(len(cells), dtype=bool)
        cut[order[: np.searchsorted(spent, _SPENT * left, side="right")]] = False
        cut |= points.on_edge(directions, radii, weights, values, scale).any(axis=0)
        cut |= ~np.tile(is_known, 4)
        cut &= spread > 0
        # A pixel alone in the dark has no spread, and may be large beside the lobe all the same.
        nearest = (points.centers @ directions.T).max(axis=0)
        cut |= points.near_core(nearest, radii) & (weights > 0)
        left -= float(worst[~cut].sum(dtype=float))
        light[cut], spread[cut] = 0, 0
        bent = light * (spread / np.maximum(weights, _TINY))[:, None]
        sums += _sums(values, light) + _sums(curvature, bent.reshape(4, -1, 3).sum(axis=0))
        errors += scale * (relative @ spread.reshape(4, -1).sum(axis=0))
        kept = np.flatnonzero(cut)
        parents, coarse = cells[kept], values.take(kept, axis=-1)
        if not len(parents):
            break
    return sums, errors


def quarters(parents: Indices) -> Indices:
    """The quarters of cells: all first ones, then all second ones, and so on, so that arrays of
    them are four of the shape of the cells', one after the other.
    """
    return (4 * parents + np.arange(4)[:, None]).ravel()


def _curvature(
    chords: Array, spread: Array, values: Array, coarse: Array, weights: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """How much T is curved over each parent, shape (channels, points, parents), and where that is
    known, (parents,).

    It is the mean of T over the quarters, by their luminance, less T at the centroid, over the mean
    square of their distances, `chords`, shape (4, parents, 3). Where all light is in one quarter,
    the others tell nothing of the `spread` of the parent.
    """
    shares = weights.reshape(4, -1)
    squares = (shares * np.einsum("qpc,qpc->qp", chords, chords)).sum(axis=0)
    is_known = squares > _TELLS * spread
    shares = shares * (is_known / np.maximum(squares, _TINY))
    fours = values.reshape(*values.shape[:2], 4, -1)
    found = (fours[:, :, 0] - coarse) * shares[0]
    for quarter in range(1, 4):
        found += (fours[:, :, quarter] - coarse) * shares[quarter]
    return found, is_known


def _relative(values: Array, scale: Array) -> Array:
    """The size of values, (channels, points, n), as parts of the light of points: (points, n)."""
    sizes = np.abs(values)
    return (sizes[0] if len(sizes) == 1 else sizes.mean(axis=0)) / scale[:, None]


def _used(indices: Indices, count: int) -> tuple[Indices, Indices]:
    """Return which of 0 .. count - 1 there are among indices, and where each index is among them.

    `np.unique` does the same, and sorts.
    """
    are_used = np.zeros(count, dtype=bool)
    are_used[indices] = True
    return np.flatnonzero(are_used), (np.cumsum(are_used) - 1)[indices]


def _places(directions: Array, sides: Array, count: int) -> tuple[Array, Array]:
    """Return the nodes of a rule of Gauss and Legendre on pixels, and their weights.

    `count` is the number of nodes along each side.

    Returns directions, (m, count^2, 3), and parts of one, shape (count^2,).
    """
    nodes, each = gauss_legendre(count)
    across, down = ((nodes / 2)[:, None] * sides[:, None, side] for side in (0, 1))
    places = normalize(directions[:, None, None] + across[:, :, None] + down[:, None])
    places = places.reshape(len(places), count**2, 3).astype(directions.dtype, copy=False)
    return places, np.outer(each, each).ravel() / 4


def _channels(values: Array) -> Array:
    """View values (..., 3) as (channels, ...), with one channel if they are grey."""
    return values[None, ..., 0] if values.strides[-1] == 0 else np.moveaxis(values, -1, 0)


def _sums(values: Array, light: Array) -> Array:
    """Sum of values (channels, points, n) times light (n, 3): (points, 3)."""
    if len(values) == 1:
        return (values[0] @ light).astype(float)
    return np.stack([values[c] @ light[:, c] for c in range(3)], axis=-1).astype(float)
