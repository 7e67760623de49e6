"""Adds a crowd of a character that is in the scene, or of a rig folder."""

import bpy
from bpy.props import IntProperty, StringProperty

from ..bake import evaluation
from ..binding import bindable
from ..crowd import crowd, phases
from ..feedback import progress
from ..rigs import rig_import
from .operators import meshes_of, selected_armature


class AddCrowd(bpy.types.Operator):
    """Add many agents that play the clip of the active character, each at a moment of its own, and walk along the
    selected curve or a circle. The shapes of the clip are made once: the crowd plays without armatures, and without
    Sinew"""

    bl_idname = "object.sinew_crowd_add"
    bl_label = "Sinew Crowd"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(
        name="Rig",
        description="Skeleton file of a rig folder with poses; empty: the active character",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    filter_glob: StringProperty(default="*.bf;*.tgf", options={"HIDDEN"})
    pose: StringProperty(name="Poses", description="File of the poses, beside the skeleton; empty: pose.dmat")
    agents: IntProperty(name="Agents", description="How many there are", default=100, min=1, soft_max=10_000)
    lanes: IntProperty(name="Lanes", description="How many walk side by side; 0: so many that they have room", min=0)
    shapes: IntProperty(
        name="Shapes", description="How many moments of the clip there are; 0: one a frame", min=0, soft_max=128
    )
    frame_start: IntProperty(name="First Frame", description="Of the clip; without it that of the action, or the scene")
    frame_end: IntProperty(
        name="Last Frame",
        description="Of the clip. If it shows the character as the first one does, the cycle ends before it",
    )
    seed: IntProperty(name="Seed", description="Another number, another crowd")

    @classmethod
    def poll(cls, context):
        return context.mode == "OBJECT"

    def draw(self, _context):
        self.layout.use_property_split = True
        names = ["agents", "lanes", "shapes", "seed"]
        names += ["filepath", "pose"] if self.filepath else ["frame_start", "frame_end"]
        for name in names:
            self.layout.prop(self, name)

    def execute(self, context):
        path = next((ob for ob in context.selected_objects if ob.type == "CURVE"), None)
        try:
            with progress.shown(context) as shown:
                made = self._of_rig() if self.filepath else self._of_character(context, shown)
                ob = crowd.build(context, made, self.agents, path, self.lanes, self.seed)
        except (ValueError, OSError, MemoryError) as error:
            self.report({"ERROR"}, str(error) or "There is not enough memory")
            return {"CANCELLED"}
        for other in context.selected_objects:
            other.select_set(False)
        ob.select_set(True)
        context.view_layer.objects.active = ob
        self.report({"INFO"}, f"{self.agents:,} agents, {made.count} shapes of {made.frames:g} frames")
        return {"FINISHED"}

    def _of_rig(self):
        path = bpy.path.abspath(self.filepath)
        return phases.of_rig(path, rig_import.ImportOptions(pose=self.pose), self.shapes)

    def _of_character(self, context, shown):
        objects, name = character(context)
        frames = clip_range(context, objects)
        for number, given in enumerate(("frame_start", "frame_end")):
            if self.properties.is_property_set(given):
                frames[number] = getattr(self, given)
        if frames[1] < frames[0]:
            raise ValueError(f"the last frame ({frames[1]:g}) comes before the first ({frames[0]:g})")
        self.frame_start, self.frame_end = map(round, frames)
        with evaluation.undisturbed(context):
            return phases.of_objects(context, objects, name, *frames, self.shapes, shown)


def character(context):
    """The meshes on show of the active character, or the selected ones of no armature, and its name. Raises
    ValueError."""
    active = context.active_object
    meshes = [ob for ob in (active, *context.selected_objects) if ob is not None and ob.type == "MESH"]
    armature = bindable.find_armature(meshes[0]) if meshes else selected_armature(context)
    found = meshes if armature is None else [*meshes_of(context, armature), *armature.children_recursive]
    found = [ob for ob in dict.fromkeys(found) if ob.type == "MESH" and ob.visible_get()]
    if not found:
        raise ValueError("select a character first: a mesh, or the armature of meshes that are on show")
    return found, (meshes or found)[0].name


def clip_range(context, objects):
    """[first frame, last frame]"""
    armature = bindable.find_armature(objects[0])
    data = armature.animation_data if armature is not None else None
    if data is not None and data.action is not None:
        return [float(frame) for frame in data.action.frame_range]
    return [float(context.scene.frame_start), float(context.scene.frame_end)]


CLASSES = (AddCrowd,)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
