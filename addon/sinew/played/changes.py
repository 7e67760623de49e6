"""Records armatures while they play, and drops from the records what an edit changes: all, or of keyframes of the
armature's own action those frames on which they matter."""

from collections.abc import Iterable, Sequence
from typing import Any

from ..blender import armatures, dependencies, values
from ..description import edits
from ..host import evaluations
from . import differences, followers, rigs, stored_keys, watch
from .followers import Followers
from .keys import Keys, keys_of

MOST_TO_SKIP = 63  # frames, of an armature that somebody edits on each


def changed(old: Keys, new: Keys) -> list[tuple[float, float]]:
    """Returns the ranges of times, without their ends, on which two states of the same action may differ."""
    numbers = old.curves.differing(new.curves)
    if numbers is None or (old.others, old.settings) != (new.others, new.settings):
        return [stored_keys.ALL]

    def curve(keys: Keys, i: int) -> stored_keys.Curve:
        stored = keys.curves
        is_local = stored.is_local(i)
        return stored_keys.Curve(stored.frames(i), stored.keys(i), is_local, i in keys.flat, (stored.settings(i),))

    return stored_keys.changed({i: curve(old, i) for i in numbers}, {i: curve(new, i) for i in numbers})


def look(own: Iterable[rigs.Rig], graph: Any, looks_at_copies: bool = True) -> list[rigs.Rig]:
    """Drops the records of the armatures of a graph on which anything but time has had an effect. Returns those. Looks
    at all before anything is marked again. Edited keyframes are only noted. looks_at_copies: otherwise only keyframes
    are looked at; what was copied until now, the last evaluation's handlers have seen."""
    edited = []
    for rig in own:
        if rig.watch is not None:
            rig.has_edited_keys |= rig.watch.are_keys_edited(graph)
            if looks_at_copies and not rig.watch.holds(graph):
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
                rig.asks_for_keys |= action in rig.actions and evaluations.is_animation_tagged(action)
                rig.has_edited_keys |= rig.watch is None or rig.watch.note_edited(action)
    for action in noted:
        evaluations.take_tags_off(action)


def expect_no_more(own: Iterable[rigs.Rig], graph: Any) -> None:
    """Called before an evaluation: what was expected of one without handlers, which is over, is expected no more."""
    if watch.has_happened(graph):
        for rig in own:
            if rig.watch is not None:
                rig.watch.mark_expected(graph)
        watch.expect_no_more(graph)


def compare_keys(rig: rigs.Rig, graph: Any) -> None:
    """Drops those frames of a record on which edited keyframes matter."""
    if rig.watch is None or not rig.has_edited_keys:
        return
    rig.has_edited_keys = False
    try:
        found = keys_of(rig.watch.action)
    except ReferenceError:
        return drop_all(rig)
    ranges = changed(rig.keys, found)
    rig.keys = found
    rig.watch.mark_keys(graph)
    drop(rig, [stored_keys.ALL] if ranges and rig.tempo[0] != rig.tempo[1] else ranges)


def record(own: Iterable[rigs.Rig], scene: Any, graph: Any) -> None:
    """Records live armatures that a change of the frame has just evaluated."""
    able = [rig for rig in own if can_record(rig, scene, graph)]
    for rig in own:
        rig.to_skip = max(rig.to_skip - 1, 0)
    own = able
    frame: Any = rigs.whole_frame(scene)
    for rig in own:
        compare_keys(rig, graph)
        moment, copy = rigs.now(rig, scene), rigs.evaluated_copy(rig, graph)
        if rig.tempo != tempo_of(scene):
            drop_all(rig)
        elif moment is None or rigs.shows(rig, graph, moment) or differences.is_near(rig, copy, frame):
            continue
        elif rig.source.is_proven and not rigs.is_hidden(rig, graph):  # something has changed that was not noticed
            rig.has_differed, difference = True, differences.Difference.between(rig, copy, frame)
            differ(rig)
            differences.note(rig, difference)
        else:
            drop_all(rig)
    begin([rig for rig in own if rig.watch is None], scene, graph)
    for rig in own:
        if frame not in rig.record:
            rig.record.put(frame, rigs.moment_of(rig, graph))
        if len(rig.record) > 2:
            rig.restless = 0
        rig.shapes.note(frame, graph)


def can_record(rig: rigs.Rig, scene: Any, graph: Any) -> bool:
    """Whether the scene's frame of an armature can be recorded."""
    is_there = rigs.evaluated_copy(rig, graph) is not None and rigs.whole_frame(scene) is not None
    return is_there and rig.is_recorded and rig.to_skip == 0 and rig.ob.mode != "EDIT" and rigs.has_animation(rig.ob)


def ask_for_shapes(own: Sequence[rigs.Rig], graph: Any) -> None:
    """Finds the meshes of armatures that have no record, and asks for their shapes in the next evaluation."""
    if own:
        for ob, found in followers.find([rig.ob for rig in own], dependencies.Users.now(), graph).items():
            rig: Any = rigs.get(ob)
            follow_shapes(rig, found.hooked if isinstance(found, Followers) else [])
            rig.shapes.ask_in(graph)


def begin(own: Sequence[rigs.Rig], scene: Any, graph: Any) -> None:
    """Watches what these armatures, which have no record, depend on, and finds what follows them."""
    if not own:
        return
    users = dependencies.Users.now()
    found = followers.find([rig.ob for rig in own], users, graph)
    for rig in own:
        each = found[rig.ob]
        meet(rig, each if isinstance(each, Followers) else Followers(), users, graph)
        rig.tempo = tempo_of(scene)


def meet(rig: rigs.Rig, found: Followers, users: Any, graph: Any) -> None:
    """Takes note of what follows an armature now. If it has no record, watches what it depends on from now on."""
    if rig.watch is not None and rig.watch.follow != [(values.key_of(keys), numbers) for keys, numbers in found.keyed]:
        drop_all(rig)
    rig.followers = found
    follow_shapes(rig, found.hooked)
    if rig.watch is None:
        follow = [keys for keys, _numbers in found.keyed]
        chain = dependencies.chain(rig.ob)
        shapes = {bone.custom_shape for each in chain for bone in each.pose.bones}
        shapes -= {target for each in chain for target in dependencies.outside_of(each)}
        action = watch.own_action(rig.ob)
        used = dependencies.used([rig.ob, *follow], users, shapes, chain)
        rig.watch = watch.Watch(rig.ob, used, action, found.keyed, graph, rigs.unseen_actions(rig, graph))
        rig.keys = keys_of(action) if action is not None else None
        rig.has_edited_keys = False


def tempo_of(scene: Any) -> tuple[int, int]:
    """Returns how a scene maps its frames to times."""
    return scene.render.frame_map_old, scene.render.frame_map_new


def follow_shapes(rig: rigs.Rig, hooked: list[Any]) -> None:
    """Records the shapes of the meshes with a hook that follow an armature, except for those that another one moves
    first."""

    def is_first(ob: Any) -> bool:
        return armatures.of_modifiers(ob)[:1] == [rig.ob]

    rig.shapes.follow(ob for ob in hooked if is_first(ob) and not rig.needs_program)


def drop_all(rig: rigs.Rig) -> None:
    """Drops the whole record of an armature. If it was short, the next frames are not recorded: somebody edits it
    again on each."""
    if rig.watch is not None and 0 < len(rig.record) <= 2:
        rig.to_skip, rig.restless = rig.restless, min(2 * rig.restless + 1, MOST_TO_SKIP)
    drop(rig, [stored_keys.ALL])


def differ(rig: rigs.Rig) -> None:
    """Drops an armature whose program has computed something else than Blender. If it is the second time, it is not
    computed any more until it has other settings."""
    rig.is_distrusted, rig.has_differed = rig.has_differed, True
    rig.distrusted = edits.settings_of(rig.ob) if rig.is_distrusted else None
    rig.is_posable = rig.is_posable and not rig.is_distrusted
    drop_all(rig)


def trust_again(rig: rigs.Rig) -> None:
    """Lets an armature be computed that has been given other settings than it had when its program differed."""
    if rig.is_distrusted and rig.distrusted is not None:
        found = edits.settings_of(rig.ob)
        rig.is_distrusted = found is None or found == rig.distrusted


def drop(rig: rigs.Rig, ranges: list[tuple[float, float]]) -> None:
    """Drops frames of an armature, and of those whose bones follow it."""
    if not ranges:
        return
    reached = [rig]
    for each in reached:
        each.record.drop_within(ranges)
        each.shapes.drop_within(ranges)
        each.source, each.passing, each.difference = rigs.Source(), None, None
        reached += [
            other
            for other in rigs.known()
            if other not in reached and other.watch is not None and each.key in other.watch.keys
        ]
        if stored_keys.ALL in ranges:
            each.watch = None
