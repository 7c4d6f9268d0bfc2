"""A glTF file with a light of ours in it: Khronos' validator reads it, and Babylon.js shows it."""

import json
import subprocess

import numpy as np

from shrm_cli.export.engine import engine
from shrm_cli.export.make import Asked, Source, packaged, write
from tests.web import ball, proofs
from tests.web.browser import MODULES, Page
from tests.web.glb import ball_file

VALIDATE = """const validator = require(process.argv[1]);
const data = new Uint8Array(require("fs").readFileSync(process.argv[2]));
validator.validateBytes(data).then((report) => console.log(JSON.stringify(report)));"""


def lit(folder):
    """Write a ball with a light in it, and return its path, and that of the light alone."""
    probe = proofs.made_probe()
    (folder / "ball.glb").write_bytes(ball_file(1.0, 0.2, rows=16))
    for name, into in (("asset", str(folder / "ball.glb")), ("alone", None)):
        source = Source("light", "light.exr", probe)
        write(packaged(source, engine("gltf"), Asked(size=64, into=into)), folder / name)
    return folder / "asset" / "light_ball.glb", folder / "alone" / "light.gltf"


def validated(path):
    """What Khronos' validator says of a file."""
    command = ["node", "-e", VALIDATE, str(MODULES / "gltf-validator"), str(path)]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)


def test_khronos_validator_finds_nothing(tmp_path):
    path, _ = lit(tmp_path)
    report = validated(path)
    assert report["issues"]["numErrors"] == report["issues"]["numWarnings"] == 0
    # It does not know the extension, and says so; what it knows is that its pictures are images.
    before, after = (
        {each["code"] for each in found["issues"]["messages"]}
        for found in (validated(tmp_path / "ball.glb"), report)
    )
    assert after - before == {"UNSUPPORTED_EXTENSION", "UNUSED_OBJECT"}
    assert report["info"]["extensionsUsed"] == ["EXT_lights_image_based"]
    pictures = [each for each in report["info"]["resources"] if each["pointer"][:8] == "/images/"]
    assert [each["mimeType"] for each in pictures] == ["image/png"] * 18


def test_babylon_finds_the_same_light_in_it(browser, site):
    folder, address = site
    proofs.prepare(folder, "babylon")
    faces = []
    for path in lit(folder):
        page = Page(browser, address, "babylon.bundle.js")
        page.call("start", 64, True, proofs.VIEW)
        page.call("environmentOfGltf", f"{address}/{path.relative_to(folder)}")
        found = [
            [ball.decoded(page.call("texels", k, m), 64 >> m) for k in range(6)] for m in (0, 2)
        ]
        faces.append(found)
        shown = ball.decoded(page.call("shade", 0.2), 64)
        assert shown.std() > 0.1
        assert not page.errors
        page.close()
    for ours, theirs in zip(*faces, strict=True):
        assert np.array_equal(ours, theirs)
