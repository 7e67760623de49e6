"""RigProgram: descriptions as dictionaries, and what it computes from them."""

import copy
import json
import pickle
import re

import numpy as np
import pytest
import sinew_native as sinew


def bone(name, parent=None, head=(0, 0, 0), tail_of_parent=(0, 0, 0), **more):
    """Returns a bone of length 1 along Y without rotation at rest."""
    rest = np.eye(4, dtype=np.float32)
    rest[:3, 3] = head
    head = np.array(head, np.float32)
    return {
        "name": name,
        "parent": parent,
        "matrix_local": rest,
        "matrix": np.eye(3),
        "head": head - tail_of_parent,
        "head_local": head,
        "tail_local": head + [0, 1, 0],
        "length": 1,
        "rotation_mode": "XYZ",
        "has_constraints": False,
        **more,
    }


def copy_location(**more):
    return {
        "bone": "owner",
        "name": "Copy",
        "type": "COPY_LOCATION",
        "targets": [{"bone": "target"}],
        "settings": {"is_valid": 1, "use_x": 1, "use_y": True},
        **more,
    }


def line(path, index, *points):
    """Returns a curve of straight lines through points of frame and value."""
    keys = [[*point, *point, *point, 0, 0, 0, 1, 0] for point in points]
    return {"path": path, "index": index, "keys": keys}


@pytest.fixture
def rig():
    """Two bones, of which one follows the other, which moves."""
    return {
        "blender": 502,
        "bones": [bone("target"), bone("owner", head=(1, 2, 3))],
        "constraints": [copy_location()],
        "properties": [{"path": '["share"]', "type": "FLOAT", "min": 0, "max": 1, "value": [0.5]}],
        "values": [{"name": "lamp", "value": 2}],
        "matrices": [],
        "curves": [line('pose.bones["target"].location', 0, (0, 0), (10, 20))],
        "drivers": [
            {
                "path": 'pose.bones["target"].location',
                "index": 2,
                "expression": "share * lamp",
                "variables": [{"name": "share", "path": '["share"]'}, {"name": "lamp", "outside": "lamp"}],
            }
        ],
    }


def test_frames(rig):
    program = sinew.RigProgram(rig)
    assert program.names == ["target", "owner"]
    assert program.parents.tolist() == [-1, -1]
    poses = program.evaluate(np.array([0, 5, 7.5]))
    assert poses.shape == (3, 2, 4, 4) and poses.dtype == np.float32
    assert poses[:, 0, :3, 3].tolist() == [[0, 0, 1], [10, 0, 1], [15, 0, 1]]
    assert poses[:, 1, :3, 3].tolist() == [[0, 0, 3], [10, 0, 3], [15, 0, 3]]


def test_local_transforms_of_chosen_bones(rig):
    """Each is below the nearest chosen ancestor, and moves relative to that."""
    rig["bones"].append(bone("middle", "target", head=(0, 1, 0), tail_of_parent=(0, 1, 0)))
    rig["bones"].append(bone("end", "middle", head=(0, 2, 0), tail_of_parent=(0, 2, 0)))
    rig["curves"].append(line('pose.bones["middle"].location', 1, (0, 0), (10, 30)))
    program = sinew.RigProgram(rig)
    bones = [program.names.index(name) for name in ("end", "target")]
    skeleton = program.skeleton(bones)
    assert skeleton.parents.tolist() == [1, -1]
    assert skeleton.rest[0, :3, 3].tolist() == [0, 2, 0]
    poses = program.evaluate(np.array([0, 5]))[:, bones]
    locations, rotations, scales, played = sinew.local_transforms(skeleton, poses)
    assert locations.tolist() == [[[0, 0, 0], [0, 0, 1]], [[0, 15, 0], [10, 0, 1]]]
    assert (rotations == [1, 0, 0, 0]).all() and (scales == 1).all() and (played == poses).all()
    with pytest.raises(ValueError, match="there is no bone 7; the rig has 4"):
        program.skeleton([7])


def test_matrices_in_other_spaces(rig):
    rig["world"] = np.eye(4) + np.eye(4, k=3) * 5  # moved by 5 along X
    program = sinew.RigProgram(rig)
    poses = program.evaluate(np.array([0, 5]))
    assert program.convert(poses, 0, "POSE", "POSE").tolist() == poses[:, 0].tolist()
    assert program.convert(poses, 0, "POSE", "WORLD")[:, :3, 3].tolist() == [[5, 0, 1], [15, 0, 1]]
    assert program.convert(poses, 0, "WORLD", "POSE").tolist() == poses[:, 0].tolist()
    with pytest.raises(ValueError, match='to_space is "CUSTOM"; expected WORLD, POSE, LOCAL or LOCAL_WITH_PARENT'):
        program.convert(poses, 0, "POSE", "CUSTOM")
    with pytest.raises(ValueError, match="bone is 2, and the rig has 2"):
        program.convert(poses, 2, "POSE", "WORLD")
    with pytest.raises(ValueError, match=r"poses .*\(F, 2, 4, 4\)"):
        program.convert(poses[:, :1], 0, "POSE", "WORLD")


def as_json(rig):
    return json.dumps(rig, default=np.ndarray.tolist)


def test_a_file_is_a_description_too(rig, tmp_path):
    path = tmp_path / "höhe.json"
    path.write_text(as_json(rig), encoding="utf-8")
    frames = np.arange(5)
    wanted = sinew.RigProgram(rig).evaluate(frames)
    for name in (path, str(path)):
        program = sinew.RigProgram(name)
        for each in (program, pickle.loads(pickle.dumps(program))):
            assert np.array_equal(each.evaluate(frames), wanted)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "No such file"),
        (b"{", "line 1, column 2: expected a name in quotation marks, found the end; expected a rig as"),
        (b"[1]", "the file holds no JSON object; expected a rig as `sinew rig -o` writes it"),
        (b'{"blender": 502, "name": "\xff"}', "the text is not UTF-8"),
        (b"[" * 100_000, "; expected a rig as `sinew rig -o` writes it"),
        (b'{"bones": []}', 'the rig has no "blender"'),
        (b'{"blender": 502, "world": [1, NaN]}', 'the rig has 2 numbers as "world"; expected 16'),
        (b'{"format": 2, "muscles": []}', "the rig has format 2, and this Sinew reads up to 1; use a newer one"),
    ],
)
def test_files_that_are_no_rig(text, message, tmp_path):
    path = tmp_path / "rig.json"
    if text is not None:
        path.write_bytes(text)
    with pytest.raises(ValueError) as error:
        sinew.RigProgram(path)
    assert str(error.value).startswith(f"{path}: ") and message in str(error.value)


def test_what_is_no_description():
    with pytest.raises(TypeError):
        sinew.RigProgram(["rig.json"])


def test_all_that_may_be_given_has_a_name(rig):
    rig["bones"][0]["name"] = rig["constraints"][0]["targets"][0]["bone"] = 'a "b"'
    rig["curves"], rig["drivers"][0]["path"] = [], 'pose.bones["a \\"b\\""].location'
    rig["constraints"].append({"bone": "owner", "name": "Arm", "type": "ARMATURE", "weights": [0.5], "targets": [None]})
    rig["properties"].append({"path": 'data["three"]', "value": [1, 2, 3]})
    rig["values"].append({"name": "lamp: location[0]", "value": 7})
    program = sinew.RigProgram(rig)
    paths = program.paths
    assert paths['pose.bones["a \\"b\\""].rotation_quaternion'] == 4 and paths['data["three"]'] == 3
    assert paths['data.bones["owner"].bbone_scalein'] == 3 and paths["lamp: location[0]"] == paths["lamp"] == 1
    assert paths['pose.bones["owner"].constraints["Arm"].targets[0].weight'] == 1
    values = program.values(np.zeros(1), list(paths))
    assert values.shape == (1, sum(paths.values()))
    others = "rotation_quaternion", "rotation_axis_angle"  # the bones have angles
    given = {path: np.arange(n) if n > 1 else 1 for path, n in paths.items() if not path.endswith(others)}
    assert program.evaluate(np.zeros(1), given).shape == (1, 2, 4, 4)
    assert program.driven == ['pose.bones["a \\"b\\""].location[2]'] and program.keyed == []


def test_what_curves_set_has_a_name(rig):
    assert sinew.RigProgram(rig).keyed == ['pose.bones["target"].location[0]']


def test_skins_take_the_poses(rig):
    """By the skeleton of the rest, and by matrices of the program itself."""
    rig["bones"][1]["matrix_local"][:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]  # a quarter turn
    program, frames = sinew.RigProgram(rig), np.array([0, 5, 7.5])
    assert np.array_equal(program.rest, [bone["matrix_local"] for bone in rig["bones"]])
    assert program.joint_begin.tolist() == [0, 1, 2]
    matrices = program.skinning_matrices(frames)
    skeleton = sinew.Skeleton(program.parents, program.rest)  # both bones are roots
    np.testing.assert_allclose(sinew.skinning_matrices(skeleton, program.evaluate(frames)), matrices, atol=1e-6)
    points = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    skin = sinew.Skin.from_dense(points, np.tile([0.25, 0.75], (50, 1)))
    shapes = np.empty((3, 50, 3), np.float32)
    sinew.skin_all([(skin, each, shape, "linear") for each, shape in zip(matrices, shapes)])
    moved = np.einsum("fjab,vb->fjva", matrices[..., :3], np.c_[points, np.ones(50)][:, [0, 1, 2]])
    moved = moved[..., :3] + matrices[:, :, None, :3, 3]
    np.testing.assert_allclose(shapes, 0.25 * moved[:, 0] + 0.75 * moved[:, 1], atol=1e-5)


def test_joints_of_bendy_bones(rig):
    rig["bones"][0]["bbone_segments"] = 4
    program = sinew.RigProgram(rig)
    assert program.joint_begin.tolist() == [0, 5, 6]
    matrices = program.skinning_matrices(np.array([10]))
    # A straight B-bone's ends move as the bone does.
    np.testing.assert_allclose(matrices[0, :5], np.tile(program.evaluate(np.array([10]))[0, :1], (5, 1, 1)), atol=1e-6)


def test_a_choice_that_is_not_known(rig):
    rig["constraints"][0] = {
        "bone": "owner",
        "name": "Turn",
        "type": "COPY_ROTATION",
        "targets": [{"bone": "target"}],
        "settings": {"is_valid": 1, "mix_mode": 5},
    }
    with pytest.raises(ValueError, match='"Turn" of bone "owner" has 5 as mix_mode; known are 0 to 4'):
        sinew.RigProgram(rig)
    rig["constraints"][0]["settings"]["mute"] = 1
    sinew.RigProgram(rig)


def test_angles_from_outside_need_names(rig):
    target = {"target": {"outside": "Cube"}, "transform_type": "ROT_X", "stored_mode": "XYZ"}
    rig["matrices"] = [{"name": "Cube", "matrix": np.eye(4)}]
    rig["drivers"][0] |= {"type": "SUM", "variables": [{"name": "a", "type": "TRANSFORMS", "targets": [target]}]}
    with pytest.raises(ValueError, match='has 0 names as "stored_angles"; expected 3'):
        sinew.RigProgram(rig)
    target["stored_angles"] = ["x", "y", "z"]
    with pytest.raises(ValueError, match="reads x, which is not among the rig's values from outside"):
        sinew.RigProgram(rig)
    rig["values"] += [{"name": name, "value": value} for name, value in zip("xyz", (7, 0, 0))]
    location = sinew.RigProgram(rig).evaluate(np.zeros(1))[0, 0, :3, 3]
    assert location[2] == np.float32(2 * np.pi)  # no angle is nearer to 7


def test_given_values_replace_curves_and_drivers_replace_them(rig):
    program = sinew.RigProgram(rig)
    frames = np.zeros(2)
    location = 'pose.bones["target"].location'
    poses = program.evaluate(frames, {location: [[1, 2, 9], [3, 4, 9]], '["share"]': [0.25, 7], "lamp": 4})
    assert poses[:, 0, :3, 3].tolist() == [[1, 2, 1], [3, 4, 4]]  # the share is at most 1
    assert program.evaluate(frames, {location: np.array([5, 6, 7])})[:, 0, :3, 3].tolist() == [[5, 6, 1]] * 2
    values = program.values(frames, [location, '["share"]', "lamp"], {"lamp": 3})
    assert values.tolist() == [[0, 0, 1.5, 0.5, 3]] * 2


def test_edits_replace_values_and_curves(rig):
    rig["matrices"] = [{"name": "Cube", "matrix": np.eye(4)}]
    rig["constraints"][0]["targets"] = [{"outside": "Cube"}]
    program, location = sinew.RigProgram(rig), 'pose.bones["target"].location'
    curve = {"path": location, "index": 0, "keys": [[0] * 2 + [0, 5] + [0] * 5 + [0, 0]]}
    moved = np.eye(4)
    moved[:3, 3] = 4, 5, 6
    edited = program.edited({location: [1, 2, 9], '["share"]': 0.25, "lamp": 4, "Cube": moved}, [curve])
    poses = edited.evaluate(np.zeros(1))[0, :, :3, 3].tolist()
    assert poses == [[5, 2, 1], [4, 5, 3]]
    assert program.evaluate(np.zeros(1))[0, :, :3, 3].tolist() == [[0, 0, 1], [0, 0, 3]]
    assert edited.names == program.names and edited.matrix_names == ["Cube"]
    for wrong, words in (
        (({"nothing": 1}, []), "nothing"),
        (({location: [1, 2]}, []), "location"),
        (({location: [1, 2, np.nan]}, []), "nan"),
        (({"Cube": np.full((4, 4), np.inf)}, []), "Cube"),
        (({'pose.bones["owner"].constraints["Copy"].influence': 1}, []), "constraint"),
        (({}, [{**curve, "index": 1}]), "no curve"),
        (({}, [{**curve, "keys": [[0.0]]}]), "11 for each key"),
        (({}, [{"path": location}, 3]), "curve"),
    ):
        with pytest.raises(ValueError, match=words):
            program.edited(*wrong)


def test_matrices_from_outside(rig):
    rig["matrices"] = [{"name": "Cube", "matrix": np.eye(4)}]
    rig["constraints"][0]["targets"] = [{"outside": "Cube"}]
    program = sinew.RigProgram(rig)
    assert program.matrix_names == ["Cube"]
    moved = np.stack([np.eye(4)] * 2)
    moved[:, :3, 3] = [[4, 5, 6], [7, 8, 9]]
    poses = program.evaluate(np.zeros(2), {"Cube": moved})
    assert poses[:, 1, :3, 3].tolist() == [[4, 5, 3], [7, 8, 3]]


@pytest.fixture
def with_objects(rig):
    """One bone follows an object, whose parent moves too, and is a child of what stays."""
    still, inverse = np.eye(4), np.eye(4)
    still[:3, 3], inverse[:3, 3] = (0, 0, 10), (-1, 0, 0)
    inverse[0, 0] = 2
    rig["matrices"] = [{"name": "Set", "matrix": still}]
    rig["objects"] = [
        {"name": "Cart", "parent": "Set", "rotation_mode": "ZYX"},
        {"name": 'Ai"m', "parent": "Cart", "matrix_parent_inverse": inverse},
    ]
    rig["constraints"][0]["targets"] = [{"outside": 'Ai"m'}]
    rig["constraints"][0]["settings"]["use_z"] = 1
    rig["curves"] += [
        line('objects["Cart"].rotation_euler', 2, (0, 0), (10, np.pi)),
        line('objects["Cart"].scale', 0, (0, 3)),
        line('objects["Ai\\"m"].location', 1, (0, 1), (10, 5)),
        line('objects["Ai\\"m"].delta_location', 0, (0, 4)),
    ]
    return rig


@pytest.fixture
def with_spline(rig):
    """The second bone alone lies along a line, whose far end another object hooks."""
    rig["matrices"] = [{"name": "Rail", "matrix": np.eye(4)}, {"name": "Hand", "matrix": np.eye(4)}]
    rig["properties"].append({"path": "radii", "value": [1.0, 1.0]})
    rig["splines"] = [
        {
            "name": "Rail",
            "object": {"outside": "Rail"},
            "type": "POLY",
            "points": [{"co": [0] * 9}, {"co": [4, 0, 0] * 3}],
            "radii": "radii",
            "hooks": [{"target": {"outside": "Hand"}, "matrix_inverse": np.eye(4), "handles": [4]}],
        }
    ]
    settings = {"is_valid": 1, "chain_count": 1, "y_scale_mode": 1}
    bone = rig["bones"][1]["name"]
    rig["constraints"] = [{"bone": bone, "name": "s", "type": "SPLINE_IK", "settings": settings, "spline": "Rail"}]
    return rig


def test_spline_ik(with_spline):
    program, moved = sinew.RigProgram(with_spline), np.eye(4)
    found = program.evaluate(np.zeros(1), {})[0, 1]
    np.testing.assert_allclose(found[:3, 3], [0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(found[:3, 1] / np.linalg.norm(found[:3, 1]), [1, 0, 0], atol=1e-6)
    moved[:3, 3] = (0, 3, 0)
    found = program.evaluate(np.zeros(1), {"Hand": moved})[0, 1]
    np.testing.assert_allclose(found[:3, 1] / np.linalg.norm(found[:3, 1]), [0.8, 0.6, 0], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda rig: rig["constraints"][0].update(spline="Way"), 'follows spline "Way", which the rig does not have'),
        (lambda rig: rig["constraints"][0].pop("spline"), "follows spline -1; the rig has 1"),
        (lambda rig: rig["constraints"][0].update(joints=[np.nan]), "the joints of SPLINE_IK"),
        (lambda rig: rig["splines"][0].pop("object"), 'spline "Rail" has matrix -1; the rig has 2'),
        (lambda rig: rig["splines"][0].update(type="CARDINAL"), 'a spline has "type": "CARDINAL"; expected'),
        (lambda rig: rig["splines"][0].update(type="NURBS"), 'spline "Rail" has 2 points and order 4; expected 2 to 2'),
        (lambda rig: rig["splines"][0].update(use_cyclic_u=True), 'follows the closed spline "Rail"'),
        (lambda rig: rig["splines"][0].update(eval_time="none"), 'spline "Rail" has as its time none'),
        (lambda rig: rig["splines"][0].update(path_duration=0), 'spline "Rail" has the duration 0'),
        (lambda rig: rig["splines"][0]["points"][0].update(co=[1, 2]), 'has 2 numbers as "co"; expected 9'),
        (lambda rig: rig["splines"][0]["points"][0].update(co=[np.inf] * 9), 'a point of spline "Rail" has inf'),
        (lambda rig: rig["splines"][0]["hooks"][0].update(handles=[-1]), "has a hook of handle -1; it has 6"),
        (lambda rig: rig["splines"][0]["hooks"][0].update(handles=["a"]), "handles"),
        (lambda rig: rig["splines"][0].update(shape_keys=[{"value": "radii", "points": [1.0]}]), "not of 10 numbers"),
        (lambda rig: rig["splines"][0].update(colour=1), "colour"),
    ],
)
def test_wrong_splines_are_refused(with_spline, change, message):
    change(with_spline)
    with pytest.raises(ValueError, match=re.escape(message)):
        sinew.RigProgram(with_spline)


def place(program, frames, given=None):
    return program.evaluate(np.array(frames), given or {})[:, 1, :3, 3]


def test_objects_that_keyframes_move(with_objects):
    program = sinew.RigProgram(with_objects)
    found = place(program, [0, 5, 10])
    # In the parent's space: 2 * 4 - 1 along X, which the parent scales by 3, and what is keyed along Y.
    for (x, y, z), angle, along in zip(found, (0, np.pi / 2, np.pi), (1, 3, 5)):
        turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ [21, along]
        np.testing.assert_allclose([x, y, z], [*turned, 10], atol=2e-5)
    assert program.paths['objects["Cart"].rotation_euler'] == 3 and program.matrix_names == ["Set", "Cart", 'Ai"m']
    assert program.paths['objects["Cart"].delta_rotation_quaternion'] == 4


@pytest.mark.parametrize("space", ["local", "basis"])
def test_objects_in_other_spaces(with_objects, space):
    """A child's local space is its parent's; an object without a parent has one that is turned as it is."""
    cart, aim = with_objects["objects"]
    aim[space], target = "Aim, there", with_objects["constraints"][0]["targets"]
    target[0] = {"outside": "Aim, there"}
    found = place(sinew.RigProgram(with_objects), [0, 5, 10])
    np.testing.assert_allclose(found, [[4, 1, 0], [4, 3, 0], [4, 5, 0]], atol=2e-5)
    cart[space], cart["parent"], target[0] = "Cart, there", None, {"outside": "Cart, there"}
    with_objects["curves"].append(line('objects["Cart"].location', 0, (0, 3)))
    wanted = [[3, 0, 0], [0, -3, 0], [-3, 0, 0]] if space == "local" else [[3, 0, 0]] * 3
    np.testing.assert_allclose(place(sinew.RigProgram(with_objects), [0, 5, 10]), wanted, atol=2e-5)
    cart[space] = "Set"
    with pytest.raises(ValueError, match='object "Cart" has the name of a matrix; give each a name of its own'):
        sinew.RigProgram(with_objects)


def test_a_rig_that_moves_as_a_whole(with_objects):
    """With an object, on each frame."""
    place, times = np.eye(4), np.array([0, 5])
    place[:3, 3] = 1, 2, 3
    given = {"Cart": place}
    still = sinew.RigProgram({**with_objects, "world": place}).evaluate(times, given)
    assert np.abs(sinew.RigProgram(with_objects).evaluate(times, given) - still).max() > 1
    with_objects["world"] = "Cart"
    program = sinew.RigProgram(with_objects)
    assert program.evaluate(times, given).tolist() == still.tolist()
    # What it follows is a child of the same object, so that they move together.
    np.testing.assert_allclose(program.evaluate(times), still, atol=1e-5)
    assert pickle.loads(pickle.dumps(program)).evaluate(times, given).tolist() == still.tolist()
    with pytest.raises(ValueError, match="the rig moves as a whole; its matrices cannot be converted from or to world"):
        program.convert(still, 0, "POSE", "WORLD")


def test_what_is_given_of_objects_counts(with_objects):
    program, raised = sinew.RigProgram(with_objects), np.eye(4)
    raised[:3, 3] = (1, 2, 30)
    assert place(program, [0], {'objects["Ai\\"m"].location': [0, 7, 1]}).tolist() == [[21, 7, 11]]
    assert place(program, [0, 10], {"Set": raised})[0].tolist() == [22, 3, 30]
    assert place(program, [0, 10], {'Ai"m': raised}).tolist() == [[1, 2, 30]] * 2
    assert np.array_equal(place(program, [10]), place(sinew.RigProgram(with_objects), [10]))  # nothing of it is kept
    edited = program.edited({'objects["Ai\\"m"].scale': [1, 1, 2], "Set": raised}, [])
    assert place(edited, [0]).tolist() == [[22, 3, 30]]
    with pytest.raises(ValueError, match='matrix "Cart" is that of an object that moves; set the object'):
        program.edited({"Cart": raised}, [])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda rig: rig["objects"].reverse(),
            'an object names parent "Cart", which is neither a matrix nor an object before it',
        ),
        (lambda rig: rig["objects"][0].update(name="Set"), 'object "Set" has the name of a matrix'),
        (lambda rig: rig["objects"][0].update(rotation_mode="AUTO"), 'an object has "rotation_mode": "AUTO"; expected'),
        (lambda rig: rig["objects"][0].update(values=[1, 2]), 'an object has 2 numbers as "values"; expected 34'),
        (lambda rig: rig["objects"][0].update(values=[np.nan] * 34), "the rig has nan as a value of location"),
        (
            lambda rig: rig["objects"][1].update(matrix_parent_inverse=np.full((4, 4), np.inf)),
            'the parent inverse matrix of object "Ai"m" has inf in it',
        ),
        (
            lambda rig: rig["drivers"][0].update(path='objects["Cart"].location'),
            'a driver sets objects["Cart"].location, which is not computed; use keyframes',
        ),
        (
            lambda rig: rig["curves"].append(line('objects["Bus"].location', 0, (0, 0))),
            'a curve sets objects["Bus"].location, which the rig does not have',
        ),
    ],
)
def test_mistakes_about_objects(with_objects, change, message):
    test_mistakes(with_objects, change, message)


@pytest.fixture
def with_strips(rig):
    """The target follows two strips, of which the upper one adds half of its action."""
    path = 'pose.bones["target"].location'
    strip = {"frame_start": 1, "frame_end": 11, "action_frame_start": 1, "action_frame_end": 11}
    del rig["curves"]
    return rig | {
        "mixed": [{"path": path, "default": [0, 0, 0]}],
        "actions": [
            {"name": "Walk", "curves": [line(path, 0, (1, 0), (11, 20))]},
            {"name": "Lean", "curves": [line(path, 0, (1, 6))]},
        ],
        "tracks": [
            {"strips": [strip | {"action": "Walk"}]},
            {"strips": [strip | {"action": "Lean", "blend_type": "ADD", "influence": 0.5}]},
        ],
    }


def test_strips(with_strips):
    program = sinew.RigProgram(with_strips)
    assert program.evaluate(np.array([1, 6, 99]))[:, 0, 0, 3].tolist() == [3, 13, 23]
    assert program.keyed == ['pose.bones["target"].location[0]']
    assert program.evaluate(np.array([6]), {'pose.bones["target"].location': [1, 2, 3]})[0, 0, 0, 3] == 1


def endless(strips):
    strips[0] |= {"type": "META", "strips": strips}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda rig: rig["actions"].pop(), 'a strip plays action "Lean", which is not described'),
        (lambda rig: rig["actions"].append(rig["actions"][0]), 'action "Walk" occurs twice'),
        (
            lambda rig: rig["tracks"][0]["strips"][0].update(type="SOUND"),
            'a strip has "type": "SOUND"; expected one of',
        ),
        (lambda rig: rig["tracks"][0]["strips"][0].pop("frame_end"), 'a strip has no "frame_end"'),
        (lambda rig: rig["tracks"][0]["strips"][0].update(speed=2), 'a strip has "speed", which is unknown'),
        (lambda rig: rig["tracks"][0].update(strips=3), 'a track has no list as "strips"'),
        (lambda rig: rig["mixed"][0].update(default=[]), 'strips set pose.bones["target"].location, which has 0'),
        (lambda rig: endless(rig["tracks"][0]["strips"]), 'the rig has lists that are nested without end as "strips"'),
        (lambda rig: rig["tracks"][0]["strips"][0].update(scale=np.inf), "a strip has inf in it; expected finite"),
    ],
)
def test_mistakes_about_strips(with_strips, change, message):
    test_mistakes(with_strips, change, message)


def test_segments(rig):
    rig["bones"][0]["bbone_segments"] = 4
    program = sinew.RigProgram(rig)
    assert program.segment_begin.tolist() == [0, 5, 5]
    segments = program.segments(np.zeros(1))
    assert segments.shape == (1, 5, 4, 4)
    assert np.allclose(segments[0, :, 1, 3], [0, 0.25, 0.5, 0.75, 1])


def test_tables():
    names = [name for name, _ in sinew.rig_bone_settings()]
    assert names[:2] == ["location", "rotation_quaternion"]
    settings = sinew.rig_constraint_settings()
    assert settings["CHILD_OF"]["inverse_matrix"] == (16, "FLOAT", 0, np.float32(-3.4e38), np.float32(3.4e38))
    assert settings["LIMIT_SCALE"]["influence"] == (1, "FLOAT", 1, 0, 1)
    assert settings["IK"]["mute"] == (1, "BOOLEAN", 0, 0, 1)


def changed(rig, change):
    result = copy.deepcopy(rig)
    change(result)
    return result


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda rig: rig.pop("blender"), 'the rig has no "blender"'),
        (lambda rig: rig.update(bone=[]), 'the rig has "bone", which is unknown'),
        # what is looked up twice does not count for another one
        (lambda rig: rig.update(bone=[], world=np.eye(4).tolist()), 'the rig has "bone", which is unknown'),
        (lambda rig: rig.update(world="Gone"), 'the rig looks at "Gone", which is not among the matrices from outside'),
        (
            lambda rig: rig["curves"][0].update(modifiers=[{"type": "LIMITS", "range": [1, 2], "blend": 1}]),
            'a modifier of a curve has "blend", which is unknown',
        ),
        (lambda rig: rig["bones"][1].update(parent="hip"), 'bone 1 names bone "hip", which the rig does not have'),
        (lambda rig: rig["bones"][1].update(parent=0), 'bone 1 has 0 as "parent"; expected text'),
        (lambda rig: rig["bones"][1].update(length="long"), 'bone 1 has "long" as "length"; expected a number'),
        (lambda rig: rig["bones"][1].update(head=[1, 2]), 'bone 1 has 2 numbers as "head"; expected 3'),
        (
            lambda rig: rig["bones"][1].update(inherit_scale="HALF"),
            'bone 1 has "inherit_scale": "HALF"; expected one of FULL, FIX_SHEAR, ALIGNED, AVERAGE, NONE, NONE_LEGACY',
        ),
        (
            lambda rig: rig["constraints"][0].update(type="SHRINKWRAP"),
            'constraint "Copy" of bone "owner" is of type SHRINKWRAP, which is not computed',
        ),
        (
            lambda rig: rig["constraints"][0]["settings"].update(power=2),
            'constraint "Copy" of bone "owner", its settings, has "power", which is unknown',
        ),
        (
            lambda rig: rig["constraints"][0].update(targets=[{"outside": "Cube"}]),
            'constraint "Copy" of bone "owner" looks at "Cube", which is not among the matrices from outside',
        ),
        (
            lambda rig: rig["curves"][0].update(keys=[1, 2, 3]),
            'a curve has 3 numbers as "keys"; expected 11 for each key',
        ),
        (
            lambda rig: rig["drivers"][0].update(expression="import os"),
            'the driver of pose.bones["target"].location[2]: ',
        ),
        (
            lambda rig: rig["drivers"][0]["variables"][1].update(outside="sun"),
            'the driver of pose.bones["target"].location[2] reads sun, which is not among the rig\'s values from '
            "outside; describe it there",
        ),
    ],
)
def test_mistakes(rig, change, message):
    with pytest.raises(ValueError) as error:
        sinew.RigProgram(changed(rig, change))
    assert str(error.value).startswith(message)


def test_the_parts_of_an_evaluation_are_timed(rig):
    parts = sinew.RigProgram(rig).profile(np.arange(5))
    assert list(parts) == ["curves", "drivers", "bones", "ik", "segments"]
    assert parts["bones"] > 0 and parts["curves"] > 0 and parts["ik"] == parts["segments"] == 0


def test_mistakes_of_a_call(rig):
    program = sinew.RigProgram(rig)
    with pytest.raises(ValueError, match=r'the rig has no property \["gone"\]'):
        program.evaluate(np.zeros(1), {'["gone"]': 1})
    with pytest.raises(ValueError, match=r"has shape \(2,\); expected \(3,\) or \(5, 3\)"):
        program.evaluate(np.zeros(5), {'pose.bones["owner"].scale': [1, 2]})
    with pytest.raises(ValueError, match=r"frames has shape \(1, 1\); expected \(N,\)"):
        program.evaluate(np.zeros((1, 1)))


FIELDS = [("pose_matrix", 0, 0), ("tail", 0, 0), ("values", 0, 3), ("channel_matrix", 0, 0), ("head", 0, 0)]


def test_records_hold_what_blender_keeps_of_each_bone(rig):
    rig["bones"][1]["matrix_local"][:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]  # a quarter turn
    rig["bones"][0]["bbone_segments"] = 3
    program, frames = sinew.RigProgram(rig), np.array([0, 5, 7.5])
    player = sinew.RigPlayer(program, [['["share"]'], []], FIELDS)
    moments = [sinew.RigPlayer.moments([(player, {})], frame)[0] for frame in frames]
    assert [numbers for _record, *numbers in moments] == [[(0.5,), ()]] * 3
    records = np.array([record for record, *_numbers in moments])
    poses, segments = program.evaluate(frames), program.segments(frames)
    heads = records[:, :12].copy().view(np.int32)
    assert heads.tolist() == [[2, 3, 0]] * 3
    bones = records[:, 12:].copy().view(np.float32)
    width = 16 + 3 + 3 + 16 + 3 + 25
    assert bones.shape == (3, 2 * width + 4 * 16 + 5 * 16 + 4 * 25)
    bent = bones[:, width:-width]
    for number, part in enumerate((bones[:, :width], bones[:, -width:])):
        pose = poses[:, number]
        assert (part[:, :16].reshape(-1, 4, 4).swapaxes(1, 2) == pose).all()
        assert (part[:, 16:19] == pose[:, :3, 3] + pose[:, :3, 1]).all()
        assert part[:, 19:22].tolist() == ([[0, 0, 1], [10, 0, 1], [15, 0, 1]] if number == 0 else [[0, 0, 0]] * 3)
        channel = part[:, 22:38].reshape(-1, 4, 4).swapaxes(1, 2)
        np.testing.assert_allclose(channel @ rig["bones"][number]["matrix_local"], pose, atol=1e-6)
        assert (part[:, 38:41] == pose[:, :3, 3]).all()
        # A dual quaternion of a movement without rotation: its translation is twice the second half.
        quaternion = part[:, 41:]
        assert quaternion[:, :4].tolist() == [[1, 0, 0, 0]] * 3 and quaternion[:, 24].tolist() == [0] * 3
        np.testing.assert_allclose(2 * quaternion[:, 5:8], channel[:, :3, 3], atol=1e-6)
    assert (bent[:, :64].reshape(3, 4, 4, 4).swapaxes(2, 3) == segments).all()
    deforming = bent[:, 64:144].reshape(3, 5, 4, 4).swapaxes(2, 3)
    assert (deforming[:, 0] == np.linalg.inv(rig["bones"][0]["matrix_local"])).all()
    # At rest the segments are straight, so that all of them move as the bone does.
    np.testing.assert_allclose(deforming[:, 1:], np.repeat(poses[:, :1], 4, axis=1), atol=1e-6)


def test_bones_that_do_not_deform_have_no_dual_quaternion(rig):
    rig["bones"][1]["use_deform"] = False
    player = sinew.RigPlayer(sinew.RigProgram(rig), [], [("head", 0, 0)])
    ((record,),) = sinew.RigPlayer.moments([(player, {})], 5)
    first, second = record[12:].copy().view(np.float32).reshape(2, 3 + 25)
    assert first[3] == 1 and not second[3:].any() and second[:3].any()


def players_of(*rigs, parts=()):
    return [sinew.RigPlayer(sinew.RigProgram(rig), list(parts), FIELDS) for rig in rigs]


def of_no_number(rig):
    other = copy.deepcopy(rig)
    other["drivers"][0]["expression"] = "share / 0"
    return other


def test_moments_of_several_rigs(rig):
    (record,), error = sinew.RigPlayer.moments([(each, {}) for each in players_of(rig, of_no_number(rig))], 1)
    assert record.ndim == 1 and "divides by 0" in error


def test_moments_of_what_comes_from_outside(rig):
    (player,) = players_of(rig, parts=[["lamp"]])
    (record, given), (other, known) = sinew.RigPlayer.moments([(player, {"lamp": 3}), (player, {})], 1)
    assert given == (3,) and known == (2,) and (record != other).any()
    with pytest.raises(ValueError, match=r"lamp has shape \(3,\); expected \(\) or \(1,\)"):
        sinew.RigPlayer.moments([(player, {"lamp": np.ones(3)})], 1)


def test_moments_computed_ahead_are_the_same(rig):
    players = players_of(rig, of_no_number(rig), rig, parts=[['["share"]']])
    asked = [(each, {}) for each in players]
    for frame in (1, 2.5) * 10:
        known = sinew.RigPlayer.moments(asked, frame)  # what was begun is another frame
        sinew.RigPlayer.begin(players, frame)
        first, again = (sinew.RigPlayer.moments(asked, frame) for _ in range(2))
        for own, found, wanted, other in zip((True, False, True), first, known, again, strict=True):
            if own:
                assert found[0] is other[0] is not wanted[0] and (found[0] == wanted[0]).all()
                assert found[1:] == wanted[1:] == [(0.5,)]
            else:
                assert found == wanted == other and "divides by 0" in found
    (given,) = sinew.RigPlayer.moments([(players[0], {"lamp": 3})], 2.5)
    assert (given[0] != first[0][0]).any(), "what is set was not known ahead"
    sinew.RigPlayer.begin(players * 500, 3)  # nobody asks for them


def test_an_edit_knows_nothing_ahead(rig):
    (player,) = players_of(rig, parts=[['["share"]'], ["lamp"]])
    sinew.RigPlayer.begin([player], 1)
    edited = player.edited({"lamp": 7}, [])
    ((_record, *numbers),) = sinew.RigPlayer.moments([(edited, {})], 1)
    assert numbers == [(0.5,), (7,)] and edited.program is edited.program is not player.program
    assert edited.program.values(np.ones(1), ["lamp"]) == 7


@pytest.mark.parametrize("field", [("pose", 0, 0), ("values", -1, 3), ("values", 0, 0), ("values", 60, 2**31 - 1)])
def test_unknown_fields(rig, field):
    with pytest.raises(ValueError, match="a field"):
        sinew.RigPlayer(sinew.RigProgram(rig), [], [field])


def test_numbers_that_are_not_there(rig):
    with pytest.raises(ValueError, match="the rig has no property gone"):
        players_of(rig, parts=[["lamp"], ["gone"]])
