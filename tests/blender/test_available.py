"""Each operator that is not available says what to do, in one line."""

import re

import bpy
import pytest

from characters import accelerate, make_armature, make_mesh, pose, select
from helpers import addon_module

PACKAGE = bpy.types.VIEW3D_PT_sinew.__module__.rpartition(".ui.")[0]
# What can be asked for at any time.
ALWAYS = {
    "import_scene.sinew_rig",
    "import_scene.sinew_drop_rig",
    "object.sinew_accelerate_again",
    "object.sinew_report_rig",
    "object.sinew_select_bone",
    "object.sinew_show_driver",
    "wm.sinew_manual",
    "wm.sinew_take_flag_down",
}
MOST_LETTERS = 80


def subclasses(cls):
    for each in cls.__subclasses__():
        yield each
        yield from subclasses(each)


def operators():
    own = {cls for cls in subclasses(bpy.types.Operator) if cls.__module__.startswith(PACKAGE)}
    return sorted((cls for cls in own if getattr(cls, "is_registered", False)), key=lambda cls: cls.bl_idname)


def in_mode(mode):
    def prepare():
        armature, mesh = character()
        select(armature if mode == "POSE" else mesh)
        if mode == "WEIGHT_PAINT":
            armature.select_set(True)
        bpy.ops.object.mode_set(mode=mode)

    return prepare


def character(is_bound=True):
    armature = make_armature()
    mesh = make_mesh(armature, False)
    pose(armature, 1, False)
    if is_bound:
        accelerate(mesh)
    return armature, mesh


def nothing():
    select()
    bpy.context.view_layer.objects.active = None


def an_empty():
    ob = bpy.data.objects.new("Empty", None)
    bpy.context.collection.objects.link(ob)
    select(ob)


def a_cube():
    bpy.ops.mesh.primitive_cube_add()


def a_mesh():
    select(character(False)[1])


def a_bound_mesh():
    select(character()[1])


def an_armature():
    select(character()[0])


def one_without_meshes():
    select(make_armature())


def a_linked_mesh(tmp_path):
    _armature, mesh = character()
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {mesh})
    name = mesh.name
    bpy.data.objects.remove(mesh)
    with bpy.data.libraries.load(path, link=True) as (_, to):
        to.objects = [name]
    bpy.context.collection.objects.link(to.objects[0])
    select(to.objects[0])


SITUATIONS = [nothing, an_empty, a_cube, a_mesh, a_bound_mesh, an_armature, one_without_meshes]
MODES = [in_mode(mode) for mode in ("EDIT", "WEIGHT_PAINT", "SCULPT", "POSE")]


def told(cls):
    """Returns what the operator says before it is available, and makes sure that a script is told the same."""
    why = cls.why_not(bpy.context)
    group, name = cls.bl_idname.split(".")
    operator = getattr(getattr(bpy.ops, group), name)
    assert operator.poll() == (not why), cls
    if why:
        assert len(why) <= MOST_LETTERS and not why.endswith("."), why
        assert why[0].isupper(), why
        with pytest.raises(RuntimeError, match=re.escape(why)):
            operator()
    return why


def test_all_say_why_not(fresh_scene, tmp_path):
    own = [cls for cls in operators() if cls.bl_idname not in ALWAYS]
    assert {cls.bl_idname for cls in own if not hasattr(cls, "why_not")} == set()
    reasons = {cls.bl_idname: set() for cls in own}
    for prepare in (*SITUATIONS, *MODES, lambda: a_linked_mesh(tmp_path)):
        prepare()
        for cls in own:
            reasons[cls.bl_idname].add(told(cls))
        if bpy.context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
    assert all(any(each) for each in reasons.values()), reasons


def test_while_the_animation_plays(fresh_scene, monkeypatch):
    an_armature()

    class Playing:
        mode, view_layer, active_object = "OBJECT", bpy.context.view_layer, bpy.context.active_object
        selected_objects = bpy.context.selected_objects

        class screen:
            is_animation_playing = True

    for name, cls in (("bake", "Bake"), ("played_rigs", "Record"), ("to_bones", "BakeToBones")):
        assert getattr(addon_module(f"ui.{name}"), cls).why_not(Playing) == "Stop the animation first"
