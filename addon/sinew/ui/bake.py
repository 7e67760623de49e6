"""Operators that bake the selected meshes and play the caches."""

import os
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ..bake import baking, mesh_cache
from ..bake import job as jobs
from . import available
from .in_steps import InSteps, OverFrames
from .operators import selected_meshes

FORMATS = (
    ("pc2", "PC2", "A point cache, little-endian"),
    ("mdd", "MDD", "A point cache, big-endian"),
    ("usd", "USD", "A skeleton where linear skinning gives the shape, otherwise points on each frame"),
)


class BakeSettings(available.Explains, OverFrames):
    """The properties that Bake and BakeFrames, which does the work, share."""

    directory: StringProperty(
        name="Folder", description="Folder for the files; created if it does not exist", subtype="DIR_PATH"
    )
    file_format: EnumProperty(name="Format", description="The file format", items=FORMATS)
    until_subdivision: BoolProperty(
        name="Until Subdivision",
        description="Bake the shape before the first Subdivision Surface modifier, which then works on the cache",
    )
    overwrite: BoolProperty(
        name="Overwrite", description="Replace existing files. If off, a bake that was stopped continues"
    )
    play: BoolProperty(
        name="Play the Cache",
        description="Play the baked files with a Mesh Cache modifier, and switch off the modifiers that it replaces",
    )

    @classmethod
    def why_not(cls, context):
        why = available.other_mode(context, *available.MODES) or available.playing(context)
        return why or ("" if selected_meshes(context) else "Select meshes")

    def job(self: Any, context: bpy.types.Context) -> jobs.Job:
        folder = bpy.path.abspath(self.directory)
        if not folder or folder.startswith("//"):
            raise ValueError("choose a folder for the files; for one beside the .blend, save the .blend first")
        if self.play and self.file_format == jobs.USD:
            raise ValueError("a Mesh Cache modifier plays PC2 and MDD, not USD")
        return jobs.Job(
            folder=os.path.abspath(folder),
            frames=self.frames(context.scene),
            names=tuple(ob.name for ob in selected_meshes(context)),
            format=self.file_format,
            overwrite=self.overwrite,
            until_subdivision=self.until_subdivision,
        )


class Bake(BakeSettings, bpy.types.Operator):
    """Write the shape of the selected meshes on each frame to files that Blender's Mesh Cache modifier and
    other programs can play. The .blend does not change, except that unkeyed changes return to their keyframes, as
    they do whenever the scene plays. Press Esc to stop; the next bake continues from there"""

    bl_idname = "object.sinew_bake"
    bl_label = "Bake"
    bl_options = {"PRESET"}

    filter_folder: BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context, _event):
        if not self.directory and bpy.data.filepath:
            self.directory = bpy.path.abspath("//bake/")
        self.set_frames(context.scene)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def run(self, _context):
        return self.start(bpy.ops.object.sinew_bake_frames)


class BakeFrames(BakeSettings, InSteps, bpy.types.Operator):
    """Bake the selected meshes, frame by frame"""

    bl_idname = "object.sinew_bake_frames"
    bl_label = "Bake Frames"
    bl_options = {"UNDO", "INTERNAL"}
    stopped = "Stopped: the frames that were baked are kept; bake again to continue from there"
    seconds_in_a_row = 0.1

    def run(self, context):
        return self.finish(context, baking.run(context, self.job(context)))

    def invoke(self, context, _event):
        return self.at_once(lambda: self.begin(context, baking.steps(context, self.job(context))))

    def finish(self, context: bpy.types.Context, baked: list[Any]) -> None:
        for each in baked:
            self.report({"INFO"}, each.sentence())
            if self.play:
                mesh_cache.set_up(context, context.view_layer.objects[each.name], each.path)


class PlayCache(available.Explains, bpy.types.Operator):
    """Let Blender's Mesh Cache modifier play a PC2 or MDD file on the active mesh, and switch off the modifiers that
    the cache replaces"""

    bl_idname = "object.sinew_play_cache"
    bl_label = "Play Cache"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(name="File Path", description="The cache file", subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.pc2;*.mdd", options={"HIDDEN"})

    @classmethod
    def why_not(cls, context):
        ob = context.active_object
        why = available.other_mode(context, "OBJECT") or available.no_mesh(ob)
        return why or (f"{ob.name} plays a cache: detach it first" if mesh_cache.is_on(ob) else "")

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def run(self, context):
        mesh_cache.set_up(context, context.active_object, bpy.path.abspath(self.filepath))


class TakeOffCache(available.Explains, bpy.types.Operator):
    """Remove the Mesh Cache modifier from the selected meshes, and restore the switches of their other modifiers"""

    bl_idname = "object.sinew_take_off_cache"
    bl_label = "Detach Cache"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def why_not(cls, context):
        is_any = any(mesh_cache.is_on(ob) for ob in selected_meshes(context))
        return available.other_mode(context, "OBJECT") or ("" if is_any else "Select a mesh that plays a cache")

    def run(self, context):
        for ob in selected_meshes(context):
            if mesh_cache.is_on(ob):
                for name in mesh_cache.take_off(ob):
                    self.report(
                        {"WARNING"}, f"{ob.name} has lost the modifier {name}, which the cache had switched off"
                    )


CLASSES = (Bake, BakeFrames, PlayCache, TakeOffCache)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
