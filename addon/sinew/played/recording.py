"""Plays a range of frames once, to record armatures, and finds the armatures that an operation is about."""

from collections.abc import Generator, Iterable
from typing import Any

import bpy

from . import comparing, reasons, rigs, states


def frame_range(scene: bpy.types.Scene) -> tuple[int, int]:
    """Returns the first and the last frame of the preview range if there is one, otherwise of the scene's range."""
    if scene.use_preview_range:
        return scene.frame_preview_start, scene.frame_preview_end
    return scene.frame_start, scene.frame_end


def missing(rig: rigs.Rig, scene: bpy.types.Scene) -> list[int]:
    """Returns the frames of the range that are neither computed nor recorded, or lack the shapes that its onion skins
    need."""
    first, last = frame_range(scene)
    return [frame for frame in range(first, last + 1) if lacks(rig, frame)]


def lacks(rig: rigs.Rig, frame: int) -> bool:
    """Whether a frame is neither computed nor recorded, or lacks the shapes that onion skins need."""
    origin = rig.origin(frame)
    return origin is None or rig.motion.skins is not None and rig.motion.skins.lacks(frame, origin)


def armatures_of(objects: Iterable[Any]) -> list[Any]:
    """Returns the armature objects that move these objects, are instanced by them or are among them, without
    duplicates."""
    found: dict[Any, None] = {}
    for ob in objects:
        if ob.type == "ARMATURE":
            found[ob] = None
        armatures = [modifier.object for modifier in ob.modifiers if modifier.type == "ARMATURE"]
        if ob.instance_collection is not None:
            armatures += ob.instance_collection.all_objects
        if ob.parent_type == "BONE":
            armatures.append(ob.parent)
        found.update(dict.fromkeys(each for each in armatures if each is not None and each.type == "ARMATURE"))
    return list(found)


def animated_armatures(layer: bpy.types.ViewLayer) -> list[Any]:
    """Returns the armature objects of a view layer that have keyframes."""
    return [ob for ob in layer.objects if ob.type == "ARMATURE" and rigs.has_animation(ob)]


def steps(
    scene: bpy.types.Scene, layer: bpy.types.ViewLayer, armatures: Iterable[Any]
) -> Generator[tuple[float, str], None, None]:
    """Plays what is not recorded yet of these armature objects, or lacks only shapes that their onion skins need, as a
    generator that yields (share done, what comes next) and may be closed early. The scene returns to its frame. Those
    with changes that playing would lose are left out."""
    layer.update()  # what was edited just now is dropped from the records
    now, own = rigs.whole_frame(scene), [rigs.learn(each) for each in armatures]
    states.settle(layer.depsgraph)
    for rig in own:
        states.keep_records(rig)
    reasons.prepare(own, scene, layer)
    for rig in own:
        rig.reason = reasons.why_live(rig, scene, layer) if reasons.unkeyed_bone(rig, scene) else ""
    own = [rig for rig in own if not rig.reason]
    for rig in own:
        if rig.source.is_proven and not rig.source.compared and comparing.compare(rig, scene):
            states.keep_played(scene, layer)
    wanted = [rig for rig in own if rig.is_wanted]
    lacking = {rig.key: _to_play(rig, scene, now) for rig in own}
    frames = sorted({frame for each in lacking.values() for frame in each})
    states.hand_back([rig for rig in own if lacking[rig.key] and not rig.source.is_proven], scene, layer)
    frame, subframe = scene.frame_current, scene.frame_subframe
    try:
        for number, each in enumerate(frames):
            yield number / len(frames), f"recording frame {each}"
            scene.frame_set(each)
    finally:
        if frames:
            scene.frame_set(frame, subframe=subframe)
        for rig in wanted:
            states.want(rig)


def _to_play(rig: rigs.Rig, scene: bpy.types.Scene, now: int | None) -> list[int]:
    """Returns the frames that have to be played: none of those that are computed, unless for ghosts."""
    first, last = frame_range(scene)
    frames = [*range(first, last + 1), *([now] if now is not None else ())]
    found = [] if rig.source.is_proven else [frame for frame in frames if frame not in rig.motion.record]
    if rig.motion.skins is not None:
        found += [frame for frame in frames if rig.origin(frame) is not None and lacks(rig, frame)]
    return found
