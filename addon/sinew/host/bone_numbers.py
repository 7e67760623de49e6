"""Reads the numbers of all bones of an armature, of its pose and of its data, in one step each, and what they have."""

import functools
from typing import Any, NamedTuple

import numpy as np

from ..native import sinew_native
from . import contract, features, poses, proof
from .members import BEND, LIMITS, REST

_FLOAT, _ADDRESS = 4, 8  # bytes
# By the member: what Blender's API calls it, or its parts.
_POSED = {member: (name,) for member, (name, _skipped) in poses.NAMES.items()} | LIMITS
_REST = {member: (name,) for member, name in REST.items()} | {member: _POSED[member] for member in BEND}
_ADDRESSES = {
    "bPoseChannel": ("*next", "*parent", "constraints", "*prop"),
    "Bone": ("*prop",),
}  # of the first of a list


class Numbers(NamedTuple):
    """What N bones have: numbers, (N, F) float32; which columns are those of a property; addresses, (N, A) uint64."""

    floats: np.ndarray
    columns: dict[str, slice]
    addresses: np.ndarray

    def of(self, name: str) -> np.ndarray:
        """Returns a property of all bones: N, or N x the numbers that it has."""
        own = self.columns[name]
        return self.floats[:, own if own.stop - own.start > 1 else own.start]

    def have_properties(self) -> np.ndarray:
        """Returns which bones may have custom properties."""
        return self.addresses[:, -1] != 0


@functools.cache
def _layout(kind: str) -> tuple[Any, dict[str, slice], int]:
    """Returns what is read of a struct of bones, the columns, and how many there are."""
    regions = [(contract.offset(kind, name), _ADDRESS) for name in _ADDRESSES[kind]]
    columns, count = dict[str, slice](), 0
    for member, names in (_POSED if kind == "bPoseChannel" else _REST).items():
        regions.append((contract.offset(kind, member), contract.size(kind, member)))
        width = regions[-1][1] // _FLOAT // len(names)
        for name in names:
            columns[name] = slice(columns[name].start if name in columns else count, count + width)
            count += width
    children = contract.offset("Bone", "childbase") + contract.offset("ListBase", "*first")
    lists = [(children, None)] if kind == "Bone" else []
    return sinew_native.host.Described(regions, [], [], lists), columns, count


def read(ob: Any) -> tuple[Numbers, Numbers] | None:
    """Returns what the bones of an original armature object's pose have, and those of its data, in the order of the
    collections in the API. None if it cannot be read."""
    if not contract.has(features.NUMBERS) or not len(ob.pose.bones):
        return None
    posed, rest = (_read(kind, bones) for kind, bones in (("bPoseChannel", ob.pose.bones), ("Bone", ob.data.bones)))
    if proof.is_due("numbers of bones"):
        if not (
            _is_shown(posed, ob.pose.bones) and _is_shown(rest, ob.data.bones) and _are_related(posed, ob.pose.bones)
        ):
            contract.distrust(features.NUMBERS, "the numbers of bones are not where they were")
            return None
        proof.give("numbers of bones")
    return posed, rest


def _read(kind: str, bones: Any) -> Numbers:
    described, columns, count = _layout(kind)
    before = _ADDRESS * len(_ADDRESSES[kind])
    stream = described.bytes_of_list(bones[0].as_pointer(), marks=False)
    found = np.frombuffer(stream, np.uint8).reshape(-1, before + _FLOAT * count)
    return Numbers(found[:, before:].view(np.float32), columns, found[:, :before].view(np.uint64))


def parents(posed: Numbers) -> list[int]:
    """Returns the number of the parent of each bone of a pose, -1 for none."""
    following, of_parents = posed.addresses[:, :2].T.tolist()
    places = {0: -1, **dict(zip(following[:-1], range(1, len(following))))}  # of all but the first bone
    return [places.get(address, 0) for address in of_parents]


def have_constraints(posed: Numbers) -> list[bool]:
    """Returns which bones of a pose have constraints."""
    return (posed.addresses[:, 2] != 0).tolist()


def _are_related(posed: Numbers, bones: Any) -> bool:
    """Whether the API shows the same parents of all bones, and constraints of the same bones."""
    names = [*bones.keys(), None]
    return all(
        (names[parent] == (bone.parent and bone.parent.name)) and has == (len(bone.constraints) > 0)
        for parent, has, bone in zip(parents(posed), have_constraints(posed), bones)
    )


def _is_shown(found: Numbers, bones: Any) -> bool:
    """Whether the API shows the numbers of the last bone, and custom properties only where they may be."""
    if len(found.floats) != len(bones):
        return False
    wanted = [(own, np.array(getattr(bones[-1], name), np.float32).T.ravel()) for name, own in found.columns.items()]
    return all(np.array_equal(found.floats[-1, own], one, equal_nan=True) for own, one in wanted) and all(
        may_have or not bone.keys() for may_have, bone in zip(found.have_properties().tolist(), bones)
    )
