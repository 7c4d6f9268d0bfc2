"""Pictures of meshes, as a perspective camera sees them through maps.

A pixel whose centre and corners see the same smooth piece of a surface is shaded once. All other
pixels, at silhouettes, creases and where a surface curves away, get 4 x 4 samples, of which those
that miss the mesh show the background.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.files.image import Picture
from shrm_cli.geometry.mesh import face_normals
from shrm_cli.geometry.paint import Points
from shrm_cli.geometry.rays import Rays
from shrm_cli.geometry.tangents import perpendicular
from shrm_cli.geometry.textures import FINER
from shrm_cli.progress import Progress, tell
from shrm_cli.records import record
from shrm_cli.render.camera import Aim, Lens, Viewer
from shrm_cli.render.sphere import Surroundings
from shrm_cli.render.stage import Reflector, Stage
from shrm_cli.render.vertex_colors import VertexColors

Reflectors = list[Reflector | VertexColors | None]
"""One for each look of a stage; None for those that no triangle has."""

_PIXELS_AT_ONCE = 2**16
"""The most pixels that are drawn at a time."""
_SAMPLES_AT_ONCE = 2**16
"""The most samples that are shaded at a time; large maps take 10 kB for each."""
_SAMPLES = 4
"""Samples along the edge of a pixel that needs more than one."""
_SMOOTH = np.cos(np.radians(5.0))
"""Cosine of the angle between normals up to which one sample will do for a pixel."""
_STEP = 2.0
"""Distance between a pixel's corners and the plane at its centre that makes an edge, pixels."""
_MOST_LAYERS = 64
"""The most triangles that are looked through."""
_GAP = 1e-5
"""Where rays go on behind a triangle, in diagonals of the mesh."""
_LEAST_SLOPE = 1e-3
"""The least cosine to a triangle by which neighbouring pixels are searched in its plane."""
MIN_COSINE = 0.01
"""The least N.V that surfaces are shaded with."""


@record(eq=False)
class _Hits:
    """What rays meet; arrays of one entry a ray, and of -1 in `faces` for no triangle.

    Where several rays belong to a pixel, `samples` numbers them.
    """

    faces: NDArray[np.int64]
    weights: Array
    distance: Array
    directions: Array
    width: float = 1.0
    """How much of a pixel each ray stands for, along an edge."""
    samples: NDArray[np.int64] | None = None


class MeshSubject:
    """Draws a stage from anywhere around it."""

    def __init__(self, stage: Stage, lens: Lens, aim: Aim, is_boxed: bool = True) -> None:
        self._is_boxed = is_boxed
        self.stage, self.lens, self.aim = stage, lens, aim
        self._rays = Rays(stage.mesh)
        self._flat = face_normals(stage.mesh.vertices, stage.mesh.faces)
        self._gap = _GAP * float(np.linalg.norm(np.subtract(*stage.mesh.bounds)))

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of a picture, pixels."""
        return self.lens.height, self.lens.width

    def background(self, surroundings: Surroundings, viewer: Viewer) -> Picture:
        """Draw what is behind the mesh, shape (H, W, 3), linear."""
        picture = np.empty((*self.shape, 3), dtype=np.float32)
        for block in self._row_blocks():
            x, y = self._points(block.start, block.stop)
            directions = self.lens.directions(viewer, x, y)
            picture[block] = surroundings.radiance(directions)
        return picture

    def covers(self, viewer: Viewer) -> NDArray[np.bool_]:
        """Return which pixels show nothing but the mesh, as far as their corners tell."""
        blocks = []
        for rows in self._row_blocks():
            x, y = self._points(rows.start, rows.stop, corners=True)
            met = (self._cast(viewer, x.ravel(), y.ravel()).faces >= 0).reshape(x.shape)
            blocks.append(met[:-1, :-1] & met[:-1, 1:] & met[1:, :-1] & met[1:, 1:])
        return np.concatenate(blocks)

    def draw(
        self,
        reflectors: Reflectors,
        viewer: Viewer,
        background: Picture | None = None,
        progress: Progress | None = None,
    ) -> Picture:
        """Draw the stage.

        `reflectors` are one for each of the stage's looks. `background`, of shape (H, W, 3), is the
        linear picture behind the mesh; black by default.

        Returns an array of float32 of shape (H, W, 3): scene-linear. The small negative values of a
        truncated expansion are kept.
        """
        picture = np.zeros((*self.shape, 3), dtype=np.float32)
        if background is not None:
            picture[:] = background
        for block in self._row_blocks():
            rows = picture[block].reshape(-1, 3)  # a view, so that the picture itself changes
            x, y = (each.ravel() for each in self._points(block.start, block.stop))
            hits = self._cast(viewer, x, y)
            edges = self._edges(viewer, hits, block.start, block.stop)
            inside = np.flatnonzero(~edges & (hits.faces >= 0))
            rows[inside] = self._shaded(reflectors, viewer, _picked(hits, inside))
            edge = np.flatnonzero(edges)
            rows[edge] = self._sampled(reflectors, viewer, x[edge], y[edge], rows[edge])
            tell(progress, block.stop, self.lens.height)
        return picture

    def _row_blocks(self) -> Iterator[slice]:
        return slices(self.lens.height, _PIXELS_AT_ONCE // self.lens.width)

    def _points(self, start: int, stop: int, corners: bool = False) -> tuple[Array, Array]:
        """Return offsets from the picture's centre to pixels of some rows, or to their corners."""
        more = int(corners)
        right = np.arange(self.lens.width + more) + 0.5 * (1 - more) - self.lens.width / 2
        up = self.lens.height / 2 - 0.5 * (1 - more) - np.arange(start, stop + more)
        x, y = np.broadcast_arrays(right[None, :], up[:, None])
        return x, y

    # ---- what is seen ------------------------------------------------------------------------

    def _cast(self, viewer: Viewer, x: Array, y: Array, width: float = 1.0) -> _Hits:
        """Return what is seen first, through what materials cut out of triangles."""
        eye, directions = self.aim.eye(viewer), self.lens.directions(viewer, x, y)
        hits = _Hits(*self._rays.first_hits(eye, directions), directions, width)
        for _ in range(_MOST_LAYERS):
            hidden = self._cut_out(viewer, hits)
            if len(hidden) == 0:
                break
            past = (hits.distance[hidden] + self._gap)[:, None] * directions[hidden]
            found = self._rays.first_hits(eye + past, directions[hidden])
            hits.faces[hidden], hits.weights[hidden] = found[0], found[1]
            hits.distance[hidden] += self._gap + found[2]
        return hits

    def _cut_out(self, viewer: Viewer, hits: _Hits) -> NDArray[np.int64]:
        """Return the hits of what is not opaque enough to be seen."""
        looks = np.where(hits.faces >= 0, self.stage.face_looks[hits.faces], -1)
        found = [np.empty(0, dtype=np.int64)]
        for index, look in enumerate(self.stage.looks):
            if look.paint is not None and look.paint.material.cutoff is not None:
                own = np.flatnonzero(looks == index)
                seen = look.paint.visible(self._points_at(viewer, _picked(hits, own)))
                found.append(own[~seen])
        return np.concatenate(found)

    def _points_at(self, viewer: Viewer, hits: _Hits) -> Points:
        """Return hits with their distances to those of the next pixels, by ray differentials.

        After Igehy 1999, "Tracing ray differentials": a ray that goes a little beside another one
        meets the plane of its triangle a little beside it.
        """
        right, up, towards = viewer.axes()
        depth = -(hits.directions @ towards)
        along = hits.directions / depth[:, None]  # its ends are a plane, as pixels are
        beside = self.lens.pixel * hits.width * np.array([right, up]).T
        flat = self._flat[hits.faces]
        slope = np.einsum("ij,ij->i", flat, along)
        slope = np.where(slope < 0, -1, 1) * np.maximum(np.abs(slope), _LEAST_SLOPE)
        moved = beside - along[:, :, None] * (flat @ beside / slope[:, None])[:, None, :]
        steps = (hits.distance * depth)[:, None, None] * moved
        finer = FINER if hits.width == 1 else 1  # many parts of a pixel are averaged anyway
        return Points(self.stage.mesh, hits.faces, hits.weights, steps, finer)

    def _edges(self, viewer: Viewer, hits: _Hits, start: int, stop: int) -> NDArray[np.bool_]:
        """Return which pixels, whose centres meet `hits`, need more than one sample."""
        x, y = self._points(start, stop, corners=True)
        corners = self._cast(viewer, x.ravel(), y.ravel())
        known = corners.faces >= 0
        looks = np.where(known, self.stage.face_looks[corners.faces], -1)
        normals = np.zeros((len(known), 3))
        normals[known] = self._smooth(_picked(corners, known))
        places = np.where(known, corners.distance, 0)[:, None] * corners.directions
        here = hits.faces >= 0
        own_look = np.where(here, self.stage.face_looks[hits.faces], -1)
        own_normal = np.zeros((len(here), 3))
        own_normal[here] = self._smooth(_picked(hits, here))
        distance = np.where(here, hits.distance, 0)
        own_place = distance[:, None] * hits.directions
        plane = np.where(here[:, None], self._flat[hits.faces], 0)
        edges = np.zeros(len(here), dtype=bool)
        grid = np.arange(len(known)).reshape(x.shape)
        for corner in (grid[:-1, :-1], grid[:-1, 1:], grid[1:, :-1], grid[1:, 1:]):
            at = corner.ravel()
            edges |= looks[at] != own_look
            edges |= here & (np.einsum("ij,ij->i", normals[at], own_normal) < _SMOOTH)
            height = np.abs(np.einsum("ij,ij->i", places[at] - own_place, plane))
            edges |= height > _STEP * self.lens.pixel * distance
        return edges

    # ---- how it looks ------------------------------------------------------------------------

    def _sampled(
        self, reflectors: Reflectors, viewer: Viewer, x: Array, y: Array, behind: Picture
    ) -> Array:
        """Return the means over 4 x 4 samples of pixels at (x, y), shape (n, 3)."""
        offsets = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
        down, right = (each.ravel() for each in np.meshgrid(offsets, offsets, indexing="ij"))
        means = np.empty((len(x), 3))
        for part in slices(len(x), _SAMPLES_AT_ONCE // len(right)):
            sub_x = (x[part, None] + right).ravel()
            hits = self._cast(viewer, sub_x, (y[part, None] + down).ravel(), 1 / _SAMPLES)
            hits = replace(hits, samples=np.arange(len(sub_x)) % len(right))
            values = np.repeat(behind[part].astype(float), len(right), axis=0)
            met = hits.faces >= 0
            values[met] = self._shaded(reflectors, viewer, _picked(hits, met))
            means[part] = values.reshape(-1, len(right), 3).mean(axis=1)
        return means

    def _shaded(self, reflectors: Reflectors, viewer: Viewer, hits: _Hits) -> Array:
        """Return the radiance of points that rays meet, shape (n, 3)."""
        result = np.empty((len(hits.faces), 3))
        views = -hits.directions
        looks = self.stage.face_looks[hits.faces]
        normals = self._bent(viewer, hits, looks)
        normals = facing(normals, self._flat[hits.faces], views)
        tangents = None
        if self.stage.tangents is not None:
            along = self.stage.mesh.interpolated(self.stage.tangents, hits.faces, hits.weights)
            tangents = perpendicular(along, normals)
        for index, reflector in enumerate(reflectors):
            own = np.flatnonzero(looks == index)
            for some in slices(len(own), _SAMPLES_AT_ONCE):
                part = own[some]
                if isinstance(reflector, VertexColors):
                    place = hits.faces[part], hits.weights[part]
                    samples = None if hits.samples is None else hits.samples[part]
                    result[part] = reflector.radiance(
                        self.aim.eye(viewer), place, normals[part], views[part], samples
                    )
                elif reflector is not None:
                    brushed = None if tangents is None else tangents[part]
                    shares = painted = None
                    if reflector.variation is not None:
                        varies = reflector.map.varies
                        picked = hits.faces[part], hits.weights[part]
                        shares = reflector.variation.shares(self.stage.mesh, *picked, varies)
                    if reflector.paint is not None:
                        seen = self._points_at(viewer, _picked(hits, part))
                        painted = reflector.paint.at(seen)
                    places = None
                    if self._is_boxed:
                        ways = hits.distance[part, None] * hits.directions[part]
                        places = self.aim.eye(viewer) + ways
                    given = normals[part], views[part], brushed, shares, painted, places
                    result[part] = reflector.radiance(*given)
        return result

    def _bent(self, viewer: Viewer, hits: _Hits, looks: NDArray[np.int64]) -> Array:
        """Return the smooth normals at hits as normal maps turn them, shape (n, 3)."""
        normals = self._smooth(hits)
        for index, look in enumerate(self.stage.looks):
            if look.paint is None or look.paint.normal_set < 0:
                continue
            own = np.flatnonzero(looks == index)
            tangents = self.stage.uv_tangents[look.paint.normal_set]
            assert tangents is not None
            along = tangents.at(hits.faces[own], hits.weights[own])
            points = self._points_at(viewer, _picked(hits, own))
            normals[own] = look.paint.bent(points, normals[own], along)
        return normals

    def _smooth(self, hits: _Hits) -> Array:
        """Return the interpolated normals at hits, shape (n, 3); the triangle's if they cancel."""
        mesh = self.stage.mesh
        normals = mesh.interpolated(mesh.normals, hits.faces, hits.weights)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.where(length > 1e-6, normals / np.maximum(length, 1e-6), self._flat[hits.faces])


def facing(normals: Array, flat: Array, views: Array) -> Array:
    """Return shading normals that face the viewer, shape (n, 3).

    Surfaces have two sides that look alike: where the viewer sees the back of a triangle, the
    normal is turned round. Which side is its front, the smooth normal decides. A smooth normal may
    still face away near a silhouette, where no BRDF has a value. It is then bent towards the
    viewer, in the plane of both, until N.V = `MIN_COSINE`.

    `normals` and `flat`, each of shape (n, 3), are unit normals, interpolated and of the triangles
    themselves.
    """
    front = np.einsum("ij,ij->i", flat, views) * np.einsum("ij,ij->i", flat, normals)
    turned = np.where((front < 0)[:, None], -normals, normals)
    cosine = np.einsum("ij,ij->i", turned, views)
    away = cosine < MIN_COSINE
    if not away.any():
        return turned
    bent = turned[away] - cosine[away, None] * views[away]
    # Where the normal is -V itself, any direction across the view will do.
    across = perpendicular(bent, views[away])
    turned[away] = MIN_COSINE * views[away] + np.sqrt(1 - MIN_COSINE**2) * across
    return turned


def _picked(hits: _Hits, chosen: NDArray[np.integer] | NDArray[np.bool_]) -> _Hits:
    return _Hits(
        hits.faces[chosen], hits.weights[chosen], hits.distance[chosen], hits.directions[chosen],
        hits.width, None if hits.samples is None else hits.samples[chosen],
    )  # fmt: skip
