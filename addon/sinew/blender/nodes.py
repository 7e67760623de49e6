"""Manages Sinew's Geometry Nodes modifier, which moves vertices to the positions in an attribute."""

import bpy

from . import graph, modifier_types

MODIFIER_NAME = "Sinew"
NODE_GROUP_NAME = "Sinew"
PLACING_GROUP_NAME = "Sinew Placing"  # inside the former
SHARED_GROUP_NAME = "Sinew Shared"  # of Sinew's modifier on a mesh that several objects share
SHARED_PLACING_GROUP_NAME = "Sinew Shared Placing"  # inside the former
FRONT_GROUP_NAME = "Sinew Front"  # of Sinew's modifier that takes all from a canvas
FRONT_PLACING_GROUP_NAME = "Sinew Front Placing"  # inside the former
_INNER = {PLACING_GROUP_NAME, SHARED_PLACING_GROUP_NAME, FRONT_PLACING_GROUP_NAME}
CANVAS_GROUP_NAME = "Sinew Canvas"  # of the only modifier of a canvas
NODE_GROUP_VERSION = 5
VERSION_PROPERTY = "sinew_version"
READS_PROPERTY = "sinew_reads"  # of the groups that read a canvas: POSITIONS or GEOMETRY
POSITIONS, GEOMETRY = 1, 2
CANVAS_PROPERTY = "sinew_canvas"  # of the group of canvases: its version
CANVAS_GROUP_VERSION = 1
CANVAS_INPUT = "Canvas"
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


def reads_canvas(modifier: bpy.types.Modifier) -> bool:
    """Whether Sinew's modifier takes the positions from a canvas, not from the object's own mesh."""
    return READS_PROPERTY in modifier.node_group


def reads_front(modifier: bpy.types.Modifier) -> bool:
    """Whether Sinew's modifier takes all of its result from a canvas."""
    return modifier.node_group.get(READS_PROPERTY) == GEOMETRY


def canvas_of(modifier: bpy.types.Modifier) -> bpy.types.Object | None:
    """Returns the canvas from which Sinew's modifier takes the positions, or None."""
    return graph.get_input(modifier, CANVAS_INPUT) if reads_canvas(modifier) else None


def set_canvas(modifier: bpy.types.Modifier, canvas: bpy.types.Object | None, takes_all: bool = False) -> None:
    """Has Sinew's modifier take the positions from a canvas, or with None from the object's own mesh. takes_all: not
    only the positions, but all that the canvas has."""
    group = node_group() if canvas is None else front_group() if takes_all else shared_group()
    if modifier.node_group != group:
        modifier.node_group = group
    if canvas is not None:
        graph.set_inputs(modifier, {CANVAS_INPUT: canvas})


def is_canvas(ob: bpy.types.Object) -> bool:
    """Whether an object is a canvas: it is in no scene, has the mesh of another object, and its evaluated copies have
    that object's deformed positions in an attribute."""
    return len(ob.modifiers) > 0 and _is_canvas_modifier(ob.modifiers[-1])


def _is_canvas_modifier(modifier):
    return modifier.type == "NODES" and modifier.node_group is not None and CANVAS_PROPERTY in modifier.node_group


def add_canvas_modifier(ob: bpy.types.Object) -> None:
    """Makes an object a canvas, whose result is that of the modifiers which it has."""
    ob.modifiers.new(MODIFIER_NAME, "NODES").node_group = canvas_group()


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
    group = _found({VERSION_PROPERTY: NODE_GROUP_VERSION, READS_PROPERTY: None})
    if group is not None:
        return group
    group, source, target = _new_group(NODE_GROUP_NAME)
    _keep(group, {VERSION_PROPERTY: NODE_GROUP_VERSION})
    within = group.nodes.new("GeometryNodeGroup")
    within.node_tree = _placing_group()
    _link(group, source, within, target)
    return group


def shared_group() -> bpy.types.NodeTree:
    """Returns the node group of Sinew's modifiers on meshes that several objects share, and makes it if there is none.
    It moves the vertices to the positions in the attribute of a canvas. Nested like `node_group`."""
    return _reading_group(SHARED_GROUP_NAME, POSITIONS, _shared_placing_group)


def front_group() -> bpy.types.NodeTree:
    """Returns the node group of Sinew's modifiers that take all from a canvas, and makes it if there is none. Its
    result is that of the canvas, with the vertices at the positions in its attribute. Nested like `node_group`."""
    return _reading_group(FRONT_GROUP_NAME, GEOMETRY, _front_placing_group)


def _reading_group(name, what, make_inner):
    """Returns a node group that reads a canvas, and makes it if there is none. what: POSITIONS or GEOMETRY; make_inner:
    function that returns the new group within it."""
    properties = {VERSION_PROPERTY: NODE_GROUP_VERSION, READS_PROPERTY: what}
    found = _found(properties)
    if found is not None:
        return found
    group, source, target = _new_group(name, CANVAS_INPUT)
    _keep(group, properties)
    within = group.nodes.new("GeometryNodeGroup")
    within.node_tree = make_inner()
    _link(group, source, within, target)
    group.links.new(source.outputs[CANVAS_INPUT], within.inputs[CANVAS_INPUT])
    return group


def canvas_group() -> bpy.types.NodeTree:
    """Returns the node group of canvases, and makes it if there is none. It adds the attribute, with the positions at
    rest, to a result that no other object has: Blender's evaluated mesh belongs to all objects that share a mesh."""
    found = _found({CANVAS_PROPERTY: CANVAS_GROUP_VERSION})
    if found is not None:
        return found
    group, source, target = _new_group(CANVAS_GROUP_NAME)
    _keep(group, {CANVAS_PROPERTY: CANVAS_GROUP_VERSION})
    store = group.nodes.new("GeometryNodeStoreNamedAttribute")
    store.data_type, store.domain = "FLOAT_VECTOR", "POINT"
    store.inputs["Name"].default_value = POSITION_ATTRIBUTE
    position = group.nodes.new("GeometryNodeInputPosition")
    position.location = (0, -200)
    group.links.new(position.outputs[0], _vector_value(store))
    _link(group, source, store, target)
    return group


def make_groups() -> None:
    """Makes all node groups of which a mesh that is bound may need one."""
    for make in (node_group, shared_group, front_group, canvas_group):
        make()


def _found(properties):
    """Returns the local group with these custom properties, as a group that Blender saves, or None. A property that
    must be absent is None."""
    for group in bpy.data.node_groups:
        if group.library is None and all(group.get(name) == value for name, value in properties.items()):
            _keep(group, {})
            return group
    return None


def _keep(group, properties):
    """Sets custom properties of a group, and has Blender save the group even if nothing uses it."""
    for name, value in properties.items():
        group[name] = value
    if not group.use_fake_user:
        group.use_fake_user = True


def _placing_group():
    """Returns a new group that moves the vertices to the positions in the attribute and removes the attribute."""
    group, source, target = _new_group(PLACING_GROUP_NAME)
    attribute = group.nodes.new("GeometryNodeInputNamedAttribute")
    attribute.data_type = "FLOAT_VECTOR"
    attribute.inputs["Name"].default_value = POSITION_ATTRIBUTE
    attribute.location = (200, -200)
    place, value = _new_place(group)
    forget = _new_forget(group)
    group.links.new(attribute.outputs["Attribute"], value)
    # A mesh without the attribute keeps its own shape.
    if "Exists" in attribute.outputs:
        group.links.new(attribute.outputs["Exists"], place.inputs["Selection"])
    _link(group, source, place, forget, target)
    return group


def _shared_placing_group():
    """Returns a new group that moves the vertices to the positions in the attribute of a canvas."""
    group, source, target = _new_group(SHARED_PLACING_GROUP_NAME, CANVAS_INPUT)
    canvas, attribute = _canvas_and_attribute(group, source)
    index = group.nodes.new("GeometryNodeInputIndex")
    sample = group.nodes.new("GeometryNodeSampleIndex")
    sample.data_type, sample.domain = "FLOAT_VECTOR", "POINT"
    index.location, sample.location = (0, -600), (200, -200)
    place, value = _new_place(group)
    geometry = next(socket for socket in sample.inputs if socket.type == "GEOMETRY")
    group.links.new(canvas.outputs["Geometry"], geometry)
    group.links.new(attribute.outputs["Attribute"], _vector_value(sample))
    group.links.new(index.outputs[0], graph.enabled(sample.inputs, "Index"))
    group.links.new(graph.enabled(sample.outputs), value)
    _link(group, source, place, target)
    return group


def _front_placing_group():
    """Returns a new group that returns the geometry of a canvas, with its vertices at the positions in its attribute,
    and without that."""
    group, source, target = _new_group(FRONT_PLACING_GROUP_NAME, CANVAS_INPUT)
    canvas, attribute = _canvas_and_attribute(group, source)
    place, value = _new_place(group)
    forget = _new_forget(group)
    group.links.new(canvas.outputs["Geometry"], place.inputs["Geometry"])
    group.links.new(attribute.outputs["Attribute"], value)
    _link(group, place, forget, target)
    return group


def _canvas_and_attribute(group, source):
    """Adds nodes for a canvas and for the attribute of deformed positions, and returns them. source: the group's input
    node."""
    canvas = group.nodes.new("GeometryNodeObjectInfo")
    canvas.transform_space = "ORIGINAL"
    group.links.new(source.outputs[CANVAS_INPUT], canvas.inputs["Object"])
    canvas.location = (0, -200)
    attribute = group.nodes.new("GeometryNodeInputNamedAttribute")
    attribute.data_type = "FLOAT_VECTOR"
    attribute.inputs["Name"].default_value = POSITION_ATTRIBUTE
    attribute.location = (0, -400)
    return canvas, attribute


def _new_forget(group):
    """Adds a node that removes the attribute of deformed positions: later modifiers would have to process it."""
    forget = group.nodes.new("GeometryNodeRemoveAttribute")
    forget.inputs["Name"].default_value = POSITION_ATTRIBUTE
    return forget


def _new_place(group):
    """Adds a node that sets all positions. Returns it, and its input for them."""
    if bpy.app.version < (4, 0, 0):
        place = group.nodes.new("GeometryNodeSetPosition")
        return place, place.inputs["Position"]
    # The same result as Set Position, but faster.
    place = group.nodes.new("GeometryNodeStoreNamedAttribute")
    place.data_type, place.domain = "FLOAT_VECTOR", "POINT"
    place.inputs["Name"].default_value = "position"
    return place, _vector_value(place)


def _vector_value(node):
    """Returns the input of a node for values that are vectors."""
    return next(socket for socket in node.inputs if socket.name == "Value" and socket.type == "VECTOR")


def _new_group(name, object_input=None):
    """Returns a new group with a geometry as input and output, its input node and its output node. object_input: name
    of another input, an object."""
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        graph.new_socket(group, "Geometry", direction, "NodeSocketGeometry")
    if object_input is not None:
        graph.new_socket(group, object_input, "INPUT", "NodeSocketObject")
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
    """Deletes Sinew's node groups that nothing uses, including those of older versions. A file may have been saved with
    an inner group whose outer one was no longer used."""
    for group in _own_groups():
        if group.users == group.use_fake_user:
            bpy.data.node_groups.remove(group)
    groups = [each for each in bpy.data.node_groups if each.library is None and each.users == 0]
    bpy.data.batch_remove([each for each in groups if each.name.partition(".")[0] in _INNER])


def _own_groups():
    return [
        group
        for group in bpy.data.node_groups
        if (VERSION_PROPERTY in group or CANVAS_PROPERTY in group) and group.library is None
    ]
