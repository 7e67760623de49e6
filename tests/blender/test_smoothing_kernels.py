"""The module's CorrectiveSmooth, Smooth and Hook, given what Blender's modifiers get: the same shape as theirs."""

import itertools

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from helpers import addon_module, diagonal, evaluated, select

BEFORE_41 = bpy.app.version < (4, 1, 0)
# Of the diagonal. To the bit, but for the arc cosine; a hook's matrix is multiplied in another order.
CORRECTIVE = 2e-7 if BEFORE_41 else 0
SMOOTH = 0
HOOK = 5e-7


def native():
    return addon_module("native").sinew_native


def monkey(mesh):
    bmesh.ops.create_monkey(mesh)


def sheet(mesh):
    """Quads, triangles, holes, faces of many corners, wires, vertices that hang on nothing."""
    random = np.random.default_rng(3)
    bmesh.ops.create_grid(mesh, x_segments=22, y_segments=17, size=1)
    faces = list(mesh.faces)
    random.shuffle(faces)
    bmesh.ops.triangulate(mesh, faces=faces[:90])
    bmesh.ops.delete(mesh, geom=faces[90:110], context="FACES_ONLY")
    bmesh.ops.dissolve_verts(mesh, verts=[v for v in mesh.verts if not v.is_boundary and v.is_valid][5:60:7])
    wires = [mesh.verts.new(random.uniform(-1, 1, 3)) for _ in range(5)]
    for a, b in zip(wires, wires[1:-1]):  # the last one alone
        mesh.edges.new((a, b))
    for vert in mesh.verts:
        vert.co += type(vert.co)(random.uniform(-0.03, 0.03, 3))


def straight(mesh):
    """A flat grid with vertices in the middle of its edges, so that their corners are straight."""
    bmesh.ops.create_grid(mesh, x_segments=9, y_segments=8, size=1)
    for edge in list(mesh.edges)[::2]:
        bmesh.utils.edge_split(edge, edge.verts[0], 0.5)


def poles(mesh):
    """A sphere with two vertices of 60 triangles, and three faces on one edge."""
    bmesh.ops.create_uvsphere(mesh, u_segments=60, v_segments=12, radius=1)
    mesh.edges.ensure_lookup_table()
    mesh.faces.new((*mesh.edges[0].verts, mesh.verts.new((0, 2, 0))))


MESHES = (monkey, sheet, straight, poles)


@pytest.fixture(params=MESHES, ids=lambda make: make.__name__)
def ob(request, fresh_scene):
    """With a key that bends it: the modifiers' input is not their rest shape. And with a group."""
    built = bmesh.new()
    request.param(built)
    mesh = bpy.data.meshes.new("mesh")
    built.to_mesh(mesh)
    built.free()
    ob = bpy.data.objects.new("mesh", mesh)
    bpy.context.collection.objects.link(ob)
    random = np.random.default_rng(4)
    ob.shape_key_add(name="Basis")
    key = ob.shape_key_add(name="bent")
    rest = own_positions(mesh)
    bent = rest + 0.1 * np.sin(3 * rest[:, [1, 2, 0]]) + random.uniform(-0.02, 0.02, rest.shape)
    key.data.foreach_set("co", bent.astype(np.float32).ravel())
    key.value = 1
    group = ob.vertex_groups.new(name="group")
    for v in range(len(rest)):
        if v % 3:
            group.add([v], random.uniform(), "REPLACE")
    select(ob)
    return ob


def own_positions(mesh):
    positions = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", positions)
    return positions.reshape(-1, 3)


def numbers(collection, name, width=1):
    out = np.empty(width * len(collection), np.int32)
    collection.foreach_get(name, out)
    return out.reshape(-1, width) if width > 1 else out


def topology(mesh):
    offsets = np.append(numbers(mesh.polygons, "loop_start"), len(mesh.loops))
    return native().Topology(
        len(mesh.vertices), numbers(mesh.edges, "vertices", 2), offsets, numbers(mesh.loops, "vertex_index")
    )


def weights(ob):
    """Of the one group that there is."""
    return np.array([v.groups[0].weight if v.groups else 0 for v in ob.data.vertices], np.float32)


def group_of(ob, modifier):
    if not modifier.vertex_group:
        return {}
    return {"weights": weights(ob), "invert": modifier.invert_vertex_group}


def shapes(ob, modifier):
    """(what the modifier gets, what it makes of it)."""
    modifier.show_viewport = False
    before = evaluated(ob)
    modifier.show_viewport = True
    return before, evaluated(ob)


def error(ours, theirs):
    return np.abs(ours - theirs).max() / diagonal(theirs)


def set_all(modifier, settings):
    for name, value in settings.items():
        setattr(modifier, name, value)


def combinations(**choices):
    return [dict(zip(choices, values)) for values in itertools.product(*choices.values())]


GROUPS = [{}, {"vertex_group": "group"}, {"vertex_group": "group", "invert_vertex_group": True}]
AMOUNTS = [
    {"factor": 0.5, "iterations": 5},
    {"factor": 0.9, "iterations": 1, "scale": 0.4},
    {"factor": -0.1, "iterations": 3, "scale": -1.5},
    {"factor": 1.2, "iterations": 2},
    {"factor": 0.5, "iterations": 0},
    {"factor": 0.0, "iterations": 4},
]


def corrective(ob, modifier, rest):
    smooth = native().CorrectiveSmooth(
        topology(ob.data),
        rest,
        pin_boundary=modifier.use_pin_boundary,
        corner_angle="arc_cosine" if BEFORE_41 else "polynomial",
        **group_of(ob, modifier),
    )
    return smooth.stage(
        modifier.factor,
        modifier.iterations,
        modifier.scale,
        {"SIMPLE": "simple", "LENGTH_WEIGHTED": "length_weighted"}[modifier.smooth_type],
        modifier.use_only_smooth,
    )


@pytest.mark.parametrize("smooth_type", ("SIMPLE", "LENGTH_WEIGHTED"))
def test_corrective_smooth(ob, smooth_type):
    moved = 0
    for group, amounts, switches in itertools.product(
        GROUPS, AMOUNTS, combinations(use_pin_boundary=[False, True], use_only_smooth=[False, True])
    ):
        modifier = ob.modifiers.new("Smooth", "CORRECTIVE_SMOOTH")
        modifier.smooth_type = smooth_type
        set_all(modifier, {**group, **amounts, **switches})
        own, theirs = shapes(ob, modifier)
        moved = max(moved, error(own, theirs))
        corrective(ob, modifier, own_positions(ob.data)).apply(own)
        assert error(own, theirs) <= CORRECTIVE, (group, amounts, switches)
        ob.modifiers.remove(modifier)
    assert moved > 1e-3


def test_corrective_smooth_bound_elsewhere(ob):
    key = ob.data.shape_keys.key_blocks["bent"]
    modifier = ob.modifiers.new("Smooth", "CORRECTIVE_SMOOTH")
    modifier.rest_source = "BIND"
    key.value = 0.4
    modifier.show_viewport = False
    bound = evaluated(ob)
    modifier.show_viewport = True
    bpy.ops.object.correctivesmooth_bind(modifier="Smooth")
    bpy.context.view_layer.update()
    assert modifier.is_bind
    key.value = 1
    own, theirs = shapes(ob, modifier)
    unlike = own.copy()
    corrective(ob, modifier, bound).apply(own)
    assert error(own, theirs) <= CORRECTIVE
    corrective(ob, modifier, own_positions(ob.data)).apply(unlike)
    assert error(unlike, theirs) > 1e-3


def test_smooth(ob):
    for group, amounts, axes in itertools.product(
        GROUPS, AMOUNTS, ({}, {"use_y": False}, {"use_x": False, "use_z": False})
    ):
        modifier = ob.modifiers.new("Smooth", "SMOOTH")
        set_all(modifier, {**group, **axes, "factor": amounts["factor"], "iterations": amounts["iterations"]})
        own, theirs = shapes(ob, modifier)
        if BEFORE_41 and group and modifier.factor < 0:  # it does nothing then
            assert (own == theirs).all()
        else:
            native().Smooth(topology(ob.data), **group_of(ob, modifier)).stage(
                modifier.factor, modifier.iterations, modifier.use_x, modifier.use_y, modifier.use_z
            ).apply(own)
        assert error(own, theirs) <= SMOOTH, (group, amounts, axes)
        ob.modifiers.remove(modifier)


FALLOFFS = ("NONE", "SMOOTH", "SPHERE", "ROOT", "INVERSE_SQUARE", "SHARP", "LINEAR", "CONSTANT")


@pytest.mark.parametrize("falloff", FALLOFFS)
def test_hook(ob, falloff):
    target = bpy.data.objects.new("target", None)
    bpy.context.collection.objects.link(target)
    ob.matrix_world = Matrix.Translation((1, 2, 3)) @ Euler((0.3, 0.8, -1)).to_matrix().to_4x4()
    target.matrix_world = Matrix.Translation((1.3, 2.1, 3)) @ Matrix.Diagonal((1, 1.2, 0.8, 1))
    named = list(range(0, len(ob.data.vertices), 2))
    for group, vertices, uniform, radius in itertools.product(GROUPS, (None, named), (False, True), (1.3, 0)):
        modifier = ob.modifiers.new("Hook", "HOOK")
        modifier.object = target
        modifier.matrix_inverse = Euler((0.2, -0.1, 0.4)).to_matrix().to_4x4() @ Matrix.Diagonal((1, 1.5, 1, 1))
        if vertices:
            modifier.vertex_indices_set(vertices)
        modifier.center = (0.1, 0.2, 0)
        set_all(
            modifier,
            {
                **group,
                "falloff_type": falloff,
                "falloff_radius": radius,
                "strength": 0.8,
                "use_falloff_uniform": uniform,
            },
        )
        own, theirs = shapes(ob, modifier)
        assert (error(own, theirs) > 1e-3) == bool(group or vertices)
        matrix = ob.matrix_world.inverted() @ target.matrix_world @ modifier.matrix_inverse
        hook = native().Hook(len(own), None if vertices is None else np.array(vertices), **group_of(ob, modifier))
        hook.stage(
            np.array(matrix),
            modifier.strength,
            falloff.lower(),
            modifier.falloff_radius,
            tuple(modifier.center),
            np.array(modifier.matrix_inverse)[:3, :3] if uniform else None,
        ).apply(own)
        assert error(own, theirs) <= HOOK, (group, vertices is None, uniform, radius)
        ob.modifiers.remove(modifier)


def test_one_after_the_other(ob):
    """Keys and three stages in one call."""
    keys = ob.data.shape_keys.key_blocks
    positions = []
    for key in keys:
        positions.append(np.empty(3 * len(ob.data.vertices), np.float32))
        key.data.foreach_get("co", positions[-1])
    ob.modifiers.new("Smooth", "SMOOTH").vertex_group = "group"
    first = ob.modifiers.new("Corrective", "CORRECTIVE_SMOOTH")
    second = ob.modifiers.new("Corrective again", "CORRECTIVE_SMOOTH")
    second.vertex_group, second.smooth_type = "group", "LENGTH_WEIGHTED"
    module, mesh = native(), topology(ob.data)
    stages = [
        module.Smooth(mesh, weights(ob)).stage(),
        *(corrective(ob, modifier, own_positions(ob.data)) for modifier in (first, second)),
    ]
    deformer = module.Deformer(keys=module.ShapeKeys([p.reshape(-1, 3) for p in positions], [0, 0]))
    own = np.empty((len(ob.data.vertices), 3), np.float32)
    for value in (1, 0.3):
        keys["bent"].value = value
        deformer.deform([], own, np.array([0, value], np.float32), stages=stages)
        assert error(own, evaluated(ob)) <= CORRECTIVE
