"""Takes armatures over from Blender and hands them back, each time by one building of Blender's relations. This module
alone sets their states:

    LIVE     Blender evaluates it, and nobody wants Sinew to play it.
    WANTED   Blender evaluates it. It is to be played; `reason` says why it is not.
    PLAYED   Blender does not evaluate it: its relations were built without its keyframes. It plays its record.
    POSED    The same, but it was edited: Blender has evaluated its bones on this frame, from their channels. Only one
             whose frames are computed: before the next frame its program is read again, and it is PLAYED.
    SUSPECT  Relations may still be those of PLAYED, but something is in doubt, so its record is not played. They are
             tagged: Blender builds them anew in its next evaluation, with the keyframes.

    LIVE ------ want, take_over -------> WANTED <--- settle: Blender has evaluated its keyframes ---+
     ^ ^                                  |  |                                                      |
     | +---------- keep_records ----------+  | take_over, take_over_again                           |
     |                                       v                                                      |
     +------------- hand_back ------------ PLAYED -------------- melt: any doubt --------------> SUSPECT
     |                                      |  ^                                                    ^
     |                         pose: edited |  | resume: its program was read                       |
     |                                      v  |                                                    |
     +------------- hand_back ------------- POSED -------------- melt: any doubt -------------------+

`_build` makes all that it changes SUSPECT first. So if it ends by an exception, they are live after the next
evaluation, and nothing of them is wrong."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import bpy

from ..blender import animation, dependencies, values
from ..host import contract, evaluations, features, keyframes, poses, relations
from ..plan import wiring
from ..run import mail
from . import changes, computing, followers, reasons, rigs, watch
from .followers import Followers
from .rigs import State

MOST_ATTEMPTS = 3
_is_building = False  # Blender is evaluating because this module has asked it to
_keeps_live = False


def is_building() -> bool:
    """Whether Blender is evaluating because this module has asked it to."""
    return _is_building


def take_over(wanted: Iterable[rigs.Rig], scene: Any, layer: Any) -> None:
    """Takes armatures over, and keeps those played that already are. `reason` of those that cannot be played says why.
    Call it in the main thread, outside an evaluation. scene, layer: what a window shows."""
    wanted = list(wanted)
    for rig in wanted:
        rig.trial.rest.end()
    try:
        _take_over(wanted, scene, layer)
    except contract.Broken as broken:
        layer.update()
        settle(layer.depsgraph)
        for rig in wanted:
            want(rig)
            rig.reason = str(broken)


def _take_over(wanted: list[rigs.Rig], scene: Any, layer: Any) -> None:
    """Does what take_over says. Raises contract.Broken."""
    if not contract.has(features.PLAYING):
        raise contract.Broken(contract.why_not(features.PLAYING))
    layer.update()
    settle(layer.depsgraph)
    own = {rig.key: rig for rig in (*wanted, *rigs.played()) if rigs.is_alive(rig.ob)}
    for rig in own.values():
        want(rig, rig.trial.needs_program)
    if evaluations.is_job_running():
        for rig in wanted:
            if not rig.is_played:
                rig.reason = f"{rig.name} waits until Blender has rendered or baked"
        return
    for _ in range(MOST_ATTEMPTS):
        chosen = reasons.playable(own, scene, layer)
        _build(list(chosen.values()), scene, layer)
        if all(rig.is_played for rig in chosen.values()):
            return
        layer.update()  # a handler has edited something meanwhile
        settle(layer.depsgraph)
    for rig in chosen.values():
        if not rig.is_played:
            rig.reason = rig.reason or (
                f"{rig.name} is changed after each evaluation: switch off the script or add-on that does it"
            )


def want(rig: rigs.Rig, needs_program: bool = False) -> None:
    """Takes an armature over as soon as it can be. needs_program: only if it can be computed, and nobody has asked for
    more."""
    if rig.state is State.LIVE:
        rig.state = State.WANTED
    elif needs_program and not rig.trial.needs_program:
        return
    rig.trial.needs_program = needs_program


def keep_records(rig: rigs.Rig) -> None:
    """Records an armature from now on, while Blender evaluates it, that may only be native until now."""
    if rig.trial.needs_program:
        rig.trial.needs_program = False
        if rig.state is State.WANTED:
            rig.state = State.LIVE


def hand_back(chosen: Iterable[rigs.Rig], scene: Any, layer: Any) -> None:
    """Hands armatures back to Blender, on this frame, and keeps the others played. Call it in the main thread, outside
    an evaluation."""
    chosen = list(chosen)
    if contract.has(features.PLAYING):
        _build([rig for rig in rigs.played() if rig not in chosen], scene, layer)
    else:
        melt_all()
    for rig in chosen:
        rig.state, rig.reason = State.LIVE, ""


def keep_played(scene: Any, layer: Any) -> None:
    """Builds relations without the keyframes of what is played, where Blender would build them with these in its next
    evaluation. Call it in the main thread, outside an evaluation."""
    _build(rigs.played(), scene, layer)


def keeps_live() -> bool:
    """Whether Blender is to evaluate all armatures, see `all_live`."""
    return _keeps_live


@contextmanager
def all_live(scene: Any, layer: Any) -> Iterator[None]:
    """Has Blender evaluate all armatures inside the `with` block."""
    global _keeps_live
    own, before = rigs.played(), _keeps_live
    if own:
        hand_back(own, scene, layer)
    _keeps_live = True
    try:
        yield
    finally:
        _keeps_live = before
        if own:
            take_over(own, scene, layer)


def _build(chosen: list[rigs.Rig], scene: Any, layer: Any) -> None:
    """Takes exactly these armatures over. All others are evaluated on this frame. While another thread may evaluate,
    which could see originals without their keyframes, all are: they are played again later."""
    chosen = [] if evaluations.is_job_running() else chosen
    graph, before = layer.depsgraph, rigs.idle()
    at_home = rigs.at_home(graph)
    lost = changes.look(at_home, graph)
    chosen = [rig for rig in chosen if rig not in lost and rigs.now(rig, scene) is not None]
    if not chosen and not before:
        return
    for rig in {rig.key: rig for rig in (*before, *chosen)}.values():
        if rig.is_played and rig not in chosen:
            _evaluate_keys(rig)
        rig.state = State.SUSPECT
    try:
        _rebuild(chosen, at_home, layer)
        watch.expect_no_more(graph)  # no handler has seen that evaluation
        moved = [rig for rig in chosen if _settle_played(rig, scene, layer)]
        own = [rig.followers for rig in moved]
        followed = [
            block for each in own for block in (*each.copied, *each.keyframed) if rigs.is_evaluated(block, graph)
        ]
        for block in {block for each in own for block in (*each.objects, *each.keyframed, *each.driven_blocks())}:
            if rigs.is_evaluated(block, graph):
                block.update_tag()
    except BaseException:
        relations.tag()
        raise
    settle(graph)
    if followed:
        watch.expect(graph, followed)
        layer.update()


def _rebuild(chosen: list[rigs.Rig], at_home: list[rigs.Rig], layer: Any) -> None:
    """Has Blender build relations without the keyframes of these armatures, and evaluate. at_home: all that are
    recorded in that view layer."""
    global _is_building
    graph = layer.depsgraph
    hooked = {values.key_of(ob): ob for rig in chosen for ob in rig.followers.hooked}
    idle = {block for rig in chosen for block in (rig.ob, rig.ob.data)}
    driven = [curve for rig in chosen for curve in rig.followers.drivers() if curve.id_data not in idle]
    for rig in chosen:
        played = [each.action for each in keyframes.actions_of(rig.ob)]
        rig.noticed.actions = [each for each in played if each.evaluated_get(graph).is_evaluated] or rig.noticed.actions

    def mark() -> None:
        for rig in at_home:
            if rig.motion.watch is not None:
                rig.motion.watch.mark(graph)

    relations.tag()
    _is_building = True
    try:
        with relations.Rebuilding() as rebuilding:
            for rig in chosen:
                if rigs.has_animation(rig.ob):
                    rebuilding.without_animation(rig.ob)
                for curve in animation.drivers_of(rig.ob):
                    rebuilding.on_no_frame(curve, rigs.time_of(rig.home.scene))
                if rig.source.hangs:
                    rebuilding.without_parent(rig.ob)
                for constraint, targets in followers.constraints_on(rig.ob, rig.source.moving):
                    rebuilding.without_targets(constraint, targets)
                through = rig.source.data.through
                for curve in followers.reading(rig.ob, (*rig.source.moving, *through)):
                    rebuilding.without_read(curve, rig.source.moving, through)
            for ob in hooked.values():
                rebuilding.on_each_frame(followers.hook_of(ob), f"{wiring.CALLS} + 0 * frame")
            for curve in driven:
                rebuilding.on_each_frame(curve)
            rebuilding.build(layer, mark)
    finally:
        _is_building = False
    for rig in chosen:
        if rig.source.hangs:
            relations.hang_again(rig.ob.evaluated_get(graph), rig.ob, graph)
        for constraint, targets in followers.constraints_on(rig.ob, rig.source.moving):
            copy = rig.ob.evaluated_get(graph).path_resolve(constraint.path_from_id())
            relations.follow_again(copy, constraint, targets, graph)
        data = rig.source.data
        for curve in followers.reading(rig.ob, (*rig.source.moving, *data.through)):
            copy = animation.find_driver(curve.id_data.evaluated_get(graph), curve.data_path, curve.array_index)
            if copy is not None:
                relations.read_again(copy, curve, rig.source.moving, data.through, graph)
        rig.noticed.hangs_unseen = rig.source.hangs
        followed = dependencies.with_parents(dependencies.outside_of(rig.ob)) if rig.source.moving else ()
        parents = [ob for ob, _channels in rig.source.place] if rig.source.hangs else ()
        # A scene changes with each selection. What is read of it is compared.
        others = [each for each in (*data.through, *data.owners) if not isinstance(each, dependencies.LISTS)]
        others += [each.action for each in dependencies.actions_of_lists(data.owners)]
        rig.noticed.unseen = [each for each in (*followed, *parents) if each != rig.ob]
        rig.noticed.unseen += others if data.through else []
    for original in [*map(followers.hook_of, hooked.values()), *driven]:
        copy = original.id_data.evaluated_get(graph).animation_data
        found = copy and copy.drivers.find(original.data_path, index=original.array_index)
        if found:
            relations.type_again(found, original)


def _settle_played(rig: rigs.Rig, scene: Any, layer: Any) -> bool:
    """Writes the pose of an armature that was just taken over. Returns whether its bones had another pose, so that what
    follows them has to be evaluated again."""
    graph, pose = layer.depsgraph, rigs.now(rig, scene)
    # Otherwise a handler has changed the frame, or relations.
    can_play = pose is not None and rigs.is_without_keys(rig, graph)
    data = rig.source.data
    unseen = [each for each in (*data.through, *data.owners) if not each.evaluated_get(graph).is_evaluated]
    if data.through and unseen:
        can_play, rig.reason = False, reasons.read_alone(rig, unseen[0])
    # Without a parent that moves, Blender has put it elsewhere.
    is_shown = can_play and not rig.noticed.hangs_unseen and rigs.shows(rig, graph, pose)
    if not can_play or not is_shown and rig.followers.is_simulated:  # what is simulated would have to be tagged
        watch.expect_hand_back(graph, rig)
        relations.tag()
        return False
    rig.noticed.is_selected = not _selected(layer).isdisjoint(rig.followers.keys | {rig.key})
    rig.shown, rig.state = rigs.Shown(rigs.whole_frame(scene), pose), State.PLAYED
    if rig.source.is_proven:
        rig.motion.record.clear()
    rig.noticed.animation, rig.noticed.asks_for_keys = rigs.animation_of(rig.ob), False
    if not is_shown:
        rigs.show(rig, graph, pose)
    return not is_shown


def settle(graph: Any) -> None:
    """Notes which armatures Blender evaluates again."""
    for rig in rigs.known():
        if rig.state is State.SUSPECT and rig.graph() in (graph, None):
            # Relations that were tagged have been built by now, even if no keyframes tell.
            if rigs.follows_only_objects(rig) or not rigs.is_without_keys(rig, graph):
                rig.state = State.WANTED


def pose(rig: rigs.Rig) -> bool:
    """Lets Blender evaluate the bones of a played armature that was edited, from a handler. Returns whether it may: not
    if the edit moves what it follows, such as a curve that its own bones bend, while Blender does not see all of
    that."""
    known = rigs.known_data(rig)
    changes.drop_all(rig)
    if not rig.trust.is_posable or is_moved_unseen(rig, rig.graph()):
        return False
    if any(each in rig.followers.shaped for each in rig.noticed.unseen):
        return False
    rig.noticed.data = known
    rig.state, rig.shown.moment, rig.trust.posed_on = State.POSED, None, None
    return True


def is_moved_unseen(rig: rigs.Rig, graph: Any) -> bool:
    """Whether an edit moves what Blender does not see that the bones follow, or an armature whose parent it does not
    see, which would be elsewhere."""
    copy = rigs.evaluated_copy(rig, graph)
    if rig.noticed.hangs_unseen and (copy is None or evaluations.is_transform_tagged(copy)):
        return True
    return any(watch.may_have_moved(each, graph) for each in rig.noticed.unseen)


def note_posed(rig: rigs.Rig, graph: Any) -> None:
    """Notes whether the evaluation whose handlers run has evaluated the bones of an armature that is POSED."""
    copy = rigs.evaluated_copy(rig, graph)
    if copy is not None and evaluations.is_tagged(copy):
        rig.trust.posed_on = rigs.time_of(rig.home.scene)


def look_at_keys(rig: rigs.Rig, graph: Any, is_new_frame: bool) -> None:
    """Has an armature that is POSED shown from its keyframes, if Blender would evaluate these now."""
    own = [each for each in (rig.ob, *rig.noticed.actions) if rigs.is_alive(each)]
    copies = [each.evaluated_get(graph) for each in own]
    is_asked = any(each.is_evaluated and evaluations.is_animation_tagged(each) for each in copies)
    if is_new_frame or rig.noticed.asks_for_keys or is_asked:
        rig.shown.frame = None


def resume(posed: Iterable[rigs.Rig], graph: Any) -> dict[int, str]:
    """Reads the programs of edited armatures again, from a handler, and has them played. Returns why others cannot be,
    by key."""
    posed = list(posed)
    _drop_edited(posed, graph)
    found = {
        rig.key: f"{rig.name} is edited on each frame: it stays Blender's until it rests"
        for rig in posed
        if rig.source.program is None and not rig.trial.rest.may_read()
    }
    found |= _read_edited([rig for rig in posed if rig.key not in found], graph)
    for rig in posed:
        if rig.key not in found:
            rig.motion.watch.expect_edited(graph)
            rig.source.is_proven = True
            rig.state, rig.shown.frame = State.PLAYED, None
    return found


def read_ahead(rig: rigs.Rig) -> None:
    """Reads the program of an armature that is POSED before another frame needs it. Call it outside an evaluation."""
    graph = rig.graph()
    _drop_edited([rig], graph)
    found = _read_edited([rig], graph)
    if found:
        melt(graph, found)


def _drop_edited(posed: list[rigs.Rig], graph: Any) -> None:
    """Drops the programs of armatures that are POSED and were edited since they were read."""
    for rig in posed:
        changes.compare_keys(rig, graph)
        is_edited = rig.motion.watch is not None and rig.motion.watch.is_tagged(graph, True)
        if is_edited or rig.motion.tempo != changes.tempo_of(rig.home.scene):
            changes.drop_all(rig)
    changes.look(rigs.at_home(graph), graph)  # before what was copied is marked


def _read_edited(posed: list[rigs.Rig], graph: Any) -> dict[int, str]:
    """Reads the programs of those armatures that are POSED and have none, and compares all with what Blender has made
    of the edit. Returns why some have none, by key."""
    unread = [rig for rig in posed if rig.source.program is None]
    found = {rig.key: f"what {rig.name} follows was edited" for rig in unread if _is_behind(rig, graph)}
    unread = [rig for rig in unread if rig.key not in found and not computing.read_again(rig, graph)]
    found |= _read_anew(unread, graph)
    return found | computing.differing([rig for rig in posed if rig.key not in found], graph)


def _read_anew(unread: list[rigs.Rig], graph: Any) -> dict[int, str]:
    """Reads armatures as if they had never been read. Returns why some have no program, by key."""
    found: dict[int, str] = {}
    users = dependencies.Users.now() if unread else dependencies.Users()
    each_followers = followers.find([rig.ob for rig in unread], users, graph)
    for rig in unread:
        own = each_followers[rig.ob]
        try:
            if isinstance(own, followers.NotPlayable):
                raise own
            reasons.check(rig.ob, graph.view_layer)
            changes.meet(rig, own, users, graph)
            computing.read(rig, rig.home.scene, graph)
            if not rig.trust.is_posable:
                raise followers.NotPlayable(rig.source.refusal or f"{rig.name} was edited")
        except followers.NotPlayable as reason:
            found[rig.key] = str(reason)
    return found


def _is_behind(rig: rigs.Rig, graph: Any) -> bool:
    """Whether Blender has yet to evaluate where an armature is, or anything outside of it that is read from evaluated
    copies."""
    copy = rigs.evaluated_copy(rig, graph)
    if copy is None or evaluations.is_transform_tagged(copy):
        return True
    outside = dependencies.outside_of(rig.ob) if rig.motion.last is None else rig.motion.last.known.follows
    return any(not rigs.is_alive(each) or evaluations.is_tagged(each.evaluated_get(graph)) for each in outside)


def select(graph: Any) -> None:
    """Hands back what has been selected since the last look, before anybody can edit it, unless it can be POSED. Call
    it in a handler."""
    selected, reasons = _selected(graph.view_layer), {}
    for rig in rigs.known():
        was, rig.noticed.is_selected = (
            rig.noticed.is_selected,
            rig.key in selected or not selected.isdisjoint(rig.followers.keys),
        )
        if rig.is_played and rig.noticed.is_selected and not was and not rig.trust.is_posable:
            reasons[rig.key] = f"{rig.name} is selected"
    if reasons:
        melt(graph, reasons)


def _selected(layer: Any) -> set[int]:
    return {values.key_of(ob) for ob in layer.objects.selected}


def melt(graph: Any, reasons: dict[int, str]) -> None:
    """Hands all armatures back that are played in a graph, from a handler: Blender evaluates them in the evaluation
    that follows, or once more in the one that has called the handler. reasons: {key of an armature: why}; the others
    may be played again at once."""
    own = [rig for rig in rigs.idle() if rig.graph() in (graph, None)]
    for rig in own:
        rig.reason = reasons.get(rig.key, "")
        if rig.reason:
            rig.motion.last = None
        if rig.is_played or rig.shown.frame is None:
            _evaluate_keys(rig)
        rig.state = State.SUSPECT
        watch.expect_hand_back(graph, rig)
        for ob in rig.followers.hooked:  # Blender calls no handler after it, so nobody updates deformed copies
            if rigs.is_alive(ob) and ob.sinew.installed_output == "MESH":
                mail.post(mail.REWIRE, values.key_of(ob))
    _tag_relations(graph, own)


def _tag_relations(graph: Any, own: Sequence[rigs.Rig]) -> None:
    """Has Blender build the relations of a graph because of these armatures, unless it has just done so, with all
    keyframes."""
    if evaluations.are_new((each.action for rig in own for each in keyframes.actions_of(rig.ob)), graph):
        return
    tagged = relations.tag()
    watch.expect(graph, [tagged, *bpy.data.collections, *bpy.data.scenes])
    watch.wait_for(graph, tagged)


def follow_tracks(scene: Any) -> None:
    """Has Blender build relations if NLA tracks of a scene were muted or are no longer, from a handler before its
    evaluation. Those that it has built while a track was muted, as after handing back, lack its strips (5.2): their
    bones would be evaluated before them."""
    for rig in rigs.known():
        graph = rig.graph()
        if graph is None or graph.scene != scene:
            continue
        before, rig.noticed.tracks = rig.noticed.tracks, rigs.tracks_of(rig.ob)
        if before != rig.noticed.tracks:
            _tag_relations(graph, [rig])


def melt_all() -> None:
    """Hands everything back, as after an error or an undo step, from a handler. Records are kept and checked again."""
    for rig in rigs.known():
        rig.reason = ""
    for graph in rigs.graphs(rigs.idle()):
        melt(graph, {})
    for rig in rigs.idle():  # the view layer is gone
        rig.state = State.SUSPECT
        relations.tag()


def _evaluate_keys(rig: rigs.Rig) -> None:
    """Has Blender evaluate the keyframes of an armature that is handed back. If the originals have the channels of this
    frame, they are left as they are: somebody may just have edited them."""
    is_here = (
        rig.shown.frame is not None
        and rigs.is_alive(rig.home.scene)
        and rig.shown.frame == rigs.time_of(rig.home.scene)
    )
    if not is_here or rig.noticed.asks_for_keys or not rig.trust.is_posable and _has_other_keys(rig.ob):
        rig.ob.update_tag(refresh={"TIME"})


def _has_other_keys(ob: Any) -> bool:
    """Whether keyframes set anything that is not recorded, such as custom properties. They do not move the object."""
    ends = tuple(f'"].{name}' for name in poses.RECORDED)
    return any(
        curve.data_path not in animation.PLACE
        and not (curve.data_path.startswith("pose.") and curve.data_path.endswith(ends))
        or "constraints[" in curve.data_path
        for curve in animation.keyed_curves(ob)
    )


def take_over_again(scene: Any, layer: Any, is_playing: bool = False) -> None:
    """Takes over what is to be played, is not selected, and is computed or recorded on this frame. is_playing: takes
    over only what was handed back because another one was. Call it in the main thread, outside an evaluation."""
    layer.update()  # an edit that Blender has yet to evaluate would count as a difference
    settle(layer.depsgraph)
    waiting = [
        rig
        for rig in rigs.known()
        if rig.state is State.WANTED
        and not rig.trial.rest.left
        and (not rig.noticed.is_selected or rig.trust.is_posable)
        and not (is_playing and (rig.reason or rig.shown.frame is None))
    ]
    # Blender has built relations for something else: nearly always they can be computed as before.
    dropped = [rig for rig in waiting if rig.trial.needs_program and rig.motion.last and rig.source.program is None]
    if dropped:
        reasons.look_at_each(dropped, scene, layer)
    waiting = [
        rig
        for rig in waiting
        if not (rig.trial.needs_program and (rig.trial.tries > 0 or not (rig.source.is_proven and rig.source.compared)))
        and (rigs.now(rig, scene) is not None or not is_playing and computing.can_be(rig))
        and (rig.ob.mode == "OBJECT" or rig.trust.is_posable and rig.ob.mode == "POSE")
    ]
    if waiting:
        take_over(waiting, scene, layer)


def find_again() -> None:
    """Finds all armatures again after an undo step, and hands them back. Blender has replaced what the step has
    changed: a record is kept if all that its pose depends on is still there."""
    rigs.find_again()
    for rig in rigs.known():
        graph = rig.graph()
        if rig.motion.watch is not None and graph is not None and all(map(rigs.is_alive, rig.motion.watch.blocks)):
            watch.expect(graph, rig.motion.watch.blocks)  # Blender copies all armatures again, with or without changes
            rig.motion.watch.action, rig.motion.has_edited_keys = (
                watch.own_action(rig.ob),
                rig.motion.watch.action is not None,
            )
            if rig.motion.has_edited_keys == (rig.motion.watch.action is not None):
                if not rig.trial.needs_program:  # of others nothing is shown before they are computed again
                    changes.compare_keys(rig, graph)
                continue
        changes.drop_all(rig)
        rig.followers = Followers()
    melt_all()
    for rig in rigs.known():
        if rig.stays_live:  # again, since its switch was undone
            rig.state = State.LIVE
