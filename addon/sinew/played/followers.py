"""Finds all that follows an armature, or why it could not follow one that Blender does not evaluate."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import bpy

from ..blender import animation, dependencies, nodes, spoken_paths, values
from ..blender.values import is_alive
from ..description import objects, rna_paths
from ..description import reading as description
from ..host import contract, features, members, poses, relations
from ..plan import wiring

# Constraints that depend on the frame, or on what cannot be watched.
TIMED = {"TRANSFORM_CACHE", "FOLLOW_TRACK", "CAMERA_SOLVER", "OBJECT_SOLVER"}
_BETWEEN_FRAMES = {"FLUID", "DYNAMIC_PAINT"}  # which have Blender evaluate keyframes between two frames
# What drivers may read of a bone on each frame.
_RECORDED = {*poses.RECORDED, "matrix", "matrix_channel", "head", "tail", "length"}
MOST_NAMES = 3  # that a reason lists
# Blender takes longer to evaluate an object that is tagged than one that time reaches: by less than these many bones.
BONES_FOR_A_TAG = 4
# What may use an armature without being changed by its pose, unless it has drivers.
_LISTS = (
    bpy.types.Armature,  # of a metarig, which names the rig that Rigify has made of it
    bpy.types.Collection,
    bpy.types.Scene,
    bpy.types.Screen,
    bpy.types.WindowManager,
    bpy.types.WorkSpace,
)


@dataclass
class Followers:
    """What has to be evaluated on each frame while an armature is played."""

    hooked: list[Any] = field(default_factory=list)  # mesh objects with Sinew's hook
    placed: list[Any] = field(default_factory=list)  # objects that hang on bones, or are constrained to them
    shaped: list[Any] = field(default_factory=list)  # objects that Blender deforms
    carried: list[Any] = field(default_factory=list)  # of `hooked`, what only hangs on it if it moves, parents first
    # Those of them that time has Blender evaluate: their simulations would begin anew if they were tagged.
    simulated: list[Any] = field(default_factory=list)
    is_simulated: bool = False  # some of these, or hooked
    # Armatures, and their data, that Blender evaluates on each frame anyway.
    keyframed: list[Any] = field(default_factory=list)
    # (shape keys' data-block, numbers of its keys that drivers set which read the bones)
    keyed: list[tuple[Any, tuple[int, ...]]] = field(default_factory=list)
    driven: list[tuple[Any, str, int]] = field(default_factory=list)  # other drivers: data-block, path, index
    # What these read of the armature that keyframes or drivers set, and is no channel of a bone, with who reads it.
    reads: dict[str, str] = field(default_factory=dict)
    keys: frozenset[int] = frozenset()  # of all these objects
    copied: list[Any] = field(default_factory=list)  # the data-blocks that Blender copies again when they are tagged

    @property
    def objects(self) -> list[Any]:
        return [*self.hooked, *self.placed, *self.shaped, *self.simulated]

    def drivers(self) -> list[Any]:
        """Returns the other drivers."""
        found = [block.animation_data.drivers.find(path, index=index) for block, path, index in self.driven]
        return [each for each in found if each is not None]

    def driven_blocks(self) -> list[Any]:
        """Returns the data-blocks that have them."""
        return list(dict.fromkeys(block for block, _path, _index in self.driven if is_alive(block)))


class NotPlayable(ValueError):
    """An armature cannot be played. The message is a sentence that says why and, if possible, what to do."""


def find(rigs: Iterable[Any], users: dict[Any, set[Any]], graph: Any) -> dict[Any, "Followers | NotPlayable"]:
    """Returns the followers of each original armature object in a graph, or the reason why they cannot all follow a
    played one. users: as dependencies.Users.now returns them."""
    found: dict[Any, Followers | NotPlayable] = {}
    outside_of = cache(dependencies.outside_of)
    for rig in rigs:
        try:
            found[rig] = _of(rig, users, graph, outside_of)
        except NotPlayable as reason:
            found[rig] = reason
    return found


def _of(rig: Any, users: dict[Any, set[Any]], graph: Any, outside_of: Callable[[Any], list[Any]]) -> Followers:
    """outside_of: that of dependencies."""
    found, groups, moves = Followers(), set(), description.is_moved_by_keyframes(rig)
    for user in sorted(users.get(rig, set()) | users.get(rig.data, set()), key=lambda each: each.name_full):
        if user in (rig, rig.data):
            continue
        if isinstance(user, bpy.types.Object):
            _sort_in(rig, user, found, graph, outside_of)
            continue
        is_of_mesh = isinstance(user, bpy.types.Key) and not isinstance(user.user, bpy.types.Curve)
        driven = _driven_values(user, rig) if is_of_mesh else ()
        if driven:
            found.keyed.append((user, driven))
            continue
        before = len(found.driven)
        for block in (user, getattr(user, "node_tree", None)):
            for curve in _drivers_on(block, rig) if block is not None and _is_evaluated(block, graph) else ():
                _add_driven(block, curve, user.name, rig, found)
        if isinstance(user, bpy.types.NodeTree):
            groups.add(user)
        elif len(found.driven) > before:
            continue
        elif isinstance(user, bpy.types.Camera) and not getattr(user.dof, "focus_subtarget", ""):
            continue  # the armature's place is read when it is drawn
        elif not isinstance(user, (*_LISTS, bpy.types.Library)) and _is_evaluated(user, graph):
            raise NotPlayable(f"{user.name} uses it in a way that Sinew does not know: remove that")
    if moves:
        groups |= _sort_moved(rig, found, users, graph)
    sorted_in = {*found.objects, rig}
    found.shaped += [ob for ob in _made_by(groups, users, graph) if ob not in sorted_in]
    meshes = {keys.user for keys, _numbers in found.keyed} - {ob.data for ob in (*found.hooked, *found.shaped)}
    if meshes:
        found.shaped += [ob for ob in bpy.data.objects if ob.data in meshes and _is_evaluated(ob, graph)]
    _sort_simulations(found)
    if moves and found.is_simulated:
        raise NotPlayable(_moves_and(rig, "a simulation follows it"))
    data = [ob.data for ob in (*found.hooked, *found.shaped) if ob.data is not None]
    data += [each.shape_keys for each in data if getattr(each, "shape_keys", None) is not None]
    found.keys, found.copied = frozenset(map(values.key_of, found.objects)), [*found.objects, *data]
    return found


def _sort_simulations(found: Followers) -> None:
    """Sorts out which of these objects are simulated. Raises NotPlayable if a simulation would be another one."""
    for ob in found.objects:
        if any(each.type in _BETWEEN_FRAMES for each in ob.modifiers):
            raise NotPlayable(f"{ob.name} is simulated, and its simulation needs its armature between frames")
        cached = relations.simulations(ob)
        if not cached:
            continue
        if ob in found.placed:
            raise NotPlayable(
                f"{ob.name} hangs on bones, and its simulation would begin anew on each frame: let them deform it"
            )
        if ob in found.shaped:
            if not any(each.show_viewport and not _is_static(each) for each in cached):
                raise NotPlayable(f"{ob.name} has hair or a simulation that is switched off: accelerate it, too")
            found.shaped.remove(ob)
            found.simulated.append(ob)
        found.is_simulated = True


def _is_static(modifier: Any) -> bool:
    """Whether time does not change what a modifier simulates."""
    system = modifier.particle_system if modifier.type == "PARTICLE_SYSTEM" else None
    return system is not None and system.settings.type == "HAIR" and not system.use_hair_dynamics


def is_simulated(ob: Any) -> bool:
    """Whether an object's shape or place depends on the frames before."""
    is_between = any(each.type in _BETWEEN_FRAMES for each in ob.modifiers)
    return is_between or ob.rigid_body is not None or bool(relations.simulations(ob))


def _made_by(groups: set[Any], users: dict[Any, set[Any]], graph: Any) -> list[Any]:
    """Returns the objects whose shapes node groups make, directly or inside others: their nodes may read bones."""
    found, queue = dict.fromkeys(groups), list(groups)
    for group in queue:
        for user in users.get(group, ()):
            if user not in found:
                found[user] = None
                queue += [user] if isinstance(user, bpy.types.NodeTree) else []
    return [each for each in found if isinstance(each, bpy.types.Object) and _is_evaluated(each, graph)]


def _is_evaluated(block: Any, graph: Any) -> bool:
    return block.evaluated_get(graph).is_evaluated


def _sort_in(rig: Any, ob: Any, found: Followers, graph: Any, outside_of: Callable[[Any], list[Any]]) -> None:
    if nodes.is_canvas(ob) or not _is_evaluated(ob, graph):
        return
    own_drivers = _drivers_on(ob, rig)
    for curve in own_drivers:
        _add_driven(ob, curve, ob.name, rig, found)
    if ob.type == "ARMATURE":
        if ob.data == rig.data and rig not in outside_of(ob):
            return  # shares its bones, not its pose
        if rig in outside_of(ob):
            is_parent = ob in dependencies.with_parents([rig]) and ob not in outside_of(rig)
            if is_parent:  # Blender evaluates the bones of its children with it
                raise NotPlayable(f"{rig.name} is a child of {ob.name}, which follows its bones: parent it otherwise")
            has_keys = ob.animation_data and (ob.animation_data.action or ob.animation_data.nla_tracks)
            if has_keys:
                found.keyframed += [ob, ob.data]
            else:
                found.shaped.append(ob)
        if _hangs_on(ob, rig):  # so that it cannot be played itself
            found.placed.append(ob)
        return
    if ob.parent == rig and ob.parent_type == "ARMATURE":
        raise NotPlayable(
            f"{ob.name} is deformed by its parent: use an Armature modifier (Object > Convert, or parent it with "
            "Armature Deform), which Sinew can follow"
        )
    is_known = ob.parent == rig or rig in dependencies.pointers(ob.sinew) or bool(own_drivers)
    if any(rig in dependencies.pointers(modifier) or modifier.type == "NODES" for modifier in ob.modifiers):
        (found.hooked if hook_of(ob) is not None else found.shaped).append(ob)
        is_known = True
    if _hangs_on(ob, rig):
        found.placed.append(ob)
        is_known = True
    if not is_known:
        raise NotPlayable(f"{ob.name} uses it in a way that Sinew does not know: remove that")


def _sort_moved(rig: Any, found: Followers, users: dict[Any, set[Any]], graph: Any) -> set[Any]:
    """Sorts in what follows the place of an armature object that moves as a whole, and of what it carries. Returns the
    node groups that read it. Raises NotPlayable."""
    groups, queue, before = set(), [rig], len(found.placed)
    for moved in queue:
        if moved.field is not None and moved.field.type != "NONE":
            raise NotPlayable(_moves_and(rig, f"{moved.name} is a force"))
        for user in sorted(users.get(moved, ()), key=lambda each: each.name_full):
            if isinstance(user, bpy.types.GeometryNodeTree):
                groups.add(user)
            elif isinstance(user, bpy.types.Object) and user not in queue and not nodes.is_canvas(user):
                if _is_evaluated(user, graph) and _is_carried(rig, user, moved, found):
                    queue.append(user)
            elif not isinstance(user, (*_LISTS, bpy.types.Library, bpy.types.Camera, bpy.types.Object)):
                if _is_evaluated(user, graph) and not (moved == rig and _drivers_on(user, rig)):
                    raise NotPlayable(_moves_and(rig, f"{user.name} uses it"))
    count = len(found.placed) - before
    if count * BONES_FOR_A_TAG > len(rig.pose.bones):
        raise NotPlayable(_moves_and(rig, f"{count} objects hang on it, which would take longer than its bones"))
    found.carried = queue[1:]
    return groups


def _is_carried(rig: Any, ob: Any, moved: Any, found: Followers) -> bool:
    """Whether an object only hangs on one that moves, and is deformed on each frame; otherwise sorts it in. Raises
    NotPlayable."""
    is_child = ob.parent == moved and ob.parent_type == "OBJECT"
    if ob.type == "ARMATURE" and moved in dependencies.outside_of(ob):
        raise NotPlayable(_moves_and(rig, f"bones of {ob.name} follow it"))
    if is_child and ob.rigid_body is not None:
        raise NotPlayable(_moves_and(rig, "a simulation follows it"))
    if moved != rig and _drivers_on(ob, moved):
        raise NotPlayable(_moves_and(rig, f"drivers of {ob.name} read {moved.name}"))
    if is_child and ob in found.hooked:
        if objects.why_not(ob) or any(rna_paths.moves_object(path) for path in animation.animated_paths(ob)):
            raise NotPlayable(_moves_and(rig, f"{ob.name}, its child, moves by itself"))
        return True
    if ob in found.placed:
        return False
    if is_child or moved != rig and _hangs_on(ob, moved):
        found.placed.append(ob)
    elif moved != rig:
        if any(moved in dependencies.pointers(each) or each.type == "NODES" for each in ob.modifiers):
            found.shaped += [ob] if ob not in (*found.hooked, *found.shaped) else []
        elif ob.parent != moved and moved not in dependencies.pointers(ob.sinew):
            raise NotPlayable(_moves_and(rig, f"{ob.name} uses {moved.name}"))
    return False


def _moves_and(rig: Any, clause: str) -> str:
    return f"{rig.name} itself is animated, and {clause}: animate its root bone instead"


def _hangs_on(ob: Any, rig: Any) -> bool:
    """Whether bones of an armature say where an object is."""
    is_child = ob.parent == rig and ob.parent_type == "BONE"
    return is_child or any(rig in dependencies.targets_of(each) for each in dependencies.constraints_of(ob))


def not_still(objects: Iterable[Any], rig: Any) -> list[Any]:
    """Returns the objects that may move, or change their shape, though nobody edits them, and not because of the bones
    of an armature: what moves with those is evaluated after them, and what follows it again. rig: that armature object;
    None: bones of all armatures have to stay, too."""
    objects = [each for each in objects if each != rig]

    def followed_by(ob: Any) -> list[Any]:
        bones_follow = dependencies.outside_of(ob) if _has_to_stay(ob, rig) else []
        return [each for each in (*dependencies.followed_by(ob), *bones_follow) if each != rig]

    found = dependencies.reaching(objects, followed_by, lambda ob: _may_move_alone(ob, rig))
    return [each for each in objects if each in found]


def _has_to_stay(ob: Any, rig: Any) -> bool:
    """Whether an object has bones that have to stay, see not_still."""
    return rig is None and ob.type == "ARMATURE"


def _may_move_alone(ob: Any, rig: Any) -> bool:
    """Whether an object, or its shape, may change though nothing does that it follows. rig: as for not_still."""
    data = ob.animation_data
    is_own = ob.type == "MESH" and ob.sinew.is_bound
    drivers = [] if data is None else [each for each in data.drivers if not (is_own and hook_of(ob) == each)]
    bones: Any = ob.pose.bones if _has_to_stay(ob, rig) and ob.pose is not None else ()
    return (
        data is not None
        and (data.action is not None or bool(drivers) or bool(data.nla_tracks))
        or any(each.type in TIMED for owner in (ob, *bones) for each in dependencies.constraints_of(owner))
        or any(each.type != "ARMATURE" and not (is_own and each.type == "NODES") for each in ob.modifiers)
        or ob.rigid_body is not None
        or getattr(ob.data, "animation_data", None) is not None
        or getattr(ob.data, "shape_keys", None) is not None
    )


def moving(rig: Any, outside: Iterable[Any]) -> list[Any]:
    """Returns those objects, armatures left out, that may move by themselves. outside: what an armature object follows,
    as dependencies.outside_of returns it."""
    return not_still((each for each in outside if each.type != "ARMATURE"), rig)


def unkeyed(rig: Any, scene: Any, others: Iterable[Any] = (), rounding: float = animation.ROUNDING) -> str:
    """Returns the name of what moves and is followed by an armature object, or of a parent of that, which is not where
    its keyframes put it; "" if there is none. others: data-blocks that are looked at, too; rounding: as for
    animation.is_near."""
    followed, time = (*moved_by_keys(rig), *filter(is_alive, others)), scene.frame_current_final
    return next((each.name for each in followed if animation.unkeyed_path(each, time, rounding)), "")


def moved_by_keys(rig: Any) -> list[Any]:
    """Returns the objects that move and are followed by an armature object, and their parents, and its own."""
    followed = moving(rig, dependencies.outside_of(rig))
    return [each for each in dependencies.with_parents([*followed, rig]) if each != rig]


def check_moving(rig: Any, followed: list[Any], layer: Any) -> None:
    """Raises NotPlayable if an armature object follows one of these moving objects in another way than by constraints
    and drivers, or if its place on each frame is not known from keyframes."""
    mixed: dict[Any, str] = {}
    known = set(followed)
    own = constraints_on(rig, followed)
    paths = {each for constraint, targets in own if constraint.type == "FOLLOW_PATH" for each in targets}
    for curve in reading(rig, followed):
        for variable in curve.driver.variables:
            read = {target.id for target in variable.targets}
            if read & known and read - known:
                mixed |= dict.fromkeys(
                    read,
                    f"the driver of {spoken_paths.spoken(curve.data_path)} reads it together with something else: give "
                    "it two variables",
                )
    for each in followed:
        why = objects.why_not(each) or mixed.get(each, "")
        is_needed = each.type != "CURVE" or objects.may_move(each) or each in paths
        if not why and not each.visible_get(view_layer=layer) and is_needed:
            # so that Blender might not evaluate it
            why = f"{each.name} is hidden: show it"
        elif not why and not contract.has(features.FOLLOWING):
            why = contract.why_not(features.FOLLOWING)
        if why:
            raise NotPlayable(f"bones of {rig.name} follow {each.name}, outside of it, which may move: {why}")
    for constraint, _targets in own:
        if constraint.type not in members.CONSTRAINTS:
            raise NotPlayable(
                f'the constraint "{constraint.name}" of {rig.name} follows an object that may move: use a '
                "constraint of another type"
            )


def constraints_on(rig: Any, targets: Sequence[Any]) -> list[tuple[Any, list[Any]]]:
    """Returns the constraints of bones that follow some of these objects, with those."""
    found = [
        (constraint, [each for each in dependencies.targets_of(constraint) if each in targets])
        for bone in (rig.pose.bones if targets else ())
        for constraint in dependencies.constraints_of(bone)
    ]
    return [each for each in found if each[1]]


def reading(rig: Any, targets: Sequence[Any]) -> list[Any]:
    """Returns the drivers of an armature object and its data that read some of these objects."""
    own = dependencies.drivers_of_both(rig) if targets else ()
    return [curve for curve in own if any(each in targets for each in dependencies.read_by(curve))]


def _set_as_a_whole(rig: Any) -> list[str]:
    """Returns the paths of all but bones and custom properties that keyframes and drivers of an armature object
    change."""
    curves = [*animation.drivers_of(rig), *animation.keyed_curves(rig)]
    others = [curve for curve in curves if not curve.data_path.startswith(("pose.", '["'))]
    others = [curve for curve in others if not animation.sets_nothing(rig, curve)]
    return sorted({rna_paths.normalised(curve.data_path) for curve in others if not animation.stays(rig, curve)})


def check_place(rig: Any, layer: Any = None) -> None:
    """Raises NotPlayable if an armature object may move as a whole while nobody edits it. layer: a view layer in which
    keyframes, its own or its parents', may move it; None: these neither."""
    own = _set_as_a_whole(rig)
    if layer is not None and contract.has(features.MOVING) and not objects.why_not(rig):
        own = [path for path in own if not rna_paths.moves_object(path)]
    if own:
        raise NotPlayable(
            f"{rig.name} itself is animated ({listed(sorted({*map(spoken_paths.spoken, own)}))}), not only its bones: "
            "animate its root bone instead"
        )
    if dependencies.constraints_of(rig):
        raise NotPlayable(f"{rig.name} itself has constraints: constrain its root bone instead")
    if layer is None or not _hangs_on_what_is_keyed(rig, layer):
        check_parent(rig)
    if rig.rigid_body is not None:
        raise NotPlayable(f"{rig.name} is simulated: remove its rigid body")


def _hangs_on_what_is_keyed(rig: Any, layer: Any) -> bool:
    """Whether the parents of an armature object with keyframes are where their own keyframes put them."""
    parents = dependencies.with_parents([rig])[:-1]
    is_known = contract.has(features.MOVING) and not objects.why_not(rig) and rig.animation_data is not None
    return is_known and all(each.type != "ARMATURE" and each.visible_get(view_layer=layer) for each in parents)


def check_parent(rig: Any) -> None:
    """Raises NotPlayable if an armature object may move because of its parent."""
    if rig.parent is not None and rig.parent.type == "ARMATURE" and rig.parent_type == "OBJECT":
        check_place(rig.parent)
    elif rig.parent is not None and not_still([rig.parent], rig):
        moving = f"{rig.name} is a child of {rig.parent.name}, which moves or may move"
        raise NotPlayable(f"{moving}: clear the parent, and animate the root bone")


def listed(names: list[str]) -> str:
    """Returns the first few of them, for people."""
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more


def hook_of(ob: Any) -> Any:
    """Returns the hook of a bound mesh, original or evaluated, or None."""
    return wiring.find_hook(ob) if ob.type == "MESH" and ob.sinew.is_bound else None


def _drivers_on(block: Any, rig: Any) -> list[Any]:
    """Returns the drivers of a data-block that read an armature object or its data, except for Sinew's hooks."""
    if not hasattr(block, "animation_data"):
        return []
    return [
        curve
        for curve in animation.drivers_of(block)
        if not any(
            variable.targets[0].data_path == wiring.HOOK
            for variable in curve.driver.variables
            if variable.type == "SINGLE_PROP"
        )
        and any(target in (rig, rig.data) for target in dependencies.read_by(curve))
        and _exists(block, curve.data_path)
    ]


def _exists(block: Any, path: str) -> bool:
    try:
        block.path_resolve(path)
    except ValueError:
        return False
    return True


def _add_driven(block: Any, curve: Any, name: str, rig: Any, found: Followers) -> None:
    """Takes note of a driver that reads an armature. name: of the data-block, for people. Raises NotPlayable."""
    try:
        relations.on_each_frame(curve.driver)
    except ValueError as reason:
        raise NotPlayable(
            f"the driver of {spoken_paths.spoken(curve.data_path)} of {name} reads it, and {reason}: rewrite it"
        ) from None
    found.driven.append((block, curve.data_path, curve.array_index))
    for path in filter(None, _paths_read(curve, rig)):
        bone = rna_paths.BONE.match(path)
        channel = bone and re.match(r"\.(\w+)", path[bone.end() :])
        is_recorded = path.startswith("pose.") and channel is not None and channel[1] in _RECORDED
        is_recorded |= rna_paths.moves_object(path)
        if not is_recorded and any(path.startswith(each) for each in animation.animated_paths(rig)):
            found.reads[path] = f"{spoken_paths.spoken(curve.data_path)} of {name}"
        elif path.startswith("data."):
            if any(path[5:].startswith(each) for each in animation.animated_paths(rig.data)):
                found.reads[path] = f"{spoken_paths.spoken(curve.data_path)} of {name}"


def _paths_read(curve: Any, rig: Any) -> list[str]:
    """Returns the paths from an armature object that a driver reads; "" for its bones."""
    found = []
    for variable in curve.driver.variables:
        for target in variable.targets:
            if target.id in (rig, rig.data):
                is_path = variable.type in {"SINGLE_PROP", "CONTEXT_PROP"}
                start = "data." if target.id == rig.data else ""
                found.append(rna_paths.normalised(start + target.data_path) if is_path else "")
    return found


def _driven_values(keys: Any, rig: Any) -> tuple[int, ...]:
    """Returns the numbers of the keys whose values are set by drivers that read an armature; none if such a driver sets
    anything else."""
    paths = {key.path_from_id("value"): i for i, key in enumerate(keys.key_blocks)}
    driven = [paths.get(curve.data_path) for curve in _drivers_on(keys, rig)]
    return () if None in driven else tuple(sorted({number for number in driven if number is not None}))
