"""Manages Sinew's Geometry Nodes modifier, which moves vertices to the positions in an attribute."""

import bpy

from . import graph, modifier_types

MODIFIER_NAME = "Sinew"
NODE_GROUP_NAME = "Sinew"
PLACING_GROUP_NAME = "Sinew Placing"  # inside the former
NODE_GROUP_VERSION = 5
VERSION_PROPERTY = "sinew_version"
POSITION_ATTRIBUTE = ".sinew_position"  # the dot hides it in the interface


def is_sinew(modifier: bpy.types.Modifier) -> bool:
    """Whether this is Sinew's own modifier."""
    return modifier.type == "NODES" and modifier.node_group is not None and VERSION_PROPERTY in modifier.node_group


def find_modifier(ob: bpy.types.Object) -> bpy.types.Modifier | None:
    """Returns Sinew's modifier of the object, or None."""
    return next(filter(is_sinew, ob.modifiers), None)


def add_modifier(ob: bpy.types.Object, index: int) -> bpy.types.Modifier:
    """Adds Sinew's modifier at that index of the stack. Raises ValueError if Blender does not allow it there."""
    modifier = ob.modifiers.new(MODIFIER_NAME, "NODES")
    modifier.node_group = node_group()
    # Sinew switches it on only in evaluated copies, so without Sinew it is off.
    modifier.show_expanded = modifier.show_viewport = modifier.show_render = False
    try:
        move_modifier(ob, modifier, index)
    except ValueError:
        ob.modifiers.remove(modifier)
        raise
    return modifier


def has_old_group(modifier: bpy.types.Modifier) -> bool:
    """Whether Sinew's modifier has a node group that an older version of Sinew made, and that is not linked."""
    return modifier.node_group[VERSION_PROPERTY] < NODE_GROUP_VERSION and modifier.node_group.library is None


def renew_group(modifier: bpy.types.Modifier) -> None:
    """Replaces the node group of Sinew's modifier by that of this version."""
    modifier.node_group = node_group()
    forget_unused_groups()


def is_removable(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> bool:
    """Whether a modifier can be removed. A library override keeps the library's modifiers: if removed, they would come
    back at a different index."""
    return ob.override_library is None or not modifier.is_override_data


def remove_modifiers(ob: bpy.types.Object) -> None:
    """Removes Sinew's modifiers from the object, except those of a library override."""
    for modifier in [modifier for modifier in ob.modifiers if is_sinew(modifier)]:
        if is_removable(ob, modifier):
            ob.modifiers.remove(modifier)


def move_modifier(ob: bpy.types.Object, modifier: bpy.types.Modifier, index: int) -> None:
    """Moves a modifier up to that index. Raises ValueError if Blender does not allow it and the order matters."""
    _move(ob, modifier, index)
    place = ob.modifiers.find(modifier.name)
    others = [m.name for m in ob.modifiers[index:place] if m.type != "ARMATURE" and (m.show_viewport or m.show_render)]
    if others:
        raise ValueError(f"Blender does not allow {modifier.name} before {others[0]} on {ob.name}")


def move_modifier_back(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> None:
    """Moves a modifier as far towards the end of the stack as Blender allows."""
    for index in range(ob.modifiers.find(modifier.name) + 1, len(ob.modifiers)):
        _move(ob, modifier, index)


def identity(modifier: bpy.types.Modifier) -> int:
    """Returns a number that identifies a modifier of an original object, even after it is renamed."""
    return modifier.persistent_uid if hasattr(modifier, "persistent_uid") else modifier.as_pointer()


def move_behind_deforming(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> None:
    """Moves a modifier to where Blender inserts a new Hook: before the first modifier that does more than deform.
    Sinew's own modifier is ignored."""
    others = [each for each in ob.modifiers if each != modifier]
    end = next(
        (i for i, each in enumerate(others) if each.type not in modifier_types.ONLY_DEFORMING and not is_sinew(each)),
        len(others),
    )
    for index in range(ob.modifiers.find(modifier.name) + 1, end + 1):
        _move(ob, modifier, index)


def _move(ob, modifier, index):
    """Moves a modifier to that index, if Blender allows it."""
    place = ob.modifiers.find(modifier.name)
    if place == index:
        return
    try:
        if hasattr(ob.modifiers, "move"):
            ob.modifiers.move(place, index)
        else:  # before 3.5
            with bpy.context.temp_override(object=ob, active_object=ob):
                bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=index)
    except RuntimeError:
        pass


def node_group() -> bpy.types.NodeTree:
    """Returns the node group that Sinew's modifiers share, and makes it if there is none. All its work is done in a
    nested group, because for each geometry passed between nodes of the outer group, Blender logs the names of all
    vertex groups for the spreadsheet."""
    group = graph.find_group(VERSION_PROPERTY, NODE_GROUP_VERSION)
    if group is not None:
        if not group.use_fake_user:
            group.use_fake_user = True
        return group
    group, source, target = _new_group(NODE_GROUP_NAME)
    group[VERSION_PROPERTY] = NODE_GROUP_VERSION
    group.use_fake_user = True
    within = group.nodes.new("GeometryNodeGroup")
    within.node_tree = _placing_group()
    _link(group, source, within, target)
    return group


def _placing_group():
    """Returns a new group that moves the vertices to the positions in the attribute and removes the attribute."""
    group, source, target = _new_group(PLACING_GROUP_NAME)
    attribute = group.nodes.new("GeometryNodeInputNamedAttribute")
    attribute.data_type = "FLOAT_VECTOR"
    attribute.inputs["Name"].default_value = POSITION_ATTRIBUTE
    attribute.location = (200, -200)
    if bpy.app.version >= (4, 0, 0):
        # The same result as Set Position, but faster.
        place = group.nodes.new("GeometryNodeStoreNamedAttribute")
        place.data_type, place.domain = "FLOAT_VECTOR", "POINT"
        place.inputs["Name"].default_value = "position"
        value = next(i for i in place.inputs if i.name == "Value" and i.type == "VECTOR")
    else:
        place = group.nodes.new("GeometryNodeSetPosition")
        value = place.inputs["Position"]
    # Otherwise a later Subdivision Surface would interpolate it.
    forget = group.nodes.new("GeometryNodeRemoveAttribute")
    forget.inputs["Name"].default_value = POSITION_ATTRIBUTE
    group.links.new(attribute.outputs["Attribute"], value)
    # A mesh without the attribute keeps its own shape.
    if "Exists" in attribute.outputs:
        group.links.new(attribute.outputs["Exists"], place.inputs["Selection"])
    _link(group, source, place, forget, target)
    return group


def _new_group(name):
    """Returns a new group with a geometry as input and output, its input node and its output node."""
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        graph.new_socket(group, "Geometry", direction, "NodeSocketGeometry")
    return group, group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")


def _link(group, *nodes):
    """Links the nodes in a row, by their geometry."""
    for column, node in enumerate(nodes):
        node.location = (200 * column, 0)
    for one, next_one in zip(nodes, nodes[1:]):
        group.links.new(one.outputs[0], next_one.inputs["Geometry"])


def let_groups_go() -> None:
    """Removes the fake users of Sinew's node groups, so that Blender does not save unused ones."""
    for group in _own_groups():
        group.use_fake_user = False


def forget_unused_groups() -> None:
    """Deletes Sinew's node groups that nothing uses, including those of older versions."""
    for group in _own_groups():
        if group.users == group.use_fake_user:
            within = {node.node_tree for node in group.nodes if node.type == "GROUP" and node.node_tree is not None}
            bpy.data.node_groups.remove(group)
            bpy.data.batch_remove([each for each in within if each.users == 0])


def _own_groups():
    return [group for group in bpy.data.node_groups if VERSION_PROPERTY in group and group.library is None]
