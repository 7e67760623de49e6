"""Whether Sinew uses Blender's memory at all, and what it says of that: in the console, the panel and the command line.

Without, all of what is in host/features.py is done in the next slower way, as in a Blender that Sinew does not know.
"""

import logging
import os
import sys
from typing import Any

import bpy

from ..host import contract, features, places
from ..native import VERSION
from . import addon_preferences

log = logging.getLogger("sinew")
SAFE = "SINEW_SAFE"  # in the environment: anything but 0 keeps Sinew from Blender's memory
_is_said = False  # in the console


def _why_not() -> tuple[str, str] | None:
    """Returns why Sinew may not use Blender's memory, and what to do about it, as clauses; or None."""
    if os.environ.get(SAFE, "0") not in {"", "0"}:
        return f"{SAFE} is set", "start Blender without it"
    preferences = addon_preferences.of_sinew()
    if preferences is not None and not preferences.uses_memory:
        return "Use Blender's Memory is off", "switch it on in Sinew's preferences"
    return None


def decide() -> None:
    """Has Sinew use Blender's memory, or do without it from now on. Call it in the main thread."""
    reason = _why_not()
    if reason is not None:
        contract.forbid(*reason)
    else:
        contract.permit()
    places.place_layout.cache_clear()


def facts() -> dict[str, Any]:
    """Returns the versions, the features of Blender's memory that are on and off, and why they are, for a report. Call
    it in the main thread."""
    off = contract.off()
    return {
        "sinew": VERSION,
        "blender": bpy.app.version_string,
        "on": [feature for feature in features.FEATURES if feature not in off],
        "off": off,
        "why": contract.sentences(),
    }


def states() -> tuple[str, str]:
    """Returns the versions, and what is on and off, as two lines of text. Call it in the main thread."""
    found = facts()
    on, off = (len(found[name]) for name in ("on", "off"))
    text = f"all {on} features on"
    if off and not on:
        text = f"none of {off} features on"
    elif off:
        text = f"{on} of {on + off} features on, without {', '.join(found['off'])}"
    return f"Sinew {VERSION} in Blender {bpy.app.version_string}", f"Blender's memory: {text}"


def sentence() -> str:
    """Returns the same, and why anything is off, as one line."""
    return "; ".join((*states(), *contract.sentences()))


def say_at_start() -> None:
    """Writes this once into the console, and into the log file if there is one: reports of crashes show it."""
    global _is_said
    if _is_said:
        return
    _is_said = True
    line = sentence()
    print(line, file=sys.stderr, flush=True)
    for handler in log.handlers:  # whatever level is logged
        handler.handle(log.makeRecord(log.name, logging.INFO, __file__, 0, line, (), None))


def register() -> None:
    global _is_said
    _is_said = False
    decide()


def unregister() -> None:
    """Does nothing: what is forbidden stays so."""
