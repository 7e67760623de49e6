"""Where native rigs are whose armature object has keyframes, and the meshes that are deformed on each frame and only
hang on it. Time does not reach these objects, so where they are is written as Blender would. What else follows them is
tagged (followers.py), and Blender evaluates it behind that."""

from collections.abc import Sequence
from typing import Any

from ..blender import values
from ..description import curves, rna_paths
from ..host import places
from ..host.places import Channel, Row


class Family:
    """An armature object and what hangs on it, with what they were placed with last."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[bytes, bytes]] = {}  # by an object's key: its state, and its matrices
        self._written: list[tuple[Any, bytes]] = []  # each object with its place, the armature's first

    def write(self, rig: Any, channels: Sequence[Channel], numbers: Sequence[float], carried: Any, graph: Any) -> None:
        """Puts an armature object where numbers of its channels say, and the objects that it carries, parents first."""
        evaluated = rig.evaluated_get(graph)
        for each in (rig, evaluated):
            places.set_channels(each, channels, numbers)
        rows, own = rows_of(rig, graph), [rig]
        rows[-1] = rows[-1]._replace(objects=(rig,), posed=evaluated)
        for ob in carried:
            if not values.is_alive(ob) or ob.parent not in own:  # Blender is about to find out
                continue
            copy = ob.evaluated_get(graph)
            rows.append(Row(len(rows) + own.index(ob.parent) - len(own), self._matrices_of(ob), (ob, copy)))
            own.append(ob)
        self._written = [(ob, place[: places.MATRIX]) for ob, place in zip(own, places.write(rows)[-len(own) :])]

    def _matrices_of(self, ob: Any) -> bytes:
        state, known = places.state_of(ob), self._known.get(key := values.key_of(ob))
        if known is None or known[0] != state:
            known = self._known[key] = state, places.matrices_of(ob)
        return known[1]

    def forget(self) -> None:
        """Forgets where they were put."""
        self._written = []

    def is_left(self, graph: Any) -> bool:
        """Whether the evaluated copies are where they were put."""
        return all(
            values.is_alive(ob) and places.place_in(ob.evaluated_get(graph), places.MATRIX) == place
            for ob, place in self._written
        )


def rows_of(rig: Any, graph: Any) -> list[Row]:
    """Returns the row of an armature object with the channels that it has, and in front of it that of its parent, which
    stays."""
    matrices = places.matrices_of(rig)
    if rig.parent is None:
        return [Row(-1, matrices[places.MATRIX :])]
    return [Row(-1, places.world_of(rig.parent.evaluated_get(graph))), Row(0, matrices)]


def channels_of(ob: Any) -> tuple[Channel, ...]:
    """Returns the numbers of an object's place that its keyframes set. Raises Refused."""
    found = ((rna_paths.normalised(each.data_path), each.array_index) for each in curves.curves_in_effect(ob))
    return tuple(each for each in found if rna_paths.moves_object(each[0]))


def prove(rig: Any, channels: Sequence[Channel], graph: Any) -> None:
    """Compares with Blender what would be written into an armature object that Blender evaluates. Raises
    contract.Broken."""
    places.prove(rig.evaluated_get(graph), rows_of(rig, graph), tuple(channels))
