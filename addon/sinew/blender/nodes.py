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
    own = list(ob.modifiers)[-1:]
    return any(
        each.type == "NODES" and each.node_group is not None and CANVAS_PROPERTY in each.node_group for each in own
    )


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
    return _nesting_group(NODE_GROUP_NAME, None, _placing_group)


def shared_group() -> bpy.types.NodeTree:
    """Returns the node group of Sinew's modifiers on meshes that several objects share, and makes it if there is none.
    It moves the vertices to the positions in the attribute of a canvas. Nested like `node_group`."""
    return _nesting_group(SHARED_GROUP_NAME, POSITIONS, _shared_placing_group)


def front_group() -> bpy.types.NodeTree:
    """Returns the node group of Sinew's modifiers that take all from a canvas, and makes it if there is none. Its
    result is that of the canvas, with the vertices at the positions in its attribute. Nested like `node_group`."""
    return _nesting_group(FRONT_GROUP_NAME, GEOMETRY, _front_placing_group)


def _nesting_group(name, what, make_inner):
    """Returns a node group around another one, and makes it if there is none. what: POSITIONS or GEOMETRY if it reads a
    canvas, else None; make_inner: function that returns the new group within it."""
    properties = {VERSION_PROPERTY: NODE_GROUP_VERSION, READS_PROPERTY: what}
    found = _found(properties)
    if found is not None:
        return found
    new = _new_graph(name, what is not None)
    _keep(new.tree, properties)
    within = new.node("GeometryNodeGroup", node_tree=make_inner())
    for socket in within.inputs:
        new.put(new.input(socket.name), socket)
    return new.close(within.outputs[0])


def canvas_group() -> bpy.types.NodeTree:
    """Returns the node group of canvases, and makes it if there is none. It adds the attribute, with the positions at
    rest, to a result that no other object has: Blender's evaluated mesh belongs to all objects that share a mesh."""
    found = _found({CANVAS_PROPERTY: CANVAS_GROUP_VERSION})
    if found is not None:
        return found
    new = _new_graph(CANVAS_GROUP_NAME)
    _keep(new.tree, {CANVAS_PROPERTY: CANVAS_GROUP_VERSION})
    rest = new.node("GeometryNodeInputPosition").outputs[0]
    return new.close(_stored(new, POSITION_ATTRIBUTE, new.input("Geometry"), rest).outputs[0])


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
        if value is not None:
            group[name] = value
    if not group.use_fake_user:
        group.use_fake_user = True


def _new_graph(name, has_canvas=False):
    inputs = [("Geometry", "Geometry", None, None, "")]
    return graph.Graph(name, inputs + [(CANVAS_INPUT, "Object", None, None, "")] * has_canvas, "Geometry")


def _placing_group():
    """Returns a new group that moves the vertices to the positions in the attribute and removes the attribute."""
    new = _new_graph(PLACING_GROUP_NAME)
    attribute = _attribute(new)
    place = _placed(new, new.input("Geometry"), attribute.outputs["Attribute"])
    # A mesh without the attribute keeps its own shape.
    if "Exists" in attribute.outputs:
        new.put(attribute.outputs["Exists"], place.inputs["Selection"])
    return new.close(_without_attribute(new, place))


def _shared_placing_group():
    """Returns a new group that moves the vertices to the positions in the attribute of a canvas."""
    new = _new_graph(SHARED_PLACING_GROUP_NAME, True)
    values = {"Value": _attribute(new).outputs["Attribute"], "Index": new.node("GeometryNodeInputIndex").outputs[0]}
    there = new.node("GeometryNodeSampleIndex", {0: _canvas(new)} | values, data_type="FLOAT_VECTOR", domain="POINT")
    return new.close(_placed(new, new.input("Geometry"), graph.enabled(there.outputs)).outputs[0])


def _front_placing_group():
    """Returns a new group that returns the geometry of a canvas, with its vertices at the positions in its attribute,
    and without that."""
    new = _new_graph(FRONT_PLACING_GROUP_NAME, True)
    return new.close(_without_attribute(new, _placed(new, _canvas(new), _attribute(new).outputs["Attribute"])))


def _canvas(new):
    """Returns the geometry of the canvas."""
    canvas = new.node("GeometryNodeObjectInfo", {"Object": new.input(CANVAS_INPUT)}, transform_space="ORIGINAL")
    return canvas.outputs["Geometry"]


def _attribute(new):
    """Adds a node for the attribute of deformed positions."""
    return new.node("GeometryNodeInputNamedAttribute", {"Name": POSITION_ATTRIBUTE}, data_type="FLOAT_VECTOR")


def _without_attribute(new, place):
    """Removes the attribute of deformed positions from a geometry: later modifiers would have to process it."""
    values = {"Geometry": place.outputs[0], "Name": POSITION_ATTRIBUTE}
    return new.node("GeometryNodeRemoveAttribute", values).outputs[0]


def _placed(new, geometry, positions):
    """Adds a node that sets all positions of a geometry."""
    if bpy.app.version < (4, 0, 0):
        return new.node("GeometryNodeSetPosition", {"Geometry": geometry, "Position": positions})
    return _stored(new, "position", geometry, positions)  # the same result as Set Position, but faster


def _stored(new, name, geometry, positions):
    """Adds a node that stores vectors in an attribute of the vertices."""
    values = {"Geometry": geometry, "Name": name, "Value": positions}
    return new.node("GeometryNodeStoreNamedAttribute", values, data_type="FLOAT_VECTOR", domain="POINT")


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
