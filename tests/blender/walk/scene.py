"""The scene in which a walk begins, and how its objects are found.

Each mesh `Tube N` may be bound, and has an unbound `Twin N` that is treated alike. The names say what belongs
together, and they are in the file: undo, redo and opening a file find the same pairs.
"""

from itertools import count

import bpy
from mathutils import Euler, Matrix

from characters import BONES, by_keys, make_armature, make_cage, make_mesh, make_mesh_cage, make_tube
from helpers import deform_small_meshes, depsgraph, select

OURS, TWINS = "Tube ", "Twin "
LAST_FRAME = 20


def new_scene(random):
    """An empty file with some characters in it."""
    deform_small_meshes()
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.context.scene.frame_end = LAST_FRAME
    bpy.context.scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.collection.objects.link(bpy.context.scene.camera)
    for name in ("Target 1", "Target 2"):
        target = bpy.data.objects.new(name, None)
        bpy.context.collection.objects.link(target)
        for frame in (1, 15):
            target.location, target.rotation_euler = some(random, 1), some(random, 1)
            target.keyframe_insert("location", frame=frame)
            target.keyframe_insert("rotation_euler", frame=frame)
    for _ in range(random.choice((1, 2))):
        new_armature(random)
    new_cages()
    for _ in range(random.choice((2, 3))):
        new_character(random)


def new_cages():
    """A lattice, a body, and a closed box, which move: for Lattice, Surface Deform and Mesh Deform.

    The body's faces stay convex: where Blender cannot bind to them, it tries again whenever it copies the mesh, at
    other times for the twin.
    """
    by_keys(make_cage())
    body = make_tube()
    body.name = body.data.name = "Body"
    # So that no vertex is as near to one of its faces as to another.
    body.data.transform(Matrix.Translation((0.02, 0.01, 0.013)) @ Matrix.Rotation(0.03, 4, "Z") @ Matrix.Scale(1.1, 4))
    for each in (body, make_mesh_cage()):
        each.shape_key_add(name="Basis")
        key = each.shape_key_add(name="Bent")
        for point in key.data:
            point.co.x += 0.2 * point.co.z**2 - 0.3
        for frame, value in ((1, 0.2), (15, 1)):
            key.value = value
            key.keyframe_insert("value", frame=frame)


def some(random, most):
    return [random.uniform(-most, most) for _ in range(3)]


def new_armature(random):
    others = [each for each in armatures() if "bone2" in each.data.bones]
    armature = make_armature()
    armature.name = armature.data.name = next_name("Rig ")
    is_scaled = random.random() < 0.5
    if random.random() < 0.5:
        constraint = armature.pose.bones["side"].constraints.new("COPY_ROTATION")
        constraint.target = bpy.data.objects.get("Target 1")
    elif others and random.random() < 0.5:
        constraint = armature.pose.bones["bone0"].constraints.new("CHILD_OF")
        constraint.target, constraint.subtarget = random.choice(others), "bone2"
    for frame in (1, 7, 14, LAST_FRAME):
        for bone in armature.pose.bones:
            pose_bone(bone, random, is_scaled)
            key_bone(bone, frame)


def pose_bone(bone, random, is_scaled):
    bone.rotation_mode = "QUATERNION"
    bone.rotation_quaternion = Euler(some(random, 1.2)).to_quaternion()
    bone.location = some(random, 0.2)
    bone.scale = [random.uniform(0.6, 1.5) for _ in range(3)] if is_scaled else (1, 1, 1)


def key_bone(bone, frame):
    for path in ("rotation_quaternion", "location", "scale"):
        bone.keyframe_insert(path, frame=frame)


def new_character(random):
    """A mesh and its twin, deformed by one of the armatures or by none."""
    name = next_name(OURS)
    rigs = [each for each in armatures() if len(each.data.bones) > BONES]  # the tube has weights of so many
    armature = random.choice(rigs) if rigs and random.random() < 0.85 else None
    preserve_volume, hooks = random.random() < 0.5, random.choice((0, 0, 1, 2))
    for each in name, twin_name(name):
        ob = make_mesh(armature, preserve_volume) if armature else make_tube()
        ob.name = ob.data.name = each
        for number in range(hooks):
            hook = ob.modifiers.new(f"Hook {number}", "HOOK")
            hook.object = bpy.data.objects.get("Target 1")
            hook.vertex_indices_set(range(number, len(ob.data.vertices), 3))


def next_name(prefix):
    return next(name for name in (f"{prefix}{number}" for number in count(1)) if name not in bpy.data.objects)


def armatures():
    return [ob for ob in bpy.context.view_layer.objects if ob.type == "ARMATURE"]


def pairs():
    """[(mesh, its twin)] of the view layer."""
    objects = bpy.context.view_layer.objects
    return [(ob, objects[twin_name(ob.name)]) for ob in objects if is_ours(ob)]


def is_ours(ob):
    return ob.name.startswith(OURS) and not ob.sinew.copied_from and ob.users_collection


def twin_name(name):
    return TWINS + name.removeprefix(OURS)


def leave_modes():
    """Everything to Object Mode."""
    objects = bpy.context.view_layer.objects
    for ob in objects:
        if ob.mode != "OBJECT":  # several leave Edit Mode together
            objects.active = ob
            bpy.ops.object.mode_set(mode="OBJECT")


def make_active(*objects):
    leave_modes()
    select(*objects)


def take_keyframes():
    """Until then an object has what was set last, or what its keyframes say if Blender has evaluated it for another
    reason. And what a scene shows at first has not come to the objects themselves: before 5.0 an edit of an armature
    then brings back the pose that they have, and Blender shows it in what is evaluated anew after that."""
    bpy.context.scene.frame_set(bpy.context.scene.frame_current)
    if len(bpy.data.scenes) > 1:
        graph = depsgraph()
        for ob in bpy.context.view_layer.objects:
            seen = ob.evaluated_get(graph)
            ob.location, ob.rotation_euler = seen.location.copy(), seen.rotation_euler.copy()


def followed_by(bone):
    """The bones that a pose bone follows, and itself. In a cycle, what Blender shows depends on what it has shown."""
    found = [bone]
    for each in found:
        targets = [(one.target, one.subtarget) for one in each.constraints if getattr(one, "subtarget", "")]
        bones = [each.parent, *(target.pose.bones.get(name) for target, name in targets if target and target.pose)]
        found += [other for other in bones if other is not None and other not in found]
    return found
