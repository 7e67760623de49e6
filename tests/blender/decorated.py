"""Objects with all that a mesh may have, and what is left of it in a result."""

import bpy
import numpy as np

from helpers import addon_module, depsgraph


def everything_of(mesh):
    """What a mesh has besides its positions and normals."""
    found = {"groups": addon_module("host.deform_verts").group_names(mesh)}
    read = addon_module("blender.meshes")._read
    values = addon_module("blender.meshes")._VALUES
    for each in mesh.attributes:
        if each.name not in {"position", "custom_normal"}:
            found[each.name] = each.data_type, each.domain, read(each.data, *values[each.data_type]).tobytes()
    found["weights"] = [part.tobytes() for part in read.__globals__["read_weights"](mesh)]
    found["materials"] = [material and material.name for material in mesh.materials]
    found["faces"] = read(mesh.polygons, "loop_start", 1, np.int32).tobytes()
    return found


def decorate(ob):
    mesh = ob.data
    for name in ("Red", "Blue"):
        mesh.materials.append(bpy.data.materials.new(name))
    random = np.random.default_rng(1)
    mesh.polygons.foreach_set("material_index", random.integers(0, 2, len(mesh.polygons)).astype(np.int32))
    mesh.polygons.foreach_set("use_smooth", random.integers(0, 2, len(mesh.polygons)).astype(bool))
    for name in ("Map", "Other"):
        mesh.uv_layers.new(name=name).data.foreach_set("uv", random.random(2 * len(mesh.loops)))
    for kind, domain in (
        ("BYTE_COLOR", "CORNER"), ("FLOAT_COLOR", "POINT"), ("FLOAT", "EDGE"), ("INT", "FACE"), ("BOOLEAN", "POINT"),
        ("FLOAT2", "POINT"), ("FLOAT_VECTOR", "CORNER"), ("INT8", "FACE"),
    ):  # fmt: skip
        attribute = mesh.attributes.new(f"{kind} {domain}", kind, domain)
        name, size, dtype = addon_module("blender.meshes")._VALUES[kind]
        attribute.data.foreach_set(name, (random.random(size * len(attribute.data)) * 3).astype(dtype))
    mesh.attributes.new("crease_edge", "FLOAT", "EDGE").data.foreach_set("value", random.random(len(mesh.edges)))
    ob.vertex_groups.new(name="unused")
    ob.material_slots[1].link = "OBJECT"
    ob.material_slots[1].material = bpy.data.materials.new("Own")


def of_result(ob):
    return everything_of(ob.evaluated_get(depsgraph()).data)


def empty_at_a_vertex(ob, vertex):
    empty = bpy.data.objects.new("Follower", None)
    bpy.context.collection.objects.link(empty)
    empty.parent, empty.parent_type = ob, "VERTEX"
    empty.parent_vertices = [vertex, 0, 0]
    return empty
