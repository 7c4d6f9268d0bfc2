"""Filament: two KTX 1 cubes and nine coefficients, as its own tool cmgen writes them.

Levels are looked up at ``(K - 1) r (2 - r)``, cubes at the world direction, and the nine
coefficients are ready for the shader's polynomial, both in a key of the cube and in a text file.

References: Filament's tools/cmgen, libs/ktxreader (`Ktx1Reader.cpp`) and
shaders/src/light_indirect.fs.
"""

from collections.abc import Sequence

from shrm_cli.arrays import Array
from shrm_cli.export.cubes import packed_levels
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.harmonics import filament
from shrm_cli.export.ktx import ktx1_cube
from shrm_cli.export.pixels import TexelFormat
from shrm_cli.export.quoting import comment

_NAMES = ("L00", "L1-1", "L10", "L11", "L2-2", "L2-1", "L20", "L21", "L22")


class Filament(Engine):
    """Filament and gltfio: `createIblFromKtx1`, `createSkyFromKtx1`."""

    name = "filament"
    title = "Filament"
    formats = ("r11g11b10", "rgba16f")
    mapping = "filament"
    lamps = 16
    default_skybox = 512
    takes_skybox = True
    least = 16
    """Texels along an edge of the last level, as cmgen has them: 256 makes five levels."""

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        nine = light.nine()
        metadata = {}
        if nine is not None:
            ready = filament(nine)
            metadata["sh"] = " ".join(f"{value:.9g}" for value in ready.ravel().tolist())
            lines = [
                f"({r: .15f}, {g: .15f}, {b: .15f}); // {name}, irradiance, pre-scaled base"
                for name, (r, g, b) in zip(_NAMES, ready.tolist(), strict=True)
            ]
            made.add_text("sh.txt", "\n".join(lines) + "\n")
            made.told.append("the nine coefficients make E/pi, with the shader's constants in them")
        if light.levels:
            name = f"{light.name}_ibl.ktx"
            made.add_bytes(name, _cube(made, name, light.levels, texels, metadata))
            made.told.append("cubes are for lookups at the world direction")
            made.loading += [
                f"// {comment(name)} as bytes: KTX 1 holds levels and coefficients",
                "auto* ktx = new image::Ktx1Bundle(bytes, size); filament::math::float3 sh[9];",
                "ktx->getSphericalHarmonics(sh);",
                "auto* ibl = IndirectLight::Builder().reflections(ktxreader::Ktx1Reader::"
                "createTexture(engine, ktx, false)).irradiance(3, sh).build(*engine);",
            ]
        elif nine is not None:
            made.loading.append(
                "// float3 sh[9], the lines of sh.txt: IndirectLight::Builder().irradiance(3, sh)"
            )
        if light.skybox is not None:
            name = f"{light.name}_skybox.ktx"
            made.add_bytes(name, _cube(made, name, [light.skybox], texels, {}))
            made.loading.append(
                f"// {comment(name)}: Skybox::Builder().environment(texture).build(*engine)"
            )
        return made


def _cube(
    made: Package, name: str, levels: Sequence[Array], texels: TexelFormat, metadata: dict[str, str]
) -> bytes:
    """Return a KTX 1 file of some levels, and tell what was clipped or lost."""
    packed = packed_levels(made, name, levels, texels)
    return ktx1_cube(packed, levels[0].shape[1], texels, metadata)
