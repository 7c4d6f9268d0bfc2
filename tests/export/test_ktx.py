"""KTX 1 and KTX 2, read again byte by byte as their specifications have it."""

import pytest

from shrm_cli.errors import MapError
from shrm_cli.export.ktx import ktx1_cube, ktx2, read_ktx1_facts, read_ktx2_facts
from shrm_cli.export.pixels import FORMATS, encoded
from tests.export.readers import read_ktx1, read_ktx2


@pytest.fixture
def mips(rng):
    """Return mips of shape (6, N, N, 3) whose numbers all formats hold."""
    return [rng.integers(0, 16, size=(6, size, size, 3)).astype(float) for size in (8, 4, 2, 1)]


def packed(mips, name):
    return [encoded(mip, FORMATS[name], "")[0] for mip in mips]


@pytest.mark.parametrize("name", ["r11g11b10", "rgba16f"])
def test_ktx1_holds_mips_and_metadata(mips, name):
    data = ktx1_cube(packed(mips, name), 8, FORMATS[name], {"sh": "1 2 3", "other": "x"})
    found = read_ktx1(data)
    assert found.pairs == {"sh": b"1 2 3\0", "other": b"x\0"}
    for got, wanted in zip(found.mips, mips, strict=True):
        assert (got == wanted).all()
    if name == "r11g11b10":  # what Filament's Ktx1Reader knows
        assert found.header["glType"] == 0x8C3A
        assert found.header["glFormat"] == 0x1907


@pytest.mark.parametrize("compress", [False, True])
@pytest.mark.parametrize("name", FORMATS)
def test_ktx2_holds_mips(mips, name, compress):
    if compress:
        pytest.importorskip("zstandard", reason="the extra export is not installed")
    found = read_ktx2(ktx2(packed(mips, name), (8, 8, 0), FORMATS[name], compress, 6))
    assert found.header["texels"] == name
    assert found.header["supercompressionScheme"] == (2 if compress else 0)
    assert found.pairs["KTXwriter"].startswith(b"shrm ")
    for got, wanted in zip(found.mips, mips, strict=True):
        assert (got == wanted).all()


def test_the_descriptors_are_those_of_the_specification(mips):
    """Tables 94 to 96 of the Khronos Data Format Specification 1.3, and Vulkan's formats."""
    one, minus_one = 0x3F800000, 0xBF800000
    wanted = {
        "rgba16f": [(0xC0 | c, 16 * k, 16, minus_one, one) for k, c in enumerate((0, 1, 2, 15))],
        "r11g11b10": [(0x80, 0, 11, 0, one), (0x81, 11, 11, 0, one), (0x82, 22, 10, 0, one)],
        "rgb9e5": [
            sample
            for c in range(3)
            for sample in ((c, 9 * c, 9, 0, 8448), (0x20 | c, 27, 5, 15, 31))
        ],
    }
    for name, samples in wanted.items():
        found = read_ktx2(ktx2(packed(mips, name), (8, 8, 0), FORMATS[name], False, 6))
        assert found.header["samples"] == samples


@pytest.mark.parametrize("version", [1, 2])
def test_files_that_are_cut_are_refused(mips, tmp_path, version):
    levels, texels = packed(mips, "r11g11b10"), FORMATS["r11g11b10"]
    if version == 1:
        data, facts = ktx1_cube(levels, 8, texels, {"sh": "1 2 3"}), read_ktx1_facts
    else:
        data, facts = ktx2(levels, (8, 8, 0), texels, False, 6), read_ktx2_facts
    path = tmp_path / "a.ktx"
    path.write_bytes(data)
    told = facts(path)
    assert (told["holds"], told["width"], told["mips"]) == ("a cube", 8, 4)
    assert (told["texels"], told["bytes"]) == ("r11g11b10", len(data))
    for kept in (*range(12, 300), len(data) // 2, len(data) - 1):
        path.write_bytes(data[:kept])
        with pytest.raises(MapError, match=r"damaged or truncated; export it again$"):
            facts(path)


def test_levels_that_no_file_has_are_refused(mips, tmp_path):
    data = bytearray(ktx2(packed(mips, "rgb9e5"), (8, 8, 0), FORMATS["rgb9e5"], False, 6))
    for place, value in ((40, 2**32 - 1), (84, 2**32 - 1), (92, 2**32 - 1)):  # of levels and bytes
        lying = bytearray(data)
        lying[place : place + 4] = value.to_bytes(4, "little")
        (tmp_path / "a.ktx2").write_bytes(lying)
        with pytest.raises(MapError, match="damaged or truncated"):
            read_ktx2_facts(tmp_path / "a.ktx2")
