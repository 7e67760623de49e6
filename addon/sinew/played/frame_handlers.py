"""Blender's callbacks for played armatures."""

import logging
from time import perf_counter
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ..feedback import notice
from ..host import contract, evaluations, relations
from ..main import callbacks
from . import accelerating, playing, rigs, states

log = logging.getLogger("sinew")
SECONDS_BETWEEN_LOOKS = 0.3  # between attempts to take over again what is to be played
LOOKS_BEFORE_COMPARING = 10  # without anything to do
_tried = (0, False)  # the number of evaluations at the last attempt, and whether the scene played
_has_accelerated = False  # all that can be done without another evaluation
_looks = 0  # since then
# Blender builds relations anew after each such step, which takes half a second for ten thousand objects. So many times
# as long as a step has taken nothing is done: accelerating takes a fifth of the time, comparing more a thirtieth.
PAUSE_AFTER_STEP, PAUSE_AFTER_COMPARING = 4, 29
_paused_until = 0.0  # as perf_counter counts
# In the background: whoever has changed so many frames changes more, and it pays to read the rigs.
FRAMES_AHEAD = 24
# How the names of operators begin with which somebody drags something.
DRAGS = "TRANSFORM_OT_", "POSE_OT_", "GIZMOGROUP_OT_"
FRAMES_LOOKED_AT = 3  # the last of these: a rig that somebody edits before one of them is not read
_frames = 0  # that were changed since


def _guarded(function: Any, *arguments: Any) -> None:
    """Calls a function. If it fails, everything is live again."""
    try:
        function(*arguments)
    except contract.Broken:  # the panel says so
        states.melt_all()
    except Exception:
        log.exception("the rigs cannot be played, so they are Blender's again")
        states.melt_all()


@persistent
def before_frame(scene: bpy.types.Scene, *_: Any) -> None:
    if bpy.app.background and _frames >= FRAMES_AHEAD - FRAMES_LOOKED_AT and not playing.is_busy():
        _guarded(accelerating.rest_edited, bpy.context.view_layer)
    _guarded(playing.before_evaluation, scene, True)


@persistent
def before_update(scene: bpy.types.Scene, *_: Any) -> None:
    _guarded(playing.before_evaluation, scene, False)


@persistent
def after_frame(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    playing.count_evaluation()
    _guarded(playing.after_evaluation, scene, depsgraph, True)


@persistent
def after_others(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Accelerates rigs in the background. To other handlers of this frame, the graph would have no updates then."""
    global _frames
    if bpy.app.background and depsgraph.mode == "VIEWPORT":
        _frames += 1
        if _frames >= FRAMES_AHEAD:
            _frames = 0
            _guarded(accelerating.accelerate_unasked, scene, depsgraph)


@persistent
def after_update(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    playing.count_evaluation()
    _guarded(playing.after_evaluation, scene, depsgraph, False)


@persistent
def after_load(*_: Any) -> None:
    global _frames
    _frames = 0
    rigs.forget()
    accelerating.forget()


@persistent
def after_undo(*_: Any) -> None:
    states.find_again()
    accelerating.forget()


def is_dragging(window: Any) -> bool:
    """Whether somebody drags something in a window; False before Blender 4.2, which does not tell."""
    return any(each.bl_idname.startswith(DRAGS) for each in getattr(window, "modal_operators", ()))


def take_over_again() -> float:
    """Takes over again what is to be played and is not selected, as a timer. While the scene plays only what was
    handed back together with another one, which takes one building of relations; during a drag nothing. If nothing has
    been evaluated since the last call, accelerates rigs. Returns the seconds until the next call."""
    global _tried, _has_accelerated, _looks, _paused_until
    context = bpy.context
    if context.window is not None and is_dragging(context.window):
        return SECONDS_BETWEEN_LOOKS
    if context.window is None or evaluations.is_job_running() or states.keeps_live():
        _tried = (-1, False)  # what has to wait for a job is tried after it
        return SECONDS_BETWEEN_LOOKS
    is_playing = context.screen.is_animation_playing
    if _tried != (playing.evaluation_count(), is_playing):
        try:
            states.take_over_again(context.scene, context.view_layer, is_playing)
        except Exception:
            log.exception("no rig could be played again")
        _tried, _has_accelerated, _looks = (playing.evaluation_count(), is_playing), False, 0
    elif context.scene.sinew_accelerates_rigs and not (is_playing or getattr(context.window, "modal_operators", ())):
        start = perf_counter()
        if start < _paused_until:
            return SECONDS_BETWEEN_LOOKS
        was_done, _has_accelerated = _has_accelerated, True
        try:
            if _accelerate(context.scene, context.view_layer, was_done):
                notice.redraw()
                context.view_layer.update()  # which drawing would do
        except Exception:
            log.exception("no rig could be accelerated")
        end = perf_counter()
        _paused_until = end + (end - start) * (PAUSE_AFTER_COMPARING if was_done else PAUSE_AFTER_STEP)
        _tried = playing.evaluation_count(), is_playing
    return SECONDS_BETWEEN_LOOKS


def _accelerate(scene: Any, layer: Any, is_done: bool) -> bool:
    """Accelerates a rig, or if that is done, compares one now and then. Returns whether anything has come of it."""
    global _has_accelerated, _looks
    accelerating.end_rests()
    if not is_done:
        _has_accelerated = not accelerating.step(scene, layer, playing.evaluation_count())
        return not _has_accelerated
    _looks = (_looks + 1) % LOOKS_BEFORE_COMPARING
    return _looks == 0 and accelerating.compare_more(scene, layer)


# After all others: before an evaluation, these see the bones of the last one.
LAST_HANDLERS = (
    ("frame_change_pre", before_frame),
    ("depsgraph_update_pre", before_update),
    ("frame_change_post", after_others),
)
HANDLERS = (
    ("frame_change_post", after_frame),
    ("depsgraph_update_post", after_update),
    ("load_post", after_load),
    ("undo_post", after_undo),
    ("redo_post", after_undo),
)


def register() -> None:
    callbacks.add(HANDLERS)
    callbacks.add(LAST_HANDLERS, is_last=True)
    callbacks.start(take_over_again)


def unregister() -> None:
    callbacks.stop(take_over_again)
    callbacks.remove((*HANDLERS, *LAST_HANDLERS))
    states.melt_all()
    rigs.forget()
    relations.release()
