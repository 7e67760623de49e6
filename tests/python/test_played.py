"""The records of characters, within their memory, and what is stored in F-curves."""

import ast
import ctypes
import importlib
import sys
import types
from pathlib import Path

import numpy as np
import pytest
import sinew_native

package = sys.modules["sinew_alone"] = types.ModuleType("sinew_alone")
package.__path__ = [str(Path(__file__).resolve().parents[2] / "addon" / "sinew")]
records = importlib.import_module("sinew_alone.played.records")
host = sinew_native.host


def pose(size=100, value=0):
    return np.full(size, value, np.uint8)


def test_runs_of_frames():
    record = records.Record(records.Store(10**6))
    for frame in (5, 1, 2, 3, 9, -1):
        record.put(frame, pose())
    assert record.runs() == [(-1, -1), (1, 3), (5, 5), (9, 9)]
    assert record.at(2.0) is not None
    assert record.at(2.5) is None
    assert record.at(4) is None


def test_the_oldest_poses_of_all_are_dropped_first():
    store = records.Store(450)
    a, b = records.Record(store), records.Record(store)
    for frame in (1, 2):
        a.put(frame, pose())
        b.put(frame, pose())
    a.put(1, pose())  # new again
    b.put(3, pose())
    assert (a.runs(), b.runs(), store.used) == ([(1, 2)], [(2, 3)], 400)
    store.set_limit(150)
    assert (a.runs(), b.runs(), store.used) == ([], [(3, 3)], 100)
    b.clear()
    assert store.used == 0


def test_a_pose_that_does_not_fit_is_not_kept():
    store = records.Store(50)
    record = records.Record(store)
    record.put(1, pose())
    assert (len(record), store.used) == (0, 0)


# --- the memory of poses --------------------------------------------------------------------------


class Bone(ctypes.Structure):
    _fields_ = (
        ("next", ctypes.c_uint64),
        ("other", ctypes.c_float),
        ("matrix", ctypes.c_float * 4),
        ("computed", ctypes.c_float),
        ("count", ctypes.c_int32),
        ("segments", ctypes.c_uint64),
    )


def at(name):
    return getattr(Bone, name).offset


LAYOUT = host.PoseRecordLayout(
    at("next"), at("count"), [(at("matrix"), 16)], [(at("computed"), 4)], [(at("segments"), 8, 1, 1)]
)


def is_pose(address, record):
    return host.are_poses(LAYOUT, [(address, record)])[0]


def bones_of(counts, start=0.0):
    bones = (Bone * len(counts))()
    arrays = []
    for number, (bone, count) in enumerate(zip(bones, counts)):
        if number + 1 < len(counts):
            bone.next = ctypes.addressof(bones[number + 1])
        bone.matrix[:] = [start + 10 * number + i for i in range(4)]
        bone.computed, bone.other, bone.count = start + number, start - 1, count
        if count > 1:
            arrays.append(np.arange(2 * (count + 1), dtype=np.float32) + start)
            bone.segments = arrays[-1].ctypes.data
    return bones, arrays


def test_a_pose_is_recorded_and_played():
    (source, source_arrays), (target, target_arrays) = bones_of([1, 3, 0]), bones_of([1, 3, 0], 100.0)
    record = host.record_pose(ctypes.addressof(source), LAYOUT)
    assert is_pose(ctypes.addressof(source), record)
    assert not is_pose(ctypes.addressof(target), record)
    assert host.play_pose(ctypes.addressof(target), LAYOUT, record)
    assert is_pose(ctypes.addressof(target), record)
    assert [list(bone.matrix) for bone in target] == [list(bone.matrix) for bone in source]
    assert [bone.other for bone in target] == [99.0] * 3
    assert np.array_equal(source_arrays[0], target_arrays[0])
    target[0].computed += 1
    assert is_pose(ctypes.addressof(target), record)
    target_arrays[0][-1] += 1
    assert not is_pose(ctypes.addressof(target), record)


@pytest.mark.parametrize("counts", [[1, 3], [1, 3, 0, 0], [1, 4, 0], [3, 1, 0]])
def test_a_record_of_other_bones_is_not_played(counts):
    source, _arrays = bones_of([1, 3, 0])
    target, _target_arrays = bones_of(counts, 100.0)
    record = host.record_pose(ctypes.addressof(source), LAYOUT)
    assert not host.play_pose(ctypes.addressof(target), LAYOUT, record)
    assert target[0].matrix[0] == 100.0
    assert not is_pose(ctypes.addressof(target), record)


def test_an_original_gets_only_what_originals_have():
    (source, _arrays), (target, target_arrays) = bones_of([1, 3, 0]), bones_of([0, 2, 0], 100.0)
    record = host.record_pose(ctypes.addressof(source), LAYOUT)
    assert host.play_original_pose(ctypes.addressof(target), LAYOUT, record)
    assert [list(bone.matrix) for bone in target] == [list(bone.matrix) for bone in source]
    assert [bone.computed for bone in target] == [100.0, 101.0, 102.0]
    assert target_arrays[0][0] == 100.0
    other, _other_arrays = bones_of([0, 2], 100.0)
    assert not host.play_original_pose(ctypes.addressof(other), LAYOUT, record)
    assert other[0].matrix[0] == 100.0


def test_no_bone():
    record = host.record_pose(0, LAYOUT)
    assert host.play_pose(0, LAYOUT, record)
    assert not host.play_pose(ctypes.addressof(bones_of([1])[0]), LAYOUT, record)


# --- in one walk ----------------------------------------------------------------------------------


def addresses(*several):
    return [ctypes.addressof(bones) for bones in several]


def test_a_step_compares_and_writes_both():
    (first, _a), (second, _b) = bones_of([1, 3, 0]), bones_of([1, 3, 0], 50.0)
    (target, arrays), (original, original_arrays) = bones_of([1, 3, 0]), bones_of([0, 2, 0], 100.0)
    before, after = (host.record_pose(ctypes.addressof(bones), LAYOUT) for bones in (first, second))
    assert host.step_poses(LAYOUT, [(*addresses(target, original), before, after)]) == [True]
    assert is_pose(ctypes.addressof(target), after)
    assert [bone.computed for bone in target] == [50.0, 51.0, 52.0]
    assert [list(bone.matrix) for bone in original] == [list(bone.matrix) for bone in second]
    assert original_arrays[0][0] == 100.0
    assert arrays[0][0] == 50.0
    assert host.step_poses(LAYOUT, [(ctypes.addressof(target), 0, after, before)]) == [True]
    assert is_pose(ctypes.addressof(target), before)


@pytest.mark.parametrize("change", ["matrix", "segments", "count", "fewer", "record"])
def test_a_step_of_another_pose_is_refused(change):
    (first, _a), (second, _b) = bones_of([1, 3, 0]), bones_of([1, 3, 0], 50.0)
    target, arrays = bones_of([1, 3] if change == "fewer" else [1, 3, 0])
    before, after = (host.record_pose(ctypes.addressof(bones), LAYOUT) for bones in (first, second))
    if change == "matrix":
        target[2].matrix[3] += 1
    elif change == "segments":
        arrays[0][-1] += 1
    elif change == "count":
        target[1].count = 4
    elif change == "record":
        other, _other_arrays = bones_of([1, 3])
        after = host.record_pose(ctypes.addressof(other), LAYOUT)
    assert host.step_poses(LAYOUT, [(ctypes.addressof(target), 0, before, after)]) == [False]


def test_many_steps_are_independent():
    (first, _a), (second, _b) = bones_of([1, 3, 0]), bones_of([1, 3, 0], 50.0)
    before, after = (host.record_pose(ctypes.addressof(bones), LAYOUT) for bones in (first, second))
    kept = [bones_of([1, 3, 0]) for _ in range(40)]
    targets = [bones for bones, _arrays in kept]
    for bones in targets[::3]:
        bones[2].matrix[3] += 1
    said = host.step_poses(LAYOUT, [(ctypes.addressof(bones), 0, before, after) for bones in targets])
    assert said == [bool(number % 3) for number in range(40)]
    assert [is_pose(ctypes.addressof(bones), after) for bones in targets] == said
    assert host.step_poses(LAYOUT, []) == []


# --- F-curves -------------------------------------------------------------------------------------


class Key(ctypes.Structure):
    _fields_ = (("frame", ctypes.c_float), ("value", ctypes.c_float), ("selection", ctypes.c_int32))


class FCurve(ctypes.Structure):
    _fields_ = (
        ("keys", ctypes.c_uint64),
        ("path", ctypes.c_char_p),
        ("modifiers", ctypes.c_uint64),
        ("samples", ctypes.c_uint64),
        ("count", ctypes.c_int32),
        ("index", ctypes.c_int32),
        ("flag", ctypes.c_uint16),
        ("extrapolation", ctypes.c_int16),
    )


PLACES = {name: getattr(FCurve, name).offset for name, _ in FCurve._fields_}
CURVES = host.CurveLayout(
    *(PLACES[name] for name in ("keys", "count", "path", "modifiers", "samples", "extrapolation", "index", "flag")),
    0b11,
    ctypes.sizeof(Key),
    Key.frame.offset,
    [(0, 8)],
)


def fcurve(frames=(1, 5), path=b"location", **settings):
    keys = (Key * len(frames))(*(Key(frame, 2 * frame, 1) for frame in frames))
    found = FCurve(ctypes.addressof(keys), path, count=len(frames), **settings)
    found.alive = keys
    return found


def stored(*curves):
    return host.StoredCurves([ctypes.addressof(each) for each in curves], CURVES)


def test_what_is_stored_in_curves():
    found = stored(fcurve(), fcurve((), b"scale", index=2), fcurve(modifiers=8), fcurve(samples=8))
    assert len(found) == 4
    assert found.frames(0).tolist() == [1, 5]
    assert found.keys(0).view(np.float32).tolist() == [[1, 2], [5, 10]]
    assert found.keys(1).shape == (0, 8)
    assert [found.is_local(i) for i in range(4)] == [True, True, False, False]
    assert found.settings(1) == b"scale\0\0\0" + (2).to_bytes(4, "little") + b"\0\0"
    with pytest.raises(ValueError, match="there are 4 curves, no number 4"):
        found.frames(4)


def test_what_a_rigs_description_says_of_curves():
    class Bezier(ctypes.Structure):
        _fields_ = [("points", ctypes.c_float * 9), ("rest", ctypes.c_float * 3), ("choices", ctypes.c_int8 * 2)]

    rest, choices = Bezier.rest.offset, Bezier.choices.offset
    members = [(0, 36), (choices, 1), (choices + 1, 1), *((rest + at, 4) for at in (0, 4, 8))]
    places = [
        PLACES[name] for name in ("keys", "count", "path", "modifiers", "samples", "extrapolation", "index", "flag")
    ]
    layout = host.CurveLayout(*places, 0, ctypes.sizeof(Bezier), 12, members)
    key = Bezier((1, 2, 0, 3, 4, 0, 5, 6, 0), (7, 8, 9), (10, 3))
    curves = [fcurve((), index=2), fcurve((), modifiers=8, extrapolation=1)]
    curves[0].keys, curves[0].count = ctypes.addressof(key), 1
    own = [ctypes.addressof(each) for each in curves]
    plain, other = host.StoredCurves(own, layout).described()
    assert plain.pop("keys").tolist() == [[1, 2, 3, 4, 5, 6, 8, 9, 7, 10, 3]]  # amplitude, period, back
    assert plain == {"path": "location", "index": 2}
    assert other.pop("keys").shape == (0, 11)
    assert other == {"path": "location", "index": 0, "modifiers": None, "is_extrapolated": True}
    with pytest.raises(ValueError, match="a keyframe's members are others than those of a rig's description"):
        stored(fcurve()).described()


def test_which_curves_differ():
    before = stored(fcurve(), fcurve())
    assert before.differing(stored(fcurve(), fcurve(flag=0b11))) == []
    assert before.differing(stored(fcurve())) is None
    for other in (
        fcurve((1, 6)),
        fcurve((1,)),
        fcurve(flag=0b100),
        fcurve(index=1),
        fcurve(path=b"scale"),
        fcurve(samples=8),
    ):
        assert before.differing(stored(fcurve(), other)) == [1]


def test_the_states_are_set_in_one_module():
    """played/states.py draws them."""
    found = set()
    for path in (Path(__file__).resolve().parents[2] / "addon" / "sinew").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and node.attr == "state" and isinstance(node.ctx, ast.Store):
                found.add(path.name)
    assert found == {"states.py"}
