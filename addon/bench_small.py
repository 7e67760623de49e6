"""Measures the cost of small meshes per frame, with Blender's modifier and with Sinew, in the same process.

    blender -b --python-exit-code 1 --python addon/bench_small.py -- [--json FILE]

20 tubes on one chain of 22 bones, each with its own mesh, and one tube with 200 hairs. Medians of whole
`scene.frame_set` calls over 40 different frames, alternating between the rig alone (the meshes hidden), Blender's
modifier with Sinew's handlers removed, and Sinew. The cost of a mesh is the time of a frame minus that of the rig
alone, divided by the number of meshes. Sinew deforms all of them here, whatever their size.

Before that, 300 props of 8 to 1,000 vertices, bound one by one, which Blender goes on to deform because they would
gain nothing. (*Accelerate* would not even bind them.)
"""

import argparse
import json
import statistics
import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from bench_playback import (
    FRAMES,
    TOLERANCE,
    difference,
    frame_times,
    frame_times_of_the_rig,
    number,
    shapes,
    without_handlers,
)
from bench_rigs import ADDON, animate, make_chain, make_mesh, select

TUBES, SIZES = 20, (8, 500, 1_000, 2_000, 4_000)
HAIRS, HAIRY_SIZE = 200, 1_000
PROPS, SMALLEST_PROP, LARGEST_PROP = 300, 8, 1_000
ROUNDS = 5


def bind_whatever_the_size():
    """Has Sinew deform even meshes that Blender's own modifier deforms faster."""
    sys.modules[f"{ADDON}.plan.ways"].FEWEST_VERTICES = {}


def make_tubes(vertices, count, hairs):
    """Adds tubes on one armature to the open file. Returns [mesh object]."""
    armature = make_chain()
    animate(armature, 1)
    meshes = [make_mesh(armature, vertices, one_tube=True) for _ in range(count)]
    for ob in meshes if hairs else ():
        settings = ob.modifiers.new("Hair", "PARTICLE_SYSTEM").particle_system.settings
        settings.type, settings.count = "HAIR", hairs
    return meshes


def make_props():
    """Adds props of all sizes on one armature to the open file. Returns [mesh object]."""
    armature = make_chain()
    animate(armature, 1)
    sizes = np.geomspace(SMALLEST_PROP, LARGEST_PROP, PROPS).round().astype(int)
    return [make_mesh(armature, int(size), one_tube=True) for size in sizes]


def start():
    """Opens an empty file, with the add-on."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)


def measure(meshes, hairs=0):
    """Returns one row, a dictionary, about the mesh objects of the open file."""
    times, worst, count = {}, 0.0, len(meshes)
    for _ in range(ROUNDS):  # alternating, because the machine's speed drifts
        with without_handlers():
            times.setdefault("rig", []).extend(frame_times_of_the_rig(meshes))
            times.setdefault("modifier", []).extend(frame_times())
            wanted = shapes(meshes)
        for ob in meshes:  # each alone, since of several Sinew binds only those that gain
            select(ob)
            assert bpy.ops.object.sinew_bind() == {"FINISHED"}
        times.setdefault("sinew", []).extend(frame_times())
        worst = max(worst, difference(shapes(meshes), wanted))
        select(*meshes)
        assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
    assert worst < TOLERANCE, f"Sinew's shape is {worst:.3g} of the diagonal off the modifier's"
    rig, modifier, ours = (statistics.median(times[name]) for name in ("rig", "modifier", "sinew"))
    return {
        "meshes": count,
        "vertices": sorted({len(ob.data.vertices) for ob in meshes}),
        "hairs": hairs,
        "rig_ms": rig,
        "modifier_ms": modifier,
        "sinew_ms": ours,
        "modifier_us_a_mesh": 1e3 * (modifier - rig) / count,
        "sinew_us_a_mesh": 1e3 * (ours - rig) / count,
        "difference": worst,
    }


def line(row):
    fewest, most = (f"{number:,}" for number in (row["vertices"][0], row["vertices"][-1]))
    size = fewest if fewest == most else f"{fewest} to {most}"
    what = f"{row['meshes']} x {size}" + (f", {row['hairs']} hairs" if row["hairs"] else "")
    times = (number(row[name]) for name in ("rig_ms", "modifier_ms", "sinew_ms"))
    each = (f"{row[name]:.1f}" for name in ("modifier_us_a_mesh", "sinew_us_a_mesh"))
    return f"| {' | '.join((what, *times, *each))} |"


def main(arguments):
    parser = argparse.ArgumentParser(prog="bench_small.py", description=__doc__.splitlines()[0])
    parser.add_argument("--json")
    options = parser.parse_args(arguments)
    print(
        f"\nBlender {bpy.app.version_string}, milliseconds per frame, medians of {ROUNDS} x {len(FRAMES)} frames; "
        "microseconds per mesh\n"
    )
    print("| meshes x vertices | rig alone | modifier | Sinew | modifier, us per mesh | Sinew, us per mesh |")
    print("|" + "---|" * 6)
    rows = []

    def add(row):
        rows.append(row)
        print(line(row), flush=True)

    start()
    add(measure(make_props()))
    for vertices, count, hairs in [*((size, TUBES, 0) for size in SIZES), (HAIRY_SIZE, 1, HAIRS)]:
        start()
        bind_whatever_the_size()
        add(measure(make_tubes(vertices, count, hairs), hairs))
    if options.json:
        found = {"blender": bpy.app.version_string, "rows": rows}
        Path(options.json).write_text(json.dumps(found, indent=1) + "\n")


main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
