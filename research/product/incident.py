"""An incident light field: a brushed mesh in a room, each point under the light of its place.

Section 4 of Kautz, Sloan and Snyder 2002 says that light which varies over an object can be
interpolated from places around it. The room, which is made here, has a lamp below its ceiling and a
bright window, and its walls have colours.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from research.extent import Extent
from research.product.orders import relative
from research.product.scenes import Shot, exposure, write_sheet
from research.product.textures import ORDER, texture
from shrm_cli.arrays import slices
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.geometry.mesh import Mesh, SurfaceMaterial, make_mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.render.camera import Viewer
from shrm_cli.render.stage import transformation
from shrm_cli.rooms.bake import Gathering, bake
from shrm_cli.rooms.brightness import Brightness
from shrm_cli.rooms.grid import Lattice, ProbeGrid
from shrm_cli.rooms.lit import ProductInGrid
from shrm_cli.rooms.room import Room
from shrm_cli.sphere.directions import surface_frames

Array = NDArray[np.floating]

BRUSHED = "ashikhmin-shirley:nu=24,nv=8"
SIZE = 6.0, 3.0, 4.0
"""Edges of the room."""
PLACES = 1.2, 3.0, 4.8
"""Where along the room's longest edge the middle of the mesh is."""
_TALL = 1.1
"""How large the mesh is."""
_PATCH = 0.2
_AT_ONCE = 50
"""Points at a time."""
_VIEWER = Viewer(0, 10)


@dataclass(frozen=True)
class Placed:
    """Relative RMS errors at points of the mesh at one place, against sums over all directions.

    Attributes
    ----------
    place : float
    alone : float
        Under the light of the room's middle, as if all of it were far away.
    grid : float
        Under the light that is interpolated between probes.
    own : float
        Under the light of the very points, cut off at the same degree.
    grid_in_degree : float
        Of the interpolated light against that of the very points: what interpolation costs.
    """

    place: float
    alone: float
    grid: float
    own: float
    grid_in_degree: float


def incident_field(mesh: Mesh, folder: Path, extent: Extent) -> tuple[str, ProbeGrid, list[Placed]]:
    """Draw a brushed mesh at some places of a room; return the file's name and the errors, too."""
    room = _room()
    lattice = Lattice(np.zeros(3), np.array(SIZE), extent.product_probes)
    grid = bake(room, lattice, ORDER, extent.product_looks)
    looks = _Looks(Brightness(room, Rays(room.mesh), _PATCH), ORDER, 4 * extent.product_looks)
    product = texture(BRUSHED, extent.product_texels)
    lit, rng = ProductInGrid(grid, "room", product), np.random.default_rng(4)
    middle = looks.probe((np.array(SIZE) / 2)[None], 0, 1.0)
    alone = product.lit((middle.reflected + middle.direct)[0])
    rows: list[list] = [[], []]
    found = []
    for place in PLACES:
        shot = Shot(_moved(mesh, place), _VIEWER, extent.product_picture)
        rows[0].append((shot.picture(alone), f"one probe, x = {place:g}"))
        rows[1].append((shot.picture(lit), f"{lattice.count} probes, x = {place:g}"))
        chosen = rng.choice(shot.facing, min(extent.product_points, len(shot.facing)), False)
        points = shot.mesh.vertices[chosen]
        vectors = shot.mesh.normals[chosen], shot.tangents[chosen], shot.views[chosen]
        truth = looks.reflected(points, vectors)
        light = looks.probe(points, 0, 1.0)
        own = product.reflected(light.reflected + light.direct, vectors)
        by_grid = lit.placed_radiance(points, *vectors)
        found.append(Placed(
            place, relative(alone.brushed_radiance(*vectors), truth), relative(by_grid, truth),
            relative(own, truth), relative(by_grid, own),
        ))  # fmt: skip
    stops = exposure([picture for picture, _ in rows[1]])
    return write_sheet(folder / "incident-field.png", rows, [stops] * 2), grid, found


class _Looks(Gathering):
    """What surfaces reflect at points of the room, by sums over directions and points of lamps.

    They share the brightness of the room with its probes, and neither their harmonics nor the
    product texture.
    """

    def reflected(self, points: Array, vectors: tuple[Array, Array, Array]) -> Array:
        """Return the radiance of brushed surfaces, shape (n, 3)."""
        brdf = parse_spec(BRUSHED)
        frames = surface_frames(*vectors[:2])
        views = np.einsum("nij,nj->ni", frames, vectors[2])
        result = np.empty(points.shape)
        for part in slices(len(points), _AT_ONCE):
            arriving, lamps, _ = self._of(self._look(points[part]), len(points[part]))
            ways, straight = self._arriving(points[part], part.start)
            even = self._area * (arriving + lamps)
            for k, (frame, view) in enumerate(zip(frames[part], views[part], strict=True)):
                result[part.start + k] = sum(
                    np.sum(brdf.transfer(each @ frame.T, view) * light, axis=0)
                    for each, light in ((self._directions, even[k]), (ways[k], straight[k]))
                )
        return result


def _room() -> Room:
    """Make the room: a lamp below the ceiling at one end, and a window at the other."""
    x, y, z = SIZE
    dark = (0.0, 0.0, 0.0)
    walls = {
        "floor": ((0.5, 0.4, 0.3), dark, [(0, 0, 0), (0, 0, z), (x, 0, z), (x, 0, 0)]),
        "ceiling": ((0.8, 0.8, 0.8), dark, [(0, y, 0), (x, y, 0), (x, y, z), (0, y, z)]),
        "red": ((0.7, 0.1, 0.1), dark, [(0, 0, 0), (0, y, 0), (0, y, z), (0, 0, z)]),
        "green": ((0.1, 0.6, 0.15), dark, [(x, 0, 0), (x, 0, z), (x, y, z), (x, y, 0)]),
        "back": ((0.7, 0.7, 0.7), dark, [(0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)]),
        "front": ((0.6, 0.6, 0.7), dark, [(0, 0, z), (0, y, z), (x, y, z), (x, 0, z)]),
        "lamp": (dark, (8, 8, 8), [(0.5, 2.99, 1), (2.5, 2.99, 1), (2.5, 2.99, 3), (0.5, 2.99, 3)]),
        "window": (
            dark, (3, 3, 3.9), [(5.99, 0.5, 1), (5.99, 0.5, 3), (5.99, 2.5, 3), (5.99, 2.5, 1)],
        ),
    }  # fmt: skip
    materials = [
        SurfaceMaterial(name, color, emission=sent) for name, (color, sent, _) in walls.items()
    ]
    corners = np.concatenate([np.array(quad, float) for _, _, quad in walls.values()])
    first = 4 * np.arange(len(walls))[:, None]
    faces = np.concatenate([first + np.array(each) for each in ([0, 1, 2], [0, 2, 3])])
    mesh = make_mesh(
        "room", corners, faces, materials=materials, face_materials=np.tile(np.arange(8), 2)
    )
    return Room.of(mesh, (0.5, 0.5, 0.5), {})


def _moved(mesh: Mesh, place: float) -> Mesh:
    """Return the mesh at a place of the room, at half of its height."""
    scale = _TALL / float(np.subtract(*mesh.bounds[::-1]).max())
    middle = (mesh.bounds[0] + mesh.bounds[1]) / 2
    shift = np.array([place, SIZE[1] / 2, SIZE[2] / 2]) - scale * middle
    return mesh.transformed(transformation(shift, scale=scale))
