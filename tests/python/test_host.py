"""sinew_native.host: structs laid out in memory as Blender lays them out, read and written by address."""

import ctypes
import gc
from types import SimpleNamespace

import numpy as np
import pytest
import sinew_native
from sinew_native import host


class Weight(ctypes.Structure):
    _fields_ = [("group", ctypes.c_uint32), ("weight", ctypes.c_float)]


class DeformVertex(ctypes.Structure):
    _fields_ = [("entries", ctypes.c_void_p), ("count", ctypes.c_int32), ("flag", ctypes.c_int32)]


class Bone(ctypes.Structure):
    _fields_ = [
        ("next", ctypes.c_void_p),
        ("other", ctypes.c_double),
        ("motion", ctypes.c_float * 16),
        ("segment_count", ctypes.c_int32),
        ("segments", ctypes.c_void_p),
    ]


class Key(ctypes.Structure):
    _fields_ = [
        ("next", ctypes.c_void_p),
        ("value", ctypes.c_float),
        ("flags", ctypes.c_uint16),
        ("relative", ctypes.c_int16),
    ]


BONE = (Bone.next.offset, Bone.motion.offset, Bone.segment_count.offset, Bone.segments.offset)
KEY = (Key.flags.offset, Key.value.offset, Key.relative.offset)


def chained(structs):
    for this, following in zip(structs[:-1], structs[1:]):
        this.next = ctypes.addressof(following)
    return structs


def test_weights_in_stored_order():
    rows = [[(3, 0.5), (1, 0.25)], [], [(0, 1.0)]]
    entries = [(Weight * max(len(row), 1))(*row) for row in rows]
    vertices = (DeformVertex * 3)(
        *[(ctypes.addressof(own) if row else None, len(row), 0) for own, row in zip(entries, rows)]
    )
    offsets, groups, weights = host.read_weights(ctypes.addressof(vertices), 3)
    assert offsets.tolist() == [0, 2, 2, 3] and offsets.dtype == np.int64
    assert groups.tolist() == [3, 1, 0] and weights.tolist() == [0.5, 0.25, 1.0]


def some_weights():
    rows = [[(3, 0.5), (1, 0.25)], [], [(0, 1.0)]]
    entries = [(Weight * max(len(row), 1))(*row) for row in rows]
    vertices = (DeformVertex * 3)(
        *[(ctypes.addressof(own) if row else None, len(row), 0) for own, row in zip(entries, rows)]
    )
    return vertices, entries


def write(vertices, offsets, groups, weights):
    numbers = np.array(offsets, np.int64), np.array(groups, np.int32), np.array(weights, np.float32)
    host.write_weights(ctypes.addressof(vertices), *numbers)


def test_weights_are_written_in_place():
    vertices, _entries = some_weights()
    write(vertices, [0, 2, 2, 3], [7, 2, 5], [0.125, 0.75, 0.5])
    offsets, groups, weights = host.read_weights(ctypes.addressof(vertices), 3)
    assert offsets.tolist() == [0, 2, 2, 3]
    assert groups.tolist() == [7, 2, 5] and weights.tolist() == [0.125, 0.75, 0.5]


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (([0, 2, 3, 4], [7, 2, 5, 1], [1, 1, 1, 1]), "vertex 1 has 0 weights; expected 1"),
        (([0, 2, 2, 3], [7, 2, 5], [1, 1]), "offsets, groups and weights do not fit together"),
        (([], [], []), r"offsets is empty; expected V \+ 1 numbers"),
    ],
)
def test_weights_of_other_vertices_are_not_written(arguments, sentence):
    vertices, _entries = some_weights()
    with pytest.raises(ValueError, match=sentence):
        write(vertices, *arguments)
    assert host.read_weights(ctypes.addressof(vertices), 3)[1].tolist() == [3, 1, 0]


def pose():
    """Three bones: an ordinary one, one that does not deform, a B-bone of two segments."""
    random = np.random.default_rng(1)
    motions = random.normal(size=(3, 16)).astype(np.float32)
    segments = random.normal(size=(4, 16)).astype(np.float32)  # the first leads into the bone's space
    bones = chained([Bone(None, 0, (ctypes.c_float * 16)(*row), 0, None) for row in motions])
    bones[2].segment_count, bones[2].segments = 2, segments.ctypes.data
    return bones, motions, segments


def read(bones, first=(0, -1, 1), counts=(1, 0, 3), joints=4):
    out = np.zeros((joints, 4, 4), np.float32)
    host.read_pose(ctypes.addressof(bones[0]), np.array(first, np.int32), np.array(counts, np.int32), BONE, out)
    return out.reshape(-1, 16)


def test_a_pose_with_segments():
    bones, motions, segments = pose()
    assert np.array_equal(read(bones), np.concatenate((motions[:1], segments[1:])))


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (dict(first=(0, -1), counts=(1, 0)), "more bones"),
        (dict(first=(0, -1, 1, -1), counts=(1, 0, 3, 0)), "fewer bones"),
        (dict(counts=(1, 0, 4), joints=5), "other segments"),
        (dict(joints=3), "too few matrices"),
    ],
)
def test_another_pose_than_was_thought(arguments, sentence):
    bones, _, _ = pose()
    with pytest.raises(ValueError, match=sentence):
        read(bones, **arguments)


class Pose(ctypes.Structure):
    _fields_ = [("first", ctypes.c_void_p), ("last", ctypes.c_void_p), ("array", ctypes.c_void_p)]


Place = ctypes.c_float * 16


class Owner(ctypes.Structure):
    _fields_ = [
        ("pose", ctypes.c_void_p),
        ("state", ctypes.c_int32),
        ("mode", ctypes.c_int32),
        ("mesh_place", Place),
        ("armature_place", Place),
    ]


def placed(matrix):
    """As Blender has it: column by column."""
    return Place(*np.asarray(matrix, np.float32).T.reshape(-1))


@pytest.fixture
def posed():
    """A shortcut for a mesh of three vertices, moved by the bones of `pose`; all that it reads and writes."""
    bones, motions, segments = pose()
    array = (ctypes.c_void_p * 3)(*map(ctypes.addressof, bones))
    own = Pose(array[0], array[2], ctypes.addressof(array))
    owner = Owner(ctypes.addressof(own), 7, 0b1011, placed(np.eye(4)), placed(np.eye(4)))
    rest = np.random.default_rng(2).normal(size=(3, 3)).astype(np.float32)
    skin = sinew_native.Skin(rest, np.arange(4), np.array([0, 2, 4]), np.ones(3), 5)
    deformer = sinew_native.Deformer([sinew_native.Layer(skin, "linear")])
    address = ctypes.addressof(owner)
    shortcut = host.Shortcut(
        deformer,
        [(address, -1, 0, [(Owner.state.offset, 4)])],
        [(address, [0, -1, 1], [1, 0, 3])],
        (Pose.first.offset, Pose.array.offset, *BONE),
        [((address + Owner.mesh_place.offset, -1), (address + Owner.armature_place.offset, -1))],
        [(address + Owner.mode.offset, 0b0011, 0b0100)],
    )
    return SimpleNamespace(
        shortcut=shortcut,
        deformer=deformer,
        owner=owner,
        pose=own,
        bones=bones,
        array=array,
        motions=motions,
        segments=segments,
    )


def as_poses(posed, space=None):
    """What the deformer takes: the motions where first_joints has them, the last joint at rest."""
    matrices = np.concatenate((posed.motions[:1], posed.segments[1:], np.eye(4, dtype=np.float32).reshape(1, 16)))
    return [(matrices.reshape(-1, 4, 4).transpose(0, 2, 1), space)]


MESH = np.array([[0, -2, 0, 1], [2, 0, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]], np.float32)
ARMATURE = np.array([[1, 0, 0, 4], [0, 0, -1, 5], [0, 1, 0, 6], [0, 0, 0, 1]], np.float32)


@pytest.mark.parametrize("mesh, armature", [(MESH, MESH), (MESH, ARMATURE)], ids=["one space", "two"])
def test_a_shortcut_gives_the_deformers_bits(posed, mesh, armature):
    out, wanted = np.empty((2, 3, 3), np.float32)
    posed.owner.mesh_place, posed.owner.armature_place = placed(mesh), placed(armature)
    assert posed.shortcut.deform(out.ctypes.data)
    posed.deformer.deform(as_poses(posed, host.space_between(mesh, armature)), wanted)
    assert np.array_equal(out, wanted) and posed.owner.mode == 0b1100
    assert posed.shortcut.milliseconds.shape == (2,) and (posed.shortcut.milliseconds >= 0).all()


def walking(posed):
    """The same as posed.shortcut, for a pose without an array."""
    address = ctypes.addressof(posed.owner)
    places = [((address + Owner.mesh_place.offset, -1), (address + Owner.armature_place.offset, -1))]
    layout = Pose.first.offset, -1, *BONE
    return host.Shortcut(posed.deformer, [], [(address, [0, -1, 1], [1, 0, 3])], layout, places, [])


def test_a_shortcut_finds_the_bones_of_a_pose_without_an_array(posed):
    """The list is followed on each frame, wherever its bones were the last time."""
    out, wanted = np.empty((2, 3, 3), np.float32)
    shortcut = walking(posed)
    posed.pose.array = None
    posed.deformer.deform(as_poses(posed), wanted)
    copy = type(posed.bones[0]).from_buffer_copy(posed.bones[0])
    for first in (posed.bones[0], copy, posed.bones[0]):
        posed.pose.first = ctypes.addressof(first)
        out[:] = 0
        assert shortcut.deform(out.ctypes.data) and np.array_equal(out, wanted)


@pytest.mark.parametrize("spoil", ("no pose", "fewer bones", "more bones", "other segments"))
def test_a_shortcut_through_another_pose_without_an_array(posed, spoil):
    shortcut, out, more = walking(posed), np.zeros((3, 3), np.float32), type(posed.bones[0])()
    if spoil == "no pose":
        posed.owner.pose = None
    elif spoil == "fewer bones":
        posed.bones[1].next = None
    elif spoil == "more bones":
        posed.bones[2].next = ctypes.addressof(more)
    else:
        spoil_segments(posed)
    with pytest.raises(ValueError, match=r"other (bones|segments) than the skin was made for"):
        shortcut.deform(out.ctypes.data)
    assert not out.any()


def test_a_shortcut_poses_the_layers_of_stages(posed):
    """A second pose, read after the deformer's own: here from the same bones, in other places."""
    rest = np.random.default_rng(3).normal(size=(3, 3)).astype(np.float32)
    skin = sinew_native.Skin(rest, np.arange(4), np.array([2, 0, 3]), np.ones(3), 5)
    mixed = sinew_native.MixedLayers([sinew_native.Layer(skin, "dual_quaternion")])
    identities = np.tile(np.eye(4, dtype=np.float32), (5, 1, 1))
    address = ctypes.addressof(posed.owner)
    shortcut = host.Shortcut(
        posed.deformer,
        [],
        [(address, [0, -1, 1], [1, 0, 3])] * 2,
        (Pose.first.offset, Pose.array.offset, *BONE),
        [((address + Owner.mesh_place.offset, -1), (address + Owner.armature_place.offset, -1))] * 2,
        [],
        (mixed.stage([(identities, None)]),),
    )
    posed.owner.mesh_place, posed.owner.armature_place = placed(MESH), placed(ARMATURE)
    out, wanted = np.empty((2, 3, 3), np.float32)
    assert shortcut.deform(out.ctypes.data)
    poses = as_poses(posed, host.space_between(MESH, ARMATURE))
    posed.deformer.deform(poses, wanted, stages=[mixed.stage(poses)])
    assert np.array_equal(out, wanted) and shortcut.milliseconds.shape == (3,)


def test_a_shortcut_follows_the_address_of_a_place(posed):
    """Blender allocates new memory for an object's matrix when it copies the object again."""
    address, out, wanted = ctypes.addressof(posed.owner), *np.empty((2, 3, 3), np.float32)
    links = (ctypes.c_void_p * 2)()
    places = [((ctypes.addressof(links), 4), (ctypes.addressof(links) + 8, 4))]
    layout = Pose.first.offset, Pose.array.offset, *BONE
    shortcut = host.Shortcut(posed.deformer, [], [(address, [0, -1, 1], [1, 0, 3])], layout, places, [])
    for _ in range(2):
        matrices = [(ctypes.c_float * 17)(9, *placed(each)) for each in (MESH, ARMATURE)]
        links[:] = [ctypes.addressof(each) for each in matrices]
        assert shortcut.deform(out.ctypes.data)
        posed.deformer.deform(as_poses(posed, host.space_between(MESH, ARMATURE)), wanted)
        assert np.array_equal(out, wanted)


def test_a_shortcut_asks_whether_bones_were_copied(posed):
    """Then the caller compares them, and marks the copy."""
    mark, rest = ctypes.c_uint8(83), np.zeros((3, 3), np.float32)
    shortcut = host.Shortcut(
        sinew_native.Deformer(vertex_count=3),
        [],
        [],
        (0,) * 6,
        [],
        [],
        rest_positions=rest,
        bones=[ctypes.addressof(mark)],
    )
    out = np.ones((3, 3), np.float32)
    mark.value = 0
    assert shortcut.holds() and not shortcut.has_bones() and not shortcut.deform(out.ctypes.data) and out.all()
    mark.value = 83
    assert shortcut.has_bones() and shortcut.deform(out.ctypes.data) and not out.any()


def test_a_shortcut_without_a_place_for_the_shape():
    shortcut = host.Shortcut(
        sinew_native.Deformer(vertex_count=3), [], [], (0,) * 6, [], [], rest_positions=np.zeros((3, 3), np.float32)
    )
    with pytest.raises(ValueError, match="out is 0, and there are no shape keys"):
        shortcut.deform()


def test_the_space_between_two_places():
    assert host.space_between(MESH, MESH.copy()) is None
    wanted = np.linalg.inv(MESH.astype(np.float64)) @ ARMATURE
    assert np.allclose(host.space_between(MESH, ARMATURE), wanted, rtol=0, atol=1e-15)
    with pytest.raises(ValueError, match=r"mesh has shape \(3, 4\)"):
        host.space_between(MESH[:3], ARMATURE)
    with pytest.raises(ValueError, match="armature is float64"):
        host.space_between(MESH, np.eye(4))


@pytest.mark.parametrize("flat", ["mesh_place", "armature_place"])
def test_a_shortcut_of_something_flat(posed, flat):
    out = np.zeros((3, 3), np.float32)
    setattr(posed.owner, flat, placed(np.diag([1, 0, 1, 1])))
    assert not posed.shortcut.deform(out.ctypes.data)
    assert posed.owner.mode == 0b1011 and not out.any()


def test_a_shortcut_holds_as_long_as_nothing_has_changed(posed):
    out = np.zeros((3, 3), np.float32)
    assert posed.shortcut.holds()
    posed.owner.mode = 0
    assert posed.shortcut.holds()
    posed.owner.state = 8
    assert not posed.shortcut.holds() and not posed.shortcut.deform(out.ctypes.data)
    assert posed.owner.mode == 0 and not out.any()
    posed.owner.state = 7
    assert posed.shortcut.holds()


def test_a_shortcut_watches_a_tree(posed):
    """What the parts of the tree do is tested in tests/native/watched_test.cpp."""
    address = ctypes.addressof(posed.owner)
    root = address, -1, 0, [(Owner.state.offset, 4), (Owner.pose.offset, 8)]
    below = ctypes.addressof(posed.pose), 0, 1, [(Pose.first.offset, 8)]

    def made(*watched):
        return host.Shortcut(sinew_native.Deformer(vertex_count=3), list(watched), [], (0,) * 6, [], [])

    shortcut = made(root, below)
    assert shortcut.holds()
    posed.pose.first += 8
    assert not shortcut.holds()
    with pytest.raises(ValueError, match="watched struct 1 is not where region 0 of its parent points"):
        made(root, (*below[:2], 0, below[3]))
    with pytest.raises(ValueError, match="watched struct 0 has the parent 0, which is not one of those before it"):
        made(below, root)


class KeyWithPoints(ctypes.Structure):
    _fields_ = [*Key._fields_, ("points", ctypes.c_void_p), ("count", ctypes.c_int32)]


def keyed(stages=(), mode=0b11, relative=(0, 0, 0)):
    """A shortcut for two shape keys, without an armature; all that it reads and writes."""
    base = np.random.default_rng(4).normal(size=(5, 3)).astype(np.float32)
    native = sinew_native.ShapeKeys([base, base + 1, base - 2], np.array([0, 0, 0]))
    deformer = sinew_native.Deformer(keys=native)
    points = base.copy()
    structs = [KeyWithPoints(None, 1.0, 0, 0, points.ctypes.data, 5)]
    structs += [KeyWithPoints(None, 0.25), KeyWithPoints(None, 0.5)]
    owner = Owner(None, 7, mode)
    layout = tuple(getattr(KeyWithPoints, name).offset for name in ("flags", "value", "relative", "points", "count"))
    shortcut = host.Shortcut(
        deformer,
        [],
        [],
        (0,) * 6,
        [],
        [(ctypes.addressof(owner) + Owner.mode.offset, 0b01, 0)],
        stages,
        ([ctypes.addressof(key) for key in structs], layout, relative, base),
    )
    return SimpleNamespace(shortcut=shortcut, deformer=deformer, keys=structs, points=points, owner=owner)


def test_a_shortcut_holds_while_the_kept_bits_stay():
    rest = np.zeros((3, 3), np.float32)
    deformer = sinew_native.Deformer(vertex_count=3)
    owner = Owner(None, 7, 0b0101)
    address = ctypes.addressof(owner)
    watched = [(address, -1, 0, [(Owner.state.offset, 4)])]
    kept = [(address + Owner.mode.offset, 0b0011)]
    shortcut = host.Shortcut(deformer, watched, [], (0,) * 6, [], [], rest_positions=rest, kept=kept)
    out = np.ones((3, 3), np.float32)
    for mode, holds in ((0b0101, True), (0b1001, True), (0b0100, False), (0b0111, False), (0b0001, True)):
        owner.mode = mode
        out[:] = 1
        assert shortcut.holds() == holds and shortcut.deform(out.ctypes.data) == holds
        assert np.array_equal(out, rest) == holds


def test_a_shortcut_through_shape_keys():
    made = keyed()
    for values in ((0.25, 0.5), (1.0, 0.0)):
        made.keys[1].value, made.keys[2].value = values
        wanted = np.empty((5, 3), np.float32)
        made.deformer.deform([], wanted, np.array([0, *values], np.float32))
        assert made.shortcut.deform()
        assert np.array_equal(made.points, wanted)
        assert [key.relative for key in made.keys] == [0, -1, -1] and made.owner.mode == 0b10
        assert [key.flags for key in made.keys] == [0, 0, 0]


def test_a_shortcut_restores_keys_and_switches():
    made = keyed(relative=(0, 0, 1))
    before = made.points.copy()
    for _ in range(2):
        assert made.shortcut.deform() and not np.array_equal(made.points, before)
        assert made.shortcut.restore() and np.array_equal(made.points, before)
        assert [key.relative for key in made.keys] == [0, 0, 1] and made.owner.mode == 0b10
    made.keys[0].count = 4
    assert not made.shortcut.restore()
    with pytest.raises(ValueError, match="keys needs one number per key"):
        keyed(relative=(0, 0))


def test_a_shortcut_leaves_out_a_key_while_it_is_muted():
    made = keyed()
    wanted = np.empty((5, 3), np.float32)
    for muted in (1, 1, 0, 1):
        made.keys[1].flags = muted
        made.deformer.deform([], wanted, np.array([0, 0 if muted else 0.25, 0.5], np.float32))
        assert made.shortcut.deform() and np.array_equal(made.points, wanted) and made.keys[1].flags == muted


def test_a_shortcut_through_keys_of_another_mesh():
    made = keyed()
    before = made.points.copy()
    made.keys[0].count = 4
    assert not made.shortcut.deform()
    assert np.array_equal(made.points, before) and made.owner.mode == 0b11
    assert [key.flags for key in made.keys] == [0, 0, 0]


def smooth_of_five():
    edges = np.array([[0, 1], [1, 2], [2, 3], [3, 4]], np.int32)
    return sinew_native.Smooth(sinew_native.Topology(5, edges, np.zeros(1, np.int32), np.zeros(0, np.int32)))


def assert_smooths(made, stage):
    wanted = np.empty((5, 3), np.float32)
    made.deformer.deform([], wanted, np.array([0, 0.25, 0.5], np.float32), stages=[stage])
    assert made.shortcut.deform() and np.array_equal(made.points, wanted)


def test_a_shortcut_with_stages():
    stage = smooth_of_five().stage(0.5, 2)
    made = keyed([stage])
    assert_smooths(made, stage)
    assert made.shortcut.milliseconds.shape == (3,)


def test_a_shortcut_of_which_a_stage_changes():
    smooth = smooth_of_five()
    made = keyed([smooth.stage(0.5, 2)])
    for factor in (0.1, 0.9):
        made.shortcut.set_stage(0, smooth.stage(factor, 3))
        gc.collect()  # the shortcut keeps it
        assert_smooths(made, smooth.stage(factor, 3))
    before = smooth.stage(0.9, 3)
    hook = sinew_native.Hook(5, None, None, False).stage(np.eye(4))
    for number, stage, message in (
        (1, before, "there is no stage 1; there are 1"),
        (0, hook, "stage 0 can only be replaced by one of the same kind"),
        (0, "smooth", "stage 0 is not a Stage"),
    ):
        with pytest.raises(ValueError, match=message):
            made.shortcut.set_stage(number, stage)
    assert_smooths(made, before)


def test_a_shortcut_for_stages_alone():
    rest = np.random.default_rng(6).normal(size=(5, 3)).astype(np.float32)
    deformer, out = sinew_native.Deformer(vertex_count=5), np.empty((5, 3), np.float32)
    shortcut = host.Shortcut(deformer, [], [], (0,) * 6, [], [], rest_positions=rest)
    assert shortcut.deform(out.ctypes.data) and np.array_equal(out, rest)


def spoil_first(posed):
    posed.pose.first = posed.array[1]


def spoil_last(posed):
    posed.pose.last = posed.array[1]


def spoil_array(posed):
    posed.pose.array = None


def spoil_pose(posed):
    posed.owner.pose = None


def spoil_segments(posed):
    posed.bones[2].segment_count = 3


@pytest.mark.parametrize("spoil", [spoil_first, spoil_last, spoil_array, spoil_pose, spoil_segments])
def test_a_shortcut_through_another_pose(posed, spoil):
    spoil(posed)
    out = np.zeros((3, 3), np.float32)
    with pytest.raises(ValueError, match="other bones|other segments"):
        posed.shortcut.deform(out.ctypes.data)
    assert posed.owner.mode == 0b1011 and not out.any()


@pytest.mark.parametrize(
    "poses, sentence",
    [
        ([], "0 and 1 entries; the deformer and the stages have 1 layers"),
        ([(0, [], [])], "one number per bone"),
        ([(0, [0, 1], [1])], "one number per bone"),
        ([(0, [3], [3])], "too few joints"),
        ([(0, [0], [0])], "too few joints"),
    ],
)
def test_a_shortcut_that_does_not_fit(posed, poses, sentence):
    with pytest.raises(ValueError, match=sentence):
        host.Shortcut(posed.deformer, [], poses, (0,) * 6, [((0, -1), (0, -1))], [])


def test_keys_are_silenced_and_restored():
    keys = chained([Key(None, 1.0, 0), Key(None, 0.5, 2), Key(None, 0.25, 1), Key(None, 0.75, 0, 2)])
    addresses = host.list_addresses(ctypes.addressof(keys[0]), 4)
    assert addresses.tolist() == [ctypes.addressof(key) for key in keys]
    for _ in range(2):
        assert host.silence_keys(addresses, KEY).tolist() == [0, 0.5, 0, 0.75]
        assert [key.relative for key in keys] == [0, -1, -1, -1]
    host.restore_keys(addresses, KEY, [0, 0, 0, 2])
    assert [key.flags for key in keys] == [0, 2, 1, 0] and [key.relative for key in keys] == [0, 0, 0, 2]
    with pytest.raises(ValueError, match="numbers needs one number per key"):
        host.restore_keys(addresses, KEY, [0, 0])


def test_a_list_ends_where_it_ends():
    keys = chained([Key(), Key(), Key()])
    assert len(host.list_addresses(ctypes.addressof(keys[0]), 2)) == 2
    assert len(host.list_addresses(ctypes.addressof(keys[0]), 9)) == 3


def test_bytes_of_structs_whose_type_follows_from_a_number():
    class Choice(ctypes.Structure):
        _fields_ = [("next", ctypes.c_void_p), ("kind", ctypes.c_int16), ("data", ctypes.c_void_p)]

    small, large = ctypes.c_int32(7), (ctypes.c_int32 * 3)(1, 2, 3)
    last = Choice(None, 2, ctypes.addressof(large))
    first = Choice(ctypes.addressof(last), 1, ctypes.addressof(small))
    kinds = {1: host.Described([(0, 4)], [], [], []), 2: host.Described([(0, 12)], [], [], [])}
    described = host.Described([], [], [], [], [(Choice.kind.offset, Choice.data.offset, kinds)])
    read = lambda: described.bytes_of_list(ctypes.addressof(first))  # noqa: E731
    before = read()
    assert before == b"+" + bytes(small) + b"+" + bytes(large) + b"."
    assert described.bytes_of_list(ctypes.addressof(first), marks=False) == bytes(small) + bytes(large)
    large[2] = 4
    assert read() != before
    last.kind = 3
    assert read() is None
    last.kind, last.data = 2, None
    assert read() is None


def test_values_of_structs():
    class Part(ctypes.Structure):
        _fields_ = [("next", ctypes.c_void_p), ("text", ctypes.c_char * 8), ("small", ctypes.c_int8)]

    class Whole(ctypes.Structure):
        _fields_ = [("kind", ctypes.c_int16), ("name", ctypes.c_char_p), ("first", ctypes.c_void_p)]

    last = Part(None, b"b", -2)
    first = Part(ctypes.addressof(last), b"\xff", 3)
    wholes = [Whole(-7, b"name", ctypes.addressof(first)), Whole()]
    parts = host.StructValues([([Part.text.offset], "s"), ([Part.small.offset], "b")])
    name, there = [Whole.name.offset, 0], [Whole.first.offset]
    members = [
        ([Whole.kind.offset], "h"),
        (name, "s"),
        (there, parts),
        (there, "P"),
        ([*there, Part.small.offset], "b"),
    ]
    found = host.StructValues(members).of([ctypes.addressof(each) for each in wholes])
    assert found == [(-7, "name", [("\udcff", 3), ("b", -2)], ctypes.addressof(first), 3), (0, None, [], 0, None)]
    with pytest.raises(ValueError, match="members has one without an offset"):
        host.StructValues([([], "b")])
