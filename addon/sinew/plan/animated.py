"""Tells what animation may change, without an edit, of what Sinew reads once and keeps: a mesh, its shape keys, bones.

Blender's animation writes into evaluated copies in place, so no lost mark tells that they have changed. Whatever
keyframes, NLA strips or drivers set in these data-blocks is taken to change what was read, except for HARMLESS.
"""

import re
import threading
from typing import Any, NamedTuple

from ..blender import animation, spoken_paths
from ..host import driver_memory, keyframes, marks
from . import driven, drivers, wiring

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
MOST_KNOWN = 4096  # data-blocks
TITLES = {"MESH": "the mesh", "KEY": "the shape keys", "ARMATURE": "the armature", "OBJECT": "the object"}


def why(block: Any, kind: str, looks_at_sources: bool = True) -> str:
    """Returns what animation may change without an edit of what Sinew has read of a data-block, and what to do, a
    sentence; "" for nothing. kind: "MESH", "KEY", "ARMATURE", or "OBJECT" for the object with the mesh;
    looks_at_sources: whether to see if anything animates what drivers of B-bones read, in another data-block."""
    if block is None or block.animation_data is None:
        return ""
    where = ", in the library" if block.library is not None else ""
    own = block.animation_data.drivers
    found = _found_in(own, block, kind)
    if found.given:
        return (
            f"The driver of {_name(own[found.number], block, kind)} runs Python with {found.given}, through which "
            f"it may change what Sinew has read: write it without{where}"
        )
    number = found.number
    if looks_at_sources and number is None:
        readers = (_reader_of_animated(own, each) for each in found.sources)
        number = next((each for each in readers if each is not None), None)
    if number is not None:
        return _sentence(own[number], block, kind, "driven", f"remove its driver{where}")
    for curve in animation.keyed_curves(block):
        if _is_kept(curve.data_path, kind):
            return _sentence(curve, block, kind, "keyed", f"remove its keyframes{where}")
    return ""


class _Found(NamedTuple):
    """What drivers are, by their numbers: so it holds for whatever data-block has the same ones."""

    number: int | None = None  # of the first that may change what was read
    given: str = ""  # what that hands over to Python
    # What drivers of B-bones read of each data-block: {path: (number of a driver, number of its variable)}
    sources: tuple[dict[str, tuple[int, int]], ...] = ()
    runs_python: bool = False  # so that it depends on more than the drivers


_found: dict[tuple[int, str], tuple[bytes, _Found]] = {}  # by the address of a data-block and its kind


def _found_in(own: Any, block: Any, kind: str) -> _Found:
    """Looks at the drivers of a data-block again only if they have changed: a large rig has hundreds."""
    now = driver_memory.read_bytes(own)
    if now is None:
        return _look_at(own, kind)
    key = block.as_pointer(), kind
    before, found = _found.get(key, (None, None))
    if found is None or before != now:
        found = _look_at(own, kind)
        if len(_found) >= MOST_KNOWN:
            _found.clear()
        if not found.runs_python:
            _found[key] = now, found
    return found


def _look_at(own: Any, kind: str) -> _Found:
    sources: dict[Any, dict[str, tuple[int, int]]] = {}
    runs_python = False
    for number, curve in enumerate(own):
        if kind == "OBJECT" and wiring.is_hook(curve):
            continue
        driver, path = curve.driver, curve.data_path
        if _runs_python(driver):
            runs_python = True
            if given := _given_to(driver):
                return _Found(number, given, runs_python=True)
        if not _is_kept(path, kind):
            continue
        if not _OF_BEND.match(path) or driver.type == "SCRIPTED":
            return _Found(number, runs_python=runs_python)
        for place, variable in enumerate(driver.variables):
            target = variable.targets[0]
            if variable.type != "SINGLE_PROP" or target.id is not None and not _CUSTOM.match(target.data_path):
                return _Found(number, runs_python=runs_python)
            if target.id is not None:
                sources.setdefault(target.id, {}).setdefault(target.data_path, (number, place))
    return _Found(sources=tuple(sources.values()), runs_python=runs_python)


def _reader_of_animated(own: Any, source: dict[str, tuple[int, int]]) -> int | None:
    """Returns the number of a driver that reads an animated property of a data-block, or None. source: as in _Found."""
    number, place = next(iter(source.values()))
    path = animation.first_animated(own[number].driver.variables[place].targets[0].id, source)
    return None if path is None else source[path][0]


def _is_kept(path: str, kind: str) -> bool:
    if kind == "OBJECT":
        return path == "show_only_shape_key"
    return _HARMLESS[kind].match(path) is None


def _sentence(curve: Any, block: Any, kind: str, how: str, advice: str) -> str:
    return f"{_name(curve, block, kind)} is {how}, and Sinew reads that only after edits: {advice}"


def _name(curve: Any, block: Any, kind: str) -> str:
    return f"{spoken_paths.spoken(curve.data_path)} of {TITLES[kind]} {block.name}"


def _runs_python(driver: Any) -> bool:
    if driver.type != "SCRIPTED":
        return False
    try:
        drivers.compiled(driver.expression, [variable.name for variable in driver.variables])
        return False
    except ValueError:
        return True


def _given_to(driver: Any) -> str:
    """Returns what of Blender's data a driver hands over to Python, or "" if it gets numbers at most."""
    if driver.use_self:
        return "the data itself (self)"
    names = [variable.name for variable in driver.variables]
    if re.search(r"\bdepsgraph\b", driver.expression) and "depsgraph" not in names:
        return "all evaluated data (depsgraph)"
    return next((f"data ({each.name})" for each in driver.variables if driven.is_data_variable(each)), "")


# --- in evaluated copies --------------------------------------------------------------------------

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
        played = {each.action.as_pointer(): each.action for each in keyframes.actions_of(block)}
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
