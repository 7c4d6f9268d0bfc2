"""What Blender's Python runs: the script of an export, then pictures around the eye by Cycles.

Its arguments are the script, a folder for pictures, and names and directions as JSON.
"""

import json
import math
import runpy
import sys

import bpy
from mathutils import Vector

script, folder, around = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
runpy.run_path(script)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.samples = 4
scene.cycles.use_denoising = False
scene.render.resolution_x = scene.render.resolution_y = 64
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
scene.render.threads_mode, scene.render.threads = "FIXED", 1
camera = bpy.data.cameras.new("camera")
camera.angle = math.pi / 2
eye = bpy.data.objects.new("camera", camera)
scene.collection.objects.link(eye)
scene.camera = eye
for name, (x, y, z) in json.loads(around).items():
    eye.rotation_euler = Vector((x, -z, y)).to_track_quat("-Z", "Y").to_euler()
    scene.render.filepath = f"{folder}/{name}.exr"
    bpy.ops.render.render(write_still=True)
