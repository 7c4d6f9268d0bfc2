"""RealityKit, and with it ARKit's scenes, filters a lat-long itself: `EnvironmentResource`.

A lat-long begins behind, at RealityKit's +Z, and runs clockwise along the horizon: -Z is in its
centre and -X in the left quarter, which is ours turned by 180 degrees. Axes are those of glTF.

References: Apple's documentation of `TextureResource.init(cubeFromEquirectangular:)`,
`EnvironmentResource` and `ImageBasedLightComponent`.
"""

from shrm_cli.arrays import Array
from shrm_cli.export.engine import Light, Package, PanoramaEngine
from shrm_cli.export.latlong import add_exr, rolled
from shrm_cli.export.quoting import string


class RealityKit(PanoramaEngine):
    """RealityKit's `EnvironmentResource`, for visionOS, iOS and macOS."""

    name = "realitykit"
    title = "RealityKit"

    def add_panorama(self, made: Package, image: Array, light: Light) -> None:
        name = f"{light.name}_skybox.exr"
        add_exr(made, name, rolled(image, 180), light)
        made.told.append("the panorama is turned by 180 degrees: -Z is in its centre")
        made.loading += [
            "// a file of the app's bundle; or in a folder NAME.skybox, which Xcode compiles,",
            '// for EnvironmentResource(named: "NAME")',
            f"let url = Bundle.main.url(forResource: {string(name)}, withExtension: nil)!",
            "let source = CGImageSourceCreateWithURL(url as CFURL, nil)!",
            "let image = CGImageSourceCreateImageAtIndex(source, 0, nil)!",
            "let environment = try await EnvironmentResource(equirectangular: image)",
            "root.components.set(ImageBasedLightComponent(source: .single(environment)))",
            "model.components.set(ImageBasedLightReceiverComponent(imageBasedLight: root))",
        ]
