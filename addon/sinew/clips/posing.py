"""Poses armatures from the clips of imported rigs, frame by frame."""

import contextlib
import logging
import math
from collections.abc import Iterable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..blender import animation, armatures, values
from ..feedback import notice
from . import clip_store

log = logging.getLogger("sinew")
_players: "dict[int, clip_store.ClipPlayer | _Unreadable]" = {}  # by key of the armature object
_said: set[str] = set()  # the sentences that were already reported


@dataclass
class _Unreadable:
    """Replaces the ClipPlayer of an armature whose clip is damaged."""

    data_key: int
    error: clip_store.DamagedClip

    def is_of(self, armature_data: Any) -> bool:
        return self.data_key == values.key_of(armature_data)

    def is_edited(self, _armature_data: Any) -> bool:
        return True


def forget() -> None:
    """Forgets all players and the last poses."""
    _players.clear()
    _posed.clear()


def forget_what_was_said() -> None:
    """Forgets which errors were reported, because another file is opened."""
    _said.clear()


def forget_armature(armature: Any) -> None:
    """Forgets the armature's player and its last pose."""
    _players.pop(values.key_of(armature), None)
    _posed.pop(values.key_of(armature), None)


def player(armature: Any) -> clip_store.ClipPlayer:
    """Returns the armature's ClipPlayer, which is created when first needed. Raises clip_store.DamagedClip."""
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


def is_damaged(armature: Any) -> bool:
    """Whether an attempt to read the armature's clip has found it damaged."""
    return isinstance(_players.get(values.key_of(armature)), _Unreadable)


def forget_if_edited(data: Any) -> None:
    """Forgets the players made from an armature's data if the bones have changed. The data's update tag does not show
    this, because posing sets it too."""
    for key in [key for key, player in _players.items() if player.is_of(data) and player.is_edited(data)]:
        del _players[key]
        _posed.pop(key, None)


def clip_time(settings: Any, length: int, frame: float, render: Any) -> tuple[float, bool]:
    """Returns the time in poses and whether the clip loops, at a frame of the scene, according to the clip's mode."""
    if settings.mode == "PLAYBACK":
        return (frame - settings.frame_start) * settings.speed, settings.loop
    if settings.mode == "SWING":
        seconds = (frame - settings.frame_start) * render.fps_base / render.fps
        return abs(math.sin(seconds)) * (length - 1), False
    factor = {"REST": 0.0, "POSED": 1.0}.get(settings.mode, settings.factor)
    return factor * (length - 1), False


def pose_armatures(armatures: Iterable[Any], scene: Any) -> None:
    """Poses armatures that have a clip for the scene's current frame, before Blender evaluates it."""
    frame = scene.frame_current + scene.frame_subframe
    for armature in armatures:
        with _said_once(armature):
            _pose(armature, _settings_at(armature, frame), scene)


def pose_anew(armatures: Iterable[Any], scene: Any, depsgraph: Any) -> None:
    """Poses armatures again after the evaluation. Settings animated by drivers or NLA strips, and armatures added
    during the evaluation, are only known then. Blender evaluates what this changes once more."""
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
    """Reports an error with one armature once, and continues with the other armatures."""
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


def channels_of(ob: Any, armature: Any) -> np.ndarray | None:
    """Returns (B, 4, 4): the motions of all bones in the clip, if the clip consists of matrices, whose scale and shear
    the bones cannot represent, and no bone has been moved since; otherwise None. ob, armature: evaluated."""
    if not _posed or ob.sinew.source != "CLIP":
        return None
    known = _posed.get(values.key_of(armature))
    if known is None or known.channels is None or not known.is_shown_by(armature):
        return None
    return known.channels


@dataclass(frozen=True)
class _Posed:
    """The last pose that Sinew gave an armature."""

    moment: tuple
    channels: np.ndarray | None
    location: np.ndarray  # as stored in the bones
    rotation: np.ndarray

    def is_shown_by(self, armature: Any) -> bool:
        """Whether the armature's bones still have this pose."""
        location, rotation = armatures.read_pose(armature)
        return np.array_equal(location, self.location) and np.array_equal(rotation, self.rotation)


_posed: dict[int, _Posed] = {}  # by key of the armature object


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
