"""Replaces all weights of a mesh at once."""

import bpy
import numpy as np

from ..host import deform_verts


def replace(ob: bpy.types.Object, offsets: np.ndarray, groups: np.ndarray, weights: np.ndarray) -> None:
    """Replaces all weights of a mesh object, which is not in Edit Mode. offsets (V + 1,), groups (N,) and weights (N,):
    as `meshes.read_weights` returns them. A vertex is in a group at most once."""
    offsets, groups = np.ascontiguousarray(offsets, np.int64), np.ascontiguousarray(groups, np.int32)
    weights = np.ascontiguousarray(weights, np.float32)
    if deform_verts.can_write(ob.data):
        _make_room(ob, offsets)
    if not deform_verts.write(ob.data, offsets, groups, weights):
        _replace_by_api(ob, offsets, groups, weights)
    ob.data.update_tag()


def _make_room(ob, offsets):
    """Gives each vertex as many entries as it needs, with any content. Blender's API cannot write the weights of many
    vertices at once, but it adds many vertices to a group, or removes them, and only Blender can allocate entries."""
    address = deform_verts.deform_vertices(ob.data)
    before, old = np.zeros(len(offsets), np.int64), np.empty(0, np.int32)
    if address:
        before, old, _ = deform_verts.read(address, len(offsets) - 1)
    had, needed = np.diff(before), np.diff(offsets)
    own_groups = len(ob.vertex_groups)
    surplus = _rank(before) >= np.repeat(needed, had)
    surplus |= old >= own_groups  # of removed groups
    vertices = np.repeat(np.arange(len(had)), had)
    for group, members in _by_group(old[surplus], vertices[surplus]):
        if group < own_groups:
            ob.vertex_groups[group].remove(members)
    kept = ~surplus
    has = np.bincount(vertices[kept], minlength=len(had))
    # The first groups in which the vertex is not yet: Blender searches its list of groups once for each vertex.
    of_new, candidates = np.repeat(np.arange(len(needed)), needed), _rank(offsets)
    is_new = ~np.isin(of_new * own_groups + candidates, vertices[kept] * own_groups + old[kept])
    lacks = is_new & (_rank_among(of_new, is_new) < (needed - has)[of_new])
    for group, members in _by_group(candidates[lacks], of_new[lacks]):
        ob.vertex_groups[group].add(members, 1.0, "REPLACE")


def _rank(offsets):
    """Returns (N,): the number of each entry within its vertex."""
    return np.arange(offsets[-1]) - np.repeat(offsets[:-1], np.diff(offsets))


def _rank_among(vertices, chosen):
    """Returns (N,): how many chosen entries of the same vertex come before each entry. vertices (N,) ascend."""
    before = np.cumsum(chosen) - chosen
    first = np.searchsorted(vertices, vertices)
    return before - before[first] if len(before) else before


def _by_group(groups, vertices):
    """Yields each group with a list of its vertices."""
    order = np.argsort(groups, kind="stable")
    sorted_groups, sorted_vertices = groups[order], vertices[order]
    names, starts = np.unique(sorted_groups, return_index=True)
    for name, members in zip(names.tolist(), np.split(sorted_vertices, starts[1:])):
        yield name, members.tolist()


def _replace_by_api(ob, offsets, groups, weights):
    every = list(range(len(ob.data.vertices)))
    for group in ob.vertex_groups:
        group.remove(every)
    vertices = np.repeat(np.arange(len(every)), np.diff(offsets))
    own = list(ob.vertex_groups)
    for vertex, group, weight in zip(vertices.tolist(), groups.tolist(), weights.tolist()):
        own[group].add((vertex,), weight, "REPLACE")
