"""Evaluates the scene for a bake, and restores everything afterwards."""

import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress

import bpy
import numpy as np

from ..blender import animation, meshes, nodes, values
from ..plan import survey
from ..played import accelerating


def objects_to_bake(context: bpy.types.Context, names: Iterable[str]) -> list[bpy.types.Object]:
    """Returns mesh objects by name; without names, all visible ones with modifiers or shape keys. Raises ValueError."""
    layer = context.view_layer
    layer.update()
    if not names:
        found = [ob for ob in layer.objects if ob.type == "MESH" and ob.visible_get() and _may_change(ob)]
        if not found:
            raise ValueError("no visible mesh has modifiers or shape keys; name the objects to bake")
        return found
    return [_object_named(layer, name) for name in dict.fromkeys(names)]


def refuse_other_shapes(objects: Iterable[bpy.types.Object]) -> None:
    """Raises ValueError if an object has another shape than Sinew would give it, which would be baked."""
    for ob in objects:
        why = survey.lacks_own_shape(ob.original)
        if why:
            raise ValueError(why)


def _may_change(ob):
    return len(ob.modifiers) > 0 or ob.data.shape_keys is not None


def _object_named(layer, name):
    ob = layer.objects.get(name)
    if ob is None:
        there = ", ".join(each.name for each in layer.objects if each.type == "MESH") or "none"
        raise ValueError(f"there is no object {name} in the view layer {layer.name}; its meshes are {there}")
    if ob.type != "MESH":
        raise ValueError(f"{name} is not a mesh")
    if not ob.visible_get():
        raise ValueError(f"{name} is hidden in the viewport, so Blender does not evaluate it: show it first")
    return ob


def digest_of_file() -> str:
    """Returns a digest of the .blend as it was saved; "" if the open file differs from it."""
    path = bpy.data.filepath
    if not os.path.isfile(path) or bpy.data.is_dirty and not bpy.app.background:
        return ""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()[:32]


def read(ob: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> tuple[np.ndarray, np.ndarray]:
    """Returns the evaluated positions (V, 3) float32, in object space, and matrix_world (4, 4) float64."""
    evaluated = ob.evaluated_get(depsgraph)
    return meshes.read_evaluated(evaluated), values.matrix_to_numpy(evaluated.matrix_world)


def read_topology(ob: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> tuple[tuple[np.ndarray, np.ndarray], int]:
    """Returns (face_offsets (faces + 1,), face_vertices) and V of the evaluated mesh."""
    evaluated = ob.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        return meshes.read_faces(mesh)[:2], len(mesh.vertices)
    finally:
        evaluated.to_mesh_clear()


def check_count(ob: bpy.types.Object, frame: int, count: int, expected: int) -> None:
    """Raises ValueError if a frame has a different number of vertices from those before it."""
    if count != expected:
        raise ValueError(
            f"{ob.name} has {count:,} vertices on frame {frame}, but {expected:,} before: a bake needs the same "
            "vertices on all frames. Switch off the modifier that changes them, or bake other frames"
        )


@contextmanager
def undisturbed(context: bpy.types.Context) -> Iterator[None]:
    """Leaves Edit or Sculpt Mode, whose meshes differ from those that play, and accelerates rigs, inside the `with`
    block; restores mode and frame."""
    scene, ob = context.scene, context.view_layer.objects.active
    frame = scene.frame_current, scene.frame_subframe
    mode = ob.mode if ob is not None and (ob.mode.startswith("EDIT") or ob.mode == "SCULPT") else None
    if mode:
        _set_mode(context, ob, "OBJECT")
    try:
        accelerating.accelerate(scene, context.view_layer)
        yield
    finally:
        scene.frame_set(frame[0], subframe=frame[1])
        if mode:
            with suppress(ReferenceError):
                _set_mode(context, ob, mode)


def _set_mode(context, ob, mode):
    with context.temp_override(active_object=ob, object=ob):
        bpy.ops.object.mode_set(mode=mode)


def subdivision_of(ob: bpy.types.Object) -> bpy.types.Modifier | None:
    """Returns the first Subdivision Surface modifier that the viewport shows, or None."""
    return next((modifier for modifier in ob.modifiers if modifier.type == "SUBSURF" and modifier.show_viewport), None)


@contextmanager
def until_subdivision(objects: Iterable[bpy.types.Object]) -> Iterator[None]:
    """Switches off the objects' first Subdivision Surface modifier and all that follow it, in the viewport, inside the
    `with` block. Raises ValueError if a switch is animated."""
    off = []
    for ob in objects:
        first = subdivision_of(ob)
        tail = list(ob.modifiers)[ob.modifiers.find(first.name) :] if first else []
        off += [modifier for modifier in tail if modifier.show_viewport and not nodes.is_sinew(modifier)]
    with switched_off(off):
        yield


@contextmanager
def switched_off(off: Sequence[bpy.types.Modifier]) -> Iterator[None]:
    """Switches modifiers off in the viewport, where all are on, inside the `with` block. Raises ValueError if a switch
    is animated."""
    for modifier in off:
        if "show_viewport" in animation.animated_properties(modifier.id_data, modifier):
            raise ValueError(
                f"{modifier.name} of {modifier.id_data.name} is switched by drivers or keyframes, so Sinew cannot "
                "switch it off: bake without Until Subdivision"
            )
    try:
        for modifier in off:
            modifier.show_viewport = False
        yield
    finally:
        for modifier in off:
            modifier.show_viewport = True
