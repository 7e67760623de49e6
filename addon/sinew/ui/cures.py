"""Operators that fix what the panel warns about."""

from typing import Any

import bpy
import numpy as np
from mathutils.kdtree import KDTree

from ..blender import armatures, meshes, temporary
from ..install import bind, mending
from ..plan import survey
from ..run import characters
from ..stencils import searching
from . import available


def doubles(ob: bpy.types.Object) -> list[bpy.types.Modifier]:
    """Returns the enabled Armature modifiers, other than Sinew's own, that use one of Sinew's armatures. Parenting a
    bound mesh again adds one."""
    ours = ob.sinew.modifiers
    return [
        modifier
        for modifier in ob.modifiers
        if modifier.type == "ARMATURE"
        and modifier.object is not None
        and modifier not in ours
        and modifier.object in [own.object for own in ours]
        and (modifier.show_viewport or modifier.show_render)
    ]


def bone_weights(ob: bpy.types.Object) -> list[dict[int, float]]:
    """Returns a list with {group: weight} for each vertex, for deforming bones only."""
    offsets, groups, weights = meshes.read_object_weights(ob)
    bones = ob.sinew.armature.data.bones
    deforming = [group.name in bones and bones[group.name].use_deform for group in ob.vertex_groups]
    groups, weights = groups.tolist(), weights.tolist()
    return [
        {
            groups[i]: weights[i]
            for i in range(first, last)
            if groups[i] >= 0 and deforming[groups[i]] and weights[i] > 0
        }
        for first, last in zip(offsets[:-1].tolist(), offsets[1:].tolist())
    ]


def _at_rest(ob):
    """Shows the object in its rest shape inside the `with` block: armatures in rest position, only the Basis shown."""
    used = {armature.data for armature in armatures.of_modifiers(ob)}
    settings: list[tuple[Any, str, Any]] = [(data, "pose_position", "REST") for data in used if data.library is None]
    if ob.data.shape_keys is not None:
        settings += [(ob, "show_only_shape_key", True), (ob, "active_shape_key_index", 0)]
    return temporary.changed(settings)


class _Cure(available.Explains):
    bl_options = {"REGISTER", "UNDO"}
    wants_armature = True

    @classmethod
    def why_not(cls, context):
        ob = context.active_object
        why = available.unbound(ob) or available.linked(ob)
        if not why and cls.wants_armature and ob.sinew.armature is None:
            why = f"{ob.name} has no armature"
        return why or available.other_mode(context, "OBJECT", "PAINT_WEIGHT") or cls.nothing_to_cure(ob)

    @classmethod
    def nothing_to_cure(cls, ob: bpy.types.Object) -> str:
        """Returns why a mesh does not need it, as far as that is soon known; "" otherwise."""
        return ""


def first_in_the_way(ob: bpy.types.Object) -> Any:
    """Returns the modifier of a bound mesh that plan/ways.py advises to move behind the armature's, here and not in a
    library, or None."""
    entry = characters.looked_at(ob)
    if entry is None or entry.way.reason.endswith(", in the library"):
        return None
    return next((each for each in ob.modifiers if f": move {each.name} behind " in entry.way.reason), None)


class MoveDown(_Cure, bpy.types.Operator):
    """Move the modifier that comes before the Armature modifier, with which Sinew has to begin, to behind it. The shape
    may change: look at it afterwards"""

    bl_idname = "object.sinew_move_down"
    bl_label = "Move Modifier Behind the Armature's"
    wants_armature = False

    @classmethod
    def nothing_to_cure(cls, ob):
        return "" if first_in_the_way(ob) is not None else f"No modifier of {ob.name} is in Sinew's way"

    def run(self, context):
        ob = context.active_object
        modifier, last = first_in_the_way(ob), ob.sinew.modifiers[-1]
        bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=list(ob.modifiers).index(last))
        self.report({"INFO"}, f"{modifier.name} comes after {last.name} now: look at the shape")


class KeepGenerated(available.Explains, bpy.types.Operator):
    """Add a Basis shape key, which Sinew then deforms: Generated texture coordinates stay in place, and modifiers that
    allow only deforming modifiers before them can be used"""

    bl_idname = "object.sinew_keep_generated"
    bl_label = "Keep Generated Coordinates"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def why_not(cls, context):
        ob = context.active_object
        why = available.no_mesh(ob) or available.linked(ob)
        if not why and ob.data.shape_keys is not None:
            why = f"{ob.name} has shape keys already"
        return why or available.other_mode(context, "OBJECT", "PAINT_WEIGHT")

    def run(self, context):
        ob = context.active_object
        ob.shape_key_add(name="Basis", from_mix=False)
        if ob.sinew.is_bound:
            mending.adapt(ob)


class RemoveDoubles(_Cure, bpy.types.Operator):
    """Remove the Armature modifiers that deform the mesh a second time, with the armature that Sinew uses"""

    bl_idname = "object.sinew_remove_doubles"
    bl_label = "Remove Second Deformation"

    @classmethod
    def nothing_to_cure(cls, ob):
        return "" if doubles(ob) else f"{ob.name} is not deformed a second time"

    def run(self, context):
        ob = context.active_object
        for modifier in doubles(ob):
            ob.modifiers.remove(modifier)


class NormalizeWeights(_Cure, bpy.types.Operator):
    """Scale the weights of the deforming bones so that they sum to 1 at each vertex; locked groups do not change. Sinew
    and the Armature modifier divide by the sum anyway; other programs may not"""

    bl_idname = "object.sinew_normalize_weights"
    bl_label = "Normalize Bone Weights"

    def run(self, context):
        ob = context.active_object
        changed = 0
        is_locked = [group.lock_weight for group in ob.vertex_groups]
        for vertex, entries in enumerate(bone_weights(ob)):
            free = {group: weight for group, weight in entries.items() if not is_locked[group]}
            total = sum(free.values())
            wanted = 1 - (sum(entries.values()) - total)
            if total > 0 and wanted >= 0 and abs(total - wanted) > 1e-6:
                changed += 1
                for group, weight in free.items():
                    ob.vertex_groups[group].add((vertex,), weight * wanted / total, "REPLACE")
        ob.data.update()
        self.report({"INFO"}, f"Normalized the weights of {changed:,} vertices")


class FillWeights(_Cure, bpy.types.Operator):
    """Give vertices that follow no bone the weights of the nearest vertex that does"""

    bl_idname = "object.sinew_fill_weights"
    bl_label = "Fill Bone Weights from Neighbors"

    def run(self, context):
        ob = context.active_object
        weights = bone_weights(ob)
        rest = meshes.read_positions(ob.data)
        weighted = [vertex for vertex, entries in enumerate(weights) if entries]
        if not weighted:
            raise ValueError(f"No vertex of {ob.name} follows a bone: parent it with automatic weights")
        tree = KDTree(len(weighted))
        for vertex in weighted:
            tree.insert(rest[vertex], vertex)
        tree.balance()
        for vertex, entries in enumerate(weights):
            if not entries:
                for group, weight in weights[tree.find(rest[vertex])[1]].items():
                    ob.vertex_groups[group].add((vertex,), weight, "REPLACE")
        ob.data.update()
        self.report({"INFO"}, f"Gave weights to {len(weights) - len(weighted):,} vertices")


class SelectUnweighted(_Cure, bpy.types.Operator):
    """Enter Edit Mode and select the vertices that follow no bone"""

    bl_idname = "object.sinew_select_unweighted"
    bl_label = "Select Vertices without Bones"

    def run(self, context):
        selected = np.array([not entries for entries in bone_weights(context.active_object)], bool)
        context.tool_settings.mesh_select_mode = (True, False, False)
        meshes.select_vertices(context.active_object.data, selected)
        bpy.ops.object.mode_set(mode="EDIT")
        self.report({"INFO"}, f"{selected.sum():,} vertices follow no bone")


class FindWeights(_Cure, bpy.types.Operator):
    """Find the weights of the last modifiers, however long it takes. This goes on while nothing is played or edited;
    Blender stands still for each of its evaluations"""

    bl_idname = "object.sinew_find_weights"
    bl_label = "Find the Weights"
    bl_options = {"REGISTER"}
    wants_armature = False

    @classmethod
    def nothing_to_cure(cls, ob):
        return "" if searching.takes_long(ob) else f"{ob.name} lacks no weights that would take long to find"

    def run(self, context):
        searching.take_time(context.active_object)


def _unbound_smoothing(ob: bpy.types.Object) -> list[bpy.types.Modifier]:
    return [modifier for modifier in ob.modifiers if survey.why_not_bound(ob, modifier)]


class BindSmoothing(_Cure, bpy.types.Operator):
    """Bind each Corrective Smooth that needs it to the mesh as it is in the rest pose, with all shape keys at rest"""

    bl_idname = "object.sinew_bind_smoothing"
    bl_label = "Bind Smoothing to Rest Pose"
    wants_armature = False

    @classmethod
    def nothing_to_cure(cls, ob):
        return "" if _unbound_smoothing(ob) else f"{ob.name} has no Corrective Smooth that needs to be bound"

    def run(self, context):
        ob = context.active_object
        unbound = _unbound_smoothing(ob)
        with _at_rest(ob):
            context.view_layer.update()
            for modifier in unbound:
                if modifier.is_bind:  # to a different number of vertices: the first call of the operator unbinds
                    bpy.ops.object.correctivesmooth_bind(modifier=modifier.name)
                bpy.ops.object.correctivesmooth_bind(modifier=modifier.name)
        ob.update_tag()


class MakeSingleUser(_Cure, bpy.types.Operator):
    """Give this object a mesh of its own"""

    bl_idname = "object.sinew_make_single_user"
    bl_label = "Make Mesh Single User"
    wants_armature = False

    @classmethod
    def nothing_to_cure(cls, ob):
        return "" if ob.data.users > 1 else f"No other object uses the mesh of {ob.name}"

    def run(self, context):
        ob = context.active_object
        bind.make_single_user(ob)


CLASSES = (
    MoveDown,
    KeepGenerated,
    RemoveDoubles,
    NormalizeWeights,
    FillWeights,
    SelectUnweighted,
    FindWeights,
    BindSmoothing,
    MakeSingleUser,
)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
