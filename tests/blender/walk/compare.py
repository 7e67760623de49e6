"""What has to hold after each step."""

import collections

import bpy
import numpy as np

from helpers import addon_module, depsgraph, diagonal, evaluated, own_positions, traces, traces_of
from relations_of_blender import bones_not_awaited

from . import scene

TOLERANCE = 1e-5  # of the diagonal
paths: collections.Counter = collections.Counter()  # by which bound meshes were deformed when they were compared
# Corrective Smooth turns by a corner's sides: where they are nearly parallel, the last bit of a position decides. And a
# negative factor amplifies rounding of all vertices in each iteration. Solidify moves along normals: of a face that is
# nearly a line, the last bit decides them.
FEW, LOOSE_TOLERANCE = 1 / 500, 5e-3
# Says something of the program, not of the modifier; and the property that the hook drives: it counts for curves alone.
NOT_SAID = {
    "settings",  # of collisions
    "use_apply_on_spline",
    "rna_type",
    "execution_time",
    "is_active",
    "persistent_uid",
    "falloff_curve",
    "map_curve",
    "debug_options",
    "show_expanded",
}


def assert_alike():
    """Every mesh and its twin."""
    for ob, twin in scene.pairs():
        entry = addon_module("run.characters").character(ob) if ob.sinew.is_bound else None
        if entry is not None and entry.is_deforming:
            paths[entry.way.kind + (" with a tail" if entry.way.tail is not None else "")] += 1
        where = f"{ob.name} ({'bound, ' + way(ob) if ob.sinew.is_bound else 'not bound'}, {ob.mode}): "
        for ours, theirs in (modifiers(ob), modifiers(twin)), (state(ob), state(twin)):
            assert ours == theirs, where + difference(ours, theirs)
        if not (ob.mode in ("WEIGHT_PAINT", "VERTEX_PAINT") and mixes_up_vertices(ob)):
            assert_same_shape(ob, twin, where)
        if not ob.data.is_editmode:
            assert_close(own_positions(ob), own_positions(twin), where + "its own vertices")
        for each in (twin,) if ob.sinew.is_bound else (ob, twin):
            assert_free(each, where)


def assert_bones_are_awaited():
    """By each mesh that Sinew deforms. Which one is missed would be seen only now and then."""
    bpy.context.view_layer.update()  # the mail may have changed a hook
    missed = bones_not_awaited(depsgraph())
    assert not missed, f"(mesh, bone that it does not wait for) {missed}"


def mixes_up_vertices(ob):
    """Whether a Hook behind modifiers of these kinds moves the first vertices of the mesh in place of the chosen ones.
    So does Blender without Sinew, but not to the active object in a paint mode, and only one of two can be that."""
    kinds, mixing = [each.type for each in ob.modifiers], addon_module("blender.modifier_types").BESIDE_SHAPE
    first = next((i for i, kind in enumerate(kinds) if kind in mixing), len(kinds))
    return any(each.type == "HOOK" and len(each.vertex_indices) for each in list(ob.modifiers)[first:])


def is_mix_split():
    """Whether Sinew's modifier stands before an Armature modifier that mixes with the one before. Sinew moves it away
    when it looks into the mail."""
    return any(
        addon_module("blender.nodes").is_sinew(modifier) and later.type == "ARMATURE" and later.use_multi_modifier
        for ob, _twin in scene.pairs()
        for modifier, later in zip(ob.modifiers, ob.modifiers[1:])
    )


def wiring():
    return addon_module("plan.wiring")


def way(ob):
    entry = addon_module("run.characters").character(ob)
    return entry.way.kind + " " + entry.way.reason if entry else "not evaluated yet"


def copy_again(ob, twin):
    """Has Blender copy both where shape keys are animated and there are several scenes: it may go on showing keyed
    points of another scene's frame, of a mesh without Sinew too, until it copies that one again, as Bind has it do."""
    keys = ob.data.shape_keys
    if len(bpy.data.scenes) > 1 and keys is not None and keys.animation_data is not None:
        for each in ob, twin:
            each.data.update_tag()
        bpy.context.view_layer.update()


def assert_same_shape(ob, twin, where):
    copy_again(ob, twin)
    assert ob.visible_get() == twin.visible_get(), where + "visible or not"
    if ob.visible_get():  # else Blender does not evaluate it
        # The originals may have the places of another scene's evaluation.
        places = [each.evaluated_get(depsgraph()).matrix_world for each in (ob, twin)]
        assert np.allclose(*places, atol=1e-6, equal_nan=True), where + "place"
        assert_close(evaluated(ob), evaluated(twin), where + "shape", looseness(ob))


def assert_same_shapes_in(graph):
    """Of a scene that need not be that of the window."""
    objects = graph.objects
    for ob in objects:
        twin = objects.get(scene.twin_name(ob.name))
        if scene.is_ours(ob) and twin is not None:
            shapes = evaluated(ob.original, graph), evaluated(twin.original, graph)
            assert_close(*shapes, f"{ob.name} in {graph.mode}", looseness(ob))


def looseness(ob):
    """(which part of the vertices may be farther off, by what part of the diagonal)."""
    if any(modifier.type == "CAST" for modifier in ob.modifiers):
        return FEW, np.inf  # it moves vertices away from a center, and one that is there somewhere
    kinds = {modifier.type for modifier in ob.modifiers}
    if not kinds.isdisjoint({"SURFACE_DEFORM", "TRIANGULATE"}):
        # The last bit of a position decides to which face it is bound, and where faces are cut.
        return (50 if "SOLIDIFY" in kinds else 20) * FEW, 10 * LOOSE_TOLERANCE
    factors = [modifier.factor for modifier in ob.modifiers if modifier.type == "CORRECTIVE_SMOOTH"]
    few = FEW if factors else 0.0
    if "SOLIDIFY" in kinds:  # along normals, and those of faces without an area have no direction
        few = 50 * FEW
    return (1.0 if min(factors, default=0) < 0 else few), LOOSE_TOLERANCE


def assert_close(ours, theirs, where, looseness=(0.0, TOLERANCE)):
    """looseness: as returned by that function."""
    loose, tolerance = looseness
    assert ours.shape == theirs.shape, f"{where}: {len(ours)} vertices, {len(theirs)} are due"
    finite = np.isfinite(theirs).all(axis=1)
    ours, theirs = ours[finite], theirs[finite]
    if len(theirs) and not np.array_equal(ours, theirs):
        errors = np.sort(np.abs(ours - theirs).max(axis=1)) / max(diagonal(theirs), 1e-9)
        assert errors[-1] < (tolerance if loose else TOLERANCE), f"{where}: {errors[-1]:.3g} of the diagonal"
        errors = errors[: len(errors) - int(len(errors) * loose)]
        assert (errors < TOLERANCE).all(), f"{where}: {errors[-1]:.3g} of the diagonal"


def modifiers(ob):
    """All that its modifiers say, but for Sinew's."""
    is_sinew = addon_module("blender.nodes").is_sinew
    return [said_by(ob, modifier) for modifier in ob.modifiers if not is_sinew(modifier)]


def said_by(ob, modifier):
    """But for what drivers set: after an undo, an original has the value that was stored, until it is evaluated."""
    drivers = ob.animation_data.drivers if ob.animation_data else ()
    driven = {curve.data_path for curve in drivers}
    names = [
        name
        for name in modifier.bl_rna.properties.keys()
        if name not in NOT_SAID and wiring().path_of(modifier, name) not in driven
    ]
    return {name: said(getattr(modifier, name)) for name in names}


def said(value):
    return list(value) if isinstance(value, bpy.types.bpy_prop_array) else str(value)


def state(ob):
    """What else of it Sinew could change."""
    keys, drivers = ob.data.shape_keys, ob.animation_data.drivers if ob.animation_data else ()
    return {
        "vertex groups": ob.vertex_groups.keys(),
        "shape keys": [(key.name, key.mute, round(key.value, 6), key.vertex_group) for key in keys.key_blocks]
        if keys
        else [],
        "drivers": [curve.data_path for curve in drivers if not wiring().is_hook(curve)],
        "properties": [name for name in ob.keys() if not name.startswith("sinew")],
        "attributes": sorted(name for name in ob.data.attributes.keys() if name[0] != "."),
        "parent": (ob.parent and ob.parent.name, ob.parent_type),
    }


def difference(ours, theirs):
    """Of two such lists or dicts, in as few words as it takes."""
    if isinstance(ours, list):
        names = [[each["name"] for each in modifiers] for modifiers in (ours, theirs)]
        if names[0] != names[1]:
            return f"modifiers {names[0]}, due are {names[1]}"
        return next(f"{a['name']}: {difference(a, b)}" for a, b in zip(ours, theirs) if a != b)
    return ", ".join(
        f"{name} {ours[name]}, due is {theirs.get(name)}" for name in ours if ours[name] != theirs.get(name)
    )


def assert_free(ob, where):
    """Nothing of Sinew's is left on a mesh that is not bound; a mesh that another object shares may be bound there."""
    assert not ob.sinew.is_bound, f"{where}{ob.name} is bound"
    is_shared = any(other.sinew.is_bound for other in bpy.data.objects if other.data == ob.data)
    left = [] if is_shared else traces_of(ob)
    assert left == [], f"{where}{left} was left"


def assert_given_back():
    """Everything is unbound: the file has nothing of Sinew's any more."""
    addon_module("main.handlers").before_save()  # the last bound mesh may have been deleted
    # What an object of a removed scene used is saved, and nothing uses it in the file that is opened.
    left = traces() + [mesh.name for mesh in bpy.data.meshes if ".deformed" in mesh.name and mesh.users]
    assert left == [], f"after all was unbound {left} was left"


def assert_copies_follow():
    """The deformed copies, where Sinew deforms all that is on show."""
    for ob, _ in scene.pairs():
        entry = addon_module("run.characters").character(ob)
        if entry is None or ob.sinew.deformed is None or ob.mode != "OBJECT" or not ob.visible_get():
            continue
        if ob.sinew.show_shape and entry.is_deforming and not entry.run.end:
            assert_close(own_positions(ob.sinew.deformed), evaluated(ob), f"{ob.name}: its deformed copy")
