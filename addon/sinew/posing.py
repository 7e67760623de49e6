"""Clips of imported rigs at work: the pose that each armature takes at a frame."""

import math
from time import perf_counter

from . import blender_io
from .clip_store import ClipPlayer, has_poses

_players = {}  # key of the armature object -> ClipPlayer


def forget():
    _players.clear()


def forget_armature(armature):
    _players.pop(blender_io.key_of(armature), None)


def player(armature):
    """The armature's ClipPlayer, made when it is first needed."""
    key = blender_io.key_of(armature)
    if key not in _players:
        _players[key] = ClipPlayer(armature)
    return _players[key]


def forget_if_edited(armature):
    """Posing tags the armature's data as well as an edit does; only the latter can change this."""
    known = _players.get(blender_io.key_of(armature))
    if known and known.edited(armature):
        forget_armature(armature)


def clip_time(settings, length, frame, render):
    """Time in poses and whether the clip loops, for the clip's mode at a frame of the scene."""
    if settings.mode == "PLAYBACK":
        return (frame - settings.frame_start) * settings.speed, settings.loop
    if settings.mode == "SWING":
        seconds = (frame - settings.frame_start) * render.fps_base / render.fps
        return abs(math.sin(seconds)) * (length - 1), False
    factor = {"REST": 0.0, "POSED": 1.0}.get(settings.mode, settings.factor)
    return factor * (length - 1), False


def pose_armatures(armatures, scene, depsgraph):
    """Poses each armature that has a clip. Returns {its key: (channels, milliseconds)}."""
    posed = {}
    for armature in armatures:
        key = blender_io.key_of(armature)
        if key in posed or not has_poses(armature.data):
            continue
        evaluated = armature.evaluated_get(depsgraph)
        if not evaluated.is_evaluated:  # of another scene
            continue
        start = perf_counter()
        clip_player = player(armature)
        settings = evaluated.sinew_clip  # an animated setting is current here alone
        frame = scene.frame_current + scene.frame_subframe
        time, loop = clip_time(settings, clip_player.clip.length, frame, scene.render)
        channels, location, rotation = clip_player.at(time, loop, rest=settings.mode == "REST")
        blender_io.write_pose(armature, location, rotation)
        posed[key] = channels, 1e3 * (perf_counter() - start)
    return posed
