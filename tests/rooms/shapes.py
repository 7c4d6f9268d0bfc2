"""Made rooms."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from shrm_cli.geometry.mesh import make_mesh
from shrm_cli.rooms.room import Room


def box(low, high, inward=True):
    """Corners, triangles and normals of a box; these point inwards, as those of a room do."""
    low, high = np.array(low, float), np.array(high, float)
    corners, faces, normals = [], [], []
    for axis in range(3):
        for side in (0, 1):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            quad = np.zeros((4, 3))
            quad[:, axis] = high[axis] if side else low[axis]
            quad[:, a] = low[a], high[a], high[a], low[a]
            quad[:, b] = low[b], low[b], high[b], high[b]
            normal = np.zeros(3)
            normal[axis] = (1 if side else -1) * (-1 if inward else 1)
            start = 4 * len(corners)
            corners.append(quad)
            normals.append(np.tile(normal, (4, 1)))
            faces += [[start, start + 1, start + 2], [start, start + 2, start + 3]]
    return np.concatenate(corners), np.array(faces), np.concatenate(normals)


def ceiling_lamp(x, z=2.0, y=2.99, half=0.5):
    """A square that faces down."""
    corners = [[x - half, y, z - half], [x + half, y, z - half],
               [x + half, y, z + half], [x - half, y, z + half]]  # fmt: skip
    return np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]), np.tile([0.0, -1, 0], (4, 1))


def room(parts, albedo, emission):
    """The room of some pieces, with a colour and a radiance each."""
    corners, faces, normals, of, start = [], [], [], [], 0
    for number, (points, triangles, directions) in enumerate(parts):
        corners.append(points)
        faces.append(triangles + start)
        normals.append(directions)
        of.append(np.full(len(triangles), number))
        start += len(points)
    mesh = make_mesh("room", *(np.concatenate(each) for each in (corners, faces, normals)))
    plain = Room.of(mesh, (0.5, 0.5, 0.5), {}, sky=SimpleNamespace(chromaticities=None))
    of = np.concatenate(of)
    return replace(
        plain, sky=None, albedo=np.array(albedo, float)[of], emission=np.array(emission, float)[of]
    )


def two_rooms(bright=10.0, dim=0.3):
    """A room with a lamp and a crate, and one beside it with a dim lamp, a thin wall apart."""
    parts = [
        box([0, 0, 0], [4, 3, 4]),
        box([4.2, 0, 0], [8.2, 3, 4]),
        ceiling_lamp(2),
        ceiling_lamp(6.2),
        box([1, 0, 1], [1.8, 0.8, 1.8], inward=False),
    ]
    albedo = [[0.7, 0.7, 0.7], [0.7, 0.3, 0.3], [0, 0, 0], [0, 0, 0], [0.3, 0.5, 0.7]]
    emission = [[0] * 3, [0] * 3, [bright, bright, 0.9 * bright], [dim, dim, 2 * dim], [0] * 3]
    return room(parts, albedo, emission)


def for_mitsuba(mitsuba, room):
    """The shapes of a room in a scene of Mitsuba, by names."""
    found = {}
    colors = np.column_stack([room.albedo, room.emission])
    for number, color in enumerate(np.unique(colors, axis=0)):
        faces = room.mesh.faces[(colors == color).all(axis=1)]
        properties = mitsuba.Properties()
        properties["bsdf"] = mitsuba.load_dict(
            {"type": "diffuse", "reflectance": {"type": "rgb", "value": color[:3].tolist()}}
        )
        if color[3:].any():
            properties["emitter"] = mitsuba.load_dict(
                {"type": "area", "radiance": {"type": "rgb", "value": color[3:].tolist()}}
            )
        shape = mitsuba.Mesh("mesh", len(room.mesh.vertices), len(faces), properties, True)
        held = mitsuba.traverse(shape)
        held["vertex_positions"] = room.mesh.vertices.ravel().astype(np.float32)
        held["vertex_normals"] = room.mesh.normals.ravel().astype(np.float32)
        held["faces"] = faces.ravel().astype(np.uint32)
        held.update()
        found[f"shape{number}"] = shape
    return found
