"""Whether Sinew uses Blender's memory at all, and what it says of that: in the console, the panel and the command line.
It does not if somebody wants it so, or since Blender crashed while it did (crash_files.py).

Without, all of what is in host/features.py is done in the next slower way, as in a Blender that Sinew does not know.
"""

import atexit
import logging
import os
import sys
from pathlib import Path
from typing import Any

import bpy

from ..feedback import notice
from ..host import contract, features
from ..native import VERSION
from . import addon_preferences, crash_files

log = logging.getLogger("sinew")
SAFE = "SINEW_SAFE"  # in the environment: anything but 0 keeps Sinew from Blender's memory
BLENDER = ".".join(map(str, bpy.app.version))
_is_said = False  # in the console
_is_new = False  # a crash that was found at this start
_has_crashed = False  # and nobody wanted to try again
_watch: crash_files.Watch | None = None


def _why_not() -> tuple[str, str] | None:
    """Returns why Sinew may not use Blender's memory, and what to do about it, as clauses; or None."""
    if os.environ.get(SAFE, "0") not in {"", "0"}:
        return f"{SAFE} is set", "start Blender without it"
    preferences = addon_preferences.of_sinew()
    if preferences is not None and not preferences.uses_memory:
        return "Use Blender's Memory is off", "switch it on in Sinew's preferences"
    if _has_crashed:
        return f"Blender {BLENDER} crashed while Sinew used its memory", "press Try Again in Sinew's preferences"
    return None


def decide() -> None:
    """Has Sinew use Blender's memory, or do without it from now on. Call it in the main thread."""
    global _watch
    reason = _why_not()
    if reason is not None:
        contract.forbid(*reason)
        _end_watch()
    else:
        contract.permit()
        if _watch is None:
            _watch = _begin_watch()


def has_crashed() -> bool:
    """Whether this Blender crashed while Sinew used its memory, and nobody has tried again."""
    return _has_crashed


def try_again() -> None:
    """Forgets that this Blender crashed. `decide` then decides anew."""
    global _has_crashed
    folder = _folder()
    if folder is not None:
        crash_files.forgive(folder, BLENDER)
    _has_crashed = False


def _folder() -> Path | None:
    """Returns Sinew's own folder among the user's files, or None if there can be none."""
    try:
        if addon_preferences.ADDON.startswith("bl_ext."):
            path = bpy.utils.extension_path_user(addon_preferences.ADDON)
        else:
            path = bpy.utils.user_resource("CONFIG", path=addon_preferences.ADDON)
        if path:
            os.makedirs(path, exist_ok=True)  # Blender, if asked to, writes a traceback if it cannot
    except (OSError, ValueError):
        return None
    return Path(path) if path else None


def _begin_watch() -> crash_files.Watch | None:
    folder = _folder()
    try:
        return None if folder is None else crash_files.Watch(folder, BLENDER, VERSION)
    except OSError:  # then nobody can tell later why Blender ended
        return None


def _end_watch() -> None:
    global _watch
    if _watch is not None:
        _watch.end()
        _watch = None


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
    if _is_new and contract.is_forbidden():
        notice.show(contract.trouble())


def register() -> None:
    global _is_said, _is_new, _has_crashed
    _is_said = False
    folder = _folder()
    if folder is not None:
        _is_new = crash_files.take_stock(folder)
        _has_crashed = bool(crash_files.crashed_in(folder, BLENDER, VERSION))
    atexit.register(_end_watch)
    decide()


def unregister() -> None:
    _end_watch()
    atexit.unregister(_end_watch)
