"""Weight tools in a window: weights are transferred while Blender draws; the dialog of Reduce Influences tells how far
vertices will move before it changes anything; one Ctrl Z takes back what it did. Esc stops Bake to Bones and leaves
nothing; what it has made goes with one Ctrl Z. Run as first_ogre.py is.
"""

import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from time import sleep

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from helpers import addon_module, select
from test_weight_reduction import counts, make_animated
from test_weight_tools import dense, entries, suit_of
from windowed import area, in_area, middle_of, outside, picture, region, run, screen, until


def steps():
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    ob, _armature = make_animated()
    suit = suit_of(ob)
    names = ob.name, suit.name
    select(ob, suit)
    yield from outside(f"xdotool mousemove {screen(*middle_of(region(area('VIEW_3D'))))}")
    with in_area("VIEW_3D"):
        bpy.ops.view3d.view_selected()
        bpy.ops.ed.undo_push(message="before")
        assert bpy.ops.object.sinew_transfer_weights("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield from until(lambda: len(bpy.data.objects[names[1]].vertex_groups) > 0)
    yield 0.5
    assert (dense(bpy.data.objects[names[1]]).sum(axis=1) > 0.99).all()
    yield from undo()
    assert len(bpy.data.objects[names[1]].vertex_groups) == 0
    print("window: weights transferred, and taken back")
    yield from in_the_dialog(names[0])


def in_the_dialog(name):
    ob = bpy.data.objects[name]
    select(ob)
    before = entries(ob)
    with in_area("VIEW_3D"):
        bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
        bpy.ops.ed.undo_push(message="before")
    yield from dialog(name)
    with counted_reductions() as computed:
        yield from picture("reduce")
        yield from outside("xdotool key Return")
        yield from until(lambda: counts(bpy.data.objects[name]).max() == 2)
    assert computed == [], "OK computed again what the dialog had told"
    assert bpy.data.objects[name].data.use_paint_mask_vertex
    yield from picture("reduced")
    yield from undo()
    assert entries(bpy.data.objects[name]) == before and bpy.context.mode == "PAINT_WEIGHT"
    print("window: the dialog told what would move, OK wrote just that, and one Ctrl Z took it back")

    for key, is_written in (("Escape", False), ("", True)):
        release = threading.Event()
        with counted_reductions(release) as computed:
            yield from dialog(name)
            yield from outside("xdotool key Return")
            yield 1.0
            assert len(computed) == 1 and entries(bpy.data.objects[name]) == before
            if key:
                yield from outside(f"xdotool key {key}")
            else:
                release.set()
            yield 1.0
        assert (counts(bpy.data.objects[name]).max() == 2) == is_written
        assert is_written or entries(bpy.data.objects[name]) == before
    yield from undo()
    assert entries(bpy.data.objects[name]) == before
    print("window: OK before the end of the computation goes on in steps, and Esc stops them")
    yield from to_bones(name)


def dialog(name):
    before = entries(bpy.data.objects[name])
    with in_area("VIEW_3D"):
        result = bpy.ops.object.sinew_reduce_influences("INVOKE_DEFAULT", max_influences=2, tolerance=0.1)
    assert result == {"RUNNING_MODAL"} and bpy.context.scene.frame_current == 3
    yield 1.0
    assert entries(bpy.data.objects[name]) == before


@contextmanager
def counted_reductions(release=None):
    """The reductions that are computed meanwhile; with an event, none ends before it is set."""
    module, computed = addon_module("weights.reducing").Reduction, []
    compute = module.compute

    def noting(self, progress=None):
        computed.append(self)
        while release is not None and not release.is_set() and not progress.is_cancelled:
            sleep(0.01)
        return compute(self, progress)

    module.compute = noting
    try:
        yield computed
    finally:
        module.compute = compute


def to_bones(name):
    bpy.ops.object.mode_set(mode="OBJECT")
    select(bpy.data.objects[name])
    scene = bpy.context.scene
    names, frame = sorted(bpy.data.objects.keys()), scene.frame_current
    with in_area("VIEW_3D"):
        bpy.ops.ed.undo_push(message="before")
        result = bpy.ops.object.sinew_bake_to_bones_steps(
            "INVOKE_DEFAULT", frame_end=300, bones=60, iterations=10000, tolerance=0
        )
    assert result == {"RUNNING_MODAL"}
    yield from until(lambda: scene.frame_current == 300)  # the last; the operator goes back when it ends
    yield from picture("to-bones")
    yield from outside("xdotool key Escape")
    yield from until(lambda: scene.frame_current == frame)
    assert sorted(bpy.data.objects.keys()) == names
    with in_area("VIEW_3D"):
        result = bpy.ops.object.sinew_bake_to_bones_steps("INVOKE_DEFAULT", bones=6)
    assert result == {"RUNNING_MODAL"}
    yield from until(lambda: scene.frame_current == frame and len(bpy.data.objects) > len(names))
    made = [ob for ob in bpy.data.objects if ob.name not in names]
    assert sorted(ob.type for ob in made) == ["ARMATURE", "MESH"]
    yield from undo()
    assert sorted(bpy.data.objects.keys()) == names
    print("window: Esc stopped Bake to Bones, and one Ctrl Z took back what it had made")


def undo():
    yield from outside(f"xdotool mousemove {screen(*middle_of(region(area('VIEW_3D'))))} key ctrl+z")
    yield 1.0


run(steps())
