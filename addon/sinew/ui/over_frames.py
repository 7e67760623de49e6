"""What operators share whose dialog sets what another operator, step by step, does on a range of frames."""

from typing import Any

import bpy
from bpy.props import IntProperty

from ..bake.frame_range import FrameRange


class OverFrames:
    """The properties of both operators. Those of a job derive from this and add their own."""

    frame_start: IntProperty(name="First Frame", description="The first frame to bake; by default the scene's")
    frame_end: IntProperty(name="Last Frame", description="The last frame to bake; by default the scene's")
    frame_step: IntProperty(name="Step", description="Distance from one baked frame to the next", default=1, min=1)

    def settings(self: Any) -> dict[str, Any]:
        """Returns the properties that are set, without those of the operator itself."""
        names = [
            name
            for kind in type(self).__mro__
            if issubclass(kind, OverFrames) and not issubclass(kind, bpy.types.Operator)
            for name in kind.__annotations__
        ]
        return {name: getattr(self, name) for name in names if self.properties.is_property_set(name)}

    def frames(self: Any, scene: bpy.types.Scene) -> FrameRange:
        is_set = self.properties.is_property_set
        return FrameRange(
            self.frame_start if is_set("frame_start") else scene.frame_start,
            self.frame_end if is_set("frame_end") else scene.frame_end,
            self.frame_step,
        )

    def set_frames(self: Any, scene: bpy.types.Scene) -> None:
        """Has the dialog show the scene's frames."""
        for name in ("frame_start", "frame_end"):
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(scene, name))

    def start(self: Any, steps: Any) -> set[str]:
        """Calls the operator `steps` with the settings: with progress if there is a window. Raises ValueError
        with its error."""
        how = "EXEC_DEFAULT" if bpy.app.background or bpy.context.window is None else "INVOKE_DEFAULT"
        try:
            return {"FINISHED"} & steps(how, **self.settings()) or {"CANCELLED"}
        except RuntimeError as error:
            raise ValueError(str(error).strip().removeprefix("Error: ")) from error
