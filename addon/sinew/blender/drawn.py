"""What Sinew draws into Blender's editors."""

from collections.abc import Callable
from typing import Any


class Drawn:
    """A function that Blender calls whenever it draws an editor, from show() until hide()."""

    def __init__(self, space: Any, draw: Callable[[], None], when: str = "POST_VIEW") -> None:
        """space: the type of the editor, for example bpy.types.SpaceView3D. when: as in its draw_handler_add."""
        self._space, self._draw, self._when = space, draw, when
        self._handle: Any = None

    def is_shown(self) -> bool:
        return self._handle is not None

    def show(self) -> None:
        if self._handle is None:
            self._handle = self._space.draw_handler_add(self._draw, (), "WINDOW", self._when)

    def hide(self) -> None:
        if self._handle is not None:
            self._space.draw_handler_remove(self._handle, "WINDOW")
            self._handle = None
