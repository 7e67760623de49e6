"""The .blend that a command works on: opening and saving it, and finding what is named in it."""

import argparse
import os
from collections.abc import Iterable

import bpy


def open_blend(path: str) -> None:
    """Opens a file. All references to data of the previous file become invalid."""
    if not os.path.isfile(path):
        raise ValueError(f"there is no file {path}")
    try:
        bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
    except RuntimeError as error:
        if bpy.data.filepath != path:  # otherwise it is open, and only some part of it is damaged
            raise ValueError(sentence(error)) from error


def open_named(options: argparse.Namespace, command: str) -> None:
    """Opens the file that is named, or goes on with the one that is open. command: its name, for the message."""
    if options.path:
        open_blend(options.path)
    elif not bpy.data.filepath:
        raise ValueError(f"no file is open: name one before --command, or after {command}")


def save() -> None:
    """Saves the open file in its place. Raises ValueError."""
    try:
        bpy.ops.wm.save_mainfile()
    except RuntimeError as error:
        raise ValueError(str(error).strip().removeprefix("Error: ")) from error


def sentence(error: Exception) -> str:
    """Returns the message of an error, without the "Error: " that operators put before it."""
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, MemoryError):
        return str(error) or "there is not enough memory"
    return str(error).strip().splitlines()[-1].removeprefix("Error: ")


def names_of(words: Iterable[str] | None) -> tuple[str, ...]:
    """Returns the object names in the words, each of which is a name or a comma-separated list of names."""
    return tuple(
        name for word in words or () for name in ([word] if word in bpy.data.objects else word.split(",")) if name
    )


def meshes_named(words: Iterable[str] | None) -> list[bpy.types.Object]:
    """Returns the mesh objects of the names in the words. Raises ValueError."""
    names = dict.fromkeys(names_of(words))
    for name in names:
        ob = bpy.data.objects.get(name)
        if ob is None or ob.type != "MESH":
            raise ValueError(f"there is no mesh {name}")
    return [bpy.data.objects[name] for name in names]


def chosen_armature(name: str | None) -> bpy.types.Object:
    """Returns the armature object of that name, or without a name the only one. Raises ValueError."""
    armatures = [ob for ob in bpy.data.objects if ob.type == "ARMATURE"]
    names = ", ".join(ob.name for ob in armatures) or "none"
    if name is None and len(armatures) == 1:
        return armatures[0]
    if name is None:
        raise ValueError(f"choose an armature with --object NAME; those in the file: {names}")
    found = next((ob for ob in armatures if ob.name == name), None)
    if found is None:
        raise ValueError(f"there is no armature {name}; those in the file: {names}")
    return found
