"""Evaluates the scene for a bake frame by frame, with the last modifiers computed natively where that is faster, and
restores everything afterwards."""

import hashlib
import os
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import bpy
import numpy as np

from ..blender import animation, meshes, nodes, temporary, values
from ..plan import survey, tails
from ..played import accelerating
from ..run import characters
from ..stencils import probing

PAYS = 1.5  # so many frames for each evaluation that the search takes


def objects_to_bake(context: bpy.types.Context, names: Iterable[str]) -> list[bpy.types.Object]:
    """Returns mesh objects by name; without names, all visible ones with modifiers or shape keys. Raises ValueError."""
    layer = context.view_layer
    layer.update()
    if not names:
        found = [
            ob
            for ob in layer.objects
            if ob.type == "MESH" and ob.visible_get() and (len(ob.modifiers) > 0 or ob.data.shape_keys is not None)
        ]
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
    ob = context.view_layer.objects.active
    mode = ob.mode if ob is not None and (ob.mode.startswith("EDIT") or ob.mode == "SCULPT") else None
    if mode:
        _set_mode(context, ob, "OBJECT")
    try:
        with temporary.frame_kept(context.scene):
            accelerating.accelerate(context.scene, context.view_layer)
            yield
    finally:
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
    with temporary.changed((modifier, "show_viewport", False) for modifier in off):
        yield


class _Stencilled:
    """An object whose tail is switched off, and made from the vertices before it."""

    def __init__(self, ob: bpy.types.Object, stencils: Any, depsgraph: Any, switches: ExitStack) -> None:
        self._ob, self._stencils, self._switches = ob, stencils, switches
        self._topology = meshes.read_topology(ob.evaluated_get(depsgraph).data)

    def read(self, depsgraph: Any) -> np.ndarray | None:
        """Returns the positions (R, 3). If other faces are there than those for which the stencils were found, switches
        the tail on and returns None."""
        mesh = self._ob.evaluated_get(depsgraph).data
        if all(map(np.array_equal, meshes.read_topology(mesh), self._topology)):
            return self._stencils.apply(meshes.read_positions(mesh))
        self._switches.close()
        return None


def _is_played(ob: bpy.types.Object, tail: Sequence[bpy.types.Modifier]) -> bool:
    """Whether Sinew computes the tail of a bound mesh in each evaluation."""
    entry = characters.character(ob)
    played = entry.way.tail if entry is not None and entry.is_deforming else None
    return played is not None and played.names == tuple(each.name for each in tail)


class Shapes:
    """The shapes of the objects of a bake."""

    def __init__(self, stack: ExitStack) -> None:
        """stack: all is restored when it is closed."""
        self._stack = stack
        self._made: dict[bpy.types.Object, _Stencilled] = {}
        self._remarks: dict[bpy.types.Object, str] = {}

    def prepare(
        self, context: bpy.types.Context, frame_counts: Mapping[bpy.types.Object, int]
    ) -> Generator[tuple[float, str], None, None]:
        """Finds the stencils of the objects' last modifiers, if so many frames of each are worth it: a generator of
        (share done, what it does). Blender must have evaluated one of the frames."""
        for ob, frame_count in frame_counts.items():
            tail = tails.of(ob)
            if not tail or frame_count < PAYS:
                continue
            names, switches = " and ".join(each.name for each in tail), ExitStack()
            if _is_played(ob, tail):
                self._remarks[ob] = f"{names} computed natively"
                continue
            self._stack.push(switches)
            try:
                self._made[ob] = yield from self._find(context, ob, tail, frame_count, names, switches)
                self._remarks[ob] = f"{names} computed natively"
            except probing.NotFound as reason:
                switches.close()
                self._remarks[ob] = f"{names} evaluated by Blender, since {reason}"
            context.view_layer.update()

    def _find(self, context, ob, tail, frame_count, names, switches):
        reader = tails.reader_of(ob)
        if reader is not None:
            raise probing.NotFound(f"{reader.name} may follow its shape")
        expected = self.read(ob, context.evaluated_depsgraph_get())[0]
        switches.enter_context(switched_off(tail))
        context.view_layer.update()
        depsgraph = context.evaluated_depsgraph_get()

        def mesh_before() -> bpy.types.Mesh:
            evaluated = ob.evaluated_get(depsgraph)
            return bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)

        with probing.Canvas(ob, tail, depsgraph.scene.render, mesh_before) as canvas:
            stencils = yield from probing.steps(canvas, f"{names} of {ob.name}", int(frame_count / PAYS))
        probing.compare(stencils, meshes.read_positions(ob.evaluated_get(depsgraph).data), expected)
        return _Stencilled(ob, stencils, depsgraph, switches)

    def read(self, ob: bpy.types.Object, depsgraph: Any) -> tuple[np.ndarray, np.ndarray]:
        """Returns the evaluated positions (V, 3) float32, in object space, and matrix_world (4, 4) float64."""
        made = self._made.get(ob)
        positions = made.read(depsgraph) if made is not None else None
        if made is not None and positions is None:
            del self._made[ob]
            self._remarks[ob] += f" up to frame {depsgraph.scene.frame_current}, where its faces change"
            depsgraph.view_layer.update()
        if positions is None:
            return read(ob, depsgraph)
        return positions, values.matrix_to_numpy(ob.evaluated_get(depsgraph).matrix_world)

    def remark(self, ob: bpy.types.Object) -> str:
        """Returns how its last modifiers are computed, a clause, or ""."""
        return self._remarks.get(ob, "")
