"""Blender: a panorama, and a script that makes a world of it.

Blender is Z-up: its importer of glTF takes our (x, y, z) for (x, -z, y). An environment texture has
its +X in the centre and -Y to the right of it, so that ours is turned by 90 degrees. Cycles samples
it as it is; EEVEE filters it itself.

References: Blender, intern/cycles/kernel/camera/projection.h
(`direction_to_equirectangular_range`).
"""

from shrm_cli.arrays import Array
from shrm_cli.export.engine import Light, Package, PanoramaEngine
from shrm_cli.export.latlong import add_exr, rolled
from shrm_cli.export.quoting import word

_SCRIPT = """\
# Makes a world of the picture beside this file, for the current scene: blender --python FILE
from pathlib import Path

import bpy

NAME = {name}
picture = bpy.data.images.load(str(Path(__file__).resolve().parent / {file}))
picture.colorspace_settings.name = "Linear Rec.709"
world = bpy.data.worlds.new(NAME)
world.use_nodes = True
nodes, links = world.node_tree.nodes, world.node_tree.links
nodes.clear()
texture = nodes.new("ShaderNodeTexEnvironment")
texture.image = picture
background = nodes.new("ShaderNodeBackground")
background.inputs["Strength"].default_value = 1.0
output = nodes.new("ShaderNodeOutputWorld")
links.new(texture.outputs["Color"], background.inputs["Color"])
links.new(background.outputs["Background"], output.inputs["Surface"])
for column, node in enumerate((texture, background, output)):
    node.location = (300 * column, 0)
bpy.context.scene.world = world
"""


class Blender(PanoramaEngine):
    """Blender's world, of Cycles and EEVEE."""

    name = "blender"
    title = "Blender"

    def add_panorama(self, made: Package, image: Array, light: Light) -> None:
        name, script = f"{light.name}_world.exr", f"{light.name}_world.py"
        add_exr(made, name, rolled(image, 90), light, "auto")
        made.add_text(script, _SCRIPT.format(name=ascii(light.name), file=ascii(name)))
        made.told.append(
            "directions (x, y, z) are Blender's (x, -z, y), as its glTF importer has it; the "
            "panorama is turned by 90 degrees for it"
        )
        made.loading += [
            f"# blender scene.blend --python {word(script)}",
            "# or open it in the workspace Scripting, and choose Text, Run Script",
        ]
