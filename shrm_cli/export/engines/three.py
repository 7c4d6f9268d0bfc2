"""three.js, r187 and later: a prefiltered cube in KTX 2, nine coefficients, and what loads both.

Levels are looked up at ``(K - 1) r (2 - r)``, cubes of files at (-x, y, z). Diffuse surfaces take
the last level, of roughness 1, as ``E / pi``. PMREMGenerator makes just that of it, because it
leaves the shadowing of facets out; so the last level is ``E / pi`` here as well.

The KTX2Loader of three.js makes cubes of block-compressed texels alone, and knows ASTC and not
BC6H. So a module of a few lines goes along: it reads the file by the parser that three.js ships,
and hands the levels to a texture of three.js.

References
----------
three.js, PMREMGenerator.js, WebGLTextures.js (`uploadCubeTexture`), WebGLMaterials.js
(`envMapRotation`), envmap_physical_pars_fragment.glsl.js, LightProbe.js.
"""

from importlib.resources import files

from shrm_cli.export.cubes import diffuse_cube, ktx2_file, mirrored
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.engines.coefficients import coefficients_json
from shrm_cli.export.pixels import TexelFormat
from shrm_cli.export.quoting import string, uri

LOOKUP = mirrored(-1, 1, 1)
LOADER = "shrm-environment.js"
"""The module that loads the files; it lies beside this one."""


class Three(Engine):
    """three.js: `scene.environment` and `LightProbe`."""

    name = "three"
    title = "three.js"
    formats = ("rgba16f", "bc6h", "uastc", "astc4x4", "astc6x6")
    mapping = "filament"
    wants_diffuse = True
    least = 8
    """Texels along an edge of the last level, as PMREMGenerator makes it."""

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        script = files(__package__).joinpath(LOADER).read_bytes()
        made.add_bytes(LOADER, script)
        if light.levels:
            self._add_cube(made, light, texels)
        coefficients = light.nine()
        if coefficients is not None:
            name = f"{light.name}_sh.json"
            made.add_text(name, coefficients_json(coefficients))
            made.told.append(
                "sh: a LightProbe holds plain lighting coefficients; scene.environment lights "
                "diffuse surfaces already, so use either"
            )
            made.loading += [
                "// or, for diffuse light alone:",
                f"scene.add(await loadLightProbe({string(uri(name))}));",
            ]
        return made

    def _add_cube(self, made: Package, light: Light, texels: TexelFormat) -> None:
        name = f"{light.name}.ktx2"
        levels = list(light.levels)
        if light.diffuse is not None:
            levels[-1] = diffuse_cube(light.diffuse, levels[-1].shape[1])
            made.told.append("the last level is E / pi, because diffuse surfaces take it")
        ktx2_file(made, name, levels, texels, LOOKUP)
        made.told += [
            "axes: three.js looks a cube of a file up at (-x, y, z), so the cube is mirrored in x",
            "levels: roughness 1 - sqrt(1 - k / (K - 1))",
        ]
        made.loading += [
            f'import {{ loadEnvironment, loadLightProbe }} from "./{LOADER}";',
            f"scene.environment = await loadEnvironment({string(uri(name))});",
            "scene.background = scene.environment;",
        ]


ENGINE = Three()
