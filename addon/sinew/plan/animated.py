"""Tells what animation may change, without an edit, of what Sinew reads once and keeps: a mesh, its shape keys, bones.

Blender's animation writes into evaluated copies in place, so no lost mark tells that they have changed. Whatever
keyframes, NLA strips or drivers set in these data-blocks is taken to change what was read, except for HARMLESS.
"""

import re
import threading
from typing import Any

from ..blender import animation
from ..host import actions, marks
from . import driver_variables, drivers, wiring

_NAME = r'\["(?:[^"\\]|\\.)*"\]'
# By kind of data-block, in which a mark has the same name: properties that are read on each frame, or that make no
# difference to what Sinew computes. tests/blender/test_animated_data.py sets each of them.
HARMLESS = {
    "MESH": rf"{_NAME}|(texspace_|use_auto_texspace$|auto_smooth_angle$)",
    "KEY": rf"{_NAME}|eval_time$|key_blocks{_NAME}\.(value|mute|slider_min|slider_max|lock_shape)$",
    "ARMATURE": rf"{_NAME}|(display_type|axes_position|relation_line_position|show_\w+)$"
    rf"|collections(_all)?\W|bones{_NAME}({_NAME}|\.(hide|hide_select|select\w*|show_wire|color\..*"
    r"|use_inherit_rotation|use_inherit_scale|inherit_scale|use_local_location|use_relative_parent)$)",
}
_HARMLESS = {kind: re.compile(pattern) for kind, pattern in HARMLESS.items()}
# Settings of B-bones at rest. As Rigify drives them, by custom properties that nothing animates, they only change by
# an edit: Blender then copies the armature again.
_OF_BEND = re.compile(rf"bones{_NAME}\.bbone_(ease|curve|roll|scale)\w+$")
_CUSTOM = re.compile(rf".*{_NAME}$")
# What is read of an object only when its plan is made.
_OF_OBJECT = re.compile(r"modifiers\[|sinew\.|show_only_shape_key$")
TITLES = {"MESH": "the mesh", "KEY": "the shape keys", "ARMATURE": "the armature", "OBJECT": "the object"}


def why(block: Any, kind: str, looks_at_sources: bool = True) -> str:
    """Returns what animation may change without an edit of what Sinew has read of a data-block, and what to do, a
    sentence; "" for nothing. kind: "MESH", "KEY", "ARMATURE", or "OBJECT" for the object with the mesh;
    looks_at_sources: whether to see if anything animates what drivers of B-bones read, for which all animation of a rig
    has to be read."""
    if block is None or block.animation_data is None:
        return ""
    sources: dict[Any, set[str]] | None = {} if looks_at_sources else None
    where = ", in the library" if block.library is not None else ""
    for curve in animation.drivers_of(block):
        if kind == "OBJECT" and wiring.is_hook(curve):
            continue
        given = _given_to(curve.driver)
        if given:
            return (
                f"The driver of {_name(curve, block, kind)} runs Python with {given}, through which it may change what "
                f"Sinew has read: write it without{where}"
            )
        if _is_kept(curve.data_path, kind) and not (
            _OF_BEND.match(curve.data_path) and _is_steady(curve.driver, sources)
        ):
            return _sentence(curve, block, kind, "driven", f"remove its driver{where}")
    for curve in animation.keyed_curves(block):
        if _is_kept(curve.data_path, kind):
            return _sentence(curve, block, kind, "keyed", f"remove its keyframes{where}")
    return ""


def _is_steady(driver: Any, sources: dict[Any, set[str]] | None) -> bool:
    """Whether the value of a driver only changes by an edit: it reads nothing but custom properties that neither
    keyframes nor drivers set. sources: the animated paths of data-blocks that were looked at; None: do not look."""
    return driver.type != "SCRIPTED" and all(
        variable.type == "SINGLE_PROP" and _is_custom_and_steady(variable.targets[0], sources)
        for variable in driver.variables
    )


def _is_custom_and_steady(target: Any, sources: dict[Any, set[str]] | None) -> bool:
    block, path = target.id, target.data_path
    if block is None or sources is None:
        return block is None or _CUSTOM.match(path) is not None
    if block not in sources:
        sources[block] = animation.animated_paths(block)
    return _CUSTOM.match(path) is not None and path not in sources[block]


def _is_kept(path: str, kind: str) -> bool:
    if kind == "OBJECT":
        return path == "show_only_shape_key"
    return _HARMLESS[kind].match(path) is None


def _sentence(curve: Any, block: Any, kind: str, how: str, advice: str) -> str:
    return f"{_name(curve, block, kind)} is {how}, and Sinew reads that only after edits: {advice}"


def _name(curve: Any, block: Any, kind: str) -> str:
    return f"{curve.data_path} of {TITLES[kind]} {block.name}"


def _given_to(driver: Any) -> str:
    """Returns what of Blender's data a driver hands over to Python, or "" if it gets numbers at most."""
    if driver.type != "SCRIPTED":
        return ""
    names = [variable.name for variable in driver.variables]
    try:
        drivers.compiled(driver.expression, names)
        return ""
    except ValueError:
        pass  # Blender runs Python for it
    if driver.use_self:
        return "the data itself (self)"
    if re.search(r"\bdepsgraph\b", driver.expression) and "depsgraph" not in names:
        return "all evaluated data (depsgraph)"
    return next((f"data ({each.name})" for each in driver.variables if driver_variables.is_data(each)), "")


# --- in evaluated copies --------------------------------------------------------------------------

MOST_KNOWN = 4096
# By the address of an evaluated data-block: (addresses of its actions, what `why` and, of an object, its paths were).
_known: dict[int, tuple[tuple[int, ...], Any]] = {}
_lock = threading.RLock()  # what a driver reads may be evaluated within it


def of_copies(ob: Any, hook: Any) -> tuple[Any, ...]:
    """Returns a value that differs if animation may change other parts than before of what Sinew has read for an
    evaluated object. hook: its hook. Call it before the marks are set: it reads only what Blender has copied again."""
    found = [_of_copy(ob, "OBJECT")]
    if hook is not None:
        for name, kind in (("mesh", "MESH"), ("keys", "KEY")):
            found.append(_of_copy(wiring.waits_for(hook, name), kind))
    for modifier in ob.modifiers:
        if modifier.type == "ARMATURE" and modifier.object is not None:
            found.append(_of_copy(modifier.object.data, "ARMATURE"))
    return tuple(found)


def forget(ob: Any) -> None:
    """Discards what is known of an evaluated object, which Blender has copied again."""
    with _lock:
        _known.pop(ob.as_pointer(), None)


def _of_copy(block: Any, kind: str) -> Any:
    """Returns what animation may change of an evaluated data-block, or None if there is no animation."""
    if block is None or block.animation_data is None:
        return None
    address = block.as_pointer()
    with _lock:
        played = {each.action.as_pointer(): each.action for each in actions.of(block)}
        edited = {at for at, action in played.items() if not marks.test_and_mark(action, "ACTION")}
        if edited:  # they may animate other data-blocks, too
            for other in [each for each, (theirs, _found) in _known.items() if not edited.isdisjoint(theirs)]:
                del _known[other]
        if not marks.is_marked(block, kind) or address not in _known:
            paths: Any = ()
            if kind == "OBJECT":
                paths = tuple(sorted(path for path in animation.animated_paths(block) if _OF_OBJECT.match(path)))
            if len(_known) >= MOST_KNOWN:
                _known.clear()
            _known[address] = tuple(played), (why(block, kind), paths)
        return _known[address][1]
