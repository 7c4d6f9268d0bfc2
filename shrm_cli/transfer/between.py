"""How far transfer that is known at the vertices of a mesh is off between them.

Shadows that lie within triangles are nowhere in what is interpolated between their corners: a floor
of two triangles has none of a crate that stands on it. So transfer is gathered at random points of
the mesh, too, and compared with what the vertices around them say.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.sphere.directions import horizontal_tangents, surface_frames
from shrm_cli.sphere.harmonics import degrees, order_of
from shrm_cli.sphere.quadrature import scrambled
from shrm_cli.transfer.gather import Gathering, sites_at
from shrm_cli.transfer.transfer import Transfer
from shrm_cli.vocabulary import DEFAULT_ERROR

_POINTS = 512
"""Points of the mesh. Of bunny, dragon and some boxes, these find .8 to 1.5 of what 8,192 do."""
_SAMPLES = 1024
"""The rays of each, along the same directions in its frame as those of vertices."""


def error_between(mesh: Mesh, transfer: Transfer) -> float | None:
    """Return the relative RMS error of the irradiance at random points between vertices.

    It is that of light whose coefficients fall as ``1 / (l+1)``, see `shrm_cli.transfer.gather`,
    before any bounce. Of texels it is None.
    """
    if transfer.texels is not None:
        return None
    vectors = transfer.vectors if transfer.direct is None else transfer.direct
    faces, weights = _points(mesh)
    found = mesh.interpolated(vectors[..., 0], faces, weights)
    order = order_of(vectors.shape[1])
    sites = sites_at(mesh, faces, weights)
    frames = surface_frames(sites.normals, horizontal_tangents(sites.normals))
    gathering = Gathering(sites, frames, Rays(mesh), order, _SAMPLES)
    steps = range(0, len(faces), 64)
    truth = np.concatenate([gathering.transfer(slice(at, at + 64))[0][..., 0] for at in steps])
    light = 1 / (degrees(order) + 1)
    wrong, whole = (np.linalg.norm(each * light) for each in (found - truth, truth))
    return float(wrong / whole) if whole > 0 else 0.0


def remarks(mesh: Mesh, error: float | None) -> list[str]:
    """Return a line about the error between vertices, if it is as large as shows."""
    if error is None or error <= DEFAULT_ERROR:
        return []
    return [
        f"{mesh.name}: between its vertices light is off by {error:.0%} (RMS), as its triangles "
        "are large beside its shadows; bake texels by `texture` 256, or cut the triangles"
    ]


def _points(mesh: Mesh) -> tuple[NDArray[np.int64], Array]:
    """Return triangles and barycentric weights of points that are even over the mesh's area."""
    corners = mesh.vertices[mesh.faces]
    sides = corners[:, 1:] - corners[:, :1]
    areas = np.cumsum(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1))
    along, first, second = (
        (np.roll(scrambled(_POINTS), shift) + 0.5) / _POINTS for shift in (0, 17, 61)
    )
    faces = np.searchsorted(areas, along * areas[-1]).clip(max=len(areas) - 1)
    root = np.sqrt(first)
    return faces, np.stack([1 - root, root * (1 - second), root * second], axis=1)
