"""Maps over the central direction times a BRDF's own functions of the view.

A lobe is a set of RGB cubes over the central direction, in bundles, and a table of functions of the
angle of the view. A bundle of degree p holds one function of each azimuthal order q = 0 .. p. Its
``2p + 1`` cubes are coefficients of real harmonics of degree p in world axes, so that they are
filtered without a pole or a seam. Around the central direction C, only harmonics in the plane of C
and the view count: the bundle's harmonics at ``p + 1`` fixed angles from C in that plane tell the
part of each q, which is multiplied with its function.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, relative_rms, slices
from shrm_cli.errors import MapError
from shrm_cli.maps.base import REMEDY, Map
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.joint import brightness, joint_error
from shrm_cli.maps.kinds import BrushedLight, ReflectionMap
from shrm_cli.maps.options import SHARED
from shrm_cli.maps.principal.about_center import orders_in_plane
from shrm_cli.maps.principal.functions import MAX_Q, span_of
from shrm_cli.maps.principal.selection import bundle_counts
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.size import check_size
from shrm_cli.records import record
from shrm_cli.sphere.cube import (
    CubeSampler,
    cube_directions,
    nearest_texels,
    texel_directions,
    texel_solid_angles,
)
from shrm_cli.sphere.directions import bisector, central_directions, horizontal_tangents, to_angles
from shrm_cli.sphere.harmonics import legendre_table
from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.sphere.rotation import rotate_to_frames
from shrm_cli.vocabulary import Center, Frame, Sampling

LookUp = Callable[[Array], Array]
"""From directions, shape (n, 3), to the values of all cubes there, shape (n, 3K)."""

_DEFAULT_ORDER_P = 8
"""The order P of the SHRM that a map is converted to, where none is asked for."""
_GREY = 1e-6
"""How far the functions of two channels of a grey BRDF may be apart, beside the largest one."""
_NODES = 64
"""Gauss's nodes over the angle of the view, for conversions."""
_VALUES_AT_ONCE = 2**18
"""The most values of cubes that are looked up at a time, so that they stay in a processor's cache:
1 MB as 32-bit floats."""


@record(eq=False)
class Lobe:
    """The light that one term of a BRDF reflects, about its own central direction."""

    cubes: Array
    """The cubes of all bundles, one after the other, shape (6N, N, K, 3). In a bundle they are the
    coefficients of the real harmonics of its degree in world axes."""
    degrees: tuple[int, ...]
    """The degree of each bundle, descending."""
    functions: Array
    """The functions of the view of all bundles, for q = 0 .. p of each, at even angles from 0 to
    180 degrees from the mirror direction, or to 90 from the normal, shape (n, entries, 3). They
    take the place of the normalized Legendre functions f_pq(theta_o), in the convention of
    `legendre_table`."""
    center: Center
    """What the central direction is."""
    albedo: Array | None = None
    """The directional albedo at the same angles, which the functions are multiplied with, shape
    (entries, 3)."""

    is_brushed = False

    def __post_init__(self) -> None:
        shape = self.cubes.shape
        if len(shape) != 4 or shape[0] != 6 * shape[1] or shape[3] != 3:
            raise ValueError(f"cubes of shape {shape}, not (6N, N, K, 3)")
        if not self.degrees or not all(0 <= p <= MAX_Q for p in self.degrees):
            raise ValueError(f"bundles of degrees {self.degrees}")
        if sum(2 * p + 1 for p in self.degrees) != shape[2]:
            raise ValueError(f"{shape[2]} cubes for bundles of degrees {self.degrees}")
        if len(self.functions) != sum(p + 1 for p in self.degrees):
            raise ValueError(f"functions of shape {self.functions.shape}")
        if self.albedo is not None and self.albedo.shape != self.functions.shape[-2:]:
            raise ValueError(f"an albedo of shape {self.albedo.shape}")

    @property
    def size(self) -> int:
        return self.cubes.shape[1]

    @property
    def span(self) -> float:
        """The largest angle of the table, radians."""
        return span_of(self.center)

    def at(self, theta: Array) -> Array:
        """Return the functions at angles of the view, interpolated linearly.

        `theta`, of shape (...), holds angles from the central direction, radians.

        Returns an array of shape (..., n, 3). They are multiplied with the albedo, if there is one.
        """
        table = self.functions
        if self.albedo is not None:
            table = table * self.albedo
        table = np.moveaxis(table, -2, 0)
        position = np.clip(theta / self.span, 0, 1) * (len(table) - 1)
        low = np.minimum(position.astype(np.intp), len(table) - 2)
        part = (position - low).reshape(*np.shape(theta), *[1] * (table.ndim - 1))
        return np.asarray((1 - part) * table[low] + part * table[low + 1])

    def radiance(
        self, look_up: LookUp, centers: Array, views: Array, tangents: Array | None = None
    ) -> Array:
        """Evaluate the light of the lobe for central directions and views, shape (..., 3).

        `look_up` is such as a `CubeSampler` of the cubes as (6N, N, 3K). `centers` and `views`,
        each of shape (..., 3), are unit vectors in world axes. `tangents`, of shape (..., 3), are
        those of the surface, for lobes that depend on them; horizontal ones by default.
        """
        shape = centers.shape
        if tangents is None:
            normals = bisector(centers, views) if self.center == "reflection" else centers
            tangents = horizontal_tangents(normals)
        flat = [each.reshape(-1, 3) for each in (centers, views, tangents)]
        result = np.empty(flat[0].shape)
        for part in slices(len(result), _VALUES_AT_ONCE // self._values_a_point):
            result[part] = self._radiance(look_up, *(each[part] for each in flat))
        return result.reshape(shape)

    @property
    def _values_a_point(self) -> int:
        return 3 * self.cubes.shape[2]

    def _radiance(self, look_up: LookUp, centers: Array, views: Array, tangents: Array) -> Array:
        """Evaluate what `radiance` does, for so few points that they fit into memory."""
        theta, across = self._plane(centers, views)
        functions = self.at(theta)
        result = np.zeros(centers.shape)
        for place, by_order in self._by_order(look_up, orders_in_plane, centers, across):
            result += np.einsum(
                "nbqc,nbqc->nc", by_order, functions[:, place].reshape(by_order.shape)
            )
        return result

    def _by_order(
        self,
        look_up: LookUp,
        take_apart: Callable[[int, Array, Array, Array], Array],
        centers: Array,
        across: Array,
    ) -> Iterator[tuple[slice, Array]]:
        """Yield where the functions of each degree stand, and the light by azimuthal orders.

        The latter has the shape (n, bundles, orders, 3), and `take_apart` makes it of coefficients
        of harmonics in world axes. Bundles of a degree stand one behind the other, and are taken
        apart together.
        """
        values = look_up(centers).reshape(len(centers), -1, 3)
        cube = first = 0
        for p, same in groupby(self.degrees):
            count = len(list(same))
            bundles = values[:, cube : cube + count * (2 * p + 1)]
            cube += bundles.shape[1]
            place = slice(first, first + count * (p + 1))
            first = place.stop
            by_bundle = bundles.reshape(len(centers), count, 2 * p + 1, 3)
            yield place, take_apart(p, centers, across, by_bundle)

    def _plane(self, centers: Array, views: Array) -> tuple[Array, Array]:
        """Return the angles of views from central directions, and the axes that point to them.

        Where a view is the central direction, the axis is 0.
        """
        # The normal lies between the mirror direction and the view, and tells their plane even
        # where the view grazes and points away from the mirror direction.
        beside = bisector(centers, views) if self.center == "reflection" else views
        across = beside - np.sum(beside * centers, axis=-1, keepdims=True) * centers
        length = np.linalg.norm(across, axis=-1, keepdims=True)
        across = np.divide(across, length, out=np.zeros_like(across), where=length > 0)
        theta = 2 * np.arctan2(
            np.linalg.norm(views - centers, axis=-1), np.linalg.norm(views + centers, axis=-1)
        )
        return theta, across


def _nearest(cubes: Array, sampling: Sampling, directions: Array) -> Array:
    """Return the values of cubes in the texels nearest to directions, shape (n, 3K)."""
    rows, columns = nearest_texels(directions, cubes.shape[1], sampling)
    return cubes[rows, columns].reshape(len(directions), -1)


@record
class PrincipalMap(BrushedLight, ReflectionMap):
    """A map of the terms of a BRDF, each with its own functions of the view."""

    lobes: tuple[Lobe, ...]
    """Their light adds up. They may differ in center, size and number of functions."""
    info: MapInfo
    sampling: Sampling = "center"

    representation = "principal"
    texels_are_series = True
    format_version = 4
    against_negatives = REMEDY
    frame = "global"

    def __post_init__(self) -> None:
        if not self.lobes:
            raise ValueError("a map has one lobe at least")

    @property
    def size(self) -> int:
        """Texels along an edge of the largest lobe's cubes."""
        return max(lobe.size for lobe in self.lobes)

    @property
    def center(self) -> str:
        """The centers of the lobes, joined by plus signs."""
        return "+".join(lobe.center for lobe in self.lobes)

    @property
    def is_brushed(self) -> bool:
        """Whether a lobe depends on the tangent of the surface."""
        return any(lobe.is_brushed for lobe in self.lobes)

    @property
    def cube_count(self) -> int:
        return sum(lobe.cubes.shape[2] for lobe in self.lobes)

    def planes(self) -> list[Array]:
        """Return the cubes of each lobe, shape (6N, N, 3K)."""
        return [lobe.cubes.reshape(*lobe.cubes.shape[:2], -1) for lobe in self.lobes]

    def mixed(self, matrix: Array, info: MapInfo) -> Map:
        """Return the map with other channels, if its functions of the view are the same in all."""
        tables = [each for lobe in self.lobes for each in (lobe.functions, lobe.albedo)]
        for table in tables:
            if table is not None and np.ptp(table, axis=-1).max() > _GREY * np.abs(table).max():
                raise MapError(
                    f"{self.what} has functions of the view of each channel's own, which "
                    "cannot be mixed; prefilter its probe with `working`"
                )
        return super().mixed(matrix, info)

    def with_planes(
        self, planes: Sequence[Array], sampling: Sampling, info: MapInfo
    ) -> "PrincipalMap":
        lobes = tuple(
            replace(lobe, cubes=plane.reshape(*plane.shape[:2], -1, 3))
            for lobe, plane in zip(self.lobes, planes, strict=True)
        )
        return PrincipalMap(lobes, info, sampling)

    def details(self) -> dict[str, Any]:
        lobes = [
            {
                "center": lobe.center,
                "size": lobe.size,
                "functions": list(bundle_counts(lobe.degrees)),
                "divided_by_albedo": lobe.albedo is not None,
            }
            for lobe in self.lobes
        ]
        return {**super().details(), "lobes": lobes}

    def check_memory(self, size: int) -> None:
        check_size(self.info.order_f, int(np.ceil(np.sqrt(self.cube_count))) - 1, size)

    def _moved(self, size: int, sampling: Sampling) -> Map:
        if len(self.lobes) == 1:
            return super()._moved(size, sampling)
        # What a lobe loses is relative to its own light, so that it is found of each by itself.
        bare = replace(self.info, added_error=0.0)
        alone = [PrincipalMap((lobe,), bare, self.sampling) for lobe in self.lobes]
        moved = [each._moved(size, sampling) for each in alone]
        strengths, whole = brightness(alone)
        lost = joint_error(strengths, [each.info.added_error for each in moved], whole)
        looked_up = joint_error(strengths, [each.info.filter_error for each in moved], whole)
        info = replace(self.info.adding(lost), filter_error=looked_up)
        return self.with_planes([each.planes()[0] for each in moved], sampling, info)

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        normals, tangents, views = np.broadcast_arrays(
            *(np.asarray(each, dtype=float) for each in (normals, tangents, views))
        )
        result = np.zeros(normals.shape)
        for lobe, sampler in zip(self.lobes, self._samplers, strict=True):
            centers = central_directions(lobe.center, normals, views, tangents)
            result += lobe.radiance(sampler, centers, views, tangents)
        return result

    def rough_radiance(self, reflections: Array, views: Array) -> Array:
        """Evaluate the radiance with the center of the nearest texel as the central direction.

        There it is exact. Taking the values of the nearest texels for directions beside them is
        not enough: the functions of small cubes are turned with the direction.
        """
        normals = bisector(reflections, views)
        result = np.zeros(normals.shape)
        for lobe in self.lobes:
            centers = central_directions(lobe.center, normals, views)
            form = lobe.size, self.sampling
            centers = texel_directions(*nearest_texels(centers, *form), *form)
            result += lobe.radiance(partial(_nearest, lobe.cubes, self.sampling), centers, views)
        return result

    def central_radiance(self, centers: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the radiance for central directions; of several lobes, for mirror directions."""
        centers, views = np.asarray(centers, dtype=float), np.asarray(views, dtype=float)
        centers, views = np.broadcast_arrays(centers, views)
        if len(self.lobes) == 1:
            return self.lobes[0].radiance(self._samplers[0], centers, views)
        return self.radiance(bisector(centers, views), views)

    @cached_property
    def parts(self) -> tuple[tuple[Any, str], ...]:
        return tuple((replace(self, lobes=(each,)), each.center) for each in self.lobes)

    @cached_property
    def _samplers(self) -> list[CubeSampler]:
        return [CubeSampler(plane, self.sampling) for plane in self.planes()]

    def to_shrm(self, order_p: int | None = None, frame: Frame | None = None) -> Shrm:
        """Return the SHRM that the functions of the view have, up to an order P.

        `order_p` is the order P, by default 8. `frame` is the frame of the result; global by
        default.
        """
        if self.is_brushed:
            raise MapError(
                "an SHRM knows no tangents, and cannot hold a brushed surface; keep the map, or "
                "make a product texture of the probe"
            )
        if len(self.lobes) > 1:
            raise MapError(
                "a sum of lobes about different centres has no single SHRM; prefilter again for "
                "an SHRM, or convert it to explicit maps"
            )
        order_p = _DEFAULT_ORDER_P if order_p is None else SHARED["order_p"].checked(order_p)
        check_size(self.info.order_f, order_p, self.size)
        return _expanded(self, order_p).to_frame(frame or "global")


def _expanded(source: PrincipalMap, order_p: int) -> Shrm:
    """Return the local SHRM of a map of one lobe, and add what its order P leaves out."""
    (lobe,) = source.lobes
    nodes, weights = gauss_legendre(_NODES)
    theta, weights = (nodes + 1) / 2 * lobe.span, weights / 2 * lobe.span
    measure = weights * np.sin(theta)
    functions = np.moveaxis(lobe.at(theta), 1, 0)
    legendre = legendre_table(order_p, np.cos(theta), max_m=min(order_p, MAX_Q))
    directions = to_angles(cube_directions(source.size, source.sampling).reshape(-1, 3))
    solid = texel_solid_angles(source.size, source.sampling).ravel()
    texels = lobe.cubes.reshape(len(solid), -1, 3)
    result = np.zeros((len(solid), (order_p + 1) ** 2, 3), dtype=texels.dtype)
    lost = whole = 0.0
    cube = first = 0
    for p in lobe.degrees:
        turned = np.zeros(((p + 1) ** 2, 3, len(solid)), dtype=texels.dtype)
        turned[p**2 :] = texels[:, cube : cube + 2 * p + 1].transpose(1, 2, 0)
        local = rotate_to_frames(turned, *directions)
        for q in range(p + 1):
            function = functions[first + q]
            parts = np.zeros((order_p + 1, 3))
            if q <= order_p:
                parts[q:] = 2 * np.pi * (legendre[q, : order_p + 1 - q] * measure) @ function
            norm = 2 * np.pi * measure @ function**2
            left = np.maximum(norm - np.sum(parts**2, axis=0), 0)
            for sign in {q, -q}:
                plane = local[p * (p + 1) + sign].T
                # Squares of bright light are beyond 32-bit floats.
                energy = np.einsum("nc,nc,n->c", plane, plane, solid, dtype=float)
                lost, whole = lost + float(energy @ left), whole + float(energy @ norm)
                for degree in range(q, order_p + 1):
                    result[:, degree * (degree + 1) + sign] += plane * parts[degree]
        cube, first = cube + 2 * p + 1, first + p + 1
    added = relative_rms(lost, whole)
    info = replace(source.info.adding(added), order_p=order_p)
    shaped = result.reshape(6 * source.size, source.size, -1, 3)
    return Shrm(shaped, "local", lobe.center, info, source.sampling)
