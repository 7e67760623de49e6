"""Finds all that follows an armature, and the reasons why an armature cannot be frozen."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import bpy

from ..blender import animation, nodes
from ..clips import clip_store
from ..plan import wiring
from ..run import characters

MOST_NAMES = 3  # that a reason lists
_SIMULATED = {"CLOTH", "SOFT_BODY", "PARTICLE_SYSTEM", "FLUID", "DYNAMIC_PAINT"}
# Constraints that depend on the frame, or on what cannot be watched.
_TIMED = {"TRANSFORM_CACHE", "FOLLOW_TRACK", "CAMERA_SOLVER", "OBJECT_SOLVER", "FOLLOW_PATH"}


@dataclass
class Followers:
    """What has to be evaluated on each frame while an armature is frozen."""

    hooked: list[Any] = field(default_factory=list)  # mesh objects with Sinew's hook
    placed: list[Any] = field(default_factory=list)  # objects that hang on bones, or are constrained to them
    shaped: list[Any] = field(default_factory=list)  # objects that Blender deforms
    # (shape keys' data-block, numbers of its keys that drivers set which read the bones)
    keyed: list[tuple[Any, tuple[int, ...]]] = field(default_factory=list)
    holders: list[Any] = field(default_factory=list)  # other armature objects whose bones follow this one's

    @property
    def objects(self) -> list[Any]:
        return [*self.hooked, *self.placed, *self.shaped]


class NotFreezable(ValueError):
    """An armature cannot be frozen. The message is a sentence that says why and, if possible, what to do."""


def find(rigs: Iterable[Any]) -> dict[Any, "Followers | NotFreezable"]:
    """Returns the followers of each original armature object, or the reason why they cannot all follow a frozen one.
    Walks through all of the file once."""
    rigs = list(rigs)
    users = bpy.data.user_map(subset=[*rigs, *(rig.data for rig in rigs)])
    found: dict[Any, Followers | NotFreezable] = {}
    for rig in rigs:
        try:
            found[rig] = _of(rig, (users.get(rig) or set()) | (users.get(rig.data) or set()))
        except NotFreezable as reason:
            found[rig] = reason
    return found


def _of(rig: Any, users: Iterable[Any]) -> Followers:
    found = Followers()
    for user in sorted(users, key=lambda each: each.name_full):
        if user == rig or user == rig.data:
            continue
        if isinstance(user, bpy.types.Object):
            _sort_in(rig, user, found)
        elif isinstance(user, bpy.types.Key) and _driven_values(user, rig):
            found.keyed.append((user, _driven_values(user, rig)))
        elif _drivers_on(user, rig):
            raise NotFreezable(
                f"{user.name} is driven by its bones, and a driver does not notice a frozen one: it would stand still"
            )
    meshes = {keys.user for keys, _numbers in found.keyed} - {ob.data for ob in (*found.hooked, *found.shaped)}
    if meshes:
        found.shaped += [ob for ob in bpy.data.objects if ob.data in meshes and ob.users_scene]
    for ob in found.objects:
        simulated = next((each for each in ob.modifiers if each.type in _SIMULATED), None)
        if simulated is not None or ob.rigid_body is not None or ob.soft_body is not None:
            raise NotFreezable(f"{ob.name} is simulated, and a simulation needs each frame of its armature")
    return found


def _sort_in(rig: Any, ob: Any, found: Followers) -> None:
    if nodes.is_canvas(ob) or not ob.users_scene:
        return
    if _drivers_on(ob, rig):
        raise NotFreezable(f"a driver of {ob.name} reads its bones, and a driver does not notice a frozen one")
    if ob.type == "ARMATURE":
        if ob.data == rig.data and not _targets(ob, rig):
            return  # shares its bones, not its pose
        if _targets(ob, rig):
            if not (ob.animation_data and (ob.animation_data.action or ob.animation_data.nla_tracks)):
                raise NotFreezable(
                    f"the armature {ob.name} follows its bones and has no keyframes: it would not notice a frozen one"
                )
            if any(target == rig for curve in _drivers_of_both(ob) for target in _read_by(curve)):
                raise NotFreezable(
                    f"drivers of the armature {ob.name} read it, and a driver does not notice a frozen one"
                )
            found.holders.append(ob)
        if ob.parent == rig and ob.parent_type != "OBJECT" or any(each.target == rig for each in _simple(ob)):
            raise NotFreezable(f"the armature {ob.name} hangs on its bones; freezing it with this one is not supported")
        return
    if ob.parent == rig and ob.parent_type == "ARMATURE":
        raise NotFreezable(
            f"{ob.name} is deformed by its parent: use an Armature modifier (Object > Convert, or parent it with "
            "Armature Deform), which Sinew can follow"
        )
    is_known = ob.parent == rig or rig in _pointers(ob.sinew)
    if any(rig in _pointers(modifier) or modifier.type == "NODES" for modifier in ob.modifiers):
        (found.hooked if hook_of(ob) is not None else found.shaped).append(ob)
        is_known = True
    if ob.parent == rig and ob.parent_type == "BONE" or _constrained(ob, rig):
        found.placed.append(ob)
        is_known = True
    if not is_known:
        raise NotFreezable(f"{ob.name} uses it in a way that Sinew does not know")


def hook_of(ob: Any) -> Any:
    """Returns the hook of a bound mesh, original or evaluated, or None."""
    return wiring.find_hook(ob) if ob.type == "MESH" and ob.sinew.is_bound else None


def _pointers(struct: Any) -> list[Any]:
    return [getattr(struct, each.identifier) for each in struct.bl_rna.properties if each.type == "POINTER"]


def _simple(ob: Any) -> list[Any]:
    """Returns the constraints of an object that have a single target."""
    return [each for each in ob.constraints if hasattr(each, "target")]


def _constrained(ob: Any, rig: Any) -> bool:
    return any(rig in targets_of(constraint) for constraint in ob.constraints)


def targets_of(constraint: Any) -> list[Any]:
    """Returns the objects that a constraint follows."""
    several = getattr(constraint, "targets", None)
    found = [each.target for each in several] if several is not None else [getattr(constraint, "target", None)]
    found += [getattr(constraint, "pole_target", None)]
    return [each for each in found if each is not None]


def _targets(armature: Any, rig: Any) -> bool:
    """Whether bones or drivers of an armature object follow another one."""
    return rig in outside_of(armature)


def _drivers_on(block: Any, rig: Any) -> list[Any]:
    """Returns the drivers of a data-block that read an armature object or its data, except for Sinew's hooks. Those of
    armatures count as constraints do."""
    if not hasattr(block, "animation_data") or getattr(block, "type", "") == "ARMATURE":
        return []
    return [
        curve
        for curve in animation.drivers_of(block)
        if not any(
            variable.targets[0].data_path == wiring.HOOK
            for variable in curve.driver.variables
            if variable.type == "SINGLE_PROP"
        )
        and any(target in (rig, rig.data) for target in _read_by(curve))
    ]


def _driven_values(keys: Any, rig: Any) -> tuple[int, ...]:
    """Returns the numbers of the keys whose values are set by drivers that read an armature; none if such a driver sets
    anything else."""
    paths = {f'key_blocks["{bpy.utils.escape_identifier(key.name)}"].value': i for i, key in enumerate(keys.key_blocks)}
    driven = [paths.get(curve.data_path) for curve in _drivers_on(keys, rig)]
    return () if None in driven else tuple(sorted({number for number in driven if number is not None}))


def _read_by(curve: Any) -> list[Any]:
    """Returns the data-blocks that a driver reads."""
    return [target.id for variable in curve.driver.variables for target in variable.targets if target.id is not None]


def _drivers_of_both(armature: Any) -> list[Any]:
    return [*animation.drivers_of(armature), *animation.drivers_of(armature.data)]


def outside_of(rig: Any) -> list[Any]:
    """Returns the other objects on which the pose of an armature depends, by constraints and drivers, or its place."""
    found: dict[Any, None] = {}
    for bone in rig.pose.bones if rig.pose is not None else ():
        for constraint in bone.constraints:
            found.update(dict.fromkeys(targets_of(constraint)))
    for curve in _drivers_of_both(rig):
        found.update(dict.fromkeys(each for each in _read_by(curve) if isinstance(each, bpy.types.Object)))
    found.pop(rig, None)
    return list(found)


# --- the armature itself --------------------------------------------------------------------------


def check(rig: Any) -> list[Any]:
    """Raises NotFreezable if the pose of an original armature object is not a function of the frame that can be played,
    whatever follows it. Returns the other armature objects on which the pose depends."""
    data = rig.animation_data
    if data is None or data.action is None and not any(track.strips for track in data.nla_tracks):
        raise NotFreezable(f"{rig.name} has no keyframes: there is nothing to freeze")
    if data.use_tweak_mode:
        raise NotFreezable(f"an NLA strip of {rig.name} is being edited: leave its tweak mode first")
    if rig.mode != "OBJECT" or rig.data.is_editmode:
        raise NotFreezable(f"{rig.name} is being edited: go back to Object Mode first")
    own = sorted(path for path in animation.animated_paths(rig) if not path.startswith(("pose.", '["')))
    if own:
        raise NotFreezable(
            f"{rig.name} itself is animated ({_names(own)}), not only its bones: animate its root bone instead"
        )
    if rig.constraints:
        raise NotFreezable(f"{rig.name} itself has constraints: constrain its root bone instead")
    if rig.parent is not None and not _is_still(rig.parent):
        raise NotFreezable(f"{rig.name} is a child of {rig.parent.name}, which moves or may move")
    if rig.rigid_body is not None:
        raise NotFreezable(f"{rig.name} is simulated")
    if animation.keyed_curves(rig.data):
        raise NotFreezable(f"the armature data {rig.data.name} have keyframes of their own")
    if rig.pose.ik_solver == "ITASC":
        raise NotFreezable(f"{rig.name} uses the iTaSC solver, whose result depends on the frames before")
    if clip_store.has_poses(rig.data) and _plays_clip(rig):
        raise NotFreezable(
            f"{rig.name} plays the poses of an imported rig, which costs little: there is nothing to gain"
        )
    for curve in _drivers_of_both(rig):
        _check_driver(rig, curve)
    for bone in rig.pose.bones:
        timed = next((each for each in bone.constraints if each.type in _TIMED), None)
        if timed is not None:
            raise NotFreezable(f"{timed.name} of {rig.name}'s bone {bone.name} may change on each frame by itself")
    outside = outside_of(rig)
    moving = [each for each in outside if each.type != "ARMATURE" and not _is_still(each)]
    if moving:
        names = _names([each.name for each in moving])
        raise NotFreezable(f"bones of {rig.name} follow {names}, outside of it, which may move")
    return [each for each in outside if each.type == "ARMATURE"]


def _plays_clip(rig: Any) -> bool:
    return any(ob.sinew.armature == rig and ob.sinew.source == "CLIP" for ob in characters.by_clip())


def _check_driver(rig: Any, curve: Any) -> None:
    driver = curve.driver
    if driver.type == "SCRIPTED":
        has_word = re.search(r"\b(frame|depsgraph)\b", driver.expression)
        is_simple = getattr(driver, "is_simple_expression", True)
        if has_word or not is_simple and "(" in driver.expression:
            raise NotFreezable(
                f"the driver of {curve.data_path} of {rig.name} may change on each frame by itself: {driver.expression}"
            )
    for variable in driver.variables:
        for target in variable.targets:
            if variable.type == "CONTEXT_PROP" or target.id is not None and not _may_be_read(rig, target.id):
                raise NotFreezable(
                    f"the driver of {curve.data_path} of {rig.name} reads {getattr(target.id, 'name', 'the scene')}, "
                    "outside of it, which may change on each frame"
                )


def _may_be_read(rig: Any, block: Any) -> bool:
    """Whether a driver of an armature may read a data-block: the armature itself, or an object, which `check` and the
    groups of armatures look at."""
    return block in (rig, rig.data) or isinstance(block, bpy.types.Object)


def _is_still(ob: Any) -> bool:
    """Whether an object stays where it is, and its shape as it is, unless somebody edits it."""
    data = ob.animation_data
    return (
        not (data is not None and (data.action is not None or data.drivers or data.nla_tracks))
        and not ob.constraints
        and not ob.modifiers
        and ob.rigid_body is None
        and (ob.data is None or getattr(ob.data, "animation_data", None) is None)
        and getattr(ob.data, "shape_keys", None) is None
        and (ob.parent is None or ob.parent_type == "OBJECT" and _is_still(ob.parent))
    )


def _names(names: list[str]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more


def needs(rig: Any) -> list[Any]:
    """Returns the other armature objects on which the pose of one depends."""
    return [each for each in outside_of(rig) if each.type == "ARMATURE"]
