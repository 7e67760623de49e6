"""Measures how long a frame of a whole shot takes with Sinew while all characters but one are frozen.

    blender -b --python-exit-code 1 --python addon/bench_shot.py -- --frozen [--characters N] [--without WHAT]...

The shot is that of bench_shot.py. Rounds alternate between all characters live, all but one frozen, and all but one
hidden, which is the least that a frame can take. Freezing, thawing and recording are measured too, and the shapes of
frozen characters are compared with the live ones.
"""

import importlib
import json
import statistics
from pathlib import Path
from time import perf_counter

import bpy
import numpy as np

from bench_playback import FRAMES, frame_times, number, shapes
from bench_rigs import ADDON, select
from bench_shot import SHOT_ROUNDS, hidden, make_shot, shapes_at_the_end


def milliseconds(function, *arguments):
    start = perf_counter()
    function(*arguments)
    return 1e3 * (perf_counter() - start)


def measure(characters, without=(), rounds=SHOT_ROUNDS):
    """Returns {what: median of milliseconds}, with the largest difference of the shapes, which must be 0."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)
    freezing, known = (importlib.import_module(f"{ADDON}.frozen.{name}") for name in ("freezing", "rigs"))
    people = make_shot(characters, without)
    meshes = [ob for person in people for ob in person.meshes]
    select(*meshes)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    bpy.ops.object.select_all(action="DESELECT")
    scene, layer = bpy.context.scene, bpy.context.view_layer
    times = {"live": [], "recording": [], "frozen": [], "hidden": [], "freezing": [], "thawing": []}

    def take(what):
        times[what].append(statistics.median(frame_times()))

    take("live")
    times["live"].clear()
    rigs = []
    for person in people[1:]:
        rigs.append(known.learn(person.rig))
    frame_times()
    for _ in range(rounds):
        take("recording")
        wanted = shapes_at_the_end(meshes)
        times["freezing"].append(milliseconds(freezing.freeze, rigs, scene, layer))
        lacking = [rig.reason for rig in rigs if not rig.is_frozen]
        assert not lacking, lacking
        take("frozen")
        found = shapes(meshes)
        assert all(rig.is_frozen for rig in rigs)
        worst = max(float(np.abs(a - b).max()) for a, b in zip(wanted, found))
        assert worst == 0.0, f"frozen shapes are {worst} off"
        times["thawing"].append(milliseconds(freezing.thaw, rigs, scene, layer))
        with hidden([ob for person in people[1:] for ob in person.objects]):
            take("hidden")
        take("recording")
    memory = sum(rig.record.nbytes for rig in rigs) / 2**20 / max(len(rigs), 1) / len(FRAMES)
    known.forget()
    for _ in range(rounds):
        take("live")
    found = {f"{what}_ms": float(np.median(each)) for what, each in times.items()}
    return found | {"characters": characters, "megabytes": memory, "faster": found["live_ms"] / found["frozen_ms"]}


def main(options):
    row = measure(options.characters, options.without)
    without = f", without {', '.join(options.without)}" if options.without else ""
    print(
        f"\nBlender {bpy.app.version_string}, {options.characters} characters{without}, milliseconds per frame, "
        f"medians of {SHOT_ROUNDS} x {len(FRAMES)} frames\n"
    )
    print(
        "| all live | recorded | all but one frozen | faster | all but one hidden | freezing | thawing | MB a frame |"
    )
    print("|" + "---|" * 8)
    cells = [number(row[f"{what}_ms"]) for what in ("live", "recording", "frozen")] + [number(row["faster"], "x")]
    cells += [number(row[f"{what}_ms"]) for what in ("hidden", "freezing", "thawing")] + [f"{row['megabytes']:.2f}"]
    print(f"| {' | '.join(cells)} |", flush=True)
    if options.json:
        row["blender"] = bpy.app.version_string
        Path(options.json).write_text(json.dumps(row, indent=1) + "\n")
