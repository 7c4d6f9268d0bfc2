"""Every export for engines of the web, loaded and shaded by the engine itself.

Where a light is mirrored along any axis, the pictures differ dozens of times as much as the bounds
allow.
"""

import base64
import json
import re

import numpy as np
import pytest

from shrm_cli.export.blocks import uastc
from shrm_cli.export.cubes import to_lookup
from shrm_cli.export.engine import engine
from shrm_cli.export.engines.three import LOOKUP
from shrm_cli.export.make import Asked, Source, packaged, write
from shrm_cli.export.packing import ALL
from shrm_cli.export.pixels import encoded
from shrm_cli.maps.splitsum.tap_shader import taps_code
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import DEFAULT_TAPS
from tests import ggx
from tests.brute_force import latlong_samples
from tests.cli.helpers import ROOT
from tests.web import proofs, viewer

ROUGHNESSES = (0.0, 0.2, 0.5, 1.0)
UNSIGNED_BC6H = 36495
"""three.js' number of the format, which is OpenGL's."""


@pytest.fixture(scope="module")
def probe():
    return proofs.made_probe()


def assert_shaded(proof, address):
    assert not proof.errors
    assert all(url.startswith((address, "data:", "blob:")) for url in proof.requests)
    assert [row.what for row in proof.rows[: len(ROUGHNESSES)]] == [f"{r:g}" for r in ROUGHNESSES]
    for row in proof.rows:
        assert row.rms < 0.02, row
        assert row.turned > 20, row
        if row.what.startswith("diffuse"):
            assert row.largest < 0.02, row
    # With little roughness no engine bends its lobe, or adds light that meets several facets.
    assert next(row for row in proof.rows if row.what == "0.2").to_shrm < 0.04


def test_three(browser, site, probe):
    folder, address = site
    proofs.prepare(folder, "three")
    proof = proofs.three(browser, folder, address, probe, 64, ROUGHNESSES, pixels=192)
    assert_shaded(proof, address)
    assert len(proof.rows) == len(ROUGHNESSES) + 2


def test_three_reads_blocks(browser, site, probe):
    """Light in BC6H beside the shading of the same light before it was packed."""
    folder, address = site
    proofs.prepare(folder, "three")
    proof = proofs.three(browser, folder, address, probe, 64, ROUGHNESSES, 192, "bc6h")
    assert not proof.errors
    for row in proof.rows:
        assert row.rms < 0.02, row
        assert row.turned > 10, row


@pytest.mark.parametrize("build", ["webgl", "webgpu"])
def test_three_s_own_loader(browser, site, probe, build):
    """UASTC HDR, which its transcoder makes BC6H of, under both of its renderers.

    The blocks are those that our losses are measured with; the picture is as far from that of the
    light before it was packed as these losses say, besides what any texels are.
    """
    folder, address = site
    proofs.prepare_three(folder, build)
    proof = proofs.three(
        browser, folder, address, probe, 64, ROUGHNESSES, 192, "uastc", build=build
    )
    assert not proof.errors
    assert proof.facts["loaded"]["format"] == UNSIGNED_BC6H
    levels = [to_lookup(level, LOOKUP) for level in proof.facts["light"].levels]
    for k, level in enumerate(levels):
        ours = uastc.to_bc6h(encoded(level, ALL["uastc"], "")[0])
        found = [base64.b64decode(face[k]) for face in proof.facts["loaded"]["blocks"]]
        assert b"".join(found) == ours
    lost = max(each.rms for each in proof.facts["losses"])
    assert lost < 0.05
    for row in proof.rows:
        assert row.rms < 0.02 + lost, row
        assert row.turned > 5, row


def test_three_s_own_loader_without_blocks(browser, site, probe):
    """On a device that reads neither BC6H nor ASTC, the transcoder makes half floats."""
    folder, address = site
    proofs.prepare_three(folder, "webgl")
    proofs.exported(folder / "three", "three", probe, 64, "uastc")
    page = proofs.Page(browser, address, "webgl.bundle.js")
    page.call("start", 64, proofs.VIEW)
    pictures = []
    for has_blocks in (True, False):
        loaded = page.call("stock", f"{address}/three/light.ktx2", f"{address}/basis/", has_blocks)
        assert (loaded["format"] == UNSIGNED_BC6H) == has_blocks
        pictures.append(proofs.ball.decoded(page.call("shade", 0.2), 64))
    assert not page.errors
    page.close()
    assert 1e-5 < proofs.relative(*pictures) < 0.02


def test_three_s_own_filter(browser, site, probe):
    """Our levels and those of PMREMGenerator, each beside sums over pixels by its own lobe.

    Ours has the shadowing of facets, which PMREMGenerator leaves out, but for the last level.
    """
    folder, address = site
    proofs.prepare_three(folder, "webgl")
    rows, errors = proofs.three_filtered(browser, folder, address, probe, 256, "webgl")
    assert not errors
    assert [round(rough, 3) for rough, _ in rows] == [0.106, 0.225, 0.368, 0.553, 1.0]
    for rough, off in rows:
        assert off["ours"] < 0.005, rough
        assert off["three"] < 0.01, rough
        assert off["both"] < (0.08 if 0.3 < rough < 1 else 0.01), rough


def with_two_lamps(brighter):
    """Smooth light with two lamps, of which the brighter one has this radiance."""
    directions = np.asarray(latlong_samples(128)[0]).reshape(128, 256, 3)
    image = 0.5 + 0.3 * directions
    for towards, color in (((1, 2, 0.5), brighter), ((-1, 1, 1), (50, 80, 150))):
        image[directions @ towards > 0.9995 * np.linalg.norm(towards)] = color
    return Probe.from_array(image, "latlong")


def test_three_has_lights_in_place_of_lamps(browser, site):
    """`--sun split` beside the same light in the cube: diffuse, and two rough metals."""
    folder, address = site
    proofs.prepare(folder, "three")
    probe = with_two_lamps((400, 300, 200))
    page = proofs.Page(browser, address, "three.bundle.js")
    pictures = {}
    for sun in (None, "split"):
        asked = Asked(size=256, texels="rgba16f", sun=sun)
        made = packaged(Source("light", "light.exr", probe=probe), engine("three"), asked)
        write(made, folder / "three", kept=False)
        page.call("start", 128, proofs.VIEW)
        page.call("environment", f"{address}/three/light.ktx2")
        for name in ("dark", "lit") if sun else ("whole",):
            if name == "lit":
                lines = [line for line in made.loading if not line.startswith(("import", "scene"))]
                start = lines.index("// The lamps that the cube is without.")
                page.call("lights", "\n".join(lines[start:]))
            for what in ("environment", 0.5, 1.0):
                pictures[name, what] = proofs.ball.decoded(page.call("shade", what), 128)
    assert not page.errors
    page.close()
    used = proofs.shown(128)[1]
    for what, most in (("environment", 0.005), (0.5, 0.1), (1.0, 0.1)):
        whole, dark, lit = (pictures[name, what][used] for name in ("whole", "dark", "lit"))
        assert proofs.relative(lit, whole) < most, what
        assert proofs.relative(dark, whole) > 0.2, what


def test_babylon_has_lights_in_place_of_lamps(browser, site):
    """They add what Lambert's surface and GGX reflect of them, and show the whole light again."""
    folder, address = site
    proofs.prepare(folder, "babylon")
    probe = with_two_lamps((240, 180, 120))
    page = proofs.Page(browser, address, "babylon.bundle.js")
    pictures = {}
    for sun in (None, "split"):
        asked = Asked(size=256, sun=sun)
        made = packaged(Source("light", "light.exr", probe=probe), engine("babylon"), asked)
        write(made, folder / "babylon", kept=False)
        page.call("start", 128, True, proofs.VIEW)
        page.call("environment", f"{address}/babylon/light.env")
        for name in ("dark", "lit") if sun else ("whole",):
            if name == "lit":
                start = next(k for k, line in enumerate(made.loading) if "lamps" in line)
                page.call("lights", "\n".join(made.loading[start:]))
            for what in (None, 0.5, 1.0):
                pictures[name, what] = proofs.ball.decoded(page.call("shade", what), 128)
    assert not page.errors
    page.close()
    lamps = json.loads((folder / "babylon" / "light_lamps.json").read_text())["lamps"]
    assert len(lamps) == 2
    towards, energy = (
        np.array([lamp[key] for lamp in lamps]) for key in ("direction", "irradiance")
    )
    normals, used, _ = proofs.shown(128)
    normals = normals[used]
    views = proofs.ball.views(normals, proofs.VIEW, 1000)
    views /= np.linalg.norm(views, axis=-1, keepdims=True)
    for what in (None, 0.5, 1.0):
        whole, dark, lit = (pictures[name, what][used] for name in ("whole", "dark", "lit"))
        if what is None:
            wanted = np.maximum(normals @ towards.T, 0) @ energy / np.pi
        else:
            wanted = ggx.reflected(what, normals, views, towards, energy)[0]
        assert proofs.relative(lit - dark, wanted) < 0.005, what
        assert proofs.relative(lit, whole) < 0.1 < proofs.relative(dark, whole), what


@pytest.mark.parametrize("surface", [(0.5, 0.6), (0.3, 0.9)])
def test_three_patched_for_brushed_surfaces(browser, site, probe, surface):
    """The patch of docs/anisotropy.md; without it, the light of a bent normal is shown."""
    folder, address = site
    proofs.prepare(folder, "three")
    text = (ROOT / "docs" / "anisotropy.md").read_text()
    patch = re.search(r"```js\n(.*?)```", text, re.S)[1]
    found, used, errors = proofs.three_brushed(
        browser, folder, address, probe, 64, surface, patch, taps_code(DEFAULT_TAPS, "glsl")
    )
    assert not errors
    rms = {k: proofs.relative(v[used], found["truth"][used]) for k, v in found.items()}
    assert proofs.relative(found["taps"][used], found["documented"][used]) < 0.02
    assert rms["taps"] < rms["bent"] / 3
    assert rms["taps"] < 0.1


@pytest.mark.parametrize("form", ["babylon", "gltf"])
def test_babylon(browser, site, probe, form):
    folder, address = site
    proofs.prepare(folder, "babylon")
    proof = proofs.babylon(browser, folder, address, probe, 64, ROUGHNESSES, 192, form)
    assert_shaded(proof, address)
    assert next(row for row in proof.rows if row.what == "0").to_shrm < 0.02


def test_a_left_handed_scene_shows_the_same_picture(browser, site, probe):
    """What is seen from (x, y, -z) of a left-handed world is what is seen from our (x, y, z)."""
    folder, address = site
    proofs.prepare(folder, "babylon")
    proofs.exported(folder / "babylon", "babylon", probe, 64)
    pictures = []
    for right_handed, view in ((True, [0.3, 0.2, 1]), (False, [0.3, 0.2, -1])):
        page = proofs.Page(browser, address, "babylon.bundle.js")
        page.call("start", 64, right_handed, view)
        page.call("environment", f"{address}/babylon/light.env")
        pictures.append(proofs.ball.decoded(page.call("shade", 0.5), 64))
        page.close()
    inner = proofs.shown(64)[1]
    assert np.abs(pictures[0] - pictures[1])[inner].max() < 0.02
    assert np.abs(pictures[0] - pictures[1][:, ::-1])[inner].max() > 0.5


def test_babylon_reads_dds_files(browser, site, probe):
    folder, address = site
    proofs.prepare(folder, "babylon")
    worst, errors, _ = proofs.directx(browser, folder, address, probe, 64)
    assert not errors
    assert worst < 2**-11, "more than the rounding of half floats"


def test_filament(browser, site, probe):
    folder, address = site
    proof = proofs.filament(browser, folder, address, probe, 64, ROUGHNESSES)
    assert_shaded(proof, address)
    assert proof.facts["sh"] < 1e-5


def test_gltf_sample_viewer(browser, site, probe):
    """It filters the panorama itself, so that its levels are near ours, and not the same."""
    folder, address = site
    proof = viewer.gltf_viewer(browser, folder, address, probe, 64, ROUGHNESSES, 192)
    assert not proof.errors
    assert all(url.startswith((address, "data:", "blob:")) for url in proof.requests)
    assert [row.what for row in proof.rows] == [*(f"{r:g}" for r in ROUGHNESSES), "diffuse"]
    for row in proof.rows:
        assert max(row.rms, row.largest) < 0.02, row
        assert row.turned > 20, row
    assert proof.rows[0].to_shrm < 0.01, "a mirror shows the light itself"
