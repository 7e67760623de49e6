"""Measures rigs' programs against Blender's evaluation of the same rigs, in the same process.

    blender -b --python-exit-code 1 --python addon/bench_rig_programs.py -- [--rig NAME]... [--folder FOLDER]

Each rig is alone in its scene, and all its controls have keys: small moves and turns. Frames alternate between
`scene.frame_set`, with as many threads as Blender takes, and the program on one thread, whose results are compared with
`==`. Times are those of the fastest tenth, because other programs slow Blender's threads down more than one thread; for
the same reason the time on the processors is measured too, of all threads together. `--folder` measures the rigs of
your own .blend files too: armatures of at least 150 bones whose name begins with "RIG". Without options: five of
Rigify's rigs.
"""

import argparse
import json
import sys
from pathlib import Path
from time import perf_counter, process_time

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from bench_playback import number, print_rows, without_handlers
from bench_rigs import ADDON, METARIGS, animate, make_generated, put_alone, sinew

RIGS = ("human", "cat", "horse", "bird", "shark")
FRAMES, ROUNDS = range(2, 42), 3
BATCH = 240  # frames
LEAST_BONES = 150
PARTS = ("curves", "drivers", "bones", "ik", "segments")
COMPARED = range(2, 42, 6)


def milliseconds(function, *arguments):
    start = perf_counter()
    found = function(*arguments)
    return 1e3 * (perf_counter() - start), found


def fastest(times):
    """Returns the time that a tenth of the others undercut."""
    return float(np.quantile(times, 0.1))


def fastest_of(function, *arguments):
    """Returns milliseconds, and the last result."""
    times, found = zip(*(milliseconds(function, *arguments) for _ in range(2 * ROUNDS)))
    return fastest(times), found[-1]


def measure(ob, name):
    """Returns one row, a dictionary. ob: an armature object that is animated and alone in the scene."""
    native = sinew("native").sinew_native
    reading, checking = sinew("description.reading"), sinew("description.equality")
    reading_ms, read = fastest_of(reading.read, ob)
    building_ms, program = fastest_of(checking.program_of, read)
    with without_handlers():
        different = checking.differences(program, checking.record_frames(ob, read, COMPARED))
        assert not different, f"{name}: {different[0]}"
        pairs = [pair(program, frame) for _ in range(ROUNDS) for frame in FRAMES]
    blender, blender_busy, ours, ours_busy = (fastest(times) for times in zip(*pairs))
    times = np.array(FRAMES, np.float32)
    parts = [program.profile(times) for _ in range(2 * ROUNDS)]
    batches = {}
    batch = np.linspace(FRAMES[0], FRAMES[-1], BATCH, dtype=np.float32)
    for _ in range(2 * ROUNDS):
        for threads in (1, 2):
            native.set_thread_count(threads)
            taken, _ = milliseconds(program.evaluate, batch)
            batches.setdefault(threads, []).append(taken)
    native.set_thread_count(0)
    description = read.description
    # Reading the clock makes parts longer that alternate often: they are shares of what a frame of a batch takes.
    shares = {part: fastest([p[part] for p in parts]) for part in PARTS}
    scale = fastest(batches[1]) / BATCH / sum(shares.values())
    return {
        "rig": name,
        "bones": len(description["bones"]),
        "constraints": len(description["constraints"]),
        "drivers": len(description["drivers"]),
        "curves": len(description["curves"]),
        "blender_ms": blender,
        "program_ms": ours,
        "times_faster": blender / ours,
        "blender_busy_ms": blender_busy,
        "program_busy_ms": ours_busy,
        "times_less_busy": blender_busy / ours_busy,
        **{f"{part}_ms": scale * shares[part] for part in PARTS},
        "frames_per_second": 1e3 * BATCH / fastest(batches[1]),
        "frames_per_second_2": 1e3 * BATCH / fastest(batches[2]),
        "reading_ms": reading_ms,
        "building_ms": building_ms,
    }


def pair(program, frame):
    """Returns milliseconds for a frame: Blender's, those of all its threads together, the program's, and the time on a
    processor of that."""
    found = []
    for function, argument in ((bpy.context.scene.frame_set, frame), (program.evaluate, np.array([frame], np.float32))):
        busy = process_time()
        found.append(milliseconds(function, argument)[0])
        found.append(1e3 * (process_time() - busy))
    return found


def generated(rig):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)
    ob = make_generated(rig)
    animate(ob, 1, controls=None)
    return ob


def of_folder(folder):
    """Yields the rigs of .blend files and their names, each animated and alone in a scene."""
    for path in sorted(Path(folder).glob("*.blend")):
        bpy.ops.wm.open_mainfile(filepath=str(path))
        bpy.ops.preferences.addon_enable(module=ADDON)
        armatures = [ob for ob in bpy.data.objects if ob.type == "ARMATURE" and ob.name.startswith("RIG")]
        for ob in armatures:
            if len(ob.pose.bones) < LEAST_BONES:
                continue
            animate(put_alone(ob), 1, controls=None)
            yield ob, f"{ob.name} ({path.stem})"


def rows(options):
    for rig in options.rig or (() if options.folder else RIGS):
        yield measure(generated(rig), rig)
    for ob, name in of_folder(options.folder) if options.folder else ():
        yield measure(ob, name)


def line(row):
    cells = [f"{row['rig']}, {row['bones']:,} bones"]
    cells += [f"{row['blender_ms']:.2f}", f"{row['program_ms']:.2f}", number(row["times_faster"], "x")]
    cells += [f"{row['blender_busy_ms']:.2f}", number(row["times_less_busy"], "x")]
    cells += [f"{row[f'{part}_ms']:.3f}" for part in PARTS]
    one, two = row["frames_per_second"], row["frames_per_second_2"]
    cells += [f"{one:,.0f}", f"{two:,.0f} ({two / one:.1f}x)"]
    cells += [f"{row['reading_ms']:.0f} + {row['building_ms']:.0f}"]
    return f"| {' | '.join(cells)} |"


def main(arguments):
    parser = argparse.ArgumentParser(prog="bench_rig_programs.py", description=__doc__.splitlines()[0])
    parser.add_argument("--rig", action="append", choices=METARIGS, help="may be repeated")
    parser.add_argument("--folder", type=lambda path: Path(path).resolve(strict=True), help="of .blend files with rigs")
    parser.add_argument("--json")
    options = parser.parse_args(arguments)
    print(f"\nBlender {bpy.app.version_string}, milliseconds per frame, {ROUNDS} x {len(FRAMES)} frames\n")
    columns = "rig", "Blender", "program, one thread", "faster", "Blender's processor time", "less"
    parts = "curves", "drivers", "bones", "IK", "B-bones"
    batches = "frames/s, one thread", "two", "reading + building"
    results = print_rows((*columns, *parts, *batches), rows(options), line)
    if options.json:
        Path(options.json).write_text(
            json.dumps({"blender": bpy.app.version_string, "results": results}, indent=1) + "\n"
        )


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
