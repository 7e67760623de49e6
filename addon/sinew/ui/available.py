"""Why an operator is not available: Blender tells it where the button is gray, and in the error of a script."""

from typing import Any

import bpy

MODES = {"OBJECT": "Object Mode", "POSE": "Pose Mode", "PAINT_WEIGHT": "Weight Paint"}


class Explains:
    """A mixin of operators. Each defines `why_not` in place of `poll`."""

    @classmethod
    def poll(cls: Any, context: bpy.types.Context) -> bool:
        why = cls.why_not(context)
        if why:
            cls.poll_message_set(why)
        return not why

    @classmethod
    def why_not(cls, context: bpy.types.Context) -> str:
        """Returns what to do before the operator is available, in one line; "" if it is."""
        raise NotImplementedError


def other_mode(context: bpy.types.Context, *modes: str) -> str:
    """Returns what to do unless the context is in one of these of MODES."""
    if context.mode in modes:
        return ""
    names = [MODES[each] for each in modes]
    return "Switch to " + " or ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def playing(context: bpy.types.Context) -> str:
    """Returns what to do if the animation plays."""
    return "Stop the animation first" if context.screen and context.screen.is_animation_playing else ""


def no_mesh(ob: Any) -> str:
    """Returns what to do unless an active object is a mesh."""
    return "" if ob is not None and ob.type == "MESH" else "Select a mesh"


def linked(ob: Any) -> str:
    """Returns what to do if a mesh object or its mesh is linked from another file."""
    is_linked = ob.library is not None or ob.data.library is not None
    return f"{ob.name} is linked from another file: edit it there, or make it local" if is_linked else ""


def unbound(ob: Any) -> str:
    """Returns what to do unless an active object is an accelerated mesh."""
    return no_mesh(ob) or ("" if ob.sinew.is_bound else f"Accelerate {ob.name} first")
