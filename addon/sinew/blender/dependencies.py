"""Finds what data-blocks use and follow."""

from collections.abc import Callable, Iterable
from functools import cached_property
from typing import Any

import bpy

from ..host import keyframes
from . import animation, values

LISTS = bpy.types.Collection, bpy.types.Scene  # which use all that is in them
_LEFT_OUT = {"rna_type", "fcurves", "keyframe_points", "channels", "data", "points", "value"}


class Users(dict[Any, set[Any]]):
    """{data-block: those that use it} of all data-blocks. To find it takes as long as the file is large, so it is found
    once for each look."""

    @classmethod
    def now(cls) -> "Users":
        return cls(bpy.data.user_map())

    @cached_property
    def uses(self) -> dict[Any, list[Any]]:
        """{data-block: those that it uses}, without scenes, which use all that is in them."""
        found: dict[Any, list[Any]] = {}
        for block, its_users in self.items():
            for user in its_users if not isinstance(block, bpy.types.Scene) else ():
                found.setdefault(user, []).append(block)
        return found


def used(roots: Iterable[Any], users: Users, without: Iterable[Any] = (), by: Iterable[Any] = ()) -> list[Any]:
    """Returns the data-blocks that these use, directly or not, and themselves, except for scenes.

    without: what those in `by` may use without being changed by it."""
    uses = users.uses
    found, skipped, skipping = dict.fromkeys(roots), set(without), set(by)
    queue = list(found)
    for block in queue:
        own = [each for each in uses.get(block, ()) if block not in skipping or each not in skipped]
        tree = None if isinstance(block, bpy.types.NodeTree) else getattr(block, "node_tree", None)
        for each in [*own, tree] if tree is not None else own:
            if each not in found:
                found[each] = None
                queue.append(each)
    return list(found)


def plain(struct: Any, depth: int = 2) -> list[Any]:
    """Returns all settings of a struct and of what it owns, except for keyframes, points and values."""
    found: list[Any] = []
    for member in struct.bl_rna.properties:
        name = member.identifier
        if name in _LEFT_OUT:
            continue
        value = getattr(struct, name)
        if member.type == "COLLECTION":
            found.append((name, [plain(each, depth - 1) for each in value] if depth else len(value)))
        elif member.type == "POINTER":
            found.append((name, values.key_of(value) if isinstance(value, bpy.types.ID) else None))
        else:
            found.append((name, tuple(value) if getattr(member, "is_array", False) else value))
    return found


def pointers(struct: Any) -> list[Any]:
    """Returns what the pointers of a struct point to."""
    return [getattr(struct, each.identifier) for each in struct.bl_rna.properties if each.type == "POINTER"]


def targets_of(constraint: Any) -> list[Any]:
    """Returns the objects that a constraint follows."""
    several = getattr(constraint, "targets", None)
    found = [each.target for each in several] if several is not None else [getattr(constraint, "target", None)]
    found += [getattr(constraint, name, None) for name in ("pole_target", "space_object")]
    return [each for each in found if each is not None]


def with_parents(objects: Iterable[Any]) -> list[Any]:
    """Returns objects and their parents, each one after its parents."""
    found: dict[Any, None] = {}
    for ob in objects:
        lineage: dict[Any, None] = {}
        while ob is not None and ob not in found and ob not in lineage:
            lineage[ob] = None
            ob = ob.parent
        found.update(dict.fromkeys(reversed(lineage)))
    return list(found)


def constraints_of(owner: Any) -> list[Any]:
    """Returns the constraints of an object or a pose bone, without those of types that this Blender does not know, as
    files of other versions have: it evaluates none of them."""
    return [each for each in owner.constraints if isinstance(each, bpy.types.Constraint)]


def read_by(curve: Any) -> list[Any]:
    """Returns the data-blocks that a driver reads."""
    return [target.id for variable in curve.driver.variables for target in variable.targets if target.id is not None]


def drivers_of_both(armature: Any) -> list[Any]:
    """Returns the drivers of an armature object and of its data."""
    return [*animation.drivers_of(armature), *animation.drivers_of(armature.data)]


def outside_of(armature: Any) -> list[Any]:
    """Returns the other objects that the bones of an armature object follow by constraints and drivers."""
    found: dict[Any, None] = {}
    for bone in armature.pose.bones if armature.pose is not None else ():
        for constraint in constraints_of(bone):
            found.update(dict.fromkeys(targets_of(constraint)))
    for curve in drivers_of_both(armature):
        found.update(dict.fromkeys(each for each in read_by(curve) if isinstance(each, bpy.types.Object)))
    found.pop(armature, None)
    return list(found)


def data_read_by(armature: Any) -> list[Any]:
    """Returns the data-blocks that the drivers of an armature object read, but objects and its own data."""
    read = (each for curve in drivers_of_both(armature) for each in read_by(curve))
    return list(
        dict.fromkeys(each for each in read if not isinstance(each, bpy.types.Object) and each != armature.data)
    )


def actions_of_lists(blocks: Iterable[Any]) -> list[Any]:
    """Returns what keyframes.actions_of does of those of these data-blocks that are LISTS."""
    own = (each for each in blocks if isinstance(each, LISTS) and hasattr(each, "animation_data"))
    return [played for each in own for played in keyframes.actions_of(each)]


def leaders_of(armature: Any) -> list[Any]:
    """Returns the other armature objects whose bones an armature object follows."""
    return [each for each in outside_of(armature) if each.type == "ARMATURE"]


def in_order(armatures: Iterable[Any]) -> list[Any]:
    """Returns armature objects, and those whose bones they follow, directly or not: each one after those that it
    follows, unless these follow it, too. Looks at each only once."""
    found: list[Any] = []
    begun: set[Any] = set()
    waiting = [(each, False) for each in reversed(list(armatures))]
    while waiting:
        ob, is_behind_its_leaders = waiting.pop()
        if is_behind_its_leaders:
            found.append(ob)
        elif ob not in begun:
            begun.add(ob)
            waiting.append((ob, True))
            waiting += [(each, False) for each in reversed(leaders_of(ob)) if each not in begun]
    return found


def chain(armature: Any) -> list[Any]:
    """Returns the armature objects whose bones an armature object follows, directly or not, and itself, the last."""
    return in_order([armature])


def reaching(
    objects: Iterable[Any], followed_by: Callable[[Any], Iterable[Any]], is_sought: Callable[[Any], bool]
) -> set[Any]:
    """Returns those of these objects, and of all that they follow, directly or not, that are sought or follow one that
    is. Looks at each only once. followed_by: returns what an object follows directly."""
    following: dict[Any, list[Any]] = {each: [] for each in objects}
    queue = list(following)
    for ob in queue:
        for each in followed_by(ob):
            if each not in following:
                following[each] = []
                queue.append(each)
            following[each].append(ob)
    found = dict.fromkeys(filter(is_sought, queue))
    queue = list(found)
    for ob in queue:
        new = [each for each in following[ob] if each not in found]
        found.update(dict.fromkeys(new))
        queue += new
    return set(found)


def followed_by(ob: Any) -> list[Any]:
    """Returns the objects that one follows by its parent, constraints and Armature modifiers."""
    found = [ob.parent, *(target for each in constraints_of(ob) for target in targets_of(each))]
    found += [each.object for each in ob.modifiers if each.type == "ARMATURE"]
    return [each for each in found if each is not None]
