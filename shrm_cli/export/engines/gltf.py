"""glTF's EXT_lights_image_based: a light in a scene, as RGBD pictures and nine coefficients.

Babylon.js is what reads it. By the extension's text the levels spread evenly over roughness.
Babylon.js looks up level ``(K - 1) (1 + log2(ggx_alpha) / log2(size))`` instead, and that is what
is written, because the picture on the screen decides.

References: KhronosGroup/glTF, extensions/2.0/Vendor/EXT_lights_image_based; Babylon.js' loader of
that name.
"""

import json
from collections.abc import Sequence
from pathlib import Path

from shrm_cli.export.asset import EXTENSION
from shrm_cli.export.cubes import mirrored, packed_levels
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.harmonics import ext_lights_image_based, in_axes
from shrm_cli.export.pixels import TexelFormat, rgbd_pictures
from shrm_cli.export.quoting import string, uri

LOOKUP = mirrored(1, 1, -1)
"""Where a right-handed scene of Babylon.js looks up a world direction."""


class Gltf(Engine):
    """glTF files with EXT_lights_image_based."""

    name = "gltf"
    title = "glTF EXT_lights_image_based"
    formats = auto = ("rgbd",)
    takes_asset = True
    least = 16
    """Texels along an edge of the last level, as the extension's text has it."""

    def roughness(self, sizes: Sequence[int]) -> tuple[float, ...]:
        steps = len(sizes) - 1
        return (0.0, *(sizes[0] ** ((k / steps - 1) / 2) for k in range(1, len(sizes))))

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        coefficients = light.nine()
        if not light.levels or coefficients is None:  # the extension asks for both
            return made
        asset = light.asset
        name = (
            f"{light.name}.gltf" if asset is None else f"{light.name}_{Path(asset.path).stem}.glb"
        )
        packed = packed_levels(made, name, light.levels, texels, LOOKUP)
        pictures = {
            f"{light.name}_{k}_{face}.png": picture
            for k, (data, cube) in enumerate(zip(packed, light.levels, strict=True))
            for face, picture in enumerate(rgbd_pictures(data, cube.shape[1]))
        }
        described = {
            "name": light.name,
            "intensity": 1.0,  # without it Babylon.js makes NaN of the coefficients
            "rotation": [0.0, 0.0, 0.0, 1.0],
            "irradianceCoefficients": ext_lights_image_based(
                in_axes(coefficients, LOOKUP)
            ).tolist(),
            "specularImageSize": light.levels[0].shape[1],
            "specularImages": [list(range(6 * k, 6 * k + 6)) for k in range(len(light.levels))],
        }
        if asset is None:
            images = [{"uri": uri(each)} for each in pictures]
            for each, picture in pictures.items():
                made.add_bytes(each, picture)
            document = {  # of a scene with nothing but the light
                "asset": {"version": "2.0", "generator": "shrm"},
                "extensionsUsed": [EXTENSION],
                "extensions": {EXTENSION: {"lights": [described]}},
                "images": images,
                "scene": 0,
                "scenes": [{"extensions": {EXTENSION: {"light": 0}}}],
            }
            made.add_text(name, json.dumps(document, allow_nan=False))
        else:
            made.add_bytes(name, asset.lit(described, list(pictures.values())))
            made.told.append(f"the light is in each scene of the file: {asset.scenes}")
        made.told += [
            "axes: right-handed scenes look up (x, y, -z), so cube and coefficients are mirrored "
            "in z",
            "levels: level (K - 1) (1 + log2(ggx_alpha) / log2(size)), as Babylon.js looks them up",
            "pixels: RGBD, 8 bits a channel, at most radiance 255",
            "sh: A_l L_lm with the Condon-Shortley phase",
        ]
        made.loading += [
            "scene.useRightHandedSystem = true;",
            f"await BABYLON.AppendSceneAsync({string(uri(name))}, scene);",
            "scene.environmentTexture.gammaSpace = false; // which its loader forgets",
        ]
        return made
