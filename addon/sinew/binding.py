"""Binding a mesh to Sinew and releasing it: what changes in the .blend, and how it is put back."""

from . import anchor, blender_io, notice, session
from .clip_store import has_poses
from .outputs import OUTPUTS, OutputError, check_numbers_kept, sinew_modifier


class BindingError(Exception):
    """The mesh cannot be bound as asked; the message says why and nothing was changed."""


def armature_modifier(ob, armature=None):
    """The mesh's first Armature modifier (on this armature), or None."""
    for modifier in ob.modifiers:
        if (modifier.type == "ARMATURE" and modifier.object is not None
                and armature in (None, modifier.object)):
            return modifier
    return None


def mixed_modifiers(ob, modifier):
    """The Armature modifiers that Multi Modifier joins, this one first: a later one starts from the same
    shape as the first, and the two results are mixed. An ordinary modifier stands alone."""
    chain = [modifier]
    for later in list(ob.modifiers)[ob.modifiers.find(modifier.name) + 1:]:
        if later.type != "ARMATURE" or not later.use_multi_modifier:
            break
        if later.object is not None and (later.show_viewport or later.show_render):
            chain.append(later)
    return chain


def first_of_mix(ob, modifier):
    """The modifier with which the mix begins that `modifier` is part of, or itself."""
    before = list(ob.modifiers)[:ob.modifiers.find(modifier.name)]
    first = modifier
    while before and first.use_multi_modifier and before[-1].type == "ARMATURE":
        first = before.pop()
    return first if modifier in mixed_modifiers(ob, first) else modifier


def find_armature(ob):
    """The armature that a mesh hangs on: its binding's, that of its Armature modifier, else its
    parent, else None."""
    if ob.sinew.is_bound:
        return ob.sinew.armature
    modifier = armature_modifier(ob)
    if modifier:
        return modifier.object
    if ob.parent and ob.parent.type == "ARMATURE":
        return ob.parent
    return None


def check_bindable(ob, armature):
    """Raises BindingError with the reason if the mesh cannot be bound to the armature."""
    if ob.type != "MESH":
        raise BindingError(f"{ob.name} is not a mesh")
    if armature is None:
        raise BindingError(
            f"{ob.name} has no armature: select one with it, parent it to one or give it an "
            "Armature modifier")
    if ob.library:
        raise BindingError(
            f"{ob.name} is linked from another file; make a library override of it first, or bind it there")
    if ob.data.is_editmode:
        raise BindingError(f"{ob.name} is in Edit Mode; leave it first")
    replaced = armature_modifier(ob, armature)
    if replaced and first_of_mix(ob, replaced) != replaced:
        raise BindingError(
            f"Multi Modifier mixes {replaced.name} of {ob.name} with the Armature modifier before it; "
            f"bind the mesh to {first_of_mix(ob, replaced).object.name}")
    for modifier in mixed_modifiers(ob, replaced) if replaced else ():
        animated = blender_io.animated_properties(ob, modifier)
        if animated:
            raise BindingError(
                f"{modifier.name} of {ob.name} is animated itself ({', '.join(animated)}), which Sinew cannot "
                "follow: remove these drivers or keyframes first")
    if replaced and replaced.use_bone_envelopes:
        return
    bone_names = {bone.name for bone in armature.data.bones if bone.use_deform}
    if not any(group.name in bone_names for group in ob.vertex_groups):
        raise BindingError(
            f"No vertex group of {ob.name} has the name of a deforming bone of {armature.name}")


@session.asleep()
def bind(ob, armature, output="MODIFIER", method=None, source=None):
    """Let Sinew deform the mesh. An Armature modifier on that armature is switched off and its place
    in the stack taken; what it says of the method is kept unless `method` is given. Without `source` a mesh that
    was bound to that armature before has its own again, and another one a clip if there is one.
    Raises BindingError."""
    check_bindable(ob, armature)
    if ob.sinew.is_bound:
        unbind(ob)
    else:
        OUTPUTS["MODIFIER"].remove(ob)  # what came with a copy of another mesh's modifiers
    settings = ob.sinew
    replaced = armature_modifier(ob, armature)
    index = ob.modifiers.find(replaced.name) if replaced else 0
    before = blender_io.modifiers_before(ob, replaced) if replaced else []
    if output == "MESH" and before:
        raise BindingError(
            f"{ob.name} has a modifier before its armature's ({before[0].name}), which the output Mesh "
            "cannot follow; use the output Modifier")
    try:
        check_numbers_kept(ob, index)
        OUTPUTS[output].install(ob, index)
    except OutputError as error:
        raise BindingError(str(error)) from error
    if source is None and settings.armature != armature:
        source = "CLIP" if has_poses(armature.data) else "ARMATURE"
    settings.source = source or settings.source
    settings.output = settings.installed_output = output
    settings.mixed.clear()
    settings.replaced.clear()
    for name in ("show_shape", "method", "use_vertex_groups", "use_envelopes", "mask_group", "mask_invert"):
        settings.property_unset(name)
    settings.armature = armature
    for modifier in mixed_modifiers(ob, replaced) if replaced else ():
        take_over(modifier, settings if modifier == replaced else settings.mixed.add())
        remember(modifier, settings.replaced.add())
    if method:
        settings.method = method
    show_as_replaced(ob)
    # Last, since the settings' update callbacks act on bound meshes alone.
    settings.is_bound = True
    session.forget_object(ob)
    session.refresh(ob)


def take_over(modifier, layer):
    """What an Armature modifier says, into a layer's settings."""
    layer.armature = modifier.object
    layer.method = "DUAL_QUATERNION" if modifier.use_deform_preserve_volume else "LINEAR"
    layer.use_vertex_groups = modifier.use_vertex_groups
    layer.use_envelopes = modifier.use_bone_envelopes
    layer.mask_group, layer.mask_invert = modifier.vertex_group, modifier.invert_vertex_group


def remember(modifier, entry):
    """Switches an Armature modifier off and keeps how it was. It is taken off its armature, else Blender
    would evaluate the mesh once for the armature and once for Sinew though the modifier is switched off:
    half of a frame's time in 3.4."""
    entry.name, entry.object = modifier.name, modifier.object
    entry.show_viewport, entry.show_render = modifier.show_viewport, modifier.show_render
    modifier.show_viewport = modifier.show_render = False
    modifier.object = None


def show_as_replaced(ob):
    """Sinew's modifier is shown where the replaced one was."""
    settings = ob.sinew
    if settings.replaced and settings.installed_output == "MODIFIER":
        modifier, replaced = sinew_modifier(ob), settings.replaced[0]
        modifier.show_viewport, modifier.show_render = replaced.show_viewport, replaced.show_render
        if replaced.name in ob.modifiers:
            own = ob.modifiers[replaced.name]
            modifier.show_in_editmode, modifier.show_on_cage = own.show_in_editmode, own.show_on_cage


def give_back(entry, ob):
    """Switches it on again, unless it is gone."""
    modifier = ob.modifiers.get(entry.name)
    if modifier is None:
        return
    modifier.object = entry.object or modifier.object
    modifier.show_viewport, modifier.show_render = entry.show_viewport, entry.show_render


@session.asleep()
def unbind(ob):
    """Give the mesh back as it was: rest positions, and the Armature modifier switched on again."""
    settings = ob.sinew
    settings.is_bound = False
    session.forget_object(ob)
    OUTPUTS[settings.installed_output].remove(ob)
    anchor.remove(ob)
    for entry in settings.replaced:
        give_back(entry, ob)
    settings.replaced.clear()
    settings.mixed.clear()
    if is_deleted(settings.armature):
        settings.armature = None  # else it would stay in the file for this mesh's sake


def is_deleted(armature):
    """Whether it was deleted from all scenes and is only in the file for the sake of bound meshes. (A linked
    one may well be in no collection.)"""
    return armature is not None and armature.library is None and not armature.users_collection


def release_applied(ob):
    """The mesh has taken its shape for good; Armature modifiers that it still has stay switched off, for
    they would deform it again."""
    for entry in ob.sinew.replaced:
        entry.show_viewport = entry.show_render = False
    unbind(ob)
    notice.show(f"{ob.name} has taken its shape for good and is no longer bound to Sinew")


def show_rest(ob):
    """Of the output Mesh: the rest shape in place of the deformed one."""
    output = OUTPUTS[ob.sinew.installed_output](ob)
    output.write(ob, output.rest_positions(ob))


def make_single_user(ob):
    """Give the object a copy of the mesh that it shares with others; bound or not, it looks the same."""
    ob.data = ob.data.copy()
    session.forget_object(ob)
    session.refresh(ob)


@session.asleep()
def switch_output(ob):
    """Move a bound mesh to the output that its settings ask for. Raises OutputError, and then stays
    with the old one."""
    settings = ob.sinew
    old, new = settings.installed_output, settings.output
    if old == new:
        return
    index = max(ob.modifiers.find(settings.replaced[0].name), 0) if settings.replaced else 0
    settings.is_bound = False
    OUTPUTS[old].remove(ob)
    try:
        OUTPUTS[new].install(ob, index)
        settings.installed_output = new
        show_as_replaced(ob)
    except OutputError:
        OUTPUTS[old].install(ob, index)
        settings.output = old
        raise
    finally:
        settings.is_bound = True
        session.forget_object(ob)
        session.refresh(ob)
