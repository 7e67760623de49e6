"""Plays a cache with Blender's Mesh Cache modifier instead of the baked modifiers, and removes it again."""

import json
import os

import bpy

from ..blender import animation, modifier_types, nodes
from . import evaluation, part_files, point_cache, systems
from . import subject as subjects

NAME = "Sinew Cache"
SWITCHES = ("show_viewport", "show_render")


def is_on(ob: bpy.types.Object) -> bool:
    return bool(ob.sinew.cache_kept)


def set_up(context: bpy.types.Context, ob: bpy.types.Object, path: str) -> None:
    """Makes a mesh object play the cache at path, PC2 or MDD, instead of its deforming modifiers, which are switched
    off. Raises ValueError, with nothing changed, or OSError."""
    if ob.library:
        raise ValueError(f"{ob.name} is linked from another file: make a library override of it first")
    if is_on(ob):
        raise ValueError(f"{ob.name} already plays a cache: detach that first")
    vertex_count, first, step, until_subdivision = _read(path, context.scene)
    end = evaluation.subdivision_of(ob) if until_subdivision else None
    place = ob.modifiers.find(end.name) if end else len(ob.modifiers)
    off = [
        modifier
        for modifier in list(ob.modifiers)[:place]
        if modifier.type in modifier_types.MOVING_VERTICES and (modifier.show_viewport or modifier.show_render)
    ]
    for modifier in off:
        if set(SWITCHES).intersection(animation.animated_properties(ob, modifier)):
            raise ValueError(f"{modifier.name} of {ob.name} is switched by drivers or keyframes: remove them first")
    active = ob.modifiers.active
    cache = ob.modifiers.new(NAME, "MESH_CACHE")
    ob.sinew.cache_kept = json.dumps(
        {
            "modifier": cache.name,
            "active": active.name if active else "",
            "switches": [(modifier.name, modifier.show_viewport, modifier.show_render) for modifier in off],
        }
    )
    try:
        nodes.move_modifier(ob, cache, place)
        _configure(cache, path, first, step)
        for modifier in off:
            modifier.show_viewport = modifier.show_render = False
        count = _count_at(context, ob, until_subdivision)
        if count != vertex_count:
            raise ValueError(
                f"{os.path.basename(path)} has {vertex_count:,} vertices, and {ob.name} has {count:,}: it is the cache "
                "of another mesh, or was baked with other modifiers"
            )
    except ValueError:
        take_off(ob)
        raise


def _read(path, scene):
    """Returns V, first frame, step, and whether the bake ended before Subdivision: from the file beside the cache, or
    else from the cache itself."""
    if part_files.is_unfinished(path):
        raise ValueError(f"{path} is not finished: bake the missing frames first")
    if not os.path.isfile(systems.native(path)):
        raise ValueError(f"there is no file {path}")
    if os.path.exists(systems.native(subjects.path_beside(path))):
        subject = subjects.of_cache(path)
        return subject.vertex_count, subject.frames.first, subject.frames.step, subject.until_subdivision
    vertices, first, step = point_cache.read_header(path)
    return vertices, scene.frame_start if first is None else first, step, False


def _configure(cache, path, first, step):
    """Configures the modifier to play by frames: by time, Blender plays PC2 files too slowly."""
    cache.cache_format = path.rpartition(".")[2].upper()
    use_relative = bpy.data.filepath and bpy.context.preferences.filepaths.use_relative_paths
    cache.filepath = bpy.path.relpath(path) if use_relative else path
    cache.play_mode, cache.time_mode = "SCENE", "FRAME"
    cache.frame_scale, cache.frame_start = 1 / step, first / step
    cache.deform_mode, cache.interpolation = "OVERWRITE", "LINEAR"
    cache.forward_axis, cache.up_axis = "POS_Y", "POS_Z"
    cache.show_in_editmode = False


def _count_at(context, ob, until_subdivision):
    """Returns the number of vertices at the cache's place in the modifier stack."""
    if not until_subdivision:
        return len(evaluation.read(ob, context.evaluated_depsgraph_get())[0])
    with evaluation.until_subdivision([ob]):
        return len(evaluation.read(ob, context.evaluated_depsgraph_get())[0])


def take_off(ob: bpy.types.Object) -> list[str]:
    """Restores the state before `set_up`. Returns the names of modifiers that were switched off and no longer exist."""
    kept = json.loads(ob.sinew.cache_kept)
    modifiers = ob.modifiers
    cache = modifiers.get(kept["modifier"])
    if cache is not None and cache.type == "MESH_CACHE":
        modifiers.remove(cache)
    for name, viewport, render in kept["switches"]:
        if name in modifiers:
            modifiers[name].show_viewport, modifiers[name].show_render = viewport, render
    if kept["active"] in modifiers:
        modifiers.active = modifiers[kept["active"]]
    ob.sinew.property_unset("cache_kept")
    return [name for name, *_ in kept["switches"] if name not in modifiers]
