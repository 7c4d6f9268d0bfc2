"""three.js, r187 and later: a prefiltered cube in KTX 2, nine coefficients, and what loads both.

Levels are looked up at ``(K - 1) r (2 - r)``, cubes of files at (-x, y, z). Diffuse surfaces take
the last level, of roughness 1, as ``E / pi``. PMREMGenerator makes just that of it, because it
leaves the shadowing of facets out; so the last level is ``E / pi`` here as well.

The KTX2Loader of three.js makes cubes of block-compressed texels alone, and knows ASTC and not
BC6H. UASTC HDR it shows everywhere. For all else a module of a few lines goes along: it reads the
file by the parser that three.js ships, and hands the levels to a texture of three.js.

References: three.js, KTX2Loader.js, PMREMGenerator.js, PMREMNode.js, WebGLTextures.js
(`uploadCubeTexture`), WebGLMaterials.js (`envMapRotation`), envmap_physical_pars_fragment.glsl.js,
LightProbe.js.
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
STOCK = ("uastc",)
"""Texels that the KTX2Loader of three.js loads by itself, on every device."""


class Three(Engine):
    """three.js: `scene.environment` and `LightProbe`."""

    name = "three"
    title = "three.js"
    formats = ("uastc", "rgba16f", "bc6h", "astc4x4", "astc6x6")
    spare = "rgba16f"
    is_last_diffuse = True
    lamps = 16
    auto = ("uastc", "rgba16f")
    mapping = "filament"
    wants_diffuse = True
    least = 8
    """Texels along an edge of the last level, as PMREMGenerator makes it."""

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        is_stock = texels.name in STOCK
        if not is_stock:
            made.add_bytes(LOADER, files(__package__).joinpath(LOADER).read_bytes())
            names = "loadEnvironment, loadLightProbe"
            made.loading.append(f'import {{ {names} }} from "./{LOADER}";')
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
            made.loading.append("// or, for diffuse light alone:")
            file = string(uri(name))
            if is_stock:
                made.loading += [
                    'import { LightProbe, SphericalHarmonics3 } from "three";',
                    f"const {{ three }} = await (await fetch({file})).json();",
                    "scene.add(new LightProbe(new SphericalHarmonics3().fromArray(three)));",
                ]
            else:
                made.loading.append(f"scene.add(await loadLightProbe({file}));")
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
        if texels.name in STOCK:
            made.told.append(
                "loading: three.js' own KTX2Loader, r187 and later, on every device; --format "
                "rgba16f has the rounding of halves alone, seven times the bytes and our loader"
            )
            made.loading += [
                'import { KTX2Loader } from "three/addons/loaders/KTX2Loader.js";',
                "const loader = new KTX2Loader().detectSupport(renderer);",
                f"scene.environment = await loader.loadAsync({string(uri(name))});",
                "scene.environment.isPMREMTexture = true;",
            ]
        else:
            if texels.name.startswith("astc"):
                made.told.append("loading: WebGLRenderer alone, as WebGPU has no ASTC of light")
            made.loading.append(f"scene.environment = await loadEnvironment({string(uri(name))});")
        made.loading.append("scene.background = scene.environment;")
