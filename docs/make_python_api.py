#!/usr/bin/env python3
"""Makes what is written twice of the docstrings of the compiled module: those in sinew_native.pyi, and the reference in
python-api.md, which has the signatures of sinew_native.pyi.

    docs/make_python_api.py MODULE_FOLDER [--check]

MODULE_FOLDER has the compiled module, as ./dev build leaves it in build/python. --check writes nothing
and exits 1 with a sentence if the page or the stub is not what it would be.
"""

import ast
import importlib
import re
import sys
import textwrap
from pathlib import Path

PAGE = Path(__file__).resolve().parent / "python-api.md"
INTERFACE = PAGE.parents[1] / "native" / "bindings" / "sinew_native.pyi"
STUB = INTERFACE.read_text(encoding="utf-8")
WIDTH = 120
GROUPS = {
    "Files": "RigSkeleton Rig read_dmat write_dmat read_skeleton write_skeleton read_rig write_rig "
    "BvhClip read_bvh write_bvh",
    "Skeleton and poses": "Skeleton PoseClip forward_kinematics skinning_matrices local_transforms rotation_transforms",
    "Skinning": "Skin group_influences skin_linear skin_dual_quaternion skin_all Bends HalfTurn Layer ShapeKeys "
    "Deformer",
    "Automatic weights": "automatic_weights AutomaticWeights WeightReport",
    "Methods with data of their own": "MethodData BlendShares skin_blended RotationCenters skin_rotation_centers "
    "DirectDeltaMush skin_direct_delta_mush Progress",
    "After skinning": "Topology CorrectiveSmooth Smooth Hook MixedLayers Lattice SurfaceDeform MeshDeform Stage "
    "Stencils colours_apart",
    "Working on weights": "WeightTable smooth_weights reduce_weights mirror_weights transfer_weights",
    "Baking to bones": "decompose Decomposition",
    "Rigs": "RigProgram RigPlayer rig_bone_settings rig_constraint_settings DriverExpression",
    "Settings": "set_thread_count thread_count instruction_sets instruction_set set_instruction_set Task",
}
MARK = "<!-- From here on made by docs/make_python_api.py, from native/bindings: change it there. -->\n"


def stub(module):
    """The text of sinew_native.pyi: its signatures, with the module's docstrings."""
    lines = STUB.splitlines(keepends=True)
    nodes = [(node, getattr(module, node.name)) for node in ast.parse(STUB).body if hasattr(node, "name")]
    for owner, live in list(nodes):
        nodes += [(f, getattr(live, f.name)) for f in getattr(owner, "body", ()) if isinstance(f, ast.FunctionDef)]
    for node, live in sorted(nodes, key=lambda pair: -pair[0].lineno):  # from the end, so that line numbers hold
        old, said = node.body[0], live.__doc__.splitlines()
        if ast.get_docstring(node) is None:
            raise ValueError(f"{INTERFACE.name}: {node.name} needs a docstring to be replaced, such as an empty one")
        if isinstance(node, ast.FunctionDef) and not isinstance(live, property):
            said = said[2:]  # without pybind11's first line
        space = " " * old.col_offset
        said[0] = '"""' + said[0].replace('"', '\\"', said[0].startswith('"'))
        wrapped = [part for line in said for part in textwrap.wrap(line, WIDTH - len(space)) or [""]]
        if len(wrapped) > 1 or wrapped[0].endswith('"'):
            wrapped.append("")
        wrapped[-1] += '"""'
        lines[old.lineno - 1 : old.end_lineno] = [(space + line).rstrip() + "\n" for line in wrapped]
    return "".join(lines)


def source(function, above=""):
    """The stub's lines of a function, without its docstring."""
    first = min(node.lineno for node in (function, *function.decorator_list))
    lines = STUB.splitlines()[first - 1 : function.body[0].lineno - 1]
    indent = 0 if above else function.col_offset
    return "```python\n" + above + "\n".join(line[indent:] for line in lines).rstrip(":") + "\n```\n"


def prose(docstring, function=None):
    """Markdown, a list of what is said of parameters; without pybind11's first line, a function's types."""
    names = {a.arg for a in function.args.args + function.args.kwonlyargs} if function else set()
    blocks = [[]]
    for line in filter(None, docstring.splitlines()[1 if function else 0 :]):
        said_of, _, what = line.partition(": ")
        if what and names.issuperset(said_of.split(", ")):
            blocks[-1].append(f"* `{said_of}`: {what}")
        else:
            blocks += [[line], []]
    return "".join("\n" + "\n".join(block) + "\n" for block in blocks if block)


def class_text(node, live):
    functions = [f for f in node.body if isinstance(f, ast.FunctionDef)]
    properties = [f for f in functions if "property" in map(ast.unparse, f.decorator_list)]
    if functions and functions[0].name == "__init__":
        first = functions.pop(0)
        yield source(first, above=f"{STUB.splitlines()[node.lineno - 1]}\n")
        yield prose(live.__doc__) + prose(live.__init__.__doc__, first)
    else:
        yield prose(live.__doc__)
    if properties:
        yield "\nProperties:\n\n"
    for f in properties:
        yield f"* `{f.name}: {ast.unparse(f.returns)}`: {getattr(live, f.name).__doc__}\n"
    for f in functions:
        if f not in properties:
            yield f"\n#### {node.name}.{f.name}\n\n{source(f)}{prose(getattr(live, f.name).__doc__, f)}"


def body(module):
    nodes = {node.name: node for node in ast.parse(STUB).body if hasattr(node, "name")}
    missing = set(nodes).symmetric_difference(" ".join(GROUPS.values()).split())
    if missing:
        raise ValueError(f"{', '.join(missing)}: either in the stub or in the groups of make_python_api.py")
    types = re.findall(r"^_\w+.* = .+\n", STUB, re.MULTILINE)
    yield f"\nThe types in the signatures below:\n\n```python\n{''.join(types)}```\n"
    for title, names in GROUPS.items():
        yield f"\n## {title}\n"
        for name in filter(names.split().__contains__, nodes):
            node, live = nodes[name], getattr(module, name)
            yield f"\n### {name}\n\n"
            yield from (
                class_text(node, live) if isinstance(node, ast.ClassDef) else (source(node), prose(live.__doc__, node))
            )


def page(module):
    """The text of python-api.md: what people wrote down to MARK, then what is made."""
    written, mark, _ = PAGE.read_text(encoding="utf-8").partition(MARK)
    if not mark:
        raise ValueError(f"{PAGE.name} has lost its line {MARK.strip()}")
    return written + mark + re.sub(r"\b_(?=[A-Z])", "", "".join(body(module)))  # types of the stub's own


def check(module):
    """What is wrong with the page or the stub, a sentence, or None."""
    for path, wanted in ((PAGE, page(module)), (INTERFACE, stub(module))):
        if path.read_text(encoding="utf-8") != wanted:
            return f"{path.name} is not what the module says: run docs/make_python_api.py build/python"
    return None


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3) or sys.argv[2:] not in ([], ["--check"]):
        sys.exit(__doc__)
    sys.path.insert(0, sys.argv[1])
    loaded = importlib.import_module("sinew_native")
    if sys.argv[2:]:
        sys.exit(check(loaded))
    PAGE.write_text(page(loaded), encoding="utf-8")
    INTERFACE.write_text(stub(loaded), encoding="utf-8")
