"""read_dmat, write_dmat, read_skeleton, write_skeleton, read_rig, write_rig and their objects.

Which messages bad files get is proved in tests/native; here, that they arrive as ValueError and name
the file."""

import gc
import os
import sys

import numpy as np
import pytest
import sinew_native as sinew

import rigs
from test_skeleton import said


def rig_folder(path, skeleton="-1 -1 0 0 0\n0 0 1 0 0\n1 1 1 0 0\n"):
    """A triangle on two bones."""
    path.mkdir(exist_ok=True)
    texts = {
        "mesh.obj": "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl green skin\nf 1 2 3\n",
        "skeleton.bf": skeleton,
        "weights.dmat": "2 3\n1 0.5 0\n0 0.5 1\n",
        "pose.dmat": "2 9\n0 0 0 0 0 0 0 0 0\n0 0 0 0 0 90 0 0 0\n",
    }
    for name, text in texts.items():
        (path / name).write_text(text, "utf-8")
    return path


def animated_rig(folder):
    rig = sinew.read_rig(rig_folder(folder))
    animation = rigs.random_matrices(np.random.default_rng(5), 4, 3)
    animation[:, 0] = np.eye(4)  # the root has no column
    return sinew.Rig(
        rig.positions,
        rig.face_offsets,
        rig.face_vertices,
        rig.skeleton,
        rig.weights,
        rig.poses,
        animation,
        rig.face_materials,
        rig.material_names,
        rig.material_library,
    )


# --- .dmat ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("shape", [(5, 3), (1, 1), (0, 4), (4, 0), (0, 0)])
def test_dmat_round_trip(tmp_path, binary, shape):
    array = np.random.default_rng(1).normal(size=shape) * 10.0 ** np.arange(-150, -150 + shape[1])
    sinew.write_dmat(tmp_path / "a.dmat", array, binary)
    back = sinew.read_dmat(tmp_path / "a.dmat")
    assert back.dtype == np.float64 and back.shape == shape
    assert back.tobytes() == array.tobytes()


def test_dmat_text_by_default_and_by_name(tmp_path):
    sinew.write_dmat(path=tmp_path / "a.dmat", array=np.array([[1, 2.5], [3, 4]]))
    assert (tmp_path / "a.dmat").read_text() == "2 2\n1\n3\n2.5\n4\n"
    sinew.write_dmat(tmp_path / "a.dmat", np.array([[1.0]]), binary=True)
    assert (tmp_path / "a.dmat").read_bytes() == b"0 0\n1 1\n" + np.array([1.0]).tobytes()


@pytest.mark.parametrize(
    "array",
    [np.arange(6).reshape(2, 3), np.arange(6.0).reshape(3, 2).T, np.arange(12, dtype=np.float32).reshape(2, 6)[:, ::2]],
)
def test_dmat_of_any_reals_and_strides(tmp_path, array):
    sinew.write_dmat(tmp_path / "a.dmat", array)
    assert np.array_equal(sinew.read_dmat(tmp_path / "a.dmat"), array)


def test_what_read_dmat_returns_is_the_callers(tmp_path):
    (tmp_path / "a.dmat").write_text("1 2\n1 2")
    array = sinew.read_dmat(tmp_path / "a.dmat")
    array[0] = 7
    assert array.tolist() == [[7], [2]]


@pytest.mark.parametrize("kind", [str, os.fsencode, lambda path: path])
def test_paths_of_every_kind(tmp_path, kind):
    path = kind(tmp_path / "größe.dmat")
    sinew.write_dmat(path, np.eye(2))
    assert np.array_equal(sinew.read_dmat(path), np.eye(2))


def test_dmat_refuses_what_is_wrong(tmp_path):
    path = tmp_path / "a.dmat"
    assert said(sinew.read_dmat, path) == f"there is no file {path}"
    assert said(sinew.read_dmat, tmp_path) == f"{tmp_path} is a folder; expected a file"
    path.write_text("")
    assert said(sinew.read_dmat, path) == "a.dmat is empty; expected a first line `columns rows`"
    path.write_text("2 2\n1 2 3 x")
    assert said(sinew.read_dmat, path) == 'a.dmat, row 1, column 1: expected a finite number, found "x"'
    path.write_bytes(b"0 0\n25000 50000\n" + bytes(4))  # 10 GB in 20 bytes
    assert (
        said(sinew.read_dmat, path) == "a.dmat ends after 0 numbers; its header promises 25,000 columns x 50,000 rows"
    )
    path.write_text("old")
    assert (
        said(sinew.write_dmat, path, np.array([[1, np.nan]]))
        == "row 0, column 1 of the matrix for a.dmat is not finite"
    )
    assert said(sinew.write_dmat, path, np.zeros(3)) == "array has shape (3,); expected (rows, columns)"
    assert said(sinew.write_dmat, path, np.array([["a"]])) == "array is <U1; expected real numbers"
    assert path.read_text() == "old"
    assert (
        said(sinew.write_dmat, tmp_path / "none" / "a.dmat", np.eye(2))
        == f"{tmp_path / 'none' / 'a.dmat'} cannot be written: No such file or directory"
    )
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.dmat"]


# --- skeletons ------------------------------------------------------------------------------------


def test_read_skeleton(tmp_path):
    path = tmp_path / "a.bf"
    path.write_text("-1 -1 0 0 1 hip\n0 0 0 0 2 knee\n")
    skeleton = sinew.read_skeleton(path)
    assert isinstance(skeleton, sinew.RigSkeleton) and isinstance(skeleton, sinew.Skeleton)
    assert skeleton.convention == "bone" and skeleton.names == ["hip", "knee"]
    assert skeleton.parents.tolist() == [-1, 0] and skeleton.weight_columns.tolist() == [-1, 0]
    assert skeleton.weight_columns.dtype == np.int32
    assert skeleton.heads.dtype == np.float64 and skeleton.heads.tolist() == [[0, 0, 1], [0, 0, 1]]
    assert skeleton.tails.dtype == np.float64 and skeleton.tails.tolist() == [[0, 0, 1], [0, 0, 3]]
    joints = sinew.read_skeleton(path, convention="joint")
    assert joints.convention == "joint" and joints.heads.tolist() == [[0, 0, 1], [0, 0, 3]]
    assert sinew.read_skeleton(path, "bone").heads.tolist() == skeleton.heads.tolist()
    local = np.tile(np.eye(4), (2, 1, 1))
    assert np.array_equal(sinew.forward_kinematics(skeleton, local)[:, :3, 3], skeleton.heads)


def test_rig_skeleton_and_its_defaults():
    skeleton = sinew.RigSkeleton(np.array([-1, 0]), np.zeros((2, 3)), np.ones((2, 3)), np.array([1, 0]))
    assert skeleton.convention == "joint" and skeleton.names == ["joint_0", "joint_1"]
    assert skeleton.tails.tolist() == np.ones((2, 3)).tolist()
    named = sinew.RigSkeleton(
        np.array([-1]), np.zeros((1, 3)), np.zeros((1, 3)), np.array([-1]), names=["hip"], convention="bone"
    )
    assert named.convention == "bone" and named.names == ["hip"]


@pytest.mark.parametrize("name", ["a.bf", "a.tgf"])
def test_skeleton_round_trip(tmp_path, name):
    (tmp_path / "a.tgf").write_text("1 0 0 0\n2 1 0 0\n3 0 2 0\n#\n1 2\n2 3\n")
    (tmp_path / "a.bf").write_text("0 -1 0 0 1 hip\n1 0 0 0 2 left knee\n")
    skeleton = sinew.read_skeleton(tmp_path / name)
    sinew.write_skeleton(path=tmp_path / f"b-{name}", skeleton=skeleton)
    back = sinew.read_skeleton(tmp_path / f"b-{name}")
    for key in ("parents", "heads", "tails", "weight_columns"):
        assert np.array_equal(getattr(back, key), getattr(skeleton, key)), key
    assert (back.names, back.convention) == (skeleton.names, skeleton.convention)


def test_skeletons_refuse_what_is_wrong(tmp_path):
    path = tmp_path / "a.bf"
    path.write_text("0 -1 0 0 0\n0 0 x 0 0\n")
    assert said(sinew.read_skeleton, path) == 'a.bf, line 2: expected an offset, found "x"'
    path.write_text("0 1 0 0 0\n1 0 0 0 0\n")
    assert said(sinew.read_skeleton, path) == "a.bf: joint 0 is its own ancestor: its chain of parents is a cycle"
    assert said(sinew.read_skeleton, tmp_path / "none.tgf") == f"there is no file {tmp_path / 'none.tgf'}"
    assert said(sinew.read_skeleton, path, "edge") == 'the convention is "edge"; expected "bone" or "joint"'
    points = np.zeros((2, 3))
    assert (
        said(sinew.RigSkeleton, np.array([-1, 0]), points[:1], points, np.array([0, 1]))
        == "there are 1 head; the skeleton has 2 joints"
    )
    assert (
        said(sinew.RigSkeleton, np.array([-1, 0]), points[:, :2], points, np.array([0, 1]))
        == "heads has shape (2, 2); expected (J, 3)"
    )
    assert (
        said(sinew.RigSkeleton, np.array([-1, 0]), points, points, np.array([3, 3]))
        == "two joints have weight column 3, the second is joint 1"
    )
    skeleton = sinew.RigSkeleton(np.array([-1]), points[:1], points[:1], np.array([0]))
    assert (
        said(sinew.write_skeleton, tmp_path / "a.tgf", skeleton)
        == "a.tgf cannot hold a skeleton in the joint convention; write a .bf file"
    )
    assert not (tmp_path / "a.tgf").exists()


# --- rigs -----------------------------------------------------------------------------------------


def test_read_rig(tmp_path):
    rig = sinew.read_rig(rig_folder(tmp_path))
    assert rig.positions.dtype == np.float32
    assert rig.positions.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert rig.face_offsets.dtype == np.int32 and rig.face_offsets.tolist() == [0, 3]
    assert rig.face_vertices.dtype == np.int32 and rig.face_vertices.tolist() == [0, 1, 2]
    assert rig.face_materials.dtype == np.int32 and rig.face_materials.tolist() == [0]
    assert rig.material_names == ["green skin"] and rig.material_library == "a.mtl"
    assert rig.weights.dtype == np.float64 and rig.weights.tolist() == [[1, 0], [0.5, 0.5], [0, 1]]
    assert isinstance(rig.skeleton, sinew.RigSkeleton) and rig.skeleton.joint_count == 3
    assert isinstance(rig.poses, sinew.PoseClip) and rig.poses.pose_count == 2
    assert rig.animation is None
    assert np.allclose(rig.poses.sample(1)[1], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])


def test_parts_may_be_named(tmp_path):
    folder = rig_folder(tmp_path)
    for old, new in (("mesh.obj", "m.obj"), ("skeleton.bf", "s.bf"), ("weights.dmat", "w.dmat")):
        (folder / old).rename(folder / new)
    (folder / "walk.dmat").write_text("1 12\n0 0 0 1\n0 0.8 0 0.6\n0 0 0 1\n")
    rig = sinew.read_rig(
        folder,
        mesh="m.obj",
        skeleton=folder / "s.bf",
        weights="w.dmat",
        pose="walk.dmat",
        convention="joint",
        quaternion_order="xyzw",
    )
    assert rig.skeleton.convention == "joint"
    assert rig.poses.rotations.tolist()[0][1] == [0.6, 0, 0.8, 0]
    assert said(sinew.read_rig, folder) == f"there is neither skeleton.bf nor skeleton.tgf in {folder}"


def test_rig_round_trip(tmp_path):
    rig = animated_rig(tmp_path / "a")
    assert rig.animation.shape == (4, 3, 4, 4) and rig.animation.dtype == np.float64
    (tmp_path / "b").mkdir()
    sinew.write_rig(tmp_path / "b", rig)
    assert sorted(path.name for path in (tmp_path / "b").iterdir()) == [
        "anim.dmat",
        "mesh.obj",
        "pose.dmat",
        "skeleton.bf",
        "weights.dmat",
    ]
    back = sinew.read_rig(tmp_path / "b")
    for key in ("positions", "face_offsets", "face_vertices", "face_materials", "weights", "animation"):
        assert np.array_equal(getattr(back, key), getattr(rig, key)), key
    for key in ("parents", "heads", "tails", "weight_columns"):
        assert np.array_equal(getattr(back.skeleton, key), getattr(rig.skeleton, key)), key
    assert np.allclose(back.poses.rotations, rig.poses.rotations, rtol=0, atol=1e-15)
    assert back.material_names == rig.material_names and back.material_library == rig.material_library


def test_rig_with_a_tgf(tmp_path):
    folder = rig_folder(tmp_path / "a")
    (folder / "skeleton.bf").unlink()
    (folder / "pose.dmat").unlink()
    (folder / "skeleton.tgf").write_text("1 0 0 0\n2 1 0 0\n3 2 0 0\n#\n1 2\n2 3\n")
    rig = sinew.read_rig(folder)
    assert rig.skeleton.joint_count == 2 and rig.poses is None
    (tmp_path / "b").mkdir()
    sinew.write_rig(folder=tmp_path / "b", rig=rig, skeleton="skeleton.tgf")
    assert np.array_equal(sinew.read_rig(tmp_path / "b").skeleton.tails, rig.skeleton.tails)


def test_rig_defaults():
    skeleton = sinew.RigSkeleton(np.array([-1]), np.zeros((1, 3)), np.zeros((1, 3)), np.array([0]))
    rig = sinew.Rig(np.zeros((3, 3)), np.array([0, 3]), np.array([0, 1, 2]), skeleton, np.ones((3, 1)))
    assert rig.poses is None and rig.animation is None
    assert rig.face_materials.shape == (0,) and rig.material_names == [] and rig.material_library == ""


def test_rig_views_are_read_only_and_outlive_their_owner(tmp_path):
    rig = animated_rig(tmp_path / "a")
    skeleton = rig.skeleton
    views = [
        rig.positions,
        rig.face_offsets,
        rig.face_vertices,
        rig.face_materials,
        rig.weights,
        rig.animation,
        skeleton.heads,
        skeleton.tails,
        skeleton.weight_columns,
    ]
    kept = [view.copy() for view in views]
    for view in views:
        with pytest.raises(ValueError, match="read-only"):
            view[0] = 0
    del rig, skeleton
    gc.collect()
    others = [animated_rig(tmp_path / "a") for _ in range(5)]
    assert others and all(np.array_equal(view, copy) for view, copy in zip(views, kept))


def test_rigs_refuse_what_is_wrong(tmp_path):
    folder = rig_folder(tmp_path / "a")
    good = sinew.read_rig(folder)
    parts = {
        "positions": good.positions,
        "face_offsets": good.face_offsets,
        "face_vertices": good.face_vertices,
        "skeleton": good.skeleton,
        "weights": good.weights,
    }

    def refused(**changed):
        return said(sinew.Rig, **{**parts, **changed})

    assert refused(weights=np.ones((2, 2))) == "weights.dmat has 2 rows, mesh.obj has 3 vertices"
    assert refused(weights=good.weights * np.nan) == "weights.dmat: a weight is not finite"
    assert refused(weights=np.ones(3)) == "weights has shape (3,); expected (rows, columns)"
    assert refused(positions=np.zeros((3, 2))) == "positions has shape (3, 2); expected (V, 3)"
    assert refused(face_vertices=np.array([0, 1, 3])) == (
        "mesh.obj: face_vertices names vertex 3; the mesh has 3 vertices"
    )
    assert refused(animation=np.ones((3, 4, 4))) == "animation has shape (3, 4, 4); expected (F, J, 4, 4)"
    assert refused(animation=np.ones((2, 1, 4, 4))) == "anim.dmat has 2 matrices for 2 frames of 3 joints"
    assert refused(animation=np.array(1.0)) == "animation has shape (); expected (F, J, 4, 4)"

    (folder / "pose.dmat").write_text("1 2\n0 0")
    assert (
        said(sinew.read_rig, folder)
        == "pose.dmat: there are 2 numbers per pose; expected 9 (Euler angles) or 12 (quaternions) for 3 joints"
    )
    assert (
        said(sinew.read_rig, folder, quaternion_order="wzyx")
        == 'the quaternion order is "wzyx"; expected "wxyz" or "xyzw"'
    )
    (folder / "weights.dmat").unlink()
    assert said(sinew.read_rig, folder) == f"there is no file {folder / 'weights.dmat'}"
    assert said(sinew.read_rig, folder / "none") == f"there is no folder {folder / 'none'}"
    assert (
        said(sinew.write_rig, folder / "none", good)
        == f"{folder / 'none' / 'skeleton.bf'} cannot be written: No such file or directory"
    )


def test_weights_are_made_from_the_bones(tmp_path):
    made = sinew.read_rig(rigs.ROOT / "data/capsule", weights="auto")
    assert made.weights.shape == sinew.read_rig(rigs.ROOT / "data/capsule").weights.shape
    assert made.weights.min() >= 0 and np.allclose(made.weights.sum(axis=1), 1, atol=1e-6)
    columns = made.skeleton.weight_columns
    expected = sinew.automatic_weights(
        made.positions,
        made.face_offsets,
        made.face_vertices,
        made.skeleton.heads[columns >= 0],
        made.skeleton.tails[columns >= 0],
        joints=columns[columns >= 0],
    )
    rows = np.repeat(np.arange(len(made.positions)), np.diff(expected.offsets))
    assert np.array_equal(made.weights[rows, expected.joints], expected.weights)


@pytest.mark.parametrize(
    "skeleton, sentence",
    [
        ("-1 -1 0 0 0\n-1 0 1 0 0\n", "no joint has a column of weights, so none can be made from the bones"),
        (
            "-1 -1 0 0 0\n0 0 1 0 0\n900000 1 1 0 0\n",
            "a joint has weight column 900000; expected 0 to 1, since that many joints have one",
        ),
    ],
)
def test_weights_that_cannot_be_made(tmp_path, skeleton, sentence):
    folder = rig_folder(tmp_path, skeleton=skeleton)
    (folder / "weights.dmat").unlink()
    assert said(sinew.read_rig, folder, weights="auto") == sentence


def test_a_column_beyond_the_animation_is_refused_before_it_is_read(tmp_path):
    folder = rig_folder(tmp_path, skeleton="-1 -1 0 0 0\n0 0 1 0 0\n900000 1 1 0 0\n")
    (folder / "pose.dmat").unlink()
    sinew.write_dmat(folder / "anim.dmat", np.zeros((24, 1)))
    assert said(sinew.read_rig, folder) == "skeleton.bf: joint 2 has weight column 900000, weights.dmat has 2 columns"


# --- encodings ------------------------------------------------------------------------------------


def test_names_in_latin_1_are_read(tmp_path):
    folder = rig_folder(tmp_path, skeleton="-1 -1 0 0 0 Hüfte\n0 0 1 0 0 Knöchel\n1 1 1 0 0 骨\n")
    utf8 = sinew.read_rig(folder)
    assert utf8.skeleton.names == ["Hüfte", "Knöchel", "骨"]
    (folder / "skeleton.bf").write_text("-1 -1 0 0 0 Hüfte\n0 0 1 0 0 Knöchel\n1 1 1 0 0 Fuß\n", "latin-1")
    (folder / "mesh.obj").write_text("mtllib größe.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl grün\nf 1 2 3\n", "latin-1")
    rig = sinew.read_rig(folder)
    assert rig.skeleton.names == ["Hüfte", "Knöchel", "Fuß"]
    assert (rig.material_names, rig.material_library) == (["grün"], "größe.mtl")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-16-le"])
def test_utf_16_is_said(tmp_path, encoding):
    path = tmp_path / "a.dmat"
    path.write_bytes("1 1\n5".encode(encoding))
    assert said(sinew.read_dmat, path).startswith(
        "a.dmat is UTF-16 text; save it as UTF-8"
        if encoding == "utf-16"
        else "a.dmat: expected a first line `columns rows`, found "
    )


def test_excerpts_are_cut_between_letters(tmp_path):
    path = tmp_path / "a.dmat"
    path.write_text("1 1\na" + 50 * "ö", "utf-8")
    assert said(sinew.read_dmat, path) == f'a.dmat, row 0, column 0: expected a finite number, found "a{39 * "ö"}"'
    path.write_text("1 1\ngröße", "latin-1")
    assert said(sinew.read_dmat, path) == r'a.dmat, row 0, column 0: expected a finite number, found "gr\xf6\xdfe"'


@pytest.mark.skipif(sys.platform == "win32", reason="on Windows every name of a file is text")
def test_files_with_names_that_are_no_text(tmp_path):
    path = os.fsencode(tmp_path) + b"/gr\xf6\xdfe.dmat"
    assert said(sinew.read_dmat, path) == rf"there is no file {tmp_path}/gr\xf6\xdfe.dmat"
