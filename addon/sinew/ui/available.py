"""What operators have in common: why one is not available, which Blender tells where the button is gray and in the
error of a script, and how errors are reported."""

from collections.abc import Callable
from typing import Any

import bpy

ERRORS = (ValueError, OSError, MemoryError)  # which are reported
MODES = {"OBJECT": "Object Mode", "POSE": "Pose Mode", "PAINT_WEIGHT": "Weight Paint"}


class Reports:
    """A mixin of operators whose errors are reported. Each defines `run` in place of `execute`: it returns an
    operator's result, None for FINISHED, and may raise ERRORS."""

    def run(self, context: bpy.types.Context) -> set[str] | None:
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self.at_once(lambda: self.run(context))

    def at_once(self: Any, work: Callable[[], set[str] | None]) -> set[str]:
        """Calls work() and reports its errors."""
        try:
            return work() or {"FINISHED"}
        except ERRORS as error:
            return self.fail(error)

    def fail(self: Any, error: Any) -> set[str]:
        name = getattr(error, "filename", None)
        text = f"{name}: {error.strerror}" if name else str(error) or "There is not enough memory"
        self.report({"ERROR"}, text)
        return {"CANCELLED"}


class Explains(Reports):
    """A mixin of operators. Each defines `why_not` in place of `poll`, or tells the modes in which it is available."""

    modes: tuple[str, ...] = ()  # of MODES

    @classmethod
    def poll(cls: Any, context: bpy.types.Context) -> bool:
        why = cls.why_not(context)
        if why:
            cls.poll_message_set(why)
        return not why

    @classmethod
    def why_not(cls, context: bpy.types.Context) -> str:
        """Returns what to do before the operator is available, in one line; "" if it is."""
        return other_mode(context, *cls.modes)


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
