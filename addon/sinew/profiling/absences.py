"""Takes things out of a scene to measure what they cost: context managers that restore everything."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import bpy

from ..blender import animation
from ..install import bind
from ..plan import bindable
from ..run import characters


@contextmanager
def scene_of(objects: Sequence[bpy.types.Object]) -> Iterator[bpy.types.Scene]:
    """Yields a scene with only these objects and what they depend on. Nothing is hidden in the file's own scenes:
    hiding would deselect objects and make simulations lose their frames."""
    scene = bpy.data.scenes.new("Sinew Profile")
    hidden = [ob for ob in objects if ob.hide_viewport]
    try:
        for ob in hidden:
            ob.hide_viewport = False
        for ob in objects:
            scene.collection.objects.link(ob)
        yield scene
    finally:
        for ob in hidden:
            ob.hide_viewport = True
        bpy.data.scenes.remove(scene)


@contextmanager
def still(curves: Sequence[Any]) -> Iterator[None]:
    """Mutes the curves (of keyframes, or drivers; all of them unmuted before) inside the `with` block."""
    try:
        for curve in curves:
            curve.mute = True
        yield
    finally:
        for curve in curves:
            curve.mute = False


@contextmanager
def switched_off(modifiers: Sequence[bpy.types.Modifier]) -> Iterator[None]:
    try:
        for modifier in modifiers:
            modifier.show_viewport = False
        yield
    finally:
        for modifier in modifiers:
            modifier.show_viewport = True


@contextmanager
def muted(keys: bpy.types.Key) -> Iterator[None]:
    before = [block.mute for block in keys.key_blocks]
    try:
        for block in keys.key_blocks:
            block.mute = True
        yield
    finally:
        for block, was_muted in zip(keys.key_blocks, before):
            block.mute = was_muted


@contextmanager
def bound_for_now(ob: bpy.types.Object) -> Iterator[Any]:
    """Binds a mesh inside the `with` block, and yields its runtime entry. Raises BindingError."""
    settings = ob.sinew
    kept = {
        name: getattr(settings, name) if settings.is_property_set(name) else None
        for name, setting in settings.bl_rna.properties.items()
        if not setting.is_readonly
    }
    active = ob.modifiers.active
    active = active and active.name
    bind.bind(ob, bindable.armature_to_bind(ob))
    try:
        yield characters.of(ob)
    finally:
        bind.unbind(ob)
        for name, value in kept.items():
            if value is None:
                settings.property_unset(name)
            elif getattr(settings, name) != value:
                setattr(settings, name, value)
        if active:
            ob.modifiers.active = ob.modifiers[active]


def why_not_muted(ob: bpy.types.Object, keys: bpy.types.Key) -> str:
    """Returns why muting the keys would measure nothing, or ""."""
    if not keys.use_relative:
        return "absolute keys cannot be muted"
    if ob.show_only_shape_key:
        return "only the active key is shown"
    if any(path.endswith(".mute") for path in animation.animated_paths(keys)):
        return "their muting is animated"
    return ""
