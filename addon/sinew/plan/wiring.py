"""Adds, finds and removes the hook: the driver of a bound mesh through which Blender's evaluation calls Sinew.

The hook drives a property of a modifier, the carrier. The property has no effect on a mesh, but makes Blender evaluate
the driver before the mesh. The carrier is the first Armature modifier that Sinew replaces, otherwise Sinew's own
modifier. The hook's first variable reads `sinew.deform_now`, whose `get` function deforms the mesh. The other variables
name what has to be evaluated first: the mesh, its shape keys, transforms and bones. The driver has no scripted
expression, so it works where scripts in files are disabled. Without the add-on the property does not exist, and nothing
happens.

The Armature modifier itself is left as it is, switched on. In the same pass, and only in the evaluated copy, Sinew
switches it off and its own modifier on (run/switching.py). So a file plays without Sinew as if it had never been bound,
and Blender's tools find the modifier that they look for.
"""

from collections.abc import Collection, Iterable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..blender import animation, dependencies, meshes, values
from ..host import driver_memory
from . import driven

HOOK = "sinew.deform_now"
CALLS = "deform"  # the variable that reads it
CARRIER = "use_apply_on_spline"  # of a modifier: affects only curves
SOLVERS = {"IK", "SPLINE_IK"}  # constraints that move a chain of bones
SHOWS = ("show_viewport", "show_render")  # of a modifier
BINDS = ("use_vertex_groups", "use_bone_envelopes")  # of an Armature modifier
# The property of a mesh by which a hook waits for it. Blender resolves the path in the original too, when it builds
# relations. To find a vertex there would give the mesh a new array of positions, which counts as a change in undo.
WAITS_FOR_MESH = "use_mirror_topology"  # off in general, so that it adds nothing to the value of the hook
# For each type of modifier that follows the shape of another object: a property of that object which Blender reads only
# after it has evaluated the shape, and with dimensions the transform. (Blender has no such property for the shape of a
# lattice alone. The dimensions of a large mesh take time; those of a cage do not.)
SHAPES = {"LATTICE": "dimensions[0]", "MESH_DEFORM": "dimensions[0]", "SURFACE_DEFORM": "data.use_auto_texspace"}


def path_of(modifier: bpy.types.Modifier, name: str = CARRIER) -> str:
    """Returns the path of a modifier's property from its object: by default the one that the hook drives."""
    return f'modifiers["{bpy.utils.escape_identifier(modifier.name)}"].{name}'


def hook_of(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> Any:
    """Returns the hook on that modifier, or None."""
    curve = animation.find_driver(ob, path_of(modifier))
    return curve if curve is not None and is_hook(curve) else None


def is_hook(curve: bpy.types.FCurve) -> bool:
    """Whether a driver is a hook."""
    return any(
        variable.type == "SINGLE_PROP" and variable.targets[0].data_path == HOOK for variable in curve.driver.variables
    )


def carrier_of(ob: bpy.types.Object) -> Any:
    """Returns the modifier with the hook, or None. ob: original or evaluated."""
    if not ob.animation_data:
        return None
    return next(
        (
            modifier
            for modifier in ob.modifiers
            if modifier.type in {"ARMATURE", "NODES"} and hook_of(ob, modifier) is not None
        ),
        None,
    )


def find_hook(ob: bpy.types.Object) -> Any:
    """Returns the hook of an original or evaluated object, or None."""
    carrier = carrier_of(ob)
    return None if carrier is None else hook_of(ob, carrier)


def taken_modifiers(ob: bpy.types.Object) -> list[bpy.types.Modifier]:
    """Returns the Armature modifiers that Sinew replaces, in stack order; none if it replaces only shape keys and
    smoothing."""
    carrier = carrier_of(ob)
    return mixed_modifiers(ob, carrier) if carrier is not None and carrier.type == "ARMATURE" else []


def mixed_modifiers(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> list[bpy.types.Modifier]:
    """Returns the Armature modifiers that Multi Modifier mixes, beginning with this one.

    Each later one starts from the same input shape as the first, and the results are mixed. For an ordinary modifier
    the list has only that one.
    """
    chain = [modifier]
    originals = ob.original.modifiers  # in an evaluated copy Sinew may have switched them off
    for later in list(ob.modifiers)[ob.modifiers.find(modifier.name) + 1 :]:
        if later.type != "ARMATURE" or not later.use_multi_modifier:
            break
        if later.object is not None and may_be_shown(ob.original, originals[later.name]):
            chain.append(later)
    return chain


def is_shown(modifier: bpy.types.Modifier) -> bool:
    """Whether a modifier is switched on in the viewport or in renders."""
    return modifier.show_viewport or modifier.show_render


def may_be_shown(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> bool:
    """Whether a modifier is switched on, or drivers or keyframes may do that. ob: original."""
    return is_shown(modifier) or not set(SHOWS).isdisjoint(animation.animated_properties(ob, modifier))


def hook_variables(
    ob: bpy.types.Object,
    armatures: Iterable[bpy.types.Object],
    bones: Collection[str] | None,
    targets: Iterable[tuple[bpy.types.Object, str]],
    waits: bool,
    canvas: bpy.types.Object | None = None,
    replaced: Collection[str] = (),
) -> list[tuple[str, str, Any, str]]:
    """Returns the variables that the hook must have: [(name, kind of data-block, data-block, path or bone)].

    bones: names of the bones whose motion matters, None for all; targets: as returned by `followed_by`, besides the
    armatures' bones; waits: whether the hook waits on each frame for all that deforming needs. Otherwise it only marks
    the modifier; canvas: what is read and written in place of a mesh that several objects share, or None; replaced:
    names of the modifiers that Sinew replaces, whose switches and settings may be driven.

    Blender evaluates the variables in this order, so those that Sinew reads come before the one that calls it.
    """
    mesh = ob.data
    wanted: list[tuple[str, str, Any, str]] = [(CALLS, "OBJECT", ob, HOOK)]
    if not waits:
        return wanted
    switches, copied = [], []
    for modifier in (each for each in ob.modifiers if each.name in replaced):
        for curve in drivers_of_settings(ob, modifier):
            if sets_switch(curve):
                switches.append(("OBJECT", ob, curve.data_path))
            else:
                copied += curve.driver.variables
    wanted[:0] = [(f"{driven.COPIED}{i}", "COPY", variable, "") for i, variable in enumerate(copied)]
    wanted += [(f"switch{i}", *variable) for i, variable in enumerate(switches)]
    if canvas is None:
        wanted.append(("mesh", "MESH", mesh, WAITS_FOR_MESH))
    else:  # a path that begins with "data." makes Blender evaluate the object's geometry first
        wanted.append(("canvas", "OBJECT", canvas, "data.use_auto_texspace"))
        if canvas.data != mesh:
            wanted.append(("mesh", "MESH", mesh, WAITS_FOR_MESH))
            wanted.append(("copied", "MESH", canvas.data, WAITS_FOR_MESH))
    if mesh.shape_keys is not None:
        wanted.append(("keys", "KEY", mesh.shape_keys, "use_relative"))
    wanted.append(("place", "OBJECT", ob, "location[0]"))  # the whole transform: Blender does not tell its parts apart
    for number, armature in enumerate(armatures):
        wanted.append((f"armature{number}", "BONE", armature, ""))
        wanted += [(f"bone{number}_{i}", *variable) for i, variable in enumerate(_bones(armature, bones))]
    for i, (target, place) in enumerate(targets):
        wanted.append((f"target{i}", "OBJECT" if place in SHAPES.values() else "BONE", target, place))
    return wanted


def waits_for_nothing(hook: bpy.types.FCurve) -> bool:
    """Whether a hook only marks the modifier, as of a mesh that is left to Blender."""
    return len(hook.driver.variables) == 1


def drivers_of_settings(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> list[Any]:
    """Returns the drivers of a modifier's settings and switches that Blender evaluates, except for the hook; sorted."""
    start, hook = path_of(modifier, ""), path_of(modifier)
    return sorted(
        (
            curve
            for curve in animation.drivers_of(ob)
            if curve.data_path.startswith(start) and curve.data_path != hook and not curve.mute
        ),
        key=lambda curve: (curve.data_path, curve.array_index),
    )


def sets_switch(curve: bpy.types.FCurve) -> bool:
    """Whether a driver of drivers_of_settings sets a modifier's switch for viewport or renders."""
    return curve.data_path.rpartition(".")[2] in SHOWS


def followed_by(ob: bpy.types.Object, names: Iterable[str]) -> list[tuple[bpy.types.Object, str]]:
    """Returns what the modifiers of these names follow, each as returned by `followed`. ob: original."""
    found = [followed(ob.modifiers[name]) for name in names if name in ob.modifiers]
    return [each for each in found if each is not None]


def followed(modifier: Any) -> tuple[bpy.types.Object, str] | None:
    """Returns what a modifier follows: (object, name of a bone, property in SHAPES, or "" for the transform), or
    None."""
    if modifier.type == "HOOK":
        return None if modifier.object is None else (modifier.object, bone_of(modifier))
    target = cage_of(modifier)
    return None if target is None else (target, SHAPES[modifier.type])


def cage_of(modifier: Any) -> Any:
    """Returns the object whose shape a modifier follows, or None, also for other modifiers."""
    if modifier.type not in SHAPES:
        return None
    target = modifier.target if modifier.type == "SURFACE_DEFORM" else modifier.object
    kind = "LATTICE" if modifier.type == "LATTICE" else "MESH"
    return target if target is not None and target.type == kind else None


def bone_of(modifier: Any) -> str:
    """Returns the name of the bone that a Hook modifier follows; "" if there is none of that name, and for other
    modifiers. A driver that waited for a bone that does not exist would become invalid."""
    if modifier.type != "HOOK" or modifier.object is None or modifier.object.type != "ARMATURE":
        return ""
    return modifier.subtarget if modifier.subtarget in modifier.object.data.bones else ""


def _bones(armature: bpy.types.Object, names: Collection[str] | None) -> Iterator[tuple[str, bpy.types.Object, str]]:
    """Yields the variables that wait for the deforming bones of these names.

    All B-bones are among them, because their segments are evaluated last. Of the others, those are left out that are
    evaluated before another such bone, see _before. Each variable costs time on each frame, so a glove does not wait
    for the feet.
    """
    deforming = [bone for bone in armature.data.bones if bone.use_deform and (names is None or bone.name in names)]
    above = _before(armature, deforming)
    for bone in deforming:
        if bone.bbone_segments > 1:
            yield "OBJECT", armature, _segments_path(bone.name)
        elif bone.name not in above:
            yield "BONE", armature, bone.name


def _before(armature: bpy.types.Object, bones: Iterable[bpy.types.Bone]) -> set[str]:
    """Returns the names of those bones above these that Blender has evaluated whenever it has evaluated these. It is
    not sure of the parents of what a solver moves: a whole chain is solved at once, and then each of its bones is
    completed by itself."""
    solved = {
        name
        for bone in (armature.pose.bones if armature.pose is not None else ())
        if any(constraint.type in SOLVERS for constraint in dependencies.constraints_of(bone))
        for name in (bone.name, *(parent.name for parent in bone.parent_recursive))  # however long the chain is
    }
    lines = ([bone, *bone.parent_recursive] for bone in bones)
    return {parent.name for line in lines for child, parent in pairwise(line) if child.name not in solved}


def _segments_path(name: str) -> str:
    """Returns the path of a bone's property that waits for its segments."""
    return f'pose.bones["{bpy.utils.escape_identifier(name)}"].bbone_rollin'


def weighted_groups(ob: bpy.types.Object) -> set[str]:
    """Returns the names of the vertex groups of a mesh object in which some vertex has weight."""
    _offsets, groups, weights = meshes.read_object_weights(ob)
    counts = np.bincount(groups[(weights != 0) & (groups >= 0)], minlength=len(ob.vertex_groups))
    return {group.name for group, count in zip(ob.vertex_groups, counts.tolist()) if count}


class Waits(NamedTuple):
    """What a hook waits for."""

    targets: frozenset[tuple[int, str]]  # {(key of an object, name of a bone, property in SHAPES or "")}
    # Whether an object or a bone was deleted. Blender makes such a driver invalid, or does not evaluate it when it
    # should.
    has_lost_target: bool
    # {(key of a target object, name of a bone or path)} for all variables; for a B-bone, the path is the property that
    # waits for its segments.
    awaited: frozenset[tuple[int, str]]
    driven: tuple[Any, ...]  # descriptions of its copies of other drivers' variables, in order


class _Variables(NamedTuple):
    """What the variables of a hook are. A large rig has hundreds, so they are read again only if they have changed."""

    blocks: dict[int, int]  # {key of a data-block: number of the first variable that reads it}
    targets: frozenset[tuple[int, str]]
    awaited: frozenset[tuple[int, str]]
    bones: dict[int, list[str]]  # {key of an object: bones that are waited for}
    copies: list[int]  # numbers of its copies of other drivers' variables
    lacks_block: bool


_variables: dict[int, tuple[bytes, _Variables]] = {}  # by the address of the object, which outlives copies of its hook
MOST_KNOWN = 4096  # objects


def waits_of(hook: bpy.types.FCurve) -> Waits:
    """Reads the variables of a hook."""
    variables, found = hook.driver.variables, _variables_of(hook)

    def lacks_any(key: int, names: list[str]) -> bool:
        bones = getattr(variables[found.blocks[key]].targets[0].id.data, "bones", ())
        return any(name not in bones for name in names)

    has_lost_target = found.lacks_block or any(lacks_any(*each) for each in found.bones.items())
    described = tuple(driven.variable_description(variables[number]) for number in found.copies)
    return Waits(found.targets, has_lost_target, found.awaited, described)


def _variables_of(hook: bpy.types.FCurve) -> _Variables:
    variables, owner = hook.driver.variables, hook.id_data.as_pointer()
    now = driver_memory.digest_of_variables(hook.driver)
    before, found = _variables.get(owner, (None, None))
    # The addresses of data-blocks are in the digest, but another one may be at the same address by now.
    if (
        now is None
        or found is None
        or before != now
        or not all(key == values.key_of(variables[number].targets[0].id) for key, number in found.blocks.items())
    ):
        found = _read_variables(variables)
        if now is not None:
            if len(_variables) >= MOST_KNOWN:
                _variables.clear()
            _variables[owner] = now, found
    return found


def _read_variables(variables: Any) -> _Variables:
    blocks: dict[int, int] = {}
    bones: dict[int, list[str]] = {}
    keys: dict[Any, int] = {}
    awaited, targets, copies, lacks_block = set(), set(), [], False
    for number, variable in enumerate(variables):
        if driven.is_copied(variable):
            copies.append(number)
            continue
        target = variable.targets[0]
        block, bone, path = target.id, target.bone_target, target.data_path
        is_object = variable.type == "TRANSFORMS" or path in SHAPES.values()
        if block is None:
            lacks_block |= is_object
            continue
        if block not in keys:
            keys[block] = values.key_of(block)
            blocks[keys[block]] = number
        waited = keys[block], bone or path
        awaited.add(waited)
        if is_object:
            targets.add(waited)
            if bone:
                bones.setdefault(keys[block], []).append(bone)
    return _Variables(blocks, frozenset(targets), frozenset(awaited), bones, copies, lacks_block)


def is_waiting_for(
    awaited: Collection[tuple[int, str]], armature: bpy.types.Object, names: Collection[str] | None
) -> bool:
    """Whether a hook waits for the motion of all deforming bones of these names.

    awaited: see Waits; names: None for all.
    """
    key, bones = values.key_of(armature), armature.data.bones
    own = {name for owner, name in awaited if owner == key}
    bent = {bone.name for bone in bones if _segments_path(bone.name) in own}
    done = bent.union(name for name in own if name in bones)
    done |= _before(armature, [bones[name] for name in done])
    return all(
        bone.name in (bent if bone.bbone_segments > 1 else done)
        for bone in bones
        if bone.use_deform and (names is None or bone.name in names)
    )


def still_waits(hook: bpy.types.FCurve, armature: bpy.types.Object, groups: Collection[str] | None) -> bool:
    """Whether a hook that was wired for an armature waits for all deforming bones of these names, although the armature
    has other constraints by now. groups: see `hook_variables`, but weights are not needed."""
    awaited, bones = waits_of(hook).awaited, armature.data.bones
    if groups is not None:
        key = values.key_of(armature)
        waited = [bone for bone in bones if {(key, bone.name), (key, _segments_path(bone.name))} & awaited]
        above = {parent.name for bone in waited for parent in bone.parent_recursive}
        groups = above.intersection(groups)
    return is_waiting_for(awaited, armature, groups)


def wire(
    ob: bpy.types.Object,
    modifier: bpy.types.Modifier,
    targets: Iterable[tuple[bpy.types.Object, str]] = (),
    waits: bool = True,
    canvas: bpy.types.Object | None = None,
    replaced: Iterable[str] = (),
) -> None:
    """Adds the hook to that modifier, or renews it, so that it waits for everything that it needs now.

    targets, waits, canvas, replaced: see `hook_variables`. Of an Armature modifier that carries the hook, those that
    Multi Modifier mixes with it need not be among `replaced`.
    """
    for other in ob.modifiers:
        if other != modifier and hook_of(ob, other):
            animation.remove_driver(ob, path_of(other))
    replaced = set(replaced)
    mixed = mixed_modifiers(ob, modifier) if modifier.type == "ARMATURE" else []
    mixed += [each for each in ob.modifiers if each.type == "ARMATURE" and each.name in replaced and each not in mixed]
    armatures = dict.fromkeys(each.object for each in mixed if each.object is not None)
    bones = None if any(each.use_bone_envelopes for each in mixed) else weighted_groups(ob)
    if canvas is not None and len(canvas.modifiers) > 1 and bones is not None:
        bones = set(ob.vertex_groups.keys())  # a front may give weights to any of them, as Mirror does
    wanted = hook_variables(ob, list(armatures), bones, targets, waits, canvas, replaced)
    hook = hook_of(ob, modifier)
    if hook is not None and hook.driver.is_valid and _present(hook) == _described(wanted):
        return
    animation.remove_driver(ob, path_of(modifier))
    animation.drive(ob, path_of(modifier), wanted)


def _described(wanted: Iterable[tuple[str, str, Any, str]]) -> list[tuple[Any, ...]]:
    """Returns the variables of `hook_variables` without their names, with the description of those that are copies."""
    return [
        ("COPY", driven.variable_description(block), "") if kind == "COPY" else (kind, block, place)
        for _name, kind, block, place in wanted
    ]


def _present(hook: bpy.types.FCurve) -> list[tuple[Any, ...]]:
    """Returns the variables of a hook, as `_described` returns those that it must have."""
    found: list[tuple[Any, ...]] = []
    for variable in hook.driver.variables:
        target = variable.targets[0]
        if driven.is_copied(variable):
            found.append(("COPY", driven.variable_description(variable), ""))
        elif variable.type == "TRANSFORMS":
            is_ours = target.transform_space == animation.WAITING  # not so in files of earlier versions
            found.append(("BONE" if is_ours else "", target.id, target.bone_target))
        else:
            found.append((target.id_type, target.id, target.data_path))
    return found


def unwire(ob: bpy.types.Object) -> None:
    """Removes the hook, even if its modifier was removed, and clears the value that it left in the property."""
    for modifier in ob.modifiers:
        if modifier.type == "ARMATURE" and getattr(modifier, CARRIER):
            setattr(modifier, CARRIER, False)
    for curve in [curve for curve in ob.animation_data.drivers if is_hook(curve)] if ob.animation_data else ():
        animation.remove_curve(ob, curve)


def waits_for(hook: bpy.types.FCurve, name: str) -> Any:
    """Returns the data-block that the hook waits for under the name "mesh", "keys" or "canvas", or None.

    In an evaluated object's hook it is an evaluated copy: the mesh before all modifiers. (The object's own `data` is
    still the last result.)
    """
    target = target_of(hook, name)
    return target and target.id


def source_of(hook: bpy.types.FCurve) -> Any:
    """Returns the evaluated mesh that an evaluated object's hook reads, and writes the shape to: the mesh before all
    modifiers, or the result of the object's canvas, in which no other object has a part. None if there is none."""
    canvas = waits_for(hook, "canvas")
    return canvas.data if canvas is not None else waits_for(hook, "mesh")


def target_of(hook: bpy.types.FCurve, name: str) -> Any:
    """Returns the target of the hook's variable of that name, or None."""
    variable = hook.driver.variables.get(name)
    return variable and variable.targets[0]


def revive(ob: bpy.types.Object) -> None:
    """Makes Blender evaluate the hook again if it became invalid because the add-on was not there."""
    hook = find_hook(ob)
    if hook and not hook.driver.is_valid:
        hook.driver.is_valid = True
        ob.update_tag()
