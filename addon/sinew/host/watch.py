"""Lists the regions of memory that must be unchanged for the fast path. They are ordered: a region comes after those
that show that it still exists."""

from typing import Any

from . import contract, key_blocks, marks, places

_ARMATURE_MODIFIER = "deformflag", "multi", "defgrp_name", "*object"
# For each type of modifier: its struct, and the members that its stage depends on.
_STAGES = {
    "CORRECTIVE_SMOOTH": (
        "CorrectiveSmoothModifierData",
        ("lambda", "scale", "repeat", "flag", "smooth_type", "rest_source", "defgrp_name"),
    ),
    "SMOOTH": ("SmoothModifierData", ("fac", "repeat", "flag", "defgrp_name")),
}


def can_watch(modifier_type: str) -> bool:
    """Whether everything that the stage of a modifier of this type depends on can be watched."""
    return modifier_type in _STAGES


def of_object(ob: Any, target: Any, mesh: Any, has_keys: bool) -> list[tuple[int, int]]:
    """Returns [(address, size)] of an evaluated object. target: the driver target of the hook's variable "mesh"; mesh:
    the mesh that it refers to, before all modifiers."""
    found = [
        marks.mark_region(ob, "OBJECT"),
        contract.region(ob, "ID", "*orig_id"),
        contract.region(ob, "Object", "mode"),
        *places.place_regions(ob),
        contract.region(target, "DriverTarget", "*id"),
        marks.mark_region(mesh, "MESH"),
    ]
    if has_keys:
        found += [contract.region(mesh, "Mesh", "*key"), marks.mark_region(mesh.shape_keys, "KEY")]
    return found


def of_armature(modifier: Any) -> list[tuple[int, int]]:
    """Returns [(address, size)] of an evaluated Armature modifier and of its armature."""
    armature = modifier.object
    return [
        *(contract.region(modifier, "ArmatureModifierData", name) for name in _ARMATURE_MODIFIER),
        *places.place_regions(armature),
        contract.region(armature, "Object", "mode"),
        contract.region(armature, "Object", "*data"),
        marks.mark_region(armature.data, "ARMATURE"),
        contract.region(armature.data, "bArmature", "flag"),
    ]


def of_stage(modifier: Any) -> list[tuple[int, int]]:
    """Returns [(address, size)] of an evaluated modifier of a type that can be watched."""
    struct, members = _STAGES[modifier.type]
    return [contract.region(modifier, struct, name) for name in members]


def key_source(block: Any) -> tuple[list[int], tuple[int, ...]]:
    """Returns the `keys` of `sinew_native.host.Shortcut` for an evaluated key data-block: addresses and layout."""
    return key_blocks.key_addresses(block).tolist(), key_blocks.key_layout()
