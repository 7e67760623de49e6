"""Takes things out of a scene to measure what they cost: context managers that restore everything. Armatures are played
in a separate scene, from which they are removed one by one."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from typing import Any

import bpy

from ..blender import animation, temporary
from ..install import bind
from ..main import whole_frames
from ..plan import bindable
from ..run import characters
from . import costs


@contextmanager
def scene_of(objects: Sequence[bpy.types.Object]) -> Iterator[bpy.types.Scene]:
    """Yields a scene with only these objects and what they depend on. Nothing is hidden in the file's own scenes:
    hiding would deselect objects and make simulations lose their frames."""
    scene = bpy.data.scenes.new("Sinew Profile")
    try:
        with temporary.changed((ob, "hide_viewport", False) for ob in objects if ob.hide_viewport):
            for ob in objects:
                scene.collection.objects.link(ob)
            yield scene
    finally:
        bpy.data.scenes.remove(scene)


def muted(parts: Iterable[Any]) -> AbstractContextManager[None]:
    """Mutes curves of keyframes, drivers or shape keys inside the `with` block."""
    return temporary.changed((each, "mute", True) for each in parts)


def switched_off(modifiers: Iterable[bpy.types.Modifier]) -> AbstractContextManager[None]:
    return temporary.changed((each, "show_viewport", False) for each in modifiers)


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


class Rigs:
    """Armatures that are measured together. Level n is played without the first n of them. Their keyframes and drivers
    are muted throughout, since these are measured separately."""

    def __init__(self, rigs: Sequence[tuple[bpy.types.Object, costs.Part]]) -> None:
        """rigs: a list of (armature object, its costs.Part)."""
        self._rigs = _users_first(rigs)
        self._down: list[list[float]] = [[] for _ in range(len(rigs) + 1)]  # milliseconds of each level's frames
        self._up: list[list[float]] = [[] for _ in range(len(rigs) + 1)]  # the same, played in the opposite order
        self.step_count = 2 * len(self._down)  # per block of frames

    def steps(self, frames: Sequence[int]) -> Iterator[tuple[str, Callable[[], None]]]:
        """Yields (what is done, a function that does it and restores everything) for a block of frames."""
        levels = [*enumerate(self._down), *reversed([*enumerate(self._up)])]
        for level, times in levels:
            left_out = f"playing without {self._rigs[level - 1][0].name}" if level else "playing the armatures alone"
            yield left_out, partial(self._play, frames, level, times)

    def _play(self, frames, level, times):
        objects = [ob for ob, _ in self._rigs[level:]]
        with ExitStack() as stack:
            stack.enter_context(muted(sum(unmuted_curves(blocks_of(objects)), [])))
            scene = stack.enter_context(scene_of(objects))
            times += whole_frames.frame_times(scene, frames)

    def conclude(self) -> None:
        for level, (_, part) in enumerate(self._rigs):
            without = [(a + b) / 2 for a, b in zip(self._down[level + 1], self._up[level + 1])]
            costs.set_difference([part], self._down[level], without, self._up[level])


def _users_first(rigs):
    """Sorts armatures before those that they follow, which are evaluated as long as a follower is in the scene."""
    if len(rigs) < 2:
        return list(rigs)
    return sorted(rigs, key=lambda rig: -len(_armatures_for([rig[0]])))


def evaluated_armatures(shown: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Returns the armatures that a frame evaluates: the visible ones, and those that visible objects need. shown: the
    visible objects."""
    found = [ob for ob in shown if ob.type == "ARMATURE"]
    if len(found) < sum(ob.type == "ARMATURE" for ob in bpy.data.objects):
        found += _armatures_for([ob for ob in shown if ob.type != "ARMATURE"])
    return list(dict.fromkeys(found))


def _armatures_for(objects):
    """Returns the armatures among the objects, and those evaluated for them. (`depsgraph.ids` lacks hidden objects.)"""
    with scene_of(objects) as scene:
        scene.view_layers[0].update()
        depsgraph = scene.view_layers[0].depsgraph
        armatures = [ob for ob in bpy.data.objects if ob.type == "ARMATURE"]
        return [ob for ob in armatures if ob.evaluated_get(depsgraph).is_evaluated]


def blocks_of(armatures: Iterable[bpy.types.Object]) -> list[Any]:
    """Returns the data-blocks that the armatures' keyframes and drivers belong to."""
    return [*armatures, *(ob.data for ob in armatures)]


def unmuted_curves(blocks: Iterable[Any], hooks: Iterable[Any] = ()) -> tuple[list[Any], ...]:
    """Returns (keyframes, drivers) of data-blocks, without duplicates. hooks: drivers that are left out."""
    keyed: dict[int, Any]
    drivers: dict[int, Any]
    keyed, drivers = {}, {}
    for block in blocks:
        keyed.update((curve.as_pointer(), curve) for curve in animation.keyed_curves(block))
        drivers.update((curve.as_pointer(), curve) for curve in animation.drivers_of(block) if curve not in hooks)
    return tuple([curve for curve in found.values() if not curve.mute] for found in (keyed, drivers))
