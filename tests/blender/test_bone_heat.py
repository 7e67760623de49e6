"""Sinew's weights against Blender's bone heat, where that works: on closed meshes without accidents. With a stiffness
of 4, which is Blender's, both are nearly the same. What remains is Blender's cut below 0.05, its areas, and bones that
it does not see."""

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from characters import make_armature, make_tube
from helpers import BY_WINE, import_rig, select

pytestmark = pytest.mark.skipif(
    BY_WINE and bpy.app.version < (5, 0, 0), reason="Wine 8 lacks a function with which Blender 4.2 solves them"
)
POSES, DEGREES = 10, 35
WORSE = 1.1  # no mesh may be farther from its own weights' shape than this many times Blender's
# Bone: head, tail, radius of the limb, parent.
LIMBS = {
    "spine": ((0, 0, 1.0), (0, 0, 1.3), 0.17, None),
    "chest": ((0, 0, 1.3), (0, 0, 1.6), 0.18, "spine"),
    "head": ((0, 0, 1.65), (0, 0, 1.95), 0.13, "chest"),
}
for _side, _x in (("L", 1), ("R", -1)):
    LIMBS[f"upper_arm.{_side}"] = ((_x * 0.2, 0, 1.55), (_x * 0.5, 0, 1.5), 0.07, "chest")
    LIMBS[f"forearm.{_side}"] = ((_x * 0.5, 0, 1.5), (_x * 0.8, 0, 1.45), 0.06, f"upper_arm.{_side}")
    LIMBS[f"thigh.{_side}"] = ((_x * 0.1, 0, 0.95), (_x * 0.13, -0.02, 0.5), 0.1, "spine")
    LIMBS[f"shin.{_side}"] = ((_x * 0.13, -0.02, 0.5), (_x * 0.15, 0, 0.05), 0.07, f"thigh.{_side}")


def make_figure():
    """A person of LIMBS, melted into one closed surface."""
    data = bpy.data.armatures.new("Rig")
    armature = bpy.data.objects.new("Rig", data)
    bpy.context.collection.objects.link(armature)
    select(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    for name, (head, tail, _radius, parent) in LIMBS.items():
        bone = data.edit_bones.new(name)
        bone.head, bone.tail = head, tail
        bone.parent = data.edit_bones[parent] if parent else None
    bpy.ops.object.mode_set(mode="OBJECT")
    balls = bmesh.new()
    for head, tail, radius, _parent in LIMBS.values():
        for share in np.linspace(0, 1, 9):
            place = Matrix.Translation(Vector(head).lerp(Vector(tail), share))
            bmesh.ops.create_uvsphere(balls, u_segments=16, v_segments=12, radius=radius, matrix=place)
    mesh = bpy.data.meshes.new("Figure")
    balls.to_mesh(mesh)
    balls.free()
    ob = bpy.data.objects.new("Figure", mesh)
    bpy.context.collection.objects.link(ob)
    select(ob)
    melt = ob.modifiers.new("Melt", "REMESH")
    melt.mode, melt.voxel_size = "VOXEL", 0.03
    ob.modifiers.new("Smooth", "SMOOTH").iterations = 5
    for name in ("Melt", "Smooth"):
        bpy.ops.object.modifier_apply(modifier=name)
    return ob, armature


def make_closed_tube():
    armature = make_armature()
    ob = make_tube()
    select(ob)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.fill_holes(sides=0)
    bpy.ops.object.mode_set(mode="OBJECT")
    return ob, armature


def imported(name):
    """The largest part of a rig's mesh, with the weights of its file."""
    ob, armature = import_rig(name, source="ARMATURE", pose="")
    bpy.ops.object.sinew_unbind()
    mesh = bmesh.new()
    mesh.from_mesh(ob.data)
    parts, seen = [], set()
    for vertex in mesh.verts:
        if vertex in seen:
            continue
        part = [vertex]
        seen.add(vertex)
        for own in part:
            others = {edge.other_vert(own) for edge in own.link_edges} - seen
            seen |= others
            part += others
        parts.append(part)
    rest = seen - set(max(parts, key=len))
    bmesh.ops.delete(mesh, geom=list(rest))
    mesh.to_mesh(ob.data)
    mesh.free()
    return ob, armature


FIGURES = {
    "figure": make_figure,
    "tube": make_closed_tube,
    "capsule": lambda: imported("capsule"),
    "ogre": lambda: imported("ogre"),
}


def bones_of(armature):
    return [bone.name for bone in armature.data.bones if bone.use_deform]


def normalized(ob, names):
    """(V, names): the weights, divided by their sum; zeros where there are none."""
    columns = {ob.vertex_groups[name].index: i for i, name in enumerate(names) if name in ob.vertex_groups}
    found = np.zeros((len(ob.data.vertices), len(names)))
    for vertex in ob.data.vertices:
        for entry in vertex.groups:
            if entry.group in columns:
                found[vertex.index, columns[entry.group]] = entry.weight
    sums = found.sum(axis=1, keepdims=True)
    return np.divide(found, sums, out=found, where=sums > 0)


def made_by(operator, ob, armature, **settings):
    place = ob.matrix_world.copy()
    ob.parent = None
    ob.matrix_world = place
    ob.modifiers.clear()
    ob.vertex_groups.clear()
    bpy.context.view_layer.update()
    select(armature, ob)
    operator(**settings)
    return normalized(ob, bones_of(armature))


def by_blender(ob, armature):
    weights = made_by(bpy.ops.object.parent_set, ob, armature, type="ARMATURE_AUTO")
    assert np.allclose(weights.sum(axis=1), 1), "Blender's bone heat does not work here: compare another mesh"
    return weights


def by_sinew(ob, armature, stiffness):
    return made_by(bpy.ops.object.sinew_parent_with_weights, ob, armature, stiffness=stiffness)


def random_poses(armature, names):
    """Skinning matrices (POSES, names, 4, 4): each bone turns about its head, with its children."""
    random = np.random.default_rng(1)
    poses = []
    for _ in range(POSES):
        of = {}
        for bone in armature.data.bones:
            head = Matrix.Translation(armature.matrix_world @ bone.head_local)
            turn = Matrix.Rotation(np.radians(DEGREES) * random.random(), 4, Vector(random.normal(size=3)))
            own = head @ turn @ head.inverted()
            of[bone.name] = of[bone.parent.name] @ own if bone.parent else own
        poses.append([of[name] for name in names])
    return np.array(poses)


def posed(weights, ob, matrices):
    """(POSES, V, 3)."""
    rest = np.array([ob.matrix_world @ vertex.co for vertex in ob.data.vertices])
    by_bone = np.einsum("fbij,vj->fbvi", matrices[..., :3, :3], rest) + matrices[:, :, None, :3, 3]
    return np.einsum("vb,fbvi->fvi", weights, by_bone)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("name", "most"), [("figure", 0.05), ("tube", 0.05), ("capsule", 0.03), ("ogre", 0.12)])
def test_weights_are_blenders_at_its_stiffness(name, most):
    ob, armature = FIGURES[name]()
    blenders = by_blender(ob, armature)

    def difference(stiffness):
        return 0.5 * np.abs(by_sinew(ob, armature, stiffness) - blenders).sum(axis=1).mean()

    same, softer = difference(4.0), difference(1.0)
    assert same < most and 2 * same < softer


# The capsule's weights are B-splines, softer than those of the default stiffness.
@pytest.mark.sampled(3)
@pytest.mark.parametrize(("name", "stiffness"), [("capsule", 4.0), ("ogre", 4.0), ("ogre", 8.0)])
def test_shapes_in_poses_are_as_near_as_blenders_to_those_of_the_files_weights(name, stiffness):
    ob, armature = FIGURES[name]()
    names = bones_of(armature)
    matrices = random_poses(armature, names)
    expected = posed(normalized(ob, names), ob, matrices)

    def distance(weights):
        return np.linalg.norm(posed(weights, ob, matrices) - expected, axis=2).mean()

    assert distance(by_sinew(ob, armature, stiffness)) < WORSE * distance(by_blender(ob, armature))
