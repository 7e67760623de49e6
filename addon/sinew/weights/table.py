"""The weights of a mesh in the bones of its armature as a table with a column for each bone: read, and written in one
go. What is not in the table keeps its entries, with their order."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..blender import meshes, weight_writing
from ..plan import bindable
from . import assigning, solid


@dataclass(frozen=True)
class Table:
    """Weights of a mesh object."""

    names: tuple[str, ...]  # of the bones
    weights: np.ndarray  # (V, B) float32, 0 or more; a vertex that is twice in a group has the sum
    locked: np.ndarray  # (B,) bool: the groups that stay
    entries: tuple[np.ndarray, np.ndarray, np.ndarray]  # offsets, groups, weights, as read_object_weights returns them

    @property
    def locked_names(self) -> tuple[str, ...]:
        """The names of the locked groups."""
        return tuple(name for name, is_locked in zip(self.names, self.locked) if is_locked)


def armature_of(ob: bpy.types.Object) -> bpy.types.Object:
    """Returns the armature that a mesh object belongs to. Raises ValueError if there is none."""
    armature = bindable.find_armature(ob)
    if armature is None:
        raise ValueError(f"{ob.name} has no armature: give it an Armature modifier, or parent it to an armature")
    return armature


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
    vertices = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    column = of_group[groups]
    used = column >= 0
    dense = np.zeros((len(offsets) - 1, len(names)), np.float32)
    np.add.at(dense, (vertices[used], column[used]), weights[used])
    locked = np.array([name in ob.vertex_groups and ob.vertex_groups[name].lock_weight for name in names], bool)
    return Table(tuple(names), dense, locked, entries)


def beside_locked(table: Table, made: np.ndarray) -> np.ndarray:
    """Returns new weights (V, B) in which the locked bones keep theirs, and the others share what these leave of the
    sum. Where the others have got nothing to share, they keep the proportions that they had."""
    locked = table.locked
    if not locked.any():
        return made
    result, kept = made.copy(), table.weights[:, locked]
    result[:, locked] = kept
    room = np.clip(made.sum(axis=1) - kept.sum(axis=1), 0, None)
    share = np.where((made[:, ~locked].sum(axis=1) > 0)[:, None], made[:, ~locked], table.weights[:, ~locked])
    sums = share.sum(axis=1)
    result[:, ~locked] = share * (room / np.where(sums > 0, sums, 1))[:, None]
    is_same = (made == table.weights).all(axis=1)
    result[is_same] = made[is_same]
    return result


def _within_1(table: Table, made: np.ndarray) -> np.ndarray:
    """Returns weights (V, B) that vertex groups can hold. Where fewer bones have the sum of many, a weight may be above
    1: then all of the vertex are scaled, which moves it alike, unless locked ones would have to be."""
    largest = np.maximum(made.max(axis=1, initial=0), 1)
    largest[(table.weights[:, table.locked] > 0).any(axis=1)] = 1
    return np.clip(made / largest[:, None], 0, 1)


def write(ob: bpy.types.Object, table: Table, made: np.ndarray, free: np.ndarray | None = None) -> np.ndarray:
    """Writes new weights (V, B) of the vertices that are free, (V,) bool, or of all; vertex groups are added for bones
    that have got weight. Locked groups stay. Returns (V,) bool: the vertices that have changed."""
    own = np.where(table.locked, table.weights, _within_1(table, made).astype(np.float32))
    changed = (own != table.weights).any(axis=1)
    if free is not None:
        changed &= free
    if not changed.any():
        return changed
    own[~changed] = 0
    has_weight = (own > 0).any(axis=0)
    there = np.array([name in ob.vertex_groups for name in table.names], bool)
    written = np.flatnonzero(~table.locked & (has_weight | there))
    groups_of = assigning.add_groups(ob, [table.names[column] for column in written])

    offsets, groups, weights = table.entries
    is_replaced = np.zeros(len(ob.vertex_groups) + 1, bool)
    is_replaced[groups_of] = True
    vertices = np.repeat(np.arange(len(changed)), np.diff(offsets))
    kept = (groups >= 0) & ~(is_replaced[groups] & changed[vertices])
    rows, columns = np.nonzero(own[:, written])
    all_vertices = np.concatenate((vertices[kept], rows))
    all_groups = np.concatenate((groups[kept], groups_of[columns]))
    all_weights = np.concatenate((weights[kept], own[rows, written[columns]]))
    # By size where a vertex has changed, otherwise as it was.
    place = np.where(changed[all_vertices], -all_weights.astype(np.float64), np.arange(len(all_vertices)))
    order = np.lexsort((all_groups, place, all_vertices))
    counts = np.bincount(all_vertices, minlength=len(changed))
    weight_writing.replace(ob, np.concatenate(([0], np.cumsum(counts))), all_groups[order], all_weights[order])
    return changed
