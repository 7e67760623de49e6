"""Measures how long a frame takes with Blender's Armature modifier and with Sinew, in the same process.

    blender -b --python-exit-code 1 --python addon/bench_playback.py -- [options]

Medians of whole `scene.frame_set` calls over 40 different frames, alternating between the rig alone (the
meshes hidden), Blender's modifiers with Sinew's handlers removed, Sinew while Blender evaluates the rigs, and Sinew
with rigs accelerated, if they are large enough. Of the first three, the figure to compare is the time that the meshes
add to the rig alone: how many times smaller it is with Sinew. Without options: a chain
of 22 bones with up to a million vertices and ten such characters in one scene, and Rigify's human. Of a .blend file the
largest armature whose name begins with "RIG" is taken.
"""

import argparse
import contextlib
import importlib
import json
import statistics
import sys
from pathlib import Path
from time import perf_counter

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from bench_rigs import ADDON, CHAIN, FOLLOWER, RIGS, STACKS, is_file, make_characters, select

FRAMES = range(2, 42)
SIZES, LARGE = (30_000, 180_000), 1_000_000
ROUNDS = 3
TOLERANCE = 1e-5  # as a fraction of the diagonal


@contextlib.contextmanager
def without_handlers():
    """Removes the add-on's handlers, as if it were not installed. The meshes must not be bound."""
    taken = []
    for handlers in (getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)):
        if isinstance(handlers, list):
            ours = [h for h in handlers if getattr(h, "__module__", "").startswith(ADDON)]
            taken += [(handlers, handler) for handler in ours]
            for handler in ours:
                handlers.remove(handler)
    try:
        yield
    finally:
        for handlers, handler in taken:
            handlers.append(handler)


@contextlib.contextmanager
def rigs_accelerated(are):
    """Has Sinew compute all rigs that it can, or none. Gives whether it computes any."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    accelerating, known = (importlib.import_module(f"{ADDON}.played.{name}") for name in ("accelerating", "rigs"))
    scene.sinew_accelerates_rigs = are
    if are:
        accelerating.accelerate(scene, layer)
    yield bool(known.played())
    scene.sinew_accelerates_rigs = False


def frame_times(looked_at=()):
    """Returns milliseconds, one value per frame, after one warm-up frame. looked_at: meshes that are read on each
    frame, since Blender 5 postpones subdivision until somebody reads the mesh."""
    scene = bpy.context.scene
    scene.frame_set(FRAMES[0] - 1)
    times = []
    for frame in FRAMES:
        start = perf_counter()
        scene.frame_set(frame)
        for ob in looked_at:
            len(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices)
        times.append(1e3 * (perf_counter() - start))
    return times


def frame_times_of_the_rig(meshes):
    hidden = [*meshes, *(ob for ob in bpy.data.objects if ob.name.startswith(FOLLOWER))]
    for ob in hidden:
        ob.hide_viewport = True
    try:
        return frame_times()
    finally:
        for ob in hidden:
            ob.hide_viewport = False


def shapes(meshes):
    """Returns [(V, 3)]: the meshes' positions on the last frame."""
    graph = bpy.context.evaluated_depsgraph_get()
    found = []
    for ob in meshes:
        mesh = ob.evaluated_get(graph).data
        positions = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", positions)
        found.append(positions.reshape(-1, 3))
    return found


def difference(ours, theirs):
    """Returns the largest difference of a coordinate from the modifier's result, as a fraction of the diagonal."""
    return max(float(np.abs(a - b).max() / np.linalg.norm(np.ptp(b, axis=0))) for a, b in zip(ours, theirs))


def measure(rig, vertices, count=1, stack="", outputs=("MODIFIER",)):
    """Returns one row, a dictionary."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)
    meshes = make_characters(rig, vertices, count, stack)
    select(*meshes)
    looked_at = meshes if stack == "subdivision" else ()
    times, bound, worst = {}, {}, 0.0
    for _ in range(ROUNDS if vertices * count < 500_000 else 1):  # alternating, because the machine's speed drifts
        with without_handlers():
            times.setdefault("rig", []).extend(frame_times_of_the_rig(meshes))
            select(*meshes)  # hiding deselects
            times.setdefault("modifier", []).extend(frame_times(looked_at))
            wanted = shapes(meshes)
        for output in outputs:
            start = perf_counter()
            bpy.ops.object.sinew_bind(output=output)
            bound[output] = perf_counter() - start
            if stack.startswith("behind-"):
                frame_times()  # in which stencils are found
            with rigs_accelerated(False):
                times.setdefault(output, []).extend(frame_times(looked_at))
                worst = max(worst, difference(shapes(meshes), wanted))
            with rigs_accelerated(output == "MODIFIER") as are_any:
                if are_any:
                    times.setdefault("accelerated", []).extend(frame_times(looked_at))
                    worst = max(worst, difference(shapes(meshes), wanted))
            select(*meshes)
            bpy.ops.object.sinew_unbind()
    assert worst < TOLERANCE, f"Sinew's shape is {worst:.3g} of the diagonal off the modifier's"
    return row_of(
        {name: statistics.median(each) for name, each in times.items()},
        {
            "rig": Path(rig).stem,
            "bones": len(meshes[0].parent.data.bones),
            "vertices": len(meshes[0].data.vertices),
            "characters": count,
            "stack": stack,
            "sinew_extremes_ms": (min(times["MODIFIER"]), max(times["MODIFIER"])),
            "accelerate_s": bound["MODIFIER"],
            "difference": worst,
        },
    )


def row_of(medians, about):
    rig, modifier, sinew = (medians[name] for name in ("rig", "modifier", "MODIFIER"))
    added, ours = modifier - rig, sinew - rig
    return {
        **about,
        "rig_ms": rig,
        "modifier_ms": modifier,
        "sinew_ms": sinew,
        "accelerated_ms": medians.get("accelerated"),
        "sinew_mesh_ms": medians.get("MESH"),
        "times_faster": modifier / sinew,
        "modifier_adds_ms": added,
        "sinew_adds_ms": ours,
        "adds_times_less": added / ours if ours > 0 else None,
    }


def rows(options):
    stacks = options.stacks or [""]
    for rig in options.rig or (CHAIN, "human"):
        if rig == CHAIN and not (options.stacks or options.characters or options.vertices):
            for stack in ("", "preserve-volume"):
                for size in (*SIZES, LARGE):
                    yield measure(rig, size, 1, stack, ("MODIFIER", "MESH"))
            yield measure(rig, SIZES[0], 10, "", ("MODIFIER", "MESH"))
            continue
        for stack in stacks:
            for size in options.vertices or (SIZES[:1] if options.characters else SIZES):
                yield measure(rig, size, options.characters or 1, stack)


def measure_beside(others=10_000, count=20):
    """Measures the same bound meshes with and without `others` more objects in the file, which are in no scene; the
    time of a frame must not depend on them. Returns a dictionary."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)
    meshes = make_characters(CHAIN, 1_000, count, "")
    select(*meshes)
    bpy.ops.object.sinew_bind()
    alone, beside = [], []
    for _ in range(ROUNDS):
        alone += frame_times()
        idle = [bpy.data.objects.new("Idle", None) for _ in range(others)]
        beside += frame_times()
        bpy.data.batch_remove(idle)
    return {
        "beside_objects": others,
        "characters": count,
        "alone_ms": statistics.median(alone),
        "beside_ms": statistics.median(beside),
    }


def number(value, unit=""):
    return "-" if value is None else f"{value:.2f}{unit}"


def line(row):
    count = f"{row['characters']} x " if row["characters"] > 1 else ""
    return (
        "| "
        + " | ".join(
            (
                f"{row['rig']} ({row['bones']})",
                f"{count}{row['vertices']:,}",
                row["stack"] or "-",
                number(row["rig_ms"]),
                number(row["modifier_ms"]),
                number(row["sinew_ms"]),
                number(row["accelerated_ms"]),
                number(row["sinew_mesh_ms"]),
                number(row["modifier_adds_ms"]),
                number(row["sinew_adds_ms"]),
                number(row["adds_times_less"], "x"),
                number(row["accelerate_s"]),
            )
        )
        + " |"
    )


def rig_of(text):
    if is_file(text):
        return str(Path(text).resolve(strict=True))
    if text not in (*RIGS, "all"):
        raise argparse.ArgumentTypeError(f"{text} is neither a rig nor a .blend file")
    return text


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="bench_playback.py", description=__doc__.splitlines()[0])
    names = ", ".join((*RIGS, "all"))
    parser.add_argument("--rig", action="append", type=rig_of, help=f"{names}, or a .blend file; may be repeated")
    parser.add_argument("--stack", action="append", choices=STACKS, dest="stacks", help="may be repeated")
    parser.add_argument("--vertices", action="append", type=int, help="of a mesh; may be repeated")
    parser.add_argument("--characters", type=int, help="how many are in one scene")
    parser.add_argument("--beside", type=int, help="measure only with this many objects more that are in no scene")
    parser.add_argument("--json")
    options = parser.parse_args(arguments)
    if options.rig and "all" in options.rig:
        options.rig = RIGS
    elif options.stacks or options.characters or options.vertices:
        options.rig = options.rig or ["human"]
    return options


def main(arguments):
    options = parsed(arguments)
    results = [] if options.beside else table(options)
    if options.beside or not (options.rig or options.stacks):
        row = measure_beside(options.beside or 10_000)
        results.append(row)
        print(
            "\n{characters} bound meshes: {alone_ms:.2f} ms per frame, beside {beside_objects:,} objects "
            "{beside_ms:.2f} ms".format(**row)
        )
    if options.json:
        Path(options.json).write_text(
            json.dumps({"blender": bpy.app.version_string, "results": results}, indent=1) + "\n"
        )


def table(options):
    """Prints a line for each row, and returns all rows."""
    print(f"\nBlender {bpy.app.version_string}, milliseconds per frame, medians of {len(FRAMES)} frames\n")
    columns = "rig (bones)", "vertices", "with", "rig alone", "modifier", "Sinew", "accelerated", "output Mesh"
    return print_rows((*columns, "modifier adds", "Sinew adds", "less", "accelerate, s"), rows(options), line)


def print_rows(columns, measured, line):
    """Prints a table, each line as soon as its row is measured, and returns the rows. columns: their titles; line: a
    function that returns the line of a row."""
    print(f"| {' | '.join(columns)} |")
    print("|" + "---|" * len(columns))
    results = []
    for row in measured:
        results.append(row)
        print(line(row), flush=True)
    return results


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
