"""Binds meshes to Sinew and unbinds them: what changes in the .blend, and how it is restored."""

import zlib

import bpy

from ..blender import meshes, nodes, values
from ..chain import methods
from ..clips import posing
from ..clips.clip_store import has_poses
from ..feedback import notice
from ..plan import canvas_survey, runs, survey, wiring
from ..plan.bindable import BindingError, check_bindable, modifiers_to_take
from ..run import characters, errors, mail
from . import canvases, deformed_copies, deformed_copy, mending, old_files, precomputing, shared_group
from .deformed_copy import OutputError

MODIFIER_NAME = "Armature"  # of the modifier that is added to a mesh without one


def bind(
    ob: bpy.types.Object,
    armature: bpy.types.Object | None,
    output: str = "MODIFIER",
    method: str | None = None,
    source: str | None = None,
    is_shown: bool = True,
) -> None:
    """Binds a mesh: Sinew replaces its Armature modifier on that armature, and those that Multi Modifier mixes with it.

    The modifier stays in the file, and its settings (method, groups, envelopes, mask) still apply; only its switches
    are changed, in evaluated copies. A mesh without one gets one. armature None: Sinew replaces only shape keys and
    smoothing. source: by default, a mesh that was last bound to that armature keeps its own; any other uses the clip if
    the armature has one. is_shown: Blender evaluates the mesh at once, which is not allowed in a handler. Raises
    BindingError, and then nothing was changed.
    """
    check_bindable(ob, armature)
    settings = ob.sinew
    taken = modifiers_to_take(ob, armature)
    if output == "MESH":
        try:
            deformed_copy.check(ob, taken, meshes.count_sharers(ob), armature is not None and not taken)
        except OutputError as error:
            raise BindingError(str(error)) from error
    was_bound_to = settings.last_armature
    is_moved = settings.is_bound and armature is not None and not taken and settings.modifier is not None
    added = [_add_armature_modifier(ob, armature)] if armature is not None and not taken and not is_moved else []
    # From here on nothing fails.
    if is_moved:
        settings.armature = armature  # the carrier's armature becomes this one
    if settings.is_bound:
        has_added = settings.has_added_modifier and (is_moved or settings.modifier in taken)
        settings.has_added_modifier = settings.has_added_modifier and not has_added
        unbind(ob)
        settings.has_added_modifier = has_added
    else:
        nodes.remove_modifiers(ob)  # Sinew's modifiers that were copied from another mesh
    if added:
        settings.has_added_modifier = True
    taken = added or modifiers_to_take(ob, armature)
    if armature is None:
        source = "ARMATURE"
    elif source is None and was_bound_to != armature:
        source = "CLIP" if has_poses(armature.data) else "ARMATURE"
    settings.source = source or settings.source
    settings.last_armature = armature
    settings.property_unset("show_shape")
    if method and taken:
        _set_method(settings, taken[0], method)
    settings.output = settings.installed_output = output
    wiring.wire(ob, taken[0] if taken else nodes.add_modifier(ob, len(ob.modifiers)))
    # Last, because the settings' update callbacks only act on bound meshes.
    settings.is_bound = True
    characters.forget_object(ob)
    shared_group.see_to()
    mending.adapt(ob)
    if is_shown:
        show(ob)
        prepare_method(ob)
    else:
        ob.update_tag()


def _add_armature_modifier(ob, armature):
    """Adds an Armature modifier as the first of the stack. Raises BindingError, and then has changed nothing, if
    Blender does not allow it there."""
    active = ob.modifiers.active
    modifier = ob.modifiers.new(MODIFIER_NAME, "ARMATURE")
    try:
        nodes.move_modifier(ob, modifier, 0)
    except ValueError as error:
        ob.modifiers.remove(modifier)
        ob.modifiers.active = active
        raise BindingError(str(error)) from error
    modifier.object = armature
    return modifier


def bind_anew(ob: bpy.types.Object) -> None:
    """Binds a mesh again that Sinew 0.1 bound. May be called in a handler."""
    source, output = ob.sinew.source, ob.sinew.installed_output
    armature = old_files.give_back(ob)
    try:
        try:
            bind(ob, armature, output, source=source, is_shown=False)
        except BindingError:
            if output == "MODIFIER":
                raise
            bind(ob, armature, source=source, is_shown=False)
            notice.show(
                f"{ob.name} now uses the output Modifier, because Blender's own modifier deforms it: "
                f"{characters.of(ob).way.reason}"
            )
    except BindingError as error:
        notice.show(f"{error} (it was bound by Sinew 0.1; until you bind it again, Blender's own modifier deforms it)")


def rewire(key: int) -> None:
    """Applies the mends of the object with that key after an edit of the object."""
    ob = characters.find(key)
    if ob is None or mending.is_adapting(key) or release_if_undone(ob):
        return
    mending.adapt(ob)
    characters.of(ob).planning.give_up_on_what_lacks()
    ob.update_tag()
    if ob.sinew.installed_output == "MESH":
        mail.post(follow_when_evaluated, key)


def follow_when_evaluated(key: int) -> None:
    """Updates the deformed copy of the object with that key, after an evaluation for which Blender called no
    handler."""
    ob = characters.find(key)
    if ob is not None:
        deformed_copies.follow_last_evaluation(ob)


def show(ob: bpy.types.Object) -> None:
    """Has Blender evaluate a bound mesh, and updates its deformed copy."""
    ob.update_tag()
    if ob.sinew.installed_output == "MESH":
        deformed_copies.follow([ob], bpy.context.evaluated_depsgraph_get(), {values.key_of(ob)})


def unbind(ob: bpy.types.Object) -> None:
    """Unbinds an object: restores it as it was before it was bound, and removes its deformed copy."""
    settings = ob.sinew
    settings.is_bound = settings.needs_attribute = False
    precomputing.drop(ob)
    if settings.installed_output == "MESH":
        deformed_copy.remove(ob)
    taken = wiring.taken_modifiers(ob)
    wiring.unwire(ob)
    mending.remove_own_modifier(ob)
    canvases.remove(ob)
    if settings.has_added_modifier:
        settings.has_added_modifier = False
        for modifier in taken[:1]:
            ob.modifiers.remove(modifier)
    characters.forget_object(ob)
    shared_group.see_to()
    if is_deleted(settings.last_armature):
        settings.last_armature = None  # otherwise this reference would keep it in the file
    ob.update_tag()


def is_deleted(armature: bpy.types.Object | None) -> bool:
    """Whether an armature was deleted from all scenes and is only in the file because bound meshes refer to it.

    A linked one is never taken for deleted: it may be in no collection.
    """
    return armature is not None and armature.library is None and not armature.users_collection


def release_if_undone(ob: bpy.types.Object) -> bool:
    """Unbinds a mesh whose modifiers the user has applied or removed, and returns whether it did.

    If Sinew's modifier was applied, the modifiers that Sinew replaced are switched off, because they would deform the
    mesh again.
    """
    lacks_own = ob.sinew.needs_attribute and not nodes.find_modifier(ob)
    if not lacks_own and wiring.carrier_of(ob) is not None:
        if ob.sinew.canvas is not None and not ob.data.is_editmode:
            characters.of(ob).edited_to = _sum_of_positions(ob.data)
        return False
    if ob.data.is_editmode or ob.library or ob.override_library or old_files.is_old(ob):
        return False
    taken = [modifier.name for modifier in wiring.taken_modifiers(ob)]
    # The node group removes the attribute: the mesh has lost it if the modifier was applied, not if it was removed.
    canvas = ob.sinew.canvas
    took_shape = lacks_own and (
        # Applying a modifier gives the object a mesh of its own.
        meshes.point_attribute(ob.data, nodes.POSITION_ATTRIBUTE) is None
        if not canvas_survey.is_canvas_of(canvas, ob)
        # A canvas need not have what was edited since.
        else canvas.data != ob.data
        and characters.of(ob).edited_to != _sum_of_positions(ob.data)
        and not meshes.are_same(canvas.data, ob.data)
    )
    was_applied = took_shape and (taken or ob.sinew.last_armature is None)
    stood_in_for = (*taken, *runs.of(survey.of(ob)).stages)
    unbind(ob)
    for name in stood_in_for if was_applied else ():
        ob.modifiers[name].show_viewport = ob.modifiers[name].show_render = False
    notice.show(
        f"The shape of {ob.name} was applied, so it is no longer bound to Sinew"
        if was_applied
        else f"{ob.name} no longer has the modifier that Sinew needs, so it was unbound; accelerate it again"
    )
    return True


def _sum_of_positions(mesh: bpy.types.Mesh) -> int:
    return zlib.crc32(meshes.read_positions(mesh).tobytes())


def switch_method(ob: bpy.types.Object, name: str) -> None:
    """Switches the skinning method of a bound mesh, and computes the data that it needs.

    name: one of deform/choices.py: a method of the Armature modifier, or of methods.py. In a window the data is
    computed in the background.
    """
    precomputing.cancel(ob)
    _set_method(ob.sinew, ob.sinew.modifier, name)
    characters.of(ob).look_again()
    ob.update_tag()
    prepare_method(ob)


def _set_method(settings, modifier, name):
    """Sets the method, and on the modifier the closest method that Blender has without Sinew."""
    settings.own_method = name if name in methods.OWN else ""
    modifier.use_deform_preserve_volume = methods.is_like_dual_quaternion(name, settings.skinning)


def follow_share(ob: bpy.types.Object) -> None:
    """Sets the modifier's closest method again after the share of the method Blended has changed."""
    if ob.sinew.own_method == methods.BLENDED and ob.sinew.modifier is not None:
        _set_method(ob.sinew, ob.sinew.modifier, methods.BLENDED)


def prepare_method(ob: bpy.types.Object) -> None:
    """Computes the data that the mesh's method needs, if the file has none that could be used meanwhile."""
    if ob.sinew.own_method not in methods.PRECOMPUTED:
        return
    bpy.context.view_layer.update()
    if precomputing.lacks(ob) in {methods.ABSENT, methods.UNFIT}:
        try:
            precomputing.start(ob)
        except precomputing.Impossible as error:
            errors.report(ob, str(error))


def make_single_user(ob: bpy.types.Object) -> None:
    """Gives the object its own copy of the mesh that it shares with others. Bound or not, its shape does not change."""
    ob.data = ob.data.copy()
    characters.gather_again()
    mending.adapt(ob)
    ob.update_tag()


def switch_output(ob: bpy.types.Object) -> None:
    """Switches a bound mesh to the output in its settings. Raises OutputError, and then keeps the old output."""
    settings = ob.sinew
    old, new = settings.installed_output, settings.output
    if old == new:
        return
    if new == "MESH":
        try:
            deformed_copy.check(ob, wiring.taken_modifiers(ob), meshes.count_sharers(ob))
        except OutputError:
            settings.output = old
            raise
    else:
        deformed_copy.remove(ob)
    settings.installed_output = new
    characters.see(ob)
    show(ob)


def show_clip(armature: bpy.types.Object) -> None:
    """Poses the armature after a change of its clip's settings, and so updates its meshes."""
    if any(ob.sinew.source == "CLIP" and ob.sinew.armature == armature for ob in characters.bound_objects()):
        if has_poses(armature.data):
            if posing.is_damaged(armature):
                posing.forget_armature(armature)  # it may have been repaired
            posing.pose_armatures([armature], bpy.context.scene)
            bpy.context.view_layer.update()
