"""PlayCanvas: an `envAtlas`, one picture of lat-longs for all roughnesses, and nine coefficients.

The upper half of the square picture is the light itself. Below it on the right are its mips, and on
the left the levels of roughness k / 5, each half as large as the one before. One more lat-long
holds E / pi. The border of each, 1/512 of the picture wide, belongs to its far side, so that the
texture unit interpolates across the seams.

The lat-longs lie as ours do: the engine looks up ``atan(-x, z) / 2 pi + 1 / 2``. Texels are RGBP.

References: PlayCanvas, scene/graphics/env-lighting.js (`generateAtlas`), and the shader chunks
`envAtlas`, `reflectionEnv`, `ambient`, `spherical`, `encode` and `decode`.
"""

from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array, slices
from shrm_cli.export.cubes import diffuse_cube, packed_images
from shrm_cli.export.engine import Engine, Light, Package, halving
from shrm_cli.export.pixels import TexelFormat, rgba_png
from shrm_cli.export.quoting import string, uri
from shrm_cli.progress import at_once
from shrm_cli.sphere.cube import CubeSampler

_LEVELS = 6
"""Levels of roughness 0 to 1, in steps of 1/5."""
_MIPS = 6
"""Mips of the light itself, the largest included."""
_UNIT = 256
"""Rows of the light itself in a picture of 512 texels, where a border is one texel wide."""
_PLACES_AT_ONCE = 2**17


class PlayCanvas(Engine):
    """PlayCanvas' `scene.envAtlas`."""

    name = "playcanvas"
    title = "PlayCanvas"
    formats = auto = ("rgbp",)
    mapping = "linear"
    wants_irradiance = False
    wants_diffuse = True

    def sizes(self, size: int) -> tuple[int, ...]:
        return halving(size, 1, _LEVELS)

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        if not light.levels or light.diffuse is None:
            return made  # one picture has both
        name = f"{light.name}_envAtlas.png"
        atlas = env_atlas(light.levels, diffuse_cube(light.diffuse))
        (data,) = packed_images(made, name, [("the atlas", atlas[None])], texels)
        made.add_bytes(name, rgba_png(np.frombuffer(data, np.uint8).reshape(*atlas.shape[:2], 4)))
        made.told += [
            "the lat-longs of the atlas lie as ours do, +Z in the centre",
            "levels: roughness k / 5; diffuse surfaces take the lat-long of E / pi",
            f"pixels: {texels.title}, 8 bits a channel, at most radiance {texels.largest[0]:g}",
        ]
        made.loading += [
            'const atlas = new pc.Asset("light", "texture", '
            f"{{ url: {string(uri(name))} }}, {{ type: pc.TEXTURETYPE_RGBP, mipmaps: false,",
            '  projection: pc.TEXTUREPROJECTION_EQUIRECT, addressu: "clamp", addressv: "clamp" });',
            "atlas.ready(() => { app.scene.envAtlas = atlas.resource; });",
            "app.assets.add(atlas);",
            "app.assets.load(atlas);",
        ]
        return made


def env_atlas(levels: Sequence[Array], diffuse: Array) -> Array:
    """Return the picture of linear radiance, shape (2 N, 2 N, 3).

    `levels`, each of shape (6 N_k, N_k, 3), are OpenEXR cubes of roughness k / 5; the first has N_0
    = N texels along an edge. `diffuse`, of shape (6 M, M, 3), is a cube of E / pi.
    """
    rows = levels[0].shape[1]
    border = rows / _UNIT
    atlas = np.zeros((2 * rows, 2 * rows, 3))

    def place(sampler: CubeSampler, left: int, top: int, height: int, finer: int = 2) -> None:
        part = atlas[top : top + height, left : left + 2 * height]
        _fill_bordered(part, sampler, border, finer)

    first, *others = (CubeSampler(cube, "center") for cube in levels)
    for k in range(min(_MIPS, rows.bit_length())):
        far = 2 * rows - (2 * rows >> k)
        place(first, far, far, rows >> k, 2 << k)
    for k, sampler in enumerate(others, 1):
        place(sampler, 0, 2 * rows - (2 * rows >> k), rows >> k)
    place(CubeSampler(diffuse, "center"), rows // 2, rows + rows // 2, rows // 8)
    return atlas


def _fill_bordered(part: Array, sampler: CubeSampler, border: float, finer: int) -> None:
    """Fill a lat-long, shape (n, 2 n, 3), of which the border belongs to the far side.

    Each texel is the mean of `finer` by `finer` places.
    """
    height, width = part.shape[:2]

    def angles(texels: slice, count: int) -> Array:
        """The angles of the places in some texels of so many, in parts of what is inside."""
        places = np.arange(finer * texels.start, finer * texels.stop) + 0.5
        return np.pi * (places / finer - border) / (count - 2 * border)

    phi = np.pi - 2 * angles(slice(0, width), width)

    def fill(rows: slice) -> None:
        theta = angles(rows, height)[:, None]
        sine = np.sin(theta)  # negative beyond a pole, which is the far side of the meridian
        towards = sine * np.sin(phi), np.cos(theta) + 0 * phi, sine * np.cos(phi)
        values = sampler(np.stack(towards, axis=-1))
        means = values.reshape(-1, finer, width, finer, 3).mean(axis=(1, 3))
        part[rows] = np.maximum(means, 0)  # a cubic filter overshoots

    at_once(fill, list(slices(height, _PLACES_AT_ONCE // (finer**2 * width))))
