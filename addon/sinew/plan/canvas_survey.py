"""Reads the canvas of an object, and what a front depends on. Only reads."""

from collections.abc import Sequence
from typing import NamedTuple

import bpy

from ..blender import animation, modifier_types, modifiers, nodes, values
from ..host import modifier_memory
from .situation import Tail

BOTH = (True, True)


class Surroundings(NamedTuple):
    """What the plan of an object depends on in the rest of the file. To read it is to walk through the file, which only
    the main thread may do, outside of evaluations."""

    sharer_count: int  # number of objects with the object's mesh
    simplification: str  # see below
    front_trouble: str  # why other objects or the scenes keep it from having a front, a sentence, or ""
    tail: Tail | None = None  # what the main thread has last found
    is_followed: bool = False  # see tails.followed
    generated_in: str = ""  # as in Situation


class File(NamedTuple):
    """What the surroundings of all objects have in common."""

    simplification: str
    is_animated: bool  # the simplification of a scene
    children: dict[int, str]  # key of an object -> name of one that follows its vertices


def read_file() -> File:
    """Walks through the objects and the scenes of the file."""
    children = {values.key_of(each.parent): each.name for each in bpy.data.objects if is_parented_to_vertices(each)}
    is_animated = any("simplify" in path for scene in bpy.data.scenes for path in animation.animated_paths(scene))
    return File(simplification(), is_animated, children)


def surroundings_of(ob: bpy.types.Object, sharer_count: int, file: File | None = None) -> Surroundings:
    """Returns the surroundings of an original object. sharer_count: number of objects with its mesh; file: as returned
    by read_file."""
    if sharer_count == 1 and not any(modifier.type in modifier_types.FRONTS for modifier in ob.modifiers):
        return Surroundings(sharer_count, "", "")
    file = file or read_file()
    child, trouble = file.children.get(values.key_of(ob)), ""
    if child is not None:
        trouble = f"The parent of {child} is a vertex of the mesh, which only Blender finds behind the first modifiers"
    elif file.is_animated:
        trouble = (
            "The simplification of a scene is animated, on which the modifiers before the Armature modifier depend"
        )
    return Surroundings(sharer_count, file.simplification, trouble)


def canvas_of(
    ob: bpy.types.Object, front: Sequence[str], tail: Tail | None, around: Surroundings
) -> bpy.types.Object | None:
    """Returns the canvas of an original object if it has one with that front or tail, and with the object's mesh, or a
    copy if no other object has that mesh; otherwise None. front: names of modifiers; around: of the object."""
    canvas = ob.sinew.canvas
    if not is_canvas_of(canvas, ob):
        return None
    is_right_mesh = (
        canvas.data == ob.data if around.sharer_count > 1 else canvas.data != ob.data and canvas.data.users == 1
    )
    names, shown = (tail.names, tail.shown) if tail is not None else (front, BOTH)
    is_current = not names or canvas.get(SIMPLIFIED) == around.simplification
    return canvas if is_right_mesh and is_current and has_modifiers_of(canvas, ob, names, shown) else None


# Custom property of a canvas: what `simplification` returned when Blender was last told to evaluate it.
SIMPLIFIED = "simplified"
OWN_SCENES = ".Sinew "  # what the names of those begin with that Sinew has made for a while
_SIMPLIFY = "use_simplify", "simplify_subdivision", "simplify_subdivision_render"


def simplification() -> str:
    """Returns the settings of the user's scenes on which the result of a front depends. Blender tells the objects of a
    scene when they change, but not canvases."""
    others = (scene for scene in bpy.data.scenes if not scene.name.startswith(OWN_SCENES))
    return str([[getattr(scene.render, name) for name in _SIMPLIFY] for scene in others])


def has_modifiers_of(
    canvas: bpy.types.Object, ob: bpy.types.Object, names: Sequence[str], shown: tuple[bool, bool] = BOTH
) -> bool:
    """Whether the modifiers of a canvas before its last one have the settings of these modifiers of an object. shown:
    whether the canvas has them in viewports and in renders."""
    copies = canvas.modifiers[:-1]
    return len(copies) == len(names) and all(
        name in ob.modifiers
        and copy.type == ob.modifiers[name].type
        and modifiers.settings_of(copy) == {**modifiers.settings_of(ob.modifiers[name]), **hidden(shown)}
        and modifier_memory.read_settings(copy) == modifier_memory.read_settings(ob.modifiers[name])
        for copy, name in zip(copies, names)
    )


def hidden(shown: tuple[bool, bool]) -> dict[str, bool]:
    """Returns the switches of a canvas's modifiers that are off whatever the object's are. shown: see
    has_modifiers_of."""
    return {switch: False for switch, is_on in zip(("show_viewport", "show_render"), shown) if not is_on}


def why_not_in_front(modifier: bpy.types.Modifier) -> str:
    """Returns why Sinew cannot begin with the result of a modifier of FRONTS, a clause, or ""."""
    if not modifier_memory.can_copy():
        return "Sinew cannot copy it in this Blender"
    if any(isinstance(value, bpy.types.ID) for value in modifiers.settings_of(modifier).values()):
        return "it depends on another object"
    return "it has a curve of its own" if getattr(modifier, "profile_type", "") == "CUSTOM" else ""


def front_trouble(ob: bpy.types.Object, around: Surroundings) -> str:
    """Returns why Sinew cannot begin with a front on this object, a sentence, or "". ob: original."""
    mesh = ob.data
    if values.VERSION < (4, 1, 0):
        return "In this version of Blender Sinew cannot begin with the result of other modifiers"
    if ob.particle_systems:
        return "Its particles need to know which vertex of the mesh each one behind the first modifiers was made from"
    if animation.animated_paths(mesh):
        return f"The mesh {mesh.name} is animated, and Sinew would begin with a copy of it, which is not"
    if mesh.has_custom_normals and "custom_normal" not in mesh.attributes:
        return "Its custom normals cannot be compared in this version of Blender"
    return around.front_trouble


def is_canvas_of(canvas: bpy.types.Object | None, ob: bpy.types.Object) -> bool:
    """Whether an object, or None, is the canvas of another one."""
    return (
        canvas is not None
        and canvas.type == "MESH"
        and nodes.is_canvas(canvas)
        and len(canvas.constraints) == 1
        and canvas.constraints[0].target == ob
    )


def is_parented_to_vertices(ob: bpy.types.Object) -> bool:
    """Whether an object follows vertices of its parent."""
    return ob.parent is not None and ob.parent_type in {"VERTEX", "VERTEX_3"}
