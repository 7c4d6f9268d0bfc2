"""Babylon.js: one file ``.env`` with the levels as RGBD pictures, and polynomials of irradiance.

A file ``.env`` is a mark of eight bytes, JSON in ASCII, a zero byte, and the pictures: for each
level the six faces +X -X +Y -Y +Z -Z, from the largest level down to that of one texel.

Level k holds ggx_alpha ``2^(k / 0.8) / size``, level 0 the light itself; every level is there down
to one texel. Scenes look cubes up at (x, y, -z) where they are right-handed.

References: Babylon.js, ``Misc/environmentTextureTools`` (``GetEnvInfo``,
``CreateEnvTextureAsync``), ``Maths/sphericalPolynomial`` and the shaders ``pbrIBLFunctions`` and
``harmonicsFunctions``.
"""

import json
import math
from collections.abc import Mapping, Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError
from shrm_cli.export.cubes import mirrored, packed_levels
from shrm_cli.export.engine import Engine, Light, Package, halving
from shrm_cli.export.harmonics import babylon, in_axes
from shrm_cli.export.pixels import TexelFormat, rgbd_pictures
from shrm_cli.export.quoting import string, uri
from shrm_cli.vocabulary import MIN_ROUGHNESS

MARK = bytes([0x86, 0x16, 0x87, 0x96, 0xF6, 0xD6, 0x96, 0x36])
LOD_SCALE = 0.8
"""How many levels further twice the ggx_alpha lies: level k holds ``2^(k / 0.8) / size``."""
LOOKUP = mirrored(1, 1, -1)
"""Where a right-handed scene looks up a world direction."""


class Babylon(Engine):
    """Babylon.js: `CubeTexture.CreateFromPrefilteredData`."""

    name = "babylon"
    title = "Babylon.js"
    formats = auto = ("rgbd",)
    lamps = 16

    def sizes(self, size: int) -> tuple[int, ...]:
        sizes = halving(size, 1)
        # Beyond alpha 1 there is no lobe; `pack` makes the levels that go on.
        return sizes[: 1 + math.ceil(LOD_SCALE * math.log2(size))]

    def roughness(self, sizes: Sequence[int]) -> tuple[float, ...]:
        alphas = [2 ** (k / LOD_SCALE) / sizes[0] for k in range(1, len(sizes))]
        if alphas and math.sqrt(alphas[0]) < MIN_ROUGHNESS:
            raise ArgumentError("size", f"{sizes[0]} makes its second level too sharp; give 512")
        return (0.0, *(min(math.sqrt(alpha), 1.0) for alpha in alphas))

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        coefficients = light.nine()
        polynomials = None
        if coefficients is not None:
            polynomials = babylon(in_axes(coefficients, LOOKUP))
            made.told.append("irradiance: polynomials with A_l/pi twice; its loader divides once")
        if not light.levels:
            return made
        name = f"{light.name}.env"
        cubes = list(light.levels)
        while cubes[-1].shape[1] > 1:
            cubes.append(_halved(cubes[-1]))
        packed = packed_levels(made, name, cubes, texels, LOOKUP)
        sizes = [cube.shape[1] for cube in cubes]
        levels = [rgbd_pictures(*level) for level in zip(packed, sizes, strict=True)]
        made.add_bytes(name, _env_file(levels, polynomials))
        made.told += [
            "axes: right-handed scenes look up (x, y, -z), so the cube and the polynomials are "
            "mirrored in z; in a left-handed scene the light of (x, y, z) comes from (x, y, -z)",
            "levels: ggx_alpha 2^(k / 0.8) / size, level 0 sharp, roughness 1 from ggx_alpha 1 on",
            "pixels: RGBD, 8 bits a channel, at most radiance 255",
        ]
        made.loading += [
            "scene.useRightHandedSystem = true;",
            "scene.environmentTexture =",
            f"  BABYLON.CubeTexture.CreateFromPrefilteredData({string(uri(name))}, scene);",
        ]
        return made


def _env_file(
    levels: Sequence[Sequence[bytes]], irradiance: Mapping[str, Sequence[float]] | None
) -> bytes:
    """Return the bytes of a file.

    `levels` are PNG pictures of the six faces of each level, from `rgbd_pictures`. The last has one
    texel, each other one twice as many along an edge as the next. `irradiance` is RGB of the
    polynomials x, y, z, xx, yy, zz, yz, zx and xy. Without it Babylon.js makes its own from the
    pictures.
    """
    pictures = [picture for level in levels for picture in level]
    places, position = [], 0
    for picture in pictures:
        places.append({"length": len(picture), "position": position})
        position += len(picture)
    head: dict[str, object] = {
        "version": 2,
        "width": 2 ** (len(levels) - 1),
        "imageType": "image/png",
        "specular": {"mipmaps": places, "lodGenerationScale": LOD_SCALE},
    }
    if irradiance is not None:
        head["irradiance"] = {name: list(values) for name, values in irradiance.items()}
    return MARK + json.dumps(head, allow_nan=False).encode("ascii") + b"\0" + b"".join(pictures)


def _halved(cube: Array) -> Array:
    """Return the means of four texels each of a cube, shape (6N, N, 3) -> (3N, N/2, 3)."""
    size = cube.shape[1] // 2
    return np.asarray(cube.reshape(6 * size, 2, size, 2, 3).mean(axis=(1, 3)))
