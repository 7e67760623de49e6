"""Blender forbids Python to write while it draws the interface, by one flag for all threads. When a render evaluates in
a thread of its own, the `get` of a property puts the flag back after itself as it had found it; if drawing has ended
meanwhile, the flag stays up. From then on no timer or handler of any add-on may write, or call an operator. Sinew's
hook is such a `get`, so Sinew looks after the flag: before the handlers of frames and edits, and by a timer, while a
render runs each time that Blender comes to its timers. Nothing is drawn then, so a flag that is up was left.

How it is taken down: another thread begins what Blender takes the flag down for, and waits. A `poll` function that is
called now finds it down, lets the other thread put it up, and ends: Blender puts the flag back as `poll` found it.

The flag stays up in 3.4, 4.3 and 5.0.1, and not in 4.2.23, 4.5.15, 5.1.2 and 5.2.
"""

import threading

import bpy

from ..blender import values
from . import callbacks

MAY_STAY = values.VERSION < (5, 1, 0)
SECONDS = 1.0  # to wait for the other thread at most
SECONDS_BETWEEN_LOOKS = 0.1  # while nothing renders
JOBS = ("RENDER", "OBJECT_BAKE")  # that evaluate in a thread of their own
_reading = None


class _Reading:
    """What the other thread does."""

    def __init__(self):
        self.has_begun, self.may_end = threading.Event(), threading.Event()
        # What it is read from is found here: bpy.context belongs to this thread.
        self._thread = threading.Thread(target=_have_it_wait, args=(bpy.context.window_manager,), daemon=True)

    def begin(self):
        self._thread.start()
        self.has_begun.wait(SECONDS)

    def end(self):
        self.may_end.set()
        self._thread.join(SECONDS)


def _have_it_wait(manager):
    """5.0 does not take the flag down for a `get`, but for an `update`."""
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


def may_write():
    """Whether the flag is down. Blender looks at it before all else that may be wrong with a property that is set."""
    try:
        bpy.context.scene.name_full = ""
    except AttributeError as error:
        return "not allowed" not in str(error)


def look():
    """Takes the flag down if it is up. In the main thread, while nothing is drawn; elsewhere nothing happens."""
    global _reading
    is_elsewhere = threading.current_thread() is not threading.main_thread()
    if not MAY_STAY or is_elsewhere or _reading is not None or may_write():
        return
    _reading = _Reading()
    try:
        _reading.begin()
        bpy.ops.wm.sinew_take_flag_down.poll()
    finally:
        _reading.end()
        _reading = None


def is_rendering():
    return any(map(bpy.app.is_job_running, JOBS))


def look_again_and_again():
    """As a timer."""
    look()
    return 0.0 if is_rendering() else SECONDS_BETWEEN_LOOKS


def register():
    bpy.utils.register_class(TakeFlagDown)
    bpy.types.WindowManager.sinew_waits = bpy.props.BoolProperty(
        get=_get,
        set=lambda _manager, _value: None,
        update=lambda _manager, _context: _wait(),
        options={"HIDDEN", "SKIP_SAVE"},
    )
    if MAY_STAY:
        callbacks.start(look_again_and_again)


def unregister():
    if MAY_STAY:
        callbacks.stop(look_again_and_again)
    del bpy.types.WindowManager.sinew_waits
    bpy.utils.unregister_class(TakeFlagDown)
