"""A probe with a text of its own written on each direction, and how engines show it around the eye.

Text that is mirrored, turned or on the wrong side is seen at once, and does not correlate.
"""

import base64

import numpy as np
from PIL import Image, ImageDraw

from shrm_cli.probe.probe import Probe
from tests.web import ball, others, proofs, viewer
from tests.web.browser import Page
from tests.web.glb import ball_file

STOCK = {"three-webgl": "webgl", "three-webgpu": "webgpu"}
"""three.js' own loader, under both of its renderers."""
ENGINES = ("three", *STOCK, "babylon", "filament", "gltf-sample-viewer", *others.NAMES)
AROUND = {"+X": (1, 0, 0), "-X": (-1, 0, 0), "+Z": (0, 0, 1), "-Z": (0, 0, -1)}
_AXES = {**AROUND, "+Y": (0, 1, 0), "-Y": (0, -1, 0)}
_TOPS = {"+Y": (0, 0, -1), "-Y": (0, 0, 1)}
"""What is above text that is not upright."""
_TEXTS = {"+X": "F1", "-X": "J2", "+Y": "P5", "-Y": "L6", "+Z": "R4", "-Z": "G7"}
"""What is like itself neither mirrored nor turned, as an X would be."""
_SIDE = 64


def written(name):
    """A picture of 90 degrees with the text of a direction on it, white on grey, shape (64, 64)."""
    image = Image.new("L", (_SIDE // 4, _SIDE // 4), 50)
    ImageDraw.Draw(image).text((2, 2), _TEXTS[name], fill=255)
    return np.asarray(image.resize((_SIDE, _SIDE), Image.BILINEAR)) / 255


def lettered_probe(rows=128):
    """A lat-long that shows `written` of each axis to an eye in its middle."""
    v, u = np.meshgrid(np.arange(rows) + 0.5, np.arange(2 * rows) + 0.5, indexing="ij")
    theta, phi = np.pi * v / rows, np.pi * (1 - u / rows)
    directions = np.stack(
        [np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1
    )
    nearest = np.argmax(directions @ np.array(list(_AXES.values())).T, axis=-1)
    values = np.zeros(directions.shape[:2])
    for k, (name, forward) in enumerate(_AXES.items()):
        top = np.array(_TOPS.get(name, (0, 1, 0)))
        right = np.cross(forward, top)
        mine = nearest == k
        seen = directions[mine]
        depth = seen @ np.array(forward)
        column, row = seen @ right / depth, -(seen @ top) / depth
        place = [np.clip((s + 1) / 2 * _SIDE, 0, _SIDE - 1).astype(int) for s in (row, column)]
        values[mine] = written(name)[tuple(place)]
    return Probe.from_array(values[..., None].repeat(3, axis=-1), "latlong")


def seen_around(browser, folder, address, name, probe, size=64, pixels=_SIDE):
    """The light along each of `AROUND` in an engine, and mostly a mirror ball: pictures by name."""
    if name in others.NAMES:
        fine = max(size, 1024 if name == "model-viewer" else 256)
        opened = others.Opened(browser, folder, address, name, probe, fine, 4 * pixels)
        found = {each: opened.ahead(to)[2::4, 2::4] for each, to in AROUND.items()}
        opened.page.close()
        return found
    if name == "gltf-sample-viewer":
        page, _ = viewer.opened(browser, folder, address, probe, size, pixels, samples=1)
        (folder / "viewer" / "mirror.glb").write_bytes(ball_file(1.0, 0.0))
        found = {"mirror": page.call("shade", f"{address}/viewer/mirror.glb")}
        found |= {each: page.call("background", to) for each, to in AROUND.items()}
    elif name == "filament":
        page, _, _ = proofs.open_filament(browser, folder, address, probe, size, (0.0,), pixels)
        found = {"mirror": page.call("shade", "metal0.glb", 1)}
        for each, to in AROUND.items():
            found[each] = page.call("background", "light_skybox.ktx", to)
        page.close()
        return {each: _of_bytes(text, pixels) for each, text in found.items()}
    elif name in STOCK:
        proofs.exported(folder / "three", "three", probe, size, "uastc")
        proofs.prepare_three(folder, STOCK[name])
        page = Page(browser, address, f"{STOCK[name]}.bundle.js")
        page.call("start", pixels, proofs.VIEW)
        page.call("stock", f"{address}/three/light.ktx2", f"{address}/basis/")
        found = {"mirror": page.call("shade", 0.0)}
        found |= {each: page.call("background", to) for each, to in AROUND.items()}
    else:
        texels = "rgba16f" if name == "three" else None
        proofs.exported(folder / name, name, probe, size, texels)
        proofs.prepare(folder, name)
        page = Page(browser, address, f"{name}.bundle.js")
        page.call("start", pixels, *((True,) if name == "babylon" else ()), proofs.VIEW)
        page.call("environment", f"{address}/{name}/light.{'env' if name == 'babylon' else 'ktx2'}")
        found = {"mirror": page.call("shade", 0.0)}
        found |= {each: page.call("background", to) for each, to in AROUND.items()}
    page.close()
    return {each: ball.decoded(text, pixels) for each, text in found.items()}


def _of_bytes(text, pixels):
    image = np.frombuffer(base64.b64decode(text), np.uint8).reshape(pixels, pixels, 4)
    return image[::-1, :, :3] / 255


def likeness(picture, text):
    """The correlation of a picture with a text as it is to be read."""
    inner = slice(4, -4)
    return np.corrcoef(picture[inner, inner, 1].ravel(), text[inner, inner].ravel())[0, 1]
