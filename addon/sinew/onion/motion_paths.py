"""The paths of the selected bones around the current frame, drawn into the 3D view. The programs of their rigs compute
them: nothing has to be played, and an edit that drops a program drops what it has computed."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..blender.drawn import Drawn
from ..main import addon_preferences
from ..played import leading, rigs

MOST_KEPT = 4000  # frames of a rig
LINE, POINT, NOW = 2.0, 5.0, 9.0  # widths, in pixels at 100 % interface scale
_shaders: dict[str, Any] = {}


class Path(NamedTuple):
    """Where the head of a bone is, frame by frame."""

    points: np.ndarray  # (F, 3) float32, in world space
    now: int  # which of them is the current frame


def around(bones: Iterable[tuple[Any, str]], frame: int, count: int) -> list[Path]:
    """Returns the paths of bones from `count` frames before a frame to `count` after it. bones: (original armature
    object, name); those of rigs that are not computed, or whose object has keyframes, have no path."""
    frames, found = list(range(frame - count, frame + count + 1)), []
    chosen: dict[Any, list[str]] = {}
    for ob, name in bones:
        chosen.setdefault(ob, []).append(name)
    for ob, names in chosen.items():
        rig = rigs.get(ob)
        if rig is None or not rig.is_idle or rig.source.program is None or rig.source.place:
            continue
        heads = _heads(rig, frames)
        if heads is None:
            continue
        numbers = {name: number for number, name in enumerate(rig.source.program.names)}
        matrix, every = np.array(ob.matrix_world, np.float32), np.stack([heads[each] for each in frames])
        for number in [numbers[name] for name in names if name in numbers]:
            found.append(Path(every[:, number] @ matrix[:3, :3].T + matrix[:3, 3], count))
    return found


def _heads(rig: rigs.Rig, frames: list[int]) -> dict[int, np.ndarray] | None:
    """Returns the heads of all bones, (B, 3) float32 in the armature's space, by frame; None if one cannot be
    computed."""
    known = rig.source.heads
    lacking = [each for each in frames if each not in known]
    if len(known) + len(lacking) > MOST_KEPT:
        known.clear()
        lacking = frames
    if lacking:
        try:
            poses = rig.source.program.evaluate(np.array(lacking, np.float32), leading.inputs(rig, lacking))
        except ValueError:  # a driver divides by 0, or it follows one that is not computed
            return None
        known.update(zip(lacking, poses[..., :3, 3].copy()))
    return known


def shown(context: bpy.types.Context) -> list[Path]:
    """Returns the paths that a 3D view shows."""
    settings = addon_preferences.of_sinew(context)
    if settings is None or not settings.onion.shows_paths or context.mode != "POSE":
        return []
    bones = [(bone.id_data, bone.name) for bone in context.selected_pose_bones or ()]
    return around(bones, context.scene.frame_current, settings.onion.path_frames)


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
