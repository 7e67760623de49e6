"""A small character with random weights, made to be compared with the Armature modifier."""

import functools

import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

from helpers import select, twin_of

BONES = 5


def make_armature(connected=True):
    """A chain of five bones along Z and a side branch, one unit each."""
    data = bpy.data.armatures.new("Rig")
    armature = bpy.data.objects.new("Rig", data)
    bpy.context.collection.objects.link(armature)
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    parent = None
    for i in range(BONES):
        bone = data.edit_bones.new(f"bone{i}")
        bone.head, bone.tail = (0, 0.05 * i, i), (0, 0.05 * (i + 1), i + 1)
        bone.roll = 0.3 * i
        bone.parent = parent
        parent = bone
    side = data.edit_bones.new("side")
    side.head, side.tail, side.parent = (0.2, 0, 2), (1.2, 0.3, 2.2), data.edit_bones["bone1"]
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def make_mesh(armature, preserve_volume):
    """A tube of 1,200 vertices with random weights that are not normalised, by that armature."""
    ob = make_tube([bone.name for bone in armature.data.bones])
    modifier = ob.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature
    modifier.use_deform_preserve_volume = preserve_volume
    return ob


def make_tube(names=(*(f"bone{i}" for i in range(BONES)), "side")):
    """The same without a modifier. names: of its vertex groups."""
    points, faces, weights = tube()
    mesh = bpy.data.meshes.new("Tube")
    mesh.from_pydata(points, [], faces)
    ob = bpy.data.objects.new("Tube", mesh)
    bpy.context.collection.objects.link(ob)
    groups = [ob.vertex_groups.new(name=name) for name in names]
    for v, bone, weight in weights:
        groups[bone].add((v,), weight, "ADD")
    return ob


@functools.cache
def tube():
    """Returns its points, its faces, and what adds to its weights, as (vertex, bone, weight): nearly every test makes
    one, and the random numbers take longer than Blender."""
    random = np.random.default_rng(3)
    rings, around = 60, 20
    height, angle = np.meshgrid(
        np.linspace(-0.2, 5.2, rings), np.linspace(0, 2 * np.pi, around, endpoint=False), indexing="ij"
    )
    points = np.stack([0.4 * np.cos(angle), 0.4 * np.sin(angle), height], -1).reshape(-1, 3)
    faces = [
        (r * around + i, r * around + (i + 1) % around, (r + 1) * around + (i + 1) % around, (r + 1) * around + i)
        for r in range(rings - 1)
        for i in range(around)
    ]
    weights = []
    for v, (_, _, z) in enumerate(points):
        near = int(np.clip(z, 0, BONES - 1))
        for bone in random.permutation([near, max(near - 1, 0), 5 if 1 < z < 3 else near]):
            weights.append((v, int(bone), float(random.uniform(0.1, 1))))
    return points.tolist(), faces, weights


def constrain(armature, bone, kind, **settings):
    constraint = armature.pose.bones[bone].constraints.new(kind)
    for name, value in settings.items():
        setattr(constraint, name, value)
    return constraint


def add_shape_keys(ob):
    """Two keys, one of them relative to the other and with a vertex group, both animated."""
    random = np.random.default_rng(5)
    ob.shape_key_add(name="Basis")
    for name in ("Wide", "Bumpy"):
        key = ob.shape_key_add(name=name)
        for point in key.data:
            point.co += Vector(random.uniform(-0.1, 0.1, 3))
    keys = ob.data.shape_keys.key_blocks
    keys["Bumpy"].relative_key = keys["Wide"]
    keys["Bumpy"].vertex_group = "bone2"
    for name, values in (("Wide", (0.2, 0.9)), ("Bumpy", (1.0, 0.3))):
        for frame, value in zip((1, 10), values):
            keys[name].value = value
            keys[name].keyframe_insert("value", frame=frame)


def remove_group(ob, name):
    """Blender 3.4 and 4.3 tell nobody that a script has removed a group: the mesh would still be deformed with it, but
    without waiting for its bone."""
    ob.vertex_groups.remove(ob.vertex_groups[name])
    ob.data.update()


def with_bendy_bones(ob):
    for bone, segments in zip(ob.modifiers["Armature"].object.data.bones, (4, 8, 1, 3, 5)):
        bone.bbone_segments = segments


def smoothed(ob, name="Corrective", kind="CORRECTIVE_SMOOTH", **settings):
    modifier = ob.modifiers.new(name, kind)
    for setting, value in settings.items():
        setattr(modifier, setting, value)
    return modifier


def animate(modifier, **settings):
    """Two keyframes a setting."""
    for name, values in settings.items():
        for frame, value in zip((1, 15), values):
            setattr(modifier, name, value)
            modifier.id_data.modifiers[modifier.name].keyframe_insert(name, frame=frame)


def hook(ob, name="Hook", bone="", **settings):
    target = ob.modifiers["Armature"].object if bone else bpy.data.objects.get("Target")
    if target is None:
        target = bpy.data.objects.new("Target", None)
        bpy.context.collection.objects.link(target)
        for frame, place in ((1, (1, 0, 0)), (15, (-1, 2, 1))):
            target.location = target.rotation_euler = place
            target.keyframe_insert("location", frame=frame)
            target.keyframe_insert("rotation_euler", frame=frame)
    modifier = smoothed(ob, name, "HOOK", object=target, subtarget=bone, **settings)
    modifier.matrix_inverse = Euler((0.1, 0.2, 0.3)).to_matrix().to_4x4() @ Matrix.Translation((-0.5, 0, 0))
    return modifier


def pose(armature, frame, scaled):
    random = np.random.default_rng(frame)
    for bone in armature.pose.bones:
        bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = Euler(random.uniform(-1.2, 1.2, 3)).to_quaternion()
        bone.location = random.uniform(-0.2, 0.2, 3)
        bone.scale = random.uniform(0.6, 1.5, 3) if scaled else (1, 1, 1)
        for path in ("rotation_quaternion", "location", "scale"):
            bone.keyframe_insert(path, frame=frame)


def accelerate(ob, output="MODIFIER"):
    select(ob)
    assert bpy.ops.object.sinew_bind(output=output) == {"FINISHED"}


# --- with several armatures ---------------------------------------------------------------------------


def with_twin(ob):
    """Accelerates a mesh. Returns it and a twin that Blender deforms."""
    twin = twin_of(ob)
    if ob.data.shape_keys:  # a copy's keys play the original's action
        twin.data.shape_keys.animation_data.action = ob.data.shape_keys.animation_data.action
    accelerate(ob)
    return ob, twin


def make_body(volume=False):
    """A mesh whose armature is animated."""
    armature = make_armature()
    for frame in (1, 7, 14, 20):
        pose(armature, frame, scaled=True)
    return make_mesh(armature, volume)


def face_of(ob, name="Face", tip=(0.1, 0.2, 0.6), **settings):
    """A rig of three bones near the top, with groups of its own, which overlap those of the body. Returns its
    modifier, the last of the mesh."""
    armature = bpy.data.objects.get(name) or make_face(name, tip)
    random = np.random.default_rng(8)
    for bone in armature.data.bones:
        if bone.name not in ob.vertex_groups:
            group = ob.vertex_groups.new(name=bone.name)
            for v, vertex in enumerate(ob.data.vertices):
                if vertex.co.z > 2.5 and random.uniform() < 0.6:
                    group.add([v], float(random.uniform(0.1, 1)), "REPLACE")
    return smoothed(ob, name, "ARMATURE", object=armature, **settings)


def make_face(name, tip):
    data = bpy.data.armatures.new(name)
    armature = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(armature)
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    parent = None
    for i, bone_name in enumerate(("neck", "jaw", "brow")):
        bone = data.edit_bones.new(f"{name} {bone_name}")
        bone.head = (0.1 * i, -0.1, 2.6 + 0.6 * i)
        bone.tail = tuple(np.add(bone.head, tip))
        bone.roll, bone.parent = 0.4 * i, parent
        parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    for frame in (1, 8, 15, 20):
        pose(armature, frame + 2, scaled=True)
    return armature


def place(armature):
    """Somewhere else, turned and scaled unevenly."""
    armature.matrix_world = (
        Matrix.Translation((0.2, -0.1, 0.3))
        @ Euler((0.3, 0.2, 0.1)).to_matrix().to_4x4()
        @ Matrix.Diagonal((1, 2, 0.5, 1))
    )


def linked(name, data=None):
    ob = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(ob)
    return ob


def make_cage(splines=("KEY_BSPLINE", "KEY_LINEAR", "KEY_CARDINAL"), counts=(3, 2, 5)):
    """A lattice around the tube, turned and scaled, of which some points were moved."""
    random = np.random.default_rng(7)
    data = bpy.data.lattices.new("Cage")
    data.points_u, data.points_v, data.points_w = counts
    data.interpolation_type_u, data.interpolation_type_v, data.interpolation_type_w = splines
    cage = linked("Cage", data)
    cage.location, cage.rotation_euler, cage.scale = (0.1, 0, 2.4), (0.1, 0.2, 0.3), (1.5, 1.2, 5)
    for point in data.points:
        point.co_deform = np.array(point.co_deform) + random.uniform(-0.15, 0.15, 3)
    return cage


def by_keys(cage):
    """Moves the points of a lattice or a mesh by keyframes."""
    random = np.random.default_rng(8)
    cage.shape_key_add(name="Basis")
    key = cage.shape_key_add(name="Bent")
    for point in key.data:
        point.co = np.array(point.co) + random.uniform(-0.3, 0.3, 3)
    for frame, value in ((1, 0), (15, 1)):
        key.value = value
        key.keyframe_insert("value", frame=frame)


def in_a_cage(ob, cage=None, name="Lattice", **settings):
    """Adds a Lattice modifier: of that cage or of the one that is called so."""
    return smoothed(ob, name, "LATTICE", object=cage or bpy.data.objects["Cage"], **settings)


def drive(block, path, expression="var", kind="TRANSFORMS", bone="bone2", channel="ROT_X", target=None, **settings):
    """A driver with one variable: of a bone, or of a custom property if kind is SINGLE_PROP."""
    driver = block.driver_add(path).driver
    driver.type = settings.pop("type", "SCRIPTED")
    if driver.type == "SCRIPTED":
        driver.expression = expression
    variable = driver.variables.new()
    variable.name, variable.type = "var", kind
    armature = bpy.data.objects["Rig"] if target is None else target
    variable.targets[0].id = armature
    if kind == "SINGLE_PROP":
        variable.targets[0].data_path = settings.pop("prop", '["amount"]')
    else:
        for each in variable.targets:
            each.id, each.bone_target = armature, bone
        variable.targets[0].transform_type = channel
        variable.targets[0].transform_space = "LOCAL_SPACE"
    for name, value in settings.items():
        setattr(variable.targets[0], name, value)
    return driver


def make_mesh_cage(armature=None):
    """A closed box in slices around the tube, with weights of bones; on an armature, if there is one."""
    heights = np.linspace(-0.6, 5.6, 12)
    points = [(x, y, z) for z in heights for x, y in ((-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9))]
    faces = [
        (4 * k + i, 4 * k + (i + 1) % 4, 4 * k + 4 + (i + 1) % 4, 4 * k + 4 + i) for k in range(11) for i in range(4)
    ]
    mesh = bpy.data.meshes.new("Box")
    mesh.from_pydata(points, [], [*faces, (3, 2, 1, 0), (44, 45, 46, 47)])
    cage = linked("Box", mesh)
    for number in range(5):
        group = cage.vertex_groups.new(name=f"bone{number}")
        for v, (_, _, z) in enumerate(points):
            group.add([v], max(0, 1 - abs(z - number - 0.5)), "REPLACE")
    if armature:
        smoothed(cage, "Armature", "ARMATURE", object=armature)
    return cage
