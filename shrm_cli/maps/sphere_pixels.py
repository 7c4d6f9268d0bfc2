"""Points that stand for all pixels of spheres, at which maps are judged.

Central directions lie on rings, for all of which light is rotated at once. About each of them views
are spread such that all pixels of spheres count alike, that are seen in parallel projection from
all sides.
"""

from functools import cache, cached_property

import numpy as np

from shrm_cli.arrays import Array, Indices
from shrm_cli.records import record
from shrm_cli.sphere.directions import (
    bisector,
    from_angles,
    horizontal_tangents,
    local_frame,
    normalize,
)
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.vocabulary import Center

_VIEWS, _AZIMUTHS = 24, 4
"""The angles of views from a central direction, and the azimuths of each of them. With 12 angles
a quarter was missing of 23 % (`charlie`, P = 12) and of 18 % (a measured cloth); 24 suffice."""
_TIMES_BRUSHED = 2
"""How many times as many angles anisotropic lobes are known at, which differ by the azimuth of the
tangent, too. With as many as others, 3.8 to 8.9 parts of a thousand were wrong under a sunrise,
depending on which azimuths these were."""


@record
class Rings:
    """Central directions that are spread evenly, on rings of equal shares of the sphere."""

    count: int
    around: int
    """The directions on each ring."""

    @cached_property
    def theta(self) -> Array:
        """The polar angles of the rings, shape (count,)."""
        return np.arccos(1 - (2 * np.arange(self.count) + 1) / self.count)

    @cached_property
    def turns(self) -> Array:
        """How far rings are turned against each other, shape (count,).

        It is by the golden angle, so that no meridian is special.
        """
        return np.pi * (3 - np.sqrt(5)) * np.arange(self.count)

    @cached_property
    def twists(self) -> Array:
        """How far the azimuths of the views about each direction are turned, (count around,).

        Else the few views of all directions would look the same way.
        """
        return np.pi * (3 - np.sqrt(5)) * np.arange(self.count * self.around)

    @cached_property
    def frames(self) -> Array:
        """The frames about the directions, shape (count around, 3, 3)."""
        phi = self.turns[:, None] + 2 * np.pi / self.around * np.arange(self.around)
        return local_frame(self.theta[:, None], phi).reshape(-1, 3, 3)


_OF_MANY_VIEWS = Rings(12, 40)
"""Of 8 rings of 30 a tenth of the wrong pixels was missing under a city and at night (`charlie`,
4.3 % of 4.8 %)."""
_DENSE = Rings(24, 80)
"""Texels are finer than lobes. Between the 12 texels of cubes of `charlie` 2.4 % of 480 directions
were wrong, and 3.5 % of all."""
_OF_ONE_VIEW = Rings(48, 160)
"""Where all views of a direction look the same, the directions alone tell. Of `phong:exponent=64`
in a courtyard 4.8 % of 1,920 were wrong, and 6 % of all."""


def view_count(is_brushed: bool) -> int:
    """Return the number of views at which lobes are known, unless all are the same."""
    return _VIEWS * (_TIMES_BRUSHED if is_brushed else 1)


def sample_views(center: Center, count: int = _VIEWS) -> tuple[Array, Array]:
    """Return angles of views from the central direction that stand for all pixels of spheres.

    About the mirror direction these pixels are uniform over all views. About the normal they are
    so over the squared sine of the angle, above the horizon, and that angle is half the one from
    the mirror direction: both are the same views. Views are dense where they graze the surface,
    because errors are large there. About the tangent all views count alike.

    Returns theta_o, of shape (count,), in radians, ascending, and, of the same shape, the share of
    the pixels that each of them stands for.
    """
    left = 1 - (np.arange(count) + 0.5) / count
    theta_o = np.arccos(2 * left**2 - 1)
    return (theta_o / 2 if center == "normal" else theta_o), left / left.sum()


def sample_tangents(count: int) -> Array:
    """Return the azimuths of the views of `sample_views` from the tangent, radians, (count,)."""
    return np.asarray(2 * np.pi * ((np.arange(count) + 0.5) * (np.sqrt(5) - 1) / 2 % 1))


@record(eq=False)
class Pixels:
    """Points at which lobes about a central direction are lit; see `pixels`."""

    center: Center
    rings: Rings
    theta_o: Array
    """The angles of the views from C, shape (views,), radians."""
    azimuths: Array
    """Those of the views about C, less the twists of the rings, shape (azimuths,), or that of all
    points."""
    parts: Array
    """How many of the pixels of a view a point stands for, 1 in the mean over those of a surface.
    Shape (1, 1, azimuths), or that of all points."""
    surfaces: tuple[slice, ...]
    """The azimuths on each of the surfaces that are judged by themselves."""

    @cached_property
    def views(self) -> Array:
        """Unit vectors, world axes, shape (directions, views, azimuths, 3); read-only."""
        local = from_angles(self.theta_o[:, None], self.rings.twists[:, None, None] + self.azimuths)
        found = np.einsum("dij,dvaj->dvai", self.rings.frames, local)
        found.setflags(write=False)
        return found

    @cached_property
    def normals(self) -> Array:
        """Those of the surfaces, of the same shape; read-only. Of fibres it is any of them."""
        beside = self._along(0 if self.center == "tangent" else 2)
        return bisector(beside, self.views) if self.center == "reflection" else beside

    def _along(self, axis: int) -> Array:
        """Return an axis of the frames about the central directions, of which 2 is the last."""
        return np.broadcast_to(self.rings.frames[:, None, None, :, axis], self.views.shape)

    def tangents(self, at: tuple[Indices, ...]) -> Array:
        """Return the tangents of surfaces at some of the points, shape (..., 3).

        `at` are the indices of their directions, views and azimuths, each of shape (...). The
        azimuths of the views from the tangents are those of `sample_tangents`. Fibres have their
        central directions.
        """
        if self.center == "tangent":
            return self._along(2)[at]
        normals, views = self.normals[at], self.views[at]
        towards = normalize(views - np.sum(normals * views, axis=-1, keepdims=True) * normals)
        azimuth = sample_tangents(self.views.shape[1])[at[1], None]
        return np.asarray(np.cos(azimuth) * towards - np.sin(azimuth) * np.cross(normals, towards))


@record(eq=False)
class Side:
    """What is seen of spheres from one side or from several, in parallel projection.

    All mirror directions have as many pixels there.
    """

    views: Array
    """Unit vectors, world axes, shape (sides, 3)."""
    count: int
    """The number of pixels from each side."""

    @cached_property
    def points(self) -> tuple[Array, Array]:
        """The mirror directions and views of all pixels, side after side, (n, 3); read-only."""
        mirrored = np.tile(spiral_directions(self.count), (len(self.views), 1))
        views = self.views.repeat(self.count, axis=0)
        for each in (mirrored, views):
            each.setflags(write=False)
        return mirrored, views


_SIDES = 64
"""The views all around from which spheres are looked at, some 29 degrees apart."""


@cache
def all_sides(count: int) -> Side:
    """Return what is seen from sides all around, in so many pixels each."""
    return Side(spiral_directions(_SIDES), count)


@cache
def one_side(side: int, count: int) -> Side:
    """Return what is seen from one of them."""
    return Side(spiral_directions(_SIDES)[[side]], count)


@cache
def pixels(
    center: Center, is_brushed: bool = False, is_dense: bool = False, is_zonal: bool = False
) -> Pixels:
    """Return the points for lobes about a center, of isotropic or of brushed surfaces.

    `is_dense` tells whether what lies between texels matters, and `is_zonal` whether all views of a
    direction look the same. Either takes more directions.

    Of brushed ones half of the azimuths are any, as on meshes that are brushed in all directions.
    With the other half tangents are horizontal, see `horizontal`.
    """
    theta_o, _ = sample_views(center, view_count(is_brushed))
    azimuths: Array = 2 * np.pi * (np.arange(_AZIMUTHS) + 0.5) / _AZIMUTHS
    parts: Array = np.ones((1, 1, _AZIMUTHS))
    surfaces: tuple[slice, ...] = (slice(None),)
    rings = _OF_ONE_VIEW if is_zonal else _DENSE if is_dense else _OF_MANY_VIEWS
    if is_brushed:
        around, half = sample_tangents(len(theta_o)), _AZIMUTHS // 2
        form = rings.frames, azimuths[::2], rings.twists
        azimuths, parts = both_surfaces(center, theta_o, around, *form)
        surfaces = slice(half), slice(half, None)
    return Pixels(center, rings, theta_o, azimuths, parts, surfaces)


# ---- spheres that are brushed around +Y, as `shrm render` and `shrm compare` draw them -----------
# Their tangents are horizontal. Where the angle of the view from the normal N and its azimuth from
# the tangent are known, all N are still as frequent, and each has one central direction C. Seen the
# other way round, a C has up to two normals, at polar angles alpha from +Y with
#
#     C.Y = cos h cos(alpha) - sin h sin(azimuth) sin(alpha) = R cos(alpha - delta),
#
# where h is the angle between C and N. Which part of all normals is reflected about C follows from
# the alpha at both ends of its share of the sphere.


def both_surfaces(
    center: Center, theta_o: Array, azimuth: Array, frames: Array, any_way: Array, twists: Array
) -> tuple[Array, Array]:
    """Return `azimuths` and `parts` of the pixels of any brushed surface, then of such spheres.

    `any_way`, of shape (2,), are the azimuths on any surface, and `twists`, of shape (directions,),
    what azimuths are told from; the rest is as `horizontal` takes it.

    Returns arrays of shape (directions, views, 4).
    """
    around, parts = horizontal(center, theta_o, azimuth, frames)
    others = np.broadcast_to(any_way, around.shape)
    azimuths = np.concatenate([others, around - twists[:, None, None]], axis=2)
    return azimuths, np.concatenate([np.ones_like(others), parts], axis=2)


def horizontal(
    center: Center, theta_o: Array, azimuth: Array, frames: Array
) -> tuple[Array, Array]:
    """Find the views about each central direction with which the tangents are horizontal.

    `theta_o` and `azimuth`, of shape (views,), are their angles from it and their azimuths from the
    tangent, radians. `frames` are those about the central directions, shape (directions, 3, 3).

    Returns the azimuths of the views in these frames, of shape (directions, views, 2), and, of the
    same shape, how many of the pixels of a view each stands for, 1 in the mean. The alpha of the
    first is ``delta + arccos(C.Y / R)``. Where there is no such normal, its part is 0.
    """
    centers = frames[..., 2]
    of_center = theta_o / 2 if center == "reflection" else np.zeros_like(theta_o)
    of_view = theta_o - of_center
    across = -np.sin(of_center) * np.sin(azimuth)
    most, delta = np.hypot(np.cos(of_center), across), np.arctan2(across, np.cos(of_center))

    def alphas(height: Array) -> Array:
        """Return both polar angles of normals, from C.Y of shape (n,), shape (n, views, 2)."""
        away = np.arccos(np.clip(height[:, None] / most, -1, 1))
        second = delta - away + np.where(delta < 0, 2 * np.pi, 0)
        return np.clip(np.stack([delta + away, second], axis=-1), 0, np.pi)

    # All directions share the sphere in bands of equal height.
    ends = np.cos(alphas(np.linspace(-1, 1, len(centers) + 1)))
    place = np.argsort(np.argsort(centers[:, 1]))
    parts = np.abs(np.diff(ends, axis=0))[place]
    alpha = alphas(centers[:, 1])
    normals = np.stack([np.sin(alpha), np.cos(alpha), 0 * alpha], axis=-1)
    tangents = horizontal_tangents(normals)
    turn, inwards, outwards = (each[:, None, None] for each in (azimuth, of_center, of_view))
    towards = np.cos(turn) * tangents + np.sin(turn) * np.cross(normals, tangents)
    views = np.cos(outwards) * normals + np.sin(outwards) * towards
    mirrored = np.cos(inwards) * normals - np.sin(inwards) * towards
    # A turn about +Y takes this central direction to the one that was asked for.
    found = _azimuth(views, horizontal_tangents(mirrored), mirrored)
    own = _azimuth(horizontal_tangents(centers), frames[..., 0], centers)
    return found + own[:, None, None], parts / parts.mean(axis=(0, 2), keepdims=True)


def _azimuth(directions: Array, x: Array, z: Array) -> Array:
    """Return the azimuths of directions in the frames of these x and z axes, radians."""
    across = np.sum(directions * np.cross(z, x), axis=-1)
    return np.asarray(np.arctan2(across, np.sum(directions * x, axis=-1)))
