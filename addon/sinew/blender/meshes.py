"""Reads and writes meshes as numpy arrays. Does not depend on what they are used for."""

from collections.abc import Iterable

import bmesh
import bpy
import numpy as np

from ..host import deform_verts, mesh_arrays
from . import nodes, values


def read_positions(mesh: bpy.types.Mesh) -> np.ndarray:
    """Returns the positions of the mesh's vertices, (V, 3) float32."""
    positions = np.empty(3 * len(mesh.vertices), np.float32)
    attribute = mesh.attributes.get("position")
    if attribute is None or len(attribute.data) != len(mesh.vertices):  # before 3.5, and in Edit Mode
        mesh.vertices.foreach_get("co", positions)
    else:  # copies memory; the other way reads vertex by vertex
        attribute.data.foreach_get("vector", positions)
    return positions.reshape(-1, 3)


def read_evaluated(ob: bpy.types.Object) -> np.ndarray:
    """Returns the positions (V, 3) float32 of an evaluated mesh object after all modifiers, including subdivision that
    Blender has deferred."""
    if not any(modifier.type == "SUBSURF" for modifier in ob.modifiers):
        return read_positions(ob.data)
    mesh = ob.to_mesh()  # before 4.1 it copies weights
    try:
        return read_positions(mesh)
    finally:
        ob.to_mesh_clear()


def write_positions(mesh: bpy.types.Mesh, positions: np.ndarray) -> None:
    """Sets the positions of the mesh's vertices, (V, 3) float32, and tags the mesh for evaluation."""
    flat = positions.reshape(-1)
    attribute = mesh.attributes.get("position")
    if attribute is None:  # before 3.5
        mesh.vertices.foreach_set("co", flat)
        mesh.update()
    else:
        numbers = mesh_arrays.attribute_vectors(attribute, len(positions))
        if numbers is None:
            attribute.data.foreach_set("vector", flat)
        else:
            numbers[:] = positions
        # In 4.3, every other way to tag the mesh leaves its bounding box stale. This setter tags everything.
        if len(positions):
            mesh.vertices[0].co = positions[0]


def selected_vertices(mesh: bpy.types.Mesh) -> np.ndarray:
    """Returns (V,) bool: the vertices that are selected, of a mesh in Edit Mode those that were before."""
    found = np.empty(len(mesh.vertices), bool)
    mesh.vertices.foreach_get("select", found)
    return found


def select_vertices(mesh: bpy.types.Mesh, selected: np.ndarray) -> None:
    """Selects only these vertices, and no edge or face. selected: (V,) bool. Not for Edit Mode."""
    # `edges[0].select` is not used: 5.0's Mesh.from_pydata makes an attribute of the wrong type, with which it crashes.
    for name in (".select_edge", ".select_poly"):
        attribute = mesh.attributes.get(name)
        if attribute is not None:
            mesh.attributes.remove(attribute)
    mesh.vertices.foreach_set("select", selected)


def read_topology(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns edges (E, 2), offsets of each face's corners (faces + 1,) and the corners' vertices (C,), all int32."""
    return mesh_arrays.read_connections(mesh.edges, "vertices", 2), *read_corners(mesh)


def read_corners(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Returns offsets of each face's corners (faces + 1,) and the corners' vertices (C,), int32."""
    corners = mesh_arrays.read_connections(mesh.loops, "vertex_index")[:, 0]
    return np.append(mesh_arrays.read_connections(mesh.polygons, "loop_start"), np.int32(len(corners))), corners


def point_attribute(mesh: bpy.types.Mesh, name: str) -> bpy.types.Attribute | None:
    """Returns the mesh's vector attribute of that name on the point domain, or None."""
    attribute = mesh.attributes.get(name)
    if attribute and attribute.data_type == "FLOAT_VECTOR" and attribute.domain == "POINT":
        return attribute
    return None


def read_attribute(attribute: bpy.types.Attribute) -> np.ndarray:
    """Returns the values of a vector attribute, (V, 3) float32."""
    vectors = np.empty(3 * len(attribute.data), np.float32)
    attribute.data.foreach_get("vector", vectors)
    return vectors.reshape(-1, 3)


def write_attribute(mesh: bpy.types.Mesh, name: str, vectors: np.ndarray) -> None:
    """Writes vectors (V, 3) float32 to a vector attribute on the point domain, which is created if it is missing."""
    attribute = point_attribute(mesh, name)
    if attribute is None:
        stale = mesh.attributes.get(name)
        if stale:
            mesh.attributes.remove(stale)
        attribute = mesh.attributes.new(name, "FLOAT_VECTOR", "POINT")
    attribute.data.foreach_set("vector", vectors.reshape(-1))
    mesh.update_tag()


# Name of the property and count of numbers of a value, and their type, by the type of an attribute.
_VALUES = {
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "BOOLEAN": ("value", 1, bool),
    "INT8": ("value", 1, np.int32),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
    "INT16_2D": ("value", 2, np.int32),
    "INT32_2D": ("value", 2, np.int32),
    "QUATERNION": ("value", 4, np.float32),
    "FLOAT4X4": ("value", 16, np.float32),
}
_LEGACY = (("edges", "use_freestyle_mark"), ("polygons", "use_freestyle_mark"))  # no attributes before 5.0
_SETTINGS = "use_auto_texspace", "texspace_location", "texspace_size"


def read_values(attribute: bpy.types.Attribute) -> np.ndarray:
    """Returns the numbers of an attribute, in a row. Raises KeyError for a type that cannot be compared."""
    return _read(attribute.data, *_VALUES[attribute.data_type])


def are_same(one: bpy.types.Mesh, other: bpy.types.Mesh) -> bool:
    """Whether two meshes have the same vertices, edges, faces, attributes, weights, materials and settings, to the bit.
    False also if they have an attribute that cannot be compared. Not for meshes with shape keys. Since 4.1."""
    if _outline(one) != _outline(other):
        return False
    for name, kind, _domain in _outline(one)[1]:
        if kind not in _VALUES:
            return False
        if not _same_numbers(*(read_values(mesh.attributes[name]) for mesh in (one, other))):
            return False
    starts = (_read(mesh.polygons, "loop_start", 1, np.int32) for mesh in (one, other))
    if not _same_numbers(*starts):
        return False
    for collection, flag in _LEGACY:
        parts = [getattr(mesh, collection) for mesh in (one, other)]
        if len(parts[0]) and hasattr(parts[0][0], flag):
            if not _same_numbers(*(_read(part, flag, 1, bool) for part in parts)):
                return False
    return all(map(_same_numbers, read_weights(one), read_weights(other)))


def _outline(mesh):
    """Returns what two meshes must have in common before their arrays are compared."""
    colors, uvs = mesh.color_attributes, mesh.uv_layers
    return (
        tuple(map(len, (mesh.vertices, mesh.edges, mesh.polygons, mesh.loops))),
        [(each.name, each.data_type, each.domain) for each in mesh.attributes],
        deform_verts.group_names(mesh),
        [material and material.original for material in mesh.materials],
        [tuple(value) if hasattr(value, "__len__") else value for value in (getattr(mesh, s) for s in _SETTINGS)],
        (colors.active_color_index, colors.render_color_index, uvs.active_index, mesh.has_custom_normals),
        [each.active_render for each in uvs],
    )


def _read(items, name, size, dtype):
    numbers = np.empty(size * len(items), dtype)
    items.foreach_get(name, numbers)
    return numbers


def _same_numbers(one, other):
    """Whether two arrays are equal to the bit, also where they are not numbers."""
    return one.tobytes() == other.tobytes()


def remove_attribute(mesh: bpy.types.Mesh, name: str) -> None:
    """Removes the attribute of that name, if there is one."""
    attribute = mesh.attributes.get(name)
    if attribute:
        mesh.attributes.remove(attribute)


def clear_keys(ob: bpy.types.Object) -> None:
    """Removes the shape keys of a mesh object. Blender 4.3 leaves their data-block, of which it complains when it
    saves."""
    keys = ob.data.shape_keys
    if keys is not None:
        key = values.key_of(keys)
        ob.shape_key_clear()
        bpy.data.batch_remove([each for each in bpy.data.shape_keys if values.key_of(each) == key])


def copy_geometry(mesh: bpy.types.Mesh, target: bpy.types.Mesh, without: str) -> None:
    """Replaces the target's vertices, edges, faces, shape keys and attributes with those of a mesh, except the vector
    attribute named `without`."""
    bm = bmesh.new()
    try:
        bm.from_mesh(mesh, face_normals=False, vertex_normals=False)
        layer = bm.verts.layers.float_vector.get(without)
        if layer is not None:
            bm.verts.layers.float_vector.remove(layer)
        bm.to_mesh(target)
    finally:
        bm.free()


def new_mesh(name: str, positions: np.ndarray, face_offsets: np.ndarray, face_vertices: np.ndarray) -> bpy.types.Mesh:
    """Makes a mesh of polygons. It has all vertices, in the given order."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions.astype(np.float32).reshape(-1))
    mesh.loops.add(len(face_vertices))
    mesh.loops.foreach_set("vertex_index", face_vertices.astype(np.int32))
    face_count = len(face_offsets) - 1
    mesh.polygons.add(face_count)
    mesh.polygons.foreach_set("loop_start", face_offsets[:-1].astype(np.int32))
    if bpy.app.version < (4, 1, 0):  # later versions compute it from the starts
        mesh.polygons.foreach_set("loop_total", np.diff(face_offsets).astype(np.int32))
    mesh.update(calc_edges=True)
    mesh.validate()  # removes invalid faces, never vertices
    shade_smooth(mesh)
    return mesh


def shade_smooth(mesh: bpy.types.Mesh) -> None:
    """Sets all faces to smooth shading."""
    mesh.polygons.foreach_set("use_smooth", np.ones(len(mesh.polygons), bool))
    mesh.update()


def read_faces(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns face_offsets (faces + 1,), face_vertices and face_materials (faces,), int32."""
    materials = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("material_index", materials)
    return *read_corners(mesh), materials


# --- weights --------------------------------------------------------------------------------------


def read_weights(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns offsets (V + 1,) int64, groups (N,) int32 and weights (N,) float32, in the order in which Blender stores
    them: dual quaternion skinning depends on it."""
    address = deform_verts.deform_vertices(mesh) if not mesh.is_editmode else None
    if address is None:
        return _weights_by_bmesh(mesh)
    if address == 0:
        return np.zeros(len(mesh.vertices) + 1, np.int64), np.empty(0, np.int32), np.empty(0, np.float32)
    return deform_verts.read(address, len(mesh.vertices))


def read_object_weights(ob: bpy.types.Object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns the same as `read_weights`, for a mesh object. Entries of removed vertex groups have the group -1."""
    offsets, groups, weights = read_weights(ob.data)
    groups[groups >= len(ob.vertex_groups)] = -1
    return offsets, groups, weights


def has_weights(mesh: bpy.types.Mesh) -> bool:
    """Whether the mesh has an array of weights, even an empty one."""
    address = deform_verts.deform_vertices(mesh)
    if address is not None:
        return address != 0
    bm = bmesh.new()
    try:
        bm.from_mesh(mesh, face_normals=False, vertex_normals=False)
        return bm.verts.layers.deform.active is not None
    finally:
        bm.free()


def _weights_by_bmesh(mesh):
    bm = bmesh.new()
    try:
        bm.from_mesh(mesh, face_normals=False, vertex_normals=False)
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
    return offsets, np.array(groups, np.int32), np.array(weights, np.float32)


def count_sharers(ob: bpy.types.Object, among: Iterable[bpy.types.Object] | None = None) -> int:
    """Returns how many objects that Blender may evaluate use this object's mesh, without canvases. among: the objects
    to search; None: all objects of the file."""
    if ob.data.users - ob.data.use_fake_user < 2:
        return 1
    among = bpy.data.objects if among is None else among
    return sum(
        other == ob or not nodes.is_canvas(other) and _may_be_evaluated(other, ob)
        for other in among
        if other.data == ob.data
    )


def _may_be_evaluated(other, ob):
    """Whether Blender may evaluate the other object. It does not if it is only the reference of ob's override."""
    reference = ob.override_library.reference if ob.override_library else None
    return (
        other != reference
        or bool(other.users_scene)
        or any(
            each.instance_collection is not None and other.name in each.instance_collection.all_objects
            for each in bpy.data.objects
        )
    )
