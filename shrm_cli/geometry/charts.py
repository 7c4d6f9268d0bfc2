"""Charts: where each triangle of a mesh lies in a texture, so that no two lie on one another.

The mesh's own texture coordinates serve where they do that. Otherwise xatlas makes some, a package
that belongs to the extra `charts` and is used by this module alone.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.extras import install
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.texels import Sampled, chart_numbers, sampled

_PADDING = 3
"""Texels between charts; look-ups at the border of each need one of its own."""
_FILLED = 0.95
"""The part of the texture's edge at which packing is tried no more."""
_MOST_TRIALS = 6
"""The most times that charts are packed to find the scale at which they fit."""


def charted(mesh: Mesh, size: int) -> Sampled:
    """Find the texels of a texture over a mesh, and the points that they stand for.

    `size` is the number of texels along the edge: of a square texture for the mesh's own
    coordinates, and the most for charts that are made.

    Raises MeshError if xatlas is needed and not installed, or the charts do not fit.
    """
    if mesh.uvs is not None and mesh.uvs.min() >= 0 and mesh.uvs.max() <= 1:
        own = mesh.uvs[mesh.faces]
        found = sampled(own, chart_numbers(mesh, own), (size, size))
        if found.is_apart and found.is_flat:
            return found
    texcoords, shape = _unwrapped(mesh, size)
    found = sampled(texcoords, chart_numbers(mesh, texcoords), shape)
    if not found.is_apart:
        raise MeshError(
            f"{mesh.name}: its charts do not fit into {size} texels; give `texture` more"
        )
    return found


def _unwrapped(mesh: Mesh, size: int) -> tuple[Array, tuple[int, int]]:
    """Let xatlas cut the mesh into charts and pack them into a texture of the most texels."""
    try:
        import xatlas
    except ImportError as error:
        raise MeshError(
            f"{mesh.name}: its texture coordinates overlap, or it has none; charts need the "
            f"package xatlas; {install('charts')}"
        ) from error
    # Lengths are told in diagonals, so that its 32-bit numbers and limits suit meshes of any unit.
    low, high = mesh.bounds
    points = ((mesh.vertices - low) / np.linalg.norm(high - low)).astype(np.float32)
    # Triangles with the same corners share their place, as they share all that is known of it.
    turn = np.argsort(mesh.faces, axis=1)
    in_order = np.take_along_axis(mesh.faces, turn, axis=1)
    _, first, same = np.unique(in_order, axis=0, return_index=True, return_inverse=True)
    packing = xatlas.PackOptions()
    packing.padding, packing.bilinear, packing.create_image = _PADDING, True, False
    texels, best = float(size), None
    for _ in range(_MOST_TRIALS):
        atlas = xatlas.Atlas()
        atlas.add_mesh(points, mesh.faces[first].astype(np.uint32), mesh.normals.astype(np.float32))
        packing.texels_per_unit = texels
        atlas.generate(xatlas.ChartOptions(), packing)
        edge = max(atlas.width, atlas.height)
        if edge <= size and (best is None or texels > best[0]):
            best = texels, atlas
        if _FILLED * size <= edge <= size:
            break
        texels *= 0.98 * size / edge
    if best is None:
        raise MeshError(
            f"{mesh.name}: its charts do not fit into {size} texels; give `texture` more"
        )
    _, faces, texcoords = best[1][0]
    found = np.take_along_axis(texcoords[faces].astype(float), turn[first][..., None], axis=1)
    found = found[same.reshape(-1)]
    found = np.take_along_axis(found, np.argsort(turn, axis=1)[..., None], axis=1)
    return found, (best[1].height, best[1].width)
