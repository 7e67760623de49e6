"""Rigs from production compute the bits that Blender computes: of each .blend file in a folder, which the environment
variable SINEW_PRODUCTION_RIGS names, all armatures whose name begins with RIG. Skipped where there is none."""

import os
from pathlib import Path

import bpy
import numpy as np
import pytest

from helpers import SHARED, addon_module

FOLDER = Path(os.environ.get("SINEW_PRODUCTION_RIGS", SHARED.parent / "production-rigs"))
FILES = sorted(FOLDER.glob("*.blend"))
FRAMES = (1, 4.25, 12, 20.5)
REFUSED = {"RIG-spline_ik": "RIG-spline_ik itself moves (its Scale is animated): move a bone instead"}

pytestmark = pytest.mark.skipif(bpy.app.version < (5, 0, 0), reason="the rigs were saved by Blender 5")


@pytest.mark.skipif(not FILES, reason=f"there are no rigs in {FOLDER}")
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_production_rigs(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    reading, checking = addon_module("description.reading"), addon_module("description.equality")
    names = [ob.name for ob in bpy.data.objects if ob.type == "ARMATURE" and ob.name.startswith("RIG")]
    for name in names:
        ob = bpy.data.objects[name]
        alone_in_its_scene(ob)
        read = reading.read(ob)
        if name in REFUSED:
            assert read.description["refused"][0] == REFUSED[name]
            continue
        program = checking.program_of(read)
        assert checking.differences(program, checking.record_frames(ob, read, FRAMES)) == [], name
        with_keys(ob)
        read = reading.read(ob)
        program = checking.program_of(read)
        assert checking.differences(program, checking.record_frames(ob, read, FRAMES)) == [], name
        recorded = checking.record_random_poses(ob, read, 3)
        assert checking.differences(program, recorded) == [], name


def alone_in_its_scene(ob):
    scene = bpy.data.scenes.new("Rig")
    scene.collection.objects.link(ob)
    bpy.context.window.scene = scene


def with_keys(ob):
    """Replaces the action: each bone that is shown in a shape of its own is moved, turned and scaled."""
    if ob.animation_data:
        ob.animation_data.action = None
    source = np.random.default_rng(1)
    for bone in ob.pose.bones:
        if not bone.custom_shape:
            continue
        for frame in (1, 12, 25):
            bone.location = 0.2 * bone.length * source.uniform(-1, 1, 3)
            bone.scale = source.uniform(0.8, 1.2, 3)
            rotation = "rotation_quaternion" if bone.rotation_mode == "QUATERNION" else "rotation_euler"
            setattr(bone, rotation, source.uniform(-0.5, 0.5, len(getattr(bone, rotation))))
            for channel in ("location", "scale", rotation):
                bone.keyframe_insert(channel, frame=frame)
