"""Whatever is edited of what the pose of a played character depends on, on a frame on which it makes no difference, all
frames look like those of a live twin with the same edit. Every property that can be written is flipped."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from characters import add_shape_keys, make_armature, make_tube
from helpers import addon_module, depsgraph, needs_memory, needs_rig_programs, select
from test_played import layer, recorded, states

pytestmark = needs_memory

FRAMES = (1, 5, 9)
STILL = 5  # all bones are at rest, and constraints have no influence
LEFT_OUT = {
    "rna_type",
    "is_active",
    "is_valid",  # what Blender has found out, and does not notice
    "active",
    "id_type",  # Blender clears the target
    "session_uid",
    "enabled",  # of a socket: Blender crashes
    "use_fake_user",
    "preview",
    "parent_type",  # Blender deletes the object's own animation in a background session
}


class Character:
    """An armature whose bones are at rest on one frame, and things that it may follow."""

    def __init__(self, scene):
        self.scene = scene
        self.rig = make_armature()
        self.bones = self.rig.pose.bones
        self.target = self.add(None, (0.7, 0.4, 1.3))
        self.spares = []  # what pointers are set to
        for number, bone in enumerate(self.bones):
            for frame, turn in zip(FRAMES, (0.3 + 0.1 * number, 0.0, -0.4)):
                bone.rotation_quaternion = (1, turn, 0.5 * turn, -turn)
                bone.location = (turn, 0, 0.2 * turn)
                for channel in ("location", "rotation_quaternion"):
                    bone.keyframe_insert(channel, frame=frame)

    def spare(self):
        """Data-blocks that pointers may be set to, the same for each character."""
        if not self.spares:
            mesh = bpy.data.meshes.new("Spare")
            mesh.from_pydata([(-2, -2, 0.5), (2, -2, 0), (0, 2, 0.2)], [], [(0, 1, 2)])
            collection = bpy.data.collections.new("Spare")
            collection.objects.link(self.add(None, (0.2, 0.9, 0.4)))
            data = self.rig.animation_data
            self.spares = [self.add(mesh, (-0.3, 0.6, 0.8)), mesh, collection, self.rig.data.copy()]
            self.spares += [data.action.copy()] if data.action else []
        return self.spares

    def add(self, data, location=(0, 0, 0)):
        ob = bpy.data.objects.new("Thing", data)
        self.scene.collection.objects.link(ob)
        ob.location = location
        return ob

    def constrain(self, kind, bone="bone3"):
        constraint = self.bones[bone].constraints.new(kind)
        if hasattr(constraint, "target"):
            constraint.target = self.target
        for frame, influence in zip(FRAMES, (0.8, 0.0, 0.6)):
            constraint.influence = influence
            constraint.keyframe_insert("influence", frame=frame)
        return constraint

    def shown(self):
        """All that is seen of the pose."""
        bones = self.rig.evaluated_get(depsgraph()).pose.bones
        return np.array([[*bone.matrix, *bone.matrix_channel] for bone in bones])


# --- what is flipped: each returns the structs of one character, or functions that return them ----


def pose_bones(character):
    return [character.bones["bone2"], character.bones["bone4"]]


def bones(character):
    return [character.rig.data.bones["bone2"], character.rig.data.bones["bone0"]]


def armature(character):
    return [character.rig, character.rig.data, character.rig.pose]


def targets(character):
    character.constrain("COPY_TRANSFORMS")
    character.target.parent = character.add(None, (0.1, 0.2, 0.3))
    character.target.constraints.new("LIMIT_LOCATION").use_min_x = True
    return [character.target, character.target.constraints[0], character.target.parent]


def meshes(character):
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata([(-3, -3, 0), (3, -3, 0.3), (3, 3, 0), (-3, 3, 0.5)], [], [(0, 1, 2, 3)])
    character.target = character.add(mesh)
    return [character.constrain("SHRINKWRAP"), mesh, mesh.vertices[0], mesh.polygons[0]]


def modified_meshes(character):
    constraint, *_mesh = meshes(character)
    return [character.target.modifiers.new("Cast", "CAST"), constraint]


def nodes(character):
    """They make the ground to which a bone is moved."""
    meshes(character)
    tree = bpy.data.node_groups.new("Ground", "GeometryNodeTree")
    for in_out in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    start, node, end = map(tree.nodes.new, ("NodeGroupInput", "GeometryNodeSetPosition", "NodeGroupOutput"))
    tree.links.new(start.outputs[0], node.inputs[0])
    tree.links.new(node.outputs[0], end.inputs[0])
    modifier = character.target.modifiers.new("Nodes", "NODES")
    modifier.node_group = tree
    return [modifier, tree, node, node.inputs["Offset"]]


def collections(character):
    """The target is in the scene through one."""
    collection, inner = (bpy.data.collections.new(name) for name in ("Things", "Inner"))
    character.scene.collection.children.link(collection)
    collection.children.link(inner)
    inner.objects.link(character.target)
    character.scene.collection.objects.unlink(character.target)
    layer_collection = layer().layer_collection.children[collection.name]
    return [character.constrain("COPY_TRANSFORMS"), collection, inner, layer_collection]


def curves(character):
    curve = bpy.data.curves.new("Path", "CURVE")
    spline = curve.splines.new("BEZIER")
    spline.bezier_points.add(1)
    for point, x in zip(spline.bezier_points, (-1, 2)):
        point.co, point.handle_left, point.handle_right = (x, 0, 1), (x - 1, 1, 1), (x + 1, 0, 0)
    character.target = character.add(curve)
    if bpy.app.version < (5, 0, 0):  # it crashes if the curve is edited while relations are built
        return [character.constrain("CLAMP_TO")]
    # A flip may have Blender make new ones.
    return [character.constrain("CLAMP_TO"), curve, lambda: curve.splines[0], lambda: curve.splines[0].bezier_points[0]]


def constrained_by_armature(character):
    constraint = character.constrain("ARMATURE")
    target = constraint.targets.new()
    target.target = character.target
    return [constraint, target]


def constrained_by_action(character):
    constraint = character.constrain("ACTION")
    constraint.action = character.rig.animation_data.action.copy()
    constraint.frame_start, constraint.frame_end, constraint.max, constraint.transform_channel = 1, 9, 2, "LOCATION_Z"
    curves = [each for each in fcurves(constraint.action) if "bone3" in each.data_path]
    return [constraint, constraint.action, curves[0], key_of(curves[0], 0)]


def fcurves(action):
    return addon_module("blender.animation").action_curves(action)


def key_of(curve, number):
    """Blender may move keyframes in memory."""
    return lambda: curve.keyframe_points[number]


def own_keyframes(character):
    action = character.rig.animation_data.action
    curve = fcurves(action)[3]
    modifier = fcurves(action)[4].modifiers.new("CYCLES")
    modified = fcurves(action)[5].modifiers.new("GENERATOR")
    return [action, curve, key_of(curve, 0), key_of(curve, 2), modifier, modified]


def strips(character):
    data = character.rig.animation_data
    action, slot = data.action, getattr(data, "action_slot", None)
    data.action = None
    track = data.nla_tracks.new()
    strip = track.strips.new("Strip", 1, action)
    if slot is not None:
        strip.action_slot = slot
    return [data, track, strip, action, fcurves(action)[3], key_of(fcurves(action)[3], 0)]


def drivers(character):
    character.target["x"] = 0.7
    character.target.update_tag()  # Blender does not notice by itself
    curve = character.bones["bone3"].driver_add("bbone_rollin")
    character.bones["bone3"].bone.bbone_segments = 3
    driver, turn = curve.driver, character.bones["bone3"].driver_add("scale", 0)
    driver.type = turn.driver.type = "SCRIPTED"
    for name, ob, path in (
        ("x", character.target, '["x"]'),
        ("turn", character.rig, 'pose.bones["bone0"].location[0]'),
    ):
        variable = turn.driver.variables.new()
        variable.name, variable.targets[0].id, variable.targets[0].data_path = name, ob, path
    turn.driver.expression = "1 + turn * x"
    place = driver.variables.new()
    place.type, place.targets[0].id, driver.expression = "TRANSFORMS", character.target, "var"
    return [turn, turn.driver, *turn.driver.variables, turn.driver.variables[0].targets[0], place, place.targets[0]]


def driven_keys(character):
    ob = make_tube()
    modifier = ob.modifiers.new("Armature", "ARMATURE")
    modifier.object = character.rig
    add_shape_keys(ob)
    keys = ob.data.shape_keys
    keys.animation_data_clear()
    curve = keys.key_blocks["Wide"].driver_add("value")
    variable = curve.driver.variables.new()
    variable.type, curve.driver.type = "TRANSFORMS", "SUM"
    target = variable.targets[0]
    target.id, target.bone_target, target.transform_type = character.rig, "bone2", "ROT_X"
    target.transform_space = "LOCAL_SPACE"
    shown = character.shown

    def with_keys():
        values = [key.value for key in keys.evaluated_get(depsgraph()).key_blocks]
        return np.append(shown().ravel(), values)

    character.shown = with_keys
    return [keys, keys.key_blocks["Wide"], curve, curve.driver, variable, target]


def aims(character):
    """An object on a bone, which another bone of the same armature follows."""
    character.constrain("DAMPED_TRACK", "side")
    character.target.parent, character.target.parent_type, character.target.parent_bone = character.rig, "BONE", "bone4"
    return [character.target, character.bones["side"].constraints[0]]


def of_type(kind):
    def constraints(character):
        return [character.constrain(kind)]

    constraints.__name__ = kind.lower()
    return constraints


KINDS = [
    pose_bones,
    bones,
    armature,
    targets,
    meshes,
    modified_meshes,
    nodes,
    collections,
    curves,
    constrained_by_armature,
]
KINDS += [constrained_by_action, own_keyframes, strips, drivers, driven_keys, aims]
TYPES = [item.identifier for item in bpy.types.Constraint.bl_rna.properties["type"].enum_items]
KINDS += [of_type(kind) for kind in TYPES if kind not in {"ARMATURE", "ACTION", "SHRINKWRAP", "CLAMP_TO"}]
# Blender evaluates them on each frame by themselves, or may, so they cannot be played.
TIMED = {"modified_meshes", "nodes", "transform_cache", "follow_track", "camera_solver", "object_solver"}


# --- flipping -------------------------------------------------------------------------------------


def flips(struct):
    """The names of the properties of a struct that can be written, in order."""
    return [
        member.identifier
        for member in struct.bl_rna.properties
        if not member.is_readonly and member.identifier not in LEFT_OUT and member.type != "COLLECTION"
    ]


def other_values(struct, name, spares):
    """Other values than a property has, of which it is set to one. spares: data-blocks for pointers."""
    member, value = struct.bl_rna.properties[name], getattr(struct, name)
    if member.type == "POINTER":
        fitting = [each for each in spares if isinstance(each, type(value) if value else bpy.types.ID)]
        return [each for each in (None, *fitting) if each != value]
    if member.type == "ENUM":
        items = [item.identifier for item in member.enum_items]
        if member.is_enum_flag:
            return [value ^ {item} for item in items]
        place = items.index(value) if value in items else 0
        return items[place + 1 :] + items[:place]
    if member.type == "STRING":
        return [each for each in ("bone1", "") if each != value]
    if member.type not in {"FLOAT", "INT", "BOOLEAN"}:
        return []
    if getattr(member, "is_array", False):
        if member.subtype == "MATRIX":
            return [Matrix.Translation((0.1, 0, 0.2)) @ value] if len(value) == 4 else []
        return [tuple(not each if member.type == "BOOLEAN" else each + 1 for each in value)]
    if member.type == "BOOLEAN":
        return [not value]
    step = 1 if member.type == "INT" else 0.37
    return [value - step if value + step > member.soft_max else value + step]


def now(place):
    return place() if callable(place) else place


def flip(structs, name, spares, turn):
    """Sets a property of each of these, which are each other's twins, to another value. spares: of each; turn: which of
    several. Returns the values before, or None if it has no other value that Blender accepts."""
    before = [getattr(each, name) for each in structs]
    before = [each.copy() if isinstance(each, Matrix) else each for each in before]
    before = [tuple(each) if hasattr(each, "__len__") and not isinstance(each, KEPT) else each for each in before]
    values = [other_values(struct, name, own) for struct, own in zip(structs, spares)]
    for number in range(len(values[0])):
        try:
            for each, others in zip(structs, values):
                setattr(each, name, others[(number + turn) % len(others)])
            return before
        except (TypeError, ValueError, AttributeError, RuntimeError):
            continue
    return None


KEPT = (str, set, Matrix, bpy.types.bpy_struct)


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    "way", ["recorded", *(pytest.param(each, marks=needs_rig_programs) for each in ("computed", "posed"))]
)
@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_an_edit_that_makes_no_difference_here_shows_on_other_frames(fresh_scene, kind, way, request, monkeypatch):
    """A character whose frames are computed is played again after the edit, before any frame is played, or stays
    played."""
    is_computed = way != "recorded"
    if not is_computed:
        request.getfixturevalue("no_program")
    computing, kept = addon_module("played.computing"), []
    read_again = computing.read_again
    monkeypatch.setattr(computing, "read_again", lambda *given: kept.append(read_again(*given)) or kept[-1])
    scene = fresh_scene
    scene.frame_start, scene.frame_end = FRAMES[0], FRAMES[-1]
    ours, theirs = Character(scene), Character(scene)
    pairs = list(zip(kind(ours), kind(theirs)))
    select()
    for each in (ours, theirs):
        each.rig.update_tag()
        addon_module("blender.animation").keyed_curves(each.rig)[0].update()
    layer().update()
    rig, flipped, played, computed = recorded().learn(ours.rig), 0, 0, 0

    def compare(what):
        assert np.array_equal(ours.shown(), theirs.shown(), equal_nan=True), what

    def play(what, frames=FRAMES):
        for frame in frames:
            scene.frame_set(frame)
            compare((*what, frame))

    def record_and_take_over(what):
        rig.motion.restless = rig.motion.to_skip = 0
        play(what, (STILL,) if is_computed else (*FRAMES, STILL))
        states().take_over([rig], scene, layer())
        compare((*what, "states"))

    record_and_take_over(("at first",))
    if kind.__name__ not in TIMED and not is_computed:
        assert rig.is_played, rig.reason
    spares, writable, pointers = [ours.spare(), theirs.spare()], 0, 0
    for places in pairs:
        for number, name in enumerate(flips(now(places[0]))):
            what = type(now(places[0])).__name__, name
            record_and_take_over(what)
            was_played = rig.is_played
            pair = list(map(now, places))
            before, writable = flip(pair, name, spares, number + bpy.app.version[1]), writable + 1
            if before is None:
                continue
            pointers += now(places[0]).bl_rna.properties[name].type == "POINTER"
            flipped, played = flipped + 1, played + was_played
            layer().update()
            if way == "computed":  # an edit of what is keyed may be lost on this frame
                states().take_over([rig], scene, layer())
                computed += rig.is_played
            play(what)
            for each, value in zip(places, before):
                setattr(now(each), name, value)
    print(f"\n{kind.__name__}: {flipped} of {writable} properties flipped, {pointers} of them pointers,", end=" ")
    print(f"{played} played, {computed} computed again")
    print(f"{len(kept)} programs read again, {sum(kept)} of them without building")
    assert flipped > 0.8 * writable and (pointers or kind is bones)
    if kind.__name__ in TIMED:
        assert played == 0
    else:
        assert is_computed or played > 0.7 * flipped


def test_a_track_that_was_muted_plays_again(fresh_scene):
    """Muting it hands back the character, for which Blender builds relations. Then they lack the strips."""
    ours = Character(fresh_scene)
    _data, track, *_rest = strips(ours)
    select()
    layer().update()
    rig, wanted = recorded().learn(ours.rig), {}
    for frame in (*FRAMES, STILL):
        fresh_scene.frame_set(frame)
        wanted[frame] = ours.shown()
    states().take_over([rig], fresh_scene, layer())
    assert rig.is_played, rig.reason
    track.mute = True
    layer().update()
    assert not rig.is_played
    track.mute = False
    for frame in (*FRAMES, STILL):
        fresh_scene.frame_set(frame)
        assert np.array_equal(ours.shown(), wanted[frame]), frame
