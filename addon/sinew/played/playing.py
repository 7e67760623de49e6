"""Plays the records of played armatures before each evaluation, and checks the result after it."""

from typing import Any

import bpy

from ..blender import dependencies
from ..host import contract, features, poses
from ..run import mail
from . import changes, computing, differences, resting, rigs, states, watch

_evaluations = 0  # that handlers have seen


def count_evaluation() -> None:
    """Counts an evaluation that this package has not asked for, after it."""
    global _evaluations
    _evaluations += not is_busy()


def evaluation_count() -> int:
    """Returns how many evaluations were counted."""
    return _evaluations


def is_busy() -> bool:
    """Whether handlers should do nothing: this package has Blender evaluate, or the call is not from the main
    thread."""
    return states.is_building() or not mail.is_main_thread()


def _has_work() -> bool:
    if not rigs.has_any() or is_busy():
        return False
    if not contract.has(features.PLAYING):  # which may have been found out by something else
        if rigs.idle():
            states.melt_all()
        return False
    return True


def before_evaluation(scene: Any, is_new_frame: bool) -> None:
    """Writes the recorded poses of the scene's frame, or hands back what cannot be shown from its record. What another
    scene shows waits for its own evaluation: if relations were built again before that of a scene which was just made,
    Blender (4.3) would crash, see evaluations.are_new."""
    if not _has_work():
        return
    states.follow_tracks(scene)
    changes.look_at_actions(rigs.idle())
    if watch.is_waiting():
        for graph in rigs.graphs(rigs.known()):
            changes.expect_no_more(rigs.at_home(graph), graph)
    played: dict[int, list[rigs.Rig]] = {}  # by view layer
    for rig in rigs.known():
        if rig.trial.rest.left and rig.graph() is not None:
            rig.trial.rest.note_live(resting.is_edited(rig.ob, rig.graph()), is_new_frame)
        if rig.is_idle:
            played.setdefault(rig.home.layer, []).append(rig)
        elif rig.motion.watch is None and is_new_frame:
            if rig.graph() is None:
                layers = [each for each in scene.view_layers if rigs.evaluated_copy(rig, each.depsgraph) is not None]
                if layers:
                    rig.live_in(scene, bpy.context.view_layer if bpy.context.view_layer in layers else layers[0])
    for own in played.values():
        graph = own[0].graph()
        if graph is None:
            states.melt_all()
        elif graph.scene == scene:
            _play(own, graph, is_new_frame)


def _play(own: list[rigs.Rig], graph: Any, is_new_frame: bool) -> None:
    reasons, everyone = {}, own
    frame = rigs.time_of(own[0].home.scene)
    changes.look(own, graph, is_new_frame or any(rig.shown.frame != frame for rig in own))
    for rig in own:
        if rig.noticed.animation != rigs.animation_of(rig.ob):
            changes.drop_all(rig)
            reasons[rig.key] = f"the animation of {rig.name} was edited"
        elif rig.is_played:
            why = _look(rig, graph, frame, is_new_frame)
            if why:
                reasons[rig.key] = why
        if not rig.is_played:
            if states.is_moved_unseen(rig, graph):
                reasons[rig.key] = f"{rig.name} was edited"
            states.look_at_keys(rig, graph, is_new_frame)
    anew = {rig.ob for rig in own if rig.shown.frame is None}
    posed = [rig for rig in own if not rig.is_played] if anew else []
    reached = dependencies.reaching((rig.ob for rig in posed), dependencies.leaders_of, anew.__contains__)
    for rig in posed:
        if rig.ob in reached:
            rig.shown.frame = None
    own = [rig for rig in own if rig.is_played or rig.shown.frame is None or rig.shown.frame != frame]
    if not reasons:
        posed = [rig for rig in own if not rig.is_played]
        reasons = states.resume(posed, graph) if posed else {}
        computing.fill(own, frame)
    for rig in own:
        if rig.at(frame) is None:
            reasons.setdefault(rig.key, f"frame {frame:g} of {rig.name} is not recorded: it is Blender's there")
        elif rig.followers.is_simulated and not is_new_frame and (rig.shown.moment is None or rig.shown.frame != frame):
            reasons.setdefault(rig.key, "")  # what is simulated would have to be tagged
    if not reasons:
        for rig in _play_frame(own, graph, frame, is_new_frame):
            reasons[rig.key] = _moved_by_others(rig)
        if is_new_frame:
            computing.look_ahead(own, frame)
    if reasons:
        states.melt(graph, reasons)
    for rig in everyone:
        rig.noticed.asks_for_keys = False


def _look(rig: rigs.Rig, graph: Any, frame: float, is_new_frame: bool) -> str:
    """Finds out whether a played armature was edited. Returns why it cannot stay played, or POSED, or ""."""
    rig.motion.has_edited_keys |= rig.motion.watch is not None and rig.motion.watch.are_keys_tagged(graph)
    changes.compare_keys(rig, graph)
    have_keys_changed = rig.trust.is_posable and rig.at(frame) is None and not rig.source.is_proven
    is_edited = rig.motion.watch is None or rig.motion.watch.is_tagged(graph, is_new_frame)
    if have_keys_changed or is_edited or rigs.is_data_edited(rig, graph):
        return "" if states.pose(rig) else f"{rig.name} was edited"
    if rig.motion.tempo != changes.tempo_of(rig.home.scene):
        return f"{rig.home.scene.name} plays at another speed than when {rig.name} was recorded: press Record"
    return ""


def _moved_by_others(rig: rigs.Rig) -> str:
    changes.drop_all(rig)
    return f"something besides its keyframes moves the bones of {rig.name}"


def _play_frame(own: list[rigs.Rig], graph: Any, frame: float, is_new_frame: bool) -> list[rigs.Rig]:
    """Shows a recorded frame of played armatures. Returns those whose bones are not as they were left."""
    shown = [rig for rig in own if rig.shown.frame == frame] if is_new_frame else []
    lacking = [rig for rig, is_left in zip(shown, rigs.are_left(graph, shown)) if not is_left]
    for rig in own:
        if rig.shown.moment is None:  # Blender has evaluated it
            rig.shown.frame, rig.shown.moment = frame, rig.at(frame)
            if not rigs.show(rig, graph, rig.shown.moment):
                lacking.append(rig)
            _tag_followers(rig, graph)
            follow = rig.followers
            watch.expect(graph, follow.keyframed if not is_new_frame else ())
            for block in (*follow.hooked, *follow.keyframed, *follow.driven_blocks()) if not is_new_frame else ():
                if rigs.is_evaluated(block, graph):
                    block.update_tag()
    steps = [(rig, rig.at(frame)) for rig in own if rig.shown.frame != frame]
    for (rig, moment), is_shown in zip(steps, rigs.show_next(graph, steps)):
        if is_shown:
            rig.shown.frame, rig.shown.moment = frame, moment
            rig.trial.rest.note_played()
            _tag_followers(rig, graph)
        else:
            lacking.append(rig)
    return lacking


def _tag_followers(rig: rigs.Rig, graph: Any) -> None:
    for refresh, objects in (("OBJECT", rig.followers.placed), ("DATA", rig.followers.shaped)):
        for ob in objects:
            if rigs.is_evaluated(ob, graph):
                ob.update_tag(refresh={refresh})
    if rig.followers.copied:
        watch.expect(graph, (block for block in rig.followers.copied if rigs.is_evaluated(block, graph)))


def _compare_in(graph: Any, scene: Any) -> None:
    """Compares what is computed of played armatures with what Blender has evaluated in another graph, such as that of a
    render."""
    time, differing = rigs.time_of(scene), []
    for rig in rigs.played():
        home, copy = rig.graph(), rigs.evaluated_copy(rig, graph)
        if (
            copy is None
            or home is None
            or rig.home.scene != scene
            or not rig.source.is_proven
            or rig.motion.watch is None
        ):
            continue
        if rig.motion.watch.may_be_edited(home):
            continue
        moment = rig.at(time) or computing.moment(rig, time)
        if moment is None:
            continue
        is_same = poses.are_posed([(copy, moment.pose)])[0] and rigs.is_placed(rig, graph, moment)
        if is_same or differences.is_near(rig, copy, time):
            rig.source.compared |= {int(time)} if time == int(time) else set()
            continue
        # Something may have been edited so that Blender has not noticed it yet. If it differs again, that is not so.
        differing.append((rig, differences.Difference.between(rig, copy, time)))
        changes.differ(rig)
    reasons = {}
    for rig, difference in differing:  # not before: to drop one may drop others
        reasons[rig.key] = differences.note(rig, difference)
    for home in rigs.graphs(rig for rig, _difference in differing):
        states.melt(home, reasons)


def after_evaluation(scene: Any, graph: Any, is_new_frame: bool) -> None:
    """Checks what an evaluation has made of played armatures, and records those that are live."""
    if not _has_work():
        return
    if graph != graph.view_layer.depsgraph:
        if is_new_frame:
            _compare_in(graph, scene)
        return
    own, frame, reasons = rigs.at_home(graph), rigs.time_of(scene), {}
    for rig in rigs.known():
        if rig not in own and rig.graph() is None and rigs.evaluated_copy(rig, graph) is not None:
            rig.clear()
            rig.live_in(scene, graph.view_layer)
            own.append(rig)
    states.settle(graph)
    for rig in own:
        if rig.is_idle and (
            not rigs.is_without_keys(rig, graph) or is_new_frame and rigs.is_moved_by_objects(rig, graph)
        ):
            # Blender has built relations, and copied it
            reasons[rig.key] = ""
            if rig.trust.is_posable:  # or edited it may be
                changes.drop_all(rig)
            else:
                watch.expect_hand_back(graph, rig)
    changes.look(own, graph)
    watch.expect_no_more(graph)
    for rig in own:
        if rig.is_idle and not rig.is_played:
            states.note_posed(rig, graph)
            if rig.noticed.unseen and not rigs.have(rig.noticed.data, graph):
                reasons.setdefault(rig.key, f"{rig.name} was edited")
        if not rig.is_played or rig.key in reasons:
            continue
        if rig.motion.watch is None:
            if is_new_frame:  # by a handler, before Blender would have evaluated its keyframes: these win
                rig.shown.frame = None
            if is_new_frame or not states.pose(rig):
                reasons[rig.key] = f"{rig.name} was edited"
        elif rig.shown.frame != frame or not rigs.is_left_by(rig, graph):
            reasons[rig.key] = _moved_by_others(rig)
        elif not rigs.have(rigs.known_data(rig), graph):
            changes.drop_all(rig)
            reasons[rig.key] = f"{rig.name} was edited"
        else:
            rig.motion.watch.note(graph)
    if reasons:
        states.melt(graph, reasons)
    states.select(graph)
    if reasons:
        return
    if is_new_frame:
        changes.record([rig for rig in own if not rig.is_idle], scene, graph)
    for rig in own:
        if rig.motion.skins is not None and not rig.is_played:
            changes.compare_keys(rig, graph)
