"""The transfer of a mesh: what vertices or texels must know to shadow and light themselves."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import TransferError
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.texels import Texels
from shrm_cli.records import record
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
        """Check that a mesh is the one that the transfer was baked for.

        `digest` is `bake.mesh_digest` of the mesh.
        """
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
            **vars(self.facts),
        }
