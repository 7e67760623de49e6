"""Reads the situation of an object, from which a plan is made. Only reads."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from typing import Any

import bpy

from ..blender import animation, armatures, meshes, modifier_types, nodes, values
from ..host import contract, evaluations, features, mesh_arrays
from . import animated, cages, canvas_survey, driven, fronts, mends, plans, runs, tails, ways, wiring
from .situation import Hook, Keys, Modifier, Situation

# Parent types that only transform the mesh; the others deform it.
PLACING_PARENTS = {"OBJECT", "BONE", "VERTEX", "VERTEX_3"}
# Since 5.0, Blender adds a new Hook before all modifiers that do more than deform, as ever those of ONLY_BEHIND.
COMES_FIRST = modifier_types.ONLY_BEHIND_DEFORMING | ({"HOOK"} if values.VERSION >= (5, 0, 0) else set())
# Why a later Armature modifier is left to Blender.
FOLLOWS_SHAPE = "its weights depend on the shape before it: turn its bone envelopes off, and map its B-bones straight"
LIKENESS = "object", "subtarget", "strength", "falloff_type", "falloff_radius", "vertex_group"


def of(
    ob: bpy.types.Object, around: canvas_survey.Surroundings | None = None, moves_against_armature: bool = False
) -> Situation:
    """Returns the situation of a bound mesh object.

    ob: original or evaluated; an evaluated copy may be older than its original. around: its surroundings; None, in the
    main thread: read them, as if no other object had its mesh; moves_against_armature: whether mesh and armature were
    seen to move relative to each other from frame to frame.
    """
    carrier = wiring.carrier_of(ob)
    taken = wiring.taken_modifiers(ob)
    return _read(ob, carrier, taken, around or canvas_survey.surroundings_of(ob, 1), moves_against_armature)


def of_evaluated(
    ob: bpy.types.Object, around: canvas_survey.Surroundings, moves_against_armature: bool
) -> tuple[Situation, Situation]:
    """Returns the situation of an evaluated copy of a bound mesh object and that of its original, which may be newer.
    They differ in what has the hook and what it waits for."""
    file = of(ob.original, around, moves_against_armature)
    carrier = wiring.carrier_of(ob)
    if tuple(modifier.name for modifier in wiring.taken_modifiers(ob)) != file.taken:
        return of(ob, around, moves_against_armature), file
    return replace(file, hook=_hook(ob, carrier)), file


def if_bound(
    ob: bpy.types.Object, taken: Sequence[bpy.types.Modifier] = (), sharer_count: int = 1, gets_armature: bool = False
) -> Situation:
    """Returns the situation in which a mesh object would be if it were bound.

    ob: original; taken: the Armature modifiers that Sinew would replace; sharer_count: number of objects with its mesh;
    gets_armature: the mesh has none, but would get one as its first modifier.
    """
    around = canvas_survey.surroundings_of(ob, sharer_count)
    return _read(ob, None, taken, around, False, is_bound=False, gets_armature=gets_armature)


def _read(
    ob: bpy.types.Object,
    carrier: Any,
    taken: Sequence[bpy.types.Modifier],
    around: canvas_survey.Surroundings,
    moves_against_armature: bool,
    **more: bool,
) -> Situation:
    original = ob.original
    mesh = original.data
    names = tuple(modifier.name for modifier in taken)
    modifiers = _modifiers(ob, names)
    front = [modifier.name for modifier in fronts.of(modifiers, names)]
    may_take_all = (
        bool(front)
        or any(not each.tail_trouble for each in modifiers)
        or around.sharer_count > 1
        and mesh.shape_keys is None
    )
    asks_for_shape = bool(taken) and (moves_against_armature or mesh.shape_keys is not None)
    found = Situation(
        values.key_of(mesh),
        len(mesh.vertices),
        modifiers,
        names,
        _hook(ob, carrier),
        _keys(original, mesh.shape_keys),
        sharer_count=around.sharer_count,
        front_trouble=canvas_survey.front_trouble(original, around) if may_take_all else "",
        tail=around.tail,
        is_followed=around.is_followed,
        generated_in=around.generated_in,
        deforming_parent=(
            "" if original.parent is None or original.parent_type in PLACING_PARENTS else original.parent.name
        ),
        moves_against_armature=moves_against_armature,
        weights_follow_shape=asks_for_shape and weights_follow_shape(original, names),
        wants_more=wants_more(original.sinew),
        has_attribute=meshes.point_attribute(mesh, nodes.POSITION_ATTRIBUTE) is not None,
        is_linked=original.library is not None,
        misses_bones=original.library is not None and not waits_for_bones(original, wiring.find_hook(original), names),
        is_mesh_linked=mesh.library is not None,
        is_canvas_slow=values.VERSION < (4, 0, 0),
        may_be_single_user=may_be_single_user(original),
        trouble=lacks_own_shape(original) or contract.trouble(),
        key_trouble=contract.why_not(features.KEYS),
        attribute_trouble=contract.why_not(features.ATTRIBUTES),
        animation_trouble=_animation_trouble(original),
        tells_renders=evaluations.is_mode_known(),
        **more,
    )
    tail = ways.tail_of(found)
    canvas = canvas_survey.canvas_of(original, front, tail, around)
    if canvas is None:
        return found
    copied = values.key_of(canvas.data) if canvas.data != mesh else None
    return replace(found, canvas=values.key_of(canvas), copied=copied)


def _animation_trouble(ob: bpy.types.Object) -> str:
    """Returns what animation may change without an edit of what Sinew reads once of an original object, its mesh and
    its shape keys, and what to do, a sentence; "" for nothing."""
    blocks = (ob, "OBJECT"), (ob.data, "MESH"), (ob.data.shape_keys, "KEY")
    return next(filter(None, (animated.why(*each) for each in blocks)), "")


def animation_troubles(ob: bpy.types.Object) -> frozenset[str]:
    """Returns `animation_troubles` of the situation of an original object."""
    data = (armature.data for armature in armatures.of_modifiers(ob))
    found = _animation_trouble(ob), *(animated.why(each, "ARMATURE") for each in data)
    return frozenset(filter(None, found))


def _modifiers(ob: bpy.types.Object, taken: Collection[str]) -> tuple[Modifier, ...]:
    """Returns the modifiers of an object. taken: names of the Armature modifiers with which Sinew begins."""
    original = ob.original
    paths = animation.animated_paths(original)
    return tuple(_modifier(original, each, _below(each, paths), each.name in taken) for each in original.modifiers)


def _below(modifier: bpy.types.Modifier, paths: Iterable[str]) -> list[str]:
    """Returns those of the paths that lead to properties of a modifier, from there on."""
    start = wiring.path_of(modifier, "")
    return [path.removeprefix(start) for path in paths if path.startswith(start)]


def _modifier(ob: bpy.types.Object, modifier: Any, paths: list[str], is_taken: bool) -> Modifier:
    """Reads one modifier. ob: original; paths: its properties that drivers or keyframes set; is_taken: an Armature
    modifier with which Sinew begins."""
    is_own = nodes.is_sinew(modifier)
    kind = modifier.type
    curves = wiring.drivers_of_settings(ob, modifier) if paths else []
    switches = [curve for curve in curves if wiring.sets_switch(curve)]
    more: dict[str, Any] = {}
    if kind == "ARMATURE":
        target = modifier.object
        trouble = animated.why(target.data, "ARMATURE") if target is not None else ""
        follows = FOLLOWS_SHAPE if not is_taken and weights_follow_shape(ob, [modifier.name]) else ""
        more = {
            "lacks_target": target is None,
            "awaits": target and (values.key_of(target), ""),
            "binds": (modifier.use_vertex_groups, modifier.use_bone_envelopes),
            "is_mixed": modifier.use_multi_modifier,
            "may_be_mixed": "use_multi_modifier" in paths,
            "animation_trouble": trouble,
            "trouble": follows or _why_not_steady(modifier, paths) or trouble,
        }
    elif kind == "HOOK":
        more = {
            "lacks_target": modifier.object is None,
            "awaits": awaited_by(modifier),
            "picks_by_index": len(modifier.vertex_indices) > 0,
            "likeness": tuple(getattr(modifier, name) for name in LIKENESS),
            "trouble": "Sinew cannot evaluate its falloff curve" if modifier.falloff_type == "CURVE" else "",
        }
    elif kind in modifier_types.CAGES:
        more = {
            "lacks_target": wiring.cage_of(modifier) is None,
            "awaits": awaited_by(modifier),
            "trouble": cages.why_not_followed(ob, modifier),
        }
    elif kind == "CORRECTIVE_SMOOTH":
        reads_binding = modifier.rest_source == "BIND" and not modifier.use_only_smooth
        unread = contract.why_not(features.BOUND) if reads_binding else ""
        more = {"trouble": why_not_bound(ob, modifier) or unread}
    elif kind in modifier_types.BESIDE_SHAPE | modifier_types.READING_SHAPE:
        more = _beside_shape(ob, modifier)
    return Modifier(
        modifier.name,
        kind,
        _title(modifier, kind),
        nodes.identity(modifier),
        is_own,
        is_own and nodes.has_old_group(modifier),
        (modifier.show_viewport, modifier.show_render),
        not set(wiring.SHOWS).isdisjoint(paths),
        frozenset((values.key_of(ob), curve.data_path) for curve in switches),
        tuple(driven.read(modifier, curve) for curve in curves if curve not in switches),
        is_fixed=not nodes.is_removable(ob, modifier),
        comes_first=kind in COMES_FIRST,
        is_animated=bool(paths) and paths != [wiring.CARRIER],
        front_trouble=canvas_survey.why_not_in_front(modifier) if kind in modifier_types.FRONTS else "",
        tail_trouble=tails.why_not(modifier, bool(paths)) or tails.why_not_for_now(modifier),
        reads_canvas=is_own and nodes.reads_canvas(modifier),
        reads_front=is_own and nodes.reads_front(modifier),
        canvas=_canvas_read_by(modifier) if is_own else None,
        **more,
    )


def _beside_shape(ob: bpy.types.Object, modifier: Any) -> dict[str, Any]:
    """Reads what a modifier needs that changes no positions. ob: original."""
    kind = modifier.type
    if kind == "DATA_TRANSFER" and modifier.use_vert_data and "VGROUP_WEIGHTS" in modifier.data_types_verts:
        return {}  # it may add and change any vertex group
    named = modifier_types.CHANGED_GROUPS.get(kind)
    changed = getattr(modifier, named) if named else ""
    has_texture = named is not None and modifier.mask_texture is not None
    return {
        "keeps_shape": True,
        "reads_shape": kind in modifier_types.READING_SHAPE or has_texture and modifier.mask_tex_mapping != "UV",
        "feeds": changed if changed and changed in _deforming_groups(ob) else "",
    }


def _deforming_groups(ob: bpy.types.Object) -> set[str]:
    """Returns the names of vertex groups by which modifiers deform a mesh that Sinew could replace. ob: original."""
    names = {ob.sinew.skinning.smooth_group}
    for modifier in ob.modifiers:
        if modifier.type == "ARMATURE" and modifier.object is not None:
            names.update(bone.name for bone in modifier.object.data.bones)
        if modifier.type in modifier_types.STAGES:
            names.add(modifier.vertex_group)
    return names


def _canvas_read_by(modifier: bpy.types.Modifier) -> int | None:
    """Returns the key of the canvas that Sinew's modifier reads, or None."""
    canvas = nodes.canvas_of(modifier)
    return canvas and values.key_of(canvas)


def _why_not_steady(modifier: Any, animated: Iterable[str]) -> str:
    """Returns why Sinew cannot follow an Armature modifier whose settings are animated, a sentence, or "". Which of
    groups and envelopes it uses is read after edits only."""
    found = [name for name in animated if name in {*wiring.BINDS, "use_multi_modifier"}]
    return f"{modifier.bl_rna.properties[found[0]].name} of {modifier.name} is animated: remove that" if found else ""


_titles: dict[str, str] = {}  # of types of modifiers


def _title(modifier: bpy.types.Modifier, kind: str) -> str:
    if kind not in _titles:
        _titles[kind] = modifier_types.title(modifier)
    return _titles[kind]


def awaited_by(modifier: Any) -> tuple[int, str] | None:
    """Returns (key of an object, name of a bone, property in wiring.SHAPES or "") that a modifier which Sinew replaces
    needs, or None. A bone that does not exist is left out (""): a driver that waited for it would become invalid."""
    if modifier.type == "ARMATURE":
        return modifier.object and (values.key_of(modifier.object), "")
    followed = wiring.followed(modifier)
    return followed and (values.key_of(followed[0]), followed[1])


def why_not_bound(ob: bpy.types.Object, modifier: bpy.types.Modifier) -> str:
    """Returns why a Corrective Smooth with rest source Bind has no bound positions of this mesh, or "", also if that
    cannot be told in this Blender.

    With Only Smooth it needs none, but Blender can only bind what it evaluates itself.
    """
    if modifier.type != "CORRECTIVE_SMOOTH" or modifier.rest_source != "BIND":
        return ""
    if not modifier.is_bind:
        return runs.why_not_bound(None, len(ob.data.vertices))
    if modifier.use_only_smooth:
        return ""
    if not contract.has(features.BOUND):
        return ""
    return runs.why_not_bound(mesh_arrays.bound_count(modifier), len(ob.data.vertices))


def waits_for_targets(ob: bpy.types.Object, plan: plans.Plan) -> bool:
    """Whether the hook still waits for everything that the modifiers follow which the plan replaces. True if there is
    no hook at the plan's path. ob: original."""
    curve = plan.hook_of(ob)
    if curve is None:
        return True
    names = [name for name in plan.replaced if name in ob.modifiers]
    waits = wiring.waits_of(curve)
    hook = Hook(plan.hook_path, targets=waits.targets, has_lost_target=waits.has_lost_target)
    return mends.waits_for(hook, (awaited_by(ob.modifiers[name]) for name in names))


def waits_for_bones(ob: bpy.types.Object, hook: Any, names: Iterable[str]) -> bool:
    """Whether a hook waits for all bones by which Armature modifiers of these names move a mesh, as it does when it is
    wired; constraints may have been edited since. True if there is none. ob: original."""
    modifiers = (ob.modifiers[name] for name in names if name in ob.modifiers)
    return hook is None or all(
        wiring.still_waits(hook, each.object, None if each.use_bone_envelopes else ob.vertex_groups.keys())
        for each in modifiers
        if each.type == "ARMATURE" and each.object is not None
    )


def may_go_on(ob: bpy.types.Object, plan: plans.Plan) -> bool:
    """Whether the plan's run would no longer end, after an edit of bones, at the Armature modifier at which it ends.
    ob: original."""
    return FOLLOWS_SHAPE in plan.run.reason and FOLLOWS_SHAPE not in runs.of(of(ob)).reason


def _hook(ob: bpy.types.Object, carrier: bpy.types.Modifier | None) -> Hook | None:
    """Reads the hook of an object. carrier: the modifier that has it, or None."""
    if carrier is None:
        return None
    curve = wiring.hook_of(ob, carrier)
    mesh, keys, canvas, copied = (wiring.waits_for(curve, name) for name in ("mesh", "keys", "canvas", "copied"))
    waits = wiring.waits_of(curve)
    return Hook(
        wiring.path_of(carrier),
        carrier.name,
        mesh and values.key_of(mesh),
        keys and values.key_of(keys),
        waits.targets,
        waits.has_lost_target,
        waits.awaited,
        canvas=canvas and values.key_of(canvas),
        copied=copied and values.key_of(copied),
        driven=waits.driven,
    )


def _keys(ob: bpy.types.Object, keys: bpy.types.Key | None) -> Keys | None:
    """Reads the shape keys of an original object."""
    if keys is None:
        return None
    return Keys(values.key_of(keys), len(keys.key_blocks), keys.use_relative, ob.show_only_shape_key)


def weights_follow_shape(ob: bpy.types.Object, taken: Iterable[str]) -> bool:
    """Whether weights depend on vertex positions in a way that Sinew evaluates only once.

    That is so for envelopes, and for B-bones whose segments are assigned along their curve. ob: original; taken: names
    of Armature modifiers.
    """
    modifiers = [ob.modifiers[name] for name in taken]
    return any(
        modifier.use_bone_envelopes
        or any(name in ob.vertex_groups for name in armatures.following_shape(modifier.object.data))
        for modifier in modifiers
        if modifier.object is not None
    )


def lacks_own_shape(ob: Any) -> str:
    """Returns why a bound object has another shape than Sinew would give it, a sentence for users, or "". Blender's own
    modifiers lack its method, or its smoothing. ob: original."""
    trouble = contract.trouble()
    if not trouble or not ob.sinew.is_bound:
        return ""
    if not ob.sinew.own_method and ob.sinew.skinning.smooth_iterations == 0:
        return ""
    return f"The shape of {ob.name} lacks its method or smoothing, which Blender does not have. {trouble}"


def wants_more(settings: Any) -> bool:
    """Whether an object uses something that Blender's modifiers and shape keys cannot do, or do slowly. settings: those
    of the add-on."""
    return (
        bool(settings.own_method)
        or settings.skinning.smooth_iterations > 0
        or settings.installed_output == "MESH"
        or settings.source == "CLIP"
    )


def may_be_single_user(ob: bpy.types.Object) -> bool:
    """Whether the object can be given its own copy of its mesh. ob: original."""
    return ob.library is None and ob.data.library is None
