"""``shrm export probe.exr --for ambient-cube``."""

import json

from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.pixels import TexelFormat
from shrm_moon.ambient_cube import AXES

NAMES = ("+x", "-x", "+y", "-y", "+z", "-z")


class AmbientCube(Engine):
    """Half-Life 2's: what white diffuse surfaces reflect that face along the axes.

    McTaggart 2004, Half-Life 2 / Valve Source Shading, Game Developers Conference.
    """

    name = "ambient-cube"
    title = "programs with ambient cubes"
    wants_levels = False

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        if light.irradiance is not None:
            values = light.irradiance.radiance(AXES, AXES)
            cube = dict(zip(NAMES, values.tolist(), strict=True))
            made.add_text(f"{light.name}_cube.json", json.dumps(cube, indent=1) + "\n")
            made.told.append("cube: irradiance / pi along each axis; nothing is turned")
            made.loading.append("color = sum of n[i] * n[i] * cube[the side of n[i]]")
        return made
