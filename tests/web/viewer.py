"""The light that glTF-Sample-Viewer makes of an exported panorama, beside ours.

It loads no filtered levels. It reads the panorama into a cube and filters that by sampling, so that
what is compared are axes, intensity, and its lobe of each roughness. Its cube has 256 texels along
an edge, which take a software renderer a quarter of an hour; here the constant is lowered.
"""

import re
import shutil
from dataclasses import replace

import numpy as np

from research.bilinear import centers
from shrm_cli.export.cubes import diffuse_cube
from tests.web import ball, proofs
from tests.web.browser import HERE, MODULES, Page, bundle
from tests.web.glb import ball_file

_DISTANCE = 1000
_TABLE = 128
"""Of its 1024 texels along an edge, which take a software renderer minutes, and show in no ball."""


def gltf_viewer(browser, folder, address, probe, size, roughnesses, pixels=256, samples=None):
    """Balls in glTF-Sample-Viewer, from glTF files; its cubes have `size` texels along an edge.

    Its mirrors are as sharp as the light: small lamps need many pixels, because renderers move
    corners of triangles to fractions of a pixel. With another number of `samples`
    than its own only mirrors are as they should be, whose samples are all the same.
    """
    page, light = opened(browser, folder, address, probe, size, pixels, samples)
    mips = len(light.levels)
    normals, used, _ = proofs.shown(pixels)
    reflected = ball.mirrored(normals, ball.views(normals, proofs.VIEW, _DISTANCE))

    def shaded(name, file):
        (folder / "viewer" / name).write_bytes(file)
        return ball.decoded(page.call("shade", f"{address}/viewer/{name}"), pixels)

    pictures = {}
    for roughness in roughnesses:
        # Scale and compensation for several facets cancel for a white metal.
        pictures[f"{roughness:g}"] = (
            shaded(f"metal{roughness:g}.glb", ball_file(1.0, roughness)),
            lambda levels, lod=roughness * (mips - 1): ball.trilinear(levels, reflected, lod),
        )
    pictures["diffuse"] = (
        shaded("diffuse.glb", ball_file(0.0, 1.0, glossy=False)),
        lambda levels: ball.trilinear(levels[mips:], normals, 0),
    )
    diffuse = diffuse_cube(light.diffuse)
    if samples is None:
        levels = documented_levels(light)
    else:
        del pictures["diffuse"]
        levels = _texels_of(light.latlong, size), *light.levels[1:]
    theirs = replace(light, levels=(*levels, diffuse))
    ours = *light.levels, diffuse
    return proofs.compare(
        "glTF-Sample-Viewer", page, theirs, "linear", pictures, normals, used, ours
    )


def opened(browser, folder, address, probe, size, pixels, samples=None):
    """The viewer's page with an exported panorama, and the light that was exported."""
    light, _ = proofs.exported(folder / "viewer", "gltf-sample-viewer", probe, size)
    prepare(folder / "viewer", size, samples)
    page = Page(browser, address, "viewer/gltf_viewer.bundle.js")
    towards = np.array(proofs.VIEW) / np.linalg.norm(proofs.VIEW)
    page.call("start", pixels, list(_DISTANCE * towards), f"{address}/viewer/libs/")
    mips = page.call("environment", f"{address}/viewer/light.hdr")["mips"]
    assert mips == len(light.levels)
    return page, light


def prepare(folder, size, samples=None):
    """Bundle the page and the engine, with cubes of `size` texels along an edge."""
    changed = {"textureSize": size, "lutResolution": _TABLE}
    if samples is not None:
        changed |= dict.fromkeys(("ggxSampleCount", "lambertianSampleCount"), samples)
    package = MODULES / "@khronosgroup" / "gltf-viewer" / "dist"
    shutil.copytree(package / "libs", folder / "libs", dirs_exist_ok=True)
    shutil.copy(HERE / "pages" / "blank.html", folder)
    script = (package / "gltf-viewer.module.js").read_text()
    for name, value in changed.items():
        script, found = re.subn(rf"this\.{name} = \d+;", f"this.{name} = {value};", script)
        assert found == 1, name
    engine = folder / "gltf-viewer.js"
    engine.write_text(script)
    alias = f"--alias:@khronosgroup/gltf-viewer={engine}"
    bundle(HERE / "pages" / "gltf_viewer.js", folder / "gltf_viewer.bundle.js", alias)


def documented_levels(exported):
    """The levels that its shaders say, as OpenEXR cubes: the panorama, and what they make of it."""
    sizes = [level.shape[1] for level in exported.levels]
    mips = [_texels_of(exported.latlong, sizes[0])]
    while mips[-1].shape[1] > 1:
        size = mips[-1].shape[1] // 2
        mips.append(mips[-1].reshape(6 * size, 2, size, 2, 3).mean(axis=(1, 3)))
    lobes = zip(sizes[1:], exported.roughness[1:], strict=True)
    return mips[0], *(sampled(mips, size, roughness) for size, roughness in lobes)


def sampled(mips, size, roughness, count=1024):
    """What `filterColor` makes of a cube: light weighed with N.L, half vectors by GGX, N = V.

    A sample stands for a solid angle of 1 / (count pdf), and is looked up in the mip whose texels
    have this many times 4 pi: `computeLod` forgets the sphere's area. So broad lobes are broadened.
    """
    normals = centers(size).reshape(-1, 3)
    tangents = np.cross([0, 1, 0], normals)
    tangents /= np.linalg.norm(tangents, axis=-1, keepdims=True)
    bitangents = np.cross(normals, tangents)
    alpha, total, result = roughness**2, 0.0, 0.0
    for k in range(count):
        y = int(f"{k:032b}"[::-1], 2) / 2**32
        cosine = np.sqrt((1 - y) / (1 + (alpha**2 - 1) * y))
        weight = 2 * cosine**2 - 1
        if weight <= 0:
            continue
        pdf = (alpha / (1 + (alpha**2 - 1) * cosine**2)) ** 2 / (4 * np.pi)
        turn, sine = 2 * np.pi * k / count, np.sqrt(1 - cosine**2)
        across = np.cos(turn) * tangents + np.sin(turn) * bitangents
        light = weight * normals + 2 * cosine * sine * across
        lod = 0.5 * np.log2(6 * mips[0].shape[1] ** 2 / (count * pdf))
        result = result + weight * ball.trilinear(mips, light, lod)
        total += weight
    return (result / total).reshape(6 * size, size, 3)


def _texels_of(panorama, size):
    height = panorama.shape[0]
    directions = centers(size)
    # docs/conventions.md: the top row is +Y, the centre +Z, the left quarter +X.
    y = np.arccos(np.clip(directions[..., 1], -1, 1)) / np.pi * height - 0.5
    x = (0.5 - np.arctan2(directions[..., 0], directions[..., 2]) / (2 * np.pi)) * 2 * height - 0.5
    row, column = np.floor(y).astype(int), np.floor(x).astype(int)
    fy, fx = (y - row)[..., None], (x - column)[..., None]
    result = 0
    for i, wy in ((0, 1 - fy), (1, fy)):
        for j, wx in ((0, 1 - fx), (1, fx)):
            rows = np.clip(row + i, 0, height - 1)
            result = result + wy * wx * panorama[rows, (column + j) % (2 * height)]
    return result.reshape(6 * size, size, 3)
