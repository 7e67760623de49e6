"""Has Blender evaluate objects on other frames, in a scene of their own, so that nothing that is shown changes.

Blender writes the values of the frames that it evaluates into the originals. So that is done only while these have what
their keyframes say, and it ends on the frame that is shown."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from ..blender import dependencies
from . import computing, rigs

NAME = ".Sinew Frames"
_COPIED = ("use_simplify", "simplify_subdivision", "frame_map_old", "frame_map_new")  # of the settings of renders


def animated(objects: Iterable[Any], scene: bpy.types.Scene) -> list[Any] | None:
    """Returns the data-blocks with keyframes on which original objects depend; None if any of them has been edited
    without a key, or the scene is between two frames."""
    found = _animated(objects)
    return None if scene.frame_subframe or _edited(found, scene) else found


def edited(objects: Iterable[Any], scene: bpy.types.Scene) -> str:
    """Returns the name of a data-block on which original objects depend that has been edited without a key; "" if there
    is none."""
    return _edited(_animated(objects), scene)


def _animated(objects: Iterable[Any]) -> list[Any]:
    users = dependencies.Users.now()
    for block in users:  # what a library override was made from is not evaluated because of it
        if block.override_library is not None:
            users.get(block.override_library.reference, set()).discard(block)
    return [each for each in dependencies.used(objects, users) if rigs.has_animation(each)]


def _edited(found: Iterable[Any], scene: bpy.types.Scene) -> str:
    time = scene.frame_current_final
    return next((each.name for each in found if computing.may_be_unkeyed(each, time)), "")


@contextmanager
def on_frames(objects: Iterable[bpy.types.Object], scene: bpy.types.Scene) -> Iterator[Callable[[int], Any]]:
    """Gives a function that has Blender evaluate original objects on a frame, with the settings of a scene, and returns
    the dependency graph. Nobody's handlers see that. Call it in the main thread, outside an evaluation; relations of
    other graphs have to be built again."""
    own = bpy.data.scenes.new(NAME)
    layer = own.view_layers[0]

    def evaluated_on(frame: int) -> Any:
        own.frame_current = frame
        layer.update()
        return layer.depsgraph

    lists = bpy.app.handlers.depsgraph_update_pre, bpy.app.handlers.depsgraph_update_post
    before = [list(each) for each in lists]
    try:
        for each in lists:
            each.clear()
        for name in _COPIED:
            setattr(own.render, name, getattr(scene.render, name))
        for ob in objects:
            own.collection.objects.link(ob)
        evaluated_on(scene.frame_current)  # which builds relations
        yield evaluated_on
    finally:
        try:
            evaluated_on(scene.frame_current)
        finally:
            for each, handlers in zip(lists, before):
                each[:] = handlers
            bpy.data.scenes.remove(own)
