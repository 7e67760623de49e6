"""Measures what the edits of a shot take, between two playbacks: posing, keys, undo and modes.

    blender -b --python-exit-code 1 --python addon/bench_edits.py -- --shot [--characters N] [--json FILE]

The shot is that of bench_shot.py without the props. Rounds alternate between Blender's modifiers with Sinew's handlers
removed, Sinew with live rigs, with accelerated ones, and with all characters but one played. Each step is measured with
the evaluation that follows. The shapes of all meshes after the last step are compared.
"""

import importlib
import json
import statistics
from pathlib import Path
from time import perf_counter

import bpy

from bench_playback import TOLERANCE, difference, number, shapes, without_handlers
from bench_rigs import ADDON, select
from bench_shot import make_shot

ROUNDS, STEPS, MODES, UNDONE = 4, 30, 16, 8
FRAME = 20
DRAGGED = {"torso": "torso", "finger": "f_index.01_master.L", "head": "head"}
KEYED = "hand_ik.L"
WAYS = {
    "modifiers": "Blender's modifiers",
    "live": "Sinew, live rigs",
    "accelerated": "rigs accelerated",
    "played": "all but one played",
}


def milliseconds(step):
    """Calls step and has Blender evaluate. Returns the time of both."""
    start = perf_counter()
    step()
    bpy.context.view_layer.update()
    return 1e3 * (perf_counter() - start)


def bone_named(rig, name):
    return bpy.data.objects[rig].pose.bones[name]


def drag(rig, bone_name):
    bone = bone_named(rig, bone_name)
    before = bone.location[0]

    def move(distance):
        bone.location[0] = before + distance

    times = [milliseconds(lambda step=step: move(0.002 * step)) for step in range(STEPS)]
    milliseconds(lambda: move(0.0))
    return times[3:]


def play_on(rig):
    """The frame that is played after a bone was moved by hand."""
    times = []
    for step in range(STEPS):
        bone_named(rig, DRAGGED["torso"]).location[0] += 0.001
        bpy.context.view_layer.update()
        times.append(milliseconds(lambda step=step: bpy.context.scene.frame_set(FRAME + step % 2)))
    return times[3:]


def with_an_update():
    """Frames after each of which another add-on's handler has the view layer updated."""

    def update(*_):
        bpy.context.view_layer.update()

    bpy.app.handlers.frame_change_post.append(update)
    try:
        times = [milliseconds(lambda step=step: bpy.context.scene.frame_set(FRAME - step)) for step in range(STEPS)]
    finally:
        bpy.app.handlers.frame_change_post.remove(update)
    return times[3:]


def undo(rig):
    """Moves a bone and undoes that, to an earlier move: Blender evaluates again whatever was tagged before the step to
    which it returns, and after binding that is all. No reference outlives an undo."""
    bone_named(rig, DRAGGED["torso"]).location[0] += 0.0  # a move to return to
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="Move")
    times = []
    for step in range(UNDONE):
        bone_named(rig, DRAGGED["torso"]).location[0] += 0.01 * (step + 1)
        bpy.context.view_layer.update()
        bpy.ops.ed.undo_push(message="Move")
        times.append(milliseconds(bpy.ops.ed.undo))
    return times[1:]


def insert_keys(rig):
    bone = bone_named(rig, KEYED)
    frames = [FRAME + 0.25 * step for step in range(STEPS)]

    def insert(frame):
        bone.keyframe_insert("location", frame=frame)
        bone.id_data.update_tag(refresh={"TIME"})  # as Blender's operator does

    times = [milliseconds(lambda frame=frame: insert(frame)) for frame in frames]
    for frame in frames:
        bone.keyframe_delete("location", frame=frame)
    bpy.context.view_layer.update()
    return times[3:]


def move_keys(rig):
    action = bpy.data.objects[rig].animation_data.action
    curves = action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves
    curve = curves.find(f'pose.bones["{KEYED}"].location', index=0) or curves[0]
    key = curve.keyframe_points[0]
    before = key.co[1]

    def move(distance):
        key.co[1] = before + distance
        curve.update()

    times = [milliseconds(lambda step=step: move(0.001 * step)) for step in range(STEPS)]
    milliseconds(lambda: move(0.0))
    return times[3:]


def toggle(name, mode):
    """A mode is entered and left."""
    select(bpy.data.objects[name])

    def there_and_back():
        bpy.ops.object.mode_set(mode=mode)
        bpy.context.view_layer.update()
        bpy.ops.object.mode_set(mode="OBJECT")

    return [milliseconds(there_and_back) for _ in range(MODES)][1:]


def rows_of(rig, body):
    """Returns {row: function that returns its times}. rig, body: names."""
    dragging = {f"dragging {what}": lambda bone=bone: drag(rig, bone) for what, bone in DRAGGED.items()}
    return dragging | {
        "the frame after posing": lambda: play_on(rig),
        "a frame, and another add-on's update": with_an_update,
        "a key inserted": lambda: insert_keys(rig),
        "a key moved": lambda: move_keys(rig),
        "Edit Mode and back": lambda: toggle(body, "EDIT"),
        "Weight Paint and back": lambda: toggle(body, "WEIGHT_PAINT"),
        "Ctrl Z of a bone's move": lambda: undo(rig),
    }


def settle():
    """Sets the frame several times, as before an edit: what is built once is there, and no frame is new."""
    for frame in (FRAME - 2, FRAME - 1, FRAME, FRAME - 1, FRAME):
        bpy.context.scene.frame_set(frame)


def measure(characters, rounds=ROUNDS):
    """Returns {row: {way: median of milliseconds}}, and the largest difference of the shapes."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=ADDON)
    accelerating, states, known = (
        importlib.import_module(f"{ADDON}.played.{name}") for name in ("accelerating", "states", "rigs")
    )
    people = make_shot(characters, ("props",))
    meshes = [ob.name for person in people for ob in person.meshes]
    rigs, body = [person.rig.name for person in people], people[0].meshes[0].name
    del people
    bpy.ops.ed.undo_push(message="Shot")
    times = {}
    worst = 0.0

    def objects():
        return [bpy.data.objects[name] for name in meshes]

    def take(way):
        bpy.context.scene.sinew_accelerates_rigs = way == "accelerated"
        settle()
        for row, function in rows_of(rigs[0], body).items():
            if way == "accelerated":
                accelerating.accelerate(bpy.context.scene, bpy.context.view_layer)
            times.setdefault(row, {}).setdefault(way, []).extend(function())
        return shapes(objects())

    for _ in range(rounds):
        with without_handlers():
            wanted = take("modifiers")
        select(*objects())
        assert bpy.ops.object.sinew_bind() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="Bind")
        worst = max(worst, difference(take("live"), wanted), difference(take("accelerated"), wanted))
        states.hand_back(known.known(), bpy.context.scene, bpy.context.view_layer)
        known.forget()
        others = [known.learn(bpy.data.objects[name]) for name in rigs[1:]]
        for frame in range(FRAME - 2, FRAME + 3):
            bpy.context.scene.frame_set(frame)
        states.take_over(others, bpy.context.scene, bpy.context.view_layer)
        worst = max(worst, difference(take("played"), wanted))
        known.forget()
        select(*objects())
        assert bpy.ops.object.sinew_unbind() == {"FINISHED"}
        bpy.ops.ed.undo_push(message="Unbind")
    assert worst < TOLERANCE, f"Sinew's shapes are up to {worst:.3g} of the diagonal off the modifiers'"
    return {row: {way: statistics.median(each) for way, each in ways.items()} for row, ways in times.items()}, worst


def main(options):
    rows, worst = measure(options.characters)
    print(f"\nBlender {bpy.app.version_string}, {options.characters} characters, milliseconds per step, medians\n")
    print(f"| | {' | '.join(WAYS.values())} |")
    print("|" + "---|" * (len(WAYS) + 1))
    for row, found in rows.items():
        modifiers = found["modifiers"]
        cells = [number(modifiers)]
        cells += [f"{number(found[way])} ({found[way] / modifiers:.2f})" for way in WAYS if way != "modifiers"]
        print(f"| {row} | {' | '.join(cells)} |", flush=True)
    print(f"| Shapes of all meshes: off by {worst:.1e} of the diagonal at most |" + " |" * len(WAYS))
    if options.json:
        found = {"blender": bpy.app.version_string, "difference": worst, "rows": rows}
        Path(options.json).write_text(json.dumps(found, indent=1) + "\n")
