"""Animation of data that Sinew reads once: points of meshes, of shape keys and of cages, bones at rest."""

import bpy

from . import scene
from .kinds import kind, on_both
from .mesh_steps import keys_of

OF_BONES = ("use_deform", "bbone_segments", "bbone_easein", "bbone_x", "envelope_distance", "head_radius", "hide")


def animate(random, block, path, may_drive=True):
    """Two keyframes or a driver of the frame."""
    holder, _, name = path.rpartition(".")
    struct = block.path_resolve(holder)
    values = [another(random, getattr(struct, name)) for _ in range(2)]
    if may_drive and random.random() < 0.4:
        found = block.driver_add(path)
        for curve in found if isinstance(found, list) else [found]:
            curve.driver.type, curve.driver.expression = "SCRIPTED", random.choice(("frame > 7", "frame / 10", "0.4"))
    else:
        for frame, value in zip((1, 15), values):
            setattr(struct, name, value)
            struct.keyframe_insert(name, frame=frame)
    scene.take_keyframes()


def another(random, value):
    if isinstance(value, bool):
        return random.random() < 0.5
    if isinstance(value, int):
        return random.choice((1, 4))
    return value + random.uniform(0, 0.3) if isinstance(value, float) else [each + random.random() for each in value]


@on_both(2)
def animate_vertices(random, ob):
    if len(ob.data.vertices):
        animate(random, ob.data, f"vertices[{random.randrange(len(ob.data.vertices))}].co")


@on_both(1.5)
def animate_points_of_key(random, ob):
    """By keyframes: Blender evaluates drivers before or after it adds the keys, as it happens."""
    key = random.choice(keys_of(ob) or [None])
    if key is not None and len(key.data):
        name = bpy.utils.escape_identifier(key.name)
        animate(random, ob.data.shape_keys, f'key_blocks["{name}"].data[{random.randrange(len(key.data))}].co', False)


@on_both(2)
def stop_animation_of_data(random, ob):
    (ob.data if random.random() < 0.6 else ob.data.shape_keys or ob.data).animation_data_clear()


@kind(1.5)
def animate_bone_at_rest(random):
    scene.leave_modes()
    found = [each for each in scene.armatures() if len(each.data.bones)]
    if found:
        data = random.choice(found).data
        name = bpy.utils.escape_identifier(random.choice(data.bones).name)
        animate(random, data, f'bones["{name}"].{random.choice(OF_BONES)}')
        return data.name
    return None


@kind(1.5)
def stop_animation_of_bones(random):
    scene.leave_modes()
    for armature in scene.armatures():
        if random.random() < 0.7:
            armature.data.animation_data_clear()


@kind(0.7)
def animate_cage(random):
    """Or no longer."""
    scene.leave_modes()
    for name, path in (("Cage", "points[3].co_deform"), ("Body", "vertices[50].co"), ("Box", "vertices[9].co")):
        ob = bpy.data.objects.get(name)
        if ob is not None and random.random() < 0.4:
            ob.data.animation_data_clear()
            if random.random() < 0.7:
                animate(random, ob.data, path)
