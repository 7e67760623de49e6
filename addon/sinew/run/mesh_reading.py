"""What is read of the evaluated copies of a mesh and its shape keys, and kept until Blender copies them again."""

import itertools
import time
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np

from ..blender import meshes
from ..chain import layers, methods, shape_keys
from ..chain.leaving import LeaveToBlender
from ..host import deform_verts, marks

_edition_numbers = itertools.count(int(time.time()) % 2**30 + 1)


class Shared:
    """The data that the graph copies of one mesh share: weights, rest positions and layers, each for as long as a graph
    copy uses it. Hold the character's lock."""

    def __init__(self) -> None:
        self._known: list[weakref.ref] = []

    def equal_to(self, kind: type, is_equal: Callable[[Any], bool]) -> Any:
        """Returns a shared object of that type for which is_equal(object) is true, or None."""
        known = (each() for each in self._known)
        return next((each for each in known if type(each) is kind and is_equal(each)), None)

    def add(self, found: Any) -> Any:
        """Shares an object and returns it."""
        self._known = [each for each in self._known if each() is not None] + [weakref.ref(found)]
        return found


class CanvasCopy:
    """Whether a canvas's copy of the mesh is like the mesh."""

    def __init__(self, planning: Any) -> None:
        """planning: planning.Planning."""
        self._planning = planning
        self._is_true: bool | None = None  # None: to be compared
        self._compared = (0, 0)  # addresses of the two
        self._is_new = True  # nothing was compared in this graph

    def forget(self) -> None:
        """Has the two compared again, because Blender has copied the object."""
        self._compared = (0, 0)

    def check(self, mesh: Any, copied: Any) -> None:
        """Compares the mesh with the copy, if either may have been edited. mesh, copied: evaluated, before all
        modifiers. Raises LeaveToBlender if they differ, or if the mesh has just been edited: then it may be again. In a
        new graph, they are compared at once."""
        is_mesh_seen = marks.test_and_mark(mesh, "MESH")
        is_copy_seen = marks.test_and_mark(copied, "MESH")
        before, self._compared = self._compared, (mesh.as_pointer(), copied.as_pointer())
        if not is_mesh_seen or not is_copy_seen or before != self._compared:
            self._is_true = None
            if not is_mesh_seen and before != (0, 0):
                raise LeaveToBlender("the mesh has just been edited")
        if self._is_true is None:
            self._is_true = meshes.are_same(mesh, copied)
        is_new, self._is_new = self._is_new, False
        if not self._is_true:
            if is_mesh_seen or is_new:  # in a render, each frame may have a new graph
                self._planning.ask_for_copy()
            raise LeaveToBlender("the canvas has an older copy of the mesh")
        self._planning.note_copy()


class Reading:
    """What was read of one evaluated object's mesh and shape keys."""

    def __init__(self, character: Any) -> None:
        """character: character.Character."""
        self._character = character
        self.edition: int = character.edition  # a number that no other edition of this mesh has; 0: not known
        self.weights: Any = None  # layers.Weights, or None
        self.rest: Any = None  # (V, 3), or None; with shape keys, the reference key
        self.keys: Any = None  # shape_keys.Keys, or None if the mesh has no shape keys
        self.method = methods.Method()
        self.canvas = CanvasCopy(character.planning)
        self._mesh_address = self._keys_address = 0  # of what was read
        self._is_method_known = False
        self._faces = ""  # methods.digest of the mesh's faces; "": not known

    def is_done(self) -> bool:
        return self.rest is not None

    def is_at(self, mesh: Any) -> bool:
        """Whether the last mesh that was read was at the address of this one."""
        return self._mesh_address == mesh.as_pointer()

    def has_read_keys(self, keys: Any) -> bool:
        """Whether the shape keys were read of the evaluated data-block at that address."""
        return self.keys is not None and self._keys_address == keys.as_pointer()

    def forget_mesh(self) -> None:
        """Has the next evaluation read the mesh again."""
        self._mesh_address = 0

    def look_again(self) -> None:
        """Has the method read again, because the object was edited."""
        self._is_method_known = False

    def read_mesh(self, mesh: Any, is_edited: bool) -> None:
        """Reads a mesh and keeps what has not changed. mesh: evaluated, before all modifiers."""
        self._mesh_address = mesh.as_pointer()
        if is_edited or not self.edition:
            self.edition = self._character.edition = next(_edition_numbers)
        self._is_method_known, self._faces = False, ""
        self.read_weights(mesh)

    def read_weights(self, mesh: Any) -> None:
        """Reads the weights of a mesh, and shares them if another graph copy has equal ones."""
        found = layers.Weights.of(mesh, deform_verts.group_names(mesh), meshes.read_weights)
        if not found.same_as(self.weights):
            shared = self._character.shared
            self.weights = shared.equal_to(layers.Weights, found.same_as) or shared.add(found)

    def read_rest(self, mesh: Any) -> None:
        """Reads the positions of a mesh without shape keys."""
        self.keys = None
        self._set_rest(meshes.read_positions(mesh))

    def _set_rest(self, found: np.ndarray) -> None:
        if self.rest is not None and np.array_equal(found, self.rest):
            return
        shared = self._character.shared
        known = shared.equal_to(np.ndarray, lambda each: np.array_equal(each, found))
        self.rest = shared.add(found) if known is None else known

    def read_keys(self, ob: Any, mesh: Any) -> None:
        """Reads the shape keys if they may have changed. ob, mesh: evaluated. A new evaluated copy may have been
        edited. A silenced copy has lost its reference shape: if it is not known here, the original is read instead."""
        keys = mesh.shape_keys
        is_fresh = not marks.test_and_mark(keys, "KEY")
        if not is_fresh and self.has_read_keys(keys):
            return
        self._keys_address = keys.as_pointer()
        source = keys if is_fresh else ob.original.data.shape_keys
        self.keys = shape_keys.read(source, len(mesh.vertices), self.weights)
        self._set_rest(self.keys.base)

    def keys_of(self, keys: Any, original: Any) -> shape_keys.Keys:
        """Returns what is known of silenced shape keys, an evaluated data-block; reads it of the original mesh if it is
        not known."""
        if not self.has_read_keys(keys):
            self.read_weights(original)
            self.keys = shape_keys.read(original.shape_keys, len(original.vertices), self.weights)
            self._keys_address = 0
        return self.keys

    def read_method(self, ob: Any, mesh: Any) -> None:
        """Reads the method and its settings, if they may have changed. ob, mesh: evaluated."""
        if not self._is_method_known:
            self.method = methods.Method.of(ob.original.sinew, lambda: self._digest_of_faces(mesh))
            self._is_method_known = True
            if self.method.kind not in methods.PRECOMPUTED:
                self._character.kept = methods.Kept()

    def _digest_of_faces(self, mesh: Any) -> str:
        self._faces = self._faces or methods.digest(*meshes.read_faces(mesh)[:2])
        return self._faces
