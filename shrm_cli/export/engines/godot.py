"""Godot filters a panorama itself, and its panoramas are ours.

Its sky looks up ``atan(x, -z) / 2 pi`` from the left edge: +Z is in the centre, and +X in the left
quarter.

References
----------
Godot 4, servers/rendering/renderer_rd/shaders/environment/sky.glsl.
"""

from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.latlong import add_exr
from shrm_cli.export.pixels import TexelFormat
from shrm_cli.export.quoting import string


class Godot(Engine):
    """Godot 4's `PanoramaSkyMaterial`."""

    name = "godot"
    title = "Godot"
    default_size = 0
    wants_levels = False
    wants_irradiance = False
    wants_latlong = True

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        if light.latlong is not None:
            name = f"{light.name}_panorama.exr"
            add_exr(made, name, light.latlong, light)
            made.told.append("the panorama lies as Godot's do, +Z in the centre")
            made.loading += [
                "var material := PanoramaSkyMaterial.new()",
                f"material.panorama = load({string(f'res://{name}')})",
                "environment.sky = Sky.new()",
                "environment.sky.sky_material = material",
            ]
        return made


ENGINE = Godot()
