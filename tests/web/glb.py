"""A ball as a binary glTF file, for viewers that take nothing else."""

import json
import struct

import numpy as np


def ball_file(metallic, roughness, rows=128, glossy=True):
    """Bytes of a white ball of radius 1; a dielectric that is not glossy is diffuse alone."""
    theta, phi = np.meshgrid(
        np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, 2 * rows + 1), indexing="ij"
    )
    points = np.stack(
        [np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1
    )
    points = points.reshape(-1, 3).astype("<f4")
    row, column = np.meshgrid(np.arange(rows), np.arange(2 * rows), indexing="ij")
    first = (row * (2 * rows + 1) + column).ravel()
    below = first + 2 * rows + 1
    corners = np.stack([first, below, first + 1, first + 1, below, below + 1], axis=-1)
    data = points.tobytes() + corners.astype("<u4").tobytes()
    count, size = len(points), points.nbytes
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {
                "primitives": [
                    {"attributes": {"POSITION": 0, "NORMAL": 0}, "indices": 1, "material": 0}
                ]
            }
        ],
        "materials": [
            {
                "pbrMetallicRoughness": {
                    "baseColorFactor": [1, 1, 1, 1],
                    "metallicFactor": metallic,
                    "roughnessFactor": roughness,
                },
                "extensions": {} if glossy else {"KHR_materials_specular": {"specularFactor": 0}},
            }
        ],
        "extensionsUsed": [] if glossy else ["KHR_materials_specular"],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": size},
            {"buffer": 0, "byteOffset": size, "byteLength": len(data) - size},
        ],
        "accessors": [
            {
                "bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3",
                "min": [-1, -1, -1], "max": [1, 1, 1],
            },
            {
                "bufferView": 1, "componentType": 5125, "count": corners.size, "type": "SCALAR",
            },
        ],
    }  # fmt: skip
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
