"""Tells whether Blender is evaluating an object, and whether it calls handlers afterwards."""

import ctypes
import sys
import threading
from collections import Counter
from collections.abc import Collection, Iterable
from typing import Any

import bpy

from . import contract

_TRANSFORM, _ANIMATION = 1 << 0, 1 << 2  # Blender's ID_RECALC_TRANSFORM and ID_RECALC_ANIMATION
# Evaluations for which Blender has called the handlers before it, but not those after it, by the thread's identifier.
_announced: Counter[int] = Counter()
_counting = threading.Lock()  # held while that changes: a render evaluates in its own thread
_is_playing = False
_has_been_set = False  # the flags of any object


def is_running(ob: Any) -> bool:
    """Whether Blender is evaluating the evaluated object, or is about to: it has been tagged, or a handler runs that
    was called because of an evaluation.

    Blender sets flags for what it evaluates in an object, and clears them afterwards. True as long as they have never
    been seen set, because then they do not have this meaning.
    """
    global _has_been_set
    if contract.is_broken():
        return True
    if ctypes.c_uint32.from_address(ob.as_pointer() + contract.offset("ID", "recalc")).value:
        _has_been_set = True
        return True
    return not _has_been_set


def _tags(block: Any) -> int:
    return ctypes.c_uint32.from_address(contract.region(block, "ID", "recalc")[0]).value


def is_tagged(block: Any) -> bool:
    """Whether anything of an evaluated data-block, or of an original, is tagged to be evaluated."""
    return bool(_tags(block))


def take_tags_off(block: Any) -> None:
    """Takes all tags off an original data-block that no graph evaluates, as Blender does after an evaluation with those
    of what a graph has."""
    ctypes.c_uint32.from_address(contract.region(block, "ID", "recalc")[0]).value = 0


def is_transform_tagged(block: Any) -> bool:
    """Whether the place of an evaluated object is to be evaluated."""
    return bool(_tags(block) & _TRANSFORM)


def is_animation_tagged(block: Any) -> bool:
    """Whether the keyframes of a data-block are to be evaluated again on the frame that is shown. Inserting a keyframe
    does not ask for that."""
    return bool(_tags(block) & _ANIMATION)


def are_new(blocks: Iterable[Any], graph: Any) -> bool:
    """Whether Blender has built a graph's relations with any of these original data-blocks, as with the action of an
    armature that was frozen, and has not evaluated it yet. If relations were built again before that, Blender (4.3)
    would follow addresses in copies that it has not made, and crash."""
    return any(not block.evaluated_get(graph).name for block in blocks)  # as long as there is nothing in the copy


def is_job_running() -> bool:
    """Whether another thread may evaluate: Blender renders, bakes or composites."""
    return any(map(bpy.app.is_job_running, ("RENDER", "RENDER_PREVIEW", "OBJECT_BAKE", "COMPOSITE")))


def announce() -> None:
    """Notes that Blender has called the handlers before an evaluation."""
    with _counting:
        _announced[threading.get_ident()] += 1


def conclude() -> None:
    """Notes that Blender has called the handlers after an evaluation."""
    with _counting:
        if _announced[threading.get_ident()] > 0:
            _announced[threading.get_ident()] -= 1


def others_run(waiting: Collection[int] = ()) -> bool:
    """Whether a thread other than this one evaluates: a render's, or a script's. waiting: identifiers of threads that
    wait for this one meanwhile."""
    with _counting:
        running = {each for each, count in _announced.items() if count > 0} - {threading.get_ident(), *waiting}
    # Blender calls no handlers after an evaluation that was stopped: who has ended evaluates no more.
    return bool(running) and (is_job_running() or not running.isdisjoint(sys._current_frames()))


def note_playing(is_playing: bool) -> None:
    """Notes whether a window plays the scene."""
    global _is_playing
    _is_playing = is_playing


def forget() -> None:
    """Discards what was announced, as after a file was loaded."""
    with _counting:
        _announced.clear()


def ends_in_handlers() -> bool:
    """Whether Blender calls handlers after the evaluation, or another one follows soon, because a window plays the
    scene. It calls none after a second evaluation, which it makes if handlers have tagged something after the first,
    and after the first one of a file."""
    return sum(_announced.values()) > 0 or _is_playing
