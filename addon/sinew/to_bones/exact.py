"""Bakes the actions of a control rig to keyframes of plain bones, exactly."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import bpy
import numpy as np

from ..bake.frame_range import FrameRange
from ..blender import bounds, weight_writing
from ..blender.selection import select
from ..feedback import long_work
from ..install import bind
from ..plan import bindable
from ..rig_files import rig_export, rig_import
from . import conversion, game_skeleton, reduction, rig_actions, writing
from . import joints as joint_motions
from .exact_report import Baked, ExactReport
from .joints import Keys
from .rig_poses import Poses

COMPUTING = 0.7  # the share of it in the progress; the rest is writing
SHEARS = 1e-6  # of the rig's size: what is off by more is named
SCALES = 1e-6


@dataclass(frozen=True)
class ExactSettings:
    """What is baked, and to what."""

    frames: FrameRange  # of the scene, if no actions are baked; else its step counts
    actions: str = ""  # a pattern such as "walk*": the rig's actions of these names; "": the scene as it plays
    root: str = ""  # a bone of the rig that all others are below
    root_motion: str = "BONES"  # ROOT: what moves along the ground is the root's; IN_PLACE: and it is left out
    is_flat: bool = False  # no bone but the root has children
    has_segments: bool = False  # a bone for each end of a B-bone's segments
    roots_alone_move: bool = False  # no other bone has a location
    copies_meshes: bool = True
    target: str = ""  # an armature to be updated
    names: Mapping[str, str] = field(default_factory=dict)  # other names for bones
    key_error: float = 0.0  # how far a bone may be off on a frame for fewer keyframes, in Blender's unit


def chosen(context: Any) -> tuple[bpy.types.Object, list[bpy.types.Object]]:
    """Returns the rig to bake, the active armature or that of the selected meshes, and the meshes to copy: the selected
    ones, or else all that it deforms. Raises ValueError."""
    active = context.view_layer.objects.active
    meshes = [ob for ob in context.selected_objects if ob.type == "MESH"]
    is_rig = active is not None and active.type == "ARMATURE" and active.select_get()
    rig = active if is_rig else conversion.common_rig(meshes)
    own = bindable.meshes_of(context, rig)
    return rig, [ob for ob in meshes if ob in own] or own


def run(
    context: Any, rig: bpy.types.Object, meshes: Sequence[bpy.types.Object], settings: ExactSettings
) -> ExactReport:
    """Bakes at once. Returns the report. Raises ValueError, and then nothing has changed."""
    return long_work.finish(steps(context, rig, meshes, settings))


def steps(
    context: Any, rig: bpy.types.Object, meshes: Sequence[bpy.types.Object], settings: ExactSettings
) -> Generator[tuple[float, str], None, ExactReport]:
    """Bakes step by step, in Object Mode: a generator of (share done, what comes next) that returns the report. If it
    is closed early, or raises ValueError, nothing has changed. meshes: those that are copied onto the skeleton."""
    start = perf_counter()
    target = _target(rig, settings)
    has_root = settings.root_motion != "BONES"
    skeleton = game_skeleton.of_rig(
        rig, settings.names, settings.root, settings.has_segments, has_root, settings.is_flat
    )
    own = rig_actions.find(rig, settings.actions) if settings.actions else []
    scene, layer = context.scene, context.view_layer
    frame = scene.frame_current, scene.frame_subframe
    selection = layer.objects.active, list(context.selected_objects)
    created: list[Any] = []
    kept = _kept(target)
    try:
        armature = target
        if armature is None:
            armature = writing.build_armature(context, rig, f"{rig.name}_bones", skeleton.joints, created)
            _place_like(armature, rig)
        made = game_skeleton.joints_of(armature)  # whose rest pose Blender has rounded
        places = game_skeleton.places_in(made, skeleton.joints.names, armature.name)
        roots = (made.parents < 0) | (made.parents == 0) & (has_root or settings.root != "")
        clips, off, largest, why = yield from _keys(context, rig, skeleton, made, places, roots, own, settings)
        written = yield from _write(armature, clips, roots, places, settings, created)
        copies = [] if target else _copy_meshes(context, rig, skeleton, armature, meshes, settings, created)
        _put_into_tracks(armature, written, kept[0][0] if kept and kept[0] else None)
    except BaseException:  # also an interrupt, and closing
        if target is not None:
            _restore(target, kept)
        rig_import.remove(created)
        select(context, *selection)
        raise
    finally:
        scene.frame_set(frame[0], subframe=frame[1])
    select(context, armature, (armature, *copies))
    is_off = off > SHEARS * _size(made)
    return ExactReport(
        armature=armature.name,
        rig=rig.name,
        objects=tuple(ob.name for ob in copies),
        bones=int((places >= 0).sum()),
        actions=tuple(each.baked for each in written),
        sheared={made.names[j]: float(off[j]) for j in np.argsort(-off) if is_off[j]},
        largest=largest,
        kept=_share_kept(clips, _used(clips, roots, places, settings)),
        evaluated=why,
        seconds=perf_counter() - start,
    )


@dataclass(frozen=True)
class _Clip:
    name: str
    source: rig_actions.RigAction | None  # None: the scene
    frames: list[int]
    keys: Keys  # float32
    kept: reduction.Kept | None  # None: all of them


def _keys(context, rig, skeleton, made, places, roots, own, settings):
    """Yields progress, and returns the clips, how far each bone is off with all keyframes (J,), how far any is with
    those that are kept, and why the rig was evaluated. made: the Joints of the armature; places: of each among the
    skeleton's."""
    largest = 0.0
    poses, clips, off = Poses(context, rig, settings.has_segments, own), [], np.zeros(len(made.names))
    may_move = roots.tolist() if settings.roots_alone_move else None
    with ExitStack() as stack:
        play = stack.enter_context(rig_actions.playing_each(rig, own)) if own else None
        for number, each in enumerate(own or [None]):
            frames = each.frames(settings.frames.step) if each else list(settings.frames)
            if play is not None:
                play(each)
            name = each.action.name if each else ""
            part = COMPUTING / max(len(own), 1)
            work = poses.steps(frames, f"computing {name or context.scene.name}", number)
            found = yield from long_work.scaled(work, number * part, (number + 1) * part)
            motions = skeleton.motions(*found)
            if not np.isfinite(motions).all():
                raise ValueError(f"a bone of {rig.name} is not at a finite place (NaN or infinite): mend what moves it")
            if settings.root_motion != "BONES":
                motions = game_skeleton.with_root_motion(motions, skeleton.joints, settings.root_motion == "IN_PLACE")
            motions = game_skeleton.moved_along(motions, places, made.parents)
            keys, played = joint_motions.keys_of(made, motions, frames, may_move)
            far = np.where(places < 0, 0, _off(played, motions, made))
            off, keys, kept = np.maximum(off, far), _as_float32(keys), None
            if settings.key_error > 0:
                kept, played = reduction.reduce(made, keys, np.array(frames), settings.key_error)
                far = np.where(places < 0, 0, _off(played, motions, made))
            largest = max(largest, float(far.max()))
            clips.append(_Clip(name, each, frames, keys, kept))
    return clips, off, largest, poses.why


def _off(played, motions, joints):
    """Returns (J,): how far bones are from their places."""
    return joint_motions.distances(played, motions, joints.rest @ joint_motions.points_of(joints)).max(axis=0)


def _size(joints):
    tails = joints.rest[:, :3, 3] + joints.rest[:, :3, 1] * joints.lengths[:, None]
    return bounds.diagonal(np.concatenate((joints.rest[:, :3, 3], tails)))


def _as_float32(keys):
    return Keys(*(np.asarray(each, np.float32) for each in (keys.locations, keys.rotations, keys.scales)))


# --- writing --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Written:
    name: str  # of the rig's action; "": of the scene
    action: bpy.types.Action
    wanted: str  # its name, if it is free
    baked: Baked


def _used(clips, roots, places, settings):
    """Returns which bones get keyframes of their location, rotation and scale, (J,) bools."""
    keyed = places >= 0
    scaled = np.any([np.abs(clip.keys.scales - 1).max(axis=(0, 2)) > SCALES for clip in clips], axis=0)
    return keyed & roots if settings.roots_alone_move else keyed, keyed, keyed & scaled


def _share_kept(clips, used):
    """Returns the share of the keyframes that is kept."""
    every = left = 0
    for clip in clips:
        own = len(clip.frames) * int(np.sum(used))
        every += own
        left += sum(int(kept[:, bones].sum()) for kept, bones in zip(clip.kept.channels, used)) if clip.kept else own
    return left / every


def _write(armature, clips, roots, places, settings, created):
    """Yields progress, and returns a _Written of each clip."""
    used = _used(clips, roots, places, settings)
    empty = writing.new_action(armature, "empty", used, created)
    found = []
    for number, clip in enumerate(clips):
        yield COMPUTING + (1 - COMPUTING) * number / len(clips), f"writing {clip.name}"
        wanted = f"{clip.name}_bones" if clip.name else f"{armature.name}_clip"
        action = empty.copy()  # which is faster than to make its curves again
        created.append(action)
        action.name = wanted
        writing.insert_keys(action, clip.keys, clip.frames, used, clip.kept.channels if clip.kept else None)
        baked = Baked(clip.name, wanted, clip.frames[0], clip.frames[-1], len(clip.frames))
        found.append(_Written(clip.name, action, wanted, baked))
        if clip.source is not None and clip.source.action.use_frame_range:
            for name in ("use_frame_range", "frame_start", "frame_end", "use_cyclic"):
                setattr(action, name, getattr(clip.source.action, name))
    last = found[-1].action
    rig_actions.assign(armature, last, last.slots[0] if hasattr(last, "slots") else None)
    created.remove(empty)
    bpy.data.actions.remove(empty)
    return found


def _put_into_tracks(armature, written, old):
    """Gives each action of the rig a track of its name. What a skeleton that was there had in its place is removed.
    old: the action that it played."""
    data = armature.animation_data
    replaced = [] if old is None else [old]
    for each in written:
        track = data.nla_tracks.get(each.name) if each.name else None
        if track is not None:
            replaced += [strip.action for strip in track.strips if strip.action is not None]
            data.nla_tracks.remove(track)
        if each.name:
            track = data.nla_tracks.new()
            track.name, track.mute = each.name, True  # or Blender would evaluate all of them on each frame
            strip = track.strips.new(each.name, each.baked.first, each.action)
            if hasattr(strip, "action_slot"):
                strip.action_slot = data.action_slot if each.action == data.action else each.action.slots[0]
    names = {each.wanted for each in written}
    for action in dict.fromkeys(replaced):
        if action.users == 0 and action.name in names:
            bpy.data.actions.remove(action)
    for each in written:
        each.action.name = each.wanted


def _target(rig, settings):
    """Returns the armature that is updated, or None. Raises ValueError."""
    if not settings.target:
        return None
    target = bpy.data.objects.get(settings.target)
    if target is None or target.type != "ARMATURE" or target == rig:
        raise ValueError(f"{settings.target} is no other armature, so it cannot be updated: choose one, or none")
    return target


def _kept(target):
    """Returns what writing changes of an armature that was there."""
    if target is None:
        return None
    data = target.animation_data
    own = (data.action, getattr(data, "action_slot", None)) if data else None
    return own, [bone.rotation_mode for bone in target.pose.bones]


def _restore(target, kept):
    own, modes = kept
    for bone, mode in zip(target.pose.bones, modes):
        bone.rotation_mode = mode
    if own is None:
        target.animation_data_clear()
        return
    rig_actions.assign(target, *own)


def _place_like(armature, rig):
    armature.parent, armature.parent_type, armature.parent_bone = rig.parent, rig.parent_type, rig.parent_bone
    armature.matrix_parent_inverse, armature.rotation_mode = rig.matrix_parent_inverse, rig.rotation_mode
    for name in rig_actions.AT_REST:
        setattr(armature, name, getattr(rig, name))
        if name != "rotation_axis_angle":
            setattr(armature, f"delta_{name}", getattr(rig, f"delta_{name}"))


def _copy_meshes(context, rig, skeleton, armature, meshes, settings, created):
    """Returns copies of meshes, moved by the armature in place of the rig."""
    return [
        _copy_mesh(context, rig, skeleton, armature, ob, settings, created) for ob in meshes if settings.copies_meshes
    ]


def _copy_mesh(context, rig, skeleton, armature, ob, settings, created):
    skin = rig_export.skin_of(context, ob, rig) if settings.has_segments else None
    copy = ob.copy()
    created.append(copy)
    copy.data = ob.data.copy()
    created.append(copy.data)
    writing.link(context, copy, ob)
    if ob.sinew.is_bound:
        bind.unbind(copy)
    copy.name = copy.data.name = f"{ob.name}_baked"
    for modifier in copy.modifiers:
        if modifier.type == "ARMATURE" and modifier.object == rig:
            modifier.object = armature
    if copy.parent == rig and copy.parent_type != "BONE":
        copy.parent = armature
    for group in copy.vertex_groups:
        group.name = settings.names.get(group.name, group.name)
    if skin is not None:
        place = {number: j for j, number in enumerate(skeleton.program_joints(rig))}
        used, groups = np.unique(skin["joints"], return_inverse=True)
        copy.vertex_groups.clear()
        for number in used.tolist():
            copy.vertex_groups.new(name=skeleton.joints.names[place[number]])
        weight_writing.replace(copy, skin["offsets"], groups, skin["weights"])
    return copy
