"""Poses armatures from the clips of imported rigs, frame by frame."""

import contextlib
import logging
import math
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from ..blender import animation, armatures, values
from ..feedback import notice
from . import clip_store

log = logging.getLogger("sinew")
_players = {}  # key of the armature object -> ClipPlayer, or _Unreadable
_said = set()  # the sentences that were already reported


@dataclass
class _Unreadable:
    """Takes the place of the ClipPlayer of an armature whose clip is damaged."""

    data_key: int
    error: clip_store.DamagedClip

    def is_of(self, armature_data):
        return self.data_key == values.key_of(armature_data)

    def is_edited(self, _armature_data):
        return True


def forget():
    _players.clear()
    _posed.clear()


def forget_what_was_said():
    """Forgets which errors were reported, since a different file is opened."""
    _said.clear()


def forget_armature(armature):
    _players.pop(values.key_of(armature), None)
    _posed.pop(values.key_of(armature), None)


def player(armature):
    """Returns the armature's ClipPlayer, which is made when first needed. Raises clip_store.DamagedClip."""
    key = values.key_of(armature)
    if key not in _players:
        try:
            _players[key] = clip_store.ClipPlayer(armature)
        except clip_store.DamagedClip as error:
            _players[key] = _Unreadable(values.key_of(armature.data), error)
    found = _players[key]
    if isinstance(found, _Unreadable):
        raise found.error
    return found


def is_damaged(armature):
    """Whether the armature's clip was found to be damaged."""
    return isinstance(_players.get(values.key_of(armature)), _Unreadable)


def forget_if_edited(data):
    """Forgets the players made from an armature's data if it was edited. Posing tags the data just as an edit does."""
    for key in [key for key, player in _players.items() if player.is_of(data) and player.is_edited(data)]:
        del _players[key]
        _posed.pop(key, None)


def clip_time(settings, length, frame, render):
    """Returns the time in poses and whether the clip loops, for the clip's mode at a frame of the scene."""
    if settings.mode == "PLAYBACK":
        return (frame - settings.frame_start) * settings.speed, settings.loop
    if settings.mode == "SWING":
        seconds = (frame - settings.frame_start) * render.fps_base / render.fps
        return abs(math.sin(seconds)) * (length - 1), False
    factor = {"REST": 0.0, "POSED": 1.0}.get(settings.mode, settings.factor)
    return factor * (length - 1), False


def pose_armatures(armatures, scene):
    """Poses the armatures that have a clip for the scene's frame, before Blender evaluates it."""
    frame = scene.frame_current + scene.frame_subframe
    for armature in armatures:
        with _said_once(armature):
            _pose(armature, _settings_at(armature, frame), scene)


def pose_anew(armatures, scene, depsgraph):
    """Poses armatures again after the evaluation: only now are settings known that drivers or strips animate, and
    armatures that were added during the evaluation. Blender evaluates again what this changes."""
    for armature in armatures:
        with _said_once(armature):
            evaluated = armature.evaluated_get(depsgraph)
            known = _posed.get(values.key_of(armature))
            if evaluated.is_evaluated and not (
                known and known.moment == _moment(armature, evaluated.sinew_clip, scene)
            ):
                _pose(armature, evaluated.sinew_clip, scene)


@contextlib.contextmanager
def _said_once(armature):
    """Reports an error of one armature once, and keeps it from stopping the others."""
    try:
        yield
    except Exception as error:
        sentence = str(error)
        if not is_damaged(armature):
            sentence = f"{armature.name} cannot be posed: {error}"
            forget_armature(armature)  # its bones may have changed
        if sentence not in _said:
            _said.add(sentence)
            log.error(sentence)
            notice.show(sentence)


def channels_of(ob, armature):
    """Returns (B, 4, 4): the motions of all bones in the clip, if bones cannot show them (matrices that scale
    or shear) and nobody has moved a bone since; otherwise None. ob, armature: evaluated."""
    if not _posed or ob.sinew.source != "CLIP":
        return None
    known = _posed.get(values.key_of(armature))
    if known is None or known.channels is None or not known.is_shown_by(armature):
        return None
    return known.channels


@dataclass(frozen=True)
class _Posed:
    """The last pose that an armature was given."""

    moment: tuple
    channels: np.ndarray | None
    location: np.ndarray  # as stored in the bones
    rotation: np.ndarray

    def is_shown_by(self, armature):
        location, rotation = armatures.read_pose(armature)
        return np.array_equal(location, self.location) and np.array_equal(rotation, self.rotation)


_posed = {}  # key of the armature object -> _Posed


def _moment(armature, settings, scene):
    frame = scene.frame_current + scene.frame_subframe
    return clip_time(settings, player(armature).clip.length, frame, scene.render) + (settings.mode == "REST",)


def _pose(armature, settings, scene):
    moment = time, loop, rest = _moment(armature, settings, scene)
    channels, location, rotation = player(armature).at(time, loop, rest=rest)
    location, rotation = location.astype(np.float32), rotation.astype(np.float32)
    armatures.write_pose(armature, location, rotation)
    kept = channels.copy() if player(armature).is_by_matrices else None
    _posed[values.key_of(armature)] = _Posed(moment, kept, location, rotation)


def _settings_at(armature, frame):
    """Returns the clip's settings, with their keyframes evaluated at that frame."""
    settings = armature.sinew_clip
    names = ("mode", "factor", "frame_start", "speed", "loop")
    curves = {name: animation.find_curve(armature, f"sinew_clip.{name}") for name in names}
    if not any(curves.values()):
        return settings
    found = {name: getattr(settings, name) for name in names}
    modes = [item.identifier for item in settings.bl_rna.properties["mode"].enum_items]
    for name, curve in curves.items():
        if curve is not None:
            value = curve.evaluate(frame)
            found[name] = modes[int(value)] if name == "mode" else type(found[name])(value)
    return SimpleNamespace(**found)
