"""A glTF file that an image-based light is put into; what comes out is one GLB.

Everything of the file stays as it is, extensions included. Buffers and pictures in files of their
own, which have to lie in its folder or below it, move into the GLB, so that it can lie anywhere.
"""

from copy import deepcopy
from os.path import getsize
from pathlib import Path

from shrm_cli.errors import MapError, MeshError
from shrm_cli.files import gltf
from shrm_cli.files.whole import check_regular, note
from shrm_cli.records import record

EXTENSION = "EXT_lights_image_based"
_COMPRESSED = "EXT_meshopt_compression"
"""What has offsets of its own into buffers, some of which exist in no file."""
_TYPES = {
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".webp": "image/webp",
    ".ktx2": "image/ktx2",
}


_MOST_BYTES = 2**20
"""The most bytes of a glTF file that holds nothing but a light."""


def read_light_facts(path: str) -> gltf.Json | None:
    """Return what a glTF file without meshes says of its light; None of another file."""
    if Path(path).suffix.lower() not in (".gltf", ".glb") or getsize(path) > _MOST_BYTES:
        return None
    try:
        tree, _ = gltf.read_tree(path, Path(path).read_bytes())
        light = tree["extensions"][EXTENSION]["lights"][0]
        if gltf.list_of(tree, "meshes"):
            return None
        return {
            "kind": f"light of glTF ({EXTENSION})",
            "width": gltf.natural(light["specularImageSize"]),
            "levels": len(gltf.list_of(light, "specularImages")),
            "bytes": getsize(path),
        }
    except (MeshError, ValueError, TypeError, LookupError):
        return None


@record
class Asset:
    """A glTF file with all that it needs."""

    path: str
    """The path of the file."""
    tree: gltf.Json
    """Its JSON, in which all views are of one buffer."""
    data: bytes
    """This buffer."""

    @property
    def scenes(self) -> int:
        return len(self.tree["scenes"])

    def lit(self, light: gltf.Json, pictures: list[bytes]) -> bytes:
        """Return a GLB in all scenes of which a light is.

        `light` is what the extension wants of a light; its images are counted from 0. `pictures`
        are PNG files, which are these images.
        """
        tree, data = deepcopy(self.tree), bytearray(self.data)
        images = tree.setdefault("images", [])
        first = len(images)
        for picture in pictures:
            images.append({"mimeType": "image/png", "bufferView": _added(tree, data, picture)})
        numbered = [[first + k for k in faces] for faces in light["specularImages"]]
        lights = (
            tree.setdefault("extensions", {}).setdefault(EXTENSION, {}).setdefault("lights", [])
        )
        lights.append({**light, "specularImages": numbered})
        for scene in tree["scenes"]:
            scene.setdefault("extensions", {})[EXTENSION] = {"light": len(lights) - 1}
        used = tree.setdefault("extensionsUsed", [])
        if EXTENSION not in used:
            used.append(EXTENSION)
        size = _padded(data, to=4)
        return gltf.glb({**tree, "buffers": [{"byteLength": size}]}, [data])


def open_asset(path: str) -> Asset:
    """Read a glTF or GLB file, and what lies beside it."""
    try:
        if check_regular(path, MapError, "a glTF file").st_size > gltf.MOST_BYTES:
            raise MapError(f"{path}: larger than {gltf.MOST_BYTES:,} bytes; simplify it")
        content = Path(path).read_bytes()
    except OSError as error:
        raise MapError(f"{path}: cannot be read ({error.strerror}); name a glTF file") from error
    note(path)
    tree, chunk = gltf.read_tree(path, content)
    with gltf.damage(path, MapError):
        return _opened(path, tree, chunk)


def _opened(path: str, tree: gltf.Json, chunk: bytes | None) -> Asset:
    if _COMPRESSED in gltf.list_of(tree, "extensionsUsed"):
        raise MapError(f"{path}: it is compressed ({_COMPRESSED}); add the light before that")
    if not gltf.list_of(tree, "scenes"):
        raise MapError(f"{path}: it has no scene that light could be in; export it with one")
    for scene in gltf.list_of(tree, "scenes"):
        gltf.table(gltf.table(scene).get("extensions", {}))
    known = gltf.table(gltf.table(tree.get("extensions", {})).get(EXTENSION, {}))
    gltf.list_of(known, "lights")
    data, starts = bytearray(), []
    buffers = gltf.buffers_of(path, tree, chunk)
    for each in buffers:
        starts.append(_padded(data))
        data += each
    for each in gltf.list_of(tree, "bufferViews"):
        found = gltf.view_of(each, buffers)
        each["byteOffset"] = starts[found["buffer"]] + found["byteOffset"]
        each["buffer"] = 0
    for image in gltf.list_of(tree, "images"):
        _embed(path, tree, data, image)
    return Asset(path, tree, bytes(data))


def _embed(path: str, tree: gltf.Json, data: bytearray, image: gltf.Json) -> None:
    """Move a picture that lies beside a file into its buffer."""
    uri = str(gltf.table(image).get("uri", "data:"))
    if uri.startswith("data:"):
        return
    kind = _TYPES.get(Path(uri).suffix.lower())
    if kind is None:
        raise MapError(f"{path}: {uri[:80]!r} is no PNG, JPEG, WebP or KTX 2 picture; convert it")
    view = _added(tree, data, gltf.bytes_at(path, uri, gltf.MOST_BYTES, "picture"))
    del image["uri"]
    image.update(mimeType=image.get("mimeType", kind), bufferView=view)


def _added(tree: gltf.Json, data: bytearray, piece: bytes) -> int:
    """Append bytes to a buffer, and return the number of their view."""
    views: list[gltf.Json] = tree.setdefault("bufferViews", [])
    views.append({"buffer": 0, "byteOffset": _padded(data), "byteLength": len(piece)})
    data += piece
    return len(views) - 1


def _padded(data: bytearray, to: int = 8) -> int:
    """Fill up to a multiple of some bytes, as accessors want their places; return the length."""
    data += bytes(-len(data) % to)
    return len(data)
