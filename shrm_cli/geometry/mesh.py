"""Triangle meshes as everything else takes them: finite, indexed soundly, with unit normals.

What files say of surfaces is in the terms of glTF's metallic-roughness model. Textures are named,
and are read only where a picture is drawn of them.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.records import record
from shrm_cli.vocabulary import LARGEST_COORDINATE

Wrap = Literal["repeat", "clamp", "mirror"]
Matrix = tuple[float, float, float, float, float, float]


MASKED = 0.5
"""Least opacity that is seen of what a file would blend with what lies behind."""


@record
class Texture:
    """A texture over a mesh."""

    picture: Path | bytes | str
    """The file of its pixels, or the content of one, or a text that says why there is none."""
    is_srgb: bool = False
    """Whether its colours are encoded as sRGB has it."""
    uv_set: int = 0
    """The texture coordinates that it lies over. One of 0 and 1."""
    matrix: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    """Two rows that multiply columns (u, 1 - v, 1), and give the place in shares of the width from
    the left and of the height from the top."""
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    """What is to the left and right, and above and below."""
    is_nearest: bool = False
    """Whether its pixels are seen as squares where they are larger than those of the picture."""


@record
class SurfaceMaterial:
    """A surface, whose numbers are factors of its textures."""

    name: str = ""
    """Empty if it has none."""
    base_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Linear RGB, 0 .. 1."""
    metallic: float = 1.0
    roughness: float = 1.0
    """`metallic` and `roughness`: 0 .. 1; GGX's alpha is the square of the roughness."""
    color_map: Texture | None = None
    """Base colour, and opacity in alpha."""
    metallic_map: Texture | None = None
    metallic_channel: int = 2
    roughness_map: Texture | None = None
    """`metallic_map` and `roughness_map`: of which the channels `metallic_channel` and
    `roughness_channel` count."""
    roughness_channel: int = 1
    normal_map: Texture | None = None
    """Normals in the tangent frame, x along u and y along v: each channel 0 .. 1 for -1 .. 1."""
    normal_scale: float = 1.0
    """Factor of x and y of the normals."""
    occlusion_map: Texture | None = None
    """Its red channel is the share of the light that reaches the surface."""
    occlusion_strength: float = 1.0
    """0 .. 1, how far it counts."""
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """What the surface emits, linear RGB, at least 0."""
    emission_map: Texture | None = None
    colored: Literal["", "linear", "srgb"] = ""
    """How vertex colours are encoded that multiply the base colour; empty where none do."""
    opacity: float = 1.0
    """Factor of the opacity."""
    cutoff: float | None = None
    """The least opacity that is seen; None where all of it is."""
    unread: tuple[str, ...] = ()
    """What else the file says of it, which is not drawn."""
    is_known: bool = True
    """Whether there is a file that says something of it; if not, `unread` says why."""

    @property
    def matte(self) -> "SurfaceMaterial":
        """The same without what a diffuse surface has not: its colours and its glow alone."""
        return replace(
            self, metallic_map=None, roughness_map=None, normal_map=None, occlusion_map=None
        )

    @property
    def has_color(self) -> bool:
        """Whether the file says of it what it reflects."""
        return bool(self.color_map or self.colored) or self.base_color != (1.0, 1.0, 1.0)

    @property
    def is_clear(self) -> bool:
        """Whether nothing of it is opaque enough to be seen."""
        return self.cutoff is not None and self.opacity < self.cutoff

    @property
    def textures(self) -> tuple[Texture, ...]:
        maps = (
            self.color_map, self.metallic_map, self.roughness_map, self.normal_map,
            self.occlusion_map, self.emission_map,
        )  # fmt: skip
        return tuple(each for each in maps if each is not None)


# ---- meshes --------------------------------------------------------------------------------------


Integers = NDArray[np.int64]

MOST_FACES = 2**22
"""The most triangles of a mesh."""

_LEAST_NORMAL = 1e-12
"""Length below which a normal of a file has no direction."""
_SINGULAR = 1e-30
"""Least determinant of a transformation whose largest number is 1; less would flatten the mesh."""


@record(eq=False)
class Mesh:
    """Triangles that share vertices."""

    name: str
    """The name of its file, for messages."""
    vertices: Array
    """Positions in world axes, in whatever unit the file has, shape (n, 3). Each belongs to a
    triangle."""
    faces: Integers
    """Vertices of each triangle, counterclockwise as seen from the outside, shape (m, 3)."""
    normals: Array
    """Unit, smooth; the file's own where it has them, shape (n, 3)."""
    uvs: Array | None
    """Texture coordinates, v upwards, shape (n, 2)."""
    uvs_1: Array | None
    """The second set of them, shape (n, 2)."""
    tangents: Array | None
    """The tangents of the file: the direction in which u grows, and 1 or -1, the sign of v's
    direction N x T; NaN where the file has none, shape (n, 4)."""
    colors: Array | None
    """Colours of the vertices as the file has them, integers as fractions of their largest, shape
    (n, 3)."""
    materials: tuple[SurfaceMaterial, ...]
    """glTF and OBJ files tell them, and any file with vertex colours has one."""
    face_materials: Integers
    """For each triangle its index in `materials`; -1 for none, shape (m,)."""
    file_vertices: Integers
    """The number of each vertex in its file, see `load_mesh`, shape (n,). Several of a mesh are
    one of its file where the file gives it several normals or texture coordinates."""
    file_rows: Integers
    """For each vertex of the file the vertex of the mesh that it is, the first one of several; -1
    for those that belong to no triangle with an area, shape (k,)."""

    @property
    def bounds(self) -> Array:
        """The least and the largest coordinates, shape (2, 3)."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    def corners(self, faces: ArrayLike) -> Array:
        """Return the corners of triangles by their indices, shape (k, 3 corners, 3)."""
        return self.vertices[self.faces[np.asarray(faces)]]

    def sides(self, faces: ArrayLike) -> Array:
        """Return the ways from the first corner of triangles to the others, shape (k, 3, 2)."""
        corners = self.corners(faces)
        return np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)

    def interpolated(self, values: Array, faces: ArrayLike, barycentric: Array) -> Array:
        """Interpolate values at the vertices to points of triangles, shape (k, channels).

        `values` are of shape (n, channels). `faces` are of shape (k,). `barycentric`, of shape (k,
        3), holds weights of the three corners of each triangle.
        """
        return np.einsum("kc,kcv->kv", barycentric, values[self.faces[np.asarray(faces)]])

    def transformed(self, matrix: ArrayLike) -> "Mesh":
        """Return the mesh moved by an affine transformation.

        `matrix`, of shape (3, 4) or (4, 4), multiplies columns (x, y, z, 1). Normals stay
        perpendicular to the surface, and mirrored triangles are turned, so that their outside stays
        outside.
        """
        rows = np.asarray(matrix, dtype=float)[:3]
        linear, shift = rows[:, :3], rows[:, 3]
        size = float(np.abs(linear).max()) or 1.0
        with np.errstate(all="ignore"):
            determinant = float(np.linalg.det(linear / size))
        if not (np.isfinite(rows).all() and abs(determinant) > _SINGULAR):
            raise MeshError(f"{self.name}: a transformation flattens it; scale it by less")
        moved = self.vertices @ linear.T + shift
        _check_vertices(self.name, moved)
        normals = self.normals @ np.linalg.inv(linear / size)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        faces = self.faces if determinant > 0 else self.faces[:, ::-1]
        tangents = self.tangents
        if tangents is not None:
            along = tangents[:, :3] @ (linear / size).T
            along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), _LEAST_NORMAL)
            tangents = np.column_stack([along, np.sign(determinant) * tangents[:, 3]])
        return replace(self, vertices=moved, normals=normals, faces=faces, tangents=tangents)


def make_mesh(
    name: str,
    vertices: ArrayLike,
    faces: ArrayLike,
    normals: ArrayLike | None = None,
    uvs: ArrayLike | None = None,
    colors: ArrayLike | None = None,
    materials: Sequence[SurfaceMaterial] = (),
    face_materials: ArrayLike | None = None,
    uvs_1: ArrayLike | None = None,
    tangents: ArrayLike | None = None,
    file_vertices: ArrayLike | None = None,
    file_count: int | None = None,
    file_rows: ArrayLike | None = None,
) -> Mesh:
    """Make a mesh of what a file or a program says, without what cannot be drawn.

    Triangles without an area are left out, as are vertices that belong to no triangle. Normals
    that are missing, not finite or of no length are the smooth ones of `smooth_normals`, around the
    vertices of the file where `file_vertices` tells them, and else around places. Texture
    coordinates and colours that are not finite, or not one for each vertex, are left out as a
    whole.

    `vertices` and `normals`, of any length, are of shape (n, 3), `faces` of (m, 3), `uvs` and
    `uvs_1` of (n, 2). Integers in `colors`, of shape (n, 3 or 4), stand for fractions of the
    largest that their type holds. The first of the `materials` is that of all triangles, unless
    `face_materials` says otherwise. `face_materials`, of shape (m,), are the indices of their
    materials; -1 for none. `tangents`, of shape (n, 4), are as `Mesh` has them. `file_vertices`, of
    shape (n,), tells which vertex of its file each vertex is; by default the one of the same
    number. `file_count` is the number of vertices of the file; by default as many as there are
    here. `file_rows`, of shape (k,), tells which vertex each vertex of the file is, where several
    of the file are one here; by default the first that `file_vertices` gives.
    """
    points, triangles = np.asarray(vertices, dtype=float), np.asarray(faces)
    if points.ndim != 2 or points.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3:
        raise MeshError(f"{name}: it has no triangles; export it as a triangle mesh")
    if len(triangles) == 0 or len(points) == 0:
        raise MeshError(f"{name}: it has no triangles; export it with its faces")
    if len(triangles) > MOST_FACES:
        raise too_many(name, len(triangles))
    if int(triangles.min()) < 0 or int(triangles.max()) >= len(points):
        raise MeshError(
            f"{name}: a triangle names a vertex that is not there; export the mesh again"
        )
    triangles = triangles.astype(np.int64)
    used = np.zeros(len(points), dtype=bool)
    used[triangles] = True
    _check_vertices(name, points[used])
    points = np.where(used[:, None], points, 0.0)  # what nobody uses may be anything
    has_area = np.any(face_normals(points, triangles) != 0, axis=1)
    if not has_area.any():
        raise MeshError(f"{name}: no triangle has an area; export it as a triangle mesh")
    kept = triangles[has_area]
    used[:] = False
    used[kept] = True
    renumbered = np.cumsum(used) - 1
    points, kept = points[used], renumbered[kept]
    own = np.arange(len(used)) if file_vertices is None else np.asarray(file_vertices)
    around = points if file_vertices is None else own[used]
    if file_rows is None:
        rows = first_places(own[used], len(used) if file_count is None else file_count)
    else:
        known = np.asarray(file_rows)
        rows = np.where((known >= 0) & used[known], renumbered[known], -1)
    owners = np.full(len(triangles), 0 if materials else -1, dtype=np.int64)
    if face_materials is not None:
        owners[:] = face_materials
    return Mesh(
        name=name, vertices=points, faces=kept,
        normals=_normals(points, kept, around, _attribute(normals, used, 3)),
        uvs=_attribute(uvs, used, 2),
        uvs_1=_attribute(uvs_1, used, 2), tangents=_attribute(tangents, used, 4),
        colors=_fractions(colors, used), materials=tuple(materials),
        face_materials=owners[has_area], file_vertices=own[used].astype(np.int64),
        file_rows=rows.astype(np.int64),
    )  # fmt: skip


def first_places(numbers: Integers, count: int) -> Integers:
    """Return where each number below a count stands first in an array, and -1 if it does not."""
    found = np.full(count, -1, dtype=np.int64)
    found[numbers[::-1]] = np.arange(len(numbers))[::-1]
    return found


def joined(name: str, meshes: Sequence[Mesh]) -> Mesh:
    """Return one mesh that holds several, in their order.

    Where some have texture coordinates, colours or tangents, those of the others are 0, white, and
    NaN. Equal materials are one.
    """
    if len(meshes) == 1:
        return replace(meshes[0], name=name)
    materials = dict.fromkeys(each for mesh in meshes for each in mesh.materials)
    places = {material: place for place, material in enumerate(materials)}
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    owners = [
        np.array([*(places[each] for each in mesh.materials), -1])[mesh.face_materials]
        for mesh in meshes
    ]
    return Mesh(
        name=name,
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate(
            [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
        ),
        normals=np.concatenate([mesh.normals for mesh in meshes]),
        uvs=_filled(meshes, [mesh.uvs for mesh in meshes], 2, 0.0),
        uvs_1=_filled(meshes, [mesh.uvs_1 for mesh in meshes], 2, 0.0),
        tangents=_filled(meshes, [mesh.tangents for mesh in meshes], 4, np.nan),
        colors=_filled(meshes, [mesh.colors for mesh in meshes], 3, 1.0),
        materials=tuple(materials),
        face_materials=np.concatenate(owners).astype(np.int64),
        file_vertices=np.concatenate([mesh.file_vertices for mesh in meshes]),
        file_rows=_joined_rows(meshes, starts),
    )


def _joined_rows(meshes: Sequence[Mesh], starts: Integers) -> Integers:
    """Return the first vertex of a joined mesh that each vertex of the file is."""
    rows = np.full(max(len(mesh.file_rows) for mesh in meshes), -1, dtype=np.int64)
    for mesh, start in zip(meshes[::-1], starts[len(meshes) - 1 :: -1], strict=True):
        known = np.flatnonzero(mesh.file_rows >= 0)
        rows[known] = mesh.file_rows[known] + start
    return rows


def too_many(name: str, faces: int) -> MeshError:
    """Return the error that a mesh has more triangles than are taken."""
    return MeshError(f"{name}: {faces:,} triangles are more than {MOST_FACES:,}; simplify the mesh")


def _check_vertices(name: str, points: Array) -> None:
    bad = ~np.isfinite(points).all(axis=1)
    if bad.any():
        raise MeshError(
            f"{name}: {np.count_nonzero(bad):,} vertices are NaN or infinite; export it again"
        )
    if float(np.abs(points).max()) > LARGEST_COORDINATE:
        raise MeshError(f"{name}: its coordinates exceed {LARGEST_COORDINATE:g}; scale the mesh")


def _attribute(values: ArrayLike | None, used: NDArray[np.bool_], columns: int) -> Array | None:
    """Return an attribute of the used vertices; None if it is no attribute of all vertices.

    Normals and tangents may hold numbers that are not finite, which are dealt with one by one.
    """
    if values is None:
        return None
    array = np.asarray(values)
    if array.shape != (len(used), columns) or array.dtype.kind not in "iuf":
        return None
    array = array.astype(float)[used]
    return array if columns > 2 or np.isfinite(array).all() else None


def _fractions(colors: ArrayLike | None, used: NDArray[np.bool_]) -> Array | None:
    array = None if colors is None else np.asarray(colors)
    if array is None or array.ndim != 2 or array.shape[1] not in (3, 4):
        return None
    scale = np.iinfo(array.dtype).max if array.dtype.kind == "u" else 1
    found = _attribute(array[:, :3], used, 3)
    return found / scale if found is not None and np.isfinite(found).all() else None


def _normals(points: Array, faces: Integers, around: NDArray[Any], given: Array | None) -> Array:
    """Return unit normals: the given ones, and smooth ones where those are no directions."""
    if given is None:
        return smooth_normals(points, faces, around)
    with np.errstate(all="ignore"):
        length = np.linalg.norm(given, axis=1, keepdims=True)
        unit = given / length
    lacking = ~(np.isfinite(unit).all(axis=1) & (length[:, 0] > _LEAST_NORMAL))
    if lacking.any():
        unit[lacking] = smooth_normals(points, faces, around)[lacking]
    return unit


def _filled(
    meshes: Sequence[Mesh], values: Sequence[Array | None], columns: int, missing: float
) -> Array | None:
    """Return the attribute of all meshes, with a number where one has none; None if all lack it."""
    if all(each is None for each in values):
        return None
    return np.concatenate([
        np.full((len(mesh.vertices), columns), missing) if each is None else each
        for mesh, each in zip(meshes, values, strict=True)
    ])  # fmt: skip


# ---- normals of triangles and vertices -----------------------------------------------------------

_FLAT = 1e-12
"""Area of a triangle, in squares of its longest edge, below which it has no direction."""
_NOWHERE = 1e-9
"""Length of a sum of normals below which they cancel each other."""


def face_normals(vertices: Array, faces: Integers) -> Array:
    """Return the unit normals of triangles.

    `faces`, of shape (m, 3), are counterclockwise as seen from where the normals point to.

    Returns an array of shape (m, 3): 0 where a triangle has no area.
    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    edges = np.stack([b - a, c - b, a - c])
    longest = np.sqrt(np.max(np.sum(edges**2, axis=-1), axis=0))[:, None]
    scale = np.where(longest > 0, longest, 1)
    normals = np.cross((b - a) / scale, (c - a) / scale)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > _FLAT, normals / np.where(length > 0, length, 1), 0)


def smooth_normals(vertices: Array, faces: Integers, around: NDArray[Any]) -> Array:
    """Return unit normals of vertices: means of the triangles there, weighted by their angles.

    The result does not depend on how a surface is cut into triangles (Thurmer and Wuthrich 1998,
    "Computing vertex normals from polygonal facets"). Vertices are one whose rows of `around` are
    the same, so that seams of texture coordinates are not seen. Triangles without an area do not
    count.

    Returns an array of shape (n, 3). Where normals cancel each other, as on the two sides of a
    sheet, the normal is that of one of the vertex's own triangles.
    """
    flat = face_normals(vertices, faces)
    _, place = np.unique(around, axis=0, return_inverse=True)
    place = place.reshape(-1)
    total = np.zeros((int(place.max()) + 1, 3))
    for corner, angle in enumerate(_angles(vertices, faces)):
        for axis in range(3):
            total[:, axis] += np.bincount(
                place[faces[:, corner]], angle * flat[:, axis], minlength=len(total)
            )
    length = np.linalg.norm(total, axis=1)
    normals = total / np.where(length > 0, length, 1)[:, None]
    result = normals[place]
    cancelled = length[place] < _NOWHERE
    if cancelled.any():
        own = np.zeros_like(result)
        sound = np.any(flat != 0, axis=1)
        own[faces[sound].ravel()] = np.repeat(flat[sound], 3, axis=0)
        result[cancelled] = own[cancelled]
    return result


def _angles(vertices: Array, faces: Integers) -> Array:
    """Return the angles of triangles at their corners, radians, shape (3, m); 0 without edges."""
    angles = np.empty(faces.T.shape)
    for corner in range(3):
        here, after, before = (vertices[faces[:, (corner + k) % 3]] for k in range(3))
        u, v = unit_or_zero(after - here), unit_or_zero(before - here)
        # atan2 is exact for small angles and those near pi, where the arc cosine is not.
        angles[corner] = np.arctan2(
            np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v)
        )
    return angles


def unit_or_zero(vectors: Array) -> Array:
    """Return vectors (n, 3) divided by their lengths; those of no length stay 0."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)


def smooth_points(mesh: "Mesh", faces: Integers, weights: Array, normals: Array) -> Array:
    """Return points of the smooth surface of the normals, to trace rays from, shape (n, 3).

    From the flat triangles themselves, rays of low lamps would meet their neighbours, and the edge
    of the light would show the triangles (Hanika 2021, "Hacking the Shadow Terminator", Ray Tracing
    Gems II, chapter 4). There points are moved onto a mean of their corners' tangent planes, which
    is twice as high above a triangle as the sphere that touches these planes: ``sum_i w_i sum_j
    w_j |e_ij|^2 / 2R`` beside ``sum_i<j w_i w_j |e_ij|^2 / 2R``, with edges e_ij. From so high they
    look over what shadows them. Here they are moved half as far, and a plane below a point, as
    where the surface turns from convex to concave, counts against one above it.

    `weights`, of shape (n, 3), are barycentric. `normals`, of shape (n, 3), are those of the side
    that is looked from.
    """
    corners = mesh.faces[faces]
    points = mesh.interpolated(mesh.vertices, faces, weights)
    flat = face_normals(mesh.vertices, corners)
    flat *= np.where(np.einsum("nv,nv->n", flat, normals) < 0, -1.0, 1.0)[:, None]
    # With a normal turned round, both factors change their signs, and so the height does not.
    own = mesh.normals[corners]
    above = np.einsum("ncv,ncv->nc", mesh.vertices[corners] - points[:, None], own)
    height = np.einsum("nc,nc,ncv,nv->n", weights, above, own, flat) / 2
    return points + np.maximum(height, 0)[:, None] * flat
