"""Digests of outputs: blind to the program that wrote them, and to nothing else."""

import numpy as np
import OpenEXR
import pytest

from tests.digests import digest

PIXELS = np.arange(32, dtype=np.float32).reshape(4, 8)


def written(path, pixels=PIXELS, **attributes):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **attributes}
    OpenEXR.File(header, {"R": pixels, "G": pixels * 2}).write(str(path))
    return digest(path)


def test_the_program_that_wrote_a_file_does_not_count(tmp_path):
    program = {"shrm:program": "9.9", "shrm:sources": "ab", "shrm:digest": "cd"}
    plain = written(tmp_path / "a.exr", **{"shrm:F": 3})
    assert written(tmp_path / "b.exr", **{"shrm:F": 3}, **program) == plain
    assert (tmp_path / "a.exr").read_bytes() != (tmp_path / "b.exr").read_bytes()


@pytest.mark.parametrize(
    ("pixels", "attributes"),
    [
        (np.nextafter(PIXELS, 1, dtype=np.float32), {"shrm:F": 3}),
        (PIXELS.astype(np.float16), {"shrm:F": 3}),
        (PIXELS.reshape(8, 4), {"shrm:F": 3}),
        (PIXELS, {"shrm:F": 4}),
        (PIXELS, {}),
    ],
)
def test_all_else_counts(tmp_path, pixels, attributes):
    plain = written(tmp_path / "a.exr", **{"shrm:F": 3})
    assert written(tmp_path / "b.exr", pixels, **attributes) != plain


def test_other_files_are_bytes(tmp_path):
    (tmp_path / "a.png").write_bytes(b"a")
    (tmp_path / "b.png").write_bytes(b"b")
    assert digest(tmp_path / "a.png") != digest(tmp_path / "b.png")
