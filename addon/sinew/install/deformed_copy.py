"""The output Mesh: a second object whose mesh has the deformed shape in its own vertices, for scripts and exporters
that read those. The bound object is bound as with the other output, and its mesh is never written.

A copy is the child of its object and says so itself (`sinew.copied_from`): Blender sees to that pointer when either is
deleted, duplicated, joined or appended, and it keeps nothing in the file that was deleted. A bound object with this
output that has no copy gets one.
"""

import bpy
from mathutils import Matrix

from ..blender import meshes, nodes, values
from ..plan import ways

SUFFIX = ".deformed"
_copies = {}  # key of a bound object -> its copy, to be checked


class OutputError(Exception):
    """The object cannot have the output Mesh; the message says why. Nothing was changed."""


def check(ob, taken, sharer_count, gets_armature=False):
    """Raises OutputError if Blender's own modifier would have to deform the mesh. taken: the Armature modifiers that
    Sinew stands in for, or is to; sharer_count: how many objects have its mesh; gets_armature: as ways.foresee has
    it."""
    way = ways.foresee(ob, ob.data, taken, sharer_count, gets_armature=gets_armature)
    if not way.in_pass:
        raise OutputError(
            f"{ob.name} cannot use the output Mesh, because Blender's own modifier deforms it: "
            f"{way.reason}. Fix that first, or use the output Modifier"
        )


def find(ob):
    """The deformed copy of a bound object, or None: also if somebody has given its mesh more vertices or fewer, for
    then it is no copy any more."""
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
    return [other for other in bpy.data.objects if other.library is None and other.sinew.copy_of == ob]


def forget():
    _copies.clear()


def _is_whole(copy):
    return copy.type == "MESH" and len(copy.data.vertices) == copy.sinew.copied_vertices


def let_go(copy):
    """It stays as it is, an object like others."""
    copy.sinew.copied_from = ""
    if copy.parent is not None:
        place = copy.matrix_world.copy()
        copy.parent = None
        copy.matrix_world = place


def _let_all_go(ob):
    for copy in _claimants(ob):
        let_go(copy)


def let_go_of_duplicate(copy):
    """Of an object that came as the copy of another one: a bound object has one copy."""
    if copy.library is None and find(copy.sinew.copy_of) != copy:
        let_go(copy)


def clear_orphans():
    """Copies whose object was deleted go as well. One whose parent somebody has cleared is let go."""
    for copy in [ob for ob in bpy.data.objects if ob.sinew.copied_from and ob.library is None]:
        if copy.parent is None and copy.sinew.copied_from not in bpy.data.objects:
            _remove(copy)
        elif not is_wanted_by(copy.parent):
            let_go(copy)


def is_wanted_by(ob):
    return ob is not None and ob.sinew.is_bound and ob.sinew.installed_output == "MESH"


def make(ob):
    """The object's deformed copy, in its rest shape, hidden."""
    _let_all_go(ob)
    mesh = bpy.data.meshes.new_from_object(ob)  # without shape keys
    meshes.remove_attribute(mesh, nodes.POSITION_ATTRIBUTE)
    mesh.name = ob.name + SUFFIX
    copy = bpy.data.objects.new(ob.name + SUFFIX, mesh)
    copy.parent = ob
    copy.hide_viewport = copy.hide_render = True  # it would be seen twice, and cost as much
    _finish(copy, ob, 0)
    keep_in_collections(copy, ob)
    _copies[values.key_of(ob)] = copy
    return copy


def renew(copy, ob, edition):
    """The original's geometry as it is now, in the same data-block: a handler that made or removed data-blocks would
    spoil operators that have Blender evaluate in between, such as Convert in 3.4. edition: a number for it."""
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


def keep_in_place(copy, ob):
    """Where the object is."""
    if copy.parent_type != "OBJECT":
        copy.parent_type = "OBJECT"
    if copy.sinew.copied_from != ob.name:
        copy.sinew.copied_from = ob.name
    identity = Matrix()
    if copy.matrix_parent_inverse != identity:
        copy.matrix_parent_inverse = identity
    if copy.matrix_world != ob.matrix_world or copy.matrix_basis != identity:
        copy.matrix_world = ob.matrix_world  # Blender itself does not move what is hidden
        copy.matrix_basis = identity


def keep_in_collections(copy, ob):
    """Those of the object that may be changed; else that of the scene."""
    wanted = set(filter(_is_open, ob.users_collection)) or {scene.collection for scene in ob.users_scene[:1]}
    present = set(filter(_is_open, copy.users_collection))
    for collection in wanted - present:
        collection.objects.link(copy)
    for collection in present - wanted if wanted else ():
        collection.objects.unlink(copy)


def _is_open(collection):
    return collection.library is None and collection.override_library is None


def remove(ob):
    """The object's copy, with its mesh if nobody else has that."""
    copy = find(ob)
    if copy is not None:
        _remove(copy)
    _copies.pop(values.key_of(ob), None)
    _let_all_go(ob)


def _remove(copy):
    mesh = copy.data
    bpy.data.objects.remove(copy)
    if mesh.users == 0 and mesh.library is None:
        bpy.data.meshes.remove(mesh)
