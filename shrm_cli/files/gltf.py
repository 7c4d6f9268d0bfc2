"""What readers of glTF share: the JSON and the binary chunk of a file, buffers, and checked values.

Files may come from anywhere. Every count, offset and index is checked against what is really there.
Only files in the folder of a glTF file, or below it, are opened for it.
"""

import base64
import binascii
import json
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from shrm_cli.errors import MeshError, ShrmError
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.texture import referenced_file
from shrm_cli.files.whole import note

Json = dict[str, Any]

MOST_BYTES = 2**28
"""The most bytes of a file, and of all buffers of a glTF together."""
GLB_HEAD, JSON, BIN = b"glTF", b"JSON", b"BIN\0"
"""How a GLB begins, and the kinds of its chunks."""
MOST_ITEMS = 2**16
"""The most nodes, meshes, primitives, accessors and the like."""
_MOST_DEPTH = 64


def read_tree(name: str, data: bytes) -> tuple[Json, bytes | None]:
    """Return the JSON of a glTF or GLB file, and the binary chunk of a GLB."""
    text, chunk = _chunks(name, data) if data.startswith(GLB_HEAD) else (data, None)
    try:
        tree = table(parse_json(text.decode("utf-8-sig"), most_depth=_MOST_DEPTH))
        version = str(table(tree.get("asset", {})).get("version", ""))
    except (ValueError, RecursionError) as error:
        if not text.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
            raise MeshError(f"{name}: no glTF file; export it as glTF 2") from error
        raise MeshError(
            f"{name}: its JSON is damaged ({str(error)[:80]}); export it again"
        ) from error
    if not version.startswith("2"):
        raise MeshError(f"{name}: glTF of version {version[:10]!r}; export it as glTF 2")
    return tree, chunk


@contextmanager
def damage(name: str, error: type[ShrmError]) -> Iterator[None]:
    """Raise an error that names the file for whatever its JSON makes Python raise."""
    try:
        yield
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, OverflowError) as found:
        why = " ".join(str(found).split())[:80]
        raise error(f"{name}: its glTF is damaged ({why}); export it again") from found


def _chunks(name: str, data: bytes) -> tuple[bytes, bytes | None]:
    """Return the text of a GLB and its binary chunk."""
    if len(data) < 20 or data[4:8] != b"\2\0\0\0":
        raise MeshError(f"{name}: not GLB of version 2; export it as glTF 2")
    found: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= len(data):
        size, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        if at + 8 + size > len(data):
            raise MeshError(f"{name}: it ends within a chunk; copy or export it again")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if JSON not in found:
        raise MeshError(f"{name}: it has no JSON; export it again")
    return found[JSON], found.get(BIN)


def glb(tree: Json, buffers: Sequence[bytes | bytearray]) -> bytes:
    """Return a GLB of version 2, with the JSON and a binary chunk for each buffer."""
    texts = [_chunk(json.dumps(tree).encode(), JSON, b" ")]
    whole = b"".join(texts + [_chunk(each, BIN, b"\0") for each in buffers])
    return struct.pack("<4sII", GLB_HEAD, 2, 12 + len(whole)) + whole


def _chunk(data: bytes | bytearray, kind: bytes, filling: bytes) -> bytes:
    rest = -len(data) % 4
    return struct.pack("<I4s", len(data) + rest, kind) + data + rest * filling


def buffers_of(name: str, tree: Json, chunk: bytes | None) -> list[bytes]:
    """Return the bytes of all buffers, of a GLB's chunk and of files beside it."""
    found, total = [], 0
    for index, each in enumerate(list_of(tree, "buffers")):
        size, uri = natural(each["byteLength"]), each.get("uri")
        if size + total > MOST_BYTES:
            raise MeshError(f"{name}: its buffers exceed {MOST_BYTES:,} bytes; simplify the mesh")
        if uri is None:
            if index or chunk is None:
                raise ValueError("a buffer without its bytes")
            data = chunk
        else:
            data = bytes_at(name, str(uri), size)
        if len(data) < size:
            raise MeshError(
                f"{name}: a buffer of {size:,} bytes has {len(data):,}; copy or export it again"
            )
        found.append(data[:size])
        total += size
    return found


def bytes_at(name: str, uri: str, most: int, what: str = "buffer") -> bytes:
    """Return the bytes at an address of a glTF file: those in the text, or a file's beside it.

    `most` is how many bytes are read of a file, at most. `what` is what the bytes are, for
    messages.
    """
    if uri.startswith("data:"):
        return embedded(uri)
    try:
        path = referenced_file(name, unquote(uri), what)
    except ValueError as error:
        raise MeshError(f"{name}: {error}") from None
    try:
        note(path)
        with open(path, "rb") as stream:
            return stream.read(most)
    except OSError as error:
        raise MeshError(f"{path}: cannot be read ({error.strerror}); copy it again") from error


def embedded(uri: str) -> bytes:
    """Return the bytes that an address ``data:...;base64,...`` holds itself."""
    _, comma, payload = uri.partition(";base64,")
    if not comma:
        raise ValueError("data that are not base64")
    try:
        return base64.b64decode(payload, validate=True)
    except binascii.Error:
        raise ValueError("data that are not base64") from None


def picture_of(
    name: str, tree: Json, buffers: Callable[[], list[bytes]], texture: Json
) -> Path | bytes:
    """Return the picture of a texture: its file, or the bytes that the glTF file holds.

    Raises ValueError if it is not beside the file, or no PNG or JPEG.
    """
    if "source" not in texture:
        raise ValueError("a texture that is neither PNG nor JPEG; export it so")
    images = list_of(tree, "images")
    image = table(images[index_in(texture["source"], images)])
    if "uri" in image:
        uri = str(image["uri"])
        return embedded(uri) if uri.startswith("data:") else referenced_file(name, unquote(uri))
    views = list_of(tree, "bufferViews")
    held = buffers()
    view = view_of(table(views[index_in(image["bufferView"], views)]), held)
    start = view["byteOffset"]
    return held[view["buffer"]][start : start + view["byteLength"]]


def view_of(given: Json, buffers: list[bytes]) -> Json:
    """Return a view of the buffers, within the one that it names."""
    index = index_in(given["buffer"], buffers)
    start, length = natural(given.get("byteOffset", 0)), natural(given["byteLength"])
    if start + length > len(buffers[index]):
        raise ValueError("a view beyond its buffer")
    result = {"buffer": index, "byteOffset": start, "byteLength": length}
    if "byteStride" in given:
        result["byteStride"] = natural(given["byteStride"])
    return result


# ---- values of JSON, which may be of any type ----------------------------------------------------


def list_of(given: Any, key: str, required: bool = False) -> list[Any]:
    """Return a list of a table, which is empty where it may be missing."""
    values = table(given)[key] if required else table(given).get(key, [])
    if not isinstance(values, list) or len(values) > MOST_ITEMS:
        raise ValueError(f"its {key} are no list, or too many")
    return values


def table(value: Any) -> Json:
    """Return a value that is a table."""
    if not isinstance(value, dict):
        raise ValueError("a value in place of a table")
    return value


def natural(value: Any) -> int:
    """Return a value that is a count or an offset."""
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 2**40:
        raise ValueError("a count or offset that is no natural number")
    return value


def index_in(value: Any, of: list[Any]) -> int:
    """Return a value that is an index of a list."""
    if natural(value) >= len(of):
        raise ValueError("an index beyond its list")
    return int(value)
