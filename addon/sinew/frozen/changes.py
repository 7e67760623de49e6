"""Records armatures while they play, and drops from the records what an edit changes."""

from typing import Any

from ..blender import armatures, values
from . import followers, rigs, settings, stored_keys
from .followers import Followers


def record_frame(rig: rigs.Rig, scene: Any, graph: Any) -> None:
    """Records an armature that a frame change has just evaluated."""
    frame, evaluated = rigs.whole_frame(scene), rigs.evaluated_copy(rig, graph)
    rig.last = None
    if frame is None or evaluated is None or rig.ob.mode == "EDIT" or not rigs.has_animation(rig.ob):
        return
    check_settings(rig)
    if frame in rig.record and not rigs.shows(rig, graph, rig.record.at(frame)):
        drop(rig, [stored_keys.ALL])  # something has changed that was not noticed
    if frame not in rig.record:
        rig.record.put(frame, rigs.moment_of(rig, graph))
    rig.shapes.note(frame, graph)
    rig.last, rig.last_layer = rig.record.at(frame), graph.view_layer.as_pointer()


def meet(rig: rigs.Rig, graph: Any) -> None:
    """Finds the meshes of an armature that has not been recorded yet, and asks for their shapes in a graph."""
    found = followers.find([rig.ob])[rig.ob]
    if isinstance(found, Followers):
        follow_shapes(rig, found.hooked)
        rig.shapes.ask_in(graph)


def check_settings(rig: rigs.Rig) -> None:
    """Drops the record if anything has changed on which the pose depends."""
    if rig.curves is None:
        compare_keys(rig)
    if not rig.is_suspect:
        return
    own = followers.find([rig.ob])[rig.ob]
    keyed = own.keyed if isinstance(own, Followers) else []
    follow_shapes(rig, own.hooked if isinstance(own, Followers) else [])
    found = settings.digest(rig.ob, followers.outside_of(rig.ob)), tuple((values.key_of(k), n) for k, n in keyed)
    if found != rig.digest:
        drop(rig, [stored_keys.ALL])
        rig.followers.keyed = keyed
    rig.digest, rig.is_suspect = found, False


def follow_shapes(rig: rigs.Rig, hooked: list[Any]) -> None:
    """Records the shapes of the meshes with a hook that follow an armature, except for those that another one moves
    first."""

    def is_first(ob: Any) -> bool:
        return armatures.of_modifiers(ob)[:1] == [rig.ob]

    rig.shapes.follow(ob for ob in hooked if is_first(ob))


def compare_keys(rig: rigs.Rig) -> None:
    """Drops those frames of a record on which the keyframes have changed."""
    found = settings.curves_of(rig.ob)
    changed = [stored_keys.ALL] if rig.curves is None else stored_keys.changed(rig.curves, found)
    rig.curves = found
    drop(rig, changed)


def drop(rig: rigs.Rig, ranges: list[tuple[float, float]]) -> None:
    """Drops frames of an armature, and of those whose bones follow it."""
    if not ranges:
        return
    reached = [rig]
    for each in reached:
        if each.record.drop_within(ranges):
            each.last = None
        each.shapes.drop_within(ranges)
        reached += [other for other in rigs.known() if other not in reached and each.ob in followers.needs(other.ob)]
