"""Where the transfer of a mesh is known: at its vertices, or at the texels of a texture over it."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.geometry.mesh import Mesh, smooth_points
from shrm_cli.geometry.texels import Texels, charted
from shrm_cli.records import record
from shrm_cli.sphere.directions import normalize

Places = Callable[[NDArray[np.integer], Array], tuple[NDArray[np.integer], Array]]
"""From triangles (n,) and barycentric weights (n, 3) to rows and their shares, both (n, k)."""

OFFSET = 1e-5
"""How far above its site a ray begins, as a part of the diagonal of the mesh's box.

It is some hundred times the rounding of the 32-bit coordinates that rays are traced with.
"""

INSET = 0.01
"""How far a ray begins from a vertex on a border, as a part of the way into its triangles.

Where walls meet, each with vertices of its own, rays from the very edge would slip between them.
"""


@record(eq=False)
class Sites:
    """Points of a mesh."""

    mesh: Mesh
    positions: Array
    normals: Array
    """`positions` and `normals`: world axes; the normals are unit vectors, shape (v, 3)."""
    origins: Array
    """Where rays of them begin, shape (v, 3)."""
    places: Places
    """Of which rows what is known at a point of the mesh is a mean."""
    of_vertices: Callable[[Array], Array]
    """What is known at vertices, shape (n, c), as it is at the sites, shape (v, c)."""
    texels: Texels | None = None


def sites_of(mesh: Mesh, texture: int | None = None) -> Sites:
    """Return the vertices of a mesh, or the texels of a texture over it.

    `texture` is the number of texels along the texture's edge, as `charted` takes them.

    Raises MeshError if there are no charts for a texture.
    """
    lift = OFFSET * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    if texture is None:
        inset = INSET * _ways_inwards(mesh.vertices, mesh.normals, mesh.faces)
        origins = mesh.vertices + lift * mesh.normals + inset
        return Sites(
            mesh, mesh.vertices, mesh.normals, origins,
            lambda faces, weights: (mesh.faces[faces], weights), lambda values: values,
        )  # fmt: skip
    found = charted(mesh, texture)
    points = found.faces, found.weights
    own = mesh.interpolated(mesh.normals, *points)
    # Normals may cancel between the two sides of a sheet; that of a corner is a direction always.
    first = mesh.normals[mesh.faces[found.faces, found.weights.argmax(axis=1)]]
    normals = normalize(np.where(np.einsum("vi,vi->v", own, own)[:, None] > 1e-12, own, first))
    positions = mesh.interpolated(mesh.vertices, *points)
    texels = Texels(found.rows, found.texcoords, positions)
    return Sites(
        mesh, positions, normals, smooth_points(mesh, *points, normals) + lift * normals,
        texels.places, lambda values: mesh.interpolated(values, *points), texels,
    )  # fmt: skip


def _ways_inwards(vertices: Array, normals: Array, faces: NDArray[np.integer]) -> Array:
    """Ways from vertices on a border to the middle of their triangles, 0 for all others; (v, 3).

    A border is an edge of one triangle only. The ways do not lead below the tangent plane, where
    a surface that is convex is closed.
    """
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, counts = np.unique(edges, axis=0, return_counts=True)
    ways, triangles = np.zeros_like(vertices), np.zeros((len(vertices), 1))
    for corner in faces.T:
        np.add.at(ways, corner, vertices[faces].mean(axis=1) - vertices[corner])
        np.add.at(triangles, corner, 1)
    ways /= np.maximum(triangles, 1)
    ways -= np.minimum(np.einsum("vi,vi->v", ways, normals), 0)[:, None] * normals
    on_border = np.zeros(len(vertices), bool)
    on_border[unique[counts == 1]] = True
    return np.where(on_border[:, None], ways, 0)
