"""What people do with Sinew: on the mesh alone, for the twin shows what ought not to change."""

import bpy

from helpers import RIGS, addon_module, evaluated, way

from . import compare, scene
from .kinds import kind, on_pair
from .object_steps import MOST_PAIRS

OUTPUTS = ("MODIFIER", "MODIFIER", "MESH")


@on_pair(8)
def bind(random, ob, twin):
    scene.make_active(ob)
    bind_selected(random)


def gets_modifier(ob):
    """Whether it would be given an Armature modifier, which its twin has not."""
    bindable = addon_module("plan.bindable")
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


@kind(9)
def find_stencils(random):
    """As if enough frames had been played."""
    searching = addon_module("stencils.searching")
    searching.IS_READ = random.random() < 0.3
    searching.note_edit()
    for is_render in (False, True):
        for ob in searching._lacking(is_render):
            searching._frames[addon_module("blender.values").key_of(ob), is_render] = searching.FRAMES_AHEAD
    bpy.context.scene.frame_set(bpy.context.scene.frame_current)


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


# --- methods of its own ---------------------------------------------------------------------------


@on_pair(1)
def own_method(random, ob, twin):
    """For a moment: compared with the modifier's, or with a copy that is bound anew."""
    if not ob.sinew.is_bound or not ob.sinew.modifier or not ob.visible_get() or not ob.data.vertices:
        return
    skinning, was = ob.sinew.skinning, ob.sinew.method
    method = random.choice(("BLENDED", "ROTATION_CENTERS", "DIRECT_DELTA_MUSH"))
    skinning.share = random.choice((0, 1))
    skinning.iterations, skinning.variant = random.choice((1, 5)), random.choice("015")
    addon_module("install.precomputing").drop(ob)  # what was computed before an edit stays until it is requested again
    ob.sinew.method = method
    addon_module("install.bind").prepare_method(ob)
    expected = of_another(ob, twin) if way(ob) != "BLENDER" else None  # whose own modifier does not know the method
    if expected is not None:
        compare.assert_close(evaluated(ob), expected, f"{ob.name}, {ob.sinew.method}")
    ob.sinew.method = was


def of_another(ob, twin):
    """The shape of a mesh that is deformed by the method of this one. None if no other mesh can be bound like it:
    its bones or groups have changed since."""
    if ob.sinew.method == "BLENDED":
        modifier = twin.modifiers[ob.sinew.modifier.name]
        was, modifier.use_deform_preserve_volume = modifier.use_deform_preserve_volume, ob.sinew.skinning.share == 1
        shape = evaluated(twin)
        modifier.use_deform_preserve_volume = was
        return shape
    copy = ob.copy()
    copy.name, copy.data = "Another", ob.data.copy()
    bpy.context.scene.collection.objects.link(copy)
    bind = addon_module("install.bind")
    bind.unbind(copy)
    try:
        bind.bind(copy, ob.sinew.armature, method=ob.sinew.method)
        shape = evaluated(copy)
        bind.unbind(copy)
    except bind.BindingError:
        shape = None
    mesh = copy.data
    bpy.data.objects.remove(copy)
    bpy.data.meshes.remove(mesh)
    return shape


# --- rigs with poses of their own -----------------------------------------------------------------


@kind(1)
def import_rig(random):
    """A bound character, whose armature imported poses move."""
    scene.leave_modes()
    if len(scene.pairs()) >= MOST_PAIRS:
        return
    name = scene.next_name(scene.OURS)
    bpy.ops.import_scene.sinew_rig(filepath=str(RIGS["capsule"]), pose="walk.dmat", output=random.choice(OUTPUTS))
    ob = bpy.context.active_object
    ob.sinew.armature.name = scene.next_name("Rig ")
    twin = ob.copy()
    twin.data = ob.data.copy()
    bpy.context.collection.objects.link(twin)
    addon_module("install.bind").unbind(twin)
    ob.name, twin.name = name, scene.twin_name(name)


@kind(1)
def play_poses(random):
    found = [ob for ob in scene.armatures() if addon_module("clips.clip_store").has_poses(ob.data)]
    if found:
        clip = random.choice(found).sinew_clip
        clip.mode = random.choice(("REST", "POSED", "FACTOR", "SWING", "PLAYBACK", "PLAYBACK"))
        clip.factor, clip.frame_start, clip.speed = random.random(), random.uniform(-5, 5), random.uniform(-2, 2)


@on_pair(1)
def choose_poses(random, ob, twin):
    ob.sinew.source = random.choice(("CLIP", "ARMATURE"))


# --- the add-on -----------------------------------------------------------------------------------


@kind(0.7)
def off_and_on(random):
    """Meanwhile Blender deforms; whatever others have cleared before, it can be switched off and on."""
    scene.leave_modes()
    switch_off_and_on(random)


HANDLERS = "frame_change_pre", "frame_change_post", "depsgraph_update_post", "load_post", "save_pre", "undo_post"


@kind(0.5)
def clear_handlers(random):
    """Sinew's: Blender's own add-ons could not be switched off without theirs."""
    scene.leave_modes()
    for name in random.sample(HANDLERS, 2):
        handlers = getattr(bpy.app.handlers, name)
        handlers[:] = [each for each in handlers if ".sinew." not in f".{each.__module__}"]
    switch_off_and_on(random)


def switch_off_and_on(random):
    pairs = [(ob.name, twin.name) for ob, twin in scene.pairs()]
    module = addon_module("run.characters").__name__.removesuffix(".run.characters")
    bpy.ops.preferences.addon_disable(module=module)
    try:
        bpy.context.scene.frame_set(random.randint(1, scene.LAST_FRAME))
        for ob, twin in pairs:
            compare.assert_same_shape(bpy.data.objects[ob], bpy.data.objects[twin], f"{ob}, without the add-on: ")
    finally:
        bpy.ops.preferences.addon_enable(module=module)
