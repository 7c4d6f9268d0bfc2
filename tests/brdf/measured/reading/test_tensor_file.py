"""Tensor files: arrays as written, and headers that lie."""

import struct
import time
import tracemalloc

import numpy as np
import pytest

from shrm_cli.brdf.measured.reading.tensor_file import TensorFile
from shrm_cli.errors import BrdfError
from tests.brdf.measured.rgl_files import material, tensor_file

HUGE = 2**63


def test_arrays_come_back(tmp_path):
    fields = {
        "a": np.arange(6, dtype="f4").reshape(1, 2, 3),
        "words": np.frombuffer(b"abc", dtype="u1"),
        "b": np.array([[1.5, -2.5]]),
    }
    path = tmp_path / "x.bsdf"
    path.write_bytes(tensor_file(fields))
    found = TensorFile.open(path)
    assert set(found.fields) == set(fields)
    for name, values in fields.items():
        read = found.read(name)
        assert read.dtype == values.dtype
        np.testing.assert_array_equal(read, values)
    with pytest.raises(BrdfError, match=r"x\.bsdf: .*no field 'c'"):
        found.read("c")


def lies():
    """Bytes of files that are damaged, and a word of what is to be said."""
    whole = material()
    size = len(tensor_file(whole))
    return {
        "nothing": (b"", "not an RGL"),
        "magic only": (b"tensor_file\0", "header ends"),
        "version": (tensor_file(whole, version=(2, 0)), "version"),
        "endless fields": (tensor_file(whole, count=2**32 - 1), "4,294,967,295 fields"),
        "more fields": (tensor_file(whole, count=11), "damaged"),
        "beyond": (tensor_file({**whole, "rgb": (size, (5, 5), "f4")}), "beyond"),
        "far": (tensor_file({**whole, "rgb": (HUGE, (5, 5), "f4")}), "beyond"),
        "huge": (tensor_file({**whole, "rgb": (size - 9, (HUGE, HUGE, HUGE), "f4")}), "beyond"),
        "wraps": (tensor_file({**whole, "rgb": (size - 9, (2**32, 2**32), "f4")}), "beyond"),
        "in the header": (tensor_file({"a": (20, (4,), "u1")}) + bytes(99), "lies over"),
        "overlap": (
            tensor_file({"a": (200, (9,), "f4"), "b": (204, (2,), "u1")}) + bytes(400),
            "'b' lies over",
        ),
        "empty": (tensor_file({**whole, "rgb": np.zeros((1, 0), "f4")}), "'rgb' is empty"),
        "many axes": (tensor_file({"a": (900, (1,) * 200, "u1")}) + bytes(2000), "200 axes"),
        "type": (b"tensor_file\0\1\0" + struct.pack("<IH", 1, 1) + b"a" + bytes(40), "type 0"),
        "long name": (b"tensor_file\0\1\0" + struct.pack("<IH", 1, 65535) + bytes(99), "65,535"),
        "twins": (
            tensor_file({"a": np.zeros(1, "f4"), "B": np.zeros(1, "f4")}).replace(b"B", b"a"),
            "same name",
        ),
    }


@pytest.mark.parametrize("case", lies())
def test_lies_are_refused_at_once(tmp_path, case):
    content, word = lies()[case]
    path = tmp_path / "lie.bsdf"
    path.write_bytes(content)
    tracemalloc.start()
    start = time.process_time()
    with pytest.raises(BrdfError, match=word) as caught:
        TensorFile.open(path)
    assert time.process_time() - start < 1
    assert tracemalloc.get_traced_memory()[1] < 2**22
    tracemalloc.stop()
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_large_array_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "sparse.bsdf"
    header = tensor_file({"a": (100, (2**27,), "f4")})
    with open(path, "wb") as stream:
        stream.write(header)
        stream.truncate(100 + 2**29)
    with pytest.raises(BrdfError, match="536,870,912 bytes"):
        TensorFile.open(path).read("a")


def test_a_file_that_shrinks_is_noticed(tmp_path):
    path = tmp_path / "x.bsdf"
    path.write_bytes(tensor_file({"a": np.zeros(100, "f4")}))
    opened = TensorFile.open(path)
    path.write_bytes(path.read_bytes()[:-4])
    with pytest.raises(BrdfError, match="'a' ends too early"):
        opened.read("a")
    path.unlink()
    with pytest.raises(BrdfError, match="cannot be read"):
        opened.read("a")
