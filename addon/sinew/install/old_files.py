"""Files of Sinew 0.1: there the Armature modifier of a bound mesh was switched off and taken off its armature, and
frame handlers deformed. The output Mesh wrote the shape into the mesh itself, with the rest shape in an attribute; a
later version left the modifier where it was, but bound to nothing. Such a mesh is bound anew when its file opens."""

import bpy

from ..blender import animation, meshes, nodes
from ..plan import wiring

ANCHOR = "sinew_anchor"  # a custom property whose driver kept the armature evaluated
REST_ATTRIBUTE = "rest_position"


def is_old(ob):
    settings, own = ob.sinew, nodes.find_modifier(ob)
    if not settings.is_bound or ob.library is not None:
        return False
    return (
        bool(settings.held)
        or wiring.carrier_of(ob) is None
        and bool(
            len(settings.replaced)
            or ANCHOR in ob
            or settings.last_armature is None
            and meshes.point_attribute(ob.data, REST_ATTRIBUTE)
            or own
            and own.node_group[nodes.VERSION_PROPERTY] < nodes.NODE_GROUP_VERSION
        )
    )


def give_back(ob):
    """As it was before it was bound. Returns its armature, or None if that is not to be known."""
    settings = ob.sinew
    preserves_volume = _number_of(settings, "method") == 1
    if settings.installed_output == "MESH":
        _put_rest_back(ob.data)
    nodes.remove_modifiers(ob)
    for name in [name for name in ob.data.attributes.keys() if name.startswith((nodes.POSITION_ATTRIBUTE, ".sinew_"))]:
        meshes.remove_attribute(ob.data, name)
    animation.remove_driver(ob, f'["{ANCHOR}"]')
    if ANCHOR in ob:
        del ob[ANCHOR]
    armature = ob.parent if ob.parent and ob.parent.type == "ARMATURE" else None
    for modifier, held in zip(wiring.taken_modifiers(ob), settings.held.split()):
        armature = settings.armature
        for name, digit in zip(wiring.BINDS, held):
            setattr(modifier, name, digit == "1")
    settings.held = ""
    wiring.unwire(ob)
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


def _put_rest_back(mesh):
    attribute = meshes.point_attribute(mesh, REST_ATTRIBUTE)
    if attribute is not None:  # else somebody has removed it: the shape stays
        meshes.write_positions(mesh, meshes.read_attribute(attribute))
        meshes.remove_attribute(mesh, REST_ATTRIBUTE)


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
