"""What people do with Sinew: on the mesh alone, for the twin shows what ought not to change."""

import bpy

from helpers import addon_module

from . import scene
from .kinds import kind, on_pair

OUTPUTS = ("MODIFIER", "MODIFIER", "MESH")


@on_pair(8)
def bind(random, ob, twin):
    scene.make_active(ob)
    bind_selected(random)


def gets_modifier(ob):
    """Whether it would be given an Armature modifier, which its twin has not."""
    bindable = addon_module("binding.bindable")
    armature = bindable.armature_to_bind(ob)
    return armature is not None and not bindable.modifiers_to_take(ob, armature)


@kind(1)
def bind_all(random):
    pairs = scene.pairs()
    if pairs:
        scene.make_active(*(ob for ob, _ in pairs))
        bind_selected(random)


def bind_selected(random):
    if any(gets_modifier(ob) for ob in (bpy.context.object, *bpy.context.selected_objects)):
        return
    try:
        bpy.ops.object.sinew_bind(output=random.choice(OUTPUTS))
    except RuntimeError as error:  # a sentence says why
        assert "Traceback" not in str(error), error


@on_pair(2)
def unbind(random, ob, twin):
    scene.make_active(ob)
    if bpy.ops.object.sinew_unbind.poll():
        bpy.ops.object.sinew_unbind()


@on_pair(2, in_any_mode=True)
def method(random, ob, twin):
    if ob.sinew.is_bound and ob.sinew.modifier:
        name = ob.sinew.modifier.name
        ob.sinew.method = random.choice(("LINEAR", "DUAL_QUATERNION"))
        twin.modifiers[name].use_deform_preserve_volume = ob.sinew.method == "DUAL_QUATERNION"


@on_pair(3)
def output(random, ob, twin):
    if ob.sinew.is_bound:
        ob.sinew.output = random.choice(OUTPUTS)


@on_pair(1)
def show_shape(random, ob, twin):
    ob.sinew.show_shape = random.random() < 0.5


@on_pair(0.5)
def remove_sinews_modifier(random, ob, twin):
    for modifier in [modifier for modifier in ob.modifiers if addon_module("blender.nodes").is_sinew(modifier)]:
        ob.modifiers.remove(modifier)


@on_pair(0.5)
def make_single_user(random, ob, twin):
    if ob.sinew.is_bound and ob.data.users > 1:
        scene.make_active(ob)
        if bpy.ops.object.sinew_make_single_user.poll():
            bpy.ops.object.sinew_make_single_user()
            twin.data = twin.data.copy()
