"""Builds Geometry Nodes groups from formulas, and hides what differs between Blender 3.4 and 5.2."""

from collections.abc import Iterable
from typing import Any

import bpy

WIDTH, HEIGHT = 190, 220  # the distance between nodes in the editor


class Graph:
    """A node group under construction. A value is a number, a string or the socket of a node."""

    def __init__(self, name: str, inputs: Iterable[tuple[str, str, Any, Any, str]], output: str) -> None:
        """Makes a new group. inputs: tuples (name, socket type without "NodeSocket", default or None, minimum or None,
        description); output: the name of the group's only output, a geometry."""
        self.tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
        for each in inputs:
            _set_up(new_socket(self.tree, each[0], "INPUT", f"NodeSocket{each[1]}"), *each[2:])
        new_socket(self.tree, output, "OUTPUT", "NodeSocketGeometry")
        self._source = self.tree.nodes.new("NodeGroupInput")

    def input(self, name: str) -> bpy.types.NodeSocket:
        """Returns the value of one of the group's inputs."""
        return self._source.outputs[name]

    def node(self, kind: str, values: dict[Any, Any] | None = None, **options: Any) -> bpy.types.Node:
        """Adds a node. values: {name or index of an input: value}; options: the node's settings, by property name.
        Those that are menu inputs in later versions of Blender are set there."""
        node = self.tree.nodes.new(kind)
        for name, option in options.items():
            if hasattr(node, name):
                setattr(node, name, option)
            else:  # 5.0 and later
                _input(node, name.replace("_", " ").title()).default_value = option.replace("_", " ").title()
        for name, value in (values or {}).items():
            self.put(value, _input(node, name))
        return node

    def put(self, value: Any, socket: bpy.types.NodeSocket) -> None:
        """Sets an input socket to a value: links it to a socket, or sets its default."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation: str, *values: Any) -> bpy.types.NodeSocket:
        """Adds a Math node and returns its output."""
        node = self.node("ShaderNodeMath", dict(enumerate(values)), operation=operation)
        return node.outputs[0]

    def vector(self, operation: str, *values: Any) -> bpy.types.NodeSocket:
        """Adds a Vector Math node and returns its output."""
        node = self.node("ShaderNodeVectorMath", operation=operation)
        used = [socket for socket in node.inputs if socket.enabled]
        for value, socket in zip(values, used):
            self.put(value, socket)
        return enabled(node.outputs)

    def random(self, least: Any, most: Any, identity: Any, seed: Any) -> bpy.types.NodeSocket:
        """Returns a random number from least to most, the same for the same identity and seed."""
        node = self.node("FunctionNodeRandomValue", data_type="FLOAT")
        values = {"Min": least, "Max": most, "ID": identity, "Seed": seed}
        for socket in node.inputs:
            if socket.enabled and socket.name in values:
                self.put(values[socket.name], socket)
        return enabled(node.outputs)

    def close(self, value: Any) -> bpy.types.NodeTree:
        """Sets the group's output and arranges the nodes. Returns the group."""
        target = self.tree.nodes.new("NodeGroupOutput")
        self.put(value, target.inputs[0])
        self._arrange()
        return self.tree

    def _arrange(self):
        """Moves each node to the column after the nodes whose values it uses."""
        column = dict.fromkeys(self.tree.nodes, 0)
        for node in self.tree.nodes:  # they were made in this order, sources first
            sources = [link.from_node for socket in node.inputs for link in socket.links]
            column[node] = max((column[source] + 1 for source in sources), default=0)
        rows = dict.fromkeys(column.values(), 0)
        for node, number in column.items():
            node.location = (number * WIDTH, -rows[number] * HEIGHT)
            rows[number] += 1


def enabled(sockets: Iterable[bpy.types.NodeSocket], name: str | None = None) -> bpy.types.NodeSocket:
    """Returns the first enabled socket, of that name if one is given."""
    return next(socket for socket in sockets if socket.enabled and name in (None, socket.name))


def _input(node, name):
    return node.inputs[name] if isinstance(name, int) else enabled(node.inputs, name)


def find_group(name: str, version: int) -> bpy.types.NodeTree | None:
    """Returns a local node group whose custom property of that name equals the version, or None."""
    return next((each for each in bpy.data.node_groups if each.library is None and each.get(name) == version), None)


def new_socket(tree: bpy.types.NodeTree, name: str, direction: str, kind: str) -> Any:
    """Adds a socket to the interface of a group. direction: "INPUT" or "OUTPUT"."""
    if hasattr(tree, "interface"):
        return tree.interface.new_socket(name, in_out=direction, socket_type=kind)
    return (tree.inputs if direction == "INPUT" else tree.outputs).new(kind, name)  # before 4.0


def _set_up(socket, default, least, description):
    if default is not None:
        socket.default_value = default
    if least is not None:
        socket.min_value = least
    socket.description = description


def set_inputs(modifier: bpy.types.Modifier, values: dict[str, Any]) -> None:
    """Sets inputs of a Geometry Nodes modifier. values: {name of an input of its group: value}."""
    for name, value in values.items():
        holder, key = _place_of(modifier, name)
        if holder == modifier:
            modifier[key] = value
        else:
            setattr(holder, key, value)
    modifier.id_data.update_tag()


def get_input(modifier: bpy.types.Modifier, name: str) -> Any:
    """Returns the value of an input of a Geometry Nodes modifier."""
    holder, key = _place_of(modifier, name)
    return modifier[key] if holder == modifier else getattr(holder, key)


def as_property(modifier: bpy.types.Modifier, name: str) -> tuple[Any, str]:
    """Returns the arguments of layout.prop() for an input: its owner, and the name of the property."""
    holder, key = _place_of(modifier, name)
    return (holder, f'["{key}"]') if holder == modifier else (holder, key)


def _place_of(modifier, name):
    """Returns the owner of an input's value and its name there: a custom property of the modifier, or in 5.2 and later
    an attribute of a struct of the modifier."""
    tree = modifier.node_group
    items = tree.interface.items_tree if hasattr(tree, "interface") else tree.inputs
    key = next(item.identifier for item in items if item.name == name and getattr(item, "in_out", "INPUT") == "INPUT")
    if hasattr(modifier, "properties"):
        return getattr(modifier.properties.inputs, key), "value"
    return modifier, key
