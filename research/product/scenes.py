"""The meshes of the figures of product textures, and how pictures of them are taken.

The paper's models are not at hand. The bunny and the dragon take their place where they are, and
surfaces made here otherwise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shrm_cli.files.image import Picture, write_picture
from shrm_cli.geometry.load import load_mesh
from shrm_cli.geometry.mesh import Mesh, make_mesh
from shrm_cli.geometry.tangents import projected_tangents
from shrm_cli.maps.base import Map
from shrm_cli.probe.probe import Probe
from shrm_cli.render.camera import Aim, Lens, Viewer, aimed
from shrm_cli.render.image import expose
from shrm_cli.render.mesh import MeshSubject
from shrm_cli.render.sheet import arrange, draw_sheet
from shrm_cli.render.stage import Actor, Look, Reflector, Stage
from shrm_cli.render.variation import Variation
from shrm_cli.render.vertex_colors import VertexColors
from shrm_cli.sphere.directions import normalize

Array = NDArray[np.floating]
Direction = tuple[float, float, float]

FILES = "bunny.obj", "dragon.ply"
"""The meshes that are taken where they are in the folder."""
UPRIGHT: Direction = (0.0, 1.0, 0.0)
"""The direction that surfaces are brushed along, projected onto them, if no other is said."""
_PEAK = 99
"""The percentile of what is shown that becomes white."""


def meshes(folder: Path, rows: int) -> list[Mesh]:
    """Return the meshes that are in a folder, or else a knot of `rows` vertices around its tube."""
    found = [load_mesh(folder / name) for name in FILES if (folder / name).exists()]
    return [replace(each, name=Path(each.name).stem) for each in found] or [knot(rows)]


def knot(rows: int) -> Mesh:
    """Make a trefoil knot about +Z, which shadows itself, of `rows` vertices around its tube."""

    def place(along: Array, around: Array) -> Array:
        # The knot winds around a torus, whose outward direction is never along the knot.
        c, s = np.cos(2 * along), np.sin(2 * along)
        out = np.stack([np.cos(3 * along) * c, np.cos(3 * along) * s, np.sin(3 * along)], axis=-1)
        middle = out + 2 * np.stack([c, s, np.zeros_like(c)], axis=-1)
        ahead = np.gradient(middle, axis=0)
        ahead[[0, -1]] = middle[1] - middle[-2]  # it is closed: the last row is the first one
        ahead = normalize(ahead)
        out = normalize(out - np.sum(out * ahead, axis=-1, keepdims=True) * ahead)
        side = np.cross(ahead, out)
        return middle + 0.5 * (np.cos(around)[..., None] * out + np.sin(around)[..., None] * side)

    turn = 2 * np.pi
    return surface(
        "knot", place, np.linspace(0, turn, 10 * rows + 1), np.linspace(0, turn, rows + 1)
    )


def vase(rows: int) -> Mesh:
    """Make a vase of `5 rows` rows of vertices, whose colours are a smooth noise, 0 .. 1."""

    def place(down: Array, around: Array) -> Array:
        width = np.sin(down) * (0.75 - 0.3 * np.cos(down) - 0.25 * np.exp(-8 * (down - 0.75) ** 2))
        return np.stack([width * np.sin(around), np.cos(down), width * np.cos(around)], axis=-1)

    # Beside the poles triangles would be narrow without end, so the ends are cut off.
    down = np.linspace(np.pi - 0.02, 0.02, 5 * rows)
    mesh = surface("vase", place, down, np.linspace(0, 2 * np.pi, 10 * rows + 1))
    # Squared, because lobes change most at small exponents.
    values = noise(8 * mesh.vertices)[:, None] ** 2
    return replace(mesh, colors=np.repeat(values, 3, axis=1))


def noise(points: Array) -> Array:
    """Return a smooth noise of points in space, shape (n, 3): values from 0 to 1, shape (n,)."""
    rng = np.random.default_rng(2002)
    waves = 2 * normalize(rng.standard_normal((12, 3)))
    total = np.cos(points @ waves.T + rng.uniform(0, 2 * np.pi, 12)).sum(axis=1)
    return np.clip(0.5 + 0.14 * total, 0, 1)


def surface(name: str, place: Callable[[Array, Array], Array], rows: Array, columns: Array) -> Mesh:
    """Make a mesh of a grid of two parameters, joined where its last row or column is the first."""
    points = place(*np.meshgrid(rows, columns, indexing="ij"))
    shape = np.array(points.shape[:2])
    index = np.arange(shape.prod()).reshape(shape)
    if np.allclose(points[-1], points[0]):
        index[-1] = index[0]
    if np.allclose(points[:, -1], points[:, 0]):
        index[:, -1] = index[:, 0]
    a, b, c, d = (each.ravel() for each in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:],
                                            index[1:, :-1]))  # fmt: skip
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return make_mesh(name, points.reshape(-1, 3), faces)


@dataclass(frozen=True)
class Shot:
    """A square picture of a mesh.

    Attributes
    ----------
    mesh : Mesh
    viewer : Viewer
    size : int
        Its width and height, pixels.
    brush : tuple of 3 float
        The direction that the surface is brushed along, projected onto it.
    """

    mesh: Mesh
    viewer: Viewer
    size: int
    brush: Direction = UPRIGHT

    @property
    def lens(self) -> Lens:
        """The camera's lens."""
        return Lens(self.size, self.size)

    @cached_property
    def aim(self) -> Aim:
        """Where the camera looks."""
        return aimed(self.mesh.vertices, [self.viewer], self.lens)

    @cached_property
    def subject(self) -> MeshSubject:
        """What draws the mesh."""
        actor = Actor(self.mesh, (Look(),), self.brush)
        return MeshSubject(Stage.of([actor]), self.lens, self.aim)

    @property
    def tangents(self) -> Array:
        """The tangents of the vertices, shape (n, 3)."""
        return projected_tangents(self.mesh.normals, self.brush)

    @property
    def views(self) -> Array:
        """Directions from the vertices to the camera, shape (n, 3)."""
        return normalize(self.aim.eye(self.viewer) - self.mesh.vertices)

    @property
    def facing(self) -> NDArray[np.intp]:
        """Indices of the vertices that face the camera, though others may hide them."""
        return np.flatnonzero(np.sum(self.views * self.mesh.normals, axis=1) > 0.1)

    def picture(
        self,
        surface: Map | VertexColors,
        variation: Variation | None = None,
        surroundings: Probe | None = None,
    ) -> Picture:
        """Draw the mesh of a map that holds light, or of colours of its vertices, linear."""
        behind = None
        if surroundings is not None:
            behind = self.subject.background(surroundings, self.viewer)
        drawn = surface
        if not isinstance(surface, VertexColors):
            drawn = Reflector(surface, surface.shaded(), variation=variation)
        return self.subject.draw([drawn], self.viewer, behind)


def exposure(pictures: Sequence[Picture]) -> float:
    """Return the stops that show pictures on black well, the same for all of them."""
    shown = np.concatenate([each.max(axis=-1).ravel() for each in pictures])
    peak = np.percentile(shown[shown > 0], _PEAK) if (shown > 0).any() else 1.0
    return float(-np.log2(peak))


def write_sheet(
    path: Path, rows: Sequence[Sequence[tuple[Picture, str]]], stops: Sequence[float]
) -> str:
    """Write rows of equally many pictures and their labels, each row exposed by its stops.

    Returns the file's name.
    """
    tiles = [expose(tile, by) for row, by in zip(rows, stops, strict=True) for tile, _ in row]
    labels = [label for row in rows for _, label in row]
    tall, wide = tiles[0].shape[:2]
    layout = arrange(len(tiles), wide, len(rows[0]), tall)
    write_picture(path, draw_sheet(layout, tiles, labels))
    return path.name
