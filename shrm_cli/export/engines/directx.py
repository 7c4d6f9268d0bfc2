"""DDS cubes for programs that use DirectX, and for tools that read its textures.

DirectX itself has no law of levels; they are those of glTF's sampler, linear in roughness.
"""

from shrm_cli.export.cubes import packed_levels
from shrm_cli.export.dds import dds_cube
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.engines.coefficients import coefficients_json
from shrm_cli.export.pixels import TexelFormat
from shrm_cli.export.quoting import string


class DirectX(Engine):
    """Readers of DDS files with the extension DX10."""

    name = "directx"
    title = "DirectX (DDS)"
    formats = ("rgba16f", "rgb9e5", "r11g11b10", "bc6h")
    mapping = "linear"
    least = 8

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        if light.levels:
            name = f"{light.name}.dds"
            data = packed_levels(made, name, light.levels, texels)
            made.add_bytes(name, dds_cube(data, light.levels[0].shape[1], texels))
            made.told += [
                "axes: sample at (x, y, z) of right-handed axes with y up, or in a left-handed "
                "world at (x, y, -z)",
                "levels: sample level r (K - 1) for the perceptual roughness r",
            ]
            made.loading += [
                f"DirectX::CreateDDSTextureFromFile(device, L{string(name)}, nullptr, &view);",
                f"color = cube.SampleLevel(trilinear, R, roughness * {len(light.levels) - 1});",
            ]
        coefficients = light.nine()
        if coefficients is not None:
            made.add_text(f"{light.name}_sh.json", coefficients_json(coefficients))
            made.told.append("sh: nine coefficients, in each convention by its name")
        return made
