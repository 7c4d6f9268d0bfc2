"""What the maps are shown on: a sphere, a figure of our own, and a mesh of the user's."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import Mesh, make_mesh
from shrm_cli.geometry.tangents import tangents_from_uvs
from shrm_cli.render.camera import Lens, Viewer, aimed
from shrm_cli.view.blocks import Blocks

_AZIMUTHS, _ELEVATIONS = range(0, 360, 30), (-60, -30, 0, 30, 60)
"""Where a mesh is looked at from, to find how far away the camera has to stand, degrees."""
_FRAMED = 20000
"""Vertices that the camera is aimed by; of larger meshes every k-th one, and the box's corners."""


def described_shapes(
    mesh: Mesh | None, blocks: Blocks, is_brushed: bool = False
) -> list[dict[str, Any]]:
    """Describe the shapes for the page, the sphere first, and keep their triangles.

    Vertices, normals and indices are added to `blocks`. `is_brushed` tells whether a map cares for
    tangents: those along texture coordinates are added then, too.
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

    `points`, of shape (n, 3), lie about their middle, which the camera looks at.
    """
    chosen = points[:: max(len(points) // _FRAMED, 1)]
    ends = np.concatenate([points[points.argmin(axis=0)], points[points.argmax(axis=0)]])
    viewers = [Viewer(a, e) for a in _AZIMUTHS for e in _ELEVATIONS]
    framed = np.concatenate([chosen, ends])
    return aimed(framed, viewers, Lens(512, 512), target=np.zeros(3)).distance


Field = Callable[[Array], Array]

_CELLS = 56
"""Cells along the longest edge of the figure's box."""
_BOX = np.array([[-0.75, -1.1, -1.1], [0.75, 1.5, 0.9]])
"""The lowest and the highest corner of the figure's box."""
_STEPS = 4
"""Steps of Newton's method that bring vertices onto the surface."""
_NEARBY = 1e-4
"""Distance over which slopes are measured."""

# The centre and the half axes of an ellipsoid each. The figure looks along +Z and +X a little.
_ELLIPSOIDS = (
    ((0.0, -0.38, -0.18), (0.50, 0.52, 0.62)),  # body
    ((0.0, -0.05, 0.16), (0.36, 0.46, 0.38)),  # chest
    ((0.0, 0.42, 0.34), (0.30, 0.29, 0.36)),  # head
    ((0.0, -0.36, -0.82), (0.16, 0.16, 0.15)),  # tail
    ((0.34, -0.62, -0.20), (0.22, 0.30, 0.42)),  # thighs
    ((-0.34, -0.62, -0.20), (0.22, 0.30, 0.42)),
    ((0.30, -0.88, 0.22), (0.15, 0.10, 0.36)),  # feet
    ((-0.30, -0.88, 0.22), (0.15, 0.10, 0.36)),
)
# Two ends and the radii there.
_CAPSULES = (
    ((0.13, 0.58, 0.24), (0.27, 1.27, -0.04), 0.09, 0.11),  # ears
    ((-0.13, 0.58, 0.24), (-0.33, 1.20, 0.06), 0.09, 0.11),
    ((0.17, -0.2, 0.40), (0.15, -0.84, 0.48), 0.12, 0.10),  # forelegs
    ((-0.17, -0.2, 0.40), (-0.15, -0.84, 0.48), 0.12, 0.10),
)
_BLEND = 0.055
"""How far the parts flow into each other."""


@cache  # each page that is made shows the same one
def figure() -> Mesh:
    """Return the figure as a mesh with smooth normals, about 2.4 high, standing on y = -1.

    It has long ears, hollows and edges, to see a material on more than a sphere. Its surface is
    where a smooth union of ellipsoids and capsules is 0.
    """
    vertices, faces = surface_nets(_distance, _BOX, _CELLS)
    return make_mesh("figure", vertices, faces, normals=_slopes(_distance, vertices))


def _distance(points: Array) -> Array:
    """Return about the distance from the figure's surface, negative within it, shape (n,)."""
    total = np.zeros(len(points))
    for center, axes in _ELLIPSOIDS:
        scaled = (points - center) / axes
        inner, outer = np.linalg.norm(scaled, axis=1), np.linalg.norm(scaled / axes, axis=1)
        total += np.exp(-inner * (inner - 1) / np.maximum(outer, 1e-9) / _BLEND)
    for start, end, first, last in _CAPSULES:
        along = np.subtract(end, start)
        share = np.clip((points - start) @ along / (along @ along), 0, 1)
        away = np.linalg.norm(points - start - share[:, None] * along, axis=1)
        total += np.exp(-(away - first - share * (last - first)) / _BLEND)
    return np.asarray(-_BLEND * np.log(np.maximum(total, 1e-300)))


def _slopes(field: Field, points: Array) -> Array:
    """Return the gradient of a function, shape (n, 3)."""
    steps = _NEARBY * np.eye(3)
    sides = [field(points + step) - field(points - step) for step in steps]
    return np.stack(sides, axis=1) / (2 * _NEARBY)


def surface_nets(field: Field, box: Array, cells: int) -> tuple[Array, NDArray[np.int64]]:
    """Return triangles of the surface where a function is 0.

    Each cell of a grid that the surface goes through gets a vertex, which Newton's method brings
    onto the surface. Each edge of the grid that it crosses joins those of the four cells around.

    `field` takes points, shape (n, 3), to values, (n,), negative within. `box`, of shape (2, 3),
    holds the corners of the grid. The surface does not reach its sides. `cells` is the number of
    cells along the longest edge of the box.

    Returns `vertices` of shape (n, 3); and `faces` of shape (m, 3), counter-clockwise, seen from
    where the function is positive.

    References: Gibson 1998, Constrained elastic surface nets.
    """
    low, high = np.asarray(box, dtype=float)
    width = float(np.max(high - low)) / cells
    counts = np.ceil((high - low) / width).astype(int) + 1
    axes = [start + width * np.arange(count) for start, count in zip(low, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    inside = np.asarray(field(grid.reshape(-1, 3)) < 0).reshape(grid.shape[:3])
    corners = np.lib.stride_tricks.sliding_window_view(inside, (2, 2, 2))
    crossed = corners.any(axis=(3, 4, 5)) & ~corners.all(axis=(3, 4, 5))
    number = np.full(crossed.shape, -1)
    number[crossed] = np.arange(crossed.sum())
    vertices = grid[:-1, :-1, :-1][crossed] + width / 2
    for _ in range(_STEPS):
        slope = _slopes(field, vertices)
        steepness = np.maximum(np.einsum("ij,ij->i", slope, slope), 1e-12)
        move = -(field(vertices) / steepness)[:, None] * slope
        vertices = vertices + np.clip(move, -width / 2, width / 2)
    faces = []
    for axis in range(3):
        across = [(axis + 1) % 3, (axis + 2) % 3]
        here = np.moveaxis(inside, axis, 0)
        starts = np.argwhere(np.moveaxis(here[1:] != here[:-1], 0, axis))
        starts = starts[np.all(starts[:, across] > 0, axis=1)]
        around = []
        for shift in ((0, 0), (-1, 0), (-1, -1), (0, -1)):
            cell = starts.copy()
            cell[:, across] += shift
            around.append(number[tuple(cell.T)])
        quads = np.stack(around, axis=1)
        outwards = inside[tuple(starts.T)]
        quads = np.where(outwards[:, None], quads, quads[:, ::-1])
        faces += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
    return vertices, np.concatenate(faces).astype(np.int64)
