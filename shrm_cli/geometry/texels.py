"""Textures over a mesh: which point of its surface each texel stands for, and how points look up.

A texel stands for the point of the mesh that lies nearest to its middle in texture coordinates:
the point at its middle, or, beside a chart, one of the chart's border. So bilinear look-ups near a
border find texels of the same chart on all sides, and two charts that meet show no seam.
"""

from collections import deque
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.extras import install
from shrm_cli.geometry.mesh import Integers, Mesh
from shrm_cli.records import record

_PAIRS_AT_ONCE = 2**18
"""Pairs of a triangle and a texel that are looked at together."""
_INSIDE = 1e-6
"""The least weight of a corner, within a triangle that certainly covers a texel's middle."""
_INSET = 0.01
"""How far a texel's point lies from the border of its triangle, as a part of the way to the middle.

Where walls meet, rays from the very edge would slip between them.
"""
_MOST_INSET = 0.25
"""The same in texels, at the most."""
_ON_BORDER = 1e-4
"""The least weight of a corner, at or below which a point counts as on the border: xatlas has
corners at the middles of texels, but for rounding, so that these lie within the triangle by chance.
"""
_SAME = 2**-18
"""Vertices that differ by less count as one, as xatlas has it: in diagonals of the mesh, normals,
and edges of the texture."""
_OFF = 0.2887
"""Where steps of `_SAME` begin, so that likely numbers of meshes do not lie between two of them."""


@record(eq=False)
class Texels:
    """A texture over a mesh, of whose texels some are rows of other arrays."""

    rows: NDArray[np.integer]
    """The row of each texel, -1 for none; the first line is the top, where v is 1, shape (height,
    width)."""
    texcoords: Array
    """Where the corners of each triangle lie, v upwards, shape (m, 3, 2)."""
    positions: Array
    """Where the points lie that the rows stand for, shape (k, 3)."""

    def places(self, faces: NDArray[np.integer], weights: Array) -> tuple[Integers, Array]:
        """Return which rows points of the mesh look up, and the share of each, bilinearly.

        `faces` are of shape (n,). `weights`, of shape (n, 3), are barycentric.

        Returns `rows` of shape (n, 4); and `shares` of shape (n, 4), 0 for texels that are no rows;
        the others add up to 1, if there is any.
        """
        height, width = self.rows.shape
        u, v = np.einsum("nc,ncv->vn", weights, self.texcoords[faces])
        x = np.clip(u * width - 0.5, 0, width - 1)
        y = np.clip((1 - v) * height - 0.5, 0, height - 1)
        left, top = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
        right, down = (x - left)[:, None], (y - top)[:, None]
        columns = left[:, None] + [0, 1, 0, 1]
        rows = self.rows[top[:, None] + [0, 0, 1, 1], columns].astype(np.int64)
        shares = np.where([0, 1, 0, 1], right, 1 - right) * np.where([0, 0, 1, 1], down, 1 - down)
        shares = np.where(rows < 0, 0, shares)
        total = shares.sum(axis=1, keepdims=True)
        return np.maximum(rows, 0), shares / np.where(total > 0, total, 1)

    def steps(self, mesh: Mesh, faces: NDArray[np.integer]) -> Array:
        """Return the sides of texels upon triangles, as columns, shape (k, 3, 2)."""
        height, width = self.rows.shape
        corners = self.texcoords[faces] * [width, height]
        (a, c), (b, d) = np.moveaxis(corners[:, 1:] - corners[:, :1], 0, -1)
        area = a * d - b * c
        scale = np.where(np.abs(area) > _INSIDE, 1 / np.where(area == 0, 1, area), 0)
        inverse = np.moveaxis(np.array([[d, -b], [-c, a]]) * scale, -1, 0)
        return np.asarray(mesh.sides(faces) @ inverse)


@record(eq=False)
class Sampled:
    """The texels of some charts of a mesh, and the points that they stand for."""

    rows: NDArray[np.int32]
    """As those of `Texels`, shape (height, width)."""
    texcoords: Array
    """Shape (m, 3, 2)."""
    faces: Integers
    """The triangle of each row's point, shape (k,)."""
    weights: Array
    """Where the point is in that triangle, barycentric, shape (k, 3)."""
    is_apart: bool
    """Whether no texel is of two charts."""
    is_flat: bool
    """Whether no two triangles cover the middle of one texel."""


def sampled(texcoords: Array, charts: Integers, shape: tuple[int, int]) -> Sampled:
    """Find the texels that look-ups need, and the points that they stand for.

    `texcoords`, of shape (m, 3, 2), are as those of `Texels`. `charts`, of shape (m,), are the
    number of each triangle's chart. `shape` is the height and width of the texture, 2 texels or
    more.
    """
    height, width = shape
    corners = texcoords * [width, -height] + [0, height]
    count = height * width
    nearest, owner = np.full(count, np.inf), np.full(count, -1)
    found = np.zeros((count, 3))
    first, last = np.full(count, charts.max()), np.full(count, -1)
    covers = np.zeros(count, dtype=np.int64)
    for face, column, row in _pairs(corners, shape):
        middles = np.stack([column, row], axis=1) + 0.5
        weights, away = _nearest(middles, corners[face])
        needed = np.abs(away).max(axis=1) < 1
        face, weights, away = face[needed], weights[needed], away[needed]
        texel = (row * width + column)[needed]
        np.minimum.at(first, texel, charts[face])
        np.maximum.at(last, texel, charts[face])
        np.add.at(covers, texel, weights.min(axis=1) > _INSIDE)
        distance = np.einsum("nv,nv->n", away, away)
        order = np.lexsort((face, distance, texel))
        chosen = order[np.unique(texel[order], return_index=True)[1]]
        chosen = chosen[distance[chosen] < nearest[texel[chosen]]]
        place = texel[chosen]
        nearest[place], owner[place], found[place] = distance[chosen], face[chosen], weights[chosen]
    used = np.flatnonzero(owner >= 0)
    rows = np.full(count, -1, dtype=np.int32)
    rows[used] = np.arange(len(used))
    faces, weights = owner[used], found[used]
    ways = corners[faces].mean(axis=1) - np.einsum("nc,ncv->nv", weights, corners[faces])
    length = np.maximum(np.linalg.norm(ways, axis=1), np.finfo(float).tiny)
    is_border = (nearest[used] > 0) | (weights.min(axis=1) <= _ON_BORDER)
    inset = np.where(is_border, np.minimum(_INSET, _MOST_INSET / length), 0)[:, None]
    return Sampled(
        rows.reshape(shape), texcoords, faces, (1 - inset) * weights + inset / 3,
        bool((first[used] == last[used]).all()), bool(covers.max(initial=0) <= 1),
    )  # fmt: skip


def chart_numbers(mesh: Mesh, texcoords: Array) -> Integers:
    """Return the chart of each triangle: those that share vertices with all that they have.

    Vertices are the same where place, normal and texture coordinates are, but for rounding. So
    charts end at creases, over which a texel would have to have two normals.
    """
    corners = mesh.faces.ravel()
    low, high = mesh.bounds
    places = (mesh.vertices[corners] - low) / np.linalg.norm(high - low)
    known = [places, mesh.normals[corners], texcoords.reshape(-1, 2)]
    steps = [np.round(each / _SAME + _OFF) for each in known]
    _, vertices = np.unique(np.column_stack(steps), axis=0, return_inverse=True)
    faces = vertices.reshape(-1, 3)
    labels = np.arange(int(faces.max()) + 1)
    while True:
        least = labels[faces].min(axis=1)
        joined = labels.copy()
        np.minimum.at(joined, faces, least[:, None])
        joined = joined[joined]
        if np.array_equal(joined, labels):
            return np.asarray(least, dtype=np.int64)
        labels = joined


def _pairs(corners: Array, shape: tuple[int, int]) -> Iterator[tuple[Integers, Integers, Integers]]:
    """Yield triangles with the texels whose middles are within one texel of the box around them."""
    most = np.array(shape)[::-1] - 1
    low = np.clip(np.ceil(corners.min(axis=1) - 1.5), 0, most).astype(np.int64)
    high = np.clip(np.floor(corners.max(axis=1) + 0.5), 0, most).astype(np.int64)
    face, row = _ranges(low[:, 1], high[:, 1])
    widths = (high - low)[face, 0] + 1
    block = (np.cumsum(widths) - 1) // _PAIRS_AT_ONCE
    for start, stop in zip(*_runs(block), strict=True):
        some = face[start:stop]
        line, column = _ranges(low[some, 0], high[some, 0])
        yield some[line], column, row[start:stop][line]


def _ranges(low: Integers, high: Integers) -> tuple[Integers, Integers]:
    """Return all numbers from `low` to `high`, after the place that each belongs to."""
    counts = high - low + 1
    place = np.repeat(np.arange(len(low)), counts)
    return place, np.arange(len(place)) - (np.cumsum(counts) - counts - low)[place]


def _runs(values: Integers) -> tuple[list[int], list[int]]:
    """Return where runs of equal values start and stop."""
    cuts = (np.flatnonzero(np.diff(values)) + 1).tolist()
    return [0, *cuts], [*cuts, len(values)]


def _nearest(points: Array, triangles: Array) -> tuple[Array, Array]:
    """Return the nearest points of triangles in the plane, barycentric, and the ways to them."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    doubled = _cross(b - a, c - a)
    scale = 1 / np.where(doubled == 0, 1, doubled)
    weights = np.stack(
        [_cross(b - points, c - points), _cross(c - points, a - points),
         _cross(a - points, b - points)], axis=1,
    ) * scale[:, None]  # fmt: skip
    outside = np.flatnonzero((weights.min(axis=1) < 0) | (doubled == 0))
    least = np.full(len(outside), np.inf)
    for k in range(3):
        start, along = triangles[outside, k], triangles[outside, k - 2] - triangles[outside, k]
        square = np.einsum("nv,nv->n", along, along)
        part = np.einsum("nv,nv->n", points[outside] - start, along) / np.where(square, square, 1)
        part = np.clip(part, 0, 1)
        away = start + part[:, None] * along - points[outside]
        distance = np.einsum("nv,nv->n", away, away)
        nearer = distance < least
        least = np.where(nearer, distance, least)
        chosen = outside[nearer]
        weights[chosen] = 0
        weights[chosen, k], weights[chosen, k - 2] = 1 - part[nearer], part[nearer]
    away = np.einsum("nc,ncv->nv", weights, triangles) - points
    away[weights.min(axis=1) > 0] = 0
    return weights, away


def _cross(first: Array, second: Array) -> Array:
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


# ---- charts --------------------------------------------------------------------------------------
# Charts say where each triangle lies in a texture, so that no two lie on one another. The mesh's
# own texture coordinates serve where they do that. Otherwise xatlas makes some, a package that
# belongs to the extra `charts` and is used by this module alone.

_PADDING = 3
"""Texels between charts; look-ups at the border of each need one of its own."""
_FILLED = 0.95
"""The part of the texture's edge at which packing is tried no more."""
_MOST_TRIALS = 6
"""The most times that charts are packed to find the scale at which they fit."""
_atlases: deque[Any] = deque(maxlen=_MOST_TRIALS)
"""The last atlases that were made. One that ends just as a thread of its own falls asleep waits for
that thread forever, as one in some thousands did on a busy machine. So each ends after others have
been made, when its threads have long been asleep."""


def charted(mesh: Mesh, size: int) -> Sampled:
    """Find the texels of a texture over a mesh, and the points that they stand for.

    `size` is the number of texels along the edge: of a square texture for the mesh's own
    coordinates, and the most for charts that are made.
    """
    if mesh.uvs is not None and mesh.uvs.min() >= 0 and mesh.uvs.max() <= 1:
        own = mesh.uvs[mesh.faces]
        found = sampled(own, chart_numbers(mesh, own), (size, size))
        if found.is_apart and found.is_flat:
            return found
    texcoords, shape = _unwrapped(mesh, size)
    found = sampled(texcoords, chart_numbers(mesh, texcoords), shape)
    if not found.is_apart:
        raise _too_few(mesh, size)
    return found


def _too_few(mesh: Mesh, size: int) -> MeshError:
    return MeshError(f"{mesh.name}: its charts do not fit into {size} texels; give `texture` more")


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
        _atlases.append(atlas)
        edge = max(atlas.width, atlas.height)
        if edge <= size and (best is None or texels > best[0]):
            best = texels, atlas
        if _FILLED * size <= edge <= size:
            break
        texels *= 0.98 * size / edge
    if best is None:
        raise _too_few(mesh, size)
    _, faces, texcoords = best[1][0]
    found = np.take_along_axis(texcoords[faces].astype(float), turn[first][..., None], axis=1)
    found = found[same.reshape(-1)]
    found = np.take_along_axis(found, np.argsort(turn, axis=1)[..., None], axis=1)
    return found, (best[1].height, best[1].width)
