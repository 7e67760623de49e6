"""Measures Blender's evaluation after a dab of Weight Paint, with its own modifier and with Sinew, in one process.

    blender -b --python-exit-code 1 --python addon/bench_edits.py -- [--vertices N] [--rig NAME] [--stack NAME]
        [--json FILE]

A character of 40,000 vertices in Weight Paint mode: a tube on a chain of 22 bones, or one of Rigify's rigs. A dab
changes the weight of 50 neighboring vertices in the active vertex group, through Blender's API; the
`view_layer.update()` that follows is timed. Medians over 40 dabs in each of several alternating rounds.
"""

import argparse
import json
import statistics
import sys
from pathlib import Path
from time import perf_counter

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from bench_playback import TOLERANCE, difference, number, shapes, without_handlers
from bench_rigs import ADDON, CHAIN, RIGS, STACKS, make_characters, select

ROUNDS, DABS, DABBED = 5, 40, 50
FRAME = 20  # a frame on which the character is bent


def dab_times(ob, seed):
    """Returns milliseconds, one value per dab, after one warm-up dab. The same seed gives the same final weights."""
    random = np.random.default_rng(seed)
    bpy.ops.object.mode_set(mode="WEIGHT_PAINT")
    group, times = ob.vertex_groups.active, []
    for _ in range(DABS + 1):
        first = int(random.integers(len(ob.data.vertices) - DABBED))
        group.add(range(first, first + DABBED), random.uniform(0.1, 1), "REPLACE")
        start = perf_counter()
        bpy.context.view_layer.update()
        times.append(1e3 * (perf_counter() - start))
    bpy.ops.object.mode_set(mode="OBJECT")
    return times[1:]


def measure(rig, vertices, stack):
    """Returns one row, a dictionary."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)
    (ob,) = make_characters(rig, vertices, stack=stack)
    bpy.context.scene.frame_set(FRAME)
    times, worst = {"modifier": [], "sinew": []}, 0.0
    for seed in range(ROUNDS):  # alternating, because the machine's speed drifts
        select(ob)
        with without_handlers():
            times["modifier"] += dab_times(ob, seed)
            wanted = shapes([ob])
        assert bpy.ops.object.sinew_bind() == {"FINISHED"}
        times["sinew"] += dab_times(ob, seed)
        worst = max(worst, difference(shapes([ob]), wanted))
        assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
    assert worst < TOLERANCE, f"Sinew's shape is {worst:.3g} of the diagonal off the modifier's"
    modifier, ours = (statistics.median(times[name]) for name in ("modifier", "sinew"))
    return {
        "rig": rig,
        "stack": stack,
        "vertices": len(ob.data.vertices),
        "modifier_ms": modifier,
        "sinew_ms": ours,
        "more_ms": ours - modifier,
        "difference": worst,
    }


def main(arguments):
    parser = argparse.ArgumentParser(prog="bench_edits.py", description=__doc__.splitlines()[0])
    parser.add_argument("--vertices", type=int, default=40_000)
    parser.add_argument("--rig", choices=(CHAIN, *RIGS), default=CHAIN)
    parser.add_argument("--stack", choices=STACKS, default="")
    parser.add_argument("--shot", action="store_true", help="the edits of a whole shot, see bench_hand.py")
    parser.add_argument("--characters", type=int, default=5, help="of the shot")
    parser.add_argument("--json")
    options = parser.parse_args(arguments)
    if options.shot:
        import bench_hand

        bench_hand.main(options)
        return
    print(f"\nBlender {bpy.app.version_string}, milliseconds per evaluation, medians of {ROUNDS} x {DABS} dabs\n")
    print("| a dab of Weight Paint | vertices | stack | modifier | Sinew | Sinew's extra |\n" + "|---" * 6 + "|")
    row = measure(options.rig, options.vertices, options.stack)
    times = " | ".join(number(row[name]) for name in ("modifier_ms", "sinew_ms", "more_ms"))
    print(f"| {row['rig']} | {row['vertices']:,} | {row['stack'] or '-'} | {times} |")
    if options.json:
        Path(options.json).write_text(json.dumps({"blender": bpy.app.version_string, **row}, indent=1) + "\n")


main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
