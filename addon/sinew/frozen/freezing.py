"""Freezes and thaws armatures, each time by one building of Blender's relations."""

from collections.abc import Iterable
from typing import Any

from ..blender import values
from ..host import contract, marks, relations
from . import changes, followers, rigs, settings
from .followers import Followers

MOST_ATTEMPTS = 3
_is_building = False  # Blender is evaluating because this module has asked it to


def is_building() -> bool:
    """Whether Blender is evaluating because this module has asked it to."""
    return _is_building


def _why_live(rig: rigs.Rig, found: Followers, scene: Any, layer: Any) -> str:
    """Returns why an armature cannot be frozen now, as a sentence; "" if it can. Evaluates nothing. found: what follows
    it."""
    if found.keyed != rig.followers.keyed:
        rig.is_suspect = True
    rig.followers = found
    changes.follow_shapes(rig, found.hooked)
    frame = rigs.whole_frame(scene)
    if frame is None:
        return f"{rig.name} is live between two frames: only whole frames are recorded"
    if rig.is_frozen:
        return ""
    changes.compare_keys(rig)
    changes.check_settings(rig)
    if frame not in rig.record:
        return f"frame {frame} of {rig.name} is not recorded: play it, or use Record"
    if rigs.evaluated_copy(rig, layer.depsgraph) is None:
        return f"{rig.name} is not in this view layer"
    if not rigs.shows(rig, layer.depsgraph, rig.record.at(frame)):
        return f"{rig.name} has changes that are not keyed: they would be lost on another frame, so it stays live"
    return ""


def freeze(wanted: Iterable[rigs.Rig], scene: Any, layer: Any) -> None:
    """Freezes armatures, and keeps those frozen that already are. `reason` of those that cannot be frozen says why.
    Call it in the main thread, outside an evaluation. scene, layer: what a window shows."""
    layer.update()
    chosen = _freezable({rig.key: rig for rig in (*wanted, *rigs.frozen()) if rigs.is_alive(rig.ob)}, scene, layer)
    for _ in range(MOST_ATTEMPTS):
        _build(list(chosen.values()), scene, layer)
        if all(rig.is_frozen for rig in chosen.values()):
            return
        layer.update()  # a handler has edited something meanwhile
    for rig in chosen.values():
        if not rig.is_frozen:
            rig.reason = f"{rig.name} is edited by a handler after each evaluation, so it stays live"


def _freezable(chosen: dict[int, rigs.Rig], scene: Any, layer: Any) -> dict[int, rigs.Rig]:
    """Returns those of these armatures that can be frozen now, by key. `reason` of the others says why not."""
    found = followers.find([rig.ob for rig in chosen.values()])
    needed: dict[int, list[Any]] = {}  # the other armatures on which each depends
    for rig in chosen.values():
        rig.is_wanted, rig.reason = True, contract.freezing_trouble()
        own = found[rig.ob]
        try:
            if not rig.reason:
                needs = followers.check(rig.ob)
                if isinstance(own, followers.NotFreezable):
                    rig.reason = f"{rig.name} cannot be frozen: {own}"
                else:
                    rig.reason = _why_live(rig, own, scene, layer)
        except followers.NotFreezable as reason:
            rig.reason = str(reason)
        if not rig.reason:
            needed[rig.key] = needs
    lacking = True
    while lacking:  # one follows another, which cannot be frozen
        lacking = False
        for key, needs in list(needed.items()):
            live = next((each for each in needs if values.key_of(each) not in needed), None)
            if live is not None:
                rig, lacking = chosen[key], True
                rig.reason = f"{rig.name} follows bones of {live.name}, which is live"
                del needed[key]
    return {key: chosen[key] for key in needed}


def thaw(chosen: Iterable[rigs.Rig], scene: Any, layer: Any) -> None:
    """Thaws armatures, on this frame, and keeps the others frozen. Call it in the main thread, outside an
    evaluation."""
    keys = {rig.key for rig in chosen}
    for rig in rigs.known():
        if rig.key in keys:
            rig.is_wanted, rig.reason = False, ""
    _build([rig for rig in rigs.frozen() if rig.key not in keys], scene, layer)


def _build(chosen: list[rigs.Rig], scene: Any, layer: Any) -> None:
    """Freezes exactly these armatures. All others are evaluated on this frame."""
    global _is_building
    chosen = [rig for rig in chosen if rig.record.at(scene.frame_current_final) is not None]
    keys = {rig.key for rig in chosen}
    before = rigs.frozen()
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
        for rig in rigs.known():
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


def _settle(rig: rigs.Rig, scene: Any, layer: Any) -> bool:
    """Marks an armature that was just frozen, and writes its pose. Returns whether what follows it has to be evaluated
    again, because its bones had another pose when that was evaluated."""
    graph = layer.depsgraph
    evaluated = rigs.evaluated_copy(rig, graph)
    if evaluated is None:
        return False
    marks.test_and_mark(evaluated, rigs.MARK)
    rig.is_selected = any(is_selected_in(ob, layer) for ob in (rig.ob, *rig.followers.objects))
    rig.scene, rig.layer, rig.last = scene, layer.name, None
    rig.shown, rig.pose = rigs.whole_frame(scene), rig.record.at(scene.frame_current_final)
    rig.has_other_keys = settings.has_other_keys(rig.ob)
    rig.is_frozen = rigs.is_intact(rig, graph)
    if not rig.is_frozen or rigs.shows(rig, graph, rig.pose):
        return False
    rigs.show(rig, graph, rig.pose)
    for ob in rig.followers.objects:
        ob.update_tag()
    return True


def select(graph: Any) -> None:
    """Thaws what has been selected since the last look, before anybody can edit it. Call it in a handler."""
    layer, reasons = graph.view_layer, {}
    for rig in rigs.known():
        objects = [rig.ob, *(ob for ob in rig.followers.objects if rigs.is_alive(ob))]
        was, rig.is_selected = rig.is_selected, any(is_selected_in(ob, layer) for ob in objects)
        if rig.is_frozen and rig.is_selected and not was:
            reasons[rig.key] = f"{rig.name} is selected"
    if reasons:
        melt(graph, reasons)


def is_selected_in(ob: Any, layer: Any) -> bool:
    try:
        return ob.select_get(view_layer=layer)
    except RuntimeError:  # it is not in the view layer
        return False


def melt_all() -> None:
    """Thaws everything, as after an error or an undo step, from a handler. Records are kept and checked again."""
    for rig in rigs.known():
        if rig.is_frozen:
            _melt(rig)
            relations.tag()
        rig.is_suspect, rig.last, rig.reason = True, None, ""


def melt(graph: Any, reasons: dict[int, str]) -> None:
    """Thaws all armatures that are frozen in a graph, from a handler: Blender evaluates them in the evaluation that
    follows, or once more in the one that has called the handler. reasons: {key of an armature: why}; the others may be
    frozen again at once."""
    for rig in rigs.frozen():
        if rig.graph() == graph:
            rig.reason = reasons.get(rig.key, "")
            _melt(rig)
    relations.tag()


def _melt(rig: rigs.Rig) -> None:
    """Thaws one armature. If the originals have the channels of this frame, they are left as they are: somebody may
    just have edited them. Otherwise its keyframes are evaluated."""
    rig.is_frozen = False
    is_here = rigs.is_alive(rig.scene) and rig.shown is not None and rig.shown == rigs.whole_frame(rig.scene)
    has_channels = is_here and rig.record.at(rig.shown or 0) is rig.pose
    if not has_channels or rig.has_other_keys:
        rig.ob.update_tag(refresh={"TIME"})


def freeze_again(scene: Any, layer: Any) -> None:
    """Freezes what is wanted frozen, is not selected, and is recorded on this frame. If the scene asks for it, every
    character is wanted frozen and recorded while it plays."""
    frame = rigs.whole_frame(scene)
    if scene.sinew_freezes_others:
        for ob in layer.objects:
            if ob.type == "ARMATURE" and rigs.has_animation(ob):
                rigs.learn(ob).is_wanted = True
    waiting = [
        rig
        for rig in rigs.known()
        if rig.is_wanted
        and not rig.is_frozen
        and not rig.is_selected
        and frame in rig.record
        and rig.ob.mode == "OBJECT"
    ]
    if waiting:
        freeze(waiting, scene, layer)


def find_again() -> None:
    """Finds all armatures again after an undo step, and thaws them. Records are kept and checked again."""
    rigs.find_again()
    for rig in rigs.known():
        rig.followers = Followers()
        if rig.curves is not None:
            changes.compare_keys(rig)
    melt_all()
