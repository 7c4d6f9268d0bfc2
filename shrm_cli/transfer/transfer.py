"""The transfer of a mesh: what vertices or texels must know to shadow and light themselves."""

from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.errors import TransferError
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.texels import Texels
from shrm_cli.records import record
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.harmonics import order_of


@record
class Facts:
    """How a transfer was made."""

    mesh: str
    """The name of the mesh, for messages."""
    mesh_sha256: str
    """The digest of its vertices and triangles, by `bake.mesh_digest`."""
    bounces: int
    """How often light is reflected within the mesh."""
    samples: int
    """Rays of each vertex and bounce."""
    brdf: str = ""
    """What the mesh reflects in bounces, as `brdf.spec.parse_spec` reads it; empty where that is
    the albedo."""


@record(eq=False)
class Transfer:
    """Precomputed radiance transfer of a mesh, for light of any coefficients.

    Raises ValueError if the shapes do not fit each other.
    """

    vectors: Array
    """Transfer vectors: the irradiance of a vertex, without 1/pi and without its albedo, is ``sum_j
    vectors[:, j] * L_j`` for light of the coefficients L_j in world axes, index l(l+1)+m, float32
    of shape (v, n, 1 or 3). Three channels where coloured surfaces light each other."""
    albedo: Array
    """What the surface reflects of its irradiance, shape (1 or v, 1 or 3)."""
    facts: Facts
    matrices: Array | None = None
    """Transfer matrices: ``sum_j matrices[:, i, j] * L_j`` are the coefficients of the radiance
    that arrives at a vertex, in its frame, float32 of shape (v, n, n, 1 or 3)."""
    frames: Array | None = None
    """The frames of the matrices, shape (v, 3, 3). The rows are the axes x', y', z' in world axes;
    z' is the normal."""
    direct: Array | None = None
    """The transfer vectors before any bounce, where light is reflected within the mesh, float32 of
    shape (v, n, 1)."""
    texels: Texels | None = None
    """The texture whose texels the rows of all arrays are. By default they are vertices."""

    def __post_init__(self) -> None:
        count, size, channels = self.vectors.shape
        glossy = (count, size, size, channels), (count, 3, 3)
        found = tuple(None if x is None else x.shape for x in (self.matrices, self.frames))
        if (self.order + 1) ** 2 != size or channels not in (1, 3):
            raise ValueError(f"transfer vectors of shape {self.vectors.shape}")
        if found not in ((None, None), glossy):
            raise ValueError(f"matrices and frames of shapes {found} beside {self.vectors.shape}")
        if self.direct is not None and self.direct.shape != (count, size, 1):
            raise ValueError(f"direct vectors of shape {self.direct.shape}")
        rows, colors = self.albedo.shape
        if rows not in (1, count) or colors not in (1, 3):
            raise ValueError(f"albedo of shape {self.albedo.shape}")
        texels = self.texels
        if texels and not len(texels.positions) == count > texels.rows.max(initial=-1):
            raise ValueError("its texture is of other rows")

    @property
    def order(self) -> int:
        """The largest degree of the harmonics."""
        return order_of(self.vectors.shape[1])

    def at(self, mesh: Mesh, values: Array, faces: NDArray[np.integer], weights: Array) -> Array:
        """Return values of all rows at points of the mesh, shape (k, channels).

        `mesh` is the one that the transfer was baked for. `values` are of shape (v, channels).
        `faces` are of shape (k,). `weights`, of shape (k, 3), are barycentric.
        """
        if self.texels is None:
            return mesh.interpolated(values, faces, weights)
        rows, shares = self.texels.places(faces, weights)
        return np.einsum("kc,kcv->kv", shares, values[rows])

    def positions(self, mesh: Mesh) -> Array:
        """Return where the vertices or the texels are, shape (v, 3)."""
        return mesh.vertices if self.texels is None else self.texels.positions

    def bent_normals(self) -> Array:
        """Return the mean directions that light comes from, unit, shape (v, 3).

        Those of rows that hardly any light reaches, and of transfers of order 0, are arbitrary.
        """
        found = np.zeros((len(self.vectors), 3)) + np.array([0, 1e-9, 0])
        if self.order > 0:  # Y_11, Y_1-1 and Y_10 are proportional to x, y and z
            found += self.vectors[:, [3, 1, 2]].mean(axis=-1)
        return normalize(found)

    def shades_lamps(self, glossy: bool) -> bool:
        """Return whether lamps may be shaded apart: what the mesh sends of their light is known.

        Matrices, by which glossy surfaces are shaded, hold direct and reflected light together.
        """
        return not self.facts.bounces or (self.direct is not None and not glossy)

    def bounced(self) -> "Transfer":
        """Return the transfer of that light alone which the mesh itself sent."""
        if self.direct is None:
            raise TransferError(
                f"{self.facts.mesh}: its transfer does not tell light that was reflected within "
                "the mesh from other light; bake it again with shrm transfer"
            )
        return replace(self, vectors=self.vectors - self.direct, direct=None)

    def check_mesh(self, digest: str, mesh: Mesh) -> None:
        """Check that a mesh is the one that the transfer was baked for."""
        fits = self.texels is None or len(self.texels.texcoords) == len(mesh.faces)
        if digest != self.facts.mesh_sha256 or not fits:
            raise TransferError(
                f"{mesh.name}: not the mesh that the transfer was baked for, which was "
                f"{self.facts.mesh}; bake it again with shrm transfer"
            )

    def check_glossy(self) -> None:
        """Check that there are matrices."""
        if self.matrices is None:
            raise TransferError(
                f"{self.facts.mesh}: its transfer has no matrices, which glossy surfaces need; "
                "bake it with shrm transfer --matrices"
            )

    def summary(self) -> dict[str, Any]:
        """Return what users and scripts are told of the transfer."""
        vertices, size, channels = self.vectors.shape
        return {
            "vertices" if self.texels is None else "texels": vertices,
            "order": self.order,
            "coefficients": size,
            "channels": channels,
            "matrices": self.matrices is not None,
            "albedo": np.round(np.mean(self.albedo, axis=0), 4).tolist(),
            **vars(self.facts),
        }


# ---- the colours of vertices under any light, with their shadows and reflections -----------------


_VERTICES_AT_ONCE = 2**13
"""Vertices whose products are in memory at a time."""


class Product(Protocol):
    """What is asked of `maps.product.product.ProductTexture`."""

    def values(self, local_views: Array) -> Array:
        """Coefficients c_i(v) of views in the surface's frame, shape (..., n, 3)."""


def cut_or_padded(lighting: ArrayLike, count: int) -> Array:
    """Return coefficients, shape (..., m, 3), to another order, cut off or followed by 0."""
    lighting = np.asarray(lighting, dtype=float)
    result = np.zeros((*lighting.shape[:-2], count, 3))
    result[..., : lighting.shape[-2], :] = lighting[..., :count, :]
    return result


def diffuse_colors(transfer: Transfer, lighting: ArrayLike) -> Array:
    """Return the radiance of a diffuse surface, ``albedo / pi`` times its irradiance, shape (v, 3).

    `lighting`, of shape (m, 3), or (v, m, 3) where each vertex has its own light, holds
    coefficients of the light in world axes, of any order, index l(l+1)+m.
    """
    vectors = transfer.vectors
    light = cut_or_padded(lighting, vectors.shape[1])
    if light.ndim == 3:
        irradiance = np.sum(vectors * light, axis=1)
    elif vectors.shape[2] == 1:
        irradiance = vectors[..., 0] @ light
    else:
        irradiance = np.einsum("vjc,jc->vc", vectors, light)
    return irradiance * transfer.albedo / np.pi


def _arriving_light(matrices: Array, lighting: ArrayLike) -> Array:
    """Return coefficients of the radiance that arrives at vertices, in their frames: (k, n, 3).

    The transfer matrices of these vertices have the shape (k, n, n, 1 or 3).
    """
    count, size, _, channels = matrices.shape
    light = cut_or_padded(lighting, size).astype(matrices.dtype)
    if light.ndim == 3:
        return np.einsum(
            "vijc,vjc->vic", np.broadcast_to(matrices, (*matrices.shape[:3], 3)), light
        )
    if channels == 1:
        # One product with a tall matrix is faster than one for each vertex.
        return (matrices.reshape(-1, size) @ light).reshape(count, size, 3)
    return np.einsum("vijc,jc->vic", matrices, light)


def glossy_colors(
    transfer: Transfer, product: Product, lighting: ArrayLike, views: ArrayLike
) -> Array:
    """Return the radiance of a glossy surface towards a viewer.

    `lighting` is as `diffuse_colors` takes it. `views`, of shape (3,) or (v, 3),
    are unit vectors to the viewer in world axes.

    Returns an array of shape (v, 3): 0 where a vertex faces away.
    """
    transfer.check_glossy()
    assert transfer.matrices is not None
    assert transfer.frames is not None
    count = len(transfer.vectors)
    views = np.broadcast_to(np.asarray(views, dtype=float), (count, 3))
    light, result = np.asarray(lighting, dtype=float), np.zeros((count, 3))
    for part in slices(count, _VERTICES_AT_ONCE):
        own = light[part] if light.ndim == 3 else light
        arriving = _arriving_light(transfer.matrices[part], own)
        local = np.einsum("vij,vj->vi", transfer.frames[part], views[part])
        facing = local[:, 2] > 0
        values = product.values(local[facing])
        terms = min(values.shape[1], arriving.shape[1])
        result[part][facing] = np.einsum("vic,vic->vc", values[:, :terms], arriving[facing, :terms])
    return result
