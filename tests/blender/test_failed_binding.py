"""A binding that fails has changed nothing, whatever the mesh was bound to before."""

import bpy
import pytest

from characters import accelerate, add_shape_keys, animate, make_armature, make_mesh, pose, smoothed
from helpers import addon_module, data_counts, evaluated, into_a_shot, needs_memory, own_positions, select, traces

NOT_KEPT = {"rna_type", "execution_time", "deform_now"}  # the last is the hook


@pytest.fixture
def tube(fresh_scene):
    """An animated mesh with smoothing and shape keys, not bound."""
    armature = make_armature()
    for frame in (1, 10):
        pose(armature, frame, False)
    ob = make_mesh(armature, True)
    add_shape_keys(ob)
    smoothed(ob, iterations=3)
    ob.modifiers["Armature"].vertex_group = "bone2"
    fresh_scene.frame_set(3)
    return ob


def is_bound_without_armature(ob):
    ob.modifiers["Armature"].show_viewport = ob.modifiers["Armature"].show_render = False
    addon_module("install.bind").bind(ob, None)


BEFORE = {
    "unbound": lambda ob: None,
    "bound": accelerate,
    "bound with a copy": lambda ob: accelerate(ob, "MESH"),
    "bound without armature": is_bound_without_armature,
}


def without_groups(ob):
    ob.vertex_groups.clear()
    return ob.modifiers["Armature"].object


def parented_directly(ob):
    other = make_armature()
    ob.parent, ob.parent_type = other, "ARMATURE"
    return other


def in_edit_mode(ob):
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    return ob.modifiers["Armature"].object


def mixed(ob):
    second = ob.modifiers.new("Second", "ARMATURE")
    second.object, second.use_multi_modifier = make_armature(), True
    ob.modifiers.active = second
    addon_module("blender.nodes").move_modifier(ob, second, ob.modifiers.find("Armature") + 1)
    return second.object


def mixed_with_nobody(ob):
    other = mixed(ob)
    ob.modifiers["Armature"].object = None
    return other


def held_by_keyframes(ob):
    second = ob.modifiers.new("Second", "ARMATURE")
    second.object = make_armature()
    animate(second, use_apply_on_spline=(True, False))
    return second.object


def nothing_to_take_over(ob):
    ob.shape_key_clear()
    ob.modifiers["Corrective"].show_viewport = ob.modifiers["Corrective"].show_render = False
    ob.modifiers["Armature"].object = None


def refused_by_blender(ob):
    """As it does for some overrides."""
    ob.modifiers["Armature"].object = None
    ob.modifiers.active = ob.modifiers["Corrective"]
    return make_armature()


FAILURES = {
    without_groups: "No vertex group",
    parented_directly: "deformed by its parent Rig.001 directly",
    in_edit_mode: "Edit Mode",
    mixed: "Multi Modifier",
    mixed_with_nobody: "has no armature: choose one there",
    held_by_keyframes: "use_apply_on_spline of Second of Tube is driven or animated",
    nothing_to_take_over: "no armature, shape keys or smoothing",
    refused_by_blender: r"Blender does not allow Armature\S* before Corrective on Tube",
}


def everything(ob):
    """All of it that a binding changes."""
    keys = ob.data.shape_keys
    drivers = ob.animation_data.drivers if ob.animation_data else ()
    copy = ob.sinew.deformed
    return {
        "modifiers": [(modifier.as_pointer(), settings_of(modifier)) for modifier in ob.modifiers],
        "active modifier": ob.modifiers.active and ob.modifiers.active.name,
        "drivers": {curve.data_path: (curve.driver.is_valid, variables_of(curve)) for curve in drivers},
        "settings": settings_of(ob.sinew),
        "properties": sorted(ob.keys()),
        "parent": (ob.parent, ob.parent_type),
        "attributes": sorted(ob.data.attributes.keys()),
        "keys": [(key.name, key.value, key.mute) for key in keys.key_blocks] if keys else [],
        "positions": own_positions(ob).tobytes(),
        "copy": copy and (copy.name, copy.parent.name, own_positions(copy).tobytes()),
        "shape": evaluated(ob).tobytes(),
        "file": (data_counts(), traces()),
        "selection": (bpy.context.object, bpy.context.selected_objects),
    }


def settings_of(item):
    names = [name for name in item.bl_rna.properties.keys() if name not in NOT_KEPT]
    return {name: str(getattr(item, name)) for name in names}


def variables_of(curve):
    return [
        (variable.name, variable.type, target.id, target.data_path, target.bone_target)
        for variable in curve.driver.variables
        for target in variable.targets
    ]


def assert_fails_without_a_change(ob, armature, sentence, output="MODIFIER"):
    bpy.context.view_layer.update()
    addon_module("run.mail").deliver()
    before = everything(ob)
    bind = addon_module("install.bind")
    with pytest.raises(bind.BindingError, match=sentence):
        bind.bind(ob, armature, output)
    bpy.context.view_layer.update()
    addon_module("run.mail").deliver()
    after = everything(ob)
    assert [name for name in before if before[name] != after[name]] == []


@needs_memory
@pytest.mark.parametrize("fail", FAILURES, ids=lambda fail: fail.__name__)
@pytest.mark.parametrize("before", BEFORE)
def test_a_binding_that_fails_has_changed_nothing(tube, monkeypatch, before, fail):
    BEFORE[before](tube)
    if before.startswith("bound") and fail in (mixed_with_nobody, nothing_to_take_over, refused_by_blender):
        if before != "bound without armature":
            pytest.skip("it would be bound to what it is bound to")
    armature = fail(tube)
    if fail is refused_by_blender:
        monkeypatch.setattr(addon_module("blender.nodes"), "_move", lambda *_: None)
    assert_fails_without_a_change(tube, armature, FAILURES[fail])


@needs_memory
@pytest.mark.parametrize("before", BEFORE)
def test_with_the_output_mesh(tube, before):
    BEFORE[before](tube)
    tube.data.shape_keys.use_relative = False
    armature = tube.modifiers["Armature"].object
    assert_fails_without_a_change(tube, armature, "cannot use the output Mesh", output="MESH")


@pytest.mark.parametrize("is_bound", (False, True))
def test_an_override_that_cannot_have_an_armature_modifier(tube, tmp_path, is_bound):
    """What the library has stands first there, before 3.5."""
    if bpy.app.version >= (3, 5, 0):
        pytest.skip("this Blender lets it go first")
    collection = bpy.data.collections.new("Character")
    bpy.context.scene.collection.children.link(collection)
    armature = tube.modifiers["Armature"].object
    tube.modifiers.remove(tube.modifiers["Armature"])
    for each in tube, armature:
        bpy.context.collection.objects.unlink(each)
        collection.objects.link(each)
    into_a_shot(tmp_path, overridden=True)
    found = {ob.type: ob for ob in bpy.data.objects if ob.override_library}
    if is_bound:
        addon_module("install.bind").bind(found["MESH"], None)
    assert_fails_without_a_change(found["MESH"], found["ARMATURE"], "Blender does not allow Armature before")


def test_of_a_linked_mesh(tube, tmp_path):
    collection = bpy.data.collections.new("Character")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(tube)
    into_a_shot(tmp_path, overridden=False)
    ob = next(ob for ob in bpy.data.objects if ob.type == "MESH")
    assert_fails_without_a_change(ob, ob.modifiers["Armature"].object, "linked from another file")


@needs_memory
def test_of_a_deformed_copy(tube):
    accelerate(tube, "MESH")
    copy = tube.sinew.deformed
    assert_fails_without_a_change(copy, tube.sinew.armature, "is the deformed copy of Tube")


def test_an_armature_modifier_of_sinews_goes_along_to_another_armature(tube):
    """It stays in its place with its settings, and goes when the mesh is unbound."""
    armature, other = tube.modifiers["Armature"].object, make_armature()
    tube.modifiers.remove(tube.modifiers["Armature"])
    bind = addon_module("install.bind")
    bind.bind(tube, armature)
    tube.modifiers["Armature"].use_deform_preserve_volume = True
    for wanted in other, other, armature:
        bind.bind(tube, wanted)
        assert tube.sinew.armature == wanted and tube.modifiers["Armature"].use_deform_preserve_volume
        assert [modifier.type for modifier in tube.modifiers].count("ARMATURE") == 1
    bind.unbind(tube)
    assert [modifier.type for modifier in tube.modifiers] == ["CORRECTIVE_SMOOTH"]
