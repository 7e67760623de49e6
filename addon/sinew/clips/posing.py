"""Clips of imported rigs at work: the pose that each armature takes at a frame."""

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
_said = set()  # sentences


@dataclass
class _Unreadable:
    """In place of the ClipPlayer of an armature whose clip is damaged."""

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
    """Another file is opened."""
    _said.clear()


def forget_armature(armature):
    _players.pop(values.key_of(armature), None)
    _posed.pop(values.key_of(armature), None)


def player(armature):
    """The armature's ClipPlayer, made when it is first needed. Raises clip_store.DamagedClip."""
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
    """Whether its clip was found to be."""
    return isinstance(_players.get(values.key_of(armature)), _Unreadable)


def forget_if_edited(data):
    """What was made of an armature's data, if that was edited. Posing tags it as an edit does."""
    for key in [key for key, player in _players.items() if player.is_of(data) and player.is_edited(data)]:
        del _players[key]
        _posed.pop(key, None)


def clip_time(settings, length, frame, render):
    """Time in poses and whether the clip loops, for the clip's mode at a frame of the scene."""
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
    """After the evaluation: settings that drivers or strips animate are known only now, and so are armatures that came
    while it went on. Blender evaluates again what this changes."""
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
    """What is wrong with one armature is said and stops no other."""
    try:
        yield
    except Exception as error:
        sentence = str(error)
        if not is_damaged(armature):
            sentence = f"{armature.name} cannot be posed: {error}"
            forget_armature(armature)  # its bones may be others by now
        if sentence not in _said:
            _said.add(sentence)
            log.error(sentence)
            notice.show(sentence)


def channels_of(ob, armature):
    """(B, 4, 4): the motions of all bones that the clip asks for, where bones cannot show them (matrices that scale
    or shear) and nobody has moved a bone since; else None. ob, armature: evaluated."""
    if not _posed or ob.sinew.source != "CLIP":
        return None
    known = _posed.get(values.key_of(armature))
    if known is None or known.channels is None or not known.is_shown_by(armature):
        return None
    return known.channels


@dataclass(frozen=True)
class _Posed:
    """What an armature was posed to last."""

    moment: tuple
    channels: np.ndarray | None
    location: np.ndarray  # as the bones hold it
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
    """The clip's settings with their keyframes as of that frame."""
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
