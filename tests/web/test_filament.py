"""`shrm export --for filament` in Filament itself: balls of white metal, and a background.

The engine is the npm package `filament` in a headless Chromium. A white metal reflects, whatever
its roughness, just the level that Filament looks up: its energy compensation divides by the very
albedo that it multiplies with. So pixels are compared with sums of the light by GGX's lobe.
"""

import json
import struct
from base64 import b64encode

import numpy as np
import pytest

from shrm_cli.export.engine import engine
from shrm_cli.export.make import Asked, Source, packaged, write
from shrm_cli.probe.probe import Probe
from tests.brute_force import latlong_samples
from tests.export.test_engines import HEIGHT, filtered, irradiance, light
from tests.web.browser import MODULES

SIZE = 128
SCALE = 0.4
"""What the light is dimmed by, so that pixels of eight bits are not clipped."""
PAGE = """<canvas width=128 height=128></canvas><script src="gl-matrix-min.js"></script>
<script>Object.assign(globalThis, glMatrix)</script><script src="filament.js"></script>"""
DRAW = """async ({ibl, sky, ball, scale}) => {
    await new Promise((done) => Filament.init([], done));
    const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const canvas = document.querySelector('canvas');
    const engine = Filament.Engine.create(canvas);
    const scene = engine.createScene();
    const read = engine.createIblFromKtx1(bytes(ibl));
    const texture = engine.createTextureFromKtx1(bytes(ibl));
    const numbers = new Float32Array(read.shfloats);
    const builder = Filament.IndirectLight.Builder().reflections(texture).irradianceSh(3, numbers);
    const built = builder.build(engine);
    built.setIntensity(scale);
    scene.setIndirectLight(built);
    if (sky) scene.setSkybox(engine.createSkyFromKtx1(bytes(sky)));
    if (ball) {
        const loader = engine.createAssetLoader();
        const asset = loader.createAsset(bytes(ball));
        await new Promise((done) => asset.loadResources(done, null, '', null));
        scene.addEntities(asset.getEntities());
    }
    const swap = engine.createSwapChain(), renderer = engine.createRenderer();
    const view = engine.createView();
    const camera = engine.createCamera(Filament.EntityManager.get().create());
    if (sky) {
        camera.setProjectionFov(90, 1, 0.1, 10, Filament.Camera$Fov.VERTICAL);
        camera.lookAt([0, 0, 0], [0, 0, 1], [0, 1, 0]);
    } else {
        camera.setProjection(Filament.Camera$Projection.ORTHO, -1, 1, -1, 1, 0.1, 10);
        camera.lookAt([0, 0, 5], [0, 0, 0], [0, 1, 0]);
    }
    camera.setExposureDirect(1);
    view.setCamera(camera);
    view.setScene(scene);
    view.setViewport([0, 0, 128, 128]);
    view.setPostProcessingEnabled(false);
    renderer.setClearOptions({clearColor: [0, 0, 0, 1], clear: true});
    const copy = document.createElement('canvas');
    copy.width = copy.height = 128;
    const context = copy.getContext('2d');
    for (let frame = 0; frame < 8; ++frame) {
        await new Promise(requestAnimationFrame);
        renderer.render(swap, view);
        engine.execute();
        context.drawImage(canvas, 0, 0);
    }
    return {pixels: Array.from(context.getImageData(0, 0, 128, 128).data), sh: read.shfloats};
}"""


def ball(metallic, roughness):
    """Return a GLB of a sphere of radius 0.9, finely meshed."""
    rings, sides = 64, 128
    polar = np.linspace(0, np.pi, rings + 1)[:, None]
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    normals = np.stack(
        [np.sin(polar) * np.sin(turn), np.cos(polar) + 0 * turn, np.sin(polar) * np.cos(turn)], -1
    ).reshape(-1, 3).astype("<f4")  # fmt: skip
    first = (np.arange(rings)[:, None] * (sides + 1) + np.arange(sides)).ravel()
    quads = np.stack([first, first + sides + 1, first + 1], -1)
    others = np.stack([first + 1, first + sides + 1, first + sides + 2], -1)
    triangles = np.concatenate([quads, others]).astype("<u4")
    data = (0.9 * normals).tobytes() + normals.tobytes() + triangles.tobytes()
    count, length = len(normals), normals.nbytes
    bounds = {"min": [-0.9] * 3, "max": [0.9] * 3}
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "materials": [{"pbrMetallicRoughness": {
            "baseColorFactor": [1, 1, 1, 1], "metallicFactor": metallic,
            "roughnessFactor": roughness,
        }}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": 0}
        ]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3", **bounds},
            {"bufferView": 1, "componentType": 5126, "count": count, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5125, "count": triangles.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": length},
            {"buffer": 0, "byteOffset": length, "byteLength": length},
            {"buffer": 0, "byteOffset": 2 * length, "byteLength": triangles.nbytes},
        ],
        "buffers": [{"byteLength": len(data)}],
    }  # fmt: skip
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Return the folder of an export of the made light, with halves so that bits do not show."""
    folder = tmp_path_factory.mktemp("filament")
    directions = np.asarray(latlong_samples(HEIGHT)[0])
    probe = Probe.from_array(light(directions).reshape(HEIGHT, 2 * HEIGHT, 3), "latlong")
    made = packaged(Source("sky", "sky.exr", probe), engine("filament"), Asked(texels="rgba16f"))
    write(made, folder)
    return folder


@pytest.fixture
def drawn(browser, files):
    """Return a function that draws in Filament: pixels (128, 128, 3) of light, and the numbers."""
    page = browser.new_page()

    def serve(route):
        name = route.request.url.rpartition("/")[2]
        if name == "":
            return route.fulfill(body=PAGE, content_type="text/html")
        found = [
            p for p in (MODULES / "filament" / name, MODULES / "gl-matrix" / name) if p.exists()
        ]
        kind = "application/wasm" if name.endswith(".wasm") else "text/javascript"
        return route.fulfill(path=found[0], content_type=kind) if found else route.abort()

    page.route("**/*", serve)
    page.goto("http://shrm.test/")

    def draw(ball=None, sky=False):
        given = {"ibl": b64encode((files / "sky_ibl.ktx").read_bytes()).decode(), "scale": SCALE}
        given["sky"] = b64encode((files / "sky_skybox.ktx").read_bytes()).decode() if sky else None
        given["ball"] = b64encode(ball).decode() if ball else None
        found = page.evaluate(DRAW, given)
        pixels = np.reshape(found["pixels"], (SIZE, SIZE, 4))[..., :3] / 255 / SCALE
        return pixels, found["sh"]

    yield draw
    page.close()


@pytest.fixture(scope="module")
def samples():
    directions, weights = (np.asarray(each) for each in latlong_samples(HEIGHT))
    return directions, light(directions) * weights[:, None]


def normals_of(places):
    """Return the normals of a ball of radius 0.9 at pixels (row, column) of the picture."""
    x, y = ((2 * each + 1) / SIZE - 1 for each in (places[:, 1], places[:, 0]))
    n = np.stack([x / 0.9, -y / 0.9], axis=-1)
    return np.concatenate([n, np.sqrt(1 - (n**2).sum(axis=1, keepdims=True))], axis=1)


PLACES = np.array(
    [(20, 64), (40, 40), (44, 90), (64, 30), (64, 64), (80, 100), (90, 50), (105, 70)]
)


@pytest.mark.parametrize("level", [2, 3, 4])
def test_a_white_metal_shows_the_level_of_its_roughness(drawn, samples, level):
    roughness = 1 - np.sqrt(1 - level / 4)
    pixels, _ = drawn(ball(1.0, roughness))
    for place, normal in zip(PLACES, normals_of(PLACES), strict=True):
        view = np.array([0.0, 0, 1])
        mirror = 2 * normal[2] * normal - view
        # getSpecularDominantDirection of Filament's shader
        seen = mirror + (normal - mirror) * roughness**4
        wanted = filtered(samples, roughness, seen / np.linalg.norm(seen))
        assert pixels[tuple(place)] == pytest.approx(wanted, rel=0.02, abs=0.7 / 255 / SCALE)


def test_the_background_is_the_light(drawn):
    """Seen along +Z with +Y up, +X is to the left."""
    pixels, _ = drawn(sky=True)
    for row, column in PLACES:
        s, t = (2 * column + 1) / SIZE - 1, (2 * row + 1) / SIZE - 1
        direction = np.array([[-s, -t, 1.0]])
        wanted = light(direction / np.linalg.norm(direction))[0]
        # A background has the intensity of the indirect light.
        assert pixels[row, column] == pytest.approx(wanted, rel=0.05)


def test_a_rough_dielectric_shows_the_coefficients(drawn, samples):
    """Most of what white plastic of roughness 1 reflects is diffuse: E / pi."""
    pixels, sh = drawn(ball(0.0, 1.0))
    assert len(sh) == 27
    normals = normals_of(PLACES)
    found = pixels[tuple(PLACES.T)]
    wanted = irradiance(samples, normals) / np.pi
    assert found == pytest.approx(wanted, rel=0.06)
