"""Numbers of glTF files: arrays within their buffers, some of whose elements others replace.

Every count, offset and index is checked against what is really there, before anything is read by
it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MeshError
from shrm_cli.files import gltf
from shrm_cli.geometry.mesh import MOST_FACES

Numbers = NDArray[Any]

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_UNSIGNED = (5121, 5123, 5125)
_MOST = 3 * MOST_FACES
"""The most elements of an array, which are the corners of all triangles."""


class Accessors:
    """The arrays of a file. `name` is its path, `tree` its JSON, and `buffers` their bytes."""

    def __init__(self, name: str, tree: gltf.Json, buffers: list[bytes]) -> None:
        self._name, self._buffers = name, buffers
        self._given = gltf.list_of(tree, "accessors")
        self._views = [gltf.view_of(each, buffers) for each in gltf.list_of(tree, "bufferViews")]
        self._known: dict[int, Numbers] = {}
        self._floats: dict[tuple[int, bool], NDArray[np.float64]] = {}
        self._read = 0

    def numbers(self, index: object, *types: str) -> Numbers:
        """Return an array as its type stores it, shape (count, columns); of one of some types."""
        place = gltf.index_in(index, self._given)
        given = gltf.table(self._given[place])
        if given["type"] not in types:
            raise ValueError(f"an accessor of type {str(given['type'])[:20]}")
        if place not in self._known:
            self._known[place] = self._found(given)
        return self._known[place]

    def values(self, index: object, *types: str, is_share: bool = False) -> NDArray[np.float64]:
        """Return an array as floats, which primitives that name it share.

        Integers that are normalized, or all of them with `is_share`, stand for fractions of the
        largest that their type holds.
        """
        numbers = self.numbers(index, *types)
        place = gltf.index_in(index, self._given)
        key = place, is_share
        if key not in self._floats:
            self._count(8 * numbers.size)
            result = numbers.astype(float)
            if numbers.dtype.kind != "f" and (is_share or self._given[place].get("normalized")):
                result = np.maximum(result / np.iinfo(numbers.dtype).max, -1)
            result.setflags(write=False)
            self._floats[key] = result
        return self._floats[key]

    def _found(self, given: gltf.Json) -> Numbers:
        count, columns = gltf.natural(given["count"]), _COLUMNS[given["type"]]
        if not 1 <= count <= _MOST:
            raise self._too_many(count)
        if "bufferView" in given:
            found = self._stored(_place(given), given["componentType"], count, columns)
        else:  # all of it is zero, but for what is replaced
            found = np.zeros((count, columns), _type(given["componentType"]))
            self._count(found.nbytes)
        if "sparse" not in given:
            return found
        changed, result = gltf.table(given["sparse"]), found.copy()
        number = gltf.natural(changed["count"])
        where, what = gltf.table(changed["indices"]), gltf.table(changed["values"])
        if where["componentType"] not in _UNSIGNED:
            raise ValueError("indices that are no natural numbers")
        rows = self._stored(_place(where), where["componentType"], number, 1)[:, 0]
        if rows.max(initial=0) >= count:
            raise ValueError("an index beyond its accessor")
        result[rows] = self._stored(_place(what), given["componentType"], number, columns)
        return result

    def _stored(
        self, place: tuple[object, object], component: object, count: int, columns: int
    ) -> Numbers:
        """Return numbers of a view of a buffer, from an offset in it on."""
        view = self._views[gltf.index_in(place[0], self._views)]
        start, kind = gltf.natural(place[1]), _type(component)
        width = columns * kind.itemsize
        stride = view.get("byteStride", width)
        if stride < width or start + (count - 1) * stride + width > view["byteLength"]:
            raise self._too_many(count)
        self._count(count * width)
        buffer, offset = self._buffers[view["buffer"]], view["byteOffset"] + start
        steps = stride, kind.itemsize
        return np.ndarray((count, columns), kind, buffer, offset, steps)

    def _count(self, size: int) -> None:
        """Refuse arrays that are read from the same bytes again and again."""
        self._read += size
        if self._read > 4 * gltf.MOST_BYTES:
            raise MeshError(
                f"{self._name}: it reads {self._read:,} bytes of its buffers; export it again"
            )

    def _too_many(self, count: int) -> MeshError:
        return MeshError(
            f"{self._name}: it declares {count:,} elements, more than its buffer holds; "
            "copy or export it again"
        )


def _type(component: object) -> np.dtype:
    if component not in _TYPES:
        raise ValueError("an accessor of no known component type")
    return np.dtype(_TYPES[component])


def _place(given: gltf.Json) -> tuple[object, object]:
    return given["bufferView"], given.get("byteOffset", 0)
