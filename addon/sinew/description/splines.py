"""Curves that Spline IK and Follow Path follow, as rows."""

import re
from collections.abc import Collection, Iterator
from typing import Any

import bpy

from ..blender import animation, spoken_paths
from . import curves, driver_rows, targets

_RADIUS = re.compile(r"splines\[0\]\.(?:bezier_points|points)\[(\d+)\]\.radius")
_KEY = re.compile(r"key_blocks\[.*\]\.value")
_KNOWN = re.compile(rf"{_RADIUS.pattern}|{_KEY.pattern}|splines\[(?:[1-9].*|.*\.(?:tilt|weight_softbody))|eval_time")
_OF_PATHS = re.compile(r"splines\[0\].*\.tilt|path_duration")  # what only Follow Path reads
_TIME = "eval_time"


def is_passed_over(constraint: Any) -> bool:
    """Whether Blender passes a constraint over, and leaves its bones to others: Spline IK without a curve."""
    return constraint.type == "SPLINE_IK" and not is_curve(constraint.target)


def is_curve(ob: bpy.types.Object | None) -> bool:
    return ob is not None and ob.type == "CURVE"


def check(ob: bpy.types.Object, kinds: Collection[str]) -> None:
    """Raises Refused if constraints along a curve object cannot be computed. kinds: their types."""
    data, own, is_path = ob.data, ob.data.splines, "FOLLOW_PATH" in kinds
    what = f"the curve {ob.name}"
    if ob.mode == "EDIT":
        raise curves.Refused(f"{what} is in Edit Mode: leave it")
    if not own:
        raise curves.Refused(f"{what} is empty: give it a spline")
    if data.dimensions != "3D" or len(_points_of(ob)) < 2:
        raise curves.Refused(f"{what} has one point alone or is not 3D, which is not covered")
    if own[0].type == "NURBS" and not _is_simple(own[0]):
        raise curves.Refused(
            f"{what} begins with NURBS that are closed with endpoints or of the kind Bezier but not both, or that have "
            "fewer points than their order, which is not covered: convert them to Bezier"
        )
    if own[0].use_cyclic_u and "SPLINE_IK" in kinds:
        raise curves.Refused(f"{what} is closed, which is not covered for Spline IK: open it")
    mappings = data.bevel_factor_mapping_start, data.bevel_factor_mapping_end
    if own[-1].resolution_u != own[0].resolution_u or any(each != "RESOLUTION" for each in mappings):
        raise curves.Refused(f"{what} has splines of several resolutions, or a bevel by segment or length")
    keys = data.shape_keys
    if keys is not None and (
        not keys.use_relative or ob.show_only_shape_key or any(each.vertex_group for each in keys.key_blocks)
    ):
        raise curves.Refused(f"{what} has absolute shape keys, one that is shown alone, or one with a vertex group")
    if is_path:
        _check_path(ob, what)
    for block, part in ((data, ""), (ob, "modifiers"), (keys, "")):
        if block is None:
            continue
        animated = (each for each in curves.curves_in_effect(block) if each.data_path.startswith(part))
        keyed = next((each for each in animated if (block, each.data_path) != (data, _TIME)), None)
        if keyed is not None:
            raise curves.Refused(f"{spoken_paths.spoken(keyed.data_path)} of {what} is keyed, which is not covered")
        for driver in animation.drivers_of(block):
            is_known = _KNOWN.fullmatch(driver.data_path) and not (is_path and _OF_PATHS.fullmatch(driver.data_path))
            if driver.data_path.startswith(part) and (block is ob or not is_known):
                raise curves.Refused(
                    f"{spoken_paths.spoken(driver.data_path)} of {what} has a driver, which is not covered"
                )
    _time_rows(ob)
    for modifier in _modifiers_of(ob):
        if modifier.type != "HOOK":
            raise curves.Refused(f"the modifier {modifier.name} of {what} is not covered: only hooks are")
        has_falloff = modifier.falloff_type != "NONE" and modifier.falloff_radius != 0
        if has_falloff or modifier.vertex_group or modifier.object is None:
            raise curves.Refused(f"the hook {modifier.name} of {what} has a falloff or a group, or no object")


def _is_simple(spline: bpy.types.Spline) -> bool:
    """Whether NURBS have knots at equal steps, except where they reach their ends, or are such as in circles."""
    is_circle = spline.use_cyclic_u and spline.use_endpoint_u
    return spline.use_bezier_u == is_circle and spline.order_u <= spline.point_count_u and spline.point_count_v == 1


def _check_path(ob: bpy.types.Object, what: str) -> None:
    """Raises Refused for what only Follow Path reads."""
    data = ob.data
    if data.twist_mode == "TANGENT" or int(data.splines[-1].resolution_u * data.twist_smooth):
        raise curves.Refused(f"{what} has the twist Tangent, or smooths it: choose Minimum, and 0 for Smooth")
    keys = [] if data.shape_keys is None else data.shape_keys.key_blocks
    count = len(_points_of(ob))
    tilts = {tuple(point.tilt for point in each.data[:count]) for each in keys}
    if len(tilts) > 1:
        raise curves.Refused(f"{what} has shape keys with different tilts, which is not covered")


def rows_of(found: targets.Targets) -> list[dict[str, Any]]:
    """Returns the rows of the splines that constraints follow. They have passed `check`. Raises Refused."""
    return [_row_of(ob, found) for ob in found.splines.values()]


def values_of(
    found: targets.Targets, outside: driver_rows.Outside
) -> Iterator[tuple[dict[str, Any], list[dict[str, Any]]]]:
    """Yields of each spline the property with its points' radii and those of its shape keys' values, and their drivers.
    What cannot be said is added to `found.refused`."""
    for curve in found.splines.values():
        points, keys = _points_of(curve), curve.data.shape_keys
        if keys is not None:  # radii are those of the keys
            points, driven = keys.key_blocks[0].data[: len(points)], {}
        else:
            by_path = ((_RADIUS.fullmatch(each.data_path), each) for each in animation.drivers_of(curve.data))
            driven = {int(match[1]): each for match, each in by_path if match}
        radii = [point.radius for point in points]
        limits = {"min": 0.0, "max": 3.4e38}
        yield _property(f"{_path_of(curve)}.radii", limits, radii, driven, found, outside)
        for number, key in _keys_of(curve):
            driver = animation.find_driver(keys, key.path_from_id("value"))
            limits = {"min": key.slider_min, "max": key.slider_max}
            driven = {0: driver} if driver is not None else {}
            yield _property(f"{_path_of(curve)}.key_values[{number}]", limits, [key.value], driven, found, outside)
        driver = animation.find_driver(curve.data, _TIME)
        driven = {0: driver} if driver is not None else {}
        time = 0.0 if _time_curves(curve) else curve.data.eval_time
        yield _property(_time_path(curve), {}, [time], driven, found, outside)


def curves_of(found: targets.Targets) -> list[dict[str, Any]]:
    """Returns the rows of the curves that say where on a spline is what follows it. They have passed `check`."""
    return [row for ob in found.splines.values() for row in _time_rows(ob)]


def _time_rows(ob: bpy.types.Object) -> list[dict[str, Any]]:
    own = _time_curves(ob)
    return [curves.animated(row | {"path": _time_path(ob)}, curve) for curve, row in zip(own, curves.rows_of(own))]


def _time_curves(ob: bpy.types.Object) -> list[bpy.types.FCurve]:
    return [each for each in curves.curves_in_effect(ob.data) if each.data_path == _TIME]


def _time_path(ob: bpy.types.Object) -> str:
    return f"{_path_of(ob)}.{_TIME}"


def _property(
    path: str,
    limits: dict[str, float],
    numbers: list[float],
    driven: dict[int, bpy.types.FCurve],
    found: targets.Targets,
    outside: driver_rows.Outside,
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """driven: drivers, by the place of what they set."""
    own = []
    for index, driver in driven.items():
        if driver.mute or not (driver.is_valid and driver.driver.is_valid):
            continue
        try:
            own.append(driver_rows.driver_elsewhere(path, index, driver, found, outside))
            numbers[index] = 0.0
        except curves.Refused as reason:
            found.refused.append(
                f"the driver of {spoken_paths.spoken(driver.data_path)} of {driver.id_data.name}: {reason}"
            )
    return {"path": path, "type": "FLOAT", **limits, "value": numbers}, own


def _path_of(ob: bpy.types.Object) -> str:
    return f'curves["{bpy.utils.escape_identifier(ob.name_full)}"]'


def _points_of(ob: bpy.types.Object) -> Any:
    spline = ob.data.splines[0]
    return spline.bezier_points if spline.type == "BEZIER" else spline.points


def _keys_of(ob: bpy.types.Object) -> list[tuple[int, bpy.types.ShapeKey]]:
    """Returns the shape keys that count, with their numbers."""
    keys = ob.data.shape_keys
    return [] if keys is None else [(i, each) for i, each in enumerate(keys.key_blocks) if i > 0 and not each.mute]


def _modifiers_of(ob: bpy.types.Object) -> list[bpy.types.Modifier]:
    return [each for each in ob.modifiers if each.show_viewport]


def _row_of(ob: bpy.types.Object, found: targets.Targets) -> dict[str, Any]:
    spline, points, keys = ob.data.splines[0], _points_of(ob), ob.data.shape_keys
    count, numbers = len(points), [number for number, _key in _keys_of(ob)]
    basis = points if keys is None else keys.key_blocks[0].data[:count]

    def key_row(number: int, key: Any) -> dict[str, Any]:
        relative = [*keys.key_blocks].index(key.relative_key)
        if relative and relative not in numbers:
            raise curves.Refused(f"the shape key {key.name} of the curve {ob.name} is relative to one that is muted")
        return {
            "value": f"{_path_of(ob)}.key_values[{number}]",
            "relative": numbers.index(relative) if relative else -1,
            "points": [[*_places_of(each), each.radius] for each in key.data[:count]],
        }

    return {
        "name": ob.name_full,
        "object": found.of(ob, ""),
        "type": spline.type,
        "order_u": spline.order_u,
        "use_endpoint_u": spline.use_endpoint_u,
        "use_cyclic_u": spline.use_cyclic_u,
        "resolution_u": spline.resolution_u,
        "radius_interpolation": spline.radius_interpolation,
        "radii": f"{_path_of(ob)}.radii",
        "tilt_interpolation": spline.tilt_interpolation,
        # What turns what follows it is only read of paths, of which the others are refused.
        "twist_mode": "Z_UP" if ob.data.twist_mode == "Z_UP" else "MINIMUM",
        "eval_time": _time_path(ob),
        "path_duration": ob.data.path_duration,
        "use_path_clamp": ob.data.use_path_clamp,
        "points": [_point_row(point, place) for point, place in zip(points, basis)],
        "has_shape_keys": keys is not None,
        "shape_keys": [key_row(number, key) for number, key in _keys_of(ob)],
        "hooks": [_hook_row(each, 3 * count, found) for each in _modifiers_of(ob)],
    }


def _places_of(point: Any) -> list[float]:
    """Returns left handle, point and right handle, of a spline or of a shape key."""
    is_bezier = hasattr(point, "handle_left")
    return [*point.handle_left, *point.co, *point.handle_right] if is_bezier else [*point.co[:3]] * 3


def _point_row(point: Any, place: Any) -> dict[str, Any]:
    """place: the point itself, or that of the Basis."""
    names = ("handle_left_type", "handle_right_type") if hasattr(point, "handle_left_type") else ()
    row = {"co": _places_of(place), "tilt": place.tilt} | {name: getattr(point, name) for name in names}
    return row if names else row | {"weight": point.co[3]}


def _hook_row(hook: Any, count: int, found: targets.Targets) -> dict[str, Any]:
    """count: of handles."""
    is_bezier = hook.id_data.data.splines[0].type == "BEZIER"
    handles = [i if is_bezier else 3 * i + 1 for i in hook.vertex_indices]
    return {
        "target": found.of(hook.object, hook.subtarget),
        "matrix_inverse": [[*row] for row in hook.matrix_inverse],
        "strength": hook.strength,
        "handles": [i for i in handles if i < count],
    }
