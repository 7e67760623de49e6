"""How long a frame takes, by Blender's Armature modifier and by Sinew in the same process.

    blender -b --python-exit-code 1 --python addon/bench_playback.py -- [--json FILE] [VERTICES ...]

Medians over 40 different frames of whole `scene.frame_set` calls; an armature of 22 animated bones,
about three influences a vertex. The last rows are ten characters of the first size in one scene.
"""

import json
import statistics
import sys
from pathlib import Path
from time import perf_counter

import bpy
import numpy as np

BONES = 22
FRAMES = range(2, 42)
SIZES = (30_000, 180_000, 1_000_000)
STAGES = ("pose", "skin", "write")
OUTPUTS = ("MODIFIER", "MESH")
ROUNDS = 3
ADDON = bpy.types.VIEW3D_PT_sinew.__module__.rpartition(".ui.")[0]  # however this Blender names it


def make_armature():
    data = bpy.data.armatures.new("Rig")
    armature = bpy.data.objects.new("Rig", data)
    bpy.context.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    parent = None
    for i in range(BONES):
        bone = data.edit_bones.new(f"bone{i:02}")
        bone.head, bone.tail, bone.parent = (0, 0, i), (0, 0, i + 1), parent
        parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    random = np.random.default_rng(1)
    for bone in armature.pose.bones:
        bone.rotation_mode = "XYZ"
        for frame in (1, 15, 30, 45):
            bone.rotation_euler = random.uniform(-0.2, 0.2, 3)
            bone.keyframe_insert("rotation_euler", frame=frame)
    return armature


def make_mesh(armature, vertices):
    """A tube of quads along the bones."""
    around = 4 * round((vertices / BONES) ** 0.5 / 4)
    rings = vertices // around
    height, angle = np.meshgrid(np.linspace(0, BONES, rings),
                                np.linspace(0, 2 * np.pi, around, endpoint=False), indexing="ij")
    points = np.stack([np.cos(angle), np.sin(angle), height], -1).reshape(-1, 3).astype(np.float32)
    row, column = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    after = (column + 1) % around
    corners = np.stack([row * around + column, row * around + after,
                        (row + 1) * around + after, (row + 1) * around + column], -1).reshape(-1)
    mesh = bpy.data.meshes.new("Tube")
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.reshape(-1))
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners.astype(np.int32))
    mesh.polygons.add(len(corners) // 4)
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 4, dtype=np.int32))
    if bpy.app.version < (4, 1, 0):
        mesh.polygons.foreach_set("loop_total", np.full(len(corners) // 4, 4, np.int32))
    mesh.update(calc_edges=True)
    ob = bpy.data.objects.new("Tube", mesh)
    ob.parent = armature  # as Blender's own Parent > Armature Deform does
    bpy.context.collection.objects.link(ob)
    for bone in armature.data.bones:
        ob.vertex_groups.new(name=bone.name)
    write_weights(mesh, points[:, 2])
    modifier = ob.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature
    return ob


def write_weights(mesh, height):
    """The three bones nearest to each vertex."""
    import bmesh
    bm = bmesh.new()
    bm.from_mesh(mesh, face_normals=False)
    layer = bm.verts.layers.deform.verify()
    near = np.clip(height.astype(int), 1, BONES - 2)
    for vertex, bone, z in zip(bm.verts, near.tolist(), height.tolist()):
        entry = vertex[layer]
        for other in (bone - 1, bone, bone + 1):
            entry[other] = max(0.05, 1 - 0.6 * abs(z - other - 0.5))
    bm.to_mesh(mesh)
    bm.free()


def frame_times(scene, entries=()):
    """([ms of frame_set], [{stage: ms, of all bound meshes}]), one of each a frame."""
    times, stages = [], []
    for frame in FRAMES:
        start = perf_counter()
        scene.frame_set(frame)
        times.append(1e3 * (perf_counter() - start))
        stages.append({stage: sum(getattr(entry.timings, stage) for entry in entries)
                       for stage in STAGES})
    return times, stages


def measure(vertices, preserve_volume, characters=1):
    """characters: so many in one scene, each with an armature of its own; `vertices` of each."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)
    session = sys.modules[f"{ADDON}.session"]
    scene = bpy.context.scene
    objects = [make_mesh(make_armature(), vertices) for _ in range(characters)]
    for ob in bpy.context.selected_objects:
        ob.select_set(False)
    for ob in objects:
        ob.modifiers["Armature"].use_deform_preserve_volume = preserve_volume
        ob.select_set(True)
    bpy.context.view_layer.objects.active = objects[0]
    scene.frame_set(1)
    method = "preserve volume" if preserve_volume else "linear"
    # Turn and turn about, for the machine's pace drifts: the modifier, then each output.
    modifier, times, stages, bound = [], {}, {}, {}
    for _ in range(ROUNDS if vertices * characters < 500_000 else 1):
        modifier += frame_times(scene)[0]
        for output in OUTPUTS:
            start = perf_counter()
            bpy.ops.object.sinew_bind(output=output)
            bound[output] = perf_counter() - start
            scene.frame_set(1)
            frames, parts = frame_times(scene, [session.character(ob) for ob in objects])
            times.setdefault(output, []).extend(frames)
            stages.setdefault(output, []).extend(parts)
            bpy.ops.object.sinew_unbind()
            scene.frame_set(1)
            modifier += frame_times(scene)[0]
    rows = []
    for output in OUTPUTS:
        own = {stage: statistics.median(parts[stage] for parts in stages[output]) for stage in STAGES}
        builtin, ours = statistics.median(modifier), statistics.median(times[output])
        rows.append({
            "vertices": len(objects[0].data.vertices), "characters": characters, "method": method,
            "output": output, "modifier_ms": builtin, "sinew_ms": ours,
            "sinew_extremes_ms": (min(times[output]), max(times[output])),
            "times_faster": builtin / ours, "stages_ms": own, "blender_ms": ours - sum(own.values()),
            "accelerate_s": bound[output]})
    return rows


def main(arguments):
    path = None
    if "--json" in arguments:
        place = arguments.index("--json")
        path = arguments[place + 1]
        del arguments[place:place + 2]
    sizes = [int(size) for size in arguments] or SIZES
    rows = [row for preserve_volume in (False, True) for size in sizes
            for row in measure(size, preserve_volume)]
    rows += measure(sizes[0], False, characters=10)
    print(f"\nBlender {bpy.app.version_string}, milliseconds a frame, medians of {len(FRAMES)} frames\n")
    print("| vertices | method | output | modifier | Sinew | faster | pose | skin | write | Blender "
          "| accelerate, s |")
    print("|" + "---|" * 11)
    for row in rows:
        stages = " | ".join(f"{row['stages_ms'][stage]:.3f}" for stage in STAGES)
        count = f"{row['characters']} x " if row["characters"] > 1 else ""
        print(f"| {count}{row['vertices']:,} | {row['method']} | {row['output']} | {row['modifier_ms']:.2f} "
              f"| {row['sinew_ms']:.2f} | {row['times_faster']:.2f}x | {stages} "
              f"| {row['blender_ms']:.2f} | {row['accelerate_s']:.2f} |")
    if path:
        Path(path).write_text(json.dumps({"blender": bpy.app.version_string, "results": rows}, indent=1) + "\n")


main(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else [])
