"""Modifiers as their settings."""

from typing import Any

import bpy

from ..host import modifier_memory

_BESIDE_RESULT = {
    "name",
    "is_active",
    "show_expanded",
    "show_in_editmode",
    "show_on_cage",
    "use_apply_on_spline",
    "use_pin_to_last",
}


def settings_of(modifier: bpy.types.Modifier) -> dict[str, Any]:
    """Returns the settings that decide a modifier's result, by the names of its properties. A vertex group that is
    missing counts as none: Blender does not take its name."""
    found = {}
    groups = modifier.id_data.vertex_groups
    for each in modifier.bl_rna.properties:
        if not each.is_readonly and each.identifier not in _BESIDE_RESULT:
            value = getattr(modifier, each.identifier)
            if each.identifier.startswith("vertex_group") and isinstance(value, str) and value not in groups:
                value = ""
            found[each.identifier] = tuple(value) if getattr(each, "is_array", False) else value
    return found


def content_of(modifier: bpy.types.Modifier) -> tuple[dict[str, Any], bytes]:
    """Returns the settings that decide a modifier's result, and what Blender's API does not show of them."""
    return settings_of(modifier), modifier_memory.read_settings(modifier)


def copy(modifier: bpy.types.Modifier, ob: bpy.types.Object) -> bpy.types.Modifier:
    """Adds a modifier with the same name and result to an object, behind all that it has. Returns it."""
    made = ob.modifiers.new(modifier.name, modifier.type)
    for setting, value in settings_of(modifier).items():
        setattr(made, setting, value)
    modifier_memory.copy_settings(modifier, made)
    return made
