"""Adds Sinew's operators to Blender's menus, which F3 also searches, and handles files dropped on a view."""

from collections.abc import Callable
from typing import Any

import bpy

from . import bake, crowd, cures, method_settings, onion_skins, played_rigs, to_bones, weight_tools, weights
from .display import ToggleSkeleton, ToggleWeights
from .operators import Bind, ClipToKeyframes, MeasureFrames, Unbind
from .preferences import OpenManual
from .rig_files import ExportRig, ImportRig

RIG_FILES = "Sinew Rig (.bf/.tgf)"


class SinewMenu(bpy.types.Menu):
    """Operators of Sinew"""

    bl_idname = "VIEW3D_MT_sinew"
    bl_label = "Sinew"

    def draw(self, context):
        layout = self.layout
        layout.operator(Bind.bl_idname, icon="LINKED")
        layout.operator(Unbind.bl_idname, icon="UNLINKED")
        layout.operator(ClipToKeyframes.bl_idname, icon="KEYFRAME")
        layout.separator()
        layout.operator(ToggleWeights.bl_idname, icon="GROUP_VCOL")
        layout.operator(ToggleSkeleton.bl_idname, icon="ARMATURE_DATA")
        layout.operator(MeasureFrames.bl_idname, icon="TIME")
        layout.separator()
        applicable = [each for each in (*cures.CLASSES, *method_settings.CLASSES) if not each.why_not(context)]
        for operator in applicable:
            layout.operator(operator.bl_idname)
        if applicable:
            layout.separator()
        layout.operator(weights.ParentWithWeights.bl_idname, text="Parent with Sinew Weights", icon="BONE_DATA")
        layout.operator(weights.CheckWeights.bl_idname)
        for tool in weight_tools.CLASSES:
            layout.operator(tool.bl_idname)
        layout.separator()
        layout.operator(bake.Bake.bl_idname, icon="FILE_CACHE")
        layout.operator(bake.PlayCache.bl_idname)
        layout.operator(bake.TakeOffCache.bl_idname)
        to_bones.draw_operator(layout)
        layout.separator()
        layout.operator(played_rigs.Record.bl_idname, icon="REC")
        layout.operator(played_rigs.RecordOthers.bl_idname)
        layout.operator(played_rigs.LeaveToBlender.bl_idname)
        layout.operator(onion_skins.ToggleOnionSkins.bl_idname, icon="ONIONSKIN_ON")
        layout.separator()
        layout.operator(crowd.RenewCrowd.bl_idname, icon="COMMUNITY")
        layout.separator()
        layout.operator(OpenManual.bl_idname, icon="HELP")


def _entry(operator: Any, **how: Any) -> Callable[[Any, Any], None]:
    """Returns a function that draws an operator in a menu."""

    def draw(menu, _context):
        menu.layout.operator(operator.bl_idname, **how)

    return draw


def draw_submenu(menu: Any, _context: bpy.types.Context) -> None:
    menu.layout.separator()
    menu.layout.menu(SinewMenu.bl_idname)


PLACES = (
    ("TOPBAR_MT_file_import", _entry(ImportRig, text=RIG_FILES)),
    ("TOPBAR_MT_file_export", _entry(ExportRig, text=RIG_FILES)),
    ("VIEW3D_MT_add", _entry(crowd.AddCrowd, icon="COMMUNITY")),
    ("VIEW3D_MT_object", weight_tools.draw_object),
    ("VIEW3D_MT_object", draw_submenu),
    ("VIEW3D_MT_object", to_bones.draw_object),
    ("VIEW3D_MT_object_parent", weights.draw_parent),
    ("VIEW3D_MT_paint_weight", weights.draw_assign),
    ("VIEW3D_MT_paint_weight", weight_tools.draw_paint),
    ("VIEW3D_MT_pose", draw_submenu),
)
CLASSES = [SinewMenu]

if hasattr(bpy.types, "FileHandler"):  # 4.1 and later

    class DropRig(bpy.types.FileHandler):
        bl_idname = "IO_FH_sinew_rig"
        bl_label = "Sinew Rig"
        bl_import_operator = ImportRig.bl_idname
        bl_export_operator = ExportRig.bl_idname
        bl_file_extensions = ".bf;.tgf"

        @classmethod
        def poll_drop(cls, context):
            return context.area is None or context.area.type in {"VIEW_3D", "OUTLINER"}

    CLASSES.append(DropRig)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for name, draw in PLACES:
        getattr(bpy.types, name).append(draw)


def unregister() -> None:
    for name, draw in reversed(PLACES):
        getattr(bpy.types, name).remove(draw)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
