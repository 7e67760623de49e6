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
from .deform import Deformer, normalised_influences
from .outputs import OUTPUTS

log = logging.getLogger("sinew")


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
    bones: tuple = ()
    timings: Timings = field(default_factory=Timings)
    error: str = ""


_lock = threading.RLock()
_characters = {}  # key of the mesh object -> Character
_players = {}  # key of the armature object -> ClipPlayer
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
        objects = bound_objects()
        if objects:
            _deform(objects, depsgraph, _pose_armatures(objects, scene, depsgraph))


def on_update(depsgraph):
    """Somebody changed something: meshes follow the bones as they stand. A clip does not step in,
    so a bone posed by hand keeps its pose until the next frame, as with keyframes."""
    with _lock:
        objects = bound_objects()
        if not objects:
            return
        changed = {blender_io.key_of(update.id) for update in depsgraph.updates
                   if isinstance(update.id, (bpy.types.Object, bpy.types.Mesh, bpy.types.Armature))}
        affected = []
        for ob in objects:
            armature = ob.sinew.armature
            blocks = [ob, ob.data] + ([armature, armature.data] if armature else [])
            if changed.isdisjoint(map(blender_io.key_of, blocks)):
                continue
            affected.append(ob)
            if blender_io.key_of(ob.data) in changed:
                _characters[blender_io.key_of(ob)].deformer = None
            if armature and blender_io.key_of(armature.data) in changed:
                _drop_player_if_edited(armature)
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
    for ob in objects:
        entry = _characters[blender_io.key_of(ob)]
        try:
            _deform_one(ob, entry, depsgraph, posed)
            entry.error = ""
        except Exception as error:  # noqa: BLE001 - whatever it is, playback goes on
            if str(error) != entry.error:
                log.exception("%s is not deformed", ob.name)
            entry.error = str(error)
            entry.deformer = None


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
    channels = clip_pose[0] if clip_pose else blender_io.read_channels(evaluated_armature)
    mesh_from_armature = _between(evaluated, evaluated_armature)
    if armature.data.pose_position == "REST" or armature.mode == "EDIT":
        channels = np.broadcast_to(np.eye(4, dtype=np.float32), channels.shape)
    deformer = _deformer(ob, entry, armature)
    pose_end = perf_counter()
    positions = deformer.deform(settings.method, channels, mesh_from_armature)
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


def _deformer(ob, entry, armature):
    bones = blender_io.bone_table(armature)
    deformer = entry.deformer
    if (deformer is None or bones != entry.bones
            or deformer.skin.vertex_count != len(ob.data.vertices)):
        entry.bones = bones
        entry.deformer = deformer = Deformer(
            OUTPUTS[ob.sinew.installed_output].rest_positions(ob), *influences(ob, bones), len(bones))
    return deformer


def influences(ob, bones):
    """The mesh's weights as influences of bones: offsets, bones, weights."""
    offsets, groups, weights = blender_io.read_weights(ob)
    index = {name: i for i, (name, deforms) in enumerate(bones) if deforms}
    bone_of_group = np.array(
        [index.get(group.name, -1) for group in ob.vertex_groups] + [-1], np.int32)
    return normalised_influences(offsets, bone_of_group[groups], weights)
