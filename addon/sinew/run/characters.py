"""All bound meshes at run time.

Frames and updates must not look up an object by name or ask how many there are: for either, Blender walks through all
objects of the file. So references to the objects are kept. When Blender frees an object, which happens after a
deletion, an undo, and when a library is reloaded or an override is recreated, its reference raises ReferenceError. New
objects are known from the hook, which Blender calls with them, and from updates. The file is then walked through once.
"""

import threading
from collections.abc import Iterable
from dataclasses import dataclass, field

import bpy

from ..blender import animation, armatures, meshes, values
from ..chain import bone_editions
from ..native import sinew_native
from ..plan import canvas_survey
from . import graph_copies, mail, planning
from .character import Character


@dataclass
class _File:
    """The result of a walk through the open file."""

    object_count: int = 0
    objects: dict[int, bpy.types.Object] = field(default_factory=dict)  # bound mesh objects, by their keys
    by_clip: dict[int, bpy.types.Object] = field(default_factory=dict)  # those whose pose may come from a clip
    with_copy: dict[int, bpy.types.Object] = field(default_factory=dict)  # those with the output Mesh, if not linked
    users_of: dict[int, int] = field(default_factory=dict)  # users of each one's mesh when its sharers were counted
    parts: dict[int, set[int]] = field(default_factory=dict)  # key of a data-block -> keys of the objects that use it

    def sort_in(self, key: int, ob: bpy.types.Object) -> None:
        """Enters a bound object."""
        own = armatures.of_modifiers(ob)
        for kept, belongs in (
            (self.by_clip, ob.sinew.source == "CLIP" or animation.find_curve(ob, "sinew.source") is not None),
            (self.with_copy, ob.sinew.installed_output == "MESH" and ob.library is None),
        ):
            if belongs:
                kept[key] = ob
            else:
                kept.pop(key, None)
        for part in filter(None, (ob, ob.data, ob.data.shape_keys, *own, *(armature.data for armature in own))):
            self.parts.setdefault(values.key_of(part), set()).add(key)


_characters: dict[int, Character] = {}  # by the key of the mesh object
_file = _File()
_is_stale = True  # bound meshes were added or removed since the walk
_through_canvas: set[int] = set()  # keys of the mesh objects whose shape goes through a canvas
_gathering_number = 0
_gathering = threading.Lock()  # held while _characters gets entries or is replaced


def configure(thread_count: int, instruction_set: str) -> None:
    """Sets how skinning runs from now on. thread_count: 0 for all threads; instruction_set: "auto" or one of
    sinew_native.instruction_sets()."""
    sinew_native.set_thread_count(thread_count)
    sinew_native.set_instruction_set(instruction_set)


def of(ob: bpy.types.Object) -> Character:
    """Returns the Character of a bound object, original or evaluated, and makes it if there is none yet. From any
    thread."""
    global _is_stale
    key = values.key_of(ob)
    entry = _characters.get(key)
    if entry is None:
        with _gathering:
            entry = _characters.setdefault(key, _new(key, _name(ob.original)))
            _is_stale = True
    return entry


def character(ob: bpy.types.Object) -> Character | None:
    """Returns the Character of an object, or None if the object is not bound or has none yet."""
    return _characters.get(values.key_of(ob)) if ob.sinew.is_bound else None


def looked_at(ob: bpy.types.Object) -> Character | None:
    """Returns the Character of an original object with its plan, or None if the object is not bound. After an undo, a
    mesh that Blender deforms has no plan until somebody asks: its hook need not be called, see in_pass."""
    if not ob.sinew.is_bound:
        return None
    entry = of(ob)
    if not entry.planning.has_looked:
        entry.look(ob)
    return entry


def _new(key: int, name: tuple[str, str | None]) -> Character:
    return Character(key, name)


def forget() -> None:
    """Discards everything that is cached, as after a file was loaded."""
    global _characters, _file, _is_stale
    with _gathering:
        _characters, _file, _is_stale = {}, _File(), True
        _through_canvas.clear()
    planning.with_tails.clear()
    bone_editions.forget()
    graph_copies.forget()
    mail.forget()


def follow_undo() -> None:
    """Notes that Blender has undone or redone a step. It has freed the objects that the step changes, and keeps the
    evaluated copies of all else, with their marks: what was read of those still holds."""
    global _file, _is_stale
    if not values.KEYS_OUTLIVE_UNDO:
        forget()
        return
    _file, _is_stale = _File(), True
    for entry in tuple(_characters.values()):
        entry.planning.follow_undo()
        entry.status.note_success()
    mail.forget()


def forget_object(ob: bpy.types.Object) -> None:
    """Discards what is cached for one mesh."""
    _characters.pop(values.key_of(ob), None)
    gather_again()


# --- which ones exist -----------------------------------------------------------------------------


def bound_objects() -> list[bpy.types.Object]:
    """Returns all bound mesh objects of the file, whether or not they are in a scene. Counts the file's objects, which
    frames and ordinary updates must not do."""
    count_again()
    return known()


def known() -> list[bpy.types.Object]:
    """Returns the same as bound_objects without counting, so new objects that are in no scene may be missing."""
    return _present("objects")


def by_clip() -> list[bpy.types.Object]:
    """Returns the bound objects whose pose may come from a clip."""
    return _present("by_clip")


def may_follow_clips() -> bool:
    """Whether any bound object's pose may come from a clip. From any thread."""
    return _is_stale or bool(_file.by_clip)


def with_copy() -> list[bpy.types.Object]:
    """Returns the bound objects with the output Mesh that are not linked, so that the copy may be written."""
    return _present("with_copy")


def made_of(keys: Iterable[int]) -> dict[int, bpy.types.Object]:
    """Returns {key: bound object} for the objects that use a data-block with one of these keys: the object itself, its
    mesh, its armatures or their data."""
    if _is_stale:
        _gather()
    found = set().union(*(_file.parts[key] for key in keys if key in _file.parts))
    return {key: _file.objects[key] for key in found if values.is_alive(_file.objects[key])}


def find(key: int) -> bpy.types.Object | None:
    """Returns the bound object with that key, or None."""
    if _is_stale or not values.is_alive(_file.objects.get(key)):
        _gather()
    return _file.objects.get(key)


def gather_again() -> None:
    """Has the next query walk through the file again."""
    global _is_stale
    _is_stale = True


def count_again() -> None:
    """Checks whether objects were added or removed, and if so has the next query walk through the file again."""
    if len(bpy.data.objects) != _file.object_count or not all(map(values.is_alive, _file.objects.values())):
        gather_again()


def gathering() -> int:
    """Returns a number that changes with every walk through the file, so after bound meshes were added or removed."""
    return _gathering_number


def members() -> frozenset[int]:
    """Returns the keys of the bound mesh objects at the last walk through the file."""
    return frozenset(_file.objects)


def see(ob: bpy.types.Object, is_edited: bool = True) -> None:
    """Updates what is known of a bound object after an update. is_edited: more than its name or place may differ."""
    key = values.key_of(ob)
    if _file.objects.get(key) != ob:
        gather_again()
        return
    entry = of(ob)
    entry.name = _name(ob)
    if is_edited:
        _file.sort_in(key, ob)


def see_mesh(mesh: bpy.types.Mesh, is_in_doubt: bool) -> None:
    """Has the sharers of a mesh counted again if bound objects use it and its number of users has changed. mesh: that
    of an object that was edited; is_in_doubt: count even if the number of users is unchanged."""
    for key in _file.parts.get(values.key_of(mesh), ()):
        if is_in_doubt or _file.users_of.get(key) != mesh.users:
            gather_again()


def _present(name: str) -> list[bpy.types.Object]:
    """Returns the objects in a field of _File, after another walk if one of them no longer exists."""
    if _is_stale or not all(map(values.is_alive, getattr(_file, name).values())):
        _gather()
    return list(getattr(_file, name).values())


def _gather() -> None:
    """Walks through the file. Entries that evaluations in other threads add in the meantime are kept."""
    global _characters, _file, _gathering_number, _is_stale
    before, _is_stale = set(_characters), False
    sharers: dict[int, list[bpy.types.Object]]  # by the key of their mesh
    file, sharers = _File(), {}
    for ob in bpy.data.objects:
        file.object_count += 1
        if ob.type == "MESH":
            if ob.data.users > 1:
                sharers.setdefault(values.key_of(ob.data), []).append(ob)
            if ob.sinew.is_bound:
                file.objects[values.key_of(ob)] = ob
    with _gathering:
        entries = {key: _characters.get(key) or _new(key, _name(ob)) for key, ob in file.objects.items()}
        for key in _characters.keys() - before - entries.keys():
            entries[key] = _characters[key]
        _characters = entries
    for key, ob in file.objects.items():
        file.sort_in(key, ob)
        file.users_of[key] = ob.data.users
        entries[key].name = _name(ob)
        sharer_count = meshes.count_sharers(ob, sharers.get(values.key_of(ob.data), ()))
        entries[key].planning.see_sharers(ob, sharer_count)
    _file = file
    _gathering_number += 1
    graph_copies.expect_strays()


def _name(ob: bpy.types.Object) -> tuple[str, str | None]:
    return ob.name, ob.library.filepath if ob.library else None


def note_canvas(entry: Character) -> None:
    """Notes that the plan of a bound mesh may depend on its surroundings. From any thread."""
    _through_canvas.add(entry.key)


def see_surroundings() -> None:
    """Hands what may have changed in the rest of the file over to the plans that depend on it. Before an evaluation;
    does nothing except in the main thread."""
    if not _through_canvas or not mail.is_main_thread():
        return
    if not any(_has_edited_objects(scene) for scene in bpy.data.scenes):
        return
    file = canvas_survey.read_file()
    for key in tuple(_through_canvas):
        ob = _file.objects.get(key)
        if ob is not None and values.is_alive(ob):
            _characters[key].planning.see_surroundings(ob, file)


def _has_edited_objects(scene: bpy.types.Scene) -> bool:
    graphs = (layer.depsgraph for layer in scene.view_layers)
    return any(graph is not None and graph.id_type_updated("OBJECT") for graph in graphs)


def sweep() -> None:
    """Discards what was read in graphs that are gone. In the main thread, after an evaluation."""
    graphs = [layer.depsgraph for scene in bpy.data.scenes for layer in scene.view_layers]
    graph_copies.sweep({ob.evaluated_get(graph).as_pointer() for graph in filter(None, graphs) for ob in known()})
