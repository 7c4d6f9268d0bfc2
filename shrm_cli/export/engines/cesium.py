"""CesiumJS: a cube in KTX 2 and nine coefficients, as its `ImageBasedLighting` takes them.

Levels are looked up at ``r (K - 1)``, where the last level of the file is that of roughness 1.
Directions are (east, up, south) at the place of a model, cubes are looked up there, and the
polynomials of the coefficients make E / pi. Its reader of KTX 2 takes the bytes of a level as they
lie in the file, so that nothing is compressed by Zstandard.

References: CesiumJS, Scene/SpecularEnvironmentCubeMap.js, Scene/Model/Model.js
(`updateReferenceMatrices`), Workers/transcodeKTX2.js, Shaders/Model/ImageBasedLightingStageFS.glsl,
and Shaders/Builtin/Functions/sphericalHarmonics.glsl.
"""

from shrm_cli.arrays import Array
from shrm_cli.export.cubes import WORLD, ktx2_file
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.harmonics import filament
from shrm_cli.export.pixels import TexelFormat
from shrm_cli.export.quoting import string, uri


class Cesium(Engine):
    """CesiumJS' `ImageBasedLighting` of models and 3D Tiles."""

    name = "cesium"
    title = "CesiumJS"
    formats = ("rgba16f",)
    mapping = "linear"
    least = 8
    """Texels along an edge of the last level: fewer would not show a lobe of roughness 1."""

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        options = []
        coefficients = light.nine()
        if coefficients is not None:
            name = f"{light.name}_sh.js"
            made.add_text(name, _module(filament(coefficients)))
            made.loading.append(
                f"import {{ sphericalHarmonicCoefficients }} from {string(f'./{uri(name)}')};"
            )
            options.append("  sphericalHarmonicCoefficients,")
            made.told.append("sh: the polynomials make E / pi")
        if light.levels:
            name = f"{light.name}.ktx2"
            ktx2_file(made, name, light.levels, texels, WORLD, reads_zstd=False)
            options.append(f"  specularEnvironmentMaps: {string(uri(name))},")
            made.told.append(f"{len(light.levels)} levels of roughness k / {len(light.levels) - 1}")
        if options:
            made.loading += [
                'import { ImageBasedLighting } from "cesium";',
                "model.imageBasedLighting = new ImageBasedLighting({",
                *options,
                "});",
            ]
            made.told.append(
                "axes: +X is east at the model, +Y is up, -Z is north; the front of a glTF model "
                "(+Z) looks east"
            )
        return made


def _module(ready: Array) -> str:
    """Return a JavaScript module of coefficients that are ready for the shader, shape (9, 3)."""
    rows = [f"  new Cartesian3({r:.9g}, {g:.9g}, {b:.9g})," for r, g, b in ready.tolist()]
    head = [
        "// L00, L1-1, L10, L11, L2-2, L2-1, L20, L21, L22 of E / pi",
        'import { Cartesian3 } from "cesium";',
        "export const sphericalHarmonicCoefficients = [",
    ]
    return "\n".join([*head, *rows, "];"]) + "\n"
