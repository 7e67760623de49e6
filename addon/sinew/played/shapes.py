"""The recorded shapes of meshes that Sinew deforms: what it has written into them, on each frame.

A frozen character's mesh takes its recorded shape in place of computing it again (run/frame_shapes.py), if that would
be computed from the same. If not, after an edit of weights, mesh, shape keys or settings, it is computed, and all other
shapes of that mesh are dropped."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..blender import values
from ..run import characters, frame_shapes, graph_copies
from . import records

_BYTES_OF_PLACE = 200  # of a matrix of Blender's


def is_alive(block: Any) -> bool:
    """Whether a data-block still exists."""
    try:
        return block is not None and bool(block.as_pointer())
    except ReferenceError:
        return False


class Shape(NamedTuple):
    """A mesh on one frame."""

    native: Any  # sinew_native.host.FrameShape
    place: Any  # mathutils.Matrix, of its object to world space

    @property
    def nbytes(self) -> int:
        return self.native.nbytes + _BYTES_OF_PLACE


@dataclass
class Mesh:
    """One mesh object that follows an armature."""

    ob: Any  # original
    record: records.Record
    address: int = 0  # of its evaluated copy
    keeper: Any = field(default_factory=frame_shapes.Keeper)
    identity: int = 0  # of what the recorded shapes were computed by

    def ask_in(self, graph: Any) -> None:
        """Asks for the shapes of its copy in a graph from now on."""
        evaluated = self.ob.evaluated_get(graph)
        copy = characters.of(self.ob).copy_of(evaluated)
        if copy.keeper is not self.keeper:
            self.let_go()
            self.address, self.keeper = evaluated.as_pointer(), frame_shapes.Keeper()
            copy.keeper = self.keeper

    def let_go(self) -> None:
        copy = graph_copies.at(self.address)
        if copy is not None and copy.keeper is self.keeper:
            copy.keeper = None
        self.address = 0

    def note(self, frame: int, graph: Any) -> None:
        """Records what an evaluation of a frame has computed."""
        evaluated = self.ob.evaluated_get(graph)
        known, found = self.keeper.known, self.keeper.found
        if found is None:
            self.ask_in(graph)
        if found is None or evaluated.as_pointer() != self.address:
            return  # or another graph has its turn
        if self.identity != self.keeper.identity or known is not None and found is not known:
            self.record.clear()  # something else has changed than the pose
        self.identity = self.keeper.identity
        if found is not known and self.keeper.is_keeping:
            self.record.put(frame, Shape(found, evaluated.matrix_world.copy()))

    def drop_edited(self) -> None:
        """Drops all shapes if an evaluation has used other weights, keys or settings than they were computed from."""
        if self.keeper.identity not in (0, self.identity):
            self.record.clear()


class Shapes:
    """The recorded shapes of the meshes that follow one armature."""

    def __init__(self, store: records.Store) -> None:
        self._store = store
        self._meshes: dict[int, Mesh] = {}  # by key of the object

    def __iter__(self) -> Iterator[Mesh]:
        return iter(self._meshes.values())

    def follow(self, objects: Iterable[Any]) -> None:
        """Records the shapes of exactly these original mesh objects from now on."""
        wanted = {values.key_of(ob): ob for ob in objects}
        for key in self._meshes.keys() - wanted.keys():
            self._remove(key)
        for key, ob in wanted.items():
            if key not in self._meshes:
                self._meshes[key] = Mesh(ob, records.Record(self._store))

    def ask_in(self, graph: Any) -> None:
        """Asks for the shapes of the meshes in a graph from now on."""
        for mesh in self._meshes.values():
            mesh.ask_in(graph)

    def ask(self, frame: int | None) -> None:
        """Says which shapes the next evaluation may take. frame: None for a moment between two frames."""
        for key, mesh in list(self._meshes.items()):
            if not is_alive(mesh.ob):
                self._remove(key)
                continue
            shape = None if frame is None else mesh.record.at(frame)
            mesh.keeper.ask(shape and shape.native, frame is not None)

    def note(self, frame: int, graph: Any) -> None:
        """Records what an evaluation of a frame has computed."""
        for mesh in self._meshes.values():
            if is_alive(mesh.ob):
                mesh.note(frame, graph)

    def drop_edited(self) -> None:
        """Drops the shapes of meshes that were edited, as the last evaluation has shown."""
        for mesh in self._meshes.values():
            mesh.drop_edited()

    def drop_within(self, ranges: Iterable[tuple[float, float]]) -> None:
        """Drops the shapes of the frames strictly between the ends of each range."""
        ranges = list(ranges)
        for mesh in self._meshes.values():
            mesh.record.drop_within(ranges)

    def clear(self) -> None:
        for key in list(self._meshes):
            self._remove(key)

    def _remove(self, key: int) -> None:
        mesh = self._meshes.pop(key)
        mesh.record.clear()
        mesh.let_go()

    @property
    def nbytes(self) -> int:
        return sum(mesh.record.nbytes for mesh in self._meshes.values())
