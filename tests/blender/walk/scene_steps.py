"""Armatures, time, modes, scenes, renders and files."""

import math
import threading
from random import Random

import bpy

from . import compare, scene
from .kinds import kind, on_pair
from .mesh_steps import move


def one_armature(random):
    found = scene.armatures()
    return random.choice(found) if found else None


# --- armatures ------------------------------------------------------------------------------------


@kind(7)
def pose(random):
    armature = one_armature(random)
    for bone in armature.pose.bones if armature else ():
        if random.random() < 0.4:
            scene.pose_bone(bone, random, random.random() < 0.2)


@kind(3)
def key_pose(random):
    pose(random)
    armature = one_armature(random)
    for bone in armature.pose.bones if armature else ():
        scene.key_bone(bone, bpy.context.scene.frame_current)


@kind(2)
def place_armature(random):
    armature = one_armature(random)
    if armature:
        armature.location, armature.rotation_euler = scene.some(random, 1), scene.some(random, 1)
        if random.random() < 0.2:
            armature.scale = [random.uniform(0.5, 2) for _ in range(3)]


@kind(1)
def rest_position(random):
    armature = one_armature(random)
    if armature:
        armature.data.pose_position = random.choice(("REST", "POSE", "POSE"))


@kind(2)
def bone_settings(random):
    scene.leave_modes()
    armature = one_armature(random)
    if armature and len(armature.data.bones):
        bone = random.choice(armature.data.bones)
        bone.bbone_segments = random.choice((1, 1, 4))
        bone.use_deform = random.random() < 0.8
        bone.use_envelope_multiply = random.random() < 0.15
        bone.envelope_distance = random.uniform(0.1, 1)


@kind(2)
def rename_bone(random):
    scene.leave_modes()
    armature = one_armature(random)
    if armature and len(armature.data.bones):
        random.choice(armature.data.bones).name = random.choice(("bone0", "bone1", "elbow", 'the "bone"', "side"))
        # Blender finds keyframes of the new name only when it sorts out again what depends on what.
        newcomer = bpy.data.objects.new("", None)
        bpy.context.scene.collection.objects.link(newcomer)
        bpy.data.objects.remove(newcomer)
        bpy.context.view_layer.update()
        for pair in scene.pairs():  # Blender may leave a mesh stale that has a group of the new name already
            for ob in pair:
                ob.data.update()


def is_followed(armature, bone):
    """By bones of other armatures. If it were removed, Blender would evaluate these before or after that armature."""
    bones = [each for other in scene.armatures() for each in other.pose.bones]
    return any(
        (getattr(each, "target", None), getattr(each, "subtarget", "")) == (armature, bone)
        for owner in bones
        for each in owner.constraints
    )


@kind(2)
def edit_bones(random):
    armature = one_armature(random)
    if armature is None or not armature.visible_get():
        return
    scene.make_active(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    bones = armature.data.edit_bones
    bone, what = random.choice(list(bones) or [None]), random.randrange(5)
    if bone is None or what == 0 and len(bones) < 9:
        new = bones.new(random.choice(("bone2", "elbow", "new")))
        new.head, new.tail, new.parent = scene.some(random, 1), (0, 0, 3), bone
    elif what == 1 and len(bones) > 3 and not is_followed(armature, bone.name):
        bones.remove(bone)
    elif what == 2:
        bone.parent = None
    else:
        bone.roll += random.uniform(-1, 1)
        bone.tail.x += random.uniform(-0.2, 0.2)
    bpy.ops.object.mode_set(mode="OBJECT")


@kind(2)
def constrain_bone(random):
    scene.leave_modes()
    armature = one_armature(random)
    if armature and len(armature.pose.bones):
        bone = random.choice(armature.pose.bones)
        if bone.constraints:
            bone.constraints.remove(bone.constraints[0])
        else:
            constraint = bone.constraints.new(random.choice(("COPY_ROTATION", "CHILD_OF", "DAMPED_TRACK")))
            constraint.target = bpy.data.objects.get(random.choice(("Target 1", "Target 2")))
            others = [each for each in scene.armatures() if each != armature]
            others = [found for each in others for found in each.pose.bones if bone not in scene.followed_by(found)]
            if others and random.random() < 0.6:
                other = random.choice(others)
                constraint.target, constraint.subtarget = other.id_data, other.name
                if constraint.type == "COPY_ROTATION":
                    constraint.target_space = random.choice(("WORLD", "LOCAL", "POSE", "LOCAL_WITH_PARENT"))


@kind(2)
def change_target(random):
    """What bones and hooks follow."""
    scene.leave_modes()
    found = [bpy.context.view_layer.objects.get(name) for name in random.sample(("Target 1", "Target 2"), 2)]
    if None in found:
        return None
    ob, other = found
    what = random.choice(("move", "key", "parent", "hide", "stop", "mode"))
    if what in ("move", "key"):
        ob.location, ob.rotation_euler, ob.delta_scale = (scene.some(random, 1) for _ in range(3))
        if what == "key":
            ob.keyframe_insert("location", frame=random.randint(1, scene.LAST_FRAME))
    elif what == "parent":
        ob.parent = other if ob.parent is None and other.parent is None else None
    elif what == "hide":
        ob.hide_set(random.random() < 0.3)
    elif what == "mode":
        ob.rotation_mode = random.choice(("XYZ", "ZXY", "QUATERNION"))
    else:
        ob.animation_data_clear()
    return f"{what} {ob.name}"


@kind(1)
def hide_armature(random):
    armature = one_armature(random)
    if armature:
        scene.leave_modes()
        armature.hide_viewport = random.random() < 0.5


@kind(0.5)
def delete_armature(random):
    armature = one_armature(random)
    if armature:
        scene.make_active(armature)
        if random.random() < 0.5:
            bpy.data.objects.remove(armature)
        else:
            bpy.ops.object.delete()


@kind(0.7)
def add_armature(random):
    scene.leave_modes()
    if len(scene.armatures()) < 3:
        scene.new_armature(random)


@kind(0.7)
def change_armature_data(random):
    """For another armature's, or a copy of what is evaluated."""
    scene.leave_modes()
    rigs = scene.armatures()
    if not rigs:
        return
    ob, other, graph = random.choice(rigs), random.choice(rigs), bpy.context.evaluated_depsgraph_get()
    what = random.randrange(3)
    if what == 0:
        ob.data, other.data = other.data, ob.data
    elif what == 1:
        ob.data = other.data.copy()
    elif ob.evaluated_get(graph).is_evaluated:
        ob.data = ob.evaluated_get(graph).data.copy()
    for each in bpy.data.objects:  # Blender itself leaves meshes as they were, if no bone is animated
        each.update_tag()


@kind(0.7)
def spoil_bone(random):
    """A place that is not a number, for a moment."""
    armature = one_armature(random)
    if armature and len(armature.pose.bones):
        bone = random.choice(list(armature.pose.bones))
        before = bone.location.copy()
        bone.location.x = math.nan
        bpy.context.view_layer.update()
        compare.assert_alike()
        bone.location = before


# --- time, modes and scenes -----------------------------------------------------------------------


@kind(14)
def play(random):
    for _ in range(random.randint(1, 4)):
        bpy.context.scene.frame_set(random.randint(1, scene.LAST_FRAME))


@on_pair(4)
def enter_mode(random, ob, twin):
    enter(ob, twin, random.choice(("EDIT", "EDIT", "SCULPT", "WEIGHT_PAINT", "VERTEX_PAINT")))


def enter(ob, twin, mode):
    """Both of them, as otherwise Blender shows other shapes. Returns whether they can."""
    scene.make_active(ob, twin)
    if not ob.visible_get() or ob.data.users > 1:
        return False
    for each in ob, twin:
        bpy.context.view_layer.objects.active = each
        bpy.ops.object.mode_set(mode=mode)
    return True


@on_pair(2)
def dabs(random, ob, twin):
    """Of a brush, while Blender deforms the mesh after each."""
    if not ob.vertex_groups or not len(ob.data.vertices):
        return
    if not enter(ob, twin, random.choice(("WEIGHT_PAINT", "WEIGHT_PAINT", "VERTEX_PAINT"))):
        return
    for _ in range(random.randint(1, 3)):
        group, weight = random.choice(ob.vertex_groups.keys()), random.random()
        part = range(random.randrange(len(ob.data.vertices)), len(ob.data.vertices), random.randint(1, 5))
        for each in ob, twin:
            each.vertex_groups[group].add(part, weight, "REPLACE")
            each.data.update()
        bpy.context.view_layer.update()
        compare.assert_alike()
        if random.random() < 0.3:
            bpy.context.scene.frame_set(random.randint(1, scene.LAST_FRAME))
            compare.assert_alike()


@kind(1)
def pose_mode(random):
    armature = one_armature(random)
    if armature and armature.visible_get():
        scene.make_active(armature)
        bpy.ops.object.mode_set(mode=random.choice(("POSE", "POSE", "EDIT")))


@kind(2)
def leave_mode(random):
    scene.leave_modes()


@kind(0.5)
def new_scene(random):
    scene.leave_modes()
    if len(bpy.data.scenes) < 3:
        bpy.ops.scene.new(type=random.choice(("LINK_COPY", "LINK_COPY", "FULL_COPY")))
        scene.take_keyframes()


@kind(1.5)
def other_scene(random):
    scene.leave_modes()
    bpy.context.window.scene = random.choice(list(bpy.data.scenes))
    scene.take_keyframes()


@kind(1)
def view_layer(random):
    """Another one is made, chosen or removed."""
    scene.leave_modes()
    layers, window = bpy.context.scene.view_layers, bpy.context.window
    what = random.choice(("new", "other", "other", "both", "remove"))
    if what == "new" and len(layers) < 3:
        layers.new("Layer")
    elif what == "other":
        window.view_layer = random.choice(list(layers))
        bpy.context.view_layer.update()
    elif what == "both":
        bpy.context.scene.frame_set(random.randint(1, scene.LAST_FRAME))
        for layer in layers:
            layer.update()
            compare.assert_same_shapes_in(layer.depsgraph)
    elif what == "remove" and len(layers) > 1:
        layers.remove(random.choice([each for each in layers if each != window.view_layer]))
    return what


@kind(0.7)
def evaluate_another_scene(random):
    """In a thread, while vertices are moved."""
    if bpy.app.version < (4, 0):  # where both evaluations write the log of a node group to the original, and crash
        return
    scene.leave_modes()
    current = bpy.context.scene
    pairs = [pair for pair in scene.pairs() if pair[0].sinew.is_bound] or scene.pairs()
    # Keyed vertices go from the other scene to the original at any moment, before or after they are moved here.
    pairs = [pair for pair in pairs if pair[0].data.animation_data is None]
    # Clips go to the originals of bones, before a frame and from its thread: in the background nobody waits for that.
    if not pairs or any(ob.sinew.source == "CLIP" for ob, _twin in scene.pairs()):
        return
    if len(bpy.data.scenes) < 2:
        bpy.ops.scene.new(type="LINK_COPY")
        bpy.context.window.scene = current
    others = [each for each in bpy.data.scenes if each != current]
    other, (ob, twin), seed = random.choice(others), random.choice(pairs), random.random()
    # The same moment: what keyframes set goes from any scene to the originals that both share, and Blender takes it
    # from there, also into the graph that it makes for applying a modifier that is off in the evaluated object.
    now = {"frame": current.frame_current, "subframe": current.frame_subframe}
    other.frame_set(**now)  # Blender crashes if something is tagged while another thread builds a graph
    for each, _twin in scene.pairs():  # a deformed copy has the shape of the scene that was evaluated last
        if each.sinew.deformed is not None:
            each.update_tag(refresh={"DATA"})
    thread = threading.Thread(target=lambda: [other.frame_set(**now) for _ in range(10)])
    thread.start()
    try:
        for number in range(10):
            for each in (ob, twin) if ob.data.vertices else ():
                move(Random(f"{seed} {number}"), each.data.vertices)
                each.data.update()
            bpy.context.view_layer.update()
            compare.assert_same_shape(ob, twin, f"{ob.name}, while another scene is evaluated: ")
    finally:
        thread.join()
    for each in bpy.data.shape_keys:
        each.update_tag()  # a keyed value that was set by hand has gone with the other scene, unnoticed by this one


class Comparing(bpy.types.RenderEngine):
    """Renders nothing, but compares what it is given, also at times between frames, as for motion blur."""

    bl_idname = "WALK_COMPARING"
    bl_label = "Comparing"
    moments = ()  # relative to the frame
    said = None  # what was different

    def render(self, graph):
        frame = graph.scene.frame_current
        try:
            compare.assert_same_shapes_in(graph)
            for moment in self.moments:
                whole = math.floor(frame + moment)
                self.frame_set(whole, frame + moment - whole)
                compare.assert_same_shapes_in(graph)
        except AssertionError as error:
            Comparing.said = error


bpy.utils.register_class(Comparing)


@kind(1.5)
def render(random):
    scene.leave_modes()
    settings = bpy.context.scene.render
    settings.engine, settings.resolution_x, settings.resolution_y = Comparing.bl_idname, 4, 4
    Comparing.moments = random.choice(((), (-0.25, 0.0, 0.25)))
    bpy.context.scene.frame_set(random.randint(1, scene.LAST_FRAME))
    if bpy.context.scene.camera is not None:
        bpy.ops.render.render()
    said, Comparing.said = Comparing.said, None
    if said:
        raise said


@kind(0.5)
def remove_scene(random):
    scene.leave_modes()
    if len(bpy.data.scenes) > 1:
        bpy.ops.scene.delete()


# --- files ----------------------------------------------------------------------------------------


STEP = "Step"  # a text of the file that says which step was the last
undone = {"asked for": 0, "did something": 0}


def note_step(step):
    """To be undone with the step."""
    text = bpy.data.texts.get(STEP) or bpy.data.texts.new(STEP)
    text.use_fake_user = True
    text.clear()
    text.write(str(step))


def noted_step():
    text = bpy.data.texts.get(STEP)
    return text and text.as_string()


@kind(8)
def undo(random):
    before = noted_step()
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        if bpy.ops.ed.undo.poll():
            try_to(bpy.ops.ed.undo)
    return count_undone(before)


@kind(4)
def redo(random):
    before = noted_step()
    try_to(bpy.ops.ed.redo)
    return count_undone(before)


def count_undone(before):
    undone["asked for"] += 1
    undone["did something"] += noted_step() != before
    return f"step {before} -> {noted_step()}"


def try_to(operator):
    try:
        operator()
    except RuntimeError:
        pass  # there is nothing


@kind(1.5)
def save_and_open(random):
    scene.leave_modes()
    path = bpy.app.tempdir + "walk.blend"
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)


@kind(0.5)
def purge(random):
    scene.leave_modes()
    bpy.ops.outliner.orphans_purge(do_recursive=True)
