"""Objects: placed, parented, hidden, duplicated, joined, deleted."""

import bpy

from helpers import addon_module, override, select

from . import compare, scene
from .kinds import kind, on_both, on_pair
from .mesh_steps import MOST_VERTICES

MOST_PAIRS = 5


@on_both(2, in_any_mode=True)
def place(random, ob):
    ob.location, ob.rotation_euler = scene.some(random, 2), scene.some(random, 1)
    if random.random() < 0.3:
        ob.scale = [random.uniform(0.5, 2) for _ in range(3)]
    scene.take_keyframes()


@on_both(0.7, in_any_mode=True)
def key_place(random, ob):
    for frame in (1, 15):
        ob.location, ob.rotation_euler = scene.some(random, 1), scene.some(random, 1)
        ob.keyframe_insert("location", frame=frame)
        ob.keyframe_insert("rotation_euler", frame=frame)
    scene.take_keyframes()


@on_both(1.5)
def parent(random, ob):
    rigs = [each for each in scene.armatures() if len(each.data.bones)]
    ob.update_tag()  # Blender does not notice by itself that its parent no longer deforms it
    if not rigs or random.random() < 0.3:
        ob.parent = None
        return
    rig = random.choice(rigs)
    ob.parent, ob.parent_type = rig, random.choice(("OBJECT", "OBJECT", "OBJECT", "BONE", "BONE", "ARMATURE"))
    if ob.parent_type == "BONE":
        ob.parent_bone = random.choice(rig.data.bones.keys())


def has_room(ob):
    """Whether it may get one more modifier. Sinew's own do not count, for its twin has none."""
    is_sinew = addon_module("blender.nodes").is_sinew
    return sum(not is_sinew(modifier) for modifier in ob.modifiers) < 8


@on_both(0.7)
def parent_with_automatic_weights(random, ob):
    """Ctrl P: adds an Armature modifier, and groups by names or envelopes."""
    if scene.armatures() and has_room(ob):
        select(random.choice(scene.armatures()), ob)
        bpy.ops.object.parent_set(type=random.choice(("ARMATURE_NAME", "ARMATURE_ENVELOPE", "ARMATURE")))


@on_both(0.7)
def parent_with_sinew_weights(random, ob):
    """Adds an Armature modifier too, and makes weights. Blender may not know where a hidden armature is."""
    rigs = [rig for rig in scene.armatures() if rig.visible_get()]
    if rigs and has_room(ob) and ob.data.vertices:
        select(random.choice(rigs), ob)
        settings = {"stiffness": random.choice((2.0, 8.0)), "max_influences": random.choice((0, 3))}
        bpy.ops.object.sinew_parent_with_weights(**settings)


@on_both(2)
def hide(random, ob):
    if random.random() < 0.5:
        ob.hide_viewport = random.random() < 0.4
    else:
        ob.hide_set(random.random() < 0.4)


@kind(1)
def compare_hidden(random):
    """They are shown, and hidden again."""
    scene.leave_modes()
    hidden = [(ob, ob.hide_viewport, ob.hide_get()) for pair in scene.pairs() for ob in pair]
    collections = [(each, each.hide_viewport) for each in bpy.data.collections]
    for collection, _ in collections:
        collection.hide_viewport = False
    for ob, *_ in hidden:
        ob.hide_viewport = False
        ob.hide_set(False)
    bpy.context.view_layer.update()
    compare.assert_alike()
    for ob, in_viewports, in_this in hidden:
        ob.hide_set(in_this)
        ob.hide_viewport = in_viewports
    for collection, was_hidden in collections:
        collection.hide_viewport = was_hidden


@kind(1)
def show_all(random):
    for ob, twin in scene.pairs():
        for each in ob, twin:
            each.hide_viewport = False
            each.hide_set(False)


@on_pair(1.5)
def duplicate(random, ob, twin):
    """Alone or with its armature, with a mesh of its own or a common one."""
    if len(scene.pairs()) >= MOST_PAIRS:
        return
    rigs = scene.armatures()
    others = [random.choice(rigs)] if rigs and len(rigs) < 4 and random.random() < 0.4 else []
    linked, name = random.random() < 0.4, scene.next_name(scene.OURS)
    for each in ob, twin:
        each.hide_viewport = False
        each.hide_set(False)
        for collection in each.users_collection:
            collection.hide_viewport = False
    select(ob, twin, *others)
    before = set(bpy.data.objects)
    bpy.ops.object.duplicate(linked=linked)
    new = [each for each in bpy.data.objects if each not in before and not each.sinew.copied_from]
    for each in new:
        if each.name.startswith(ob.name + ".") and each.type == "MESH":
            each.name = name
        elif each.name.startswith(twin.name + "."):
            each.name = scene.twin_name(name)
        elif each.type == "ARMATURE":
            each.name = scene.next_name("Rig ")


@on_pair(1.2)
def delete(random, ob, twin):
    if len(scene.pairs()) > 1:
        scene.make_active(ob, twin)
        if random.random() < 0.5:
            bpy.ops.object.delete()
        else:
            for each in ob, twin:
                bpy.data.objects.remove(each)


@kind(2)
def add_character(random):
    scene.leave_modes()
    if len(scene.pairs()) < 3:
        if not scene.armatures():
            scene.new_armature(random)
        scene.new_character(random)


@on_pair(0.4)
def join(random, ob, twin):
    """Another character into this one. Not keys that are relative to each other in a circle: there 5.2 never ends."""
    other, its_twin = random.choice(scene.pairs())
    if has_circle(other) or has_circle(ob):
        return
    if other != ob and len(scene.pairs()) > 2 and len(ob.data.vertices) + len(other.data.vertices) < 4000:
        scene.make_active(ob, other)
        done = bpy.ops.object.join() if bpy.ops.object.join.poll() else {"CANCELLED"}
        scene.make_active(twin, its_twin)
        assert (bpy.ops.object.join() if bpy.ops.object.join.poll() else {"CANCELLED"}) == done


def has_circle(ob):
    """Whether following the keys' relative keys some way goes round."""
    for key in ob.data.shape_keys.key_blocks if ob.data.shape_keys else ():
        for _ in ob.data.shape_keys.key_blocks:
            key = key.relative_key
        if key.relative_key != key:
            return True
    return False


def is_exact(ob, _twin):
    """Whether its shape may become its own: what a modifier makes of rounding would stay when that is gone."""
    return not compare.looseness(ob)[0]


@on_both(0.5, wanted=is_exact)
def convert_to_mesh(random, ob):
    select(ob)
    if ob.visible_get():
        bpy.ops.object.convert(target="MESH")


@on_pair(0.5)
def copy_modifiers(random, ob, twin):
    """From another character (Ctrl L)."""
    other, its_twin = random.choice(scene.pairs())
    for source, target in (other, ob), (its_twin, twin):
        scene.make_active(source, target)
        if source != target and bpy.ops.object.make_links_data.poll():
            bpy.ops.object.make_links_data(type="MODIFIERS")


@on_pair(0.7)
def share_mesh(random, ob, twin):
    """Two characters with one mesh (Ctrl L)."""
    other, its_twin = random.choice(scene.pairs())
    if other != ob:
        ob.data, twin.data = other.data, its_twin.data


@on_pair(1)
def unshare_mesh(random, ob, twin):
    for each in ob, twin:
        if each.data.users > 1:
            each.data = each.data.copy()


@on_pair(0.7)
def move_to_collection(random, ob, twin):
    collection = bpy.data.collections.get("Aside")
    if collection is None:
        collection = bpy.data.collections.new("Aside")
        bpy.context.scene.collection.children.link(collection)
    for each in ob, twin:
        for other in each.users_collection:
            other.objects.unlink(each)
        collection.objects.link(each)


@kind(0.5)
def hide_collection(random):
    scene.leave_modes()
    for collection in bpy.data.collections:
        collection.hide_viewport = random.random() < 0.3


@on_both(0.7, wanted=is_exact)
def take_evaluated_mesh(random, ob):
    """In place of its own. (With shape keys it crashes Blender 5.2 as the next file is opened, bound or not.)"""
    if not ob.data.shape_keys and (ob.visible_get() and not ob.modifiers or random.random() < 0.5):
        mesh = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        if 0 < len(mesh.vertices) < MOST_VERTICES:
            ob.data = mesh.copy()


@kind(0.5)
def link_characters(random):
    """All of them from another file, or overrides of these, which play and go again."""
    scene.leave_modes()
    path = bpy.app.tempdir + f"library {random.randrange(10**6)}.blend"
    collection = bpy.data.collections.new("Library")
    for ob in {each for pair in scene.pairs() for each in pair}.union(scene.armatures()):
        collection.objects.link(ob)
    bpy.data.libraries.write(path, {collection})
    name = collection.name
    bpy.data.collections.remove(collection)
    before = set(bpy.data.objects)
    with bpy.data.libraries.load(path, link=True) as (_, to):
        to.collections = [name]
    linked = to.collections[0]
    if random.random() < 0.5:
        override(linked)
    else:
        bpy.context.scene.collection.children.link(linked)
    try:
        for _ in range(2):
            bpy.context.scene.frame_set(random.randint(1, scene.LAST_FRAME))
            compare_strangers([ob for ob in bpy.data.objects if ob not in before])
    finally:
        for ob in [ob for ob in bpy.data.objects if ob not in before and ob.library is None]:
            bpy.data.objects.remove(ob)
        bpy.data.libraries.remove(next(each for each in bpy.data.libraries if each.filepath == path))
        bpy.ops.outliner.orphans_purge()


def compare_strangers(objects):
    """Objects of a library, or overrides of them."""
    for ob in objects:
        if not scene.is_ours(ob) or not ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).is_evaluated:
            continue
        source = ob.override_library.reference.name if ob.override_library else ob.name
        for twin in objects:
            name = twin.override_library.reference.name if twin.override_library else twin.name
            if name == scene.twin_name(source) and bool(twin.library) == bool(ob.library):
                compare.assert_same_shape(ob, twin, f"{ob.name_full}: ")


@on_both(0.5, in_any_mode=True)
def rename_data(random, ob):
    ob.data.name = f"Mesh {random.randrange(5)}"
