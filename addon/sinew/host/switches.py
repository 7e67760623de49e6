"""Writes switches of evaluated objects' modifiers by address. Through the API, a change would count as an edit."""

import ctypes
from collections.abc import Callable
from typing import Any

from . import contract, proof

_VIEWPORT, _RENDER = 1, 2  # bits of a modifier's mode
_GROUPS, _ENVELOPES = 1, 2  # bits of an Armature modifier's deformflag


def bind_armature_modifier(modifier: Any, groups: bool, envelopes: bool) -> None:
    """Sets whether an evaluated Armature modifier uses vertex groups and bone envelopes."""
    flags = ctypes.c_int16.from_address(contract.region(modifier, "ArmatureModifierData", "deformflag")[0])
    bits = _GROUPS * bool(groups) | _ENVELOPES * bool(envelopes)
    _write(
        "groups and envelopes",
        flags,
        flags.value & ~(_GROUPS | _ENVELOPES) | bits,
        (bool(groups), bool(envelopes)),
        lambda: (modifier.use_vertex_groups, modifier.use_bone_envelopes),
    )


def mode_switch(modifier: Any, viewport: bool, render: bool) -> tuple[int, int, int]:
    """Returns what to change to show or hide a modifier of an evaluated object, before its modifiers are evaluated: the
    address of an int32, the bits to clear and the bits to set."""
    return (
        contract.region(modifier, "ModifierData", "mode")[0],
        _VIEWPORT | _RENDER,
        _VIEWPORT * bool(viewport) | _RENDER * bool(render),
    )


def switch_modifier(modifier: Any, viewport: bool, render: bool) -> None:
    """Shows or hides a modifier of an evaluated object, in the viewport and in renders."""
    address, clear, bits = mode_switch(modifier, viewport, render)
    mode = ctypes.c_int32.from_address(address)
    _write(
        "switches of modifiers",
        mode,
        mode.value & ~clear | bits,
        (bool(viewport), bool(render)),
        lambda: (modifier.show_viewport, modifier.show_render),
    )


def _write(
    what: str,
    number: ctypes.c_int16 | ctypes.c_int32,
    value: int,
    wanted: tuple[bool, bool],
    shown: Callable[[], tuple[bool, bool]],
) -> None:
    """Writes a number whose bits are switches. Compares the result with the API until each bit was seen to change.

    wanted: the values that the bits stand for; shown: a function that returns these values from Blender's API."""
    before = number.value
    if before == value:
        return
    if not proof.is_due((what, wanted)):
        number.value = value
        return
    shown_before = shown()
    number.value = value
    is_done = shown() == wanted
    if not is_done:
        number.value = before
        raise contract.distrust(f"the bits of {what} have another meaning")
    if all(old != new for old, new in zip(shown_before, wanted)):
        proof.give((what, wanted))
