"""Lists the memory that must be unchanged for the fast path, as a tree of Blender's structs."""

from collections.abc import Sequence
from typing import Any

from . import contract, features, key_blocks, keyframes, marks

_ARMATURE_MODIFIER = "*object", "deformflag", "multi", "defgrp_name"
# For each type of modifier: the feature that needs the members on which its stage depends.
_STAGES = {"CORRECTIVE_SMOOTH": features.FAST_CORRECTIVE, "SMOOTH": features.FAST_SMOOTH}


def can_watch(modifier_type: str) -> bool:
    """Whether everything that the stage of a modifier of this type depends on can be watched."""
    return modifier_type == "ARMATURE" or modifier_type in _STAGES and contract.has(_STAGES[modifier_type])


class Tree:
    """The structs of Blender that a shortcut depends on. A struct is read only after something in an earlier one was
    found unchanged: the pointer that leads to it, or the mark of the data-block that owns it. Whatever adds to the tree
    raises contract.Broken if a part of Blender's memory is not what Sinew expects."""

    def __init__(self, ob: Any) -> None:
        """ob: an evaluated object, which exists whenever Blender calls for it."""
        self.structs: list[tuple[int, int, int, list[tuple[int, int]]]] = []  # as sinew_native.host.Shortcut takes them
        # Addresses of the armatures' marks. A mark may be lost while the bones stay as they are.
        self.bones: list[int] = []
        mark = marks.mark_region(ob, "OBJECT")
        origin = contract.region(ob, "ID", "*orig_id")
        mode = contract.region(ob, "Object", "mode")
        self._add_actions(ob, self._add(ob, [mark, origin, mode], -1, 0), 0)

    def _add(self, struct: Any, regions: list[tuple[int, int]], parent: int, voucher: int) -> int:
        """Adds a struct. regions: [(address, size)]; parent: number of a struct; voucher: which of its regions shows
        that this one exists. Returns the struct's number."""
        start = struct.as_pointer()
        self.structs.append((start, parent, voucher, [(address - start, size) for address, size in regions]))
        return len(self.structs) - 1

    def _add_actions(self, block: Any, owner: int, voucher: int) -> None:
        """Adds the actions that animate a data-block: with other F-curves, they may change what was read of it. owner:
        number of its struct; voucher: which of its regions shows that it has the same animation data."""
        for played in keyframes.actions_of(block):
            link = self._add(
                played.holder, [contract.region(played.holder, played.kind, played.member)], owner, voucher
            )
            self._add(played.action, [marks.mark_region(played.action, "ACTION")], link, 0)

    def _add_owned(self, struct: Any, regions: list[tuple[int, int]]) -> int:
        """Adds a struct that Blender copies and frees together with the object."""
        return self._add(struct, regions, 0, 0)

    def add_mesh(self, target: Any, mesh: Any, has_keys: bool) -> None:
        """Adds the mesh before all modifiers. target: the driver target of the hook's variable "mesh"."""
        link = self._add_owned(target, [contract.region(target, "DriverTarget", "*id")])
        mark = marks.mark_region(mesh, "MESH")
        if not has_keys:
            self._add_actions(mesh, self._add(mesh, [mark], link, 0), 0)
            return
        data = self._add(mesh, [mark, contract.region(mesh, "Mesh", "*key")], link, 0)
        self._add_actions(mesh, data, 0)
        keys = mesh.shape_keys
        self._add_actions(keys, self._add(keys, [marks.mark_region(keys, "KEY")], data, 1), 0)

    def add_canvas(self, target: Any, mesh: Any) -> None:
        """Adds a canvas and its result. target: the driver target of the hook's variable "canvas"."""
        link = self._add_owned(target, [contract.region(target, "DriverTarget", "*id")])
        canvas = target.id
        held = self._add(canvas, [contract.region(canvas, "Object", "*data")], link, 0)
        self._add(mesh, [marks.mark_region(mesh, "MESH")], held, 0)

    def add_modifier(self, modifier: Any) -> None:
        """Adds an evaluated modifier of a type that can be watched, with its armature if it has one."""
        if modifier.type == "ARMATURE":
            self._add_armature(modifier)
            return
        needed = features.needs(_STAGES[modifier.type])
        self._add_owned(modifier, [contract.region(modifier, kind, name) for kind, name in needed])

    def _add_armature(self, modifier: Any) -> None:
        armature, data = modifier.object, modifier.object.data
        settings = [contract.region(modifier, "ArmatureModifierData", name) for name in _ARMATURE_MODIFIER]
        owner = self._add_owned(modifier, settings)
        mode = contract.region(armature, "Object", "mode")
        link = contract.region(armature, "Object", "*data")
        posed = self._add(armature, [link, mode], owner, 0)
        flag = contract.region(data, "bArmature", "flag")
        mark = marks.mark_region(data, "ARMATURE")
        if keyframes.actions_of(data):  # a copy without the mark may have others
            self._add_actions(data, self._add(data, [flag, mark], posed, 0), 1)
        else:
            self._add(data, [flag], posed, 0)
        self.bones.append(mark[0])


def key_source(block: Any, relative: Sequence[int], base: Any) -> tuple[list[int], tuple[int, ...], Sequence[int], Any]:
    """Returns the `keys` of `sinew_native.host.Shortcut` for an evaluated key data-block: addresses, layout, and what
    to restore after a frame. relative: as key_blocks.relative_numbers returned them; base: points of the first key."""
    return key_blocks.key_addresses(block).tolist(), key_blocks.key_layout(), relative, base
