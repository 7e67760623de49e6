"""All bound meshes at run time, and what is said of them.

Caches are dropped on load and undo. Data-blocks are known by key and name, not by reference: a reference dies when
Blender replaces the block.
"""

import logging
import threading

import bpy

from ..blender import meshes, values
from ..feedback import notice
from ..native import sinew_native
from . import layers, mail, shortcuts
from .character import Character

log = logging.getLogger("sinew")

_characters = {}  # key of the mesh object -> Character
_editions = {}  # key of the mesh object -> the edition of its mesh, kept through undo
_gathering_number = 0
_object_count = -1  # of the file when _characters was last gathered; -1: gather again
_gathering = threading.Lock()


def configure(thread_count, instruction_set):
    """How skinning runs from now on. thread_count 0: all; instruction_set "auto" or a name of
    sinew_native.instruction_sets()."""
    sinew_native.set_thread_count(thread_count)
    sinew_native.set_instruction_set(instruction_set)


def of(ob):
    """The Character of a bound object, original or evaluated, made if there is none yet. From any thread."""
    key = values.key_of(ob)
    entry = _characters.get(key)
    if entry is None:
        with _gathering:
            entry = _characters.setdefault(key, _new(key, _name(ob.original)))
    return entry


def character(ob):
    """The Character of a bound object, or None."""
    return _characters.get(values.key_of(ob)) if ob.sinew.is_bound else None


def _new(key, name):
    return Character(key, name, edition=_editions.get(key, 0))


def forget(is_undo=False):
    """Drop everything that is cached, as after load."""
    global _object_count
    _editions.clear()
    if is_undo:
        _editions.update((key, entry.edition) for key, entry in _characters.items())
    _characters.clear()
    layers.forget_editions()
    shortcuts.forget()
    mail.forget()
    _object_count = -1


def forget_object(ob):
    """Drop what is cached of one mesh."""
    global _object_count
    _characters.pop(values.key_of(ob), None)
    _object_count = -1


def gather_again():
    global _object_count
    _object_count = -1


def bound_objects():
    """All bound mesh objects of the file, whether a scene shows them or not."""
    objects = bpy.data.objects
    if len(objects) != _object_count:
        _gather()
    found = []
    for key, entry in list(_characters.items()):
        ob = objects.get(entry.name)
        if ob is None or values.key_of(ob) != key:
            _gather()  # renamed or replaced
            return [objects[entry.name] for entry in _characters.values()]
        found.append(ob)
    return found


def gathering():
    """A number that is another one after bound meshes have come or gone."""
    return _gathering_number


def find(key):
    """The bound object of that key, or None."""
    return next((ob for ob in bound_objects() if values.key_of(ob) == key), None)


def _name(ob):
    return ob.name, ob.library.filepath if ob.library else None


def _gather():
    global _object_count, _gathering_number
    _gathering_number += 1
    old = dict(_characters)
    _characters.clear()
    for ob in bpy.data.objects:
        if ob.type == "MESH" and ob.sinew.is_bound:
            key = values.key_of(ob)
            _characters[key] = old.get(key) or _new(key, _name(ob))
            _characters[key].name = _name(ob)
            _characters[key].take_sharer_count(meshes.count_sharers(ob))
    _object_count = len(bpy.data.objects)


# --- what the main thread does for them -----------------------------------------------------------


def keep_error(entry, error):
    """An error in one mesh is kept with it and said once, until a frame succeeds."""
    sentence = str(error)
    if sentence != entry.error:
        entry.error = sentence
        mail.post(_say, entry.name[0], error)
    entry.forget_shape()


def _say(name, error):
    log.error("Sinew cannot deform %s", name, exc_info=error)
    notice.show(f"Sinew cannot deform {name}, so Blender's own modifier does: {error}")


def report(ob, message):
    """Show a sentence with the object in the panel, until it is edited."""
    of(ob).error = message
    log.error("%s: %s", ob.name, message)
    notice.show(f"{ob.name}: {message}")
