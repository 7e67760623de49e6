"""Which deforming bone carries which, as an animator sees it: in many rigs deforming bones hang on controls."""

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np

_COPYING = {"COPY_TRANSFORMS", "COPY_LOCATION", "COPY_ROTATION", "ARMATURE", "CHILD_OF"}
_LEAST = 0.5  # the influence of a constraint that counts
_SAME = 1e-4  # two bones begin at one place if they are nearer than this share of a bone's length,
_ALIKE = 0.999  # and point alike if the cosine between them is more than this


def of(armature: bpy.types.Object) -> dict[str, str]:
    """Returns {bone: the bone that carries it} of an armature object's deforming bones, without those that none
    carries. No bone carries itself, directly or not.

    That is the parent if it deforms. Otherwise it is the nearest on the way up, through the targets of constraints that
    copy, and parents. On that way, any bone counts as the deforming bone that lies in it at rest: of several, the one
    that follows it."""
    bones = armature.data.bones
    followed = {bone.name: [*_followed(armature, bone)] for bone in armature.pose.bones}
    deforming = [bone.name for bone in bones if bone.use_deform]
    stands_for = {name: name for name in deforming}
    alike = {name: found - stands_for.keys() for name, found in _alike(bones, deforming)}
    for name in deforming:
        for other in _upwards([name], followed):
            if other in alike[name]:
                stands_for.setdefault(other, name)
    for name in deforming:
        for other in alike[name]:
            stands_for.setdefault(other, name)
    found: dict[str, str] = {}

    def nearest(name: str, begin: list[str]) -> str | None:
        for other in _upwards(begin, followed):
            own = stands_for.get(other, name)
            if own != name and name not in _above(own, found):
                return own
        return None

    for name in deforming:  # first, as all others look at them
        parent = bones[name].parent
        if parent is not None and parent.use_deform:
            found[name] = parent.name
    for name in deforming:
        own = None if name in found else nearest(name, followed[name])
        if own is not None:
            found[name] = own
    for name in deforming:  # a parent that carries all, such as a root, counts less than what a constraint follows
        parent = bones[name].parent
        own = nearest(name, [each for each in followed[name] if parent is None or each != parent.name])
        if own is not None and found.get(name) in _above(own, found):
            found[name] = own
    return found


def carried(armature: bpy.types.Object) -> dict[str, list[str]]:
    """Returns for each deforming bone all deforming bones that go with it when it is turned, itself first."""
    carrier = of(armature)
    found: dict[str, list[str]] = {bone.name: [bone.name] for bone in armature.data.bones if bone.use_deform}
    for name in found:
        for above in _above(name, carrier):
            found[above].append(name)
    return found


def _followed(armature: bpy.types.Object, bone: Any) -> Iterator[str]:
    """Yields the bones of the same armature that a pose bone follows: the last constraint wins, so its target first."""
    for constraint in reversed(bone.constraints):
        if constraint.type in _COPYING and not constraint.mute and constraint.influence >= _LEAST:
            targets = constraint.targets if constraint.type == "ARMATURE" else [constraint]
            for each in sorted(targets, key=lambda one: -getattr(one, "weight", 1)):
                if each.target == armature and each.subtarget in armature.pose.bones:
                    yield each.subtarget
    if bone.parent is not None:
        yield bone.parent.name


def _upwards(begin: list[str], followed: dict[str, list[str]]) -> Iterator[str]:
    """Yields bones, and what they follow, the nearest first."""
    queue = list(dict.fromkeys(begin))
    seen = set(queue)
    for name in queue:
        yield name
        new = [each for each in dict.fromkeys(followed[name]) if each not in seen]
        queue += new
        seen.update(new)


def _alike(bones: Any, names: list[str]) -> Iterator[tuple[str, set[str]]]:
    """Yields each of the bones of these names with those that begin where it does at rest, and point as it does."""
    heads, tails = (np.empty((len(bones), 3), np.float32) for _ in range(2))
    bones.foreach_get("head_local", heads.reshape(-1))
    bones.foreach_get("tail_local", tails.reshape(-1))
    every, lengths = [bone.name for bone in bones], np.linalg.norm(tails - heads, axis=1)
    directions = (tails - heads) / np.maximum(lengths, np.finfo(np.float32).tiny)[:, None]
    place = {name: number for number, name in enumerate(every)}
    for name in names:
        own = place[name]
        is_here = np.linalg.norm(heads - heads[own], axis=1) <= _SAME * lengths[own]
        yield name, {every[other] for other in np.flatnonzero(is_here & (directions @ directions[own] > _ALIKE))}


def _above(name: str, carrier: dict[str, str]) -> list[str]:
    """Returns the bones that carry one, the nearest first."""
    found = []
    while (above := carrier.get(name)) is not None:
        found.append(above)
        name = above
    return found
