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
_MOST_NODES = 6
"""The most nodes of Gauss and Legendre's rule along each side of a pixel: of GGX of roughness .1
under a sunset of 512 rows, 8.8 % of a right picture is wrong beside points, 2.5 % beside parts."""
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

    def near_core(self, directions: Array, radii: Array, part: float = PART) -> NDArray[np.bool_]:
        """Which cells are larger than a part of the core of a point's lobe, where it may be.

        Returns an array of shape (points, m).
        """
        least, reach = part * self.core[0], self.core[1]
        near = np.zeros((len(self.centers), len(radii)), dtype=bool)
        large = radii > least
        if large.any():
            cosines = self.centers @ directions[large].T
            beyond = np.arccos(np.clip(cosines, -1, 1)) - radii[large] - reach
            near[:, large] = radii[large] > least + _GRADING * np.maximum(beyond, 0)
        return near

    def of_pixels(
        self, pixels: Level, cells: Indices, values: Array, coarse: Array, weights: Array,
        scale: Array,
    ) -> Array:  # fmt: skip
        """Sum the light of pixels, shape (points, 3), of known values at their middles.

        Those that are large beside the core of the lobe of a point, or cross the edge of its cap,
        are cut into parts: if the point has enough of its luminance, `scale`, from theirs,
        `weights`; or if the transfer function is bent there, as it tells in the middle of four,
        `coarse`; or if they are so large that it could be bent without being told.
        """
        directions, sides = pixels.directions[cells], pixel_sides(pixels, cells)
        radii = np.linalg.norm(sides, axis=-1).max(axis=-1) / 2
        relative = np.abs(values).mean(axis=0) / scale[:, None]
        is_heavy = relative * weights > _PIXEL_SHARE
        large = self.near_core(directions, radii, _PIXEL_PART)
        fours = values.reshape(*values.shape[:2], -1, 4)
        bent = np.abs(fours.mean(axis=-1) - coarse).mean(axis=0) * _OWN_SPREAD / scale[:, None]
        is_bent = np.repeat(bent, 4, axis=1) * weights > _BENT
        large &= is_heavy | is_bent | (radii > _HIDING * self.core[0])
        edge = self.on_edge(directions, radii, weights, relative, scale)
        light = pixels.light[cells]
        nodes = int(min(1 + np.ceil(radii.max() / (PART * self.core[0])), _MOST_NODES))
        total = self._over_pixels(edge, directions, sides, light, max(nodes, _EDGE_NODES))
        total += self._over_pixels(large & ~edge, directions, sides, light, nodes)
        return total + _sums(np.where(large | edge, 0, values), light)

    def _over_pixels(
        self, cut: NDArray[np.bool_], directions: Array, sides: Array, light: Array, count: int
    ) -> Array:
        """Sum the light of the pixels that are `cut`, (points, m), over the area of each.

        Each pair of a point and a pixel is integrated by itself, by `count` nodes of Gauss and
        Legendre along both sides of the pixel.

        Returns an array of shape (points, 3).
        """
        total = np.zeros(self.centers.shape)
        some = np.flatnonzero(cut.any(axis=0))
        places, shares = _places(directions[some], sides[some], count)
        points, pixels = np.nonzero(cut[:, some])
        for part in slices(len(points), SAMPLES_AT_ONCE // count**2):
            which, own = points[part], pixels[part]
            # Components lie apart in memory, as those that `transfer` has.
            rows, towards = self.rows[:, which, :, None], np.moveaxis(places[own], -1, 1)
            cosines = rows[:, :, 0] * towards[:, 0]
            for axis in (1, 2):
                cosines += rows[:, :, axis] * towards[:, axis]
            means = _channels(self.evaluate(cosines[None], which)[0]) @ shares
            for channel, sums in enumerate(means * light[some[own]].T):
                total[:, channel] += np.bincount(which, sums, len(total))
        return total

    def on_edge(
        self, directions: Array, radii: Array, weights: Array, relative: Array, scale: Array
    ) -> NDArray[np.bool_]:
        """Which cells cross the edge of a cap, where the transfer function bends or jumps, and are
        large or may hold much of the light of a point, `scale`, by their luminance, `weights`.

        `relative` is the transfer function at their centroids, shape (points, m), as parts of that
        light. A dark one tells nothing, as a part of its cell may be lit: its inner side tells.

        Returns an array of shape (points, m).
        """
        some = np.flatnonzero((radii > _EDGE) | (weights * relative.max() > _PIXEL_SHARE))
        found = np.zeros(relative.shape, dtype=bool)
        for axes, angle in self.caps:
            cosines, sizes = axes @ directions[some].T, radii[some]
            inner, outer = np.maximum(angle - sizes, 0), np.minimum(angle + sizes, np.pi)
            crosses = (cosines > np.cos(outer)) & (cosines < np.cos(inner))
            cells = crosses.any(axis=0)
            crosses, cells = crosses[:, cells], some[cells]
            if not len(cells):
                continue
            lit = normalize(directions[cells] + radii[cells, None] * axes.mean(axis=0))
            shares = np.abs(self.transfer(lit)).mean(axis=0) / scale[:, None]
            is_heavy = weights[cells] * np.maximum(shares, relative[:, cells]) > _PIXEL_SHARE
            found[:, cells] |= crosses & (is_heavy | (radii[cells] > _EDGE))
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
        cells = (4 * parents[:, None] + np.arange(4)).ravel()
        light = level.light[cells]
        values = points.transfer(level.directions[cells])
        total += _sums(values, light) - _sums(coarse, above.light[parents])
        weights = np.abs(light) @ np.array(LUMINANCE, light.dtype)
        bright = np.abs(total) @ LUMINANCE + points.beside
        scale = np.maximum(bright, max(_DARK * float(bright.mean()), _TINY))
        if level is levels[0]:
            sums += points.of_pixels(level, cells, values, coarse, weights, scale)
            break
        curvature, is_known = _curvature(above, level, parents, values, coarse, weights)
        relative = (np.abs(curvature).mean(axis=0) / scale[:, None]).astype(light.dtype)
        spread = level.spread[cells]
        worst = np.repeat(relative.max(axis=0), 4) * spread
        order = np.argsort(worst, kind="stable")
        spent = np.cumsum(worst[order], dtype=float)
        cut = np.ones(len(cells), dtype=bool)
        cut[order[: np.searchsorted(spent, _SPENT * left, side="right")]] = False
        shares = np.abs(values).mean(axis=0) / scale[:, None]
        edge = points.on_edge(level.directions[cells], level.radii[cells], weights, shares, scale)
        cut |= edge.any(axis=0)
        cut |= ~np.repeat(is_known, 4)
        cut &= spread > 0
        # A pixel alone in the dark has no spread, and may be large beside the lobe all the same.
        near = points.near_core(level.directions[cells], level.radii[cells])
        cut |= near.any(axis=0) & (weights > 0)
        done = np.flatnonzero(~cut)
        left -= float(worst[done].sum(dtype=float))
        bent = spread[done] / np.maximum(weights[done], _TINY)
        sums += _sums(values[..., done] + curvature[..., done // 4] * bent, light[done])
        errors += scale * (relative[:, done // 4] @ spread[done])
        parents, coarse = cells[cut], values[..., cut]
        if not len(parents):
            break
    return sums, errors


def _curvature(
    above: Level, level: Level, parents: Indices, values: Array, coarse: Array, weights: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """How much T is curved over each parent, shape (channels, points, parents), and where that is
    known, (parents,).

    It is the mean of T over the quarters, by their luminance, less T at the centroid, over the mean
    square of their distances. Where all light is in one quarter, the others tell nothing.
    """
    quarters = (4 * parents[:, None] + np.arange(4)).ravel()
    chords = level.directions[quarters].reshape(-1, 4, 3) - above.directions[parents][:, None]
    shares = weights.reshape(-1, 4)
    squares = np.einsum("pq,pqc,pqc->p", shares, chords, chords)
    is_known = squares > _TELLS * above.spread[parents]
    shares = shares * (is_known / np.maximum(squares, _TINY))[:, None]
    fours = values.reshape(*values.shape[:2], -1, 4)
    found = (fours[..., 0] - coarse) * shares[:, 0]
    for quarter in range(1, 4):
        found += (fours[..., quarter] - coarse) * shares[:, quarter]
    return found, is_known


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
