"""What cls.__new__(cls) returns has no C++ half. Whatever is done with it is an error, and not the end of Python."""

import subprocess
import sys
from pathlib import Path

import pytest
import sinew_native as sinew

CLASSES = {
    name: cls
    for module in (sinew, sinew.host)
    for name, cls in vars(module).items()
    if type(cls).__name__ == "pybind11_type"
}
# Looks at each property, and calls each method with up to eight arguments: with more or fewer than it has, or with some
# of the wrong type, it is refused for that.
CODE = """
import sys; sys.path.insert(0, sys.argv[1])
import sinew_native as sinew
cls = getattr(sinew, sys.argv[2], None) or getattr(sinew.host, sys.argv[2])
for name in sys.argv[3:]:
    member = getattr(cls, name)
    if isinstance(member, property):
        calls = [member.fget]
    else:
        calls = [lambda own, count=count: member(own, *[own] * count) for count in range(8)]
    for call in calls:
        try:
            call(cls.__new__(cls))
        except (TypeError, RuntimeError):  # the latter is pybind11's where a shared_ptr is wanted
            continue
        print(name, "is not refused")
    print(name, flush=True)
"""


def members_of(cls):
    """Properties and methods, also those of its bases."""
    names = [name for base in cls.__mro__ if base in CLASSES.values() for name in vars(base)]
    return [name for name in names if name not in {"__init__", "__doc__", "__module__"}]


def test_there_are_classes():
    assert {"Skin", "Deformer", "Shortcut", "Stage"} <= CLASSES.keys()
    assert {"vertex_count", "set_rest_positions", "__repr__"} <= set(members_of(sinew.Skin))


@pytest.mark.parametrize("name", CLASSES)
def test_unmade_objects_are_refused(name):
    members, folder = members_of(CLASSES[name]), str(Path(sinew.__file__).parent)
    done = subprocess.run(
        [sys.executable, "-c", CODE, folder, name, *members], capture_output=True, text=True, check=False
    )
    assert done.stdout.splitlines() == members, f"{name} ended Python ({done.returncode}): {done.stderr}"


def test_it_says_what_is_missing():
    with pytest.raises(TypeError, match="__init__ was not called; call the class itself"):
        _ = sinew.Skin.__new__(sinew.Skin).vertex_count
