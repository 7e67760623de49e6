"""Makes a crowd: the phases in a collection of their own, and an object whose modifier lets instances of them walk
along a curve. Nothing of it needs Sinew to play."""

import math

import bpy
import numpy as np

from ..blender import graph
from . import walkers

AHEAD, ASIDE = 1.6, 1.2  # from one agent to the next, and from lane to lane, in sizes of the character
LENGTH_OF_BLOCK = 6.0  # of its width: how long a crowd is in which nobody chose lanes


def build(context, phases, agents, path=None, lanes=0, seed=0):
    """phases: phases.Phases, which now belong to the crowd. path: a curve object; None: a circle is made. lanes: 0: so
    many that the agents have room. Returns the crowd's object."""
    inputs, along, across = _clip_inputs(context.scene, phases)
    length, width = AHEAD * along, ASIDE * across
    needed = agents * length
    if path is None:
        lanes = lanes or max(1, round(math.sqrt(needed / (LENGTH_OF_BLOCK * width))))
        path = _circle(context, phases.name, max(needed / lanes / math.tau, lanes * width))
    else:
        lanes = lanes or max(1, math.ceil(needed / (_length_of(path) or needed)))
    ob = bpy.data.objects.new(f"{phases.name} Crowd", bpy.data.meshes.new(f"{phases.name} Crowd"))
    context.collection.objects.link(ob)
    modifier = ob.modifiers.new(walkers.NAME, "NODES")
    modifier.node_group = graph.find_group(walkers.VERSION_PROPERTY, walkers.VERSION) or walkers.make()
    graph.set_inputs(
        modifier, inputs | {"Path": path, "Agents": agents, "Lanes": lanes, "Lane Distance": width, "Seed": seed}
    )
    return ob


def modifier_of(ob):
    """The modifier that makes an object a crowd, or None."""
    return next(
        (
            modifier
            for modifier in ob.modifiers
            if modifier.type == "NODES" and modifier.node_group and walkers.VERSION_PROPERTY in modifier.node_group
        ),
        None,
    )


def renew(scene, ob, phases):
    """Other shapes for a crowd, which keeps all else. Those that it had are removed."""
    modifier = modifier_of(ob)
    old = graph.get_input(modifier, "Phases")
    inputs, _, _ = _clip_inputs(scene, phases)
    graph.set_inputs(modifier, inputs)
    if old is not None and old.library is None and old.users == 0:
        objects = list(old.all_objects)
        meshes = [each.data for each in objects]
        bpy.data.batch_remove([*objects, *old.children, old])
        bpy.data.batch_remove([mesh for mesh in meshes if mesh.users == 0])


def _clip_inputs(scene, phases):
    """What the modifier knows of the clip; the extent along and across its heading."""
    stride, corners = phases.settle(phases.frames * scene.render.fps_base / scene.render.fps)
    heading = math.atan2(stride[1], stride[0]) if stride.any() else -math.pi / 2  # Blender's front view looks along Y
    inputs = {
        "Phases": _collection(phases),
        "First Frame": float(phases.first),
        "Frames a Cycle": float(phases.frames),
        "Phase Count": phases.count,
        "Stride": float(np.linalg.norm(stride)),
        "Heading": heading,
    }
    return inputs, *_extent(corners, heading)


def _extent(corners, heading):
    """Along the heading and across it, of a box (2, 3)."""
    x, y, _ = corners[1] - corners[0]
    along, across = abs(math.cos(heading)), abs(math.sin(heading))
    return max(along * x + across * y, 1e-3), max(across * x + along * y, 1e-3)


def _circle(context, name, radius):
    curve = bpy.data.curves.new(f"{name} Path", "CURVE")
    curve.dimensions = "3D"
    spline = curve.splines.new("BEZIER")
    spline.bezier_points.add(3)
    handle = radius * 4 / 3 * (math.sqrt(2) - 1)
    for number, point in enumerate(spline.bezier_points):
        x, y = ((1, 0), (0, 1), (-1, 0), (0, -1))[number]
        point.co = (radius * x, radius * y, 0)
        point.handle_left_type = point.handle_right_type = "ALIGNED"
        point.handle_left = (radius * x + handle * y, radius * y - handle * x, 0)
        point.handle_right = (radius * x - handle * y, radius * y + handle * x, 0)
    spline.use_cyclic_u = True
    path = bpy.data.objects.new(curve.name, curve)
    path.location = context.scene.cursor.location
    context.collection.objects.link(path)
    return path


def _length_of(path):
    scale = sum(map(abs, path.matrix_world.to_scale())) / 3
    return scale * sum(spline.calc_length() for spline in path.data.splines)


def _collection(phases):
    """Of the phases, in no scene: they are there to be instanced. Names decide their order. A character of several
    meshes has a collection a phase."""
    whole = bpy.data.collections.new(f"{phases.name} Phases")
    for number, shapes in enumerate(zip(*phases.shapes)):
        name = f"{phases.name}.{number:04}"
        holder = whole
        if len(shapes) > 1:
            holder = bpy.data.collections.new(name)
            whole.children.link(holder)
        for mesh in shapes:
            holder.objects.link(bpy.data.objects.new(name, mesh))
    return whole
