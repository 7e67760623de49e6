"""The hook: the driver of a bound mesh by which Blender calls Sinew in its own evaluation.

It drives a property of a modifier, the carrier: one that means nothing on a mesh, but has Blender wait for the driver
before it evaluates the mesh. The carrier is the first Armature modifier that Sinew stands in for; where there is none,
Sinew's own modifier. Its first variable reads `sinew.deform_now`, whose `get`
deforms the mesh; the others name what has to be there by then: the mesh, its shape keys, places, and the bones. There
is no scripted expression in it, so it works where scripts of files may not run; and where the add-on is not there,
the property does not exist, and nothing happens.

The Armature modifier itself stays as it is, switched on. Sinew switches it off in the evaluated copy alone, in the
same pass, and its own modifier on (`switch`): so a file plays without Sinew as if Sinew had never been there, and
Blender's tools find the modifier that they look for.
"""

import bpy
import numpy as np

from ..blender import animation, meshes, values
from ..host import switches

HOOK = "sinew.deform_now"
CARRIER = "use_apply_on_spline"  # of a modifier: for curves alone


def path_of(modifier, name=CARRIER):
    return f'modifiers["{bpy.utils.escape_identifier(modifier.name)}"].{name}'


def hook_of(ob, modifier):
    """The driver, or None."""
    curve = animation.find_driver(ob, path_of(modifier))
    return curve if curve is not None and _is_hook(curve) else None


def _is_hook(curve):
    return any(
        variable.type == "SINGLE_PROP" and variable.targets[0].data_path == HOOK for variable in curve.driver.variables
    )


def carrier_of(ob):
    """The modifier with the hook, or None. ob: original or evaluated."""
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


def taken_modifiers(ob):
    """The Armature modifiers that Sinew stands in for, in their order; none, if it is keys and smoothing alone."""
    carrier = carrier_of(ob)
    return mixed_modifiers(ob, carrier) if carrier is not None and carrier.type == "ARMATURE" else []


def mixed_modifiers(ob, modifier):
    """The Armature modifiers that Multi Modifier joins, this one first: a later one starts from the same
    shape as the first, and the two results are mixed. An ordinary modifier stands alone."""
    chain = [modifier]
    originals = ob.original.modifiers  # in an evaluated copy Sinew itself has switched them off
    for later in list(ob.modifiers)[ob.modifiers.find(modifier.name) + 1 :]:
        if later.type != "ARMATURE" or not later.use_multi_modifier:
            break
        if later.object is not None and is_shown(originals[later.name]):
            chain.append(later)
    return chain


def driven_settings(ob, modifiers):
    """Names of properties of these modifiers that drivers set, but for the hook. (Keyframes come before the hook.)"""
    if not ob.animation_data:
        return []
    starts = tuple(path_of(modifier, "") for modifier in modifiers)
    return [
        curve.data_path.rpartition(".")[2]
        for curve in ob.animation_data.drivers
        if curve.data_path.startswith(starts) and not curve.data_path.endswith(CARRIER)
    ]


def is_shown(modifier):
    return modifier.show_viewport or modifier.show_render


def does_nothing(modifier):
    """Whether a modifier is switched off or lacks the object without which it changes nothing."""
    return not is_shown(modifier) or modifier.type in {"ARMATURE", "HOOK"} and modifier.object is None


SHOWS = ("show_viewport", "show_render")
OFF = (False, False)


def switch(ob, taken, shown, binds, run, own, deforms, through_keys):
    """Who deforms an evaluated object in the pass that goes on. taken: names of the Armature modifiers; shown, binds:
    of each, as `shown_of` and `binds_of` give them; run: the runs.Run behind them; own: name of Sinew's, or None;
    deforms: Sinew does, else Blender's own modifiers do; through_keys: the evaluated keys have the shape, so that
    whoever asks for the Armature modifier and them (Save as Shape Key) must not get it twice."""
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


def shown_of(ob, modifier):
    """(in the viewport, in renders): the switches of a modifier of an object, original or evaluated, as its owner
    set them; None if keyframes or drivers do so, and nobody else may."""
    original = ob.original.modifiers[modifier.name]
    return None if is_switched(ob.original, original) else (original.show_viewport, original.show_render)


def is_switched(ob, modifier):
    """Whether keyframes or drivers of the object switch that modifier on and off."""
    return not set(SHOWS).isdisjoint(animation.animated_properties(ob, modifier))


def hook_variables(ob, armatures, bones, targets, waits):
    """What the hook is to have. bones: names of those whose motion matters, None for all; targets: [(object, name of a
    bone or "")] besides the armatures'; waits: for all that deforming needs, on each frame; else it only marks the
    modifier."""
    mesh = ob.data
    wanted = [("deform", "OBJECT", ob, HOOK)]
    if not waits:
        return wanted
    wanted.append(("mesh", "MESH", mesh, "vertices[0].hide"))
    if mesh.shape_keys is not None:
        wanted.append(("keys", "KEY", mesh.shape_keys, "use_relative"))
    wanted.append(("place", "OBJECT", ob, "location[0]"))  # its transform, as all of it is one to Blender
    for number, armature in enumerate(armatures):
        wanted.append((f"armature{number}", "BONE", armature, ""))
        wanted += [(f"bone{number}_{i}", *variable) for i, variable in enumerate(_bones(armature, bones))]
    return wanted + [(f"target{i}", "BONE", *target) for i, target in enumerate(targets)]


def _bones(armature, names):
    """The deforming bones of these names on which no other one hangs: all others are done before them. And B-bones,
    whose segments come last. Each variable costs its time on each frame, so a glove does not wait for the feet."""
    deforming = [bone for bone in armature.data.bones if bone.use_deform and (names is None or bone.name in names)]
    above = {parent.name for bone in deforming for parent in bone.parent_recursive}
    for bone in deforming:
        if bone.bbone_segments > 1:
            yield "OBJECT", armature, _segments_path(bone.name)
        elif bone.name not in above:
            yield "BONE", armature, bone.name


def _segments_path(name):
    return f'pose.bones["{bpy.utils.escape_identifier(name)}"].bbone_rollin'


def weighted_groups(ob):
    """Names of the vertex groups of a mesh object in which some vertex has weight."""
    _offsets, groups, weights = meshes.read_object_weights(ob)
    counts = np.bincount(groups[(weights != 0) & (groups >= 0)], minlength=len(ob.vertex_groups))
    return {group.name for group, count in zip(ob.vertex_groups, counts.tolist()) if count}


def awaited_bones(hook):
    """{(key of an armature object, name of a bone, or the path that waits for the segments of a B-bone)}"""
    targets = [variable.targets[0] for variable in hook.driver.variables]
    return frozenset(
        (values.key_of(target.id), target.bone_target or target.data_path)
        for target in targets
        if target.id is not None
    )


def is_waiting_for(awaited, armature, names):
    """Whether a hook waits for the motion of all deforming bones of these names. awaited: as awaited_bones gives them;
    names: None for all."""
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


def targets_of(hook):
    """{(key of an object, name of a bone or "")} that a hook waits for."""
    return {(values.key_of(target.id), target.bone_target) for target in _objects_of(hook) if target.id is not None}


def has_lost_target(hook):
    """An object or a bone was deleted: Blender gives up such a driver, or does not call it when it should."""
    return any(
        target.id is None or target.bone_target and target.bone_target not in target.id.data.bones
        for target in _objects_of(hook)
    )


def _objects_of(hook):
    return [variable.targets[0] for variable in hook.driver.variables if variable.type == "TRANSFORMS"]


def wire(ob, modifier, targets=(), waits=True):
    """Gives the object the hook, on that modifier, with what it has to wait for as things stand. targets: as
    `hook_variables` takes them."""
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


def _present(hook):
    found = []
    for variable in hook.driver.variables:
        target = variable.targets[0]
        if variable.type == "TRANSFORMS":
            found.append(("BONE", target.id, target.bone_target))
        else:
            found.append((target.id_type, target.id, target.data_path))
    return found


def unwire(ob):
    """Also of a modifier that is gone. What the driver has left in the property goes too."""
    for modifier in ob.modifiers:
        if modifier.type == "ARMATURE" and getattr(modifier, CARRIER):
            setattr(modifier, CARRIER, False)
    for curve in [curve for curve in ob.animation_data.drivers if _is_hook(curve)] if ob.animation_data else ():
        animation.remove_curve(ob, curve)


def waits_for(hook, name):
    """The data-block that the hook waits for under that name, "mesh" or "keys": of an evaluated object an evaluated
    copy, the mesh as it is before all modifiers (the object's own `data` is still the last result)."""
    target = target_of(hook, name)
    return target and target.id


def target_of(hook, name):
    """The hook's target of that name, or None."""
    variable = hook.driver.variables.get(name)
    return variable and variable.targets[0]


def revive(ob):
    """A hook that was found invalid, for the add-on was not there, is tried again."""
    carrier = carrier_of(ob)
    hook = carrier and hook_of(ob, carrier)
    if hook and not hook.driver.is_valid:
        hook.driver.is_valid = True
        ob.update_tag()


BINDS = ("use_vertex_groups", "use_bone_envelopes")


def binds_of(ob, modifier):
    """(use_vertex_groups, use_bone_envelopes) of a modifier of an object, original or evaluated, as its owner set
    them: they are cleared in evaluated copies that deform through shape keys."""
    original = ob.original.modifiers[modifier.name]
    return tuple(getattr(original, name) for name in BINDS)
