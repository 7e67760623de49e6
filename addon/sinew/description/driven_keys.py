"""Values of shape keys that a rig drives, as if they were properties of the rig."""

from collections.abc import Iterator, Sequence
from itertools import chain, count
from typing import Any

import bpy

from ..blender import spoken_paths
from . import curves, driver_rows, targets

Keyed = tuple[bpy.types.Key, tuple[int, ...]]  # numbers of its keys


def paths_of(keyed: Sequence[Keyed]) -> list[list[str]]:
    """Returns of each data-block the paths of its values in the description."""
    number = count()
    return [[f"key_values[{next(number)}]" for _ in numbers] for _keys, numbers in keyed]


def rows_of(
    keyed: Sequence[Keyed], found: targets.Targets, outside: driver_rows.Outside
) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Yields the property and the driver of each value. What cannot be said is added to `found.refused`."""
    chosen = [(keys, keys.key_blocks[i]) for keys, numbers in keyed for i in numbers]
    for path, (keys, key) in zip(chain(*paths_of(keyed)), chosen):
        limits = {"min": key.slider_min, "max": key.slider_max}
        curve = keys.animation_data.drivers.find(key.path_from_id("value"))
        try:
            if curve is None or curve.mute or not curve.is_valid or not curve.driver.is_valid:
                raise curves.Refused("it is muted or not valid: mend or delete it")
            driver = driver_rows.driver_elsewhere(path, 0, curve, found, outside)
            yield {"path": path, "type": "FLOAT", **limits, "value": [key.value]}, driver
        except curves.Refused as reason:
            found.refused.append(
                f"the driver of {spoken_paths.spoken(key.path_from_id('value'))} of {keys.name}: {reason}"
            )
