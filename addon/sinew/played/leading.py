"""Rigs that follow bones of other rigs, as a rider follows a horse. The program of the one that follows is given what
the others have on each frame: what is known of that frame, or what their programs compute."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..blender import animation, dependencies, values
from ..description import curves, driver_rows, objects, other_data, rna_paths, targets
from ..host import poses
from . import followers, rigs


class Bone(NamedTuple):
    """A bone of a leader whose matrix is given."""

    number: int  # in the order of the pose
    read_as: targets.ReadAs | None  # how else than as a world matrix
    along: float  # see Targets.along
    length: float


class Leader(NamedTuple):
    """A rig that another one follows, and what the program of that one is given of it, by name."""

    rig: rigs.Rig
    world: np.ndarray  # (4, 4) float32, where it stands
    bones: dict[str, Bone]
    numbers: dict[str, str]  # paths of numbers


class Unknown(ValueError):
    """What a leader has on a frame is not known. The message is a sentence."""


def leaders_of(
    ob: bpy.types.Object, read: targets.Targets, numbers: driver_rows.Outside, graph: Any
) -> tuple[Leader, ...]:
    """Returns what an armature object follows that moves with other armatures. read, numbers: what it reads from
    outside. Raises ValueError, whose message is a sentence, for what moves otherwise, unless the program computes
    it."""
    found: dict[int, Leader] = {}

    def leader(block: bpy.types.Object) -> Leader:
        key = values.key_of(block)
        if key not in found:
            world = np.array(block.evaluated_get(graph).matrix_world, np.float32)
            found[key] = Leader(rigs.learn(block), world, {}, {})
        return found[key]

    placed = [each for each in read.outside.values() if each[1] or _moves_otherwise(each[0], read)]
    of_data = dict(numbers.of_data())
    for owner, path in numbers.owned.values():
        if isinstance(owner, bpy.types.Scene) and owner != graph.scene and owner.animation_data is not None:
            raise curves.Refused(
                f"{ob.name} reads {owner.name}, another scene, which has keyframes: let it read {graph.scene.name}"
            )
        why = "" if isinstance(owner, bpy.types.Object) else other_data.why_unknown(owner, path)
        if why:
            raise curves.Refused(f"{ob.name} reads {why}")
    of_objects = [each for name, each in numbers.read.items() if name not in of_data]
    animated = {block: tuple(map(rna_paths.normalised, animation.animated_paths(block))) for block, _path in of_objects}
    read_numbers = [(block, path) for block, path in of_objects if not _is_plain(path, animated[block])]
    is_led = _are_led(dict.fromkeys(block for block, _what in (*placed, *read_numbers)), ob)
    for name, (block, bone) in read.outside.items():
        if bone and is_led[block] and read.read_as.get(name) == targets.BASIS:
            raise curves.Refused(
                f"{ob.name} reads {bone} of {block.name}, which moves, in transform space: choose World Space"
            )
        if bone and is_led[block]:
            bones = block.pose.bones
            if (number := bones.find(bone)) < 0:
                raise curves.Refused(f"{ob.name} follows a bone of {block.name} that is not there: choose another one")
            length = bones[number].bone.length
            leader(block).bones[name] = Bone(number, read.read_as.get(name), read.along.get(name, 0), length)
    for name, (block, path) in numbers.read.items():
        path = rna_paths.normalised(path)
        if name not in of_data and is_led.get(block) and path.startswith(animated[block]):
            leader(block).numbers[name] = path
    return tuple(found.values())


def _moves_otherwise(ob: bpy.types.Object, read: targets.Targets) -> bool:
    """Whether time, or the pose of an armature, may change where an object is, so that the program does not compute
    it."""
    return ob.name_full not in read.moving and (ob.type == "ARMATURE" or objects.may_move(ob))


def _is_plain(path: str, animated: tuple[str, ...]) -> bool:
    """Whether what is read of an object is a custom property that nothing animates. animated: paths."""
    path = rna_paths.normalised(path)
    return path.startswith('["') and not path.startswith(animated)


def _are_led(blocks: Iterable[Any], ob: bpy.types.Object) -> dict[Any, bool]:
    """Returns whether what an armature object reads of each of these data-blocks moves with the bones of another
    armature. Raises ValueError."""
    blocks = list(blocks)
    moving = set(followers.not_still(blocks, None))
    led = [each for each in blocks if each in moving and each.type == "ARMATURE"]
    mutual = dependencies.reaching(led, dependencies.leaders_of, lambda each: each == ob)
    found = {each: each in moving for each in blocks}
    for block in (each for each in blocks if found[each]):
        if block not in led:
            why = objects.why_not(block)
            raise curves.Refused(f"{ob.name} follows {block.name}, which may move{why and ': ' + why}")
        followers.check_place(block)
        if block in mutual:
            raise curves.Refused(f"{ob.name} and {block.name} follow each other: have one of them alone follow")
    return found


def in_order(own: Iterable[rigs.Rig]) -> list[rigs.Rig]:
    """Returns armatures with each one after those that it follows."""
    by_key = {rig.key: rig for rig in own}
    order = map(values.key_of, dependencies.in_order(rig.ob for rig in by_key.values()))
    return [by_key[key] for key in order if key in by_key]


def levels(own: Iterable[rigs.Rig]) -> Iterator[list[rigs.Rig]]:
    """Yields armatures that were read, those first that follow none of the others."""
    left = {rig.key: rig for rig in own}
    while left:
        waiting = {key for key, rig in left.items() if any(each.rig.key in left for each in rig.source.leaders)}
        ready = left.keys() - waiting or left.keys()
        yield [rig for key, rig in left.items() if key in ready]
        left = {key: rig for key, rig in left.items() if key not in ready}


def inputs(rig: rigs.Rig, frames: Sequence[float]) -> dict[str, np.ndarray]:
    """Returns what those have on these frames that an armature follows, as RigProgram.evaluate takes it. Raises
    Unknown."""
    try:
        return {name: given for leader in rig.source.leaders for name, given in _given(leader, frames)}
    except ValueError as reason:
        raise Unknown(str(reason)) from None


def _given(leader: Leader, frames: Sequence[float]) -> Iterator[tuple[str, np.ndarray]]:
    program, times, given = leader.rig.source.program, np.array(frames, np.float32), {}
    moments: list[Any] = [leader.rig.at(frame) for frame in frames]
    if None in moments or leader.numbers:
        if program is None or not leader.rig.source.is_proven:
            raise Unknown(f"{leader.rig.name}, which it follows, is not native")
        given = inputs(leader.rig, frames)
    is_known = None not in moments
    found = np.array([poses.matrices_in(each.pose) for each in moments]) if is_known else program.evaluate(times, given)
    for read_as, along in dict.fromkeys((each.read_as, each.along) for each in leader.bones.values()):
        own = {name: each for name, each in leader.bones.items() if (each.read_as, each.along) == (read_as, along)}
        numbers, lengths = [each.number for each in own.values()], [each.length for each in own.values()]
        posed = targets.moved_along(found[:, numbers], lengths, along)  # (F, bones, 4, 4)
        if read_as is None or read_as == targets.HEAD:
            yield from zip(own, targets.multiplied(leader.world, posed.swapaxes(0, 1), read_as == targets.HEAD))
            continue
        if program is None:
            raise Unknown(f"{leader.rig.name}, which it follows, is not native")
        moved = found
        if along:
            moved = found.copy()
            moved[:, numbers] = posed
        yield from ((name, program.convert(moved, number, *read_as)) for name, number in zip(own, numbers))
    if leader.numbers:
        yield from zip(leader.numbers, program.values(times, list(leader.numbers.values()), given).T)
