"""Chooses the path of a bound mesh: through an attribute, through its shape keys, or Blender's own modifier.

Sinew deforms in the pass in which Blender evaluates the mesh, so it has to know the Armature modifier's input without
Blender. Where it does not, Blender's own modifier deforms, in the same pass.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..blender import animation, armatures, modifier_types, nodes
from ..host import contract
from . import runs, wiring

ATTRIBUTE, KEYS, BLENDER = "ATTRIBUTE", "KEYS", "BLENDER"
# Blender allows only deforming modifiers before these.
WANTS_DEFORM_ONLY = {"MULTIRES", "SOFT_BODY"}
# A node group has a fixed cost, so with fewer vertices Blender's own modifier is faster.
# Measured: docs/speed.md, Small meshes.
FEWEST_VERTICES = {ATTRIBUTE: 3_000, KEYS: 500}
# Parent types that only transform the mesh; the others deform it.
PLACING_PARENTS = {"OBJECT", "BONE", "VERTEX", "VERTEX_3"}


@dataclass(frozen=True)
class Way:
    """The path of a mesh."""

    kind: str
    reason: str = ""  # of BLENDER, a sentence for users
    wants_keys: bool = False  # it would take the path through shape keys if it had any

    @property
    def in_pass(self) -> bool:
        """Whether Sinew deforms, in Blender's pass."""
        return self.kind in {ATTRIBUTE, KEYS}


def choose(ob: Any, mesh: Any, sharer_count: int, moves_against_armature: bool = False) -> Way:
    """Returns the path of a bound mesh object.

    ob: original or evaluated; mesh: its own mesh; sharer_count: number of objects with that mesh;
    moves_against_armature: whether mesh and armature were seen to move relative to each other from frame to frame.
    """
    carrier = wiring.carrier_of(ob)
    if carrier is None or carrier.type == "ARMATURE" and ob.original.modifiers[carrier.name].object is None:
        return Way(BLENDER, "Its armature is gone: choose another one, or unbind")
    taken = [ob.original.modifiers[modifier.name] for modifier in wiring.taken_modifiers(ob)]
    way = foresee(ob, mesh, taken, sharer_count, moves_against_armature)
    fewest = FEWEST_VERTICES.get(way.kind, 0)
    if len(mesh.vertices) < fewest and not _asks_for_sinew(ob.original, taken):
        return Way(BLENDER, f"It has fewer than {fewest:,} vertices, which Blender's own modifier deforms sooner")
    return way


def _asks_for_sinew(ob: Any, taken: Sequence[Any]) -> bool:
    """Whether the object uses something that Blender's modifiers and shape keys cannot do, or do slowly. ob:
    original."""
    settings = ob.sinew
    return (
        bool(settings.own_method)
        or settings.skinning.smooth_iterations > 0
        or settings.installed_output == "MESH"
        or settings.source == "CLIP"
        or bool(runs.of(ob, tuple(modifier.name for modifier in taken)).stages)
    )


def foresee(
    ob: Any,
    mesh: Any,
    taken: Sequence[Any],
    sharer_count: int,
    moves_against_armature: bool = False,
    gets_armature: bool = False,
) -> Way:
    """Returns the path that a mesh would take if it were bound, whatever its number of vertices.

    taken: the Armature modifiers that Sinew would replace; gets_armature: the mesh has none, but would get one as its
    first modifier. The other arguments are those of `choose`.
    """
    if contract.trouble():
        return Way(BLENDER, contract.trouble())
    for modifier in ob.original.modifiers:
        if modifier in taken[:1] or not taken:
            break
        if not nodes.is_sinew(modifier) and wiring.is_shown(modifier):
            return Way(BLENDER, _why_not_first(ob.original, modifier, taken[0]))
    idle = _why_by_parent(ob.original) or ("" if taken or gets_armature else why_idle(ob.original))
    if idle:
        return Way(BLENDER, f"It {idle}")
    driven = wiring.driven_settings(ob, taken)
    if driven:
        return Way(BLENDER, f"{driven[0]} of its Armature modifier is driven, and the driver may run too late")
    switched = [modifier.name for modifier in taken if wiring.is_switched(ob.original, modifier)]
    if switched:
        return Way(
            BLENDER,
            f"{switched[0]} is switched by drivers or keyframes, but Sinew has to switch it itself: remove them",
        )
    unlike = [modifier.name for modifier in taken if wiring.shown_of(ob, modifier) != wiring.shown_of(ob, taken[0])]
    if unlike:
        return Way(
            BLENDER,
            f"{taken[0].name} and {unlike[0]} are mixed, but their switches for viewport and renders differ: set them "
            "alike",
        )
    if sharer_count > 1:
        advice = ": make it single-user" if may_be_single_user(ob.original) else ""
        return Way(
            BLENDER, f"{sharer_count} objects share this mesh, and Blender evaluates them at the same time{advice}"
        )
    if (moves_against_armature or mesh.shape_keys is not None) and depends_on_shape(ob, taken):
        what = "Its shape keys move vertices" if mesh.shape_keys else "Mesh and armature move against each other"
        return Way(BLENDER, f"{what}, so the weights from envelopes or curved B-bones change on each frame")
    if mesh.shape_keys is not None:
        return _through_keys(ob.original, mesh.shape_keys, taken)
    for modifier in ob.original.modifiers:
        if modifier.type in WANTS_DEFORM_ONLY:
            return Way(
                BLENDER,
                f"{modifier.name} allows only deforming modifiers before it: add a shape key, and Sinew uses that",
                wants_keys=True,
            )
    stages = runs.of(ob, tuple(modifier.name for modifier in taken)).stages
    for modifier in ob.original.modifiers:
        if _picks_by_number(modifier) and modifier.name not in stages:
            return Way(
                BLENDER,
                f"{modifier.name} picks vertices by index, and Blender mixes these up behind Sinew's modifier: add a "
                "shape key, and Sinew uses that",
                wants_keys=True,
            )
    return Way(ATTRIBUTE)


def _why_not_first(ob: Any, modifier: Any, first: Any) -> str:
    """Returns why no modifier may come before the first one that Sinew replaces, and what to do. ob: original."""
    is_of_library = ob.library is not None or ob.override_library is not None and modifier.is_override_data
    where = ", in the library" if is_of_library else ""
    return (
        f"{modifier_types.name_and_title(modifier)} comes before {first.name}, with which Sinew has to begin: move "
        f"{modifier.name} behind {first.name} if the shape may be made in that order{where}"
    )


def may_be_single_user(ob: Any) -> bool:
    """Whether the object can be given its own copy of its mesh. ob: original."""
    return ob.library is None and ob.data.library is None


def _picks_by_number(modifier: Any) -> bool:
    """Whether it is an active Hook modifier that selects vertices by index."""
    return (
        modifier.type == "HOOK"
        and modifier.object is not None
        and wiring.is_shown(modifier)
        and len(modifier.vertex_indices) > 0
    )


def why_idle(ob: Any) -> str:
    """Returns why Sinew can replace nothing on a mesh without an armature, or "".

    The result is a sentence without its subject.
    """
    by_parent = _why_by_parent(ob)
    if by_parent:
        return by_parent
    run = runs.of(ob, ())
    keys = ob.data.shape_keys
    if run.stages or keys is not None and len(keys.key_blocks) > 1:
        return ""
    nothing = "has no armature, shape keys or smoothing that Sinew could take over: add one of them"
    return f"{nothing} ({run.end} comes first, and {run.reason})" if run.end else nothing


def _why_by_parent(ob: Any) -> str:
    """Returns why the parent prevents Sinew from deforming the mesh, a sentence without its subject, or ""."""
    if ob.parent is None or ob.parent_type in PLACING_PARENTS:
        return ""
    return f"is deformed by its parent {ob.parent.name} directly, before any modifier"


def depends_on_shape(ob: Any, taken: Sequence[Any]) -> bool:
    """Whether weights depend on vertex positions in a way that Sinew evaluates only once.

    That is so for envelopes, and for B-bones whose segments are assigned along their curve.
    """
    groups = {group.name for group in ob.original.vertex_groups}
    return any(
        modifier.use_bone_envelopes
        or any(
            bone.use_deform
            and bone.name in groups
            and (bone.use_envelope_multiply or bone.bbone_segments > 1 and armatures.is_curved(bone))
            for bone in modifier.object.data.bones
        )
        for modifier in taken
        if modifier.object is not None
    )


def _through_keys(ob: Any, keys: Any, taken: Sequence[Any]) -> Way:
    """Returns the path of a mesh with shape keys."""
    if not keys.use_relative:
        return Way(BLENDER, "Its shape keys are absolute, which Sinew cannot blend: make them relative")
    if ob.show_only_shape_key:
        return Way(BLENDER, "Only the active shape key is shown: turn that off")
    if animation.is_muting_animated(keys):
        return Way(BLENDER, "A shape key is muted by drivers or keyframes: animate its value instead")
    if any(modifier.show_viewport != modifier.show_render for modifier in taken):
        return Way(
            BLENDER,
            "Its Armature modifier is shown only in the viewport or only in renders, which Sinew cannot tell apart on "
            "a mesh with shape keys: show it in both",
        )
    if taken and not wiring.is_shown(taken[0]):
        return Way(BLENDER, _why_off(ob, taken[0]))
    return Way(KEYS)


def _why_off(ob: Any, modifier: Any) -> str:
    """Returns why an Armature modifier is switched off, or what to do."""
    cache = next((each for each in ob.modifiers if each.type in modifier_types.CACHES and wiring.is_shown(each)), None)
    if cache is not None:
        return f"{cache.name} plays a cache in place of {modifier.name}, which is switched off"
    return f"{modifier.name} is switched off: switch it on"
