"""Computes moments of armatures that Blender has not evaluated, if they can be programs (description/).

A program is read from an armature that is live, and dies with the record: whatever drops a part of that drops it. It
is used once it has computed exactly what Blender shows on a frame. If it ever differs, the armature is recorded
instead."""

import contextlib
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..blender import animation, dependencies, spoken_paths
from ..description import curves, driven_keys, driver_rows, edits, other_data, reading, rna_paths, strips
from ..host import evaluations, poses
from ..native import sinew_native
from . import changes, differences, families, followers, leading, rigs, settings, watch
from .followers import Followers
from .keys import Keys, keys_of
from .rigs import Source


def can_be(rig: rigs.Rig) -> bool:
    """Whether moments of an armature can be computed, as far as is known."""
    return not (rig.trust.is_distrusted or rig.source.refusal)


def prove(rig: rigs.Rig, found: Any, users: Any, scene: Any, graph: Any) -> None:
    """Reads the program of a live armature, which is proven if it computes what Blender shows on the scene's frame.
    found: what follows it, as followers.find returns it; users: as bpy.data.user_map returns them."""
    frame = rigs.whole_frame(scene)
    is_live = not rig.is_played and rigs.evaluated_copy(rig, graph) is not None and rigs.moves(rig.ob)
    if frame is None or not is_live or not can_be(rig) or rig.ob.mode == "EDIT":
        return
    if rig.source.is_proven and rig.at(frame) is not None:
        return
    changes.meet(rig, found if isinstance(found, Followers) else Followers(), users, graph)
    if rig.source.program is None and not read_again(rig, graph):
        read(rig, scene, graph)
    computed, copy = moment(rig, frame), rigs.evaluated_copy(rig, graph)
    if computed is None:
        return
    if rigs.shows(rig, graph, computed) or differences.is_near(rig, copy, frame):
        if rig.source.place:
            families.prove(rig.source.place, graph)
        rig.source.is_proven, rig.trust.is_posable = True, rig.source.is_posable
        rig.motion.computed = frame, computed
        return
    rig.motion.last = None
    if rig.source.is_proven:  # something has changed that was not noticed
        changes.drop_all(rig)
    elif not (
        rigs.is_hidden(rig, graph)
        or unkeyed_path(rig, scene.frame_current_final, 0)
        or followers.unkeyed(rig.ob, scene, rig.source.data.owners, 0)
    ):
        differences.note(rig, differences.Difference.between(rig, copy, frame))


def unkeyed_path(rig: rigs.Rig, frame: float, rounding: float = animation.ROUNDING) -> str:
    """Returns the path of a property of an armature that is not as its keyframes set it, "" if there is none or nothing
    can tell. rounding: as for animation.is_near."""
    program = rig.source.program
    if program is None or not strips.play(rig.ob):
        return animation.unkeyed_path(rig.ob, frame, rounding)
    names = sorted(name for name in set(program.keyed) - set(program.driven) if not other_data.is_of_other(name))
    try:
        keyed = program.values(np.array([frame], np.float32), names)[0].tolist()
        found = zip(names, keyed)
        return next(
            (name for name, value in found if not animation.is_near(rig.ob.path_resolve(name), value, rounding)), ""
        )
    except ValueError:
        return ""


def may_be_unkeyed(block: bpy.types.ID, frame: float) -> bool:
    """Whether any property of a data-block may not be as its keyframes set it. Of what NLA strips set programs alone
    tell."""
    if block.animation_data is None or not animation.plays_strips(block.animation_data):
        return bool(animation.unkeyed_path(block, frame))
    rig = rigs.get(block)
    if rig is None or rig.source.program is None or unkeyed_path(rig, frame):
        return True
    known = {re.sub(r"\[\d+\]$", "", name) for name in rig.source.program.keyed}.union(animation.PLACE)
    own = curves.that_set_anything(block, animation.keyed_curves(block))
    return not known.issuperset(rna_paths.normalised(curve.data_path) for curve in own)


_last, _step = 0.0, 0.0  # the last frame that was shown, and how far it was from the one before


def look_ahead(own: Iterable[rigs.Rig], frame: float) -> None:
    """Has other threads compute the frame after this one, while Blender evaluates and draws this one, if that is as far
    as it was from the one before. What they compute is lost with the program, which dies with each edit."""
    global _last, _step
    step, before = frame - _last, _step
    if step == 0:
        return
    _last, _step = frame, step
    if step == before:
        able = [rig for rig in own if rig.source.is_proven and rig.at(frame + step) is None]
        able = [rig for rig in able if not rig.source.leaders]  # which wait for what others have there
        sinew_native.RigPlayer.begin([rig.source.player for rig in able], frame + step)


def fill(own: Iterable[rigs.Rig], frame: float) -> None:
    """Computes a frame of the armatures that have a proven program."""
    for able in leading.levels(rig for rig in own if rig.source.is_proven):
        lacking = [rig for rig in able if rig.at(frame) is None]
        for rig, found in zip(lacking, _moments(lacking, frame)):
            if found is not None:
                rig.motion.computed = frame, found


def moment(rig: rigs.Rig, frame: float) -> rigs.Moment | None:
    """Returns a moment of an armature with a program. If that fails, returns None, and it has no program any more."""
    return _moments([rig], frame)[0]


def read(rig: rigs.Rig, scene: Any, graph: Any) -> None:
    """Reads the program of an armature, or why there is none."""
    rig.source, rig.motion.tempo = _read(rig, scene, graph), changes.tempo_of(scene)
    rig.trust.is_posable &= rig.source.is_posable
    if rig.source.settings:
        rig.motion.record.clear()  # it was recorded without them


class _Last(NamedTuple):
    """What the last program of an armature was read from."""

    source: Source
    known: edits.Known
    counts: list[int]  # of the shape keys that followed it, see _counts
    keys: Keys | None  # of its own action
    watch: watch.Watch


def _remember(rig: rigs.Rig, read: reading.Reading, source: Source, graph: Any) -> None:
    has_keys = rig.motion.watch is not None and rig.motion.watch.action is not None
    is_compared = has_keys == rigs.has_animation(rig.ob) or strips.play(rig.ob)
    if rig.motion.watch is not None and is_compared and not rig.motion.has_edited_keys:
        known = edits.Known(rig.ob, read, graph, _seen(rig, graph))
        rig.motion.last = _Last(source, known, _counts(rig, graph), rig.motion.keys, rig.motion.watch)


def _counts(rig: rigs.Rig, graph: Any) -> list[int]:
    return [len(numbers) for _keys, numbers in rigs.keyed(rig, graph)]


def _seen(rig: rigs.Rig, graph: Any) -> Any:
    """Returns the object whose custom properties Blender evaluates next. The copy has no property that was set without
    a tag, as by `ob["x"] = 1`, until an edit has Blender copy the original again."""
    copy = rigs.evaluated_copy(rig, graph)
    if copy is None or rig.is_idle and (evaluations.is_tagged(copy) or evaluations.is_tagged(copy.data)):
        return rig.ob
    return copy


def read_again(rig: rigs.Rig, graph: Any) -> bool:
    """Reads of an armature, which may have been edited, what its pose and its keyframes change. Returns whether nothing
    else has changed since its program was read: neither the shape keys that follow it nor what it depends on."""
    last: Any = rig.motion.last
    rig.motion.last = None
    if last is None or rig.motion.tempo != changes.tempo_of(rig.home.scene):
        return False
    action: Any = last.watch.action
    needed = [*last.watch.blocks, *(keys for keys, _numbers in rig.followers.keyed), *([action] if last.keys else [])]
    if not all(map(rigs.is_alive, needed)):
        return False
    if last.counts != _counts(rig, graph):
        return False
    unseen = rigs.unseen_actions(rig, graph)
    new = rig.motion.watch or watch.Watch(rig.ob, last.watch.blocks, action, rig.followers.keyed, graph, unseen)
    keys, numbers = _keys_now(rig, action) if last.keys else None, []
    if keys is not None:
        numbers = last.keys.curves.differing(keys.curves)
        has_same_others = last.keys.others == keys.others and last.keys.settings == keys.settings
        if numbers is None or not has_same_others:
            return False
    if not new.is_like(last.watch):
        return False
    all_curves = animation.action_curves(action) if numbers else []
    try:
        followers.check_place(rig.ob, graph.view_layer)
        edited = [all_curves[number] for number in numbers]
        edit = last.known.edit(rig.ob, graph, edited, _seen(rig, graph))
        if edit is None:
            return False
        player = last.source.player.edited(*edit)
        leaders = leading.leaders_of(rig.ob, last.known.targets, last.known.outside, graph)
    except (ValueError, KeyError, ReferenceError):
        return False
    compared = set() if any(edit) else last.source.compared
    rig.source = replace(
        last.source,
        player=player,
        leaders=leaders,
        data=_data_of(last.known.outside, last.known.from_outside()),
        is_proven=False,
        heads={},
        compared=compared,
        is_compared=False,
    )
    rig.motion.watch, rig.motion.keys, rig.motion.has_edited_keys = new, keys, False
    rig.motion.last = last._replace(source=rig.source, keys=keys, watch=new)
    return True


def _keys_now(rig: rigs.Rig, action: Any) -> Keys:
    """Returns what is stored in an armature's own action. While it is idle, what was without a tag does not count, as
    in Blender."""
    known = rig.motion.keys if rig.is_idle and not rig.motion.has_edited_keys else None
    return keys_of(action) if known is None else known


def differing(own: Iterable[rigs.Rig], graph: Any) -> dict[int, str]:
    """Compares what was read of armatures that are POSED with the bones that Blender has evaluated since, from the
    channels that they have. Returns how those that are others differ, sentences by key."""
    found = {}
    for rig in own:
        copy, time, rig.trust.posed_on = rigs.evaluated_copy(rig, graph), rig.trust.posed_on, None
        if copy is None or time is None or rig.motion.last is None or evaluations.is_tagged(copy):
            continue
        given = dict(rig.motion.last.known.keyed()) | rig.motion.last.known.from_outside()
        given |= {
            each.path: value for each, value in zip(rig.source.settings, settings.read(copy, rig.source.settings))
        }
        given |= zip(_paths_of(rig.source.place), families.numbers_of(rig.source.place, graph))
        difference = differences.Difference.between(rig, copy, time, given)
        if difference.is_any():
            changes.differ(rig)
            found[rig.key] = differences.note(rig, difference)
        elif time == int(time):
            rig.source.compared.add(int(time))
    return found


def _read(rig: rigs.Rig, scene: Any, graph: Any) -> Source:
    keyed, rig.motion.last = rigs.keyed(rig, graph), None
    try:
        old, new = changes.tempo_of(scene)
        if old != new:
            raise curves.Refused(
                f"{scene.name} maps its frames to other times: set Old and New of its Time Stretching alike"
            )
        read = reading.read(rig.ob, graph, keyed, _seen(rig, graph), may_move=True)
        place = families.place_of(rig.ob) if read.targets.moves else ()
        leaders = leading.leaders_of(rig.ob, read.targets, read.outside, graph)
        program = sinew_native.RigProgram(read.description, keep_description=False)
        own, is_posable = settings.of(rig.ob, read.description)
        parts = [
            *driven_keys.paths_of(keyed),
            [setting.path for setting in own],
            _paths_of(place),
            list(read.outside.computed),
        ]
        player = sinew_native.RigPlayer(program, parts, poses.fields())
        moving = [each for each in read.targets.moving.values() if each != rig.ob]
        if moving:  # but not the parents of the armature's object alone
            followed = dependencies.with_parents(dependencies.outside_of(rig.ob))
            moving = [each for each in moving if each in followed]
        keyed_objects = [each.block for each in read.outside.keyed.values() if isinstance(each.block, bpy.types.Object)]
        moving += followers.moving(rig.ob, (*read.targets.splines.values(), *keyed_objects))
        data = _data_of(read.outside, {row["name"]: row["value"] for row in read.description["values"]})
        source = Source(player, tuple(own), place, leaders, tuple(moving), data=data, is_posable=is_posable)
    except ValueError as reason:
        return Source(refusal=_in_words(str(reason)))
    _remember(rig, read, source, graph)
    return source


def _data_of(outside: driver_rows.Outside, numbers: dict[str, Any]) -> rigs.Data:
    """numbers: what comes from outside, by name."""
    owners = [each.block for each in outside.owned.values()]
    return rigs.Data(
        tuple((*outside.read[name], numbers[name]) for name, _owned in outside.of_data()),
        tuple(outside.computed.values()),
        tuple(outside.through),
        tuple(dict.fromkeys(each for each in owners if not isinstance(each, bpy.types.Object))),
    )


def _paths_of(place: families.Place) -> list[str]:
    return [other_data.path_of(ob, f"{path}[{index}]") for ob, channels in place for path, index in channels]


def _in_words(reason: str) -> str:
    """Returns why there is no program for people, who describe no properties."""
    reason = spoken_paths.in_words(reason)
    return reason.replace(
        "which the rig does not have; remove it or describe the property", "which Sinew does not compute: remove that"
    )


def _moments(own: Sequence[rigs.Rig], frame: float) -> list[rigs.Moment | None]:
    """Returns the moment of each armature on a frame; None for those without a program, or that follow one without
    it."""
    able, asked, found = [], [], {}
    for rig in own:
        if rig.source.player is not None:
            with contextlib.suppress(leading.Unknown):
                asked.append((rig.source.player, leading.inputs(rig, [frame])))
                able.append(rig)
    for rig, result in zip(able, sinew_native.RigPlayer.moments(asked, frame)):
        if isinstance(result, str):
            rig.source = Source(refusal=result)
        else:
            record, *keys, own_settings, place, data = result
            found[rig.key] = rigs.Moment(record, tuple(keys), own_settings, place, data)
    return [found.get(rig.key) for rig in own]
