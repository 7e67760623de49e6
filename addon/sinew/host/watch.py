"""What has to be as it was for a frame that takes the shorter way: regions of memory, in an order in which none is read
before those that say that it is still there."""

from . import contract, key_blocks, marks, places

_ARMATURE_MODIFIER = "deformflag", "multi", "defgrp_name", "*object"
# By type of modifier: its struct, and what decides on its stage.
_STAGES = {
    "CORRECTIVE_SMOOTH": (
        "CorrectiveSmoothModifierData",
        ("lambda", "scale", "repeat", "flag", "smooth_type", "rest_source", "defgrp_name"),
    ),
    "SMOOTH": ("SmoothModifierData", ("fac", "repeat", "flag", "defgrp_name")),
}


def can_watch(modifier_type):
    """Whether all that decides on the stage of a modifier of that type can be watched."""
    return modifier_type in _STAGES


def of_object(ob, target, mesh, has_keys):
    """[(address, size)] of an evaluated object. target: of the hook's variable "mesh"; mesh: what it names, as it is
    before all modifiers."""
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


def of_armature(modifier):
    """[(address, size)] of an evaluated Armature modifier and of its armature."""
    armature = modifier.object
    return [
        *(contract.region(modifier, "ArmatureModifierData", name) for name in _ARMATURE_MODIFIER),
        *places.place_regions(armature),
        contract.region(armature, "Object", "mode"),
        contract.region(armature, "Object", "*data"),
        marks.mark_region(armature.data, "ARMATURE"),
        contract.region(armature.data, "bArmature", "flag"),
    ]


def of_stage(modifier):
    """[(address, size)] of an evaluated modifier of a type that can be watched."""
    struct, members = _STAGES[modifier.type]
    return [contract.region(modifier, struct, name) for name in members]


def key_source(block):
    """What `sinew_native.host.Shortcut` takes of an evaluated key data-block."""
    return key_blocks.key_addresses(block).tolist(), key_blocks.key_layout()
