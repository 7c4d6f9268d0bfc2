"""DDS cubes of floats, which image libraries do not read, and cubes that lack faces."""

import struct

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe.open import open_probe
from tests.probe import scenes

SIZE = 8
FORMATS = {113: np.float16, 116: np.float32}
ALL, NO_MINUS_Y = 0xFC00, 0xFC00 & ~0x2000


def write(path, faces, code=113, levels=1, caps=0x200 | ALL, height=None, dx10=None, depth=0):
    """A DDS file of floats as the DirectX SDK's manual lays it out, 32-bit words one by one."""
    size = faces.shape[2]
    four = b"DX10" if dx10 else struct.pack("<I", code)
    words = [124, 0x2100F, height or faces.shape[1], size, 0, depth, levels, *[0] * 11]
    head = b"DDS " + struct.pack("<18I", *words) + struct.pack("<II", 32, 4) + four
    head += struct.pack("<5I", *[0] * 5) + struct.pack("<5I", 0x401008, caps, 0, 0, 0)
    assert len(head) == 128
    if dx10:
        head += struct.pack("<5I", dx10, 3, 4, 1, 0)
    dtype = FORMATS[{10: 113, 2: 116}[dx10] if dx10 else code]
    body = b""
    for face in faces:
        alpha = np.full((*face.shape[:2], 1), 0.5)
        body += np.concatenate([face, alpha], axis=-1).astype(dtype).tobytes()
        for level in range(1, levels):  # whose content must not matter
            side = max(size >> level, 1)
            body += np.full((side, side, 4), 9, dtype).tobytes()
    path.write_bytes(head + body)
    return path


@pytest.mark.parametrize("levels", [1, 2, 4])
@pytest.mark.parametrize(("code", "dx10"), [(113, None), (116, None), (113, 10), (116, 2)])
def test_cubes_of_floats(tmp_path, code, dx10, levels):
    faces = scenes.cube_faces(SIZE, orientation="gl")
    path = write(tmp_path / "a.dds", faces, code, levels, dx10=dx10)
    probe = open_probe(path)
    assert (probe.layout, probe.orientation, probe.height) == ("openexr", "gl", 6 * SIZE)
    tolerance = 1e-3 if code == 113 else 1e-6
    expected = scenes.cube_faces(SIZE).reshape(6 * SIZE, SIZE, 3)
    np.testing.assert_allclose(probe.image(), expected, rtol=tolerance)
    stacked = faces.reshape(6 * SIZE, SIZE, 3)
    np.testing.assert_allclose(probe.images[0].read(5, 29), stacked[5:29], rtol=tolerance)


def test_a_latlong_of_floats(tmp_path):
    image = scenes.latlong(16)
    probe = open_probe(write(tmp_path / "a.dds", image[None], 116, caps=0))
    assert (probe.layout, probe.orientation) == ("latlong", None)
    np.testing.assert_allclose(probe.image(), image, rtol=1e-6)


def test_missing_faces(tmp_path):
    """Of floats, and of 8 bits, whose missing faces the library shows as black."""
    path = write(tmp_path / "a.dds", np.ones((5, SIZE, SIZE, 3)), caps=0x200 | NO_MINUS_Y)
    with pytest.raises(ProbeError, match="without its faces -Y; export all six"):
        open_probe(path)
    path = scenes.write_dds_cube(tmp_path / "b.dds", np.ones((6, SIZE, SIZE, 3), np.uint8))
    open_probe(path, linearize=True)
    data = bytearray(path.read_bytes())
    data[112:116] = struct.pack("<I", 0x200 | 0x3C00)
    path.write_bytes(data)
    with pytest.raises(ProbeError, match="without its faces \\+Z, -Z; export all six"):
        open_probe(path, linearize=True)


CASES = {
    "cut short": (lambda f: write(f, np.ones((6, SIZE, SIZE, 3))), 1, "damaged or truncated"),
    "cut in the header": (lambda f: write(f, np.ones((6, 2, 2, 3))), 250, "damaged or truncated"),
    "not square": (lambda f: write(f, np.ones((6, 4, 8, 3))), 0, "8 x 4 are not square"),
    "too large": (
        lambda f: write(f, np.ones((6, 2, 2, 3)), height=10**6), 0, "x 1000000 pixels are not 1",
    ),
    "a volume": (
        lambda f: write(f, np.ones((6, 2, 2, 3)), caps=0x200000, depth=6), 0, "a volume",
    ),
    "more levels than bytes": (
        lambda f: write(f, np.ones((6, SIZE, SIZE, 3)), levels=2), 700, "damaged or truncated",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_files_of_no_use(tmp_path, case):
    make, lost, message = CASES[case]
    path = make(tmp_path / "a.dds")
    path.write_bytes(path.read_bytes()[: -lost or None])
    with pytest.raises(ProbeError, match=f"{message}.*; "):
        open_probe(path)


def test_parts_of_a_dds_file(tmp_path):
    path = write(tmp_path / "a.dds", np.ones((6, SIZE, SIZE, 3)))
    with pytest.raises(ProbeError, match="no parts or layers; leave"):
        open_probe(path, part="beauty")
