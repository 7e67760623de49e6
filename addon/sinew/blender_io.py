"""bpy <-> numpy, both ways. Nothing here knows what the numbers are for."""

import ctypes
import functools

import bmesh
import bpy
import numpy as np
from mathutils import Vector

VERSION = bpy.app.version


def key_of(id_block):
    """A number that tells data-blocks of one session apart, the same for evaluated copies."""
    original = id_block.original
    return getattr(original, "session_uid", None) or original.as_pointer()


def matrix_to_numpy(matrix):
    return np.array(matrix, dtype=np.float64)


def relative_matrix(ob, armature):
    """(4, 4): from the armature's space to the object's."""
    return (np.linalg.inv(matrix_to_numpy(ob.matrix_world))
            @ matrix_to_numpy(armature.matrix_world))


# --- meshes ---------------------------------------------------------------------------------------

def read_positions(mesh):
    """(V, 3) float32, the mesh's own vertices."""
    positions = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", positions)
    return positions.reshape(-1, 3)


def write_positions(mesh, positions):
    """positions (V, 3) float32 -> the mesh's own vertices; tags the mesh for evaluation."""
    flat = positions.reshape(-1)
    attribute = mesh.attributes.get("position")
    if attribute is None:  # before 3.5
        mesh.vertices.foreach_set("co", flat)
        mesh.update()
    else:
        attribute.data.foreach_set("vector", flat)
        positions_written(mesh, positions)


def positions_written(mesh, positions):
    """Tells Blender that its positions (3.5 and later) were changed. 4.3's bounding box stays stale
    after all other ways of saying so, this setter looks after it and all else."""
    if len(positions):
        mesh.vertices[0].co = positions[0]


def memory_of(attribute, count):
    """(count, 3) float32: the numbers of a vector attribute themselves, to be written at once and
    forgotten, or None if they cannot be had. Asking for their address makes Blender give the mesh
    numbers of its own, no longer shared with evaluated copies, as any write through its API does; but
    it does not see what is written here."""
    data = attribute.data
    if count == 0 or len(data) != count:
        return None
    address = data[0].as_pointer()
    if data[count - 1].as_pointer() != address + 12 * (count - 1):
        return None
    return np.frombuffer(_floats(3 * count).from_address(address), np.float32).reshape(count, 3)


@functools.lru_cache(maxsize=64)
def _floats(count):
    return ctypes.c_float * count


def point_attribute(mesh, name):
    """The mesh's vector attribute on points of this name, or None."""
    attribute = mesh.attributes.get(name)
    if attribute and attribute.data_type == "FLOAT_VECTOR" and attribute.domain == "POINT":
        return attribute
    return None


def read_attribute(attribute):
    """(V, 3) float32."""
    vectors = np.empty(3 * len(attribute.data), np.float32)
    attribute.data.foreach_get("vector", vectors)
    return vectors.reshape(-1, 3)


def modifiers_before(ob, modifier):
    """Those in the stack above `modifier` that are switched on anywhere."""
    return [m for m in list(ob.modifiers)[:ob.modifiers.find(modifier.name)]
            if m.show_viewport or m.show_render]


def animated_properties(ob, modifier):
    """Names of the modifier's properties that drivers or keyframes of the object set."""
    data = ob.animation_data
    if data is None:
        return []
    actions = {data.action, *(strip.action for track in data.nla_tracks for strip in track.strips)} - {None}
    curves = [*data.drivers, *(curve for action in actions for curve in action_curves(action))]
    start = f'modifiers["{bpy.utils.escape_identifier(modifier.name)}"].'
    return sorted({curve.data_path.removeprefix(start) for curve in curves if curve.data_path.startswith(start)})


def action_curves(action):
    if hasattr(action, "fcurves"):  # before 5.0
        return list(action.fcurves)
    return [curve for layer in action.layers for strip in layer.strips
            for bag in strip.channelbags for curve in bag.fcurves]


def write_attribute(mesh, name, vectors):
    """vectors (V, 3) float32 -> a vector attribute on points, made if it is not there."""
    attribute = point_attribute(mesh, name)
    if attribute is None:
        stale = mesh.attributes.get(name)
        if stale:
            mesh.attributes.remove(stale)
        attribute = mesh.attributes.new(name, "FLOAT_VECTOR", "POINT")
    attribute.data.foreach_set("vector", vectors.reshape(-1))
    mesh.update_tag()


def remove_attribute(mesh, name):
    attribute = mesh.attributes.get(name)
    if attribute:
        mesh.attributes.remove(attribute)


def new_mesh(name, positions, face_offsets, face_vertices):
    """A mesh of polygons with vertices in the given order, all of them kept."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions.astype(np.float32).reshape(-1))
    mesh.loops.add(len(face_vertices))
    mesh.loops.foreach_set("vertex_index", face_vertices.astype(np.int32))
    face_count = len(face_offsets) - 1
    mesh.polygons.add(face_count)
    mesh.polygons.foreach_set("loop_start", face_offsets[:-1].astype(np.int32))
    if bpy.app.version < (4, 1, 0):  # later versions know it from the starts
        mesh.polygons.foreach_set("loop_total", np.diff(face_offsets).astype(np.int32))
    mesh.update(calc_edges=True)
    mesh.validate()  # drops broken faces, never vertices
    shade_smooth(mesh)
    return mesh


def shade_smooth(mesh):
    mesh.polygons.foreach_set("use_smooth", np.ones(len(mesh.polygons), bool))
    mesh.update()


def read_faces(mesh):
    """face_offsets (faces + 1,), face_vertices, face_materials (faces,), int32."""
    starts = np.empty(len(mesh.polygons), np.int32)
    counts = np.empty(len(mesh.polygons), np.int32)
    materials = np.empty(len(mesh.polygons), np.int32)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    mesh.polygons.foreach_get("loop_total", counts)
    mesh.polygons.foreach_get("material_index", materials)
    mesh.loops.foreach_get("vertex_index", corners)
    return np.append(starts, len(corners)).astype(np.int32), corners, materials


# --- weights --------------------------------------------------------------------------------------

def read_weights(ob):
    """offsets (V + 1,), groups (N,) int32, weights (N,) float32 of a mesh object, in the order in
    which Blender stores them: dual quaternion skinning depends on it. An entry of a vertex group that
    was removed has the group -1."""
    bm = bmesh.new()
    try:
        bm.from_mesh(ob.data, face_normals=False, vertex_normals=False)
        layer = bm.verts.layers.deform.active
        counts = np.zeros(len(bm.verts), np.int64)
        groups, weights = [], []
        if layer is not None:
            for i, vertex in enumerate(bm.verts):
                entries = vertex[layer]
                names = entries.keys()
                counts[i] = len(names)
                groups += names
                weights += entries.values()
    finally:
        bm.free()
    offsets = np.concatenate(([0], np.cumsum(counts)))
    groups = np.array(groups, np.int32)
    groups[groups >= len(ob.vertex_groups)] = -1
    return offsets, groups, np.array(weights, np.float32)


def write_weights(mesh, dense):
    """dense (V, groups): entries above zero become entries of the vertex groups of that index, the
    heaviest first."""
    bm = bmesh.new()
    try:
        bm.from_mesh(mesh, face_normals=False, vertex_normals=False)
        layer = bm.verts.layers.deform.verify()
        rows, columns = np.nonzero(dense > 0)
        values = dense[rows, columns]
        order = np.lexsort((-values, rows))
        vertices = bm.verts
        vertices.ensure_lookup_table()
        for row, column, value in zip(
                rows[order].tolist(), columns[order].tolist(), values[order].tolist()):
            vertices[row][layer][column] = value
        bm.to_mesh(mesh)
    finally:
        bm.free()


# --- armatures ------------------------------------------------------------------------------------

_BONE_NUMBERS = (
    ("use_deform", 1, bool), ("use_envelope_multiply", 1, bool), ("bbone_segments", 1, np.int32),
    ("matrix_local", 16, np.float32), ("length", 1, np.float32), ("head_radius", 1, np.float32),
    ("tail_radius", 1, np.float32), ("envelope_distance", 1, np.float32),
    ("envelope_weight", 1, np.float32), ("bbone_curveinx", 1, np.float32),
    ("bbone_curveinz", 1, np.float32), ("bbone_curveoutx", 1, np.float32),
    ("bbone_curveoutz", 1, np.float32), ("bbone_rollin", 1, np.float32),
    ("bbone_rollout", 1, np.float32), ("bbone_easein", 1, np.float32),
    ("bbone_easeout", 1, np.float32))


def bone_signature(armature):
    """What can be compared to see whether bones have changed in anything that decides on influences."""
    bones = armature.data.bones
    parts = [bones.keys()]
    for name, size, dtype in _BONE_NUMBERS:
        numbers = np.empty(size * len(bones), dtype)
        bones.foreach_get(name, numbers)
        parts.append(numbers.tobytes())
    parts.append([is_curved(bone) for bone in bones])
    return parts


def is_curved(bone):
    """Whether a B-bone's vertices belong to its segments along its curve (4.x)."""
    return getattr(bone, "bbone_mapping_mode", "STRAIGHT") == "CURVED"


def read_bones(armature):
    """Fields of influences.Bones, each with an entry a pose bone in the order of `read_channels`."""
    bones = [bone.bone for bone in armature.pose.bones]

    def numbers(name, dtype=np.float64):
        return np.array([getattr(bone, name) for bone in bones], dtype)

    rest = np.array([bone.matrix_local for bone in bones], np.float64).reshape(-1, 4, 4)
    return dict(
        names=tuple(bone.name for bone in bones), deform=numbers("use_deform", bool), rest=rest,
        length=numbers("length"), head_radius=numbers("head_radius"),
        tail_radius=numbers("tail_radius"), envelope_distance=numbers("envelope_distance"),
        envelope_weight=numbers("envelope_weight"), multiply=numbers("use_envelope_multiply", bool),
        segments=numbers("bbone_segments", int),
        curved=np.array([is_curved(bone) for bone in bones], bool))


def read_channels(armature, numbers=None):
    """(B, 4, 4) float32: each pose bone's motion from rest to pose, armature space; a view of numbers
    (16 B,), if given, which has them by columns, as Blender does."""
    bones = armature.pose.bones
    if numbers is None:
        numbers = np.empty(16 * len(bones), np.float32)
    bones.foreach_get("matrix_channel", numbers)
    return numbers.reshape(-1, 4, 4).transpose(0, 2, 1)


def read_segments(armature, bone, rest=False):
    """(n + 1, 4, 4): the ends of a B-bone's n segments, space of the bone."""
    pose_bone = armature.pose.bones[bone]
    return np.array([pose_bone.bbone_segment_matrix(k, rest=rest)
                     for k in range(pose_bone.bone.bbone_segments + 1)], np.float64)


def segment_at(armature, bone, point):
    """(segment, 0 to 1: how near its end) of a curved B-bone at a point (3,), space of the armature."""
    return armature.pose.bones[bone].bbone_segment_index(Vector(point))


def read_bone_matrix(armature, bone):
    """(4, 4): a pose bone in the armature's space."""
    return matrix_to_numpy(armature.pose.bones[bone].matrix)


def write_pose(armature, location, rotation):
    """location (B, 3), rotation (B, 4) w x y z -> all pose bones of the original armature."""
    bones = armature.pose.bones
    bones.foreach_set("location", location.astype(np.float32).reshape(-1))
    bones.foreach_set("rotation_quaternion", rotation.astype(np.float32).reshape(-1))
    bones.foreach_set("scale", np.ones(3 * len(bones), np.float32))
    armature.update_tag(refresh={"DATA"})


# --- custom properties ----------------------------------------------------------------------------

def to_property(array):
    """A numpy array as what a custom property holds: flat numbers."""
    flat = np.ascontiguousarray(array).reshape(-1)
    if flat.dtype.kind == "i":
        flat = flat.astype(np.int32)
    return flat.tolist()


def from_property(values, dtype, shape):
    return np.array(values.to_list() if hasattr(values, "to_list") else values, dtype).reshape(shape)
