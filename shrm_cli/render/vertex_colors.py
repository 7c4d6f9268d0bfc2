"""Surfaces that are shaded at the vertices or texels of their mesh, by its transfer."""

from collections.abc import Mapping, Sequence
from copy import copy
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import TransferError
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.geometry.tangents import perpendicular
from shrm_cli.maps.base import Map
from shrm_cli.maps.info import common_brdf
from shrm_cli.maps.product.product import ProductMap
from shrm_cli.probe.disc import Disc, disc_coefficients
from shrm_cli.render.lamps import BrdfAt, LampsOnMesh, Points, blended
from shrm_cli.render.variation import Variation
from shrm_cli.sphere.directions import horizontal_tangents, normalize
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.transfer.bake import mesh_digest
from shrm_cli.transfer.shading import diffuse_colors, fitted, glossy_colors
from shrm_cli.transfer.transfer import Transfer

_SAME = 1e-5
"""How far tangents may be from those around +Y, which files hold as 32-bit floats."""


class VertexColors:
    """A mesh with its own shadows, under one light.

    Where few orders make light negative, in shadows beside lamps, it is black. Windows of the light
    help little there and cost much: those that left no more than a thousandth of a bunny's vertices
    negative under a bare sun changed the light by 10 % to 21 % RMS, and no window did for a dragon.
    What is made black is 0.1 % to 5 %.

    `mesh` is the one that the transfer was baked for. `lighting`, of shape (n, 3), holds
    coefficients of the light in world axes. `product` is that of a glossy surface; by default the
    surface is diffuse, with the transfer's albedo. `lamps` are what the mesh reflects of lamps that
    `lighting` lacks. A diffuse mesh is white to them. `variation` is what parameters of the BRDF
    follow that vary; by default they are in the middle.

    Raises TransferError if the transfer was baked for another mesh, or lacks the matrices of a
    glossy surface.
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
        if second is not None:
            count = max(len(light), len(second._lighting))
            first, other = fitted(light, count), fitted(second._lighting, count)
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

    Raises TransferError if the map is another one, or the transfer does not fit. Raises BrdfError
    if there are lamps, and the map's BRDF cannot be evaluated.
    """
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
