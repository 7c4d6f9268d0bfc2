"""Reflected light by angular integration: one sum over the probe for each point.

This is the truth that everything is measured against, and the traditional way to prefilter. A
point is a pair of a normal and a view. Points are taken in small groups of neighbors.

By default a group sums cells of a pyramid of the source, see `shrm_cli.adaptive`, and the error of
that is estimated. The full sum is over all pixels: these are in tiles of neighbors, and a group is
multiplied with those tiles only that may light it. It does not depend on how both are cut, but the
time does.
"""

from collections.abc import Callable, Iterator
from math import prod

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.adaptive import ROUNDING, SAMPLES_AT_ONCE, Cap, Indices, Points, adaptive_sums
from shrm_cli.arrays import Array
from shrm_cli.brdf import lobe
from shrm_cli.brdf.base import Brdf, scaled
from shrm_cli.brdf.core import MOST_CELLS, Core, parts_with_cores
from shrm_cli.brdf.spec import AnyBrdf, as_brdf
from shrm_cli.messages import whole_number
from shrm_cli.probe.coarse import fine_probe, summed_probe
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.source import Pyramid, Source
from shrm_cli.progress import Progress, in_order, tell
from shrm_cli.records import record
from shrm_cli.sphere.directions import (
    as_directions,
    bisector,
    central_directions,
    horizontal_tangents,
    surface_frames,
)
from shrm_cli.vocabulary import LUMINANCE, MAX_SOURCE_HEIGHT, SEEN_FLOOR

Evaluate = Callable[[Array, Indices], Array]
Part = tuple[Brdf, Core | None]
"""A part of a BRDF that is summed at once, and its core, if sums are adaptive."""

_POINTS_AT_ONCE = 64
"""Points of the groups that a thread takes at a time."""
_GROUP_SIZES = 4, 32
"""Fewest and most points of a group."""
_FEW_PIXELS = 2**14
"""Sources of no more are summed in full: of 64 rows, that takes as long as the adaptive sum."""
_PIXELS_OF_CORE = 3
"""Unless the core of a lobe is narrower than so many pixels, which are to be cut then: of 64 rows,
as points under GGX of roughness .3, 1.5 pixels wide, they missed 4 % of a lamp."""
_PART_OF_PIXEL, _ROWS_OF_NEEDLES = 0.25, 512
"""Lobes of less than this part of a pixel see how pixels meet, which are cut to so many rows: even
light of 128 rows was up to 4 % uneven under GGX of roughness .05."""
_ADAPTIVE_SIZES = 4, 64
"""Fewest and most points of a group that is summed adaptively."""
_EXTENT = 0.3
"""The side of such a group, radians, if the points fill the sphere."""
_FULL_SHARE = 0.2
"""Where the core of a lobe may be in so large a part of the pixels, all of them are summed."""
_TINY = 1e-300


class Reference:
    """Reflected light by angular integration; answers `radiance` as every map does.

    With a `source_height` the probe is averaged down to a lat-long of this height first. With a
    `tolerance` the lobe is truncated where it holds all but this fraction of its energy. By default
    it is not truncated. `dtype` is the precision of the integrand. Sums over tiles are float64.
    `exact` sums over all pixels of the source, each as a point in its middle, however coarse they
    are. So it is with small sources, too, and with lobes that are narrow far from their central
    directions, where the adaptive sum does not pay.

    `source` is a pyramid where sums are adaptive. `pixels` are those of the source, before they are
    cut where they are coarse. `angle` is where the lobe is truncated, radians from the central
    direction; pi where it is not (Ramamoorthi 2002, eq. 5.30).
    """

    def __init__(
        self,
        probe: Probe,
        brdf: Brdf,
        source_height: int | None = None,
        tolerance: float | None = None,
        dtype: type = np.float32,
        progress: Progress | None = None,
        exact: bool = False,
    ) -> None:
        if source_height is not None:
            source_height = whole_number("source_height", source_height, 2, MAX_SOURCE_HEIGHT)
        self.brdf = brdf
        self.angle = np.pi if tolerance is None else lobe.lobe_angle(brdf, tolerance)
        self.dtype = dtype
        self.progress = progress
        asked = None if source_height is None else (source_height, 2 * source_height)
        own = prod(asked or probe.grid.shape)
        if asked is None and not exact:
            probe = fine_probe(probe)
        pixels = prod(asked or probe.grid.shape)
        self._core: Core | None = None
        self._parts: list[Part] = [(brdf, None)]
        if not exact:
            self._core = core = Core.of(brdf)
            width, pixel = np.median(core.widths), np.sqrt(4 * np.pi / pixels)
            is_narrow = width < _PIXELS_OF_CORE * pixel
            if is_narrow and asked is None:
                is_needle = width < _PART_OF_PIXEL * pixel
                probe = summed_probe(probe, _ROWS_OF_NEEDLES if is_needle else 0)
                pixels = prod(probe.grid.shape)
            exact = pixels <= _FEW_PIXELS and not is_narrow
            exact = exact or core.cells > min(MOST_CELLS, _FULL_SHARE * pixels)
            # Where lobes are truncated, that is about the central direction of all of them.
            is_one = exact or self.angle < np.pi
            self._parts = [(brdf, core)] if is_one else [*parts_with_cores(brdf, core)]
        made: type[Source] | type[Pyramid] = Source if exact else Pyramid
        self.source = made.of(probe, source_height, dtype)
        self.pixels = min(self.source.pixels, own)
        self._errors: list[Array] = []

    @property
    def error(self) -> float | None:
        """What the adaptive sums may be wrong by: the 95th percentile of the estimated error of the
        luminance over all points so far, as a fraction of it; it counts as 2 % of its mean at
        least. None of full sums.
        """
        if isinstance(self.source, Source):
            return None
        return float(np.percentile(np.concatenate(self._errors), 95)) if self._errors else 0.0

    @property
    def statement(self) -> str:
        """How the truth was summed and how right it is, in words."""
        if self.error is None:
            return f"summed over all {self.source.pixels:,} pixels"
        return f"summed adaptively, 95 % within {max(self.error, 1e-4):.2%}"

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Reflected radiance, shape (..., 3), of normals and views, (..., 3), unit, world axes."""
        normals, views = np.broadcast_arrays(normals, views)
        normals, views = normals.astype(float), views.astype(float)
        centers = central_directions(self.brdf.center, normals, views)
        return self._radiance(centers if self.brdf.center == "tangent" else normals, centers, views)

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        """Reflected radiance of a surface whose tangents are known.

        `normals`, `tangents` and `views`, each of shape (..., 3), broadcastable, are unit, world
        axes. The tangents are perpendicular to the normals and run along the x axis of the BRDF's
        own frame; the y axis is N x T.
        """
        normals, tangents, views = (
            each.astype(float) for each in np.broadcast_arrays(normals, tangents, views)
        )
        if self.brdf.center == "tangent":
            return self._radiance(tangents, tangents, views)
        centers = central_directions(self.brdf.center, normals, views)
        return self._radiance(normals, centers, views, tangents)

    def central_radiance(self, centers: ArrayLike, views: ArrayLike) -> Array:
        """Reflected radiance of central directions instead of normals; else as `radiance`."""
        centers, views = np.broadcast_arrays(centers, views)
        centers, views = centers.astype(float), views.astype(float)
        is_mirror = self.brdf.center == "reflection"
        return self._radiance(bisector(centers, views) if is_mirror else centers, centers, views)

    def _radiance(
        self, axes: Array, centers: Array, views: Array, tangents: Array | None = None
    ) -> Array:
        """Reflected radiance of points, all arrays of one shape (..., 3).

        `axes` are the z axes of the frames that the BRDF is evaluated in: the normals, or the
        tangents of a BRDF that is central about them. `tangents` are their x axes; anisotropic
        BRDFs are brushed along the horizontal tangent by default, and the others do not care.
        """
        shape = axes.shape
        axes, views, centers = (each.reshape(-1, 3) for each in (axes, views, centers))
        if tangents is not None:
            tangents = tangents.reshape(-1, 3)
        found, errors = np.zeros(axes.shape), np.zeros(len(axes))
        for number, part in enumerate(self._parts):
            lit = self._lit(part, axes, centers, views, tangents)
            beside = np.abs(found @ LUMINANCE)
            light, error = self._integrate(lit, beside, (number, len(self._parts)))
            found += light
            errors += error
        self._note(found, errors)
        return found.reshape(shape)

    def _lit(
        self, part: Part, normals: Array, centers: Array, views: Array, tangents: Array | None
    ) -> "_Lit":
        """A part of the BRDF at points."""
        (brdf, core), truncated = part, self.angle < np.pi
        if brdf.center != self.brdf.center:
            centers = central_directions(brdf.center, normals, views)
        if brdf.zonal:  # it depends on C.L alone, so N and V may be C
            normals = views = centers
        if tangents is None or brdf.zonal:
            tangents = horizontal_tangents(normals)
        rows = surface_frames(normals, tangents)
        local_views = np.einsum("nij,nj->ni", rows, views).astype(self.dtype)
        if truncated and not brdf.zonal:  # the last row is C
            rows = np.concatenate([rows, centers[:, None]], axis=1)
        caps = []
        reach = self._reach(brdf)
        if reach < np.pi:
            caps.append((centers, reach))
        if lobe.cuts_horizon(brdf):
            caps.append((normals, np.pi / 2))
        bound = self.dtype(np.cos(self.angle))

        def evaluate(cosines: Array, points: Indices) -> Array:
            light = np.moveaxis(cosines[:, :3], 1, -1)
            values = brdf.transfer(light, local_views[points][:, :, None])
            return scaled(values, cosines[:, -1] >= bound) if truncated else values

        angles = np.arccos(np.clip(np.einsum("nj,nj->n", centers, views), -1, 1))
        return _Lit.of(rows, evaluate, caps, centers, angles, core, self.dtype)

    def _reach(self, brdf: Brdf) -> float:
        """How far from its central directions a part of the BRDF reflects, radians."""
        return min(self.angle, lobe.zonal_support(brdf)) if brdf.zonal else self.angle

    def _note(self, light: Array, errors: Array) -> None:
        """Keep estimated errors of the luminance of points, shape (n,), as parts of it."""
        if not len(light):
            return
        luminance = np.abs(light @ LUMINANCE)
        least = max(SEEN_FLOOR * float(luminance.mean()), _TINY)
        self._errors.append(errors / np.maximum(luminance, least))

    def zonal_radiance(self, centers: ArrayLike, view_theta: float) -> Array:
        """Light integrated with the lobe's mean over the azimuth (Kautz and McCool).

        `centers`, of shape (..., 3), are central directions, unit, world axes. `view_theta` is the
        angle theta_o' between them and the view, radians.

        Returns an array of float64 of shape (..., 3), the mean of the reflected radiance over all
        views at that angle from the center.
        """
        centers = np.asarray(centers, dtype=float)
        points = centers.reshape(-1, 3)
        _, means = lobe.azimuthal_mean(self.brdf, view_theta)
        means = means.astype(self.dtype)
        bound = self.dtype(np.cos(self.angle))

        def evaluate(cosines: Array, points: Indices) -> Array:
            cosine = cosines[:, 0]
            return scaled(lobe.interpolate_mean(cosine, means), cosine >= bound)

        caps, angles = [(points, self._reach(self.brdf))], np.full(len(points), view_theta)
        rows = points[:, None]
        lit = _Lit.of(rows, evaluate, caps, points, angles, self._core, self.dtype)
        light, errors = self._integrate(lit, np.zeros(len(points)))
        self._note(light, errors)
        return light.reshape(centers.shape)

    def _integrate(
        self, lit: "_Lit", beside: Array, stage: tuple[int, int] = (0, 1)
    ) -> tuple[Array, Array]:
        """Sum over the source at every point, for a part of the BRDF.

        `beside`, of shape (points,), is the luminance of other parts, beside which errors count.
        `stage` tells how many parts were summed before, and how many there are, for the progress.

        Returns `light`, shape (points, 3), and the estimated `errors` of its luminance, (points,),
        which are 0 for full sums.
        """
        count, done = len(lit.rows), 1
        result, errors = np.zeros((count, 3)), np.zeros(count)
        if count == 0:
            return result, errors
        if isinstance(self.source, Source):
            groups = self._full(self.source, lit)
        else:
            groups = self._adaptive(self.source, lit, beside, errors)
        for points, sums in groups:
            result[points] = sums
            done += int(np.count_nonzero(points < count - 1))  # the last one fills up groups
            tell(self.progress, stage[0] * count + done, stage[1] * count)
        return result, errors

    def _adaptive(
        self, source: Pyramid, lit: "_Lit", beside: Array, errors: Array
    ) -> Iterator[tuple[Indices, Array]]:
        """Yield groups of points and their adaptive sums, and set the errors of these."""
        core = lit.core
        assert core is not None
        size = int(np.clip(len(lit.rows) * _EXTENT**2 / (4 * np.pi), *_ADAPTIVE_SIZES))
        groups = list(_neighbors(lit.centers, size))

        def work(points: Indices) -> tuple[Array, Array]:
            group = Points(
                np.ascontiguousarray(lit.rows[points].swapaxes(0, 1)),
                lambda cosines, which: lit.evaluate(cosines, points[which][None]),
                [(axes[points], angle) for axes, angle in lit.caps],
                lit.centers[points],
                core.seen(lit.angles[points]),
                beside[points],
            )
            return adaptive_sums(source, group)

        # Calls of models are so short that threads wait for one another: two of them took a sixth
        # longer than one, and half as much of the processors again.
        found = in_order(work, groups, self.brdf.is_measured)
        for points, (sums, error) in zip(groups, found, strict=True):
            errors[points] = error
            yield points, sums

    def _full(self, source: Source, lit: "_Lit") -> Iterator[tuple[Indices, Array]]:
        """Yield groups of points and their sums over all pixels."""
        rows, axes = lit.rows, [axis for axis, _ in lit.caps]
        limits = [
            np.cos(np.minimum(angle + source.angles, np.pi)).astype(self.dtype) - ROUNDING
            for _, angle in lit.caps
        ]
        # Groups are to be small beside the lobe, if the points fill the sphere.
        size = len(rows) * (min(self._reach(self.brdf), np.pi / 2) / 10) ** 2
        first_axes = axes[0] if axes else rows[:, 0]
        groups = _neighbors(first_axes, int(np.clip(size, *_GROUP_SIZES)))
        at_once = max(_POINTS_AT_ONCE // groups.shape[1], 1)
        step = max(SAMPLES_AT_ONCE // (groups.shape[1] * source.light.shape[1]), 1)

        def work(start: int) -> tuple[Indices, Array]:
            points = groups[start : start + at_once]
            near = np.ones((*points.shape, len(source.axes)), dtype=bool)
            for axis, limit in zip(axes, limits, strict=True):
                near &= axis[points] @ source.axes.T >= limit
            pairs = np.nonzero(near.any(axis=1))
            # Planes of cosines are contiguous if the points vary faster than the k rows.
            own_rows = rows[points].swapaxes(1, 2).reshape(len(points), -1, 3)
            sums = np.zeros((*points.shape, 3))
            for first in range(0, len(pairs[0]), step):
                group, tile = (which[first : first + step] for which in pairs)
                cosines = own_rows[group] @ source.directions[tile]
                cosines = cosines.reshape(len(group), rows.shape[1], points.shape[1], -1)
                parts = _light(lit.evaluate(cosines, points[group]), source.light[tile])
                starts = np.nonzero(np.diff(group, prepend=-1))[0]
                sums[group[starts]] += np.add.reduceat(parts, starts, axis=0, dtype=float)
            return points, sums

        yield from in_order(work, range(0, len(groups), at_once))


@record(eq=False)
class _Lit:
    """A part of the BRDF at points, which are to be lit."""

    rows: Array
    """Vectors whose cosines with the directions to the light `evaluate` needs, shape (points, k,
    3)."""
    evaluate: Evaluate
    """From cosines, shape (pairs, k, group, m), and the indices of their points, (pairs, group), to
    the transfer function, (pairs, group, m, 3); a pair is one of a group of points and a tile of m
    pixels."""
    caps: list[Cap]
    """Each point is lit from within all of them: axes, shape (points, 3), and an angle, radians."""
    centers: Array
    angles: Array
    """`centers` and `angles`: the central directions, shape (points, 3), and the angles from them
    to the views, radians, shape (points,)."""
    core: Core | None
    """The core of the part's lobe; full sums need none."""

    @classmethod
    def of(
        cls, rows: Array, evaluate: Evaluate, caps: list[Cap], centers: Array, angles: Array,
        core: Core | None, dtype: type,
    ) -> "_Lit":  # fmt: skip
        """Return the part with vectors of a data type, in which its sums are computed."""
        typed: list[Cap] = [(axes.astype(dtype), angle) for axes, angle in caps]
        return cls(rows.astype(dtype), evaluate, typed, centers.astype(dtype), angles, core)


def reference(
    probe: AnyProbe,
    brdf: AnyBrdf,
    normals: ArrayLike,
    views: ArrayLike,
    source_height: int | None = None,
    progress: Progress | None = None,
    exact: bool = False,
) -> Array:
    """Reflected radiance by angular integration: the truth to compare a map with.

    Parameters
    ----------
    probe : Probe, path-like or array
    brdf : Brdf, str or path-like
        A BRDF, its specification or its file.
    normals, views : array_like, shape (..., 3), broadcastable
        Unit, world axes; views point to the viewer.
    source_height : int, optional
        Rows of the lat-long that the probe is averaged down to first, which is faster.
    progress : callable, optional
        Called with the number of points done and of points in all.
    exact : bool
        Sum over all pixels of the probe, each as a point. By default it is summed adaptively, and
        pixels are as bright all over: large probes within a percent of all points, in a fiftieth
        of the time. `shrm_cli.reference.Reference` tells its error.

    Returns
    -------
    ndarray of float64, shape (..., 3)

    Raises
    ------
    ProbeError, BrdfError

    Examples
    --------
    >>> white = np.ones((16, 32, 3), np.float32)
    >>> up = [0.0, 1.0, 0.0]
    >>> shrm.reference(white, "lambertian", up, up).round(2).tolist()
    [1.0, 1.0, 1.0]
    """
    normals, views = as_directions(normals=normals, views=views)
    light = as_probe(probe)
    material = as_brdf(brdf, light.chromaticities)
    truth = Reference(light, material, source_height, progress=progress, exact=exact)
    return truth.radiance(normals, views)


def _neighbors(directions: Array, size: int) -> Indices:
    """Directions, shape (n, 3), in groups of neighbors.

    All of them are cut into halves along the longest side of their bounding box, these into halves
    along theirs, and so on.

    Returns an array of int of shape (groups, at most size), indices. The last direction stands
    several times where groups would not be full.
    """
    count = len(directions)
    levels = max(int(np.ceil(np.log2(max(count, 1) / size))), 0)
    members = -(-count // 2**levels)
    groups = np.minimum(np.arange(members * 2**levels), count - 1)[None]
    for _ in range(levels):
        points = directions[groups]
        axis = np.argmax(np.ptp(points, axis=1), axis=-1)
        along = np.take_along_axis(points, axis[:, None, None], axis=2)[..., 0]
        half = groups.shape[1] // 2
        order = np.argpartition(along, half, axis=1)
        groups = np.take_along_axis(groups, order, axis=1).reshape(-1, half)
    return groups


def _light(values: Array, light: Array) -> Array:
    """Sum of values (pairs, group, tile, 3) times light (pairs, tile, 3): (pairs, group, 3)."""
    if values.strides[-1] == 0:
        return values[..., 0].astype(light.dtype, copy=False) @ light
    parts = [values[..., c] @ light[..., c, None] for c in range(3)]
    return np.concatenate(parts, axis=-1)
