"""Lists the actions that animate a data-block, and reads the keyframes of all F-curves of an action in one step."""

import ctypes
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..native import sinew_native
from . import contract, features, proof

_MEMBERS = ("vec", "ipo", "easing", "back", "amplitude", "period")  # all that values between keyframes depend on
_OF_CURVE = ("*bezt", "totvert", "*rna_path", "modifiers", "*fpt", "extend", "array_index", "flag")
_IGNORED = 0b1111  # bits of a curve's flag: visible, selected, active, protected
_ROUNDED = 1 << 11  # a bit of a curve's flag


class Played(NamedTuple):
    """An action that animates a data-block."""

    action: Any
    slot: Any  # of the action: the slot, its number, or None
    holder: Any  # AnimData or NlaStrip
    kind: str  # of the holder's struct
    member: str  # of the holder's struct, which leads to the action


def actions_of(block: Any) -> list[Played]:
    """Returns the actions of a data-block: its own, the one that tweak mode has put aside, and those of NLA strips."""
    data = block.animation_data
    if data is None:
        return []
    found = [
        Played(data.action, getattr(data, "action_slot", None), data, "AnimData", "*action"),
        Played(
            getattr(data, "action_tweak_storage", None),  # before 4.0 the API does not show it
            getattr(data, "action_slot_handle_tweak_storage", None),
            data,
            "AnimData",
            "*tmpact",
        ),
    ]
    for track in data.nla_tracks:
        for strip in _all_strips(track.strips):
            found.append(Played(strip.action, getattr(strip, "action_slot", None), strip, "NlaStrip", "*act"))
    return [each for each in found if each.action is not None]


def _all_strips(strips: Iterable[Any]) -> Iterator[Any]:
    """Yields strips, with those inside meta strips."""
    for strip in strips:
        yield strip
        yield from _all_strips(strip.strips)


@contract.kept
def _layout() -> Any:
    """Returns the layout of F-curves, a sinew_native.host.CurveLayout."""
    vectors = contract.offset("BezTriple", "vec")  # of (handle, keyframe, handle), each (frame, value, 0)
    return sinew_native.host.CurveLayout(
        *(contract.offset("FCurve", name) for name in _OF_CURVE),
        _IGNORED,
        contract.struct_size("BezTriple"),
        vectors + 12,
        [(contract.offset("BezTriple", name), contract.size("BezTriple", name)) for name in _MEMBERS],
    )


def is_rounded(curve: Any) -> bool:
    """Whether Blender rounds what an F-curve gives, as it does for whole numbers, switches and choices that were keyed,
    but not for curves that drivers have or that scripts have made."""
    address = curve.as_pointer() + contract.offset("FCurve", "flag")
    return bool(ctypes.c_int16.from_address(address).value & _ROUNDED)


def read(curves: Sequence[Any]) -> Any:
    """Returns a copy of what is stored in F-curves of originals, a sinew_native.host.StoredCurves: all that their
    values depend on, without selection and the like. Raises contract.Broken."""
    found = sinew_native.host.StoredCurves([curve.as_pointer() for curve in curves], _layout())
    if proof.is_due("keyframes"):
        number, curve = next(((i, each) for i, each in enumerate(curves) if len(each.keyframe_points)), (0, None))
        if curve is not None:
            wanted = np.empty(2 * len(curve.keyframe_points), np.float32)
            curve.keyframe_points.foreach_get("co", wanted)
            path = curve.data_path.encode() + b"\0"
            if not (np.array_equal(wanted[::2], found.frames(number)) and found.settings(number).startswith(path)):
                raise contract.distrust(features.PLAYING, "keyframes are not where they were")
            proof.give("keyframes")
    return found
