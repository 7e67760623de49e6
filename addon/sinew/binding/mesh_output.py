"""The output Mesh: positions straight in the mesh's own vertices, for scripts and exporters that read those. The rest
shape is kept in an attribute."""

from ..blender import memory, meshes

REST_ATTRIBUTE = "rest_position"


class OutputError(Exception):
    """The output cannot be installed; the message says why."""


def check(ob, taken):
    """Raises OutputError if the mesh cannot have it. taken: the Armature modifiers that Sinew stands in for."""
    mesh = ob.data
    before = [modifier for modifier in ob.modifiers if modifier.show_viewport or modifier.show_render]
    before = before[:before.index(taken[0])] if taken and taken[0] in before else []
    if before:
        raise OutputError(
            f"{ob.name} has a modifier before its armature's ({before[0].name}), which the output Mesh "
            "cannot follow; use the output Modifier")
    if mesh.attributes.get(REST_ATTRIBUTE):
        raise OutputError(
            f'{mesh.name} already has an attribute "{REST_ATTRIBUTE}", which the output '
            "Mesh needs; rename or remove it, or use the output Modifier")
    if mesh.library:
        raise OutputError(
            f"The mesh {mesh.name} is linked from another file, so the output Mesh cannot write "
            "it; use the output Modifier")
    if mesh.users > 1:
        raise OutputError(
            f"The mesh {mesh.name} has {mesh.users} users, which the output Mesh would all "
            "deform; make it single-user first, or use the output Modifier")
    if mesh.shape_keys:
        raise OutputError(
            f"{ob.name} has shape keys, which the output Mesh cannot follow; use the output Modifier")


def install(ob):
    meshes.write_attribute(ob.data, REST_ATTRIBUTE, meshes.read_positions(ob.data))


def remove(ob):
    if meshes.point_attribute(ob.data, REST_ATTRIBUTE):  # else somebody removed it: the shape stays
        show_rest(ob)
    meshes.remove_attribute(ob.data, REST_ATTRIBUTE)


def show_rest(ob):
    """The rest shape in place of the deformed one."""
    meshes.write_positions(ob.data, rest_positions(ob))


def rest_positions(ob):
    attribute = meshes.point_attribute(ob.data, REST_ATTRIBUTE)
    if attribute is None:
        raise OutputError(
            f'{ob.data.name} has lost its attribute "{REST_ATTRIBUTE}" with the rest '
            "positions; unbind it, which leaves the shape as it is")
    return meshes.read_attribute(attribute)


def target(ob):
    """(V, 3) float32: the mesh's own memory of its positions, or None if it cannot be had (3.4)."""
    attribute = ob.data.attributes.get("position")
    return attribute and memory.attribute_vectors(attribute, len(ob.data.vertices))
