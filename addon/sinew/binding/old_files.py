"""Files of Sinew 0.1: there the Armature modifier of a bound mesh was switched off and taken off its armature, and
frame handlers deformed. Such a mesh is bound anew when its file is opened."""

import bpy

from ..blender import animation, meshes, nodes
from . import mesh_output, wiring

ANCHOR = "sinew_anchor"  # a custom property whose driver kept the armature evaluated


def is_old(ob):
    settings, own = ob.sinew, nodes.find_modifier(ob)
    return settings.is_bound and ob.library is None and wiring.first_taken(ob) is None and bool(
        len(settings.replaced) or ANCHOR in ob or settings.installed_output == "MESH"
        or own and own.node_group[nodes.VERSION_PROPERTY] < nodes.NODE_GROUP_VERSION)


def give_back(ob):
    """As it was before it was bound. Returns its armature, or None if that is not to be known."""
    settings = ob.sinew
    preserves_volume = _number_of(settings, "method") == 1
    if settings.installed_output == "MESH":
        mesh_output.remove(ob)
    nodes.remove_modifiers(ob)
    for name in [name for name in ob.data.attributes.keys() if name.startswith((nodes.POSITION_ATTRIBUTE, ".sinew_"))]:
        meshes.remove_attribute(ob.data, name)
    animation.remove_driver(ob, f'["{ANCHOR}"]')
    if ANCHOR in ob:
        del ob[ANCHOR]
    armature = ob.parent if ob.parent and ob.parent.type == "ARMATURE" else None
    for number, entry in enumerate(settings.replaced):
        modifier = ob.modifiers.get(entry.name)
        if modifier is None:
            continue
        modifier.object = entry.object
        modifier.show_viewport, modifier.show_render = entry.show_viewport, entry.show_render
        if number == 0:
            armature = entry.object
            modifier.use_deform_preserve_volume = preserves_volume or modifier.use_deform_preserve_volume
    settings.replaced.clear()
    settings.is_bound = False
    return armature


def _number_of(settings, name):
    """What 0.1 had stored for a setting that is now the modifier's."""
    try:
        return settings[name]
    except (KeyError, TypeError):  # 5.0 and later do not show it
        return None


class SinewReplacedModifier(bpy.types.PropertyGroup):
    """An Armature modifier that 0.1 had switched off, and how it was."""

    name: bpy.props.StringProperty(override={"LIBRARY_OVERRIDABLE"})
    object: bpy.props.PointerProperty(type=bpy.types.Object, override={"LIBRARY_OVERRIDABLE"})
    show_viewport: bpy.props.BoolProperty(override={"LIBRARY_OVERRIDABLE"})
    show_render: bpy.props.BoolProperty(override={"LIBRARY_OVERRIDABLE"})
