"""Khronos' glTF-Sample-Viewer, and readers of what its glTF-IBL-Sampler writes.

The viewer's package takes a Radiance panorama alone and filters it itself; its code for filtered
KTX 2 files is commented out. Other renderers read the sampler's KTX 2 cubes and table: they look
cubes up at the world direction, and levels at ``r (K - 1)``.

References: @khronosgroup/gltf-viewer 1.1, `_loadEnvironmentFromPanorama`, `iblSampler`, `ibl.glsl`.
"""

from functools import partial

from shrm_cli.export.cubes import WORLD, diffuse_cube, ktx2_file
from shrm_cli.export.engine import Engine, Light, OutputFile, Package
from shrm_cli.export.latlong import add_radiance
from shrm_cli.export.pixels import TexelFormat
from shrm_cli.export.quoting import string, uri
from shrm_cli.export.table import write_texture


class GltfSampleViewer(Engine):
    """glTF-Sample-Viewer, and the cubes of glTF-IBL-Sampler."""

    name = "gltf-sample-viewer"
    title = "glTF-Sample-Viewer"
    formats = ("rgba16f", "rgb9e5", "r11g11b10")
    mapping = "linear"
    wants_irradiance = False
    wants_diffuse = True
    wants_latlong = True
    latlong_rows = 512  # it reads single pixels, at the middles of the texels of a cube of 256
    takes_table = True
    lobes = ("ggx", "charlie")
    least = 16
    """Texels along an edge of the last level: the viewer leaves out the smallest mips of 256."""

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        if light.latlong is not None:
            name = f"{light.name}.hdr"
            add_radiance(made, name, light.latlong)
            made.told.append(
                "the panorama is right at the viewer's default rotation of 90 degrees; of more "
                f"than {self.latlong_rows} rows it would skip pixels"
            )
            load = "view.createResourceLoader().loadEnvironment"
            made.loading.append(f"state.environment = await {load}({string(uri(name))});")
        if light.levels:
            ktx2_file(made, f"{light.name}_{light.lobe}.ktx2", light.levels, texels, WORLD)
        if light.diffuse is not None:
            cube = diffuse_cube(light.diffuse)
            ktx2_file(made, f"{light.name}_lambertian.ktx2", [cube], texels, WORLD)
        if light.levels or light.diffuse is not None:
            made.told.append(
                "cubes are for lookups at the world direction, the diffuse one holds E/pi; the "
                "viewer itself reads the panorama alone"
            )
            made.loading.append(
                f"// {light.lobe}: textureLod(cube, R, r * (levels - 1)); "
                "lambertian: albedo * texture(cube, N)"
            )
        if light.table is not None:
            # As a picture: red is the scale, green the bias, blue is 0.
            write = partial(write_texture, table=light.table)
            made.files.append(OutputFile(f"{light.name}_lut_ggx.png", write))
            made.told.append(
                "the table has N.V across and the roughness down, from 0 in the first row"
            )
        return made
