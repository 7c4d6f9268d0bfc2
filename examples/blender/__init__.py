"""A panel in the properties of the world: light of a probe by shrm, and its maps for a BRDF.

It runs the command `shrm`, which may belong to another Python: Blender's own needs no packages.
"""

import json
import os
import runpy
import shlex
import subprocess
from pathlib import Path

import bpy

PREVIEW = "shrm preview"


def words_of(command):
    """The words of a command, in which Windows' backslashes are parts of paths."""
    found = shlex.shlex(command, posix=True)
    found.whitespace_split, found.commenters = True, ""
    if os.sep == "\\":
        found.escape = ""
    return list(found)


class ShrmPreferences(bpy.types.AddonPreferences):
    """Where the command is."""

    bl_idname = __package__

    command: bpy.props.StringProperty(
        name="Command", default="shrm",
        description="The command shrm, with its path, or python -m shrm_cli",
    )  # fmt: skip

    def draw(self, context):
        self.layout.prop(self, "command")


class ShrmSettings(bpy.types.PropertyGroup):
    """What is asked for, and what was made of it."""

    probe: bpy.props.StringProperty(
        name="Probe", subtype="FILE_PATH",
        description="An image of any layout, a light file, or a stage of USD",
    )  # fmt: skip
    brdf: bpy.props.StringProperty(
        name="BRDF", default="ggx:roughness=0.4", description="As shrm brdf lists them"
    )
    folder: bpy.props.StringProperty(
        name="Folder", subtype="DIR_PATH", default="//shrm",
        description="Where files are written; a temporary folder while the blend file has no name",
    )  # fmt: skip
    map: bpy.props.StringProperty(name="Map", subtype="FILE_PATH")


class _Job:
    """An operator that runs `shrm`, and reports what it says."""

    @classmethod
    def poll(cls, context):
        return bool(context.scene.shrm.probe)

    def execute(self, context):
        settings = context.scene.shrm
        folder = Path(bpy.path.abspath(settings.folder))
        if settings.folder.startswith("//") and not bpy.data.filepath:
            folder = Path(bpy.app.tempdir) / "shrm"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.work(context, settings, Path(bpy.path.abspath(settings.probe)), folder)
        except (RuntimeError, OSError, ValueError) as error:
            self.report({"ERROR"}, " ".join(str(error).split()))
            return {"CANCELLED"}
        return {"FINISHED"}

    def run(self, context, *arguments):
        """Run the command; return what it prints, or raise RuntimeError with the line of errors."""
        command = context.preferences.addons[__package__].preferences.command
        line = [*words_of(command), *map(str, arguments)]
        try:
            done = subprocess.run(line, capture_output=True, text=True, encoding="utf-8")
        except FileNotFoundError:
            raise RuntimeError(f"there is no command {line[0]}; name it in Preferences") from None
        if done.returncode:
            said = (done.stderr.strip() or "shrm failed").splitlines()[-1]
            raise RuntimeError(said.removeprefix("Error: "))
        for warning in done.stderr.strip().splitlines():
            self.report({"WARNING"}, warning)
        return done.stdout


class SHRM_OT_world(_Job, bpy.types.Operator):
    """Make the world of the scene from the probe."""

    bl_idname = "shrm.world"
    bl_label = "Set World"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    def work(self, context, settings, probe, folder):
        world = folder / "world"
        asked = "--for", "blender", "--force", "--json", "-o", world
        told = json.loads(self.run(context, "export", probe, *asked))
        (script,) = (each["name"] for each in told["files"] if each["name"].endswith(".py"))
        runpy.run_path(str(world / script))


class SHRM_OT_prefilter(_Job, bpy.types.Operator):
    """Prefilter the probe for the BRDF, and show the map on a ball."""

    bl_idname = "shrm.prefilter"
    bl_label = "Prefilter"

    def work(self, context, settings, probe, folder):
        target, picture = folder / f"{probe.stem}.map.exr", folder / f"{probe.stem}.map.png"
        self.run(context, "prefilter", probe, "--brdf", settings.brdf, "--force", "-o", target)
        self.run(
            context, "render", target, "--size", 256, "--exposure",
            context.scene.view_settings.exposure, "-o", picture,
        )  # fmt: skip
        settings.map = str(target)
        old = bpy.data.images.get(PREVIEW)
        if old is not None:
            bpy.data.images.remove(old)
        image = bpy.data.images.load(str(picture))
        image.name = PREVIEW
        image.preview_ensure()


class SHRM_OT_view(_Job, bpy.types.Operator):
    """Open the map beside the truth in the browser."""

    bl_idname = "shrm.view"
    bl_label = "View"

    @classmethod
    def poll(cls, context):
        return bool(context.scene.shrm.map)

    def work(self, context, settings, probe, folder):
        page = folder / f"{probe.stem}.html"
        self.run(context, "view", bpy.path.abspath(settings.map), "--probe", probe, "-o", page)
        if not bpy.app.background:
            bpy.ops.wm.url_open(url=page.as_uri())


class SHRM_PT_world(bpy.types.Panel):
    """The panel."""

    bl_label = "shrm"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "world"

    def draw(self, context):
        layout, settings = self.layout, context.scene.shrm
        layout.use_property_split = True
        layout.prop(settings, "probe")
        layout.prop(settings, "folder")
        layout.operator("shrm.world", icon="WORLD")
        layout.prop(settings, "brdf")
        row = layout.row()
        row.operator("shrm.prefilter", icon="SPHERE")
        row.operator("shrm.view", icon="URL")
        image = bpy.data.images.get(PREVIEW)
        if image is not None and image.preview is not None:
            layout.template_icon(icon_value=image.preview.icon_id, scale=8)


CLASSES = (
    ShrmPreferences, ShrmSettings, SHRM_OT_world, SHRM_OT_prefilter, SHRM_OT_view, SHRM_PT_world,
)  # fmt: skip


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.shrm = bpy.props.PointerProperty(type=ShrmSettings)


def unregister():
    del bpy.types.Scene.shrm
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
