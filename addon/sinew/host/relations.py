"""Has Blender build the relations of its dependency graph as if some of the file were different.

Blender looks at an object's action and NLA tracks only while it builds relations, and then at the type of a driver to
see whether it depends on the frame. So these are changed in memory for that moment, in the originals, and restored at
once. Nothing that reads the file, its undo steps or a render sees a difference. Whatever makes Blender build the
relations again undoes the effect.
"""

import ctypes
from typing import Any, NamedTuple

import bpy

from . import contract, proof

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
        rebuilding.build(view_layer)

    Handlers of other add-ons that Blender calls before it builds would see objects without their actions, and might
    remove them. So they are left out of this one update. Those that it calls afterwards see everything restored."""

    def __init__(self) -> None:
        self._places: list[_Place] = []
        self._early_handlers: list[Any] = []

    def __enter__(self) -> "Rebuilding":
        if contract.freezing_trouble():
            raise contract.Broken(contract.freezing_trouble())
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
            raise contract.distrust_freezing("actions are not where they were")
        self._change(action, bytes(size))
        self._change(strips, bytes(strips_size))

    def on_each_frame(self, hook: Any) -> None:
        """Has Blender evaluate a hook, the driver of an original, on each frame. Raises contract.Broken."""
        driver = hook.driver
        kind, size = contract.region(driver, "ChannelDriver", "type")
        if driver.type == "SCRIPTED":
            return
        if ctypes.c_int32.from_address(kind).value != _SUM or driver.type != "SUM":
            raise contract.distrust_freezing("drivers have other types")
        parsed, _size = contract.region(driver, "ChannelDriver", "*expr_simple")
        text, length = contract.region(driver, "ChannelDriver", "expression")
        if contract.address_at(parsed) and _parsed_by_this.get(parsed) != contract.address_at(parsed):
            self._change(parsed, bytes(8), stays=True)
        self._change(text, ON_EACH_FRAME.encode().ljust(length, b"\0"))
        self._change(kind, _SCRIPTED.to_bytes(size, "little"))
        _seen_parsed.append(parsed)
        if proof.is_due("drivers on each frame"):
            if (driver.type, driver.expression) != ("SCRIPTED", ON_EACH_FRAME):
                raise contract.distrust_freezing("drivers are not where they were")
            proof.give("drivers on each frame")

    def build(self, view_layer: bpy.types.ViewLayer) -> None:
        """Has Blender build the relations of a view layer's graph, and evaluate. All else that was tagged must have
        been evaluated before."""
        handlers = bpy.app.handlers
        self._early_handlers = list(handlers.depsgraph_update_pre)
        handlers.depsgraph_update_pre.clear()
        handlers.depsgraph_update_post.insert(0, self._after_evaluation)
        try:
            view_layer.update()
        finally:
            handlers.depsgraph_update_post.remove(self._after_evaluation)  # not before: Blender goes through the list
            self.restore()

    def _after_evaluation(self, *_: Any) -> None:
        """Restores everything before Blender calls any other handler."""
        self.restore()

    def restore(self) -> None:
        """Restores all that was changed, in reverse order, and the handlers."""
        bpy.app.handlers.depsgraph_update_pre[:0] = self._early_handlers
        self._early_handlers = []
        while self._places:
            address, before, meanwhile = self._places.pop()
            if ctypes.string_at(address, len(meanwhile)) == meanwhile:
                ctypes.memmove(address, before, len(before))
        while _seen_parsed:
            place = _seen_parsed.pop()
            _parsed_by_this[place] = contract.address_at(place)

    def _change(self, address: int, to: bytes, stays: bool = False) -> None:
        before = ctypes.string_at(address, len(to))
        if not stays:
            self._places.append(_Place(address, before, to))
        ctypes.memmove(address, to, len(to))


# Where Blender keeps the parsed expression of a driver -> that of ON_EACH_FRAME. It stays there, as nothing reads it.
_parsed_by_this: dict[int, int] = {}
_seen_parsed: list[int] = []


def sum_again(hook: Any) -> None:
    """Restores the type of a hook, the driver of an evaluated copy that was made inside a Rebuilding."""
    kind = ctypes.c_int32.from_address(contract.region(hook.driver, "ChannelDriver", "type")[0])
    if kind.value == _SCRIPTED:
        kind.value = _SUM


def tag() -> None:
    """Has Blender build all relations again before its next evaluation."""
    ob = bpy.data.objects[0]
    ob.hide_viewport = ob.hide_viewport  # Blender tags them even if nothing changes
