"""Measures how long a frame of a whole shot takes with Sinew while all characters but one are played.

    blender -b --python-exit-code 1 --python addon/bench_shot.py -- --played [--characters N] [--without WHAT]...

The shot is that of bench_shot.py. Rounds alternate between Blender's modifiers with Sinew's handlers removed, all
characters live, all with accelerated rigs, all but one recorded and played, and all but one hidden, which is the
least. Accelerating, taking over, handing back and recording are measured too, and shapes are compared with those of
live characters.
"""

import importlib
import json
import statistics
from pathlib import Path
from time import perf_counter

import bpy
import numpy as np

from bench_playback import FRAMES, frame_times, number, shapes, without_handlers
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
    accelerating, states, known = (
        importlib.import_module(f"{ADDON}.played.{name}") for name in ("accelerating", "states", "rigs")
    )
    people = make_shot(characters, without)
    meshes = [ob for person in people for ob in person.meshes]
    select(*meshes)
    assert bpy.ops.object.sinew_bind() == {"FINISHED"}
    bpy.ops.object.select_all(action="DESELECT")
    scene, layer = bpy.context.scene, bpy.context.view_layer
    names = (
        "modifiers",
        "live",
        "accelerated",
        "recording",
        "played",
        "hidden",
        "reading",
        "taking over",
        "handing back",
    )
    times = {name: [] for name in names}

    def take(what):
        times[what].append(statistics.median(frame_times()))

    def take_over(what, chosen):
        times[what].append(milliseconds(states.take_over, chosen, scene, layer))
        lacking = [rig.reason for rig in chosen if not rig.is_played]
        assert not lacking, lacking

    scene.sinew_accelerates_rigs = False
    take("live")
    times["live"].clear()
    for _ in range(rounds):
        known.forget()
        scene.frame_set(FRAMES[0] - 1)
        scene.sinew_accelerates_rigs = True
        times["reading"].append(milliseconds(accelerating.accelerate, scene, layer))
        every = [known.learn(person.rig) for person in people]
        take("accelerated")
        assert all(rig.is_played for rig in every), [rig.reason for rig in every]
        found = shapes(meshes)
        states.hand_back(every, scene, layer)
        scene.sinew_accelerates_rigs = False
        known.forget()
        rigs = [known.learn(person.rig) for person in people[1:]]
        for rig in rigs:
            rig.trust.is_distrusted = True  # so that they are recorded, not computed
        frame_times()
        take("recording")
        assert all(np.array_equal(a, b) for a, b in zip(found, shapes(meshes)))
        wanted = shapes_at_the_end(meshes)
        take_over("taking over", rigs)
        take("played")
        found = shapes(meshes)
        assert all(rig.is_played for rig in rigs)
        worst = max(float(np.abs(a - b).max()) for a, b in zip(wanted, found))
        assert worst == 0.0, f"played shapes are {worst} off"
        times["handing back"].append(milliseconds(states.hand_back, rigs, scene, layer))
        with hidden([ob for person in people[1:] for ob in person.objects]):
            take("hidden")
        take("recording")
    memory = sum(rig.motion.record.nbytes for rig in rigs) / 2**20 / max(len(rigs), 1) / len(FRAMES)
    known.forget()
    for _ in range(rounds):
        take("live")
    select(*meshes)
    assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
    with without_handlers():
        for _ in range(rounds):
            take("modifiers")
    found = {f"{what}_ms": float(np.median(each)) for what, each in times.items()}
    return found | {"characters": characters, "megabytes": memory, "faster": found["live_ms"] / found["played_ms"]}


def main(options):
    row = measure(options.characters, options.without)
    without = f", without {', '.join(options.without)}" if options.without else ""
    print(
        f"\nBlender {bpy.app.version_string}, {options.characters} characters{without}, milliseconds per frame, "
        f"medians of {SHOT_ROUNDS} x {len(FRAMES)} frames\n"
    )
    print(
        "| modifiers | all live | rigs accelerated | recorded | all but one played | faster | all but one hidden | "
        "accelerating | taking over | handing back | MB a frame |"
    )
    print("|" + "---|" * 11)
    names = ("modifiers", "live", "accelerated", "recording", "played")
    cells = [number(row[f"{what}_ms"]) for what in names] + [number(row["faster"], "x")]
    names = ("hidden", "reading", "taking over", "handing back")
    cells += [number(row[f"{what}_ms"]) for what in names] + [f"{row['megabytes']:.2f}"]
    print(f"| {' | '.join(cells)} |", flush=True)
    if options.json:
        row["blender"] = bpy.app.version_string
        Path(options.json).write_text(json.dumps(row, indent=1) + "\n")
