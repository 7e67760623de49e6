"""Compares a rig's program with Blender, with == on every number."""

import math
import random
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from ..native import sinew_native
from . import custom_properties, reading

_ROTATIONS = {"QUATERNION": "rotation_quaternion", "AXIS_ANGLE": "rotation_axis_angle"}


@dataclass
class Recording:
    """What Blender computed, and with which inputs."""

    times: list[float] = field(default_factory=list)
    poses: list[np.ndarray] = field(default_factory=list)  # B x 4 x 4 each
    segments: list[np.ndarray] = field(default_factory=list)  # S x 4 x 4 each
    inputs: list[dict[str, Any]] = field(default_factory=list)

    def add(self, ob: bpy.types.Object, read: reading.Reading, inputs: dict[str, Any]) -> None:
        """Records the present evaluation. inputs: what the program is given besides what comes from outside."""
        depsgraph = bpy.context.evaluated_depsgraph_get()
        bones = ob.evaluated_get(depsgraph).pose.bones
        self.times.append(bpy.context.scene.frame_current_final)
        self.poses.append(matrices_of(bones))
        self.segments.append(segments_of(bones))
        self.inputs.append({**read.targets.matrices(depsgraph), **read.outside.values(depsgraph), **inputs})

    def given(self) -> dict[str, np.ndarray]:
        """Returns the inputs of all frames by name."""
        names = self.inputs[0] if self.inputs else ()
        return {name: np.array([frame[name] for frame in self.inputs], np.float32) for name in names}


@dataclass(frozen=True)
class Difference:
    """The bones of a frame that differ."""

    time: float
    bones: list[str]
    largest: float  # between two numbers

    def __str__(self) -> str:
        names = ", ".join(self.bones[:3]) + (f" and {len(self.bones) - 3} more" if len(self.bones) > 3 else "")
        return f"frame {self.time:g}: {names} differ by up to {self.largest:.3g}"


def matrices_of(bones: Any) -> np.ndarray:
    """Returns the poses of bones: B x 4 x 4, float32."""
    numbers = np.empty(16 * len(bones), np.float32)
    bones.foreach_get("matrix", numbers)
    return numbers.reshape(-1, 4, 4).swapaxes(1, 2)


def segments_of(bones: Any) -> np.ndarray:
    """Returns the ends of the B-bones' segments: S x 4 x 4, float32."""
    found = [
        bone.bbone_segment_matrix(end)
        for bone in bones
        if bone.bone.bbone_segments > 1
        for end in range(bone.bone.bbone_segments + 1)
    ]
    return np.array(found, np.float32).reshape(-1, 4, 4)


def program_of(read: reading.Reading) -> Any:
    """Builds the program. Raises ValueError with the reasons why the rig cannot be one."""
    return sinew_native.RigProgram(read.description, keep_description=False)


def record_frames(ob: bpy.types.Object, read: reading.Reading, times: Iterable[float]) -> Recording:
    """Plays frames, which may be fractions."""
    recording = Recording()
    for time in times:
        whole = math.floor(time)
        bpy.context.scene.frame_set(whole, subframe=time - whole)
        recording.add(ob, read, {})
    return recording


def record_random_poses(ob: bpy.types.Object, read: reading.Reading, count: int, seed: int = 0) -> Recording:
    """Gives all bones and custom properties random values in the present frame. They stay changed."""
    recording, source = Recording(), random.Random(seed)
    for _ in range(count):
        inputs = dict(randomise(ob, read, source))
        bpy.context.view_layer.update()
        recording.add(ob, read, inputs)
    return recording


def channels_of(bone: bpy.types.PoseBone) -> tuple[str, str, str]:
    """Returns the names of the channels that move a bone."""
    return "location", _ROTATIONS.get(bone.rotation_mode, "rotation_euler"), "scale"


def randomise(
    ob: bpy.types.Object, read: reading.Reading, source: random.Random
) -> Iterator[tuple[str, float | list[float]]]:
    """Yields paths and values of what was set. Driven values are set too: drivers replace them."""
    for bone in ob.pose.bones:
        for name in channels_of(bone):
            width = len(getattr(bone, name))
            if name == "scale":
                values = [source.uniform(0.7, 1.3) for _ in range(width)]
            elif name == "location":
                values = [source.uniform(-0.3, 0.3) * bone.length for _ in range(width)]
            else:
                values = [source.uniform(-1, 1) for _ in range(width)]
            # Not element by element: writing into an Euler would also set the mode of rotation.
            setattr(bone, name, values)
            yield f'pose.bones["{bpy.utils.escape_identifier(bone.name)}"].{name}', list(getattr(bone, name))
    for row in read.description["properties"]:
        path = row["path"]
        is_own = path.endswith('"]') and not path.startswith("data.")
        if is_own and len(row["value"]) == 1 and row["type"] != "BOOLEAN":
            low, high = max(row["min"], -2), min(row["max"], 2)
            value = source.uniform(low, high) if row["type"] == "FLOAT" else source.randint(int(low), int(high))
            holder, name = custom_properties.owner_and_name(path)
            holder = ob.path_resolve(holder) if holder else ob
            holder[name] = value
            yield path, value
    ob.update_tag(refresh={"OBJECT", "DATA"})


def differences(program: Any, recording: Recording) -> list[Difference]:
    """Returns the frames in which the program computes other numbers than Blender."""
    if not recording.times:
        return []
    times, given = np.array(recording.times, np.float32), recording.given()
    poses = program.evaluate(times, given)
    segments = program.segments(times, given)
    owners = np.repeat(np.arange(len(program.names)), np.diff(program.segment_begin))
    found = []
    for frame, time in enumerate(recording.times):
        far = distances(poses[frame], recording.poses[frame])
        np.maximum.at(far, owners, distances(segments[frame], recording.segments[frame]))
        if far.any():
            found.append(Difference(time, [program.names[bone] for bone in np.flatnonzero(far)], float(far.max())))
    return found


def distances(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Returns the largest difference between the numbers of each pair of matrices. NaN equals NaN, and infinity
    itself."""
    with np.errstate(invalid="ignore"):
        far = np.abs(a - b)
    far[(a == b) | (np.isnan(a) & np.isnan(b))] = 0
    return np.nan_to_num(far, nan=np.inf).max(axis=(1, 2), initial=0)
