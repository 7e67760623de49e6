"""Bakes meshes of the open scene to bones, step by step."""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import bpy
import numpy as np

from ..bake import evaluation
from ..bake.frame_range import FrameRange
from ..blender import bounds, values
from ..feedback import long_work
from ..native import sinew_native
from ..plan import bindable
from ..weights import background
from . import joints as joint_motions
from . import sampling, writing
from .bake_options import FoundOptions
from .joints import Joints
from .report import Report

SAMPLING = 0.5  # the share of sampling in the progress
FOUND = "finding weights"
LARGEST_SHEAR = 1e-4  # the cosine between two axes of an object


@dataclass(frozen=True)
class Settings(FoundOptions):
    """What is baked, and how closely. bones 0: the deforming bones of the meshes' own armature."""

    frames: FrameRange = field(kw_only=True)


def run(context: Any, objects: Sequence[bpy.types.Object], settings: Settings) -> Report:
    """Bakes at once. Returns the Report. Raises ValueError, and then nothing has changed."""
    return long_work.finish(steps(context, objects, settings, in_thread=False))


def steps(
    context: Any, objects: Sequence[bpy.types.Object], settings: Settings, in_thread: bool = True
) -> Generator[tuple[float, str], None, Report]:
    """Bakes step by step, in Object Mode: a generator of (share done, what comes next) that returns a Report. Closing
    it early is safe: all that is written is written in the last step. The frame is restored. Raises ValueError.

    in_thread: whether the computation runs in a thread of its own, so that steps stay short.
    """
    start = perf_counter()
    rig = None if settings.bones else common_rig(objects)
    for ob in objects:
        _refuse(ob)
    if not objects:
        raise ValueError("no mesh is selected: select those to bake")
    evaluation.refuse_other_shapes(objects)
    with evaluation.undisturbed(context):
        sampler = sampling.sample(context, objects, rig, settings.frames)
        clip = yield from long_work.scaled(sampler, 0.0, SAMPLING)
        joints = clip.joints
        known: dict[str, Any] = {"bones": settings.bones}
        if joints is not None:  # weights are made for what an armature can play
            _keys, played = joint_motions.keys_of(joints, clip.motions, list(settings.frames))
            known = {"matrices": played, "heads": joints.rest[:, :3, 3]}

        def work(progress=None):
            return sinew_native.decompose(
                clip.rest,
                clip.frames,
                clip.face_offsets,
                clip.face_vertices,
                **known,
                max_influences=settings.max_influences,
                iterations=settings.iterations,
                tolerance=settings.tolerance,
                progress=progress,
            )

        found = (yield from long_work.scaled(background.steps(work, FOUND), SAMPLING, 1.0)) if in_thread else work()
        if joints is None:
            joints = new_joints(found, clip.rest)
        armature, made = writing.write(context, objects, clip, joints, found, settings.frames)
    return Report(
        armature=armature.name,
        objects=tuple(ob.name for ob in made),
        sources=tuple(ob.name for ob in objects),
        vertices=len(clip.rest),
        bones=len(joints.names),
        frames=str(settings.frames),
        frame_count=len(settings.frames),
        mean=found.mean,
        rms=found.rms,
        largest=found.largest,
        iterations=found.iterations,
        seconds=perf_counter() - start,
    )


def common_rig(objects: Sequence[bpy.types.Object]) -> bpy.types.Object:
    """Returns the armature of all the meshes. Raises ValueError if they have none, several, or one without deforming
    bones."""
    rigs = {bindable.find_armature(ob): ob for ob in objects}
    for rig, ob in rigs.items():
        if rig is None:
            raise ValueError(f"{ob.name} has no armature whose bones could be used: choose new bones")
    if len(rigs) > 1:
        names = ", ".join(sorted(rig.name for rig in rigs))
        raise ValueError(
            f"the meshes have different armatures ({names}): bake those of one at a time, or choose new bones"
        )
    rig = next(iter(rigs), None)
    if rig is not None and not len(sampling.deforming(rig)):
        raise ValueError(
            f"{rig.name} has no deforming bone: tick Deform in the properties of at least one, or choose new bones"
        )
    if rig is not None and _is_sheared(rig):
        raise ValueError(
            f"{rig.name} is below an object that is scaled unevenly and turned, so its bones shear in the world: apply "
            "that object's scale, or choose The Rig's Bones, Exact"
        )
    return rig


def _is_sheared(rig):
    axes = values.matrix_to_numpy(rig.matrix_world)[:3, :3]
    lengths = np.linalg.norm(axes, axis=0)
    if not lengths.all():
        return False  # which is another error
    cosines = (axes / lengths).T @ (axes / lengths) - np.eye(3)
    return bool(np.abs(cosines).max() > LARGEST_SHEAR)


def _refuse(ob):
    if ob.type != "MESH":
        raise ValueError(f"{ob.name} is not a mesh")
    if ob.data.is_editmode:
        raise ValueError(f"{ob.name} is in Edit Mode; leave it first")
    if not ob.visible_get():
        raise ValueError(f"{ob.name} is hidden in the viewport, so Blender does not evaluate it: show it first")


def new_joints(found: Any, rest: np.ndarray) -> Joints:
    """Returns Joints for those that were found: without parents, each as long as half of what it moves is wide.
    found: a sinew_native.Decomposition of positions rest (V, 3)."""
    count = found.joint_count
    vertex = np.repeat(np.arange(len(rest)), np.diff(found.offsets))
    off = ((rest[vertex] - found.rest[found.joints, :3, 3]) ** 2).sum(axis=1)
    total = np.bincount(found.joints, found.weights, minlength=count)
    squares = np.bincount(found.joints, found.weights * off, minlength=count)
    lengths = np.sqrt(squares / np.maximum(total, 1e-12))
    size = bounds.diagonal(rest)
    digits = len(str(count - 1))
    return Joints(
        tuple(f"bone_{j:0{digits}}" for j in range(count)),
        np.full(count, -1),
        np.array(found.rest),
        np.maximum(lengths, max(0.01 * size, sampling.SHORTEST_BONE)),
    )
