"""Blender's callbacks for onion skins. They come after those that play rigs."""

import logging
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ..main import callbacks
from . import ghosts

log = logging.getLogger("sinew")


def _after_evaluation(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, is_new_frame: bool) -> None:
    """Keeps the shapes that were evaluated. If it fails, no ghosts are shown any more."""
    try:
        ghosts.after_evaluation(scene, depsgraph, is_new_frame)
    except Exception:
        log.exception("ghosts cannot be kept, so none are shown")
        for rig in ghosts.shown():
            ghosts.hide(rig)


@persistent
def after_frame(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    _after_evaluation(scene, depsgraph, True)


@persistent
def after_update(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    _after_evaluation(scene, depsgraph, False)


@persistent
def after_undo(*_: Any) -> None:
    ghosts.find_again()


HANDLERS = (
    ("frame_change_post", after_frame),
    ("depsgraph_update_post", after_update),
    ("undo_post", after_undo),
    ("redo_post", after_undo),
)


def register() -> None:
    callbacks.add(HANDLERS)


def unregister() -> None:
    callbacks.remove(HANDLERS)
