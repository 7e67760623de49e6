"""Records armatures while they play, and drops the records of those that are edited."""

from collections.abc import Iterable, Sequence
from typing import Any

from ..blender import dependencies, values
from ..description import edits
from ..host import evaluations
from . import differences, followers, rigs, watch
from .followers import Followers
from .keys import keys_of

MOST_TO_SKIP = 63  # frames, of an armature that somebody edits on each


def look(own: Iterable[rigs.Rig], graph: Any, looks_at_copies: bool = True) -> list[rigs.Rig]:
    """Drops the records of the armatures of a graph on which anything but time has had an effect. Returns those. Looks
    at all before anything is marked again. Edited keyframes are only noted. looks_at_copies: otherwise only keyframes
    are looked at; what was copied until now, the last evaluation's handlers have seen."""
    edited = []
    for rig in own:
        if rig.motion.watch is not None:
            rig.motion.has_edited_keys |= rig.motion.watch.are_keys_edited(graph)
            if looks_at_copies and not rig.motion.watch.holds(graph):
                edited.append(rig)
    for rig in edited:
        drop_all(rig)
    return edited


def look_at_actions(own: Iterable[rigs.Rig]) -> None:
    """Notes which actions of idle armatures were edited since the last evaluation, before one. Takes off the tags that
    tell: Blender does so only with those of what its graphs have, and these have no such action."""
    noted = []
    for rig in own:
        graph = rig.graph()
        for action in rigs.unseen_actions(rig, graph) if graph is not None else ():
            if evaluations.is_tagged(action):
                noted.append(action)
                rig.noticed.asks_for_keys |= action in rig.noticed.actions and evaluations.is_animation_tagged(action)
                rig.motion.has_edited_keys |= rig.motion.watch is None or rig.motion.watch.note_edited(action)
    for action in noted:
        evaluations.take_tags_off(action)


def expect_no_more(own: Iterable[rigs.Rig], graph: Any) -> None:
    """Called before an evaluation: what was expected of one without handlers, which is over, is expected no more."""
    if watch.has_happened(graph):
        for rig in own:
            if rig.motion.watch is not None:
                rig.motion.watch.mark_expected(graph)
        watch.expect_no_more(graph)


def compare_keys(rig: rigs.Rig, graph: Any) -> None:
    """Drops the record of an armature whose keyframes are not those that it was made with."""
    if rig.motion.watch is None or not rig.motion.has_edited_keys:
        return
    rig.motion.has_edited_keys = False
    try:
        found = keys_of(rig.motion.watch.action)
    except ReferenceError:
        return drop_all(rig)
    is_like, rig.motion.keys = found.is_like(rig.motion.keys), found
    rig.motion.watch.mark_keys(graph)
    if not is_like:
        drop(rig)


def record(own: Iterable[rigs.Rig], scene: Any, graph: Any) -> None:
    """Records live armatures that a change of the frame has just evaluated."""
    able = [rig for rig in own if can_record(rig, scene, graph)]
    for rig in own:
        rig.motion.to_skip = max(rig.motion.to_skip - 1, 0)
    own = able
    frame: Any = rigs.whole_frame(scene)
    for rig in own:
        compare_keys(rig, graph)
        moment, copy = rigs.now(rig, scene), rigs.evaluated_copy(rig, graph)
        is_right = moment is None or rigs.shows(rig, graph, moment) or differences.is_near(rig, copy, frame)
        if rig.motion.tempo != tempo_of(scene) or not is_right:
            drop_all(rig)
    begin([rig for rig in own if rig.motion.watch is None], scene, graph)
    for rig in own:
        if frame not in rig.motion.record:
            rig.motion.record.put(frame, rigs.moment_of(rig, graph))
        if len(rig.motion.record) > 2:
            rig.motion.restless = 0


def can_record(rig: rigs.Rig, scene: Any, graph: Any) -> bool:
    """Whether the scene's frame of an armature can be recorded."""
    is_there = rigs.evaluated_copy(rig, graph) is not None and rigs.whole_frame(scene) is not None
    return (
        is_there
        and rig.is_recorded
        and rig.motion.to_skip == 0
        and rig.ob.mode != "EDIT"
        and rigs.has_animation(rig.ob)
    )


def begin(own: Sequence[rigs.Rig], scene: Any, graph: Any) -> None:
    """Watches what these armatures, which have no record, depend on, and finds what follows them."""
    if not own:
        return
    users = dependencies.Users.now()
    found = followers.find([rig.ob for rig in own], users, graph)
    for rig in own:
        each = found[rig.ob]
        meet(rig, each if isinstance(each, Followers) else Followers(), users, graph)
        rig.motion.tempo = tempo_of(scene)


def meet(rig: rigs.Rig, found: Followers, users: Any, graph: Any) -> None:
    """Takes note of what follows an armature now. If it has no record, watches what it depends on from now on."""
    following = [(values.key_of(keys), numbers) for keys, numbers in found.keyed]
    if rig.motion.watch is not None and rig.motion.watch.follow != following:
        drop_all(rig)
    rig.followers = found
    if rig.motion.watch is None:
        follow = [keys for keys, _numbers in found.keyed]
        chain = dependencies.chain(rig.ob)
        shapes = {bone.custom_shape for each in chain for bone in each.pose.bones}
        # What these have is compared, see rigs.known_data: they use all else.
        lists = [
            each for own in chain for each in dependencies.data_read_by(own) if isinstance(each, dependencies.LISTS)
        ]
        played = [each.action for each in dependencies.actions_of_lists(lists)]
        shapes -= {target for each in chain for target in dependencies.outside_of(each)}
        action = watch.own_action(rig.ob)
        used = dependencies.used(
            [rig.ob, *follow, *played], users, {*shapes, *lists}, [*chain, *(each.data for each in chain)]
        )
        rig.motion.watch = watch.Watch(rig.ob, used, action, found.keyed, graph, rigs.unseen_actions(rig, graph))
        rig.motion.keys = keys_of(action) if action is not None else None
        rig.motion.has_edited_keys = False


def tempo_of(scene: Any) -> tuple[int, int]:
    """Returns how a scene maps its frames to times."""
    return scene.render.frame_map_old, scene.render.frame_map_new


def drop_all(rig: rigs.Rig) -> None:
    """Drops the whole record of an armature. If it was short, the next frames are not recorded: somebody edits it
    again on each."""
    if rig.motion.watch is not None and 0 < len(rig.motion.record) <= 2:
        rig.motion.to_skip, rig.motion.restless = rig.motion.restless, min(2 * rig.motion.restless + 1, MOST_TO_SKIP)
    for each in drop(rig):
        each.motion.watch = None


def differ(rig: rigs.Rig) -> None:
    """Drops an armature whose program has computed something else than Blender. If it is the second time, it is not
    computed any more until it has other settings."""
    rig.trust.is_distrusted, rig.trust.has_differed = rig.trust.has_differed, True
    rig.trust.distrusted = edits.settings_of(rig.ob) if rig.trust.is_distrusted else None
    rig.trust.is_posable = rig.trust.is_posable and not rig.trust.is_distrusted
    drop_all(rig)


def trust_again(rig: rigs.Rig) -> None:
    """Lets an armature be computed that has been given other settings than it had when its program differed."""
    if rig.trust.is_distrusted and rig.trust.distrusted is not None:
        found = edits.settings_of(rig.ob)
        rig.trust.is_distrusted = found is None or found == rig.trust.distrusted


def trust(rig: rigs.Rig) -> None:
    """Lets an armature be computed again whose program has differed from Blender."""
    rig.trust.is_distrusted = rig.trust.has_differed = False
    rig.trust.difference, rig.trust.distrusted, rig.reason = None, None, ""
    rig.try_at_once()


def drop(rig: rigs.Rig) -> list[rigs.Rig]:
    """Drops what is recorded and computed of an armature, and of those whose bones follow it. Returns them."""
    reached = [rig]
    for each in reached:
        each.motion.record.clear()
        each.source, each.motion.computed, each.trust.difference = rigs.Source(), None, None
        reached += [
            other
            for other in rigs.known()
            if other not in reached and other.motion.watch is not None and each.key in other.motion.watch.keys
        ]
    return reached
