"""Says why armatures stay Blender's, in sentences, and drops what does not hold of their records before."""

import re
from collections.abc import Iterable
from typing import Any

import bpy

from ..blender import animation, dependencies, spoken_paths, values
from ..clips import clip_store
from ..description import driver_rows, rna_paths
from ..host import relations
from ..run import characters
from . import changes, computing, differences, followers, leading, rigs
from .followers import NotPlayable


def playable(chosen: dict[int, rigs.Rig], scene: Any, layer: Any) -> dict[int, rigs.Rig]:
    """Returns those of these armatures that can be played now, by key. `reason` of the others says why not."""
    needed = look_at_each(chosen.values(), scene, layer)
    lacking = True
    while lacking:  # one follows another, which cannot be played
        lacking = False
        for key, needs in list(needed.items()):
            live = next((each for each in needs if values.key_of(each) not in needed), None)
            if live is not None:
                rig, lacking = chosen[key], True
                rig.reason = f"{rig.name} follows bones of {live.name}, which is Blender's"
                del needed[key]
    return {key: chosen[key] for key in needed}


def look_at_each(own: Iterable[rigs.Rig], scene: Any, layer: Any) -> dict[int, list[Any]]:
    """Returns the other armatures on which each of these depends that can be played beside them, by key. `reason` of
    the others says why not."""
    own = list(own)
    needed = _look_at_each(own, scene, layer)
    live = (rig for rig in own if rig.reason and rig.source.program is not None and not rig.is_idle)
    rounded = [rig for rig in live if _lose_rounding(rig, scene)]
    if rounded:
        layer.update()
        needed |= _look_at_each(rounded, scene, layer)
    return needed


def _lose_rounding(rig: rigs.Rig, scene: Any) -> bool:
    """Has Blender evaluate keyframes again from which an armature, and what it follows, differ by rounding alone, as
    where a drag has moved a channel so little that auto-keying leaves it out. Returns whether there are any."""
    time = scene.frame_current_final
    if computing.unkeyed_path(rig, time) or followers.unkeyed(rig.ob, scene, rig.source.data.owners):
        return False
    found = [rig.ob] if computing.unkeyed_path(rig, time, 0) else []
    found += [each for each in followers.moved_by_keys(rig.ob) if animation.unkeyed_path(each, time, 0)]
    for each in found:
        each.update_tag(refresh={"TIME"})
    return bool(found)


def _look_at_each(own: list[rigs.Rig], scene: Any, layer: Any) -> dict[int, list[Any]]:
    own, users = leading.in_order(own), dependencies.Users.now()
    found = followers.find([rig.ob for rig in own], users, layer.depsgraph)
    changes.look(rigs.at_home(layer.depsgraph), layer.depsgraph)
    for rig in rigs.at_home(layer.depsgraph):  # which these may follow
        if not rig.is_idle:
            changes.compare_keys(rig, layer.depsgraph)
    needed: dict[int, list[Any]] = {}
    for rig in own:
        try:
            needs = check(rig.ob, layer)
            rig.reason = _why_not(rig, found[rig.ob], users, scene, layer)
        except NotPlayable as reason:
            rig.reason = str(reason)
        if not rig.reason:
            needed[rig.key] = needs
    return needed


def _why_not(rig: rigs.Rig, own: Any, users: Any, scene: Any, layer: Any) -> str:
    """Reads the program of a rig if there may be one. Returns why it cannot be played, or "". own: what follows it, as
    followers.find returns it."""
    if isinstance(own, NotPlayable):
        return f"{rig.name} stays Blender's: {own}"
    _drop_what_is_wrong(rig, scene, layer)
    computing.prove(rig, own, users, scene, layer.depsgraph)
    if not (rig.source.is_proven and rig.trust.is_posable):
        # Only those are recorded that have keyframes, and follow nothing that moves by itself, nor other data.
        moving = followers.moving(rig.ob, dependencies.outside_of(rig.ob))
        follows = f"bones of {rig.name} follow {_names(moving)}, outside of it, which may move: " if moving else ""
        if rig.trial.needs_program or moving or not rigs.can_be_recorded(rig.ob):
            return follows + why_not_computed(rig, scene)
        followers.check_place(rig.ob)
    unknown = own.reads.keys() - {each.path for each in rig.source.settings}
    if unknown:
        path = min(unknown)
        return (
            f"the driver of {own.reads[path]} reads {spoken_paths.spoken(path)} of {rig.name}, which is animated and "
            "not recorded: let it read a channel of a bone"
        )
    if rig.ob.mode == "POSE" and not rig.trust.is_posable:
        return being_edited(rig.ob)
    if (unused := _read_alone(rig, users, layer.depsgraph)) is not None:
        return read_alone(rig, unused)
    reason = why_live(rig, scene, layer)
    if reason:
        return reason
    changes.meet(rig, own, users, layer.depsgraph)  # drops the record if other keys follow
    return why_live(rig, scene, layer)


def _read_alone(rig: rigs.Rig, users: Any, graph: Any) -> Any:
    """Returns a data-block with keyframes that a rig reads and that nothing else uses which is shown, so that Blender
    would not evaluate it, or None."""
    data = rig.source.data
    keyed = [each for each in data.owners if data.through and rigs.has_animation(each)]
    keyed = [each for each in keyed if not isinstance(each, dependencies.LISTS)]
    if not keyed:
        return None
    shown = [ob for ob in bpy.data.objects if ob.evaluated_get(graph).is_evaluated]
    armatures = [ob for ob in shown if ob.type == "ARMATURE"]
    roots = [*(ob for ob in shown if ob not in armatures), *(ob.data for ob in armatures), graph.scene.world]
    readers = [*armatures, *(ob.data for ob in armatures)]
    used = set(dependencies.used((each for each in roots if each is not None), users, keyed, readers))
    return next((each for each in keyed if each not in used), None)


def read_alone(rig: rigs.Rig, block: Any) -> str:
    """Returns a sentence for that."""
    return f"{rig.name} reads {block.name}, which has keyframes and is not shown: let something use it that is"


def why_live(rig: rigs.Rig, scene: Any, layer: Any) -> str:
    """Returns why an armature whose record is right cannot be played now, as a sentence; "" if it can."""
    frame = rigs.whole_frame(scene)
    if frame is None:
        return f"{rig.name} is Blender's between two frames: only whole frames are recorded"
    if rigs.evaluated_copy(rig, layer.depsgraph) is None:
        return f"{rig.name} is not in this view layer: switch its collection on"
    if rig.at(frame) is not None:
        return ""
    bone = unkeyed_bone(rig, scene)
    if bone:
        return _unkeyed(rig, bone)
    if rig.motion.restless > 1:
        return f"{rig.name} is edited on each frame: switch off the script or add-on that does it, and press Record"
    return f"frame {frame} of {rig.name} is not recorded: play it, or press Record"


def _unkeyed(rig: rigs.Rig, bone: str) -> str:
    return f'{rig.name} has changes that are not keyed (bone "{bone}"): key them, or change the frame to lose them'


def why_not_computed(rig: rigs.Rig, scene: Any) -> str:
    """Returns why an armature is not played that is only if it can be computed, as a sentence."""
    if rig.source.refusal:
        return rig.source.refusal
    unknown = next((each.rig.name for each in rig.source.leaders if not each.rig.source.is_proven), "")
    if unknown:
        return f"{rig.name} follows bones of {unknown}, which is not native"
    if rig.source.is_proven:
        return (
            f"keyframes of {rig.name} set more than channels of bones, constraints' influence and custom properties: "
            "press Record to have it native until it is selected"
        )
    bone = unkeyed_bone(rig, scene)
    if bone:
        return _unkeyed(rig, bone)
    if rna_paths.moves_object(path := computing.unkeyed_path(rig, scene.frame_current_final)):
        spoken = spoken_paths.spoken(path)
        return (
            f"{rig.name} itself has changes that are not keyed ({spoken}): key them, or change the frame to lose them"
        )
    if followed := followers.unkeyed(rig.ob, scene, rig.source.data.owners):
        return f"{followed}, which {rig.name} follows, has changes that are not keyed: key them"
    graph = rig.graph()
    if graph is not None and rigs.is_hidden(rig, graph):
        return f"{rig.name} is hidden, so Blender may not evaluate all of its bones: show it"
    if rig.trust.difference is not None:
        return rig.trust.difference.sentence(rig.ob)
    return f"the pose of {rig.name} is not exactly what was computed: change the frame to have it compared again"


def being_edited(rig: Any) -> str:
    return f"{rig.name} is being edited: go back to Object Mode first"


def _drop_what_is_wrong(rig: rigs.Rig, scene: Any, layer: Any) -> None:
    """Drops what of the record of an armature does not hold in a view layer, in which it is played from now on."""
    graph = layer.depsgraph
    if rigs.evaluated_copy(rig, graph) is None or rig.is_played and rig.graph() == graph:
        return
    if rig.graph() != graph:
        _move(rig, scene, layer)
    elif rig.motion.watch is not None and rig.motion.tempo != changes.tempo_of(scene):
        changes.drop_all(rig)
    changes.compare_keys(rig, graph)
    moment, copy = rigs.now(rig, scene), rigs.evaluated_copy(rig, graph)
    if moment is None or rigs.shows(rig, graph, moment) or differences.is_near(rig, copy, scene.frame_current):
        return
    changes.drop_all(rig)


def _move(rig: rigs.Rig, scene: Any, layer: Any) -> None:
    """Records and takes over an armature in another view layer from now on. Of the same scene it keeps its record,
    unless something was edited: the pose does not depend on the view layer, as far as this frame shows."""
    before = rig.graph()
    is_kept = rig.motion.watch is not None and before is not None and rig.home.scene == scene
    if is_kept and not changes.look([rig], before) and not rig.motion.watch.is_tagged(before, True):
        changes.compare_keys(rig, before)
    else:
        rig.clear()
    rig.motion.watch = None
    rig.live_in(scene, layer)


def unkeyed_bone(rig: rigs.Rig, scene: Any) -> str:
    """Returns the name of a bone that is not where the keyframes put it, or ""."""
    path = "" if rig.is_played else computing.unkeyed_path(rig, scene.frame_current_final)
    name, separator, _channel = path.removeprefix('pose.bones["').partition('"].')
    return bpy.utils.unescape_identifier(name) if separator else ""


def prepare(own: Iterable[rigs.Rig], scene: Any, layer: Any) -> None:
    """Drops from the records of armatures what was edited, so that it can be played again in a view layer, or
    computed."""
    own, users = leading.in_order(own), dependencies.Users.now()
    found = followers.find([rig.ob for rig in own], users, layer.depsgraph)
    changes.look(rigs.at_home(layer.depsgraph), layer.depsgraph)
    for rig in own:
        rig.motion.restless = rig.motion.to_skip = 0
        _drop_what_is_wrong(rig, scene, layer)
        computing.prove(rig, found[rig.ob], users, scene, layer.depsgraph)


# --- the armature itself --------------------------------------------------------------------------


def check(rig: Any, layer: Any) -> list[Any]:
    """Raises NotPlayable if the pose of an original armature object is not a function of the frame that can be played
    in a view layer, whatever follows it. Returns the other armature objects on which the pose depends."""
    data, outside = rig.animation_data, dependencies.outside_of(rig)
    moving = followers.moving(rig, outside)
    is_keyed = data is not None and (data.action is not None or any(track.strips for track in data.nla_tracks))
    if not is_keyed and not rigs.moves(rig):
        raise NotPlayable(f"{rig.name} has no keyframes: key a pose")
    if data is not None and data.use_tweak_mode:
        raise NotPlayable(f"an NLA strip of {rig.name} is being edited: leave its tweak mode first")
    if rig.mode not in ("OBJECT", "POSE") or rig.data.is_editmode:
        raise NotPlayable(being_edited(rig))
    followers.check_place(rig, layer)
    if animation.keyed_curves(rig.data):
        raise NotPlayable(f"the armature {rig.data.name} itself has keyframes, not only its bones: remove those")
    if rig.pose.ik_solver == "ITASC":
        raise NotPlayable(
            f"{rig.name} uses the iTaSC solver, whose result depends on the frames before: choose Standard"
        )
    if clip_store.has_poses(rig.data) and _plays_clip(rig):
        raise NotPlayable(
            f"{rig.name} plays the poses of an imported rig, which costs little: there is nothing to gain"
        )
    for curve in dependencies.drivers_of_both(rig):
        _check_driver(rig, curve)
    for bone in rig.pose.bones:
        timed = next((each for each in dependencies.constraints_of(bone) if each.type in followers.TIMED), None)
        if timed is not None:
            raise NotPlayable(
                f'the constraint "{timed.name}" of the bone "{bone.name}" of {rig.name} is of the type '
                f"{values.choice_name(timed, 'type')}, which Sinew cannot follow: bake it into keyframes"
            )
    followers.check_moving(rig, moving, layer)
    return followers.not_still((each for each in outside if each.type == "ARMATURE"), None)


def _plays_clip(rig: Any) -> bool:
    return any(ob.sinew.armature == rig and ob.sinew.source == "CLIP" for ob in characters.by_clip())


def _check_driver(rig: Any, curve: Any) -> None:
    driver = curve.driver
    if driver.type == "SCRIPTED":
        words = "depsgraph" if _may_be_quiet(rig, curve) else "frame|depsgraph"
        has_word = re.search(rf"\b({words})\b", driver.expression)
        if has_word or not driver_rows.reads_variables_only(driver):
            raise NotPlayable(
                f"the driver of {spoken_paths.spoken(curve.data_path)} of {rig.name} depends on more than its "
                f"variables ({driver.expression}): use these alone"
            )
    if any(variable.type == "CONTEXT_PROP" for variable in driver.variables):
        raise NotPlayable(
            f"the driver of {spoken_paths.spoken(curve.data_path)} of {rig.name} reads what is shown at the moment "
            "(Context Property): let it read the scene itself, as Single Property"
        )


def _may_be_quiet(rig: Any, curve: Any) -> bool:
    """Whether Blender can be kept from evaluating a driver of an armature on each frame. Others may use its data."""
    try:
        return curve.id_data == rig and bool(relations.on_no_frame(curve.driver, -123456.789))
    except ValueError:
        return False


def _names(objects: list[Any]) -> str:
    return followers.listed([each.name for each in objects])
