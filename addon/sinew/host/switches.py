"""Switches of the modifiers of evaluated objects. Through the API a change would count as an edit."""

import ctypes

from . import contract, proof

_VIEWPORT, _RENDER = 1, 2  # bits of a modifier's mode
_GROUPS, _ENVELOPES = 1, 2  # bits of an Armature modifier's way to bind


def bind_armature_modifier(modifier, groups, envelopes):
    """Whether an evaluated Armature modifier binds vertices through groups and through envelopes."""
    flags = ctypes.c_int16.from_address(contract.region(modifier, "ArmatureModifierData", "deformflag")[0])
    bits = _GROUPS * bool(groups) | _ENVELOPES * bool(envelopes)
    _write(
        "groups and envelopes",
        flags,
        flags.value & ~(_GROUPS | _ENVELOPES) | bits,
        lambda: (modifier.use_vertex_groups, modifier.use_bone_envelopes) == (bool(groups), bool(envelopes)),
    )


def mode_switch(modifier, viewport, render):
    """(address, bits to clear, bits to set) of an int32 that switch a modifier of an evaluated object, before its
    modifiers are evaluated."""
    return (
        contract.region(modifier, "ModifierData", "mode")[0],
        _VIEWPORT | _RENDER,
        _VIEWPORT * bool(viewport) | _RENDER * bool(render),
    )


def switch_modifier(modifier, viewport, render):
    """Shows or hides a modifier of an evaluated object, in the viewport and in renders."""
    address, clear, bits = mode_switch(modifier, viewport, render)
    mode = ctypes.c_int32.from_address(address)
    _write(
        "switches of modifiers",
        mode,
        mode.value & ~clear | bits,
        lambda: (modifier.show_viewport, modifier.show_render) == (bool(viewport), bool(render)),
    )


def _write(what, number, value, is_done):
    """is_done: function that says whether Blender's API shows what was written."""
    before, number.value = number.value, value
    if not proof.is_due(what) or before == value:
        return
    done = is_done()
    if not done:
        number.value = before
    proof.give(what, done, f"the bits of {what} have another meaning")
