"""Blender's callbacks."""

import bpy
from bpy.app.handlers import persistent

from . import binding, notice, session


@persistent
def on_frame_change(scene, depsgraph):
    session.on_frame(scene, depsgraph)


@persistent
def on_depsgraph_update(_scene, depsgraph):
    session.on_update(depsgraph)
    for ob in session.take_applied():
        binding.release_applied(ob)


@persistent
def on_load(*_):
    notice.forget()
    session.forget()
    session.refresh_all()


@persistent
def on_undo_redo(*_):
    session.forget_after_undo()


HANDLERS = (
    ("frame_change_post", on_frame_change),
    ("depsgraph_update_post", on_depsgraph_update),
    ("load_post", on_load),
    ("undo_post", on_undo_redo),
    ("redo_post", on_undo_redo),
)


def register():
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister():
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
    session.forget()
