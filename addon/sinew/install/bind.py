"""Binding a mesh to Sinew and releasing it: what changes in the .blend, and how it is put back."""

import bpy

from ..blender import meshes, nodes, values
from ..clips import posing
from ..clips.clip_store import has_poses
from ..feedback import notice
from ..plan import runs, wiring
from ..plan.bindable import BindingError, check_bindable, modifiers_to_take
from ..run import characters, mail, methods
from . import deformed_copies, deformed_copy, mending, old_files, precomputing, shared_group
from .deformed_copy import OutputError

MODIFIER_NAME = "Armature"  # of one that a mesh gets that has none


def bind(ob, armature, output="MODIFIER", method=None, source=None, is_shown=True):
    """Let Sinew deform the mesh in place of its Armature modifier on that armature (and those that Multi Modifier
    mixes with it), which stays as it is but for its switches, and goes on saying how: method, groups, envelopes,
    mask. A mesh that has none gets one. armature None: in place of its shape keys and smoothing alone. Without `source`
    a mesh that was bound to that armature before has its own again, and another one a clip if there is one. is_shown:
    have Blender evaluate it at once, which must not be asked for in a handler. Raises BindingError."""
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
        settings.armature = armature  # in place of the one that it was bound to
    if settings.is_bound:
        has_added = settings.has_added_modifier and (is_moved or settings.modifier in taken)
        settings.has_added_modifier = settings.has_added_modifier and not has_added
        unbind(ob)
        settings.has_added_modifier = has_added
    else:
        nodes.remove_modifiers(ob)  # what came with a copy of another mesh's modifiers
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
    # Last, since the settings' update callbacks act on bound meshes alone.
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
    """The first of all. Raises BindingError where Blender does not let it go there, and then has changed nothing."""
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


def bind_anew(ob):
    """A mesh that Sinew 0.1 has bound. In a handler."""
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


def rewire(key):
    """Of the object with that key, after somebody has edited it."""
    ob = characters.find(key)
    if ob is None or mending.is_adapting(key) or release_if_undone(ob):
        return
    mending.adapt(ob)
    characters.of(ob).planning.give_up_on_what_lacks()
    ob.update_tag()
    if ob.sinew.installed_output == "MESH":
        mail.post(follow_when_evaluated, key)


def follow_when_evaluated(key):
    """The deformed copy of the object with that key, where Blender has told no handler of an evaluation."""
    ob = characters.find(key)
    if ob is not None:
        deformed_copies.follow_last_evaluation(ob)


def show(ob):
    """The shape as the bound mesh now has it, in its deformed copy as well."""
    ob.update_tag()
    if ob.sinew.installed_output == "MESH":
        deformed_copies.follow([ob], bpy.context.evaluated_depsgraph_get(), {values.key_of(ob)})


def unbind(ob):
    """Give the object back as it was; its deformed copy goes."""
    settings = ob.sinew
    settings.is_bound = settings.needs_attribute = False
    precomputing.drop(ob)
    if settings.installed_output == "MESH":
        deformed_copy.remove(ob)
    taken = wiring.taken_modifiers(ob)
    wiring.unwire(ob)
    mending.remove_own_modifier(ob)
    if settings.has_added_modifier:
        settings.has_added_modifier = False
        for modifier in taken[:1]:
            ob.modifiers.remove(modifier)
    characters.forget_object(ob)
    shared_group.see_to()
    if is_deleted(settings.last_armature):
        settings.last_armature = None  # else it would stay in the file for this mesh's sake
    ob.update_tag()


def is_deleted(armature):
    """Whether it was deleted from all scenes and is only in the file for the sake of bound meshes. (A linked
    one may well be in no collection.)"""
    return armature is not None and armature.library is None and not armature.users_collection


def release_if_undone(ob):
    """Releases a mesh whose modifiers somebody has applied or removed, and returns whether. Modifiers that Sinew stood
    in for are switched off if its own was applied, for they would deform the mesh again."""
    has_hook, taken = wiring.carrier_of(ob) is not None, [modifier.name for modifier in wiring.taken_modifiers(ob)]
    lacks_own = ob.sinew.needs_attribute and not nodes.find_modifier(ob)
    if ob.data.is_editmode or ob.library or ob.override_library or old_files.is_old(ob) or has_hook and not lacks_own:
        return False
    # What its node group makes has no attribute, which the mesh still has if the modifier was removed.
    took_shape = lacks_own and meshes.point_attribute(ob.data, nodes.POSITION_ATTRIBUTE) is None
    was_applied = took_shape and (taken or ob.sinew.last_armature is None)
    stood_in_for = (*taken, *runs.of(ob, taken).stages)
    unbind(ob)
    for name in stood_in_for if was_applied else ():
        ob.modifiers[name].show_viewport = ob.modifiers[name].show_render = False
    notice.show(
        f"The shape of {ob.name} was applied, so it is no longer bound to Sinew"
        if was_applied
        else f"{ob.name} no longer has the modifier that Sinew needs, so it was unbound; accelerate it again"
    )
    return True


def switch_method(ob, name):
    """name: one of METHODS of properties.py, which the Armature modifier has as well, or of methods.py. What the
    latter has to compute is computed now, in a window meanwhile."""
    precomputing.cancel(ob)
    _set_method(ob.sinew, ob.sinew.modifier, name)
    characters.of(ob).look_again()
    ob.update_tag()
    prepare_method(ob)


def _set_method(settings, modifier, name):
    """Without Sinew the modifier has to come as near as it can."""
    settings.own_method = name if name in methods.OWN else ""
    modifier.use_deform_preserve_volume = methods.is_like_dual_quaternion(name, settings.skinning)


def follow_share(ob):
    """Likewise, where the share of the method Blended is another one now."""
    if ob.sinew.own_method == methods.BLENDED and ob.sinew.modifier is not None:
        _set_method(ob.sinew, ob.sinew.modifier, methods.BLENDED)


def prepare_method(ob):
    """What its method has to compute is computed, if there is nothing that it could use meanwhile."""
    if ob.sinew.own_method not in methods.PRECOMPUTED:
        return
    bpy.context.view_layer.update()
    if precomputing.lacks(ob) in {methods.ABSENT, methods.UNFIT}:
        try:
            precomputing.start(ob)
        except precomputing.Impossible as error:
            characters.report(ob, str(error))


def make_single_user(ob):
    """Give the object a copy of the mesh that it shares with others; bound or not, it looks the same."""
    ob.data = ob.data.copy()
    characters.gather_again()
    mending.adapt(ob)
    ob.update_tag()


def switch_output(ob):
    """Move a bound mesh to the output that its settings ask for. Raises OutputError, and then stays
    with the old one."""
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


def show_clip(armature):
    """A setting of the armature's clip was changed: its bones show it now, and the meshes with them."""
    if any(ob.sinew.source == "CLIP" and ob.sinew.armature == armature for ob in characters.bound_objects()):
        if has_poses(armature.data):
            if posing.is_damaged(armature):
                posing.forget_armature(armature)  # it may have been mended
            posing.pose_armatures([armature], bpy.context.scene)
            bpy.context.view_layer.update()
