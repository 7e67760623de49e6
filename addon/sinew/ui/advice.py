"""The panel's warnings about a bound mesh, each with the operators that fix its cause."""

from dataclasses import dataclass
from typing import Any

import bpy

from ..bake import mesh_cache
from ..blender import materials, meshes
from ..clips import clip_store
from ..host import contract
from ..install import bind, deformed_copies
from ..plan import survey
from ..run import characters
from . import cures, display, rig_cures
from .operators import Unbind


@dataclass
class Advice:
    text: str
    cures: tuple[tuple[str, str], ...]  # (operator's name, text of its button)
    is_error: bool = False  # False: the mesh is deformed correctly all the same


def warnings(ob: bpy.types.Object) -> list[Advice]:
    """Returns the warnings about a bound mesh, worst first."""
    entry = characters.looked_at(ob)
    return [
        *_about_evaluation(ob, entry),
        *_about_blender(entry),
        *_about_copy(ob),
        *about_generated(ob),
        *_about_doubles(ob),
        *_about_weights(entry),
        *_about_armature(ob, ob.sinew.armature),
        *_about_sharers(ob, entry),
    ]


def _about_evaluation(ob: bpy.types.Object, entry: Any) -> list[Advice]:
    """Why the mesh is not deformed, or Blender's own modifier deforms it."""
    if entry is not None and entry.status.error:
        return [Advice(entry.status.error, (), True)]
    if entry is None or not entry.way.reason or mesh_cache.is_on(ob):
        return []
    if ob.sinew.armature is None and ob.sinew.modifiers:
        return [Advice(entry.way.reason, (), True)]
    fixes = ((cures.KeepGenerated.bl_idname, "Add a Basis"),) if entry.way.wants_keys else ()
    if cures.first_in_the_way(ob) is not None:
        fixes = ((cures.MoveDown.bl_idname, "Move Down"),)
    elif rig_cures.names_driver(entry.way.reason):
        fixes = ((rig_cures.ShowDriver.bl_idname, "Show Driver"),)
    return [Advice(f"Blender's own modifier deforms it: {_lower(entry.way.reason)}", fixes)]


def _about_blender(entry: Any) -> list[Advice]:
    """What Sinew does without in this version of Blender, besides what keeps it from deforming the mesh."""
    said = "" if entry is None else f"{entry.way.reason} {entry.run.reason}"
    return [Advice(sentence, ()) for sentence in contract.sentences() if sentence not in said]


def _about_copy(ob):
    copy, why = ob.sinew.deformed, deformed_copies.why_it_stays(ob)
    return [Advice(f"{copy.name} keeps its last shape {why}", ())] if copy is not None and why else []


def about_generated(ob: bpy.types.Object) -> list[Advice]:
    """Returns a warning about a mesh, bound or not yet bound, whose material would slide over the surface."""
    material = materials.user_of_generated(ob) if ob.data.shape_keys is None else None
    if material is None:
        return []
    return [
        Advice(
            f"{material} uses Generated coordinates, which move with the shape on a mesh without shape keys",
            ((cures.KeepGenerated.bl_idname, "Keep Generated"),),
        )
    ]


def _about_doubles(ob: bpy.types.Object) -> list[Advice]:
    return [
        Advice(
            f"Modifier {modifier.name} deforms this mesh a second time, with armature {modifier.object.name}",
            ((cures.RemoveDoubles.bl_idname, "Remove It"),),
            True,
        )
        for modifier in cures.doubles(ob)
    ]


def _about_weights(entry: Any) -> list[Advice]:
    if entry is None or not entry.layers:
        return []
    influences, found = entry.layers[0].influences, []
    if influences.unweighted_count and not entry.run.mixes:  # a later armature may move them
        found.append(
            Advice(
                f"{_vertices(influences.unweighted_count)} without a bone: kept in the rest pose",
                ((cures.FillWeights.bl_idname, "Fill from Neighbors"), (cures.SelectUnweighted.bl_idname, "Select")),
                True,
            )
        )
    if influences.unnormalized_count:
        found.append(
            Advice(
                f"The weights of {_vertices(influences.unnormalized_count)} do not sum to 1",
                ((cures.NormalizeWeights.bl_idname, "Normalize"),),
            )
        )
    return found


def _about_armature(ob: bpy.types.Object, armature: bpy.types.Object | None) -> list[Advice]:
    if armature is None:
        return []
    found = []
    if ob.sinew.source == "CLIP" and not clip_store.bones_are_where_they_were(armature):
        found.append(
            Advice(
                "Bones were moved after the import, so the rig's poses no longer fit: undo that, or set Pose to "
                "Armature",
                (),
                True,
            )
        )
    if bind.is_deleted(armature):
        found.append(
            Advice(
                f"{armature.name} was deleted from all collections but moves the mesh until you unbind it",
                ((display.ToggleSkeleton.bl_idname, "Bring Back"), (Unbind.bl_idname, "Unbind")),
                True,
            )
        )
    elif not armature.visible_get():
        found.append(Advice(f"{armature.name} is hidden", ((display.ToggleSkeleton.bl_idname, "Show"),)))
    return found


def _about_sharers(ob: bpy.types.Object, entry: Any) -> list[Advice]:
    if entry is not None and entry.way.in_pass:
        return []
    sharers = meshes.count_sharers(ob)
    if sharers < 2 or not survey.may_be_single_user(ob):
        return []
    return [Advice(f"{sharers} objects share this mesh", ((cures.MakeSingleUser.bl_idname, "Make Single User"),))]


def _lower(sentence):
    first = sentence.split(maxsplit=1)[0]
    return sentence[0].lower() + sentence[1:] if first in {"It", "Its"} else sentence


def _vertices(count):
    return "1 vertex" if count == 1 else f"{count:,} vertices"
