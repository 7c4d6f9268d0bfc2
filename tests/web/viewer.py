"""The light that glTF-Sample-Viewer makes of an exported panorama, beside ours.

It loads no filtered levels. It reads the panorama into a cube and filters that by sampling, so that
what is compared are axes, intensity, and its lobe of each roughness. Its cube has 256 texels along
an edge, which take a software renderer a quarter of an hour; here the constant is lowered.
"""

import re
import shutil
from dataclasses import replace

import numpy as np

from shrm_cli.export.cubes import diffuse_cube
from shrm_cli.probe.lighting import project
from shrm_cli.sphere.synthesis import CubeSeries
from tests.bilinear import centers
from tests.web import ball, proofs
from tests.web.browser import HERE, Page, bundle, node_modules
from tests.web.glb import ball_file

_DISTANCE = 1000
_DEGREES = 200
"""Its sharpest lobe, of roughness 0.25, passes less than 1e-9 of what is beyond."""
_CONSTANTS = {"lutResolution": 128}
"""What takes a software renderer minutes, and shows in no ball."""


def gltf_viewer(browser, folder, address, probe, size, roughnesses, pixels=256):
    """Balls in glTF-Sample-Viewer, from glTF files; its cubes have `size` texels along an edge."""
    light, _ = proofs.exported(folder / "viewer", "gltf-sample-viewer", probe, size)
    prepare(folder / "viewer", size)
    page = Page(browser, address, "viewer/gltf_viewer.bundle.js")
    towards = np.array(proofs.VIEW) / np.linalg.norm(proofs.VIEW)
    page.call("start", pixels, list(_DISTANCE * towards), f"{address}/viewer/libs/")
    mips = page.call("environment", f"{address}/viewer/light.hdr")["mips"]
    normals, used, _ = proofs.shown(pixels)
    reflected = ball.mirrored(normals, ball.views(normals, towards, _DISTANCE))

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
    theirs = replace(light, levels=(*documented_levels(probe, light), diffuse))
    ours = *light.levels, diffuse
    return proofs.compare(
        "glTF-Sample-Viewer", page, theirs, "linear", pictures, normals, used, ours
    )


def prepare(folder, size):
    """Bundle the page and the engine, with cubes of `size` texels along an edge."""
    package = node_modules() / "@khronosgroup" / "gltf-viewer" / "dist"
    shutil.copytree(package / "libs", folder / "libs", dirs_exist_ok=True)
    shutil.copy(HERE / "pages" / "blank.html", folder)
    script = (package / "gltf-viewer.module.js").read_text()
    for name, value in {"textureSize": size, **_CONSTANTS}.items():
        script, found = re.subn(rf"this\.{name} = \d+;", f"this.{name} = {value};", script)
        assert found == 1, name
    engine = folder / "gltf-viewer.js"
    engine.write_text(script)
    alias = f"--alias:@khronosgroup/gltf-viewer={engine}"
    bundle(HERE / "pages" / "gltf_viewer.js", folder / "gltf_viewer.bundle.js", alias)


def documented_levels(probe, exported):
    """The levels that its shaders say, but integrated in place of sampled, as OpenEXR cubes.

    The first is the panorama, looked up at the middles of texels. The lobe of the others is that
    of `filterColor`: half vectors by GGX around N = V, weighed with N.L and without shadowing.
    """
    light = CubeSeries(project(probe, _DEGREES).coefficients)
    levels = [_texels_of(exported.latlong, exported.levels[0].shape[1])]
    for ours, roughness in list(zip(exported.levels, exported.roughness, strict=True))[1:]:
        planes = light.planes(ours.shape[1], "center", factors=zonal(roughness))
        levels.append(np.ascontiguousarray(planes.transpose(1, 2, 0)))
    return tuple(levels)


def zonal(roughness):
    """What the lobe multiplies degrees with, shape (_DEGREES + 1,)."""
    half, weights = np.polynomial.legendre.leggauss(4000)
    half, weights = (half + 1) * np.pi / 8, weights * np.pi / 8  # angles from 0 to 45 degrees
    alpha = roughness**2
    density = (alpha / (1 + (alpha**2 - 1) * np.cos(half) ** 2)) ** 2
    cosine = np.cos(2 * half)
    lobe = weights * density * cosine * np.sin(2 * half)
    passed = np.polynomial.legendre.legvander(cosine, _DEGREES).T @ lobe
    return passed / passed[0]


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
