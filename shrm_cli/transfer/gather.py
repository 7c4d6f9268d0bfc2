"""What reaches the vertices of a mesh: integrals over the directions that the mesh itself blocks.

Light comes from far away: its radiance L(s) has the coefficients L_j over the harmonics of world
axes. Light from the direction s reaches a vertex with the unit normal N unless the mesh is in the
way. Let V(s) be 1 where the way is free and 0 where it is not. Then the irradiance of the vertex is
``E = sum_j T_j L_j``, with its transfer vector

    T_j = int V(s) max(0, N.s) Y_j(s) ds = A_l Y_j(N) - int (1 - V(s)) max(0, N.s) Y_j(s) ds.

The first term of the right side has a closed form. Only the second one is estimated, so that a
vertex which sees the whole sky has no error at all, and any other an error in proportion to what is
blocked.

A glossy surface needs more than the irradiance: the radiance that arrives, as a function of the
direction in the vertex's own frame. Its coefficients are ``sum_j M_ij L_j``, with the transfer
matrix

    M_ij = int V(s) Y_i(F s) Y_j(s) ds = D_ij - int (1 - V(s)) Y_i(F s) Y_j(s) ds,

where F takes directions into the frame, and D is the rotation of coefficients that belongs to it.
Below the horizon V counts as 1: a BRDF's product function with the cosine is 0 there, so no true
value depends on it. This choice makes an unshadowed vertex exact, whereas a function that is cut
off at the horizon has no short expansion.

A direction that is blocked brings the light that the point in the way reflects: what the three
vertices of its triangle, or the texels around it, send back along the ray, interpolated between
them. A diffuse vertex sends the same radiance everywhere: ``albedo / pi`` times its irradiance. A
glossy one sends towards the unit vector v

    sum_i c_i(F v) sum_j M_ij L_j,

where c_i are those of the BRDF's product function (see `maps.product.product`). Both are linear in
the light, so that what is sent is a coefficient for each j. "Vertex" stands for texels, too
(`transfer.sites`). A triangle that is met from behind blocks light, and sends none.

All vertices use the same directions of their own frames. With these the sums over the directions
are products of matrices, and neighbours on a smooth surface share their errors, which are not seen
as noise then.

References: Sloan, Kautz and Snyder 2002, Precomputed Radiance Transfer for Real-Time Rendering in
Dynamic, Low-Frequency Lighting Environments, sections 4 and 5. Kautz, Sloan and Snyder 2002, Fast,
Arbitrary BRDF Shading for Low-Frequency Lighting Using Spherical Harmonics, section 5: the BRDF
must be fixed for interreflection.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.geometry.mesh import Mesh, smooth_points
from shrm_cli.geometry.rays import Rays
from shrm_cli.geometry.texels import Texels, charted
from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.records import record
from shrm_cli.sphere.directions import horizontal_tangents, normalize, surface_frames
from shrm_cli.sphere.harmonics import by_degree, degrees, real_harmonics
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.sphere.rotation import rotate_into_frames
from shrm_cli.transfer.transfer import Product

Places = Callable[[NDArray[np.integer], Array], tuple[NDArray[np.integer], Array]]
"""From triangles (n,) and barycentric weights (n, 3) to rows and their shares, both (n, k)."""

OFFSET = 1e-5
"""How far above its site a ray begins, as a part of the diagonal of the mesh's box.

It is some hundred times the rounding of the 32-bit coordinates that rays are traced with.
"""

_LOOKS = 32
"""Directions in which backs of triangles are looked for. Sites that see more than a quarter of them
lie below a closed part of the mesh, or on its border, as probes of a grid within walls do."""
_FIRST = 4
"""A quarter of them is looked along first."""
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
    """Tells the rows whose mean is what is known at a point of the mesh."""
    of_vertices: Callable[[Array], Array]
    """What is known at vertices, shape (n, c), as it is at the sites, shape (v, c)."""
    faces: NDArray[np.int64]
    weights: Array
    """`faces` and `weights`: a triangle that each site lies in, and where, barycentric, shapes (v,)
    and (v, 3)."""
    steps: Array
    """Two sides of what each site stands for, as columns, shape (v, 3, 2)."""
    texels: Texels | None = None


def sites_of(mesh: Mesh, texture: int | None = None) -> Sites:
    """Return the vertices of a mesh, or the texels of a texture over it."""
    if texture is None:
        inset = INSET * _ways_inwards(mesh.vertices, mesh.normals, mesh.faces)
        origins = mesh.vertices + _lift(mesh) * mesh.normals + inset
        own = np.empty(len(mesh.vertices), np.int64)
        own[mesh.faces] = np.arange(len(mesh.faces))[:, None]
        corner = (mesh.faces[own] == np.arange(len(own))[:, None]).astype(float)
        return Sites(
            mesh, mesh.vertices, mesh.normals, origins,
            lambda faces, weights: (mesh.faces[faces], weights), lambda values: values,
            own, corner, mesh.sides(own) / 2,
        )  # fmt: skip
    found = charted(mesh, texture)
    sites = sites_at(mesh, found.faces, found.weights)
    rows = _beside(found.rows, sites.positions, _enclosed(mesh, sites.origins, sites.normals))
    texels = Texels(rows, found.texcoords, sites.positions)
    steps = texels.steps(mesh, found.faces)
    return replace(sites, places=texels.places, steps=steps, texels=texels)


def sites_at(mesh: Mesh, faces: NDArray[np.int64], weights: Array) -> Sites:
    """Return points of triangles, shape (n,), at barycentric weights, shape (n, 3)."""
    smooth = mesh.interpolated(mesh.normals, faces, weights)
    # Normals may cancel between the two sides of a sheet; that of a corner is a direction always.
    first = mesh.normals[mesh.faces[faces, weights.argmax(axis=1)]]
    normals = normalize(
        np.where(np.einsum("vi,vi->v", smooth, smooth)[:, None] > 1e-12, smooth, first)
    )
    origins = smooth_points(mesh, faces, weights, normals) + _lift(mesh) * normals
    return Sites(
        mesh, mesh.interpolated(mesh.vertices, faces, weights), normals, origins,
        lambda faces, weights: (mesh.faces[faces], weights),
        lambda values: mesh.interpolated(values, faces, weights),
        faces, weights, mesh.sides(faces) / 2,
    )  # fmt: skip


def _lift(mesh: Mesh) -> float:
    return OFFSET * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))


def _enclosed(mesh: Mesh, origins: Array, normals: Array) -> NDArray[np.bool_]:
    """Tell which sites see many backs of triangles, as those of a floor below a crate, (v,)."""
    rays, fronts = Rays(mesh), mesh.normals[mesh.faces].mean(axis=1)
    every, seen = spiral_directions(_LOOKS), np.zeros(len(origins), np.int64)
    some = np.arange(len(origins))
    for start in range(_FIRST):
        for way in every[start::_FIRST]:
            below = np.einsum("vi,i->v", normals[some], way) < 0
            ways = np.where(below[:, None], -way, way)
            faces = rays.first_hits(origins[some], ways)[0]
            seen[some] += (faces >= 0) & (np.einsum("vi,vi->v", fronts[faces], ways) > 0)
        some = some[seen[some] > 0]  # most see none in the first directions
    return seen > _LOOKS // 4


def _beside(
    rows: NDArray[np.int32], positions: Array, hidden: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Return rows of texels of which hidden ones have the row of the nearest one beside them.

    Where two bodies touch, points that are seen look up texels that are not, which are black.
    """
    height, width = rows.shape
    found, nearest = rows.copy(), np.full(rows.shape, np.inf)
    wide = np.pad(rows, 1, constant_values=-1)
    dark = (rows >= 0) & hidden[rows]
    for down, right in np.ndindex(3, 3):
        other = wide[down : down + height, right : right + width]
        usable = dark & (other >= 0) & ~hidden[other]
        away = np.linalg.norm(positions[rows] - positions[other], axis=-1)
        closer = usable & (away < nearest)
        found[closer], nearest[closer] = other[closer], away[closer]
    return found


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


# ---- what reaches the sites ----------------------------------------------------------------------


Both = tuple[Array, Array | None]
"""Transfer vectors and matrices of some vertices."""


@record(eq=False)
class DiffuseLight:
    """What diffuse vertices send."""

    radiance: Array
    """``albedo / pi`` times the transfer vectors of all vertices, float32 of shape (v, n,
    channels)."""

    @property
    def shape(self) -> tuple[int, int]:
        """Coefficients, and colour channels."""
        return self.radiance.shape[1:]

    def towards(self, vertices: NDArray[np.integer], directions: Array) -> Array:
        """What some vertices, shape (k,), send in world directions, shape (k, 3).

        Returns an array of float32 of shape (k, coefficients * channels).
        """
        return self.radiance.reshape(len(self.radiance), -1)[vertices]

    def summed(
        self, owners: NDArray[np.integer], vertices: NDArray[np.integer], weights: Array, count: int
    ) -> Array:
        """Sums of what vertices send to so many places, which is the same in all directions.

        Places that lie together see the same vertices, each of them in many directions. So what a
        vertex sends is read once for all of them.

        `owners`, of shape (k,), are the places of rays, and `vertices` and `weights`, of shape (k,
        corners), what they see.

        Returns an array of float32 of shape (count, coefficients * channels).
        """
        used, index = np.unique(vertices, return_inverse=True)
        flat = owners[:, None] * len(used) + index.reshape(vertices.shape)
        sums = np.bincount(flat.ravel(), weights.ravel(), count * len(used))
        sent = self.radiance.reshape(len(self.radiance), -1)[used]
        return np.asarray(sums.reshape(count, -1).astype(np.float32) @ sent)


@record(eq=False)
class GlossyLight:
    """What glossy vertices send."""

    matrices: Array
    """The transfer matrices of all vertices, float32 of shape (v, n, n, 1 or channels)."""
    frames: Array
    """The frames of the vertices, with axes as rows, shape (v, 3, 3)."""
    product: Product
    """The product function of the BRDF."""
    channels: int
    """Colour channels of what is sent."""

    @property
    def shape(self) -> tuple[int, int]:
        """Coefficients, and colour channels."""
        return self.matrices.shape[2], self.channels

    def towards(self, vertices: NDArray[np.integer], directions: Array) -> Array:
        """Return what `DiffuseLight.towards` does; vertices that face away send nothing."""
        size = self.matrices.shape[1]
        result = np.zeros((len(vertices), *self.shape), np.float32)
        for part in slices(len(vertices), _VERTICES_AT_ONCE):
            some = vertices[part]
            local = np.einsum("kij,kj->ki", self.frames[some], directions[part])
            facing = np.flatnonzero(local[:, 2] > 0)
            values = self.product.values(local[facing])[:, :size].astype(np.float32)
            matrices = self.matrices[some[facing]]
            # Matrices of one channel serve all colours of the BRDF, and the other way round.
            shape = len(facing), size, self.channels
            result[part.start + facing] = np.einsum(
                "kic,kijc->kjc",
                np.broadcast_to(values, shape),
                np.broadcast_to(matrices, (*shape[:2], size, self.channels)),
                optimize=True,
            )
        return result.reshape(len(vertices), np.prod(self.shape))


Sent = DiffuseLight | GlossyLight
"""Coefficients of the radiance that the vertices of a mesh send."""


class Gathering:
    """Transfer of light to the vertices of a mesh, for some of them at a time.

    `frames` are of shape (v, 3, 3). The rows are the axes x', y', z' of each site's frame in world
    axes; z' is the normal. `rays` meet the same mesh. `samples` is the number of directions of the
    hemisphere above each vertex, along which a ray is traced.
    """

    def __init__(self, sites: Sites, frames: Array, rays: Rays, order: int, samples: int) -> None:
        self.order, self.samples, self._rays = order, samples, rays
        self._sites, self._frames = sites, frames
        # The upper half of directions that fill the sphere evenly. The cosines of the n of them
        # are (k + 1/2) / n, so that the cosine's integral pi comes out exactly.
        local = spiral_directions(2 * samples)[samples:]
        harmonics = real_harmonics(order, local)
        weight = 2 * np.pi / samples
        self._local = local
        self._cosines = (weight * local[:, 2]).astype(np.float32)
        self._harmonics = (weight * harmonics).astype(np.float32)
        self._lambert = (weight * local[:, 2:] * harmonics).astype(np.float32)
        self._pairs = np.triu_indices(harmonics.shape[1])
        self._factors = lambert_factors(order)[degrees(order)]
        self._sides = _outer_sides(sites.mesh)

    @cached_property
    def _products(self) -> Array:
        """Products of two harmonics in each direction, for `_pairs` of them."""
        rows, columns = self._pairs
        harmonics, weight = real_harmonics(self.order, self._local), 2 * np.pi / self.samples
        return (weight * harmonics[:, rows] * harmonics[:, columns]).astype(np.float32)

    def rotations(self, part: slice) -> Array:
        """Matrices of the rotation of coefficients from world axes into the frames, (k, n, n)."""
        every = np.eye((self.order + 1) ** 2)
        return np.moveaxis(rotate_into_frames(every, self._frames[part]), -1, 0)

    def transfer(self, part: slice, sent: Sent | None = None, glossy: bool = False) -> Both:
        """Transfer vectors of some vertices, and their matrices if these are asked for.

        `sent` is what each vertex of the mesh sends. By default the mesh blocks light and sends
        none.

        Returns vectors of shape (k, n, channels), ``n = (order+1)^2``, index l(l+1)+m, world axes,
        of one channel if nothing is sent; and matrices of shape (k, n, n, channels), or None, from
        coefficients in world axes (columns) to those in the vertex's frame (rows).
        """
        origins, directions = self._bundle(part)
        blocked, rays, rows, shares = self._look(origins, directions, sent is not None)
        rotations = self.rotations(part)
        # The rotation is orthogonal: its transpose leads from the frame back to the world.
        shadow = np.einsum("kij,ki->kj", rotations, blocked @ self._lambert)
        # Those of a mesh that blocks nothing are A_l Y_lm(N).
        open_to_all = self._factors * real_harmonics(self.order, self._sites.normals[part])
        vectors = (open_to_all - shadow)[..., None]
        matrices = self._free(blocked, rotations)[..., None] if glossy else None
        if sent is None:
            return vectors, matrices
        count = len(vectors)
        if matrices is None and isinstance(sent, DiffuseLight):
            weights = shares * self._cosines[rays % self.samples, None]
            found = sent.summed(rays // self.samples, rows, weights, count)
            return vectors + found.reshape(count, *sent.shape), None
        back, seen = -directions[rays], np.zeros((len(origins), np.prod(sent.shape)), np.float32)
        seen[rays] = sum(
            shares[:, each, None] * sent.towards(rows[:, each], back)
            for each in range(shares.shape[1])
        )
        seen = seen.reshape(count, self.samples, -1)
        vectors = vectors + (self._cosines @ seen).reshape(count, *sent.shape)
        if matrices is not None:
            matrices = matrices + (self._harmonics.T @ seen).reshape(count, -1, *sent.shape)
        return vectors, matrices

    def _free(self, blocked: Array, rotations: Array) -> Array:
        """Matrices of the light that is not blocked, shape (k, n, n)."""
        count = rotations.shape[-1]
        free = np.empty((len(blocked), count, count), np.float32)
        rows, columns = self._pairs
        free[:, rows, columns] = free[:, columns, rows] = -(blocked @ self._products)
        free[:, range(count), range(count)] += 1
        return free @ rotations.astype(np.float32)

    def _look(
        self, origins: Array, directions: Array, is_lit: bool
    ) -> tuple[Array, NDArray[np.intp], NDArray[np.integer], Array]:
        """What is in the way of the rays of some vertices, and which vertices send it.

        Returns `blocked` of shape (k, samples), 1 where the mesh is in the way and 0 elsewhere; the
        rays that meet fronts, shape (m,); and the rows and the shares of what sends light along
        them, shape (m, corners) each. There are none of them unless the mesh is lit.
        """
        if not is_lit:
            hit = self._rays.occluded(origins, directions)
            none = np.empty((0, 1))
            return _by_site(hit, self.samples), np.empty(0, np.intp), none.astype(np.intp), none
        faces, inside, _ = self._rays.first_hits(origins, directions)
        rays = np.flatnonzero(faces >= 0)
        rays = rays[np.einsum("ij,ij->i", self._sides[faces[rays]], directions[rays]) < 0]
        rows, shares = self._sites.places(faces[rays], inside[rays])
        return _by_site(faces >= 0, self.samples), rays, rows, shares.astype(np.float32)

    def _bundle(self, part: slice) -> tuple[Array, Array]:
        """Origins and directions of the rays of some vertices, shapes (k * samples, 3)."""
        directions = self._local @ self._frames[part]
        origins = np.broadcast_to(self._sites.origins[part, None], directions.shape)
        return origins.reshape(-1, 3), directions.reshape(-1, 3)


def _by_site(blocked: NDArray[np.bool_], samples: int) -> Array:
    return blocked.reshape(-1, samples).astype(np.float32)


def _outer_sides(mesh: Mesh) -> Array:
    """Normals of the triangles, of any length, on the side where their vertices' normals are.

    Not all files wind their triangles the same way round.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, each]] for each in range(3))
    across = np.cross(b - a, c - a)
    along = np.einsum("fi,fi->f", across, mesh.normals[mesh.faces].sum(axis=1))
    return np.where(along < 0, -1.0, 1.0)[:, None] * across


_VERTICES_AT_ONCE = 2**12
"""Vertices whose matrices are gathered at a time: 10 MB of them at order 4."""


# ---- how many degrees of the light a mesh has to be baked for ------------------------------------
# What a vertex that sees most of the sky takes of the light is smooth. Where light comes in by a
# window alone, the window's edges are in the transfer vectors. What a light loses beyond an order
# depends on the light, which is not known here: coefficients that fall as ``1 / (l+1)`` are those
# of a sunrise without its sun, and fall less than those of six of nine real probes without their
# lamps.

ORDERS = 4, 6, 8, 10, 12, 16
"""The orders that are tried."""
MISSED = 0.025
"""The relative RMS error of the irradiance of such a light that an order may make."""
_SITES, _SAMPLES = 256, 1024
"""The sites that stand for all, at least, and their rays."""
_AT_ONCE = 32


def sufficient_order(sites: Sites, rays: Rays) -> int:
    """Return the least of some orders that the irradiance of a mesh's sites needs.

    `rays` meet the same mesh.
    """
    missed = missed_by_order(sites, rays)
    return next((order for order in ORDERS if missed[order] <= MISSED), ORDERS[-1])


def missed_by_order(sites: Sites, rays: Rays) -> Array:
    """Return the relative RMS error that each order up to the last one makes, shape (order+1,)."""
    last, count = ORDERS[-1], len(sites.positions)
    frames = surface_frames(sites.normals, horizontal_tangents(sites.normals))
    gathering = Gathering(sites, frames, rays, last, _SAMPLES)
    step = max(count // _SITES, 1)
    energy = np.zeros((last + 1) ** 2)
    for start in range(0, count, step * _AT_ONCE):
        part = slice(start, min(start + step * _AT_ONCE, count), step)
        energy += (gathering.transfer(part)[0][..., 0] ** 2).sum(axis=0)
    lit = by_degree(energy / (degrees(last) + 1) ** 2)
    beyond = np.append(np.cumsum(lit[::-1])[-2::-1], 0.0)
    return np.sqrt(beyond / max(lit.sum(), 1e-300))
