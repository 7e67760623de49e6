"""Updates deformed copies, for the output Mesh: writes the evaluated shapes of bound meshes into them.

That happens in a handler that runs after the evaluation of a viewport. Evaluations for renders are ignored.
"""

import logging
from collections.abc import Collection, Iterable

import bpy

from ..blender import meshes, nodes, values
from ..host import mesh_arrays
from ..plan import ways, wiring
from ..run import afterwards, characters, graph_copies, mail
from . import deformed_copy

log = logging.getLogger("sinew")


def forget() -> None:
    """Forgets all deformed copies, as after load."""
    deformed_copy.forget()


def follow(objects: Iterable[bpy.types.Object], depsgraph: bpy.types.Depsgraph, changed: Collection[int]) -> None:
    """Updates the deformed copies of those objects that were evaluated or edited.

    objects: as returned by characters.with_copy; changed: keys of the updated data-blocks.
    """
    if not _is_ours(depsgraph):
        return
    for ob in objects:
        entry = characters.of(ob)
        if not entry.status.is_copy_known or values.key_of(ob) in changed:
            try:
                _follow_one(entry, ob, depsgraph)
            except Exception as error:
                _say_once(ob, error)


def follow_last_evaluation(ob: bpy.types.Object) -> None:
    """Updates the deformed copy of an object after an evaluation for which Blender called no handler.

    Blender calls none when it evaluates what a handler has edited.
    """
    depsgraph = bpy.context.view_layer.depsgraph
    if depsgraph is not None and ob.library is None and ob.sinew.installed_output == "MESH":
        follow([ob], depsgraph, {values.key_of(ob)})


def tidy(objects: Iterable[bpy.types.Object], depsgraph: bpy.types.Depsgraph, may_be_orphans: bool) -> None:
    """Updates the copies' collections, and removes orphans, after objects were moved between collections or deleted.

    objects: as in `follow`.
    """
    if not _is_ours(depsgraph):
        return
    if any(isinstance(update.id, bpy.types.Collection) for update in depsgraph.updates):
        for ob in objects:
            copy = deformed_copy.find(ob)
            if copy is not None:
                deformed_copy.keep_in_collections(copy, ob)
    if may_be_orphans:
        deformed_copy.clear_orphans()


def _is_ours(depsgraph):
    """Whether deformed copies follow this evaluation: not a render's, and only in the main thread."""
    return depsgraph.mode != "RENDER" and mail.is_main_thread()


def why_it_stays(ob: bpy.types.Object) -> str:
    """Returns why the deformed copy is not updated, as the end of a sentence, or ""."""
    if ob.mode in graph_copies.EDITING:
        return f"while {ob.name} is in {ob.mode.capitalize()} Mode"
    if not ob.visible_get():
        return f"while {ob.name} is hidden, because Blender does not evaluate it then"
    if characters.of(ob).status.copy_stays:
        return f"while Blender's own modifier deforms {ob.name} among others, because Blender keeps no shape in between"
    return ""


def _follow_one(entry, ob, depsgraph):
    copy = deformed_copy.find(ob)
    if copy is None:
        if not ob.users_collection:  # it was deleted
            entry.status.is_copy_known = True  # there is none; looking again would search the whole file
            return
        copy = deformed_copy.make(ob)
    deformed_copy.keep_in_place(copy, ob)
    evaluated = ob.evaluated_get(depsgraph)
    if ob.mode in graph_copies.EDITING or not evaluated.is_evaluated:
        return
    seen = entry.copy_of(evaluated)
    shape = _shape_of(seen, ob, evaluated)
    entry.status.copy_stays = shape is None
    if shape is None:
        return
    # While the user paints, the geometry need not be renewed: the vertices stay where they are.
    is_stale = copy.sinew.copied_edition != seen.reading.edition and ob.mode == "OBJECT"
    if is_stale or copy.data.library is not None or len(copy.data.vertices) != len(shape):
        deformed_copy.renew(copy, ob, seen.reading.edition)
    entry.status.is_copy_known = True
    meshes.write_positions(copy.data, shape)


def _shape_of(seen, ob, evaluated):
    """Returns the shape after Sinew's stages, as the viewport shows it, or None if it is not available.

    (V, 3) float32; may refer to Blender's memory, so use it at once. seen: graph_copies.GraphCopy of the evaluated
    object.
    """
    plan = seen.plan or characters.of(ob).plan
    if not ob.sinew.show_shape or not _is_shown(plan, evaluated):
        return meshes.read_positions(ob.data)
    if not seen.is_deforming:
        shape = meshes.read_positions(evaluated.data) if _ends_with_ours(plan, ob) else None
        return shape if shape is not None and len(shape) == len(ob.data.vertices) else None
    mesh = wiring.source_of(plan.hook_of(evaluated))
    count = len(mesh.vertices)
    if count == 0:
        return meshes.read_positions(ob.data)
    if plan.way.kind == ways.KEYS:
        return afterwards.shape_in_keys(evaluated)
    return mesh_arrays.attribute_vectors(mesh.attributes[nodes.POSITION_ATTRIBUTE], count)


def _is_shown(plan, evaluated):
    """Whether the modifiers that Sinew replaces are shown in the viewport."""
    names = [name for name in plan.replaced if name in evaluated.modifiers]
    return not names or any(evaluated.modifiers[name].show_viewport for name in names)


def _ends_with_ours(plan, ob):
    """Whether the result of Blender's own modifiers is the shape after Sinew's stages."""
    if plan.way.in_pass:  # from the next evaluation on
        return not plan.run.end
    shown = [modifier for modifier in ob.modifiers if modifier.show_viewport and not nodes.is_sinew(modifier)]
    return not shown or shown[-1].name in plan.taken


_said: set[str] = set()


def _say_once(ob, error):
    if str(error) not in _said:
        _said.add(str(error))
        log.error("the deformed copy of %s could not be written", ob.name, exc_info=error)
