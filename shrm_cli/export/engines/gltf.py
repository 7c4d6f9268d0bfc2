"""glTF's EXT_lights_image_based: a light in a scene, as RGBD pictures and nine coefficients.

Babylon.js is what reads it. By the extension's text the levels spread evenly over roughness.
Babylon.js looks up level ``(K - 1) (1 + log2(ggx_alpha) / log2(size))`` instead, and that is what
is written, because the picture on the screen decides.

References
----------
KhronosGroup/glTF, extensions/2.0/Vendor/EXT_lights_image_based; Babylon.js' loader of that name.
"""

import json
from collections.abc import Sequence
from typing import Any

from shrm_cli.export.cubes import mirrored, to_lookup
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.harmonics import ext_lights_image_based, in_axes
from shrm_cli.export.pixels import TexelFormat
from shrm_cli.export.quoting import string, uri
from shrm_cli.export.rgbd import RGBD, rgbd_pictures

LOOKUP = mirrored(1, 1, -1)
"""Where a right-handed scene of Babylon.js looks up a world direction."""
_EXTENSION = "EXT_lights_image_based"


class Gltf(Engine):
    """glTF files with EXT_lights_image_based."""

    name = "gltf"
    title = "glTF EXT_lights_image_based"
    least = 16
    """Texels along an edge of the last level, as the extension's text has it."""

    def roughness(self, sizes: Sequence[int]) -> tuple[float, ...]:
        steps = max(len(sizes) - 1, 1)
        return (0.0, *(sizes[0] ** ((k / steps - 1) / 2) for k in range(1, len(sizes))))

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        coefficients = light.nine()
        if not light.levels or coefficients is None:  # the extension asks for both
            return made
        numbers = ext_lights_image_based(in_axes(coefficients, LOOKUP))
        name = f"{light.name}.gltf"
        images: list[dict[str, str]] = []
        levels: list[list[int]] = []
        found = []
        for k, cube in enumerate(light.levels):
            pictures, clipped = rgbd_pictures(to_lookup(cube, LOOKUP), f"level {k}")
            found.append(clipped)
            levels.append(list(range(len(images), len(images) + len(pictures))))
            for face, picture in enumerate(pictures):
                picture_name = f"{light.name}_{k}_{face}.png"
                made.add_bytes(picture_name, picture)
                images.append({"uri": uri(picture_name)})
        made.tell_clipped(name, RGBD, found)
        described = {
            "name": light.name,
            "intensity": 1.0,  # without it Babylon.js makes NaN of the coefficients
            "rotation": [0.0, 0.0, 0.0, 1.0],
            "irradianceCoefficients": numbers.tolist(),
            "specularImageSize": light.levels[0].shape[1],
            "specularImages": levels,
        }
        made.add_text(name, json.dumps(_document(described, images), allow_nan=False))
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


def _document(light: dict[str, Any], images: list[dict[str, str]]) -> dict[str, Any]:
    """Return a glTF document of a scene with nothing but a light."""
    return {
        "asset": {"version": "2.0", "generator": "shrm"},
        "extensionsUsed": [_EXTENSION],
        "extensions": {_EXTENSION: {"lights": [light]}},
        "images": images,
        "scene": 0,
        "scenes": [{"extensions": {_EXTENSION: {"light": 0}}}],
    }


ENGINE = Gltf()
