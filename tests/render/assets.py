"""Textured meshes that tests make, as files of glTF and OBJ, and their textures."""

import copy
import io
import json

import numpy as np
from PIL import Image

from tests.geometry.shapes import glb


def png(pixels):
    """The bytes of a PNG of 8-bit pixels, shape (H, W) or (H, W, channels)."""
    stream = io.BytesIO()
    Image.fromarray(np.asarray(pixels, dtype=np.uint8)).save(stream, "png")
    return stream.getvalue()


def globe(rows=48, stretch=(1.0, 1.0, 1.0)):
    """Vertices, faces, normals and texture coordinates (v down) of a globe about +Y."""
    row, column = np.mgrid[: rows + 1, : 2 * rows + 1]
    v, u = row / rows, column / (2 * rows)
    theta, phi = np.pi * v, 2 * np.pi * u
    directions = np.stack(
        [np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1
    ).reshape(-1, 3)
    first = (np.arange(rows)[:, None] * (2 * rows + 1) + np.arange(2 * rows)).ravel()
    down = first + 2 * rows + 1
    faces = np.concatenate([
        np.stack([first, down, down + 1], axis=1), np.stack([first, down + 1, first + 1], axis=1)
    ])  # fmt: skip
    normals = directions / np.array(stretch)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return directions * stretch, faces, normals, np.stack([u, v], axis=-1).reshape(-1, 2)


def textures(size=256):
    """Base colour (sRGB), roughness and metallic, and normals, 8-bit pixels of one pattern."""
    y, x = (np.mgrid[: size // 2, :size] + 0.5) / size
    tau = 2 * np.pi
    checks = (np.floor(16 * x) + np.floor(16 * y)) % 2
    color = np.stack([0.25 + 0.6 * checks, 0.5 + 0.4 * np.sin(tau * 3 * x), 0.3 + 0 * x], axis=-1)
    rough = 0.45 + 0.2 * np.sin(tau * 2 * x) * np.sin(tau * 2 * y)
    metal = 0.5 + 0.5 * np.cos(tau * 2 * x)
    packed = np.stack([0 * x, rough, metal], axis=-1)
    slope = 0.3 * np.stack([np.sin(tau * 4 * x), np.cos(tau * 6 * y)], axis=-1)
    normals = np.concatenate([slope, np.sqrt(1 - (slope**2).sum(-1, keepdims=True))], axis=-1)
    return tuple(np.round(255 * each) for each in (color, packed, (normals + 1) / 2))


def packed_glb(shape, material, pictures, samplers=(), extra=None):
    """A GLB of one mesh with a material and the pictures that it names.

    Parameters
    ----------
    shape : tuple
        Vertices, faces, normals and texture coordinates.
    material : dict
    pictures : sequence of bytes
        Files; texture k is picture k, with sampler k if there are any.
    extra : dict of str to array, optional
        More attributes of the vertices, as 32-bit floats.
    """
    vertices, faces, normals, uvs = shape
    attributes = {"POSITION": vertices, "NORMAL": normals, "TEXCOORD_0": uvs, **(extra or {})}
    views, accessors, data = [], [], b""

    def put(content):
        nonlocal data
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content)})
        data += content + bytes(-len(content) % 4)

    for values in attributes.values():
        values = np.asarray(values, "<f4")
        accessors.append({"bufferView": len(views), "componentType": 5126, "count": len(values),
                          "type": f"VEC{values.shape[1]}"})  # fmt: skip
        put(values.tobytes())
    accessors.append({"bufferView": len(views), "componentType": 5125, "count": 3 * len(faces),
                      "type": "SCALAR"})  # fmt: skip
    put(np.asarray(faces, "<u4").tobytes())
    images = []
    for picture in pictures:
        images.append({"bufferView": len(views), "mimeType": "image/png"})
        put(picture)
    primitive = {
        "attributes": {key: place for place, key in enumerate(attributes)},
        "indices": len(attributes),
        "material": 0,
    }
    names = [{"source": k, **({"sampler": k} if samplers else {})} for k in range(len(pictures))]
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
        "materials": [copy.deepcopy(material)],
        "textures": names,
        "images": images,
        "samplers": list(samplers),
    }
    return glb(json.loads(json.dumps(tree)), data)


def obj_text(shape, library, material):
    """The text of an OBJ with texture coordinates and normals, and a material of a library."""
    vertices, faces, normals, uvs = shape
    lines = [f"mtllib {library}"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [f"vt {u!r} {1 - v!r}" for u, v in uvs.tolist()]
    lines += [f"vn {x!r} {y!r} {z!r}" for x, y, z in normals.tolist()]
    lines.append(f"usemtl {material}")
    lines += ["f " + " ".join(f"{k + 1}/{k + 1}/{k + 1}" for k in face) for face in faces.tolist()]
    return "\n".join(lines) + "\n"
