"""Lists the actions that animate a data-block."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple


class Played(NamedTuple):
    """An action that animates a data-block."""

    action: Any
    slot: Any  # of the action: the slot, its number, or None
    holder: Any  # AnimData or NlaStrip
    kind: str  # of the holder's struct
    member: str  # of the holder's struct, which leads to the action


def of(block: Any) -> list[Played]:
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
