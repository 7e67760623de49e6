"""Tells why Sinew cannot follow a modifier that moves a mesh with the shape of another object. Only reads."""

from typing import Any

from ..host import cage_memory, contract, features
from . import runs, wiring


def why_not_followed(ob: Any, modifier: Any) -> str:
    """Returns why only Blender can evaluate a modifier of a type in wiring.SHAPES, a clause, or "". ob: original."""
    target = wiring.cage_of(modifier)
    if target is None or contract.trouble():
        return ""
    for feature in _features_of(modifier, target):
        if not contract.has(feature):
            return contract.why_not(feature)
    if any(_points_to(each, ob) for each in target.modifiers):
        return f"{target.name}, which it follows, depends on {ob.name} itself: remove one of the two"
    try:
        return _why_not_bound(ob, modifier) if modifier.type in COUNTS else ""
    except contract.Broken as broken:
        return str(broken)


def _features_of(modifier: Any, target: Any) -> list[str]:
    """Returns what has to be read by address for a modifier with that target."""
    if modifier.type != "LATTICE":
        return [{"MESH_DEFORM": features.CAGE, "SURFACE_DEFORM": features.SURFACE}[modifier.type]]
    return [features.LATTICES, *([features.WEIGHTED_LATTICES] if target.data.vertex_group else [])]


def _points_to(modifier: Any, ob: Any) -> bool:
    """Whether a setting of a modifier is that object."""
    return any(
        getattr(modifier, each.identifier) == ob for each in modifier.bl_rna.properties if each.type == "POINTER"
    )


# For the types of modifiers that have to be bound.
COUNTS = {"MESH_DEFORM": cage_memory.mesh_counts, "SURFACE_DEFORM": cage_memory.surface_counts}


def _why_not_bound(ob: Any, modifier: Any) -> str:
    if modifier.type == "MESH_DEFORM" and modifier.is_bound and modifier.use_dynamic_bind:
        return "it was bound with Dynamic, which Sinew cannot evaluate: bind it without"
    counts = COUNTS[modifier.type](modifier)
    reason = runs.why_not_bound(counts and counts.mesh, len(ob.data.vertices))
    is_old = counts is not None and not counts.target
    return reason or ("it was bound by an old version of Blender: bind this modifier again" if is_old else "")
