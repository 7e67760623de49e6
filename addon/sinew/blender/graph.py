"""Geometry Nodes by formulas. What differs between Blender 3.4 and 5.2 stands here."""

import bpy

WIDTH, HEIGHT = 190, 220  # of a node's place on the editor's canvas


class Graph:
    """The nodes of one group. A value is a number, a string or the socket of a node."""

    def __init__(self, name, inputs, output):
        """inputs: (name, socket type without NodeSocket, default or None, least or None, description) each; output: the
        name of the group's one output, a geometry."""
        self.tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
        for each in inputs:
            _set_up(new_socket(self.tree, each[0], "INPUT", f"NodeSocket{each[1]}"), *each[2:])
        new_socket(self.tree, output, "OUTPUT", "NodeSocketGeometry")
        self._source = self.tree.nodes.new("NodeGroupInput")

    def input(self, name):
        return self._source.outputs[name]

    def node(self, kind, values=None, **options):
        """values: {name or index of an input: value}; options: the node's settings, by the names of its properties, or
        of its menus where a later Blender has these as inputs."""
        node = self.tree.nodes.new(kind)
        for name, option in options.items():
            if hasattr(node, name):
                setattr(node, name, option)
            else:  # 5.0 and later
                _input(node, name.replace("_", " ").title()).default_value = option.replace("_", " ").title()
        for name, value in (values or {}).items():
            self.put(value, _input(node, name))
        return node

    def put(self, value, socket):
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation, *values):
        node = self.node("ShaderNodeMath", dict(enumerate(values)), operation=operation)
        return node.outputs[0]

    def vector(self, operation, *values):
        node = self.node("ShaderNodeVectorMath", operation=operation)
        used = [socket for socket in node.inputs if socket.enabled]
        for value, socket in zip(values, used):
            self.put(value, socket)
        return enabled(node.outputs)

    def random(self, least, most, identity, seed):
        """A number of that range, the same for the same identity and seed."""
        node = self.node("FunctionNodeRandomValue", data_type="FLOAT")
        values = {"Min": least, "Max": most, "ID": identity, "Seed": seed}
        for socket in node.inputs:
            if socket.enabled and socket.name in values:
                self.put(values[socket.name], socket)
        return enabled(node.outputs)

    def close(self, value):
        """The group's output. Returns the group."""
        target = self.tree.nodes.new("NodeGroupOutput")
        self.put(value, target.inputs[0])
        self._arrange()
        return self.tree

    def _arrange(self):
        """Each node in the column behind those that it takes values from."""
        column = dict.fromkeys(self.tree.nodes, 0)
        for node in self.tree.nodes:  # which were made in that order
            sources = [link.from_node for socket in node.inputs for link in socket.links]
            column[node] = max((column[source] + 1 for source in sources), default=0)
        rows = dict.fromkeys(column.values(), 0)
        for node, number in column.items():
            node.location = (number * WIDTH, -rows[number] * HEIGHT)
            rows[number] += 1


def enabled(sockets, name=None):
    """The first one in use of those of a node, of that name."""
    return next(socket for socket in sockets if socket.enabled and name in (None, socket.name))


def _input(node, name):
    return node.inputs[name] if isinstance(name, int) else enabled(node.inputs, name)


def find_group(name, version):
    """A node group of this file that has that version as a custom property of that name, or None."""
    return next((each for each in bpy.data.node_groups if each.library is None and each.get(name) == version), None)


def new_socket(tree, name, direction, kind):
    """Of the group itself. direction: "INPUT" or "OUTPUT"."""
    if hasattr(tree, "interface"):
        return tree.interface.new_socket(name, in_out=direction, socket_type=kind)
    return (tree.inputs if direction == "INPUT" else tree.outputs).new(kind, name)  # before 4.0


def _set_up(socket, default, least, description):
    if default is not None:
        socket.default_value = default
    if least is not None:
        socket.min_value = least
    socket.description = description


def set_inputs(modifier, values):
    """values: {name of an input of the modifier's group: value}."""
    for name, value in values.items():
        holder, key = _place_of(modifier, name)
        if holder == modifier:
            modifier[key] = value
        else:
            setattr(holder, key, value)
    modifier.id_data.update_tag()


def get_input(modifier, name):
    holder, key = _place_of(modifier, name)
    return modifier[key] if holder == modifier else getattr(holder, key)


def as_property(modifier, name):
    """What layout.prop() wants for that input: its holder, and the name of the property there."""
    holder, key = _place_of(modifier, name)
    return (holder, f'["{key}"]') if holder == modifier else (holder, key)


def _place_of(modifier, name):
    """What holds the value of an input, and under which name: the modifier, by a custom property, or in 5.2 and later a
    struct of it, by an attribute."""
    tree = modifier.node_group
    items = tree.interface.items_tree if hasattr(tree, "interface") else tree.inputs
    key = next(item.identifier for item in items if item.name == name and getattr(item, "in_out", "INPUT") == "INPUT")
    if hasattr(modifier, "properties"):
        return getattr(modifier.properties.inputs, key), "value"
    return modifier, key
