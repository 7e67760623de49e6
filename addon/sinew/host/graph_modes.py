"""Tells whether an evaluated data-block is in a dependency graph for renders or in one for a viewport.

Its data-block leads to the graph, whose struct is not in Blender's description. Where the mode is in it is found, and
compared, in a graph that Blender's API shows: it follows the addresses of the graph's scene and view layer.
"""

import ctypes
from typing import Any

from . import contract, layout

_MOST_WORDS_OF_RUNTIME = 5  # in which the address of the graph is searched
_MOST_WORDS_OF_GRAPH = 90  # in which its scene is searched; its struct is longer
_MODES = ["VIEWPORT", "RENDER"]  # by their numbers
# The byte offset in a data-block of what leads to its graph, whether that is a pointer, the offset from there, and the
# offset of the mode in the graph. None: not known.
_place: tuple[int, bool, int, int] | None = None


def is_render(block: Any) -> bool | None:
    """Whether an evaluated data-block belongs to a graph for renders. None: not known."""
    if _place is None or contract.is_broken():
        return None
    graph = _graph_of(block, *_place[:3])
    mode = ctypes.c_int32.from_address(graph + _place[3]).value if graph else -1
    return mode == 1 if mode in {0, 1} else None


def is_known() -> bool:
    """Whether graphs for renders can be told from those for a viewport."""
    return _place is not None


def learn(graph: Any) -> bool:
    """Finds where the mode is, in a graph that has been evaluated. Call it in the main thread. Returns whether it is
    known since this call. If it was known, but is wrong for this graph, it is not used any more."""
    global _place
    if contract.is_broken() or graph.mode not in _MODES:
        return False
    if _place is not None:
        if is_render(graph.scene_eval) is not (graph.mode == "RENDER"):
            _place = None
            _given_up.append(graph.mode)
        return False
    if _given_up or contract.trouble():
        return False
    found = _find(graph)
    if found is None:
        _given_up.append(graph.mode)  # as before 4.0, where no data-block leads to its graph
    _place = found
    return found is not None


_given_up: list[str] = []  # the mode of the graph in which it was not found


def _find(graph: Any) -> tuple[int, bool, int, int] | None:
    mode_at = _find_mode(graph)
    members = layout.structs()["ID"].members
    if mode_at is None or not {"runtime", "*runtime"} & members.keys():
        return None
    is_pointer = "*runtime" in members
    offset, _type, size = members["*runtime" if is_pointer else "runtime"]
    words = _MOST_WORDS_OF_RUNTIME if is_pointer else size // layout.POINTER
    for number in range(words):
        place = offset, is_pointer, number * layout.POINTER
        if _graph_of(graph.scene_eval, *place) == graph.as_pointer():
            return *place, mode_at
    return None


def _graph_of(block: Any, offset: int, is_pointer: bool, from_there: int) -> int:
    start = block.as_pointer() + offset
    if is_pointer:
        start = contract.address_at(start)
    return contract.address_at(start + from_there) if start else 0


def _find_mode(graph: Any) -> int | None:
    """Returns the offset in a graph of its mode: behind the addresses of its scene and view layer."""
    start, wanted = graph.as_pointer(), [graph.scene.as_pointer(), graph.view_layer.as_pointer()]
    for number in range(_MOST_WORDS_OF_GRAPH - 3):
        offset = number * layout.POINTER
        if [contract.address_at(start + offset + each) for each in (0, layout.POINTER)] == wanted:
            mode_at = offset + 2 * layout.POINTER
            mode = ctypes.c_int32.from_address(start + mode_at).value
            return mode_at if mode == _MODES.index(graph.mode) else None
    return None
