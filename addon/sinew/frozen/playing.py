"""Plays the records of frozen armatures before each evaluation, and checks the result after it."""

import threading
from typing import Any

from ..host import evaluations
from . import changes, freezing, rigs, stored_keys


def _is_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


def is_busy() -> bool:
    """Whether handlers should do nothing: this module has Blender evaluate, or the call is not from the main thread."""
    return freezing.is_building() or not _is_main_thread()


def before_evaluation(scene: Any) -> None:
    """Writes the recorded poses of the scene's frame, or thaws what cannot be shown from its record."""
    if is_busy() or not rigs.has_any():
        return
    graphs = {layer.as_pointer(): layer.depsgraph for layer in scene.view_layers if layer.depsgraph is not None}
    are_keys_edited = any(graph.id_type_updated("ACTION") for graph in graphs.values())
    for rig in rigs.known():
        if any(rigs.is_tagged(rig, graph) for graph in graphs.values()):
            rig.is_suspect = True
        if are_keys_edited and rig.curves is not None:
            changes.compare_keys(rig)
        if rig.last is not None and not rig.is_frozen and not rig.is_suspect:
            _check_unchanged(rig, graphs.get(rig.last_layer))
        rig.last = None
        own = next((graph for graph in graphs.values() if rigs.evaluated_copy(rig, graph) is not None), None)
        if rig.curves is None and own is not None:
            changes.meet(rig, own)
        rig.shapes.ask(rigs.whole_frame(scene))
    for graph in graphs.values():
        _play(scene, graph)


def _was_evaluated(rig: rigs.Rig, graph: Any) -> bool:
    """Whether the evaluation whose handlers run has evaluated anything of an armature or of the keys that follow it."""
    return rigs.is_tagged(rig, graph) or any(
        evaluations.is_tagged(keys.evaluated_get(graph)) for keys, _numbers in rigs.keyed(rig, graph)
    )


def _check_unchanged(rig: rigs.Rig, graph: Any) -> None:
    """Drops the record if the last frame that it shows is not what its evaluation has ended with: a handler of another
    add-on has moved bones after it was recorded."""
    evaluated = rigs.evaluated_copy(rig, graph)
    if evaluated is not None and not rigs.shows(rig, graph, rig.last):
        changes.drop(rig, [stored_keys.ALL])
        rig.reason = f"{rig.name} is moved by another add-on after each frame, which cannot be recorded"


def _play(scene: Any, graph: Any) -> None:
    own = [rig for rig in rigs.frozen() if rig.graph() == graph]
    if not own:
        return
    frame, reasons = rigs.whole_frame(scene), {}
    for rig in own:
        if not rigs.is_intact(rig, graph) or rigs.is_tagged(rig, graph):
            reasons[rig.key] = f"{rig.name} was edited"
        elif frame is None or frame not in rig.record:
            reasons[rig.key] = f"frame {scene.frame_current_final:g} of {rig.name} is not recorded: it is live there"
    if frame is not None and not reasons:
        for rig in _play_frame(own, graph, frame):
            reasons[rig.key] = f"something besides its keyframes moves the bones of {rig.name}"
            changes.drop(rig, [stored_keys.ALL])
    if reasons:
        freezing.melt(graph, reasons)


def _play_frame(own: list[rigs.Rig], graph: Any, frame: int) -> list[rigs.Rig]:
    """Shows a recorded frame of frozen armatures. Returns those whose bones are not as they were left."""
    lacking = [rig for rig in own if rig.shown == frame and not rigs.shows(rig, graph, rig.pose)]
    steps = [(rig, rig.record.at(frame)) for rig in own if rig.shown != frame]
    for (rig, moment), is_shown in zip(steps, rigs.show_next(graph, steps)):
        if is_shown:
            rig.shown, rig.pose = frame, moment
            _tag_followers(rig)
        else:
            lacking.append(rig)
    return lacking


def _tag_followers(rig: rigs.Rig) -> None:
    for ob in rig.followers.placed:
        if rigs.is_alive(ob):
            ob.update_tag(refresh={"OBJECT"})
    for ob in rig.followers.shaped:
        if rigs.is_alive(ob):
            ob.update_tag(refresh={"DATA"})


def after_evaluation(scene: Any, graph: Any, is_new_frame: bool) -> None:
    """Checks what an evaluation has made of frozen armatures, and records those that are live."""
    if is_busy() or not rigs.has_any() or graph != graph.view_layer.depsgraph:
        return
    own = [rig for rig in rigs.frozen() if rig.graph() == graph]
    frame = rigs.whole_frame(scene)
    reasons = {}
    for rig in own:
        if not rigs.is_intact(rig, graph):
            reasons[rig.key] = ""
        elif rig.shown != frame or _was_evaluated(rig, graph) and not rigs.shows(rig, graph, rig.pose):
            reasons[rig.key] = f"something besides its keyframes moves the bones of {rig.name}"
            changes.drop(rig, [stored_keys.ALL])
    if reasons:
        freezing.melt(graph, reasons)
    freezing.select(graph)
    if reasons:
        return
    for rig in rigs.known():
        if rig.is_frozen and rig.graph() == graph and frame is not None:
            rig.shapes.note(frame, graph)
        elif is_new_frame and not rig.is_frozen:
            changes.record_frame(rig, scene, graph)
        elif not rig.is_frozen:
            rig.shapes.drop_edited()
