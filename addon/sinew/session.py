"""The runtime side of bound meshes: native objects made from the .blend, never saved in it.

The .blend holds everything (`properties.py`); what stands here is a cache that is dropped on load
and undo and rebuilt when somebody edits mesh, weights or bones. Blender calls the handlers of a
render from another thread than the interface's, so one lock guards it all. Data-blocks are known
by key and name, not by reference: a reference dies when Blender replaces the block.
"""

import logging
import math
import threading
from dataclasses import dataclass, field
from time import perf_counter

import bpy
import numpy as np

from . import blender_io
from .clip_store import ClipPlayer, has_poses
from .deform import Deformer, transformed
from .influences import Bones, Rules, group_weights, influences
from .outputs import OUTPUTS

log = logging.getLogger("sinew")

# How Blender itself treats scaled bones when it preserves volume.
STRETCH = "frame_each" if bpy.app.version >= (4, 0, 0) else "frame"


@dataclass
class Timings:
    """Milliseconds of the last frame, by stage."""

    pose: float = 0.0
    skin: float = 0.0
    write: float = 0.0

    @property
    def total(self):
        return self.pose + self.skin + self.write


@dataclass
class Character:
    """One bound mesh. `deformer` is None until it is first needed and after an edit."""

    name: str
    deformer: Deformer | None = None
    made_of: tuple = ()  # what the deformer depends on and can change without an edit being seen
    bones: Bones | None = None
    space: bytes | None = None  # from armature to mesh, when the deformer was made
    matrices: np.ndarray | None = None  # (J + 1, 4, 4) float32, what the deformer takes
    timings: Timings = field(default_factory=Timings)
    error: str = ""


_lock = threading.RLock()
_characters = {}  # key of the mesh object -> Character
_players = {}  # key of the armature object -> ClipPlayer
_evaluating = False  # Blender is evaluating at our request: handlers are not for us
_object_count = -1  # of the file when _characters was last gathered; -1: gather again


def forget():
    """Drop everything that is cached, as after load and undo."""
    global _object_count
    with _lock:
        _characters.clear()
        _players.clear()
        _object_count = -1


def forget_object(ob):
    """Drop what is cached of one mesh or armature."""
    global _object_count
    with _lock:
        _characters.pop(blender_io.key_of(ob), None)
        _players.pop(blender_io.key_of(ob), None)
        _object_count = -1


def character(ob):
    """The Character of a bound object, or None."""
    return _characters.get(blender_io.key_of(ob))


def report(ob, message):
    """Show a sentence with the object in the panel, until its next frame succeeds."""
    with _lock:
        bound_objects()
        entry = character(ob)
        if entry:
            entry.error = message
    log.error("%s: %s", ob.name, message)


def bound_objects():
    """All bound mesh objects of the file, whether a scene shows them or not."""
    global _object_count
    objects = bpy.data.objects
    if len(objects) != _object_count:
        _gather()
    found = []
    for key, entry in _characters.items():
        ob = objects.get(entry.name)
        if ob is None or blender_io.key_of(ob) != key:
            _gather()  # renamed or replaced
            return [objects[entry.name] for entry in _characters.values()]
        found.append(ob)
    return found


def _gather():
    global _object_count
    old = dict(_characters)
    _characters.clear()
    for ob in bpy.data.objects:
        if ob.type == "MESH" and ob.sinew.is_bound:
            key = blender_io.key_of(ob)
            _characters[key] = old.get(key) or Character(ob.name)
            _characters[key].name = ob.name
    _object_count = len(bpy.data.objects)


# --- what the handlers call -----------------------------------------------------------------------

def on_frame(scene, depsgraph):
    """A new frame: clips pose their armatures, then every bound mesh takes its shape."""
    with _lock:
        objects = [] if _evaluating else bound_objects()
        if objects:
            _forget_edited(objects, depsgraph)
            _deform(objects, depsgraph, _pose_armatures(objects, scene, depsgraph))


def _forget_edited(objects, depsgraph):
    """Drops what is cached of meshes and armatures that somebody has edited since the last
    evaluation; what Sinew's own handlers write is never among it. Returns the objects concerned."""
    kinds = (bpy.types.Object, bpy.types.Mesh, bpy.types.Armature, bpy.types.Key)
    updates = [update for update in depsgraph.updates if isinstance(update.id, kinds)]
    changed = {blender_io.key_of(update.id) for update in updates}
    edited = {blender_io.key_of(update.id) for update in updates if update.is_updated_shading}
    affected = []
    for ob in objects if changed else ():
        armature = ob.sinew.armature
        blocks = [ob, ob.data] + ([armature, armature.data] if armature else [])
        if changed.isdisjoint(map(blender_io.key_of, blocks)):
            continue
        affected.append(ob)
        # An animated shape key tags its mesh too, but for its geometry alone: the moved shape
        # arrives through the modifier, and weights stay as they are.
        keys = ob.data.shape_keys
        moved_by_keys = keys is not None and blender_io.key_of(keys) in changed
        if blender_io.key_of(ob.data) in (edited if moved_by_keys else changed):
            _characters[blender_io.key_of(ob)].deformer = None
        if armature and blender_io.key_of(armature.data) in changed:
            _drop_player_if_edited(armature)
            _drop_deformer_if_edited(ob, armature)
    return affected


def on_update(depsgraph):
    """Somebody changed something: meshes follow the bones as they stand. A clip does not step in,
    so a bone posed by hand keeps its pose until the next frame, as with keyframes."""
    with _lock:
        objects = [] if _evaluating else bound_objects()
        if not objects:
            return
        affected = _forget_edited(objects, depsgraph)
        if affected:
            _deform(affected, depsgraph, {})


def refresh(ob):
    """A setting of this object or of its armature was changed: show it now."""
    context = bpy.context
    with _lock:
        if not ob.sinew.is_bound:
            return
        armature = ob.sinew.armature
        if armature is not None:
            armature.update_tag()  # else its evaluated copy keeps the setting's old value
        depsgraph = context.evaluated_depsgraph_get()
        objects = [other for other in bound_objects() if other.sinew.armature == armature]
        _deform(objects, depsgraph, _pose_armatures(objects, context.scene, depsgraph))


def refresh_armature(armature):
    """A setting of the armature's clip was changed: show it now."""
    with _lock:
        for ob in bound_objects():
            if ob.sinew.armature == armature:
                return refresh(ob)


def refresh_all():
    """Bring every bound mesh to its armature as it stands, as after load."""
    with _lock:
        objects = bound_objects()
        if objects:
            _deform(objects, bpy.context.evaluated_depsgraph_get(), {})


# --- poses ----------------------------------------------------------------------------------------

def _player(armature):
    key = blender_io.key_of(armature)
    player = _players.get(key)
    if player is None:
        player = _players[key] = ClipPlayer(armature)
    return player


def _drop_player_if_edited(armature):
    """Posing tags the armature's data as well as an edit does; only the latter can change this."""
    player = _players.get(blender_io.key_of(armature))
    if player and player.edited(armature):
        del _players[blender_io.key_of(armature)]


def _drop_deformer_if_edited(ob, armature):
    """The same for what bones say about influences."""
    entry = _characters[blender_io.key_of(ob)]
    if entry.bones is None:
        return
    bones = Bones(**blender_io.read_bones(armature))
    if not bones.same_as(entry.bones):
        _follow_renamed_bones(ob, entry.bones.names, bones.names)
        entry.deformer = None


def _follow_renamed_bones(ob, old, new):
    """Blender renames vertex groups with their bones only where an Armature modifier on that armature
    is at work, which is not so on a bound mesh."""
    if len(old) != len(new):
        return
    renamed = [(a, b) for a, b in zip(old, new) if a != b and a not in new and b not in old]
    for before, after in renamed:
        group = ob.vertex_groups.get(before)
        if group is not None and after not in ob.vertex_groups:
            group.name = after


def clip_time(settings, length, frame, render):
    """Time in poses and whether the clip loops, for the clip's mode at a frame of the scene."""
    if settings.mode == "PLAYBACK":
        return (frame - settings.frame_start) * settings.speed, settings.loop
    if settings.mode == "SWING":
        seconds = (frame - settings.frame_start) * render.fps_base / render.fps
        return abs(math.sin(seconds)) * (length - 1), False
    factor = {"REST": 0.0, "POSED": 1.0}.get(settings.mode, settings.factor)
    return factor * (length - 1), False


def _pose_armatures(objects, scene, depsgraph):
    """Pose each armature that a clip drives. Returns {its key: (channels, milliseconds)}."""
    posed = {}
    for ob in objects:
        armature = ob.sinew.armature
        if ob.sinew.source != "CLIP" or armature is None or not has_poses(armature.data):
            continue
        key = blender_io.key_of(armature)
        evaluated = armature.evaluated_get(depsgraph)
        if key in posed or not evaluated.is_evaluated:  # the latter: of another scene
            continue
        start = perf_counter()
        player = _player(armature)
        settings = evaluated.sinew_clip  # an animated setting is current here alone
        frame = scene.frame_current + scene.frame_subframe
        time, loop = clip_time(settings, player.clip.length, frame, scene.render)
        channels, location, rotation = player.at(time, loop, rest=settings.mode == "REST")
        blender_io.write_pose(armature, location, rotation)
        posed[key] = channels, 1e3 * (perf_counter() - start)
    return posed


# --- shapes ---------------------------------------------------------------------------------------

def _deform(objects, depsgraph, posed):
    """An error in one mesh is kept with it and logged once; the others go on."""
    if _adapt(objects) and depsgraph.mode == "VIEWPORT":
        _evaluate_again(depsgraph)
    for ob in objects:
        entry = _characters[blender_io.key_of(ob)]
        try:
            _deform_one(ob, entry, depsgraph, posed)
            entry.error = ""
        except Exception as error:  # noqa: BLE001 - whatever it is, playback goes on
            _keep_error(ob, entry, error)


def _keep_error(ob, entry, error):
    if str(error) != entry.error:
        log.error("%s is not deformed", ob.name, exc_info=error)
    entry.error = str(error)
    entry.deformer = None


def _adapt(objects):
    """Whether some output had to be changed and has to be evaluated before it is of use."""
    changed = False
    for ob in objects:
        try:
            changed |= OUTPUTS[ob.sinew.installed_output].adapt(ob)
        except Exception as error:  # noqa: BLE001
            _keep_error(ob, _characters[blender_io.key_of(ob)], error)
    return changed


def _evaluate_again(depsgraph):
    """Rare: somebody has given a bound mesh its first shape key, or put a modifier before Sinew's."""
    global _evaluating
    _evaluating = True
    try:
        depsgraph.update()
    finally:
        _evaluating = False


def _deform_one(ob, entry, depsgraph, posed):
    settings = ob.sinew
    armature = settings.armature
    if armature is None:
        raise RuntimeError("Its armature is gone: choose another one, or unbind")
    evaluated = ob.evaluated_get(depsgraph)
    if not evaluated.is_evaluated or ob.data.is_editmode:
        return
    start = perf_counter()
    evaluated_armature = armature.evaluated_get(depsgraph)
    clip_pose = posed.get(blender_io.key_of(armature))
    mesh_from_armature = _between(evaluated, evaluated_armature)
    deformer = _deformer(ob, evaluated, entry, armature, mesh_from_armature)
    if armature.data.pose_position == "REST" or armature.mode == "EDIT":
        entry.matrices[:] = np.eye(4)
    else:
        _read_joints(entry, evaluated_armature, clip_pose)
    pose_end = perf_counter()
    positions = deformer.deform(settings.method, entry.matrices, mesh_from_armature)
    skin_end = perf_counter()
    OUTPUTS[settings.installed_output].write(ob, positions)
    end = perf_counter()
    timings = entry.timings
    timings.pose = 1e3 * (pose_end - start) + (clip_pose[1] if clip_pose else 0.0)
    timings.skin = 1e3 * (skin_end - pose_end)
    timings.write = 1e3 * (end - skin_end)


def _between(mesh_object, armature):
    """What leads from the armature's space to the mesh's, or None if they are one."""
    if mesh_object.matrix_world == armature.matrix_world:
        return None
    return blender_io.relative_matrix(mesh_object, armature)


def _read_joints(entry, armature, clip_pose):
    """The bones' motions into entry.matrices, those of B-bones spread over their joints."""
    bones = entry.bones
    channels = clip_pose[0] if clip_pose else blender_io.read_channels(armature)
    entry.matrices[bones.first_joint] = channels
    for bone in bones.bent:
        first, count = bones.first_joint[bone], bones.segments[bone] + 1
        posed = blender_io.read_bone_matrix(armature, bone) @ blender_io.read_segments(armature, bone)
        entry.matrices[first:first + count] = posed @ np.linalg.inv(
            entry.deformer.rest_frames[first:first + count])


def _deformer(ob, evaluated, entry, armature, mesh_from_armature):
    """The object's deformer on the rest shape of this frame, made anew if its influences may have
    changed."""
    settings = ob.sinew
    output = OUTPUTS[settings.installed_output]
    made_of = (settings.method, settings.use_vertex_groups, settings.use_envelopes,
               settings.mask_group, settings.mask_invert, len(ob.data.vertices),
               len(armature.pose.bones), blender_io.bone_flags(armature))
    space = None if mesh_from_armature is None else mesh_from_armature.tobytes()
    deformer = entry.deformer
    if deformer is not None and entry.made_of == made_of:
        hangs_on_shape = deformer.influences.hang_on_shape
        stays = not hangs_on_shape or space == entry.space
        if stays and not output.captures(ob):
            return deformer
        rest = output.rest_positions(ob, evaluated)
        if stays and deformer.has_rest(rest):
            return deformer
        if not hangs_on_shape:
            deformer.set_rest(rest)
            return deformer
    entry.made_of, entry.space = made_of, space
    entry.bones = Bones(**blender_io.read_bones(armature))
    entry.deformer = _make_deformer(
        ob, armature, entry.bones, output.rest_positions(ob, evaluated), mesh_from_armature)
    entry.matrices = np.tile(np.eye(4, dtype=np.float32), (entry.bones.joint_count + 1, 1, 1))
    return entry.deformer


def _make_deformer(ob, armature, bones, rest, mesh_from_armature):
    settings = ob.sinew
    offsets, groups, weights = blender_io.read_weights(ob)
    index = {name: i for i, name in enumerate(bones.names)}
    bone_of_group = np.array(
        [index.get(group.name, -1) for group in ob.vertex_groups] + [-1], np.int32)
    mask, group = None, ob.vertex_groups.get(settings.mask_group)
    if group is not None:
        mask = group_weights(offsets, groups, weights, group.index)
        mask = 1 - mask if settings.mask_invert else mask
    linear = settings.method == "LINEAR"
    rules = Rules(settings.use_vertex_groups, settings.use_envelopes, mask if linear else None)
    inverse = None if mesh_from_armature is None else np.linalg.inv(mesh_from_armature)
    own = influences(offsets, bone_of_group[groups], weights, bones, rules,
                     transformed(inverse, rest.astype(np.float64)))
    rest_frames = np.tile(np.eye(4), (bones.joint_count + 1, 1, 1))
    rest_frames[bones.first_joint] = bones.rest
    for bone in bones.bent:
        first, count = bones.first_joint[bone], bones.segments[bone] + 1
        rest_frames[first:first + count] = bones.rest[bone] @ blender_io.read_segments(
            armature, bone, rest=True)
    return Deformer(rest, own, rest_frames, STRETCH, None if linear else mask)
