"""Binding a mesh to Sinew and releasing it: what changes in the .blend, and how it is put back."""

from . import blender_io, session
from .clip_store import has_poses
from .outputs import OUTPUTS, OutputError, check_numbers_kept


class BindingError(Exception):
    """The mesh cannot be bound as asked; the message says why and nothing was changed."""


def armature_modifier(ob, armature=None):
    """The mesh's first Armature modifier (on this armature), or None."""
    for modifier in ob.modifiers:
        if (modifier.type == "ARMATURE" and modifier.object is not None
                and armature in (None, modifier.object)):
            return modifier
    return None


def mixes_with_another(ob, modifier):
    """Whether Multi Modifier joins this modifier's result with that of another one."""
    armatures = [m for m in ob.modifiers
                 if m.type == "ARMATURE" and (m.show_viewport or m.show_render or m == modifier)]
    place = armatures.index(modifier)
    return (place > 0 and modifier.use_multi_modifier) or (
        place + 1 < len(armatures) and armatures[place + 1].use_multi_modifier)


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
    if ob.library or ob.override_library or ob.data.library:
        raise BindingError(f"{ob.name} is linked from another file; make it local first")
    if ob.data.users > 1:
        raise BindingError(
            f"The mesh {ob.data.name} has {ob.data.users} users; make it single-user first")
    if ob.data.is_editmode:
        raise BindingError(f"{ob.name} is in Edit Mode; leave it first")
    for bone in armature.data.bones:
        if bone.bbone_segments > 1 and getattr(bone, "bbone_mapping_mode", "STRAIGHT") != "STRAIGHT":
            raise BindingError(
                f"The B-bone {bone.name} of {armature.name} maps vertices along its curve, which "
                "Sinew cannot follow; set its Vertex Mapping to Straight")
    replaced = armature_modifier(ob, armature)
    if replaced and mixes_with_another(ob, replaced):
        raise BindingError(
            f"{ob.name} mixes several Armature modifiers (Multi Modifier), which Sinew cannot follow")
    if replaced and replaced.use_bone_envelopes:
        return
    bone_names = {bone.name for bone in armature.data.bones if bone.use_deform}
    if not any(group.name in bone_names for group in ob.vertex_groups):
        raise BindingError(
            f"No vertex group of {ob.name} has the name of a deforming bone of {armature.name}")


def bind(ob, armature, output="MODIFIER", method=None, source=None):
    """Let Sinew deform the mesh. An Armature modifier on that armature is switched off and its place
    in the stack taken; what it says of the method is kept unless `method` is given.
    Raises BindingError."""
    check_bindable(ob, armature)
    if ob.sinew.is_bound:
        unbind(ob)
    settings = ob.sinew
    replaced = armature_modifier(ob, armature)
    index = ob.modifiers.find(replaced.name) if replaced else 0
    before = blender_io.modifiers_before(ob, replaced) if replaced else []
    if output == "MESH" and before:
        raise BindingError(
            f"{ob.name} has a modifier before its armature's ({before[0].name}), which the output Mesh "
            "cannot follow; use the output Modifier")
    try:
        if before or ob.data.shape_keys:
            check_numbers_kept(ob, index)
        OUTPUTS[output].install(ob, index)
    except OutputError as error:
        raise BindingError(str(error)) from error
    if method is None:
        preserve = replaced is not None and replaced.use_deform_preserve_volume
        method = "DUAL_QUATERNION" if preserve else "LINEAR"
    if source is None:
        source = "CLIP" if has_poses(armature.data) else "ARMATURE"
    settings.armature, settings.method, settings.source = armature, method, source
    settings.use_vertex_groups = replaced is None or replaced.use_vertex_groups
    settings.use_envelopes = replaced is not None and replaced.use_bone_envelopes
    settings.mask_group = replaced.vertex_group if replaced else ""
    settings.mask_invert = replaced is not None and replaced.invert_vertex_group
    settings.output = settings.installed_output = output
    settings.replaced_modifier = replaced.name if replaced else ""
    if replaced:
        settings.replaced_show_viewport = replaced.show_viewport
        settings.replaced_show_render = replaced.show_render
        replaced.show_viewport = replaced.show_render = False
        # Else Blender evaluates the mesh once for the armature and once for Sinew, though the
        # modifier is switched off: half of a frame's time in 3.4.
        settings.replaced_object, replaced.object = replaced.object, None
    # Last, since the settings' update callbacks act on bound meshes alone.
    settings.is_bound = True
    session.forget_object(ob)
    session.refresh(ob)


def unbind(ob):
    """Give the mesh back as it was: rest positions, and the Armature modifier switched on again."""
    settings = ob.sinew
    OUTPUTS[settings.installed_output].remove(ob)
    settings.is_bound = False
    modifier = ob.modifiers.get(settings.replaced_modifier)
    if modifier:
        modifier.show_viewport = settings.replaced_show_viewport
        modifier.show_render = settings.replaced_show_render
        modifier.object = settings.replaced_object or modifier.object
    settings.replaced_object = None
    session.forget_object(ob)


def switch_output(ob):
    """Move a bound mesh to the output that its settings ask for. Raises OutputError, and then stays
    with the old one."""
    settings = ob.sinew
    old, new = settings.installed_output, settings.output
    if old == new:
        return
    index = max(ob.modifiers.find(settings.replaced_modifier), 0)
    settings.is_bound = False  # moving a modifier evaluates the scene, and handlers run
    OUTPUTS[old].remove(ob)
    try:
        OUTPUTS[new].install(ob, index)
        settings.installed_output = new
    except OutputError:
        OUTPUTS[old].install(ob, index)
        settings.output = old
        raise
    finally:
        settings.is_bound = True
        session.forget_object(ob)
        session.refresh(ob)
