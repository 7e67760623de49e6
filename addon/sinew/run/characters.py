"""All bound meshes at run time, and what is said of them.

Frames and updates must not ask Blender for an object by its name, or for their number: both are walks along all objects
of the file. So the objects themselves are kept. Python is told when Blender frees one: a reference then raises
ReferenceError, after a deletion, an undo, and when a library is read again or an override made anew. What came is known
by the hook, which Blender calls with it, and by updates. Then the file is walked through once.
"""

import logging
import threading
from dataclasses import dataclass, field

import bpy

from ..blender import animation, meshes, values
from ..feedback import notice
from ..native import sinew_native
from . import layers, mail, shortcuts
from .character import Character

log = logging.getLogger("sinew")


@dataclass
class _File:
    """What a walk through the open file has found."""

    object_count: int = 0
    objects: dict = field(default_factory=dict)  # key -> bound mesh object
    by_clip: dict = field(default_factory=dict)  # those of them whose pose may come from a clip
    with_copy: dict = field(default_factory=dict)  # those with the output Mesh that may be written
    users_of: dict = field(default_factory=dict)  # of the mesh of each, when its sharers were counted
    parts: dict = field(default_factory=dict)  # key of a data-block that bound meshes are made of -> their keys

    def sort_in(self, key, ob, armatures):
        """armatures: objects, that deform it."""
        for kept, belongs in (self.by_clip, _may_follow_clip(ob)), (self.with_copy, _has_copy(ob)):
            if belongs:
                kept[key] = ob
            else:
                kept.pop(key, None)
        for part in (ob, ob.data, *armatures, *(armature.data for armature in armatures)):
            self.parts.setdefault(values.key_of(part), set()).add(key)


_characters = {}  # key of the mesh object -> Character
_file = _File()
_is_stale = True  # bound meshes have come or gone since the walk
_editions = {}  # key of the mesh object -> the edition of its mesh, kept through undo
_gathering_number = 0
_gathering = threading.Lock()  # while _characters gets entries, or is replaced


def configure(thread_count, instruction_set):
    """How skinning runs from now on. thread_count 0: all; instruction_set "auto" or a name of
    sinew_native.instruction_sets()."""
    sinew_native.set_thread_count(thread_count)
    sinew_native.set_instruction_set(instruction_set)


def of(ob):
    """The Character of a bound object, original or evaluated, made if there is none yet. From any thread."""
    global _is_stale
    key = values.key_of(ob)
    entry = _characters.get(key)
    if entry is None:
        with _gathering:
            entry = _characters.setdefault(key, _new(key, _name(ob.original)))
            _is_stale = True
    return entry


def character(ob):
    """The Character of a bound object, or None."""
    return _characters.get(values.key_of(ob)) if ob.sinew.is_bound else None


def _new(key, name):
    return Character(key, name, _editions.get(key, 0))


def forget(is_undo=False):
    """Drop everything that is cached, as after load."""
    global _characters, _file, _is_stale
    with _gathering:
        _editions.clear()
        if is_undo:
            _editions.update((key, entry.data.edition) for key, entry in _characters.items())
        _characters, _file, _is_stale = {}, _File(), True
    layers.forget_editions()
    shortcuts.forget()
    mail.forget()


def forget_object(ob):
    """Drop what is cached of one mesh."""
    _characters.pop(values.key_of(ob), None)
    gather_again()


# --- which there are ------------------------------------------------------------------------------


def bound_objects():
    """All bound mesh objects of the file, whether a scene shows them or not. Counts the file's objects, as frames and
    ordinary updates must not."""
    count_again()
    return known()


def known():
    """The same without counting: what came to no scene may be missing."""
    return _present("objects")


def by_clip():
    """The bound objects whose pose may come from a clip."""
    return _present("by_clip")


def may_follow_clips():
    """Whether there may be such objects. From any thread."""
    return _is_stale or bool(_file.by_clip)


def with_copy():
    """The bound objects with the output Mesh that may be written."""
    return _present("with_copy")


def made_of(keys):
    """{key: bound object} of those of which a data-block with one of these keys is a part: the object itself, its
    mesh, its armatures or their data."""
    if _is_stale:
        _gather()
    found = set().union(*(_file.parts[key] for key in keys if key in _file.parts))
    return {key: _file.objects[key] for key in found if _is_alive(_file.objects[key])}


def find(key):
    """The bound object of that key, or None."""
    if _is_stale or not _is_alive(_file.objects.get(key)):
        _gather()
    return _file.objects.get(key)


def gather_again():
    global _is_stale
    _is_stale = True


def count_again():
    """Objects may have come or gone."""
    if len(bpy.data.objects) != _file.object_count or not all(map(_is_alive, _file.objects.values())):
        gather_again()


def gathering():
    """A number that is another one after bound meshes have come or gone."""
    return _gathering_number


def see(ob):
    """A bound object was edited: frames and updates may have other things to do for it."""
    key = values.key_of(ob)
    if _file.objects.get(key) != ob:
        gather_again()
        return
    entry = of(ob)
    entry.name = _name(ob)
    modifiers = [ob.modifiers[name] for name in entry.taken if name in ob.modifiers]
    _file.sort_in(key, ob, [each.object for each in modifiers if getattr(each, "object", None) is not None])


def see_mesh(mesh, is_in_doubt):
    """The mesh of an object that was edited: it may be that of a bound object as well. is_in_doubt: count the sharers
    again though it has as many users as before."""
    for key in _file.parts.get(values.key_of(mesh), ()):
        if is_in_doubt or _file.users_of.get(key) != mesh.users:
            gather_again()


def _present(name):
    """A list of that field's objects, after gathering if one of them is gone."""
    if _is_stale or not all(map(_is_alive, getattr(_file, name).values())):
        _gather()
    return list(getattr(_file, name).values())


def _is_alive(ob):
    try:
        return ob is not None and bool(ob.type)
    except ReferenceError:
        return False


def _gather():
    """Walks through the file. Another thread may have Blender evaluate meanwhile: what it has entered stays."""
    global _characters, _file, _gathering_number, _is_stale
    before, _is_stale = set(_characters), False
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
        armatures = [modifier.object for modifier in ob.sinew.modifiers if modifier.object is not None]
        file.sort_in(key, ob, armatures)
        file.users_of[key] = ob.data.users
        entries[key].name = _name(ob)
        entries[key].planning.set_sharer_count(meshes.count_sharers(ob, sharers.get(values.key_of(ob.data), ())))
    _file = file
    _gathering_number += 1


def _name(ob):
    return ob.name, ob.library.filepath if ob.library else None


def _may_follow_clip(ob):
    return ob.sinew.source == "CLIP" or animation.find_curve(ob, "sinew.source") is not None


def _has_copy(ob):
    return ob.sinew.installed_output == "MESH" and ob.library is None


# --- what the main thread does for them -----------------------------------------------------------


def keep_error(entry, error):
    """An error in one mesh is kept with it and said once, until a frame succeeds."""
    sentence = str(error)
    if sentence != entry.status.error:
        entry.status.error = sentence
        mail.post(_say, entry.name[0], error)
    entry.forget_shape()


def _say(name, error):
    log.error("Sinew cannot deform %s", name, exc_info=error)
    notice.show(f"Sinew cannot deform {name}, so Blender's own modifier does: {error}")


def report(ob, message):
    """Show a sentence with the object in the panel, until it is edited."""
    of(ob).status.error = message
    log.error("%s: %s", ob.name, message)
    notice.show(f"{ob.name}: {message}")
