"""Where deformed positions go: through a Geometry Nodes modifier, or into the mesh itself.

An output class puts itself into the .blend and takes itself out again, leaving the mesh as it was before;
an instance of it knows one bound object as it stands, until somebody edits it. A shape goes to it by
`write(object, positions)`, or into the array that `target(object)` gives, if it gives one, and then
`written(object, positions)`.
"""

import bpy
import numpy as np

from . import blender_io

MODIFIER_NAME = "Sinew"
NODE_GROUP_NAMES = {False: "Sinew", True: "Sinew After Shape Keys or Modifiers"}
NODE_GROUP_VERSION = 2
VERSION_PROPERTY = "sinew_version"
CAPTURE_PROPERTY = "sinew_captures"
SLOT_PROPERTY = "sinew_slot"
POSITION_ATTRIBUTE = ".sinew_position"  # the dot hides it from the lists of the interface
INPUT_ATTRIBUTE = ".sinew_input"
# Modifiers that move vertices or change other things, and those that add new ones behind those there were.
KEEPS_VERTICES = {
    "ARMATURE", "CAST", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE", "MESH_DEFORM",
    "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "CORRECTIVE_SMOOTH", "LAPLACIANSMOOTH", "SURFACE_DEFORM",
    "WARP", "WAVE", "CLOTH", "SOFT_BODY", "COLLISION", "WEIGHTED_NORMAL", "NORMAL_EDIT", "UV_PROJECT",
    "UV_WARP", "VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY", "DATA_TRANSFER",
    "PARTICLE_SYSTEM"}
ADDS_VERTICES = {"SUBSURF", "SOLIDIFY", "MIRROR", "ARRAY", "MULTIRES"}
REST_ATTRIBUTE = "rest_position"


class OutputError(Exception):
    """The output cannot be installed; the message says why."""


class ModifierOutput:
    """Positions in an attribute, put in place by a modifier: the mesh itself is never touched. Objects
    that share a mesh have an attribute each, told apart by a number, the slot."""

    def __init__(self, ob):
        group = sinew_modifier(ob).node_group
        self.captures = bool(group.get(CAPTURE_PROPERTY))  # the modifier hands over its input
        self._attribute = attribute_name(group.get(SLOT_PROPERTY, 0))

    @staticmethod
    def install(ob, index=0):
        """index: the modifier's place in the stack."""
        modifier = ob.modifiers.new(MODIFIER_NAME, "NODES")
        modifier.node_group = node_group(False, free_slot(ob))
        modifier.show_expanded = False
        try:
            move_modifier(ob, modifier, index)
            ModifierOutput.adapt(ob)
        except Exception:
            ModifierOutput.remove(ob)
            raise

    @staticmethod
    def adapt(ob):
        """Sees to it that the modifier hands over its input if that is not the mesh's own shape (shape
        keys, or other modifiers before it) and that its slot is its own. Returns whether something had
        to be changed; the input is then there after the next evaluation."""
        modifier = sinew_modifier(ob)
        check_numbers_kept(ob, ob.modifiers.find(modifier.name))
        group = modifier.node_group
        slot = group.get(SLOT_PROPERTY, 0)
        if ob.data.users > 1 and slot in slots_of_others(ob):
            slot = free_slot(ob)
        if not blender_io.point_attribute(ob.data, attribute_name(slot)):
            blender_io.write_attribute(
                ob.data, attribute_name(slot), blender_io.read_positions(ob.data))
        captures = (ob.data.shape_keys is not None
                    or bool(blender_io.modifiers_before(ob, modifier)))
        if is_group(group, captures, slot) or ob.library is not None:
            return False
        modifier.node_group = node_group(captures, slot)
        forget_unused_node_groups()
        return True

    @staticmethod
    def remove(ob):
        for modifier in [m for m in ob.modifiers if is_sinew(m)]:
            ob.modifiers.remove(modifier)
        used = {attribute_name(slot) for slot in slots_of_others(ob)}
        for name in ob.data.attributes.keys():
            if name.startswith(POSITION_ATTRIBUTE) and name not in used:
                blender_io.remove_attribute(ob.data, name)
        forget_unused_node_groups()

    @staticmethod
    def was_applied(ob):
        """Whether the modifier is gone and has left its shape behind: it was applied, perhaps with all others
        when the object was converted."""
        if find_sinew_modifier(ob):
            return False
        if ob.sinew.replaced and not any(entry.name in ob.modifiers for entry in ob.sinew.replaced):
            return True
        own = blender_io.read_positions(ob.data)
        return any(np.array_equal(own, blender_io.read_attribute(attribute)) for attribute in ob.data.attributes
                   if attribute.name.startswith(POSITION_ATTRIBUTE) and attribute.domain == "POINT")

    def rest_positions(self, ob, evaluated=None):
        """The modifier's input as Blender has evaluated it, (V, 3)."""
        if evaluated is None or not self.captures:
            return blender_io.read_positions(ob.data)
        attribute = blender_io.point_attribute(evaluated.data, INPUT_ATTRIBUTE)
        if attribute is None:  # switched off, or not yet evaluated
            return blender_io.read_positions(ob.data)
        captured = blender_io.read_attribute(attribute)
        count = len(ob.data.vertices)
        if len(captured) != count:
            check_numbers_kept(ob, ob.modifiers.find(sinew_modifier(ob).name))
        return captured[:count]

    def target(self, ob):
        attribute = blender_io.point_attribute(ob.data, self._attribute)
        return attribute and blender_io.memory_of(attribute, len(ob.data.vertices))

    def written(self, ob, _positions):
        ob.data.update_tag()

    def write(self, ob, positions):
        blender_io.write_attribute(ob.data, self._attribute, positions)


class MeshOutput:
    """Positions straight in the mesh's vertices, with the rest kept in an attribute."""

    captures = False

    def __init__(self, _ob):
        pass

    @staticmethod
    def was_applied(_ob):
        return False

    @staticmethod
    def install(ob, index=0):
        if ob.data.attributes.get(REST_ATTRIBUTE):
            raise OutputError(
                f'{ob.data.name} already has an attribute "{REST_ATTRIBUTE}", which the output '
                "Mesh needs; rename or remove it, or use the output Modifier")
        if ob.data.library:
            raise OutputError(
                f"The mesh {ob.data.name} is linked from another file, so the output Mesh cannot write "
                "it; use the output Modifier")
        if ob.data.users > 1:
            raise OutputError(
                f"The mesh {ob.data.name} has {ob.data.users} users, which the output Mesh would all "
                "deform; make it single-user first, or use the output Modifier")
        if ob.data.shape_keys:
            raise OutputError(
                f"{ob.name} has shape keys, which the output Mesh cannot follow; use the output "
                "Modifier")
        blender_io.write_attribute(ob.data, REST_ATTRIBUTE, blender_io.read_positions(ob.data))

    @staticmethod
    def adapt(_ob):
        return False

    @staticmethod
    def remove(ob):
        if blender_io.point_attribute(ob.data, REST_ATTRIBUTE):  # else somebody removed it: the shape stays
            blender_io.write_positions(ob.data, MeshOutput(ob).rest_positions(ob))
        blender_io.remove_attribute(ob.data, REST_ATTRIBUTE)

    def rest_positions(self, ob, _evaluated=None):
        attribute = blender_io.point_attribute(ob.data, REST_ATTRIBUTE)
        if attribute is None:
            raise OutputError(
                f'{ob.data.name} has lost its attribute "{REST_ATTRIBUTE}" with the rest '
                "positions; unbind it, which leaves the shape as it is")
        return blender_io.read_attribute(attribute)

    def target(self, ob):
        attribute = ob.data.attributes.get("position")
        return attribute and blender_io.memory_of(attribute, len(ob.data.vertices))

    def written(self, ob, positions):
        blender_io.positions_written(ob.data, positions)

    def write(self, ob, positions):
        blender_io.write_positions(ob.data, positions)


OUTPUTS = {"MODIFIER": ModifierOutput, "MESH": MeshOutput}


def check_numbers_kept(ob, index):
    """Raises OutputError if, for a Sinew modifier in place `index` of the stack that has to follow what comes
    in, a modifier before it has other vertices than the mesh, or one after it gives them other numbers (Sinew's
    own group, and those that are switched off, aside)."""
    shown = [modifier.show_viewport or modifier.show_render for modifier in ob.modifiers]
    before = [modifier for modifier, on in zip(list(ob.modifiers)[:index], shown) if on]
    for modifier in before:
        if modifier.type not in KEEPS_VERTICES:
            raise OutputError(
                f"{ob.name} has {modifier.name} before its armature's modifier, which Sinew cannot follow: it "
                "changes the number of vertices; move it after the armature's, or apply it")
    if not before and ob.data.shape_keys is None:
        return
    for modifier, on in zip(list(ob.modifiers)[index + 1:], shown[index + 1:]):
        if on and not is_sinew(modifier) and modifier.type not in KEEPS_VERTICES | ADDS_VERTICES:
            raise OutputError(
                f"{ob.name} has shape keys or modifiers before Sinew, which can then not be followed "
                f"through {modifier.name}: it gives vertices other numbers")


def find_sinew_modifier(ob):
    """Or None."""
    return next(filter(is_sinew, ob.modifiers), None)


def sinew_modifier(ob):
    modifier = find_sinew_modifier(ob)
    if modifier is not None:
        return modifier
    raise OutputError(f"{ob.name} has lost its Sinew modifier: bind it again, or unbind it")


def attribute_name(slot):
    return f"{POSITION_ATTRIBUTE}_{slot}" if slot else POSITION_ATTRIBUTE


def slots_of_others(ob):
    """The slots that other bound objects with the same mesh have."""
    return {modifier.node_group.get(SLOT_PROPERTY, 0)
            for other in (bpy.data.objects if ob.data.users > 1 else ())
            if other != ob and other.data == ob.data
            for modifier in other.modifiers if is_sinew(modifier)}


def free_slot(ob):
    taken = slots_of_others(ob)
    return next(slot for slot in range(len(taken) + 1) if slot not in taken)


def is_sinew(modifier):
    return (modifier.type == "NODES" and modifier.node_group is not None
            and VERSION_PROPERTY in modifier.node_group)


def move_modifier(ob, modifier, index):
    """Raises OutputError where Blender does not allow it and it would make a difference."""
    place = ob.modifiers.find(modifier.name)
    if place == index:
        return
    if hasattr(ob.modifiers, "move"):
        ob.modifiers.move(place, index)
        return
    with bpy.context.temp_override(object=ob, active_object=ob):  # before 3.5
        if bpy.ops.object.modifier_move_to_index.poll():
            bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=index)
            return
    others = [m.name for m in ob.modifiers[index:place]
              if m.type != "ARMATURE" and (m.show_viewport or m.show_render)]
    if others:
        raise OutputError(
            f"This version of Blender does not let modifiers of a library override be moved, and "
            f"{ob.name} needs Sinew's before {others[0]}; bind it in its own file")


def node_group(captures, slot):
    """The node group that Sinew's modifiers share, made when it is first needed. captures: keep the
    positions that come in, for the next evaluation's handler to read."""
    for group in bpy.data.node_groups:
        if group.library is None and is_group(group, captures, slot):
            return group
    name = NODE_GROUP_NAMES[captures] + (f" {slot + 1}" if slot else "")
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    group[VERSION_PROPERTY] = NODE_GROUP_VERSION
    group[CAPTURE_PROPERTY] = captures
    group[SLOT_PROPERTY] = slot
    if hasattr(group, "interface"):
        for direction in ("INPUT", "OUTPUT"):
            group.interface.new_socket(
                "Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    else:  # before 4.0
        group.inputs.new("NodeSocketGeometry", "Geometry")
        group.outputs.new("NodeSocketGeometry", "Geometry")
    nodes = [group.nodes.new("NodeGroupInput")]
    geometry = nodes[0].outputs[0]
    if captures:
        position = group.nodes.new("GeometryNodeInputPosition")
        store, value = store_node(group, INPUT_ATTRIBUTE)
        group.links.new(geometry, store.inputs["Geometry"])
        group.links.new(position.outputs[0], value)
        geometry = store.outputs[0]
        nodes += [position, store]
    attribute = group.nodes.new("GeometryNodeInputNamedAttribute")
    attribute.data_type = "FLOAT_VECTOR"
    attribute.inputs["Name"].default_value = attribute_name(slot)
    if bpy.app.version >= (4, 0, 0):
        # The same as Set Position, in less time.
        place, value = store_node(group, "position")
    else:
        place = group.nodes.new("GeometryNodeSetPosition")
        value = place.inputs["Position"]
    target = group.nodes.new("NodeGroupOutput")
    group.links.new(geometry, place.inputs["Geometry"])
    group.links.new(attribute.outputs["Attribute"], value)
    # A mesh that has lost the attribute keeps its own shape.
    if "Exists" in attribute.outputs:
        group.links.new(attribute.outputs["Exists"], place.inputs["Selection"])
    group.links.new(place.outputs[0], target.inputs[0])
    for column, node in enumerate([*nodes, attribute, place, target]):
        node.location = (200 * column, -120 if not node.inputs else 0)
    return group


def is_group(group, captures, slot):
    return (group.get(VERSION_PROPERTY) == NODE_GROUP_VERSION
            and bool(group.get(CAPTURE_PROPERTY)) == captures and group.get(SLOT_PROPERTY, 0) == slot)


def store_node(group, name):
    """A node that stores a vector a point in the attribute of that name, and its input for them."""
    node = group.nodes.new("GeometryNodeStoreNamedAttribute")
    node.data_type, node.domain = "FLOAT_VECTOR", "POINT"
    node.inputs["Name"].default_value = name
    return node, next(i for i in node.inputs if i.name == "Value" and i.type == "VECTOR")


def forget_unused_node_groups():
    for group in [g for g in bpy.data.node_groups
                  if VERSION_PROPERTY in g and g.users == 0 and g.library is None]:
        bpy.data.node_groups.remove(group)
