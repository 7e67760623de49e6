"""Blender's own exporters: a bound character becomes the same file as an unbound one."""

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, make_tube, pose, smoothed
from exporting import enable_exporters, operator, skip_without
from helpers import (
    addon_module,
    assert_same_on_all_frames,
    diagonal,
    evaluated,
    is_deforming,
    maps_files,
    needs_memory,
    needs_rig_programs,
    twin_of,
    way,
)

FRAMES = range(1, 5)
USD = ("wm.usd_export", "wm.usd_import", "usdc")
GLTF = ("export_scene.gltf", "import_scene.gltf", "glb")
FBX = ("export_scene.fbx", "import_scene.fbx", "fbx")
OBJ = ("wm.obj_export", "wm.obj_import", "obj")
PLY = ("wm.ply_export", "wm.ply_import", "ply")
STL = ("wm.stl_export", "wm.stl_import", "stl")
COLLADA = ("wm.collada_export", "wm.collada_import", "dae")
ALEMBIC = ("wm.alembic_export", "wm.alembic_import", "abc")
# Operator that writes, operator that reads, ending, options.
EXPORTERS = {
    "USD": (*USD, {"export_animation": True}),
    "USD as in the viewport": (*USD, {"export_animation": True, "evaluation_mode": "VIEWPORT"}),
    "USD of one frame": (*USD, {"export_animation": False}),
    "USD without shape keys": (*USD, {"export_animation": True, "export_shapekeys": False}),
    "USD without armatures": (*USD, {"export_animation": True, "export_armatures": False}),
    "USD points": (*USD, {"export_animation": True, "export_armatures": False, "export_shapekeys": False}),
    "Alembic": (*ALEMBIC, {"as_background_job": False, "start": FRAMES[0], "end": FRAMES[-1]}),
    "glTF": (*GLTF, {}),
    "glTF with modifiers": (*GLTF, {"export_apply": True}),
    "glTF with modifiers, without skins": (*GLTF, {"export_apply": True, "export_skins": False}),
    "FBX": (*FBX, {}),
    "FBX without modifiers": (*FBX, {"use_mesh_modifiers": False}),
    "FBX without armatures": (*FBX, {"object_types": {"MESH"}}),
    "OBJ": (*OBJ, {}),
    "OBJ without modifiers": (*OBJ, {"apply_modifiers": False}),
    "PLY": (*PLY, {}),
    "PLY without modifiers": (*PLY, {"apply_modifiers": False}),
    "STL": (*STL, {}),
    "STL without modifiers": (*STL, {"apply_modifiers": False}),
    "Collada": (*COLLADA, {"include_shapekeys": True}),
    "Collada with modifiers": (*COLLADA, {"apply_modifiers": True}),
}
SMOOTHED = ("USD", "Alembic", "glTF with modifiers")  # written once more, with a modifier behind the armature


@pytest.fixture(scope="module", autouse=True)
def addons():
    enable_exporters()


def make_figure(with_keys, is_smoothed=False):
    """A tube by an armature, animated."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    if is_smoothed:
        smoothed(ob, iterations=2)
    if with_keys:
        add_shape_keys(ob)
        bumpy = ob.data.shape_keys.key_blocks["Bumpy"]  # files know of no key relative to another, nor of masks
        bumpy.vertex_group, bumpy.relative_key = "", ob.data.shape_keys.key_blocks[0]
    for frame in FRAMES:
        pose(armature, frame, False)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    return ob


def export(name, path):
    write, read, _, options = EXPORTERS[name]
    skip_without(write, read, options=options)
    path.parent.mkdir(exist_ok=True)
    bpy.context.scene.frame_set(3)  # some leave another frame behind
    assert operator(write)(filepath=str(path), **options) == {"FINISHED"}


def imported(name, path):
    """{what it is: array} of a file, as Blender reads it."""
    bpy.ops.wm.read_homefile(use_empty=True)
    assert operator(EXPORTERS[name][1])(filepath=str(path)) == {"FINISHED"}
    found = {}
    for ob in bpy.data.objects:
        if ob.type == "ARMATURE":
            found[ob.name, "bones"] = np.array([bone.matrix_local for bone in ob.data.bones])
        if ob.type == "MESH":
            found[ob.name, "mesh"] = addon_module("blender.meshes").read_positions(ob.data)
            for key in ob.data.shape_keys.key_blocks if ob.data.shape_keys else ():
                found[ob.name, key.name] = np.array([point.co for point in key.data])
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        for ob in bpy.data.objects:
            if ob.type == "MESH":
                found[ob.name, frame] = evaluated(ob) @ np.array(ob.matrix_world)[:3, :3].T
                for key in ob.data.shape_keys.key_blocks if ob.data.shape_keys else ():
                    found[ob.name, key.name, frame] = np.array([key.value])
    return found


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    "name, with_keys, is_smoothed",
    [
        pytest.param(name, with_keys, is_smoothed, marks=[maps_files] if name.startswith("OBJ") else [])
        for names, is_smoothed in ((EXPORTERS, False), (SMOOTHED, True))
        for name in names
        for with_keys in (False, True)
    ],
)
def test_a_bound_character_is_exported_as_an_unbound_one(tmp_path, name, with_keys, is_smoothed):
    ob = make_figure(with_keys, is_smoothed)
    unbound, bound = [tmp_path / folder / f"shot.{EXPORTERS[name][2]}" for folder in ("unbound", "bound")]
    export(name, unbound)
    accelerate(ob)
    assert way(ob) == ("KEYS" if with_keys else "ATTRIBUTE")
    export(name, bound)
    unbound, bound = imported(name, unbound), imported(name, bound)
    assert set(bound) == set(unbound) and len(unbound) > len(FRAMES)
    errors = {key: float(np.abs(bound[key] - value).max(initial=0.0)) for key, value in unbound.items()}
    assert max(errors.values()) < 1e-5, errors


@needs_memory
@needs_rig_programs
@pytest.mark.parametrize("name", EXPORTERS)
def test_a_character_whose_rig_is_computed_is_exported_as_an_unbound_one(tmp_path, name, monkeypatch):
    ob = make_figure(True, False)
    unbound, bound = [tmp_path / folder / f"shot.{EXPORTERS[name][2]}" for folder in ("unbound", "bound")]
    export(name, unbound)
    accelerate(ob)
    accelerating, rigs = (addon_module(f"played.{each}") for each in ("accelerating", "rigs"))
    monkeypatch.setattr(accelerating, "LEAST_WORK", 0)
    accelerating.accelerate(bpy.context.scene, bpy.context.view_layer)
    assert len(rigs.played()) == 1, [rig.reason for rig in rigs.known()]
    export(name, bound)
    unbound, bound = imported(name, unbound), imported(name, bound)
    assert set(bound) == set(unbound) and len(unbound) > len(FRAMES)
    errors = {key: float(np.abs(bound[key] - value).max(initial=0.0)) for key, value in unbound.items()}
    assert max(errors.values()) < 1e-5, errors


@pytest.mark.parametrize("is_keyed", (False, True), ids=("at rest", "keyed"))
@pytest.mark.parametrize("name", [name for name in EXPORTERS if "armatures" not in name and "skins" not in name])
def test_a_bound_prop_is_exported_as_an_unbound_one(tmp_path, name, is_keyed):
    """It has shape keys, and no armature."""
    ob = make_tube()
    ob.shape_key_add(name="Basis")
    key = ob.shape_key_add(name="Wide")
    for point in key.data:
        point.co.x *= 2
    key.value = 0.5
    for frame, value in ((1, 0.2), (4, 0.9)) if is_keyed else ():
        key.value = value
        key.keyframe_insert("value", frame=frame)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    unbound, bound = [tmp_path / folder / f"prop.{EXPORTERS[name][2]}" for folder in ("unbound", "bound")]
    export(name, unbound)
    accelerate(ob)
    assert way(ob) == "KEYS"
    export(name, bound)
    assert is_deforming(ob)
    unbound, bound = imported(name, unbound), imported(name, bound)
    assert set(bound) == set(unbound)
    errors = {key: float(np.abs(bound[key] - value).max(initial=0.0)) for key, value in unbound.items()}
    assert max(errors.values()) < 1e-5, errors
    if "glTF" in name:
        assert any("Wide" in what for what in unbound)


@pytest.mark.usefixtures("usd")
@pytest.mark.parametrize("with_keys", (False, True))
def test_usd_itself_moves_the_file_to_the_shape_that_blender_shows(tmp_path, with_keys):
    """Its own skinning, which other programs use."""
    from pxr import Usd, UsdGeom, UsdSkel

    ob = make_figure(with_keys)
    accelerate(ob)
    export("USD", tmp_path / "shot.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "shot.usdc"))
    assert UsdSkel.BakeSkinning(stage.Traverse())
    (mesh,) = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        shown = evaluated(ob)
        to_world = np.array(UsdGeom.Xformable(mesh).ComputeLocalToWorldTransform(frame))
        assert np.allclose(to_world, np.array(ob.matrix_world).T)
        assert np.abs(np.array(mesh.GetPointsAttr().Get(frame)) - shown).max() < 1e-4 * diagonal(shown)


@needs_memory
@pytest.mark.parametrize("name", ("USD points", "Alembic"))
def test_points_have_the_shape_of_what_sinew_alone_can_do(tmp_path, name):
    """No skeleton could say it."""
    ob = make_figure(False)
    accelerate(ob)
    bpy.context.scene.frame_set(3)
    linear = evaluated(ob)
    ob.sinew.skinning.smooth_iterations = 5
    shown = {}
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        shown[frame] = evaluated(ob)
    assert np.abs(shown[3] - linear).max() > 0.01
    export(name, tmp_path / f"shot.{EXPORTERS[name][2]}")
    found = imported(name, tmp_path / f"shot.{EXPORTERS[name][2]}")
    for frame in FRAMES:
        assert np.abs(found["Tube", frame] - shown[frame]).max() < 1e-5


@pytest.mark.parametrize("with_keys", (False, True))
def test_after_an_export_sinew_goes_on(tmp_path, with_keys):
    ob = make_figure(with_keys)
    twin = twin_of(ob)
    accelerate(ob)
    for number in range(2):
        export("USD", tmp_path / f"{number}.usdc")
        assert_same_on_all_frames(bpy.context.scene, ob, twin, FRAMES)
        assert addon_module("run.characters").character(ob).is_deforming
