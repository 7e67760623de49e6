"""Weights that are transferred, smoothed and mirrored: what the operators write, keep and refuse."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from mathutils.bvhtree import BVHTree

from characters import accelerate, add_shape_keys, make_armature, make_tube, pose, twin_of
from helpers import addon_module, evaluated, select
from side_names import SIDE_NAMES
from test_automatic_weights import BONES, armature_of, dense, group_names, paint, parent, places


def triangulated(ob):
    """Splits all faces along their diagonals, so that there is one way to interpolate on them."""
    modifier = ob.modifiers.new("Triangles", "TRIANGULATE")
    select(ob)
    bpy.ops.object.modifier_apply(modifier=modifier.name)


def make_body(name="Body"):
    """A tube of triangles with weights made by Sinew, and its armature."""
    armature = make_armature()
    ob = make_tube()
    triangulated(ob)
    ob.vertex_groups.clear()
    ob.name = name
    parent(ob, armature)
    return ob, armature


def suit_of(ob, grow=1.05, name="Suit"):
    """The same surface around the body, with neither weights nor armature."""
    suit = twin_of(ob)
    suit.name = name
    suit.vertex_groups.clear()
    suit.modifiers.clear()
    suit.parent = None
    for vertex in suit.data.vertices:
        vertex.co.xy *= grow
    return suit


def run(operator, *objects, **settings):
    """With the first of the objects active."""
    select(*objects)
    return getattr(bpy.ops.object, f"sinew_{operator}")(**settings)


def transfer(source, *targets, **settings):
    return run("transfer_weights", source, *targets, **settings)


def transferred_and_cleared(body, suit):
    """The weights that the suit gets, which has none again afterwards."""
    transfer(body, suit)
    found = dense(suit)
    suit.vertex_groups.clear()
    return found


def refusal(operator, *objects, **settings):
    """The sentence with which an operator refuses."""
    with pytest.raises(RuntimeError) as raised:
        run(operator, *objects, **settings)
    return str(raised.value).strip().removeprefix("Error: ")


def report_of(source, *targets, **settings):
    """Of a transfer that is not written."""
    module = addon_module("weights.transferring")
    made = module.Transfer([source], targets, module.TransferSettings(**settings))
    made.compute()
    return made.report(), made.matched


def entries(ob):
    """All that the mesh has of weights, to the bit."""
    return [part.tobytes() for part in addon_module("blender.meshes").read_weights(ob.data)], group_names(ob)


def selected(ob):
    return np.array([vertex.select for vertex in ob.data.vertices])


def closest(source, points):
    """(P, B) and (P,): weights at the closest points of the source's triangles, in the space of both, and how far they
    are. By Blender's own tree."""
    corners = np.array([vertex.co for vertex in source.data.vertices])
    faces = [tuple(face.vertices) for face in source.data.polygons]
    tree, weights = BVHTree.FromPolygons(corners.tolist(), faces), dense(source)
    weights /= weights.sum(axis=1, keepdims=True)
    found, distances = [], []
    for point in points:
        place, _normal, face, distance = tree.find_nearest(point)
        own = list(faces[face])
        sides = np.vstack((corners[own].T, np.ones(3)))
        share = np.linalg.lstsq(sides, np.append(place, 1), rcond=None)[0]
        found.append(share @ weights[own])
        distances.append(distance)
    return np.array(found), np.array(distances)


def diagonal_of(ob):
    return np.linalg.norm(np.ptp([vertex.co for vertex in ob.data.vertices], axis=0))


# --- Transfer -------------------------------------------------------------------------------------


def test_matched_vertices_have_the_weights_of_the_closest_point():
    body, _ = make_body()
    suit = suit_of(body)
    suit.data.transform(Matrix.Rotation(0.1, 4, "Z"))
    assert transfer(body, suit) == {"FINISHED"}
    expected, distances = closest(body, [vertex.co for vertex in suit.data.vertices])
    assert distances.max() < 0.05 * diagonal_of(suit)
    assert np.abs(dense(suit) - expected).max() < 1e-4


def test_what_is_too_far_is_filled_in():
    body, _ = make_body()
    suit = suit_of(body)
    for vertex in suit.data.vertices:
        if 2 < vertex.co.z < 3:
            vertex.co.xy *= 3  # a bulge
    _, distances = closest(body, [vertex.co for vertex in suit.data.vertices])
    is_near = distances <= 0.1 * diagonal_of(suit)
    report, (matched,) = report_of(body, suit, distance=0.1, angle=180.0)
    assert np.array_equal(matched, is_near) and 0 < is_near.sum() < 1200
    transfer(body, suit, distance=0.1, angle=math.pi)
    assert np.allclose(dense(suit).sum(axis=1), 1, atol=1e-5) and dense(suit).min() >= 0
    assert report.sentence() == f"1,200 vertices: {is_near.sum():,} matched, {1200 - is_near.sum():,} filled in"


def test_the_angle_counts_and_linings_need_flipped_normals():
    body, _ = make_body()
    suit = suit_of(body, 0.97)
    suit.data.flip_normals()
    report, (matched,) = report_of(body, suit)
    assert not matched.any() and report.fits[0].islands == 1
    assert report.sentence() == "1,200 vertices: 0 matched, 1,200 filled in, 1 island follows its nearest point"
    assert report_of(body, suit, flipped=True)[1][0].all()
    assert report_of(body, suit, angle=180.0)[1][0].all()
    transfer(body, suit, flipped=True)
    assert np.abs(dense(suit) - dense(body)).max() < 0.05


def test_an_island_far_away_follows_one_point():
    body, _ = make_body()
    suit = suit_of(body)
    corners = [(2 + 0.1 * i, 0.1 * k, 2.0) for i in (0, 1) for k in (0, 1)]
    faces = [tuple(face.vertices) for face in suit.data.polygons] + [(1200, 1201, 1203, 1202)]
    mesh = bpy.data.meshes.new("With a badge")
    mesh.from_pydata([tuple(vertex.co) for vertex in suit.data.vertices] + corners, [], faces)
    suit.data = mesh
    report, _ = report_of(body, suit)
    assert report.sentence() == "1,204 vertices: 1,200 matched, 4 filled in, 1 island follows its nearest point"
    transfer(body, suit)
    badge = dense(suit)[1200:]
    assert (badge == badge[0]).all() and badge.sum(axis=1) == pytest.approx(1, abs=1e-5)
    assert badge[0, BONES.index("bone1")] + badge[0, BONES.index("bone2")] + badge[0, BONES.index("side")] > 0.9


@pytest.mark.parametrize("name", places())
def test_both_are_compared_where_they_are_in_the_world(name):
    body, armature = make_body()
    suit = suit_of(body)
    expected = transferred_and_cleared(body, suit)
    place = places()[name]
    for ob in (body, suit):  # both, so that shares of the size are the same
        ob.parent = None
    suit.data.transform(place.inverted())
    if place.determinant() < 0:  # as Blender would when a mirrored scale is applied
        suit.data.flip_normals()
    suit.matrix_world = place
    transfer(body, suit)
    assert np.abs(dense(suit) - expected).max() < 1e-3


def test_a_sheared_parent():
    body, armature = make_body()
    suit = suit_of(body)
    expected = transferred_and_cleared(body, suit)
    top, below = bpy.data.objects.new("Top", None), bpy.data.objects.new("Below", None)
    for ob in (top, below):
        bpy.context.collection.objects.link(ob)
    top.scale, below.rotation_euler, below.parent, suit.parent = (1, 3, 0.5), (0.5, 0.3, 0.8), top, below
    bpy.context.view_layer.update()
    suit.data.transform(suit.matrix_world.inverted())
    transfer(body, suit)
    assert np.abs(dense(suit) - expected).max() < 1e-3


def test_the_rest_shape_counts_whatever_is_shown():
    body, armature = make_body()
    suit = suit_of(body)
    transfer(body, suit)
    expected = dense(suit)
    pose(armature, 1, True)
    for ob in (body, suit):
        add_shape_keys(ob)
    bpy.context.scene.frame_set(10)
    transfer(body, suit)
    assert np.array_equal(dense(suit), expected)


def test_several_sources_for_the_active_one():
    body, _ = make_body()
    suit = suit_of(body)
    expected = transferred_and_cleared(body, suit)
    upper = twin_of(body)
    upper.name = "Upper"
    for ob, is_upper in ((body, False), (upper, True)):
        select(ob)
        meshes = addon_module("blender.meshes")
        meshes.select_vertices(ob.data, np.array([(vertex.co.z > 2.5) != is_upper for vertex in ob.data.vertices]))
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.delete(type="VERT")
        bpy.ops.object.mode_set(mode="OBJECT")
    assert run("transfer_weights", suit, body, upper, selected_to_active=True) == {"FINISHED"}
    is_inner = np.array([abs(vertex.co.z - 2.5) > 0.2 for vertex in suit.data.vertices])
    assert np.abs(dense(suit) - expected)[is_inner].max() < 1e-4


def test_groups_that_are_not_of_bones_or_that_are_locked_stay():
    body, armature = make_body()
    armature.data.bones["bone4"].use_deform = False
    suit = suit_of(body)
    for name, share in (("Cloth", 0.25), ("bone4", 0.5), ("bone1", 0.75), ("bone3", 1.0)):
        suit.vertex_groups.new(name=name).add(range(0, 1200, 3), share, "REPLACE")
    suit.vertex_groups["bone1"].lock_weight = True
    suit.vertex_groups.active_index = 2
    kept = ("Cloth", "bone4", "bone1")
    before = dense(suit, kept)
    transfer(body, suit)
    assert group_names(suit)[:4] == ["Cloth", "bone4", "bone1", "bone3"] and suit.vertex_groups.active_index == 2
    assert np.array_equal(dense(suit, kept), before)
    deforming = [name for name in BONES if name != "bone4"]
    assert np.allclose(dense(suit, deforming).sum(axis=1), 1, atol=1e-5)
    assert dense(suit, ["bone3"])[:200].max() < 0.1  # what was there is replaced
    for vertex in list(suit.data.vertices)[::100]:
        own = [entry.weight for entry in vertex.groups if suit.vertex_groups[entry.group].name not in kept]
        assert own == sorted(own, reverse=True)


def test_only_groups_that_get_weight_are_made():
    body, _ = make_body()
    low = suit_of(body)
    select(low)
    meshes = addon_module("blender.meshes")
    meshes.select_vertices(low.data, np.array([vertex.co.z > 0.8 for vertex in low.data.vertices]))
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.delete(type="VERT")
    bpy.ops.object.mode_set(mode="OBJECT")
    transfer(body, low)
    assert "bone0" in group_names(low) and "bone4" not in group_names(low)


def test_the_preview_selects_the_matched_and_changes_nothing():
    body, _ = make_body()
    suit = suit_of(body)
    for vertex in suit.data.vertices:
        if vertex.co.z > 4:
            vertex.co.xy *= 5
    suit.vertex_groups.new(name="bone1").add(range(7), 0.5, "REPLACE")
    before = entries(suit)
    _report, (matched,) = report_of(body, suit)
    assert transfer(body, suit, preview=True, add_modifier=True) == {"FINISHED"}
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert np.array_equal(selected(suit), matched) and 0 < matched.sum() < 1200
    assert entries(suit) == before and not len(suit.modifiers)


def test_what_nothing_deforms_gets_a_modifier():
    """Unless it is told not to: then the report says that nothing follows."""
    body, armature = make_body()
    suit, other, child = suit_of(body), suit_of(body, 1.1, "Coat"), suit_of(body, 1.2, "Belt")
    other.modifiers.new("Own", "ARMATURE").object = armature
    child.parent = armature
    transferring = addon_module("weights.transferring")
    made = transferring.Transfer([body], [suit, other, child], add_modifier=False)
    made.compute()
    assert made.write().sentence().endswith("; Suit, Belt: no Armature modifier, so nothing follows the bones")
    assert not len(suit.modifiers) and not len(child.modifiers)
    transfer(body, suit, other, child)
    for ob in (suit, child):
        assert ob.parent == armature and [modifier.object for modifier in ob.modifiers] == [armature]
    assert other.parent is None and [modifier.name for modifier in other.modifiers] == ["Own"]


def test_a_mesh_that_is_accelerated_without_an_armature_gets_a_modifier():
    body, armature = make_body()
    suit = suit_of(body)
    suit.shape_key_add(name="Basis")
    suit.shape_key_add(name="Key")
    accelerate(suit)
    assert suit.sinew.is_bound and suit.sinew.armature is None
    transfer(body, suit)
    assert [each.object for each in suit.modifiers if each.type == "ARMATURE"] == [armature]


def test_what_hangs_on_a_bone_stays_there():
    body, armature = make_body()
    suit = suit_of(body)
    suit.parent, suit.parent_type, suit.parent_bone = armature, "BONE", "bone1"
    transfer(body, suit)
    assert suit.parent_type == "BONE" and not len(suit.modifiers)


def test_undo_gives_back_every_bit():
    body, _ = make_body()
    suit = suit_of(body)
    suit.vertex_groups.new(name="bone1").add(range(0, 1200, 2), 0.3, "REPLACE")
    names, before = (body.name, suit.name), entries(suit)
    for operator, objects in (
        ("transfer_weights", names),
        ("smooth_weights", names[:1]),
        ("mirror_weights", names[:1]),
    ):
        before = {name: entries(bpy.data.objects[name]) for name in names}
        select(*(bpy.data.objects[name] for name in objects))
        bpy.ops.ed.undo_push(message="before")
        assert getattr(bpy.ops.object, f"sinew_{operator}")("EXEC_DEFAULT", True) == {"FINISHED"}
        after = {name: entries(bpy.data.objects[name]) for name in names}
        assert after != before
        bpy.ops.ed.undo()
        assert {name: entries(bpy.data.objects[name]) for name in names} == before
        bpy.ops.ed.redo()
        assert {name: entries(bpy.data.objects[name]) for name in names} == after


def test_sinew_deforms_clothes_with_their_new_weights():
    body, armature = make_body()
    suit = suit_of(body)
    armature_of(suit, armature)
    transfer(body, suit)
    pose(armature, 1, False)
    select(suit)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    transfer(body, suit, distance=0.2)
    twin = twin_of(suit)
    addon_module("install.bind").unbind(twin)
    evaluated = addon_module("bake.evaluation").read
    graph = bpy.context.evaluated_depsgraph_get()
    assert np.abs(evaluated(suit, graph)[0] - evaluated(twin, graph)[0]).max() < 1e-5


# --- what is refused, without a change ------------------------------------------------------------


def nothing_selected(body, suit):
    suit.select_set(False)
    return [body]


def no_armature(body, suit):
    body.modifiers.clear()
    body.parent = None


def no_weights(body, suit):
    body.vertex_groups.clear()


def no_deforming_bone(body, suit):
    for bone in body.parent.data.bones:
        bone.use_deform = False


def no_faces(body, suit):
    points = [tuple(vertex.co) for vertex in body.data.vertices]
    body.data.clear_geometry()
    body.data.from_pydata(points, [], [])
    body.vertex_groups.clear()
    body.vertex_groups.new(name="bone1").add(range(1200), 1.0, "REPLACE")


def not_a_number(body, suit):
    suit.data.vertices[17].co.y = math.nan


def source_not_a_number(body, suit):
    body.data.vertices[5].co.y = math.nan


def no_vertices(body, suit):
    suit.data.clear_geometry()


def shared(body, suit):
    other = suit.copy()
    bpy.context.collection.objects.link(other)


def same_mesh(body, suit):
    suit.data = body.data


def all_locked(body, suit):
    for name in BONES:
        suit.vertex_groups.new(name=name).lock_weight = True


def other_bones(body, suit):
    data = bpy.data.armatures.new("Other")
    other = bpy.data.objects.new("Other", data)
    bpy.context.collection.objects.link(other)
    suit.modifiers.new("Armature", "ARMATURE").object = other


REFUSED = {
    nothing_selected: "nothing to copy between: select the clothes, then the body last, so that it is active",
    no_armature: "Body has no armature: give it an Armature modifier, or parent it to an armature",
    no_weights: "no vertex of Body has weight in a deforming bone: make its weights first",
    no_deforming_bone: "no vertex of Body has weight in a deforming bone: make its weights first",
    no_faces: "Body has no faces: weights are copied from the points of faces",
    not_a_number: "Vertex 17 of Suit is not at a finite position (NaN or infinite): delete it or move it",
    source_not_a_number: "Vertex 5 of Body is not at a finite position (NaN or infinite): delete it or move it",
    no_vertices: "Suit has no vertices, so there are no weights to edit",
    shared: "Suit shares its mesh with 1 other object, whose weights would change too; make it single-user first "
    "(Object > Relations > Make Single User > Object & Data)",
    same_mesh: "Suit shares its mesh with 1 other object, whose weights would change too; make it single-user first "
    "(Object > Relations > Make Single User > Object & Data)",
    all_locked: "all vertex groups of Suit that would get weights are locked: unlock some",
    other_bones: "Suit belongs to Other, which lacks deforming bones that move Body: bone0, bone1, bone2 and 3 more. "
    "Give it the Armature modifier of Rig",
}


@pytest.mark.parametrize("spoil", REFUSED, ids=lambda spoil: spoil.__name__)
def test_what_a_transfer_refuses(spoil):
    body, _ = make_body()
    suit = suit_of(body)
    suit.vertex_groups.new(name="Cloth").add(range(9), 0.5, "REPLACE")
    chosen = spoil(body, suit) or [body, suit]
    before = [entries(ob) for ob in (body, suit)]
    assert refusal("transfer_weights", *chosen) == REFUSED[spoil]
    assert [entries(ob) for ob in (body, suit)] == before


def test_a_target_with_two_armatures_needs_the_bones_of_one():
    body, _ = make_body()
    suit = suit_of(body)
    other_bones(body, suit)
    suit.modifiers.new("Behind", "ARMATURE").object = body.modifiers["Armature"].object
    assert transfer(body, suit) == {"FINISHED"}
    assert np.abs(dense(suit).sum(axis=1) - 1).max() < 1e-5


def test_one_refused_target_leaves_the_others_alone():
    body, _ = make_body()
    suit, other = suit_of(body), suit_of(body, 1.1, "Coat")
    not_a_number(body, other)
    before = entries(suit)
    assert "Vertex 17 of Coat" in refusal("transfer_weights", body, suit, other)
    assert entries(suit) == before


def test_a_linked_mesh_gives_weights_but_gets_none(tmp_path):
    make_body()
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, to):
        to.objects = ["Body"]
    body = to.objects[0]
    bpy.context.collection.objects.link(body)
    tube = make_tube()
    tube.vertex_groups.clear()
    bpy.context.view_layer.update()
    assert transfer(body, tube) == {"FINISHED"}
    assert np.abs(dense(tube) - dense(body)).max() < 1e-4
    tube.modifiers.new("Armature", "ARMATURE").object = body.parent
    assert refusal("transfer_weights", tube, body) == (
        "Body is linked from another file; make its weights in that file"
    )


def test_vertices_over_unpainted_skin_follow_what_is_painted():
    body, _ = make_body()
    suit = suit_of(body)
    for name in BONES:
        body.vertex_groups[name].remove(range(1200))
    body.vertex_groups["bone4"].add([1199], 1.0, "REPLACE")
    report, (matched,) = report_of(body, suit)
    assert report.unweighted == 0 and 0 < matched.sum() < 100
    transfer(body, suit)
    assert np.allclose(dense(suit)[:, BONES.index("bone4")], 1)


@pytest.mark.parametrize("what", ("transfer", "assign"))
def test_a_mirror_modifier_finds_the_groups_of_the_other_side(what):
    """Blender gives weights of a group to the mirrored half only if there is a group of the other side."""
    ob, armature = make_symmetric()
    half = suit_of(ob)
    half.vertex_groups.clear()
    half.modifiers.new("Mirror", "MIRROR")
    if what == "transfer":
        transfer(ob, half)
    else:
        made = addon_module("weights.assigning").Assignment([half], armature, names=["arm.L", "Left toe"])
        made.compute()
        made.write()
    assert {"arm.L", "arm.R", "Left toe", "Right toe"} <= set(group_names(half))
    half.modifiers["Mirror"].use_mirror_vertex_groups = False
    half.vertex_groups.clear()
    if what == "transfer":
        transfer(ob, half)
        assert "arm.R" not in group_names(half)


def make_half():
    """A ball whose sides follow bones of their own, and the positive half of a garment around it, whose other half a
    Mirror modifier makes."""
    ob, armature = make_symmetric()
    ob.vertex_groups.clear()
    for name, share in {"spine": lambda x: 1 - abs(x), "arm.L": lambda x: x, "arm.R": lambda x: -x}.items():
        group = ob.vertex_groups.new(name=name)
        for vertex in ob.data.vertices:
            if share(vertex.co.x) > 1e-4:
                group.add([vertex.index], share(vertex.co.x), "REPLACE")
    half = suit_of(ob, name="Half")
    select(half)
    addon_module("blender.meshes").select_vertices(half.data, [vertex.co.x < -1e-4 for vertex in half.data.vertices])
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.delete(type="VERT")
    bpy.ops.object.mode_set(mode="OBJECT")
    half.modifiers.new("Mirror", "MIRROR")
    return ob, half, armature


def shape_in_a_pose(ob, armature):
    """What Blender shows, deformed behind other modifiers, when each bone is turned in its own way."""
    if not any(modifier.type == "ARMATURE" for modifier in ob.modifiers):
        ob.modifiers.new("Armature", "ARMATURE").object = armature
    pose(armature, 1, False)
    return evaluated(ob)


@pytest.mark.parametrize("way", ("operator", "again", "command"))
def test_the_mirrored_half_of_a_garment_follows_its_own_side(way, sinew, tmp_path):
    ob, half, armature = make_half()
    whole = twin_of(half)
    select(whole)
    bpy.ops.object.modifier_apply(modifier="Mirror")
    transfer(ob, whole)
    if way == "command":
        names, path = (ob.name, half.name, whole.name, armature.name), str(tmp_path / "half.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        assert sinew("weights", "transfer", path, "--from", names[0], "--to", names[1])[0] == 0
        ob, half, whole, armature = (bpy.data.objects[name] for name in names)
    else:
        transfer(ob, half)
    if way == "again":  # after an older version, which did not make it
        half.vertex_groups.remove(half.vertex_groups["arm.R"])
        transfer(ob, half)
    assert set(group_names(half)) == {"spine", "arm.L", "arm.R"}
    expected, found = shape_in_a_pose(whole, armature), shape_in_a_pose(half, armature)
    assert found.shape == expected.shape and np.abs(found - expected).max() < 1e-4
    bare = twin_of(half)
    bare.vertex_groups.remove(bare.vertex_groups["arm.R"])
    assert np.abs(shape_in_a_pose(bare, armature) - expected).max() > 0.1, "the pose tells nothing"


@pytest.mark.parametrize("operator", ("smooth_weights", "mirror_weights", "reduce_influences"))
def test_each_tool_makes_the_groups_of_the_mirrored_half(operator):
    ob, half, armature = make_half()
    transfer(ob, half)
    half.vertex_groups.remove(half.vertex_groups["arm.R"])
    half.modifiers.new("Armature", "ARMATURE").object = armature
    settings = {"poses": "TEST", "max_influences": 1} if operator == "reduce_influences" else {}
    assert run(operator, half, **settings) == {"FINISHED"}
    assert set(group_names(half)) == {"spine", "arm.L", "arm.R"}


# --- Smooth ---------------------------------------------------------------------------------------


def neighbors_mean(ob):
    """(V, V): the mean over the vertices that edges lead to."""
    matrix = np.zeros((len(ob.data.vertices),) * 2)
    for edge in ob.data.edges:
        a, b = edge.vertices
        matrix[a, b] = matrix[b, a] = 1
    return matrix / matrix.sum(axis=1, keepdims=True)


def make_painted():
    """A tube with random weights that are not normalised, a group that is no bone's, and its armature."""
    armature = make_armature()
    ob = make_tube()
    ob.vertex_groups.new(name="Cloth").add(range(0, 1200, 7), 0.25, "REPLACE")
    armature_of(ob, armature)
    for name in BONES:  # Blender's groups hold 1 at most
        assert dense(ob, [name]).max() <= 1
    return ob, armature


def test_steps_go_to_the_mean_of_the_neighbors():
    ob, _ = make_painted()
    expected, mean, cloth = dense(ob).astype(float), neighbors_mean(ob), dense(ob, ["Cloth"])
    assert run("smooth_weights", ob, steps=3, factor=0.4) == {"FINISHED"}
    for _ in range(3):
        expected = 0.6 * expected + 0.4 * mean @ expected
    assert np.abs(dense(ob) - expected).max() < 1e-5
    assert np.array_equal(dense(ob, ["Cloth"]), cloth)


def test_a_strength_is_solved_for():
    ob, _ = make_painted()
    before, mean = dense(ob).astype(float), neighbors_mean(ob)
    run("smooth_weights", ob, strength=20.0)
    expected = np.linalg.solve(np.eye(1200) * 21 - 20 * mean, before)
    assert np.abs(dense(ob) - expected).max() < 1e-4


@pytest.mark.parametrize("operator", ("smooth_weights", "mirror_weights"))
def test_what_is_locked_or_not_selected_stays(operator):
    ob, armature = make_painted()
    ob.vertex_groups["bone1"].lock_weight = True
    free = np.array([vertex.index % 3 != 0 for vertex in ob.data.vertices])
    before, kept = dense(ob), entries_of_vertices(ob)
    paint(ob, armature)
    ob.data.use_paint_mask_vertex = True
    addon_module("blender.meshes").select_vertices(ob.data, free)
    assert getattr(bpy.ops.object, f"sinew_{operator}")() == {"FINISHED"}
    after = dense(ob)
    assert [own for own, is_free in zip(entries_of_vertices(ob), free) if not is_free] == [
        own for own, is_free in zip(kept, free) if not is_free
    ]
    assert np.array_equal(after[:, 1], before[:, 1]) and np.array_equal(dense(ob, ["Cloth"]), dense_of(kept, ob))
    assert np.abs(after - before)[free].max() > 0.1


def entries_of_vertices(ob):
    return [[(entry.group, entry.weight) for entry in vertex.groups] for vertex in ob.data.vertices]


def dense_of(kept, ob, name="Cloth"):
    group = ob.vertex_groups[name].index
    return np.array([[dict(own).get(group, 0)] for own in kept], np.float32)


def test_a_face_mask_frees_the_corners():
    ob, armature = make_painted()
    before = dense(ob)
    paint(ob, armature)
    ob.data.use_paint_mask = True
    chosen = np.zeros(len(ob.data.polygons), bool)
    chosen[:20] = True
    ob.data.polygons.foreach_set("select", chosen)
    assert bpy.ops.object.sinew_smooth_weights() == {"FINISHED"}
    assert np.flatnonzero((dense(ob) != before).any(axis=1)).tolist() == list(range(40))


def no_selection(ob, armature):
    paint(ob, armature)
    ob.data.use_paint_mask_vertex = True
    addon_module("blender.meshes").select_vertices(ob.data, np.zeros(1200, bool))


def locked_groups(ob, armature):
    for name in BONES:
        ob.vertex_groups[name].lock_weight = True


def removed_modifier(ob, armature):
    ob.modifiers.clear()


def cleared(ob, armature):
    for name in BONES:
        ob.vertex_groups.remove(ob.vertex_groups[name])


def points_only(ob, armature):
    weights = dense(ob, ["bone1"])[:, 0].tolist()
    points = [tuple(vertex.co) for vertex in ob.data.vertices]
    ob.data.clear_geometry()
    ob.data.from_pydata(points, [], [])
    ob.vertex_groups.clear()
    ob.vertex_groups.new(name="bone1")
    for number, weight in enumerate(weights):
        ob.vertex_groups["bone1"].add([number], weight, "REPLACE")


def nan(ob, armature):
    ob.data.vertices[17].co.y = math.nan


def nothing(ob, armature):
    ob.data.clear_geometry()


EDITS_REFUSED = {
    no_selection: "no vertex is selected: select those whose weights to change, or turn the mask off",
    locked_groups: "all vertex groups of Tube that move it are locked: unlock some",
    removed_modifier: "Tube has no armature: give it an Armature modifier, or parent it to an armature",
    cleared: "no vertex of Tube has weight in a deforming bone of Rig: make weights first",
    points_only: "Tube has no faces, ",
    nan: "Vertex 17 of Tube is not at a finite position (NaN or infinite): delete it or move it",
    nothing: "Tube has no vertices, so there are no weights to edit",
    shared: "Tube shares its mesh with 1 other object, whose weights would change too; make it single-user first "
    "(Object > Relations > Make Single User > Object & Data)",
}


@pytest.mark.parametrize("operator", ("smooth_weights", "mirror_weights"))
@pytest.mark.parametrize("spoil", EDITS_REFUSED, ids=lambda spoil: spoil.__name__)
def test_what_edits_refuse(spoil, operator):
    ob, armature = make_painted()
    spoil(*((None, ob) if spoil == shared else (ob, armature)))
    before = entries(ob)
    with pytest.raises(RuntimeError) as raised:
        if bpy.context.mode == "OBJECT":
            select(ob)
        getattr(bpy.ops.object, f"sinew_{operator}")()
    assert str(raised.value).strip().removeprefix("Error: ").startswith(EDITS_REFUSED[spoil])
    assert entries(ob) == before


# --- Mirror ---------------------------------------------------------------------------------------

SIDES = ("spine", "arm.L", "arm.R", "Left toe", "Right toe")


def make_symmetric(names=SIDES, remove=()):
    """A ball around the origin with random weights on its positive side, and bones of these names."""
    data = bpy.data.armatures.new("Rig")
    armature = bpy.data.objects.new("Rig", data)
    bpy.context.collection.objects.link(armature)
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    for number, name in enumerate(names):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail = (0, 0, number), (0, 0, number + 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=9)
    ob = bpy.context.active_object
    ob.name = "Ball"
    triangulated(ob)
    random = np.random.default_rng(6)
    for name in ("spine", "arm.L", "Left toe"):
        if name not in ob.vertex_groups:
            ob.vertex_groups.new(name=name)
    for vertex in ob.data.vertices:
        if vertex.co.x > -1e-4:
            for name, weight in zip(("spine", "arm.L", "Left toe"), random.dirichlet(np.ones(3))):
                ob.vertex_groups[name].add([vertex.index], float(weight), "REPLACE")
    armature_of(ob, armature)
    return ob, armature


def test_the_other_side_gets_the_mirrored_weights():
    ob, _ = make_symmetric()
    before = dense(ob, SIDES)
    assert run("mirror_weights", ob) == {"FINISHED"}
    after = dense(ob, SIDES)
    points = np.array([vertex.co for vertex in ob.data.vertices])
    twins = np.array([np.argmin(np.linalg.norm(points - point * (-1, 1, 1), axis=1)) for point in points])
    swapped = [0, 2, 1, 4, 3]
    left, right, middle = points[:, 0] > 1e-4, points[:, 0] < -1e-4, np.abs(points[:, 0]) <= 1e-4
    assert np.array_equal(after[left], before[left])
    assert np.abs(after[right] - before[twins][:, swapped][right]).max() < 1e-5
    assert np.abs(after[middle] - 0.5 * (before[middle] + before[middle][:, swapped])).max() < 1e-6
    assert group_names(ob) == ["spine", "arm.L", "Left toe", "arm.R", "Right toe"]


def test_the_direction_and_the_axis():
    ob, _ = make_symmetric()
    run("mirror_weights", ob)
    expected = dense(ob, SIDES)
    ob.data.transform(Matrix.Rotation(math.pi / 2, 4, "Z"))  # its left is along Y
    right = [vertex.index for vertex in ob.data.vertices if vertex.co.y > 1e-4]
    for group in ob.vertex_groups:
        group.remove(right)
    run("mirror_weights", ob, axis="Y", direction="NEGATIVE")
    swapped = np.abs(dense(ob, SIDES) - expected).max(axis=1)
    assert (swapped < 1e-4).all()


def test_every_vertex_gets_weights_whatever_the_topology():
    ob, _ = make_symmetric()
    select(ob)
    points = np.array([vertex.co for vertex in ob.data.vertices])
    addon_module("blender.meshes").select_vertices(ob.data, points[:, 0] < -0.1)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.subdivide(number_cuts=2)
    bpy.ops.object.mode_set(mode="OBJECT")
    for group in ob.vertex_groups:  # subdividing has interpolated
        group.remove([vertex.index for vertex in ob.data.vertices if vertex.co.x < -1e-4])
    assert run("mirror_weights", ob) == {"FINISHED"}
    weights = dense(ob, SIDES)
    right = np.array([vertex.co.x < -1e-4 for vertex in ob.data.vertices])
    assert right.sum() > 300 and np.allclose(weights.sum(axis=1), 1, atol=1e-5)
    assert not weights[right][:, [1, 3]].any()


def test_a_scaled_object_is_mirrored_alike():
    ob, _ = make_symmetric()
    run("mirror_weights", ob)
    expected = dense(ob, SIDES)
    other, _ = make_symmetric()
    other.matrix_world = places()["negative"] @ Matrix.Translation((5, 0, 0))
    run("mirror_weights", other)
    assert np.array_equal(dense(other, SIDES), expected)


def test_bones_without_the_other_side_are_told():
    ob, _ = make_symmetric(("spine", "arm.L", "Left toe", "Right toe"))
    module = addon_module("weights.editing")
    made = module.Mirroring(ob)
    made.compute()
    report = made.write()
    assert report.unpaired == ("arm.L",) and "1 bone without a bone on the other side (arm.L)" in report.sentence()
    assert "arm.R" not in ob.vertex_groups and np.allclose(dense(ob, SIDES).sum(axis=1), 1, atol=1e-5)


@pytest.mark.parametrize("left, right, is_flipped", SIDE_NAMES)
def test_which_names_blender_flips(left, right, is_flipped):
    assert (bpy.utils.flip_name(left) == right) == is_flipped == (bpy.utils.flip_name(right) == left)


@pytest.mark.parametrize("right", ("mixamorig:RightArm", "mixamorig:RightForeArm"))
def test_sides_that_blender_cannot_flip_are_found_by_place(right):
    """Blender's flip_name knows left and right only at the ends of names, and with a separator in between."""
    names = ("mixamorig:Hips", "mixamorig:LeftArm", right, "mixamorig:LeftHand")
    ob, armature = make_symmetric(names)
    for old, name in zip(("spine", "arm.L", "Left toe"), (names[0], names[1], names[3])):
        ob.vertex_groups[old].name = name
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    for name, x in zip(names, (0, 1, -1, 2)):
        bone = armature.data.edit_bones[name]
        bone.head.x = bone.tail.x = x
        bone.head.z, bone.tail.z = 1, 2
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.utils.flip_name(names[1]) == names[1]
    before = dense(ob, names)
    made = addon_module("weights.editing").Mirroring(ob)
    made.compute()
    report = made.write()
    after = dense(ob, names)
    points = np.array([vertex.co for vertex in ob.data.vertices])
    twins = np.array([np.argmin(np.linalg.norm(points - point * (-1, 1, 1), axis=1)) for point in points])
    is_left, is_right = points[:, 0] > 1e-4, points[:, 0] < -1e-4
    assert np.array_equal(after[is_left], before[is_left])
    assert np.abs(after[is_right] - before[twins][:, [0, 2, 1, 3]][is_right]).max() < 1e-5
    assert report.unpaired == ("mixamorig:LeftHand",)
    assert "1 bone without a bone on the other side (mixamorig:LeftHand)" in report.sentence()


def test_nothing_to_copy_from():
    ob, _ = make_symmetric()
    ob.data.transform(Matrix.Translation((-5, 0, 0)))
    before = entries(ob)
    assert refusal("mirror_weights", ob) == (
        "Ball has no vertices on the positive side of its X axis to copy weights from: choose the other direction, or "
        "move its origin to the middle"
    )
    assert entries(ob) == before


# --- menus ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "menu, draw", (("VIEW3D_MT_object", "draw_object"), ("VIEW3D_MT_paint_weight", "draw_paint")), ids=str
)
def test_the_operators_are_in_blenders_menus(menu, draw):
    assert draw in [function.__name__ for function in getattr(bpy.types, menu)._dyn_ui_initialize()]


def test_a_transfer_that_is_stopped_changes_nothing():
    body, _ = make_body()
    suit = suit_of(body)
    before = entries(suit)
    made = addon_module("weights.transferring").Transfer([body], [suit])
    progress = addon_module("native").sinew_native.Progress()
    progress.cancel()
    assert made.compute(progress) is False and entries(suit) == before


def test_of_several_armatures_the_first_counts_bound_or_not():
    ob, armature = make_body()
    select(ob)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    twin, other = twin_of(ob), make_armature()
    for each in (ob, twin):
        modifier = each.modifiers.new("Other", "ARMATURE")
        modifier.object = other
        assert addon_module("weights.table").armature_of(each) == armature
        select(each)
        bpy.ops.object.modifier_move_to_index(modifier=each.modifiers[-1].name, index=0)
        assert addon_module("weights.table").armature_of(each) == other
