"""Makes and removes canvases: what lets Sinew deform an object whose mesh other objects have too, or one with a front.

Blender evaluates a shared mesh once for all its objects, so the deformed positions of one cannot be written there. Each
object has a canvas instead: an object in no scene, with the same mesh and one modifier, by which its evaluated result
is its own. The hook waits for it, reads it and writes to it; Sinew's modifier takes the positions from it. Blender
evaluates it again only after edits of the mesh.

A front (plan/fronts.py) is evaluated by the canvas in place of the object: the canvas has the same modifiers before its
own, and Sinew's modifier takes not only the positions from it, but all. Unless the mesh is shared anyway, the canvas
has a copy of it: Blender refuses to apply modifiers or transforms to a mesh with two users. The hook compares mesh and
copy when either may have been edited (run/graph_copies.py), and asks for another copy if they differ.

An object points to its canvas (`ob.sinew.canvas`). The canvas names its object in a muted constraint, which Blender
corrects when objects are appended, overridden or deleted, and which keeps no deleted object in the file. A duplicate
points to the canvas of its original, which names only that one.

A tail (plan/tails.py) is evaluated by the canvas too, at rest: the hook writes the positions that stencils make of the
deformed mesh, and Sinew's modifier takes all.

Undo may keep objects as they are now, and what a handler has added since the step vanishes. So all canvases are removed
before each undo, and with them all pointers to them; the evaluation after it asks for new ones.
"""

from collections.abc import Sequence

import bpy

from ..blender import meshes, modifiers, nodes, values
from ..plan import canvas_survey
from ..run import mail

NAME = ".Sinew Canvas"  # the dot hides it in lists


def provide(
    ob: bpy.types.Object,
    names: Sequence[str] = (),
    shown: tuple[bool, bool] = canvas_survey.BOTH,
    has_copy: bool = False,
    is_stale: bool = False,
) -> bpy.types.Object:
    """Returns the canvas of a bound object, and makes it or changes it if necessary.

    names: of the modifiers of the object that the canvas has too; shown: whether it has them in viewports and in
    renders; has_copy: the canvas has a copy of the object's mesh, not the mesh itself; is_stale: the copy has to be
    made again.
    """
    canvas = ob.sinew.canvas
    if not canvas_survey.is_canvas_of(canvas, ob):
        lost = (each for each in bpy.data.objects if each.library is None and canvas_survey.is_canvas_of(each, ob))
        canvas = next(lost, None) or _make(ob)
        ob.sinew.canvas = canvas
    if has_copy:
        if is_stale or canvas.data == ob.data or canvas.data.users > 1:
            _give_mesh(canvas, ob.data.copy())
            canvas.data.name = NAME
            meshes.remove_attribute(canvas.data, nodes.POSITION_ATTRIBUTE)  # as the mesh's is, where it has a canvas
            meshes.clear_keys(canvas)
    elif canvas.data != ob.data:
        _give_mesh(canvas, ob.data)
    if not canvas_survey.has_modifiers_of(canvas, ob, names, shown):  # which may name groups of the mesh
        _copy_modifiers(canvas, ob, names, shown)
        canvas.update_tag()
    if names and canvas.get(canvas_survey.SIMPLIFIED) != canvas_survey.simplification():
        canvas[canvas_survey.SIMPLIFIED] = canvas_survey.simplification()
        canvas.update_tag()
    return canvas


def _copy_modifiers(canvas, ob, names, shown):
    canvas.modifiers.clear()
    for name in names:
        copy = modifiers.copy(ob.modifiers[name], canvas)
        for switch, is_on in canvas_survey.hidden(shown).items():
            setattr(copy, switch, is_on)
    nodes.add_canvas_modifier(canvas)


def _give_mesh(canvas, mesh):
    """Gives a canvas another mesh, and removes its copy if it had one."""
    old, canvas.data = canvas.data, mesh
    _forget_copies([old])
    canvas.update_tag()


def _forget_copies(meshes):
    """Removes those of the meshes that are copies, and that nothing uses any more."""
    keys = {values.key_of(mesh) for mesh in meshes if mesh.name.startswith(NAME) and mesh.users == 0}
    if keys:  # even for none, Blender would build the relations of its dependency graph again
        mail.once_handlers_are_done(_remove_meshes, keys)


def _remove_meshes(keys):
    bpy.data.batch_remove([mesh for mesh in bpy.data.meshes if values.key_of(mesh) in keys and mesh.users == 0])


def _make(ob):
    canvas = bpy.data.objects.new(NAME, ob.data)
    nodes.add_canvas_modifier(canvas)
    constraint = canvas.constraints.new("COPY_TRANSFORMS")
    constraint.mute = True
    constraint.target = ob
    return canvas


def remove(ob: bpy.types.Object) -> None:
    """Removes the canvas of an object, if it has one of its own."""
    canvas = ob.sinew.canvas
    if canvas is None:
        return
    ob.sinew.canvas = None
    if canvas.library is None and canvas_survey.is_canvas_of(canvas, ob):
        _remove([canvas])


def remove_unused() -> None:
    """Removes the canvases whose objects were deleted, or have other ones."""
    _remove([canvas for canvas in _local() if not _is_used(canvas)])


def _is_used(canvas):
    owner = canvas.constraints[0].target if canvas.constraints else None
    return owner is not None and owner.sinew.is_bound and owner.sinew.canvas == canvas


def remove_all() -> None:
    """Removes all canvases that are not linked."""
    _remove(_local())


def _remove(canvases):
    if canvases:
        mail.once_handlers_are_done(_remove_objects, {values.key_of(canvas) for canvas in canvases})


def _remove_objects(keys):
    canvases = [ob for ob in _local() if values.key_of(ob) in keys]
    meshes = {canvas.data for canvas in canvases}
    bpy.data.batch_remove(canvases)
    _forget_copies(meshes)


def _local():
    return [ob for ob in bpy.data.objects if ob.type == "MESH" and ob.library is None and nodes.is_canvas(ob)]
