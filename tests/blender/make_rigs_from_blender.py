"""Writes tests/python/rigs_from_blender_VERSION.json.gz: small random rigs and the poses that Blender computed, for
tests without Blender. They have all types of constraints between them, and B-bones of all shapes.

    blender -b --python-exit-code 1 --python tests/blender/make_rigs_from_blender.py

Made with Blender 5.2 of Debian unstable, and with the official 4.2, which runs with Debian 12's C library.
"""

import gzip
import json
import re
import sys
from pathlib import Path
from random import Random

import bpy
import numpy as np

sys.path.append(str(Path(__file__).parent))
sys.path.append(str(Path(__file__).parents[1] / "python"))
import c_library
import edge_rigs
import random_rigs
import random_strips
from helpers import addon_module
from test_follow_path import follow, key_time, train
from test_spline_ik import tentacle

SEEDS = (44, 6, 1)
STRIPS = 9
BONES = 12  # those after them are left out; nothing before looks at them
TIMES = (1, 4.25, 20.5, -7)
FILE = Path(c_library.__file__).parent / f"rigs_from_blender_{bpy.app.version[0]}_{bpy.app.version[1]}.json.gz"


def shortened(description):
    """The description without the last bones and what belongs to them."""
    kept = {random_rigs.name_of(number) for number in range(BONES)}

    def is_kept(path):
        bone = re.match(r'(?:pose|data)\.bones\["(.*?)"\]', path)
        return bone is None or bone[1] in kept

    bones = [bone for bone in description["bones"] if bone["name"] in kept]
    for bone in bones:
        if bone.get("connected_child") not in kept:
            bone["connected_child"] = None
    return {
        **description,
        "bones": bones,
        "constraints": [row for row in description["constraints"] if row["bone"] in kept],
        **{
            name: [row for row in description[name] if is_kept(row["path"])]
            for name in ("properties", "curves", "drivers")
        },
    }


def rounded(found):
    """Shorter numbers that are the same as float32."""
    if isinstance(found, float):
        return float(f"{found:.9g}")
    if isinstance(found, dict):
        return {key: rounded(value) for key, value in found.items()}
    return [rounded(each) for each in found] if isinstance(found, list | tuple) else found


def random_rig(seed):
    return random_rigs.make(seed, [feature for feature in random_rigs.features_of(seed) if feature.bone < BONES])


def made(ob, shortened):
    read = addon_module("description.reading").read(ob)
    recorded = addon_module("description.equality").record_frames(ob, read, TIMES)
    description = shortened(json.loads(json.dumps(read.description, default=np.ndarray.tolist)))
    rows = [ob.pose.bones.find(bone["name"]) for bone in description["bones"]]
    return {
        "description": description,
        "frames": TIMES,
        "inputs": {name: values.tolist() for name, values in recorded.given().items()},
        "poses": [poses[rows].tolist() for poses in recorded.poses],
    }


def with_strips():
    """A rig that has strips of all kinds."""
    ob, random = new_armature(), Random(STRIPS)
    ob["part"] = 0.5
    ob.id_properties_ui("part").update(min=-2, max=2, default=0.25)
    random_strips.animate(ob, random)
    kinds = {each.type for strip in random_strips.strips_of(ob) for each in (strip, *strip.strips)}
    assert kinds == {"CLIP", "TRANSITION", "META"}, "choose another seed"
    return ob


def on_a_path():
    """A chain of bones, one of which follows a curve in time."""
    bpy.ops.wm.read_homefile(use_empty=True)
    armature, curve = train("written")
    key_time(curve)
    follow(armature, "Chain1", curve, use_curve_follow=True, forward_axis="FORWARD_Y", up_axis="UP_Z")
    return armature


def new_armature():
    """Returns an armature of two bones in a file of its own."""
    bpy.ops.wm.read_homefile(use_empty=True)
    ob = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    bpy.context.collection.objects.link(ob)
    bpy.context.view_layer.objects.active = ob
    bpy.ops.object.mode_set(mode="EDIT")
    for number, name in enumerate("ab"):
        bone = ob.data.edit_bones.new(name)
        bone.head, bone.tail, bone.parent = (0, 0, number), (0, 0.1, number + 1), ob.data.edit_bones.get("a")
    bpy.ops.object.mode_set(mode="OBJECT")
    return ob


rigs = [made(random_rig(seed), shortened) for seed in SEEDS]
rigs.append(made(tentacle("written", count=3, xz_scale_mode="VOLUME_PRESERVE")[0], lambda description: description))
rigs.append(made(on_a_path(), lambda description: description))
rigs.append(made(with_strips(), lambda description: description))
for edge in (edge_rigs.bent, edge_rigs.bent_and_mapped_along_its_curve):
    rigs.append(made(edge_rigs.made(edge), lambda description: description))
document = {"c_library": c_library.fingerprint(), "rigs": rounded(rigs)}
text = json.dumps(document, separators=(",", ":"))
FILE.write_bytes(gzip.compress(text.encode(), 9, mtime=0))
print(f"{bpy.app.version_string}: wrote {FILE}")
