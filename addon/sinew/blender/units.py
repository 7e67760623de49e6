"""Lengths in the unit of a scene, for people."""

import bpy

_DIGITS = 3


def length(scene: bpy.types.Scene, distance: float) -> str:
    """Returns a distance in world space as the scene's unit system writes it: "3.2 mm"; without one, a number."""
    settings = scene.unit_settings
    if settings.system == "NONE":
        return f"{distance:.{_DIGITS}g}"
    return bpy.utils.units.to_string(
        settings.system, "LENGTH", distance * settings.scale_length, precision=_DIGITS
    ).strip()
