"""Which modifiers make vertices as fixed weighted sums of those before them: those of a tail."""

import hashlib
from collections.abc import Iterable, Sequence
from typing import Any

import bpy

from ..blender import animation, dependencies, meshes, modifier_types, modifiers, nodes
from ..host import deform_verts, modifier_memory

# Without one of these it is not worth the search for a bake: the others cost Blender little.
_DEAR = {"ARRAY", "EDGE_SPLIT", "MIRROR", "SUBSURF"}
# Attributes of the mesh on which the sums may depend.
READ = {"crease_edge", "crease_vert", "sharp_edge", "sharp_face", "material_index"}


def of(ob: bpy.types.Object) -> list[bpy.types.Modifier]:
    """Returns the last modifiers that the viewport shows, if all of them are such and it is worth it; otherwise none.
    ob: an original mesh object."""
    shown: list[Any] = [modifier for modifier in ob.modifiers if modifier.show_viewport]
    found: list[bpy.types.Modifier] = []
    while shown and not why_not(shown[-1], bool(animation.animated_properties(ob, shown[-1]))):
        found.insert(0, shown.pop())
    while found and shown and shown[-1].type in modifier_types.DEFERRED:
        shown.append(found.pop(0))
    if animation.animated_paths(ob.data) or not any(modifier.type in _DEAR for modifier in found):
        return []
    return found


def needs_quads(tail: Sequence[bpy.types.Modifier]) -> bool:
    """Whether a tail makes the same in each shape only if no face before it has more than four corners."""
    first: Any = next((modifier.type for modifier in tail if modifier.type in {"TRIANGULATE", "SUBSURF"}), "")
    return first == "TRIANGULATE"


def reader_of(ob: bpy.types.Object) -> bpy.types.ID | None:
    """Returns another data-block that may read what the modifiers of an original object make, or None. It may read the
    object or a collection that has it."""
    holders: list[Any] = [ob]
    for holder in holders:
        for user in bpy.data.user_map(subset=[holder])[holder]:
            if isinstance(user, bpy.types.Collection):
                holders += [user] if user not in holders else []
            elif not isinstance(user, bpy.types.Scene) and user != ob and not _is_canvas(user):
                return user
    return None


def followed(objects: Sequence[bpy.types.Object]) -> list[bpy.types.Object]:
    """Returns those of the original mesh objects whose evaluated vertices other objects or node groups may read: in a
    viewport, Blender makes the vertices of their last Subdivision on each frame."""
    users = bpy.data.user_map(subset=objects) if objects else {}
    return [ob for ob in objects if any(_may_read(user, ob) for user in users[ob])]


def _may_read(user: Any, ob: bpy.types.Object) -> bool:
    if not isinstance(user, bpy.types.Object):
        return isinstance(user, bpy.types.GeometryNodeTree)
    if user == ob or _is_canvas(user) or user.sinew.copy_of == ob:
        return False
    if user.parent == ob and user.parent_type.startswith("VERTEX"):
        return True
    if any(each.type == "NODES" or ob in modifiers.settings_of(each).values() for each in user.modifiers):
        return True
    owners = user, *(user.pose.bones if user.pose is not None else ())
    constraints = map(dependencies.constraints_of, owners)
    return any(_reads_vertices(each, ob) for own in constraints for each in own)


def _reads_vertices(constraint: Any, ob: bpy.types.Object) -> bool:
    if getattr(constraint, "target", None) != ob:
        return False
    return constraint.type == "SHRINKWRAP" or bool(getattr(constraint, "subtarget", ""))


def _is_canvas(block: Any) -> bool:
    return isinstance(block, bpy.types.Object) and nodes.is_canvas(block)


def digest(ob: bpy.types.Object, names: Iterable[str]) -> str:
    """Returns a digest of what the sums of these modifiers of an original object depend on: neither positions nor
    Simplify. The modifiers come right behind others that keep the vertices."""
    mesh: Any = ob.data
    tail = [ob.modifiers.get(name) for name in names]
    if None in tail:
        return ""
    found = hashlib.blake2b(repr([(each.type, modifiers.content_of(each)) for each in tail]).encode(), digest_size=16)
    arrays = [*meshes.read_topology(mesh)]
    for name in sorted(READ & set(mesh.attributes.keys())):
        arrays.append(meshes.read_values(mesh.attributes[name]))
        found.update(name.encode())
    if any(each.type == "MASK" for each in tail):
        arrays += meshes.read_weights(mesh)
        found.update(repr(deform_verts.group_names(mesh)).encode())
    for array in arrays:
        found.update(repr((array.shape, array.dtype.str)).encode())
        found.update(array.tobytes())
    return found.hexdigest()


def is_alike_in_renders(tail: Iterable[Any], render: bpy.types.RenderSettings) -> bool:
    """Whether modifiers of a tail make the same in renders as in viewports. render: of the scene."""
    has_levels = [each for each in tail if each.type == "SUBSURF"]
    is_simplified_alike = not render.use_simplify or render.simplify_subdivision == render.simplify_subdivision_render
    return not has_levels or is_simplified_alike and all(each.levels == each.render_levels for each in has_levels)


def why_not(modifier: Any, is_animated: bool) -> str:
    """Returns why what a modifier makes is no fixed weighted sum, a clause, or ""."""
    kind = modifier.type
    if kind not in modifier_types.TAILS:
        return "its result is no weighted sum of the vertices before it"
    if not modifier_memory.can_copy():
        return "Sinew cannot copy it in this Blender"
    if is_animated:
        return "it is animated"
    used = next((each for each in modifiers.settings_of(modifier).values() if isinstance(each, bpy.types.ID)), None)
    return f"it names {used.name}, which may move: clear that field" if used is not None else _REASONS[kind](modifier)


def why_not_for_now(modifier: Any) -> str:
    """Returns why the result of a modifier of an original object is not only its vertices, or not there, a clause, or
    ""."""
    if modifier.type in modifier_types.TAILS and modifier_memory.can_put_aside() and modifier_memory.is_aside(modifier):
        return "an exporter has switched it off for a while"
    if modifier.type == "TRIANGULATE" and modifier.keep_custom_normals:
        return "it keeps normals, which depend on the shape: switch Keep Normals off"
    if modifier.type == "SUBSURF" and modifier.use_custom_normals and modifier.id_data.data.has_custom_normals:
        return "it makes custom normals, which depend on the shape: switch Use Custom Normals off"
    if modifier.type == "MIRROR" and modifier.id_data.data.has_custom_normals:
        return f"it makes custom normals, which depend on the shape{_or_in_front(modifier, ': ')}"
    return ""


def _mask(modifier: Any) -> str:
    return "" if modifier.mode == "VERTEX_GROUP" else "which bones it masks depends on the selection"


def _edge_split(modifier: Any) -> str:
    return "it splits edges by their angle: switch Edge Angle off" if modifier.use_edge_angle else ""


def _triangulate(modifier: Any) -> str:
    is_fixed = modifier.quad_method in {"FIXED", "FIXED_ALTERNATE"}
    return "" if is_fixed else "it cuts quads by their shape: set Quad Method to Fixed"


def _mirror(modifier: Any) -> str:
    return _dependent(modifier, {"Merge": modifier.use_mirror_merge, "Bisect": any(modifier.use_bisect_axis)})


def _array(modifier: Any) -> str:
    if modifier.fit_type != "FIXED_COUNT":
        return "how many copies it makes is no fixed number: set Fit Type to Fixed Count"
    if modifier.use_object_offset:
        return "it depends on another object: switch Object Offset off"
    if modifier.use_relative_offset:
        return "Relative Offset depends on the shape: use Constant Offset"
    return _dependent(modifier, {"Merge": modifier.use_merge_vertices})


def _dependent(modifier: Any, named: dict[str, bool]) -> str:
    """Returns which setting makes the result depend on the shape, a clause, or "". named: name -> whether it is on."""
    name = next((name for name, is_on in named.items() if is_on), "")
    return f"{name} depends on the shape: switch {name} off{_or_in_front(modifier, ', or ')}" if name else ""


def _or_in_front(modifier: Any, joined: str) -> str:
    """Returns the advice to move a modifier where it would be evaluated once, if that is possible."""
    ob = modifier.id_data
    may_be_front = ob.data.shape_keys is None and any(each.type == "ARMATURE" for each in ob.modifiers)
    return f"{joined}put the modifier before the armature's" if may_be_front else ""


_REASONS = {
    "ARRAY": _array,
    "EDGE_SPLIT": _edge_split,
    "MASK": _mask,
    "MIRROR": _mirror,
    "SUBSURF": lambda _modifier: "",
    "TRIANGULATE": _triangulate,
}
