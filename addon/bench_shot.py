"""Measures how long a frame of a whole shot takes with Blender's modifiers and with Sinew, in the same process.

    blender -b --python-exit-code 1 --python addon/bench_shot.py -- [--parts] [--moving] [--without WHAT]...

With --played it measures something else, see bench_played.py. With --moving the armature objects have keyframes.

Rigify humans, duplicated with their rigs as Shift D does. Each has a body of 30,000 vertices with 20 shape keys driven
by bones, four garments of 4,000 to 8,000 vertices with their own weights, a Corrective Smooth after the
Armature modifier of one of them, Preserve Volume on body and clothes, and two eyes that are parented to a bone and not
bound. The set has 3,000 props that do not move; two thirds of them share 200 meshes.

Medians of whole `scene.frame_set` calls over 40 different frames, in rounds that alternate between Blender's modifiers
with Sinew's handlers removed, Sinew, and the set with the rigs (the characters' meshes hidden). The figure to compare
is the time that the meshes add to set and rigs, each round less the rigs before and after it: the median of the rounds.
The shapes of all meshes are compared too.
"""

import argparse
import contextlib
import json
import statistics
import sys
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from bench_playback import (
    FRAMES,
    TOLERANCE,
    difference,
    frame_times,
    number,
    rigs_accelerated,
    shapes,
    without_handlers,
)
from bench_rigs import ADDON, add_keys, animate, drive_by_some_bone, make_generated, make_mesh, select

BODY, BODY_VERTICES, BODY_KEYS = "Body", 30_000, 20
CLOTHES = {  # the number of vertices, and the bones that the garment covers
    "Coat": (8_000, ("spine", "shoulder", "upper_arm", "forearm")),
    "Trousers": (6_000, ("pelvis", "thigh", "shin")),
    "Boots": (5_000, ("shin", "foot", "toe")),
    "Gloves": (4_000, ("forearm", "hand", "f_", "thumb", "palm")),
}
SMOOTHED, THICKNESS = "Coat", 0.27  # slightly thicker than the body
EYE_BONES = ("MCH-eye.L", "MCH-eye.R")
PROPS, SHARING_PROPS, SHARED_MESHES, PROP_SIDE = 3_000, 2_000, 200, 10
SHOT_ROUNDS = 9
LEFT_OUT = ("clothes", "keys", "smooth", "preserve-volume", "eyes", "props")  # what --without can leave out


@dataclass
class Person:
    rig: object
    meshes: list  # body and clothes
    eyes: list

    @property
    def objects(self):
        return [self.rig, *self.meshes, *self.eyes]


def part_of(ob):
    """Returns "bodies", "clothes" or "smoothed clothes"."""
    if ob.name.startswith(BODY):
        return "bodies"
    return "smoothed clothes" if any(m.type == "CORRECTIVE_SMOOTH" for m in ob.modifiers) else "clothes"


# --- the shot -------------------------------------------------------------------------------------


def make_shot(characters, without, moving=False):
    """Builds the shot in the open file. Returns [Person]."""
    people = [make_person(without)]
    people += [duplicate(people[0]) for _ in range(characters - 1)]
    for seed, person in enumerate(people, start=1):
        animate(person.rig, seed)
        if moving:
            move(person.rig, seed)
        if "keys" not in without:
            drive_keys(person.meshes[0], seed)
    if "props" not in without:
        add_props()
    return people


def move(rig, seed):
    """Has a person walk and turn."""
    for frame in (FRAMES[0], FRAMES[-1]):
        rig.location = seed, 0.02 * frame, 0.1
        rig.rotation_euler.z = 0.01 * frame
        rig.keyframe_insert("location", frame=frame)
        rig.keyframe_insert("rotation_euler", frame=frame)


def make_person(without):
    rig = make_generated("human")
    body = make_mesh(rig, BODY_VERTICES, False, BODY)
    garments = {} if "clothes" in without else CLOTHES
    clothes = [
        make_mesh(rig, vertices, False, name, covers, THICKNESS) for name, (vertices, covers) in garments.items()
    ]
    if "keys" not in without:
        add_keys(body, BODY_KEYS)
    for ob in (body, *clothes):
        ob.modifiers["Armature"].use_deform_preserve_volume = "preserve-volume" not in without
        if ob.name == SMOOTHED and "smooth" not in without:
            ob.modifiers.new("Smooth", "CORRECTIVE_SMOOTH")
    eyes = [] if "eyes" in without else [make_eye(rig, bone) for bone in EYE_BONES]
    return Person(rig, [body, *clothes], eyes)


def make_eye(rig, bone):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.012)
    eye = bpy.context.active_object
    eye.name = "Eye"
    eye.parent, eye.parent_type, eye.parent_bone = rig, "BONE", rig.data.bones[bone].name
    return eye


def duplicate(person):
    """Duplicates a person as Shift D does."""
    select(*person.objects)
    bpy.ops.object.duplicate()
    copies = bpy.context.selected_objects
    rig = next(ob for ob in copies if ob.type == "ARMATURE")
    meshes = [next(ob for ob in copies if ob.name.startswith(original.name)) for original in person.meshes]
    return Person(rig, meshes, [ob for ob in copies if ob.name.startswith("Eye")])


def drive_keys(body, seed):
    random = np.random.default_rng(seed)
    for key in body.data.shape_keys.key_blocks[1:]:
        drive_by_some_bone(key, body, random)


def add_props():
    shared = [prop_mesh(f"Shared {each}") for each in range(SHARED_MESHES)]
    collection = bpy.data.collections.new("Set")
    bpy.context.scene.collection.children.link(collection)
    for place in range(PROPS):
        mesh = shared[place % SHARED_MESHES] if place < SHARING_PROPS else prop_mesh(f"Prop {place}")
        prop = bpy.data.objects.new(f"Prop {place}", mesh)
        prop.location = (place % 60, place // 60 + 5, 0)
        collection.objects.link(prop)


def prop_mesh(name):
    """Makes a plate of 100 vertices."""
    mesh = bpy.data.meshes.new(name)
    row, column = np.meshgrid(range(PROP_SIDE), range(PROP_SIDE), indexing="ij")
    points = np.stack([row, column, 0 * row], -1).reshape(-1, 3) / PROP_SIDE
    first = (row * PROP_SIDE + column)[:-1, :-1].reshape(-1, 1)
    mesh.from_pydata(points.tolist(), [], (first + [0, 1, PROP_SIDE + 1, PROP_SIDE]).tolist())
    return mesh


# --- measuring ------------------------------------------------------------------------------------


@contextlib.contextmanager
def hidden(objects):
    """Hides the objects inside the `with` block. They stay deselected afterwards."""
    for ob in objects:
        ob.hide_viewport = True
    try:
        yield
    finally:
        for ob in objects:
            ob.hide_viewport = False


def parts_of(meshes, each):
    """Returns {part: its meshes}: all meshes, and, if `each`, also each kind by itself."""
    parts = {"all": meshes}
    for ob in meshes if each else ():
        parts.setdefault(part_of(ob), []).append(ob)
    return parts


def measure(characters, without=(), each_part=False, rounds=SHOT_ROUNDS, moving=False):
    """Returns a list with one row (a dictionary) per part, and the largest difference of the shapes."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)
    people = make_shot(characters, without, moving)
    meshes = [ob for person in people for ob in person.meshes]
    parts = parts_of(meshes, each_part)
    times, worst = {}, 0.0  # the median of each round, by what was on show

    def take(what, objects):
        with hidden(objects):
            times.setdefault(what, []).append(statistics.median(frame_times()))

    def take_parts(who):
        for part, shown in parts.items():
            take((who, part), [ob for ob in meshes if ob not in shown])

    with without_handlers():
        take("set", [ob for person in people for ob in person.objects])
        take("rigs", meshes)
    for _ in range(rounds):
        with without_handlers():
            take_parts("modifiers")
            wanted = shapes_at_the_end(meshes)
        select(*meshes)
        assert bpy.ops.object.sinew_bind() == {"FINISHED"}
        for who, are in (("sinew", False), ("accelerated", True)):
            with rigs_accelerated(are):
                take_parts(who)
                worst = max(worst, difference(shapes_at_the_end(meshes), wanted))
        select(*meshes)  # hiding has deselected them
        assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
        with without_handlers():
            take("rigs", meshes)
    assert worst < TOLERANCE, f"Sinew's shapes are up to {worst:.3g} of the diagonal off the modifiers'"
    return [row_of(times, part, shown) for part, shown in parts.items()], worst


def shapes_at_the_end(meshes):
    bpy.context.scene.frame_set(FRAMES[-1])
    return shapes(meshes)


def row_of(times, part, meshes):
    """times: {what: its median in each round}; of the rigs also one from before the first."""
    rigs, modifiers, ours = np.array(times["rigs"]), np.array(times["modifiers", part]), np.array(times["sinew", part])
    around = (rigs[:-1] + rigs[1:]) / 2  # each round, since the machine's speed drifts
    added, ours_added = np.median(modifiers - around), np.median(ours - around)
    return {
        "part": part,
        "meshes": len(meshes),
        "set_ms": times["set"][0],
        "rigs_ms": float(np.median(rigs)),
        "modifiers_ms": float(np.median(modifiers)),
        "sinew_ms": float(np.median(ours)),
        "accelerated_ms": float(np.median(times["accelerated", part])),
        "times_faster": float(np.median(modifiers / ours)),
        "accelerated_times_faster": float(np.median(modifiers / np.array(times["accelerated", part]))),
        "modifiers_add_ms": float(added),
        "sinew_adds_ms": float(ours_added),
        "adds_times_less": float(added / ours_added) if ours_added > 0 else None,
        "modifiers_a_mesh_ms": float(added / len(meshes)),
        "sinew_a_mesh_ms": float(ours_added / len(meshes)),
        "rounds": {name: times[name, part] for name in ("modifiers", "sinew", "accelerated")} | {"rigs": times["rigs"]},
    }


def line(row):
    cells = (
        f"{row['part']} ({row['meshes']})",
        *(number(row[name]) for name in ("set_ms", "rigs_ms", "modifiers_ms", "sinew_ms")),
        number(row["times_faster"], "x"),
        number(row["accelerated_ms"]),
        number(row["accelerated_times_faster"], "x"),
        *(number(row[name]) for name in ("modifiers_add_ms", "sinew_adds_ms")),
        number(row["adds_times_less"], "x"),
        *(f"{row[name]:.3f}" for name in ("modifiers_a_mesh_ms", "sinew_a_mesh_ms")),
    )
    return f"| {' | '.join(cells)} |"


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="bench_shot.py", description=__doc__.splitlines()[0])
    parser.add_argument("--characters", type=int, default=5)
    parser.add_argument("--without", action="append", choices=LEFT_OUT, default=[], help="may be repeated")
    parser.add_argument("--parts", action="store_true", help="also measure bodies, clothes and smoothed clothes alone")
    parser.add_argument("--played", action="store_true", help="all characters but one played, see bench_played.py")
    parser.add_argument("--moving", action="store_true", help="the armature objects have keyframes, too")
    parser.add_argument("--json")
    return parser.parse_args(arguments)


def main(arguments):
    options = parsed(arguments)
    if options.played:
        import bench_played

        bench_played.main(options)
        return
    without = f", without {', '.join(options.without)}" if options.without else ""
    without += ", moving" if options.moving else ""
    print(
        f"\nBlender {bpy.app.version_string}, {options.characters} characters{without}, milliseconds per frame, "
        f"medians of {SHOT_ROUNDS} x {len(FRAMES)} frames\n"
    )
    print(
        "| meshes | set alone | set and rigs | modifiers | Sinew | faster | accelerated | faster | modifiers add "
        "| Sinew adds | less | modifiers, per mesh | Sinew, per mesh |"
    )
    print("|" + "---|" * 13)
    rows, worst = measure(options.characters, options.without, options.parts, moving=options.moving)
    for row in rows:
        print(line(row), flush=True)
    print(f"| Shapes of all meshes: off by {worst:.1e} of the diagonal at most |" + " |" * 12)
    if options.json:
        found = {"blender": bpy.app.version_string, "without": options.without, "difference": worst, "rows": rows}
        Path(options.json).write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
