"""Gives an armature random actions and NLA strips that play them, for comparing what programs mix with Blender: all
blend types, extrapolations, transitions, meta strips, animated influences and times, and an active action above
them."""

import contextlib
from collections.abc import Iterator
from typing import Any

import bpy

import random_modifiers
from helpers import addon_module

BLENDS = "REPLACE", "REPLACE", "COMBINE", "ADD", "SUBTRACT", "MULTIPLY"
HOLDS = "HOLD", "HOLD_FORWARD", "NOTHING"
CHANNELS = "location", "rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale"
CHANNELS += "bbone_curveinx", "bbone_scalein"


def animate(ob: Any, random: Any, may_group: bool = True) -> None:
    """may_group: adds transitions and meta strips, for which Blender needs an NLA editor."""
    actions = [_action(ob, random, number) for number in range(random.randint(1, 3))]
    data = ob.animation_data
    if random.random() < 0.5:
        data.action = None
    data.action_influence = random.choice((1, 1, 0.6, 0))
    has_modifiers = any(len(each.modifiers) for each in addon_module("blender.animation").slot_curves(ob))
    data.action_blend_type = random.choice(BLENDS)
    data.action_extrapolation = "HOLD" if has_modifiers else random.choice(HOLDS)
    for _ in range(random.randint(1, 3)):
        _track(data, random, actions)
    if may_group and random.random() < 0.6:
        _group(ob, random)


def _action(ob: Any, random: Any, number: int) -> tuple[Any, Any]:
    data = ob.animation_data_create()
    data.action = bpy.data.actions.new(f"Action {number}")
    constraints = [each for bone in ob.pose.bones for each in bone.constraints]
    for frame in sorted(random.sample(range(-5, 40), random.randint(1, 5))):
        for bone in ob.pose.bones:
            for name in CHANNELS:
                if random.random() < 0.6:
                    _key_channel(bone, name, frame, random)
        for holder in (ob, *ob.pose.bones):
            for name in holder.keys():
                if isinstance(holder[name], int | float) and random.random() < 0.6:
                    kind = type(holder[name])
                    holder[name] = random.uniform(-2, 2) if kind is float else kind(random.randint(-4, 4))
                    holder.keyframe_insert(f'["{name}"]', frame=frame)
        for each in constraints:
            each.influence, each.mute = random.random(), random.random() < 0.3
            for name in ("influence", "mute"):
                if random.random() < 0.6:
                    each.keyframe_insert(name, frame=frame)
    for curve in addon_module("blender.animation").slot_curves(ob):
        if random.random() < 0.2 and "scale" not in curve.data_path:  # of which negative ones have no power
            random_modifiers.modify(curve, random)
    return data.action, getattr(data, "action_slot", None)


def _key_channel(bone: Any, name: str, frame: float, random: Any) -> None:
    value = getattr(bone, name)
    count = len(value) if hasattr(value, "__len__") else 1
    low, high = (0.3, 1.5) if "scale" in name else (-1, 1)
    numbers = [random.uniform(low, high) for _ in range(count)]
    setattr(bone, name, numbers if count > 1 else numbers[0])
    only = {"index": random.randrange(count)} if count > 1 and random.random() < 0.3 else {}
    bone.keyframe_insert(name, frame=frame, **only)


def _track(data: Any, random: Any, actions: list[tuple[Any, Any]]) -> None:
    track, begin = data.nla_tracks.new(), random.randint(-10, 5)
    for number in range(random.randint(1, 3)):
        action, slot = random.choice(actions)
        strip = track.strips.new(f"Strip {number}", begin, action)
        if slot is not None:
            strip.action_slot = slot
        strip.scale, strip.repeat = random.choice((1, 1, 0.5, 1.7)), random.choice((1, 1, 2, 1.5))
        strip.use_reverse, strip.mute = random.random() < 0.2, random.random() < 0.1
        strip.blend_type, strip.extrapolation = random.choice(BLENDS), random.choice(HOLDS)
        for name in ("blend_in", "blend_out"):
            if random.random() < 0.4:
                setattr(strip, name, random.uniform(0, 8))
        for name, low, high in (("influence", 0, 1), ("strip_time", -5, 50)):
            if random.random() < 0.2:
                setattr(strip, f"use_animated_{'time' if name == 'strip_time' else name}", True)
                for frame in (0, 10, 25):
                    setattr(strip, name, random.uniform(low, high))
                    strip.keyframe_insert(name, frame=frame)
        strip.use_animated_time_cyclic = random.random() < 0.5
        begin = int(strip.frame_end) + random.randint(1, 12)
    track.mute, track.is_solo = random.random() < 0.1, random.random() < 0.05


def _group(ob: Any, random: Any) -> None:
    with in_nla_editor(ob), contextlib.suppress(RuntimeError):  # if no strips have a gap between them
        bpy.ops.nla.transition_add()
        if random.random() < 0.5:
            bpy.ops.nla.meta_add()
    for strip in strips_of(ob):
        if strip.type == "TRANSITION":
            strip.use_reverse = random.random() < 0.3


@contextlib.contextmanager
def in_nla_editor(ob: Any) -> Iterator[None]:
    """All strips of the object are selected, for operators."""
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    before, area.type = area.type, "NLA_EDITOR"
    bpy.context.view_layer.objects.active = ob
    ob.select_set(True)
    for each in (*ob.animation_data.nla_tracks, *strips_of(ob)):
        each.select = True
    region = next(each for each in area.regions if each.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        yield
    area.type = before


def strips_of(ob: Any) -> list[Any]:
    return [strip for track in ob.animation_data.nla_tracks for strip in track.strips]
