"""Blender forbids Python to write while it draws the interface, by one flag for all threads. When a render evaluates in
a thread of its own, the `get` of a property takes the flag down for itself and puts it up again afterwards; if drawing
has ended meanwhile, the flag stays up. From then on no timer, handler or script of any add-on may write, or call an
operator. Sinew's hook is such a `get`, so Sinew takes the flag down after a render.

How: another thread reads a property whose `get` waits, for which Blender takes the flag down. An operator that is
called then finds it down, lets the other thread put it up, and ends: Blender puts the flag back as it was before.

The flag stays up in 3.4, 4.3 and 5.0.1, and not in 4.2.23, 4.5.15, 5.1.2 and 5.2. In 5.0 this does not take it down.
"""

import threading

import bpy
from bpy.app.handlers import persistent

from . import callbacks

SECONDS = 1.0  # to wait for the other thread at most
LOOKS = 4  # after a render, whose last evaluations may end a little later
_looks = 0  # to come
_reading = None


class _Reading:
    """What the other thread does."""

    def __init__(self):
        self.has_begun, self.may_end = threading.Event(), threading.Event()
        # What the property is read from is found here: bpy.context belongs to this thread.
        self._thread = threading.Thread(target=getattr, args=(bpy.context.window_manager, "sinew_waits"), daemon=True)

    def begin(self):
        self._thread.start()
        self.has_begun.wait(SECONDS)

    def end(self):
        self.may_end.set()
        self._thread.join(SECONDS)


def _wait(_manager):
    if _reading is not None:
        _reading.has_begun.set()
        _reading.may_end.wait(SECONDS)
    return False


class MayWrite(bpy.types.Operator):
    """Do nothing, if Blender lets Python call an operator"""

    bl_idname = "wm.sinew_may_write"
    bl_label = "May Write"
    bl_options = {"INTERNAL"}

    def execute(self, _context):
        if _reading is not None:
            _reading.end()
        return {"FINISHED"}


def may_write():
    """Whether the flag is down."""
    try:
        bpy.ops.wm.sinew_may_write()
    except RuntimeError as error:
        if "drawing/rendering" not in str(error):
            raise
        return False
    return True


def release():
    """Takes the flag down if it is up. In the main thread, while nothing is drawn: from a timer."""
    global _reading
    if may_write():
        return
    _reading = _Reading()
    try:
        _reading.begin()
        may_write()
    finally:
        _reading.end()
        _reading = None


def look():
    """From a timer."""
    global _looks
    if _looks:
        _looks -= 1
        release()


@persistent
def after_render(*_):
    """In whichever thread."""
    global _looks
    _looks = LOOKS


HANDLERS = (("render_complete", after_render), ("render_cancel", after_render))


def register():
    bpy.utils.register_class(MayWrite)
    bpy.types.WindowManager.sinew_waits = bpy.props.BoolProperty(get=_wait, options={"HIDDEN", "SKIP_SAVE"})
    callbacks.add(HANDLERS)


def unregister():
    callbacks.remove(HANDLERS)
    del bpy.types.WindowManager.sinew_waits
    bpy.utils.unregister_class(MayWrite)
