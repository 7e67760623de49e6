"""Marks in the timeline which frames of characters are recorded: a thin strip under the frame numbers for each."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import bpy
import gpu
from gpu_extras.batch import batch_for_shader

from ..blender.drawn import Drawn
from ..played import rigs
from . import played_rigs

MOST_STRIPS = 8
RULER, HEIGHT, GAP = 23, 3, 1  # of the frame numbers, of a strip, between two: pixels at 100 % interface scale
FROZEN, LIVE = (0.35, 0.75, 1.0, 0.9), (0.55, 0.6, 0.65, 0.7)


class Bar(NamedTuple):
    """A run of recorded frames, in pixels of the region."""

    left: float
    bottom: float
    right: float
    top: float
    color: tuple[float, float, float, float]


def marked(context: bpy.types.Context) -> list[rigs.Rig]:
    """Returns the characters with a strip: those that are frozen or were, and the selected ones."""
    selected = played_rigs.chosen(context)
    found = [rig for rig in rigs.known() if len(rig.record) and (rig.is_wanted or rig.ob in selected)]
    return sorted(found, key=lambda rig: rig.name)[:MOST_STRIPS]


def bars(shown: Iterable[rigs.Rig], place: Callable[[float], float], height: float, scale: float) -> list[Bar]:
    """Returns what is drawn. place: the pixel of a frame; height: of the region; scale: of the interface."""
    shown = list(shown)
    # Under the frame numbers, or over the lower border of a timeline that shows nothing else.
    found, top = [], max(height - RULER * scale, len(shown) * (HEIGHT + GAP) * scale)
    for rig in shown:
        color = FROZEN if rig.is_idle else LIVE
        bottom = top - HEIGHT * scale
        found += [Bar(place(first - 0.5), bottom, place(last + 0.5), top, color) for first, last in rig.record.runs()]
        top = bottom - GAP * scale
    return found


def _draw() -> None:
    context = bpy.context
    shown = marked(context)
    if not shown:
        return
    region = context.region
    drawn = bars(
        shown,
        lambda frame: region.view2d.view_to_region(frame, 0, clip=False)[0],
        region.height,
        context.preferences.system.ui_scale,
    )
    shader = gpu.shader.from_builtin("2D_UNIFORM_COLOR" if bpy.app.version < (4, 0, 0) else "UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    for color in {bar.color for bar in drawn}:
        corners = [corner for bar in drawn if bar.color == color for corner in _triangles(bar)]
        shader.bind()
        shader.uniform_float("color", color)
        batch_for_shader(shader, "TRIS", {"pos": corners}).draw(shader)
    gpu.state.blend_set("NONE")


def _triangles(bar: Bar) -> list[tuple[float, float]]:
    left, bottom, right, top, _color = bar
    return [(left, bottom), (right, bottom), (right, top), (left, bottom), (right, top), (left, top)]


_strips = Drawn(bpy.types.SpaceDopeSheetEditor, _draw, "POST_PIXEL")


def register() -> None:
    if not bpy.app.background:
        _strips.show()


def unregister() -> None:
    _strips.hide()
