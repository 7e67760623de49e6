"""Blender's paths of a rig's properties: which of them are numbers that poses depend on. Imports no bpy."""

import re
from functools import lru_cache

from ..blender.spoken_paths import NAME

BONE = re.compile(rf"^(?:pose|data)\.bones{NAME}")

SWITCHES = "mute", "enabled"  # of a constraint: the same bit, and its contrary
SWITCH = re.compile(rf"\.constraints{NAME}\.({'|'.join(SWITCHES)})$")

# What may be animated without any effect on poses: what is shown, how bones and their collections look.
WITHOUT_EFFECT = re.compile(
    r"(^|\.)(hide|hide_select|hide_viewport|hide_render|is_visible|is_solo|is_expanded|select|select_head|select_tail|"
    r"custom_shape\w*|show_\w+|use_custom_shape\w*|color|display_\w+|layers|draw_\w+|bbone_x|bbone_z|envelope_\w+|"
    r"head_radius|tail_radius|use_deform|use_envelope_multiply|lock_location|lock_rotation|lock_rotation_w|"
    r"lock_rotations_4d|lock_scale|pass_index|use_transform_limit|visible_\w+|error_\w+)(\.\w+|\[\d+\])?$"
)
# Where the armature's object is.
OBJECT_TRANSFORM = re.compile(r"^(delta_)?(location|rotation_\w+|scale)(\.[wxyz]|\[\d+\])?$|^parent\b|^constraints\b")


def has_effect(path: str) -> bool:
    """Whether poses may depend on a property. path: of the armature's object; its data's begin with `data.`."""
    return not _is_without_effect(path.rpartition('"]')[2]) and not path.startswith(
        ("data.collections", "data.layers", "animation_data")
    )


@lru_cache(1024)
def _is_without_effect(end: str) -> bool:
    """end: what comes after the last name, in which alone there may be a match."""
    return WITHOUT_EFFECT.search(end) is not None


def moves_object(path: str) -> bool:
    """Whether it is where the armature's object is."""
    return OBJECT_TRANSFORM.match(path) is not None


def normalised(path: str) -> str:
    """Returns the path as Blender writes it: with double quotes, and no point before a custom property."""
    if "'" in path:
        path = path.replace("['", '["').replace("']", '"]')
    return path.replace('.["', '["') if '.["' in path else path
