"""Rigs that follow bones of other rigs, as a rider follows a horse. The program of the one that follows is given what
the others have on each frame: what is known of that frame, or what their programs compute."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..blender import animation, dependencies, values
from ..host import poses
from ..rig_programs import curves, drivers, paths, targets
from . import followers, rigs


class Link(NamedTuple):
    """What comes from outside and moves with another armature."""

    name: str  # in the program of the one that follows
    leader: rigs.Rig
    world: np.ndarray  # (4, 4) float32, where the leader stands
    bone: int  # of the leader, in the order of its pose; -1: a number
    path: str  # of that number


class Unknown(ValueError):
    """What a leader has on a frame is not known. The message is a sentence."""


def links_of(ob: bpy.types.Object, read: targets.Targets, numbers: drivers.Outside, graph: Any) -> tuple[Link, ...]:
    """Returns what an armature object follows that moves with other armatures. read, numbers: what it reads from
    outside. Raises ValueError, whose message is a sentence, for what moves otherwise."""
    found = []
    for name, (block, bone) in read.outside.items():
        if _is_led(block, ob) and bone:
            found.append(Link(name, *_leader(block, graph), block.pose.bones.keys().index(bone), ""))
    for name, (block, path) in numbers.read.items():
        path = paths.normalised(path)
        if _is_led(block, ob) and any(path.startswith(each) for each in animation.animated_paths(block)):
            found.append(Link(name, *_leader(block, graph), -1, path))
    return tuple(found)


def _leader(block: bpy.types.Object, graph: Any) -> tuple[rigs.Rig, np.ndarray]:
    return rigs.learn(block), np.array(block.evaluated_get(graph).matrix_world, np.float32)


def _is_led(block: Any, ob: bpy.types.Object) -> bool:
    """Whether what an armature object reads of a data-block moves with the bones of another armature. Raises
    ValueError."""
    if not may_change(block):
        return False
    if not isinstance(block, bpy.types.Object) or block.type != "ARMATURE":
        raise curves.Refused(f"{ob.name} follows {block.name}, which may move")
    followers.check_place(block)
    if ob in dependencies.chain(block):
        raise curves.Refused(f"{ob.name} and {block.name} follow each other")
    return True


def may_change(block: Any) -> bool:
    """Whether time, or the pose of an armature, may change a data-block that nobody edits."""
    if isinstance(block, bpy.types.Object):
        return not followers.is_still(block, None)
    data = getattr(block, "animation_data", None)
    is_animated = data is not None and (data.action is not None or data.nla_tracks or data.drivers)
    return bool(is_animated) or isinstance(block, bpy.types.Scene)


def in_order(own: Iterable[rigs.Rig]) -> list[rigs.Rig]:
    """Returns armatures with each one after those that it follows."""
    by_key = {rig.key: rig for rig in own}
    order = {values.key_of(each): None for rig in by_key.values() for each in dependencies.chain(rig.ob)}
    return [by_key[key] for key in order if key in by_key]


def levels(own: Iterable[rigs.Rig]) -> Iterator[list[rigs.Rig]]:
    """Yields armatures that were read, those first that follow none of the others."""
    left = {rig.key: rig for rig in own}
    while left:
        ready = [rig for rig in left.values() if not any(link.leader.key in left for link in rig.source.links)]
        yield ready or list(left.values())
        left = {key: rig for key, rig in left.items() if ready and rig not in ready}


def inputs(rig: rigs.Rig, frames: Sequence[float]) -> dict[str, np.ndarray]:
    """Returns what those have on these frames that an armature follows, as RigProgram.evaluate takes it. Raises
    Unknown."""
    leaders = {link.leader.key: link.leader for link in rig.source.links}
    try:
        return {name: numbers for leader in leaders.values() for name, numbers in _of(leader, rig.source.links, frames)}
    except ValueError as reason:
        raise Unknown(str(reason)) from None


def _of(leader: rigs.Rig, links: Iterable[Link], frames: Sequence[float]) -> Iterator[tuple[str, np.ndarray]]:
    own = [link for link in links if link.leader is leader]
    program, times, given = leader.source.program, np.array(frames, np.float32), {}
    moments: list[Any] = [leader.at(frame) for frame in frames]
    if None in moments or any(link.bone < 0 for link in own):
        if program is None:
            raise Unknown(f"{leader.name}, which it follows, is not computed")
        given = inputs(leader, frames)
    is_known = None not in moments
    matrices = [poses.matrices_in(each.pose) for each in moments] if is_known else program.evaluate(times, given)
    for link in own:
        if link.bone < 0:
            yield link.name, program.values(times, [link.path], given)[:, 0]
        else:
            yield link.name, np.stack([targets.multiplied(link.world, each[link.bone]) for each in matrices])
