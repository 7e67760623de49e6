"""Decides what a mesh can be bound to, or why it cannot be bound."""

from typing import Any

from ..blender import animation, armatures, meshes
from . import survey, ways, wiring


class BindingError(ValueError):
    """The mesh cannot be bound. The message gives the reason; nothing was changed."""


def armature_modifier(ob: Any, armature: Any = None) -> Any:
    """Returns the mesh's first Armature modifier with an armature (with this one, if given), or None."""
    for modifier in ob.modifiers:
        if modifier.type == "ARMATURE" and modifier.object is not None and armature in (None, modifier.object):
            return modifier
    return None


def first_of_mix(ob: Any, modifier: Any) -> Any:
    """Returns the first modifier of the Multi Modifier mix that `modifier` belongs to, or `modifier` itself."""
    before = list(ob.modifiers)[: ob.modifiers.find(modifier.name)]
    first = modifier
    while before and first.use_multi_modifier and before[-1].type == "ARMATURE":
        first = before.pop()
    return first if modifier in wiring.mixed_modifiers(ob, first) else modifier


def find_armature(ob: Any) -> Any:
    """Returns the armature of a mesh, or None: of its binding, else of its Armature modifier, else its parent."""
    if ob.sinew.is_bound and ob.sinew.armature is not None:
        return ob.sinew.armature
    modifier = armature_modifier(ob)
    if modifier:
        return modifier.object
    if ob.parent and ob.parent.type == "ARMATURE":
        return ob.parent
    return None


def armatures_of(ob: Any) -> list[Any]:
    """Returns the armatures of a mesh: those of its Armature modifiers, or find_armature's, or none."""
    own = armatures.of_modifiers(ob) or [find_armature(ob)]
    return [each for each in dict.fromkeys(own) if each is not None]


def meshes_of(context: Any, armature: Any) -> list[Any]:
    """Returns the meshes of the view layer that an armature deforms, through Blender or Sinew."""
    return [
        ob
        for ob in context.view_layer.objects
        if ob.type == "MESH"
        and (ob.sinew.is_bound and ob.sinew.armature == armature or armature_modifier(ob, armature) is not None)
    ]


def armature_to_bind(ob: Any) -> Any:
    """Returns the armature to bind a mesh to if the user chooses none: its own.

    None: only shape keys and smoothing deform the mesh.
    """
    armature = find_armature(ob)
    if armature is None or ob.sinew.is_bound and ob.sinew.armature is not None:
        return armature
    modifier = armature_modifier(ob, armature)
    is_deformed = wiring.may_be_shown(ob, modifier) if modifier else has_group_of(ob, armature)
    return armature if is_deformed or ways.why_idle(survey.if_bound(ob)) else None


def armature_to_begin_with(ob: Any, armature: Any) -> Any:
    """Returns the armature to bind a mesh to if the user has chosen this one.

    If its modifier comes behind another Armature modifier, that is the other's: Sinew begins with the first and also
    replaces later ones.
    """
    chosen, first = armature_modifier(ob, armature), armature_modifier(ob)
    if chosen is None or not wiring.is_shown(first) or first_of_mix(ob, chosen) != chosen:
        return armature
    return first.object


def has_group_of(ob: Any, armature: Any) -> bool:
    """Whether a vertex group of the mesh has the name of a deforming bone."""
    bone_names = {bone.name for bone in armature.data.bones if bone.use_deform}
    return any(group.name in bone_names for group in ob.vertex_groups)


def modifiers_to_take(ob: Any, armature: Any) -> list[Any]:
    """Returns the Armature modifiers that Sinew would replace if the mesh were bound to this armature (or to none)."""
    modifier = armature and armature_modifier(ob, armature)
    return wiring.mixed_modifiers(ob, modifier) if modifier else []


def why_not_accelerated(ob: Any) -> str:
    """Returns why Sinew would not deform a mesh if it were bound to its own armature, or "". Changes nothing."""
    armature = armature_to_bind(ob)
    try:
        check_bindable(ob, armature)
    except BindingError as error:
        return str(error)
    return _way_if_bound(ob, armature).reason


def is_too_small(ob: Any, armature: Any) -> bool:
    """Whether a mesh is not bound, could be bound to the armature (or to none), and is faster without Sinew."""
    try:
        check_bindable(ob, armature)
    except BindingError:
        return False
    return not ob.sinew.is_bound and _way_if_bound(ob, armature).is_small


def _way_if_bound(ob: Any, armature: Any) -> ways.Way:
    taken = modifiers_to_take(ob, armature)
    gets_armature = armature is not None and not taken
    return ways.choose(survey.if_bound(ob, taken, meshes.count_sharers(ob), gets_armature))


def check_bindable(ob: Any, armature: Any) -> None:
    """Raises BindingError with the reason if the mesh cannot be bound to the armature (or, with None, without one)."""
    if ob.type != "MESH":
        raise BindingError(f"{ob.name} is not a mesh; select one")
    if ob.sinew.copy_of is not None:
        raise BindingError(f"{ob.name} is the deformed copy of {ob.sinew.copy_of.name}; bind that mesh instead")
    if ob.library:
        raise BindingError(
            f"{ob.name} is linked from another file; make a library override of it first, or bind it in that file"
        )
    if ob.data.is_editmode:
        raise BindingError(f"{ob.name} is in Edit Mode; leave it first")
    if armature is None:
        idle = ways.why_idle(survey.if_bound(ob))
        if idle:
            raise BindingError(f"{ob.name} {idle}")
        return
    if ob.parent == armature and ob.parent_type == "ARMATURE":
        raise BindingError(
            f"{ob.name} is deformed by its parent {armature.name} directly (parent type Armature), which Sinew "
            "cannot take over: set the parent type to Object and add an Armature modifier"
        )
    replaced = armature_modifier(ob, armature)
    first = replaced and first_of_mix(ob, replaced)
    if first != replaced:
        raise BindingError(
            f"{ob.name} mixes {replaced.name} with the Armature modifier before it (Multi Modifier); "
            + (
                f"bind the mesh to {first.object.name} instead"
                if first.object is not None
                else f"{first.name} has no armature: choose one there, or remove it"
            )
        )
    for modifier in modifiers_to_take(ob, armature):
        is_held = wiring.CARRIER in animation.animated_properties(ob, modifier)
        if is_held and modifier not in wiring.taken_modifiers(ob):
            raise BindingError(
                f"{wiring.CARRIER} of {modifier.name} of {ob.name} is driven or animated, but Sinew has to drive it "
                "itself: remove that first"
            )
    if replaced and replaced.use_bone_envelopes:
        return
    if not has_group_of(ob, armature):
        raise BindingError(
            f"No vertex group of {ob.name} is named after a deforming bone of {armature.name}: rename the groups, "
            "or parent the mesh with automatic weights"
        )
