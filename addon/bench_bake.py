"""Measures the cost of a baked frame: Sinew against Blender's own exporters of point caches.

    blender -b --python-exit-code 1 --python addon/bench_bake.py -- [--vertices N] [--json FILE]

A chain of 22 bones with a tube of 120,000 vertices, bound to Sinew; 100 frames. Milliseconds per frame, medians of
ROUNDS alternating rounds: the evaluation alone, the write alone (the same bytes in one stream, synced to the disk),
Sinew's whole bakes, and the exporters: Blender's own (io_shape_mdd, io_export_pc2) where it has them, and plain
versions of what they do: a list of coordinates packed by `struct`, and `foreach_get` into numpy.

Then whole bakes of 250 frames of a fifth of the vertices with Subdivision at the end, in seconds: evaluated by Blender,
and computed natively, the search for the weights included.
"""

import argparse
import json
import os
import statistics
import struct
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import addon_utils
import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from bench_rigs import ADDON, CHAIN, make_characters, select, sinew

FRAMES = range(1, 101)
SLOW_FRAMES = range(1, 11)  # for the slow exporters
ROUNDS = 3
LONG = 250  # frames of what is subdivided


def each_frame(frames):
    scene = bpy.context.scene
    for frame in frames:
        scene.frame_set(frame)
        yield bpy.context.evaluated_depsgraph_get()


def evaluate(ob, _folder):
    for depsgraph in each_frame(FRAMES):
        len(ob.evaluated_get(depsgraph).data.vertices)
    return len(FRAMES)


def write_alone(ob, folder):
    positions = np.random.default_rng(1).random(3 * len(ob.data.vertices), np.float32)
    with open(folder / "raw", "wb", buffering=0) as file:
        for _ in FRAMES:
            file.write(positions)
        os.fdatasync(file.fileno())
    return len(FRAMES)


def bake(format):
    def run(ob, folder):
        frames = sinew("bake.frame_range").FrameRange(FRAMES[0], FRAMES[-1])
        job = sinew("bake.job").Job(str(folder), frames, (ob.name,), format, overwrite=True)
        sinew("bake.baking").run(bpy.context, job)
        return len(FRAMES)

    return run


def by_struct(ob, folder):
    """Writes the file as io_shape_mdd does."""
    with open(folder / "struct.mdd", "wb") as file:
        for depsgraph in each_frame(SLOW_FRAMES):
            evaluated = ob.evaluated_get(depsgraph)
            mesh = evaluated.to_mesh()
            numbers = [axis for vertex in mesh.vertices for axis in vertex.co]
            file.write(struct.pack(f">{len(numbers)}f", *numbers))
            evaluated.to_mesh_clear()
    return len(SLOW_FRAMES)


def by_numpy(ob, folder):
    with open(folder / "numpy.pc2", "wb") as file:
        for depsgraph in each_frame(FRAMES):
            mesh = ob.evaluated_get(depsgraph).data
            numbers = np.empty(3 * len(mesh.vertices), np.float32)
            mesh.vertices.foreach_get("co", numbers)
            file.write(numbers.tobytes())
        os.fdatasync(file.fileno())
    return len(FRAMES)


def export_mdd(ob, folder):
    bpy.ops.export_shape.mdd(
        filepath=str(folder / "own.mdd"), frame_start=SLOW_FRAMES[0], frame_end=SLOW_FRAMES[-1], use_rest_frame=False
    )
    return len(SLOW_FRAMES)


def export_pc2(ob, folder):
    bpy.ops.export_shape.pc2(
        filepath=str(folder / "own.pc2"), range_start=SLOW_FRAMES[0], range_end=SLOW_FRAMES[-1], rot_x90=False
    )
    return len(SLOW_FRAMES)


def ways():
    """Returns {name: function(object, folder) that returns the number of frames it wrote or evaluated}."""
    found = {
        "evaluation alone": evaluate,
        "write alone": write_alone,
        "Sinew, PC2": bake("pc2"),
        "Sinew, MDD": bake("mdd"),
        "numpy, foreach_get": by_numpy,
        "struct, vertex by vertex": by_struct,
    }
    for module, name, way in (
        ("io_shape_mdd", "Blender's MDD exporter", export_mdd),
        ("io_export_pc2", "Blender's PC2 exporter", export_pc2),
    ):
        if any(each.__name__ == module for each in addon_utils.modules()):
            bpy.ops.preferences.addon_enable(module=module)
            found[name] = way
    return found


def measure(vertices):
    """Returns the number of vertices, and [(name, milliseconds per frame)]."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)
    (ob,) = make_characters(CHAIN, vertices)
    select(ob)
    bpy.ops.object.sinew_bind()
    times = {}
    with tempfile.TemporaryDirectory(dir=os.environ.get("BENCH_FOLDER")) as folder:
        for _ in range(ROUNDS):
            for name, way in ways().items():
                start = perf_counter()
                count = way(ob, Path(folder))
                times.setdefault(name, []).append(1e3 * (perf_counter() - start) / count)
    return len(ob.data.vertices), [(name, statistics.median(each)) for name, each in times.items()]


def subdivided(vertices):
    """Yields (levels, vertices of the result, seconds with Blender's modifier, seconds with Sinew's)."""
    shapes, frame_range = sinew("bake.evaluation"), sinew("bake.frame_range")
    for levels in (1, 2):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.preferences.addon_enable(module=ADDON)
        (ob,) = make_characters(CHAIN, vertices)
        ob.modifiers.new("Subdivision", "SUBSURF").levels = levels
        select(ob)
        bpy.ops.object.sinew_bind()
        times, pays = {}, shapes.PAYS
        with tempfile.TemporaryDirectory(dir=os.environ.get("BENCH_FOLDER")) as folder:
            frames = frame_range.FrameRange(1, LONG)
            job = sinew("bake.job").Job(folder, frames, (ob.name,), "pc2", overwrite=True)
            for _ in range(ROUNDS):
                for shapes.PAYS in (float("inf"), pays):
                    start = perf_counter()
                    (done,) = sinew("bake.baking").run(bpy.context, job)
                    times.setdefault(shapes.PAYS, []).append(perf_counter() - start)
                    assert shapes.PAYS != pays or "natively" in done.remark, done.remark
        yield levels, done.vertices, *map(statistics.median, times.values())


def main(arguments):
    parser = argparse.ArgumentParser(prog="bench_bake.py", description=__doc__.splitlines()[0])
    parser.add_argument("--vertices", type=int, default=120_000)
    parser.add_argument("--json")
    options = parser.parse_args(arguments)
    vertices, rows = measure(options.vertices)
    whole = dict(rows)["Sinew, MDD"]
    print(
        f"\nBlender {bpy.app.version_string}, {vertices:,} vertices, milliseconds per frame, medians of {ROUNDS} "
        "rounds\n"
    )
    print("| method | ms per frame | MB/s | times Sinew's MDD |\n|---|---|---|---|")
    for name, ms in rows:
        print(f"| {name} | {ms:.2f} | {12 * vertices / ms / 1e3:,.0f} | {ms / whole:.1f} |")
    print(f"\n| {LONG} frames | vertices | Blender: s | natively: s | |\n|---|---|---|---|---|")
    long = []
    for levels, count, by_blender, natively in subdivided(options.vertices // 5):
        long.append({"levels": levels, "vertices": count, "blender": by_blender, "natively": natively})
        ratio = f"{by_blender / natively:.1f} times"
        print(f"| Subdivision, level {levels} | {count:,} | {by_blender:.1f} | {natively:.1f} | {ratio} |", flush=True)
    if options.json:
        found = {"blender": bpy.app.version_string, "vertices": vertices, "ms": dict(rows), "subdivided": long}
        Path(options.json).write_text(json.dumps(found, indent=1) + "\n")


main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
