"""sinew_native.pyi says what the compiled module is: the same names, parameters and defaults."""

import ast
import re
from pathlib import Path
from types import WrapperDescriptorType

import numpy as np
import pytest
import sinew_native as sinew

STUB = Path(__file__).resolve().parents[2] / "native" / "bindings" / "sinew_native.pyi"
TREE = ast.parse(STUB.read_text())
CLASSES = {node.name: node for node in TREE.body if isinstance(node, ast.ClassDef)}
FUNCTIONS = [node for node in TREE.body if isinstance(node, ast.FunctionDef)]


def is_public(name):
    return not name.startswith("_") or name in {"__init__", "__version__"}


def of_stub(function):
    """[(name, has a default)], with "*" where keywords begin."""
    arguments = function.args
    required = len(arguments.args) - len(arguments.defaults)
    parameters = [(a.arg, i >= required) for i, a in enumerate(arguments.args)]
    if arguments.kwonlyargs:
        parameters.append(("*", False))
    parameters += [(a.arg, d is not None) for a, d in zip(arguments.kwonlyargs, arguments.kw_defaults)]
    return parameters


def of_docstring(docstring):
    """The same from pybind11's first line, `name(a: T, b: U[V, W] = x) -> R`."""
    inside = re.match(r"\w+\((.*)\) -> ", docstring.splitlines()[0]).group(1)
    parts, depth = [""], 0
    for character in inside:
        depth += (character in "[(") - (character in "])")
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [(part.split(":")[0].strip(), " = " in part) for part in parts if part.strip()]


def kind_of_stub(function):
    for decorator in function.decorator_list:
        if isinstance(decorator, ast.Name) and decorator.id in {"property", "staticmethod"}:
            return decorator.id
    return "method"


def members_of_stub(node):
    return {f.name: kind_of_stub(f) for f in node.body if isinstance(f, ast.FunctionDef)}


def members_of_class(cls):
    kinds = {property: "property", staticmethod: "staticmethod"}
    return {
        name: kinds.get(type(value), "method")
        for name, value in vars(cls).items()
        if is_public(name) and not isinstance(value, WrapperDescriptorType)
    }  # has no constructor


def test_docstrings_are_understood():
    assert of_docstring("f(self: a.B, x: Dict[str, int] = {}, *, y: Tuple[int, ...]) -> None\n\nz") == [
        ("self", False),
        ("x", True),
        ("*", False),
        ("y", False),
    ]
    assert of_docstring("f() -> int") == []


def test_public_names():
    in_stub = {f.name for f in FUNCTIONS} | set(CLASSES)
    in_stub |= {node.target.id for node in TREE.body if isinstance(node, ast.AnnAssign)}
    in_module = set(vars(sinew)) - {"host"}  # the add-on's own, of no use outside Blender
    assert {name for name in in_stub if is_public(name)} == {name for name in in_module if is_public(name)}


@pytest.mark.parametrize("name", CLASSES)
def test_members(name):
    cls = getattr(sinew, name)
    assert members_of_stub(CLASSES[name]) == members_of_class(cls)
    bases = [base.__name__ for base in cls.__bases__ if base.__name__ in {*CLASSES, "ValueError"}]
    assert [base.id for base in CLASSES[name].bases] == bases


def methods():
    for name, node in CLASSES.items():
        for function in node.body:
            if isinstance(function, ast.FunctionDef) and kind_of_stub(function) != "property":
                yield pytest.param(getattr(getattr(sinew, name), function.name), function, id=f"{name}.{function.name}")
    for function in FUNCTIONS:
        yield pytest.param(getattr(sinew, function.name), function, id=function.name)


@pytest.mark.parametrize("live, function", list(methods()))
def test_parameters(live, function):
    assert of_stub(function) == of_docstring(live.__doc__)


ALIASES = {
    "_Float32": np.float32,
    "_Float64": np.float64,
    "_Int32": np.int32,
    "_Int64": np.int64,
    "_UInt8": np.uint8,
    "_Bool": np.bool_,
}


def samples():
    skeleton = sinew.RigSkeleton(np.array([-1]), np.zeros((1, 3)), np.ones((1, 3)), np.array([0]))
    one = np.eye(4, dtype=np.float32)[None]
    poses = sinew.PoseClip(np.array([[[1.0, 0, 0, 0]]]))
    rig = sinew.Rig(
        np.zeros((3, 3)), np.array([0, 3]), np.array([0, 1, 2]), skeleton, np.ones((3, 1)), poses, one[None]
    )
    skin = sinew.Skin.from_dense(np.zeros((1, 3)), np.ones((1, 1)))
    layer, keys = sinew.Layer(skin, "linear"), sinew.ShapeKeys([np.zeros((1, 3))], np.array([0]))
    numbers = np.array([0])
    bends = sinew.Bends(numbers, np.array([0, 1]), numbers, np.ones(1), numbers, np.array([1]), np.zeros((1, 4)))
    shares = sinew.BlendShares(np.ones(1))
    mush = sinew.DirectDeltaMush(np.zeros((1, 3)), numbers, np.array([], int), np.ones((1, 1)))
    topology = sinew.Topology(1, np.zeros((0, 2), int))
    hook = sinew.Hook(1)
    points = np.zeros((1, 3))
    weights = sinew.automatic_weights(np.zeros((1, 3)), numbers[:0], numbers[:0], np.zeros((1, 3)), np.ones((1, 3)))
    none, start = np.zeros(0, int), np.zeros(1, int)
    return {
        "Topology": topology,
        "Smooth": sinew.Smooth(topology),
        "Hook": hook,
        "HalfTurn": sinew.HalfTurn(),
        "Stencils": sinew.Stencils(start, none, none, 1),
        "Lattice": sinew.Lattice(1),
        "MeshDeform": sinew.MeshDeform(np.zeros(2, int), none, none, np.zeros((0, 3))),
        "SurfaceDeform": sinew.SurfaceDeform(1, none, start, none, start, *4 * [none]),
        "Stage": hook.stage(np.eye(4)),
        "CorrectiveSmooth": sinew.CorrectiveSmooth(topology),
        "Decomposition": sinew.decompose(points, points[None], none, none, bones=1),
        "MethodData": shares,
        "BlendShares": shares,
        "AutomaticWeights": weights,
        "WeightReport": weights.report,
        "WeightTable": sinew.WeightTable.from_dense(np.ones((1, 1))),
        "Progress": sinew.Progress(),
        "RotationCenters": sinew.RotationCenters(np.zeros((1, 3)), np.ones(1, bool)),
        "DirectDeltaMush": mush,
        "Bends": bends,
        "Skeleton": sinew.Skeleton(np.array([-1]), one),
        "RigSkeleton": skeleton,
        "PoseClip": poses,
        "BvhClip": sinew.BvhClip(["a"], np.array([-1]), points, 0.1, points[None], np.ones((1, 1, 4))),
        "Rig": rig,
        "RigProgram": sinew.RigProgram({"blender": 502}),
        "RigPlayer": sinew.RigPlayer(sinew.RigProgram({"blender": 502}), [], []),
        "Skin": skin,
        "Layer": layer,
        "ShapeKeys": keys,
        "Deformer": sinew.Deformer([layer], keys),
        "MixedLayers": sinew.MixedLayers([layer]),
        "Task": sinew.Task(lambda: 0),
        "DriverExpression": sinew.DriverExpression("a + frame", ["a"]),
    }


@pytest.mark.parametrize("name", CLASSES)
def test_types_of_properties(name):
    sample = samples()[name]
    for function in CLASSES[name].body:
        if not isinstance(function, ast.FunctionDef) or kind_of_stub(function) != "property":
            continue
        value, said = getattr(sample, function.name), ast.unparse(function.returns).split(" | ")[0]
        if said in ALIASES:
            assert value.dtype == ALIASES[said], function.name
            shape = re.match(r"\(([^()]+)\)", ast.get_docstring(function) or "")
            if shape is not None:
                assert value.ndim == len([size for size in shape.group(1).split(",") if size]), function.name
        else:
            python = {"_Convention": "str"}.get(said, said).partition("[")[0]
            assert type(value).__name__ == python, function.name
