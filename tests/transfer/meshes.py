"""Made meshes, and integrals over directions that share no code with the package."""

import numpy as np

from shrm_cli.geometry.mesh import make_mesh


def quad(a, b, c, d):
    """Corners and triangles of a quadrilateral, counterclockwise as seen from its outside."""
    return np.array([a, b, c, d], dtype=float), np.array([[0, 1, 2], [0, 2, 3]])


def joined(*parts):
    """Vertices and faces of several pieces as one."""
    vertices, faces, start = [], [], 0
    for points, triangles in parts:
        vertices.append(points)
        faces.append(triangles + start)
        start += len(points)
    return np.concatenate(vertices), np.concatenate(faces)


def wall(angle, size=30):
    """A point of the ground, and a wall whose upper edge is seen from it at an angle (radians).

    The point is the mesh's first vertex, at the origin with the normal +Z, and belongs to a small
    triangle. The wall fills the directions of elevations 0 to `angle` towards +X.
    """
    ground = np.array([[0, 0, 0], [-1e-3, 1e-3, 0], [-1e-3, -1e-3, 0]]), np.array([[0, 1, 2]])
    x, z = np.cos(angle), np.sin(angle)
    high = quad((1, -size, -1), (1, size, -1), (1, size, z / x), (1, -size, z / x))
    vertices, faces = joined(ground, high)
    normals = np.tile([0.0, 0, 1], (3, 1)), np.tile([-1.0, 0, 0], (4, 1))
    return make_mesh("wall", vertices, faces, np.concatenate(normals))


def sphere(level, inwards=False, hole=1.1):
    """An icosahedron, divided `level` times and blown up, with exact normals.

    Triangles whose middle has a z above `hole` are left out.
    """
    g = (1 + 5**0.5) / 2
    corners = [(0, s, t * g) for s in (-1, 1) for t in (-1, 1)]
    points = np.array([np.roll(corner, k) for corner in corners for k in range(3)])
    length = np.linalg.norm(points[:, None] - points, axis=-1)
    near = np.isclose(length, 2)
    faces = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    triangles = points[np.array(faces)]
    for _ in range(level):
        a, b, c = np.moveaxis(triangles, 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        triangles = np.concatenate([np.stack(each, axis=1) for each in parts])
    triangles /= np.linalg.norm(triangles, axis=-1, keepdims=True)
    turned = np.einsum("fi,fi->f", np.cross(*(triangles[:, 1:] - triangles[:, :1]).swapaxes(0, 1)),
                       triangles.mean(axis=1)) < 0  # fmt: skip
    triangles[turned] = triangles[turned][:, ::-1]
    triangles = triangles[triangles.mean(axis=1)[:, 2] < hole]
    flat = triangles.reshape(-1, 3)
    _, first, index = np.unique(np.round(flat, 9), axis=0, return_index=True, return_inverse=True)
    vertices, indices = flat[first], index.reshape(-1, 3)
    if inwards:
        return make_mesh("cavity", vertices, indices[:, ::-1], -vertices)
    return make_mesh("sphere", vertices, indices, vertices)


def box(inwards=True, divided=3):
    """The cube from -1 to 1, each of its faces of its own vertices."""
    t = np.linspace(-1, 1, divided + 1)
    u, v = np.meshgrid(t, t, indexing="ij")
    first = np.arange(divided * (divided + 1)).reshape(divided, divided + 1)[:, :-1].ravel()
    right, up = divided + 1, 1
    faces = np.concatenate(
        [
            np.stack([first, first + right, first + right + up], axis=1),
            np.stack([first, first + right + up, first + up], axis=1),
        ]
    )
    parts, normals = [], []
    for axis in range(3):
        for side in (-1, 1):
            points = np.roll(np.stack([u.ravel(), v.ravel(), np.full(u.size, 1.0)], 1), axis, 1)
            parts.append((side * points, faces))  # mirrored or not, seen from within or without
            normals.append(np.tile(np.roll([0, 0, -1.0 * side], axis), (u.size, 1)))
    vertices, triangles = joined(*parts)
    normals = np.concatenate(normals)
    return make_mesh("box", vertices, triangles, normals if inwards else -normals)


def bumps(count=24):
    """A wavy square, whose valleys are in shadow."""
    t = np.linspace(-1, 1, count)
    x, y = np.meshgrid(t, t, indexing="ij")
    z = 0.35 * np.cos(5 * x) * np.cos(4 * y)
    index = np.arange(count * count).reshape(count, count)
    a, b, c, d = (
        index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(),
        index[:-1, 1:].ravel(),
    )  # fmt: skip
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return make_mesh("bumps", np.stack([x, y, z], -1).reshape(-1, 3), faces)


def curved(mesh):
    """Each triangle in four, with the middles of its edges where its normals bend them to.

    References: Vlachos et al. 2001, Curved PN Triangles: on an edge from P with the normal N to Q,
    with M, the cubic's points are ``(2 P + Q - N.(Q - P) N) / 3``, and from Q alike.
    """
    points, normals = mesh.vertices[mesh.faces], mesh.normals[mesh.faces]
    start, end = points, np.roll(points, -1, axis=1)
    along = end - start
    first = np.sum(along * normals, axis=-1, keepdims=True) * normals
    ends = np.roll(normals, -1, axis=1)
    second = np.sum(along * ends, axis=-1, keepdims=True) * ends
    middles = (start + end) / 2 + (second - first) / 8
    corners = np.concatenate([points, middles], axis=1)  # a, b, c, ab, bc, ca
    order = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
    vertices, faces = np.unique(
        corners[:, order].reshape(-1, 3).round(6), axis=0, return_inverse=True
    )
    return make_mesh("curved", vertices, faces.reshape(-1, 3))


def whole_sphere(rows=400):
    """Directions and solid angles of a product rule: Gauss in z, and even steps about it."""
    z, weights = np.polynomial.legendre.leggauss(rows)
    phi = 2 * np.pi * (np.arange(2 * rows) + 0.5) / (2 * rows)
    sine = np.sqrt(1 - z**2)[:, None]
    directions = np.stack(
        np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), z[:, None]), axis=-1
    )
    return directions.reshape(-1, 3), np.repeat(weights * np.pi / rows, 2 * rows)
