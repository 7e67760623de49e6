"""Calls of every binding with something in them that nobody should pass: `spoilt_calls.py FILE FIRST COUNT`.

Each call has a number, from which it follows; the number is written to FILE before the call, so that whoever runs this
knows which call ended Python. One line is printed for each call whose outcome is neither a result nor a ValueError,
TypeError or MemoryError with a short text, and for each that takes long.
"""

import ctypes
import gc
import os
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

if __name__ == "__main__":
    ROOT = Path(__file__).resolve().parents[2]
    sys.path[:0] = [str(Path(os.environ.get("SINEW_BUILD") or ROOT / "build").resolve() / "python")]
    sys.path.append(str(ROOT / "tests/blender"))

import numpy as np
import sinew_native as sinew
from sinew_native import host

import test_host
from test_hostile_input import BONE, FRAMES, MATRICES, POINTS, any_part, floats, valid
from test_rigs_from_blender import RIGS

LONGEST_TEXT = 2500  # in characters
SECONDS = 20.0
CALLS_WITH_THE_SAME_OBJECTS = 200
CLASSES = [each for module in (sinew, host) for each in vars(module).values() if type(each).__name__ == "pybind11_type"]
WITHOUT_CONSTRUCTOR = {"MethodData", "Stage", "WeightReport", "Decomposition", "AutomaticWeights"}
FIELDS = [("pose_matrix", 0, 0), ("values", 0, 3)]


class Strange(Exception):
    """What objects of our own raise."""


class Evil(list):
    """Raises whatever is done with it."""

    def evil(self, *_arguments):
        raise Strange

    __len__ = __getitem__ = __iter__ = __repr__ = __str__ = __float__ = __index__ = __int__ = __bool__ = evil
    __hash__ = __eq__ = __array__ = __fspath__ = __contains__ = evil


class Lying(list):
    def __len__(self):
        return 10**6


def endless():
    inside = [1.0]
    inside += [inside, inside]
    return inside


def deep(kind):
    inside = 1.0
    for _ in range(20_000):
        inside = kind((inside,))
    return inside


@cache
def texts():
    return "x" * 8_000_000, "\ud800", "\0", "XYZ", "pose.bones[" + '"' * 99, "é" * 5000


def strange_things(random):
    """Yields functions that make what no call should be given. None is a number, which might be an address."""
    yield from (lambda: None, lambda: "", dict, object, lambda: b"1", lambda: print, lambda: int, Evil, lambda: {1: 2})
    yield from (lambda text=text: text for text in texts())
    yield lambda: CLASSES[random.integers(len(CLASSES))].__new__(CLASSES[random.integers(len(CLASSES))])
    yield lambda: (each := CLASSES[random.integers(len(CLASSES))]).__new__(each)
    yield lambda: sinew.Progress()
    yield lambda: sinew.Hook(4)
    yield lambda: {"blender": 502}
    yield lambda: {None: endless(), deep(tuple): 1}
    yield lambda: [None]
    yield lambda: (None, None)
    yield lambda: (text for text in "abc")


def strange_numbers():
    yield from (
        endless,
        lambda: deep(list),
        lambda: deep(tuple),
        lambda: Lying([1.0]),
        lambda: [[]],
        lambda: [1] * 10**6,
    )
    for number in (True, -1, 0, 1, 7, 2**31 - 1, 2**31, 2**62, -(2**62), 2**70, 10**5000, 0.5, -0.0, 1e300, 1j):
        yield lambda number=number: number
    yield from (lambda number=number: float(number) for number in ("nan", "inf", "-inf"))
    for shape in ((), (0,), (3,), (4, 3), (2, 4, 4), (1,) * 32, (10**6,), (0, 4, 4)):
        for kind in ("f4", "f8", "i4", "i8", "u8", "?", "U3", "O", "c16", "M8[s]", "f2", ">f4", "V5"):
            yield lambda shape=shape, kind=kind: np.zeros(shape, kind)
    yield lambda: np.full((4, 3), np.nan)
    yield lambda: np.broadcast_to(np.float32(1), (50_000, 3))
    yield lambda: np.zeros((4, 6), np.float32)[:, ::-2]
    yield lambda: np.frombuffer(b"\1" * 49, np.uint8)[1:].view(np.float32).reshape(4, 3)  # not aligned


def spoilt_array(array, random):
    """Another array in place of one."""
    kind = random.integers(8)
    if kind == 0:
        return array.tolist()
    if kind == 1:
        return array.astype(random.choice(["f4", "f8", "i4", "i8", "u8", "?", "O", "c16", "f2", ">f8"]))
    if kind == 2:
        return array[: random.integers(len(array) + 1)] if array.ndim else array[None]
    if kind == 3:
        return np.concatenate((array, array[-1:])) if array.ndim else array
    if kind == 4:
        return array[..., None] if random.random() < 0.5 else array.reshape(-1)
    if kind == 5:
        return np.repeat(array, 2, axis=-1)[..., ::2] if array.ndim else array
    changed = array.copy()
    numbers = (-1, 0, 1, 7, 2**31 - 1, -(2**31)) if array.dtype.kind in "iu" else (np.nan, np.inf, -1, 3e38, 1e-45, 0)
    if changed.size and array.dtype.kind in "iuf":
        flat = changed.reshape(-1)
        with np.errstate(all="ignore"):
            where = slice(None) if kind == 6 else random.integers(changed.size)
            flat[where] = np.array(random.choice(numbers)).astype(array.dtype)
    return changed


def replaced(value, path, new):
    """Returns a value in which something else is at a place."""
    if not path:
        return new(value)
    first, *rest = path
    if isinstance(value, dict):
        return value | {first: replaced(value[first], rest, new)}
    own = list(value)
    own[first] = replaced(own[first], rest, new)
    return own if isinstance(value, list) else tuple(own)


@cache
def places_of_rigs():
    """Of each rig the places in its description, by kind: of keys there are most."""
    found = []
    for rig, _ in RIGS[:3]:
        kinds = {}
        for place in any_part(rig["description"]):
            kinds.setdefault(tuple(key for key in place if isinstance(key, str)), []).append(place)
        found.append((rig["description"], list(kinds.values())))
    return found


def parts(value, path=()):
    """Yields the places in a call's arguments."""
    if path:
        yield path
    inside = value if isinstance(value, dict) else range(len(value)) if isinstance(value, (list, tuple)) else ()
    for key in inside:
        yield from parts(value[key], (*path, key))


def spoil(value, random, numbers):
    """Returns something else in place of a value."""
    if numbers and isinstance(value, np.ndarray) and random.random() < 0.7:
        return spoilt_array(value, random)
    if isinstance(value, (list, tuple)) and random.random() < 0.4:
        own = list(value)
        if own and (not numbers or random.random() < 0.5):  # spoilt twice, offsets never have the right length
            del own[random.integers(len(own))]
        elif own:
            own.append(own[random.integers(len(own))])
        return (list if random.random() < 0.5 else tuple)(own)
    things = [*strange_things(random), *(strange_numbers() if numbers else ())]
    return things[random.integers(len(things))]()


def more_calls(folder):
    """What valid() of test_hostile_input has not, in the same form: {name: (function, arguments)}."""
    program = sinew.RigProgram({"blender": 502, "bones": [BONE], "values": [{"name": "lamp", "value": 1}]})
    skin = sinew.Skin.from_dense(POINTS, np.array([[1, 0], [0.5, 0.5], [0.25, 0.75], [0, 1.0]]))
    player = {"program": program, "parts": [["lamp"], ['pose.bones["Arm"].location']], "fields": FIELDS}
    players = [sinew.RigPlayer(**player) for _ in range(2)]
    rig = sinew.Rig(**valid()["Rig.__init__"][1])
    sinew.write_rig(folder, rig)
    clip = sinew.BvhClip(**valid()["BvhClip.__init__"][1])
    sinew.write_bvh(folder / "own.bvh", clip)
    curve = {"path": 'pose.bones["Arm"].location', "index": 0, "keys": [0.0] * 11}
    known = sinew.RigProgram({"blender": 502, "bones": [BONE], "curves": [curve]})
    return {
        "skin_all": (
            sinew.skin_all,
            {"jobs": [(skin, MATRICES[0], np.empty((4, 3), np.float32), "dual_quaternion", "polar", None, None)]},
        ),
        "RigPlayer.__init__": (sinew.RigPlayer, player),
        "RigPlayer.edited": (sinew.RigPlayer(known, [], FIELDS).edited, {"set": {}, "curves": [curve]}),
        "RigPlayer.moments": (
            sinew.RigPlayer.moments,
            {"rigs": [(each, {"lamp": 2.0}) for each in players], "frame": 2.5},
        ),
        "RigPlayer.begin": (sinew.RigPlayer.begin, {"players": players, "frame": 2.5}),
        "RigProgram.__init__": (
            sinew.RigProgram,
            {"description": {"blender": 502, "bones": [BONE], "curves": [curve]}},
        ),
        "RigProgram.edited": (known.edited, {"set": {'pose.bones["Arm"].scale': [1, 2, 3.0]}, "curves": [curve]}),
        "PoseClip.sample": (sinew.PoseClip(np.tile(np.eye(4)[:1], (2, 2, 1))).sample, {"time": 0.5}),
        "MixedLayers.__init__": (sinew.MixedLayers, {"layers": [sinew.Layer(skin, "linear")]}),
        "write_dmat": (sinew.write_dmat, {"path": folder / "own.dmat", "array": POINTS, "binary": True}),
        "read_dmat": (sinew.read_dmat, {"path": folder / "own.dmat"}),
        "read_skeleton": (sinew.read_skeleton, {"path": folder / "skeleton.bf", "convention": None}),
        "write_skeleton": (sinew.write_skeleton, {"path": folder / "own.bf", "skeleton": rig.skeleton}),
        "write_bvh": (sinew.write_bvh, {"path": folder / "own.bvh", "clip": clip}),
        "read_bvh": (sinew.read_bvh, {"path": folder / "own.bvh"}),
        "read_rig": (sinew.read_rig, {"folder": folder, "skeleton": "skeleton.bf"}),
        "write_rig": (sinew.write_rig, {"folder": folder, "rig": rig, "skeleton": "skeleton.bf"}),
        "Task.__init__": (lambda **given: sinew.Task(**given).result(), {"work": int}),
        "Task.wait": (sinew.Task(int).wait, {"seconds": 0.1}),
        "Task.result": (sinew.Task.result, {"self": sinew.Task(int)}),
        "DriverExpression.__init__": (
            sinew.DriverExpression,
            {"text": "clamp(a) if b > 2 else -frame", "names": ["a", "b"]},
        ),
        "DriverExpression.value": (sinew.DriverExpression("a / 2", ["a"]).value, {"variables": [0.5], "frame": 1.0}),
        "set_instruction_set": (sinew.set_instruction_set, {"name": "auto"}),
    }


def host_calls():
    """As more_calls, of sinew_native.host. What it is given are addresses: numbers are not spoilt, only what they are.
    Also returns what has to stay alive."""
    bones, *_ = kept = test_host.pose()
    vertices, entries = test_host.some_weights()
    keys = test_host.chained([test_host.Key(None, 0.5, 0, 0) for _ in range(3)])
    addresses = [ctypes.addressof(key) for key in keys]
    shaped, staged = test_host.keyed(), test_host.keyed((sinew.Hook(5).stage(np.eye(4)),))
    described = host.Described([(0, 4)], [], [], [])
    layout = host.PoseRecordLayout(test_host.Bone.next.offset, test_host.Bone.segment_count.offset, [(16, 64)], [], [])
    bone, floats_of = ctypes.addressof(bones[0]), np.float32
    record = host.record_pose(bone, layout)
    curves = host.CurveLayout(0, 0, 0, 0, 0, 0, 0, 0, 0, 4, 0, [(0, 4)])
    memory = (ctypes.c_char * 64)()
    stored = host.StoredCurves([ctypes.addressof(memory)], curves)
    values, places = host.StructValues([([0], "b")]), host.PlaceLayout(0, 8, 136, 4)
    joints, counts = np.array([0, -1, 1], np.int32), np.array([1, 0, 3], np.int32)
    offsets = np.array([0, 2, 2, 3]), np.array([3, 1, 0], np.int32), np.ones(3, floats_of)
    calls = {
        "read_weights": (host.read_weights, {"vertices": ctypes.addressof(vertices), "count": 3}),
        "write_weights": (
            host.write_weights,
            {"vertices": ctypes.addressof(vertices), **dict(zip(("offsets", "groups", "weights"), offsets))},
        ),
        "read_surface_binding": (host.read_surface_binding, {"vertices": 0, "count": 0}),
        "read_pose": (
            host.read_pose,
            {"bone": bone, "first_joints": joints, "joint_counts": counts, "layout": test_host.BONE}
            | {"out": np.zeros((4, 4, 4), floats_of)},
        ),
        "is_any_flat": (
            host.is_any_flat,
            {"motions": np.zeros((4, 4, 4), floats_of), "first_joints": joints, "joint_counts": counts},
        ),
        "list_addresses": (host.list_addresses, {"first": addresses[0], "count": 3}),
        "silence_keys": (host.silence_keys, {"keys": addresses, "layout": test_host.KEY}),
        "restore_keys": (host.restore_keys, {"keys": addresses, "layout": test_host.KEY, "numbers": [0, 0, 0]}),
        "Described.__init__": (
            host.Described,
            {"regions": [(0, 4)], "texts": [8], "structs": [(0, described)], "lists": [(0, None)]}
            | {"choices": [(0, 8, {1: described})]},
        ),
        "Described.bytes_of_list": (described.bytes_of_list, {"first": 0, "marks": True}),
        "StructValues.__init__": (host.StructValues, {"members": [([0], "b"), ([8], values)]}),
        "StructValues.of": (values.of, {"addresses": addresses}),
        "PoseRecordLayout.__init__": (
            host.PoseRecordLayout,
            {"next": 0, "segment_count": 8, "members": [(0, 4)], "computed": [(4, 4)], "segments": [(8, 4, 1, 1)]},
        ),
        "record_pose": (host.record_pose, {"bone": bone, "layout": layout}),
        "play_pose": (host.play_pose, {"bone": bone, "layout": layout, "record": record}),
        "play_original_pose": (host.play_original_pose, {"bone": bone, "layout": layout, "record": record}),
        "step_poses": (host.step_poses, {"layout": layout, "steps": [(bone, 0, record, record)]}),
        "are_poses": (host.are_poses, {"layout": layout, "asked": [(bone, record)]}),
        "PlaceLayout.__init__": (host.PlaceLayout, {"pointer": 0, "matrix": 8, "flags": 136, "mirrored": 4}),
        "write_places": (host.write_places, {"layout": places, "rows": [(-1, np.eye(4, dtype="f").tobytes(), [], 0)]}),
        "CurveLayout.__init__": (
            host.CurveLayout,
            dict.fromkeys(("keys", "count", "path", "modifiers", "samples", "extrapolation", "index", "flag"), 0)
            | {"ignored": 0, "key_size": 4, "frame": 0, "members": [(0, 4)]},
        ),
        "StoredCurves.__init__": (host.StoredCurves, {"curves": [], "layout": curves}),
        "StoredCurves.__len__": (host.StoredCurves.__len__, {"self": stored}),
        "StoredCurves.described": (host.StoredCurves.described, {"self": stored}),
        "StoredCurves.differing": (stored.differing, {"other": stored}),
        **{
            f"StoredCurves.{name}": (getattr(stored, name), {"number": 0})
            for name in ("is_local", "settings", "frames", "keys")
        },
        "Shortcut.__init__": (
            host.Shortcut,
            {"deformer": sinew.Deformer(vertex_count=4), "watched": [], "poses": [], "layout": (0,) * 6, "places": []}
            | {"switches": [], "stages": (sinew.Hook(4).stage(np.eye(4)),), "keys": None}
            | {"rest_positions": floats(POINTS), "kept": [], "bones": []},
        ),
        "Shortcut.set_stage": (staged.shortcut.set_stage, {"number": 0, "stage": sinew.Hook(5).stage(np.eye(4))}),
        "Shortcut.deform": (shaped.shortcut.deform, {"out": 0}),
        **{
            f"Shortcut.{name}": (getattr(host.Shortcut, name), {"self": shaped.shortcut})
            for name in ("holds", "has_bones", "restore")
        },
        "space_between": (host.space_between, {"mesh": test_host.MESH, "armature": test_host.ARMATURE}),
    }
    return {f"host.{name}": call for name, call in calls.items()}, (
        kept,
        vertices,
        entries,
        keys,
        shaped,
        staged,
        record,
        memory,
    )


def members():
    """Yields each function and method of the module, by the names that the calls have."""
    for prefix, module in (("", sinew), ("host.", host)):
        for name, own in vars(module).items():
            if own in CLASSES:
                for member, function in vars(own).items():
                    is_public = not member.startswith("_") or member in {"__init__", "__len__"}
                    if (
                        is_public
                        and not isinstance(function, property)
                        and not (member == "__init__" and name in WITHOUT_CONSTRUCTOR)
                    ):
                        yield f"{prefix}{name}.{member}"
            elif callable(own) and not isinstance(own, type):
                yield prefix + name


def called(function, values):
    """Calls a function with arguments by name, of which `self` comes first."""
    own = [values["self"]] if "self" in values else []
    return function(*own, **{name: value for name, value in values.items() if name != "self"})


def objects(calls):
    """One of each class, with its name."""
    found = {}
    for name, (function, values) in calls.items():
        if name.endswith(".__init__") and isinstance(function, type):
            found[name.removesuffix(".__init__")] = function(**values)
    return found


def spoilt_at(place, value, random, numbers):
    try:
        return replaced(value, place, lambda own: spoil(own, random, numbers))
    except Exception:  # something else is there already, or it cannot become that
        return value


def spoilt_call(number, calls, made):
    """Returns what call `number` is, as a text and as a function."""
    random = np.random.default_rng((63, number))
    kind = random.random()
    if kind < 0.2:  # a rig with something else in it
        description, kinds = places_of_rigs()[random.integers(3)]
        for _ in range(random.integers(1, 4)):
            same = kinds[random.integers(len(kinds))]
            place = same[random.integers(len(same))]
            description = spoilt_at(place, description, random, True)
        return "a rig", lambda: sinew.RigProgram(description).evaluate(FRAMES)
    name = list(calls)[random.integers(len(calls))]
    function, values = calls[name]
    numbers = not name.startswith("host.")
    if kind < 0.3:  # another object, or none, as self; other arguments
        own = made[list(made)[random.integers(len(made))]]
        members = [getattr(type(own), each) for each in dir(type(own)) if not each.startswith("_")]
        method = members[random.integers(len(members))] if members else type(own)
        method = method.fget if isinstance(method, property) else method
        if method in (host.Shortcut.set_stage, host.Shortcut.deform) or type(own).__module__.endswith("host"):
            numbers = False
        given = [spoil(None, random, numbers) for _ in range(random.integers(0, 4))]
        if random.random() < 0.7:
            given = [type(own).__new__(type(own)) if random.random() < 0.5 else own, *given]
        return f"{type(own).__name__}: {method}", lambda: method(*given)
    values = dict(values)
    if kind < 0.35 and numbers:  # another name, or none
        values["x" * random.choice([1, 10**7])] = values.pop(list(values)[random.integers(len(values))])
        return f"{name} without an argument", lambda: called(function, values)
    places = list(parts(values))
    for _ in range(random.integers(1, 4)):
        place = places[random.integers(len(places))]
        values = spoilt_at(place, values, random, numbers)
    return name, lambda: called(function, values)


def main(file, first, count):
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (6 << 30, -1))
    sinew.set_thread_count(2)
    with open(file, "wb", buffering=0) as written, tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for number in range(first, first + count):
            if number % CALLS_WITH_THE_SAME_OBJECTS == 0 or number == first:
                of_host, _kept = host_calls()
                calls = valid() | more_calls(Path(folder)) | of_host
                made = objects(calls)
                gc.collect()
            os.pwrite(written.fileno(), b"%12d" % number, 0)
            said, call = spoilt_call(number, calls, made)
            start = time.process_time()
            try:
                call()
            except (ValueError, TypeError, MemoryError, Strange) as error:
                if not isinstance(error, Strange) and not 0 < len(str(error)) < LONGEST_TEXT:
                    print(f"{number}, {said}: a text of {len(str(error))} characters, {str(error)[:200]!r}")
            except BaseException as error:
                print(f"{number}, {said}: {type(error).__name__}, {str(error)[:200]!r}")
            if time.process_time() - start > SECONDS:
                print(f"{number}, {said}: {time.process_time() - start:.1f} s")
        os.pwrite(written.fileno(), b"%12d" % (first + count), 0)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
