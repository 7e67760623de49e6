"""Onion skins as data: the shapes of characters' meshes on the frames that were played, and which of them to show.

A shape is kept together with what its pose came from, the rig's program or a recorded pose, and counts only as long as
the rig still has that: an edit that drops it drops the ghosts as well. Whatever else changes a shape (weights,
modifiers, the mesh) is noticed by comparing, on each frame that is evaluated."""

import weakref
from collections.abc import Iterable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..blender import meshes, values
from ..played import computing, elsewhere, followers, playing, recording, records, rigs, states

SECONDS = 0.3  # after which no other frame is evaluated elsewhere
MOST_FACES = 2_000_000  # of a mesh that is shown as a ghost


class Topology(NamedTuple):
    """The triangles of an evaluated mesh. It is one object as long as they do not change."""

    triangles: np.ndarray  # (T, 3) int32: vertices
    counts: tuple[int, int, int]  # of vertices, edges and corners


class Shape(NamedTuple):
    """An evaluated mesh on one frame."""

    positions: np.ndarray  # (V, 3) float32, space of the object
    matrix: np.ndarray  # (4, 4) float32, to world space
    topology: Topology
    origin: Any  # weak reference to what Rig.origin returned: what keeps that is the rig alone

    @property
    def nbytes(self) -> int:
        return self.positions.nbytes + self.matrix.nbytes


class Ghost(NamedTuple):
    """A shape to be drawn."""

    key: tuple[int, int]  # of the mesh object, frame
    shape: Shape
    steps: int  # from the current frame: negative before it, positive after it


@dataclass
class Skins:
    """The shapes of all meshes of one character."""

    objects: list[Any] = field(default_factory=list)  # original mesh objects that the armature moves
    object_count: int = 0  # of the file, when they were found
    shapes: dict[int, records.Record] = field(default_factory=dict)  # by key of the object
    topologies: dict[int, Topology] = field(default_factory=dict)  # likewise
    # Weak references to what Rig.origin returned when a frame's shapes were kept.
    seen: dict[int, Any] = field(default_factory=dict)

    def shape(self, key: int, frame: int, origin: Any) -> Shape | None:
        """Returns the shape of a mesh object on a frame, if its pose is from this origin."""
        record = self.shapes.get(key)
        found = record.at(frame) if record is not None else None
        return found if found is not None and origin is not None and found.origin() is origin else None

    def lacks(self, frame: int, origin: Any) -> bool:
        """Whether a frame has to be played for its shapes."""
        found = self.seen.get(frame)
        return found is None or found() is not origin

    def see(self, frame: int, origin: Any) -> None:
        """Notes that a frame need not be played for its shapes."""
        if origin is not None:
            self.seen[frame] = weakref.ref(origin)

    def drop(self, key: int) -> None:
        """Discards all shapes of one mesh object."""
        record = self.shapes.pop(key, None)
        if record is not None:
            record.clear()
            self.seen.clear()
        self.topologies.pop(key, None)

    def clear(self) -> None:
        for key in list(self.shapes):
            self.drop(key)


def show(rig: rigs.Rig) -> None:
    """Keeps the shapes of a character from now on."""
    states.keep_records(rig)
    rig.motion.skins = rig.motion.skins or Skins()
    _find_objects(rig)


def hide(rig: rigs.Rig) -> None:
    if rig.motion.skins is not None:
        rig.motion.skins.clear()
    rig.motion.skins = None


def shown() -> list[rigs.Rig]:
    """Returns the characters whose ghosts are shown."""
    return [rig for rig in rigs.known() if rig.motion.skins is not None]


def is_kept(key: tuple[int, int], shape: Shape) -> bool:
    """Whether a shape, of a mesh object on a frame, may be shown again."""
    records_of = (rig.motion.skins.shapes.get(key[0]) for rig in shown())
    return any(record is not None and record.at(key[1]) is shape for record in records_of)


def is_complete(rig: rigs.Rig, scene: Any) -> bool:
    """Whether no frame of the range has to be played for a character's ghosts."""
    return not recording.missing(rig, scene)


def keep_now(scene: Any, layer: Any) -> None:
    """Keeps the shapes of the current frame, outside an evaluation."""
    _keep_all(scene, layer.depsgraph)


def fill(scene: Any, frames: Iterable[int]) -> bool:
    """Keeps the shapes of some frames that were never played, of characters whose rigs are computed: Blender evaluates
    them elsewhere, in this order, until so much time has passed that the next call should go on. Call it in the main
    thread, outside an evaluation. Returns whether it has, so that states.keep_played has to follow."""
    is_any, began = False, perf_counter()
    for rig in shown():
        lacking = [frame for frame in frames if recording.lacks(rig, frame)]
        objects = [rig.ob, *filter(rigs.is_alive, rig.motion.skins.objects)]
        if not lacking or not (rig.is_played and rig.source.is_proven and rig.home.scene == scene):
            continue
        if any(map(followers.is_simulated, objects)) or elsewhere.animated(objects, scene) is None:
            continue
        is_any = True
        with elsewhere.on_frames(objects, scene) as evaluated_on:
            for frame in lacking:
                graph, moment = evaluated_on(frame), computing.moment(rig, frame)
                if moment is not None and rigs.is_shown(rig, graph, moment):
                    _keep_frame(rig, graph, frame)
                rig.motion.skins.see(frame, rig.origin(frame))  # and is not tried again
                if perf_counter() - began > SECONDS:
                    return True
    return is_any


def find_again() -> None:
    """Finds all meshes again after an undo step, which may have replaced them."""
    for rig in rigs.known():
        if rig.motion.skins is not None:
            rig.motion.skins.clear()
            _find_objects(rig)


def _is_moved(ob: Any, rig: rigs.Rig) -> bool:
    """Whether a mesh object belongs to a character."""
    return ob.type == "MESH" and (ob.parent == rig.ob or rig.ob in recording.armatures_of([ob]))


def _find_objects(rig: rigs.Rig) -> None:
    skins = rig.motion.skins
    skins.objects = [ob for ob in bpy.data.objects if _is_moved(ob, rig) and ob.users_scene]
    skins.object_count = len(bpy.data.objects)
    keys = {values.key_of(ob) for ob in skins.objects}
    for key in [key for key in skins.shapes if key not in keys]:
        skins.drop(key)


def after_evaluation(scene: Any, graph: Any, is_new_frame: bool) -> None:
    """Keeps the shapes of the frame that was just evaluated, as a handler."""
    own = shown()
    if not own or playing.is_busy() or graph != graph.view_layer.depsgraph:
        return
    for rig in own:
        if len(bpy.data.objects) != rig.motion.skins.object_count:
            _find_objects(rig)
        if not is_new_frame:
            _look_at_edits(rig, graph)
    _keep_all(scene, graph)


def _keep_all(scene: Any, graph: Any) -> None:
    """Keeps the shapes of all characters that show ghosts, on the scene's frame."""
    frame = rigs.whole_frame(scene)
    if frame is None:
        return
    for rig in shown():
        moment = rig.at(frame) or computing.moment(rig, frame)
        if moment is None or not rigs.is_shown(rig, graph, moment):
            continue
        try:
            _keep_frame(rig, graph, frame)
        except ReferenceError:  # one was removed, and another one added
            _find_objects(rig)


def _keep_frame(rig: rigs.Rig, graph: Any, frame: int) -> None:
    origin = rig.origin(frame)
    for ob in rig.motion.skins.objects if origin is not None else ():
        _keep(rig.motion.skins, ob, graph, frame, origin)
    rig.motion.skins.see(frame, origin)


def _look_at_edits(rig: rigs.Rig, graph: Any) -> None:
    """Finds the meshes again if an edit may have changed which they are, and discards what an edit of their data may
    have changed on other frames."""
    edited = [update.id.original for update in graph.updates]
    objects = [ob for ob in edited if isinstance(ob, bpy.types.Object)]
    if any(_is_moved(ob, rig) != (ob in rig.motion.skins.objects) for ob in objects):
        _find_objects(rig)
    for ob in rig.motion.skins.objects:
        if ob.data in edited:
            rig.motion.skins.drop(values.key_of(ob))


def _keep(skins: Skins, ob: Any, graph: Any, frame: int, origin: Any) -> None:
    """Keeps the shape of a mesh. If the frame has another one that was made in the same pose, the mesh has changed:
    its shapes on other frames are discarded."""
    evaluated, key = ob.evaluated_get(graph), values.key_of(ob)
    if not evaluated.is_evaluated or evaluated.type != "MESH" or evaluated.mode == "EDIT":
        return
    positions = meshes.read_positions(evaluated.data)
    matrix = np.array(evaluated.matrix_world, np.float32)
    known = skins.shape(key, frame, origin)
    if known is not None:
        if np.array_equal(known.positions, positions) and np.array_equal(known.matrix, matrix):
            return
        skins.drop(key)
    topology = _topology(skins, key, evaluated.data)
    if topology is not None:
        record = skins.shapes.setdefault(key, records.Record(rigs.store))
        record.put(frame, Shape(positions, matrix, topology, weakref.ref(origin)))


def _topology(skins: Skins, key: int, mesh: Any) -> Topology | None:
    """Returns the triangles of an evaluated mesh; those that are known if they are still right. None if there are too
    many to draw, or none."""
    counts = len(mesh.vertices), len(mesh.edges), len(mesh.loops)
    known = skins.topologies.get(key)
    if known is not None:
        if known.counts == counts:
            return known
        skins.drop(key)
    if not 0 < len(mesh.polygons) <= MOST_FACES:
        return None
    mesh.calc_loop_triangles()
    triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    found = skins.topologies[key] = Topology(triangles.reshape(-1, 3), counts)
    return found


def frames_around(frame: int, before: int, after: int, step: int) -> list[tuple[int, int]]:
    """Returns (frame, steps from the current one) of the frames on which ghosts are shown, the farthest first."""
    steps = sorted((*range(-before, 0), *range(1, after + 1)), key=lambda each: -abs(each))
    return [(frame + step * each, each) for each in steps]


def around(scene: Any, before: int, after: int, step: int, objects: Iterable[Any]) -> list[Ghost]:
    """Returns the ghosts of all characters around the scene's frame, the farthest first. objects: original mesh objects
    that may be shown."""
    own = shown()
    keys = {values.key_of(ob) for ob in objects} if own else set()
    return [
        Ghost((key, frame), shape, steps)
        for frame, steps in frames_around(scene.frame_current, before, after, step)
        for rig in own
        for key in rig.motion.skins.shapes
        for shape in (rig.motion.skins.shape(key, frame, rig.origin(frame)),)
        if key in keys and shape is not None
    ]
