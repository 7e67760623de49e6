"""After Blender crashed while Sinew used its memory, the next one begins without it, and says so. Whatever else ends a
Blender changes nothing. Each in a Blender and a profile of its own."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import bpy
import pytest

from helpers import COMMAND, needs_memory, needs_program

pytestmark = [needs_program, needs_memory]
VERSION = ".".join(map(str, bpy.app.version))
CRASHED = (
    f"Blender {VERSION} crashed while Sinew used its memory, so Blender's own modifiers deform: press Try Again in "
    "Sinew's preferences"
)
# A character that is played. `how` is what happens in the middle of a frame, or where nothing of Sinew's runs.
SCRIPT = """
import ctypes, importlib, json, os, signal, sys
sys.path.insert(0, {tests!r})
import bpy
from characters import accelerate, make_armature, make_mesh, pose
from helpers import addon_module, assert_same_shape, deform_small_meshes, twin_of
is_deforming = lambda ob: addon_module("run.characters").character(ob).is_deforming
deform_small_meshes()
bpy.ops.wm.read_homefile(use_empty=True)
armature = make_armature()
ob = make_mesh(armature, False)
twin = twin_of(ob)
for frame in (1, 10):
    pose(armature, frame, False)
accelerate(ob)
scene = bpy.context.scene
for frame in range(2, 9):
    scene.frame_set(frame)
    assert_same_shape(ob, twin)
use = addon_module("main.memory_use")
print("FACTS " + json.dumps(use.facts() | {{"deforms": is_deforming(ob)}}), flush=True)
in_frame = lambda function: setattr(addon_module("run.in_pass"), "_prepare", lambda *_: function())
{how}
ob.data.update()
scene.frame_set(5)
"""
ENDS = {
    "memory is not there": ("in_frame(lambda: ctypes.string_at(0))", True),
    "a signal": ("in_frame(lambda: os.kill(os.getpid(), signal.SIGSEGV))", True),
    "an assertion": ("in_frame(os.abort)", True),
    "in the fast path": (
        "addon_module('run.fast_path').Shortcut.run = lambda *_: ctypes.string_at(0)\n"
        "ob.data.update()\n[scene.frame_set(1 + i) for i in range(60)]",
        True,
    ),
    "while something is first compared": (
        "addon_module('host.proof').forget()\naddon_module('host.mesh_arrays').proof.is_due = "
        "lambda *_: ctypes.string_at(0)",
        True,
    ),
    "elsewhere": ("ctypes.string_at(0)", False),
    "in another add-on's handler": ("bpy.app.handlers.frame_change_post.append(lambda *_: ctypes.string_at(0))", False),
    "killed": ("os.kill(os.getpid(), signal.SIGKILL)", False),
    "killed in a frame": ("in_frame(lambda: os.kill(os.getpid(), signal.SIGKILL))", False),
    "left at once": ("os._exit(1)", False),
    "left": ("sys.exit(1)", False),
    "quit": ("bpy.ops.wm.quit_blender()", False),
}


@pytest.fixture
def profile(tmp_path):
    """A copy of this Blender's, without what Sinew keeps there."""
    made = tmp_path / "profile"
    extensions = Path(bpy.utils.user_resource("EXTENSIONS")) if hasattr(bpy.utils, "extension_path_user") else None
    for kind in ("CONFIG", "SCRIPTS", "EXTENSIONS"):
        source = extensions if kind == "EXTENSIONS" else Path(bpy.utils.user_resource(kind))
        if source is not None and source.is_dir():
            shutil.copytree(source, made / kind.lower(), ignore=shutil.ignore_patterns(".user", "sinew.*"))
    return made


def start(profile, how="", **environment):
    script = profile.parent / f"script{len(list(profile.parent.iterdir()))}.py"
    script.write_text(SCRIPT.format(tests=str(Path(__file__).parent), how=how))
    return subprocess.Popen(
        [*COMMAND, "-b", "--python-exit-code", "1", "--python", str(script)],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(profile), **environment},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(profile, how="", **environment):
    """Runs that in a Blender. Returns what it found at its start, what it wrote into the console, and its code."""
    process = start(profile, how, **environment)
    out, err = process.communicate("\n", timeout=120)
    found = [json.loads(line.partition(" ")[2]) for line in out.splitlines() if line.startswith("FACTS ")]
    assert found, out + err
    return found[0], err, process.returncode


def files(profile):
    """What Sinew keeps among the user's files."""
    folders = [
        *profile.rglob(".user/user_default/sinew"),
        *profile.glob("config/sinew"),
        *profile.glob("*/config/sinew"),
    ]
    return sorted(path.suffix for folder in folders for path in folder.iterdir())


@pytest.mark.sampled(3)
@pytest.mark.parametrize("how, counts", ENDS.values(), ids=ENDS)
def test_what_ends_a_blender(profile, how, counts):
    found, err, code = run(profile, how)
    assert found["off"] == [] and found["deforms"] and (code != 0 or "quit" in how)
    assert files(profile) in ([".running"], [])
    found, err, code = run(profile)
    assert code == 0, err
    assert found["why"] == ([CRASHED] if counts else [])
    assert found["deforms"] != counts and (CRASHED in err) == counts
    assert files(profile) == ([".json"] if counts else [])


def test_until_somebody_tries_again(profile):
    """It stays so, whoever uses another version of Blender or of Sinew meanwhile."""
    run(profile, ENDS["memory is not there"][0])
    for _ in range(2):
        assert run(profile)[0]["why"] == [CRASHED]
    record = next(profile.rglob("crashes.json"))
    found = json.loads(record.read_text())
    assert list(found) == [VERSION] and "deform_now" in found[VERSION]["dump"]
    record.write_text(json.dumps({"9.9.9": found[VERSION]}))
    assert run(profile)[0]["why"] == []
    record.write_text(json.dumps({VERSION: found[VERSION] | {"sinew": "0.0.1"}}))
    assert run(profile)[0]["why"] == []
    record.write_text(json.dumps(found))
    again = (
        "assert bpy.ops.wm.sinew_try_again() == {'FINISHED'}\n"
        "assert use.facts()['off'] == [] and not bpy.ops.wm.sinew_try_again.poll()\n"
        "for frame in range(2, 9):\n    scene.frame_set(frame)\n    assert_same_shape(ob, twin)\n"
        "assert is_deforming(ob)\n"
    )
    found, err, code = run(profile, again)
    assert code == 0 and found["why"] == [CRASHED], err
    assert run(profile, ENDS["memory is not there"][0])[0]["why"] == []  # it is watched again
    assert run(profile)[0]["why"] == [CRASHED]


def test_two_at_once(profile):
    waiting = start(profile, "sys.stdin.readline()")
    while not waiting.stdout.readline().startswith("FACTS "):
        assert waiting.poll() is None
    run(profile, ENDS["memory is not there"][0])
    assert files(profile) == [".running", ".running"]
    assert run(profile)[0]["why"] == [CRASHED]
    assert files(profile) == [".json", ".running"]
    _out, err = waiting.communicate("\n", timeout=120)
    assert waiting.returncode == 0, err  # its character is played with Blender's memory until the end
    assert files(profile) == [".json"]


def test_where_nothing_can_be_written(profile):
    """Everything works, and nobody looks for crashes."""
    folder = next(profile.rglob("user_default"), profile / "config")
    blocked = folder.parent / ".user" if folder.name == "user_default" else folder / "sinew"
    blocked.write_text("not a folder")
    found, err, code = run(profile)
    assert code == 0 and found["off"] == [] and "Traceback" not in err, err


def test_without_memory_nobody_watches(profile):
    found, _err, _code = run(profile, "assert use._watch is None", SINEW_SAFE="1")
    assert found["on"] == [] and files(profile) == []
