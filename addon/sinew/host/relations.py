"""Has Blender build the relations of its dependency graph as if some of the file were different.

Blender looks at an object's action and NLA tracks only while it builds relations, and then at the type of a driver to
see whether it depends on the frame. So these are changed in memory for that moment, in the originals, and restored at
once. Nothing that reads the file, its undo steps or a render sees a difference. Whatever makes Blender build the
relations again undoes the effect.
"""

import ctypes
from collections.abc import Callable
from typing import Any, NamedTuple

import bpy

from . import contract, features, layout, proof

ON_EACH_FRAME = "deform + 0 * frame"  # simple expression of a hook's variable; "frame" makes it depend on the frame
_SCRIPTED, _SUM = 1, 2  # types of drivers


class _Place(NamedTuple):
    address: int
    before: bytes
    meanwhile: bytes


class Rebuilding:
    """Takes animation away inside a `with` block, in which `build` is called once:

    with Rebuilding() as rebuilding:
        rebuilding.without_animation(rig)
        rebuilding.on_each_frame(hook)
        rebuilding.build(view_layer, then)

    Handlers of other add-ons that Blender calls before it builds would see objects without their actions, and might
    remove them. So they are left out of this one update. Those that it calls afterwards see everything restored."""

    def __init__(self) -> None:
        self._places: list[_Place] = []
        self._early_handlers: list[Any] = []

    def __enter__(self) -> "Rebuilding":
        if not contract.has(features.FREEZING):
            raise contract.Broken(contract.why_not(features.FREEZING))
        return self

    def __exit__(self, *_: object) -> None:
        self.restore()

    def without_animation(self, block: Any) -> None:
        """Has Blender see neither action nor NLA tracks of an original data-block. Raises contract.Broken."""
        data = block.animation_data
        tracks = data.nla_tracks
        wanted = [
            data.action.as_pointer() if data.action is not None else 0,
            tracks[0].as_pointer() if len(tracks) else 0,
            tracks[-1].as_pointer() if len(tracks) else 0,
        ]
        action, size = contract.region(data, "AnimData", "*action")
        strips, strips_size = contract.region(data, "AnimData", "nla_tracks")
        found = [contract.address_at(each) for each in (action, strips, strips + size)]
        if found != wanted:
            raise contract.distrust(features.FREEZING, "actions are not where they were")
        self._change(action, bytes(size))
        self._change(strips, bytes(strips_size))

    def on_each_frame(self, hook: Any) -> None:
        """Has Blender evaluate a hook, the driver of an original, on each frame. Raises contract.Broken."""
        driver = hook.driver
        kind, size = contract.region(driver, "ChannelDriver", "type")
        if driver.type == "SCRIPTED":
            return
        if ctypes.c_int32.from_address(kind).value != _SUM or driver.type != "SUM":
            raise contract.distrust(features.FREEZING, "drivers have other types")
        parsed, _size = contract.region(driver, "ChannelDriver", "*expr_simple")
        text, length = contract.region(driver, "ChannelDriver", "expression")
        self._change(text, ON_EACH_FRAME.encode().ljust(length, b"\0"))
        self._change(kind, _SCRIPTED.to_bytes(size, "little"))
        if contract.address_at(parsed):  # another expression, which is the driver's to free; if none, Blender parses
            self._change(parsed, _parsed(driver, parsed).to_bytes(8, "little"))
        if proof.is_due("drivers on each frame"):
            if (driver.type, driver.expression) != ("SCRIPTED", ON_EACH_FRAME):
                raise contract.distrust(features.FREEZING, "drivers are not where they were")
            proof.give("drivers on each frame")

    def build(self, view_layer: bpy.types.ViewLayer, then: Callable[[], None]) -> None:
        """Has Blender build the relations of a view layer's graph, and evaluate. All else that was tagged must have
        been evaluated before. then: what to do after the evaluation, before any other handler can edit."""

        def after_evaluation(*_: Any) -> None:
            self.restore()
            then()

        handlers = bpy.app.handlers
        self._early_handlers = list(handlers.depsgraph_update_pre)
        handlers.depsgraph_update_pre.clear()
        handlers.depsgraph_update_post.insert(0, after_evaluation)
        try:
            view_layer.update()
        finally:
            handlers.depsgraph_update_post.remove(after_evaluation)  # not before: Blender goes through the list
            self.restore()

    def restore(self) -> None:
        """Restores all that was changed, in reverse order, and the handlers."""
        bpy.app.handlers.depsgraph_update_pre[:0] = self._early_handlers
        self._early_handlers = []
        while self._places:
            address, before, meanwhile = self._places.pop()
            if ctypes.string_at(address, len(meanwhile)) == meanwhile:
                ctypes.memmove(address, before, len(before))

    def _change(self, address: int, to: bytes) -> None:
        self._places.append(_Place(address, ctypes.string_at(address, len(to)), to))
        ctypes.memmove(address, to, len(to))


_parsed_address = 0  # of the parsed ON_EACH_FRAME, which all hooks share and nothing frees


def _parsed(driver: Any, place: int) -> int:
    """Returns the address of the parsed ON_EACH_FRAME, which is the expression of this driver now. place: where the
    driver keeps the address of its own."""
    global _parsed_address
    if not _parsed_address:
        own = contract.address_at(place)
        ctypes.c_uint64.from_address(place).value = 0
        is_simple = driver.is_simple_expression  # Blender parses it here
        _parsed_address = contract.address_at(place)
        ctypes.c_uint64.from_address(place).value = own
        if not is_simple or not _parsed_address:
            raise contract.distrust(features.FREEZING, "expressions are not parsed where they were")
    return _parsed_address


def release() -> None:
    """Has Blender free what `_parsed` has made, by giving it to a driver that is removed."""
    global _parsed_address
    if _parsed_address:
        with layout.temporary_data() as data:
            driver = data.objects.new("Driver", None).driver_add("location", 0).driver
            place = contract.region(driver, "ChannelDriver", "*expr_simple")[0]
            if contract.address_at(place) == 0:
                ctypes.c_uint64.from_address(place).value = _parsed_address
                _parsed_address = 0


def sum_again(hook: Any) -> None:
    """Restores the type of a hook, the driver of an evaluated copy that was made inside a Rebuilding."""
    kind = ctypes.c_int32.from_address(contract.region(hook.driver, "ChannelDriver", "type")[0])
    if kind.value == _SCRIPTED:
        kind.value = _SUM


def tag() -> Any:
    """Has Blender build all relations again before its next evaluation. Returns the object that Blender copies again
    because of this, with the collections that it is in."""
    ob = bpy.data.objects[0]
    ob.hide_viewport = ob.hide_viewport  # Blender tags them even if nothing changes
    return ob
