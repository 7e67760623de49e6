"""Operators that import and export rig folders."""

import os
from collections.abc import Callable
from typing import Any

import bpy
from bpy.props import CollectionProperty, StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ..feedback import progress
from ..rig_files import rig_export, rig_import
from ..rig_files.file_options import ANIMATION, POSE, WEIGHTS, ExportOptions, ImportOptions
from . import available, option_properties


def files_beside(suffix: str, *others: str) -> Callable[..., list[str]]:
    """Returns the search of a property of ImportRig: it suggests files of the chosen folder, except those with the
    usual names of something else (others), or that another property names."""

    def search(operator, context, edit_text):
        folder = operator.directory or os.path.dirname(operator.filepath)
        params = getattr(context.space_data, "params", None)  # of the file browser
        if params is not None:
            folder = os.fsdecode(params.directory)
        named = {operator.mesh, operator.weights, operator.pose} - {edit_text}
        names = os.listdir(folder) if os.path.isdir(folder) else []
        return sorted(
            name
            for name in names
            if name.endswith(suffix) and edit_text.lower() in name.lower() and name not in {*others, *named}
        )

    return search


def _file(name: str, suffix: str, *others: str) -> Any:
    """Returns a property of ImportRig, the name of a file."""
    search = {"search": files_beside(suffix, *others), "search_options": {"SUGGESTION"}}
    return option_properties.one(ImportOptions, name, **search)


WHEN_EMPTY = {"placeholder": "automatic"} if bpy.app.version >= (4, 1, 0) else {}  # what an empty field says


@option_properties.added(ImportOptions)
class ImportRig(available.Reports, bpy.types.Operator, ImportHelper):
    """Import rig folders: mesh, skeleton, weights and poses"""

    bl_idname = "import_scene.sinew_rig"
    bl_label = "Import Sinew Rig"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    filename_ext = ".bf"
    filter_glob: StringProperty(default="*.bf;*.tgf", options={"HIDDEN"})
    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"})
    mesh: _file("mesh", ".obj")
    weights: _file("weights", ".dmat", POSE, ANIMATION)
    pose: _file("pose", ".dmat", WEIGHTS, ANIMATION)

    def invoke(self, context, event):
        if self.files and self.directory:  # dropped: the files are known, so ask only for the options
            if bpy.app.background:
                return self.execute(context)
            return context.window_manager.invoke_props_dialog(self, width=360)
        return ImportHelper.invoke(self, context, event)

    def draw(self, _context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        for label, names in (
            ("Files", ("mesh", "weights", "pose")),
            ("Conversion", ("convention", "quaternion_order", "up_axis", "scale")),
            ("Animation", ("source", "frame_rate", "set_frame_range")),
            ("Deformation", ("method", "output")),
        ):
            box = self.layout.box().column()
            box.label(text=label)
            for name in names:
                box.prop(self, name, **(WHEN_EMPTY if label == "Files" else {}))

    def paths(self) -> list[str]:
        """Returns the chosen paths: one or more that were selected in the file browser or dropped, or one from a
        script."""
        chosen = [os.path.join(self.directory, file.name) for file in self.files if file.name]
        return chosen if chosen and self.directory else [self.filepath]

    def run(self, context):
        paths = self.paths()
        if not all(map(os.path.basename, paths)):
            raise ValueError("Choose a skeleton file (.bf or .tgf)")
        if context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        imported, problems, chosen = [], [], option_properties.read(self, ImportOptions)
        with progress.shown(context) as shown:
            for number, path in enumerate(paths):
                part = progress.Part(shown, number, len(paths))
                try:
                    *objects, remark = rig_import.import_rig(context, path, chosen, part)
                    imported.append(objects)
                    problems += [remark] if remark else []
                except (ValueError, OSError, MemoryError) as error:
                    problems.append(str(error) or "There is not enough memory")
        for problem in problems:
            self.report({"WARNING" if imported else "ERROR"}, problem)
        if not imported:
            return {"CANCELLED"}
        for ob in [ob for rig in imported for ob in rig]:
            ob.select_set(True)
        meshes = [ob for ob, _armature in imported]
        vertices = sum(len(ob.data.vertices) for ob in meshes)
        self.report({"INFO"}, f"Imported {', '.join(ob.name for ob in meshes)}: {vertices:,} vertices")


@option_properties.added(ExportOptions)
class ExportRig(available.Explains, bpy.types.Operator, ExportHelper):
    """Write the active mesh, its skeleton, weights and poses as a rig folder"""

    bl_idname = "export_scene.sinew_rig"
    bl_label = "Export Sinew Rig"
    bl_options = {"PRESET"}

    filename_ext = ".bf"
    check_extension = None  # .tgf is accepted too
    filter_glob: StringProperty(default="*.bf;*.tgf", options={"HIDDEN"})

    @classmethod
    def why_not(cls, context):
        return available.no_mesh(context.active_object)

    def run(self, context):
        path = self.filepath
        if os.path.isdir(path):
            path = os.path.join(path, "skeleton.bf")
        with progress.shown(context) as shown:
            chosen = option_properties.read(self, ExportOptions)
            rig_export.export_rig(context, context.active_object, path, chosen, shown)
        self.report({"INFO"}, f"Exported {context.active_object.name} to {os.path.dirname(path)}")


CLASSES = (ImportRig, ExportRig)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
