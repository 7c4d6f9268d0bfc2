"""What Blender's Python runs: the extension is installed, and shows a ball in its world.

Its arguments are the folder of the extension, the command, a probe, a folder for what is made,
and azimuth and elevation of the view in degrees.
"""

import math
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
from mathutils import Vector

source, command, probe, folder, azimuth, elevation = sys.argv[1:]
tool = Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core/bl_pkg/cli/blender_ext.py"
for line in (
    ["validate", source],
    ["build", "--source-dir", source, "--output-filepath", f"{folder}/shrm_light.zip"],
):
    subprocess.run([sys.executable, str(tool), *line], check=True)
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.preferences.addon_enable(module="bl_pkg")
bpy.ops.extensions.package_install_files(
    filepath=f"{folder}/shrm_light.zip", repo="user_default", enable_on_install=True
)
addons = bpy.context.preferences.addons
(addon,) = (addons[name] for name in addons.keys() if name.endswith(".shrm_light"))  # noqa: SIM118
addon.preferences.command = command
scene = bpy.context.scene
settings = scene.shrm
settings.probe, settings.brdf, settings.folder = probe, "lambertian", f"{folder}/out"
assert bpy.ops.shrm.world() == {"FINISHED"}
assert bpy.ops.shrm.prefilter() == {"FINISHED"}
assert Path(settings.map).is_file()
assert tuple(bpy.data.images["shrm preview"].size) == (256, 256)
assert bpy.ops.shrm.view() == {"FINISHED"}
assert Path(folder, "out", f"{Path(probe).stem}.html").is_file()
settings.brdf = "no such"
said = ""
try:
    bpy.ops.shrm.prefilter()
except RuntimeError as error:
    said = str(error)
assert "no such" in said, said


class Layout:
    """Takes what a panel draws, if Blender has it: nothing is drawn without a window."""

    shown = None

    def prop(self, data, name):
        assert name in data.bl_rna.properties

    def operator(self, name, icon):
        assert getattr(bpy.ops.shrm, name.removeprefix("shrm.")).poll()
        assert icon in bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items

    def row(self):
        return self

    def template_icon(self, icon_value, scale):
        self.shown = icon_value


layout = Layout()
bpy.types.SHRM_PT_world.draw(SimpleNamespace(layout=layout), bpy.context)
assert layout.shown is not None  # it is 0 where Blender has no window
bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=64)
ball = bpy.context.object
bpy.ops.object.shade_smooth()
scene.render.engine = "CYCLES"
scene.cycles.samples = 512
scene.cycles.use_denoising = False
scene.render.resolution_x = scene.render.resolution_y = 32
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
scene.render.threads_mode, scene.render.threads = "FIXED", 1
camera = bpy.data.cameras.new("camera")
camera.type, camera.ortho_scale = "ORTHO", 1 / 0.45
eye = bpy.data.objects.new("camera", camera)
scene.collection.objects.link(eye)
scene.camera = eye
turn, rise = math.radians(float(azimuth)), math.radians(float(elevation))
x, y, z = math.sin(turn) * math.cos(rise), math.sin(rise), math.cos(turn) * math.cos(rise)
toward = Vector((x, -z, y))
eye.location, eye.rotation_euler = 10 * toward, (-toward).to_track_quat("-Z", "Y").to_euler()
for kind in ("Diffuse", "Glossy"):
    material = bpy.data.materials.new(kind)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    node = nodes.new("ShaderNodeBsdfDiffuse" if kind == "Diffuse" else "ShaderNodeBsdfAnisotropic")
    node.inputs["Color"].default_value = (1, 1, 1, 1)
    if kind == "Glossy":
        node.distribution = "GGX"
        node.inputs["Roughness"].default_value = 0.5
    links.new(node.outputs["BSDF"], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    ball.data.materials.clear()
    ball.data.materials.append(material)
    scene.render.filepath = f"{folder}/{kind}.exr"
    bpy.ops.render.render(write_still=True)
