"""Operators that add a crowd of a character in the scene or of a rig folder, and renew it."""

import bpy
from bpy.props import IntProperty, StringProperty

from ..blender import selection
from ..crowd import making
from ..feedback import progress
from . import available


class AddCrowd(available.Explains, bpy.types.Operator):
    """Add many agents that play the clip of the active character, each starting at a different moment, and walk along
    the selected curve or a circle. The shapes of the clip are computed once, so the crowd plays without armatures and
    without Sinew"""

    bl_idname = "object.sinew_crowd_add"
    bl_label = "Sinew Crowd"
    bl_options = {"REGISTER", "UNDO"}
    modes = ("OBJECT",)

    filepath: StringProperty(
        name="Rig",
        description="Skeleton file of a rig folder with poses; empty: the active character",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    filter_glob: StringProperty(default="*.bf;*.tgf", options={"HIDDEN"})
    pose: StringProperty(name="Poses", description="File of the poses, beside the skeleton; empty: pose.dmat")
    agents: IntProperty(name="Agents", description="Number of agents", default=100, min=1, soft_max=10_000)
    lanes: IntProperty(name="Lanes", description="How many walk side by side; 0: as many as the agents need", min=0)
    shapes: IntProperty(
        name="Shapes", description="How many moments of the clip become meshes; 0: one per frame", min=0, soft_max=128
    )
    frame_start: IntProperty(
        name="First Frame", description="The first frame of the clip; by default that of the action, or of the scene"
    )
    frame_end: IntProperty(
        name="Last Frame",
        description="The last frame of the clip. If it shows the same pose as the first one, the cycle ends before it",
    )
    seed: IntProperty(name="Seed", description="A different number gives a different crowd")

    def draw(self, _context):
        self.layout.use_property_split = True
        names = ["agents", "lanes", "shapes", "seed"]
        names += ["filepath", "pose"] if self.filepath else ["frame_start", "frame_end"]
        for name in names:
            self.layout.prop(self, name)

    def run(self, context):
        path = next((ob for ob in context.selected_objects if ob.type == "CURVE"), None)
        with progress.shown(context) as shown:
            origin = self.source(context)
            made = origin.phases(context, shown)
            ob = making.build(context, made, self.agents, path, self.lanes, self.seed)
        origin.keep(ob)
        selection.select(context, ob, (ob,))
        self.report({"INFO"}, f"{self.agents:,} agents, {made.count} shapes of {made.frames:g} frames")

    def source(self, context: bpy.types.Context) -> making.Source:
        if self.filepath:
            return making.Source(filepath=self.filepath, pose=self.pose, count=self.shapes)
        candidates = [context.active_object, *context.selected_objects]
        found = next((ob for ob in candidates if ob is not None and ob.type in {"MESH", "ARMATURE"}), None)
        if found is None:
            raise ValueError("select a character first: a mesh, or the armature of visible meshes")
        first, last = (
            float(getattr(self, name)) if self.properties.is_property_set(name) else None
            for name in ("frame_start", "frame_end")
        )
        return making.Source(character=found.name, count=self.shapes, first=first, last=last)


class RenewCrowd(available.Explains, bpy.types.Operator):
    """Compute the shapes of the active crowd again, after its character or the clip has changed"""

    bl_idname = "object.sinew_crowd_renew"
    bl_label = "Renew Crowd"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def why_not(cls, context):
        ob = context.active_object
        is_crowd = ob is not None and making.modifier_of(ob) is not None
        return available.other_mode(context, "OBJECT") or ("" if is_crowd else "Select a crowd")

    def run(self, context):
        ob = context.active_object
        origin = making.kept(ob)
        if origin is None:
            raise ValueError(f"{ob.name} does not know what it was made from: add another crowd")
        with progress.shown(context) as shown:
            made = origin.phases(context, shown)
        making.renew(context.scene, ob, made)
        self.report({"INFO"}, f"{made.count} shapes of {made.frames:g} frames")


CLASSES = (AddCrowd, RenewCrowd)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
