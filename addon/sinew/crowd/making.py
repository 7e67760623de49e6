"""Makes a crowd: the phases in their own collection, and an object whose modifier lets instances of them walk along a
curve. A crowd plays without Sinew. It keeps what it was made from."""

import math
from dataclasses import asdict, dataclass
from typing import Any

import bpy
import numpy as np

from ..bake import evaluation
from ..blender import graph
from ..plan import bindable
from ..rig_files.file_options import ImportOptions
from . import phases, walkers

PROPERTY = "sinew_crowd"  # custom property of the crowd's object: its Source
AHEAD, ASIDE = 1.6, 1.2  # distance between agents in a lane, and between lanes, as multiples of the character's size
LENGTH_OF_BLOCK = 6.0  # length of a crowd whose lanes were not chosen, as a multiple of its width


@dataclass
class Source:
    """The source of a crowd's shapes. character: the name of an object; or filepath: of a rig folder's skeleton, and
    pose: the name of its pose file, or "". count: number of shapes; 0: one per frame. first, last: frames; None: those
    of the clip."""

    character: str = ""
    filepath: str = ""
    pose: str = ""
    count: int = 0
    first: float | None = None
    last: float | None = None

    def keep(self, ob: bpy.types.Object) -> None:
        """Saves the source with the crowd's object."""
        ob[PROPERTY] = {name: value for name, value in asdict(self).items() if value is not None}

    def phases(self, context: bpy.types.Context, shown: Any) -> phases.Phases:
        """Returns phases.Phases. The scene does not change. Raises ValueError or OSError."""
        if self.filepath:
            path = bpy.path.abspath(self.filepath)
            return phases.of_rig(path, ImportOptions(pose=self.pose), self.count)
        ob = context.view_layer.objects.get(self.character)
        if ob is None:
            raise ValueError(f"there is no object {self.character} in the view layer {context.view_layer.name}")
        objects = meshes_of_character(context, ob)
        first, last = clip_range(context.scene, ob)
        first, last = (first if self.first is None else self.first), (last if self.last is None else self.last)
        if last < first:
            raise ValueError(f"the last frame ({last:g}) comes before the first ({first:g})")
        with evaluation.undisturbed(context):
            return phases.of_objects(context, objects, ob.name, first, last, self.count, shown)


def kept(ob: bpy.types.Object) -> Source | None:
    """Returns the Source of a crowd's object, or None."""
    found = ob.get(PROPERTY)
    return Source(**found.to_dict()) if found is not None else None


def meshes_of_character(context: bpy.types.Context, ob: bpy.types.Object) -> list[bpy.types.Object]:
    """Returns the visible meshes of the character that a mesh or an armature belongs to: those that the armature
    deforms, or that are parented to it. Raises ValueError."""
    armature = ob if ob.type == "ARMATURE" else bindable.find_armature(ob)
    found = [ob] if armature is None else [*bindable.meshes_of(context, armature), *armature.children_recursive]
    found = [each for each in dict.fromkeys(found) if each.type == "MESH" and each.visible_get()]
    if not found:
        raise ValueError(f"{ob.name} has no visible mesh: show the character first, or select another one")
    return found


def clip_range(scene: bpy.types.Scene, ob: bpy.types.Object) -> tuple[float, float]:
    """Returns first, last: the frames of the character's action, or else the scene's."""
    for each in ob if ob.type == "ARMATURE" else bindable.find_armature(ob), ob:
        data = each.animation_data if each is not None else None
        if data is not None and data.action is not None:
            return tuple(data.action.frame_range)
    return float(scene.frame_start), float(scene.frame_end)


def build(
    context: bpy.types.Context,
    phases: Any,
    agents: int,
    path: bpy.types.Object | None = None,
    lanes: int = 0,
    seed: int = 0,
) -> bpy.types.Object:
    """Makes a crowd and returns its object. phases: phases.Phases, which now belong to the crowd. path: a curve object;
    None: a circle is made. lanes: 0: as many as the agents need."""
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


def modifier_of(ob: bpy.types.Object) -> bpy.types.Modifier | None:
    """Returns the modifier that makes an object a crowd, or None."""
    return next(
        (
            modifier
            for modifier in ob.modifiers
            if modifier.type == "NODES" and modifier.node_group and walkers.VERSION_PROPERTY in modifier.node_group
        ),
        None,
    )


def renew(scene: bpy.types.Scene, ob: bpy.types.Object, phases: Any) -> None:
    """Replaces the shapes of a crowd, which keeps everything else. The old shapes are removed."""
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
    """Returns the modifier's inputs that describe the clip, and the extent along and across its heading."""
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
    """Returns the extent of a box (2, 3) along the heading and across it."""
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
    """Returns a collection of the phases that is in no scene, since it only serves for instances. The names define the
    order. If the character has several meshes, each phase has its own collection."""
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
