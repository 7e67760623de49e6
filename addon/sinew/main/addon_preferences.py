"""Where the add-on's preferences are. What they are stands in ui/preferences.py."""

from typing import Any

import bpy

ADDON = __package__.rpartition(".")[0]  # the name under which Blender knows the add-on


def of_sinew(context: bpy.types.Context | None = None) -> Any:
    """Returns the add-on's preferences, or None if the add-on runs without being enabled there."""
    addon = (context or bpy.context).preferences.addons.get(ADDON)
    return addon.preferences if addon else None
