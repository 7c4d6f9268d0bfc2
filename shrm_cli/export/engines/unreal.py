"""Unreal filters a lat-long on import; the nine coefficients are those of its `FSHVectorRGB3`.

Unreal's axes are left-handed with Z up: its importer of glTF exchanges y and z. A lat-long has
Unreal's -Y in its centre and +X in the right quarter: ours turned by 180 degrees.

References: `LookupLongLat` of Unreal's texture compressor, `ConvertVec3` of its glTF importer, and
`TSHVector<3>::SHBasisFunction`, which has the Condon-Shortley phase.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.export.engine import Light, Package, PanoramaEngine
from shrm_cli.export.engines.coefficients import add_coefficients
from shrm_cli.export.harmonics import in_axes, unreal
from shrm_cli.export.latlong import add_exr, rolled
from shrm_cli.export.quoting import comment, numbers
from shrm_cli.probe.proxy import ProxyBox

_AXES = np.array([[1.0, 0, 0], [0, 0, 1], [0, 1, 0]])


class Unreal(PanoramaEngine):
    """Unreal's cube textures from lat-longs, and `FSHVectorRGB3`."""

    name = "unreal"
    title = "Unreal"
    wants_irradiance = True

    def boxed(self, box: ProxyBox) -> list[str]:
        low, high, at = (100 * np.array(each)[[0, 2, 1]] for each in (box.low, box.high, box.at))
        middle = (low + high) / 2
        return [
            "// or a Box Reflection Capture, Source Type Specified Cubemap; from metres:",
            f"// Location {numbers(middle)}; Scale {numbers((high - low) / 2)}; "
            f"Capture Offset {numbers(at - middle)}",
        ]

    def add_panorama(self, made: Package, image: Array, light: Light) -> None:
        name = f"{light.name}_longlat.exr"
        add_exr(made, name, rolled(image, 180), light)
        made.told.append(
            "directions (x, y, z) are Unreal's (x, z, y), as glTF importers have it; the "
            "lat-long is turned by 180 degrees for it"
        )
        made.loading += [
            f"// drag {comment(name)} into the content browser: it becomes a Texture Cube",
            "// SkyLight: Source Type SLS Specified Cubemap, Cubemap: this one",
        ]

    def add_nine(self, made: Package, nine: Array, light: Light) -> None:
        name = f"{light.name}_sh.json"
        meaning = "FSHVectorRGB3 R, G, B .V[index]: radiance, with Condon-Shortley phase"
        ready = unreal(in_axes(nine, _AXES))
        add_coefficients(made, name, ready, meaning, "Unreal: left-handed, Z up, (x, z, y)")
        made.told.append("the nine coefficients are of radiance, in Unreal's axes and basis")
        made.loading.append(f"// {comment(name)}: FSHVectorRGB3 sh; sh.R.V[i] = red[i]; ...")
