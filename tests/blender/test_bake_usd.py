"""USD: points as Blender shows them, and skeletons that USD's own skinning moves to the same shape."""

import os
import signal
import subprocess
import sys

import bpy
import numpy as np
import pytest

from characters import accelerate, add_shape_keys, make_armature, make_mesh, pose, smoothed
from helpers import addon_module, diagonal, evaluated, needs_memory, select

pytestmark = pytest.mark.usefixtures("usd")
FRAMES = range(1, 8)


@pytest.fixture
def figure():
    """A tube that moves, by an armature of another size that moves as well."""
    armature = make_armature()
    ob = make_mesh(armature, False)
    for frame in (1, 4, 7):
        pose(armature, frame, False)
    armature.location, armature.rotation_euler, armature.scale = (1, 2, 3), (0.3, 0.2, 0.1), (2, 2, 2)
    for frame, angle in ((1, 0.0), (7, 2.0)):
        ob.rotation_euler.x = angle
        ob.keyframe_insert("rotation_euler", frame=frame)
    return ob


def bake(folder, words="1-7", **options):
    frames = addon_module("bake.frame_range").parse(words)
    found = addon_module("bake.job").Job(str(folder), frames, format="usd", **options)
    return addon_module("bake.baking").run(bpy.context, found)


def shown(ob, frames=FRAMES):
    found = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        found.append((evaluated(ob), np.array(ob.matrix_world)))
    return found


def opened(path):
    from pxr import Usd

    return Usd.Stage.Open(str(path))


def world_of(stage, frame):
    from pxr import UsdGeom

    return np.array(UsdGeom.Xformable(stage.GetDefaultPrim()).ComputeLocalToWorldTransform(frame)).T


def assert_points(path, ob, frames=FRAMES):
    from pxr import UsdGeom

    stage = opened(path)
    mesh = UsdGeom.Mesh(stage.GetDefaultPrim())
    for frame, (positions, world) in zip(frames, shown(ob, frames)):
        assert np.array_equal(np.array(mesh.GetPointsAttr().Get(frame)), positions)
        assert np.allclose(world_of(stage, frame), world, atol=1e-6)
    faces = addon_module("blender.meshes").read_faces(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data)
    assert np.array_equal(mesh.GetFaceVertexIndicesAttr().Get(), faces[1])
    assert np.array_equal(mesh.GetFaceVertexCountsAttr().Get(), np.diff(faces[0]))
    return stage, mesh


def skinned(stage, frame):
    """(V, 3): by USD's own skinning, space of the mesh."""
    from pxr import Usd, UsdGeom, UsdSkel, Vt

    root = UsdSkel.Root(stage.GetDefaultPrim())
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.TraverseInstanceProxies())
    (binding,) = cache.ComputeSkelBindings(root, Usd.TraverseInstanceProxies())
    skeleton = cache.GetSkelQuery(binding.GetSkeleton())
    (query,) = binding.GetSkinningTargets()
    points = Vt.Vec3fArray(UsdGeom.Mesh(query.GetPrim()).GetPointsAttr().Get())
    assert query.ComputeSkinnedPoints(skeleton.ComputeSkinningTransforms(frame), points, frame)
    return np.array(points)


def assert_skeleton(path, ob, frames=FRAMES):
    stage = opened(path)
    expected = shown(ob, frames)
    assert np.ptp([positions for positions, _ in expected], axis=0).max() > 0.1
    for frame, (positions, world) in zip(frames, expected):
        assert np.abs(skinned(stage, frame) - positions).max() < 1e-5 * diagonal(positions)
        assert np.allclose(world_of(stage, frame), world, atol=1e-6)
    return stage


@pytest.mark.parametrize("bound", (False, True))
def test_a_linear_character_has_a_skeleton(figure, tmp_path, bound):
    if bound:
        accelerate(figure)
    (done,) = bake(tmp_path)
    assert (done.baked, done.remark) == (7, "skeleton") and os.listdir(tmp_path) == ["Tube.usdc"]
    stage = assert_skeleton(tmp_path / "Tube.usdc", figure)
    from pxr import UsdSkel

    (animation,) = [prim for prim in stage.Traverse() if prim.IsA(UsdSkel.Animation)]
    assert UsdSkel.Animation(animation).GetJointsAttr().Get()[2] == "bone0/bone1/bone2"
    assert stage.GetTimeCodesPerSecond() == 24 and (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (1, 7)


def test_frames_of_a_skeleton_are_small(figure, tmp_path):
    """Of six joints, 34 bytes each, and the place: not of 1,200 points."""
    for frame in (40, 80, 110):
        pose(figure.modifiers["Armature"].object, frame, False)
    sizes = []
    for words in ("1-10", "1-110"):
        (done,) = bake(tmp_path, words, overwrite=True)
        assert done.remark == "skeleton"
        sizes.append(os.path.getsize(tmp_path / "Tube.usdc"))
    assert 6 * 34 < (sizes[1] - sizes[0]) / 100 < 1000


def test_usd_bakes_the_skin_to_the_same_points(figure, tmp_path):
    """Its own tool, which other programs use."""
    from pxr import UsdGeom, UsdSkel

    bake(tmp_path)
    stage = opened(tmp_path / "Tube.usdc")
    assert UsdSkel.BakeSkinning(UsdSkel.Root(stage.GetDefaultPrim()))
    (mesh,) = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    for frame, (positions, _) in zip(FRAMES, shown(figure)):
        assert np.abs(np.array(mesh.GetPointsAttr().Get(frame)) - positions).max() < 1e-5 * diagonal(positions)


def test_vertices_without_a_bone_stay(figure, tmp_path):
    for group in figure.vertex_groups:
        group.remove([0, 7])
    bake(tmp_path)
    assert_skeleton(tmp_path / "Tube.usdc", figure)


def test_names_that_usd_does_not_know(figure, tmp_path):
    figure.name = "1 Röhre"
    for name, other in (("bone0", "a.L"), ("bone1", "a L"), ("side", "Knöchel")):
        figure.modifiers["Armature"].object.data.bones[name].name = other
    (done,) = bake(tmp_path)
    assert done.remark == "skeleton"
    assert_skeleton(tmp_path / "1 Röhre.usdc", figure)


def test_points_when_asked_for(figure, tmp_path):
    (done,) = bake(tmp_path, usd_points=True)
    assert done.remark == "points"
    assert_points(tmp_path / "Tube.usdc", figure)


def add_keys(ob):
    add_shape_keys(ob)


def smooth(ob):
    smoothed(ob, "Smooth", "SMOOTH")


def preserve_volume(ob):
    ob.modifiers["Armature"].use_deform_preserve_volume = True


def mask(ob):
    ob.modifiers["Armature"].vertex_group = "bone2"


def bend(ob):
    ob.modifiers["Armature"].object.data.bones["bone2"].bbone_segments = 4


def scale(ob):
    pose(ob.modifiers["Armature"].object, 4, True)


def flatten(ob):
    bone = ob.modifiers["Armature"].object.pose.bones["bone1"]
    for frame in (1, 4, 7):
        bone.scale = (0, 0, 0)
        bone.keyframe_insert("scale", frame=frame)


@pytest.mark.parametrize(
    "change, reason",
    [
        (add_keys, "shape keys deform it"),
        (smooth, "Smooth deforms it"),
        (preserve_volume, "Armature preserves volume"),
        (mask, "Armature uses more than vertex groups"),
        (bend, "Rig has bones with segments or envelopes that move it"),
        (scale, "on frame 2 a skeleton without scale would be"),
        (flatten, "on frame 1 a bone has a scale of 0"),
        (lambda ob: ob.modifiers.clear(), "its only deformer is not a single Armature modifier"),
    ],
)
def test_points_where_a_skeleton_does_not_say_it_all(figure, tmp_path, change, reason):
    change(figure)
    (done,) = bake(tmp_path, names=("Tube",))
    assert done.remark.startswith(f"points, since {reason}") and os.listdir(tmp_path) == ["Tube.usdc"]
    assert_points(tmp_path / "Tube.usdc", figure)


@needs_memory
def test_subdivision_is_left_to_the_reader(figure, tmp_path):
    expected = shown(figure)
    smoothed(figure, "Sub", "SUBSURF", levels=1)
    (done,) = bake(tmp_path, until_subdivision=True)
    assert (done.remark, done.vertices) == ("skeleton", 1200)
    stage = opened(tmp_path / "Tube.usdc")
    for frame, (positions, _) in zip(FRAMES, expected):
        assert np.abs(skinned(stage, frame) - positions).max() < 1e-5 * diagonal(positions)
    assert stage.GetPrimAtPath("/Tube/mesh").GetAttribute("subdivisionScheme").Get() == "catmullClark"
    (done,) = bake(tmp_path / "all", "1-2")
    assert done.remark.startswith("points, since Sub deforms it;")  # then whether its weights were found
    _, mesh = assert_points(tmp_path / "all" / "Tube.usdc", figure, (1, 2))
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"


def test_several_at_once(figure, tmp_path):
    other = make_mesh(figure.modifiers["Armature"].object, True)
    assert [(done.name, done.remark.split()[0]) for done in bake(tmp_path)] == [
        ("Tube", "skeleton"),
        ("Tube.001", "points,"),
    ]
    assert_skeleton(tmp_path / "Tube.usdc", figure)
    assert_points(tmp_path / "Tube.001.usdc", other)


# --- what goes wrong ------------------------------------------------------------------------------


def test_a_file_that_is_there_stays(figure, tmp_path):
    (tmp_path / "Tube.usdc").write_text("mine")
    with pytest.raises(ValueError, match="Tube.usdc already exists; overwrite it, or choose another folder"):
        bake(tmp_path)
    work = addon_module("bake.baking").steps(
        bpy.context,
        addon_module("bake.job").Job(
            str(tmp_path), addon_module("bake.frame_range").parse("1-7"), format="usd", overwrite=True
        ),
    )
    for _ in range(3):
        next(work)
    work.close()
    assert (tmp_path / "Tube.usdc").read_text() == "mine" and os.listdir(tmp_path) == ["Tube.usdc"]


def test_what_a_dead_process_has_left_goes(figure, tmp_path):
    leftovers = addon_module("bake.leftovers")
    own = leftovers.own_name(f"{tmp_path / 'Tube.usdc'}.part", ".usdc")
    dead = own.replace(str(os.getpid()), "4194399")  # beyond any
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as other:
        living = own.replace(str(os.getpid()), str(other.pid))
        for path in (dead, living):
            with open(path, "w"):
                pass
        bake(tmp_path)
        other.communicate(b"\n")
    assert sorted(os.listdir(tmp_path)) == ["Tube.usdc", os.path.basename(living)]


def test_a_full_disk(figure, tmp_path):
    """The kernel refuses to make a file longer, as it does where there is no room left."""
    resource = pytest.importorskip("resource")  # Windows sets no such limits
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    (tmp_path / "Tube.usdc").write_text("mine")
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, limits[1]))
    try:
        with pytest.raises(OSError, match="writing file: File too large: .*Tube.usdc'$"):
            bake(tmp_path, usd_points=True, overwrite=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert os.listdir(tmp_path) == ["Tube.usdc"] and (tmp_path / "Tube.usdc").read_text() == "mine"


def test_a_folder_that_forbids_it(figure, tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OSError, match="sinew"):
        bake(tmp_path / "file" / "sinew")
    (tmp_path / "file").unlink()
    select(figure)
    (tmp_path / "Tube.usdc").mkdir()
    with pytest.raises(OSError, match="Tube.usdc"):
        bake(tmp_path, overwrite=True)
    assert os.listdir(tmp_path) == ["Tube.usdc"]


def test_without_the_package(figure, tmp_path, monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "pxr"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ValueError, match="USD needs the Python package usd-core.*pip install.*--target .*usd-core"):
        bake(tmp_path)
    assert os.listdir(tmp_path) == []
