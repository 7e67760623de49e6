"""sinew_native.host: structs laid out in memory as Blender lays them out, read and written by address."""

import ctypes

import numpy as np
import pytest

from sinew_native import host


class Weight(ctypes.Structure):
    _fields_ = [("group", ctypes.c_uint32), ("weight", ctypes.c_float)]


class DeformVertex(ctypes.Structure):
    _fields_ = [("entries", ctypes.c_void_p), ("count", ctypes.c_int32), ("flag", ctypes.c_int32)]


class Bone(ctypes.Structure):
    _fields_ = [("next", ctypes.c_void_p), ("other", ctypes.c_double), ("motion", ctypes.c_float * 16),
                ("segment_count", ctypes.c_int32), ("segments", ctypes.c_void_p)]


class Key(ctypes.Structure):
    _fields_ = [("next", ctypes.c_void_p), ("value", ctypes.c_float), ("flags", ctypes.c_uint16)]


BONE = (Bone.next.offset, Bone.motion.offset, Bone.segment_count.offset, Bone.segments.offset)
KEY = (Key.flags.offset, Key.value.offset)


def chained(structs):
    for this, following in zip(structs[:-1], structs[1:]):
        this.next = ctypes.addressof(following)
    return structs


def test_weights_in_stored_order():
    rows = [[(3, 0.5), (1, 0.25)], [], [(0, 1.0)]]
    entries = [(Weight * max(len(row), 1))(*row) for row in rows]
    vertices = (DeformVertex * 3)(*[
        (ctypes.addressof(own) if row else None, len(row), 0) for own, row in zip(entries, rows)])
    offsets, groups, weights = host.read_weights(ctypes.addressof(vertices), 3)
    assert offsets.tolist() == [0, 2, 2, 3] and offsets.dtype == np.int64
    assert groups.tolist() == [3, 1, 0] and weights.tolist() == [0.5, 0.25, 1.0]


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


@pytest.mark.parametrize("arguments, sentence", [
    (dict(first=(0, -1), counts=(1, 0)), "more bones"), (dict(first=(0, -1, 1, -1), counts=(1, 0, 3, 0)), "fewer bones"),
    (dict(counts=(1, 0, 4), joints=5), "other segments"), (dict(joints=3), "too few matrices")])
def test_another_pose_than_was_thought(arguments, sentence):
    bones, _, _ = pose()
    with pytest.raises(ValueError, match=sentence):
        read(bones, **arguments)


def test_keys_are_silenced_and_given_back():
    keys = chained([Key(None, 1.0, 0), Key(None, 0.5, 2), Key(None, 0.25, 1), Key(None, 0.75, 0)])
    addresses = host.list_addresses(ctypes.addressof(keys[0]), 4)
    assert addresses.tolist() == [ctypes.addressof(key) for key in keys]
    for _ in range(2):  # the second time its own muting is not taken for the user's
        assert host.silence_keys(addresses, KEY).tolist() == [0, 0.5, 0, 0.75]
        assert [key.flags & 1 for key in keys] == [0, 1, 1, 1]
    host.give_keys_back(addresses, KEY[0])
    assert [key.flags for key in keys] == [0, 2, 1, 0]


def test_a_list_ends_where_it_ends():
    keys = chained([Key(), Key(), Key()])
    assert len(host.list_addresses(ctypes.addressof(keys[0]), 2)) == 2
    assert len(host.list_addresses(ctypes.addressof(keys[0]), 9)) == 3
