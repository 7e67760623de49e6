"""Compares Sinew with Blender's own Armature modifier: the same frames of the open scene and of a copy of it,
alternately, because a machine's speed drifts."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..blender import meshes
from ..clips import clip_store
from ..install import bind
from ..main import handlers
from ..main.whole_frames import frame_times
from ..plan import bindable, survey, ways
from ..rig_files import clip_keyframes
from ..run import characters

BLOCK = 10  # consecutive frames that are played with one of the two before the other's turn
STAGES = ("pose", "skin")
NUMBER_PROPERTY = "sinew_bench"  # identifies the mesh that an object is a copy of


@dataclass
class Contest:
    """Two scenes with the same characters."""

    scenes: tuple  # the one deformed by Sinew, the one deformed by Blender's modifiers
    layer: str  # name of the active view layer, the same in both
    pairs: list  # (mesh that Sinew deforms, its copy)
    skipped: dict  # {name: why Sinew does not deform it}; Blender's modifiers do that in both scenes
    frames: list


def deformed_meshes(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Returns the meshes that Sinew or an Armature modifier deforms, or that Sinew could deform without an armature."""
    return [
        ob
        for ob in objects
        if ob.type == "MESH"
        and (
            ob.sinew.is_bound
            or any(modifier.type == "ARMATURE" for modifier in ob.modifiers)
            or not ways.why_idle(survey.if_bound(ob))
        )
    ]


def set_up(output: str, frame_count: int) -> Contest:
    """Copies the scene, then binds its visible meshes; the open file stays changed. Returns a
    Contest, or raises ValueError if Sinew can deform none of the meshes."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    meshes = [ob for ob in deformed_meshes(layer.objects) if ob.visible_get()]
    if not meshes:
        raise ValueError("no visible mesh is one that Sinew deforms or could deform: show one")
    linked = [ob for ob in meshes if ob.library]
    skipped = {ob.name_full: f"{ob.name} is linked from another file: make a library override of it" for ob in linked}
    sources = {ob: release(ob) for ob in meshes if ob not in linked}
    copied_scene, copies = copy_scene(list(sources))
    pairs = []
    for (ob, source), copy in zip(sources.items(), copies):
        try:
            bind.bind(ob, bindable.armature_to_bind(ob), output, source=source)
            pairs.append((ob, copy))
        except bindable.BindingError as error:
            skipped[ob.name_full] = str(error)
    if not pairs:
        raise ValueError("; ".join(skipped.values()))
    length = scene.frame_end - scene.frame_start + 1
    frames = [scene.frame_start + i % length for i in range(frame_count)]
    for armature in {bindable.find_armature(copy) for ob, copy in pairs if ob.sinew.source == "CLIP"}:
        if clip_store.has_poses(armature.data):
            clip_keyframes.insert(copied_scene, armature, min(frames), max(frames))
    return Contest((scene, copied_scene), layer.name, pairs, skipped, frames)


def release(ob: bpy.types.Object) -> str:
    """Unbinds the mesh if it is bound, and keeps its Armature modifiers. Returns the source of its pose."""
    settings = ob.sinew
    if not settings.is_bound:
        return "ARMATURE"
    source = settings.source
    settings.has_added_modifier = False  # so that unbinding keeps it
    bind.unbind(ob)
    return source


def copy_scene(meshes: Sequence[bpy.types.Object]) -> tuple[bpy.types.Scene, list[bpy.types.Object]]:
    """Copies the open scene with its objects, meshes and armatures. Returns the new scene, and the copy of
    each of these mesh objects."""
    window, scene = bpy.context.window, bpy.context.scene
    for number, ob in enumerate(meshes):
        ob[NUMBER_PROPERTY] = number
    bpy.ops.scene.new(type="FULL_COPY")
    copied_scene = bpy.context.scene
    window.scene = scene
    by_number = {ob[NUMBER_PROPERTY]: ob for ob in copied_scene.objects if NUMBER_PROPERTY in ob}
    copies = [by_number[number] for number in range(len(meshes))]
    for ob, copy in zip(meshes, copies):
        if copy.data == ob.data:  # possible, depending on the preferences for duplication
            copy.data = ob.data.copy()
    return copied_scene, copies


def set_method(contest: Contest, method: str) -> None:
    """Sets the skinning method in both scenes."""
    for pair in contest.pairs:
        for ob in pair:
            ob.sinew.own_method = ""
            for modifier in ob.modifiers:
                if modifier.type == "ARMATURE":
                    modifier.use_deform_preserve_volume = method == "DUAL_QUATERNION"


def measure(contest: Contest) -> dict[str, float]:
    """Returns {name: milliseconds, median over the frames}: `sinew` and `modifier` are whole calls of
    scene.frame_set, the stages are Sinew's own, summed over all meshes. Raises ValueError if a mesh cannot be
    deformed."""
    entries = [characters.of(ob) for ob, _ in contest.pairs]
    ours, theirs = [], []
    for start in range(0, len(contest.frames), BLOCK):
        block = contest.frames[start : start + BLOCK]
        ours += play(contest.scenes[0], block, entries)
        theirs += play_without_sinew(contest.scenes[1], block)
    for entry in entries:
        if entry.status.error:
            raise ValueError(f"{entry.name[0]} is not deformed: {entry.status.error}")
    sinew, *stages = np.median(ours, axis=0).tolist()
    return {"sinew": sinew, "modifier": float(np.median(theirs)), **dict(zip(STAGES, stages))}


def play(scene: bpy.types.Scene, frames: Sequence[int], entries: Sequence[Any] = ()) -> list[list[float]]:
    """Plays the frames after one warm-up frame. Returns a row of milliseconds per frame: the whole call of frame_set,
    and, if there are entries, the stages."""
    bpy.context.window.scene = scene
    rows = []
    for milliseconds in frame_times(scene, frames):
        row = [milliseconds]
        if entries:
            row += [sum(getattr(entry.status.timings.last, stage) for entry in entries) for stage in STAGES]
        rows.append(row)
    return rows


def play_without_sinew(scene: bpy.types.Scene, frames: Sequence[int]) -> list[list[float]]:
    """Plays without Sinew's handlers. They have nothing to do in the copied scene, but checking that takes time."""
    handlers.unregister_frame_handlers()
    try:
        return play(scene, frames)
    finally:
        handlers.register_frame_handlers()


def compare(contest: Contest) -> tuple[float, float]:
    """Returns (distance, motion) in the objects' space: the largest distance, over all frames, of a vertex from the
    same vertex of the copy, and from its own position on the first frame."""
    distance = motion = 0.0
    first = None
    for frame in contest.frames:
        for scene in contest.scenes:
            scene.frame_set(frame)
        ours, theirs = (
            [shape(ob, scene.view_layers[contest.layer].depsgraph) for ob in objects]
            for scene, objects in zip(contest.scenes, zip(*contest.pairs))
        )
        first = first or ours
        distance = max(distance, *map(farthest, ours, theirs))
        motion = max(motion, *map(farthest, ours, first))
    return distance, motion


def shape(ob: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> np.ndarray:
    """Returns (V, 3): the evaluated positions."""
    return meshes.read_positions(ob.evaluated_get(depsgraph).data)


def farthest(positions: np.ndarray, others: np.ndarray) -> float:
    return float(np.linalg.norm(positions - others, axis=1).max(initial=0.0))
