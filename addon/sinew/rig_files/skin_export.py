"""The skin of a mesh for the poses of a rig that is computed without Blender."""

from typing import Any

import numpy as np

from ..blender import armatures, meshes, values
from ..deform.clips import transformed
from ..deform.influences import Bones, Rules, influences
from ..plan import bindable


def mesh_to_export(context: Any, armature: Any, name: str | None) -> Any:
    """Returns the mesh object of that name, or without a name the only one that the armature deforms. Raises
    ValueError."""
    deformed = bindable.meshes_of(context, armature)
    names = ", ".join(ob.name for ob in deformed) or "none"
    found = [ob for ob in deformed if name in (None, ob.name)]
    if not found:
        raise ValueError(f"there is no mesh {name} that {armature.name} deforms; those that it deforms: {names}")
    if len(found) > 1:
        raise ValueError(f"choose a mesh with --mesh NAME; those that {armature.name} deforms: {names}")
    return found[0]


def skin_of(context: Any, ob: Any, armature: Any) -> dict[str, Any]:
    """Returns the arguments of sinew_native.Skin for a mesh at rest, without shape keys, in armature space. Its joints
    are those of RigProgram.joint_begin. Masks and other modifiers are left out."""
    modifier = bindable.armature_modifier(ob, armature)
    rules = Rules(modifier.use_vertex_groups, modifier.use_bone_envelopes) if modifier else Rules()
    evaluated = armature.evaluated_get(context.evaluated_depsgraph_get())
    bones = Bones(**armatures.read_bones(evaluated))
    rest = transformed(values.relative_matrix(armature, ob), meshes.read_positions(ob.data).astype(np.float64))
    index = {name: number for number, name in enumerate(bones.names)}
    own = influences(
        *meshes.read_object_weights(ob),
        np.array([index.get(group.name, -1) for group in ob.vertex_groups], np.int32),
        bones,
        rules,
        lambda: rest,
        lambda bone, point: armatures.segment_at(evaluated, bone, point),
    )
    # A deformer has no joints for bones that do not deform; a program has.
    counts = np.where(bones.segments > 1, bones.segments + 1, 1)
    joints = np.flatnonzero(np.repeat(bones.deform, counts))
    return {
        "rest_positions": rest.astype(np.float32),
        "offsets": own.offsets,
        "joints": joints[own.joints].astype(np.int32),
        "weights": own.weights,
        "joint_count": int(counts.sum()),
    }
