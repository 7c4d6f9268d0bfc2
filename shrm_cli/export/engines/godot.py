"""Godot filters a panorama itself, and its panoramas are ours.

Its sky looks up ``atan(x, -z) / 2 pi`` from the left edge: +Z is in the centre, and +X in the left
quarter. It is drawn into a cube of 256 texels, of which 7 rougher ones are made: by 32 half vectors
for each texel.

References: Godot 4, servers/rendering/renderer_rd/shaders/environment/sky.glsl and effects/
cubemap_roughness.glsl; the project settings of rendering/reflections/sky_reflections.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.export.engine import Light, Package, PanoramaEngine
from shrm_cli.export.latlong import add_exr
from shrm_cli.export.quoting import numbers, string
from shrm_cli.export.tamed import Sampler
from shrm_cli.probe.proxy import ProxyBox


class Godot(PanoramaEngine):
    """Godot 4's `PanoramaSkyMaterial`."""

    name = "godot"
    title = "Godot"
    lamps = 8
    sampler = Sampler(
        edge=256,
        radius=1.0,
        roughness=(1 / 7, 2 / 7, 3 / 7, 4 / 7, 5 / 7, 6 / 7, 1.0),
        bare=(0.37, 0.38, 0.39, 0.46, 0.47, 0.50, 0.49),
        spread=(0.08, 0.28, 0.34, 0.43, 0.46, 0.48, 0.49),
    )

    def boxed(self, box: ProxyBox) -> list[str]:
        low, high, at = (np.array(each) for each in (box.low, box.high, box.at))
        middle = (low + high) / 2
        return [
            "# a sky has no box; a ReflectionProbe has one, and captures the scene by itself:",
            "var probe := ReflectionProbe.new()",
            f"probe.position = Vector3({numbers(middle)})",
            f"probe.size = Vector3({numbers(high - low)})",
            f"probe.origin_offset = Vector3({numbers(at - middle)})",
            "probe.box_projection = true",
        ]

    def add_panorama(self, made: Package, image: Array, light: Light) -> None:
        name = f"{light.name}_panorama.exr"
        add_exr(made, name, image, light)
        made.told.append("the panorama lies as Godot's do, +Z in the centre")
        made.loading += [
            "var material := PanoramaSkyMaterial.new()",
            f"material.panorama = load({string(f'res://{name}')})",
            "environment.background_mode = Environment.BG_SKY",
            "environment.sky = Sky.new()",
            "environment.sky.sky_material = material",
        ]
