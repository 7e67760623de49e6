"""Measures clips for games: Bake to Bones, The Rig's Bones, Exact, of all actions of a rig, against Blender's nla.bake.

    blender -b --python-exit-code 1 --python addon/bench_clips.py -- [--rig NAME|FILE] [--actions N] [--json FILE]

One of Rigify's rigs, or the largest armature of a .blend file whose name begins with RIG: 25 actions of 100 frames, in
which 60 controls move. nla.bake is run for each action, on a skeleton whose bones copy the deforming ones, as a game
artist sets it up. Seconds of the processor and seconds passed, of all actions.
"""

import argparse
import json
import sys
from pathlib import Path
from time import perf_counter, process_time

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from bench_rigs import ADDON, METARIGS, animate, is_file, loaded, make_game_rig, make_generated, select, sinew

FRAMES = 100
KEYED = (1, 33, 66, FRAMES)


def make_rig(name, count):
    """Returns an armature with so many actions."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)
    rig = loaded(name) if is_file(name) else make_generated(name)
    for number in range(count):
        action = bpy.data.actions.new(f"clip{number:02}")
        action.use_fake_user = True
        (rig.animation_data or rig.animation_data_create()).action = action
        animate(rig, number, frames=KEYED)
    bpy.context.scene.frame_set(1)
    return rig


def timed(work):
    """Returns (seconds of processor, seconds passed, what work returned)."""
    processor, passed = process_time(), perf_counter()
    found = work()
    return process_time() - processor, perf_counter() - passed, found


def by_sinew(rig):
    exact = sinew("to_bones.exact")
    frames = sinew("bake.frame_range").FrameRange(1, FRAMES)
    return exact.run(bpy.context, rig, [], exact.ExactSettings(frames, actions="clip*"))


def by_blender(rig, game):
    select(game)
    for action in [each for each in bpy.data.actions if each.name.startswith("clip") and "_" not in each.name]:
        rig.animation_data.action = action
        if hasattr(action, "slots"):
            rig.animation_data.action_slot = action.slots[0]
        if game.animation_data:
            game.animation_data.action = None
        bpy.ops.object.mode_set(mode="POSE")
        bpy.ops.pose.select_all(action="SELECT")
        bpy.ops.nla.bake(frame_start=1, frame_end=FRAMES, only_selected=False, visual_keying=True, bake_types={"POSE"})
        bpy.ops.object.mode_set(mode="OBJECT")


def main(arguments):
    parser = argparse.ArgumentParser(prog="bench_clips.py", description=__doc__.splitlines()[0])
    parser.add_argument("--rig", default="human", help=f"one of {', '.join(METARIGS)}, or a .blend file")
    parser.add_argument("--actions", type=int, default=25)
    parser.add_argument("--json")
    options = parser.parse_args(arguments)
    rig = make_rig(options.rig, options.actions)
    by_sinew(rig)  # what is only done once in a session
    ours, ours_passed, report = timed(lambda: by_sinew(rig))
    game = make_game_rig(rig)
    theirs, theirs_passed, _ = timed(lambda: by_blender(rig, game))
    print(f"\nBlender {bpy.app.version_string}, seconds, {options.actions} actions of {FRAMES} frames\n")
    print("| rig | bones | nla.bake: processor | passed | exact: processor | passed | |\n" + "|---" * 7 + "|")
    times = " | ".join(f"{each:.2f}" for each in (theirs, theirs_passed, ours, ours_passed))
    print(f"| {Path(options.rig).stem} | {report.bones} | {times} | {theirs / ours:.1f} times |")
    if options.json:
        found = {
            "blender": bpy.app.version_string,
            "rig": options.rig,
            "actions": options.actions,
            "nla_bake_s": theirs,
        }
        found |= {"nla_bake_passed_s": theirs_passed, "exact_s": ours, "exact_passed_s": ours_passed}
        Path(options.json).write_text(json.dumps(found, indent=1) + "\n")


main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
