"""The weights of a mesh in the bones of its armature as a table with a column for each bone: read, and written in one
go. What is not in the table keeps its entries, with their order."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..blender import meshes, weight_writing
from ..deform import influences
from ..plan import bindable, wiring
from . import reports, solid
from .entries import Entries, differ


@dataclass(frozen=True)
class Table:
    """Weights of a mesh object."""

    names: tuple[str, ...]  # of the bones
    weights: Any  # a sinew_native.WeightTable, V x B; a vertex that is twice in a group has the sum
    locked: np.ndarray  # (B,) bool: the groups that stay
    entries: Entries  # all that the object has, as `in_groups` returns them

    @property
    def locked_names(self) -> tuple[str, ...]:
        """The names of the locked groups."""
        return tuple(name for name, is_locked in zip(self.names, self.locked) if is_locked)


def armature_of(ob: bpy.types.Object) -> bpy.types.Object:
    """Returns the armature that a mesh object belongs to: with several, the first in the stack, whether or not it is
    the one with which Sinew begins. Raises ValueError if there is none."""
    found = bindable.armatures_of(ob)
    if not found:
        raise ValueError(f"{ob.name} has no armature: give it an Armature modifier, or parent it to an armature")
    return found[0]


def deforming(armature: bpy.types.Object) -> tuple[str, ...]:
    """Returns the names of the bones that deform, in the armature's order."""
    return tuple(bone.name for bone in armature.data.bones if bone.use_deform)


def why_not_writable(ob: bpy.types.Object) -> str:
    """Returns why the weights of a mesh object cannot be written, as a clause without its subject, or ""."""
    if ob.type != "MESH":
        return "is not a mesh; select one"
    if ob.sinew.copy_of is not None:
        return f"is the deformed copy of {ob.sinew.copy_of.name}; select that mesh instead"
    if ob.library is not None or ob.data.library is not None:
        return "is linked from another file; make its weights in that file"
    if ob.data.override_library is not None:
        return "has a mesh from another file (a library override); make its weights in that file"
    if ob.data.is_editmode:
        return "is in Edit Mode; leave it first"
    sharers = meshes.count_sharers(ob)
    if sharers > 1:
        return (
            f"shares its mesh with {reports.counted(sharers - 1, 'other object')}, whose weights would change too; "
            "make it single-user first (Object > Relations > Make Single User > Object & Data)"
        )
    return ""


def refuse(ob: bpy.types.Object) -> None:
    """Raises ValueError if the weights of an object cannot be edited."""
    why = why_not_writable(ob)
    if why:
        raise ValueError(f"{ob.name} {why}")
    if not len(ob.data.vertices):
        raise ValueError(f"{ob.name} has no vertices, so there are no weights to edit")


def own_positions(ob: bpy.types.Object) -> np.ndarray:
    """Returns the positions at rest in the object's space, (V, 3) float32. Raises ValueError if one is not finite."""
    positions = solid.rest_positions(ob.data)
    solid.refuse_infinite(ob, positions)
    return positions


def used_names(ob: bpy.types.Object, names: Iterable[str]) -> tuple[str, ...]:
    """Returns those of the bones' names in whose vertex groups any vertex has weight."""
    used = wiring.weighted_groups(ob)
    return tuple(name for name in names if name in used)


def in_groups(ob: bpy.types.Object) -> Entries:
    """Returns all weights of a mesh object, with vertex groups in place of bones, -1 for one that was removed."""
    return Entries.from_offsets(*meshes.read_object_weights(ob))


def read(ob: bpy.types.Object, names: Sequence[str]) -> Table:
    """Returns the weights of a mesh object in the groups of these names. A group that is not there has none."""
    entries = in_groups(ob)
    own = entries.renumbered(influences.columns_of_groups(ob.vertex_groups.keys(), names))
    locked = np.array([name in ob.vertex_groups and ob.vertex_groups[name].lock_weight for name in names], bool)
    return Table(tuple(names), own.table(len(ob.data.vertices), len(names)), locked, entries)


def held(table: Table, made: Any, free: np.ndarray | None = None) -> tuple[Any, np.ndarray]:
    """Returns what vertex groups will hold of new weights, both a sinew_native.WeightTable, and (V,) bool: the vertices
    that change, of those that are free, (V,) bool, or of all.

    Locked bones keep theirs, and the others share what these leave. Where fewer bones have the sum of many, a weight
    may be above 1: then all of the vertex are scaled, which moves it alike, unless locked ones would have to be."""
    made = _beside_locked(table, made)
    own, before, count = Entries.of(made), Entries.of(table.weights), made.vertex_count
    largest = np.ones(count)
    np.maximum.at(largest, own.vertices, own.weights)
    largest[before.vertices[table.locked[before.bones]]] = 1
    own = Entries(own.vertices, own.bones, np.minimum(own.times(1 / largest).weights, 1))
    both = (each.where(~table.locked[each.bones]).table(count, len(table.names)) for each in (own, before))
    changed = differ(*both)
    return own.table(count, len(table.names)), changed if free is None else changed & free


def _beside_locked(table: Table, made: Any) -> Any:
    """Returns new weights, a sinew_native.WeightTable, in which the locked bones keep theirs, and the others share what
    these leave of the sum. Where the others have got nothing to share, they keep the proportions that they had."""
    if not table.locked.any():
        return made
    count, before, after = made.vertex_count, Entries.of(table.weights), Entries.of(made)
    is_changed = differ(table.weights, made)
    unchanged, before = before.where(~is_changed[before.vertices]), before.where(is_changed[before.vertices])
    after = after.where(is_changed[after.vertices])
    kept, total = before.where(table.locked[before.bones]), after.sums(count)
    before, after = before.where(~table.locked[before.bones]), after.where(~table.locked[after.bones])
    has_got = after.sums(count) > 0
    share = after.joined(before.where(~has_got[before.vertices]))
    share = share.summing_to(np.clip(total - kept.sums(count), 0, None))
    return unchanged.joined(kept).joined(share).table(count, len(table.names))


def write(ob: bpy.types.Object, table: Table, made: Any, changed: np.ndarray) -> None:
    """Writes what `held` has returned: the weights of the vertices that change. Vertex groups are added for bones that
    have got weight. Locked groups stay."""
    own = Entries.of(made)
    own = own.where(changed[own.vertices] & ~table.locked[own.bones])
    is_written = np.array([name in ob.vertex_groups for name in table.names], bool)
    is_written[own.bones] = True
    written = np.flatnonzero(~table.locked & is_written)
    group_of = np.full(len(table.names), -1)
    group_of[written] = add_groups(ob, [table.names[column] for column in written])
    if changed.any():
        replace(ob, table.entries, own.renumbered(group_of), group_of[written], changed)


def replace(ob: bpy.types.Object, before: Entries, new: Entries, replaced: np.ndarray, changed: np.ndarray) -> Entries:
    """Replaces the weights of a mesh object in some vertex groups, at the vertices that change, (V,) bool. What else it
    has stays, with its order. before: `in_groups`; new: with vertex groups in place of bones; replaced: numbers of the
    groups. Returns all that it then has."""
    is_replaced = np.zeros(len(ob.vertex_groups) + 1, bool)
    is_replaced[replaced] = True
    kept = before.where((before.bones >= 0) & ~(is_replaced[before.bones] & changed[before.vertices]))
    both = kept.joined(new)
    # By size where a vertex has changed, otherwise as it was.
    place = np.where(changed[both.vertices], -both.weights.astype(np.float64), np.arange(len(both.vertices)))
    both = both.where(np.lexsort((both.bones, place, both.vertices)))
    weight_writing.replace(ob, both.offsets(len(changed)), both.bones, both.weights)
    return both


def add_groups(ob: bpy.types.Object, names: Sequence[str]) -> np.ndarray:
    """Adds the vertex groups of these names that the object lacks; with a Mirror modifier those of the other side, too,
    since it gives weights of a group to the other half only if there is one. Returns the index of each, (names,)
    int."""
    active = ob.vertex_groups.active_index if len(ob.vertex_groups) else 0
    there = {group.name: group.index for group in ob.vertex_groups}
    is_mirrored = any(each.type == "MIRROR" and each.use_mirror_vertex_groups for each in ob.modifiers)
    for name in [*names, *(map(bpy.utils.flip_name, names) if is_mirrored else ())]:
        if name not in there:
            there[name] = ob.vertex_groups.new(name=name).index
    ob.vertex_groups.active_index = active
    return np.array([there[name] for name in names], int)
