"""Has Blender build the relations of its dependency graph as if some of the file were different.

Blender looks at an object's action and NLA tracks only while it builds relations, and then at the type of a driver to
see whether it depends on the frame. So these are changed in memory for that moment, in the originals, and restored at
once. Nothing that reads the file, its undo steps or a render sees a difference. Whatever makes Blender build the
relations again undoes the effect.
"""

import ctypes
import keyword
import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import bpy

from . import contract, features, layout, members, proof

_TYPES = {"AVERAGE": 0, "SCRIPTED": 1, "SUM": 2, "MIN": 3, "MAX": 4}  # of drivers
LONGEST = 256  # bytes of an expression
# Modifiers that keep what was on the frame before until somebody tags their object.
_SIMULATED = {"CLOTH", "COLLISION", "PARTICLE_SYSTEM", "SOFT_BODY"}
_FRAME = re.compile(r"\bframe\b")


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
        if not contract.has(features.PLAYING):
            raise contract.Broken(contract.why_not(features.PLAYING))
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
            raise contract.distrust(features.PLAYING, "actions are not where they were")
        self._change(action, bytes(size))
        self._change(strips, bytes(strips_size))

    def without_targets(self, constraint: Any, targets: list[Any]) -> None:
        """Has Blender see none of these original objects, all that a constraint of a bone follows. Raises
        contract.Broken."""
        addresses = {each.as_pointer() for each in targets}
        found = [place for place in _pointers_of(constraint) if contract.address_at(place) in addresses]
        if len(found) != len(targets):
            raise contract.distrust(features.FOLLOWING, "constraints are not where they were")
        for place in found:
            self._change(place, bytes(members.POINTER))

    def without_parent(self, ob: Any) -> None:
        """Has Blender see no parent of an original object. Raises contract.Broken."""
        place, size = contract.region(ob, "Object", "*parent")
        if contract.address_at(place) != ob.parent.as_pointer():
            raise contract.distrust(features.MOVING, "the parents of objects are not where they were")
        self._change(place, bytes(size))

    def without_read(self, curve: Any, objects: Sequence[Any], named: Sequence[Any] = ()) -> None:
        """Has Blender see no variable of an original's driver that reads these original objects, or a property by one
        of the data-blocks in `named`. A copy of the driver is as `read_again` leaves it. Raises contract.Broken."""
        for variable in _reading(curve.driver, objects, named):
            place, size = contract.region(variable, "DriverVar", "num_targets")
            if int.from_bytes(ctypes.string_at(place, size), "little") != len(variable.targets):
                raise contract.distrust(features.FOLLOWING, "what drivers read is not where it was")
            self._change(place, bytes(size))

    def on_each_frame(self, curve: Any, text: str = "") -> None:
        """Has Blender evaluate a driver of an original on each frame. text: an expression with its value, if not
        on_each_frame's. Raises contract.Broken, and ValueError as on_each_frame does."""
        self._say(curve, text or on_each_frame(curve.driver))

    def on_no_frame(self, curve: Any, frame: float) -> None:
        """Has Blender evaluate a driver of an original as if it were always on that frame. Raises contract.Broken, and
        ValueError with a clause if that cannot be done."""
        self._say(curve, on_no_frame(curve.driver, frame))

    def _say(self, curve: Any, text: str) -> None:
        """Gives a driver an expression. text: "" for its own."""
        if not text or curve.driver.type == "SCRIPTED" and curve.driver.expression == text:
            return
        kind, size = contract.region(curve.driver, "ChannelDriver", "type")
        if ctypes.c_int32.from_address(kind).value != _TYPES[curve.driver.type]:
            raise contract.distrust(features.PLAYING, "drivers have other types")
        place, length = contract.region(curve.driver, "ChannelDriver", "expression")
        parsed, _size = contract.region(curve.driver, "ChannelDriver", "*expr_simple")
        self._change(place, text.encode().ljust(length, b"\0"))
        self._change(kind, _TYPES["SCRIPTED"].to_bytes(size, "little"))
        if proof.is_due("drivers on each frame"):
            if (curve.driver.type, curve.driver.expression) != ("SCRIPTED", text):
                raise contract.distrust(features.PLAYING, "drivers are not where they were")
            proof.give("drivers on each frame")
        # Another expression than its own, which is the driver's to free.
        self._change(parsed, _parsed(curve.driver, parsed).to_bytes(8, "little"))

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


def depends_on_frame(driver: Any) -> bool:
    """Whether a driver's expression has the word that stands for the frame."""
    has_word = driver.type == "SCRIPTED" and _FRAME.search(driver.expression) is not None
    return has_word and all(variable.name != "frame" for variable in driver.variables)


def on_no_frame(driver: Any, frame: float) -> str:
    """Returns the expression of a driver with a number in place of the frame; "" if it does not depend on it. Raises
    ValueError with a clause if that would be too long."""
    text = _FRAME.sub(f"({frame:.9g})", driver.expression) if depends_on_frame(driver) else ""
    if len(text.encode()) >= LONGEST:
        raise ValueError("its expression is too long")
    return text


def on_each_frame(driver: Any) -> str:
    """Returns an expression with the value of a driver that depends on the frame; "" if the driver does. Raises
    ValueError with a clause if there is none."""
    names = [variable.name for variable in driver.variables]
    if depends_on_frame(driver):
        return ""
    listed = ", ".join(names)
    values = {
        "SCRIPTED": driver.expression,
        "SUM": " + ".join(names),
        "AVERAGE": f"({' + '.join(names)}) / {len(names)}",
        "MIN": f"min({listed})" if len(names) > 1 else listed,
        "MAX": f"max({listed})" if len(names) > 1 else listed,
    }
    own = values[driver.type]
    end = "\n" if "#" in own else ""  # of a comment
    text = f"({own}{end}) + 0 * frame"
    if "frame" in names or not all(name.isidentifier() and not keyword.iskeyword(name) for name in names):
        raise ValueError(f"its variables need other names than {listed}")
    if not names or len(text.encode()) >= LONGEST:
        raise ValueError("its expression is too long" if names else "it has no variables")
    return text


def _pointers_of(constraint: Any) -> list[int]:
    """Returns the places in a constraint at which there may be addresses."""
    data = contract.address_at(contract.region(constraint, "bConstraint", "*data")[0])
    kinds = (constraint.as_pointer(), "bConstraint"), (data, members.CONSTRAINTS[constraint.type])
    return [
        place for start, kind in kinds for place in range(start, start + contract.struct_size(kind), members.POINTER)
    ]


def follow_again(copy: Any, original: Any, targets: list[Any], graph: Any) -> None:
    """Has a constraint of an evaluated copy that was made inside a Rebuilding follow again what the original's does."""
    evaluated = {each.as_pointer(): each.evaluated_get(graph).as_pointer() for each in targets}
    for place, own in zip(_pointers_of(copy), _pointers_of(original)):
        address = evaluated.get(contract.address_at(own))
        if address is not None and contract.address_at(place) == 0:
            ctypes.c_uint64.from_address(place).value = address


def hang_again(copy: Any, original: Any, graph: Any) -> None:
    """Gives an evaluated copy that was made inside a Rebuilding the parent of the original again."""
    place = contract.region(copy, "Object", "*parent")[0]
    if contract.address_at(place) == 0:
        ctypes.c_uint64.from_address(place).value = original.parent.evaluated_get(graph).as_pointer()


def _reading(driver: Any, objects: Sequence[Any], named: Sequence[Any]) -> list[Any]:
    return [
        each
        for each in driver.variables
        if any(target.id in objects for target in each.targets)
        or each.type == "SINGLE_PROP"
        and each.targets[0].id in named
    ]


def read_again(copy: Any, original: Any, objects: Sequence[Any], named: Sequence[Any], graph: Any) -> None:
    """Has a driver of an evaluated copy that was made inside a Rebuilding read again what the original's reads."""
    read = {each.name for each in _reading(original.driver, objects, named)}
    for own, variable in zip(copy.driver.variables, original.driver.variables):
        if variable.name in read:
            place, size = contract.region(own, "DriverVar", "num_targets")
            ctypes.memmove(place, len(variable.targets).to_bytes(size, "little"), size)
            for target, followed in zip(own.targets, variable.targets):
                address = ctypes.c_uint64.from_address(contract.region(target, "DriverTarget", "*id")[0])
                address.value = followed.id.evaluated_get(graph).as_pointer()


def type_again(copy: Any, original: Any) -> None:
    """Gives a driver of an evaluated copy that was made inside a Rebuilding the type of the original's."""
    kind = ctypes.c_int32.from_address(contract.region(copy.driver, "ChannelDriver", "type")[0])
    if kind.value == _TYPES["SCRIPTED"]:
        kind.value = _TYPES[original.driver.type]


# Addresses of two parsed expressions, which no driver keeps and nothing else frees: of one that does not depend on the
# frame, and of one that does. Of an original's, Blender only asks that.
_parsed_kinds: dict[bool, int] = {}


def _parsed(driver: Any, place: int) -> int:
    """Returns the address of a parsed expression that depends on the frame if a driver's does. place: where the driver
    keeps the address of its own, of what it was before."""
    kind = depends_on_frame(driver)
    if kind not in _parsed_kinds:
        own = contract.address_at(place)
        ctypes.c_uint64.from_address(place).value = 0
        driver.is_simple_expression  # noqa: B018  # Blender parses it here
        found = contract.address_at(place)
        ctypes.c_uint64.from_address(place).value = own
        if not found:
            raise contract.distrust(features.PLAYING, "expressions are not parsed where they were")
        _parsed_kinds[kind] = found
    return _parsed_kinds[kind]


def release() -> None:
    """Has Blender free what `_parsed` has made, by giving it to drivers that are removed."""
    if not _parsed_kinds:
        return
    with layout.temporary_data() as data:
        while _parsed_kinds:
            driver = data.objects.new("Driver", None).driver_add("location", 0).driver
            place = contract.region(driver, "ChannelDriver", "*expr_simple")[0]
            _kind, address = _parsed_kinds.popitem()
            if contract.address_at(place) == 0:
                ctypes.c_uint64.from_address(place).value = address


def simulations(ob: Any) -> list[Any]:
    """Returns the modifiers of an object that begin anew when somebody tags it."""
    return [each for each in ob.modifiers if each.type in _SIMULATED]


def tag() -> Any:
    """Has Blender build all relations again before its next evaluation. Returns the object that Blender copies again
    because of this, with the collections that it is in."""
    # What drivers of an armature read may be out of sight meanwhile.
    others = (each for each in bpy.data.objects if each.type != "ARMATURE" and not simulations(each))
    ob = next(others, bpy.data.objects[0])
    ob.hide_viewport = ob.hide_viewport  # Blender tags them even if nothing changes
    return ob
