"""Surfaces that are shaded at the vertices of their mesh, by its precomputed transfer."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import TransferError
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.geometry.tangents import perpendicular
from shrm_cli.maps.base import Map
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.product.product import ProductTexture
from shrm_cli.maps.product.varying import VaryingProduct
from shrm_cli.maps.provenance import common_brdf
from shrm_cli.probe.disc import Disc, disc_coefficients
from shrm_cli.render.lamps import LampsOnMesh, Points
from shrm_cli.sphere.directions import normalize
from shrm_cli.transfer.bake import mesh_digest
from shrm_cli.transfer.shading import diffuse_colors, glossy_colors
from shrm_cli.transfer.transfer import Transfer

_MIDDLE = 0.5
"""Where in its range a parameter is that nothing tells."""


class VertexColors:
    """A mesh with its own shadows, under one light.

    Where few orders make light negative, in shadows beside lamps, it is black. Windows of the light
    help little there and cost much: those that left no more than a thousandth of a bunny's vertices
    negative under a bare sun changed the light by 10 % to 21 % RMS, and no window did for a dragon.
    What is made black is 0.1 % to 5 %.

    Parameters
    ----------
    mesh : Mesh
        The one that the transfer was baked for.
    transfer : Transfer
    lighting : array_like, shape (n, 3)
        Coefficients of the light in world axes.
    product : ProductTexture, optional
        That of a glossy surface; by default the surface is diffuse, with the transfer's albedo.
    lamps : LampsOnMesh, optional
        What the mesh reflects of lamps that `lighting` lacks. A diffuse mesh is white to them.

    Raises
    ------
    TransferError
        If the transfer was baked for another mesh, or lacks the matrices of a glossy surface.
    """

    def __init__(
        self,
        mesh: Mesh,
        transfer: Transfer,
        lighting: ArrayLike,
        product: ProductTexture | None = None,
        lamps: LampsOnMesh | None = None,
    ) -> None:
        transfer.check_mesh(mesh_digest(mesh.vertices, mesh.faces), mesh.name)
        self._mesh, self._transfer, self._product, self._lamps = mesh, transfer, product, lamps
        self._lighting = np.asarray(lighting, dtype=float)
        self._eye: Array | None = None
        self._colors: Array = np.empty((0, 3))
        if product is None:
            colors = diffuse_colors(transfer, self._lighting)
            if lamps is not None and transfer.facts.bounces:
                of_lamps = disc_coefficients(lamps.discs, transfer.order)
                colors += diffuse_colors(transfer.bounced(), of_lamps)
            self._colors = np.maximum(colors, 0)
        else:
            transfer.check_glossy()

    def radiance(
        self,
        eye: Array,
        points: Points,
        normals: Array,
        views: Array,
        samples: NDArray[np.int64] | None = None,
    ) -> Array:
        """Return the radiance of points towards a viewer, shape (n, 3).

        Parameters
        ----------
        eye : ndarray, shape (3,)
            Where the viewer is.
        points, normals, views, samples
            As `LampsOnMesh.radiance` takes them.
        """
        found = self._mesh.interpolated(self.seen_from(eye), *points)
        if self._lamps is None:
            return found
        transfer, albedo, tangents = self._transfer, self._transfer.albedo, None
        if self._product is not None and transfer.frames is not None:
            along = self._mesh.interpolated(transfer.frames[:, 0], *points)
            tangents = perpendicular(along, normals)
        lit = self._lamps.radiance(points, normals, views, tangents, samples)
        if self._product is not None:
            return found + lit
        return found + lit * (
            albedo if len(albedo) == 1 else self._mesh.interpolated(albedo, *points)
        )

    def seen_from(self, eye: Array) -> Array:
        """Return what the vertices reflect towards a point, without the lamps, shape (v, 3)."""
        if self._product is None:
            return self._colors
        if self._eye is None or not np.array_equal(eye, self._eye):
            views = normalize(eye - self._mesh.vertices)
            arguments = self._transfer, self._product, self._lighting, views
            self._colors = np.maximum(glossy_colors(*arguments), 0)
            self._eye = np.array(eye)
        return self._colors


def vertex_colors(
    mesh: Mesh, transfer: Transfer, light: Map, discs: Sequence[Disc] = (), path: str = ""
) -> VertexColors:
    """Return a mesh as a map lights it: diffuse under irradiance, glossy by a product texture.

    Parameters
    ----------
    mesh : Mesh
    transfer : Transfer
    light : Map
        An irradiance map, or a product texture with light. Of one whose parameter varies the
        middle of the range is shown, as without a transfer.
    discs : sequence of Disc
        Lamps that the map's light lacks. They cast shadows of their own.
    path : str
        The file of the map, beside which a measured BRDF is looked for.

    Raises
    ------
    TransferError
        If the map is another one, or the transfer does not fit.
    BrdfError
        If there are lamps, and the map's BRDF cannot be evaluated.
    """
    if isinstance(light, Irradiance):
        lamps = _lamps(mesh, discs)
        return VertexColors(mesh, transfer, light.coefficients, lamps=lamps)
    if isinstance(light, VaryingProduct):
        light = light.at(_MIDDLE)
    if isinstance(light, ProductTexture) and light.lighting is not None:
        brdf = common_brdf({path: light.info}) if discs else None
        return VertexColors(mesh, transfer, light.lighting, light, _lamps(mesh, discs, brdf))
    raise TransferError(
        f"{transfer.facts.mesh}: transfer shades by irradiance maps and by product textures, not "
        f"by a map of the form {light.representation}; make one with shrm prefilter --to irradiance"
    )


def _lamps(mesh: Mesh, discs: Sequence[Disc], brdf: Brdf | None = None) -> LampsOnMesh | None:
    return LampsOnMesh(mesh, Rays(mesh), discs, brdf) if discs else None
