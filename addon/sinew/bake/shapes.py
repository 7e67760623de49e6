"""Reads the shapes of objects frame by frame, and computes their last modifiers natively where that is faster."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack
from typing import Any

import bpy
import numpy as np

from ..blender import meshes, values
from ..plan import tails
from ..run import characters
from ..stencils import probing
from . import evaluation

PAYS = 1.5  # so many frames for each evaluation that the search takes


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
        switches.enter_context(evaluation.switched_off(tail))
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
            return evaluation.read(ob, depsgraph)
        return positions, values.matrix_to_numpy(ob.evaluated_get(depsgraph).matrix_world)

    def remark(self, ob: bpy.types.Object) -> str:
        """Returns how its last modifiers are computed, a clause, or ""."""
        return self._remarks.get(ob, "")
