"""Small rigs with settings or numbers at the edge of what they may be: the end of a range, a size of 0, an angle of 0,
points that coincide. Each function of EDGES makes one, in a file of its own."""

from random import Random

import bpy
from mathutils import Vector

from helpers import addon_module, select

TIMES = (1, 2, 4.5, 8, 8.25, 12)
INHERIT = ("FULL", "FIX_SHEAR", "ALIGNED", "AVERAGE", "NONE", "NONE_LEGACY")


def made(edge):
    """Returns the armature of an edge, in an empty file."""
    bpy.ops.wm.read_homefile(use_empty=True)
    ob = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    bpy.context.collection.objects.link(ob)
    edge(ob)
    select()
    bpy.context.view_layer.update()
    return ob


def add_bones(ob, *bones):
    """bones: (name, parent or None, head, tail, roll)."""
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    for name, parent, head, tail, roll in bones:
        bone = ob.data.edit_bones.new(name)
        bone.head, bone.tail, bone.roll = head, tail, roll
        if parent is not None:
            bone.parent = ob.data.edit_bones[parent]
            bone.use_connect = bone.head == bone.parent.tail
    bpy.ops.object.mode_set(mode="OBJECT")
    for bone in ob.pose.bones:
        bone.rotation_mode = "XYZ"


def turn(ob, name, random=None, size=0.8):
    """Keyframes that turn a bone."""
    random = random or Random(name)
    for frame in (1, 8, 12):
        ob.pose.bones[name].rotation_euler = [random.uniform(-size, size) for _ in range(3)]
        ob.pose.bones[name].keyframe_insert("rotation_euler", frame=frame)


def constrain(ob, bone, kind, target=None, **settings):
    constraint = ob.pose.bones[bone].constraints.new(kind)
    if target is not None:
        constraint.target, constraint.subtarget = ob, target
    for name, value in settings.items():
        setattr(constraint, name, value)
    return constraint


def bent(ob, mapping="STRAIGHT"):
    """A B-bone with a shape at rest and rolled bones at its ends; others follow it from many places around."""
    random = Random(3)
    riders = [
        (f"rider{n}", None, (x := random.uniform(-0.4, 0.4), 0.3, 0.5 + 0.2 * n), (x, 0.6, 0.5 + 0.2 * n), 0)
        for n in range(9)
    ]
    add_bones(
        ob,
        ("before", None, (0, 0, 0), (0, 0.3, 0.8), 0.7),
        ("bent", "before", (0, 0.3, 0.8), (0.1, 0, 2.1), -0.4),
        ("after", "bent", (0.1, 0, 2.1), (0.6, 0.2, 2.9), 1.9),
        *riders,
    )
    bone = ob.data.bones["bent"]
    bone.bbone_segments = 12
    bone.bbone_rollin, bone.bbone_rollout = -0.3, 0.9
    bone.bbone_curveinx, bone.bbone_curveinz, bone.bbone_curveoutx, bone.bbone_curveoutz = 0.5, -0.3, 0.4, 0.6
    bone.bbone_easein, bone.bbone_easeout = 0.6, 1.4
    bone.bbone_scalein, bone.bbone_scaleout = (0.9, 1.3, 1.1), (1.2, 0.5, 0.8)
    if bpy.app.version >= (4, 0, 0):
        bone.bbone_mapping_mode = mapping
    bone.use_endroll_as_inroll, ob.data.bones["before"].bbone_rollout = True, 0.35
    turn(ob, "after")
    for name, *_ in riders:
        each = constrain(ob, name, "ARMATURE").targets.new()
        each.target, each.subtarget = ob, "bent"


def bent_and_mapped_along_its_curve(ob):
    bent(ob, "CURVED")


def ends_without_length(ob):
    """B-bones whose pieces at one end have next to no length, or none."""
    sizes = (0, 1e-5, 1e-4, 1e-3)
    add_bones(ob, *((f"bent{n}", None, (n, 0, 0), (n, 0.2, 1.5), 0.1 * n) for n in range(2 * len(sizes))))
    for n, size in enumerate(sizes):
        for end, name in enumerate(("bbone_scalein", "bbone_scaleout")):
            bone = ob.data.bones[f"bent{2 * n + end}"]
            bone.bbone_segments, bone.bbone_curveoutx = 4, 0.3
            setattr(bone, name, (1, size, 1))


def ends_of_ranges(ob):
    """Modifiers of curves that act between frames that are looked at, and blend in or out until those."""
    add_bones(ob, *((f"b{n}", None, (n, 0, 0), (n, 0, 1), 0) for n in range(4)))
    for n, blends in enumerate(((0, 0), (2.5, 0), (0, 3.75), (2.5, 3.75))):
        bone = ob.pose.bones[f"b{n}"]
        for frame, value in ((0, 0.1), (12, 0.9)):
            bone.location = (value, value, value)
            bone.keyframe_insert("location", frame=frame)
        curves = addon_module("blender.animation").keyed_curves(ob)
        for curve in [each for each in curves if each.data_path.startswith(f'pose.bones["b{n}"]')]:
            modifier = curve.modifiers.new("GENERATOR")
            modifier.coefficients, modifier.use_restricted_range = (0.3, 0.07), True
            modifier.frame_start, modifier.frame_end = 2, 8.25
            modifier.blend_in, modifier.blend_out = blends
            modifier.use_influence, modifier.influence = True, 0.9


def below_a_parent_of_scale_0(ob):
    """Children of each kind, which go to their own space and back."""
    kinds = [(mode, turns) for mode in INHERIT for turns in (True, False)]
    children = [(f"{mode} {turns}", "parent", (0.2, 0.3, 1.2), (0.2, 0.8, 1.4), 0.4) for mode, turns in kinds]
    add_bones(ob, ("parent", None, (0, 0, 0), (0, 0.2, 1), 0.3), *children)
    add_bones(ob, ("tracking", "parent", (0.1, 0, 1.1), (0.1, 0.5, 1.3), 0), ("goal", None, (1, 1, 0), (1, 1, 1), 0))
    constrain(ob, "tracking", "LOCKED_TRACK", "goal", track_axis="TRACK_X", lock_axis="LOCK_Z")
    ob.pose.bones["parent"].scale = (2, 1, 0)
    turn(ob, "parent")
    for (mode, turns), (name, *_) in zip(kinds, children):
        bone = ob.data.bones[name]
        bone.inherit_scale, bone.use_inherit_rotation = mode, turns
        ob.pose.bones[name].location = (0.1, 0.2, 0.3)
        constrain(ob, name, "LIMIT_LOCATION", owner_space="LOCAL", use_max_x=True, max_x=0.05)


def a_pole_and_two_places_to_reach(ob):
    add_bones(
        ob,
        ("a", None, (0, 0, 0), (0, 0.1, 1), 0),
        ("b", "a", (0, 0.1, 1), (0, 0, 2), 0),
        ("c", "b", (0, 0, 2), (0, 0.1, 3), 0),
        ("goal", None, (0.8, 0.5, 1.8), (0.8, 0.5, 2), 0),
        ("other", None, (0.3, 0.2, 1.2), (0.3, 0.2, 1.5), 0),
        ("pole", None, (2, 1, 0), (2, 1, 1), 0),
    )
    for name in ("goal", "other"):
        ob.pose.bones[name].keyframe_insert("location", frame=1)
        ob.pose.bones[name].location = (0.1, -0.3, 0.2)
        ob.pose.bones[name].keyframe_insert("location", frame=12)
    constrain(ob, "c", "IK", "goal", chain_count=3, pole_target=ob, pole_subtarget="pole", pole_angle=0.5)
    constrain(ob, "b", "IK", "other", chain_count=2)


def points_that_coincide(ob):
    """A chain along a spline with doubled and nearly doubled points, of which each has a radius of its own."""
    add_bones(ob, *((f"b{n}", f"b{n - 1}" if n else None, (0, 0, n), (0, 0, n + 1), 0) for n in range(5)))
    curve = bpy.data.objects.new("Rail", bpy.data.curves.new("Rail", "CURVE"))
    bpy.context.collection.objects.link(curve)
    curve.data.dimensions = "3D"
    spline = curve.data.splines.new("POLY")
    spline.resolution_u = 4
    places = (0, 1, 1, 2, 2, 2, 3, 3 + 2e-6, 4, 4 + 4e-6, 6)
    spline.points.add(len(places) - 1)
    for number, (point, x) in enumerate(zip(spline.points, places)):
        point.co, point.radius = (x, 0.1 * x, 0, 1), 1 + 0.3 * (number % 4)
    constraint = ob.pose.bones["b4"].constraints.new("SPLINE_IK")
    constraint.target, constraint.chain_count, constraint.use_curve_radius = curve, 5, True
    turn(ob, "b0")


def pivots_at_an_angle_of_0(ob):
    """Pivots that act in each range of an angle, of bones with angles of 0 about all axes but one, and of none."""
    ranges = ("ALWAYS_ACTIVE", "NX", "NY", "NZ", "X", "Y", "Z")
    add_bones(
        ob,
        ("target", None, (0.3, -0.2, 0.4), (0.3, -0.2, 1), 0),
        ("far", None, (1e8, 3e7, 0), (1e8, 3e7, 1e3), 0),
        *((f"{way}{n}", None, (n, 1, 0.5), (n, 1, 1.5), 0) for n, way in enumerate(ranges)),
        *((f"{name} still", None, (n, 1, 0.7), (n, 2, 0.7), 0) for n, name in enumerate(("near", "far"))),
    )
    for n, way in enumerate(ranges):
        ob.pose.bones[f"{way}{n}"].rotation_euler = Vector((0.7, 0, 0)) if n % 2 else Vector((0, 0, -0.4))
        constrain(ob, f"{way}{n}", "PIVOT", "target", rotation_range=way)
    constrain(ob, "near still", "PIVOT", "target", rotation_range="ALWAYS_ACTIVE")
    constrain(ob, "far still", "PIVOT", "far", rotation_range="ALWAYS_ACTIVE")


def distances_at_their_limit(ob):
    """As far as they may be, hardly farther or nearer, and nowhere."""
    beside = (0, 3e-8, 6e-8, 9e-8, 1.2e-7, 3e-7, -3e-8, -9e-8, -3e-7)
    cases = [(mode, n) for mode in ("INSIDE", "OUTSIDE", "ONSURFACE") for n in range(len(beside))]
    bones = [(f"{mode}{n}", None, (0, 0, 0.5 + beside[n]), (0, 0.4, 0.9), 0) for mode, n in cases]
    nowhere = [(f"{mode} nowhere", None, (0, 0, 0), (0.3, 0, 0.2), 0) for mode in ("INSIDE", "OUTSIDE", "ONSURFACE")]
    add_bones(ob, ("target", None, (0, 0, 0), (0, 0, 1), 0), *bones, *nowhere)
    for name, *_ in (*bones, *nowhere):
        mode = name.rstrip("0123456789").removesuffix(" nowhere")
        constrain(ob, name, "LIMIT_DISTANCE", "target", distance=0.5, limit_mode=f"LIMITDIST_{mode}")


def names_with_control_characters(ob):
    """A driver reads a bone of such a name."""
    name = 'n\nt\tq"s\\r\r'
    add_bones(ob, (name, None, (0, 0, 0), (0, 0, 1), 0), ("b", None, (1, 0, 0), (1, 0, 1), 0))
    turn(ob, name)
    driver = ob.pose.bones["b"].driver_add("location", 0).driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.targets[0].id = ob
    path = f'pose.bones["{bpy.utils.escape_identifier(ob.pose.bones[0].name)}"].rotation_euler[1]'
    variable.targets[0].data_path = path


EDGES = (
    bent,
    bent_and_mapped_along_its_curve,
    ends_without_length,
    ends_of_ranges,
    below_a_parent_of_scale_0,
    a_pole_and_two_places_to_reach,
    points_that_coincide,
    pivots_at_an_angle_of_0,
    distances_at_their_limit,
    names_with_control_characters,
)
