"""Draws ghosts into the 3D view. What is drawn is decided in `drawings`; the rest is the graphics card's."""

from typing import Any, NamedTuple

import bpy
import gpu
from mathutils import Matrix

from ..blender.drawn import Drawn
from ..main import addon_preferences
from . import ghosts

FADING = 0.6  # share of the opacity that the farthest ghost loses
MOST_SPARE = 64  # batches that are kept though they are not shown
_VERTEX = """
void main()
{
  viewed = turned * pos;
  gl_Position = whole * vec4(pos, 1.0);
}
"""
# The normal of a triangle, from how its position changes between pixels: so no normals are stored.
_FRAGMENT = """
void main()
{
  vec3 normal = normalize(cross(dFdx(viewed), dFdy(viewed)));
  float facing = abs(normal.z);
  result = vec4(color.rgb * (0.45 + 0.55 * facing), color.a);
}
"""
_shader: Any = None
_batches: dict[tuple[int, int], tuple[ghosts.Shape, Any]] = {}  # (shape, its batch), by key of the ghost
_triangles: dict[int, tuple[ghosts.Topology, Any]] = {}  # (topology, its triangles), by key of the mesh object


class Drawing(NamedTuple):
    """One ghost, and its color with the opacity."""

    ghost: ghosts.Ghost
    color: tuple[float, float, float, float]


def drawings(context: bpy.types.Context) -> list[Drawing]:
    """Returns what is drawn in a 3D view, the ghosts that are farthest from the current frame first."""
    settings = addon_preferences.of_sinew(context).onion
    space = context.space_data
    shown = [ob for ob in context.view_layer.objects if ob.type == "MESH" and ob.visible_get()]
    if isinstance(space, bpy.types.SpaceView3D):
        shown = [ob for ob in shown if ob.visible_in_viewport_get(space)]
    found = ghosts.around(context.scene, settings.before, settings.after, settings.step, shown)
    return [Drawing(each, _color(settings, each.steps)) for each in found]


def _color(settings: Any, steps: int) -> tuple[float, float, float, float]:
    """Returns the color of a ghost so many steps before (negative) or after the current frame."""
    most = settings.before if steps < 0 else settings.after
    color = settings.color_before if steps < 0 else settings.color_after
    return (*color, settings.opacity * (1 - FADING * (abs(steps) - 1) / max(most - 1, 1)))


def start() -> None:
    """Draws ghosts from now on, wherever there are any."""
    if not bpy.app.background:
        _drawn.show()


def stop() -> None:
    _drawn.hide()
    _batches.clear()
    _triangles.clear()


def _draw() -> None:
    context = bpy.context
    if not context.space_data.overlay.show_overlays or not ghosts.shown():
        forget_all_but([])
        return
    drawn = drawings(context)
    view = context.region_data
    shader = _shader_of_ghosts()
    shader.bind()
    # First the depth of a ghost, then its color: whatever of it is behind itself is not seen through it.
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(True)
    gpu.state.blend_set("ALPHA")
    for ghost, color in drawn:
        batch = _batch(ghost)
        placed = view.view_matrix @ Matrix(ghost.shape.matrix.tolist())
        shader.uniform_float("whole", view.window_matrix @ placed)
        shader.uniform_float("turned", placed.to_3x3())
        shader.uniform_float("color", color)
        for has_color in (False, True):
            gpu.state.color_mask_set(*4 * (has_color,))
            batch.draw(shader)
    gpu.state.color_mask_set(True, True, True, True)
    gpu.state.blend_set("NONE")
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set("NONE")
    forget_all_but(drawn)


def forget_all_but(drawn: list[Drawing]) -> None:
    """Discards batches that cannot be shown any more, and others that are not shown once there are too many: the next
    frames show some of them again, and another view may show others."""
    keys = {each.ghost.key for each in drawn}
    for key, (shape, _batch) in list(_batches.items()):
        if not ghosts.is_kept(key, shape):
            del _batches[key]
    for key in list(_batches.keys() - keys)[: max(len(_batches) - MOST_SPARE - len(keys), 0)]:
        del _batches[key]
    for mesh in _triangles.keys() - {mesh for mesh, _frame in _batches}:
        del _triangles[mesh]


def _batch(ghost: ghosts.Ghost) -> Any:
    """Returns the batch of a ghost, which is made once for each shape."""
    known = _batches.get(ghost.key)
    if known is None or known[0] is not ghost.shape:
        layout = gpu.types.GPUVertFormat()
        layout.attr_add(id="pos", comp_type="F32", len=3, fetch_mode="FLOAT")
        vertices = gpu.types.GPUVertBuf(layout, len(ghost.shape.positions))
        vertices.attr_fill("pos", ghost.shape.positions)
        batch = gpu.types.GPUBatch(type="TRIS", buf=vertices, elem=_index(ghost.key[0], ghost.shape.topology))
        known = _batches[ghost.key] = ghost.shape, batch
    return known[1]


def _index(key: int, topology: ghosts.Topology) -> Any:
    """Returns the triangles of a mesh on the graphics card, which all its ghosts share."""
    known = _triangles.get(key)
    if known is None or known[0] is not topology:
        known = _triangles[key] = topology, gpu.types.GPUIndexBuf(type="TRIS", seq=topology.triangles)
    return known[1]


def _shader_of_ghosts() -> Any:
    global _shader
    if _shader is None:
        passed = gpu.types.GPUStageInterfaceInfo("sinew_ghost")
        passed.smooth("VEC3", "viewed")
        info = gpu.types.GPUShaderCreateInfo()
        # Together at most 128 bytes: more are not fast everywhere.
        info.push_constant("MAT4", "whole")  # from the object to the picture
        info.push_constant("MAT3", "turned")  # from the object to the view, without translation
        info.push_constant("VEC4", "color")
        info.vertex_in(0, "VEC3", "pos")
        info.vertex_out(passed)
        info.fragment_out(0, "VEC4", "result")
        info.vertex_source(_VERTEX)
        info.fragment_source(_FRAGMENT)
        _shader = gpu.shader.create_from_info(info)
    return _shader


_drawn = Drawn(bpy.types.SpaceView3D, _draw)
