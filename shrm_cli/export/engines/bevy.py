"""Bevy: two KTX 2 cubes, one of the levels and one of a white diffuse surface.

Bevy looks cubes up at (x, y, -z), levels at ``r (K - 1)``, and multiplies the diffuse cube with
the albedo, so that it holds E / pi.

References: Bevy, crates/bevy_pbr/src/light_probe/environment_map.wgsl.
"""

from shrm_cli.export.cubes import diffuse_cube, ktx2_file, mirrored
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.pixels import TexelFormat
from shrm_cli.export.quoting import string

_LOOKUP = mirrored(1, 1, -1)


class Bevy(Engine):
    """Bevy's `EnvironmentMapLight`."""

    name = "bevy"
    title = "Bevy"
    formats = ("rgb9e5", "rgba16f", "bc6h", "astc4x4", "astc6x6")
    mapping = "linear"
    wants_irradiance = False
    wants_diffuse = True
    lamps = 10
    least = 8
    """Texels along an edge of the last level: fewer would not show a lobe of roughness 1."""

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        specular, diffuse = f"{light.name}_specular.ktx2", f"{light.name}_diffuse.ktx2"
        if light.levels:
            ktx2_file(made, specular, light.levels, texels, _LOOKUP)
            made.told.append(f"{len(light.levels)} levels of roughness k / {len(light.levels) - 1}")
        if light.diffuse is not None:
            cube = diffuse_cube(light.diffuse)
            ktx2_file(made, diffuse, [cube], texels, _LOOKUP)
            made.told.append("the diffuse cube holds E/pi")
        made.told.append("cubes are mirrored, z to -z, as Bevy looks them up")
        made.loading += [
            "// features: ktx2, zstd_rust",
            "commands.entity(camera).insert(EnvironmentMapLight {",
            f"    diffuse_map: assets.load({string(diffuse)}),"
            if light.diffuse is not None
            else "    // diffuse_map: none here; export an irradiance map, too",
            f"    specular_map: assets.load({string(specular)}),"
            if light.levels
            else "    // specular_map: none here; export a split sum, too",
            "    intensity: 1000.0, ..default() });",
        ]
        return made
