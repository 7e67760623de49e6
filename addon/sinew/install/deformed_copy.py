"""Makes and removes the deformed copy of a bound mesh: the output Mesh.

It is a second object whose own vertices have the deformed shape, for scripts and exporters that read those. The object
itself is bound as with the other output, and its mesh is never written.

A copy is a child of its object and is marked as a copy (`sinew.copied_from`). Blender updates the parent pointer when
either is deleted, duplicated, joined or appended, and it does not keep a deleted object in the file. A bound object
with this output and without a copy gets one.
"""

from collections.abc import Sequence

import bpy
from mathutils import Matrix

from ..blender import meshes, nodes, values
from ..plan import survey, ways
from ..run import mail

SUFFIX = ".deformed"
_copies: dict[int, bpy.types.Object] = {}  # key of a bound object -> its copy, which may have become invalid


class OutputError(ValueError):
    """The object cannot have the output Mesh. The message gives the reason; nothing was changed."""


def check(
    ob: bpy.types.Object, taken: Sequence[bpy.types.Modifier], sharer_count: int, gets_armature: bool = False
) -> None:
    """Raises OutputError if Blender's own modifier would have to deform the mesh.

    taken: the Armature modifiers that Sinew replaces or would replace; sharer_count: number of objects with its mesh;
    gets_armature: see survey.if_bound.
    """
    way = ways.whatever_its_size(survey.if_bound(ob, taken, sharer_count, gets_armature))
    if way.front:
        raise OutputError(
            f"{ob.name} cannot use the output Mesh, because {way.front[0]} makes other vertices than the mesh's own. "
            "Use the output Modifier"
        )
    if not way.in_pass:
        raise OutputError(
            f"{ob.name} cannot use the output Mesh, because Blender's own modifier deforms it: "
            f"{way.reason}. Fix that first, or use the output Modifier"
        )


def find(ob: bpy.types.Object) -> bpy.types.Object | None:
    """Returns the deformed copy of a bound object, or None.

    An object whose number of vertices was changed by the user is no longer a copy.
    """
    copy = _copies.get(values.key_of(ob))
    if copy is not None and _is_whole_copy(copy, ob):
        return copy
    copy = next(filter(_is_whole, _claimants(ob)), None)
    if copy is not None:
        _copies[values.key_of(ob)] = copy
    return copy


def _is_whole_copy(copy, ob):
    try:
        return copy.sinew.copy_of == ob and _is_whole(copy)
    except ReferenceError:  # it was deleted
        return False


def _claimants(ob):
    """Returns all objects that are marked as copies of an object."""
    return [other for other in bpy.data.objects if other.library is None and other.sinew.copy_of == ob]


def forget() -> None:
    """Forgets all copies, as after load."""
    _copies.clear()


def _is_whole(copy):
    """Whether a copy still has the number of vertices that it was made with."""
    return copy.type == "MESH" and len(copy.data.vertices) == copy.sinew.copied_vertices


def let_go(copy: bpy.types.Object) -> None:
    """Makes a copy an ordinary object that stays as it is."""
    copy.sinew.copied_from = ""
    if copy.parent is not None:
        place = copy.matrix_world.copy()
        copy.parent = None
        copy.matrix_world = place


def _let_all_go(ob):
    for copy in _claimants(ob):
        let_go(copy)


def let_go_of_duplicate(copy: bpy.types.Object) -> None:
    """Lets go of an object that is a duplicate of the deformed copy: a bound object has only one."""
    if copy.library is None and find(copy.sinew.copy_of) != copy:
        let_go(copy)


def clear_orphans() -> None:
    """Removes copies whose object was deleted, and lets go of those whose parent the user has cleared."""
    for copy in [ob for ob in bpy.data.objects if ob.sinew.copied_from and ob.library is None]:
        if copy.parent is None and copy.sinew.copied_from not in bpy.data.objects:
            _remove(copy)
        elif not is_wanted_by(copy.parent):
            let_go(copy)


def is_wanted_by(ob: bpy.types.Object | None) -> bool:
    """Whether an object is bound with the output Mesh."""
    return ob is not None and ob.sinew.is_bound and ob.sinew.installed_output == "MESH"


def make(ob: bpy.types.Object) -> bpy.types.Object:
    """Makes the object's deformed copy, in the rest shape and hidden."""
    _let_all_go(ob)
    mesh = bpy.data.meshes.new_from_object(ob)  # without shape keys
    meshes.remove_attribute(mesh, nodes.POSITION_ATTRIBUTE)
    mesh.name = ob.name + SUFFIX
    copy = bpy.data.objects.new(ob.name + SUFFIX, mesh)
    copy.parent = ob
    copy.hide_viewport = copy.hide_render = True  # otherwise it would be drawn twice, at twice the cost
    _finish(copy, ob, 0)
    keep_in_collections(copy, ob)
    _copies[values.key_of(ob)] = copy
    return copy


def renew(copy: bpy.types.Object, ob: bpy.types.Object, edition: int) -> None:
    """Copies the object's current geometry and materials into its copy.

    The mesh data-block stays the same: adding or removing data-blocks in a handler would break operators that have
    Blender evaluate while they run, such as Convert in 3.4. edition: a number for the geometry.
    """
    if copy.data.library is not None:  # of an override
        copy.data = copy.data.copy()
    meshes.copy_geometry(ob.data, copy.data, without=nodes.POSITION_ATTRIBUTE)
    if list(copy.data.materials) != list(ob.data.materials):
        copy.data.materials.clear()
        for material in ob.data.materials:
            copy.data.materials.append(material)
    _finish(copy, ob, edition)


def _finish(copy, ob, edition):
    settings = copy.sinew
    settings.copied_from, settings.copied_vertices, settings.copied_edition = ob.name, len(copy.data.vertices), edition
    for mine, theirs in zip(copy.material_slots, ob.material_slots):
        mine.link = theirs.link
        if theirs.link == "OBJECT":
            mine.material = theirs.material


def keep_in_place(copy: bpy.types.Object, ob: bpy.types.Object) -> None:
    """Moves the copy to its object."""
    if copy.parent_type != "OBJECT":
        copy.parent_type = "OBJECT"
    if copy.sinew.copied_from != ob.name:
        copy.sinew.copied_from = ob.name
    identity = Matrix()
    if copy.matrix_parent_inverse != identity:
        copy.matrix_parent_inverse = identity
    if copy.matrix_world != ob.matrix_world or copy.matrix_basis != identity:
        copy.matrix_world = ob.matrix_world  # Blender does not update hidden objects
        copy.matrix_basis = identity


def keep_in_collections(copy: bpy.types.Object, ob: bpy.types.Object) -> None:
    """Links the copy to its object's editable collections, or to the scene's if there are none, and to no others."""
    wanted = set(filter(_is_open, ob.users_collection)) or {scene.collection for scene in ob.users_scene[:1]}
    present = set(filter(_is_open, copy.users_collection))
    for collection in wanted - present:
        collection.objects.link(copy)
    for collection in present - wanted if wanted else ():
        collection.objects.unlink(copy)


def _is_open(collection):
    """Whether a collection is editable."""
    return collection.library is None and collection.override_library is None


def remove(ob: bpy.types.Object) -> None:
    """Removes the object's copy, and its mesh if nothing else uses it."""
    copy = find(ob)
    if copy is not None:
        _remove(copy)
    _copies.pop(values.key_of(ob), None)
    _let_all_go(ob)


def _remove(copy):
    for collection in filter(_is_open, copy.users_collection):  # so that it is not seen until then
        collection.objects.unlink(copy)
    mail.once_handlers_are_done(_remove_object, values.key_of(copy))


def _remove_object(key):
    copy = next((ob for ob in bpy.data.objects if values.key_of(ob) == key), None)
    if copy is not None:
        mesh = copy.data
        bpy.data.objects.remove(copy)
        if mesh.users == 0 and mesh.library is None:
            bpy.data.meshes.remove(mesh)
