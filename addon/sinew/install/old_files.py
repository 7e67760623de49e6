"""Reads files of Sinew 0.1.

There, the Armature modifier of a bound mesh was switched off and its armature removed, and frame handlers deformed. The
output Mesh wrote the shape into the mesh itself and kept the rest shape in an attribute. A later version left the
modifier in place, but with its binding switched off. Such a mesh is bound again when its file is opened.
"""

import bpy

from ..blender import animation, meshes, nodes
from ..plan import wiring

ANCHOR = "sinew_anchor"  # a custom property whose driver kept the armature evaluated
REST_ATTRIBUTE = "rest_position"


def is_old(ob: bpy.types.Object) -> bool:
    """Whether a mesh was bound by such a version."""
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


def give_back(ob: bpy.types.Object) -> bpy.types.Object | None:
    """Restores the object as it was before it was bound. Returns its armature, or None if that is unknown."""
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
    """Restores the rest shape from its attribute."""
    attribute = meshes.point_attribute(mesh, REST_ATTRIBUTE)
    if attribute is not None:  # otherwise the user has removed it: the mesh keeps its shape
        meshes.write_positions(mesh, meshes.read_attribute(attribute))
        meshes.remove_attribute(mesh, REST_ATTRIBUTE)


def _number_of(settings, name):
    """Returns the value that 0.1 stored for a setting that the modifier has now, or None."""
    try:
        return settings[name]
    except (KeyError, TypeError):  # 5.0 and later give no access to it
        return None


class SinewReplacedModifier(bpy.types.PropertyGroup):
    """An Armature modifier that 0.1 switched off, and its settings before."""

    name: bpy.props.StringProperty(override={"LIBRARY_OVERRIDABLE"})
    object: bpy.props.PointerProperty(type=bpy.types.Object, override={"LIBRARY_OVERRIDABLE"})
    show_viewport: bpy.props.BoolProperty(override={"LIBRARY_OVERRIDABLE"})
    show_render: bpy.props.BoolProperty(override={"LIBRARY_OVERRIDABLE"})
