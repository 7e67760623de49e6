"""Clears a flag that Blender may leave set, and that keeps Python from writing.

While Blender draws the interface, it forbids Python to write, by one flag for all threads. When a render evaluates in
its own thread, the `get` of a property ends by restoring the flag that it found; if drawing has ended in the meantime,
the flag stays set. From then on no timer or handler of any add-on can write, or call an operator. Sinew's hook is such
a `get`, so Sinew checks the flag: before its frame and edit handlers, and in a timer that runs, while something
renders, each time that Blender processes its timers. Nothing is drawn at these moments, so a flag that is set was left
behind.

How the flag is cleared: another thread starts something for which Blender clears the flag, and waits. A `poll` function
that is called now finds the flag cleared, lets the other thread set it again, and ends: Blender restores the flag that
`poll` found.

The flag stays set in 3.4, 4.3 and 5.0.1, and not in 4.2.23, 4.5.15, 5.1.2 and 5.2.
"""

import threading

import bpy

from ..blender import values
from ..native import sinew_native
from ..run import mail
from . import callbacks

MAY_STAY = values.VERSION < (5, 1, 0)
SECONDS = 1.0  # for the other thread, at most
SECONDS_BETWEEN_LOOKS = 0.1  # between checks of the flag, while nothing renders
JOBS = ("RENDER", "OBJECT_BAKE")  # the jobs that evaluate in their own thread
_reading = None


class _Reading:
    """A thread that reads or sets a property, and waits inside that call."""

    def __init__(self):
        self.has_begun, self.may_end = threading.Event(), threading.Event()
        self._task = None

    def begin(self) -> None:
        manager = bpy.context.window_manager  # bpy.context belongs to this thread
        self._task = sinew_native.Task(lambda: _have_it_wait(manager))
        self.has_begun.wait(SECONDS)

    def end(self) -> None:
        self.may_end.set()
        if self._task is not None:
            self._task.wait(SECONDS)


def _have_it_wait(manager):
    """Waits inside the `get` of a property or, in 5.0, inside its `update`: 5.0 clears the flag only for the latter."""
    if values.VERSION >= (5, 0, 0):
        manager.sinew_waits = True
    else:
        _ = manager.sinew_waits


def _get(_manager):
    _wait()
    return False


def _wait():
    if _reading is not None:
        _reading.has_begun.set()
        _reading.may_end.wait(SECONDS)


class TakeFlagDown(bpy.types.Operator):
    """Has a `poll` function, and does nothing"""

    bl_idname = "wm.sinew_take_flag_down"
    bl_label = "Take Flag Down"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, _context):
        if _reading is not None:
            _reading.end()
        return False


def may_write() -> bool:  # type: ignore[return] # a scene's name_full cannot be set
    """Whether the flag is cleared. When a property is set, Blender checks the flag before anything else."""
    try:
        bpy.context.scene.name_full = ""
    except AttributeError as error:
        return "not allowed" not in str(error)


def look() -> None:
    """Clears the flag if it is set. Call it in the main thread while nothing is drawn; in others it does nothing."""
    global _reading
    is_elsewhere = not mail.is_main_thread()
    if not MAY_STAY or is_elsewhere or _reading is not None or may_write():
        return
    _reading = _Reading()
    try:
        _reading.begin()
        bpy.ops.wm.sinew_take_flag_down.poll()
    finally:
        _reading.end()
        _reading = None


def is_rendering() -> bool:
    return any(map(bpy.app.is_job_running, JOBS))


def look_again_and_again() -> float:
    """Checks the flag as a timer. Returns the seconds until the next check."""
    look()
    return 0.0 if is_rendering() else SECONDS_BETWEEN_LOOKS


def register() -> None:
    bpy.utils.register_class(TakeFlagDown)
    bpy.types.WindowManager.sinew_waits = bpy.props.BoolProperty(
        get=_get,
        set=lambda _manager, _value: None,
        update=lambda _manager, _context: _wait(),
        options={"HIDDEN", "SKIP_SAVE"},
    )
    if MAY_STAY:
        callbacks.start(look_again_and_again)


def unregister() -> None:
    if MAY_STAY:
        callbacks.stop(look_again_and_again)
    del bpy.types.WindowManager.sinew_waits
    bpy.utils.unregister_class(TakeFlagDown)
