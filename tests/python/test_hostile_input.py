"""Every integer and array that a binding takes becomes what nobody should pass, one after the other: an error that
names the argument, or a result, and never a crash. What takes them is read from sinew_native.pyi."""

import ast
import gc
import itertools
import re

import numpy as np
import pytest
import sinew_native as sinew

from test_rigs_from_blender import RIGS
from test_stub import CLASSES, FUNCTIONS, kind_of_stub

EYE = np.eye(4)
BONE = {"name": "Arm", "matrix_local": EYE, "matrix": EYE[:3, :3], "head": [0, 0, 0], "head_local": [0, 0, 0]}
BONE |= {"tail_local": [0, 1, 0], "length": 1}
FACES = {"face_offsets": np.array([0, 3, 6]), "face_vertices": np.array([0, 1, 2, 2, 1, 3])}
POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.5]])
WEIGHTS = np.array([[1, 0], [0.5, 0.5], [0.25, 0.75], [0, 1.0]])
MATRICES = np.tile(np.eye(4, dtype=np.float32), (3, 2, 1, 1))
FRAMES = np.array([1.0, 2.5])
ENDS = {"heads": POINTS[:2], "tails": POINTS[1:3]}


def floats(array):
    return np.ascontiguousarray(array, np.float32)


def valid():
    """{name in the stub: (what is called, arguments)}: a call that is right, with each argument that has no default,
    and each integer or array besides."""
    skin = sinew.Skin.from_dense(POINTS, WEIGHTS)
    topology = sinew.Topology(4, np.array([[0, 1], [1, 2], [2, 0], [1, 3], [3, 2]]), *FACES.values())
    mush = sinew.DirectDeltaMush(POINTS, *FACES.values(), WEIGHTS)
    centers = sinew.RotationCenters(POINTS, np.ones(4, bool))
    rig = sinew.RigSkeleton(np.array([-1, 0]), POINTS[:2], POINTS[1:3], np.array([0, 1]))
    layer, keys = sinew.Layer(skin, "linear"), sinew.ShapeKeys([POINTS, POINTS + 1], np.array([0, 0]))
    bent = sinew.Skin(POINTS, np.arange(5), np.array([0, 1, 0, 1]), np.ones(4), 4)
    bends = {
        "vertices": np.array([0, 1]),
        "offsets": np.array([0, 1, 2]),
        "bones": np.array([0, 0]),
        "weights": np.ones(2),
        "first_joints": np.array([0]),
        "segments": np.array([1]),
        "axes": np.ones((1, 4)),
    }
    group, numbers = np.array([0, 0.5, 1, 1]), np.array([0, 1, 2, 3])
    attached = {
        "vertex_count": 4,
        "vertices": np.array([0, 3]),
        "offsets": np.array([0, 1, 2]),
        "attachments": np.array([0, 0]),
        "corner_offsets": np.array([0, 3, 6]),
        "corners": np.array([0, 1, 2, 2, 1, 3]),
        "corner_weights": np.full(6, 1 / 3),
        "distances": np.zeros(2),
        "influences": np.ones(2),
        "weights": group,
    }
    caged = {
        "offsets": np.array([0, 1, 2, 3, 4]),
        "cage_vertices": numbers,
        "cage_weights": np.ones(4),
        "cage_positions": POINTS,
        "weights": group,
    }
    program = sinew.RigProgram({"blender": 502})
    kept = mush.arrays()
    surface = {"positions": POINTS, **FACES}
    source = {f"source_{name}": array for name, array in surface.items()}
    return {
        "Skeleton.__init__": (sinew.Skeleton, {"parents": np.array([-1, 0]), "rest": np.stack((EYE, EYE))}),
        "RigSkeleton.__init__": (
            sinew.RigSkeleton,
            {"parents": np.array([-1, 0]), **ENDS, "weight_columns": np.array([0, 1])},
        ),
        "PoseClip.__init__": (sinew.PoseClip, {"rotations": np.tile(EYE[:1], (2, 2, 1))}),
        "BvhClip.__init__": (
            sinew.BvhClip,
            {"names": ["a", "b"], "parents": np.array([-1, 0]), "offsets": POINTS[:2], "frame_time": 0.1}
            | {"locations": POINTS[None, :2], "rotations": np.tile(EYE[:1], (1, 2, 1)), "ends": POINTS[2:]},
        ),
        "Rig.__init__": (
            sinew.Rig,
            {**surface, "skeleton": rig, "weights": WEIGHTS, "animation": MATRICES, "face_materials": np.array([0, -1])}
            | {"material_names": ["red"]},
        ),
        "Skin.__init__": (
            sinew.Skin,
            {"rest_positions": POINTS, "offsets": np.arange(5), "joints": np.array([0, 1, 0, 1]), "weights": np.ones(4)}
            | {"joint_count": 2},
        ),
        "Skin.from_dense": (sinew.Skin.from_dense, {"rest_positions": POINTS, "weights": WEIGHTS}),
        "Skin.set_rest_positions": (skin.set_rest_positions, {"positions": POINTS}),
        "BlendShares.__init__": (sinew.BlendShares, {"shares": group}),
        "RotationCenters.__init__": (sinew.RotationCenters, {"centers": POINTS, "has_center": np.ones(4, bool)}),
        "RotationCenters.compute": (sinew.RotationCenters.compute, {"skin": skin, **FACES}),
        "DirectDeltaMush.__init__": (
            sinew.DirectDeltaMush,
            {"rest_positions": POINTS, **FACES, "weights": WEIGHTS, "iterations": 2, "variant": 0},
        ),
        "DirectDeltaMush.compute": (
            sinew.DirectDeltaMush.compute,
            {"skin": skin, **FACES, "iterations": 2, "variant": 0},
        ),
        "DirectDeltaMush.from_arrays": (sinew.DirectDeltaMush.from_arrays, {"skin": skin, **kept}),
        "Bends.__init__": (sinew.Bends, bends),
        "Layer.__init__": (
            sinew.Layer,
            {
                "skin": bent,
                "method": "dual_quaternion",
                "stretch": "frame",
                "rest_frames": np.stack((EYE, EYE, EYE, EYE)),
                "mask": group,
                "share": group,
                "bends": sinew.Bends(**bends),
                "split_space": EYE,
            },
        ),
        "ShapeKeys.__init__": (
            sinew.ShapeKeys,
            {"positions": [POINTS, POINTS], "relative_to": np.array([0, 0]), "weights": [group, group]},
        ),
        "Topology.__init__": (
            sinew.Topology,
            {"vertex_count": 4, "edges": np.array([[0, 1], [1, 2], [2, 0], [1, 3], [3, 2]])}
            | dict(zip(("face_offsets", "corner_vertices"), FACES.values())),
        ),
        "Stencils.__init__": (
            sinew.Stencils,
            {"offsets": np.array([0, 2, 3]), "vertices": np.array([0, 3, 1]), "weights": np.array([0.5, 0.5, 1])}
            | {"vertex_count": 4, "scales": POINTS[:2], "shifts": POINTS[:2]},
        ),
        "Stencils.apply": (
            sinew.Stencils(np.array([0, 2, 3]), np.array([0, 3, 1]), np.array([0.5, 0.5, 1]), 4).apply,
            {"positions": floats(POINTS), "out": np.empty((2, 3), np.float32)},
        ),
        "colours_apart": (
            sinew.colours_apart,
            {"vertex_count": 4, "edges": np.array([[0, 1], [1, 2], [2, 3]]), **FACES, "steps": 2, "most": 9},
        ),
        "Stage.apply": (sinew.Hook(4).stage(EYE).apply, {"positions": floats(POINTS)}),
        "CorrectiveSmooth.__init__": (
            sinew.CorrectiveSmooth,
            {"topology": topology, "rest_positions": POINTS, "weights": group},
        ),
        "CorrectiveSmooth.set_rest_positions": (
            sinew.CorrectiveSmooth(topology, POINTS).set_rest_positions,
            {"positions": POINTS},
        ),
        "CorrectiveSmooth.stage": (sinew.CorrectiveSmooth(topology, POINTS).stage, {"iterations": 2}),
        "Smooth.__init__": (sinew.Smooth, {"topology": topology, "weights": group}),
        "Smooth.stage": (sinew.Smooth(topology).stage, {"iterations": 2}),
        "Hook.__init__": (sinew.Hook, {"vertex_count": 4, "vertices": np.array([0, 2]), "weights": group}),
        "Hook.stage": (sinew.Hook(4).stage, {"matrix": EYE, "uniform": EYE[:3, :3]}),
        "Lattice.__init__": (sinew.Lattice, {"vertex_count": 4, "weights": group}),
        "Lattice.stage": (
            sinew.Lattice(4).stage,
            {"points": POINTS, "counts": (2, 2, 1), "first": (0, 0, 0), "step": (1, 1, 1)}
            | {"interpolation": ("linear",) * 3, "matrix": EYE, "point_weights": group},
        ),
        "SurfaceDeform.__init__": (sinew.SurfaceDeform, attached),
        "SurfaceDeform.stage": (sinew.SurfaceDeform(**attached).stage, {"target": POINTS, "matrix": EYE}),
        "MeshDeform.__init__": (sinew.MeshDeform, caged),
        "MeshDeform.stage": (sinew.MeshDeform(**caged).stage, {"cage": POINTS, "matrix": EYE, "back": EYE[:3, :3]}),
        "MixedLayers.stage": (sinew.MixedLayers([layer]).stage, {"poses": [(MATRICES[0], EYE)]}),
        "Deformer.__init__": (sinew.Deformer, {"vertex_count": 4}),
        "Deformer.deform": (
            sinew.Deformer([layer], keys).deform,
            {"poses": [(MATRICES[0], EYE)], "out": floats(POINTS), "key_values": np.ones(2, np.float32)}
            | {"milliseconds": np.zeros(1)},
        ),
        "forward_kinematics": (
            sinew.forward_kinematics,
            {"skeleton": rig, "local": MATRICES, "out": np.empty_like(MATRICES)},
        ),
        "skinning_matrices": (
            sinew.skinning_matrices,
            {"skeleton": rig, "world": MATRICES, "out": np.empty_like(MATRICES)},
        ),
        "local_transforms": (sinew.local_transforms, {"skeleton": rig, "world": MATRICES, "may_move": [True, False]}),
        "rotation_transforms": (sinew.rotation_transforms, {"rotations": EYE[:2], "out": np.empty((2, 4, 4))}),
        "group_influences": (
            sinew.group_influences,
            {"offsets": np.arange(5), "groups": np.array([0, 1, 0, 1]), "weights": np.ones(4)}
            | {"joint_of_group": np.array([0, 1])},
        ),
        "skin_linear": (
            sinew.skin_linear,
            {"skin": skin, "matrices": MATRICES, "out": np.empty((3, 4, 3), np.float32)},
        ),
        "skin_dual_quaternion": (
            sinew.skin_dual_quaternion,
            {"skin": skin, "matrices": MATRICES, "out": np.empty((3, 4, 3), np.float32)}
            | {"stretch": "frame", "rest_frames": np.stack((EYE, EYE))},
        ),
        "skin_blended": (
            sinew.skin_blended,
            {"skin": skin, "shares": sinew.BlendShares(group), "matrices": MATRICES}
            | {"out": np.empty((3, 4, 3), np.float32), "stretch": "frame", "rest_frames": np.stack((EYE, EYE))},
        ),
        "skin_rotation_centers": (
            sinew.skin_rotation_centers,
            {"skin": skin, "centers": centers, "matrices": MATRICES, "out": np.empty((3, 4, 3), np.float32)},
        ),
        "skin_direct_delta_mush": (
            sinew.skin_direct_delta_mush,
            {"ddm": mush, "matrices": MATRICES, "out": np.empty((3, 4, 3), np.float32)},
        ),
        "set_thread_count": (sinew.set_thread_count, {"count": 2}),
        "automatic_weights": (
            sinew.automatic_weights,
            {**surface, **ENDS, "joints": np.array([0, 1]), "resolution": 16, "max_influences": 2}
            | {"fixed_vertices": np.array([3]), "fixed_weights": WEIGHTS[3:], "rigid_parts": np.array([0, 0, -1, -1])},
        ),
        "decompose": (
            sinew.decompose,
            {"rest": POINTS, "frames": POINTS[None] + np.zeros((3, 1, 1)), **FACES, "heads": POINTS[:2]}
            | {"matrices": MATRICES.astype(float), "max_influences": 2, "iterations": 2},
        ),
        "WeightTable.__init__": (
            sinew.WeightTable,
            {"offsets": np.arange(5), "bones": np.array([0, 1, 0, 1]), "weights": np.ones(4), "bone_count": 2},
        ),
        "WeightTable.from_dense": (sinew.WeightTable.from_dense, {"weights": WEIGHTS}),
        "smooth_weights": (
            sinew.smooth_weights,
            {"weights": WEIGHTS, **surface, "steps": 2, "mask": group, "locked": np.array([1])},
        ),
        "reduce_weights": (
            sinew.reduce_weights,
            {"weights": WEIGHTS, **surface, "matrices": MATRICES, "max_influences": 1, "rings": 1}
            | {"locked": np.array([0])},
        ),
        "mirror_weights": (
            sinew.mirror_weights,
            {"weights": WEIGHTS, **surface, "pairs": np.array([1, 0]), "axis": 0, "mask": group},
        ),
        "transfer_weights": (sinew.transfer_weights, {**source, "source_weights": WEIGHTS, **surface}),
        **{
            f"RigProgram.{name}": (getattr(program, name), {"frames": FRAMES})
            for name in ("evaluate", "segments", "skinning_matrices", "profile")
        },
        "RigProgram.skeleton": (sinew.RigProgram({"blender": 502, "bones": [BONE]}).skeleton, {"bones": [0]}),
        "RigProgram.values": (program.values, {"frames": FRAMES, "paths": []}),
        "RigProgram.convert": (
            sinew.RigProgram({"blender": 502, "bones": [BONE]}).convert,
            {
                "poses": EYE[None, None].repeat(2, 0).astype(np.float32),
                "bone": 0,
                "from_space": "POSE",
                "to_space": "LOCAL",
            },
        ),
    }


def call_with(name, argument):
    """The function, and the arguments of a call that is right and has this one."""
    function, values = valid()[name]
    if name == "decompose" and argument in ("bones", "weights"):  # what is known in place of these
        values = {own: value for own, value in values.items() if own not in ("heads", "matrices")}
        values[argument] = {"bones": 2, "weights": WEIGHTS}[argument]
    if name == "Deformer.deform" and argument == "rest_positions":
        values = {own: value for own, value in values.items() if own != "key_values"} | {argument: floats(POINTS)}
    return function, values


# What needs no numbers of its own, files, and lists of arrays, which have tests of their own.
ELSEWHERE = {"write_dmat", "skin_all"}
# What messages call an argument, if it is none of the words of its name.
OTHER_WORDS = {
    "rotations": ("quaternion",),
    "animation": ("anim.dmat",),
    "world": ("result",),
    "out": ("result",),
    "heads": ("rest transform",),
    "offsets": ("rest transform",),  # of a BvhClip
    "back": ("the matrix",),
    "poses": ("layer",),
    "vertex_count": ("no layers",),  # nor a count
    "positions": ("of key", "side of the mirror"),
    "rest_positions": ("scales",),
}


def is_array(annotation):
    return any(kind in annotation for kind in ("_Integers", "_Reals", "_Float32", "_Float64", "_Bool"))


def with_annotations():
    """Yields the name of what is called, and {argument: its annotation}."""
    functions = [(f.name, f) for f in FUNCTIONS]
    for name, node in CLASSES.items():
        members = (f for f in node.body if isinstance(f, ast.FunctionDef) and kind_of_stub(f) != "property")
        functions += [(f"{name}.{f.name}", f) for f in members]
    for name, function in functions:
        own = function.args.args + function.args.kwonlyargs
        yield name, {each.arg: ast.unparse(each.annotation) for each in own if each.annotation}


def arguments():
    """{name of what is called: {argument: its annotation}}, of integers and arrays."""
    found = {}
    for name, own in with_annotations():
        own = {arg: said for arg, said in own.items() if is_array(said) or re.match(r"(Sequence\[)?int\b", said)}
        if own and name not in ELSEWHERE:
            found[name] = own
    return found


ARGUMENTS = arguments()
INTEGERS = (-1, 2**31 - 1, 2**31, 2**62, -(2**62), 2**70, 1.5, "1", None)


def alike(array):
    """The same numbers in another form, by a name."""
    array = np.asarray(array)
    yield "not contiguous", np.repeat(array, 2, axis=-1)[..., ::2]
    kept = array.copy()
    kept.flags.writeable = False
    yield "read-only", kept
    yield "other bytes", array.astype(array.dtype.newbyteorder())


def spoilt(array):
    """What an array becomes, by a name."""
    array = np.asarray(array)
    yield "a list", array.tolist()
    yield "nothing", None
    yield "empty", array[:0]
    yield "one less", array[:-1]
    yield "one more", np.concatenate((array, array[-1:]))
    yield "another axis", array[..., None]
    yield "flat", array.reshape(-1) if array.ndim > 1 else np.array(5)
    yield "text", array.astype(str)
    yield "objects", array.astype(object)
    yield "complex", array.astype(complex)
    if array.dtype.kind == "i":
        yield "real", array + 0.5
        for number in (-1, -(2**31), 2**31 - 1, 2**32, 2**62, -(2**62)):
            changed = np.array(array, np.int64)
            yield f"all {number}", np.full_like(changed, number)
            changed.reshape(-1)[changed.size // 2] = number
            yield f"one {number}", changed
        yield "2^64 - 1", np.full(array.shape, 2**64 - 1, np.uint64)
    elif array.dtype.kind == "f":
        for number in (np.nan, np.inf, -np.inf, -1.0, 3e38, 1e300, 1e-45):
            changed = array.copy()
            with np.errstate(over="ignore"):
                yield f"all {number}", np.full_like(changed, number)
                changed.reshape(-1)[changed.size // 2] = number
            yield f"one {number}", changed


def hostile(value):
    """What a value becomes, by a name: of a list or tuple, the first item."""
    if isinstance(value, np.ndarray):
        yield from spoilt(value)
    elif isinstance(value, (list, tuple)):
        yield "a number", 5
        yield "too few", value[:-1]
        yield from ((f"the first {what}", type(value)((own, *value[1:]))) for what, own in hostile(value[0]))
    else:
        yield from ((repr(number), number) for number in INTEGERS)


def alike_values(value):
    if isinstance(value, np.ndarray):
        yield from alike(value)
    elif isinstance(value, (list, tuple)):
        yield from ((f"the first {what}", type(value)((own, *value[1:]))) for what, own in alike_values(value[0]))


def calls():
    for name, own in ARGUMENTS.items():
        for argument in own:
            yield pytest.param(name, argument, id=f"{name}-{argument}")


def words_of(argument):
    words = [word.removesuffix("s") for word in argument.split("_")]
    return [{"vertice": "vert", "vertex": "vert", "matrice": "matri", "axe": "ax"}.get(word, word) for word in words]


def is_named(argument, what, values, said):
    """Whether a sentence says which argument it is about, by a word of its name; where only its size is wrong, by the
    name of what it does not fit."""
    words = [*words_of(argument), *OTHER_WORDS.get(argument, ())]
    if re.search("empty|one less|one more|too few", what):
        words += ["result", *(word for other in values for word in words_of(other))]
    return "incompatible" not in said and any(word in said for word in words)


def outcome(value):
    """What a result consists of, to be compared: numbers, text, and these in lists and in the properties of objects."""
    if isinstance(value, np.ndarray):
        return value.shape, value.tolist()
    if isinstance(value, (list, tuple)):
        return [outcome(own) for own in value]
    if isinstance(value, dict):
        return {name: outcome(own) for name, own in value.items()}
    if isinstance(value, sinew.Stage):
        positions = floats(POINTS)
        value.apply(positions)
        return outcome(positions)
    if isinstance(value, tuple(STAGES)):
        make = next(make for kind, make in STAGES.items() if isinstance(value, kind))
        return outcome(make(value))
    if type(value).__module__.endswith("sinew_native"):
        names = [name for name, own in vars(type(value)).items() if isinstance(own, property)]
        return {name: outcome(getattr(value, name)) for name in names if name not in ("seconds", "report")}
    return value


# What shows the numbers with which these were made.
STAGES = {
    sinew.Hook: lambda own: own.stage(2 * EYE),
    sinew.Smooth: lambda own: own.stage(iterations=2),
    sinew.CorrectiveSmooth: lambda own: own.stage(iterations=2),
    sinew.Lattice: lambda own: own.stage(**valid()["Lattice.stage"][1]),
    sinew.SurfaceDeform: lambda own: own.stage(2 * POINTS, EYE),
    sinew.MeshDeform: lambda own: own.stage(2 * POINTS, EYE, EYE[:3, :3]),
    sinew.Topology: sinew.Smooth,
}


def done(function, values):
    """What a call returns, and what it has written, as text."""
    result = function(**values)
    written = {name: values[name] for name in ("out", "positions") if isinstance(values.get(name), np.ndarray)}
    return repr((outcome(result), outcome(written), outcome(getattr(function, "__self__", None))))


def copied(values):
    return {name: own.copy() if isinstance(own, np.ndarray) else own for name, own in values.items()}


def said_of(function, values):
    """What a call complains about, or None. Everything else than a refusal is an error here."""
    try:
        function(**values)
    except (ValueError, TypeError) as error:
        return str(error)
    return None


def test_every_binding_is_called():
    missing = set(ARGUMENTS) - set(valid())
    assert not missing, "give each of these a call in valid(), or ELSEWHERE"


@pytest.mark.parametrize("name, argument", calls())
def test_what_nobody_should_pass_is_refused_or_right(name, argument):
    function, values = call_with(name, argument)
    assert argument in values, "give it a value in valid()"
    expected = done(function, copied(values))
    wrong = []
    for what, value in hostile(values[argument]):
        said = said_of(function, copied(values) | {argument: value})
        if said is not None and not is_named(argument, what, values, said):
            wrong.append((what, said))
    for what, value in alike_values(values[argument]):
        try:
            found = done(function, copied(values) | {argument: value})
        except (ValueError, TypeError) as error:
            wrong += [] if is_named(argument, what, values, str(error)) else [(what, str(error))]
        else:
            wrong += [] if found == expected else [(what, "another result")]
    gc.collect()
    assert not wrong, "\n".join(f"{argument}, {what}: {said}" for what, said in wrong)


def objects():
    for name, own in with_annotations():
        for argument, said in own.items():
            if said in CLASSES and name in valid():
                yield pytest.param(name, argument, id=f"{name}-{argument}")


@pytest.mark.parametrize("name, argument", objects())
def test_none_and_text_are_no_objects(name, argument):
    function, values = valid()[name]
    for value in (None, "1"):
        with pytest.raises(TypeError, match=rf"^{argument} is .*; expected an? "):
            function(**values | {argument: value})


@pytest.mark.parametrize(
    "call, kind, said",
    [
        (lambda: sinew.Hook(), TypeError, "Hook() lacks the argument vertex_count"),
        (lambda: sinew.Hook(1, vertex=2), TypeError, "Hook() has no argument vertex"),
        (lambda: sinew.Hook(1, vertex_count=2), TypeError, "Hook() has the argument vertex_count twice"),
        (lambda: sinew.set_thread_count(1, 2), TypeError, "set_thread_count() takes 1 arguments without names, not 2"),
        (lambda: sinew.set_thread_count(1.5), TypeError, "count is a float; expected an integer"),
        (lambda: sinew.set_thread_count(2**31), ValueError, "count is 2147483648, which is out of range"),
        (lambda: sinew.Hook(2**70), ValueError, "vertex_count is 1180591620717411303424, which is out of range"),
        (lambda: sinew.Smooth(None), TypeError, "topology is None; expected a Topology"),
        (lambda: sinew.Hook(4, [1]), TypeError, "vertices is a list; expected a numpy array or None"),
        (lambda: sinew.ShapeKeys([[1]], FRAMES), TypeError, "positions is a list; expected a list, each a numpy array"),
        (
            lambda: sinew.Hook(4).stage(EYE, center=(1, 2)),
            TypeError,
            "center is a tuple; expected 3 in a list, each a number",
        ),
    ],
)
def test_the_sentence_about_a_call(call, kind, said):
    with pytest.raises(kind) as raised:
        call()
    assert str(raised.value) == said


# --- shapes ---------------------------------------------------------------------------------------

ONE_SHAPE = r"\(\w+(?: \+ 1)?,(?: [\w]+(?:, \w+)*)?\)"
SHAPES = re.compile(rf"{ONE_SHAPE}(?:(?:,| or) {ONE_SHAPE})*")
# Lists of arrays.
OF_LISTS = {
    "ShapeKeys.__init__": {"positions", "weights"},
    "Deformer.deform": {"poses"},
    "MixedLayers.stage": {"poses"},
}


def sizes_of(said):
    return [re.findall(r"\w+(?: \+ 1)?", each) for each in re.findall(ONE_SHAPE, said)]


def shapes_in(docstring):
    """{argument: its shapes, each a list of sizes as text}: each argument has its own line, `name, name: ...`."""
    entries = (line.partition(": ") for line in docstring.splitlines() if re.match(r"\w+(, \w+)*: ", line))
    found = ((names, SHAPES.search(said)) for names, _, said in entries)
    return {own: sizes_of(said.group()) for names, said in found if said is not None for own in names.split(", ")}


def shapes_of(name):
    """The shapes that the module says of a binding's arguments."""
    owner, _, member = name.rpartition(".")
    return shapes_in((getattr(getattr(sinew, owner), member) if owner else getattr(sinew, member)).__doc__)


def arrays_of(name):
    return [arg for arg, said in ARGUMENTS[name].items() if is_array(said) and arg not in OF_LISTS.get(name, ())]


WITH_ARRAYS = [name for name in ARGUMENTS if arrays_of(name)]


def test_shapes_are_understood():
    docstring = "f(a: T) -> U\n\nSays (X,).\na, b: (V, 3) or (F, V, 3), or c\nd: where; (faces + 1,)\ne: a number\n"
    points = [["V", "3"], ["F", "V", "3"]]
    assert shapes_in(docstring) == {"a": points, "b": points, "d": [["faces + 1"]]}


@pytest.mark.parametrize("name", WITH_ARRAYS)
def test_shapes_are_those_that_are_said(name):
    """A call that is right has the shapes that are said, with one size for each letter. Another number of axes is
    refused with these shapes, and so is another size where there is a number."""
    shapes, (function, values) = shapes_of(name), valid()[name]
    lacking = [argument for argument in arrays_of(name) if argument not in shapes]
    assert not lacking, "say their shapes in the docstring"
    sizes, taken = {}, []
    for argument in (each for each in arrays_of(name) if isinstance(values.get(each), np.ndarray)):
        array, axes = values[argument], {len(shape) for shape in shapes[argument]}
        shape = next((each for each in shapes[argument] if fits(array.shape, each, sizes)), None)
        assert shape is not None, f"{argument} {array.shape}: it says {shapes[argument]} with {sizes}"
        for number in {0, 1, 2, 3, 4, 5} - axes:
            other = array.reshape(-1)[:1].reshape((1,) * number)
            said = said_of(function, values | {argument: other})
            told = sizes_of((said or "").partition("; expected ")[2])
            if said is None or not all(any(is_case(own, each) for each in shapes[argument]) for own in told):
                taken.append((argument, other.shape, said))
        fixed = [i for i, size in enumerate(shape) if size.isdigit()]
        for axis, change in itertools.product(fixed, (-1, 1)):
            others = {each[axis] for each in shapes[argument] if len(each) == len(shape)}
            if str(array.shape[axis] + change) in others:
                continue
            other = np.take(array, [i % array.shape[axis] for i in range(array.shape[axis] + change)], axis)
            if said_of(function, values | {argument: other}) is None:
                taken.append((argument, other.shape))
    assert not taken


def fits(shape, said, sizes):
    """Whether a shape is what is said. Notes in `sizes` how much each letter is."""
    if len(shape) != len(said):
        return False
    found = {}
    for size, text in zip(shape, said):
        letter, _, more = text.partition(" + ")
        size -= int(more or 0)
        if (int(letter) if letter.isdigit() else {**sizes, **found}.setdefault(letter, size)) != size:
            return False
        if not letter.isdigit():
            found[letter] = size
    sizes |= found
    return True


def is_case(told, said):
    """Whether a shape that was told has the numbers of the one that is said; letters may differ."""
    return len(told) == len(said) and all(own == size for own, size in zip(told, said) if size.isdigit())


def any_part(value, path=()):
    """Yields the places of all that a description holds."""
    yield path
    for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        yield from any_part(value[key], (*path, key))


def spoilt_part(value, path, random):
    """Returns the description with another thing at that place, or with nothing there."""
    if not path:
        strange = (
            None,
            True,
            -1,
            2**70,
            -0.5,
            float("nan"),
            1e38,
            "",
            "b01",
            "XYZ",
            [],
            {},
            [[]],
            {"bone": "b02"},
            b"",
        )
        return strange[random.integers(len(strange))]
    first, rest = path[0], path[1:]
    if not rest and random.random() < 0.3:
        return (
            [e for i, e in enumerate(value) if i != first]
            if isinstance(value, list)
            else {key: e for key, e in value.items() if key != first}
        )
    changed = list(value) if isinstance(value, list) else dict(value)
    changed[first] = spoilt_part(value[first], rest, random)
    return changed


def test_descriptions_with_anything_in_them():
    """They are refused in a sentence or evaluated."""
    random = np.random.default_rng(1)
    accepted = 0
    for rig, _ in RIGS[:3]:
        description = rig["description"]
        places = list(any_part(description))
        by_kind = {}
        for place in places:  # as many of each entry, of which curves have most
            by_kind.setdefault(tuple(key for key in place if isinstance(key, str)), []).append(place)
        for place in [same[random.integers(len(same))] for same in by_kind.values() for _ in range(4)]:
            try:
                sinew.RigProgram(spoilt_part(description, place, random)).evaluate(FRAMES)
                accepted += 1
            except (ValueError, TypeError) as error:
                assert str(error)
    assert accepted > 50


def with_itself():
    inside = [1.0]
    inside.append(inside)
    return inside


def very_deep():
    inside = 1.0
    for _ in range(20_000):
        inside = [inside]
    return inside


@pytest.mark.parametrize("made", (with_itself, very_deep))
@pytest.mark.parametrize(
    "spoil",
    [
        lambda rig, inside: {**rig, "world": inside},
        lambda rig, inside: {**rig, "bones": [BONE | {"values": inside}]},
        lambda rig, inside: {**rig, "curves": [{"path": "a", "keys": inside}]},
        lambda rig, inside: {**rig, "properties": [{"path": '["a"]', "value": inside}]},
        lambda rig, inside: {**rig, "name": inside},
        lambda rig, inside: {**rig, "blender": inside},
        lambda rig, inside: {**rig, "unknown": inside},
        lambda rig, inside: {**rig, "bones": inside},
    ],
)
def test_lists_in_lists_without_end(spoil, made):
    """They neither overflow the stack nor fill memory, and raise what is promised."""
    with pytest.raises(ValueError) as raised:
        sinew.RigProgram(spoil({"blender": 502}, made()))
    assert len(str(raised.value)) < 300


def test_lists_in_lists_in_an_edit():
    program = sinew.RigProgram({"blender": 502, "bones": [BONE]})
    for made in (with_itself, very_deep):
        with pytest.raises(ValueError, match="nested without end"):
            program.edited({}, [{"path": 'pose.bones["Arm"].location', "keys": made()}])
        with pytest.raises(ValueError, match="location"):
            program.edited({'pose.bones["Arm"].location': made()}, [])


def test_strips_in_strips_without_end():
    strip = {"type": "META", "frame_start": 1, "frame_end": 2}
    strip["strips"] = [strip]
    with pytest.raises(ValueError, match="nested without end"):
        sinew.RigProgram({"blender": 502, "tracks": [{"strips": [strip]}]})
    inside = {"type": "META", "frame_start": 1, "frame_end": 2}
    for _ in range(10):
        inside = {"type": "META", "frame_start": 1, "frame_end": 2, "strips": [inside] * 10}
    with pytest.raises(ValueError, match="the rig has too many lists and dictionaries"):
        sinew.RigProgram({"blender": 502, "tracks": [{"strips": [inside]}]})


def test_texts_of_errors_are_short():
    """And say the beginning and the end, in whole letters."""
    name = "ä" * 4_000_000
    for call in (
        lambda: sinew.RigProgram({"blender": 502, "bones": [BONE | {"parent": name}]}),
        lambda: sinew.RigProgram({"blender": 502, name: 1}),
        lambda: sinew.RigProgram({"blender": [1.5] * 1_000_000}),
        lambda: sinew.RigProgram({"blender": 502}).evaluate(FRAMES, {name: 1}),
        lambda: sinew.Hook(4).stage(EYE, falloff=name),
        lambda: sinew.Hook(4, **{name: 1}),
        lambda: sinew.Hook([1.5] * 1_000_000),
    ):
        said = said_of(call, {})
        assert said and len(said) < 2100 and "\ufffd" not in said
    assert said_of(sinew.RigProgram, {"description": {"blender": 502, name: 1}}).endswith('", which is unknown')


def test_rigs_have_limits():
    bones, objects = [BONE] * 65_537, [{"name": "a"}] * 65_537
    with pytest.raises(ValueError, match="the rig has 65,537 bones; expected at most 65,536"):
        sinew.RigProgram({"blender": 502, "bones": bones})
    with pytest.raises(ValueError, match="the rig has 65,537 objects; expected at most 65,536"):
        sinew.RigProgram({"blender": 502, "objects": objects})


def unmade(cls):
    return cls.__new__(cls)


@pytest.mark.parametrize("kind", ("None", "unmade"))
@pytest.mark.parametrize(
    "call",
    [
        lambda layer, program: sinew.Deformer([layer]),
        lambda layer, program: sinew.MixedLayers([layer]),
        lambda layer, program: sinew.MixedLayers((layer,)),
        lambda layer, program: sinew.RigPlayer(program, [], []),
        lambda layer, program: sinew.RigPlayer.moments([(program, {})], 1),
        lambda layer, program: sinew.RigPlayer.begin([program], 1),
        lambda layer, program: sinew.RigProgram.evaluate(program, FRAMES),
        lambda layer, program: sinew.RigProgram.names.fget(program),
        lambda layer, program: sinew.Layer.vertex_count.fget(layer),
        lambda layer, program: sinew.RigPlayer.begin([None if program is None else unmade(sinew.RigPlayer)], 1),
    ],
)
def test_neither_none_nor_an_unmade_object_is_an_object(call, kind):
    """Not in lists and tuples either."""
    own = (None, None) if kind == "None" else (unmade(sinew.Layer), unmade(sinew.RigProgram))
    with pytest.raises(TypeError) as raised:
        call(*own)
    assert len(str(raised.value)) < 300


def test_what_may_be_none_is_none_or_an_object():
    skin = sinew.Skin.from_dense(POINTS, WEIGHTS)
    assert sinew.Deformer([sinew.Layer(skin, "linear", bends=None, data=None)], keys=None, stencils=None)
    for name in ("keys", "stencils"):
        with pytest.raises(TypeError):
            sinew.Deformer(**{name: unmade(sinew.ShapeKeys if name == "keys" else sinew.Stencils)})
