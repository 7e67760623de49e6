"""What keyframes and drivers of a rig set besides the channels of its bones: custom properties, and the influence and
mute of constraints. While Blender does not evaluate the rig, they are written as Blender would.

Nothing here tags the original: Blender copies it only when somebody edits it."""

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import bpy

from ..blender import animation, spoken_paths
from ..description import curves, custom_properties, rna_paths
from ..host import bone_memory, poses

_OF_CONSTRAINT = re.compile(
    rf"(pose\.bones{spoken_paths.NAME}\.constraints{spoken_paths.NAME})\.({'|'.join(bone_memory.SETTERS)})$"
)


class Setting(NamedTuple):
    """A number or a switch."""

    path: str  # from the armature object
    owner: str  # the path of what has it, "" for the object
    name: str
    of_constraint: bool = False  # otherwise a custom property


def of(ob: Any, description: dict[str, Any]) -> tuple[list[Setting], bool]:
    """Returns what a rig sets, and whether its keyframes set nothing else that is not recorded. description: what was
    read of it (description/reading.py)."""
    single = {row["path"] for row in description["properties"] if len(row["value"]) == 1}
    constraints = {(row["bone"], row["name"]) for row in description["constraints"]}
    effective = curves.that_set_anything(ob, animation.keyed_curves(ob))
    keyed = {rna_paths.normalised(curve.data_path) for curve in effective}
    driven = {row["path"] for row in description["drivers"] if not row["path"].startswith("data.")}
    found, is_complete = [], True
    for path in sorted(keyed | driven):
        bone, match = rna_paths.BONE.match(path), _OF_CONSTRAINT.match(path)
        if path in single and path.endswith('"]'):
            found.append(Setting(path, *custom_properties.owner_and_name(path)))
        elif match is not None and bone_memory.can_set_constraints():
            owner, *names, name = match.groups()
            if tuple(map(bpy.utils.unescape_identifier, names)) in constraints:
                found.append(Setting(path, owner, name, True))
        elif rna_paths.moves_object(path):  # it stays, or is in Source.place
            continue
        elif path in keyed and (bone is None or path[bone.end() + 1 :] not in poses.RECORDED):
            is_complete = False
    return found, is_complete


def read(ob: Any, settings: Sequence[Setting]) -> tuple[float, ...]:
    """Returns the values of an armature object."""
    return tuple(float(ob.path_resolve(each.path)) for each in settings)


def write(ob: Any, settings: Sequence[Setting], values: Sequence[float], before: Sequence[float] | None) -> None:
    """Writes values into an armature object, original or evaluated. before: those that were written last, or None."""
    for number, (setting, value) in enumerate(zip(settings, values)):
        if before is not None and before[number] == value:
            continue
        owner = ob.path_resolve(setting.owner) if setting.owner else ob
        if setting.of_constraint:
            bone_memory.SETTERS[setting.name](owner, value)
        else:
            owner[setting.name] = type(owner[setting.name])(value)
