"""Unity filters a lat-long on import; the nine coefficients are ready for its ambient probe.

Unity's axes are left-handed: its importers of glTF take our x for -x. A lat-long that is imported
as a cube has +Z in its centre and Unity's +X in the right quarter, which is our lat-long. How its
import filters is not public; its high definition pipeline filters skies, cubes of 256 texels, with
21 to 89 half vectors for a texel.

References: `SHCoefficients` and ImageBasedLighting.hlsl (`IntegrateLD`) of Unity's package
com.unity.render-pipelines.core; Skybox-Panoramic.shader.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.export.cubes import mirrored
from shrm_cli.export.engine import Light, Package, PanoramaEngine
from shrm_cli.export.engines.coefficients import add_coefficients
from shrm_cli.export.harmonics import in_axes, unity
from shrm_cli.export.latlong import add_exr
from shrm_cli.export.quoting import comment, numbers
from shrm_cli.export.tamed import Sampler
from shrm_cli.probe.proxy import ProxyBox

_AXES = mirrored(-1, 1, 1)


class Unity(PanoramaEngine):
    """Unity's cube textures and `SphericalHarmonicsL2`."""

    name = "unity"
    title = "Unity"
    wants_irradiance = True
    sampler = Sampler(
        edge=256,
        radius=0.5,
        roughness=(0.1024, 0.2151, 0.3424, 0.4917, 0.6814, 1.0),
        bare=(0.32, 0.26, 0.22, 0.17, 0.19, 0.37),
        spread=(0.13, 0.18, 0.19, 0.16, 0.18, 0.37),
    )

    def boxed(self, box: ProxyBox) -> list[str]:
        low, high, at = (np.array(each) for each in (box.low, box.high, box.at))
        place, middle = at * [-1, 1, 1], ((low + high) / 2 - at) * [-1, 1, 1]
        where, center, size = (
            f"new Vector3({numbers(each, 'f')})" for each in (place, middle, high - low)
        )
        return [
            "var probe = new GameObject().AddComponent<ReflectionProbe>();",
            "probe.mode = ReflectionProbeMode.Custom; probe.customBakedTexture = cubemap;",
            f"probe.transform.position = {where}; probe.boxProjection = true;",
            f"probe.center = {center}; probe.size = {size};",
        ]

    def add_panorama(self, made: Package, image: Array, light: Light) -> None:
        add_exr(made, f"{light.name}_latlong.exr", image, light)
        made.told.append("directions (x, y, z) are Unity's (-x, y, z), as glTF importers have it")
        made.loading += [
            "// Texture Shape: Cube, Mapping: Latitude-Longitude, Convolution Type: Specular",
            "// (a Skybox/Panoramic material has Unity's +X in its centre: set Rotation to 90)",
        ]

    def add_nine(self, made: Package, nine: Array, light: Light) -> None:
        ready = unity(in_axes(nine, _AXES))
        meaning = "SphericalHarmonicsL2[channel, index]; Evaluate gives E/pi"
        name = f"{light.name}_sh.json"
        add_coefficients(made, name, ready, meaning, "Unity: left-handed, Y up, x = -x")
        made.told.append("the nine coefficients are in Unity's axes and make E/pi")
        made.loading += [
            f'// red[i] and so on: ["red"][i] of {comment(name)}',
            "var sh = new SphericalHarmonicsL2();",
            "for (int i = 0; i < 9; i++) { sh[0, i] = red[i]; sh[1, i] = green[i]; "
            "sh[2, i] = blue[i]; }",
            "RenderSettings.ambientMode = AmbientMode.Custom;",
            "RenderSettings.ambientProbe = sh;",
        ]
