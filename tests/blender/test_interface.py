"""What a person clicks that does not deform: cures, colours, skeleton, menus, files dropped, preferences."""

import logging
import shutil
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from characters import accelerate, make_armature, make_mesh, pose
from helpers import (
    RIGS,
    addon_module,
    assert_same_shape,
    builtin_copy,
    copied_rig,
    evaluated,
    import_rig,
    make_fail,
    needs_memory,
    own_positions,
    select,
)


@pytest.fixture
def tube(fresh_scene):
    armature = make_armature()
    ob = make_mesh(armature, False)
    pose(armature, 1, False)
    return ob


def warnings(ob):
    return [warning.text for warning in addon_module("ui.advice").warnings(ob)]


def influences(ob):
    return addon_module("run.characters").character(ob).deformer.influences


def sums(ob):
    return np.array([sum(entry.weight for entry in vertex.groups) for vertex in ob.data.vertices])


# --- warnings and their cures ---------------------------------------------------------------------


@needs_memory
def test_weights_that_do_not_sum_to_1(tube, fresh_scene):
    accelerate(tube)
    before = evaluated(tube)
    count = int((np.abs(sums(tube) - 1) > 0.05).sum())
    assert warnings(tube) == [f"The weights of {count:,} vertices do not sum to 1"]
    assert bpy.ops.object.sinew_normalize_weights() == {"FINISHED"}
    fresh_scene.frame_set(2)
    fresh_scene.frame_set(1)
    assert warnings(tube) == [] and np.allclose(sums(tube), 1, atol=1e-5)
    assert np.abs(evaluated(tube) - before).max() < 1e-5


@needs_memory
def test_vertices_without_a_bone(tube, fresh_scene):
    for group in tube.vertex_groups:
        group.remove(range(40, 60))
    accelerate(tube)
    assert warnings(tube)[0] == "20 vertices without a bone: kept in the rest pose"
    assert bpy.ops.object.sinew_select_unweighted() == {"FINISHED"}
    assert tube.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")
    selected = np.zeros(len(tube.data.vertices), bool)
    tube.data.vertices.foreach_get("select", selected)
    assert np.array_equal(np.flatnonzero(selected), range(40, 60))
    assert bpy.ops.object.sinew_fill_weights() == {"FINISHED"}
    fresh_scene.frame_set(1)
    assert not any("no bone" in text for text in warnings(tube))
    assert (sums(tube) > 0).all()
    assert_same_shape(tube, builtin_copy(tube))


def test_no_vertex_has_a_bone(tube):
    accelerate(tube)
    for group in tube.vertex_groups:
        group.remove(range(len(tube.data.vertices)))
    with pytest.raises(RuntimeError, match="No vertex of Tube follows a bone"):
        bpy.ops.object.sinew_fill_weights()


@needs_memory
def test_a_mesh_that_others_share(tube, fresh_scene):
    twin = tube.copy()
    fresh_scene.collection.objects.link(twin)
    accelerate(tube)
    assert not any("share" in text for text in warnings(tube))
    tube.shape_key_add(name="Basis")
    bpy.context.view_layer.update()
    assert "2 objects share this mesh" in warnings(tube)
    assert bpy.ops.object.sinew_make_single_user() == {"FINISHED"}
    assert tube.data != twin.data and not any("share" in text for text in warnings(tube))
    fresh_scene.frame_set(1)
    assert_same_shape(tube, twin)


def test_bones_that_no_longer_fit_the_poses(fresh_scene):
    ob, armature = import_rig("capsule")
    assert not any("Bones were moved" in text for text in warnings(ob))
    select(armature)
    armature.scale = (2, 2, 2)
    bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
    assert (
        "Bones were moved after the import, so the rig's poses no longer fit: undo that, or set Pose to Armature"
        in warnings(ob)
    )
    ob.sinew.source = "ARMATURE"
    assert not any("Bones were moved" in text for text in warnings(ob))


def hide_eye(armature):
    armature.hide_set(True)


def hide_in_viewports(armature):
    armature.hide_viewport = True


def exclude_collection(armature):
    collection = bpy.data.collections.new("Rigs")
    bpy.context.scene.collection.children.link(collection)
    for other in armature.users_collection:
        other.objects.unlink(armature)
    collection.objects.link(armature)
    bpy.context.view_layer.layer_collection.children["Rigs"].exclude = True


@pytest.mark.parametrize("hide", (hide_eye, hide_in_viewports, exclude_collection))
def test_a_hidden_armature_is_shown(tube, hide):
    armature = tube.modifiers["Armature"].object
    accelerate(tube)
    hide(armature)
    select(tube)
    assert "Rig is hidden" in warnings(tube)
    assert bpy.ops.object.sinew_show_skeleton() == {"FINISHED"}
    assert armature.visible_get() and armature.show_in_front
    assert not any("hidden" in text for text in warnings(tube))
    assert bpy.ops.object.sinew_show_skeleton() == {"FINISHED"}
    assert not armature.visible_get()


# --- switches -------------------------------------------------------------------------------------


@needs_memory
def test_the_shape_in_the_copy_can_be_switched_off(tube, fresh_scene):
    rest = own_positions(tube)
    accelerate(tube, "MESH")
    copy = tube.sinew.deformed
    deformed = own_positions(copy)
    assert np.abs(deformed - rest).max() > 0.1
    tube.sinew.show_shape = False
    assert np.array_equal(own_positions(copy), rest)
    fresh_scene.frame_set(2)
    assert np.array_equal(own_positions(copy), rest)
    assert not np.allclose(evaluated(tube), rest, atol=0.1)  # the bound mesh has switches of its own
    tube.sinew.show_shape = True
    fresh_scene.frame_set(1)
    assert np.array_equal(own_positions(copy), deformed)
    for shown, shape in ((False, rest), (True, deformed)):
        tube.modifiers["Armature"].show_viewport = shown
        bpy.context.view_layer.update()
        assert np.allclose(own_positions(copy), shape, atol=1e-5)


# --- weights as colours ---------------------------------------------------------------------------


def test_weight_colors():
    colors = addon_module("ui.display").weight_colors
    found = colors(np.array([0, 1, 3, 3]), np.array([0, 0, 1]), np.array([0.5, 0.25, 0.75]), 2)
    assert found.shape == (3, 4) and found.dtype == np.float32 and (found[:, 3] == 1).all()
    alone = [colors(np.array([0, 1]), np.array([group]), np.array([1.0]), 2)[0] for group in (0, 1)]
    assert np.allclose(found[0], alone[0]) and np.abs(alone[0] - alone[1]).max() > 0.3
    assert np.allclose(found[1], 0.25 * alone[0] + 0.75 * alone[1])
    assert (found[2, :3] < 0.1).all()


def test_weights_are_shown_and_put_away(tube, fresh_scene):
    accelerate(tube)
    before = evaluated(tube)
    own = tube.data.color_attributes.new("Mine", "BYTE_COLOR", "CORNER")
    tube.data.color_attributes.active_color = own
    assert bpy.ops.object.sinew_show_weights() == {"FINISHED"}
    attribute = tube.data.color_attributes["Sinew Weights"]
    assert tube.data.color_attributes.active_color == attribute
    colors = np.empty(4 * len(tube.data.vertices), np.float32)
    attribute.data.foreach_get("color", colors)
    assert len(np.unique(colors.reshape(-1, 4), axis=0)) > 100
    fresh_scene.frame_set(1)
    assert np.array_equal(evaluated(tube), before)
    assert bpy.ops.object.sinew_show_weights() == {"FINISHED"}
    assert tube.data.color_attributes.keys() == ["Mine"]
    assert tube.data.color_attributes.active_color.name == "Mine"
    assert "sinew_shown_before" not in tube.data


# --- importing as Blender's users do --------------------------------------------------------------


@pytest.fixture
def two_rigs(tmp_path):
    """A folder with two skeleton files."""
    folder = copied_rig(tmp_path)
    shutil.copy(folder / "skeleton.bf", folder / "again.bf")
    return folder


def files_of(folder, *names):
    return {"directory": f"{folder}/", "files": [{"name": name} for name in names]}


def test_several_files_at_once(two_rigs):
    assert bpy.ops.import_scene.sinew_rig(**files_of(two_rigs, "skeleton.bf", "again.bf")) == {"FINISHED"}
    assert sum(ob.sinew.is_bound for ob in bpy.data.objects) == 2
    assert len(bpy.context.selected_objects) == 4


def test_progress_of_several_files():
    said = []
    whole = SimpleNamespace(step=lambda share, _text: said.append(share))
    for number in range(2):
        part = addon_module("feedback.progress").Part(whole, number, 2)
        part.step(0.0, "reading")
        part.step(0.5, "building")
    assert said == [0.0, 0.25, 0.5, 0.75]


def test_one_of_several_files_is_bad(two_rigs):
    (two_rigs / "again.bf").write_text("nonsense")
    assert bpy.ops.import_scene.sinew_rig(**files_of(two_rigs, "skeleton.bf", "again.bf")) == {"FINISHED"}
    assert sum(ob.sinew.is_bound for ob in bpy.data.objects) == 1


@pytest.mark.skipif(bpy.app.version < (4, 1, 0), reason="this Blender has nothing that can be dropped")
def test_files_are_dropped(two_rigs):
    handler = bpy.types.FileHandler.bl_rna_get_subclass_py("IO_FH_sinew_rig")
    assert handler.bl_import_operator == "import_scene.sinew_rig"
    assert handler.bl_file_extensions == ".bf;.tgf"
    bpy.ops.wm.drop_import_file(**files_of(two_rigs, "skeleton.bf"))
    assert sum(ob.sinew.is_bound for ob in bpy.data.objects) == 1


def test_frame_rate(fresh_scene):
    fresh_scene.render.fps = 24
    ob, armature = import_rig("capsule", frame_rate=12.0)
    count = addon_module("clips.clip_store").pose_count(armature.data)
    assert armature.sinew_clip.speed == pytest.approx(0.5)
    if count > 2:
        assert fresh_scene.frame_end == 1 + 2 * (count - 1)
    fresh_scene.frame_set(3)
    half = evaluated(ob)
    armature.sinew_clip.speed = 1.0
    fresh_scene.frame_set(2)
    assert np.abs(evaluated(ob) - half).max() < 1e-6


def test_the_importers_options_can_be_kept():
    assert "PRESET" in addon_module("ui.rig_files").ImportRig.bl_options


# --- menus ----------------------------------------------------------------------------------------


class Items:
    """A menu's layout that notes operators and submenus."""

    def __init__(self):
        self.layout, self.found = self, []

    def operator(self, name, **_options):
        self.found.append(name)

    menu = operator

    def separator(self):
        pass


def test_everything_can_be_searched():
    """F3 searches menus: each operator stands in one, cures where they apply, but not those beside a sentence."""
    menus = addon_module("ui.menus")
    items = Items()
    for _, draw in menus.PLACES:
        draw(items, bpy.context)
    assert menus.SinewMenu.bl_idname in items.found
    menus.SinewMenu.draw(items, bpy.context)
    for name in ("operators", "display", "preferences", "played_rigs"):
        for cls in addon_module(f"ui.{name}").CLASSES:
            if issubclass(cls, bpy.types.Operator) and "INTERNAL" not in getattr(cls, "bl_options", ()):
                assert cls.bl_idname in items.found or cls.__name__ == "ToggleBoneLines"  # in the section Weights alone
                assert cls.bl_label and cls.__doc__


def test_the_menu_has_the_cures_that_apply(tube, fresh_scene):
    cures = [cls for name in ("cures", "method_settings") for cls in addon_module(f"ui.{name}").CLASSES]
    seen = set()
    for prepare in (lambda: None, lambda: accelerate(tube), lambda: fresh_scene.collection.objects.link(tube.copy())):
        prepare()
        select(tube)
        items = Items()
        addon_module("ui.menus").SinewMenu.draw(items, bpy.context)
        found = {cls for cls in cures if cls.bl_idname in items.found}
        assert found == {cls for cls in cures if not cls.why_not(bpy.context)} and found not in seen
        seen.add(frozenset(found))


# --- preferences ----------------------------------------------------------------------------------


@pytest.fixture
def preferences():
    found = addon_module("main.addon_preferences").of_sinew()
    yield found
    for name in ("thread_count", "instruction_set", "log_file"):
        found.property_unset(name)
    found.thread_count, found.log_file = 0, ""
    found.instruction_set = "auto"


def test_threads_and_instruction_set(preferences, tube, fresh_scene):
    native = addon_module("native").sinew_native
    accelerate(tube)
    shape = evaluated(tube)
    everything = native.thread_count()
    preferences.thread_count = 1
    assert native.thread_count() == 1
    slowest = native.instruction_sets()[-1]
    preferences.instruction_set = slowest
    assert native.instruction_set() == slowest
    fresh_scene.frame_set(2)
    fresh_scene.frame_set(1)
    assert np.abs(evaluated(tube) - shape).max() < 1e-5
    preferences.thread_count, preferences.instruction_set = 0, "auto"
    assert native.thread_count() == everything and native.instruction_set() == native.instruction_sets()[0]


@needs_memory
def test_what_goes_wrong_is_logged_once(preferences, tube, fresh_scene, tmp_path, monkeypatch):
    preferences.log_file = str(tmp_path / "sinew.log")
    accelerate(tube)
    make_fail(monkeypatch, tube.name)
    for frame in (2, 3, 4):
        fresh_scene.frame_set(frame)
    preferences.log_file = ""
    text = (tmp_path / "sinew.log").read_text()
    assert text.count("Sinew cannot deform Tube") == 1 and "It was told to fail" in text
    assert not logging.getLogger("sinew").handlers


@pytest.mark.says_errors
def test_a_log_that_cannot_be_written(preferences, tmp_path):
    preferences.log_file = str(tmp_path / "no folder" / "sinew.log")
    assert not logging.getLogger("sinew").handlers


def test_the_manual_is_in_the_package():
    manual = addon_module("ui.preferences").MANUAL
    text = manual.read_text()
    for page in manual.parent.glob("*.html"):
        assert page.stat().st_size > 1000
    assert "<h1" in text and RIGS["ogre"].parent.name in text
