"""Writes switches of evaluated objects' modifiers and drivers by address, and copies modifiers as a whole.

Through the API, a change of a switch would count as an edit. A modifier that Sinew replaces is switched off by a bit of
its own, with which Blender disables a modifier for a while. Its switches for viewport and renders are left to the user,
and to drivers and keyframes, which may set them on each frame: so they can be read in each evaluation.

The API does not show all settings of modifiers. A Mirror that was made before Blender 3.0 merges the vertices in
another order, in each newer Blender, too."""

import ctypes
from collections.abc import Callable
from typing import Any

import bpy

from . import contract, features, layout, members, proof

_VIEWPORT, _RENDER = 1, 2  # bits of a modifier's mode
SWITCHES = _VIEWPORT | _RENDER
_ASIDE = 1 << 31  # a bit of a modifier's mode: Blender does not evaluate it, whatever its switches are
_MUTED = 1 << 4  # a bit of an F-curve's flag
_WEIGHTS = "edge_weight_name", "vertex_weight_name"  # attributes
# What every modifier has, such as its name and switches; what Blender writes when it evaluates one; and the names of
# vertex groups and attributes, all of which the API shows.
_WITHOUT = "modifier", "face_count", "defgrp_name", "shell_defgrp_name", "rim_defgrp_name", "vgroup", *_WEIGHTS


def mute_driver(curve: Any) -> None:
    """Mutes a driver of an evaluated object, until Blender copies the object again. Also from that driver. Does nothing
    if that is not known to work."""
    if not contract.has(features.MUTING):
        return
    flag = ctypes.c_int16.from_address(contract.region(curve, "FCurve", "flag")[0])
    _write("muted drivers", flag, flag.value | _MUTED, (True,), lambda: (curve.mute,), features.MUTING)


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


def aside_switch(modifier: Any) -> tuple[int, int, int]:
    """Returns what to change to keep Blender from evaluating a modifier of an evaluated object, as mode_switch."""
    return contract.region(modifier, "ModifierData", "mode")[0], 0, ctypes.c_int32(_ASIDE).value


def put_aside(modifier: Any, is_aside: bool) -> None:
    """Keeps Blender from evaluating a modifier of an evaluated object, or lets it. Call only if can_put_aside()."""
    mode = ctypes.c_uint32.from_address(contract.region(modifier, "ModifierData", "mode")[0])
    mode.value = mode.value | _ASIDE if is_aside else mode.value & ~_ASIDE


def is_aside(modifier: Any) -> bool:
    """Whether put_aside keeps Blender from evaluating a modifier of an evaluated object."""
    return bool(ctypes.c_uint32.from_address(contract.region(modifier, "ModifierData", "mode")[0]).value & _ASIDE)


def can_put_aside() -> bool:
    """Whether put_aside was seen to work, see prove."""
    return not proof.is_due("the bit that disables modifiers")


def prove() -> None:
    """Compares with the API what put_aside does. Call it in the main thread. Stops all access to Blender's memory if it
    does something else."""
    if can_put_aside() or contract.trouble():
        return
    scene = bpy.data.scenes[0]
    with layout.temporary_data() as data:
        ob = data.objects.new("", data.meshes.new(""))
        modifier = ob.modifiers.new("", "CAST")
        found = []
        for is_aside in (False, True, False):
            put_aside(modifier, is_aside)
            found.append([ob.is_deform_modified(scene, kind) for kind in ("PREVIEW", "RENDER")])
    is_same = found == [[True, True], [False, False], [True, True]]
    try:
        proof.give("the bit that disables modifiers", is_same, "the bit that disables modifiers has another meaning")
    except contract.Broken:
        pass  # contract.trouble() tells


def _write(
    what: str,
    number: ctypes.c_int16 | ctypes.c_int32,
    value: int,
    wanted: tuple[bool, ...],
    shown: Callable[[], tuple[bool, ...]],
    feature: str = features.DEFORMING,
) -> None:
    """Writes a number whose bits are switches. Compares the result with the API until each bit was seen to change.

    wanted: the values that the bits stand for; shown: a function that returns these values from Blender's API; feature:
    what is lost if they differ. Raises contract.Broken then."""
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
        raise contract.distrust(feature, f"the bits of {what} have another meaning")
    if all(old != new for old, new in zip(shown_before, wanted)):
        proof.give((what, wanted))


def can_copy() -> bool:
    """Whether modifiers can be copied as a whole in this Blender."""
    return contract.has(features.WHOLE)


def read_settings(modifier: Any) -> bytes:
    """Returns the settings of a modifier except those that every modifier has, and other data-blocks. Two modifiers of
    one type have the same if these bytes are equal; they may differ for equal ones, by bytes that do not matter. b"" if
    this cannot be told."""
    return b"".join(ctypes.string_at(*each) for each in _regions(modifier))


def copy_settings(modifier: Any, made: Any) -> None:
    """Gives a modifier, which is new, these settings of another one of its type, whose shown settings it has already.
    Raises contract.Broken if they are not the same any more."""
    own = _regions(modifier)
    if not own or read_settings(modifier) == read_settings(made):
        return
    shown = _shown(made)
    for (start, size), (to, _size) in zip(own, _regions(made)):
        ctypes.memmove(to, start, size)
    if _shown(made) != shown:
        raise contract.distrust(
            features.WHOLE, f"the settings of {members.MODIFIERS[made.type]} are not where they were"
        )


def _regions(modifier: Any) -> list[tuple[int, int]]:
    """Returns [(address, size)]."""
    kind = members.MODIFIERS.get(modifier.type)
    if kind is None or not can_copy():
        return []
    address = modifier.as_pointer()
    return [(address + offset, size) for offset, size in contract.plain_regions(kind, *_WITHOUT)]


def _shown(modifier: Any) -> list[str]:
    """What Blender's API shows of a modifier."""
    return [f"{name} {getattr(modifier, name)!r}" for name in modifier.bl_rna.properties.keys()]
