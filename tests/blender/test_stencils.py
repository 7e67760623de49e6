"""Bakes that compute the last modifiers natively: the shapes are Blender's, whatever the mesh and the settings are, and
what cannot be computed is left to Blender, with the reason."""

import bmesh
import bpy
import numpy as np
import pytest

from characters import accelerate, make_armature, make_mesh, pose
from helpers import addon_module, diagonal, needs_memory
from test_bake import bake, read, shown

FRAMES = range(1, 7)
TOLERANCE = 2e-6  # of the diagonal


def subdivision(**settings):
    return "SUBSURF", {"levels": 1, **settings}


def mirror(**settings):
    return "MIRROR", {"use_mirror_merge": False, **settings}


def array(**settings):
    offset = {"use_relative_offset": False, "use_constant_offset": True, "constant_offset_displace": (0.3, 70, -2)}
    return "ARRAY", {**offset, **settings}


TAILS = {
    "smooth": [subdivision()],
    "twice": [subdivision(levels=2)],
    "without limit": [subdivision(use_limit_surface=False)],
    "simple": [subdivision(subdivision_type="SIMPLE", levels=2)],
    "without creases": [subdivision(use_creases=False)],
    "corners": [subdivision(boundary_smooth="PRESERVE_CORNERS")],
    "quality": [subdivision(quality=1)],
    "two": [subdivision(), subdivision(subdivision_type="SIMPLE")],
    "masked": [("MASK", {"vertex_group": "side"}), subdivision()],
    "masked softly": [("MASK", {"vertex_group": "side", "use_smooth": True, "threshold": 0.3}), subdivision()],
    "masked behind": [subdivision(), ("MASK", {"vertex_group": "side", "invert_vertex_group": True})],
    "split": [("EDGE_SPLIT", {"use_edge_angle": False}), subdivision()],
    "only split": [("EDGE_SPLIT", {"use_edge_angle": False})],
    "cut": [subdivision(), ("TRIANGULATE", {"quad_method": "FIXED"})],
    "mirrored": [mirror(), subdivision()],
    "mirrored twice": [subdivision(), mirror(use_axis=(True, True, False))],
    "in a row": [subdivision(), array(count=3)],
    "mirrored and in a row": [mirror(), subdivision(), ("MASK", {"vertex_group": "side"}), array()],
}


def make_rough(ob):
    """Creases, sharp edges, a hole, triangles, a face with many corners, loose edges and vertices."""
    mesh = bmesh.new()
    mesh.from_mesh(ob.data)
    mesh.faces.ensure_lookup_table()
    rng = np.random.default_rng(3)
    bmesh.ops.triangulate(mesh, faces=[face for face in mesh.faces if rng.random() < 0.06])
    inner = [edge for edge in mesh.edges if len(edge.link_faces) == 2 and rng.random() < 0.04]
    bmesh.ops.dissolve_edges(mesh, edges=inner, use_verts=False, use_face_split=False)
    bmesh.ops.delete(mesh, geom=[face for face in mesh.faces if rng.random() < 0.02], context="FACES_ONLY")
    creases = (
        mesh.edges.layers.float.new("crease_edge") if bpy.app.version >= (4, 0, 0) else mesh.edges.layers.crease.new()
    )
    for edge in mesh.edges:
        edge[creases] = rng.choice((0.0, 0.0, 0.0, 1.0, rng.random()))
        edge.smooth = rng.random() > 0.1
    for number in range(4):
        ends = [mesh.verts.new((number, 1, 1)), mesh.verts.new((number, 2, 1))]
        if number % 2:
            mesh.edges.new(ends)
    mesh.to_mesh(ob.data)
    mesh.free()


def add_modifiers(ob, tail):
    for kind, settings in tail:
        modifier = ob.modifiers.new(kind, kind)
        for name, value in settings.items():
            if hasattr(modifier, name):  # newer Blenders have more
                setattr(modifier, name, bpy.data.objects.new(value, None) if value == "Other" else value)


@pytest.fixture
def plain():
    """A tube of quads by an armature that moves."""
    armature = make_armature()
    for frame in (1, 3, 6):
        pose(armature, frame, True)
    return make_mesh(armature, False)


@pytest.fixture
def figure(plain):
    """The same, rough."""
    make_rough(plain)
    return plain


@pytest.fixture
def always(monkeypatch):
    """The search is worth it however few frames there are."""
    monkeypatch.setattr(addon_module("bake.evaluation"), "PAYS", 0.001)


def leftovers():
    return [each.name for each in (*bpy.data.scenes, *bpy.data.objects, *bpy.data.meshes) if "Stencils" in each.name]


def assert_baked(ob, folder, remark, **options):
    switches = [(modifier.name, modifier.show_viewport) for modifier in ob.modifiers]
    (done,) = bake(folder, "1-6", **options)
    assert remark in done.remark
    assert [(modifier.name, modifier.show_viewport) for modifier in ob.modifiers] == switches
    assert leftovers() == []
    found, expected = read(folder / "Tube.pc2"), shown(ob, FRAMES)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() <= TOLERANCE * diagonal(expected[0]) and np.ptp(found, axis=0).max() > 0.1
    return found, expected


@needs_memory
@pytest.mark.sampled(3)
@pytest.mark.parametrize("tail, bound", [(tail, bool(i % 2)) for i, tail in enumerate(TAILS)] + [("smooth", True)])
def test_shapes_are_blenders(figure, tmp_path, always, tail, bound):
    add_modifiers(figure, TAILS[tail])
    if bound:
        accelerate(figure)
    assert_baked(figure, tmp_path, "computed natively")


@needs_memory
def test_few_frames_are_blenders_to_the_bit(figure, tmp_path):
    add_modifiers(figure, TAILS["smooth"])
    found, expected = assert_baked(figure, tmp_path, "evaluated by Blender, since it would take longer")
    assert np.array_equal(found, expected)


@pytest.mark.parametrize(
    "tail",
    (
        [("MASK", {"mode": "ARMATURE"}), ("EDGE_SPLIT", {"use_edge_angle": True})],
        [subdivision(), ("SOLIDIFY", {})],
        [subdivision(), ("EDGE_SPLIT", {"use_edge_angle": True})],
        [subdivision(), ("TRIANGULATE", {"quad_method": "BEAUTY"})],
        [("MASK", {"vertex_group": "side"})],
        [subdivision(), ("MIRROR", {})],
        [subdivision(), mirror(use_bisect_axis=(False, True, False))],
        [subdivision(), ("ARRAY", {})],
        [subdivision(), array(use_merge_vertices=True)],
        [subdivision(), array(fit_type="FIT_LENGTH")],
        [subdivision(), array(use_object_offset=True)],
        [subdivision(), array(offset_object="Other")],
        [mirror(mirror_object="Other")],
    ),
    ids=lambda tail: "-".join(kind for kind, _ in tail),
)
def test_other_tails_are_blenders(figure, tail):
    add_modifiers(figure, tail)
    assert addon_module("plan.tails").of(figure) == []


def test_an_animated_setting_is_blenders(figure, tmp_path, always):
    add_modifiers(figure, TAILS["smooth"])
    figure.modifiers[-1].keyframe_insert("levels", frame=1)
    (done,) = bake(tmp_path, "1-6")
    assert done.remark == ""


@needs_memory
def test_cut_faces_with_many_corners_are_blenders(plain, tmp_path, always):
    mesh = bmesh.new()
    mesh.from_mesh(plain.data)
    mesh.edges.ensure_lookup_table()
    bmesh.ops.dissolve_edges(
        mesh, edges=[edge for edge in mesh.edges if len(edge.link_faces) == 2][:1], use_verts=False
    )
    mesh.to_mesh(plain.data)
    mesh.free()
    add_modifiers(plain, [("TRIANGULATE", {"quad_method": "FIXED"}), subdivision()])
    assert_baked(plain, tmp_path, "Triangulate cuts faces with more than four corners by their shape")


@needs_memory
def test_other_faces_of_as_many_vertices_are_blenders(plain, tmp_path, always):
    """A Triangulate before them cuts quads in another way from frame 4 on."""
    cut = plain.modifiers.new("Triangulate", "TRIANGULATE")
    for frame, method in ((1, "FIXED"), (3, "FIXED"), (4, "FIXED_ALTERNATE")):
        cut.quad_method = method
        cut.keyframe_insert("quad_method", frame=frame)
    add_modifiers(plain, TAILS["smooth"])
    assert_baked(plain, tmp_path, "computed natively up to frame 4, where its faces change")


def test_faces_that_change_on_the_way_are_blenders(figure, tmp_path, always):
    """A Weld before them joins other vertices from some frame on."""
    figure.modifiers.new("Weld", "WELD").merge_threshold = 1e-6
    add_modifiers(figure, TAILS["smooth"])
    figure.modifiers["Weld"].keyframe_insert("merge_threshold", frame=3)
    figure.modifiers["Weld"].merge_threshold = 0.05
    figure.modifiers["Weld"].keyframe_insert("merge_threshold", frame=4)
    with pytest.raises(ValueError, match="vertices on frame"):
        bake(tmp_path, "1-6")
    assert all(modifier.show_viewport for modifier in figure.modifiers) and leftovers() == []


@needs_memory
@pytest.mark.parametrize("bound", (False, True))
def test_a_mesh_that_another_one_follows_is_blenders(figure, tmp_path, always, bound):
    """The other one would follow the shape before the modifiers."""
    add_modifiers(figure, TAILS["smooth"])
    bpy.ops.mesh.primitive_plane_add()
    coat = bpy.context.object
    coat.name = "Coat"
    coat.modifiers.new("Shrinkwrap", "SHRINKWRAP").target = figure
    if bound:
        accelerate(figure)
    done = bake(tmp_path, "1-6", names=("Tube", "Coat"))
    assert [each.remark for each in done] == ["SUBSURF evaluated by Blender, since Coat may follow its shape", ""]
    assert np.array_equal(read(tmp_path / "Coat.pc2"), shown(coat, FRAMES))


@needs_memory
def test_a_mesh_whose_collection_is_read_is_blenders(figure, tmp_path, always):
    add_modifiers(figure, TAILS["smooth"])
    outer, inner = bpy.data.collections.new("Outer"), bpy.data.collections.new("Inner")
    outer.children.link(inner)
    inner.objects.link(figure)
    assert addon_module("plan.tails").reader_of(figure) is None
    crowd = bpy.data.objects.new("Crowd", None)
    crowd.instance_type, crowd.instance_collection = "COLLECTION", outer
    assert_baked(figure, tmp_path, "evaluated by Blender, since Crowd may follow its shape")


@needs_memory
@pytest.mark.parametrize("spoil", ("empty", "infinite"))
def test_bad_meshes_are_blenders(figure, tmp_path, always, spoil):
    add_modifiers(figure, TAILS["smooth"])
    if spoil == "empty":
        figure.data.clear_geometry()
    else:
        figure.data.vertices[5].co = (np.nan, 0, 0)
    (done,) = bake(tmp_path, "1-6")
    assert "evaluated by Blender, since" in done.remark and leftovers() == []


@needs_memory
def test_what_is_wrong_is_noticed(figure, tmp_path, always, monkeypatch):
    """The comparison is there for what nobody has thought of."""
    probing = addon_module("stencils.probing")
    assembled = probing._assembled

    def changed(rows, vertices, weights, *sizes):
        one, other = np.flatnonzero(rows == rows[0])[:2]
        weights[[one, other]] += 1e-4, -1e-4
        return assembled(rows, vertices, weights, *sizes)

    monkeypatch.setattr(probing, "_assembled", changed)
    add_modifiers(figure, TAILS["smooth"])
    assert_baked(figure, tmp_path, "evaluated by Blender, since it was off by")


def test_a_bake_that_is_closed_early_leaves_nothing(figure, tmp_path, always):
    add_modifiers(figure, TAILS["smooth"])
    baking, job = addon_module("bake.baking"), addon_module("bake.job")
    frames = addon_module("bake.frame_range").parse("1-6")
    for steps in range(1, 40, 5):
        work = baking.steps(bpy.context, job.Job(str(tmp_path / str(steps)), frames))
        for _ in zip(range(steps), work):
            pass
        work.close()
        assert all(modifier.show_viewport for modifier in figure.modifiers) and leftovers() == []


@pytest.mark.parametrize("is_forgotten", [False, True], ids=["closed", "left over"])
def test_whoever_deletes_all_scenes_meanwhile_keeps_an_empty_one(figure, is_forgotten):
    """Blender does not let go of the last scene."""
    add_modifiers(figure, TAILS["smooth"])
    probing = addon_module("stencils.probing")
    canvas = probing.Canvas(figure, figure.modifiers[:], bpy.context.scene.render, figure.data.copy)
    assert len(canvas.mesh.vertices) > 0
    for scene in [each for each in bpy.data.scenes if not each.name.startswith(probing.NAME)]:
        bpy.data.scenes.remove(scene)
    (probing.remove_leftovers if is_forgotten else canvas.close)()
    (scene,) = bpy.data.scenes
    assert (scene.name, len(scene.objects), leftovers()) == ("Scene", 0, [])
