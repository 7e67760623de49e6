"""What happens to a bound character by the way: modifiers renamed, armatures changed, bones renamed and deleted while
nobody looks. Nothing is lost, and no traceback shows."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose
from helpers import (
    addon_module,
    assert_same_shape,
    evaluated,
    import_rig,
    needs_memory,
    select,
    stages,
    traces,
    twin_of,
    way,
)


@pytest.fixture(autouse=True)
def no_tracebacks(capsys):
    """Blender prints what a handler or an operator raises, and goes on."""
    yield
    said = capsys.readouterr()
    assert "Traceback" not in said.err + said.out, said.err + said.out


def assert_plays(ob, twin, frames=(5, 8)):
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        assert_same_shape(ob, twin)


def assert_given_back(ob, twin):
    """Unbound, it is what its twin is."""
    select(ob)
    assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
    assert traces() == [] and ob.animation_data is None
    assert_plays(ob, twin)
    for ours, theirs in zip(ob.modifiers, twin.modifiers, strict=True):
        assert (ours.type, ours.object, ours.show_viewport, ours.show_render) == (
            theirs.type,
            theirs.object,
            theirs.show_viewport,
            theirs.show_render,
        )


# --- modifiers and armatures ----------------------------------------------------------------------


def test_the_armature_modifier_is_renamed(character):
    ob, twin, _ = character
    ob.modifiers["Armature"].name = 'My "Rig"'
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert_plays(ob, twin)
    assert way(ob) == "ATTRIBUTE"
    assert_given_back(ob, twin)


@pytest.fixture
def other_armature(fresh_scene):
    other = make_armature()
    for frame in (1, 10):
        pose(other, 20 + frame, False)
    return other


@pytest.mark.parametrize("chosen", ("mesh", "mesh and armature"))
def test_another_armature_is_chosen_in_the_panel_and_the_mesh_bound_again(character, other_armature, chosen):
    ob, twin, _ = character
    ob.sinew.armature = twin.modifiers["Armature"].object = other_armature
    assert_plays(ob, twin)
    select(*((ob,) if chosen == "mesh" else (ob, other_armature)))
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert_plays(ob, twin)
    assert_given_back(ob, twin)


def test_bound_again_to_another_armature(character, other_armature):
    """That one deforms it from now on, in place of the first."""
    ob, twin, _ = character
    twin.modifiers["Armature"].object = other_armature
    select(ob, other_armature)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert ob.sinew.armature == other_armature
    assert_plays(ob, twin)
    assert_given_back(ob, twin)


def test_bound_again_to_the_armature_of_another_modifier(character, other_armature):
    """It has one for each: Blender deforms it by both, and so does Sinew, which begins with the first."""
    ob, twin, armature = character
    for each in ob, twin:
        each.modifiers.new("Other", "ARMATURE").object = other_armature
    assert_plays(ob, twin)
    select(ob, other_armature)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    assert_plays(ob, twin)
    assert ob.sinew.armature == armature and ob.modifiers["Armature"].object == armature
    assert stages(ob) == ["Other"]
    assert_given_back(ob, twin)


@pytest.mark.parametrize("keys", (False, True), ids=("plain", "shape keys"))
def test_a_parent_that_comes_later_and_deforms(character, other_armature, keys):
    """Before all modifiers, so only Blender has what goes into them."""
    ob, twin, _ = character
    for each in ob, twin:
        if keys:
            add_shape_keys(each)
        each.parent, each.parent_type = other_armature, "ARMATURE"
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert_plays(ob, twin)
    assert way(ob) == "BLENDER"
    assert "deformed by its parent" in addon_module("run.characters").character(ob).way.reason
    for each in ob, twin:
        each.parent = None
    assert_plays(ob, twin)
    assert_given_back(ob, twin)


# --- what is refused ------------------------------------------------------------------------------


def an_armature_of_other_bones(ob):
    other = make_armature()
    for bone in other.data.bones:
        bone.name = f"other {bone.name}"
    select(ob, other)


def in_edit_mode(ob):
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")


def a_mix_from_the_middle(ob):
    other = make_armature()
    second = ob.modifiers.new("Second", "ARMATURE")
    second.object, second.use_multi_modifier = other, True
    select(ob, other)


def a_parent_that_deforms(ob):
    ob.parent, ob.parent_type = ob.sinew.armature, "ARMATURE"
    select(ob)


@pytest.mark.parametrize(
    "spoil",
    (an_armature_of_other_bones, in_edit_mode, a_mix_from_the_middle, a_parent_that_deforms),
    ids=lambda spoil: spoil.__name__,
)
def test_a_refused_binding_changes_nothing(character, spoil):
    ob, _, armature = character
    modifier = ob.modifiers["Armature"]
    modifier.use_deform_preserve_volume, modifier.vertex_group = True, "bone2"
    spoil(ob)

    def state():
        settings = {
            name: getattr(ob.sinew, name)
            for name in ("is_bound", "source", "output", "installed_output", "armature", "method")
        }
        return (
            settings,
            [(m.name, m.show_viewport, m.show_render, m.as_pointer()) for m in ob.modifiers],
            [curve.data_path for curve in ob.animation_data.drivers],
            modifier.vertex_group,
            traces(),
        )

    before = state()
    bind = addon_module("install.bind")
    with pytest.raises(bind.BindingError):
        bind.bind(ob, next((each for each in bpy.context.selected_objects if each.type == "ARMATURE"), armature))
    assert state() == before and before[0]["is_bound"]


def test_an_armature_modifier_that_cannot_be_put_first(fresh_scene, monkeypatch):
    """As Blender refuses it of some overrides."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    ob.modifiers.clear()
    ob.modifiers.new("Cast", "CAST")
    monkeypatch.setattr(addon_module("blender.nodes"), "_move", lambda *_: None)
    select(ob, armature)
    with pytest.raises(RuntimeError, match="Blender does not allow Armature before Cast on Tube"):
        bpy.ops.object.sinew_bind()
    assert [modifier.name for modifier in ob.modifiers] == ["Cast"]
    assert not ob.sinew.is_bound and not ob.sinew.has_added_modifier and traces() == []


# --- bones ----------------------------------------------------------------------------------------


def hide(ob, away):
    ob.hide_viewport = away


def enter_edit_mode(ob, away):
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT" if away else "OBJECT")


def switch_off(ob, away):
    ob.modifiers["Armature"].show_viewport = not away


AWAY = pytest.mark.parametrize("go", (hide, enter_edit_mode, switch_off), ids=lambda go: go.__name__)


@AWAY
@pytest.mark.parametrize("opened", (False, True), ids=("just now", "when the file is opened"))
def test_a_bone_is_renamed_while_sinew_does_not_deform(character, go, opened, tmp_path):
    ob, twin, armature = character
    names = [each.name for each in character]
    go(ob, True)
    if opened:
        path = str(tmp_path / "away.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        ob, twin, armature = (bpy.data.objects[name] for name in names)
    bpy.context.view_layer.update()
    armature.data.bones["bone2"].name = "elbow"
    bpy.context.view_layer.update()
    go(ob, False)
    for each in ob, twin:
        assert "elbow" in each.vertex_groups and "bone2" not in each.vertex_groups
    assert_plays(ob, twin)


@AWAY
def test_bones_are_edited_while_sinew_does_not_deform(character, go):
    ob, twin, armature = character
    go(ob, True)
    if go is not enter_edit_mode:
        select(armature)
        bpy.ops.object.mode_set(mode="EDIT")
        armature.data.edit_bones["bone2"].roll += 0.5
        armature.data.edit_bones.remove(armature.data.edit_bones["side"])
        bpy.ops.object.mode_set(mode="OBJECT")
    armature.data.bones["bone1"].use_deform = False
    bpy.context.view_layer.update()
    go(ob, False)
    assert_plays(ob, twin)


def test_a_bone_of_a_further_modifier_is_renamed(fresh_scene, other_armature):
    """Of a mix, in which each armature has bones of its own."""
    armature = make_armature()
    other_armature.data.bones["bone3"].name = "other3"
    ob = make_mesh(armature, False)
    ob.vertex_groups.new(name="other3").add(range(600, 1200), 0.6, "REPLACE")
    second = ob.modifiers.new("Second", "ARMATURE")
    second.object, second.use_multi_modifier, second.vertex_group = other_armature, True, "bone1"
    twin = twin_of(ob)
    accelerate(ob)
    assert_plays(ob, twin, (3, 6))
    other_armature.data.bones["other3"].name = "elbow"
    for each in ob, twin:
        assert "elbow" in each.vertex_groups and "other3" not in each.vertex_groups
    assert_plays(ob, twin)
    assert len(ob.sinew.modifiers) == 2


@needs_memory
def test_a_bone_of_shared_armature_data_is_deleted(fresh_scene, character):
    """Through another object that has the same data. Blender gives up the driver, which waits for the bone."""
    ob, twin, armature = character
    other = armature.copy()
    fresh_scene.collection.objects.link(other)
    assert_plays(ob, twin, (2, 3))
    select(other)
    bpy.ops.object.mode_set(mode="EDIT")
    for name in ("bone4", "side"):
        other.data.edit_bones.remove(other.data.edit_bones[name])
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert_plays(ob, twin, (5, 6))
    entry = addon_module("run.characters").character(ob)
    assert entry.plan.hook_of(ob).driver.is_valid and entry.is_deforming


@needs_memory
def test_a_further_modifier_is_mixed_in_later(character, other_armature):
    """Blender evaluates its armature first: else its pose would now and then be that of the frame before."""
    ob, twin, armature = character
    for each in ob, twin:
        second = each.modifiers.new("Second", "ARMATURE")
        second.object, second.use_multi_modifier, second.vertex_group = other_armature, True, "bone1"
    assert_plays(ob, twin, (3, 6))
    entry = addon_module("run.characters").character(ob)
    targets = [variable.targets[0].id for variable in entry.plan.hook_of(ob).driver.variables]
    assert entry.taken == ("Armature", "Second") and armature in targets and other_armature in targets


def test_a_bone_of_a_mesh_that_several_objects_have_is_renamed(fresh_scene):
    armature = make_armature()
    objects = [make_mesh(armature, False)]
    objects.append(objects[0].copy())
    fresh_scene.collection.objects.link(objects[1])
    twin = twin_of(objects[0])
    pose(armature, 1, False)
    pose(armature, 10, False)
    select(*objects)
    bpy.ops.object.sinew_bind()
    armature.data.bones["bone2"].name = "elbow"
    for ob in objects:
        assert "elbow" in ob.vertex_groups
        assert_plays(ob, twin)


@needs_memory
def test_a_bone_loses_its_parent(fresh_scene):
    """Blender then evaluates the parent at any time, no longer before the bone, so the hook has to wait for it too."""
    ob, armature = import_rig("capsule")
    look = addon_module("main.handlers").look_into_the_mail

    def awaited():
        hook = addon_module("run.characters").character(ob).plan.hook_of(ob)
        return {target.bone_target for variable in hook.driver.variables for target in variable.targets} - {""}

    look()
    assert awaited() == {"tip"}
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    armature.data.edit_bones["lower"].parent = None
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()
    look()
    assert awaited() == {"base", "tip"}


@pytest.mark.parametrize("keys", (False, True), ids=("plain", "shape keys"))
def test_all_bones_are_deleted_and_made_anew(character, keys):
    """As Rigify's Re-Generate does."""
    ob, twin, armature = character
    for each in (ob, twin) if keys else ():
        add_shape_keys(each)
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    bones = armature.data.edit_bones
    kept = [(bone.name, bone.head.copy(), bone.tail.copy(), bone.parent and bone.parent.name) for bone in bones]
    for bone in list(bones):
        bones.remove(bone)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(armature.data.bones) == 0
    assert_plays(ob, twin)
    bpy.ops.object.mode_set(mode="EDIT")
    for name, head, tail, parent in kept:
        bone = bones.new(name)
        bone.head, bone.tail, bone.parent = head, tail, bones.get(parent) if parent else None
    bpy.ops.object.mode_set(mode="OBJECT")
    before = evaluated(ob)
    assert_plays(ob, twin, (6, 3))
    assert np.abs(evaluated(ob) - before).max() > 0.1 and way(ob) == ("KEYS" if keys else "ATTRIBUTE")


# --- what else ------------------------------------------------------------------------------------


@pytest.mark.parametrize("when", ("before", "after"))
@pytest.mark.parametrize("kind", ("MULTIRES", "SOFT_BODY"))
def test_modifiers_that_want_deforming_ones_before_them(fresh_scene, kind, when):
    """Blender's own modifier deforms such a mesh."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    twin = twin_of(ob)
    pose(armature, 1, False)
    pose(armature, 10, False)
    for each in (ob, twin) if when == "before" else ():
        each.modifiers.new("Behind", kind)
    accelerate(ob)
    for each in (ob, twin) if when == "after" else ():
        each.modifiers.new("Behind", kind)
    bpy.context.view_layer.update()
    assert_plays(ob, twin, (1, 2, 3))
    assert way(ob) == "BLENDER" and "Behind allows only deforming" in addon_module("run.characters").of(ob).way.reason
    for each in ob, twin:
        each.modifiers.remove(each.modifiers["Behind"])
    assert_plays(ob, twin)
    assert way(ob) == "ATTRIBUTE"


def test_the_addon_is_switched_on_in_an_open_file(character, tmp_path):
    """That was opened without it."""
    names = [each.name for each in character[:2]]
    path = str(tmp_path / "bound.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    package = bpy.types.VIEW3D_PT_sinew.__module__.rpartition(".ui.")[0]
    try:
        bpy.ops.preferences.addon_disable(module=package)
        bpy.ops.wm.open_mainfile(filepath=path)
        ob, twin = (bpy.data.objects[name] for name in names)
        assert_plays(ob, twin)
    finally:
        bpy.ops.preferences.addon_enable(module=package)
    bpy.context.view_layer.update()
    assert_same_shape(ob, twin)
    assert_plays(ob, twin, (6, 3))
    assert way(ob) == "ATTRIBUTE"


@pytest.mark.parametrize("keyed", (False, True), ids=("free", "keyed"))
def test_a_transform_that_is_not_keyed_stays(character, keyed):
    """Of a mesh that nothing is the parent of, when it is bound and when it is given back."""
    ob, _, _ = character
    if keyed:
        for frame in (1, 10):
            ob.keyframe_insert("location", frame=frame)
    for operator in bpy.ops.object.sinew_unbind, bpy.ops.object.sinew_bind:
        ob.location, ob.rotation_euler, ob.scale = (1, 2, 3), (0.1, 0.2, 0.3), (1, 2, 1)
        bpy.context.view_layer.update()
        place = ob.matrix_world.copy()
        select(ob)
        assert operator() == {"FINISHED"}
        bpy.context.view_layer.update()
        assert ob.matrix_world == place and tuple(ob.location) == (1, 2, 3)
