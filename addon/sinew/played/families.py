"""Where native rigs are whose armature object has keyframes, and the meshes that are deformed on each frame and only
hang on it. Time does not reach these objects, so where they are is written as Blender would. What else follows them is
tagged (followers.py), and Blender evaluates it behind that."""

from collections.abc import Iterator, Sequence
from typing import Any

from ..blender import dependencies, values
from ..description import curves, rna_paths
from ..host import places
from ..host.places import Channel, Row

Place = tuple[tuple[Any, tuple[Channel, ...]], ...]  # see rigs.Source


class Family:
    """An armature object and what hangs on it, with what they were placed with last."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[bytes, bytes]] = {}  # by an object's key: its state, and its matrices
        self._written: list[tuple[Any, bytes]] = []  # each object with its place, the armature's first

    def write(self, place: Place, numbers: Sequence[float], carried: Any, graph: Any) -> None:
        """Puts an armature object where numbers say, and the objects that it carries, parents first."""
        for (ob, channels), own_numbers in zip(place, _split(place, numbers)):
            places.set_channels(ob, channels, own_numbers)  # a parent's evaluated copy Blender evaluates itself
        rig, channels = place[-1]
        evaluated = rig.evaluated_get(graph)
        places.set_channels(evaluated, channels, own_numbers)
        rows, own = rows_of(place), [rig]
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


def rows_of(place: Place) -> list[Row]:
    """Returns the rows of an armature object and its parents with the channels that they have."""
    rows: list[Row] = []
    for ob, _channels in place:
        matrices = places.matrices_of(ob)
        rows.append(Row(-1, matrices[places.MATRIX :]) if ob.parent is None else Row(len(rows) - 1, matrices))
    return rows


def place_of(rig: Any) -> Place:
    """Returns an armature object and its parents, each one after these, with the numbers of their places that keyframes
    set. Raises Refused."""
    return tuple((ob, _channels_of(ob)) for ob in dependencies.with_parents([rig]))


def _channels_of(ob: Any) -> tuple[Channel, ...]:
    found = ((rna_paths.normalised(each.data_path), each.array_index) for each in curves.curves_in_effect(ob))
    return tuple(each for each in found if rna_paths.moves_object(each[0]))


def numbers_of(place: Place, graph: Any) -> tuple[float, ...]:
    """Returns these numbers as Blender has evaluated them."""
    return tuple(each for ob, channels in place for each in places.channels_in(ob.evaluated_get(graph), channels))


def _split(place: Place, numbers: Sequence[float]) -> Iterator[Sequence[float]]:
    begin = 0
    for _ob, channels in place:
        yield numbers[begin : begin + len(channels)]
        begin += len(channels)


def prove(place: Place, graph: Any) -> None:
    """Compares with Blender what would be written into an armature object that Blender evaluates. Raises
    contract.Broken."""
    rig, channels = place[-1]
    places.prove(rig.evaluated_get(graph), rows_of(place), channels)
