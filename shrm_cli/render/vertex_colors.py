"""Surfaces that are shaded at the vertices or texels of their mesh, by its transfer."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import MapError, TransferError
from shrm_cli.geometry.mesh import Mesh, smooth_points
from shrm_cli.geometry.rays import Rays
from shrm_cli.geometry.tangents import perpendicular
from shrm_cli.maps.base import Map
from shrm_cli.maps.info import common_brdf
from shrm_cli.maps.lamps.rule import DiscRule, LitDiscs, integrals
from shrm_cli.maps.product.product import ProductMap
from shrm_cli.probe.disc import Disc, disc_coefficients, disc_directions
from shrm_cli.render.variation import Variation, between_steps
from shrm_cli.rooms.lit import STAYS, InGrid, ProductInGrid
from shrm_cli.sphere.directions import horizontal_tangents, normalize
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.transfer.bake import mesh_digest
from shrm_cli.transfer.transfer import Transfer, cut_or_padded, diffuse_colors, glossy_colors

# ---- lamps beside the other light of a mesh ------------------------------------------------------
# Few coefficients hold no shadow of a lamp: to order 4 a dragon under a studio's lamps is 15 % off,
# and 1.5 % where they are taken out of the light and each point of the surface looks for them.

Points = tuple[NDArray[np.int64], Array]
"""Triangles of points, shape (n,), and their places within these, barycentric (n, 3)."""
BrdfAt = Callable[[tuple[float, ...]], Brdf]
"""Takes where parameters are on their ways, nothing where none varies; returns the BRDF."""

_DIRECTIONS = 64
"""Directions within a lamp along which a point in its penumbra looks for it."""
_FIRST = 4
"""Every so many of them tell whether the point is in the penumbra."""
_OF_SAMPLE = 16
"""Every so many of them are all that one of the samples of a pixel looks along."""
_RULED = {1: (0.0, 0.125, 0.25, 0.5, 1.0), 2: (0.0, 0.25, 1.0)}
"""Where on the way of each of so many parameters it is found out how lamps are integrated: closer
at the end where lobes are sharp."""
_LIFT = 1e-5
"""How far above the surface rays begin, as a part of the diagonal of the mesh's box."""


class LampsOnMesh:
    """What a mesh reflects of lamps that it partly hides from itself.

    `rays` meet the same mesh. `discs` are the lamps, world axes. `brdf` takes where parameters are
    on their ways, a tuple of float, and returns the BRDF. White and diffuse by default.
    """

    def __init__(
        self, mesh: Mesh, rays: Rays, discs: Sequence[Disc], brdf: BrdfAt | None = None
    ) -> None:
        self._mesh, self._rays = mesh, rays
        self.discs = tuple(discs)
        self._brdf = brdf
        self._rules = cache(self._rules_at)
        self._directions = tuple(disc_directions(disc, _DIRECTIONS) for disc in discs)
        self._lift = _LIFT * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))

    def with_discs(self, discs: Sequence[Disc]) -> "LampsOnMesh":
        """Return the same mesh under other lamps."""
        return LampsOnMesh(self._mesh, self._rays, discs, self._brdf)

    def turned(self, rotation: Array) -> "LampsOnMesh":
        """Return the same mesh under lamps that a matrix (3, 3) has turned."""
        return self.with_discs(
            [replace(disc, direction=rotation @ disc.direction) for disc in self.discs]
        )

    def radiance(
        self,
        points: Points,
        normals: Array,
        views: Array,
        tangents: Array | None = None,
        samples: NDArray[np.int64] | None = None,
        shares: Array | Sequence[float] = (),
    ) -> Array:
        """Return what points of the surface reflect, shape (n, 3).

        `normals`, `views`, of shape (n, 3), are unit vectors in world axes; normals face the
        viewer. `tangents`, of shape (n, 3), are unit vectors at right angles to the normals; around
        +Y by default. `samples`, of shape (n,), is the number of each point among the samples of
        its pixel, which share the work. `shares`, of shape (n, parameters) or (parameters,), is
        where parameters of the BRDF are on their ways, for each point or for all of them.
        """
        tangents = horizontal_tangents(normals) if tangents is None else tangents
        origins = smooth_points(self._mesh, *points, normals) + self._lift * normals
        seen = [self._seen(origins, normals, each, samples) for each in self._directions]
        if self._brdf is None:
            result = np.zeros((len(origins), 3))
            for disc, directions, share in zip(self.discs, self._directions, seen, strict=True):
                cosines = np.maximum(normals @ directions.T, 0).mean(axis=1)
                result += (share * cosines)[:, None] * (disc.solid_angle / np.pi * disc.radiance)
            return result

        def of_node(node: tuple[float, ...], own: NDArray[np.int64]) -> Array:
            total = np.zeros((len(own), 3))
            for index, share in enumerate(seen):
                there = np.flatnonzero(share[own])
                lit = own[there]
                vectors = normals[lit], views[lit], tangents[lit]
                total[there] += share[lit, None] * self._reflected(node, index, vectors)
            return total

        where = np.asarray(shares)
        if where.ndim == 1:
            return of_node(tuple(where.tolist()), np.arange(len(origins)))
        return between_steps(where, of_node)

    def _reflected(
        self, shares: tuple[float, ...], index: int, vectors: tuple[Array, Array, Array]
    ) -> Array:
        """Return what points of one BRDF reflect of a lamp that nothing hides, shape (n, 3)."""
        assert self._brdf is not None
        normals, views, tangents = vectors
        disc, points = self.discs[index], (normals, views, self.discs[index].direction, tangents)
        brdf, rule = self._brdf(shares), self._rule(shares, index)
        return disc.radiance * integrals(rule, brdf, points, disc.radius, np.float32)

    def _rule(self, shares: tuple[float, ...], index: int) -> DiscRule:
        """Return how a lamp is integrated: as carefully as it needs at the `_RULED` places around.

        Finding a rule takes longer than using it for one of the surfaces between which points are
        interpolated.
        """
        ruled = _RULED.get(len(shares), ())
        around = (
            {max(p for p in ruled if p <= each), min(p for p in ruled if p >= each)}
            for each in shares
        )
        rules = [self._rules(place)[index] for place in product(*around)]
        return DiscRule(
            min(each.width for each in rules),
            max(each.steps for each in rules),
            max(each.reach for each in rules),
        )

    def _rules_at(self, shares: tuple[float, ...]) -> tuple[DiscRule, ...]:
        assert self._brdf is not None
        return LitDiscs(self._brdf(shares), self.discs).rules

    def _seen(
        self, origins: Array, normals: Array, directions: Array, samples: NDArray[np.int64] | None
    ) -> Array:
        """Return the part of a lamp's irradiance that points get, shape (n,).

        Samples of pixels look along other directions each.
        """
        if samples is None:
            share = self._share(origins, normals, directions[::_FIRST])
            partly = np.flatnonzero((share > 0) & (share < 1))
            share[partly] = self._share(origins[partly], normals[partly], directions)
            return share
        share = np.empty(len(origins))
        for each in range(_OF_SAMPLE):
            own = np.flatnonzero(samples % _OF_SAMPLE == each)
            share[own] = self._share(origins[own], normals[own], directions[each::_OF_SAMPLE])
        return share

    def _share(self, origins: Array, normals: Array, directions: Array) -> Array:
        cosines = np.maximum(normals @ directions.T, 0)
        points, along = np.nonzero(cosines)
        free = ~self._rays.occluded(origins[points], directions[along])
        seen = np.bincount(points, free * cosines[points, along], len(origins))
        return seen / np.maximum(cosines.sum(axis=1), np.finfo(float).tiny)


def blended(
    first: LampsOnMesh | None, second: LampsOnMesh | None, share: float
) -> LampsOnMesh | None:
    """Return the lamps of one light, dimmed, beside a share of those of another one."""
    known = first or second
    if known is None:
        return None
    discs = [
        replace(disc, radiance=part * disc.radiance)
        for lamps, part in ((first, 1 - share), (second, share))
        for disc in (() if lamps is None else lamps.discs)
    ]
    return known.with_discs(discs)


# ---- surfaces shaded by the transfer of their mesh -----------------------------------------------


_SAME = 1e-5
"""How far tangents may be from those around +Y, which files hold as 32-bit floats."""


class VertexColors:
    """A mesh with its own shadows, under one light.

    Where few orders make light negative, in shadows beside lamps, it is black. Windows of the light
    help little there and cost much: those that left no more than a thousandth of a bunny's vertices
    negative under a bare sun changed the light by 10 % to 21 % RMS, and no window did for a dragon.
    What is made black is 0.1 % to 5 %.

    `lighting`, of shape (n, 3), or (v, n, 3) where each vertex or texel has its own light, holds
    coefficients of the light in world axes. `product` is that of a glossy surface; by default the
    surface is diffuse, with the transfer's albedo. `lamps` are what the mesh reflects of lamps that
    `lighting` lacks. A diffuse mesh is white to them. `variation` is what parameters of the BRDF
    follow that vary; by default they are in the middle.
    """

    def __init__(
        self,
        mesh: Mesh,
        transfer: Transfer,
        lighting: ArrayLike,
        product: ProductMap | None = None,
        lamps: LampsOnMesh | None = None,
        variation: Variation | None = None,
    ) -> None:
        transfer.check_mesh(mesh_digest(mesh.vertices, mesh.faces), mesh)
        self._mesh, self._transfer, self._product, self._lamps = mesh, transfer, product, lamps
        self._variation = variation
        self._shares: list[float] = []
        # Tangents around +Y are known at each point. Means of those of vertices are not them where
        # normals are near +Y, about which they go all the way round.
        self._is_around = False
        if product is not None:
            transfer.check_glossy()
            self._shares = product.shares({})
            assert transfer.frames is not None
            around = horizontal_tangents(transfer.frames[:, 2])
            self._is_around = bool(np.abs(transfer.frames[:, 0] - around).max() < _SAME)
        self._set(np.asarray(lighting, dtype=float))

    def _set(self, lighting: Array) -> None:
        """Set the light, and what a diffuse surface makes of it and of the lamps."""
        self._lighting = lighting
        self._eye: Array | None = None
        self._colors: list[Array] = []
        if self._product is not None:
            return
        colors = diffuse_colors(self._transfer, lighting)
        if self._lamps is not None and self._transfer.facts.bounces:
            of_lamps = disc_coefficients(self._lamps.discs, self._transfer.order)
            colors += diffuse_colors(self._transfer.bounced(), of_lamps)
        self._colors = [np.maximum(colors, 0)]

    def with_values(self, values: Mapping[str, float]) -> "VertexColors":
        """Return the mesh where parameters have values, if they do not follow anything else."""
        if self._product is None or self._variation is not None:
            return self
        moved = copy(self)
        moved._shares = self._product.shares(values)
        moved._set(self._lighting)
        return moved

    def under(
        self, turn: Array | None, second: "VertexColors | None" = None, share: float = 0.0
    ) -> "VertexColors":
        """Return the mesh under light that has moved; its shadows stay those of the mesh.

        `turn`, of shape (3, 3), is the rotation of the light. `second` is the same mesh under the
        light that this one becomes. `share` is how much of the light is that of the second one.
        """
        light, lamps = self._lighting, self._lamps
        if light.ndim == 3:
            raise MapError(STAYS)
        if second is not None:
            count = max(len(light), len(second._lighting))
            first, other = cut_or_padded(light, count), cut_or_padded(second._lighting, count)
            light = (1 - share) * first + share * other
            lamps = blended(lamps, second._lamps, share)
        if turn is not None:
            light = transform_coefficients(light, turn)
            lamps = None if lamps is None else lamps.turned(turn)
        moved = copy(self)
        moved._lamps = lamps
        moved._set(light)
        return moved

    def radiance(
        self,
        eye: Array,
        points: Points,
        normals: Array,
        views: Array,
        samples: NDArray[np.int64] | None = None,
    ) -> Array:
        """Return the radiance of points towards a viewer, shape (n, 3).

        `eye`, of shape (3,), is where the viewer is. `points`, `normals`, `views` and `samples` are
        as `LampsOnMesh.radiance` takes them.
        """
        transfer, albedo, tangents = self._transfer, self._transfer.albedo, None
        shares: Array = np.array(self._shares)
        each = self.seen_from(eye)
        if self._variation is None or self._product is None:
            found = transfer.at(self._mesh, each[0], *points)
        else:
            shares = self._variation.shares(self._mesh, *points, self._product.varies)
            shares = shares.reshape(len(normals), -1)
            found = np.zeros(normals.shape)
            for colors, weights in zip(each, self._product.weights(shares).T, strict=True):
                own = np.flatnonzero(weights)
                there = transfer.at(self._mesh, colors, points[0][own], points[1][own])
                found[own] += weights[own, None] * there
            found = np.maximum(found, 0)
        if self._lamps is None:
            return found
        if self._product is not None and transfer.frames is not None and not self._is_around:
            along = transfer.at(self._mesh, transfer.frames[:, 0], *points)
            tangents = perpendicular(along, normals)
        lit = self._lamps.radiance(points, normals, views, tangents, samples, shares)
        if self._product is not None:
            return found + lit
        return found + lit * (
            albedo if len(albedo) == 1 else transfer.at(self._mesh, albedo, *points)
        )

    def seen_from(self, eye: Array) -> list[Array]:
        """Return what vertices or texels reflect towards a point, without lamps, shape (v, 3) each.

        These are one, or where parameters follow something one for each texture, of which points
        mix their own.
        """
        if self._product is None:
            return self._colors
        if self._eye is None or not np.array_equal(eye, self._eye):
            views = normalize(eye - self._transfer.positions(self._mesh))
            given = self._lighting, views
            if self._variation is None:
                texture = self._product.at(self._shares)
                colors = glossy_colors(self._transfer, texture, *given)
                self._colors = [np.maximum(colors, 0)]
            else:
                textures = self._product.textures
                self._colors = [glossy_colors(self._transfer, each, *given) for each in textures]
            self._eye = np.array(eye)
        return self._colors


def vertex_colors(
    mesh: Mesh,
    transfer: Transfer,
    light: Map,
    discs: Sequence[Disc] = (),
    path: str = "",
    variation: Variation | None = None,
) -> VertexColors:
    """Return a mesh as a map lights it: diffuse under irradiance, glossy by a product texture.

    `light` is an irradiance map, or a product texture with light. `discs` are lamps that the map's
    light lacks. They cast shadows of their own. `path` is the file of the map, beside which a
    measured BRDF is looked for. `variation` is what parameters of the BRDF follow, where some vary;
    they are in the middle by default.
    """
    if isinstance(light, InGrid):
        # Rows look at the probes that are on the side from which light reaches them.
        own = light.light(transfer.positions(mesh), transfer.bent_normals(), transfer.order)
        made = light.product if isinstance(light, ProductInGrid) else None
        follows = variation if made is not None and made.varies else None
        return VertexColors(mesh, transfer, own, made, None, follows)
    held = light.harmonic_light
    if held is None:
        raise TransferError(
            f"{transfer.facts.mesh}: transfer shades by irradiance maps and by product textures, "
            f"not by a map of the form {light.representation}; make one with shrm prefilter --to "
            "irradiance"
        )
    if held.product is None:
        lamps = _lamps(mesh, discs)
        return VertexColors(mesh, transfer, held.coefficients, lamps=lamps)
    product = held.product

    @cache
    def brdf_at(shares: tuple[float, ...]) -> Brdf:
        return common_brdf({path: product.info_at(shares)})

    if discs:
        brdf_at(tuple(product.shares({})))  # refuses one that cannot be evaluated
    lamps, follows = _lamps(mesh, discs, brdf_at), variation if product.varies else None
    return VertexColors(mesh, transfer, held.coefficients, product, lamps, follows)


def _lamps(mesh: Mesh, discs: Sequence[Disc], brdf: BrdfAt | None = None) -> LampsOnMesh | None:
    return LampsOnMesh(mesh, Rays(mesh), discs, brdf) if discs else None
