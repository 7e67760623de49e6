"""Makes the characters for benchmarks: a chain of 22 bones, or one of the rigs that ship with Blender (Rigify), with a
mesh of tubes around the deforming bones.

A `stack` is what the mesh has besides its Armature modifier: one of STACKS, or "" for nothing.
"""

import contextlib
from typing import Any

import bmesh
import bpy
import numpy as np
from mathutils import Euler

CHAIN, CHAIN_BONES = "chain", 22
METARIGS = ("human", "horse", "cat", "wolf", "bird", "shark", "basic_human", "basic_quadruped")
RIGS = (CHAIN, *METARIGS)
STACKS = (
    "keys",
    "driven-keys",
    "smooth",
    "smooth-part",
    "keys-smooth",
    "subdivision",
    "preserve-volume",
    "second-armature",
    "game-rig",
    "driven-smooth",
    "render-smooth",
    "lattice-smooth",
    "surface-deform",
    "mesh-deform",
    "before-subsurf",
    "before-triangulate",
    "before-mirror",
    "before-weld",
    "before-solidify",
    "before-mask",
    "before-uv_warp",
    "behind-subsurf-1",
    "behind-subsurf-2",
    "behind-subsurf-triangulate",
    "behind-subsurf-solidify",
    "behind-subsurf-weighted_normal",
    "behind-mask",
    "behind-edge_split",
    "behind-mirror",
    "behind-array",
    "shared",
)
KEYED_FRAMES = (1, 15, 30, 45)
CONTROLS = 60  # how many controls of a generated rig are animated
INFLUENCES = 3
KEYS, KEY_SHARE = 50, 0.05  # the number of shape keys, and the share of the vertices that each moves
SMOOTHED_SHARE = 0.2  # the share of the vertices that the stack smooth-part smooths
CHUNK = 10_000  # vertices
FOLLOWER = "Follower"


# The add-on's module name, which depends on the version of Blender.
ADDON = next(name for name in bpy.context.preferences.addons.keys() if name.rpartition(".")[2] == "sinew")


def sinew(name):
    """Returns a module of the add-on."""
    return __import__(f"{ADDON}.{name}", fromlist=["_"])


def make_characters(rig, vertices, count=1, stack=""):
    """Adds `count` characters to the open file, or to a .blend file that has the rig, each with its own armature.
    Returns [mesh object]."""
    armature = make_chain() if rig == CHAIN else loaded(rig) if is_file(rig) else make_generated(rig)
    meshes = [make_mesh(armature, vertices, one_tube=rig == CHAIN)]
    add_stack(meshes[0], stack)
    meshes += [duplicate(meshes[0], linked=stack == "shared") for _ in range(count - 1)]
    for seed, ob in enumerate(meshes, start=1):
        animate(ob.parent, seed)
        animate_keys(ob, stack, seed)
    if stack == "surface-deform":
        meshes.append(make_clothes(meshes[0]))
    return meshes


def select(*objects):
    for ob in bpy.context.selected_objects:
        ob.select_set(False)
    for ob in objects:
        ob.select_set(True)
    bpy.context.view_layer.objects.active = objects[0]


def duplicate(ob, linked=False):
    """Duplicates a mesh together with its rig, as Shift D does, or linked as Alt D does."""
    select(ob, ob.parent)
    bpy.ops.object.duplicate(linked=linked)
    return bpy.context.active_object


# --- armatures ------------------------------------------------------------------------------------


def make_chain():
    data = bpy.data.armatures.new("Rig")
    armature = bpy.data.objects.new("Rig", data)
    bpy.context.collection.objects.link(armature)
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    parent = None
    for i in range(CHAIN_BONES):
        bone = data.edit_bones.new(f"bone{i:02}")
        bone.head, bone.tail, bone.parent = (0, 0, i), (0, 0, i + 1), parent
        parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def make_generated(rig):
    bpy.ops.preferences.addon_enable(module="rigify")
    getattr(bpy.ops.object, f"armature_{rig}_metarig_add")()
    metarig = bpy.context.active_object
    bpy.ops.pose.rigify_generate()
    armature = bpy.context.active_object
    assert armature != metarig
    bpy.data.objects.remove(metarig)
    return armature


def is_file(rig):
    return rig.endswith(".blend")


def loaded(path):
    """Returns the largest armature of a file whose name begins with "RIG", alone in a scene."""
    bpy.ops.wm.open_mainfile(filepath=path)
    bpy.ops.preferences.addon_enable(module=ADDON)
    found = [ob for ob in bpy.data.objects if ob.type == "ARMATURE" and ob.name.startswith("RIG")]
    return put_alone(max(found, key=lambda ob: len(ob.pose.bones)))


def put_alone(ob):
    scene = bpy.data.scenes.new("Rig")
    scene.collection.objects.link(ob)
    bpy.context.window.scene = scene
    if ob.animation_data:
        ob.animation_data.action = None
    return ob


def animate(armature, seed, controls=CONTROLS, frames=KEYED_FRAMES):
    """Rotates all bones of a chain; rotates and moves some controls of a generated rig, with controls=None all."""
    random = np.random.default_rng(seed)
    bones = [bone for bone in armature.pose.bones if bone.custom_shape]
    if bones:
        bones = [bones[i] for i in sorted(random.permutation(len(bones))[:controls])]
    moves = bool(bones)
    for bone in bones or armature.pose.bones:
        if not moves:
            bone.rotation_mode = "XYZ"
        turned = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}.get(
            bone.rotation_mode, "rotation_euler"
        )
        for frame in frames:
            turn = Euler(random.uniform(-0.2, 0.2, 3))
            if turned == "rotation_quaternion":
                turn = turn.to_quaternion()
            elif turned == "rotation_axis_angle":
                axis, angle = turn.to_quaternion().to_axis_angle()
                turn = (angle, *axis)
            setattr(bone, turned, turn)
            bone.keyframe_insert(turned, frame=frame)
            if moves:
                bone.location = random.uniform(-0.05, 0.05, 3) * bone.length
                bone.keyframe_insert("location", frame=frame)


# --- meshes ---------------------------------------------------------------------------------------


def make_mesh(armature, vertices, one_tube, name="Body", covers=("",), thickness=0.25):
    """Makes tubes of quads with `vertices` vertices in total or slightly fewer, bound as Blender's own
    Parent > Armature Deform does. covers: prefixes of the names of deforming bones that get a tube; thickness: a tube's
    radius, as a multiple of its bone's length."""
    bones = [bone for bone in armature.data.bones if bone.use_deform]
    heads, tails = (np.array([getattr(bone, end)[:] for bone in bones]) for end in ("head_local", "tail_local"))
    if one_tube:
        tubes = [tube(heads[0], tails[-1], 1.0, vertices)]
    else:
        covered = [bone.name.removeprefix("DEF-").startswith(covers) for bone in bones]
        lengths = np.linalg.norm(tails - heads, axis=1)[covered]
        until = vertices * np.cumsum(lengths) / lengths.sum()
        tubes, made = [], 0
        for head, tail, length, goal in zip(heads[covered], tails[covered], lengths, until):
            tubes.append(tube(head, tail, thickness * length, max(12, int(goal - made))))
            made += len(tubes[-1][0])
    starts = np.cumsum([0] + [len(points) for points, _ in tubes])
    points = np.concatenate([points for points, _ in tubes]).astype(np.float32)
    corners = np.concatenate([corners + start for (_, corners), start in zip(tubes, starts)])
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.reshape(-1))
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners.astype(np.int32))
    mesh.polygons.add(len(corners) // 4)
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 4, dtype=np.int32))
    if bpy.app.version < (4, 1, 0):
        mesh.polygons.foreach_set("loop_total", np.full(len(corners) // 4, 4, np.int32))
    mesh.update(calc_edges=True)
    ob = bpy.data.objects.new(name, mesh)
    ob.parent = armature
    bpy.context.collection.objects.link(ob)
    for bone in bones:
        ob.vertex_groups.new(name=bone.name)
    write_weights(mesh, *nearest(points, heads, tails))
    ob.modifiers.new("Armature", "ARMATURE").object = armature
    return ob


def tube(head, tail, radius, vertices):
    """Returns (points, corners of quads) of a tube around a bone, with at most `vertices` vertices."""
    around = max(4, 4 * round(vertices**0.5 / 4))
    rings = vertices // around
    along = tail - head
    side = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    side /= np.linalg.norm(side)
    other = np.cross(along / np.linalg.norm(along), side)
    way, angle = np.meshgrid(np.linspace(0, 1, rings), np.linspace(0, 2 * np.pi, around, endpoint=False), indexing="ij")
    points = (
        head + way[..., None] * along + radius * (np.cos(angle)[..., None] * side + np.sin(angle)[..., None] * other)
    )
    row, column = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    after = (column + 1) % around
    corners = np.stack(
        [row * around + column, row * around + after, (row + 1) * around + after, (row + 1) * around + column], -1
    )
    return points.reshape(-1, 3), corners.reshape(-1)


def nearest(points, heads, tails):
    """Returns (bones, weights), both (V, 3): each vertex's nearest bones. A weight falls towards 0 (at least 0.01) as
    its bone becomes as far away as the fourth."""
    along = tails - heads
    bones, weights = [], []
    for start in range(0, len(points), CHUNK):
        offset = points[start : start + CHUNK, None] - heads
        way = np.clip((offset * along).sum(-1) / (along * along).sum(-1), 0, 1)
        distances = np.linalg.norm(offset - way[..., None] * along, axis=-1)
        order = np.argsort(distances, axis=1)[:, : INFLUENCES + 1]
        near = np.take_along_axis(distances, order, axis=1)
        bones.append(order[:, :INFLUENCES])
        weights.append(np.maximum(1 - near[:, :INFLUENCES] / np.maximum(near[:, INFLUENCES:], 1e-9), 0.01))
    return np.concatenate(bones), np.concatenate(weights)


def write_weights(mesh, bones, weights):
    bm = bmesh.new()
    bm.from_mesh(mesh, face_normals=False)
    layer = bm.verts.layers.deform.verify()
    for vertex, indices, values in zip(bm.verts, bones.tolist(), weights.tolist()):
        entry = vertex[layer]
        for index, value in zip(indices, values):
            entry[index] = value
    bm.to_mesh(mesh)
    bm.free()


# --- stacks ---------------------------------------------------------------------------------------


def add_stack(ob, stack):
    if "keys" in stack:
        add_keys(ob)
    if stack == "lattice-smooth":
        ob.modifiers.new("Lattice", "LATTICE").object = make_lattice(ob)
    if "smooth" in stack:
        smooth = ob.modifiers.new("Smooth", "CORRECTIVE_SMOOTH")
        if stack == "smooth-part":
            smooth.vertex_group = ob.vertex_groups.new(name="Smoothed").name
            ob.vertex_groups["Smoothed"].add(range(int(SMOOTHED_SHARE * len(ob.data.vertices))), 1, "REPLACE")
        elif stack == "driven-smooth":
            bone = ob.vertex_groups[len(ob.vertex_groups) // 2].name
            drive(smooth, ob.parent, bone, "factor")
        elif stack == "render-smooth":
            smooth.show_viewport = False
    ob.modifiers["Armature"].use_deform_preserve_volume = stack == "preserve-volume"
    if stack == "subdivision":
        ob.modifiers.new("Subdivision", "SUBSURF").levels = 1
    elif stack == "second-armature":
        ob.modifiers.new("Face", "ARMATURE").object = make_face(ob)
    elif stack == "game-rig":
        ob.modifiers["Armature"].object = make_game_rig(ob.parent)
    elif stack == "mesh-deform":
        bind_to_cage(ob)
    elif stack.startswith("behind-"):
        add_behind(ob, stack.removeprefix("behind-").upper())
    elif stack.startswith("before-"):
        add_before(ob, stack.removeprefix("before-").upper())


def make_game_rig(rig):
    """Returns an armature without keyframes, as game engines are given it: its bones follow those that deform of a
    rig."""
    select(rig)
    bpy.ops.object.duplicate()
    game = bpy.context.active_object
    game.animation_data_clear()
    game.data.animation_data_clear()
    game.parent, game.matrix_parent_inverse = rig, rig.matrix_world.inverted()
    for bone in game.pose.bones:
        for constraint in list(bone.constraints):
            bone.constraints.remove(constraint)
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in list(game.data.edit_bones):
        if not bone.use_deform:
            game.data.edit_bones.remove(bone)
    for bone in game.data.edit_bones:
        bone.bbone_segments = 1
    bpy.ops.object.mode_set(mode="OBJECT")
    for bone in game.pose.bones:
        constraint = bone.constraints.new("COPY_TRANSFORMS")
        constraint.target, constraint.subtarget = rig, bone.name
    return game


def add_behind(ob, stack):
    """Adds modifiers behind the armature, and an object that follows a vertex which they make. stack: their types, or
    the levels of the one before."""
    modifier: Any = None
    for word in stack.split("-"):
        if word.isdigit():
            modifier.levels = int(word)
            continue
        modifier = ob.modifiers.new(word.title(), word)
        if word == "EDGE_SPLIT":
            modifier.use_edge_angle = False
            for number, edge in enumerate(ob.data.edges):
                edge.use_edge_sharp = number % 7 == 0
        elif word == "MASK":
            group = ob.vertex_groups.new(name="Shown")
            group.add(range(len(ob.data.vertices) // 2), 1.0, "REPLACE")
            modifier.vertex_group = group.name
        elif word == "TRIANGULATE":
            modifier.quad_method = "FIXED"
        elif word == "MIRROR":
            modifier.use_mirror_merge = False
        elif word == "ARRAY":
            modifier.use_relative_offset, modifier.use_constant_offset = False, True
    add_follower(ob)


def add_follower(ob):
    """Adds a mesh of one vertex that node tools put to the first one of an object."""
    mesh = bpy.data.meshes.new(FOLLOWER)
    mesh.vertices.add(1)
    follower = bpy.data.objects.new(FOLLOWER, mesh)
    bpy.context.collection.objects.link(follower)
    group = bpy.data.node_groups.new(FOLLOWER, "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    kinds = "NodeGroupInput", "NodeGroupOutput", "GeometryNodeObjectInfo", "GeometryNodeSampleIndex"
    source, target, info, sample = (group.nodes.new(kind) for kind in kinds)
    place = group.nodes.new("GeometryNodeSetPosition")
    position = group.nodes.new("GeometryNodeInputPosition")
    info.inputs["Object"].default_value = ob
    sample.data_type, sample.domain = "FLOAT_VECTOR", "POINT"
    value = next(each for each in sample.inputs if each.type == "VECTOR" and each.enabled)
    result = next(each for each in sample.outputs if each.type == "VECTOR" and each.enabled)
    for one, other in (
        (info.outputs["Geometry"], sample.inputs["Geometry"]),
        (position.outputs["Position"], value),
        (result, place.inputs["Position"]),
        (source.outputs[0], place.inputs["Geometry"]),
        (place.outputs[0], target.inputs[0]),
    ):
        group.links.new(one, other)
    follower.modifiers.new(FOLLOWER, "NODES").node_group = group


def make_lattice(ob):
    """Adds a lattice around a mesh, with points that are not where they were."""
    lattice = bpy.data.lattices.new("Lattice")
    lattice.points_u = lattice.points_v = lattice.points_w = 4
    for number, point in enumerate(lattice.points):
        point.co_deform.x += 0.05 * (number % 3)
    cage = bpy.data.objects.new("Lattice", lattice)
    bpy.context.collection.objects.link(cage)
    cage.location = np.mean(ob.bound_box, axis=0)
    cage.scale = 1.1 * np.array(ob.dimensions)
    return cage


def make_face(ob):
    """Adds a second armature, with a bone for every third of the first one's that deform."""
    body = ob.parent
    armature = body.copy()
    armature.data = body.data.copy()
    bpy.context.collection.objects.link(armature)
    for number, bone in enumerate(armature.data.bones):
        bone.use_deform = bone.use_deform and number % 3 == 0
    animate(armature, 99)
    return armature


def bind_to_cage(ob):
    """Adds a Mesh Deform modifier and its cage behind the armature."""
    low, high = np.min(ob.bound_box, axis=0), np.max(ob.bound_box, axis=0)
    bpy.ops.mesh.primitive_cube_add()
    cage = bpy.context.active_object
    cage.location, cage.scale = (low + high) / 2, 0.6 * (high - low)
    cage.name = "Cage"
    for number, vertex in enumerate(cage.data.vertices):
        vertex.co.y *= 1 + 0.05 * (number % 3)
    modifier = ob.modifiers.new("Mesh Deform", "MESH_DEFORM")
    modifier.object, modifier.precision = cage, 4
    select(ob)
    bpy.ops.object.meshdeform_bind(modifier=modifier.name)
    assert modifier.is_bound
    for vertex in cage.data.vertices:
        vertex.co.x *= 1.2
    cage.hide_render = cage.hide_viewport = True


def make_clothes(body):
    """Adds a slightly larger copy of a mesh with a Surface Deform modifier alone, which binds it to that mesh."""
    clothes = body.copy()
    clothes.data = body.data.copy()
    clothes.name = "Clothes"
    bpy.context.collection.objects.link(clothes)
    clothes.modifiers.clear()
    points = np.empty(3 * len(clothes.data.vertices), np.float32)
    normals = points.copy()
    clothes.data.vertices.foreach_get("co", points)
    clothes.data.vertices.foreach_get("normal", normals)
    clothes.data.vertices.foreach_set("co", points + 0.01 * normals)
    modifier = clothes.modifiers.new("Surface Deform", "SURFACE_DEFORM")
    modifier.target = body
    select(clothes)
    with at_rest(body.parent):
        bpy.ops.object.surfacedeform_bind(modifier=modifier.name)
    assert modifier.is_bound
    return clothes


@contextlib.contextmanager
def at_rest(armature):
    armature.data.pose_position = "REST"
    bpy.context.view_layer.update()
    try:
        yield
    finally:
        armature.data.pose_position = "POSE"


def add_before(ob, kind):
    """Adds a modifier of that type before the Armature modifier."""
    modifier = ob.modifiers.new("Before", kind)
    if kind == "SUBSURF":
        modifier.levels = 1
    elif kind == "SOLIDIFY":
        modifier.thickness = 0.01
    elif kind == "MASK":
        group = ob.vertex_groups.new(name="Shown")
        group.add(range(len(ob.data.vertices) // 2), 1, "REPLACE")
        modifier.vertex_group = group.name
    elif kind == "UV_WARP":
        ob.data.uv_layers.new()
        modifier.offset = 0.1, 0.2
    with bpy.context.temp_override(object=ob):
        bpy.ops.object.modifier_move_to_index(modifier="Before", index=0)


def add_keys(ob, count=KEYS):
    """Adds shape keys, each of which moves a run of consecutive vertices; all have an effect."""
    random = np.random.default_rng(1)
    rest = np.empty(3 * len(ob.data.vertices), np.float32)
    ob.data.vertices.foreach_get("co", rest)
    moved = int(KEY_SHARE * len(rest) / 3) * 3
    far = 0.01 * max(ob.dimensions)
    ob.shape_key_add(name="Basis")
    for number in range(count):
        shape = rest.copy()
        start = 3 * random.integers(len(rest) // 3 - moved // 3)
        shape[start : start + moved] += random.uniform(-far, far, moved).astype(np.float32)
        key = ob.shape_key_add(name=f"Key {number:02}")
        key.data.foreach_set("co", shape)
        key.value = 0.3


def animate_keys(ob, stack, seed):
    """Animates half of the shape keys, with keyframes or with drivers on bones."""
    if not ob.data.shape_keys:
        return
    random = np.random.default_rng(seed)
    for key in ob.data.shape_keys.key_blocks[1 : KEYS // 2 + 1]:
        if stack == "driven-keys":
            drive_by_some_bone(key, ob, random)
        else:
            for frame in KEYED_FRAMES:
                key.value = random.uniform(0, 1)
                key.keyframe_insert("value", frame=frame)


def drive_by_some_bone(key, ob, random):
    key.driver_remove("value")
    drive(key, ob.parent, ob.vertex_groups[int(random.integers(len(ob.vertex_groups)))].name, "value")


def drive(owner, armature, bone, name):
    """Has the rotation of a bone set a property of that name."""
    driver = owner.driver_add(name).driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.type = "TRANSFORMS"
    target = variable.targets[0]
    target.id, target.bone_target = armature, bone
    target.transform_type, target.transform_space = "ROT_X", "LOCAL_SPACE"
