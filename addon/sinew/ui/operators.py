"""Operators for binding and for bound meshes. Each reads its properties, calls one function and reports the result."""

from collections import defaultdict
from functools import partial

import bpy
from bpy.props import EnumProperty

from ..deform import choices
from ..feedback import progress
from ..install import bind
from ..main import whole_frames
from ..plan import bindable
from ..played import accelerating, states
from ..rig_files import clip_keyframes
from ..run import characters
from . import available


def selected_meshes(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Returns the selected meshes, or else the active one, or else those of a selected armature."""
    meshes = [ob for ob in context.selected_objects if ob.type == "MESH"]
    active = context.active_object
    if not meshes and active and active.type == "MESH":
        meshes = [active]
    if not meshes and selected_armature(context):
        meshes = bindable.meshes_of(context, selected_armature(context))
    return meshes


def selected_armature(context: bpy.types.Context) -> bpy.types.Object | None:
    active = context.active_object
    if active and active.type == "ARMATURE":
        return active
    return next((ob for ob in context.selected_objects if ob.type == "ARMATURE"), None)


def no_meshes(context: bpy.types.Context) -> str:
    """Returns what to do before meshes can be bound or unbound."""
    why = available.other_mode(context, *available.MODES)
    return why or ("" if selected_meshes(context) else "Select a mesh, or an armature that moves some")


class Bind(available.Explains, bpy.types.Operator):
    """Let Sinew deform the selected meshes, with the selected armature or their own, or only with shape keys and
    smoothing. If only an armature is selected: all meshes that it deforms. Of several meshes, those that are so small
    that Blender is faster are left to it"""

    bl_idname = "object.sinew_bind"
    bl_label = "Accelerate"
    bl_options = {"REGISTER", "UNDO"}

    output: EnumProperty(name="Output", items=choices.OUTPUTS, description="Where the deformed positions go")

    @classmethod
    def why_not(cls, context):
        return no_meshes(context)

    def run(self, context):
        bound, problems = 0, []
        small = defaultdict(list)  # by armature
        meshes = selected_meshes(context)
        with progress.shown(context) as shown:
            for number, ob in enumerate(meshes):
                shown.step(number / len(meshes), f"binding {ob.name}")
                chosen = selected_armature(context)
                armature = bindable.armature_to_begin_with(ob, chosen) if chosen else bindable.armature_to_bind(ob)
                try:
                    if len(meshes) > 1 and self.output == "MODIFIER" and bindable.is_too_small(ob, armature):
                        small[armature].append(ob)
                        continue
                    bind.bind(ob, armature, self.output)
                    bound += 1
                except bindable.BindingError as error:
                    problems.append(str(error))
        for armature, own in small.items():
            if accelerating.needs_a_mesh(armature):  # which Blender goes on deforming, with a rig that Sinew computes
                bind.bind(max(own, key=lambda ob: len(ob.data.vertices)), armature, self.output)
        for problem in problems:
            self.report({"WARNING" if bound else "ERROR"}, problem)
        if bound > 1 or small:
            count = sum(map(len, small.values()))
            left = f"; {count} with few vertices are left to Blender, which is faster there" if small else ""
            self.report({"INFO"}, f"Sinew deforms {bound} meshes{left}")
        return {"FINISHED"} if bound or small else {"CANCELLED"}


class Unbind(available.Explains, bpy.types.Operator):
    """Let Blender deform the selected meshes again, as before they were bound"""

    bl_idname = "object.sinew_unbind"
    bl_label = "Unbind from Sinew"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def why_not(cls, context):
        is_any = any(ob.sinew.is_bound for ob in selected_meshes(context))
        return no_meshes(context) or ("" if is_any else "No selected mesh is accelerated")

    def run(self, context):
        for ob in selected_meshes(context):
            if ob.sinew.is_bound:
                bind.unbind(ob)


class ClipToKeyframes(available.Explains, bpy.types.Operator):
    """Write the poses of the imported rig as keyframes of its armature, on all frames of the scene"""

    bl_idname = "object.sinew_clip_to_keyframes"
    bl_label = "Poses to Keyframes"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def why_not(cls, context):
        is_there = clip_keyframes.clip_armature(context.active_object) is not None
        return "" if is_there else "Select a rig that was imported with poses"

    def run(self, context):
        armature = clip_keyframes.clip_armature(context.active_object)
        scene = context.scene
        with progress.shown(context) as shown:
            count = clip_keyframes.insert(scene, armature, scene.frame_start, scene.frame_end, shown)
        self.report({"INFO"}, f"{count} frames keyed on {armature.name}")


class MeasureFrames(available.Explains, bpy.types.Operator):
    """Play some of the scene's frames with Sinew and with Blender's own modifiers, and show how long a whole frame
    takes"""

    bl_idname = "object.sinew_measure"
    bl_label = "Measure Frames"

    @classmethod
    def why_not(cls, context):
        is_any = any(ob.sinew.installed_output == "MODIFIER" for ob in characters.bound_objects())
        why = available.other_mode(context, "OBJECT", "POSE")
        return why or ("" if is_any else "Accelerate a mesh first, with the output Modifier")

    def run(self, context):
        with progress.shown(context) as shown:
            live = partial(states.all_live, context.scene, context.view_layer)
            measured = whole_frames.measure(context.scene, shown, live)
        self.report(
            {"INFO"},
            f"A whole frame takes {measured.sinew:.2f} ms with Sinew and {measured.blender:.2f} ms "
            "with Blender's own modifiers",
        )


CLASSES = (Bind, Unbind, ClipToKeyframes, MeasureFrames)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
