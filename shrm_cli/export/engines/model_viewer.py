"""<model-viewer> filters a panorama itself, by the filter of three.js.

Its panoramas have +X in the centre and +Z in the right quarter: ours turned by 90 degrees.

References: three.js, ShaderChunk/common.glsl.js (`equirectUv`); @google/model-viewer,
TextureUtils.ts, which reads Radiance files where the name ends in ``.hdr``.
"""

from shrm_cli.arrays import Array
from shrm_cli.export.engine import Light, Package, PanoramaEngine
from shrm_cli.export.latlong import add_radiance, rolled
from shrm_cli.export.quoting import uri

_ROWS = 1024
"""Rows of a panorama from which its filter is as good as it becomes within reason."""


class ModelViewer(PanoramaEngine):
    """The web component `<model-viewer>`, by its attribute `environment-image`."""

    name = "model-viewer"
    title = "<model-viewer>"

    def add_panorama(self, made: Package, image: Array, light: Light) -> None:
        name = f"{light.name}.hdr"
        add_radiance(made, name, rolled(image, 90))
        made.told.append("the panorama is turned by 90 degrees: +X is in its centre")
        if image.shape[0] < _ROWS:
            made.told.append(
                "it filters better what has more rows: at roughness .5 it is 22 % from GGX "
                f"with 256, 15 % with `--size {_ROWS}`"
            )
        address = uri(name)
        made.loading += [
            f'<model-viewer src="model.glb" environment-image="{address}"',
            f'  skybox-image="{address}" tone-mapping="neutral"></model-viewer>',
        ]
