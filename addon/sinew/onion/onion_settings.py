"""How many onion skins are shown, and how they look: a part of the preferences, so that no file has it."""

from typing import Any

import bpy
from bpy.props import BoolProperty, FloatProperty, FloatVectorProperty, IntProperty


class SinewOnionSettings(bpy.types.PropertyGroup):
    """Settings of onion skins."""

    before: IntProperty(
        name="Before", description="Number of ghosts before the current frame", default=3, min=0, max=50
    )
    after: IntProperty(name="After", description="Number of ghosts after the current frame", default=3, min=0, max=50)
    step: IntProperty(name="Step", description="Frames from one ghost to the next", default=2, min=1, max=1000)
    color_before: FloatVectorProperty(
        name="Color Before",
        description="Color of the ghosts before the current frame",
        subtype="COLOR",
        default=(0.15, 0.55, 1.0),
        min=0,
        max=1,
    )
    color_after: FloatVectorProperty(
        name="Color After",
        description="Color of the ghosts after the current frame",
        subtype="COLOR",
        default=(1.0, 0.4, 0.1),
        min=0,
        max=1,
    )
    opacity: FloatProperty(
        name="Opacity",
        description="Opacity of the ghosts nearest to the current frame",
        subtype="FACTOR",
        default=0.35,
        min=0,
        max=1,
    )
    shows_paths: BoolProperty(
        name="Motion Paths",
        description="Show where the selected bones go, in Pose Mode: computed at once, and again after each edit. Only "
        "of rigs that are computed natively",
    )
    path_frames: IntProperty(
        name="Frames",
        description="Frames of a motion path before and after the current one",
        default=20,
        min=1,
        max=500,
    )


def draw(layout: bpy.types.UILayout, settings: Any) -> None:
    """Draws the settings, one below the other."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    for names in (
        ("before", "after", "step"),
        ("color_before", "color_after", "opacity"),
        ("shows_paths", "path_frames"),
    ):
        column = layout.column(align=True)
        for name in names:
            column.prop(settings, name)
