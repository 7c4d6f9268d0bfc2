"""What the maps are shown on: a sphere, a figure of our own, and a mesh of the user's."""

from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.tangents import tangents_from_uvs
from shrm_cli.render.camera import Viewer
from shrm_cli.render.perspective import Lens, aimed
from shrm_cli.view.blocks import Blocks
from shrm_cli.view.figure import figure

_AZIMUTHS, _ELEVATIONS = range(0, 360, 30), (-60, -30, 0, 30, 60)
"""Where a mesh is looked at from, to find how far away the camera has to stand, degrees."""
_FRAMED = 20000
"""Vertices that the camera is aimed by; of larger meshes every k-th one, and the box's corners."""


def described_shapes(
    mesh: Mesh | None, blocks: Blocks, is_brushed: bool = False
) -> list[dict[str, Any]]:
    """Describe the shapes for the page, and keep their triangles.

    Parameters
    ----------
    mesh : Mesh, optional
        The user's, in world axes.
    blocks : Blocks
        Vertices, normals and indices are added to these.
    is_brushed : bool
        Whether a map cares for tangents: those along texture coordinates are added then, too.

    Returns
    -------
    list of dict
        The sphere first, which has no triangles.

    Raises
    ------
    MeshError
        If the mesh has no extent.
    """
    shapes = [{"name": "Sphere", "file": ""}, _described(figure(), "Figure", "", blocks)]
    if mesh is not None:
        file = Path(mesh.name).name
        shapes.append(_described(mesh, file, file, blocks))
        if is_brushed and mesh.uvs is not None:
            tangents = tangents_from_uvs(mesh)[np.unique(mesh.faces)]
            shapes[-1]["tangents"] = blocks.add(_as_shorts(tangents))
    return shapes


def _described(mesh: Mesh, name: str, file: str, blocks: Blocks) -> dict[str, Any]:
    """Describe a mesh that is moved and scaled into a ball of radius 1 about the origin."""
    used = np.unique(mesh.faces)
    vertices = mesh.vertices[used]
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    radius = float(np.max(np.linalg.norm(vertices - middle, axis=1)))
    if not radius > 0:
        raise MeshError(f"{mesh.name}: it has no extent; export it again")
    points = (vertices - middle) / radius
    place = np.zeros(len(mesh.vertices), dtype=np.int64)
    place[used] = np.arange(len(used))
    wide = len(used) > 2**16
    return {
        "name": name,
        "file": file,
        "middle": middle.tolist(),
        "triangles": len(mesh.faces),
        "wide": wide,
        "distance": distance_of(points),
        "radius": radius,
        "positions": blocks.add(points.astype(np.float32)),
        "normals": blocks.add(_as_shorts(mesh.normals[used])),
        "indices": blocks.add(place[mesh.faces].astype(np.uint32 if wide else np.uint16)),
    }


def _as_shorts(directions: Array) -> Array:
    """Return unit vectors, shape (n, 3), as integers of 16 bits, four each to be aligned."""
    return np.pad(np.rint(directions * 32767).astype(np.int16), ((0, 0), (0, 1)))


def distance_of(points: Array) -> float:
    """Return how far from the middle a camera of `Lens` stands that sees all points.

    It sees them from all azimuths, and from elevations up to 60 degrees.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        About their middle, which the camera looks at.
    """
    chosen = points[:: max(len(points) // _FRAMED, 1)]
    ends = np.concatenate([points[points.argmin(axis=0)], points[points.argmax(axis=0)]])
    viewers = [Viewer(a, e) for a in _AZIMUTHS for e in _ELEVATIONS]
    framed = np.concatenate([chosen, ends])
    return aimed(framed, viewers, Lens(512, 512), target=np.zeros(3)).distance
