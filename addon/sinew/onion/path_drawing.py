"""Draws the paths of the selected bones into the 3D view, see onion/motion_paths.py."""

from typing import Any

import bpy
import gpu
from gpu_extras.batch import batch_for_shader

from ..blender.drawn import Drawn
from ..main import addon_preferences
from . import motion_paths

LINE, POINT, NOW = 2.0, 5.0, 9.0  # widths, in pixels at 100 % interface scale
_shaders: dict[str, Any] = {}


def shown(context: bpy.types.Context) -> list[motion_paths.Path]:
    """Returns the paths that a 3D view shows."""
    settings = addon_preferences.of_sinew(context)
    if settings is None or not settings.onion.shows_paths or context.mode != "POSE":
        return []
    bones = [(bone.id_data, bone.name) for bone in context.selected_pose_bones or ()]
    return motion_paths.around(bones, context.scene.frame_current, settings.onion.path_frames)


def start() -> None:
    """Draws paths from now on, wherever there are any."""
    if not bpy.app.background:
        _drawn.show()


def stop() -> None:
    _drawn.hide()
    _shaders.clear()


def _draw() -> None:
    context = bpy.context
    found = shown(context) if context.space_data.overlay.show_overlays else []
    if not found:
        return
    settings: Any = addon_preferences.of_sinew(context)
    before, after = ((*color, 1.0) for color in (settings.onion.color_before, settings.onion.color_after))
    scale = context.preferences.system.ui_scale
    gpu.state.blend_set("ALPHA")
    for path in found:
        for points, color in ((path.points[: path.now + 1], before), (path.points[path.now :], after)):
            _draw_line(points, color, LINE * scale)
            _draw_points(points, color, POINT * scale)
        _draw_points(path.points[path.now : path.now + 1], (1.0, 1.0, 1.0, 1.0), NOW * scale)
    gpu.state.blend_set("NONE")


def _draw_line(points: Any, color: tuple[float, ...], width: float) -> None:
    shader = _shader("POLYLINE_UNIFORM_COLOR")
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", width)
    shader.uniform_float("color", color)
    batch_for_shader(shader, "LINE_STRIP", {"pos": points.tolist()}).draw(shader)


def _draw_points(points: Any, color: tuple[float, ...], size: float) -> None:
    shader = _shader("POINT_UNIFORM_COLOR", "UNIFORM_COLOR")
    shader.bind()
    shader.uniform_float("color", color)
    gpu.state.point_size_set(size)
    batch_for_shader(shader, "POINTS", {"pos": points.tolist()}).draw(shader)


def _shader(*names: str) -> Any:
    """Returns the first of Blender's shaders that this version has."""
    if names[0] not in _shaders:
        for name in names:
            try:
                _shaders[names[0]] = gpu.shader.from_builtin(name)
                break
            except ValueError:
                pass
    return _shaders[names[0]]


_drawn = Drawn(bpy.types.SpaceView3D, _draw)
