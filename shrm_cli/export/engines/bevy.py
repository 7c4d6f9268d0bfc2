"""Bevy: two KTX 2 cubes, one of the levels and one of a white diffuse surface.

Bevy looks cubes up at (x, y, -z), levels at ``r (K - 1)``, and multiplies the diffuse cube with
the albedo, so that it holds E / pi. Its background is the first level, or a sharp cube.

References: Bevy, crates/bevy_pbr/src/light_probe/environment_map.wgsl, and skybox.wgsl.
"""

from shrm_cli.errors import ArgumentError
from shrm_cli.export.cubes import diffuse_cube, ktx2_file, mirrored
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.pixels import TexelFormat
from shrm_cli.export.quoting import string

_LOOKUP = mirrored(1, 1, -1)


class Bevy(Engine):
    """Bevy's `EnvironmentMapLight`."""

    name = "bevy"
    title = "Bevy"
    # No blocks of 6 x 6: wgpu takes whole blocks alone, and no power of two has them.
    formats = ("rgb9e5", "rgba16f", "bc6h", "astc4x4")
    mapping = "linear"
    wants_irradiance = False
    wants_diffuse = True
    takes_skybox = True
    lamps = 10
    least = 8
    """Texels along an edge of the last level: fewer would not show a lobe of roughness 1."""

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        specular, diffuse, skybox = (
            f"{light.name}_{what}.ktx2" for what in ("specular", "diffuse", "skybox")
        )
        if light.levels:
            ktx2_file(made, specular, light.levels, texels, _LOOKUP)
            made.told.append(f"{len(light.levels)} levels of roughness k / {len(light.levels) - 1}")
        if light.diffuse is not None:
            cube = diffuse_cube(light.diffuse)
            ktx2_file(made, diffuse, [cube], texels, _LOOKUP)
            made.told.append("the diffuse cube holds E/pi")
        if light.skybox is not None:
            if light.skybox.shape[1] % texels.edge:
                raise ArgumentError("skybox", f"is no multiple of {texels.edge}, as blocks have it")
            ktx2_file(made, skybox, [light.skybox], texels, _LOOKUP)
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
        if light.skybox is not None or light.levels:
            background = string(specular if light.skybox is None else skybox)
            made.loading += [
                "// bevy::light::Skybox, or bevy::core_pipeline::Skybox before 0.19",
                "commands.entity(camera).insert(Skybox {",
                f"    image: assets.load::<Image>({background}).into(), brightness: 1000.0,",
                "    ..default() });",
            ]
        return made
