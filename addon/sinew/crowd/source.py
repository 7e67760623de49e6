"""The source of a crowd's shapes: a character of the scene, or a rig folder."""

from dataclasses import asdict, dataclass
from typing import Any

import bpy

from ..bake import evaluation
from ..plan import bindable
from ..rig_files.file_options import ImportOptions
from . import phases

PROPERTY = "sinew_crowd"  # custom property of the crowd's object: its Source


@dataclass
class Source:
    """The source of a crowd's shapes. character: the name of an object; or filepath: of a rig folder's skeleton, and
    pose: the name of its pose file, or "". count: number of shapes; 0: one per frame. first, last: frames; None: those
    of the clip."""

    character: str = ""
    filepath: str = ""
    pose: str = ""
    count: int = 0
    first: float | None = None
    last: float | None = None

    def keep(self, ob: bpy.types.Object) -> None:
        """Saves the source with the crowd's object."""
        ob[PROPERTY] = {name: value for name, value in asdict(self).items() if value is not None}

    def phases(self, context: bpy.types.Context, shown: Any) -> phases.Phases:
        """Returns phases.Phases. The scene does not change. Raises ValueError or OSError."""
        if self.filepath:
            path = bpy.path.abspath(self.filepath)
            return phases.of_rig(path, ImportOptions(pose=self.pose), self.count)
        ob = context.view_layer.objects.get(self.character)
        if ob is None:
            raise ValueError(f"there is no object {self.character} in the view layer {context.view_layer.name}")
        objects = meshes_of_character(context, ob)
        first, last = clip_range(context.scene, ob)
        first, last = (first if self.first is None else self.first), (last if self.last is None else self.last)
        if last < first:
            raise ValueError(f"the last frame ({last:g}) comes before the first ({first:g})")
        with evaluation.undisturbed(context):
            return phases.of_objects(context, objects, ob.name, first, last, self.count, shown)


def kept(ob: bpy.types.Object) -> Source | None:
    """Returns the Source of a crowd's object, or None."""
    found = ob.get(PROPERTY)
    return Source(**found.to_dict()) if found is not None else None


def meshes_of_character(context: bpy.types.Context, ob: bpy.types.Object) -> list[bpy.types.Object]:
    """Returns the visible meshes of the character that a mesh or an armature belongs to: those that the armature
    deforms, or that are parented to it. Raises ValueError."""
    armature = ob if ob.type == "ARMATURE" else bindable.find_armature(ob)
    found = [ob] if armature is None else [*bindable.meshes_of(context, armature), *armature.children_recursive]
    found = [each for each in dict.fromkeys(found) if each.type == "MESH" and each.visible_get()]
    if not found:
        raise ValueError(f"{ob.name} has no visible mesh: show the character first, or select another one")
    return found


def clip_range(scene: bpy.types.Scene, ob: bpy.types.Object) -> tuple[float, float]:
    """Returns first, last: the frames of the character's action, or else the scene's."""
    for each in ob if ob.type == "ARMATURE" else bindable.find_armature(ob), ob:
        data = each.animation_data if each is not None else None
        if data is not None and data.action is not None:
            return tuple(data.action.frame_range)
    return float(scene.frame_start), float(scene.frame_end)
