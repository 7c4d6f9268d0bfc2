"""Meshes that tests make, and the bytes of their files, by no reader's code."""

import base64
import json
import struct

import numpy as np


def icosphere(splits=2):
    """Vertices and faces of an icosahedron whose triangles are split, on the unit sphere."""
    g = (1 + 5**0.5) / 2
    vertices = [(s, t * g, 0) for s in (-1, 1) for t in (-1, 1)]
    vertices = vertices + [(0, *v[:2]) for v in vertices] + [(v[1], 0, v[0]) for v in vertices]
    vertices = np.array(vertices, dtype=float) / np.hypot(1, g)
    distance = np.linalg.norm(vertices[:, None] - vertices, axis=-1)
    near = (distance > 0) & (distance < 1.1)
    faces = np.array([
        (i, j, k)
        for i in range(12) for j in range(12) for k in range(12)
        if i < j and i < k and j != k and near[i, j] and near[j, k] and near[k, i]
        and np.linalg.det(vertices[[i, j, k]]) > 0
    ])  # fmt: skip
    assert len(faces) == 20
    for _ in range(splits):
        corners = vertices[faces]
        middles = [corners[:, k] + corners[:, (k + 1) % 3] for k in range(3)]
        points = np.concatenate([*(corners[:, k] for k in range(3)), *middles])
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        vertices, place = np.unique(np.round(points, 12), axis=0, return_inverse=True)
        a, b, c, ab, bc, ca = place.reshape(6, -1)
        quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = np.concatenate([np.stack(each, axis=1) for each in quarters])
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


TETRAHEDRON = (
    np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=float),
    np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]),
)


def obj(vertices, faces):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices).tolist()]
    lines += ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    return ("\n".join(lines) + "\n").encode()


def ply(vertices, faces, binary=True, count=None):
    kind = "binary_little_endian" if binary else "ascii"
    header = (
        f"ply\nformat {kind} 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces) if count is None else count}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    if binary:
        body = b"".join(struct.pack("<3f", *v) for v in vertices)
        body += b"".join(struct.pack("<B3i", 3, *f) for f in faces)
        return header.encode() + body
    rows = [" ".join(f"{x:.9g}" for x in v) for v in vertices]
    rows += ["3 " + " ".join(map(str, f)) for f in faces]
    return (header + "\n".join(rows) + "\n").encode()


def stl(vertices, faces, binary=True, count=None):
    corners = np.asarray(vertices)[np.asarray(faces)]
    if binary:
        body = b"".join(struct.pack("<12f2x", 0, 0, 0, *each.ravel()) for each in corners)
        return bytes(80) + struct.pack("<I", len(corners) if count is None else count) + body
    rows = []
    for each in corners:
        rows += ["facet normal 0 0 0", "outer loop"]
        rows += [f"vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in each]
        rows += ["endloop", "endfacet"]
    return "\n".join(["solid a", *rows, "endsolid a", ""]).encode()


def gltf_tree(vertices, faces, uvs=None, node=None, material=None, normals=None):
    """The JSON of a glTF and its buffer."""
    data = np.asarray(vertices, "<f4").tobytes()
    views = [{"buffer": 0, "byteOffset": 0, "byteLength": len(data)}]
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3"},
        {"bufferView": 1, "componentType": 5125, "count": 3 * len(faces), "type": "SCALAR"},
    ]
    indices = np.asarray(faces, "<u4").tobytes()
    views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(indices)})
    data += indices
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    for label, values in (("TEXCOORD_0", uvs), ("NORMAL", normals)):
        if values is None:
            continue
        more = np.asarray(values, "<f4")
        primitive["attributes"][label] = len(accessors)
        accessors.append({
            "bufferView": len(views), "componentType": 5126, "count": len(more),
            "type": f"VEC{more.shape[1]}",
        })  # fmt: skip
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": more.nbytes})
        data += more.tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **(node or {})}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    if material is not None:
        tree["materials"] = [material]
        primitive["material"] = 0
    return tree, data


def glb(tree, data):
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def gltf(tree, data):
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    return json.dumps({**tree, "buffers": [{"byteLength": len(data), "uri": uri}]}).encode()
