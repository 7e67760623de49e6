"""Measures the time and the memory that a crowd takes, for several ways of holding its shapes.

    blender -b --python-exit-code 1 --python addon/bench_crowd.py -- [--vertices N] [--agents N] [--json FILE]

Medians of whole `scene.frame_set` calls over 40 frames, and the growth of a separate process, for: the
character duplicated with its armature, deformed by Blender's modifier and by Sinew; and agents that pick one of 64
shapes: one mesh of all agents, rebuilt on each frame; one mesh of all shapes, split into instances on each frame;
Sinew's crowd, whose shapes are objects in a collection. The last row is Sinew's crowd with ten times as many agents.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
from pathlib import Path
from time import perf_counter

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from bench_rigs import ADDON, CHAIN, make_characters, select, sinew

FRAMES = range(2, 42)
SHAPES = 64
RESULT = "measured"  # begins the line in which a process prints its measurements


def frame_time():
    """Returns the median, in milliseconds. One extra frame is played first as a warm-up."""
    scene = bpy.context.scene
    scene.frame_set(FRAMES[0] - 1)
    times = []
    for frame in FRAMES:
        start = perf_counter()
        scene.frame_set(frame)
        times.append(1e3 * (perf_counter() - start))
    return statistics.median(times)


def resident():
    """Returns the resident memory of this process, in bytes."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


# --- ways of holding the shapes -------------------------------------------------------------------


def duplicated(vertices, agents):
    make_characters(CHAIN, vertices, agents)


def duplicated_with_sinew(vertices, agents):
    select(*make_characters(CHAIN, vertices, agents))
    bpy.ops.object.sinew_bind()


def crowd(vertices, agents):
    """Makes a crowd as Add > Sinew Crowd does, and removes the character."""
    (ob,) = make_characters(CHAIN, vertices)
    armature = ob.parent
    select(ob)
    assert bpy.ops.object.sinew_crowd_add(agents=agents, shapes=SHAPES) == {"FINISHED"}
    for each in ob, armature:
        bpy.data.objects.remove(each)
    return bpy.context.active_object


def split_mesh(vertices, agents):
    """Makes the same crowd from one mesh of all shapes, whose parts become the instances on each frame."""
    ob = crowd(vertices, agents)
    modifier = ob.modifiers[0]
    phases = sinew("blender.graph").get_input(modifier, "Phases")
    meshes = [each.data for each in phases.objects]
    carrier = bpy.data.objects.new("shapes", joined(meshes))
    phases.objects.link(carrier)
    for each in [each for each in phases.objects if each != carrier]:
        bpy.data.objects.remove(each)
    for mesh in meshes:
        bpy.data.meshes.remove(mesh)
    tree = modifier.node_group
    instances = next(node for node in tree.nodes if node.bl_idname == "GeometryNodeInstanceOnPoints")
    info = next(node for node in tree.nodes if node.bl_idname == "GeometryNodeCollectionInfo")
    info.inputs["Separate Children"].default_value = False
    realised = tree.nodes.new("GeometryNodeRealizeInstances")
    split = tree.nodes.new("GeometryNodeSplitToInstances")
    split.domain = "FACE"
    shape = tree.nodes.new("GeometryNodeInputNamedAttribute")
    shape.data_type = "INT"
    shape.inputs["Name"].default_value = "shape"
    tree.links.new(info.outputs[0], realised.inputs[0])
    tree.links.new(realised.outputs[0], split.inputs[0])
    tree.links.new(next(s for s in shape.outputs if s.enabled), split.inputs["Group ID"])
    tree.links.new(split.outputs[0], instances.inputs["Instance"])


def joined(meshes):
    positions, faces, shapes, start = [], [], [], 0
    for number, mesh in enumerate(meshes):
        positions.append(sinew("blender.meshes").read_positions(mesh))
        _, corners, _ = sinew("blender.meshes").read_faces(mesh)
        faces.append(corners + start)
        start += len(mesh.vertices)
        shapes.append(np.full(len(mesh.polygons), number, np.int32))
    corners = np.concatenate(faces)  # all of them quads
    mesh = sinew("blender.meshes").new_mesh(
        "shapes", np.concatenate(positions), np.arange(0, len(corners) + 1, 4), corners
    )
    mesh.attributes.new("shape", "INT", "FACE").data.foreach_set("value", np.concatenate(shapes))
    return mesh


def realised(vertices, agents):
    """Makes the same crowd as one mesh of all agents, rebuilt on each frame: the crowd as a mesh modifier sees it."""
    ob = crowd(vertices, agents)
    tree = ob.modifiers[0].node_group
    target = next(node for node in tree.nodes if node.bl_idname == "NodeGroupOutput")
    whole = tree.nodes.new("GeometryNodeRealizeInstances")
    tree.links.new(target.inputs[0].links[0].from_socket, whole.inputs[0])
    tree.links.new(whole.outputs[0], target.inputs[0])


SPLIT = "one mesh of all shapes, split on each frame"
WAYS = {
    "armatures and meshes, Armature modifier": duplicated,
    "armatures and meshes, Sinew": duplicated_with_sinew,
    "one mesh of all agents, made on each frame": realised,
    SPLIT: split_mesh,
    "Sinew Crowd: shapes as objects, instances": crowd,
}


def measure(way, vertices, agents):
    """Measures in this process. Returns milliseconds per frame and megabytes."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)
    before = resident()
    WAYS[way](vertices, agents)
    return frame_time(), (resident() - before) / 1e6


def measure_apart(way, vertices, agents):
    """Measures the same in a separate process."""
    options = ["--way", way, "--vertices", str(vertices), "--agents", str(agents)]
    command = [bpy.app.binary_path, "-b", "--python-exit-code", "1", "--python", __file__, "--", *options]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit(done.stdout[-2000:])
    return next(map(float, line.split()[1:]) for line in done.stdout.splitlines() if line.startswith(RESULT))


def main(arguments):
    parser = argparse.ArgumentParser(prog="bench_crowd.py", description=__doc__.splitlines()[0])
    parser.add_argument("--vertices", type=int, default=10_000)
    parser.add_argument("--agents", type=int, default=100)
    parser.add_argument("--json")
    parser.add_argument("--way", choices=WAYS, help="measure only this one")
    options = parser.parse_args(arguments)
    if options.way:
        print(RESULT, *measure(options.way, options.vertices, options.agents))
        return
    print(
        f"\nBlender {bpy.app.version_string}, {options.vertices:,} vertices per agent, {SHAPES} shapes, milliseconds "
        "per whole frame, medians of 40\n"
    )
    print("| what holds the shapes | agents | ms per frame | MB | times less than armatures |\n|---|---|---|---|---|")
    rows = []
    ways = [way for way in WAYS if way != SPLIT or hasattr(bpy.types, "GeometryNodeSplitToInstances")]  # not in 3.4
    for way, agents in [*((way, options.agents) for way in ways), (ways[-1], 10 * options.agents)]:
        ms, megabytes = measure_apart(way, options.vertices, agents)
        rows.append({"way": way, "agents": agents, "ms": ms, "megabytes": megabytes})
        times = f"{rows[0]['ms'] / ms:.1f}" if agents == options.agents else ""
        print(f"| {way} | {agents:,} | {ms:.2f} | {megabytes:,.0f} | {times} |", flush=True)
    if options.json:
        found = {"blender": bpy.app.version_string, "vertices": options.vertices, "rows": rows}
        Path(options.json).write_text(json.dumps(found, indent=1) + "\n")


main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
