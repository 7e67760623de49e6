"""Freezes armatures, plays their records before each evaluation, checks the result after it, and thaws.

Whether an armature is frozen is read from its evaluated copy (`_is_intact`), so nothing here can be wrong about it for
longer than one evaluation: whatever builds relations, or copies the armature again, is noticed right after it and
before anything is drawn."""

import sys
import threading
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..blender import values
from ..host import contract, evaluations, key_blocks, marks, poses, relations
from . import followers, records, settings, stored_keys
from .followers import Followers

DEFAULT_LIMIT = 2048  # megabytes for all records
MOST_ATTEMPTS = 3
_MARK = "OBJECT"  # kind of the mark on a frozen armature's evaluated copy


@dataclass
class Rig:
    """An armature that is recorded, and may be frozen, with all that follows it."""

    ob: Any  # the original armature object
    key: int
    name: str
    record: records.Record
    is_wanted: bool = False  # frozen whenever possible, see `freeze`
    is_frozen: bool = False
    reason: str = ""  # why it is live although it is wanted frozen, a sentence
    followers: Followers = field(default_factory=Followers)
    scene: Any = None  # in which it is frozen
    layer: str = ""  # name of the view layer in which it is frozen
    shown: int | None = None  # the frame whose pose was written last
    pose: Any = None  # that Moment
    has_other_keys: bool = False  # for more than the channels of bones, which a record does not hold
    is_selected: bool = False  # it was, or something of it, at the last look
    curves: dict[Any, stored_keys.Curve] | None = None  # the keyframes that the record was made with
    digest: Any = None  # of the settings that the record was made with
    is_suspect: bool = True  # the settings may have changed since
    last: Any = None  # the Moment that the last frame change has shown, while it plays live
    last_layer: int = 0  # address of the view layer that has shown it
    skins: Any = None  # its onion skins (ghosts.Skins), if they are shown

    def graph(self) -> Any:
        """Returns the dependency graph in which it is frozen, or None."""
        layer = self.scene.view_layers.get(self.layer) if _is_alive(self.scene) else None
        return layer.depsgraph if layer is not None else None


_rigs: dict[int, Rig] = {}
_store = records.Store(DEFAULT_LIMIT * records.MEGABYTE)
_is_building = False  # Blender is evaluating because this module has asked it to


def set_limit(megabytes: int) -> None:
    """Sets how much memory all records may need together."""
    _store.set_limit(megabytes * records.MEGABYTE)


def used_memory() -> int:
    """Returns how much memory all records need, in bytes."""
    return _store.used


def known() -> list[Rig]:
    """Returns the armatures that are recorded or frozen, without those that no longer exist."""
    for key in [key for key, rig in _rigs.items() if not _is_alive(rig.ob)]:
        _discard(_rigs.pop(key))
    return list(_rigs.values())


def new_record() -> records.Record:
    """Returns a record whose memory counts like that of poses."""
    return records.Record(_store)


def get(ob: Any) -> Rig | None:
    """Returns what is known of an armature object, or None."""
    found = _rigs.get(values.key_of(ob))
    return found if found is not None and _is_alive(found.ob) else None


def learn(ob: Any) -> Rig:
    """Records an original armature object from now on, whenever it plays. Returns what is known of it."""
    found = get(ob)
    if found is None:
        found = _rigs[values.key_of(ob)] = Rig(ob, values.key_of(ob), ob.name, records.Record(_store))
    return found


def forget() -> None:
    """Discards everything, as after a file was loaded."""
    for rig in _rigs.values():
        _discard(rig)
    _rigs.clear()


def _discard(rig: Rig) -> None:
    """Releases the memory of an armature that is no longer known."""
    rig.record.clear()
    if rig.skins is not None:
        rig.skins.clear()


def _is_alive(block: Any) -> bool:
    try:
        return block is not None and bool(block.name_full)
    except ReferenceError:
        return False


def _evaluated(rig: Rig, graph: Any) -> Any:
    """Returns the evaluated copy of an armature, or None if the graph has none."""
    if graph is None:
        return None
    found = rig.ob.evaluated_get(graph)
    return found if found.is_evaluated else None


def _is_intact(rig: Rig, graph: Any) -> bool:
    """Whether an armature is still frozen in its graph, as it was left."""
    evaluated = _evaluated(rig, graph)
    if evaluated is None or not marks.is_marked(evaluated, _MARK):
        return False
    data = evaluated.animation_data
    return data is not None and data.action is None and not len(data.nla_tracks)


class Moment(NamedTuple):
    """What is recorded of one frame."""

    pose: np.ndarray  # (N,) uint8, see host/poses.py
    keys: tuple[tuple[float, ...], ...]  # the values of the keys that followers.keyed lists

    @property
    def nbytes(self) -> int:
        return self.pose.nbytes + sum(map(sys.getsizeof, self.keys))


def _moment(rig: Rig, graph: Any) -> Moment:
    """Returns what an evaluation has made of an armature."""
    values_now = tuple(key_blocks.values_of(keys.evaluated_get(graph), numbers) for keys, numbers in _keyed(rig, graph))
    return Moment(poses.record(_evaluated(rig, graph)), values_now)


def _keyed(rig: Rig, graph: Any) -> list[tuple[Any, tuple[int, ...]]]:
    """Returns the shape keys that follow an armature and are in the graph."""
    return [(keys, numbers) for keys, numbers in rig.followers.keyed if keys.evaluated_get(graph).is_evaluated]


def _shows(rig: Rig, graph: Any, moment: Any) -> bool:
    """Whether the evaluated bones, and the keys that follow them, are exactly as recorded."""
    if moment is None or not poses.is_posed(_evaluated(rig, graph), moment.pose):
        return False
    keyed = _keyed(rig, graph)
    return len(keyed) == len(moment.keys) and all(
        key_blocks.values_of(keys.evaluated_get(graph), numbers) == recorded
        for (keys, numbers), recorded in zip(keyed, moment.keys)
    )


def is_shown(rig: Rig, graph: Any, moment: Any) -> bool:
    """Whether a graph shows a recorded moment of an armature, frozen or live."""
    is_played = rig.last is moment and rig.last_layer == graph.view_layer.as_pointer()
    return is_played or _evaluated(rig, graph) is not None and _shows(rig, graph, moment)


def _show(rig: Rig, graph: Any, moment: Any) -> None:
    """Writes what is recorded into the evaluated copies, and into the originals as Blender does."""
    poses.play(_evaluated(rig, graph), moment.pose)
    poses.play_original(rig.ob, moment.pose)
    for (keys, numbers), recorded in zip(_keyed(rig, graph), moment.keys):
        key_blocks.set_values(keys.evaluated_get(graph), numbers, recorded)
        key_blocks.set_values(keys, numbers, recorded)


def whole_frame(scene: Any) -> int | None:
    """Returns the scene's frame, or None on a sub-frame."""
    frame = scene.frame_current_final
    return int(frame) if frame == int(frame) else None


# --- recording ------------------------------------------------------------------------------------


def _record_frame(rig: Rig, scene: Any, graph: Any) -> None:
    """Records an armature that a frame change has just evaluated."""
    frame, evaluated = whole_frame(scene), _evaluated(rig, graph)
    rig.last = None
    if frame is None or evaluated is None or rig.ob.mode == "EDIT" or not has_animation(rig.ob):
        return
    _check_settings(rig)
    if frame in rig.record and not _shows(rig, graph, rig.record.at(frame)):
        drop(rig, [stored_keys.ALL])  # something has changed that was not noticed
    if frame not in rig.record:
        rig.record.put(frame, _moment(rig, graph))
    rig.last, rig.last_layer = rig.record.at(frame), graph.view_layer.as_pointer()


def has_animation(ob: Any) -> bool:
    """Whether an original object has an action or NLA tracks."""
    data = ob.animation_data
    return data is not None and (data.action is not None or len(data.nla_tracks) > 0)


def _check_settings(rig: Rig) -> None:
    """Drops the record if anything has changed on which the pose depends."""
    if rig.curves is None:
        compare_keys(rig)
    if not rig.is_suspect:
        return
    own = followers.find([rig.ob])[rig.ob]
    keyed = own.keyed if isinstance(own, Followers) else []
    found = settings.digest(rig.ob, followers.outside_of(rig.ob)), tuple((values.key_of(k), n) for k, n in keyed)
    if found != rig.digest:
        drop(rig, [stored_keys.ALL])
        rig.followers.keyed = keyed
    rig.digest, rig.is_suspect = found, False


def compare_keys(rig: Rig) -> None:
    """Drops those frames of a record on which the keyframes have changed."""
    found = settings.curves_of(rig.ob)
    changed = [stored_keys.ALL] if rig.curves is None else stored_keys.changed(rig.curves, found)
    rig.curves = found
    drop(rig, changed)


def drop(rig: Rig, ranges: list[tuple[float, float]]) -> None:
    """Drops frames of an armature, and of those whose bones follow it."""
    reached = [rig]
    for each in reached:
        if each.record.drop_within(ranges):
            each.last = None
        reached += [other for other in known() if other not in reached and each.ob in followers.needs(other.ob)]


# --- freezing -------------------------------------------------------------------------------------


def _why_live(rig: Rig, found: Followers | followers.NotFreezable, scene: Any, layer: Any) -> str:
    """Returns why an armature cannot be frozen now, as a sentence; "" if it can. Evaluates nothing. found: as returned
    by followers.find."""
    if contract.freezing_trouble():
        return contract.freezing_trouble()
    try:
        followers.check(rig.ob)
    except followers.NotFreezable as reason:
        return str(reason)
    if isinstance(found, followers.NotFreezable):
        return f"{rig.name} cannot be frozen: {found}"
    if found.keyed != rig.followers.keyed:
        rig.is_suspect = True
    rig.followers = found
    frame = whole_frame(scene)
    if frame is None:
        return f"{rig.name} is live between two frames: only whole frames are recorded"
    if rig.is_frozen:
        return ""
    compare_keys(rig)
    _check_settings(rig)
    if frame not in rig.record:
        return f"frame {frame} of {rig.name} is not recorded: play it, or use Record"
    if _evaluated(rig, layer.depsgraph) is None:
        return f"{rig.name} is not in this view layer"
    if not _shows(rig, layer.depsgraph, rig.record.at(frame)):
        return f"{rig.name} has changes that are not keyed: they would be lost on another frame, so it stays live"
    return ""


def freeze(wanted: Iterable[Rig], scene: Any, layer: Any) -> None:
    """Freezes armatures, and keeps those frozen that already are. `reason` of those that cannot be frozen says why.
    Call it in the main thread, outside an evaluation. scene, layer: what a window shows."""
    layer.update()
    chosen = {rig.key: rig for rig in (*wanted, *frozen()) if _is_alive(rig.ob)}
    found = followers.find([rig.ob for rig in chosen.values()])
    for rig in list(chosen.values()):
        rig.is_wanted = True
        rig.reason = _why_live(rig, found[rig.ob], scene, layer)
        if rig.reason:
            del chosen[rig.key]
    while True:  # one follows another, which cannot be frozen
        for rig in chosen.values():
            lacking = [each for each in followers.needs(rig.ob) if values.key_of(each) not in chosen]
            if lacking:
                rig.reason = f"{rig.name} follows bones of {lacking[0].name}, which is live"
                del chosen[rig.key]
                break
        else:
            break
    for _ in range(MOST_ATTEMPTS):
        _build(list(chosen.values()), scene, layer)
        if all(rig.is_frozen for rig in chosen.values()):
            return
        layer.update()  # a handler has edited something meanwhile
    for rig in chosen.values():
        if not rig.is_frozen:
            rig.reason = f"{rig.name} is edited by a handler after each evaluation, so it stays live"


def thaw(chosen: Iterable[Rig], scene: Any, layer: Any) -> None:
    """Thaws armatures, on this frame, and keeps the others frozen. Call it in the main thread, outside an
    evaluation."""
    keys = {rig.key for rig in chosen}
    for rig in known():
        if rig.key in keys:
            rig.is_wanted, rig.reason = False, ""
    _build([rig for rig in frozen() if rig.key not in keys], scene, layer)


def frozen() -> list[Rig]:
    """Returns the armatures that are frozen."""
    return [rig for rig in known() if rig.is_frozen]


def _build(chosen: list[Rig], scene: Any, layer: Any) -> None:
    """Freezes exactly these armatures. All others are evaluated on this frame."""
    global _is_building
    chosen = [rig for rig in chosen if rig.record.at(scene.frame_current_final) is not None]
    keys = {rig.key for rig in chosen}
    before = frozen()
    if not chosen and not before:
        return
    for rig in before:
        if rig.key not in keys:
            _melt(rig)
    hooked = {values.key_of(ob): ob for rig in chosen for ob in rig.followers.hooked}
    relations.tag()
    _is_building = True
    try:
        with relations.Rebuilding() as rebuilding:
            for rig in chosen:
                rebuilding.without_animation(rig.ob)
            for ob in hooked.values():
                rebuilding.on_each_frame(followers.hook_of(ob))
            rebuilding.build(layer)
    finally:
        _is_building = False
        for rig in known():
            rig.is_frozen = False
    graph = layer.depsgraph
    for ob in hooked.values():
        hook = followers.hook_of(ob.evaluated_get(graph))
        if hook is not None:
            relations.sum_again(hook)
    is_other = False
    for rig in chosen:
        is_other |= _settle(rig, scene, layer)
    if is_other:
        layer.update()


def _settle(rig: Rig, scene: Any, layer: Any) -> bool:
    """Marks an armature that was just frozen, and writes its pose. Returns whether what follows it has to be evaluated
    again, because its bones had another pose when that was evaluated."""
    graph = layer.depsgraph
    evaluated = _evaluated(rig, graph)
    if evaluated is None:
        return False
    marks.test_and_mark(evaluated, _MARK)
    rig.is_selected = any(_is_selected(ob, layer) for ob in (rig.ob, *rig.followers.objects))
    rig.scene, rig.layer, rig.last = scene, layer.name, None
    rig.shown, rig.pose = whole_frame(scene), rig.record.at(scene.frame_current_final)
    rig.has_other_keys = settings.has_other_keys(rig.ob)
    rig.is_frozen = _is_intact(rig, graph)
    if not rig.is_frozen or _shows(rig, graph, rig.pose):
        return False
    _show(rig, graph, rig.pose)
    for ob in rig.followers.objects:
        ob.update_tag()
    return True


def select(graph: Any) -> None:
    """Thaws what has been selected since the last look, before anybody can edit it. Call it in a handler."""
    layer, reasons = graph.view_layer, {}
    for rig in known():
        objects = [rig.ob, *(ob for ob in rig.followers.objects if _is_alive(ob))]
        was, rig.is_selected = rig.is_selected, any(_is_selected(ob, layer) for ob in objects)
        if rig.is_frozen and rig.is_selected and not was:
            reasons[rig.key] = f"{rig.name} is selected"
    if reasons:
        melt(graph, reasons)


def _is_selected(ob: Any, layer: Any) -> bool:
    return layer.objects.get(ob.name) == ob and ob.select_get(view_layer=layer)


def melt_all() -> None:
    """Thaws everything, as after an error or an undo step, from a handler. Records are kept and checked again."""
    for rig in known():
        if rig.is_frozen:
            _melt(rig)
            relations.tag()
        rig.is_suspect, rig.last, rig.reason = True, None, ""


def melt(graph: Any, reasons: dict[int, str]) -> None:
    """Thaws all armatures that are frozen in a graph, from a handler: Blender evaluates them in the evaluation that
    follows, or once more in the one that has called the handler. reasons: {key of an armature: why}; the others may be
    frozen again at once."""
    for rig in frozen():
        if rig.graph() == graph:
            rig.reason = reasons.get(rig.key, "")
            _melt(rig)
    relations.tag()


def _melt(rig: Rig) -> None:
    """Thaws one armature. If the originals have the channels of this frame, they are left as they are: somebody may
    just have edited them. Otherwise its keyframes are evaluated."""
    rig.is_frozen = False
    is_here = _is_alive(rig.scene) and rig.shown is not None and rig.shown == whole_frame(rig.scene)
    has_channels = is_here and rig.record.at(rig.shown or 0) is rig.pose
    if not has_channels or rig.has_other_keys:
        rig.ob.update_tag(refresh={"TIME"})


# --- around each evaluation -----------------------------------------------------------------------


def _is_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


def is_busy() -> bool:
    """Whether handlers should do nothing: this module has Blender evaluate, or the call is not from the main thread."""
    return _is_building or not _is_main_thread()


def before_evaluation(scene: Any) -> None:
    """Writes the recorded poses of the scene's frame, or thaws what cannot be shown from its record."""
    if is_busy() or not _rigs:
        return
    graphs = {layer.as_pointer(): layer.depsgraph for layer in scene.view_layers if layer.depsgraph is not None}
    are_keys_edited = any(graph.id_type_updated("ACTION") for graph in graphs.values())
    for rig in known():
        if any(_is_tagged(rig, graph) for graph in graphs.values()):
            rig.is_suspect = True
        if are_keys_edited and rig.curves is not None:
            compare_keys(rig)
        if rig.last is not None and not rig.is_frozen and not rig.is_suspect:
            _check_unchanged(rig, graphs.get(rig.last_layer))
        rig.last = None
    for graph in graphs.values():
        _play(scene, graph)


def _is_tagged(rig: Rig, graph: Any) -> bool:
    """Whether an armature has been edited and not been evaluated since."""
    evaluated = _evaluated(rig, graph)
    return evaluated is not None and (evaluations.is_tagged(evaluated) or evaluations.is_tagged(evaluated.data))


def _was_evaluated(rig: Rig, graph: Any) -> bool:
    """Whether the evaluation whose handlers run has evaluated anything of an armature or of the keys that follow it."""
    return _is_tagged(rig, graph) or any(
        evaluations.is_tagged(keys.evaluated_get(graph)) for keys, _numbers in _keyed(rig, graph)
    )


def _check_unchanged(rig: Rig, graph: Any) -> None:
    """Drops the record if the last frame that it shows is not what its evaluation has ended with: a handler of another
    add-on has moved bones after it was recorded."""
    evaluated = _evaluated(rig, graph)
    if evaluated is not None and not _shows(rig, graph, rig.last):
        drop(rig, [stored_keys.ALL])
        rig.reason = f"{rig.name} is moved by another add-on after each frame, which cannot be recorded"


def _play(scene: Any, graph: Any) -> None:
    own = [rig for rig in frozen() if rig.graph() == graph]
    if not own:
        return
    frame, reasons = whole_frame(scene), {}
    for rig in own:
        if not _is_intact(rig, graph) or _is_tagged(rig, graph):
            reasons[rig.key] = f"{rig.name} was edited"
        elif frame is None or frame not in rig.record:
            reasons[rig.key] = f"frame {scene.frame_current_final:g} of {rig.name} is not recorded: it is live there"
        elif not _shows(rig, graph, rig.pose):
            reasons[rig.key] = f"something besides its keyframes moves the bones of {rig.name}"
            drop(rig, [stored_keys.ALL])
    if reasons:
        melt(graph, reasons)
        return
    for rig in own:
        if frame is not None and rig.shown != frame:
            rig.shown, rig.pose = frame, rig.record.at(frame)
            _show(rig, graph, rig.pose)
            _tag_followers(rig)


def _tag_followers(rig: Rig) -> None:
    for ob in rig.followers.placed:
        if _is_alive(ob):
            ob.update_tag(refresh={"OBJECT"})
    for ob in rig.followers.shaped:
        if _is_alive(ob):
            ob.update_tag(refresh={"DATA"})


def after_evaluation(scene: Any, graph: Any, is_new_frame: bool) -> None:
    """Checks what an evaluation has made of frozen armatures, and records those that are live."""
    if is_busy() or not _rigs or graph != graph.view_layer.depsgraph:
        return
    own = [rig for rig in frozen() if rig.graph() == graph]
    frame = whole_frame(scene)
    reasons = {}
    for rig in own:
        if not _is_intact(rig, graph):
            reasons[rig.key] = ""
        elif rig.shown != frame or _was_evaluated(rig, graph) and not _shows(rig, graph, rig.pose):
            reasons[rig.key] = f"something besides its keyframes moves the bones of {rig.name}"
            drop(rig, [stored_keys.ALL])
    if reasons:
        melt(graph, reasons)
    select(graph)
    if is_new_frame and not reasons:
        for rig in known():
            if not rig.is_frozen:
                _record_frame(rig, scene, graph)


def freeze_again(scene: Any, layer: Any) -> None:
    """Freezes what is wanted frozen, is not selected, and is recorded on this frame. If the scene asks for it, every
    character is wanted frozen and recorded while it plays."""
    frame = whole_frame(scene)
    if scene.sinew_freezes_others:
        for ob in layer.objects:
            if ob.type == "ARMATURE" and has_animation(ob):
                learn(ob).is_wanted = True
    waiting = [
        rig
        for rig in known()
        if rig.is_wanted
        and not rig.is_frozen
        and not rig.is_selected
        and frame in rig.record
        and rig.ob.mode == "OBJECT"
    ]
    if waiting:
        freeze(waiting, scene, layer)


def find_again() -> None:
    """Finds all armatures again after an undo step, which may have replaced them, and thaws them. Records are kept and
    checked again."""
    for key, rig in list(_rigs.items()):
        if _is_alive(rig.ob) and values.key_of(rig.ob) == key:
            continue
        del _rigs[key]
        rig.ob = bpy.data.objects.get(rig.name)
        if rig.ob is None or rig.ob.type != "ARMATURE":
            _discard(rig)
        else:
            rig.key = values.key_of(rig.ob)
            _rigs[rig.key] = rig
    for rig in known():
        rig.followers = Followers()
        if rig.curves is not None:
            compare_keys(rig)
    melt_all()
