"""KTX 2 files of `shrm export`, read by the npm package ktx-parse; node runs it."""

import json
import subprocess

import numpy as np
import pytest

from shrm_cli.export.ktx import ktx2
from shrm_cli.export.packing import ALL
from shrm_cli.export.pixels import encoded
from tests.web.browser import MODULES

READ = """
const fs = require('fs');
import(process.argv[1]).then(({ read }) => {
    const found = read(new Uint8Array(fs.readFileSync(process.argv[2])));
    console.log(JSON.stringify({
        vkFormat: found.vkFormat, typeSize: found.typeSize, faceCount: found.faceCount,
        width: found.pixelWidth, height: found.pixelHeight, depth: found.pixelDepth,
        scheme: found.supercompressionScheme, pairs: found.keyValue,
        lengths: found.levels.map((each) => each.uncompressedByteLength),
        first: Array.from(found.levels[0].levelData.slice(0, 16)),
        descriptor: found.dataFormatDescriptor[0],
    }));
});
"""


@pytest.fixture(scope="module")
def parse():
    """Return a function that reads a file by ktx-parse."""
    (script,) = (MODULES / "ktx-parse" / "dist").glob("*.mjs")

    def read(path):
        done = subprocess.run(
            ["node", "-e", READ, str(script), str(path)],
            capture_output=True, text=True, timeout=60,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return read


@pytest.mark.parametrize("compress", [False, True])
@pytest.mark.parametrize(
    ("name", "number"),
    [("rgba16f", 97), ("r11g11b10", 122), ("rgb9e5", 123), ("bc6h", 143), ("uastc", 1000066000)],
)
def test_ktx_parse_reads_what_is_written(parse, tmp_path, rng, name, number, compress):
    texels = ALL[name]
    mips = [
        encoded(rng.uniform(size=(6, size, size, 3)), texels, "")[0] for size in (32, 16, 8, 4)
    ]  # fmt: skip
    (tmp_path / "cube.ktx2").write_bytes(ktx2(mips, (32, 32, 0), texels, compress, 6))
    found = parse(tmp_path / "cube.ktx2")
    type_size = {"rgba16f": 2, "bc6h": 1, "uastc": 1}.get(name, 4)
    assert (found["vkFormat"], found["typeSize"]) == (number, type_size)
    assert (found["width"], found["height"], found["depth"], found["faceCount"]) == (32, 32, 0, 6)
    assert found["scheme"] == (2 if compress else 0)
    assert found["pairs"]["KTXwriter"].startswith("shrm ")
    assert found["lengths"] == [len(mip) for mip in mips]
    if not compress:
        assert bytes(found["first"]) == mips[0][:16]
    descriptor = found["descriptor"]
    assert (descriptor["colorModel"], descriptor["transferFunction"]) == (
        {"bc6h": 133, "uastc": 167}.get(name, 1), 1
    )  # fmt: skip
    assert descriptor["texelBlockDimension"][:2] == [texels.edge - 1] * 2
    assert descriptor["bytesPlane"][0] == texels.size
    bits = [(each["bitOffset"], each["bitLength"] + 1) for each in descriptor["samples"]]
    covered = np.zeros(8 * texels.size, dtype=int)
    for offset, length in bits:
        covered[offset : offset + length] += 1
    assert (covered > 0).all()  # every bit of a texel is somebody's
