"""Tells whether Blender is evaluating an object, whether it calls handlers afterwards, and whether an evaluated
data-block is in a dependency graph for renders or in one for a viewport.

A data-block leads to its graph, whose struct is not in Blender's description. Where the mode is in it is found, and
compared, in a graph that Blender's API shows: it follows the addresses of the graph's scene and view layer."""

import ctypes
import sys
import threading
from collections import Counter
from collections.abc import Collection, Iterable
from typing import Any

import bpy

from . import contract, layout

_TRANSFORM, _ANIMATION = 1 << 0, 1 << 2  # Blender's ID_RECALC_TRANSFORM and ID_RECALC_ANIMATION
# Evaluations for which Blender has called the handlers before it, but not those after it, by the thread's identifier.
_announced: Counter[int] = Counter()
_counting = threading.Lock()  # held while that changes: a render evaluates in its own thread
_is_playing = False
_has_been_set = False  # the flags of any object
_MOST_WORDS_OF_RUNTIME = 5  # in which the address of the graph is searched
_MOST_WORDS_OF_GRAPH = 90  # in which its scene is searched; its struct is longer
_MODES = ["VIEWPORT", "RENDER"]  # by their numbers
# The byte offset in a data-block of what leads to its graph, whether that is a pointer, the offset from there, and the
# offset of the mode in the graph. None: not known.
_place: tuple[int, bool, int, int] | None = None
_given_up: list[str] = []  # the mode of the graph in which it was not found


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
    armature that was played, and has not evaluated it yet. If relations were built again before that, Blender (4.3)
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


def is_render(block: Any) -> bool | None:
    """Whether an evaluated data-block belongs to a graph for renders. None: not known."""
    if _place is None or contract.is_broken():
        return None
    graph = _graph_of(block, *_place[:3])
    mode = ctypes.c_int32.from_address(graph + _place[3]).value if graph else -1
    return mode == 1 if mode in {0, 1} else None


def is_mode_known() -> bool:
    """Whether graphs for renders can be told from those for a viewport."""
    return _place is not None


def learn_mode(graph: Any) -> bool:
    """Finds where the mode is, in a graph that has been evaluated. Call it in the main thread. Returns whether it is
    known since this call. If it was known, but is wrong for this graph, it is not used any more."""
    global _place
    if contract.is_broken() or graph.mode not in _MODES:
        return False
    if _place is not None:
        if is_render(graph.scene_eval) is not (graph.mode == "RENDER"):
            _place = None
            _given_up.append(graph.mode)
        return False
    if _given_up or contract.trouble():
        return False
    found = _find(graph)
    if found is None:
        _given_up.append(graph.mode)  # as before 4.0, where no data-block leads to its graph
    _place = found
    return found is not None


def _find(graph: Any) -> tuple[int, bool, int, int] | None:
    mode_at = _find_mode(graph)
    members = layout.structs()["ID"].members
    if mode_at is None or not {"runtime", "*runtime"} & members.keys():
        return None
    is_pointer = "*runtime" in members
    offset, _type, size = members["*runtime" if is_pointer else "runtime"]
    words = _MOST_WORDS_OF_RUNTIME if is_pointer else size // layout.POINTER
    for number in range(words):
        place = offset, is_pointer, number * layout.POINTER
        if _graph_of(graph.scene_eval, *place) == graph.as_pointer():
            return *place, mode_at
    return None


def _graph_of(block: Any, offset: int, is_pointer: bool, from_there: int) -> int:
    start = block.as_pointer() + offset
    if is_pointer:
        start = contract.address_at(start)
    return contract.address_at(start + from_there) if start else 0


def _find_mode(graph: Any) -> int | None:
    """Returns the offset in a graph of its mode: behind the addresses of its scene and view layer."""
    start, wanted = graph.as_pointer(), [graph.scene.as_pointer(), graph.view_layer.as_pointer()]
    for number in range(_MOST_WORDS_OF_GRAPH - 3):
        offset = number * layout.POINTER
        if [contract.address_at(start + offset + each) for each in (0, layout.POINTER)] == wanted:
            mode_at = offset + 2 * layout.POINTER
            mode = ctypes.c_int32.from_address(start + mode_at).value
            return mode_at if mode == _MODES.index(graph.mode) else None
    return None
