"""Adds, finds and removes the hook: the driver of a bound mesh through which Blender's evaluation calls Sinew.

The hook drives a property of a modifier, the carrier. The property has no effect on a mesh, but makes Blender evaluate
the driver before the mesh. The carrier is the first Armature modifier that Sinew replaces, otherwise Sinew's own
modifier. The hook's first variable reads `sinew.deform_now`, whose `get` function deforms the mesh. The other variables
name what has to be evaluated first: the mesh, its shape keys, transforms and bones. The driver has no scripted
expression, so it works where scripts in files are disabled. Without the add-on the property does not exist, and nothing
happens.

The Armature modifier itself is left as it is, switched on. In the same pass, and only in the evaluated copy, Sinew
switches it off and its own modifier on (`switch`). So a file plays without Sinew as if it had never been bound, and
Blender's tools find the modifier that they look for.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Any

import bpy
import numpy as np

from ..blender import animation, meshes, values
from ..host import switches

HOOK = "sinew.deform_now"
CARRIER = "use_apply_on_spline"  # of a modifier: affects only curves


def path_of(modifier: bpy.types.Modifier, name: str = CARRIER) -> str:
    """Returns the path of a modifier's property from its object: by default the one that the hook drives."""
    return f'modifiers["{bpy.utils.escape_identifier(modifier.name)}"].{name}'


def hook_of(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> Any:
    """Returns the hook on that modifier, or None."""
    curve = animation.find_driver(ob, path_of(modifier))
    return curve if curve is not None and _is_hook(curve) else None


def _is_hook(curve: bpy.types.FCurve) -> bool:
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
        if later.object is not None and is_shown(originals[later.name]):
            chain.append(later)
    return chain


def driven_settings(ob: bpy.types.Object, modifiers: Iterable[bpy.types.Modifier]) -> list[str]:
    """Returns the names of the properties of these modifiers that drivers set, except for the hook.

    Keyframes are left out: Blender evaluates them before the hook.
    """
    if not ob.animation_data:
        return []
    starts = tuple(path_of(modifier, "") for modifier in modifiers)
    return [
        curve.data_path.rpartition(".")[2]
        for curve in ob.animation_data.drivers
        if curve.data_path.startswith(starts) and not curve.data_path.endswith(CARRIER)
    ]


def is_shown(modifier: bpy.types.Modifier) -> bool:
    """Whether a modifier is switched on in the viewport or in renders."""
    return modifier.show_viewport or modifier.show_render


def does_nothing(modifier: bpy.types.Modifier) -> bool:
    """Whether a modifier is switched off, or lacks the object that it needs to have an effect."""
    return not is_shown(modifier) or modifier.type in {"ARMATURE", "HOOK"} and modifier.object is None


SHOWS = ("show_viewport", "show_render")
OFF = (False, False)


def switch(
    ob: bpy.types.Object,
    taken: Sequence[str],
    shown: Sequence[Any],
    binds: Sequence[tuple[bool, bool]],
    run: Any,
    own: str | None,
    deforms: bool,
    through_keys: bool,
) -> None:
    """Sets which modifiers deform an evaluated object in the current pass.

    taken: names of the Armature modifiers; shown, binds: of each, as returned by `shown_of` and `binds_of`; run: the
    runs.Run behind them; own: name of Sinew's modifier, or None; deforms: Sinew deforms, otherwise Blender's own
    modifiers do; through_keys: the evaluated keys have the shape. Then the Armature modifiers are also unbound, so that
    code that applies both them and the keys (Save as Shape Key) does not deform twice.
    """
    modifiers = ob.modifiers
    for number, name in enumerate(taken):
        evaluated = modifiers[name]
        if deforms or shown[number] is not None:
            switches.switch_modifier(evaluated, *(OFF if deforms else shown[number]))
        if through_keys:
            switches.bind_armature_modifier(evaluated, *(OFF if deforms else binds[number]))
    for name in run.stages:
        switches.switch_modifier(modifiers[name], *(OFF if deforms else run.shown))
    if own is not None:
        switches.switch_modifier(modifiers[own], *(run.shown if deforms and not through_keys else OFF))


def shown_of(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> tuple[bool, bool] | None:
    """Returns (in the viewport, in renders): the switches of a modifier as the user set them.

    None if keyframes or drivers set them; then Sinew must not. ob: original or evaluated.
    """
    original = ob.original.modifiers[modifier.name]
    return None if is_switched(ob.original, original) else (original.show_viewport, original.show_render)


def is_switched(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> bool:
    """Whether keyframes or drivers of the object switch that modifier on and off."""
    return not set(SHOWS).isdisjoint(animation.animated_properties(ob, modifier))


def hook_variables(
    ob: bpy.types.Object,
    armatures: Iterable[bpy.types.Object],
    bones: Collection[str] | None,
    targets: Iterable[tuple[bpy.types.Object, str]],
    waits: bool,
) -> list[tuple[str, str, Any, str]]:
    """Returns the variables that the hook must have: [(name, kind of data-block, data-block, path or bone)].

    bones: names of the bones whose motion matters, None for all; targets: [(object, name of a bone or "")] besides the
    armatures' bones; waits: whether the hook waits on each frame for all that deforming needs. Otherwise it only marks
    the modifier.
    """
    mesh = ob.data
    wanted = [("deform", "OBJECT", ob, HOOK)]
    if not waits:
        return wanted
    wanted.append(("mesh", "MESH", mesh, "vertices[0].hide"))
    if mesh.shape_keys is not None:
        wanted.append(("keys", "KEY", mesh.shape_keys, "use_relative"))
    wanted.append(("place", "OBJECT", ob, "location[0]"))  # the whole transform: Blender does not tell its parts apart
    for number, armature in enumerate(armatures):
        wanted.append((f"armature{number}", "BONE", armature, ""))
        wanted += [(f"bone{number}_{i}", *variable) for i, variable in enumerate(_bones(armature, bones))]
    return wanted + [(f"target{i}", "BONE", *target) for i, target in enumerate(targets)]


def _bones(armature: bpy.types.Object, names: Collection[str] | None) -> Iterator[tuple[str, bpy.types.Object, str]]:
    """Yields the variables that wait for the deforming bones of these names.

    All B-bones are among them, because their segments are evaluated last, and otherwise only bones with no other such
    bone below them, because Blender evaluates the parents first. Each variable costs time on each frame, so a glove
    does not wait for the feet.
    """
    deforming = [bone for bone in armature.data.bones if bone.use_deform and (names is None or bone.name in names)]
    above = {parent.name for bone in deforming for parent in bone.parent_recursive}
    for bone in deforming:
        if bone.bbone_segments > 1:
            yield "OBJECT", armature, _segments_path(bone.name)
        elif bone.name not in above:
            yield "BONE", armature, bone.name


def _segments_path(name: str) -> str:
    """Returns the path of a bone's property that waits for its segments."""
    return f'pose.bones["{bpy.utils.escape_identifier(name)}"].bbone_rollin'


def weighted_groups(ob: bpy.types.Object) -> set[str]:
    """Returns the names of the vertex groups of a mesh object in which some vertex has weight."""
    _offsets, groups, weights = meshes.read_object_weights(ob)
    counts = np.bincount(groups[(weights != 0) & (groups >= 0)], minlength=len(ob.vertex_groups))
    return {group.name for group, count in zip(ob.vertex_groups, counts.tolist()) if count}


def awaited_bones(hook: bpy.types.FCurve) -> frozenset[tuple[int, str]]:
    """Returns {(key of a target object, name of a bone or path)} for all variables of a hook.

    For a B-bone, the path is the property that waits for its segments.
    """
    targets = [variable.targets[0] for variable in hook.driver.variables]
    return frozenset(
        (values.key_of(target.id), target.bone_target or target.data_path)
        for target in targets
        if target.id is not None
    )


def is_waiting_for(
    awaited: Collection[tuple[int, str]], armature: bpy.types.Object, names: Collection[str] | None
) -> bool:
    """Whether a hook waits for the motion of all deforming bones of these names.

    awaited: as returned by awaited_bones; names: None for all.
    """
    key, bones = values.key_of(armature), armature.data.bones
    own = {name for owner, name in awaited if owner == key}
    bent = {bone.name for bone in bones if _segments_path(bone.name) in own}
    done = bent.union(name for name in own if name in bones)
    done.update(parent.name for name in tuple(done) for parent in bones[name].parent_recursive)
    return all(
        bone.name in (bent if bone.bbone_segments > 1 else done)
        for bone in bones
        if bone.use_deform and (names is None or bone.name in names)
    )


def targets_of(hook: bpy.types.FCurve) -> set[tuple[int, str]]:
    """Returns {(key of an object, name of a bone or "")} that a hook waits for."""
    return {(values.key_of(target.id), target.bone_target) for target in _objects_of(hook) if target.id is not None}


def has_lost_target(hook: bpy.types.FCurve) -> bool:
    """Whether an object or a bone that the hook waits for was deleted.

    Blender makes such a driver invalid, or does not evaluate it when it should.
    """
    return any(
        target.id is None or target.bone_target and target.bone_target not in target.id.data.bones
        for target in _objects_of(hook)
    )


def _objects_of(hook: bpy.types.FCurve) -> list[Any]:
    """Returns the targets of a hook that are objects or bones."""
    return [variable.targets[0] for variable in hook.driver.variables if variable.type == "TRANSFORMS"]


def wire(
    ob: bpy.types.Object,
    modifier: bpy.types.Modifier,
    targets: Iterable[tuple[bpy.types.Object, str]] = (),
    waits: bool = True,
) -> None:
    """Adds the hook to that modifier, or renews it, so that it waits for everything that it needs now.

    targets, waits: see `hook_variables`.
    """
    for other in ob.modifiers:
        if other != modifier and hook_of(ob, other):
            animation.remove_driver(ob, path_of(other))
    mixed = mixed_modifiers(ob, modifier) if modifier.type == "ARMATURE" else ()
    armatures = dict.fromkeys(each.object for each in mixed if each.object is not None)
    bones = None if any(each.use_bone_envelopes for each in mixed) else weighted_groups(ob)
    wanted = hook_variables(ob, list(armatures), bones, targets, waits)
    hook = hook_of(ob, modifier)
    if hook is not None and hook.driver.is_valid and _present(hook) == [variable[1:] for variable in wanted]:
        return
    animation.remove_driver(ob, path_of(modifier))
    animation.drive(ob, path_of(modifier), wanted)


def _present(hook: bpy.types.FCurve) -> list[tuple[str, Any, str]]:
    """Returns the variables of a hook, as in `hook_variables` but without their names."""
    found = []
    for variable in hook.driver.variables:
        target = variable.targets[0]
        if variable.type == "TRANSFORMS":
            found.append(("BONE", target.id, target.bone_target))
        else:
            found.append((target.id_type, target.id, target.data_path))
    return found


def unwire(ob: bpy.types.Object) -> None:
    """Removes the hook, even if its modifier was removed, and clears the value that it left in the property."""
    for modifier in ob.modifiers:
        if modifier.type == "ARMATURE" and getattr(modifier, CARRIER):
            setattr(modifier, CARRIER, False)
    for curve in [curve for curve in ob.animation_data.drivers if _is_hook(curve)] if ob.animation_data else ():
        animation.remove_curve(ob, curve)


def waits_for(hook: bpy.types.FCurve, name: str) -> Any:
    """Returns the data-block that the hook waits for under the name "mesh" or "keys", or None.

    In an evaluated object's hook it is an evaluated copy: the mesh before all modifiers. (The object's own `data` is
    still the last result.)
    """
    target = target_of(hook, name)
    return target and target.id


def target_of(hook: bpy.types.FCurve, name: str) -> Any:
    """Returns the target of the hook's variable of that name, or None."""
    variable = hook.driver.variables.get(name)
    return variable and variable.targets[0]


def revive(ob: bpy.types.Object) -> None:
    """Makes Blender evaluate the hook again if it became invalid because the add-on was not there."""
    carrier = carrier_of(ob)
    hook = carrier and hook_of(ob, carrier)
    if hook and not hook.driver.is_valid:
        hook.driver.is_valid = True
        ob.update_tag()


BINDS = ("use_vertex_groups", "use_bone_envelopes")


def binds_of(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> tuple[bool, bool]:
    """Returns (use_vertex_groups, use_bone_envelopes) of a modifier as the user set them.

    ob: original or evaluated. Evaluated copies that deform through shape keys have them cleared.
    """
    original = ob.original.modifiers[modifier.name]
    return tuple(getattr(original, name) for name in BINDS)
