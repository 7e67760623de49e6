"""Shape keys, vertices, weights and vertex groups."""

import bpy
import numpy as np

from helpers import select

from .kinds import on_both
from .scene import LAST_FRAME

MOST_KEYS = 6
MOST_VERTICES = 4000


def keys_of(ob):
    return list(ob.data.shape_keys.key_blocks) if ob.data.shape_keys else []


def shapes_of(ob):
    """Its keys but for the reference."""
    return keys_of(ob)[1:]


# --- shape keys -----------------------------------------------------------------------------------


@on_both(4)
def add_shape_key(random, ob):
    if len(keys_of(ob)) < MOST_KEYS and len(ob.data.vertices):
        if not keys_of(ob):
            ob.shape_key_add(name="Basis")
        key = ob.shape_key_add(name=f"Key {random.randrange(100)}", from_mix=random.random() < 0.3)
        move(random, key.data)
        key.value = random.uniform(0, 1)


def move(random, points):
    """Some of them, at random. points: with coordinates."""
    places = np.empty(3 * len(points), np.float32)
    points.foreach_get("co", places)
    shift = np.random.default_rng(random.randrange(10**6)).uniform(-0.1, 0.1, (len(points), 3))
    start = random.randrange(len(points))
    shift[:start] = 0
    points.foreach_set("co", (places + shift.reshape(-1)).astype(np.float32))


@on_both(4)
def set_shape_key(random, ob):
    for key in shapes_of(ob):
        key.value, key.mute = random.uniform(0, 1), random.random() < 0.2
        if random.random() < 0.3:
            key.vertex_group = random.choice(("", "gone", *ob.vertex_groups.keys()))
        if random.random() < 0.2:
            key.relative_key = random.choice(keys_of(ob))


@on_both(2)
def key_shape_key(random, ob):
    if shapes_of(ob):
        key = random.choice(shapes_of(ob))
        for frame in (1, LAST_FRAME // 2):
            key.value = random.random()
            key.keyframe_insert("value", frame=frame)


@on_both(1)
def edit_shape_key(random, ob):
    if keys_of(ob) and len(ob.data.vertices):
        move(random, random.choice(keys_of(ob)).data)
        ob.data.update()


@on_both(1)
def remove_shape_key(random, ob):
    if keys_of(ob):
        ob.shape_key_remove(random.choice(keys_of(ob)))


@on_both(0.7)
def clear_shape_keys(random, ob):
    if keys_of(ob):
        ob.shape_key_clear()


@on_both(0.7)
def show_shape_key_alone(random, ob):
    ob.active_shape_key_index = random.randrange(MOST_KEYS)
    ob.show_only_shape_key = random.random() < 0.4


@on_both(0.5)
def absolute_shape_keys(random, ob):
    if keys_of(ob):
        ob.data.shape_keys.use_relative = random.random() < 0.6
        ob.data.shape_keys.eval_time = random.uniform(0, 30)


# --- vertices -------------------------------------------------------------------------------------


@on_both(2)
def move_vertices(random, ob):
    if len(ob.data.vertices):
        move(random, ob.data.vertices)
        ob.data.update()


def pulled(random):
    bpy.ops.transform.translate(value=(random.uniform(-0.2, 0.2), 0, 0.1))


def resized(random):
    bpy.ops.transform.resize(value=(random.uniform(0.9, 1.1), 1, 1))


def subdivided(random):
    if len(bpy.context.object.data.vertices) < MOST_VERTICES / 4:
        bpy.ops.mesh.subdivide(number_cuts=1)


def deleted(random):
    bpy.ops.mesh.delete(type=random.choice(("VERT", "FACE", "ONLY_FACE")))


def extruded(random):
    """Face by face: in which order a region's new faces come is left to chance, and for a twin comes out otherwise."""
    bpy.ops.mesh.extrude_faces_move(TRANSFORM_OT_shrink_fatten={"value": 0.1})


def triangulated(random):
    bpy.ops.mesh.quads_convert_to_tris(quad_method="FIXED", ngon_method="CLIP")


def duplicated(random):
    bpy.ops.mesh.duplicate_move(TRANSFORM_OT_translate={"value": (0.5, 0, 0)})


@on_both(5)
def edit_mesh(random, ob):
    """In Edit Mode, a part of its vertices."""
    mesh, edit = (
        ob.data,
        random.choice((pulled, pulled, resized, subdivided, deleted, extruded, triangulated, duplicated)),
    )
    count = len(mesh.vertices)
    if count > MOST_VERTICES and edit in (extruded, duplicated):
        return
    start = random.randrange(count or 1)
    end = start + random.randrange((count // 5 if edit in (deleted, extruded, duplicated) else count) or 1)
    mesh.vertices.foreach_set("select", [start <= number < end for number in range(count)])
    select_parts(mesh, mesh.edges, ".select_edge", start, end)
    select_parts(mesh, mesh.polygons, ".select_poly", start, end)
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        edit(random)
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")


def select_parts(mesh, parts, name, start, end):
    """Edges or faces, of which all vertices are selected. name: of the attribute that says so."""
    selected = [all(start <= number < end for number in part.vertices) for part in parts]
    if bpy.app.version[:2] != (5, 0):
        parts.foreach_set("select", selected)
    elif name in mesh.attributes:  # there the other way crashes
        mesh.attributes[name].data.foreach_set("value", selected)


@on_both(0.2)
def clear_geometry(random, ob):
    if not keys_of(ob) and ob.data.animation_data is None:  # Blender crashes over the driver of a vertex that has gone
        ob.data.clear_geometry()


# --- weights --------------------------------------------------------------------------------------


@on_both(4)
def paint(random, ob):
    if ob.vertex_groups:
        group = random.choice(list(ob.vertex_groups))
        part = range(random.randrange(100), len(ob.data.vertices), random.randint(1, 7))
        group.add(part, random.random(), random.choice(("REPLACE", "ADD", "SUBTRACT")))
        ob.data.update()


@on_both(1)
def take_out_of_group(random, ob):
    if ob.vertex_groups:
        random.choice(list(ob.vertex_groups)).remove(range(0, len(ob.data.vertices), random.randint(2, 9)))
        ob.data.update()


@on_both(1)
def rename_group(random, ob):
    if ob.vertex_groups:
        random.choice(list(ob.vertex_groups)).name = random.choice(("bone1", "bone3", "side", "Nobody's", "elbow"))
        ob.data.update()  # else Blender evaluates it some time later, and its twin at another time


@on_both(1)
def add_group(random, ob):
    ob.vertex_groups.new(name=random.choice(("bone0", "bone2", "side", "elbow")))
    ob.data.update()


@on_both(0.7)
def remove_group(random, ob):
    if len(ob.vertex_groups) > 2:
        ob.vertex_groups.remove(random.choice(list(ob.vertex_groups)))
        ob.data.update()


@on_both(1)
def weight_tools(random, ob):
    if len(ob.modifiers) <= 1 and ob.parent_type == "ARMATURE":
        return  # whether it has any decides on which groups are those of bones
    select(ob)
    if random.random() < 0.5:
        bpy.ops.object.vertex_group_normalize_all(lock_active=False)
    else:
        bpy.ops.object.vertex_group_sort(sort_type="NAME")
