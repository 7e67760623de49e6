"""The weights of a mesh in the bones of its armature as a table with a column for each bone: read, and written in one
go. What is not in the table keeps its entries, with their order."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..blender import meshes, weight_writing
from ..native import sinew_native
from ..plan import bindable
from . import assigning, solid


@dataclass(frozen=True)
class Entries:
    """Weights above 0, in any order."""

    vertices: np.ndarray  # (N,) int
    bones: np.ndarray  # (N,) int
    weights: np.ndarray  # (N,)

    @classmethod
    def of(cls, weights: Any) -> "Entries":
        """Returns those of a sinew_native.WeightTable, vertex after vertex, by the bones."""
        counts = np.diff(weights.offsets)
        return cls(np.repeat(np.arange(len(counts)), counts), np.array(weights.bones), np.array(weights.weights, float))

    def where(self, chosen: np.ndarray) -> "Entries":
        """Returns the chosen ones, (N,) bool."""
        return Entries(self.vertices[chosen], self.bones[chosen], self.weights[chosen])

    def times(self, factors: np.ndarray) -> "Entries":
        """Returns all, multiplied by a factor for each vertex, (V,)."""
        return Entries(self.vertices, self.bones, self.weights * factors[self.vertices])

    def sums(self, vertex_count: int) -> np.ndarray:
        """Returns the sum of each vertex's weights, (V,)."""
        return np.bincount(self.vertices, self.weights, minlength=vertex_count)

    def joined(self, other: "Entries") -> "Entries":
        """Returns all of both."""
        pairs = ((self.vertices, other.vertices), (self.bones, other.bones), (self.weights, other.weights))
        return Entries(*map(np.concatenate, pairs))

    def table(self, vertex_count: int, bone_count: int) -> Any:
        """Returns a sinew_native.WeightTable."""
        order = np.argsort(self.vertices, kind="stable")
        offsets = np.concatenate(([0], np.cumsum(np.bincount(self.vertices, minlength=vertex_count))))
        return sinew_native.WeightTable(offsets, self.bones[order], self.weights[order], bone_count)


@dataclass(frozen=True)
class Table:
    """Weights of a mesh object."""

    names: tuple[str, ...]  # of the bones
    weights: Any  # a sinew_native.WeightTable, V x B; a vertex that is twice in a group has the sum
    locked: np.ndarray  # (B,) bool: the groups that stay
    entries: tuple[np.ndarray, np.ndarray, np.ndarray]  # offsets, groups, weights, as read_object_weights returns them

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


def refuse(ob: bpy.types.Object) -> None:
    """Raises ValueError if the weights of an object cannot be edited."""
    why = assigning.why_not_writable(ob)
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
    _offsets, groups, weights = meshes.read_object_weights(ob)
    used = np.unique(groups[weights > 0]).tolist()
    own = {ob.vertex_groups[group].name for group in used if group >= 0}
    return tuple(name for name in names if name in own)


def read(ob: bpy.types.Object, names: Sequence[str]) -> Table:
    """Returns the weights of a mesh object in the groups of these names. A group that is not there has none."""
    entries = meshes.read_object_weights(ob)
    offsets, groups, weights = entries
    columns = {name: column for column, name in enumerate(names)}
    of_group = np.array([columns.get(group.name, -1) for group in ob.vertex_groups] + [-1], int)
    column = of_group[groups]
    own = Entries(np.repeat(np.arange(len(offsets) - 1), np.diff(offsets)), column, weights).where(column >= 0)
    locked = np.array([name in ob.vertex_groups and ob.vertex_groups[name].lock_weight for name in names], bool)
    return Table(tuple(names), own.table(len(offsets) - 1, len(names)), locked, entries)


def differ(one: Any, other: Any) -> np.ndarray:
    """Returns (V,) bool: the vertices whose weights differ between two of sinew_native.WeightTable."""
    counts = np.diff(one.offsets)
    result = counts != np.diff(other.offsets)
    own, others = (each.where(~result[each.vertices]) for each in (Entries.of(one), Entries.of(other)))
    result[own.vertices[(own.bones != others.bones) | (own.weights != others.weights)]] = True
    return result


def beside_locked(table: Table, made: Any) -> Any:
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
    sums = share.sums(count)
    share = share.times(np.clip(total - kept.sums(count), 0, None) / np.where(sums > 0, sums, 1))
    return unchanged.joined(kept).joined(share).table(count, len(table.names))


def _within_1(table: Table, made: Any) -> Entries:
    """Returns weights that vertex groups can hold. Where fewer bones have the sum of many, a weight may be above 1:
    then all of the vertex are scaled, which moves it alike, unless locked ones would have to be."""
    own, before = Entries.of(made), Entries.of(table.weights)
    largest = np.ones(made.vertex_count)
    np.maximum.at(largest, own.vertices, own.weights)
    largest[before.vertices[table.locked[before.bones]]] = 1
    return Entries(own.vertices, own.bones, np.clip(own.times(1 / largest).weights, 0, 1).astype(np.float32))


def write(ob: bpy.types.Object, table: Table, made: Any, free: np.ndarray | None = None) -> np.ndarray:
    """Writes new weights, a sinew_native.WeightTable, of the vertices that are free, (V,) bool, or of all; vertex
    groups are added for bones that have got weight. Locked groups stay. Returns (V,) bool: the vertices that have
    changed."""
    own = _within_1(table, made)
    own, before = (each.where(~table.locked[each.bones]) for each in (own, Entries.of(table.weights)))
    changed = differ(*(each.table(made.vertex_count, len(table.names)) for each in (own, before)))
    if free is not None:
        changed &= free
    if not changed.any():
        return changed
    own = own.where(changed[own.vertices] & (own.weights > 0))
    is_written = np.array([name in ob.vertex_groups for name in table.names], bool)
    is_written[own.bones] = True
    written = np.flatnonzero(~table.locked & is_written)
    group_of = np.full(len(table.names), -1)
    group_of[written] = assigning.add_groups(ob, [table.names[column] for column in written])

    offsets, groups, weights = table.entries
    is_replaced = np.zeros(len(ob.vertex_groups) + 1, bool)
    is_replaced[group_of[written]] = True
    vertices = np.repeat(np.arange(len(changed)), np.diff(offsets))
    kept = (groups >= 0) & ~(is_replaced[groups] & changed[vertices])
    both = (
        Entries(vertices, groups, weights).where(kept).joined(Entries(own.vertices, group_of[own.bones], own.weights))
    )
    # By size where a vertex has changed, otherwise as it was.
    place = np.where(changed[both.vertices], -both.weights.astype(np.float64), np.arange(len(both.vertices)))
    order = np.lexsort((both.bones, place, both.vertices))
    counts = np.bincount(both.vertices, minlength=len(changed))
    weight_writing.replace(ob, np.concatenate(([0], np.cumsum(counts))), both.bones[order], both.weights[order])
    return changed
